"""Absolute coordinates of a scene's machine: poses, velocities, and the constraints between them.

In: a checked scene.  Out: points with their velocities as linear forms, rows of the constraints, poses that close.

Coordinates are x, y of the centre of mass and the angle of every body, x, y of every outer ring on an elastic housing,
and the slopes of the driven body's axis where it tilts.  Nothing of the derivation is used but the records that hold
the scene.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.mechanism_records import Gear, Joint
from ballpass.derive.scene.quantity import Vector
from ballpass.derive.scene.records import Scene, quantities_of
from ballpass.derive.scene.table import FRAME

Array = np.ndarray
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
TURN = 2 * math.pi


def rotation(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


@dataclass
class Place:
    """A point: where it is, how fast, its velocity as ``jacobian @ v``, its acceleration as ``jacobian @ a + rest``."""

    position: Array
    velocity: Array
    jacobian: Array
    rest: Array

    def __sub__(self, other: Place) -> Place:
        return Place(
            self.position - other.position,
            self.velocity - other.velocity,
            self.jacobian - other.jacobian,
            self.rest - other.rest,
        )


class Absolute:
    """A scene's machine in absolute coordinates.

    Parameters
    ----------
    scene : with bearings coupled two-way, or none
    changes : other values of parameters, by path
    guess : where points of bodies are at the start, to choose the branch of the assembly: (body, point) to (x, y) [m]
    """

    def __init__(
        self, scene: Scene, guess: Mapping[tuple[str, str], tuple[float, float]], changes: Mapping[str, float] = {}
    ) -> None:
        assert scene.mechanism is not None
        self.mechanism, self.bearings = scene.mechanism, scene.bearings
        self.values = {q.path: q.value for q in scene.quantities} | dict(changes)
        self.bodies = [b.name for b in self.mechanism.bodies]
        self.elastic = [b.name for b in self.bearings if b.outer is not None]
        self.tilt = 3 * len(self.bodies) + 2 * len(self.elastic)
        on_shaft = [b for b in self.bearings if b.tilts]
        self.size = self.tilt + (2 if on_shaft else 0)
        self.in_play = {b.joint: [other for other in self.bearings if other.joint == b.joint] for b in self.bearings}
        self.first = [several[0] for several in self.in_play.values()]  # the others' inner rings move alike
        self.first = [b for b in self.bearings if (b in on_shaft[:2] if b.tilts else b in self.first)]
        self.speed = self.values[self.mechanism.driver.speed.path]
        self.start = self.values[self.mechanism.driver.start_angle.path]
        joint = self.mechanism.joint(self.mechanism.driver.joint)
        self.driven = joint.other(FRAME)
        self.motor, self.table = self.mechanism.driver.torque, self.mechanism.driver.table  # neither: constant speed
        # the driver's angle is a state
        self.free = self.motor is not None or (self.table is not None and not self.bearings)
        self.acceleration = 0.0  # of the driver, where its speed is given
        # slip that changes: a lag is a state where the rings swing, or a motor drives
        slipping = [b for b in self.bearings if b.cage is not None and b.cage.time]
        self.lagging = [b for b in slipping if self.motor is not None or not {*self.rings(b)} <= {FRAME, self.driven}]
        self.known_lags = [b for b in slipping if b not in self.lagging]
        self.lags, self.time = dict.fromkeys((b.name for b in self.lagging), 0.0), 0.0
        self._arms: dict[tuple[str, str], Array] = {}
        self._chain = [(self.start, self._closed(self.start, self._guessed(guess)))]

    # numbers of the scene

    def value(self, quantity: object) -> float:
        return 0.0 if quantity is None else self.values[quantity.path]  # type: ignore[attr-defined]

    def vector(self, vector: Vector, axis: tuple[float, float] = (1.0, 0.0)) -> Array:
        numbers = [self.values[q.path] for q in quantities_of(vector)]
        if not numbers:
            return np.zeros(2)
        if len(numbers) == 1:
            return numbers[0] * np.array(axis)
        if vector.kind == "cartesian":
            return np.array(numbers)
        return numbers[0] * np.array([math.cos(numbers[1]), math.sin(numbers[1])])

    def arm(self, body: str, point: str) -> Array:
        """A point in body axes, from the centre of mass; on the frame from the origin."""
        if (body, point) not in self._arms:
            self._arms[body, point] = self._arm(body, point)
        return self._arms[body, point]

    def _arm(self, body: str, point: str) -> Array:
        if body == FRAME:
            return self.vector(next(p.position for p in self.mechanism.frame_points if p.name == point))
        record = self.mechanism.body(body)
        arm = self.vector(record.point(point)) - self.vector(record.center_of_mass)
        return np.array([*arm, self.along_shaft(body, point)])

    def along_shaft(self, body: str, point: str) -> float:
        """Place of a point of a body that tilts, from its centre of mass."""
        places = dict(self.mechanism.body(body).positions)
        return self.value(places.get(point)) - self.value(places.get("center_of_mass"))

    def row(self, body: str) -> Array:
        """Rate of a body's angle as a linear form."""
        out = np.zeros(self.size)
        if body != FRAME:
            out[3 * self.bodies.index(body) + 2] = 1.0
        return out

    def angle(self, body: str, q: Array) -> float:
        return float(self.row(body) @ q)

    def place(self, body: str, arm: Array, q: Array, v: Array) -> Place:
        if body == FRAME:
            return Place(arm, np.zeros(2), np.zeros((2, self.size)), np.zeros(2))
        k = 3 * self.bodies.index(body)
        turned = rotation(q[k + 2]) @ arm[:2]
        jacobian = np.zeros((2, self.size))
        jacobian[:, k : k + 2] = np.eye(2)
        jacobian[:, k + 2] = QUARTER @ turned
        moved = q[k : k + 2] + turned
        if body == self.driven and self.size > self.tilt:
            jacobian[:, self.tilt :] = arm[2] * np.eye(2)
            moved = moved + arm[2] * q[self.tilt :]
        return Place(moved, jacobian @ v, jacobian, -turned * v[k + 2] ** 2)

    def at(self, joint: Joint, body: str, q: Array, v: Array) -> Place:
        return self.place(body, self.arm(body, joint.point(body)), q, v)

    def ring(self, name: str, q: Array, v: Array) -> Place:
        k = 3 * len(self.bodies) + 2 * self.elastic.index(name)
        jacobian = np.zeros((2, self.size))
        jacobian[:, k : k + 2] = np.eye(2)
        return Place(q[k : k + 2], v[k : k + 2], jacobian, np.zeros(2))

    # constraints: residual, rows, and what accelerations leave over

    def constraints(
        self, q: Array, v: Array, angle: float, rate: float
    ) -> tuple[Array, Array, Array, Array, dict[str, slice]]:
        """Residuals, Jacobian, prescribed rates, right-hand sides for accelerations; rows of each ideal joint."""
        residual, rows, rates, rest, where = [], [], [], [], dict[str, slice]()
        for joint in self.mechanism.joints:
            if joint.name in self.in_play:
                continue
            first, second = joint.bodies
            apart = self.at(joint, second, q, v) - self.at(joint, first, q, v)
            where[joint.name] = slice(len(residual), len(residual) + 2)
            if joint.kind == "revolute":
                residual += [*apart.position]
                rows += [*apart.jacobian]
                rest += [*-apart.rest]
            else:
                alpha, turning = self.angle(first, q) + self.value(joint.direction), float(self.row(first) @ v)
                normal = np.array([-math.sin(alpha), math.cos(alpha)])
                sideways = QUARTER @ normal  # derivative of the normal by the guide's angle
                turned = math.remainder(self.angle(second, q) - self.angle(first, q), TURN)
                residual += [normal @ apart.position, turned]
                rows.append(normal @ apart.jacobian + (sideways @ apart.position) * self.row(first))
                rows.append(self.row(second) - self.row(first))
                rest.append(
                    -normal @ apart.rest
                    - 2 * turning * (sideways @ apart.velocity)
                    + turning**2 * (normal @ apart.position)
                )
                rest.append(0.0)
            rates += [0.0, 0.0]
        for gear in self.mechanism.gears:
            where[gear.name] = slice(len(residual), len(residual) + 1)
            row, offset = self.ratio(gear)
            residual.append(row @ q - offset)
            rows.append(row)
            rates.append(0.0)
            rest.append(0.0)
        where["driver"] = slice(len(residual), len(residual) + 1)
        driven = self.row(self.driven)
        residual.append(driven @ q - angle)
        rows.append(driven)
        rates.append(rate)
        rest.append(self.acceleration)
        return np.array(residual), np.array(rows), np.array(rates), np.array(rest), where

    def ratio(self, gear: Gear) -> tuple[Array, float]:
        """What a gear keeps: a linear form of the angles, and its value."""
        sense = -1.0 if gear.kind == "external" else 1.0
        turned = [self.row(body) - self.row(self.carrier(gear)) for body in gear.bodies]
        first, second = self.value(gear.first_angle), self.value(gear.second_angle)
        ratio = sense * gear.teeth[0] / gear.teeth[1]
        return turned[1] - ratio * turned[0], second - ratio * first

    def carrier(self, gear: Gear) -> str:
        """The body hinged to both wheels, or to one of them and to the frame, which holds the other one."""
        near = [{joint.other(body) for joint in self._hinges(body)} for body in gear.bodies]
        both = sorted((near[0] & near[1]) - {*gear.bodies}, key=lambda body: body != FRAME)
        arms = [b for b in self.bodies if b not in gear.bodies and any(b in held for held in near)]
        return next(iter([*both, *(b for b in arms if any(FRAME in joint.bodies for joint in self._hinges(b)))]))

    def _hinges(self, body: str) -> list[Joint]:
        return [j for j in self.mechanism.joints if j.kind == "revolute" and body in j.bodies]

    def axle(self, gear: Gear, body: str, q: Array) -> Array:
        """A place on the axis of a wheel."""
        carrier = self.carrier(gear)
        held = sorted(self._hinges(body), key=lambda joint: (carrier not in joint.bodies, FRAME not in joint.bodies))
        return self.at(held[0], body, q, np.zeros(self.size)).position

    def play(self, bearing: Bearing, q: Array, v: Array) -> tuple[Place, Place, Place]:
        """Points of a bearing: of the inner ring's body, of the housing's body, and the centre of the outer ring."""
        joint = self.mechanism.joint(bearing.joint or "")
        inner, housing = (self.at(joint, body, q, v) for body in (bearing.inner_body, joint.other(bearing.inner_body)))
        if bearing.tilts:
            arm = self.arm(self.driven, joint.point(self.driven)).copy()
            arm[2] += self.value(bearing.position) - self.value(
                dict(self.mechanism.body(self.driven).positions).get(joint.point(self.driven))
            )
            inner = self.place(self.driven, arm, q, v)
            housing.position = housing.position + (
                0.0 if bearing.offset is None else np.array([self.value(q) for q in bearing.offset])
            )
        return inner, housing, housing if bearing.outer is None else self.ring(bearing.name, q, v)

    def _guessed(self, guess: Mapping[tuple[str, str], tuple[float, float]]) -> Array:
        """Poses from two known points of each body; a body with one point starts at the angle zero."""
        q = np.zeros(self.size)
        for k, body in enumerate(self.bodies):
            known = [(self.arm(body, point), np.array(guess[body, point])) for point in self._points(body)]
            (arm, at), (other, there) = max(
                ((a, b) for a in known for b in known), key=lambda pair: float(np.linalg.norm(pair[1][0] - pair[0][0]))
            )
            local, world = other - arm, there - at
            local = local[:2]
            if np.linalg.norm(local) > 0.0:
                q[3 * k + 2] = math.atan2(world[1], world[0]) - math.atan2(local[1], local[0])
            q[3 * k : 3 * k + 2] = at - rotation(q[3 * k + 2]) @ arm[:2]
        q[3 * self.bodies.index(self.driven) + 2] = self.start
        for gear in self.mechanism.gears:  # whole turns of the later wheel
            row, offset = self.ratio(gear)
            wheel = max((body for body in gear.bodies if body != FRAME), key=self._place_of)
            place = 3 * self.bodies.index(wheel) + 2
            q[place] -= TURN * round(float(row @ q - offset) / row[place] / TURN)
        return q

    def _place_of(self, body: str) -> int:
        return -1 if body == self.driven else self.bodies.index(body)

    def _points(self, body: str) -> list[str]:
        return [p.name for p in self.mechanism.body(body).points]

    def _closed(
        self, angle: float, q: Array, displaced: Mapping[str, Array] = {}, rings: Sequence[Array] = ()
    ) -> Array:
        """Newton's method from a near pose: constraints, and the play of each bearing as given."""
        still = np.zeros(self.size)
        for _ in range(40):
            residual, rows, *_ = self.constraints(q, still, angle, 0.0)
            parts, slopes = [residual], [rows]
            for bearing in self.first:
                inner, housing, _ = self.play(bearing, q, still)
                parts.append(inner.position - housing.position - displaced.get(bearing.name, np.zeros(2)))
                slopes.append((inner - housing).jacobian)
            for name, shift in zip(self.elastic, rings or [np.zeros(2)] * len(self.elastic), strict=True):
                bearing = next(b for b in self.bearings if b.name == name)
                _, housing, ring = self.play(bearing, q, still)
                parts.append(ring.position - housing.position - shift)
                slopes.append((ring - housing).jacobian)
            step = np.linalg.solve(np.vstack(slopes), np.concatenate(parts))
            q = q - step
            if np.max(np.abs(step)) < 1e-15:
                break
        assert np.max(np.abs(np.concatenate(parts))) < 1e-12, "Newton's method found no pose"
        return q

    def ideal(self, angle: float) -> Array:
        """Pose of the linkage without play, followed from the start in small steps: angles do not jump."""
        last, q = min(self._chain, key=lambda entry: abs(entry[0] - angle))
        step = 0.1
        while last != angle:
            there = angle if abs(angle - last) < step else last + math.copysign(step, angle - last)
            moved = self._closed(there, q)
            if np.max(np.abs((moved - q)[2 : 3 * len(self.bodies) : 3])) > 0.2:  # another branch is near
                step = abs(there - last) / 4
                continue
            last, q, step = there, moved, 0.1
            self._chain.append((last, q))
        return q

    def drive(self, t: float, x: Array) -> tuple[float, float]:
        """Angle and speed of the driven body: in the state, before the lags of cages, or by its table."""
        if not self.free:
            return self.driver_at(t)
        behind = 1 + len(self.lagging)
        return float(x[len(x) // 2 - behind]), float(x[-behind])

    def rings(self, bearing: Bearing) -> tuple[str, str]:
        """Bodies that carry the inner and the outer ring."""
        inner = bearing.inner_body or self.driven
        return inner, self.mechanism.joint(bearing.joint or "").other(inner)

    def driver_at(self, t: float) -> tuple[float, float]:
        """Angle and speed of a driver whose speed is given: trapezoids between the rows of its table."""
        if self.table is None:
            return self.start + self.speed * t, self.speed
        times = np.array([self.value(q) for q in self.table.time])
        speeds = [self.value(q) for q in (self.mechanism.driver.speed, *self.table.later_speed)]
        edges = np.array([0.0, *times[(times > 0.0) & (times < t)], t])
        rates = np.interp(edges, times, speeds)
        return self.start + float(np.trapezoid(rates, edges)), float(rates[-1])

    def slope(self, t: float) -> float:
        """Acceleration of the driver by the table of its speed."""
        if self.table is None:
            return 0.0
        times = [self.value(q) for q in self.table.time]
        speeds = [self.value(q) for q in (self.mechanism.driver.speed, *self.table.later_speed)]
        apart = 1e-3 * min(np.diff(times))
        return float(np.diff(np.interp([t, t + apart], times, speeds))[0] / apart)

    def absolute(self, t: float, x: Array) -> tuple[Array, Array]:
        """Positions and velocities of all bodies and rings, from a state of the scene: positions, then velocities."""
        (angle, rate), half = self.drive(t, x), len(x) // 2
        self.time, last = t, x[len(x) - len(self.lagging) :]
        self.lags = {bearing.name: float(lag) for bearing, lag in zip(self.lagging, last, strict=True)}
        self.lags |= {bearing.name: self.known_lag(bearing, t) for bearing in self.known_lags}
        shifts: dict[str, Array] = {}
        speeds: dict[str, Array] = {}
        rings, ring_rates, k = [], [], 0
        for bearing in self.bearings:
            if bearing in self.first:
                shifts[bearing.name], speeds[bearing.name] = x[k : k + 2], x[half + k : half + k + 2]
                k += 2
            if bearing.outer is not None:
                rings.append(x[k : k + 2])
                ring_rates.append(x[half + k : half + k + 2])
                k += 2
        q = self._closed(angle, self.ideal(angle), shifts, rings)
        _, rows, wanted, *_ = self.constraints(q, np.zeros(self.size), angle, rate)
        slopes, ends = [rows], [wanted]
        for bearing in self.first:
            inner, housing, _ = self.play(bearing, q, np.zeros(self.size))
            slopes.append((inner - housing).jacobian)
            ends.append(speeds[bearing.name])
        for name, ring_rate in zip(self.elastic, ring_rates, strict=True):
            bearing = next(b for b in self.bearings if b.name == name)
            _, housing, ring = self.play(bearing, q, np.zeros(self.size))
            slopes.append((ring - housing).jacobian)
            ends.append(ring_rate)
        return q, np.linalg.solve(np.vstack(slopes), np.concatenate(ends))
