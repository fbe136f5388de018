"""Claims about `auto` where oscillation, not damping, makes a model stiff: its steps tell, and it goes back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from stepper_runs import edges_of, run, segments_between

from ballpass.runtime import Model
from ballpass.runtime.native.stepper import Outcome

Make = Callable[..., Model]

STIFFNESS = "bearing.outer_ring.stiffness"


@pytest.fixture(scope="module")
def paper(make_model: Make) -> Model:
    return make_model("punching_press")


def counts(model: Model, family: str, rtol: float, parameters: dict[str, float]) -> Outcome:
    """One turn, the tolerance relative to the magnitudes of the run."""
    numbers = model.numbers(parameters)
    magnitudes = model.simulate(1, parameters=parameters, method="stepper-rodas5p", outputs=[]).statistics.magnitudes
    whole = segments_between(model, numbers, edges_of(model, numbers, 0.0, model.period(parameters)))
    return run(model, numbers, whole, method=family, tolerance=rtol * np.array(magnitudes)).outcome


def work(outcome: Outcome) -> float:
    """Evaluations; what a factorization and what belongs to it costs is four of them."""
    return outcome.evaluations + 4.0 * outcome.factorizations


@pytest.mark.parametrize("rtol", [1e-3, 1e-5])
@pytest.mark.parametrize("factor", [1.0, 30.0, 400.0, 4000.0])
def test_a_stiff_housing_is_left_to_the_method_that_fits(paper: Model, factor: float, rtol: float) -> None:
    """A housing on springs 400 times as stiff, hardly damped, swings 20 times as fast, and nobody has to follow that.

    Explicit steps are then held down by stability: to the root of that, whatever the tolerance.
    """
    parameters = {STIFFNESS: factor * paper.parameters[STIFFNESS]}
    explicit, implicit, free = (work(counts(paper, family, rtol, parameters)) for family in ("dp54", "rodas5p", "auto"))
    found_out = 24 * 6 + 70 * 12  # explicit steps at the limit, and linearly implicit ones until the housing is calm
    assert free < 1.5 * min(explicit, implicit) + found_out, (explicit, implicit, free)
    if factor == 400.0:
        assert explicit > 2.5 * implicit


@pytest.mark.parametrize("rtol", [1e-3, 1e-4])
def test_what_stability_no_longer_disturbs_is_as_accurate(paper: Model, rtol: float) -> None:
    """At the limit of stability an explicit method shakes the housing by about the tolerance."""
    parameters = {STIFFNESS: 400.0 * paper.parameters[STIFFNESS]}
    exact = paper.simulate(1, parameters=parameters, method="stepper-rodas5p", rtol=1e-11, samples_per_cycle=250)
    error = {}
    for method in ("stepper", "stepper-rodas5p", "stepper-dp54"):
        found = paper.simulate(1, parameters=parameters, method=method, rtol=rtol, samples_per_cycle=250)
        error[method] = float(np.max(np.abs(found.x - exact.x) / exact.statistics.magnitudes))
    assert error["stepper"] < 0.5 * error["stepper-dp54"], error


def test_a_housing_that_does_not_move_is_no_reason_for_millions_of_steps(make_model: Make) -> None:
    """Once 39 million for two turns: three changes of family a segment, and all were used up."""
    model = make_model("offset_slider")
    parameters = {STIFFNESS: 1e9 * model.parameters[STIFFNESS]}
    steps = {}
    for method in ("stepper", "stepper-rodas5p"):
        done = model.simulate(2, transient=0, rtol=1e-3, parameters=parameters, method=method, outputs=[])
        steps[method] = done.statistics.steps or 0
    assert 0 < steps["stepper"] < 2 * steps["stepper-rodas5p"]


def test_a_rate_that_vanishes_and_one_that_is_no_number_end(paper: Model) -> None:
    """No ball touches in a clearance this wide, and nothing holds the outer ring; then a stiffness that overflows."""
    free = paper.simulate(
        0.1,
        transient=0,
        parameters={"bearing.clearance": 1e-3, STIFFNESS: 0.0, "bearing.outer_ring.damping": 0.0},
        outputs=[],
    )
    assert np.all(np.isfinite(free.x))
