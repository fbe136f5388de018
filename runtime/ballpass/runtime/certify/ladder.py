"""Ways from cheap to accurate that are the same for all scenes, and what each was found to keep on the shipped ones.

In: a target and observables.  Out: the rung to begin at.  The errors are in ``ladder.json`` beside this module, written
by `make trade` from the trades of the shipped scenes: for each way and kind of observable the median error over the
ensemble of the scene where it is largest.  They say where to begin, not what a run has reached.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

from ballpass.runtime.certify.trade import FULL, Trade

#: Method and tolerance.
Way = tuple[str, float]

#: Where the errors are stored.
TABLE = Path(__file__).with_name("ladder.json")


def _ladder(fine: str) -> tuple[Way, ...]:
    return (
        ("stepper-rodas4", 1e-1),
        ("stepper-rodas4", 1e-2),
        ("stepper-rodas5p", 1e-3),
        *((fine, 10.0**decade) for decade in (-4, -5, -6, -7, -8, -9, -10)),
        ("stepper-rodas5p", 1e-11),
    )


#: Ways from cheap to accurate: for models that are not stiff, and stiff ones.
LADDER, STIFF_LADDER = _ladder("stepper-dop853"), _ladder("stepper-rodas5p")


def first_rung(ladder: Sequence[Way], target: float, observables: Sequence[tuple[str, str]]) -> int:
    """The cheapest rung that kept a target on the shipped scenes, or the last one that was measured on them."""
    table = errors()
    kinds = {kind_of(*one) for one in observables}
    measured = [k for k, way in enumerate(ladder[:-1]) if way in table]
    for k in measured:
        found = table[ladder[k]]
        if all(found.get(kind, max(found.values())) <= target for kind in kinds):
            return k
    return measured[-1]


def kind_of(kind: str, channel: str) -> str:
    """What observables are told apart by: whether of a ball or a ring, and extremes from means."""
    place = "ball" if channel.startswith("ball.") else "ring"
    return f"{'mean' if kind in ('mean', 'rms') else 'extreme'} of a {place}"


@cache
def errors() -> dict[Way, dict[str, float]]:
    """Errors of the ways by kind of observable [1]."""
    rows = json.loads(TABLE.read_text(encoding="utf-8"))["ways"]
    return {(row["method"], float(row["rtol"])): row["errors"] for row in rows}


def table_of(trades: Sequence[Trade], observables: Mapping[str, tuple[str, str]]) -> str:
    """The text of the table, from trades of several scenes.

    Parameters
    ----------
    observables : kind and channel of each quantity of the trades
    """
    rows = []
    for method, rtol in dict.fromkeys((*LADDER, *STIFF_LADDER)):
        worst: dict[str, float] = {}
        for one in (m for trade in trades for m in trade.measured):
            way = one.configuration
            if (way.model, way.method, way.rtol, way.switch) == (FULL, method, rtol, ""):
                for name, error in one.median.items():
                    kind = kind_of(*observables[name])
                    worst[kind] = max(worst.get(kind, 0.0), float(f"{error:.2g}"))
        if worst:
            rows.append({"method": method, "rtol": rtol, "errors": worst})
    return json.dumps({"written by": "make trade", "ways": rows}, indent=1, allow_nan=False) + "\n"
