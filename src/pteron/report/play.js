// The motion of a page: its frames follow the clock, with the readings of each moment.
(() => {
  const data = JSON.parse(document.getElementById("scene").textContent);
  const canvas = document.getElementById("view");
  if (!canvas.getContext("2d")) return;
  document.documentElement.classList.add("scripted");
  if (window.location.search === "?embedded") document.documentElement.classList.add("embedded");
  const play = document.getElementById("play"), seek = document.getElementById("seek"), pace = document.getElementById("pace");
  const frames = data.time.length, calm = window.matchMedia("(prefers-reduced-motion: reduce)");
  const path = data.tool || data.position, trail = data.closed ? path.concat([path[0]]) : path;
  // Bars of one unit share a scale.
  const peaks = data.units.map((unit) =>
    data.forces.reduce((most, row) => Math.max(most, ...row.filter((_, i) => data.units[i] === unit).map(Math.abs)), 1e-9));
  const picture = new Picture(canvas, data, data.chains.flat(2).concat(data.position));
  // The page around a frame may have a theme of its own: it sends "dark" or "light".
  const dark = [...document.styleSheets].flatMap((sheet) => [...sheet.cssRules])
    .filter((rule) => rule.media?.mediaText.includes("prefers-color-scheme: dark"));
  window.addEventListener("message", ({ source, data: theme }) => {
    if (source !== window.parent || !["dark", "light"].includes(theme)) return;
    for (const rule of dark) rule.media.mediaText = theme === "dark" ? "screen" : "not all";
    picture.theme(); picture.draw();
  });
  let frame = 0, playing = false, now = 0, last = null, shown = true;

  // A line in every curve over time, at the moment that the picture shows.
  const cursors = [...document.querySelectorAll("svg[data-time]")].map((svg) => {
    const [start, end, left, right, top, bottom] = svg.dataset.time.split(" ").map(Number), line = document.createElementNS(svg.namespaceURI, "line");
    line.setAttribute("class", "cursor"); line.setAttribute("y1", top); line.setAttribute("y2", bottom); svg.append(line);
    return (time) => { for (const name of ["x1", "x2"]) line.setAttribute(name, left + ((right - left) * (time - start)) / (end - start)); };
  });
  const put = (id, text) => { document.getElementById(id).textContent = text; };
  picture.drawn = () => {
    const k = frame;
    for (let i = 0; i < data.guides.length; i++) {
      const force = data.forces[k][i], share = (50 * Math.abs(force)) / peaks[i];
      const bar = document.getElementById("bar" + i);
      bar.style.width = share + "%"; bar.style.left = (force < 0 ? 50 - share : 50) + "%";
      put("force" + i, minus(force, Math.max(peaks[i] < 1e3 ? 1 : 0, 2 - Math.floor(Math.log10(peaks[i]))))); put("joint" + i, minus(data.factors[i] * data.coordinates[k][i], 1));
    }
    data.pose[k].forEach((value, j) => put("pose" + j, minus(value * data.scales[j], 1)));
    put("clock", data.time[k].toFixed(2) + " of " + data.duration.toFixed(2) + " s");
    seek.value = k; cursors.forEach((move) => move(data.time[k]));
    seek.setAttribute("aria-valuetext", data.time[k].toFixed(2) + " seconds");
  };
  function show(k) {
    frame = Math.min(Math.max(k, 0), frames - 1); now = data.time[frame];
    picture.show(moment(data, frame), { trail, dashed: true });
  }
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
      let at = now + (Number(pace.value) * (clock - last)) / 1e3;
      // A closed motion goes on from its beginning; another one stops, for it would jump there.
      if (data.closed) at %= data.duration;
      const k = frameAt(at);
      if (k !== frame) { show(k); picture.draw(); }
      now = at;
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
  picture.space = () => run(!playing);
  play.addEventListener("click", () => run(!playing));
  document.getElementById("reset").addEventListener("click", () => picture.reset());
  seek.addEventListener("input", () => { run(false); show(Number(seek.value)); });
  calm.addEventListener("change", () => { if (calm.matches) run(false); });
  new IntersectionObserver((seen) => { shown = seen[0].isIntersecting; last = null; }).observe(canvas);

  // Paper has no use for closed sections.
  const folds = () => [...document.querySelectorAll("details:not([open])")];
  let opened = [];
  window.addEventListener("beforeprint", () => { opened = folds(); opened.forEach((fold) => { fold.open = true; }); });
  window.addEventListener("afterprint", () => opened.forEach((fold) => { fold.open = false; }));

  seek.max = String(frames - 1);
  show(0); picture.draw();
  if (!calm.matches) run(true);
})();
