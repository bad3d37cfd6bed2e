"""Wrong scenes made from the shipped ones: one mistake each, drawn with fixed seeds."""

import copy
import random
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from impactfem.scene import describe
from impactfem.scene.toml import write_value
from impactfem.shipped import shipped_scenes

LETTERS = "abcdefghijklmnopqrstuvwxyz_"
# Keys by their table; what a text may be is told apart by the words of the reference.
ROWS = {(table.name, row.key): row for table in describe() for row in table.keys}
KEYS = {name for _, name in ROWS}


@dataclass
class Wrong:
    """A wrong scene: its text, files beside it, and what the message must hold."""

    name: str
    text: bytes
    says: list[str]
    files: dict[str, str] = field(default_factory=dict)
    data: dict | None = None


def by_hand():
    """Mistakes of people, from wrong_scenes.toml."""
    path = Path(__file__).with_name("wrong_scenes.toml")
    scenes = shipped_scenes()
    for entry in tomllib.loads(path.read_text(encoding="utf-8"))["wrong"]:
        text = scenes[entry["scene"]].read_text(encoding="utf-8")
        for old, new in entry.get("change", []):
            assert old in text, (entry["name"], old)
            text = text.replace(old, new, 1)
        content = (text + entry.get("end", "")).encode(entry.get("encoding", "utf-8"))
        yield Wrong(entry["name"], content, entry["says"], entry.get("files", {}))


def heading(path, table):
    """Name of a table in the reference."""
    if not path:
        return "top level"
    if path[-1] in {"solve", "output"}:
        return f"[{path[-1]}]"
    if path[-1] == "shape":
        return f'shape = {{ kind = "{table["kind"]}" }}'
    if len(path) == 2:
        kind = f' with kind = "{table["kind"]}"' if path[0] in {"body", "obstacle"} else ""
        return f"[[{path[0]}]]{kind}"
    return f"{path[-2]} = [{{ ... }}]"


def tables(data, path=()):
    """Every table of a scene with its path."""
    if isinstance(data, dict):
        yield path, data
    pairs = data.items() if isinstance(data, dict) else enumerate(data)
    for name, value in pairs:
        if isinstance(value, dict | list):
            yield from tables(value, (*path, name))


def place(path):
    """A path as messages write it."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.lstrip(".")


def edited(word, draw):
    """The word with one edit: a letter left out, doubled, exchanged or replaced."""
    i = draw.randrange(len(word))
    return draw.choice(
        [
            word[:i] + word[i + 1 :],
            word[:i] + word[i] + word[i:],
            word[:i] + word[i : i + 2][::-1] + word[i + 2 :],
            word[:i] + draw.choice(LETTERS) + word[i + 1 :],
        ]
    )


def misspelt(word, taken, draw):
    """The word with one edit, which makes it another than all that are taken."""
    while (other := edited(word, draw)) in {*taken, ""}:
        pass
    return other


def positions(data, fits):
    """Paths of keys whose row of the reference fits, with their row and value."""
    for path, table in tables(data):
        for name, value in table.items():
            row = ROWS.get((heading(path, table), name))
            if row is not None and fits(row, value):
                yield path, table, name, row


def _renamed(table, old, new):
    """Rename a key where it stands."""
    entries = [(new if name == old else name, value) for name, value in table.items()]
    table.clear()
    table.update(entries)


def misspell_key(data, draw):
    found = list(positions(data, lambda row, _: len(row.key) > 3 and row.key != "name"))
    path, table, name, _ = draw.choice(found)
    new = misspelt(name, KEYS, draw)
    _renamed(table, name, new)
    return [place((*path, new)), f'did you mean "{name}"?']


def leave_out(data, draw):
    path, table, name, _ = draw.choice(list(positions(data, lambda r, _: r.default == "required")))
    del table[name]
    return [f"{place((*path, name))} is missing"]


def give_unit(data, draw):
    fits = lambda row, value: row.type == "number" and isinstance(value, int | float)  # noqa: E731
    path, table, name, row = draw.choice(list(positions(data, fits)))
    table[name] = f"{table[name]} {row.unit or 'm'}"
    return [place((*path, name)), "without quotes and without unit", row.unit]


def negate(data, draw):
    fits = lambda row, value: "number > 0" in row.allowed and isinstance(value, int | float)  # noqa: E731
    path, table, name, _ = draw.choice(list(positions(data, fits)))
    table[name] = -table[name]
    return [f"{place((*path, name))} = {table[name]}", "it must be > 0"]


def wrong_type(data, draw):
    fits = lambda row, _: row.type in {"number", "integer", "text", "list of texts"}  # noqa: E731
    path, table, name, row = draw.choice(list(positions(data, fits)))
    table[name] = draw.choice([True, {"value": 1.0}, [[1.0]]])
    return [place((*path, name)), row.doc] if name != "kind" else [place((*path, name)), "give"]


def another_length(data, draw):
    fits = lambda row, value: isinstance(value, list) and row.type == "list of numbers"  # noqa: E731
    found = list(positions(data, fits))
    if not found:
        return None
    path, table, name, _ = draw.choice(found)
    table[name] = table[name] + [0.0] * 3
    return [place((*path, name)), f"{len(table[name])} entries"]


def misspell_word(data, draw):
    fits = lambda row, value: isinstance(value, str) and f'"{value}"' in row.allowed  # noqa: E731
    found = [(p, t, n) for p, t, n, _ in positions(data, fits)]
    found += [(p, t, "kind") for p, t in tables(data) if len(p) == 2 and "kind" in t]
    path, table, name = draw.choice(found)
    word = table[name]
    table[name] = misspelt(word, [word], draw)
    return [place((*path, name)), f'did you mean "{word}"?']


def misplace(data, draw):
    path, table = draw.choice([entry for entry in tables(data) if len(entry[0]) == 2])
    name = draw.choice(["title", "duration"])
    table[name] = data.pop(name)
    return [place((*path, name)), "belongs to the top of the file"]


OPERATORS = (
    misspell_key, leave_out, give_unit, negate, wrong_type, another_length, misspell_word, misplace,
)  # fmt: skip


def written(data):
    """A scene as TOML, each table in one line."""
    return "".join(f"{name} = {write_value(value)}\n" for name, value in data.items()).encode()


def mutations():
    """One wrong scene of each shipped scene and operator that applies."""
    number = 0
    for scene, path in shipped_scenes().items():
        good = tomllib.loads(path.read_text(encoding="utf-8"))
        for operator in OPERATORS:
            number += 1
            data = copy.deepcopy(good)
            says = operator(data, random.Random(number))  # noqa: S311
            if says is not None:
                yield Wrong(f"{scene}, {operator.__name__}", written(data), says, data=data)
