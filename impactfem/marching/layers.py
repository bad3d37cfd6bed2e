"""What a time scheme does inside the body in one layer; contact forces are added by the loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.pair_responses import Roots
from impactfem.contact.responses import Columns
from impactfem.contact.rooted import Matrix


@dataclass
class Sums:
    """Sums over the dofs this rank owns, of one layer; the loop adds those of all ranks up.

    Attributes:
        kinetic: Kinetic energy [J].
        elastic: Elastic energy [J], without that of contact for explicit schemes.
        work: Work of tractions, pressures and supports in the layer [J].
        momentum: [kg m/s], shape (dim,).
        first_moment: Mass times displacement [kg m], shape (dim,).
        angular_momentum: About the body's own centre of mass [kg m^2/s], (1,) or in space (3,).
        attitude: Of bodies that may turn far, sum of m x (X - c)^T [kg m^2], whose polar factor is
            the rotation, and sum of m a a^T with the arms from the present centre, (2 dim dim,);
            of others None: their spins sum up to their rotation.
        early: Energy of which steps know nothing from here on [J]: what conserves
            v M v / 2 + u_0 K u_1 / 2 after a half step at a_0 has dt^2 a_0 M a_0 / 8 less than the
            start.
    """

    kinetic: float
    elastic: float
    work: float
    momentum: Floats
    first_moment: Floats
    angular_momentum: Floats
    attitude: Floats | None = None
    early: float = 0.0


class Backward(NamedTuple):
    """Derivatives of a number by what a layer begins with, of owned dofs but for the forces.

    Attributes:
        place: By displacements at its start [1/m], (dofs,).
        rate: By velocities there, of explicit layers by the last step, (dofs,).
        forces: By contact forces that act in it [1/N], (count, dim), the same on all ranks.
        loads: By other forces that act in it [1/N], (dofs,).
        memory: By what solids that relax remember at its start [1/m], (terms, dofs).
    """

    place: Floats
    rate: Floats
    forces: Floats
    loads: Floats
    memory: Floats = np.zeros((0, 1))


class Ends(NamedTuple):
    """What a layer began and ended with, as observers saw it, and what acted in it.

    Attributes:
        place, velocity: At its start [m, m/s], (dofs,) each.
        end_place, end_velocity: At its end, (dofs,) each.
        forces: Contact forces of the layer [N], (count, dim).
        start, end: Its times [s].
    """

    place: Floats
    velocity: Floats
    end_place: Floats
    end_velocity: Floats
    forces: Floats
    start: float
    end: float


class SumsTable(Sequence[Sums]):
    """The sums of many bodies as arrays, of which single ones are made when they are asked for.

    Attributes:
        sums: Numbers of `Sums` in their order but for the attitude, (bodies, numbers).
        attitude: See `Sums`, (bodies, 2, dim, dim).
    """

    def __init__(self, sums: Floats, attitude: Floats) -> None:
        """Keep arrays."""
        self.sums, self.attitude = sums, attitude
        self._made: list[Sums] | None = None

    @property
    def whole(self) -> bool:
        """Whether the arrays still tell all: single ones may have been changed."""
        return self._made is None

    def none(self) -> "SumsTable":
        """Zeros in their place, of ranks that do not sum up."""
        return SumsTable(0.0 * self.sums, 0.0 * self.attitude)

    def __len__(self) -> int:
        """Number of bodies."""
        return len(self.sums)

    def __getitem__(self, body: Any) -> Any:
        """Of a body."""
        if self._made is None:
            first, second = 3 + self.attitude.shape[-1], 3 + 2 * self.attitude.shape[-1]
            self._made = [
                Sums(kinetic, elastic, work, own[3:first], own[first:second], own[second:], turned)
                for (kinetic, elastic, work), own, turned in zip(
                    self.sums[:, :3].tolist(), self.sums,
                    self.attitude.reshape(len(self.sums), -1), strict=True,
                )
            ]  # fmt: skip
        return self._made[body]


class Stepper(Protocol):
    """What the time loop asks of the bodies, whatever they do in a layer.

    Attributes:
        dt: Time step [s].
    """

    dt: float

    @property
    def rolling(self) -> bool:
        """Whether some contact nodes touch at places that change; see `Rolling`."""

    @property
    def velocity(self) -> Floats:
        """Velocity of the owned dofs [m/s]."""

    @property
    def surface_displacement(self) -> Floats:
        """Of the contact nodes, massless ones without contact forces [m], (count, dim)."""

    def initial(self, static: Floats) -> Sequence[Sums]:
        """Sums of the initial state, one for each body; ``static`` as in `finish`."""

    def inertia(self) -> Sequence[Floats]:
        """Of each body [kg m^2], as the sums of angular momentum have it, (1, 1) or (3, 3)."""

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins of their bodies [m], (turns, count, dim).

        Those of the layer, with the arms of angular momenta; 0 of what does not turn (collective).
        """

    def gravity(self, start: float, end: float) -> Floats:
        """Gravity that a layer between two times uses [m/s^2], shape (dim,)."""

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times from the present state (collective)."""

    @property
    def surface_iterate(self) -> Floats:
        """Displacement of the contact nodes at the end of the step, as it is solved now [m].

        Of shape (count, dim) (collective).
        """

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the layer; sums of each body.

        Args:
            static: Displacements of the contact nodes by the multipliers [m], (count, dim).
        """

    def placed(self, static: Floats) -> Floats:
        """Displacement of the owned dofs with massless nodes where they are, as a new array."""

    def state(self) -> dict[str, Any]:
        """What the next layer needs, by name: arrays of owned dofs."""

    def memory(self) -> dict[str, Floats]:
        """What it needs besides, by name, the same on all ranks."""

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave; other names are passed over."""

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state; ``surface`` was `surface_displacement`, to the last bit."""

    def destroy(self) -> None:
        """Free what PETSc holds."""


class Interior(Stepper, Protocol):
    """One layer of a scheme that is linear but for contact, in the order of the loop's calls.

    `begin` solves it without contact forces, `push` adds these.

    Attributes:
        whole_columns: For how many contact nodes answers are worth keeping in full; None: for all.
    """

    whole_columns: int | None

    @property
    def apart(self) -> Integers | None:
        """Body of each contact node, (count,), if forces on one body move no other one."""

    @property
    def massive(self) -> Booleans:
        """Contact nodes whose mass makes impacts: between them the law acts on speeds, (count,)."""

    @property
    def radiating(self) -> Booleans:
        """Contact nodes that forces give a velocity at once, as ends of bars do, (count,)."""

    @property
    def volatile(self) -> Booleans:
        """Contact nodes whose answers change from layer to layer, (count,)."""

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of contact nodes at both ends of the layer as it has begun, if with mass.

        Args:
            way: What they moved in it [m], (count, dim).

        Returns:
            Before and after it [m/s], (count, dim) each (collective).
        """

    @property
    def share(self) -> float:
        """Part of the layer's contact force that acts."""

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to forces; see `impactfem.contact.responses`.

        The forces are numbered in the order in which they are asked for, over all calls.
        """

    def answers(self, forces: Floats) -> tuple[Floats, Floats]:
        """The same for volatile nodes that are asked again: not numbered."""

    def roots(self) -> Roots | None:
        """Answers of volatile nodes now, in place of their columns; see `PairResponses`."""

    def static(self, forces: Floats) -> Floats:
        """Displacement of massless contact nodes by static forces on them, (count, dim) each."""

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:
        """Add the effect of the layer's contact forces (count, dim) to all dofs.

        Args:
            forces: [N].
            change: What they do to the contact nodes [m], if it is known.
            parts: The same forces as a sum of those that `columns` was asked for, shape (asked,).
        """


class MaterialSums(Protocol):
    """Sums of products of displacements of a body, of which derivatives by its material are made.

    As `impactfem.system.material_slopes.MaterialSlopes` and `impactfem.system.plate_slopes`.
    """

    def stiff(self, one: Floats, other: Floats) -> None:
        """Add one . K other, (dofs,) each (collective)."""

    def heavy(self, one: Floats, other: Floats) -> None:
        """Add one . M other, (dofs,) each (collective)."""

    def weigh(self, values: Floats) -> None:
        """Add the sum of lumped masses times values, (dofs,)."""

    def weigh_whole(self, factor: float) -> None:
        """Add a factor times the mass of the body."""

    def by_material(self) -> Floats:
        """Derivatives by the numbers of the elements of this rank, (numbers, elements)."""


class Reversible(Protocol):
    """An interior whose layers are known backwards, as gradients need them (collective).

    `backward` is the transpose of a layer: of `begin`, `push` and `finish` without `static`. What
    bodies with a `relaxation` remember goes on beside it (`impactfem.marching.reversed_march`).
    """

    @property
    def dofs(self) -> int:
        """How many owned dofs it takes."""

    def backward(
        self, place: Floats, rate: Floats, contact: Floats, *, first: bool,
        parts: Floats | None = None,
    ) -> Backward:  # fmt: skip
        """Derivatives by what a layer begins with.

        Args:
            place: By displacements of owned dofs at its end, (dofs,).
            rate: By velocities there, of explicit layers by its step, (dofs,).
            contact: By `surface_displacement` there, (count, dim).
            first: Whether it is the layer from t = 0.
            parts: Where nothing else is given, the contact nodes' as a sum of forces that
                `columns` was asked for, (asked,).
        """

    def settled(self, place: Floats, contact: Floats) -> Floats:
        """Derivatives by displacements (dofs,) with those by contact nodes in equilibrium."""

    def eased(self, place: Floats | float, contact: Floats) -> Floats | None:
        """How far derivatives, taken for forces, move what has no mass with all else held, (dofs,).

        Args:
            place: By displacements; see `backward`.
            contact: By contact nodes.

        Returns:
            None if nothing moves, on all ranks alike.
        """

    def on_contact(self, values: Floats) -> Floats:
        """Values of the contact nodes (count, dim) on the owned dofs, 0 where held, (dofs,)."""

    def vary(self, into: MaterialSums, loads: Floats, ends: Ends) -> None:
        """Add derivatives by the material that a layer makes.

        Args:
            into: The sums of the body.
            loads: Derivatives by forces that act in the layer, (dofs,).
            ends: Of the layer.
        """

    def vary_product(self, into: MaterialSums, one: Floats, other: Floats) -> None:
        """Add those of one . M other with the mass of momenta, (dofs,) each."""

    def vary_weight(self, into: MaterialSums, values: Floats) -> None:
        """Add those of the sum of values (dofs,) by the mass of first moments."""

    def sums_by(self) -> tuple[Floats, Floats]:
        """Mass times displacement by displacements, momentum by rates, (dim, dofs) each."""


class Rolling(Protocol):
    """An interior with balls that turn: what touches is not their middle, and no one place."""

    def touched(self, normals: Floats) -> Floats:
        """Learn where nodes touch; what their surface moves in the layer besides them [m].

        Asked after `Stepper.begin`, for the layer without contact forces.

        Args:
            normals: Of the gaps of each node, towards it, (count, dim).

        Returns:
            Ways, shape (count, dim); 0 of nodes that touch themselves.
        """

    @property
    def rolled(self) -> Floats:
        """The same ways in the last layer, with contact; asked of what is staggered."""

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of nodes at both ends of the layer without contact [rad/s], (count, turns) each."""

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """What several moments on nodes do (several, count, turns) [N m].

        Returns:
            Displacements of the contact nodes [m], (several, count, dim), and turns of their bodies
            [rad], (several, count, turns), both as `Interior.columns` has those of forces.
        """

    def twist(self, moments: Floats) -> None:
        """Add the layer's moments on nodes (count, turns); iterates take them in place of others.

        Where steps are solved by iterates `NewtonStepper.unbalanced` and `correct` see to them.
        """


class Answers(Protocol):
    """How gaps answer to contact forces; see `impactfem.contact.responses.Responses`."""

    @property
    def known(self) -> Integers:
        """Contact nodes whose answers are known, in the order of their finding."""

    def learn(self, nodes: Integers) -> None:
        """Find the answers of contact nodes in the same order (collective)."""

    def require(self, rows: Integers) -> None:
        """Compute what is missing for some gaps (collective)."""

    def matrices(self, rows: Integers, normals: Floats) -> tuple[Floats, Floats]:
        """Response C and compliance D of some gaps [m/N], (k, k) each."""

    def approach(
        self, rows: Integers, normals: Floats, forces: Floats, multipliers: Floats
    ) -> Floats:
        """Changes of all gaps by layer forces and static ones on some, (pairs,)."""

    def parts(self, rows: Integers, forces: Floats) -> Floats:
        """Vector forces (k, dim) in some gaps as a sum of those that were asked for, (asked,)."""

    def displacement(self, rows: Integers, normals: Floats, forces: Floats) -> Floats | None:
        """Displacements of the contact nodes by layer forces, (nodes, dim); None if not kept."""

    def static(self, rows: Integers, normals: Floats, multipliers: Floats) -> Floats | None:
        """Displacements of the contact nodes by static forces, (nodes, dim); None if not kept."""

    def renew(self, changed: Booleans, answers: Columns, roots: Roots | None) -> None:
        """Ask again for the answers of volatile nodes (collective)."""


class DirectedAnswers(Answers, Protocol):
    """Answers in all directions, as friction needs them."""

    def blocks(self, rows: Integers, frames: Floats) -> tuple[Matrix, Matrix]:
        """C and D of some gaps in all directions [m/N], (k dim, k dim); with friction."""

    def moved(self, rows: Integers, forces: Floats, multipliers: Floats) -> Floats:
        """Relative displacements in all gaps by vector forces on some, (pairs, dim)."""


class DirectedGaps(Protocol):
    """Gaps that friction acts in; see `ContactGaps`."""

    def directed(self, columns: Columns, apart: Integers | None) -> DirectedAnswers:
        """How the gaps answer to contact forces in any direction."""


class ContactGaps(Protocol):
    """Gaps of contact nodes: to obstacles (`contact.gaps`), or between bodies (`contact.pairs`).

    Attributes:
        pairs: Names of the pairs of the scene that they belong to.
    """

    pairs: tuple[str, ...]

    def pair_of(self) -> Integers:
        """Which of `pairs` each gap belongs to now, (gaps,)."""

    def responses(
        self, columns: Columns, whole: int | None, apart: Integers | None = None
    ) -> Answers:
        """How the gaps answer to contact forces."""

    def relative(self, values: Floats) -> Floats:
        """What values of the contact nodes (nodes, dim) make for the gaps, (pairs, dim)."""

    def spread(self, forces: Floats) -> Floats:
        """Forces on the contact nodes (nodes, dim) by those in the gaps (pairs, dim)."""

    def units(self, rows: Integers, directions: Floats) -> Floats:
        """`spread` of unit forces in some gaps along directions (rows, ways, dim).

        Of shape (rows, ways, nodes, dim).
        """

    def entries(self, rows: Integers) -> tuple[Integers, Integers, Floats]:
        """What some gaps weigh: place of the gap among them, contact node, weight, (entries,)."""

    def only_on(self, nodes: Booleans) -> Booleans:
        """Whether a gap weighs no other nodes than some (nodes,), (pairs,)."""

    def at(
        self,
        displacement: Floats,
        begin: Floats,
        last: Floats,
        time: float,
        back: float = 0.5,
        span: float = 0.0,
    ) -> tuple[Floats, Floats]:
        """Gaps (pairs,) and normals (pairs, dim) for displacements at a time.

        See `impactfem.contact.gaps.Gaps.at`.
        """

    def normals_at(self, displacement: Floats, time: float, arms: Floats | None = None) -> Floats:
        """Normals (pairs, dim) amid a step, where nodes are by an iterate; who meets whom stays.

        To the next `at` forces that `spread` puts on nodes have neither sum nor moment, and
        `relative` is its transpose.

        Args:
            displacement: Of the contact nodes [m], (nodes, dim).
            time: [s].
            arms: Displacements that moments go by [m], (nodes, dim); None: the same.
        """

    def shift(self, time: float) -> Floats:
        """How far what each gap's node faces has moved with its obstacle since t = 0 [m].

        What that is `at` has found, so that differences tell its way; (pairs, dim).
        """

    @property
    def moves(self) -> bool:
        """Whether what some nodes face moves by itself, as obstacles may."""

    @property
    def shares_nodes(self) -> bool:
        """Whether a node may have gaps to several obstacles."""

    def handed(self, values: Floats) -> Floats:
        """What gaps have, (pairs,) or (pairs, dim), where other gaps carry it now."""

    def nodal(self, force: Floats, gap: Floats) -> tuple[Floats, Floats, Floats]:
        """Gap [m], pressure [Pa] and whether pressed (1 or 0), of the contact nodes, (nodes,) each.

        Args:
            force: Normal forces in the gaps [N], (pairs,).
            gap: [m], (pairs,).
        """

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs to know of earlier ones, by name."""

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave; other names are passed over."""
