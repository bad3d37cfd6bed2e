/* What the views of the moving picture share: numbers, colours, canvas, scales, obstacles, windows. */
"use strict";
const impactfemTools = (function () {
  const STRESS = [[255, 255, 217], [237, 248, 177], [199, 233, 180], [127, 205, 187], [65, 182, 196], [29, 145, 192], [34, 94, 168], [37, 52, 148], [8, 29, 88]]; // as in the pictures
  const SIGNED = [[33, 102, 172], [103, 169, 207], [240, 240, 240], [239, 138, 98], [178, 24, 43]];
  const SOLID = "#d0d0d0", EDGE = "#666666"; // of obstacles
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

  /* The unit with the prefix that suits numbers up to `most`, as prefixes.py chooses it: {factor, unit}. */
  function prefixed(unit, most) {
    const size = Math.abs(most);
    if (!(size > 0) || !isFinite(size) || (size >= 0.1 && size < 1e4)) return {factor: 1, unit};
    const third = Math.min(4, Math.max(-5, Math.floor(Math.log10(size * (1 + 1e-6)) / 3)));
    return {factor: Number("1e" + -3 * third), unit: "fpnµm kMGT"[third + 5].trim() + unit};
  }

  /* A number with its unit for people: 12.3 µm. */
  function quantity(number, unit) {
    const shown = prefixed(unit, number);
    return short(shown.factor * number) + " " + shown.unit;
  }

  /* The same of a title with its unit in brackets: {factor, title}. */
  function titled(title, most) {
    const [before, unit] = title.split(/[[\]]/), shown = prefixed(unit || "", most);
    return unit === undefined || unit === "1" ? {factor: 1, title} : {factor: shown.factor, title: before + "[" + shown.unit + "]"};
  }

  const largest = (list) => list.reduce((most, v) => Math.max(most, Math.abs(v)), 0);

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

  const rounded = (number) => { const power = 10 ** Math.floor(Math.log10(number)); return power * (number / power >= 5 ? 5 : number / power >= 2 ? 2 : 1); };

  /* Lines at rest behind a picture that follows its bodies. */
  function grid(ctx, map, width, height) {
    const step = rounded(width / 4 / map.scale);
    ctx.strokeStyle = "#e8e8e8";
    ctx.lineWidth = 1;
    ctx.beginPath();
    for (let x = step * Math.ceil((map.cx - width / 2 / map.scale) / step); map.X(x) < width; x += step) { ctx.moveTo(map.X(x), 0); ctx.lineTo(map.X(x), height); }
    for (let y = step * Math.ceil((map.cy - height / 2 / map.scale) / step); map.Y(y) > 0; y += step) { ctx.moveTo(0, map.Y(y)); ctx.lineTo(width, map.Y(y)); }
    ctx.stroke();
    ctx.fillStyle = "#666666";
    ctx.textAlign = "left";
    ctx.fillText("follows the motion; lines every " + quantity(step, "m"), 8, 14);
  }

  /* The lower edge: a scale to the left, colours to the right. */
  function legend(ctx, width, height, scale, factor, stops, low, high, name) {
    const length = rounded(width / 5 / scale), y = height - 10;
    ctx.fillStyle = "#ffffff";
    ctx.fillRect(0, height - FOOT, width, FOOT);
    ctx.strokeStyle = ctx.fillStyle = "#222222";
    ctx.lineWidth = 2;
    ctx.beginPath();
    ctx.moveTo(8, y);
    ctx.lineTo(8 + length * scale, y);
    ctx.stroke();
    ctx.textAlign = "left";
    ctx.fillText(quantity(length, "m") + (factor > 1 ? ", motion × " + factor : ""), 8, y - 6);
    if (!stops) return;
    const wide = Math.min(240, width * 0.58), left = width - wide - 8, fade = ctx.createLinearGradient(left, 0, left + wide, 0);
    stops.forEach((c, k) => fade.addColorStop(k / (stops.length - 1), "rgb(" + c.join(",") + ")"));
    ctx.fillStyle = fade;
    ctx.fillRect(left, y - 4, wide, 8);
    ctx.fillStyle = "#222222";
    ctx.textAlign = "left";
    const colours = titled(name, Math.max(Math.abs(low), Math.abs(high)));
    ctx.fillText(short(colours.factor * low, 3), left, y - 9);
    ctx.textAlign = "right";
    ctx.fillText(short(colours.factor * high, 3), left + wide, y - 9);
    ctx.textAlign = "center";
    ctx.fillText(colours.title, left + wide / 2, y - 9);
  }

  function drawObstacles(ctx, map, obstacles, frame, width, height, mirror) {
    const far = 2 * (width + height) / map.scale;
    for (const o of obstacles) {
      const [dx, dy] = o.way ? o.way.slice(2 * frame, 2 * frame + 2) : [0, 0], [a, b, c, d] = o.turn ? o.turn.slice(4 * frame, 4 * frame + 4) : [1, 0, 0, 1];
      const at = (x, y) => [a * x + b * y + dx, c * x + d * y + dy];
      const path = new Path2D();
      let fill = true;
      if (o.shape === "half") {
        const [u, v] = o.normal, nx = a * u + b * v, ny = c * u + d * v, [px, py] = at(...o.point), along = -ny * (map.cx - px) + nx * (map.cy - py);
        const bx = px - ny * along, by = py + nx * along;
        [[-1, 0], [1, 0], [1, -1], [-1, -1]].forEach(([s, d], k) =>
          path[k ? "lineTo" : "moveTo"](map.X(bx - s * far * ny + d * far * nx), map.Y(by + s * far * nx + d * far * ny)));
        path.closePath();
      } else if (o.shape === "circle") {
        const [px, py] = at(...o.point);
        path.arc(map.X(px), map.Y(py), o.radius * map.scale, 0, 2 * Math.PI);
      } else {
        for (let k = 0; k < o.points.length; k += 2) { const [px, py] = at(o.points[k], o.points[k + 1]); path[k ? "lineTo" : "moveTo"](map.X(px), map.Y(py)); }
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
      if (o.shape === "circle" && o.turn) { // a mark in what turns
        const mark = o.radius * (o.inside ? 1.06 : 0.94), [px, py] = o.point;
        ctx.beginPath();
        [at(px + o.radius, py), at(px + mark, py)].forEach(([x, y], k) => ctx[k ? "lineTo" : "moveTo"](map.X(x), map.Y(y)));
        ctx.lineWidth = 3;
        ctx.stroke();
      }
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
    if (Math.max(all[1] - all[0], all[3] - all[2]) <= FAR * size) return {follows: false, at: () => widened(all, 0.06)};
    const half = 0.65 * boxes.reduce((a, b) => Math.max(a, b[1] - b[0], b[3] - b[2]), 0);
    const at = (f) => {
      const x = (boxes[f][0] + boxes[f][1]) / 2, y = (boxes[f][2] + boxes[f][3]) / 2;
      return [x - half, x + half, y - half, y + half];
    };
    return {follows: true, at};
  }

  const fitted = (win, most) => (width) => Math.min(most, Math.max(130, width * (win[3] - win[2]) / (win[1] - win[0]) + FOOT));

  return {STRESS, SIGNED, SOLID, EDGE, FOOT, unpack, tint, short, prefixed, quantity, titled, largest, make, stage, mapping, widened, legend, grid, drawObstacles, windows, fitted};
})();
