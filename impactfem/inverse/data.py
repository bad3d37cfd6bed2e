"""What was measured: the files and numbers of a scene's measures."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import OutputError
from impactfem.result.record import Record
from impactfem.scene import Scene
from impactfem.scene.inverse import Measure
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_MOST = 1_000_000  # lines of a file


@dataclass(frozen=True)
class Data:
    """Times of a measure, and what was measured there.

    Attributes:
        times: [s], (n,).
        values: (n,); None if nothing was measured.
        sigma: Standard deviations (n,); None if unknown.
        by_rows: Whether they are rows of a run: of forces means over the step before.
    """

    times: Floats
    values: Floats | None = None
    sigma: Floats | None = None
    by_rows: bool = False


def data_of(scene: Scene, index: int) -> Data:
    """Times and values of a measure.

    Raises:
        SceneError: The file cannot be read, or does not fit the run; the message names the key.
    """
    measure, where = scene.measures[index], f"measure[{index}]"
    if measure.result is not None:
        return _of_run(scene, measure, where)
    if measure.data is None:
        at = np.array([scene.duration if measure.at is None else measure.at])
        values = None if measure.value is None else np.array([measure.value])
        return Data(at, values, None if measure.sigma is None else np.full(1, measure.sigma))
    path = Path(scene.folder or "", measure.data)
    table = _table(path, where, measure)
    times, values = table[:, 0], table[:, 1]
    if (wrong := (times < 0.0) | (times > scene.duration * (1.0 + 1e-12))).any():
        text = f" = {show(measure.data)} has the time {times[wrong][0]:g} s, the run lasts from 0 "
        raise KeyedError(where, "data", f"{text}to {scene.duration:g} s: leave it out.")
    sigma = table[:, 2] if table.shape[1] > 2 else None
    if measure.sigma is not None:
        sigma = np.full(len(times), measure.sigma)
    if sigma is not None and not (sigma > 0.0).all():
        text = f" = {show(measure.data)} has a sigma that is not > 0: give standard deviations."
        raise KeyedError(where, "data", text)
    order = np.argsort(times, kind="stable")
    return Data(times[order], values[order], None if sigma is None else sigma[order])


def _of_run(scene: Scene, measure: Measure, where: str) -> Data:
    """The history of another run, as long as both last."""

    def refuse(why: str) -> KeyedError:
        return KeyedError(where, "result", f" = {show(measure.result)}: {why}.")

    try:
        history = Record.load(Path(scene.folder or "", str(measure.result))).rows
    except OutputError as error:
        raise refuse(str(error)) from None
    columns = [name for name, column in history.items() if column.values.ndim == 1]
    if measure.of not in columns:
        raise refuse(f"its history has no {show(measure.of)}; {meant(measure.of, columns)}")
    unit = history[measure.of].attrs.get("units")
    if measure.unit is not None and measure.unit != unit:
        raise refuse(f"there {measure.of} is in {unit}, not in unit = {show(measure.unit)}")
    times, values = (np.asarray(history[name].values, float) for name in ("time", measure.of))
    both = times <= scene.duration * (1.0 + 1e-12)
    sigma = None if measure.sigma is None else np.full(np.count_nonzero(both), measure.sigma)
    return Data(np.minimum(times[both], scene.duration), values[both], sigma, by_rows=True)


def _table(path: Path, where: str, measure: Measure) -> Floats:
    """Lines time, value and perhaps sigma; a line that names them may stand first."""

    def refuse(why: str) -> KeyedError:
        text = f" = {show(measure.data)}: {why}; give lines time,value or time,value,sigma."
        return KeyedError(where, "data", text)

    try:
        if not path.is_file():
            raise refuse("there is no such file")
        with path.open(encoding="utf-8-sig") as file:
            lines = file.readlines(100 * _MOST)
    except (OSError, UnicodeDecodeError) as error:
        raise refuse(f"it cannot be read ({error})") from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].replace(",", " ").replace(";", " ").split()
        if not words or (not rows and _is_heading(words)):
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            raise refuse(f"line {number} holds {show(line.strip()[:40])}") from None
        if len(words) not in {2, 3} or len(words) != len(rows[0]):
            raise refuse(f"line {number} has {len(words)} numbers")
        if not np.isfinite(rows[-1]).all():
            raise refuse(f"line {number} has a number that is not finite")
    if not rows:
        raise refuse("it holds no numbers")
    return np.array(rows)


def _is_heading(words: list[str]) -> bool:
    """Whether a line names columns."""
    return words[:2] == ["time", "value"]
