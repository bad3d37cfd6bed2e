"""Golden figures of all shipped scenes and starters, before and after a change of the engine.

    python benchmarks/golden.py --store     # writes benchmarks/results/golden.json
    python benchmarks/golden.py             # compares with it: exit code 1 beyond 1e-10

Of each scene the figures of its summary, and of each column of its history the root of the sum of
squares, which any row changes. Numbers of another processor may differ by rounding, and more where
a motion forgets its start: store anew on the machine that compares, from the commit before.
"""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import stamp

import impactfem
from impactfem.shipped import shipped_scenes
from impactfem.starting import starters

STORE = Path(__file__).parent / "results" / "golden.json"
LIMIT = 1e-10
_PARTS = {
    "": ("num_dofs", "num_steps"),
    "energy": ("initial", "final", "max_relative_drift"),
    "contact": ("max_force", "impulse", "max_penetration"),
    "error": ("displacement_max", "displacement_l2", "force_l1"),
}
_SHARES = ("error.", "energy.max", "contact.max_penetration")
_SAME = {"N m": "J"}


def figures(path: Path) -> dict[str, float]:
    """Figures of a scene by name."""
    scene = impactfem.Scene.from_toml(path).with_settings({"output.fields": []})
    result = impactfem.solve(scene)
    summary: Mapping[str, Any] = result.summary
    found = {}
    for part, names in _PARTS.items():
        values = summary[part] if part else summary
        found |= {f"{part}.{k}".strip("."): values[k] for k in names if (values or {}).get(k)}
    for name, column in result.history.items():
        norm = float(np.sqrt(np.nansum(np.square(column.values))))
        found[f"column {name} [{_SAME.get(column.attrs['units'], column.attrs['units'])}]"] = norm
    return {name: value for name, value in found.items() if isinstance(value, int | float)}


def differences(old: Mapping[str, float], new: Mapping[str, float]) -> list[tuple[float, str]]:
    """Relative differences, the largest first; infinite where one has no such figure.

    Errors are told to few digits: they are compared as shares of what they are errors of, which is
    of order one. Columns are compared with the largest of their unit, as some are but rounding.
    """
    found, largest = [], dict[str, float]()
    for name, value in new.items():
        largest[_unit(name)] = max(abs(value), largest.get(_unit(name), 0.0))
    for name in old.keys() | new.keys():
        a, b = old.get(name, np.inf), new.get(name, np.inf)
        scale = 1.0 if name.startswith(_SHARES) else max(abs(a), abs(b))
        if name.startswith("column "):
            scale = max(scale, largest.get(_unit(name), 0.0))
        found.append((abs(a - b) / scale if scale and np.isfinite(a - b) else float(a != b), name))
    return sorted(found, reverse=True)


def _unit(name: str) -> str:
    """Unit of a column by its name here; the name of another figure."""
    return name.partition("[")[2] if name.startswith("column ") else name


def main() -> int:
    """Store or compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--store", action="store_true", help="write the figures")
    parser.add_argument("--only", default="", help="scenes whose name contains this")
    given = parser.parse_args()
    scenes = {**{f"new {k}": path for k, path in starters().items()}, **shipped_scenes()}
    new = {}
    for name, path in scenes.items():
        if given.only in name:
            new[name] = figures(path)
            print(name, len(new[name]), "figures", flush=True)
    if given.store:
        STORE.write_text(json.dumps(stamp.stamp() | {"figures": new}, indent=1) + "\n")
        return 0
    old, worst = json.loads(STORE.read_text())["figures"], 0.0
    for name, found in new.items():
        apart, where = differences(old.get(name, {}), found)[0]
        worst = max(worst, apart)
        if apart > LIMIT:
            print(f"{name}: {where} differs by {apart:.2g}")
    print(f"largest difference {worst:.2g}")
    return int(worst > LIMIT)


if __name__ == "__main__":
    sys.exit(main())
