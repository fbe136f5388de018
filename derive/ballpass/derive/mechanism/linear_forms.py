"""Velocities as linear forms in the generalized velocities, and the equations of motion they give (Kane's form).

In: the definitions of a derivation with free coordinates, its inertias, and its loads.  Out: M, h and Q of
M(q) q'' + h(q, q') = Q, entry by entry, and the definitions they use.

Every velocity of a linkage is linear in the generalized velocities, every acceleration in the generalized
accelerations: J q'' + a0.  The columns of J are the derivatives of the velocities' definitions, one after the other;
a0 is the acceleration with q'' = 0.  Nothing is differentiated by a coordinate.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.mechanism.kinematics import Ledger, Motion
from ballpass.derive.terms import Definition
from ballpass.derive.variables import Coordinate


@dataclass(frozen=True, slots=True, kw_only=True)
class Inertia:
    """A mass [kg] and one component of its velocity and acceleration, or a moment of inertia and its rates."""

    amount: sp.Expr
    rate: sp.Expr
    acceleration: sp.Expr


def inertias_of(mass: sp.Expr, moving: Motion) -> list[Inertia]:
    """A mass that moves in the plane, or an inertia whose rates are pairs."""
    rates = zip(moving.velocity, moving.acceleration, strict=True)
    return [Inertia(amount=mass, rate=rate, acceleration=acceleration) for rate, acceleration in rates]


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """A force [N] or torque [N*m], and the rate [m/s] or [rad/s] along which it does work.

    `place` is what changes at this rate, of weights [m].
    """

    amount: sp.Expr
    rate: sp.Expr
    place: sp.Expr = sp.S.Zero


@dataclass(frozen=True, slots=True, kw_only=True)
class EquationsOfMotion:
    """Equations of motion ``mass * accelerations = forcing``, both of symbols that `definitions` explain."""

    mass: sp.ImmutableMatrix
    forcing: sp.ImmutableMatrix
    definitions: tuple[Definition, ...]


class LinearForms:
    """Columns and biases of definitions, each named once, when first asked for.

    Parameters
    ----------
    definitions : ordered, over the positions, velocities and accelerations of `coordinates`
    coordinates : the generalized coordinates
    """

    def __init__(self, definitions: Iterable[Definition], coordinates: Sequence[Coordinate]) -> None:
        self._known = {d.symbol: d for d in definitions}
        self._coordinates = tuple(coordinates)
        self._velocities = {c.velocity: k for k, c in enumerate(coordinates)}
        self._at_rest = {c.acceleration: sp.S.Zero for c in coordinates}
        self._columns: dict[sp.Symbol, tuple[sp.Expr, ...]] = {}
        self._biases: dict[sp.Symbol, sp.Expr] = {}
        self._ledger = Ledger()

    def columns(self, rate: sp.Expr) -> tuple[sp.Expr, ...]:
        """Derivatives of a velocity by the generalized velocities."""
        found = [sp.S.Zero] * len(self._coordinates)
        rate = sp.sympify(rate)
        for symbol in sorted(rate.free_symbols, key=str):
            moves = self._columns_of(symbol)
            if any(moves):
                slope = sp.diff(rate, symbol)
                found = [entry + slope * along for entry, along in zip(found, moves, strict=True)]
        return tuple(found)

    def _columns_of(self, symbol: sp.Symbol) -> tuple[sp.Expr, ...]:
        if symbol in self._velocities:
            return tuple(sp.Integer(k == self._velocities[symbol]) for k in range(len(self._coordinates)))
        definition = self._known.get(symbol)
        if definition is None:
            return (sp.S.Zero,) * len(self._coordinates)
        if symbol not in self._columns:
            self._columns[symbol] = tuple(
                self._ledger.name(
                    f"{symbol.name}.by.{c.name}",
                    entry,
                    "1" if definition.unit == f"{c.unit}/s" else f"({definition.unit})/({c.unit}/s)",
                    f"{definition.description}: slope by {c.velocity.name}",
                    rf"{{{definition.latex}}}_{{,{c.latex}}}",
                )
                for c, entry in zip(self._coordinates, self.columns(definition.expression), strict=True)
            )
        return self._columns[symbol]

    def bias(self, acceleration: sp.Expr) -> sp.Expr:
        """An acceleration with all generalized accelerations zero."""
        acceleration = sp.sympify(acceleration)
        return acceleration.xreplace({s: self._bias_of(s) for s in sorted(acceleration.free_symbols, key=str)})

    def _bias_of(self, symbol: sp.Symbol) -> sp.Expr:
        if symbol in self._at_rest:
            return sp.S.Zero
        definition = self._known.get(symbol)
        if definition is None:
            return symbol
        if symbol not in self._biases:
            bare = self.bias(definition.expression)
            self._biases[symbol] = (
                symbol
                if bare == definition.expression
                else self._ledger.name(
                    f"{symbol.name}.bias",
                    bare,
                    definition.unit,
                    f"{definition.description}, with all generalized accelerations zero",
                    rf"{{{definition.latex}}}_{{(0)}}",
                )
            )
        return self._biases[symbol]

    def motion(self, inertias: Sequence[Inertia], efforts: Sequence[Effort]) -> EquationsOfMotion:
        """M and Q - h of inertias and efforts: the sums of J^T m J and of J^T (F - m a0)."""
        size = len(self._coordinates)
        mass = [[sp.S.Zero] * size for _ in range(size)]
        forcing = [sp.S.Zero] * size
        for inertia in inertias:
            along = self.columns(inertia.rate)
            if not any(along):
                continue
            bias = self.bias(inertia.acceleration)
            for i in range(size):
                if along[i] == 0:
                    continue
                forcing[i] -= inertia.amount * along[i] * bias
                for j in range(i + 1):
                    mass[i][j] += inertia.amount * along[i] * along[j]
        for effort in efforts:
            for i, slope in enumerate(self.columns(effort.rate)):
                forcing[i] += slope * effort.amount
        names = [c.name for c in self._coordinates]
        symbols = [c.latex for c in self._coordinates]
        for i in range(size):
            for j in range(i + 1):
                mass[i][j] = self._ledger.name(
                    f"mass.{names[i]}.{names[j]}",
                    mass[i][j],
                    "kg" if self._coordinates[i].unit == self._coordinates[j].unit == "m" else "kg*m^2/rad^2",
                    f"entry of the mass matrix, {names[i]} and {names[j]}",
                    f"M_{{{symbols[i]},{symbols[j]}}}",
                )
            forcing[i] = self._ledger.name(
                f"forcing.{names[i]}",
                forcing[i],
                "N" if self._coordinates[i].unit == "m" else "N*m",
                f"generalized force along {names[i]} without inertia, Q - h",
                f"f_{{{symbols[i]}}}",
            )
        full = sp.ImmutableMatrix(size, size, lambda i, j: mass[max(i, j)][min(i, j)])
        forces, named = sp.ImmutableMatrix(size, 1, forcing), self._ledger.definitions
        return EquationsOfMotion(mass=full, forcing=forces, definitions=named)
