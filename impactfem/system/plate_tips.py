"""Regions of plates as joints hold them: rigid tips in the mean, as those of surfaces of solids.

Vertices move along the normal alone, so that a tip takes the force along it and both moments across
it; in its plane a plate is rigid and at rest, and takes what acts there as a support does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from impactfem.arrays import Booleans, Floats
from impactfem.scene import Scene
from impactfem.scene.laws import side_of
from impactfem.scene.plate import Plate
from impactfem.system.kirchhoff import DOFS
from impactfem.system.plate_mesh import PlateMesh
from impactfem.system.regions import HeldRegion, HeldRegions, Key, region
from impactfem.system.stations import Asked, Stations


def held_vertices(
    scene: Scene, plate: Plate, mesh: PlateMesh, still: Booleans
) -> Mapping[Key, HeldRegion]:
    """What joints hold of a plate.

    Args:
        scene: With the joints.
        plate: The plate.
        mesh: Of its mid-surface.
        still: Vertices that supports hold.

    Raises:
        KeyedError: A region is empty or shared.
    """
    center, axes = plate.frame
    points, areas = center + mesh.points @ axes[:2], mesh.lumped(np.ones(len(mesh.cells)))
    found = HeldRegions()

    for index, joint in enumerate(scene.couplings):
        for side, place in zip(joint.between or (), joint.places, strict=False):
            if side_of(side)[0] != plate.name:
                continue
            where = scene.table_of(index), side
            at = np.asarray(place)
            own = region(at, points, mesh.cells, joint.radius, areas, ~still, where)
            kept = np.flatnonzero(own.nodes)
            made = HeldRegion(kept, points[kept], areas[kept], len(points), own.radius, own.why)
            key = side, tuple(float(x) for x in place), joint.radius
            found.add(index, joint.name, key, made, alone=scene.holds_alone(index))
    return found.regions


def plate_stations(
    asked: Sequence[Asked], regions: Mapping[Key, HeldRegion], axes: Floats, basis: csr_matrix,
    weight: Floats, velocity: Floats,
) -> Stations:  # fmt: skip
    """Stations of a plate, one for each region.

    Args:
        asked: Sides of joints.
        regions: What they hold.
        axes: Of the plate, (3, 3) by rows.
        basis: W and slopes of all vertices by q.
        weight: Mass of q, (d,).
        velocity: Rates of q at t = 0, (d,).
    """
    keys = [(name, tuple(place.tolist()), radius) for name, place, radius in asked]
    alone = list(dict.fromkeys(keys))
    places, rows = [], []
    for key in alone:
        held = regions[key]
        mean, moving = held.tip()
        place, own = np.array(key[1]), moving @ axes[2]
        own[:3] += np.cross(own[3:], place - mean, axis=0)  # of the joint's place
        places.append(place)
        rows.append(own @ basis[DOFS * held.numbers].toarray())
    every = np.array(rows)
    light = np.divide(1.0, weight, where=weight > 0.0, out=np.zeros_like(weight))
    found = Stations.along(
        tuple(alone.index(key) for key in keys), tuple(name for name, *_ in alone),
        np.array(places), every, light[:, None] * every.reshape(-1, len(weight)).T, velocity,
    )  # fmt: skip
    return replace(found, freedoms=int((weight > 0.0).sum()), given=(), axes=axes)
