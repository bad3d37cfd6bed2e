"""Two amplitudes of one tapping lever. script.py [FOLDER] (default results/afm_tapping_script).

branches.png: way of the tip of both, and that of a point mass on a spring under the same forces.
"""

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
STEPS, LAST = 150, 10  # steps in a period, and periods at the end that are looked at
LEVELS = {"attractive": 0.0, "repulsive": 10e-9}  # by what amplitude of the tip it starts with
ANGLE = 1.138  # tip speed of the first mode by that of a straight turn about the clamp
DRIVEN = 0.39150  # of an even load on a mode whose tip moves by 1


def point_mass(
    lever: impactfem.Beam, contact: impactfem.Contact, start: float, periods: int
) -> np.ndarray:
    """Its way by Runge-Kutta's method, four steps in each: a quarter of the lever's mass."""
    omega, mass = lever.first_frequency, 0.25 * lever.mass
    damping, drive = omega / lever.quality_factor, DRIVEN * lever.length * lever.load(t=0.0)
    pull, room = lever.end_loads[0].force[1], 7e-9
    reach = contact.adhesion.energy / contact.adhesion.force

    def change(t: float, state: np.ndarray, holds: bool) -> np.ndarray:
        y, v = state
        force = drive * math.cos(omega * t) + pull(u=y)
        if y < -room:
            force += max(-contact.stiffness * (room + y) - contact.damping * v, 0.0)
        force -= contact.adhesion.force * (holds and y < reach - room)
        return np.array([v, force / mass - damping * v - omega**2 * y])

    step, state, holds = 2.0 * math.pi / omega / (4 * STEPS), np.array([0.0, start * omega]), False
    found = []
    for k in range(4 * STEPS * periods):
        t = k * step
        one = change(t, state, holds)
        two = change(t + 0.5 * step, state + 0.5 * step * one, holds)
        three = change(t + 0.5 * step, state + 0.5 * step * two, holds)
        four = change(t + step, state + step * three, holds)
        state = state + step / 6.0 * (one + 2.0 * (two + three) + four)
        holds = state[0] < -room or (holds and state[0] < reach - room)
        found.append(state[0])
    return np.array(found)[3::4]


def beaten(way: np.ndarray) -> tuple[float, float]:
    """Amplitude [m] and phase to the drive [degrees] over the last periods."""
    last = way[-LAST * STEPS :]
    turn = np.exp(-2j * np.pi * np.arange(1, len(last) + 1) / STEPS)
    whole = 2.0 * np.mean(last * turn)
    return float(abs(whole)), float(np.degrees(np.angle(whole)))


def main() -> None:
    """Run both, draw, and compare with the point mass."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/afm_tapping_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    lever, contact = scene.bodies[0], scene.contacts[0]
    axes = (figure := Figure(figsize=(8.0, 4.0), layout="constrained")).subplots()
    for name, start in LEVELS.items():
        spin = start * lever.first_frequency / ANGLE / lever.length
        moving = {"velocity": [0.0, 0.5 * spin * lever.length], "angular_velocity": spin}
        found = impactfem.solve(replace(scene, bodies=(replace(lever, **moving),))).history
        way = found["tip.uy"].values[1:]
        alike = point_mass(lever, contact, start, len(way) // STEPS)
        for kind, each in (("lever", way), ("point mass", alike)):
            size, phase = beaten(each)
            print(f"{name}, {kind}: {size * 1e9:.3f} nm, {phase:.2f} degrees")
        time = np.arange(1, 2 * STEPS + 1) / STEPS
        (line,) = axes.plot(time, way[-2 * STEPS :] * 1e9, label=f"{name}: lever")
        axes.plot(time, alike[-2 * STEPS :] * 1e9, ":", color=line.get_color(), label="point mass")
    axes.axhline(-7.0, color="0.5", linewidth=0.8)
    axes.set(xlabel="time [periods of the drive]", ylabel="tip [nm]")
    axes.set_ylim(top=14.0)
    axes.legend(loc="upper right", ncols=2)
    figure.savefig(folder / "branches.png", dpi=130)


if __name__ == "__main__":
    main()
