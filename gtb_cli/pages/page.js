// A page that shows what is in #data: its state, which its address holds too, and its controls.

const MODES = { shaded: "Shaded", mean: "Mean curvature", gaussian: "Gaussian curvature", zebra: "Zebra stripes", isophotes: "Isophotes", wall: "Wall thickness", overhangs: "Overhangs" };
const SWITCHES = {
  patches: ["c", "Patch colours"], net: ["n", "Control net"], knots: ["k", "Knots"], edges: ["e", "Edges"], hidden: ["b", "Hidden edges"],
  open: ["o", "Open edges"], folds: ["p", "Folds"], axes: ["a", "Axes"], names: ["l", "Edge names"], measure: ["m", "Measure"],
};
const VIEWS = { t: ["top", -90, 90], v: ["front", -90, 0], s: ["side", 0, 0], h: ["home", -60, 30] };   // and those from behind

const state = { mode: "shaded", azimuth: -60, elevation: 30, zoom: 1, panX: 0, panY: 0, frame: 0, patches: true, net: false, knots: false,
  edges: true, hidden: false, open: true, folds: true, axes: true, names: false, measure: false, section: "", at: 0.5, flip: false, explode: 0, angle: 45, scale: 0, thin: 0, from: "", to: "", back: true, theme: "" };
let defaults = null, scene = null, version = 0, playing = false, wanted = false, fitted = "", beside = true, offered = ["shaded"];   // modes; the scale was hidden when it was fitted

function read(data) {
  const frames = data.frames.map(f => ({ label: f.label, positions: decoded(f.positions, Float32Array),
    normals: f.normals && decoded(f.normals, Float32Array), net: f.net && decoded(f.net, Float32Array) }));
  const lines = {}, scalars = {}, cells = decoded(data.cells, data.wide ? Uint32Array : Uint16Array);
  for (const [name, text] of Object.entries(data.lines)) lines[name] = decoded(text, Uint32Array);
  for (const [name, { values, low, high }] of Object.entries(data.scalars)) {
    const numbers = decoded(values, Float32Array);
    scalars[name] = { values: numbers, low, high, least: numbers.reduce((best, x, k) => x < numbers[best] ? k : best, 0) };
  }
  const centres = data.groups.map(([, start, stop]) => {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    if (!data.curve) for (let k = 3 * start; k < 3 * stop; k++) for (let i = 0; i < 3; i++) {
      const x = frames[0].positions[3 * cells[k] + i];
      low[i] = Math.min(low[i], x); high[i] = Math.max(high[i], x);
    }
    return low.map((x, i) => (x + high[i] - data.box.low[i] - data.box.high[i]) / 2);
  });
  const net = frames.length === 1 && frames[0].net, far = net && net.some(x => Math.abs(x) > 2);   // points of small weight may be very far
  if (far) {
    lines.net = lines.net.filter((_, k, ends) => isNear(net, 3 * ends[k & ~1]) && isNear(net, 3 * ends[k | 1]));
    data.facts += "; the control net without its farthest points";
  }
  return { ...data, far, frames, lines, scalars, cells, centres, spots: decoded(data.knots.points, Float32Array), middles: decoded(data.edges.points, Float32Array) };
}

const isNear = (cloud, k) => Math.max(Math.abs(cloud[k]), Math.abs(cloud[k + 1]), Math.abs(cloud[k + 2])) <= 1;
const redraw = () => { if (scene && !wanted) { wanted = true; requestAnimationFrame(() => draw()); } };
const ends = ({ low, high }) => state.scale ? [low && -state.scale, state.scale] : [low, high];   // of a scale: as made, or as chosen
const withUnit = text => scene.unit ? `${text} ${scene.unit}` : `${text}`;
const isDark = () => (state.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark";
const modes = () => scene.quick ? [...new Set([...offered, MODES[state.mode] ? state.mode : "shaded"])] : scene.curve ? ["shaded"] : Object.keys(MODES)
  .filter(name => name === "overhangs" ? scene.closed : scene.scalars[name] || !["mean", "gaussian", "wall"].includes(name));

// ---- state and address

function set(changes) {
  if (!scene) return;
  if ("zoom" in changes || "panX" in changes) fitted = "";
  Object.assign(state, changes);
  if (changes.explode) state.measure = false;
  if (changes.measure) state.explode = 0;
  if (scene.frames.length > 1) state.measure = false;
  state.elevation = clamp(state.elevation, -90, 90);
  state.zoom = clamp(state.zoom, 0.05, 400);
  state.frame = clamp(state.frame, 0, scene.frames.length - 1);
  for (const [name, high] of [["at", 1], ["explode", 1], ["angle", 90], ["scale", 1e30], ["thin", 1e30]]) state[name] = clamp(state[name], 0, high);
  if (!scene.quick && !modes().includes(state.mode)) {
    lack(state.mode);
    state.mode = "shaded";
  }
  if (!["x", "y", "z"].includes(state.section) || scene.curve) state.section = "";
  if (scene.groups.length < 2 || scene.curve) state.explode = 0;
  show();
  redraw();
  clearTimeout(set.timer);
  set.timer = setTimeout(remember, 250);
}

function lack(mode) {   // say which mode of an address this page does not have, and why
  const reason = scene.absent[mode], text = document.createElement("li");
  text.textContent = reason ? `The address asks for ${MODES[mode].toLowerCase()}, which is shown ${reason}.` : `The address asks for a mode "${mode}": there are ${Object.keys(MODES).join(", ")}.`;
  $("remarks").append(text);
}

const fitting = () => [state.azimuth, state.elevation, state.net, state.axes, state.explode, $("scale").hidden].join();   // on which fit depends

function remember() {   // in the address, so that a link shows the same; a frame of a notebook has none
  const isFitted = fitted && fitted === fitting();   // in another window, too
  const kept = Object.keys(state).filter(name => state[name] !== defaults[name] && !(isFitted && ["zoom", "panX", "panY"].includes(name)));
  const text = kept.map(name => `${name}=${typeof state[name] === "number" ? +state[name].toFixed(6) : state[name]}`).join("&");
  try { history.replaceState(null, "", `#${text}`); } catch { /* it stays as it is */ }
}

function recall(text) {   // #mode=zebra&azimuth=30&net=true
  const given = {};
  for (const [name, value] of new URLSearchParams(text)) {
    const kind = typeof state[name], number = Number(value);
    if (kind === "string") given[name] = value;
    else if (kind === "boolean") given[name] = value === "true";
    else if (kind === "number" && value && Number.isFinite(number)) given[name] = number;
  }
  Object.assign(state, defaults, given);
  return "zoom" in given;
}

function show() {
  if (state.theme) document.documentElement.dataset.theme = state.theme; else delete document.documentElement.dataset.theme;
  for (const name of Object.keys(SWITCHES)) $(name).checked = state[name];
  $("back").checked = state.back;
  $("mode").value = state.mode;
  const scalar = scene.scalars[state.mode], { now, next, share } = frameNow();
  $("scale").hidden = !scalar;
  if (scalar) {
    const [low, high] = ends(scalar), unit = state.mode === "wall" && scene.unit;
    $("scale-name").textContent = MODES[state.mode] + (unit ? `, ${unit}` : "");
    if (document.activeElement !== $("scale-high")) $("scale-high").value = +high.toPrecision(3);
    $("scale-low").textContent = low.toPrecision(3);
    $("walls").hidden = state.mode !== "wall";
    $("least").textContent = `least ${scalar.values[scalar.least].toPrecision(3)}`;
    if (document.activeElement !== $("thin")) $("thin").value = state.thin || "";
    $("thinner").textContent = state.mode === "wall" && state.thin ? thinner(scalar.values) : "";
    paintScale(document.querySelector("#scale canvas").getContext("2d"), 0, 0, 1, 150);
  }
  $("overhang").hidden = state.mode !== "overhangs";
  $("angle").value = state.angle;
  if (state.mode === "overhangs") $("steep").textContent = `${state.angle}° from upright: ${overhang()}`;
  $("section").value = state.section;
  $("cutting").hidden = !state.section;
  $("at").value = state.at;
  $("explode").value = state.explode;
  const axis = "xyz".indexOf(state.section);
  if (state.section) $("where").textContent = withUnit(`${state.section} = ${lengthText(inModel([0, 1, 2].map(() => cutPlane().at))[axis])}`);
  canvas.classList.toggle("measuring", state.measure);
  if (!state.measure) hovered = null;
  sayMeasure();
  $("slider").value = state.frame;
  $("value").textContent = share === 0 ? now.label : share === 1 ? next.label : `${now.label} → ${next.label}`;
  $("run").textContent = playing ? "❚❚" : "▶";
  if (fitted && isBeside()) fit();
}

function paintScale(context, left, top, width, height) {
  const ramp = context.createLinearGradient(0, top + height, 0, top);
  stops().forEach((colour, k) => ramp.addColorStop(k / 4, colour));
  context.fillStyle = ramp;
  context.fillRect(left, top, width, height);
}

function areaWhere(isCounted) {   // the area of triangles of which this is true, and its part of the surface
  const p = scene.frames[0].positions;
  let sum = 0, all = 0;
  for (let k = 0; k < scene.cells.length; k += 3) {
    const [a, b, c] = [0, 1, 2].map(i => p.subarray(3 * scene.cells[k + i], 3 * scene.cells[k + i] + 3));
    const [u, v] = [[0, 1, 2].map(i => b[i] - a[i]), [0, 1, 2].map(i => c[i] - a[i])];
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]], area = Math.hypot(...normal);
    all += area;
    if (isCounted(k, normal[2] / area, (a[2] + b[2] + c[2]) / 3)) sum += area;
  }
  const area = sum / 2 * scene.size ** 2, text = scene.unit === "mm" && area >= 100 ? `${(area / 100).toPrecision(4)} cm²` : withUnit(area.toPrecision(4)) + (scene.unit && "²");
  return `${text} (${(100 * sum / all).toFixed(1)} %)`;
}

const overhang = () => once("overhang", state.angle, () => {   // of what is painted as such
  const { low, high } = scene.box, floor_ = low[2] + 0.002 * (high[2] - low[2]), steep = Math.sin(state.angle * Math.PI / 180);
  return areaWhere((_, up, z) => up < -steep && !(up < -0.99 && z < floor_));
});
const thinner = wall => once("thinner", state.thin, () => areaWhere(k => scene.cells.subarray(k, k + 3).every(v => wall[v] < state.thin)));

// ---- camera

// The camera for which all that there is fills the window, beside the panel where that leaves room enough; and its extents.
function filling() {
  const clouds = scene.frames.flatMap(f => [f.positions, ...(state.net && f.net ? [scene.far ? f.net.filter((_, k) => isNear(f.net, k - k % 3)) : f.net] : [])]);
  if (state.axes) clouds.push(corners().flat());
  if (state.explode) for (const f of ["border", "open"]) clouds.push(gather(f, 0, scene.frames[0].positions, scene.lines[f]));
  const ends = extents(clouds), w = canvas.clientWidth, h = canvas.clientHeight, least = Math.min(w, h), panel = $("panel").getBoundingClientRect();
  const left = $("panel").open && w > 2.4 * panel.right ? panel.right : 0, bar = document.querySelector("#play:not([hidden])"), below = bar ? bar.offsetHeight + 14 : 0;
  const right = $("scale").hidden || w < 500 ? 0 : $("scale").offsetWidth + 12;
  const unit = 1.75 / 2 * least, margin = Math.min(60, 0.12 * least);
  const beside = state.axes ? Math.min(75, 0.2 * w) : margin;   // where the axes' numbers are
  const zoom = Math.min((w - left - right - 2 * beside) / Math.max(ends[1] - ends[0], 1e-6), (h - below - 2 * margin) / Math.max(ends[3] - ends[2], 1e-6)) / unit;
  return { ends, zoom, panX: ((left - right) / 2 - (ends[0] + ends[1]) / 2 * unit * zoom) / least, panY: (below / 2 - (ends[2] + ends[3]) / 2 * unit * zoom) / least };
}

function fit() {
  const { zoom, panX, panY } = filling();
  beside = $("scale").hidden;
  set({ zoom, panX, panY });
  fitted = fitting();
}

const isBeside = () => !scene.quick && $("scale").hidden !== beside;   // the scale has come, or gone: there is other room

function strays() {   // out of the window, or below a third of what would fill it
  const { ends, zoom } = filling(), { grow, move } = view();
  return 3 * state.zoom < zoom || ends.some((x, k) => Math.abs(x * grow[k >> 1] + move[k >> 1]) > 1);
}

function look(key, behind) {
  const [, azimuth, elevation] = VIEWS[key];
  set(behind ? { azimuth: key === "t" ? azimuth : azimuth + 180, elevation: -elevation } : { azimuth, elevation });
  fit();
}

function zoomAt(left, top, factor) {   // what is at a place stays there
  const least = Math.min(canvas.clientWidth, canvas.clientHeight), x = (left - canvas.clientWidth / 2) / least, y = (canvas.clientHeight / 2 - top) / least;
  set({ zoom: state.zoom * factor, panX: x + (state.panX - x) * factor, panY: y + (state.panY - y) * factor });
}

function pan(dx, dy) {   // by pixels, downwards
  const least = Math.min(canvas.clientWidth, canvas.clientHeight);
  set({ panX: state.panX + dx / least, panY: state.panY - dy / least });
}

// ---- the picture

function picture() {   // at twice the size, with the texts that stand beside the model
  draw(2, !state.back);
  const made = document.createElement("canvas"), context = made.getContext("2d");
  made.width = canvas.width;
  made.height = canvas.height;
  context.drawImage(canvas, 0, 0);
  context.scale(ratio, ratio);
  context.textBaseline = "middle";
  const style = getComputedStyle(document.body), write = (text, x, y, align, colour) => {
    context.font = `12px ${style.fontFamily}`;
    context.textAlign = align;
    context.fillStyle = colour;
    context.fillText(text, x, y);
  };
  for (const span of document.querySelectorAll("#marks span, #labels span")) if (!span.hidden)
    write(span.textContent, parseFloat(span.style.left), parseFloat(span.style.top), "center", getComputedStyle(span).color);
  if (!$("length").hidden) {
    const box = $("length").getBoundingClientRect(), card = getComputedStyle($("length"));
    context.fillStyle = card.backgroundColor;
    context.fillRect(box.left, box.top, box.width, box.height);
    write($("length").textContent, box.left + box.width / 2, box.top + box.height / 2, "center", style.color);
  }
  if (!$("scale").hidden) {
    const right = canvas.clientWidth - 24;
    ["scale-name", "scale-high", "scale-low"].forEach((id, k) => write($(id).value || $(id).textContent, right, [20, 38, 208][k], "right", style.color));
    if (state.mode === "wall") [$("least").textContent, ...(state.thin ? [`thinner than ${state.thin}:`, $("thinner").textContent] : [])]
      .forEach((text, k) => write(text, right, 226 + 18 * k, "right", style.color));
    paintScale(context, right - 14, 48, 14, 150);
  }
  draw();
  return made;
}

function save() {
  picture().toBlob(blob => {
    const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: `${scene.name}.png` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

// ---- controls

function play(time, before) {
  if (!playing) return;
  const last = scene.frames.length - 1, on = state.frame + (before ? (time - before) / 1000 : 0);
  set({ frame: on >= last + 0.7 ? 0 : on });
  state.frame = Math.min(on >= last + 0.7 ? 0 : on, last + 0.7);
  requestAnimationFrame(t => play(t, time));
}

function toggle() { playing = !playing; if (playing && state.frame >= scene.frames.length - 1) state.frame = 0; show(); if (playing) requestAnimationFrame(t => play(t)); }

const ACTIONS = {
  f: fit, d: () => set({ theme: isDark() ? "light" : "dark" }), w: save, i: () => set({ flip: !state.flip }),
  g: () => { set({ explode: state.explode ? 0 : 0.5 }); fit(); },
  ",": () => set({ at: state.at - 0.02 }), ".": () => set({ at: state.at + 0.02 }),
  "+": () => set({ zoom: state.zoom * 1.2 }), "=": () => set({ zoom: state.zoom * 1.2 }), "-": () => set({ zoom: state.zoom / 1.2 }),
  "[": () => set({ frame: Math.ceil(state.frame) - 1 }), "]": () => set({ frame: Math.floor(state.frame) + 1 }),
  Escape: () => set({ from: "", to: "", measure: false }),
};

addEventListener("keydown", e => {
  if (!scene || e.ctrlKey || e.metaKey || e.altKey || ["SELECT", "SUMMARY"].includes(e.target.tagName) || e.target.type === "number") return;
  const moves = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }, letter = e.key.toLowerCase();
  const name = Object.keys(SWITCHES).find(each => SWITCHES[each][0] === e.key);
  if (moves[e.key]) {
    if (e.target.type === "range") return;
    const [x, y] = moves[e.key];
    if (e.shiftKey) pan(20 * x, -20 * y); else set({ azimuth: state.azimuth - 5 * x, elevation: state.elevation - 5 * y });
  } else if (e.key === " ") {
    if (scene.frames.length < 2 || e.target.tagName === "BUTTON" || e.target.type === "checkbox") return;
    toggle();
  } else if (ACTIONS[e.key]) ACTIONS[e.key]();
  else if (VIEWS[letter]) look(letter, e.key !== letter);
  else if (["x", "y", "z"].includes(e.key)) set({ section: state.section === e.key ? "" : e.key });
  else if (modes()[e.key - 1]) set({ mode: modes()[e.key - 1], scale: 0 });
  else if (name) set({ [name]: !state[name] });
  else return;
  e.preventDefault();
});

steer({ fit, zoom: zoomAt, move: pan, turn: (dx, dy) => set({ azimuth: state.azimuth - dx, elevation: state.elevation + dy }), hover: e => { if (scene) point(e); },
  click: e => pick(e.offsetX, e.offsetY), leave: () => { $("tip").hidden = true; if (hovered) { hovered = null; redraw(); } } });
$("fit").onclick = fit;
for (const key of "tvs") $(VIEWS[key][0]).onclick = () => look(key);
$("theme").onclick = ACTIONS.d;
$("save").onclick = save;
$("turned").onclick = ACTIONS.i;
$("back").onchange = e => set({ back: e.target.checked });
$("mode").onchange = e => set({ mode: e.target.value, scale: 0 });
$("section").onchange = e => set({ section: e.target.value });
for (const [id, name] of [["scale-high", "scale"], ["thin", "thin"]]) $(id).oninput = e => set({ [name]: Math.max(Number(e.target.value), 0) });
for (const name of ["at", "explode", "angle"]) $(name).oninput = e => set({ [name]: Number(e.target.value) });
$("explode").onchange = () => fit();
$("slider").oninput = e => { playing = false; set({ frame: Number(e.target.value) }); };
$("run").onclick = toggle;
addEventListener("resize", () => { if (scene) fitted ? fit() : redraw(); });
addEventListener("hashchange", () => { if (scene) { const placed = recall(location.hash.slice(1)); placed ? set({ zoom: state.zoom }) : fit(); } });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

function present(data) {
  const first = !scene, before = scene;
  scene = read(data);
  if (first) {
    if (data.plane) Object.assign(state, { azimuth: -90, elevation: 90 });
    if (data.curve) state.net = true;
    defaults = { ...state };
  }
  const isPlaced = first && recall(location.hash.slice(1));
  $("panel").hidden = false;
  if (!scene.quick) offered = modes();
  if (data.numbers) offerNumbers(data.numbers);
  version += 1;
  made.clear();
  $("title").textContent = scene.name;
  $("working").hidden = !scene.quick;
  $("working").textContent = `${scene.quick}: what was asked for follows …`;
  $("facts").textContent = scene.quick || scene.facts;
  $("measures").replaceChildren(...scene.measures.flatMap(([name, text]) => [["dt", name], ["dd", text]].map(([tag, own]) => Object.assign(document.createElement(tag), { textContent: own }))));
  $("remarks").replaceChildren(...scene.remarks.map(text => Object.assign(document.createElement("li"), { textContent: text })));
  const others = Object.keys(scene.absent).filter(name => !modes().includes(name));
  if (!scene.quick || first) $("mode").replaceChildren(...modes().map(name => new Option(MODES[name], name)), ...(scene.quick ? [] : others).map(name =>
    Object.assign(new Option(`${MODES[name]}: ${scene.absent[name]}`, name), { disabled: true })));
  $("mode").hidden = $("sections").hidden = scene.curve;
  const there = { patches: scene.groups.length > 1 && !scene.curve, net: !!scene.frames[0].net, knots: scene.spots.length > 0,
    edges: scene.lines.border.length > 0, hidden: scene.lines.border.length > 0 && !scene.curve, open: scene.lines.open.length > 0, folds: scene.lines.folds.length > 0, axes: true, names: scene.middles.length > 0, measure: scene.frames.length < 2 };
  for (const name of Object.keys(SWITCHES)) $(name).parentElement.classList.toggle("off", !there[name]);
  $("apart").hidden = scene.groups.length < 2 || scene.curve;
  $("play").hidden = scene.frames.length < 2;
  $("slider").max = scene.frames.length - 1;
  if (first) isPlaced ? set({ zoom: state.zoom }) : (show(), fit());
  else {
    const own = !fitted;   // where the user has put it, it stays
    set(placed(before));
    if (!own && (strays() || isBeside())) fit();
    else if (!own) fitted ||= "before";
  }
}

function placed(before) {   // as large as before, and in the same place, unless it is much larger or smaller
  const ratio = scene.size / before.size;
  if (!(ratio > 0.3 && ratio < 3) || before.plane !== scene.plane) return {};
  const moved = axes().map(row => row.reduce((sum, x, i) => sum + x * (scene.middle[i] - before.middle[i]), 0) / before.size * 0.875 * state.zoom);
  return ratio === 1 && !moved[0] && !moved[1] ? {} : { zoom: state.zoom * ratio, panX: state.panX + moved[0], panY: state.panY + moved[1] };
}

function complain(text) {
  if (text) $("working").hidden = true;
  $("error").hidden = !text;
  $("error").textContent = text || "";
  $("error").scrollTop = 0;
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
  if (innerWidth < 560) $("panel").open = false;
  const data = JSON.parse($("data").textContent);
  if (data.given) Object.assign(chosen, data.given);
  if (data.frames) present(data);
  else $("working").hidden = false;
  complain(data.error);
  if (data.watch !== undefined) watch(data.watch);
}
