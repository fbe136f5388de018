"""A drive as the rest of the derivation uses it: the driver's angle, speed and acceleration, and its symbols.

Only drives multiply a speed by time, and decide whether the angle is known before a run.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import sympy as sp

from ballpass.derive.terms import Definition, Smoothness
from ballpass.derive.variables import DRIVER_ANGLE, Coordinate, Input, Terms


@dataclass(frozen=True, slots=True, kw_only=True)
class OverAngle(Terms):
    """Something that changes with the driver's angle: its value, and what this is made of."""

    value: sp.Expr


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive(ABC):
    """The driver's motion, as the equations show it.

    Attributes
    ----------
    angle : of the driven body's x axis from +x [rad]
    speed, acceleration : of the same [rad/s], [rad/s^2]
    first_angle, first_speed : of the start, parameters [rad], [rad/s]
    description : of the acceleration, as text
    constants, definitions : of the symbols in these, ordered
    inputs : that these need
    coordinate : the angle, where it is a state
    passive : the angle as a coordinate on which nothing depends, in a scene that has no other one, where it is known
    whole : the angle with its whole turns, where the speed changes [rad]
    swings : angle [rad], rate and angular acceleration of the driven body of a driver that swings; `angle` and `speed`
        are then those of the swing's phase
    torque : on the driven body [N*m]; None where it follows from a given motion
    flywheel : moment of inertia that turns with the driven body [kg*m^2]
    smoothness : of the torque
    """

    angle: sp.Expr = DRIVER_ANGLE
    speed: sp.Expr
    acceleration: sp.Expr
    first_angle: sp.Expr
    first_speed: sp.Expr
    description: str
    constants: tuple[Definition, ...] = ()
    definitions: tuple[Definition, ...] = ()
    inputs: tuple[Input, ...] = ()
    coordinate: Coordinate | None = None
    passive: Coordinate | None = None
    whole: sp.Expr | None = None
    swings: tuple[sp.Expr, sp.Expr, sp.Expr] | None = None
    torque: sp.Expr | None = None
    flywheel: sp.Expr = sp.S.Zero
    smoothness: Smoothness = Smoothness.TWICE_SMOOTH

    def repeating(self, turns: int) -> Self:
        """The drive of a machine that repeats after so many turns: its angle is known within these."""
        inputs = tuple(replace(one, turns=turns) if one.kind == "phase" else one for one in self.inputs)
        return replace(self, inputs=inputs)

    @property
    def driven(self) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """Angle [rad], rate [rad/s] and angular acceleration [rad/s^2] of the driven body."""
        return (self.angle, self.speed, self.acceleration) if self.swings is None else self.swings

    @abstractmethod
    def gate(self, name: str, windows: Sequence[tuple[str, str]]) -> OverAngle:
        """1 while the angle lies in one of some windows, pairs of parameter names [rad], else 0."""

    @abstractmethod
    def table(self, name: str, unit: str, angles: Sequence[str], values: Sequence[str], turns: int = 1) -> OverAngle:
        """Value of a table over a turn of the angle, or several, linear between its knots and periodic.

        Parameters
        ----------
        angles, values : names of parameters, in [rad] and `unit`
        """
