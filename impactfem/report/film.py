"""Films of what a reel shows moment by moment: in a notebook, as a GIF or as an MP4."""

import importlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

from impactfem.arrays import Floats, Integers
from impactfem.errors import MissingDependencyError, OutputError
from impactfem.report.palette import FORCE, HELD, PRESSURE
from impactfem.report.panel import COLOURS
from impactfem.report.player import player
from impactfem.report.prefixes import prefix_ticks, prefixed_unit
from impactfem.report.telling import acting, peak_layer
from impactfem.result import Record

BLUE = "#0b559f"
"""Colour of the curve beside a motion."""

_SECONDS = 5.0  # that a film takes
_WHITE = 247  # of 255, from which a colour is that of the paper
_LOOKS = 8  # frames that the colours of a GIF are taken from


@dataclass(frozen=True)
class Reel(ABC):
    """A figure whose moving parts stand for one moment after the other.

    Attributes:
        figure: On a canvas of Agg.
        times: Of the moments [s], shape (moments,).
        clock: Says the time.
        now: Marks the time.
    """

    figure: Figure
    times: Floats
    clock: Text
    now: Line2D

    @property
    def count(self) -> int:
        """Number of moments."""
        return len(self.times)

    def show(self, moment: int) -> Sequence[Artist]:
        """Let the figure show a moment; returns what moves, from the back to the front."""
        time = float(self.times[moment])
        moved = self.move(moment, time)
        unit = prefixed_unit("s", self.times[-1])
        self.clock.set_text(f"t = {unit.text(time, 4)}")
        self.now.set_xdata([time, time])
        return [*moved, self.clock, self.now]

    @abstractmethod
    def move(self, moment: int, time: float) -> Sequence[Artist]:
        """Move what is drawn of the bodies to a moment; returns it."""


class Film(FuncAnimation):
    """An animation of Matplotlib that shows itself in a notebook, with a slider."""

    def __init__(self, reel: Reel, result: Record) -> None:
        """Take the reel of a result; nothing is drawn before the film is shown or saved."""
        self._reel, self._title = reel, result.scene.title
        self._opening = peak_layer(result, reel.times) if acting(result)[1].any() else 0
        interval = 1000.0 / frame_rate(reel.count)
        super().__init__(reel.figure, reel.show, frames=reel.count, interval=interval, blit=False)

    def _repr_html_(self) -> str:
        # Matplotlib's own player draws each frame anew and fetches its symbols from the network.
        rate = frame_rate(self._reel.count)
        return player(_frames(self._reel), rate, self._title, self._opening)

    def __del__(self) -> None:
        """Go silently: a film that was only returned and never shown is no mistake."""


def frame_rate(count: int) -> float:
    """Frames a second with which so many take some seconds."""
    return max(1.0, count / _SECONDS)


def beside(axes: Axes, time: Floats, values: Floats, label: str) -> None:
    """Draw the curve of what holds during each step, beside a motion."""
    axes.stairs(values[1:], time, baseline=None, color=BLUE, linewidth=1.2)
    axes.set_xlim(0.0, float(time[-1]))
    prefix_ticks(axes.xaxis, "time [s]")
    prefix_ticks(axes.yaxis, label)


def force_beside(axes: Axes, result: Record) -> Line2D:
    """Draw the contact force beside a motion; returns the line that marks the moment."""
    history = result.rows
    beside(axes, history["time"].values, history["contact_force"].values, "contact force [N]")
    return cursor(axes)


def cursor(axes: Axes) -> Line2D:
    """A line that marks a moment."""
    line = axes.axvline(0.0, color="black", linewidth=1.0)
    line.set_animated(True)
    return line


def film_moments(result: Record, times: Floats, frames: int) -> Integers:
    """Layers at about equal distances in time, at most so many, one at the largest force."""
    found = even_moments(times, frames)
    peak = peak_layer(result, times)
    if 0 < peak < len(times) - 1 and len(found) > 2:
        found[1 + int(np.abs(found[1:-1] - peak).argmin())] = peak
    return np.unique(found)


def even_moments(times: Floats, frames: int) -> Integers:
    """Layers at about equal distances in time, at most so many."""
    wanted = np.linspace(times[0], times[-1], min(frames, len(times)))
    after = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    nearer = wanted - times[before] <= times[after] - wanted
    return np.unique(np.where(nearer, before, after))


def write_film(reel: Reel, path: Path) -> Path:
    """Write a GIF or, with imageio-ffmpeg, an MP4; no display is needed.

    Raises:
        OutputError: The ending is unknown, or the file cannot be written.
        MissingDependencyError: MP4 is asked for without imageio-ffmpeg.
    """
    check_ending(path)
    pictures = _frames(reel)
    try:
        if path.suffix == ".gif":
            _write_gif(pictures, path, frame_rate(reel.count))
        else:
            _write_mp4(pictures, path, frame_rate(reel.count))
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    return path


def check_ending(path: Path) -> None:
    """Refuse what is no film.

    Raises:
        OutputError: The ending is unknown.
    """
    if path.suffix not in {".gif", ".mp4"}:
        raise OutputError(f"{path}: a film is a .gif or an .mp4; choose one of these endings")


def _frames(reel: Reel) -> Iterator[Image.Image]:
    """Draw the frames one after the other, in RGB.

    What stays is drawn once; what moves is drawn above it, and is animated in Matplotlib's sense.
    """
    figure, canvas = reel.figure, _canvas(reel.figure)
    canvas.draw()
    figure.set_layout_engine("none")
    background = canvas.copy_from_bbox(figure.bbox)
    for moment in range(reel.count):
        canvas.restore_region(background)
        for artist in reel.show(moment):
            if artist.axes is not None:
                artist.axes.draw_artist(artist)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")


def _canvas(figure: Figure) -> Any:
    """The canvas, whose methods have no types."""
    return figure.canvas


def _write_gif(frames: Iterator[Image.Image], path: Path, rate: float) -> None:
    """One palette for all frames: a GIF that chose colours for each would flicker."""
    pictures = list(frames)
    if not pictures:
        raise OSError("no frame is finite")
    looked = pictures[:: max(1, len(pictures) // _LOOKS)]
    strip = np.concatenate([np.asarray(picture)[::2, ::2] for picture in looked])
    rare = np.array([to_rgb(each) for each in (FORCE, PRESSURE, HELD, *COLOURS)])
    palette = Image.fromarray(strip).quantize(256 - len(rare), method=Image.Quantize.MEDIANCUT)
    colours = np.array(palette.getpalette() or []).reshape(-1, 3)[: 256 - len(rare)]
    colours[colours.min(axis=1) > _WHITE] = 255  # the paper, mixed with its neighbours
    colours = np.concatenate([colours, np.round(255.0 * rare).astype(int)])
    palette.putpalette(colours.ravel().tolist())
    first, *rest = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures)
    first.save(
        path, save_all=True, append_images=rest, duration=round(1000 / rate), loop=0, optimize=False
    )


def _write_mp4(frames: Iterator[Image.Image], path: Path, rate: float) -> None:
    try:
        ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ImportError as error:
        raise MissingDependencyError(
            f"{path}: MP4 needs imageio-ffmpeg; `pip install imageio-ffmpeg`, or choose a .gif"
        ) from error
    writer = None
    for frame in frames:
        even = frame.crop((0, 0, frame.width // 2 * 2, frame.height // 2 * 2))
        if writer is None:
            writer = ffmpeg.write_frames(str(path), even.size, fps=rate, macro_block_size=2)
            writer.send(None)
        writer.send(even.tobytes())
    if writer is None:
        raise OSError("no frame is finite")
    writer.close()
