"""What is probably meant by a line that is not TOML."""

import re

_NUMBER = r"[-+]?[0-9][0-9_.]*([eE][-+]?[0-9]+)?"

# Tried in this order on what stands behind the equals sign; the first that fits is told.
_VALUES = (
    (rf"{_NUMBER}\s*,\s*[0-9]", "write decimals with a dot, not a comma"),
    (r".*//", "a comment begins with #"),
    (r".*;$", "remove the semicolon"),
    (rf"{_NUMBER}\s*(\*|\^|x ?10)", "write powers of ten as 2.1e11, and a formula in quotes"),
    (rf"{_NUMBER}\s*[^\W\d_]+", "leave the unit out: the scene reference names it"),
    (r"(True|False|TRUE|FALSE|yes|no)\b", "write true or false"),
    (r"[^\W\d_][\w ]*$", "put the text in quotes"),
    (r"'[^']*$", "close the quotes"),
    (r'"[^"]*$', "close the quotes"),
    (r"\.[0-9]", "write a 0 before the dot"),
    (rf"{_NUMBER}\.$", "write a digit behind the dot"),
    (r"\($", "write a list as [0.0, 1.0]"),
    (r"\(.*\)$", "write a list as [0.0, 1.0]"),
    (r"\{.*:", "in { } write key = value, not key: value"),
    (r"$", "give a value behind the ="),
)
# Tried on the message of the reader, before the line is looked at and after.
_CERTAIN = (
    ("overwrite", "the key stands there already, remove one"),
    ("twice", "the table stands there already, put its keys together"),
    ("unclosed array", "close the [ that begins before with ]"),
)
_LIKELY = (
    ("array", "separate entries by a comma, and close the [ with ]"),
    ("inline table", "close the { in its own line with }, entries separated by a comma"),
)
_USUAL = "key = value, texts in quotes, each key once"


def toml_hint(error: str, line: str) -> str:
    """Return what to correct.

    Args:
        error: message of the TOML reader.
        line: the line it names; empty if it names none.
    """
    said = error.lower()
    certain = next((hint for part, hint in _CERTAIN if part in said), "")
    likely = next((hint for part, hint in _LIKELY if part in said), "")
    return certain or _hint_of_line(line) or likely or _USUAL


def _hint_of_line(line: str) -> str:
    """What is wrong with a line by its looks; empty if it looks right."""
    name, equals, value = line.partition("=")
    if equals:
        given = re.sub(r"#[^\"']*$", "", value).strip()
        return next((hint for pattern, hint in _VALUES if re.match(pattern, given)), "")
    heading = name.partition("#")[0].strip()
    if heading.startswith("["):
        return "close the brackets of the heading" * (heading.count("[") != heading.count("]"))
    return "write key = value, with = and not a colon" * (":" in name)
