"""Figures of the page, from the results: readable in grey, by marker and line style."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from benchmarks.curves import LEVELS, lower

#: 1200 pixels wide, shown at 800.
WIDTH, RESOLUTION = 8.0, 150

#: Damping that the figure of the cost of derivatives shows: the one with rows of all ways.
COST_CASE = "onesided"

plt.rcParams.update({"font.size": 9.5, "legend.fontsize": 9.0, "axes.titlesize": 10.5, "figure.titlesize": 11.5})


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How a contender is drawn."""

    color: str
    marker: str
    line: str | tuple[int, tuple[int, int]]
    width: float = 1.4


#: Libraries by name: all their variants, of which the best at each error is drawn.
_LIBRARIES: dict[str, tuple[str, tuple[str, ...], Look]] = {
    "numpy": (
        "SciPy with NumPy:\nLSODA, DOP853, Radau",
        ("scipy-lsoda-numpy", "scipy-dop853-numpy", "scipy-radau-numpy"),
        Look(color="#8a8a8a", marker="x", line="--"),
    ),
    "diffrax": (
        "diffrax:\nTsit5, Kvaerno5",
        ("diffrax-tsit5", "diffrax-kvaerno5"),
        Look(color="#b8860b", marker="<", line="-"),
    ),
    "numba": (
        "SciPy with numba:\nLSODA, DOP853, Radau",
        ("scipy-lsoda-numba", "scipy-dop853-numba", "scipy-radau-numba"),
        Look(color="#741b47", marker="*", line="-."),
    ),
    "casadi": (
        "CasADi, compiled:\nerk, rosenbrock, cvodes",
        ("erk", "rosenbrock", "cvodes-compiled"),
        Look(color="#c0392b", marker="^", line="-"),
    ),
    "sundials": (
        "SUNDIALS CVODE, C:\nBDF, Adams",
        ("cvode-bdf", "cvode-adams", "cvode-adams-newton"),
        Look(color="#38761d", marker="D", line="--"),
    ),
    "numbalsoda": (
        "numbalsoda:\nLSODA, DOP853",
        ("numbalsoda-lsoda", "numbalsoda-dop853"),
        Look(color="#0b5394", marker="s", line=":"),
    ),
}

#: ballpass's own, and the limit.
_STEPPER = ("ballpass's stepper", Look(color="black", marker="o", line="-", width=3.0))
_HAND = ("by hand in C,\nbest method", Look(color="#555555", marker="", line=(0, (1, 1)), width=1.8))
_FAMILIES: dict[str, tuple[str, Look]] = {
    "simulate": ("model.simulate,\noutputs included", Look(color="#8a8a8a", marker="*", line="-.")),
    "stepper-rodas4": ("Rodas4", Look(color="#c0392b", marker="v", line="-")),
    "stepper-rodas5p": ("Rodas5P", Look(color="#0b5394", marker="^", line="--")),
    "stepper-dp54": ("Dormand–Prince 5(4)", Look(color="#38761d", marker="s", line=":")),
    "stepper-dop853": ("DOP853", Look(color="#b8860b", marker="D", line="-.")),
}

Curve = Sequence[tuple[float, float]]


def work_precision(path: Path, words: str, curves: dict[str, Curve]) -> None:
    """Time against error for one damping: the stepper among its peers, and its families.

    Parameters
    ----------
    curves : (error [1], time [s]) of each contender's tolerances, medians
    """
    figure, (upper, lower_axes) = plt.subplots(2, 1, figsize=(WIDTH, 8.8), sharex=True)
    peers = [(label, lower([curves.get(key, ()) for key in keys]), look) for label, keys, look in _LIBRARIES.values()]
    own = (_STEPPER[0], curves.get("stepper", ()), _STEPPER[1])
    hand = (_HAND[0], curves.get("hand-best", ()), _HAND[1])
    families = [(label, curves.get(key, ()), look) for key, (label, look) in _FAMILIES.items()]
    for axes, entries in ((upper, [*peers, own, hand]), (lower_axes, [*families, own, hand])):
        for label, curve, look in entries:
            points = [(e, t) for e, t in curve if 1e-10 < e < 0.3]
            if points:
                errors, times = [e for e, _ in points], [1e3 * t for _, t in points]
                axes.plot(errors, times, label=label, zorder=4 if look is _STEPPER[1] else 3, **_looks(look))
        axes.set_xscale("log")
        axes.set_yscale("log")
        _plain(axes.yaxis)
        axes.set_ylabel("time of one cycle [ms]")
        for error in LEVELS:
            axes.axvline(error, color="#aaaaaa", linewidth=1.0, zorder=0)
        axes.grid(visible=True, which="major", color="#e5e5e5", linewidth=0.6)
        _beside(axes)
    upper.set_title("a) other libraries, each by its best method at every error", loc="left")
    lower_axes.set_title("b) ballpass: methods of its own, and the limit", loc="left")
    lower_axes.set_xlabel("relative error of the quantities of interest [1]; vertical lines: errors of the table")
    upper.invert_xaxis()
    figure.suptitle(f"Work and precision, damping {words}")
    _save(figure, path)


def _looks(look: Look) -> dict[str, Any]:
    return {
        "color": look.color,
        "marker": look.marker or None,
        "linestyle": look.line,
        "linewidth": look.width,
        "markersize": 6.5 if look.marker in ("*", "x") else 5.0,
    }


def _beside(axes: Axes) -> None:
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, labelspacing=0.8, handlelength=3.2)


def _plain(axis: Axis, subs: Sequence[float] = (1.0,)) -> None:
    """Ticks of a logarithmic axis as plain numbers."""
    axis.set_major_locator(LogLocator(10.0, subs=subs, numticks=20))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def balls(path: Path, rows: Sequence[dict[str, Any]], fits: Sequence[dict[str, Any]]) -> None:
    """Cost of an evaluation against the number of balls, with the straight line through it."""
    figure, axes = plt.subplots(figsize=(WIDTH, 4.2))
    for fit, color, marker, style in zip(fits, ("black", "#c0392b"), ("o", "s"), ("-", "--"), strict=False):
        some = [row for row in rows if row["method"] == fit["method"]]
        count = [row["balls"] for row in some]
        times = [1e9 * row["seconds_an_evaluation"]["median"] for row in some]
        axes.plot(count, times, color=color, marker=marker, linestyle="", label=f"{fit['method']}, measured")
        line = [1e9 * (fit["seconds_without"] + fit["seconds_a_ball"] * n) for n in (0, count[-1])]
        slope = 1e9 * fit["seconds_a_ball"]
        words = f"line through it: {line[0]:.3g} ns + {slope:.2g} ns a ball"
        axes.plot((0, count[-1]), line, color=color, linestyle=style, linewidth=1.2, label=words)
    axes.set_xlabel("number of balls [1]")
    axes.set_ylabel("time of an evaluation within a run [ns]")
    axes.set_title("Cost of a right-hand side against the number of balls", loc="left")
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(left=0.0)
    axes.grid(visible=True, color="#e5e5e5", linewidth=0.6)
    axes.legend(loc="lower right")
    _save(figure, path)


def sensitivity_errors(path: Path, cases: Sequence[dict[str, Any]]) -> None:
    """Errors of states and derivatives against tolerance, with and without control; 10th to 90th percentile."""
    panels = plt.subplots(1, len(cases), figsize=(WIDTH, 5.4), sharey=True, squeeze=False)
    figure, row_of_axes = panels[0], panels[1][0]
    looks = (
        ("states alone", "state", Look(color="#8a8a8a", marker="s", line="--")),
        ("states alone", "derivative", Look(color="#c0392b", marker="^", line="--")),
        ("with derivatives", "state", Look(color="black", marker="o", line="-")),
        ("with derivatives", "derivative", Look(color="#0b5394", marker="D", line="-", width=2.2)),
    )
    for axes, case in zip(row_of_axes, cases, strict=True):
        tolerances = [row["tolerance"] for row in case["rows"]]
        for kind, what, look in looks:
            spreads = [row[kind][what] for row in case["rows"]]
            low, high = ([one[part] for one in spreads] for part in ("p10", "p90"))
            axes.fill_between(tolerances, low, high, color=look.color, alpha=0.12, linewidth=0.0)
            steps = "steps follow the states" if kind == "states alone" else "steps follow states and derivatives"
            axes.plot(tolerances, [one["median"] for one in spreads], label=f"{what}; {steps}", **_looks(look))
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.invert_xaxis()
        axes.set_title(f"damping {case['words']}", loc="left")
        axes.set_xlabel("tolerance [1]")
        axes.grid(visible=True, which="major", color="#e5e5e5", linewidth=0.6)
    row_of_axes[0].set_ylabel("largest relative error [1]")
    figure.suptitle("Errors of states and of derivatives: median, and 10th to 90th percentile shaded")
    handles, words = row_of_axes[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=2, frameon=False, fontsize=10, handlelength=3.2)
    _save(figure, path)


def sensitivity_costs(path: Path, rows: Sequence[dict[str, Any]], words: str) -> None:
    """Time of a run with derivatives over that of the plain run, against the number of parameters, for one damping."""
    figure, axes = plt.subplots(figsize=(WIDTH, 4.6))
    looks = (
        ("central differences", "central differences", Look(color="#8a8a8a", marker="x", line=":")),
        ("CasADi rosenbrock, C", "CasADi rosenbrock, C", Look(color="#c0392b", marker="v", line="--")),
        ("CasADi erk, C", "CasADi erk, C", Look(color="#b8860b", marker="^", line="-.")),
        (
            "stepper, 2000 points",
            "ballpass's stepper,\n2000 points",
            Look(color="black", marker="o", line="-", width=2.6),
        ),
        ("model.simulate", "model.sensitivities,\noutputs included", Look(color="#0b5394", marker="s", line="--")),
    )
    counts: set[int] = set()
    for way, label, look in looks:
        some = [row for row in rows if row["way"] == way and row["case"] == COST_CASE and row.get("parameters")]
        if some:
            ratios = [row["times_plain"]["median"] for row in some]
            axes.plot([row["parameters"] for row in some], ratios, label=label, **_looks(look))
            counts |= {row["parameters"] for row in some}
    axes.set_xlabel("number of parameters [1]")
    axes.set_ylabel("time with derivatives over\nthat of the plain run [1]")
    axes.set_title(f"Cost of derivatives, damping {words}", loc="left")
    axes.set_yscale("log")
    _plain(axes.yaxis, (1.0, 2.0, 5.0))
    axes.set_xticks(sorted(counts))
    axes.grid(visible=True, color="#e5e5e5", linewidth=0.6)
    _beside(axes)
    _save(figure, path)


def ensembles(path: Path, result: dict[str, Any]) -> None:
    """Members times cycles a second of every damping: one by one, in lanes, and on a second thread."""
    figure, axes = plt.subplots(figsize=(WIDTH, 4.6))
    bars = (
        ("one by one, 1", "one at a time, 1 thread", "#ffffff", "///"),
        ("end, 1", "eight lanes, 1 thread", "#9db8d2", ""),
        ("end, 2", "eight lanes, 2 threads", "#1d3557", ""),
    )
    cases, width = result["cases"], 0.26
    for k, (name, label, color, hatch) in enumerate(bars):
        places = [n + (k - 1) * width for n in range(len(cases))]
        rates = [1e-3 * case["rows"][name]["per_second"] for case in cases]
        drawn = axes.bar(places, rates, width, color=color, hatch=hatch, edgecolor="black", linewidth=0.8, label=label)
        # above the bars of the second thread is the line of what was possible
        inside = {"padding": -14, "color": "white"} if name == "end, 2" else {"padding": 2}
        axes.bar_label(drawn, [f"{rate:.1f}" for rate in rates], **inside)
    reach = 1.5 * width
    for n, case in enumerate(cases):
        limit = 1e-3 * case["ratios"]["possible"]["median"] * case["rows"]["end, 1"]["per_second"]
        label = "what two threads that only\nhash would gain" if n == 0 else "_nolegend_"
        axes.plot((n + reach - width, n + reach), (limit, limit), color="#c0392b", linestyle="--", label=label)
    axes.set_xticks(range(len(cases)), ["damping\n" + case["words"].replace(", ", ",\n") for case in cases])
    axes.set_ylabel("members × cycles a second, wall time [1000/s]")
    axes.set_title(f"Ensembles of {result['members']} members: throughput", loc="left")
    axes.grid(visible=True, axis="y", color="#e5e5e5", linewidth=0.6)
    axes.set_axisbelow(True)
    _beside(axes)
    _save(figure, path)


def regeneration(path: Path, stages: dict[str, dict[str, dict[str, float]]], words: dict[str, str]) -> None:
    """Seconds of each stage from a scene to a first cycle, one panel a way to begin, all on one scale."""
    heights = [len(found) + 1.2 for found in stages.values()]
    figure, panels = plt.subplots(
        len(stages),
        1,
        figsize=(WIDTH, 0.27 * sum(heights) + 1.2),
        sharex=True,
        squeeze=False,
        gridspec_kw={"height_ratios": heights},
    )
    longest = max(value["median"] for found in stages.values() for value in found.values())
    for axes, (how, found) in zip(panels[:, 0], stages.items(), strict=True):
        times = [value["median"] for value in found.values()]
        compiled = [stage.startswith("C compiler") for stage in found]
        colors = ["#9db8d2" if c else "#1d3557" for c in compiled]
        drawn = axes.barh(range(len(found)), times, color=colors, edgecolor="black", linewidth=0.8)
        for bar, c in zip(drawn, compiled, strict=True):
            bar.set_hatch("///" if c else "")
        axes.bar_label(drawn, [f"{time:.2g} s" for time in times], padding=3)
        axes.set_yticks(range(len(found)), list(found))
        axes.invert_yaxis()
        axes.set_title(f"{words[how]}: {sum(times):.2g} s", loc="left")
        axes.grid(visible=True, axis="x", color="#e5e5e5", linewidth=0.6)
        axes.set_axisbelow(True)
    panels[-1, 0].set_xlim(0.0, 1.12 * longest)
    panels[-1, 0].set_xlabel("time [s]; hatched: C compiler")
    figure.suptitle("From a scene to its first cycle")
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.set_layout_engine("constrained")
    figure.savefig(path, dpi=RESOLUTION, metadata={"Software": None})
    plt.close(figure)
