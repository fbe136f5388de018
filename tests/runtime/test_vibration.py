"""Claims about signals of bearings: spectra, envelopes, orders, statistics, and the names of their lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import signal as scipy_signal
from scripts.validation.kinematics import kinematic_frequencies

from ballpass.derive import SceneError, read_scene
from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.quantity.characteristic import characteristic_lines, frequencies_of, mean_speeds, name_of
from ballpass.runtime.questions.spectrum import spectrum
from ballpass.runtime.vibration.diagnosis import diagnosis, envelope, order_spectrum, spectrogram
from ballpass.runtime.vibration.spectrum import amplitude_spectrum, power_spectrum

TURN = 2.0 * np.pi
RATE = 8192.0
T = np.arange(16384) / RATE
NOISE = np.random.default_rng(7).standard_normal(T.size)


@pytest.mark.parametrize("window", ["boxcar", "hann", "flattop", "blackmanharris"])
def test_a_sine_has_its_amplitude_and_its_power_in_every_scaling(window: str) -> None:
    """On a line: a as amplitude, a^2/2 as power; the integral of the density is a^2/2 too."""
    sine = 3.0 * np.sin(TURN * 512.0 * T + 0.3) + 5.0
    amplitude = amplitude_spectrum(T, sine, window=window)
    assert amplitude.amplitude[1024] == pytest.approx(3.0, rel=1e-12)
    power = power_spectrum(T, sine, window=window, scaling="spectrum")
    assert power.frequency[1024] == 512.0
    assert power.power[1024] == pytest.approx(4.5, rel=1e-12)
    density = power_spectrum(T, sine, window=window)
    assert np.sum(density.power) * density.resolution == pytest.approx(4.5, rel=1e-12)


def test_power_keeps_parsevals_theorem_and_agrees_with_scipy() -> None:
    density = power_spectrum(T, NOISE, window="boxcar")
    assert np.sum(density.power) * density.resolution == pytest.approx(np.var(NOISE), rel=1e-12, abs=0.0)
    found = power_spectrum(T, NOISE, segment=0.125)
    frequency, expected = scipy_signal.welch(NOISE, RATE, window="hann", nperseg=1024)
    assert np.array_equal(found.frequency, frequency)
    assert found.power == pytest.approx(expected, rel=1e-12, abs=0.0)


def test_the_envelope_of_a_modulated_carrier_is_its_modulation() -> None:
    """1 + 0.4 cos at 37 Hz on a carrier of 2 kHz, beside a strong line outside the band."""
    modulation = 1.0 + 0.4 * np.cos(TURN * 37.0 * T)
    found = envelope(T, modulation * np.sin(TURN * 2000.0 * T) + 9.0 * np.sin(TURN * 60.0 * T), (1500.0, 2500.0))
    inner = slice(800, -800)
    assert found[inner] == pytest.approx(modulation[inner], abs=2e-3)
    lines = amplitude_spectrum(T[inner], found[inner], cycle_length=1.0 / 37.0)
    assert lines.frequency[np.argmax(lines.amplitude)] == pytest.approx(37.0)
    assert np.max(lines.amplitude) == pytest.approx(0.4, rel=2e-3)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_orders_of_a_run_up_are_sharp_where_its_frequencies_are_smeared(sense: float) -> None:
    """A chirp of order 3.25 while the shaft goes from 10 to 40 turns a second."""
    angle = TURN * (10.0 * T + 7.5 * T**2)
    chirp = 2.0 * np.cos(3.25 * angle)
    found = order_spectrum(sense * angle, chirp, window="flattop")
    top = int(np.argmax(found.amplitude))
    assert found.frequency[top] == pytest.approx(3.25, abs=found.resolution)
    assert found.amplitude[top] == pytest.approx(2.0, rel=2e-3)
    assert np.max(amplitude_spectrum(T, chirp, window="flattop").amplitude) < 0.7
    map_ = spectrogram(T, chirp, segment=0.125)
    ridge = map_.frequency[np.argmax(map_.amplitude, axis=0)]
    assert ridge == pytest.approx(3.25 * (10.0 + 15.0 * map_.time), abs=8.0)


def test_a_spectrogram_reads_the_amplitude_of_a_sine() -> None:
    found = spectrogram(T, 3.0 * np.sin(TURN * 512.0 * T) + 1.0, segment=0.125)
    assert found.amplitude[64] == pytest.approx(np.full(found.time.size, 3.0), rel=1e-3)
    assert found.time[0] >= 0.0625 - 2.0 / RATE
    assert found.time[-1] <= T[-1] - 0.0625 + 2.0 / RATE


def test_statistics_of_a_sine_of_noise_and_of_pulses() -> None:
    sine = diagnosis(4.0 * np.sin(TURN * 512.0 * T) + 1.0)
    assert (sine.rms, sine.peak, sine.crest_factor) == pytest.approx((8**0.5, 4.0, 2**0.5), rel=1e-12)
    assert (sine.kurtosis, sine.skewness) == pytest.approx((1.5, 0.0), abs=1e-9)
    assert diagnosis(NOISE).kurtosis == pytest.approx(3.0, abs=0.1)
    pulses = np.zeros(1000)
    pulses[::100] = 1.0  # a variable of Bernoulli with p = 0.01
    found = diagnosis(pulses)
    assert found.kurtosis == pytest.approx((1 - 3 * 0.01 * 0.99) / (0.01 * 0.99), rel=1e-9)
    assert found.skewness == pytest.approx(0.98 / (0.01 * 0.99) ** 0.5, rel=1e-9)


@pytest.mark.parametrize(
    "name", ["rotor", "punching_press", pytest.param("punching_press_two_way", marks=pytest.mark.long)]
)
def test_characteristic_frequencies_of_a_rolling_cage_are_the_kinematic_ones(
    make_model: Callable[..., Model], name: str
) -> None:
    model = make_model(name)
    values = model.numbers().values
    bearing = model.manifest.bearings[0]
    speed, ball, pitch = (
        values[f"{p}"] for p in (bearing.ring_speed, "bearing.ball_diameter", "bearing.pitch_diameter")
    )
    expected = kinematic_frequencies(bearing.balls, ball, pitch, speed)
    found = frequencies_of(bearing, values)
    for what in ("shaft", "cage", "ball_pass_outer", "ball_pass_inner", "ball_spin"):
        assert getattr(found, what) == pytest.approx(getattr(expected, what), rel=1e-12)


def test_a_cage_that_slips_moves_its_lines(make_model: Callable[..., Model]) -> None:
    """Speed of cage times (1 - s): BPFO, BSF and FTF in proportion, BPFI as far up as BPFO goes down."""
    model = make_model("rotor")
    values, bearing = dict(model.numbers().values), model.manifest.bearings[0]
    rolling = frequencies_of(bearing, values)
    values["bearing.cage_speed"] *= 0.98
    values["bearing.inner_pass_speed"] = values["bearing.cage_speed"] - values["shaft.speed"]
    slipping = frequencies_of(bearing, values)
    for what in ("cage", "ball_pass_outer", "ball_spin"):
        assert getattr(slipping, what) == pytest.approx(0.98 * getattr(rolling, what), rel=1e-12)
    assert slipping.ball_pass_inner + slipping.ball_pass_outer == pytest.approx(8 * 50.0, rel=1e-12)


def test_lines_of_a_cage_whose_slip_changes_are_those_of_its_mean_over_the_run(
    make_virtual: Callable[..., Model],
) -> None:
    """They were those of the last slip, which a run need not reach: of none, then a fifth after its end."""
    slip = '[bearing.cage]\nslip = { time = ["0 s", "0.03 s"], value = [0.0, 0.2] }\n\n[bearing.initial]'
    model = make_virtual("rotor", ("[bearing.initial]", slip))
    rolling, bearing = 50.0 * model.constants()["bearing.cage_ratio"], model.manifest.bearings[0]
    for begin, end, mean in ((0.0, 0.02, 0.0), (0.01, 0.04, 0.2 / 3.0), (0.05, 0.1, 0.2)):
        run = model.simulate(times=np.array([begin, 0.5 * (begin + end), end]), duration=end, transient=0, outputs=[])
        values = mean_speeds(run)
        found = frequencies_of(bearing, values)
        assert found.cage == pytest.approx(rolling * (1.0 - mean), rel=1e-9)
        assert found.ball_pass_outer == pytest.approx(8 * rolling * (1.0 - mean), rel=1e-9)
        assert found.ball_pass_inner == pytest.approx(8 * (50.0 - rolling * (1.0 - mean)), rel=1e-9)
    solution = model.simulate(duration=0.02, transient=0)
    assert summarize(model, solution)["frequencies"]["cage"] == pytest.approx(rolling, rel=1e-9)


def test_lines_are_named_by_what_turns(make_model: Callable[..., Model]) -> None:
    model = make_model("rotor")
    values = model.numbers().values
    lines = characteristic_lines(model.manifest, values)
    at = {line.name: line.frequency for line in lines}
    assert name_of(3 * at["BPFO"], lines, 0.2) == "3 BPFO"
    assert name_of(at["BPFI"] - 50.0, lines, 0.2) == "BPFI - shaft"
    assert name_of(2 * at["2 BSF"] + 2 * at["FTF"], lines, 0.1) == "2 x 2 BSF + 2 FTF"
    assert name_of(100.0, lines, 0.2) == "2 shaft"
    assert name_of(33.3, lines, 0.2) == ""
    orders = {line.name: line.frequency for line in characteristic_lines(model.manifest, values, orders=True)}
    assert orders == pytest.approx({name: frequency / 50.0 for name, frequency in at.items()})
    assert characteristic_lines(model.manifest, {**values, "shaft.speed": 0.0}) == ()
    assert replace(lines[1], bearing="left").label == "FTF left"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: power_spectrum(T, NOISE, scaling="amplitude"), "allowed: spectrum, density"),  # type: ignore[arg-type]
        (lambda: power_spectrum(T, NOISE, segment=9.0), "up to the record's length"),
        (lambda: power_spectrum(T, NOISE, window="kaiser"), "get_window knows"),
        (lambda: envelope(T, NOISE, (100.0, 5000.0)), "half the sampling"),
        (lambda: order_spectrum(np.sin(T), NOISE), "stops or turns back"),
        (lambda: order_spectrum(T, NOISE), "a turn or more"),
        (lambda: spectrogram(T, NOISE, segment=9.0), "up to the record's"),
        (lambda: diagnosis(np.ones(9)), "does not change"),
    ],
)
def test_requests_that_no_signal_can_answer_are_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(RequestError, match=message):
        call()


def test_lines_of_a_recording_are_named_by_the_bearings_of_the_scene(
    make_model: Callable[..., Model], tmp_path: Path
) -> None:
    """Two sines at the shaft's speed and at the ball pass of the 6204, 3.052239 a turn, in m/s^2 over milliseconds."""
    rotor, t = make_model("rotor"), np.arange(40_000) / 20e3
    sines = np.sin(2.0 * np.pi * 50.0 * t) + 0.3 * np.sin(2.0 * np.pi * 3.052239 * 50.0 * t)
    rows = [f"{1e3 * at};{value}" for at, value in zip(t.tolist(), sines.tolist(), strict=True)]
    (tmp_path / "probe.csv").write_text("\n".join(["# shaft.speed = 3000 rpm", "Zeit [ms];acc (m/s^2)", *rows]))
    found = rotor.spectrum(recording=tmp_path / "probe.csv", top=2)
    assert found.names == ("shaft", "BPFO")
    assert found.position[list(found.highest)] == pytest.approx([50.0, 152.6], abs=0.5)
    assert found.of == "acc"
    with pytest.raises(RequestError, match="--of"):
        rotor.spectrum(recording=tmp_path / "probe.csv", of="inner.y")
    with pytest.raises(RequestError, match="named by a scene"):
        spectrum(rotor.simulate(cycles=1), recording=tmp_path / "probe.csv")
    with pytest.raises(SceneError, match="spectrum SCENE --recording FILE"):
        read_scene(tmp_path / "probe.csv")
