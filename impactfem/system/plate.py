"""Plates as the march takes them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.errors import SceneError
from impactfem.scene import Formula
from impactfem.scene.jets import motion_at
from impactfem.scene.obstacles.rotation import gap_at
from impactfem.scene.plate import Plate
from impactfem.system.few import FewBodies
from impactfem.system.kirchhoff import DOFS
from impactfem.system.loads import FormulaValues
from impactfem.system.membrane import Membrane
from impactfem.system.plate_damping import PlateDamping
from impactfem.system.plate_faces import PlateFaces
from impactfem.system.plate_mesh import PlateMesh
from impactfem.system.plate_rows import pinned
from impactfem.system.plate_tips import plate_stations
from impactfem.system.regions import HeldRegion, Key
from impactfem.system.stations import Asked, Stations

OF_BENDING = 5.0  # modes up to about the second are followed like a vibration, as of beams
_UNDAMPED = 200.0
"""Impulse too large over root of the first mode's damping ratio and area of an element by width^2.

A clamped square thrown at a flat stop, ratios of 0.1 and 0.5, elements of 1/25 and 1/12: 4, 31, 10,
71 %, beside contacts with a stiffness, whose vertices have mass and are damped.
"""
_LINEAR_SECONDS, _STRETCHING_SECONDS = 3.6e-7, 3.7e-6
"""Of an unknown in a layer: 36 ms with 99 517, 4 ms with 10 657; 45 ms with 11 949."""


@dataclass(frozen=True, kw_only=True)
class PlateSystem(FewBodies):
    """A plate; q are w and the slopes that are free, its contact nodes those without mass.

    Attributes:
        plate: As the scene has it.
        mesh: Of its mid-surface.
        basis: w and slopes of all vertices by q, (3 vertices, d).
        stiffness: In q [N/m, N, N m], (d, d).
        deflected: Which of q are deflections, not slopes, (d,).
        light: Which of q have no mass, (d,).
        node_mass: Of the vertices, after what touches gave its away [kg], (vertices,).
        weight: Mass of q, (d,) [kg, kg m^2].
        damping: Of it.
        turning: Rotary inertia of the vertices about any axis in the plate [kg m^2], (vertices,).
        shears: Whether it does.
        thickness: At the vertices [m], (vertices,).
        transfer: P of `mass_to_neighbours`, by which loads move too; (vertices, vertices).
        loads: Pressures at the vertices, and which way along the normal they push.
        obstacles: Of the scene that it may meet, to which pressures count gaps.
        curved: `Triangles.curvatures` of the vertices by q, (3 vertices, d).
        enclosed: Whether all of its outline is held.
        membrane: How its middle stretches; None if it does not.
        regions: What joints hold of it.
        led: Which of q are deflections of edges that move, (d,).
        motions: Of such edges which of q, (d,), and their displacement in t [m].
        on_faces: How contact nodes follow the vertices: those of `touch`, or means around.
        touch: Vertices that may touch, (count,); `lines` are triangles between them, for balls.
    """

    plate: Plate
    mesh: PlateMesh
    basis: csr_matrix
    stiffness: csr_matrix
    deflected: Booleans
    light: Booleans
    node_mass: Floats
    weight: Floats
    damping: PlateDamping
    turning: Floats
    shears: bool
    thickness: Floats
    transfer: csr_matrix
    on_faces: PlateFaces
    touch: Integers
    loads: tuple[tuple[float, FormulaValues], ...]
    obstacles: tuple[Any, ...]
    curved: csr_matrix
    enclosed: bool
    membrane: Membrane | None
    regions: Mapping[Key, HeldRegion]
    led: Booleans
    motions: tuple[tuple[Booleans, Formula], ...]

    @property
    def swinging(self) -> tuple[csr_matrix, Floats]:
        """Stiffness and mass of vibrations, edges that move at rest: (d, d) and (d,)."""
        return pinned(self.stiffness, self.led), self.weight * ~(self.light | self.led)

    def leading(self, time: float) -> tuple[Floats, Floats]:
        """Deflections [m] and velocities [m/s] of edges that move, 0 of all else, (d,) each.

        Raises:
            SceneError: One is not finite.
        """
        found = np.zeros((2, len(self.led)))
        for own, formula in self.motions:
            jet = motion_at(formula, time)
            found[:, own] = np.array([[jet.value], [jet.rate]])
        if not np.isfinite(found).all():
            raise SceneError(
                f"body {self.names[0]}: the motion of an edge is not finite at t = {time:g} s; "
                "give a formula that is smooth there"
            )
        return found[0], found[1]

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """See `FewBodies`."""
        axes = self.plate.frame[1]
        return plate_stations(asked, self.regions, axes, self.basis, self.weight, self.velocity)

    @property
    def width(self) -> float:
        """Least one [m], about."""
        size = float(np.ptp(self.mesh.points, axis=0).max())
        return min(self.plate.least_width, float(self.mesh.areas.sum()) / size)

    @property
    def depth(self) -> float:
        """Largest thickness [m]."""
        return float(self.thickness.max())

    @property
    def massless(self) -> bool:
        """Whether what touches has no mass."""
        return bool((self.light & self.deflected).any())

    @property
    def undamped(self) -> float:
        """See `FewBodies`; by the damping of the first mode and the size of elements."""
        ratio = 0.5 * self.damping.stiffness * self.rate() / OF_BENDING * self.massless
        elements = float(self.mesh.areas.sum() / len(self.mesh.cells))
        return min(_UNDAMPED * math.sqrt(ratio) * elements / self.width**2, 1.0)

    @property
    def seconds(self) -> float:
        """Time of a layer on one core, about [s]: one solve, of one that stretches several."""
        share = _LINEAR_SECONDS if self.membrane is None else _STRETCHING_SECONDS
        return share * len(self.position)

    @property
    def areas(self) -> Floats:
        """Of the vertices that may touch [m^2], (count,)."""
        return self.mesh.lumped(np.ones(len(self.mesh.cells)))[self.touch]

    @property
    def faces(self) -> tuple[Integers, Integers]:
        """See `FewBodies`."""
        return self._vertices[: len(self.on_faces.followers)], self.on_faces.followers

    @property
    def _vertices(self) -> Integers:
        return np.arange(len(self.touch))

    def meeting(
        self,
        body: int,  # noqa: ARG002  (it is one)
        surfaces: Sequence[str] | None,  # noqa: ARG002  (it has none)
        partner: tuple[str, int],  # noqa: ARG002  (all meet it alike)
    ) -> Integers:
        """Its vertices, without what follows them."""
        return self._vertices

    def deflection(self, q: Floats) -> Floats:
        """Of all vertices [m], (vertices,)."""
        return np.asarray((self.basis @ q)[::DOFS])

    def give(self, mass: float, radius: float, speed: float) -> float:
        """How far it gives way to a rigid ball [kg, m, m/s] by its dent: Zener's number.

        Source: C. Zener, Phys. Rev. 59 (1941) 669-673, whose lambda this is.
        """
        section = self.plate.section
        dent = 4.0 / 3.0 * section.hardness * math.sqrt(radius)
        return float((dent**2 * speed * mass**3) ** 0.2 / self.impedance_at_point)

    @property
    def impedance_at_point(self) -> float:
        """Force on a single place by its speed, without end: 8 sqrt(D rho t) [kg/s]."""
        return 8.0 * math.sqrt(self.plate.section.rigidity * self.plate.section.mass)

    def weighing(self, mass: float) -> float:
        """Radius of a disc of it that has a mass [m]."""
        return math.sqrt(mass / (math.pi * self.plate.section.mass))

    def crossing(self, width: float) -> float:
        """Time in which bending waves as long as a way [m] cross it, about [s]."""
        return width**2 * math.sqrt(self.plate.section.mass / self.plate.section.rigidity)

    def crossed(self, time: float) -> float:
        """Way that they cross in a time, [s] to [m]."""
        return math.sqrt(time / self.crossing(1.0))

    def is_taut(self, width: float) -> bool:
        """Whether tension at rest, not bending, carries waves as long as a width [m]."""
        section = self.plate.section
        return self.plate.residual_stress * section.thickness * width**2 > section.rigidity

    def width_at(self, place: Floats, way: Floats) -> float:
        """Of the largest element at the vertex nearest to where a line meets the plate [m].

        Args:
            place: On the line [m], (3,).
            way: Its direction, (3,); along the plate, or none: the normal instead.
        """
        center, axes = self.plate.frame
        (x, y, z), (a, b, c) = axes @ (place - center), axes @ way
        if z * c < 0.0:
            x, y = x - z * a / c, y - z * b / c
        nearest = np.linalg.norm(self.mesh.points - np.array([x, y]), axis=1).argmin()
        areas = self.mesh.areas[(self.mesh.cells == nearest).any(axis=1)]
        return math.sqrt(2.0 * float(areas.max()))

    def elastic(self, q: Floats, strains: Floats) -> float:
        """Energy of bending, shear, springs, and of the middle with strains (cells, 3) [J]."""
        found = 0.5 * float(q @ (self.stiffness @ q))
        return found if self.membrane is None else found + self.membrane.energy(strains)

    def stresses(self, q: Floats, strains: Floats) -> Floats:
        """S_xx, s_yy, s_xy along the axes of the plate at the bottom and the top face [Pa].

        Args:
            q: Coordinates, (d,).
            strains: Of the middle in the triangles, of plates that stretch, (cells, 3).

        Returns:
            Shape (2, vertices, 3).
        """
        section = self.plate.section
        curved = (self.curved @ q).reshape(-1, 3) * (self.thickness / section.thickness)[:, None]
        # Slopes that grow press the top together.
        found = -np.einsum("fij,vj->fvi", section.faces, curved)
        if self.membrane is not None:
            each = self.membrane.at_vertices(strains)
            found += np.einsum("fij,vj->fvi", section.skins, each)
        found[..., :2] += self.plate.residual_stress
        return np.asarray(found)

    def pressure(self, start: float, end: float, deflection: Floats | None = None) -> Floats:
        """Mean forces of the pressures along the normal on all vertices [N], (vertices,).

        Args:
            start: Of the time [s].
            end: Its end [s]; gaps are those amid it.
            deflection: Of the vertices [m], (vertices,); None: 0.
        """
        middle = 0.5 * (start + end)
        found = np.zeros(len(self.mesh.points))
        for sign, values in self.loads:
            more = {"gap": self.gap(sign, middle, deflection)} if values.uses_gap else {}
            found += sign * (self.mesh.shares @ values.mean(start, end, **more))
        return found

    def gap(self, sign: float, t: float, deflection: Floats | None = None) -> Floats:
        """From a face to the obstacle that it sees [m], >= 0, infinite if none; see `pressure`."""
        center, axes = self.plate.frame
        moved = np.zeros(len(self.mesh.points)) if deflection is None else deflection
        places = center + self.mesh.points @ axes[:2] + np.outer(moved, axes[2])
        found = np.full(len(places), np.inf)
        for obstacle in self.obstacles:
            away, normal = gap_at(obstacle, places, t)
            seen = sign * (normal @ axes[2]) > 0.0
            found = np.where(seen & (away < found), away, found)
        return np.maximum(found - 0.5 * self.thickness, 0.0)

    @property
    def is_steady(self) -> bool:
        """Whether the pressures stay as they are, wherever the plate is."""
        return all(values.is_steady for _, values in self.loads) and not self.by_gap

    @property
    def by_gap(self) -> bool:
        """Whether some go by the gap to an obstacle."""
        return any(values.uses_gap for _, values in self.loads)
