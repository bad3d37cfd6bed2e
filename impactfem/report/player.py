"""A film as a piece of HTML with a slider, for notebooks: nothing is fetched from the network."""

import base64
import io
from collections.abc import Iterable
from uuid import uuid4

from PIL import Image

_PAGE = """<div id="{name}" style="display:inline-block;max-width:100%">
<img alt="{text}" style="display:block;max-width:100%">
<div style="display:flex;gap:8px;align-items:center">
<button type="button" aria-label="play or stop">&#9654;</button>
<input type="range" min="0" max="{last}" value="{opening}" aria-label="moment" style="flex:1"></div>
<script>(function () {{
  const frames = [{frames}];
  const box = document.getElementById("{name}");
  const [image, slider] = [box.querySelector("img"), box.querySelector("input")];
  const button = box.querySelector("button");
  let timer = null;
  function show() {{ image.src = "data:image/png;base64," + frames[slider.valueAsNumber]; }}
  function stop() {{ clearInterval(timer); timer = null; button.innerHTML = "&#9654;"; }}
  function step() {{
    if (!box.isConnected) {{ stop(); return; }}
    slider.value = (slider.valueAsNumber + 1) % frames.length;
    show();
  }}
  slider.addEventListener("input", function () {{ stop(); show(); }});
  button.addEventListener("click", function () {{
    if (timer !== null) {{ stop(); return; }}
    timer = setInterval(step, {interval});
    button.innerHTML = "&#9632;";
  }});
  show();
}})();</script></div>"""


def player(frames: Iterable[Image.Image], rate: float, text: str, opening: int = 0) -> str:
    """A picture with a slider below it and a button that lets it run.

    Args:
        frames: In RGB.
        rate: Frames a second.
        text: What it shows, for those who do not see it.
        opening: The frame that it shows first.
    """
    codes = [_code(frame) for frame in frames]
    return _PAGE.format(
        name=f"impactfem-{uuid4().hex}",
        text=text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;"),
        last=len(codes) - 1,
        opening=opening,
        frames=",".join(f'"{code}"' for code in codes),
        interval=round(1000.0 / rate),
    )


def _code(frame: Image.Image) -> str:
    """A frame as a PNG of 256 colours, in letters."""
    file = io.BytesIO()
    frame.quantize(256, method=Image.Quantize.FASTOCTREE).save(file, "PNG")
    return base64.b64encode(file.getvalue()).decode("ascii")
