"""How far the motion of solids is from that on other elements, and what this says of its error."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.errors import ConvergenceError, ImpactError, SceneError
from impactfem.log import Progress
from impactfem.planning import MarchNumbers, Plan
from impactfem.reference.bar import Errors
from impactfem.runs.accelerations import longest_row
from impactfem.runs.samples import Places
from impactfem.runs.tracks import Track, difference
from impactfem.scene import Scene

if TYPE_CHECKING:
    from impactfem.runs.solid_rows import SolidsMotion

COARSER = "runs on elements twice and four times as large"
LONGER = "runs with steps twice and four times as long"
FINER = "runs on elements half as large"
"""What estimated errors are measured against."""

SAFETY = 1.25
"""What an extrapolated error is multiplied by."""

ORDERS = (1.75, 3.0)
"""Ratios of two differences, 2^p, that are believed: a smaller one counts as the first, a larger
one as the second, since single pairs of runs can agree by chance."""

FALL, SMALL = 1.25, 0.1
"""Ratio of two differences from which a motion counts as regular, or else the largest of them: on
meshes that it hardly depends on runs agree by chance."""

_ROUNDING = 1e-10  # relative difference of runs that do not differ


def estimate_error(
    scene: Scene, chosen: Plan[MarchNumbers], motion: "SolidsMotion"
) -> tuple[Errors | None, dict[str, Any]]:
    """Run the scene on other elements and tell the error from the differences (collective).

    On elements 2 h and 4 h, where all of them can be made larger: see `extrapolated`. On h / 2
    where the plan says so: e(h) is the difference over 1 - 2^-p, told as for p = 1.

    Args:
        scene: The scene as used, with the degree of each body.
        chosen: Its plan.
        motion: What this plan gave.

    Returns:
        The errors, or None if the runs do not allow to tell them; and what the runs were, cost and
        said, for the summary.
    """
    begin = time.perf_counter()
    own = Track.of_motion(scene, motion)
    tracks = []
    for factor in chosen.numbers.resizing:
        try:
            tracks.append(rerun(scene, chosen, factor, motion.places, own))
        except (ImpactError, ArithmeticError, ValueError, RuntimeError, MemoryError) as error:
            return None, {"message": f"the run on elements {factor:g} times as large: {error}"}
    found: Errors | None
    if len(tracks) == 1:
        apart = difference(tracks[0], own, FINER)
        each = {name: None if one is None else 2.0 * one for name, one in apart.probes.items()}
        found = replace(apart.times(2.0, 2.0), probes=each)
        note = {"message": "from a run on elements half as large"}
    else:
        words = COARSER if scene.resized else LONGER
        near = difference(own, tracks[0], words)
        found, note = extrapolated(near, difference(tracks[0], tracks[1], words))
    if found is not None:
        found = replace(found, probes={name: found.probes.get(name) for name in sorted(own.told)})
    steps = sum(len(track.times) - 1 for track in tracks)
    return found, note | {"seconds": time.perf_counter() - begin, "num_steps": steps}


def extrapolated(near: Errors, far: Errors) -> tuple[Errors | None, dict[str, Any]]:
    """The error that two differences tell, from runs on h, 2 h and 4 h.

    For an error e(h) = C h^p they are (2^p - 1) e(h) and (2^p - 1) e(2 h), so that their ratio is
    2^p and e(h) the first over 2^p - 1. A ratio seen once is uncertain: it is kept within `ORDERS`,
    and the error multiplied by `SAFETY`. Measured in benchmarks/estimates.py.

    Args:
        near: Difference of the runs on h and 2 h.
        far: Difference of those on 2 h and 4 h.

    Returns:
        The errors, None if the differences do not fall by `FALL`; and why, for the summary.
    """
    probes = {name: _told(own, far.probes.get(name)) for name, own in near.probes.items()}
    if near.displacement_max <= _ROUNDING:
        return replace(near, probes=probes), {"message": "coarser runs do not differ"}
    seen = f"{near.displacement_max:.2g} from 2 h to h, after {far.displacement_max:.2g} from 4 h"
    share = _share(near.displacement_max, far.displacement_max)
    if share is None:
        return None, {
            "message": f"the motion changes by {seen}: what does not fall by {FALL:g} tells no "
            "error; take smaller elements or steps, or a shorter duration",
        }
    if _falls(near.displacement_max, far.displacement_max):
        force = _extrapolation(far.force_l1 / max(near.force_l1, _ROUNDING))
        message = f"from coarser runs: the motion changes by {seen}"
    else:
        force, message = 2.0, f"twice what the motion changes by: {seen}"
    return replace(near.times(share, force), probes=probes), {"message": message}


def _told(near: float | None, far: float | None) -> float | None:
    """The error that two differences tell; None if they tell none."""
    if near is None or far is None or not math.isfinite(near):
        return None
    share = _share(near, far)
    return None if share is None else share * near


def _falls(near: float, far: float) -> bool:
    """Whether differences fall with the elements."""
    return far >= FALL * near


def _share(near: float, far: float) -> float | None:
    """The error over the nearer of two differences; None if these do not allow to tell it."""
    if near <= _ROUNDING:
        return 1.0
    if _falls(near, far):
        return _extrapolation(far / near)
    largest = max(near, far)
    return 2.0 * largest / near if largest <= SMALL and math.isfinite(far) else None


def _extrapolation(ratio: float) -> float:
    """The error over a difference, if differences fall by a ratio."""
    least, most = ORDERS
    believed = min(ratio, most) if ratio > least else least
    return SAFETY / (believed - 1.0)


def rerun(
    scene: Scene, chosen: Plan[MarchNumbers], factor: float, places: Places, own: Track
) -> Track:
    """The scene on elements so many times as large, with steps as much larger.

    Probes whose filter takes shorter steps tell nothing there, and none if one of them is outside
    its body, from which larger elements cut corners off.

    Args:
        scene: See `estimate_error`.
        chosen: Likewise.
        factor: How many times as large elements are.
        places: Of bodies whose way is kept.
        own: What the scene's own run is compared by.
    """
    from impactfem.runs.solids import run_solids  # noqa: PLC0415  (loads DOLFINx)

    numbers = chosen.numbers
    explicit = numbers.linear_solver == "none"  # steps follow from the stiffness anyway
    numbers = replace(
        numbers,
        mesh_size=factor * numbers.mesh_size,
        dt=None if explicit or numbers.dt is None else factor * numbers.dt,
        courant=numbers.courant or (0.9 if explicit else None),
        layers=None,
        estimate=False,
    )
    step = 1.2 * factor * float(np.diff(own.times).max(initial=0.0))  # those of meshes differ a bit
    probes = tuple(probe for probe in scene.probes if step <= longest_row(probe))
    with resized(scene, factor, numbers.unresized) as other:
        changed, quiet = replace(chosen, numbers=numbers), Progress()
        try:
            seen = replace(other, probes=probes)
            motion, _ = run_solids(seen, changed, quiet, places=places)
        except SceneError:
            if not probes:
                raise
            motion, _ = run_solids(other, changed, quiet, places=places)
    if not motion.effort.converged:
        raise ConvergenceError(motion.effort.message)
    return Track.of_motion(replace(other, probes=probes), motion)


@contextmanager
def resized(scene: Scene, factor: float, kept: Sequence[str] = ()) -> Iterator[Scene]:
    """The scene on elements so many times as large, steps left to the plan, without output.

    Mesh files are only refined: elsewhere than within this context the finer ones are gone.

    Raises:
        MeshError: A mesh file cannot be refined.
    """
    with ExitStack() as files:
        others = {
            body.name: _with_size(scene, body, factor, files)
            for body in scene.resized
            if body.name not in kept
        }
        bodies = tuple(others.get(body.name, body) for body in scene.bodies)
        settings = replace(scene.solve, dt=None, courant=None, estimate=False)
        output = replace(scene.output, fields=(), checkpoint=0)
        yield replace(scene, bodies=bodies, probes=(), solve=settings, output=output)


def _with_size(scene: Scene, body: Any, factor: float, files: ExitStack) -> Any:
    """The body with elements so many times as large."""
    if body.meshed and body.mesh_size is None:
        from impactfem.fem import MPI  # noqa: PLC0415
        from impactfem.mesh.body_files import refined  # noqa: PLC0415

        path = Path(scene.folder or "", str(body.mesh))
        finer = files.enter_context(refined(MPI.COMM_WORLD, path, body.mesh_dim))
        return replace(body, mesh=finer)
    return body.with_elements(factor)
