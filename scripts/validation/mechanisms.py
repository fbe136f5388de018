"""Reactions and torque of mechanisms of textbooks, at one position each, against a second program.

The numbers of that program are in ``mechanisms.csv``: `tests/machines/reference.py` solves the equations of motion in
maximal coordinates, three for each body, with joints as constraints.  It reads scene files alone.
"""

from __future__ import annotations

import csv
import tempfile
from pathlib import Path

from ballpass.derive import generate, read_scene
from ballpass.runtime import load

FOLDER = Path(__file__).with_name("mechanisms")

#: Times [s] of positions other than the first.
TIMES = {"wiper": 0.2}

#: Dyads of each mechanism, and where its position is.
WHAT = {
    "equal_links": ("RRP", "crank at 45 deg"),
    "quick_return": ("RPR, RRP", "crank at 0.6 rad"),
    "jansen_leg": ("RRR, RRR, RRR", "crank at 0.7 rad"),
    "double_rocker": ("RRR", "driver at -36 deg"),
    "toggle_clamp": ("RRR", "handle at 12 deg"),
    "wiper": ("RRR", "swing, 0.2 s"),
    "pump_jack": ("RRR", "crank at 2.1 rad"),
    "v_compressor": ("RRP, RRP", "crank at 1 rad"),
    "watt_six_bar": ("RRR, RRR", "crank at 0.9 rad"),
    "stephenson_six_bar": ("RRR, RRR", "crank at 0.9 rad"),
    "scotch_yoke": ("RPP", "crank at 45 deg"),
    "elliptic_trammel": ("RRP", "crank at 0.7 rad"),
    "geared_five_bar": ("gear, RRR", "pinion at 0.9 rad"),
}


def numbers_of(name: str) -> dict[str, float]:
    """Reactions and torque of a mechanism by the second program [N], [N*m]."""
    with FOLDER.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return {row["quantity"]: float(row["value"]) for row in csv.DictReader(file) if row["mechanism"] == name}


def ours(name: str) -> dict[str, float]:
    """The same by ballpass."""
    with tempfile.TemporaryDirectory() as place:
        model = load(generate(read_scene(FOLDER / f"{name}.toml"), Path(place) / name))
        found = model.evaluate(TIMES.get(name, 0.0))
    return {key: float(value) for key, value in found.items()}


def printed() -> list[str]:
    """Lines of the page."""
    lines = [f"{'mechanism':18} {'dyads':13} {'position':17} {'torque [N*m]':>20} {'theirs':>20} {'numbers':>7}"]
    for name, (dyads, position) in WHAT.items():
        found, expected = ours(name), numbers_of(name)
        largest = max(map(abs, expected.values()))
        apart = max(abs(found[key] - value) / max(abs(value), 1e-3 * largest) for key, value in expected.items())
        assert apart < 1e-12, name
        torque, other = found["drive_torque"], expected["drive_torque"]
        lines.append(f"{name:18} {dyads:13} {position:17} {torque:20.10f} {other:20.10f} {len(expected):7}")
    return [*lines, "largest difference of any reaction, moment or torque: below 1e-12 of it"]


if __name__ == "__main__":
    print(*printed(), sep="\n")
