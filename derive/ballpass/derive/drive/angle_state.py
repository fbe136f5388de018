"""A drive whose angle is a coordinate: loads that change with the angle are functions of the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.drive.drive import Drive, OverAngle
from ballpass.derive.drive.piecewise_linear import piecewise_linear
from ballpass.derive.terms import Smoothness, defined
from ballpass.derive.variables import DRIVER_ANGLE, Coordinate, Input, StateSwitch

#: Of a window without width, or without a gap [1].
LEAST_SLOPE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleState(Drive):
    """A drive whose angle and speed are states."""

    def gate(self, name: str, windows: Sequence[tuple[str, str]]) -> OverAngle:
        """1 where the switching function of a window is positive."""
        latex = rf"g_{{\mathrm{{{name}}}}}"
        return window_gate(
            name, f"1 while {name} acts, else 0", latex, angle=(DRIVER_ANGLE, self.speed), windows=windows
        )

    def table(self, name: str, unit: str, angles: Sequence[str], values: Sequence[str], turns: int = 1) -> OverAngle:
        """Value over the angle after the first knot, without whole periods."""
        knots, heights = ([sp.Symbol(path, real=True) for path in column] for column in (angles, values))
        turn, past = 2 * turns * sp.pi, DRIVER_ANGLE - knots[0]
        within = past - turn * sp.floor(past / turn, evaluate=False)
        words = f"Driver's angle behind the first row of the table of {name}, within a turn"
        behind = defined(f"{name}.angle", within, "rad", words, rf"\theta_{{\mathrm{{{name}}}}}")
        places = [knot - knots[0] for knot in knots]
        height = piecewise_linear(behind.symbol, [*places, turn], [*heights, heights[0]])
        latex = rf"T_{{\mathrm{{{name}}}}}"
        value = defined(f"{name}.value", height, unit, f"Value of the table of {name}", latex)
        kinks = ((f"{name}.table", Smoothness.KINKED),)
        return OverAngle(value=value.symbol, definitions=(behind, value), smoothness=kinks)


def window_gate(
    name: str, words: str, latex: str, *, angle: tuple[sp.Expr, sp.Expr], windows: Sequence[tuple[str, str]]
) -> OverAngle:
    """1 where the switching function of a window of an angle is positive.

    Parameters
    ----------
    angle : with its rate, functions of the state [rad], [rad/s]
    windows : names of their edges
    """
    edges = [_edges(name, number, angle, *window) for number, window in enumerate(windows, start=1)]
    inside = [sp.Piecewise((1, edge.function > edge.border.symbol), (0, True)) for edge in edges]
    any_of_them = sp.Max(*inside, evaluate=False) if len(inside) > 1 else inside[0]
    gate = defined(f"gate.{name}", any_of_them, "1", words, latex)
    return OverAngle(
        value=gate.symbol,
        inputs=tuple(edge.border for edge in edges),
        definitions=(gate,),
        smoothness=((gate.symbol.name, Smoothness.DISCONTINUOUS),),
        switches=tuple(edges),
    )


def _edges(name: str, number: int, angle: tuple[sp.Expr, sp.Expr], start: str, end: str) -> StateSwitch:
    path, placeholder = f"border.{name}.{number}", sp.Dummy("angle", real=True)
    function = inside_window(placeholder, start, end)
    slope = sp.diff(function, placeholder).xreplace({placeholder: angle[0]})
    return StateSwitch(
        border=Input(
            name=path,
            kind="border",
            unit="rad",
            description=f"Border of the switching function of window {number} of {name}",
            latex=rf"b_{{\mathrm{{{name}}},{number}}}",
            windows=((start, end),),
        ),
        function=function.xreplace({placeholder: angle[0]}),
        rate=slope * angle[1],
        changes=f"`gate.{name}`",
        angle=angle[0],
        turning=angle[1],
    )


def inside_window(angle: sp.Expr, start: str, end: str) -> sp.Expr:
    """Switching function of a window of an angle from one to another: positive inside, modulo a turn [rad].

    Its zeros are the edges: (cos(angle - middle) - cos(half)) / sin(half), half of the width; its slope there is one.
    An end before the start lies in the next turn: middle and half width are then half a turn more, which changes both
    signs of the difference.
    """
    first, last = (sp.Symbol(path, real=True) for path in (start, end))
    span = last - first
    half = sp.Min(sp.Abs(span) / 2, sp.pi, evaluate=False)
    middle = (first + last) / 2
    # cosine and sine of the driver's angle are defined already: the driven body's
    along = sp.cos(angle) * sp.cos(middle) + sp.sin(angle) * sp.sin(middle)
    slope = sp.Max(sp.sin(half), LEAST_SLOPE, evaluate=False)
    return sp.sign(span, evaluate=False) * (along - sp.cos(half)) / slope


def driver_coordinate() -> Coordinate:
    """The driver's angle as a coordinate."""
    return Coordinate(
        name=DRIVER_ANGLE.name,
        kind="angle",
        unit="rad",
        position=DRIVER_ANGLE,
        velocity=sp.Symbol("driver.speed", real=True),
        latex=r"\theta_1",
        description="of the driven body, counter-clockwise",
        group="driver",
    )
