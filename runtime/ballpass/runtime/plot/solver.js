
// ------------------------------------------------------------------------------------------------------------- solver
// The exported C program, compiled to WebAssembly: a run of given numbers, and what of it is drawn.
const solver = numbers.solver, width = solver.columns.length + solver.drawn.reduce((sum, count) => sum + count, 0);
let far = solver.columns.length;
const [pointsAt, cagesAt, seenAt, inputsAt] = solver.drawn.map((count) => { far += count; return far - count; });
const TURN = 2 * Math.PI, DEGREE = Math.PI / 180;
const BLOCK = 64; // samples that are read at once
let machine = null;

async function loadSolver() {
  const packed = Uint8Array.from(atob(solver.module), (letter) => letter.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const module = await WebAssembly.compile(await new Response(unpacked).arrayBuffer()), system = {};
  // The solver reads and writes no files; what its library could ask a system for answers "not supported".
  for (const { module: space, name } of WebAssembly.Module.imports(module)) (system[space] ??= {})[name] = () => 52;
  const { exports } = await WebAssembly.instantiate(module, system);
  exports._initialize?.();
  machine = { ...exports, one: exports.ballpass_make(), rows: exports.malloc(8 * (BLOCK + 1) * width), ratings: exports.malloc(16 * solver.bearings.length + 8), saved: exports.malloc(exports.ballpass_state_size()), reduction: exports.malloc(8 * solver.reduction.size) };
  if (!machine.one || !machine.rows || !machine.ratings || !machine.saved || !machine.reduction) throw new Error("The memory is too small for the solver.");
}

const savedState = () => new Uint8Array(machine.memory.buffer, machine.saved, machine.ballpass_state_size());
const inMemory = (place, count) => new Float64Array(machine.memory.buffer, place, count);
function complaint() {
  const bytes = new Uint8Array(machine.memory.buffer, machine.ballpass_error(machine.one));
  return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
}
const must = (answer) => { if (answer) throw new Error(complaint()); };

// Rows at some of the times that divide `whole` into equal parts. Their blocks are used again when a run is not shown any more: to
// collect megabytes at every move of a slider took as long as the run, and with the garbage went the compiled script.
const spare = [];
function makeBlock() {
  const numbers = new Float64Array((BLOCK + 1) * width);
  return { numbers, rows: Array.from({ length: BLOCK + 1 }, (_, k) => numbers.subarray(k * width, (k + 1) * width)) };
}
function readRows(blocks, whole, parts, first, count) {
  must(machine.ballpass_rows(machine.one, whole, parts, first, count, width, machine.rows));
  blocks.push(spare.pop() ?? makeBlock());
  blocks.at(-1).numbers.set(inMemory(machine.rows, count * width));
  return blocks.at(-1).rows.slice(0, count);
}

// How many times as many samples are taken as the scene says, which counts turns at the speed of t = 0; most samples of a run then.
let finer = 1;
const MOST = 40000;

// A run of these numbers, or null where `stale` says that it is not wanted any more: its steady samples, row after row.
async function solve(values, stale) {
  machine.ballpass_stop(machine.one);
  const faults = values.map((value, place) => (machine.ballpass_set_at(machine.one, place, value) ? complaint() : "")).filter(Boolean);
  if (faults.length) throw new Error(faults.join("\n"));
  must(machine.ballpass_start(machine.one, 0));
  const known = inMemory(machine.ballpass_values(machine.one), solver.places).slice(), { cycles, duration, transient, samples } = solver.run;
  const place = solver.rows ? solver.rows[1].at(-1) : solver.speed, speed = place === null ? 0 : known[place], turn = speed ? TURN / Math.abs(speed) : Infinity;
  const whole = cycles ? machine.ballpass_after(machine.one, cycles) : duration, turns = Math.max(whole / turn, machine.ballpass_turns(machine.one, whole));
  const base = Math.max(1, Math.round(samples * (turns || 1))), count = finer * base;
  const time = (k) => whole * (k / count), least = transient ? machine.ballpass_after(machine.one, transient) * (1 - 1e-12) : 0;
  if (!Number.isFinite(least)) throw new Error("Transient cycles are turns, and nothing turns in this run, or not so often.");
  let first = 0, began = performance.now();
  while (time(first) < least) first += 1;
  const reduced = inMemory(machine.reduction, solver.reduction.size).fill(0); // the highest ball forces, of every step
  reduced[solver.reduction.from] = least * (1 - 1e-9);
  for (const { top, deflection, life } of solver.bearings) {
    reduced[top.max_wanted] = reduced[deflection.max_wanted] = 1;
    if (life) reduced[life.wanted] = 1;
  }
  machine.ballpass_reduce(machine.one, machine.reduction);
  const blocks = [], rows = [], nodes = [], states = [], apart = 1e-10 * whole; // closer than this a sample and a switch are one time
  for (let k = 0, end = 0; k <= count; k = end) {
    if (k < first) {
      end = Math.min(k + BLOCK, first);
      must(machine.ballpass_run_to(machine.one, time(end)));
    } else {
      const next = machine.ballpass_next_switch(machine.one);
      end = Math.min(k + BLOCK, count + 1);
      while (end > k && time(end - 1) + apart > next) end -= 1;
      if (k >= first + 8 * BLOCK * states.length) {
        machine.ballpass_save(machine.one, machine.saved);
        states.push([k, savedState().slice()]);
      }
      const block = end > k ? readRows(blocks, whole, count, k, end - k) : [next - apart, next].flatMap((side) => readRows(blocks, side, 1, 1, 1));
      nodes.push(...block); // also both sides of every time at which a load switches, for means and peaks
      if (end > k) rows.push(...block);
    }
    if (performance.now() - began > 40) { // the page stays alive
      await new Promise((go) => { setTimeout(go); });
      if (stale()) return null;
      began = performance.now();
    }
  }
  if (solver.angle !== null || solver.rows) { // so many samples a turn where the driver is fastest, as means over the run need
    let step = 0;
    for (let k = 1; k < rows.length; k += 1) step = Math.max(step, Math.abs(turnedTo(known, rows[k]) - turnedTo(known, rows[k - 1])));
    const wanted = Math.min(Math.round(finer * step * samples / TURN), Math.floor(MOST / base));
    if (wanted > finer) {
      finer = wanted;
      spare.push(...blocks);
      return solve(values, stale);
    }
  }
  machine.ballpass_ratings(machine.one, machine.ratings);
  machine.ballpass_reduce(machine.one, 0);
  const ratings = inMemory(machine.ratings, 2 * solver.drawn[1]).slice(), found = inMemory(machine.reduction, solver.reduction.size).slice();
  const tops = solver.bearings.map(({ top }) => ({ value: found[top.max], time: found[top.max_time] })), deflections = solver.bearings.map(({ deflection }) => found[deflection.max]);
  return { values, known, ratings, reduced: found, tops, deflections, blocks, rows, nodes, states, turn, speed, whole, first, parts: count };
}

// Mean over the time of a run of what was measured at its nodes, by trapezoids between samples and the sides of jumps.
function mean({ nodes }, series) {
  let sum = 0;
  for (let k = 1; k < nodes.length; k += 1) sum += (nodes[k][0] - nodes[k - 1][0]) * (series[k] + series[k - 1]);
  return 0.5 * sum / (nodes.at(-1)[0] - nodes[0][0]);
}
function measured({ nodes }, measure) {
  const values = new Float64Array(nodes.length);
  for (let k = 0; k < nodes.length; k += 1) values[k] = measure(nodes[k]);
  return values;
}
const rms = (run, series) => Math.sqrt(mean(run, series.map((value) => value * value)));

// Rating life of a bearing [h], as of `ballpass life`, over the passes of this run, from its steps; 0 where its rings do not turn
// against each other.
function lifeOf({ nodes, ratings, reduced }, { cage, force, life: { standing, weibull, sectors, turned, raceways } }) {
  // how far the rings turn from one node to the next; angles of cages come back after a turn
  const apart = nodes.map((node) => node[seenAt + 2 * cage] - node[seenAt + 2 * cage + 1]), passes = reduced[turned];
  const net = apart.reduce((sum, angle, k) => sum + (k ? angle - apart[k - 1] - TURN * Math.round((angle - apart[k - 1]) / TURN) : 0), 0);
  if (!(Math.abs(net) > 0.5 * passes)) return 0;
  const damage = [0, 1].map((ring) => { // of the outer and of the inner raceway; loads in kN
    const field = reduced.subarray(raceways + ring * sectors, raceways + (ring + 1) * sectors);
    return field.reduce((sum, power) => sum + (sectors * power / (passes * force.length)) ** weibull, 0) / sectors * (1e3 / ratings[2 * cage + 1 - ring]) ** standing;
  });
  const speed = passes / reduced[solver.reduction.duration];
  return 1e6 * (damage[0] + damage[1]) ** (-1 / weibull) * TURN / speed / 3600;
}

// Highest values of measures of a sample, between samples too: the steps do not depend on what is read.
function peaks(run, measures, series) {
  const FINE = BLOCK / 2, { whole, parts, first, nodes, states } = run, topOf = (values) => values.reduce((best, value, k) => (value > values[best] ? k : best), 0);
  return measures.map((measure, k) => {
    const node = topOf(series[k]), from = Math.max(Math.round(nodes[node][0] / whole * parts) - 1, first);
    savedState().set(states.findLast(([sample]) => sample <= from)[1]);
    must(machine.ballpass_restore(machine.one, machine.saved, savedState().length));
    const fine = readRows(spare, whole, parts * FINE, from * FINE, Math.min(2, parts - from) * FINE + 1).map(measure), top = topOf(fine), [a, b, c] = [fine[top - 1], fine[top], fine[top + 1]];
    // the parabola through three neighbours, where they are: not across a jump
    const bend = a - 2 * b + c, smooth = bend < 0 && 2 * b - a - c < 1e-3 * Math.abs(b), way = smooth ? 0.5 * (a - c) / bend : 0;
    const value = smooth ? b - 0.25 * (a - c) * way : b;
    return value > series[k][node] ? { value, time: whole * ((from * FINE + top + way) / (parts * FINE)) } : { value: series[k][node], time: nodes[node][0] };
  });
}

// ---------------------------------------------------------------------------------------------------- from run to page
const greatest = (values, most = 1e-12) => values.reduce((found, value) => Math.max(found, Math.abs(value)), most);
const signalOf = (values, most = greatest(values)) => {
  return { decimals: most > 1e-12 ? 4 - Math.floor(Math.log10(most)) : 0, all: values };
};
// Signals of one kind have the same decimals.
const signalsOf = (columns) => { const most = columns.reduce((found, values) => greatest(values, found), 1e-12); return columns.map((values) => signalOf(values, most)); };

/* Angle of the driver by a table of its speed, linear between rows and constant outside, or where it is a state. */
function turnedTo(known, row) {
  if (!solver.rows) return row[solver.angle];
  const [times, speeds] = solver.rows.map((places) => places.map((place) => known[place])), last = times.length - 1;
  const speed = (t) => {
    const k = times.findIndex((time) => time > t);
    if (k <= 0) return speeds[k < 0 ? last : 0];
    return speeds[k - 1] + (speeds[k] - speeds[k - 1]) * (t - times[k - 1]) / (times[k] - times[k - 1]);
  };
  const edges = [0, ...times.filter((time) => time > 0 && time < row[0]), row[0]];
  return edges.reduce((sum, t, k) => sum + (k ? 0.5 * (speed(t) + speed(edges[k - 1])) * (t - edges[k - 1]) : 0), known[solver.start]);
}

function angleOf(run, row) {
  if (solver.angle !== null || solver.rows) return turnedTo(run.known, row);
  return (solver.start === null ? 0 : run.known[solver.start]) + run.speed * row[0];
}

const between = (angle, [start, end]) => ((angle - start) % TURN + TURN) % TURN < ((end - start) % TURN + TURN) % TURN;
function interpolated(angle, knots, heights, period) {
  const turned = ((angle - knots[0]) % period + period) % period + knots[0], next = knots.findIndex((knot) => knot > turned), n = next < 0 ? knots.length : next;
  const [a, b] = [knots[n - 1], n < knots.length ? knots[n] : knots[0] + period];
  return heights[n - 1] + (heights[n % knots.length] - heights[n - 1]) * (turned - a) / (b - a);
}

// Share of a load that rises behind the start of its window and falls before its end.
function risen(angle, start, end, rise) {
  const [past, width] = [angle - start, end - start].map((turned) => (turned % TURN + TURN) % TURN);
  return Math.max(Math.min(past / rise, (width - past) / rise, 1), 0);
}

function forceOf(run, source, row, placeOf) {
  const value = (place) => run.known[place];
  if (source.columns) return source.columns.map((column) => source.sign * row[column]);
  if (source.between) {
    const [from, to] = source.between.map(placeOf), way = [to[0] - from[0], to[1] - from[1]], size = Math.max(length(way), 1e-12);
    return way.map((part) => source.sign * row[source.tension] * part / size);
  }
  let amount = 1;
  if (source.input !== undefined) amount = row[inputsAt + source.input];
  else if (source.borders) amount = Number(source.borders.some((edges) => between(angleOf(run, row), edges.map(value))));
  else if (source.rise) amount = risen(angleOf(run, row), ...source.rise.map(value));
  else if (source.table) amount = interpolated(angleOf(run, row), ...source.table.map((places) => places.map(value)), TURN * source.turns);
  if (amount === 0) return [0, 0];
  if (source.cartesian) return source.cartesian.map((place) => amount * value(place));
  const [size, direction] = source.polar ? source.polar.map(value) : [1, value(source.direction)];
  return [amount * size * Math.cos(direction), amount * size * Math.sin(direction)];
}

function loadOf(run, { load, force, cage, cosine }, row) {
  if (load.columns === null) { // what presses the balls
    const radial = cosine === null ? 1 : run.known[cosine], pitch = TURN / force.length;
    return [Math.cos, Math.sin].map((part) => force.reduce((sum, column, ball) => sum + radial * row[column] * part(row[cagesAt + cage] + ball * pitch), 0));
  }
  const share = load.sign * (load.share === null ? 1 : run.known[load.share]) / (load.count === null ? 1 : run.known[load.count]);
  return load.columns.map((column) => share * row[column]);
}

const motionOf = ({ inner, outer }, row) => (outer ? [1e6 * (row[inner[0]] - row[outer[0]]), 1e6 * (row[inner[1]] - row[outer[1]])] : [1e6 * row[inner[0]], 1e6 * row[inner[1]]]);

// ------------------------------------------------------------------------------------------------------------- limits
// A number as Python's format "g" writes it, and a template of `str.format` filled with such numbers.
const general = (value, digits) => {
  const [mantissa, power] = value.toExponential(digits - 1).split("e").map(Number);
  return power < -4 || power >= digits ? `${mantissa}e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}` : String(Number(value.toPrecision(digits)));
};
const filled = (words, given) => words.replace(/\{(\w+):\.(\d)g\}/g, (_, name, digits) => general(given[name], Number(digits)));

// What `ballpass run` warns of: numbers outside of their usual ranges, results that no real bearing shows. An error where these mean nothing.
function warningsOf({ known, rows, deflections }) {
  const said = solver.usual.flatMap(({ at, of, each, least, most, words }) => {
    const values = at.map((place) => known[place]), total = values.reduce((sum, value) => sum + value), scale = of === null ? 1 : Math.abs(known[of]);
    const odd = each ? values.every((value) => value > 0 && value < least) : (least !== null && total < least * scale) || (most !== null && total > most * scale);
    return odd && scale > 0 ? [filled(words, [...values, of === null ? total : values[0] / scale])] : [];
  });
  solver.bearings.forEach((bearing, k) => {
    const { limits } = bearing, ball = known[bearing.ball], half = known[bearing.clearance] / 2;
    const words = (limit, deflection, displaced) => filled(limits[limit], { deflection: 1e3 * deflection, displaced: 1e3 * displaced, share: 100 * deflection / ball });
    const check = (deflection, displaced) => {
      const limit = deflection > solver.limits.flattened * ball ? "flattened" : displaced > ball ? "displaced" : "";
      if (limit) throw new Error(`${solver.limits.void}\n${words(limit, deflection, displaced)}`);
    };
    const deflection = deflections[k]; // of every step
    check(deflection, deflection + half);
    let displaced = 0; // of the samples, as the summary of a run has it
    for (const row of rows) displaced = Math.max(displaced, 1e-6 * length(motionOf(bearing, row)));
    if (deflection > solver.limits.deflected * ball) said.push(words("deflected", deflection, displaced));
  });
  return said;
}

// What the pictures show of a run, its last turn or cycle of turns, in the form in which the page brings the scene's own.
function drawnOf(run) {
  const end = run.rows.length - 1, angles = run.rows.map((row) => angleOf(run, row));
  const sense = Math.sign(angles[end] - angles[0]), turning = sense !== 0 && angles.every((angle, k) => !k || sense * (angle - angles[k - 1]) > 0);
  let begins = 0;
  if (turning) while (begins < end && Math.abs(angles[end] - angles[begins + 1]) >= TURN * solver.shown * (1 - 1e-9)) begins += 1;
  // every bearing's highest force is among the positions
  const tops = solver.bearings.map((bearing) => {
    let [most, top] = [-Infinity, begins];
    for (let k = begins; k <= end; k += 1) for (const column of bearing.force) if (run.rows[k][column] > most) [most, top] = [run.rows[k][column], k];
    return [most, top];
  }), stride = Math.ceil((end - begins) / 1000), chosen = [];
  for (let k = begins; k <= end; k += 1) if ((k - begins) % stride === 0 || k === end || tops.some((top) => top[1] === k)) chosen.push(k);
  const peak = tops.length ? tops.reduce((best, top) => (top[0] > best[0] ? top : best))[1] : begins;
  const rows = chosen.map((k) => run.rows[k]), shift = 360 * Math.floor(Math.min(...chosen.map((k) => angles[k])) / TURN + 1e-9);
  const fresh = { ...numbers, turning, peak: chosen.indexOf(peak), time: { decimals: 7, all: rows.map((one) => one[0]) } };
  fresh.angle = numbers.angle && { decimals: 3, all: chosen.map((k) => angles[k] / DEGREE - shift) };
  const acting = turning ? solver.windows.map((edges) => edges.map((place) => run.known[place] / DEGREE)).map(([from, to]) => {
    const first = ((from % 360) + 360) % 360;
    return [first, first + (((to - from) % 360) + 360) % 360];
  }) : [];
  // as in `Record.load_windows`: of loads of which some act at any angle nothing is shaded
  const within = (place) => acting.some(([from, to]) => (((place - from) % 360) + 360) % 360 < to - from - 1e-7);
  fresh.windows = acting.every(([, to]) => within(to)) ? [] : acting;
  fresh.torque = solver.torque === null ? null : signalOf(rows.map((one) => one[solver.torque]));
  if (solver.linkage) {
    const paths = solver.linkage.points.map((point) => [0, 1].map((axis) => rows.map((one) => one[pointsAt + 2 * point + axis])));
    const corners = numbers.linkage.bodies.flatMap((body) => body.points).concat(numbers.linkage.names.map((name) => name.at));
    const ends = (pick) => [0, 1].map((axis) => pick(...corners.map((point) => pick(...paths[point][axis]))));
    fresh.linkage = { ...numbers.linkage, low: ends(Math.min), high: ends(Math.max),
      points: paths.map(signalsOf),
      forces: numbers.linkage.forces.map((force, k) => {
        const parts = rows.map((one, n) => forceOf(run, solver.linkage.forces[k], one, (point) => paths[point].map((axis) => axis[n]))), [x, y] = signalsOf([0, 1].map((axis) => parts.map((part) => part[axis])));
        return { ...force, x, y };
      }) };
  }
  fresh.bearings = solver.bearings.map((bearing, k) => {
    const [moved, ball] = [rows.map((one) => motionOf(bearing, one)), run.known[bearing.ball]];
    const gap = bearing.gap === null ? run.known[bearing.clearance] / 2 : run.known[bearing.gap];
    const first = rows.map((one) => one[cagesAt + bearing.cage] / DEGREE), whole = 360 * Math.floor(Math.min(...first) / 360 + 1e-9);
    const furthest = Math.max(Math.abs(gap), 1e-6 * highest(moved.map(length)), 1e-12), share = 0.25 * ball / furthest, decade = 10 ** Math.floor(Math.log10(share));
    const ends = bearing.load && rows.map((one) => loadOf(run, bearing, one));
    return { ...numbers.bearings[k], pitch: run.known[bearing.pitch], ball, gap,
      factor: Math.max(1, decade * Math.max(...[1, 2, 5].filter((digit) => digit * decade <= share))),
      ball_angle: { decimals: 3, all: first.map((angle) => angle - whole) },
      force: signalsOf(bearing.force.map((column) => rows.map((one) => one[column]))),
      inner: signalsOf([0, 1].map((axis) => moved.map((pairs) => pairs[axis]))),
      outer: bearing.outer && numbers.bearings[k].outer ? signalsOf(bearing.outer.map((column) => rows.map((one) => 1e6 * one[column]))) : null,
      load: ends && signalsOf([0, 1].map((axis) => ends.map((end) => end[axis]))),
      settings: "with the numbers of this page" };
  });
  return fresh;
}
