"""Pathway: the angle between two bodies, of which one may be the frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.swing import Average, followed, nearest
from ballpass.derive.mechanism.vectors import Pair, cross, dot, rotate
from ballpass.derive.scene.body_keys import BODIES
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.terms import defined, subscript, symbol_of
from ballpass.runtime.contract.manifest import UsualInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBodies(Pathway):
    """A torque turns ``bodies[0]`` counter-clockwise and ``bodies[1]`` clockwise.

    The angle is that of ``bodies[1]`` in the axes of ``bodies[0]``.  Where the bodies swing against each other, its
    excess over a free one is continuous, and the mean of it over a turn of the driver, a period of its swing, or its
    range lies within half a turn.  Where they turn, it lies there itself, and jumps; within a range of the driver it
    jumps half a turn from its mean.
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
            return _excess(force, setting, rotate(sp.cos(free), -sp.sin(free), turned))

        def loads(torque: sp.Expr) -> tuple[AppliedLoad, ...]:
            signed = zip(self.bodies, (torque, -torque), strict=True)
            return tuple(AppliedLoad(body=body, torque=on) for body, on in signed)

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


def _excess(force: Force, setting: Setting, direction: Pair) -> sp.Expr:
    """The angle of a direction, cosine and sine, less whole turns."""
    linkage, label, mark = setting.linkage, force.label, subscript(force.name)
    limits, words = linkage.mechanism.driver.range, f"the bodies of {force.name} against each other"
    turned, rest, angle = followed(linkage, f"{label}.bodies", words, direction)
    ratio, swings, whole = turned.symbol, sp.S.One, sp.S.Zero
    if linkage.drive.swings is not None:
        mean = Average(angle, 0, 2 * sp.pi, *linkage.positions)
    elif limits is not None:
        first, last = symbol_of(limits.start), symbol_of(limits.end)
        whole = ratio * sp.floor(sp.Abs(ratio) * (last - first) / (2 * sp.pi))
        mean = Average(angle, first, last, *linkage.positions)
    else:
        whole, swings, mean = ratio, sp.Max(1 - 2 * linkage.turns * sp.Abs(ratio), 0), rest.symbol
    about = defined(f"{label}.mean_excess", swings * mean, "rad", f"Mean excess of {words}", f"M_{{{mark}}}")
    turns = defined(f"{label}.turns", whole, "1", f"Turns of {words} in a turn of the driver", f"n_{{{mark}}}")
    left_out = 2 * sp.pi * sp.floor(about.symbol / (2 * sp.pi) + sp.Rational(1, 2))
    less = defined(f"{label}.left_out", left_out, "rad", f"Whole turns that {words} leave out", f"L_{{{mark}}}")
    setting.constants.extend((turned, rest, about, turns, less))
    return (nearest(direction, about.symbol) if linkage.drive.swings is None else angle) - less.symbol
