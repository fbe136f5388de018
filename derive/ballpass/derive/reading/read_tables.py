"""All tables of a scene file to a `Scene`, and rules across tables.

In: the table of the whole file.  Out: the record, with placeholders where faults were noted (see `table.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar, cast

from ballpass.derive.drive import known_drive
from ballpass.derive.mechanism.forces.angle_table import MOST_TURNS, AngleTable
from ballpass.derive.mechanism.linkage import derive_linkage
from ballpass.derive.reading.read_bearing import read_bearing, read_shaft
from ballpass.derive.reading.read_duty import read_duty
from ballpass.derive.reading.read_load import read_load
from ballpass.derive.reading.read_mechanism import read_mechanism
from ballpass.derive.reading.values import replaced
from ballpass.derive.scene.bearing_records import Bearing, InitialState
from ballpass.derive.scene.errors import LinkageError
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.scene.read_keys import keys_of, read_keys, read_record
from ballpass.derive.scene.records import OUTPUTS, RunSettings, Scene, quantities_of
from ballpass.derive.scene.shaft_records import HarmonicLoad, Load, Shaft, UnbalanceLoad
from ballpass.derive.scene.table import FRAME, Table, listing
from ballpass.derive.scene.units import show
from ballpass.derive.terms import Names, names_of
from ballpass.runtime.contract.defaults import STEADY_CYCLES
from ballpass.runtime.time.repetition import LOCKED, near_fraction

T = TypeVar("T", Bearing, Load)

#: Tables of a scene file.
TABLES = ("mechanism", "shaft", "load", "loads", "bearing", "bearings", "run", "duty")
#: First parts of the names of a mechanism's variables and of inputs: a bearing's names may not begin so.
RESERVED = (
    *("body", "driver", "force", "friction", "gate", "gear", "guide_friction", "input", "joint", "load", "phase"),
    *("point", "reaction", "shaft", "spring", "stop", "torque", "torsion_spring", "torsion_stop", "weight"),
)
#: Turns before the steady ones of a run whose length is not given, which it drops.
DROPPED_CYCLES = 50.0


def read_tables(root: Table, name: str) -> Scene:
    """The scene of the tables of a file, with placeholders where faults were noted."""
    with root:
        title = keys_of(Scene)["title"].read(root, "title") or name
        root.know(*TABLES)
        mechanism, driven = read_mechanism(root.table("mechanism")) if root.has("mechanism") else (None, None)
        has_bearing = root.has("bearing") or root.has("bearings")
        if mechanism is None and not has_bearing:
            root.fault(
                "",
                "the scene has neither a mechanism nor a bearing",
                allowed="[mechanism], [bearing] (or [bearings.<name>]) or both",
                remedy="add one of the two tables; [shaft] and [load] turn and load a bearing",
            )
        shaft = None
        if mechanism is None and not _states_drive(root):
            root.table("mechanism", "driver, frame, bodies and joints")
            has_bearing = False
        elif mechanism is not None:
            _refuse_loads(root)
        elif has_bearing:
            shaft = read_shaft(root.table("shaft", "speed"))
        loads = _read_loads(root, required=shaft is not None) if has_bearing else ()
        if shaft is not None and shaft.ring == "outer":
            _refuse_unbalance(root, loads)
        tilts = _tilts(root, shaft, mechanism, driven)
        bearings = _read_bearings(root, mechanism, driven, tilts) if has_bearing else ()
        if bearings or not has_bearing:  # else reported
            _check_positions(root, bearings, tilts)
            known = driven is not None  # else a fault of the driver is noted
            if not any(bearing.position for bearing in bearings):
                driven = None
                _refuse_places(root, [load.path for load in loads if load.position is not None])
            if mechanism is not None:
                named = [body.name for body in mechanism.bodies if known and body.positions and body.name != driven]
                _refuse_places(root, [f"mechanism.bodies.{name}.positions" for name in named])
                pivots = {j.point(driven or "") for j in mechanism.joints if j.bodies == (FRAME, driven)}
                own = [name for body in mechanism.bodies if body.name == driven for name, _ in body.positions]
                _refuse_places(root, [f"mechanism.bodies.{driven}.positions.{name}" for name in own if name in pivots])
                _check_loads_beside(root, loads, bearings)
        cycle = _turns_of_loads(mechanism, shaft, loads, None if root.collector.faults else mechanism)
        speeds = mechanism.driver.table if mechanism is not None else None
        # rows of equal speed are those of a constant one
        unlike = {q.value for q in (mechanism.driver.speed, *speeds.later_speed)} if mechanism and speeds else set()
        span = speeds.time[-1].value if speeds is not None and len(unlike) > 1 else None
        # of a swing a transient that does not suffice is doubled from a period on: balls are then where they were
        dropped = DROPPED_CYCLES if mechanism is None or mechanism.driver.swing is None else 1.0
        steady = cycle * math.ceil(STEADY_CYCLES / cycle)
        run, outputs = _read_run(root.table("run", required=False), dropped, steady, span)
        given = root.data.get("run")
        turns = {"cycles", "duration", "transient_cycles"}.intersection(given if isinstance(given, dict) else ())
        transient = "transient_cycles" in turns
        seated = not transient and not any(_states(root, "initial"))
        scene = Scene(
            name=name,
            title=title,
            mechanism=mechanism,
            shaft=shaft,
            loads=loads,
            bearings=bearings,
            outputs=outputs,
            run=replace(run, at_rest=seated, stated=bool(turns)),
        )
        return replace(scene, duty=read_duty(root.table("duty"), scene)) if root.has("duty") else scene


def _states_drive(root: Table) -> bool:
    """Whether something turns and loads the bearings, or none of them names a joint."""
    return any(key in root.data for key in ("shaft", "load", "loads")) or not any(_states(root, "joint"))


def _states(root: Table, key: str) -> Iterator[bool]:
    """Of each bearing: whether the scene gives this key."""
    several = root.data.get("bearings", {})
    for bearing in (root.data.get("bearing", {}), *(several.values() if isinstance(several, dict) else ())):
        yield isinstance(bearing, dict) and key in bearing


def _turns_of_loads(
    mechanism: Mechanism | None, shaft: Shaft | None, loads: Sequence[Load], geared: Mechanism | None
) -> int:
    """Turns after which all loads repeat: means over other numbers of turns count some of these more than others.

    `geared` is a mechanism without faults, whose wheels repeat as well.
    """
    laws = [force.law for force in mechanism.forces] if mechanism is not None else []
    counts = [law.turns for law in laws if isinstance(law, AngleTable)]
    if geared is not None and geared.gears:
        with suppress(LinkageError):  # the derivation reports it
            counts.append(derive_linkage(geared, known_drive(geared.driver)).turns)
    if shaft is not None and shaft.speed.value != 0.0:
        for law in (load.law for load in loads):
            ratio = (
                math.tau * law.frequency.value / abs(shaft.speed.value) if isinstance(law, HarmonicLoad) else math.nan
            )
            if math.isfinite(ratio):  # a number with a fault has none
                near = near_fraction(ratio, MOST_TURNS, LOCKED)
                counts += [] if near is None else [near.denominator]
    return math.lcm(1, *counts)


def _read_run(table: Table, dropped: float, steady: int, span: float | None) -> tuple[RunSettings, tuple[str, ...]]:
    """Length, samples and method of a run, and the names of its outputs.

    Without a length it takes the `span` of a table in which the speed changes [s], or else `steady` turns count, behind
    `dropped` at least.
    """
    if table.missing:  # not a fault
        table = Table(table.collector, table.path, {})
    with table:
        run = read_record(RunSettings, table)
        if run.cycles is None and run.duration is None and span is not None:
            run = replace(run, duration=span)
        elif run.cycles is None and run.duration is None:
            dropped = run.transient_cycles if "transient_cycles" in table.data else dropped
            run = replace(run, cycles=dropped + steady, transient_cycles=dropped)
        return run, read_keys(table, {"outputs": OUTPUTS})["outputs"]


def _tilts(root: Table, shaft: Shaft | None, mechanism: Mechanism | None, driven: str | None) -> bool:
    """Whether the shaft tilts in its bearings; a fault where another body than the driven one has the key."""
    found = shaft is not None and shaft.transverse_inertia is not None
    for body in mechanism.bodies if mechanism is not None else ():
        if body.transverse_inertia is not None and body.name != driven:
            root.fault(
                f"mechanism.bodies.{body.name}.transverse_inertia",
                "only the driven body tilts: the others move in the plane",
                given=show(body.name),
                allowed="the body that the driver turns",
                remedy="delete the key",
            )
        found = found or body.transverse_inertia is not None
    return found


def _read_bearings(root: Table, mechanism: Mechanism | None, driven: str | None, tilts: bool) -> tuple[Bearing, ...]:
    """``[bearing]``, or ``[bearings.<name>]`` for several."""
    bearings = []
    for table, name in _one_or_several(root, "bearing", ""):
        if name in RESERVED:
            table.fault(
                "",
                "other outputs and variables have names that begin so",
                given=show(name),
                allowed=f"a name that is none of {listing(RESERVED)}",
                remedy="give the bearing another name",
            )
        bearing = read_bearing(table, mechanism, driven, tilts, name)
        bearings.append(_marked(bearing, names_of(bearing)))
    _check_couplings(root, bearings)
    return tuple(_beside(root, bearing, bearings[:k]) for k, bearing in enumerate(bearings))


def _beside(root: Table, bearing: Bearing, before: Sequence[Bearing]) -> Bearing:
    """A bearing whose inner ring moves as that of another one at the joint, where there is one; coupled two-way."""
    if bearing.tilts:
        on_shaft = [b for b in before if b.tilts]
        first = on_shaft[0] if len(on_shaft) >= 2 else None
    else:
        two_way = (b for b in before if b.coupling == bearing.coupling == "two-way" and b.joint == bearing.joint)
        first = next(two_way, None)
    if first is None:
        return bearing
    if bearing.inner_body != first.inner_body:
        root.fault(
            f"bearings.{bearing.name}.inner_ring",
            f"joint {show(bearing.joint)}: the inner ring of {first.name} is on the other body",
            given=f"{show(first.inner_body)}, {show(bearing.inner_body)}",
            allowed="bearings side by side: all inner rings of a joint on one body",
            remedy=f'write body = "{first.inner_body}" in its table inner_ring',
        )
    given = root.data["bearings"][bearing.name].get("initial")
    for key in ("inner", "inner_velocity"):
        if isinstance(given, dict) and key in given:
            root.fault(
                f"bearings.{bearing.name}.initial.{key}",
                "its inner ring moves with the shaft, whose start those of the first two bearings give"
                if bearing.tilts
                else f"its inner ring moves as that of the bearing {first.name} beside it",
                given=show(given[key]),
                allowed="an initial state of the first two alone"
                if bearing.tilts
                else f"an initial state of bearings.{first.name} alone",
                remedy="delete the key",
            )
    start = bearing.initial
    own = InitialState(position=start.position[2:], velocity=start.velocity[2:])
    return replace(bearing, beside="" if bearing.tilts else first.name, has_axis=bearing.tilts, initial=own)


def _one_or_several(root: Table, one: str, example: str) -> Iterator[tuple[Table, str]]:
    """The table ``[one]``, or those of ``[ones.<name>]`` with their names."""
    several = f"{one}s"
    if root.has(one) and root.has(several):
        root.fault(
            several,
            f"{several} are given in two places",
            given=f"[{one}] and [{several}]",
            allowed=f"[{one}] for one, or [{several}.<name>] for several",
            remedy=f"move [{one}] to [{several}.<name>], with a name of its own",
        )
        return  # faults of a half-moved table would only hide this one
    if not root.has(several):
        yield root.table(one, example), ""
        return
    with root.table(several) as tables:
        for name in tables.names(one):
            yield tables.table(name, example), name


def _marked(record: T, names: Names) -> T:
    """A part with its name in its symbols, where several have the same ones."""
    marked = {
        q.path: replace(q, description=names.words(q.description), latex=names.latex(q.latex))
        for q in quantities_of(record)
    }
    return cast(T, replaced(record, marked))


def _check_couplings(root: Table, bearings: Sequence[Bearing]) -> None:
    """All bearings one-way or all two-way."""
    one_way = [b.name for b in bearings if b.coupling == "one-way"]
    two_way = [b.name for b in bearings if b.coupling == "two-way"]
    if one_way and two_way:
        root.fault(
            f"bearings.{one_way[0]}",
            "a bearing loaded one-way takes the reaction of an ideal linkage, and others give this linkage play",
            given=f"one-way: {listing(one_way)}; two-way: {listing(two_way)}",
            allowed="one coupling for all bearings of a scene",
            remedy='give all of them coupling = "two-way", or none',
        )


def _check_positions(root: Table, bearings: Sequence[Bearing], tilts: bool) -> None:
    """Levers part the forces on a shaft between two bearings; one that tilts has two or more."""
    placed = [bearing for bearing in bearings if bearing.position is not None]
    values = [bearing.position.value for bearing in placed if bearing.position is not None]
    if tilts:
        on_shaft = [bearing for bearing in bearings if bearing.tilts]
        if len(on_shaft) == len(placed) >= 2 and len({*values[:2]}) == 2:
            return
        if any(bearing.position is None for bearing in on_shaft):  # reported
            return
        problem = "the axis of a shaft that tilts runs through the inner rings of its first two bearings"
        allowed = "two bearings or more on the shaft, the first two at unlike places"
        remedy = "give it a second bearing"
    else:
        if not placed or (len(bearings) == len(placed) == 2 and len({*values}) == 2):
            return
        problem = "levers part the forces on a shaft between two bearings at two places"
        allowed = "position at both of two bearings, and unlike"
        remedy = "give both a position; with one bearing share, with three or more the shaft a transverse_inertia"
    root.fault(
        f"{placed[0].path}.position" if placed else "",
        problem,
        given="one place twice"
        if len({*values}) < len(values)
        else f"places of {len(placed)} of {len(bearings)} bearings",
        allowed=allowed,
        remedy=remedy,
    )


def _refuse_places(root: Table, paths: Sequence[str]) -> None:
    """Places along the shaft are those of what bearings with places carry by levers."""
    for path in paths:
        root.fault(
            path,
            "this has no place along the shaft of its own: no bearing would carry it by that",
            allowed="places of loads, and of the driven body's points but that of the driver's joint, where its "
            "bearings have a position",
            remedy="delete it, or give the bearings a position in place of share",
        )


def _read_loads(root: Table, *, required: bool) -> tuple[Load, ...]:
    """``[load]``, or ``[loads.<name>]`` for several."""
    if not required and not root.has("load") and not root.has("loads"):
        return ()
    loads = (read_load(table, name) for table, name in _one_or_several(root, "load", "type"))
    return tuple(
        _marked(load, Names(prefix=f"{load.name}." * bool(load.name), path=load.path))
        for load in loads
        if load is not None
    )


def _refuse_unbalance(root: Table, loads: Sequence[Load]) -> None:
    """An unbalance turns with the inner ring, on which it acts."""
    for load in (load for load in loads if isinstance(load.law, UnbalanceLoad)):
        root.collector.fault(
            (*load.path.split("."), "type"),
            "the unbalance turns with the shaft and acts on the inner ring, which stands",
            given=f'type = "unbalance" in [{load.path}], and ring = "outer" in [shaft]',
            allowed="loads that do not turn with the shaft, where the outer ring turns",
            remedy='write ring = "inner", or a harmonic load with the frequency of the shaft',
        )


def _check_loads_beside(root: Table, loads: Sequence[Load], bearings: Sequence[Bearing]) -> None:
    """Beside a mechanism loads follow the time, and bearings are loaded one-way."""
    coupled = any(bearing.coupling == "two-way" for bearing in bearings)
    for load in (load for load in loads if coupled or load.turns):
        of_mass = ", an unbalance as its center_of_mass" * (not coupled)
        root.collector.fault(
            tuple(load.path.split(".")),
            "a bearing coupled two-way has no ring of its own that a load could act on"
            if coupled
            else "this load follows the angle of a shaft, and a mechanism has none",
            given=f"[{load.path}]",
            allowed="loads over time on bearings that are coupled one-way",
            remedy=f"write it as a force on a body, [mechanism.forces.<name>]{of_mass}",
        )


def _refuse_loads(root: Table) -> None:
    """A mechanism turns and loads its bearings; a bearing loaded one-way may have a load beside it."""
    for key in ("shaft",) if root.has("bearing") or root.has("bearings") else ("shaft", "load", "loads"):
        if root.has(key):
            root.fault(
                key,
                "the mechanism turns the bearing",
                given=f"[{key}]",
                allowed=f"[{key}] only in a scene with [bearing] and without [mechanism]",
                remedy=f"delete [{key}], or delete [mechanism]",
            )
