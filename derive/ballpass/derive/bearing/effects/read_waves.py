"""Waves in a table of the scene: each order with amplitude and phase, or a spectrum that falls with the order.

In: a table whose keys are orders, or ``roughness``.  Out: orders, and amplitude and phase of each.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable

from ballpass.derive.bearing.effects.effect import Usual
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.schema import Table
from ballpass.derive.scene.units import show

#: Highest order.
MOST_WAVES = 200
#: Orders as their keys; an order has one key, 8 and not 08.
ORDERS = [str(order) for order in range(1, MOST_WAVES + 1)]
#: Amplitude over ball diameter.
AMPLITUDE = (None, 0.001)


def usual_amplitudes(amplitudes: Iterable[Quantity]) -> list[Usual]:
    """Usual ranges of amplitudes."""
    return [
        (amplitude, AMPLITUDE, "Waves are some tenths of a micrometre: check the unit.") for amplitude in amplitudes
    ]


def read_waves(table: Table, where: str, symbols: tuple[str, str], label: str = "") -> tuple[list[int], list[Quantity]]:
    """Orders, and amplitude and phase of each in turn.

    Parameters
    ----------
    where : for people, "around the outer raceway"
    symbols : LaTeX of amplitude and phase
    label : index of these before the order, with its comma
    """
    orders, numbers = [], []
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
            with table.table(key) as wave:
                orders.append(int(key))
                words, (amplitude, phase) = f"of {key} waves {where}", symbols
                numbers += [
                    wave.quantity(
                        "amplitude", "m", f"Amplitude {words}", f"{amplitude}_{{{label}{key}}}", example="1 um"
                    ),
                    wave.quantity(
                        "phase", "rad", f"Phase {words}", f"{phase}_{{{label}{key}}}", example="0 deg", default="0 deg"
                    ),
                ]
    return orders, numbers


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
        amplitude = rough.quantity("amplitude", "m", "Amplitude of the lowest order", "", example="0.1 um").value
        exponent = rough.number("exponent", example="1.0")
        lowest = rough.integer("lowest", 1, MOST_WAVES, example="2")
        highest = rough.integer("highest", 1, MOST_WAVES, example="40")
        seed = rough.integer("seed", 0, 2**63 - 1, example="1")
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
    draw = random.Random(f"{seed} {draws}" if draws else seed)
    made = {
        str(n): {
            "amplitude": f"{amplitude * (lowest / n) ** exponent!r} m",
            "phase": f"{draw.random() * 2.0 * math.pi!r} rad",
        }
        for n in range(lowest, highest + 1)
    }
    return {**rest, **made}
