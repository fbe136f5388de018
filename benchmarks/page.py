"""The page of the benchmarks: results in, Markdown and a figure for each damping out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ballpass.runtime.plot.style import MANY, new_figure, save, styled
from benchmarks.work_precision import LEVELS, curve, time_at

Result = Mapping[str, Any]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Markdown table, numbers to the right."""
    marks = ["---", *("---:" for _ in head[1:])]
    return [f"| {' | '.join(cells)} |" for cells in (head, marks, *rows)]


def measured(value: Sequence[float], factor: float = 1.0) -> str:
    """Median with 10th and 90th percentile."""
    middle, low, high = (factor * part for part in value)
    return f"{middle:.3g} ({low:.3g} … {high:.3g})"


def write(results: Mapping[str, Result], state: Mapping[str, str], page: Path) -> None:
    """Write the page from the results of the parts that were measured, and its figures beside it."""
    head = Path(__file__).with_name("page.md").read_text(encoding="utf-8")
    for name, value in state.items():
        head = head.replace(f"@{name.upper()}@", value)
    sections = {
        "work_precision": _work_precision,
        "coupling": _coupling,
        "ensembles": _ensembles,
        "sensitivities": _sensitivities,
        "preparation": _preparation,
    }
    (page.parent / "images").mkdir(parents=True, exist_ok=True)
    lines = [head.rstrip()]
    for name, section in sections.items():
        if name in results:
            lines += ["", *section(results[name], page.parent / "images")]
    page.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _work_precision(result: Result, images: Path) -> list[str]:
    lines = ["## Work and precision"]
    for key, case in result.items():
        curves = {label: curve(contender) for label, contender in case["contenders"].items()}
        save(_figure(case, curves), images / f"bench_{key}.png")
        base = [time_at(curves["stepper"], level) for level in LEVELS]
        rows = []
        for label, points in curves.items():
            cells = []
            for level, own in zip(LEVELS, base, strict=True):
                taken = time_at(points, level)
                cells.append("–" if taken is None else f"{1e3 * taken:.3g}")
                cells.append("–" if taken is None or own is None else f"{taken / own:.3g}×")
            rows.append([label, *cells])
        rows += [[f"{label}: {reason}", *["–"] * 6] for label, reason in case["absent"].items()]
        rates = ", ".join(f"{name} within {value:.0e}" for name, value in case["rate_agreement"].items())
        lines += [
            "",
            f"### Damping {case['words']}",
            "",
            f"![Time against error, damping {case['words']}](images/bench_{key}.png)",
            "",
            *table(
                ["ms a cycle at error", *(cell for level in LEVELS for cell in (f"{level:.0e}", "× stepper"))], rows
            ),
            "",
            f"{case['members']} parameter sets (three for runs above 0.1 s). The two references agree within "
            f"{case['reference_agreement']:.0e} of the range of the motion; right-hand sides by hand and the generated "
            f"one: {rates}.",
        ]
    return lines


@styled
def _figure(case: Result, curves: Mapping[str, Sequence[tuple[float, float]]]) -> Figure:
    """Time against error; of each library the best of its methods at every error."""
    figure = new_figure(4.6)
    axes = figure.subplots()
    groups = dict.fromkeys(contender["group"] for contender in case["contenders"].values())
    for look, group in zip(MANY, groups, strict=False):
        some = [curves[label] for label, contender in case["contenders"].items() if contender["group"] == group]
        errors = sorted({error for points in some for error, _ in points}, reverse=True)
        best = [min(t for t in (time_at(points, e) for points in some) if t is not None) for e in errors]
        width = 2.4 if group == "ballpass" else 1.2
        axes.loglog(errors, [1e3 * t for t in best], markersize=4, linewidth=width, label=group, **look)
    axes.set(
        xlabel="largest relative error of motion, peak force and rms", ylabel="time of a cycle [ms]", xlim=(1e-1, 1e-9)
    )
    axes.set_title(f"One cycle of the press, damping {case['words']}")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _coupling(result: Result, _: Path) -> list[str]:
    base = next(iter(result["scenes"].values()))
    body = [
        [words, f"{1e3 * taken:.3g}", f"{taken / base:.3g}×", measured(result["lanes"][words])]
        for words, taken in result["scenes"].items()
    ]
    lines = [
        "## Bearings coupled both ways",
        "",
        f"Raw calls of the stepper: the first turn of each scene from rest, at an error of {result['level']:.0e} of "
        f"the range of the rings' motion; references agree within {result['agreement']:.0e}. *Lanes*: members a second "
        "of an ensemble in SIMD lanes over one by one, on one thread.",
        "",
        *table(["", "ms a turn", "× one-way", "lanes"], body),
        "",
    ]
    if "absent" in result:
        return [*lines, f"Exudyn: {result['absent']}."]
    own = result["exudyn"]["ballpass"]
    times = ", ".join(f"{name} {1e3 * s:.3g} ms ({s / own:.3g}×)" for name, s in result["exudyn"]["seconds"].items())
    finest = min(error for curve in result["exudyn"]["curves"].values() for error, _ in curve)
    return [
        *lines,
        f"The machine with two-way bearings at A in Exudyn, same turn, same error: {times}; ballpass {1e3 * own:.3g} "
        "ms. There bodies have absolute coordinates, joints and drive are constraints, all balls are one connector "
        "with a symbolic user function, steps are equal and end on the edges of the punch's window; its explicit "
        f"integrators take no constraints. Its motion comes as close as {finest:.0e} to the reference with smaller "
        "steps: it is the same machine.",
    ]


def _ensembles(result: Result, _: Path) -> list[str]:
    ways = list(dict.fromkeys(way for rows in result["cases"].values() for way in rows))
    body = [[way, *(measured(rows[way]) for rows in result["cases"].values())] for way in ways]
    return [
        "## Ensembles",
        "",
        f"{result['members']} parameter sets (a tenth of them one by one), {result['cycles']} cycles each, rtol "
        f"{result['rtol']:.0e}, preparation included. Members times cycles a second; median and 10th to 90th "
        "percentile over the rounds. *End*: `end:inner.y`; *states*: `rms:`, `range:` of `inner.y`; "
        "*balls*: `max:ball.force` too.",
        "",
        *table(["members × cycles a second", *result["cases"]], body),
    ]


def _sensitivities(result: Result, _: Path) -> list[str]:
    counts = list(next(iter(result["cases"].values()))["ratios"])
    body = [
        [words, measured(case["plain"], 1e3), *(f"{case['ratios'][count][0]:.3g}×" for count in counts)]
        for words, case in result["cases"].items()
    ]
    lines = [
        "## Derivatives",
        "",
        "Derivatives of the states of a cycle by parameters: time of `model.sensitivities` over that of "
        f"`model.simulate`, measured side by side, rtol {result['rtol']:.0e}. Central differences cost two plain "
        "runs a parameter.",
        "",
        *table(["", "plain run, ms", *(f"{count} parameters" for count in counts)], body),
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
