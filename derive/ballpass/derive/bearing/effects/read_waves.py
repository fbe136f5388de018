"""Waves in a table of the scene: each order with amplitude and phase, or a spectrum that falls with the order.

In: a table whose keys are orders, or ``roughness``.  Out: a `Wave` for each order.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from ballpass.derive.scene.keys import Key, WholeKey
from ballpass.derive.scene.quantity import SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import keys_of, not_negative, quantity, read_record
from ballpass.derive.scene.table import Table
from ballpass.derive.scene.units import show

#: Highest order.
MOST_WAVES = 200
#: Orders as their keys; an order has one key, 8 and not 08.
ORDERS = [str(order) for order in range(1, MOST_WAVES + 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """Waves of one order; `whose` ball they are around where not all have them."""

    order: int
    whose: str

    amplitude: SceneNumber = not_negative(
        "m",
        "Amplitude of ORDER waves WHERE",
        "AMPLITUDE_{MARK}",
        "1 um",
        remedy="give the amount, and turn the phase by 180 deg",
        usual=UsualRange(most=0.001, of="ball_diameter", hint="Waves are some tenths of a micrometre: check the unit."),
    )
    phase: SceneNumber = quantity("rad", "Phase of ORDER waves WHERE", "PHASE_{MARK}", "0 deg", default="0 deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class Roughness:
    """Waves of a range of orders, with random phases."""

    amplitude: float = quantity("m", "Amplitude of the lowest order", example="0.1 um", setting=True)
    exponent: float = quantity("1", "$p$ of $B_n = B_{n_0} (n_0/n)^p$", example=1.0, setting=True)
    lowest: int = WholeKey(words="Lowest order", lowest=1, highest=MOST_WAVES, example=2).declared()
    highest: int = WholeKey(words="Highest order", lowest=1, highest=MOST_WAVES, example=40).declared()
    seed: int = WholeKey(words="Seed of the random phases", lowest=0, highest=2**63 - 1, example=1).declared()


def wave_tables(where: str, *around: str) -> dict[tuple[str, ...], dict[str, Key]]:
    """Keys of waves `around` which they are, in the tables of a scene file."""
    fill = {"ORDER": "<order>", "WHERE": where, "AMPLITUDE": "", "PHASE": "", "MARK": ""}
    return {(*around, "#"): keys_of(Wave, fill), (*around, "roughness"): keys_of(Roughness)}


def read_waves(table: Table, where: str, symbols: tuple[str, str], label: str = "", whose: str = "") -> list[Wave]:
    """Waves of all orders.

    Parameters
    ----------
    where : for people, "around the outer raceway"
    symbols : LaTeX of amplitude and phase
    label : index of these before the order, with its comma
    whose : see `Wave`
    """
    waves = []
    with table:
        table.data = with_roughness(table)
        for key in list(table.data):
            table.know(key)
            if key not in ORDERS:
                table.fault(
                    key,
                    "this is no order of waviness",
                    given=show(key),
                    allowed=f"whole numbers of waves {where}, from 1 to {MOST_WAVES}, without leading 0",
                    remedy='write for example 8 = { amplitude = "1 um" }',
                )
                continue
            fill = {"ORDER": key, "WHERE": where, "AMPLITUDE": symbols[0], "PHASE": symbols[1], "MARK": f"{label}{key}"}
            with table.table(key) as data:
                waves.append(read_record(Wave, data, fill, order=int(key), whose=whose))
    return waves


def with_roughness(table: Table, draws: str = "") -> dict[str, object]:
    """What the table holds, the key ``roughness`` replaced by the waves it stands for.

    The amplitude of order n is that of the lowest times (lowest/n)^exponent; phases are drawn evenly.

    Parameters
    ----------
    draws : other texts draw other phases of the same seed
    """
    if not table.has("roughness"):
        return table.data
    rest = {key: value for key, value in table.data.items() if key != "roughness"}
    noted = len(table.collector.faults)
    with table.table("roughness") as rough:
        waves = read_record(Roughness, rough)
        lowest, highest = waves.lowest, waves.highest
        if highest < lowest:
            rough.fault(
                "highest",
                "the highest order lies below the lowest",
                given=f"{highest} below {lowest}",
                allowed=f"a whole number from {lowest} to {MOST_WAVES}",
                remedy="exchange the two",
            )
    for key in ORDERS[lowest - 1 : highest]:
        if key in rest:
            table.fault(
                key,
                "the order is given twice, by itself and within the roughness",
                given=f"{key} and roughness from {lowest} to {highest}",
                allowed="orders outside the roughness",
                remedy="delete the key, or narrow the roughness",
            )
    if len(table.collector.faults) > noted:
        return rest
    draw = random.Random(f"{waves.seed} {draws}" if draws else waves.seed)
    made = {
        str(n): {
            "amplitude": f"{waves.amplitude * (lowest / n) ** waves.exponent!r} m",
            "phase": f"{draw.random() * 2.0 * math.pi!r} rad",
        }
        for n in range(lowest, highest + 1)
    }
    return {**rest, **made}
