"""How far the motion of solids is from that on other elements, and what this says of its error."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import ConvergenceError, ImpactError
from impactfem.log import Progress
from impactfem.planning import MarchNumbers, Plan
from impactfem.reference.bar import Errors, relative
from impactfem.result.table import Table
from impactfem.scene import Scene

if TYPE_CHECKING:
    from impactfem.runs.solid_rows import SolidsMotion

Floats = NDArray[np.float64]

COARSER = "runs on elements twice and four times as large"
FINER = "runs on elements half as large"
"""What estimated errors are measured against."""

SAFETY = 1.5
"""What an extrapolated error is multiplied by."""

ORDERS = (1.75, 2.5)
"""Ratios of two differences, 2^p, that are believed: a smaller one counts as the first, a larger
one as the second, since single pairs of runs can agree by chance."""

FALL = 1.25
"""Ratio of two differences from which a motion counts as regular."""

_ROUNDING = 1e-10  # relative difference of runs that do not differ


@dataclass(frozen=True)
class Track:
    """What two runs of solids are compared by.

    Attributes:
        times: t_m [s], shape (rows,).
        position: Centres of mass at t_m [m], those of all bodies side by side, shape
            (rows, 3 * bodies); then what `turned` gives of bodies that may turn far.
        force: Contact force during (t_{m-1}, t_m] [N], shape (rows,).
        moved: Ways of the same before t = 0, to where bodies rest [m].
    """

    times: Floats
    position: Floats
    force: Floats
    moved: Floats | float = 0.0

    @classmethod
    def of_history(
        cls,
        history: Table,
        names: Sequence[str],
        details: Mapping[str, Any] | None = None,
        turning: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> "Track":
        """Of the history of bodies, and what summaries tell of their start.

        Args:
            history: Of the run.
            names: Of the bodies.
            details: Of its summary.
            turning: Mass and inertia of those whose rotation counts.
        """
        moved = np.zeros((len(names), 3))
        for name, way in (details or {}).get("start", {}).get("moved", {}).items():
            moved[names.index(name), : len(way)] = way
        columns = [history[f"{name}.{axis}"].values for name in names for axis in "xyz"]
        for name, body in (turning or {}).items():
            columns += turned(history, name, body)
        force = history["contact_force"].values
        before = np.zeros(len(columns))
        before[: moved.size] = moved.ravel()
        return cls(history["time"].values, np.stack(columns, axis=1), force, before)

    def way(self, times: Floats) -> Floats:
        """Way of the centres [m], linear between levels, shape (times, 3 * bodies).

        It is that since t = 0, and before it that to where bodies rest.
        """
        moved = self.position - self.position[0] + self.moved
        return np.stack([np.interp(times, self.times, column) for column in moved.T], axis=1)

    def impulse(self, times: Floats) -> Floats:
        """Impulse of the contact force up to some times [N s], shape (times,)."""
        done = np.cumsum(self.force[1:] * np.diff(self.times))
        impulse: Floats = np.interp(times, self.times, np.concatenate([[0.0], done]))
        return impulse


def turning(scene: Scene, bodies: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Those of some bodies, by name, whose rotation counts: they may turn far."""
    return {body.name: bodies[body.name] for body in scene.bodies if body.turns_far}


def turned(history: Table, name: str, body: Mapping[str, Any]) -> list[Floats]:
    """Rotation of a body times its radius of gyration [m], as columns; none if it is held.

    They are the entries of the rotation matrix: two rotations are as far apart in them as the
    points of the body are in the mean square (in space, as if its inertia were that of a ball). Of
    mechanisms positions of the joints, by what each has to move at t = 0, and of a free base this.

    Args:
        history: Of the run.
        name: Of the body.
        body: Its mass and inertia, as ``summary.json`` has them.
    """
    given = body.get("inertia", 0.0)
    if isinstance(given, Mapping):  # of the joints of a mechanism
        each = ((f"{name}.{joint}", own / body["mass"]) for joint, own in given.items())
        return [column for joint, own in each for column in _jointed(history, joint, own)]
    inertia = np.atleast_2d(np.asarray(given, dtype=np.float64))
    if f"{name}.angle" in history:
        radius, angle = np.sqrt(inertia[0, 0] / body["mass"]), history[f"{name}.angle"].values
        return [radius * np.cos(angle), radius * np.sin(angle)]
    if f"{name}.qw" not in history:
        return []
    return _rotation(history, name, float(np.trace(inertia)) / (3.0 * body["mass"]))


def _jointed(history: Table, joint: str, own: float) -> list[Floats]:
    """Motion in a joint [m], by the square of the radius of gyration of what it moves [m^2]."""
    if f"{joint}.qw" in history:
        return _rotation(history, joint, own)
    return [np.sqrt(own) * history[f"{joint}.q"].values]


def _rotation(history: Table, name: str, own: float) -> list[Floats]:
    """Entries of a rotation matrix [m], by the square of a mean radius of gyration [m^2]."""
    scale = np.sqrt(0.5 * own)
    w, x, y, z = (history[f"{name}.q{letter}"].values for letter in "wxyz")
    entries = [
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w),
        2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w),
        2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y),
    ]  # fmt: skip
    return [scale * entry for entry in entries]


def estimate_error(
    scene: Scene, chosen: Plan[MarchNumbers], motion: "SolidsMotion"
) -> tuple[Errors | None, dict[str, Any]]:
    """Run the scene on other elements and tell the error from the differences (collective).

    On elements 2 h and 4 h, where all of them can be made larger: see `extrapolated`. On h / 2
    where there is a mesh file: e(h) is the difference over 1 - 2^-p, told as for p = 1.

    Args:
        scene: The scene as used, with the degree of each body.
        chosen: Its plan.
        motion: What this plan gave.

    Returns:
        The errors, or None if the runs do not allow to tell them; and what the runs were, cost and
        said, for the summary.
    """
    begin = time.perf_counter()
    own = _track(scene, motion)
    factors = (2.0, 4.0) if can_be_resized(scene) else (0.5,)
    tracks = []
    for factor in factors:
        try:
            tracks.append(_run(scene, chosen, factor))
        except ImpactError as error:
            return None, {"message": f"the run on elements {factor:g} times as large: {error}"}
    found: Errors | None
    if len(tracks) == 1:
        apart = difference(tracks[0], own, FINER)
        found, note = apart.times(2.0, 2.0), {"message": "from a run on elements half as large"}
    else:
        near = difference(own, tracks[0], COARSER)
        found, note = extrapolated(near, difference(tracks[0], tracks[1], COARSER))
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
    if near.displacement_max <= _ROUNDING:
        return near, {"message": "runs on larger elements do not differ"}
    ratio = far.displacement_max / near.displacement_max
    seen = f"{near.displacement_max:.2g} from elements 2 h to h, after {far.displacement_max:.2g}"
    if not ratio >= FALL:
        return None, {
            "message": f"the motion changes by {seen} from 4 h to 2 h: what does not fall by "
            f"{FALL:g} tells no error; take smaller elements, or a shorter duration",
        }
    force = far.force_l1 / max(near.force_l1, _ROUNDING)
    found = near.times(_share(ratio), _share(force))
    return found, {"message": f"from runs on larger elements: the motion changes by {seen}"}


def _share(ratio: float) -> float:
    """The error over a difference, if differences fall by a ratio."""
    least, most = ORDERS
    believed = min(ratio, most) if ratio > least else least
    return SAFETY / (believed - 1.0)


def can_be_resized(scene: Scene) -> bool:
    """Whether all bodies are meshed by this run, so that their elements can be made larger."""
    return all(body.mesh_size is not None for body in scene.meshed)


def _run(scene: Scene, chosen: Plan[MarchNumbers], factor: float) -> Track:
    """The scene on elements so many times as large, with steps as much larger."""
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
    with resized(scene, factor) as other:
        motion, _ = run_solids(other, replace(chosen, numbers=numbers), Progress())
    if not motion.effort.converged:
        raise ConvergenceError(motion.effort.message)
    return _track(scene, motion)


def _track(scene: Scene, motion: "SolidsMotion") -> Track:
    names = [body.name for body in scene.bodies]
    effort = motion.effort
    return Track.of_history(motion.history, names, effort.details, turning(scene, effort.bodies))


@contextmanager
def resized(scene: Scene, factor: float) -> Iterator[Scene]:
    """The scene on elements so many times as large, steps left to the plan, without output.

    Mesh files are only refined: elsewhere than within this context the finer ones are gone.

    Raises:
        MeshError: A mesh file cannot be refined.
    """
    with ExitStack() as files:
        others = {body.name: _with_size(scene, body, factor, files) for body in scene.meshed}
        bodies = tuple(others.get(body.name, body) for body in scene.bodies)
        settings = replace(scene.solve, dt=None, courant=None, estimate=False)
        output = replace(scene.output, fields=(), checkpoint=0)
        yield replace(scene, bodies=bodies, probes=(), solve=settings, output=output)


def _with_size(scene: Scene, body: Any, factor: float, files: ExitStack) -> Any:
    """The body with elements so many times as large."""
    if body.mesh_size is None:
        from impactfem.fem import MPI  # noqa: PLC0415
        from impactfem.mesh.body_files import refined  # noqa: PLC0415

        path = Path(scene.folder or "", str(body.mesh))
        finer = files.enter_context(refined(MPI.COMM_WORLD, path, body.mesh_dim))
        return replace(body, mesh=finer)
    return body.with_elements(factor)


def difference(fine: Track, coarse: Track, reference: str) -> Errors:
    """Difference of two runs at the times and in the layers of the coarser one.

    Displacements are those of the centres of mass, and of bodies under finite strain those of
    their points by rotation (root mean square), linear between the levels of the finer run;
    forces are compared by their impulse in each layer, which is exact as they are constant there.

    Args:
        fine: The run with shorter layers.
        coarse: The other one.
        reference: What the errors are measured against, in words.
    """
    end = min(fine.times[-1], coarse.times[-1])
    times = coarse.times[coarse.times <= end * (1.0 + 1e-12)]
    way = fine.way(times)
    apart = np.linalg.norm(way - coarse.way(times), axis=1)
    length = np.linalg.norm(way, axis=1)
    weights = np.diff(times, prepend=times[0]) + np.diff(times, append=times[-1])
    impulses, others = (np.diff(track.impulse(times)) for track in (fine, coarse))
    return Errors(
        reference,
        relative(apart.max(), length.max()),
        relative(np.sqrt(weights @ apart**2), np.sqrt(weights @ length**2)),
        relative(np.abs(impulses - others).sum(), impulses.sum()),
    )
