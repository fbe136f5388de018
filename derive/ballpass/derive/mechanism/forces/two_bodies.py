"""Pathway: the angle between two bodies, of which one may be the frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.kinematics import Pair, cross, dot, rotate, subscript
from ballpass.derive.mechanism.swing import Average, followed
from ballpass.derive.scene.body_keys import BODIES
from ballpass.derive.scene.records import FRAME, Force
from ballpass.derive.terms import Definition, symbol_of
from ballpass.runtime.contract.manifest import UsualInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBodies(Pathway):
    """A torque turns ``bodies[0]`` counter-clockwise and ``bodies[1]`` clockwise.

    The angle is that of ``bodies[1]`` in the axes of ``bodies[0]``.  Where the bodies swing against each other, its
    excess over a free one is continuous, and the mean of it over a turn of the driver, or over a period of its swing,
    lies within half a turn.  Where they turn, it lies there itself, and jumps; within a range of the driver it jumps
    half a turn from the middle of the range.
    """

    measure: ClassVar[Measure] = Measure(
        size="angle", size_unit="rad", example="90 deg", amount="torque", amount_unit="N*m"
    )

    bodies: tuple[str, str] = BODIES.declared()

    def act(self, force: Force, setting: Setting) -> Action:
        """Relative angle and its rate."""
        one, two = (setting.linkage.pose(body) for body in self.bodies)

        def excess(free: sp.Expr) -> sp.Expr:
            turned = (dot((one.cos, one.sin), (two.cos, two.sin)), cross((one.cos, one.sin), (two.cos, two.sin)))
            from_free = rotate(sp.cos(free), -sp.sin(free), turned)
            exact = None if one.angle is None or two.angle is None else two.angle - one.angle - free
            return _excess(force, setting, from_free, exact)

        def loads(torque: sp.Expr) -> tuple[AppliedLoad, ...]:
            signed = zip(self.bodies, (torque, -torque), strict=True)
            return tuple(AppliedLoad(body=body, torque=on) for body, on in signed if body != FRAME)

        return Action(loads=loads, excess=excess, rate=two.rate - one.rate)

    def words(self) -> str:
        """The two bodies."""
        return f"torque between {self.bodies[0]} and {self.bodies[1]}"

    def usual(self, force: Force) -> Iterable[UsualInfo]:
        """No whole turns, where the law depends on the angle."""
        if getattr(force.law, "free", None) is not None:
            hint = (
                "Torsion springs and stops are for bodies that swing: half a turn from the free angle the torque jumps."
            )
            yield UsualInfo(names=(f"{force.label}.turns",), least=0.0, most=0.0, hint=hint)


def _excess(force: Force, setting: Setting, direction: Pair, exact: sp.Expr | None) -> sp.Expr:
    """The angle of a direction, cosine and sine, less whole turns; `exact` is it where these are known."""
    linkage, (cos, sin) = setting.linkage, direction
    drive, limits, driven = linkage.drive, linkage.mechanism.driver.range, linkage.drive.driven[0]
    ratio, rest, mean, turns = (
        sp.Symbol(f"{force.label}.{name}", real=True) for name in ("ratio", "mean_rest", "mean_excess", "turns")
    )
    if exact is None:
        whole, middle, beyond = followed(linkage, cos, sin, ratio, rest)
    else:
        whole = sp.diff(exact, driven)
        middle, beyond = sp.expand(exact - whole * driven), rest
    if drive.swings is None:
        swings, between, made = sp.Max(1 - 2 * linkage.turns * sp.Abs(ratio), 0), sp.S.Zero, ratio
        if limits is not None:
            first, last = symbol_of(limits.start), symbol_of(limits.end)
            swings, between = sp.S.One, (first + last) / 2
            made = ratio * sp.floor(sp.Abs(ratio) * (last - first) / (2 * sp.pi))
        about = swings * _within_half_a_turn(ratio * between + rest)
        ahead, across = sp.cos(mean), sp.sin(mean)
        found = mean + sp.atan2(sin * ahead - cos * across, cos * ahead + sin * across)
    else:
        followed_angle, made = ratio * driven + beyond, sp.S.Zero
        about = Average(followed_angle, *linkage.positions)
        found = followed_angle + _within_half_a_turn(mean) - mean
    words = f"the bodies of {force.name} against each other"
    for symbol, value, unit, text, letter in (
        (ratio, whole, "1", f"Turns of {words} in a turn of the driven body", "n"),
        (rest, middle, "rad", f"Mean excess of {words}, less these turns", "m"),
        (mean, about, "rad", f"Mean excess of {words}, if they swing", "M"),
        (turns, made, "1", f"Turns of {words} in a turn of the driver", "N"),
    ):
        latex = f"{letter}_{{{subscript(force.name)}}}"
        setting.constants.append(Definition(symbol=symbol, expression=value, unit=unit, description=text, latex=latex))
    return found


def _within_half_a_turn(angle: sp.Expr) -> sp.Expr:
    return angle - 2 * sp.pi * sp.floor(angle / (2 * sp.pi) + sp.Rational(1, 2))
