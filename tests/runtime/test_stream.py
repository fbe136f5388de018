"""Claims about runs that are written to a file piece by piece: the samples of one run, in bounded memory."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray

from ballpass.runtime import Model, RequestError, load_solution
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.request import request
from ballpass.runtime.request.request import Request
from ballpass.runtime.solution.stream import stream_run


def test_a_streamed_run_has_the_samples_of_one_run(rotor: Model, tmp_path: Path) -> None:
    """In a dozen pieces, at a rate that no turn is a multiple of; the file is one of `load_solution` and of xarray."""
    path, rate = tmp_path / "long.nc", 7001.0
    asked = Request(duration=0.4, sample_rate=rate, rtol=1e-9, transient_cycles=1)
    statistics = stream_run(rotor, rotor.numbers(), asked, path, piece=9000)
    whole = rotor.simulate(duration=0.4, sample_rate=rate, rtol=1e-9, transient=1)
    found = load_solution(path)
    assert np.array_equal(found.t, whole.t)
    assert found.t == pytest.approx(np.arange(2801) / rate, rel=1e-15, abs=0.0)
    for name in (*whole.states, *whole.outputs):
        assert found[name] == pytest.approx(whole[name], abs=2e-5 * np.max(np.abs(whole[name])))
    assert statistics.steps == found.statistics.steps
    assert found.statistics.duration == pytest.approx(0.4, abs=1.0 / rate)  # each piece goes on from the one before
    assert found.statistics.segments > whole.statistics.segments  # it was made of pieces
    assert len(found.steady()) == len(whole.steady())
    with xarray.open_dataset(path, engine="h5netcdf") as stored:
        assert stored["ball.force"].attrs["units"] == "N"
        assert np.array_equal(stored["inner.y"][-5:], found["inner.y"][-5:])
    more = rotor.simulate(duration=0.01, sample_rate=rate, initial=found.end, transient=0)
    assert more.t[0] == pytest.approx(0.4 - 0.4 % (1 / rate), abs=1.1 / rate)


def test_a_run_whose_samples_memory_does_not_hold_is_streamed(
    rotor: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No piece is larger than asked for: a limit that refuses the whole run lets every piece pass."""
    monkeypatch.setattr(request, "MAX_NUMBERS", 26_000)
    with pytest.raises(RequestError, match="would not fit into memory"):
        rotor.simulate(duration=0.2, sample_rate=51200.0)
    stream_run(rotor, rotor.numbers(), Request(duration=0.2, sample_rate=51200.0), tmp_path / "long.nc", piece=25_000)
    assert len(load_solution(tmp_path / "long.nc")) == 10241


@pytest.mark.long
def test_memory_does_not_grow_with_the_run(rotor: Model, tmp_path: Path) -> None:
    def peak(duration: float) -> float:
        numbers: Numbers = rotor.numbers()
        tracemalloc.start()
        asked = Request(duration=duration, sample_rate=51200.0, rtol=1e-5)
        stream_run(rotor, numbers, asked, tmp_path / "long.nc", piece=2**16)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return float(found)

    peak(0.2)  # imports
    short, long = peak(0.5), peak(2.0)
    assert long < 1.1 * short + 2e5
    assert (tmp_path / "long.nc").stat().st_size > 5 * long


def test_what_cannot_be_streamed_is_refused_and_leaves_the_file(rotor: Model, tmp_path: Path) -> None:
    path = tmp_path / "kept.nc"
    path.write_text("kept")
    with pytest.raises(RequestError, match="above 0 Hz"):
        rotor.stream(path, sample_rate=-1.0)
    with pytest.raises(RequestError, match="fewer than two samples"):
        rotor.stream(path, sample_rate=1.0, duration=0.1)
    with pytest.raises(RequestError, match="output"):
        rotor.stream(path, sample_rate=1e4, duration=0.1, outputs=["inner.z"])
    with pytest.raises(RequestError, match="cannot be written"):
        rotor.stream(tmp_path / "missing" / "x.nc", sample_rate=1e4, duration=0.1)
    with pytest.raises(RequestError, match="both given"):
        rotor.simulate(duration=0.1, sample_rate=1e4, samples_per_cycle=100)
    os.mkfifo(pipe := tmp_path / "pipe.nc")
    for write in (lambda: rotor.stream(pipe, sample_rate=1e4, duration=0.1), lambda: rotor.simulate(1).save(pipe)):
        with pytest.raises(RequestError, match="this is no regular file"):
            write()
    assert pipe.is_fifo()  # as root, a device had become a file
    pipe.unlink()
    assert path.read_text() == "kept"
    assert [p.name for p in tmp_path.iterdir()] == ["kept.nc"]
