"""What a scene says of a bearing's cage: ratio, and slip as a number, over time or at random."""

from __future__ import annotations

import random

from ballpass.derive.scene.bearing_records import CageMotion
from ballpass.derive.scene.schema import Table
from ballpass.derive.scene.units import show

#: Most rows of a random slip: each is a number of the model.
MOST_ROWS = 500


def read_cage(table: Table, uneven: str) -> CageMotion | None:
    """The table ``cage`` of a bearing; None where there is none.

    Parameters
    ----------
    uneven : what makes the rings turn unevenly, so that there is no slip; empty where nothing does
    """
    if not table.has("cage"):
        return None
    with table.table("cage", "ratio or slip") as cage:
        ratio = cage.optional_quantity("ratio", "1", "Speed of the cage over that of the inner ring", r"\kappa_c")
        words = "Part by which the cage turns slower than by rolling"
        for key in ("slip", "jitter"):
            if cage.has(key) and uneven:
                cage.fault(
                    key,
                    "slip of the cage is modelled for rings that turn at constant speed",
                    given=f"{key}, and {uneven}",
                    allowed=f'{key} with coupling = "one-way" and a driver of constant speed',
                    remedy=f"delete {key}; ratio may stay",
                )
        if cage.has("jitter"):
            cage.data = {**cage.data, "slip": _jitter(cage)}
        if not isinstance(cage.data.get("slip"), dict):
            return CageMotion(ratio=ratio, slip=cage.optional_quantity("slip", "1", words, "s_c"))
        with cage.table("slip") as rows:
            return CageMotion(
                ratio=ratio,
                time=rows.column("time", "s", "Time from which the cage's slip of row ROW holds", "t_{c,ROW}"),
                slips=rows.column("value", "1", f"{words}, row ROW", "s_{c,ROW}"),
            )


def _jitter(cage: Table) -> object:
    """Rows of a slip that is drawn anew after each interval, normally about its mean, which holds afterwards."""
    mean = 0.0
    given = cage.data.get("slip", 0.0)
    if isinstance(given, int | float) and not isinstance(given, bool):
        mean = float(given)
    else:
        cage.fault(
            "slip",
            "beside jitter the slip is its mean",
            given=show(given),
            allowed="a number",
            remedy="write one number, or delete jitter",
        )
    noted = len(cage.collector.faults)
    with cage.table("jitter") as jitter:
        deviation = jitter.number("deviation", example="0.01")
        interval = jitter.quantity("interval", "s", "Interval of the jitter", "", example="5 ms").value
        duration = jitter.quantity("duration", "s", "Duration of the jitter", "", example="1 s").value
        seed = jitter.integer("seed", 0, 2**63 - 1, example="1")
        if len(cage.collector.faults) > noted:
            return mean
        if not (deviation >= 0.0 and interval > 0.0 and 1.0 <= duration / interval <= MOST_ROWS):
            jitter.fault(
                "",
                "the jitter has no rows, or too many",
                given=f"deviation {deviation:g}, an interval of {interval:g} s in {duration:g} s",
                allowed=f"a deviation from 0, and 1 to {MOST_ROWS} intervals above zero",
                remedy="give a longer interval, or a shorter duration",
            )
            return mean
    draw, count = random.Random(seed), round(duration / interval)
    times = [f"{k * interval!r} s" for k in range(count + 1)]
    return {"time": times, "value": [*(mean + deviation * draw.gauss() for _ in range(count)), mean]}
