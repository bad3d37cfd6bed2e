// Starts the interactive parts of the page; the still pictures stay open where that fails.
"use strict";
(async function () {
  const still = document.getElementById("still");
  const parts = document.querySelectorAll(".interactive");
  const show = (visible) => parts.forEach((part) => { part.hidden = !visible; });
  /* The text of an element that is a gzip file in base64; the element then holds that text. */
  const unpack = async (id) => {
    const element = document.getElementById(id);
    if (element === null) return null;
    const bytes = Uint8Array.from(atob(element.textContent), (sign) => sign.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return (element.textContent = await new Response(stream).text());
  };
  let shown = true;
  try {
    const [code, motion, charts] = await Promise.all(["plotly", "motion-data", "charts-data"].map(unpack));
    const script = document.createElement("script");
    script.textContent = code;
    document.head.append(script);
    show(true); // charts measure the room that they have
    if (motion !== null) impactfemMotion("motion-view", JSON.parse(motion));
    impactfemCharts(JSON.parse(charts) || []);
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
