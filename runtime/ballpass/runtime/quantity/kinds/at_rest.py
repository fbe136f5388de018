"""Quantities of the rings at rest under the load of one instant: they need no run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.equilibrium import instant, static_equilibrium
from ballpass.runtime.quantity.location import FIRST_TURN, check_first_turns, named_place, place_slope
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity
from ballpass.runtime.run.directions import Chain


def at_rest(model: LoadedModel, numbers: Numbers, quantity: Quantity, chain: Chain | None) -> Estimate:
    """A static quantity; its derivative follows from the implicit function of the equilibrium.

    Parameters
    ----------
    chain : directions of the derivative; None for none

    Raises
    ------
    RequestError
        No bearing, an unloaded ring in a clearance, or an angle where nothing turns.
    SimulationError
        Nothing holds the rings.
    """
    time, moved = 0.0, np.zeros(0 if chain is None else len(chain.names))
    if quantity.place:
        # an angle is that of the first turn, as in `Model.static_equilibrium`: so are the places of the balls
        kind = named_place(quantity)
        by_angle = kind.kind == "angle"
        time = instant(model, numbers, None if by_angle else kind.number, kind.number if by_angle else None)
        if chain is not None:
            moved = place_slope(model.manifest, numbers, kind, time, moved, chain.derivative)
    rest = static_equilibrium(model, numbers, t=time)
    names = [] if chain is None else [*chain.names, "time"]
    if quantity.kind == "static_deflection":
        info = quantity.bearing(model.manifest)
        states = [info.inner_states(axis, numbers.values) for axis in "xy"]
        place = np.array([sum(weight * rest[name] for name, weight in one.items()) for one in states])
        value, ball = float(np.hypot(*place)), None
        rows = rest.derivative([info.inner_state(axis) for axis in "xy"], names) if names else np.zeros((2, 1))
        slope = place @ rows / value if value else np.zeros(rows.shape[1])
    else:
        bearings = model.manifest.bearings
        k = [bearing.prefix for bearing in bearings].index(quantity.channel)
        first = sum(bearing.balls for bearing in bearings[:k])
        forces = rest.ball_force[first : first + bearings[k].balls]
        best = int(np.argmax(forces))
        value, ball = float(forces[best]), best + 1
        slope = rest.derivative(f"{quantity.channel}ball.elastic_force", names)[best] if names else np.zeros(1)
    return Estimate(value=value, slope=slope[:-1] + slope[-1] * moved, time=time, ball=ball)


_DEFLECTION = Kind(
    name="static_deflection",
    summary="distance of the inner ring's centre from its unloaded place, at rest under the load of one instant",
    takes="bearing at rest",
    place=FIRST_TURN,
    unit="m",
    check=check_first_turns,
    at_rest=at_rest,
)
_FORCE_WORDS = "largest elastic force of any ball, at rest under the load of one instant"

KINDS = (_DEFLECTION, replace(_DEFLECTION, name="static_peak_ball_force", summary=_FORCE_WORDS, unit="N"))
