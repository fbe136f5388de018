"""Claims about long ensembles: a run cut into stretches is the run, whatever it costs in memory and patience."""

from __future__ import annotations

import ctypes
import json
import math
import subprocess
import sys
import textwrap
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from press_laws import press

from ballpass.runtime import Model
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.many import chunks, member_segments
from ballpass.runtime.many.chunks import PATIENCE
from ballpass.runtime.many.member_segments import moments, stretches
from ballpass.runtime.many.members import Spans, make_members
from ballpass.runtime.native.ensemble_driver import RESULT, EnsembleDriver, MemberArrays
from ballpass.runtime.request.choose_method import stepper_method
from ballpass.runtime.request.locating import Kinks

ModelMaker = Callable[..., Model]
OBSERVABLES = ("max:ball.force", "peak_time:ball.force", "min:inner.y", "rms_inner_y", "end:inner.vx")
SPEED = "mechanism.driver.speed"


def cut(whole: MemberArrays, cuts: list[list[int]]) -> list[MemberArrays]:
    """Segments cut for each member where its list says, in as many parts as the longest list has entries but one."""
    found = []
    for part in range(len(cuts[0]) - 1):
        spans = [(int(whole.first[m]), places[part], places[part + 1]) for m, places in enumerate(cuts)]
        times = [whole.times[begin + m + a : begin + m + b + 1] for m, (begin, a, b) in enumerate(spans)]
        found.append(
            MemberArrays(
                p=whole.p,
                c=whole.c,
                first=np.concatenate([[0], np.cumsum([b - a for _, a, b in spans])]).astype(np.int_),
                times=np.concatenate(times),
                inputs=np.concatenate([whole.inputs[begin + a : begin + b] for begin, a, b in spans]),
                restarts=np.concatenate([whole.restarts[begin + a : begin + b] for begin, a, b in spans]),
            )
        )
    return found


@pytest.mark.parametrize(
    "law", ["one-sided", pytest.param("stiff", marks=pytest.mark.long), pytest.param("tangent", marks=pytest.mark.long)]
)
@pytest.mark.parametrize("method", ["auto", "stepper-dp54", "stepper-rodas5p"])
def test_a_run_cut_at_its_segments_is_the_run_in_one_call(make_model: ModelMaker, law: str, method: str) -> None:
    """States, reductions, counts, methods and step sizes are the same bits; members are cut each at its own places."""
    model, count = press(make_model, law), 11
    random = np.random.default_rng(5)
    clearance = random.uniform(5e-6, 2e-5, count)
    speed = 52.36 * random.uniform(0.8, 1.2, count)
    members = make_members(model, {"bearing.clearance": clearance, SPEED: speed})
    turns = 2.0 * math.pi / speed
    span = Spans(durations=2.0 * turns, turns=turns, starts=0.3 * turns)
    (whole,) = stretches(model, members, span, np.arange(count))
    driver = model.ensemble_driver
    tolerance = 1e-6 * driver.magnitudes(whole, members.initial, *moments(model, members, span, np.arange(count)))
    segments = np.diff(whole.first)
    cuts = [[0, *np.sort(random.integers(0, n + 1, 3)).tolist(), int(n)] for n in segments]
    # one that begins late, one that is done early
    cuts[0][1:3], cuts[1][1:4] = [0, 0], [int(segments[1])] * 3
    runs = []
    for parts in ([whole], cut(whole, cuts)):
        x = members.initial.copy()
        rows = driver.rows.empty(count, span.starts, driver.rows.all_of(("inner.y", "ball.force")))
        carried = driver.carry(count)
        reached = np.zeros(count)
        for part in parts:
            results = driver.run(
                *(STEPPERS[stepper_method(method)], part, x, tolerance, rows, ctypes.c_int(0)),
                carried=carried,
                reached=reached,
            )
        assert np.array_equal(reached, span.durations)
        runs.append((x, rows, results))
    (x, rows, results), (cut_x, cut_rows, cut_results) = runs
    assert np.array_equal(x, cut_x)
    assert np.array_equal(rows, cut_rows)
    assert results["steps"].min() > 100
    for name in RESULT.names or ():
        if name != "segment":
            assert np.array_equal(results[name], cut_results[name]), name


@pytest.mark.parametrize(
    ("law", "rtol"),
    [
        pytest.param("stiff", 1e-6, marks=pytest.mark.long),
        *(pytest.param(law, rtol, marks=pytest.mark.long) for law, rtol in (("one-sided", 1e-6), ("tangent", 1e-2))),
    ],
)
def test_results_are_the_same_bits_for_stretches_of_any_length(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch, law: str, rtol: float
) -> None:
    """Runs of 200 turns, some turns or some segments at a time; a member that turns slowly is done in the first.

    At a loose tolerance, light damping lets the rates seen in the whole run decide about the families.
    """
    model = press(make_model, law)
    columns = {"bearing.clearance": [8e-6, 1e-5, 1.2e-5], SPEED: [52.36, 48.0, 3.0]}
    assert 24.0 * 52.36 / (2.0 * math.pi) > 3 * 64
    calls: list[int] = []
    run = EnsembleDriver.run

    def counted(*given: Any, **more: Any) -> np.ndarray:
        calls.append(len(given[2].inputs))
        return run(*given, **more)

    monkeypatch.setattr(EnsembleDriver, "run", counted)
    found, stretched = [], []
    for windows, segments in ((1000, 1_000_000), (1, 1_000_000), (1000, 30)):
        monkeypatch.setattr(member_segments, "MEMBER_WINDOWS", windows)
        monkeypatch.setattr(member_segments, "SEGMENTS", segments)
        calls.clear()
        found.append(model.simulate_many(columns, OBSERVABLES, duration=24.0, transient=1.5, rtol=rtol))
        stretched.append(len(calls))
        assert max(calls) <= segments
    assert stretched[:2] == [1, 4]
    assert stretched[2] > 50
    whole, *others = found
    assert whole.failures == ()
    for other in others:
        assert other.failures == ()
        for name in OBSERVABLES:
            assert np.array_equal(whole[name], other[name]), name
        assert whole.statistics.steps == other.statistics.steps
        assert whole.statistics.evaluations == other.statistics.evaluations


def test_a_member_that_fails_in_one_stretch_does_not_go_on_in_the_next(
    make_model: ModelMaker, boundless: Callable[[Model], Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    model = boundless(press(make_model))
    columns = {"bearing.outer_ring.stiffness": [5e7, -1e10, 5e7]}
    found = []
    for segments in (1_000_000, 3):
        monkeypatch.setattr(member_segments, "SEGMENTS", segments)
        found.append(model.simulate_many(columns, OBSERVABLES, cycles=3, transient=0))
    whole, cut_up = found
    assert whole.failures == cut_up.failures
    (failure,) = whole.failures
    assert failure.member == 1
    assert 0.0 < failure.time < 3.0 * model.period()
    for name in OBSERVABLES:
        assert np.array_equal(whole[name], cut_up[name], equal_nan=True), name
    assert whole.statistics.steps == cut_up.statistics.steps


@pytest.mark.parametrize("kinks", [None, "stepped-over"])
@pytest.mark.parametrize(
    ("scene", "cycles", "transient"), [("varying_compliance", 5.5, 0.3), ("varying_compliance", 20.0, 2.0)]
)
def test_members_one_by_one_are_reduced_runs_to_the_last_bit(
    make_model: ModelMaker, scene: str, cycles: float, transient: float, kinks: Kinks | None
) -> None:
    """Rattling balls carry a last digit of the tolerance to the first of the motion: both must find the same one."""
    model = make_model(scene)
    clearance = [5e-6, 2e-5, 4e-5, 8e-5]
    given: dict[str, Any] = {"cycles": cycles, "transient": transient, "rtol": 1e-9, "kinks": kinks}
    found = model.simulate_many({"bearing.clearance": clearance}, OBSERVABLES, lanes=False, **given)
    for k, value in enumerate(clearance):
        single = model.reduce(parameters={"bearing.clearance": value}, **given)
        assert found["max:ball.force"][k] == single["ball.force"].maximum
        assert found["peak_time:ball.force"][k] == single["ball.force"].maximum_time
        assert found["rms_inner_y"][k] == single["inner.y"].rms
        assert found["end:inner.vx"][k] == single.end["inner.vx"]


@pytest.mark.parametrize("lanes", [True, False])
def test_a_member_has_its_own_limit_of_steps(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch, lanes: bool
) -> None:
    """One that meets its limit alone meets it beside a member that turns ten times as often, and may take more."""
    model = press(make_model)
    monkeypatch.setattr(
        "ballpass.runtime.run.limits.step_limit", lambda duration, turn: 1000 * math.ceil(duration / turn - 1e-9)
    )
    fates = []
    for speeds in ([10.0], [10.0, 100.0]):
        columns = {SPEED: speeds}
        given: dict[str, Any] = {"duration": 0.2 * math.pi, "transient": 0, "rtol": 1e-3, "method": "stepper-dp54"}
        found = model.simulate_many(columns, ["end:inner.y"], lanes=lanes, **given)
        fates.append(found.failures)
    assert [(failure.member, failure.status) for failure in fates[0]] == [(0, "TOO_MANY_STEPS")]
    assert fates[0] == fates[1]


@pytest.mark.parametrize("lanes", [True, pytest.param(False, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("members", "cycles"), [pytest.param(8, 200, marks=pytest.mark.long), (200, 8)], ids=["few long", "many short"]
)
def test_progress_is_told_within_chunks(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch, lanes: bool, members: int, cycles: int
) -> None:
    """As often as patience asks, though nothing has come to its end."""
    model = press(make_model)
    monkeypatch.setattr(chunks, "PATIENCE", 0.01)
    monkeypatch.setattr(chunks, "CHUNKS", 1)
    monkeypatch.setattr(chunks, "CHUNK", 1000)
    columns = {"bearing.clearance": np.linspace(5e-6, 2e-5, members)}
    for longer in (1, 4, 16, 64):  # runs that last, on a fast machine and on one that does something else as well
        told: list[float] = []
        model.simulate_many(
            columns, ["end:inner.y"], cycles=longer * cycles, transient=0, rtol=1e-4, lanes=lanes, progress=told.append
        )
        assert told == sorted(told)
        assert told[-1] == 1.0
        if len({fraction for fraction in told if 0.0 < fraction < 1.0}) >= 4:
            break
    else:
        pytest.fail(f"progress was told {len(told)} times in a run of {64 * cycles} turns")
    # twice a second and more, as it is
    assert PATIENCE <= 0.5


@pytest.mark.parametrize("lanes", [True, False])
def test_members_interrupted_between_stretches_have_no_results(make_model: ModelMaker, lanes: bool) -> None:
    model = press(make_model)

    def interrupt(fraction: float) -> None:
        if fraction > 1e-6:  # ten turns each in lanes, where all go on together
            raise KeyboardInterrupt

    columns = {"bearing.clearance": np.linspace(5e-6, 2e-5, 8)}
    found = model.simulate_many(
        columns, OBSERVABLES, cycles=1e7, transient=0, threads=1, lanes=lanes, progress=interrupt
    )
    assert found.interrupted
    assert [failure.member for failure in found.failures] == list(range(8))
    assert {failure.status for failure in found.failures} == {"INTERRUPTED"}
    reached = np.array([failure.time for failure in found.failures])
    assert np.all(reached < 1e7 * model.period())
    assert reached[0] > 0.0  # of members or blocks of lanes the first is under way
    assert np.all(np.isnan(found["max:ball.force"]))


@pytest.mark.long
def test_the_end_of_a_stretch_is_not_that_of_the_run(make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked to stop when all have come to the end of their first stretch: only who needs no other one has results."""
    model = press(make_model)
    run = EnsembleDriver.run

    def stopping(*given: Any, **more: Any) -> np.ndarray:
        found = run(*given, **more)
        given[6].value = 1
        return found

    monkeypatch.setattr(EnsembleDriver, "run", stopping)
    monkeypatch.setattr(member_segments, "MEMBER_WINDOWS", 1)
    columns = {SPEED: [52.36, 5.236, 48.0]}
    found = model.simulate_many(columns, OBSERVABLES, duration=10.0, transient=0)
    assert [(failure.member, failure.status) for failure in found.failures] == [(0, "INTERRUPTED"), (2, "INTERRUPTED")]
    assert [failure.time for failure in found.failures] == pytest.approx(
        [128.0 * math.pi / 52.36, 128.0 * math.pi / 48.0]
    )
    assert np.flatnonzero(np.isfinite(found["rms_inner_y"])).tolist() == [1]


def test_runs_of_ten_million_turns_need_little_memory_and_hear_an_interrupt(make_model: ModelMaker) -> None:
    """A process of its own: its largest memory, and how soon Ctrl-C ends it."""
    pytest.importorskip("resource")
    folder = press(make_model).folder
    code = """
        import json, os, resource, signal, sys, threading, time
        from ballpass.runtime import load

        model = load(sys.argv[1])
        asked = {"bearing.clearance": [k * 1e-6 for k in range(4, 12)]}, ["max:ball.force"]
        model.simulate_many(*asked, cycles=3, transient=0)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        sent, timers = [], []

        def interrupt():
            sent.append(time.process_time())  # of this process: others may keep it from its processor
            os.kill(os.getpid(), signal.SIGINT)

        def begun(fraction):
            if fraction > 1e-6 and not timers:
                timers.append(threading.Timer(0.3, interrupt))
                timers[0].start()

        found = model.simulate_many(*asked, cycles=1e7, transient=0, progress=begun)
        heard = time.process_time() - sent[0]
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        print(json.dumps([found.interrupted, [failure.time for failure in found.failures], heard, grown]))
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code), str(folder)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    interrupted, times, heard, grown = json.loads(done.stdout)
    assert interrupted
    assert len(times) == 8
    assert max(times) > 0.0
    assert heard < 1.0
    # in kilobytes; in one go it were gigabytes
    assert grown < 40_000
