"""A second implementation of machines with bearings, for tests alone: absolute coordinates and Lagrange multipliers.

In: a checked scene.  Out: accelerations, reactions, drive torque, energies at a state.

Ideal joints and a driver at constant speed are constraints; a bearing is a force between two points, ball by ball.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from absolute import QUARTER, TURN, Absolute, Array, rotation
from ball_effects import taken
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from ballpass.derive.mechanism.forces import BodyTorque, Friction, PistonPressure, PointForce, Windows
from ballpass.derive.mechanism.forces.along_direction import AlongDirection
from ballpass.derive.mechanism.forces.angle_table import AngleTable
from ballpass.derive.mechanism.forces.spring_damper import SpringDamper
from ballpass.derive.mechanism.forces.stop import Stop
from ballpass.derive.mechanism.forces.two_bodies import TwoBodies
from ballpass.derive.mechanism.forces.two_points import TwoPoints
from ballpass.derive.scene.bearing_records import Bearing, GivenContact
from ballpass.derive.scene.mechanism_records import Gear
from ballpass.derive.scene.table import FRAME


@dataclass
class Found:
    """Accelerations by coordinate of the scene, reactions by output, and accelerations of the absolute coordinates."""

    accelerations: dict[str, float]
    outputs: dict[str, float]
    absolute: Array


class Multibody(Absolute):
    """Forces on a scene's machine, and how it moves under them."""

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

    def ball_angle(self, bearing: Bearing, q: Array) -> float:
        """Rolling from the ideal linkage at the start: each ring's turn with its weight, less the lag of the cage."""
        weights = self.weights(bearing, math.inf)
        turned = (w * angle for w, angle in zip(weights, self.turned(bearing, q), strict=True))
        return self.value(bearing.ball_angle) + sum(turned) - self.lags.get(bearing.name, 0.0)

    def turned(self, bearing: Bearing, q: Array) -> tuple[float, float]:
        """How far the inner and the outer ring have turned since the start."""
        start, joint = self._chain[0][1], self.mechanism.joint(bearing.joint or "")
        inner, outer = bearing.inner_body, joint.other(bearing.inner_body)
        return self.angle(inner, q) - self.angle(inner, start), self.angle(outer, q) - self.angle(outer, start)

    def known_lag(self, bearing: Bearing, time: float) -> float:
        """Lag of a cage between rings that turn with the driver, which a table or a speed gives: row by row."""
        assert bearing.cage is not None
        rows = [self.value(row) for row in bearing.cage.time]
        total = self.value(bearing.cage.lag)
        for begin, end in pairwise([*(row for row in rows if row < time), time]):
            moved = self.driver_at(end)[0] - self.driver_at(begin)[0]
            lost = np.subtract(self.weights(bearing, math.inf), self.weights(bearing, 0.5 * (begin + end)))
            total += float(lost @ [moved if body == self.driven else 0.0 for body in self.rings(bearing)])
        return total

    def slip(self, bearing: Bearing, time: float) -> float:
        """Of the cage: that of the row that holds."""
        if bearing.cage is None or not bearing.cage.time:
            return 0.0 if bearing.cage is None else self.value(bearing.cage.slip)
        rows = zip(bearing.cage.time, bearing.cage.slips, strict=True)
        return [self.value(slip) for start, slip in rows if self.value(start) <= time][-1]

    def weights(self, bearing: Bearing, time: float | None = None) -> tuple[float, float]:
        """Raceways' radii roll on the ball: R_i w_i + R_o w_o over their sum; a cage that slips keeps less of the way
        over the ring that stands, or the outer one.  None: now."""
        rolling, pitch = self.cosine(bearing) * self.value(bearing.ball_diameter), self.value(bearing.pitch_diameter)
        inner, outer = (pitch - rolling) / 2, (pitch + rolling) / 2
        kept = 1.0 - self.slip(bearing, self.time if time is None else time)
        if bearing.inner_body == FRAME:
            return 1.0 - kept * outer / (inner + outer), kept * outer / (inner + outer)
        return kept * inner / (inner + outer), 1.0 - kept * inner / (inner + outer)

    def cosine(self, bearing: Bearing) -> float:
        """Of the contact angle."""
        return 1.0 if bearing.contact_angle is None else math.cos(self.value(bearing.contact_angle))

    def taken(self, bearing: Bearing, ball: int, q: Array) -> tuple[float, float]:
        """What effects take from a ball's deflection, and its slope over the inner ring's angle against the outer."""
        angle, (inner, outer) = self.ball_angle(bearing, q), self.turned(bearing, q)
        (share, _), (end, _), step = self.weights(bearing), self.weights(bearing, math.inf), 1e-200j
        angle += TURN * (ball - 1) / bearing.balls
        # the circle of contacts on the outer raceway over the ball's radius
        passed = self.cosine(bearing) + self.value(bearing.pitch_diameter) / self.value(bearing.ball_diameter)
        found = taken(
            bearing,
            self.value,
            ball,
            angle - outer + share * step,
            angle - inner + (share - 1) * step,
            passed * (end * (inner - outer) - self.lags.get(bearing.name, 0.0) + share * step),
        )
        return found.real, found.imag / step.imag

    @cached_property
    def stiffnesses(self) -> dict[str, float]:
        return {b.name: self._stiffness(b) for b in self.bearings}

    def _stiffness(self, bearing: Bearing) -> float:
        """k_b: given, or both contacts in series by Hertz (K. L. Johnson, Contact Mechanics, Eqs. 4.25 to 4.28)."""
        contact = bearing.contact
        if isinstance(contact, GivenContact):
            return self.value(contact.stiffness)
        if bearing.element == "cylindrical-roller":  # of steel: both contacts approach alike (Palmgren, mm and N)
            return (2 * 3.84e-8 * (1e3 * self.value(contact.length)) ** -0.8) ** (-10 / 9)
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
        """Of each ball: deflection, force, gradient of the deflection along all coordinates, what of it is radial."""
        inner, _, outer = self.play(bearing, q, v)
        apart, joint = inner - outer, self.mechanism.joint(bearing.joint or "")
        roll, angle = self.weights(bearing), self.ball_angle(bearing, q)
        turn = roll[0] * self.row(bearing.inner_body) + roll[1] * self.row(joint.other(bearing.inner_body))
        for j in range(bearing.balls):
            along = self.cosine(bearing) * rotation(angle + TURN * j / bearing.balls) @ np.array([1.0, 0.0])
            delta = float(apart.position @ along) - self.cosine(bearing) * self.value(bearing.clearance) / 2
            gradient = along @ apart.jacobian + float(apart.position @ QUARTER @ along) * turn
            if bearing.effects:
                amount, slope = self.taken(bearing, j + 1, q)
                against = self.row(bearing.inner_body) - self.row(joint.other(bearing.inner_body))
                delta, gradient = delta - amount, gradient - slope * against
            yield delta, self._force(bearing, delta, float(gradient @ v)), gradient, along

    def _force(self, bearing: Bearing, delta: float, rate: float) -> float:
        law, stiffness = bearing.damping.law, self.stiffnesses[bearing.name]
        pressed, exponent = max(delta, 0.0), {"ball": 1.5, "cylindrical-roller": 10 / 9}[bearing.element]
        elastic = stiffness * pressed**exponent
        numbers = {q.path.rpartition(".")[2]: self.value(q) for q in bearing.damping.numbers}
        if law == "none":
            return elastic
        if law == "tangent":
            return elastic + numbers["ratio"] * exponent * stiffness * pressed ** (exponent - 1) * rate
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
        if self.size > self.tilt:
            out += [self.value(self.mechanism.body(self.driven).transverse_inertia)] * 2
        return np.array(out)

    def weight(self) -> Array:
        along = np.zeros(self.size)
        for k in range(0, 3 * len(self.bodies), 3):
            along[k : k + 2] = self.gravity
        for k in range(3 * len(self.bodies), self.tilt, 2):
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

    def interpolated(self, law: AngleTable, angle: float) -> float:
        """Amount by a table over the driver's angle."""
        columns = ([self.value(q) for q in column] for column in (law.angle, law.values))
        return float(np.interp(angle, *columns, period=TURN))

    def along(self, direction: object) -> Array:
        return np.array([math.cos(self.value(direction)), math.sin(self.value(direction))])

    def applied(self, q: Array, v: Array, angle: float) -> Array:
        """Generalized forces of loads and springs."""
        out = np.zeros(self.size)
        for force in self.mechanism.forces:
            path, law = force.pathway, force.law
            gate = self.gate(force.name, angle) if isinstance(law, Windows) else 1.0
            rows = self.interpolated(law, angle) if isinstance(law, AngleTable) else None
            if isinstance(path, PistonPressure):
                place = self.place(path.body, self.arm(path.body, path.point), q, v)
                over = (self.value(path.pressure) if rows is None else rows) - self.value(path.ambient)
                size = gate * over * math.pi * (self.value(path.bore) / 2.0) ** 2
                out += size * self.along(path.direction) @ place.jacobian
            elif isinstance(path, PointForce):
                place = self.place(path.body, self.arm(path.body, path.point), q, v)
                vector = gate * self.vector(path.force) if rows is None else rows * self.along(path.direction)
                out += vector @ place.jacobian
            elif isinstance(path, BodyTorque):
                out += (gate * self.value(path.torque) if rows is None else rows) * self.row(path.body)
            elif isinstance(law, Friction):
                slope = self._joint_slope(path.joint, q, v)
                rate = float(slope @ v)
                amount = self.value(law.viscous) * rate
                if law.coulomb is not None:
                    amount += self.value(law.coulomb) * math.tanh(rate / self.value(law.smoothing))
                out -= amount * slope
            elif isinstance(law, Stop):
                size, slope = self._size(path, q, v)
                pressed = max(-self._beyond(path, size, self.value(law.free)), 0.0)
                factor = max(1.0 - self.value(law.hysteresis) * float(slope @ v), 0.0)
                out += self.value(law.stiffness) * pressed * factor * slope
            else:
                assert isinstance(law, SpringDamper)
                size, slope = self._size(path, q, v)
                amount = self.value(law.preload) + self.value(law.damping) * float(slope @ v)
                if law.stiffness is not None:
                    amount += self.value(law.stiffness) * self._beyond(path, size, self.value(law.free))
                out -= amount * slope
        return out

    def _joint_slope(self, name: str, q: Array, v: Array) -> Array:
        """Gradient of the angle, or of the travel, that a joint leaves free."""
        joint = self.mechanism.joint(name)
        if joint.kind == "revolute":
            return self.row(joint.bodies[1]) - self.row(joint.bodies[0])
        one, two = (self.place(b, self.arm(b, p), q, v) for b, p in zip(joint.bodies, joint.points, strict=True))
        angle = self.angle(joint.bodies[0], q) + self.value(joint.direction)
        return np.array([math.cos(angle), math.sin(angle)]) @ (two - one).jacobian

    def _size(self, path: TwoPoints | TwoBodies | AlongDirection, q: Array, v: Array) -> tuple[float, Array]:
        """Length or angle of a spring, distance of a stop, and its gradient."""
        if isinstance(path, TwoBodies):
            return self.angle(path.bodies[1], q) - self.angle(path.bodies[0], q), self.row(path.bodies[1]) - self.row(
                path.bodies[0]
            )
        one, two = (self.place(b, self.arm(b, p), q, v) for b, p in zip(path.bodies, path.points, strict=True))
        line = two - one
        if isinstance(path, AlongDirection):
            angle = self.angle(path.bodies[0], q) + self.value(path.direction)
            normal = np.array([math.cos(angle), math.sin(angle)])
            turned = float(QUARTER @ normal @ line.position) * self.row(path.bodies[0])
            return float(normal @ line.position), normal @ line.jacobian + turned
        length = float(np.linalg.norm(line.position))
        return length, line.position / length @ line.jacobian

    @staticmethod
    def _beyond(path: TwoPoints | TwoBodies | AlongDirection, size: float, free: float) -> float:
        return math.remainder(size - free, TURN) if isinstance(path, TwoBodies) else size - free

    # what is compared

    def evaluate(self, t: float, x: Array) -> Found:
        """Accelerations, reactions and drive torque at a state."""
        self.acceleration = self.slope(t)
        return self.move(*self.absolute(t, x))

    def move(self, q: Array, v: Array) -> Found:
        """The same at positions and velocities of the absolute coordinates."""
        angle, rate = self.angle(self.driven, q), float(self.row(self.driven) @ v)
        _, rows, _, rest, where = self.constraints(q, v, angle, rate)
        pushed = self.weight() + self.applied(q, v, angle)
        for bearing in self.bearings:
            for _, force, gradient, _ in self.balls(bearing, q, v):
                pushed -= self.count(bearing) * force * gradient
            if bearing.outer is not None:
                pushed += self.housing_force(bearing, q, v)[1]
        if self.size > self.tilt:  # J_t s'' = M + gyroscopic moments
            turning = self.value(self.mechanism.body(self.driven).inertia) * rate
            pushed[self.tilt :] += turning * QUARTER @ v[self.tilt :]
        if self.motor is not None:
            pushed += self.torque(rate) * self.row(self.driven)
            rows, rest = rows[:-1], rest[:-1]  # the driver's comes last
        a, multipliers = self._solve(rows, rows, pushed, rest)
        sides = {gear.name: 1.0 for gear in self.mechanism.gears}
        for gear in self.mechanism.gears * 2:  # the flank that pushes
            teeth = rows.copy()
            for one in self.mechanism.gears:
                teeth[where[one.name]] = self.pressure(one, q, sides[one.name])[0]
            a, multipliers = self._solve(rows, teeth, pushed, rest)
            if multipliers[where[gear.name]][0] < 0.0:
                sides[gear.name] *= -1.0
        held = self.motor is None
        outputs = {"drive_torque": float(multipliers[where["driver"]][0]) if held else self.torque(rate)}
        for joint in self.mechanism.joints:
            if joint.name in self.in_play:
                on_inner = np.zeros(2)
                for bearing in self.in_play[joint.name]:
                    held = bearing.outer is not None
                    ring_force = -self.count(bearing) * self.ring_force(bearing, q, v)
                    on_inner += self.housing_force(bearing, q, v)[0] if held else ring_force
                reaction = on_inner if bearing.inner_body == joint.bodies[0] else -on_inner
            elif joint.kind == "revolute":
                reaction = -multipliers[where[joint.name]]
            else:
                alpha = self.angle(joint.bodies[0], q) + self.value(joint.direction)
                push, moment = multipliers[where[joint.name]]
                reaction = -push * np.array([-math.sin(alpha), math.cos(alpha)])
                outputs[f"reaction.{joint.name}.moment"] = -moment
            outputs |= {f"reaction.{joint.name}.{axis}": float(f) for axis, f in zip("xy", reaction, strict=True)}
        for gear in self.mechanism.gears:
            (size,), along = multipliers[where[gear.name]], self.pressure(gear, q, sides[gear.name])[1]
            outputs |= {f"reaction.{gear.name}.{axis}": float(size * f) for axis, f in zip("xy", along, strict=True)}
            outputs[f"gear.{gear.name}.force"] = float(size)
        found = {} if not self.free else {"driver.angle": float(self.row(self.driven) @ a)}
        for bearing in self.bearings:
            prefix = bearing.prefix
            inner, housing, outer = self.play(bearing, q, v)
            pairs = [("inner", inner - housing)] if bearing in self.first else []
            pairs += [("outer", outer - housing)] if bearing.outer is not None else []
            for name, apart in pairs:
                second = apart.jacobian @ a + apart.rest
                found |= {f"{prefix}{name}.{axis}": float(s) for axis, s in zip("xy", second, strict=True)}
            force = self.ring_force(bearing, q, v)
            outputs |= {f"{prefix}ring_force.{axis}": float(f) for axis, f in zip("xy", force, strict=True)}
            if bearing in self.lagging:
                bodies = bearing.inner_body, self.mechanism.joint(bearing.joint or "").other(bearing.inner_body)
                lost = np.subtract(self.weights(bearing, math.inf), self.weights(bearing))
                found[f"{prefix}cage.lag_integral"] = float(lost @ [self.row(body) @ v for body in bodies])
        return Found(found, outputs, a)

    def pressure(self, gear: Gear, q: Array, side: float) -> tuple[Array, Array]:
        """Along the line of pressure on the first wheel: the generalized forces of a force, and its direction."""
        ends = [self.axle(gear, body, q) for body in gear.bodies]
        across, sense = ends[1] - ends[0], 1.0 if gear.kind == "internal" else -1.0
        pitch_point = ends[0]
        if gear.kind != "belt":
            pitch_point = ends[0] + gear.teeth[0] / (gear.teeth[0] - sense * gear.teeth[1]) * across
        alpha, along = self.value(gear.pressure_angle), across / np.linalg.norm(across)
        line = side * math.cos(alpha) * QUARTER @ along + sense * math.sin(alpha) * along
        if gear.kind == "belt":  # along the common tangent of both circles, on one of its sides
            first, apart = self.value(gear.radius), np.linalg.norm(across)
            radii = first, first * gear.teeth[1] / gear.teeth[0]
            tilt = math.asin((radii[1] - radii[0]) / apart)
            line = rotation(-side * tilt) @ along
            pitch_point = ends[0] + radii[0] * side * (-QUARTER @ line)
        slopes = []
        for body in gear.bodies:
            k = 0 if body == FRAME else 3 * self.bodies.index(body)
            arm = pitch_point if body == FRAME else rotation(-q[k + 2]) @ (pitch_point - q[k : k + 2])
            slopes.append(self.place(body, arm, q, np.zeros(self.size)).jacobian)
        return line @ (slopes[0] - slopes[1]), line

    def _solve(self, rows: Array, forces: Array, pushed: Array, rest: Array) -> tuple[Array, Array]:
        """Accelerations and multipliers, scaled by the masses; one step of refinement.

        `forces` are those of the constraints in `rows`, which do no work.
        """
        count = len(rest)
        scale = np.sqrt(self.masses())
        matrix = np.block([[np.eye(self.size), -(forces / scale).T], [rows / scale, np.zeros((count, count))]])
        right = np.concatenate([pushed / scale, rest])
        found = np.linalg.solve(matrix, right)
        exact = matrix.astype(np.longdouble), right.astype(np.longdouble)
        found = found + np.linalg.solve(matrix, (exact[1] - exact[0] @ found).astype(float))
        return found[: self.size] / scale, found[self.size :]

    def state(self, q: Array, v: Array) -> Array:
        """State of the scene at absolute coordinates, that of a driver whose speed changes included."""
        positions, velocities = [], []
        for bearing in self.bearings:
            inner, housing, outer = self.play(bearing, q, v)
            rings = [inner - housing] if bearing in self.first else []
            for apart in rings + ([outer - housing] if bearing.outer is not None else []):
                positions += [*apart.position]
                velocities += [*apart.velocity]
        if self.free:
            positions.append(self.angle(self.driven, q))
            velocities.append(float(self.row(self.driven) @ v))
        lags = [self.lags[bearing.name] for bearing in self.lagging]
        return np.array([*positions, *(0.0 for _ in lags), *velocities, *lags])

    def energy(self, t: float, x: Array) -> tuple[float, float]:
        """Kinetic energy, and potential energy of weight, balls, housings and springs [J]."""
        q, v = self.absolute(t, x)
        total = -float(self.weight() @ q)
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
        return 0.5 * float(self.masses() @ v**2), total
