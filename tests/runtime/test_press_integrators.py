"""Claims about simulated motion: every integrator follows a press written down by hand, and meets the punch on time.

The second model is in tests/machines/hand_written_press.py: crank-slider and bearing in NumPy, integrated by SciPy
from one step of the load to the next.  The contact stiffness is the reference value of a 6204.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from hand_written_press import Machine
from quick_cases import long_but

from ballpass.runtime import Model, Solution
from ballpass.runtime.native.casadi_integrators import METHODS as OF_CASADI

METHODS = (*OF_CASADI, "stepper")
SCENES = ("punching_press", "punching_press_tangent")
STIFFNESS = 8.64473e9  # k_b of a 6204 by exact elliptic integrals, computed independently
#: A third of a turn with both edges of the punch, which fall between the samples.
FROM, PART, SAMPLES = {"mechanism.driver.start_angle": math.radians(200.0)}, 1 / 3, 999
#: More steps than any method takes in a turn at the tightest tolerance.
STEPS = 1e5

Make = Callable[[str], Model]


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model], scene_text: Callable[..., str]) -> Make:
    """The shipped press with its contact stiffness given as a number."""

    def make(name: str) -> Model:
        text = scene_text(name)
        begin = text.index("[bearing.contact]")
        contact = text[begin : text.index("\n\n", begin)]
        return make_model(name, (contact, f'[bearing.contact]\nstiffness = "{STIFFNESS!r} N/m^1.5"'))

    return make


@cache
def part_of_a_turn(model: Model, method: str, rtol: float) -> Solution:
    return model.simulate(
        cycles=PART, samples_per_cycle=SAMPLES, method=method, rtol=rtol, transient=0, parameters=FROM
    )


@cache
def by_hand(model: Model, method: str = "DOP853", rtol: float = 1e-13, kick: float = 0.0) -> np.ndarray:
    """States by SciPy; the start kicked by a part of each state's largest value."""
    size = np.array([1e-4] * 4 + [0.1] * 4)
    start = kick * np.max(np.abs(by_hand(model)), axis=0) if kick else np.zeros(8)
    times = model.period() * np.arange(round(PART * SAMPLES) + 1) / SAMPLES
    return Machine.of(model, FROM).integrate(times, start, method=method, rtol=rtol, magnitude=size)


def difference(model: Model, x: np.ndarray, y: np.ndarray) -> float:
    """Largest difference, in parts of each state's largest value."""
    return float(np.max(np.abs(x - y) / np.max(np.abs(by_hand(model)), axis=0)))


def needs(model: Model, method: str) -> None:
    if method not in model.methods:
        pytest.skip(f"{method} needs a C compiler")


@pytest.mark.long
@pytest.mark.parametrize("name", [SCENES[0], pytest.param(SCENES[1], marks=pytest.mark.extreme)])
def test_reference_does_not_depend_on_its_method(press: Make, name: str) -> None:
    # multistep methods in Fortran against a Runge-Kutta method; the tangent law multiplies differences by a hundred
    model = press(name)
    bound = {"punching_press": 1e-8, "punching_press_tangent": 1e-7}[name]
    assert difference(model, by_hand(model, "LSODA", 1e-12), by_hand(model)) < bound


@pytest.mark.parametrize("name", [SCENES[0], pytest.param(SCENES[1], marks=pytest.mark.long)])
@pytest.mark.parametrize("method", long_but(METHODS, "stepper"))
def test_motion_converges_to_the_hand_written_press(press: Make, name: str, method: str) -> None:
    model = press(name)
    needs(model, method)
    loose, tight, tightest = (
        difference(model, part_of_a_turn(model, method, rtol).x, by_hand(model)) for rtol in (1e-6, 1e-9, 1e-12)
    )
    assert loose < 0.2
    assert tight < 0.1 * loose
    assert tightest < 0.1 * tight
    # errors of at most rtol a step, all of one sign, each grown like a kick at the start
    growth = difference(model, by_hand(model, "DOP853", 1e-10, 1e-6), by_hand(model)) / 1e-6
    assert tightest < 1e-12 * STEPS * growth


@pytest.mark.parametrize("name", SCENES)
def test_outputs_are_those_of_the_hand_written_press(press: Make, name: str) -> None:
    model = press(name)
    solution, hand = part_of_a_turn(model, "stepper", 1e-6), Machine.of(model, FROM)
    linkage = hand.linkage
    assert linkage is not None
    angles = linkage.start + linkage.speed * solution.t
    reaction = np.array([linkage.hinge(float(a), linkage.punching(float(a))) for a in angles])
    for axis, column in (("x", reaction.real), ("y", reaction.imag)):
        np.testing.assert_allclose(solution[f"reaction.A.{axis}"], column, rtol=0.0, atol=1e-12 * 8497.0)
    forces = [hand.balls(float(t), x) for t, x in zip(solution.t, solution.x, strict=True)]
    for output, part in (("ball.elastic_force", 0), ("ball.force", 1)):
        expected = np.array([force[part] for force in forces])
        assert expected.max() > 1000.0
        # deflections are differences of coordinates some ten times as large
        np.testing.assert_allclose(solution[output], expected, rtol=0.0, atol=1e-12 * expected.max())


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", METHODS)
def test_acceleration_jumps_where_the_punch_starts_and_ends(press: Make, name: str, method: str) -> None:
    model = press(name)
    needs(model, method)
    hand, period = Machine.of(model), model.period()
    # 100 samples a degree, so that the edges are samples; at this tolerance a step is as long as tens of samples: an
    # integrator that does not stop at the edge smears the jump over all of them
    solution = model.simulate(cycles=1, samples_per_cycle=36000, method=method, rtol=1e-6, transient=0)
    step, velocity = period / 36000, solution["inner.vy"]
    for edge, k, starts in ((237.0, 23700, True), (267.0, 26700, False)):
        assert solution.t[k] * 2.0 * math.pi / period == pytest.approx(math.radians(edge), rel=1e-15, abs=0.0)
        before = np.dot([1.0, -4.0, 3.0], velocity[k - 2 : k + 1]) / (2.0 * step)
        behind = np.dot([-3.0, 4.0, -1.0], velocity[k : k + 3]) / (2.0 * step)
        wanted = [hand.rate(float(solution.t[k]), solution.x[k], punch)[5] for punch in (not starts, starts)]
        jump = wanted[1] - wanted[0]
        inner_mass = 0.032 + 0.3567 + 0.05 / 2  # Eq. (3): the crank's centre of mass is on its axis
        assert abs(jump) == pytest.approx(0.5 * 8964.8 / inner_mass, rel=1e-6)
        # three-point differences: (step * 16e3 rad/s)^2 of the jump, 16e3 rad/s being the ring on its loaded contacts
        assert [before, behind] == pytest.approx(wanted, abs=3e-3 * abs(jump))
