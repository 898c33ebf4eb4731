"use strict";
// The machine in motion, drawn on a plain canvas from the joints' positions in each frame.
(() => {
  const data = JSON.parse(document.getElementById("scene").textContent);
  const canvas = document.getElementById("view");
  const pen = canvas.getContext("2d");
  if (!pen) return;
  document.documentElement.classList.add("scripted");
  const play = document.getElementById("play"), seek = document.getElementById("seek");
  const clock = document.getElementById("clock"), pace = document.getElementById("pace");
  const frames = data.time.length, legs = data.guides.length;
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)");

  const add = (a, b, t = 1) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };

  // The picture's vertical is `up`; the first axis stays as nearly to the right as it can. A planar
  // machine lies in the plane of the first two axes and is seen from above.
  const up = unit(data.up);
  const side = unit(cross(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]), up));
  const basis = [side, cross(up, side), up];
  const upright = (p) => basis.map((axis) => dot(axis, p));
  const deep = (value) => (typeof value[0] === "number" ? upright(value) : value.map(deep));
  const guides = deep(data.guides), directions = deep(data.directions), axes = deep(data.axes), bars = data.bars.map((bar) => bar && upright(bar));
  // Of each frame and leg, the points where its bodies meet, from the slider or the crank's centre.
  const chains = deep(data.chains), slides = data.slides;
  const first = chains.map((lines) => lines.map((chain) => chain[0]));
  // The platform's parts: arms from a hub to corners, in each frame.
  const parts = data.parts.map((part) => ({ ...part, hub: deep(part.hub), corners: deep(part.corners) }));
  const position = deep(data.position), tool = data.tool && deep(data.tool), base = deep(data.base);
  const way = data.closed ? (tool || position).concat([(tool || position)[0]]) : tool || position;
  const baseAxes = deep([[1, 0, 0], [0, 1, 0], [0, 0, 1]]).slice(0, data.planar ? 2 : 3);

  const rails = guides.filter((_, i) => slides[i]);
  const cloud = guides.flat().concat(chains.flat(2));
  const ends = [0, 1, 2].map((k) => cloud.reduce(([least, most], p) => [Math.min(least, p[k]), Math.max(most, p[k])], [Infinity, -Infinity]));
  const low = ends.map((pair) => pair[0]), high = ends.map((pair) => pair[1]);
  const size = Math.max(...[0, 1, 2].map((k) => high[k] - low[k]));
  const floor = low[2] - 0.03 * size, step = data.grid;
  const rim = data.planar ? 0.06 * size : 0; // the view ends where the squares of a planar machine end
  const gridLow = [0, 1].map((k) => Math.floor((low[k] - rim) / step) * step);
  const gridHigh = [0, 1].map((k) => Math.ceil((high[k] + rim) / step) * step);
  const center = [(gridLow[0] + gridHigh[0]) / 2, (gridLow[1] + gridHigh[1]) / 2, (floor + high[2]) / 2];
  // Bars of one unit share a scale.
  const peaks = data.units.map((unit) =>
    data.forces.reduce((most, row) => Math.max(most, ...row.filter((_, i) => data.units[i] === unit).map(Math.abs)), 1e-9));

  const start = data.planar ? { yaw: 0, pitch: Math.PI / 2, zoom: 1 } : { yaw: -0.95, pitch: 0.4, zoom: 1 };
  const camera = { ...start };
  let width = 0, height = 0, scale = 1, middle = 0, frame = 0, playing = false, now = 0, last = null, shown = true;
  let colors = {};

  function theme() {
    const style = getComputedStyle(document.documentElement);
    const get = (name) => style.getPropertyValue(name).trim();
    colors = {
      ink: get("--ink"), muted: get("--muted"), grid: get("--grid"), paper: get("--panel"), rail: get("--rail"),
      reach: get("--reach"), shade: get("--shade"), legs: [1, 2, 3, 4, 5, 6].map((i) => get("--leg" + i)),
    };
  }

  // Camera coordinates: x to the right, y down, depth away from the eye, in metres; then pixels.
  function project(p, yaw = camera.yaw, pitch = camera.pitch) {
    const q = add(p, center, -1);
    const c = Math.cos(yaw), s = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
    const x = c * q[0] - s * q[1], y = s * q[0] + c * q[1];
    const depth = cp * y - sp * q[2], rise = sp * y + cp * q[2];
    const eye = 3.2 * size, near = eye / Math.max(eye + depth, 0.1 * eye);
    return [x * near, -rise * near, depth, near];
  }
  const pixel = (p) => {
    const q = project(p), k = scale * camera.zoom;
    return [width / 2 + k * q[0], height / 2 + k * (q[1] - middle), q[2], k * q[3]];
  };

  function fit() {
    const ratio = window.devicePixelRatio || 1;
    width = canvas.clientWidth; height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    frameAll();
  }
  // The corners of everything that is drawn: of a cloud of points, those farthest out in many directions.
  const outer = (() => {
    const corners = [gridLow, [gridLow[0], gridHigh[1]], gridHigh, [gridHigh[0], gridLow[1]]].map((p) => [...p, floor]);
    const frame = position.flatMap((p, k) => axes[k].map((axis) => add(p, axis, 0.1 * size)));
    const base = baseAxes.map((axis) => add(corners[0], axis, 0.17 * size));
    const all = cloud.concat(corners, frame, base), found = new Set(base);
    for (let i = 0; i < 12; i++) {
      for (const rise of [-1, -0.5, 0, 0.5, 1]) {
        const way = [Math.cos((i * Math.PI) / 6), Math.sin((i * Math.PI) / 6), 2 * rise];
        found.add(all.reduce((best, p) => (dot(p, way) > dot(best, way) ? p : best)));
      }
    }
    return [...found];
  })();
  // The size that holds the machine at this tilt, however far it is turned; a planar one only as it is turned.
  function frameAll() {
    let wide = 0, top = Infinity, bottom = -Infinity;
    for (let turn = 0; turn < (data.planar ? 1 : 24); turn++) {
      for (const p of outer) {
        const q = project(p, camera.yaw + (turn * Math.PI) / 12, camera.pitch);
        wide = Math.max(wide, Math.abs(q[0])); top = Math.min(top, q[1]); bottom = Math.max(bottom, q[1]);
      }
    }
    // Half the breadth of a leg's number is kept free on every side.
    scale = Math.min((width / 2 - 16) / wide, (height - 32) / (bottom - top));
    middle = (top + bottom) / 2;
  }

  function path(points) {
    pen.beginPath();
    points.forEach((p, i) => { const q = pixel(p); if (i) pen.lineTo(q[0], q[1]); else pen.moveTo(q[0], q[1]); });
  }
  function line(a, b, color, thick) {
    path([a, b]); pen.lineCap = "round"; pen.strokeStyle = color; pen.lineWidth = thick; pen.stroke();
  }
  function rod(a, b, color, metres) {
    const thick = Math.max(2, metres * pixel(add(a, add(b, a, -1), 0.5))[3]);
    line(a, b, colors.paper, thick + 2.5); line(a, b, color, thick);
    pen.globalAlpha = 0.35; line(a, b, "#fff", 0.28 * thick); pen.globalAlpha = 1;
  }
  function ball(p, color, metres) {
    const q = pixel(p);
    pen.beginPath(); pen.arc(q[0], q[1], Math.max(2, metres * q[3]), 0, 2 * Math.PI);
    pen.fillStyle = colors.paper; pen.fill(); pen.strokeStyle = color; pen.lineWidth = 2; pen.stroke();
  }
  function label(p, text, color) { const q = pixel(p); write(q[0], q[1], text, color); }
  function write(x, y, text, color, bold) {
    pen.font = (bold ? "650 " : "") + "13px system-ui, sans-serif";
    pen.textAlign = "center"; pen.textBaseline = "middle";
    pen.strokeStyle = colors.paper; pen.lineWidth = 4; pen.lineJoin = "round";
    pen.strokeText(text, x, y); pen.fillStyle = color; pen.fillText(text, x, y);
  }
  function face(points, color, alpha) {
    path(points); pen.closePath(); pen.globalAlpha = alpha; pen.fillStyle = color; pen.fill();
    pen.globalAlpha = 1; pen.strokeStyle = colors.paper; pen.lineWidth = 1; pen.lineJoin = "round"; pen.stroke();
  }
  // A convex solid: only faces towards the eye, shaded by how much they face the light.
  function solid(faces, color, alpha = 1) {
    for (const f of faces) {
      const q = f.map(pixel);
      const area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
      if (area >= 0) continue;
      face(f, color, alpha);
      const n = unit(cross(add(f[1], f[0], -1), add(f[2], f[0], -1)));
      const light = dot(n, unit([0.3, -0.5, 0.8]));
      path(f); pen.closePath(); pen.globalAlpha = 0.28 * Math.abs(light); pen.fillStyle = light > 0 ? "#fff" : "#000";
      pen.fill(); pen.globalAlpha = 1;
    }
  }
  function box(c, along, half) {
    const a = unit(along), b = unit(cross(a, Math.abs(a[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])), n = cross(a, b);
    const corner = (i, j, k) => add(add(add(c, a, i * half[0]), b, j * half[1]), n, k * half[2]);
    const faces = [];
    for (const s of [-1, 1]) {
      const loops = [
        [corner(s, -1, -1), corner(s, 1, -1), corner(s, 1, 1), corner(s, -1, 1)],
        [corner(-1, s, -1), corner(-1, s, 1), corner(1, s, 1), corner(1, s, -1)],
        [corner(-1, -1, s), corner(1, -1, s), corner(1, 1, s), corner(-1, 1, s)],
      ];
      faces.push(...loops.map((loop) => (s > 0 ? loop : loop.reverse())));
    }
    return faces;
  }
  function prism(points, axis, thick) {
    const top = points.map((p) => add(p, axis, thick / 2)), bottom = points.map((p) => add(p, axis, -thick / 2));
    const sides = points.map((_, i) => { const j = (i + 1) % points.length; return [bottom[i], bottom[j], top[j], top[i]]; });
    return [top, bottom.slice().reverse(), ...sides];
  }

  function ground() {
    pen.lineCap = "butt"; pen.strokeStyle = colors.grid; pen.lineWidth = 1;
    for (let x = gridLow[0]; x <= gridHigh[0] + 1e-9; x += step) {
      path([[x, gridLow[1], floor], [x, gridHigh[1], floor]]); pen.stroke();
    }
    for (let y = gridLow[1]; y <= gridHigh[1] + 1e-9; y += step) {
      path([[gridLow[0], y, floor], [gridHigh[0], y, floor]]); pen.stroke();
    }
    const corner = [...gridLow, floor];
    baseAxes.forEach((axis, k) => {
      line(corner, add(corner, axis, 0.13 * size), colors.ink, 1.8);
      label(add(corner, axis, 0.17 * size), "xyz"[k], colors.ink);
    });
    if (!data.planar || !Math.hypot(...data.gravity)) return;
    const from = [gridLow[0] + 0.05 * size, gridHigh[1] - 0.06 * size, floor], down = data.gravity, across = [-down[1], down[0], 0];
    const tip = add(from, down, 0.15 * size);
    for (const end of [from, add(add(tip, down, -0.04 * size), across, 0.025 * size), add(add(tip, down, -0.04 * size), across, -0.025 * size)]) line(tip, end, colors.muted, 1.8);
    label(add(from, down, -0.04 * size), "g", colors.muted);
  }
  function shadow(k) {
    const drop = (p) => [p[0], p[1], floor];
    pen.lineJoin = "round"; pen.lineCap = "round"; pen.strokeStyle = colors.shade; pen.fillStyle = colors.shade;
    for (let i = 0; i < legs; i++) {
      path(chains[k][i].map(drop));
      pen.lineWidth = Math.max(2, 0.016 * size * pixel(drop(position[k]))[3]); pen.stroke();
    }
    for (const rail of rails) { path(rail.map(drop)); pen.lineWidth = 2; pen.stroke(); }
    for (const part of parts) { path(part.corners[k].map(drop)); pen.closePath(); pen.fill(); }
  }

  function draw() {
    pen.clearRect(0, 0, width, height);
    const k = frame;
    ground();
    if (!data.planar) shadow(k);
    const items = [];
    const put = (points, run, nearer = 0) => {
      const depth = points.reduce((sum, p) => sum + project(p)[2], 0) / points.length;
      items.push([depth - nearer * size, run]);
    };
    for (let i = 0; i < legs; i++) {
      const color = colors.legs[i], chain = chains[k][i], a = chain[0];
      if (slides[i]) {
        // In two halves, split at the slider: a long rail has no one distance.
        for (const end of guides[i]) put([end, a], () => line(end, a, colors.rail, Math.max(2.5, 0.011 * size * pixel(end)[3])), -0.02);
        put([a], () => solid(box(a, directions[i], [0.036 * size, 0.02 * size, 0.02 * size]), color));
      } else {
        guides[i].slice(1).forEach((p, j) => { if (j % 2) put([p], () => line(guides[i][j], p, colors.rail, 1.2), -0.02); });
        const axle = [-0.035, 0.035].map((t) => add(a, directions[i], t * size));
        put([a], () => line(...axle, colors.rail, Math.max(3, 0.026 * size * pixel(a)[3])), -0.01);
      }
      chain.slice(1, -1).forEach((p, j) => put([chain[j], p], () => rod(chain[j], p, color, 0.022 * size)));
      const ends = chain.slice(-2), sides = bars[i] ? [-size, size].map((t) => ends.map((p) => add(p, bars[i], t))) : [ends];
      for (const [from, to] of sides) put([from, to], () => rod(from, to, color, (bars[i] ? 0.009 : 0.015) * size));
      if (bars[i]) for (const j of [0, 1]) put([ends[j]], () => rod(sides[0][j], sides[1][j], color, 0.009 * size));
      for (const p of data.rams[i] ? [a, chain[2]] : chain) put([p], () => ball(p, color, 0.011 * size), 0.012);
    }
    if (base.length > 2) put(base, () => face(base, colors.rail, 0.25), -0.03);
    else if (base.length > 1) put(base, () => line(...base, colors.rail, Math.max(2.5, 0.011 * size * pixel(base[0])[3])), -0.03);
    for (const part of parts) {
      const hub = part.hub[k], plate = part.corners[k];
      const faces = () => part.triangles ? part.triangles.map((three) => three.map((i) => plate[i])) : prism(plate, axes[k][2], 0.014 * size);
      if (plate.length > 2) put(plate, () => solid(faces(), colors.reach, 0.85));
      for (const corner of plate) put([hub, corner], () => line(hub, corner, colors.reach, Math.max(2, 0.012 * size * pixel(corner)[3])));
      put([hub], () => ball(hub, colors.reach, 0.009 * size), 0.012);
    }
    if (tool) {
      put([position[k], tool[k]], () => line(position[k], tool[k], colors.reach, Math.max(2, 0.016 * size * pixel(tool[k])[3])));
      put([tool[k]], () => ball(tool[k], colors.ink, 0.009 * size), 0.02);
    }
    items.sort((a, b) => b[0] - a[0]).forEach((item) => item[1]());

    pen.setLineDash([2, 4]); path(way);
    pen.strokeStyle = colors.ink; pen.lineWidth = 1.4; pen.stroke(); pen.setLineDash([]);
    const p = position[k];
    axes[k].slice(0, baseAxes.length).forEach((axis, j) => line(p, add(p, axis, (j < 2 ? 0.1 : 0.07) * size), colors.ink, 1.6));
    for (let i = 0; i < legs; i++) {
      const at = first[k][i], along = slides[i] ? directions[i] : unit(add(chains[k][i][1], at, -1));
      const a = pixel(at), ahead = pixel(add(at, along, 0.1)), from = pixel(p);
      const across = unit([a[1] - ahead[1], ahead[0] - a[0], 0]);
      const sign = across[0] * (a[0] - from[0]) + across[1] * (a[1] - from[1]) < 0 ? -1 : 1;
      const gap = sign * (0.034 * size * a[3] + 11);
      write(a[0] + gap * across[0], a[1] + gap * across[1], String(i + 1), colors.legs[i], true);
    }
    readout(k);
  }

  const minus = (value, places) => {
    const text = value.toFixed(places);
    return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "\u2212");
  };
  const put = (id, text) => { document.getElementById(id).textContent = text; };
  function readout(k) {
    for (let i = 0; i < legs; i++) {
      const force = data.forces[k][i], share = (50 * Math.abs(force)) / peaks[i];
      const bar = document.getElementById("bar" + i);
      bar.style.width = share + "%"; bar.style.left = (force < 0 ? 50 - share : 50) + "%";
      put("force" + i, minus(force, Math.max(peaks[i] < 1e3 ? 1 : 0, 2 - Math.floor(Math.log10(peaks[i]))))); put("joint" + i, minus(data.factors[i] * data.coordinates[k][i], 1));
    }
    data.pose[k].forEach((value, j) => put("pose" + j, minus(value * data.scales[j], 1)));
    put("clock", data.time[k].toFixed(2) + " of " + data.duration.toFixed(2) + " s");
    seek.value = k;
    seek.setAttribute("aria-valuetext", data.time[k].toFixed(2) + " seconds");
  }

  let queued = false;
  const redraw = () => {
    if (queued) return;
    queued = true;
    requestAnimationFrame(() => { queued = false; draw(); });
  };
  function show(k) { frame = Math.min(Math.max(k, 0), frames - 1); now = data.time[frame]; redraw(); }
  // The last frame that is not later than a time.
  function frameAt(time) {
    let low = 0, high = frames - 1;
    while (low < high) {
      const k = Math.ceil((low + high) / 2);
      if (data.time[k] <= time + 1e-9) low = k; else high = k - 1;
    }
    return low;
  }
  function tick(clock) {
    if (!playing) return;
    if (last !== null && shown) {
      now += (Number(pace.value) * (clock - last)) / 1e3;
      // A closed motion goes on from its beginning; another one stops, for it would jump there.
      if (data.closed) now %= data.duration;
      const k = frameAt(now);
      if (k !== frame) { frame = k; draw(); }
      if (!data.closed && now >= data.duration) { show(frames - 1); run(false); return; }
    }
    last = clock; requestAnimationFrame(tick);
  }
  function run(on) {
    if (on && !data.closed && frame === frames - 1) show(0);
    playing = on; last = null;
    play.firstElementChild.textContent = on ? "\u275A\u275A" : "\u25B6";
    play.setAttribute("aria-label", on ? "Pause" : "Play");
    if (on) requestAnimationFrame(tick);
  }
  function turn(yaw, pitch) {
    camera.yaw += yaw; camera.pitch = Math.min(Math.PI / 2, Math.max(-0.3, camera.pitch + pitch)); frameAll(); redraw();
  }
  function zoom(factor) { camera.zoom = Math.min(8, Math.max(0.5, camera.zoom * factor)); redraw(); }

  const fingers = new Map();
  let engaged = false;
  canvas.addEventListener("pointerdown", (event) => {
    engaged = true;
    fingers.set(event.pointerId, [event.clientX, event.clientY]); canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const from = fingers.get(event.pointerId);
    if (!from) return;
    const to = [event.clientX, event.clientY];
    if (fingers.size === 2) {
      const other = [...fingers.entries()].find(([id]) => id !== event.pointerId)[1];
      const span = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      zoom(span(to) / Math.max(span(from), 1));
    } else turn(0.008 * (to[0] - from[0]), 0.008 * (to[1] - from[1]));
    fingers.set(event.pointerId, to);
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => fingers.delete(event.pointerId));
  // The wheel scrolls the page unless the view was clicked, or a key says that it is meant.
  for (const name of ["pointerleave", "blur"]) canvas.addEventListener(name, () => { engaged = false; });
  canvas.addEventListener("wheel", (event) => {
    if (!engaged && !event.ctrlKey && !event.shiftKey && !event.metaKey) return;
    zoom(Math.exp(-0.0016 * (event.deltaY || event.deltaX)));
    event.preventDefault();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const keys = {
      ArrowLeft: () => turn(-0.09, 0), ArrowRight: () => turn(0.09, 0), ArrowUp: () => turn(0, -0.07), ArrowDown: () => turn(0, 0.07),
      "+": () => zoom(1.15), "=": () => zoom(1.15), "-": () => zoom(1 / 1.15), " ": () => run(!playing), Home: reset,
    };
    if (keys[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) { keys[event.key](); event.preventDefault(); }
  });
  function reset() { Object.assign(camera, start); frameAll(); redraw(); }
  play.addEventListener("click", () => run(!playing));
  document.getElementById("reset").addEventListener("click", reset);
  seek.addEventListener("input", () => { run(false); show(Number(seek.value)); });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { theme(); redraw(); });
  calm.addEventListener("change", () => { if (calm.matches) run(false); });
  if ("IntersectionObserver" in window) new IntersectionObserver((seen) => { shown = seen[0].isIntersecting; last = null; }).observe(canvas);
  if ("ResizeObserver" in window) new ResizeObserver(() => { fit(); draw(); }).observe(canvas);

  // Paper has no use for closed sections.
  const folds = () => [...document.querySelectorAll("details:not([open])")];
  let opened = [];
  window.addEventListener("beforeprint", () => { opened = folds(); opened.forEach((fold) => { fold.open = true; }); });
  window.addEventListener("afterprint", () => opened.forEach((fold) => { fold.open = false; }));

  seek.max = String(frames - 1);
  theme(); fit(); draw();
  if (!calm.matches) run(true);
})();
