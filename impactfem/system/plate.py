"""Plates as the march takes them."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import eigsh

from impactfem import fem
from impactfem.errors import MeshError, SceneError
from impactfem.scene import Formula, Scene
from impactfem.scene.obstacles.rotation import gap_at
from impactfem.scene.pairing import bodies_met, law_of, obstacles_of
from impactfem.scene.plate import Plate
from impactfem.scene.plate_keys import FACES
from impactfem.system.few import FewBodies
from impactfem.system.kirchhoff import DOFS, Triangles, edge_stiffness
from impactfem.system.loads import FormulaValues
from impactfem.system.membrane import Membrane
from impactfem.system.plate_mesh import (
    Booleans,
    PlateMesh,
    apart_from_others,
    held_in_plane,
    held_slopes,
    mass_to_neighbours,
    net_between,
    plate_mesh,
)
from impactfem.system.plate_rows import free_basis, patches
from impactfem.system.plate_tones import first_frequency

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_LINEAR_SECONDS, _STRETCHING_SECONDS = 3.6e-7, 3.7e-6
"""Of an unknown in a layer: 36 ms with 99 517, 4 ms with 10 657; 45 ms with 11 949."""
_OF_BENDING = 5.0  # modes up to about the second are followed like a vibration, as of beams


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
        turning: Rotary inertia of the vertices about any axis in the plate [kg m^2], (vertices,).
        shears: Whether it does.
        thickness: At the vertices [m], (vertices,).
        transfer: P of `mass_to_neighbours`, by which loads move too; (vertices, vertices).
        loads: Pressures at the vertices, and which way along the normal they push.
        obstacles: Of the scene that it may meet, to which pressures count gaps.
        curved: `Triangles.curvatures` of the vertices by q, (3 vertices, d).
        enclosed: Whether all of its outline is held.
        membrane: How its middle stretches; None if it does not.
        reading: Deflections of contact nodes by q, (count, d): those of `touch`, or means around.
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
    turning: Floats
    shears: bool
    thickness: Floats
    transfer: csr_matrix
    reading: csr_matrix
    touch: Integers
    loads: tuple[tuple[float, FormulaValues], ...]
    obstacles: tuple[Any, ...]
    curved: csr_matrix
    enclosed: bool
    membrane: Membrane | None

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
    def seconds(self) -> float:
        """Time of a layer on one core, about [s]: one solve, of one that stretches several."""
        share = _LINEAR_SECONDS if self.membrane is None else _STRETCHING_SECONDS
        return share * len(self.position)

    @property
    def areas(self) -> Floats:
        """Of the vertices that may touch [m^2], (count,)."""
        return self.mesh.lumped(np.ones(len(self.mesh.cells)))[self.touch]

    def deflection(self, q: Floats) -> Floats:
        """Of all vertices [m], (vertices,)."""
        return np.asarray((self.basis @ q)[::DOFS])

    def give(self, mass: float, radius: float, speed: float) -> float:
        """Zener's number of a rigid ball on a plate without end (see `FewBodies.give`).

        Source: C. Zener, Phys. Rev. 59 (1941) 669-673, whose lambda this is.
        """
        section = self.plate.section
        dent = 4.0 / 3.0 * section.hardness * math.sqrt(radius)
        wave = 8.0 * math.sqrt(section.rigidity * section.mass)
        return float((dent**2 * speed * mass**3) ** 0.2 / wave)

    def elastic(self, q: Floats) -> float:
        """Energy of bending, shear, springs, and of the middle that stretches [J]."""
        found = 0.5 * float(q @ (self.stiffness @ q))
        if self.membrane is not None:
            slopes = self.membrane.slopes(self.deflection(q))
            found += self.membrane.energy(self.membrane.stretched(slopes))
        return found

    def stresses(self, q: Floats) -> Floats:
        """S_xx, s_yy, s_xy along the axes of the plate at the bottom and the top face [Pa].

        Of shape (2, vertices, 3).
        """
        section = self.plate.section
        curved = (self.curved @ q).reshape(-1, 3) * (self.thickness / section.thickness)[:, None]
        # Slopes that grow press the top together.
        found = -np.einsum("fij,vj->fvi", section.faces, curved)
        if self.membrane is not None:
            strains = self.membrane.at_vertices(self.deflection(q))
            found += np.einsum("fij,vj->fvi", section.skins, strains)
        found[..., :2] += self.plate.residual_stress
        return np.asarray(found)

    def pressure(self, t: float, deflection: Floats | None = None) -> Floats:
        """Forces of the pressures along the normal on all vertices [N], (vertices,).

        Args:
            t: [s].
            deflection: Of the vertices [m], (vertices,); None: 0.
        """
        found = np.zeros(len(self.mesh.points))
        for sign, values in self.loads:
            more = {"gap": self.gap(sign, t, deflection)} if values.uses_gap else {}
            found += sign * (self.mesh.shares @ values.at(t, **more))
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


def plate_system(scene: Scene, plate: Plate) -> PlateSystem:
    """Discretise a plate (collective).

    Vertices that may touch are no neighbours of each other and have no mass, and slopes have none
    either: both are in equilibrium with the rest. Where there is nothing to meet all keep theirs,
    and so they do where all contacts have a stiffness, which any vertex then may have.

    Raises:
        MeshError: It cannot be meshed, has an unknown edge, or all of it is held.
        SceneError: A formula has no finite value.
    """
    mesh = plate_mesh(plate, scene.folder or Path())
    obstacles = tuple(obstacles_of(scene, plate.name))
    met = [*bodies_met(scene, plate.name), *(o.name for o in obstacles)]
    laws = [law_of(scene, plate.name, name) for name in met]
    sprung = bool(laws) and all(law is not None and law.stiffness is not None for law in laws)
    patch = plate.patch_radius if plate.pressed_by(scene.bodies) else None
    if patch is not None and not sprung:
        raise SceneError(
            f"body {plate.name}: patch_radius = {patch:g}: forces act on patches "
            "where all of its contacts have a stiffness: give these one by [[contact]], or remove "
            "it"
        )
    found = discretised(
        plate, mesh, touches=bool(met) and not sprung, sprung=sprung,
        shears=plate.shears_beside(scene.bodies), obstacles=obstacles, patch=patch,
    )  # fmt: skip
    for load, (sign, values) in zip(plate.pressures, found.loads, strict=True):
        if values.uses_gap and np.isinf(found.gap(sign, 0.0)).all():
            raise SceneError(
                f"pressure on the {load.face} of {plate.name}: {load.value.text!r} uses gap, but "
                "this face sees no obstacle at t = 0: give one there, or the other face"
            )
    return found


def discretised(
    plate: Plate,
    mesh: PlateMesh,
    *,
    touches: bool,
    sprung: bool = False,
    shears: bool = False,
    obstacles: tuple[Any, ...] = (),
    patch: float | None = None,
) -> PlateSystem:
    """The same on a mesh that is given.

    Args:
        plate: As the scene has it.
        mesh: Of its mid-surface.
        touches: Whether there is anything that it may meet without a stiffness between.
        sprung: Whether all that it meets has one.
        shears: Whether it shears.
        obstacles: That it may meet.
        patch: Over which contact forces act [m]; None: on single vertices.

    Raises:
        MeshError: It has an unknown edge, or no vertex is left that could move and have mass.
        SceneError: Its thickness is none, or too large for its theory, or a stress buckles it.
    """
    thickness = _thicknesses(plate, mesh)
    still, ways = held_slopes(mesh, plate)
    count = len(mesh.points)
    touch = np.flatnonzero(~still) if sprung else apart_from_others(mesh, ~still)
    if not len(touch) or (touches and len(touch) == count - int(still.sum())):
        raise MeshError(
            f"body {plate.name}: no vertex is left that could move and have mass: give a smaller "
            "mesh_size"
        )
    light = touch if touches else np.zeros(0, dtype=np.int64)
    transfer = mass_to_neighbours(mesh, light)
    section = plate.section
    ratio = thickness[mesh.cells].mean(axis=1) / section.thickness
    own = section.mass * mesh.lumped(ratio)
    mass = np.asarray(transfer.T @ own)
    mass[still] = 0.0
    basis, deflected, vertex = free_basis(still, ways)
    triangles = Triangles(mesh, section, ratio, shears)
    stiffness = triangles.stiffness
    for support in plate.supports:
        springs = support.stiffness, support.rotational_stiffness
        if any(springs):
            stiffness = stiffness + edge_stiffness(mesh.points, mesh.edges[support.edge], *springs)
    reduced = csr_matrix(basis.T @ stiffness @ basis)
    if plate.residual_stress:
        reduced = _stressed(plate, mesh, still, reduced, triangles, basis)
    # Rotary inertia, of plates that shear: others have none, and follow their deflection.
    turning = section.turning * mesh.lumped(ratio**3) * shears
    inertia = sum(basis[k::DOFS].power(2).T @ turning for k in (1, 2))
    weight = basis[::DOFS].T @ mass + inertia
    massless = weight == 0.0
    center, axes = plate.frame
    start = center + mesh.points @ axes[:2]

    def values(formula: Formula, label: str) -> FormulaValues:
        return FormulaValues(
            formula, f"{label} of {plate.name}", mesh.points, fem.MPI.COMM_SELF, "plate"
        )

    u = values(plate.displacement, "displacement").at(0.0)
    v = values(plate.velocity, "velocity").at(0.0).copy()
    v[still] = 0.0
    v = np.asarray(transfer @ v)  # of what has no mass the mean of its neighbours
    position = np.zeros(basis.shape[1])
    position[deflected] = u[vertex[deflected]]
    rest, reading = start[touch], csr_matrix(basis[DOFS * touch])
    if patch is not None:
        reading = csr_matrix(patches(mesh, touch, patch) @ basis[::DOFS])

    def places(q: Floats) -> Floats:
        return np.asarray(rest + np.outer(reading @ q, axes[2]))

    total = float(own.sum())
    half = 0.5 * thickness[touch]
    first = first_frequency(reduced, weight * ~massless)
    return PlateSystem(
        names=(plate.name,),
        masses=(total,),
        centers=(own @ start / total)[None],
        speeds=(mass @ v / total * axes[2])[None],
        inertias=(0.0,),
        angles=(0.0,),
        position=position,
        velocity=np.where(deflected, v[vertex], 0.0),
        places=places,
        radius=half,
        shell=half,
        touching=np.ones(len(touch), dtype=bool),
        body=np.zeros(len(touch), dtype=np.int64),
        lines=mesh.cells_of(touch) if sprung else net_between(mesh, touch),
        ends={},
        rate=lambda: _OF_BENDING * first,
        words=f"a {'thick' if shears else 'thin'} plate of {len(mesh.cells)} discrete Kirchhoff"
        f"{'-Mindlin' if shears else ''} triangles",
        plate=plate,
        mesh=mesh,
        basis=basis,
        stiffness=reduced,
        deflected=deflected,
        light=massless,
        node_mass=mass,
        weight=weight,
        turning=turning,
        shears=shears,
        thickness=thickness,
        transfer=transfer,
        reading=reading,
        touch=touch,
        loads=tuple(
            (FACES[load.face], values(load.value, f"pressure on the {load.face}"))
            for load in plate.pressures
        ),
        obstacles=obstacles,
        curved=csr_matrix(triangles.curvatures @ basis),
        enclosed=bool(still[mesh.rim].all()),
        membrane=Membrane(triangles, held_in_plane(mesh, plate)) if plate.stretches else None,
    )


def _thicknesses(plate: Plate, mesh: PlateMesh) -> Floats:
    """At the vertices [m], (vertices,).

    Raises:
        SceneError: It is none somewhere, or too large.
    """
    if plate.thickness is None or plate.thickness.is_constant:
        return np.full(len(mesh.points), plate.depth)
    x, y = mesh.points.T
    found = np.asarray(plate.thickness(x=x, y=y))
    bad = np.flatnonzero(~(np.isfinite(found) & (found > 0.0)))
    if len(bad):
        at = ", ".join(f"{each:.4g}" for each in mesh.points[bad[0]])
        raise SceneError(
            f"body {plate.name}: thickness = {plate.thickness.text!r} is {found[bad[0]]:.4g} at "
            f"(x, y) = ({at}): give a formula that is above 0 all over the plate"
        )
    plate.check_thickness(float(found.max()))
    return found


def _stressed(
    plate: Plate, mesh: PlateMesh, still: Booleans, stiffness: csr_matrix, triangles: Triangles,
    basis: csr_matrix,
) -> csr_matrix:  # fmt: skip
    """Stiffness in q with that of the tension in the plate.

    Raises:
        SceneError: Nothing holds the tension, or it buckles the plate.
    """
    stress = plate.residual_stress
    where = f"body {plate.name}: residual_stress = {stress:g} Pa"
    if not (still & held_in_plane(mesh, plate))[mesh.rim].all():
        raise SceneError(
            f"{where} needs all edges held, which a free or elastic one lets go: hold them, in the "
            "plane too, or remove it"
        )
    unit = csr_matrix(basis.T @ triangles.tension(plate.section.thickness) @ basis)
    if stress < 0.0:
        start = np.ones(basis.shape[1])
        least = eigsh(stiffness, 1, unit, sigma=0.0, v0=start, return_eigenvectors=False)
        if -stress >= least[0]:
            raise SceneError(
                f"{where} buckles it, as {-least[0]:.4g} Pa do: give less, motions beyond are not "
                "modelled"
            )
    return stiffness + stress * unit
