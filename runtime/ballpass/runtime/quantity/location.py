"""The part after ``@`` in the name of a quantity: an angle, a time or a frequency, and its derivative by parameters.

In: a `Quantity` and the numbers of a run.  Out: a time [s] or a frequency [Hz], each with its derivative.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest, TurningInfo
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.units import FAR_ANGLE, MOST_ANGLE
from ballpass.runtime.point.equilibrium import LARGEST_ANGLE
from ballpass.runtime.quantity.characteristic import PASS_SPEEDS, frequencies_of
from ballpass.runtime.quantity.records import Array, Place, Quantity, View
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.turning import STEP, TURN, Turning

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


#: Numbers of a bearing that these follow from.
_NUMBERS = ("cage_speed", *PASS_SPEEDS, "ball_diameter", "pitch_diameter", "cos_contact_angle")


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
    repetition = Repetition.of(manifest, numbers.values)
    if repetition.driver.fastest == 0.0:
        raise RequestError(f"{quantity.name}: nothing turns (its speed is zero). Name a time instead, as in @0.41s.")
    time = repetition.driver.last_pass(angle, end, repetition.turns)
    if time is None:
        raise RequestError(f"{quantity.name}: the run is over before that angle is passed. Run longer.")
    return time, asked


def check_instant(manifest: Manifest, _values: Mapping[str, float], quantity: Quantity) -> None:
    """Raise `RequestError` for an angle where a torque drives."""
    if quantity.place and named_place(quantity).kind == "angle":
        _refuse_driven(manifest, quantity, "passes an angle when its motion does. Name a time instead, as in @0.41s")


def check_frequency(manifest: Manifest, values: Mapping[str, float], quantity: Quantity) -> None:
    """Raise `RequestError` for a frequency where a torque drives, or of a bearing whose rings only swing."""
    if not quantity.place.endswith("Hz"):
        _refuse_driven(manifest, quantity, "has no one speed. Name a frequency instead, as in @250Hz")
    if quantity.place in _FREQUENCIES and quantity.place != "shaft":
        bearing = quantity.bearing(manifest)
        moving = {**values, **timeline.highest_rates(manifest, values)}
        if not timeline.turns_steadily(bearing, moving, timeline.shaft_speed(manifest, moving)):
            words = bearing_words("no ball passes", [bearing])
            raise RequestError(
                f"{quantity.name}: the rings of {bearing.path} do not turn against each other, so that {words} "
                "at a frequency of its own. Allowed: @shaft, an order as in @2x, a frequency as in @250Hz."
            )


def _refuse_driven(manifest: Manifest, quantity: Quantity, words: str) -> None:
    """Refuse a place that needs a speed known before the run."""
    if timeline.is_free(manifest):
        raise RequestError(f"{quantity.name}: a torque drives this scene: the driver {words}.")


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
    info = timeline.driver_info(manifest)
    assert info is not None  # something turns
    rate = Turning.of(info, numbers.values).at(time)[1]
    return np.array(
        [-timeline.angle_slope(info, numbers.values, moved, time) / rate for moved in moved_numbers(info, slopes)]
    )


def moved_numbers(info: TurningInfo, slopes: Callable[[str], Array]) -> Iterator[dict[str, float]]:
    """Directions of the numbers that a turning depends on."""
    columns = {name: slopes(name) for name in timeline.names_of(info)}
    for k in range(len(next(iter(columns.values())))):
        yield {name: float(column[k]) for name, column in columns.items()}


def frequency(view: View, quantity: Quantity) -> tuple[float, Array]:
    """The frequency written after ``@`` [Hz], and its derivative along the directions, shape (directions,)."""
    manifest, values = view.manifest, view.numbers.values
    place = quantity.place
    form = _PLACE.fullmatch(place)
    if form is not None and form["unit"] == "Hz":
        return float(form["number"]), np.zeros(view.directions)
    check_frequency(manifest, values, quantity)
    values = {
        **values,
        **timeline.mean_rates(manifest, values, float(np.min(view.nodes.t)), float(np.max(view.nodes.t))),
    }
    speed = timeline.shaft_speed(manifest, values)
    name = timeline.speed_name(manifest)
    assert name is not None  # something turns
    faster = _rate_slopes(view, name)
    if form is not None or place == "shaft":
        order = 1.0 if form is None else float(form["number"])
        return order * abs(speed) / TURN, order * math.copysign(1.0, speed) * faster / TURN
    bearing = quantity.bearing(manifest)
    names = (f"{bearing.path}.{name}" for name in _NUMBERS)
    slopes = {name: _rate_slopes(view, name) for name in names if name in values}

    def read(numbers: Mapping[str, Any]) -> Any:
        return getattr(frequencies_of(bearing, numbers), _FREQUENCIES[place])

    moved = ({name: slope[k] for name, slope in slopes.items()} for k in range(view.directions))
    return read(values), np.array([np.imag(read(timeline.along(values, one))) / STEP for one in moved])


def _rate_slopes(view: View, rate: str) -> Array:
    """Derivative of a mean speed over the time that counts along the directions, by the name of the first speed."""
    uneven = (info for info in view.manifest.turnings if info.rate == rate and (info.times or info.turns))
    info = next(uneven, None)
    if info is None:
        return view.slopes(rate)
    values, nodes = view.numbers.values, view.nodes
    turning, ends = Turning.of(info, values), [int(np.argmin(nodes.t)), int(np.argmax(nodes.t))]
    length = float(nodes.t[ends[1]] - nodes.t[ends[0]])
    before, after = (
        np.array(
            [timeline.angle_slope(info, values, moved, float(nodes.t[k])) for moved in moved_numbers(info, view.slopes)]
        )
        + float(turning.at(nodes.t[k])[1]) * nodes.slope[k]
        for k in ends
    )
    longer = nodes.slope[ends[1]] - nodes.slope[ends[0]]
    mean = turning.mean_rate(float(nodes.t[ends[0]]), float(nodes.t[ends[1]]))
    return np.asarray((after - before - mean * longer) / length)


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
