"""A second implementation of machines with bearings, for tests alone: absolute coordinates and Lagrange multipliers.

In: a checked scene.  Out: accelerations, reactions, drive torque, energies at a state.

Unknowns are x, y of the centre of mass and the angle of every body, and x, y of every outer ring on an elastic housing.
Ideal joints and the driver are constraints; a bearing is a force between two points, ball by ball.  Nothing of the
derivation is used but the records that hold the scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from ballpass.derive.mechanism.forces import BodyTorque, PointForce, Windows
from ballpass.derive.mechanism.forces.spring_damper import SpringDamper
from ballpass.derive.mechanism.forces.two_bodies import TwoBodies
from ballpass.derive.mechanism.forces.two_points import TwoPoints
from ballpass.derive.scene.records import FRAME, Bearing, GivenContact, Joint, Scene, Vector

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


@dataclass
class Found:
    """Accelerations by coordinate of the scene, reactions by output, and the rates of all absolute coordinates."""

    accelerations: dict[str, float]
    outputs: dict[str, float]
    rates: Array


class Multibody:
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
        self.size = 3 * len(self.bodies) + 2 * len(self.elastic)
        self.in_play = {b.joint: b for b in self.bearings}
        self.speed = self.values[self.mechanism.driver.speed.path]
        self.start = self.values[self.mechanism.driver.start_angle.path]
        joint = self.mechanism.joint(self.mechanism.driver.joint)
        self.driven = joint.other(FRAME)
        self.motor = self.mechanism.driver.torque  # None: constant speed
        self._chain = [(self.start, self._closed(self.start, self._guessed(guess)))]

    # numbers of the scene

    def value(self, quantity: object) -> float:
        return 0.0 if quantity is None else self.values[quantity.path]  # type: ignore[attr-defined]

    def vector(self, vector: Vector, axis: tuple[float, float] = (1.0, 0.0)) -> Array:
        numbers = [self.values[q.path] for q in vector.quantities()]
        if not numbers:
            return np.zeros(2)
        if len(numbers) == 1:
            return numbers[0] * np.array(axis)
        if vector.kind == "cartesian":
            return np.array(numbers)
        return numbers[0] * np.array([math.cos(numbers[1]), math.sin(numbers[1])])

    def arm(self, body: str, point: str) -> Array:
        """A point in body axes, from the centre of mass; on the frame from the origin."""
        if body == FRAME:
            return self.vector(next(p.position for p in self.mechanism.frame_points if p.name == point))
        record = self.mechanism.body(body)
        return self.vector(record.point(point)) - self.vector(record.center_of_mass)

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
        turned = rotation(q[k + 2]) @ arm
        jacobian = np.zeros((2, self.size))
        jacobian[:, k : k + 2] = np.eye(2)
        jacobian[:, k + 2] = QUARTER @ turned
        return Place(q[k : k + 2] + turned, jacobian @ v, jacobian, -turned * v[k + 2] ** 2)

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
        where["driver"] = slice(len(residual), len(residual) + 1)
        driven = self.row(self.driven)
        residual.append(driven @ q - angle)
        rows.append(driven)
        rates.append(rate)
        rest.append(0.0)
        return np.array(residual), np.array(rows), np.array(rates), np.array(rest), where

    def play(self, bearing: Bearing, q: Array, v: Array) -> tuple[Place, Place, Place]:
        """Points of a bearing: of the inner ring's body, of the housing's body, and the centre of the outer ring."""
        joint = self.mechanism.joint(bearing.joint or "")
        inner, housing = (self.at(joint, body, q, v) for body in (bearing.inner_body, joint.other(bearing.inner_body)))
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
            if np.linalg.norm(local) > 0.0:
                q[3 * k + 2] = math.atan2(world[1], world[0]) - math.atan2(local[1], local[0])
            q[3 * k : 3 * k + 2] = at - rotation(q[3 * k + 2]) @ arm
        q[3 * self.bodies.index(self.driven) + 2] = self.start
        return q

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
            for bearing in self.bearings:
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
        step = 0.03
        while last != angle:
            there = angle if abs(angle - last) < step else last + math.copysign(step, angle - last)
            moved = self._closed(there, q)
            if np.max(np.abs((moved - q)[2 : 3 * len(self.bodies) : 3])) > 0.2:  # another branch is near
                step = abs(there - last) / 4
                continue
            last, q, step = there, moved, 0.03
            self._chain.append((last, q))
        return q

    def drive(self, t: float, x: Array) -> tuple[float, float]:
        """Angle and speed of the driven body: last of the state's positions and velocities where a torque drives."""
        if self.motor is None:
            return self.start + self.speed * t, self.speed
        return float(x[len(x) // 2 - 1]), float(x[-1])

    def torque(self, speed: float) -> float:
        """Of the motor."""
        motor = self.motor
        if motor.name == "none":
            return 0.0
        if motor.name == "constant":
            return self.value(motor.amount)
        if motor.name == "linear":
            line = [self.value(motor.at), self.value(motor.no_load_speed)], [self.value(motor.amount), 0.0]
            return float(np.polyval(np.polyfit(*line, 1), speed))
        if motor.name == "table":
            return float(np.interp(speed, *([self.value(q) for q in column] for column in (motor.speed, motor.amount))))
        assert motor.name == "asynchronous"  # Kloss
        ratio = (1 - speed / self.value(motor.synchronous_speed)) / self.value(motor.breakdown_slip)
        return 2 * self.value(motor.breakdown_torque) / (ratio + 1 / ratio)

    def absolute(self, t: float, x: Array) -> tuple[Array, Array]:
        """Positions and velocities of all bodies and rings, from a state of the scene: positions, then velocities."""
        (angle, rate), half = self.drive(t, x), len(x) // 2
        shifts: dict[str, Array] = {}
        speeds: dict[str, Array] = {}
        rings, ring_rates, k = [], [], 0
        for bearing in self.bearings:
            shifts[bearing.name], speeds[bearing.name] = x[k : k + 2], x[half + k : half + k + 2]
            k += 2
            if bearing.outer is not None:
                rings.append(x[k : k + 2])
                ring_rates.append(x[half + k : half + k + 2])
                k += 2
        q = self._closed(angle, self.ideal(angle), shifts, rings)
        _, rows, wanted, *_ = self.constraints(q, np.zeros(self.size), angle, rate)
        slopes, ends = [rows], [wanted]
        for bearing in self.bearings:
            inner, housing, _ = self.play(bearing, q, np.zeros(self.size))
            slopes.append((inner - housing).jacobian)
            ends.append(speeds[bearing.name])
        for name, ring_rate in zip(self.elastic, ring_rates, strict=True):
            bearing = next(b for b in self.bearings if b.name == name)
            _, housing, ring = self.play(bearing, q, np.zeros(self.size))
            slopes.append((ring - housing).jacobian)
            ends.append(ring_rate)
        return q, np.linalg.solve(np.vstack(slopes), np.concatenate(ends))

    # forces

    def ball_angle(self, bearing: Bearing, q: Array) -> float:
        """Pure rolling from the ideal linkage at the start: each ring's turn with its weight."""
        start, joint = self._chain[0][1], self.mechanism.joint(bearing.joint or "")
        weights = self.weights(bearing)
        bodies = (bearing.inner_body, joint.other(bearing.inner_body))
        turned = (w * (self.angle(b, q) - self.angle(b, start)) for w, b in zip(weights, bodies, strict=True))
        return self.value(bearing.ball_angle) + sum(turned)

    def weights(self, bearing: Bearing) -> tuple[float, float]:
        """Raceways' radii roll on the ball: R_i w_i + R_o w_o over their sum."""
        ball, pitch = self.value(bearing.ball_diameter), self.value(bearing.pitch_diameter)
        inner, outer = (pitch - ball) / 2, (pitch + ball) / 2
        return inner / (inner + outer), outer / (inner + outer)

    @cached_property
    def stiffnesses(self) -> dict[str, float]:
        return {b.name: self._stiffness(b) for b in self.bearings}

    def _stiffness(self, bearing: Bearing) -> float:
        """k_b: given, or both contacts in series by Hertz (K. L. Johnson, Contact Mechanics, Eqs. 4.25 to 4.28)."""
        contact = bearing.contact
        if isinstance(contact, GivenContact):
            return self.value(contact.stiffness)
        materials = (contact.ring, contact.ball or contact.ring)
        compliance = sum((1 - self.value(m.poisson_ratio) ** 2) / self.value(m.young_modulus) for m in materials)
        ball, pitch = self.value(bearing.ball_diameter), self.value(bearing.pitch_diameter)
        total = 0.0
        for groove, raceway in (
            (contact.inner_groove_radius, (pitch - ball) / 2),
            (contact.outer_groove_radius, -(pitch + ball) / 2),
        ):
            low, high = sorted((1 / ball - 0.5 / self.value(groove), 1 / ball + 0.5 / raceway))

            def shape(log_ratio: float) -> tuple[float, float, float]:
                m = -math.expm1(-2 * log_ratio)
                return math.exp(log_ratio), float(ellipk(m)), float(ellipe(m))

            def residual(log_ratio: float, wanted: float = high / low) -> float:
                ratio, k, e = shape(log_ratio)
                return math.log((ratio**2 * e - k) / (k - e) / wanted)

            ratio, k, e = shape(brentq(residual, 1e-3, 12.0, xtol=1e-15, rtol=1e-15))
            cube = 0.75 * compliance / (2 * math.sqrt(low * high))
            cube *= 4 / (math.pi * (1 - ratio**-2)) * ratio**-1.5 * math.sqrt((ratio**2 * e - k) * (k - e))
            total += 1.5 * compliance * k / (math.pi * cube ** (1 / 3) * math.sqrt(ratio))
        return total**-1.5

    def balls(self, bearing: Bearing, q: Array, v: Array) -> Iterator[tuple[float, float, Array, Array]]:
        """Of each ball: deflection, force, gradient of the deflection along all coordinates, direction."""
        inner, _, outer = self.play(bearing, q, v)
        apart, joint = inner - outer, self.mechanism.joint(bearing.joint or "")
        roll, angle = self.weights(bearing), self.ball_angle(bearing, q)
        turn = roll[0] * self.row(bearing.inner_body) + roll[1] * self.row(joint.other(bearing.inner_body))
        for j in range(bearing.balls):
            along = rotation(angle + TURN * j / bearing.balls) @ np.array([1.0, 0.0])
            delta = float(apart.position @ along) - self.value(bearing.clearance) / 2
            gradient = along @ apart.jacobian + float(apart.position @ QUARTER @ along) * turn
            yield delta, self._force(bearing, delta, float(gradient @ v)), gradient, along

    def _force(self, bearing: Bearing, delta: float, rate: float) -> float:
        law, stiffness = bearing.damping.law, self.stiffnesses[bearing.name]
        pressed = max(delta, 0.0)
        elastic = stiffness * pressed**1.5
        numbers = {q.path.rpartition(".")[2]: self.value(q) for q in bearing.damping.numbers}
        if law == "none":
            return elastic
        if law == "tangent":
            return elastic + numbers["ratio"] * 1.5 * stiffness * math.sqrt(pressed) * rate
        if law == "hunt-crossley":
            return elastic * (1 + numbers["hysteresis"] * rate)
        viscous = numbers.get("coefficient", numbers.get("ratio", 0.0) * stiffness)
        if law == "two-sided-gated":
            return elastic + (viscous * rate if delta > 0 else 0.0)
        if law == "one-sided-gated":
            return elastic + (viscous * max(rate, 0.0) if delta > 0 else 0.0)
        assert law == "one-sided"
        return elastic + viscous * max(rate, 0.0)

    def count(self, bearing: Bearing) -> float:
        return 1.0 if bearing.count is None else self.value(bearing.count)

    def ring_force(self, bearing: Bearing, q: Array, v: Array) -> Array:
        """Of the inner ring on the balls of one bearing."""
        return sum((force * along for _, force, _, along in self.balls(bearing, q, v)), start=np.zeros(2))

    def housing_force(self, bearing: Bearing, q: Array, v: Array) -> tuple[Array, Array]:
        """Force of the housings on the outer rings, and the generalized forces of it."""
        assert bearing.outer is not None
        _, housing, ring = self.play(bearing, q, v)
        apart, joint = ring - housing, self.mechanism.joint(bearing.joint or "")
        body = joint.other(bearing.inner_body)
        seen = apart.jacobian - np.outer(
            QUARTER @ apart.position, self.row(body)
        )  # from axes that turn with the housing
        spring = -self.count(bearing) * self.value(bearing.outer.stiffness) * apart.position
        damper = -self.count(bearing) * self.value(bearing.outer.damping) * (seen @ v)
        return spring + damper, spring @ apart.jacobian + damper @ seen

    @cached_property
    def gravity(self) -> Array:
        return np.zeros(2) if self.mechanism.gravity is None else self.vector(self.mechanism.gravity, (0.0, -1.0))

    def masses(self) -> Array:
        out = []
        for body in self.mechanism.bodies:
            inertia = 1.0 if body.inertia is None else self.value(body.inertia)  # none: it does not turn
            inertia += self.value(self.mechanism.driver.flywheel) if body.name == self.driven else 0.0
            out += [self.value(body.mass)] * 2 + [inertia]
        for bearing in self.bearings:
            if bearing.outer is not None:
                out += [self.count(bearing) * self.value(bearing.outer.mass)] * 2
        return np.array(out)

    def weight(self) -> Array:
        along = np.zeros(self.size)
        for k in range(0, 3 * len(self.bodies), 3):
            along[k : k + 2] = self.gravity
        for k in range(3 * len(self.bodies), self.size, 2):
            along[k : k + 2] = self.gravity
        return self.masses() * along

    def gate(self, name: str, angle: float) -> float:
        """1 within the windows of a force."""
        law = next(f.law for f in self.mechanism.forces if f.name == name)
        assert isinstance(law, Windows)
        for window in law.windows:
            start, end = self.value(window.start), self.value(window.end)
            if (angle - start) % TURN < (end - start) % TURN:
                return 1.0
        return 0.0

    def applied(self, q: Array, v: Array, angle: float) -> Array:
        """Generalized forces of loads and springs."""
        out = np.zeros(self.size)
        for force in self.mechanism.forces:
            path, law = force.pathway, force.law
            gate = self.gate(force.name, angle) if isinstance(law, Windows) else 1.0
            if isinstance(path, PointForce):
                place = self.place(path.body, self.arm(path.body, path.point), q, v)
                out += gate * self.vector(path.force) @ place.jacobian
            elif isinstance(path, BodyTorque):
                out += gate * self.value(path.torque) * self.row(path.body)
            else:
                assert isinstance(law, SpringDamper)
                size, slope = self._size(path, q, v)
                amount = self.value(law.preload) + self.value(law.damping) * float(slope @ v)
                if law.stiffness is not None:
                    amount += self.value(law.stiffness) * self._beyond(path, size, self.value(law.free))
                out -= amount * slope
        return out

    def _size(self, path: TwoPoints | TwoBodies, q: Array, v: Array) -> tuple[float, Array]:
        """Length or angle of a spring and its gradient."""
        if isinstance(path, TwoBodies):
            return self.angle(path.bodies[1], q) - self.angle(path.bodies[0], q), self.row(path.bodies[1]) - self.row(
                path.bodies[0]
            )
        one, two = (self.place(b, self.arm(b, p), q, v) for b, p in zip(path.bodies, path.points, strict=True))
        line = two - one
        length = float(np.linalg.norm(line.position))
        return length, line.position / length @ line.jacobian

    @staticmethod
    def _beyond(path: TwoPoints | TwoBodies, size: float, free: float) -> float:
        return size - free if isinstance(path, TwoPoints) else math.remainder(size - free, TURN)

    # what is compared

    def evaluate(self, t: float, x: Array) -> Found:
        """Accelerations, reactions and drive torque at a state."""
        q, v = self.absolute(t, x)
        angle, rate = self.drive(t, x)
        _, rows, _, rest, where = self.constraints(q, v, angle, rate)
        pushed = self.weight() + self.applied(q, v, angle)
        for bearing in self.bearings:
            for _, force, gradient, _ in self.balls(bearing, q, v):
                pushed -= self.count(bearing) * force * gradient
            if bearing.outer is not None:
                pushed += self.housing_force(bearing, q, v)[1]
        if self.motor is not None:
            pushed += self.torque(rate) * self.row(self.driven)
            rows, rest = rows[:-1], rest[:-1]  # the driver's comes last
        a, multipliers = self._solve(rows, pushed, rest)
        held = self.motor is None
        outputs = {"drive_torque": float(multipliers[where["driver"]][0]) if held else self.torque(rate)}
        for joint in self.mechanism.joints:
            if joint.name in self.in_play:
                bearing = self.in_play[joint.name]
                on_inner = -self.count(bearing) * self.ring_force(bearing, q, v)
                if bearing.outer is not None:
                    on_inner = self.housing_force(bearing, q, v)[0]
                reaction = on_inner if bearing.inner_body == joint.bodies[0] else -on_inner
            elif joint.kind == "revolute":
                reaction = -multipliers[where[joint.name]]
            else:
                alpha = self.angle(joint.bodies[0], q) + self.value(joint.direction)
                push, moment = multipliers[where[joint.name]]
                reaction = -push * np.array([-math.sin(alpha), math.cos(alpha)])
                outputs[f"reaction.{joint.name}.moment"] = -moment
            outputs |= {f"reaction.{joint.name}.{axis}": float(f) for axis, f in zip("xy", reaction, strict=True)}
        found = {} if held else {"driver.angle": float(self.row(self.driven) @ a)}
        for bearing in self.bearings:
            prefix = bearing.prefix
            inner, housing, outer = self.play(bearing, q, v)
            pairs = [("inner", inner - housing)] + ([("outer", outer - housing)] if bearing.outer is not None else [])
            for name, apart in pairs:
                second = apart.jacobian @ a + apart.rest
                found |= {f"{prefix}{name}.{axis}": float(s) for axis, s in zip("xy", second, strict=True)}
            force = self.ring_force(bearing, q, v)
            outputs |= {f"{prefix}ring_force.{axis}": float(f) for axis, f in zip("xy", force, strict=True)}
        return Found(found, outputs, np.concatenate([v, a]))

    def _solve(self, rows: Array, pushed: Array, rest: Array) -> tuple[Array, Array]:
        """Accelerations and multipliers, scaled by the masses; one step of refinement."""
        count = len(rest)
        scale = np.sqrt(self.masses())
        matrix = np.block([[np.eye(self.size), -(rows / scale).T], [rows / scale, np.zeros((count, count))]])
        right = np.concatenate([pushed / scale, rest])
        found = np.linalg.solve(matrix, right)
        exact = matrix.astype(np.longdouble), right.astype(np.longdouble)
        found = found + np.linalg.solve(matrix, (exact[1] - exact[0] @ found).astype(float))
        return found[: self.size] / scale, found[self.size :]

    def energy(self, t: float, x: Array) -> float:
        """Kinetic and potential energy [J]: of weight, balls, housings and springs."""
        q, v = self.absolute(t, x)
        total = 0.5 * float(self.masses() @ v**2) - float(self.weight() @ q)
        for bearing in self.bearings:
            stiffness = self.stiffnesses[bearing.name]
            pressed = (max(delta, 0.0) for delta, *_ in self.balls(bearing, q, v))
            total += self.count(bearing) * 0.4 * stiffness * sum(p**2.5 for p in pressed)
            if bearing.outer is not None:
                _, housing, ring = self.play(bearing, q, v)
                shift = ring.position - housing.position
                total += 0.5 * self.count(bearing) * self.value(bearing.outer.stiffness) * float(shift @ shift)
        for force in self.mechanism.forces:
            if isinstance(force.law, SpringDamper):
                size, _ = self._size(force.pathway, q, v)
                beyond = self._beyond(force.pathway, size, self.value(force.law.free))
                total += 0.5 * self.value(force.law.stiffness) * beyond**2 + self.value(force.law.preload) * size
        return total
