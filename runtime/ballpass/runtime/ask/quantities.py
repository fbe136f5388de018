"""Names of quantities of interest: numbers that a run is asked for, each with its derivative.

In: a name, `parse_quantity`.  Out: a `Quantity`, which `ballpass.runtime.ask.study` evaluates along a run.

A name is ``kind:output``, with ``[ball]`` for one ball and ``@place`` where a kind wants one::

    max:ball.force          rms:inner.y        value:inner.y@240deg      amplitude:inner.y@bpfo
    max:ball.force[3]       range:inner.x      value:inner.y@0.41s       amplitude:inner.y@2x

Without ``[ball]`` an output of the balls is that of the most loaded ball at each moment.  The names of observables of
ensembles (`run/reductions.py`) mean the same numbers here, ``peak_ball_force`` and ``rms_inner_y`` included.
What each kind does with a run stands in `ballpass.runtime.ask.kinds`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from ballpass.runtime.ask.kinds import KINDS, Kind
from ballpass.runtime.ask.quantity_location import check_first_turns, is_frequency, is_instant
from ballpass.runtime.ask.quantity_records import Quantity
from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.ratings.readings import KINDS as LIFE
from ballpass.runtime.run.request import no_output

#: Kinds of the ensembles' observables that are no differentiable quantities.
_COUNTED = ("peak_time", "peak_ball", "min_time")

#: What is asked for of each bearing when nothing is named.
DEFAULTS = (
    *(("max", "ball.force"), ("rms", "inner.x"), ("rms", "inner.y")),
    *(("range", "inner.y"), ("rms", "outer.y")),
)

#: Units of integrals over time that have names.
_OVER_TIME = {"W": "J", "m/s": "m", "m/s^2": "m/s", "rad/s": "rad", "rad/s^2": "rad/s"}

#: Kinds as figures call them, where their name is no word for it.
_IN_WORDS = {
    "max": "highest",
    "min": "lowest",
    "end": "at the end",
    "value": "at",
    "amplitude": "amplitude at",
    "peak_time": "time of the highest",
    "peak_ball": "ball of the highest",
}

#: Words people use for kinds.
_SYNONYMS = {"peak": "max"}

_FORM = re.compile(r"(?P<kind>[a-z_]+):(?P<channel>[^\[\]@\s]+)(?:\[(?P<ball>\d+)\])?(?:@(?P<place>\S+))?")


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
    aliases = _aliases(channels) | _lives(manifest)
    form = _FORM.fullmatch(aliases.get(text, text))
    bare, _, instant = text.partition("@")
    statics = _statics(manifest)
    static, bearing = statics.get(bare, (bare, ""))
    kind = KINDS.get(static)
    if kind is not None and kind.static:
        if not manifest.bearings:
            raise RequestError(f"{text}: this scene has no bearing. Ask for another quantity.")
        if bare not in statics:
            allowed = " or ".join(name for name, (meant, _) in statics.items() if meant == bare)
            raise RequestError(f"{text}: the scene has several bearings, and this names none. Write {allowed}.")
        if instant:
            _check_place(manifest, text, kind, bare, instant)
        asked = Quantity(name=text, kind=static, channel=bearing, ball=None, place=instant, unit=kind.unit)
        check_first_turns(asked)
        return asked
    if kind is not None and kind.channel and not instant:
        if kind.channel not in channels:
            raise RequestError(f"{text}: {no_output(manifest, kind.channel, list(channels))}")
        return Quantity(name=text, kind=bare, channel=kind.channel, ball=None, place="", unit=kind.unit)
    if form is None:
        known = _usable(manifest, channels)
        raise RequestError(f"{unknown_name('quantity', text, known)} Its form is kind:output, as in max:ball.force.")
    name = _SYNONYMS.get(form["kind"], form["kind"])
    if name in _COUNTED:
        raise RequestError(f"{text}: {name} is found in ensembles, and has no derivative here. Ask for max: instead.")
    if name not in KINDS or KINDS[name].static or KINDS[name].channel:
        raise RequestError(f"{text}: {unknown_name('kind of quantity', form['kind'], [*KINDS, *_SYNONYMS])}")
    if KINDS[name].of_loads:
        bearings = {meant: written for written, meant in _lives(manifest).items()}
        if aliases.get(text, text) not in bearings:
            words = " or ".join(written for meant, written in bearings.items() if meant.startswith(f"{name}:"))
            raise RequestError(f"{text}: {name} is of a bearing. Write {words or 'it for a scene with one'}.")
        return Quantity(name=text, kind=name, channel=form["channel"], ball=None, place="", unit=KINDS[name].unit)
    if form["channel"] not in channels:
        raise RequestError(f"{text}: {no_output(manifest, form['channel'], list(channels))}")
    columns, unit = channels[form["channel"]]
    ball = None if form["ball"] is None else int(form["ball"])
    if ball is not None and not (columns > 1 and 1 <= ball <= columns):
        allowed = f"1 to {columns}" if columns > 1 else "none, for it has no balls"
        raise RequestError(f"{text}: ball {ball} was given; {form['channel']} allows {allowed}.")
    place = form["place"] or ""
    _check_place(manifest, text, KINDS[name], name, place)
    if KINDS[name].over_time:
        unit = _OVER_TIME.get(unit, f"{unit}*s")
    return Quantity(name=text, kind=name, channel=form["channel"], ball=ball, place=place, unit=unit)


def channel_words(manifest: Manifest, kind: str, channel: str, ball: int | None = None, place: str = "") -> str:
    """What a number of a state or output is, for figures: "Position of the centre of the inner ring along y, rms"."""
    if kind in LIFE:
        reading = f"reading {LIFE[kind][0]}" if len(LIFE[kind]) == 1 else "shortest reading"
        return ", ".join(["Rating life", reading, *_bearings(manifest, channel)])
    described = {info.name: info.description for info in manifest.quantities}
    described |= {info.name: info.description for info in (*manifest.states, *manifest.outputs)}
    which = "any ball" if ball is None else f"ball {ball}"
    return f"{described[channel].replace('each ball', which)}, {_IN_WORDS.get(kind, kind)} {place}".rstrip()


def quantity_words(manifest: Manifest, quantity: Quantity) -> str:
    """What a quantity is, for figures."""
    kind = KINDS[quantity.kind]
    if not (kind.static or kind.channel):
        return channel_words(manifest, quantity.kind, quantity.channel, quantity.ball, quantity.place)
    words = [kind.summary, *_bearings(manifest, quantity.channel), *filter(None, [quantity.place])]
    return ", ".join(words)


def _bearings(manifest: Manifest, channel: str) -> list[str]:
    """The bearing that a channel is of, where bearings have names."""
    return [f"bearing {one.name}" for one in manifest.bearings if one.name and channel.startswith(one.prefix)]


def default_quantities(manifest: Manifest) -> tuple[str, ...]:
    """What is asked for when nothing is named: ball forces and motion of the rings, else loads of the mechanism."""
    channels = channels_of(manifest)
    wanted = [(kind, f"{bearing.prefix}{channel}") for bearing in manifest.bearings for kind, channel in DEFAULTS]
    found = [f"{kind}:{channel}" for kind, channel in wanted if channel in channels]
    found = ["peak_ball_force" if name == "max:ball.force" else name for name in found]
    if not found:
        found = [f"max:{name}" for name in channels if name.startswith("reaction.")]
        found += ["max:drive_torque"] if "drive_torque" in channels else []
    return tuple(found)


def _check_place(manifest: Manifest, text: str, kind: Kind, name: str, place: str) -> None:
    if not kind.place:
        if place:
            raise RequestError(f"{text}: {name} takes nothing behind @. Leave @{place} away.")
        return
    fine = is_frequency(manifest, place) if name == "amplitude" else is_instant(manifest, place)
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
    } | {
        # as the summary names it, with the bearing first
        f"{channel.removesuffix('ball.force')}peak_ball_force": f"max:{channel}"
        for channel in channels
        if channel.endswith(".ball.force")
    }


def _lives(manifest: Manifest) -> dict[str, str]:
    """Names of the kinds that are of a bearing's loads, with its prefix: ``life``, ``big_end.life_sectors``."""
    return {
        f"{bearing.prefix}{name}": f"{name}:{bearing.prefix}ball.force"
        for name, kind in KINDS.items()
        if kind.of_loads
        for bearing in manifest.bearings
    }


def _statics(manifest: Manifest) -> dict[str, tuple[str, str]]:
    """Names of the static quantities, ``static_left_deflection`` of one bearing of several; -> (kind, prefix)."""
    return {
        name.replace("_", f"_{bearing.name}_", 1) if bearing.name else name: (name, bearing.prefix)
        for name, kind in KINDS.items()
        if kind.static
        for bearing in manifest.bearings
    }


def _usable(manifest: Manifest, channels: Mapping[str, tuple[int, str]]) -> list[str]:
    """Names that can be asked for as they stand, for suggestions."""
    open_ = [name for name, kind in KINDS.items() if not kind.place and not kind.unit]
    counted = tuple(f"{name}:" for name in _COUNTED)
    alone = {name: kind for name, kind in KINDS.items() if kind.unit and not kind.of_loads}
    return [
        *(alias for alias, meant in _aliases(channels).items() if not meant.startswith(counted)),
        *(f"{name}:{channel}" for name in open_ for channel in channels),
        *(name for name, kind in alone.items() if not kind.static and kind.channel in channels),
        *_statics(manifest),
        *_lives(manifest),
    ]
