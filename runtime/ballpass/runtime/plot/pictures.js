"use strict";
// Moves linkage, bearing and cursors of the page to one sample of the run: the slider's, or that of #angle=90 or #time=0.1.
const numbers = JSON.parse(document.getElementById("data").textContent);
const get = (id) => document.getElementById(id), slider = get("frame");
// The run that is shown; of one that it is compared with, dashed behind it: its numbers and its horizontal axis.
let data, frames, last, across, begin, end, compared = null;
function use(run) {
  data = run;
  frames = all(data.time).map((_, k) => k);
  last = frames.length - 1;
  across = data.turning ? all(data.angle) : all(data.time).map((t) => 1e3 * t);
  [begin, end] = [Math.min(across[0], across[last]), Math.max(across[0], across[last])];
}
const all = (signal) => signal.all ??= signal.values.map((value) => value / 10 ** signal.decimals);
const at = (signal, k) => all(signal)[k];
const capital = (word) => word[0].toUpperCase() + word.slice(1);
const pair = (signals, k) => [at(signals[0], k), at(signals[1], k)];
const length = ([x, y]) => Math.sqrt(x * x + y * y); // much faster than Math.hypot
const highest = (values) => values.reduce((most, value) => Math.max(most, value), 1e-12);
const short = (value) => Math.round(1e2 * value) / 1e2; // several times as fast as toFixed
const joined = (places) => places.map(([x, y]) => short(x) + "," + short(y)).join(" ");
// A curve without the points that straight lines between the others pass at less than a twentieth of a unit.
function traced(xs, ys, near = 0.05) {
  const point = (k) => short(xs[k]) + "," + short(ys[k]) + " ", end = xs.length - 1;
  let text = point(0);
  for (let from = 0, next = 1; from < end; text += point(from), next = from + 1) {
    // slopes of lines that begin here and pass all points so far
    let [left, right, below, above] = [-Infinity, Infinity, -Infinity, Infinity];
    for (; next <= end; next += 1) {
      const far = next - from, x = (xs[next] - xs[from]) / far, y = (ys[next] - ys[from]) / far, wide = near / far;
      if (x < left || x > right || y < below || y > above) break;
      [left, right, below, above] = [Math.max(left, x - wide), Math.min(right, x + wide), Math.max(below, y - wide), Math.min(above, y + wide)];
    }
    from = next - 1;
  }
  return text;
}
const set = (node, values) => { for (const [name, value] of Object.entries(values)) node.setAttribute(name, value); };

function draw(parent, kind, attributes, text = "", node = document.createElementNS("http://www.w3.org/2000/svg", kind)) {
  set(node, attributes);
  node.textContent = text;
  parent.append(node);
  return node;
}
const element = (parent, kind, text = "", attributes = {}) => draw(parent, kind, attributes, text, document.createElement(kind));

// An arrow from foot to tip in units of the picture; a short one is left out.
function arrow(parent, colour) {
  const group = draw(parent, "g", { stroke: colour, fill: colour, "stroke-width": 1.1, class: "force" });
  const shaft = draw(group, "line", {}), head = draw(group, "polygon", { stroke: "none" });
  return (foot, tip) => {
    const way = [tip[0] - foot[0], tip[1] - foot[1]], size = length(way);
    set(group, { visibility: size > 0.8 ? "visible" : "hidden" });
    if (size <= 0.8) return;
    const [x, y] = way.map((part) => part / size), long = Math.min(3.6, size), wide = 0.42 * long;
    const neck = [tip[0] - long * x, tip[1] - long * y];
    set(shaft, { x1: foot[0], y1: foot[1], x2: neck[0], y2: neck[1] });
    set(head, { points: joined([tip, [neck[0] - wide * y, neck[1] + wide * x], [neck[0] + wide * y, neck[1] - wide * x]]) });
  };
}

// ------------------------------------------------------------------------------------------------------------ linkage
function drawLinkage(parts) {
  const picture = get("linkage").querySelector("svg"), moves = [], ink = { stroke: "var(--ink)", "stroke-width": 0.45 };
  picture.replaceChildren();
  // Words stand where they cover least: [x, y, half the width, half the height, weight] of what is there.
  let full = [];
  const covered = (box) => full.reduce((sum, one) => (Math.abs(one[0] - box[0]) < one[2] + box[2] && Math.abs(one[1] - box[1]) < one[3] + box[3] ? sum + one[4] : sum), 0);
  const avoid = (one, other, weight = 0.2) => { for (let n = 0; n < 9; n += 1) full.push([...[0, 1].map((axis) => one[axis] + (other[axis] - one[axis]) * n / 8), 0.7, 0.7, weight]); };
  const writer = (size, weight, kind = "") => {
    const label = draw(picture, "text", { "font-size": size, "font-weight": weight, "text-anchor": "middle", class: kind });
    let kept = 0;
    return (at, words, gap) => {
      label.textContent = words;
      if (!words) return;
      const half = [0.31 * size * words.length, 0.6 * size];
      const boxes = [[1, 0], [1, -1], [0, -1], [-1, -1], [-1, 0], [-1, 1], [0, 1], [1, 1]].map(([right, down]) => {
        const far = gap / Math.hypot(right, down);
        return [at[0] + right * (far + half[0]), at[1] + down * (far + half[1]), ...half, 3];
      });
      // beyond the edge of the picture nobody reads them
      const costs = boxes.map((box) => covered(box) + 2 * [0, 1].reduce((sum, axis) => sum + Math.max(0, Math.abs(box[axis]) + box[axis + 2] - 50), 0)), best = costs.indexOf(Math.min(...costs));
      if (costs[best] < costs[kept] - 0.5) kept = best; // words that jump at every step cannot be read
      full.push(boxes[kept]);
      set(label, { x: boxes[kept][0], y: boxes[kept][1] + 0.36 * size });
    };
  };
  moves.push(() => { full = []; });
  const unit = 52 / Math.max(parts.high[0] - parts.low[0], parts.high[1] - parts.low[1], 1e-9);
  const middle = [0, 1].map((axis) => (parts.low[axis] + parts.high[axis]) / 2);
  const places = parts.points.map(([x, y]) => [all(x).map((value) => unit * (value - middle[0])), all(y).map((value) => unit * (middle[1] - value))]);
  const place = (number, k) => [places[number][0][k], places[number][1][k]];
  places.forEach((path) => draw(picture, "polyline", {
    points: traced(...path), fill: "none", stroke: "var(--soft)", "stroke-width": 0.25, "stroke-dasharray": "1 0.8",
  }));
  for (const { guide, block, direction } of parts.guides) {
    const rails = [-3.5, 3.5].map((side) => [side, draw(picture, "line", ink)]), box = draw(picture, "polygon", { fill: "var(--ring)", ...ink });
    const apart = frames.map((k) => [0, 1].map((axis) => place(block, k)[axis] - place(guide, k)[axis]));
    const clear = frames.filter((k) => length(apart[k]) > 0.02 * highest(apart.map(length)));
    const way = (k) => {
      if (direction) return [direction[0], -direction[1]];
      // where both points meet, as in the nearest picture in which they are apart
      const near = clear.reduce((one, other) => (Math.abs(other - k) < Math.abs(one - k) ? other : one), clear[0] ?? k);
      const size = length(apart[near]) || 1;
      return apart[near].map((part) => part / size);
    };
    const from = place(block, 0), along = frames.map((k) => place(block, k).reduce((sum, value, axis) => sum + (value - from[axis]) * way(0)[axis], 0));
    const span = direction ? [-highest(along.map((value) => -value)) - 8, highest(along) + 8] : [-14, 14];
    moves.push((k) => {
      const here = place(block, k), [x, y] = way(k);
      avoid([here[0] - 5 * x, here[1] - 5 * y], [here[0] + 5 * x, here[1] + 5 * y], 0.1);
      const corner = (o, a, b) => [o[0] + a * x - b * y, o[1] + a * y + b * x];
      set(box, { points: joined([[-5, -3.2], [5, -3.2], [5, 3.2], [-5, 3.2]].map(([a, b]) => corner(here, a, b))) });
      for (const [side, rail] of rails) {
        const [a, b] = span.map((far) => corner(direction ? from : here, far, side));
        set(rail, { x1: a[0], y1: a[1], x2: b[0], y2: b[1] });
      }
    });
  }
  for (const pin of parts.pins.filter((one) => one.fixed)) {
    const [x, y] = place(pin.at, 0);
    draw(picture, "polygon", { points: joined([[x, y], [x - 3, y + 4.5], [x + 3, y + 4.5]]), fill: "var(--ring)", ...ink });
    draw(picture, "line", { x1: x - 5, x2: x + 5, y1: y + 4.5, y2: y + 4.5, ...ink });
    moves.push(() => avoid([x, y], [x, y + 5], 0.1));
  }
  for (const [one, other, share] of parts.wheels) {
    for (const [centre, part] of [[one, share], [other, 1 - share]]) {
      const node = draw(picture, "circle", { fill: "none", stroke: "var(--soft)", "stroke-width": 0.4 });
      moves.push((k) => {
        const [[cx, cy], a, b] = [place(centre, k), place(one, k), place(other, k)];
        set(node, { cx, cy, r: Math.abs(part) * length([b[0] - a[0], b[1] - a[1]]) });
      });
    }
  }
  for (const [one, other] of parts.springs) {
    const node = draw(picture, "polyline", { fill: "none", stroke: "var(--soft)", "stroke-width": 0.6, "stroke-linejoin": "round" });
    moves.push((k) => {
      const [a, b] = [place(one, k), place(other, k)], way = [b[0] - a[0], b[1] - a[1]], size = length(way) || 1;
      const bend = (share, side) => [a[0] + share * way[0] - side * way[1] / size, a[1] + share * way[1] + side * way[0] / size];
      const bends = Array.from({ length: 12 }, (_, n) => bend(0.2 + 0.6 * n / 11, n % 11 ? (n % 2 ? 1.2 : -1.2) : 0));
      set(node, { points: joined([a, ...bends, b]) });
      avoid(a, b);
    });
  }
  for (const body of parts.bodies) {
    const ends = body.points.map((number, n) => [number, body.points.at(n - 1)]);
    const node = draw(picture, "polygon", { fill: "var(--bar)", stroke: "var(--bar)", "stroke-width": 2.6, "stroke-linejoin": "round" });
    draw(node, "title", {}, body.name);
    moves.push((k) => {
      set(node, { points: joined(body.points.map((number) => place(number, k))) });
      for (const [one, other] of ends) avoid(place(one, k), place(other, k));
    });
  }
  for (const [number, r, fill] of [...parts.masses.map((one) => [one, 0.7, "var(--soft)"]), ...parts.pins.map((pin) => [pin.at, 1.1, "var(--paper)"]), ...parts.tracers.map((one) => [one, 0.8, "var(--ink)"])]) {
    const node = draw(picture, "circle", { r, fill, ...ink });
    moves.push((k) => { const [cx, cy] = place(number, k); set(node, { cx, cy }); });
  }
  const scale = 19 / highest(parts.forces.flatMap((force) => frames.map((k) => length(pair([force.x, force.y], k)))));
  for (const force of parts.forces) {
    const move = arrow(picture, force.name.startsWith("reaction.") ? "var(--signal)" : "var(--sand)");
    force.end = (k) => {
      const foot = place(force.at, k), [x, y] = pair([force.x, force.y], k), side = force.pushes ? -scale : scale;
      return [foot, [foot[0] + side * x, foot[1] - side * y], length([x, y])];
    };
    moves.push((k) => {
      const [foot, end] = force.end(k);
      move(...(force.pushes ? [end, foot] : [foot, end]));
      avoid(foot, end);
    });
  }
  if (parts.driver !== null && data.torque) {
    const node = draw(picture, "path", { fill: "none", stroke: "var(--torque)", "stroke-width": 1.1 }), head = draw(picture, "polygon", { fill: "var(--torque)" });
    const most = highest(all(data.torque).map(Math.abs)), write = writer(3.3, 600);
    moves.push((k) => {
      const [x, y] = place(parts.driver, k), torque = at(data.torque, k), sense = Math.sign(torque), share = Math.abs(torque) / most, visible = share > 0.02;
      const turn = (angle, r = 6) => [x + r * Math.cos(angle), y - r * Math.sin(angle)], half = sense * (0.35 + 1.75 * share);
      const [from, to, tip] = [-half, half - 0.3 * sense, half + 0.15 * sense].map((angle) => Math.PI / 2 + angle);
      for (const one of [node, head]) set(one, { visibility: visible ? "visible" : "hidden" });
      set(node, { d: `M ${joined([turn(from)])} A 6 6 0 ${Math.abs(to - from) > Math.PI ? 1 : 0} ${sense > 0 ? 0 : 1} ${joined([turn(to)])}` });
      set(head, { points: joined([turn(tip), turn(to, 7.5), turn(to, 4.5)]) });
      if (visible) for (const n of [0, 1, 2, 3]) avoid(turn(from + (to - from) * n / 4), turn(from + (to - from) * (n + 1) / 4), 0.05);
      write([x, y], visible ? `${Math.abs(torque).toPrecision(3)} N\u00b7m` : "", 7.5);
    });
  }
  for (const force of parts.forces) {
    const write = writer(3.3, 600, "force");
    moves.push((k) => {
      const [, end, size] = force.end(k);
      write(end, size * scale > 2 ? `${size.toFixed(0)} N` : "", 1.2);
    });
  }
  const blocks = parts.guides.map((guide) => guide.block);
  for (const name of parts.names) {
    const write = writer(3.6, 400);
    moves.push((k) => write(place(name.at, k), name.text, blocks.includes(name.at) ? 5.5 : 2.1));
  }
  return (k) => moves.forEach((move) => move(k));
}

// ------------------------------------------------------------------------------------------------------------ bearing
const STOPS = [[255, 255, 255], [180, 198, 223], [74, 111, 165], [13, 27, 51]];
function colourOf(share) {
  const scaled = 3 * Math.min(Math.max(share, 0), 1), k = Math.min(Math.floor(scaled), 2);
  return STOPS[k].map((from, channel) => Math.round(from + (scaled - k) * (STOPS[k + 1][channel] - from)));
}

function drawBearing(bearing) {
  const picture = get("rings").querySelector("svg"), ink = { stroke: "var(--ink)", "stroke-width": 0.4 };
  picture.replaceChildren();
  const unit = 41 / (0.5 * bearing.pitch + 0.92 * bearing.ball), r = 0.5 * bearing.ball * unit, wall = 0.84 * r;
  const gap = bearing.factor * bearing.gap / 2 * unit, inside = 0.5 * bearing.pitch * unit - r - gap, outside = inside + 2 * (r + gap);
  const most = highest(bearing.force.flatMap(all));
  draw(picture, "circle", { r: outside + wall, fill: "var(--ring)", ...ink });
  draw(picture, "circle", { r: outside, fill: "var(--panel)", ...ink });
  const inner = draw(picture, "g", {}), middle = { "text-anchor": "middle" };
  draw(inner, "circle", { r: inside, fill: "var(--ring)", ...ink });
  draw(inner, "circle", { r: inside - wall, fill: "var(--paper)", ...ink });
  const balls = bearing.force.map((_, number) => [draw(picture, "circle", { r, stroke: "#101418", "stroke-width": 0.4 }),
    draw(picture, "text", { "font-size": 3.2, ...middle }, number + 1), draw(picture, "text", { "font-size": 3, ...middle })]);
  const push = arrow(picture, "var(--signal)");
  const long = bearing.load && 0.8 * (inside - wall) / highest(frames.map((k) => length(pair(bearing.load, k))));
  get("most").textContent = `${most.toFixed(0)} N`;
  get("magnified").textContent = `Clearance and displacement between the rings \u00d7${bearing.factor}. `
    + `${capital(bearing.noun)}s coloured by ${bearing.words}${bearing.load ? "; arrow: load on the inner ring." : "."}`;
  get("settings").textContent = `Run: ${bearing.settings}.`;
  return (k) => {
    const moved = pair(bearing.inner, k).map((value, axis) => (axis ? -1e-6 : 1e-6) * value * bearing.factor * unit);
    set(inner, { transform: `translate(${moved[0].toFixed(3)} ${moved[1].toFixed(3)})` });
    balls.forEach(([ball, label, words], number) => {
      const angle = at(bearing.ball_angle, k) * Math.PI / 180 + 2 * Math.PI * number / bearing.balls, [x, y] = [Math.cos(angle), -Math.sin(angle)];
      const along = moved[0] * x + moved[1] * y, reach = along + Math.sqrt(Math.max(inside ** 2 - length(moved) ** 2 + along ** 2, 0));
      const radius = (reach + outside) / 2, force = at(bearing.force[number], k), rgb = colourOf(force / most), far = outside + wall + 3.4;
      set(ball, { cx: radius * x, cy: radius * y, fill: `rgb(${rgb})` });
      set(label, { x: radius * x, y: radius * y + 1.1, style: `fill:${rgb[0] + 2 * rgb[1] > 300 ? "#101418" : "#ffffff"}` });
      set(words, { x: far * x, y: far * y + 1 });
      words.textContent = force > 0.02 * most ? force.toFixed(0) : "";
    });
    if (!bearing.load) return;
    const [x, y] = pair(bearing.load, k).map((part) => part * long);
    push([moved[0] - x, moved[1] + y], [moved[0] + x, moved[1] - y]);
  };
}

// ------------------------------------------------------------------------------------------------------------- charts
function ticks(low, high) {
  const raw = (high - low) / 4 || 1, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find((one) => one * power >= raw) * power;
  return Array.from({ length: 8 }, (_, n) => Number(((Math.ceil(low / step - 1e-9) + n) * step).toPrecision(12))).filter((value) => value <= high + 1e-9 * step);
}

function drawChart(title, unit, curves) {
  const [width, height, left, right, top, below] = [420, 190, 56, 20, 8, 40], section = element(get("charts"), "section");
  element(section, "h2", `${title} [${unit}]`);
  const picture = draw(section, "svg", { viewBox: `0 0 ${width} ${height}`, class: "chart", role: "img", "aria-label": title });
  const values = curves.map((curve) => all(curve.signal)), olds = curves.filter((curve) => curve.before).map((curve) => all(curve.before));
  const shown = [...values, ...olds], [low, high] = [-highest(shown.map((some) => highest(some.map((one) => -one)))), highest(shown.map(highest))];
  const X = (x) => left + (x - begin) / (end - begin || 1) * (width - left - right), Y = (y) => top + (high - y) / (high - low) * (height - top - below);
  const places = across.map(X);
  for (const [from, to] of data.windows) {
    for (let turn = Math.floor(begin / 360) - 1; turn * 360 <= end; turn += 1) {
      const [a, b] = [Math.max(from + 360 * turn, begin), Math.min(to + 360 * turn, end)];
      if (b > a) draw(picture, "rect", { x: X(a), width: X(b) - X(a), y: top, height: height - top - below, fill: "var(--shade)" });
    }
  }
  for (const y of ticks(low, high)) {
    draw(picture, "line", { x1: left, x2: width - right, y1: Y(y), y2: Y(y), stroke: y === 0 ? "var(--soft)" : "var(--grid)" });
    draw(picture, "text", { x: left - 5, y: Y(y) + 4, "text-anchor": "end" }, y);
  }
  const step = 90 * Math.ceil((end - begin) / 540), marks = data.turning ? frames.map((k) => step * (Math.ceil(begin / step - 1e-6) + k)).filter((x) => x <= end) : ticks(begin, end);
  for (const x of marks) draw(picture, "text", { x: X(x), y: height - below + 16, "text-anchor": "middle" }, x);
  draw(picture, "text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle" }, data.turning ? `${data.driver} angle [\u00b0]` : "time [ms]");
  olds.forEach((old) => draw(picture, "polyline", {
    points: traced(compared.across.map(X), old.map(Y)), fill: "none", stroke: "var(--soft)", "stroke-width": 1.1, "stroke-dasharray": "2 2",
  }));
  curves.forEach(({ colour = "var(--ink)", wide = 1.5, dashes = "none" }, n) => draw(picture, "polyline", {
    points: traced(places, values[n].map(Y)), fill: "none", stroke: colour, "stroke-width": wide, "stroke-dasharray": dashes,
  }));
  element(section, "p", [...curves.map((curve) => curve.name), olds.length && "dotted: the scene's numbers", data.windows.length && "shaded: an applied load acts"].filter(Boolean).join("; "));
  const cursor = draw(picture, "line", { y1: top, y2: height - below, stroke: "var(--signal)", "stroke-width": 1.6 });
  const follow = (event) => {
    const box = picture.getBoundingClientRect(), x = (event.clientX - box.left) / box.width * width;
    if (event.buttons || event.type === "pointerdown") { stop(); go(nearest((k) => Math.abs(places[k] - x))); }
  };
  for (const kind of ["pointerdown", "pointermove"]) picture.addEventListener(kind, follow);
  return (k) => set(cursor, { x1: places[k], x2: places[k] });
}

// ------------------------------------------------------------------------------------------------- numbers and moving
function writeNumbers(bearing) {
  const rows = [], both = (name, words, signals, unit) => ["x", "y"].forEach((axis, n) => rows.push([`${name}.${axis}`, `${words}, ${axis}`, signals[n], unit]));
  if (bearing) {
    const prefix = bearing.name && `${bearing.name}.`;
    bearing.force.forEach((signal, number) => rows.push([`${prefix}ball.force ${number + 1}`, `force on ${bearing.noun} ${number + 1}`, signal, "N"]));
    both(`${prefix}inner`, "inner ring against outer", bearing.inner, "\u00b5m");
    if (bearing.outer) both(`${prefix}outer`, "outer ring", bearing.outer, "\u00b5m");
    if (bearing.load) both(`${prefix}load`, "load on the inner ring", bearing.load, "N");
  }
  if (data.torque) rows.push(["drive_torque", "drive torque", data.torque, "N\u00b7m"]);
  for (const force of data.linkage?.forces ?? []) both(force.name, force.words, [force.x, force.y], "N");
  get("numbers").replaceChildren();
  return rows.map(([name, words, signal, unit]) => {
    const row = element(get("numbers"), "div");
    element(row, "dt", words);
    const cell = element(row, "dd", "", { "data-quantity": name });
    element(row, "dd", unit, { class: "unit" });
    return (k) => { cell.textContent = at(signal, k).toFixed(Math.max(0, signal.decimals)).replace(/^-(0(\.0*)?)$/, "$1"); };
  });
}

const nearest = (distance) => frames.reduce((best, k) => (distance(k) < distance(best) ? k : best), 0);
let moves = [], frame = 0, playing = 0, moveLinkage = null;
// Of a page: what is drawn besides, each as a function of the bearing that gives what moves with the position.
const besides = [];
// The same signal of the run that is compared with.
const before = (find) => (compared ? find(compared.run) : null);

function build(number) {
  const bearing = data.bearings[number];
  get("charts").replaceChildren();
  moves = data.linkage ? [moveLinkage] : [];
  if (bearing) {
    const worst = bearing.force.map((signal) => highest(all(signal))), top = worst.indexOf(highest(worst));
    const old = before((run) => run.bearings[number]), most = old && old.force.map((signal) => highest(all(signal)));
    moves.push(drawBearing(bearing), drawChart(`${capital(bearing.noun)} forces`, "N", [...bearing.force.map((signal) => ({ signal, colour: "var(--bar)", wide: 0.8 })),
      { signal: bearing.force[top], before: old && old.force[most.indexOf(highest(most))], name: `strong: ${bearing.noun} ${top + 1}, the most loaded; faint: the others` }]));
    moves.push(drawChart("Inner ring against outer", "\u00b5m", [{ signal: bearing.inner[0], before: old?.inner[0], name: "solid: x" },
      { signal: bearing.inner[1], before: old?.inner[1], colour: "var(--signal)", dashes: "5 3", name: "dashed: y" }]));
  }
  if (data.torque) moves.push(drawChart("Drive torque", "N\u00b7m", [{ signal: data.torque, before: before((run) => run.torque) }]));
  moves.push(...besides.map((more) => more(bearing, number)).filter(Boolean), ...writeNumbers(bearing));
  go(frame);
}

function go(k) {
  frame = Math.min(Math.max(k, 0), last);
  const angle = data.angle ? `${data.driver} angle ${(((at(data.angle, frame) % 360) + 360) % 360).toFixed(1)}\u00b0, ` : "";
  get("now").textContent = `${angle}t = ${(1e3 * at(data.time, frame)).toFixed(2)} ms`;
  slider.value = frame;
  set(slider, { "aria-valuetext": get("now").textContent });
  moves.forEach((move) => move(frame));
}

function stop() {
  cancelAnimationFrame(playing);
  [playing, get("play").textContent] = [0, "Play"];
}

function play() {
  if (playing) return stop();
  get("play").textContent = "Pause";
  const first = at(data.time, 0), whole = at(data.time, last) - first, turns = data.turning ? (end - begin) / 360 : 1;
  let t = at(data.time, frame) - first, before = null;
  const step = (now) => {
    t = (t + (before === null ? 0 : whole * (now - before) / (1e3 * turns * get("pace").value))) % whole;
    before = now;
    let k = at(data.time, frame) - first <= t ? frame : 0;
    while (k < last && at(data.time, k + 1) - first <= t) k += 1;
    go(k);
    playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

function follow() {
  const asked = new URLSearchParams(location.hash.slice(1)), named = data.bearings.findIndex((one) => one.name === asked.get("bearing"));
  if (named > 0) { get("bearing").value = named; build(named); }
  const apart = (k) => Math.abs(((at(data.angle, k) - asked.get("angle")) % 360 + 540) % 360 - 180);
  if (asked.has("angle") && data.angle) go(nearest(apart));
  else if (asked.has("time")) go(nearest((k) => Math.abs(at(data.time, k) - asked.get("time"))));
}

// A run in place of the one that is shown, at the same position.
function showRun(run) {
  use(run);
  slider.max = last;
  moveLinkage = data.linkage && drawLinkage(data.linkage);
  build(Number(get("bearing").value));
}

slider.addEventListener("input", () => { stop(); go(Number(slider.value)); });
get("play").addEventListener("click", play);
get("peak").addEventListener("click", () => { stop(); go(data.peak); });
get("bearing").addEventListener("change", () => build(Number(get("bearing").value)));
get("arrows").addEventListener("change", () => document.body.classList.toggle("bare", !get("arrows").checked));
addEventListener("hashchange", () => { stop(); follow(); });
addEventListener("keydown", (event) => {
  const steps = { ArrowLeft: -1, ArrowRight: 1, PageDown: -50, PageUp: 50, " ": 0 }[event.key];
  if (steps === undefined || ["BUTTON", "SELECT", "INPUT", "TEXTAREA", "SUMMARY"].includes(document.activeElement.tagName)) return;
  event.preventDefault();
  if (steps) { stop(); go(frame + steps); } else play();
});
numbers.bearings.forEach((bearing, number) => get("bearing").append(new Option(bearing.name, number)));
for (const [id, shown] of Object.entries({ choose: numbers.bearings.length > 1, rings: numbers.bearings.length, linkage: numbers.linkage,
  sprung: numbers.linkage?.springs.length, turned: numbers.torque && numbers.linkage && numbers.linkage.driver !== null })) get(id).hidden = !shown;
get("bearing").value = 0;
frame = numbers.peak;
showRun(numbers);
follow();
