"""The kinds of quantities: how each is evaluated, value and derivative.

In: a `View` of the run and the `Quantity` asked for.  Out: an `Estimate`.  To add a kind, add an entry to `KINDS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.ask.life import PLACES, life
from ballpass.runtime.ask.quantity_location import frequency
from ballpass.runtime.ask.quantity_records import Array, Estimate, Quantity, View
from ballpass.runtime.ask.rivals import nearest_rival
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.readings import KINDS as LIFE
from ballpass.runtime.run import inputs as clock


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """How a kind of quantity is evaluated.

    Attributes
    ----------
    summary : one line for people
    evaluate : value and derivative
    extremes : extremes of the channel it needs
    place : what is expected behind ``@``, "" for nothing
    channel : output it always takes; "" when the name says it
    unit : of the value; "" for that of the channel
    over_time : whether the unit is that of the channel times a second
    static : whether it is one of the rings at rest, for which nothing is run (`ballpass.runtime.ask.study`)
    of_loads : whether it is of the loads of a bearing's balls, which its channel has to be
    beside : channels that it looks at as well, behind the bearing's prefix
    """

    summary: str
    evaluate: Callable[[View, Quantity], Estimate] | None
    extremes: tuple[str, ...] = ()
    place: str = ""
    channel: str = ""
    unit: str = ""
    static: bool = False
    over_time: bool = False
    of_loads: bool = False
    beside: tuple[str, ...] = ()


def _mean(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.mean(*view.channel(quantity))
    return Estimate(value=value, slope=slope)


def _integral(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.integral(*view.channel(quantity))
    return Estimate(value=value, slope=slope)


def _rms(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    square, moved = view.mean(value**2, 2.0 * value[:, None] * slope)
    root = math.sqrt(square)
    if root == 0.0:
        return _zero(view, "zero throughout", slope)
    return Estimate(value=root, slope=moved / (2.0 * root))


def _zero(view: View, note: str, moved: Array) -> Estimate:
    """A size that is zero; `moved` are derivatives of what it is the size of."""
    kink = "it is zero and has a corner there; the derivative given is zero" if np.any(moved) else ""
    return Estimate(value=0.0, slope=np.zeros(view.directions), notes=(note,), kink=kink)


def _extreme(view: View, quantity: Quantity, kind: str) -> Estimate:
    mark = view.marks[quantity.name, kind]
    signal = view.signals[quantity.channel]
    value, slope = signal.value[mark.node, mark.ball], signal.slope[mark.node, mark.ball]
    notes = []
    if mark.other is not None and mark.rate != mark.other_rate:
        # two balls change rank: the moment moves so that both stay equal
        apart = slope - signal.slope[mark.node, mark.other]
        slope = slope - mark.rate * apart / (mark.rate - mark.other_rate)
        notes.append(f"balls {mark.ball + 1} and {mark.other + 1} change rank there")
    if mark.at_edge:
        notes.append("at an edge: the moment moves with it")
    ball = mark.ball + 1 if signal.value.shape[1] > 1 else None
    # the least of the most loaded ball is no extreme of any one
    ranked = kind == "min" and ball is not None and quantity.ball is None
    kink = "" if ranked else nearest_rival(view, quantity, mark)
    return Estimate(value=float(value), slope=slope, time=mark.time, ball=ball, notes=tuple(notes), kink=kink)


def _range(view: View, quantity: Quantity) -> Estimate:
    top, bottom = _extreme(view, quantity, "max"), _extreme(view, quantity, "min")
    parts = (("largest", top.kink), ("smallest", bottom.kink))
    return Estimate(
        value=top.value - bottom.value,
        slope=top.slope - bottom.slope,
        notes=top.notes + bottom.notes,
        kink="; ".join(f"of its {word} value, {kink}" for word, kink in parts if kink),
    )


def _at_place(view: View, quantity: Quantity) -> Estimate:
    mark = view.marks[quantity.name, "place"]
    value, slope = view.channel(quantity)
    return Estimate(value=float(value[mark.node]), slope=slope[mark.node], time=mark.time)


def _amplitude(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    line_frequency, faster = frequency(view, quantity)
    length, longer = view.length
    mean, mean_slope = view.mean(value, slope)
    turning = np.exp(-2j * np.pi * line_frequency * view.nodes.t)
    angle_slope = 2.0 * np.pi * (faster * view.nodes.t[:, None] + line_frequency * view.nodes.slope)
    swing = (value - mean) * turning
    swing_slope = (slope - mean_slope) * turning[:, None] - 1j * swing[:, None] * angle_slope
    sum_, sum_slope = view.nodes.weight @ swing, view.nodes.weight @ swing_slope + swing @ view.nodes.weight_slope
    line, line_slope = 2.0 * sum_ / length, 2.0 * (sum_slope - sum_ * longer / length) / length
    size = abs(line)
    if size == 0.0:
        return _zero(view, "zero", line_slope)
    return Estimate(value=size, slope=np.real(np.conj(line) * line_slope) / size)


def _drive_work(view: View, quantity: Quantity) -> Estimate:
    mechanism = view.manifest.mechanism
    assert mechanism is not None  # it has a drive torque
    if mechanism.angle:
        raise RequestError(
            f"{quantity.name}: the driver's speed changes in this scene, and its turns are not alike. Ask for "
            "mean:drive_power, times the length of the run."
        )
    value, slope = view.mean(*view.channel(quantity))
    # mean torque times the angle of a turn, which no parameter changes
    angle = math.copysign(clock.TURN, view.numbers.values[mechanism.speed])
    return Estimate(value=angle * value, slope=angle * slope)


def _of_life(name: str) -> Kind:
    readings = LIFE[name]
    which = f"reading {readings[0]}" if len(readings) == 1 else "by the reading that gives the shortest"
    return Kind(
        summary=f"rating life of the bearing in turns, ISO 16281, {which}",
        evaluate=lambda view, quantity: life(view, quantity, readings),
        unit="turns",
        of_loads=True,
        beside=PLACES if "sectors" in readings else (),
    )


#: What is expected behind ``@`` of quantities at rest.
_FIRST_TURN = "a crank angle of the first turn (240deg, 4.19rad) or a time (0.41s)"

#: Every kind of quantity by name.
KINDS: Mapping[str, Kind] = {
    "max": Kind(summary="largest value", evaluate=lambda v, q: _extreme(v, q, "max"), extremes=("max",)),
    "min": Kind(summary="smallest value", evaluate=lambda v, q: _extreme(v, q, "min"), extremes=("min",)),
    "range": Kind(summary="largest less smallest value", evaluate=_range, extremes=("max", "min")),
    "mean": Kind(summary="mean over time", evaluate=_mean),
    "integral": Kind(summary="integral over time; of a power the work", evaluate=_integral, over_time=True),
    "rms": Kind(summary="root mean square over time, with the mean in it", evaluate=_rms),
    "value": Kind(
        summary="value at a crank angle of the last turn, or at a time",
        evaluate=_at_place,
        place="a crank angle (240deg, 4.19rad) or a time (0.41s)",
    ),
    "end": Kind(summary="value at the end of the run", evaluate=_at_place),
    "amplitude": Kind(
        summary="amplitude of the oscillation about the mean at one frequency",
        evaluate=_amplitude,
        place="a frequency (250Hz), an order of the shaft (2x), or shaft, cage, bpfo, bpfi or bsf",
    ),
    "drive_work": Kind(summary="work of the drive in a turn", evaluate=_drive_work, channel="drive_torque", unit="J"),
    "static_deflection": Kind(
        summary="distance of the inner ring's centre from its unloaded place, at rest under the load of one instant",
        evaluate=None,
        place=_FIRST_TURN,
        unit="m",
        static=True,
    ),
    "static_peak_ball_force": Kind(
        summary="largest elastic force of any ball, at rest under the load of one instant",
        evaluate=None,
        place=_FIRST_TURN,
        unit="N",
        static=True,
    ),
    **{name: _of_life(name) for name in LIFE},
}
