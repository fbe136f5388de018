"""Make the numbers and the figures of docs/howto/sensitivity.md: `.venv/bin/python docs/make_sensitivity.py`."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ballpass.derive import generate
from ballpass.runtime import Model, load
from ballpass.runtime.certify.sensitivity_report import SensitivityReport
from ballpass.runtime.plot.style import FIRST, GREY, SECOND, caption, legend_above, new_figure, save, styled
from ballpass.runtime.plot.tornado import tornado

DOCS = Path(__file__).resolve().parent
SCENE = DOCS.parent / "scenes" / "punching_press.toml"

PEAK, RMS = "peak_ball_force", "rms:inner.y"
PARAMETERS = {
    "mechanism.bodies.crank.points.B": "crank length",
    "mechanism.bodies.slider.mass": "slider mass",
    "bearing.clearance": "clearance",
    "bearing.contact.inner_groove_radius": "inner groove radius",
    "mechanism.driver.speed": "speed",
    "mechanism.forces.punch.force.y": "punch force",
}

#: Relative changes that are tried, on both sides, and drawn.
CHANGES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1)
DRAWN = 0.05

#: A prediction holds while it errs by no more than this share of the change it predicts, or of the quantity.
SHARE, LEAST = 0.1, 1e-3


def sweep(model: Model, name: str, relative: np.ndarray) -> dict[str, np.ndarray]:
    """Both quantities over relative changes of a parameter, from an ensemble."""
    values = model.parameters[name] * (1.0 + relative)
    result = model.simulate_many({name: values}, [PEAK, RMS], rtol=1e-8)
    return {quantity: np.asarray(result[quantity]) for quantity in (PEAK, RMS)}


def reach(report: SensitivityReport, quantity: str, name: str, relative: np.ndarray, values: np.ndarray) -> float:
    """Largest of `CHANGES` up to which the linear prediction holds on both sides; 0 where none does."""
    pair = report[quantity, name]
    predicted = pair.dimensionless * relative
    error = np.abs(values / pair.value - 1.0 - predicted)
    fine = error <= np.maximum(SHARE * np.abs(predicted), LEAST)
    held = 0.0
    for change in CHANGES:
        if not np.all(fine[np.isclose(np.abs(relative), change)]):
            break
        held = change
    return held


@styled
def linear_figure(model: Model, report: SensitivityReport) -> Figure:
    """Change of both quantities against that of each parameter, and what the derivative predicts."""
    relative = np.linspace(-DRAWN, DRAWN, 81)
    figure = new_figure(5.6)
    axes = figure.subplots(2, 3, sharex=True)
    for axis, (name, words) in zip(axes.ravel(), PARAMETERS.items(), strict=True):
        found = sweep(model, name, relative)
        for quantity, style, label in ((PEAK, FIRST, "peak ball force"), (RMS, SECOND, "rms of the vibration")):
            pair = report[quantity, name]
            axis.plot(100 * relative, 100 * (found[quantity] / pair.value - 1.0), label=label, **style)
            axis.plot(100 * relative, 100 * pair.dimensionless * relative, color=GREY, linewidth=0.9, linestyle=":")
        axis.set_title(words)
    for axis in axes[-1]:
        axis.set_xlabel("change of the parameter [%]")
    for axis in axes[:, 0]:
        axis.set_ylabel("change of the quantity [%]")
    legend_above(figure, *axes[0, 0].get_legend_handles_labels())
    caption(
        figure,
        "How far a linear prediction holds",
        f"{report.scene}: each point is a simulation; dotted: the derivative at the scene's own parameters.",
    )
    return figure


def main() -> None:
    model = load(generate(SCENE))
    report = model.sensitivity([PEAK, RMS], list(PARAMETERS))
    relative = np.array([sign * change for change in CHANGES for sign in (-1.0, 1.0)])
    lines = [
        "| parameter | peak ball force, % per % | verdict | linear up to | "
        "rms vibration, % per % | verdict | linear up to |",
        "| --- | ---: | --- | ---: | ---: | --- | ---: |",
    ]
    ranked = sorted(PARAMETERS, key=lambda name: -abs(report[PEAK, name].dimensionless))
    for name in ranked:
        values = sweep(model, name, relative)
        cells = [f"{PARAMETERS[name]} (`{name}`)"]
        for quantity in (PEAK, RMS):
            pair = report[quantity, name]
            held = reach(report, quantity, name, relative, values[quantity])
            limit = f"{100 * held:g} %" if held > 0.0 else f"below {100 * CHANGES[0]:g} %"
            if math.isclose(held, CHANGES[-1]):
                limit = f"{100 * held:g} % and more"
            cells += [f"{pair.dimensionless:+.4f}", pair.check.verdict.value, limit]
        lines.append(f"| {' | '.join(cells)} |")
    peak, rms = report.quantities
    lines += [
        "",
        f"Peak ball force {peak.value:.1f} N (ball {peak.ball}, t = {peak.time:.5f} s); rms of the inner ring's y "
        f"{1e6 * rms.value:.3f} µm. Places where the motion grazes a kink: {len(report.grazing)}.",
    ]
    (DOCS / "howto" / "sensitivity_numbers.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    save(linear_figure(model, report), DOCS / "images" / "sensitivity_linear.png")
    save(tornado(report, PEAK), DOCS / "images" / "sensitivity_tornado.png")


if __name__ == "__main__":
    main()
