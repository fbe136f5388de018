"""The mechanism and the loaded bearing at the moment of the highest ball force."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.ask.peaks import refine_peak
from ballpass.runtime.plot import PAPER
from ballpass.runtime.plot.bearing import draw_bearing
from ballpass.runtime.plot.mechanism import draw_mechanism
from ballpass.runtime.plot.record import Record
from ballpass.runtime.plot.style import frame, new_figure, styled


@styled
def peak_moment(record: Record) -> Figure:
    """Mechanism, bearing, or both side by side.

    The moment is that of the highest sample of the ball force; without a bearing, of the greatest drive torque.
    """
    with_mechanism = record.manifest.mechanism is not None
    with_bearing = record.can_draw_bearing
    sample, reason = _moment(record)
    both, on_paper = with_mechanism and with_bearing, PAPER.get()[0] is not None
    figure = new_figure(10.0 if both and on_paper else 5.6, layout=None)
    figure.set_layout_engine("none")  # axes of equal scales would become small
    text = f"{record.when(sample)}. "
    if both:
        # in a column of a paper one above the other
        left, right = figure.subplots(2, 1) if on_paper else figure.subplots(1, 2, width_ratios=(0.8, 1.0))
        draw_mechanism(left, record, sample)
        factor = draw_bearing(right, record, sample)
    elif with_bearing:
        factor = draw_bearing(figure.add_subplot(), record, sample)
    else:
        draw_mechanism(figure.add_subplot(), record, sample)
    if with_mechanism:
        words = "force on the frame" if with_bearing else "forces on the frame"
        sprung = any(record.spring_tension(label) is not None for label, *_ in record.mechanism.springs)
        if sprung or record.applied_forces(float(record.t[sample])):
            words += ", applied force (brown)"
        if record.has("drive_torque"):
            words += ", torque of the drive (arc)"
        words += ", dashed paths of joints and points. "
        text += f"{'Above' if on_paper else 'Left'}: {words}" if with_bearing else words.capitalize()
    if with_bearing:
        words, _ = record.ball_force()
        text += f"Bearing: {record.noun}s coloured by {words}; clearance and displacement between the rings ×{factor:g}"
        if record.bearing is not None and record.bearing.outer_ring and record.has("outer.x", "outer.y"):
            moved = 1e6 * np.hypot(*record.centres("outer")[sample])
            text += f", the outer ring itself has moved by {moved:.3g} µm"
        text += ". "
    subject = "Mechanism and bearing" if with_mechanism and with_bearing else "Bearing" if with_bearing else "Mechanism"
    title = record.title(f"{subject} at the {reason}") + (_between_samples(record) if with_bearing else "")
    frame(figure, title, f"{text}{record.settings()}.", left=0.2, right=0.8 if on_paper else 0.3, below=0.1)
    return figure


def _between_samples(record: Record) -> str:
    """For the title: the peak between the samples, as in the summary, where the samples miss part of it."""
    if len(record.solution) < 3:
        return ""
    name = "ball.force" if record.has("ball.force") else "ball.elastic_force"
    numbers = record.model.numbers(record.solution.parameters)
    peak = refine_peak(record.model, numbers, record.solution, record.output(name))
    shown, true = (f"{value:.4g}" if value < 9999.5 else f"{value:.0f}" for value in (peak.sampled, peak.value))
    return "" if shown == true else f"\n{shown} N; between the samples it reaches {true} N"


def _moment(record: Record) -> tuple[int, str]:
    """Sample to draw, and why."""
    if record.can_draw_bearing:
        return int(np.argmax(record.highest_ball_force())), f"highest sample of the {record.noun} force"
    if record.has("drive_torque"):
        return int(np.argmax(np.abs(record.values("drive_torque")))), "highest sample of the drive torque"
    return 0, "start of the steady part"
