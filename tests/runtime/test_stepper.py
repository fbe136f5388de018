"""Claims about the driver of the project's own stepper: breakpoints, samples, phases, statuses, threads, memory."""

from __future__ import annotations

import ctypes
import gc
import resource
import tracemalloc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partialmethod

import numpy as np
import pytest
from stepper_methods import FAMILIES
from stepper_runs import edges_of, run, segments_between

from ballpass.runtime import IntegrationError, Model, RequestError, Status
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.native import stepper as stepping
from ballpass.runtime.native.stepper import End, Segments, Stepper, method_numbers

NAMES = method_numbers()

TURN = 2.0 * np.pi

Make = Callable[..., Model]


@pytest.fixture(scope="module")
def magnitude(press: Model) -> np.ndarray:
    return np.array(press.simulate(0.1).statistics.magnitudes)


# breakpoints


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_run_split_where_the_load_jumps_gives_the_same_bits(press: Model, magnitude: np.ndarray, family: str) -> None:
    numbers = press.numbers()
    edges = edges_of(press, numbers, 0.0, 2 * press.period())
    whole = segments_between(press, numbers, edges)
    tolerance = 1e-7 * magnitude
    at_once = run(press, numbers, whole, method=family, tolerance=tolerance)
    cut = 1 + int(np.flatnonzero(whole.restarts[1:])[1])
    first = Segments(times=edges[: cut + 1], inputs=whole.inputs[:cut], restarts=whole.restarts[:cut])
    second = Segments(times=edges[cut:], inputs=whole.inputs[cut:], restarts=whole.restarts[cut:])
    half = run(press, numbers, first, method=family, tolerance=tolerance)
    rest = run(press, numbers, second, method=family, tolerance=tolerance, start=half.end)
    assert np.array_equal(rest.end, at_once.end)
    assert half.outcome.steps + rest.outcome.steps == at_once.outcome.steps


def test_auto_chooses_anew_where_the_load_jumps(make_model: Make) -> None:
    """A ring falls freely, touches a ball with heavy damping, and is pulled off again.

    Flight is for an explicit method and such contact for a linearly implicit one.  Within a segment `auto` would need a
    dozen steps to see that; where the load jumps it looks at once.  Without a restart it keeps what it has.
    """
    model = make_model(
        "varying_compliance",
        ('speed = "393.1540342298 rpm"', 'speed = "0 rpm"'),
        ("cycles = 24 ", 'duration = "0.02 s" #'),
        ("transient_cycles = 20", "transient_cycles = 0"),
        ('law = "none"  ', 'law = "two-sided-gated"\ncoefficient = "4e5 N*s/m"  '),
        ('damping = "200 N*s/m"  ', '#damping = "0 N*s/m"'),
    )
    numbers = model.numbers({"bearing.clearance": 40e-6})
    flight, touched, brief = 1.5e-3, 2.1e-3, 1e-6
    falling = np.array([0.0, flight, flight + brief, touched, touched + brief])
    whole = segments_between(model, numbers, falling)

    def family_behind(last: int, *, restarts: bool) -> str:
        some = Segments(
            times=falling[: last + 2],
            inputs=whole.inputs[: last + 1],
            restarts=np.array([True] + [restarts] * last),
        )
        return run(model, numbers, some, method="auto", tolerance=np.repeat([1e-9, 1e-6], 2)).outcome.method

    explicit = ("dp54", "dop853")
    assert all(family_behind(k, restarts=True) in explicit for k in range(3))
    assert family_behind(3, restarts=True) == "rodas5p"
    assert family_behind(3, restarts=False) in explicit
    # from the contact, pulled off: the other way round
    start = np.array([20.8e-6, 0.0, -0.02, 0.0])
    off = np.array([0.0, 2e-4, 2e-4 + brief])
    for restarts, expected in ((True, "dp54"), (False, "rodas5p")):
        some = Segments(times=off, inputs=whole.inputs[:2], restarts=np.array([True, restarts]))
        found = run(model, numbers, some, method="auto", tolerance=np.repeat([1e-9, 1e-6], 2), start=start)
        assert found.outcome.method == expected


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_further_edges_change_nothing_and_a_shifted_one_does(press: Model, magnitude: np.ndarray, family: str) -> None:
    numbers = press.numbers()
    edges = edges_of(press, numbers, 0.0, press.period())
    tolerance = 1e-9 * magnitude

    def end(some: np.ndarray, gates: np.ndarray | None = None) -> np.ndarray:
        return run(
            press, numbers, segments_between(press, numbers, some, gates), method=family, tolerance=tolerance
        ).end

    exact = end(edges)
    further = np.unique(np.concatenate([edges, np.random.default_rng(5).uniform(0.0, edges[-1], 37)]))
    assert np.max(np.abs(end(further) - exact) / magnitude) < 2e-5
    # the press lets go a thousandth of a turn late: the driver switches where it is told and nowhere else
    late = edges.copy()
    late[2] += 1e-3 * press.period()
    assert np.max(np.abs(end(late, gates=edges) - exact) / magnitude) > 1e-2


def test_load_switches_exactly_at_the_edge_of_its_window(press: Model) -> None:
    """A window that opens a millionth of a turn later gives a motion that differs in proportion: no step hides it."""
    name = "mechanism.forces.punch.window.end"
    base = press.parameters[name]

    def end(shift: float) -> np.ndarray:
        return press.simulate(
            0.8, parameters={name: base + shift}, method="stepper-dop853", rtol=1e-12, samples_per_cycle=4
        ).x[-1]

    small, large = end(1e-6) - end(0.0), end(4e-6) - end(0.0)
    # the bodies still swing at the end of the run; the response is as linear as a motion with kinks can be
    assert np.linalg.norm(small) > 0.0
    np.testing.assert_allclose(large / np.linalg.norm(large), small / np.linalg.norm(small), atol=0.02)
    np.testing.assert_allclose(np.linalg.norm(large) / np.linalg.norm(small), 4.0, rtol=0.02)


# samples


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_states_do_not_depend_on_how_often_they_are_looked_at(press: Model, magnitude: np.ndarray, family: str) -> None:
    numbers = press.numbers()
    segments = segments_between(press, numbers, edges_of(press, numbers, 0.0, press.period()))
    ends, shared = [], []
    for samples in (100, 20_000):
        times = segments.times[-1] * (np.arange(samples + 1) / samples)
        found = run(press, numbers, segments, method=family, tolerance=1e-6 * magnitude, output_times=times)
        assert found.outcome.written == samples + 1
        assert np.array_equal(found.states[-1], found.end)
        assert np.array_equal(found.states[0], press.initial())
        ends.append(found.end)
        shared.append(found.states[:: samples // 100])
    assert np.array_equal(ends[0], ends[1])
    # the same polynomials, at times that differ in the last bit
    np.testing.assert_allclose(shared[0] / magnitude, shared[1] / magnitude, rtol=0.0, atol=1e-11)


def test_grid_of_samples_does_not_move_the_motion(press: Model, magnitude: np.ndarray) -> None:
    ends = [press.simulate(1, method="stepper", samples_per_cycle=n).x[-1] for n in (1, 3, 7, 64, 333, 2000)]
    for end in ends[1:]:
        assert np.array_equal(end, ends[0])


def test_last_output_is_written_however_the_times_round(rotor: Model) -> None:
    """start + (end - start) misses the end by a bit for many numbers; the output there must not be lost."""
    numbers = rotor.numbers()
    generator = np.random.default_rng(3)
    for _ in range(400):
        end = generator.uniform(1.50e-2, 1.56e-2)
        segments = segments_between(rotor, numbers, np.array([end * generator.uniform(0.3, 0.4), end]))
        family = generator.choice([*FAMILIES.values()])
        found = run(rotor, numbers, segments, method=family, tolerance=np.array([4e-9, 4e-9, 1e-6, 1e-6]))
        assert found.outcome.written == 2
        assert np.array_equal(found.states[-1], found.end)


# phases


# statuses


def limited(monkeypatch: pytest.MonkeyPatch, **options: float) -> None:
    monkeypatch.setattr(Stepper, "run", partialmethod(Stepper.run, **options))


def check_message(error: IntegrationError, samples: int) -> None:
    text = str(error)
    assert error.status.value in text
    assert f"t = {error.time:.9g} s" in text
    assert f"crank angle {np.degrees(error.crank_angle):.4f} deg" in text
    assert "Step size" in text
    partial = error.partial
    assert 0 < len(partial) < samples
    assert partial.t[-1] <= error.time
    assert np.all(np.isfinite(partial.x))
    assert len(partial["ball.force"]) == len(partial)


@pytest.mark.parametrize("method", STEPPERS)
def test_run_of_too_many_steps_tells_and_keeps_its_samples(
    press: Model, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    whole = press.simulate(1, method=method, samples_per_cycle=400)
    monkeypatch.setattr("ballpass.runtime.run.loop.STEPS_A_CALL", 600)
    monkeypatch.setattr("ballpass.runtime.run.limits.step_limit", lambda *_: 600)
    with pytest.raises(IntegrationError, match="600 steps for the first") as caught:
        press.simulate(1, method=method, samples_per_cycle=400)
    assert caught.value.status is Status.TOO_MANY_STEPS
    check_message(caught.value, 401)
    done = len(caught.value.partial)
    assert np.array_equal(caught.value.partial.x, whole.x[:done])


@pytest.mark.parametrize("method", ["stepper-rodas5p", "stepper-dop853"])
def test_tolerance_that_asks_for_smaller_steps_than_allowed_tells_which_state(
    press: Model, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    limited(monkeypatch, smallest_step=5e-6)
    with pytest.raises(IntegrationError) as caught:
        press.simulate(1, method=method, rtol=1e-9, samples_per_cycle=4000)
    assert caught.value.status is Status.STEP_TOO_SMALL
    check_message(caught.value, 4001)
    assert any(f"worst state {state}." in str(caught.value) for state in press.states)


@pytest.mark.parametrize("method", STEPPERS)
def test_motion_that_grows_without_bound_ends_soon_with_a_status(
    rotor: Model, boundless: Callable[[Model], Model], method: str
) -> None:
    """Damping that feeds the motion: error control alone would follow it with ever smaller steps for hours."""
    with pytest.raises(IntegrationError, match="grows without bound") as caught:
        boundless(rotor).simulate(
            4, parameters={"bearing.inner_ring.damping": -1e5}, method=method, samples_per_cycle=2000
        )
    assert caught.value.status is Status.STEP_TOO_SMALL
    check_message(caught.value, 8001)
    # it did grow, and what is kept is from before
    assert np.max(np.abs(caught.value.partial.x[:, 0])) > 1e-3
    assert caught.value.time < 0.1 * rotor.period()


@pytest.mark.parametrize("family", NAMES)
def test_what_is_not_a_number_is_refused_or_reported(rotor: Model, family: str) -> None:
    numbers = rotor.numbers()
    segments = segments_between(rotor, numbers, np.array([0.0, 0.01]))
    tolerance = np.array([4e-12, 4e-12, 1e-9, 1e-9])
    start = rotor.initial()
    start[3] = np.nan
    state = run(rotor, numbers, segments, method=family, tolerance=tolerance, start=start)
    assert (state.outcome.end, state.outcome.steps, state.outcome.written) == (End.NOT_FINITE, 0, 0)
    # finite, but the estimate of the first step overflows
    start[3] = 1e200
    state = run(rotor, numbers, segments, method=family, tolerance=tolerance, start=start, max_steps=1000)
    assert (state.outcome.end, state.outcome.steps, state.outcome.written) == (End.NOT_FINITE, 0, 1)
    for vector in (numbers.p, numbers.c):
        for k in range(len(vector)):
            kept, vector[k] = vector[k], np.nan
            found = run(rotor, numbers, segments, method=family, tolerance=tolerance)
            vector[k] = kept
            # a number the motion does not depend on may be anything
            assert found.outcome.end in (End.NOT_FINITE, End.DONE), (k, found.outcome)
            assert np.all(np.isfinite(found.end))
            if found.outcome.end is End.NOT_FINITE:
                assert found.outcome.time == 0.0
                assert found.outcome.steps == 0


def test_faulty_calls_are_refused(rotor: Model) -> None:
    numbers = rotor.numbers()
    good = segments_between(rotor, numbers, np.array([0.0, 0.005, 0.01]))
    backward = Segments(times=np.array([0.0, 0.01, 0.005]), inputs=good.inputs, restarts=good.restarts)
    missing = Segments(times=np.array([0.0, np.nan, 0.01]), inputs=good.inputs, restarts=good.restarts)
    for segments in (backward, missing):
        found = run(rotor, numbers, segments, method="dp54", tolerance=1e-9)
        assert found.outcome.end is End.BAD_ARGUMENT
        assert np.array_equal(found.end, rotor.initial())
    for nothing in (0.0, -1e-9, np.nan, 1e-320):
        tolerance = np.array([1e-9, 1e-9, nothing, 1e-9])
        for family in NAMES:
            found = run(rotor, numbers, good, method=family, tolerance=tolerance)
            assert found.outcome.end is End.BAD_ARGUMENT
            assert np.array_equal(found.end, rotor.initial())
    limits = [("largest_step", bad) for bad in (0.0, -1e-5, np.nan)]
    limits += [(name, bad) for name in ("first_step", "smallest_step") for bad in (-1e-5, np.nan)]
    for name, bad in limits:
        for family in NAMES:
            found = run(rotor, numbers, good, method=family, tolerance=1e-9, **{name: bad})
            assert found.outcome.end is End.BAD_ARGUMENT, (name, bad)
            assert np.array_equal(found.end, rotor.initial())
    with pytest.raises(RequestError, match="stepper-rodas4"):
        rotor.simulate(1, method="stepper-euler")
    with pytest.raises(ctypes.ArgumentError, match="float64"):
        run(rotor, numbers, Segments(times=np.array([0, 1, 2]), inputs=good.inputs, restarts=good.restarts),
            method="dp54", tolerance=1e-9)  # fmt: skip


@pytest.mark.parametrize("family", NAMES)
def test_output_times_that_no_step_would_reach_are_refused(rotor: Model, family: str) -> None:
    """They are not left out of a run that says it is done."""
    numbers, begin, end = rotor.numbers(), 0.001, 0.01
    segments = segments_between(rotor, numbers, np.array([begin, 0.005, end]))
    for times in (
        [begin, np.nan, end],
        [np.nan],
        [0.002, 0.003, np.nan],
        [0.004, 0.002],
        [begin, end, 0.005],
        [np.nextafter(begin, 0.0), end],
        [begin, np.nextafter(end, 1.0)],
        [-np.inf, 0.002],
        [0.002, np.inf],
    ):
        found = run(rotor, numbers, segments, method=family, tolerance=1e-9, output_times=np.array(times))
        assert found.outcome.end is End.BAD_ARGUMENT, times
        assert (found.outcome.written, found.outcome.steps) == (0, 0)
        assert np.all(np.isnan(found.states))
        assert np.array_equal(found.end, rotor.initial())
    # from the begin to the end, each as often as it is wanted
    times = np.array([begin, begin, 0.004, 0.004, 0.005, end, end])
    found = run(rotor, numbers, segments, method=family, tolerance=1e-9, output_times=times)
    assert (found.outcome.end, found.outcome.written) == (End.DONE, len(times))
    assert np.array_equal(found.states[::6], [rotor.initial(), found.end])
    assert np.array_equal(found.states[[0, 2, 5]], found.states[[1, 3, 6]])


@pytest.mark.parametrize(("segments", "outputs"), [(-1, 0), (-1, 2), (1, -1), (0, 1)])
def test_counts_below_zero_are_refused(rotor: Model, segments: int, outputs: int) -> None:
    """And outputs of a run without segments that its one moment does not have."""
    numbers, x = rotor.numbers(), rotor.initial()
    tolerance, times, states = np.full(4, 1e-9), np.array([0.0, 0.01]), np.full((2, 4), np.nan)
    options = stepping._Options(0, 1000, 0.0, 0.0, np.inf, tolerance.ctypes.data, None)
    result = stepping._Result(status=-1, steps=-1, written=-1)
    inputs, restarts = np.zeros((2, max(len(rotor.manifest.inputs), 1))), np.ones(2, dtype=np.uint8)
    one = np.array([0.005, 0.006])
    end = rotor.stepper._code.ballpass_run(
        *(ctypes.byref(options), numbers.p, numbers.c, x, segments, times, inputs, restarts, outputs, one, states),
        ctypes.byref(result),
    )
    assert (End(end), End(result.status)) == (End.BAD_ARGUMENT, End.BAD_ARGUMENT)
    assert (result.steps, result.written) == (0, 0)
    assert np.array_equal(x, rotor.initial())
    assert np.all(np.isnan(states))


# discontinuous laws


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_law_that_jumps_is_got_through_or_given_up_with_a_status(make_model: Make, family: str) -> None:
    model = make_model(
        "varying_compliance",
        ('law = "none"  ', 'law = "two-sided-gated"\ncoefficient = "2e4 N*s/m"  '),
    )
    numbers = model.numbers({"bearing.clearance": 20e-6})
    segments = segments_between(model, numbers, edges_of(model, numbers, 0.0, model.period()))
    tolerance = np.array([4e-6, 4e-6, 1e-3, 1e-3])
    for rtol in (1e-4, 1e-7, 1e-10):
        found = run(model, numbers, segments, method=family, tolerance=rtol * tolerance, max_steps=2_000_000)
        assert found.outcome.end in (End.DONE, End.STEP_TOO_SMALL)
        assert np.all(np.isfinite(found.end))


# threads and memory


@pytest.mark.long
def test_eight_runs_at_once_give_the_bits_of_one_after_another(press: Model, magnitude: np.ndarray) -> None:
    settings = [
        (press.numbers({"bearing.clearance": 1e-6 * k}), family)
        for k in range(4, 20, 2)
        for family in FAMILIES.values()
    ]

    def one(setting: tuple) -> np.ndarray:  # type: ignore[type-arg]
        numbers, family = setting
        segments = segments_between(press, numbers, edges_of(press, numbers, 0.0, press.period()))
        times = segments.times[-1] * (np.arange(401) / 400)
        return run(press, numbers, segments, method=family, tolerance=1e-6 * magnitude, output_times=times).states

    press.stepper  # noqa: B018  compiled once, before the threads
    serial = [one(setting) for setting in settings]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(one, settings * 3))
    for found, expected in zip(together, serial * 3, strict=True):
        assert np.array_equal(found, expected)


def test_driver_has_no_allocator_to_call(press: Model) -> None:
    code = press.stepper.library.path.read_bytes()
    for name in (b"malloc", b"calloc", b"realloc", b"free", b"alloca", b"fopen", b"printf"):
        assert b"\0" + name + b"\0" not in code
    # names are kept as such: what the driver does call, and offers, is there
    assert b"\0ballpass_run\0" in code
    assert b"\0pow\0" in code


@pytest.mark.long
def test_memory_stays_flat_over_hundreds_of_runs(rotor: Model) -> None:
    numbers = rotor.numbers()
    segments = segments_between(rotor, numbers, np.array([0.0, 0.01]))
    tolerance = np.array([4e-10, 4e-10, 1e-7, 1e-7])

    def runs(count: int) -> None:
        for k in range(count):
            run(rotor, numbers, segments, method=NAMES[k % len(NAMES)], tolerance=tolerance)

    runs(50)
    gc.collect()
    tracemalloc.start()
    before, peak = tracemalloc.get_traced_memory()[0], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    runs(500)
    gc.collect()
    kept = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak
    assert kept < 16_000  # bytes of Python objects: 32 a run
    assert grown < 4096  # KiB of the process


# choice of the family


def test_auto_takes_the_family_that_fits(make_model: Make, press: Model) -> None:
    paper = make_model("punching_press")
    # the paper's damping number read in SI instead of millimetres
    stiff = {"bearing.damping.ratio": paper.parameters["bearing.damping.ratio"] * 10.0**1.5}
    stiff_run = paper.simulate(1, parameters=stiff, method="stepper", rtol=1e-5)
    light_run = press.simulate(1, method="stepper", rtol=1e-5)
    assert "rodas" in stiff_run.statistics.reason
    assert "dp54" in light_run.statistics.reason or "dop853" in light_run.statistics.reason
    forced = paper.simulate(1, parameters=stiff, method="stepper-dp54", rtol=1e-5)
    assert stiff_run.statistics.steps is not None
    assert forced.statistics.steps is not None
    assert forced.statistics.steps > 5 * stiff_run.statistics.steps


def test_loose_runs_held_down_by_stability_go_on_linearly_implicitly(make_model: Make) -> None:
    """Where an explicit step is no longer at a loose tolerance than at a tight one, fewer steps do the same."""
    model = make_model("punching_press")
    exact = model.simulate(1, method="stepper-dop853", rtol=1e-11, samples_per_cycle=250)
    steps, error = {}, {}
    for method in ("stepper", "stepper-dp54"):
        for rtol in (1e-3, 1e-4):
            run = model.simulate(1, method=method, rtol=rtol, samples_per_cycle=250)
            steps[method, rtol] = run.statistics.steps or 0
            error[method, rtol] = float(np.max(np.abs(run.x - exact.x) / exact.statistics.magnitudes))
    assert steps["stepper-dp54", 1e-4] < 1.2 * steps["stepper-dp54", 1e-3], steps
    for rtol in (1e-3, 1e-4):
        assert 0 < steps["stepper", rtol] < 0.7 * steps["stepper-dp54", rtol], steps
        assert error["stepper", rtol] < 2.0 * error["stepper-dp54", rtol], error


def test_accurate_runs_take_the_high_order(press: Model) -> None:
    """Where accuracy asks for steps far below the stability limit, order eight does better with fewer stages.

    In the median of clearances: how steps meet contacts moves the error of one run tenfold, of either method.
    """
    error: dict[str, list[float]] = {"stepper": [], "stepper-dp54": []}
    for clearance in 1e-5 * (1.0 + 1e-3 * np.arange(9)):
        given = {"samples_per_cycle": 250, "parameters": {"bearing.clearance": float(clearance)}}
        exact = press.simulate(1, method="stepper-rodas5p", rtol=1e-12, **given)  # type: ignore[arg-type]
        steps = {}
        for method, found in error.items():
            run = press.simulate(1, method=method, rtol=1e-9, kinks="stepped-over", **given)  # type: ignore[arg-type]
            steps[method] = run.statistics.steps or 0
            found.append(float(np.max(np.abs(run.x - exact.x) / exact.statistics.magnitudes)))
        # a step of order eight has twice the stages
        assert 0 < 2 * steps["stepper"] < steps["stepper-dp54"], steps
    assert np.median(error["stepper"]) < np.median(error["stepper-dp54"]), error


def test_runs_of_engineering_accuracy_stay_with_the_low_order(press: Model) -> None:
    """There work and error are those of Dormand and Prince: order eight takes half as many evaluations again."""
    numbers = press.numbers()
    whole = segments_between(press, numbers, edges_of(press, numbers, 0.0, press.period()))
    exact = press.simulate(1, method="stepper-rodas5p", rtol=1e-12, samples_per_cycle=250)
    tolerance = 1e-5 * np.array(exact.statistics.magnitudes)
    free, forced, high = (
        run(press, numbers, whole, method=family, tolerance=tolerance) for family in ("auto", "dp54", "dop853")
    )
    assert free.outcome.evaluations == pytest.approx(forced.outcome.evaluations, rel=0.05)
    assert high.outcome.evaluations > 1.3 * forced.outcome.evaluations
    errors = [float(np.max(np.abs(one.end - exact.x[-1]))) for one in (free, forced)]
    assert errors[0] < 1.5 * errors[1], errors
