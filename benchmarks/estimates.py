"""Claimed errors of solids over true ones, at rest and seen from a moving frame (15 minutes).

    python benchmarks/estimates.py [--out benchmarks/results] [NAME ...]

Writes estimates.md with its stamp. True errors are those against a run on elements a quarter as
large, by the measure of the claim: displacement fields and probes, in the frame in which bodies
move least. Scenes are the quick ones of the board of hard cases and twenty-one others.
"""

import argparse
import copy
import math
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

from stamp import RESULTS, write_stamp

import impactfem
from impactfem.errors import ImpactError
from impactfem.log import Progress
from impactfem.runs.error_estimate import estimate_error, rerun
from impactfem.runs.marched import as_used, strained
from impactfem.runs.solids import run_solids
from impactfem.runs.tracks import Track, difference
from impactfem.scene import Scene
from impactfem.studies import hard
from impactfem.studies.study import markdown_table

FINER = 0.25
BOOST = (3.0, 0.5)
FIGURES = ("displacement_max", "displacement_l2", "force_l1")
_RUBBER = {
    "kind": "solid", "model": "plane_strain", "density": 1000.0, "youngs_modulus": 1e6,
    "poisson_ratio": 0.3,
}  # fmt: skip


def block(size: Any = (0.1, 0.1), corner: Any = (0.0, 0.001), h: float = 0.01, **keys: Any) -> Any:
    """A block of rubber."""
    shape = {"kind": "block", "size": [*size], "corner": [*corner], "angle": keys.pop("angle", 0.0)}
    return {**_RUBBER, "name": "s", "shape": shape, "mesh_size": h, **keys}


def disc(center: Any = (0.0, 0.051), h: float = 0.00625, **keys: Any) -> Any:
    """A disc of rubber."""
    shape = {"kind": "disc", "radius": 0.05, "center": [*center]}
    return {**_RUBBER, "name": "s", "shape": shape, "mesh_size": h, **keys}


def plane(height: float = 0.0, **keys: Any) -> Any:
    """A floor."""
    return {
        "name": "floor", "kind": "half_space", "point": [0.0, height], "normal": [0.0, 1.0], **keys,
    }  # fmt: skip


def scenes() -> Iterator[tuple[str, dict[str, Any]]]:
    """Names, and scenes as data."""
    floor, far = plane(), plane(-9.0)
    down: dict[str, Any] = {"velocity": [0.0, -0.5]}
    held = [{"surface": side, "kind": "fixed"} for side in ("left", "right")]
    ring = {"kind": "ring", "inner_radius": 0.05, "radius": 0.1, "center": [0.0, 0.0]}
    pressed = {"surface": "inner", "value": "2e5*t"}
    ridge = {"name": "ridge", "kind": "cylinder", "point": [0.2, -0.02], "radius": 0.02}
    rub = {"between": ["s", "floor"], "friction_coefficient": 0.3}
    gravity = {"gravity": [0.0, -9.81]}

    def made(duration: float, bodies: list[Any], obstacles: list[Any], **more: Any) -> Any:
        return {"duration": duration, "body": bodies, "obstacle": obstacles, **more}

    def probe(*point: float) -> list[Any]:
        return [{"name": "q", "body": "s", "point": [*point]}]

    yield "block falls flat", made(0.02, [block(**down)], [floor])
    yield "the same, degree 2", made(0.02, [block(h=0.02, degree=2, **down)], [floor])
    yield (
        "block on its corner",
        made(0.04, [block(corner=(0.0, 0.025), angle=0.5, **down)], [floor]),
    )
    for method in ("explicit", "massless", "conserving", "moreau_jean"):
        yield f"disc, {method}", made(0.02, [disc(**down)], [floor], solve={"method": method})
    yield "disc, oblique, rubs", made(0.02, [disc(velocity=[0.4, -0.5])], [floor], contact=[rub])
    yield "disc bounces", made(0.3, [disc((0.0, 0.07), 0.0125)], [floor], **gravity)
    yield (
        "disc, finite strain",
        made(0.02, [disc(h=0.0125, strain="finite", velocity=[0.0, -2.0])], [floor]),
    )
    yield "disc touches late", made(0.01, [disc((0.0, 0.0545), **down)], [floor])
    yield "disc in free flight", made(0.01, [disc((0.0, 0.0945), velocity=[0.1, -0.5])], [floor])
    widened = {**_RUBBER, "name": "s", "shape": ring, "mesh_size": 0.00625, "pressures": [pressed]}
    yield "ring widens", made(0.01, [widened], [far], probe=probe(0.0501, 0.0))
    strip = block((0.4, 0.05), h=0.004, degree=1, **down)
    yield "strip on a ridge", made(0.03, [strip], [ridge], probe=probe(0.4, 0.026))
    pair = [block(corner=(0.0, 0.0), velocity=[0.4, 0.0]), block(corner=(0.101, 0.0), name="b")]
    yield "two blocks", made(0.02, pair, [])
    pair = [disc((0.0, 0.0), velocity=[0.4, 0.0]), disc((0.101, 0.02), name="b")]
    yield "two discs", made(0.02, pair, [])
    pull = {"surface": "right", "value": ["0", "-100"]}
    beam = block((0.2, 0.05), (0.0, 0.0), 0.008, supports=held[:1], tractions=[pull])
    yield "cantilever", made(0.05, [beam], [far], probe=probe(0.2, 0.025))
    shaken = plane(motion=["0", "0.01*sin(100*t)"])
    yield "shaken block", made(0.05, [block(corner=(0.0, 0.002))], [shaken], **gravity)
    table = block((0.2, 0.049), (0.0, 0.0), 0.00625, name="p", supports=held)
    yield "disc on a plate", made(0.02, [disc((0.1, 0.1), **down), table], [])
    thin = block((0.2, 0.01), (0.0, 0.0), 0.0025, name="p", supports=held)
    yield "disc on a thin plate", made(0.01, [disc((0.1, 0.062), **down), thin], [])
    yield (
        "slender bar falls flat",
        made(0.01, [block((0.2, 0.01), (0.0, 0.002), 0.0025, **down)], [floor]),
    )
    yield "rest", made(0.05, [block(corner=(0.0, 0.0))], [floor], start="static", **gravity)


def board() -> Iterator[tuple[str, dict[str, Any]]]:
    """The quick cases of solids of the board that are plain runs."""
    from impactfem.studies.hard.rows import Row, base  # noqa: PLC0415

    with (Path(hard.__file__).parent / "solids.toml").open("rb") as file:
        cases = tomllib.load(file)["case"]
    for case in cases:
        if not {"run", "refused"} & case.keys() and case.get("quick", True):
            row = Row(base=base("solids", case.get("scene")), set=case.get("set", {}))
            yield case["name"], row.scene().to_dict()


def boosted(data: dict[str, Any]) -> dict[str, Any]:
    """The same, seen from a frame that moves."""
    data = copy.deepcopy(data)
    for body in data["body"]:
        first = body.get("velocity") or [0.0, 0.0]
        body["velocity"] = [
            f"({v}) + {c}" if isinstance(v, str) else v + c
            for v, c in zip(first, BOOST, strict=True)
        ]
        for support in body.get("supports") or ():
            if support["kind"] == "fixed":
                support |= {"kind": "motion", "value": [f"{c}*t" for c in BOOST]}
    for obstacle in data["obstacle"]:
        motion = obstacle.get("motion") or ["0", "0"]
        obstacle["motion"] = [f"{old} + {c}*t" for old, c in zip(motion, BOOST, strict=True)]
    return data


def measured(name: str, data: dict[str, Any]) -> list[Any]:
    """Name, true errors, claims over them, and the time of the claim over that of the run."""
    given = {**data, "title": name, "output": {"fields": []}}
    given["solve"] = {**(data.get("solve") or {}), "estimate": True}
    scene = Scene.from_dict(given)
    plan = impactfem.plan(scene)
    scene = strained(scene, plan)
    begin = time.perf_counter()
    motion, _ = run_solids(scene, plan, Progress())
    taken = time.perf_counter() - begin
    used = as_used(scene, plan)
    claim, note = estimate_error(used, plan, motion)
    own = Track.of_motion(used, motion)
    true = difference(rerun(used, plan, FINER, motion.places), own, "")
    row: list[Any] = [name]
    for figure in FIGURES:
        exact = getattr(true, figure)
        told = math.nan if claim is None else getattr(claim, figure)
        # Rounding has no ratio.
        row += [exact, told / exact if exact > 1e-9 else math.nan, told]
    return [*row, note.get("seconds", math.nan) / taken]


def report(rows: list[list[Any]]) -> str:
    """Spread of the ratios, and each run."""
    spread = []
    for column, figure in zip((2, 5, 8), FIGURES, strict=True):
        found = sorted(row[column] for row in rows if math.isfinite(row[column]))
        if not found:
            continue
        spread.append(
            [figure, str(len(found)), *(f"{v:.2g}" for v in (found[0], median(found), found[-1]))]
        )
    detail = [
        [row[0], *(f"{row[k]:.1e}" if k % 3 == 1 else f"{row[k]:.2g}" for k in (1, 2, 4, 5, 7, 8)),
         f"{row[10]:.2g}"]
        for row in rows
    ]  # fmt: skip
    names = ["displacement, largest", "claimed / true", "mean", "claimed / true", "force"]
    head = ["scene", *names, "claimed / true", "time of the claim / of the run"]
    return (
        markdown_table(["figure", "runs", "least", "median", "largest"], spread)
        + "\n\n"
        + markdown_table(head, detail)
        + "\n"
    )


def main() -> None:
    """Measure all scenes and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("names", nargs="*", help="only scenes whose names hold one of these")
    given = parser.parse_args()
    rows = []
    for name, data in [*scenes(), *board()]:
        for label, seen in ((name, data), (f"{name}, boosted", boosted(data))):
            if given.names and not any(part in label for part in given.names):
                continue
            try:
                rows.append(measured(label, seen))
                print(*(f"{v:.2g}" if isinstance(v, float) else v for v in rows[-1]), flush=True)
            except ImpactError as error:
                print(label, error, flush=True)
            if not given.names:
                (given.out / "estimates.md").write_text(report(rows), encoding="utf-8")
    if not given.names:
        write_stamp("estimates", folder=given.out)
    else:
        print(report(rows))


if __name__ == "__main__":
    main()
