"""A machine with bearings in maximal coordinates: slow, plain, in one file, from the tables of a scene file alone.

In: tables as `generator.scene` gives them, a time, a state by name.  Out: rates of the state and outputs, by name.

Written from docs/theory and docs/reference, without any module of ballpass.  Bodies have x, y of the centre of mass and
an angle, elastic outer rings of bearings coupled two-way x and y; joints and a driver of known motion are constraints;
accelerations and reactions come from one linear system.  Balls are forces between points.

Not covered (`missing` says so): fits, lubrication and other settings of ratings, designations, columns of files,
jitter, roughness, rollers without a given stiffness, tilting shafts of mechanisms.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

TURN = 2 * math.pi
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
Tables = Mapping[str, Any]
Array = np.ndarray


def number(value: Any) -> float:
    return float(value.split()[0]) if isinstance(value, str) else float(value)


def vector(value: Any, axis: tuple[float, float] = (1.0, 0.0)) -> Array:
    """Origin, axis, cartesian or polar."""
    if value == "origin":
        return np.zeros(2)
    if isinstance(value, str):
        return number(value) * np.array(axis)
    if isinstance(value, Mapping):
        size, angle = (number(one) for one in value.values())  # in this order in scenes of the tests
        return size * unit(angle)
    return np.array([number(one) for one in value])


def unit(angle: float) -> Array:
    return np.array([math.cos(angle), math.sin(angle)])


def rotated(angle: float, arm: Array) -> Array:
    return arm[0] * unit(angle) + arm[1] * (QUARTER @ unit(angle))


def within(angle: float, start: Any, end: Any) -> bool:
    return (angle - number(start)) % TURN < (number(end) - number(start)) % TURN


def windows(entry: Tables) -> list[Tables]:
    given = entry.get("window", [])
    return list(given) if isinstance(given, list) else [given]


def missing(scene: Tables) -> list[str]:
    """What of a scene this file does not cover."""
    unknown = {"fit", "designation", "jitter", "roughness", "file"}

    def found(table: Any) -> Iterator[str]:
        for key, value in table.items() if isinstance(table, Mapping) else ():
            if key in unknown:
                yield key
            yield from found(value)

    return list(found(scene))


# bearings


class Bearing:
    """Balls between two rings.

    `name` is the prefix of its outputs; `stands` says whether the inner ring is the one that stands.
    """

    def __init__(self, name: str, data: Tables, stands: bool) -> None:
        self.name, self.data, self.stands = name, data, stands
        self.balls = data["balls"]
        self.ball, self.pitch = number(data["ball_diameter"]), number(data["pitch_diameter"])
        self.count = float(data.get("count", 1))
        self.elastic = data["outer_ring"]["support"] == "elastic"
        self.cosine, self.gap = math.cos(number(data.get("contact_angle", 0.0))), 0.5 * number(data["clearance"])
        contact = data["contact"]
        if "axial_displacement" in data:
            whole = number(contact["inner_groove_radius"]) + number(contact["outer_groove_radius"]) - self.ball
            left = whole - self.gap
            self.cosine = math.cos(math.atan2(number(data["axial_displacement"]), left))
            self.gap = (whole - left / self.cosine) / self.cosine
        self.exponent = 10 / 9 if data.get("element") == "cylindrical-roller" else 1.5
        self.stiffness = number(contact["stiffness"]) if "stiffness" in contact else self._hertz(contact)
        cage = data.get("cage", {})
        self.share = float(cage.get("ratio", 0.5 * (1 - self.cosine * self.ball / self.pitch)))
        slip = cage.get("slip", 0.0)
        self.slips = slip if isinstance(slip, Mapping) else {"time": [0.0], "value": [slip]}

    def _hertz(self, contact: Tables) -> float:
        """K. L. Johnson, Contact Mechanics, Eqs. 4.25 to 4.28, both contacts in series."""
        balls = contact.get("ball_material", contact)
        compliance = sum((1 - m["poisson_ratio"] ** 2) / number(m["young_modulus"]) for m in (contact, balls))
        total = 0.0
        for ring, sign in (("inner", 1), ("outer", -1)):
            raceway = sign * 0.5 * (self.pitch / self.cosine - sign * self.ball)
            across = 1 / self.ball - 0.5 / number(contact[f"{ring}_groove_radius"])
            along = 1 / self.ball + 0.5 / raceway
            low, high = sorted((across, along))

            def ratio_of(log: float) -> tuple[float, float, float]:
                m = -math.expm1(-2 * log)
                return math.exp(log), float(ellipk(m)), float(ellipe(m))

            def residual(log: float, wanted: float = high / low) -> float:
                r, k, e = ratio_of(log)
                return math.log((r**2 * e - k) / (k - e) / wanted)

            r, k, e = ratio_of(brentq(residual, 1e-3, 12.0, xtol=1e-15, rtol=1e-15))
            cube = 0.75 * compliance / (2 * math.sqrt(low * high))
            cube *= 4 / (math.pi * (1 - r**-2)) * r**-1.5 * math.sqrt((r**2 * e - k) * (k - e))
            total += 1.5 * compliance * k / (math.pi * cube ** (1 / 3) * math.sqrt(r))
        return total**-1.5

    def weights(self, slip: float) -> Array:
        """By how much the cage turns with the inner and the outer ring."""
        if self.stands:
            return np.array([1 - (1 - self.share) * (1 - slip), (1 - self.share) * (1 - slip)])
        return np.array([self.share * (1 - slip), 1 - self.share * (1 - slip)])

    def slip(self, time: float) -> float:
        rows = zip(self.slips["time"], self.slips["value"], strict=True)
        return [value for start, value in rows if number(start) <= time][-1]

    @property
    def last(self) -> Array:
        return self.weights(self.slips["value"][-1])

    def lag(self, time: float, turned: Any) -> float:
        """Behind a cage with the last slip; `turned` gives the angles of both rings at a time."""
        times = [number(row) for row in self.slips["time"]]
        edges, total = [*(row for row in times if row < time), time], number(self.slips.get("lag", 0.0))
        for begin, end in pairwise(edges):
            lost = self.last - self.weights(self.slip(0.5 * (begin + end)))
            total += float(lost @ (np.array(turned(end)) - np.array(turned(begin))))
        return total

    def effects(self, j: int, angle: complex, outer: complex, inner: complex, spin: complex) -> complex:
        """What is taken from the deflection of a ball."""
        total = 0j
        for ring, seen in (("outer", outer), ("inner", inner)):
            for order, wave in self.data.get(f"{ring}_waviness", {}).items():
                total -= number(wave["amplitude"]) * cmath.cos(int(order) * seen + number(wave["phase"]))
        for whose, waves in self.data.get("ball_waviness", {}).items():
            for order, wave in waves.items() if whose in ("each", str(j + 1)) else ():
                for contact in (spin, spin + math.pi):
                    total -= number(wave["amplitude"]) * cmath.cos(int(order) * contact + number(wave["phase"]))
        total -= number(self.data.get("ball_deviation", {}).get(str(j + 1), 0.0))
        for spall in self.data.get("defects", {}).values():
            if spall["on"] == "ball":
                if spall["ball"] == j + 1:
                    total += self._sunk(spall, "outer", spin) + self._sunk(spall, "inner", spin - math.pi)
            else:
                total += self._sunk(spall, spall["on"], outer if spall["on"] == "outer" else inner)
        return total

    def _sunk(self, spall: Tables, ring: str, angle: complex) -> complex:
        """How far the distance of the centres of ball and raceway changes, two circles that an edge holds apart."""
        small = 0.5 * self.ball
        large = 0.5 * self.pitch + (small if ring == "outer" else -small) * self.cosine
        own = small if spall["on"] == "ball" else large
        half = math.asin(number(spall["chord"]) / 2 / own)
        past = angle - number(spall["angle"])
        past -= TURN * round(past.real / TURN)
        if abs(past.real) >= half:
            return 0j
        depth = number(spall.get("depth", math.inf))
        if spall["profile"] == "rectangular":
            return complex(depth)
        if spall["profile"] == "half-sine":
            return depth * cmath.cos(math.pi * own * cmath.sin(past) / number(spall["chord"]))
        beta = half - past if past.real > 0 else half + past  # of the edge against the line of centres
        other = large if own == small else small
        reach = cmath.sqrt(other**2 - (own * cmath.sin(beta)) ** 2)
        if ring == "inner":
            sunk = own + other - own * cmath.cos(beta) - reach
        else:
            sunk = (own * cmath.cos(beta) - reach - (own - other)) * (1 if own > other else -1)
        return sunk if sunk.real < depth else complex(depth)

    def force(self, delta: float, rate: float) -> tuple[float, float]:
        """Elastic and damping force of a ball."""
        width = number(self.data["contact"].get("smoothing", 0.0))
        law, pressed, open_ = self.data["damping"], ramp(delta, width), step(delta, width)
        elastic = self.stiffness * pressed**self.exponent
        name = law["law"]
        if name == "none":
            return elastic, 0.0
        if name == "tangent":
            slope = self.exponent * self.stiffness * pressed ** (self.exponent - 1) * open_
            return elastic, number(law["ratio"]) * slope * rate
        if name == "hunt-crossley":
            factor = number(law["hysteresis"]) if "hysteresis" in law else 0.0
            if "restitution" in law:
                factor = 3 * (1 - law["restitution"] ** 2) / (4 * number(law["impact_speed"]))
            return elastic, factor * elastic * rate
        viscous = number(law["coefficient"]) if "coefficient" in law else number(law["ratio"]) * self.stiffness
        if name == "two-sided-gated":
            return elastic, viscous * rate * open_
        one_sided = viscous * ramp(rate, number(law.get("smoothing", 0.0)))
        return elastic, one_sided * (open_ if name == "one-sided-gated" else 1.0)

    def contacts(
        self, time: float, apart: Array, speed: Array, turned: Array, rates: Array, lag: float
    ) -> tuple[dict[str, Any], list[tuple[float, Array, float, float]]]:
        """Outputs, and of each ball its force, direction in the plane, lever of the cage's turn, slope of effects."""
        now = self.weights(self.slip(time))
        first = number(self.data.get("ball_angle", 0.0)) + float(self.last @ turned) - lag
        passed, tiny = self.cosine + self.pitch / self.ball, 1e-200j
        spin = passed * (first - number(self.data.get("ball_angle", 0.0)) - turned[1])
        found: dict[str, list[float]] = {name: [] for name in ("deflection", "elastic_force", "damping_force", "force")}
        balls, total = [], np.zeros(2)
        for j in range(self.balls):
            angle = first + TURN * j / self.balls
            effect = self.effects(
                j,
                angle,
                angle - turned[1] + now[0] * tiny,
                angle - turned[0] + (now[0] - 1) * tiny,
                spin + passed * now[0] * tiny,
            )
            slope, along = effect.imag / tiny.imag, self.cosine * unit(angle)
            lever = float(apart @ QUARTER @ along)
            delta = float(apart @ along) - self.cosine * self.gap - effect.real
            rate = float(speed @ along) + lever * float(now @ rates) - slope * float(rates[0] - rates[1])
            elastic, damping = self.force(delta, rate)
            for name, value in zip(found, (delta, elastic, damping, elastic + damping), strict=True):
                found[name].append(value)
            total += (elastic + damping) * along
            balls.append((elastic + damping, along, lever, slope))
        outputs: dict[str, Any] = {f"ball.{name}": np.array(values) for name, values in found.items()}
        outputs |= {"ring_force.x": total[0], "ring_force.y": total[1]}
        outputs |= {"cage.in_outer": first - turned[1], "cage.in_inner": first - turned[0]}
        return {self.name + name: value for name, value in outputs.items()}, balls


def ramp(z: float, width: float) -> float:
    if width == 0.0 or abs(z) >= width:
        return max(z, 0.0)
    v = 0.5 * (1 + z / width)
    return width * v**4 * (2 * v**2 - 6 * v + 5)


def step(z: float, width: float) -> float:
    if width == 0.0 or abs(z) >= width:
        return float(z > 0)
    v = 0.5 * (1 + z / width)
    return v**3 * (6 * v**2 - 15 * v + 10)


# the machine


class Reference:
    """A scene's machine."""

    def __init__(self, scene: Tables) -> None:
        assert not missing(scene)
        self.scene, self.mechanism = scene, scene.get("mechanism")
        tables = {"": scene["bearing"]} if "bearing" in scene else scene.get("bearings", {})
        self.bearings = [Bearing(f"{name}." if name else "", data, self._stands(data)) for name, data in tables.items()]
        self.two_way = any(one.data.get("coupling") == "two-way" for one in self.bearings)
        if self.mechanism is None:
            return
        self.bodies, self.joints = self.mechanism["bodies"], self.mechanism["joints"]
        self.index = {name: 3 * k for k, name in enumerate(self.bodies)}
        self.rings = {}
        if self.two_way:
            elastic = [one.name for one in self.bearings if one.elastic]
            self.rings = {name: 3 * len(self.bodies) + 2 * k for k, name in enumerate(elastic)}
        self.gears = self.mechanism.get("gears", {})
        self.size = 3 * len(self.bodies) + 2 * len(self.rings)
        self.driver = self.mechanism["driver"]
        self.driven = next(b for b in self.joints[self.driver["joint"]]["bodies"] if b != "frame")
        self.start = number(self.driver.get("start_angle", 0.0))
        self.at_joint: dict[str, list[Bearing]] = {}
        for one in self.bearings if self.two_way else ():
            self.at_joint.setdefault(one.data["joint"], []).append(one)
        self.exact = {"frame": 0.0, self.driven: 1.0}  # turns of bodies in proportion to the driver's
        for _ in self.gears:
            for gear in self.gears.values():
                (one, two), ratio = gear["bodies"], self._ratio(gear)
                arm = self.exact.get(self.axes(self.mechanism, gear)[0])
                if arm is not None and one in self.exact:
                    self.exact[two] = arm + ratio * (self.exact[one] - arm)
                elif arm is not None and two in self.exact:
                    self.exact[one] = arm + (self.exact[two] - arm) / ratio
        self.first_pose = self._assembled()
        self._poses = [(self.start, self.first_pose)]  # of the ideal linkage, known so far
        self._means: dict[tuple[str, str], float | None] = {}

    def _stands(self, data: Tables) -> bool:
        if "shaft" in self.scene:
            return self.scene["shaft"].get("ring", "inner") == "outer"
        if data.get("coupling") != "two-way":
            return False
        standing, joints = {"frame"}, self.scene["mechanism"]["joints"].values()
        for _ in joints:  # what slides on a body that stands does not turn
            standing |= {
                b for j in joints if j["type"] == "prismatic" and standing & {*j["bodies"]} for b in j["bodies"]
            }
        return self._rings_of(data)[0] in standing

    def _rings_of(self, data: Tables) -> tuple[str, str]:
        """Bodies that carry the inner and the outer ring; the inner one is the moving body where nothing is said."""
        first, second = self.scene["mechanism"]["joints"][data["joint"]]["bodies"]
        inner = data.get("inner_ring", {}).get("body", second if first == "frame" else first)
        return inner, first if inner == second else second

    # positions

    def arm(self, body: str, point: str) -> Array:
        if body == "frame":
            return vector(self.mechanism["frame"]["points"][point])
        data = self.bodies[body]
        return vector(data["points"][point]) - vector(data["center_of_mass"])

    def angle(self, body: str, q: Array) -> float:
        return 0.0 if body == "frame" else float(q[self.index[body] + 2])

    def row(self, body: str) -> Array:
        out = np.zeros(self.size)
        if body != "frame":
            out[self.index[body] + 2] = 1.0
        return out

    def point(self, body: str, arm: Array, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Position, Jacobian, and the acceleration without accelerations of coordinates."""
        jacobian = np.zeros((2, self.size))
        if body == "frame":
            return arm, jacobian, np.zeros(2)
        k, out = self.index[body], rotated(self.angle(body, q), arm)
        jacobian[:, k : k + 2], jacobian[:, k + 2] = np.eye(2), QUARTER @ out
        return q[k : k + 2] + out, jacobian, -out * v[k + 2] ** 2

    def ends(self, joint: str, q: Array, v: Array) -> list[tuple[Array, Array, Array]]:
        """Points of both bodies of a joint."""
        data = self.joints[joint]
        points = data.get("points", (joint, joint))
        return [self.point(b, self.arm(b, p), q, v) for b, p in zip(data["bodies"], points, strict=True)]

    def line(self, joint: str, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """From the first body's point to the second's."""
        one, two = self.ends(joint, q, v)
        return tuple(b - a for a, b in zip(one, two, strict=True))  # type: ignore[return-value]

    def guide(self, joint: str, q: Array) -> Array:
        data = self.joints[joint]
        return unit(self.angle(data["bodies"][0], q) + number(data["direction"]))

    def constraints(self, q: Array, v: Array, ideal: bool) -> tuple[Array, Array, Array, dict[str, int]]:
        """Residuals, rows, what accelerations of coordinates must make up for, first row of each joint.

        Joints with bearings coupled two-way are constraints of an ideal linkage alone.
        """
        residuals: list[float] = []
        rows: list[Array] = []
        rest: list[float] = []
        where = {}
        for name, joint in self.joints.items():
            if name in self.at_joint and not ideal:
                continue
            where[name] = len(rows)
            apart, jacobian, left = self.line(name, q, v)
            first, second = joint["bodies"]
            if joint["type"] == "revolute":
                residuals, rows, rest = [*residuals, *apart], [*rows, *jacobian], [*rest, *-left]
                continue
            normal, turning = QUARTER @ self.guide(name, q), float(self.row(first) @ v)
            sideways = QUARTER @ normal
            residuals += [normal @ apart, math.remainder(self.angle(second, q) - self.angle(first, q), TURN)]
            rows += [normal @ jacobian + (sideways @ apart) * self.row(first), self.row(second) - self.row(first)]
            rest.append(-normal @ left - 2 * turning * sideways @ (jacobian @ v) + turning**2 * normal @ apart)
            rest.append(0.0)
        for name, gear in self.gears.items():  # the wheels' angles; where their teeth push, see `_teeth`
            (one, two), ratio, arm = gear["bodies"], self._ratio(gear), self.axes(self.mechanism, gear)[0]
            begins = (number(gear.get(f"{which}_angle", 0.0)) for which in ("first", "second"))
            turned = [
                self.angle(body, q) - self.angle(arm, q) - begin for body, begin in zip((one, two), begins, strict=True)
            ]
            where[name] = len(rows)
            residuals.append(turned[1] - ratio * turned[0])
            rows.append(self.row(two) - ratio * self.row(one) - (1 - ratio) * self.row(arm))
            rest.append(0.0)
        return np.array(residuals), np.array(rows), np.array(rest), where

    @staticmethod
    def _ratio(gear: Tables) -> float:
        """Turns of the second wheel for one of the first, seen from the body that carries both."""
        return float(
            (-1.0 if gear.get("type", "external") == "external" else 1.0) * gear["teeth"][0] / gear["teeth"][1]
        )

    @staticmethod
    def axes(mechanism: Tables, gear: Tables) -> tuple[str, list[tuple[str, list[tuple[str, str]]]]]:
        """The body that carries both axes; of each its point there, and the hinges by which the wheel pushes it.

        A hinge comes with the body that pushes the other one: the wheel, and where it is hinged to a third body at a
        hinge of the carrier that body.
        """
        hinges = {name: joint for name, joint in mechanism["joints"].items() if joint["type"] == "revolute"}

        def point(name: str, body: str) -> str:
            joint = hinges[name]
            return str(joint.get("points", (name, name))[joint["bodies"].index(body)])

        for carrier in ("frame", *mechanism["bodies"]):
            found = []
            for wheel in gear["bodies"]:
                ways = [
                    (point(name, carrier), [(name, wheel)])
                    for name, joint in hinges.items()
                    if {*joint["bodies"]} == {carrier, wheel} and carrier != wheel
                ]
                ways += [
                    (point(two, carrier), [(one, wheel), (two, third)])
                    for one, first in hinges.items()
                    if wheel in first["bodies"]
                    for third in [next(body for body in first["bodies"] if body != wheel)]
                    for two, second in hinges.items()
                    if {*second["bodies"]} == {carrier, third} and point(one, third) == point(two, third)
                ]
                found.append(ways[0] if ways else None)
            if carrier not in gear["bodies"] and None not in found:
                return carrier, [way for way in found if way is not None]
        raise AssertionError("no body carries both axes")

    def _teeth(self, name: str, torque: float, q: Array) -> tuple[Array, float, list[tuple[str, str, float]]]:
        """Force of the second wheel on the first, its size along the line of action, and hinges that it passes through.

        The multiplier is the torque of the teeth, or of the belt, on the second wheel.
        """
        gear, still = self.gears[name], np.zeros(self.size)
        carrier, axes = self.axes(self.mechanism, gear)
        centers = [self.point(carrier, self.arm(carrier, point), q, still)[0] for point, _ in axes]
        hinges = [(*step, sign) for (_, way), sign in zip(axes, (1.0, -1.0), strict=True) for step in way]
        apart, teeth = centers[1] - centers[0], gear["teeth"]
        far = float(np.linalg.norm(apart))
        along = apart / far
        if gear.get("type") == "belt":
            radii = number(gear["radius"]) * np.array([1.0, teeth[1] / teeth[0]])
            for side in (1.0, -1.0):  # one of the strands pulls
                cosine = (radii[0] - radii[1]) / far
                out = cosine * along + side * math.sqrt(1 - cosine**2) * (QUARTER @ along)
                strand = (apart + (radii[1] - radii[0]) * out) / math.sqrt(far**2 - (radii[0] - radii[1]) ** 2)
                lever = radii[1] * float((QUARTER @ out) @ -strand)
                if torque / lever >= 0.0:
                    return torque / lever * strand, torque / lever, hinges
        ratio = self._ratio(gear)
        pitch = far * teeth[0] / (teeth[0] - math.copysign(teeth[1], ratio))  # from the first axis on
        size, slope = torque / (far - pitch), math.tan(number(gear.get("pressure_angle", "0.3490658503988659")))
        force = size * (QUARTER @ along) + math.copysign(abs(size) * slope, ratio) * along
        return force, abs(size) * math.hypot(1.0, slope), hinges

    def _play(self, q: Array, v: Array) -> Iterator[tuple[str, tuple[Array, Array, Array]]]:
        """Distances that coordinates of bearings measure, by their names."""
        for several in self.at_joint.values():
            for k, one in enumerate(several):
                inner, _ = self._rings_of(one.data)
                sign = 1.0 if self.joints[one.data["joint"]]["bodies"][1] == inner else -1.0
                if k == 0:
                    apart, jacobian, left = self.line(one.data["joint"], q, v)
                    yield f"{one.name}inner", (sign * apart, sign * jacobian, sign * left)
                if one.elastic:
                    housing, jacobian, left = self.ends(one.data["joint"], q, v)[0 if sign > 0 else 1]
                    ring, place = self.rings[one.name], np.zeros((2, self.size))
                    place[:, ring : ring + 2] = np.eye(2)
                    yield f"{one.name}outer", (q[ring : ring + 2] - housing, place - jacobian, -left)

    def closed(self, angle: float, q: Array, state: Mapping[str, float]) -> tuple[Array, float]:
        """Newton's method from a near pose; the last residual."""
        still, worst = np.zeros(self.size), math.inf
        for _ in range(50):
            residual, rows, *_ = self.constraints(q, still, False)
            parts, slopes = (
                [residual, [self.row(self.driven) @ q - angle]],
                [rows.reshape(-1, self.size), self.row(self.driven)[None]],
            )
            for name, (apart, jacobian, _) in self._play(q, still):
                parts.append(apart - [state.get(f"{name}.{axis}", 0.0) for axis in "xy"])
                slopes.append(jacobian)
            values = np.concatenate(parts)
            worst = float(np.max(np.abs(values)))
            move, *_ = np.linalg.lstsq(np.vstack(slopes), values, rcond=None)
            q = q - move
            if np.max(np.abs(move)) < 1e-15 or not np.all(np.isfinite(q)) or np.max(np.abs(move)) > 1e6:
                break
        return q, worst

    def _assembled(self) -> Array:
        """Pose at the start on the branches that the scene names: Newton's method from random poses."""
        rng = np.random.default_rng(1)
        for _ in range(3000):
            q = rng.uniform(-0.5, 0.5, self.size)
            for k in self.index.values():
                q[k + 2] = rng.uniform(-math.pi, math.pi)
            q[self.index[self.driven] + 2] = self.start
            found, worst = self.closed(self.start, q, {})
            if worst < 1e-13 and self._on_branches(found):
                for name, k in self.index.items():
                    if name not in self.exact:
                        near = self._near(name)
                        found[k + 2] = near + math.remainder(found[k + 2] - near, TURN)
                return self.closed(self.start, found, {})[0]
        raise AssertionError("no pose on the branches of the scene was found")

    def _beyond(self, entry: Tables, size: float, free: float) -> float:
        """Beyond a free size; an angle within half a turn of the free one where the bodies turn against each other.

        Else it has no jump, and its mean is within half a turn of the free angle: over a turn of the driver, a period
        of its swing, or its range.
        """
        if "points" in entry:
            return size - free
        first, second = entry["bodies"]

        def at(angle: float) -> float:
            q = self.pose(angle, {})
            return self.angle(second, q) - self.angle(first, q)

        if (first, second) not in self._means:
            if "swing" in self.driver:
                most = number(self.driver["swing"]["amplitude"])
                angles = [self.start + most * math.sin(math.radians(6 * k)) for k in range(60)]
            elif "range" in self.driver:
                angles = list(np.linspace(*(number(self.driver["range"][end]) for end in ("start", "end")), 61))
            else:
                whole = 12 if self.gears else 1  # the machine repeats after some of these
                angles = [self.start + math.radians(6 * k) for k in range(60 * whole)]
            found = [at(angle) for angle in angles]
            turns = not {"swing", "range"} & {*self.driver} and abs(at(self.start + whole * TURN) - found[0]) > 1.0
            self._means[first, second] = None if turns else float(np.mean(found))
        mean = self._means[first, second]
        if mean is None:
            return math.remainder(size - free, TURN)
        return size - free - TURN * round((mean - free) / TURN)

    def _near(self, body: str) -> float:
        """Half a turn from which the angle of a body that a dyad places may be, at the start."""
        for gear in self.gears.values():
            if body in gear["bodies"] and self.axes(self.mechanism, gear)[0] == "frame":
                return number(gear.get(f"{('first', 'second')[gear['bodies'].index(body)]}_angle", 0.0))
        return 0.0

    def _on_branches(self, q: Array) -> bool:
        placed, still = {"frame", self.driven}, np.zeros(self.size)
        while True:
            wheels = [{*gear["bodies"]} for gear in self.gears.values() if self.axes(self.mechanism, gear)[0] in placed]
            if loose := next((pair - placed for pair in wheels if len(pair - placed) == 1), None):
                placed |= loose
                continue
            for name, joint in self.joints.items():  # noqa: B007 - used after the loop
                pair = joint["bodies"]
                outer = [
                    [n for n, j in self.joints.items() if b in j["bodies"] and placed & {*j["bodies"]}] for b in pair
                ]
                if all(outer) and not placed & {*pair}:
                    break
            else:
                assert placed == {"frame", *self.bodies}, "no dyad"
                return True
            placed |= {*pair}
            kinds = [self.joints[names[0]]["type"] for names in outer]
            if [*kinds, self.joints[name]["type"]].count("prismatic") == 2:  # it has one position
                continue
            branch, inner = self.joints[name]["branch"], self.ends(name, q, still)[0][0]
            one, two = (self.ends(names[0], q, still)[0][0] for names in outer)
            if self.joints[name]["type"] == "prismatic":
                side = self.guide(name, q) @ (two - one)
            elif "prismatic" in kinds:
                k = kinds.index("prismatic")
                side = self.guide(outer[k][0], q) @ (inner - (one, two)[1 - k])
            else:
                side = (QUARTER @ (two - one)) @ (inner - one)
            if (side > 0) != (branch in ("left", "ahead")):
                return False

    def pose(self, angle: float, state: Mapping[str, float]) -> Array:
        """Of the displaced linkage, followed from the start so that angles keep their turns."""
        (at, q), step_ = min(self._poses, key=lambda known: abs(known[0] - angle)), 0.1
        while at != angle:
            there = angle if abs(angle - at) <= step_ else at + math.copysign(step_, angle - at)
            moved, _ = self.closed(there, q, {})
            if max(abs(moved[k + 2] - q[k + 2]) for k in self.index.values()) > 0.3:
                step_ /= 4
                continue
            q, at, step_ = moved, there, 0.1
            self._poses.append((at, q))
        q, worst = self.closed(angle, q, state)
        assert worst < 1e-12
        return q

    # what moves and loads it

    def driven_at(self, time: float) -> tuple[float, float, float]:
        """Angle, speed and acceleration of a driver or shaft whose motion is known."""
        if self.mechanism is None:
            speed = number(self.scene["shaft"]["speed"])
            return speed * time, speed, 0.0
        if "swing" in self.driver:
            most, rate = (number(self.driver["swing"][key]) for key in ("amplitude", "frequency"))
            phase, rate = TURN * rate * time, TURN * rate
            return (
                self.start + most * math.sin(phase),
                most * rate * math.cos(phase),
                -most * rate**2 * math.sin(phase),
            )
        if "table" not in self.driver:
            speed = number(self.driver["speed"])
            return self.start + speed * time, speed, 0.0
        times, speeds = (np.array([number(one) for one in self.driver["table"][key]]) for key in ("time", "speed"))
        edges = np.array([0.0, *times[(times > 0) & (times < time)], time])
        rates = np.interp(edges, times, speeds)
        slopes = np.concatenate([[0.0], np.diff(speeds) / np.diff(times), [0.0]])
        return (
            self.start + float(np.trapezoid(rates, edges)),
            float(rates[-1]),
            float(slopes[np.searchsorted(times, time, side="right")]),
        )

    def _phase(self, time: float, angle: float) -> float:
        """The angle that windows and tables are over: of a driver that swings its phase."""
        return TURN * number(self.driver["swing"]["frequency"]) * time if "swing" in self.driver else angle

    def motor(self, speed: float) -> float:
        law = self.driver["torque"]
        if law["law"] == "none":
            return 0.0
        if law["law"] == "constant":
            return number(law["torque"])
        if law["law"] == "linear":
            idle = number(law["no_load_speed"])
            if "stall_torque" in law:
                return number(law["stall_torque"]) * (1 - speed / idle)
            return number(law["nominal_torque"]) * (idle - speed) / (idle - number(law["nominal_speed"]))
        if law["law"] == "table":
            return float(np.interp(speed, *([number(one) for one in law[key]] for key in ("speed", "torque"))))
        ratio = (1 - speed / number(law["synchronous_speed"])) / law["breakdown_slip"]
        return 2 * number(law["breakdown_torque"]) / (ratio + 1 / ratio)

    def loads(self, time: float) -> Iterator[tuple[float, Array]]:
        """Places along the shaft and forces of the loads on inner rings."""
        angle, speed, _ = self.driven_at(time)
        for data in [self.scene["load"]] if "load" in self.scene else self.scene.get("loads", {}).values():
            kind = data["type"]
            if kind == "constant":
                force = vector(data["force"])
            elif kind == "harmonic":
                phase = data["phase"] if isinstance(data["phase"], list) else [data["phase"]] * 2
                swing = [math.cos(TURN * number(data["frequency"]) * time + number(one)) for one in phase]
                force = vector(data["mean"]) + vector(data["amplitude"]) * swing
            elif kind == "unbalance":
                size = number(data["mass"]) * number(data["eccentricity"]) * speed**2
                force = size * unit(angle + number(data.get("angle", 0.0)))
            else:
                key, period = ("time", None) if "time" in data else ("angle", TURN)
                columns = [[number(one) for one in data[name]] for name in (key, "x", "y")]
                at = time if key == "time" else angle
                force = np.array([np.interp(at, columns[0], one, period=period) for one in columns[1:]])
            if "window" in data:
                force = force * within(angle, data["window"]["start"], data["window"]["end"])
            if "time_window" in data:
                until = number(data["time_window"].get("end", math.inf))
                force = force * (number(data["time_window"]["start"]) <= time < until)
            yield number(data.get("position", 0.0)), force

    def _share(self, entry: Tables, name: str, angle: float) -> Any:
        """A force or torque of the scene at an angle of the driver."""
        if "table" in entry:
            rows = [[number(one) for one in entry["table"][key]] for key in ("angle", name)]
            amount = float(np.interp(angle, *rows, period=TURN * entry["table"].get("turns", 1)))
            return amount * unit(number(entry["direction"])) if name == "force" else amount
        plain = vector(entry[name]) if name == "force" else number(entry[name])
        if "window" not in entry:
            return plain
        opened = [one for one in windows(entry) if within(angle, one["start"], one["end"])]
        if opened and "rise" in opened[0]:
            width = (number(opened[0]["end"]) - number(opened[0]["start"])) % TURN
            past = (angle - number(opened[0]["start"])) % TURN
            return plain * min(1.0, past / number(opened[0]["rise"]), (width - past) / number(opened[0]["rise"]))
        return plain * float(bool(opened))

    def applied(self, q: Array, v: Array, angle: float) -> tuple[Array, dict[str, float]]:
        """Generalized forces of all but bearings and weight, and what of them is an output."""
        total, outputs, scene = np.zeros(self.size), {}, self.mechanism
        for entry in scene.get("forces", {}).values():
            _, jacobian, _ = self.point(entry["body"], self.arm(entry["body"], entry["point"]), q, v)
            total += self._share(entry, "force", angle) @ jacobian
        for entry in scene.get("torques", {}).values():
            total += self._share(entry, "torque", angle) * self.row(entry["body"])
        for table, key in (("springs", "spring"), ("torsion_springs", "torsion_spring")):
            for name, entry in scene.get(table, {}).items():
                size, gradient = self._size(entry, q, v)
                free = number(entry.get("free_length", entry.get("free_angle", 0.0)))
                beyond = self._beyond(entry, size, free)
                pull = number(entry.get("preload", 0.0)) + number(entry.get("damping", 0.0)) * float(gradient @ v)
                pull += (
                    number(entry.get("stiffness", 0.0)) * beyond + number(entry.get("cubic_stiffness", 0.0)) * beyond**3
                )
                total -= pull * gradient
                outputs[f"{key}.{name}.{'tension' if 'points' in entry else 'torque'}"] = pull
                if "points" in entry:
                    outputs[f"{key}.{name}.length"] = size
        for table, key in (("stops", "stop"), ("torsion_stops", "torsion_stop")):
            for name, entry in scene.get(table, {}).items():
                size, gradient = self._size(entry, q, v)
                free = number(entry.get("free_length", entry.get("free_angle", entry.get("free_distance", 0.0))))
                deep = -self._beyond(entry, size, free)
                loss = number(entry.get("hysteresis", 0.0)) * float(-gradient @ v)
                push = number(entry["stiffness"]) * max(deep, 0.0) * max(1 + loss, 0.0)
                total += push * gradient
                outputs |= {f"{key}.{name}.compression": deep}
                outputs[f"{key}.{name}.{'force' if 'points' in entry else 'torque'}"] = push
        for table, key in (("friction", "torque"), ("guide_friction", "force")):
            for name, entry in scene.get(table, {}).items():
                gradient = self._free_way(entry["joint"], q, v)
                rate = float(gradient @ v)
                held = number(entry.get("viscous", 0.0)) * rate
                if key in entry:
                    held += number(entry[key]) * math.tanh(rate / number(entry["smoothing"]))
                total -= held * gradient
                outputs[f"{table}.{name}.{key}"] = held
        return total, outputs

    def _free_way(self, joint: str, q: Array, v: Array) -> Array:
        first, second = self.joints[joint]["bodies"]
        if self.joints[joint]["type"] == "revolute":
            return self.row(second) - self.row(first)
        apart, jacobian, _ = self.line(joint, q, v)
        along = self.guide(joint, q)
        return along @ jacobian + (QUARTER @ along @ apart) * self.row(first)

    def _size(self, entry: Tables, q: Array, v: Array) -> tuple[float, Array]:
        first, second = entry["bodies"]
        if "points" not in entry:
            return self.angle(second, q) - self.angle(first, q), self.row(second) - self.row(first)
        one, two = (self.point(b, self.arm(b, p), q, v) for b, p in zip(entry["bodies"], entry["points"], strict=True))
        apart, jacobian = two[0] - one[0], two[1] - one[1]
        if "direction" in entry:
            normal = unit(self.angle(first, q) + number(entry["direction"]))
            return float(normal @ apart), normal @ jacobian + (QUARTER @ normal @ apart) * self.row(first)
        length = float(np.linalg.norm(apart))
        return length, apart / length @ jacobian

    def masses(self) -> Array:
        out = np.zeros(self.size)
        for name, body in self.bodies.items():
            k = self.index[name]
            out[k : k + 2] = number(body["mass"])
            out[k + 2] = number(body.get("inertia", 1.0))  # none: it does not turn
        out[self.index[self.driven] + 2] += number(self.driver.get("flywheel", {}).get("inertia", 0.0))
        for one in self.bearings:
            if one.name in self.rings:
                k = self.rings[one.name]
                out[k : k + 2] = one.count * number(one.data["outer_ring"]["mass"])
        return out

    # what is compared

    def evaluate(self, time: float, state: Mapping[str, float]) -> dict[str, Any]:
        """Second derivatives of coordinates (`inner.x`: ``a.inner.x``) and outputs."""
        out: dict[str, Any] = {}
        if self.mechanism is not None:
            out |= self._linkage(time, state)
        elif "transverse_inertia" in self.scene["shaft"]:
            return self._tilting(time, state)
        for one in [] if self.two_way else self.bearings:
            share, load = one.data.get("share", 1.0), np.zeros(2)
            for place, force in self.loads(time):
                load += self._lever(one, place) * force
            if self.mechanism is not None:
                joint = one.data["joint"]
                sign = 1.0 if self.joints[joint]["bodies"][0] == "frame" else -1.0
                shaft = sign * np.array([out[f"reaction.{joint}.{axis}"] for axis in "xy"])
                load = share * shaft + (load if joint == self.driver["joint"] else 0.0)
            found, force = self._one_way(one, time, state)
            ring = one.data["inner_ring"]
            out |= found | self._named(f"{one.name}load", load)
            out |= self._named(f"a.{one.name}inner", (load - force) / self._mass(ring))
        return out

    def _lever(self, one: Bearing, place: float) -> float:
        """Share of a bearing in a load of a shaft at a place."""
        if self.mechanism is not None or "position" not in one.data:
            return float(one.data.get("share", 1.0)) if self.mechanism is None else 1.0
        here = number(one.data["position"])
        (there,) = (number(other.data["position"]) for other in self.bearings if other is not one)
        return (there - place) / (there - here)

    def _tilting(self, time: float, state: Mapping[str, float]) -> dict[str, Any]:
        """A rigid rotor: Newton's law for its centre, Euler's for the slopes of its axis."""
        shaft, out = self.scene["shaft"], dict[str, Any]()
        first, second = (number(one.data["position"]) for one in self.bearings[:2])
        center, span = number(shaft.get("center_of_mass", 0.0)), second - first
        ends = [
            np.array([state[f"{one.name}inner.{kind}{axis}"] for kind in ("", "v") for axis in "xy"])
            for one in self.bearings[:2]
        ]
        force, moment = np.zeros(2), np.zeros(2)
        for place, load in self.loads(time):
            force, moment = force + load, moment + (place - center) * load
        for one in self.bearings:
            place = number(one.data["position"])
            here = ends[0] + (place - first) / span * (ends[1] - ends[0])
            off = vector(one.data["offset"]) if "offset" in one.data else np.zeros(2)
            names = [f"{one.name}inner.{kind}{axis}" for kind in ("", "v") for axis in "xy"]
            moved = {**state, **dict(zip(names, here - [*off, 0.0, 0.0], strict=True))}
            found, held = self._one_way(one, time, moved)
            out |= found
            force, moment = force - held, moment - (place - center) * held
        rate = (ends[1] - ends[0])[2:] / span
        spin = 0.0 if self.bearings[0].stands else self.driven_at(time)[1]
        gyroscopic = number(shaft.get("polar_inertia", 0.0)) * spin * (QUARTER @ rate)
        bent = (moment + gyroscopic) / number(shaft["transverse_inertia"])
        start = force / number(shaft["mass"]) + (first - center) * bent
        for one, place in zip(self.bearings[:2], (first, second), strict=True):
            out |= self._named(f"a.{one.name}inner", start + (place - first) * bent)
        return out

    def _turned(self, one: Bearing, time: float) -> tuple[Array, Array]:
        """Angles of both rings since the start, and their rates."""
        angle, rate, _ = self.driven_at(time)
        turned = np.array([angle - self.driven_at(0.0)[0], rate])
        if self.mechanism is not None:
            turned *= self.exact[next(b for b in self.joints[one.data["joint"]]["bodies"] if b != "frame")]
        outer = number(self.scene.get("shaft", {}).get("outer_speed", 0.0)) * np.array([time, 1.0])
        both = np.array([outer, turned] if one.stands else [turned, outer])
        return both[:, 0], both[:, 1]

    def _one_way(self, one: Bearing, time: float, state: Mapping[str, float]) -> tuple[dict[str, Any], Array]:
        """Outputs, and the force that holds the inner ring."""

        def place(name: str) -> Array:
            return np.array([state.get(f"{one.name}{name}{axis}", 0.0) for axis in "xy"])

        inner, outer, speed, slow = place("inner."), place("outer."), place("inner.v"), place("outer.v")
        turned, rates = self._turned(one, time)
        lag = one.lag(time, lambda at: self._turned(one, at)[0])
        out, _ = one.contacts(time, inner - outer, speed - slow, turned, rates, lag)
        force = np.array([out[f"{one.name}ring_force.{axis}"] for axis in "xy"])
        if one.elastic:
            housing = one.data["outer_ring"]
            held = number(housing["stiffness"]) * outer + number(housing["damping"]) * slow
            out |= self._named(f"a.{one.name}outer", (force - held) / number(housing["mass"]))
        return out, force + number(one.data.get("inner_ring", {}).get("damping", 0.0)) * speed

    def _mass(self, ring: Tables) -> float:
        """Eq. (3)."""
        if "mass" in ring:
            return number(ring["mass"])
        parts, crank = ring["equivalent_mass"], self.bodies[self.driven]
        near = self.driver["joint"]
        far = next(n for n, j in self.joints.items() if n != near and self.driven in j["bodies"])
        here, there = (
            vector(
                crank["points"][
                    dict(zip(self.joints[n]["bodies"], self.joints[n].get("points", (n, n)), strict=True))[self.driven]
                ]
            )
            for n in (near, far)
        )
        arm = there - here
        lever = float((there - vector(crank["center_of_mass"])) @ arm / (arm @ arm))
        share = 1.0 if parts["crank"] == "whole" else 0.5
        return number(parts["ring"]) + share * number(crank["mass"]) * lever + 0.5 * number(parts["crankpin"])

    @staticmethod
    def _named(name: str, pair: Sequence[float]) -> dict[str, float]:
        return {f"{name}.{axis}": float(value) for axis, value in zip("xy", pair, strict=True)}

    def _linkage(self, time: float, state: Mapping[str, float]) -> dict[str, Any]:
        motor = "torque" in self.driver
        angle, rate, gained = self.driven_at(time) if not motor else (state["driver.angle"], state["driver.speed"], 0.0)
        q = self.pose(angle, state)
        still = np.zeros(self.size)
        _, rows, *_ = self.constraints(q, still, False)
        slopes, ends = [rows.reshape(-1, self.size), self.row(self.driven)[None]], [np.zeros(len(rows)), [rate]]
        for name, (_, jacobian, _) in self._play(q, still):
            slopes.append(jacobian)
            ends.append([state[f"{name}.v{axis}"] for axis in "xy"])
        v = np.linalg.solve(np.vstack(slopes), np.concatenate(ends))
        pushed, out = self.applied(q, v, self._phase(time, angle))
        masses = self.masses()
        fall = vector(self.mechanism["gravity"], (0.0, -1.0)) if "gravity" in self.mechanism else np.zeros(2)
        for k in [*self.index.values(), *self.rings.values()]:
            pushed[k : k + 2] += masses[k : k + 2] * fall
        on_inner: dict[str, Array] = {}
        for one in self.bearings if self.two_way else ():
            found, force, at_housing = self._bearing(one, time, q, v, state)
            out |= found
            pushed += force
            on_inner[one.data["joint"]] = on_inner.get(one.data["joint"], np.zeros(2)) + at_housing
        _, rows, rest, where = self.constraints(q, v, False)
        rows = rows.reshape(-1, self.size)
        if motor:
            pushed += self.motor(rate) * self.row(self.driven)
        else:
            rows, rest = np.vstack([rows, self.row(self.driven)]), np.append(rest, gained)
        accelerations, forces = self._solved(masses, rows, pushed, rest)
        out["drive_torque"] = self.motor(rate) if motor else float(forces[-1])
        for name, joint in self.joints.items():
            if name in self.at_joint:
                inner, _ = self._rings_of(self.at_joint[name][0].data)
                reaction = on_inner[name] if inner == joint["bodies"][0] else -on_inner[name]
            elif joint["type"] == "revolute":
                reaction = -forces[where[name] : where[name] + 2]
            else:
                reaction = -forces[where[name]] * (QUARTER @ self.guide(name, q))
                out[f"reaction.{name}.moment"] = -float(forces[where[name] + 1])
            out |= self._named(f"reaction.{name}", reaction)
        for name in self.gears:
            force, out[f"gear.{name}.force"], hinges = self._teeth(name, float(forces[where[name]]), q)
            out |= self._named(f"reaction.{name}", force)
            for hinge, body, sign in hinges:
                on_first = sign if self.joints[hinge]["bodies"][1] == body else -sign
                held = [out[f"reaction.{hinge}.{axis}"] for axis in "xy"]
                out |= self._named(f"reaction.{hinge}", np.array(held) + on_first * force)
        for name, (_, jacobian, left) in self._play(q, v):
            out |= self._named(f"a.{name}", jacobian @ accelerations + left)
        if motor:
            out["a.driver.angle"] = float(self.row(self.driven) @ accelerations)
        elif "table" in self.driver and not self.bearings:  # integrated along
            out["a.driver.angle"] = gained
        return out | {f"body.{name}.angle": self.angle(name, q) for name in self.bodies}

    def _solved(self, masses: Array, rows: Array, pushed: Array, rest: Array) -> tuple[Array, Array]:
        """Accelerations and multipliers: scaled by the masses, with two steps of refinement in longer numbers."""
        scale, count = np.sqrt(masses), len(rest)
        matrix = np.block([[np.eye(self.size), -(rows / scale).T], [rows / scale, np.zeros((count, count))]])
        right = np.concatenate([pushed / scale, rest]).astype(np.longdouble)
        found = np.linalg.solve(matrix, right.astype(float)).astype(np.longdouble)
        for _ in range(2):
            found = found + np.linalg.solve(matrix, (right - matrix.astype(np.longdouble) @ found).astype(float))
        return found[: self.size].astype(float) / scale, found[self.size :].astype(float)

    def _bearing(
        self, one: Bearing, time: float, q: Array, v: Array, state: Mapping[str, float]
    ) -> tuple[dict[str, Any], Array, Array]:
        """Outputs, generalized forces, and force on the body of the inner ring through the housing."""
        inner, outer = self._rings_of(one.data)
        data = self.joints[one.data["joint"]]
        ends = dict(zip(data["bodies"], self.ends(one.data["joint"], q, v), strict=True))
        (at, jacobian, _), (housing, carried, _) = ends[inner], ends[outer]
        ring, moved = housing, carried
        if one.elastic:
            k = self.rings[one.name]
            ring, moved = q[k : k + 2], np.zeros((2, self.size))
            moved[:, k : k + 2] = np.eye(2)
        pair = (inner, outer)
        turned = np.array([self.angle(b, q) - self.angle(b, self.first_pose) for b in pair])
        rates = np.array([self.row(b) @ v for b in pair])

        def known(at: float) -> list[float]:
            return [self.driven_at(at)[0] - self.start if b == self.driven else 0.0 for b in pair]

        state_name = f"{one.name}cage.lag"
        lag = state[state_name] if state_name in state else one.lag(time, known)
        gradient = jacobian - moved
        out, balls = one.contacts(time, at - ring, gradient @ v, turned, rates, lag)
        now, total = one.weights(one.slip(time)), np.zeros(self.size)
        rolls, against = now[0] * self.row(inner) + now[1] * self.row(outer), self.row(inner) - self.row(outer)
        for force, along, lever, slope in balls:
            total -= one.count * force * (along @ gradient + lever * rolls - slope * against)
        if state_name in state:
            out[f"a.{one.name}cage.lag_integral"] = float((one.last - now) @ rates)
        if not one.elastic:
            return out, total, -one.count * np.array([out[f"{one.name}ring_force.{axis}"] for axis in "xy"])
        support, apart = one.data["outer_ring"], ring - housing
        seen = moved - carried - np.outer(QUARTER @ apart, self.row(outer))  # in axes of the housing
        spring = -one.count * number(support["stiffness"]) * apart
        damper = -one.count * number(support["damping"]) * (seen @ v)
        return out, total + spring @ (moved - carried) + damper @ seen, spring + damper
