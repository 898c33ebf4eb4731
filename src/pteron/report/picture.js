"use strict";
// A picture of a machine on a plain canvas: its bodies, from the places of its joints, with light on them.
// Points are those of `motion_frames.py`. Bodies are painted from the farthest to the nearest.
const add = (a, b, t = 1) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const sub = (a, b) => add(a, b, -1);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
const minus = (value, places) => {
  const text = value.toFixed(places);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "\u2212");
};
// The moment k of a motion's frames, or of one pose.
const moment = (frames, k) => ({
  chains: frames.chains[k], position: frames.position[k], axes: frames.axes[k], tool: frames.tool && frames.tool[k],
  parts: frames.parts.map((part) => ({ triangles: part.triangles, hub: part.hub[k], corners: part.corners[k] })),
});

class Picture {
  // The canvas shows a machine (`still`); the cloud of points is to be in sight at any angle.
  constructor(canvas, machine, cloud) {
    this.canvas = canvas; this.pen = canvas.getContext("2d"); this.extra = {};
    this.start = machine.planar ? { yaw: 0, pitch: Math.PI / 2, zoom: 1, pan: [0, 0] } : { yaw: -0.95, pitch: 0.4, zoom: 1, pan: [0, 0] };
    this.camera = { ...this.start };
    this.take(machine, cloud);
    this.fingers = new Map();
    this.#watch();
  }

  // Another machine, seen as the one before.
  take(machine, cloud) {
    this.machine = machine;
    // The picture's vertical is `up`; the first axis stays as nearly to the right as it can. A planar
    // machine lies in the plane of the first two axes and is seen from above.
    const up = unit(machine.up), side = unit(cross(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]), up));
    this.basis = [side, cross(up, side), up];
    this.guides = this.deep(machine.guides); this.directions = this.deep(machine.directions);
    this.bars = machine.bars.map((bar) => bar && this.deep(bar)); this.base = this.deep(machine.base);
    this.baseAxes = this.deep([[1, 0, 0], [0, 1, 0], [0, 0, 1]]).slice(0, machine.planar ? 2 : 3);
    this.cloud = this.guides.flat().concat(this.deep(cloud));
    const ends = [0, 1, 2].map((k) => this.cloud.reduce(([least, most], p) => [Math.min(least, p[k]), Math.max(most, p[k])], [Infinity, -Infinity]));
    const low = (this.low = ends.map((pair) => pair[0])), high = (this.high = ends.map((pair) => pair[1]));
    const size = (this.size = Math.max(...[0, 1, 2].map((k) => high[k] - low[k])));
    this.floor = low[2] - 0.03 * size;
    const rim = machine.planar ? 0.06 * size : 0, step = machine.grid; // a planar machine is seen against its squares
    this.gridLow = [0, 1].map((k) => Math.floor((low[k] - rim) / step) * step);
    this.gridHigh = [0, 1].map((k) => Math.ceil((high[k] + rim) / step) * step);
    // Where the base frame's directions are drawn: in space beside the squares, whose corner a foot may fill.
    const off = machine.planar ? 0 : 0.08 * size;
    this.corner = [this.gridLow[0] - off, this.gridLow[1] - off, this.floor];
    this.center = [(this.gridLow[0] + this.gridHigh[0]) / 2, (this.gridLow[1] + this.gridHigh[1]) / 2, (this.floor + high[2]) / 2];
    const given = machine.radii || {}, own = (name, share) => given[name] || share * size;
    this.radii = { guide: own("guide", 0.008), upper: own("upper", 0.012), lower: own("lower", 0.0085), rod: own("lower", 0.0055), platform: own("platform", 0.008) };
    this.#hull();
    this.theme();
  }

  deep(value) { return typeof value[0] === "number" ? this.basis.map((axis) => dot(axis, value)) : value.map((one) => this.deep(one)); }
  // A point of the picture as the data have it.
  given(p) { return [0, 1, 2].map((k) => this.basis.reduce((sum, axis, i) => sum + p[i] * axis[k], 0)); }
  turned(m) {
    return {
      chains: this.deep(m.chains), position: this.deep(m.position), axes: this.deep(m.axes), tool: m.tool && this.deep(m.tool),
      parts: m.parts.map((part) => ({ triangles: part.triangles, hub: this.deep(part.hub), corners: this.deep(part.corners) })),
    };
  }

  // What is shown: a moment of the machine, and further things (`ghost`, `arrows`, `trail`, `slice`, `handles`, `spring`).
  show(now, extra = {}) { this.now = this.turned(now); this.extra = extra; this.redraw(); }

  theme() {
    const style = getComputedStyle(document.documentElement), get = (name) => style.getPropertyValue(name).trim();
    this.colors = Object.fromEntries(["ink", "muted", "grid", "rail", "reach", "shade", "warning", "accent"].map((name) => [name, get("--" + name)]));
    this.colors.paper = get("--panel"); this.colors.legs = [1, 2, 3, 4, 5, 6].map((i) => get("--leg" + i));
    this.tones = {};
    this.redraw();
  }
  // Dark, plain and light tones of a colour.
  shades(color) {
    return (this.tones[color] ||= [`color-mix(in srgb, ${color} 55%, #000)`, color, `color-mix(in srgb, ${color} 45%, #fff)`]);
  }

  // Camera coordinates: x to the right, y down, depth away from the eye, in metres; then pixels.
  project(p, yaw = this.camera.yaw, pitch = this.camera.pitch) {
    const q = sub(p, this.center), c = Math.cos(yaw), s = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
    const x = c * q[0] - s * q[1], y = s * q[0] + c * q[1], depth = cp * y - sp * q[2], rise = sp * y + cp * q[2];
    const eye = 3.2 * this.size, near = eye / Math.max(eye + depth, 0.1 * eye);
    return [x * near, -rise * near, depth, near];
  }
  pixel(p) {
    const q = this.project(p), k = this.scale * this.camera.zoom, pan = this.camera.pan;
    return [this.width / 2 + k * q[0] + pan[0], this.level + k * (q[1] - this.middle) + pan[1], q[2], k * q[3]];
  }
  // The point under a pixel, as far from the eye as another point.
  under(x, y, beside) {
    const near = this.project(beside)[3], k = this.scale * this.camera.zoom, [panX, panY] = this.camera.pan;
    const right = (x - this.width / 2 - panX) / k / near, rise = -((y - this.level - panY) / k + this.middle) / near;
    const depth = this.project(beside)[2], { yaw, pitch } = this.camera;
    const c = Math.cos(yaw), s = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
    const across = add(add([right * c, -right * s, 0], [sp * s, sp * c, cp], rise), [cp * s, cp * c, -sp], depth);
    return add(this.center, across);
  }

  fit() {
    const ratio = window.devicePixelRatio || 1, { canvas } = this;
    this.width = canvas.clientWidth; this.height = canvas.clientHeight;
    // A bar over the picture covers none of the machine: `level` is the middle of what it leaves.
    const covered = this.bar ? this.bar.offsetHeight : 0, under = this.foot && this.foot.offsetHeight ? this.foot.offsetHeight + 20 : 0;
    this.clear = this.height - covered - under; this.level = covered + this.clear / 2;
    canvas.width = Math.round(this.width * ratio); canvas.height = Math.round(this.height * ratio);
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.frameAll();
  }
  // The corners of everything that is drawn: of a cloud of points, those farthest out in many directions.
  #hull() {
    const { gridLow, gridHigh, size } = this;
    const corners = [gridLow, [gridLow[0], gridHigh[1]], gridHigh, [gridHigh[0], gridLow[1]]].map((p) => [...p, this.floor]);
    const base = this.baseAxes.map((axis) => add(this.corner, axis, 0.17 * size));
    this.outer = [...base, ...this.#farthest(this.cloud.concat(corners, base))];
    const { planar, gravity } = this.machine, falls = planar && Math.hypot(...gravity) ? this.#gravity() : [];
    this.body = this.#farthest(this.cloud.concat(falls, planar ? [] : [[this.center[0], this.center[1], this.floor]]));
  }
  #farthest(all) {
    const found = new Set();
    for (let i = 0; i < 12; i++) {
      for (const rise of [-1, -0.5, 0, 0.5, 1]) {
        const way = [Math.cos((i * Math.PI) / 6), Math.sin((i * Math.PI) / 6), 2 * rise];
        found.add(all.reduce((best, p) => (dot(p, way) > dot(best, way) ? p : best)));
      }
    }
    return [...found];
  }
  // The size that holds the machine at this tilt, however far it is turned; a planar one only as it is turned.
  // Where directions stand in the picture's corner (`compass`) the ground may end at its edges.
  frameAll() {
    let wide = 0, top = Infinity, bottom = -Infinity;
    for (let turn = 0; turn < (this.machine.planar ? 1 : 24); turn++) {
      for (const p of this.compass ? this.body : this.outer) {
        const q = this.project(p, this.camera.yaw + (turn * Math.PI) / 12);
        wide = Math.max(wide, Math.abs(q[0])); top = Math.min(top, q[1]); bottom = Math.max(bottom, q[1]);
      }
    }
    // Half the breadth of a leg's number is kept free on every side.
    this.scale = Math.max(1, Math.min((this.width / 2 - (this.compass ? 28 : 16)) / wide, (this.clear - 32) / (bottom - top)));
    this.middle = (top + bottom) / 2;
    this.redraw();
  }

  // Strokes and faces.
  path(points) {
    this.pen.beginPath();
    points.forEach((p, i) => { const q = this.pixel(p); if (i) this.pen.lineTo(q[0], q[1]); else this.pen.moveTo(q[0], q[1]); });
  }
  line(a, b, color, thick) {
    this.path([a, b]); this.pen.lineCap = "round"; this.pen.strokeStyle = color; this.pen.lineWidth = thick; this.pen.stroke();
  }
  // A round bar: a belt of light along its upper side, dark ones along its edges.
  rod(a, b, color, radius) {
    const p = this.pixel(a), q = this.pixel(b), { pen } = this, [dark, plain, light] = this.shades(color);
    const along = Math.hypot(q[0] - p[0], q[1] - p[1]), r = [p, q].map((end) => Math.max(1.1, radius * end[3]));
    if (along < 1e-3) return;
    let n = [-(q[1] - p[1]) / along, (q[0] - p[0]) / along];
    if (n[1] > 0 || (n[1] === 0 && n[0] > 0)) n = [-n[0], -n[1]];
    const wide = Math.max(...r), middle = [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2], more = [0.4 * (q[0] - p[0]) / along, 0.4 * (q[1] - p[1]) / along];
    const tint = pen.createLinearGradient(middle[0] + n[0] * wide, middle[1] + n[1] * wide, middle[0] - n[0] * wide, middle[1] - n[1] * wide);
    [[0, dark], [0.14, plain], [0.32, light], [0.5, plain], [1, dark]].forEach(([at, tone]) => tint.addColorStop(at, tone));
    pen.beginPath(); pen.moveTo(p[0] + n[0] * r[0] - more[0], p[1] + n[1] * r[0] - more[1]); pen.lineTo(q[0] + n[0] * r[1] + more[0], q[1] + n[1] * r[1] + more[1]);
    pen.lineTo(q[0] - n[0] * r[1] + more[0], q[1] - n[1] * r[1] + more[1]); pen.lineTo(p[0] - n[0] * r[0] - more[0], p[1] - n[1] * r[0] - more[1]); pen.closePath();
    pen.fillStyle = tint; pen.fill();
  }
  ball(p, color, radius) {
    const q = this.pixel(p), r = Math.max(2, radius * q[3]), { pen } = this, [dark, plain, light] = this.shades(color);
    const tint = pen.createRadialGradient(q[0] - 0.35 * r, q[1] - 0.4 * r, 0.1 * r, q[0], q[1], r);
    [[0, light], [0.45, plain], [1, dark]].forEach(([at, tone]) => tint.addColorStop(at, tone));
    pen.beginPath(); pen.arc(q[0], q[1], r, 0, 2 * Math.PI); pen.fillStyle = tint; pen.fill();
  }
  write(x, y, text, color, bold) {
    const { pen } = this;
    pen.font = (bold ? "650 " : "") + "13px system-ui, sans-serif";
    pen.textAlign = "center"; pen.textBaseline = "middle";
    pen.strokeStyle = this.colors.paper; pen.lineWidth = 4; pen.lineJoin = "round";
    pen.strokeText(text, x, y); pen.fillStyle = color; pen.fillText(text, x, y);
    this.written.push([x, y]);
  }
  label(p, text, color) { const q = this.pixel(p); this.write(q[0], q[1], text, color); }
  // A convex solid: only faces towards the eye, shaded by how much they face the light.
  solid(faces, color, alpha = 1) {
    const { pen } = this;
    for (const f of faces) {
      const q = f.map((p) => this.pixel(p));
      const area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
      if (area >= 0) continue;
      const light = dot(unit(cross(sub(f[1], f[0]), sub(f[2], f[0]))), unit([0.3, -0.5, 0.8])), [dark, plain, bright] = this.shades(color);
      this.path(f); pen.closePath(); pen.globalAlpha = alpha; pen.fillStyle = plain; pen.fill(); pen.strokeStyle = plain; pen.lineWidth = 0.6; pen.stroke();
      pen.globalAlpha = 0.75 * alpha * Math.abs(light); pen.fillStyle = light > 0 ? bright : dark; pen.fill();
      pen.globalAlpha = 1;
    }
  }
  frameOf(along) { const a = unit(along), b = unit(cross(a, Math.abs(a[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0])); return [a, b, cross(a, b)]; }
  box(c, along, half) {
    const [a, b, n] = this.frameOf(along);
    const corner = (i, j, k) => add(add(add(c, a, i * half[0]), b, j * half[1]), n, k * half[2]), faces = [];
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
  prism(points, axis, thick) {
    const top = points.map((p) => add(p, axis, thick / 2)), bottom = points.map((p) => add(p, axis, -thick / 2));
    const sides = points.map((_, i) => { const j = (i + 1) % points.length; return [bottom[i], bottom[j], top[j], top[i]]; });
    return [top, bottom.slice().reverse(), ...sides];
  }
  drum(c, along, radius, long) {
    const [a, b, n] = this.frameOf(along), turns = Array.from({ length: 16 }, (_, i) => (i * Math.PI) / 8);
    return this.prism(turns.map((t) => add(add(c, b, radius * Math.cos(t)), n, radius * Math.sin(t))), a, long);
  }

  // Where a planar machine's arrow of gravity begins and ends.
  #gravity() {
    const from = [this.gridLow[0] + 0.05 * this.size, this.gridHigh[1] - 0.06 * this.size, this.floor];
    return [from, add(from, this.machine.gravity, 0.15 * this.size)];
  }
  ground() {
    const { pen, gridLow, gridHigh, floor, size, machine, colors } = this, step = machine.grid;
    pen.lineCap = "butt"; pen.strokeStyle = colors.grid; pen.lineWidth = 1;
    for (let x = gridLow[0]; x <= gridHigh[0] + 1e-9; x += step) { this.path([[x, gridLow[1], floor], [x, gridHigh[1], floor]]); pen.stroke(); }
    for (let y = gridLow[1]; y <= gridHigh[1] + 1e-9; y += step) { this.path([[gridLow[0], y, floor], [gridHigh[0], y, floor]]); pen.stroke(); }
    if (!this.compass) {
      this.baseAxes.forEach((axis, k) => {
        this.line(this.corner, add(this.corner, axis, 0.13 * size), colors.ink, 1.8);
        this.label(add(this.corner, axis, 0.17 * size), "xyz"[k], colors.ink);
      });
    }
    if (!machine.planar || !Math.hypot(...machine.gravity)) return;
    const [from, tip] = this.#gravity(), down = machine.gravity, across = [-down[1], down[0], 0];
    for (const end of [from, add(add(tip, down, -0.04 * size), across, 0.025 * size), add(add(tip, down, -0.04 * size), across, -0.025 * size)]) this.line(tip, end, colors.muted, 1.8);
    this.label(add(from, down, -0.04 * size), "g", colors.muted);
  }
  // The directions of the base frame in the picture's lower right corner, out of the way of everything.
  directionsInCorner() {
    const { pen } = this, from = [this.width - 58, this.level + this.clear / 2 - 42], about = this.project(this.center);
    this.baseAxes.forEach((axis, k) => {
      const q = this.project(add(this.center, axis, 0.01 * this.size)), way = [q[0] - about[0], q[1] - about[1]].map((w) => (100 * w) / this.size);
      pen.beginPath(); pen.moveTo(...from); pen.lineTo(from[0] + 26 * way[0], from[1] + 26 * way[1]);
      pen.lineCap = "round"; pen.strokeStyle = this.colors.ink; pen.lineWidth = 1.8; pen.stroke();
      this.write(from[0] + 37 * way[0], from[1] + 37 * way[1], "xyz"[k], this.colors.ink);
    });
  }
  shadow(m) {
    const { pen, colors, size } = this, drop = (p) => [p[0], p[1], this.floor];
    pen.lineJoin = "round"; pen.lineCap = "round"; pen.strokeStyle = colors.shade; pen.fillStyle = colors.shade;
    for (const chain of m.chains) {
      this.path(chain.map(drop));
      pen.lineWidth = Math.max(2, 0.016 * size * this.pixel(drop(m.position))[3]); pen.stroke();
    }
    this.guides.forEach((rail, i) => { if (this.machine.slides[i]) { this.path(rail.map(drop)); pen.lineWidth = 2; pen.stroke(); } });
    for (const part of m.parts) { this.path(part.corners.map(drop)); pen.closePath(); pen.fill(); }
  }

  // Puts what is to be painted into a list, each with its distance from the eye.
  bodies(m, put, grey) {
    const { machine, size, colors, radii } = this;
    const bar = (a, b, color, radius, nearer = 0) => {
      const count = Math.max(1, Math.ceil((10 * Math.hypot(...sub(b, a))) / size)); // a long bar has no one distance
      for (let j = 0; j < count; j++) {
        const ends = [add(a, sub(b, a), j / count), add(a, sub(b, a), (j + 1) / count)];
        put(ends, () => this.rod(...ends, color, radius), nearer);
      }
    };
    m.chains.forEach((chain, i) => {
      const color = grey || colors.legs[i], a = chain[0], ram = machine.rams[i], along = this.directions[i];
      if (!grey && machine.slides[i]) {
        for (const end of this.guides[i]) bar(end, a, colors.rail, radii.guide, -0.02);
        const motor = add(this.guides[i][0], along, -0.03 * size);
        put([motor], () => this.solid(this.box(motor, along, [0.03 * size, 0.018 * size, 0.018 * size]), colors.rail));
      } else if (!grey && this.guides[i].length > 1) {
        this.guides[i].slice(1).forEach((p, j) => { if (j % 2) put([p], () => this.line(this.guides[i][j], p, colors.rail, 1), -0.02); });
        put([a], () => this.solid(this.drum(a, along, 0.024 * size, 0.066 * size), colors.rail), -0.015);
      }
      if (machine.slides[i]) put([a], () => this.solid(this.box(a, along, [0.036 * size, 0.02 * size, 0.02 * size]), color));
      chain.slice(1, -1).forEach((p, j) => bar(chain[j], p, color, radii.upper * (ram ? 1.25 : 1)));
      const ends = chain.slice(-2), pair = this.bars[i], sides = pair ? [-size, size].map((t) => ends.map((p) => add(p, pair, t))) : [ends];
      for (const [from, to] of sides) bar(from, to, color, pair || ram ? radii.rod : radii.lower);
      if (pair) for (const j of [0, 1]) bar(sides[0][j], sides[1][j], color, radii.rod);
      for (const p of ram ? [a, chain[2]] : chain) put([p], () => this.ball(p, color, 1.25 * Math.max(radii.lower, 0.6 * radii.upper)), 0.012);
    });
    for (const part of m.parts) {
      const { hub, corners } = part, color = grey || colors.reach;
      const faces = () => (part.triangles ? part.triangles.map((three) => three.map((i) => corners[i])) : this.prism(corners, m.axes[2], 0.016 * size));
      if (corners.length > 2 && !grey) put(corners, () => this.solid(faces(), color, 0.9));
      for (const corner of corners) bar(hub, corner, color, radii.platform);
      put([hub], () => this.ball(hub, color, 1.3 * radii.platform), 0.012);
    }
    if (m.tool) {
      bar(m.position, m.tool, grey || colors.reach, radii.platform);
      put([m.tool], () => this.ball(m.tool, grey || colors.ink, 1.1 * radii.platform), 0.02);
    }
  }
  // An arrow along a path, straight or bent: its head begins where the path comes so near to its tip.
  arrow([points, color, radius]) {
    const path = this.deep(points), b = path.pop(), away = (p, q) => Math.hypot(...sub(q, p)), thick = radius * this.size;
    const whole = path.reduce((sum, p, i) => sum + away(p, path[i + 1] || b), 0);
    if (whole < 1e-9) return [];
    const tint = this.colors[color] || this.colors.legs[color], head = Math.min(6 * thick, 0.6 * whole);
    while (path.length > 1 && away(path[path.length - 1], b) < head) path.pop();
    const neck = add(b, unit(sub(b, path[path.length - 1])), -head);
    const cone = () => {
      const p = this.pixel(neck), q = this.pixel(b), w = Math.max(3, 2.6 * thick * p[3]), { pen } = this;
      const n = unit([q[1] - p[1], p[0] - q[0], 0]);
      pen.beginPath(); pen.moveTo(q[0], q[1]); pen.lineTo(p[0] + w * n[0], p[1] + w * n[1]); pen.lineTo(p[0] - w * n[0], p[1] - w * n[1]); pen.closePath();
      pen.fillStyle = tint; pen.fill(); pen.strokeStyle = this.colors.paper; pen.lineWidth = 1; pen.stroke();
    };
    const shaft = path.map((p, i) => [p, path[i + 1] || neck]).map((ends) => [ends, () => this.rod(...ends, tint, thick)]);
    return [...shaft, [[b], cone]];
  }

  draw() {
    const { pen, machine, size, colors, now: m, extra } = this;
    this.queued = false;
    if (!m || !this.width) return;
    pen.clearRect(0, 0, this.width, this.height);
    this.written = [];
    if (this.compass) {
      pen.save(); pen.beginPath(); pen.rect(0, this.level - this.clear / 2, this.width, this.height); pen.clip(); this.ground(); pen.restore();
      this.directionsInCorner();
    } else this.ground();
    if (!machine.planar) this.shadow(m);
    for (const { color, rings } of extra.slice || []) {
      pen.beginPath();
      for (const ring of this.deep(rings)) ring.forEach((p, i) => { const q = this.pixel(p); if (i) pen.lineTo(q[0], q[1]); else pen.moveTo(q[0], q[1]); });
      pen.globalAlpha = 0.42; pen.fillStyle = color; pen.fill("evenodd"); pen.globalAlpha = 1;
    }
    const items = [];
    const put = (points, run, nearer = 0) => {
      const depth = points.reduce((sum, p) => sum + this.project(p)[2], 0) / points.length;
      items.push([depth - nearer * size, run]);
    };
    if (this.base.length > 2) {
      const normal = unit(cross(sub(this.base[1], this.base[0]), sub(this.base[2], this.base[0])));
      put(this.base, () => this.solid(this.prism(this.base, normal, 0.014 * size), colors.rail, 0.4), -0.03);
    } else if (this.base.length > 1) put(this.base, () => this.rod(...this.base, colors.rail, this.radii.guide), -0.03);
    if (extra.ghost) this.bodies(this.turned(extra.ghost), put, colors.muted);
    this.bodies(m, put);
    for (const one of extra.arrows || []) for (const [points, run] of this.arrow(one)) put(points, run, 0.03);
    items.sort((a, b) => b[0] - a[0]).forEach((item) => item[1]());

    if ((extra.trail || []).length > 1) {
      pen.setLineDash(extra.dashed ? [2, 4] : []); this.path(this.deep(extra.trail));
      pen.strokeStyle = colors.ink; pen.lineWidth = 1.4; pen.stroke(); pen.setLineDash([]);
    }
    const p = m.position;
    m.axes.slice(0, this.baseAxes.length).forEach((axis, j) => this.line(p, add(p, axis, (j < 2 ? 0.1 : 0.07) * size), colors.ink, 1.6));
    for (const { at, held } of extra.handles || []) {
      const q = this.pixel(this.deep(at));
      pen.beginPath(); pen.arc(q[0], q[1], held ? 9 : 7, 0, 2 * Math.PI); pen.fillStyle = colors.paper; pen.globalAlpha = 0.8; pen.fill(); pen.globalAlpha = 1;
      pen.strokeStyle = colors.accent; pen.lineWidth = 2.5; pen.stroke();
    }
    if (extra.spring) {
      const [a, b] = extra.spring.map((end) => this.pixel(this.deep(end))), n = unit([a[1] - b[1], b[0] - a[0], 0]);
      pen.beginPath(); pen.moveTo(a[0], a[1]);
      for (let j = 1; j < 24; j++) { const t = j / 24, w = j % 2 ? 5 : -5; pen.lineTo(a[0] + t * (b[0] - a[0]) + w * n[0], a[1] + t * (b[1] - a[1]) + w * n[1]); }
      pen.lineTo(b[0], b[1]); pen.strokeStyle = colors.warning; pen.lineWidth = 1.8; pen.stroke();
    }
    m.chains.forEach((chain, i) => {
      const at = chain[0], along = machine.slides[i] ? this.directions[i] : unit(sub(chain[1], at));
      const a = this.pixel(at), ahead = this.pixel(add(at, along, 0.1)), from = this.pixel(p);
      const across = unit([a[1] - ahead[1], ahead[0] - a[0], 0]);
      const sign = across[0] * (a[0] - from[0]) + across[1] * (a[1] - from[1]) < 0 ? -1 : 1, gap = sign * (0.034 * size * a[3] + 11);
      // Elsewhere where another letter stands already: feet of two legs may be one in the picture.
      const places = [1, 1.7, -1, 2.4].map((t) => [a[0] + t * gap * across[0], a[1] + t * gap * across[1]]);
      const [x, y] = places.find((q) => this.written.every((w) => Math.hypot(q[0] - w[0], q[1] - w[1]) > 15)) || places[0];
      this.write(x, y, String(i + 1), colors.legs[i], true);
    });
    if (this.drawn) this.drawn();
  }
  redraw() {
    if (this.queued) return;
    this.queued = true;
    requestAnimationFrame(() => { if (this.queued) this.draw(); });
  }

  // Turning, shifting, coming nearer.
  turn(yaw, pitch) {
    this.camera.yaw += yaw; this.camera.pitch = Math.min(Math.PI / 2, Math.max(-0.3, this.camera.pitch + pitch)); this.frameAll();
  }
  zoom(factor) { this.camera.zoom = Math.min(8, Math.max(0.5, this.camera.zoom * factor)); this.redraw(); }
  shift(x, y) { this.camera.pan = [this.camera.pan[0] + x, this.camera.pan[1] + y]; this.redraw(); }
  reset() { this.camera = { ...this.start }; this.frameAll(); }
  #watch() {
    const { canvas, fingers } = this;
    let engaged = false;
    // `grab`, where there is one, may take a pointer for itself.
    canvas.addEventListener("pointerdown", (event) => {
      engaged = true;
      fingers.set(event.pointerId, [event.clientX, event.clientY]); canvas.setPointerCapture(event.pointerId);
      this.held = fingers.size === 1 && this.grab ? this.grab(event.offsetX, event.offsetY) : null;
    });
    canvas.addEventListener("pointermove", (event) => {
      const from = fingers.get(event.pointerId);
      if (!from) return;
      const to = [event.clientX, event.clientY], by = [to[0] - from[0], to[1] - from[1]];
      if (this.held) this.held.move(event.offsetX, event.offsetY);
      else if (fingers.size === 2) {
        const other = [...fingers.entries()].find(([id]) => id !== event.pointerId)[1];
        const span = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
        this.zoom(span(to) / Math.max(span(from), 1)); this.shift(by[0] / 2, by[1] / 2);
      } else if (event.buttons & 6 || event.shiftKey) this.shift(...by);
      else this.turn(0.008 * by[0], 0.008 * by[1]);
      fingers.set(event.pointerId, to);
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => { fingers.delete(event.pointerId); if (this.held) this.held.end(); this.held = null; });
    }
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    // The wheel scrolls the page unless the view was clicked, or a key says that it is meant.
    for (const name of ["pointerleave", "blur"]) canvas.addEventListener(name, () => { engaged = false; });
    canvas.addEventListener("wheel", (event) => {
      if (!this.whole && !engaged && !event.ctrlKey && !event.shiftKey && !event.metaKey) return;
      this.zoom(Math.exp(-0.0016 * (event.deltaY || event.deltaX)));
      event.preventDefault();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const keys = {
        ArrowLeft: () => this.turn(-0.09, 0), ArrowRight: () => this.turn(0.09, 0), ArrowUp: () => this.turn(0, -0.07), ArrowDown: () => this.turn(0, 0.07),
        "+": () => this.zoom(1.15), "=": () => this.zoom(1.15), "-": () => this.zoom(1 / 1.15), " ": () => this.space && this.space(), Home: () => this.reset(),
      };
      if (keys[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) { keys[event.key](); event.preventDefault(); }
    });
    for (const query of ["(prefers-color-scheme: dark)", "print"]) window.matchMedia(query).addEventListener("change", () => { this.theme(); this.draw(); });
    new ResizeObserver(() => { this.fit(); this.draw(); }).observe(canvas);
    this.fit();
  }
}
