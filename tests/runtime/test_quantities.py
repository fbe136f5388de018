"""Quantities of interest: one meaning for one name, closed forms, wrong names."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import KinkWarning, Model, QuantityFunction, RequestError, UnknownValueWarning
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.quantity.grammar import parse_quantity, quantities_of, quantity_words


def values(model: Model, of: list[str], **options: object) -> dict[str, float]:
    report = model.sensitivity(of, [next(iter(model.parameters))], check=False, **options)  # type: ignore[arg-type]
    return {item.name: item.value for item in report.quantities}


def test_drive_work_is_the_work_of_the_punch_and_falls_with_its_window(make_model: Callable[..., Model]) -> None:
    """Work F (y(start) - y(end)) of a turn: its derivatives by force and edges need no simulation at all."""
    model = make_model("punching_press")
    punch = "mechanism.forces.punch"
    names = [f"{punch}.force.y", f"{punch}.window.start", f"{punch}.window.end", "mechanism.driver.speed"]
    report = model.sensitivity(["drive_work", "integral:drive_torque"], names, 2, transient=1, check=False)
    speed = model.parameters[names[3]]
    force = model.parameters[names[0]]
    start, end = model.parameters[names[1]], model.parameters[names[2]]
    crank, rod = (model.parameters[f"mechanism.bodies.{name}"] for name in ("crank.points.B", "rod.points.C"))

    def height(angle: float) -> float:
        return crank * math.sin(angle) - math.sqrt(rod**2 - (crank * math.cos(angle)) ** 2)

    def falling(angle: float) -> float:
        x = crank * math.cos(angle)
        return crank * math.cos(angle) - x * crank * math.sin(angle) / math.sqrt(rod**2 - x**2)

    work = force * (height(start) - height(end))
    assert report.quantities[0].value == pytest.approx(work, rel=1e-9)
    expected = [work / force, force * falling(start), -force * falling(end)]
    for name, number in zip(names, expected, strict=False):
        assert report["drive_work", name].derivative == pytest.approx(number, rel=1e-8), name
    assert abs(report["drive_work", names[3]].dimensionless) < 1e-10
    # the integral over time of one turn is work over speed
    assert report.quantities[1].unit == "N*m*s"
    assert report.quantities[1].value == pytest.approx(work / speed, rel=1e-9)
    assert report["integral:drive_torque", names[0]].derivative == pytest.approx(
        work / force / speed, rel=1e-8, abs=0.0
    )
    assert report["integral:drive_torque", names[3]].dimensionless == pytest.approx(-1.0, abs=1e-10)


@pytest.mark.parametrize("scene", ["punching_press", pytest.param("engine", marks=pytest.mark.long)])
def test_drive_work_of_a_run_that_ends_within_a_turn_is_that_of_whole_turns(
    make_model: Callable[..., Model], scene: str
) -> None:
    """Of as many turns as loads repeat after: an engine fires in every second one."""
    model, speed = make_model(scene), "mechanism.driver.speed"
    whole = model.quantities(["drive_work"], cycles=5, transient=1)["drive_work"].value
    for cycles, transient in ((4.0, 1.0), (4.5, 1.0), (4.5, 1.75), (4.0, 1.5)):
        report = model.sensitivity(["drive_work"], [speed], cycles, transient=transient, check=False)
        assert report.quantities[0].value == pytest.approx(whole, rel=1e-9), (cycles, transient)
        assert abs(report["drive_work", speed].dimensionless) < 1e-9
        for method in ("auto", "cvodes"):
            run = model.simulate(cycles=cycles, transient=transient, method=method)
            assert summarize(model, run)["drive_work"]["value"] == pytest.approx(whole, rel=1e-6)
    # a run in seconds that ends with a whole turn, which a slower driver ends later
    end = 6.0 * math.tau / model.parameters[speed]
    report = model.sensitivity(["drive_work"], [speed], duration=end, transient=2, check=False)
    assert report.quantities[0].notes == ()
    assert abs(report["drive_work", speed].dimensionless) < 1e-9
    for cycles, transient in ((1.5, 0.75), (1.5, 1.0), (0.4, 0.1)):  # on both sides of a turn's end, and within a turn
        with pytest.raises(RequestError, match="drive_work: the time that counts holds no whole turn"):
            model.quantities(["drive_work"], cycles=cycles, transient=transient)
        assert "drive_work" not in summarize(model, model.simulate(cycles=cycles, transient=transient))


@pytest.mark.long
def test_drive_work_of_a_time_of_whole_turns_has_the_derivative_towards_higher_speeds(
    make_model: Callable[..., Model],
) -> None:
    """Two-way the turns after the start differ, and a slower driver leaves out the last one: a jump, which is said."""
    model, speed = make_model("punching_press_two_way"), "mechanism.driver.speed"
    end = 4.0 * math.tau / model.parameters[speed]
    report = model.sensitivity(["drive_work"], [speed, "bearing.clearance"], duration=end, transient=2)
    cycles = model.sensitivity(["drive_work"], [speed], 4, transient=2)
    assert cycles.verdicts[Verdict.VERIFIED] == 1
    assert report["drive_work", speed].derivative == pytest.approx(cycles["drive_work", speed].derivative, rel=1e-5)
    assert all("the value jumps there" in pair.check.reason for pair in report.pairs)


@pytest.mark.long
def test_static_deflection_follows_the_two_thirds_power(make_model: Callable[..., Model]) -> None:
    """With zero clearance delta = const (F/k)^(2/3) and Q proportional to F: elasticities 2/3, -2/3, 1 and 0."""
    model = make_model("varying_compliance")
    wrt = ["load.force.x", "bearing.contact.stiffness"]
    report = model.sensitivity(["static_deflection", "static_peak_ball_force"], wrt)
    expected = {
        ("static_deflection", wrt[0]): 2 / 3,
        ("static_deflection", wrt[1]): -2 / 3,
        ("static_peak_ball_force", wrt[0]): 1.0,
        ("static_peak_ball_force", wrt[1]): 0.0,
    }
    for key, number in expected.items():
        assert report[key].dimensionless == pytest.approx(number, abs=1e-8)
        assert report[key].check.verdict.value == "verified"


@pytest.mark.long
@pytest.mark.parametrize("start_angle", [0.0, 4.5])
def test_static_quantities_are_those_of_the_static_query_in_the_first_turn(
    make_model: Callable[..., Model], start_angle: float
) -> None:
    """In a later turn the balls stand elsewhere, for cage and crank turn at different speeds."""
    model = make_model("punching_press_tangent")
    numbers = {"mechanism.driver.start_angle": start_angle}
    names = ["static_deflection@240deg", "static_peak_ball_force@240deg", "static_deflection"]
    # without a place t = 0 counts: there must be a load then
    asked = names if start_angle else names[:2]
    found = values(model, asked, parameters=numbers)
    rest = model.static_equilibrium(crank_angle=math.radians(240.0), parameters=numbers)
    later = model.static_equilibrium(t=rest.time + model.period(), parameters=numbers)
    assert found[names[0]] == pytest.approx(math.hypot(rest["inner.x"], rest["inner.y"]), rel=1e-12, abs=0.0)
    assert found[names[1]] == pytest.approx(rest.peak_ball_force, rel=1e-12)
    assert abs(later.peak_ball_force / rest.peak_ball_force - 1.0) > 1e-3
    if start_angle:
        rest = model.static_equilibrium(t=0.0, parameters=numbers)
        assert found[names[2]] == pytest.approx(math.hypot(rest["inner.x"], rest["inner.y"]), rel=1e-12, abs=0.0)


def test_a_parameter_that_is_zero_has_no_elasticity_and_is_ranked_by_its_effect(
    make_model: Callable[..., Model],
) -> None:
    """One loaded ball: a change of the diametral clearance moves the ring by half of it, though clearance is 0 here."""
    model = make_model("varying_compliance")
    names = ["bearing.ball_angle", "load.force.y", "bearing.clearance", "load.force.x"]
    report = model.sensitivity(["static_peak_ball_force", "static_deflection"], names)
    pair = report["static_deflection", "bearing.clearance"]
    # a tenth of a micrometre, of more than one: far more than any elasticity of 0 would let one expect
    assert abs(pair.derivative) > 0.1
    assert math.isnan(pair.dimensionless)
    assert [row["dimensionless"] for row in report.to_json()["sensitivities"][:3]] == [None] * 3
    ranked = report.of("static_deflection")
    assert ranked[0].parameter == "load.force.x"
    behind = [abs(item.change) for item in ranked[1:]]
    assert behind == sorted(behind, reverse=True)
    assert behind[0] > behind[-1]
    text = str(report)
    assert text.count("parameter is 0") == 2
    (line, _) = [line for line in text.splitlines() if line.lstrip().startswith("bearing.clearance")]
    assert "–" in line
    assert "+0.0000" not in line


@pytest.mark.long
def test_amplitude_of_a_ring_on_a_linear_spring(make_model: Callable[..., Model]) -> None:
    """Heavy preload makes the contacts linear: the outer ring on its housing then answers a constant load, and the
    amplitude at an order of the shaft falls with the housing's stiffness as the static compliance does."""
    model = make_model("punching_press_tangent")
    loose = {
        "mechanism.forces.punch.force.y": 0.0,
        "bearing.clearance": -60e-6,
        "bearing.outer_ring.stiffness": 1e6,
        "bearing.outer_ring.damping": 3e3,
        "mechanism.driver.speed": 2.0,
    }
    report = model.sensitivity(
        "amplitude:outer.y@1x", "bearing.outer_ring.stiffness", 2, transient=1, parameters=loose, check=False
    )
    # a slow load: amplitude = F/k_p up to (omega/omega_0)^2 ~ 1e-5 and the square of the damper's c omega/k = 6e-3
    assert report.pairs[0].dimensionless == pytest.approx(-1.0, abs=2e-4)


@pytest.mark.long
def test_an_amplitude_of_rounding_has_a_corner_and_no_derivative(make_model: Callable[..., Model]) -> None:
    """Of a harmonic load that is off, beside a mean of 196 N: the line has the phase of rounding."""
    load = """type = "harmonic"
mean = ["196 N", "0 N"]
amplitude = ["0 N", "0 N"]
frequency = "31 Hz"
phase = "25 deg" #"""
    model = make_model("varying_compliance", ('type = "constant" ', load), ('force = ["196 N", "0 N"]', ""))
    asked, by = ["amplitude:load.x@31Hz", "amplitude:load.y@31Hz"], ["load.amplitude.x", "load.amplitude.y"]
    report = model.sensitivity(asked, by, 20, transient=10)
    assert [pair.value for pair in report.pairs] == [0.0] * 4
    assert [pair.derivative for pair in report.pairs] == [0.0] * 4
    for quantity, name in zip(asked, by, strict=True):
        assert "the slope is -1.0" in report[quantity, name].check.reason
    function = QuantityFunction(model, asked, by, 20, transient=10)
    with pytest.warns(KinkWarning, match="load.x@31Hz.*: it is zero and has a corner there"):
        assert not function.jacobian(function.start).any()


@pytest.mark.long
def test_value_at_a_crank_angle_is_that_of_the_run(make_model: Callable[..., Model]) -> None:
    model = make_model("offset_slider")
    angle = math.radians(200.0)
    found = values(model, ["value:inner.y@200deg", f"value:inner.y@{angle!r}rad", "end:inner.y"], cycles=1, transient=0)
    turn = model.period()
    fine = model.simulate(1, rtol=1e-11, samples_per_cycle=360)
    assert found["value:inner.y@200deg"] == pytest.approx(float(fine["inner.y"][200]), rel=1e-6)
    assert found[f"value:inner.y@{angle!r}rad"] == found["value:inner.y@200deg"]
    assert found["end:inner.y"] == pytest.approx(float(fine["inner.y"][-1]), rel=1e-5)
    assert fine.t[-1] == pytest.approx(turn)


@pytest.mark.long
def test_values_at_angles_of_an_engine_are_those_of_the_same_stroke(make_model: Callable[..., Model]) -> None:
    """Whatever the last turn of the run: 40 degrees are not 400."""
    model = make_model("engine")
    turn = model.period()
    for cycles in (4, 5):
        found = values(model, ["value:inner.y@40deg", "value:inner.y@400deg"], cycles=cycles, transient=0)
        run = model.simulate(cycles, rtol=1e-10, times=[turn * (k + 40.0 / 360.0) for k in (2, 3)])
        late = model.simulate(cycles, rtol=1e-10, times=[turn * (4 + 40.0 / 360.0)]) if cycles == 5 else run
        assert found["value:inner.y@400deg"] == pytest.approx(float(run["inner.y"][1]), rel=1e-4)
        assert found["value:inner.y@40deg"] == pytest.approx(float(late["inner.y"][0]), rel=1e-4)
        assert abs(run["inner.y"][0] / run["inner.y"][1] - 1.0) > 0.1


@pytest.mark.long
def test_a_sum_rule_of_amplitudes_holds(make_model: Callable[..., Model]) -> None:
    """Parseval: mean square about the mean is half the sum of squares of the harmonics' amplitudes."""
    model = make_model("four_bar")
    orders = [f"amplitude:drive_torque@{k}x" for k in range(1, 40)]
    found = values(model, ["rms:drive_torque", "mean:drive_torque", *orders], cycles=1, transient=0)
    square = found["mean:drive_torque"] ** 2 + 0.5 * sum(found[name] ** 2 for name in orders)
    # the torque steps with its load: amplitudes fall like 1/k, and 40 of them leave about a hundredth of the square
    assert square == pytest.approx(found["rms:drive_torque"] ** 2, rel=0.02)
    assert square < found["rms:drive_torque"] ** 2


def test_smooth_reactions_have_no_lines_far_above_the_shafts(make_model: Callable[..., Model]) -> None:
    """Nodes lay as dense as the reaction needs: 1024 a turn, and the line at 1025 was a quarter of the first."""
    model, punch = make_model("punching_press"), {"mechanism.forces.punch.force.y": 0.0}
    names = [f"amplitude:reaction.A.x@{order}x" for order in (1, 1025)]
    first, far = model.quantities(names, cycles=3, transient=1, parameters=punch).values()
    assert far.value < 1e-6 * first.value


@pytest.mark.long
def test_the_shaft_of_a_bearing_that_swings_is_the_driver(make_model: Callable[..., Model]) -> None:
    """Its rings have no mean speed against each other: the amplitude was that at 0 Hz, about nothing."""
    model = make_model("punching_press_hinges")
    found = values(model, ["amplitude:pin.inner.x@shaft", "amplitude:pin.inner.x@1x"], cycles=2, transient=1)
    assert found["amplitude:pin.inner.x@shaft"] == found["amplitude:pin.inner.x@1x"] > 1e-9
    for what in ("cage", "bpfo", "bpfi", "bsf"):
        with pytest.raises(RequestError, match=r"bearings\.pin do not turn against each other"):
            values(model, [f"amplitude:pin.inner.x@{what}"], cycles=2, transient=1)


@pytest.mark.long
def test_the_frequency_of_a_cage_between_rings_moves_with_the_balls_whichever_ring_turns(
    make_model: Callable[..., Model],
) -> None:
    """Thicker balls slow the cage that an inner ring turns, and speed up the other one: the slope was that of BPFO."""
    model = make_model("varying_compliance", ("[shaft]\n", '[shaft]\nring = "outer"\n'))
    report = model.sensitivity(["amplitude:inner.x@cage"], ["bearing.ball_diameter"], cycles=3, transient=1)
    assert [pair.check.verdict for pair in report.pairs] == [Verdict.VERIFIED]


@pytest.mark.long
def test_the_frequency_of_a_cage_whose_slip_changes_is_that_of_its_mean_over_the_run(
    make_model: Callable[..., Model],
) -> None:
    """It was that of the last slip; its derivative by slips, and by times from which they hold, was none."""
    slip = '[bearing.cage]\nslip = { time = ["0 s", "0.03 s"], value = [0.0, 0.2] }\n\n[bearing.initial]'
    model = make_model("rotor", ("[bearing.initial]", slip))
    cage = 50.0 * model.constants()["bearing.cage_ratio"] * (1.0 - 0.2 * 0.03 / 0.04)  # from 0.02 s to 0.06 s
    lines = {"cage": cage, "bpfo": 8 * cage, "bpfi": 8 * (50.0 - cage)}
    names = [f"amplitude:inner.y@{line}" for line in lines]
    given = [f"amplitude:inner.y@{frequency:.12f}Hz" for frequency in lines.values()]
    moved = ["bearing.cage.slip.value.1", "bearing.cage.slip.value.2", "bearing.cage.slip.time.2", "shaft.speed"]
    report = model.sensitivity([*names, *given], moved, cycles=3, transient=1)
    found = {item.name: item.value for item in report.quantities}
    assert [found[name] for name in names] == pytest.approx([found[name] for name in given], rel=1e-9, abs=0.0)
    assert {pair.check.verdict for pair in report.pairs} == {Verdict.VERIFIED}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("peak_bal_force", "peak_ball_force"),
        ("max:ball.forse", r"ball\.force"),
        ("mx:ball.force", "max"),
        ("max:ball.force[9]", "1 to 8"),
        ("max:inner.y[1]", "no balls"),
        ("value:inner.y", "240deg"),
        ("value:inner.y@bpfo", "240deg"),
        ("amplitude:inner.y@9", "bpfo"),
        ("max:inner.y@2x", "nothing after"),
        ("drive_wrok", "drive_work"),
        ("static_deflection@1000deg", "1000deg is more than two turns.* -720deg to 720deg"),
        ("static_peak_ball_force@-17.5rad", "-17.5rad is more than two turns.* -4 pi to 4 pi rad"),
        ("max:drive_angle", 'run.outputs: add "drive_angle" there'),
    ],
)
def test_wrong_names_are_refused_with_a_remedy(make_model: Callable[..., Model], text: str, words: str) -> None:
    with pytest.raises(RequestError, match=words):
        quantities_of(make_model("punching_press"), [text])


@pytest.mark.parametrize("kind", ["value:inner.y", "static_deflection"])
def test_angles_of_a_motor_are_refused_and_times_are_not(make_model: Callable[..., Model], kind: str) -> None:
    model = make_model("punching_press_motor")
    assert [item.place for item in quantities_of(model, [f"{kind}@0.1s"])] == ["0.1s"]
    with pytest.raises(RequestError, match=r"the driver passes an angle when its motion does.* @0\.41s"):
        quantities_of(model, [f"{kind}@240deg"])


@pytest.mark.parametrize("scene", ["punching_press", "offset_slider", "four_bar"])
@pytest.mark.parametrize(
    "text",
    ["peak_bal_force", "peaktime_ball_force", "valu_inner_y", "value_inner.y", "drive_wrok", "static_deflektion"],
)
def test_what_is_suggested_can_be_asked_for(make_model: Callable[..., Model], scene: str, text: str) -> None:
    manifest = make_model(scene).manifest
    with pytest.raises(RequestError) as refused:
        parse_quantity(manifest, text)
    suggested = re.findall(r"'([^']+)'", str(refused.value).partition("Did you mean")[2])
    for name in suggested:
        parse_quantity(manifest, name)


def test_parameters_are_chosen_by_patterns_too(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    report = model.sensitivity("static_deflection", ["load.force.y", "load.*", "bearing.b*_diameter"], check=False)
    assert report.parameters == ("load.force.y", "load.force.x", "bearing.ball_diameter")
    with pytest.raises(RequestError, match=r"bering\.\*"):
        model.sensitivity("static_deflection", "bering.*", check=False)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("peak_ball_force", "Elastic and damping force of any ball, highest"),
        ("max:ball.force[3]", "Elastic and damping force of ball 3, highest"),
        ("rms_inner_y", "Position of the centre of the inner ring along y, rms"),
        ("value:inner.y@240deg", "Position of the centre of the inner ring along y, at 240deg"),
        ("life", "Rating life"),
        ("drive_work", "work of the drive in a turn"),
    ],
)
def test_quantities_have_words_for_figures(make_model: Callable[..., Model], name: str, words: str) -> None:
    manifest = make_model("punching_press").manifest
    assert quantity_words(manifest, parse_quantity(manifest, name)) == words


def test_angles_of_driver_and_cage_do_not_depend_on_edges_of_loads(make_model: Callable[..., Model]) -> None:
    """They grew on from the last edge of a load: over a turn of the press the driver's angle was up to 597 degrees."""
    model = make_model("punching_press", ('"drive_torque"]', '"drive_torque", "drive_angle", "cage.*"]'))
    angles = ("drive_angle", "cage.in_outer", "cage.in_inner")
    found = model.quantities([f"{kind}:{angle}" for angle in angles for kind in ("max", "min", "mean", "rms")], 4)
    share = model.constants()["bearing.cage_ratio"]
    turned = np.linspace(2.0, 4.0, 2_000_001) * 2.0 * np.pi  # of the driver, in turns two to four
    expected = {
        "drive_angle": turned % (2.0 * np.pi),
        "cage.in_outer": np.angle(np.exp(1j * share * turned)),
        "cage.in_inner": np.angle(np.exp(1j * (share - 1.0) * turned)),
    }
    for name, angle in expected.items():
        got = [found[f"{kind}:{name}"].value for kind in ("max", "min", "mean", "rms")]
        assert got == pytest.approx([max(angle), min(angle), np.mean(angle), np.sqrt(np.mean(angle**2))], abs=1e-5)


def test_time_of_the_largest_load_of_an_unbalance_moves_with_its_angle_and_with_the_speed(
    make_model: Callable[..., Model],
) -> None:
    """The load turns with the shaft: its time is an angle over the speed.  It falls on an end of the grid of nodes."""
    model = make_model("rotor")
    speed = model.parameters["shaft.speed"]
    names = ["loads.unbalance.angle", "shaft.speed"]
    report = model.sensitivity(["peak_time:load.y", "min_time:load.y"], names, cycles=2, transient=1)
    for first, second in (report.pairs[:2], report.pairs[2:]):
        assert first.derivative == pytest.approx(-1.0 / speed, rel=1e-9)
        assert second.derivative == pytest.approx(-first.value / speed, rel=1e-9)
    assert {pair.check.verdict for pair in report.pairs} == {Verdict.VERIFIED}


def test_of_equal_peaks_of_a_periodic_torque_the_first_is_taken(make_model: Callable[..., Model]) -> None:
    """Of a linkage that turns evenly every turn has the same peak; rounding decided in which it was."""
    model = make_model("four_bar")
    name, extremes = "mechanism.driver.speed", ["peak_time:drive_torque", "min_time:drive_torque"]
    speeds = model.parameters[name] * (1.0 + 1e-3 * np.arange(-4, 5))
    found = model.simulate_many({name: speeds}, extremes, cycles=6, transient=1)
    report = model.sensitivity(extremes, name, cycles=6, transient=1)
    assert {pair.check.verdict for pair in report.pairs} == {Verdict.VERIFIED}
    for pair, extreme in zip(report.pairs, extremes, strict=True):
        turns = speeds * found[extreme] / (2.0 * math.pi)
        assert np.all(turns < 2.01), extreme
        slope = (found[extreme][5] - found[extreme][3]) / (speeds[5] - speeds[3])
        assert pair.derivative == pytest.approx(slope, rel=1e-4), extreme


@pytest.mark.long
def test_lives_of_two_bearings_have_the_same_bits_in_runs_and_members(make_model: Callable[..., Model]) -> None:
    model = make_model("rotor_two_bearings")
    names = ["pulley.life", "free_end.life"]
    options: dict[str, Any] = {"cycles": 2, "transient": 1, "rtol": 1e-9, "kinks": "located"}
    alone = {name: one.value for name, one in model.quantities(names, **options).items()}
    width = "bearings.pulley.clearance"
    many = model.simulate_many({width: [model.parameters[width]] * 2}, names, **options)
    assert {name: many[name].tolist() for name in names} == {name: [value] * 2 for name, value in alone.items()}


def test_where_an_angle_jumps_at_an_edge_its_mean_does_not_move_with_the_edge(make_model: Callable[..., Model]) -> None:
    """The jump was taken for one that the window moves: -2 pi over a turn, where zero is right."""
    angle, window = "mechanism.driver.start_angle", "mechanism.forces.punch.window.start"
    model = make_model("punching_press", ('"drive_torque"]', '"drive_torque", "drive_angle", "body.crank.*"]'))
    at, span = {window: math.pi}, {"cycles": 2, "transient": 0}
    means = ["mean:body.crank.angle", "rms:body.crank.angle"]
    found = model.sensitivity(means, window, parameters=at, check=False, **span)
    assert all(pair.derivative == pytest.approx(0.0, abs=1e-12) for pair in found.pairs)
    start = QuantityFunction(model, "mean:drive_angle", [angle, "mechanism.driver.speed"], **span)
    with pytest.warns(UnknownValueWarning, match="the angle jumps by a turn at an edge"):
        by_start, by_speed = start.jacobian([0.0, 52.0])
    assert math.isnan(by_start)  # other to the one side than to the other where the run is not of whole turns
    assert by_speed == pytest.approx(0.0, abs=1e-12)
    assert start.jacobian([0.1, 52.0]) == pytest.approx([0.0, 0.0], abs=1e-12)
