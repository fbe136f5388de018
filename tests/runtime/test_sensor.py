"""Claims about the way from a bearing to a recorder: filters against SciPy, noise, converter, bands of a kurtogram."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import signal as scipy_signal

from ballpass.runtime import Model, RequestError, Sensor, SignalClass, Signals, make_data_set
from ballpass.runtime.vibration.diagnosis import amplitude_spectrum, envelope, kurtogram
from ballpass.runtime.vibration.sensor import sensor_of_text
from ballpass.runtime.vibration.spectrum import power_spectrum

RATE = 200e3
T = np.arange(40000) / RATE
#: Hits of a millisecond, at places that no period repeats.
HITS = sum(np.where(np.abs(T - at) < 5e-4, np.cos(np.pi * (T - at) / 1e-3) ** 2, 0.0) for at in (0.03, 0.071, 0.15))


def test_resonance_and_filter_agree_with_scipys_solution_of_their_equations() -> None:
    """A foot moves, the mass on it follows, the filter behind it: integrated over time, not by lines."""
    sensor = Sensor(resonance=6e3, damping=0.03, low_pass=9e3)
    w, z = 2.0 * np.pi * 6e3, 0.03
    low = scipy_signal.butter(8, 2.0 * np.pi * 9e3, analog=True, output="zpk")
    mass = scipy_signal.TransferFunction([2 * z * w, w * w], [1.0, 2 * z * w, w * w]).to_zpk()
    whole = scipy_signal.ZerosPolesGain(
        np.append(low[0], mass.zeros), np.append(low[1], mass.poles), low[2] * mass.gain
    ).to_ss()
    # hits are smooth, so that straight lines between their samples are 1e-5 off
    _, expected, _ = scipy_signal.lsim(whole, HITS, T)
    found = sensor.measured(HITS, RATE, np.random.default_rng(0))
    assert np.max(np.abs(found - expected)) < 3e-4 * np.max(np.abs(expected))
    assert np.max(np.abs(found - HITS)) > 0.05


def test_a_constant_stays_and_the_end_does_not_ring_into_the_start() -> None:
    sensor = Sensor(resonance=6e3, damping=0.01)
    ramp = 3.0 + 2.0 * T
    assert sensor.measured(ramp, RATE, np.random.default_rng(0)) == pytest.approx(ramp, abs=1e-6)


def test_noise_has_its_rms_and_its_slope() -> None:
    sensor = Sensor(noise=0.3, colour=1.0)
    found = sensor.measured(np.zeros(1 << 18), 1e4, np.random.default_rng(3))
    assert np.std(found) == pytest.approx(0.3, rel=0.05)
    density = power_spectrum(np.arange(found.size) / 1e4, found, segment=0.4096)
    slope = np.polyfit(np.log(density.frequency[10:-1]), np.log(density.power[10:-1]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.02)
    assert np.std(Sensor(noise=0.3).measured(np.zeros(99999), 1e4, np.random.default_rng(3))) == pytest.approx(
        0.3, rel=0.01
    )


def test_a_converter_has_steps_and_ends() -> None:
    """An error evenly spread within half a step has the rms step/sqrt(12)."""
    sensor = Sensor(range=1.0, bits=8)
    sine = 0.9 * np.sin(2.0 * np.pi * 37.3 * T)
    found = sensor.measured(sine, RATE, np.random.default_rng(0))
    assert np.std(found - sine) == pytest.approx(2.0**-7 / 12**0.5, rel=0.02)
    clipped = sensor.measured(3.0 * sine, RATE, np.random.default_rng(0))
    assert (clipped.min(), clipped.max()) == (-1.0, 1.0 - 2.0**-7)


def test_a_measured_transfer_function_is_read_from_a_table(tmp_path: Path) -> None:
    """Phase -360 f T is a delay of T."""
    (tmp_path / "path.csv").write_text(
        "# Hz, gain, deg\n" + "".join(f"{f}, 0.5, {-0.36 * f}\n" for f in range(0, 100_000, 100))
    )
    sensor = sensor_of_text(f"transfer={tmp_path / 'path.csv'}")
    smooth = np.exp(-(((T - 0.1) / 2e-3) ** 2))
    found = sensor.measured(smooth, RATE, np.random.default_rng(0))
    assert found[200:] == pytest.approx(0.5 * smooth[:-200], abs=1e-9)


def test_a_sensor_is_written_as_text() -> None:
    found = sensor_of_text("resonance=8 kHz, damping=2 %, low_pass=10kHz, noise=0.05, colour=1, range=50, bits=16")
    expected = Sensor(resonance=8e3, damping=0.02, low_pass=1e4, noise=0.05, colour=1.0, range=50.0, bits=16)
    assert found == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("resonance", "is no sensor"),
        ("resonance=8", "unit is missing"),
        ("mass=1", "no such number"),
        ("resonance=-1 Hz, damping=0", "resonance: -1.0.*\n.*damping: 0.0"),
        ("bits=8", "bits and a range"),
        ("bits=8.5, range=1", "whole number"),
        ("transfer=nowhere.csv", "cannot be read"),
    ],
)
def test_wrong_sensors_are_refused(text: str, words: str) -> None:
    with pytest.raises(RequestError, match=words):
        sensor_of_text(text)


def test_kurtosis_finds_the_band_in_which_hits_ring() -> None:
    """A ring at 7.3 kHz hit 107 times a second, below noise and a tone; its rate stands out of the band's envelope."""
    rate, random = 50e3, np.random.default_rng(5)
    t = np.arange(100000) / rate
    since = np.mod(t, 1.0 / 107.0)
    ring = np.exp(-900.0 * since) * np.sin(2.0 * np.pi * 7300.0 * since)
    noise = random.standard_normal(t.size)
    bands = kurtogram(t, ring + noise + 3.0 * np.sin(2.0 * np.pi * 2000.0 * t), 400.0)
    assert bands[0].low < 7300.0 < bands[0].high
    assert bands[0].kurtosis > 5.0 * abs(np.median([band.kurtosis for band in bands]))
    best = envelope(t, ring + noise, (bands[0].low, bands[0].high))
    lines = amplitude_spectrum(t, best)
    assert lines.frequency[1 + np.argmax(lines.amplitude[1:])] == pytest.approx(107.0, abs=0.5)
    alone = kurtogram(t, noise, 400.0)
    # the mean of n values of |z|^4 over a noise has a variance of about 4/n
    assert all(abs(band.kurtosis) < 6.0 * (4.0 * 1.5 / (2.0 * (band.high - band.low))) ** 0.5 for band in alone)
    assert len({band.high - band.low for band in alone}) > 8


def test_a_data_set_records_through_a_sensor(make_model: Callable[..., Model], tmp_path: Path) -> None:
    """What is stored is the signal of a run from its start on, through the same sensor."""
    xarray = pytest.importorskip("xarray")
    model = make_model("rotor")
    sensor = Sensor(resonance=1500.0, damping=0.05, low_pass=2e3)
    plain = Signals(outputs=("inner.ay",), sample_rate=5e3, duration=0.05, transient=0.05, precision="float64")
    one = [SignalClass(label="rotor", model=model, members=1, parameters={})]
    kept = {}
    for name, signals in {"plain": plain, "sensed": replace(plain, sensor=sensor)}.items():
        path = make_data_set(tmp_path / f"{name}.nc", one, signals, seed=1).path
        with xarray.open_dataset(path) as found:
            kept[name] = found["inner.ay"].values[0]
    rate = 5e3 * 4
    times = np.arange(round(0.1 * rate)) / rate
    fine = model.simulate(times=times, outputs=["inner.ay"])["inner.ay"]
    expected = sensor.measured(fine, rate, np.random.default_rng(0))[1000::4]
    inner = slice(0, 200)  # behind, the end is continued in another way
    assert kept["sensed"][inner] == pytest.approx(expected[inner], abs=1e-5 * np.ptp(fine))
    assert np.max(np.abs(kept["plain"] - kept["sensed"])) > 0.05 * np.ptp(kept["plain"])
