"""Scenes with bearings in any joint, as text, and their derived equations evaluated without a compiler."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
from linkages import Machine

from ballpass.derive import derive
from ballpass.derive.lowering.functions import _Lowering
from ballpass.derive.mechanism.forces import PointForce
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.mechanism_records import NamedPoint
from ballpass.derive.scene.quantity import SceneNumber, Vector
from ballpass.derive.scene.records import Scene, quantities_of
from ballpass.derive.variables import Input
from ballpass.runtime.time.turning import Turning

UNDAMPED = 'law = "none"'
TANGENT = 'law = "tangent"\nratio = "2.5e-5 s"'
ONE_SIDED = 'law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"'
GATED = 'law = "two-sided-gated"\ncoefficient = "300 N*s/m"'
HUNT = 'law = "hunt-crossley"\nhysteresis = "4 s/m"'
HERTZ = """inner_groove_radius = "4.1275 mm"
outer_groove_radius = "4.206875 mm"
young_modulus = "207 GPa"
poisson_ratio = 0.3
ball_material = { young_modulus = "310 GPa", poisson_ratio = 0.27 }"""
#: Every effect; balls are in spalls of each ring most of the time.
EFFECTS = """[bearing.outer_waviness]
7 = { amplitude = "3 um", phase = "0.4 rad" }
[bearing.inner_waviness]
9 = { amplitude = "2 um", phase = "0.3 rad" }
[bearing.ball_waviness.3]
2 = { amplitude = "2 um", phase = "0.6 rad" }
[bearing.ball_waviness.each]
4 = { amplitude = "1 um", phase = "1 rad" }
[bearing.ball_deviation]
5 = "-2 um"
[bearing.cage]
slip = 0.03
"""
CHANGING_SLIP = """[bearing.cage]
slip = { time = ["0 s", "0.03 s", "0.07 s"], value = [0.0, 0.3, 0.05], lag = "2 deg" }
"""
LAGGING = EFFECTS.replace("[bearing.cage]\nslip = 0.03\n", CHANGING_SLIP)
#: Rows so long that the slip is another than in the end at any time that is drawn.
LAGGING_LONG = LAGGING.replace("0.07 s", "2 s")
SPALLS = "".join(
    f'[bearing.defects.{name}]\non = "{on}"\n{"ball = 2" if on == "ball" else ""}\nangle = "{angle} deg"\n'
    f'chord = "{chord} mm"\nprofile = "{profile}"\n{depth}\n'
    for name, on, angle, chord, profile, depth in (
        ("a", "outer", 250, 4, "path", ""),
        ("b", "outer", 20, 3, "half-sine", 'depth = "8 um"'),
        ("c", "inner", 120, 3, "path", 'depth = "60 um"'),
        ("d", "inner", -70, 2, "rectangular", 'depth = "5 um"'),
        ("e", "ball", 40, 5, "path", ""),
    )
)
LAWS = (UNDAMPED, TANGENT, ONE_SIDED, GATED, HUNT)


def bearing(
    joint: str,
    inner: str = "",
    *,
    law: str = TANGENT,
    elastic: bool = False,
    count: float | None = None,
    clearance: str = "10 um",
    housing_damping: str = "500 N*s/m",
    balls: int = 8,
    stiffness: float | None = 8.6e9,
    effects: str = "",
    angle: str = "",
    beside: str = "",
    position: str = "",
    offset: str = "",
) -> str:
    """Tables of a bearing coupled two-way at a joint; `inner` carries the inner ring; no stiffness: from geometry.

    One of several at the joint has a name that `beside` makes different.
    """
    name = f"bearings.{beside}at_{joint}"
    support = 'support = "fixed"'
    if elastic:
        support = f'support = "elastic"\nmass = "0.5 kg"\nstiffness = "5e7 N/m"\ndamping = "{housing_damping}"'
    return f"""
[{name}]
joint = "{joint}"
coupling = "two-way"
balls = {balls}
ball_diameter = "7.9375 mm"
pitch_diameter = "33.5 mm"
clearance = "{clearance}"
ball_angle = "17 deg"
{f'contact_angle = "{angle}"' if angle else ""}
{"" if count is None else f"count = {count}"}
{f'position = "{position}"' if position else ""}
{f"offset = {offset}" if offset else ""}
[{name}.contact]
{HERTZ if stiffness is None else f'stiffness = "{stiffness!r} N/m^1.5"'}
[{name}.damping]
{law}
[{name}.outer_ring]
{support}
{f'[{name}.inner_ring]{chr(10)}body = "{inner}"' if inner else ""}
{effects.replace("[bearing.", f"[{name}.")}
"""


#: Outputs on request that a balance of powers takes.
POWERS = ("*.power", "drive_power", "kinetic_energy")
RUN = '\n[run]\ncycles = 1\noutputs = ["*"]\n'


def with_bearings(text: str, *bearings: str) -> Scene:
    """The mechanism of a scene's text, with other bearings; without any the scene as it is."""
    if not bearings:
        return scene_from_text(text, "coupled")
    return scene_from_text(text.partition("[bearing]")[0] + "".join(bearings) + RUN, "coupled")


class Derived:
    """Accelerations, outputs and ball angles of a scene, from the derived equations as CasADi evaluates them.

    `changes` are other values of parameters, by path; `further` are patterns of outputs on request.
    """

    def __init__(self, scene: Scene, changes: Mapping[str, float] = {}, further: tuple[str, ...] = ()) -> None:
        self.scene = replace(scene, outputs=("*", *further))
        self.system = system = derive(self.scene)
        lowering = _Lowering(system)  # less than `lower`: no derivatives, which take seconds
        balls, visit = lowering._balls(lowering.visit), lowering.visit
        outputs = lowering._outputs(balls)
        results = [
            lowering._rhs(balls) if system.coordinates else ca.SX(0, 1),
            ca.vertcat(*outputs.values()),
            ca.vertcat(*(visit(b.ball.cage.angle) for b in system.bearings)),
            ca.vertcat(*(visit(e) for p in system.linkage.points for e in (p.x, p.y))),
            lowering._moving(visit, balls)(system.reactions.drive_torque),
        ]
        c, once = lowering._constants()
        self._function = ca.Function("all", [lowering.t, lowering.x, lowering.u, lowering.p, c], results)
        self._once = ca.Function("constants", [lowering.p], [once])
        self.names: list[str] = []
        for output, value in zip(system.outputs, outputs.values(), strict=True):
            self.names += [output.name] + [""] * (value.numel() - 1)
        self.coordinates = [c.name for c in system.coordinates]
        self.change(changes)

    def change(self, changes: Mapping[str, float]) -> None:
        """Take other values of parameters, by path."""
        self.values = {q.name: q.default for q in self.system.parameters} | dict(changes)
        self._p = np.array([self.values[q.name] for q in self.system.parameters])
        self._c = self._once(self._p)
        constants = zip(self.system.constants, self._c.full()[:, 0], strict=False)  # more are hoisted
        self._known = self.values | {c.symbol.name: float(v) for c, v in constants}

    @property
    def initial(self) -> np.ndarray:
        """State at the start."""
        return np.array([self.values[name] for name in self.system.initial])

    def at(self, t: float, x: np.ndarray, gates: Mapping[str, float]) -> list[np.ndarray]:
        """Rates of the states, outputs, angles of the first balls, places of points, torque by the balances."""
        uneven = any(one.times or one.turns for one in self.system.turnings)
        turned = {one.name: Turning.of(one, self._known).held(t if uneven else 0.0, t) for one in self.system.turnings}

        def value(i: Input) -> float:
            if i.kind in ("phase", "angle", "rate", "slope") and i.turning is not None:
                return float(turned[i.turning.name][{"rate": 1, "slope": 2}.get(i.kind, 0)])
            if i.kind == "table_rate":
                return self._slope(i, t)
            # no side of a window is held
            return 0.0 if i.kind == "border" else gates[i.name.removeprefix("gate.")]

        inputs = [value(i) for i in self.system.inputs]
        local = 0.0 if uneven else t  # time since the reference time
        return [part.full()[:, 0] for part in self._function(local, x, inputs, self._p, self._c)]

    def _slope(self, table: Input, t: float) -> float:
        """Of a table over time, flat before its first row and behind its last."""
        times, heights = (np.array([self._known[name] for name in column]) for column in (table.times, table.values))
        return float(np.concatenate([[0.0], np.diff(heights) / np.diff(times), [0.0]])[np.searchsorted(times, t)])

    def gates(self, value: float = 0.0) -> dict[str, float]:
        return {i.name.removeprefix("gate."): value for i in self.system.inputs if i.kind == "gate"}

    def spall_gates(self, t: float) -> dict[str, float]:
        """Gates of spalls that balls pass evenly."""
        known, found = self._known, {}
        for gate in self.system.inputs:
            if gate.kind == "gate" and "defects." in gate.name and (turning := gate.turning) is not None:
                ((first, last),) = gate.windows
                angle = gate.parts * float(Turning.of(turning, known).at(t)[0])
                past = (angle - known[first]) % (2 * np.pi)
                found[gate.name.removeprefix("gate.")] = float(past < known[last] - known[first])
        return found

    def rhs(self, t: float, x: np.ndarray, gates: Mapping[str, float]) -> np.ndarray:
        return self.at(t, x, gates)[0]

    def outputs(self, t: float, x: np.ndarray, gates: Mapping[str, float]) -> dict[str, float]:
        values = self.at(t, x, gates)[1]
        return {name: float(value) for name, value in zip(self.names, values, strict=True) if name}

    def ball_angles(self, t: float, x: np.ndarray) -> np.ndarray:
        return self.at(t, x, self.gates())[2]

    def points(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Points of the linkage without play at the start, by body and name [m]."""
        x = np.zeros(2 * len(self.coordinates))
        if "driver.angle" in self.coordinates:
            x[self.coordinates.index("driver.angle")] = self.values["mechanism.driver.start_angle"]
        found = self.at(0.0, x, self.gates())[3].reshape(-1, 2)
        assert self.system.linkage is not None
        return {
            (p.body, p.point): (float(x), float(y)) for p, (x, y) in zip(self.system.linkage.points, found, strict=True)
        }


def linkage_text(machine: Machine) -> str:
    """The mechanism of a linkage built as records, as a scene file has it."""
    mechanism, values = machine.mechanism, machine.values

    def amount(quantity: SceneNumber) -> str:
        return f'"{float(values[quantity.path])!r} {"" if quantity.unit == "1" else quantity.unit}"'

    def vector(place: Vector) -> str:
        numbers = [amount(q) for q in quantities_of(place)]
        if len(numbers) < 2:
            return numbers[0] if numbers else '"origin"'
        if place.kind == "cartesian":
            return f"[{', '.join(numbers)}]"
        return f"{{ distance = {numbers[0]}, angle = {numbers[1]} }}"

    def places(points: Iterable[NamedPoint]) -> str:
        return "".join(f"{p.name} = {vector(p.position)}\n" for p in points)

    driver = mechanism.driver
    lines = ["[mechanism]"]
    if mechanism.gravity is not None:
        lines.append(f"gravity = {vector(mechanism.gravity)}")
    lines += ["[mechanism.driver]", f'joint = "{driver.joint}"', f"speed = {amount(driver.speed)}"]
    lines += [f"start_angle = {amount(driver.start_angle)}", "[mechanism.frame.points]", places(mechanism.frame_points)]
    for body in mechanism.bodies:
        lines += [f"[mechanism.bodies.{body.name}]", f"mass = {amount(body.mass)}"]
        lines += [f"inertia = {amount(body.inertia)}"] if body.inertia is not None else []
        lines += [f"center_of_mass = {vector(body.center_of_mass)}", f"[mechanism.bodies.{body.name}.points]"]
        lines.append(places(body.points))
    for joint in mechanism.joints:
        lines += [f"[mechanism.joints.{joint.name}]", f'type = "{joint.kind}"', f"bodies = {list(joint.bodies)}"]
        lines.append(f"points = {list(joint.points)}")
        lines += [f"direction = {amount(joint.direction)}"] if joint.direction is not None else []
        lines += [f'branch = "{joint.branch}"'] if joint.branch is not None else []
    for gear in mechanism.gears:
        lines += [f"[mechanism.gears.{gear.name}]", f'type = "{gear.kind}"', f"bodies = {list(gear.bodies)}"]
        lines += [f"teeth = {list(gear.teeth)}", f"pressure_angle = {amount(gear.pressure_angle)}"]
        lines += [f"radius = {amount(gear.radius)}"] if gear.radius is not None else []
        lines += [f"first_angle = {amount(gear.first_angle)}", f"second_angle = {amount(gear.second_angle)}"]
    for force in mechanism.forces:
        lines += [f"[mechanism.{force.table}.{force.name}]", f'body = "{force.pathway.body}"']
        if isinstance(force.pathway, PointForce):
            lines += [f'point = "{force.pathway.point}"', f"force = {vector(force.pathway.force)}"]
        else:
            lines.append(f"torque = {amount(force.pathway.torque)}")
    return "\n".join(lines) + "\n"
