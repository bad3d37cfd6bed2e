"""A plate at rest: what loads leave unbalanced, and what forces do to it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.sparse.linalg import splu

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.system.kirchhoff import DOFS
from impactfem.system.plate import PlateSystem
from impactfem.system.plate_rows import pinned
from impactfem.system.rigid_modes import RigidModes
from impactfem.system.surface import CHOLESKY

if TYPE_CHECKING:
    from impactfem.marching.plate import PlateMidpoint
    from impactfem.marching.plate_newton import PlateNewton


_FREE = 1e-9  # share below which supports take nothing of a motion, or springs resist it by nothing


class PlateAtRest:
    """A plate as the search for equilibrium sees it; see `impactfem.marching.resting.Resting`."""

    def __init__(self, march: "PlateMidpoint") -> None:
        """Take a plate.

        Raises:
            SceneError: Supports do not hold it.
        """
        bodies = march.bodies
        self.name, self.patience = bodies.names[0], 0
        # Behind the coordinates, of what stretches, is what friction pulls in the plane [N].
        self.start = np.concatenate([march.coordinates, march.pulls])
        self.size = float(np.ptp(bodies.mesh.points, axis=0).max())
        self._march, self._stiffness = march, bodies.stiffness
        self._membrane, self._vertices = bodies.membrane, bodies.basis[::DOFS].T.tocsr()
        self._ends = len(march.coordinates)
        free = _free_motions(bodies)
        if free:
            raise SceneError(
                f'start = "static": no support holds body {self.name} against {", ".join(free)}; '
                'support its edges, or use start = "given"'
            )
        self.modes = RigidModes.none(len(self.start))
        self._led = bodies.led
        self._factor = splu(pinned(self._stiffness, self._led).tocsc(), **CHOLESKY)

    def contact(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, 3)."""
        return self._march.displaced(*self._parts(place))

    @property
    def _stretching(self) -> "PlateNewton":
        """Of a plate that stretches; its steps are iterates."""
        return cast("PlateNewton", self._march)

    def _parts(self, place: Floats) -> tuple[Floats, Floats]:
        return place[: self._ends], place[self._ends :]

    def touch(self, normals: Floats) -> None:
        """Nothing: nodes touch themselves."""

    def touching(self, place: Floats) -> Floats:
        """Displacements of the contact nodes [m], (count, dim) (collective)."""
        return self.contact(place)

    def moved(self, place: Floats, change: Floats) -> Floats:
        """How they move by a change of q, (count, 3)."""
        return self._march.moved(*self._parts(place), *self._parts(change))

    def pulled(self, forces: Floats, place: Floats) -> Floats:  # noqa: ARG002  (as of others)
        """Forces on q by those on the contact nodes (count, 3)."""
        return np.concatenate(self._march.pulled(forces))

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces."""
        q, pulls = self._parts(place)
        inside = self._stiffness @ q
        if (membrane := self._membrane) is not None:
            slopes, strains, _ = self._stretching.inside(q, pulls)
            inside = inside + self._vertices @ membrane.force(membrane.tension(strains), slopes)
        left = self._march.loads_at_rest(q) - inside
        left[self._led] = 0.0
        return np.concatenate([left, -pulls])

    def steady(self) -> bool:
        """Nothing to change: plates do not turn."""
        return False

    def tangent(self, place: Floats) -> Callable[[Floats], Floats]:
        """What forces on q do, but for pressures that go by the gap."""
        if self._membrane is None:
            return self._answer
        march = self._stretching
        slopes, strains, _ = march.inside(*self._parts(place))
        # As in a step, which takes halves of all that is in the plate.
        matrix = self._membrane.tangent(
            self._vertices, 0.5 * self._stiffness, self._membrane.tension(strains), slopes, slopes
        )
        stays = np.pad(self._led, (0, matrix.shape[0] - self._ends))
        factor = splu(pinned(matrix, stays).tocsc())

        def answer(forces: Floats) -> Floats:
            pushed, pulls = self._parts(forces)
            found = factor.solve(np.concatenate([0.5 * pushed, march.on_u(pulls)]))
            return np.concatenate([found[: self._ends], pulls])

        return answer

    def _answer(self, forces: Floats) -> Floats:
        return np.asarray(self._factor.solve(np.where(self._led, 0.0, forces)))

    def destroy(self) -> None:
        """Nothing to free."""

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (3,)."""
        return self._march.settle(*self._parts(place))


def _free_motions(bodies: PlateSystem) -> list[str]:
    """Rigid motions that neither supports nor springs hold, in words."""
    scale = float(np.ptp(bodies.mesh.points, axis=0).max())
    points = bodies.mesh.points / scale
    one, none = np.ones(len(points)), np.zeros(len(points))
    slope = one / scale
    columns = ([one, none, none], [points[:, 0], slope, none], [points[:, 1], none, slope])
    fields = np.stack([np.stack(each, axis=1).ravel() for each in columns], axis=1)
    basis = bodies.basis[:, ~bodies.led]
    kept = basis.T @ fields
    _, sizes, ways = np.linalg.svd(fields - basis @ kept, full_matrices=False)
    found = []
    for way in ways[sizes <= _FREE * np.sqrt(len(points))]:
        q = np.zeros(len(bodies.led))
        q[~bodies.led] = kept @ way
        if q @ (bodies.stiffness @ q) > _FREE * (bodies.stiffness.diagonal() @ q**2):
            continue
        turn = np.array([way[2], -way[1]])
        size = float(np.linalg.norm(turn))
        x, y = np.round(turn / (size or 1.0), 6) + 0.0
        along = "motion along its normal"
        found.append(along if size <= _FREE else f"rotation about an axis along ({x:.3g}, {y:.3g})")
    return found
