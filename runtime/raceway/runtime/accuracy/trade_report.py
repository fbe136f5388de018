"""A trade for people and for files: the front in words, what each simplification costs and saves, JSON and back.

In: a `Trade`.  Out: text, a table, plain data.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from raceway.runtime.accuracy.quasi_static import NAME as QUASI_STATIC
from raceway.runtime.accuracy.trade import (
    FAST_MATH,
    FULL,
    KINKS_LOCATED,
    PROMISED,
    TARGETS,
    Configuration,
    Measured,
    Trade,
)

#: Layout of trade.json.
SCHEMA = 3


def versions() -> dict[str, str]:
    """What a measurement depends on besides the scene."""
    return {name: version(name) for name in ("raceway", "casadi")}


def to_plain(trade: Trade, key: Mapping[str, Any], folder: Path | None = None) -> dict[str, Any]:
    """Plain data for JSON; what is infinite (nothing finished) becomes None.

    Parameters
    ----------
    key : says what it was measured of
    folder : where it is stored; the models kept with it lie below
    """
    data = _without_infinities(asdict(replace(trade, folders={})))
    data["folders"] = {} if folder is None else {n: p.relative_to(folder).as_posix() for n, p in trade.folders.items()}
    return {
        "schema": SCHEMA,
        "key": dict(key),
        "digest": digest_of(key, data),
        "trade": data,
        "front": {
            name: [_row(trade, one, quantity) for one in trade.front(quantity)] for name, quantity in _columns(trade)
        },
        "words": words(trade),
    }


def digest_of(key: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    """What tells a measurement that was damaged or edited."""
    text = json.dumps([SCHEMA, key, data], sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def from_plain(data: Mapping[str, Any], folder: Path | None = None) -> Trade:
    """The trade of plain data; without the models kept with it where the folder it was stored in is not known."""
    fields = dict(data["trade"])
    kept = fields.pop("folders")
    fields["folders"] = {} if folder is None else {name: folder / place for name, place in kept.items()}
    measured = []
    for entry in fields.pop("measured"):
        errors = {
            name: {q: math.inf if e is None else float(e) for q, e in entry[name].items()}
            for name in ("median", "promised")
        }
        measured.append(
            Measured(
                configuration=Configuration(**entry["configuration"]),
                time=math.inf if entry["time"] is None else float(entry["time"]),
                median=errors["median"],
                promised=errors["promised"],
                failures=int(entry["failures"]),
            )
        )
    fields["quantities"] = tuple(fields["quantities"])
    return Trade(measured=tuple(measured), **fields)


def words(trade: Trade) -> list[str]:
    """The front in words: what each target costs for each quantity, and what simplifications cost and save."""
    said = []
    for name, quantity in _columns(trade):
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
    known = ", ".join(f"{name} {percent(trade.uncertainty[q])}" for name, q in _columns(trade) if q is not None)
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


def _columns(trade: Trade) -> list[tuple[str, str | None]]:
    both: list[tuple[str, str | None]] = [(name, name) for name in trade.quantities]
    return [*both, ("all of them", None)] if len(both) > 1 else both


def _row(trade: Trade, one: Measured, quantity: str | None) -> dict[str, Any]:
    return {"error": trade.error(one, quantity), "time": one.time, **asdict(one.configuration)}


def _without_infinities(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_infinities(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_without_infinities(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
