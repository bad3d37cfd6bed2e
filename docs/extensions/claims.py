"""Why believe the numbers: claims with their tests, figures and pages; no figure is typed."""

import csv
import json
import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import stored
from gallery_runs import ROOT, Run
from md_tables import table

type Claim = tuple[str, str, str, str]
"""Claim; tests or script; figure; page, as a link."""

WAVE_BENCHMARKS = ("bar_impact", "gravity_impact", "step_load", "two_bars", "wave_cradle")
DEMOS = (*WAVE_BENCHMARKS, "elastic_sphere", "sliding_block")


def _peer(name: str, study: str = "k1_off_grid") -> str:
    """Range of factors of a study in displacement over a peer, from the stored comparison."""
    row = rf"\| {study} \| {re.escape(name)} \| displacement L2 \| \S+ \| (\S+) to (\S+) times"
    found = re.search(row, stored.text("comparison"))
    if found is None:
        raise ValueError(f"comparison.md has no row of {study} and {name}")
    return f"{float(found[1]):.3g} to {float(found[2]):.3g} times"


def hard_cases() -> str:
    """How many cells of the board hold, and which methods fail."""
    cells = {(row["case"], row["method"]): row["verdict"] for row in stored.rows("hard_cases")}
    failed = [method for (_, method), verdict in cells.items() if verdict == "FAIL"]
    control = failed.count("newmark")
    refused = sum(verdict == "refused" for verdict in cells.values())
    return (
        f"{len(cells) - len(failed)} of {len(cells)} hold ({refused} by refusing); {control} "
        f"failures are of negative controls, {len(failed) - control} are shown and explained"
    )


def long_run() -> str:
    """Change of energy in the longest run of bars."""
    found = [
        float(row["value"]) for row in stored.rows("hard_cases")
        if row["case"].startswith("750 bounces") and row["method"] == "conserving"
        and row["figure"] == "drift"
    ]  # fmt: skip
    return f"energy changes by at most {max(found):.0e}"


def disc() -> str:
    """Errors on the finest mesh against the finer reference."""
    rows = [row for row in stored.rows("disc") if row["method"] == "explicit"]
    last = max(rows, key=lambda row: int(row["elements"]))
    apart = re.search(r"differ by (\S+) in motion and (\S+) in force", stored.text("disc"))
    known = f"; known to {apart[1]} and {apart[2]}" if apart else ""
    return (
        f"motion {float(last['displacement_max']):.0e}, force {float(last['force_l1']):.0e} with "
        f"{last['elements']} elements across{known}"
    )


def disc_peer() -> str:
    """The least factors over the SciPy loop, by size."""
    found = re.findall(r"([\d.]+) at n = (\d+)", stored.text("disc_comparison"))
    least = [f"{factor} with {size}" for factor, size in found]
    return f"times faster at equal error, least: {', '.join(least)} elements across"


def large() -> str:
    """Unknowns and time of the largest run."""
    text = stored.text("large_sphere")
    unknowns = re.search(r"(\d+) unknowns", text)
    whole = [float(row.split("|")[7]) for row in text.splitlines() if re.match(r"\| \d", row)]
    return (
        f"{int(unknowns[1]) / 1e6:.2f} million unknowns: mesh, assembly and 200 steps in "
        f"{min(whole):.0f} to {max(whole):.0f} s"
    )


def events() -> str:
    """Best errors of the event-driven method."""
    errors: dict[str, float] = {}
    for row in stored.rows("vibro_work_precision"):
        if row["method"] == "event driven":
            name = row["problem"]
            errors[name] = min(errors.get(name, math.inf), abs(float(row["error"])))
    return ", ".join(f"{name} {error:.0e}" for name, error in errors.items())


def flip() -> str:
    """Where period one of the vibrating table ends."""
    found = {row["quantity"]: row for row in stored.rows("vibrating_table")}["flip"]
    return (
        f"{float(found['measured']):.6f}, closed form {float(found['closed form or chance']):.6f}"
    )


def corner() -> str:
    """Largest errors of direction beside the vertex, of two methods."""
    found = {}
    for method in ("event driven", "penalty, k = 1e4"):
        row = re.search(rf"\| {method} \| (.*) \|", stored.text("corner"))
        if row is None:
            raise ValueError(f"corner.md has no row of {method}")
        found[method] = max(float(cell.split(",")[0]) for cell in row[1].split("|"))
    return ", ".join(f"{method}: off by {error:g}°" for method, error in found.items())


def _scene(name: str) -> dict[str, Any]:
    """The scene of a demo as it stands in its file."""
    return tomllib.loads((ROOT / "demos" / name / "scene.toml").read_text(encoding="utf-8"))


def _named(path: Path) -> str:
    """A file of the repository as code.

    Raises:
        FileNotFoundError: There is no such file: the claim has lost its test.
    """
    if not path.is_file():
        raise FileNotFoundError(path)
    return f"`{path.relative_to(ROOT).as_posix()}`"


def _tests(name: str) -> str:
    return _named(ROOT / "tests" / name)


def _script(name: str) -> str:
    return _named(ROOT / "benchmarks" / name)


def _summaries(runs: Sequence[Run]) -> dict[str, dict[str, Any]]:
    return {
        run.name: json.loads((run.folder / "summary.json").read_text(encoding="utf-8"))
        for run in runs
    }  # fmt: skip


def waves(facts: Mapping[str, Mapping[str, Any]]) -> str:
    """Errors of the bars against characteristics."""
    parts = [
        f"{name} {facts[name]['error']['displacement_max']:.0e}"
        for name in WAVE_BENCHMARKS
    ]  # fmt: skip
    return f"displacement error: {', '.join(parts)}"


def hertz(facts: Mapping[str, Mapping[str, Any]]) -> str:
    """Largest force and duration of the elastic ball over those of Hertz's theory of impact."""
    ball = _scene("elastic_sphere")["body"][0]
    radius, speed = ball["shape"]["radius"], abs(ball["velocity"][1])
    mass = 4.0 / 3.0 * math.pi * radius**3 * ball["density"]
    modulus = ball["youngs_modulus"] / (1.0 - ball["poisson_ratio"] ** 2)
    # H. Hertz, J. reine angew. Math. 92 (1881): F = 4/3 E* sqrt(R) d^1.5 brings the ball to rest.
    deep = (15.0 * mass * speed**2 / (16.0 * modulus * math.sqrt(radius))) ** 0.4
    force = 4.0 / 3.0 * modulus * math.sqrt(radius) * deep**1.5
    lasts = 2.0 * deep / speed * math.sqrt(math.pi) * math.gamma(0.4) / (2.5 * math.gamma(0.9))
    contact = facts["elastic_sphere"]["contact"]
    begin, end = contact["intervals"][0][0], contact["intervals"][-1][-1]
    return (
        f"force {contact['max_force'] / force:.3f}, duration {(end - begin) / lasts:.3f} of the "
        f"theory, which takes a contact of {math.sqrt(deep / radius):.2f} R for small"
    )


def sliding(runs: Sequence[Run]) -> str:
    """Way of the sliding block over that of a point mass with friction."""
    run = next(run for run in runs if run.name == "sliding_block")
    scene = _scene("sliding_block")
    with (run.folder / "history.csv").open(encoding="utf-8", newline="") as file:
        x = [float(row["block.x"]) for row in csv.DictReader(file)]
    friction = scene["contact"][0]["friction_coefficient"]
    way = scene["body"][0]["velocity"][0] ** 2 / (2.0 * friction * abs(scene["gravity"][1]))
    return f"stops after {1e3 * (x[-1] - x[0]):.2f} mm; v²/2μg = {1e3 * way:.2f} mm"


def of_demos(runs: Sequence[Run]) -> dict[str, str]:
    """Figures from runs of demos."""
    facts = _summaries(runs)
    return {"waves": waves(facts), "hertz": hertz(facts), "sliding": sliding(runs)}


def claims() -> list[Claim]:
    """All claims, with stored figures."""
    demos = stored.stamp("demos")["figures"]
    gallery, board = "[gallery](generated/gallery/index.md)", "[hard cases](hard_cases.md)"
    speed, solids = "[speed](work_precision.md)", "[solids](solid_benchmarks.md)"
    return [
        ("Bars follow the exact waves where events fall on time levels or meshes are fitted",
         _tests("verification/test_bar_verification.py"),
         demos["waves"], gallery),
        ("Energy stays over 750 bounces (`conserving`)", _tests("report/test_hard_cases.py"),
         long_run(), board),
        ("Hard cases hold, and negative controls fail", _tests("report/test_hard_cases.py"),
         hard_cases(), board),
        ("Bars are faster than a peer's loop at equal error", _script("standing.py"),
         f"{_peer('NumPy leapfrog')} (NumPy), {_peer('DOLFINx + SciPy Newmark')} (SciPy)", speed),
        ("Solids converge to a reference with other elements, mesh and steps", _script("disc.py"),
         disc(), solids),
        ("Solids are faster than a plain SciPy loop from some size on", _script("disc.py"),
         disc_peer(), solids),
        ("An elastic ball bounces as Hertz says", _tests("verification/test_solid_hertz.py"),
         demos["hertz"], "[verification](solid_verification.md)"),
        ("Friction takes what Coulomb says", _tests("verification/test_bodies_friction.py"),
         demos["sliding"], "[friction](friction.md)"),
        ("A million unknowns fit a workstation", _script("large_sphere.py"), large(), solids),
        ("Few degrees of freedom: impacts are located to rounding",
         _tests("vibro/test_event_driven.py"), events(), "[vibro-impact](vibro_impact.md)"),
        ("A bouncing ball doubles its period where the exact map does",
         _tests("verification/test_vibrating_table.py"), flip(),
         "[vibrating table](vibrating_table.md)"),
        ("Rays leave a corner as unfolded reflections do",
         _tests("verification/test_corner.py"), corner(), "[ill-posed](ill_posed.md)"),
    ]  # fmt: skip


def page() -> str:
    """The table of claims, and when the demos ran."""
    rows = [(f"{claim}<br>{test}", figure, more) for claim, test, figure, more in claims()]
    said = stored.measured(stored.stamp("demos")).replace("Measured", "Demos measured", 1)
    return f"{table(['claim, and what tests it', 'figure', 'more'], rows)}\n*{said}*\n"
