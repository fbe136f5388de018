"""Every question and command of scenes without states: the right answer, or a refusal in words before anything is
derived.

Answers are compared with a slider-crank in closed form: the torque of the drive is the derivative of the energy by the
angle of the crank, less the work of the force.
"""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from parts import DRIVER_IS_A_STATE, WITHOUT_STATES
from quick_cases import long_but
from typer.main import get_command
from typer.testing import Result

from ballpass.derive import derive, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, QuantityFunction, RequestError, SignalClass, Signals, load, make_data_set
from ballpass.runtime.app.cli import app
from ballpass.runtime.report.text import to_text

SPEED, MASS, FORCE = "mechanism.driver.speed", "mechanism.bodies.slider.mass", "mechanism.forces.work.force.x"
R, LENGTH = 0.05, 0.16
BEGIN, END = np.radians(20.0), np.radians(150.0)
TURN = 2.0 * np.pi
ANGLES = np.linspace(0.0, TURN, 200_001)


def _slider(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Its place, and the derivative by the angle."""
    tilt = np.arcsin(-R * np.sin(angle) / LENGTH)
    turned = -R * np.cos(angle) / (LENGTH * np.cos(tilt))
    place = R * np.cos(angle) + LENGTH * np.cos(tilt)
    return place, -R * np.sin(angle) - LENGTH * np.sin(tilt) * turned


def _energy(angle: np.ndarray, speed: float, mass: float) -> np.ndarray:
    """Kinetic and potential energy of all bodies."""
    tilt = np.arcsin(-R * np.sin(angle) / LENGTH)
    turned = -R * np.cos(angle) / (LENGTH * np.cos(tilt))
    dx = -R * np.sin(angle) - 0.06 * np.sin(tilt) * turned
    dy = R * np.cos(angle) + 0.06 * np.cos(tilt) * turned
    inertia = 300e-6 + 0.4 * 0.02**2 + 0.6 * (dx**2 + dy**2) + 1500e-6 * turned**2 + mass * _slider(angle)[1] ** 2
    height = 0.4 * 0.02 * np.sin(angle) + 0.6 * (R * np.sin(angle) + 0.06 * np.sin(tilt))
    return np.asarray(0.5 * inertia * speed**2 + 9.81 * height)


def drive_torque(angle: np.ndarray, speed: float = 60.0, mass: float = 1.2, force: float = 900.0) -> np.ndarray:
    """Derivative of the energy by the angle, less the work of the force."""
    near, far = (_energy(angle + n * 1e-3, speed, mass) - _energy(angle - n * 1e-3, speed, mass) for n in (1, 2))
    within = (angle % TURN > BEGIN) & (angle % TURN < END)
    return np.asarray((8.0 * near - far) / 12e-3 - np.where(within, force * _slider(angle)[1], 0.0))


def peak(speed: float = 60.0, mass: float = 1.2) -> float:
    return float(np.max(drive_torque(ANGLES, speed, mass)))


@pytest.fixture(scope="module")
def still(tmp_path_factory: pytest.TempPathFactory) -> Model:
    scene = scene_from_text(WITHOUT_STATES["slider_crank"], "still")
    return load(generate(scene, tmp_path_factory.mktemp("still") / "still"))


# numbers


def test_samples_and_quantities_are_those_of_the_closed_form(still: Model) -> None:
    run = still.simulate(cycles=1, transient=0, samples_per_cycle=499)
    np.testing.assert_allclose(run["drive_torque"], drive_torque(60.0 * run.t), atol=1e-6)
    names = ["max:drive_torque", "min:drive_torque", "mean:drive_torque", "rms:drive_torque", "drive_work"]
    names += ["amplitude:drive_torque@2x", "value:drive_torque@90deg", "peak_time:drive_torque"]
    for method in (None, "stepper", "cvodes", run.statistics.method):
        found = {name: one.value for name, one in still.quantities(names, cycles=1, transient=0, method=method).items()}
    torque = drive_torque(ANGLES)
    assert found["max:drive_torque"] == pytest.approx(peak(), rel=1e-7)
    assert found["min:drive_torque"] == pytest.approx(np.min(torque), rel=1e-7)
    assert found["peak_time:drive_torque"] == pytest.approx(ANGLES[np.argmax(torque)] / 60.0, rel=1e-4)
    # gravity and inertia give back what they take
    ends = _slider(np.array([BEGIN, END]))[0]
    assert found["drive_work"] == pytest.approx(-900.0 * (ends[1] - ends[0]), rel=1e-9)
    assert found["mean:drive_torque"] == pytest.approx(found["drive_work"] / (2.0 * np.pi), rel=1e-9)
    assert found["rms:drive_torque"] == pytest.approx(np.sqrt(np.mean(torque[:-1] ** 2)), rel=1e-4)
    line = 2.0 * np.mean(torque[:-1] * np.exp(-2j * ANGLES[:-1]))
    assert found["amplitude:drive_torque@2x"] == pytest.approx(abs(line), rel=1e-4)
    assert found["value:drive_torque@90deg"] == pytest.approx(drive_torque(np.array([0.5 * np.pi]))[0], rel=1e-8)


def test_members_are_those_of_the_closed_form(still: Model) -> None:
    """`simulate_many` needed at least one array to concatenate."""
    speeds = [20.0, 60.0, 110.0]
    many = still.simulate_many({SPEED: speeds}, ["max:drive_torque", "drive_work"], uncertainty=True, kinks="located")
    assert many.failures == ()
    assert many["max:drive_torque"] == pytest.approx([peak(speed) for speed in speeds], rel=1e-7)
    assert np.ptp(many["drive_work"]) < 1e-9
    drawn = still.sobol([f"{SPEED}=20 rad/s:110 rad/s", f"{MASS}=1 kg:2 kg"], "max:drive_torque", samples=16)
    some = slice(0, 6)
    expected = [peak(speed, mass) for speed, mass in drawn.base[some]]
    assert drawn.values[some, 0] == pytest.approx(expected, rel=1e-7)
    screened = still.morris([f"{MASS}=1 kg:2 kg"], "value:drive_torque@90deg", base=4).quantities[0].effects[0]
    here = np.array([0.5 * np.pi])
    whole = drive_torque(here, mass=2.0) - drive_torque(here, mass=1.0)  # linear: the same everywhere
    assert screened.mean == pytest.approx(whole[0], rel=1e-6)
    assert screened.deviation == pytest.approx(0.0, abs=1e-6)


def test_what_does_not_vary_has_no_shares(still: Model) -> None:
    """Shares of the variance of rounding had numbers."""
    found = still.sobol(f"{MASS}=1 kg:2 kg", "drive_work", samples=16)
    assert found.quantities[0].shares == ()
    assert "drive_work is the same in all members" in to_text(found.report())


def test_derivatives_and_optima_are_those_of_the_closed_form(still: Model) -> None:
    report = still.sensitivity("max:drive_torque", [SPEED, MASS])
    assert [pair.check.verdict.value for pair in report.pairs] == ["verified", "verified"]
    steps = {SPEED: (60.0 + 0.01, 1.2, 60.0 - 0.01, 1.2, 0.02), MASS: (60.0, 1.201, 60.0, 1.199, 0.002)}
    expected = {}
    for pair in report.pairs:
        high, m_high, low, m_low, width = steps[pair.parameter]
        expected[pair.parameter] = (peak(high, m_high) - peak(low, m_low)) / width
        assert pair.derivative == pytest.approx(expected[pair.parameter], rel=1e-5)
    assert "nothing is integrated" in to_text(report.report())
    function = QuantityFunction(still, "max:drive_torque", [SPEED])
    assert function([60.0]) == pytest.approx(peak(), rel=1e-7)
    assert function.jacobian([60.0])[0] == pytest.approx(expected[SPEED], rel=1e-5)
    # a work that takes up as much of the inertia's torque as it can
    found = still.optimize("rms:drive_torque", f"{FORCE}=-2 kN:2 kN", parameters={SPEED: 120.0}, starts=1)
    inertia = drive_torque(ANGLES[:-1], speed=120.0, force=0.0)
    work = inertia - drive_torque(ANGLES[:-1], speed=120.0, force=1.0)
    least = float(np.mean(inertia * work) / np.mean(work**2))
    assert found.x[0] == pytest.approx(least, rel=1e-3)
    assert found.value == pytest.approx(np.sqrt(np.mean((inertia - least * work) ** 2)), rel=1e-5)
    angle = still.checked_jacobian("drive_torque", "crank_angle", t=0.01)
    by_angle = (drive_torque(np.array([0.601])) - drive_torque(np.array([0.599]))) / 0.002
    assert angle.value.item() == pytest.approx(by_angle[0], rel=1e-5)


def test_a_fit_of_exact_data_says_that_there_is_no_noise(still: Model) -> None:
    """It divided by zero."""
    angles = np.arange(400) * (2.0 * np.pi / 400) + 0.003
    for loss, profile in (("linear", False), ("huber", True)):
        run = still.simulate(times=angles / 60.0, parameters={MASS: 1.47}, transient=0)
        found = still.fit(
            {"time": run.t, "drive_torque": run["drive_torque"]}, f"{MASS}=1 kg:2 kg", loss=loss, profile=profile
        )
        (number,), report = found.numbers, found.report()
        assert number.value == pytest.approx(1.47, rel=1e-12)
        assert number.deviation < 1e-13
        assert report.fault == ""
        assert list(report.warnings) == []
        assert found.signals[0].exact
        text = to_text(report)
        assert "no noise" in text
        assert "none, but for rounding" in text


def test_a_signal_that_the_model_does_not_explain_is_a_fault(still: Model) -> None:
    times = np.arange(400) / 4000.0
    alien = 5.0 * np.random.default_rng(3).standard_normal(400)
    for more in ({}, {"gain": True, "offset": True}):
        found = still.fit({"time": times, "drive_torque": alien}, f"{MASS}=1 kg:2 kg", **more).report()
        assert "explains nothing of drive_torque" in found.fault
        assert any("as large as the signal's own deviation" in words for words in found.warnings)
    noisy = drive_torque(60.0 * times) + alien
    fine = still.fit({"time": times, "drive_torque": noisy}, f"{MASS}=1 kg:2 kg")
    assert fine.report().fault == ""
    (number,) = fine.numbers
    assert abs(number.value - 1.2) < 4.0 * number.deviation


def test_data_sets_and_spectra_are_those_of_the_closed_form(still: Model, tmp_path: Path) -> None:
    import xarray

    signals = Signals(outputs=("drive_torque",), sample_rate=2e3, duration=0.1, transient=0.05)
    made = make_data_set(
        tmp_path / "a.nc", [SignalClass(label="a", model=still, members=2, parameters={})], signals, seed=1
    )
    assert made.failures == ()
    with xarray.open_dataset(tmp_path / "a.nc") as data:
        expected = drive_torque(60.0 * data["time"].values)
        np.testing.assert_allclose(data["drive_torque"].values[0], expected, rtol=1e-4, atol=1e-3)
    # a whole number of turns has no leakage
    found = still.spectrum("drive_torque", cycles=11, transient=1, window="flattop")
    line = 2.0 * np.mean(drive_torque(ANGLES[:-1]) * np.exp(-1j * ANGLES[:-1]))
    nearest = np.argmin(np.abs(found.position - 60.0 / TURN))
    assert found.height[nearest] == pytest.approx(abs(line), rel=2e-3)


# every command


def _commands() -> set[str]:
    return set(get_command(app).commands)  # type: ignore[attr-defined]


#: Commands that take no scene, or whose answer of any scene has nothing to do with states.
NO_SCENE = {"new", "bearings", "schema", "derive", "equations", "dataset", "mcp", "skill"}

VARY = f"{SPEED}=50rad/s:80rad/s"
ANSWERED = {
    "run": "--of=max:drive_torque --of=drive_work --method=stepper --no-figures",
    "sweep": f"--vary={VARY}:3 --no-figures",
    "explain": "",
    "animate": "",
    "stream": "--sample-rate=1kHz --out=s.nc",
    "jacobian": "--of=drive_torque --wrt=mechanism.driver.speed",
    "fit": f"data.csv --vary={MASS}=1kg:2kg",
    "morris": f"--vary={VARY} --of=max:drive_torque --base=4",
    "optimize": f"--minimize=max:drive_torque --vary={VARY} --starts=1",
    "sensitivity": f"--of=max:drive_torque --wrt={SPEED}",
    "sobol": f"--vary={VARY} --of=max:drive_torque --samples=16",
    "spectrum": "--of=reaction.A.x --no-figures",
    "export": "--c",
    "explore": "",
}
REFUSED = {
    "bifurcation": (f"--vary={VARY}:3", "this scene has no bearing"),
    "life": ("", "this scene has no bearing"),
    "linearize": ("", "this scene has no states"),
    "section": ("", "this scene has no bearing"),
    "select": ("", "this scene has no bearing"),
    "steady": ("", "this scene has no bearing"),
    "trade": ("", "this scene has no states"),
    "jacobian": ("--of=drive_torque --wrt=states", "this scene has no states"),
    "run --error": ("1%", "this scene has no states"),
    "run --turns": ("settle", "this scene has no states"),
    "run --initial": ("equilibrium", "this scene has no bearing"),
}


def test_every_command_is_here() -> None:
    refused = {command for command in REFUSED if " " not in command}
    missing = _commands() - NO_SCENE - set(ANSWERED) - refused
    assert not missing, f"tests/conformance/test_scenes_without_states.py has no line for {', '.join(sorted(missing))}"


@pytest.fixture(scope="module")
def scenes(site: Path) -> Path:
    for name, text in (WITHOUT_STATES | DRIVER_IS_A_STATE).items():
        (site / f"{name}.toml").write_text(text, encoding="utf-8")
    times = np.arange(300) / 3000.0
    rows = [f"{t},{y}" for t, y in zip(times, drive_torque(60.0 * times), strict=True)]
    (site / "data.csv").write_text("\n".join(["time [s],drive_torque [N*m]", *rows]), encoding="utf-8")
    return site


def _asked(ballpass: Callable[..., Result], command: str, scene: str, options: str) -> Result:
    name, *flags = command.split()
    return ballpass(name, f"{scene}.toml", *flags, *options.split())


def _said(done: Result, code: int) -> str:
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    words = " ".join(done.output.split())
    assert done.exit_code == code, words
    assert "'none'" not in words
    return words


@pytest.mark.parametrize(
    "command", long_but(ANSWERED, "run", "sweep", "sobol", "optimize", "fit", "spectrum", "explain")
)
def test_a_command_answers(ballpass: Callable[..., Result], scenes: Path, command: str) -> None:
    assert "error" not in _said(_asked(ballpass, command, "slider_crank", ANSWERED[command]), 0)


@pytest.mark.parametrize("command", REFUSED)
def test_a_command_refuses_in_words_before_anything_is_derived(
    ballpass: Callable[..., Result], scenes: Path, command: str
) -> None:
    """`linearize` advised to write the folder again; others were refused once C was compiled."""
    options, words = REFUSED[command]
    said = _said(_asked(ballpass, command, "four_bar", options), 2)
    assert words in said
    assert "ballpass run" in said or "Give parameters" in said  # what to do instead
    assert not (scenes / "generated" / "four_bar").exists()


@pytest.mark.parametrize("scene", long_but(DRIVER_IS_A_STATE, "torque"))
def test_a_scene_without_bearings_whose_driver_is_a_state_answers_what_has_a_meaning(
    ballpass: Callable[..., Result], scenes: Path, scene: str
) -> None:
    """`jacobian` was refused for want of a bearing, with the advice to write the folder again."""
    for command in ("life", "linearize", "section", "steady"):
        assert "this scene has no bearing" in _said(ballpass(command, f"{scene}.toml"), 2)
    said = _said(
        ballpass("jacobian", f"{scene}.toml", "--of=reaction.A.x", f"--wrt={MASS}", "--wrt=states", "--json"), 0
    )
    assert "verified" in said


@pytest.mark.parametrize("scene", [*WITHOUT_STATES, *DRIVER_IS_A_STATE])
def test_a_scene_says_before_it_is_derived_whether_it_has_states(scene: str) -> None:
    read = scene_from_text((WITHOUT_STATES | DRIVER_IS_A_STATE)[scene], scene)
    assert read.integrated == bool(derive(read).states) == (scene in DRIVER_IS_A_STATE)


def test_a_wrong_method_is_refused_and_every_other_taken(still: Model) -> None:
    """Any word was taken for a method, as none runs."""
    with pytest.raises(RequestError, match="There is no method 'foo'"):
        still.simulate(method="foo")
    for method in ("auto", "stepper-dp54", "cvodes"):
        assert still.simulate(method=method, kinks="located", cycles=2).statistics.steps == 0


@pytest.mark.filterwarnings("default::ballpass.runtime.NoCompilerWarning")
@pytest.mark.parametrize("command", long_but(("run", "sweep", "sensitivity", "optimize", "sobol"), "sweep"))
def test_without_a_compiler_it_answers_too(
    ballpass: Callable[..., Result], scenes: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """Nothing is integrated, so that no stepper is needed."""
    for module in ("compilers", "compile", "loaded_model"):
        monkeypatch.setattr(f"ballpass.runtime.native.{module}.find_compiler", lambda command=None: None)
    _said(_asked(ballpass, command, "slider_crank", ANSWERED[command]), 0)


def test_the_exported_program_has_the_torque_of_the_closed_form(
    ballpass: Callable[..., Result], scenes: Path, tmp_path: Path
) -> None:
    """It was refused: the driver's angle is a state there."""
    _said(ballpass("export", "slider_crank.toml", "--c", f"--out={tmp_path}"), 0)
    subprocess.run(["make", "-s", "-C", tmp_path, "run"], check=True, capture_output=True)
    rows = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True)
    np.testing.assert_allclose(rows["driverangle"], 60.0 * rows["t"], rtol=1e-12)
    edges = np.min(np.abs(rows["driverangle"][:, None] % TURN - np.array([BEGIN, END])), axis=1) > 1e-6
    np.testing.assert_allclose(rows["drive_torque"][edges], drive_torque(60.0 * rows["t"][edges]), atol=1e-8)


@pytest.mark.long
def test_the_fmu_has_the_speed_as_an_input(ballpass: Callable[..., Result], scenes: Path, tmp_path: Path) -> None:
    fmu = tmp_path / "crank.fmu"
    _said(ballpass("export", "slider_crank.toml", "--fmu", "--target=linux-x86_64", f"--out={fmu}"), 0)
    with zipfile.ZipFile(fmu) as archive:
        text = archive.read("modelDescription.xml").decode()
    (speed,) = (one for one in Xml.fromstring(text).iter() if one.get("name") == SPEED)
    assert speed.get("causality") == "input"
    assert float(speed.get("start", "nan")) == 60.0
