"""Quantities of interest: numbers that a run is asked for, each with its derivative.

In: a name, `parse_quantity`.  Out: a `Quantity`, which `raceway.runtime.quantities.study` evaluates along a run.

A name is ``kind:output``, with ``[ball]`` for one ball and ``@place`` where a kind wants one::

    max:ball.force          rms:inner.y        value:inner.y@240deg      amplitude:inner.y@bpfo
    max:ball.force[3]       range:inner.x      value:inner.y@0.41s       amplitude:inner.y@2x

Without ``[ball]`` an output of the balls is that of the most loaded ball at each moment.  The names of observables of
ensembles (`integrate/reductions.py`) mean the same numbers here, ``peak_ball_force`` and ``rms_inner_y`` included.
To add a quantity, add an entry to `KINDS`: a function that takes a `View` of the run and gives value and derivative.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from raceway.runtime.errors import RequestError
from raceway.runtime.integrate import clock
from raceway.runtime.manifest import Manifest
from raceway.runtime.parameters import Numbers, unknown_name
from raceway.runtime.quantities.nodes import Nodes, Window
from raceway.runtime.quantities.observables import KinematicFrequencies, kinematic_frequencies

if TYPE_CHECKING:
    from raceway.runtime.quantities.track import Signal

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity of interest as asked for.

    Attributes
    ----------
    name : as written
    kind : entry of `KINDS`
    channel : state or output, "" for a quantity that names none
    ball : which ball, counted from 1; None for the most loaded one, and for outputs without balls
    place : what stands behind ``@``
    unit : of the value
    """

    name: str
    kind: str
    channel: str
    ball: int | None
    place: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mark:
    """A moment of a run at which a quantity is taken: an extreme, or a place.

    Attributes
    ----------
    node : its node
    time : [s]
    ball : column of the channel
    other : column that the channel's most loaded ball changes to or from at this very moment; None elsewhere
    rate, other_rate : time derivatives of both columns there, where there is another
    runner_up : relative distance to the next extreme elsewhere in the run; infinite where there is none
    at_edge : whether the extreme lies at an edge of a load or of the window
    """

    node: int
    time: float
    ball: int
    other: int | None = None
    rate: float = 0.0
    other_rate: float = 0.0
    runner_up: float = math.inf
    at_edge: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """What a kind sees of a run.

    Attributes
    ----------
    manifest, numbers, window, nodes : of the run
    signals : channels along the nodes
    marks : moments by quantity, and "max", "min" or "place"
    slopes : derivative of a parameter or constant by name, shape (directions,)
    directions : how many
    """

    manifest: Manifest
    numbers: Numbers
    window: Window
    nodes: Nodes
    signals: Mapping[str, Signal]
    marks: Mapping[tuple[str, str], Mark]
    slopes: Callable[[str], Array]
    directions: int

    def channel(self, quantity: Quantity) -> tuple[Array, Array]:
        """The quantity's channel along the nodes, and its derivative: shapes (nodes,), (nodes, directions)."""
        signal = self.signals[quantity.channel]
        if quantity.ball is not None or signal.value.shape[1] == 1:
            column = 0 if quantity.ball is None else quantity.ball - 1
            return signal.value[:, column], signal.slope[:, column]
        rows, best = np.arange(len(signal.value)), np.argmax(signal.value, axis=1)
        return signal.value[rows, best], signal.slope[rows, best]

    def integral(self, values: Array, slopes: Array) -> tuple[complex, Array]:
        """Integral over the time that counts, and its derivative."""
        nodes = self.nodes
        return complex(nodes.weight @ values), nodes.weight @ slopes + values @ nodes.weight_slope

    @property
    def length(self) -> tuple[float, Array]:
        """Length of the time that counts, and its derivative [s]."""
        return float(np.sum(self.nodes.weight)), np.sum(self.nodes.weight_slope, axis=0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """A quantity's value and derivative.

    Attributes
    ----------
    value : in the quantity's unit
    slope : derivative along the directions, shape (directions,)
    time, ball : of an extreme: when [s], and which ball, counted from 1
    notes : what to mind
    """

    value: float
    slope: Array
    time: float | None = None
    ball: int | None = None
    notes: tuple[str, ...] = ()


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
    static : whether it is one of the rings at rest, for which nothing is run (`raceway.runtime.quantities.study`)
    """

    summary: str
    evaluate: Callable[[View, Quantity], Estimate] | None
    extremes: tuple[str, ...] = ()
    place: str = ""
    channel: str = ""
    unit: str = ""
    static: bool = False


def _mean(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    total, moved = view.integral(value, slope)
    length, longer = view.length
    mean = total.real / length
    return Estimate(value=mean, slope=(moved.real - mean * longer) / length)


def _rms(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    total, moved = view.integral(value**2, 2.0 * value[:, None] * slope)
    length, longer = view.length
    square = total.real / length
    root = math.sqrt(square)
    if root == 0.0:
        return Estimate(value=0.0, slope=np.zeros(view.directions), notes=("zero throughout",))
    return Estimate(value=root, slope=(moved.real - square * longer) / (2.0 * root * length))


#: Extremes nearer to each other than this share are told: a small change may make the other one the largest.
RIVAL = 1e-3


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
    if mark.runner_up < RIVAL:
        notes.append(f"another extreme comes within {mark.runner_up:.1e} of it")
    ball = mark.ball + 1 if signal.value.shape[1] > 1 else None
    return Estimate(value=float(value), slope=slope, time=mark.time, ball=ball, notes=tuple(notes))


def _range(view: View, quantity: Quantity) -> Estimate:
    top, bottom = _extreme(view, quantity, "max"), _extreme(view, quantity, "min")
    return Estimate(value=top.value - bottom.value, slope=top.slope - bottom.slope, notes=top.notes + bottom.notes)


def _at_place(view: View, quantity: Quantity) -> Estimate:
    mark = view.marks[quantity.name, "place"]
    value, slope = view.channel(quantity)
    return Estimate(value=float(value[mark.node]), slope=slope[mark.node], time=mark.time)


def _amplitude(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    frequency, faster = _frequency(view, quantity.place)
    length, longer = view.length
    total, moved = view.integral(value, slope)
    mean = total.real / length
    mean_slope = (moved.real - mean * longer) / length
    turning = np.exp(-2j * np.pi * frequency * view.nodes.t)
    angle_slope = 2.0 * np.pi * (faster * view.nodes.t[:, None] + frequency * view.nodes.slope)
    swing = (value - mean) * turning
    swing_slope = (slope - mean_slope) * turning[:, None] - 1j * swing[:, None] * angle_slope
    sum_, sum_slope = view.nodes.weight @ swing, view.nodes.weight @ swing_slope + swing @ view.nodes.weight_slope
    line, line_slope = 2.0 * sum_ / length, 2.0 * (sum_slope - sum_ * longer / length) / length
    size = abs(line)
    if size == 0.0:
        return Estimate(value=0.0, slope=np.zeros(view.directions), notes=("zero",))
    return Estimate(value=size, slope=np.real(np.conj(line) * line_slope) / size)


def _drive_work(view: View, quantity: Quantity) -> Estimate:
    mechanism = view.manifest.mechanism
    assert mechanism is not None  # it has a drive torque
    value, slope = view.channel(quantity)
    total, moved = view.integral(value, slope)
    length, longer = view.length
    # mean torque times the angle of a turn, which no parameter changes
    angle = math.copysign(clock.TURN, view.numbers.values[mechanism.speed])
    mean = total.real / length
    return Estimate(value=angle * mean, slope=angle * (moved.real - mean * longer) / length)


#: Every kind of quantity by name.
KINDS: Mapping[str, Kind] = {
    "max": Kind(summary="largest value", evaluate=lambda v, q: _extreme(v, q, "max"), extremes=("max",)),
    "min": Kind(summary="smallest value", evaluate=lambda v, q: _extreme(v, q, "min"), extremes=("min",)),
    "range": Kind(summary="largest less smallest value", evaluate=_range, extremes=("max", "min")),
    "mean": Kind(summary="mean over time", evaluate=_mean),
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
        place="a crank angle of the first turn (240deg, 4.19rad) or a time (0.41s)",
        unit="m",
        static=True,
    ),
    "static_peak_ball_force": Kind(
        summary="largest elastic force of any ball, at rest under the load of one instant",
        evaluate=None,
        place="a crank angle of the first turn (240deg, 4.19rad) or a time (0.41s)",
        unit="N",
        static=True,
    ),
}

#: Kinds of the ensembles' observables that are no differentiable quantities.
_COUNTED = ("peak_time", "peak_ball", "min_time")

#: Words people use for kinds.
_SYNONYMS = {"peak": "max"}

_FORM = re.compile(r"(?P<kind>[a-z_]+):(?P<channel>[^\[\]@\s]+)(?:\[(?P<ball>\d+)\])?(?:@(?P<place>\S+))?")
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


def channels_of(manifest: Manifest) -> dict[str, tuple[int, str]]:
    """States and outputs of a model: columns and unit of each."""
    return {info.name: (info.size, info.unit) for info in (*manifest.states, *manifest.outputs)}


def parse_quantity(manifest: Manifest, text: str) -> Quantity:
    """Read the name of a quantity.

    Raises
    ------
    RequestError
        No such kind, output, ball or place; the nearest known names are told.
    """
    channels = channels_of(manifest)
    aliases = _aliases(channels)
    form = _FORM.fullmatch(aliases.get(text, text))
    bare, _, instant = text.partition("@")
    kind = KINDS.get(bare)
    if kind is not None and kind.static:
        if manifest.bearing is None:
            raise RequestError(f"{text}: this scene has no bearing. Ask for another quantity.")
        if instant:
            _check_place(manifest, text, kind, bare, instant)
        return Quantity(name=text, kind=bare, channel="", ball=None, place=instant, unit=kind.unit)
    if kind is not None and kind.channel and not instant:
        if kind.channel not in channels:
            raise RequestError(
                f"{text}: this scene has no output {kind.channel}. Add it to the scene's run.outputs, or ask for "
                "another quantity."
            )
        return Quantity(name=text, kind=bare, channel=kind.channel, ball=None, place="", unit=kind.unit)
    if form is None:
        known = _usable(manifest, channels)
        raise RequestError(f"{unknown_name('quantity', text, known)} Its form is kind:output, as in max:ball.force.")
    name = _SYNONYMS.get(form["kind"], form["kind"])
    if name in _COUNTED:
        raise RequestError(f"{text}: {name} is found in ensembles, and has no derivative here. Ask for max: instead.")
    if name not in KINDS or KINDS[name].unit:
        raise RequestError(f"{text}: {unknown_name('kind of quantity', form['kind'], [*KINDS, *_SYNONYMS])}")
    if form["channel"] not in channels:
        hint = unknown_name("output", form["channel"], channels)
        raise RequestError(f"{text}: {hint} The scene's run.outputs says which are computed.")
    columns, unit = channels[form["channel"]]
    ball = None if form["ball"] is None else int(form["ball"])
    if ball is not None and not (columns > 1 and 1 <= ball <= columns):
        allowed = f"1 to {columns}" if columns > 1 else "none, for it has no balls"
        raise RequestError(f"{text}: ball {ball} was given; {form['channel']} allows {allowed}.")
    place = form["place"] or ""
    _check_place(manifest, text, KINDS[name], name, place)
    return Quantity(name=text, kind=name, channel=form["channel"], ball=ball, place=place, unit=unit)


def default_quantities(manifest: Manifest) -> tuple[str, ...]:
    """What is asked for when nothing is named: ball forces and motion of the rings, else loads of the mechanism."""
    channels = channels_of(manifest)
    wanted = [
        *(("peak_ball_force", "ball.force"), ("rms:inner.x", "inner.x"), ("rms:inner.y", "inner.y")),
        *(("range:inner.y", "inner.y"), ("rms:outer.y", "outer.y")),
    ]
    found = [name for name, channel in wanted if channel in channels]
    if not found:
        found = [f"max:{name}" for name in channels if name.startswith("reaction.")]
        found += ["max:drive_torque"] if "drive_torque" in channels else []
    return tuple(found)


def place_of(manifest: Manifest, numbers: Numbers, window: Window, quantity: Quantity) -> tuple[float, Place]:
    """Time at which a quantity with a place is taken, in the last turn [s], and how it moves."""
    if quantity.kind == "end":
        return window.duration, Place(kind="end", number=0.0)
    asked = named_place(quantity)
    if asked.kind == "time":
        number = asked.number
        if not 0.0 <= number <= window.duration:
            raise RequestError(f"{quantity.name}: the run ends at {window.duration:g} s. Run longer, or ask earlier.")
        return number, asked
    angle = asked.number
    speed = clock.shaft_speed(manifest, numbers.values)
    if speed == 0.0:
        raise RequestError(f"{quantity.name}: nothing turns (its speed is zero). Name a time instead, as in @0.41s.")
    start = numbers.values[manifest.mechanism.start_angle] if manifest.mechanism is not None else 0.0
    turns = (start + speed * window.duration - angle) / clock.TURN
    # the last turn before the end, an angle at the very end included; 1e-9 of a turn is rounding
    whole = math.floor(turns + 1e-9) if speed > 0.0 else math.ceil(turns - 1e-9)
    time = (angle + clock.TURN * whole - start) / speed
    if time < 0.0:
        raise RequestError(f"{quantity.name}: the run is over before that angle is passed. Run longer.")
    return min(time, window.duration), asked


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Of what kind a place is: "angle" [rad], "time" [s] or "end"."""

    kind: str
    number: float


def named_place(quantity: Quantity) -> Place:
    """The place written behind ``@``: an angle or a time."""
    form = _PLACE.fullmatch(quantity.place)
    assert form is not None  # checked when read
    number = float(form["number"])
    if form["unit"] == "s":
        return Place(kind="time", number=number)
    return Place(kind="angle", number=math.radians(number) if form["unit"] == "deg" else number)


def place_slope(
    manifest: Manifest, numbers: Numbers, place: Place, time: float, end: Array, slopes: Callable[[str], Array]
) -> Array:
    """Derivative of the time of a place along the directions [s/unit]; `end` is that of the end of the run."""
    if place.kind == "end":
        return end
    if place.kind == "time":
        return np.zeros_like(end)
    speed = clock.shaft_speed(manifest, numbers.values)
    if manifest.mechanism is not None:
        moved = slopes(manifest.mechanism.start_angle) + time * slopes(manifest.mechanism.speed)
    else:
        assert manifest.bearing is not None
        moved = time * slopes(manifest.bearing.shaft_speed)
    return -moved / speed


def _frequency(view: View, place: str) -> tuple[float, Array]:
    """A frequency [Hz] and its derivative along the directions."""
    manifest, values = view.manifest, view.numbers.values
    form = _PLACE.fullmatch(place)
    if form is not None and form["unit"] == "Hz":
        return float(form["number"]), np.zeros(view.directions)
    speed = clock.shaft_speed(manifest, values)
    name = manifest.mechanism.speed if manifest.mechanism is not None else None
    if name is None:
        assert manifest.bearing is not None
        name = manifest.bearing.shaft_speed
    faster = view.slopes(name)
    if form is not None:
        order = float(form["number"])
        return order * abs(speed) / clock.TURN, order * math.copysign(1.0, speed) * faster / clock.TURN
    bearing = manifest.bearing
    assert bearing is not None
    ball, pitch = values["bearing.ball_diameter"], values["bearing.pitch_diameter"]

    def of(ratio: complex, shaft: complex) -> complex:
        """The same closed forms for complex numbers: their derivative is exact to rounding (complex step)."""
        cage = shaft * (1.0 - ratio) / 2.0
        spin = shaft * (1.0 - ratio**2) / (2.0 * ratio)
        passing = {"ball_pass_outer": bearing.balls * cage, "ball_pass_inner": bearing.balls * (shaft - cage)}
        return {"shaft": shaft, "cage": cage, "ball_spin": spin, **passing}[_FREQUENCIES[place]]

    known: KinematicFrequencies = kinematic_frequencies(bearing.balls, ball, pitch, speed)
    ratio, shaft, tiny = ball / pitch, abs(speed) / clock.TURN, 1e-30
    by_ratio = of(complex(ratio, tiny), shaft).imag / tiny
    by_shaft = of(ratio, complex(shaft, tiny)).imag / tiny
    ratio_slope = (view.slopes("bearing.ball_diameter") - ratio * view.slopes("bearing.pitch_diameter")) / pitch
    shaft_slope = math.copysign(1.0, speed) * faster / clock.TURN
    return float(getattr(known, _FREQUENCIES[place])), by_ratio * ratio_slope + by_shaft * shaft_slope


def _check_place(manifest: Manifest, text: str, kind: Kind, name: str, place: str) -> None:
    if not kind.place:
        if place:
            raise RequestError(f"{text}: {name} takes nothing behind @. Leave @{place} away.")
        return
    form = _PLACE.fullmatch(place)
    turning = manifest.mechanism is not None or manifest.bearing is not None
    if name == "amplitude":
        fine = (form is not None and form["unit"] in ("Hz", "x")) or place in _FREQUENCIES
        if place in _FREQUENCIES and (manifest.bearing is None or manifest.bearing.balls < 1):
            fine = False
    else:
        fine = form is not None and (form["unit"] == "s" or (form["unit"] in ("deg", "rad") and turning))
    if not fine:
        example = "amplitude:inner.y@2x" if name == "amplitude" else "value:inner.y@240deg"
        raise RequestError(f"{text}: behind @ {kind.place} is expected, not {place!r}. Example: {example}.")


def _aliases(channels: Mapping[str, tuple[int, str]]) -> dict[str, str]:
    """Names for people: ``peak_ball_force``, ``rms_inner_y``."""
    kinds = [name for name, kind in KINDS.items() if not kind.place and not kind.unit]
    return {
        f"{kind}_{channel.replace('.', '_')}": f"{kind}:{channel}"
        for channel in channels
        for kind in (*kinds, *_SYNONYMS, *_COUNTED)
    }


def _usable(manifest: Manifest, channels: Mapping[str, tuple[int, str]]) -> list[str]:
    """Names that can be asked for as they stand, for suggestions."""
    open_ = [name for name, kind in KINDS.items() if not kind.place and not kind.unit]
    counted = tuple(f"{name}:" for name in _COUNTED)
    alone = {name: kind for name, kind in KINDS.items() if kind.unit}
    return [
        *(alias for alias, meant in _aliases(channels).items() if not meant.startswith(counted)),
        *(f"{name}:{channel}" for name in open_ for channel in channels),
        *(
            name
            for name, kind in alone.items()
            if (manifest.bearing is not None if kind.static else kind.channel in channels)
        ),
    ]
