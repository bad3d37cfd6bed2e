"""When does the switch close for good? script.py [FOLDER] (default results/mems_switch_script).

bounces.png: gap and contact force for two steps of time, and the force at rest by beam theory.
"""

import argparse
from pathlib import Path

from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")


def force_at_rest(scene: impactfem.Scene) -> float:
    """Force on the bump [N] of an Euler-Bernoulli beam in plane strain, bent down by the gap."""
    strip, bump, load, gap = scene.solid, 76e-6, 20e3, 1e-6
    length, height = strip.shape.size
    modulus = strip.youngs_modulus / (1.0 - strip.poisson_ratio**2)
    bending = modulus * strip.thickness * height**3 / 12.0
    free = load * strip.thickness * bump**2 / (24.0 * bending)
    free *= 6.0 * length**2 - 4.0 * length * bump + bump**2
    return 3.0 * bending / bump**3 * (free - gap)


def main() -> None:
    """Solve with two steps, say when it closes, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/mems_switch_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE).with_settings({"output.fields": []})
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    gap, force = figure.subplots(2, 1, sharex=True)
    rest = force_at_rest(scene)
    for dt, colour in ((1e-8, "#d95f02"), (5e-9, "#0b559f")):
        result = impactfem.solve(scene, dt=dt)
        history, contacts = result.history, result.summary["contact"]["intervals"]
        label = f"dt = {1e9 * dt:g} ns"
        gap.plot(1e6 * history["time"], 1e6 * history["gap"], color=colour, label=label)
        force.stairs(1e6 * history["contact_force"][1:], 1e6 * history["time"], baseline=None,
                     color=colour, alpha=0.8)  # fmt: skip
        late = history["contact_force"].sel(time=slice(20e-6, None))
        print(f"{label}: touches after {1e6 * contacts[0][0]:.2f} us, closed from "
              f"{1e6 * contacts[-1][0]:.1f} us on, {len(contacts)} contacts, pushes with "
              f"{1e6 * float(late.mean()):.2f} uN (beam at rest: {1e6 * rest:.2f} uN)")  # fmt: skip
    force.axhline(1e6 * rest, color="black", linestyle="--", linewidth=1.0, label="beam at rest")
    force.set_yscale("symlog", linthresh=10.0)
    force.set_ylim(bottom=-2.0)
    force.set(xlabel="time [us]", ylabel="contact force [uN]", xlim=(0.0, 30.0))
    gap.set(ylabel="gap [um]", title="MEMS switch closing on its contact")
    gap.legend(frameon=False)
    force.legend(frameon=False)
    figure.savefig(folder / "bounces.png", dpi=100)
    print(folder / "bounces.png")


if __name__ == "__main__":
    main()
