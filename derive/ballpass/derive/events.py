"""Events of a model: where its equations change, each a switching function with its rate.

In: the inputs of a model and its bearings.  Out: `Event` after `Event`.  Steps end on all of them.  Zeros of a function
of time, or of an angle that turns with a given speed, are known before a run: its segments end there.  Zeros of a
function of the state are located in the step in which they occur.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.bearing.equations import BearingModel
from ballpass.derive.terms import TIME
from ballpass.derive.variables import Input, StateSwitch


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A place at which the equations change.

    Attributes
    ----------
    name : for texts; of ``ball.`` events there is one for each ball
    kind : what the switching function depends on; one of an angle counts modulo a turn
    function : zero at the event, positive after it
    rate : its time derivative; None where that takes accelerations
    changes : what changes there
    """

    name: str
    kind: Literal["time", "angle", "state"]
    function: sp.Expr
    rate: sp.Expr | None
    changes: str


def events_of(
    inputs: Iterable[Input], bearings: Iterable[BearingModel], switches: Iterable[StateSwitch]
) -> tuple[Event, ...]:
    """Events of a model, in the order of its inputs, bearings and loads that switch where the motion decides."""
    listed = tuple(inputs)
    valued = {item.times for item in listed if item.kind == "table"}
    # the slope of a table whose value is a state stands alone
    found = [e for item in listed if item.kind != "table_rate" or item.times not in valued for e in _of_input(item)]
    found += [event for bearing in bearings for event in _of_balls(bearing)]
    found += [
        Event(name=one.border.name, kind="state", function=one.function, rate=one.rate, changes=one.changes)
        for one in switches
    ]
    return tuple(found)


def _of_input(item: Input) -> Iterator[Event]:
    """Edges of windows, and knots of tables over time or an angle."""
    turning, passed, rate, uneven = item.turning, TIME, sp.S.One, ""
    if turning is not None:
        rate = sp.Symbol(turning.rate, real=True)
        passed = sp.Symbol(turning.offset, real=True) + rate * TIME
        uneven = ", of an angle whose rate changes" if turning.turns or turning.times else ""
    if item.kind == "gate":
        for edge in (edge for window in item.windows for edge in window):
            function = item.parts * passed - sp.Symbol(edge, real=True)
            changes = f"`{item.name}`{uneven}"
            yield Event(name=edge, kind="angle", function=function, rate=item.parts * rate, changes=changes)
    elif item.kind in ("table", "table_rate"):
        changes = f"the slope of `{item.name}`" if item.kind == "table" else f"`{item.name}`"
        for knot in item.times[:1]:
            yield Event(
                name=f"{knot} and the {len(item.times) - 1} rows behind",
                kind="time" if turning is None else "angle",
                function=passed - sp.Symbol(knot, real=True),
                rate=rate,
                changes=f"{changes}{uneven}",
            )


def _of_balls(bearing: BearingModel) -> Iterator[Event]:
    """Kinks and jumps of a ball's force."""
    ball = bearing.ball
    for switch in ball.switching.switches:
        symbol = ball.deflection_rate if switch.of_rate else ball.deflection
        rate = None if switch.of_rate or ball.damping_force is None else ball.deflection_rate
        changes = bearing.names.words(f"the force of the ball {'jumps' if switch.jumps else 'has a kink'}")
        yield Event(name=symbol.name, kind="state", function=switch.function, rate=rate, changes=changes)
