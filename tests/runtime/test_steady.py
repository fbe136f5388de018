"""Periodic states: numbers of an independent solver, differences of a tight flow, brute force, refusals."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from flow_differences import differences
from typer.testing import CliRunner

from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "varying_compliance.toml"

#: Time from ball to ball on the load line [s], and speeds [rad/s].
PERIOD, RPM = 0.05, math.tau / 60.0

#: Pitch diameter at which the cage makes three of eight turns in one of the shaft [m].
THREE_EIGHTHS = {"bearing.pitch_diameter": 31.75e-3}


def test_varying_compliance_has_the_state_and_multipliers_of_an_independent_solver(rotor: Model) -> None:
    found = rotor.steady()
    assert found.period == pytest.approx(PERIOD, rel=1e-12, abs=0.0)
    assert "renumbered by 1" in found.forcing
    assert len(found.left) <= 6
    assert found.start[:2] == pytest.approx([3.9935867208e-6, 6.860837e-10], rel=1e-6, abs=1e-15)
    assert found.start[2:] == pytest.approx([-1.439634e-8, -2.0469226e-5], abs=1e-13)
    first, second = -0.775690017 + 0.069538893j, 0.048261392 + 0.777303993j
    for printed in (first, second):
        for m in (printed, printed.conjugate()):
            assert np.min(np.abs(found.multipliers - m)) < 2e-9
    assert found.kind == "stable"


def test_multipliers_have_the_product_that_damping_leaves_of_volume(rotor: Model) -> None:
    """Liouville: the divergence of the equations is -c/m for each of two velocities, wherever the balls stand."""
    loss = 2.0 * rotor.parameters["bearing.inner_ring.damping"] / rotor.parameters["bearing.inner_ring.mass"]
    assert np.prod(rotor.steady().multipliers) == pytest.approx(math.exp(-loss * PERIOD), rel=1e-9)


def test_multipliers_are_those_of_differences_of_a_tight_flow(rotor: Model) -> None:
    found = rotor.steady()
    flow = np.linalg.eigvals(differences(rotor, {}, found.start, PERIOD, [1e-9, 1e-9, 3e-7, 3e-7]))
    for m in found.multipliers:
        assert np.min(np.abs(flow - m)) < 1e-6


@pytest.mark.parametrize("hertz", [20.0, 600.0])
def test_the_transient_that_comes_as_near_takes_more_than_ten_times_the_periods(rotor: Model, hertz: float) -> None:
    """Side by side: a run of the printed number of periods is as near to the state, and one of half as many is not."""
    given = {"shaft.speed": 393.1540342298 * RPM * hertz / 20.0}
    found = rotor.steady(parameters=given)
    words = str(found).replace("\n", " ").partition("a transient takes ")[2]
    periods = int(words.partition(" periods")[0])
    assert periods > 10 * found.integrated
    times = np.array([periods // 2, periods]) * found.period
    run = rotor.simulate(duration=times[-1], times=times, parameters=given, rtol=1e-11, outputs=[], transient=0.0)
    half, whole = np.max(np.abs(run.x - found.start) / run.statistics.magnitudes, axis=1)
    assert found.left[-1] < 1e-11
    assert whole < 1e-10 < 1e-7 < half


def test_multipliers_are_those_of_the_state_that_is_given(make_model: Callable[..., Model]) -> None:
    """Where branches wind, a last step of 1e-7 of the state changes them by 1e-3."""
    given = {**THREE_EIGHTHS, "bearing.clearance": 20.155e-6}
    press = make_model("punching_press_tangent")
    found = press.steady(parameters=given)
    begun_there = dict(zip(press.manifest.initial, found.start.tolist(), strict=True))
    again = press.steady(transient=0.0, parameters={**given, **begun_there})
    assert again.left[0] < 1e-6
    for one in (found, again):
        assert one.multipliers[0].real == pytest.approx(-1.28949, abs=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("ends", ["0 um:10 um", "10 um:0 um"])
def test_a_branch_over_clearance_begins_at_none(rotor: Model, ends: str) -> None:
    """At the states of the zero end no ball touches at the other one."""
    branch = rotor.steady(over=f"bearing.clearance={ends}", transient=20.0).branches[0]
    for point in (branch.points[0], branch.points[-1]):
        there = rotor.steady(transient=20.0, parameters={"bearing.clearance": point.value})
        assert point.multipliers == pytest.approx(there.multipliers, abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("law", ["one-sided-gated", "two-sided-gated"])
def test_multipliers_of_a_law_that_jumps_are_those_of_differences_of_a_tight_flow(
    make_model: Callable[..., Model], law: str
) -> None:
    damped = ('law = "none"', f'law = "{law}"\ncoefficient = "400 N*s/m"')
    rotor = make_model("varying_compliance", damped)
    given = {"bearing.clearance": 2e-6, "shaft.speed": 5870.0 * RPM, "bearing.inner_ring.damping": 100.0}
    found = rotor.steady(transient=20.0, parameters=given)
    assert found.contacts.count >= 2
    flow = differences(rotor, given, found.start, found.period, [1e-10, 1e-10, 3e-8, 3e-8], kinks="located")
    values = np.linalg.eigvals(flow)
    for m in found.multipliers:
        assert np.min(np.abs(values - m)) < 1e-5


def test_states_in_one_and_in_several_segments_are_the_same(rotor: Model) -> None:
    one, several = rotor.steady(), rotor.steady(segments=5)
    assert several.segments == 5
    assert several.start == pytest.approx(one.start, abs=1e-12)
    assert np.abs(several.multipliers) == pytest.approx(np.abs(one.multipliers), rel=1e-7)


def test_beyond_the_doubling_the_state_is_unstable_and_twice_its_period_is_what_runs_end_on(rotor: Model) -> None:
    speed = {"shaft.speed": 1965.0 * RPM}
    single, twice = (rotor.steady(repeats=n, parameters=speed) for n in (1, 2))
    assert not single.stable
    assert "period doubling" in single.kind
    assert single.multipliers[0] == pytest.approx(-1.00719457, abs=1e-6)
    assert twice.stable
    assert twice.sooner == 2
    times = np.arange(1196, 1200) * single.period  # distances fall by a factor of 0.97 each second period
    run = rotor.simulate(duration=1200 * single.period, times=times, parameters=speed, outputs=[], rtol=1e-9)
    assert np.ptp(run.x[::2, 1]) < 1e-11
    assert abs(run.x[0, 1] - run.x[1, 1]) > 1e-8  # two values by turns, of which one is at the start
    assert np.min(np.abs(run.x[:2] - twice.start)[:, 1]) < 1e-11


def test_the_doubling_is_where_an_independent_solver_has_it_and_its_branch_is_followed(rotor: Model) -> None:
    found = rotor.steady(over="shaft.speed=1955 rpm:1972 rpm")
    base, twice = found.branches
    assert [point.kind for point in base.special] == ["period doubling", "period doubling"]
    assert base.special[0].value / RPM == pytest.approx(1961.14639, abs=2e-5)
    last = base.points[-1]
    assert last.value / RPM == pytest.approx(1972.0, rel=1e-12)  # the range's end, not a point beyond it
    there = rotor.steady(parameters={"shaft.speed": 1972.0 * RPM})
    assert last.multipliers == pytest.approx(there.multipliers, abs=1e-6)
    assert twice.repeats == 2
    assert all(point.stable for point in twice.points)
    assert "meets the branch" in twice.ended
    text = str(found)
    assert "1961.146" in text
    assert "period doubling" in text


def test_two_doublings_in_a_wide_range_are_both_found(rotor: Model) -> None:
    """They are 7 rpm apart, steps of a fiftieth of the range 20."""
    base, twice = rotor.steady(over="shaft.speed=1800 rpm:2400 rpm").branches
    assert [point.kind for point in base.special] == ["period doubling", "period doubling"]
    for point, printed in zip(base.special, (1961.146, 1968.185), strict=True):
        assert point.value / RPM == pytest.approx(printed, abs=1e-3)
        sizes = []
        for aside in (-1e-5, 1e-5):
            value = (1.0 + aside) * point.value
            there = rotor.steady(parameters={"shaft.speed": value}, transient=20.0)
            period = PERIOD * 393.1540342298 * RPM / value
            flow = differences(rotor, {"shaft.speed": value}, there.start, period, [1e-9, 1e-9, 3e-7, 3e-7])
            sizes.append(np.max(np.abs(np.linalg.eigvals(flow))) - 1.0)
        assert sizes[0] * sizes[1] < 0.0
    assert "meets the branch" in twice.ended


@pytest.mark.long
def test_doublings_of_a_winding_branch_are_all_found_and_each_curve_is_followed_once(rotor: Model) -> None:
    found = rotor.steady(over="shaft.speed=1500 rpm:2500 rpm", parameters={"bearing.clearance": 10e-6}, transient=20.0)
    base, *others = found.branches
    doublings = [point.value / RPM for point in base.special if point.kind == "period doubling"]
    assert doublings[-2:] == pytest.approx([2348.0851, 2369.4435], abs=1e-3)
    assert 2 * len(others) == len(doublings) == 8
    assert all("meets the branch" in other.ended for other in others)


@pytest.mark.long
def test_a_fold_is_where_runs_leave_the_branch(rotor: Model) -> None:
    (branch,) = rotor.steady(over="shaft.speed=5920 rpm:5950 rpm").branches
    (fold,) = branch.special
    assert fold.kind == "fold"
    assert branch.ended.startswith("at the first end of the range")
    assert not branch.points[-1].stable
    went = []
    for away in (0.999, 1.001):
        speed = {"shaft.speed": away * fold.value}
        period = PERIOD * rotor.parameters["shaft.speed"] / speed["shaft.speed"]
        run = rotor.simulate(
            duration=400 * period,
            times=np.arange(395, 400) * period,
            parameters=speed,
            initial=fold.nodes[0],
            outputs=[],
        )
        went.append(float(np.max(np.abs(run.x[:, 0] - fold.nodes[0, 0]))) / abs(fold.nodes[0, 0]))
    assert went[0] < 0.1 < 0.3 < went[1]


def test_a_turn_is_a_period_of_the_press_whose_cage_makes_three_eighths(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press_tangent")
    found = press.steady(parameters=THREE_EIGHTHS)
    assert found.turns == 1.0
    assert "renumbered by 3" in found.forcing
    assert found.stable
    run = press.simulate(cycles=6, parameters=THREE_EIGHTHS, outputs=[], rtol=1e-10)
    assert run.x[-1] == pytest.approx(found.start, abs=1e-9)


def openings_and_closings(
    model: Model, parameters: dict[str, float], start: np.ndarray, period: float
) -> list[tuple[int, int, bool]]:
    """Sample, ball, and whether it closes: where the ball forces of a plain run become zero or cease to be."""
    t = np.linspace(0.0, period, 100_001)
    run = model.simulate(
        times=t,
        duration=period,
        initial=start,
        parameters=parameters,
        outputs=["ball.force"],
        transient=0.0,
        rtol=1e-10,
    )
    loaded = run["ball.force"] > 0.0
    rows, balls = np.nonzero(loaded[1:] != loaded[:-1])
    return [(int(k), int(ball) + 1, bool(loaded[k + 1, ball])) for k, ball in zip(rows, balls, strict=True)]


@pytest.mark.long
def test_the_branch_of_the_press_goes_into_its_chaotic_region(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press_tangent")
    branch = press.steady(over="bearing.clearance=10 um:20.2 um", parameters=THREE_EIGHTHS).branches[0]
    assert branch.ended == "at the end of the range"
    assert abs(branch.points[-1].multipliers[0]) > 10.0  # a state that repels
    # folds and doublings of branches over other ranges: which neighbours are passed within one step depends on the last
    # digits, but none lies elsewhere
    known = [20.12879, 20.12928, 20.15138, 20.15265, 20.15360, 20.16724, 20.17368, 20.17486, 20.17614, 20.18525]
    known += [20.18541, 20.18663, 20.18874]
    seen = [point for point in branch.special if point.value > 20.1e-6]
    assert len(seen) > 1
    assert all(min(abs(point.value * 1e6 - place) for place in known) < 2e-5 for point in seen)
    readings = press.bifurcation("bearing.clearance=20.19 um:20.2 um:2", parameters=THREE_EIGHTHS, readings=60).up[-1]
    assert readings.exponent is not None
    assert readings.exponent.low > 0.0  # beside it motion is chaotic


@pytest.mark.long
def test_the_contacts_of_the_press_are_those_of_its_sampled_ball_forces(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press_tangent")
    found = press.steady(parameters=THREE_EIGHTHS)
    seen = openings_and_closings(press, THREE_EIGHTHS, found.start, found.period)
    assert found.contacts.count == len(seen) > 100
    # damping ends the force shortly before the contact opens: the order is compared where contacts close
    moments = [(moment, ball) for moment, ball, closes in seen if closes]
    order = [int(one.split()[0]) for one in found.contacts.order if "closes" in one]
    # the signature begins elsewhere in the sequence; what comes a period later is renumbered by three
    every = [(moment + 100_000 * turn, (ball - 1 - 3 * turn) % 8 + 1) for turn in range(9) for moment, ball in moments]
    one_after_other = [ball for _, ball in every]
    together = {k for k, (one, other) in enumerate(pairwise(every)) if one[0] == other[0]}
    assert len(together) < 20  # those whose order samples do not say

    def same(first: int) -> bool:
        wrong = [k for k, ball in enumerate(order, first) if one_after_other[k] != ball]
        return all(k in together or k - 1 in together for k in wrong)

    assert any(same(first) for first in range(8 * len(moments)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("over", "parameters", "added", "warned"),
    [
        ("shaft.speed=6000 rpm:5850 rpm", {"bearing.clearance": 2e-6}, 2, True),  # a ball touches once more
        ("bearing.clearance=5.62 um:5.68 um", {}, 0, False),  # one parts before another touches, instead of after
    ],
)
def test_contacts_change_on_a_branch_as_runs_on_both_sides_say(
    rotor: Model, over: str, parameters: dict[str, float], added: int, warned: bool
) -> None:
    found = rotor.steady(over=over, transient=20.0, parameters=parameters)
    assert found.over is not None
    (branch,) = found.branches
    ((one, other),) = branch.contact_changes
    for point in (one, other):
        given = {**parameters, found.over.name: point.value}
        period = PERIOD * rotor.parameters["shaft.speed"] / given.get("shaft.speed", rotor.parameters["shaft.speed"])
        seen = openings_and_closings(rotor, given, point.nodes[0], period)
        assert point.contacts.count == len(seen)
    assert other.contacts.count - one.contacts.count == added
    assert one.contacts.grazes == other.contacts.grazes == warned
    report = found.report()
    (event,) = report.facts["branches"][0]["events"]
    assert event["between"] == [one.value, other.value]
    assert "contacts change" in str(found)
    assert any("Do not trust Newton's iteration" in words for words in report.warnings) == warned


@pytest.mark.long
def test_the_press_of_the_paper_repeats_after_134_turns(make_model: Callable[..., Model]) -> None:
    parts: list[float] = []
    found = make_model("punching_press_tangent").steady(parameters={"bearing.clearance": 20e-6}, progress=parts.append)
    assert len(parts) > 20
    assert all(0.0 <= one <= other < 1.0 for one, other in pairwise(parts))
    assert found.left[0] < 1e-3  # behind a plain period; it was 0.2
    assert found.turns == 134.0
    assert math.log(abs(found.multipliers[0])) / 134.0 == pytest.approx(-1.7588, abs=5e-4)


@pytest.mark.long
def test_a_ball_that_differs_takes_whole_turns_of_the_cage(make_model: Callable[..., Model]) -> None:
    table = '\n[bearing.ball_deviation]\n1 = "2 um"\n'
    rotor = make_model("varying_compliance", ("[bearing.contact]", f"{table}[bearing.contact]"))
    assert rotor.steady(transient=8.0).period == pytest.approx(8.0 * PERIOD, rel=1e-12, abs=0.0)


def test_what_has_no_common_period_is_refused_with_fractions_nearby(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press_tangent")
    with pytest.raises(RequestError, match=r"two periods.*Near: "):
        press.steady(parameters={"bearing.pitch_diameter": math.pi * 1e-2})
    with pytest.raises(RequestError, match="no period holds between"):
        press.steady(over="bearing.pitch_diameter=31.75 mm:33.5 mm")


def test_a_period_over_a_range_holds_within_it_too(make_model: Callable[..., Model]) -> None:
    """A load of 50 to 100 Hz on a shaft of 50 Hz repeats each turn at both ends, and not between them."""
    load = """[loads.harmonic]
type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["10 N", "0 N"]
frequency = "50 Hz"
phase = "0 deg"

[bearing]
"""
    model = make_model("rotor", ("[bearing]\n", load))
    with pytest.raises(RequestError, match=r"loads.harmonic.frequency: at the first end .* no period holds between"):
        model.steady(over="loads.harmonic.frequency=50 Hz:100 Hz", parameters=THREE_EIGHTHS)
    read = model.bifurcation(
        "loads.harmonic.frequency=50 Hz:100 Hz:2", parameters=THREE_EIGHTHS, readings=20, settling=0, exponent=False
    )
    assert read.every == "once a turn, after which balls or loads are elsewhere"


@pytest.mark.long
def test_a_branch_over_an_amplitude_begins_at_none(make_model: Callable[..., Model]) -> None:
    """The rates on which the equations depend are not the same at both ends."""
    model = make_model("rotor", ("[bearing]\n", '[bearing.inner_waviness]\n3 = { amplitude = "0 um" }\n\n[bearing]\n'))
    still = {**THREE_EIGHTHS, "loads.unbalance.mass": 0.0}
    found = model.steady(over="bearing.inner_waviness.3.amplitude=0 um:0.1 um", parameters=still, transient=20.0)
    last = found.branches[0].points[-1]
    for value, state in ((0.0, found.start), (last.value, last.nodes[0])):
        numbers = {**still, "bearing.inner_waviness.3.amplitude": value}
        times = found.period * np.arange(3)
        run = model.simulate(
            duration=float(times[-1]), times=times, initial=state, parameters=numbers, outputs=[], rtol=1e-10
        )
        assert np.max(np.abs(run.x - state), axis=0) == pytest.approx(0.0, abs=1e-6 * float(np.max(np.abs(state))))


def test_turns_after_which_the_balls_are_elsewhere_are_warned_of(rotor: Model) -> None:
    turns = PERIOD * rotor.parameters["shaft.speed"] / math.tau
    assert rotor.steady(turns).report().warnings == []
    (warning,) = rotor.steady(0.9 * turns).report().warnings
    assert "no period" in warning


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("shaft.speed", "is no range"),
        ("shaft.sped=1 rpm:2 rpm", "shaft.speed"),
        ("shaft.speed=1 mm:2 mm", "speed"),
        ("shaft.speed=5 rpm:5 rpm", "two ends that differ"),
        ("bearing.inner_ring.mass=-1 kg:1 kg", "beyond its bounds"),
    ],
)
def test_ranges_are_refused(rotor: Model, over: str, words: str) -> None:
    with pytest.raises(RequestError, match=words):
        rotor.steady(over=over)


@pytest.mark.long
def test_a_driver_whose_motion_is_a_state_is_refused(make_model: Callable[..., Model]) -> None:
    with pytest.raises(RequestError, match="driver's motion is a state"):
        make_model("punching_press_motor").steady()


def test_the_command_prints_what_the_call_gives(rotor: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["steady", str(SCENE)]
    done = CliRunner().invoke(app, [*words, "--json", "--out", "figures"])
    assert done.exit_code == 0, done.output
    plain, found = json.loads(done.stdout), rotor.steady()
    assert [row["start"] for row in plain["states"]] == pytest.approx(found.start.tolist(), rel=1e-6, abs=1e-15)
    assert plain["multipliers"][0]["magnitude"] == pytest.approx(0.778800783, abs=1e-8)
    assert (tmp_path / "figures" / "multipliers.png").exists()
    told = CliRunner().invoke(app, words)
    assert "(size 0.7788007" in told.stdout
    assert CliRunner().invoke(app, [*words, "--turns", "0"]).exit_code == 2


@pytest.mark.parametrize(
    ("ask", "given", "words"),
    [
        ("steady", {"turns": 0.0}, "turns: 0 lies outside its bounds. Allowed: a number above 0"),
        ("spectrum", {"of": "inner.x", "top": 0, "scaling": "loud"}, "Allowed: amplitude, power, density"),
        ("spectrum", {"of": "inner.x", "orders": True, "spectrogram": True}, "both given"),
        ("checked_jacobian", {"of": "rhs", "wrt": "states", "state": "moving"}, "Allowed: equilibrium, initial"),
        ("life", {"cycles": float("inf")}, "cycles: inf lies outside its bounds"),
    ],
)
def test_options_are_refused_in_python_as_on_the_command_line(
    rotor: Model, ask: str, given: dict[str, object], words: str
) -> None:
    with pytest.raises(RequestError, match=words):
        getattr(rotor, ask)(**given)
