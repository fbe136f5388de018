"""Certificates: what agreement, disagreement and ignorance are called."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError, SimulationError
from ballpass.runtime.certify.certificate import Second, Verdict, better_known, by_differences, compare
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun

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


@pytest.mark.long
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
    assert f"{start.derivative:.4g}" not in line
    assert "1 of them ~0" in str(report)
    assert repr(report).count("\n") == 0
    assert "2 verified" in repr(report)


def test_a_derivative_that_is_no_number_disagrees_with_one_that_is() -> None:
    assert compare(math.nan, 0.0, 1.0, 1e-9, route="x", quantum=0.0).verdict is Verdict.DISAGREES


def jitter(at: Mapping[str, float]) -> list[dict[str, float]]:
    """Tiny changes of all parameters."""
    return [{name: value * (1.0 + move) for name, value in at.items()} for move in np.linspace(-2e-7, 2e-7, 5)]


def test_differences_of_a_noisy_function_state_an_uncertainty_that_holds() -> None:
    """exp with noise of 1e-9: the stated uncertainty must cover the error, and be no more than a thousand times it."""
    generator = np.random.default_rng(3)

    def noisy(change: Mapping[str, float]) -> np.ndarray:
        x, y = change.get("a", 1.0), change.get("b", 2.0)
        return np.array([math.exp(x) * y**3 + 1e-9 * generator.standard_normal()])

    at, scales = {"a": 1.0, "b": 2.0}, np.array([1.0, 2.0])
    found = by_differences(
        lambda changes: np.array([noisy(change) for change in changes]),
        at,
        scales,
        quantum=np.zeros((1, 2)),
        jitter=jitter(at),
    )
    exact = np.array([[8 * math.e, 12 * math.e]])
    error = np.abs(found.value - exact)
    assert np.all(error <= 4.0 * found.uncertainty)
    assert np.all(found.uncertainty < 1e-5 * exact)


def test_slopes_on_both_sides_of_a_kink_are_given() -> None:
    """|a - 1| + 3 a: 2 below and 4 above."""

    def kinked(changes: Sequence[Mapping[str, float]]) -> np.ndarray:
        return np.array([[abs(change.get("a", 1.0) - 1.0) + 3.0 * change.get("a", 1.0)] for change in changes])

    at = {"a": 1.0}
    found = by_differences(kinked, at, np.array([1.0]), quantum=np.zeros((1, 1)), jitter=jitter(at))
    assert found.sides(0, 0) == pytest.approx((2.0, 4.0))
    check = compare(4.0, 0.0, 3.0, 1e-9, route="x", quantum=0.0, sides=found.sides(0, 0))
    assert check.verdict is Verdict.NOT_CHECKED
    assert "2 below the parameter's value and 4 above" in check.reason


def test_two_steps_are_enough_where_they_agree_with_the_derivative() -> None:
    """exp(a) b: a third step to each side where the derivative is another one."""
    at, slopes = {"a": 1.0, "b": 2.0}, np.array([[2.0 * math.e, math.e]])
    taken: list[int] = []

    def measure(changes: Sequence[Mapping[str, float]]) -> np.ndarray:
        taken.append(len(changes))
        return np.array([[math.exp(change.get("a", 1.0)) * change.get("b", 2.0)] for change in changes])

    for expected, runs in ((slopes, [5, 8]), (slopes * [1.0, 1.01], [5, 8, 2])):
        taken.clear()
        scales, quantum = np.array([1.0, 2.0]), np.full((1, 2), 1e-5)
        found = by_differences(measure, at, scales, quantum=quantum, jitter=jitter(at), expected=expected)
        assert taken == runs
        assert np.all(np.abs(found.value - slopes) <= found.uncertainty)
        assert np.all(found.uncertainty < 1e-4 * slopes)


@pytest.mark.parametrize("known", [False, True])
def test_what_is_found_of_a_pair_does_not_depend_on_the_others(known: bool) -> None:
    """A smooth, a noisy, a sharply bent and a kinked function by two parameters, alone and together."""
    slopes = np.array([[2.0 * math.e, math.e], [2.0, 1.0], [3e3 * math.cos(3e3), 1.0], [1.0, 4.0]])
    functions: tuple[Callable[[float, float], float], ...] = (
        lambda a, b: math.exp(a) * b,
        lambda a, b: a * b + 1e-7 * math.sin(1e9 * (a + b)),
        lambda a, b: math.sin(3e3 * a) + b,
        lambda a, b: abs(a - 1.0) + b**2,
    )
    at, moves = {"a": 1.0, "b": 2.0}, jitter({"a": 1.0, "b": 2.0})

    def found(chosen: Sequence[int], names: Sequence[str]) -> Second:
        def measure(changes: Sequence[Mapping[str, float]]) -> np.ndarray:
            points = [(change.get("a", 1.0), change.get("b", 2.0)) for change in changes]
            return np.array([[functions[k](*point) for k in chosen] for point in points])

        given = {name: at[name] for name in names}
        quantum = np.full((len(chosen), len(names)), 1e-5)
        expected = slopes[np.ix_(chosen, ["ab".index(name) for name in names])] if known else None
        scales = np.array(list(given.values()))
        return by_differences(measure, given, scales, quantum=quantum, jitter=moves, expected=expected)

    together = found(range(4), "ab")
    for row in range(4):
        for column, name in enumerate("ab"):
            alone = found([row], [name])
            for of in ("value", "uncertainty", "below", "above"):
                assert getattr(alone, of)[0, 0] == pytest.approx(
                    getattr(together, of)[row, column], rel=0, nan_ok=True, abs=0.0
                )
    assert together.sides(3, 0) is not None


@pytest.mark.parametrize(
    ("derivative", "own", "second", "uncertainty", "given", "by_second"),
    [
        (-33.8487, 0.02, -33.873901, 6e-6, -33.873901, True),  # verified to 1e-3, and one is known to 1e-7
        (1.0, 1e-9, 1.0005, 1e-6, 1.0, False),  # verified
        (1.0, 1e-3, 1.1, 1e-6, 1.1, True),  # they disagree, and one is known better
        (1.0, 1e-6, 1.1, 1e-3, 1.0, False),
        (-1.6e12, 4e10, -4e6, 4e7, math.nan, True),  # no digit in common, and they exclude each other
        (1e4, 3e4, 5.0, 1e-3, 5.0, True),  # not checked: the first is not known, the second is
        (5.0, 10.0, -3.0, 8.0, math.nan, False),  # not checked: neither is known
        (math.nan, 0.0, 2.0, 1e-6, 2.0, True),
        (2.0, 1e-6, math.nan, math.inf, 2.0, False),
    ],
)
def test_the_number_known_better_is_given_and_none_where_nothing_is_known(
    derivative: float, own: float, second: float, uncertainty: float, given: float, *, by_second: bool
) -> None:
    check = compare(derivative, own, second, uncertainty, route="x", quantum=0.0)
    value, _, of_second = better_known(derivative, own, check)
    assert value == pytest.approx(given, rel=0, nan_ok=True, abs=0.0)
    assert of_second is by_second


@pytest.mark.parametrize(
    ("own", "second", "uncertainty", "stated"),
    [
        (1e-9, 1.0005, 1e-7, 5e-4),  # the second is that far away, and known to be
        (1e-9, 1.0005, 1e-3, 8e-9),  # it may be where the first is
        (1e-3, 1.0005, 1e-3, 8e-3),
    ],
)
def test_the_stated_uncertainty_reaches_to_a_number_that_excludes_the_derivative(
    own: float, second: float, uncertainty: float, stated: float
) -> None:
    check = compare(1.0, own, second, uncertainty, route="x", quantum=0.0)
    value, known, of_second = better_known(1.0, own, check)
    assert not of_second
    assert (value, known) == pytest.approx((1.0, stated), rel=1e-9, abs=0.0)


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "quantity", "parameter"),
    [
        ("punching_press", "mean:ball.force[5]", "bearing.ball_diameter"),
        ("punching_press", "mean:ball.elastic_force", "bearing.outer_ring.damping"),
        ("punching_press_roller", "drive_work", "mechanism.gravity"),
        ("eccentric_pump", "mean:ball.elastic_force", "mechanism.bodies.rod_3.mass"),
    ],
)
def test_the_stated_uncertainty_covers_the_derivative_of_a_run_at_the_tightest_tolerances(
    make_model: Callable[..., Model], scene: str, quantity: str, parameter: str
) -> None:
    """Of 188 random pairs those whose two tolerances are nearest each other and farthest from the limit."""
    model = make_model(scene)
    pair = model.sensitivity(quantity, parameter).pairs[0]
    tight = model.sensitivity(quantity, parameter, rtol=1e-13, sensitivity_rtol=1e-12, check=False).pairs[0]
    assert pair.uncertainty is not None
    assert abs(pair.derivative - tight.derivative) <= pair.uncertainty < 1e-3 * abs(pair.derivative)


@pytest.mark.parametrize(("own", "second"), [(1.6e-2, 1e-9), (1e-9, 1.6e-2), (3e-2, 3e-2), (0.0, 1.0)])
def test_the_reason_of_an_open_verdict_is_true(own: float, second: float) -> None:
    """Each comparison that it states holds."""
    for apart in (0.0, 2.5e-3, 3e-2):
        check = compare(1.0 + apart, own, 1.0, second, route="x", quantum=0.0)
        numbers = [float(text) for text in re.findall(r"\d\.\de[-+]\d+", check.reason)]
        if check.verdict is not Verdict.NOT_CHECKED:
            continue
        if "differ by" in check.reason:
            distance, allowed, *uncertainties = numbers
            assert allowed < distance <= 4.0 * sum(uncertainties) * 1.05
        else:
            uncertainty, allowed = numbers
            assert uncertainty > allowed


@pytest.mark.long
def test_of_two_numbers_the_one_known_better_is_given(make_model: Callable[..., Model]) -> None:
    """Loose steps know the peak's derivative to a part in thirty, differences to a part in ten thousand."""
    model = make_model("punching_press_tangent")
    report = model.sensitivity("peak_ball_force", "mechanism.driver.speed", rtol=1e-5, sensitivity_rtol=1e-3)
    (pair,) = report.pairs
    assert pair.check.verdict is Verdict.NOT_CHECKED
    assert pair.route == "differences"
    assert pair.derivative == pair.check.value
    assert pair.derivative == pytest.approx(-2.523, rel=1e-3)
    assert pair.uncertainty is not None
    assert pair.uncertainty < 1e-3 * abs(pair.derivative)
    assert report.to_json()["sensitivities"][0]["route"] == "differences"
    assert "±" in str(report)


def test_a_right_derivative_is_verified_and_a_wrong_one_disagrees(
    model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = {"cycles": 0.4, "transient": 0.0, "parameters": PRELOADED}
    names = ["rms:inner.y", "bearing.share"]
    right = model.sensitivity(*names, **options)  # type: ignore[arg-type]
    assert right.pairs[0].check.verdict is Verdict.VERIFIED
    plain = QuantityRun.differentiate

    def wrong(self: QuantityRun, *arguments: object, **more: object) -> EvaluatedQuantities:
        course = plain(self, *arguments, **more)  # type: ignore[arg-type]
        return replace(course, estimates=tuple(replace(item, slope=1.01 * item.slope) for item in course.estimates))

    monkeypatch.setattr(QuantityRun, "differentiate", wrong)
    found = model.sensitivity(*names, **options)  # type: ignore[arg-type]
    (pair,) = found.disagreements
    assert pair.check.value == pytest.approx(right.pairs[0].by_steps, rel=1e-5)
    assert pair.by_steps == pytest.approx(1.01 * right.pairs[0].by_steps, rel=1e-12, abs=0.0)
    assert pair.derivative in (pair.by_steps, pair.check.value)


@pytest.mark.long
def test_quantities_do_not_depend_on_the_samples(make_model: Callable[..., Model]) -> None:
    """Sixteen samples a turn see 4395 N and half of the second derivative; quadratures follow the motion instead."""
    model = make_model("punching_press_tangent", ("samples_per_cycle = 2000", "samples_per_cycle = 16"))
    report = model.sensitivity(["peak_ball_force", "rms:inner.x"], "bearing.share")
    peak, rms = report.pairs
    assert peak.value == pytest.approx(5574.8, rel=1e-5)
    assert rms.derivative == pytest.approx(-3.726e-6, rel=2e-4)
    assert report.verdicts[Verdict.VERIFIED] == 2


@pytest.mark.long
def test_a_slow_press_is_seen_as_closely_as_a_fast_one(make_model: Callable[..., Model]) -> None:
    """10 rpm: the vibrations of a stroke take a thousandth of a turn; other code says 5635.85 N and 5.966e7 N/m."""
    model = make_model("punching_press_tangent")
    slow = {"mechanism.driver.speed": 10.0 * math.pi / 30.0}
    report = model.sensitivity("peak_ball_force", "bearing.clearance", 2, transient=1, parameters=slow)
    (pair,) = report.pairs
    assert pair.value == pytest.approx(5635.85, rel=2e-6)
    assert pair.derivative == pytest.approx(5.966e7, rel=1e-3)
    assert pair.check.verdict is Verdict.VERIFIED


def test_integrals_follow_vibrations_that_take_a_thousandth_of_a_turn(make_model: Callable[..., Model]) -> None:
    """The stroke at 10 rpm, against the driver's own sums over its steps."""
    model = make_model("punching_press_tangent")
    slow = {"mechanism.driver.speed": 10.0 * math.pi / 30.0, "mechanism.driver.start_angle": math.radians(230.0)}
    of = ["rms:ball.force", "mean:ball.force", "rms:inner.vy"]
    report = model.sensitivity(of, "bearing.share", 0.1, transient=0, parameters=slow, check=False)
    run = model.reduce(0.1, transient=0, parameters=slow, rtol=1e-10)
    values = [run["ball.force"].rms, run["ball.force"].mean, run["inner.vy"].rms]
    assert [pair.value for pair in report.pairs] == pytest.approx(values, rel=1e-5)


@pytest.mark.long
def test_asking_for_more_does_not_move_a_quantity_or_its_derivative(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_tangent")
    of = ["peak_ball_force", "rms:inner.x", "mean:outer.y"]
    few = model.sensitivity(of, "bearing.share", check=False)
    more = model.sensitivity([*of, "mean:ball.elastic_force[3]"], "bearing.share", check=False)
    for a, b in zip(few.pairs, more.pairs, strict=False):
        assert a.value == pytest.approx(b.value, rel=1e-6, abs=0.0)
        assert a.derivative == pytest.approx(b.derivative, rel=1e-4, abs=0.0)


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
    with pytest.raises(RequestError, match="check: True or False is expected, not 'diferences'"):
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
@pytest.mark.extreme
def test_a_smoothed_contact_makes_a_gated_law_differentiable(make_model: Callable[..., Model]) -> None:
    """Contacts open and close in this run: with Hertz's own onset the force would jump there."""
    smooth = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')
    model = make_model("punching_press", ('law = "one-sided"', 'law = "two-sided-gated"'), smooth)
    report = model.sensitivity("rms:inner.y", "bearing.clearance", 0.7, transient=0)
    (pair,) = report.pairs
    assert pair.check.verdict is Verdict.VERIFIED
    assert not pair.check.bounded
