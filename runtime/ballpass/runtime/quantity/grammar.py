"""Names of quantities (numbers computed from a run), alike in every command and call.

In: a name, `parse_quantity`.  Out: a `Quantity`, which `ballpass.runtime.quantity.quantity_run` evaluates along a run.

A name is ``kind:output``, with ``[ball]`` for one ball and ``@place`` where a kind wants one::

    max:ball.force          rms:inner.y        value:inner.y@240deg      amplitude:inner.y@bpfo
    max:ball.force[3]       range:inner.x      value:inner.y@0.41s       amplitude:inner.y@2x

Without ``[ball]`` an output of the balls is the largest of all balls at each moment.  Underscores may stand for
colon and points, ``peak_ball_force`` and ``rms_inner_y``.  What each kind does stands in its file in `kinds`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.records import Kind, Quantity
from ballpass.runtime.quantity.registry import KINDS, find_kind
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.request.request import no_output
from ballpass.runtime.run.reductions import channel_names

_Given = TypeVar("_Given")
_Found = TypeVar("_Found")

#: Default quantities of each bearing.
DEFAULTS = (
    *(("max", "ball.force"), ("rms", "inner.x"), ("rms", "inner.y")),
    *(("range", "inner.y"), ("rms", "outer.y")),
)

_FORM = re.compile(r"(?P<kind>[a-z_]+):(?P<channel>[^\[\]@\s]+)(?:\[(?P<ball>\d+)\])?(?:@(?P<place>\S+))?")


def quantities_of(model: LoadedModel, names: Sequence[str]) -> tuple[Quantity, ...]:
    """Read names of quantities of a model, and refuse what cannot be evaluated, before anything runs.

    Raises
    ------
    RequestError
        As `parse_quantities`; then what has no value with the scene's numbers.  All faults at once.
    """
    found = parse_quantities(model.manifest, names)
    values = model.numbers(None).values

    def check(quantity: Quantity) -> None:
        one = KINDS[quantity.kind].check
        if one is not None:
            one(model.manifest, values, quantity)

    _all_at_once(check, found)
    if not found:
        raise RequestError("of: at least one quantity is expected. Example: peak_ball_force.")
    return found


def parse_quantities(manifest: Manifest, names: Sequence[str]) -> tuple[Quantity, ...]:
    """Read names of quantities, each once.

    Raises
    ------
    RequestError
        As `refuse_unknown_kinds`; then what the manifest does not have.  All faults at once.
    """
    refuse_unknown_kinds(names)
    channels = channels_of(manifest)
    known = _names(manifest, channels)
    return tuple(_all_at_once(lambda name: _parsed(manifest, channels, known, name), dict.fromkeys(names)))


def refuse_unknown_kinds(names: Iterable[str]) -> None:
    """Refuse kinds of quantities and places that no scene has, all at once: known before a scene is derived."""

    def check(text: str) -> None:
        kind = _kind_of(text)
        if kind is not None:
            _check_place(None, text, kind, text.partition("@")[2])

    _all_at_once(check, dict.fromkeys(names))


def _all_at_once(read: Callable[[_Given], _Found], given: Iterable[_Given]) -> list[_Found]:
    """What is read from each; the messages of all that cannot be read in one `RequestError`."""
    found, faults = [], []
    for one in given:
        try:
            found.append(read(one))
        except RequestError as fault:
            faults.append(str(fault))
    if faults:
        raise RequestError("\n".join(faults))
    return found


def parse_quantity(manifest: Manifest, text: str) -> Quantity:
    """Read the name of a quantity.

    Raises
    ------
    RequestError
        No such kind, output, ball or place; the message has the nearest known names.
    """
    channels = channels_of(manifest)
    return _parsed(manifest, channels, _names(manifest, channels), text)


def _parsed(
    manifest: Manifest, channels: Mapping[str, tuple[int, str]], names: Mapping[str, tuple[Kind, str]], text: str
) -> Quantity:
    whole, _, place = str(text).partition("@")
    if whole in names:
        kind, channel = names[whole]
        _check_place(manifest, text, kind, place)
        unit = kind.unit or (kind.unit_of(channels[channel][1]) if kind.unit_of else channels[channel][1])
        return Quantity(name=text, kind=kind.name, channel=channel, ball=None, place=place, unit=unit)
    form = _FORM.fullmatch(str(text))
    if form is None:
        _explain_alone(manifest, channels, text, whole)
        known = [name for name, (kind, _) in names.items() if kind.place is None or kind.at_rest]
        raise RequestError(f"{unknown_name('quantity', text, known)} Its form is kind:output, as in max:ball.force.")
    found = _kind_of(text)
    assert found is not None  # a form has a kind
    if found.takes == "bearing":
        words = " or ".join(name for name, (kind, _) in names.items() if kind is found and ":" not in name)
        raise RequestError(f"{text}: {found.name} is of a bearing. Write {words or 'it for a scene with one'}.")
    if form["channel"] not in channels:
        raise RequestError(f"{text}: {no_output(manifest, form['channel'], list(channels))}")
    columns, unit = channels[form["channel"]]
    ball = None if form["ball"] is None else int(form["ball"])
    if ball is not None and not (columns > 1 and 1 <= ball <= columns):
        allowed_balls = f"1 to {columns}" if columns > 1 else "none, for it has no balls"
        words = f"ball {ball} was given; {form['channel']} allows {allowed_balls}."
        raise RequestError(f"{text}: {bearing_words(words, manifest.bearings)}")
    place = form["place"] or ""
    _check_place(manifest, text, found, place)
    unit = found.unit or (found.unit_of(unit) if found.unit_of else unit)
    return Quantity(name=text, kind=found.name, channel=form["channel"], ball=ball, place=place, unit=unit)


def _kind_of(text: str) -> Kind | None:
    """The kind in front of a colon; None for a name without one, which is a scene's own."""
    form = _FORM.fullmatch(str(text))
    if form is None:
        return None
    found = find_kind(form["kind"])
    if found is None or found.takes in ("nothing", "bearing at rest"):
        allowed = [name for name, kind in KINDS.items() if kind.takes in ("channel", "bearing")]
        also = [name for kind in KINDS.values() for name in kind.also]
        raise RequestError(f"{text}: {unknown_name('kind of quantity', form['kind'], [*allowed, *also])}")
    return found


def channels_of(manifest: Manifest) -> dict[str, tuple[int, str]]:
    """Channels of quantities: states, outputs, and ball forces of the steps; columns and unit of each."""
    known = {info.name: (info.size, info.unit) for info in (*manifest.states, *manifest.outputs)}
    every = {info.name: (info.size, info.unit) for info in manifest.quantities}
    balls = [name for name in channel_names(manifest) if name not in known]
    return known | {name: every[name] for name in balls if name in every}


def _names(manifest: Manifest, channels: Mapping[str, tuple[int, str]]) -> dict[str, tuple[Kind, str]]:
    """Names without ball and place: -> kind and channel."""
    found: dict[str, tuple[Kind, str]] = {}
    for kind in KINDS.values():
        for written, channel in _written(manifest, channels, kind):
            found.setdefault(written, (kind, channel))
    for channel in channels:
        if channel.endswith(".ball.force"):  # as the summary names it, with the bearing first
            found[f"{channel.removesuffix('ball.force')}peak_ball_force"] = (KINDS["max"], channel)
    return found


def _written(manifest: Manifest, channels: Mapping[str, tuple[int, str]], kind: Kind) -> Iterator[tuple[str, str]]:
    if kind.takes == "channel":
        for name in (kind.name, *kind.also):
            for channel in channels:
                yield f"{name}:{channel}", channel
                if kind.place is None:
                    yield f"{name}_{channel.replace('.', '_')}", channel
    elif kind.takes == "nothing":
        if kind.channel in channels:
            yield kind.name, kind.channel
    else:
        for bearing in manifest.bearings:
            if kind.takes == "bearing":
                for name in (kind.name, *kind.also):
                    yield f"{bearing.prefix}{name}", f"{bearing.prefix}ball.force"
                    yield f"{name}:{bearing.prefix}ball.force", f"{bearing.prefix}ball.force"
            else:
                # ``static_left_deflection`` of one bearing of several
                yield kind.name.replace("_", f"_{bearing.name}_", 1) if bearing.name else kind.name, bearing.prefix


def _explain_alone(manifest: Manifest, channels: Mapping[str, tuple[int, str]], text: str, name: str) -> None:
    """Raise `RequestError` for a kind that this scene does not have, or has several times."""
    kind = KINDS.get(name)
    if kind is None:
        return
    if kind.takes == "nothing":
        raise RequestError(f"{text}: {no_output(manifest, kind.channel, list(channels))}")
    if kind.takes in ("bearing", "bearing at rest"):
        if not manifest.bearings:
            raise RequestError(f"{text}: this scene has no bearing. Ask for another quantity.")
        allowed = " or ".join(written for written, _ in _written(manifest, channels, kind) if ":" not in written)
        raise RequestError(f"{text}: the scene has several bearings, and this names none. Write {allowed}.")


def _check_place(manifest: Manifest | None, text: str, kind: Kind, place: str) -> None:
    if kind.place is None:
        if place:
            raise RequestError(f"{text}: {kind.name} takes nothing after @. Omit @{place}.")
        return
    # rings at rest stand where the run starts, unless an instant is named
    if kind.takes == "bearing at rest" and not place:
        return
    if not kind.place.is_valid(manifest, place):
        raise RequestError(
            f"{text}: after @ {kind.place.words} is expected, not {place!r}. Example: {kind.place.example}."
        )


def quantity_words(manifest: Manifest, quantity: Quantity) -> str:
    """Description of a quantity for figures: "Position of the centre of the inner ring along y, rms"."""
    kind = KINDS[quantity.kind]
    if kind.takes != "channel":
        named = (one.name for one in manifest.bearings if one.name and quantity.channel.startswith(one.prefix))
        return ", ".join(
            [
                bearing_words(kind.words or kind.summary, manifest.bearings),
                *(f"bearing {name}" for name in named),
                *filter(None, [quantity.place]),
            ]
        )
    described = {info.name: info.description for info in manifest.quantities}
    described |= {info.name: info.description for info in (*manifest.states, *manifest.outputs)}
    which = r"any \1" if quantity.ball is None else rf"\1 {quantity.ball}"
    channel = re.sub(r"each (ball|roller)", which, described[quantity.channel])
    words = bearing_words(kind.words or kind.name, manifest.bearings, quantity.channel)
    return f"{channel}, {words} {quantity.place}".rstrip()


def default_quantities(manifest: Manifest) -> tuple[str, ...]:
    """Default quantities: ball forces and motion of the rings, else loads of the mechanism."""
    channels = channels_of(manifest)
    wanted = [(kind, f"{bearing.prefix}{channel}") for bearing in manifest.bearings for kind, channel in DEFAULTS]
    found = [f"{kind}:{channel}" for kind, channel in wanted if channel in channels]
    found = ["peak_ball_force" if name == "max:ball.force" else name for name in found]
    if not found:
        found = [f"max:{name}" for name in channels if name.startswith("reaction.")]
        found += ["max:drive_torque"] if "drive_torque" in channels else []
    return tuple(found)
