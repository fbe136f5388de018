"""Claims about requests: wrong numbers, names, settings and file names are refused in words."""

from __future__ import annotations

import functools
import inspect
import math
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_bad_input import EVIL, PRESS
from typer.testing import CliRunner

import ballpass.derive
import ballpass.runtime
from ballpass.derive import check, derive, equations, generate, lower, read_scene
from ballpass.derive.reading.read import parse_override, scene_from_text, with_values
from ballpass.runtime import (
    BallpassError,
    Model,
    QuantityFunction,
    RequestError,
    load,
    load_results,
    load_solution,
    make_data_set,
    read_manifest,
)
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.trade import trade
from ballpass.runtime.contract.arguments import type_fault
from ballpass.runtime.contract.options import options_of
from ballpass.runtime.questions import QUESTIONS
from ballpass.runtime.report.report import Marked, Report, ReportTable
from ballpass.runtime.report.text import to_text

SCENES = Path(__file__).resolve().parents[2] / "scenes"
ROTOR = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return load(generate(scene_from_text(PRESS, "press"), tmp_path_factory.mktemp("requests") / "press"))


PRESS_FILE = str(SCENES / "punching_press.toml")


@pytest.mark.parametrize(
    "value",
    [
        *(5, math.inf, None, [], {}, (), {5: 5}, {"x": 1}, b"x", 1j, object(), np.array([]), type, [[1]], np.sin),
        *(
            10**5000,
            [10**5000],
            "x\0",
            "\ud800",
            "x" * 100_000,
            {"x"},
            np.array(1.0),
            np.array("x\0"),
            functools.reduce(lambda inner, _: [inner], range(3000), 0),
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_functions_of_both_packages_refuse_what_is_of_a_wrong_type(value: Any, tmp_path: Path) -> None:
    """Only methods of models did: of 1360 such calls about 1000 ended in a TypeError, AttributeError or ValueError."""
    scene = read_scene(PRESS_FILE)
    calls: dict[Callable[..., object], dict[str, Any]] = {
        load_results: {"folder": value},
        load_solution: {"path": value},
        read_manifest: {"folder": value},
        make_data_set: {"path": str(tmp_path / "x.nc"), "classes": value, "signals": value, "seed": 1},
        check: {"scene": value},
        derive: {"scene": value},
        equations: {"system": value},
        lower: {"system": value},
        read_scene: {"path": value},
        generate: {"scene": scene, "out": tmp_path, "inspect": [value]},
        partial(read_scene, PRESS_FILE): {"changes": [value]},
        partial(generate, scene): {"out": [value]},
    }
    for call, wrong in calls.items():
        with pytest.raises(BallpassError):
            call(**wrong)


def _public_functions() -> dict[str, Callable[..., Any]]:
    """Questions, and public functions and methods of both packages, by name."""
    found: dict[str, Callable[..., Any]] = {one.__name__: one for one in (*QUESTIONS, trade)}
    for package in (ballpass.runtime, ballpass.derive):
        for name in package.__all__:
            item = getattr(package, name)
            if inspect.isclass(item):
                members = inspect.getmembers(item, inspect.isfunction)
                found |= {f"{name}.{method}": one for method, one in members if not method.startswith("_")}
            elif inspect.isfunction(item):
                found[name] = item
    return found


def test_options_passed_as_their_defaults_are_accepted() -> None:
    """`fit(signal=None)` was refused: types are checked by the words of annotations, and its alias was `Signals`."""
    checked = 0
    for name, function in _public_functions().items():
        options = options_of(function)
        for argument in inspect.signature(function).parameters.values():
            if argument.default is not argument.empty:
                fault = type_fault(argument.name, str(argument.annotation), argument.default)
                if argument.name in options:
                    kind, option = options[argument.name]
                    fault = fault or option.fault(argument.name, kind, argument.default)
                assert fault is None, f"{name}: {fault}"
                checked += 1
    assert checked > 200


WRONG_VALUES = [
    (math.nan, "a finite number in m is expected, not nan"),
    (math.inf, "a finite number in m is expected, not inf"),
    (-math.inf, "a finite number in m is expected, not -inf"),
    (10**400, "a finite number in m is expected, not inf"),
    ("8 um", "one number in m is expected, not '8 um' (str)"),
    (b"1", "one number in m is expected, not b'1' (bytes)"),
    (None, "one number in m is expected, not None (NoneType)"),
    (True, "one number in m is expected, not True (bool)"),
    (1 + 2j, "one number in m is expected, not (1+2j) (complex)"),
    ([1e-6], "one number in m is expected, not [1e-06] (list)"),
    (np.array([1e-6, 2e-6]), "one number in m is expected, not array"),
    (np.array([[1e-6]]), "one number in m is expected, not array"),
]


@pytest.mark.parametrize(("value", "words"), WRONG_VALUES, ids=[repr(value)[:20] for value, _ in WRONG_VALUES])
def test_an_override_that_is_no_finite_number_is_refused(model: Model, value: Any, words: str) -> None:
    calls: list[Callable[[], object]] = [
        lambda: model.simulate(cycles=0.1, parameters={"bearing.clearance": value}),
        lambda: model.reduce(cycles=0.1, parameters={"bearing.clearance": value}),
        lambda: model.evaluate(0.0, parameters={"bearing.clearance": value}),
        lambda: model.jacobian("rhs", parameters={"bearing.clearance": value}),
    ]
    for call in calls:
        with pytest.raises(RequestError) as caught:
            call()
        assert f"bearing.clearance: {words}" in str(caught.value)
    with pytest.raises(RequestError, match=r"bearing\.clearance"):
        model.simulate_many({"bearing.clearance": [1e-6, value]}, ["peak_ball_force"], cycles=0.1)


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("bearing.clearence", "'bearing.clearance'"),
        ("clearance", "'bearing.clearance'"),
        ("mechanism.bodies.crank.masss", "'mechanism.bodies.crank.mass'"),
        ("bearing.balls", "'bearing."),
        ("x" * 10_000, "There are "),
        ("__class__", "There are "),
        (3, "There are "),
    ],
)
def test_an_unknown_parameter_is_refused_with_the_nearest_names(model: Model, name: Any, near: str) -> None:
    with pytest.raises(RequestError) as caught:
        model.simulate(cycles=0.1, parameters={name: 1.0})
    assert "There is no parameter" in str(caught.value)
    assert near in str(caught.value)
    assert len(str(caught.value)) < 1000


WRONG_REQUESTS = [
    ("cycles", "2", "cycles: a number above 0 is expected, not '2'"),
    ("cycles", math.nan, "cycles: a number above 0 is expected, not nan"),
    ("cycles", -1, "cycles: a number above 0 is expected, not -1"),
    ("cycles", [1], r"cycles: a number above 0 is expected, not \[1\]"),
    ("cycles", 10**400, "cycles: a number above 0 is expected"),
    ("cycles", 1e8, "samples of .* numbers would not fit into memory.*Model.reduce"),
    ("cycles", 1e300, "1e[+]300 turns, is too long to be computed"),
    ("cycles", 1e308, "is too long to be computed"),
    ("duration", "1 s", "duration: a time above 0 s is expected, not '1 s'"),
    ("duration", 1e7, "samples of .* numbers would not fit into memory.*Model.reduce"),
    (
        "duration",
        1e300,
        "A run of 1e[+]300 s, 8.33e[+]300 turns, is too long.* Allowed: up to 1e[+]09 turns and 1e[+]09 s",
    ),
    ("rtol", "a", "rtol: a number from 1e-13 to 0.1 is expected, not 'a'"),
    ("rtol", math.nan, "rtol: a number from 1e-13 to 0.1 is expected, not nan"),
    ("rtol", 0, "rtol: a number from 1e-13 to 0.1 is expected, not 0"),
    ("samples_per_cycle", "a", "samples_per_cycle: a whole number from 1 on is expected, not 'a'"),
    ("samples_per_cycle", math.nan, "samples_per_cycle: a whole number from 1 on is expected, not nan"),
    ("samples_per_cycle", math.inf, "samples_per_cycle: a whole number from 1 on is expected, not inf"),
    ("samples_per_cycle", 1.5, r"samples_per_cycle: a whole number from 1 on is expected, not 1\.5"),
    ("samples_per_cycle", 10**30, r"^1e[+]29 samples of .* numbers would not fit into memory"),
    ("transient", "x", "transient: a number of cycles from 0 on is expected, not 'x'"),
    ("transient", math.nan, "transient: a number of cycles from 0 on is expected, not nan"),
    ("initial", "abc", r"initial: 'abc' \(str\) was given\. Allowed: a state, \"equilibrium\", or the end of a run"),
    ("initial", {"inner.x": 0.0}, r"initial: {'inner.x': 0.0} \(dict\) was given\. Allowed: a state"),
    ("initial", [0.0] * 3, r"initial: 8 finite numbers are expected .*not an array of shape \(3,\)"),
    ("initial", [math.nan] * 8, "initial: 8 finite numbers are expected .*NaN or inf"),
    ("initial", [[0.0] * 8], r"initial: 8 finite numbers are expected .*shape \(1, 8\)"),
    ("method", "euler", "There is no method 'euler'"),
    ("method", 3, "method: a text is expected, not 3 .int."),
]


@pytest.mark.parametrize(
    ("name", "value", "words"), WRONG_REQUESTS, ids=[f"{n}={v!r}"[:30] for n, v, _ in WRONG_REQUESTS]
)
def test_a_request_out_of_bounds_is_refused(model: Model, name: str, value: Any, words: str) -> None:
    given = {name: value} if name in ("cycles", "duration") else {"cycles": 0.1, name: value}
    with pytest.raises(RequestError, match=words):
        model.simulate(**given)


DATA = {"time": [0.0, 1e-3], "inner.y": [0.0, 0.0]}
MANY = {"bearing.clearance": [1e-5]}

#: Each ended in a traceback of a module deep inside.
WRONG_TYPES: list[tuple[Callable[[Any], object], str]] = [
    (lambda m: m.simulate(cycles=0.1, outputs=5), r"outputs: one name or several .* not 5 \(int\)\. Example: outputs="),
    (lambda m: m.simulate(cycles=0.1, method=["stepper"]), r"method: a text is expected, not \['stepper'\] \(list\)"),
    (lambda m: m.simulate(cycles=0.1, error=0.01, of=5), "of: one name or several"),
    (lambda m: m.sensitivities(5, cycles=0.1), r"wrt: one name .* Example: wrt=\[\"bearing\.clearance\"\]"),
    (lambda m: m.sensitivities(None, cycles=0.1), "wrt: one name or several"),
    (lambda m: m.quantities(None, cycles=0.1), "of: one name or several"),
    (lambda m: m.simulate_many(MANY, 5, cycles=0.1), "observables: one name or several"),
    (lambda m: m.simulate_many(MANY, ["peak_ball_force"], cycles="3"), "cycles: a number above 0 is expected, not '3'"),
    (lambda m: m.simulate_many(MANY, ["peak_ball_force"], client=5), "client: a Client of dask.distributed"),
    (
        lambda m: m.simulate_many(MANY, [], uncertainty=np.zeros(3)),
        r"uncertainty: True or False is expected, not array",
    ),
    (lambda m: m.refine_peak(5, "ball.force"), "solution: a solution of a run is expected"),
    (lambda m: m.refine_peak(m.simulate(0.1), "ball.force", kind=[]), r"kind: 'max' or 'min' is expected, not \[\]"),
    (
        lambda m: m.simulate(0.1, initial=m.simulate(0.1, transient=0)),
        r"\(Solution\) was given.*Solution.end continues",
    ),
    (lambda m: m.stream(5, sample_rate=1e4, cycles=0.1), "path: a path is expected"),
    (lambda m: m.evaluate(0.0, outputs=5), "outputs: one name or several"),
    (lambda m: m.breakpoints("a", 1), "finite times t0 < t1 are expected, not 'a'"),
    (lambda m: m.jacobian([5]), "of: one name or several"),
    (lambda m: m.jacobian("rhs", wrt=5), "wrt: one name or several"),
    (lambda m: m.sensitivity("drive_work", [5], cycles=0.1), "wrt: one name or several"),
    (lambda m: m.sensitivity("drive_work", agreement="a"), "agreement: a number between 0 and 1 is expected, not 'a'"),
    (lambda m: m.checked_jacobian("rhs", 5), "wrt: one name or several"),
    (lambda m: m.bifurcation(vary={"bearing.clearance": (1e-6, 3e-6)}), "vary: 'bearing.clearance' is no range"),
    (
        lambda m: m.bifurcation("bearing.clearance=1um:3um:2", readings=None),
        r"readings: None \(NoneType\) is no number",
    ),
    (
        lambda m: m.bifurcation("bearing.clearance=1um:3um:2", exponent="no"),
        "exponent: True or False is expected, not 'no' ",
    ),
    (lambda m: m.bifurcation("bearing.clearance=1um:3um:2", parameters=5), "parameters: a mapping from name to value"),
    (lambda m: m.bifurcation("bearing.clearance=1um:3um:2", settling=10**400), "settling: inf is no whole number"),
    (lambda m: m.checked_jacobian("rhs", "inner.x", state=5), r"state: a text is expected, not 5 \(int\)"),
    (lambda m: m.sensitivities("bearing.clearance", cycles=0.1, rtol="a"), "rtol: a number from 1e-13 to"),
    (lambda m: m.hessian("rhs", 5), "hessian: wrt must be a pair of names"),
    *((lambda m, name=name: getattr(m, name)([]), r"no function \[\]") for name in ("function", "kernel", "symbolic")),
    (lambda m: m.loop([], ("t",)), r"name: a text is expected, not \[\] \(list\)"),
    (lambda m: m.loop("rhs", 5), r"varying: one name or several in a list is expected, not 5 \(int\)"),
    (lambda m: m.sample_outputs(1, 5, ["ball.force"]), "values: a mapping from name to value is expected, not 5"),
    (lambda m: m.sample_outputs(1, {}, ["a"]), r"(?s)no output 'a'.*values: t is missing"),
    (lambda m: m.virtual_integrator([]), r"intervals: \[\] \(list\) is no number\. Allowed: a number from 1 on"),
    (lambda m: m.virtual_integrator(-1), "intervals: -1 lies outside its bounds"),
    (lambda m: m.explore(""), r"path: a path is expected, not '' \(str\)"),
    (lambda m: m.explore("x.html", units=5), r"units: a mapping from name to value is expected, not 5 \(int\)"),
    (lambda m: m.explore("x.html", units={"a": "m", "bearing.clearance": "N"}), r"(?s)no parameter 'a'.*clearance: "),
    (lambda m: m.explore("x.html", units={"bearing.clearance": np.zeros((2, 2))}), r"units: bearing\.clearance: "),
    (lambda m: m.optimize("drive_work", "bearing.clearance=1um:3um", starts=1.5), "starts: 1.5 is no whole number"),
    (lambda m: m.optimize("drive_work", "bearing.clearance=1um:3um", starts=np.int64(-1)), "starts: -1 lies outside"),
    (lambda m: m.fit(5, "bearing.clearance=1um:3um"), r"data: a file .* or a mapping .* expected, not 5 \(int\)"),
    (lambda m: m.fit({"time": "a", "inner.y": [1.0]}, "bearing.clearance=1um:3um"), "trial 1, time: numbers in SI are"),
    (lambda m: m.fit(DATA | {"bearing.clearance": [1e-6]}, "bearing.clearance=1um:3um"), "clearance: one number in SI"),
    (lambda m: m.optimize("drive_work", "bearing.clearance=1um:3um", keep=5), "keep: a path is expected, not 5"),
    (lambda m: m.spectrum("inner.x", cycles=2, sensor=5), r"sensor: a sensor is expected, not 5 \(int\)"),
    (lambda m: m.settle(transient="a"), "transient"),
    (
        lambda m: m.uncertainties([], 0.1, progress=np.zeros(3)),
        r"progress: a function that takes .*, not array.* \(ndarray\)",
    ),
    (lambda m: m.sensitivity("drive_work", cycles=0.1, progress=5), "progress: a function that takes .*, not 5 "),
    (lambda m: m.reduce(1, kinks=np.zeros(2)), "no choice of kinks array"),
    (lambda m: m.steady(parameters=5), r"parameters: a mapping from name to value is expected, not 5 \(int\)"),
    (
        lambda m: m.evaluate(0.0, outputs={"inner.y"}),
        r"outputs: one name .* not {'inner.y'} \(set\)\. A set has no order",
    ),
    (lambda m: m.sensitivity({"drive_work"}, "bearing.clearance", cycles=0.1), r"of: one name .* A set has no order"),
    (lambda m: m.optimize("drive_work", "bearing.clearance=1um:3um", search="x"), "search: 'x' is none of the choices"),
    (
        lambda m: m.optimize("drive_work", "bearing.clearance=1um:3um", search=[]),
        r"search: \[\] is none of the choices",
    ),
    (lambda m: m.spectrum("inner.x", envelope=[1]), r"envelope: \[1\] was given\. Allowed: two numbers \[Hz\]"),
    (lambda m: m.spectrum("inner.x", sample_rate=0), "sample_rate: 0 Hz lies outside its bounds"),
    (lambda m: m.explore("a\0b"), "up to 255 bytes, none of them NUL"),
    (lambda m: m.stream("x" * 300, sample_rate=1e4, cycles=1), "path: a path is expected, not 'xxx.{0,60} .*255 bytes"),
    (lambda m: m.stream("x/" * 3000, sample_rate=1e4, cycles=1), "path: a path is expected"),
    (lambda m: m.steady(keep="a\0b"), "keep: a path is expected"),
    (lambda m: m.simulate(10**5000), "cycles: a number above 0 is expected, not inf"),
    (lambda m: m.evaluate([10**5000]), r"t: .* not \[inf\]"),
    (lambda m: m.jacobian_function("rhs")("a"), r"x: 8 numbers are expected, not 'a' \(str\)"),
    (lambda m: m.simulate(0.1)[["inner.x"]], r"no output or state \['inner\.x'\]"),
    (lambda m: m.evaluate("x" * 100_000), "^.{0,400}$"),
    (lambda m: m.steady("a"), r"turns: 'a' \(str\) is no number\. Allowed: a number above 0"),
    (lambda m: QuantityFunction(m, "drive_work", 5), "wrt: one name or several"),
    (lambda m: QuantityFunction(m, "drive_work", "bearing.clearance", parameters=5), "parameters: a mapping"),
    (lambda m: QuantityFunction(m, "drive_work", "bearing.clearance", kinks=5), "There is no choice of kinks 5"),
    (lambda m: QuantityFunction(m, "drive_work", "bearing.clearance")("a"), "an array of numbers, SI, is expected"),
    (lambda m: QuantityFunction(5, "drive_work", "bearing.clearance"), "model: a model that `load` gave is expected"),
    (lambda m: load(5), "folder: a path is expected, not 5"),
    (lambda m: load("x", compiler=5), "compiler: a text is expected, not 5"),
]


@pytest.mark.parametrize(("call", "words"), WRONG_TYPES, ids=[words[:40] for _, words in WRONG_TYPES])
def test_an_argument_of_a_wrong_type_is_refused_in_words(
    model: Model, call: Callable[[Any], object], words: str
) -> None:
    with pytest.raises(RequestError, match=words):
        call(model)


@pytest.mark.parametrize("angle", [1e10, -1e10, 1e300])
def test_an_angle_without_a_place_in_a_turn_is_refused_wherever_one_is_read(model: Model, angle: float) -> None:
    """`jacobian --at-angle 1e300deg` was verified: neighbouring numbers there are further apart than a turn."""
    assert math.ulp(angle) > 1e-6 > math.ulp(8e9)
    path = "mechanism.driver.start_angle"
    scene, changes = read_scene(PRESS_FILE), {"mechanism": {"driver": {"start_angle": f"{angle!r} rad"}}}
    calls: list[Callable[[], object]] = [
        lambda: read_scene(PRESS_FILE, changes=changes),
        lambda: with_values(scene, {path: angle}),
        lambda: parse_override(scene, f"{path}={angle * 180:g} deg"),
        lambda: model.reduce(cycles=1, transient=0, parameters={path: angle}),
        lambda: model.quantities(f"value:inner.y@{angle!r}rad", cycles=1, transient=0),
    ]
    for call in calls:
        with pytest.raises(BallpassError, match=r"no place in a turn.*8\.6e\+09 rad"):
            call()
    done = CliRunner().invoke(
        app, ["jacobian", PRESS_FILE, "--of", "rhs", "--wrt", "time", "--at-angle", f"{angle}rad"]
    )
    assert done.exit_code == 2
    assert "no place in a turn" in done.stderr
    assert with_values(scene, {path: 1e9}).mechanism is not None
    members = model.simulate_many({path: [1e9, angle]}, ["peak_ball_force"], cycles=0.1, transient=0)
    assert [(one.member, one.status) for one in members.failures] == [(1, "REFUSED")]


def test_what_a_run_within_its_transient_is_told_to_do_can_be_done(model: Model) -> None:
    """A run of one cycle of a scene without a run was told of 50 cycles to drop fewer than, and of no number."""
    bare = PRESS.partition("[run]")[0]
    for text in (f"{bare}[run]\ncycles = 1\ntransient_cycles = 50", PRESS.replace("cycles = 4 ", "cycles = 1 ")):
        with pytest.raises(BallpassError, match="of 1 cycles") as caught:
            scene_from_text(text, "short")
        longer = re.search(r"cycles = (\d+) \(--cycles", str(caught.value))
        assert longer is not None
        assert scene_from_text(re.sub(r"\ncycles = 1\b", f"\ncycles = {longer[1]}", text), "long").run.cycles
        assert scene_from_text(re.sub(r"transient_cycles = \d+", "transient_cycles = 0", text), "all").run.cycles == 1
    with pytest.raises(RequestError, match=r"lies within its 2 transient cycles.*cycles = 12 .*--transient 0"):
        model.reduce(cycles=1)
    assert model.reduce(cycles=12)
    assert model.reduce(cycles=1, transient=0)


def test_a_function_of_no_name_is_none_that_a_model_has(model: Model) -> None:
    assert [model.has(name) for name in ("rhs", "a", [], 5)] == [True, False, False, False]


def test_names_may_be_given_in_any_kind_of_sequence(model: Model) -> None:
    several = ("inner.y", ["inner.y"], np.array(["inner.y"]), np.array("inner.y"), {"inner.y": 1}.keys())
    found = [model.evaluate(0.0, outputs=names) for names in (*several, (name for name in ["inner.y"]))]
    assert found == [{"inner.y": 0.0}] * 6
    of = (name for name in ["max:inner.y"])  # of a question, which looks at it more than once
    assert model.sensitivity(of, "bearing.clearance", cycles=0.1, transient=0, check=False)


@pytest.mark.parametrize("kind", [np.array, np.float64, np.float32])
def test_numbers_may_be_those_of_numpy(model: Model, kind: Callable[[float], Any]) -> None:
    assert model.evaluate(kind(0.5))["drive_torque"] == model.evaluate(0.5)["drive_torque"]
    found, plain = (model.reduce(length, transient=np.array(0)) for length in (kind(0.5), 0.5))
    assert found["inner.y"].maximum == plain["inner.y"].maximum
    assert model.virtual_integrator(np.array(3)) is model.virtual_integrator(3)


@pytest.mark.parametrize("length", [{"duration": 1e300}, {"cycles": 1e10}, {"cycles": 1e308}])
def test_runs_without_samples_that_would_not_end_are_refused(model: Model, length: dict[str, float]) -> None:
    """Also where nothing turns, in members of an ensemble, and where the last sample says how long the run is."""
    calls: list[Callable[[], object]] = [
        lambda: model.reduce(**length),
        lambda: model.simulate_many({"bearing.clearance": [1e-5, 2e-5]}, ["max:ball.force"], **length),
        lambda: model.simulate(times=[0.0, 1e300]),
        lambda: model.reduce(duration=1e300, transient=0, parameters={"mechanism.driver.speed": 0.0}),
        lambda: model.reduce(cycles=1, transient=0, parameters={"mechanism.driver.speed": 1e-300}),
    ]
    for call in calls:
        with pytest.raises(RequestError, match=r"A run of .* is too long to be computed") as caught:
            call()
        assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("bearing.clearence=1 um", ("bearing.clearence", 'did you mean "bearing.clearance"?')),
        ("bearing.clearance=1 kg", ('"1 kg"', "wrong dimension for a length", "SI: m")),
        ("bearing.clearance=1", ("the unit is missing",)),
        ("bearing.clearance=nan m", ("the number is not finite",)),
        ("bearing.clearance=inf m", ("the number is not finite",)),
        ("bearing.clearance=1e999 m", ("the number is not finite", "given", "allowed", "remedy")),
        ("bearing.clearance=[1 m, 2 m]", ("no number in front",)),
        ("bearing.clearance=__import__('os').getcwd()", ("no number in front",)),
        ("bearing.clearance=1 m; touch pwned", ("has no place in a unit",)),
        ("bearing.clearance=$(touch pwned)", ("no number in front",)),
        ("bearing.clearance", ("an override without a value", "PATH=VALUE")),
        ("=1 m", ("the scene has no quantity of this path",)),
        ("x" * 10_000 + "=1", ("the scene has no quantity of this path",)),
        ("\x1b[31m=1 m", ("the scene has no quantity of this path",)),
        ("mechanism.bodies.rod.mass=-1 kg", ("the value is negative", "a value above zero")),
    ],
)
def test_a_wrong_setting_exits_with_2_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, setting: str, words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["run", str(SCENES / "punching_press.toml"), "--set", setting])
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert "\x1b" not in result.stderr
    assert len(result.stderr) < 5000
    for word in words:
        assert word in result.stderr
    assert not list(tmp_path.iterdir())


OBEYED = "\x1b[2J\x1b]0;owned\x07\r\u202e\x9b31m"


def test_nothing_that_a_terminal_obeys_is_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Heads of a file of measurements, names of files and titles of solutions went to the terminal as they are."""
    monkeypatch.chdir(tmp_path)
    data = tmp_path / "data.csv"
    data.write_text(f"time,{OBEYED}\n0,1\n1,2\n", encoding="utf-8", newline="")
    named = tmp_path / f"{OBEYED}.toml"
    named.write_text(ROTOR.replace("balls = 8", "balls = x"), encoding="utf-8")
    for words in (
        ["fit", PRESS_FILE, str(data), "--vary", "bearing.clearance=1um:3um"],
        ["run", str(named)],
        ["run", str(tmp_path / f"{OBEYED}")],
        ["run", PRESS_FILE, "--of", f"max:{OBEYED}"],
    ):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 2
        assert not set(OBEYED).difference("[2J]0;owned31m") & set(done.output), words
        assert r"\x1b[2J" in done.output or words[0] == "fit", done.output
    table = ReportTable(heads=("a", OBEYED), rows=[(OBEYED, Marked(OBEYED, "bad"))], title=OBEYED, caption=OBEYED)
    text = to_text(Report(title=OBEYED, parts=(OBEYED, table)))
    assert text.count(r"\x1b[2J\x1b]0;owned\x07\r\u202e\x9b31m") == 7
    assert all(letter.isprintable() or letter == "\n" for letter in text)


@pytest.mark.parametrize("evil", [evil for evil in EVIL if "\0" not in evil and "/" not in evil and len(evil) < 200])
def test_a_scene_file_of_any_name_writes_within_its_folders_or_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, evil: str
) -> None:
    here = tmp_path / "outer" / "here"
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    scene = here / f"{evil}.toml"
    scene.write_text(ROTOR.replace("balls = 8", "balls = x"), encoding="utf-8")  # refused in any case
    result = CliRunner().invoke(app, ["derive", str(scene)])
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [scene]
