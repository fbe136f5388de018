"""Random scenes over the features of the scene file: what is one scene is a pure function of its seed.

In: a seed.  Out: the tables of a scene file, every quantity a text in SI units, so that mutants are plain edits.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
from coupled_scenes import linkage_text
from linkages import GEARED
from random_machines import random_linkage

Tables = dict[str, Any]
KINDS = ("shaft", "one-way", "two-way", "motor", "linkage", "crank")
#: From a seed on: gears and belts, drivers that swing or have a range, shafts of which both rings turn or that tilt.
FURTHER, FIRST = ("gears", "swing", "range", "rings", "tilting"), 300


def amount(text: object) -> float:
    """Number of a quantity in SI units."""
    return float(text.split()[0]) if isinstance(text, str) else float(text)  # type: ignore[arg-type]


def quantity(value: float, unit: str) -> str:
    return f"{float(value)!r} {unit}"


def text(tables: Mapping[str, Any]) -> str:
    """The scene file: values of a table first, then the tables within it."""
    return "\n".join(_lines((), tables)) + "\n"


def _lines(path: tuple[str, ...], table: Mapping[str, Any]) -> Iterable[str]:
    if path:
        yield f"[{'.'.join(path)}]"
    inner = {key: value for key, value in table.items() if isinstance(value, dict)}
    yield from (f"{key} = {_value(value)}" for key, value in table.items() if key not in inner)
    for key, value in inner.items():
        yield from _lines((*path, key), value)


def _value(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else repr(value)


class Draw:
    """Random numbers of a scene, of five digits: what a scene prints is what it is."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 45, 11])

    def number(self, low: float, high: float) -> float:
        return float(f"{self.rng.uniform(low, high):.5g}")

    def size(self, low: float, high: float) -> float:
        """Evenly over orders of magnitude."""
        return float(f"{math.exp(self.rng.uniform(math.log(low), math.log(high))):.5g}")

    def of(self, unit: str, low: float, high: float) -> str:
        return quantity(self.number(low, high), unit)

    def vector(self, unit: str, size: float) -> list[str]:
        return [self.of(unit, -size, size) for _ in range(2)]

    def rising(self, unit: str, low: float, high: float, count: int) -> list[str]:
        """Apart by a tenth of an even share at least."""
        share = (high - low) / count
        return [self.of(unit, low + k * share, low + (k + 0.9) * share) for k in range(count)]

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one(self, values: Sequence[Any]) -> Any:
        return values[int(self.rng.integers(len(values)))]

    def whole(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, high + 1))


def scene(seed: int) -> Tables:
    """Tables of the scene of a seed."""
    draw, kinds = Draw(seed), KINDS if seed < FIRST else FURTHER
    kind = kinds[seed % len(kinds)]
    made = _MADE.get(kind, _machine)(draw, kind)
    return {"title": f"random scene {seed}, {kind}", **made, "run": {"cycles": 1, "outputs": ["*"]}}


# bearings


def bearing(draw: Draw, kind: str) -> Tables:
    """Without what says where it is."""
    roller, ball = draw.chance(0.15), draw.number(6e-3, 9e-3)
    pitch, count = draw.number(3.2e-2, 4e-2), draw.whole(5, 10)
    out: Tables = {"element": "cylindrical-roller"} if roller else {}
    out |= {
        "balls": count,
        "ball_diameter": quantity(ball, "m"),
        "pitch_diameter": quantity(pitch, "m"),
        "clearance": draw.of("m", -6e-6, 2e-5),
        "ball_angle": draw.of("rad", -3, 3),
    }
    geometry = not roller and draw.chance(0.3)
    if not roller and draw.chance(0.25):
        out["contact_angle"] = draw.of("rad", 0.05, 0.5)
    elif geometry and draw.chance(0.4):
        out["axial_displacement"] = draw.of("m", 2e-5, 1e-4)
    contact: Tables = {"stiffness": quantity(draw.size(4e9, 2e10), "N/m^1.5")}
    if roller:
        contact = {"stiffness": quantity(draw.size(3e8, 1e9), "N/m^(10/9)"), "length": quantity(8e-3, "m")}
    if geometry:
        contact = {
            f"{ring}_groove_radius": quantity(draw.number(0.515, 0.53) * ball, "m") for ring in ("inner", "outer")
        }
        contact |= {"young_modulus": draw.of("Pa", 2e11, 2.1e11), "poisson_ratio": draw.number(0.28, 0.31)}
        if draw.chance(0.5):
            contact["ball_material"] = {"young_modulus": "3.1e11 Pa", "poisson_ratio": draw.number(0.25, 0.28)}
    if amount(out["clearance"]) > 1e-6 and draw.chance(0.2):
        contact["smoothing"] = draw.of("m", 2e-8, 3e-7)
    out["contact"] = contact
    out["damping"] = _damping(draw)
    elastic = {
        "mass": draw.of("kg", 0.2, 1),
        "stiffness": draw.of("N/m", 2e7, 9e7),
        "damping": draw.of("N*s/m", 0, 900),
    }
    out["outer_ring"] = {"support": "elastic", **elastic} if draw.chance(0.4) else {"support": "fixed"}
    if kind in ("shaft", "one-way"):
        out["inner_ring"] = {"mass": draw.of("kg", 0.3, 2)}
        if kind == "one-way" and draw.chance(0.3):
            masses = {"ring": draw.of("kg", 0.02, 0.05), "crankpin": draw.of("kg", 0, 0.1)}
            out["inner_ring"] = {"equivalent_mass": {**masses, "crank": draw.one(["whole", "half"])}}
        if draw.chance(0.6):
            out["inner_ring"]["damping"] = draw.of("N*s/m", 50, 900)
    return out | _effects(draw, count, ball * (1 - math.sin(math.pi / count)))


def _damping(draw: Draw) -> Tables:
    law = draw.one(["none", "tangent", "one-sided", "one-sided-gated", "two-sided-gated", "hunt-crossley"])
    viscous = {"coefficient": draw.of("N*s/m", 50, 900)}
    if law == "none":
        return {"law": law}
    if law == "tangent":
        return {"law": law, "ratio": quantity(draw.size(1e-6, 4e-5), "s")}
    if law == "hunt-crossley":
        restitution = {"restitution": draw.number(0.3, 0.9), "impact_speed": draw.of("m/s", 0.05, 0.5)}
        return {"law": law, **(restitution if draw.chance(0.5) else {"hysteresis": draw.of("s/m", 0.1, 4)})}
    if law.startswith("one") and draw.chance(0.2):
        viscous["smoothing"] = draw.of("m/s", 1e-4, 2e-3)
    return {"law": law, **viscous}


def _waves(draw: Draw, orders: Iterable[int]) -> Tables:
    return {str(n): {"amplitude": draw.of("m", 2e-7, 3e-6), "phase": draw.of("rad", -3, 3)} for n in orders}


def _effects(draw: Draw, count: int, room: float) -> Tables:
    """Of a bearing with so many balls, and room for spalls between them."""
    out: Tables = {}
    for ring in ("outer", "inner"):
        if draw.chance(0.3):
            out[f"{ring}_waviness"] = _waves(draw, sorted({draw.whole(1, 14) for _ in range(draw.whole(1, 3))}))
    if draw.chance(0.25):
        out["ball_waviness"] = {"each": _waves(draw, [draw.whole(1, 4)])} | (
            {str(draw.whole(1, count)): _waves(draw, [2])} if draw.chance(0.6) else {}
        )
    if draw.chance(0.25):
        out["ball_deviation"] = {
            str(j): draw.of("m", -3e-6, 3e-6) for j in sorted({draw.whole(1, count) for _ in range(2)})
        }
    spalls: Tables = {}
    for name in ("a", "b"):
        if draw.chance(0.3):
            on, profile = draw.one(["outer", "inner", "ball"]), draw.one(["rectangular", "half-sine", "path"])
            spall: Tables = {"on": on, "profile": profile, "angle": draw.of("rad", -3, 3)}
            spall["chord"] = draw.of("m", 0.3 * room, 0.9 * room)
            if on == "ball":
                spall["ball"] = draw.whole(1, count)
            if profile != "path" or draw.chance(0.3):
                spall["depth"] = draw.of("m", 2e-6, 2e-5)
            spalls[name] = spall
    if spalls:
        out["defects"] = spalls
    cage: Tables = {}
    if draw.chance(0.2):
        cage["ratio"] = draw.number(0.36, 0.42)
    if draw.chance(0.5):
        cage["slip"] = draw.number(-0.02, 0.1)
        if draw.chance(0.5):
            later = draw.rising("s", 0.01, 0.15, draw.whole(1, 2))
            cage["slip"] = {
                "time": ["0.0 s", *later],
                "value": [draw.number(-0.02, 0.2) for _ in range(1 + len(later))],
            }
            if draw.chance(0.5):
                cage["slip"]["lag"] = draw.of("rad", -0.3, 0.3)
    return out | ({"cage": cage} if cage else {})


# shafts


def _shaft(draw: Draw, kind: str) -> Tables:
    speed = draw.number(20, 200) * draw.one([1, -1])
    shaft: Tables = {"speed": quantity(speed, "rad/s")} | ({"ring": "outer"} if draw.chance(0.3) else {})
    kinds = _SHAFT_LOADS[: -1 if "ring" in shaft else None]  # an unbalance turns with the inner ring
    loads = {f"load{k}": _load(draw, draw.one(kinds), speed) for k in range(draw.whole(1, 3))}
    names = ["left", "right"] if draw.chance(0.3) else [""]
    bearings = [bearing(draw, "shaft") | ({"share": draw.number(0.2, 1)} if draw.chance(0.4) else {}) for _ in names]
    where = {"bearing": bearings[0]} if names == [""] else {"bearings": dict(zip(names, bearings, strict=True))}
    return {"shaft": shaft, "loads": loads, **where}


def _rings(draw: Draw, kind: str) -> Tables:
    """Both rings turn, the outer one in either sense and at any speed."""
    made = _shaft(draw, kind)
    made["shaft"].pop("ring", None)
    made["shaft"]["outer_speed"] = draw.of("rad/s", -200, 200)
    return made


def _tilting(draw: Draw, kind: str) -> Tables:
    """A rigid shaft in two or three bearings, loads at places along it; or levers alone in two."""
    made, tilts = _shaft(draw, kind), draw.chance(0.8)
    made.pop("bearing", None)
    names = ("left", "right", "middle")[: 3 if tilts and draw.chance(0.4) else 2]
    made["bearings"] = {}
    for name, place in zip(names, draw.rng.permutation([-0.08, 0.07, 0.01]), strict=False):
        one = bearing(draw, "shaft") | {"position": draw.of("m", place - 0.02, place + 0.02)}
        if tilts:
            one["inner_ring"] = {key: value for key, value in one["inner_ring"].items() if key == "damping"}
            if draw.chance(0.6):
                one["offset"] = draw.vector("m", 1e-5)
        made["bearings"][name] = one
    for load in made["loads"].values():
        if draw.chance(0.8):
            load["position"] = draw.of("m", -0.1, 0.1)
    if tilts:
        made["shaft"] |= {"mass": draw.of("kg", 1, 6), "transverse_inertia": draw.of("kg*m^2", 5e-3, 5e-2)}
        if draw.chance(0.7):
            made["shaft"]["polar_inertia"] = draw.of("kg*m^2", 1e-3, 2e-2)
        if draw.chance(0.7):
            made["shaft"]["center_of_mass"] = draw.of("m", -0.03, 0.03)
        if draw.chance(0.3) and "ring" not in made["shaft"]:
            made["shaft"]["outer_speed"] = draw.of("rad/s", -200, 200)
    return made


_SHAFT_LOADS = ("constant", "constant", "harmonic", "rows over time", "rows over angles", "unbalance")


def _load(draw: Draw, kind: str, speed: float) -> Tables:
    span = 4 * math.pi / abs(speed)
    if kind == "constant":
        out: Tables = {"type": kind, "force": draw.vector("N", 800)}
    elif kind == "harmonic":
        phase: Any = draw.vector("rad", 3) if draw.chance(0.5) else draw.of("rad", -3, 3)
        out = {"type": kind, "mean": draw.vector("N", 300), "amplitude": draw.vector("N", 300)}
        out |= {"frequency": quantity(draw.size(0.1, 20) * abs(speed) / math.tau, "Hz"), "phase": phase}
    elif kind == "unbalance":
        out = {"type": kind, "mass": draw.of("kg", 0.01, 0.2), "eccentricity": draw.of("m", 0.01, 0.05)}
        if draw.chance(0.7):
            out["angle"] = draw.of("rad", -3, 3)
    else:
        rows = draw.rising("s", 0, span, 4) if kind.endswith("time") else draw.rising("rad", -2, 4, 4)
        out = {"type": "table", "time" if kind.endswith("time") else "angle": rows}
        out |= {axis: [draw.of("N", -400, 400) for _ in rows] for axis in "xy"}
    if draw.chance(0.35) and kind in ("constant", "harmonic", "unbalance"):
        start = draw.number(-6, 6)
        out["window"] = {"start": quantity(start, "rad"), "end": quantity(start + draw.number(0.5, 5), "rad")}
    if draw.chance(0.25) and kind in ("constant", "harmonic", "unbalance"):
        out["time_window"] = {"start": draw.of("s", 0, 0.4 * span)}
        if draw.chance(0.6):
            out["time_window"]["end"] = draw.of("s", 0.5 * span, span)
    return out


# linkages


def _crank(draw: Draw, kind: str) -> Tables:
    """A crank alone whose bearing carries all of it: one-way and two-way are the same machine."""
    mass, pin = draw.of("kg", 0.4, 2), quantity(8e-3, "m")
    bodies = {
        "crank": {"mass": mass, "inertia": draw.of("kg*m^2", 1e-4, 1e-3), "center_of_mass": draw.vector("m", 2e-3)}
    }
    bodies["crank"]["points"] = {"A": "origin", "B": pin}
    mechanism: Tables = {
        "driver": {"joint": "A", "speed": quantity(draw.number(20, 100) * draw.one([1, -1]), "rad/s")},
        "frame": {"points": {"A": draw.vector("m", 0.02)}},
        "bodies": bodies,
        "joints": {"A": {"type": "revolute", "bodies": ["frame", "crank"]}},
    }
    mechanism["driver"]["start_angle"] = draw.of("rad", -3, 3)
    if draw.chance(0.5):
        mechanism["gravity"] = draw.vector("m/s^2", 10)
    if draw.chance(0.4):
        mechanism["driver"] |= {"table": _speeds(draw, amount(mechanism["driver"].pop("speed")))}
    mechanism["forces"] = {"push": {"body": "crank", "point": "A", **_amount_of(draw, "force", "N", 300, [0.0])}}
    one = bearing(draw, "one-way")
    one["inner_ring"], one["outer_ring"] = {"mass": mass}, {"support": "fixed"}
    return {"mechanism": mechanism, "bearing": {"joint": "A", "share": 1.0, **one}}


def _speeds(draw: Draw, speed: float) -> Tables:
    rows = draw.rising("s", 0, 6 / abs(speed), draw.whole(2, 4))
    factors = [1.0, *(draw.number(-0.3, 1.5) for _ in rows[1:])]
    return {"time": rows, "speed": [quantity(float(f"{speed * f:.6g}"), "rad/s") for f in factors]}


def _machine(draw: Draw, kind: str) -> Tables:
    machine = random_linkage(draw.rng, draw.whole(0, 999))
    mechanism = tomllib.loads(linkage_text(machine))["mechanism"]
    speed = amount(mechanism["driver"]["speed"])
    mechanism["frame"]["points"]["hook"] = draw.vector("m", 0.5)
    if draw.chance(0.3):
        mechanism.pop("gravity", None)
    if kind == "motor":
        mechanism["driver"]["torque"] = _motor(draw, speed)
    elif draw.chance(0.25):
        mechanism["driver"] |= {"table": _speeds(draw, amount(mechanism["driver"].pop("speed")))}
    _add_loads(draw, mechanism)
    out: Tables = {"mechanism": mechanism}
    if kind == "linkage":
        return out
    if kind == "one-way":
        return out | _one_way(draw, mechanism, mechanism["driver"]["joint"], speed)
    return out | _two_way(draw, mechanism, [])


def _add_loads(draw: Draw, mechanism: Tables) -> None:
    """A flywheel, other forces and torques in place of those of the linkage, springs, stops, friction."""
    driver = mechanism["driver"]
    if draw.chance(0.5) and {"torque", "table", "swing"} & {*driver}:
        driver["flywheel"] = {"inertia": draw.of("kg*m^2", 0.01, 0.3)}
    start = 0.0 if "swing" in driver else amount(driver.get("start_angle", 0.0))
    for table in ("forces", "torques"):
        for force in mechanism.get(table, {}).values():
            name, unit = ("force", "N") if table == "forces" else ("torque", "N*m")
            force.pop(name)
            force |= _amount_of(draw, name, unit, 300 if unit == "N" else 2, [start])
    _add_forces(draw, mechanism)


def _one_way(draw: Draw, mechanism: Tables, joint: str, speed: float) -> Tables:
    """At the driver's joint or a wheel's; the mass of a ring by Eq. (3) is for cranks with two joints."""
    out: Tables = {"bearing": {"joint": joint, "share": draw.number(0.3, 1.0), **bearing(draw, "one-way")}}
    turning = next(body for body in mechanism["joints"][joint]["bodies"] if body != "frame")
    ring, held = out["bearing"]["inner_ring"], [j for j in mechanism["joints"].values() if turning in j["bodies"]]
    if "equivalent_mass" in ring and (joint != mechanism["driver"]["joint"] or len(held) != 2):
        ring |= {"mass": ring.pop("equivalent_mass")["ring"]}
    if draw.chance(0.5):
        out["loads"] = {"own": _load(draw, draw.one(["constant", "harmonic", "rows over time"]), speed)}
        out["loads"]["own"].pop("window", None)
    return out


def _two_way(draw: Draw, mechanism: Tables, rigid: Sequence[str]) -> Tables:
    """In some of the hinges but those that may have no play."""
    joints = mechanism["joints"].items()
    hinges = [name for name, joint in joints if joint["type"] == "revolute" and name not in rigid]
    chosen = [name for name in hinges if draw.chance(0.35)] or [draw.one(hinges)]
    if draw.chance(0.2):
        chosen.append(chosen[0])
    bearings = {}
    for k, joint in enumerate(chosen):
        one = {"joint": joint, "coupling": "two-way", **bearing(draw, "two-way")}
        one |= {"count": draw.whole(1, 2)}
        bearings[f"b{k}"] = one
        one["inner_ring"] = {"body": draw.one(mechanism["joints"][joint]["bodies"])}
        if joint == chosen[0]:
            one["inner_ring"] = bearings["b0"]["inner_ring"]
    return {"bearing": bearings["b0"]} if len(bearings) == 1 and draw.chance(0.5) else {"bearings": bearings}


def _geared(draw: Draw, kind: str) -> Tables:
    """Wheels and belts on the frame and on an arm, of other ratios, any drive, bearings at wheels or elsewhere."""
    name = draw.one(list(GEARED))
    mechanism = tomllib.loads(linkage_text(GEARED[name]()))["mechanism"]
    driver, speed = mechanism["driver"], draw.number(15, 60) * draw.one([1, -1])
    driver |= {"speed": quantity(speed, "rad/s"), "start_angle": draw.of("rad", -3, 3)}
    mechanism["frame"]["points"]["hook"] = draw.vector("m", 0.5)
    for gear in mechanism["gears"].values():
        gear["type"] = draw.one(["external", "internal", "belt"])
        gear["teeth"] = draw.one([[20, 40], [45, 30], [18, 54], [24, 36], [48, 36], [25, 50], [60, 20]])
        gear.pop("radius", None)
        gear.pop("pressure_angle", None)
        if gear["type"] == "belt":
            gear["radius"] = quantity(draw.number(0.002, 0.015) * min(1.0, gear["teeth"][0] / gear["teeth"][1]), "m")
        elif draw.chance(0.5):
            gear["pressure_angle"] = draw.of("rad", 0, 0.5)
        if name != "sector":  # whose wheel is on a rocker, and within half a turn of its angle
            gear |= {key: draw.of("rad", -3, 3) for key in ("first_angle", "second_angle")}
    _other_drive(draw, mechanism, speed)
    _add_loads(draw, mechanism)
    out: Tables = {"mechanism": mechanism}
    if draw.chance(0.3):
        return out
    hinges = {*mechanism["joints"]} & {"A", "E", "I", "S", "P", "F"}  # they hold axes, most of them on the frame
    if {"torque", "swing"} & {*driver} or draw.chance(0.4):
        return out | _two_way(draw, mechanism, [*hinges, *(["D"] if name == "sector" else [])])
    held = [one for one in sorted(hinges) if "frame" in mechanism["joints"][one]["bodies"]]
    out |= _one_way(draw, mechanism, draw.one(held), speed)
    if out["bearing"]["joint"] != driver["joint"]:
        out.pop("loads", None)
    return out


def _other_drive(draw: Draw, mechanism: Tables, speed: float) -> None:
    """In place of a constant speed: a motor, a table or a swing, or neither."""
    driver, drive = mechanism["driver"], draw.one(["speed", "table", "torque", "swing"])
    if drive == "torque":
        driver["torque"] = _motor(draw, speed)
    elif drive != "speed":
        driver.pop("speed")
        driver[drive] = _speeds(draw, speed) if drive == "table" else _swing(draw, 0.3, 9.0)


def _swing(draw: Draw, least: float, most: float) -> Tables:
    amplitude = quantity(draw.size(least, most), "rad")
    return {"amplitude": amplitude, "frequency": draw.of("Hz", 1, 6)}


#: A double rocker, whose driver may turn from 0 to 101 degrees.
ROCKERS = {
    "frame": {"points": {"A": "origin", "D": ["0.1 m", "0 m"]}},
    "bodies": {
        "arm": {"points": {"A": "origin", "B": "0.08 m"}},
        "coupler": {"points": {"B": "origin", "C": "0.06 m"}},
        "rocker": {"points": {"D": "origin", "C": "0.08 m"}},
    },
    "joints": {
        "A": {"type": "revolute", "bodies": ["frame", "arm"]},
        "B": {"type": "revolute", "bodies": ["arm", "coupler"]},
        "C": {"type": "revolute", "bodies": ["coupler", "rocker"], "branch": "left"},
        "D": {"type": "revolute", "bodies": ["frame", "rocker"]},
    },
}


def _limited(draw: Draw, kind: str) -> Tables:
    """A driver that swings or has a range, of a linkage that can turn round or of a double rocker."""
    locks = draw.chance(0.4)
    if locks:
        mechanism = deepcopy(ROCKERS) | {"driver": {"joint": "A"}, "gravity": draw.vector("m/s^2", 10)}
        for body in mechanism["bodies"].values():
            body |= {"mass": draw.of("kg", 0.2, 1), "inertia": draw.of("kg*m^2", 1e-4, 1e-3)}
            body["center_of_mass"] = draw.vector("m", 0.03)
        mechanism["forces"] = {"push": {"body": "rocker", "point": "C", "force": ["1 N", "0 N"]}}
    else:
        mechanism = tomllib.loads(linkage_text(random_linkage(draw.rng, draw.whole(0, 999))))["mechanism"]
    mechanism["frame"]["points"]["hook"] = draw.vector("m", 0.5)
    driver, speed = mechanism["driver"], draw.number(2, 30) * draw.one([1, -1])
    driver.pop("speed", None)
    low, high = (draw.number(0.2, 0.5), draw.number(1.2, 1.6)) if locks else (draw.number(-3, 0), draw.number(0.5, 3))
    if kind == "swing":
        driver["start_angle"] = quantity(0.5 * (low + high), "rad")
        driver["swing"] = _swing(draw, 0.05 if locks else 0.2, 0.5 * (high - low) if locks else 12.0)
    else:
        driver["range"] = {"start": quantity(low, "rad"), "end": quantity(high, "rad")}
        driver["start_angle"] = quantity(low + (high - low) * (0.1 if speed > 0 else 0.9), "rad")
        driver["speed"] = quantity(speed, "rad/s")
        if draw.chance(0.5):
            driver["torque"] = _motor(draw, speed)
    _add_loads(draw, mechanism)
    out: Tables = {"mechanism": mechanism}
    if draw.chance(0.4):
        return out
    if kind == "range" and "torque" not in driver and draw.chance(0.3):
        return out | _one_way(draw, mechanism, driver["joint"], speed)
    return out | _two_way(draw, mechanism, [])


#: By kind; linkages that turn round are the others.
_MADE = {"shaft": _shaft, "crank": _crank, "gears": _geared, "rings": _rings, "tilting": _tilting}
_MADE |= {"swing": _limited, "range": _limited}


def _motor(draw: Draw, speed: float) -> Tables:
    law, sense, size = (
        draw.one(["constant", "linear", "nominal", "table", "asynchronous", "none"]),
        np.sign(speed),
        abs(speed),
    )
    torque = quantity(sense * draw.number(5, 50), "N*m")
    if law == "none":
        return {"law": law}
    if law == "constant":
        return {"law": law, "torque": torque}
    if law == "linear":
        return {"law": law, "no_load_speed": quantity(1.3 * speed, "rad/s"), "stall_torque": torque}
    if law == "nominal":
        nominal = {"nominal_torque": torque, "nominal_speed": quantity(speed, "rad/s")}
        return {"law": "linear", "no_load_speed": quantity(1.1 * speed, "rad/s"), **nominal}
    if law == "table":
        return {
            "law": law,
            "speed": [quantity(f * size, "rad/s") for f in (-1.5, -0.4, 0.5, 1.4)],
            "torque": [draw.of("N*m", -50, 50) for _ in range(4)],
        }
    slip = {"breakdown_slip": draw.number(0.1, 0.4), "synchronous_speed": quantity(1.05 * speed, "rad/s")}
    return {"law": law, "breakdown_torque": torque, **slip}


def _amount_of(draw: Draw, name: str, unit: str, size: float, starts: Sequence[float]) -> Tables:
    """A force or torque: constant, within windows, or by a table over the driver's angle."""
    plain: Any = draw.vector(unit, size) if name == "force" else draw.of(unit, -size, size)
    if draw.chance(0.3):
        turns = draw.one([1, 1, 2])
        rows = draw.rising("rad", starts[0] - 1, starts[0] + 4 * turns, 4 * turns)
        table = {
            "angle": rows,
            name: [draw.of(unit, -size, size) for _ in rows],
            **({"turns": turns} if turns > 1 else {}),
        }
        return {"table": table} | ({"direction": draw.of("rad", -3, 3)} if name == "force" else {})
    if draw.chance(0.5):
        windows = []
        for offset in (-0.4, 1.5)[: draw.whole(1, 2)]:
            begin = starts[0] % math.tau - math.tau * draw.whole(0, 1) + offset + draw.number(0, 0.6)
            windows.append({"start": quantity(begin, "rad"), "end": quantity(begin + draw.number(0.3, 1.1), "rad")})
        if len(windows) == 1 and draw.chance(0.5):
            windows[0]["rise"] = draw.of("rad", 0.03, 0.14)
        return {name: plain, "window": windows if len(windows) > 1 else windows[0]}
    return {name: plain}


def _add_forces(draw: Draw, mechanism: Tables) -> None:
    """Springs, stops and friction."""
    bodies, joints = mechanism["bodies"], mechanism["joints"]
    turning = ["frame", *(name for name, body in bodies.items() if "inertia" in body)]

    def line() -> Tables:
        body = draw.one(list(bodies))
        ends = [("frame", "hook"), (body, draw.one(list(bodies[body]["points"])))]
        ends = ends[::-1] if draw.chance(0.3) else ends
        return {"bodies": [name for name, _ in ends], "points": [point for _, point in ends]}

    def pair() -> Tables:
        return {"bodies": [str(name) for name in draw.rng.choice(turning, 2, replace=False)]}

    def law(unit: str, per: str, size: float, free: Tables) -> Tables:
        out: Tables = {}
        if draw.chance(0.8):
            out = {"stiffness": draw.of(f"{unit}/{per}", 0.1 * size, size), **free}
            if draw.chance(0.3):
                out["cubic_stiffness"] = draw.of(f"{unit}/{per}^3", -size, size)
        if not out or draw.chance(0.5):
            out["damping"] = draw.of(f"{unit}*s/{per}", 0, 0.02 * size)
        return out | ({"preload": draw.of(unit, -0.01 * size, 0.01 * size)} if draw.chance(0.4) else {})

    def put(table: str, name: str, entry: Tables) -> None:
        mechanism.setdefault(table, {})[name] = entry

    if draw.chance(0.4):
        put("springs", "coil", line() | law("N", "m", 3000, {"free_length": draw.of("m", 0.2, 0.7)}))
    if draw.chance(0.3):
        put("torsion_springs", "twist", pair() | law("N*m", "rad", 30, {"free_angle": draw.of("rad", -2, 2)}))
    loss = {"hysteresis": draw.of("s/m", 0, 1)} if draw.chance(0.5) else {}
    if draw.chance(0.3):
        free = {"free_length": draw.of("m", 0.2, 0.8)}
        if draw.chance(0.5):
            free = {"direction": draw.of("rad", -3, 3), "free_distance": draw.of("m", -0.4, 0.4)}
        put("stops", "wall", line() | {"stiffness": draw.of("N/m", 1e4, 2e5), **free, **loss})
    if draw.chance(0.2):
        free = {"stiffness": draw.of("N*m/rad", 100, 1000), "free_angle": draw.of("rad", -3, 3)}
        put("torsion_stops", "limit", pair() | free)
    for name, joint in joints.items():
        if not draw.chance(0.2):
            continue
        table, key, unit, rate = ("friction", "torque", "N*m", "rad")
        if joint["type"] != "revolute":
            table, key, unit, rate = ("guide_friction", "force", "N", "m")
        entry: Tables = {"joint": name, "viscous": draw.of(f"{unit}*s/{rate}", 0, 0.5)}
        if draw.chance(0.6):
            entry |= {key: draw.of(unit, 0, 5), "smoothing": draw.of(f"{rate}/s", 0.5, 1)}
        put(table, f"at_{name}", entry)
