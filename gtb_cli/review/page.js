// Shows what is in #data: a table of changes, and the chosen one as three views under one camera.
const data = JSON.parse($("data").textContent);
const state = { azimuth: -60, elevation: 30, zoom: 1, panX: 0, panY: 0 };
const COLUMNS = ["faces", "segments", "area", "length", "volume", "lowest", "highest", "open edges"];
const THICK = [[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1], [-.7, -.7], [-.7, .7], [.7, -.7], [.7, .7]];
let chosen = -1, wanted = false, views = [];

const VERTEX = `#version 300 es
precision highp float;
layout(location=0) in vec3 p; layout(location=1) in float d;
uniform mat3 turn; uniform vec2 grow, move;
out vec3 seen; out float value;
void main() { seen = turn * p; value = d; gl_Position = vec4(seen.xy * grow + move, -seen.z * 0.5, 1.0); }`;
const PIXEL = `#version 300 es
precision highp float;
uniform vec3 colour; uniform bool flat_, scaled;
in vec3 seen; in float value; out vec4 pixel;
vec3 ramp(float x) {
  vec3 a = vec3(.79, .83, .855), b = vec3(.965, .83, .396), c = vec3(.91, .455, .23), d = vec3(.55, .06, .185);
  x *= 3.0;
  return x < 1.0 ? mix(a, b, x) : x < 2.0 ? mix(b, c, x - 1.0) : mix(c, d, min(x - 2.0, 1.0));
}
void main() {
  vec3 c = scaled ? ramp(value) : gl_FrontFacing || flat_ ? colour : mix(colour, vec3(.45, .15, .65), .65);
  if (flat_) { pixel = vec4(c * 0.85, 1.0); return; }
  vec3 n = normalize(cross(dFdx(seen), dFdy(seen)));   // that of the triangle: what is in the file, not made smoother
  float bright = 0.5 + 0.5 * max(dot(n, normalize(vec3(-0.45, 0.55, 0.7))), 0.0);
  pixel = vec4(c * bright * (gl_FrontFacing ? 1.0 : 0.72), 1.0);
}`;

function uploaded(target, values) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, values, gl.STATIC_DRAW);
  return buffer;
}

function shown(side, values) {   // a view: buffers of a mesh on the card
  if (!side) return null;
  const positions = decoded(side.positions, Float32Array), cells = decoded(side.cells, side.wide ? Uint32Array : Uint16Array);
  return { positions, count: cells.length, curve: side.corners === 2, type: side.wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, scaled: !!values,
    vertices: uploaded(gl.ARRAY_BUFFER, positions), indices: uploaded(gl.ELEMENT_ARRAY_BUFFER, cells),
    values: values && uploaded(gl.ARRAY_BUFFER, values) };
}

function frame() {   // of one of the three views, in pixels of the page
  const width = canvas.clientWidth / 3, height = canvas.clientHeight, scale = 0.86 * state.zoom * Math.min(width, height);
  return { width, height, scale };
}

function draw() {
  wanted = false;
  const ratio = window.devicePixelRatio || 1, w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  gl.clearColor(...(dark ? [0.086, 0.098, 0.11] : [0.984, 0.984, 0.98]), 1);
  gl.disable(gl.SCISSOR_TEST);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.SCISSOR_TEST);
  const { width, height, scale } = frame();
  gl.uniformMatrix3fv(at("turn"), true, axes().flat());
  gl.uniform2f(at("grow"), 2 * scale / width, 2 * scale / height);
  gl.uniform2f(at("move"), 2 * state.panX / width, 2 * state.panY / height);
  views.forEach((view, k) => {
    if (!view) return;
    const x = Math.round(k * w / 3);
    gl.viewport(x, 0, Math.round(w / 3), h);
    gl.scissor(x, 0, Math.round(w / 3), h);
    gl.uniform3f(at("colour"), ...(k === 1 ? [0.56, 0.74, 0.85] : [0.95, 0.71, 0.54]));
    gl.uniform1i(at("flat_"), view.curve);
    gl.uniform1i(at("scaled"), view.scaled);
    gl.bindBuffer(gl.ARRAY_BUFFER, view.vertices);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.disableVertexAttribArray(1);
    if (view.values) {
      gl.bindBuffer(gl.ARRAY_BUFFER, view.values);
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 1, gl.UNSIGNED_BYTE, true, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, view.indices);
    if (!view.curve) return gl.drawElements(gl.TRIANGLES, view.count, view.type, 0);
    for (const [x, y] of THICK) {   // browsers draw lines of one pixel only
      gl.uniform2f(at("move"), 2 * (state.panX + x) / width, 2 * (state.panY + y) / height);
      gl.drawElements(gl.LINES, view.count, view.type, 0);
    }
    gl.uniform2f(at("move"), 2 * state.panX / width, 2 * state.panY / height);
  });
  mark(width, height, scale);
}

function mark(width, height, scale) {   // the place of the largest distance, also where it is behind something
  const change = data.changes[chosen], spot = $("spot"), coloured = change && change.coloured;
  spot.hidden = !(coloured && coloured.at);
  if (spot.hidden) return;
  const [x, y] = axes().map(row => row.reduce((sum, r, k) => sum + r * coloured.at[k], 0));
  const left = width / 2 + x * scale + state.panX, top = height / 2 - y * scale - state.panY;
  spot.hidden = left < 0 || left > width || top < 0 || top > height;
  spot.style.left = `${2 * width + left}px`;
  spot.style.top = `${top}px`;
}

const redraw = () => { if (gl && !wanted) { wanted = true; requestAnimationFrame(draw); } };

// A word for a shell, which takes no part of it for anything else
const quoted = word => (/^[\w./+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`).replace(/^(?='?-)/, "./");
// The command that takes a file of a folder over; none for two files, or where names had to be changed to be shown
const approval = change => change.approvable && ["different", "extra"].includes(change.verdict) && !data.names[1].endsWith(change.name)
  && ![...data.names, change.name].some(name => name.includes("\\"))
  ? `gtb approve ${[...data.names, change.name].map(quoted).join(" ")}` : "";

function choose(k) {
  if (!data.changes.length) return;
  k = clamp(Math.trunc(k) || 0, 0, data.changes.length - 1);
  if (k === chosen) return;
  const body = $("body");
  if (chosen >= 0) body.children[chosen].classList.remove("chosen");
  body.children[k].classList.add("chosen");
  if (chosen >= 0 || k) body.children[k].scrollIntoView({ block: "nearest" });
  chosen = k;
  const change = data.changes[k], coloured = change.coloured;
  for (const view of views) if (view) for (const name of ["vertices", "indices", "values"]) gl.deleteBuffer(view[name]);
  views = gl ? [shown(change.old), shown(change.new), coloured && shown(change[coloured.side], decoded(coloured.values, Uint8Array))] : [];
  $("name").textContent = change.name;
  $("what").textContent = change.amount ? `${change.verdict}: ${change.amount} apart, tolerance ${change.tolerance}` : change.verdict;
  const most = ["old", "new"].filter(side => change[side] && change[side].shown < change[side].faces);
  $("facts").textContent = [`${k + 1} of ${data.changes.length}`, coloured && coloured.at ? `most at ${coloured.place}` : "",
    ...most.map(side => `${side}: simplified from ${change[side].faces} to ${change[side].shown} faces`)].filter(x => x).join("; ");
  $("reasons").replaceChildren(...change.reasons.map(text => { const item = document.createElement("li"); item.textContent = text; return item; }));
  $("approving").hidden = !approval(change);
  $("approve").textContent = approval(change);
  const own = change.alone ? ", at its own scale" : "";
  $("first").textContent = `old${own}`;
  $("second").textContent = `new${own}`;
  $("no-old").textContent = !gl ? "This page needs WebGL 2, which the browser does not offer."
    : change.old ? "" : change.verdict === "extra" ? "there was none" : "nothing to show";
  $("no-new").textContent = change.new ? "" : change.verdict === "missing" ? "there is none" : "nothing to show";
  $("no-third").textContent = coloured ? "" : change.uncoloured;
  $("third").textContent = !coloured ? "" : coloured.turned ? "new, around the faces that are turned over" : coloured.vertices ? "new, by how far its vertices have moved"
    : `${coloured.side}, by its distance from ${coloured.side === "old" ? "new" : "old"}`;
  $("scale").hidden = !(coloured && coloured.at);
  $("scale-high").textContent = coloured && coloured.top || "";
  location.replace(`#${k + 1}`);
  fit();
}

function fit() {
  const ends = extents(views.filter(view => view).map(view => view.positions));
  if (ends[0] === Infinity) return redraw();
  Object.assign(state, { zoom: 1 });
  const { width, height, scale } = frame();
  const zoom = Math.min(0.84 * width / Math.max(ends[1] - ends[0], 1e-9), 0.84 * height / Math.max(ends[3] - ends[2], 1e-9)) / scale;
  Object.assign(state, { zoom, panX: -(ends[0] + ends[1]) / 2 * scale * zoom, panY: -(ends[2] + ends[3]) / 2 * scale * zoom });
  redraw();
}

function scaled(x, y, factor) {
  for (const name of ["zoom", "panX", "panY"]) state[name] *= factor;
  redraw();
}

steer({ fit, zoom: scaled, move: (dx, dy) => { state.panX += dx; state.panY -= dy; redraw(); },
  turn: (dx, dy) => { state.azimuth -= dx; state.elevation = clamp(state.elevation + dy, -90, 90); redraw(); } });
addEventListener("keydown", e => {
  if (e.ctrlKey || e.metaKey || e.altKey) return;
  const steps = { j: 1, n: 1, ArrowDown: 1, k: -1, p: -1, ArrowUp: -1 };
  if (steps[e.key]) choose(chosen + steps[e.key]);
  else if (e.key === "Home") choose(0);
  else if (e.key === "End") choose(data.changes.length - 1);
  else if (e.key === "f") fit();
  else if (e.key === "ArrowLeft" || e.key === "ArrowRight") { state.azimuth += e.key === "ArrowLeft" ? 5 : -5; redraw(); }
  else return;
  e.preventDefault();
});
addEventListener("resize", fit);
addEventListener("hashchange", () => choose(Number(location.hash.slice(1)) - 1));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
$("before").onclick = () => choose(chosen - 1);
$("after").onclick = () => choose(chosen + 1);
$("copy").onclick = () => navigator.clipboard?.writeText($("approve").textContent).catch(() => { /* it stands there to be copied */ });

function cell(row, ...texts) {
  const made = document.createElement("td");
  for (const text of texts) { const line = document.createElement("div"); line.textContent = text; made.append(line); }
  row.append(made);
  return made;
}

function start() {
  $("title").textContent = data.names.join(" → ");
  $("counts").textContent = Object.entries(data.counts).filter(([name, count]) => count || name === "same").map(([name, count]) => `${count} ${name}`).join(", ")
    + (data.changes.length ? ". Keys: j and k step through the changes; drag turns, Shift-drag moves, the wheel zooms, f fits. Backs of faces are violet." : ". Nothing differs.");
  const columns = COLUMNS.filter(label => data.changes.some(change => change.rows.some(row => row[0] === label && (row[1] || row[2]))));
  for (const text of ["name", "verdict", "distance", "tolerance", ...columns]) {
    const head = document.createElement("th");
    head.textContent = text;
    $("heads").append(head);
  }
  data.changes.forEach((change, k) => {
    const row = document.createElement("tr");
    cell(row, change.name).className = "name";
    cell(row, change.verdict).className = change.verdict;
    cell(row, change.amount);
    cell(row, change.tolerance);
    for (const label of columns) {
      const [, old, now] = change.rows.find(row => row[0] === label) || ["", "", ""];
      if (old === now) cell(row, old);
      else cell(row, old || "–", `→ ${now || "–"}`).className = "changed";
    }
    row.onclick = () => choose(k);
    $("body").append(row);
  });
  $("stage").hidden = $("about").hidden = $("scroll").hidden = !data.changes.length;
  choose((Number(location.hash.slice(1)) || 1) - 1);
}

let at = null;
if (gl) {
  const shader = program(VERTEX, PIXEL);
  shader.use();
  at = shader.at;
  canvas.addEventListener("webglcontextlost", e => e.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => location.reload());
}
start();
