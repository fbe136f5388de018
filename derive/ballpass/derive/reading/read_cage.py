"""Keys of a bearing's cage: ratio, and slip as a number, over time or at random."""

from __future__ import annotations

import random
from dataclasses import dataclass

from ballpass.derive.scene.bearing_records import CageMotion
from ballpass.derive.scene.keys import ColumnKey, WholeKey
from ballpass.derive.scene.quantity import Bounds, UsualRange
from ballpass.derive.scene.read_keys import keys_of, number, quantity, read_keys, read_record
from ballpass.derive.scene.table import Table
from ballpass.derive.scene.units import show

#: Most rows of a random slip: each is a number of the model.
MOST_ROWS = 500
#: Keys of a slip over time.
SLIPS = {
    "time": ColumnKey(
        unit="s", words="Time from which the cage's slip of row ROW holds", symbol="t_{c,ROW}", note="the first is zero"
    ),
    "value": ColumnKey(
        unit="1",
        words="Part by which the cage turns slower than by rolling, row ROW",
        symbol="s_{c,ROW}",
        bounds=Bounds(above=-1.0, below=1.0),
        usual=UsualRange(
            least=-0.3, most=0.3, hint="A cage lags by some hundredths: check whether a percentage was given."
        ),
    ),
    "lag": number(
        "rad",
        "Angle by which the cage lags at the start",
        r"\lambda_0",
        default="0 deg",
        note="behind one that has the slip of the last row",
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Jitter:
    """Random slip, drawn anew after each interval."""

    deviation: float = quantity("1", "Standard deviation of the slip", example=0.01, setting=True)
    interval: float = quantity("s", "Interval of the jitter", example="5 ms", setting=True)
    duration: float = quantity("s", "Duration of the jitter", example="1 s", setting=True, note="at most 500 intervals")
    seed: int = WholeKey(words="Seed", lowest=0, highest=2**63 - 1, example=1).declared()


def read_cage(table: Table) -> CageMotion | None:
    """The table ``cage`` of a bearing; None where there is none."""
    if not table.has("cage"):
        return None
    with table.table("cage", "ratio or slip") as cage:
        cage.know(*keys_of(CageMotion), "jitter")
        if cage.has("jitter"):
            cage.data = {**cage.data, "slip": _jitter(cage)}
        if not isinstance(cage.data.get("slip"), dict):
            return read_record(CageMotion, cage, time=(), slips=())
        with cage.table("slip") as rows:
            time, slips, lag = read_keys(rows, SLIPS).values()
        return read_record(CageMotion, cage, slip=None, time=time, slips=slips, lag=lag)


def _jitter(cage: Table) -> object:
    """Rows of a slip that is drawn anew after each interval, normally distributed about its mean; then the mean."""
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
        known = read_record(Jitter, jitter)
        deviation, interval, duration = known.deviation, known.interval, known.duration
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
    draw, count = random.Random(known.seed), round(duration / interval)
    times = [f"{k * interval!r} s" for k in range(count + 1)]
    return {"time": times, "value": [*(mean + deviation * draw.gauss() for _ in range(count)), mean]}
