"""Lag of the cage with the load, from MFPT's recordings: ``python -m scripts.validation.cage_lag [FOLDER]``.

FOLDER holds the recordings; without it the numbers read off them are taken from ``mfpt_lines.csv``, which ``--write``
writes anew.  The lag is the slip of the cage, `bearing.cage.slip`, that puts the model's line where the recording has
it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

from scripts.validation.kinematics import kinematic_frequencies
from scripts.validation.lines import SpallLines, asked, commit, committed, read_mfpt

TABLE = "mfpt_lines.csv"
SOURCE = """Lines read off recordings of the Society for Machinery Failure Prevention Technology (MFPT), by
python -m scripts.validation.cage_lag FOLDER --write; columns: scripts/validation/lines.py.  Load in lb."""
BALLS, BALL, PITCH = 8, 0.235 * 0.0254, 1.245 * 0.0254
#: A line of the shaft counts where it stands so far above the floor [1].
SEEN = 15.0


def measured(folder: Path | None) -> list[SpallLines]:
    """Lines of the recordings, or those read off them."""
    found = kinematic_frequencies(BALLS, BALL, PITCH, 2.0 * math.pi)
    orders = {"outer": found.ball_pass_outer, "inner": found.ball_pass_inner}
    return committed(TABLE) if folder is None else read_mfpt(folder, orders)


def slip(spall: str, order: float) -> float:
    """Part by which the cage turns slower than by rolling: of BPFO = Z f_c (1 - s), BPFI = Z (f - f_c (1 - s)) [1]."""
    rolling = kinematic_frequencies(BALLS, BALL, PITCH, 2.0 * math.pi).ball_pass_outer
    return 1.0 - (order if spall == "outer" else BALLS - order) / rolling


def printed(rows: Sequence[SpallLines]) -> list[str]:
    """The table as text."""
    out = ["spall  load   line     shaft    slip at 25 Hz  slip by the shaft's line"]
    for one in rows:
        seen = one.shaft_height > SEEN
        shaft, own = (f"{one.shaft:.4f}", f"{100 * slip(one.spall, one.order):.2f} %") if seen else ("  -   ", "-")
        nominal = 100 * slip(one.spall, one.line)
        out.append(f"{one.spall}  {one.load:3.0f} lb {one.line:.4f}   {shaft}   {nominal:5.2f} % {own:>15}")
    return out


def main(arguments: Sequence[str]) -> None:
    folder, write = asked(arguments)
    if write:
        commit(TABLE, SOURCE, measured(folder))
    print("\n".join(printed(measured(folder))))


if __name__ == "__main__":
    main(sys.argv[1:])
