"""Force on an inner ring: share of a joint's reaction, or the scene's own load.

In: a scene, one of its bearings and the reactions of its mechanism.  Out: a `RingLoad`, the force and the inputs,
constants and definitions it is made of.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.mechanism.reactions import Reactions
from ballpass.derive.scene.records import FRAME, Bearing, ConstantLoad, HarmonicLoad, Quantity, Scene, TableLoad
from ballpass.derive.terms import TIME, Definition, components, symbol_of
from ballpass.derive.variables import Input, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class RingLoad:
    """Force on the inner ring [N] and what it is made of."""

    force: tuple[sp.Expr, sp.Expr]
    inputs: tuple[Input, ...] = ()
    constants: tuple[Definition, ...] = ()
    definitions: tuple[Definition, ...] = ()


def reaction_share(scene: Scene, bearing: Bearing, reactions: Reactions) -> RingLoad:
    """Share of the reaction of the bearing's joint: the force of the body it carries on the frame."""
    assert scene.mechanism is not None
    assert bearing.joint is not None
    assert bearing.share is not None
    fx, fy = reactions.joint_force[bearing.joint]
    share = symbol_of(bearing.share)
    sign = 1 if scene.mechanism.joint(bearing.joint).bodies[0] == FRAME else -1
    return RingLoad(force=(sign * share * fx, sign * share * fy))


def own_load(scene: Scene) -> RingLoad:
    """The load of a scene without mechanism; every bearing of the scene carries it."""
    load = scene.load
    assert load is not None  # the reader requires a load where there is no mechanism
    if isinstance(load, ConstantLoad):
        return RingLoad(force=components(load.force))
    if isinstance(load, HarmonicLoad):
        return _harmonic(load)
    return _table(load)


def _harmonic(load: HarmonicLoad) -> RingLoad:
    words = "Angle of the harmonic load at the reference time"
    turning = phase("load", words, r"\varphi_0", offset=load.phase.path, rate="load.angular_frequency")
    angular = Definition(
        symbol=sp.Symbol("load.angular_frequency", real=True),
        expression=2 * sp.pi * symbol_of(load.frequency),
        unit="rad/s",
        description="Angular frequency of the load",
        latex=r"\Omega",
    )
    wave = Definition(
        symbol=sp.Symbol("load.wave", real=True),
        expression=sp.cos(turning.symbol + angular.symbol * TIME),
        unit="1",
        description="Harmonic of the load",
        latex="w",
    )
    mean, amplitude = components(load.mean), components(load.amplitude)
    return RingLoad(
        force=(mean[0] + amplitude[0] * wave.symbol, mean[1] + amplitude[1] * wave.symbol),
        inputs=(turning,),
        constants=(angular,),
        definitions=(wave,),
    )


def _table(load: TableLoad) -> RingLoad:
    inputs: list[Input] = []
    times = tuple(q.path for q in load.time)

    def column(axis: str, values: tuple[Quantity, ...]) -> sp.Expr:
        names = tuple(q.path for q in values)
        value = Input(
            name=f"load.{axis}",
            symbol=sp.Symbol(f"input.load.{axis}", real=True),
            kind="table",
            unit="N",
            description=f"Value of the load table along {axis} at the reference time",
            latex=rf"F_{{0,{axis}}}",
            times=times,
            values=names,
        )
        slope = Input(
            name=f"load.{axis}_rate",
            symbol=sp.Symbol(f"input.load.{axis}_rate", real=True),
            kind="table_rate",
            unit="N/s",
            description=f"Slope of the load table along {axis} at the reference time",
            latex=rf"\dot F_{{0,{axis}}}",
            times=times,
            values=names,
        )
        inputs.extend((value, slope))
        return value.symbol + slope.symbol * TIME

    force = (column("x", load.x), column("y", load.y))
    return RingLoad(force=force, inputs=tuple(inputs))
