"""Claims about the numbers of the project's own stepper: orders of convergence, agreement with other integrators."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from quick_cases import long_but
from scipy.integrate import solve_ivp
from stepper_methods import FAMILIES, NAMES, ORDERS
from stepper_runs import edges_of, run, segments_between

from ballpass.runtime import Model
from ballpass.runtime.contract.method_registry import STEPPERS

SCENES = ("punching_press", "punching_press_tangent", "four_bar", "offset_slider", "varying_compliance")

#: A rotor whose balls all stay loaded, under a load that depends on time: smooth, so that orders show.
SMOOTH = (
    ('type = "constant"  ', 'type = "harmonic"  '),
    (
        'force = ["196 N", "0 N"]',
        'mean = ["196 N", "20 N"]\namplitude = ["300 N", "500 N"]\nfrequency = "400 Hz"\nphase = "20 deg"\n#',
    ),
    ('clearance = "0 um"', 'clearance = "-30 um"'),
)
#: Time of the smooth run [s]: two and a half oscillations of the rotor.
SPAN = 4e-3

#: Steps with which the error is far from rounding and already behaves as its first power of the step size: of most
#: methods, and of some.
MOST_STEPS = (48, 192)
STEPS = {
    "stepper-dp54": (96, 384),
    "stepper-dop853": (16, 64),
    "stepper-rodas4": (32, 128),
}

Make = Callable[..., Model]


@pytest.fixture(scope="module")
def smooth(make_model: Make) -> Model:
    return make_model("varying_compliance", *SMOOTH)


@pytest.fixture(scope="module")
def reference(smooth: Model) -> tuple[np.ndarray, np.ndarray]:
    """Times inside the run, its end the last, and the states there by SciPy with CasADi's right-hand side."""
    numbers = smooth.numbers()
    rhs = smooth.kernel("rhs")
    u = segments_between(smooth, numbers, edges_of(smooth, numbers, 0.0, SPAN)).inputs[0]
    times = np.append(SPAN * np.sort(np.random.default_rng(7).uniform(0.0, 1.0, 100)), SPAN)
    found = solve_ivp(
        lambda t, x: rhs({"t": t, "x": x, "u": u, "p": numbers.p, "c": numbers.c}),
        (0.0, SPAN),
        smooth.initial(),
        method="DOP853",
        rtol=3e-14,
        atol=1e-22,
        max_step=SPAN / 1000,
        t_eval=times,
    )
    return times, found.y.T


def errors_with_equal_steps(
    model: Model, reference: tuple[np.ndarray, np.ndarray], family: str, count: int
) -> tuple[float, float]:
    """Error at the run's end, and the largest at output times off the steps; velocities over the natural frequency."""
    times, exact = reference
    numbers = model.numbers()
    segments = segments_between(model, numbers, edges_of(model, numbers, 0.0, SPAN))
    step = SPAN / count
    found = run(
        model,
        numbers,
        segments,
        method=family,
        tolerance=1e30,
        output_times=times,
        first_step=step,
        largest_step=step,
    )
    assert (found.outcome.steps, found.outcome.rejected) == (count, 0)
    frequency = np.sqrt(1.5 * 13.34e9 * np.sqrt(15e-6) * 4 / 20.0)
    difference = (found.states - exact) / np.array([1.0, 1.0, frequency, frequency])
    norms = np.linalg.norm(difference, axis=1)
    return float(norms[-1]), float(np.max(norms[:-1]))


@pytest.mark.parametrize("method", NAMES)
def test_error_falls_with_the_order_of_the_method(
    smooth: Model, reference: tuple[np.ndarray, np.ndarray], method: str
) -> None:
    # every ball stays loaded: otherwise the force has a kink, and no method its order
    loaded = smooth.simulate(duration=SPAN, method="stepper-dop853", rtol=1e-10, samples_per_cycle=400)
    assert np.min(loaded["ball.deflection"]) > 1e-6
    order, dense_order = ORDERS[method]
    few, many = STEPS.get(method, MOST_STEPS)
    coarse = errors_with_equal_steps(smooth, reference, FAMILIES[method], few)
    fine = errors_with_equal_steps(smooth, reference, FAMILIES[method], many)
    slopes = np.log(np.array(coarse) / np.array(fine)) / np.log(many / few)
    # methods may do better than they promise, on the way to the limit
    assert order - 0.4 < slopes[0] < order + 0.9, slopes
    assert dense_order - 0.4 < slopes[1], slopes


def test_agreement_with_scipy_tightens_with_the_tolerance(
    smooth: Model, reference: tuple[np.ndarray, np.ndarray]
) -> None:
    times, exact = reference
    numbers = smooth.numbers()
    segments = segments_between(smooth, numbers, edges_of(smooth, numbers, 0.0, SPAN))
    scale = np.max(np.abs(exact), axis=0)
    for family in FAMILIES.values():
        errors = []
        for rtol in (1e-4, 1e-6, 1e-8, 1e-10):
            found = run(smooth, numbers, segments, method=family, tolerance=rtol * scale, output_times=times)
            errors.append(float(np.max(np.abs(found.states - exact) / scale)))
            # error per step, summed over hundreds of steps
            assert errors[-1] < 300 * rtol, (family, rtol, errors)
        assert all(tight < loose / 8 for loose, tight in pairwise(errors)), (family, errors)


@pytest.fixture(scope="module")
def oracle(make_model: Make) -> Callable[[str], tuple[Model, np.ndarray, np.ndarray]]:
    """Model, states and magnitudes of a scene's first turn by CVODES, once."""
    kept: dict[str, tuple[Model, np.ndarray, np.ndarray]] = {}

    def find(scene: str) -> tuple[Model, np.ndarray, np.ndarray]:
        if scene not in kept:
            model = make_model(scene)
            found = model.simulate(1, method="cvodes", rtol=1e-11, samples_per_cycle=250)
            kept[scene] = (model, found.x, np.array(found.statistics.magnitudes))
        return kept[scene]

    return find


#: Tolerances beside one, as factors of it.  Where in a step a ball meets its track is chance: on the tangent law, whose
#: force bends most sharply there, a tolerance changed by a tenth changes the error of a run up to fiftyfold.
NEIGHBOURS = 10.0 ** np.linspace(-0.15, 0.15, 5)
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)


def errors_around(model: Model, exact: np.ndarray, magnitude: np.ndarray, method: str) -> np.ndarray:
    """Largest error of a run, over magnitudes, at each tolerance and its neighbours: shape (tolerances, neighbours)."""

    def error(rtol: float) -> float:
        found = model.simulate(1, method=method, rtol=rtol, samples_per_cycle=250, outputs=())
        assert len(found) == 251
        return float(np.max(np.abs(found.x - exact) / magnitude))

    return np.array([[error(rtol * factor) for factor in NEIGHBOURS] for rtol in TOLERANCES])


def typical(errors: np.ndarray) -> np.ndarray:
    """Geometric mean over the neighbours; below a ten-millionth it is the error of CVODES that shows."""
    return np.maximum(np.exp(np.mean(np.log(errors), axis=1)), 1e-7)


@pytest.mark.parametrize("method", STEPPERS)
@pytest.mark.parametrize("scene", long_but(SCENES, "punching_press_tangent"))
def test_every_family_converges_to_the_motion_cvodes_finds(
    oracle: Callable[[str], tuple[Model, np.ndarray, np.ndarray]], scene: str, method: str
) -> None:
    errors = errors_around(*oracle(scene), method)
    # balls that lift off and land magnify errors, and make kinks that hold the order down: hence the square root
    assert np.all(errors < 3.0 * np.sqrt(TOLERANCES)[:, None]), errors
    middle = typical(errors)
    assert all(tight < max(loose / 3, 2e-7) for loose, tight in pairwise(middle)), middle
    assert middle[-1] < middle[0] / 500, middle


@pytest.mark.long
@pytest.mark.parametrize("method", STEPPERS)
def test_without_kinks_errors_fall_with_the_tolerance(make_model: Make, method: str) -> None:
    """The press under the tangent law, contact onset smoothed over 2 um: what held the order down was the kink."""
    model = make_model("punching_press_tangent", ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "2 um"\n'))
    exact = model.simulate(1, method="cvodes", rtol=1e-11, samples_per_cycle=250)
    errors = errors_around(model, exact.x, np.array(exact.statistics.magnitudes), method)
    middle = typical(errors)
    assert all(tight < max(loose / 12, 2e-7) for loose, tight in pairwise(middle)), middle


def test_stiff_damping_is_followed_by_both_families(make_model: Make) -> None:
    """The paper's number read in SI: eigenvalues to -1e6 1/s; an explicit method gets there by many small steps."""
    model = make_model("punching_press")
    stiff = {"bearing.damping.ratio": model.parameters["bearing.damping.ratio"] * 10.0**1.5}
    runs = {
        method: model.simulate(1, parameters=stiff, method=method, rtol=rtol, samples_per_cycle=250)
        # a multistep method accumulates more error a turn
        for method, rtol in (*((f"stepper-{name}", 1e-5) for name in ("rodas5p", "rodas4", "dp54")), ("cvodes", 1e-7))
    }
    magnitude = np.array(runs["cvodes"].statistics.magnitudes)
    for found in runs.values():
        assert np.max(np.abs(found.x - runs["stepper-rodas4"].x) / magnitude) < 1e-4
    linear, explicit = runs["stepper-rodas5p"].statistics.steps, runs["stepper-dp54"].statistics.steps
    assert linear is not None
    assert explicit is not None
    assert explicit > 10 * linear
