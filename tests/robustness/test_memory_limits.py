"""Claims about requests too large for memory: refused with a remedy, and before there is memory for any of it.

Memory is what `tracemalloc` counts, which numpy tells of every array, also of pages that nobody has touched yet.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, RequestError, load
from ballpass.runtime.quantity.grammar import parse_quantity
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.request import request
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.request.sampling import Sampling
from ballpass.runtime.request.segments import WORK, segment_edges
from ballpass.runtime.run.directions import Directions
from ballpass.runtime.run.trajectory import start_trajectory

SCENES = Path(__file__).resolve().parents[2] / "scenes"

#: That a request may take which is refused [bytes].
NEXT_TO_NOTHING = 100_000_000


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Model:
    text = (SCENES / "punching_press.toml").read_text(encoding="utf-8")
    return load(generate(scene_from_text(text, "press"), tmp_path_factory.mktemp("limits") / "press"))


def two_samples(run: Run) -> Sampling:
    """Both ends of a run."""
    return Sampling(span=run.span, times=np.array([run.begin, run.end]), even=False, outputs=())


def most_memory(call: Callable[[], object]) -> int:
    """Most that a call held at a time [bytes]."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


MANY_TURNS = 3e8

TOO_LARGE: dict[str, tuple[Callable[[Model], object], str]] = {
    "derivatives": (
        lambda model: model.sensitivities(wrt=list(model.parameters), cycles=45, samples_per_cycle=20_000),
        r"900001 samples of derivatives of 8 states by 41 parameters, .* of 768 numbers would not fit into memory\. "
        "Take fewer samples a cycle, a shorter run, or fewer parameters at a time",
    ),
    "segments": (
        lambda model: model.simulate(MANY_TURNS, times=[0.0, MANY_TURNS * model.period()], outputs=[]),
        r"Up to 9\d{8} segments, .* of 11 numbers would not fit into memory\. Take a shorter run, .*Model\.reduce",
    ),
    "segments of a method without a stepper": (
        lambda model: model.simulate(MANY_TURNS, times=[0.0, MANY_TURNS * model.period()], outputs=[], method="cvodes"),
        r"Up to 9\d{8} segments",
    ),
    "segments of a shaft that is fast": (
        lambda model: model.simulate(
            duration=3600.0, times=[0.0, 3600.0], outputs=[], parameters={"mechanism.driver.speed": 1.7e6}
        ),
        r"Up to 29\d{8} segments",
    ),
    "segments of a run to a named error": (
        lambda model: model.simulate(
            MANY_TURNS, times=[0.0, MANY_TURNS * model.period()], outputs=[], error=0.01, of=["peak_ball_force"]
        ),
        r"Up to 9\d{8} segments",
    ),
    "nodes of a quantity": (
        lambda model: model.sensitivity(of=["rms_inner_y"], wrt=list(model.parameters), cycles=100),
        r"\d+ nodes, with states and derivatives by 41 parameters, of 2752 numbers would not fit into memory\. Take a "
        r"shorter run, or fewer parameters",
    ),
    "segments of a quantity": (
        lambda model: model.sensitivity(of=["peak_ball_force"], wrt=["bearing.clearance"], cycles=MANY_TURNS),
        r"Up to 9\d{8} segments",
    ),
}


@pytest.mark.parametrize(
    "name",
    # a hundred turns in debug code
    [pytest.param(name, marks=pytest.mark.long) if name == "nodes of a quantity" else name for name in TOO_LARGE],
)
def test_what_does_not_fit_into_memory_is_refused_before_it_is_asked_for(press: Model, name: str) -> None:
    call, words = TOO_LARGE[name]
    # what is compiled once
    press.sensitivities(wrt=["bearing.clearance"], cycles=0.01, samples_per_cycle=100)

    def refused() -> None:
        with pytest.raises(RequestError, match=words):
            call(press)

    assert most_memory(refused) < NEXT_TO_NOTHING


@pytest.mark.parametrize("speed", [50.0, -3.0])
def test_count_of_segments_is_what_making_them_takes(
    press: Model, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A limit below what a run takes refuses it, one above lets it run: within a tenth."""
    numbers = press.numbers({"mechanism.driver.speed": speed})
    turn = 2.0 * np.pi / abs(speed)
    end = 20_000 * turn
    run = resolve(press, numbers, Request(duration=end, transient_cycles=0.0))
    taken = most_memory(lambda: start_trajectory(run, two_samples(run)))
    count = len(segment_edges(press, numbers, 0.0, end, turn)) - 1
    counted = 8 * count * (len(press.manifest.inputs) + WORK)
    assert 0.9 * counted < taken < 1.1 * counted
    monkeypatch.setattr(request, "MAX_NUMBERS", int(1.001 * counted / 8))
    segment_edges(press, numbers, 0.0, end, turn)
    monkeypatch.setattr(request, "MAX_NUMBERS", int(0.999 * counted / 8))
    with pytest.raises(RequestError, match=r"segments, .* would not fit into memory"):
        segment_edges(press, numbers, 0.0, end, turn)


def test_phases_that_are_cut_short_of_rounding_count(press: Model) -> None:
    """A load that turns a million million times faster than the shaft has a segment for each million radians."""
    fast = press.manifest.turnings[0]
    numbers = press.numbers()
    rate = 1e6 * 2.0**29 / 7.9  # in a second, with eight numbers a segment: just too many
    crowded = replace(numbers, values={**numbers.values, fast.rate: rate})
    with pytest.raises(RequestError, match="segments"):
        segment_edges(press, crowded, 0.0, 1.0, np.inf)


def test_count_of_derivatives_is_what_they_take(press: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = press.numbers()
    names, samples = list(press.parameters), 20_000
    made: list[Directions] = []

    def derivatives() -> None:
        made.append(Directions(press, numbers, names, samples))
        assert made[0].states(samples).shape == (samples, len(press.states), len(names))

    press.sensitivities(wrt=names, cycles=0.01, samples_per_cycle=100)
    taken = most_memory(derivatives)
    lanes = press.differentiating_stepper.lanes
    columns = 2 * len(press.states) * lanes * -(-len(names) // lanes)
    assert 0.9 * 8 * samples * columns < taken < 1.1 * 8 * samples * columns
    monkeypatch.setattr(request, "MAX_NUMBERS", samples * columns)
    Directions(press, numbers, names, samples)
    monkeypatch.setattr(request, "MAX_NUMBERS", samples * columns - 1)
    with pytest.raises(RequestError, match=f"{samples} samples of derivatives .* of {columns} numbers"):
        Directions(press, numbers, names, samples)
    # segments of one call as well: their inputs have derivatives
    monkeypatch.setattr(request, "MAX_NUMBERS", 10 * columns)
    few = Directions(press, numbers, names, 10)
    run = resolve(press, numbers, Request(cycles=1.0, transient_cycles=0.0))
    trajectory = start_trajectory(run, two_samples(run))
    few.tangents(trajectory.segments, 0, 1)
    monkeypatch.setattr(request, "MAX_NUMBERS", lanes * -(-len(names) // lanes))
    with pytest.raises(RequestError, match=r"3 segments in one call, .* fewer parameters"):
        few.tangents(trajectory.segments, 0, 1)


@pytest.mark.parametrize("count", [pytest.param(16, marks=pytest.mark.long), pytest.param(41, marks=pytest.mark.long)])
def test_count_of_nodes_is_what_a_quantity_takes(press: Model, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    names = list(press.parameters)[:count]
    asked = [parse_quantity(press.manifest, "mean:inner.y")]
    quantities = QuantityRun(press, asked, along_nodes=asked)
    run = resolve(press, press.numbers(), Request(cycles=2.0, transient_cycles=0.0, rtol=1e-10, kinks="stepped-over"))
    quantities.differentiate(run, names, 1e-3)  # what is compiled once
    taken = most_memory(lambda: quantities.differentiate(run, names, 1e-3))
    nodes = 4 * quantities.measure(run).steps
    columns = len(press.states) * (16 + 8 * count)
    # the count is that of a whole `Model.sensitivity`, which holds one run while it makes the next
    assert 0.5 * 8 * nodes * columns < taken < 1.1 * 8 * nodes * columns
    monkeypatch.setattr(request, "MAX_NUMBERS", int(0.99 * nodes * columns))
    quantities.measure(run)  # values alone take less
    with pytest.raises(RequestError, match=f"{nodes} nodes, with states and derivatives by {count} parameters"):
        quantities.differentiate(run, names, 1e-3)
    monkeypatch.setattr(request, "MAX_NUMBERS", int(0.99 * nodes * len(press.states) * 16))
    with pytest.raises(RequestError, match=f"{nodes} nodes, with states, of 128 numbers"):
        quantities.measure(run)


def test_a_table_of_more_members_than_fit_is_refused(press: Model) -> None:
    with pytest.raises(RequestError, match=r"10000000 members of \d+ numbers would not fit.*Run the table in parts"):
        press.simulate_many({"bearing.clearance": np.full(10_000_000, 2e-5)}, ["rms:inner.y"])
