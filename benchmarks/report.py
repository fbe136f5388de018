"""The page docs/benchmarks.md and its figures, from benchmarks/results/*.json alone: ``python -m benchmarks.report``.

A further part is an entry of `parts` in `benchmarks.__main__`, which writes a file of results, and an entry of
`SECTIONS` here: name of the file, and a function from its content to lines.  A section without its file is left out.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import arithmetic, ensemble, figures, jacobians, sensitivity_cost, sensitivity_error
from benchmarks.curves import LEVELS, curve, lower, time_at
from benchmarks.problem import CASES, SPREAD
from benchmarks.tables import milliseconds, table
from benchmarks.targets import targets

Result = dict[str, Any]

#: The page's text around the numbers.
TEMPLATE = Path(__file__).with_name("page.md")


def write(folder: Path, page: Path) -> None:
    """Write page and figures from the results in a folder.

    Raises
    ------
    FileNotFoundError
        There are no results of part 1.
    """
    results = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))}
    images = page.parent / "images"
    cases = [results[f"work_precision_{key}"] for key in _ORDER if f"work_precision_{key}" in results]
    if not cases:
        raise FileNotFoundError(f"{folder}: no results of work_precision are here; measure them first")
    quick = any(result["quick"] for result in results.values())
    sections = [line for name, section in SECTIONS if name in results for line in (*section(results[name], images), "")]
    text = TEMPLATE.read_text(encoding="utf-8").format(
        note="**Measured with `QUICK=1`: these numbers only show that the scripts run.**\n\n" if quick else "",
        machine="\n".join(_machine(results)),
        summary="\n".join(_summary(cases)),
        level=f"{LEVELS[0]:.0e}",
        elsewhere="\n".join(f"- {text}" for name, text in _ELSEWHERE if name in results),
        spread=f"{100 * SPREAD:g} %",
        cases="\n".join(line for case in cases for line in _case(case, images)),
        targets="\n".join(targets(cases, results)),
        sections="\n".join(sections),
        **_conditions(cases),
    )
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text.rstrip() + "\n", encoding="utf-8")


#: Name of a file of results, and what its section tells, for the list on top.
_ELSEWHERE = (
    ("ensemble", "[Ensembles](#ensembles) advance eight parameter sets in the lanes of one core, and on all cores."),
    ("sensitivity_cost", "[Derivatives](#number-of-parameters) by any number of parameters come out of the same run."),
    (
        "sensitivity_error",
        "[How accurate derivatives are](#errors-of-derivatives) is a question of its own: pass `sensitivity_rtol`.",
    ),
    (
        "regeneration",
        "Changing a number compiles nothing; [from a scene to a model](#from-scene-to-model) takes seconds.",
    ),
)

#: A load below this is that of the benchmarks alone.
QUIET = 1.5

_ORDER = ("stiff", "onesided", "tangent")


def _machine(results: dict[str, Result]) -> list[str]:
    newest = next(iter(results.values()))["machine"]
    packages = ", ".join(f"{name} {version}" for name, version in newest["packages"].items())
    lines = [
        f"Machine: {newest['processor']}, {newest['cores']} cores, {newest['vectors'] or 'no wide vectors'}; "
        f"{newest['system']}; {newest['compiler']}; Python {newest['python']}; {packages}."
    ]
    begun, after = (
        [result["machine"][when] for result in results.values() if result["machine"].get(when) is not None]
        for when in ("load", "load_after")
    )
    if begun:
        quiet = max(begun) < QUIET
        lines += [
            "",
            f"Load of the machine (programs that wanted a processor, these included): {min(begun):.1f} to "
            f"{max(begun):.1f} when parts began"
            + (f", {min(after):.1f} to {max(after):.1f} when they ended. " if after else ". ")
            + ("It was quiet otherwise." if quiet else "It was not quiet: times may be long, ratios less so."),
        ]
    return lines


def _summary(cases: Sequence[Result]) -> list[str]:
    """What to take from the page first: time of a cycle, and what each peer takes at the loosest error compared."""
    curves = {case["case"]: {c["key"]: curve(c) for c in case["contenders"]} for case in cases}
    labels = {c["key"]: c["label"] for case in cases for c in case["contenders"]}
    for each in curves.values():
        each["hand-best"] = lower([points for key, points in each.items() if key.startswith("hand-")])
        each["numpy-best"] = lower(
            [points for key, points in each.items() if key.startswith("scipy-") and key.endswith("-numpy")]
        )
    labels |= {"hand-best": "by hand in C, best method", "numpy-best": "best of SciPy with NumPy"}
    own = {name: time_at(each["stepper"], LEVELS[0]) for name, each in curves.items()}
    peers = [key for key in labels if not key.startswith(("stepper", "hand-", "simulate", "numpy-"))]
    rows = [["**raceway**, ms a cycle", *(f"**{milliseconds(own[case['case']])}**" for case in cases)]]
    for key in ("hand-best", *(key for key in peers if not key.endswith("-numpy")), "numpy-best"):
        cells = []
        for case in cases:
            taken, mine = time_at(curves[case["case"]].get(key, ()), LEVELS[0]), own[case["case"]]
            cells.append("–" if taken is None or mine is None else f"{float(f'{taken / mine:.2g}'):g}×")
        rows.append([labels[key], *cells])
    return table(["", *(case["words"] for case in cases)], rows)


def _conditions(cases: Sequence[Result]) -> dict[str, object]:
    """What all cases have in common, for the template."""
    rates: dict[str, float] = {}
    for case in cases:
        for name, value in case["rate_agreement"].items():
            rates[name] = max(value, rates.get(name, 0.0))
    return {
        "transient": cases[0]["transient_cycles"],
        "points": f"{cases[0]['points']:,}".replace(",", " "),
        "members": cases[0]["members"],
        "reference": " and ".join(cases[0]["reference"]["methods"]),
        "agreement": f"{max(case['reference']['worst_agreement'] for case in cases):.0e}",
        "rates": ", ".join(f"{name} within {value:.0e}" for name, value in rates.items()),
    }


def _case(case: Result, images: Path) -> list[str]:
    contenders = case["contenders"]
    curves: dict[str, figures.Curve] = {c["key"]: curve(c) for c in contenders}
    curves["hand-best"] = lower([curves[c["key"]] for c in contenders if c["key"].startswith("hand-")])
    labels = {c["key"]: c["label"] for c in contenders} | {
        "stepper": "stepper (auto)",
        "hand-best": "by hand in C, best",
    }
    figures.work_precision(images / f"bench_{case['case']}.png", case["words"], curves)
    base = {level: time_at(curves["stepper"], level) for level in LEVELS}
    rows = []
    for c in contenders:
        if "absent" in c:
            rows.append([c["label"], *(c["absent"], *[""] * (2 * len(LEVELS) - 1))])
            continue
        cells = [labels[c["key"]]]
        for level in LEVELS:
            taken, own = time_at(curves[c["key"]], level), base[level]
            cells += [milliseconds(taken), "–" if taken is None or own is None else f"{taken / own:.3g}"]
        rows.append(cells)
    head = ["ms a cycle at error", *(word for level in LEVELS for word in (f"{level:.0e}", "× stepper"))]
    lines = [
        f"### Damping {case['words']}",
        "",
        f"![Time against error, damping {case['words']}](images/bench_{case['case']}.png)",
        "",
        "*In the figure a library stands for the best of its methods at every error; all that were measured are in the "
        "table.*",
        "",
        *table(head, rows),
        "",
    ]
    return lines + _faults(contenders)


def _faults(contenders: Sequence[Result]) -> list[str]:
    lines = []
    for c in contenders:
        faults = [(row["tolerance"], row["fault"]) for row in c.get("runs", ()) if "fault" in row]
        if faults:
            where = ", ".join(f"{tolerance:.0e}" for tolerance, _ in faults)
            lines.append(f"- {c['label']} failed at tolerance {where}: {faults[0][1]}")
    return [*lines, ""] if lines else []


def _one_step(result: Result, _: Path) -> list[str]:
    def nanoseconds(value: Result) -> str:
        return f"{1e9 * value['median']:.3g} ({1e9 * value['p10']:.3g} … {1e9 * value['p90']:.3g})"

    rates = [row for row in result["rows"] if row["kind"] == "rate"]
    steps = [row for row in result["rows"] if row["kind"] == "step"]
    return [
        "## One right-hand side, one step",
        "",
        f"Median and 10th to 90th percentile, damping case `{result['case']}`. One right-hand side alone, load and "
        "sines of its own time included:",
        "",
        *table(
            ["right-hand side", "ns"],
            [[row["label"], row.get("absent") or nanoseconds(row["seconds_each"])] for row in rates],
        ),
        "",
        f"Within a run at tolerance {result['tolerance']:.0e} without outputs: a step, and the run's time over its "
        "evaluations (stage algebra, linear systems and step control included; stages at one time share its load):",
        "",
        *table(
            ["method", "ns a step", "ns an evaluation"],
            [
                [row["label"], nanoseconds(row["seconds_each"]), nanoseconds(row["seconds_an_evaluation"])]
                for row in steps
            ],
        ),
    ]


def _balls(result: Result, images: Path) -> list[str]:
    figures.balls(images / "bench_balls.png", result["rows"], result["fits"])
    rows = [
        [
            f"{row['balls']} balls, {row['method']}",
            f"{1e9 * row['seconds_an_evaluation']['median']:.3g}",
            milliseconds(row["seconds"]["median"]),
            str(row["evaluations"]),
            f"{row['kernel_bytes'] / 1024:.1f}",
        ]
        for row in result["rows"]
    ]
    fits = [
        f"- {fit['method']}: {1e9 * fit['seconds_without']:.3g} ns + {1e9 * fit['seconds_a_ball']:.3g} ns a ball, "
        f"every point within {100 * fit['largest_deviation']:.0f} % of the line."
        for fit in result["fits"]
    ]
    return [
        "## Number of balls",
        "",
        "The press with small balls (1.5 mm), whose contact stiffness and damping together stay the same, so that the "
        f"motion hardly depends on their number. Tolerance {result['tolerance']:.0e}, no outputs.",
        "",
        "![Time of an evaluation against the number of balls](images/bench_balls.png)",
        "",
        *table(["", "ns an evaluation", "ms a cycle", "evaluations", "kernels.h, kB"], rows),
        "",
        *fits,
    ]


def _regeneration(result: Result, images: Path) -> list[str]:
    words = {
        "cold": "Nothing there: everything is derived, written and compiled",
        "warm": "Everything there",
        "number": "A number in the scene has changed",
    }
    # what reads a changed number reads the scene again: its stage "read" is not counted twice
    counted = {
        how: {stage: value for stage, value in stages.items() if stage != "read" or how != "number"}
        for how, stages in result["stages"].items()
    }
    figures.regeneration(images / "bench_regeneration.png", counted, words)
    lines = ["## From scene to model", "", f"Each time a new process; medians over {result['repeats']}, in ms.", ""]
    lines += ["![Time of each stage from a scene to its first cycle](images/bench_regeneration.png)", ""]
    for how, stages in result["stages"].items():
        rows = [[stage, milliseconds(value["median"])] for stage, value in stages.items()]
        total = sum(value["median"] for stage, value in stages.items() if stage != "read" or how != "number")
        lines += [f"**{words[how]}**", "", *table(["stage", "ms"], [*rows, ["sum", milliseconds(total)]]), ""]
    again = "something was compiled again" if result["compiled_again"] else "nothing was compiled again"
    return [
        *lines,
        f"Warm, and after a changed number, {again}. `read` is the scene alone; `generate` reads it once more.",
    ]


def _sensitivity_cost(result: Result, images: Path) -> list[str]:
    words = {case.key: case.words for case in CASES}[figures.COST_CASE]
    figures.sensitivity_costs(images / "bench_sensitivity_cost.png", result["rows"], words)
    fits = [
        f"- {fit['way']}, `{fit['case']}`: {fit['without']:.3g} plain runs, and {fit['a_block']:.3g} for every eight "
        f"parameters begun; every point within {100 * fit['largest_deviation']:.0f} % of this line."
        for fit in result["fits"]
    ]
    agreement = [row["agreement"] for row in result["rows"] if "agreement" in row]
    return [
        "## Number of parameters",
        "",
        "Derivatives of the cycle's states by parameters: time over that of the plain run of the same method, measured "
        f"side by side, medians, tolerance {result['tolerance']:.0e}. Rows of the stepper are its driver alone; "
        "`model.simulate` is what a user types, against `model.sensitivities`, with checks, outputs and 2 000 points. "
        "CasADi's and the differences give derivatives at the end of the cycle only."
        + (f" Those of CasADi agree with the stepper's within {max(agreement):.0e}." if agreement else ""),
        "",
        "![Cost of derivatives against the number of parameters](images/bench_sensitivity_cost.png)",
        "",
        *sensitivity_cost.lines(result),
        "",
        *fits,
    ]


def _sensitivity_error(result: Result, images: Path) -> list[str]:
    sensitivity_error.figure(images / "bench_sensitivity_error.png", result)
    names = ", ".join(f"`{name}`" for name in result["names"])
    return [
        "## Errors of derivatives",
        "",
        f"Over {result['members']} parameter sets: the largest error of any state, and of any state's derivative by "
        f"{names}, at 100 points of the cycle, over the largest value of each. Left columns: step sizes follow the "
        "states alone, and the derivatives are those of the steps taken. Right columns: the derivatives take part "
        "(`sensitivity_rtol`), with the same tolerance; the last column says how many more steps that takes.",
        "",
        "![Errors of states and derivatives against tolerance](images/bench_sensitivity_error.png)",
        "",
        *sensitivity_error.lines(result),
        "Without control, derivatives can be worthless while the states are right: an explicit method whose steps are "
        "held near the limit of stability keeps the states still and lets a derivative grow; and where a contact "
        "opens, the rate of a derivative jumps (one-sided damping) or has no bound (tangent damping), which the "
        "states' error does not show.",
    ]


def _ensemble(result: Result, images: Path) -> list[str]:
    figures.ensembles(images / "bench_ensemble.png", result)
    return [
        "## Ensembles",
        "",
        f"{result['members']:,} parameter sets".replace(",", " ")
        + f", {result['cycles']} cycles each, rtol {result['rtol']:.0e}. Processor time for a member and cycle: the "
        "driver of single runs alone on prepared arrays; `simulate_many` without lanes and with them, preparation "
        "included; with reductions of states (`rms:`, `range:`), and of balls as well (`max:ball.force`). *Lanes*: "
        "single run over lanes. *Threads*: wall time on one thread over that on two; *possible*: the same for two "
        "threads that only hash bytes, which is what the machine lets two threads gain.",
        "",
        "![Throughput of ensembles against lanes and threads](images/bench_ensemble.png)",
        "",
        *ensemble.lines(result),
    ]


def _jacobians(result: Result, _: Path) -> list[str]:
    return [
        "## Jacobians",
        "",
        f"One call at a state of `{result['scene']}` under the punch's load. *Code*: the compiled function through its "
        "buffer. *Prepared*: `model.jacobian_function`, with a state copied in and the entries picked. *Dense*: "
        "`model.jacobian`, which looks up names and numbers anew. One right-hand side through its buffer: "
        f"{1e6 * result['rhs']:.3g} µs. The last column: central differences, two calls for each column.",
        "",
        *jacobians.lines(result),
    ]


def _arithmetic(result: Result, _: Path) -> list[str]:
    return [
        "## Fast arithmetic",
        "",
        "The stepper is compiled for IEEE arithmetic without contraction. Compiled with `-ffast-math` (NaN kept) and "
        f"fused multiplications, over {result['members']} parameter sets at a tolerance of {result['tolerance']:.0e}: "
        "the largest change of motion, peak force and rms, in units of the tolerance, and the time, paired.",
        "",
        *arithmetic.lines(result),
    ]


#: Name of a file of results, and what makes lines of it.
SECTIONS: tuple[tuple[str, Callable[[Result, Path], list[str]]], ...] = (
    ("one_step", _one_step),
    ("balls", _balls),
    ("sensitivity_cost", _sensitivity_cost),
    ("sensitivity_error", _sensitivity_error),
    ("ensemble", _ensemble),
    ("jacobians", _jacobians),
    ("arithmetic", _arithmetic),
    ("regeneration", _regeneration),
)


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    write(here / "results", here.parent / "docs" / "benchmarks.md")
