"""A motion graph: script.py [FOLDER] (default results/motion_graph_script).

Clips of a ball that hops are cut at their apexes; where two are alike one may go on with the other.
The shortest way through this graph is a motion that no clip has. It is run again as a scene, whose
impacts know nothing of clips. graph.png: the clips, how alike their apexes are, and what was run.
"""

import argparse
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.sparse.csgraph import shortest_path

import impactfem

SCENE = Path(__file__).with_name("scene.toml")
ALIKE = 0.1  # distance of apexes up to which one clip may go on with another
SIZES = np.array([1.0, 0.5])  # of speeds [m/s] and heights [m], in which it is counted
DEAR = 10.0  # [s] by distance, which a way through the graph costs besides its time

type Orders = list[tuple[float, float, float]]
"""From when on [s], which speed [m/s] and apex [m]."""

CLIPS: dict[str, Orders] = {
    "set off": [(0.0, 0.0, 0.5), (3.0, 2.0, 0.5)],
    "leap": [(0.0, 2.0, 0.5), (3.0, 2.0, 1.2), (5.0, 2.0, 0.5)],
    "stop": [(0.0, 2.0, 0.5), (3.0, 0.0, 0.5)],
}


@dataclass
class Clip:
    """A run of the scene, and its apexes.

    Attributes:
        orders: What it was told.
        way: Place along the floor and height (2, rows) [m].
        times: Of apexes [s].
        rows: Of apexes.
        apexes: Speed [m/s] and height [m] of each.
    """

    orders: Orders
    way: np.ndarray
    times: np.ndarray
    rows: np.ndarray
    apexes: np.ndarray


def steps(orders: Orders, which: int) -> str:
    """What jumps from one order to the next, as a formula of time."""
    jumps = [f"{orders[0][which]!r}"]
    jumps += [
        f"{new[which] - old[which]!r}*where(t>={new[0]!r},1,0)" for old, new in pairwise(orders)
    ]
    return "(" + "+".join(jumps) + ")"


def run(orders: Orders, duration: float) -> Clip:
    """The ball, told so from its first apex on."""
    scene = impactfem.Scene.from_toml(SCENE)
    along, up = (force.text for force in scene.bodies[0].force)
    told = [along.replace("0 - vx", f"{steps(orders, 1)} - vx"),
            up.replace("0.5 - y", f"{steps(orders, 2)} - y")]  # fmt: skip
    begun = {"position": [0.0, orders[0][2]], "velocity": [orders[0][1], 0.0], "force": told}
    scene = scene.with_settings({
        "duration": duration, **{f"body.ball.{key}": value for key, value in begun.items()},
    })  # fmt: skip
    history = impactfem.solve(scene).history
    names = ("time", "ball.x", "ball.y", "ball.vx")
    t, x, y, vx = (np.asarray(history[name].values) for name in names)
    rows = 1 + np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:]))
    return Clip(orders, np.array([x, y]), t[rows], rows, np.array([vx[rows], y[rows]]).T)


def graph(clips: list[Clip]) -> tuple[np.ndarray, np.ndarray]:
    """How far all apexes are from each other, and what edges between them cost; 0: none."""
    apexes = np.concatenate([clip.apexes for clip in clips]) / SIZES
    apart = np.linalg.norm(apexes[:, None] - apexes[None], axis=2)
    of = np.repeat(np.arange(len(clips)), [len(clip.times) for clip in clips])
    near = (apart < ALIKE) & (of[:, None] != of[None])
    edges = np.where(near, DEAR * apart + 1e-3, 0.0)  # a change costs a little at least
    first = 0
    for clip in clips:
        for k, lasts in enumerate(np.diff(clip.times)):
            edges[first + k, first + k + 1] = lasts
        first += len(clip.times)
    return apart, edges


def shortest(edges: np.ndarray, begin: int, end: int) -> list[int]:
    """Apexes from one to another."""
    _, before = shortest_path(edges, return_predecessors=True, indices=begin)
    way = [end]
    while way[-1] != begin:
        if before[way[-1]] < 0:
            raise SystemExit(f"no way leads from apex {begin} to {end}: ALIKE is too small")
        way.append(int(before[way[-1]]))
    return way[::-1]


def main() -> None:
    """Run the clips, find the way, run what it tells, and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path("results/motion_graph_script")
    parser.add_argument("folder", nargs="?", type=Path, default=default)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    clips = [run(orders, 6.5) for orders in CLIPS.values()]
    apart, edges = graph(clips)
    nodes = [(clip, k) for clip in clips for k in range(len(clip.times))]
    every = np.concatenate([clip.apexes for clip in clips])
    through = int(every[:, 1].argmax())  # the highest one
    way = shortest(edges, 0, through) + shortest(edges, through, len(nodes) - 1)[1:]

    # What clips were told from apex to apex, one behind the other.
    orders: Orders = []
    met, time = [(0.0, every[way[0]])], 0.0
    for one, two in pairwise(way):
        (clip, k), (other, j) = nodes[one], nodes[two]
        if clip is not other:
            print(f"at {time:.2f} s another clip goes on, apexes {apart[one, two]:.3f} apart")
            continue
        begin, end = clip.times[k], clip.times[j]
        last = [each for each in clip.orders if each[0] <= begin][-1:]
        inside = [each for each in clip.orders if begin < each[0] < end]
        orders += [(float(time + max(at - begin, 0.0)), *rest) for at, *rest in last + inside]
        time += end - begin
        met.append((time, every[two]))
    played = run(orders, time + 0.5)
    told = np.array([apex for _, apex in met[1:]])
    off = np.abs(played.apexes[: len(told)] - told).max(axis=0)
    late = np.abs(played.times[: len(told)] - [at for at, _ in met[1:]]).max()
    print(f"{len(told)} hops in {time:.2f} s, run again: apexes off by at most {off[1]:.4f} m, "
          f"speeds by {off[0]:.4f} m/s, times by {late:.4f} s")  # fmt: skip

    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(2, 1))
    ways, alike, whole = (figure.add_subplot(at) for at in (grid[0, 0], grid[0, 1], grid[1, :]))
    for shift, (name, clip) in enumerate(zip(CLIPS, clips, strict=True)):
        ways.plot(clip.way[0], clip.way[1] + 1.5 * shift, label=name)
        ways.plot(clip.way[0, clip.rows], clip.way[1, clip.rows] + 1.5 * shift, "k.")
    ways.set(title="clips and their apexes", xlabel="x [m]", yticks=[],
             ylim=(-0.2, 4.7))  # fmt: skip
    ways.legend(fontsize="small", loc="upper right")
    shown = alike.imshow(apart, cmap="gray", vmax=1.0)
    alike.plot(way, way, "r.", markersize=4, label="way")
    alike.set(title="distance of apexes, clip by clip", xlabel="apex", ylabel="apex")
    figure.colorbar(shown, ax=alike, shrink=0.7)
    whole.plot(*played.way)
    whole.plot(played.way[0, played.rows[: len(told)]], told[:, 1], "ko", fillstyle="none",
               label="apexes of the clips")  # fmt: skip
    whole.set(title="run again", xlabel="x [m]", ylabel="y [m]", ylim=(0.0, 1.5))
    whole.legend(fontsize="small", loc="upper right")
    figure.savefig(folder / "graph.png", dpi=110)
    print(folder / "graph.png")


if __name__ == "__main__":
    main()
