"""A named error is kept, the estimate is near the true one and cheap; what cannot be kept is refused with the best."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError
from ballpass.runtime.certify.calibration import calibrate
from ballpass.runtime.certify.candidates import prefer, rungs
from ballpass.runtime.certify.companion import chosen_part
from ballpass.runtime.certify.error_target import TargetMissed, estimated, like_those_measured, meet_target
from ballpass.runtime.certify.ladder import LADDER, STIFF_LADDER, errors, first_rung, table_of
from ballpass.runtime.certify.parts import integrate_parts
from ballpass.runtime.certify.prepared import default_observables, prepare
from ballpass.runtime.certify.trade import (
    FULL,
    TARGETS,
    Configuration,
    Measured,
    Trade,
    full_configurations,
    measure_trade,
)
from ballpass.runtime.run.reductions import column

MEMBERS = 12
PEAK = "peak_ball_force"
PEAK_ALONE = [("max", "ball.force")]


@pytest.mark.usefixtures("counted_work")
@pytest.mark.parametrize("scene", ["punching_press", "four_bar"])
def test_true_errors_are_within_the_target_and_near_an_estimate_that_is_cheap(
    make_model: Callable[..., Model], scene: str
) -> None:
    """A small version of the calibration in the documentation, on other members and without a trade."""
    model = make_model(scene)
    rows = calibrate(model, default_observables(model), [PEAK], members=MEMBERS, seed=11)
    assert [row.target for row in rows] == 2 * list(TARGETS)
    for row in rows:
        assert (row.runs, row.missed, row.measured) == (MEMBERS, 0, False)
    assert np.mean([row.within for row in rows]) >= 0.95
    assert np.mean([row.near for row in rows]) >= 0.9
    # companion, and what measures the memory of the motion, integrate a part of the run only
    assert np.median([row.share for row in rows]) < 1.0


@pytest.mark.usefixtures("counted_work")
def test_with_a_trade_the_estimate_costs_half_of_the_run_and_is_as_near(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    ways = [way for way in full_configurations(model) if way.method.startswith("stepper") and way.rtol > 1e-7]
    trade = measure_trade({FULL: model}, [PEAK], members=MEMBERS, configurations=ways)
    rows = calibrate(model, [PEAK], members=MEMBERS, seed=12, trades=[trade])
    for row in rows:
        assert (row.runs, row.missed, row.measured) == (MEMBERS, 0, True)
    assert np.mean([row.within for row in rows]) >= 0.95
    assert np.mean([row.near for row in rows]) >= 0.9
    assert np.median([row.share for row in rows]) < 0.55


def test_errors_measured_with_other_numbers_are_not_taken_for_this_run(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    run = prepare(model)
    trade = replace(a_trade(), cycles=run.cycles, spread=0.005, numbers=dict(model.parameters))
    assert like_those_measured(run, trade)
    assert like_those_measured(
        prepare(model, {"bearing.clearance": 1.004 * model.parameters["bearing.clearance"]}), trade
    )
    others = (
        prepare(model, {"bearing.clearance": 1.1 * model.parameters["bearing.clearance"]}),
        prepare(model, cycles=2.0 * run.cycles),
        prepare(model, transient=1.0),
        prepare(model, initial=np.full(len(model.states), 1e-7)),
    )
    for other in others:
        assert not like_those_measured(other, trade)


def test_the_solution_is_the_run_whose_error_was_estimated(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    swing = "range_inner_y"
    solution = model.simulate(error=0.02, of=[PEAK, swing])
    found = solution.accuracy
    assert found is not None
    assert (solution.statistics.method, solution.statistics.rtol) == (found.method, found.rtol)
    # nothing is integrated again for the samples: they are those of the run whose extremes were taken on its way, and
    # writing them changes no step
    assert found.values == meet_target(prepare(model), 0.02, [PEAK, swing]).values
    sampled = np.ptp(solution.steady()["inner.y"])
    assert (1.0 - 1e-3) * found.values[swing] < sampled <= found.values[swing]
    assert solution.steady()["ball.force"].max() <= found.values[PEAK]
    plain = model.simulate(method="stepper-rodas5p", rtol=1e-10)
    assert solution.t.tolist() == plain.t.tolist()
    np.testing.assert_allclose(solution["inner.y"], plain["inner.y"], atol=0.02 * np.ptp(plain["inner.y"]))
    begin, end = found.part
    assert 0.0 <= begin < end <= solution.t[-1]
    assert "2 %" in found.words
    assert found.method in found.words


def test_samples_are_those_of_an_exact_run_up_to_the_error(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    times = [0.0, 0.0123, 0.05, 0.11]
    found = model.simulate(error=1e-6, of="rms:inner.x", times=times, transient=0, outputs=["ball.force", "inner.x"])
    exact = model.simulate(rtol=1e-11, method="stepper-rodas5p", times=times, outputs=["ball.force", "inner.x"])
    for name in ("ball.force", "inner.x"):
        np.testing.assert_allclose(found[name], exact[name], atol=1e-4 * np.abs(exact[name]).max())
    assert found.t.tolist() == times


@pytest.mark.parametrize("cycles", [0.3, 1.0, 2.5, 9.0])
def test_a_run_of_any_length_has_a_companion(make_model: Callable[..., Model], cycles: float) -> None:
    model = make_model("four_bar")
    run = prepare(model, cycles=cycles, transient=0.0)
    found = meet_target(run, 1e-3, [PEAK])
    true = abs(found.values[PEAK] / meet_target(run, 1e-8, [PEAK]).values[PEAK] - 1.0)
    assert true <= 1e-3
    assert 0.05 * true <= found.estimate <= 20.0 * max(true, 1e-8)
    assert found.part[1] - found.part[0] <= 0.5 * run.duration


def test_the_companion_looks_where_the_peak_is(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    found = meet_target(prepare(model), 0.01, [PEAK])
    peak = model.reduce(method=found.method, rtol=found.rtol)["ball.force"].maximum_time
    assert found.part[0] <= peak <= found.part[1]


def test_a_companion_starts_before_a_peak_at_the_start_of_a_part(make_model: Callable[..., Model]) -> None:
    """From the run's own state at the peak both would agree on it to the last bit."""
    model = make_model("punching_press")
    run = prepare(model)
    done = integrate_parts(run, PEAK_ALONE, "stepper-rodas4", 1e-2)
    first, behind = chosen_part(run, done, PEAK_ALONE, 2.0)
    assert behind == first + 1
    times = done.rows[:, column(model.ensemble_driver, "max_time", "ball.force")]
    assert run.segments.times[run.parts[first]] < times[first] < run.segments.times[run.parts[behind]]
    times[first] = run.segments.times[run.parts[first]]
    assert chosen_part(run, done, PEAK_ALONE, 2.0) == (first - 1, behind)


def test_smaller_errors_take_tighter_tolerances(make_model: Callable[..., Model]) -> None:
    run = prepare(make_model("four_bar"))
    found = [meet_target(run, target, ["rms_inner_x"]) for target in (0.1, 1e-3, 1e-6)]
    assert [one.estimate <= target for one, target in zip(found, (0.1, 1e-3, 1e-6), strict=True)] == [True] * 3
    assert found[0].rtol > found[1].rtol > found[2].rtol


def test_a_stiff_model_goes_up_the_linearly_implicit_ladder(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press", ('ratio = "0.25e-5 s*mm^0.5"', 'ratio = "0.25e-5 s*m^0.5"'))
    found = meet_target(prepare(model), 1e-3, [PEAK])
    assert (found.method, found.rtol) in STIFF_LADDER
    assert not found.method.endswith("dop853")
    assert "a stiff model" in found.reason


def test_an_error_that_chaos_forbids_is_refused_with_the_best_there_is(make_model: Callable[..., Model]) -> None:
    """At 200 um of clearance the motion is chaotic: after some turns no tolerance fixes an extreme."""
    model = make_model("four_bar")
    run = prepare(model, {"bearing.clearance": 200e-6}, cycles=6, transient=3)
    with pytest.raises(TargetMissed, match=r"cannot be met\. The best is") as refused:
        meet_target(run, 1e-6, [PEAK, "range_inner_x"])
    assert refused.value.best is not None
    assert refused.value.best.estimate > 1e-6
    assert "chaos" in str(refused.value)


def test_a_lucky_difference_does_not_make_an_estimate_of_zero() -> None:
    """What a trade found for the way holds a difference up that is small by luck; a large one is believed."""
    assert estimated(1e-9, 1e-3, 3e-3) == estimated(1e-12, 1e-3, 3e-3) > 1e-4
    assert estimated(1e-3, 1e-3, 3e-3) == pytest.approx(1e-3)
    assert estimated(0.5, 1e-3, 3e-3) == 0.5
    assert estimated(1e-9, None, None) == 1e-9


def test_wrong_requests_are_refused(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    for wrong in (0.0, 2.0, -0.1, True):
        with pytest.raises(RequestError, match="relative error from"):
            model.simulate(error=wrong, of=PEAK)
    with pytest.raises(RequestError, match="method or rtol as well"):
        model.simulate(error=0.01, rtol=1e-6)
    with pytest.raises(RequestError, match="peak_ball_force"):
        model.simulate(error=0.01, of="peak_ball_forse")
    with pytest.raises(RequestError, match="'any' or 'full'"):
        model.simulate(error=0.01, models="simple")  # type: ignore[arg-type]
    with pytest.raises(RequestError, match="follows from time alone"):
        model.simulate(error=0.01, of="max:drive_torque")
    with pytest.raises(RequestError, match="measured of the scene 'elsewhere'"):
        model.simulate(error=0.01, trade=a_trade())


def test_ladders_go_from_loose_to_tight_and_a_companion_is_a_rung_higher() -> None:
    for stiff, ladder in ((False, LADDER), (True, STIFF_LADDER)):
        tolerances = [rtol for _, rtol in ladder]
        assert tolerances == sorted(tolerances, reverse=True)
        for one in rungs(0.1, PEAK_ALONE, stiff=stiff):
            assert ladder.index(one.companion) == ladder.index(one.way) + 1


def measured(model: str, method: str, rtol: float, time: float, error: float) -> Measured:
    return Measured(
        configuration=Configuration(model=model, method=method, rtol=rtol),
        time=time,
        median={PEAK: error / 2},
        promised={PEAK: error},
        failures=0,
    )


def a_trade(*ways: Measured) -> Trade:
    return Trade(
        scene="elsewhere",
        title="",
        quantities=(PEAK,),
        values={PEAK: 1.0},
        uncertainty={PEAK: 0.0},
        members=2,
        spread=0.0,
        cycles=4.0,
        numbers={},
        measured=ways,
    )


def test_a_simpler_model_is_preferred_only_where_it_pays_and_may_be_taken() -> None:
    full, tight = measured(FULL, "stepper", 1e-3, 1.0, 5e-3), measured(FULL, "stepper", 1e-5, 2.0, 1e-4)
    still = measured(FULL, "quasi-static", 1e-2, 0.1, 2e-3)
    for time, taken in ((0.5, "simple"), (0.9, FULL)):
        trade = a_trade(full, tight, measured("simple", "stepper", 1e-3, time, 6e-3))
        found = prefer(trade, 0.01, [PEAK], (FULL, "simple"))
        assert found is not None
        assert found.model == taken
        assert found.companion == ("stepper", 1e-5)  # of the full model
        assert ("0.5 of a full one's time" in found.reason) == (taken == "simple")
        alone = prefer(trade, 0.01, [PEAK])
        assert alone is not None
        assert alone.model == FULL
    both = a_trade(full, tight, still)
    for allowed, method in ((True, "quasi-static"), (False, "stepper")):
        found = prefer(both, 0.01, [PEAK], quasi_static=allowed)
        assert found is not None
        assert found.way[0] == method
    # what fails on one parameter set is not taken, and what was not measured is not guessed
    assert prefer(a_trade(replace(full, failures=1)), 0.01, [PEAK]) is None
    assert prefer(both, 0.01, ["rms_inner_x"]) is None


def test_every_way_of_a_trade_has_a_companion_that_is_finer() -> None:
    found = prefer(a_trade(measured(FULL, "stepper-dop853", 1e-8, 1.0, 1e-6)), 1e-4, [PEAK])
    assert found is not None
    assert found.companion == ("stepper-dop853", pytest.approx(1e-9))


def test_the_ladder_begins_where_the_shipped_scenes_kept_the_target() -> None:
    for ladder in (LADDER, STIFF_LADDER):
        starts = [first_rung(ladder, target, PEAK_ALONE) for target in TARGETS]
        assert starts == sorted(starts)
        for start, target in zip(starts, TARGETS, strict=True):
            assert errors()[ladder[start]]["extreme of a ball"] <= target
            assert start == 0 or errors()[ladder[start - 1]]["extreme of a ball"] > target
        # the swing of a ring is known less well than a force: it takes a tighter way
        assert first_rung(ladder, 0.01, [("range", "inner.x")]) > first_rung(ladder, 0.01, PEAK_ALONE)


def test_the_table_of_the_ladder_is_made_of_trades() -> None:
    loose, tight = (measured(FULL, *way, 1.0, error) for way, error in ((LADDER[0], 0.4), (LADDER[1], 0.02)))
    worse = measured(FULL, *LADDER[0], 1.0, 0.6)
    rows = json.loads(table_of([a_trade(loose, tight), a_trade(worse)], {PEAK: ("max", "ball.force")}))["ways"]
    assert [(row["method"], row["rtol"]) for row in rows] == list(LADDER[:2])
    assert [row["errors"] for row in rows] == [{"extreme of a ball": 0.3}, {"extreme of a ball": 0.01}]


def test_a_slow_turn_is_integrated_without_stepping_vibrations_that_died_out(make_model: Callable[..., Model]) -> None:
    """At one revolution a minute a quarter of a million oscillations fit into a turn."""
    model = make_model("punching_press")
    run = prepare(model, {"mechanism.driver.speed": 2.0 * np.pi / 60.0})
    found = meet_target(run, 0.01, [PEAK])
    assert "rodas" in found.method
    exact = run.run(PEAK_ALONE, "stepper-rodas5p", 1e-9).values[0]
    assert abs(found.values[PEAK] / exact - 1.0) < 0.01


def test_a_quantity_that_both_runs_find_zero_has_no_error(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    found = meet_target(prepare(model, {"bearing.share": 0.0}), 0.01, [PEAK])
    assert found.values[PEAK] == 0.0
    assert found.estimate < 1e-12


@pytest.mark.parametrize("method", ["cvodes", "rosenbrock"])
def test_errors_of_sampled_methods_are_not_those_of_sampling(make_model: Callable[..., Model], method: str) -> None:
    """Their samples alone read a peak low by percents."""
    run = prepare(make_model("punching_press"), cycles=2, transient=1)
    wanted = [("max", "ball.force"), ("range", "inner.y")]
    exact = run.run(wanted, "stepper-rodas5p", 1e-11).values
    found = run.run(wanted, method, 1e-9).values
    assert found == pytest.approx(exact, rel=1e-4)
