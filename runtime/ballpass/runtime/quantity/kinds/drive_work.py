"""Work of the drive in a turn: mean of the last whole turns after which all loads repeat."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.quantity.records import Array, Estimate, Kind, Quantity, View
from ballpass.runtime.run.resolve import Run
from ballpass.runtime.time.timeline import cycle_turns, is_even
from ballpass.runtime.time.turning import TURN

#: Part of a turn by which times miss it by rounding.
_NEAR = 1e-9

#: Part of a turn, and of a work, by which a run that is a little shorter shows whether its work is another one.
_LESS = 1e-6


def whole_cycles(run: Run) -> tuple[float, float] | None:
    """Begin and end of the last whole turns that count [s]: as many as loads repeat after, or several times that.

    They begin and end where the driver has made whole turns since t = 0, as segments of a run do, or with what counts.
    None where it holds none.
    """
    cycle = cycle_turns(run.model.manifest)
    first, last = run.start / run.turn, run.end / run.turn
    for end in (last, math.floor(last + _NEAR)):
        count = cycle * math.floor((end - first) / cycle + _NEAR)
        begin = end - count
        if count > 0 and min(abs(begin - first), abs(begin - round(begin))) < _NEAR * max(last, 1.0):
            return begin * run.turn, end * run.turn
    return None


def _drive_work(view: View, quantity: Quantity) -> Estimate:
    mechanism = view.manifest.mechanism
    assert mechanism is not None  # it has a drive torque
    run, window = view.run, whole_cycles(view.run)
    if window is None:
        raise RequestError(
            f"{quantity.name}: the time that counts holds no whole turn of the driver, or as many as all loads repeat "
            "after, from a whole turn on. Run longer."
        )
    (value, slope), kink = _mean_within(view, quantity, window), ""
    if run.turns is None and run.end - window[1] < _NEAR * run.turn:
        # the turns end elsewhere at another speed, though the run does not
        turning = -window[1] / view.numbers.values[mechanism.speed] * view.slopes(mechanism.speed)
        last = view.channel(quantity)[0][np.argmax(view.nodes.t)]
        slope = slope + (last - value) / (window[1] - window[0]) * turning
        fewer = whole_cycles(replace(run, end=run.end - _LESS * run.turn))
        other = None if fewer is None else _mean_within(view, quantity, fewer)[0]
        if other is None or abs(other - value) > _LESS * abs(value):
            kink = (
                "the run ends with a whole turn, and at a lower speed it holds one less, whose work differs; the value "
                "jumps there, and differences are not of it; the derivative given is that towards higher speeds. Ask "
                "for turns (cycles), not for a time"
            )
    # mean torque times the angle of a turn, which does not depend on parameters
    angle = math.copysign(TURN, view.numbers.values[mechanism.speed])
    return Estimate(value=angle * value, slope=angle * slope, kink=kink)


def _mean_within(view: View, quantity: Quantity, window: tuple[float, float]) -> tuple[float, Array]:
    """Mean of the channel over a window from edge to edge, and its derivative."""
    nodes, near = view.nodes, _NEAR * view.run.turn
    within = (window[0] - near < nodes.t) & (nodes.t < window[1] + near)
    whole = replace(
        nodes,
        weight=np.where(within, nodes.weight, 0.0),
        weight_slope=np.where(within[:, None], nodes.weight_slope, 0.0),
    )
    return replace(view, nodes=whole).mean(*view.channel(quantity))


def _check(manifest: Manifest, values: Mapping[str, float], quantity: Quantity) -> None:
    if not is_even(manifest, values):
        raise RequestError(
            f"{quantity.name}: the driver's speed changes in this scene, and its turns are not alike. Ask for "
            "mean:drive_power, times the length of the run."
        )


KINDS = (
    Kind(
        name="drive_work",
        summary="work of the drive in a turn",
        takes="nothing",
        channel="drive_torque",
        unit="J",
        check=_check,
        evaluate=_drive_work,
    ),
)
