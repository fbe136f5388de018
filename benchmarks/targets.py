"""What the project set out to reach, what it reaches, and why not where it does not; all from the results.

A target that lies within the spread of what was measured is neither met nor missed for sure: "at the limit".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks.compared import Compared, Ratio
from benchmarks.curves import LEVELS, error_of, time_of, tolerance_at, written
from benchmarks.ensemble import times
from benchmarks.problem import CASES

Result = dict[str, Any]

#: Target, damping, what was measured, verdict.
Row = tuple[str, str, str, str]

#: (rival: a contender or a group, words, factor, whether the stepper may take `factor` times the rival's time)
_AT_1E3 = (
    ("hand-best", "by hand in C", 1.5, True),
    ("numbalsoda-lsoda", "numbalsoda LSODA", 4.0, False),
    ("erk", "CasADi erk in C", 4.0, False),
    ("cvodes-compiled", "CasADi cvodes, compiled", 20.0, False),
    ("numpy-best", "best SciPy with NumPy", 300.0, False),
)

#: At tighter errors, every peer takes at least so many times as long [1].
_EVERY_PEER = 3.0

#: Share of what two hashing threads gain from which on the machine, and not the project, is the limit [1].
AT_THE_LIMIT = 0.95

_WORDS = {case.key: case.words for case in CASES}

#: Not peers: the project itself, and the limit.
_NOT_PEERS = ("stepper", "simulate", "hand-")


def targets(cases: Sequence[Compared], results: Mapping[str, Result]) -> list[str]:
    """The section on targets, from the cases of part 1 and the results of the other parts that are there."""
    rows: list[Row] = []
    reasons: list[str] = []
    for case in cases:
        _speed(case, rows, reasons)
    for name, judge in _JUDGES:
        if name in results:
            rows += judge(results[name], reasons)
    lines = [
        "## Targets",
        "",
        "Ratios are of times at equal error; `stepper` with its own choice of method. In brackets their 10th and 90th "
        "percentile, over draws of the parameter sets or over rounds. *At the limit*: the target lies between these "
        "two, and another measurement may fall on its other side.",
        "",
    ]
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
    limits = {5: 4.0, 20: 12.0}
    for row in result["rows"]:
        limit = limits.get(row.get("parameters"))
        if row["way"] != "model.simulate" or limit is None:
            continue
        ratio = _ratio(row["times_plain"])
        text = f"{row['parameters']} sensitivities: `model.sensitivities` at most {limit:g}× `model.simulate`"
        alone = [
            other["times_plain"]
            for other in result["rows"]
            if (other["way"], other["case"], other.get("parameters"))
            == ("stepper, 2000 points", row["case"], row["parameters"])
        ]
        measured = "; ".join((ratio.text(), *(f"the drivers alone {times(one)}" for one in alone)))
        rows.append((text, _WORDS[row["case"]], measured, _verdict(ratio, limit, at_most=True)))
        if ratio.value > limit:
            reasons.append(
                f"{row['parameters']} sensitivities, {_WORDS[row['case']]}: {ratio.value:.3g} plain runs; see "
                "[number of parameters](#number-of-parameters) for where the time goes."
            )
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


def _ensemble(result: Result, reasons: list[str]) -> list[Row]:
    rows: list[Row] = []
    for case in result["cases"]:
        lanes, threads = _ratio(case["ratios"]["lanes"]), _ratio(case["ratios"]["threads"])
        possible = case["ratios"]["possible"]["median"]
        same = f"{times(case['ratios']['lanes'])}; with the same method {times(case['ratios']['lanes_same'])}"
        rows.append(("ensemble: lanes at least 2.5× a core", case["words"], same, _verdict(lanes, 2.5)))
        measured = f"{times(case['ratios']['threads'])}; two threads that hash: {possible:.2f}×"
        # the machine's own limit is not the project's, where the project reaches it
        limited = threads.value < 1.8 and possible < 1.8 and threads.value >= AT_THE_LIMIT * possible
        verdict = "the machine gives no more" if limited else _verdict(threads, 1.8)
        rows.append(("ensemble: at least 1.8× from the second thread", case["words"], measured, verdict))
        if lanes.value < 2.5:
            reasons.append(_lanes(case))
        if threads.value < 1.8 and not limited:
            reasons.append(_threads(case))
    return rows


def _lanes(case: Result) -> str:
    alone, lanes = (case["rows"][name]["cpu_a_cycle"]["median"] for name in ("one by one, 1", "end, 1"))
    ratio = case["ratios"]["lanes"]["median"]
    return (
        f"Lanes, {case['words']}: {ratio:.2f}×, against the bare driver of single runs on prepared arrays, "
        f"while lanes bring their preparation; against `simulate_many` without lanes, which does too, "
        f"{alone / lanes:.2g}×. A single run fills the vector units with its own balls; lanes gain "
        "only what it does one number after another, and from waiting less ([measurements](adr/0010-ensembles.md))."
    )


def _threads(case: Result) -> str:
    ours, hashing = (
        case["rows"][f"{name}, 2"]["cpu_a_cycle"]["median"] / case["rows"][f"{name}, 1"]["cpu_a_cycle"]["median"]
        for name in ("end", "hash")
    )
    threads, possible = (case["ratios"][name]["median"] for name in ("threads", "possible"))
    return (
        f"Second thread, {case['words']}: {threads:.2f}× where two threads that hash gain {possible:.2f}×. "
        f"Two threads take {round(100 * (ours - 1)):+d} % processor time for the same members "
        f"({round(100 * (hashing - 1)):+d} % for hashing); without that it would be {threads * ours:.2f}×. "
        "What is known of the rest: part of the preparation holds the interpreter's lock while the other thread waits, "
        "and at the end one thread is done half a chunk before the other ([measurements](adr/0010-ensembles.md))."
    )


def _jacobians(result: Result, reasons: list[str]) -> list[Row]:
    slowest = max(result["rows"], key=lambda row: float(row["code"]["time"]))
    time = slowest["code"]["time"]
    wrt = slowest["wrt"]
    by = wrt if isinstance(wrt, str) else f"{len(wrt)} parameters"
    taken = _ratio(slowest["code"]["seconds"])
    what = f"{1e6 * time:.3g} µs ({1e6 * taken.low:.3g} … {1e6 * taken.high:.3g}), {slowest['of']} by {by}"
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
    return [("a Jacobian of generated code in under 2 µs", "", what, _verdict(taken, 2e-6, at_most=True))]


def _arithmetic(result: Result, _: list[str]) -> list[Row]:
    if not result["cases"]:
        return []
    worst = max(case["change"]["worst"] for case in result["cases"])
    text = "`-ffast-math`, if used, changes no quantity by more than 0.01 tolerances"
    measured = f"it would by up to {worst:.2g} ([fast arithmetic](#fast-arithmetic))"
    return [(text, "", measured, "not used")]


def _regeneration(result: Result, reasons: list[str]) -> list[Row]:
    cold, warm = (result["stages"][how] for how in ("cold", "warm"))
    derive = sum(v["median"] for k, v in cold.items() if not k.startswith(("C compiler", "first", "load")))
    load = warm["load"]["median"]
    written = sorted({name for files in result["written"].values() for names in files.values() for name in names})
    refreshed = result["stages"]["number"]["generate: numbers only"]["median"]
    only_numbers = not result["compiled_again"] and set(written) <= {"manifest.json"}
    by_set = sorted({name for names in result["written"]["set"].values() for name in names})
    changed = (
        f"in the file: {', '.join(f'`{name}`' for name in written) or 'nothing'} written, {1e3 * refreshed:.0f} ms; "
        f"by `--set`: {', '.join(f'`{name}`' for name in by_set) or 'nothing'}"
    )
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
    if not only_numbers:
        reasons.append(
            f"Changed number: {', '.join(written)} were written"
            + (", and something was compiled again." if result["compiled_again"] else ".")
        )
    return [
        ("cold, without the C compiler ≤ 3 s", "", f"{derive:.2f} s", _met(derive <= 3.0)),
        ("warm load ≤ 50 ms", "", f"{1e3 * load:.0f} ms, imports not counted", _met(load <= 0.05)),
        (
            "changed number: nothing derived, generated or compiled; only numbers written",
            "",
            changed,
            _met(only_numbers),
        ),
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


def _ratio(spread: Mapping[str, float]) -> Ratio:
    return Ratio(value=spread["median"], low=spread["p10"], high=spread["p90"])


def _verdict(ratio: Ratio, target: float, *, at_most: bool = False) -> str:
    """Met, short, or at the limit where the target lies within the spread."""
    if ratio.low <= target <= ratio.high:
        return "at the limit"
    return _met(ratio.value <= target if at_most else ratio.value >= target)


def _speed(case: Compared, rows: list[Row], reasons: list[str]) -> None:
    words = case.case["words"]
    for key, rival, factor, limit in _AT_1E3:
        text = f"1e-3: at most {factor:g}× the time {rival}" if limit else f"1e-3: {rival} takes at least {factor:g}×"
        ratio = case.ratio("stepper", key, LEVELS[0]) if limit else case.ratio(key, "stepper", LEVELS[0])
        if ratio is None:
            absent = [c["absent"] for one in case.members_of(key) if "absent" in (c := case.contenders[one])]
            rows.append((text, words, absent[0] if absent else "not reached", "–"))
            continue
        rows.append((text, words, ratio.text(), _verdict(ratio, factor, at_most=limit)))
        best = case.best(key, LEVELS[0])
        if best is not None and (ratio.value > factor if limit else ratio.value < factor):
            reasons.append(_why(case, best, ratio.value, limit))
    for level in LEVELS[1:]:
        text = f"{written(level)}: every peer takes at least {_EVERY_PEER:g}×"
        peers = [key for key in case.contenders if not key.startswith(_NOT_PEERS)]
        ratios = {key: ratio for key in peers if (ratio := case.ratio(key, "stepper", level)) is not None}
        if not ratios:
            rows.append((text, words, "not reached", "–"))
            continue
        nearest = min(ratios, key=lambda key: ratios[key].value)
        measured = f"{ratios[nearest].text()}, {case.contenders[nearest]['label']}"
        rows.append((text, words, measured, _verdict(ratios[nearest], _EVERY_PEER)))
        if ratios[nearest].value < _EVERY_PEER:
            reasons.append(_families(case, level, nearest, ratios[nearest].value))


def _why(case: Compared, rival: str, ratio: float, limit: bool) -> str:
    """Split a ratio into number of evaluations and time of each where both are counted, else name the times."""
    mine, theirs = (tolerance_at(case.contenders[key], LEVELS[0]) for key in ("stepper", rival))
    label = case.contenders[rival]["label"]
    start = f"{case.case['words']}, against {label}: {ratio:.3g}×."
    if mine is None or theirs is None:
        return start
    if not (limit and "counts" in mine and "counts" in theirs):
        taken = [f"{1e3 * time_of(run):.3g} ms at an error of {error_of(run):.1e}" for run in (mine, theirs)]
        return f"{start} At the nearest tolerances the stepper takes {taken[0]}, {label} {taken[1]}."
    each = [1e9 * time_of(run) / run["counts"]["evaluations"] for run in (mine, theirs)]
    counts = [run["counts"]["evaluations"] for run in (mine, theirs)]
    return (
        f"{start} At the nearest tolerances the stepper takes {counts[0]:.0f} evaluations of {each[0]:.0f} ns with "
        f"outputs and step control, {label} {counts[1]:.0f} of {each[1]:.0f} ns: "
        f"a factor of {counts[0] / counts[1]:.2g} from the method that is chosen, "
        f"{each[0] / each[1]:.2g} from what this one machine allows by hand (see above)."
    )


def _families(case: Compared, level: float, nearest: str, ratio: float) -> str:
    """Say whether another method of the stepper's, asked for by name, would come nearer to the target."""
    start = f"{case.case['words']} at {written(level)}, against {case.contenders[nearest]['label']}: {ratio:.3g}×."
    named = {
        key: found.value
        for key in case.contenders
        if key.startswith("stepper-") and (found := case.ratio(nearest, key, level)) is not None
    }
    best = max(named, key=lambda key: named[key], default=None)
    if best is None or named[best] <= ratio:
        return f"{start} None of the stepper's methods, asked for by name, would be faster there."
    return f"{start} That is the stepper's own choice of method; asked for by name, {best} reaches {named[best]:.3g}×."
