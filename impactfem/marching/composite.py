"""Several bodies in one layer: each moves by its own scheme, contact sees all their nodes."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_matrix

from impactfem.arrays import Booleans, Floats
from impactfem.contact.pair_responses import Roots
from impactfem.errors import SceneError
from impactfem.marching.layers import Backward, Interior, Reversible, Rolling, Stepper, Sums


class Gathered:
    """What the steppers of several bodies have by one name, one after the other."""

    def __set_name__(self, owner: type[Any], name: str) -> None:
        """Learn the name."""
        self._name = name

    def __get__(self, bodies: Any, owner: type[Any]) -> NDArray[Any]:
        """Ask all of them."""
        return np.concatenate([getattr(part, self._name) for part in bodies.parts])


class Bodies[P: Stepper]:
    """The steppers of several bodies as one; see `impactfem.marching.layers.Stepper`.

    Contact nodes are those of the first body, then of the second, and so on.

    Attributes:
        parts: Steppers of the bodies, all with the same step.
        offsets: Where the contact nodes of each body begin, and their number, (bodies + 1,).
        velocity, surface_displacement, surface_iterate, massive: See `layers.Stepper` and its kin.
    """

    velocity = Gathered()
    surface_displacement = Gathered()
    surface_iterate = Gathered()
    massive = Gathered()

    def __init__(self, parts: Sequence[P]) -> None:
        """Join steppers.

        Raises:
            SceneError: Their steps differ.
        """
        self.parts = tuple(parts)
        self.dt = parts[0].dt
        if any(part.dt != self.dt for part in parts):
            raise SceneError(
                f"the bodies have the time steps {[part.dt for part in parts]} s: give one solve.dt"
            )
        surfaces = [part.surface_displacement for part in parts]
        self.offsets: tuple[int, ...] = (0, *np.cumsum([len(s) for s in surfaces]).tolist())
        self._dim = int(surfaces[0].shape[1])
        self._owned = tuple((part, self.own(k)) for k, part in enumerate(self.parts))

    def own(self, body: int) -> slice:
        """Places of a body's contact nodes."""
        return slice(self.offsets[body], self.offsets[body + 1])

    @property
    def _dofs(self) -> list[slice]:
        """Places of the owned dofs of each body."""
        cuts = np.cumsum([0, *(len(part.velocity) for part in self.parts)])
        return [slice(*ends) for ends in pairwise(cuts.tolist())]

    def initial(self, static: Floats) -> Sequence[Sums]:
        """Sums of the initial state, of each body."""
        return [sums for part, own in self._owned for sums in part.initial(static[own])]

    def inertia(self) -> list[Floats]:
        """Moments of inertia of each body [kg m^2]."""
        return [inertia for part in self.parts for inertia in part.inertia()]

    def spins(self) -> Floats:
        """Velocities of the contact nodes by unit spins [m], of all bodies."""
        return np.concatenate([part.spins() for part in self.parts], axis=1)

    def gravity(self, start: float, end: float) -> Floats:
        """Gravity that a layer between two times uses [m/s^2], shape (dim,)."""
        return self.parts[0].gravity(start, end)

    def begin(self, start: float, end: float) -> None:
        """Take up a step between two times, of all bodies."""
        for part in self.parts:
            part.begin(start, end)

    @property
    def beyond(self) -> Floats:
        """How far contact nodes went beyond what answers say of the forces on them [m]."""
        none = np.zeros_like(self.surface_iterate)
        return np.concatenate([getattr(part, "beyond", none[own]) for part, own in self._owned])

    def finish(self, static: Floats) -> Sequence[Sums]:
        """End the layer of all bodies; sums of each."""
        if len(self.parts) == 1:
            return self.parts[0].finish(static)
        return [sums for part, own in self._owned for sums in part.finish(static[own])]

    def placed(self, static: Floats) -> Floats:
        """Displacement of the owned dofs of all bodies, one after the other."""
        return np.concatenate([part.placed(static[own]) for part, own in self._owned])

    def straining(self, static: Floats) -> Floats:
        """Displacement whose elastic stress is that of the bodies; of others that they have."""
        return np.concatenate(
            [getattr(part, "straining", part.placed)(static[own]) for part, own in self._owned]
        )

    def state(self) -> dict[str, Any]:
        """What the next layer needs, of all bodies: one after the other, as `velocity` has them."""
        each = [part.state() for part in self.parts]
        names = dict.fromkeys(name for state in each for name in state)
        # Bodies that lack something have 0 of it.
        return {
            name: np.concatenate(
                [state.get(name, np.zeros_like(state["displacement"])) for state in each if state]
            )
            for name in names
        }

    def memory(self) -> dict[str, Floats]:
        """What it needs besides, of each body by its place."""
        each = enumerate(self.parts)
        return {f"{k}.{name}": values for k, part in each for name, values in part.memory().items()}

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        for k, part in enumerate(self.parts):
            own = f"{k}."
            part.remember({n.removeprefix(own): v for n, v in memory.items() if n.startswith(own)})

    def restore(self, state: dict[str, Any], surface: Floats) -> None:
        """Continue from a state."""
        for (part, nodes), own in zip(self._owned, self._dofs, strict=True):
            part.restore({n: values[own] for n, values in state.items()}, surface[nodes])

    def relax(self, loose: Booleans, time: float) -> None:
        """Take what supports let go of at a time [s], of owned dofs of solids (collective)."""
        for part, own in zip(self.parts, self._dofs, strict=True):
            if hasattr(part, "relax"):  # others have no supports, or ask for nothing
                part.relax(loose[own], time)

    def destroy(self) -> None:
        """Free what PETSc holds."""
        for part in self.parts:
            part.destroy()

    @property
    def rolling(self) -> bool:
        """Whether some contact nodes touch at places that change."""
        return any(part.rolling for part in self.parts)

    def turning(self) -> tuple[Floats, Floats]:
        """Spins of the body of each node at both ends of the layer [rad/s], (count, turns) each."""
        before = np.zeros((self.offsets[-1], self._turns))
        after = before.copy()
        for own, part in self._rolling():
            before[own], after[own] = part.turning()
        return before, after

    def twisted(self, moments: Floats) -> tuple[Floats, Floats]:
        """Displacements of all nodes, and turns of their bodies, by moments on nodes.

        Args:
            moments: Several at once [N m], (several, count, turns); those on bodies that do not
                roll move nothing.

        Returns:
            Shapes (several, count, dim) [m] and (several, count, turns) [rad].
        """
        moved = np.zeros((*moments.shape[:2], self._dim))
        turned = np.zeros_like(moments)
        for own, part in self._rolling():
            moved[:, own], turned[:, own] = part.twisted(moments[:, own])
        return moved, turned

    def twist(self, moments: Floats) -> None:
        """Moments on nodes (count, turns) that act on their bodies in the step."""
        for own, part in self._rolling():
            part.twist(moments[own])

    @property
    def _turns(self) -> int:
        return self._dim * (self._dim - 1) // 2

    def _rolling(self) -> list[tuple[slice, Rolling]]:
        """Bodies that roll, and their nodes."""
        return [(own, cast("Rolling", part)) for part, own in self._owned if part.rolling]


class Composite(Bodies[Interior]):
    """The interiors of several bodies as one; see `impactfem.marching.layers.Interior`.

    Bodies that no force reaches are not asked for answers. The part of a contact force that a
    support takes (a normal on the axis or a cut of symmetry may lean a little out of it) moves
    nothing.
    """

    radiating = Gathered()

    def __init__(self, parts: Sequence[Interior], free: Sequence[Floats] | None = None) -> None:
        """Join interiors.

        Args:
            parts: The bodies.
            free: Of the first bodies 1 where a contact node may move and 0 where a support holds
                it, (count, dim); of the others everywhere 1.

        Raises:
            SceneError: Their steps differ.
        """
        super().__init__(parts)
        wholes = [part.whole_columns for part in parts if part.whole_columns is not None]
        self.whole_columns = min(wholes, default=None)
        self._count = 0  # forces that were asked for
        self._asked = [np.zeros(0, dtype=np.int64) for _ in parts]  # which of them reach each body
        self._free = list(free or ())

    def _on(self, body: int, forces: Floats) -> Floats:
        """The part of forces (..., count, dim) that moves nodes of a body."""
        own = forces[..., self.own(body), :]
        return own * self._free[body] if body < len(self._free) else own

    @property
    def apart(self) -> NDArray[np.int64] | None:
        """Body of each contact node: no force moves another body."""
        each, first = [], 0
        for k, part in enumerate(self.parts):
            own = np.zeros(self.offsets[k + 1] - self.offsets[k], dtype=np.int64)
            each.append(first + (own if part.apart is None else part.apart))
            first = int(each[-1].max(initial=first - 1)) + 1
        return np.concatenate(each)

    @property
    def volatile(self) -> Booleans:
        """Contact nodes whose answers change, of all bodies."""
        return np.concatenate([part.volatile for part in self.parts])

    def contact_speeds(self, way: Floats) -> tuple[Floats, Floats]:
        """Velocities of the contact nodes at both ends of the layer [m/s], (count, dim) each."""
        each = [part.contact_speeds(way[own]) for part, own in self._owned]
        before, after = zip(*each, strict=True)
        return np.concatenate(before), np.concatenate(after)

    @property
    def share(self) -> float:
        """Part of the layer's contact force that acts."""
        return self.parts[0].share

    def touched(self, normals: Floats) -> Floats:
        """Tell bodies that roll where they touch; see `Rolling`."""
        found = np.zeros_like(normals)
        for own, part in self._rolling():
            found[own] = part.touched(normals[own])
        return found

    @property
    def rolled(self) -> Floats:
        """Ways that surfaces have gone in the last layer besides their nodes [m]; staggered ones.

        Of shape (count, dim).
        """
        found = np.zeros((self.offsets[-1], self._dim))
        for own, part in self._rolling():
            found[own] = part.rolled
        return found

    def columns(self, forces: Floats) -> tuple[Floats, Floats]:
        """Answers of the contact nodes to several forces (several, count, dim)."""
        return self._each(forces, keep=True)

    def answers(self, forces: Floats) -> tuple[Floats, Floats]:
        """The same, but not numbered."""
        return self._each(forces, keep=False)

    def roots(self) -> Roots | None:
        """Answers of the bodies that have some; none moves another."""
        each = [part.roots() for part in self.parts]
        if all(found is None for found in each):
            return None
        sizes, dim = np.diff(self.offsets).tolist(), self._dim
        rooted, roots = zip(
            *(
                (np.zeros(size, dtype=bool), csr_matrix((dim * size, 0)))
                if found is None
                else found
                for size, found in zip(sizes, each, strict=True)
            ),
            strict=True,
        )
        if len(roots) == 1:
            return rooted[0], roots[0]
        return np.concatenate(rooted), csr_matrix(block_diag(roots))

    def _each(self, forces: Floats, *, keep: bool) -> tuple[Floats, Floats]:
        layer, static = np.zeros_like(forces), np.zeros_like(forces)
        before = self._count
        self._count += len(forces) if keep else 0
        nodes = np.flatnonzero(forces.any(axis=(0, 2)))
        for k in np.unique(np.searchsorted(self.offsets, nodes, side="right") - 1).tolist():
            part, mine = self.parts[k], self._on(k, forces)
            asked = np.flatnonzero(mine.any(axis=(1, 2)))
            if len(asked):
                answer = part.columns if keep else part.answers
                found = answer(np.ascontiguousarray(mine[asked]))
                layer[asked, self.own(k)], static[asked, self.own(k)] = found
                if keep:
                    self._asked[k] = np.concatenate([self._asked[k], before + asked])
        return layer, static

    def static(self, forces: Floats) -> Floats:
        """Displacement of massless contact nodes by static forces on them, (count, dim) each."""
        found = np.zeros_like(forces)
        for k, part in enumerate(self.parts):
            mine = self._on(k, forces)
            if mine.any():
                found[self.own(k)] = part.static(mine)
        return found

    def push(self, forces: Floats, change: Floats | None, parts: Floats) -> None:
        """Add the effect of the layer's contact forces (count, dim) to the bodies they act on."""
        for k, part in enumerate(self.parts):
            mine = self._on(k, forces)
            if mine.any():
                known = None if change is None else change[self.own(k)]
                part.push(mine, known, parts[self._asked[k]])

    @property
    def reversible(self) -> bool:
        """Whether all of them are; see `Reversible`."""
        return all(getattr(part, "reversible", False) for part in self.parts)

    @property
    def dofs(self) -> int:
        """How many owned dofs `backward` takes, of all bodies."""
        return sum(part.dofs for part in cast("Sequence[Reversible]", self.parts))

    def backward(
        self, place: Floats, rate: Floats, contact: Floats, *, first: bool,
        parts: Floats | None = None,
    ) -> Backward:  # fmt: skip
        """Derivatives by what a layer begins with, of all bodies; see `Reversible`."""
        each = [
            part.backward(
                place[own],
                rate[own],
                contact[self.own(k)],
                first=first,
                parts=None if parts is None else parts[self._asked[k]],
            )
            for k, (part, own) in enumerate(self._reversible())
        ]
        forces = np.concatenate([found.forces for found in each])
        memory = np.zeros((max(len(found.memory) for found in each), self.dofs))
        for (_, own), found in zip(self._reversible(), each, strict=True):
            memory[: len(found.memory), own] = found.memory  # bodies without a term have 0 of it
        return Backward(
            np.concatenate([found.place for found in each]),
            np.concatenate([found.rate for found in each]),
            np.concatenate([self._on(k, forces) for k in range(len(self.parts))]),
            np.concatenate([found.loads for found in each]),
            memory,
        )

    def settled(self, place: Floats, contact: Floats) -> Floats:
        """Derivatives by displacements, with those by contact nodes, of all bodies."""
        each = enumerate(self._reversible())
        return np.concatenate(
            [part.settled(place[own], contact[self.own(k)]) for k, (part, own) in each]
        )

    def _reversible(self) -> list[tuple[Reversible, slice]]:
        """The bodies, and which dofs are theirs."""
        parts = cast("Sequence[Reversible]", self.parts)
        cuts = np.cumsum([0, *(part.dofs for part in parts)])
        return [(part, slice(*cuts[k : k + 2])) for k, part in enumerate(parts)]
