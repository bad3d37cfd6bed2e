"""Plates discretised, as a scene has them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, eye_array
from scipy.sparse.linalg import eigsh

from impactfem import fem
from impactfem.arrays import Booleans, Floats
from impactfem.errors import MeshError, SceneError
from impactfem.scene import Formula, Scene
from impactfem.scene.pairing import bodies_met, law_of, obstacles_of
from impactfem.scene.plate import Plate
from impactfem.scene.plate_keys import FACES
from impactfem.system.kirchhoff import DOFS, Triangles, edge_stiffness
from impactfem.system.loads import FormulaValues
from impactfem.system.membrane import Membrane
from impactfem.system.plate import OF_BENDING, PlateSystem
from impactfem.system.plate_damping import PlateDamping
from impactfem.system.plate_faces import PlateFaces
from impactfem.system.plate_mesh import (
    PlateMesh,
    apart_from_others,
    held_in_plane,
    held_slopes,
    led_vertices,
    mass_to_neighbours,
    net_between,
    plate_mesh,
)
from impactfem.system.plate_rows import free_basis, patches, pinned
from impactfem.system.plate_tips import held_vertices
from impactfem.system.plate_tones import first_frequency
from impactfem.system.regions import HeldRegion, Key


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
        rubs=any(law is not None and law.friction_coefficient for law in laws),
        regions=held_vertices(scene, plate, mesh, held_slopes(mesh, plate)[0]),
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
    rubs: bool = False,
    regions: Mapping[Key, HeldRegion] | None = None,
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
        rubs: Whether there is friction where it touches.
        regions: What joints hold of it, which does not touch.

    Raises:
        MeshError: It has an unknown edge, or no vertex is left that could move and have mass.
        SceneError: Its thickness is none, or too large for its theory, a stress buckles it, or it
            has fewer modes than ratios of damping.
    """
    thickness = thicknesses(plate, mesh)
    still, ways = held_slopes(mesh, plate)
    moved, moves = led_vertices(mesh, plate, still)
    count = len(mesh.points)
    loose = ~still
    for held in (regions or {}).values():
        loose[held.numbers] = False
    touch = np.flatnonzero(loose) if sprung else apart_from_others(mesh, loose)
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
    mass[~moves] = 0.0
    basis, deflected, vertex = free_basis(~moves, ways)
    led = deflected & still[vertex]
    triangles = Triangles(mesh, section, ratio, shears)
    reduced = csr_matrix(basis.T @ _sprung(plate, mesh, triangles.stiffness) @ basis)
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

    u = values(plate.displacement, "displacement").mean(0.0, 0.0)
    v = values(plate.velocity, "velocity").mean(0.0, 0.0).copy()
    v[still] = 0.0
    v = np.asarray(transfer @ v)  # of what has no mass the mean of its neighbours
    position = np.zeros(basis.shape[1])
    position[deflected] = u[vertex[deflected]]
    half, total = 0.5 * thickness[touch], float(own.sum())
    spots = csr_matrix(eye_array(count, format="csr")[touch])
    if patch is not None:
        spots = patches(mesh, touch, patch)
    faces = PlateFaces.of(spots, basis, axes, half, rubs=rubs)
    nodes = len(faces.arms)
    rest = np.tile(start[touch], (nodes // len(touch), 1)) + faces.arms
    radius = np.pad(half, (0, nodes - len(half)))

    def places(q: Floats) -> Floats:
        return np.asarray(rest + faces.moved(faces.told(q)))

    swinging = pinned(reduced, led), weight * ~(massless | led)
    first = first_frequency(*swinging)
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
        radius=radius,
        shell=radius,
        touching=np.arange(nodes) < len(touch),
        body=np.zeros(nodes, dtype=np.int64),
        lines=mesh.cells_of(touch) if sprung else net_between(mesh, touch),
        ends={},
        rate=lambda: OF_BENDING * first,
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
        damping=PlateDamping.of(plate, *swinging),
        turning=turning,
        shears=shears,
        thickness=thickness,
        transfer=transfer,
        on_faces=faces,
        touch=touch,
        loads=tuple(
            (FACES[load.face], values(load.acting, f"pressure on the {load.face}"))
            for load in plate.pressures
        ),
        obstacles=obstacles,
        curved=csr_matrix(triangles.curvatures @ basis),
        enclosed=bool(still[mesh.rim].all()),
        led=led,
        motions=tuple((np.isin(vertex, vertices) & led, formula) for vertices, formula in moved),
        membrane=Membrane(triangles, held_in_plane(mesh, plate)) if plate.stretches else None,
        regions=regions or {},
    )


def _sprung(plate: Plate, mesh: PlateMesh, stiffness: csr_matrix) -> csr_matrix:
    """A stiffness with that of springs at edges."""
    for support in plate.supports:
        springs = support.stiffness, support.rotational_stiffness
        if any(springs):
            stiffness = stiffness + edge_stiffness(mesh.points, mesh.edges[support.edge], *springs)
    return stiffness


def thicknesses(plate: Plate, mesh: PlateMesh) -> Floats:
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
    tension = triangles.assembled(triangles.tension(plate.section.thickness))
    unit = csr_matrix(basis.T @ tension @ basis)
    if stress < 0.0:
        start = np.ones(basis.shape[1])
        least = eigsh(stiffness, 1, unit, sigma=0.0, v0=start, return_eigenvectors=False)
        if -stress >= least[0]:
            raise SceneError(
                f"{where} buckles it, as {-least[0]:.4g} Pa do: give less, motions beyond are not "
                "modelled"
            )
    return stiffness + stress * unit
