"""The press written by hand, once, for every contender that does not come with the project.

In: numbers of a model.  Out: dx/dt in NumPy, numba, JAX; cvode.c has the same in C.  A crank-slider on its centre line
with a balanced crank, balls of one kind, an elastic outer ring, one-sided or tangent damping.  The formulas were
derived apart from the project's generated equations, and `disagreement` holds both against each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from ballpass.runtime.model import Model


class Press(NamedTuple):
    """Numbers of the press, SI; the order is that of the struct in cvode.c."""

    speed: float
    cage_speed: float
    ball_angle: float
    crank: float
    rod: float
    rod_centre: float
    m_crank: float
    m_rod: float
    j_rod: float
    m_slider: float
    gravity: float
    punch: float
    share: float
    m_inner: float
    m_outer: float
    stiffness: float
    damping: float
    half_clearance: float
    contact: float
    rate: float
    tangent: float
    window_start: float
    window_end: float


def press_numbers(model: Model, parameters: dict[str, float]) -> Press:
    """Numbers of a press model for the formulas here.

    Raises
    ------
    ValueError
        The model is not the press these formulas hold for.
    """
    v = model.numbers(parameters).values
    ratio = next(p for p in model.manifest.parameters if p.name == "bearing.damping.ratio")
    tangent = ratio.unit == "s"  # else the ratio of c_b to k_b
    numbers = Press(
        speed=v["mechanism.driver.speed"],
        cage_speed=v["bearing.cage_speed"],
        ball_angle=v["bearing.ball_angle"],
        crank=v["mechanism.bodies.crank.points.B"],
        rod=v["mechanism.bodies.rod.points.C"],
        rod_centre=v["mechanism.bodies.rod.center_of_mass"],
        m_crank=v["mechanism.bodies.crank.mass"],
        m_rod=v["mechanism.bodies.rod.mass"],
        j_rod=v["mechanism.bodies.rod.inertia"],
        m_slider=v["mechanism.bodies.slider.mass"],
        gravity=v["mechanism.gravity"],
        punch=v["mechanism.forces.punch.force.y"],
        share=v["bearing.share"],
        m_inner=v["bearing.m_ei"],
        m_outer=v["bearing.outer_ring.mass"],
        stiffness=v["bearing.outer_ring.stiffness"],
        damping=v["bearing.outer_ring.damping"],
        half_clearance=0.5 * v["bearing.clearance"],
        contact=v["bearing.k_b"],
        rate=v[ratio.name] * (1.0 if tangent else v["bearing.k_b"]),
        tangent=float(tangent),
        window_start=v["mechanism.forces.punch.window.start"],
        window_end=v["mechanism.forces.punch.window.end"],
    )
    fitting = (
        v["mechanism.bodies.crank.center_of_mass.distance"] == 0.0
        and v["mechanism.forces.punch.force.x"] == 0.0
        and v["mechanism.driver.start_angle"] == 0.0
        and abs(v["mechanism.joints.D.direction"] - 1.5 * math.pi) < 1e-12
        and numbers.half_clearance >= 0.0
    )
    if not fitting:
        raise ValueError(
            "press: a balanced crank, a vertical guide below it and a clearance are what the formulas hold for"
        )
    return numbers


Load = Callable[[Press, float, Any], tuple[Any, Any]]


def make_load(xp: ModuleType) -> Load:
    """Load on the inner ring as a function of numbers, gate and time; `xp`: math or jax.numpy."""

    def load(n, gate, t):  # type: ignore[no-untyped-def]
        angle = n.speed * t
        w = n.speed
        x = n.crank * xp.cos(angle)
        y = n.crank * xp.sin(angle)
        vx = -w * y
        ax = -w * w * x
        ay = -w * w * y
        span = xp.sqrt(n.rod * n.rod - x * x)
        turning = -vx / span
        turning_t = -(ax + x * turning * turning) / span
        slider = ay - vx * turning - x * turning_t
        part = n.rod_centre / n.rod
        gx = (1.0 - part) * ax
        gy = (1.0 - part) * ay + part * slider
        qy = gate * n.punch - n.m_slider * (slider + n.gravity)
        moment = x * (qy - part * n.m_rod * (n.gravity + gy)) + n.j_rod * turning_t + n.m_rod * part * span * gx
        return (
            n.share * (moment / span - n.m_rod * gx),
            n.share * (qy - n.m_rod * (gy + n.gravity) - n.m_crank * n.gravity),
        )

    return load


Rate = Callable[[Press, float, Any, Any], Any]


def make_vector_rate(
    xp: ModuleType, load: Load, balls: int, tangent: bool, root_of: Callable[[Any], Any] | None = None
) -> Rate:
    """dx/dt with the balls as a vector.

    Parameters
    ----------
    xp : numpy or jax.numpy
    root_of : a square root whose derivative at zero is finite, where one is needed
    """
    square_root = root_of or xp.sqrt
    spread = 2.0 * np.pi * np.arange(balls) / balls

    def rate(n, gate, t, x):  # type: ignore[no-untyped-def]
        load_x, load_y = load(n, gate, t)
        angle = spread + (n.ball_angle + n.cage_speed * t)
        co, si = xp.cos(angle), xp.sin(angle)
        rx, ry = x[0] - x[2], x[1] - x[3]
        vx = x[4] - x[6] + n.cage_speed * ry
        vy = x[5] - x[7] - n.cage_speed * rx
        deflection = xp.maximum(rx * co + ry * si - n.half_clearance, 0.0)
        closing = vx * co + vy * si
        root = square_root(deflection)
        if tangent:
            force = n.contact * root * (deflection + 1.5 * n.rate * closing)
        else:
            force = n.contact * root * deflection + n.rate * xp.maximum(closing, 0.0)
        fx, fy = force @ co, force @ si
        return xp.array(
            [
                x[4],
                x[5],
                x[6],
                x[7],
                (load_x - fx) / n.m_inner,
                (load_y - fy) / n.m_inner,
                (fx - n.stiffness * x[2] - n.damping * x[6]) / n.m_outer,
                (fy - n.stiffness * x[3] - n.damping * x[7]) / n.m_outer,
            ]
        )

    return rate


def make_loop_rate(load: Load, balls: int) -> Callable[[Press, float, float, Any, Any], None]:
    """dx/dt into an array, with a loop over the balls and one sine and cosine for all: for numba."""
    spread_cos = np.cos(2.0 * np.pi * np.arange(balls) / balls)
    spread_sin = np.sin(2.0 * np.pi * np.arange(balls) / balls)

    def rate(n, gate, t, x, dx):  # type: ignore[no-untyped-def]
        load_x, load_y = load(n, gate, t)
        angle = n.ball_angle + n.cage_speed * t
        c, s = math.cos(angle), math.sin(angle)
        rx, ry = x[0] - x[2], x[1] - x[3]
        vx = x[4] - x[6] + n.cage_speed * ry
        vy = x[5] - x[7] - n.cage_speed * rx
        fx = 0.0
        fy = 0.0
        for j in range(balls):
            co = spread_cos[j] * c - spread_sin[j] * s
            si = spread_sin[j] * c + spread_cos[j] * s
            deflection = max(rx * co + ry * si - n.half_clearance, 0.0)
            closing = vx * co + vy * si
            root = math.sqrt(deflection)
            if n.tangent != 0.0:
                force = n.contact * root * (deflection + 1.5 * n.rate * closing)
            else:
                force = n.contact * root * deflection + n.rate * max(closing, 0.0)
            fx += force * co
            fy += force * si
        dx[0] = x[4]
        dx[1] = x[5]
        dx[2] = x[6]
        dx[3] = x[7]
        dx[4] = (load_x - fx) / n.m_inner
        dx[5] = (load_y - fy) / n.m_inner
        dx[6] = (fx - n.stiffness * x[2] - n.damping * x[6]) / n.m_outer
        dx[7] = (fy - n.stiffness * x[3] - n.damping * x[7]) / n.m_outer

    return rate


def disagreement(
    model: Model, parameters: dict[str, float], rate: Rate, magnitude: np.ndarray, count: int = 200, seed: int = 7
) -> float:
    """Largest relative difference between a rate written here and the model's own, at random times and states.

    Accelerations are compared with the largest of them at the point: where forces cancel, one alone may be anything.
    """
    random = np.random.default_rng(seed)
    numbers = press_numbers(model, parameters)
    values = model.numbers(parameters)
    period = model.period(parameters)
    kernel = model.kernel("rhs")
    worst = 0.0
    for _ in range(count):
        t = float(random.uniform(0.0, period))
        x = random.uniform(-1.0, 1.0, len(magnitude)) * magnitude
        gate = float(numbers.window_start <= numbers.speed * t < numbers.window_end)
        mine = np.asarray(rate(numbers, gate, t, x), dtype=float)
        point = {"t": 0.0, "x": x, "u": model.inputs_at(t, parameters), "p": values.p, "c": values.c}
        theirs = kernel(point)
        for block in (slice(0, 4), slice(4, 8)):
            worst = max(worst, float(np.max(np.abs(mine[block] - theirs[block])) / np.max(np.abs(theirs[block]))))
    return worst
