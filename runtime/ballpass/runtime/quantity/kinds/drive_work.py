"""Work of the drive in a turn: mean of the last whole turns after which all loads repeat."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.quantity.location import moved_numbers
from ballpass.runtime.quantity.records import Array, Estimate, Kind, Quantity, View
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.span import NEAR
from ballpass.runtime.time.timeline import along, driver_info, is_free
from ballpass.runtime.time.turning import STEP, TURN, Turning

#: Part of a turn, and of a work, by which a run that is a little shorter shows whether its work is another one.
_LESS = 1e-6


def _drive_work(view: View, quantity: Quantity) -> Estimate:
    mechanism = view.manifest.mechanism
    assert mechanism is not None  # it has a drive torque
    span, cycle = view.run.span, Repetition.of(view.manifest, view.numbers.values).turns
    window = span.whole_cycles(cycle)
    if window is None:
        raise RequestError(
            f"{quantity.name}: the time that counts holds no whole turn of the driver, or fewer than all loads repeat "
            "after. It begins with a whole turn, and where the speed changes it ends with one. Ask for whole turns "
            "(cycles, transient), or of a driver that makes none for mean:drive_torque."
        )
    if not span.turning.is_even:
        return _of_changing_speed(view, quantity)
    (value, slope), kink = _mean_within(view, quantity, window), ""
    if span.asked is None and span.end - window[1] < NEAR * span.turning.turn:
        # the turns end elsewhere at another speed, though the run does not
        turning = -window[1] / view.numbers.values[mechanism.speed] * view.slopes(mechanism.speed)
        last = view.channel(quantity)[0][np.argmax(view.nodes.t)]
        slope = slope + (last - value) / (window[1] - window[0]) * turning
        fewer = replace(span, end=span.end - _LESS * span.turning.turn).whole_cycles(cycle)
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
    nodes, near = view.nodes, NEAR * view.run.span.turning.turn
    within = (window[0] - near < nodes.t) & (nodes.t < window[1] + near)
    whole = replace(
        nodes,
        weight=np.where(within, nodes.weight, 0.0),
        weight_slope=np.where(within[:, None], nodes.weight_slope, 0.0),
    )
    return replace(view, nodes=whole).mean(*view.channel(quantity))


def _of_changing_speed(view: View, quantity: Quantity) -> Estimate:
    """Work over all that counts, in a turn of it."""
    span, nodes, values = view.run.span, view.nodes, view.numbers.values
    if view.directions and span.asked is None:
        raise RequestError(
            f"{quantity.name}: by a parameter that moves its turns the run would hold no whole ones. Ask for turns "
            "(cycles), not for a time."
        )
    torque, slope = view.channel(quantity)
    _, rate, growth = span.turning.held(nodes.t, nodes.t)
    info = driver_info(view.manifest)
    assert info is not None  # its speed changes
    faster = growth[:, None] * nodes.slope
    for column, moved in enumerate(moved_numbers(info, view.slopes)):
        faster[:, column] += np.imag(Turning.of(info, along(values, moved)).at(nodes.t)[1]) / STEP
    work, slopes = view.integral(torque * rate, slope * rate[:, None] + torque[:, None] * faster)
    return Estimate(value=work / span.counted, slope=slopes / span.counted)


def _check(manifest: Manifest, _values: Mapping[str, float], quantity: Quantity) -> None:
    if manifest.mechanism is not None and manifest.mechanism.swing:
        raise RequestError(
            f"{quantity.name}: the driver swings and makes no turn. Ask for mean:drive_power, times the period of the "
            "swing."
        )
    if is_free(manifest):
        raise RequestError(
            f"{quantity.name}: a torque drives this scene, and its turns are not alike. Ask for mean:drive_power, "
            "times the length of the run."
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
