"""Claims about lanes: a member of an ensemble is its single run to the last bit, in states and in all that is reduced."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from parts import PARTS, Part, press, shipped

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.contract.method_registry import METHODS
from ballpass.runtime.native.reduction_rows import BALL_CHANNELS
from ballpass.runtime.ratings.readings import KINDS as LIVES

#: What is reduced of a channel.
KINDS = ("max", "min", "peak_time", "min_time", "peak_ball", "mean", "rms")
METHODS_OF_RUNS = tuple(f"stepper-{name}" for name in METHODS)

FORTY_ROLLERS = shipped(
    "varying_compliance",
    ("[bearing]\n", '[bearing]\nelement = "cylindrical-roller"\n'),
    ("balls = 8", "balls = 40"),
    ('"33.5 mm"', '"110 mm"'),
    ('stiffness = "13.34e9 N/m^1.5"', 'length = "8 mm"\nyoung_modulus = "207 GPa"\npoisson_ratio = 0.3'),
    ('law = "none"', 'law = "tangent"\nratio = "0.25e-5 s"'),
)


def bearings_in_a_row(count: int) -> str:
    """So many bearings on the press's crank pin, with five to ten balls each, that share the load."""
    text = press("one-sided", 'coefficient = "683 N*s/m"', ("share = 0.5", f"share = {1.0 / count}"))
    start, end = (text.index(mark) for mark in ("[bearing]", "[run]"))
    of = text[start:end]
    named = [
        re.sub(r"^\[bearing(?=[.\]])", f"[bearings.b{k}", of.replace("balls = 8", f"balls = {5 + k % 6}"), flags=re.M)
        for k in range(count)
    ]
    return text[:start] + "".join(named) + re.sub(r"outputs = \[.*?\]", "outputs = []", text[end:], flags=re.S)


@pytest.fixture(scope="module")
def model_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Model]:
    def make(text: str) -> Model:
        folder: Path = tmp_path_factory.mktemp("lanes") / "scene"
        return load(generate(scene_from_text(text, "scene"), folder))

    return make


def observables(model: Model) -> list[str]:
    """All that lanes reduce: states, the channels of the balls of each bearing, its lives."""
    states, bearings = [state.name for state in model.manifest.states], model.manifest.bearings
    of_balls = [bearing.prefix + name for bearing in bearings for name in BALL_CHANNELS]
    kinds = {name: tuple(kind for kind in KINDS if kind != "peak_ball" or name in of_balls) for name in states + of_balls}
    return [
        *(f"end:{name}" for name in states),
        *(f"{kind}:{name}" for name, those in kinds.items() for kind in those),
        *(bearing.prefix + life for bearing in bearings for life in LIVES),
    ]


def differing(model: Model, method: str, cycles: float) -> list[str]:
    """What of three members in lanes is not the bits of their single runs."""
    name = next((p for p in model.parameters if p.endswith("clearance")), [*model.parameters][-1])
    table, names = {name: model.parameters[name] * np.array([0.9, 1.0, 1.15])}, observables(model)
    given = {"cycles": cycles, "transient": 0.25 * cycles, "rtol": 1e-5, "method": method, "kinks": "stepped-over"}
    single, lanes = (model.simulate_many(table, names, lanes=lanes, **given) for lanes in (False, True))  # type: ignore[arg-type]
    assert (single.statistics.lanes, lanes.statistics.lanes) == (1, model.ensemble_driver.lanes)
    assert not single.failures
    assert (single.statistics.steps, single.statistics.rejected) == (lanes.statistics.steps, lanes.statistics.rejected)
    return [name for name in names if not np.array_equal(single[name], lanes[name], equal_nan=True)]


@pytest.mark.parametrize("method", METHODS_OF_RUNS)
def test_members_of_the_press_are_single_runs_to_the_bit(make_model: Callable[..., Model], method: str) -> None:
    model = make_model("punching_press")
    assert len(observables(model)) > 80
    assert differing(model, method, 1.5) == []


@pytest.mark.long
@pytest.mark.parametrize("part", PARTS, ids=str)
def test_members_with_any_part_are_single_runs_to_the_bit(part: Part, model_of: Callable[[str], Model]) -> None:
    model = model_of(part.text)
    assert {m: differing(model, m, 0.3) for m in ("stepper-dp54", "stepper-rodas5p")} == {
        "stepper-dp54": [],
        "stepper-rodas5p": [],
    }


@pytest.mark.long
@pytest.mark.parametrize("method", METHODS_OF_RUNS)
def test_forty_rollers_in_lanes_are_those_of_single_runs(model_of: Callable[[str], Model], method: str) -> None:
    assert differing(model_of(FORTY_ROLLERS), method, 0.3) == []
