// Starts the interactive parts of the page; the still pictures stay open where that fails.
"use strict";
(function () {
  const still = document.getElementById("still");
  const data = (id) => {
    const element = document.getElementById(id);
    return element === null ? null : JSON.parse(element.textContent);
  };
  const parts = document.querySelectorAll(".interactive");
  const show = (visible) => parts.forEach((part) => { part.hidden = !visible; });
  let shown = typeof Plotly !== "undefined";
  show(shown); // charts measure the room that they have
  try {
    if (shown) {
      const motion = data("motion-data");
      if (motion !== null) impactfemMotion("motion-view", motion);
      impactfemCharts(data("charts-data") || []);
    }
  } catch (problem) {
    shown = false;
    show(false);
    console.error(problem);
  }
  document.documentElement.classList.toggle("live", shown);
  if (still !== null) {
    if (shown) still.open = false;
    let open = still.open;
    window.addEventListener("beforeprint", () => { open = still.open; still.open = true; });
    window.addEventListener("afterprint", () => { still.open = open; });
  }
})();
