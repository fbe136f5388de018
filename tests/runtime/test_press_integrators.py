"""Claims about simulated motion: every integrator follows a press written down by hand, and meets the punch on time.

The right-hand side below is a second model of the paper's machine, for this test alone: crank-slider in closed form,
Newton-Euler solved body by body, Eqs. (2) to (11) in NumPy.  SciPy integrates it from one step of the load to the next.
Nothing of it comes from the package; the contact stiffness is the reference value of a 6204.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ballpass.runtime import Model, Solution

METHODS = ("cvodes", "stepper")
LAWS = {"punching_press": "one-sided", "punching_press_tangent": "tangent"}
SLOWEST = tuple(("punching_press_tangent", method) for method in METHODS)

# The paper's data, and the scene's assumptions where the paper has none; SI.
GRAVITY, SPEED, TURN = 9.81, 500.0 * 2.0 * math.pi / 60.0, 0.12
CRANK, ROD, ROD_CENTER = 0.006, 0.1, 0.05
M1, M2, M3, J2 = 0.3567, 2.55, 16.7965, 7517.545e-6
PUNCH, START, END = 8964.8, math.radians(237.0), math.radians(267.0)
STIFFNESS = 8.64473e9  # k_b of a 6204 by exact elliptic integrals, computed independently
BALLS, BALL, PITCH, CLEARANCE = 8, 7.9375e-3, 33.5e-3, 10e-6
INNER_MASS = 0.032 + M1 + 0.05 / 2  # Eq. (3): the crank's centre of mass is on its axis
OUTER_MASS, HOUSING_STIFFNESS, HOUSING_DAMPING = 0.555, 5e7, 500.0

CAGE = 0.5 * SPEED * (1.0 - BALL / PITCH)
BALL_ANGLES = 2.0 * math.pi * np.arange(BALLS) / BALLS
ONE_SIDED = 0.25e-5 * math.sqrt(1e-3) * STIFFNESS  # 0.25e-5 s*mm^0.5 times k_b, about 683 N*s/m
TANGENT = 0.25e-5

#: Samples of a turn; the punch's edges fall between them.
SAMPLES = 1000
TIMES = TURN * np.arange(SAMPLES + 1) / SAMPLES
#: More steps than any method takes in a turn at the tightest tolerance.
STEPS = 1e5

Rate = Callable[[float, np.ndarray, bool], np.ndarray]


def hinge(angle: float, punch: bool) -> tuple[float, float]:
    """Force of the crank on the frame [N], from slider to rod to crank."""
    cos, sin = math.cos(angle), math.sin(angle)
    # the rod's direction is (u, -v): u = -x_B / l_2
    u = -CRANK / ROD * cos
    du, ddu = CRANK / ROD * sin * SPEED, CRANK / ROD * cos * SPEED**2
    v = math.sqrt(1.0 - u * u)
    ddv = -(du * du + u * ddu) / v - (u * du) ** 2 / v**3
    rod_acceleration = ddu / v + u * du * du / v**3
    slider_ay = -CRANK * sin * SPEED**2 - ROD * ddv
    center_ax = -CRANK * cos * SPEED**2 + ROD_CENTER * ddu
    center_ay = -CRANK * sin * SPEED**2 - ROD_CENTER * ddv
    # force of the rod on the slider along y, of the crank on the rod along y
    sy = M3 * (slider_ay + GRAVITY) - (PUNCH if punch else 0.0)
    py = M2 * (center_ay + GRAVITY) + sy
    # moments about the rod's centre of mass, levers towards B and C
    bx, by = -ROD_CENTER * u, ROD_CENTER * v
    cx, cy = (ROD - ROD_CENTER) * u, -(ROD - ROD_CENTER) * v
    sx = (J2 * rod_acceleration - bx * py + by * M2 * center_ax + cx * sy) / (cy - by)
    px = sx + M2 * center_ax
    return -px, -py - M1 * GRAVITY


def ball_forces(law: str, t: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Elastic and total force of every ball [N], cosine and sine of its angle."""
    angles = BALL_ANGLES + CAGE * t
    cos, sin = np.cos(angles), np.sin(angles)
    xi, yi, xo, yo, vxi, vyi, vxo, vyo = x.tolist()
    gap, across, rate, rate_across = xi - xo, yi - yo, vxi - vxo, vyi - vyo
    pressed = np.maximum(gap * cos + across * sin - 0.5 * CLEARANCE, 0.0)
    closing = rate * cos + rate_across * sin + CAGE * (across * cos - gap * sin)
    root = np.sqrt(pressed)
    elastic = STIFFNESS * pressed * root
    if law == "one-sided":
        return elastic, elastic + ONE_SIDED * np.maximum(closing, 0.0), cos, sin
    return elastic, elastic + TANGENT * 1.5 * STIFFNESS * root * closing, cos, sin


def right_hand_side(law: str) -> Rate:
    def rate(t: float, x: np.ndarray, punch: bool) -> np.ndarray:
        rx, ry = hinge(SPEED * t, punch)
        _, force, cos, sin = ball_forces(law, t, x)
        fx, fy = float(force @ cos), float(force @ sin)
        return np.array(
            [
                *x[4:],
                (0.5 * rx - fx) / INNER_MASS,
                (0.5 * ry - fy) / INNER_MASS,
                (fx - HOUSING_STIFFNESS * x[2] - HOUSING_DAMPING * x[6]) / OUTER_MASS,
                (fy - HOUSING_STIFFNESS * x[3] - HOUSING_DAMPING * x[7]) / OUTER_MASS,
            ]
        )

    return rate


def by_scipy(law: str, method: str, rtol: float, start: np.ndarray | None = None) -> np.ndarray:
    """States at `TIMES`, restarted at the edges of the punch; shape (samples, 8)."""
    rate = right_hand_side(law)
    state = np.zeros(8) if start is None else start
    blocks = []
    atol = rtol * np.array([1e-4] * 4 + [0.1] * 4)
    for number, (begin, end) in enumerate(pairwise((0.0, START / SPEED, END / SPEED, TURN))):
        times = TIMES[(begin <= TIMES) & ((end > TIMES) | (end == TURN))]
        run = solve_ivp(
            rate,
            (begin, end),
            state,
            method=method,
            t_eval=np.unique([*times, end]),
            rtol=rtol,
            atol=atol,
            args=(number == 1,),
        )
        assert run.success
        blocks.append(run.y.T[: len(times)])
        state = run.y[:, -1]
    return np.vstack(blocks)


@cache
def reference(law: str) -> np.ndarray:
    return by_scipy(law, "DOP853", 1e-13)


def difference(law: str, x: np.ndarray, y: np.ndarray) -> float:
    """Largest difference over the turn, in parts of each state's largest value."""
    return float(np.max(np.abs(x - y) / np.max(np.abs(reference(law)), axis=0)))


@cache
def growth(law: str) -> float:
    """How much a kick of every state at the start grows in the turn."""
    kick = 1e-6 * np.max(np.abs(reference(law)), axis=0)
    return difference(law, by_scipy(law, "DOP853", 1e-10, kick), reference(law)) / 1e-6


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model], scene_text: Callable[..., str]) -> Callable[[str], Model]:
    """The shipped press with its contact stiffness given as a number."""

    def make(name: str) -> Model:
        text = scene_text(name)
        begin = text.index("[bearing.contact]")
        contact = text[begin : text.index("\n\n", begin)]
        return make_model(name, (contact, f'[bearing.contact]\nstiffness = "{STIFFNESS!r} N/m^1.5"'))

    return make


@cache
def turn(model: Model, method: str, rtol: float) -> Solution:
    return model.simulate(cycles=1, samples_per_cycle=SAMPLES, method=method, rtol=rtol, transient=0)


def needs(model: Model, method: str) -> None:
    if method not in model.methods:
        pytest.skip(f"{method} needs a C compiler")


@pytest.mark.long
@pytest.mark.parametrize("law", ["one-sided", pytest.param("tangent", marks=pytest.mark.extreme)])
def test_reference_does_not_depend_on_its_method(law: str) -> None:
    # multistep methods in Fortran against a Runge-Kutta method; the tangent law multiplies differences by a hundred
    assert difference(law, by_scipy(law, "LSODA", 1e-12), reference(law)) < {"one-sided": 1e-8, "tangent": 1e-7}[law]


@pytest.mark.parametrize(
    ("name", "method"),
    [
        # small steps in CasADi's functions
        pytest.param(name, method, marks=[pytest.mark.long] if (name, method) in SLOWEST else [])
        for name in LAWS
        for method in METHODS
    ],
)
def test_motion_converges_to_the_hand_written_press(press: Callable[[str], Model], name: str, method: str) -> None:
    model, law = press(name), LAWS[name]
    needs(model, method)
    loose, tight, tightest = (
        difference(law, turn(model, method, rtol).x, reference(law)) for rtol in (1e-6, 1e-9, 1e-12)
    )
    assert loose < 0.2
    assert tight < 0.1 * loose
    assert tightest < 0.1 * tight
    # errors of at most rtol a step, all of one sign, each grown like a kick at the start
    assert tightest < 1e-12 * STEPS * growth(law)


@pytest.mark.parametrize(
    "name", ["punching_press", pytest.param("punching_press_tangent", marks=[pytest.mark.long, pytest.mark.extreme])]
)
def test_integrators_agree_with_each_other(press: Callable[[str], Model], name: str) -> None:
    model, law = press(name), LAWS[name]
    runs = {method: turn(model, method, 1e-12).x for method in METHODS if method in model.methods}
    assert len(runs) == 2
    # each is off by less than 2e-8 and 3e-6 of the largest value; their sources have nothing in common
    allowed = {"one-sided": 1e-7, "tangent": 1e-5}[law]
    for first, second in combinations(runs, 2):
        assert difference(law, runs[first], runs[second]) < allowed, (first, second)


@pytest.mark.parametrize("name", LAWS)
def test_outputs_are_those_of_the_hand_written_press(press: Callable[[str], Model], name: str) -> None:
    solution, law = turn(press(name), "cvodes", 1e-6), LAWS[name]
    punch = (START <= SPEED * TIMES) & (SPEED * TIMES < END)
    reaction = np.array([hinge(SPEED * t, bool(on)) for t, on in zip(TIMES, punch, strict=True)])
    for axis, column in zip("xy", reaction.T, strict=True):
        np.testing.assert_allclose(solution[f"reaction.A.{axis}"], column, rtol=0.0, atol=1e-12 * 8497.0)
    forces = [ball_forces(law, t, x) for t, x in zip(solution.t, solution.x, strict=True)]
    for output, part in (("ball.elastic_force", 0), ("ball.force", 1)):
        by_hand = np.array([force[part] for force in forces])
        assert by_hand.max() > 1000.0
        # deflections are differences of coordinates some ten times as large
        np.testing.assert_allclose(solution[output], by_hand, rtol=0.0, atol=1e-12 * by_hand.max())


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("method", METHODS)
def test_acceleration_jumps_where_the_punch_starts_and_ends(
    press: Callable[[str], Model], name: str, method: str
) -> None:
    model = press(name)
    needs(model, method)
    # 100 samples a degree, so that the edges are samples; at this tolerance a step is as long as tens of samples: an
    # integrator that does not stop at the edge smears the jump over all of them
    solution = model.simulate(cycles=1, samples_per_cycle=36000, method=method, rtol=1e-6, transient=0)
    rate, step = right_hand_side(LAWS[name]), TURN / 36000
    velocity = solution["inner.vy"]
    for edge, k in ((START, 23700), (END, 26700)):
        assert solution.t[k] * SPEED == pytest.approx(edge, rel=1e-15)
        before = np.dot([1.0, -4.0, 3.0], velocity[k - 2 : k + 1]) / (2.0 * step)
        behind = np.dot([-3.0, 4.0, -1.0], velocity[k : k + 3]) / (2.0 * step)
        wanted = [rate(edge / SPEED, solution.x[k], punch)[5] for punch in (edge == END, edge == START)]
        jump = wanted[1] - wanted[0]
        assert abs(jump) == pytest.approx(0.5 * PUNCH / INNER_MASS, rel=1e-6)
        # three-point differences: (step * 16e3 rad/s)^2 of the jump, 16e3 rad/s being the ring on its loaded contacts
        assert [before, behind] == pytest.approx(wanted, abs=3e-3 * abs(jump))


def four_bar(angle: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Force of the crank on the frame, shape (angles, 2), and drive torque of ``scenes/four_bar.toml``."""
    lengths, ground = (0.03, 0.1, 0.08), 0.12
    masses, inertias = (0.35, 0.4, 0.6), (120e-6, 480e-6, 520e-6)
    centers = (0.01, 0.05 + 0.004j, 0.036)  # in each body's own axes
    pin_b = lengths[0] * np.exp(1j * angle)
    diagonal = ground - pin_b
    along = (lengths[1] ** 2 - lengths[2] ** 2 + np.abs(diagonal) ** 2) / (2.0 * np.abs(diagonal))
    pin_c = pin_b + (along + 1j * np.sqrt(lengths[1] ** 2 - along**2)) * diagonal / np.abs(diagonal)  # left of B to D
    arms = (pin_b, pin_c - pin_b, pin_c - ground)

    def rates(closure: np.ndarray) -> np.ndarray:
        """w2, w3 with  closure + i w2 (C - B) = i w3 (C - D)."""
        matrix = np.stack([1j * arms[1], -1j * arms[2]], axis=-1)
        both = np.stack([matrix.real, matrix.imag], axis=-2)
        return np.linalg.solve(both, -np.stack([closure.real, closure.imag], axis=-1)[..., None])[..., 0].T

    w = (np.full_like(angle, speed), *rates(1j * speed * pin_b))
    a = (np.zeros_like(angle), *rates(-(w[0] ** 2) * arms[0] - w[1] ** 2 * arms[1] + w[2] ** 2 * arms[2]))
    roots = (0.0, pin_b, ground)
    root_accelerations = (0.0, -(speed**2) * pin_b, 0.0)
    matrix, right = np.zeros((len(angle), 9, 9)), np.zeros((len(angle), 9))
    # unknown forces: frame on crank, crank on coupler, coupler on rocker, frame on rocker; torque of the drive
    acting = (
        ((0, 1.0, 0.0), (1, -1.0, pin_b)),
        ((1, 1.0, pin_b), (2, -1.0, pin_c)),
        ((2, 1.0, pin_c), (3, 1.0, ground)),
    )
    for body in range(3):
        reach = centers[body] * arms[body] / lengths[body]
        center = roots[body] + reach
        acceleration = root_accelerations[body] + (1j * a[body] - w[body] ** 2) * reach
        rows = slice(3 * body, 3 * body + 3)
        for force, sign, point in acting[body]:
            lever = point - center
            matrix[:, rows, 2 * force : 2 * force + 2] += sign * np.stack(
                [
                    np.stack([np.ones_like(angle), np.zeros_like(angle)], axis=-1),
                    np.stack([np.zeros_like(angle), np.ones_like(angle)], axis=-1),
                    np.stack([-lever.imag, lever.real], axis=-1),
                ],
                axis=1,
            )
        right[:, 3 * body] = masses[body] * acceleration.real
        right[:, 3 * body + 1] = masses[body] * (acceleration.imag + GRAVITY)
        right[:, 3 * body + 2] = inertias[body] * a[body]
    matrix[:, 2, 8] = 1.0
    working = (math.radians(70.0) <= angle) & (angle < math.radians(190.0))
    right[:, 8] -= np.where(working, -60.0, 0.0)
    unknown = np.linalg.solve(matrix, right[..., None])[..., 0]
    return -unknown[:, :2], unknown[:, 8]


def test_load_of_the_four_bar_is_that_of_newton_and_euler(make_model: Callable[..., Model]) -> None:
    solution = make_model("four_bar").simulate(cycles=1, transient=0)
    speed = 600.0 * 2.0 * math.pi / 60.0
    force, torque = four_bar(speed * solution.t[:-1], speed)
    assert np.abs(force).max() > 500.0
    for output, by_hand in (("reaction.A.x", force[:, 0]), ("reaction.A.y", force[:, 1]), ("drive_torque", torque)):
        np.testing.assert_allclose(solution[output][:-1], by_hand, rtol=0.0, atol=1e-11 * np.abs(by_hand).max())
