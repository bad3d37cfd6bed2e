"""Natural frequencies of a body of a scene, as its model has them."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_matrix

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.planning import plan
from impactfem.scene import Bar, Beam, Plate, Scene, Solid
from impactfem.scene.values import show

_COUNT = 12
_RIGID = 1e-6  # of the largest of the squares, below which motions are rigid


def natural_frequencies(scene: Scene, name: str) -> Floats:
    """The 12 lowest natural frequencies of a body without contact and rigid motions [Hz].

    Of beams, plates and solids those of the mesh, without damping and large strains, as they are
    held; of uniform bars the exact ones.

    Args:
        scene: The scene.
        name: Of the body.

    Raises:
        SceneError: There is no such body, or it has none.
    """
    bodies = {body.name: body for body in scene.bodies}
    body = bodies.get(name)
    if body is None:
        known = ", ".join(bodies)
        raise SceneError(f"spectrum: there is no body {show(name)}; give one of {known}")
    told = _TOLD.get(type(body))
    if told is None:
        raise SceneError(
            f"spectrum: {show(name)} is a {body.kind}, which has no modes of its own here: give a "
            "bar, beam, plate or solid"
        )
    return told(scene, body, _COUNT)


def _of_beam(_: Scene, beam: Beam, count: int) -> Floats:
    from impactfem.system.beam_parts import beam_parts  # noqa: PLC0415

    parts = beam_parts(beam)
    return _sounding(eigh(parts.stiffness, parts.mass, eigvals_only=True), count)


def _of_plate(scene: Scene, plate: Plate, count: int) -> Floats:
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.system.plate_tones import vibrations  # noqa: PLC0415

    model = solids_model(scene, plan(scene).numbers.degrees)
    few: Any = next(few for few in model.few if plate.name in few.names)
    stiffness, mass = few.swinging
    return np.asarray(vibrations(stiffness, mass, count)[0] / (2.0 * np.pi))


def _of_solid(scene: Scene, solid: Solid, count: int) -> Floats:
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)

    model = solids_model(scene, plan(scene).numbers.degrees)
    part = next(part for part in model.parts if part.solid.name == solid.name)
    return _of_matrices(part.system, count)


def _of_matrices(system: Any, count: int) -> Floats:
    """Of a solid, by shifted inversion."""
    from scipy.sparse.linalg import eigsh  # noqa: PLC0415

    free = np.flatnonzero(~system.constrained)
    both = system.stiffness, system.mass
    stiffness, mass = (_sparse(each)[free][:, free].tocsc() for each in both)
    scale = float(np.median(stiffness.diagonal()) / np.median(mass.diagonal()))
    most = min(count + 6, len(free) - 1)
    squares = eigsh(
        stiffness, most, mass, sigma=-1e-8 * scale, v0=np.ones(len(free)), return_eigenvectors=False
    )
    return _sounding(squares, count)


def _sparse(matrix: Any) -> csr_matrix:
    """A matrix of PETSc."""
    starts, columns, values = matrix.getValuesCSR()
    return csr_matrix((values, columns, starts), shape=matrix.getSize())


def _of_bar(_: Scene, bar: Bar, count: int) -> Floats:
    if bar.profile is not None:
        raise SceneError(
            f"spectrum: modes of {show(bar.name)} are told of bars that are the same along their "
            "length only; leave --modes out"
        )
    waves = np.arange(1, count + 1) - 0.5 * (bar.far_end == "clamped")
    return np.asarray(waves * bar.wave_speed / (2.0 * bar.length))


def _sounding(squares: Floats, count: int) -> Floats:
    """Frequencies [Hz] of squares of angular ones without those of rigid motions."""
    ordered = np.sort(np.real(squares))[: count + 6]
    first = int((ordered <= _RIGID * ordered[-1]).sum())
    return np.asarray(np.sqrt(ordered[first : first + count]) / (2.0 * np.pi))


_TOLD: Mapping[type[Any], Callable[[Scene, Any, int], Floats]] = {
    Bar: _of_bar, Beam: _of_beam, Plate: _of_plate, Solid: _of_solid,
}  # fmt: skip
"""Who tells the frequencies of each kind of body."""
