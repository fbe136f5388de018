"""The page of the benchmarks.

In: results.  Out: Markdown, and a figure with its caption for each damping.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ballpass.runtime.plot.style import GREY, MANY, caption, caption_of, log_ticks, new_figure, save, styled
from benchmarks.first_use import ASKED
from benchmarks.work_precision import LEVELS, curve, time_at

Result = Mapping[str, Any]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Markdown table, numbers to the right."""
    marks = ["---", *("---:" for _ in head[1:])]
    return [f"| {' | '.join(cells)} |" for cells in (head, marks, *rows)]


def measured(value: Sequence[float], factor: float = 1.0) -> str:
    """Median with 10th and 90th percentile."""
    middle, low, high = (rounded(factor * part) for part in value)
    return f"{middle} ({low} … {high})"


def write(parts: Mapping[str, Result], page: Path) -> None:
    """Write the page from the parts that were measured, each a state and a result, and its figures beside it."""
    sections = {
        "work_precision": _work_precision,
        "coupling": _coupling,
        "ensembles": _ensembles,
        "sensitivities": _sensitivities,
        "preparation": _preparation,
        "first_use": _first_use,
        "questions": _questions,
    }
    (page.parent / "images").mkdir(parents=True, exist_ok=True)
    summary = _summary(parts["work_precision"]["result"]) if "work_precision" in parts else []
    machine = next(iter(parts.values()))["state"]["machine"]
    head = Path(__file__).with_name("page.md").read_text(encoding="utf-8").rstrip()
    lines = [head.replace("@MACHINE@", machine).replace("@SUMMARY@", "\n".join(summary))]
    for name, section in sections.items():
        if name in parts:
            heading, *text = section(parts[name]["result"], page.parent / "images")
            state = parts[name]["state"]
            lines += ["", heading, "", f"Measured at commit {state['commit']} on {state['date']}.", *text]
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


def level_words(level: float) -> str:
    """An error as headings have it: 1e-3."""
    return f"{level:.0e}".replace("e-0", "e-")


def rounded(value: float, digits: int = 3) -> str:
    """A number to its digits, never as a power of ten: 5.10, 2700."""
    value = float(f"{value:.{digits}g}")
    return f"{value:.{max(digits - 1 - math.floor(math.log10(value)), 0)}f}"


def _curves(case: Result) -> dict[str, list[tuple[float, float]]]:
    return {label: curve(contender) for label, contender in case["contenders"].items()}


def _summary(result: Result) -> list[str]:
    """What a user would take instead of the stepper, at the loosest of the errors."""
    level, cases = LEVELS[0], [(case, _curves(case)) for case in result.values()]
    base = [time_at(curves["stepper"], level) for _, curves in cases]
    rows = [["**ballpass**, ms a cycle", *("–" if own is None else f"**{rounded(1e3 * own)}**" for own in base)]]
    for label in dict.fromkeys(label for case, _ in cases for label in case["contenders"]):
        if any(case["contenders"].get(label, {}).get("group") == "ballpass" for case, _ in cases):
            continue
        taken = [time_at(curves.get(label, []), level) for _, curves in cases]
        rows.append([label, *(_times(t, own, 2) for t, own in zip(taken, base, strict=True))])
    return [
        "## What to take from it",
        "",
        f"At an error of {level_words(level)}: milliseconds of ballpass's stepper; how many times as long others take.",
        "The columns are three dampings of the contacts, from stiff to light: the paper's number read in SI; the same",
        "read in mm, as in `scenes/punching_press.toml`; that of `scenes/punching_press_tangent.toml`.",
        "",
        *table(["", *(case["words"] for case, _ in cases)], rows),
    ]


def _times(taken: float | None, own: float | None, digits: int) -> str:
    """How many times as long."""
    return "–" if taken is None or own is None else f"{rounded(taken / own, digits)}×"


def _work_precision(result: Result, images: Path) -> list[str]:
    lines = ["## Work and precision"]
    for key, case in result.items():
        curves = _curves(case)
        figure = _figure(case, curves)
        save(figure, images / f"bench_{key}.png")
        base = [time_at(curves["stepper"], level) for level in LEVELS]
        rows = []
        for label, points in curves.items():
            cells = []
            for level, own in zip(LEVELS, base, strict=True):
                taken = time_at(points, level)
                cells.append("–" if taken is None else rounded(1e3 * taken))
                cells.append(_times(taken, own, 3))
            rows.append([label, *cells])
        rows += [[f"{label}: {reason}", *["–"] * 6] for label, reason in case["absent"].items()]
        rates = ", ".join(f"{name} within {value:.0e}" for name, value in case["rate_agreement"].items())
        lines += [
            "",
            f"### Damping {case['words']}",
            "",
            f"![{figure.get_suptitle()}](images/bench_{key}.png)",
            "",
            f"*{caption_of(figure)}*",
            "",
            *table(
                ["ms a cycle at error", *(cell for level in LEVELS for cell in (level_words(level), "× stepper"))], rows
            ),
            "",
            f"{case['members']} parameter sets (three for runs above 0.1 s). The two references agree within "
            f"{case['reference_agreement']:.0e} of the range of the motion; right-hand sides by hand and the generated "
            f"one: {rates}.",
        ]
    return lines


@styled
def _figure(case: Result, curves: Mapping[str, Sequence[tuple[float, float]]]) -> Figure:
    """Time against error; of each library the best of its methods at every error, the slowest on top of the legend."""
    figure = new_figure(5.0)
    axes = figure.add_subplot()
    lines: list[tuple[float, Line2D, str]] = []
    groups = dict.fromkeys(contender["group"] for contender in case["contenders"].values())
    for look, group in zip(MANY, groups, strict=False):
        some = [curves[label] for label, contender in case["contenders"].items() if contender["group"] == group]
        errors = sorted({error for points in some for error, _ in points}, reverse=True)
        best = [min(t for t in (time_at(points, e) for points in some) if t is not None) for e in errors]
        width, size = (2.6, 3.5) if group == "ballpass" else (1.2, 4.5)
        (line,) = axes.loglog(errors, [1e3 * t for t in best], markersize=size, linewidth=width, zorder=3, **look)
        lines.append((best[0], line, group))
    for level in LEVELS:
        axes.axvline(level, color=GREY, linewidth=0.9, linestyle=(0, (1, 1.5)))
    axes.set(xlabel="largest relative error of motion, peak force and rms [1]", ylabel="time of a cycle [ms]")
    axes.set_xlim(1e-1, 1e-9)
    log_ticks(axes.xaxis)
    log_ticks(axes.yaxis)
    _, handles, labels = zip(*sorted(lines, key=lambda line: -line[0]), strict=True)
    axes.legend(handles, labels, loc="center left", bbox_to_anchor=(1.01, 0.5))
    caption(
        figure,
        f"Time against error, damping {case['words']}",
        "One cycle of the press. A line is the best of a library's methods at every error; dotted: the errors of the "
        "table.",
    )
    return figure


def _coupling(result: Result, _: Path) -> list[str]:
    base = next(iter(result["scenes"].values()))
    body = [
        [words, rounded(1e3 * taken), f"{rounded(taken / base)}×", measured(result["lanes"][words])]
        for words, taken in result["scenes"].items()
    ]
    lines = [
        "## Bearings coupled both ways",
        "",
        "Raw calls of the stepper: the first turn of each scene from rest, at an error of "
        f"{level_words(result['level'])} of the range of the rings' motion; references agree within "
        f"{result['agreement']:.0e}. *Lanes*: members a second of an ensemble in SIMD lanes over one by one, on one "
        "thread.",
        "",
        *table(["", "ms a turn", "× one-way", "lanes"], body),
        "",
    ]
    if "absent" in result:
        return [*lines, f"Exudyn: {result['absent']}."]
    own = result["exudyn"]["ballpass"]
    seconds = result["exudyn"]["seconds"]
    times = ", ".join(f"{name} {rounded(1e3 * s)} ms ({_times(s, own, 3)})" for name, s in seconds.items())
    finest = min(error for curve in result["exudyn"]["curves"].values() for error, _ in curve)
    return [
        *lines,
        f"The machine with two-way bearings at A in Exudyn, same turn, same error: {times}; ballpass "
        f"{rounded(1e3 * own)} ms. There bodies have absolute coordinates, joints and drive are constraints, all balls "
        "are one connector with a symbolic user function, steps are equal and end on the edges of the punch's window; "
        f"its explicit integrators take no constraints. Its motion comes as close as {finest:.0e} to the reference "
        "with smaller steps: it is the same machine.",
    ]


def _ensembles(result: Result, _: Path) -> list[str]:
    members = f"{result['members']:_}".replace("_", " ")
    ways = list(dict.fromkeys(way for rows in result["cases"].values() for way in rows))
    body = [[way, *(measured(rows[way]) for rows in result["cases"].values())] for way in ways]
    return [
        "## Ensembles",
        "",
        f"{members} parameter sets (a tenth of them one by one), {result['cycles']} cycles each, rtol "
        f"{result['rtol']:.0e}, preparation included. Members times cycles a second; median and 10th to 90th "
        "percentile over the rounds. *End*: `end:inner.y`; *states*: `rms:`, `range:` of `inner.y`; "
        "*balls*: `max:ball.force` too; *life*: `max:ball.force` and the rating life.",
        "",
        *table(["members × cycles a second", *result["cases"]], body),
    ]


def _sensitivities(result: Result, _: Path) -> list[str]:
    counts = list(next(iter(result["cases"].values()))["ratios"])
    body = [
        [words, measured(case["plain"], 1e3), *(f"{rounded(case['ratios'][count][0])}×" for count in counts)]
        for words, case in result["cases"].items()
    ]
    lines = [
        "## Derivatives",
        "",
        "Derivatives of the states of a cycle by parameters: time of `model.sensitivities` over that of "
        f"`model.simulate`, measured side by side, rtol {result['rtol']:.0e}. Central differences cost two plain "
        "runs a parameter.",
        "",
        *table(["", "plain run, ms", *(f"{count} parameter{'s' * (count != '1')}" for count in counts)], body),
    ]
    if "query" in result:
        query = result["query"]
        lines += [
            "",
            f"A full query, `model.sensitivity` of {len(query['quantities'])} quantities by all {query['parameters']} "
            f"parameters with a certificate each, takes {query['seconds']:.3g} s of a processor.",
        ]
    return lines


def _preparation(result: Result, _: Path) -> list[str]:
    return [
        "## From a scene to results",
        "",
        f"Each row in a new Python process, in this order; medians over {result['repeats']} and 10th to 90th "
        "percentile.",
        "",
        *table(["", "seconds"], [[words, measured(value)] for words, value in result["steps"].items()]),
    ]


def _first_use(result: Result, _: Path) -> list[str]:
    least = result["1 alike bearing"]

    def row(words: str, own: Result) -> list[str]:
        compilers = [own[asked][0] for asked in ASKED]
        grown = [f"{own[asked][0] / least[asked][0]:.2f}" for asked in ASKED]
        return [
            words,
            f"{own['kilobytes']:.0f}",
            *(f"{sum(own[asked]):.1f} ({own[asked][0]:.1f})" for asked in ASKED),
            f"{compilers[1] / compilers[0]:.2f}, {compilers[2] / compilers[0]:.2f}",
            ", ".join(grown) if "alike" in words else "",
        ]

    head = ["", "kB of C", *(f"first {asked}" for asked in ASKED), "sweep, sensitivity over run", "over one bearing"]
    return [
        "## What is asked for the first time",
        "",
        "Processor seconds of a question in a new process with an empty cache, in brackets those of the compiler; the "
        "compiler's for a first sweep and a first sensitivity over those for a first run; those for run, sweep and "
        "sensitivity over those of one bearing. Alike bearings have elastic outer rings and share the press load.",
        "",
        *table(head, [row(words, own) for words, own in result.items()]),
    ]


def _questions(result: Result, _: Path) -> list[str]:
    rows = [[words, *(f"{part:.3g}" for part in ratio)] for words, ratio in result["ratios"].items()]
    returns = [[words, rounded(count)] for words, count in result["returns"].items() if math.isfinite(count)]
    points = result["points"]
    return [
        "## What questions cost over the runs they are made of",
        "",
        "Processor time over processor time, medians with the 10th and the 90th percentile. Gradients and an optimum's "
        "slopes are of runs at a hundredth of the tolerance of the values, whose steps end on every kink; values and "
        "sweeps go over the kinks, in lanes.",
        "",
        *table(["", "ratio", "10 %", "90 %"], rows),
        "",
        f"A map of the rotor of varying compliance over clearance and speed, {points} by {points} points at a relative "
        f"tolerance of {level_words(result['rtol'])}: returns (from one passing of balls to the next) a second of one "
        "core. DOP853 is compiled, its right-hand side by numba.",
        "",
        *table(["", "returns a second"], returns),
    ]
