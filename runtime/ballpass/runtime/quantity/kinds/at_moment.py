"""Values at one moment: at an angle of the last turn, at a time, at the end."""

from __future__ import annotations

from ballpass.runtime.quantity.location import INSTANT, check_instant
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, View


def _at_moment(view: View, quantity: Quantity) -> Estimate:
    mark = view.marks[quantity.name, "place"]
    value, slope = view.channel(quantity)
    return Estimate(value=float(value[mark.node]), slope=slope[mark.node], time=mark.time)


KINDS = (
    Kind(
        name="value",
        summary="value at a crank angle of the last turn, or at a time",
        words="at",
        place=INSTANT,
        check=check_instant,
        evaluate=_at_moment,
        at_moment=True,
    ),
    Kind(
        name="end",
        summary="value at the end of the run",
        words="at the end",
        evaluate=_at_moment,
        at_moment=True,
        reduced=lambda runs, quantity: runs.end[:, runs.layout.states.index(quantity.channel)].copy(),
        needs=lambda _channel: (),
    ),
)
