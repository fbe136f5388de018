"""Claims about lanes: a member of an ensemble is its single run to the last bit, in states and reductions."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from coupled_scenes import EFFECTS, LAGGING, RUN, bearing
from parts import PARTS, shipped

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.contract.method_registry import METHODS
from ballpass.runtime.native import driver_library
from ballpass.runtime.native.compilers import find_compiler
from ballpass.runtime.native.reduction_rows import BALL_CHANNELS
from ballpass.runtime.ratings.elements import RATED

#: What is reduced of a channel.
OF_RATINGS = ("life", "static_safety")
KINDS = ("max", "min", "peak_time", "min_time", "mean", "rms")
WITH_BALLS = ("damping law", "rolling element", "effect")
BOTH_WAYS = bearing("A", effects=LAGGING), bearing("B", "rod", effects=EFFECTS)
TEXTS = {
    **{str(part): part.text for part in PARTS if part.registry in WITH_BALLS},
    "effects in two-way bearings": "".join([shipped("punching_press").partition("[bearing]")[0], *BOTH_WAYS, RUN]),
}
METHODS_OF_RUNS = tuple(f"stepper-{name}" for name in METHODS)

FORTY_ROLLERS = shipped(
    "varying_compliance",
    ("[bearing]\n", '[bearing]\nelement = "cylindrical-roller"\n'),
    ("balls = 8", "balls = 40"),
    ('"33.5 mm"', '"110 mm"'),
    ('stiffness = "13.34e9 N/m^1.5"', 'length = "8 mm"\nyoung_modulus = "207 GPa"\npoisson_ratio = 0.3'),
    ('law = "none"', 'law = "tangent"\nratio = "0.25e-5 s"'),
)


def bearings_on_a_shaft(balls: Sequence[int]) -> str:
    """Bearings with so many balls each."""
    text = shipped("varying_compliance", ('law = "none"', 'law = "one-sided"\ncoefficient = "683 N*s/m"'))
    start, end = (text.index(mark) for mark in ("[bearing]", "[run]"))
    named = [
        re.sub(
            r"^\[bearing(?=[.\]])",
            f"[bearings.b{k}",
            text[start:end].replace("balls = 8", f"balls = {count}"),
            flags=re.M,
        )
        for k, count in enumerate(balls)
    ]
    outputs = re.sub(r"outputs = \[.*?\]", 'outputs = ["b*"]', text[end:], flags=re.S)
    return text[:start] + "".join(named) + outputs


@pytest.fixture(scope="module")
def model_of_case(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Model]:
    def make(text: str) -> Model:
        folder: Path = tmp_path_factory.mktemp("lanes") / "scene"
        return load(generate(scene_from_text(text, "scene"), folder))

    return make


def observables(model: Model) -> list[str]:
    """All that lanes reduce: states, the channels of the balls of each bearing, its lives."""
    states, bearings = [state.name for state in model.manifest.states], model.manifest.bearings
    of_balls = [
        bearing.prefix + name
        for bearing in bearings
        for name in BALL_CHANNELS
        if bearing.damping.acts or name != "ball.damping_force"
    ]
    return [
        *(f"end:{name}" for name in states),
        *(f"{kind}:{name}" for name in (*states, *of_balls) for kind in KINDS),
        *(f"peak_ball:{name}" for name in of_balls),
        *(
            f"{bearing.prefix}{name}"
            for bearing in bearings
            for name in OF_RATINGS
            if not RATED[bearing.element].unrated
        ),
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
@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_members_with_any_part_are_single_runs_to_the_bit(text: str, model_of_case: Callable[[str], Model]) -> None:
    model = model_of_case(text)
    assert {m: differing(model, m, 0.3) for m in ("stepper-dp54", "stepper-rodas5p")} == {
        "stepper-dp54": [],
        "stepper-rodas5p": [],
    }


@pytest.mark.long
def test_forty_rollers_in_lanes_are_those_of_single_runs(model_of_case: Callable[[str], Model]) -> None:
    """And what is reduced of them is that of samples."""
    model = model_of_case(FORTY_ROLLERS)
    assert {method: differing(model, method, 0.3) for method in METHODS_OF_RUNS} == {
        method: [] for method in METHODS_OF_RUNS
    }
    run = {"transient": 0, "rtol": 1e-8, "method": "stepper-dp54", "kinks": "stepped-over"}
    samples = model.simulate(0.3, samples_per_cycle=100_000, outputs=["ball.force"], **run)  # type: ignore[arg-type]
    force, found = samples["ball.force"].max(axis=1), model.reduce(0.3, **run)["ball.force"]  # type: ignore[arg-type]
    assert found.maximum == pytest.approx(force.max(), rel=1e-6)
    assert found.minimum == pytest.approx(force.min(), rel=1e-6)
    weights = np.r_[0.5, np.ones(len(force) - 2), 0.5]
    mean = np.average(force, weights=weights)
    assert found.mean == pytest.approx(mean, rel=1e-6)
    assert found.std == pytest.approx(np.sqrt(np.average((force - mean) ** 2, weights=weights)), rel=1e-6)


@pytest.mark.long
@pytest.mark.extreme
def test_twenty_bearings_on_a_shaft_in_lanes_are_those_of_single_runs(model_of_case: Callable[[str], Model]) -> None:
    """That each is what it is alone says test_cylindrical_roller.py."""
    assert differing(model_of_case(bearings_on_a_shaft([5 + k % 6 for k in range(20)])), "stepper-dp54", 0.05) == []


@pytest.mark.long
@pytest.mark.skipif(shutil.which("gcc") is None, reason="this is a claim about gcc, which is not installed")
@pytest.mark.parametrize(
    ("scene", "driver"),
    [
        ("punching_press", driver_library.LOCATING),
        ("punching_press", driver_library.DIFFERENTIATING_LOCATED),
        ("punching_press_tangent", driver_library.DIFFERENTIATING_LOCATED),
        ("punching_press_roller", driver_library.DIFFERENTIATING_LOCATED),
        ("punching_press_roller", driver_library.LOCATING),
        ("punching_press_roller", driver_library.PLAIN),
        ("punching_press_roller", driver_library.ENSEMBLE),
    ],
    ids=lambda value: getattr(value, "kind", value),
)
def test_every_loop_over_elements_or_directions_is_vector_code(
    scene: str, driver: driver_library.DriverSources, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the generated kernels, as gcc says: loops that it leaves run one by one, which is right and slow."""
    monkeypatch.setenv("BALLPASS_CACHE", str(tmp_path / "cache"))
    said = tmp_path / "said.txt"
    compiler = find_compiler(f"gcc -fopt-info-vec-all={said}")
    assert compiler is not None
    folder = generate(scene_from_text(shipped(scene), scene), tmp_path / scene)
    driver_library.compile_driver(folder, load(folder).manifest, compiler, driver)
    loops = re.findall(
        r"((?:kernels|switches|tangents)\.h:\d+):\d+: (optimized: loop vectorized|missed: couldn't vectorize loop)",
        said.read_text(),
    )
    assert len(loops) > 2
    assert {place for place, how in loops if how.startswith("missed")} == set()
