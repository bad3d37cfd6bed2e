"""How often 95 % intervals of identified parameters hold the truth (an hour of one core).

    python benchmarks/intervals.py [--seeds 100] [--out benchmarks/results] [NAME ...]

Writes intervals.md with its stamp after each problem; rows of others stay. Data are motions of the
truth with noise of a known standard deviation: from runs, or a closed form. Each seed is identified
from the same wrong start, with the standard deviation as it is and once more with half of it, where
intervals must fail.
"""

import argparse
import json
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from stamp import RESULTS, write_stamp

import impactfem
from impactfem import Scene
from impactfem.inverse.varied import Varied
from impactfem.studies.study import markdown_table

Floats = NDArray[np.float64]
Rows = dict[str, list[list[str]]]
G = 9.81
QUIET = {"report": False, "pictures": False, "fields": []}


@dataclass(frozen=True)
class Problem:
    """Something to identify.

    Attributes:
        name: As it is shown.
        scene: With parameters and measures: the first has a history of data, others one number.
        truth: Of the parameters, by name.
        times: Of the first one's data [s].
        sigma: Of its noise.
        values: Closed form of all data without noise, by times and parameters; None: by runs.
        others: Sigmas of the other measures.
    """

    name: str
    scene: dict[str, Any]
    truth: dict[str, float]
    times: Floats
    sigma: float
    values: Callable[..., Floats] | None = None
    others: tuple[float, ...] = ()

    @property
    def sigmas(self) -> Floats:
        """Of all data, (n,)."""
        return np.array([self.sigma] * len(self.times) + [*self.others])


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

    def places(t: Floats, mu: float, v: float) -> Floats:
        end = np.minimum(t, v / (mu * G))
        return np.asarray(v * end - 0.5 * mu * G * end**2)

    truth, times = {"mu": 0.25, "v": 1.8}, np.arange(0.01, 1.0, 0.01)
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

    def pushed(t: Floats, gap: float, v: float) -> Floats:
        return v * np.clip(t - gap / v, 0.0, 2.0)  # Z v for 2 L/c from gap/v on

    truth = {"gap": 0.5, "v": 0.5}
    return Problem("bar, impulse", scene, truth, np.arange(0.05, 3.0, 0.05), 0.01, pushed)


def wall(stiffness: float = 4.0, elements: int = 160, rise: float = 0.03) -> Problem:
    """Gap, speed and stiffness of the wall of a bar, from impulse, duration and rise of force.

    Args:
        stiffness: Of the wall, in E A/L.
        elements: With which errors of the mesh are a twentieth of sigma at most.
        rise: Sigma of the mean rate of the force.
    """
    pair = "bar.wall"
    scene = {
        "duration": 4.0,
        "body": [{"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "area": 1.0,
                  "youngs_modulus": 1.0, "gap": 0.45, "velocity": "-v"}],
        "obstacle": [{"kind": "wall", "name": "wall"}],
        "contact": [{"between": ["bar", "wall"], "stiffness": 1.125 * stiffness}],
        "parameter": [{"name": "gap", "key": "body.bar.gap", "bounds": [0.1, 0.9]},
                      {"name": "v", "start": 0.55, "bounds": [0.2, 2.0]},
                      {"name": "k", "key": "contact.0.stiffness",
                       "bounds": [0.25 * stiffness, 5.0 * stiffness]}],
        "measure": [{"name": "pushed", "of": f"impulse.{pair}"},
                    {"name": "lasts", "of": f"duration.{pair}"},
                    {"name": "rises", "of": f"force_rise.{pair}"}],
        "solve": {"method": "galerkin", "elements": elements},
    }  # fmt: skip
    truth = {"gap": 0.507, "v": 0.5, "k": stiffness}
    times = np.arange(0.05, 4.0, 0.05)
    name = f"bar, wall of {stiffness:g} E A/L"
    return Problem(name, scene, truth, times, 0.01, spring_wall, (0.02, rise))


def spring_wall(times: Floats, gap: float, v: float, k: float) -> Floats:
    """Impulses at some times, duration of contact, mean rate of the force up to half of its most.

    With L = c = Z = 1 the force is v (1 - e^(-k s)) for s < 2 from the touch on, and then, what
    left at s - 2 having come back from the free end, v (e^(-k y) (a + 2 k y) - 1) with y = s - 2,
    a = 2 - e^(-2 k).
    """
    a = 2.0 - np.exp(-2.0 * k)
    more = brentq(lambda y: k * y - np.log(a + 2.0 * k * y), 1e-9, 10.0)
    s = times - gap / v
    soon, y = np.clip(s, 0.0, 2.0), np.clip(s - 2.0, 0.0, more)
    late = np.exp(-k * y)
    pushed = (
        soon
        + np.expm1(-k * soon) / k
        + (a * (1.0 - late) + 2.0 - late * (2.0 + 2.0 * k * y)) / k
        - y
    )
    half = 0.5 * (2.0 * np.exp(0.5 * a - 1.0) - 1.0)  # of the most, at 2 k y = 2 - a
    return np.array([*v * pushed, 2.0 + more, -v * k * half / np.log1p(-half)])


PROBLEMS = {"ball": ball, "block": block, "bar": bar, "wall": wall,
            "stiff_wall": lambda: wall(20.0, 320, 0.15)}  # fmt: skip


def numbers_of(problem: Problem, folder: Path) -> Callable[[Floats], Floats]:
    """Data without noise by parameters, (n,)."""
    values = problem.values
    if values is not None:
        return lambda at: values(problem.times, *at)
    varied = Varied.of(scene_of(problem, folder, np.zeros(len(problem.sigmas))))
    return lambda at: varied.numbers(at)[: len(problem.sigmas)]


def scene_of(problem: Problem, folder: Path, data: Floats, share: float = 1.0) -> Scene:
    """The scene with data, (n,), and a share of their standard deviations."""
    first, *others = problem.scene["measure"]
    history, single = np.split(data, [len(problem.times)])
    table = np.column_stack([problem.times, history])
    np.savetxt(folder / "data.csv", table, delimiter=",", fmt="%.17g")
    measures = [first | {"data": "data.csv", "sigma": share * problem.sigma}]
    measures += [
        each | {"value": float(value), "sigma": share * sigma}
        for each, value, sigma in zip(others, single, problem.others, strict=True)
    ]
    told = {"title": problem.name, "output": QUIET, "measure": measures}
    return Scene.from_dict(problem.scene | told, base=folder)


def bound(problem: Problem, numbers: Callable[[Floats], Floats]) -> Floats:
    """Cramer-Rao bound of the parameters at the truth, by differences, (P,)."""
    at = np.array([*problem.truth.values()])
    slopes = []
    for k, value in enumerate(at):
        step = np.zeros(len(at))
        step[k] = 1e-6 * value
        slopes.append((numbers(at + step) - numbers(at - step)) / (2.0 * step[k]))
    shaped = np.array(slopes) / problem.sigmas
    return np.sqrt(np.diag(np.linalg.inv(shaped @ shaped.T)))


def measured(problem: Problem, seeds: int) -> list[list[str]]:
    """Rows of a problem, one for each parameter."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        numbers = numbers_of(problem, folder)
        exact = numbers(np.array([*problem.truth.values()]))
        bounds = bound(problem, numbers)
        held, short, sigmas, wrong, told, doubted = [], [], [], [], 0, 0
        for seed in range(seeds):
            data = exact + problem.sigmas * np.random.default_rng(seed).standard_normal(len(exact))
            found = impactfem.identify(scene_of(problem, folder, data))
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
                half = impactfem.identify(scene_of(problem, folder, data, 0.5))
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
    """Measure problems and write their rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("names", nargs="*", choices=[*PROBLEMS, []], help="only these")
    given = parser.parse_args()
    new: Rows = {}
    old, note = stored(given.out)
    for name in given.names or PROBLEMS:
        problem = PROBLEMS[name]()
        new[problem.name] = measured(problem, given.seeds)
        kept = [name for name in old if name not in new]
        table = markdown_table(HEAD, [row for rows in (old | new).values() for row in rows])
        (given.out / "intervals.md").write_text(table + "\n", encoding="utf-8")
        told = f"{'; '.join(kept)}: {note}" if kept else ""
        write_stamp("intervals", folder=given.out, note=told)
    print(table)


def stored(folder: Path) -> tuple[Rows, str]:
    """Rows that a folder holds, by problem, and when they were measured."""
    path = folder / "intervals.md"
    found: Rows = {}
    if not path.is_file():
        return {}, ""
    for line in path.read_text(encoding="utf-8").splitlines()[2:]:
        row = line.strip("| ").split(" | ")
        found.setdefault(row[0], []).append(row)
    old = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    said = [f"on {old['date']}, impactfem {old['impactfem']}", *filter(None, [old.get("note")])]
    return found, "; ".join(said)


if __name__ == "__main__":
    main()
