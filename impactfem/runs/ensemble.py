"""Many motions of one rigid body from different starts, by one compiled loop."""

import os
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import solve_cones
from impactfem.errors import ConvergenceError, ImpactWarning, SceneError
from impactfem.marching.lone_kernels import DONE, TURNS, WAITS, march_members, starts
from impactfem.marching.rubbing import frames
from impactfem.models.solids import SolidsModel, solids_model
from impactfem.planning import plan
from impactfem.planning.solid_plan import MarchNumbers
from impactfem.runs.loops import rounding
from impactfem.runs.members import Members, read_members
from impactfem.scene import Contact, Scene
from impactfem.scene.pairing import law_of
from impactfem.system.rigid import in_space
from impactfem.vibro.ensemble import EnsembleResult
from impactfem.vibro.vibro_rows import row_levels, row_times

_INSIDE = 1e-12  # share of the largest coordinate that a place may lie in a plane at t = 0
_SYSTEMS = 10000  # linear ones of a step whose forces are hard to find
_CHUNKS = 4  # parts of the members by thread


class _Fixed(NamedTuple):
    """What all members share; see `impactfem.marching.lone_kernels`."""

    body: tuple[Any, ...]
    places: tuple[Any, ...]
    planes: tuple[Floats, Floats]
    laws: tuple[Contact | None, ...]


def solve_ensemble(
    scene: Scene | str | Path,
    *,
    position: ArrayLike | None = None,
    angle: ArrayLike | None = None,
    orientation: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
    friction_coefficient: ArrayLike | None = None,
    restitution: ArrayLike | None = None,
    every: int | None = None,
    threads: int | None = None,
    **settings: Any,
) -> EnsembleResult:
    """Solve a scene of one rigid body and half-spaces at rest from n starts, each as `solve` would.

    What is not given is that of the scene.

    Args:
        scene: Scene, or its file.
        position: Centres of mass at t = 0 [m], (n, dim).
        angle: Angles of the body at t = 0 in the plane [rad], (n,).
        orientation: The same in space, quaternions (w, x, y, z) of length 1, (n, 4).
        velocity: Of the centre at t = 0 [m/s], (n, dim).
        angular_velocity: At t = 0 along the axes of the scene [rad/s], (n,), in space (n, 3).
        friction_coefficient: Of all pairs (n,), or of each half-space as the scene lists them,
            (n, J).
        restitution: Likewise.
        every: Steps between two kept levels; None for the start and the end alone.
        threads: That share the members; None: one for each processor.
        **settings: Keys of the scene's ``[solve]`` table that replace its own.

    Returns:
        Places are centres with the angle (n, rows, 3) or the quaternion (n, rows, 7), velocities
        those of the centre and the spin along the axes of the scene, (n, rows, 3 or 6); gaps and
        normal impulses are of the J half-spaces. Rows of members that stopped early are NaN from
        there on; ``details["failed"]`` says why, and a warning tells how many.

    Raises:
        SceneError: The scene is another one, or a start cannot be; it names the member.
        ConvergenceError: All members stopped early: forces were not found, or a body turned too
            far in a step.
    """
    found = scene if isinstance(scene, Scene) else Scene.from_toml(scene)
    found = found.with_settings({f"solve.{key}": value for key, value in settings.items()})
    if every is not None and every < 1:
        raise SceneError(f"every = {every}: give a number >= 1 of steps between two rows")
    numbers = plan(found).numbers
    if not isinstance(numbers, MarchNumbers):
        _refuse(f"its bodies are {', '.join(body.kind for body in found.bodies)}")
    fixed = _fixed(solids_model(found, (), updated=True))
    (body,) = found.bodies
    members = read_members(
        body, fixed.laws, position=position, angle=angle, orientation=orientation,
        velocity=velocity, angular_velocity=angular_velocity,
        friction_coefficient=friction_coefficient, restitution=restitution,
    )  # fmt: skip
    return _march(found, fixed, members, numbers, every, threads or os.cpu_count() or 1)


def _refuse(why: str) -> NoReturn:
    raise SceneError(
        "solve_ensemble takes one rigid body that touches half-spaces at rest, on which gravity "
        f"acts; of this scene {why}: use solve for each start, or integrate_ensemble for linear "
        "systems"
    )


def _fixed(model: SolidsModel) -> _Fixed:
    """What of a scene is the same for all members.

    Raises:
        SceneError: There are other bodies, obstacles or laws.
    """
    scene, lone = model.scene, model.few[0].lone if len(model.few) == 1 else None
    if len(scene.bodies) != 1 or lone is None or model.joints is not None:
        names = ", ".join(body.name for body in scene.bodies)
        _refuse(f"{names} is not one body, or is held, driven, met by faces or not rigid")
    if scene.starts_at_rest:
        _refuse(f"it starts {scene.start!r}")
    if scene.solve.impact_law == "sequential":
        _refuse('solve.impact_law = "sequential"')
    nodes, planes, laws = [], [], []
    for met in model.obstacle_meetings:
        obstacle = met.gaps.single
        plane = None if obstacle is None or obstacle.moves else obstacle.plane
        if plane is None:
            _refuse(f"obstacle {met.names[1]} is no half-space, or moves")
        law = law_of(scene, *met.names)
        others = () if law is None else _others(law)
        if law is not None and others:
            _refuse(f"the contact of {met.names[1]} has {', '.join(others)}")
        nodes.append(met.nodes)
        planes.append(plane)
        laws.append(law)
    if len(planes) < len(scene.rigid_obstacles) or not planes:
        _refuse("an obstacle is met by faces, or there is no half-space")
    own = np.concatenate(nodes)
    of = np.repeat(np.arange(len(nodes)), [len(each) for each in nodes])
    rims, shell = len(lone.shares) > 0, model.few[0].shell[own]
    shares = lone.shares[own] if rims else np.zeros((len(own), 2))
    far = np.linalg.norm(lone.arms[own], axis=1) + np.linalg.norm(shares, axis=1) + shell
    reach = np.array([far[of == j].max() for j in range(len(planes))])
    normals = np.array([plane.normal for plane in planes], dtype=float)
    return _Fixed(
        (lone.mass, lone.inertia, np.linalg.inv(lone.inertia), lone.free),
        (lone.arms[own], shell, lone.rolling[own], shares, lone.axis, rims, of, reach),
        (in_space(frames(normals)), in_space(np.array([plane.point for plane in planes]))),
        tuple(laws),
    )  # fmt: skip


def _others(law: Contact) -> list[str]:
    """What of a law has no compiled step."""
    found = {
        "static_friction_coefficient": law.sticking != law.friction_coefficient,
        "rolling_resistance": law.rolling_resistance > 0.0,
        "spinning_resistance": law.spinning_resistance > 0.0,
        f'restitution_law = "{law.restitution_law}"': not law.is_newton,
        "stiffness": law.stiffness is not None,
    }
    return [name for name, there in found.items() if there]


def _march(
    scene: Scene, fixed: _Fixed, members: Members, numbers: Any, every: int | None, threads: int
) -> EnsembleResult:
    """March all members."""
    dt, steps, n = numbers.dt, numbers.layers, len(members.centre)
    dim, count = fixed.planes[0].shape[1], len(fixed.planes[1])
    turns, nodes = members.angles.shape[1], len(fixed.places[0])
    across = np.eye(3)[np.argmin(np.abs(fixed.places[4]))]
    known = members.rotated(np.cross(fixed.places[4], across))
    lowest = np.repeat(known[:, None], count, axis=1)
    states = (
        members.centre, members.angles, members.speed, members.spin,
        np.zeros((n, nodes, dim)), lowest,
    )  # fmt: skip
    gaps, size, speed = starts(fixed.places, fixed.planes, states)
    if len(bad := np.flatnonzero((gaps < -_INSIDE * np.maximum(1.0, size)[:, None]).any(axis=1))):
        deep = -gaps[bad[0]].min()
        raise SceneError(f"member {bad[0]}: it is {deep:.6g} m inside a plane at t = 0; move it")
    size = np.maximum(size, fixed.places[1].max())
    tolerance = numbers.tolerance * np.maximum(size, rounding(scene, speed, dt))
    levels = row_levels(steps, every or steps)
    rows = (
        np.zeros((n, len(levels), dim + turns)),
        np.zeros((n, len(levels), dim + dim * (dim - 1) // 2)),
        np.zeros((n, len(levels), count)),
        np.zeros((n, len(levels), count)),
    )
    logs = np.zeros((n, count)), gaps.min(axis=1)
    laws = (*members.laws, tolerance)
    span = steps, every or steps
    shared = span, dt, _pulls(scene, dt, steps), *fixed[:3], laws, states, logs

    failed: dict[int, str] = {}

    def some(first: int, beyond: int) -> int:
        handing = (
            np.zeros((nodes * dim, nodes * dim)), np.zeros((nodes, dim)), np.zeros(nodes),
            np.full((nodes, dim), np.nan),
        )  # fmt: skip
        begins, handed = (first, 0), 0
        while True:
            member, m, why = march_members(begins, beyond, *shared, handing, rows)
            if why == DONE:
                return handed
            begins, handed = (member, m), handed + (why == WAITS)
            try:
                if why == TURNS:
                    raise ConvergenceError("it turns too far in a step")
                _solve_elsewhere(handing, tolerance[member])
            except ConvergenceError as error:
                failed[member] = f"t = {m * dt:.6g} s: {error}"
                for row in rows:
                    row[member, np.searchsorted(levels, m, side="right") :] = np.nan
                begins = member + 1, 0

    cuts = np.linspace(0, n, min(n, 1 if threads == 1 else _CHUNKS * threads) + 1).astype(int)
    with ThreadPoolExecutor(threads) as pool:
        handed_back = sum(pool.map(some, cuts[:-1].tolist(), cuts[1:].tolist()))
    lost = np.flatnonzero(~np.isfinite(rows[1][:, -1]).all(axis=1)).tolist()
    failed |= {k: "the motion is not finite" for k in lost if k not in failed}
    if failed:
        first = min(failed)
        text = f"{len(failed)} of {n} members stopped early, the first is member {first}, "
        text += f"{failed[first]}; use a smaller solve.dt"
        if len(failed) == n:
            raise ConvergenceError(text)
        warnings.warn(text, ImpactWarning, stacklevel=3)
    details = {"dt": dt, "handed_back": handed_back, "failed": dict(sorted(failed.items()))}
    deepest = np.maximum(0.0, -logs[1])
    return EnsembleResult(row_times(levels, dt), *rows, deepest, details)


def _solve_elsewhere(handing: tuple[Floats, ...], tolerance: float) -> None:
    """Find forces that are hard to find.

    Raises:
        ConvergenceError: None were found.
    """
    matrix, offset, friction, known = handing
    count = int(np.isfinite(friction).sum())
    wide = count * offset.shape[1]
    problem = ConeProblem(
        matrix[:wide, :wide].copy(), offset[:count].copy(), friction[:count].copy(),
        np.zeros(count),
    )  # fmt: skip
    known[:count] = solve_cones(problem, known[:count].copy(), tolerance, _SYSTEMS)[0]


def _pulls(scene: Scene, dt: float, steps: int) -> Floats:
    """Gravity of each step [m/s^2], of all one where it is constant, (1 or steps, 3)."""
    gravity = scene.vector_gravity
    if gravity.is_constant:
        return in_space(np.array(gravity.values[:1], dtype=float))
    return in_space(np.array([gravity.mean(m * dt, (m + 1) * dt) for m in range(steps)]))
