"""What a page carries within itself: plotly.js, data as JSON, pictures as base64."""

import base64
import io
import json
import zlib
from pathlib import Path
from typing import Any

from PIL import Image

PLOTLY = Path(__file__).parent / "plotly.min.js.gz"
"""The parts of plotly.js that pages draw with, made by .ci/plotly-bundle."""

_LARGE = 250_000  # bytes of a picture from which it is worth the time to compress it again
_FAST = 1  # level of compression: the numbers of a page take milliseconds


def packed(name: str, data: bytes) -> str:
    """An element whose text page.js unpacks into itself: gzip in base64.

    Args:
        name: Its id.
        data: A gzip file.
    """
    code = base64.b64encode(data).decode("ascii")
    return f'<script type="application/gzip" id="{name}">{code}</script>'


def compressed(text: str) -> bytes:
    """A text as a gzip file, without a time."""
    packer = zlib.compressobj(_FAST, wbits=31)
    return packer.compress(text.encode("utf-8")) + packer.flush()


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
    """A PNG picture as the address of an image element; a large one as WebP, a quarter as large."""
    kind = "png"
    if len(picture) > _LARGE:
        file, kind = io.BytesIO(), "webp"
        Image.open(io.BytesIO(picture)).save(file, kind, quality=90, method=2)
        picture = file.getvalue()
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"
