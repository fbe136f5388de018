"""A crank-slider press and its bearing written down by hand, for any numbers: the independent reference
of the extreme cases.

Nothing of it comes from the package.  The linkage is solved with complex numbers and one 8 by 8 system of Newton and
Euler's equations at each instant, the bearing by Eqs. (2) to (11) in NumPy, and SciPy integrates from one step of the
load to the next.  The contact stiffness alone is taken from the model, as a number; tests compare it with tables.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from ballpass.runtime import Model

TURN = 2.0 * math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class Linkage:
    """Crank-slider: lengths [m], masses [kg], inertias [kg m^2]; places as complex numbers, in body axes."""

    speed: float
    start: float
    gravity: complex
    crank: float
    crank_center: complex
    crank_mass: float
    rod: float
    rod_center: complex
    rod_mass: float
    rod_inertia: float
    slider_mass: float
    guide: complex
    direction: complex
    punch: complex
    windows: tuple[tuple[float, float], ...]

    def punching(self, angle: float) -> bool:
        """Whether the crank is inside a window."""
        return any(
            last - first >= TURN or (angle - first) % TURN < (last - first) % TURN for first, last in self.windows
        )

    def hinge(self, angle: float, punching: bool) -> complex:
        """Force of the crank on the frame [N]."""
        return self.solve(angle, punching)[0]

    def solve(self, angle: float, punching: bool) -> tuple[complex, float]:
        """Force of the crank on the frame [N] and torque of the drive [N m]."""
        w, l2, d = self.speed, self.rod, self.direction
        arm = cmath.exp(1j * angle)
        pin = self.crank * arm
        velocity, acceleration = 1j * w * pin, -w * w * pin
        # the slider's pin is at guide + s d, ahead of the foot of the perpendicular from the crankpin
        across, along = ((self.guide - pin) * d.conjugate()).imag, -((self.guide - pin) * d.conjugate()).real
        s = along + math.sqrt(l2 * l2 - across * across)
        rod = (self.guide + s * d - pin) / l2
        # velocity + i w2 l2 rod = ds d, and the same with accelerations, solved across and along the guide
        turned = l2 * rod * d.conjugate()
        w2 = -(velocity * d.conjugate()).imag / turned.real
        rest = (acceleration - w2 * w2 * l2 * rod) * d.conjugate()
        a2 = -rest.imag / turned.real
        dds = (rest + 1j * a2 * turned).real
        centers = (
            self.crank_center * arm * (-w * w),
            acceleration + (1j * a2 - w2 * w2) * self.rod_center * rod,
            dds * d,
        )
        # unknowns: force on the crank at A (x, y), on the rod at B, on the slider at C, of the guide, drive torque
        matrix, right = np.zeros((8, 8)), np.zeros(8)
        loads = [
            mass * (center - self.gravity)
            for mass, center in zip((self.crank_mass, self.rod_mass, self.slider_mass), centers, strict=True)
        ]
        loads[2] -= self.punch if punching else 0.0
        near, far = -self.crank_center * arm, pin - self.crank_center * arm
        back, front = -self.rod_center * rod, (l2 - self.rod_center) * rod
        for row, (plus, minus) in enumerate(((0, 2), (2, 4))):
            for axis in range(2):
                matrix[2 * row + axis, plus + axis], matrix[2 * row + axis, minus + axis] = 1.0, -1.0
        normal = 1j * d
        matrix[4, 4] = matrix[5, 5] = 1.0
        matrix[4, 6], matrix[5, 6] = normal.real, normal.imag
        for row, load in enumerate(loads):
            right[2 * row], right[2 * row + 1] = load.real, load.imag
        matrix[6, :4] = (-near.imag, near.real, far.imag, -far.real)
        matrix[6, 7] = 1.0
        matrix[7, 2:6] = (-back.imag, back.real, front.imag, -front.real)
        right[7] = self.rod_inertia * a2
        unknown = np.linalg.solve(matrix, right)
        return -complex(unknown[0], unknown[1]), float(unknown[7])

    def travel(self, angle: float) -> float:
        """Place of the slider's pin along the guide [m]."""
        pin = self.crank * cmath.exp(1j * angle)
        local = (self.guide - pin) * self.direction.conjugate()
        return -local.real + math.sqrt(self.rod**2 - local.imag**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing:
    """Ring masses [kg], contact, housing; without `outer_mass` the outer ring is fixed."""

    balls: int
    ball_angle: float
    cage_speed: float
    clearance: float
    stiffness: float
    law: str
    coefficient: float
    inner_mass: float
    inner_damping: float
    outer_mass: float | None
    housing_stiffness: float
    housing_damping: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """Bearing under the share of the hinge's force, or under a load over time [N]."""

    bearing: Bearing
    linkage: Linkage | None
    share: float
    load: Callable[[float], complex]

    @classmethod
    def of(cls, model: Model, parameters: Mapping[str, float] | None = None) -> Self:
        """The machine with a model's numbers; the load of a scene without linkage is its constant one."""
        p = {**model.parameters, **(parameters or {})}
        c = model.constants(dict(parameters or {}))
        info = model.manifest.bearing
        if info is None:
            raise ValueError(f"{model.manifest.scene} has no bearing")
        shaft = p[info.ring_speed]
        cage = 0.5 * shaft * (1.0 - p["bearing.ball_diameter"] / p["bearing.pitch_diameter"])  # Eq. (7)
        bearing = Bearing(
            balls=info.balls,
            ball_angle=p["bearing.ball_angle"],
            cage_speed=cage,
            clearance=p["bearing.clearance"],
            stiffness=c["bearing.k_b"],
            law=info.damping.law,
            coefficient=c.get("bearing.c_b", 0.0),
            inner_mass=c["bearing.m_ei"],
            inner_damping=p.get("bearing.inner_ring.damping", 0.0),
            outer_mass=p.get("bearing.outer_ring.mass"),
            housing_stiffness=p.get("bearing.outer_ring.stiffness", 0.0),
            housing_damping=p.get("bearing.outer_ring.damping", 0.0),
        )
        if model.manifest.mechanism is None:
            force = complex(p.get("load.force.x", 0.0), p.get("load.force.y", 0.0))
            return cls(bearing=bearing, linkage=None, share=1.0, load=lambda t: force)
        return cls(bearing=bearing, linkage=_linkage(p), share=p["bearing.share"], load=lambda t: 0j)

    def force(self, t: float, punching: bool) -> complex:
        """Load on the inner ring [N]."""
        if self.linkage is None:
            return self.load(t)
        return self.share * self.linkage.hinge(self.linkage.start + self.linkage.speed * t, punching)

    def equilibrium(self, t: float, punching: bool, guess: np.ndarray) -> np.ndarray:
        """Positions at rest that balance the load of an instant, near a guess, shape (coordinates,) [m]."""
        half = len(guess)
        unit = 1e-6

        def residual(z: np.ndarray) -> np.ndarray:
            return self.rate(t, np.concatenate([unit * z, np.zeros(half)]), punching)[half:]

        found = root(residual, guess / unit, tol=1e-13)
        return np.asarray(unit * found.x)

    def balls(self, t: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Elastic and total force of every ball [N], cosine and sine of its angle."""
        b = self.bearing
        angles = b.ball_angle + TURN * np.arange(b.balls) / b.balls + b.cage_speed * t
        cos, sin = np.cos(angles), np.sin(angles)
        half = len(x) // 2
        gap, rate = x[:2].copy(), x[half : half + 2].copy()
        if half == 4:
            gap -= x[2:4]
            rate -= x[6:8]
        pressed = gap[0] * cos + gap[1] * sin - 0.5 * b.clearance
        closing = rate[0] * cos + rate[1] * sin + b.cage_speed * (gap[1] * cos - gap[0] * sin)
        root = np.sqrt(np.maximum(pressed, 0.0))
        elastic = b.stiffness * root**3
        touching = pressed > 0.0
        damping = {
            "none": lambda: 0.0 * closing,
            "one-sided": lambda: b.coefficient * np.maximum(closing, 0.0),
            "one-sided-gated": lambda: b.coefficient * np.maximum(closing, 0.0) * touching,
            "two-sided-gated": lambda: b.coefficient * closing * touching,
            "tangent": lambda: b.coefficient * 1.5 * b.stiffness * root * closing,
        }[b.law]()
        return elastic, elastic + damping, cos, sin

    def rate(self, t: float, x: np.ndarray, punching: bool) -> np.ndarray:
        """Time derivative of the states, positions first."""
        b = self.bearing
        _, force, cos, sin = self.balls(t, x)
        contact = np.array([force @ cos, force @ sin])
        load = self.force(t, punching)
        half = len(x) // 2
        v = x[half:]
        inner = (np.array([load.real, load.imag]) - contact - b.inner_damping * v[:2]) / b.inner_mass
        if b.outer_mass is None:
            return np.concatenate([v, inner])
        outer = (contact - b.housing_stiffness * x[2:4] - b.housing_damping * v[2:4]) / b.outer_mass
        return np.concatenate([v, inner, outer])

    def edges(self, begin: float, end: float) -> list[float]:
        """Begin, the passages of window edges in between, end [s]."""
        found = [begin, end]
        if self.linkage is not None and self.linkage.speed:
            for edge in (edge for window in self.linkage.windows for edge in window):
                first = (edge - self.linkage.start) % TURN / self.linkage.speed
                period = TURN / self.linkage.speed
                k = np.arange(math.floor((begin - first) / period) - 1, math.ceil((end - first) / period) + 2)
                found += [float(t) for t in first + k * period if begin < t < end]
        return sorted(found)

    def integrate(
        self,
        times: Sequence[float] | np.ndarray,
        start: np.ndarray,
        *,
        method: str = "DOP853",
        rtol: float = 1e-10,
        magnitude: np.ndarray | None = None,
        **options: Any,
    ) -> np.ndarray:
        """States at increasing `times`, the first of which is the start's; shape (times, states).

        Parameters
        ----------
        magnitude : of the states: errors of `rtol` of it are let pass as well
        """
        times = np.asarray(times, dtype=float)
        size = np.full(len(start), 1e-5) if magnitude is None else magnitude
        states = np.empty((len(times), len(start)))
        state = np.array(start, dtype=float)
        edges = self.edges(float(times[0]), float(times[-1]))
        for left, right in pairwise(edges):
            if right <= left:
                continue
            inside = np.flatnonzero((left <= times) & ((times < right) | (right == edges[-1])))
            punching = False
            if self.linkage is not None:
                punching = self.linkage.punching(self.linkage.start + self.linkage.speed * 0.5 * (left + right))
            run = solve_ivp(
                self.rate,
                (left, right),
                state,
                method=method,
                t_eval=np.unique([left, *times[inside], right]),
                rtol=rtol,
                atol=rtol * size,
                args=(punching,),
                **options,
            )
            if not run.success:
                raise RuntimeError(f"the reference failed: {run.message}")
            places = np.searchsorted(run.t, times[inside])
            states[inside] = run.y.T[places]
            state = run.y[:, -1]
        return states


def _linkage(p: Mapping[str, float]) -> Linkage:
    def vector(key: str) -> complex:
        if key in p:
            return complex(p[key], 0.0)
        if f"{key}.distance" in p:
            return cmath.rect(p[f"{key}.distance"], p[f"{key}.angle"])
        return complex(p.get(f"{key}.x", 0.0), p.get(f"{key}.y", 0.0))

    windows = []
    number = 0
    while True:
        number += 1
        base = "mechanism.forces.punch.window" + ("" if number == 1 else f".{number}")
        if f"{base}.start" not in p:
            base = f"mechanism.forces.punch.window.{number}"
        if f"{base}.start" not in p:
            break
        windows.append((p[f"{base}.start"], p[f"{base}.end"]))
    gravity = vector("mechanism.gravity")
    if "mechanism.gravity.magnitude" in p:
        gravity = cmath.rect(p["mechanism.gravity.magnitude"], p["mechanism.gravity.direction"])
    elif "mechanism.gravity" in p:
        gravity = -1j * p["mechanism.gravity"]
    punch = vector("mechanism.forces.punch.force")
    if "mechanism.forces.punch.force.magnitude" in p:
        punch = cmath.rect(p["mechanism.forces.punch.force.magnitude"], p["mechanism.forces.punch.force.direction"])
    return Linkage(
        speed=p["mechanism.driver.speed"],
        start=p["mechanism.driver.start_angle"],
        gravity=gravity,
        crank=p["mechanism.bodies.crank.points.B"],
        crank_center=vector("mechanism.bodies.crank.center_of_mass"),
        crank_mass=p["mechanism.bodies.crank.mass"],
        rod=p["mechanism.bodies.rod.points.C"],
        rod_center=vector("mechanism.bodies.rod.center_of_mass"),
        rod_mass=p["mechanism.bodies.rod.mass"],
        rod_inertia=p["mechanism.bodies.rod.inertia"],
        slider_mass=p["mechanism.bodies.slider.mass"],
        guide=vector("mechanism.frame.points.guide"),
        direction=cmath.rect(1.0, p["mechanism.joints.D.direction"]),
        punch=punch,
        windows=tuple(windows),
    )
