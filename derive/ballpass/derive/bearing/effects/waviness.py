"""Waviness of a raceway: harmonics of its angle, which the balls roll over.

A ball at the angle psi, as the ring sees it, finds the raceway raised by sum of B_n cos(n psi + alpha_n); as much is
added to its deflection.
"""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing.effects.effect import Effect, GenericBall
from ballpass.derive.bearing.effects.read_waves import read_waves, wave_tables
from ballpass.derive.scene.bearing_records import BallEffect, Bearing
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Names, symbol_of


class _RacewayWaviness(Effect):
    ring = ""
    label = ""

    def read(self, table: Table, balls: int) -> BallEffect:
        waves = read_waves(table, f"around the {self.ring} raceway", ("B", r"\alpha"), self.label)
        return BallEffect(kind=self.name, parts=tuple(waves))

    def term(self, effect: BallEffect, bearing: Bearing, names: Names, ball: GenericBall) -> sp.Expr:
        angle = ball.on_outer if self.ring == "outer" else ball.on_inner
        return -sum(
            (symbol_of(w.amplitude) * sp.cos(w.order * angle + symbol_of(w.phase)) for w in effect.parts),
            start=sp.S.Zero,
        )

    def describe(self, effect: BallEffect) -> str:
        return f"waves around the {self.ring} raceway, orders {', '.join(str(wave.order) for wave in effect.parts)}"


class OuterWaviness(_RacewayWaviness):
    """Waves around the outer raceway."""

    name = "outer_waviness"
    words = "waviness of the outer raceway"
    ring = "outer"
    tables = wave_tables("around the outer raceway")


class InnerWaviness(_RacewayWaviness):
    """Waves around the inner raceway, which turn with it."""

    name = "inner_waviness"
    words = "waviness of the inner raceway"
    ring = "inner"
    tables = wave_tables("around the inner raceway")
    label = "i,"
