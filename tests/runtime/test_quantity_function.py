"""Quantities as a function of parameters: batches, Jacobians and failures, in arrays, in JAX and in PyTorch.

JAX's and PyTorch's own checkers compare the derivatives with differences of the values.
"""

from __future__ import annotations

import pickle
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.optimize import approx_fprime, brentq

from ballpass.runtime import (
    BallpassError,
    KinkWarning,
    Model,
    QuantityFunction,
    RequestError,
    SimulationError,
    UnknownValueWarning,
)
from ballpass.runtime.certify import derivative_runs
from ballpass.runtime.certify.derivative_runs import derivative_run, differentiate
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.request.request import Request

CLEARANCE, MASS, ANGLE = "bearing.clearance", "mechanism.bodies.slider.mass", "mechanism.driver.start_angle"
SPEED = "mechanism.driver.speed"
#: Reduced by ensembles, and not.
OF = ("peak_ball_force", "rms:inner.y", "value:inner.y@200deg")
SPAN: dict[str, Any] = {"cycles": 0.8, "transient": 0.4}
#: Differences see no noise of steps over kinks then.
TIGHT: dict[str, Any] = {**SPAN, "rtol": 1e-11}
WIDE = {CLEARANCE: 60e-6}
#: Of PyTorch, which warns of a call of its own.
SCRIPT = "ignore:.torch.jit.script. is deprecated:DeprecationWarning"


@pytest.fixture(scope="module")
def smooth(make_model: Callable[..., Model]) -> Model:
    """The punching press whose ring moves little between two strokes, so that differences have digits."""
    return make_model("punching_press")


@pytest.fixture(scope="module")
def function(smooth: Model) -> QuantityFunction:
    return QuantityFunction(smooth, OF, (CLEARANCE, MASS), **SPAN)


@pytest.fixture(scope="module")
def rows(function: QuantityFunction) -> np.ndarray:
    """Neighbours of the scene, shape (9, 2): a whole set of lanes and a member more."""
    return function.start * (1.0 + 0.05 * np.random.default_rng(1).uniform(-1.0, 1.0, (9, 2)))


@pytest.fixture(scope="module")
def jax() -> Iterator[ModuleType]:
    jax = pytest.importorskip("jax", reason="JAX is not installed: pip install ballpass[jax]")
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield jax
    jax.config.update("jax_enable_x64", before)


@pytest.fixture(scope="module")
def torch() -> ModuleType:
    return pytest.importorskip("torch", reason="PyTorch is not installed: pip install ballpass[torch]")


def in_jax(function: QuantityFunction) -> Callable[..., Any]:
    from ballpass.jax import wrap

    return wrap(function)


def in_torch(function: QuantityFunction) -> Callable[..., Any]:
    from ballpass.torch import wrap

    return wrap(function)


def test_values_and_derivatives_are_those_of_the_report(smooth: Model, function: QuantityFunction) -> None:
    report = smooth.sensitivity(OF, (CLEARANCE, MASS), **SPAN, check=False)
    expected = np.array([[report[name, by].derivative for by in function.wrt] for name in OF])
    np.testing.assert_allclose(function.jacobian(function.start), expected, rtol=1e-3)
    values = [report[name, CLEARANCE].value for name in OF]
    np.testing.assert_allclose(function(function.start), values, rtol=1e-6)


def test_a_batch_is_a_loop_to_the_bit(function: QuantityFunction, rows: np.ndarray) -> None:
    assert np.array_equal(function(rows), [function(row) for row in rows])
    assert np.array_equal(function.jacobian(rows[:3]), [function.jacobian(row) for row in rows[:3]])
    assert function(rows[:8].reshape(2, 4, 2)).shape == (2, 4, 3)
    assert repr(function) == f"QuantityFunction(punching_press: {', '.join(OF)} by {CLEARANCE}, {MASS})"
    one = QuantityFunction(function._model, OF[0], CLEARANCE, **SPAN, parameters={MASS: rows[0, 1]})
    assert one(rows[0, :1]) == function(rows[0])[0]
    assert one(rows[:, :1]).shape == (9,)
    assert one.jacobian(rows[:2, :1]).shape == (2, 1)


@pytest.mark.long
def test_what_fails_is_told_or_nan_as_asked(smooth: Model, function: QuantityFunction, rows: np.ndarray) -> None:
    table = rows[:3].copy()
    table[1, 1] = -1.0
    for call in (function, function.jacobian):
        with pytest.raises(RequestError, match=r"slider\.mass = -1: .*allowed is a number above 0"):
            call(table)
    table[2, 0] = np.nan
    for call, own in (("__call__", function(rows[:1])), ("jacobian", function.jacobian(rows[:1]))):
        lenient = QuantityFunction(smooth, OF, (CLEARANCE, MASS), **SPAN, failed="nan")
        with pytest.warns(UnknownValueWarning) as caught:
            mine = getattr(lenient, call)(table)
        assert {name for name in OF if any(name in str(item.message) for item in caught)} == set(OF)
        assert any("clearance = nan" in str(item.message) for item in caught)
        assert np.array_equal(mine[:1], own)
        assert np.isnan(mine[1:]).all()
        getattr(lenient, call)(table)  # a warning would be an error: it is said once


@pytest.mark.long
def test_what_is_known_is_given_beside_what_is_not(smooth: Model) -> None:
    """At twice the speed the run of 0.8 turns is over before the time that is asked for."""
    known, beyond = ("rms:inner.y", "static_deflection@240deg"), "value:inner.y@0.08s"
    both = QuantityFunction(smooth, (known[0], beyond, known[1]), SPEED, **SPAN, failed="nan")
    alone = QuantityFunction(smooth, known, SPEED, **SPAN)
    rows = both.start * np.array([[1.0], [2.0]])
    with pytest.warns(UnknownValueWarning, match=r"0\.08s: the run ends at .*speed = 104\.7"):
        values = both(rows)
    slopes = both.jacobian(rows)  # said once
    for found, expected in ((values, alone(rows)), (slopes, alone.jacobian(rows))):
        assert np.array_equal(found[:, [0, 2]], expected)
        assert np.isfinite(found[0, 1]).all()
        assert np.isnan(found[1, 1]).all()


@pytest.mark.long
def test_a_peak_that_passes_to_another_ball_is_warned_of_and_certified_as_a_kink(smooth: Model) -> None:
    """Where the largest forces of balls 1 and 2 are equal, those of either ball alone have the slopes on both sides."""
    balls = QuantityFunction(smooth, ("max:ball.force[1]", "max:ball.force[2]"), ANGLE, **SPAN)
    tie = float(brentq(lambda angle: float(np.diff(balls([angle]))[0]), 0.9, 1.0, xtol=1e-7))
    slopes = balls.jacobian([tie])[:, 0]
    assert slopes[0] < 0.0 < slopes[1]
    largest = QuantityFunction(smooth, "peak_ball_force", ANGLE, **SPAN)
    for away in (-0.02, 0.02):
        assert largest.jacobian([tie + away])[0] == pytest.approx(slopes[int(away > 0.0)], rel=0.1)
    with pytest.warns(KinkWarning, match=f"peak_ball_force: a change of {ANGLE}") as caught:
        given = largest.jacobian([tie])
    words = str(caught[0].message)
    for slope in slopes:
        assert f"{slope:.4g}"[:3] in words
    assert np.min(np.abs(given - slopes)) < 1e-3 * abs(slopes[0])
    largest.jacobian([tie])  # said once
    report = largest.certify([tie])
    (pair,) = report.pairs
    assert "not checked, 1 pairs: a kink: the slopes on both sides" in str(report)
    assert pair.check.sides == pytest.approx(slopes, rel=1e-2)
    assert pair.by_steps == given[0]


@pytest.mark.long
def test_the_certificate_is_of_the_numbers_of_the_jacobian(function: QuantityFunction) -> None:
    at = {MASS: 18.0}
    report = function.certify(at)
    slopes = function.jacobian(function.arguments(at))
    assert [pair.by_steps for pair in report.pairs] == slopes.ravel().tolist()
    assert {pair.check.verdict.value for pair in report.pairs} == {"verified"}
    with pytest.raises(RequestError, match="one point"):
        function.certify(np.ones((2, 2)))


def test_derivatives_by_the_speed_are_known_as_others_are(smooth: Model) -> None:
    """At one tolerance they are a thousand times less accurate: what steps lose at each contact adds up."""
    fine, usual = (QuantityFunction(smooth, OF, (SPEED, ANGLE), **SPAN, rtol=rtol) for rtol in (1e-11, 1e-9))
    np.testing.assert_allclose(usual.jacobian(usual.start), fine.jacobian(fine.start), rtol=2e-3)


@pytest.mark.long
def test_derivatives_that_mean_nothing_are_refused(
    press: Model, smooth: Model, function: QuantityFunction, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings: dict[str, Any] = {"cycles": 12, "transient": 0, "parameters": WIDE}
    chaotic = QuantityFunction(press, "range:inner.x", MASS, **settings)
    assert np.isfinite(chaotic(chaotic.start))
    with pytest.raises(SimulationError, match="chaotic"):
        chaotic.jacobian(chaotic.start)
    both = QuantityFunction(press, ("range:inner.x", "static_deflection@240deg"), MASS, **settings, failed="nan")
    with pytest.warns(UnknownValueWarning, match=r"^range:inner\.x: .*chaotic"):
        slopes = both.jacobian(both.start)
    assert np.isnan(slopes).tolist() == [[True], [False]]
    jumping = replace(smooth.manifest, smoothness=(("damping", "discontinuous"),))
    monkeypatch.setattr(smooth, "manifest", jumping)
    with pytest.raises(RequestError, match="discontinuous"):
        function.jacobian(function.start)


def test_most_motions_show_without_another_run_that_they_are_not_chaotic(
    smooth: Model, press: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The derivative along the start says what differences of moved starts say; only a large one needs these runs."""
    quantities, request = quantities_of(smooth, ["end:inner.y"]), Request(cycles=0.02, transient_cycles=0.0, rtol=1e-11)
    run, _ = derivative_run(smooth, smooth.numbers(None), request)
    found, _ = differentiate(QuantityRun(smooth, quantities), run, [CLEARANCE], 1e-11)
    moved = np.concatenate([run.magnitude[: len(run.magnitude) // 2], np.zeros(len(run.magnitude) // 2)])
    ends = [
        QuantityRun(smooth, quantities).measure(replace(run, initial=run.initial + step * moved)).end
        for step in (1e-5, -1e-5)
    ]
    assert ends[0] is not None
    assert ends[1] is not None
    change = np.max(np.abs(ends[0] - ends[1]) / 2e-5 / run.magnitude)
    assert found.growth == pytest.approx(change, rel=1e-4)
    looks: list[str] = []
    monkeypatch.setattr(derivative_runs, "refuse_growth", lambda *_: looks.append("moved start"))
    calm = QuantityFunction(smooth, OF, CLEARANCE, **SPAN)
    calm.jacobian(calm.start)
    assert not looks
    wild = QuantityFunction(press, "range:inner.x", MASS, cycles=4, transient=0, parameters={CLEARANCE: 120e-6})
    with pytest.warns(KinkWarning):
        wild.jacobian(wild.start)
    assert looks == ["moved start"]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"of": "peak_bal_force"}, "peak_ball_force"),
        ({"of": ()}, "one name or more"),
        ({"wrt": ["bearing.clearanc"]}, "bearing.clearance"),
        ({"wrt": [MASS, MASS]}, "each once"),
        ({"failed": "ignore"}, "nan"),
        ({"chaos": "raise"}, "refuse"),
        ({"rtol": 1.0}, "rtol"),
        ({"transient": 1.0}, "transient"),
    ],
)
def test_wrong_requests_are_told_before_anything_runs(smooth: Model, wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(RequestError, match=message):
        QuantityFunction(smooth, **{"of": OF, "wrt": MASS, **SPAN, **wrong})


def test_jax_finds_derivatives_right(smooth: Model, jax: ModuleType) -> None:
    from jax.test_util import check_grads

    function = QuantityFunction(smooth, OF, (CLEARANCE, MASS, ANGLE), **TIGHT)
    f, start = in_jax(function), jax.numpy.asarray(function.start)
    scaled = f(start)
    check_grads(
        lambda x: f(start * x) / scaled, (jax.numpy.ones(3),),
        order=1, modes=("fwd", "rev"), eps=1e-3, rtol=2e-4, atol=1e-7,
    )  # fmt: skip


@pytest.mark.long
def test_jax_transforms_give_the_same_bits(jax: ModuleType, function: QuantityFunction, rows: np.ndarray) -> None:
    f, some = in_jax(function), rows[:2]
    expected, slopes = function(some), function.jacobian(some)
    assert f(some).dtype == np.float64
    for call in (f, jax.jit(f), jax.vmap(f), jax.jit(jax.vmap(f))):
        assert np.array_equal(call(some), expected)
    for jacobian in (jax.jacfwd(f), jax.jit(jax.jacrev(f))):
        np.testing.assert_allclose(jacobian(rows[0]), slopes[0], rtol=1e-15)
    np.testing.assert_allclose(jax.vmap(jax.jacrev(f))(some), slopes, rtol=1e-15)
    # a mapping; the gradient of a composed function has its keys
    value, slope = jax.jit(jax.value_and_grad(lambda x: f(x)[0] ** 2))({MASS: rows[0, 1]})
    at = np.array([function.start[0], rows[0, 1]])
    assert value == pytest.approx(function(at)[0] ** 2, rel=1e-15)
    assert slope == {MASS: pytest.approx(2.0 * function(at)[0] * function.jacobian(at)[0, 1], rel=1e-12)}


def test_a_batch_of_jax_is_one_ensemble(
    jax: ModuleType, function: QuantityFunction, rows: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    shapes = []
    plain = function._by_ensemble
    monkeypatch.setattr(function, "_by_ensemble", lambda table, tell: shapes.append(table.shape) or plain(table, tell))
    jax.vmap(in_jax(function))(rows)
    assert shapes == [(9, 2)]


def test_jax_refuses_what_it_cannot_do(smooth: Model, jax: ModuleType, function: QuantityFunction) -> None:
    f = in_jax(function)
    for call in (jax.hessian(f), jax.jacfwd(jax.jacfwd(f)), jax.jacrev(jax.jacrev(f)), jax.jit(jax.hessian(f))):
        with pytest.raises(RequestError, match="second derivative"):
            call(function.start)
    with pytest.raises(RequestError, match=CLEARANCE):
        f({"bearing.clearanc": 1e-5})
    with pytest.raises(RequestError, match=r"\(\.\.\., 2\) is expected"):
        jax.jit(f)(np.zeros(3))
    wrong = np.array([function.start[0], -1.0])
    with pytest.raises(RequestError, match="above 0"):
        f(wrong)
    with pytest.raises(jax.errors.JaxRuntimeError, match="above 0"):
        jax.jit(f)(wrong)
    lenient = in_jax(QuantityFunction(smooth, OF, (CLEARANCE, MASS), **SPAN, failed="nan"))
    with pytest.warns(UnknownValueWarning):
        assert np.isnan(jax.jit(jax.jacrev(lenient))(wrong)).all()
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(RequestError, match="jax_enable_x64"):
            f(function.start)
    finally:
        jax.config.update("jax_enable_x64", True)


@pytest.mark.filterwarnings(SCRIPT)
def test_pytorch_finds_derivatives_right(smooth: Model, torch: ModuleType) -> None:
    function = QuantityFunction(smooth, OF, (CLEARANCE, MASS), **TIGHT)
    f, start = in_torch(function), torch.as_tensor(function.start)
    scaled = f(start)
    x = torch.ones(2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda x: f(start * x) / scaled, x, eps=1e-3, rtol=2e-4, atol=1e-7, check_forward_ad=True
    )


def test_pytorch_gives_the_same_bits(torch: ModuleType, function: QuantityFunction, rows: np.ndarray) -> None:
    f, x = in_torch(function), torch.as_tensor(rows)
    for given in (x, rows, rows.tolist()):
        assert np.array_equal(f(given), function(rows))
    assert np.array_equal(torch.func.vmap(f)(x), function(rows))
    slopes = function.jacobian(rows[:2])
    np.testing.assert_allclose(torch.func.vmap(torch.func.jacrev(f))(x[:2]), slopes, rtol=1e-15)
    mass = torch.tensor(rows[0, 1], requires_grad=True)
    f({CLEARANCE: torch.tensor(rows[0, 0]), MASS: mass})[0].backward()
    assert float(mass.grad) == pytest.approx(slopes[0, 0, 1], rel=1e-15)
    # numbers, and the scene's where a name is left out, have 64 bits as well
    assert np.array_equal(f({MASS: rows[0, 1].item()}), function([function.start[0], rows[0, 1]]))


@pytest.mark.filterwarnings(SCRIPT)
def test_pytorch_refuses_what_it_cannot_do(torch: ModuleType, function: QuantityFunction) -> None:
    f, x = in_torch(function), torch.as_tensor(function.start)
    for again in (torch.func.jacfwd, torch.func.jacrev):
        with pytest.raises(RequestError, match="second derivative"):
            again(torch.func.jacrev(f))(x)
    with pytest.raises(RequestError, match=CLEARANCE):
        f({"bearing.clearanc": x})
    with pytest.raises(BallpassError, match=r"\(\.\.\., 2\) is expected"):
        f(torch.zeros(3))


def test_scipy_takes_it(smooth: Model) -> None:
    function = QuantityFunction(smooth, "rms:inner.y", (MASS,), **TIGHT)
    at = np.array([16.8])
    assert function.jacobian(at) == pytest.approx(approx_fprime(at, function, 1e-2), rel=1e-3)


@pytest.mark.parametrize("package", ["jax", "torch"])
def test_a_missing_package_is_named_with_the_command(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, f"ballpass.{package}", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ModuleNotFoundError, match=rf"pip install 'ballpass\[{package}\]'"):
        import_module(f"ballpass.{package}")


def test_a_function_that_has_differentiated_can_be_pickled(make_model: Callable[..., Model]) -> None:
    """As joblib and SciPy's workers do; what runs had left to be taken up again could not be."""
    function = QuantityFunction(make_model("varying_compliance"), "rms:inner.y", ["shaft.speed"], cycles=22)
    slope = function.jacobian(function.start)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(function)).jacobian(function.start), slope)


def test_nan_among_the_parameters_is_nan_with_a_warning(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    function = QuantityFunction(model, "rms:inner.y", ["shaft.speed"], cycles=22, failed="nan")
    with pytest.warns(UnknownValueWarning, match=r"a parameter is no finite number \(shaft.speed = nan\)"):
        assert np.isnan(function([np.nan]))


def test_nan_input_does_not_use_up_the_warning_of_a_run_that_fails(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    function = QuantityFunction(model, "rms:inner.y", ["load.force.x"], cycles=1, transient=0, failed="nan")
    with pytest.warns(UnknownValueWarning, match="no finite number"):
        function([np.nan])
    with pytest.warns(UnknownValueWarning, match="a ball is flattened by"):
        assert np.isnan(function([1.5e6]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        function([[np.nan], [1.5e6]])  # each was said
