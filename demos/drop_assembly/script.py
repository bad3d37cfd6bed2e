"""What the board of a dropped assembly feels. script.py [FOLDER].

FOLDER (default results/drop_assembly_script) gets shock.png: acceleration and strain of
the board, its shock response, on elements and steps as given and twice as large.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
GRAVITY = 9.81  # [m/s^2]
PASSED = 1650.0  # frequency that CFC1000 passes with -3 dB: beyond it the record's end shows [Hz]
LARGER = {2.0: ("elements twice as large", "#9a9a9a"), 1.0: ("as given", "#0b559f")}


def solved(larger: float) -> impactfem.Result:
    """Solve on elements and steps so much larger, without an estimate."""
    scene = impactfem.Scene.from_toml(SCENE)
    sizes = {f"body.{body.name}.mesh_size": larger * body.mesh_size for body in scene.bodies}
    steps = {"solve.dt": larger * scene.to_dict()["solve"]["dt"], "output.fields": []}
    return impactfem.solve(scene.with_settings({**sizes, **steps}), estimate=False)


def strain(result: impactfem.Result) -> np.ndarray:
    """Strain along the upper face of the board, by Hooke's law in plane strain; shape (rows,)."""
    board = next(body for body in result.scene.bodies if body.name == "board")
    nu, modulus = board.poisson_ratio, board.youngs_modulus
    along, across = (result.history[f"face.{name}"].values for name in ("sxx", "syy"))
    return ((1.0 - nu**2) * along - nu * (1.0 + nu) * across) / modulus


def main() -> None:
    """Solve, draw, and say the largest values with their changes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    results = Path("results/drop_assembly_script")
    parser.add_argument("folder", nargs="?", type=Path, default=results)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(9.0, 8.0), layout="constrained")
    above, middle, below = figure.subplots(3, 1)
    peaks = []
    for larger, (words, color) in LARGER.items():
        result = solved(larger)
        time = 1e3 * result.history["time"].values
        felt, bent = result.history["middle.ay"].values / GRAVITY, 1e3 * strain(result)
        found = result.spectrum("middle.ay", q=10.0)
        shock = np.asarray(found.shock) / GRAVITY
        above.plot(time, felt, color=color, label=words)
        middle.plot(time, bent, color=color)
        below.loglog(found.shock_frequencies, shock, color=color)
        passed = shock[np.asarray(found.shock_frequencies) <= PASSED]
        peaks.append([np.abs(felt).max(), passed.max(), np.abs(bent).max()])
    names = ("acceleration, CFC1000", "shock response, Q = 10", "strain")
    for name, unit, coarse, fine in zip(names, ("g", "g", "mm/m"), *peaks, strict=True):
        off = abs(coarse / fine - 1.0)
        print(f"{name}: {fine:.4g} {unit}, {off:.1%} off on elements twice as large")
    above.set(ylabel="acceleration [g]")
    middle.set(xlabel="time [ms]", ylabel="strain of the upper face [mm/m]")
    below.set(xlabel="frequency [Hz]", ylabel="shock response, Q = 10 [g]")
    above.legend()
    figure.savefig(folder / "shock.png", dpi=100)


if __name__ == "__main__":
    main()
