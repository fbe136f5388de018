"""Waviness of the balls: harmonics of a ball's own angle, which it meets both raceways with.

A ball whose material at the angle psi meets the outer raceway, and at psi + pi the inner one, is thicker there by
C_n cos(n psi + gamma_n) and C_n cos(n (psi + pi) + gamma_n).  Both are added to its deflection: of even orders twice
the amplitude, and nothing of odd ones, which only move the ball.
"""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing.effects.effect import Effect, GenericBall
from ballpass.derive.bearing.effects.read_waves import ORDERS, Wave, read_waves, wave_tables, with_roughness
from ballpass.derive.scene.bearing_records import BallEffect, Bearing
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Names, symbol_of

#: Table of waves that all balls have alike.
EACH = "each"


class BallWaviness(Effect):
    """Waves around the balls."""

    name = "ball_waviness"
    words = "waviness of the balls"
    tables = wave_tables("around each ball", EACH) | wave_tables("around the ball", "#")

    def read(self, table: Table, balls: int) -> BallEffect:
        waves: list[Wave] = []
        with table:
            table.data = _for_every_ball(table, balls)
            names = (EACH, *ORDERS[:balls])
            table.know(*names)
            for whose in (name for name in names if name in table.data):
                where = "around each ball" if whose == EACH else f"around ball {whose}"
                label = "" if whose == EACH else f"{whose},"
                waves += read_waves(table.table(whose), where, ("C", r"\gamma"), label, whose)
        return BallEffect(kind=self.name, parts=tuple(waves))

    def spins(self, effect: BallEffect) -> bool:
        return True

    def term(self, effect: BallEffect, bearing: Bearing, names: Names, ball: GenericBall) -> sp.Expr:
        assert ball.spin is not None  # `spins`
        thicker: dict[str, sp.Expr] = {}
        for wave in effect.parts:
            n, phase = wave.order, symbol_of(wave.phase)
            both = sum(
                symbol_of(wave.amplitude) * sp.cos(n * ball.spin + n * side + phase) for side in (sp.S.Zero, sp.pi)
            )
            thicker[wave.whose] = thicker.get(wave.whose, sp.S.Zero) + both
        return -sum(
            (value if whose == EACH else ball.only(int(whose), value) for whose, value in thicker.items()),
            start=sp.S.Zero,
        )

    def describe(self, effect: BallEffect) -> str:
        orders: dict[str, list[str]] = {}
        for wave in effect.parts:
            orders.setdefault(wave.whose, []).append(str(wave.order))
        parts = (
            f"{'each ball' if whose == EACH else f'ball {whose}'}: orders {', '.join(of)}"
            for whose, of in orders.items()
        )
        return "waves around the balls, of which only even orders act; " + "; ".join(parts)


def _for_every_ball(table: Table, balls: int) -> dict[str, object]:
    """What the table holds; the roughness of each ball has phases of its own."""
    each = table.data.get(EACH)
    if not isinstance(each, dict) or "roughness" not in each:
        return table.data
    found = dict(table.data)
    for whose in ORDERS[:balls]:
        own = found.get(whose, {})
        if isinstance(own, dict):
            rough = Table(table.collector, (*table.path, EACH), {"roughness": each["roughness"]})
            found[whose] = {**with_roughness(rough, whose), **own}
    rest = {key: value for key, value in each.items() if key != "roughness"}
    return {**found, EACH: rest}
