"""How often 95 % intervals of identified parameters hold the truth (an hour of one core).

    python benchmarks/intervals.py [--seeds 100] [--out benchmarks/results] [NAME ...]

Writes intervals.md with its stamp. Data are motions of the truth with noise of a known standard
deviation: from runs, or a closed form. Each seed is identified from the same wrong start, with the
standard deviation as it is and once more with half of it, where intervals must fail.
"""

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stamp import RESULTS, write_stamp

import impactfem
from impactfem import Scene
from impactfem.inverse.varied import Varied
from impactfem.studies.study import markdown_table

Floats = NDArray[np.float64]
G = 9.81
QUIET = {"report": False, "pictures": False, "fields": []}


@dataclass(frozen=True)
class Problem:
    """Something to identify.

    Attributes:
        name: As it is shown.
        scene: With parameters and one measure, whose data are "data.csv".
        truth: Of the parameters, by name.
        times: Of the data [s].
        sigma: Of the noise.
        values: Data without noise at the times; None: those of a run.
    """

    name: str
    scene: dict[str, Any]
    truth: dict[str, float]
    times: Floats
    sigma: float
    values: Callable[[Floats], Floats] | None = None


def ball() -> Problem:
    """Drag and restitution of a thrown ball from its heights, 50 a second for 8 s."""
    drag = [f"-c*{v}*sqrt(vx*vx + vy*vy)" for v in ("vx", "vy")]
    scene = {
        "duration": 8.0, "gravity": [0.0, -G],
        "body": [{"kind": "point", "name": "ball", "mass": 0.06, "position": [0.0, 2.0],
                  "velocity": [1.0, 4.0], "force": drag}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "contact": [{"between": ["ball", "floor"], "restitution": 0.7}],
        "parameter": [{"name": "c", "start": 0.0012, "bounds": [1e-5, 0.02]},
                      {"name": "e", "key": "contact.0.restitution", "bounds": [0.1, 1.0]}],
        "measure": [{"name": "heights", "of": "ball.y"}],
    }  # fmt: skip
    return Problem(
        "thrown ball, heights", scene, {"c": 0.0015, "e": 0.75}, np.arange(0.02, 8.0, 0.02), 0.05
    )


def block() -> Problem:
    """Friction and first speed of a block that slides to rest, from its places."""
    scene = {
        "duration": 1.0, "gravity": [0.0, -G],
        "body": [{"kind": "rigid", "name": "block", "density": 500.0,
                  "shape": {"kind": "block", "size": [0.4, 0.1], "corner": [-0.2, 0.0]},
                  "velocity": [1.5, 0.0]}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "contact": [{"between": ["block", "floor"], "friction_coefficient": 0.35}],
        "parameter": [{"name": "mu", "key": "contact.0.friction_coefficient",
                       "bounds": [0.05, 1.0]},
                      {"name": "v", "key": "body.block.velocity.0", "bounds": [0.5, 5.0]}],
        "measure": [{"name": "places", "of": "block.x"}],
    }  # fmt: skip
    mu, v = 0.25, 1.8

    def places(t: Floats) -> Floats:
        end = np.minimum(t, v / (mu * G))
        return np.asarray(v * end - 0.5 * mu * G * end**2)

    truth, times = {"mu": mu, "v": v}, np.arange(0.01, 1.0, 0.01)
    return Problem("sliding block, places", scene, truth, times, 2e-3, places)


def bar() -> Problem:
    """Gap and speed of a bar from the impulse that the wall has taken."""
    scene = {
        "duration": 3.0,
        "body": [{"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "area": 1.0,
                  "youngs_modulus": 1.0, "gap": 0.45, "velocity": "-v"}],
        "obstacle": [{"kind": "wall", "name": "wall"}],
        "parameter": [{"name": "gap", "key": "body.bar.gap", "bounds": [0.1, 0.9]},
                      {"name": "v", "start": 0.55, "bounds": [0.2, 2.0]}],
        "measure": [{"name": "pushed", "of": "impulse.bar.wall"}],
    }  # fmt: skip

    def pushed(t: Floats) -> Floats:
        return 0.5 * np.clip(t - 1.0, 0.0, 2.0)  # Z v for 2 L/c from gap/v on

    truth = {"gap": 0.5, "v": 0.5}
    return Problem("bar, impulse", scene, truth, np.arange(0.05, 3.0, 0.05), 0.01, pushed)


PROBLEMS = {"ball": ball, "block": block, "bar": bar}


def data_of(problem: Problem, folder: Path) -> Floats:
    """Data without noise."""
    if problem.values is not None:
        return problem.values(problem.times)
    write(folder, problem.times, 0.0 * problem.times)
    varied = Varied.of(scene_of(problem, folder, problem.sigma))
    q = varied.numbers(np.array([*problem.truth.values()]))
    return q[varied.quantities.slices[0]]


def write(folder: Path, times: Floats, values: Floats) -> None:
    """Write the file of data."""
    np.savetxt(folder / "data.csv", np.column_stack([times, values]), delimiter=",", fmt="%.17g")


def scene_of(problem: Problem, folder: Path, sigma: float) -> Scene:
    """The scene with a standard deviation of its data."""
    measure = [problem.scene["measure"][0] | {"data": "data.csv", "sigma": sigma}]
    told = {"title": problem.name, "output": QUIET, "measure": measure}
    return Scene.from_dict(problem.scene | told, base=folder)


def bound(problem: Problem, folder: Path, truth: Floats) -> Floats:
    """Cramer-Rao bound of the parameters at the truth, by differences of runs, (P,)."""
    write(folder, problem.times, truth)
    varied = Varied.of(scene_of(problem, folder, problem.sigma))
    at = np.array([*problem.truth.values()])
    own, slopes = varied.quantities.slices[0], []
    for k, value in enumerate(at):
        step = np.zeros(len(at))
        step[k] = 1e-6 * value
        far, near = (varied.numbers(at + sign * step)[own] for sign in (1.0, -1.0))
        slopes.append((far - near) / (2.0 * step[k]))
    shaped = np.array(slopes) / problem.sigma
    return np.sqrt(np.diag(np.linalg.inv(shaped @ shaped.T)))


def measured(problem: Problem, seeds: int) -> list[list[Any]]:
    """Rows of a problem, one for each parameter."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        exact = data_of(problem, folder)
        bounds = bound(problem, folder, exact)
        held, short, sigmas, wrong, told, doubted = [], [], [], [], 0, 0
        for seed in range(seeds):
            noise = problem.sigma * np.random.default_rng(seed).standard_normal(len(exact))
            write(folder, problem.times, exact + noise)
            found = impactfem.identify(scene_of(problem, folder, problem.sigma))
            doubted += not found.trusted
            each = [found.parameters[n] for n in problem.truth]
            truth = np.array([*problem.truth.values()])
            error = np.array([p.value for p in each]) - truth
            sigma = np.array([p.sigma for p in each])
            sigmas.append(sigma)
            wrong.append(error / sigma)
            held.append(
                [p.interval95[0] <= t <= p.interval95[1] for p, t in zip(each, truth, strict=True)]
            )
            # With half the sigma the answer is the same, its intervals half as wide.
            short.append(np.abs(error) <= 0.5 * 1.96 * sigma)
            if seed % 10 == 0:
                half = impactfem.identify(scene_of(problem, folder, 0.5 * problem.sigma))
                told += any("too small" in doubt for doubt in half.doubts)
            print(problem.name, seed, *wrong[-1].round(2), found.trusted, flush=True)
    tried = len(range(0, seeds, 10))
    ratio = np.array(sigmas) / bounds
    return [
        [
            problem.name, name, f"{int(np.sum(held, axis=0)[k])} of {seeds}",
            f"{ratio[:, k].min():.3f} to {ratio[:, k].max():.3f}",
            f"{np.std(np.array(wrong)[:, k]):.2f}", f"{int(np.sum(short, axis=0)[k])} of {seeds}",
            f"{told} of {tried}", f"{doubted} of {seeds}",
        ]
        for k, name in enumerate(problem.truth)
    ]  # fmt: skip


HEAD = [
    "scene", "parameter", "intervals that hold the truth", "sigma / Cramer-Rao bound",
    "deviation of error / sigma", "with half of sigma", "half of sigma told", "doubted",
]  # fmt: skip


def main() -> None:
    """Measure all problems and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("names", nargs="*", choices=[*PROBLEMS, []], help="only these")
    given = parser.parse_args()
    rows = []
    for name in given.names or PROBLEMS:
        rows += measured(PROBLEMS[name](), given.seeds)
    table = markdown_table(HEAD, rows)
    print(table)
    if not given.names:
        (given.out / "intervals.md").write_text(table + "\n", encoding="utf-8")
        write_stamp("intervals", folder=given.out)


if __name__ == "__main__":
    main()
