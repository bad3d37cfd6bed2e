"""Rigid bodies, joints and friction beside MuJoCo, Drake, Exudyn and Siconos: error against time.

    python benchmarks/rigid_peers.py [--python PYTHON] [--siconos PYTHON] [--out benchmarks/results]

PYTHON are interpreters that import the peers and Siconos (Debian's python3-siconos with its
/usr/bin/python3); PEER_RIGID and PEER_SICONOS in the environment say the same. Without them only
ours run. `peers/rigid_*.py` say their settings: the best of those tried. Times are
seconds of the process on one thread, ours with all that `solve` does (checks, plan, histories;
compiled before), the peers' of their steps only, after they have settled.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import numpy as np
from poured_balls import RADIUS, WINDOW, poured
from stamp import write_stamp

import impactfem
from impactfem.studies.study import markdown_table

HERE = Path(__file__).resolve().parent
G, OFF = 9.81, 1e-6
ZERO = 69.96761999  # third zero of the top's spin about its intermediate axis [s]
SETTINGS: dict[str, tuple[dict[str, Any], ...]] = {
    "MuJoCo": ({"noslip": 0}, {"noslip": 100}),
    "Drake": ({"solver": "sap"}, {"solver": "tamsi"}),
    "Exudyn": ({},),
    "Siconos": ({},),
}
KINDS = {"Exudyn": {"top", "chain"}, "Siconos": {"floor", "top"}}
"""Cases of those that have not all."""
LAWLESS = {"MuJoCo", "Drake", "Exudyn"}
"""Without a law that turns slip round."""
TOP = {"tilt": 0.4, "height": 0.1, "radius": 0.02, "inertia": [6e-3, 3e-3, 6e-3]}
SPIN, POURED, STEPS = 60.0, 200, 600
LONGEST = 40.0  # of a run of a peer [s]
Case = dict[str, Any]


def floor(name: str, duration: float, **more: Any) -> Case:
    """A ball (radius 0.1 m) or boxes (0.2 x 0.1 x 0.2 m), each on the one below, on a floor."""
    masses, ball = more.get("masses", [1.0]), more.get("ball", False)
    slope = more.get("slope", 0.0)
    return {
        "kind": "floor", "name": name, "duration": duration, "masses": masses, "ball": ball,
        "heights": [0.1] if ball else [0.05 + 0.1 * k for k in range(len(masses))],
        "gravity": [G * np.sin(slope), -G * np.cos(slope), 0.0], "mu": 0.2 if ball else 0.3,
        "speed": more.get("speed", 0.0), "steps": (4e-3, 1e-3),
    }  # fmt: skip


def superball() -> Case:
    """A ball that keeps its energy and turns its slip round, thrown on a floor with spin."""
    return floor("superball: speeds [m/s]", 0.1, ball=True, speed=1.0) | {
        "heights": [0.15], "gravity": [0.0] * 3, "mu": 1e6, "restitution": 1.0,
        "falls": -1.0, "rolls": 5.0,
    }  # fmt: skip


def plane_top() -> Case:
    """A top whose tip, a ball, slides on a smooth plane: it precesses, its centre at rest.

    A W^2 cos(tilt) - C n W + m g h = 0 with the moments A across and C along its axis, the spin n
    and the slower of two precessions W.
    """
    across, along, _ = TOP["inertia"]
    a, b, c = across * np.cos(TOP["tilt"]), -along * SPIN, G * TOP["height"]
    rate = float((-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a))
    return TOP | {
        "kind": "plane_top", "name": "top on a plane: axis [rad]", "duration": 1.0,
        "spin": [0.0, SPIN, -rate * float(np.sin(TOP["tilt"]))],  # along the axes of the body
        "rate": rate, "gravity": [0.0, -G, 0.0], "steps": (1e-3, 2.5e-4),
    }  # fmt: skip


def cases() -> list[Case]:
    """All cases; horizons twice where errors may grow."""
    sticks, slides = (float(np.arctan(0.3 + off)) for off in (-OFF, OFF))
    return [
        floor("ball slides, then rolls: speed", 1.2, ball=True, speed=3.0),
        *(floor("slope sticks: slip [m]", t, slope=sticks) for t in (1.0, 4.0)),
        *(floor("slope slides: slip [m]", t, slope=slides) for t in (1.0, 4.0)),
        superball(),
        floor("10 boxes: force of the floor", 0.2, masses=[1.0] * 10),
        *(floor(f"1 : 1e{k} boxes: force", 0.2, masses=[1.0, 10.0**k]) for k in (2, 4, 6)),
        {
            "kind": "top", "name": "free top: third zero [s]", "duration": 72.0,
            "spin": [1e-3, 1.0, 1e-3], "gravity": [0.0] * 3, "steps": (1e-2, 2.5e-3),
        },
        plane_top(),
        {
            "kind": "chain", "name": "50 links: tip [m]", "duration": 1.0, "links": 50,
            "link": [0.1, 0.1], "gravity": [0.0, -G, 0.0], "steps": (4e-3, 1e-3),
        },
    ]  # fmt: skip


def bodies(at: Case) -> Case:
    """Bodies, joints and contacts of our scene."""
    if at["kind"] == "top":
        top = {
            "name": "top", "kind": "rigid", "mass": 1.0, "inertia": [1.0, 2.0, 3.0],
            "shape": {"kind": "sphere", "radius": 0.1, "center": [0.0] * 3},
            "angular_velocity": at["spin"],
        }  # fmt: skip
        return {"body": [top]}
    if at["kind"] == "plane_top":
        low = -at["height"]
        turn, w = at["tilt"], at["spin"]
        spin = [0.0, np.cos(turn) * w[1] - np.sin(turn) * w[2],
                np.sin(turn) * w[1] + np.cos(turn) * w[2]]  # fmt: skip
        top = {
            "name": "top", "kind": "rigid", "mass": 1.0, "inertia": at["inertia"],
            "shape": {"kind": "sphere", "radius": at["radius"], "center": [0.0, low, 0.0]},
            "center_of_mass": [0.0] * 3, "orientation": {"axis": [1.0, 0.0, 0.0], "angle": turn},
            "angular_velocity": spin,
        }  # fmt: skip
        under = [0.0, low * np.cos(turn) - at["radius"], 0.0]
        return {
            "body": [top],
            "obstacle": [plane(under)],
            "contact": [{"between": ["top", "floor"]}],
        }
    if at["kind"] == "chain":
        length, mass = at["link"]
        links = [
            {
                "name": f"l{k}", "kind": "rigid", "mass": mass, "inertia": mass * length**2 / 12,
                "shape": {"kind": "disc", "radius": 0.01, "center": [(k + 0.5) * length, 0.0]},
            }
            for k in range(at["links"])
        ]  # fmt: skip
        words = ["ground", *(link["name"] for link in links)]
        joints = [
            {
                "name": f"j{k}", "kind": "revolute", "between": words[k : k + 2],
                "point": [k * length, 0.0],
            }
            for k in range(at["links"])
        ]  # fmt: skip
        return {"body": links, "joint": joints}
    stand = [
        {
            "name": f"b{k}", "kind": "rigid", "mass": mass,
            "shape": {"kind": "sphere", "radius": 0.1, "center": [0.0, y, 0.0]} if at["ball"] else
            {"kind": "block", "size": [0.2, 0.1, 0.2], "corner": [-0.1, y - 0.05, -0.1]},
            "velocity": [at["speed"], at.get("falls", 0.0), 0.0],
            "angular_velocity": [0.0, 0.0, at.get("rolls", 0.0)],
        }
        for k, (mass, y) in enumerate(zip(at["masses"], at["heights"], strict=True))
    ]  # fmt: skip
    pairs = [["b0", "floor"], *([f"b{k}", f"b{k - 1}"] for k in range(1, len(stand)))]
    law = {
        "friction_coefficient": at["mu"], "restitution": at.get("restitution", 0.0),
        "tangential_restitution": at.get("restitution", 0.0),
    }  # fmt: skip
    return {
        "body": stand, "obstacle": [plane([0.0] * 3)],
        "contact": [{"between": pair, **law} for pair in pairs],
    }  # fmt: skip


def plane(point: list[float]) -> Case:
    """A floor."""
    return {"name": "floor", "kind": "half_space", "point": point, "normal": [0.0, 1.0, 0.0]}


def ours(at: Case) -> Case:
    """One of our runs."""
    gravity = at["gravity"][:2] if at["kind"] == "chain" else at["gravity"]
    scene = impactfem.Scene.from_dict(
        {
            "title": at["name"], "duration": at["duration"], "gravity": gravity, **bodies(at),
            "solve": {"dt": at["dt"], "estimate": False}, "output": {"fields": []},
        }
    )  # fmt: skip
    begin = time.process_time()
    history = impactfem.solve(scene).history
    seconds = time.process_time() - begin
    if at["kind"] == "top":
        w, x, y, z = (history[f"top.q{c}"].values for c in "wxyz")
        spin = [history[f"top.w{c}"].values for c in "xyz"]
        axis = (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x))
        spins = sum(a * s for a, s in zip(axis, spin, strict=True))
        return {"seconds": seconds, "spins": spins[1:]}
    last = {name: column.values[-1] for name, column in history.items()}
    if at["kind"] == "plane_top":
        w, x, y, z = (last[f"top.q{c}"] for c in "wxyz")
        axis = [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)]
        return {"seconds": seconds, "axis": axis}
    if at["kind"] == "chain":
        name, (length, _) = f"l{at['links'] - 1}", at["link"]
        angle = last[f"{name}.angle"]
        half = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
        return {
            "seconds": seconds,
            "tip": [last[f"{name}.x"] + half[0], last[f"{name}.y"] + half[1]],
        }
    # A step in which rounding passes for an impact tells an impulse for its force.
    push = last.get("force.b0.floor", last["contact_force"])
    force = push + last.get("impulse.b0.floor", last["contact_impulse"]) / at["dt"]
    return {"seconds": seconds, "way": last["b0.x"], "speed": last["b0.vx"], "rolls": last["b0.wz"],
            "force": force}  # fmt: skip


def peer(name: str, at: Case, python: str) -> Case:
    """One of a peer's."""
    script = HERE / "peers" / f"rigid_{name.lower()}.py"
    done = subprocess.run(
        [python, str(script), json.dumps(at)], check=True, text=True, timeout=LONGEST,
        stderr=subprocess.DEVNULL,
        stdout=subprocess.PIPE, env={**os.environ, "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    found: Case = json.loads(done.stdout)
    return found


def error(at: Case, found: Case) -> float:
    """Relative error of speed or force; error of way or place [m], or time [s]."""
    if at["kind"] == "top":
        spins = np.asarray(found["spins"])
        k = np.flatnonzero(spins[:-1] * spins[1:] < 0.0)
        times = (k + 1 + spins[k] / (spins[k] - spins[k + 1])) * at["dt"]
        return abs(times[2] - ZERO) if len(times) > 2 else np.inf
    if at["kind"] == "chain":
        return float(np.linalg.norm(np.asarray(found["tip"]) - at["tip"]))
    if at["kind"] == "plane_top" or "restitution" in at:
        return smooth_error(at, found)
    if "speed" in at["name"]:
        return float(abs(found["speed"] / (5 / 7 * at["speed"]) - 1.0))
    if "force" in at["name"]:
        return float(abs(found["force"] / (G * sum(at["masses"])) - 1.0))
    pull = at["gravity"][0] + at["mu"] * at["gravity"][1]
    return float(abs(found["way"] - 0.5 * max(pull, 0.0) * at["duration"] ** 2))


def smooth_error(at: Case, found: Case) -> float:
    """Error of a top's axis [rad], or of a superball's speeds [m/s]."""
    if at["kind"] == "plane_top":
        far, turn = at["rate"] * at["duration"], np.sin(at["tilt"])
        axis = [turn * np.sin(far), np.cos(at["tilt"]), turn * np.cos(far)]
        return float(2.0 * np.arcsin(0.5 * np.linalg.norm(np.asarray(found["axis"]) - axis)))
    v, u = at["speed"], 0.1 * at["rolls"]
    after = (3.0 * v - 4.0 * u) / 7.0, (-10.0 * v - 3.0 * u) / 7.0  # Garwin
    return float(max(abs(found["speed"] - after[0]), abs(0.1 * found["rolls"] - after[1])))


def heap(by: str, heights: Any, depth: float, energy: float, seconds: float) -> Case:
    """A row of balls that have been poured."""
    return {
        "by": by, "height of the centre [m]": f"{np.mean(heights):.4f}",
        "depth / radius": f"{depth / RADIUS:.1e}", "energy left [J]": f"{energy:.1e}",
        "a step [ms]": f"{1e3 * seconds / STEPS:.2g}",
    }  # fmt: skip


def poured_ours() -> Case:
    """Balls in a box after 0.6 s, by ours with a residual of 1e-4."""
    scene = poured(POURED, STEPS).with_settings({"solve.friction_residual": 1e-4})
    begin = time.process_time()
    result = impactfem.solve(scene)
    seconds, names = time.process_time() - begin, [body.name for body in scene.bodies]
    history = result.history
    heights = [history[f"{name}.z"].values[-1] for name in names]
    depth = -float(history["gap"].values.min())
    return heap("ours", heights, depth, float(history["kinetic_energy"].values[-1]), seconds)


def poured_peer(python: str) -> Case:
    """The same in MuJoCo."""
    scene = poured(POURED, STEPS).to_dict()
    case = {
        "radius": RADIUS, "steps": STEPS, "window": WINDOW, "tolerance": "1e-8",
        "places": [body["shape"]["center"] for body in scene["body"]],
        "walls": [(wall["point"], wall["normal"]) for wall in scene["obstacle"]],
    }  # fmt: skip
    done = subprocess.run(
        [python, str(HERE / "peers" / "poured_mujoco.py"), json.dumps(case)], check=True,
        text=True, stdout=subprocess.PIPE,
    )  # fmt: skip
    row = json.loads(done.stdout)
    return heap(row["by"], **row["rest"])


def of_peers(at: Case, pythons: dict[str, str | None]) -> list[tuple[str, Case]]:
    """Runs of the peers, empty where they stop or have no such law."""
    found: list[tuple[str, Case]] = []
    touches = at["kind"] in {"floor", "plane_top"}
    for name, settings in SETTINGS.items():
        python = pythons[name]
        if not python or at["kind"] not in KINDS.get(name, {at["kind"]}):
            continue
        if "restitution" in at and name in LAWLESS:
            found.append((name, {}))
            continue
        for more in settings if touches else settings[:1]:
            words = [name, *(f"{k} = {v}" for k, v in more.items() if touches)]
            try:
                run = peer(name, at | more, python)
            except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
                run = {}
            found.append((", ".join(words), run))
    return found


def main() -> None:
    """Run all cases and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=os.environ.get("PEER_RIGID"))
    parser.add_argument("--siconos", default=os.environ.get("PEER_SICONOS"))
    parser.add_argument("--out", type=Path, default=HERE / "results")
    given = parser.parse_args()
    for at in cases():
        ours(at | {"dt": 0.02, "duration": 0.04, "links": 2})  # compiles
    impactfem.solve(poured(25, 100))
    rows, versions = [], {}
    pythons = dict.fromkeys(SETTINGS, given.python) | {"Siconos": given.siconos}
    for at in cases():
        if at["kind"] == "chain":
            # No closed form: the least step of a peer, or of ours.
            fine = at | {"dt": 5e-5 if given.python else 5e-4}
            runs = peer("mujoco", fine, given.python) if given.python else ours(fine)
            at["tip"] = list(runs["tip"])
        for dt in at["steps"]:
            one = at | {"dt": dt}
            found = [("ours", ours(one)), *of_peers(one, pythons)]
            versions |= {name.split(",")[0]: run["version"] for name, run in found[1:] if run}
            for name, run in found:
                cells = ["no such law" if "restitution" in at else "stopped", "-"]
                if run:
                    cells = [f"{error(one, run):.1e}", f"{run['seconds']:.3f}"]
                rows.append([
                    at["name"], f"{at['duration']:g}", f"{1e3 * dt:g}", name, *cells
                ])  # fmt: skip
                print(*rows[-1], sep=" | ", flush=True)
    head = ["case", "duration [s]", "step [ms]", "by", "error", "time [s]"]
    text = markdown_table(head, rows)
    (given.out / "rigid_peers.md").write_text(text, encoding="utf-8")  # pouring takes minutes
    heaps = [poured_ours(), *([poured_peer(given.python)] if given.python else [])]
    heap_rows = [list(each.values()) for each in heaps]
    text += "\n\n" + markdown_table(list(heaps[0]), heap_rows)
    (given.out / "rigid_peers.md").write_text(text, encoding="utf-8")
    note = ", ".join(f"{name} {number}" for name, number in versions.items())
    write_stamp("rigid_peers", folder=given.out, note=note)


if __name__ == "__main__":
    main()
