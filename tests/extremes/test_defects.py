"""What the tour of extremes found: each of these failed once."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import IntegrationError, Model
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.app.summary_table import render_summary
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.status import Status
from ballpass.runtime.point.conditioning import ConditioningWarning, conditioning
from ballpass.runtime.request.magnitudes import model_scales
from ballpass.runtime.request.segments import LARGEST_PHASE, segment_edges
from ballpass.runtime.run.failure_location import locate_failure
from ballpass.runtime.run.limits import brief_limit, step_limit
from ballpass.runtime.time import timeline

ModelMaker = Callable[..., Model]
OUTER = "bearing.outer_ring"


def needs_stepper(model: Model) -> Model:
    if not model.has_stepper:
        pytest.skip("the stepper needs a C compiler")
    return model


@pytest.mark.parametrize(
    "numbers",
    [{f"{OUTER}.mass": 1e-6}, {f"{OUTER}.mass": 1e-3}, {f"{OUTER}.stiffness": 1.0}, {f"{OUTER}.stiffness": 0.0}],
    ids=["mass 1 mg", "mass 1 g", "stiffness 1 N/m", "stiffness 0"],
)
def test_a_light_or_loose_outer_ring_does_not_loosen_the_tolerance(make_model: ModelMaker, numbers: dict) -> None:
    # magnitudes were metres, and kilometres, for contacts of 50 um; without stiffness NumPy's "Singular matrix" came up
    model = needs_stepper(make_model("punching_press"))
    found = {}
    for rtol in (1e-6, 1e-10):
        solution = model.simulate(cycles=1, parameters=numbers, rtol=rtol, transient=0)
        found[rtol] = solution["ball.elastic_force"]
        assert max(solution.statistics.magnitudes[:4]) < 1e-3
    assert np.max(np.abs(found[1e-6] - found[1e-10])) < 1e-2 * np.max(found[1e-10])


@pytest.mark.parametrize("mass", [1e-6, 0.555, 1e4])
@pytest.mark.parametrize("stiffness", [0.0, 1.0, 5e7, 1e12])
def test_magnitudes_in_c_and_python_are_the_same_at_the_edges(
    make_model: ModelMaker, mass: float, stiffness: float
) -> None:
    model = needs_stepper(make_model("punching_press"))
    values = {f"{OUTER}.mass": mass, f"{OUTER}.stiffness": stiffness}
    numbers = model.numbers(values)
    turn = timeline.stretch(model.manifest, numbers.values)
    by_python = model_scales(model, numbers, model.initial(values), turn, turn).magnitude
    by_c = model.simulate(cycles=1, parameters=values, samples_per_cycle=16, transient=0).statistics.magnitudes
    np.testing.assert_allclose(by_c, by_python, rtol=1e-3)


@pytest.mark.parametrize("start", [0.0, 1e-9])
@pytest.mark.parametrize("force", [0.0, 1e-6])
def test_a_rotor_thrown_through_its_clearance_flies_straight_for_many_turns(
    make_model: ModelMaker, start: float, force: float
) -> None:
    # its magnitude was what the load moves in a turn, a tolerance below the digits of a position that velocity carries
    model = needs_stepper(make_model("varying_compliance"))
    numbers = {
        "bearing.inner_ring.mass": 1.0, "bearing.inner_ring.damping": 0.0, "bearing.clearance": 1.0,
        "load.force.x": force, "bearing.initial.inner.x": start, "bearing.initial.inner.y": 0.0,
        "bearing.initial.inner_velocity.y": 7e-4,  # less than a ball in all: more is refused
    }  # fmt: skip
    solution = model.simulate(duration=10.0, parameters=numbers, transient=0, rtol=1e-9, samples_per_cycle=16)
    np.testing.assert_allclose(solution["inner.x"][-1], start + 0.5 * force * 10.0**2, rtol=1e-6)
    np.testing.assert_allclose(solution["inner.y"][-1], 7e-4 * 10.0, rtol=1e-9)
    turn = timeline.stretch(model.manifest, model.numbers(numbers).values)
    by_python = model_scales(model, model.numbers(numbers), model.initial(numbers), 10.0, turn).magnitude
    np.testing.assert_allclose(solution.statistics.magnitudes, by_python, rtol=1e-3)


def test_a_load_that_overflows_ends_in_words_without_warnings_of_numpy(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    numbers = {"mechanism.forces.punch.force.y": 1e300}
    turn = timeline.stretch(model.manifest, model.numbers().values)
    model_scales(model, model.numbers(numbers), model.initial(), turn, turn)  # warnings are errors here
    with pytest.raises(IntegrationError, match="stopped being finite"):
        needs_stepper(model).simulate(cycles=1, parameters=numbers, transient=0)


def test_an_explicit_method_on_a_stiff_model_is_given_up_after_bounded_work(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    # it took a hundred million steps, and Ctrl-C was not heard meanwhile
    model = needs_stepper(make_model("punching_press"))
    numbers = {"bearing.damping.ratio": 2.5e-4, f"{OUTER}.mass": 1e-3}
    monkeypatch.setattr("ballpass.runtime.run.limits.step_limit", lambda duration, turn: 200_000)
    monkeypatch.setattr("ballpass.runtime.run.loop.STEPS_A_CALL", 100_000)
    monkeypatch.setattr("ballpass.runtime.run.limits.LEAST_PROGRESS", 0.0)
    with pytest.raises(IntegrationError, match=r"more steps than allowed.*explicit method crawls on a stiff") as caught:
        model.simulate(cycles=1, parameters=numbers, method="stepper-dp54", transient=0)
    assert caught.value.status is Status.TOO_MANY_STEPS
    steps = caught.value.partial.statistics
    assert 200_000 <= (steps.steps or 0) + (steps.rejected or 0) <= 300_000
    assert len(caught.value.partial.t) > 1


def test_slow_machines_may_take_as_many_steps_a_second_as_fast_ones() -> None:
    # a turn at 1 rpm without damping takes ten million steps at tight tolerances, and was refused
    for limit in (step_limit, brief_limit):
        assert limit(60.0, 60.0) > 30_000_000
        assert limit(60.0, math.inf) > 30_000_000


def test_a_run_that_fails_tells_time_crank_angle_and_ball(make_model: ModelMaker) -> None:
    model = needs_stepper(make_model("punching_press"))
    with pytest.raises(IntegrationError) as caught:
        model.simulate(cycles=1, parameters={"mechanism.forces.punch.force.y": 1e300}, transient=0)
    fault = caught.value
    said = re.search(
        r"crank angle ([\d.]+) deg.*Most deflected there: ball (\d) at ([\d.]+) deg, by", str(fault), re.DOTALL
    )
    assert said is not None
    assert float(said[1]) == pytest.approx(500.0 * 6.0 * fault.time, abs=1e-3)
    assert int(said[2]) == fault.ball
    # ball k sits at 45 (k - 1) degrees plus the cage's angle, 0.381530 of the crank's
    cage = 0.38153 * 500.0 * 6.0 * fault.time
    assert float(said[3]) == pytest.approx(45.0 * (fault.ball - 1) + cage, abs=0.01)
    assert fault.status.value in str(fault)
    with pytest.raises(SimulationError, match=r"crank angle [\d.]+ deg. Step size.*ball \d at"):
        model.reduce(cycles=3, parameters={"mechanism.forces.punch.force.y": 1e300})


def test_the_most_deflected_ball_is_the_one_the_ring_presses_on(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    numbers = model.numbers()
    for ball, angle in ((1, 0.0), (3, math.pi / 2.0), (6, 5.0 * math.pi / 4.0)):
        x = np.zeros(8)
        x[0], x[1] = 2e-5 * math.cos(angle), 2e-5 * math.sin(angle)
        place = locate_failure(model, numbers, 0.0, x)
        assert place.ball == ball
        assert place.deflection == pytest.approx(2e-5 - 5e-6, rel=1e-12, abs=0.0)  # less half the clearance, Eq. (6)
    assert locate_failure(model, numbers, 0.0, np.full(8, math.nan)).ball is None


def test_phases_stay_small_within_a_segment(make_model: ModelMaker, scene_text: Callable[..., str]) -> None:
    # a load of 1 MHz on a shaft that stands: sines of 1e8 rad had errors of 1e-8 rad
    text = scene_text("varying_compliance")
    load = "\n".join(line for line in text.splitlines() if line.startswith(("type = ", "force = ")))
    wave = 'type = "harmonic"\nmean = ["0 N", "0 N"]\namplitude = ["1 N", "0 N"]\nfrequency = "1 MHz"\nphase = "0 deg"'
    model = make_model("varying_compliance", (load, wave))
    numbers = model.numbers({"shaft.speed": 0.0})
    edges = segment_edges(model, numbers, 0.0, 20.0, math.inf)
    assert edges[0] == 0.0
    assert edges[-1] == 20.0
    assert np.max(np.diff(edges)) * 2.0 * math.pi * 1e6 <= LARGEST_PHASE * (1.0 + 1e-12)


def test_the_summary_tells_how_well_the_reactions_can_be_solved(make_model: ModelMaker) -> None:
    model = make_model("punching_press")
    summary = summarize(model, model.simulate(cycles=1, transient=0))
    told = summary["reaction_condition"]
    assert told["unscaled"] == pytest.approx(37.0458, rel=1e-5)  # of the printed 8 by 8 matrix at 180 degrees
    assert told["unscaled"] > told["scaled"] > 1.0
    assert set(told["crank_angle"]) == {"unscaled", "scaled", "unit"}
    assert render_summary(summary, model.manifest)[0].rows


def test_a_linkage_that_nearly_locks_is_warned_about(make_model: ModelMaker) -> None:
    model = needs_stepper(make_model("punching_press"))
    near = {"mechanism.bodies.crank.points.B": 0.1 * (1.0 - 1e-9), "mechanism.driver.start_angle": math.radians(30.0)}
    with pytest.warns(
        ConditioningWarning, match=r"ill-conditioned at crank angle (180|0|360)\.00 deg.*Change the lengths"
    ):
        conditioning(model, model.numbers(near))
