"""A mechanism's load on the bearing by its mean and first harmonics of the driver's angle.

In: the derived load as an expression of the driver's angle and the gates.  Out: a `LoadSeries`: the series that takes
the load's place in the equations of motion, and its coefficients, which are derived constants like any other: numbers
of the run, evaluated from the parameters by a generated function, so that a changed number needs no new derivation.

The coefficients are integrals over a turn.  The load is linear in every gate, so that its part without gates and what
each gate adds are integrated apart: the first, periodic and smooth, by the trapezoidal rule (which converges faster
than any power for such integrands), the others by Gauss and Legendre's rule from the start of each window to its end.
No quadrature meets a jump.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import sympy as sp

from ballpass.derive.lower.visitor import Visitor
from ballpass.derive.terms import Definition

#: Nodes of the trapezoidal rule, besides four for each harmonic.  The load's harmonics fall geometrically.
TURN_NODES = 128

#: Nodes of Gauss's rule in a window, besides two for each harmonic.
WINDOW_NODES = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """A coefficient of the series [N]: its symbol, and the words and symbol for people."""

    symbol: sp.Symbol
    description: str
    latex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class GatedPart:
    """What acts within windows of the driver's angle: the gate's symbol, and symbols of start and end of each [rad]."""

    gate: sp.Symbol
    windows: tuple[tuple[sp.Symbol, sp.Symbol], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadSeries:
    """Mean and harmonics of a load.

    Attributes
    ----------
    count : number of harmonics
    angle : symbol of the driver's angle
    load : the derived load along x and y [N]
    parts : gates that the load depends on
    coefficients : mean, then cosine and sine of each harmonic, for x and then for y
    waves : cosine and sine of the multiples of the angle
    force : the series along x and y [N]
    """

    count: int
    angle: sp.Symbol
    load: tuple[sp.Expr, sp.Expr]
    parts: tuple[GatedPart, ...]
    coefficients: tuple[Coefficient, ...]
    waves: tuple[Definition, ...]
    force: tuple[sp.Expr, sp.Expr]


def load_series(
    count: int, angle: sp.Symbol, load: tuple[sp.Expr, sp.Expr], parts: tuple[GatedPart, ...]
) -> LoadSeries:
    """The series of a load by `count` harmonics; its coefficients still without values."""
    waves, cosines, sines = _waves(count, angle)
    coefficients: list[Coefficient] = []
    force = []
    for axis in "xy":
        mean = _coefficient(f"load.{axis}.mean", f"Mean of the load along {axis}", rf"\bar F_{axis}")
        coefficients.append(mean)
        total: sp.Expr = mean.symbol
        for k in range(1, count + 1):
            a = _coefficient(
                f"load.{axis}.cos{k}", f"Cosine coefficient {k} of the load along {axis}", rf"a_{{{axis},{k}}}"
            )
            b = _coefficient(
                f"load.{axis}.sin{k}", f"Sine coefficient {k} of the load along {axis}", rf"b_{{{axis},{k}}}"
            )
            coefficients += [a, b]
            total += a.symbol * cosines[k - 1] + b.symbol * sines[k - 1]
        force.append(total)
    return LoadSeries(
        count=count,
        angle=angle,
        load=load,
        parts=parts,
        coefficients=tuple(coefficients),
        waves=waves,
        force=(force[0], force[1]),
    )


def _coefficient(name: str, description: str, latex: str) -> Coefficient:
    return Coefficient(symbol=sp.Symbol(name, real=True), description=description, latex=latex)


def _waves(count: int, angle: sp.Symbol) -> tuple[tuple[Definition, ...], list[sp.Symbol], list[sp.Symbol]]:
    """Cosine and sine of the angle's multiples by angle addition: one pair of them is evaluated."""
    definitions: list[Definition] = []
    cosines: list[sp.Symbol] = []
    sines: list[sp.Symbol] = []
    for k in range(1, count + 1):
        cosine, sine = (sp.Symbol(f"load.{name}{k}", real=True) for name in ("cos", "sin"))
        if k == 1:
            values = (sp.cos(angle), sp.sin(angle))
        else:
            values = (
                cosines[-1] * cosines[0] - sines[-1] * sines[0],
                sines[-1] * cosines[0] + cosines[-1] * sines[0],
            )
        for symbol, value, word, latex in (
            (cosine, values[0], "Cosine", rf"c_{{{k}}}"),
            (sine, values[1], "Sine", rf"s_{{{k}}}"),
        ):
            multiple = "the driver's angle" if k == 1 else f"{k} times the driver's angle"
            definitions.append(
                Definition(symbol=symbol, expression=value, unit="1", description=f"{word} of {multiple}", latex=latex)
            )
        cosines.append(cosine)
        sines.append(sine)
    return tuple(definitions), cosines, sines


def coefficients_of(
    series: LoadSeries,
    parameters: Mapping[sp.Symbol, ca.SX],
    p: ca.SX,
    definitions: Mapping[sp.Symbol, sp.Expr],
    *,
    differentiated: bool,
) -> ca.Function:
    """Function p -> k with the coefficients of a series, by quadrature over a turn, or p -> dk/dp, dense.

    The nodes are a loop in the generated code, and the derivative is that of a node, summed: text and compile time do
    not depend on their number.

    Parameters
    ----------
    parameters : SX of every parameter, entries of `p`
    definitions : everything the load is made of but the driver's angle
    """
    angle, gates = ca.SX.sym("angle"), ca.SX.sym("gates", len(series.parts))
    values = {series.angle: angle, **{part.gate: gates[k] for k, part in enumerate(series.parts)}, **parameters}
    visit = Visitor(values, definitions)
    load = ca.vertcat(*(visit(component) for component in series.load))
    without = ca.substitute(load, gates, ca.SX.zeros(len(series.parts)))
    place, weight = ca.SX.sym("place"), ca.SX.sym("weight")
    argument = ca.MX.sym("p", p.numel())

    def integral(name: str, integrand: ca.SX, begin: ca.SX, width: ca.SX, rule: tuple[np.ndarray, np.ndarray]) -> ca.MX:
        """Of integrand times basis from `begin` on; nodes and weights of the rule are those of the unit interval."""
        there = ca.substitute(integrand, angle, begin + place * width)
        shares = _shares(series.count, there, begin + place * width, weight * width)
        result = ca.vec(ca.densify(ca.jacobian(shares, p))) if differentiated else shares
        node = ca.Function(name, [place, weight, p], [ca.cse(result)])
        nodes, weights = (ca.DM(row).T for row in rule)
        return ca.sum2(node.map(nodes.numel())(nodes, weights, argument))

    count = TURN_NODES + 4 * series.count
    turn = (np.arange(count) / count, np.full(count, 1.0 / count))
    total = integral("of_turn", without, ca.SX(0.0), ca.SX(2.0 * math.pi), turn)
    nodes, weights = np.polynomial.legendre.leggauss(WINDOW_NODES + 2 * series.count)
    gauss = (0.5 * (nodes + 1.0), 0.5 * weights)
    edges = Visitor(parameters, definitions)
    for k, part in enumerate(series.parts):
        alone = ca.SX.zeros(len(series.parts))
        alone[k] = 1.0
        added = ca.substitute(load, gates, alone) - without
        for row, (start, end) in enumerate(part.windows):
            begin = edges(start)
            total += integral(f"of_window_{k + 1}_{row + 1}", added, begin, _width(edges(end) - begin), gauss)
    if differentiated:
        total = ca.reshape(total, len(series.coefficients), p.numel())
    return ca.Function("load_coefficients", [argument], [total], ["p"], ["k"])


def _shares(count: int, load: ca.SX, angle: ca.SX, weight: ca.SX) -> ca.SX:
    """A node's share of the coefficients, in their order."""
    basis = [ca.SX(1.0 / (2.0 * math.pi))]
    for k in range(1, count + 1):
        basis += [ca.cos(k * angle) / math.pi, ca.sin(k * angle) / math.pi]
    return ca.SX(ca.vertcat(*(load[axis] * weight * wave for axis in range(2) for wave in basis)))


def _width(width: ca.SX) -> ca.SX:
    """Width of a window; an end before the start lies in the next turn, and no window is wider than a turn."""
    turn = 2.0 * math.pi
    return ca.if_else(width < 0.0, width - turn * ca.floor(width / turn), ca.fmin(width, turn))
