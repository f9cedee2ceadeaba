// All limits of a patch: of the page's cells, those of one limit are shown, chosen by slider, keys or small pictures.

let limits = null, everything = null;

function rowsOf(values, width, ranges) {   // those rows of an array, one range after the other
  const made = new values.constructor(ranges.reduce((count, [a, b]) => count + b - a, 0) * width);
  let at = 0;
  for (const [a, b] of ranges) { made.set(values.subarray(a * width, b * width), at); at += (b - a) * width; }
  return made;
}

function choose(number) {
  const k = clamp(Math.round(number), 0, limits.list.length - 1), { cells, absent, dimension } = limits.list[k];
  const parts = cells.map(c => limits.cells[c]), ranges = kind => parts.map(part => part.rows[kind]);
  let end = 0;
  scene.groups = cells.map((c, n) => [everything.groups[c][0], end, end += parts[n].rows.cells[1] - parts[n].rows.cells[0]]);
  scene.centres = cells.map(c => everything.centres[c]);
  scene.cells = rowsOf(everything.cells, scene.curve ? 2 : 3, ranges("cells"));
  const pairs = new Map(parts.flatMap(part => part.net).map(pair => [`${pair}`, pair]));
  scene.lines = { ...everything.lines, net: Uint32Array.from([...pairs.values()].flat()) };
  for (const kind of ["border", "folds"]) {
    const rows = scene.lines[kind] = rowsOf(everything.lines[kind], 4, ranges(kind));
    for (let i = 2; i < rows.length; i += 4) rows[i] = rows[i + 1] = cells.indexOf(rows[i]);   // the group of the line
  }
  scene.spots = rowsOf(everything.spots, 3, ranges("knots"));
  scene.knots = { ...everything.knots, names: ranges("knots").flatMap(([a, b]) => everything.knots.names.slice(a, b)) };
  version += 1;
  $("facts").textContent = `Limit ${k} of ${limits.list.length}, numbered from 0 as by ${limits.command}: ${cells.length} ${cells.length > 1 ? "cells" : "cell"}; `
    + `${absent.length ? `no cell has knot ${absent.join(", ")}` : "all knots used"}; liftings of dimension ${dimension}`;
  $("limit").value = k;
  $("limit-number").textContent = k;
  const shown = clamp(Math.floor((innerWidth - 60) / 74), 1, 9), first = clamp(k - (shown >> 1), 0, Math.max(limits.list.length - shown, 0));
  $("limit-pictures").replaceChildren(...limits.list.slice(first, first + shown).map((_, n) => small(first + n, first + n === k)));
  set({ limit: k });
}

function small(number, chosen) {   // a picture of a decomposition, to click on
  const { cells, absent, heights } = limits.list[number], button = document.createElement("button");
  const places = limits.knots.map(([x, y], i) => [4 + 52 * x, 56 - 52 * (heights.length ? heights[i] : y)]);
  const outline = (c, n) => `<polygon points="${limits.cells[c].polygon.map(i => places[i].join()).join(" ")}" fill="${COLOURS[n % COLOURS.length]}"/>`;
  const spot = ([x, y], i) => `<circle cx="${x}" cy="${y}" r="2.2" fill="${absent.includes(i) ? "#fff" : "#23282d"}"/>`;
  button.innerHTML = `<svg width="60" height="60" style="background:#fbfbfa;border-radius:4px" stroke="#23282d" stroke-linejoin="round">${cells.map(outline).join("")}${places.map(spot).join("")}</svg>`;
  button.title = `limit ${number}`;
  button.style.cssText = `padding:1px;background:none;border-radius:6px;cursor:pointer;border:2px solid ${chosen ? "var(--accent)" : "transparent"}`;
  button.onclick = () => choose(number);
  return button;
}

function offer() {   // the card with which a limit is chosen
  const card = document.createElement("div");
  card.className = "card";
  card.id = "limits";
  card.style.cssText = "left:50%;bottom:14px;transform:translateX(-50%);display:grid;gap:4px;max-width:calc(100% - 24px)";
  card.innerHTML = `<div id="limit-pictures" style="display:flex;justify-content:center"></div>
    <label style="display:flex;gap:8px;align-items:center">Limit <input id="limit" type="range" min="0" step="1" style="flex:1;min-width:0;accent-color:var(--accent)">
    <output id="limit-number" style="min-width:2.5em;text-align:right"></output></label>`;
  document.body.append(card);
  $("limit").oninput = e => choose(Number(e.target.value));
  addEventListener("keydown", e => {
    const step = { "[": -1, "]": 1 }[e.key];
    if (step && !e.ctrlKey && !e.metaKey && !e.altKey) choose(state.limit + step);
  });
}

present = (shown => data => {
  shown(data);
  limits = data.limits;
  if (!limits) return;
  everything = { ...scene };
  if (!$("limits")) offer();
  $("limit").max = limits.list.length - 1;
  choose(state.limit);
})(present);
