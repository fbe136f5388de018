"""Waviness of the outer raceway: harmonics of its angle, which the balls roll over.

A ball at the angle psi finds the raceway raised by sum of B_n cos(n psi + alpha_n); as much is added to its deflection.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ballpass.derive.bearing.effects.effect import Effect
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.records import BallEffect
from ballpass.derive.scene.schema import Table
from ballpass.derive.scene.units import show
from ballpass.derive.terms import symbol_of

if TYPE_CHECKING:
    import sympy as sp

#: Highest order: more waves than this are roughness.
MOST_WAVES = 200
#: Orders as their keys; an order has one key, 8 and not 08.
ORDERS = [str(order) for order in range(1, MOST_WAVES + 1)]


class OuterWaviness(Effect):
    """Waves around the outer raceway."""

    name = "outer_waviness"

    def read(self, table: Table) -> BallEffect:
        orders, numbers = [], []
        with table:
            for key in list(table.data):
                table.know(key)
                if key not in ORDERS:
                    table.fault(
                        key,
                        "this is no order of waviness",
                        given=show(key),
                        allowed=f"whole numbers of waves around the raceway, from 1 to {MOST_WAVES}, without leading 0",
                        remedy='write for example 8 = { amplitude = "1 um" }',
                    )
                    continue
                with table.table(key) as wave:
                    orders.append(int(key))
                    numbers += [
                        wave.quantity(
                            "amplitude",
                            "m",
                            f"Amplitude of {key} waves around the outer raceway",
                            f"B_{{{key}}}",
                            example="1 um",
                        ),
                        wave.quantity(
                            "phase",
                            "rad",
                            f"Phase of {key} waves around the outer raceway",
                            rf"\alpha_{{{key}}}",
                            example="0 deg",
                            default="0 deg",
                        ),
                    ]
        return BallEffect(kind=self.name, structure=tuple(orders), numbers=tuple(numbers))

    def check(self, effect: BallEffect, checker: Checker) -> None:
        for amplitude in effect.numbers[::2]:
            checker.not_negative(amplitude, "give the amount, and turn the phase by 180 deg")

    def term(self, effect: BallEffect, angle: sp.Expr) -> sp.Expr:
        import sympy as sp

        waves = zip(effect.structure, effect.numbers[::2], effect.numbers[1::2], strict=True)
        return -sum(
            (symbol_of(amplitude) * sp.cos(n * angle + symbol_of(phase)) for n, amplitude, phase in waves),
            start=sp.S.Zero,
        )

    def describe(self, effect: BallEffect) -> str:
        return f"waves around the outer raceway, orders {', '.join(str(n) for n in effect.structure)}"
