"""The drive at constant speed: angle = angle at the reference time + speed times the time since then.

Loads that change with the angle are inputs; they change at times that are known before a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.drive.drive import Drive, OverAngle, part_of, parts_of_knots
from ballpass.derive.scene.records import Driver
from ballpass.derive.terms import TIME, Definition, symbol_of
from ballpass.derive.variables import DRIVER_ANGLE, Input, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantSpeed(Drive):
    """A drive whose angle is known; `phase` is the input that holds it at the reference time [rad]."""

    phase: Input

    def gate(self, name: str, windows: Sequence[tuple[str, str]]) -> OverAngle:
        """An input."""
        gate = Input(
            name=f"gate.{name}",
            symbol=sp.Symbol(f"gate.{name}", real=True),
            kind="gate",
            unit="1",
            description=f"1 while {name} acts, else 0",
            latex=rf"g_{{\mathrm{{{name}}}}}",
            offset=self.phase.offset,
            rate=self.phase.rate,
            windows=tuple(windows),
        )
        return OverAngle(value=gate.symbol, inputs=(gate,))

    def table(self, name: str, unit: str, angles: Sequence[str], values: Sequence[str], turns: int = 1) -> OverAngle:
        """Value at the reference time, plus slope over the angle times the angle turned since then.

        A table over several turns is one over the angle divided by these: that repeats after a turn.
        """
        offset, rate, divided = self.phase.offset, self.phase.rate, list(parts_of_knots(name, angles, turns))
        if turns > 1:
            divided = [
                part_of(name, "part_angle", "rad", "Start angle", offset, turns),
                part_of(name, "part_speed", "rad/s", "Speed", rate, turns),
                *divided,
            ]
            offset, rate, *angles = (str(one.symbol) for one in divided)

        def entry(kind: Literal["table", "table_rate"], ending: str, unit: str, words: str, latex: str) -> Input:
            return Input(
                name=f"{name}{ending}",
                symbol=sp.Symbol(f"input.{name}{ending}", real=True),
                kind=kind,
                unit=unit,
                description=f"{words} of the table of {name} at the reference time",
                latex=rf"{latex}_{{0,\mathrm{{{name}}}}}",
                offset=offset,
                rate=rate,
                times=tuple(angles),
                values=tuple(values),
            )

        value = entry("table", "", unit, "Value", "T")
        slope = entry("table_rate", "_slope", f"{unit}/rad", "Slope over the driver's angle", "T'")
        passed = self.speed / turns * TIME
        return OverAngle(value=value.symbol + slope.symbol * passed, constants=tuple(divided), inputs=(value, slope))


def constant_speed(driver: Driver) -> ConstantSpeed:
    """Drive of a driver with speed and start angle."""
    speed = symbol_of(driver.speed)
    words = "Angle of the driven body at the reference time"
    start = phase("driver", words, r"\theta_{1,0}", offset=driver.start_angle.path, rate=driver.speed.path)
    angle = Definition(
        symbol=DRIVER_ANGLE,
        expression=start.symbol + speed * TIME,
        unit="rad",
        description="Angle of the driven body",
        latex=r"\theta_1",
    )
    return ConstantSpeed(
        speed=speed,
        acceleration=sp.S.Zero,
        description="the driver's speed is constant",
        definitions=(angle,),
        inputs=(start,),
        phase=start,
    )
