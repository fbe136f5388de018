"""The tables [load] and [loads.<name>] of a scene file to their records.

In: a table.  Out: a `Load`, or None, with a fault, where its type is unknown.
"""

from __future__ import annotations

from typing import Any

from ballpass.derive.scene.keys import ChoiceKey, PairKey, QuantityKey
from ballpass.derive.scene.read_keys import keys_of, read_record
from ballpass.derive.scene.shaft_records import ConstantLoad, HarmonicLoad, Load, LoadWindow, TableLoad, UnbalanceLoad
from ballpass.derive.scene.table import Table

#: Laws of a load by its type.
LOADS = {"constant": ConstantLoad, "harmonic": HarmonicLoad, "table": TableLoad, "unbalance": UnbalanceLoad}
TYPE = ChoiceKey(words="How the load changes", choices=tuple(LOADS))
POSITION = keys_of(Load)["position"]
#: Values of the placeholders in the keys of its windows.
WINDOWS = {
    "window": {"UNIT": "rad", "WHAT": "Angle of the shaft", "SYMBOL": r"\theta", "FIRST": "30 deg", "LAST": "60 deg"},
    "time_window": {"UNIT": "s", "WHAT": "Time", "SYMBOL": "t", "FIRST": "0.1 s", "LAST": "0.2 s"},
}


def read_load(table: Table, name: str = "") -> Load | None:
    """A load on the inner rings; `name` of ``[loads.<name>]``."""
    with table:
        table.know("type", "position", *WINDOWS)
        kind = TYPE.read(table, "type")
        if kind is None or kind != table.data["type"]:
            table.know(*table.data)
            return None
        phase = table.data.get("phase")
        known: dict[str, Any] = {}
        if kind == "harmonic" and isinstance(phase, list) and len(phase) == 2:
            known["phase"] = components_of_phase().read(table, "phase")
        return Load(
            name=name,
            law=read_record(LOADS[kind], table, **known),
            position=POSITION.read(table, "position"),
            angle_window=_read_window(table, "window"),
            time_window=_read_window(table, "time_window"),
        )


def components_of_phase() -> PairKey:
    """A phase for x and one for y."""
    key = keys_of(HarmonicLoad)["phase"]
    assert isinstance(key, QuantityKey)
    words = f"AXIS component: {key.words[0].lower()}{key.words[1:]}"
    return PairKey(unit=key.unit, words=words, symbol=rf"{key.symbol}_AXIS", example=key.example)


def _read_window(table: Table, key: str) -> LoadWindow | None:
    """From start to end; without an end, which times may lack, for ever."""
    if not table.has(key):
        return None
    with table.table(key, "start and end") as window:
        known: dict[str, Any] = {"end": None} if key == "time_window" and not window.has("end") else {}
        return read_record(LoadWindow, window, WINDOWS[key], **known)
