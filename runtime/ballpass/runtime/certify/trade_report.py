"""A trade for people and for files: the front in words, what each simplification costs and saves, JSON and back.

In: a `Trade`.  Out: text, a table, plain data.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.certify.trade import (
    FAST_MATH,
    FULL,
    KINKS_LOCATED,
    PROMISED,
    TARGETS,
    Configuration,
    Measured,
    Trade,
)


def words(trade: Trade) -> list[str]:
    """The front in words: what each target costs for each quantity, and what simplifications cost and save."""
    said = []
    for name, quantity in columns(trade):
        for target in TARGETS:
            one = trade.cheapest(target, quantity)
            if one is None:
                best = min(trade.measured, key=lambda m, q=quantity: trade.error(m, q))  # type: ignore[misc]
                said.append(
                    f"{percent(target)} on {name}: nothing measured here; the best is "
                    f"{percent(trade.error(best, quantity))} ({best.configuration.words})."
                )
                continue
            said.append(f"{percent(target)} on {name}: {milliseconds(one.time)} a cycle ({one.configuration.words}).")
    known = ", ".join(f"{name} {percent(trade.uncertainty[q])}" for name, q in columns(trade) if q is not None)
    said.append(f"The reference, two methods that agree, is known to: {known}. Nothing below is claimed.")
    return said + simplifications(trade)


def simplifications(trade: Trade) -> list[str]:
    """What each simpler model, or switch, costs in error and saves in time."""
    said = []
    known = {m.configuration: m for m in trade.measured}
    kinds = dict.fromkeys(
        (m.configuration.model, m.configuration.switch)
        for m in trade.measured
        if m.configuration.model != FULL or m.configuration.switch
    )
    for model, switch in kinds:
        own = [m for m in trade.measured if (m.configuration.model, m.configuration.switch) == (model, switch)]
        ratios = []
        for m in own:
            c = m.configuration
            plain = known.get(Configuration(model=FULL, method=c.method, rtol=c.rtol))
            if plain is not None and 0.0 < m.time < math.inf and plain.time < math.inf:
                ratios.append(m.time / plain.time)
        if not ratios:
            continue
        finest = min(own, key=lambda m: m.configuration.rtol)
        errors = ", ".join(f"{percent(e)} on {q}" for q, e in finest.promised.items())
        what = {
            FAST_MATH: "Arithmetic that the compiler may reorder",
            KINKS_LOCATED: "Ending steps on the kinks of the laws",
        }.get(switch, f"The model with {model}")
        ratio = sorted(ratios)[len(ratios) // 2]
        said.append(
            f"{what} takes {ratio:.2f} of the time of the full one at the same tolerance; at rtol "
            f"{finest.configuration.rtol:g} its error is {errors}."
        )
    still = [m for m in trade.measured if m.configuration.method == QUASI_STATIC]
    done = [m for m in still if m.time < math.inf and trade.error(m) < math.inf]
    if done:
        best = min(done, key=trade.error)
        errors = ", ".join(f"{percent(e)} on {q}" for q, e in best.promised.items())
        said.append(
            f"The quasi-static model takes {milliseconds(best.time)} a cycle at rtol {best.configuration.rtol:g}; its "
            f"error is {errors}, and a tighter tolerance changes little."
        )
    elif still:
        said.append(
            "The quasi-static model has no answer for some parameter sets: at some instant nothing holds a ring."
        )
    return said


def table(trade: Trade, quantity: str | None = None) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows of a front: error, time, configuration."""
    head: tuple[str, ...] = (f"error ({PROMISED:.0%} of runs)", "median error", "time a cycle", "configuration")
    rows: list[tuple[str, ...]] = []
    for one in trade.front(quantity):
        median = max(one.median.values()) if quantity is None else one.median[quantity]
        rows.append(
            (
                percent(trade.error(one, quantity)),
                percent(median),
                milliseconds(one.time),
                one.configuration.words,
            )
        )
    return head, rows


def percent(error: float) -> str:
    """A relative error as people read it: 1 %, 0.02 %, 3e-05 %."""
    if not math.isfinite(error):
        return "no result"
    value = 100.0 * error
    return f"{value:.2g} %" if value < 100.0 else f"{value:.0f} %"


def milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.1 else f"{1e3 * seconds:.0f} ms"


def columns(trade: Trade) -> list[tuple[str, str | None]]:
    both: list[tuple[str, str | None]] = [(name, name) for name in trade.quantities]
    return [*both, ("all of them", None)] if len(both) > 1 else both


def row(trade: Trade, one: Measured, quantity: str | None) -> dict[str, Any]:
    return {"error": trade.error(one, quantity), "time": one.time, **asdict(one.configuration)}
