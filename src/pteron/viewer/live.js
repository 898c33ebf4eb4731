// The page of one machine: shows what the server tells, and asks it for what a person does.
(() => {
  const the = (id) => document.getElementById(id), every = (query) => [...document.querySelectorAll(query)];
  const _SPAN = 10, _HELD = 500, _TRAIL = 3000;
  let picture, machine, state, settled, listed, slice = [], socket, trail = [], held = null;
  const touched = {}, past = [];
  const send = (asked) => { if (socket && socket.readyState === 1) socket.send(JSON.stringify(asked)); };
  const round = (value) => Math.round(10 * value) / 10;

  // The connection.
  function connect() {
    socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[?#].*/, ""));
    socket.onmessage = (event) => {
      const [[kind, data]] = Object.entries(JSON.parse(event.data));
      ({ machine: takeMachine, state: takeState, spans: takeSpans, settled: takeSettled, slice: takeSlice })[kind](data);
    };
    socket.onopen = () => { the("gone").hidden = true; };
    socket.onclose = () => {
      the("gone").textContent = "The server is gone: nothing here moves until pteron view runs again. This page then comes back by itself.";
      the("gone").hidden = false;
      setTimeout(connect, 1000);
    };
  }

  function takeMachine(found) {
    const first = !machine;
    if (!first && machine.run !== found.run) { socket.onmessage = null; location.reload(); return; } // perhaps of another machine
    machine = found; trail = []; slice = [];
    if (first) {
      picture = new Picture(the("view"), found.still, found.cloud);
      Object.assign(picture, { whole: true, grab, space: () => the("play").click(), bar: document.querySelector(".top"), foot: the("transport"), compass: true, drawn: placeHint });
      picture.fit();
    } else { picture.take(found.still, found.cloud); picture.frameAll(); }
    for (const [name, sliders] of [["pose", found.coordinates], ["joint", found.joints]]) {
      sliders.forEach((one, i) => Object.assign(the(name + i), { min: one.least, max: one.most }));
    }
    the("squares").textContent = `squares of ${round(1e3 * found.still.grid)} mm`;
    if (first) follow();
  }

  function takeState(found) {
    state = found;
    const status = the("status");
    if (status.textContent !== found.message) status.textContent = found.message;
    status.classList.toggle("warns", found.warns);
    the("where").textContent = found.where;
    the("given").replaceChildren(...found.plotted.forces.flatMap((force, i) => {
      const one = document.createElement("span"), leg = document.createElement("span");
      leg.className = `leg leg${(i % 6) + 1}`; leg.textContent = i + 1;
      one.append(leg, ` ${force === null ? "–" : `${minus(force, Math.abs(force) < 100 ? 1 : 0)} ${machine.forceUnits[i]}`}`);
      return [one, " "];
    }));
    const silent = the("transport").hidden;
    the("transport").hidden = found.duration === null;
    if (silent !== the("transport").hidden) picture.fit();
    the("readout").innerHTML = found.readout;
    putAll(); nameAssemblies();
    if (document.activeElement !== the("payload")) the("payload").value = found.payload;
    const doubt = the("payload-doubt");
    if (doubt.textContent !== found.payloadDoubt) doubt.textContent = found.payloadDoubt;
    doubt.hidden = !found.payloadDoubt;
    for (const id of ["mode", "plane", "speed"]) the(id).value = found[id];
    the("screws").checked = found.screws;
    const play = the("play"), push = the("push"), time = the("time");
    play.setAttribute("aria-pressed", found.playing); play.textContent = found.playing ? "Pause" : "Play";
    push.setAttribute("aria-pressed", found.pushing); push.setAttribute("aria-busy", found.preparing);
    push.textContent = found.pushing ? "Bring it to rest" : found.preparing ? "Preparing …" : "Let it move";
    the("does").textContent = found.pushed;
    if (found.pushing && document.activeElement !== the("stiffness") && !the("stiffness").value) the("stiffness").value = found.stiffness;
    time.disabled = found.duration === null;
    if (found.duration !== null) {
      time.max = Math.max(0.01, found.duration); put("time", found.time);
      the("clock").textContent = `${found.time.toFixed(2)} of ${found.duration.toFixed(2)}`;
      the("title").textContent = `${found.title}: ${Number(found.duration.toPrecision(3))} s`;
    }
    const end = trail[trail.length - 1];
    if (!end || Math.hypot(...sub(end, found.tip)) > 1e-4 * picture.size) trail = [...trail.slice(-_TRAIL), found.tip];
    past.push({ clock: found.clock, ...found.plotted });
    while (past[0].clock < found.clock - _SPAN) past.shift();
    the("force-scale").textContent = found.legend;
    every("[data-if]").forEach((one) => { one.hidden = one.dataset.if === "screws" ? !found.screws : found.plane === "none"; });
    show(); plot();
  }
  function putAll() {
    state.pose.forEach((value, i) => put("pose" + i, value));
    state.joints.forEach((value, i) => put("joint" + i, value));
  }
  // A control that a person moves is left alone: an older answer would pull it back.
  function put(id, value) {
    const slider = the(id), field = the(id + "n");
    if (performance.now() - (touched[id] || -1e9) > _HELD) {
      if (value < slider.min) slider.min = value;
      if (value > slider.max) slider.max = value;
      slider.value = value;
    }
    if (field && document.activeElement !== field) field.value = round(value);
    if (!field) slider.setAttribute("aria-valuetext", `${value.toFixed(2)} seconds`);
  }
  // The band of each slider: how far it may go from here; none for joints whose spans take too long while the machine moves.
  function takeSpans(found) {
    for (const name of ["pose", "joint"]) {
      const spans = found[name];
      if (!spans) every(`input[type=range][id^=joint]`).forEach((slider) => { slider.style.setProperty("--from", "0%"); slider.style.setProperty("--to", "0%"); slider.title = ""; });
      else spans[0].forEach((low, i) => {
        const slider = the(name + i), share = (x) => `${(100 * (x - slider.min)) / (slider.max - slider.min)}%`;
        slider.style.setProperty("--from", share(Math.min(low, spans[1][i]))); slider.style.setProperty("--to", share(Math.max(low, spans[1][i])));
        slider.title = `from here ${round(low)} to ${round(spans[1][i])}`;
      });
    }
  }
  function takeSettled(found) {
    settled = found; listed = null;
    nameAssemblies();
    setTimeout(putAll, _HELD);
  }
  // The list of assembly modes is that of a pose; while the machine moves it has the pose alone.
  function nameAssemblies() {
    const same = settled && free() && settled.label === state.label, names = same ? settled.assemblies : [state.label];
    if (listed === names.join()) return;
    listed = names.join();
    the("assembly").replaceChildren(...names.map((words) => new Option(words)));
    the("assembly").selectedIndex = same ? settled.assembly : 0;
  }
  function takeSlice(found) { slice = found.parts; the("map").innerHTML = found.map; show(); }

  // The picture.
  function handles() {
    const { position, axes } = state.now, found = machine.lengths ? [{ at: position, axis: null }] : [];
    const turns = machine.angles > 1 ? [0, 1, 2] : machine.angles ? [0] : [];
    turns.forEach((j) => found.push({ at: add(position, axes[j], (j < 2 ? 0.1 : 0.07) * picture.size), axis: j }));
    return found;
  }
  // What a new user cannot guess stands beside the ring until it was dragged once, on this browser.
  const learned = { get known() { try { return localStorage.getItem("pteron-ring") === "1"; } catch { return this.said; } } };
  function learn() { learned.said = true; try { localStorage.setItem("pteron-ring", "1"); } catch { /* no storage here */ } the("first").hidden = true; }
  function placeHint() {
    const hint = the("first"), ring = free() && !learned.known && !learned.said && the("show-handles").checked && handles()[0];
    hint.hidden = !ring;
    if (!ring) return;
    the("first-text").textContent = `Drag this ring to ${ring.axis === null ? "move" : "turn"} the platform`;
    const [x, y] = picture.pixel(picture.deep(ring.at)), wide = hint.offsetWidth, right = x + 16 + wide < picture.width;
    hint.style.left = `${Math.max(6, right ? x + 16 : x - 16 - wide)}px`; hint.style.top = `${y + 14}px`;
  }
  const free = () => state && !state.playing && !state.pushing;
  function show() {
    if (!state || !picture) return;
    const forces = the("show-forces").checked ? state.forces : [], rings = free() && the("show-handles").checked ? handles() : [];
    picture.show(state.now, {
      ghost: state.ghost, arrows: forces.concat(state.arrows), slice, spring: state.spring,
      trail: the("show-trail").checked ? trail : [], handles: rings.map((one) => ({ ...one, held: held === one.axis + "" })),
    });
  }
  // Where a spring takes hold of the platform: all over it, but not at the centre of one that only turns.
  function grips() {
    const found = state.now.parts.flatMap(({ hub, corners }) => corners.flatMap((corner, i) => {
      const spokes = [0.25, 0.5, 0.75, 1].map((t) => add(hub, sub(corner, hub), t)), next = corners[(i + 1) % corners.length];
      return [...spokes, add(corner, sub(next, corner), 0.5)];
    }));
    return machine.lengths ? found.concat(state.now.parts.map((part) => part.hub), [state.now.tool || state.now.position]) : found;
  }
  // What a pointer takes hold of: a handle, else a part of the platform.
  function grab(x, y) {
    if (!state) return null;
    const away = (p) => { const q = picture.pixel(picture.deep(p)); return Math.hypot(q[0] - x, q[1] - y); };
    const nearest = (list, at) => list.reduce((best, one) => (away(at(one)) < (best ? away(at(best)) : Infinity) ? one : best), null);
    const corners = state.now.parts.flatMap((part) => [part.hub, ...part.corners]).concat([state.now.tool || state.now.position]);
    if (state.playing) return null;
    if (state.pushing) {
      const grip = nearest(grips(), (p) => p);
      if (away(grip) > 45) return null;
      const pull = (px, py) => send({ do: "pull", grip, to: picture.given(picture.under(px, py, picture.deep(grip))), stiffness: typed(the("stiffness")) || state.stiffness });
      pull(x, y);
      return { move: pull, end: () => send({ do: "release" }) };
    }
    const handle = the("show-handles").checked ? nearest(handles(), (one) => one.at) : null;
    const corner = nearest(corners, (p) => p), taken = handle && away(handle.at) < 22;
    if (!taken && (away(corner) > 20 || !machine.lengths)) return null;
    const at = taken ? handle.at : corner, axis = taken ? handle.axis : null, offset = taken ? [0, 0, 0] : sub(state.now.position, corner);
    const from = picture.under(x, y, picture.deep(at)), start = picture.deep(at);
    held = axis + ""; learn();
    return {
      // A push that begins meanwhile, once its equations are prepared, is not ended by this drag.
      move: (px, py) => { if (!state.pushing) send({ do: "drag", axis, to: add(picture.given(add(start, sub(picture.under(px, py, start), from))), offset) }); },
      end: () => { held = null; show(); },
    };
  }

  // Lines over the last seconds.
  function plot() {
    if (!the("plots").open || plot.queued) return;
    plot.queued = true;
    requestAnimationFrame(() => {
      plot.queued = false;
      for (const name of ["forces", "joints", "power"]) {
        const canvas = the("plot-" + name), pen = canvas.getContext("2d"), ratio = window.devicePixelRatio || 1;
        const width = canvas.clientWidth, height = canvas.clientHeight, colors = picture.colors;
        if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
        pen.setTransform(ratio, 0, 0, ratio, 0, 0); pen.clearRect(0, 0, width, height);
        const known = past.flatMap((row) => row[name]).filter((value) => value !== null);
        if (!known.length) continue;
        let low = Math.min(...known), high = Math.max(...known);
        // What differs by rounding alone is drawn as one level, and its numbers have no more digits.
        const most = Math.max(Math.abs(low), Math.abs(high)), rim = most < 1e-6 ? 1 : Math.max(0.08 * (high - low), 0.02 * most);
        low -= rim; high += rim;
        const places = Math.min(4, Math.max(0, 1 - Math.floor(Math.log10(high - low)))), levels = [low + rim, (low + high) / 2, high - rim];
        const labels = levels.map((v) => minus(v, places)).map((text, i, all) => (all.indexOf(text) === i ? text : ""));
        pen.font = "11px system-ui, sans-serif";
        const left = Math.max(46, ...labels.map((text) => pen.measureText(text).width + 8));
        const end = past[past.length - 1].clock, x = (t) => left + ((t - end + _SPAN) / _SPAN) * (width - left - 4), y = (v) => 4 + ((high - v) / (high - low)) * (height - 20);
        pen.fillStyle = colors.muted; pen.textAlign = "right"; pen.textBaseline = "middle";
        for (const [i, v] of levels.entries()) {
          if (!labels[i]) continue;
          pen.fillText(labels[i], left - 5, y(v)); pen.strokeStyle = colors.grid; pen.lineWidth = 1;
          pen.beginPath(); pen.moveTo(left, y(v)); pen.lineTo(width, y(v)); pen.stroke();
        }
        pen.textBaseline = "alphabetic"; pen.textAlign = "left"; pen.fillText(`${_SPAN} s ago`, left, height - 2); pen.textAlign = "right"; pen.fillText("now", width - 2, height - 2);
        past[0][name].forEach((_, i) => {
          pen.beginPath(); let on = false;
          for (const row of past) { if (row[name][i] === null) { on = false; continue; } pen[on ? "lineTo" : "moveTo"](x(row.clock), y(row[name][i])); on = true; }
          pen.strokeStyle = colors.legs[i]; pen.lineWidth = 1.6; pen.setLineDash([[], [7, 2], [2, 2], [7, 2, 2, 2], [4, 2], [1, 1]][i]); pen.stroke(); pen.setLineDash([]);
        });
      }
    });
  }

  // What people do.
  function typed(field) { const said = field.value.trim().replace(",", "."), value = Number(said); return said !== "" && Number.isFinite(value) ? value : null; }
  for (const [name, what] of [["pose", "coordinate"], ["joint", "joint"]]) {
    every(`input[type=range][id^=${name}]`).forEach((slider, i) => {
      const ask = (value) => { if (value !== "" && Number.isFinite(Number(value))) send({ do: what, i, value: Number(value) }); };
      slider.addEventListener("input", () => { touched[slider.id] = performance.now(); the(slider.id + "n").value = slider.value; ask(slider.value); });
      the(slider.id + "n").addEventListener("change", (event) => { if (typed(event.target) === null) event.target.value = slider.value; else ask(typed(event.target)); });
    });
  }
  const on = (id, event, act) => the(id).addEventListener(event, act);
  on("typed", "submit", (event) => { event.preventDefault(); send({ do: "type", text: the("type").value }); });
  on("payload", "change", (event) => send({ do: "payload", text: event.target.value }));
  on("mode", "change", (event) => send({ do: "mode", mode: event.target.value }));
  on("assembly", "change", (event) => send({ do: "assembly", i: event.target.selectedIndex }));
  on("speed", "change", (event) => send({ do: "speed", speed: event.target.value }));
  on("plane", "change", (event) => send({ do: "plane", plane: event.target.value }));
  on("screws", "change", (event) => send({ do: "screws", on: event.target.checked }));
  for (const id of ["home", "undo", "standard"]) on(id, "click", () => send({ do: id }));
  on("play", "click", () => send({ do: "play", on: !state.playing }));
  on("back", "click", () => send({ do: "step", back: true }));
  on("ahead", "click", () => send({ do: "step", back: false }));
  on("time", "input", (event) => { touched.time = performance.now(); send({ do: "seek", time: Number(event.target.value) }); });
  on("file", "change", async (event) => {
    const [file] = event.target.files;
    if (!file) return;
    const data = await file.arrayBuffer();
    send({ do: "file", name: file.name }); socket.send(data); event.target.value = "";
  });
  on("push", "click", () => {
    if (state.pushing) send({ do: "rest" });
    else if (!state.preparing) { the("stiffness").value = ""; send({ do: "push", drives: the("drives").value }); }
  });
  on("drives", "change", () => { if (state.pushing) send({ do: "push", drives: the("drives").value }); });
  for (const id of ["show-forces", "show-handles", "show-trail"]) on(id, "change", () => { if (id === "show-trail") trail = []; show(); });
  on("first-close", "click", learn);
  on("plots", "toggle", plot);
  on("reset", "click", () => picture.reset());
  on("whole", "click", () => { if (document.fullscreenElement) document.exitFullscreen(); else document.documentElement.requestFullscreen(); });
  the("whole").hidden = !document.fullscreenEnabled;
  function fold(away) {
    document.body.classList.toggle("folded", away); the("fold").setAttribute("aria-expanded", !away);
    if (away) the("brief").append(the("status")); else the("panel").prepend(the("status"));
  }
  on("fold", "click", () => fold(!document.body.classList.contains("folded")));
  fold(window.matchMedia("(max-width: 759px)").matches);
  the("legend").open = window.matchMedia("(min-width: 1300px) and (min-height: 700px)").matches;
  document.addEventListener("keydown", (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === "z" && !event.target.matches("input[type=text]")) { event.preventDefault(); send({ do: "undo" }); }
  });

  // A link that carries pose, modes and looks.
  on("link", "click", async () => {
    const { yaw, pitch, zoom, pan } = picture.camera, marks = ["show-forces", "show-handles", "show-trail"].map((id) => Number(the(id).checked)).join("");
    const said = new URLSearchParams({ pose: state.pose.join(" "), mode: state.mode, payload: state.payload, plane: state.plane, screws: Number(state.screws), show: marks, eye: [yaw, pitch, zoom, ...pan].map((x) => x.toFixed(3)).join(" ") });
    history.replaceState(null, "", "#" + said);
    try { await navigator.clipboard.writeText(location.href); the("link").textContent = "Link copied"; } catch { the("link").textContent = "Link is in the address"; }
    setTimeout(() => { the("link").textContent = "Copy link"; }, 2000);
  });
  function follow() {
    const said = new URLSearchParams(location.hash.slice(1)), get = (name) => said.get(name);
    if (machine.modes.includes(get("mode"))) send({ do: "mode", mode: get("mode") });
    if (get("payload")) send({ do: "payload", text: get("payload") });
    if (get("pose")) send({ do: "type", text: get("pose") });
    if (machine.planes.includes(get("plane"))) send({ do: "plane", plane: get("plane") });
    if (get("screws")) send({ do: "screws", on: get("screws") === "1" });
    if (get("show")) ["show-forces", "show-handles", "show-trail"].forEach((id, i) => { the(id).checked = get("show")[i] === "1"; });
    const eye = (get("eye") || "").split(" ").map(Number);
    if (eye.length === 5 && eye.every(Number.isFinite)) { picture.camera = { yaw: eye[0], pitch: eye[1], zoom: Math.min(8, Math.max(0.5, eye[2])), pan: eye.slice(3) }; picture.frameAll(); }
  }
  // Where the first handle is in the picture, for tests and benchmarks.
  the("view").platform = () => picture.pixel(picture.deep(handles()[0].at)).slice(0, 2);
  connect();
})();
