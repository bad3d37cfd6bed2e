"""What soft joints cost: drift, energy and period of a pendulum and a four-bar linkage.

    python benchmarks/soft_joints.py [--out benchmarks/results]

Three ways to hold a joint: rigid (ours), ``soft = { erp, cfm }`` in our step, and the step of game
engines, symplectic Euler with velocities that mend a share erp of the error and give way by cfm to
forces (R. Smith, Open Dynamics Engine, user's guide, section 3.8), written out below. Both have
closed forms or a quadrature for their periods. Writes soft_joints.md and, for the page,
docs/images/soft_joints.png.
"""

import argparse
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import quad
from scipy.special import ellipk
from stamp import write_stamp

import impactfem
from impactfem.studies.study import markdown_table

HERE = Path(__file__).resolve().parent
G, DURATION = 9.81, 10.0
STEPS = (1e-2, 2.5e-3)
SOFT = ((1.0, 0.0), (0.2, 0.0), (0.8, 1e-4), (0.2, 1e-4), (0.2, 1e-3))
BARS = (0.1, 0.35, 0.2)  # crank, coupler, rocker [m]; 1 kg a metre
BASE, TURN = 0.4, 8.0  # [m]; rate of the crank at t = 0 [rad/s]

Floats = np.ndarray
Bodies = list[dict[str, Any]]


def closed(angle: float) -> tuple[Floats, Floats]:
    """Places of elbow and wrist of the four-bar linkage [m]."""
    elbow = BARS[0] * np.array([np.cos(angle), np.sin(angle)])
    way = np.array([BASE, 0.0]) - elbow
    far = np.linalg.norm(way)
    along = (BARS[1] ** 2 - BARS[2] ** 2 + far**2) / (2.0 * far)
    across = np.array([-way[1], way[0]]) / far
    wrist: Floats = elbow + along * way / far + np.sqrt(BARS[1] ** 2 - along**2) * across
    return elbow, wrist


def rods(angle: float) -> Floats:
    """Middles and angles of the three bars, (3, 3)."""
    elbow, wrist = closed(angle)
    ends = ((np.zeros(2), elbow), (elbow, wrist), (np.array([BASE, 0.0]), wrist))
    return np.array([[*(a + b) / 2.0, np.arctan2(*(b - a)[::-1])] for a, b in ends])


def rates(angle: float) -> Floats:
    """Velocities of the bars by unit rate of the crank, (3, 3)."""
    step = 1e-5
    rise = rods(angle + step) - rods(angle - step)
    rise[:, 2] = (rise[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    rise /= 2.0 * step
    return np.asarray(rise)


def mechanism(name: str) -> tuple[Bodies, list[tuple[int, int, Floats]], float, float]:
    """Bodies, joints (-1: ground; place), gravity [m/s^2] and period [s]."""
    if name == "pendulum":  # (I + m d^2)/(m d) = 1 m
        place = np.array([0.5 * np.sin(1.0), -0.5 * np.cos(1.0), 0.0])
        body = {"mass": 1.0, "inertia": 0.25, "start": place, "velocity": np.zeros(3)}
        return [body], [(-1, 0, np.zeros(2))], G, 4.0 / np.sqrt(G) * ellipk(np.sin(0.5) ** 2)
    start, moving = rods(1.0), TURN * rates(1.0)
    bodies = [
        {"mass": b, "inertia": b**3 / 12.0, "start": s, "velocity": v}
        for b, s, v in zip(BARS, start, moving, strict=True)
    ]
    masses = np.array([[b, b, b**3 / 12.0] for b in BARS])

    def weight(angle: float) -> float:
        return float((masses * rates(angle) ** 2).sum())

    first = weight(1.0)
    turn = quad(lambda a: np.sqrt(weight(a) / first), 0.0, 2.0 * np.pi, limit=200)[0] / TURN
    elbow, wrist = closed(1.0)
    nail = np.array([BASE, 0.0])
    return bodies, [(-1, 0, np.zeros(2)), (0, 1, elbow), (1, 2, wrist), (-1, 2, nail)], 0.0, turn


def ours(name: str, soft: tuple[float, float] | None, dt: float) -> tuple[Floats, Floats]:
    """Places (layers, bodies, 3) and velocities of one of our runs."""
    bodies, joints, gravity, _ = mechanism(name)
    words = ["ground", *(f"b{k}" for k in range(len(bodies)))]
    hold = {} if soft is None else {"soft": dict(zip(("erp", "cfm"), soft, strict=True))}
    scene = impactfem.Scene.from_dict({
        "title": name, "duration": DURATION, "gravity": [0.0, -gravity],
        "body": [{
            "kind": "rigid", "name": f"b{k}", "mass": b["mass"], "inertia": b["inertia"],
            "shape": {"kind": "disc", "radius": 0.01, "center": b["start"][:2].tolist()},
            "velocity": b["velocity"][:2].tolist(), "angular_velocity": float(b["velocity"][2]),
        } for k, b in enumerate(bodies)],
        "joint": [{
            "kind": "revolute", "name": f"j{k}", "between": [words[a + 1], words[b + 1]],
            "point": point.tolist(), **hold,
        } for k, (a, b, point) in enumerate(joints)],
        "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
    })  # fmt: skip
    history = impactfem.solve(scene).history
    places = [
        [history[f"b{k}.{c}"].values for c in ("x", "y", "angle")] for k in range(len(bodies))
    ]
    speeds = [
        [history[f"b{k}.{c}"].values for c in ("vx", "vy", "spin")] for k in range(len(bodies))
    ]
    return np.moveaxis(np.array(places), 2, 0), np.moveaxis(np.array(speeds), 2, 0)


def engine(name: str, soft: tuple[float, float], dt: float) -> tuple[Floats, Floats]:
    """The same by the step of game engines; angles count from t = 0."""
    bodies, joints, gravity, _ = mechanism(name)
    count, (erp, cfm) = len(bodies), soft
    places = np.array([[*b["start"][:2], 0.0] for b in bodies])
    first, speeds = places.copy(), np.array([b["velocity"] for b in bodies])
    inverse = 1.0 / np.array([[b["mass"], b["mass"], b["inertia"]] for b in bodies]).ravel()
    kept = [(places.copy(), speeds.copy())]
    for _ in range(round(DURATION / dt)):
        rows, errors = np.zeros((2 * len(joints), 3 * count)), np.zeros(2 * len(joints))
        for j, joint in enumerate(joints):
            for side, k in zip((-1.0, 1.0), joint[:2], strict=True):
                at = joint[2]
                if k >= 0:
                    arm = turned(joint[2] - first[k, :2], places[k, 2])
                    at = places[k, :2] + arm
                    rows[2 * j : 2 * j + 2, 3 * k : 3 * k + 3] = side * np.array(
                        [[1.0, 0.0, -arm[1]], [0.0, 1.0, arm[0]]]
                    )
                errors[2 * j : 2 * j + 2] += side * at
        free = speeds.ravel() - dt * gravity * np.tile([0.0, 1.0, 0.0], count)
        answer = (rows * inverse) @ rows.T + cfm / dt * np.eye(len(errors))
        pull = np.linalg.lstsq(answer, -(rows @ free) - erp / dt * errors, rcond=None)[0]
        speeds = (free + inverse * (rows.T @ pull)).reshape(count, 3)
        places = places + dt * speeds
        kept.append((places.copy(), speeds.copy()))
    found = [np.array(part) for part in zip(*kept, strict=True)]
    return found[0], found[1]


def turned(arm: Floats, angle: Floats) -> Floats:
    """An arm after a turn, for each angle."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1]], axis=-1)


def measured(name: str, dt: float, places: Floats, speeds: Floats) -> tuple[float, float, float]:
    """Largest drift [m], and errors of energy and period, in shares of the kinetic energy."""
    bodies, joints, gravity, period = mechanism(name)
    first = np.array([b["start"][:2] for b in bodies])
    parted = 0.0
    for a, b, point in joints:
        ends = [
            point if k < 0
            else places[:, k, :2] + turned(point - first[k], places[:, k, 2] - places[0, k, 2])
            for k in (a, b)
        ]  # fmt: skip
        parted = max(parted, float(np.linalg.norm(ends[1] - ends[0], axis=-1).max()))
    masses = np.array([[b["mass"], b["mass"], b["inertia"]] for b in bodies])
    kinetic = 0.5 * (masses * speeds**2).sum((1, 2))
    energy = kinetic + gravity * (masses[:, 0] * places[:, :, 1]).sum(1)
    lost = (energy[-1] - energy[0]) / kinetic.max()
    turn = places[:, 0, 2] - places[0, 0, 2]
    if name == "pendulum":
        level = places[:, 0, 0]
        at = np.flatnonzero((level[:-1] > 0.0) & (level[1:] <= 0.0))
        share = level[at] / (level[at] - level[at + 1])
    else:
        whole = np.floor(turn / (2.0 * np.pi))
        at = np.flatnonzero(np.diff(whole) > 0)
        share = (whole[at + 1] * 2.0 * np.pi - turn[at]) / (turn[at + 1] - turn[at])
    times = (at + share) * dt
    found = (times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else np.nan
    return parted, lost, found / period - 1.0


def main() -> None:
    """Run all, write table and picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=HERE / "results")
    given = parser.parse_args()
    rows, drawn = [], {}
    for name in ("pendulum", "four-bar"):
        for dt in STEPS:
            runs: list[tuple[str, tuple[float, float] | None]] = [("rigid", None)]
            runs += [("soft", s) for s in SOFT[1:]] + [("engine", s) for s in SOFT]
            for kind, soft in runs:
                if soft and kind == "engine":
                    found = engine(name, soft, dt)
                else:
                    found = ours(name, soft, dt)
                drift, energy, period = measured(name, dt, *found)
                drawn[name, kind, soft, dt] = drift, energy, period
                words = ("", "") if soft is None else (f"{soft[0]:g}", f"{soft[1]:g}")
                rows.append([
                    name, f"{1e3 * dt:g}", kind, *words, f"{drift:.1e}", f"{energy:+.1e}",
                    f"{period:+.1e}",
                ])  # fmt: skip
                print(*rows[-1], flush=True)
    head = ["mechanism", "step [ms]", "joints", "erp", "cfm [m/(N s)]"]
    head += ["drift [m]", "energy", "period"]
    (given.out / "soft_joints.md").write_text(markdown_table(head, rows), encoding="utf-8")
    write_stamp("soft_joints", folder=given.out)
    draw(drawn)


def draw(drawn: dict[Any, tuple[float, float, float]]) -> None:
    """Drift and error of energy of both mechanisms."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained", sharey=True)
    marks = {"rigid": "o", "soft": "s", "engine": "^"}
    for axis, name in zip(axes, ("pendulum", "four-bar"), strict=True):
        for kind, mark in marks.items():
            for dt, fill in zip(STEPS, ("none", "full"), strict=True):
                at = [v for (n, k, _, d), v in drawn.items() if (n, k, d) == (name, kind, dt)]
                axis.loglog(
                    [max(v[0], 1e-17) for v in at], [max(abs(v[1]), 1e-17) for v in at], mark,
                    fillstyle=fill, color=f"C{list(marks).index(kind)}",
                    label=f"{kind}, {1e3 * dt:g} ms",
                )  # fmt: skip
        axis.set(title=name, xlabel="joints part by [m]")
    axes[0].set_ylabel("change of energy after 10 s")
    axes[1].legend(fontsize="small")
    figure.savefig(HERE.parent / "docs" / "images" / "soft_joints.png", dpi=110)


if __name__ == "__main__":
    main()
