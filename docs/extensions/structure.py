"""Draw the structure of the package as its imports make it, layer by layer."""

import io
import tomllib
from collections import Counter
from pathlib import Path

import grimp
import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "impactfem"
_WIDTH, _HEIGHT = 2.0, 0.62  # of a box
_ACROSS, _DOWN = 2.35, 1.05  # from box to box
_SHOWN = 2  # imports from one part to another from which an arrow is drawn
_COMMON = 7  # parts that import another from which on its arrows are left out


def layers() -> list[list[str]]:
    """Parts of the package by layer, the command line first, as the contract orders them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    ordered = next(c for c in contracts if c["type"] == "layers")["layers"]
    rows = [[name.strip(" ()") for name in row.split("|")] for row in ordered]
    there = [[name for name in row if _path(name) is not None] for row in rows]
    return [row for row in there if row and row != ["__main__"]]


def _path(name: str) -> Path | None:
    folder, module = PACKAGE / name, PACKAGE / f"{name}.py"
    return folder if folder.is_dir() else module if module.exists() else None


def lines(name: str) -> int:
    """Lines of Python in a part."""
    place = _path(name)
    if place is None:
        return 0
    files = place.rglob("*.py") if place.is_dir() else [place]
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def imports() -> dict[tuple[str, str], int]:
    """Number of imports between two parts, by (importing, imported)."""
    graph = grimp.build_graph("impactfem", cache_dir=None)
    found: dict[tuple[str, str], int] = {}
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            pair = tuple(name.split(".")[1] if "." in name else name for name in (module, other))
            if pair[0] != pair[1]:
                found[pair] = found.get(pair, 0) + 1
    return found


def _shift(row: list[str], level: int) -> float:
    """Sideways shift of a layer with one box, so that arrows past it can be told apart."""
    return (0.75 if level % 2 else -0.75) * _ACROSS if len(row) == 1 and level else 0.0


def picture() -> str:
    """The picture as SVG; parts that nearly all others import are bold and have no arrows."""
    rows = layers()
    figure = Figure(figsize=(11.5, 0.62 * len(rows) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    places = {
        name: ((k - (len(row) - 1) / 2) * _ACROSS + _shift(row, level), -level * _DOWN)
        for level, row in enumerate(rows)
        for k, name in enumerate(row)
    }
    found = {pair: n for pair, n in imports().items() if n >= _SHOWN and set(pair) <= set(places)}
    users = Counter(other for _, other in found)
    common = {name for name, count in users.items() if count >= _COMMON}
    for (one, other), count in sorted(found.items()):
        if other in common:
            continue
        (x, y), (to_x, to_y) = places[one], places[other]
        bend = 0.0 if abs(y - to_y) <= 1.5 * _DOWN else 0.12 if x >= to_x else -0.12
        axes.annotate(
            "", (to_x, to_y + _HEIGHT / 2), (x, y - _HEIGHT / 2),
            arrowprops={
                "arrowstyle": "-|>", "color": "#0b559f", "alpha": 0.28, "shrinkA": 0, "shrinkB": 0,
                "linewidth": 0.5 + 0.08 * min(count, 30), "connectionstyle": f"arc3,rad={bend}",
            }, zorder=1,
        )  # fmt: skip
    for name, (x, y) in places.items():
        folder = (PACKAGE / name).is_dir()
        axes.add_patch(
            FancyBboxPatch(
                (x - _WIDTH / 2, y - _HEIGHT / 2), _WIDTH, _HEIGHT,
                boxstyle="round,pad=0.02,rounding_size=0.08", linewidth=0.8, edgecolor="0.35",
                facecolor="#dbe9f6" if folder else "#f6f1e3", zorder=3,
            )
        )  # fmt: skip
        style = {"ha": "center", "va": "center", "zorder": 4}
        axes.text(
            x, y + 0.1, f"{name}/" if folder else name, fontsize=9,
            fontweight="bold" if name in common else "normal", **style,
        )  # fmt: skip
        axes.text(x, y - 0.17, f"{lines(name)} lines", fontsize=6.5, color="0.4", **style)
    wide = max(len(row) for row in rows) * _ACROSS / 2
    axes.set_xlim(-wide, wide)
    axes.set_ylim(-(len(rows) - 1) * _DOWN - 0.6, 0.6)
    axes.set_aspect("equal")
    axes.axis("off")
    text = io.StringIO()
    # Always the same text for the same structure.
    with mpl.rc_context({"svg.hashsalt": "structure"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
