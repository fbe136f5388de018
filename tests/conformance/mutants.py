"""Edits of a scene that leave its machine what it is, and how names and numbers of one read in the other.

In: the tables of a scene.  Out: `Mutant`, or None where the scene has nothing to edit.
"""

from __future__ import annotations

import cmath
import math
import re
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from generator import Tables, amount, quantity
from one_machine import LENGTH, MASS, TIME, scaled
from reference import Reference, vector

TURN = math.tau
Values = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """A machine described in another way.

    Attributes
    ----------
    tables : of its scene
    moved : states and outputs of the first machine, as the second has them
    further : states that only the second has, from a time and its other states
    time : by which times are longer
    scale : by which numbers of a unit are larger
    but : beginnings of names of what differs
    """

    tables: Tables
    moved: Callable[[Values], dict[str, Any]] = dict
    further: Callable[[float, Values], Values] = lambda time, state: {}
    time: float = 1.0
    scale: Callable[[str], float] = lambda unit: 1.0
    but: tuple[str, ...] = ()


def bearings(tables: Tables) -> dict[str, Tables]:
    """By prefix of their names."""
    one = {"": tables["bearing"]} if "bearing" in tables else {}
    return one | {f"{name}.": data for name, data in tables.get("bearings", {}).items()}


def forces(tables: Tables) -> Iterator[tuple[str, Tables]]:
    """Forces and torques of a mechanism, with the name of their amount."""
    mechanism = tables.get("mechanism", {})
    for table in ("forces", "torques"):
        yield from ((table[:-1], entry) for entry in mechanism.get(table, {}).values())


def loads(tables: Tables) -> list[Tables]:
    return [tables["load"]] if "load" in tables else list(tables.get("loads", {}).values())


def windows(tables: Tables) -> list[Tables]:
    """Over angles, wherever they are."""
    entries = [entry for _, entry in forces(tables)] + loads(tables)
    given = [entry["window"] for entry in entries if "window" in entry]
    return [one for several in given for one in (several if isinstance(several, list) else [several])]


def plus(text: str, by: float) -> str:
    return quantity(amount(text) + by, text.split(maxsplit=1)[1])


def minus(text: str) -> str:
    return quantity(-amount(text), text.split(maxsplit=1)[1])


# the same numbers in another form


def as_table_of_speeds(tables: Tables) -> Mutant | None:
    driver = tables.get("mechanism", {}).get("driver", {})
    if "speed" not in driver or "torque" in driver:
        return None
    start, speed = amount(driver.get("start_angle", 0.0)), amount(driver["speed"])
    text = driver.pop("speed")
    driver["table"] = {"time": ["0.0 s", "0.13 s"], "speed": [text, text]}

    def further(time: float, state: Values) -> Values:
        return {"driver.angle": start + speed * time, "driver.speed": speed}

    return Mutant(tables=tables, further=further)


def as_table_of_slips(tables: Tables) -> Mutant | None:
    found = [one["cage"] for one in bearings(tables).values() if isinstance(one.get("cage", {}).get("slip"), float)]
    for cage in found:
        cage["slip"] = {"time": ["0.0 s", "0.02 s"], "value": [cage["slip"]] * 2}
    lags = {f"{prefix}cage.lag{of}": 0.0 for prefix in bearings(tables) for of in ("", "_integral")}
    return (
        Mutant(tables=tables, further=lambda time, state: {n: v for n, v in lags.items() if n not in state})
        if found
        else None
    )


def twice_over_two_turns(tables: Tables) -> Mutant | None:
    found = [(n, e["table"]) for n, e in forces(tables) if "table" in e and e["table"].get("turns", 1) == 1]
    for name, table in found:
        table |= {name: table[name] * 2, "turns": 2}
        table["angle"] = [*table["angle"], *(plus(one, TURN) for one in table["angle"])]
    return Mutant(tables=tables) if found else None


def unbalance_as_harmonic(tables: Tables) -> Mutant | None:
    found = [one for one in loads(tables) if one["type"] == "unbalance"]
    speed = amount(tables["shaft"]["speed"]) if found else 0.0
    for load in found:
        size, sense = amount(load.pop("mass")) * amount(load.pop("eccentricity")) * speed**2, math.copysign(1.0, speed)
        angle = amount(load.pop("angle", 0.0)) * sense
        load |= {"type": "harmonic", "mean": ["0 N", "0 N"], "amplitude": [quantity(size, "N")] * 2}
        phases = [quantity(one, "rad") for one in (angle, angle - sense * math.pi / 2)]
        load |= {"frequency": quantity(abs(speed) / TURN, "Hz"), "phase": phases}
    return Mutant(tables=tables) if found else None


def windows_a_turn_on(tables: Tables) -> Mutant | None:
    found = windows(tables)
    for one in found:
        one |= {edge: plus(one[edge], TURN) for edge in ("start", "end")}
    return Mutant(tables=tables) if found else None


def load_as_rows(tables: Tables) -> Mutant | None:
    found = [one for one in loads(tables) if one["type"] == "constant" and not {"window", "time_window"} & {*one}]
    for load in found:
        x, y = load.pop("force")
        load |= {"type": "table", "time": ["0.0 s", "0.03 s", "0.07 s"], "x": [x] * 3, "y": [y] * 3}
    return Mutant(tables=tables) if found else None


def as_two_way(tables: Tables) -> Mutant | None:
    """A crank without anything that it moves."""
    if {*tables.get("mechanism", {}).get("bodies", {})} != {"crank"}:
        return None
    one = tables["bearing"]
    del one["share"], one["inner_ring"]
    one["coupling"] = "two-way"
    return Mutant(tables=tables, but=("load", "reaction", "drive", "body"))  # the linkage feels the bearing


# more parts that change nothing

_OF_A_BEARING = ("inner.", "outer.", "ball.", "cage.", "ring_force.", "load.")


def _named(tables: Tables) -> Callable[[Values], dict[str, Any]]:
    """A single bearing gets a name."""
    if "bearing" not in tables:
        return dict
    tables["bearings"] = {"one": tables.pop("bearing")}
    return lambda values: {f"one.{n}" if n.startswith(_OF_A_BEARING) else n: v for n, v in values.items()}


def bearing_twice(tables: Tables) -> Mutant | None:
    """Loaded one-way each carries its share; of those coupled two-way two single ones take the place of a pair."""
    if any("position" in one for one in bearings(tables).values()):  # the shaft parts its loads
        return None
    both = [p for p, one in bearings(tables).items() if one.get("coupling") != "two-way" or one.get("count") == 2]
    if not both:
        return None
    moved, twins = _named(tables), {}
    for name, one in list(tables["bearings"].items()):
        if not {f"{name}.", ""} & {*both}:
            continue
        if "count" in one:
            one["count"] = 1
        tables["bearings"][f"{name}b"] = deepcopy(one)
        twins[f"{name}b."] = f"{name}."

    def further(time: float, state: Values) -> Values:
        return {
            new + n.removeprefix(old): v for new, old in twins.items() for n, v in state.items() if n.startswith(old)
        }

    return Mutant(tables=tables, moved=moved, further=further)


def bearing_that_carries_nothing(tables: Tables) -> Mutant | None:
    if not bearings(tables) or any("position" in one for one in bearings(tables).values()):
        return None
    moved = _named(tables)
    first = next(iter(tables["bearings"].values()))
    idle: Tables = {
        key: first[key] for key in ("balls", "ball_diameter", "pitch_diameter", "clearance", "joint") if key in first
    }
    idle |= {"outer_ring": {"support": "fixed"}, "damping": {"law": "none"}}
    if first.get("coupling") == "two-way":
        idle |= {"coupling": "two-way", "contact": {"stiffness": "1e-30 N/m^1.5"}, "inner_ring": first["inner_ring"]}
    else:
        idle |= {"share": 0.0, "contact": {"stiffness": "8e9 N/m^1.5"}, "inner_ring": {"mass": "1.0 kg"}}
    tables["bearings"]["idle"] = idle
    return Mutant(tables=tables, moved=moved)


def spring_without_stiffness(tables: Tables) -> Mutant | None:
    mechanism = tables.get("mechanism", {})
    bodies = [name for name, body in mechanism.get("bodies", {}).items() if "inertia" in body]
    if not bodies:
        return None
    body = bodies[-1]
    mechanism["frame"]["points"]["idle"] = ["0.61 m", "-0.57 m"]
    ends = {"bodies": ["frame", body], "points": ["idle", next(iter(mechanism["bodies"][body]["points"]))]}
    mechanism.setdefault("springs", {})["idle"] = ends | {"stiffness": "0.0 N/m", "free_length": "0.1 m"}
    twist = {"bodies": [body, "frame"], "damping": "0.0 N*m*s/rad"}
    mechanism.setdefault("torsion_springs", {})["idle_twist"] = twist
    return Mutant(tables=tables)


def body_of_three_parts(tables: Tables) -> Mutant | None:
    """Two bars, hinged to a body and to each other: a triangle, which moves with the body that gave their masses."""
    mechanism = tables.get("mechanism", {})
    bodies = [name for name, body in mechanism.get("bodies", {}).items() if "inertia" in body]
    if not bodies:
        return None
    body = mechanism["bodies"][bodies[-1]]
    mass, centre = amount(body["mass"]), vector(body["center_of_mass"])
    corners = [centre + one for one in np.array([[-9e-3, 2e-3], [8e-3, 1e-3], [1e-3, 1.1e-2]])]
    small, own, parts = 0.02 * mass, 1e-6 * mass, [0.5 * (corner + corners[2]) for corner in corners[:2]]
    rest = (mass * centre - small * sum(parts)) / (mass - 2 * small)
    around = sum(own + small * float((one - centre) @ (one - centre)) for one in parts)
    inertia = amount(body["inertia"]) - around - (mass - 2 * small) * float((rest - centre) @ (rest - centre))
    if inertia <= 0.0:
        return None
    body |= {
        "mass": quantity(mass - 2 * small, "kg"),
        "inertia": quantity(inertia, "kg*m^2"),
        "center_of_mass": _pair(rest),
    }
    for k, corner in enumerate(corners[:2]):
        length = float(np.linalg.norm(corners[2] - corner))
        body["points"][f"corner{k}"] = _pair(corner)
        mechanism["bodies"][f"bar{k}"] = {
            "mass": quantity(small, "kg"),
            "inertia": quantity(own, "kg*m^2"),
            "center_of_mass": quantity(0.5 * length, "m"),
            "points": {f"corner{k}": "origin", "top": quantity(length, "m")},
        }
        mechanism["joints"][f"corner{k}"] = {"type": "revolute", "bodies": [bodies[-1], f"bar{k}"]}
    # the top lies to the left of the line from the first corner to the second
    mechanism["joints"]["top"] = {"type": "revolute", "bodies": ["bar0", "bar1"], "branch": "left"}
    return Mutant(tables=tables)


def _pair(place: Any, unit: str = "m") -> list[str]:
    return [quantity(one, unit) for one in place]


# other numbers, names and frames


def balls_renumbered(tables: Tables, steps: int = 2) -> Mutant | None:
    """Another ball is the first."""
    several = bearings(tables)
    for one in several.values():
        one["ball_angle"] = plus(one["ball_angle"], TURN * steps / one["balls"])
        _renumber(one, lambda ball, one=one: (ball - steps - 1) % one["balls"] + 1)
    turned = {p: TURN * steps / one["balls"] for p, one in several.items()}

    def moved(values: Values) -> dict[str, Any]:
        out = {n: np.roll(v, -steps) if np.ndim(v) else v for n, v in values.items()}
        names = [(f"{p}cage.in_{ring}", by) for p, by in turned.items() for ring in ("outer", "inner")]
        return out | {name: out[name] + by for name, by in names if name in out}

    return Mutant(tables=tables, moved=moved) if several else None


def _renumber(one: Tables, number: Callable[[int], int]) -> None:
    waves = {k if k == "each" else str(number(int(k))): v for k, v in one.get("ball_waviness", {}).items()}
    one |= {"ball_waviness": waves} if waves else {}
    if "ball_deviation" in one:
        one["ball_deviation"] = {str(number(int(k))): v for k, v in one["ball_deviation"].items()}
    for spall in one.get("defects", {}).values():
        if "ball" in spall:
            spall["ball"] = number(spall["ball"])


def frame_turned(tables: Tables, by: float = 0.7) -> Mutant:
    def turned(x: float, y: float) -> tuple[float, float]:
        return math.cos(by) * x - math.sin(by) * y, math.sin(by) * x + math.cos(by) * y

    def around(place: Any, unit: str, axis: tuple[float, float] = (1.0, 0.0)) -> list[str]:
        return _pair(turned(*vector(place, axis)), unit)

    mechanism, standing = tables.get("mechanism"), {"frame"}
    if mechanism is not None:
        for _ in mechanism["joints"]:  # what slides on the frame has its axes
            for joint in mechanism["joints"].values():
                standing |= (
                    {*joint["bodies"]} if joint["type"] == "prismatic" and standing & {*joint["bodies"]} else set()
                )
        for name in standing - {"frame"}:
            body = mechanism["bodies"][name]
            body["points"] = {point: around(place, "m") for point, place in body["points"].items()}
            body["center_of_mass"] = around(body["center_of_mass"], "m")
        if "gravity" in mechanism:
            mechanism["gravity"] = around(mechanism["gravity"], "m/s^2", (0.0, -1.0))
        points = mechanism["frame"]["points"]
        points |= {name: around(place, "m") for name, place in points.items()}
        driver, over = mechanism["driver"], 0.0 if "swing" in mechanism["driver"] else by  # its phase
        driver["start_angle"] = plus(driver.get("start_angle", "0.0 rad"), by)
        if "range" in driver:
            driver["range"] = {end: plus(one, by) for end, one in driver["range"].items()}
        for gear in mechanism.get("gears", {}).values():
            arm, _ = Reference.axes(mechanism, gear)
            for key, wheel in zip(("first_angle", "second_angle"), gear["bodies"], strict=True):
                gear[key] = plus(gear.get(key, "0.0 rad"), by * ((arm in standing) - (wheel in standing)))
        entries = [*mechanism["joints"].values(), *mechanism.get("stops", {}).values()]
        for entry in (one for one in entries if "direction" in one and one["bodies"][0] in standing):
            entry["direction"] = plus(entry["direction"], by)
        for table in ("torsion_springs", "torsion_stops"):
            for entry in (one for one in mechanism.get(table, {}).values() if "free_angle" in one):
                sign = (entry["bodies"][0] in standing) - (entry["bodies"][1] in standing)
                entry["free_angle"] = plus(entry["free_angle"], sign * by)
        for _, entry in forces(tables):
            if "force" in entry:
                entry["force"] = around(entry["force"], "N")
            if "direction" in entry:
                entry["direction"] = plus(entry["direction"], by)
            if "table" in entry:
                entry["table"]["angle"] = [plus(one, over) for one in entry["table"]["angle"]]
    for window in windows(tables):
        window |= {edge: plus(window[edge], by if mechanism is None else over) for edge in ("start", "end")}
    for load in loads(tables):
        load |= {key: around(load[key], "N") for key in ("force", "mean") if key in load}
        if load["type"] == "unbalance":
            load["angle"] = plus(load.get("angle", "0.0 rad"), by)
        elif load["type"] == "table":
            rows = [turned(*map(amount, row)) for row in zip(load["x"], load["y"], strict=True)]
            load |= {axis: _pair(column, "N") for axis, column in zip("xy", zip(*rows, strict=True), strict=True)}
        elif load["type"] == "harmonic":
            phase = load["phase"] if isinstance(load["phase"], list) else [load["phase"]] * 2
            x, y = (cmath.rect(amount(a), amount(p)) for a, p in zip(load["amplitude"], phase, strict=True))
            pair = turned(x, y)  # type: ignore[arg-type]
            load |= {"amplitude": _pair(map(abs, pair), "N"), "phase": _pair(map(cmath.phase, pair), "rad")}
    for one in bearings(tables).values():
        one["ball_angle"] = plus(one["ball_angle"], by)
        if "offset" in one:
            one["offset"] = around(one["offset"], "m")
        for ring in ("outer", "inner"):
            for order, wave in one.get(f"{ring}_waviness", {}).items():
                wave["phase"] = plus(wave["phase"], -int(order) * by)
        for spall in one.get("defects", {}).values():
            if spall["on"] != "ball":
                spall["angle"] = plus(spall["angle"], by)

    if mechanism is not None and "swing" in mechanism["driver"]:
        standing.add("drive_angle")

    def moved(values: Values) -> dict[str, Any]:
        out = dict(values)
        for name in values:
            if name.endswith("x") and (other := f"{name[:-1]}y") in values:
                out[name], out[other] = turned(values[name], values[other])
            elif _is_angle(name) and not standing & {*name.split(".")[:2]}:
                out[name] = values[name] + by
        return out

    return Mutant(tables=tables, moved=moved)


def _is_angle(name: str) -> bool:
    return bool(re.fullmatch(r"driver\.angle|drive_angle|body\..*\.angle|(.*\.)?cage\.in_.*", name))


def frame_mirrored(tables: Tables) -> Mutant | None:
    """y, angles and turns have the other sign; a driver cannot swing backwards first."""
    if "swing" in tables.get("mechanism", {}).get("driver", {}):
        return None

    def across(place: Any, unit: str, axis: tuple[float, float] = (1.0, 0.0)) -> Any:
        return _pair(vector(place, axis) * [1.0, -1.0], unit) if place != "origin" else place

    def negate(entry: Tables, *names: str) -> None:
        entry |= {name: [minus(one) for one in entry[name]] if isinstance(entry[name], list) else minus(entry[name])
                  for name in names if name in entry}  # fmt: skip

    def backwards(entry: Tables, over: str, *negated: str) -> None:
        negate(entry, over, *negated)
        entry |= {name: rows[::-1] for name, rows in entry.items() if isinstance(rows, list)}

    for window in windows(tables):
        window |= {"start": minus(window["end"]), "end": minus(window["start"])}
    mechanism = tables.get("mechanism")
    if mechanism is not None:
        if "gravity" in mechanism:
            mechanism["gravity"] = across(mechanism["gravity"], "m/s^2", (0.0, -1.0))
        for body in (mechanism["frame"], *mechanism["bodies"].values()):
            body["points"] = {name: across(place, "m") for name, place in body["points"].items()}
            if "center_of_mass" in body:
                body["center_of_mass"] = across(body["center_of_mass"], "m")
        driver = mechanism["driver"]
        negate(driver, "speed", "start_angle")
        negate(driver.get("table", {}), "speed")
        if "range" in driver:
            driver["range"] = {"start": minus(driver["range"]["end"]), "end": minus(driver["range"]["start"])}
        for gear in mechanism.get("gears", {}).values():
            negate(gear, "first_angle", "second_angle")
        motor = driver.get("torque", {})
        if motor.get("law") == "table":
            backwards(motor, "speed", "torque")
        else:
            negate(motor, "torque", "no_load_speed", "stall_torque", "nominal_torque", "nominal_speed")
            negate(motor, "breakdown_torque", "synchronous_speed")
        for joint in mechanism["joints"].values():
            negate(joint, "direction")
            joint |= (
                {"branch": {"left": "right", "right": "left"}.get(joint["branch"], joint["branch"])}
                if "branch" in joint
                else {}
            )
        for entry in mechanism.get("stops", {}).values():
            negate(entry, "direction")
        for entry in mechanism.get("torsion_springs", {}).values():
            negate(entry, "free_angle", "preload")
        for entry in mechanism.get("torsion_stops", {}).values():
            entry["bodies"] = entry["bodies"][::-1]
        for name, entry in forces(tables):
            if "table" in entry:
                backwards(entry["table"], "angle", *(["torque"] if name == "torque" else []))
            if "force" in entry:
                entry["force"] = across(entry["force"], "N")
            negate(entry, "torque", "direction")
    negate(tables.get("shaft", {}), "speed", "outer_speed")
    for load in loads(tables):
        load |= {key: across(load[key], "N") for key in ("force", "mean", "amplitude") if key in load}
        if load["type"] == "table":
            (negate if "time" in load else lambda entry, name: backwards(entry, "angle", name))(load, "y")
        elif load["type"] == "unbalance":
            negate(load, "angle")
    several = bearings(tables)
    for one in several.values():
        negate(one, "ball_angle")
        one |= {"offset": across(one["offset"], "m")} if "offset" in one else {}
        for waves in (
            one.get("outer_waviness", {}),
            one.get("inner_waviness", {}),
            *one.get("ball_waviness", {}).values(),
        ):
            for wave in waves.values():
                negate(wave, "phase")
        for spall in one.get("defects", {}).values():
            negate(spall, "angle")
        if isinstance(one.get("cage", {}).get("slip"), dict):
            negate(one["cage"]["slip"], "lag")
        _renumber(one, lambda ball, one=one: (1 - ball) % one["balls"] + 1)

    turns = ("drive_torque", "driver.", "torsion_spring.", "friction.")

    def moved(values: Values) -> dict[str, Any]:
        return {
            name: np.roll(value[::-1], 1)
            if np.ndim(value)
            else -value
            if name.endswith(("y", "moment")) or name.startswith(turns) or _is_angle(name) or "cage.lag" in name
            else value
            for name, value in values.items()
        }

    return Mutant(tables=tables, moved=moved)


def other_units(tables: Tables) -> Mutant:
    """Of length, mass and time, by powers of four."""

    def scale(unit: str) -> float:
        return scaled(unit, LENGTH, MASS, TIME)

    def changed(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: changed(one) for key, one in value.items()}
        if isinstance(value, list):
            return [changed(one) for one in value]
        number, _, unit = value.partition(" ") if isinstance(value, str) else ("", "", "")
        try:
            return quantity(float(number) * scale(unit), unit) if unit else value
        except ValueError:  # a text
            return value

    title = tables.pop("title")
    return Mutant(tables={"title": title, **changed(tables)}, scale=scale, time=TIME)


MUTANTS: Mapping[str, Callable[[Tables], Mutant | None]] = {
    "constant speed as a table": as_table_of_speeds,
    "slip as a table": as_table_of_slips,
    "table twice over two turns": twice_over_two_turns,
    "unbalance as a harmonic load": unbalance_as_harmonic,
    "windows a turn on": windows_a_turn_on,
    "load as equal rows over time": load_as_rows,
    "a bearing as two": bearing_twice,
    "one-way as two-way": as_two_way,
    "frame turned": frame_turned,
    "frame mirrored": frame_mirrored,
    "other units": other_units,
    "a spring without stiffness": spring_without_stiffness,
    "a body of three parts": body_of_three_parts,
    "balls renumbered": balls_renumbered,
    "a bearing that carries nothing": bearing_that_carries_nothing,
}


def mutant(name: str, tables: Tables) -> Mutant | None:
    """Of a copy of the tables."""
    return MUTANTS[name](deepcopy(tables))
