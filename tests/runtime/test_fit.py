"""Fits: intervals that hold and are as narrow as they can be, and what the data do not determine."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from ballpass.runtime import Model, RequestError, SimulationError
from ballpass.runtime.fit.measured import read_trial
from ballpass.runtime.fit.report import FitAnswer
from ballpass.runtime.report.text import to_text

RATIO, CLEARANCE, HOUSING = "bearing.damping.ratio", "bearing.clearance", "bearing.outer_ring.stiffness"
VARY = (f"{RATIO}=1e-6 s:1e-5 s:log", f"{CLEARANCE}=5 um:30 um", f"{HOUSING}=30 MN/m:80 MN/m")
TRUTH = {RATIO: 4.1e-6, CLEARANCE: 13.7e-6, HOUSING: 44.3e6}


def _data(
    model: Model, truth: dict[str, float], output: str, noise: float, seed: int, times: np.ndarray
) -> dict[str, np.ndarray]:
    clean = model.simulate(times=times, parameters=truth, rtol=1e-10, progress=False)[output]
    random = np.random.default_rng(seed)
    return {"time": times, output: clean + noise * np.std(clean) * random.standard_normal(len(times))}


def _bound(model: Model, truth: dict[str, float], output: str, noise: float, times: np.ndarray) -> np.ndarray:
    """Cramér-Rao deviations by differences of plain runs."""

    def run(overrides: dict[str, float]) -> np.ndarray:
        return model.simulate(times=times, parameters=overrides, rtol=1e-11, progress=False)[output]

    columns = []
    for name, value in truth.items():
        step = 1e-4 * value
        ends = [run({**truth, name: value + side * step}) for side in (-1.0, 1.0)]
        columns.append((ends[1] - ends[0]) / (2.0 * step))
    jacobian = np.array(columns).T / (noise * np.std(run(truth)))
    return np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))


def test_a_number_that_an_end_of_its_range_holds_is_warned_of(rotor: Model) -> None:
    data = _data(rotor, {}, "inner.x", 1e-3, 1, np.arange(201) / 4e3)
    within = rotor.fit(data, "load.force.x=150 N:250 N", starts=1, progress=False)
    held = rotor.fit(data, "load.force.x=150 N:190 N", starts=1, progress=False)  # it is 196 N
    assert held.numbers[0].held == "second"
    assert any("held by the second end of its range" in words for words in held.report().warnings)
    assert not any("held by" in words for words in within.report().warnings)


@pytest.mark.long
@pytest.mark.extreme
def test_intervals_hold_the_truth_as_often_as_they_say_and_are_as_narrow_as_they_can_be(press: Model) -> None:
    """100 trials of damping, clearance and housing stiffness, with noise of 1 to 10 % of the signal."""
    times = np.arange(601) / 5e3
    values = np.array(list(TRUTH.values()))
    inside, searched, narrow = np.zeros(3), 0, []
    noises = np.geomspace(0.01, 0.10, 100)
    bound = _bound(press, TRUTH, "outer.y", 1.0, times)
    for seed, noise in enumerate(noises.tolist()):
        found = press.fit(_data(press, TRUTH, "outer.y", noise, seed, times), VARY, starts=1, rtol=1e-8, progress=False)
        searched += found.converged
        inside += [one.low < value < one.high for one, value in zip(found.numbers, values.tolist(), strict=True)]
        narrow.append([one.deviation for one in found.numbers] / (noise * bound))
    assert searched >= 98  # of one start each; others are reported as not to be relied on
    assert np.all((inside >= 90) & (inside <= 99)), inside
    assert np.all(np.abs(np.mean(narrow, axis=0) - 1.0) < 0.2), np.mean(narrow, axis=0)


@pytest.mark.long
def test_a_fit_is_within_the_noise_of_the_truth_and_the_profile_agrees(press: Model) -> None:
    times = np.arange(601) / 5e3
    found = press.fit(_data(press, TRUTH, "outer.y", 0.02, 5, times), VARY, profile=True, progress=False)
    bound = _bound(press, TRUTH, "outer.y", 0.02, times)
    for one, value, deviation in zip(found.numbers, TRUTH.values(), bound.tolist(), strict=True):
        assert abs(one.value - value) < 3.0 * deviation
        assert one.deviation == pytest.approx(deviation, rel=0.2)
        assert one.value - one.low == pytest.approx(1.96 * deviation, rel=0.3)
    assert found.signals[0].white
    assert not found.undetermined


def test_a_product_is_reported_as_one_number(make_model: Callable[..., Model]) -> None:
    """An unbalance acts by mass times eccentricity alone; clearance is found beside it."""
    rotor = make_model("rotor")
    mass, eccentricity = "loads.unbalance.mass", "loads.unbalance.eccentricity"
    truth = {mass: 4e-3, eccentricity: 30e-3, CLEARANCE: 7e-6}
    data = _data(rotor, truth, "inner.y", 0.02, 1, np.arange(400) / 5e3)
    vary = [f"{mass}=1 g:20 g:log", f"{eccentricity}=5 mm:80 mm", f"{CLEARANCE}=2 um:15 um"]
    found = rotor.fit(data, vary, progress=False)
    (group,) = found.undetermined
    assert group.combination == f"{mass} · {eccentricity}"
    assert group.value == pytest.approx(1.2e-4, abs=3.0 * group.deviation * 1.2e-4)
    assert group.deviation < 0.05
    assert [np.isnan(one.value) for one in found.numbers] == [True, True, False]
    assert max(map(len, to_text(found._report()).splitlines())) <= 80
    assert abs(found.numbers[2].value - 7e-6) < 4.0 * found.numbers[2].deviation < 1e-6


@pytest.mark.long
def test_what_a_signal_does_not_depend_on_is_not_given_as_a_number(press: Model) -> None:
    """The crank's inertia acts nowhere at constant speed."""
    times = np.arange(300) / 5e3
    data = _data(press, {CLEARANCE: 13.7e-6}, "outer.y", 0.02, 1, times)
    vary = [f"{CLEARANCE}=5 um:30 um", "mechanism.bodies.crank.inertia=1 kg*mm^2:900 kg*mm^2"]
    found = press.fit(data, vary, progress=False)
    assert [one.name for one in found.numbers if np.isnan(one.value)] == ["mechanism.bodies.crank.inertia"]
    assert "other values within the bounds fit as well" in found.report().parts[1]


def test_shift_gain_and_offset_are_found_with_the_parameter(make_model: Callable[..., Model]) -> None:
    """A displacement with gain 1.5 and offset 2 um, recorded 1.3 ms late."""
    rotor = make_model("rotor")
    clean = _data(rotor, {CLEARANCE: 7e-6}, "inner.y", 0.0, 1, 0.05 + np.arange(500) / 5e3)
    noise = 0.02 * np.std(clean["inner.y"]) * np.random.default_rng(2).standard_normal(500)
    data = {"time": clean["time"] - 0.05 + 1.3e-3, "inner.y": 1.5 * (clean["inner.y"] + noise) + 2e-6}
    vary = f"{CLEARANCE}=2 um:15 um"
    found = rotor.fit(data, vary, begin=0.05, shift="-3 ms:3 ms", gain=True, offset=True, progress=False)
    for one, value in zip(found.numbers, (7e-6, -1.3e-3, 1.5, 2e-6), strict=True):
        assert abs(one.value - value) < 3.5 * one.deviation < 0.2 * abs(value), one


def test_other_values_that_fit_as_well_are_named(make_model: Callable[..., Model]) -> None:
    """Eight balls that are turned by one pitch, 45 degrees, move as before."""
    rotor = make_model("rotor")
    angle = "bearing.ball_angle"
    data = _data(rotor, {angle: np.radians(20.0)}, "inner.y", 0.02, 2, np.arange(400) / 5e3)
    found = rotor.fit(data, f"{angle}=0 deg:100 deg", starts=6, progress=False)
    values = [found.numbers[0].value, *(rival[0] for rival in found.rivals)]
    assert {round(float(np.degrees(value))) for value in values} == {20, 65}
    assert "Other values fit as well" in found.report().warnings[0]


@pytest.mark.long
def test_several_trials_with_numbers_of_their_own_from_files(make_model: Callable[..., Model], tmp_path: Path) -> None:
    """Two speeds, in a CSV file in micrometres and milliseconds, and in a NetCDF file; wrong samples in one of them."""
    import xarray

    rotor, speed, paths = make_model("rotor"), "shaft.speed", [tmp_path / "slow.csv", tmp_path / "fast.nc"]
    slow, fast = (
        _data(rotor, {CLEARANCE: 7e-6, speed: value}, "inner.y", 0.02, seed, np.arange(400) / 5e3)
        for seed, value in ((1, 250.0), (2, 350.0))
    )
    slow["inner.y"][::25] += 3e-6
    slow["inner.y"][7] = np.nan
    lines = [f"{1e3 * t:.6f},{1e6 * y:.9f}" for t, y in zip(*slow.values(), strict=True)]
    paths[0].write_text("\n".join([f"# {speed} = 250 rad/s", "time [ms],inner.y [um]", *lines]))
    set_ = xarray.Dataset({"inner.y": ("time", fast["inner.y"])}, {"time": fast["time"]}, {speed: "350 rad/s"})
    set_.to_netcdf(paths[1], engine="h5netcdf")
    robust, plain = (
        rotor.fit(paths, f"{CLEARANCE}=2 um:15 um", loss=loss, progress=False) for loss in ("huber", "linear")
    )
    (one,) = robust.numbers
    assert len(robust.signals[0].t) == 399
    assert abs(one.value - 7e-6) < 3.0 * one.deviation
    assert one.deviation < 0.8 * plain.numbers[0].deviation
    for signal in robust.signals:
        assert signal.noise == pytest.approx(0.02 * np.std(signal.model), rel=0.15)
    assert plain.signals[0].noise > 0.1 * np.std(plain.signals[0].model)


def test_accelerations_are_data_too(make_model: Callable[..., Model]) -> None:
    rotor = make_model("rotor")
    data = _data(rotor, {CLEARANCE: 7e-6}, "inner.ay", 0.05, 1, np.arange(400) / 5e3)
    found: FitAnswer = rotor.fit(data, f"{CLEARANCE}=2 um:15 um", progress=False)
    assert abs(found.numbers[0].value - 7e-6) < 3.0 * found.numbers[0].deviation < 1e-6


@pytest.mark.long
def test_a_spectrum_is_data_as_amplitudes_over_the_frequency(make_model: Callable[..., Model], tmp_path: Path) -> None:
    """Amplitudes of a discrete Fourier transform, by a second method, over whole turns; gain of the sensor unknown."""
    rotor, turns, count = make_model("rotor"), 4, 2048
    truth = {CLEARANCE: 7e-6, "loads.unbalance.mass": 4e-3}
    turn = 2.0 * np.pi / {one.name: one.default for one in rotor.manifest.parameters}["shaft.speed"]
    times = turn * (2.0 + turns * np.arange(count) / count)
    y = rotor.simulate(times=times, parameters=truth, rtol=1e-10, progress=False)["inner.y"]
    lines = 2.0 * np.abs(np.fft.rfft(y))[1:61] / count
    noise = 0.01 * np.std(lines) * np.random.default_rng(1).standard_normal(60)
    frequency = np.arange(1, 61) / (turns * turn)
    path = tmp_path / "spectrum.csv"
    rows = [f"{f / 1e3!r},{1e6 * a!r}" for f, a in zip(frequency.tolist(), (1.2 * lines + noise).tolist(), strict=True)]
    path.write_text("\n".join(["frequency [kHz],inner.y [um]", *rows]))
    vary = [f"{CLEARANCE}=2 um:15 um", "loads.unbalance.mass=1 g:20 g:log"]
    found = rotor.fit(path, vary, cycles=2 + turns, transient=2, gain=True, starts=1, progress=False)
    for one, value in zip(found.numbers, (*truth.values(), 1.2), strict=True):
        assert abs(one.value - value) < 3.0 * one.deviation < 0.2 * value, one
    assert found.signals[0].noise == pytest.approx(np.std(noise), rel=0.3)
    assert found.signals[0].axis == "frequency"


@pytest.mark.long
def test_lines_peaks_and_means_are_data_with_their_deviations(make_model: Callable[..., Model], tmp_path: Path) -> None:
    """Four numbers read off instruments at each of two speeds, in a table with units."""
    rotor, names = make_model("rotor"), ["amplitude:inner.y@1x", "amplitude:inner.x@1x", "rms:inner.y", "mean:inner.y"]
    truth = {CLEARANCE: 7e-6, "loads.unbalance.mass": 4e-3}
    length: dict[str, float] = {"cycles": 6, "transient": 3}
    random, paths = np.random.default_rng(4), []
    for speed in (250.0, 350.0):
        at = rotor.quantities(names, parameters=truth | {"shaft.speed": speed}, rtol=1e-9, **length)
        rows = []
        for name in names:
            one = at[name]
            deviation = 0.01 * abs(one.value)
            value = one.value + deviation * random.standard_normal()
            rows.append(f"{name},{float(value)!r} {one.unit},{float(deviation)!r} {one.unit}")
        paths.append(tmp_path / f"{speed}.csv")
        paths[-1].write_text("\n".join([f"# shaft.speed = {speed} rad/s", "quantity,value,deviation", *rows]))
    vary = [f"{CLEARANCE}=2 um:15 um", "loads.unbalance.mass=1 g:20 g:log"]
    found = rotor.fit(paths, vary, progress=False, **length)
    for one, value in zip(found.numbers, truth.values(), strict=True):
        assert one.low < value < one.high, one
        assert one.deviation < 0.1 * value
    assert 0.3 < found.signals[0].noise == found.signals[1].noise < 2.0
    assert not found.report().warnings
    far = rotor.fit(paths, f"{CLEARANCE}=2 um:5 um", progress=False, starts=1, **length)
    held, *off = far.report().warnings
    assert "held by the second end" in held
    assert all("differs by" in words for words in off)
    assert off
    with pytest.raises(RequestError, match="1 values for 2 numbers"):
        rotor.fit({"rms:inner.y": 1e-6}, vary, progress=False, **length)


@pytest.mark.long
def test_filtered_noise_is_warned_of(press: Model) -> None:
    data = _data(press, {CLEARANCE: 13.7e-6}, "outer.y", 0.0, 1, np.arange(500) / 5e3)
    random = np.convolve(np.random.default_rng(1).standard_normal(502), np.ones(3), "valid")
    data["outer.y"] = data["outer.y"] + 3e-7 * random
    report = press.fit(data, f"{CLEARANCE}=5 um:30 um", progress=False).report()
    assert "too narrow" in report.warnings[0]


@pytest.mark.long
def test_a_chaotic_motion_is_refused(press: Model) -> None:
    data = _data(press, {CLEARANCE: 100e-6}, "outer.y", 0.02, 1, np.arange(1800) / 5e3)
    with pytest.raises(SimulationError, match="chaotic"):
        press.fit(data, f"{CLEARANCE}=99.999 um:100.002 um", starts=1, progress=False)


@pytest.mark.parametrize(
    ("data", "options", "words"),
    [
        ({"time": np.arange(9.0), "outer.z": np.arange(9.0)}, {}, "none of its columns"),
        ({"time": np.zeros(9), "outer.y": np.arange(9.0)}, {}, "do not increase"),
        ({"time": np.arange(9.0), "outer.y": np.ones(9)}, {}, "not constant"),
        ({"outer.y": np.arange(9.0)}, {}, "no column of times"),
        ({"time": np.arange(9.0) - 1.0, "outer.y": np.arange(9.0)}, {}, "starts at 0 s"),
        ({"time": np.arange(9.0), "outer.y": np.arange(9.0), CLEARANCE: 1e-5}, {}, "are to be found"),
        ({"time": np.arange(9.0), "a": np.arange(9.0)}, {"signal": "ball.force=a"}, "one value"),
        ({"time": np.arange(9.0), "outer.y": np.arange(9.0)}, {"shift": "1 ms"}, "no range of times"),
        ({"time": np.arange(9.0), "outer.y": np.arange(9.0)}, {"loss": "square"}, "huber"),
        ("nowhere.csv", {}, "cannot be read"),
        ({"peak_ball_force": 0.0}, {}, "a value above zero"),
        ({"frequency": np.arange(9.0), "outer.y": np.arange(9.0)}, {}, "above 0 Hz"),
    ],
)
def test_wrong_requests_are_refused(press: Model, data: object, options: dict[str, str], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        press.fit(data, f"{CLEARANCE}=5 um:30 um", **options)


def test_a_pipe_is_no_record_and_not_waited_for(make_virtual: Callable[..., Model], tmp_path: Path) -> None:
    os.mkfifo(pipe := tmp_path / "pipe.nc")
    with pytest.raises(RequestError, match="it is not a NetCDF-4 file"):
        read_trial(make_virtual("varying_compliance").manifest, str(pipe), {}, 1)


def test_arrays_that_say_their_unit_are_taken_in_it(make_virtual: Callable[..., Model]) -> None:
    """As columns of files are."""
    manifest = make_virtual("varying_compliance").manifest
    times, places = np.arange(1.0, 10.0), np.sin(np.arange(9.0))
    plain = read_trial(manifest, {"time": 1e-3 * times, "inner.y": 1e-6 * places}, {}, 1)
    units = {"time": "ms", "inner.y": "um"}
    named = {
        name: xarray.DataArray(column, attrs={"units": units[name]})
        for name, column in (("time", times), ("inner.y", places))
    }
    found = read_trial(manifest, named, {}, 1)
    assert found.t == pytest.approx(plain.t, rel=1e-15)
    assert found.signals["inner.y"] == pytest.approx(plain.signals["inner.y"], rel=1e-14, abs=1e-20)
    pairs = {"rms:inner.y": xarray.DataArray([5.0, 0.1], attrs={"units": "um"})}
    (quantities,) = read_trial(manifest, pairs, {}, 1).quantities
    assert (quantities.values[0], quantities.sizes[0]) == pytest.approx((5e-6, 1e-7), rel=1e-12)
