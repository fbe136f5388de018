"""Claims about waviness, spalls and slip with every drive, in both couplings, on whichever ring turns.

Accelerations against absolute coordinates are in `test_coupled_machines.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from ball_effects import taken
from comparison import drawn, power_imbalance
from coupled_scenes import (
    CHANGING_SLIP,
    EFFECTS,
    LAGGING,
    LAGGING_LONG,
    POWERS,
    RUN,
    SPALLS,
    TANGENT,
    UNDAMPED,
    Derived,
    bearing,
    with_bearings,
)
from multibody import Multibody
from virtual import virtual_model

from ballpass.derive import SceneError, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, RequestError, load
from ballpass.runtime.vibration.diagnosis import order_spectrum
from ballpass.runtime.vibration.spectrum import AmplitudeSpectrum

SCENES = Path(__file__).resolve().parents[2] / "scenes"
MOTOR = """[mechanism.driver.torque]
law = "asynchronous"
breakdown_torque = "40 N*m"
breakdown_slip = 0.2
synchronous_speed = "520 rpm"
[mechanism.driver.flywheel]
inertia = "0.2 kg*m^2"
"""
COASTING = '[mechanism.driver.torque]\nlaw = "none"\n[mechanism.driver.flywheel]\ninertia = "0.2 kg*m^2"\n'
SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
RUN_UP = 'table = { time = ["0 s", "6 s"], speed = ["300 rpm", "900 rpm"] }\n'
SPALL = """[bearing.defects.spall]
on = "outer"
angle = "283 deg"
chord = "1 mm"
profile = "path"
"""


@cache
def press(*bearings: str, drive: str = "", table: bool = False) -> str:
    """The paper's press with other bearings and another drive."""
    text = (SCENES / "punching_press.toml").read_text(encoding="utf-8").partition("[bearing]")[0]
    assert SPEED in text
    text = text.replace(SPEED, RUN_UP) if table else text
    return text.replace("[mechanism.frame.points]", f"{drive}[mechanism.frame.points]") + "".join(bearings) + RUN


ALL = EFFECTS + SPALLS


@pytest.mark.parametrize(
    "text",
    [
        press(bearing("A", elastic=True, count=2, effects=ALL, angle="25 deg")),
        pytest.param(
            press(
                bearing("A", "frame", effects=LAGGING_LONG), bearing("B", "rod", elastic=True, effects=ALL), drive=MOTOR
            ),
            marks=pytest.mark.long,
        ),
    ],
    ids=["constant speed, contact angle", "motor, outer ring on the crank, slip that changes"],
)
def test_powers_of_all_forces_are_the_change_of_the_kinetic_energy(text: str) -> None:
    """Balls that roll over waves and edges turn the rings; without that power the balance misses by 2e-4."""
    derived = Derived(with_bearings(text), further=POWERS)
    machine, rng = Multibody(derived.scene, derived.points()), np.random.default_rng(3)
    for _ in range(3):
        assert power_imbalance(derived, machine, *drawn(rng, derived, machine)) < 1e-10


@pytest.mark.long
def test_a_heavy_ring_in_a_light_linkage_feels_effects_as_one_coupled_one_way_does() -> None:
    """The same state, with effects and without: what they change of the rings' accelerations."""
    one_way = (SCENES / "punching_press.toml").read_text(encoding="utf-8").partition("[bearing]")
    common = bearing("A", elastic=True, effects=ALL).replace("bearings.at_A", "bearing")
    single = common.replace('coupling = "two-way"', "share = 1.0") + '[bearing.inner_ring]\nmass = "50 kg"\n'
    states = np.random.default_rng(8).uniform(-1, 1, (4, 8)) * np.repeat([3e-5, 0.1], 4)
    changed = []
    for text in (common, single):
        derived = [
            Derived(scene_from_text(one_way[0] + own + RUN, "press"))
            for own in (text, text.replace(EFFECTS.replace("[bearing.", "[bearing."), "").replace(SPALLS, ""))
        ]
        for one in derived:
            light = {f"mechanism.bodies.{body}.mass": 1e-9 for body in ("rod", "slider")}
            light |= {"mechanism.bodies.rod.inertia": 1e-12, "mechanism.bodies.crank.mass": 50.0}
            one.change({name: value for name, value in light.items() if name in one.values})
        rows = []
        for t, x in zip((0.011, 0.03, 0.07, 0.15), states, strict=True):
            rows.append([one.rhs(t, x, one.gates() | one.spall_gates(t))[4:] for one in derived])
        changed.append(np.array([wavy - plain for wavy, plain in rows]))
    assert np.max(np.abs(changed[1])) > 10.0
    assert changed[0] == pytest.approx(changed[1], rel=1e-6, abs=1e-6 * np.max(np.abs(changed[1])))


FLAT = 'table = { time = ["0 s", "6 s"], speed = ["500 rpm", "500 rpm"] }\n'
ONE_WAY = bearing("A", elastic=True, effects=ALL, angle="25 deg").replace('coupling = "two-way"', "share = 0.5")


@pytest.mark.long
def test_a_table_of_one_speed_gives_the_forces_of_that_speed(tmp_path: Path) -> None:
    """Terms by time there, by the angle between the rings here; each ball's deflection and damping agree."""
    even = press(f'{ONE_WAY}[bearings.at_A.inner_ring]\nmass = "0.4 kg"\n')
    steady, table = (
        virtual_model(text, tmp_path / name) for name, text in (("even", even), ("flat", even.replace(SPEED, FLAT)))
    )
    rng = np.random.default_rng(7)
    names = ["at_A.ball.deflection", "at_A.ball.damping_force"]
    for t in rng.uniform(0.0, 0.2, 8).tolist():
        x = np.concatenate([rng.uniform(-3e-5, 3e-5, 4), rng.uniform(-0.1, 0.1, 4)])
        one, other = steady.evaluate(t, x, names), table.evaluate(t, x, names)
        for name in names:
            assert other[name] == pytest.approx(one[name], rel=1e-9, abs=1e-9 * np.max(np.abs(one[name])))


@pytest.mark.long
def test_a_slip_that_changes_is_the_same_by_a_speed_and_by_a_table_of_it(tmp_path: Path) -> None:
    """At constant speed and by a table of one speed: two derivations, spalls met at the same times."""
    effects = LAGGING + SPALL
    even = ONE_WAY.replace(ALL.replace("[bearing.", "[bearings.at_A."), effects.replace("[bearing.", "[bearings.at_A."))
    even = press(f'{even}[bearings.at_A.inner_ring]\nmass = "0.4 kg"\n')
    assert "excess_slip" not in even
    known, state = (built(text, tmp_path / name) for name, text in (("a", even), ("b", even.replace(SPEED, FLAT))))
    way = {"method": "stepper-dop853", "kinks": "located", "rtol": 1e-11}
    one, other = (m.simulate(duration=0.12, transient=0, samples_per_cycle=50, **way) for m in (known, state))
    for name in known.states:
        assert other[name] == pytest.approx(one[name], abs=1e-8 * np.max(np.abs(one[name])))
    for at in (0.02, 0.05, 0.1):
        rest, there = state.static_equilibrium(t=at), known.static_equilibrium(t=at)
        assert rest.ball_force == pytest.approx(there.ball_force, rel=1e-9, abs=1e-9 * there.peak_ball_force)
        names = [f"bearings.at_A.cage.slip.{name}" for name in ("value.1", "value.3", "time.2", "lag")]
        slopes = [r.derivative("at_A.ball.elastic_force", [*names, "time"]) for r in (rest, there)]
        assert slopes[0] == pytest.approx(slopes[1], rel=1e-6, abs=1e-6 * np.max(np.abs(slopes[1])))
    names = [f"bearings.at_A.cage.slip.{name}" for name in ("value.2", "value.3", "time.2", "lag")]
    columns = []
    for model in (known, state):
        found = model.sensitivities(names, duration=0.12, method="stepper-dop853", rtol=1e-11).x[-1]
        columns.append(found[[model.states.index(name) for name in known.states]])
    assert columns[1] == pytest.approx(columns[0], rel=1e-6, abs=1e-6 * np.max(np.abs(columns[0])))


@pytest.mark.long
def test_points_of_a_lag_that_is_a_state_are_refused(tmp_path: Path) -> None:
    """Its integral grows without end, also behind the last row: a section is on no curve."""
    model = built(press(bearing("B", "rod", effects=CHANGING_SLIP)), tmp_path / "model")
    asked = (model.steady, model.section, partial(model.bifurcation, "bearings.at_B.clearance=8 um:9 um:2"))
    for question in asked:
        with pytest.raises(RequestError, match="slip of a cage changes over time"):
            question()


#: With preload, so that every ball strikes the edges.
STRUCK = bearing("A", elastic=True, effects=SPALL, clearance="-20 um")
LINES = {
    "constant speed": press(STRUCK),
    "run-up by a table": press(STRUCK, table=True),
    "motor": press(STRUCK, drive=MOTOR),
}


def built(text: str, folder: Path) -> Model:
    return load(generate(scene_from_text(text, "press"), folder))


@pytest.mark.long
@pytest.mark.parametrize("drive", LINES)
def test_a_spall_of_the_outer_ring_is_met_at_the_ball_pass_order_of_the_momentary_speed(
    drive: str, tmp_path: Path
) -> None:
    """Amplitudes over the angle that the crank has turned: the line lies at a multiple of Z r_b/(R_b + r_b)."""
    model = built(LINES[drive], tmp_path / "model")
    times, signal = np.linspace(0.3, 2.5, 40001), "at_A.ring_force.y"
    multiple, order = 4, 8 * (1 - 7.9375 / 33.5) / 2

    def spectrum(chord: float) -> tuple[AmplitudeSpectrum, np.ndarray]:
        """Amplitudes over orders, and which of them are near the line: no multiple of the shaft is."""
        numbers = {"bearings.at_A.defects.spall.chord": chord}
        even = drive == "constant speed"
        kept = [signal] if even else [signal, "driver.angle"]
        run = model.simulate(times=times, duration=2.5, transient=0, rtol=1e-7, parameters=numbers, outputs=kept)
        angle = model.parameters["mechanism.driver.speed"] * times if even else run["driver.angle"]
        rates = np.gradient(angle, times)
        changes = {"constant speed": -1.0, "run-up by a table": 0.3, "motor": 0.01}
        assert np.ptp(rates) / np.mean(rates) > changes[drive]
        found = order_spectrum(angle, run[signal])
        return found, np.flatnonzero(np.abs(found.frequency - multiple * order) < 0.1)

    found, near = spectrum(1e-3)
    healthy, beside = spectrum(1e-7)
    k = near[np.argmax(found.amplitude[near])]
    left, top, right = np.log(found.amplitude[k - 1 : k + 2])
    line = found.frequency[k] + 0.5 * (left - right) / (left - 2 * top + right) * found.resolution
    assert found.amplitude[k] > 4 * np.max(healthy.amplitude[beside])
    assert line / multiple == pytest.approx(order, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("drive", ["constant speed", "motor"])
def test_passages_are_where_a_ball_is_at_an_edge_and_the_crank_at_that_of_a_window(drive: str, tmp_path: Path) -> None:
    """Known before the run or decided by the motion: angles at these times, and as many times as balls went by."""
    model = built(LINES[drive], tmp_path / "model")
    options = {"duration": 0.4, "transient": 0.0, "rtol": 1e-9}
    found = model.passages(**options)
    assert [edge.rpartition(".")[2] for edge in found] == ["start", "end", "begin", "middle", "end"]
    for edge, times in found.items():
        assert np.all(np.diff(times) > 0.0)
        at = {**model.parameters, **model.constants()}[edge]
        name = "drive_angle" if drive == "constant speed" else "driver.angle"
        run = model.simulate(times=np.concatenate([times, [0.4]]), outputs=["at_A.cage.in_outer", name], **options)
        angle, count = (8 * run["at_A.cage.in_outer"], 8) if "defects" in edge else (run[name], 1)
        assert np.angle(np.exp(1j * (angle[:-1] - at))) == pytest.approx(0.0, abs=1e-6)
        turns = 0.4 * 500 / 60 if drive == "constant speed" else run["driver.angle"][-1] / (2 * np.pi)
        passed = turns * (count * (1 - 7.9375 / 33.5) / 2 if count == 8 else 1)
        assert abs(len(times) - passed) <= 1.0


#: No edge has a step, which would give or take energy.
COASTING_PRESS = press(bearing("B", "rod", law=UNDAMPED, effects=EFFECTS + SPALL), drive=COASTING)


@pytest.mark.long
def test_a_machine_that_coasts_keeps_its_energy_with_every_effect(tmp_path: Path) -> None:
    """Weight, kinetic energy and contacts by the second implementation along a run."""
    model = built(COASTING_PRESS, tmp_path / "model")
    idle = {f"mechanism.forces.punch.force.{axis}": 0.0 for axis in "xy"}
    times = np.linspace(0.0, 0.09, 7)
    run = model.simulate(
        duration=0.09, times=times, transient=0, parameters=idle, method="stepper-dop853", rtol=1e-11, kinks="located"
    )
    derived = Derived(with_bearings(COASTING_PRESS), idle)
    machine = Multibody(derived.scene, derived.points(), idle)
    energy = np.array([machine.energy(t, x) for t, x in zip(times, run.x, strict=True)])
    total, exchanged = np.sum(energy, axis=1), np.ptp(energy[:, 0])
    assert exchanged > 0.1
    assert np.max(np.abs(total - total[0])) < 1e-7 * energy[0, 0]


@pytest.mark.long
def test_derivatives_and_members_are_right_where_the_motion_meets_the_spalls(tmp_path: Path) -> None:
    """Against differences of located runs, and single runs; a motor turns the crank, and the rod swings."""
    text = press(bearing("A", law=TANGENT, effects=EFFECTS), bearing("B", "rod", effects=LAGGING + SPALL), drive=MOTOR)
    model = built(text, tmp_path / "press")
    names = [
        "bearings.at_B.defects.spall.angle",
        "bearings.at_B.defects.spall.chord",
        "bearings.at_B.inner_waviness.9.amplitude",
        "bearings.at_A.ball_waviness.each.4.amplitude",
        "bearings.at_A.cage.slip",
        "bearings.at_B.cage.slip.value.1",
        "bearings.at_B.cage.slip.value.2",
        "bearings.at_B.cage.slip.time.2",
        "bearings.at_B.cage.slip.lag",
        "bearings.at_B.ball_angle",
    ]
    length = {"duration": 0.04, "transient": 0}
    found = model.sensitivities(names, duration=0.04, method="stepper-dop853", rtol=1e-10).x[-1]
    for name, column in zip(names, found.T, strict=True):
        value, step = model.parameters[name], 1e-9 if name.endswith(("chord", "amplitude")) else 1e-5
        ends = [
            model.simulate(
                parameters={name: value + s}, method="stepper-dop853", rtol=1e-12, kinks="located", **length
            ).x[-1]
            for s in (step, -step)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.max(np.abs(slope)) > 0.0
        assert column == pytest.approx(slope, rel=1e-3, abs=3e-4 * np.max(np.abs(slope)))
    depths = {"bearings.at_B.outer_waviness.7.amplitude": [1e-6, 3e-6]}
    many = model.simulate_many(depths, ["max:at_B.inner.y"], rtol=1e-9, **length)
    alone = model.reduce(rtol=1e-9, **length)["at_B.inner.y"].maximum
    assert many["max:at_B.inner.y"][1] == pytest.approx(alone, rel=1e-9, abs=0.0)


SHAFT = ("[shaft]\n", '[shaft]\nring = "outer"\n')
#: Every ball pressed, rings held in the middle.
HELD = (
    ('clearance = "0 um"  ', 'clearance = "-200 um"  '),
    ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]'),
    ("[bearing.inner_ring]", f"{ALL}[bearing.inner_ring]"),
)


@pytest.mark.long
@pytest.mark.parametrize("outer", [False, pytest.param(True, marks=pytest.mark.long)])
def test_an_outer_ring_that_turns_carries_its_waves_and_spalls_with_it(
    make_virtual: Callable[..., Model], outer: bool
) -> None:
    """Deflections while the rings are held, over the second implementation's angles; the lines follow from them."""
    model = make_virtual("varying_compliance", *HELD, *((SHAFT,) if outer else ()))
    values, (record,) = model.parameters, scene_bearings(outer)
    ball, pitch, speed = (values[k] for k in ("bearing.ball_diameter", "bearing.pitch_diameter", "shaft.speed"))
    kept, rolling = 1 - values["bearing.cage.slip"], (pitch - ball) / (2 * pitch)
    cage = kept * (1 - rolling if outer else rolling) * speed
    felt = []
    for t in np.linspace(0.0, 1.3, 29):
        rings = (speed * t, 0.0) if outer else (0.0, speed * t)
        angles = cage * t + values["bearing.ball_angle"] + 2 * math.pi * np.arange(8) / 8
        spin = (1 + pitch / ball) * (cage * t - rings[0])
        expected = [
            1e-4 - taken(record, lambda q: values[q.path], j + 1, a - rings[0], a - rings[1], spin).real
            for j, a in enumerate(angles)
        ]
        found = model.evaluate(float(t), np.zeros(4), ["ball.deflection"])["ball.deflection"]
        assert found == pytest.approx(np.array(expected), abs=1e-12)
        felt.append(expected)
    assert np.ptp(felt) > 5e-6


@cache
def scene_bearings(outer: bool) -> tuple:  # type: ignore[type-arg]
    text = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")
    for old, new in (*HELD, *((SHAFT,) if outer else ())):
        assert old in text
        text = text.replace(old, new)
    return scene_from_text(text, "held").bearings


def test_what_has_no_model_is_refused(scene_text: Callable[..., str]) -> None:
    """Half a bearing, an unbalance on a ring that stands."""
    with pytest.raises(SceneError, match=r"bearing.count.*no number of bearings"):
        scene_from_text(scene_text("punching_press_two_way", ("count = 2 ", "count = 1.5 ")), "press")
    with pytest.raises(SceneError, match="acts on the inner ring, which stands"):
        scene_from_text(scene_text("rotor", SHAFT), "rotor")
