"""What the project set out to reach, what it reaches, and why not where it does not; all from the results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks.curves import LEVELS, curve, lower, time_at, tolerance_at
from benchmarks.problem import CASES

Result = dict[str, Any]

#: Target, damping, what was measured, verdict.
Row = tuple[str, str, str, str]

#: (rival: keys that count as one, words, level, factor, whether the stepper may take `factor` times the rival's time)
_AT_1E3 = (
    (("hand-",), "by hand in C", 1.5, True),
    (("numbalsoda",), "numbalsoda LSODA", 4.0, False),
    (("erk",), "CasADi erk in C", 4.0, False),
    (("cvodes-compiled",), "CasADi cvodes, compiled", 20.0, False),
    (("scipy-lsoda-numpy", "scipy-dop853-numpy", "scipy-radau-numpy"), "best SciPy with NumPy", 300.0, False),
)

#: Share of what two hashing threads gain from which on the machine, and not the project, is the limit [1].
AT_THE_LIMIT = 0.95

_WORDS = {case.key: case.words for case in CASES}

#: Not peers: the project itself, and the limit.
_NOT_PEERS = ("stepper", "simulate", "hand-")


def targets(cases: Sequence[Result], results: Mapping[str, Result]) -> list[str]:
    """The section on targets, from the cases of part 1 and the results of the other parts that are there."""
    rows: list[Row] = []
    reasons: list[str] = []
    for case in cases:
        _speed(case, rows, reasons)
    for name, judge in _JUDGES:
        if name in results:
            rows += judge(results[name], reasons)
    lines = ["## Targets", "", "Ratios are of times at equal error; `stepper` with its own choice of method.", ""]
    lines += ["| target | damping | measured | |", "| --- | --- | ---: | --- |"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    if reasons:
        lines += ["", "Where a case falls short, and why:", "", *(f"- {reason}" for reason in reasons)]
    return [*lines, ""]


def _balls(result: Result, reasons: list[str]) -> list[Row]:
    worst = max(fit["largest_deviation"] for fit in result["fits"])
    if worst >= 0.15:
        far = [fit["method"] for fit in result["fits"] if fit["largest_deviation"] >= 0.15]
        reasons.append(
            f"Cost against the number of balls, {', '.join(far)}: a point is {100 * worst:.0f} % off the line; balls "
            "are taken in whole lanes, so that the cost has steps."
        )
    return [("cost linear in the balls", "", f"within {100 * worst:.0f} % of a line", _met(worst < 0.15))]


def _sensitivity_cost(result: Result, reasons: list[str]) -> list[Row]:
    rows: list[Row] = []
    limits = ((5, 4.0), (20, 12.0))
    for way in ("model.simulate", "stepper, 2000 points"):
        for row in result["rows"]:
            for count, limit in limits:
                if row["way"] != way or row.get("parameters") != count:
                    continue
                ratio = row["times_plain"]["median"]
                text = f"{count} sensitivities: at most {limit:g}× the plain run ({way})"
                rows.append((text, _WORDS[row["case"]], f"{ratio:.3g}×", _met(ratio <= limit)))
                if ratio > limit:
                    reasons.append(_blocks(result, way, row["case"], count, ratio))
    deviations = [fit["largest_deviation"] for fit in result["fits"]]
    if deviations:
        worst = max(deviations)
        measured = f"within {100 * worst:.0f} % of a line"
        rows.append(("cost linear in the parameters, eight at a time", "", measured, _met(worst < 0.15)))
        if worst >= 0.15:
            far = ", ".join(
                f"{fit['way']}, {_WORDS[fit['case']]}" for fit in result["fits"] if fit["largest_deviation"] >= 0.15
            )
            reasons.append(
                f"Cost against the number of parameters: {far}, a point is {100 * worst:.0f} % off the line."
            )
    return rows


def _blocks(result: Result, way: str, case: str, count: int, ratio: float) -> str:
    """Where the time of derivatives goes: blocks begun, what does not depend on the number, outputs."""
    start = f"{count} sensitivities, {way}, {_WORDS[case]}: {ratio:.3g} plain runs."
    fits = {(fit["way"], fit["case"]): fit for fit in result["fits"]}
    if (way, case) not in fits:
        return start
    fit, blocks = fits[way, case], -(-count // 8)
    text = (
        f"{start} Derivatives come in blocks of eight: {count} parameters cost as much as {8 * blocks}. "
        f"{fit['without']:.2g} plain runs do not depend on the number (steps with the derivatives of the right-hand "
        f"side by states), each block takes {fit['a_block']:.2g}"
    )
    end = [
        row["times_plain"]["median"]
        for row in result["rows"]
        if row["way"] == "stepper, end only" and row["case"] == case and row.get("parameters") == count
    ]
    return text + (f"; without the {way.split(', ')[-1]} it is {end[0]:.3g}." if end else ".")


def _ensemble(result: Result, reasons: list[str]) -> list[Row]:
    rows: list[Row] = []
    for case in result["cases"]:
        lanes, threads, possible = case["lanes"], case["threads"], case["possible"]
        rows.append(("ensemble: lanes at least 2.5× a core", case["words"], f"{lanes:.2f}×", _met(lanes >= 2.5)))
        measured = f"{threads:.2f}× (two threads that hash: {possible:.2f}×)"
        # the machine's own limit is not the project's, where the project reaches it
        limited = threads < 1.8 and possible < 1.8 and threads >= AT_THE_LIMIT * possible
        verdict = "the machine gives no more" if limited else _met(threads >= 1.8)
        rows.append(("ensemble: at least 1.8× from the second thread", case["words"], measured, verdict))
        if lanes < 2.5:
            reasons.append(_lanes(case))
        if threads < 1.8 and not limited:
            reasons.append(_threads(case))
    return rows


def _lanes(case: Result) -> str:
    alone, lanes = (case["rows"][name]["cpu_a_cycle"] for name in ("one by one, 1", "end, 1"))
    return (
        f"Lanes, {case['words']}: {case['lanes']:.2f}×, against the bare driver of single runs on prepared arrays, "
        f"while lanes bring their preparation; against `simulate_many` without lanes, which does too, "
        f"{alone / lanes:.2g}×. A single run fills the vector units with its own balls; lanes gain "
        "only what it does one number after another, and from waiting less ([measurements](adr/0010-ensembles.md))."
    )


def _threads(case: Result) -> str:
    ours, hashing = (
        case["rows"][f"{name}, 2"]["cpu_a_cycle"] / case["rows"][f"{name}, 1"]["cpu_a_cycle"]
        for name in ("end", "hash")
    )
    return (
        f"Second thread, {case['words']}: {case['threads']:.2f}× where two threads that hash gain "
        f"{case['possible']:.2f}×. Two threads take {round(100 * (ours - 1)):+d} % processor time for the same members "
        f"({round(100 * (hashing - 1)):+d} % for hashing); without that it would be {case['threads'] * ours:.2f}×. "
        "What is known of the rest: part of the preparation holds the interpreter's lock while the other thread waits, "
        "and at the end one thread is done half a chunk before the other ([measurements](adr/0010-ensembles.md))."
    )


def _jacobians(result: Result, reasons: list[str]) -> list[Row]:
    slowest = max(result["rows"], key=lambda row: float(row["code"]["time"]))
    time = slowest["code"]["time"]
    wrt = slowest["wrt"]
    by = wrt if isinstance(wrt, str) else f"{len(wrt)} parameters"
    what = f"{1e6 * time:.3g} µs ({slowest['of']} by {by})"
    if time >= 2e-6:
        ratio = slowest["code"]["ratio"]["median"]
        reason = f"Jacobian of {slowest['of']} by {by}: {1e6 * time:.3g} µs, {ratio:.2g} right-hand sides"
        if isinstance(wrt, str):
            reasons.append(f"{reason}, for {slowest['entries']} entries.")
        else:
            reasons.append(
                f"{reason}. Any parameters may be asked for, and one may move all constants: the compiled derivative "
                "along one direction in parameters and constants is called once for each, "
                f"{1e6 * time / len(wrt):.2g} µs a call, and each computes the values anew."
            )
    return [("a Jacobian of generated code in under 2 µs", "", what, _met(time < 2e-6))]


def _arithmetic(result: Result, reasons: list[str]) -> list[Row]:
    rows: list[Row] = []
    for case in result["cases"]:
        measured = (
            f"{case['change']['worst']:.2g} tolerances, {case['time_over_ieee']['median']:.2f}× the time; not used"
        )
        text = "`-ffast-math` would change no quantity by 0.01 tolerances"
        rows.append((text, case["words"], measured, _met(case["change"]["worst"] <= 0.01)))
        if case["change"]["worst"] > 0.01:
            reasons.append(
                f"`-ffast-math`, {case['words']}: {case['change']['worst']:.2g} tolerances at worst, "
                f"{case['change']['median']:.2g} in the median. Other roundings move the last digits; where an impact "
                "decides the next, they grow until steps are accepted and rejected elsewhere, and the error of the "
                "run is another draw. So the stepper is compiled without, "
                f"at {1 / case['time_over_ieee']['median']:.2f}× the time."
            )
    return rows


def _regeneration(result: Result, reasons: list[str]) -> list[Row]:
    cold, warm = (result["stages"][how] for how in ("cold", "warm"))
    derive = sum(v["median"] for k, v in cold.items() if not k.startswith(("C compiler", "first", "load")))
    load = warm["load"]["median"]
    changed = "compiled" if result["compiled_again"] else "nothing"
    if derive > 3.0:
        own = {k: v["median"] for k, v in cold.items() if not k.startswith(("C compiler", "first", "load"))}
        longest = max(own, key=lambda stage: own[stage])
        reasons.append(
            f"Cold, without the C compiler: {derive:.2f} s, of which `{longest}` takes {own[longest]:.2f} s."
        )
    if load > 0.05:
        reasons.append(
            f"Warm load: {1e3 * load:.0f} ms in the median, {1e3 * warm['load']['p10']:.0f} ms at the 10th percentile "
            f"of {result['repeats']} new processes: files are read and libraries opened anew in each."
        )
    if result["compiled_again"]:
        reasons.append("Changed number: a file of the compiled cache changed its time while only numbers had changed.")
    return [
        ("cold, without the C compiler ≤ 3 s", "", f"{derive:.2f} s", _met(derive <= 3.0)),
        ("warm load ≤ 50 ms", "", f"{1e3 * load:.0f} ms, imports not counted", _met(load <= 0.05)),
        ("changed number: nothing compiled", "", changed, _met(not result["compiled_again"])),
    ]


#: Name of a file of results, and what makes rows of it.
_JUDGES: tuple[tuple[str, Callable[[Result, list[str]], list[Row]]], ...] = (
    ("balls", _balls),
    ("sensitivity_cost", _sensitivity_cost),
    ("ensemble", _ensemble),
    ("jacobians", _jacobians),
    ("arithmetic", _arithmetic),
    ("regeneration", _regeneration),
)


def _met(reached: bool) -> str:
    return "met" if reached else "**short**"


def _speed(case: Result, rows: list[tuple[str, str, str, str]], reasons: list[str]) -> None:
    contenders = {c["key"]: c for c in case["contenders"]}
    curves = {key: curve(c) for key, c in contenders.items()}
    own = {level: time_at(curves["stepper"], level) for level in LEVELS}
    for keys, words, factor, limit in _AT_1E3:
        some = [key for key in curves if key.startswith(keys)]
        text = f"1e-3: at most {factor:g}× the time {words}" if limit else f"1e-3: {words} takes at least {factor:g}×"
        absent = [contenders[key]["absent"] for key in some if "absent" in contenders[key]]
        theirs = time_at(lower([curves[key] for key in some]), LEVELS[0])
        mine = own[LEVELS[0]]
        if theirs is None or mine is None:
            rows.append((text, case["words"], absent[0] if absent else "not reached", "–"))
            continue
        ratio = mine / theirs if limit else theirs / mine
        reached = ratio <= factor if limit else ratio >= factor
        rows.append((text, case["words"], f"{ratio:.3g}×", _met(reached)))
        if not reached:
            best = min(some, key=lambda key: time_at(curves[key], LEVELS[0]) or float("inf"))
            reasons.append(_why(case, contenders, best, ratio, limit))
    for level in LEVELS[1:]:
        peers = {
            key: taken
            for key, points in curves.items()
            if not key.startswith(_NOT_PEERS) and (taken := time_at(points, level)) is not None
        }
        mine = own[level]
        if not peers or mine is None:
            rows.append((f"{level:.0e}: every peer takes at least 3×", case["words"], "not reached", "–"))
            continue
        nearest = min(peers, key=lambda key: peers[key])
        ratio = peers[nearest] / mine
        measured = f"{ratio:.3g}× ({contenders[nearest]['label']})"
        rows.append((f"{level:.0e}: every peer takes at least 3×", case["words"], measured, _met(ratio >= 3.0)))
        if ratio < 3.0:
            reasons.append(_families(case, contenders, curves, level, nearest, ratio))


def _why(case: Result, contenders: dict[str, Result], rival: str, ratio: float, limit: bool) -> str:
    """Split a ratio into number of evaluations and time of each where both are counted, else name the times."""
    mine, theirs = (tolerance_at(contenders[key], LEVELS[0]) for key in ("stepper", rival))
    label = contenders[rival]["label"]
    start = f"{case['words']}, against {label}: {ratio:.3g}×."
    if mine is None or theirs is None:
        return start
    if not (limit and "counts" in mine and "counts" in theirs):
        times = [f"{1e3 * row['time']['median']:.3g} ms at an error of {_worst(row):.1e}" for row in (mine, theirs)]
        return f"{start} At the nearest tolerances the stepper takes {times[0]}, {label} {times[1]}."
    each = [1e9 * row["time"]["median"] / row["counts"]["evaluations"] for row in (mine, theirs)]
    counts = [row["counts"]["evaluations"] for row in (mine, theirs)]
    return (
        f"{start} At the nearest tolerances the stepper takes {counts[0]:.0f} evaluations of {each[0]:.0f} ns with "
        f"outputs and step control, {label} {counts[1]:.0f} of {each[1]:.0f} ns: "
        f"a factor of {counts[0] / counts[1]:.2g} from the method that is chosen, "
        f"{each[0] / each[1]:.2g} from what this one machine allows by hand (see above)."
    )


def _worst(row: Result) -> float:
    return float(row["error"]["worst"]["median"])


def _families(
    case: Result, contenders: dict[str, Result], curves: dict[str, Any], level: float, nearest: str, ratio: float
) -> str:
    """Say whether another family of the stepper would have reached the target."""
    families = {
        key: taken
        for key, points in curves.items()
        if key.startswith("stepper-") and (taken := time_at(points, level)) is not None
    }
    start = f"{case['words']} at {level:.0e}, against {contenders[nearest]['label']}: {ratio:.3g}×."
    rival = time_at(curves[nearest], level)
    if not families or rival is None:
        return start
    best = min(families, key=lambda key: families[key])
    return f"{start} The stepper's own choice of method; asked for, {best} would reach {rival / families[best]:.3g}×."
