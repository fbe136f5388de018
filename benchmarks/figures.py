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


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """How a contender is drawn."""

    color: str
    marker: str
    line: str
    width: float = 1.2


_PEERS = {
    "stepper": Look(color="black", marker="o", line="-", width=2.4),
    "hand-best": Look(color="black", marker="", line=":", width=1.6),
    "numbalsoda": Look(color="#0b5394", marker="s", line="-"),
    "erk": Look(color="#990000", marker="^", line="-"),
    "rosenbrock": Look(color="#990000", marker="v", line="--"),
    "cvodes-compiled": Look(color="#38761d", marker="D", line="-"),
    "cvode-c": Look(color="#38761d", marker="d", line="--"),
    "diffrax-tsit5": Look(color="#7f6000", marker="<", line="-"),
    "diffrax-kvaerno5": Look(color="#7f6000", marker=">", line="--"),
    "scipy-lsoda-numba": Look(color="#741b47", marker="x", line="-"),
    "scipy-lsoda-numpy": Look(color="#666666", marker="x", line="--"),
    "scipy-radau-numpy": Look(color="#666666", marker="+", line=":"),
    "scipy-dop853-numpy": Look(color="#666666", marker="*", line="-."),
}
_FAMILIES = {
    "stepper": Look(color="black", marker="o", line="-", width=2.4),
    "simulate": Look(color="#666666", marker="*", line="-."),
    "stepper-rodas4": Look(color="#990000", marker="v", line="-"),
    "stepper-rodas5p": Look(color="#0b5394", marker="^", line="-"),
    "stepper-dp54": Look(color="#38761d", marker="s", line="-"),
    "stepper-dop853": Look(color="#7f6000", marker="D", line="-"),
    "hand-rodas4": Look(color="#990000", marker="v", line=":"),
    "hand-rodas5p": Look(color="#0b5394", marker="^", line=":"),
    "hand-dp54": Look(color="#38761d", marker="s", line=":"),
}

Curve = Sequence[tuple[float, float]]


def work_precision(path: Path, words: str, curves: dict[str, Curve], labels: dict[str, str]) -> None:
    """Time against error for one damping: the stepper among its peers, and its families.

    Parameters
    ----------
    curves : (error [1], time [s]) of each contender's tolerances, medians
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.5, 7.0), sharex=True)
    for axes, looks in ((left, _PEERS), (right, _FAMILIES)):
        for key, look in looks.items():
            points = [(e, t) for e, t in curves.get(key, ()) if 1e-10 < e < 0.3]
            if not points:
                continue
            axes.plot(
                [e for e, _ in points],
                [1e3 * t for _, t in points],
                color=look.color,
                marker=look.marker,
                linestyle=look.line,
                linewidth=look.width,
                markersize=4.5,
                label=labels.get(key, key),
            )
        _finish(axes)
    left.set_title("stepper and peers", fontsize=10)
    right.set_title("families of the stepper, and the same by hand", fontsize=10)
    left.set_ylabel("time of one cycle [ms]")
    left.invert_xaxis()
    figure.suptitle(f"Work and precision: {words}", fontsize=11)
    _save(figure, path)


def _finish(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("relative error of the quantities of interest [1]")
    for error in (1e-3, 1e-5, 1e-7):
        axes.axvline(error, color="#bbbbbb", linewidth=0.8, zorder=0)
    axes.grid(visible=True, which="major", color="#e5e5e5", linewidth=0.6)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=2, frameon=False)


def balls(path: Path, rows: Sequence[dict[str, Any]], fits: Sequence[dict[str, Any]]) -> None:
    """Cost of an evaluation against the number of balls, with the straight line through it."""
    figure, axes = plt.subplots(figsize=(6.2, 4.2))
    for fit, color, marker in zip(fits, ("black", "#0b5394"), ("o", "s"), strict=False):
        some = [row for row in rows if row["method"] == fit["method"]]
        count = [row["balls"] for row in some]
        axes.plot(
            count,
            [1e9 * row["seconds_an_evaluation"]["median"] for row in some],
            color=color,
            marker=marker,
            linestyle="",
            label=fit["method"],
        )
        line = [1e9 * (fit["seconds_without"] + fit["seconds_a_ball"] * n) for n in (0, count[-1])]
        slope = 1e9 * fit["seconds_a_ball"]
        axes.plot((0, count[-1]), line, color=color, linestyle="--", linewidth=1.0, label=f"{slope:.2g} ns a ball")
    axes.set_xlabel("balls")
    axes.set_ylabel("time of an evaluation within a run [ns]")
    axes.set_ylim(bottom=0.0)
    axes.grid(visible=True, color="#e5e5e5", linewidth=0.6)
    axes.legend(fontsize=8)
    _save(figure, path)


def sensitivity_errors(path: Path, cases: Sequence[dict[str, Any]]) -> None:
    """Errors of states and derivatives against tolerance, with and without control; 10th to 90th percentile."""
    panels = plt.subplots(1, len(cases), figsize=(5.6 * len(cases), 4.4), sharey=True, squeeze=False)
    figure, row_of_axes = panels[0], panels[1][0]
    looks = (
        ("states alone", "state", Look(color="#666666", marker="s", line="--")),
        ("states alone", "derivative", Look(color="#990000", marker="^", line="--")),
        ("with derivatives", "state", Look(color="black", marker="s", line="-")),
        ("with derivatives", "derivative", Look(color="#0b5394", marker="^", line="-", width=2.0)),
    )
    for axes, case in zip(row_of_axes, cases, strict=True):
        tolerances = [row["tolerance"] for row in case["rows"]]
        for kind, what, look in looks:
            spreads = [row[kind][what] for row in case["rows"]]
            axes.fill_between(
                tolerances,
                [one["p10"] for one in spreads],
                [one["p90"] for one in spreads],
                color=look.color,
                alpha=0.12,
                linewidth=0.0,
            )
            axes.plot(
                tolerances,
                [one["median"] for one in spreads],
                color=look.color,
                marker=look.marker,
                linestyle=look.line,
                linewidth=look.width,
                markersize=4.5,
                label=f"{what}; steps follow {'states and derivatives' if kind != 'states alone' else kind}",
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.invert_xaxis()
        axes.set_title(case["words"], fontsize=10)
        axes.set_xlabel("tolerance [1]")
        axes.grid(visible=True, which="major", color="#e5e5e5", linewidth=0.6)
        axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False)
    row_of_axes[0].set_ylabel("largest relative error [1]")
    _save(figure, path)


def sensitivity_costs(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Time of a run with derivatives over that of the plain run, against the number of parameters."""
    figure, axes = plt.subplots(figsize=(6.6, 4.4))
    looks = (
        ("stepper, 2000 points", "stepper", Look(color="black", marker="o", line="-", width=2.0)),
        ("CasADi erk, C", "CasADi erk, C", Look(color="#990000", marker="^", line="-")),
        ("CasADi rosenbrock, C", "CasADi rosenbrock, C", Look(color="#990000", marker="v", line="--")),
        ("central differences", "central differences", Look(color="#666666", marker="x", line=":")),
    )
    for way, label, look in looks:
        some = [row for row in rows if row["way"] == way and row["case"] == "onesided" and row.get("parameters")]
        if not some:
            continue
        axes.plot(
            [row["parameters"] for row in some],
            [row["times_plain"]["median"] for row in some],
            color=look.color,
            marker=look.marker,
            linestyle=look.line,
            linewidth=look.width,
            label=label,
        )
    axes.set_xlabel("parameters")
    axes.set_ylabel("time over that of the plain run of the same method [1]")
    axes.set_yscale("log")
    axes.grid(visible=True, which="both", color="#e5e5e5", linewidth=0.6)
    axes.legend(fontsize=8)
    _save(figure, path)


def _save(figure: Any, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.tight_layout()
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
