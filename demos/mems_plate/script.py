"""Where does the plate lie? script.py [FOLDER] (default results/mems_plate_script).

closing.png: the gap from above at four times, and the area that is closed against time.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
TIMES = (0.38e-6, 0.50e-6, 2e-6, 4.6e-6)  # [s]
CLOSED = 20e-9  # [m] gap up to which it counts as closed


def main() -> None:
    """Solve, draw, and say when it closes and how much of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("results/mems_plate_script"))
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    scene = impactfem.Scene.from_toml(SCENE)
    result = impactfem.solve(scene, estimate=False)
    fields = result.fields
    plate, room = scene.bodies[0], 0.9e-6
    points = np.asarray(fields.points)
    mesh = Triangulation(points[:, 0] * 1e6, points[:, 1] * 1e6)
    corners = points[mesh.triangles][:, :, :2]
    areas = 0.5 * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    gaps = np.array([room + fields.read(k)["displacement"][:, 2] for k in range(len(fields))])
    closed = ((gaps < CLOSED)[:, mesh.triangles].mean(axis=2) * areas).sum(axis=1) / areas.sum()
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    above, below = figure.subfigures(2, 1, height_ratios=(3, 2))
    for axes, time in zip(above.subplots(1, len(TIMES)), TIMES, strict=True):
        k = int(np.argmin(np.abs(np.asarray(fields.times) - time)))
        shades = axes.tripcolor(mesh, gaps[k] * 1e6, cmap="viridis", vmin=0.0, vmax=1.6,
                                shading="gouraud")  # fmt: skip
        axes.tricontour(mesh, gaps[k] * 1e6, levels=[CLOSED * 1e6], colors="#b2182b")
        axes.set(aspect="equal", title=f"{fields.times[k] * 1e6:.2f} us", xlabel="x [um]")
    above.colorbar(shades, ax=above.axes, label="gap [um]")
    axes = below.subplots()
    axes.plot(np.asarray(fields.times) * 1e6, closed, color="#0b559f")
    axes.set(xlabel="time [us]", ylabel=f"closed area (gap < {CLOSED * 1e9:g} nm)", ylim=(0, None))
    figure.savefig(folder / "closing.png", dpi=110)
    first = result.summary["contact"]["intervals"]
    print(f"{plate.name}: touches after {first[0][0] * 1e6:.2f} us, opens at "
          f"{first[-1][1] * 1e6:.2f} us, {len(first)} contacts, at most {closed.max():.0%} of its "
          f"area closed")  # fmt: skip
    print(folder / "closing.png")


if __name__ == "__main__":
    main()
