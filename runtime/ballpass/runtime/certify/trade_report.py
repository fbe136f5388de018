"""A trade for people and for files: a table of what no other way beats, sentences, plain data.

In: a `Trade`.  Out: text, rows, plain data.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from ballpass.runtime.certify.trade import PROMISED, TARGETS, Trade
from ballpass.runtime.certify.whole_run import Way
from ballpass.runtime.run.locating import LOCATED


def words(trade: Trade) -> list[str]:
    """What each target costs for each quantity, and what locating kinks costs and gains."""
    columns: list[tuple[str, str | None]] = [(name, name) for name in trade.quantities]
    if len(columns) > 1:
        columns.append(("all of them", None))
    said = []
    for name, quantity in columns:
        for target in TARGETS:
            one = trade.cheapest(target, quantity)
            if one is None:
                best = min(trade.measured, key=lambda m, q=quantity: trade.error(m, q))  # type: ignore[misc]
                said.append(
                    f"{percent(target)} on {name}: nothing measured here; the best is "
                    f"{percent(trade.error(best, quantity))} ({best.way.words})."
                )
            else:
                said.append(f"{percent(target)} on {name}: {milliseconds(one.time)} a cycle ({one.way.words}).")
    known = ", ".join(f"{name} {percent(value)}" for name, value in trade.uncertainty.items())
    said.append(f"The reference, two methods that agree, is known to: {known}. Nothing below is claimed.")
    return said + _located(trade)


def _located(trade: Trade) -> list[str]:
    known = {one.way: one for one in trade.measured}
    pairs = []
    for way, one in known.items():
        plain = known.get(Way(method=way.method, rtol=way.rtol)) if way.kinks == LOCATED else None
        if plain is not None and math.isfinite(one.time) and math.isfinite(plain.time):
            pairs.append((one, plain))
    if not pairs:
        return []
    longer = sorted(one.time / plain.time for one, plain in pairs)[len(pairs) // 2]
    one, plain = min(pairs, key=lambda pair: pair[0].way.rtol)
    return [
        f"Ending steps on the kinks of the laws takes {longer:.2g} of the time at the same tolerance; at "
        f"{one.way.method}, rtol {one.way.rtol:g}, the worst error is {percent(trade.error(one))}, without "
        f"{percent(trade.error(plain))}."
    ]


def table(trade: Trade, quantity: str | None = None) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows of a front: error, time, way."""
    head: tuple[str, ...] = (f"error ({PROMISED:.0%} of runs)", "median error", "time a cycle", "way")
    rows: list[tuple[str, ...]] = []
    for one in trade.front(quantity):
        median = max(one.median.values()) if quantity is None else one.median[quantity]
        rows.append((percent(trade.error(one, quantity)), percent(median), milliseconds(one.time), one.way.words))
    return head, rows


def to_plain(trade: Trade) -> dict[str, Any]:
    """Plain data for JSON: the trade and its words; what is infinite becomes None."""
    return {"trade": _finite(asdict(trade)), "words": words(trade)}


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def percent(error: float) -> str:
    """A relative error as people read it: 1 %, 0.02 %, 3e-05 %."""
    if not math.isfinite(error):
        return "no result"
    value = 100.0 * error
    return f"{value:.2g} %" if value < 100.0 else f"{value:.0f} %"


def milliseconds(seconds: float) -> str:
    """A time as people read it."""
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.1 else f"{1e3 * seconds:.0f} ms"
