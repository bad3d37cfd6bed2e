/* Views of the moving picture, one for each kind of payload: view(pane, data, state) returns what paints state.frame.
   Needs motion_tools.js, and Plotly for bodies in space. */
"use strict";
const impactfemViews = (function () {
  const {STRESS, SIGNED, SOLID, EDGE, FOOT, unpack, tint, titled, stage, mapping, widened, legend, grid, drawObstacles, windows, fitted} = impactfemTools;
  const BODIES = ["#0b559f", "#d95f02", "#1b7837", "#7b3294", "#b2182b", "#666666"];
  const PLAIN = "#7a9cc6"; // balls and tubes, which have no stress
  const PRESSED = "#d95f02"; // boundary under contact pressure
  const LEVELS = 48; // of colours
  const LIGHT = {x: 4e4, y: 8e4, z: -1e5}; // as the camera sees it: right, up, negative towards it
  const ZOOM = 1.5; // of bodies in space

  function barsView(pane, data, state) {
    const motion = unpack(data.motion), value = unpack(data.value), nodes = data.base.length;
    const bounds = (factor) => {
      let low = data.wall ? 0 : Infinity, high = -Infinity;
      motion.forEach((m, k) => { const x = data.base[k % nodes] + factor * m; low = Math.min(low, x); high = Math.max(high, x); });
      return [low, high];
    };
    return stage(pane, () => 150, (ctx, width, height) => {
      const [low, high] = bounds(state.factor), left = data.wall ? 22 : 10, scale = (width - left - 10) / (high - low);
      const X = (x) => left + scale * (x - low), top = 34, thick = 46, foot = height - 36;
      if (data.wall) {
        ctx.fillStyle = SOLID;
        ctx.fillRect(0, 12, X(0), foot - 12);
        ctx.fillStyle = EDGE;
        ctx.fillRect(X(0) - 1.5, 12, 1.5, foot - 12);
      }
      let node = 0, piece = state.frame * (nodes - data.counts.length);
      data.counts.forEach((count, body) => {
        const at = (k) => X(data.base[k] + state.factor * motion[state.frame * nodes + k]), first = at(node), last = at(node + count - 1);
        for (let k = 0; k < count - 1; k++, piece++) {
          ctx.fillStyle = tint(SIGNED, 0.5 + 0.5 * (data.limit ? value[piece] / data.limit : 0));
          const a = at(node + k);
          ctx.fillRect(a, top, Math.max(at(node + k + 1) - a, 0) + 0.6, thick);
        }
        ctx.strokeStyle = "#222222";
        ctx.lineWidth = 1;
        ctx.strokeRect(first, top, last - first, thick);
        ctx.fillStyle = "#222222";
        ctx.textAlign = "center";
        if (last - first > ctx.measureText(data.names[body]).width) ctx.fillText(data.names[body], (first + last) / 2, top - 8);
        node += count;
      });
      legend(ctx, width, height, scale, state.factor, SIGNED, -data.limit, data.limit, data.valueName);
    });
  }

  function planeView(pane, data, state) {
    const reference = unpack(data.reference), moved = unpack(data.displacement), value = unpack(data.value);
    const triangles = unpack(data.triangles), segments = unpack(data.segments), length = reference.length, cache = {};
    const place = (f, k) => reference[k] + state.factor * moved[f * length + k];
    const view = () => (cache[state.factor] = cache[state.factor] || windows(data.times.length, length / 2, place, data.mirror, data.size));
    return stage(pane, (width) => fitted(view().at(0), 470)(width), (ctx, width, height) => {
      const f = state.frame, map = mapping(view().at(f), width, height, FOOT);
      if (view().follows) grid(ctx, map, width, height);
      drawObstacles(ctx, map, data.obstacles, f, width, height, false);
      if (data.mirror) drawObstacles(ctx, map, data.obstacles, f, width, height, true);
      const half = length / 2, y = Float64Array.from({length: half}, (_, k) => map.Y(place(f, 2 * k + 1)));
      for (const side of data.mirror ? [1, -1] : [1]) {
        const x = Float64Array.from({length: half}, (_, k) => map.X(side * place(f, 2 * k)));
        const groups = Array.from({length: LEVELS + 1}, () => []), plain = 3 * data.coloured;
        for (let t = 0; t < triangles.length; t += 3) {
          if (t >= plain) { groups[LEVELS].push(t); continue; }
          const mean = (value[f * half + triangles[t]] + value[f * half + triangles[t + 1]] + value[f * half + triangles[t + 2]]) / 3;
          groups[Math.min(LEVELS - 1, Math.floor(LEVELS * mean / data.limit))].push(t);
        }
        groups.forEach((group, level) => {
          if (!group.length) return;
          ctx.fillStyle = ctx.strokeStyle = level < LEVELS ? tint(STRESS, level / (LEVELS - 1)) : PLAIN;
          ctx.lineWidth = 0.7;
          ctx.beginPath();
          for (const t of group) [0, 1, 2].forEach((c) => ctx[c ? "lineTo" : "moveTo"](x[triangles[t + c]], y[triangles[t + c]]));
          ctx.fill();
          // A thin line closes the seams between neighbours.
          ctx.beginPath();
          for (const t of group) [0, 1, 2, 0].forEach((c, k) => ctx[k ? "lineTo" : "moveTo"](x[triangles[t + c]], y[triangles[t + c]]));
          ctx.stroke();
        });
        const edge = (list, style, thick) => {
          ctx.strokeStyle = style;
          ctx.lineWidth = thick;
          ctx.beginPath();
          for (const s of list) { ctx.moveTo(x[segments[2 * s]], y[segments[2 * s]]); ctx.lineTo(x[segments[2 * s + 1]], y[segments[2 * s + 1]]); }
          ctx.stroke();
        };
        edge(Array.from({length: segments.length / 2}, (_, k) => k), "#222222", 0.8);
        edge(data.pressed[f], PRESSED, 4);
      }
      legend(ctx, width, height, map.scale, state.factor, ...(data.coloured ? [STRESS, 0, data.limit, data.valueName] : []));
    });
  }

  /* Lengths are shares of the body's size: Plotly takes normals of faces of millimetres for zero. */
  function spaceView(pane, data, state) {
    const size = data.size, reference = unpack(data.reference), moved = unpack(data.displacement), colours = titled(data.valueName, data.limit), value = unpack(data.value).map((v) => colours.factor * v), corners = Array.from(unpack(data.triangles));
    const nodes = reference.length / 3, box = [[Infinity, -Infinity], [Infinity, -Infinity], [Infinity, -Infinity]];
    const place = (f, k) => (reference[k] + state.factor * moved[f * reference.length + k]) / size;
    const parts = (f) => [0, 1, 2].map((a) => Float64Array.from({length: nodes}, (_, k) => place(f, 3 * k + a)));
    const every = (list, offset) => list.filter((_, k) => k % 3 === offset);
    const traces = [], ways = [];
    const mesh = (xyz, index) => ({type: "mesh3d", x: xyz[0], y: xyz[1], z: xyz[2], i: every(index, 0), j: every(index, 1), k: every(index, 2), flatshading: false, hoverinfo: "skip",
      lighting: {ambient: 0.7, diffuse: 0.4, specular: 0, fresnel: 0}, lightposition: LIGHT});
    const plain = 3 * data.coloured, rest = corners.length > plain ? 1 : 0;
    traces.push({...mesh(parts(0), corners.slice(0, plain)), intensity: value.slice(0, nodes), cmin: 0, cmax: colours.factor * data.limit, colorscale: STRESS.map((c, k) => [k / (STRESS.length - 1), `rgb(${c})`]),
      hovertemplate: "%{intensity:.4g}<extra></extra>",
      colorbar: {title: {text: colours.title, side: "top"}, orientation: "h", y: -0.02, yanchor: "bottom", thickness: 8, len: 0.7, nticks: 5, exponentformat: "power"}});
    if (rest) traces.push({...mesh(parts(0), corners.slice(plain)), color: PLAIN, showscale: false});
    for (const o of data.obstacles) {
      const at = unpack(o.corners).map((v) => v / size), xyz = [0, 1, 2].map((a) => at.filter((_, k) => k % 3 === a));
      traces.push({...mesh(xyz, Array.from(unpack(o.triangles))), color: "#bbbbbb", opacity: o.lines.length ? 0.35 : 1, showscale: false});
      ways.push({xyz, way: o.way, turn: o.turn});
      const line = [[], [], []];
      for (let k = 0; k < o.lines.length; k += 6) for (let a = 0; a < 3; a++) line[a].push(o.lines[k + a] / size, o.lines[k + 3 + a] / size, null);
      if (o.lines.length) {
        traces.push({type: "scatter3d", mode: "lines", x: line[0], y: line[1], z: line[2], line: {color: "#999999", width: 1}, hoverinfo: "skip", showlegend: false});
        ways.push({xyz: line, way: o.way, turn: o.turn});
      }
    }
    for (let f = 0; f < data.times.length; f++) parts(f).forEach((axis, a) => axis.forEach((v) => { box[a][0] = Math.min(box[a][0], v); box[a][1] = Math.max(box[a][1], v); }));
    ways.forEach((o) => o.xyz.forEach((axis, a) => axis.forEach((v) => { if (v !== null && o.way === undefined) { box[a][0] = Math.min(box[a][0], v); box[a][1] = Math.max(box[a][1], v); } })));
    const ranges = box.map(([low, high]) => [low - 0.02, high + 0.02]), spans = ranges.map((r) => r[1] - r[0]);
    const most = Math.max(...spans) / ZOOM, axis = (a) => ({range: ranges[a], visible: false});
    const [ux, uy, uz] = data.up, eye = data.towards.map((v) => 1.9 * v);
    Plotly.newPlot(pane, traces, {height: 440, margin: {l: 0, r: 0, t: 0, b: 0}, paper_bgcolor: "#ffffff", scene: {xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "manual",
      aspectratio: {x: spans[0] / most, y: spans[1] / most, z: spans[2] / most}, camera: {eye: {x: eye[0], y: eye[1], z: eye[2]}, up: {x: ux, y: uy, z: uz}, projection: {type: "orthographic"}}}},
    {responsive: true, displayModeBar: false});
    return () => {
      const f = state.frame, [x, y, z] = parts(f);
      Plotly.restyle(pane, {x: [x], y: [y], z: [z], intensity: [value.slice(f * nodes, (f + 1) * nodes)]}, [0]);
      if (rest) Plotly.restyle(pane, {x: [x], y: [y], z: [z]}, [1]);
      ways.forEach((o, k) => {
        if (!o.way) return;
        const [u, v, w] = o.xyz, m = o.turn ? o.turn.slice(9 * f, 9 * f + 9) : [1, 0, 0, 0, 1, 0, 0, 0, 1];
        const shifted = [0, 1, 2].map((a) => Array.from(u, (_, n) => (u[n] === null ? null : m[3 * a] * u[n] + m[3 * a + 1] * v[n] + m[3 * a + 2] * w[n] + o.way[3 * f + a] / size)));
        Plotly.restyle(pane, {x: [shifted[0]], y: [shifted[1]], z: [shifted[2]]}, [k + 1 + rest]);
      });
    };
  }

  /* Points on a line, which draw on a strip of paper that moves away behind them. */
  function stripView(pane, data, state) {
    const all = data.places.flat().concat(data.obstacles.flatMap((o) => o.place)), most = Math.max(0, ...data.radii);
    let low = Math.min(...all) - most, high = Math.max(...all) + most;
    const room = 0.07 * (high - low || 1);
    [low, high] = [low - room, high + room];
    return stage(pane, () => (data.upright ? 320 : 240), (ctx, width, height) => {
      const up = data.upright, now = data.at[state.frame], t = data.time[now], edge = up ? 40 : 50, span = up ? width - edge - 8 : height - edge - FOOT;
      const scale = (up ? height - FOOT : width) / (high - low), P = (x) => (up ? height - FOOT - scale * (x - low) : scale * (x - low));
      const T = (time) => (up ? width - edge - (t - time) / data.trail * span : edge + (t - time) / data.trail * span);
      let first = now;
      while (first > 0 && data.time[first - 1] > t - data.trail) first--;
      const trace = (list, from, to) => {
        for (let k = from; k <= to; k++) { const p = P(list[k]), s = T(data.time[k]); ctx[k === from ? "moveTo" : "lineTo"](up ? s : p, up ? p : s); }
      };
      for (const o of data.obstacles) {
        const far = o.side > 0 ? P(low) : P(high), s = T(t) + (up ? edge : -edge), begin = T(data.time[first]);
        ctx.beginPath();
        trace(o.place, first, now);
        ctx.lineTo(up ? s : P(o.place[now]), up ? P(o.place[now]) : s);
        ctx.strokeStyle = EDGE;
        ctx.lineWidth = 1.5;
        ctx.stroke();
        [[s, far], [begin, far]].forEach(([a, b]) => ctx.lineTo(up ? a : b, up ? b : a));
        ctx.fillStyle = SOLID;
        ctx.fill();
      }
      data.places.forEach((list, body) => {
        ctx.strokeStyle = ctx.fillStyle = BODIES[body % BODIES.length];
        ctx.lineWidth = 1.5;
        ctx.beginPath();
        trace(list, first, now);
        ctx.stroke();
        const r = Math.max(5, data.radii[body] * scale), p = P(list[now]);
        ctx.beginPath();
        ctx.arc(up ? T(t) : p, up ? p : T(t), r, 0, 2 * Math.PI);
        ctx.fill();
        if (data.places.length < 12 && !up) { ctx.textAlign = "center"; ctx.fillText(data.names[body], p, T(t) - r - 4 - 12 * (body % 2)); }
      });
      legend(ctx, width, height, scale, 1);
    });
  }

  function pointsView(pane, data, state) {
    if (data.dim === 1) return stripView(pane, data, state);
    const pole = data.reference && unpack(data.reference), moved = pole && unpack(data.displacement), cache = {};
    const count = pole ? pole.length / 2 : data.places.length;
    const place = pole ? (f, k) => pole[k] + state.factor * moved[f * pole.length + k] : (f, k) => data.places[k >> 1][2 * data.at[f] + k % 2];
    const view = () => (cache[state.factor] = cache[state.factor] || windows(data.times.length, count, place, false, Infinity));
    return stage(pane, (width) => fitted(widened(view().at(0), 0.05), 440)(width), (ctx, width, height) => {
      const f = state.frame, map = mapping(widened(view().at(f), 0.05), width, height, FOOT);
      drawObstacles(ctx, map, data.obstacles, f, width, height, false);
      const chain = (from, to, at, style, thick) => {
        ctx.strokeStyle = style;
        ctx.lineWidth = thick;
        ctx.beginPath();
        for (let k = from; k <= to; k++) ctx[k === from ? "moveTo" : "lineTo"](map.X(at(2 * k)), map.Y(at(2 * k + 1)));
        ctx.stroke();
      };
      for (const o of data.outlines || []) for (const flat of o.frames ? o.frames[f] : o.lines) chain(0, flat.length / 2 - 1, (k) => flat[k] + (o.way ? o.way[2 * f + k % 2] : 0), "#aaaaaa", 1);
      if (pole) {
        ctx.lineCap = data.round ? "round" : "butt";
        chain(0, count - 1, (k) => place(f, k), "#9db8d8", Math.max(3, data.thickness * map.scale));
        chain(0, count - 1, (k) => place(0, k), "#888888", 1);
        chain(0, count - 1, (k) => place(f, k), BODIES[0], 2.5);
      } else {
        const here = (k) => [map.X(place(f, 2 * k)), map.Y(place(f, 2 * k + 1))];
        const spring = (a, b) => { ctx.strokeStyle = "#999999"; ctx.lineWidth = 1; ctx.beginPath(); ctx.moveTo(...a); ctx.lineTo(...b); ctx.stroke(); };
        data.links.forEach(([a, b]) => spring(here(a), here(b)));
        data.anchors.forEach(([a, b]) => spring(here(a), [map.X(b[0]), map.Y(b[1])]));
        data.places.forEach((list, body) => {
          ctx.strokeStyle = ctx.fillStyle = BODIES[body % BODIES.length];
          if (count <= 60) chain(0, data.at[f], (k) => list[k], BODIES[body % BODIES.length], 1.5);
          ctx.beginPath();
          ctx.arc(...here(body), Math.max(5, data.radii[body] * map.scale), 0, 2 * Math.PI);
          ctx.fill();
        });
      }
      legend(ctx, width, height, map.scale, state.factor);
    });
  }

  return {bars: barsView, plane: planeView, space: spaceView, points: pointsView};
})();
