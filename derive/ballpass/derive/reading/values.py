"""The numbers of a scene: list them, check them, replace them.

In: a `Scene`.  Out: its quantities; the faults of their values; a scene with other values.  All checks
that need nothing but numbers are here, so that values from ``--set`` and from the file are checked alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from itertools import pairwise
from typing import Any, cast

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.reading.clearance_groups import clearance_of_group
from ballpass.derive.scene.bearing_records import Bearing, CageMotion
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.errors import Fault, SceneError
from ballpass.derive.scene.mechanism_records import Driver, Mechanism
from ballpass.derive.scene.quantity import Bounds, SceneNumber
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.shaft_records import Load, Shaft, TableLoad
from ballpass.derive.scene.units import QuantityError, parse_quantity, show
from ballpass.runtime.contract.defaults import longer_words
from ballpass.runtime.contract.units import split_setting
from ballpass.runtime.time.turning import TURN, Turning

#: Last parts of keys of the file that are no quantities, for the message about an override of one.
_STRUCTURE = ("balls", "designation", "joint", "law", "support")


def value_faults(scene: Scene, given: Mapping[str, str]) -> list[Fault]:
    """Faults of the values: signs, bounds, and rules between several values.

    Parameters
    ----------
    scene : NaN stands for a value that has been reported before; it passes every check
    given : text of a value by path, where the file has one; others are shown in SI
    """
    checker = Checker(given)
    for quantity in scene.quantities:
        checker.within(quantity)
    if scene.mechanism is not None:
        _check_mechanism(checker, scene.mechanism)
    for load in scene.loads:
        _check_load(checker, load)
    for bearing in scene.bearings:
        _check_bearing(checker, bearing)
    _check_run(checker, scene)
    shaft = scene.shaft
    if shaft is not None and shaft.outer_speed is not None and shaft.speed.value == 0.0:
        checker.fault(
            shaft.speed.path,
            "the inner ring stands, and angles count in its turns",
            checker.show(shaft.speed),
            "a speed other than zero where both rings turn",
            'write ring = "outer" and the outer ring\'s speed as speed',
        )
    return checker.faults


def value_bounds(scene: Scene) -> dict[str, Bounds]:
    """Bounds of each quantity by path; quantities without bounds are left out."""
    return {q.path: q.limits.bounds for q in scene.quantities if q.limits.bounds is not None}


def value_relations(scene: Scene) -> tuple[tuple[str, float, str], ...]:
    """Rules between quantities: (path, factor, other path) for ``value > factor * other value``."""
    relations: list[tuple[str, float, str]] = []
    for bearing in scene.bearings:
        ball, pitch = bearing.ball_diameter.path, bearing.pitch_diameter.path
        # the balls fit side by side on the pitch circle, with a small gap
        relations.append((pitch, (1.0 - 1e-12) / math.sin(math.pi / bearing.balls) if bearing.balls > 1 else 1.0, ball))
        relations.append((bearing.clearance.path, -1.0, ball))  # see `_check_preload`
        relations += [r for effect in bearing.effects for r in EFFECTS[effect.kind].relations(effect, bearing)]
        relations += ELEMENTS[bearing.element].relations(bearing)
    return tuple(relations)


def with_values(scene: Scene, values: Mapping[str, float]) -> Scene:
    """The scene with other values.

    Parameters
    ----------
    values : SI values by path

    Raises
    ------
    SceneError
        An unknown path, a value that is not finite, or one that the same key of a file could not have.
    """
    known = {quantity.path: quantity for quantity in scene.quantities}
    faults = []
    changed: dict[str, SceneNumber] = {}
    for path, value in values.items():
        if path not in known:
            faults.append(_unknown_path(path, list(known)))
        elif not math.isfinite(value):
            faults.append(
                Fault(
                    key=path,
                    problem="the number is not finite",
                    given=repr(float(value)),
                    allowed=f"a finite number [{known[path].unit}]",
                    remedy="give a finite number",
                )
            )
        else:
            changed[path] = replace(known[path], value=float(value))
    if faults:
        raise SceneError(faults)
    result = cast(Scene, replaced(scene, changed))
    faults = value_faults(result, {})
    if faults:
        raise SceneError(faults)
    return result


def parse_override(scene: Scene, text: str) -> tuple[str, float]:
    """Path and SI value of ``"bearing.clearance=20 um"``; a group of clearance gives its middle.

    Raises
    ------
    SceneError
        No "=", an unknown path (the nearest ones are named), or no quantity of its unit.
    """
    path, equals, value = split_setting(text)
    if not equals:
        raise Fault(
            key=path,
            problem="an override without a value",
            given=show(text),
            allowed="PATH=VALUE",
            remedy='write the value with its unit after "=", as in "bearing.clearance=20 um"',
        ).error()
    check_path(scene, path)
    group = clearance_of_group(scene, path, value)
    if group is not None:
        return path, group[1]
    units = {quantity.path: quantity.unit for quantity in scene.quantities}
    try:
        return path, parse_quantity(value, units[path])
    except QuantityError as error:
        fault = Fault(key=path, problem=error.problem, given=error.given, allowed=error.allowed, remedy=error.remedy)
        raise SceneError([fault]) from None


def check_path(scene: Scene, path: str) -> None:
    """Refuse a path that is none of the scene's numbers.

    Raises
    ------
    SceneError
        The nearest paths are named; keys that decide the structure of the model get another message than unknown ones.
    """
    known = [quantity.path for quantity in scene.quantities]
    if path not in known:
        raise _unknown_path(path, known).error()


def _unknown_path(path: str, known: Sequence[str]) -> Fault:
    if path.rpartition(".")[2] in _STRUCTURE or path.startswith("run."):
        return Fault(
            key=path,
            problem="this is not a number of the model"
            + ("" if path.startswith("run.") else ": it decides which equations are derived"),
            given=show(path),
            allowed="paths of quantities",
            remedy="change it in the scene file" + ("" if path.startswith("run.") else " and derive the model again"),
        )
    near = get_close_matches(path[:200], known, n=3, cutoff=0.5)
    last = path.rpartition(".")[2]
    near += [name for name in known if name.rpartition(".")[2] == last and name not in near][: 3 - len(near)]
    return Fault(
        key=path,
        problem="the scene has no quantity of this path",
        given=show(path),
        allowed=", ".join(near) if near else f"one of {len(known)} paths, such as {', '.join(known[:5])}",
        remedy=f'did you mean "{near[0]}"?' if near else "write the path as its keys stand in the scene file",
    )


def replaced(record: Any, changed: Mapping[str, SceneNumber]) -> Any:
    """A record with other quantities, by their paths."""
    if isinstance(record, SceneNumber):
        return changed.get(record.path, record)
    if isinstance(record, tuple):
        return tuple(replaced(item, changed) for item in record)
    if is_dataclass(record) and not isinstance(record, type):
        return replace(
            record, **{field.name: replaced(getattr(record, field.name), changed) for field in fields(record)}
        )
    return record


def _check_mechanism(checker: Checker, mechanism: Mechanism) -> None:
    if mechanism.driver.torque is not None:
        mechanism.driver.torque.check(checker)
    if (table := mechanism.driver.table) is not None:
        remedy = "give every row a time and a speed, or write speed instead of the table for one that does not change"
        speeds = (mechanism.driver.speed, *table.later_speed)
        path = speeds[0].path.rpartition(".")[0].rpartition(".")[0]
        checker.rows(path, {"time": table.time, "speed": speeds}, remedy)
    if (limits := mechanism.driver.range) is not None and limits.start.value >= limits.end.value:
        checker.fault(
            limits.end.path,
            "the driver's range ends where it starts, or before",
            f"{checker.show(limits.start)}, {checker.show(limits.end)}",
            "an end above the start; whole turns count, as in 400 deg",
            "exchange start and end",
        )
    for force in mechanism.forces:
        force.law.check(checker)


def _check_load(checker: Checker, load: Load) -> None:
    """Note faults of the numbers of a load."""
    if isinstance(load.law, TableLoad):
        table = load.law
        remedy = f'give every row {table.over}, x and y; add rows, or write type = "constant"'
        checker.rows(load.path, {table.over: table.rows, "x": table.x, "y": table.y}, remedy)
        if table.over == "angle":
            checker.within_a_turn(table.rows)
    window = load.angle_window
    if window is not None and window.end is not None:
        checker.window(window.start, window.end)
    window = load.time_window
    if window is not None and window.end is not None and window.end.value <= window.start.value:
        checker.fault(
            window.end.path,
            "the load ends before it begins",
            f"start {checker.show(window.start)}, end {checker.show(window.end)}",
            "an end after the start",
            "give a later end, or none for a load that does not end",
        )


def _check_bearing(checker: Checker, bearing: Bearing) -> None:
    _check_balls(checker, bearing)
    _check_preload(checker, bearing)
    ELEMENTS[bearing.element].check(checker, bearing)
    for effect in bearing.effects:
        EFFECTS[effect.kind].check(effect, checker, bearing)
    if bearing.cage is not None:
        _check_slip(checker, bearing.cage, bearing.path)


def _check_slip(checker: Checker, cage: CageMotion, path: str) -> None:
    """Rows of a slip over time."""
    remedy = "give each row a time and a slip"
    if not checker.rows(f"{path}.cage.slip", {"time": cage.time, "value": cage.slips}, remedy):
        return
    if cage.time[0].value != 0.0:
        checker.fault(
            cage.time[0].path,
            "the first row does not begin at the start",
            checker.show(cage.time[0]),
            "zero",
            'write "0 s" in the first row',
        )


def _check_balls(checker: Checker, bearing: Bearing) -> None:
    ball, pitch = bearing.ball_diameter, bearing.pitch_diameter
    if ball.value <= 0.0 or pitch.value <= 0.0:
        return
    if pitch.value <= ball.value:
        checker.fault(
            pitch.path,
            "the pitch diameter does not exceed the ball diameter",
            f"pitch diameter {checker.show(pitch)}, ball diameter {checker.show(ball)}",
            "a pitch diameter above the ball diameter",
            "check both: the pitch diameter is about the mean of bore and outside diameter",
        )
        return
    room = pitch.value * math.sin(math.pi / bearing.balls)
    if room < ball.value:
        most = int(math.pi / math.asin(ball.value / pitch.value))
        checker.fault(
            f"{bearing.path}.balls",
            "the balls do not fit on the pitch circle",
            f"{bearing.balls} balls of {ball.value:.6g} m, {room:.6g} m from centre to centre",
            f"at most {most} balls of this diameter on this circle",
            "check ball count, ball diameter and pitch diameter",
        )


def _check_preload(checker: Checker, bearing: Bearing) -> None:
    """Refuse a preload as large as a ball.  A clearance may have any size: the ring is free then."""
    ball, clearance = bearing.ball_diameter, bearing.clearance
    if ball.value <= 0.0 or not -clearance.value >= ball.value:
        return
    checker.fault(
        clearance.path,
        "the preload (a negative clearance) is as large as a ball",
        f"{checker.show(clearance)}, ball diameter {checker.show(ball)}",
        f"a diametral clearance above -{ball.value:.9g} m, the ball diameter",
        'check its unit: clearances are some micrometres, "10 um"',
    )


def _check_run(checker: Checker, scene: Scene) -> None:
    source = scene.mechanism.driver if scene.mechanism is not None else scene.shaft
    run, within = scene.run, ""
    turns = run.cycles if (run.cycles or 0.0) > 0.0 else None
    turning = None if source is None else _turning(source)
    if source is not None and turning is not None and turns is not None and math.isinf(turning.after(turns)):
        checker.fault(
            "run.cycles",
            "nothing turns, or not so often",
            f"{turns:g} cycles; {source.speed.path} = {checker.show(source.speed)}",
            "a duration where the speed is zero; turns that are made until the driver stands",
            'write duration = "0.5 s" instead of cycles (or run with --duration "0.5 s"), or give a speed',
        )
    if turning is not None and run.duration is not None:
        turns, within = turning.turns(0.0, run.duration), f" in {run.duration:g} s"
    if turns is not None and turns <= run.transient_cycles and run.transient_cycles > 0.0:
        checker.fault(
            "run.transient_cycles",
            "the transient cycles fill the whole run",
            f"{run.transient_cycles:g} of {turns:g} cycles{within}",
            "fewer cycles than the run has",
            longer_words(run.transient_cycles, turning=turning is not None and turning.fastest > 0.0),
        )


def _turning(source: Driver | Shaft) -> Turning:
    """The angle of driver or shaft over time, of its first speed where no table gives it."""
    table = source.table if isinstance(source, Driver) else None
    swings = isinstance(source, Driver) and source.swing is not None
    times, speeds = [], [source.speed.value * (TURN if swings else 1.0)]
    if table is not None:
        times = [number.value for number in table.time]
        speeds += [number.value for number in table.later_speed]
    if not times or not all(map(math.isfinite, [*times, *speeds])) or any(b <= a for a, b in pairwise(times)):
        return Turning.even(0.0, speeds[0])  # faults of the table have been reported
    return Turning.by_speeds(0.0, times, speeds)
