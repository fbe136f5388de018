"""Sections of the page behind work and precision: content of a file of results in, lines of Markdown and a figure out.

`SECTIONS` names the file of each and its order on the page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks import arithmetic, ensemble, figures, jacobians, sensitivity_cost, sensitivity_error
from benchmarks.problem import CASES
from benchmarks.tables import milliseconds, spread_of, table

Result = dict[str, Any]


def _one_step(result: Result, _: Path) -> list[str]:
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
            [[row["label"], row.get("absent") or spread_of(row["seconds_each"], 1e9)] for row in rates],
        ),
        "",
        f"Within a run at tolerance {result['tolerance']:.0e} without outputs: a step, and the run's time over its "
        "evaluations (stage algebra, linear systems and step control included; stages at one time share its load):",
        "",
        *table(
            ["method", "ns a step", "ns an evaluation"],
            [
                [row["label"], *(spread_of(row[what], 1e9) for what in ("seconds_each", "seconds_an_evaluation"))]
                for row in steps
            ],
        ),
    ]


def _balls(result: Result, images: Path) -> list[str]:
    figures.balls(images / "bench_balls.png", result["rows"], result["fits"])
    rows = [
        [
            f"{row['balls']} balls, {row['method']}",
            spread_of(row["seconds_an_evaluation"], 1e9),
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
        f"motion hardly depends on their number. Tolerance {result['tolerance']:.0e}, no outputs; medians and 10th "
        "to 90th percentile.",
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
    lines = [
        "## From scene to model",
        "",
        f"Each time a new process; medians over {result['repeats']} and 10th to 90th percentile, in ms.",
        "",
    ]
    lines += ["![Time of each stage from a scene to its first cycle](images/bench_regeneration.png)", ""]
    for how, stages in result["stages"].items():
        rows = [[stage, spread_of(value, 1e3)] for stage, value in stages.items()]
        total = sum(value["median"] for stage, value in stages.items() if stage != "read" or how != "number")
        lines += [f"**{words[how]}**", "", *table(["stage", "ms"], [*rows, ["sum", milliseconds(total)]]), ""]
    again = "something was compiled again" if result["compiled_again"] else "nothing was compiled again"
    written, taken = result["written"], result["stages"]["number"]["generate: numbers only"]["median"]
    return [
        *lines,
        f"Warm, and after a changed number, {again}. `read` is the scene alone; `generate` reads it once more.",
        "",
        "What a changed number writes, found from all files of the generated folder and of the compiled cache before "
        f"and after. Changed in the scene file: {_files(written['scene'])}; the scene is read and checked again and "
        f"the manifest gets the new numbers, {milliseconds(taken)} ms together, and the time of a new process besides. "
        f'Given on the command line, `--set bearing.clearance="12 um"`: {_files(written["set"])}, but the results.',
    ]


def _files(written: dict[str, list[str]]) -> str:
    """Files in generated folder and cache, in words."""
    texts = [
        f"in the {place} " + (", ".join(f"`{name}`" for name in written[key]) if written[key] else "nothing")
        for key, place in (("generated", "generated folder"), ("cache", "compiled cache"))
    ]
    return " and ".join(texts) if any(written.values()) else "nothing, in neither of them"


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
        "CasADi's and the differences give derivatives at the end of the cycle only. The stepper's come in blocks of "
        "eight: five parameters cost as much as eight."
        f" From the 10th to the 90th percentile of the rounds, ratios differ by {_widest(result['rows'])}."
        + (f" Those of CasADi agree with the stepper's within {max(agreement):.0e}." if agreement else ""),
        "",
        "![Cost of derivatives against the number of parameters](images/bench_sensitivity_cost.png)",
        "",
        *sensitivity_cost.lines(result),
        "",
        *fits,
    ]


def _widest(rows: Sequence[Result]) -> str:
    """Spread of ratios over the rounds, relative to their medians: of the middle row and of the widest."""
    spreads = [row["times_plain"] for row in rows if row.get("parameters")]
    relative = [100 * (one["p90"] - one["p10"]) / one["median"] for one in spreads]
    return f"{median(relative):.2g} % in the median row and by {max(relative):.2g} % in the widest"


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
    rows = result["cases"][0]["rows"]
    counts = {name: f"{rows[name]['members']:,}".replace(",", " ") for name in ("single", "states, 1", "end, 1")}
    return [
        "## Ensembles",
        "",
        f"{counts['end, 1']} parameter sets, {result['cycles']} cycles each, rtol {result['rtol']:.0e}; "
        f"{result['rounds']} rounds, medians, and the 10th and 90th percentile of ratios over the rounds. Processor "
        "time for a member and cycle: the driver of single runs alone on prepared arrays; `simulate_many` without "
        "lanes and with them, preparation included; with reductions of states (`rms:`, `range:`), and of balls as well "
        f"(`max:ball.force`). Single runs are {counts['single']} of these parameter sets, runs with reductions "
        f"{counts['states, 1']}. *Threads*: wall time on one thread over that on two; *possible*: the same for two "
        "threads that only hash bytes, which is what the machine lets two threads gain.",
        "",
        "![Throughput of ensembles against lanes and threads](images/bench_ensemble.png)",
        "",
        "The second table compares lanes with single runs, and the median errors of both, over "
        f"{result['checked']} of the parameter sets, at this tolerance: of the rms of `inner.y` and of the peak ball "
        "force behind the transient, relative to runs with kinks located at rtol "
        f"{result['reference_rtol']:.0e}. *As each chooses*: lanes know Dormand–Prince 5(4) and Rodas5P; a single run "
        "with light damping may take DOP853, which is another method with other errors. *Both*: the same method on "
        "either side, so that only lanes differ. The peak comes with the punch, behind which every run starts anew, "
        "single ones with Dormand–Prince too: there the errors are alike.",
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
        "",
        "Other roundings move the last digits. Where an impact decides the next they grow, until steps are accepted "
        "and rejected elsewhere and the error of a run is another draw. So the stepper is compiled without, and no "
        "build of it has other arithmetic than IEEE's.",
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
