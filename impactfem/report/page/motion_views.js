/* Views of the moving picture, one for each kind of payload: view(pane, data, state) returns what paints state.frame.
   Loaded before motion.js; needs Plotly for bodies in space. */
"use strict";
const impactfemViews = (function () {
  const VIRIDIS = [[68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140], [40, 174, 128], [94, 201, 98], [173, 220, 48], [253, 231, 37]];
  const SIGNED = [[178, 24, 43], [239, 138, 98], [240, 240, 240], [103, 169, 207], [33, 102, 172]];
  const ZOOM = 1.5; // of bodies in space
  const BODIES = ["#0b559f", "#d95f02", "#1b7837", "#7b3294", "#b2182b", "#666666"];
  const SOLID = "#d0d0d0", EDGE = "#666666", PRESSED = "#d95f02";
  const LEVELS = 48; // of colours
  const FOOT = 34; // height of scale and colours below a picture [px]
  const FAR = 2.5; // a body that moves farther than so many of its sizes is followed

  /* Numbers low + step * q, with unsigned integers q in base64. */
  function unpack(entry) {
    const bytes = Uint8Array.from(atob(entry.data), (c) => c.charCodeAt(0));
    const whole = entry.bits === 8 ? bytes : entry.bits === 16 ? new Uint16Array(bytes.buffer) : new Uint32Array(bytes.buffer);
    return Float64Array.from(whole, (q) => entry.low + entry.step * q);
  }

  function tint(stops, share) {
    const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
    return "rgb(" + stops[k].map((c, i) => Math.round(c + (at - k) * (stops[k + 1][i] - c))).join(",") + ")";
  }

  /* A number for people: 0.0123, 1.46e-5, 9.1e7. */
  function short(number, digits = 5) {
    if (number === null || number === undefined) return "unknown";
    const size = Math.abs(number);
    if (size === 0 || (size >= 1e-3 && size < 1e6)) return String(Number(number.toPrecision(digits)));
    return number.toExponential(digits - 1).replace(/\.?0*e/, "e").replace("e+", "e");
  }

  function make(tag, style, parent, text) {
    const element = document.createElement(tag);
    element.style.cssText = style;
    if (text !== undefined) element.textContent = text;
    parent.append(element);
    return element;
  }

  /* A crisp canvas that is painted anew when its width changes; returns the function that paints. */
  function stage(pane, heightOf, paint) {
    const canvas = make("canvas", "display:block;width:100%", pane);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The bodies at the time of the slider");
    const redraw = () => {
      const width = pane.clientWidth, ratio = window.devicePixelRatio || 1;
      if (!width) return;
      const height = Math.round(heightOf(width));
      canvas.style.height = height + "px";
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      const ctx = canvas.getContext("2d");
      ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
      ctx.font = "12px system-ui, sans-serif";
      ctx.lineJoin = "round";
      paint(ctx, width, height);
    };
    new ResizeObserver(redraw).observe(pane);
    return redraw;
  }

  /* Where a window [x0, x1, y0, y1] of the plane lies on a canvas, at one scale. */
  function mapping(win, width, height, foot) {
    const tall = height - foot, scale = Math.min(width / (win[1] - win[0]), tall / (win[3] - win[2]));
    const cx = (win[0] + win[1]) / 2, cy = (win[2] + win[3]) / 2;
    return {scale, cx, cy, X: (x) => width / 2 + scale * (x - cx), Y: (y) => tall / 2 - scale * (y - cy)};
  }

  function widened(win, share) {
    const room = share * Math.max(win[1] - win[0], win[3] - win[2]) || 1;
    return [win[0] - room, win[1] + room, win[2] - room, win[3] + room];
  }

  /* The lower edge: a scale to the left, colours to the right. */
  function legend(ctx, width, height, scale, factor, stops, low, high, name) {
    const wanted = width / 5 / scale, power = 10 ** Math.floor(Math.log10(wanted));
    const length = power * (wanted / power >= 5 ? 5 : wanted / power >= 2 ? 2 : 1), y = height - 10;
    ctx.fillStyle = "#ffffff";
    ctx.fillRect(0, height - FOOT, width, FOOT);
    ctx.strokeStyle = ctx.fillStyle = "#222222";
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(8, y);
    ctx.lineTo(8 + length * scale, y);
    ctx.stroke();
    ctx.textAlign = "left";
    ctx.fillText(short(length) + " m" + (factor > 1 ? ", motion × " + factor : ""), 8, y - 6);
    if (!stops) return;
    const wide = Math.min(240, width * 0.58), left = width - wide - 8, fade = ctx.createLinearGradient(left, 0, left + wide, 0);
    stops.forEach((c, k) => fade.addColorStop(k / (stops.length - 1), "rgb(" + c.join(",") + ")"));
    ctx.fillStyle = fade;
    ctx.fillRect(left, y - 4, wide, 8);
    ctx.fillStyle = "#222222";
    ctx.textAlign = "left";
    ctx.fillText(short(low, 3), left, y - 9);
    ctx.textAlign = "right";
    ctx.fillText(short(high, 3), left + wide, y - 9);
    ctx.textAlign = "center";
    ctx.fillText(name, left + wide / 2, y - 9);
  }

  function drawObstacles(ctx, map, obstacles, frame, width, height, mirror) {
    const far = 2 * (width + height) / map.scale;
    for (const o of obstacles) {
      const dx = o.way ? o.way[2 * frame] : 0, dy = o.way ? o.way[2 * frame + 1] : 0;
      const path = new Path2D();
      let fill = true;
      if (o.shape === "half") {
        const [nx, ny] = o.normal, px = o.point[0] + dx, py = o.point[1] + dy, along = -ny * (map.cx - px) + nx * (map.cy - py);
        const bx = px - ny * along, by = py + nx * along;
        [[-1, 0], [1, 0], [1, -1], [-1, -1]].forEach(([s, d], k) =>
          path[k ? "lineTo" : "moveTo"](map.X(bx - s * far * ny + d * far * nx), map.Y(by + s * far * nx + d * far * ny)));
        path.closePath();
      } else if (o.shape === "circle") {
        path.arc(map.X(o.point[0] + dx), map.Y(o.point[1] + dy), o.radius * map.scale, 0, 2 * Math.PI);
      } else {
        for (let k = 0; k < o.points.length; k += 2) path[k ? "lineTo" : "moveTo"](map.X(o.points[k] + dx), map.Y(o.points[k + 1] + dy));
        fill = o.closed;
      }
      if (o.inside) path.rect(-10, -10, width + 20, height + 20);
      ctx.save();
      if (mirror) { ctx.translate(2 * map.X(0), 0); ctx.scale(-1, 1); }
      ctx.fillStyle = SOLID;
      ctx.strokeStyle = EDGE;
      ctx.lineWidth = fill ? 1 : 3;
      if (fill) ctx.fill(path, "evenodd");
      ctx.stroke(path);
      ctx.restore();
    }
  }

  /* Extents of nodes (x, y, x, y, ...) in each frame, and the window that follows or holds them all. */
  function windows(frames, count, place, mirror, size) {
    const boxes = [];
    for (let f = 0; f < frames; f++) {
      const box = [Infinity, -Infinity, Infinity, -Infinity];
      for (let k = 0; k < count; k++) {
        const x = place(f, 2 * k), y = place(f, 2 * k + 1);
        box[0] = Math.min(box[0], mirror ? -x : x, x); box[1] = Math.max(box[1], x, mirror ? -x : x);
        box[2] = Math.min(box[2], y); box[3] = Math.max(box[3], y);
      }
      boxes.push(box);
    }
    const all = boxes.reduce((a, b) => [Math.min(a[0], b[0]), Math.max(a[1], b[1]), Math.min(a[2], b[2]), Math.max(a[3], b[3])]);
    if (Math.max(all[1] - all[0], all[3] - all[2]) <= FAR * size) return () => widened(all, 0.06);
    const half = 0.65 * boxes.reduce((a, b) => Math.max(a, b[1] - b[0], b[3] - b[2]), 0);
    return (f) => {
      const x = (boxes[f][0] + boxes[f][1]) / 2, y = (boxes[f][2] + boxes[f][3]) / 2;
      return [x - half, x + half, y - half, y + half];
    };
  }

  const fitted = (win, most) => (width) => Math.min(most, Math.max(130, width * (win[3] - win[2]) / (win[1] - win[0]) + FOOT));

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
    return stage(pane, (width) => fitted(view()(0), 470)(width), (ctx, width, height) => {
      const f = state.frame, map = mapping(view()(f), width, height, FOOT);
      drawObstacles(ctx, map, data.obstacles, f, width, height, false);
      if (data.mirror) drawObstacles(ctx, map, data.obstacles, f, width, height, true);
      const half = length / 2, y = Float64Array.from({length: half}, (_, k) => map.Y(place(f, 2 * k + 1)));
      for (const side of data.mirror ? [1, -1] : [1]) {
        const x = Float64Array.from({length: half}, (_, k) => map.X(side * place(f, 2 * k)));
        const groups = Array.from({length: LEVELS}, () => []);
        for (let t = 0; t < triangles.length; t += 3) {
          const mean = (value[f * half + triangles[t]] + value[f * half + triangles[t + 1]] + value[f * half + triangles[t + 2]]) / 3;
          groups[Math.min(LEVELS - 1, Math.floor(LEVELS * mean / data.limit))].push(t);
        }
        groups.forEach((group, level) => {
          if (!group.length) return;
          ctx.fillStyle = ctx.strokeStyle = tint(VIRIDIS, level / (LEVELS - 1));
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
      legend(ctx, width, height, map.scale, state.factor, VIRIDIS, 0, data.limit, data.valueName);
    });
  }

  function spaceView(pane, data, state) {
    const reference = unpack(data.reference), moved = unpack(data.displacement), value = unpack(data.value), corners = Array.from(unpack(data.triangles));
    const nodes = reference.length / 3, box = [[Infinity, -Infinity], [Infinity, -Infinity], [Infinity, -Infinity]];
    const place = (f, k) => reference[k] + state.factor * moved[f * reference.length + k];
    const parts = (f) => [0, 1, 2].map((a) => Float64Array.from({length: nodes}, (_, k) => place(f, 3 * k + a)));
    const every = (list, offset) => list.filter((_, k) => k % 3 === offset);
    const traces = [], ways = [];
    const mesh = (xyz, index) => ({type: "mesh3d", x: xyz[0], y: xyz[1], z: xyz[2], i: every(index, 0), j: every(index, 1), k: every(index, 2), flatshading: false, hoverinfo: "skip"});
    traces.push({...mesh(parts(0), corners), intensity: value.slice(0, nodes), cmin: 0, cmax: data.limit, colorscale: "Viridis",
      lighting: {ambient: 0.75, diffuse: 0.4, specular: 0.05}, hovertemplate: "%{intensity:.4g}<extra></extra>",
      colorbar: {title: {text: data.valueName, side: "top"}, orientation: "h", y: -0.02, yanchor: "bottom", thickness: 8, len: 0.7, nticks: 5, exponentformat: "power"}});
    for (const o of data.obstacles) {
      const at = unpack(o.corners), xyz = [0, 1, 2].map((a) => at.filter((_, k) => k % 3 === a));
      traces.push({...mesh(xyz, Array.from(unpack(o.triangles))), color: "#bbbbbb", opacity: o.lines.length ? 0.35 : 1, showscale: false});
      ways.push({xyz, way: o.way});
      const line = [[], [], []];
      for (let k = 0; k < o.lines.length; k += 6) for (let a = 0; a < 3; a++) line[a].push(o.lines[k + a], o.lines[k + 3 + a], null);
      if (o.lines.length) {
        traces.push({type: "scatter3d", mode: "lines", x: line[0], y: line[1], z: line[2], line: {color: "#999999", width: 1}, hoverinfo: "skip", showlegend: false});
        ways.push({xyz: line, way: o.way});
      }
    }
    for (let f = 0; f < data.times.length; f++) parts(f).forEach((axis, a) => axis.forEach((v) => { box[a][0] = Math.min(box[a][0], v); box[a][1] = Math.max(box[a][1], v); }));
    ways.forEach((o) => o.xyz.forEach((axis, a) => axis.forEach((v) => { if (v !== null && o.way === undefined) { box[a][0] = Math.min(box[a][0], v); box[a][1] = Math.max(box[a][1], v); } })));
    const ranges = box.map(([low, high]) => [low - 0.02 * data.size, high + 0.02 * data.size]), spans = ranges.map((r) => r[1] - r[0]);
    const most = Math.max(...spans) / ZOOM, axis = (a) => ({range: ranges[a], visible: false});
    const [ux, uy, uz] = data.up, eye = data.towards.map((v) => 1.9 * v);
    Plotly.newPlot(pane, traces, {height: 440, margin: {l: 0, r: 0, t: 0, b: 0}, paper_bgcolor: "#ffffff", scene: {xaxis: axis(0), yaxis: axis(1), zaxis: axis(2), aspectmode: "manual",
      aspectratio: {x: spans[0] / most, y: spans[1] / most, z: spans[2] / most}, camera: {eye: {x: eye[0], y: eye[1], z: eye[2]}, up: {x: ux, y: uy, z: uz}, projection: {type: "orthographic"}}}},
    {responsive: true, displayModeBar: false});
    return () => {
      const f = state.frame, [x, y, z] = parts(f);
      Plotly.restyle(pane, {x: [x], y: [y], z: [z], intensity: [value.slice(f * nodes, (f + 1) * nodes)]}, [0]);
      ways.forEach((o, k) => {
        if (!o.way) return;
        const shifted = o.xyz.map((axis, a) => Array.from(axis, (v) => (v === null ? null : v + o.way[3 * f + a])));
        Plotly.restyle(pane, {x: [shifted[0]], y: [shifted[1]], z: [shifted[2]]}, [k + 1]);
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
    return stage(pane, (width) => fitted(widened(view()(0), 0.05), 440)(width), (ctx, width, height) => {
      const f = state.frame, map = mapping(widened(view()(f), 0.05), width, height, FOOT);
      drawObstacles(ctx, map, data.obstacles, f, width, height, false);
      const chain = (from, to, at, style, thick) => {
        ctx.strokeStyle = style;
        ctx.lineWidth = thick;
        ctx.beginPath();
        for (let k = from; k <= to; k++) ctx[k === from ? "moveTo" : "lineTo"](map.X(at(2 * k)), map.Y(at(2 * k + 1)));
        ctx.stroke();
      };
      for (const o of data.outlines || []) for (const flat of o.lines) chain(0, flat.length / 2 - 1, (k) => flat[k] + (o.way ? o.way[2 * f + k % 2] : 0), "#aaaaaa", 1);
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

  return {bars: barsView, plane: planeView, space: spaceView, points: pointsView, make, short};
})();
