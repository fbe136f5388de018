
// ------------------------------------------------------------------------------------------------- numbers and sliders
const list = solver.parameters, own = list.map((one) => one.value), values = own.slice(), rows = [];
const written = (value, digits = 6) => {
  if (Number.isNaN(value)) return "\u2013";
  const short = Number(value.toPrecision(digits)), size = Math.abs(short);
  return size && (size < 1e-3 || size >= 1e6) ? short.toExponential().replace("+", "") : String(short);
};
const printed = (unit) => unit.replace(/\bum\b/g, "\u00b5m").replaceAll("*", "\u00b7").replace(/\^2(?![.\d])/g, "\u00b2").replace(/\^3(?![.\d])/g, "\u00b3");
const shownValue = (k) => written(values[k] / list[k].factor);
const quantity = (k, digits = 12) => `${written(values[k] / list[k].factor, digits)}${list[k].unit && ` ${list[k].unit}`}`;
const changed = (k) => values[k] !== own[k];
const STEPS = 200;
const toSlider = ({ low, high, log }, value) => STEPS * (log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
// Of three digits, so that it is a number that people write.
const fromSlider = ({ low, high, log, factor }, place) => {
  const share = place / STEPS, value = log ? low * (high / low) ** share : low + (high - low) * share;
  return Math.min(Math.max(factor * Number((value / factor).toPrecision(3)), low), high);
};

function makeRow(k) {
  const one = list[k], row = element(get("rows"), "div", "", { class: "row", "data-name": one.name });
  element(row, "label", one.words, { for: `value${k}`, title: one.name });
  const range = element(row, "input", "", { type: "range", min: 0, max: STEPS, step: 1, "aria-label": one.words });
  const field = element(row, "input", "", { type: "number", step: "any", id: `value${k}` });
  element(row, "span", printed(one.unit), { class: "unit" });
  const back = element(row, "button", "\u21ba", { type: "button", title: "back to the scene's number", "aria-label": `reset ${one.words}` });
  range.addEventListener("change", keepAddress); // not at every step of the slider: browsers limit how often
  range.addEventListener("input", () => change(k, fromSlider(one, range.value)));
  field.addEventListener("change", () => { if (field.value !== "") change(k, one.factor * Number(field.value)); else show(); keepAddress(); });
  back.addEventListener("click", () => { change(k, own[k]); keepAddress(); });
  const show = () => {
    // a slider that is moved stays where it is, though its number is rounded
    if (fromSlider(one, range.value) !== values[k]) range.value = toSlider(one, values[k]);
    set(range, { "aria-valuetext": `${shownValue(k)} ${one.unit}` });
    if (document.activeElement !== field || Number(field.value) !== Number(shownValue(k))) field.value = shownValue(k);
    row.classList.toggle("changed", changed(k));
    back.style.visibility = changed(k) ? "visible" : "hidden";
  };
  rows[k] = { row, show };
  show();
}

function change(k, value) {
  values[k] = value;
  rows[k]?.show();
  ask();
}

// Rows of what was searched, else of what comes first and of what is changed.
function listRows() {
  const words = get("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  const order = list.map((_, k) => k).sort((a, b) => (list[a].first ?? 1e6 + a) - (list[b].first ?? 1e6 + b));
  const found = order.filter((k) => (words.length ? words.every((word) => `${list[k].name} ${list[k].words}`.toLowerCase().includes(word)) : list[k].first !== null || changed(k)));
  get("rows").replaceChildren();
  rows.length = 0;
  found.slice(0, 60).forEach(makeRow);
  get("more").textContent = words.length ? `${found.length} of ${list.length} numbers` : `${list.length} numbers in all: search them by word or name`;
}

// ------------------------------------------------------------------------------------------------------------- address
const isNumber = new Map(list.map((one, k) => [one.name, k]));
function keepAddress() {
  const asked = new URLSearchParams(location.hash.slice(1));
  for (const [name, k] of isNumber) if (changed(k)) asked.set(name, quantity(k)); else asked.delete(name);
  history.replaceState(null, "", `#${asked}`);
}
function readAddress() {
  const asked = new URLSearchParams(location.hash.slice(1)), faults = [];
  own.forEach((value, k) => { values[k] = value; });
  for (const [name, text] of asked) {
    if (!name.includes(".")) continue; // an angle, a time or a bearing
    const k = isNumber.get(name), [, number, unit] = text.match(/^\s*([-+0-9.eE]+)\s*(.*)$/) ?? [];
    if (k === undefined) faults.push(`${name}: this scene has no such number.`);
    else if (!Number.isFinite(Number(number)) || unit !== list[k].unit) faults.push(`${name}: ${text} was given. Allowed: a number in ${list[k].unit || "1"}, as in ${quantity(k)}.`);
    else values[k] = Number(number) * list[k].factor;
  }
  listRows();
  return faults.join("\n");
}

// -------------------------------------------------------------------------------------------------------------- results
const turnsTo = (run, time) => (solver.rows ? Math.abs(angleOf(run, [time]) - angleOf(run, [0])) / TURN : time / run.turn);
const degrees = (run, time) => `at ${((((angleOf(run, [time]) / DEGREE) % 360) + 360) % 360).toFixed(1)}\u00b0 of turn ${Math.floor(turnsTo(run, time) + 1e-9) + 1}`;

// The last whole turns after which loads repeat, from a whole turn on, as native runs take them; null where there are none.
function wholeCycles(run) {
  const near = 1e-9, [first, last] = [run.nodes[0], run.nodes.at(-1)].map(([time]) => turnsTo(run, time));
  for (const end of solver.rows ? [last] : [last, Math.floor(last + near)]) {
    const count = solver.shown * Math.floor((end - first) / solver.shown + near), begin = end - count;
    const edge = solver.rows ? first : Math.round(begin);
    if (count > 0 && Math.min(Math.abs(begin - first), Math.abs(begin - edge)) < near * Math.max(last, 1)) {
      return { count, nodes: run.nodes.filter(([time]) => turnsTo(run, time) > begin - near && turnsTo(run, time) < end + near) };
    }
  }
  return null;
}

// Rows of the table: key, words, unit, value, where.
function resultsOf(run) {
  const found = [], measures = [], series = [], forces = [];
  const rest = (key, words, unit, value) => found.push({ key, words, unit, value });
  const shortly = (words) => { found.at(-1).short = words; }; // in the line above the sliders
  const peak = (key, words, unit, measure) => {
    found.push({ key, words, unit, place: measures.length });
    measures.push(measure);
    series.push(measured(run, measure));
    return series.at(-1);
  };
  solver.bearings.forEach((bearing, k) => {
    const name = numbers.bearings[k].name, of = name && ` of ${name}`, id = name && `${name}.`;
    forces.push(measures.length);
    const force = peak(`${id}peak_ball_force`, `Highest ${numbers.bearings[k].noun} force${of}`, "N", (row) => { let most = -Infinity; for (const column of bearing.force) if (row[column] > most) most = row[column]; return most; });
    rest(`${id}rms_ball_force`, `Rms of the force on the most loaded ${numbers.bearings[k].noun}${of}`, "N", rms(run, force));
    const life = bearing.life ? lifeOf(run, bearing) : 0;
    if (life) found.push({ key: `${id}life`, words: `Rating life${of}, 90 % of such bearings run longer`, unit: "h", value: life, digits: 3, short: `life${of}` });
    if (bearing.load) rest(`${id}rms_load`, `Rms of the load on the ring${of}`, "N", rms(run, peak(`${id}peak_load`, `Highest load on the ring${of}`, "N", (row) => length(loadOf(run, bearing, row)))));
    peak(`${id}peak_motion`, `Furthest that the rings are apart${of}`, "\u00b5m", (row) => length(motionOf(bearing, row)));
    shortly(`rings apart${of}`);
    const parts = [0, 1].map((axis) => measured(run, (row) => motionOf(bearing, row)[axis])), middle = parts.map((part) => mean(run, part));
    rest(`${id}rms_motion`, `Rms of their motion about its mean${of}`, "\u00b5m", rms(run, parts[0].map((x, n) => Math.hypot(x - middle[0], parts[1][n] - middle[1]))));
  });
  if (solver.linkage && !solver.bearings.length) numbers.linkage.forces.forEach(({ name, words }, k) => {
    const source = solver.linkage.forces[k];
    if (source.columns) peak(`peak_${name}`, `Highest force in joint ${words}`, "N", (row) => length(source.columns.map((column) => row[column])));
  });
  if (solver.torque !== null) {
    peak("peak_torque", "Highest drive torque, either way", "N\u00b7m", (row) => Math.abs(row[solver.torque]));
    shortly("torque");
    if (run.speed && solver.angle === null) {
      const part = wholeCycles(run), torque = part && measured(part, (row) => row[solver.torque]), angles = part && part.nodes.map((row) => angleOf(run, row));
      rest("drive_work", "Work of the drive in a turn", "J", part ? torque.reduce((sum, now, k) => sum + (k ? 0.5 * (now + torque[k - 1]) * (angles[k] - angles[k - 1]) : 0), 0) / part.count : NaN);
    }
  }
  const tops = peaks(run, measures, series);
  // of ball forces the highest of any step, which samples may miss by far
  solver.bearings.forEach((bearing, k) => { if (run.tops[k].value > tops[forces[k]].value) tops[forces[k]] = run.tops[k]; });
  return found.map((one) => (one.place === undefined ? one : { ...one, value: tops[one.place].value,
    where: run.speed && solver.angle === null ? degrees(run, tops[one.place].time) : `at ${(1e3 * tops[one.place].time).toFixed(2)} ms` }));
}

const difference = (now, old) => {
  if (Object.is(now, old)) return "\u2013";
  const ratio = now / old, share = 100 * (now - old) / Math.abs(old);
  if (!Number.isFinite(share)) return "new";
  if (ratio >= 10) return `\u00d7${written(ratio, 3)}`;
  if (ratio > 0 && ratio <= 0.01) return `\u00f7${written(1 / ratio, 3)}`;
  return `${share > 0 ? "+" : "\u2212"}${written(Math.abs(share), 3)} %`;
};

function showResults(results, olds) {
  const body = get("results").tBodies[0];
  body.replaceChildren();
  results.forEach((one, k) => {
    const row = element(body, "tr");
    element(row, "td", `${one.words}${one.where ? `, ${one.where}` : ""} [${one.unit}]`);
    const digits = one.digits ?? 5;
    element(row, "td", written(one.value, digits), { "data-result": one.key, "data-value": one.value });
    element(row, "td", written(olds[k].value, digits));
    element(row, "td", difference(one.value, olds[k].value));
  });
  const one = results[0];
  get("sum").replaceChildren();
  if (!one) return;
  element(get("sum"), "span", `${one.words} `);
  element(get("sum"), "b", `${written(one.value, 4)} ${one.unit}`);
  element(get("sum"), "span", one.value === olds[0].value ? " (numbers of the scene)" : `, ${difference(one.value, olds[0].value)} against the scene`);
  const more = element(get("sum"), "div", "", { class: "more" });
  results.forEach((row, k) => { if (row.short && more.childElementCount < 3) element(more, "span", `${row.short} ${written(row.value, 3)} ${row.unit}${row.value === olds[k].value ? "" : `, ${difference(row.value, olds[k].value)}`}`); });
}

// ------------------------------------------------------------------------------------------------------- more pictures
let current = null, scene = null; // runs: what is shown, and that of the scene's own numbers

function drawOrbit(bearing, number) {
  if (!bearing || !current) return null;
  const section = element(get("charts"), "section", "", { class: "orbit" });
  element(section, "h2", "Orbit of the inner ring against the outer [\u00b5m]");
  const picture = draw(section, "svg", { viewBox: "-60 -60 120 120", role: "img", "aria-label": "orbit of the inner ring" });
  const orbits = [bearing, before((run) => run.bearings[number])].filter(Boolean).map(({ inner }) => inner.map(all)), limit = 1e6 * bearing.gap;
  const unit = 50 / highest(orbits.map(([xs, ys]) => highest(xs.map((x, k) => length([x, ys[k]])))).concat(Math.abs(limit)));
  const [now, old] = orbits.map(([xs, ys]) => traced(xs.map((x) => unit * x), ys.map((y) => -unit * y)));
  for (const [x, y] of [[1, 0], [0, 1]]) draw(picture, "line", { x1: -56 * x, x2: 56 * x, y1: -56 * y, y2: 56 * y, stroke: "var(--grid)", "stroke-width": 0.5 });
  if (limit > 0) draw(picture, "circle", { r: limit * unit, fill: "none", stroke: "var(--soft)", "stroke-width": 0.4, "stroke-dasharray": "2 1.5" });
  if (old) draw(picture, "polyline", { points: old, fill: "none", stroke: "var(--soft)", "stroke-width": 0.5, "stroke-dasharray": "1 1" });
  draw(picture, "polyline", { points: now, fill: "none", stroke: "var(--ink)", "stroke-width": 0.8, "stroke-linejoin": "round" });
  const dot = draw(picture, "circle", { r: 1.8, fill: "var(--signal)" });
  for (const value of ticks(0, 56 / unit).slice(1)) draw(picture, "text", { x: value * unit, y: 5.4, "font-size": 4.8, "text-anchor": "middle" }, value);
  element(section, "p", `${limit > 0 ? "dashed circle: gap between the rings; " : ""}equal scales${compared ? "; dotted: the scene's numbers" : ""}`);
  return (k) => set(dot, { cx: at(bearing.inner[0], k) * unit, cy: -at(bearing.inner[1], k) * unit });
}

function drawLoad(bearing, number) {
  if (!bearing?.load || !current) return null;
  const old = before((run) => run.bearings[number].load);
  return drawChart("Load on the inner ring", "N", [{ signal: bearing.load[0], before: old?.[0], name: "solid: x" },
    { signal: bearing.load[1], before: old?.[1], colour: "var(--signal)", dashes: "5 3", name: "dashed: y" }]);
}

// Amplitudes of the rings' motion at whole parts of the record's frequency, as far as 40 a turn; Hann's window where turns hold no whole period.
function spectrumOf(run, number) {
  const bearing = solver.bearings[number], turns = run.turn < Infinity ? Math.min(Math.floor((run.rows.at(-1)[0] - run.rows[0][0]) / run.turn + 1e-6), 4) : 0;
  const size = turns ? Math.round(turns * run.turn / run.whole * run.parts) : run.rows.length - 1, from = run.rows.length - 1 - size, lines = Math.min(40 * (turns || 5), Math.floor(size / 2)), hann = !solver.linkage;
  const motion = run.rows.slice(from, from + size).map((row) => motionOf(bearing, row));
  const middle = [0, 1].map((axis) => motion.reduce((sum, one) => sum + one[axis], 0) / size);
  const [xs, ys] = [0, 1].map((axis) => Float64Array.from(motion, (one, k) => (one[axis] - middle[axis]) * (hann ? 1 - Math.cos(TURN * k / size) : 1)));
  const step = run.parts / (size * run.whole);
  return Array.from({ length: lines }, (_, n) => {
    const turnBy = TURN * (n + 1) / size, [c, s] = [Math.cos(turnBy), Math.sin(turnBy)];
    let re = 1, im = 0, xr = 0, xi = 0, yr = 0, yi = 0;
    for (let k = 0; k < size; k += 1) {
      xr += xs[k] * re; xi += xs[k] * im; yr += ys[k] * re; yi += ys[k] * im;
      const turned = re * c - im * s;
      im = re * s + im * c;
      re = turned;
    }
    return [(n + 1) * step, 2 / size * Math.hypot(xr, xi, yr, yi)];
  });
}

function drawSpectrum(bearing, number) {
  if (!bearing || !current) return null;
  const [now, old] = [current, compared ? scene : null].map((run) => (run ? (run.spectra ??= [])[number] ??= spectrumOf(run, number) : []));
  const [wide, height, left, right, top, below] = [420, 190, 56, 20, 8, 40], section = element(get("charts"), "section");
  element(section, "h2", "Spectrum of the motion between the rings [\u00b5m]");
  const picture = draw(section, "svg", { viewBox: `0 0 ${wide} ${height}`, class: "chart", role: "img", "aria-label": "spectrum" });
  const most = highest([...now, ...old].map((line) => line[1])), high = Math.ceil(Math.log10(most)), low = high - 4, end = highest(now.map((line) => line[0]));
  const X = (x) => left + x / end * (wide - left - right), Y = (y) => top + Math.min((high - Math.log10(Math.max(y, 1e-300))) / (high - low), 1) * (height - top - below);
  for (let decade = low; decade <= high; decade += 1) {
    draw(picture, "line", { x1: left, x2: wide - right, y1: Y(10 ** decade), y2: Y(10 ** decade), stroke: "var(--grid)" });
    draw(picture, "text", { x: left - 5, y: Y(10 ** decade) + 4, "text-anchor": "end" }, Number((10 ** decade).toPrecision(3)));
  }
  for (const x of ticks(0, end)) draw(picture, "text", { x: X(x), y: height - below + 16, "text-anchor": "middle" }, x);
  draw(picture, "text", { x: (left + wide - right) / 2, y: height - 6, "text-anchor": "middle" }, "frequency [Hz]");
  const stems = (lines, look) => draw(picture, "path", { d: lines.filter(([x]) => x <= end).map(([x, y]) => `M${short(X(x))} ${short(Y(0))}V${short(Y(y))}`).join(""), fill: "none", ...look });
  stems(now, { stroke: "var(--ink)", "stroke-width": 1.4 });
  for (const [x, y] of old.filter((one) => one[0] <= end && one[1] > most * 1e-4)) draw(picture, "circle", { cx: X(x), cy: Y(y), r: 1.7, fill: "none", stroke: "var(--signal)" });
  element(section, "p", `amplitude of both directions together${old.length ? "; rings: the scene's numbers" : ""}`);
  return null;
}
besides.push(drawOrbit, drawLoad, drawSpectrum);

// -------------------------------------------------------------------------------------------------------------- solving
let busy = false, wanted = 0;
function ask() {
  wanted += 1;
  if (!busy) work();
}

// The table has the highest force of all steady turns, which need not be the last one.
const highestDrawn = ({ bearings, peak }) => (bearings.length
  ? `; highest ${bearings[0].noun} force there: ${written(highest(bearings.flatMap((one) => one.force.map((signal) => at(signal, peak)))), 5)} N` : "");

async function work() {
  busy = true;
  while (wanted) {
    wanted = 0;
    get("shown").classList.add("waiting");
    try {
      const began = performance.now(), run = await solve(values, () => wanted > 0);
      if (run === null) continue;
      const warned = warningsOf(run), results = resultsOf(run), solved = performance.now();
      run.results = results;
      scene ??= run;
      if (current && current !== scene) spare.push(...current.blocks);
      current = run;
      const same = values.every((value, k) => value === own[k]), drawn = drawnOf(run);
      if (scene === run) scene.drawn = drawn;
      compared = same ? null : { run: scene.drawn, across: scene.drawn.turning ? all(scene.drawn.angle) : all(scene.drawn.time).map((t) => 1e3 * t) };
      const [place, peaked] = [frame, frame === data.peak];
      frame = peaked ? drawn.peak : place;
      showRun(drawn);
      showResults(results, scene.results);
      get("warned").replaceChildren();
      warned.forEach((words) => element(get("warned"), "p", `warning: ${words}`));
      const [first, second] = [solved - began, performance.now() - solved];
      set(get("took"), { "data-solve": first, "data-draw": second });
      const pictured = !drawn.turning ? "" : ` Pictures show the last ${solver.shown > 1 ? `${solver.shown} turns` : "turn"}${highestDrawn(drawn)}.`;
      get("took").textContent = `Solved in ${first.toFixed(0)} ms, drawn in ${second.toFixed(0)} ms, all in this page.${pictured}`;
      get("fault").hidden = true;
      get("shown").classList.remove("waiting");
    } catch (fault) {
      get("fault").textContent = `The solver says:\n${fault.message}`;
      get("fault").hidden = false; // the pictures are of the numbers before, and look like it
      get("warned").replaceChildren();
    }
  }
  busy = false;
}

// --------------------------------------------------------------------------------------------------------------- doing
const lines = () => list.flatMap((one, k) => (changed(k) ? [`--set ${one.name}=${one.unit ? `"${quantity(k)}"` : quantity(k)}`] : []));
async function hand(text, button) {
  get("text").hidden = false;
  get("text").value = text;
  get("text").select();
  try {
    await navigator.clipboard.writeText(text);
    const words = button.textContent;
    button.textContent = "Copied";
    setTimeout(() => { button.textContent = words; }, 1500);
  } catch { /* a browser may forbid it: the text stands selected */ }
}
get("search").addEventListener("input", listRows);
get("reset").addEventListener("click", () => { own.forEach((value, k) => { values[k] = value; }); keepAddress(); listRows(); ask(); });
get("link").addEventListener("click", (event) => hand(location.href, event.target));
get("lines").addEventListener("click", (event) => hand([`ballpass run ${solver.scene}.toml`, ...lines()].join(" \\\n    "), event.target));
get("csv").addEventListener("click", () => {
  if (!current) return;
  const count = solver.columns.length, text = [solver.columns.map((name, k) => `${name} [${solver.units[k]}]`).join(",")];
  for (const row of current.rows) text.push(row.subarray(0, count).join(","));
  const link = element(document.body, "a", "", { href: URL.createObjectURL(new Blob([text.join("\n"), "\n"], { type: "text/csv" })), download: `${solver.scene}.csv` });
  link.click();
  link.remove();
});

async function openPage() {
  document.body.classList.toggle("framed", self !== top); // the page around it has a title
  listRows();
  try {
    await loadSolver();
  } catch (fault) {
    get("fault").textContent = `The solver cannot be started in this browser: ${fault.message}`;
    get("fault").hidden = false;
    return;
  }
  const asked = location.hash;
  own.forEach((value, k) => { values[k] = value; });
  wanted = 1;
  await work(); // of the scene's own numbers, which others are compared with
  if (asked.includes(".")) obey();
}
function obey() {
  const fault = readAddress();
  if (fault) { get("fault").textContent = fault; get("fault").hidden = false; } else ask();
}
addEventListener("hashchange", obey);
openPage();
