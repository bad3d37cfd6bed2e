"""Files of gradients and of what was identified: data, picture, page."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.errors import OutputError
from impactfem.inverse.gradients import Gradient, TaylorCheck
from impactfem.inverse.identification import Identified
from impactfem.inverse.optimisation import Optimised
from impactfem.report.page import elements, page
from impactfem.report.page.sketch import svg
from impactfem.report.sheet import Sheet, write_png
from impactfem.report.table import table

Rows = list[tuple[str, str]]

_MOST = 20  # unknowns in a table
_LOG = 100.0  # times the least objective, from which on a picture has powers of ten


def gradient_table(found: Gradient) -> str:
    """A gradient for a terminal."""
    rows = [("objective", f"{found.objective:.10g}")]
    for name, value in found.gradient.items():
        told = f"{value:.10g}"
        if found.sides is not None:
            below, above = found.sides[name]
            told += f", {below:.10g} below and {above:.10g} above"
        if found.error is not None:
            told += f" ({found.error[name]:.2g} from that of the exact solution)"
        rows.append((f"d/d{name}", told))
    rows.append(("check", _check(found.check)))
    rows += _words(found)
    cost = f"{found.seconds_gradient:.3g} s with derivatives, {found.seconds_forward:.3g} s without"
    rows += [("method", found.method), ("cost", f"{cost}; {found.forward_runs} more runs")]
    return table(rows)


def identified_rows(found: Identified) -> Rows:
    """What was identified as rows of a table."""
    rows = [("status", found.status)]
    for name, each in found.parameters.items():
        around = ""
        if each.interval95 is not None:
            low, high = each.interval95
            around = f", 95 % within [{low:.8g}, {high:.8g}]"
        rows.append((name, f"{each.value:.10g}{around} (began at {each.start:g})"))
    costs = found.objective
    told = f"{costs['initial']:.6g} at first, {costs['final']:.6g} at the end, "
    rows.append(("misfit", f"{told}{costs['verified']:.6g} with a plan of its own"))
    sigma = found.sigma_of_data
    told = "as given" if isinstance(sigma, str) else f"{sigma:.4g}, by the misfits"
    chance = found.chi2_probability
    told += "" if chance is None else f" (chance of misfits as large: {chance:.2g})"
    rows.append(("sigma of data", told))
    rows.append(("check", _check(found.check)))
    rows += _words(found)
    cost = f"{found.gradient_runs} runs with derivatives, {found.forward_runs} without"
    return [*rows, ("method", found.method), ("cost", f"{cost}, {found.seconds:.3g} s")]


def _words(found: Gradient | Identified | Optimised) -> Rows:
    """What speaks against an answer, and what makes its search difficult."""
    doubts = [("doubt", doubt) for doubt in found.doubts]
    return [*doubts, *(("note", note) for note in found.notes)]


def _check(check: TaylorCheck) -> str:
    rate = check.rate
    what = "rounding only" if rate is None else f"of order {rate:.3f} (2 is right)"
    if check.sided:
        what += " on one side: the objective has a kink here"
    elif check.kinked:
        what += ": an impact, or the end of a piece of the start, is on a time that is looked at, "
        what += "where the objective has a kink"
    return f"Taylor remainders {what}{'' if check.passed else ': the gradient is WRONG'}"


def identified_table(found: Identified) -> str:
    """What was identified for a terminal."""
    return table(identified_rows(found))


def write_gradient(found: Gradient, folder: Path) -> None:
    """Write ``gradient.json``.

    Raises:
        OutputError: It cannot be written.
    """
    _write(folder, {"gradient.json": _json(found.as_dict())})


def optimised_rows(found: Optimised) -> Rows:
    """What was optimised as rows of a table; of many unknowns the first and the last."""
    rows = [("status", found.status)]
    shown = list(found.parameters.items())
    for name, each in shown if len(shown) <= _MOST else shown[: _MOST // 2]:
        rows.append((name, f"{each['value']:.10g} (began at {each['start']:g})"))
    if len(shown) > _MOST:
        rows.append(("...", f"{len(shown) - _MOST // 2} more, in optimum.toml"))
    costs = found.objective
    told = f"{costs['initial']:.8g} at first, {costs['final']:.8g} at the end, "
    rows.append(("objective", f"{told}{costs['verified']:.8g} with a plan of its own"))
    rows += [("within limits", f"{value:.8g}") for value in found.constraints]
    rows.append(("gradient left", f"{found.kkt_residual:.3g}"))
    rows.append(("check", _check(found.check)))
    rows += _words(found)
    cost = f"{found.gradient_runs} runs with derivatives, {found.forward_runs} without"
    cost += f", {found.resumed} from before" if found.resumed else ""
    rows.append(("method", f"{found.method}, searched by {found.searched_by}"))
    return [*rows, ("cost", f"{cost}, {found.seconds:.3g} s")]


def optimised_table(found: Optimised) -> str:
    """What was optimised for a terminal."""
    return table(optimised_rows(found))


def write_identified(found: Identified, folder: Path, run: dict[str, Any]) -> None:
    """Write the answer as a scene, the search, the summary, a picture and a page.

    Args:
        found: What was identified.
        folder: Where.
        run: Date, versions, machine and command.

    Raises:
        OutputError: They cannot be written.
    """
    title, picture = f"Identified: {found.scene.title}", identified_picture(found)
    _write(folder, _answer(found, title, identified_rows(found), picture, folder, run))
    found.scene.keep_meshes(folder)
    write_png(picture, folder / "identified.png")


def write_optimised(found: Optimised, folder: Path, run: dict[str, Any]) -> None:
    """Write the answer as a scene, its controls, the search, the summary, a picture and a page.

    Args:
        found: What was optimised.
        folder: Where.
        run: Date, versions, machine and command.

    Raises:
        OutputError: They cannot be written.
    """
    title, picture = f"Optimised: {found.scene.title}", optimised_picture(found)
    texts = _answer(found, title, optimised_rows(found), picture, folder, run)
    for along, head, name in (("t", "time", "control.csv"), ("x", "x", "control_along.csv")):
        controls = [each for each in found.scene.controls if each.along == along]
        if not controls:
            continue
        duration = found.scene.duration
        places = np.unique(np.concatenate([c.times(duration) for c in controls]))
        columns = [places, *(c.at(places, duration) for c in controls)]
        lines = [",".join([head, *(c.name for c in controls)])]
        lines += [",".join(f"{x:.17g}" for x in row) for row in zip(*columns, strict=True)]
        texts[name] = "\n".join(lines) + "\n"
    _write(folder, texts)
    found.scene.keep_meshes(folder)
    write_png(picture, folder / "optimised.png")


def _answer(
    found: Identified | Optimised, title: str, rows: Rows, picture: Sheet, folder: Path,
    run: dict[str, Any],
) -> dict[str, str]:  # fmt: skip
    """Texts by the name of their file: the scene, the search, the summary and the page."""
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    head = ["iteration", "objective", "gradient_norm", "step", "seconds", "forward_runs"]
    writer.writerow([*head, *found.parameters])
    for k, each in enumerate(found.iterations):
        numbers = (each.objective, each.gradient_norm, each.step, each.seconds)
        shown = [f"{number:.17g}" for number in (*numbers, *each.parameters)]
        writer.writerow([str(k), *shown[:4], str(each.forward_runs), *shown[4:]])
    search = [
        (str(k), f"{i.objective:.8g}", f"{i.gradient_norm:.3g}", f"{i.step:.3g}")
        for k, i in enumerate(found.iterations)
    ]
    parts = [
        elements.section("answer", "Answer", elements.table(rows)),
        elements.section("picture", "At the start and at the answer", svg(picture, title)),
        elements.section(
            "search", "Search",
            elements.table(search, ("evaluation", "objective", "gradient", "step")),
        ),
        elements.section("run", "Where it comes from", elements.code(str(run.get("command")))),
    ]  # fmt: skip
    return {
        "optimum.toml": found.scene.to_toml(folder),
        "iterations.csv": lines.getvalue(),
        "summary.json": _json({**found.as_dict(), "run": run}),
        "report.html": page.shell(title, str(run.get("date")), parts),
    }


def optimised_picture(found: Optimised) -> Sheet:
    """The objective along the search, and each control at the start and at the answer."""
    controls, duration = found.scene.controls, found.scene.duration
    sheet = Sheet(7.0, 2.6 * (1 + len(controls)) + 0.4)
    axes = sheet.add_subplot(1 + len(controls), 1, 1)
    values = np.array([each.objective for each in found.iterations])
    axes.plot(np.minimum.accumulate(values), color="tab:blue", label="best so far")
    axes.plot(values, ".", color="0.5", markersize=4, label="tried")
    if (values > 0.0).all() and values.max() > _LOG * values.min():
        axes.set_yscale("log")
    axes.set_xlabel("evaluation")
    axes.set_ylabel("objective")
    axes.legend(fontsize=8)
    for place, control in enumerate(controls):
        axes = sheet.add_subplot(1 + len(controls), 1, 2 + place)
        own = [
            each for name, each in found.parameters.items() if name.startswith(f"{control.name}.")
        ]
        first = replace(control, start=tuple(each["start"] for each in own))
        along = control.along == "x"
        times = np.linspace(0.0, control.times(duration)[-1] if along else duration, 2001)
        for one, label, colour in ((first, "start", "0.6"), (control, "answer", "tab:blue")):
            axes.plot(times, one.at(times, duration), color=colour, label=label)
        axes.set_xlabel("x [m]" if along else "time [s]")
        axes.set_ylabel(control.name)
        axes.legend(fontsize=8)
    return sheet


def identified_picture(found: Identified) -> Sheet:
    """Measurements, and the model at the start and at the answer."""
    sheet = Sheet(7.0, 2.6 * len(found.fits) + 0.4)
    for place, fit in enumerate(found.fits):
        axes = sheet.add_subplot(len(found.fits), 1, place + 1)
        times, values = fit.data.times, np.asarray(fit.data.values, dtype=float)
        curves = (fit.start, "start", "0.6"), (fit.answer, "answer", "tab:blue")
        for curve, label, colour in curves:
            axes.plot(times, curve, color=colour, label=label, marker="_" * (len(times) == 1))
        if fit.data.sigma is None:
            axes.plot(times, values, ".", color="tab:red", markersize=3, label="measured")
        else:
            axes.errorbar(
                times, values, fit.data.sigma, fmt=".", color="tab:red", markersize=3,
                elinewidth=0.5, label="measured",
            )  # fmt: skip
        axes.set_xlabel("time [s]")
        axes.set_ylabel(fit.of)
        axes.legend(fontsize=8)
    return sheet


def _json(data: dict[str, Any]) -> str:
    return json.dumps(_finite(data), indent=1) + "\n"


def _finite(data: Any) -> Any:
    """Plain data with null for what is no number."""
    if isinstance(data, dict):
        return {name: _finite(entry) for name, entry in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(entry) for entry in data]
    return None if isinstance(data, float) and not np.isfinite(data) else data


def _write(folder: Path, texts: dict[str, str]) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        why = f"{folder}: cannot be written ({error.strerror}); choose another folder (--out)"
        raise OutputError(why) from None
