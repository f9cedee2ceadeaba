// A page of `gtb view --watch`: it follows a spec, with sliders for its numbers. It asks for pictures with others, and never writes the file.

const chosen = {};   // numbers that differ from those of the file, as for --set
let onOffer = [], turnedAt = -Infinity, wake = () => {}, running = null, doubted = 0;   // a version with an error that is not shown yet

const isTurning = () => performance.now() - turnedAt < 400;
const isQuick = () => isTurning() || doubted || !$("error").hidden;   // an error goes as soon as the file can be read
const asked = () => (isQuick() ? "&quick=1" : "") + Object.entries(chosen).map(([name, value]) => `&set=${encodeURIComponent(`${name}=${value}`)}`).join("");

function asking() {   // a signal that ends a slow answer when a slider moves
  running = { control: new AbortController(), quick: isQuick() };
  return running.control.signal;
}

function pause(milliseconds) {   // or until a slider moves, also if it has done so since the last question
  if (pause.missed) { pause.missed = false; return Promise.resolve(); }
  return new Promise(done => { wake = done; setTimeout(done, milliseconds); }).finally(() => { wake = () => { pause.missed = true; }; pause.missed = false; });
}

function turned() {
  turnedAt = performance.now();
  if (running && !running.quick) running.control.abort();
  showNumbers();
  wake();
}

function turn(name, text) {
  const own = onOffer.find(each => each.name === name), value = +Number(text).toPrecision(12);
  if (!text || !Number.isFinite(value) || value === own.value) delete chosen[name]; else chosen[name] = value;
  turned();
}

function offerNumbers(numbers) {
  const text = JSON.stringify(numbers);
  if (text !== offerNumbers.before) {
    offerNumbers.before = text;
    onOffer = numbers;
    for (const name of Object.keys(chosen)) if (!numbers.some(each => each.name === name)) delete chosen[name];
    $("numbers").hidden = !numbers.length;
    $("sliders").replaceChildren(...numbers.map(({ name, low, high, step, label }) => {
      const row = document.createElement("p"), title = document.createElement("b"), note = document.createElement("small");
      title.textContent = name;
      note.textContent = label;
      const [field, slider] = [{ type: "number", step: "any" }, { type: "range", min: low, max: high, step }].map(kind =>
        Object.assign(document.createElement("input"), kind, { ariaLabel: `${name} ${label}`, oninput: e => turn(name, e.target.value) }));
      row.dataset.name = name;
      row.append(title, field, ...(label ? [note] : []), slider);
      return row;
    }));
  }
  showNumbers();
}

function showNumbers() {
  for (const row of $("sliders").children) {
    const { name, value } = onOffer.find(each => each.name === row.dataset.name), now = Number(chosen[name] ?? value);
    row.classList.toggle("turned", name in chosen);
    for (const input of row.querySelectorAll("input")) if (input !== document.activeElement || Number(input.value) !== now) input.value = +now.toPrecision(6);
  }
  $("reset").disabled = $("options").disabled = $("edits").disabled = !Object.keys(chosen).length;
  if (!$("said").hidden) $("said").textContent = said();
}

const options = () => Object.entries(chosen).map(([name, value]) => `--set ${name}=${value}`).join(" ");

function edits() {   // the lines of the file that would make this, with their numbers
  const lines = new Map();
  for (const { name, line, text } of onOffer) if (name in chosen) {
    const value = new RegExp(`(^|[\\s{,"])(${name}"?\\s*[=:]\\s*)("[^"]*"|'[^']*'|[^\\s,}#]+)`);
    lines.set(line, (lines.get(line) ?? text).replace(/ {3,}/g, "  ").replace(value, (_, start, head) => start + head + chosen[name]));
  }
  return [...lines].sort((a, b) => a[0] - b[0]).map(([line, text]) => `${line}: ${text}`).join("\n");
}

let said = options;
function say(what) {
  said = what;
  $("said").hidden = false;
  $("said").textContent = said();
}

$("reset").onclick = () => { for (const name of Object.keys(chosen)) delete chosen[name]; $("said").hidden = true; turned(); };
$("options").onclick = () => { say(options); navigator.clipboard?.writeText(options()).catch(() => { /* it stands there to be copied */ }); };
$("edits").onclick = () => say(edits);

// While `gtb view --watch` runs, it is asked four times a second whether there is something new, and while a slider
// moves, at once and for a quick picture. An error is shown if it is still there the next time: a file that is being
// written is empty, or cut, for a moment.
async function watch(have) {
  for (;;) {
    await pause(250);
    let news;
    try { news = await (await fetch(`state?have=${have}${asked()}`, { signal: asking() })).json(); }
    catch (error) { if (error.name !== "AbortError") complain("gtb view has ended: the page shows what it had last."); continue; }
    if (news.version === have) { if ($("error").textContent.startsWith("gtb view has ended")) complain(news.error); continue; }
    if (news.error && !isTurning() && news.version !== doubted) { doubted = news.version; continue; }
    doubted = 0;
    have = news.version;
    complain(news.error);
    if (news.data) present(news.data);
  }
}
