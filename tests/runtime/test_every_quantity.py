"""Every kind of quantity works in every call, and one run has one value for it.

A kind that is added to `ballpass.runtime.quantity.kinds` is tested by all of this: it needs a name in `NAMES` where its
own, a colon and a state are none.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

from ballpass.runtime import Model, QuantityFunction, RequestError, SignalClass, Signals, make_data_set
from ballpass.runtime.app.cli import app
from ballpass.runtime.certify.simplification import measure_simplification
from ballpass.runtime.certify.trade import REFERENCE, measure_trade
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.time.timeline import driver

#: How kinds are asked for that take no state, or want a place.
NAMES = {
    "value": "value:inner.y@240deg",
    "amplitude": "amplitude:inner.y@2x",
    "drive_work": "drive_work",
    "static_deflection": "static_deflection@250deg",
    "static_peak_ball_force": "static_peak_ball_force@250deg",
}

#: Outputs, a ball, and what steps reduce, beside one name of each kind.
MORE = (
    *("max:ball.force", "min:ball.force", "mean:ball.force", "rms:ball.force", "peak_ball:ball.force"),
    *("max:ball.force[3]", "max:drive_torque", "min_time:reaction.A.y", "rms:reaction.A.x", "kurtosis:ball.force"),
)

RUN: Mapping[str, Any] = {"cycles": 1.5, "transient": 0.5}
CLEARANCE = "bearing.clearance"


def name_of(kind: str) -> str:
    takes = KINDS[kind].takes
    return NAMES.get(kind, kind if takes in ("bearing", "nothing") else f"{kind}:inner.y")


ALL = (*(name_of(kind) for kind in KINDS), *MORE)


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press")


@pytest.fixture(scope="module")
def expected(press: Model) -> dict[str, float]:
    found = press.quantities(ALL, rtol=1e-9, kinks="located", **RUN)
    return {name: one.value for name, one in found.items()}


def test_a_run_has_one_value_for_each_to_the_last_bit(press: Model, expected: dict[str, float]) -> None:
    """Asked alone or with others; in an ensemble; as a function of parameters; where the run keeps samples."""
    assert all(np.isfinite(value) for value in expected.values())
    options: dict[str, Any] = {"rtol": 1e-9, "kinks": "located", **RUN}
    alone = {name: press.quantities(name, **options)[name].value for name in ALL}
    assert alone == expected
    here = press.parameters[CLEARANCE]
    many = press.simulate_many({CLEARANCE: [here, 2.0 * here]}, ALL, **options)
    assert {name: float(many[name][0]) for name in ALL} == expected
    assert many.failures == ()
    function = QuantityFunction(press, ALL, [CLEARANCE], **options)
    assert dict(zip(ALL, function([here]).tolist(), strict=True)) == expected
    for samples in (7, 500):
        solution = press.simulate(samples_per_cycle=samples, **options)
        reduced = solution.steady_reductions
        assert reduced is not None
        assert reduced["ball.force"].maximum == expected["max:ball.force"]
        assert reduced["ball.force"].mean == expected["mean:ball.force"]
        assert reduced["inner.y"].rms == expected["rms:inner.y"]
        assert solution.x[-1, press.states.index("inner.y")] == expected["end:inner.y"]
    assert press.reduce(**options)["inner.y"].range == expected["range:inner.y"]


FEW = ("max:ball.force", "rms:inner.y", "mean:ball.force[3]", "amplitude:inner.y@2x", "drive_work")


@pytest.mark.parametrize(
    ("scene", "names"),
    [
        ("punching_press", FEW),
        *(pytest.param(scene, ALL, marks=pytest.mark.long) for scene in ("punching_press", "punching_press_two_way")),
    ],
)
def test_commands_and_data_sets_give_that_value(
    make_model: Callable[..., Model], scene: str, names: tuple[str, ...], tmp_path: Path
) -> None:
    """`ballpass run`, `ballpass sweep` and a data set: to the last bit at equal options."""
    model = make_model(scene)
    here = model.parameters[CLEARANCE]
    signals = Signals(outputs=("inner.y",), sample_rate=10e3, duration=0.2, transient=0.06, rtol=1e-9, quantities=names)
    length = {
        "duration": float(signals.times[-1]),
        "transient": signals.transient / driver(model.manifest, model.numbers().values).turn,
    }
    expected = {name: one.value for name, one in model.quantities(names, rtol=1e-9, **length).items()}
    asked = ["--rtol=1e-9", f"--duration={length['duration']!r} s", f"--transient={length['transient']!r}"]
    asked += [*(f"--of={name}" for name in names), "--no-figures", "--json", f"--out={tmp_path}"]

    def shown(*words: str) -> Mapping[str, Any]:
        done = CliRunner().invoke(app, [*words, *asked])
        assert done.exit_code == 0, done.stderr
        found: Mapping[str, Any] = json.loads(done.stdout)["quantities"]
        return found

    run = shown("run", str(model.folder))
    assert {name: run[name]["value"] for name in names} == expected
    sweep = shown("sweep", str(model.folder), f"--vary={CLEARANCE}={here!r} m:{2.0 * here!r} m:2")
    assert {name: sweep[name]["values"][0] for name in names} == expected
    one = SignalClass(label="one", model=model, members=1, parameters={})
    make_data_set(tmp_path / "one.nc", [one], signals, seed=1)
    with xarray.open_dataset(tmp_path / "one.nc") as labels:
        assert dict(zip(names, labels["quantities"].values[0].tolist(), strict=True)) == expected


@pytest.mark.long
@pytest.mark.parametrize("scene", ["punching_press", "punching_press_two_way"])
def test_the_reference_of_trade_has_that_value(make_model: Callable[..., Model], scene: str) -> None:
    model = make_model(scene)
    trade = measure_trade(model, ALL, members=2, spread=0.0, ways=[])
    alike = model.quantities(ALL, method=REFERENCE.method, rtol=REFERENCE.rtol, kinks=REFERENCE.kinks)
    assert trade.values == {name: one.value for name, one in alike.items()}


def test_lanes_are_a_fast_path_of_the_same_kinds(press: Model) -> None:
    """They step over kinks, and agree within the tolerance with single runs that do."""
    options: dict[str, Any] = {"rtol": 1e-8, "kinks": "stepped-over", **RUN}
    single = press.quantities(ALL, **options)
    lanes = press.simulate_many({CLEARANCE: [press.parameters[CLEARANCE]]}, ALL, **options)
    assert lanes.statistics.lanes > 1
    for name in ALL:
        assert lanes[name][0] == pytest.approx(single[name].value, rel=1e-5, abs=1e-12), name


def test_a_method_that_is_named_is_that_of_derivatives_too(press: Model) -> None:
    """`stepper` changes between explicit and linearly implicit steps; other methods give other bits."""
    names, options = ["max:ball.force", "rms:inner.y"], {**RUN, "rtol": 1e-8, "kinks": "located", "method": "stepper"}
    found = press.sensitivity(names, CLEARANCE, check=False, **options)
    assert [one.value for one in found.quantities] == [one.value for one in press.quantities(names, **options).values()]


def test_a_report_of_derivatives_names_the_run_that_has_its_values(press: Model) -> None:
    names, length = ["max:ball.force", "rms:inner.y", "amplitude:inner.y@2x"], {"cycles": 1.5, "transient": 0.5}
    report = press.sensitivity(names, CLEARANCE, check=False, **length)
    options = {name: report.settings[name] for name in ("method", "rtol", "kinks")}
    again = press.quantities(names, **length, **options)
    assert [one.value for one in report.quantities] == [one.value for one in again.values()]
    assert all(str(value) in str(report) for value in (options["method"], options["kinks"]))


def test_every_kind_has_an_error_and_a_derivative(press: Model, expected: dict[str, float]) -> None:
    """A run to a named error keeps it; derivatives are there, and verified or said to be none."""
    target = 1e-3
    found = press.simulate(error=target, of=ALL, **RUN).accuracy
    assert found is not None
    for name in ALL:
        assert found.values[name] == pytest.approx(expected[name], rel=target, abs=1e-300), name
    slopes = QuantityFunction(press, ALL, [CLEARANCE], **RUN).jacobian([press.parameters[CLEARANCE]])
    assert np.all(np.isfinite(slopes))


@pytest.mark.long
def test_every_kind_is_certified_traded_and_compared(press: Model) -> None:
    report = press.sensitivity(ALL, [CLEARANCE, "mechanism.driver.speed"], **RUN)
    assert not report.disagreements
    assert len(report.pairs) == 2 * len(ALL)
    assert set(measure_trade(press, ALL, members=2).quantities) == set(ALL)
    assert set(measure_simplification(press, press, ALL, members=2).units) == set(ALL)


WRONG = ("drive_wrok", "mx:inner.y", "max:iner.y", "value:inner.y", "max:inner.y[2]", "amplitude:inner.y@240deg")


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_quantity_is_refused_alike_before_anything_runs(press: Model, name: str) -> None:
    calls: list[Callable[[], object]] = [
        lambda: press.quantities(name),
        lambda: press.simulate_many({CLEARANCE: [1e-5]}, name),
        lambda: press.simulate(error=0.01, of=name),
        lambda: press.sensitivity(name, CLEARANCE),
        lambda: QuantityFunction(press, name, CLEARANCE),
        lambda: measure_trade(press, [name]),
        lambda: measure_simplification(press, press, [name]),
    ]
    said = set()
    for call in calls:
        with pytest.raises(RequestError) as refused:
            call()
        said.add(str(refused.value))
    assert len(said) == 1
