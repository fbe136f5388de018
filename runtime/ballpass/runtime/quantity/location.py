"""The part after ``@`` in the name of a quantity: an angle, a time or a frequency, and its derivative by parameters.

In: a `Quantity` and the numbers of a run.  Out: a time [s] or a frequency [Hz], each with its derivative.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import CAGE_EXCESS_SLIP, CAGE_LAG_RATE, BearingInfo, Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.units import FAR_ANGLE, MOST_ANGLE
from ballpass.runtime.point.equilibrium import LARGEST_ANGLE
from ballpass.runtime.quantity.characteristic import PASS_SPEEDS, frequencies_of
from ballpass.runtime.quantity.records import Array, Place, Quantity, View
from ballpass.runtime.ratings.of_bearing import TURNS, bearing_words, contact_cosine
from ballpass.runtime.run import driver_angle

_PLACE = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>deg|rad|s|Hz|x)")

#: Names of kinematic frequencies in quantities, and in `KinematicFrequencies`.
_FREQUENCIES = {
    "shaft": "shaft",
    "cage": "cage",
    "ftf": "cage",
    "bpfo": "ball_pass_outer",
    "bpfi": "ball_pass_inner",
    "bsf": "ball_spin",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """Of what kind a moment is: "angle" [rad], "time" [s] or "end"."""

    kind: str
    number: float


def named_place(quantity: Quantity) -> Moment:
    """The place written after ``@``: an angle or a time."""
    form = _PLACE.fullmatch(quantity.place)
    assert form is not None  # checked when read
    if form["unit"] == "s":
        return Moment(kind="time", number=float(form["number"]))
    return Moment(kind="angle", number=_radians(form))


def _radians(form: re.Match[str]) -> float:
    number = float(form["number"])
    angle = math.radians(number) if form["unit"] == "deg" else number
    if abs(angle) >= MOST_ANGLE:
        raise RequestError(f"@{form[0]}: {FAR_ANGLE}. Give the angle without its whole turns.")
    return angle


def place_of(manifest: Manifest, numbers: Numbers, end: float, quantity: Quantity) -> tuple[float, Moment]:
    """Time at which a quantity with a place is taken, in the last turn before the end [s], and the moment.

    Where tables over the driver's angle repeat after several turns the last so many count: 40 deg of a four-stroke
    engine are not 400 deg.

    Raises
    ------
    RequestError
        The run does not reach it, or nothing turns.
    """
    if quantity.kind == "end":
        return end, Moment(kind="end", number=0.0)
    asked = named_place(quantity)
    if asked.kind == "time":
        number = asked.number
        if not 0.0 <= number <= end:
            raise RequestError(f"{quantity.name}: the run ends at {end:g} s. Run longer, or ask earlier.")
        return number, asked
    angle = asked.number
    check_instant(manifest, numbers.values, quantity)
    speed = driver_angle.shaft_speed(manifest, numbers.values)
    if speed == 0.0:
        raise RequestError(f"{quantity.name}: nothing turns (its speed is zero). Name a time instead, as in @0.41s.")
    start = numbers.values[manifest.mechanism.start_angle] if manifest.mechanism is not None else 0.0
    cycle = driver_angle.TURN * driver_angle.cycle_turns(numbers.values)
    cycles = (start + speed * end - angle) / cycle
    # the last one before the end, an angle at the very end included; 1e-9 of it is rounding
    whole = math.floor(cycles + 1e-9) if speed > 0.0 else math.ceil(cycles - 1e-9)
    time = (angle + cycle * whole - start) / speed
    if time < 0.0:
        raise RequestError(f"{quantity.name}: the run is over before that angle is passed. Run longer.")
    return min(time, end), asked


def check_instant(manifest: Manifest, _values: Mapping[str, float], quantity: Quantity) -> None:
    """Raise `RequestError` for an angle where the driver's speed changes."""
    if quantity.place and named_place(quantity).kind == "angle":
        _refuse_driven(manifest, quantity, "passes an angle when its motion does. Name a time instead, as in @0.41s")


def check_frequency(manifest: Manifest, values: Mapping[str, float], quantity: Quantity) -> None:
    """Raise `RequestError` for a frequency of a speed that changes, or of a bearing whose rings only swing."""
    if not quantity.place.endswith("Hz"):
        _refuse_driven(manifest, quantity, "has no one speed. Name a frequency instead, as in @250Hz")
    if quantity.place in _FREQUENCIES and quantity.place != "shaft":
        bearing = _bearing_of(manifest, quantity)
        if abs(values[bearing.ring_speed]) <= TURNS * abs(driver_angle.shaft_speed(manifest, values)):
            words = bearing_words("no ball passes", [bearing])
            raise RequestError(
                f"{quantity.name}: the rings of {bearing.path} do not turn against each other, so that {words} "
                "at a frequency of its own. Allowed: @shaft, an order as in @2x, a frequency as in @250Hz."
            )


def _bearing_of(manifest: Manifest, quantity: Quantity) -> BearingInfo:
    """The bearing of the channel, else the first."""
    ours = (one for one in manifest.bearings if one.prefix and quantity.channel.startswith(one.prefix))
    return next(ours, manifest.bearings[0])


def _refuse_driven(manifest: Manifest, quantity: Quantity, words: str) -> None:
    """Refuse a place that needs a constant speed where the driver's changes."""
    if manifest.mechanism is not None and manifest.mechanism.angle:
        raise RequestError(f"{quantity.name}: the driver's speed changes in this scene: the driver {words}.")


def place_slope(
    manifest: Manifest, numbers: Numbers, place: Moment, time: float, end: Array, slopes: Callable[[str], Array]
) -> Array:
    """Derivative of the time of a place along the directions, shape (directions,) [s/unit].

    Parameters
    ----------
    time : of the place [s]
    end : derivative of the time at which the run ends, shape (directions,) [s/unit]
    slopes : that of a parameter or constant by its name, shape (directions,)
    """
    if place.kind == "end":
        return end
    if place.kind == "time":
        return np.zeros_like(end)
    speed = driver_angle.shaft_speed(manifest, numbers.values)
    name = driver_angle.speed_name(manifest)
    assert name is not None  # something turns
    moved = time * slopes(name)
    if manifest.mechanism is not None:
        moved = slopes(manifest.mechanism.start_angle) + moved
    return -moved / speed


def frequency(view: View, quantity: Quantity) -> tuple[float, Array]:
    """The frequency written after ``@`` [Hz], and its derivative along the directions, shape (directions,)."""
    manifest, values = view.manifest, view.numbers.values
    place = quantity.place
    form = _PLACE.fullmatch(place)
    if form is not None and form["unit"] == "Hz":
        return float(form["number"]), np.zeros(view.directions)
    check_frequency(manifest, values, quantity)
    speed = driver_angle.shaft_speed(manifest, values)
    name = driver_angle.speed_name(manifest)
    assert name is not None  # something turns
    faster = view.slopes(name)
    if form is not None or place == "shaft":
        order = 1.0 if form is None else float(form["number"])
        return order * abs(speed) / driver_angle.TURN, order * math.copysign(1.0, speed) * faster / driver_angle.TURN
    bearing = _bearing_of(manifest, quantity)
    at, what = bearing.path, _FREQUENCIES[place]
    lag_rate, lag_slope = _mean_lag_rate(view, bearing)
    turning = (f"{at}.{speed}" for speed in ("cage_speed", *PASS_SPEEDS))
    values = {**values, **{name: values[name] - lag_rate for name in turning if name in values}}
    frequency = float(getattr(frequencies_of(bearing, values), what))
    if what == "ball_pass_inner":
        of = f"{at}.inner_pass_speed"
    elif what != "cage" and f"{at}.outer_pass_speed" in values:  # of an outer ring that turns
        of = f"{at}.outer_pass_speed"
    else:
        of = f"{at}.cage_speed"
    moving = view.slopes(of) - lag_slope
    slope = frequency / values[of] * moving if values[of] else 0.0 * moving
    if what == "ball_spin":  # in proportion to cos(contact angle) + pitch/ball
        ball, pitch = f"{at}.ball_diameter", f"{at}.pitch_diameter"
        ratio = values[pitch] / values[ball]
        moved = (view.slopes(pitch) - ratio * view.slopes(ball)) / values[ball]
        angled = f"{at}.cos_contact_angle"
        if angled in values:
            moved = moved + view.slopes(angled)
        slope = slope + frequency / (contact_cosine(bearing, values) + ratio) * moved
    return frequency, slope


def _mean_lag_rate(view: View, bearing: BearingInfo) -> tuple[float, Array]:
    """Mean rate at which a cage lags its speed in the end [rad/s], and its derivative; 0 where slip is constant.

    Of rings that turn evenly with the driver: no body swings.
    """
    values, times = view.numbers.values, view.nodes.t
    for item in view.manifest.inputs:
        if item.name in (bearing.prefix + CAGE_LAG_RATE, bearing.prefix + CAGE_EXCESS_SLIP):
            rows = np.searchsorted([values[name] for name in item.times], times, side="right")
            slopes = np.zeros((len(times), view.directions))
            for row in np.unique(rows).tolist():
                here = rows == row
                for _, name, amount in driver_angle.input_derivatives([item], values, float(times[here][0])):
                    slopes[here] += amount * view.slopes(name)
            mean, slope = view.mean(driver_angle.inputs_over([item], values, times, times)[:, 0], slopes)
            if item.name.endswith(CAGE_LAG_RATE):
                return mean, slope
            turns, turning = f"{bearing.path}.rolling_turns", driver_angle.speed_name(view.manifest)
            assert turning is not None  # of a linkage
            faster = values[turns] * view.slopes(turning) + values[turning] * view.slopes(turns)
            return mean * values[turns] * values[turning], slope * values[turns] * values[turning] + mean * faster
    return 0.0, np.zeros(view.directions)


def is_frequency(manifest: Manifest | None, place: str) -> bool:
    """Whether the part after ``@`` is a frequency of this model; without one, of any."""
    form = _PLACE.fullmatch(place)
    if form is not None:
        return form["unit"] in ("Hz", "x")
    return place in _FREQUENCIES and (manifest is None or any(bearing.balls >= 1 for bearing in manifest.bearings))


def is_instant(manifest: Manifest | None, place: str) -> bool:
    """Whether the part after ``@`` is a time, or an angle where something turns, as it does without a manifest."""
    form = _PLACE.fullmatch(place)
    if form is None or form["unit"] not in ("deg", "rad"):
        return form is not None and form["unit"] == "s"
    return math.isfinite(_radians(form)) and (
        manifest is None or manifest.mechanism is not None or bool(manifest.bearings)
    )


def check_first_turns(manifest: Manifest, _values: Mapping[str, float], quantity: Quantity) -> None:
    """Raise `RequestError` for an angle of a quantity at rest where the driver's speed changes, or beyond two turns."""
    if not quantity.place or named_place(quantity).kind != "angle":
        return
    start = "Give the angle as mechanism.driver.start_angle, or name a time instead, as in @0.41s"
    _refuse_driven(manifest, quantity, f"passes an angle when its motion does. {start}")
    if abs(named_place(quantity).number) > LARGEST_ANGLE:
        allowed = "-720deg to 720deg" if quantity.place.endswith("deg") else "-4 pi to 4 pi rad"
        raise RequestError(
            f"{quantity.name}: {quantity.place} is more than two turns, while the angle is one of the first turn. "
            f"Allowed: {allowed}. Or name a time instead, as in @0.41s."
        )


#: Places that kinds expect after ``@``.
INSTANT = Place(
    words="a crank angle (240deg, 4.19rad) or a time (0.41s)", example="value:inner.y@240deg", is_valid=is_instant
)
FIRST_TURN = Place(
    words="a crank angle of the first turn (240deg, 4.19rad) or a time (0.41s)",
    example="static_deflection@240deg",
    is_valid=is_instant,
)
FREQUENCY = Place(
    words="a frequency (250Hz), an order of the shaft (2x), or shaft, cage, bpfo, bpfi or bsf",
    example="amplitude:inner.y@2x",
    is_valid=is_frequency,
)
