(() => {
"use strict";
// Steps through the increments of a drop. Without what it needs, the still pictures stay in its place.
const root = document.getElementById("explorer");
if (!root || !("DecompressionStream" in window)) return;
const $ = name => document.getElementById("x-" + name);
const canvas = $("canvas"), ink = canvas.getContext("2d");
const MEASURES = [
  ["axial_force_N", "axial force", "N"], ["buckling_angle_deg", "buckling angle", "°"],
  ["axial_displacement_over_R", "axial displacement/R", ""],
  ["normal_displacement_over_R", "normal displacement/R", ""],
  ["rotation_deg", "rotation", "°"], ["lateral_force_N", "lateral force", "N"]];
const WALLS = { "-1": [-1, 0], "-2": [1, 0], "-3": [0, -1], "-4": [0, 1], "-5": [0, 1] };
const MAX_ZOOM = 20, FRAME_MS = 140, MOUSE_PX = 6, TOUCH_PX = 16;
const views = new Map();
let view = null, step = 0, zoom = 1, centre = [0, 0], hovered = -1, chosen = -1, timer = 0, waiting = false;

// ---- data
async function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.content), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const width = Number(packed.type.slice(1)), count = planes.length / width;
  const values = new Uint8Array(planes.length);
  for (let byte = 0; byte < width; byte++)
    for (let i = 0; i < count; i++) values[i * width + byte] = planes[byte * count + i];
  return new ({ i4: Int32Array, i2: Int16Array, u1: Uint8Array }[packed.type])(values.buffer);
}
function accumulate(values, rowLength) { // rows hold changes since the row before
  for (let i = rowLength; i < values.length; i++) values[i] += values[i - rowLength];
  return values;
}
async function load(id) {
  if (!views.has(id)) {
    const data = JSON.parse(document.getElementById(id).textContent);
    const [radius, position, contacts, force, chain, text] = await Promise.all(
      ["radius", "position", "contacts", "force", "chain", "measures"].map(name => unpack(data[name])));
    const n = radius.length, pairs = contacts.length / 2;
    views.set(id, { ...data, n, pairs, radius, position: accumulate(position, 2 * n), contacts: accumulate(contacts, 2),
      force: accumulate(force, pairs), chain, chainBytes: Math.ceil(n / 8), measures: JSON.parse(new TextDecoder().decode(text)) });
  }
  return views.get(id);
}
const x = (disc, at = step) => view.position[at * 2 * view.n + disc];
const y = (disc, at = step) => view.position[at * 2 * view.n + view.n + disc];
const inChain = disc => (view.chain[($("then").checked ? 0 : step) * view.chainBytes + (disc >> 3)] >> (disc & 7)) & 1;

// ---- drawing
const colour = name => getComputedStyle(root).getPropertyValue(name).trim();
function frame() {
  const width = canvas.clientWidth, height = canvas.clientHeight, [w, h] = view.size;
  const scale = zoom * Math.min((width - 8) / w, (height - 8) / h);
  return { width, height, scale, X: value => width / 2 + (value - centre[0]) * scale,
    Y: value => height / 2 - (value - centre[1]) * scale };
}
const meanRadius = f => view.quanta_a_radius * f.scale;
function draw() {
  waiting = false;
  if (!view || !canvas.clientWidth) return;
  const ratio = window.devicePixelRatio || 1, f = frame();
  if (canvas.width !== Math.round(f.width * ratio) || canvas.height !== Math.round(f.height * ratio)) {
    canvas.width = Math.round(f.width * ratio); canvas.height = Math.round(f.height * ratio);
  }
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.clearRect(0, 0, f.width, f.height);
  ink.lineCap = ink.lineJoin = "round";
  const buckling = new Map();
  if ($("segments").checked) view.segments.forEach(s => s.particles.forEach(disc => buckling.set(disc, s.class)));
  const groups = { plain: [], chain: [] };
  for (let disc = 0; disc < view.n; disc++) {
    if (buckling.has(disc)) continue;
    if ($("chains").checked && inChain(disc)) groups.chain.push(disc);
    else if ($("discs").checked) groups.plain.push(disc);
  }
  discs(f, groups.plain, colour("--disc"), colour("--disc-edge"));
  discs(f, groups.chain, colour("--chain"), colour("--canvas"));
  for (let kind = 0; kind < 5; kind++) {
    const members = [...buckling].filter(([, found]) => found === kind).map(([disc]) => disc);
    discs(f, members, colour("--class-" + kind), colour("--canvas"));
  }
  if ($("forces").checked) forces(f);
  if ($("segments").checked) bends(f);
  const marked = hovered >= 0 ? hovered : chosen;
  if (marked >= 0) mark(f, view.segments[marked]);
}
function discs(f, members, fill, edge) {
  if (!members.length) return;
  ink.beginPath();
  for (const disc of members) {
    const cx = f.X(x(disc)), cy = f.Y(y(disc)), r = view.radius[disc] * f.scale;
    ink.moveTo(cx + r, cy); ink.arc(cx, cy, r, 0, 6.2832);
  }
  ink.fillStyle = fill; ink.fill();
  ink.strokeStyle = edge; ink.lineWidth = Math.min(1, meanRadius(f) / 4); ink.stroke();
}
function forces(f) { // lines of like width are drawn at once
  const bins = new Map(), full = 0.55 * meanRadius(f) * view.force_unit_N / view.full_width_force_N; // px a level
  for (let pair = 0; pair < view.pairs; pair++) {
    const width = view.force[step * view.pairs + pair] * full;
    if (width < 0.06) continue;
    const bin = Math.round(width * 3);
    if (!bins.has(bin)) bins.set(bin, []);
    bins.get(bin).push(pair);
  }
  ink.strokeStyle = colour("--force");
  for (const [bin, pairs] of bins) {
    ink.lineWidth = Math.max(bin / 3, 0.12);
    ink.beginPath();
    for (const pair of pairs) {
      const one = view.contacts[2 * pair], other = view.contacts[2 * pair + 1];
      const [dx, dy] = other < 0 ? WALLS[other] : [0, 0];
      ink.moveTo(f.X(x(one)), f.Y(y(one)));
      if (other < 0) ink.lineTo(f.X(x(one) + dx * view.radius[one]), f.Y(y(one) + dy * view.radius[one]));
      else ink.lineTo(f.X(x(other)), f.Y(y(other)));
    }
    ink.stroke();
  }
}
function trace(f, particles) {
  ink.beginPath();
  particles.forEach((disc, i) => ink[i ? "lineTo" : "moveTo"](f.X(x(disc)), f.Y(y(disc))));
}
function bends(f) {
  ink.strokeStyle = colour("--ink"); ink.lineWidth = Math.max(0.8, Math.min(3, meanRadius(f) / 8));
  for (const segment of view.segments) { trace(f, segment.particles); ink.stroke(); }
  if (meanRadius(f) < 15) return; // no room for the class within a disc
  ink.font = `600 ${Math.min(18, 0.8 * meanRadius(f))}px system-ui, sans-serif`;
  ink.textAlign = "center"; ink.textBaseline = "middle"; ink.lineWidth = 3;
  for (const segment of view.segments) {
    const at = [f.X(x(segment.particles[1])), f.Y(y(segment.particles[1]))];
    ink.strokeStyle = colour("--canvas"); ink.strokeText(segment.class || "–", ...at);
    ink.fillStyle = colour("--ink"); ink.fillText(segment.class || "–", ...at);
  }
}
function mark(f, segment) {
  for (const [name, width] of [["--canvas", 5], ["--ink", 2.2]]) {
    ink.strokeStyle = colour(name); ink.lineWidth = width;
    for (const disc of segment.particles) {
      ink.beginPath(); ink.arc(f.X(x(disc)), f.Y(y(disc)), view.radius[disc] * f.scale + 1.5, 0, 6.2832); ink.stroke();
    }
    trace(f, segment.particles); ink.stroke();
  }
  ink.setLineDash([4, 4]); ink.lineWidth = 1.4; // the line 1-3 from which the angle is taken
  trace(f, [segment.particles[0], segment.particles[2]]); ink.stroke(); ink.setLineDash([]);
}
function redraw() {
  if (!waiting) { waiting = true; requestAnimationFrame(draw); }
}

// ---- numbers
const number = value => value === null ? "–" : String(Number(value.toPrecision(3))).replace("-", "−");
function element(name, text = "", attributes = {}) {
  const made = document.createElement(name);
  made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}
function value(measure, segment, at = step) {
  const row = view.measures[measure][at];
  return segment >= 0 ? row[segment] : row.reduce((sum, one) => sum + one, 0) / row.length;
}
function tell() {
  const shown = hovered >= 0 ? hovered : chosen, facts = $("facts"), segment = view.segments[shown];
  facts.replaceChildren();
  if (!view.segments.length) { facts.append(element("p", "No segment buckles in this drop.")); chart(-1); return; }
  const title = element("h3", segment ? `Segment ${segment.segment}` : `All ${view.segments.length} buckled segments, mean`);
  facts.dataset.segment = segment ? segment.segment : "";
  facts.append(title);
  if (segment) {
    const chip = element("p", segment.class ? `class ${segment.class}: ${segment.order}` : segment.order, { class: "chip" });
    chip.dataset.class = segment.class;
    facts.append(chip);
  }
  const list = element("dl");
  for (const [name, words, unit] of MEASURES)
    list.append(element("dt", words),
      element("dd", number(value(name, shown)) + (unit === "°" ? unit : unit && " " + unit), { "data-measure": name }));
  if (segment) {
    list.append(element("dt", "discs 1, 2, 3"), element("dd", segment.particles.join(", "), { "data-measure": "particles" }));
    list.append(element("dt", "force chain"),
      element("dd", `no. ${segment.chain}, ${segment.chain_length} discs`, { "data-measure": "chain" }));
  }
  facts.append(list);
  chart(shown);
}
function now() {
  const ratio = view.stress_ratio ? `, stress ratio ${view.stress_ratio[step].toFixed(3)}` : "";
  $("now").textContent = `increment ${view.steps[step]} of ${view.increments}, axial strain ${view.strain[step].toFixed(5)}${ratio}`;
  $("step").value = step;
  $("step").setAttribute("aria-valuetext", $("now").textContent);
}
function say() { // what a screen reader is told after a key
  const segment = view.segments[chosen];
  $("said").textContent = (segment ? `Segment ${segment.segment}, ${segment.order}: ` +
    MEASURES.slice(0, 2).map(([name, words, unit]) => `${words} ${number(value(name, chosen))} ${unit === "°" ? "degrees" : "newton"}`)
      .join(", ") + ". " : "") + $("now").textContent;
}

// ---- force against angle, of the segment and of the model
function svg(name, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}
function round(value) { // up to 1, 2, 2.5 or 5 times a power of ten
  const ten = 10 ** Math.floor(Math.log10(value));
  return ten * [1, 2, 2.5, 5, 10].find(one => one * ten >= value * 0.999);
}
function chart(shown) {
  const board = $("chart"), W = 320, H = 210, left = 40, right = 10, top = 16, bottom = 34;
  board.replaceChildren();
  if (!view.segments.length) return;
  const angle = view.measures.buckling_angle_deg, force = view.measures.axial_force_N;
  const most = rows => Math.max(...rows.flat());
  const xStep = round(most(angle) / 4), xMax = xStep * Math.ceil(most(angle) / xStep);
  const yMost = Math.max(most(force), ...(view.model ? view.model.axial_force_N : [])), yStep = round(yMost / 4);
  const yMax = yStep * Math.ceil(yMost / yStep);
  const X = value => left + (W - left - right) * value / xMax, Y = value => H - bottom - (H - top - bottom) * value / yMax;
  const line = (xs, ys) => xs.map((one, i) => [one, ys[i]]).filter(([one, other]) => one <= xMax && other >= 0)
    .map(([one, other], i) => `${i ? "L" : "M"}${X(one).toFixed(1)} ${Y(other).toFixed(1)}`).join("");
  for (let i = 0; i * xStep <= xMax; i++)
    board.append(svg("text", { x: X(i * xStep), y: H - bottom + 14, "text-anchor": "middle" }, number(i * xStep)));
  for (let i = 0; i * yStep <= yMax * 1.001; i++) {
    board.append(svg("text", { x: left - 6, y: Y(i * yStep) + 4, "text-anchor": "end" }, number(i * yStep)));
    board.append(svg("path", { class: "grid", d: `M${left} ${Y(i * yStep)}H${W - right}` }));
  }
  board.append(svg("text", { x: W - right, y: H - 4, "text-anchor": "end" }, "buckling angle [deg]"));
  board.append(svg("text", { x: 2, y: 10 }, "axial force [N]"));
  view.segments.forEach((_, i) => board.append(svg("path", { class: "other", d: line(angle.map(row => row[i]), force.map(row => row[i])) })));
  if (view.model) board.append(svg("path", { class: "model", d: line(view.model.angle_deg, view.model.axial_force_N) }));
  const at = view.steps.map((_, i) => [value("buckling_angle_deg", shown, i), value("axial_force_N", shown, i)]);
  board.append(svg("path", { class: "path", d: line(at.map(one => one[0]), at.map(one => one[1])) }));
  board.append(svg("circle", { class: "now", r: 4.5, cx: X(at[step][0]).toFixed(1), cy: Y(at[step][1]).toFixed(1) }));
}

// ---- what the reader does
function go(to) {
  step = Math.min(Math.max(to, 0), view.steps.length - 1);
  now(); tell(); redraw();
}
function stop() {
  clearInterval(timer); timer = 0;
  $("play").classList.remove("on"); $("play").setAttribute("aria-label", "Play");
}
function play() {
  if (timer) return stop();
  if (step === view.steps.length - 1) go(0);
  $("play").classList.add("on"); $("play").setAttribute("aria-label", "Pause");
  timer = setInterval(() => { if (step === view.steps.length - 1) stop(); else go(step + 1); }, FRAME_MS);
}
function choose(segment) {
  chosen = segment; hovered = -1;
  tell(); redraw();
}
function walk(by) {
  const count = view.segments.length;
  if (count) choose(chosen < 0 ? (by > 0 ? 0 : count - 1) : (chosen + by + count) % count);
}
function zoomTo(wanted, at = null) { // `at`, a place on the canvas, stays where it is
  const before = frame(), place = at && [centre[0] + (at[0] - before.width / 2) / before.scale,
    centre[1] - (at[1] - before.height / 2) / before.scale];
  zoom = Math.min(Math.max(wanted, 1), MAX_ZOOM);
  if (zoom === 1) centre = [view.size[0] / 2, view.size[1] / 2];
  else if (place) {
    const after = frame();
    centre = [place[0] - (at[0] - after.width / 2) / after.scale, place[1] + (at[1] - after.height / 2) / after.scale];
  } else if (chosen >= 0) centre = [x(view.segments[chosen].particles[1]), y(view.segments[chosen].particles[1])];
  canvas.classList.toggle("zoomed", zoom > 1);
  redraw();
}
function nearest(at, reach) {
  if (!$("segments").checked) return -1;
  const f = frame();
  let found = -1, best = reach;
  view.segments.forEach((segment, i) => {
    for (const disc of segment.particles) {
      const away = Math.hypot(at[0] - f.X(x(disc)), at[1] - f.Y(y(disc))) - view.radius[disc] * f.scale;
      // discs may belong to two segments: the one whose middle is nearer
      const middle = Math.hypot(at[0] - f.X(x(segment.particles[1])), at[1] - f.Y(y(segment.particles[1])));
      const rank = Math.max(away, 0) + 1e-3 * middle;
      if (away < reach && rank < best) { best = rank; found = i; }
    }
  });
  return found;
}
const KEYS = {
  ArrowLeft: () => go(step - 1), ArrowRight: () => go(step + 1), Home: () => go(0), End: () => go(view.steps.length - 1),
  ArrowUp: () => walk(-1), ArrowDown: () => walk(1), " ": play, Escape: () => choose(-1),
  "+": () => zoomTo(1.5 * zoom), "=": () => zoomTo(1.5 * zoom), "-": () => zoomTo(zoom / 1.5), 0: () => zoomTo(1) };
canvas.addEventListener("keydown", event => {
  const act = KEYS[event.key];
  if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  if (event.key !== " ") stop();
  act(); say();
});
const pointers = new Map();
let dragged = false, pinch = 0;
const place = event => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
canvas.addEventListener("pointerdown", event => {
  pointers.set(event.pointerId, place(event)); dragged = false; pinch = 0;
  if (zoom > 1 || pointers.size > 1) canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener("pointermove", event => {
  const at = place(event), before = pointers.get(event.pointerId);
  if (before) {
    pointers.set(event.pointerId, at);
    if (pointers.size === 2) {
      const [one, other] = [...pointers.values()], apart = Math.hypot(one[0] - other[0], one[1] - other[1]);
      if (pinch) zoomTo(zoom * apart / pinch, [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2]);
      pinch = apart; dragged = true;
    } else if (zoom > 1 && (dragged || Math.hypot(at[0] - before[0], at[1] - before[1]) > 1)) {
      const { scale } = frame();
      centre = [centre[0] - (at[0] - before[0]) / scale, centre[1] + (at[1] - before[1]) / scale];
      dragged = true; redraw();
    }
  } else if (event.pointerType === "mouse") {
    const found = nearest(at, MOUSE_PX);
    if (found !== hovered) { hovered = found; canvas.style.cursor = found >= 0 ? "pointer" : ""; tell(); redraw(); }
  }
});
for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, event => {
  pointers.delete(event.pointerId);
  if (name === "pointerup" && !dragged) choose(nearest(place(event), event.pointerType === "mouse" ? MOUSE_PX : TOUCH_PX));
});
canvas.addEventListener("pointerleave", () => { if (hovered >= 0) { hovered = -1; tell(); redraw(); } });
canvas.addEventListener("wheel", event => { // the page scrolls, unless the reader asks for the picture
  if (!event.ctrlKey && !event.metaKey) return;
  event.preventDefault(); zoomTo(zoom * Math.exp(-event.deltaY / 200), place(event));
}, { passive: false });
canvas.addEventListener("dblclick", event => zoomTo(2 * zoom, place(event)));
$("in").addEventListener("click", () => zoomTo(1.5 * zoom));
$("out").addEventListener("click", () => zoomTo(zoom / 1.5));
$("whole").addEventListener("click", () => zoomTo(1));
$("first").addEventListener("click", () => { stop(); go(0); });
$("back").addEventListener("click", () => { stop(); go(step - 1); });
$("next").addEventListener("click", () => { stop(); go(step + 1); });
$("last").addEventListener("click", () => { stop(); go(view.steps.length - 1); });
$("play").addEventListener("click", play);
$("step").addEventListener("input", event => { stop(); go(Number(event.target.value)); });
for (const name of ["discs", "forces", "chains", "segments", "then"]) $(name).addEventListener("change", redraw);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
new ResizeObserver(redraw).observe(canvas);

async function show(id) {
  stop();
  view = await load(id);
  step = 0; hovered = chosen = -1; zoom = 1; centre = [view.size[0] / 2, view.size[1] / 2];
  canvas.style.aspectRatio = `${view.size[0]} / ${view.size[1]}`;
  $("step").max = view.steps.length - 1;
  $("name").textContent = `${view.case}, ${view.run}, drop ${view.drop}`;
  document.querySelectorAll("[data-class-count]").forEach(mark => {
    const count = view.segments.filter(one => one.class === Number(mark.dataset.classCount)).length;
    mark.querySelector("b").textContent = count;
    mark.hidden = count === 0;
  });
  document.querySelectorAll("[data-view]").forEach(table => { table.hidden = table.dataset.view !== id; });
  go(0);
  root.dataset.ready = id;
}
$("drop").addEventListener("change", event => show(event.target.value));
show($("drop").value).then(() => { // not before it is known to work
  root.hidden = false;
  document.documentElement.classList.add("explorable");
});
})();
