"""Events of a model: where its equations change, each a switching function with its rate.

In: the inputs of a model and its bearings.  Out: `Event` after `Event`.  Steps end on all of them.  Zeros of a function
of time, or of an angle that turns at constant speed, are known before a run: its segments end there.  Zeros of a
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
    turns = item.rate != ""
    rate = sp.Symbol(item.rate, real=True) if turns else sp.S.One
    passed = sp.Symbol(item.offset, real=True) + rate * TIME if turns else TIME
    if item.kind == "gate":
        for edge in (edge for window in item.windows for edge in window):
            function = passed - sp.Symbol(edge, real=True)
            lags = ", the angle less the lag of the cage" if item.times else ""
            yield Event(name=edge, kind="angle", function=function, rate=rate, changes=f"`{item.name}`{lags}")
    elif item.kind in ("table", "table_rate"):
        changes = f"the slope of `{item.name}`" if item.kind == "table" else f"`{item.name}`"
        for knot in item.times[:1]:
            yield Event(
                name=f"{knot} and the {len(item.times) - 1} rows behind",
                kind="angle" if turns else "time",
                function=passed - sp.Symbol(knot, real=True),
                rate=rate,
                changes=changes,
            )


def _of_balls(bearing: BearingModel) -> Iterator[Event]:
    """Kinks and jumps of a ball's force."""
    ball = bearing.ball
    for switch in ball.switching.switches:
        symbol = ball.deflection_rate if switch.of_rate else ball.deflection
        rate = None if switch.of_rate or ball.damping_force is None else ball.deflection_rate
        changes = bearing.names.words(f"the force of the ball {'jumps' if switch.jumps else 'has a kink'}")
        yield Event(name=symbol.name, kind="state", function=switch.function, rate=rate, changes=changes)
