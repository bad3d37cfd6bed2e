"""The time loop of bodies that are marched: layers, rows of the history, observers, restart."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.adhesion import Bonds
from impactfem.contact.complementarity import Solver
from impactfem.contact.friction_solver import Solving
from impactfem.contact.impact_law import Law
from impactfem.contact.speed_kernels import row_sums, rubbing_sums
from impactfem.contact.speed_law import SpeedLaws
from impactfem.contact.springs import ContactSprings
from impactfem.errors import ConvergenceError
from impactfem.fem import MPI
from impactfem.findings import Finding
from impactfem.marching.impacts import Impacts
from impactfem.marching.layers import ContactGaps, Stepper
from impactfem.marching.newton_steps import LayerSums
from impactfem.marching.rows import Level, Rows
from impactfem.marching.rubbing import Friction, frames, told, turned
from impactfem.marching.schemes import SolidScheme

_CHECKED = 32  # layers between checks that all numbers are finite


@dataclass
class ContactState:
    """Multipliers and true gaps of all contact nodes at the last level and the one before.

    Attributes:
        multiplier, gap: At the last level [N], [m].
        older_multiplier, older_gap: One level earlier.
        static: Displacement of massless nodes by the multipliers [m], (count, dim).
    """

    multiplier: Floats
    gap: Floats
    older_multiplier: Floats
    older_gap: Floats
    static: Floats = field(default_factory=lambda: np.zeros((0, 0)))


_CONTACT = fields(ContactState)


@dataclass(frozen=True)
class LoopSettings:
    """What a march is told besides its bodies.

    Attributes:
        comm: MPI communicator.
        scheme: The scheme as data.
        gaps: Distances from obstacles and between bodies.
        active_set: Solver of complementarity problems.
        layers: Number of layers.
        tolerance: Rounding level of gaps [m].
        rest: Where bodies start at rest: forces in the gaps [N], (pairs,), what these do to
            massless nodes [m], (nodes, dim), and those of friction [N], (pairs, dim). None: they
            are found.
        friction: Coulomb's law; None without.
        restitution: Newton's e of each gap between nodes with mass, (pairs,); None: 0.
        speed_laws: Restitution by the speed of approach; None: by `restitution` alone.
        poisson: Poisson's e likewise.
        springs: In the gaps; None without any.
        bonds: What holds bodies together that have touched; None: nothing does.
        most_pairs: Of which rows are kept for each; of more none is.
        impact_law: How contacts between nodes with mass share an impact.
    """

    comm: Any
    scheme: SolidScheme
    gaps: ContactGaps
    active_set: Solver
    layers: int
    tolerance: float
    rest: tuple[Floats, Floats, Floats] | None = None
    friction: Friction | None = None
    restitution: Floats | None = None
    speed_laws: SpeedLaws | None = None
    poisson: Floats | None = None
    springs: ContactSprings | None = None
    bonds: Bonds | None = None
    most_pairs: int | None = None
    impact_law: Law = "simultaneous"

    def of(self, rows: Integers, gaps: ContactGaps) -> "LoopSettings":
        """Of some of its gaps, which are `gaps`."""
        found = replace(self, gaps=gaps)
        if found.rest is not None:
            force, static, rubbing = found.rest
            found = replace(found, rest=(force[rows], static, rubbing[rows]))
        if found.friction is not None:
            found = replace(found, friction=found.friction.some(rows))
        if found.springs is not None:
            found = replace(found, springs=found.springs.some(rows))
        if found.bonds is not None:
            found = replace(found, bonds=found.bonds.some(rows))
        if found.restitution is not None:
            found = replace(found, restitution=found.restitution[rows])
        if found.speed_laws is not None:
            found = replace(found, speed_laws=found.speed_laws.some(rows))
        if found.poisson is not None:
            found = replace(found, poisson=found.poisson[rows])
        return found


class TimeLoop[I: Stepper](ABC):
    """A march through the layers, which can be stopped and continued between any two.

    Attributes:
        interior: What the scheme does inside the bodies.
        contact: Forces and gaps at the last level.
        rows: What each layer has left.
        layer: Number of layers done.
        pairs: Names of the pairs of the scene of which rows are kept.
        failure: Why the march ended early; empty if it did not.
    """

    _done: LayerSums | None = None  # of the last layer, where its steps sum up

    def __init__(self, interior: I, settings: LoopSettings) -> None:
        """Find the contact forces of the initial state.

        Args:
            interior: What the scheme does inside the bodies.
            settings: All else.
        """
        scheme, gaps, rest, layers = (
            settings.scheme, settings.gaps, settings.rest, settings.layers,
        )  # fmt: skip
        self._comm, self._scheme, self._gaps = settings.comm, scheme, gaps
        self._solver, self._friction = settings.active_set, settings.friction
        self._how = Solving(settings.active_set, settings.tolerance)
        if settings.friction is not None:
            self._how = settings.friction.solving
        self._restitution, self._poisson = settings.restitution, settings.poisson
        self._speed_laws = settings.speed_laws
        self._rubs, self._springs = settings.friction is not None, settings.springs
        self._impacts, self._bonds = Impacts(settings.impact_law), settings.bonds
        self.layers, self.tolerance = layers, settings.tolerance
        self.interior = interior
        most = settings.most_pairs
        self.pairs: tuple[str, ...] = gaps.pairs if most is None or len(gaps.pairs) <= most else ()
        free = interior.surface_displacement
        self.layer = 0
        self.failure = ""  # why the march ended early
        # An explicit step spans two layers: what it conserves pairs each level with the one after
        # the next, and contact nodes that have mass take the forces of neighbouring layers.
        self._skips = scheme.staggered and scheme.massless
        last = free if rest is None else free + rest[1]
        gap, normals = gaps.at(free, free, last, 0.0)
        count = len(gap)
        self._normals = normals
        multiplier, static = rest[:2] if rest else self._initial_contact(gap, normals)
        acting = np.zeros(count) if rest is None else multiplier
        if scheme.shares_forces:  # half of the force at t = 0 lies before it, and is missing
            multiplier = np.zeros(count)
        true = gap + np.einsum("ij,ij->i", normals, gaps.relative(static))
        if self._springs is not None:
            true = true + self._springs.depth(acting)
        self.contact = ContactState(multiplier, true, multiplier, true, static)
        if self._bonds is not None:
            self._bonds.touch(true <= self.tolerance)
        sums = interior.initial(static)
        self.rows = Rows.empty(
            layers + 1, len(sums), free.shape[1], len(self.pairs), friction=self._rubs
        )
        self.rows.put(0, sums)
        self._impulsive = np.zeros(count, dtype=bool)
        self._start_force = acting
        self._close_row(0, acting, 0)
        if rest is not None and self._rubs:
            directions = frames(normals)
            rubbing = turned(directions, rest[2])
            rubbing[:, 0] = acting
            acting, none = told(directions, rubbing, np.zeros_like(rubbing[:, 1:]))
            self._close_rubbing(0, np.arange(count), acting, none)

    @abstractmethod
    def _advance(self) -> Floats:
        """One layer; returns the contact forces [N], shape (gaps,)."""

    def findings(self) -> tuple[Finding, ...]:
        """What the bodies, as they are marched, cannot do right."""
        return self._impacts.findings(self.figures())

    def figures(self) -> Mapping[str, Any]:
        """The same in numbers, for the details of a run."""
        return self._impacts.figures(self._gaps.pairs)

    def _approach(self, speed: Floats) -> None:
        """Let restitution know normal speeds at the start of a step [m/s], (gaps,)."""
        if self._speed_laws is not None:
            self._restitution = self._speed_laws.at(speed)

    @property
    def _lively(self) -> Floats:
        """Newton's e, by the last speeds of which `_approach` learned, (gaps,)."""
        none = np.zeros(len(self.contact.gap))
        return none if self._restitution is None else self._restitution

    @property
    def _returning(self) -> Floats:
        """That e, or Poisson's, by which two bodies part, (gaps,)."""
        return self._lively if self._poisson is None else np.maximum(self._lively, self._poisson)

    def _initial_contact(self, gap: Floats, normals: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002
        """Forces in the gaps at t = 0 [N], (gaps,), and what they do to massless nodes [m]."""
        return np.zeros(len(gap)), np.zeros_like(self.interior.surface_displacement)

    @property
    def asked(self) -> Integers:
        """Contact nodes whose answers to forces are known, in the order of their finding."""
        return np.zeros(0, dtype=np.int64)

    @property
    def sets(self) -> Booleans:
        """Which gaps press at the last level, and with friction which stick, (gaps, 1 or 2)."""
        return (self.contact.multiplier > 0.0)[:, None]

    @property
    def gaps(self) -> ContactGaps:
        """All gaps, as observers look at them."""
        return self._gaps

    @property
    def springs(self) -> bool:
        """Whether there are springs in gaps."""
        return self._springs is not None

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs besides the state of the bodies, the same on all ranks."""
        contact = {f"contact.{entry.name}": getattr(self.contact, entry.name) for entry in _CONTACT}
        own = {"surface": self.interior.surface_displacement, "impacts": self._impacts.seen}
        own |= self.interior.memory()
        own |= {} if self._bonds is None else self._bonds.memory()
        return contact | own | self._gaps.memory()

    def restore(
        self,
        state: dict[str, Any],
        memory: Mapping[str, Floats],
        asked: Integers,  # noqa: ARG002  (of marches that keep answers)
        layer: int,
    ) -> None:
        """Continue after ``layer`` layers; the rows are set (collective).

        Args:
            state: Of the interior.
            memory: As `memory` gave it.
            asked: As the property was: sums of answers then round as they would have.
            layer: Number of layers done.
        """
        self.contact = ContactState(*(memory[f"contact.{entry.name}"] for entry in _CONTACT))
        self.interior.restore(state, memory["surface"])
        self.interior.remember(memory)
        self._impacts.seen = memory["impacts"].copy()
        if self._bonds is not None:
            self._bonds.restore(memory)
        self._gaps.remember(memory)
        self.layer = layer

    def release(self, loose: Booleans) -> None:
        """Go on where supports let go: what carries no mass is in equilibrium (collective).

        Args:
            loose: Which owned dofs of solids they let go, (dofs,).
        """
        if hasattr(self.interior, "relax"):  # others find that equilibrium in each step
            self.interior.relax(loose, self.layer * self.interior.dt)

    def run(self, observers: Sequence[Callable[[Level], None]] = ()) -> None:
        """March to the end; observers see every level, the initial one included.

        Raises:
            ConvergenceError: Contact forces were not found, or the numbers are no longer finite.
        """
        self.begin(observers)
        self.go_on(observers, self.layers)

    def go_on(self, observers: Sequence[Callable[[Level], None]], end: int) -> None:
        """March up to a layer; see `run`."""
        while self.layer < end:
            self.step(observers)

    def begin(self, observers: Sequence[Callable[[Level], None]] = ()) -> None:
        """Have observers see the initial level, unless the march goes on from another one.

        Raises:
            ConvergenceError: Its numbers are not finite.
        """
        if self.layer == 0:
            self._check_finite()
            self._observe(observers, self._start_force)

    def step(self, observers: Sequence[Callable[[Level], None]] = ()) -> None:
        """March one layer; see `run`."""
        force = self._advance()
        if self.layer % _CHECKED == 0 or self.layer == self.layers:
            self._check_finite()
        self._observe(observers, force)

    def _observe(self, observers: Sequence[Callable[[Level], None]], force: Floats) -> None:
        if not observers:
            return
        state = self.contact
        level = Level(
            self.interior, self.layer, state.static, force, state.gap,
            lambda: self._vectors(np.where(self._impulsive, 0.0, force)), self._gaps.spread,
            self._normals,
        )  # fmt: skip
        for observer in observers:
            observer(level)

    def _vectors(self, lasting: Floats) -> Floats:
        """Forces in the gaps as vectors (pairs, dim), of their normal parts (pairs,) [N]."""
        if self._done is not None:
            return np.where(self._impulsive[:, None], 0.0, self._done.vectors / self.interior.dt)
        return lasting[:, None] * self._normals

    def _pressed_work(self, way: Floats) -> float:
        """Multipliers times the displacements (pairs, dim) that they give to massless nodes [J]."""
        return float(self.contact.multiplier @ np.einsum("ij,ij->i", self._normals, way))

    def _close_layer(self, done: LayerSums) -> None:
        """Store what the steps of a layer have summed up to."""
        rows, row, self._done = self.rows, self.layer, done
        rows.obstacle_work[row], rows.friction_work[row] = done.obstacles, done.friction
        rows.braked_work[row] = done.braked
        rows.impact_work[row], rows.impact[row] = done.impacts, done.impulse[done.struck].sum()
        self._impulsive = done.struck

    def _close_row(self, row: int, force: Floats, iterations: int) -> None:
        """Store what is the same on all ranks."""
        rows, state, count = self.rows, self.contact, len(self.pairs)
        pair = self._gaps.pair_of() if count > 1 else np.zeros(0, dtype=np.int64)
        found = row_sums(force, self._impulsive, state.gap, pair, count)
        lasting, rows.gap[row], rows.force[row], rows.largest[row], rows.active[row], *each = found
        rows.iterations[row] = iterations
        if count:
            rows.pair_force[row], struck, rows.pair_gap[row] = each
            rows.pair_impact[row] = rows.impact[row] if count == 1 else self.interior.dt * struck
            self._close_pairs(row, lasting)
        if self._springs is not None:
            rows.indentation[row] = self._springs.depth(state.multiplier).max(initial=0.0)
            rows.spring_energy[row] = self._springs.energy(state.multiplier).sum()
        if self._skips:
            # gap = g + D lambda and lambda gap = 0: lambda D lambda = lambda . (gap - g).
            pressed = self._pressed_work(self._gaps.relative(state.static))
            rows.contact_energy[row] = 0.5 * pressed

    def _close_pairs(self, row: int, force: Floats) -> None:
        """Store what pairs have of lasting forces across normals, and of slip."""
        if self._done is not None and self._rubs:
            rubbed = np.column_stack([force, self._done.rubbed / self.interior.dt])
            self._close_rubbing(row, np.arange(len(force)), rubbed, self._done.slid)

    def _close_rubbing(self, row: int, rows: Integers, acting: Floats, way: Floats) -> None:
        """Store tangential forces and slip of pairs.

        Args:
            row: Of the history.
            rows: Gaps that took part.
            acting: Their forces as `impactfem.marching.rubbing.told` has them [N], (rows, 2 or 4).
            way: Ways slid [m], (rows,).
        """
        count = len(self._gaps.pairs)
        pair = self._gaps.pair_of()[rows] if count > 1 else np.zeros(len(rows), dtype=np.int64)
        own = np.ascontiguousarray(acting), np.ascontiguousarray(way)
        self.rows.tangential[row], self.rows.slip[row] = rubbing_sums(pair, *own, count)

    def _check_finite(self) -> None:
        """Stop all ranks if the numbers of one are not finite."""
        fine = bool(np.isfinite(self.rows.sums[self.layer]).all())
        if not self._comm.allreduce(fine, op=MPI.LAND):
            if self.layer == 0:
                raise ConvergenceError(
                    "the energy or momentum at t = 0 is not finite: the body's velocity, "
                    "displacement or material data are too large; give SI units"
                )
            raise ConvergenceError(
                f"the motion is no longer finite at t = {self.layer * self.interior.dt:g} s; use "
                "a smaller solve.dt or solve.courant, or check the loads of the scene"
            )
