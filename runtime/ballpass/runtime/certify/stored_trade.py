"""A trade on disk: ``trade.json`` beside the results, written, read back, and refused where it is damaged.

In: a `Trade`, or the folder it was stored in.  Out: plain data, or the `Trade`.
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

from ballpass.runtime.certify.trade import Configuration, Measured, Trade
from ballpass.runtime.certify.trade_report import columns, row, words
from ballpass.runtime.contract.errors import RequestError

#: Name of the file with the measurement, in the folder of the results.
FILE_NAME = "trade.json"

#: Layout of trade.json.
SCHEMA = 4


def versions() -> dict[str, str]:
    """What a measurement depends on besides the scene."""
    return {name: version(name) for name in ("ballpass", "casadi")}


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
            name: [row(trade, one, quantity) for one in trade.front(quantity)] for name, quantity in columns(trade)
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


def load_trade(folder: str | Path) -> Trade:
    """Read the measurement that ``ballpass trade`` wrote into a folder, for ``model.simulate(error=, of=, trade=)``.

    Parameters
    ----------
    folder : of the results, ``results/<scene>`` where no other was asked for; the models kept with the measurement are
        loaded from there when one is taken

    Raises
    ------
    RequestError
        There is none, it was written by another version, damaged, or edited by hand.
    """
    place = Path(folder)
    try:
        data = read_stored(place / FILE_NAME)
    except OSError as fault:
        raise RequestError(
            f"{place / FILE_NAME}: cannot be read ({fault.strerror}). A folder in which `ballpass trade SCENE` stored "
            "its measurement is expected."
        ) from None
    if data is None:
        raise RequestError(
            f"{place / FILE_NAME}: was written by another version, which measured otherwise. Measure again: ballpass "
            "trade SCENE --fresh."
        )
    return from_plain(data, place)


def read_stored(path: Path) -> Mapping[str, Any] | None:
    """Plain data of a stored measurement; None where another version wrote it.

    Raises
    ------
    OSError
        There is no such file, or it cannot be read.
    RequestError
        It is damaged or was edited by hand.
    """
    try:
        data = json.loads(path.read_bytes())
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError):
        data = None
    if isinstance(data, dict) and isinstance(data.get("schema"), int) and data["schema"] != SCHEMA:
        return None
    key, measured = (data.get("key"), data.get("trade")) if isinstance(data, dict) else (None, None)
    if isinstance(key, dict) and isinstance(measured, dict) and data.get("digest") == digest_of(key, measured):
        return dict(data)
    raise RequestError(
        f"{path} is damaged or was edited by hand, and is not used. Measure again: ballpass trade SCENE --fresh."
    )


def _without_infinities(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_infinities(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_without_infinities(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
