"""Rigid bodies, joints and friction beside MuJoCo, Drake and Exudyn: error against time.

    python benchmarks/rigid_peers.py [--python PYTHON] [--out benchmarks/results]

PYTHON is an interpreter that imports the peers (PEER_RIGID in the environment says the same);
without it only ours run. `peers/rigid_*.py` say their settings: the best of those tried. Times are
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
}
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


def cases() -> list[Case]:
    """All cases; horizons twice where errors may grow."""
    sticks, slides = (float(np.arctan(0.3 + off)) for off in (-OFF, OFF))
    return [
        floor("ball slides, then rolls: speed", 1.2, ball=True, speed=3.0),
        *(floor("slope sticks: way [m]", t, slope=sticks) for t in (1.0, 4.0)),
        *(floor("slope slides: way [m]", t, slope=slides) for t in (1.0, 4.0)),
        floor("10 boxes: force of the floor", 0.2, masses=[1.0] * 10),
        *(floor(f"1 : 1e{k} boxes: force", 0.2, masses=[1.0, 10.0**k]) for k in (2, 4, 6)),
        {
            "kind": "top", "name": "free top: third zero [s]", "duration": 72.0,
            "spin": [1e-3, 1.0, 1e-3], "gravity": [0.0] * 3, "steps": (1e-2, 2.5e-3),
        },
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
            "velocity": [at["speed"], 0.0, 0.0],
        }
        for k, (mass, y) in enumerate(zip(at["masses"], at["heights"], strict=True))
    ]  # fmt: skip
    pairs = [["b0", "floor"], *([f"b{k}", f"b{k - 1}"] for k in range(1, len(stand)))]
    plane = {
        "name": "floor", "kind": "half_space", "point": [0.0] * 3, "normal": [0.0, 1.0, 0.0]
    }  # fmt: skip
    return {
        "body": stand, "obstacle": [plane],
        "contact": [{"between": pair, "friction_coefficient": at["mu"]} for pair in pairs],
    }  # fmt: skip


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
    return {"seconds": seconds, "way": last["b0.x"], "speed": last["b0.vx"], "force": force}


def peer(name: str, at: Case, python: str) -> Case:
    """One of a peer's."""
    script = HERE / "peers" / f"rigid_{name.lower()}.py"
    done = subprocess.run(
        [python, str(script), json.dumps(at)], check=True, text=True,
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
    if "speed" in at["name"]:
        return float(abs(found["speed"] / (5 / 7 * at["speed"]) - 1.0))
    if "force" in at["name"]:
        return float(abs(found["force"] / (G * sum(at["masses"])) - 1.0))
    pull = at["gravity"][0] + at["mu"] * at["gravity"][1]
    return float(abs(found["way"] - 0.5 * max(pull, 0.0) * at["duration"] ** 2))


def main() -> None:
    """Run all cases and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=os.environ.get("PEER_RIGID"))
    parser.add_argument("--out", type=Path, default=HERE / "results")
    given = parser.parse_args()
    for warm in (0, 1, 5, 9, 10):
        ours(cases()[warm] | {"dt": 0.02, "duration": 0.04, "links": 2})  # compiles
    rows, versions = [], {}
    for at in cases():
        if at["kind"] == "chain":
            # No closed form: the least step of a peer, or of ours.
            fine = at | {"dt": 5e-5 if given.python else 5e-4}
            runs = peer("mujoco", fine, given.python) if given.python else ours(fine)
            at["tip"] = list(runs["tip"])
        for dt in at["steps"]:
            one = at | {"dt": dt}
            found = [("ours", ours(one))]
            for name, settings in SETTINGS.items() if given.python else ():
                if at["kind"] == "floor" and name == "Exudyn":
                    continue
                for more in settings if at["kind"] == "floor" else settings[:1]:
                    words = [
                        name,
                        *(f"{k} = {v}" for k, v in more.items() if at["kind"] == "floor"),
                    ]
                    run = peer(name, one | more, given.python)
                    versions[name] = run["version"]
                    found.append((", ".join(words), run))
            for name, run in found:
                rows.append([
                    at["name"], f"{at['duration']:g}", f"{1e3 * dt:g}", name,
                    f"{error(one, run):.1e}", f"{run['seconds']:.3f}",
                ])  # fmt: skip
                print(*rows[-1], sep=" | ", flush=True)
    head = ["case", "duration [s]", "step [ms]", "by", "error", "time [s]"]
    (given.out / "rigid_peers.md").write_text(markdown_table(head, rows), encoding="utf-8")
    note = ", ".join(f"{name} {number}" for name, number in versions.items())
    write_stamp("rigid_peers", folder=given.out, note=note)


if __name__ == "__main__":
    main()
