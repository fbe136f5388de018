"""Claims about ensembles: members in lanes are single runs, whatever their neighbours, threads and misfortunes."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from dataclasses import replace
from time import monotonic, sleep
from typing import Any, Literal

import numpy as np
import pandas
import pint
import pytest
import xarray
from press_laws import press

from ballpass.runtime import Model, QuantityFunction, RequestError, SimulationError
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.many.ensemble import EnsembleResult
from ballpass.runtime.many.member_segments import moments, stretches
from ballpass.runtime.many.members import Members, Spans, make_members
from ballpass.runtime.native.ensemble_driver import EnsembleDriver, MemberArrays, MemberNumbers
from ballpass.runtime.native.member_schedule import MOMENTS
from ballpass.runtime.native.stepper import End
from ballpass.runtime.request.choose_method import stepper_method
from ballpass.runtime.request.magnitudes import model_scales
from ballpass.runtime.request.resolve import SCALED_TURNS
from ballpass.runtime.request.segments import TURNED, edge_windows, segment_edges
from ballpass.runtime.time import timeline

ModelMaker = Callable[..., Model]
OBSERVABLES = (
    *("max:ball.force", "peak_time:ball.force", "peak_ball:ball.force", "min:inner.y", "mean:ball.deflection"),
    *("rms_inner_y", "range_inner_y", "end:inner.vx", "max:ball.damping_force"),
)


def table(members: int) -> dict[str, np.ndarray]:
    """Members that differ in load, clearance, timing and cage speed."""
    random = np.random.default_rng(20_261_121)
    return {
        "bearing.clearance": 10e-6 * random.uniform(0.5, 2.0, members),
        "mechanism.bodies.slider.mass": 16.8 * random.uniform(0.9, 1.1, members),
        "mechanism.driver.speed": 52.36 * random.uniform(0.8, 1.2, members),
        "mechanism.forces.punch.window.start": np.radians(random.uniform(225.0, 245.0, members)),
        "bearing.ball_diameter": 7.9375e-3 * random.uniform(0.98, 1.02, members),
    }


def member(columns: dict[str, np.ndarray], k: int) -> dict[str, float]:
    return {name: float(column[k]) for name, column in columns.items()}


def same(a: EnsembleResult, b: EnsembleResult, rows: np.ndarray | slice = slice(None)) -> bool:
    """Whether the observables are the same bits, `rows` of `a` against all of `b`."""
    return all(np.array_equal(a[name][rows], b[name], equal_nan=True) for name in b)


@pytest.mark.parametrize(
    ("law", "rtol"),
    [
        pytest.param("stiff", 1e-3, marks=pytest.mark.long),
        pytest.param("stiff", 1e-6, marks=pytest.mark.long),
        ("one-sided", 1e-3),
    ],
)
def test_lanes_take_the_steps_of_single_runs(make_model: ModelMaker, law: str, rtol: float) -> None:
    """Lanes change their family where single runs do, as often, and their step sizes agree."""
    model, columns = press(make_model, law), table(8)
    result = model.simulate_many(columns, ["end:inner.vx"], cycles=1, transient=0, rtol=rtol)
    at: Literal["stepped-over", "located"] = "stepped-over" if rtol > 3e-7 else "located"  # single runs locate
    singles = [model.reduce(1, transient=0, rtol=rtol, parameters=member(columns, k), kinks=at) for k in range(8)]
    assert result.statistics.switches > 0
    assert result.statistics.steps == pytest.approx(sum(single.steps for single in singles), rel=0.01)
    assert result.statistics.rejected == pytest.approx(sum(single.rejected for single in singles), rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("rtol", [1e-8, 1e-10])
def test_members_at_tight_tolerances_are_single_runs(make_model: ModelMaker, rtol: float) -> None:
    """Tangent damping is steep where contact begins: lanes lose hundreds of tolerances there."""
    model, columns = press(make_model, "tangent"), table(3)
    names = ("rms:inner.x", "rms:inner.y", "max:ball.force", "end:inner.vx")
    given = {"cycles": 2, "transient": 1, "rtol": rtol}
    found = model.simulate_many(columns, names, **given)  # type: ignore[arg-type]
    lanes = model.simulate_many(columns, names, kinks="stepped-over", **given)  # type: ignore[arg-type]
    assert found.statistics.kinks == "located"
    astray = []
    for k in range(3):
        single = model.reduce(**given, parameters=member(columns, k))  # type: ignore[arg-type]
        expected = (single["inner.x"].rms, single["inner.y"].rms, single["ball.force"].maximum, single.end["inner.vx"])
        assert [found[name][k] for name in names] == list(expected)
        astray.append(abs(lanes["rms:inner.x"][k] / expected[0] - 1.0))
    assert max(astray) > 100.0 * rtol


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_members_at_loose_tolerances_advance_in_lanes(make_model: ModelMaker, rtol: float) -> None:
    model = press(make_model, "tangent")
    found = model.simulate_many(table(3), ["rms:inner.x"], cycles=1, transient=0, rtol=rtol)
    assert (found.statistics.kinks, found.statistics.lanes) == ("stepped-over", model.ensemble_driver.lanes)


@pytest.mark.long
def test_members_of_smoothed_laws_have_no_kinks_to_locate(make_model: ModelMaker) -> None:
    model = make_model("varying_compliance", ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n'))
    columns = {"bearing.clearance": [5e-6, 1e-5]}
    located = model.simulate_many(columns, ["rms:inner.y"], cycles=1, transient=0, kinks="located")
    assert same(located, model.simulate_many(columns, ["rms:inner.y"], cycles=1, transient=0, lanes=False))


def test_results_are_the_same_bits_for_any_number_of_threads(make_model: ModelMaker) -> None:
    model, columns = press(make_model), table(150)
    results = [
        model.simulate_many(columns, OBSERVABLES, cycles=1, transient=0.5, threads=threads) for threads in (1, 2, 5)
    ]
    assert results[0].statistics.chunk < 150
    assert same(results[0], results[1])
    assert same(results[0], results[2])


@pytest.mark.parametrize("law", ["one-sided", pytest.param("stiff", marks=pytest.mark.long)])
def test_a_member_does_not_depend_on_its_neighbours(make_model: ModelMaker, law: str) -> None:
    model, columns = press(make_model, law), table(40)
    whole = model.simulate_many(columns, OBSERVABLES, cycles=1, transient=0.5)
    order = np.random.default_rng(7).permutation(40)[:13]
    some = {name: column[order] for name, column in columns.items()}
    assert same(whole, model.simulate_many(some, OBSERVABLES, cycles=1, transient=0.5), order)
    alone = {name: column[:1] for name, column in columns.items()}
    assert same(whole, model.simulate_many(alone, OBSERVABLES, cycles=1, transient=0.5), slice(1))


def test_one_failing_member_is_reported_and_the_rest_is_untouched(
    make_model: ModelMaker, boundless: Callable[[Model], Model]
) -> None:
    model, columns = boundless(press(make_model)), table(20)
    columns["bearing.outer_ring.stiffness"] = np.full(20, 5e7)
    good = model.simulate_many(columns, OBSERVABLES, cycles=1, transient=0.5)
    columns["bearing.outer_ring.stiffness"][3] = -1e13  # pushes itself away
    length = next(name for name in model.parameters if name.startswith("mechanism.bodies.rod.points.C"))
    columns[length] = np.full(20, 0.1)
    columns[length][7] = 0.004  # shorter than the crank
    bad = model.simulate_many(columns, OBSERVABLES, cycles=1, transient=0.5)
    assert [failure.member for failure in bad.failures] == [3, 7]
    assert bad.failures[0].status in ("TOO_MANY_STEPS", "STEP_TOO_SMALL", "NOT_FINITE")
    assert 0.0 < bad.failures[0].time < 0.12
    assert bad.failures[1].status == "REFUSED"
    assert "cannot be assembled" in bad.failures[1].message
    for name in OBSERVABLES:
        assert np.flatnonzero(np.isnan(bad[name])).tolist() == [3, 7]
    rest = [k for k in range(20) if k not in (3, 7)]
    assert all(np.array_equal(good[name][rest], bad[name][rest]) for name in OBSERVABLES)


@pytest.mark.parametrize(
    "absurd",
    [
        {"bearing.initial.inner_velocity.y": 1e200},
        {"bearing.outer_ring.damping": -1e5},
        {"bearing.outer_ring.stiffness": -1e13},
    ],
    ids=["fast", "driven", "pushed"],
)
@pytest.mark.parametrize("method", ["auto", "stepper-dp54", "stepper-rodas5p"])
def test_an_absurd_member_ends_soon_and_as_a_single_run_does(
    make_model: ModelMaker, boundless: Callable[[Model], Model], absurd: dict[str, float], method: str
) -> None:
    """What grows without bound ends where the tolerance falls below rounding, after as many steps as by itself."""
    model = boundless(press(make_model))
    good = {name: model.parameters[name] for name in absurd}
    result = model.simulate_many([good, absurd, good], ["end:inner.y"], cycles=1, transient=0, method=method)
    (failure,) = result.failures
    with pytest.raises(SimulationError) as single:
        model.reduce(cycles=1, transient=0, method=method, parameters=absurd)
    assert failure.member == 1
    assert failure.status == single.value.status.name
    assert failure.time == pytest.approx(single.value.time, rel=0.02, abs=1e-9)
    assert result.statistics.steps < 200_000
    assert np.isfinite(result["end:inner.y"][[0, 2]]).all()


def test_an_interrupt_keeps_the_members_finished_by_then(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, columns = press(make_model), table(400)
    whole = model.simulate_many(columns, ["max:ball.force"], cycles=1, transient=0)
    calls, run = [], EnsembleDriver.run

    def waiting(*given: Any, **more: Any) -> np.ndarray:
        """The third chunk waits to be stopped, so that two are finished by then on any machine."""
        calls.append(1)
        patience = monotonic() + 120.0
        while len(calls) == 3 and not given[6].value and monotonic() < patience:
            sleep(0.001)
        return run(*given, **more)

    def interrupt(fraction: float) -> None:
        if fraction > 0.1:
            raise KeyboardInterrupt

    monkeypatch.setattr(EnsembleDriver, "run", waiting)
    part = model.simulate_many(columns, ["max:ball.force"], cycles=1, transient=0, threads=1, progress=interrupt)
    assert part.interrupted
    lost = [failure.member for failure in part.failures]
    assert {failure.status for failure in part.failures} == {"INTERRUPTED"}
    kept = [k for k in range(400) if k not in lost]
    assert 0 < len(kept) < 400
    assert np.array_equal(part["max:ball.force"][kept], whole["max:ball.force"][kept])
    assert np.all(np.isnan(part["max:ball.force"][lost]))


def test_an_error_in_the_callers_progress_is_the_callers(make_model: ModelMaker) -> None:
    def fail(_: float) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        press(make_model).simulate_many(table(60), ["max:ball.force"], cycles=1, transient=0, progress=fail)


def test_tables_of_three_forms_are_one_ensemble(make_model: ModelMaker) -> None:
    model, columns = press(make_model), table(9)
    a = model.simulate_many(columns, OBSERVABLES, cycles=1, transient=0)
    b = model.simulate_many([member(columns, k) for k in range(9)], OBSERVABLES, cycles=1, transient=0)
    fields = np.rec.fromarrays(list(columns.values()), dtype=[(name, float) for name in columns])
    c = model.simulate_many(np.asarray(fields), OBSERVABLES, cycles=1, transient=0)
    assert same(a, b)
    assert same(a, c)
    missing = [{"bearing.clearance": 9e-6}, {}]
    d = model.simulate_many(missing, ["max:ball.force"], cycles=1, transient=0)
    default = model.parameters["bearing.clearance"]
    e = model.simulate_many({"bearing.clearance": [9e-6, default]}, ["max:ball.force"], cycles=1, transient=0)
    assert same(d, e)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"bearing.clearence": [1e-5]}, "Did you mean 'bearing.clearance'"),
        ({"bearing.clearance": [1e-5, math.nan, 1e-5]}, "member 1 has nan"),
        ({"bearing.clearance": [1e-5, 2e-5], "bearing.ball_diameter": [8e-3]}, "of one length"),
        ({"bearing.clearance": 1e-5}, "one number for each member"),
        ({"bearing.clearance": ["thick"]}, "numbers are expected"),
        ({"bearing.clearance": []}, "no members"),
        ({}, "no parameter is named"),
        ([], "list of mappings"),
        (np.zeros(3), "named fields"),
    ],
)
def test_wrong_tables_are_refused_before_anything_runs(
    make_model: ModelMaker, columns: dict[str, list[float]], message: str
) -> None:
    with pytest.raises(RequestError, match=message):
        press(make_model).simulate_many(columns, ["max:ball.force"], cycles=1, transient=0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observables": ["max:ball.forces"]}, "Did you mean 'ball.force'"),
        ({"observables": ["value:ball.force"]}, "after @ a crank angle"),
        ({"observables": []}, "one name or more"),
        ({"threads": 0}, "threads"),
        ({"transient": 1}, "nothing is left"),
        ({"duration": 1.0}, "give one"),
        ({"method": "cvodes"}, "stepper-dp54"),
        ({"rtol": 1.0}, "rtol"),
        ({"kinks": "locate"}, "Did you mean 'located'"),
        ({"kinks": "located", "method": "cvodes"}, "stepper-dp54"),
    ],
)
def test_wrong_requests_are_refused_with_a_remedy(
    make_model: ModelMaker, changes: dict[str, object], message: str
) -> None:
    request: dict[str, object] = {"observables": ["max:ball.force"], "cycles": 1, "transient": 0, **changes}
    with pytest.raises(RequestError, match=message):
        press(make_model).simulate_many({"bearing.clearance": [1e-5]}, **request)  # type: ignore[arg-type]


def test_the_dataset_carries_parameters_and_units(make_model: ModelMaker) -> None:
    columns = table(5)
    data = press(make_model).simulate_many(columns, OBSERVABLES, cycles=1, transient=0).to_xarray()
    assert data["max:ball.force"].dims == ("member",)
    assert data["max:ball.force"].attrs["units"] == "N"
    assert data["peak_time:ball.force"].attrs["units"] == "s"
    assert np.array_equal(data["bearing.clearance"], columns["bearing.clearance"])
    assert data["bearing.clearance"].attrs["units"] == "m"


@pytest.mark.long
def test_magnitudes_in_c_are_those_of_single_runs(make_model: ModelMaker) -> None:
    for model in (press(make_model), make_model("varying_compliance"), make_model("offset_slider")):
        count = 6
        clearance = np.linspace(4e-6, 3e-5, count)
        members = make_members(model, {"bearing.clearance": clearance})
        numbers = [members.numbers(model, k) for k in range(count)]
        turns = np.array([timeline.stretch(model.manifest, n.values) for n in numbers])
        span = Spans(durations=2 * turns, turns=turns, starts=np.zeros(count))
        looked_at = moments(model, members, span, np.arange(count))
        found = model.ensemble_driver.magnitudes(MemberNumbers(p=members.p, c=members.c), members.initial, *looked_at)
        expected = [
            model_scales(model, n, start, 2 * turn, turn).magnitude
            for n, start, turn in zip(numbers, members.initial, turns, strict=True)
        ]
        np.testing.assert_allclose(found, expected, rtol=1e-4)


LOAD = (
    'type = "constant"                       # or "harmonic" (mean, amplitude, frequency, phase), '
    'or "table" (time, x, y)\n'
)
TABLE = (
    'type = "table"\ntime = ["0 s", "0.02 s", "0.05 s"]\nx = ["0 N", "196 N", "100 N"]\ny = ["0 N", "0 N", "50 N"]\n'
)


@pytest.mark.long
def test_loads_from_tables_run_in_ensembles(make_model: ModelMaker) -> None:
    model = make_model("varying_compliance", (LOAD, TABLE), ('force = ["196 N", "0 N"] ', ""))
    times = next(name for name in model.parameters if "time" in name and name.endswith("2"))
    columns = {times: np.array([0.01, 0.02, 0.03]), "bearing.clearance": np.array([0.0, 1e-6, 2e-6])}
    members = make_members(model, columns)
    turns = np.array([timeline.stretch(model.manifest, members.numbers(model, k).values) for k in range(3)])
    for start in (0.0, 0.005, 0.02):
        assert_segments_of_one(model, members, Spans(durations=np.full(3, 0.1), turns=turns, starts=np.full(3, start)))
    result = model.simulate_many(columns, ["rms:inner.x"], duration=0.1, transient=0, rtol=1e-9)
    for k in range(3):
        single = model.reduce(duration=0.1, transient=0, rtol=1e-9, parameters=member(columns, k))
        assert result["rms:inner.x"][k] == pytest.approx(single["inner.x"].rms, rel=1e-6, abs=0.0)
    # knots that do not increase are one member's fault
    columns[times][1] = 0.06
    result = model.simulate_many(columns, ["rms:inner.x"], duration=0.1, transient=0, rtol=1e-9)
    assert [failure.member for failure in result.failures] == [1]
    assert "must increase" in result.failures[0].message


def test_a_member_that_stands_still_is_refused_alone(make_model: ModelMaker) -> None:
    model = press(make_model)
    speeds = {"mechanism.driver.speed": [50.0, 0.0, -50.0]}
    result = model.simulate_many(speeds, ["max:ball.force"], cycles=1, transient=0)
    assert [failure.member for failure in result.failures] == [1]
    assert "nothing turns" in result.failures[0].message
    assert np.isfinite(result["max:ball.force"][[0, 2]]).all()


def test_inputs_made_for_many_are_those_made_for_one(make_model: ModelMaker) -> None:
    model, count = press(make_model), 5
    columns = table(count) | {"mechanism.forces.punch.window.end": np.radians([267.0, 200.0, 267.0, 590.0, 700.0])}
    members = make_members(model, columns)
    random = np.random.default_rng(3)
    owner = random.integers(0, count, 400)
    times = random.uniform(0.0, 1.0, 400)
    schedule = model.ensemble_driver.schedule
    found = schedule.inputs(np.hstack([members.p, members.c]), owner, times, times + 1e-4)
    for row, (k, time) in enumerate(zip(owner, times, strict=True)):
        values = members.numbers(model, int(k)).values
        assert np.array_equal(found[row], timeline.inputs_at(model.manifest, values, time, time + 1e-4))


def assert_segments_of_one(model: Model, members: Members, span: Spans) -> None:
    """Segments and moments made for many members at once are the bits of those made for each by itself."""
    count, inputs = len(members), model.manifest.inputs
    parts = list(stretches(model, members, span, np.arange(count)))
    first, looked_at, horizons = moments(model, members, span, np.arange(count))
    for k in range(count):
        numbers = members.numbers(model, k)
        duration, turn, start = (float(values[k]) for values in (span.durations, span.turns, span.starts))
        windows = list(edge_windows(model, numbers, duration, turn, start))
        edges = np.concatenate([windows[0], *(window[1:] for window in windows[1:])])
        own = [(part, int(part.first[k]), int(part.first[k + 1])) for part in parts]
        times = [part.times[a + k : b + k + 1] for part, a, b in own]
        assert np.array_equal(np.concatenate([times[0], *(some[1:] for some in times[1:])]), edges), k
        middles = 0.5 * (edges[:-1] + edges[1:])
        expected = timeline.inputs_over(model.manifest, numbers.values, edges[:-1], middles)
        assert np.array_equal(np.concatenate([part.inputs[a:b] for part, a, b in own]), expected), k
        gates = [place for place, info in enumerate(inputs) if info.kind not in TURNED]
        jumps = [True, *np.any(np.diff(expected[:, gates], axis=0) != 0.0, axis=1)]
        assert np.array_equal(np.concatenate([part.restarts[a:b] for part, a, b in own]), jumps), k
        edges = segment_edges(model, numbers, 0.0, min(duration, SCALED_TURNS * turn), turn)
        middles = 0.5 * (edges[:-1] + edges[1:])
        looked = np.unique(np.linspace(0, len(middles) - 1, MOMENTS).astype(int))
        at = np.concatenate([middles[looked], min(duration, turn) * (np.arange(MOMENTS) + 0.5) / MOMENTS])
        expected = timeline.inputs_over(model.manifest, numbers.values, at, at)
        assert np.array_equal(looked_at[first[k] : first[k + 1]], expected), k
        assert horizons[k] == min(duration, turn)


@pytest.mark.parametrize(
    ("turns", "transient"), [(2.0, 1.0), (1.0, 0.0), (3.3, 0.7), (2.0, 1e-12), (70.0, 3.0), (1e-9, 0.0)]
)
def test_segments_made_for_many_are_those_made_for_one(make_model: ModelMaker, turns: float, transient: float) -> None:
    model, count = press(make_model), 12
    columns = table(count)
    begin = model.parameters["mechanism.forces.punch.window.start"]
    here = model.parameters["mechanism.driver.start_angle"]
    # where the punch's window begins or ends: at the run's start, close to it, all around, nowhere
    columns["mechanism.forces.punch.window.start"][:7] = [
        here,
        here + 1e-10,
        here - 3e-13,
        begin,
        begin,
        0.0,
        here + 1.0,
    ]
    columns["mechanism.forces.punch.window.end"] = np.full(count, begin + 0.5)
    columns["mechanism.forces.punch.window.end"][3:7] = [begin, begin + 7.0, here, here]
    columns["mechanism.driver.speed"][8:10] *= -1.0
    members = make_members(model, columns)
    length = 2.0 * math.pi / np.abs(columns["mechanism.driver.speed"])
    assert_segments_of_one(model, members, Spans(durations=turns * length, turns=length, starts=transient * length))


@pytest.mark.long
def test_segments_of_fast_loads_on_slow_shafts_are_those_made_for_one(make_model: ModelMaker) -> None:
    """Where a phase gets large within a turn, the turn is cut."""
    wave = (
        'type = "harmonic"\nmean = ["0 N", "0 N"]\namplitude = ["1 N", "0 N"]\nfrequency = "50 Hz"\nphase = "0 deg"\n'
    )
    model = make_model("varying_compliance", (LOAD, wave), ('force = ["196 N", "0 N"] ', ""))
    fast = next(name for name in model.parameters if name.endswith("frequency"))
    members = make_members(model, {fast: np.array([50.0, 1e7, 3e7])})
    turns = np.array([timeline.stretch(model.manifest, members.numbers(model, k).values) for k in range(3)])
    span = Spans(durations=2.0 * turns, turns=turns, starts=turns)
    assert_segments_of_one(model, members, span)
    (whole,) = stretches(model, members, span, np.arange(3))
    assert len(np.unique(np.diff(whole.first))) == 3


def test_one_observable_is_named_like_several(make_model: ModelMaker) -> None:
    model, columns = press(make_model), table(3)
    one = model.simulate_many(columns, "peak_ball_force", cycles=1, transient=0)
    several = model.simulate_many(columns, ["peak_ball_force"], cycles=1, transient=0)
    assert list(one) == ["peak_ball_force"]
    assert same(one, several)
    assert "\n" not in repr(one)
    assert "3 members" in repr(one)
    assert f"{one['peak_ball_force'].max():.6g}" in str(one)


def test_a_wrong_table_is_told_before_anything_is_compiled(
    make_model: ModelMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    def compiled(self: Model) -> None:
        raise AssertionError("compiled before the table was read")

    monkeypatch.setattr(Model, "ensemble_driver", property(compiled))
    with pytest.raises(RequestError, match="finite number"):
        press(make_model).simulate_many({"bearing.clearance": [math.nan]}, ["peak_ball_force"])


@pytest.mark.parametrize("method", ["auto", "stepper-dp54", "stepper-rodas5p"])
def test_members_with_faulty_numbers_are_refused_each_and_the_others_are_untouched(
    make_model: ModelMaker, method: str
) -> None:
    """The driver looks at tolerances and segments as that of single runs does: no member begins that could not end."""
    model = make_model("varying_compliance")
    driver, family = model.ensemble_driver, STEPPERS[stepper_method(method)]
    faults = [0.0, -1e-9, np.nan, 1e-320, 1e-9, 1e-9, 1e-9]
    count = len(faults)
    members = make_members(model, {"bearing.clearance": np.linspace(0.0, 2e-5, count)})
    turns = np.full(count, model.period())
    span = Spans(durations=0.2 * turns, turns=turns, starts=np.zeros(count))
    (good,) = stretches(model, members, span, np.arange(count))
    tolerance = 1e-6 * driver.magnitudes(good, members.initial, *moments(model, members, span, np.arange(count)))

    def ends(arrays: MemberArrays, allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = members.initial.copy()
        results = driver.run(family, arrays, x, allowed, None, ctypes.c_int(0))
        return np.array([End(status) for status in results["status"]]), x

    status, reached = ends(good, tolerance)
    assert np.all(status == End.DONE)
    for state in range(tolerance.shape[1]):
        wrong = tolerance.copy()
        wrong[:4, state] = faults[:4]
        status, x = ends(good, wrong)
        assert np.all(status[:4] == End.BAD_ARGUMENT)
        assert np.array_equal(x[:4], members.initial[:4])
        assert np.all(status[4:] == End.DONE)
        assert np.array_equal(x[4:], reached[4:])
    # the last member would have fewer than no segments
    first = good.first.copy()
    first[-1] = first[-2] - 1
    status, x = ends(replace(good, first=first), tolerance)
    assert status[-1] == End.BAD_ARGUMENT
    assert np.array_equal(x[-1], members.initial[-1])
    assert np.all(status[:-1] == End.DONE)
    assert np.array_equal(x[:-1], reached[:-1])


def test_values_that_say_another_unit_are_refused(make_model: Callable[..., Model]) -> None:
    """An array of xarray in rpm was taken for rad/s: 6726 N where 4418 N are right."""
    model, name, unit = make_model("varying_compliance"), "shaft.speed", pint.UnitRegistry()
    plain = model.simulate_many({name: [41.0, 42.0]}, "rms:inner.y", cycles=22)["rms:inner.y"]
    right = (
        xarray.DataArray([41.0, 42.0], attrs={"units": "rad/s"}),
        np.array([41.0, 42.0]) * unit.rad / unit.s,
        xarray.DataArray([41.0, 42.0]),
    )
    tables: list[Any] = [{name: column} for column in right] + [pandas.DataFrame({name: [41.0, 42.0]})]
    for table in tables:
        np.testing.assert_array_equal(model.simulate_many(table, "rms:inner.y", cycles=22)["rms:inner.y"], plain)
    for column in (xarray.DataArray([392.0], attrs={"units": "rpm"}), np.array([392.0]) * unit.rpm):
        with pytest.raises(RequestError, match=r"shaft\.speed: values in rpm were given.*values in rad/s"):
            model.simulate_many({name: column}, "rms:inner.y", cycles=22)
    speed, other = xarray.DataArray(392.0, attrs={"units": "rpm"}), "bearing.clearance"
    function = QuantityFunction(model, "rms:inner.y", [name], cycles=22)
    calls: tuple[Callable[[], object], ...] = (
        lambda: model.simulate(cycles=1, transient=0, parameters={name: speed}),
        lambda: model.quantities("rms:inner.y", parameters={name: 392.0 * unit.rpm}),
        lambda: function(xarray.DataArray([392.0], attrs={"units": "rpm"})),
        lambda: function.jacobian(np.array([392.0]) * unit.rpm),
        lambda: function.certify({name: speed}),
        lambda: model.fit({"time": np.arange(9.0), "inner.y": np.arange(9.0), name: speed}, f"{other}=1 um:2 um"),
    )
    for call in calls:
        with pytest.raises(RequestError, match=r"values in rpm were given.*values in rad/s"):
            call()
    mixed = QuantityFunction(model, "rms:inner.y", [name, other], cycles=22)
    with pytest.raises(RequestError, match="values in rpm were given"):
        mixed(xarray.DataArray([392.0, 1e-5], attrs={"units": "rpm"}))
    with pytest.raises(RequestError, match=r"times: values in ms were given.*values in s"):
        model.simulate(times=xarray.DataArray([1.0, 2.0], attrs={"units": "ms"}))
