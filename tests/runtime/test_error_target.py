"""A named error is kept and the estimate near the true one; what cannot be kept is refused with the best there is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from raceway.runtime import Model, RequestError
from raceway.runtime.accuracy.calibration import calibrate
from raceway.runtime.accuracy.error_target import LADDER, STIFF_LADDER, TargetMissed, meet_target
from raceway.runtime.accuracy.prepared import default_observables, prepare
from raceway.runtime.accuracy.trade import TARGETS

MEMBERS = 12


@pytest.mark.parametrize("scene", ["punching_press", "four_bar"])
def test_true_errors_are_within_the_target_and_near_the_estimate(make_model: Callable[..., Model], scene: str) -> None:
    """A small version of the calibration in the documentation, on other members."""
    model = make_model(scene)
    rows = calibrate(model, default_observables(model), members=MEMBERS, seed=11)
    assert [row.target for row in rows] == list(TARGETS)
    for row in rows:
        assert (row.runs, row.missed) == (MEMBERS, 0)
    assert np.mean([row.within for row in rows]) >= 0.95
    assert np.mean([row.near for row in rows]) >= 0.9


def test_the_solution_is_the_run_whose_error_was_estimated(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    solution = model.simulate(error=0.01, of="peak_ball_force")
    found = solution.accuracy
    assert found is not None
    assert (solution.statistics.method, solution.statistics.rtol) == (found.method, found.rtol)
    again = model.reduce(method=found.method, rtol=found.rtol)
    assert found.values["peak_ball_force"] == again["ball.force"].maximum
    np.testing.assert_allclose(solution.x[-1], list(again.end.values()), rtol=1e-12)
    assert "1 %" in found.words
    assert found.method in found.words


def test_smaller_errors_take_tighter_tolerances(make_model: Callable[..., Model]) -> None:
    run = prepare(make_model("four_bar"))
    found = [meet_target(run, target, ["rms_inner_x"]) for target in (0.1, 1e-3, 1e-6)]
    assert [one.estimate <= target for one, target in zip(found, (0.1, 1e-3, 1e-6), strict=True)] == [True] * 3
    assert found[0].rtol > found[1].rtol > found[2].rtol
    assert found[2].tried  # the ladder begins at 0.01 %: tighter ones are found by going on


def test_a_stiff_model_goes_up_the_linearly_implicit_ladder(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press", ('ratio = "0.25e-5 s*mm^0.5"', 'ratio = "0.25e-5 s*m^0.5"'))
    found = meet_target(prepare(model), 1e-3, ["peak_ball_force"])
    assert (found.method, found.rtol) in STIFF_LADDER
    assert not found.method.endswith("dop853")
    assert "a stiff model" in found.reason


def test_an_error_that_chaos_forbids_is_refused_with_the_best_there_is(make_model: Callable[..., Model]) -> None:
    """At 200 um of clearance the motion is chaotic: after some turns no tolerance fixes an extreme."""
    model = make_model("four_bar")
    run = prepare(model, {"bearing.clearance": 200e-6}, cycles=6, transient=3)
    with pytest.raises(TargetMissed, match=r"cannot be met\. The best is") as refused:
        meet_target(run, 1e-6, ["peak_ball_force", "range_inner_x"])
    assert refused.value.best is not None
    assert refused.value.best.estimate > 1e-6
    assert "chaos" in str(refused.value)


def test_wrong_requests_are_refused(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    for wrong in (0.0, 2.0, -0.1, True):
        with pytest.raises(RequestError, match="relative error from"):
            model.simulate(error=wrong, of="peak_ball_force")
    with pytest.raises(RequestError, match="method or rtol as well"):
        model.simulate(error=0.01, rtol=1e-6)
    with pytest.raises(RequestError, match="peak_ball_force"):
        model.simulate(error=0.01, of="peak_ball_forse")


def test_ladders_go_from_loose_to_tight() -> None:
    for ladder in (LADDER, STIFF_LADDER):
        tolerances = [rtol for _, rtol in ladder]
        assert tolerances == sorted(tolerances, reverse=True)
