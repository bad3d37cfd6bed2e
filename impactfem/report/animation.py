"""A short film of a solid's motion with the contact force beside it."""

import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from impactfem.errors import MissingDependencyError, OutputError
from impactfem.report.plane_picture import PRESSURE
from impactfem.report.skin import Skin
from impactfem.report.solid_figures import FLAT, survey
from impactfem.result import Result, SolidFields

type Pixels = NDArray[np.uint8]

_MOST, _LEAST = 60, 12  # frames
_TRIANGLES = 600_000  # drawn in all frames together: some seconds
_SECONDS = 5.0  # that a film takes
_BLUE = "#0b559f"


def animate(result: Result, path: str | Path, frames: int | None = None) -> Path:
    """Write a film of the motion; no display is needed.

    Args:
        result: Of a solid, with its fields.
        path: Target; ``.gif``, or ``.mp4`` if imageio-ffmpeg is installed.
        frames: Number of frames at most; fewer for large meshes if None.

    Returns:
        The path.

    Raises:
        OutputError: There are no fields of a solid, the ending is unknown, or the file cannot be
            written.
        MissingDependencyError: MP4 is asked for without imageio-ffmpeg.
    """
    path = Path(path)
    if not isinstance(result.fields, SolidFields):
        raise OutputError(
            f'{path}: no fields of a solid to show; run a solid with output.fields = ["vtkhdf"]'
        )
    if path.suffix not in {".gif", ".mp4"}:
        raise OutputError(f"{path}: a film is a .gif or an .mp4; choose one of these endings")
    skin = Skin.of(result.fields)
    if frames is None:
        frames = int(np.clip(_TRIANGLES // max(1, len(skin.triangles)), _LEAST, _MOST))
    layers = _layers(result.fields, frames)
    pictures = _frames(result, skin, layers)
    rate = max(1.0, len(layers) / _SECONDS)
    try:
        if path.suffix == ".gif":
            _write_gif(pictures, path, rate)
        else:
            _write_mp4(pictures, path, rate)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    return path


def _layers(fields: SolidFields, frames: int) -> NDArray[np.int64]:
    """Layers at about equal distances in time."""
    wanted = np.linspace(fields.times[0], fields.times[-1], min(frames, len(fields)))
    return np.unique(np.abs(fields.times[None] - wanted[:, None]).argmin(axis=1))


def _frames(result: Result, skin: Skin, layers: NDArray[np.int64]) -> Iterator[Pixels]:
    """Draw the frames one after the other, shape (height, width, 3) each.

    What stays is drawn once; only the body, and obstacles that move, are drawn in each frame.
    """
    painter, extents = survey(result, skin, (skin.snapshot(int(layer)) for layer in layers))
    if not extents:
        return
    window = painter.window(extents)
    aspect = float(np.ptp(window[1]) / np.ptp(window[0]))
    figure = Figure(figsize=_size(aspect), dpi=90, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
    if aspect < FLAT:
        left, right = figure.subplots(2, 1, height_ratios=[0.3 + 1.8 * aspect, 0.7])
    else:
        left, right = figure.subplots(1, 2, width_ratios=[1.3, 1.0])
    first = skin.snapshot(int(layers[0]))
    above = painter.prepare(left, window, first.time)
    colours = ScalarMappable(Normalize(0.0, painter.stress), "viridis")
    figure.colorbar(colours, ax=left, label="von Mises stress [Pa]", shrink=0.9)
    _draw_force(right, result)
    figure.suptitle(result.scene.title, fontsize=11)
    clock = left.text(0.02, 0.98, "", transform=left.transAxes, va="top", zorder=5, fontsize=9)
    now = right.axvline(first.time, color="black", linewidth=1.0)
    for artist in (*above, clock, now):
        artist.set_animated(True)
    canvas.draw()
    figure.set_layout_engine("none")
    background = canvas.copy_from_bbox(figure.bbox)
    for layer in layers:
        snapshot = skin.snapshot(int(layer))
        canvas.restore_region(background)
        if snapshot.is_finite:
            artists = painter.draw(left, snapshot)
            for artist in artists:
                left.draw_artist(artist)
                artist.remove()
        clock.set_text(f"t = {snapshot.time:.4g} s")
        now.set_xdata([snapshot.time, snapshot.time])
        for artist in (*above, clock):
            left.draw_artist(artist)
        right.draw_artist(now)
        yield np.array(canvas.buffer_rgba())[:, :, :3]


def _size(aspect: float) -> tuple[float, float]:
    """Size of a frame [inches] in which the body's panel fits its height over width."""
    if aspect < FLAT:
        return 8.0, 4.2 + 6.0 * aspect
    return 9.0, float(np.clip(4.0 * aspect + 1.0, 3.2, 6.0))


def _draw_force(axes: Axes, result: Result) -> None:
    time, force = result.history["time"].values, result.history["contact_force"].values
    axes.stairs(force[1:], time, baseline=None, color=_BLUE, linewidth=1.2)
    axes.set_xlim(0.0, float(time[-1]))
    axes.set_xlabel("time [s]")
    axes.set_ylabel("contact force [N]")


def _write_gif(frames: Iterator[Pixels], path: Path, rate: float) -> None:
    palette = Image.new("P", (1, 1))
    palette.putpalette(_colours().ravel().tolist())
    pictures = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    if not pictures:
        raise OSError("no frame is finite")
    first, *rest = pictures
    first.save(
        path, save_all=True, append_images=rest, duration=round(1000 / rate), loop=0, optimize=False
    )


def _colours() -> Pixels:
    """Colours of all frames, shape (256, 3): a GIF that chose them anew would flicker."""
    stress = colormaps["viridis"](np.linspace(0.0, 1.0, 64))[:, :3]
    shades = [shade * stress for shade in (0.82, 0.91, 1.0)]  # of bodies in space
    grey = np.linspace(0.0, 1.0, 32)[:, None] * np.ones(3)
    lines = [
        share * np.array(to_rgb(colour)) + (1.0 - share) * ground
        for colour, ground, shares in ((_BLUE, 1.0, 16), (PRESSURE, 0.8, 16))
        for share in np.linspace(1.0 / shares, 1.0, shares)[:, None]
    ]
    return np.round(255.0 * np.concatenate([*shades, grey, np.array(lines)])).astype(np.uint8)


def _write_mp4(frames: Iterator[Pixels], path: Path, rate: float) -> None:
    try:
        ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ImportError as error:
        raise MissingDependencyError(
            f"{path}: MP4 needs imageio-ffmpeg; `pip install imageio-ffmpeg`, or choose a .gif"
        ) from error
    writer = None
    for frame in frames:
        even = np.ascontiguousarray(frame[: frame.shape[0] // 2 * 2, : frame.shape[1] // 2 * 2])
        if writer is None:
            size = (even.shape[1], even.shape[0])
            writer = ffmpeg.write_frames(str(path), size, fps=rate, macro_block_size=2)
            writer.send(None)
        writer.send(even)
    if writer is None:
        raise OSError("no frame is finite")
    writer.close()
