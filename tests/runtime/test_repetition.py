"""When a machine repeats, against a search over its inputs: random turnings, tables over angles and rows over time."""

from __future__ import annotations

import math
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ballpass.runtime.contract.manifest import InputInfo, TurningInfo
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.turning import TURN

SEEDS = range(25)


def manifest_of(turnings: list[TurningInfo], inputs: list[InputInfo]) -> Any:
    """What `Repetition` reads of a manifest."""
    return SimpleNamespace(inputs=inputs, turnings=turnings, mechanism=None, bearing=None, bearings=())


def table_over_turns(rng: np.random.Generator, turns: int, alike: int) -> tuple[InputInfo, dict[str, float]]:
    """A table over so many turns, made of one of its parts that is `alike` turns long."""
    angles = np.sort(rng.uniform(0.0, alike * TURN, 5))
    heights = rng.integers(-3, 4, 5) + np.array([0.0, 0.5, 0.25, 0.125, 0.0625])
    whole = np.concatenate([angles + k * alike * TURN for k in range(turns // alike)])
    names = tuple(f"{k}" for k in range(len(whole)))
    item = InputInfo(
        name="table",
        kind="table",
        turning="driver",
        turns=turns,
        times=tuple(f"a{n}" for n in names),
        values=tuple(f"h{n}" for n in names),
    )
    values = dict(zip(item.times, whole.tolist(), strict=True))
    return item, values | dict(zip(item.values, np.tile(heights, turns // alike).tolist(), strict=True))


def rows(rng: np.random.Generator, key: str, levels: np.ndarray) -> tuple[dict[str, float], tuple[str, ...], Any]:
    times = np.cumsum(rng.uniform(0.2, 1.0, len(levels)))
    names = tuple(f"t{key}{k}" for k in range(len(levels))), tuple(f"{key}{k}" for k in range(len(levels)))
    found = dict(zip(names[0], times.tolist(), strict=True)) | dict(zip(names[1], levels.tolist(), strict=True))
    return found, *names


@pytest.mark.parametrize("seed", SEEDS)
def test_turns_and_settling_are_those_of_a_search_over_the_inputs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turns = int(rng.integers(1, 7))
    alike = int(rng.choice([n for n in range(1, turns + 1) if turns % n == 0]))
    table, values = table_over_turns(rng, turns, alike)
    # rows of equal level are no rows, at the end of a table above all
    speeds, speed_times, speed_names = rows(rng, "v", rng.choice([3.0, 5.0, 5.0, -4.0], 4))
    forces, force_times, force_names = rows(rng, "f", rng.choice([1.0, 2.0, 2.0], 5))
    driver = TurningInfo(
        name="driver", kind="driver", words="", offset="start", rate="v0", turns="one", times=speed_times,
        speeds=speed_names,
    )  # fmt: skip
    force = InputInfo(name="force", kind="table", times=force_times, values=force_names)
    values |= speeds | forces | {"start": float(rng.uniform(0.0, TURN)), "one": 1.0}
    manifest = manifest_of([driver], [table, force])
    repetition = Repetition.of(manifest, values)

    def acts(t: np.ndarray) -> np.ndarray:
        rate = timeline.driver(manifest, values).at(t)[1]
        return np.column_stack([timeline.inputs_over(manifest, values, t, t, [force]), rate])

    dense = np.linspace(-0.5, 6.5, 20001)
    moved = np.flatnonzero(np.any(np.abs(np.diff(acts(dense), axis=0)) > 1e-12, axis=1))
    last = dense[moved[-1] + 1] if moved.size else -math.inf
    assert repetition.settled_after == pytest.approx(last, abs=2.0 * (dense[1] - dense[0]))

    begin = repetition.alike_from
    assert begin >= max(repetition.settled_after, 0.0)
    turning, turn = timeline.driver(manifest, values), repetition.turn
    assert turn == pytest.approx(TURN / abs(speeds[speed_names[-1]]))
    assert repetition.settled_after <= 0.0 or math.remainder(
        turning.at(begin)[0] - values["start"], alike * TURN
    ) == pytest.approx(0.0, abs=1e-9)
    t = begin + turn * rng.uniform(0.0, turns, 60)
    now = timeline.inputs_over(manifest, values, t, t)
    searched = next(
        n
        for n in range(1, turns + 1)
        if np.allclose(now, timeline.inputs_over(manifest, values, t + n * turn, t + n * turn), rtol=0.0, atol=1e-6)
    )
    assert (repetition.turns, searched) == (alike, alike)
    assert [repetition.whole(n) for n in (1, alike, alike + 1)] == [alike, alike, 2 * alike if alike > 1 else 2]
    assert repetition.holds(begin)
    assert repetition.holds(0.0) is (repetition.settled_after <= 0.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_period_is_the_shortest_of_a_search(seed: int) -> None:
    """The least time, in parts of the first turning, after which each has made whole parts."""
    rng = np.random.default_rng(seed)
    infos = [
        TurningInfo(name=f"{k}", kind="load", words="", offset="", rate=f"r{k}", parts=int(rng.integers(1, 5)))
        for k in range(3)
    ]
    ratios = [Fraction(1), *(Fraction(int(rng.integers(1, 9)), int(rng.integers(1, 9))) for _ in infos[1:])]
    speed = float(rng.uniform(10.0, 400.0))
    values = {info.rate: speed * float(ratio) for info, ratio in zip(infos, ratios, strict=True)}
    found = Repetition.of(manifest_of(infos, []), values).period(infos)
    base = Fraction(1, infos[0].parts)
    searched = next(
        n * base
        for n in range(1, 10_000)
        if all((n * base * ratio * info.parts).denominator == 1 for info, ratio in zip(infos, ratios, strict=True))
    )
    assert found == {info: searched * ratio for info, ratio in zip(infos, ratios, strict=True)}

    lost = {**values, infos[2].rate: values[infos[2].rate] * math.sqrt(2.0)}
    apart = Repetition.of(manifest_of(infos, []), lost).period(infos)
    assert [turns is None for turns in apart.values()] == [False, False, True]


@pytest.mark.parametrize("seed", SEEDS)
def test_after_a_beat_and_not_before_two_loads_are_in_step_again(seed: int) -> None:
    rng = np.random.default_rng(seed)
    infos = [
        TurningInfo(name=name, kind="load", words=f"load {name}", offset=f"{name}.phase", rate=f"{name}.rate")
        for name in ("one", "two")
    ]
    other, detuned = float(rng.uniform(50.0, 80.0)), float(rng.uniform(1e-3, 1e-2))
    multiple = int(rng.integers(1, 4))
    values = {
        "speed": 0.3,
        "one.rate": other,
        "two.rate": (multiple + detuned) * other,
        "one.phase": 0.0,
        "two.phase": 0.0,
    }
    driver = TurningInfo(name="driver", kind="driver", words="", offset="", rate="speed", speeds=("speed",))
    beats = list(Repetition.of(manifest_of([driver, *infos], []), values).beats())
    (slow,) = [beat for beat in beats if beat.words == "load two with load one" and beat.period > 30.0 * TURN / other]
    assert slow.period == pytest.approx(TURN / (detuned * other))
    times = np.linspace(0.0, slow.period, 1001)
    lead = (values["two.rate"] - multiple * other) * times
    in_step = times[np.cos(lead) > 1.0 - 1e-9]
    np.testing.assert_allclose(in_step, [0.0, slow.period], atol=slow.period / 1000.0)
    assert slow.half == {"two.phase": math.pi}
