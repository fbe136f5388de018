"""Figures of the tour."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from extremes.case import Row
from extremes.invariants import NO_LOAD
from extremes.models import press, rotor
from extremes.physics import SPEED
from extremes.reference import TURN
from raceway.runtime.conditioning import BOUND, equilibrate
from raceway.runtime.integrate import clock

RESOLUTION = 130


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
    figure, axes = plt.subplots(figsize=(7.5, 3.6), layout="constrained")
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
        axes.plot(ratios, place, ".", markersize=6)
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
    figure, axes = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
    axes.loglog(rpm, np.array(total) / 1e3, "o-", markersize=4, label="highest force of a ball")
    axes.loglog(rpm, np.array(still) / 1e3, "--", label="highest load on the bearing")
    axes.set_xlabel("speed of the crank [rpm]")
    axes.set_ylabel("force [kN]")
    axes.grid(which="both", alpha=0.25)
    axes.legend()
    return figure


def energy() -> Figure:
    """Relative change of the energy of an undamped ring over time."""
    model = rotor(NO_LOAD)
    figure, axes = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
    angles = TURN * np.arange(8) / 8
    stiffness, mass = 13.34e9, 0.5
    for words, clearance, method, rtol in (
        ("in contact, stepper-dop853, 1e-11", -120e-6, "stepper-dop853", 1e-11),
        ("losing contact, stepper-dop853, 1e-10", -10e-6, "stepper-dop853", 1e-10),
        ("losing contact, stepper-dp54, 1e-10", -10e-6, "stepper-dp54", 1e-10),
        ("losing contact, stepper-dp54, 1e-8", -10e-6, "stepper-dp54", 1e-8),
    ):
        numbers = {
            "shaft.speed": 0.0, "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": mass,
            "bearing.clearance": clearance,
        }  # fmt: skip
        start = np.array([20e-6, 6e-6, 0.0, 0.0])
        solution = model.simulate(
            duration=2.0,
            parameters=numbers,
            initial=start,
            rtol=rtol,
            method=method,
            samples_per_cycle=400,
            transient=0,
        )
        x = solution.x
        pressed = np.maximum(
            np.outer(x[:, 0], np.cos(angles)) + np.outer(x[:, 1], np.sin(angles)) - 0.5 * clearance, 0.0
        )
        total = 0.4 * stiffness * np.sum(pressed**2.5, axis=1) + 0.5 * mass * np.sum(x[:, 2:] ** 2, axis=1)
        axes.semilogy(solution.t[1:], np.maximum(np.abs(total[1:] / total[0] - 1.0), 1e-16), label=f"{words}")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("change of energy over energy [1]")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, title="balls, method, rtol", title_fontsize=8)
    return figure


def condition() -> Figure:
    """Scaled condition number of the reaction matrix over a turn, for cranks of several lengths."""
    model = press()
    kernel = model.kernel("reaction_system")
    figure, axes = plt.subplots(figsize=(7.5, 4.0), layout="constrained")
    degrees = np.unique(np.concatenate([np.linspace(0.0, 360.0, 721), 180.0 + np.linspace(-1.0, 1.0, 201)]))
    for ratio, words in ((0.06, "0.06 (shipped)"), (0.9, "0.9"), (0.9999, "0.9999"), (1.0 - 1e-9, "1 - 1e-9")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            numbers = model.numbers({"mechanism.bodies.crank.points.B": 0.1 * ratio})
        values = []
        for angle in degrees:
            t = math.radians(angle) / numbers.values[SPEED]
            u = clock.inputs_at(model.manifest.inputs, numbers.values, t)
            values.append(np.linalg.cond(equilibrate(kernel({"t": 0.0, "u": u, "p": numbers.p, "c": numbers.c}))))
        axes.semilogy(degrees, values, label=f"crank over rod {words}")
    axes.axhline(BOUND, color="black", linestyle="--", linewidth=1.0)
    axes.set_xlim(0.0, 360.0)
    axes.set_xticks(range(0, 361, 45))
    axes.set_xlabel("crank angle [deg]")
    axes.set_ylabel("scaled condition number [1]")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return figure
