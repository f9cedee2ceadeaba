// Drawing what `scene` holds as `state` says: meshes with normals at their vertices, interpolated and evaluated at each pixel.

const COLOURS = ["#8fbcd9", "#f2b48a", "#86cdb5", "#e3b5ce", "#f1cf85", "#aedbf3", "#c9c9c9", "#e9e39a"];
const STOPS = ["#7f3b08", "#e08214", "#f7f7f7", "#8073ac", "#2d004b"], THIN_TO_THICK = ["#a50026", "#f46d43", "#fee090", "#abd9e9", "#4575b4"];
const rgb = hex => [1, 3, 5].map(k => parseInt(hex.slice(k, k + 2), 16) / 255);
const stops = () => state.mode === "wall" ? THIN_TO_THICK : STOPS;

// ---- shaders

const HEAD = `#version 300 es
precision highp float;
uniform mat3 turn; uniform vec2 grow, move; uniform float share; uniform vec3 shift;
out vec3 spot;
vec3 between(vec3 a, vec3 b) { return mix(a, b, share) + shift; }
vec4 place(vec3 spot) { vec3 p = turn * spot; return vec4(p.xy * grow + move, -p.z * 0.5, 1.0); }
`;
const PIXEL = `#version 300 es
precision highp float;
uniform vec4 cut;
in vec3 spot; out vec4 pixel;
`;
const SURFACE_VERTEX = HEAD + `
layout(location=0) in vec3 p0; layout(location=1) in vec3 p1; layout(location=2) in vec3 n0; layout(location=3) in vec3 n1;
layout(location=4) in float scalar;
out vec3 own; out float value;
void main() { spot = between(p0, p1); gl_Position = place(spot); own = mix(n0, n1, share); value = scalar; }`;
const SURFACE_PIXEL = PIXEL + `
uniform mat3 turn; uniform int mode; uniform vec3 colour, shift; uniform vec3 stops[5]; uniform float steep, floor_;
in vec3 own; in float value;
vec3 scaled(float x) {
  x = clamp(x, 0.0, 1.0) * 4.0;
  return x < 1.0 ? mix(stops[0], stops[1], x) : x < 2.0 ? mix(stops[1], stops[2], x - 1.0)
       : x < 3.0 ? mix(stops[2], stops[3], x - 2.0) : mix(stops[3], stops[4], x - 3.0);
}
float stripes(float x) { float d = max(fwidth(x), 1e-6), f = abs(fract(x) - 0.5) - 0.25; return clamp(0.5 + f / d, 0.0, 1.0); }
void main() {
  if (dot(cut.xyz, spot) > cut.w) discard;
  vec3 outward = normalize(own), n = turn * outward;
  bool away = n.z < 0.0;
  if (away) n = -n;
  vec3 light = normalize(vec3(-0.45, 0.55, 0.7)), half_way = normalize(light + vec3(0, 0, 1));
  float bright = (0.5 + 0.5 * max(dot(n, light), 0.0)) * (away ? 0.78 : 1.0);
  float shine = away ? 0.0 : 0.2 * pow(max(dot(n, half_way), 0.0), 28.0);
  vec3 c = colour;
  if (mode == 1) { c = scaled(value); bright = 0.6 + 0.4 * bright; shine = 0.0; }
  if (mode == 2) {                                // the reflection of a room with parallel lamps on its ceiling
    vec3 r = reflect(vec3(0, 0, -1), n);
    c = mix(vec3(0.07), vec3(0.97), stripes(4.0 * acos(clamp(r.y, -1.0, 1.0)) / 1.5708));
  }
  if (mode == 3) c = mix(vec3(0.15), vec3(0.97), stripes(9.0 * dot(n, light)));   // curves on which it is equally bright
  if (mode == 2 || mode == 3) { bright = 0.8 + 0.2 * bright; shine = 0.0; }
  if (mode == 4) {                                // what stands on the floor is none
    c = outward.z < -0.99 && spot.z - shift.z < floor_ ? vec3(0.45, 0.62, 0.5) : outward.z < -steep ? vec3(0.84, 0.16, 0.1) : vec3(0.78, 0.8, 0.82);
    bright = 0.5 + 0.5 * bright; shine = 0.0;
  }
  pixel = vec4(c * bright + shine, 1.0);
}`;
const CAP_VERTEX = HEAD + `
layout(location=0) in vec3 p0;
void main() { spot = p0; gl_Position = place(spot); }`;
const CAP_PIXEL = PIXEL + `
uniform float fine;
void main() { pixel = vec4(mod(gl_FragCoord.x + gl_FragCoord.y, 9.0 * fine) < 1.5 * fine ? vec3(0.62, 0.3, 0.2) : vec3(0.9, 0.6, 0.46), 1.0); }`;
const LINE_VERTEX = HEAD + `
layout(location=0) in vec3 a0; layout(location=1) in vec3 b0; layout(location=2) in vec3 a1; layout(location=3) in vec3 b1;
uniform vec2 window; uniform float width, nearer, cap;
void main() {
  vec3 start = between(a0, a1), stop = between(b0, b1);
  vec4 a = place(start), b = place(stop);
  vec2 along = (b.xy - a.xy) * window;
  float length_ = length(along);
  along = length_ > 1e-6 ? along / length_ : vec2(1, 0);
  int corner = gl_VertexID;
  float side = (corner & 1) == 0 ? -1.0 : 1.0;
  bool end = corner > 1;
  spot = end ? stop : start;
  vec4 p = end ? b : a;
  p.xy += (vec2(-along.y, along.x) * side + along * (end ? cap : -cap)) * width / window;
  p.z -= nearer;
  gl_Position = p;
}`;
const POINT_VERTEX = HEAD + `
layout(location=0) in vec3 a0; layout(location=1) in vec3 a1;
uniform float size, nearer;
void main() { spot = between(a0, a1); gl_Position = place(spot); gl_Position.z -= nearer; gl_PointSize = size; }`;
const FLAT_PIXEL = PIXEL + `
uniform vec4 paint, rim; uniform bool round_;
void main() {
  if (dot(cut.xyz, spot) > cut.w) discard;
  pixel = paint;
  if (round_) { float r = length(gl_PointCoord - 0.5) * 2.0; if (r > 1.0) discard; if (r > 0.62) pixel = rim; }
}`;

let surfaces, caps, strokes, dots, buffers, ratio = 1;

function equip() {   // also after a graphics card has gone and come back, with all that it held lost
  surfaces = program(SURFACE_VERTEX, SURFACE_PIXEL);
  caps = program(CAP_VERTEX, CAP_PIXEL);
  strokes = program(LINE_VERTEX, FLAT_PIXEL);
  dots = program(POINT_VERTEX, FLAT_PIXEL);
  buffers = {};
}

function upload(name, target, values) {   // to the card, if it has not these values already
  const found = buffers[name] ??= { buffer: gl.createBuffer(), values: null };
  gl.bindBuffer(target, found.buffer);
  if (found.values !== values) { gl.bufferData(target, values, gl.DYNAMIC_DRAW); found.values = values; }
}

function attribute(index, name, values, size) {
  upload(name, gl.ARRAY_BUFFER, values);
  gl.enableVertexAttribArray(index);
  gl.vertexAttribPointer(index, size, gl.FLOAT, false, 0, 0);
  gl.vertexAttribDivisor(index, 0);
}

function segments(name, attributeNames, pairs) {   // two attributes of one interleaved buffer: both ends of each segment
  upload(name, gl.ARRAY_BUFFER, pairs);
  attributeNames.forEach((index, k) => {
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 24, 12 * k);
    gl.vertexAttribDivisor(index, 1);
  });
}

// ---- where things are

function frameNow() {
  const last = scene.frames.length - 1, first = clamp(Math.floor(state.frame), 0, Math.max(last - 1, 0)), second = Math.min(first + 1, last);
  return { now: scene.frames[first], next: scene.frames[second], share: clamp(state.frame - first, 0, 1), first, second };
}

function view() {
  const w = canvas.clientWidth, h = canvas.clientHeight, least = Math.min(w, h), scale = 1.75 * state.zoom * least;
  return { turn: axes(), grow: [scale / w, scale / h], move: [2 * state.panX * least / w, 2 * state.panY * least / h] };
}

function project(x, y, z) {   // pixels from the left and the top, and the height towards the eye
  const { turn, grow, move } = view(), p = turn.map(r => r[0] * x + r[1] * y + r[2] * z);
  return [(1 + p[0] * grow[0] + move[0]) / 2 * canvas.clientWidth, (1 - p[1] * grow[1] - move[1]) / 2 * canvas.clientHeight, p[2]];
}

function cutPlane() {   // what is above it is cut away
  const axis = "xyz".indexOf(state.section), { low, high } = scene.box, n = [0, 0, 0];
  if (axis < 0 || state.section === "") return { n, d: 1, axis: -1 };
  const sign = (state.section === "y") !== state.flip ? -1 : 1, at = low[axis] + state.at * (high[axis] - low[axis]);
  n[axis] = sign;
  return { n, d: sign * at + 1e-7, axis, at };
}

const shiftOf = group => state.explode ? scene.centres[group].map(x => x * state.explode) : [0, 0, 0];

let made = new Map();   // what was computed, by what it depends on
function once(name, depends, make) {
  const found = made.get(name), key = `${version} ${depends}`;
  if (found && found.key === key) return found.value;
  const value = make();
  made.set(name, { key, value });
  return value;
}

// Segments of a frame; those between two groups that are apart occur twice.
const gather = (name, frame, positions, rows) => once(`${name}/${frame}`, `${state.explode}`, () => {
  const width = name === "net" || name === "curve" ? 2 : 4, found = [];
  for (let k = 0; k < rows.length; k += width) {
    const groups = width === 2 ? [-1] : state.explode && rows[k + 2] !== rows[k + 3] ? [rows[k + 2], rows[k + 3]] : [rows[k + 2]];
    for (const group of groups) {
      const shift = group < 0 ? [0, 0, 0] : shiftOf(group);
      for (const v of [rows[k], rows[k + 1]]) for (let i = 0; i < 3; i++) found.push(positions[3 * v + i] + shift[i]);
    }
  }
  return new Float32Array(found);
});

// Where the section cuts the triangles.
const sectionLines = () => once("section", [state.section, state.at, state.flip, state.explode, state.frame], () => {
  const { axis, at } = cutPlane(), found = [];
  if (axis < 0 || scene.curve) return new Float32Array();
  const { now, next, share } = frameNow(), { cells } = scene;
  const p = share ? now.positions.map((x, k) => x + share * (next.positions[k] - x)) : now.positions;
  scene.groups.forEach(([, start, stop], group) => {
    const shift = shiftOf(group), level = at - shift[axis];
    for (let k = 3 * start; k < 3 * stop; k += 3) {
      const ends = [];
      for (let i = 0; i < 3; i++) {
        const a = 3 * cells[k + i], b = 3 * cells[k + (i + 1) % 3], ha = p[a + axis] - level, hb = p[b + axis] - level;
        if ((ha < 0) !== (hb < 0)) { const t = ha / (ha - hb); for (let j = 0; j < 3; j++) ends.push(p[a + j] + t * (p[b + j] - p[a + j]) + shift[j]); }
      }
      if (ends.length === 6) found.push(...ends);
    }
  });
  return new Float32Array(found);
});

// ---- drawing

function prepare(shader, share, whole = false) {
  shader.use();
  const { turn, grow, move } = view(), { n, d } = whole ? { n: [0, 0, 0], d: 1 } : cutPlane();
  gl.uniformMatrix3fv(shader.at("turn"), true, turn.flat());
  gl.uniform2fv(shader.at("grow"), grow);
  gl.uniform2fv(shader.at("move"), move);
  gl.uniform1f(shader.at("share"), share);
  gl.uniform3f(shader.at("shift"), 0, 0, 0);
  gl.uniform4f(shader.at("cut"), ...n, d);
}

function stroke(name, share, first, second, paint, width, hidden, whole = false) {
  if (!first.length) return;
  prepare(strokes, share, whole);
  gl.uniform2f(strokes.at("window"), canvas.width / 2, canvas.height / 2);
  gl.uniform1f(strokes.at("width"), width * ratio / 2);
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

function dotted(name, share, first, second, paint, rim, size, hidden = 0.15, whole = false) {
  if (!first.length) return;
  prepare(dots, share, whole);
  gl.uniform1f(dots.at("size"), size * ratio);
  gl.uniform1f(dots.at("nearer"), 0.003);
  gl.uniform1i(dots.at("round_"), 1);
  attribute(0, name + "0", first, 3);
  attribute(1, name + "1", second, 3);
  for (const k of [2, 3, 4]) gl.disableVertexAttribArray(k);
  for (const [test, strength] of [[gl.GREATER, hidden], [gl.LEQUAL, 1]]) {
    gl.depthFunc(test);
    gl.uniform4f(dots.at("paint"), ...paint, strength);
    gl.uniform4f(dots.at("rim"), ...rim, strength);
    gl.drawArrays(gl.POINTS, 0, first.length / 3);
  }
  gl.depthFunc(gl.LEQUAL);
}

const shownOf = scalar => once("shown", [state.mode, state.scale, state.thin], () => {   // numbers as parts of the scale; thin walls are at its end
  const [low, high] = ends(scalar), thin = state.mode === "wall" ? state.thin : -Infinity;
  return scalar.values.map(x => x < thin ? 0 : clamp((x - low) / (high - low), 0, 1));
});

function fill() {
  const { now, next, share } = frameNow(), { low, high } = scene.box;
  prepare(surfaces, share);
  const scalar = scene.scalars[state.mode];
  gl.uniform1i(surfaces.at("mode"), scalar ? 1 : { zebra: 2, isophotes: 3, overhangs: 4 }[state.mode] || 0);
  gl.uniform1f(surfaces.at("steep"), Math.sin(state.angle * Math.PI / 180));
  gl.uniform1f(surfaces.at("floor_"), low[2] + 0.002 * (high[2] - low[2]));
  gl.uniform3fv(surfaces.at("stops"), stops().flatMap(rgb));
  attribute(0, "p0", now.positions, 3); attribute(1, "p1", next.positions, 3);
  attribute(2, "n0", now.normals, 3); attribute(3, "n1", next.normals, 3);
  if (scalar) attribute(4, "s-" + state.mode, shownOf(scalar), 1);
  else { gl.disableVertexAttribArray(4); gl.vertexAttrib1f(4, 0); }
  upload("cells", gl.ELEMENT_ARRAY_BUFFER, scene.cells);
  scene.groups.forEach(([, start, stop], k) => {
    gl.uniform3fv(surfaces.at("shift"), shiftOf(k));
    gl.uniform3fv(surfaces.at("colour"), rgb(COLOURS[state.patches && scene.groups.length > 1 ? k % COLOURS.length : 0]));
    gl.drawElements(gl.TRIANGLES, 3 * (stop - start), scene.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, (scene.wide ? 12 : 6) * start);
  });
}

// Where the plane is inside of a solid, a ray towards it passes through more of its faces one way than the other.
function drawCap() {
  const { axis, at } = cutPlane();
  if (axis < 0 || !scene.closed || state.explode) return;
  gl.enable(gl.STENCIL_TEST);
  gl.stencilFunc(gl.ALWAYS, 0, 255);
  gl.stencilOpSeparate(gl.FRONT, gl.KEEP, gl.KEEP, gl.DECR_WRAP);
  gl.stencilOpSeparate(gl.BACK, gl.KEEP, gl.KEEP, gl.INCR_WRAP);
  gl.colorMask(false, false, false, false);
  gl.depthMask(false);
  gl.disable(gl.DEPTH_TEST);
  fill();
  gl.enable(gl.DEPTH_TEST);
  gl.depthMask(true);
  gl.colorMask(true, true, true, true);
  gl.stencilFunc(gl.NOTEQUAL, 0, 255);
  gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
  prepare(caps, 0);
  gl.uniform1f(caps.at("fine"), ratio);
  const [i, j] = [(axis + 1) % 3, (axis + 2) % 3], corners = [[-1, -1], [1, -1], [-1, 1], [1, 1]];
  attribute(0, "cap", new Float32Array(corners.flatMap(([a, b]) => { const p = []; p[axis] = at; p[i] = a; p[j] = b; return p; })), 3);
  for (const k of [1, 2, 3, 4]) gl.disableVertexAttribArray(k);
  gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  gl.disable(gl.STENCIL_TEST);
}

function draw(larger = 1, clear = false) {
  wanted = false;
  ratio = larger * (window.devicePixelRatio || 1);
  const w = Math.max(Math.round(canvas.clientWidth * ratio), 1), h = Math.max(Math.round(canvas.clientHeight * ratio), 1);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const dark = isDark(), ink = dark ? [0.9, 0.91, 0.92] : [0.13, 0.15, 0.17], faint = dark ? [0.45, 0.5, 0.53] : [0.62, 0.65, 0.68];
  gl.viewport(0, 0, w, h);
  gl.clearColor(...(clear ? [0, 0, 0, 0] : [...(dark ? [0.086, 0.098, 0.11] : [0.984, 0.984, 0.98]), 1]));
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.disable(gl.BLEND);
  if (!scene.curve) {
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 1);
    fill();
    drawCap();
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }
  gl.enable(gl.BLEND);
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthMask(false);   // lines do not hide each other: what shines through a surface would hide what is on it
  const { now, next, share, first, second } = frameNow(), accent = dark ? [0.34, 0.71, 0.91] : [0, 0.45, 0.7];
  const moving = (name, rows) => [gather(name, first, now.positions, rows), gather(name, second, next.positions, rows)];
  markAxes(faint);
  markNames();
  if (scene.curve) stroke("curve", share, ...moving("curve", scene.cells), accent, 3.6, 0);
  if (state.edges) stroke("border", share, ...moving("border", scene.lines.border), scene.curve ? ink : [0.1, 0.12, 0.14], 1.6, state.hidden ? 0.3 : 0);
  if (state.folds) stroke("folds", share, ...moving("folds", scene.lines.folds), [0.9, 0.62, 0], 4, 0.3);
  if (state.open) stroke("open", share, ...moving("open", scene.lines.open), [0.84, 0, 0.11], 3.6, 0.35);
  const section = sectionLines();
  stroke("section", 0, section, section, ink, 2, 0, true);
  if (state.net && now.net && !state.explode) {
    const ends = f => gather("net", f, scene.frames[f].net, scene.lines.net);
    stroke("net", share, ends(first), ends(second), ink, 1.4, 0.25);
    dotted("control", share, now.net, next.net, dark ? [0.1, 0.11, 0.12] : [1, 1, 1], ink, 8);
  }
  if (state.knots && !state.explode) dotted("knots", 0, scene.spots, scene.spots, accent, [1, 1, 1], 11);
  if (state.mode === "wall" && scene.scalars.wall && !state.explode) {
    const { least } = scene.scalars.wall, spot = now.positions.slice(3 * least, 3 * least + 3);
    dotted("least", 0, spot, spot, [1, 1, 1], [0.84, 0, 0.11], 13, 0.7, true);
  }
  markMeasure(accent);
  gl.depthMask(true);
}

// ---- axes: beside edges of the box that are outlines of it, and so beside the model

function corners() {   // of the box
  const { low, high } = scene.box;
  return [0, 1, 2, 3, 4, 5, 6, 7].map(k => low.map((x, i) => k >> i & 1 ? high[i] : x));
}

function axisEdges() {
  const { low, high } = scene.box, towards = axes()[2].map(x => x < -1e-9 ? -1 : 1);
  return [0, 1, 2].map(k => {
    const i = (k + 1) % 3, j = (k + 2) % 3, pick = (axis, sign) => sign > 0 ? high[axis] + 0.02 : low[axis] - 0.02;
    const both = [1, -1].map(sign => {   // one of the faces beside such an edge looks towards the eye, and one away
      const start = [...low], end = [...low];
      start[i] = end[i] = pick(i, sign * towards[i]);
      start[j] = end[j] = pick(j, -sign * towards[j]);
      end[k] = high[k];
      const a = project(...start), b = project(...end);
      return { k, start, end, a, b, rank: k === 2 ? a[0] + b[0] : -a[1] - b[1] };
    });
    return both[0].rank <= both[1].rank ? both[0] : both[1];
  }).filter(({ a, b }) => Math.hypot(b[0] - a[0], b[1] - a[1]) > 30);
}

function markAxes(paint) {
  const marks = $("marks"), { low, high, texts } = scene.box, edges = state.axes && !state.explode ? axisEdges() : [];   // patches that are apart are not in the box
  const pairs = new Float32Array(edges.flatMap(({ start, end }) => [...start, ...end]));
  stroke("axes", 0, pairs, pairs, paint, 1.5, 0, true);
  const [cx, cy] = project(...low.map((x, k) => (x + high[k]) / 2));
  const places = edges.flatMap(({ k, a, b }) => {
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]), normal = [(b[1] - a[1]) / length, (a[0] - b[0]) / length];
    const side = normal[0] * ((a[0] + b[0]) / 2 - cx) + normal[1] * ((a[1] + b[1]) / 2 - cy) < 0 ? -1 : 1;
    return [[0.04, texts[k][0]], [0.5, "xyz"[k]], [0.96, texts[k][1]]].map(([t, text]) => {
      const far = 12 + Math.abs(normal[0]) * 3.2 * text.length;
      return [a[0] + t * (b[0] - a[0]) + side * normal[0] * far, a[1] + t * (b[1] - a[1]) + side * normal[1] * far, text];
    });
  });
  spread(marks, places);
}

function spread(marks, places) {   // texts: [x, y, text] of their middles
  while (marks.children.length < places.length) marks.append(document.createElement("span"));
  [...marks.children].forEach((span, k) => {
    span.hidden = k >= places.length;
    if (span.hidden) return;
    const [x, y, text] = places[k];
    span.textContent = text;
    span.style.left = `${x}px`;
    span.style.top = `${y}px`;
  });
}

function markNames() {   // of edges, within the window; one that would cover another, nearer to the eye, is left out
  const marks = $("labels"), p = scene.middles, shown = state.names && !state.explode ? scene.edges.names : [], taken = [];
  const places = shown.map((text, k) => [...project(p[3 * k], p[3 * k + 1], p[3 * k + 2]), text]).sort((a, b) => b[2] - a[2]);
  spread(marks, places.map(([x, y, , text]) => [x, y, text]));
  for (const span of [...marks.children].slice(0, places.length)) {
    const w = span.offsetWidth / 2, h = span.offsetHeight / 2;
    const x = clamp(parseFloat(span.style.left), w, Math.max(innerWidth - w, w)), y = clamp(parseFloat(span.style.top), h, Math.max(innerHeight - h, h));
    span.style.left = `${x}px`;
    span.style.top = `${y}px`;
    span.hidden = taken.some(([a, b, c, d]) => Math.abs(a - x) < c + w && Math.abs(b - y) < d + h);
    if (!span.hidden) taken.push([x, y, w, h]);
  }
}
