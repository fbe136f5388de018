"""A crank that a torque drives, against published test problems, textbook formulas and balances of energy."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, simpson

from ballpass.derive import derive, generate, read_scene
from ballpass.derive.mechanism.evaluator import Evaluator
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.runtime import IntegrationError, Model, Solution, load
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.native.driver_library import DRIVER
from ballpass.runtime.native.method_tables import METHOD_TABLES, method_tables
from ballpass.runtime.native.reduction_rows import REDUCTION_TABLES, reduction_tables

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
ANDREWS = ROOT / "scenes/andrews.toml"
CRANK = (HERE / "slider_crank.toml").read_text()

BETA, THETA = 14222.4439199541, -10666.8329399656  # initial angular accelerations of the test set [rad/s^2]


@pytest.fixture(scope="module")
def andrews(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return load(generate(ANDREWS, tmp_path_factory.mktemp("andrews")))


def test_means_of_a_torque_that_is_given_need_no_step(andrews: Model) -> None:
    """No step is taken for it, and where the driver is was read from the first one: a crash of the interpreter."""
    found = andrews.quantities(["mean:drive_torque", "rms:drive_torque"])
    assert [one.value for one in found.values()] == pytest.approx([0.033, 0.033], rel=1e-12)


def test_andrews_squeezer_starts_with_the_published_accelerations(andrews: Model) -> None:
    """beta'' and beta'' + Theta'' of the IVP test set; at that place no other body accelerates."""
    assert andrews.evaluate(0.0)["driver.acceleration"] == pytest.approx(BETA, rel=1e-11)
    system = derive(read_scene(ANDREWS))
    numbers = {p.symbol: p.default for p in system.parameters}
    numbers |= {s.symbol: numbers[sp.Symbol(n, real=True)] for s, n in zip(system.states, system.initial, strict=True)}
    numbers[system.coordinates[0].acceleration] = BETA
    assert system.linkage is not None
    names = ("coupler", "arm", "upper_link", "lower_link")
    definitions = [d for d in system.definitions if d in system.linkage.definitions]
    found = Evaluator(definitions, [system.linkage.pose(name).acceleration for name in names])(numbers)
    assert found == pytest.approx([BETA + THETA, 0.0, 0.0, 0.0], rel=1e-11, abs=1e-8)


def test_a_driver_without_bearings_has_no_arrays_without_entries(andrews: Model, tmp_path: Path) -> None:
    """C knows none; nor does it say what a number is that is assigned twice in one expression."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc, whose warnings these are")
    warnings = [f"-Werror={name}" for name in ("array-bounds", "stringop-overflow", "sequence-point")]
    (tmp_path / METHOD_TABLES).write_text(method_tables(), encoding="utf-8")
    (tmp_path / REDUCTION_TABLES).write_text(reduction_tables(), encoding="utf-8")
    places = [f"-I{place}" for place in (andrews.folder, DRIVER, tmp_path)]
    command = ["gcc", "-std=c99", "-O2", "-fopenmp-simd", *warnings, *places, "-DBALLPASS_REDUCTIONS", "-S"]
    subprocess.run([*command, "-o", os.devnull, str(DRIVER / "stepper.c")], check=True)


def test_andrews_squeezer_comes_to_the_published_end(andrews: Model) -> None:
    """Angles of the IVP test set at 0.03 s, to the digits that are known."""
    end = andrews.simulate(rtol=1e-11)
    phi, delta, omega, epsilon = -0.53473012, 0.52440997, 0.53473012, 1.04808074
    expected = {
        "driver.angle": 15.8107712,
        "body.coupler.angle": 15.8107712 - 15.7563711,
        "body.arm.angle": 0.04082224,
        "body.upper_link.angle": phi + delta,
        "body.upper_jaw.angle": delta,
        "body.lower_link.angle": omega + epsilon,
        "body.lower_jaw.angle": epsilon,
    }
    for name, value in expected.items():
        assert float(end[name][-1]) == pytest.approx(value, abs=1e-7), name


@pytest.mark.long
def test_kinetic_energy_of_a_slider_crank_and_its_sensitivities_are_those_of_idas(tmp_path: Path) -> None:
    """G, dG/dk and dG/dc of SUNDIALS' example idasSlCrank_FSA_dns, by the project's own forward sensitivities."""
    path = tmp_path / "slider_crank.toml"
    path.write_text(CRANK)
    model = load(generate(path, tmp_path / "model"))
    names = ["mechanism.springs.link.stiffness", "mechanism.springs.link.damping"]
    slopes = model.sensitivities(names, rtol=1e-10, samples_per_cycle=2000)
    angle, speed = slopes.solution["driver.angle"], slopes.solution["driver.speed"]

    def energy(theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Crank 1 kg m^2, rod 2 kg m^2 of length 1, 1 kg at the slider; sin p = -sin(theta)/2."""
        sine, cosine = np.sin(theta) / 2.0, np.cos(theta) / 2.0
        rod = -cosine * omega / np.sqrt(1.0 - sine * sine)
        slider = -sine * omega + sine * rod
        return 0.5 * omega**2 + rod**2 + 0.5 * slider**2

    step = 1e-30j
    by_angle = np.imag(energy(angle + step, speed + 0j)) / 1e-30
    by_speed = np.imag(energy(angle + 0j, speed + step)) / 1e-30
    time = slopes.solution.t
    assert simpson(energy(angle, speed), x=time) == pytest.approx(3.3366068, abs=1e-8)
    found = [simpson(by_angle * slopes.x[:, 0, k] + by_speed * slopes.x[:, 1, k], x=time) for k in range(2)]
    assert found == pytest.approx([0.3334481, -0.3637540], abs=1e-6)


def test_what_a_torque_has_no_meaning_for_is_refused_with_reason() -> None:
    """A flywheel at constant speed, and a bearing loaded by the reaction at constant speed."""
    wheel = '[mechanism.driver.flywheel]\ninertia = "1 kg*m^2"\n'
    constant = CRANK.replace('[mechanism.driver.torque]\nlaw = "none"\n', wheel)
    with pytest.raises(SceneError, match="at constant speed a flywheel is without effect"):
        scene_from_text(constant, "crank")
    press = (ROOT / "scenes/punching_press.toml").read_text()
    driven = press.replace(
        "[mechanism.frame.points]", '[mechanism.driver.torque]\nlaw = "none"\n\n[mechanism.frame.points]'
    )
    with pytest.raises(SceneError, match="loaded one-way takes the reaction of a linkage whose driver"):
        scene_from_text(driven, "press")


MOTOR = """[mechanism.driver.torque]
law = "asynchronous"
breakdown_torque = "60 N*m"
breakdown_slip = 0.2
synchronous_speed = "520 rpm"

[mechanism.driver.flywheel]
inertia = "0.2 kg*m^2"

"""
TORQUE, WHEEL, PUNCH = (
    "mechanism.driver.torque.breakdown_torque",
    "mechanism.driver.flywheel.inertia",
    "mechanism.forces.punch.force.y",
)
CRANK_LENGTH, ROD_LENGTH, FORCE = 0.006, 0.1, 8964.8
START, END = math.radians(237.0), math.radians(267.0)


def _press(motor: str) -> str:
    """The press of the paper without its bearing, at 500 rpm or from there on."""
    text = (ROOT / "scenes/punching_press.toml").read_text()
    head = text[: text.index("[bearing]")].replace("[mechanism.frame.points]", motor + "[mechanism.frame.points]")
    outputs = '"driver.*", "drive_*", ' if motor else '"drive_angle", '
    return f'{head}\n[run]\ncycles = 2\noutputs = [{outputs}"reaction.A.*"]\n'


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Model:
    folder = tmp_path_factory.mktemp("motor")
    (folder / "motor.toml").write_text(_press(MOTOR))
    return load(generate(folder / "motor.toml", folder / "model"))


def _energy(model: Model, solution: Solution) -> np.ndarray:
    """Kinetic energy by the mass matrix, potential energy of rod and slider, work of the punch in whole windows [J]."""
    numbers = model.numbers(solution.parameters)
    mass, angle, speed = model.function("mass_matrix"), solution["driver.angle"], solution["driver.speed"]
    inertia = [float(mass([a, 0.0], [], numbers.p, numbers.c)) for a in angle.tolist()]
    weight = 9.81 * (2.55 * (_height(angle) + CRANK_LENGTH * np.sin(angle)) / 2.0 + 16.7965 * _height(angle))
    inside = np.clip(angle % (2.0 * np.pi), START, END)
    work = solution.parameters[PUNCH] * (_height(inside) - _height(START))
    work += angle // (2.0 * np.pi) * solution.parameters[PUNCH] * (_height(END) - _height(START))
    return np.asarray(0.5 * np.array(inertia) * speed**2 + weight - work)


def _height(angle: np.ndarray | float) -> np.ndarray:
    """Height of the slider over the crank's axis [m]."""
    return np.asarray(CRANK_LENGTH * np.sin(angle) - np.sqrt(ROD_LENGTH**2 - (CRANK_LENGTH * np.cos(angle)) ** 2))


def test_every_joule_of_a_press_without_drive_is_in_motion_weight_or_punch(press: Model) -> None:
    """Through two windows, both edges of each; the closed form of the slider's height is written here."""
    run = press.simulate(rtol=1e-12, samples_per_cycle=100, parameters={TORQUE: 0.0})
    energy = _energy(press, run)
    assert run["driver.angle"][-1] > 2.0 * np.pi + END
    assert np.max(np.abs(energy - energy[0])) <= 1e-9 * abs(energy[0])


def test_work_of_a_motor_is_the_integral_of_its_power(press: Model) -> None:
    """Without the punch everything is smooth, and Simpson's rule is exact enough."""
    run = press.simulate(rtol=1e-12, samples_per_cycle=1000, parameters={PUNCH: 0.0, "mechanism.driver.speed": 45.0})
    energy = _energy(press, run)
    work = simpson(run["drive_power"], x=run.t)
    assert abs(work) > 10.0
    assert energy[-1] - energy[0] == pytest.approx(work, rel=1e-9)


def test_a_heavy_flywheel_keeps_the_speed_constant(press: Model, tmp_path: Path) -> None:
    """Deviations of the speed, and of the reaction from that at constant speed, fall with one over its inertia."""
    (tmp_path / "constant.toml").write_text(_press(""))
    constant = load(generate(tmp_path / "constant.toml", tmp_path / "model"))
    speeds, forces = [], []
    for inertia in (10.0, 100.0, 1000.0):
        run = press.simulate(rtol=1e-11, samples_per_cycle=60, parameters={TORQUE: 0.0, WHEEL: inertia})
        omega = run.parameters["mechanism.driver.speed"]
        speeds.append(np.max(np.abs(run["driver.speed"] / omega - 1.0)))
        there = [constant.evaluate(a / omega, outputs=["reaction.A.x"])["reaction.A.x"] for a in run["driver.angle"]]
        forces.append(np.max(np.abs(run["reaction.A.x"] - there)))
    for errors in (speeds, forces):
        assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)
        assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.01)


@pytest.mark.long
def test_members_of_an_ensemble_end_their_steps_on_the_edges_of_windows_as_single_runs_do(press: Model) -> None:
    """Lanes would leave the jump to error control, by whichever method."""
    request = {"cycles": 1.0, "transient": 0.0, "rtol": 1e-4}
    members = press.simulate_many({WHEEL: [0.2, 0.4]}, "min:driver.speed", **request, method="stepper-dp54")
    assert members.statistics.kinks == "located"
    exact = [press.reduce(cycles=1.0, transient=0.0, rtol=1e-11, parameters={WHEEL: w}) for w in (0.2, 0.4)]
    found = [run.channels["driver.speed"].minimum for run in exact]
    assert members["min:driver.speed"] == pytest.approx(found, rel=1e-5)


EDGES = ["mechanism.forces.punch.window.start", "mechanism.forces.punch.window.end"]


@pytest.mark.parametrize("method", [pytest.param("stepper-dop853", marks=pytest.mark.long), "stepper-rodas5p"])
def test_derivatives_across_windows_of_a_driven_crank_are_those_of_differences(press: Model, method: str) -> None:
    """Through two windows.  The driver gets to an edge earlier or later, and the derivative jumps there."""
    names = [*EDGES, PUNCH, WHEEL, TORQUE, "mechanism.driver.speed", "mechanism.driver.start_angle"]
    request = {"duration": 0.22, "rtol": 1e-12, "method": method}
    found = press.sensitivities(names, **request)
    assert found.solution["driver.angle"][-1] > 2.0 * np.pi + END
    for name in names:
        value = press.parameters[name]
        step = 1e-4 * max(abs(value), 1.0)
        ends = [press.simulate(**request, parameters={name: value + k * step}).x[-1] for k in (-2, -1, 1, 2)]
        difference = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * step)
        assert found.x[-1, :, names.index(name)] == pytest.approx(difference, rel=1e-5), name


@pytest.mark.long
def test_reports_across_windows_of_a_driven_crank_are_verified(press: Model) -> None:
    """The speed has its maximum where the punch begins; the reaction jumps at both edges."""
    quantities = ["max:driver.speed", "range:driver.speed", "rms:driver.speed", "mean:reaction.A.y"]
    report = press.sensitivity(quantities, [*EDGES, PUNCH], duration=0.3, transient=0.0)
    assert {pair.check.verdict.value for pair in report.pairs} == {"verified"}
    with pytest.raises(RequestError, match=r"reaction.A.y jumps where a load.*means and integrals of all"):
        press.sensitivity("max:reaction.A.y", PUNCH)


@pytest.mark.long
def test_what_counts_on_a_constant_speed_is_refused_with_reason(andrews: Model, press: Model) -> None:
    for quantity in ("value:driver.speed@240deg", "amplitude:driver.speed@2x", "drive_work"):
        with pytest.raises(RequestError, match=r"a torque drives this scene|the driver's speed changes in this scene"):
            andrews.sensitivity(quantity, "mechanism.driver.torque.torque")
    with pytest.raises(RequestError, match=r"driver's angle is a state.*'driver.angle' instead"):
        press.jacobian("reaction.A.y", "crank_angle")


def test_a_motor_that_is_too_weak_stalls_at_its_window(press: Model) -> None:
    """It swings back and forth there, less each time, until the run ends and says what is missing.

    With a breakdown slip above one the torque falls with the speed from rest on, which damps.
    """
    slip = "mechanism.driver.torque.breakdown_slip"
    weak = {TORQUE: 2.0, slip: 2.0, "mechanism.driver.speed": 10.0, WHEEL: 0.01}
    with pytest.raises(IntegrationError, match="The driver has stalled") as stalled:
        press.simulate(duration=60.0, rtol=1e-6, parameters=weak)
    with pytest.raises(SimulationError, match="within that window of punch it lacks"):
        press.reduce(duration=60.0, rtol=1e-6, parameters=weak)
    partial = stalled.value.partial
    assert len(np.flatnonzero(np.diff(np.sign(partial["driver.speed"])))) > 10
    assert partial["driver.angle"][-1] == pytest.approx(START, abs=1e-3)
    step = 1e-30j
    slider, rod = (np.imag(part(START + step)) / 1e-30 for part in (_height, lambda a: CRANK_LENGTH * np.sin(a)))
    holding = (FORCE - 16.7965 * 9.81) * slider - 2.55 * 9.81 * (slider + rod) / 2.0
    start = 2.0 * 2.0 * 2.0 / (1.0 + 2.0**2)  # Kloss at rest
    words = re.search(r"window.start = 237 deg; within that window of punch it lacks ([\d.]+) N\*m", str(stalled.value))
    assert words is not None
    assert float(words[1]) == pytest.approx(-(holding + start), rel=1e-3)


def test_steps_end_on_the_edges_of_windows_either_way_round(press: Model) -> None:
    """Located edges: few steps to a tight tolerance, and turning backwards gives the mirrored motion back."""
    there = press.simulate(rtol=1e-11, cycles=1.0, parameters={TORQUE: 0.0})
    assert there.statistics.located == 2
    turned = there.x[-1] * [1.0, -1.0]
    back = press.simulate(rtol=1e-11, cycles=1.0, parameters={TORQUE: 0.0}, initial=turned)
    assert back.statistics.located == 2
    assert back.x[-1] == pytest.approx(there.x[0] * [1.0, -1.0], abs=1e-8)


def test_no_step_passes_over_a_narrow_window(press: Model) -> None:
    """Of a fifth of a degree, with a flywheel that lets steps become long; the work of the punch is in the speed."""
    narrow = {"mechanism.forces.punch.window.end": START + math.radians(0.2), TORQUE: 0.0, WHEEL: 100.0}
    run = press.simulate(rtol=1e-3, cycles=3.0, parameters=narrow)
    assert run.statistics.located == 6
    assert run.statistics.steps < 60


def test_engine1a_turns_as_its_energy_says(tmp_path: Path) -> None:
    """`Engine1a` of the Modelica Standard Library: kinetic and potential energy of a coasting crank-slider are kept."""
    model = load(generate(ROOT / "scripts/validation/engine1a.toml", tmp_path / "model"))
    steel = 7700.0
    web, shaft, pin = steel * 0.1 * 0.05 * 0.02, steel * np.pi * 0.025**2 * 0.1, steel * np.pi * 0.015**2 * 0.1
    rod, piston = steel * 0.2 * 0.06 * 0.02, steel * np.pi * 0.05**2 * 0.1
    about_axis = 1.0 + shaft * 0.025**2 / 2 + pin * (0.015**2 / 2 + 0.1**2)
    about_axis += 2 * web * ((0.1**2 + 0.05**2) / 12 + 0.05**2)
    about_middle = rod * (0.2**2 + 0.06**2) / 12

    def inertia_and_height(turned: float) -> tuple[float, float]:
        """Reduced inertia; potential energy over gravity.  The crank stands upright at the start."""
        swing = np.arcsin(-0.5 * np.sin(turned))
        rate = -0.5 * np.cos(turned) / np.cos(swing)
        slide = -0.1 * np.sin(turned) - 0.2 * np.sin(swing) * rate
        across = 0.1 * np.cos(turned) + 0.1 * np.cos(swing) * rate
        along = -0.1 * np.sin(turned) - 0.1 * np.sin(swing) * rate
        inertia = about_axis + about_middle * rate**2 + rod * (across**2 + along**2) + piston * slide**2
        high = 0.1 * np.cos(turned)
        pin_height = 2 * web * high / 2 + pin * high
        return inertia, pin_height + rod * (high + 0.1 * np.cos(swing)) + piston * (high + 0.2 * np.cos(swing))

    inertia, height = inertia_and_height(0.0)
    energy = 0.5 * inertia * 10.0**2 + 9.81 * height

    def slowness(turned: float) -> float:
        inertia, height = inertia_and_height(turned)
        return float(np.sqrt(inertia / (2.0 * (energy - 9.81 * height))))

    turned = float(model.simulate(rtol=1e-12)["driver.angle"][-1]) - np.pi / 2
    turns, rest = divmod(turned, 2.0 * np.pi)
    time = turns * quad(slowness, 0.0, 2.0 * np.pi, epsabs=1e-13)[0] + quad(slowness, 0.0, rest, epsabs=1e-13)[0]
    assert time == pytest.approx(5.0, abs=1e-10)


@pytest.mark.long
@pytest.mark.parametrize("name", ["andrews", "slider_crank", "engine1a", "planar_fourbar"])
def test_published_motions_are_those_of_another_method(name: str, tmp_path: Path) -> None:
    homes = {"andrews": ANDREWS, "slider_crank": ROOT / "tests/physics/slider_crank.toml"}
    model = load(generate(homes.get(name, ROOT / f"scripts/validation/{name}.toml"), tmp_path / "model"))
    time, *columns = np.loadtxt(ROOT / f"docs/validation/motions/{name}.csv", delimiter=",", skiprows=1).T
    run = model.simulate(rtol=1e-12, times=time, method="stepper-rodas5p")
    for column, channel in zip(columns, ("driver.angle", "driver.speed"), strict=True):
        assert np.abs(run[channel] - column).max() <= 6e-10 * np.abs(column).max(), channel  # ten digits are written
