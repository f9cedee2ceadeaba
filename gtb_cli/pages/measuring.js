// What is under the pointer, and how far two points are apart.

// All vertices as they are seen: pixels from the left and the top, and heights towards the eye.
const seen = () => once("seen", [JSON.stringify(view()), state.frame, canvas.clientWidth, canvas.clientHeight], () => {
  const { now, next, share } = frameNow(), { turn, grow, move } = view(), w = canvas.clientWidth / 2, h = canvas.clientHeight / 2;
  const found = new Float64Array(now.positions.length);
  for (let k = 0; k < found.length; k += 3) {
    const p = [0, 1, 2].map(i => now.positions[k + i] + share * (next.positions[k + i] - now.positions[k + i]));
    const [x, y, z] = turn.map(r => r[0] * p[0] + r[1] * p[1] + r[2] * p[2]);
    found[k] = (1 + x * grow[0] + move[0]) * w; found[k + 1] = (1 - y * grow[1] - move[1]) * h; found[k + 2] = z;
  }
  return found;
});

// What a ray through a pixel meets first: {height, group, corners, shares, point}, or null; on the cut face without corners.
function hit(x, y) {
  if (scene.curve) return null;
  const places = seen(), { cells } = scene, { turn, grow } = view(), { n, d, axis, at } = cutPlane(), { now, next, share } = frameNow();
  const pixels = [grow[0] * canvas.clientWidth / 2, -grow[1] * canvas.clientHeight / 2];
  let best = null, inside = 0;
  scene.groups.forEach(([, start, stop], group) => {
    const shift = shiftOf(group), [sx, sy, sz] = turn.map(r => r[0] * shift[0] + r[1] * shift[1] + r[2] * shift[2]);
    const px = x - sx * pixels[0], py = y - sy * pixels[1];
    for (let k = 3 * start; k < 3 * stop; k += 3) {
      const a = 3 * cells[k], b = 3 * cells[k + 1], c = 3 * cells[k + 2];
      const ax = places[a] - px, bx = places[b] - px, cx = places[c] - px;
      if ((ax > 0 && bx > 0 && cx > 0) || (ax < 0 && bx < 0 && cx < 0)) continue;
      const ay = places[a + 1] - py, by = places[b + 1] - py, cy = places[c + 1] - py;
      if ((ay > 0 && by > 0 && cy > 0) || (ay < 0 && by < 0 && cy < 0)) continue;
      const u = bx * cy - cx * by, v = cx * ay - ax * cy, w = ax * by - bx * ay, area = u + v + w;
      if (!area || u * area < 0 || v * area < 0 || w * area < 0) continue;
      const shares = [u / area, v / area, w / area], height = shares[0] * places[a + 2] + shares[1] * places[b + 2] + shares[2] * places[c + 2] + sz;
      const mean = i => [a, b, c].reduce((sum, p, m) => sum + shares[m] * (now.positions[p + i] + share * (next.positions[p + i] - now.positions[p + i])), 0);
      const point = [0, 1, 2].map(i => mean(i) + shift[i]);
      if (n[0] * point[0] + n[1] * point[1] + n[2] * point[2] > d) continue;
      inside += Math.sign(area);
      if (!best || height > best.height) best = { height, group, corners: [a / 3, b / 3, c / 3], shares, point };
    }
  });
  if (!inside || axis < 0 || !scene.closed || state.explode || Math.abs(turn[2][axis]) < 1e-6) return best;
  const { move } = view(), right = (2 * x / canvas.clientWidth - 1 - move[0]) / grow[0], up = (1 - 2 * y / canvas.clientHeight - move[1]) / grow[1];
  const height = (at - right * turn[0][axis] - up * turn[1][axis]) / turn[2][axis];
  if (best && best.height >= height) return best;
  return { height, group: -1, point: [0, 1, 2].map(i => right * turn[0][i] + up * turn[1][i] + height * turn[2][i]) };
}

// Vertices at which lines end, branch, or turn by more than 30 degrees.
const cornerPoints = () => once("corners", [state.frame], () => {
  const p = frameNow().now.positions, ways = new Map(), { border, open } = scene.lines;
  const add = (v, w) => {
    const way = [0, 1, 2].map(i => p[3 * w + i] - p[3 * v + i]), length = Math.hypot(...way);
    if (!length) return;
    if (!ways.has(v)) ways.set(v, []);
    ways.get(v).push(way.map(x => x / length));
  };
  for (const [rows, width] of scene.curve ? [[scene.cells, 2]] : [[border, 4], [open, 4]])
    for (let k = 0; k < rows.length; k += width) { add(rows[k], rows[k + 1]); add(rows[k + 1], rows[k]); }
  const isCorner = all => all.length !== 2 || all[0].reduce((sum, x, i) => sum + x * all[1][i], 0) > -0.866;
  return [...ways].filter(([, all]) => isCorner(all)).map(([v]) => [...p.subarray(3 * v, 3 * v + 3)]);
});

function nearestOn(lines, x, y) {   // the nearest point of segments on the screen, and how far it is in pixels
  let best = [Infinity, null];
  const { turn, grow, move } = view(), w = canvas.clientWidth / 2, h = canvas.clientHeight / 2;
  const left = p => (1 + (turn[0][0] * p[0] + turn[0][1] * p[1] + turn[0][2] * p[2]) * grow[0] + move[0]) * w - x;
  const top = p => (1 - (turn[1][0] * p[0] + turn[1][1] * p[1] + turn[1][2] * p[2]) * grow[1] - move[1]) * h - y;
  for (let k = 0; k < lines.length; k += 6) {
    const a = lines.subarray(k, k + 3), b = lines.subarray(k + 3, k + 6), ax = left(a), ay = top(a), dx = left(b) - ax, dy = top(b) - ay;
    const t = clamp(-(ax * dx + ay * dy) / (dx * dx + dy * dy || 1), 0, 1), far = Math.hypot(ax + t * dx, ay + t * dy);
    if (far < best[0]) best = [far, [0, 1, 2].map(i => a[i] + t * (b[i] - a[i]))];
  }
  return best;
}

// The point to measure from or to: a corner, else an edge, else a vertex, if one is near, else the surface.
function snap(x, y) {
  const here = hit(x, y), { now, first } = frameNow(), { n, d } = cutPlane();
  const isSeen = p => {
    if (n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > d + 1e-6) return false;
    const [px, py, height] = project(...p), over = hit(px, py);
    return !over || over.height < height + 0.004;
  };
  const near = (points, reach) => points.map(p => [Math.hypot(...[0, 1].map(i => project(...p)[i] - [x, y][i])), p])
    .filter(([far]) => far < reach).sort((a, b) => a[0] - b[0]).map(([, p]) => p).find(isSeen);
  const corner = near(cornerPoints(), 11);
  if (corner) return { kind: "corner", point: corner };
  const lines = scene.curve ? [gather("curve", first, now.positions, scene.cells)]
    : [...["border", "open"].map(name => gather(name, first, now.positions, scene.lines[name])), sectionLines()];
  const [, edge] = lines.map(each => nearestOn(each, x, y)).filter(([far, p]) => far < 8 && isSeen(p)).sort((a, b) => a[0] - b[0])[0] || [];
  if (edge) return { kind: "edge", point: edge };
  if (!here) return null;
  const vertex = here.corners && near(here.corners.map(v => [...now.positions.subarray(3 * v, 3 * v + 3)]), 6);
  return vertex ? { kind: "vertex", point: vertex } : { kind: here.corners ? "surface" : "cut face", point: here.point };
}

// ---- lengths in model units

function lengthText(x) {   // to six digits of the size
  const digits = 5 - Math.floor(Math.log10(scene.size));
  return digits < 0 || digits > 12 ? x.toPrecision(6) : (Math.round(x * 10 ** digits) / 10 ** digits + 0).toString();
}

const inModel = p => p.map((x, i) => scene.middle[i] + x * scene.size);
const pointText = p => inModel(p).map(lengthText).join(",");
function pointOf(text) {   // the place of a point in an address, if it is one
  const p = text.split(",").map(Number);
  return p.length === 3 && p.every(Number.isFinite) && text ? p.map((x, i) => (x - scene.middle[i]) / scene.size) : null;
}

function measured() {   // what is between the two chosen points
  const from = pointOf(state.from), to = pointOf(state.to);
  if (!from) return null;
  if (!to) return { from };
  const apart = to.map((x, i) => (x - from[i]) * scene.size);
  return { from, to, apart, distance: Math.hypot(...apart) };
}

let hovered = null;   // what a click would choose

function markMeasure(accent) {
  const found = state.explode ? null : measured(), label = $("length"), spots = [];
  if (found) spots.push(...found.from, ...(found.to || []));
  if (state.measure && hovered) spots.push(...hovered.point);
  const white = [1, 1, 1];
  label.hidden = !(found && found.to);
  if (!label.hidden) {
    const line = new Float32Array([...found.from, ...found.to]), [a, b] = [project(...found.from), project(...found.to)];
    stroke("measure", 0, line, line, accent, 2.4, 0.75, true);
    label.textContent = withUnit(lengthText(found.distance));
    label.style.left = `${(a[0] + b[0]) / 2}px`;
    label.style.top = `${(a[1] + b[1]) / 2}px`;
  }
  if (spots.length) dotted("ends", 0, new Float32Array(spots), new Float32Array(spots), white, accent, 11, 0.8, true);
}

function sayMeasure() {
  const found = state.explode ? null : measured(), lines = [];
  if (state.measure && !(found && found.to)) lines.push(found ? "Click the other point." : "Click two points.");
  if (found) lines.push(`from ${inModel(found.from).map(lengthText).join(", ")}`);
  if (found && found.to) lines.push(`to ${inModel(found.to).map(lengthText).join(", ")}`, withUnit(`distance ${lengthText(found.distance)}`),
    ["dx", "dy", "dz"].map((name, i) => `${name} ${lengthText(found.apart[i])}`).join("  "));
  $("measured").textContent = lines.join("\n");
}

function pick(x, y) {
  const found = state.measure && snap(x, y);
  if (!found) return;
  set(state.from && !state.to ? { to: pointText(found.point) } : { from: pointText(found.point), to: "" });
}

// ---- names and numbers under the pointer

function under(x, y) {
  const { now, next, share } = frameNow(), close = [];
  const look = (points, name) => { for (let k = 0; k < points.length; k += 3) {
    const [a, b] = project(points[k], points[k + 1], points[k + 2]), far = Math.hypot(a - x, b - y);
    if (far < 9) close.push([far, name(k / 3)]);
  } };
  if (state.net && now.net && share === 0 && !state.explode) look(now.net, k => scene.netNames[k] || "");
  if (state.knots && !state.explode) look(scene.spots, k => scene.knots.names[k]);
  if (close.length) return close.sort((a, b) => a[0] - b[0])[0][1];
  const found = hit(x, y), scalar = scene.scalars[state.mode];
  if (!found || !found.corners) return "";
  if (!scalar) return scene.groups[found.group][0];
  const value = found.corners.reduce((sum, v, k) => sum + found.shares[k] * scalar.values[v], 0);
  const text = `${MODES[state.mode]} ${value.toPrecision(4)}`;
  return `${scene.groups[found.group][0]}\n${state.mode === "wall" ? withUnit(text) : text}`;
}

function point(event) {
  const x = event.offsetX, y = event.offsetY, tip = $("tip");
  if (state.measure) { hovered = snap(x, y); redraw(); }
  const text = state.measure ? hovered ? `${hovered.kind}\n${inModel(hovered.point).map(lengthText).join(", ")}` : "" : under(x, y);
  tip.hidden = !text;
  tip.textContent = text;
  tip.style.left = `${Math.min(event.clientX + 14, innerWidth - tip.offsetWidth - 4)}px`;
  tip.style.top = `${Math.min(event.clientY + 14, innerHeight - tip.offsetHeight - 4)}px`;
}
