/* Draws the charts and the moving picture of a run; needs Plotly, motion_tools.js and motion_views.js, nothing else.
   impactfemCharts([{element: "id", figure: {data, layout}}, ...]) draws every chart into its element.
   impactfemMotion("id", payload) builds the moving picture of report/page/motion.py in an element. */
"use strict";
(function () {
  const CONFIG = {responsive: true, displaylogo: false, modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]]};
  const SECONDS = 8; // that playing takes
  const PAPER = 640; // width of charts in print [px]
  const FLAT = 0.3; // height over width below which the force stands below the picture
  const ROUNDING = 1e-9; // of the largest number, below which the readout says 0,
  const NOTHING = 1e-15; // as below this
  const {make, short, prefixed, largest} = impactfemTools;
  const plots = [];

  function draw(element, figure, config) {
    Plotly.newPlot(element, figure.data, figure.layout, config);
    plots.push(element);
  }

  function impactfemCharts(list) {
    for (const chart of list) {
      const element = document.getElementById(chart.element || chart.id || "chart-" + chart.name);
      if (element) draw(element, chart.figure, CONFIG);
    }
  }

  /* The force over time with a line at the time of the picture; pressing in it calls jump(time). */
  function forcePlot(pane, data, height, jump) {
    const given = data.curve, times = prefixed("s", largest(given.time)), forces = prefixed("N", largest(given.force.concat(given.exact_force || [])));
    const scaled = (list, unit) => list && list.map((v) => (v === null ? null : unit.factor * v)), traces = [];
    const curve = {time: scaled(given.time, times), force: scaled(given.force, forces), exact_time: scaled(given.exact_time, times), exact_force: scaled(given.exact_force, forces)};
    const hover = "t = %{x:.6g} " + times.unit + "<br>%{y:.6g} " + forces.unit;
    if (curve.exact_time) {
      traces.push({x: curve.exact_time, y: curve.exact_force, name: "exact", mode: "lines", line: {color: "#d95f02", width: 4}, opacity: 0.6, hovertemplate: hover + "<extra>exact</extra>"});
    }
    traces.push({x: curve.time, y: curve.force, name: "run", mode: "lines", line: {color: "#0b559f", width: 1.4, shape: "vh"}, hovertemplate: hover + "<extra>run</extra>"});
    const axis = (title) => ({title: {text: title, standoff: 8}, zeroline: false, gridcolor: "#e6e6e6", linecolor: "#999999", ticks: "outside", automargin: true, exponentformat: "power"});
    const layout = {
      height, margin: {l: 60, r: 20, t: 28, b: 45}, dragmode: false, showlegend: traces.length > 1,
      legend: {orientation: "h", x: 0, y: 1.02, yanchor: "bottom"}, font: {family: "system-ui, sans-serif", size: 12, color: "#222222"},
      paper_bgcolor: "#ffffff", plot_bgcolor: "#ffffff", modebar: {orientation: "v", bgcolor: "rgba(0,0,0,0)"},
      xaxis: {...axis("time [" + times.unit + "]"), range: [curve.time[0], curve.time[curve.time.length - 1]]}, yaxis: axis("contact force [" + forces.unit + "]"),
      shapes: [{type: "line", xref: "x", yref: "paper", x0: curve.time[0], x1: curve.time[0], y0: 0, y1: 1, line: {color: "#222222", width: 1.5}},
        ...(given.spans || []).map(([a, b]) => ({type: "rect", xref: "x", yref: "paper", x0: times.factor * a, x1: times.factor * b, y0: 0, y1: 1, layer: "below", fillcolor: "#eeeeee", line: {width: 0.5, color: "#dddddd"}}))],
    };
    draw(pane, {data: traces, layout}, CONFIG);
    pane.on("plotly_relayout", (change) => { if ("xaxis.range[0]" in change && pane._fullLayout.dragmode) Plotly.relayout(pane, {dragmode: false}); }); // once enlarged, pressing moves the time again
    const press = (event) => {
      if (pane._fullLayout.dragmode || event.target.closest(".modebar")) return;
      const full = pane._fullLayout, left = pane.getBoundingClientRect().left + full.xaxis._offset;
      const time = full.xaxis.p2c(event.clientX - left);
      if (event.buttons === 1 && time >= full.xaxis.range[0] && time <= full.xaxis.range[1]) jump(time / times.factor);
    };
    pane.addEventListener("pointerdown", press, true);
    pane.addEventListener("pointermove", press, true);
    pane.style.cursor = "pointer";
    return (time) => Plotly.relayout(pane, {"shapes[0].x0": times.factor * time, "shapes[0].x1": times.factor * time});
  }

  function impactfemMotion(id, data) {
    const root = document.getElementById(id);
    if (!root || !data) return;
    root.textContent = "";
    const state = {frame: 0, factor: data.factor, timer: 0}, last = data.times.length - 1;
    const panes = make("div", "display:flex;flex-wrap:wrap;gap:12px;align-items:center", root);
    const picture = make("div", "flex:1.2 1 320px;min-width:0;max-width:100%", panes);
    const force = make("div", "flex:1 1 300px;min-width:0;max-width:100%;overflow:hidden", panes);
    const controls = make("div", "display:flex;flex-wrap:wrap;gap:10px;align-items:center;margin-top:6px", root);
    const play = make("button", "min-width:5em;font:inherit;padding:2px 10px", controls, "Play");
    play.type = "button";
    const label = make("label", "flex:1 1 240px;display:flex;gap:8px;align-items:center", controls, "Time");
    const slider = make("input", "flex:1;min-width:120px", label);
    Object.assign(slider, {type: "range", min: 0, max: last, step: 1, value: 0});
    const text = make("p", "margin:4px 0;font-variant-numeric:tabular-nums", root);
    text.className = "motion-readout";
    text.setAttribute("aria-live", "off");

    if (data.kind === "bars") picture.style.flexBasis = "100%";
    const paint = impactfemViews[data.kind](picture, data, state);
    paint();
    const canvas = picture.querySelector("canvas"), flat = canvas && canvas.height < FLAT * canvas.width;
    if (flat) picture.style.flexBasis = force.style.flexBasis = "100%";
    const nearest = (time) => data.times.reduce((best, t, k) => (Math.abs(t - time) < Math.abs(data.times[best] - time) ? k : best), 0);
    const mark = forcePlot(force, data, flat ? 300 : 340, (time) => { stop(); show(nearest(time)); });

    const told = (list, unit) => {
      const most = largest(list), shown = prefixed(unit, most), value = list[state.frame];
      const size = value === null || Math.abs(value) >= Math.max(ROUNDING * most, NOTHING) ? 1 : 0;
      return short(value === null ? null : size * shown.factor * value) + " " + shown.unit;
    };
    const peak = data.force.reduce((best, v, k) => (v > data.force[best] ? k : best), 0);
    function show(frame) {
      state.frame = frame;
      state.moved = true;
      slider.value = frame;
      const time = "t = " + told(data.times, "s");
      slider.setAttribute("aria-valuetext", time);
      text.textContent = time + " · contact force " + told(data.force, "N") + " · gap " + told(data.gap, "m");
      paint();
      mark(data.times[frame]);
    }
    function stop() {
      clearInterval(state.timer);
      state.timer = 0;
      play.textContent = "Play";
    }
    play.addEventListener("click", () => {
      if (state.timer) return stop();
      if (state.frame === last || state.frame === peak && !state.moved) show(0);
      play.textContent = "Pause";
      state.timer = setInterval(() => (state.frame < last ? show(state.frame + 1) : stop()), Math.max(40, 1000 * SECONDS / (last + 1)));
    });
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    if (data.factors.length > 1) {
      const scale = make("label", "display:flex;gap:6px;align-items:center", controls, data.kind === "bars" ? "Motion and gaps ×" : "Displacement ×");
      const choice = make("select", "font:inherit", scale);
      for (const factor of data.factors) {
        const option = make("option", "", choice, String(factor));
        option.value = factor;
        option.selected = factor === data.factor;
      }
      choice.addEventListener("change", () => { state.factor = Number(choice.value); show(state.frame); });
    }
    if (data.caption) make("p", "margin:4px 0;color:#444444", root, data.caption);
    show(peak); // the first look is at the largest force; playing begins at t = 0
    state.moved = false;
  }

  window.addEventListener("beforeprint", () => plots.forEach((plot) => Plotly.relayout(plot, {autosize: false, width: Math.min(PAPER, plot.clientWidth || PAPER)})));
  window.addEventListener("afterprint", () => plots.forEach((plot) => Plotly.relayout(plot, {autosize: true, width: null})));
  Object.assign(window, {impactfemCharts, impactfemMotion});
})();
