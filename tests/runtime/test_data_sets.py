"""Claims about data sets: what is drawn, what is added as noise, what is kept when a process ends."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from scipy import stats

from ballpass.runtime import (
    Distribution,
    Model,
    RequestError,
    SignalClass,
    Signals,
    make_data_set,
)
from ballpass.runtime.many import data_set, data_set_store
from ballpass.runtime.many.cluster import connected
from ballpass.runtime.many.distributions import draw
from ballpass.runtime.many.spall_entries import entry_times

CLEARANCE = "bearing.clearance"
SIGNALS = Signals(outputs=("inner.x", "inner.vy"), sample_rate=5e3, duration=0.04, transient=0.01, rtol=1e-5)


def uniform(low: float, high: float) -> Distribution:
    return Distribution(name="uniform", arguments={"loc": low, "scale": high - low})


def classes(model: Model, members: int = 6) -> list[SignalClass]:
    """A third more members of one class than of the other."""
    return [
        SignalClass(label=label, model=model, members=count, parameters={CLEARANCE: uniform(low, low + 5e-6)})
        for label, low, count in (("tight", 1e-6, members), ("loose", 20e-6, members + members // 3))
    ]


def read(path: Path) -> xarray.Dataset:
    found = xarray.open_dataset(path) if path.suffix == ".nc" else xarray.open_zarr(path, chunks=None)
    with found:
        return found.load()


def chunk_files(path: Path, output: str) -> dict[str, int]:
    return {file.name: file.stat().st_mtime_ns for file in (path / output).glob("[0-9]*.0")}


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("uniform", {"loc": -2.0, "scale": 3.0}),
        ("norm", {"loc": 5.0, "scale": 0.1}),
        ("lognorm", {"s": 0.3, "scale": 2.0}),
        ("triang", {"c": 0.2, "loc": 1.0}),
        ("loguniform", {"a": 0.1, "b": 10.0, "scale": 1e-6}),
        ("truncnorm", {"a": -1.0, "b": 2.0}),
    ],
)
def test_drawn_values_are_distributed_as_scipy_says(name: str, arguments: dict[str, float]) -> None:
    other = Distribution(name="norm")
    drawn = draw(3, 1, 4000, {"x": Distribution(name=name, arguments=arguments), "y": other, "z": 2.0})
    law = getattr(stats, name)(**arguments)
    assert abs(drawn["x"].mean() - law.mean()) < 4.0 * law.std() / np.sqrt(4000)
    assert drawn["x"].var() == pytest.approx(law.var(), rel=0.15, abs=0.0)
    assert stats.kstest(drawn["x"], law.cdf).pvalue > 1e-3
    assert abs(stats.spearmanr(drawn["x"], drawn["y"]).statistic) < 4.0 / np.sqrt(4000)
    assert set(drawn["z"]) == {2.0}
    # a member's numbers are its own, whatever the others; other seeds and classes have others
    few = draw(3, 1, 10, {"x": Distribution(name=name, arguments=arguments), "y": other})
    assert np.array_equal(few["x"], drawn["x"][:10])
    for seed, kind in ((4, 1), (3, 2)):
        assert not np.any(draw(seed, kind, 10, {"x": Distribution(name=name, arguments=arguments)})["x"] == few["x"])


def test_quantities_of_members_are_those_of_their_runs(rotor: Model, tmp_path: Path) -> None:
    names = ("peak_ball_force", "rms:inner.y", "value:inner.x@0.03s", "mean:ball.force")
    signals = replace(SIGNALS, quantities=names)
    found = read(make_data_set(tmp_path / "a.nc", classes(rotor, 3), signals, seed=2).path)
    assert list(found["quantity"].values) == list(names)
    assert list(found["quantity_unit"].values) == ["N", "m", "m", "N"]
    turn = 2.0 * np.pi / rotor.parameters["shaft.speed"]
    for member in range(len(found["member"])):
        row = dict(zip(found["parameter"].values.tolist(), found["parameters"].values[member].tolist(), strict=True))
        changed = {CLEARANCE: row[CLEARANCE]}
        own = rotor.quantities(
            names, parameters=changed, rtol=SIGNALS.rtol, duration=found["time"].values[-1], transient=0.01 / turn
        )
        assert found["quantities"].values[member].tolist() == [own[name].value for name in names]
    with pytest.raises(RequestError, match=r"class tight: .*peak_bal_force.*peak_ball_force"):
        make_data_set(tmp_path / "b.nc", classes(rotor), replace(SIGNALS, quantities=("peak_bal_force",)), seed=1)


def test_wrong_distributions_are_refused_with_what_is_allowed() -> None:
    with pytest.raises(RequestError, match="Did you mean 'uniform'"):
        Distribution(name="unifrom")
    with pytest.raises(RequestError, match=r"width = 1\.0\. Expected: no shape parameters; loc and scale"):
        Distribution(name="uniform", arguments={"width": 1.0})
    with pytest.raises(RequestError, match="domain"):
        Distribution(name="norm", arguments={"scale": -1.0})
    with pytest.raises(RequestError, match=r"(?s)sample_rate: -1.*Allowed: a frequency.*precision: 'half'"):
        Signals(outputs=("inner.x",), sample_rate=-1.0, duration=1.0, precision="half")


def test_samples_are_those_of_single_runs_and_truth_is_what_they_were_run_with(rotor: Model, tmp_path: Path) -> None:
    report = make_data_set(tmp_path / "a.zarr", classes(rotor), replace(SIGNALS, precision="float64"), seed=1)
    found = read(report.path)
    assert report.members == report.made == 14
    assert dict(zip(*np.unique(found.label, return_counts=True), strict=True)) == {"tight": 6, "loose": 8}
    assert found["inner.vy"].attrs["units"] == "m/s"
    assert found.parameter_unit.sel(parameter=CLEARANCE) == "m"
    for member in (0, 13):
        parameters = dict(zip(found.parameter.values, found.parameters.values[member], strict=True))
        assert (parameters[CLEARANCE] > 10e-6) == (found.label[member] == "loose")
        run = rotor.simulate(times=found.time.values, parameters=parameters, rtol=SIGNALS.rtol)
        for name in SIGNALS.outputs:
            assert np.array_equal(run[name], found[name][member])


@pytest.mark.long
def test_noise_is_white_and_of_the_stated_ratio(rotor: Model, tmp_path: Path) -> None:
    long = replace(SIGNALS, duration=0.4, precision="float64")
    ratios = uniform(-10.0, 30.0)
    for name, snr in (("clean", None), ("noisy", ratios)):
        make_data_set(tmp_path / name, classes(rotor), replace(long, snr=snr), seed=1)
    clean, noisy = read(tmp_path / "clean"), read(tmp_path / "noisy")
    assert np.all(np.isinf(clean.snr))
    assert len(np.unique(noisy.snr)) == 14
    for k, name in enumerate(long.outputs):
        # the noise changes no parameter: the same motion is below it
        noise = (noisy[name] - clean[name]).values
        ratio = 10.0 * np.log10(clean[name].values.var(axis=1) / noise.var(axis=1))
        assert np.allclose(ratio, noisy.snr, atol=4.0 * 10.0 / np.log(10.0) * np.sqrt(2.0 / 2000))
        scaled = noise / noisy.noise_rms.values[:, k, None]
        assert stats.kstest(scaled.ravel(), "norm").pvalue > 1e-3
        neighbours = np.mean(scaled[:, 1:] * scaled[:, :-1])
        assert abs(neighbours) < 4.0 / np.sqrt(scaled.size)
        assert abs(np.corrcoef(scaled)[0, 1:]).max() < 5.0 / np.sqrt(2000)


def test_second_call_goes_on_where_the_first_one_ended(
    rotor: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    noisy = replace(SIGNALS, snr=10.0)
    make_data_set(tmp_path / "whole.zarr", classes(rotor), noisy, seed=1, chunk=4)

    def stop(fraction: float) -> None:
        if fraction > 0.5:
            raise KeyboardInterrupt

    part = tmp_path / "part.zarr"
    with pytest.raises(KeyboardInterrupt):
        make_data_set(part, classes(rotor), noisy, seed=1, chunk=4, progress=stop)
    assert np.sum(read(part).status == data_set.MADE) == 8
    before = chunk_files(part, "inner.x")
    # the next chunk ends between its samples and the note that it is there
    monkeypatch.setattr(data_set, "write_status", lambda *_: stop(1.0))
    with pytest.raises(KeyboardInterrupt):
        make_data_set(part, classes(rotor), noisy, seed=1, chunk=4)
    monkeypatch.undo()
    report = make_data_set(part, classes(rotor), noisy, seed=1, chunk=4)
    assert report.made == 6
    after = chunk_files(part, "inner.x")
    assert len(before) == 2
    assert {name: after[name] for name in before} == before
    xarray.testing.assert_identical(read(part), read(tmp_path / "whole.zarr"))
    # another specification is refused, with what differs, and nothing is touched
    with pytest.raises(RequestError, match=r"seed was 1, and is 2 now; signals\.snr|seed was 1, and is 2 now"):
        make_data_set(part, classes(rotor), noisy, seed=2, chunk=4)
    with pytest.raises(RequestError, match=r"classes\.tight\.members was 6, and is 9 now"):
        make_data_set(part, classes(rotor, 9), noisy, seed=1, chunk=4)
    assert chunk_files(part, "inner.x") == after
    with pytest.raises(RequestError, match="something else than a data set"):
        make_data_set(tmp_path, classes(rotor), noisy, seed=1)


@pytest.mark.parametrize(
    "name",
    [
        "inner.x/1.0",
        pytest.param("noise_rms/0.0", marks=pytest.mark.long),
        pytest.param("noise_rms/2.0", marks=pytest.mark.long),
        "status/1",
        pytest.param("time/0", marks=pytest.mark.long),
        pytest.param("label/0", marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize("cut", [True, False])
def test_what_was_deleted_or_cut_is_made_again(rotor: Model, tmp_path: Path, name: str, cut: bool) -> None:
    """A set with a deleted chunk was complete, with NaN for samples; cut noise ended in a traceback."""
    path, signals = tmp_path / "set.zarr", replace(SIGNALS, snr=20.0)
    make_data_set(path, classes(rotor, 3), signals, seed=5, chunk=3)
    before, content = read(path), (path / name).read_bytes()
    (path / name).unlink()
    if cut:
        (path / name).write_bytes(content[: len(content) // 2])
    made = make_data_set(path, classes(rotor, 3), signals, seed=5, chunk=3).made
    assert made == {"time/0": 0, "label/0": 0, "noise_rms/2.0": 1}.get(name, 3)
    xarray.testing.assert_identical(read(path), before)


@pytest.mark.parametrize("name", [".zattrs", ".zmetadata", ".zgroup"])
def test_a_set_whose_description_is_cut_is_refused_by_name(rotor: Model, tmp_path: Path, name: str) -> None:
    path = tmp_path / "set.zarr"
    make_data_set(path, classes(rotor, 1), SIGNALS, seed=5)
    (path / name).write_bytes((path / name).read_bytes()[:3])
    with pytest.raises(RequestError, match=r"set\.zarr: what describes the data set .* cannot be read"):
        make_data_set(path, classes(rotor, 1), SIGNALS, seed=5)


@pytest.mark.parametrize("name", ["time/.zattrs", "status/.zarray"])
def test_a_description_of_an_array_that_is_cut_or_deleted_is_written_again(
    rotor: Model, tmp_path: Path, name: str
) -> None:
    """Readers that take no consolidated description failed on a set that counted as complete."""
    path = tmp_path / "set.zarr"
    make_data_set(path, classes(rotor, 1), SIGNALS, seed=5)
    content = (path / name).read_bytes()
    for rest in (None, b"", content[:-3]):
        (path / name).unlink()
        if rest is not None:
            (path / name).write_bytes(rest)
        assert make_data_set(path, classes(rotor, 1), SIGNALS, seed=5).made == 0
        assert json.loads((path / name).read_text(encoding="utf-8")) == json.loads(content)


def test_a_set_that_fits_nowhere_is_refused_and_leaves_nothing(rotor: Model, tmp_path: Path) -> None:
    for rate, members, words in ((1e12, 1, "would not fit into memory"), (1e6, 10_000_000, "GB would be written")):
        with pytest.raises(RequestError, match=words):
            make_data_set(
                tmp_path / "set.zarr", classes(rotor, members)[:1], replace(SIGNALS, sample_rate=rate), seed=1
            )
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_netcdf_holds_what_zarr_holds(rotor: Model, tmp_path: Path) -> None:
    for name in ("a.zarr", "a.nc"):
        make_data_set(tmp_path / name, classes(rotor), SIGNALS, seed=1, chunk=4)
    one, other = read(tmp_path / "a.zarr"), read(tmp_path / "a.nc")
    xarray.testing.assert_equal(one, other)
    assert one.attrs == other.attrs
    assert {name: item.attrs.get("units") for name, item in one.items()} == {
        name: item.attrs.get("units") for name, item in other.items()
    }
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.nc", "a.zarr"]
    assert make_data_set(tmp_path / "a.nc", classes(rotor), SIGNALS, seed=1, chunk=4).made == 0
    with pytest.raises(RequestError, match="seed was 1"):
        make_data_set(tmp_path / "a.nc", classes(rotor), SIGNALS, seed=5, chunk=4)


def test_members_that_fail_are_named_and_cost_no_other(rotor: Model, tmp_path: Path) -> None:
    mass = "bearing.inner_ring.mass"
    vary = {mass: uniform(-10.0, 30.0)}
    one = [SignalClass(label="any", model=rotor, members=20, parameters=vary)]
    report = make_data_set(tmp_path / "a.nc", one, SIGNALS, seed=1)
    again = make_data_set(tmp_path / "a.nc", one, SIGNALS, seed=1)
    found = read(tmp_path / "a.nc")
    negative = np.flatnonzero(found.parameters.sel(parameter=mass) <= 0.0)
    assert 0 < len(negative) < 20
    assert [failure.member for failure in report.failures] == negative.tolist()
    assert report.failures == again.failures
    assert {failure.status for failure in report.failures} == {"REFUSED"}
    assert mass in report.failures[0].message
    assert np.array_equal(np.flatnonzero(np.isnan(found["inner.x"]).any("time")), negative)


def test_wrong_classes_are_refused(rotor: Model, tmp_path: Path) -> None:
    def make(signals: Signals = SIGNALS, **changes: Any) -> None:
        make_data_set(tmp_path / "a", [replace(classes(rotor)[0], **changes)], signals, seed=1)

    with pytest.raises(RequestError, match=r"class tight: There is no parameter .*bearing\.clearance"):
        make(parameters={"bearing.clearence": 1e-6})
    with pytest.raises(RequestError, match=r"class tight: 0 members"):
        make(members=0)
    with pytest.raises(RequestError, match="a value for each ball"):
        make(replace(SIGNALS, outputs=("ball.force",)))
    with pytest.raises(RequestError, match=r"inner\.z"):
        make(replace(SIGNALS, outputs=("inner.z",)))
    assert not (tmp_path / "a").exists()


def test_missing_packages_are_named_with_the_command(
    rotor: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(RequestError, match=r"needs Zarr, which is not installed: pip install 'ballpass\[scale\]'"):
        make_data_set(tmp_path / "a", classes(rotor), SIGNALS, seed=1)
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    with pytest.raises(RequestError, match="needs Dask"), connected(None, 2):
        pass


@pytest.mark.long
@pytest.mark.parametrize("speed", ["3000 rpm", "-3000 rpm"])
def test_entry_times_of_a_spall_are_those_of_the_cage(
    make_model: Callable[..., Model], tmp_path: Path, speed: str
) -> None:
    spall = 'on = "outer"\nangle = "270 deg"\nchord = "2 mm"\nprofile = "half-sine"\ndepth = "5 um"'
    here = "[bearing.initial]"
    pitted = make_model("rotor", (here, f"[bearing.defects.pit]\n{spall}\n\n{here}"), ("3000 rpm", speed))
    healthy = make_model("rotor")
    vary = {"bearing.ball_angle": uniform(0.0, 6.0)}
    some = [
        SignalClass(label="healthy", model=healthy, members=3, parameters={}),
        SignalClass(label="pitted", model=pitted, members=5, parameters=vary),
    ]
    make_data_set(tmp_path / "a", some, replace(SIGNALS, outputs=("inner.y",), duration=0.1), seed=1)
    found = read(tmp_path / "a")
    times = found["entry_time.defects.pit"].values
    assert np.all(np.isnan(times[found.label.values == "healthy"]))
    names = found.parameter.values.tolist()
    for member in np.flatnonzero(found.label == "pitted"):
        own = dict(zip(names, found.parameters.values[member], strict=True))
        ball, pitch = own["bearing.ball_diameter"], own["bearing.pitch_diameter"]
        cage = own["shaft.speed"] / 2.0 * (1.0 - ball / pitch)
        radius = pitted.constants()["bearing.outer_raceway_radius"]
        edge = np.radians(270.0) - np.sign(cage) * np.arcsin(2e-3 / (2.0 * radius))
        entries = times[member][np.isfinite(times[member])]
        angles = own["bearing.ball_angle"] + cage * entries[:, None] + 2.0 * np.pi * np.arange(8) / 8
        beside = np.abs(np.angle(np.exp(1j * (angles - edge)))).min(axis=1)
        assert np.all(beside < 1e-9)
        assert len(entries) in (int(0.1 * 8 * abs(cage) / (2 * np.pi)) + k for k in (0, 1))
        assert np.all((entries >= 0.01) & (entries < 0.11))


@pytest.mark.long
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("name", ["set", "set.nc"])
def test_entry_times_of_a_run_up_are_those_of_the_cage(
    make_model: Callable[..., Model], tmp_path: Path, sense: int, name: str
) -> None:
    """A run-up beside a constant speed: both are known before a run."""
    spall = 'on = "outer"\nangle = "270 deg"\nchord = "2 mm"\nprofile = "half-sine"\ndepth = "5 um"'
    pit, here = ("[bearing.initial]", f"[bearing.defects.pit]\n{spall}\n\n[bearing.initial]"), 'start_angle = "0 deg"'
    rows = f'time = ["0 s", "0.4 s"]\nspeed = ["{sense * 300} rpm", "{sense * 900} rpm"]'
    table = (here, f"{here}\n[mechanism.driver.table]\n{rows}\n#")
    kept = ('"outer.*",', '"outer.*", "cage.in_outer",')
    even = make_model("punching_press", pit, kept, ("500 rpm", f"{sense * 500} rpm"))
    driven = make_model("punching_press", pit, kept, table, ('speed = "500 rpm"', ""))
    shares = {"bearing.share": uniform(0.3, 0.6)}
    some = [
        SignalClass(label="even", model=even, members=2, parameters={}),
        SignalClass(label="driven", model=driven, members=3, parameters=shares),
    ]
    outputs = {"outputs": ("cage.in_outer",), "precision": "float64"}
    recorded = Signals(sample_rate=20e3, duration=0.4, transient=0.05, rtol=1e-7, **outputs)
    make_data_set(tmp_path / name, some, recorded, seed=1, chunk=2)
    found = read(tmp_path / name)
    times = found["entry_time.defects.pit"].values
    edge = driven.constants()[f"bearing.defects.pit.{'begin' if sense > 0 else 'end'}"]
    for member in range(5):
        entries = times[member][np.isfinite(times[member])]
        seen = np.unwrap(found["cage.in_outer"].values[member])
        turned = np.interp(entries, found.time.values, seen)
        assert np.max(np.abs(np.angle(np.exp(1j * (8 * turned - edge))))) < 1e-5  # straight between samples
        assert len(entries) in (int(8 * np.ptp(seen) / (2 * np.pi)) + k for k in (0, 1))
        assert np.all(np.diff(entries) > 0.0)


def test_entry_times_follow_a_slip_of_the_cage_that_changes(make_virtual: Callable[..., Model]) -> None:
    """They were those of the last slip from the start on: off by half a ball pitch here."""
    spall = 'on = "outer"\nangle = "270 deg"\nchord = "2 mm"\nprofile = "half-sine"\ndepth = "5 um"'
    slip = 'slip = { time = ["0 s", "0.03 s"], value = [0.0, 0.1] }'
    here = "[bearing.initial]"
    model = make_virtual("rotor", (here, f"[bearing.defects.pit]\n{spall}\n\n[bearing.cage]\n{slip}\n\n{here}"))
    starts = np.array([0.0, 1.0, 2.5])
    found = entry_times(model, {"bearing.ball_angle": starts}, 0.01, 0.11)["defects.pit"]
    cage, edge = model.constants()["bearing.cage_ratio"] * 100.0 * np.pi, model.constants()["bearing.defects.pit.begin"]
    for start, times in zip(starts, found, strict=True):
        entries = times[np.isfinite(times)]
        turned = start + cage * (entries - 0.1 * np.maximum(entries - 0.03, 0.0))
        assert np.abs(np.angle(np.exp(1j * (8 * turned - edge)))).max() < 1e-8
        assert len(entries) in (int(8 * cage * (0.1 - 0.1 * 0.08) / (2 * np.pi)) + k for k in (0, 1))
        assert np.all((entries >= 0.01) & (entries < 0.11))


@pytest.mark.long
def test_bits_are_the_same_for_any_number_of_workers(rotor: Model, tmp_path: Path) -> None:
    noisy = replace(SIGNALS, snr=10.0)
    make_data_set(tmp_path / "none", classes(rotor), noisy, seed=1, chunk=3)
    rows = {CLEARANCE: np.linspace(1e-6, 30e-6, 700)}
    ask = {"duration": 0.3, "transient": 1.0, "rtol": 1e-5}
    here = rotor.simulate_many(rows, ["max:ball.force", "rms:inner.y"], threads=1, **ask)
    for workers in (1, 2):
        path = tmp_path / str(workers)
        with connected(None, workers) as client:
            make_data_set(path, classes(rotor), noisy, seed=1, chunk=3, client=client)
            there = rotor.simulate_many(rows, ["max:ball.force", "rms:inner.y"], client=client, **ask)
        xarray.testing.assert_identical(read(path), read(tmp_path / "none"))
        assert there.statistics.lanes == here.statistics.lanes > 1
        assert there.statistics.steps == here.statistics.steps
        for name in here:
            assert np.array_equal(here[name], there[name])


@pytest.mark.long
def test_a_worker_that_does_not_see_the_store_sends_its_samples(
    rotor: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_data_set(tmp_path / "a", classes(rotor), SIGNALS, seed=1)
    elsewhere = data_set.SignalPlace(path=str(tmp_path / "b"), mark="of another disk")
    monkeypatch.setattr(data_set, "marked", lambda _: nullcontext(elsewhere))
    with connected(None, 1) as client:
        make_data_set(tmp_path / "b", classes(rotor), SIGNALS, seed=1, client=client)
    xarray.testing.assert_identical(read(tmp_path / "a"), read(tmp_path / "b"))


@pytest.mark.long
@pytest.mark.parametrize("interrupted", [False, True])
def test_a_lost_worker_loses_no_finished_chunk(rotor: Model, tmp_path: Path, interrupted: bool) -> None:
    make_data_set(tmp_path / "a", classes(rotor, 60), SIGNALS, seed=1, chunk=4)
    finished: dict[str, int] = {}
    killed: list[int] = []
    with connected(None, 2) as client:

        def kill(fraction: float) -> None:
            if fraction > 0.2 and not killed:
                finished.update(chunk_files(tmp_path / "b", "inner.x"))
                made = read(tmp_path / "b").status.values
                whole = {f"{first // 4}.0" for first in range(0, len(made), 4) if made[first] == data_set.MADE}
                for name in set(finished) - whole:  # under way
                    del finished[name]
                killed.extend(client.run(os.getpid).values())
                os.kill(killed[0], signal.SIGKILL)
                if interrupted:
                    raise KeyboardInterrupt

        def make(progress: Callable[[float], None]) -> None:
            make_data_set(
                tmp_path / "b", classes(rotor, 60), SIGNALS, seed=1, chunk=4, client=client, progress=progress
            )

        if interrupted:
            with pytest.raises(KeyboardInterrupt):
                make(kill)
        make(kill)
    assert killed
    assert len(finished) >= 7
    after = chunk_files(tmp_path / "b", "inner.x")
    assert {name: after[name] for name in finished} == finished
    xarray.testing.assert_identical(read(tmp_path / "a"), read(tmp_path / "b"))


def test_a_pipe_in_the_place_of_a_data_set_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(pipe := tmp_path / "pipe.nc")
    with pytest.raises(RequestError, match="this is no regular file"):
        data_set_store.read_finished(pipe, {})
