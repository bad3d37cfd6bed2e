"""What a page carries within itself: plotly.js, data as JSON, pictures as base64."""

import base64
import json
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

# Debian keeps its plotly.js outside the Python package.
_DEBIAN = Path("/usr/share/python3-plotly/plotly.js")


@cache
def plotly_script() -> str | None:
    """Text of plotly.js as the plotly package brings it; None if it is not installed.

    The package is not imported, which would take ten times as long as reading the file.
    """
    places = [_DEBIAN]
    found = find_spec("plotly")
    if found is not None and found.origin is not None:
        places.insert(0, Path(found.origin).parent / "package_data" / "plotly.min.js")
    for place in places:
        if place.is_file():
            return script_text(place.read_text(encoding="utf-8"))
    return None


def script_text(code: str) -> str:
    """JavaScript that may stand in a script element: nothing in it ends the element early."""
    return code.replace("</script", "<\\/script").replace("<!--", "<\\!--")


def json_text(data: Any) -> str:
    """JSON that may stand in a script element, whatever texts it holds.

    Raises:
        ValueError: A number is not finite.
    """
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for sign, escaped in (("<", "\\u003c"), (">", "\\u003e"), ("&", "\\u0026")):
        text = text.replace(sign, escaped)
    return text


def picture_address(picture: bytes) -> str:
    """A PNG picture as the address of an image element."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode('ascii')}"
