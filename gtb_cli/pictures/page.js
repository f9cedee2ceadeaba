// Shows what is in #data: meshes with normals at their vertices, interpolated and evaluated at each pixel.

const MODES = { shaded: "Shaded", mean: "Mean curvature", gaussian: "Gaussian curvature", zebra: "Zebra stripes", isophotes: "Isophotes" };
const SWITCHES = {
  patches: ["c", "Patch colours"], net: ["n", "Control net"], knots: ["k", "Knots"], edges: ["e", "Edges of patches"],
  open: ["o", "Open edges"], folds: ["p", "Folds"], axes: ["a", "Axes"],
};
const COLOURS = ["#8fbcd9", "#f2b48a", "#86cdb5", "#e3b5ce", "#f1cf85", "#aedbf3", "#c9c9c9", "#e9e39a"];
const STOPS = ["#7f3b08", "#e08214", "#f7f7f7", "#8073ac", "#2d004b"];
const rgb = hex => [1, 3, 5].map(k => parseInt(hex.slice(k, k + 2), 16) / 255);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

const state = { mode: "shaded", azimuth: -60, elevation: 30, zoom: 1, panX: 0, panY: 0, frame: 0, limit: 0,
  patches: true, net: false, knots: false, edges: true, open: true, folds: true, axes: true };
let scene = null, version = 0, playing = false, wanted = false, fitted = false;

// ---- data

function read(data) {
  const frames = data.frames.map(f => ({ label: f.label, positions: decoded(f.positions, Float32Array),
    normals: f.normals && decoded(f.normals, Float32Array), net: f.net && decoded(f.net, Float32Array) }));
  const lines = {};
  for (const [name, text] of Object.entries(data.lines)) lines[name] = decoded(text, Uint32Array);
  const scalars = {};
  for (const [name, s] of Object.entries(data.scalars)) scalars[name] = { values: decoded(s.values, Float32Array), low: s.low, high: s.high };
  return { ...data, frames, lines, scalars, cells: decoded(data.cells, Uint32Array), spots: decoded(data.knots.points, Float32Array) };
}

// ---- shaders

const HEAD = `#version 300 es
precision highp float;
uniform mat3 turn; uniform vec2 grow, move; uniform float share;
vec4 place(vec3 a, vec3 b) { vec3 p = turn * mix(a, b, share); return vec4(p.xy * grow + move, -p.z * 0.5, 1.0); }
`;
const SURFACE_VERTEX = HEAD + `
layout(location=0) in vec3 p0; layout(location=1) in vec3 p1; layout(location=2) in vec3 n0; layout(location=3) in vec3 n1;
layout(location=4) in float scalar;
out vec3 normal; out float value;
void main() { gl_Position = place(p0, p1); normal = turn * mix(n0, n1, share); value = scalar; }`;
const SURFACE_PIXEL = `#version 300 es
precision highp float;
uniform int mode; uniform vec3 colour; uniform vec3 stops[5]; uniform bool lit;
in vec3 normal; in float value; out vec4 pixel;
vec3 scaled(float x) {
  x = clamp(x, 0.0, 1.0) * 4.0;
  return x < 1.0 ? mix(stops[0], stops[1], x) : x < 2.0 ? mix(stops[1], stops[2], x - 1.0)
       : x < 3.0 ? mix(stops[2], stops[3], x - 2.0) : mix(stops[3], stops[4], x - 3.0);
}
float stripes(float x) { float d = max(fwidth(x), 1e-6), f = abs(fract(x) - 0.5) - 0.25; return clamp(0.5 + f / d, 0.0, 1.0); }
void main() {
  vec3 n = normalize(normal);
  bool away = n.z < 0.0;
  if (away) n = -n;
  vec3 light = normalize(vec3(-0.45, 0.55, 0.7)), half_way = normalize(light + vec3(0, 0, 1));
  float bright = lit ? (0.5 + 0.5 * max(dot(n, light), 0.0)) * (away ? 0.78 : 1.0) : 1.0;
  float shine = lit && !away ? 0.2 * pow(max(dot(n, half_way), 0.0), 28.0) : 0.0;
  vec3 c = colour;
  if (mode == 1) c = scaled(value);
  if (mode == 2) {                                // the reflection of a room with parallel lamps on its ceiling
    vec3 r = reflect(vec3(0, 0, -1), n);
    c = mix(vec3(0.07), vec3(0.97), stripes(4.0 * acos(clamp(r.y, -1.0, 1.0)) / 1.5708));
    bright = 0.8 + 0.2 * bright; shine = 0.0;
  }
  if (mode == 3) {                                // curves on which the surface is equally bright
    c = mix(vec3(0.15), vec3(0.97), stripes(9.0 * dot(n, light)));
    bright = 0.8 + 0.2 * bright; shine = 0.0;
  }
  pixel = vec4(c * bright + shine, 1.0);
}`;
const LINE_VERTEX = HEAD + `
layout(location=0) in vec3 a0; layout(location=1) in vec3 b0; layout(location=2) in vec3 a1; layout(location=3) in vec3 b1;
uniform vec2 window; uniform float width, nearer, cap;
void main() {
  vec4 a = place(a0, a1), b = place(b0, b1);
  vec2 along = (b.xy - a.xy) * window;
  float length_ = length(along);
  along = length_ > 1e-6 ? along / length_ : vec2(1, 0);
  int corner = gl_VertexID;
  float side = (corner & 1) == 0 ? -1.0 : 1.0;
  bool end = corner > 1;
  vec4 p = end ? b : a;
  p.xy += (vec2(-along.y, along.x) * side + along * (end ? cap : -cap)) * width / window;
  p.z -= nearer;
  gl_Position = p;
}`;
const POINT_VERTEX = HEAD + `
layout(location=0) in vec3 a0; layout(location=1) in vec3 a1;
uniform float size, nearer;
void main() { gl_Position = place(a0, a1); gl_Position.z -= nearer; gl_PointSize = size; }`;
const FLAT_PIXEL = `#version 300 es
precision highp float;
uniform vec4 paint, rim; uniform bool round_;
out vec4 pixel;
void main() {
  pixel = paint;
  if (round_) { float r = length(gl_PointCoord - 0.5) * 2.0; if (r > 1.0) discard; if (r > 0.62) pixel = rim; }
}`;

let surfaces, strokes, dots, buffers;

function equip() {   // also after a graphics card has gone and come back, with all that it held lost
  surfaces = program(SURFACE_VERTEX, SURFACE_PIXEL);
  strokes = program(LINE_VERTEX, FLAT_PIXEL);
  dots = program(POINT_VERTEX, FLAT_PIXEL);
  buffers = {};
}

function upload(name, target, values) {   // to the card, if it has not these values already
  const found = buffers[name] ??= { buffer: gl.createBuffer(), values: null };
  gl.bindBuffer(target, found.buffer);
  if (found.values !== values) { gl.bufferData(target, values, gl.DYNAMIC_DRAW); found.values = values; }
}

function attribute(index, name, values, size, each = 0) {
  upload(name, gl.ARRAY_BUFFER, values);
  gl.enableVertexAttribArray(index);
  gl.vertexAttribPointer(index, size, gl.FLOAT, false, 0, 0);
  gl.vertexAttribDivisor(index, each);
}

function segments(name, attributeNames, pairs) {   // two attributes of one interleaved buffer: both ends of each segment
  upload(name, gl.ARRAY_BUFFER, pairs);
  attributeNames.forEach((index, k) => {
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 24, 12 * k);
    gl.vertexAttribDivisor(index, 1);
  });
}

// ---- drawing

function frameNow() {
  const last = scene.frames.length - 1, first = clamp(Math.floor(state.frame), 0, Math.max(last - 1, 0));
  return { now: scene.frames[first], next: scene.frames[Math.min(first + 1, last)], share: clamp(state.frame - first, 0, 1), first };
}

function view() {
  const w = canvas.width, h = canvas.height, scale = 1.75 * state.zoom * Math.min(w, h);
  return { turn: axes(), grow: [scale / w, scale / h], move: [2 * state.panX / canvas.clientWidth, 2 * state.panY / canvas.clientHeight] };
}

function prepare(shader, share) {
  shader.use();
  const { turn, grow, move } = view();
  gl.uniformMatrix3fv(shader.at("turn"), true, turn.flat());
  gl.uniform2fv(shader.at("grow"), grow);
  gl.uniform2fv(shader.at("move"), move);
  gl.uniform1f(shader.at("share"), share);
}

const gathered = new Map();   // segments of a frame, made once
function gather(name, frame, positions, pairs) {
  const key = `${version}/${name}/${frame}`;
  if (!gathered.has(key)) {
    const made = new Float32Array(pairs.length * 3);
    pairs.forEach((v, k) => made.set(positions.subarray(3 * v, 3 * v + 3), 3 * k));
    gathered.set(key, made);
  }
  return gathered.get(key);
}

function stroke(name, share, first, second, paint, width, hidden) {
  if (!first.length) return;
  prepare(strokes, share);
  gl.uniform2f(strokes.at("window"), canvas.width / 2, canvas.height / 2);
  gl.uniform1f(strokes.at("width"), width * (window.devicePixelRatio || 1) / 2);
  gl.uniform1f(strokes.at("nearer"), 0.0015);
  gl.uniform1i(strokes.at("round_"), 0);
  segments(name + "0", [0, 1], first);
  segments(name + "1", [2, 3], second);
  for (const [test, strength] of [[gl.GREATER, hidden], [gl.LEQUAL, 1]]) {
    if (!strength) continue;
    gl.depthFunc(test);
    gl.uniform1f(strokes.at("cap"), test === gl.GREATER ? 0 : 0.5);   // what shines through must not cover itself twice
    gl.uniform4f(strokes.at("paint"), ...paint, strength);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, first.length / 6);
  }
  gl.depthFunc(gl.LEQUAL);
}

function dotted(name, share, first, second, paint, rim, size) {
  if (!first.length) return;
  prepare(dots, share);
  gl.uniform1f(dots.at("size"), size * (window.devicePixelRatio || 1));
  gl.uniform1f(dots.at("nearer"), 0.003);
  gl.uniform1i(dots.at("round_"), 1);
  attribute(0, name + "0", first, 3);
  attribute(1, name + "1", second, 3);
  for (const k of [2, 3, 4]) gl.disableVertexAttribArray(k);
  for (const [test, strength] of [[gl.GREATER, 0.15], [gl.LEQUAL, 1]]) {
    gl.depthFunc(test);
    gl.uniform4f(dots.at("paint"), ...paint, strength);
    gl.uniform4f(dots.at("rim"), ...rim, strength);
    gl.drawArrays(gl.POINTS, 0, first.length / 3);
  }
  gl.depthFunc(gl.LEQUAL);
}

function fill(picking) {
  if (scene.curve) return;
  const { now, next, share } = frameNow();
  prepare(surfaces, share);
  const scalar = scene.scalars[state.mode];
  const mode = picking ? 0 : scalar ? 1 : state.mode === "zebra" ? 2 : state.mode === "isophotes" ? 3 : 0;
  gl.uniform1i(surfaces.at("mode"), mode);
  gl.uniform1i(surfaces.at("lit"), picking ? 0 : 1);
  gl.uniform3fv(surfaces.at("stops"), STOPS.flatMap(rgb));
  attribute(0, "p0", now.positions, 3); attribute(1, "p1", next.positions, 3);
  attribute(2, "n0", now.normals, 3); attribute(3, "n1", next.normals, 3);
  if (mode === 1) attribute(4, "s-" + state.mode, scalar.shown, 1);
  else { gl.disableVertexAttribArray(4); gl.vertexAttrib1f(4, 0); }
  gl.enable(gl.POLYGON_OFFSET_FILL);
  gl.polygonOffset(1, 1);
  upload("cells", gl.ELEMENT_ARRAY_BUFFER, scene.cells);
  scene.groups.forEach(([, start, stop], k) => {
    const id = k + 1;
    gl.uniform3fv(surfaces.at("colour"), picking ? [(id & 255) / 255, (id >> 8 & 255) / 255, (id >> 16) / 255]
      : rgb(COLOURS[state.patches && scene.groups.length > 1 ? k % COLOURS.length : 0]));
    gl.drawElements(gl.TRIANGLES, 3 * (stop - start), gl.UNSIGNED_INT, 12 * start);
  });
  gl.disable(gl.POLYGON_OFFSET_FILL);
}

function draw() {
  wanted = false;
  const ratio = window.devicePixelRatio || 1;
  const w = Math.max(Math.round(canvas.clientWidth * ratio), 1), h = Math.max(Math.round(canvas.clientHeight * ratio), 1);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const dark = isDark(), ink = dark ? [0.9, 0.91, 0.92] : [0.13, 0.15, 0.17], faint = dark ? [0.45, 0.5, 0.53] : [0.62, 0.65, 0.68];
  gl.viewport(0, 0, w, h);
  gl.clearColor(...(dark ? [0.086, 0.098, 0.11] : [0.984, 0.984, 0.98]), 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.disable(gl.BLEND);
  fill(false);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthMask(false);   // lines do not hide each other: what shines through a surface would hide what is on it
  const { now, next, share, first } = frameNow();
  const moving = (name, pairs) => [gather(name, first, now.positions, pairs), gather(name, Math.min(first + 1, scene.frames.length - 1), next.positions, pairs)];
  if (scene.curve) stroke("curve", share, ...moving("curve", scene.cells), dark ? [0.34, 0.71, 0.91] : [0, 0.45, 0.7], 3.6, 0);
  if (state.edges) stroke("border", share, ...moving("border", scene.lines.border), scene.curve ? ink : [0.1, 0.12, 0.14], 1.6, 0.3);
  if (state.folds) stroke("folds", share, ...moving("folds", scene.lines.folds), [0.9, 0.62, 0], 4, 0.3);
  if (state.open) stroke("open", share, ...moving("open", scene.lines.open), [0.84, 0, 0.11], 3.6, 0.35);
  if (state.net && now.net) {
    const ends = f => gather("net", f, scene.frames[f].net, scene.lines.net), other = Math.min(first + 1, scene.frames.length - 1);
    stroke("net", share, ends(first), ends(other), ink, 1.4, 0.25);
    dotted("control", share, now.net, next.net, dark ? [0.1, 0.11, 0.12] : [1, 1, 1], ink, 8);
  }
  if (state.knots) dotted("knots", 0, scene.spots, scene.spots, dark ? [0.34, 0.71, 0.91] : [0, 0.45, 0.7], [1, 1, 1], 11);
  mark(faint);
  gl.depthMask(true);
}

function project(x, y, z) {
  const { turn, grow, move } = view(), p = turn.map(r => r[0] * x + r[1] * y + r[2] * z);
  return [(1 + p[0] * grow[0] + move[0]) / 2 * canvas.clientWidth, (1 - p[1] * grow[1] - move[1]) / 2 * canvas.clientHeight];
}

function mark(paint) {
  const { low, high, texts } = scene.box, marks = $("marks");
  marks.hidden = !state.axes;
  if (!state.axes) return;
  const [start, ...ends] = corners(), pairs = ends.flatMap(end => [...start, ...end]);
  stroke("axes", 0, new Float32Array(pairs), new Float32Array(pairs), paint, 1.5, 0.6);
  const places = [...ends.map((end, k) => [end, texts[k]]), [start, texts[3]]].filter(([, text]) => text);
  while (marks.children.length < places.length) marks.append(document.createElement("span"));
  const [cx, cy] = project(...low.map((x, k) => (x + high[k]) / 2));
  places.forEach(([place, text], k) => {
    const [x, y] = project(...place), far = Math.hypot(x - cx, y - cy) || 1, span = marks.children[k];
    span.textContent = text;
    span.style.left = `${x + 22 * (x - cx) / far}px`;
    span.style.top = `${y + 14 * (y - cy) / far}px`;
  });
}

const redraw = () => { if (scene && !wanted) { wanted = true; requestAnimationFrame(draw); } };
const isDark = () => (document.documentElement.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";

// ---- what is under the pointer

function under(x, y) {
  const ratio = canvas.width / canvas.clientWidth, px = Math.round(x * ratio), py = canvas.height - 1 - Math.round(y * ratio);
  const close = [];
  const look = (points, name) => { for (let k = 0; k < points.length; k += 3) {
    const [a, b] = project(points[k], points[k + 1], points[k + 2]);
    const d = Math.hypot(a - x, b - y);
    if (d < 9) close.push([d, name(k / 3)]);
  } };
  const frame = frameNow();
  if (state.net && frame.now.net && frame.share === 0) look(frame.now.net, k => scene.netNames[k] || "");
  if (state.knots) look(scene.spots, k => scene.knots.names[k]);
  if (close.length) return close.sort((a, b) => a[0] - b[0])[0][1];
  if (scene.curve) return "";
  gl.enable(gl.SCISSOR_TEST);
  gl.scissor(px, py, 1, 1);
  gl.disable(gl.BLEND);
  gl.clearColor(0, 0, 0, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  fill(true);
  const pixel = new Uint8Array(4);
  gl.readPixels(px, py, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  gl.disable(gl.SCISSOR_TEST);
  draw();
  const id = pixel[0] + 256 * pixel[1] + 65536 * pixel[2];
  return id && scene.groups[id - 1] ? scene.groups[id - 1][0] : "";
}

function point(event) {
  const name = under(event.offsetX, event.offsetY), tip = $("tip");
  tip.hidden = !name;
  tip.textContent = name;
  tip.style.left = `${Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 4)}px`;
  tip.style.top = `${Math.min(event.clientY + 14, innerHeight - tip.offsetHeight - 4)}px`;
}

// ---- controls

function set(changes) {
  if (!scene) return;
  if ("zoom" in changes || "panX" in changes) fitted = false;
  Object.assign(state, changes);
  state.elevation = clamp(state.elevation, -90, 90);
  state.zoom = clamp(state.zoom, 0.05, 400);
  state.frame = clamp(state.frame, 0, scene.frames.length - 1);
  show();
  redraw();
}

function show() {
  for (const name of Object.keys(SWITCHES)) $(name).checked = state[name];
  $("mode").value = state.mode;
  const scalar = scene.scalars[state.mode], { now, next, share } = frameNow();
  $("scale").hidden = !scalar;
  if (scalar) {
    $("scale-name").textContent = MODES[state.mode];
    $("scale-high").textContent = scalar.high.toPrecision(3);
    $("scale-low").textContent = scalar.low.toPrecision(3);
  }
  $("slider").value = state.frame;
  $("value").textContent = share === 0 ? now.label : share === 1 ? next.label : `${now.label} → ${next.label}`;
  $("run").textContent = playing ? "❚❚" : "▶";
}

function corners() {   // of the box that the axes are edges of: where they start, and their ends
  const { low, high } = scene.box;
  return [low, ...low.map((_, k) => low.map((x, j) => j === k ? high[j] : x))];
}

// Let all that there is fill the window, beside the panel where that leaves room enough.
function fit() {
  const right = axes()[0], up = axes()[1], ends = [Infinity, -Infinity, Infinity, -Infinity];
  const clouds = scene.frames.flatMap(f => [f.positions, ...(state.net && f.net ? [f.net] : [])]);
  if (state.axes) clouds.push(corners().flat());
  for (const cloud of clouds) for (let k = 0; k < cloud.length; k += 3) {
    const x = right[0] * cloud[k] + right[1] * cloud[k + 1] + right[2] * cloud[k + 2];
    const y = up[0] * cloud[k] + up[1] * cloud[k + 1] + up[2] * cloud[k + 2];
    ends[0] = Math.min(ends[0], x); ends[1] = Math.max(ends[1], x); ends[2] = Math.min(ends[2], y); ends[3] = Math.max(ends[3], y);
  }
  const w = canvas.clientWidth, h = canvas.clientHeight, panel = $("panel").getBoundingClientRect();
  const left = $("panel").open && w > 2.4 * panel.right ? panel.right : 0, bar = document.querySelector("#limits, #play:not([hidden])");
  const below = bar ? bar.offsetHeight + 14 : 0;
  const right_ = $("scale").hidden || w < 500 ? 0 : $("scale").offsetWidth + 12;
  const unit = 1.75 / 2 * Math.min(w, h), margin = Math.min(60, 0.12 * Math.min(w, h));
  const beside = state.axes ? Math.min(75, 0.2 * w) : margin;   // where the axes' numbers are
  const zoom = Math.min((w - left - right_ - 2 * beside) / Math.max(ends[1] - ends[0], 1e-6), (h - below - 2 * margin) / Math.max(ends[3] - ends[2], 1e-6)) / unit;
  set({ zoom, panX: (left - right_) / 2 - (ends[0] + ends[1]) / 2 * unit * zoom, panY: below / 2 - (ends[2] + ends[3]) / 2 * unit * zoom });
  fitted = true;
}

function play(time, before) {
  if (!playing) return;
  const last = scene.frames.length - 1, on = state.frame + (before ? (time - before) / 1000 : 0);
  set({ frame: on >= last + 0.7 ? 0 : on });
  state.frame = Math.min(on >= last + 0.7 ? 0 : on, last + 0.7);
  requestAnimationFrame(t => play(t, time));
}

function toggle() { playing = !playing; if (playing && state.frame >= scene.frames.length - 1) state.frame = 0; show(); if (playing) requestAnimationFrame(t => play(t)); }

function zoomAt(left, top, factor, panX = 0, panY = 0) {   // what is at a place stays there, and moves by the pan
  const x = left - canvas.clientWidth / 2, y = canvas.clientHeight / 2 - top;
  set({ zoom: state.zoom * factor, panX: x + (state.panX - x) * factor + panX, panY: y + (state.panY - y) * factor + panY });
}

const fingers = new Map();
canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, e); $("tip").hidden = true; canvas.focus(); });
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, e => fingers.delete(e.pointerId));
canvas.addEventListener("pointermove", e => {
  const old = fingers.get(e.pointerId);
  if (!old) { if (e.pointerType !== "touch") point(e); return; }
  const dx = e.clientX - old.clientX, dy = e.clientY - old.clientY;
  if (fingers.size === 2) {
    const other = [...fingers.values()].find(f => f.pointerId !== e.pointerId);
    const was = Math.hypot(old.clientX - other.clientX, old.clientY - other.clientY);
    const is = Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
    zoomAt((old.offsetX + other.offsetX) / 2, (old.offsetY + other.offsetY) / 2, is / Math.max(was, 1), dx / 2, -dy / 2);
  } else if (e.shiftKey || old.buttons & 6) set({ panX: state.panX + dx, panY: state.panY - dy });
  else set({ azimuth: state.azimuth - dx * 0.4, elevation: state.elevation + dy * 0.4 });
  fingers.set(e.pointerId, e);
});
canvas.addEventListener("pointerleave", () => { $("tip").hidden = true; });
canvas.addEventListener("contextmenu", e => e.preventDefault());
canvas.addEventListener("dblclick", fit);
canvas.addEventListener("wheel", e => {
  e.preventDefault();
  zoomAt(e.offsetX, e.offsetY, Math.exp(-clamp(e.deltaY, -200, 200) * 0.002));
}, { passive: false });

addEventListener("keydown", e => {
  if (e.ctrlKey || e.metaKey || e.altKey || ["SELECT", "SUMMARY"].includes(e.target.tagName)) return;
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  if (moves[e.key] && e.target.id !== "slider") {
    const [x, y] = moves[e.key];
    set(e.shiftKey ? { panX: state.panX + 20 * x, panY: state.panY + 20 * y } : { azimuth: state.azimuth - 5 * x, elevation: state.elevation - 5 * y });
  } else if (e.key === "+" || e.key === "=") set({ zoom: state.zoom * 1.2 });
  else if (e.key === "-") set({ zoom: state.zoom / 1.2 });
  else if (e.key === "f") fit();
  else if (e.key === "d") $("theme").click();
  else if (e.key === " ") {
    if (scene.frames.length < 2 || e.target.tagName === "BUTTON" || e.target.type === "checkbox") return;
    toggle();
  }
  else if (e.key === "[") set({ frame: Math.ceil(state.frame) - 1 });
  else if (e.key === "]") set({ frame: Math.floor(state.frame) + 1 });
  else if ("12345".includes(e.key) && modes()[e.key - 1]) set({ mode: modes()[e.key - 1] });
  else {
    const name = Object.keys(SWITCHES).find(key => SWITCHES[key][0] === e.key);
    if (!name) return;
    set({ [name]: !state[name] });
  }
  e.preventDefault();
});
$("fit").onclick = fit;
$("theme").onclick = () => { document.documentElement.dataset.theme = isDark() ? "light" : "dark"; redraw(); };
$("mode").onchange = e => set({ mode: e.target.value });
$("slider").oninput = e => { playing = false; set({ frame: Number(e.target.value) }); };
$("run").onclick = toggle;
addEventListener("resize", () => fitted ? fit() : redraw());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

const modes = () => scene.curve ? ["shaded"] : Object.keys(MODES).filter(name => scene.scalars[name] || !["mean", "gaussian"].includes(name));

function present(data) {
  scene = read(data);
  version += 1;
  gathered.clear();
  for (const scalar of Object.values(scene.scalars)) scalar.shown = scalar.values.map(x => clamp((x - scalar.low) / (scalar.high - scalar.low), 0, 1));
  $("title").textContent = scene.name;
  $("facts").textContent = scene.facts;
  $("mode").replaceChildren(...modes().map(name => new Option(MODES[name], name)));
  $("mode").hidden = scene.curve;
  if (!modes().includes(state.mode)) state.mode = "shaded";
  const there = { patches: scene.groups.length > 1 && !scene.curve, net: !!scene.frames[0].net, knots: scene.spots.length > 0,
    edges: scene.lines.border.length > 0, open: scene.lines.open.length > 0,
    folds: scene.lines.folds.length > 0, axes: true };
  for (const name of Object.keys(SWITCHES)) $(name).parentElement.classList.toggle("off", !there[name]);
  $("play").hidden = scene.frames.length < 2;
  $("slider").max = scene.frames.length - 1;
  state.frame = clamp(state.frame, 0, scene.frames.length - 1);
  show();
  redraw();
}

function complain(text) { $("error").hidden = !text; $("error").textContent = text || ""; }

// While `gtb view --watch` runs, it is asked four times a second whether there is something new.
async function watch(have) {
  for (;;) {
    await new Promise(done => setTimeout(done, 250));
    let news;
    try { news = await (await fetch(`state?have=${have}`)).json(); }
    catch { complain("gtb view has ended: the page shows what it had last."); continue; }
    if (news.version === have) { if ($("error").textContent.startsWith("gtb view has ended")) complain(news.error); continue; }
    have = news.version;
    complain(news.error);
    const first = !scene;
    if (news.data) present(news.data);
    if (first && scene) fit();
  }
}

function start() {
  if (!gl) { complain("This page needs WebGL 2, which the browser does not offer."); return; }
  equip();
  canvas.addEventListener("webglcontextlost", e => e.preventDefault());   // else it does not come back
  canvas.addEventListener("webglcontextrestored", () => { equip(); redraw(); });
  for (const [name, [key, text]] of Object.entries(SWITCHES)) {
    const label = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, { type: "checkbox", id: name, onchange: () => set({ [name]: box.checked }) });
    label.title = key;
    label.append(box, text);
    $("switches").append(label);
  }
  const bar = document.querySelector("#scale canvas").getContext("2d"), ramp = bar.createLinearGradient(0, 150, 0, 0);
  STOPS.forEach((colour, k) => ramp.addColorStop(k / 4, colour));
  bar.fillStyle = ramp;
  bar.fillRect(0, 0, 1, 150);
  if (innerWidth < 560) $("panel").open = false;
  const data = JSON.parse($("data").textContent);
  if (data.plane) Object.assign(state, { azimuth: -90, elevation: 90 });
  if (data.curve) state.net = true;
  for (const [key, value] of new URLSearchParams(location.hash.slice(1)))   // #mode=zebra&azimuth=30&net=true
    if (key === "theme") document.documentElement.dataset.theme = value;
    else if (key in state) state[key] = typeof state[key] === "string" ? value : JSON.parse(value);
  if (data.frames) { present(data); if (!location.hash.includes("zoom")) fit(); }
  complain(data.error);
  if (data.watch !== undefined) watch(data.watch);
}

start();
