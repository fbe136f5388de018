"""Force on an inner ring: share of a joint's reaction, and the scene's own loads.

In: a scene, one of its bearings and the reactions of its mechanism.  Out: a `RingLoad`, the force and the inputs,
constants and definitions it is made of.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.drive import Drive
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.reactions import Reactions
from ballpass.derive.mechanism.vectors import ZERO, Pair, add, scale
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.shaft_records import ConstantLoad, HarmonicLoad, Load, LoadWindow, TableLoad, UnbalanceLoad
from ballpass.derive.terms import TIME, Definition, components, defined, symbol_of
from ballpass.derive.variables import Input, Terms, turned
from ballpass.runtime.contract.manifest import TurningInfo

#: How long a load without an end acts, longer than any run [s].
FOR_EVER = 10**9


@dataclass(frozen=True, slots=True, kw_only=True)
class RingLoad(Terms):
    """Force on the inner ring [N], its moment about the plane z = 0 [N*m], and what they are made of."""

    force: tuple[sp.Expr, sp.Expr]
    moment: Pair = ZERO


def load_on(
    bearing: Bearing, own: RingLoad, linkage: Linkage | None, reactions: Reactions | None, lever: Lever | None
) -> Pair | None:
    """Force on an inner ring that is loaded one-way: its share of the reaction of its joint, and loads of the scene.

    On a shaft it has a share of these; the reaction is that of the body it carries on the frame.  Beside a
    mechanism loads of the scene are on the driven body.

    Parameters
    ----------
    lever : of a bearing that has a place along the shaft, which bears all forces by it
    """
    if bearing.coupling == "two-way" or bearing.tilts:
        return None
    share = sp.S.One if bearing.share is None else symbol_of(bearing.share)
    if linkage is None or reactions is None:
        return scale(share, own.force) if lever is None else lever.bears(own.force, own.moment)
    joint = linkage.mechanism.joint(bearing.joint or "")
    reaction = scale(
        -share if joint.bodies[0] in linkage.poses else share, reactions.joint_force[joint.name]
    )  # on the frame
    if bearing.joint != linkage.driver.name:
        return reaction
    if lever is None:
        return add(reaction, own.force)
    on_shaft = load_on_shaft(own, linkage, reactions)
    return lever.bears(on_shaft.force, on_shaft.moment)


def load_on_shaft(own: RingLoad, linkage: Linkage | None, reactions: Reactions | None) -> RingLoad:
    """Sum and moment of all that loads a shaft one-way: forces on the driven body, and loads of the scene."""
    if linkage is None or reactions is None:
        return own
    places = {name: symbol_of(place) for name, place in linkage.mechanism.body(linkage.driven).positions}
    moments = [scale(places[name], force) for name, force in reactions.on_driven if name in places]
    reaction = reactions.joint_force[linkage.driver.name]
    return RingLoad(force=add(reaction, own.force), moment=add(own.moment, *moments))


@dataclass(frozen=True, slots=True, kw_only=True)
class Lever:
    """How two bearings on one shaft part its forces.

    Attributes
    ----------
    share : of a force in the plane z = 0 [1]
    per_moment : of a force times its place along the shaft [1/m]
    constants : both
    """

    share: sp.Symbol
    per_moment: sp.Symbol
    constants: tuple[Definition, ...]

    def bears(self, force: Pair, moment: Pair) -> Pair:
        """Force on the bearing: R_1 = sum of F_k (z_2 - z_k)/(z_2 - z_1)."""
        return add(scale(self.share, force), scale(-self.per_moment, moment))


def lever_of(bearing: Bearing, bearings: Iterable[Bearing]) -> Lever | None:
    """The lever of a bearing that has a place along the shaft, beside the other one that has."""
    if bearing.position is None or bearing.tilts:
        return None
    other = next(one for one in bearings if one.position is not None and one is not bearing)
    assert other.position is not None  # the reader refuses any but two
    here, there = symbol_of(bearing.position), symbol_of(other.position)
    words = "Share of the force in the plane z = 0 that the bearing carries by levers"
    share = defined(f"{bearing.path}.share", there / (there - here), "1", words, "s")
    words = "Force on the bearing for a force times its place along the shaft"
    per_moment = defined(f"{bearing.path}.lever_per_moment", 1 / (there - here), "1/m", words, "s_M")
    return Lever(share=share.symbol, per_moment=per_moment.symbol, constants=(share, per_moment))


def own_loads(scene: Scene, drive: Drive) -> RingLoad:
    """Sum of the loads that a scene gives itself; every bearing of the scene carries it.

    Parameters
    ----------
    drive : of the shaft, whose angle some follow; beside a mechanism the reader refuses these
    """
    parts = [_placed(load, _windowed(load, _unwindowed(load, drive), drive)) for load in scene.loads]
    return RingLoad(
        force=add(*(part.force for part in parts)),
        moment=add(*(part.moment for part in parts)),
        inputs=tuple(i for part in parts for i in part.inputs),
        constants=tuple(c for part in parts for c in part.constants),
        definitions=tuple(d for part in parts for d in part.definitions),
    )


def _placed(load: Load, full: RingLoad) -> RingLoad:
    """The load with its moment about the plane z = 0."""
    return full if load.position is None else replace(full, moment=scale(symbol_of(load.position), full.force))


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
