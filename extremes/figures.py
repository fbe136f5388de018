"""Figures of the tour."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.point.conditioning import BOUND, equilibrate
from ballpass.runtime.run import inputs as clock
from extremes.case import Row
from extremes.invariants import NO_LOAD
from extremes.models import press, rotor
from extremes.physics import SPEED
from extremes.reference import TURN

#: 1200 pixels wide, shown at 800.
WIDTH, RESOLUTION = 8.0, 150

#: Time over which oscillations are counted [s].
SHORT = 0.01

#: Colour, style and width of lines, the wide ones below: told apart in grey.
LOOKS: tuple[tuple[str, Any, float], ...] = (
    ("black", "-", 1.6),
    ("#0b5394", "--", 1.8),
    ("#c0392b", ":", 2.2),
    ("#d9a441", "-", 5.0),
)


def write(rows: Sequence[Row], folder: Path) -> None:
    """All figures of the page."""
    for name, figure in (
        ("errors", errors(rows)),
        ("speeds", speeds()),
        ("energy", energy()),
        ("condition", condition()),
    ):
        figure.savefig(folder / f"extremes_{name}.png", dpi=RESOLUTION)
        plt.close(figure)


def errors(rows: Sequence[Row]) -> Figure:
    """Error over allowed error of every case that has both, section by section."""
    figure, axes = plt.subplots(figsize=(WIDTH, 3.6), layout="constrained")
    groups = list(dict.fromkeys(row.case.group for row in rows))
    smallest = 1e-12
    labels: list[str] = []
    for group in groups:
        ratios = [
            max(row.finding.error / row.finding.bound, smallest)
            for row in rows
            if row.case.group == group and row.finding and row.finding.error is not None and row.finding.bound
        ]
        if not ratios:
            continue
        place = np.full(len(ratios), float(len(labels))) + np.linspace(-0.3, 0.3, len(ratios))
        axes.plot(ratios, place, ".", color="#1d3557", markersize=6)
        labels.append(f"{group} ({len(ratios)})")
    axes.axvline(1.0, color="black", linestyle="--", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(smallest / 3.0, 30.0)
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()
    axes.set_xlabel("error over allowed error [1] (smaller ones are drawn at 1e-12)")
    axes.grid(axis="x", alpha=0.3)
    return figure


def speeds() -> Figure:
    """Peak ball force of the press over its speed."""
    model = press()
    rpm = np.geomspace(1.0, 60_000.0, 25)
    total, still = [], []
    for value in rpm:
        numbers = {SPEED: value * TURN / 60.0}
        total.append(
            model.reduce(cycles=2 if value < 10.0 else 6, transient=1, parameters=numbers)["ball.force"].maximum
        )
        samples = model.simulate(cycles=1, parameters=numbers, samples_per_cycle=720, rtol=1e-3, transient=0)
        still.append(0.5 * float(np.max(np.hypot(samples["reaction.A.x"], samples["reaction.A.y"]))))
    figure, axes = plt.subplots(figsize=(WIDTH, 4.0), layout="constrained")
    axes.loglog(rpm, np.array(total) / 1e3, "o-", color="black", markersize=4, label="highest force of a ball")
    axes.loglog(rpm, np.array(still) / 1e3, "--", color="#c0392b", label="highest load on the bearing")
    axes.set_xlabel("speed of the crank [rpm]")
    axes.set_ylabel("force [kN]")
    axes.grid(which="both", alpha=0.25)
    axes.legend()
    return figure


def energy() -> Figure:
    """Relative change of the energy of an undamped ring over its oscillations."""
    model = rotor(NO_LOAD)
    figure, axes = plt.subplots(figsize=(WIDTH, 4.4), layout="constrained")
    angles = TURN * np.arange(8) / 8
    stiffness, mass = 13.34e9, 0.5
    for (words, clearance, method, rtol), (color, style, width) in zip(
        (
            ("losing contact, stepper-dp54, 1e-8", -10e-6, "stepper-dp54", 1e-8),
            ("losing contact, stepper-dp54, 1e-10", -10e-6, "stepper-dp54", 1e-10),
            ("losing contact, stepper-dop853, 1e-10", -10e-6, "stepper-dop853", 1e-10),
            ("in contact, stepper-dop853, 1e-11", -120e-6, "stepper-dop853", 1e-11),
        ),
        (LOOKS[0], LOOKS[3], LOOKS[1], LOOKS[2]),  # the wide one is covered by that of the other method
        strict=True,
    ):
        numbers = {
            "shaft.speed": 0.0, "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": mass,
            "bearing.clearance": clearance,
        }  # fmt: skip
        run: dict[str, Any] = {"parameters": numbers, "initial": np.array([20e-6, 6e-6, 0.0, 0.0]), "transient": 0}
        solution = model.simulate(duration=2.0, rtol=rtol, method=method, samples_per_cycle=400, **run)
        x = solution.x
        pressed = np.maximum(
            np.outer(x[:, 0], np.cos(angles)) + np.outer(x[:, 1], np.sin(angles)) - 0.5 * clearance, 0.0
        )
        total = 0.4 * stiffness * np.sum(pressed**2.5, axis=1) + 0.5 * mass * np.sum(x[:, 2:] ** 2, axis=1)
        change = np.maximum(np.abs(total[1:] / total[0] - 1.0), 1e-16)
        # oscillations a second, counted over a short time where each has many samples
        close = model.simulate(duration=SHORT, rtol=1e-8, samples_per_cycle=20_000, **run)
        turns_back = np.count_nonzero(np.diff(np.sign(close["inner.vx"])))
        rate = 0.5 * turns_back / SHORT
        axes.semilogy(
            rate * solution.t[1:] / 1e3,
            change,
            label=words,
            color=color,
            linestyle=style,
            linewidth=width,
            zorder=8.0 - width,
        )
    axes.set_xlabel("oscillations of the ring, in 2 s [1000]")
    axes.set_ylabel("change of energy over energy [1]")
    axes.grid(alpha=0.3)
    figure.legend(
        loc="outside lower center",
        ncols=2,
        fontsize=9,
        title="balls, method, rtol",
        title_fontsize=9,
        frameon=False,
        handlelength=3.5,
    )
    return figure


def condition() -> Figure:
    """Scaled condition number of the reaction matrix over a turn, for cranks of several lengths."""
    model = press()
    kernel = model.kernel("reaction_system")
    figure = plt.figure(figsize=(WIDTH, 4.6), layout="constrained")
    whole, near = figure.subplots(1, 2, sharey=True, width_ratios=(2.0, 1.0))
    degrees = np.unique(np.concatenate([np.linspace(0.0, 360.0, 721), 180.0 + np.linspace(-1.0, 1.0, 201)]))
    for (ratio, words), (color, style, width) in zip(
        ((0.06, "0.06 (shipped)"), (0.9, "0.9"), (0.9999, "0.9999"), (1.0 - 1e-9, "1 - 1e-9")), LOOKS, strict=True
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            numbers = model.numbers({"mechanism.bodies.crank.points.B": 0.1 * ratio})
        values = []
        for angle in degrees:
            t = math.radians(angle) / numbers.values[SPEED]
            u = clock.inputs_at(model.manifest.inputs, numbers.values, t)
            values.append(np.linalg.cond(equilibrate(kernel({"t": 0.0, "u": u, "p": numbers.p, "c": numbers.c}))))
        for axes in (whole, near):
            axes.semilogy(
                degrees, values, label=words, color=color, linestyle=style, linewidth=width, zorder=8.0 - width
            )
    for axes in (whole, near):
        axes.axhline(BOUND, color="black", linestyle=(0, (6, 3)), linewidth=1.0)
        axes.set_xlabel("crank angle [deg]")
        axes.grid(alpha=0.3)
    whole.text(4.0, 1.3 * BOUND, f"above {BOUND:g} a summary warns", va="bottom", fontsize=9)
    whole.set_xlim(0.0, 360.0)
    whole.set_xticks(range(0, 361, 45))
    whole.set_ylabel("scaled condition number [1]")
    whole.set_title("a) a turn", loc="left", fontsize=10)
    near.set_xlim(179.0, 181.0)
    near.set_xticks((179, 180, 181))
    near.set_title("b) around 180°", loc="left", fontsize=10)
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=4,
        fontsize=9,
        title="length of crank over rod",
        title_fontsize=9,
        frameon=False,
        handlelength=3.5,
    )
    return figure
