"""What files and pictures show of a plate: its mid-surface, or all that is between its faces."""

from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.marching.marched import Shown
from impactfem.result.shapes import TETRAHEDRON, TRIANGLE, VECTOR, Shape
from impactfem.system.closest import shares_inside
from impactfem.system.kirchhoff import DOFS

if TYPE_CHECKING:
    from impactfem.marching.plate import PlateMidpoint

_NEAR = 1e-9  # share of the plate's size by which a probe may lie off its mid-surface


class ShownPlate(Shown["PlateMidpoint"]):
    """A plate; its nodes are the vertices of its mid-surface, or of its bottom, then its top."""

    measure = "thickness"

    def __init__(self, march: "PlateMidpoint") -> None:
        """See a plate, with stresses s_xx, s_yy, s_xy along its axes [Pa]."""
        super().__init__(march)
        self._system = march.bodies
        names = ["face_stress"] if self._system.plate.is_filled else ["stress_bottom", "stress_top"]
        self.components = dict.fromkeys(names, VECTOR)

    @property
    def middle(self) -> Floats:
        """Vertices of the mid-surface, undeformed [m], (vertices, 3)."""
        center, axes = self._system.plate.frame
        return np.asarray(center + self._system.mesh.points @ axes[:2])

    def material(self, body: int) -> Floats:  # noqa: ARG002  (it is one)
        """Its nodes, undeformed [m], (nodes, 3)."""
        if not self._system.plate.is_filled:
            return self.middle
        half = np.outer(0.5 * self._system.thickness, self._system.plate.frame[1][2])
        return np.concatenate([self.middle - half, self.middle + half])

    def drawn(self, body: int, name: str) -> Shape:
        """Triangles of its mid-surface, or tetrahedra between its faces."""
        cells = self._system.mesh.cells
        if not self._system.plate.is_filled:
            return Shape(name, self.material(body), cells, TRIANGLE)
        # Cut alike from both sides of a common edge: by the numbers of the vertices.
        a, b, c = np.sort(cells, axis=1).T
        top = len(self._system.mesh.points)
        thirds = [(a, b, c, c + top), (a, b, b + top, c + top), (a, a + top, b + top, c + top)]
        filled = np.concatenate([np.stack(each, axis=1) for each in thirds])
        places = self.material(body)[filled]
        volume = np.linalg.det(places[:, 1:] - places[:, :1])
        filled[volume < 0.0] = filled[volume < 0.0][:, [0, 2, 1, 3]]
        return Shape(name, self.material(body), filled, TETRAHEDRON)

    def motion(self, body: int) -> dict[str, Floats]:  # noqa: ARG002  (it is one)
        """Displacement [m], velocity [m/s], stress at the faces [Pa] of its nodes, by name."""
        march, bodies, axes = self._march, self._system, self._system.plate.frame[1]
        moved = np.outer(bodies.deflection(march.coordinates), axes[2]) + march.in_plane
        speed = np.outer(march.speed, axes[2])
        stress = bodies.stresses(march.coordinates, march.strains)
        mises = von_mises(stress)
        if not bodies.plate.is_filled:
            return {
                "displacement": moved, "velocity": speed, "von_mises": mises.max(axis=0),
                "stress_bottom": stress[0], "stress_top": stress[1],
            }  # fmt: skip
        half = 0.5 * bodies.thickness[:, None]
        tilt, tilting = (
            half * (rates.reshape(-1, DOFS)[:, 1:] @ axes[:2])
            for rates in (bodies.basis @ march.coordinates, bodies.basis @ march.rates)
        )  # of the normal, against the slope
        return {
            "displacement": np.concatenate([moved + tilt, moved - tilt]),
            "velocity": np.concatenate([speed + tilting, speed - tilting]),
            "von_mises": mises.ravel(),
            "face_stress": np.concatenate(list(stress)),
        }

    def acting(self, body: int, forces: Floats) -> Floats:
        """Contact forces [N] on its nodes by those on the contact nodes, (nodes, 3)."""
        found = np.zeros_like(self.material(body))
        nodes = self._system.touch
        forces = self._system.on_faces.at_vertices(forces)
        if self._system.plate.is_filled:
            on_top = forces @ self._system.plate.frame[1][2] < 0.0
            nodes = nodes + len(self._system.mesh.points) * on_top
        found[nodes] = forces
        return found

    def located(self, body: int, point: Floats) -> tuple[Integers, Floats, bool]:  # noqa: ARG002
        """Nodes around a place of its mid-surface, their weights, if it is in the plate."""
        center, axes = self._system.plate.frame
        mesh = self._system.mesh
        x, y, off = axes @ (point - center)
        shares = shares_inside(np.array([x, y]), mesh.points[mesh.cells])
        at = int(np.argmax(shares.min(axis=1)))
        inside = abs(off) <= 0.5 * self._system.depth * (1.0 + _NEAR)
        inside = bool(inside and shares[at].min() >= -_NEAR)
        nodes, weights = mesh.cells[at], shares[at]
        if not inside:
            nearest = int(np.argmin(np.linalg.norm(mesh.points - np.array([x, y]), axis=1)))
            nodes, weights = np.array([nearest]), np.ones(1)
        if self._system.plate.is_filled:  # what both faces do is what the middle does
            nodes = np.concatenate([nodes, nodes + len(mesh.points)])
            weights = np.concatenate([0.5 * weights, 0.5 * weights])
        return nodes, weights, inside

    def unguarded(self, lines: Integers) -> tuple[Floats, float]:  # noqa: ARG002
        """All triangles, and half the thickness."""
        deflection = self._system.deflection(self._march.coordinates)
        moved = np.outer(deflection, self._system.plate.frame[1][2])
        return (self.middle + moved)[self._system.mesh.cells], 0.5 * self._system.depth

    @property
    def nodes_sink(self) -> bool:
        """Whether contact lets vertices sink in: on springs, and where they have mass."""
        return not self._system.massless

    def unguarded_in_words(self, lines: Integers) -> tuple[float, str, str]:  # noqa: ARG002
        """See `Shown`."""
        remedy = "take a smaller mesh_size"
        if not self.nodes_sink:
            remedy += ": vertices between those that touch keep their mass"
        return self._system.depth, "places of {name} lie", remedy


def von_mises(stress: Floats) -> Floats:
    """Of stresses s_xx, s_yy, s_xy in a face [Pa], (..., 3)."""
    x, y, mixed = np.moveaxis(stress, -1, 0)
    return np.asarray(np.sqrt(x**2 - x * y + y**2 + 3.0 * mixed**2))
