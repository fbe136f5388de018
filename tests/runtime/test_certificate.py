"""Certificates: what agreement, disagreement and ignorance are called."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError, SimulationError
from ballpass.runtime.ask.study import Course, Study
from ballpass.runtime.certify.certificate import Verdict, by_differences, compare

PRELOADED = {"bearing.clearance": -60e-6, "mechanism.driver.start_angle": 4.0}


@pytest.fixture(scope="module")
def model(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_tangent")


@pytest.mark.parametrize(
    ("own", "second", "uncertainty", "verdict"),
    [
        (0.0, 1.0005, 1e-6, Verdict.VERIFIED),
        (0.0, 1.01, 1e-6, Verdict.DISAGREES),
        (0.1, 1.01, 1e-6, Verdict.NOT_CHECKED),
        (0.0, 1.01, 0.1, Verdict.NOT_CHECKED),
        (0.0, 1.0, 0.1, Verdict.NOT_CHECKED),
        (0.0, math.nan, 0.1, Verdict.NOT_CHECKED),
    ],
)
def test_verdicts_follow_from_distance_and_uncertainties(
    own: float, second: float, uncertainty: float, verdict: Verdict
) -> None:
    found = compare(1.0, own, second, uncertainty, route="x", quantum=0.0)
    assert found.verdict is verdict
    assert (found.reason == "") == (verdict in (Verdict.VERIFIED, Verdict.DISAGREES))


@pytest.mark.parametrize(
    ("derivative", "second", "uncertainty", "bounded", "nothing"),
    [
        (1.82, -0.222, 0.604, True, True),  # both are below the quantum, and their signs differ
        (400.0, 395.0, 0.1, True, False),  # a per cent apart: known to the quantum, and no nearer
        (400.0, 400.1, 5.0, True, False),  # they agree, but the second is not known to a thousandth
        (400.0, 400.1, 0.1, False, False),
        (1.82, 1.8201, 1e-4, False, False),  # small, and known
        (0.0, 0.0, 0.0, False, False),
    ],
)
def test_a_verdict_says_when_it_rests_on_the_quantum_alone(
    derivative: float, second: float, uncertainty: float, *, bounded: bool, nothing: bool
) -> None:
    found = compare(derivative, 2.59, second, uncertainty, route="x", quantum=266.0)
    assert found.verdict is Verdict.VERIFIED
    assert (found.bounded, found.is_nothing(derivative)) == (bounded, nothing)


def test_an_effect_of_the_start_that_has_died_out_is_called_nothing(make_model: Callable[..., Model]) -> None:
    """Damping takes the start away like exp(-t/0.2 s): no digit of its derivative 2.7 s later is known, and no report
    may look as if one was."""
    model = make_model("varying_compliance")
    names = ["bearing.initial.inner.x", "load.force.x"]
    report = model.sensitivity(["peak_ball_force"], names, 18, transient=17)
    start, load = report.pairs
    assert start.check.verdict is Verdict.VERIFIED
    assert start.is_nothing
    assert not load.is_nothing
    rows = {row["parameter"]: row["certificate"] for row in report.to_json()["sensitivities"]}
    assert rows[names[0]]["nothing"] is True
    assert rows[names[0]]["bound"] > abs(start.derivative)
    assert rows[names[1]]["nothing"] is False
    (line,) = [line for line in str(report).splitlines() if names[0] in line]
    assert "~0 (<" in line
    assert "verified: ~0" in line
    assert f"{start.derivative:.4g}" not in line
    assert "1 of them ~0" in str(report)
    assert repr(report).count("\n") == 0
    assert "2 verified" in repr(report)


def test_a_derivative_that_is_no_number_disagrees_with_one_that_is() -> None:
    assert compare(math.nan, 0.0, 1.0, 1e-9, route="x", quantum=0.0).verdict is Verdict.DISAGREES


def test_differences_of_a_noisy_function_state_an_uncertainty_that_holds() -> None:
    """exp with noise of 1e-9: the stated uncertainty must cover the error, and be no more than a thousand times it."""
    generator = np.random.default_rng(3)

    def noisy(change: Mapping[str, float]) -> np.ndarray:
        x, y = change.get("a", 1.0), change.get("b", 2.0)
        return np.array([math.exp(x) * y**3 + 1e-9 * generator.standard_normal()])

    at, scales = {"a": 1.0, "b": 2.0}, np.array([1.0, 2.0])
    found = by_differences(
        lambda changes: np.array([noisy(change) for change in changes]), at, scales, quantum=np.zeros((1, 2))
    )
    exact = np.array([[8 * math.e, 12 * math.e]])
    error = np.abs(found.value - exact)
    assert np.all(error <= 4.0 * found.uncertainty)
    assert np.all(found.uncertainty < 1e-5 * exact)


def test_a_right_derivative_is_verified_and_a_wrong_one_disagrees(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = {"cycles": 0.4, "transient": 0.0, "parameters": PRELOADED}
    names = ["rms:inner.y", "bearing.share"]
    right = model.sensitivity(*names, **options)  # type: ignore[arg-type]
    assert right.pairs[0].check.verdict is Verdict.VERIFIED
    plain = Study.differentiate

    def wrong(self: Study, *arguments: object, **more: object) -> Course:
        course = plain(self, *arguments, **more)  # type: ignore[arg-type]
        return replace(course, estimates=tuple(replace(item, slope=1.01 * item.slope) for item in course.estimates))

    monkeypatch.setattr(Study, "differentiate", wrong)
    found = model.sensitivity(*names, **options)  # type: ignore[arg-type]
    (pair,) = found.disagreements
    assert pair.check.value == pytest.approx(right.pairs[0].derivative, rel=1e-5)
    assert pair.derivative == pytest.approx(1.01 * right.pairs[0].derivative, rel=1e-12)


def test_a_peak_is_that_of_the_run_however_few_the_nodes(make_model: Callable[..., Model]) -> None:
    """Sixteen nodes a turn see 4395 N; and an rms from them is not called verified."""
    model = make_model("punching_press_tangent")
    report = model.sensitivity(["peak_ball_force", "rms:inner.x"], "bearing.share", samples_per_cycle=16)
    peak, rms = report.pairs
    assert peak.value == pytest.approx(model.reduce(rtol=1e-10)["ball.force"].maximum, rel=1e-7)
    assert peak.check.verdict is Verdict.VERIFIED
    assert rms.check.verdict is not Verdict.VERIFIED
    assert rms.uncertainty is not None
    assert rms.check.value is not None
    assert abs(rms.derivative - rms.check.value) < 4.0 * rms.uncertainty


def test_derivatives_in_chaos_are_refused(model: Model) -> None:
    """At 200 um clearance perturbations grow by e^13 a turn: derivatives of the trajectory mean nothing."""
    with pytest.raises(SimulationError, match="mean nothing here: the motion is chaotic"):
        model.sensitivity(
            "value:inner.y@200deg", "bearing.clearance", 2, transient=1, parameters={"bearing.clearance": 200e-6}
        )


def test_turning_the_check_off_is_said(model: Model) -> None:
    report = model.sensitivity("rms:inner.y", "bearing.share", 0.4, transient=0, parameters=PRELOADED, check=False)
    (pair,) = report.pairs
    assert pair.check.verdict is Verdict.NOT_CHECKED
    assert "turned off" in pair.check.reason
    assert report.to_json()["sensitivities"][0]["certificate"]["verdict"] == "not checked"


def test_wrong_requests_are_refused(model: Model) -> None:
    with pytest.raises(RequestError, match="differences"):
        model.sensitivity("rms:inner.y", "bearing.share", 1, transient=0, check="diferences")  # type: ignore[arg-type]
    with pytest.raises(RequestError, match=r"bearing\.clearance"):
        model.sensitivity("rms:inner.y", "bearing.clearanse", 1, transient=0)
    with pytest.raises(RequestError, match="transient cycles"):
        model.sensitivity("rms:inner.y", "bearing.clearance", 1, transient=1)
    with pytest.raises(RequestError, match="cvodes"):
        model.sensitivity("rms:inner.y", "bearing.clearance", 1, transient=0, method="cvodes")
    with pytest.raises(RequestError, match="agreement"):
        model.sensitivity("rms:inner.y", "bearing.clearance", 1, transient=0, agreement=2.0)


def test_laws_whose_force_jumps_are_refused_with_what_is_allowed(make_model: Callable[..., Model]) -> None:
    jumping = make_model("punching_press", ('law = "one-sided"', 'law = "two-sided-gated"'))
    with pytest.raises(RequestError, match=r"discontinuous.*tangent.*one-sided.*smoothing"):
        jumping.sensitivity("rms:inner.y", "bearing.clearance", 1, transient=0)


@pytest.mark.long
def test_a_smoothed_contact_makes_a_gated_law_differentiable(make_model: Callable[..., Model]) -> None:
    """Contacts open and close in this run: with Hertz's own onset the force would jump there."""
    smooth = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')
    model = make_model("punching_press", ('law = "one-sided"', 'law = "two-sided-gated"'), smooth)
    report = model.sensitivity("rms:inner.y", "bearing.clearance", 0.7, transient=0)
    (pair,) = report.pairs
    assert pair.check.verdict is Verdict.VERIFIED
    assert not pair.check.bounded
