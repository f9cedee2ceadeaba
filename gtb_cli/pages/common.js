"use strict";
// What all pages share: their canvas, the data in them, programs for the graphics card, the camera of `state`, fingers.
const $ = id => document.getElementById(id);
const canvas = $("view");
const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true, stencil: true });
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

function decoded(text, kind) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new kind(bytes.buffer);
}

function program(vertex, pixel) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, pixel]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const places = {};
  return { use: () => gl.useProgram(made), at: name => places[name] ??= gl.getUniformLocation(made, name) };
}

function axes() {   // unit vectors to the right, upwards, and towards the eye
  const a = state.azimuth * Math.PI / 180, e = state.elevation * Math.PI / 180;
  const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
  return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
}

function extents(clouds) {   // lowest and highest of what is to the right, and of what is upwards, of flat arrays of points
  const [right, up] = axes(), ends = [Infinity, -Infinity, Infinity, -Infinity];
  for (const cloud of clouds) for (let k = 0; k < cloud.length; k += 3) {
    const x = right[0] * cloud[k] + right[1] * cloud[k + 1] + right[2] * cloud[k + 2];
    const y = up[0] * cloud[k] + up[1] * cloud[k + 1] + up[2] * cloud[k + 2];
    ends[0] = Math.min(ends[0], x); ends[1] = Math.max(ends[1], x); ends[2] = Math.min(ends[2], y); ends[3] = Math.max(ends[3], y);
  }
  return ends;
}

// Mouse, wheel and fingers: what they do is up to the page.
function steer({ turn, move, zoom, hover = () => {}, leave = () => {}, click = () => {}, fit }) {
  const fingers = new Map();
  let start = null;
  canvas.addEventListener("pointerdown", e => { canvas.setPointerCapture(e.pointerId); start = fingers.size ? null : e; fingers.set(e.pointerId, e); leave(); canvas.focus(); });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, e => {
    fingers.delete(e.pointerId);
    if (end === "pointerup" && start && e.button === 0 && Math.hypot(e.clientX - start.clientX, e.clientY - start.clientY) < 5) click(e);
    start = null;
  });
  canvas.addEventListener("pointermove", e => {
    const old = fingers.get(e.pointerId);
    if (!old) { if (e.pointerType !== "touch") hover(e); return; }
    const dx = e.clientX - old.clientX, dy = e.clientY - old.clientY;
    if (fingers.size === 2) {
      const other = [...fingers.values()].find(f => f.pointerId !== e.pointerId);
      const was = Math.hypot(old.clientX - other.clientX, old.clientY - other.clientY);
      const is = Math.hypot(e.clientX - other.clientX, e.clientY - other.clientY);
      zoom((old.offsetX + other.offsetX) / 2, (old.offsetY + other.offsetY) / 2, is / Math.max(was, 1));
      move(dx / 2, dy / 2);
    } else if (e.shiftKey || old.buttons & 6) move(dx, dy);
    else turn(dx * 0.4, dy * 0.4);
    fingers.set(e.pointerId, e);
  });
  canvas.addEventListener("pointerleave", leave);
  canvas.addEventListener("contextmenu", e => e.preventDefault());
  canvas.addEventListener("dblclick", fit);
  canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(e.offsetX, e.offsetY, Math.exp(-clamp(e.deltaY, -200, 200) * 0.002)); }, { passive: false });
}
