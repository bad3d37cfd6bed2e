"""Tables of reference pages that come from the code: scene language, columns of a history."""

import re

from md_tables import code, table

from impactfem.findings import CODES
from impactfem.result.history import (
    ANGULAR,
    BODY_COLUMNS,
    COLUMNS,
    JOINT_COLUMNS,
    PAIR_COLUMNS,
    PROBE_COLUMNS,
)
from impactfem.scene.schema import describe

KEY = '<a class="key" id="{place}" href="#{place}"><code>{key}</code></a>'


def slug(name: str) -> str:
    """Anchor of a table of the scene language, such as body-solid or solve."""
    return "-".join(re.findall(r"[a-z_]+", name.replace("kind", "").replace("with", "")))


def scene_reference() -> str:
    """Every table and key of the scene language, from its schema; each can be linked."""
    parts = []
    for group in describe():
        anchor = slug(group.name)
        rows = [
            (
                KEY.format(place=f"{anchor}-{row.key}", key=row.key),
                row.doc, row.unit,
                row.default if row.default.isalpha() or " " in row.default else code(row.default),
                row.allowed,
            )
            for row in group.keys
        ]  # fmt: skip
        title = "Top level" if group.name == "top level" else f"`{group.name}`"
        shown = table(("key", "meaning", "unit", "default", "allowed"), rows)
        parts.append(f"## {title}\n\n{shown}\n")
    return "".join(parts)


def finding_codes() -> str:
    """Codes of findings, from the module that names them."""
    return table(("code", "says"), [(code(name), text) for name, text in CODES.items()])


def history_columns() -> str:
    """Columns of a history, from the module that writes it."""
    rows = [(code("time"), "s", "end of time step m; row 0 is the initial state")]
    rows += [(code(name), unit, text) for name, (unit, text) in COLUMNS.items()]
    rows.append((code("angular_momentum"), *ANGULAR))
    rows += [(code(f"NAME.{name}"), *told) for name, told in BODY_COLUMNS.items()]
    rows += [(code(f"{name}.PAIR"), *told) for name, told in PAIR_COLUMNS.items()]
    rows += [(code(f"PROBE.{name}"), *told) for name, told in PROBE_COLUMNS.items()]
    rows += [(code(f"NAME.JOINT.{name}"), *told) for name, told in JOINT_COLUMNS.items()]
    return table(("column", "unit", "meaning"), rows)


PARTS = {"keys": scene_reference, "columns": history_columns, "findings": finding_codes}
