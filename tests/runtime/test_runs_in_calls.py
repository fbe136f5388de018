"""Claims about runs with reductions that last: cut into calls they are the same run, heard and bounded as any other."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from typing import Any

import numpy as np
import pytest
from press_laws import press
from quick_cases import long_but

from ballpass.runtime import IntegrationError, Model
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.contract.status import Status
from ballpass.runtime.many import chunks
from ballpass.runtime.native.stepper import End, Outcome, Stepper
from ballpass.runtime.request.locating import stepper_for
from ballpass.runtime.request.magnitudes import stepper_magnitudes
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import resolve
from ballpass.runtime.request.segments import make_segments, segment_edges, time_resolution
from ballpass.runtime.run import limits, loop
from ballpass.runtime.run.loop import KeptSteps, RunFailed, RunUnderWay, Samples, segments_of, start_run
from ballpass.runtime.run.reductions import channel_names
from ballpass.runtime.time import timeline

ModelMaker = Callable[..., Model]
CLEARANCE = "bearing.clearance"


def in_calls(model: Model, stepper: Stepper, method: str, steps: int) -> tuple[Outcome, list[np.ndarray], int]:
    """Two turns in calls of so many steps, every other one in another thread: what the driver tells at the end; state,
    reductions and samples; number of calls."""
    numbers = model.numbers()
    turn = timeline.stretch(model.manifest, numbers.values)
    state = np.array([numbers.values[name] for name in model.manifest.initial])
    tolerance = 1e-6 * stepper_magnitudes(model, model.stepper, numbers, state, 2.0 * turn, turn)
    segments = make_segments(model.manifest, numbers, segment_edges(model, numbers, 0.0, 2.0 * turn, turn))
    layout = model.ensemble_driver.rows
    row = layout.empty(1, turn, layout.all_of(channel_names(model.manifest)))[0]
    times = np.linspace(0.0, 2.0 * turn, 77)
    states = np.full((len(times), len(state)), np.nan)
    held = stepper.hold()

    def call(most: int) -> Outcome:
        return stepper.run(
            method=STEPPERS[method],
            tolerance=tolerance,
            p=numbers.p,
            c=numbers.c,
            x=state,
            segments=segments,
            output_times=times,
            output_states=states,
            reduction=row,
            max_steps=most,
            held=held,
        )

    with ThreadPoolExecutor(max_workers=1) as elsewhere:  # on another stack
        for calls in count(1):
            outcome = call(calls * steps) if calls % 2 else elsewhere.submit(call, calls * steps).result()
            if outcome.end is not End.TOO_MANY_STEPS:
                break
    return outcome, [state, row, states], calls


@pytest.mark.parametrize("kinks", [pytest.param("stepped-over", marks=pytest.mark.long), "located"])
@pytest.mark.parametrize("law", ["tangent", "two-sided-gated"])
@pytest.mark.parametrize("method", long_but(STEPPERS, "stepper", "stepper-rodas4"))
def test_a_run_has_the_same_bits_however_it_is_cut_into_calls(
    make_model: ModelMaker, law: str, method: str, kinks: str
) -> None:
    """End, reductions, samples, and all that the driver counts; cut within segments, at refused steps, at kinks."""
    model = press(make_model, law)
    stepper = model.locating_stepper if kinks == "located" else model.stepper
    whole, expected, once = in_calls(model, stepper, method, 10**9)
    assert (whole.end, once) == (End.DONE, 1)
    assert whole.kinks > 20 if kinks == "located" else whole.kinks == 0
    assert whole.rejected > 0
    for steps in (1, 37):
        outcome, found, calls = in_calls(model, stepper, method, steps)
        assert calls > (whole.steps + whole.rejected) / (8 * steps)
        assert outcome == whole
        for ours, theirs in zip(found, expected, strict=True):
            assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("kinks", ["stepped-over", "located"])
@pytest.mark.parametrize("method", long_but(STEPPERS, "stepper", "stepper-dop853", "stepper-rodas5p"))
def test_states_of_kept_steps_are_the_samples_of_the_run_to_the_bit(
    make_model: ModelMaker, method: str, kinks: Any
) -> None:
    """At any times, also at the ends of segments; among them steps over the square root of time."""
    model = press(make_model, "tangent")
    run = resolve(model, model.numbers(), Request(cycles=1.5, method=method, kinks=kinks, rtol=1e-7))
    stepper = stepper_for(model, run.kinks)
    edges = segments_of(run).times
    times = np.unique([*np.linspace(run.begin, run.end, 997), *edges])
    sampled = np.empty((len(times), len(model.states)))
    near = time_resolution(run.begin, run.end, run.stretch)
    start_run(run, [Samples(times=times, x=sampled, near=near, end=run.end)]).go_on()
    kept = KeptSteps(numbers=stepper.kept)
    start_run(run, [kept]).go_on()
    assert np.array_equal(stepper.read(kept.all, times), sampled)
    assert np.any(kept.all[:, 1]) == (kinks == "located")


@pytest.mark.parametrize("kinks", ["stepped-over", "located"])
@pytest.mark.parametrize("method", ["auto", "stepper-rodas4"])
def test_reduced_runs_tell_progress_within_a_turn_and_keep_their_bits(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch, method: str, kinks: Any
) -> None:
    model = press(make_model)
    given: dict[str, Any] = {"cycles": 1.5, "transient": 0.4, "rtol": 1e-7, "method": method, "kinks": kinks}
    whole = model.reduce(**given)
    monkeypatch.setattr(loop, "STEPS_A_CALL", 20)
    told: list[float] = []
    assert model.reduce(**given, progress=told.append) == whole
    assert len(told) > 50
    assert told == sorted(told)
    assert (told[0] < 0.1, told[-1]) == (True, 1.0)


@pytest.mark.parametrize("more", [{"lanes": False}, {"kinks": "located"}])
def test_members_one_by_one_tell_progress_within_a_turn(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch, more: dict[str, Any]
) -> None:
    """And hear, wherever they are, that their ensemble is to stop."""
    model = press(make_model)
    monkeypatch.setattr(loop, "STEPS_A_CALL", 20)
    run = Stepper.run
    calls: list[Outcome] = []
    begun: list[chunks.Work] = []

    def interrupted(self: Stepper, **given: Any) -> Outcome:
        outcome = run(self, **given)
        calls.append(outcome)
        if len(calls) == 3:
            begun[0].stop.value = 1
        return outcome

    def noted(work: chunks.Work, *given: Any) -> bool:
        begun.append(work)
        return chunks.run_chunks(work, *given)

    monkeypatch.setattr(Stepper, "run", interrupted)
    monkeypatch.setattr("ballpass.runtime.many.ensemble.run_chunks", noted)
    found = model.simulate_many({CLEARANCE: [1e-5, 1.1e-5]}, ["rms:inner.y"], cycles=1, transient=0, threads=1, **more)
    assert [failure.status for failure in found.failures] == ["INTERRUPTED"] * 2
    assert found.failures[0].time == pytest.approx(calls[2].time, rel=1e-12, abs=0.0)
    assert 0.0 < calls[2].time < 0.2 * model.period()
    assert len(calls) == 3


@pytest.mark.long
def test_an_interrupt_is_heard_while_a_run_crawls(make_model: ModelMaker) -> None:
    """Millions of steps a turn, which ended in one call; a process of its own takes the signal."""
    folder = press(make_model).folder
    code = """
        import json, os, signal, sys, threading, time
        from ballpass.runtime import load

        model = load(sys.argv[1])
        stiff = {"bearing.outer_ring.stiffness": 5e15}
        model.reduce(cycles=0.1, transient=0)
        model.locating_stepper  # compiled before it is timed
        sent = []

        def interrupt():
            sent.append(time.process_time())  # of this process: others may keep it from its processor
            os.kill(os.getpid(), signal.SIGINT)

        def waited(run):
            timer = threading.Timer(0.3, interrupt)
            timer.start()
            try:
                done = run()
            except KeyboardInterrupt:
                done = None
            heard = time.process_time() - sent[-1]
            timer.join()
            return heard, done

        found = []
        given = {"cycles": 4, "transient": 0, "method": "stepper-dp54"}
        heard, done = waited(lambda: model.reduce(parameters=stiff, **given))
        found.append((heard, done is None))
        for more in ({"lanes": False}, {"method": "stepper-dop853"}, {"kinks": "located"}):
            asked = [stiff] * 2, ["rms:inner.y"]
            heard, done = waited(lambda: model.simulate_many(*asked, **{**given, **more}))
            found.append((heard, done is not None and done.interrupted))
        print(json.dumps(found))
    """
    command = [sys.executable, "-c", textwrap.dedent(code), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert all(interrupted for _, interrupted in found), found
    assert max(heard for heard, _ in found) < 0.8, found


def test_a_run_that_crawls_is_given_up_by_reduce_where_simulate_gives_it_up(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An explicit method on contacts damped a hundred thousand times too much: hours of steps, however long the run."""
    model = press(make_model)
    monkeypatch.setattr(limits, "STEPS_A_LOOK", 30_000)
    monkeypatch.setattr(loop, "STEPS_A_CALL", 30_000)
    given: dict[str, Any] = {
        "parameters": {"bearing.damping.ratio": 3e5 * model.parameters["bearing.damping.ratio"]},
        "method": "stepper-dp54",
        "transient": 0,
    }
    for cycles in (2, 2000):
        with pytest.raises(IntegrationError) as sampled:
            model.simulate(cycles=cycles, outputs=[], samples_per_cycle=2, **given)
        with pytest.raises(RunFailed) as reduced:
            model.reduce(cycles=cycles, **given)
        assert sampled.value.status is reduced.value.status is Status.TOO_MANY_STEPS
        # calls of 50 000 steps here, of 30 000 there
        assert 0.0 < reduced.value.time < 3.0 * sampled.value.time < 0.1 * model.period()


@pytest.mark.parametrize("rtol", [1e-6, pytest.param(1e-8, marks=pytest.mark.long)])
def test_runs_with_samples_and_with_reductions_have_one_limit(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch, rtol: float
) -> None:
    """Where one finishes the others do: reduced runs, and members in lanes, one by one, and gone on alone."""
    model = press(make_model)
    needed = model.simulate(cycles=2, transient=0, rtol=rtol).statistics
    steps = (needed.steps or 0) + (needed.rejected or 0)
    monkeypatch.setattr(loop, "STEPS_A_CALL", 10)
    for name in ("STEPS_A_TURN", "STEPS_A_SECOND", "BRIEF_A_TURN"):  # what is left is the limit of a run
        monkeypatch.setattr(limits, name, 1)
    monkeypatch.setattr(limits, "LEAST_PROGRESS", 0.0)
    ways: list[Callable[[], object]] = [
        lambda: model.simulate(cycles=2, transient=0, rtol=rtol, method="stepper"),
        lambda: model.reduce(cycles=2, transient=0, rtol=rtol),
        *(
            lambda more=more: model.simulate_many(
                {CLEARANCE: [model.parameters[CLEARANCE]]}, "rms:inner.y", cycles=2, transient=0, rtol=rtol, **more
            )
            for more in ({}, {"lanes": False}, {"kinks": "stepped-over"})
        ),
    ]
    for limit, brief in ((2 * steps, 10**9), (2 * steps, steps // 3), (steps // 2, 10**9)):
        monkeypatch.setattr(limits, "STEPS_A_RUN", limit)
        monkeypatch.setattr(limits, "BRIEF_A_RUN", brief)
        fates = []
        for way in ways:
            try:
                done = way()
            except (IntegrationError, RunFailed) as fault:
                fates.append(fault.status.name)
            else:
                fates.append(next((failure.status for failure in getattr(done, "failures", ())), "DONE"))
        assert fates == ["DONE" if limit > steps else "TOO_MANY_STEPS"] * len(ways)


def test_a_member_that_goes_on_alone_is_the_run_it_was(make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    """State, reductions and counts of its lane are taken along, and its neighbours do not notice."""
    model = press(make_model, "stiff")
    columns = {CLEARANCE: np.array([8e-6, 1e-5, 1.2e-5]), "mechanism.driver.speed": np.array([52.0, 48.0, 25.0])}
    names = ("max:ball.force", "peak_time:ball.force", "min:inner.y", "mean:inner.y", "rms:inner.y", "end:inner.vx")
    given: dict[str, Any] = {"duration": 0.5, "transient": 0.1, "rtol": 1e-6, "method": "stepper-rodas5p"}
    whole = model.simulate_many(columns, names, **given)
    assert whole.failures == ()
    alone = model.simulate_many({name: column[2:] for name, column in columns.items()}, names, **given).statistics
    limit, go_on = limits.brief_limit, RunUnderWay.go_on
    monkeypatch.setattr(
        "ballpass.runtime.many.chunks.brief_limit",
        lambda duration, turn: alone.steps // 2 if turn > 0.2 else limit(duration, turn),
    )
    begun: list[tuple[int, float]] = []

    def noted(self: RunUnderWay) -> None:
        begun.append((self.steps + self.rejected, self.time))
        go_on(self)

    monkeypatch.setattr(RunUnderWay, "go_on", noted)
    found = model.simulate_many(columns, names, **given)
    assert found.failures == ()
    ((steps, time),) = begun
    assert steps == alone.steps // 2
    assert 0.1 < time < 0.4
    assert found.statistics.steps == pytest.approx(whole.statistics.steps, rel=0.02)
    for name in names:
        assert np.array_equal(found[name][:2], whole[name][:2])
        scale = 1.0 if name.startswith("peak_time") else abs(whole[name][2])
        assert found[name][2] == pytest.approx(whole[name][2], abs=2e-4 * scale)
    # behind its lane it takes other steps within the tolerance
    assert found["rms:inner.y"][2] != whole["rms:inner.y"][2]
