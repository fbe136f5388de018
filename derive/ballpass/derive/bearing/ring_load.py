"""Force on an inner ring: share of a joint's reaction, and the scene's own loads.

In: a scene, one of its bearings and the reactions of its mechanism.  Out: a `RingLoad`, the force and the inputs,
constants and definitions it is made of.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.drive import Drive
from ballpass.derive.mechanism.kinematics import Pair, add, scale
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.reactions import Reactions
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.records import (
    FRAME,
    ConstantLoad,
    HarmonicLoad,
    Load,
    LoadWindow,
    Scene,
    TableLoad,
    UnbalanceLoad,
)
from ballpass.derive.terms import TIME, Definition, components, defined, symbol_of
from ballpass.derive.variables import Input, Terms, turned
from ballpass.runtime.contract.manifest import TurningInfo

#: How long a load without an end acts, longer than any run [s].
FOR_EVER = 10**9


@dataclass(frozen=True, slots=True, kw_only=True)
class RingLoad(Terms):
    """Force on the inner ring [N] and what it is made of."""

    force: tuple[sp.Expr, sp.Expr]


def load_on(bearing: Bearing, own: RingLoad, linkage: Linkage | None, reactions: Reactions | None) -> Pair | None:
    """Force on an inner ring that is loaded one-way: its share of the reaction of its joint, and loads of the scene.

    On a shaft it has a share of these; the reaction is that of the body it carries on the frame.
    """
    share = sp.S.One if bearing.share is None else symbol_of(bearing.share)
    if linkage is None or reactions is None:
        return scale(share, own.force)
    if bearing.coupling == "two-way":
        return None
    joint = linkage.driver  # the reader refuses another one
    sign = 1 if joint.bodies[0] == FRAME else -1
    return add(scale(sign * share, reactions.joint_force[joint.name]), own.force)


def own_loads(scene: Scene, drive: Drive) -> RingLoad:
    """Sum of the loads that a scene gives itself; every bearing of the scene carries it.

    Parameters
    ----------
    drive : of the shaft, whose angle some follow; beside a mechanism the reader refuses these
    """
    return _sum(_windowed(load, _unwindowed(load, drive), drive) for load in scene.loads)


def _sum(parts: Iterable[RingLoad]) -> RingLoad:
    total = RingLoad(force=(sp.S.Zero, sp.S.Zero))
    for part in parts:
        total = RingLoad(
            force=(total.force[0] + part.force[0], total.force[1] + part.force[1]),
            inputs=(*total.inputs, *part.inputs),
            constants=(*total.constants, *part.constants),
            definitions=(*total.definitions, *part.definitions),
        )
    return total


def _unwindowed(load: Load, shaft: Drive) -> RingLoad:
    law = load.law
    if isinstance(law, ConstantLoad):
        return RingLoad(force=components(law.force))
    if isinstance(law, HarmonicLoad):
        return _harmonic(load, law)
    if isinstance(law, UnbalanceLoad):
        return _unbalance(load, law, shaft)
    return _over_time(load, law) if law.over == "time" else _over_angle(load, law, shaft)


def _windowed(load: Load, full: RingLoad, shaft: Drive) -> RingLoad:
    """The load times 1 within its windows and 0 outside."""
    if load.angle_window is not None and load.angle_window.end is not None:
        gate = shaft.gate(load.label, [(load.angle_window.start.path, load.angle_window.end.path)])
        full = _times(gate.value, full, gate.inputs)
    if load.time_window is not None:
        full = _within_times(load, load.time_window, full)
    return full


def _times(
    gate: sp.Expr, full: RingLoad, inputs: tuple[Input, ...], constants: tuple[Definition, ...] = ()
) -> RingLoad:
    force = (gate * full.force[0], gate * full.force[1])
    return replace(full, force=force, inputs=(*full.inputs, *inputs), constants=(*full.constants, *constants))


def _within_times(load: Load, window: LoadWindow, full: RingLoad) -> RingLoad:
    """The gate is the slope of the table with the rows (start, start) and (end, end): one between, zero outside."""
    constants: tuple[Definition, ...] = ()
    if window.end is None:
        never = symbol_of(window.start) + FOR_EVER
        end = defined(f"{load.path}.time_window.end", never, "s", "Time at which the load ends: never", "t_{off}")
        constants, edges = (end,), (window.start.path, end.symbol.name)
    else:
        edges = (window.start.path, window.end.path)
    gate = Input(
        name=f"{load.label}.time_window",
        kind="table_rate",
        unit="1",
        description="1 while the load acts, else 0",
        latex=r"g_t",
        times=edges,
        values=edges,
    )
    return _times(gate.symbol, full, (gate,), constants)


def _unbalance(load: Load, law: UnbalanceLoad, shaft: Drive) -> RingLoad:
    """Centrifugal force m_u e_u omega^2 of a mass that turns with the shaft."""
    pull = symbol_of(law.mass) * symbol_of(law.eccentricity) * shaft.speed**2
    amount = defined(f"{load.path}.centrifugal_force", pull, "N", "Centrifugal force of the unbalance", "F_u")
    towards = shaft.angle + symbol_of(law.angle)
    return RingLoad(force=(amount.symbol * sp.cos(towards), amount.symbol * sp.sin(towards)), constants=(amount,))


def _harmonic(load: Load, law: HarmonicLoad) -> RingLoad:
    words = "Angle of the harmonic load at the reference time"
    rate = 2 * sp.pi * symbol_of(law.frequency)
    angular = defined(f"{load.path}.angular_frequency", rate, "rad/s", "Angular frequency of the load", r"\Omega")

    def wave(ending: str, at_start: SceneNumber, words: str) -> tuple[Input, Definition]:
        axis = ending.removeprefix(".")
        angle = TurningInfo(
            name=f"{load.label}{ending}",
            kind="load",
            words=f"load {load.name}" if load.name else "load",
            offset=at_start.path,
            rate=angular.symbol.name,
        )
        turning = turned(angle, words, rf"\varphi_{{0,{axis}}}" if axis else r"\varphi_0")
        cosine = sp.cos(turning.symbol + angular.symbol * TIME)
        words = f"Harmonic of the load{f' along {axis}' if axis else ''}"
        return turning, defined(f"{load.label}.wave{ending}", cosine, "1", words, f"w_{axis}" if axis else "w")

    if isinstance(law.phase, tuple):
        both = [wave(f".{a}", at, f"{words} along {a}") for a, at in zip("xy", law.phase, strict=True)]
    else:
        both = [wave("", law.phase, words)]
    mean, amplitude = components(law.mean), components(law.amplitude)
    waves = (both[0][1].symbol, both[-1][1].symbol)
    return RingLoad(
        force=(mean[0] + amplitude[0] * waves[0], mean[1] + amplitude[1] * waves[1]),
        inputs=tuple(turning for turning, _ in both),
        constants=(angular,),
        definitions=tuple(harmonic for _, harmonic in both),
    )


def _over_angle(load: Load, law: TableLoad, shaft: Drive) -> RingLoad:
    angles = [q.path for q in law.rows]
    x, y = (
        shaft.table(f"{load.label}.{axis}", "N", angles, [q.path for q in values])
        for axis, values in (("x", law.x), ("y", law.y))
    )
    return RingLoad(force=(x.value, y.value), inputs=(*x.inputs, *y.inputs))


def _over_time(load: Load, law: TableLoad) -> RingLoad:
    inputs: list[Input] = []

    def column(axis: str, values: tuple[SceneNumber, ...]) -> sp.Expr:
        value = Input(
            name=f"{load.label}.{axis}",
            kind="table",
            unit="N",
            description=f"Value of the load table along {axis} at the reference time",
            latex=rf"F_{{0,{axis}}}",
            times=tuple(q.path for q in law.rows),
            values=tuple(q.path for q in values),
        )
        slope = replace(
            value,
            name=f"{load.label}.{axis}_rate",
            kind="table_rate",
            unit="N/s",
            description=f"Slope of the load table along {axis} at the reference time",
            latex=rf"\dot F_{{0,{axis}}}",
        )
        inputs.extend((value, slope))
        return value.symbol + slope.symbol * TIME

    force = (column("x", law.x), column("y", law.y))
    return RingLoad(force=force, inputs=tuple(inputs))
