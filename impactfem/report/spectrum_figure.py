"""Spectra drawn: amplitudes over frequency, shock response below, modes as lines."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from impactfem.errors import FolderError, OutputError
from impactfem.report.panel import colour
from impactfem.report.sheet import Sheet, write_png
from impactfem.report.table import table
from impactfem.result.spectrum import Spectrum

if TYPE_CHECKING:
    from impactfem.arrays import Floats


def spectrum_figure(found: Spectrum, *, fft: bool = True, srs: bool = True) -> Figure:
    """Draw a spectrum: amplitudes, the shock response, or both."""
    shown = [fft, srs and bool(len(found.shock))]
    figure = Sheet(7.0, 3.6 * sum(shown))
    panels = figure.subplots(sum(shown), 1, squeeze=False)[:, 0]
    if fft:
        panels[0].loglog(found.frequencies[1:], found.amplitudes[1:], color=colour(0), lw=1.0)
        panels[0].set_title(f"{found.column}: amplitudes")
    if shown[1]:
        panels[-1].loglog(found.shock_frequencies, found.shock, color=colour(1))
        title = f"shock response spectrum, Q = {found.q:g}, absolute acceleration"
        panels[-1].set_title(title if fft else f"{found.column}: {title}")
    for axes in panels:
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel(f"[{found.unit}]")
        axes.grid(visible=True, which="both", linewidth=0.3)
        _mark(axes, found)
    return figure


def spectrum_table(found: Spectrum, told: Mapping[str, Any]) -> str:
    """Its figures, as `write_spectrum` gave them, as a table for the command line."""
    rows = [("column", f"{found.column} [{found.unit}]")]
    more = "; rows at unequal times were brought to equal ones" if found.resampled else ""
    rows.append(("samples", f"every {found.step:.4g} s{more}"))
    for name, what in (("fft", "largest amplitude"), ("srs", "largest shock response")):
        if name in told:
            own = told[name]
            text = f"{own['peak']:.4g} {found.unit} at {own['peak_frequency']:.4g} Hz"
            rows.append((what, text))
    if found.mode_body:
        listed = ", ".join(f"{frequency:.5g}" for frequency in found.modes)
        rows.append((f"modes of {found.mode_body} [Hz]", listed))
    return table(rows)


def write_spectrum(
    found: Spectrum, folder: Path, *, fft: bool = True, srs: bool = True
) -> Mapping[str, Any]:
    """Write fft.csv, srs.csv, modes.csv, spectrum.png and summary.json, as far as there are any.

    Returns:
        What the summary holds.

    Raises:
        FolderError: The folder holds a result, whose summary would be lost.
        OutputError: It cannot be written.
    """
    if (folder / "history.csv").exists():
        raise FolderError(f"{folder}: holds a result; choose another folder (--out)")
    srs = srs and bool(len(found.shock))
    tables: dict[str, Mapping[str, Floats]] = {}
    if fft:
        tables["fft"] = {"frequency": found.frequencies, "amplitude": found.amplitudes}
    if srs:
        tables["srs"] = {
            "frequency": found.shock_frequencies, "maximax": found.shock,
            "highest": found.highest, "lowest": found.lowest,
        }  # fmt: skip
    if found.mode_body:
        tables["modes"] = {"frequency": found.modes}
    left_out = {"fft", "srs"} - {*tables}
    told = {name: what for name, what in found.figures().items() if name not in left_out}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, columns in tables.items():
            values = np.column_stack([*columns.values()])
            head = ",".join(columns)
            np.savetxt(
                folder / f"{name}.csv", values, delimiter=",", header=head, comments="", fmt="%.17g"
            )
        (folder / "summary.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
        write_png(spectrum_figure(found, fft=fft, srs=srs), folder / "spectrum.png")
    except OSError as error:
        why = f"{folder}: cannot be written ({error.strerror}); choose another folder (--out)"
        raise OutputError(why) from None
    return told


def _mark(axes: Axes, found: Spectrum) -> None:
    low, high = axes.get_xlim()
    for index, frequency in enumerate(found.modes):
        if low < frequency < high:
            name = f"modes of {found.mode_body}" if not index else None
            axes.axvline(frequency, color="0.5", linewidth=0.8, linestyle=":", label=name)
    if len(found.modes):
        axes.legend(frameon=False)
    axes.set_xlim(low, high)
