"""Methods of the stepper: figures have the orders printed for them, a wrong digit is found, docs name the method."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import fields, replace
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from order_conditions import PRECISION, Claims, classical_form, dense_weights, faults, stability_polynomial
from parts import ROOT
from reference_steps import ReferenceStep, Vector, explicit_step, floats, rosenbrock_step
from scipy.integrate import DOP853 as ScipyDop853
from scipy.integrate import RK45
from stepper_methods import EXPLICIT, IMPLICIT, ORDERS, TABLEAUS

from ballpass.runtime.contract.method_registry import OWN
from ballpass.runtime.contract.methods.dop853 import METHOD as DOP853
from ballpass.runtime.contract.methods.dp54 import METHOD as DORMAND_PRINCE_54
from ballpass.runtime.contract.methods.rodas4 import METHOD as RODAS4
from ballpass.runtime.contract.methods.rodas5p import METHOD as RODAS5P
from ballpass.runtime.contract.tableaus import ExplicitTableau, RosenbrockTableau, Row, Tableau, TableauError

#: Beside the orders of `ORDERS`: what is left of them in an algebraic component, and what the rounding of the printed
#: figures explains.
ROUNDING: dict[str, tuple[str, dict[str, tuple[int, ...]]]] = {
    # Printed to 30 digits, the dense output to 29: up to 5e-27 each where a figure is above 100; 3e-26 is the
    # largest residual.
    "stepper-dop853": ("1e-25", {}),
    # Printed to 16 digits: up to 5e-15 each where a figure is above 10; 1.2e-14 is the largest residual.
    "stepper-rodas4": ("1e-13", {"algebraic_orders": (4, 3, 2)}),
    # Printed from double precision: up to 1.4e-14 each where a figure is above 128; 2.3e-13 is the largest
    # residual.
    "stepper-rodas5p": ("1e-12", {"algebraic_orders": (4, 3, 3)}),
}


def claims_of(name: str) -> Claims:
    """Where figures are exact, what is left is the arithmetic of the check."""
    rounding, further = ROUNDING.get(name, ("1e-45", {}))
    order, dense_order = ORDERS[name]
    return Claims(order=order, dense_order=dense_order, rounding=Fraction(rounding), **further)


CLAIMS = {tableau.name: claims_of(name) for name, tableau in TABLEAUS.items()}


def named(names: Iterable[str]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("tableau", [TABLEAUS[name] for name in names], ids=lambda tableau: tableau.name)


every_method, explicit_methods, implicit_methods = named(TABLEAUS), named(EXPLICIT), named(IMPLICIT)


def test_methods_are_numbered_without_gaps() -> None:
    """Exported programs take the numbers."""
    assert [tableau.number for tableau in OWN.values()] == list(range(1, len(OWN) + 1))


def test_docs_have_a_row_of_every_method() -> None:
    scene, theory = (
        (ROOT / "docs" / page).read_text("utf-8") for page in ("reference/scene/run.md", "theory/integration.md")
    )
    (row,) = [line for line in scene.splitlines() if line.startswith("| `method` |")]
    for name, (order, _) in ORDERS.items():
        assert f'`"{name}"`' in row, f"docs/reference/scene/run.md does not name {name}"
        found = re.search(rf"^\| `{name}` \|.*\| {order}\(", theory, re.MULTILINE)
        assert found, f"docs/theory/integration.md has no row of {name} with order {order}"


# Figures against other prints


def test_dormand_prince_figures_equal_scipys():
    size = DORMAND_PRINCE_54.stages
    assert np.array_equal(floats(DORMAND_PRINCE_54.matrix, size)[:, :5], RK45.A)
    assert np.array_equal(floats((DORMAND_PRINCE_54.weights, DORMAND_PRINCE_54.nodes), size), [RK45.B, RK45.C])
    (estimate,) = DORMAND_PRINCE_54.error_estimates
    assert np.allclose(floats((estimate.weights,), 7)[0], -RK45.E, rtol=1e-15, atol=0)
    # SciPy's interpolant is Shampine's in powers of theta, printed apart from the nested form used here.
    assert np.allclose(floats(dense_weights(DORMAND_PRINCE_54), 7).T, RK45.P, rtol=1e-14, atol=1e-15)


def test_dop853_step_error_and_dense_output_equal_scipys():
    start, time, step = solution_at(0.3), 0.3, 0.4
    solver = ScipyDop853(slope, time, start, 5.0, first_step=step, rtol=1.0, atol=1.0)
    solver.step()
    ours = explicit_step(DOP853, slope, time, start, step)
    assert np.allclose(ours.end, solver.y, rtol=1e-15, atol=1e-15)
    theirs = solver.dense_output()
    for theta in np.linspace(0, 1, 7):
        assert np.allclose(ours.dense(theta), theirs(time + theta * step), rtol=1e-14, atol=0)

    scale = np.array([1e-3, 2e-3])
    norms = [np.mean((error / scale) ** 2) for error in ours.errors]
    shares = [float(estimate.share) for estimate in DOP853.error_estimates]
    combined = norms[0] / math.sqrt(sum(share * norm for share, norm in zip(shares, norms, strict=True)))
    # what is left of sums of slopes that cancel to 4e-8 of the states, each rounded
    assert combined == pytest.approx(solver._estimate_error_norm(solver.K, step, scale), rel=1e-9, abs=0.0)


def test_rodas4_has_the_free_parameters_printed_for_it():
    # Hairer & Wanner print beta_2', beta_3', beta_4', the row sums of beta_ij without the diagonal, beside the figures.
    form = classical_form(RODAS4)
    sums = [sum(form.alpha[row]) + sum(form.gamma[row][:row]) for row in range(4)]
    assert np.allclose([float(number) for number in sums], [0, 0.0317, 0.0635, 0.3438], rtol=0, atol=1e-14)


# Order conditions


@every_method
def test_figures_meet_every_condition_of_the_claimed_orders(tableau):
    assert faults(tableau, CLAIMS[tableau.name]) == []


def changed_rows(rows: tuple[Row, ...], change: Fraction) -> Iterator[tuple[Row, ...]]:
    for place, row in enumerate(rows):
        for column, number in enumerate(row):
            yield (*rows[:place], (*row[:column], number + change, *row[column + 1 :]), *rows[place + 1 :])


def changes(tableau: Tableau, change: Fraction) -> Iterator[tuple[str, object]]:
    """Every field of figures with one figure changed."""
    for field in fields(tableau):
        value = getattr(tableau, field.name)
        if field.name == "gamma":
            yield field.name, value + change
        elif field.name == "error_estimates":
            for place, estimate in enumerate(value):
                for (row,) in changed_rows((estimate.weights,), change):
                    yield field.name, (*value[:place], replace(estimate, weights=row), *value[place + 1 :])
        elif isinstance(value, tuple):
            if value and isinstance(value[0], Fraction):
                yield from ((field.name, row) for (row,) in changed_rows((value,), change))
            else:
                yield from ((field.name, rows) for rows in changed_rows(value, change))


def count_figures(tableau: Tableau) -> int:
    """All that are printed, without the shares of error estimates, which are a choice."""
    shares = len(tableau.error_estimates) if isinstance(tableau, ExplicitTableau) else 0
    return repr(tableau).count("Fraction(") - shares


def free_figures(tableau: Tableau) -> Row:
    """Weights in the dense output of the last stage, whose u is an error estimate and so smaller than any condition."""
    return tuple(row[-1] for row in tableau.dense_rows) if isinstance(tableau, RosenbrockTableau) else ()


@pytest.mark.parametrize(
    "tableau",
    [pytest.param(t, id=t.name, marks=pytest.mark.long if t.name == "DOP853" else ()) for t in TABLEAUS.values()],
)
def test_any_changed_figure_is_found(tableau):
    claims = CLAIMS[tableau.name]
    found = 0
    for name, value in changes(tableau, 1000 * claims.rounding):
        changed = replace(tableau, **{name: value})
        free = free_figures(changed) != free_figures(tableau)
        assert (faults(changed, claims) == []) == free, (name, value)
        found += not free
    assert found == count_figures(tableau) - len(free_figures(tableau))


def test_figures_that_no_condition_fixes_are_the_printed_ones():
    assert free_figures(RODAS4) == (0, 0)
    printed = ("-0.17202221070155493", "-6.710236069923372", "4.883087185713722")
    assert free_figures(RODAS5P) == tuple(Fraction(number) for number in printed)


@every_method
@pytest.mark.parametrize(("claim", "label"), [("order", "solution: tree"), ("dense_order", "dense output: tree")])
def test_no_order_is_higher_than_claimed(tableau, claim, label):
    claims = CLAIMS[tableau.name]
    found = faults(tableau, replace(claims, **{claim: getattr(claims, claim) + 1}))
    assert found != []
    assert all(fault.startswith(label) for fault in found)


@implicit_methods
@pytest.mark.parametrize(("place", "label"), list(enumerate(["solution", "error estimate", "dense output"])))
def test_no_order_in_the_algebraic_component_is_higher_than_claimed(tableau, place, label):
    claims = CLAIMS[tableau.name]
    orders = list(claims.algebraic_orders)
    orders[place] += 1
    found = faults(tableau, replace(claims, algebraic_orders=tuple(orders)))
    assert found != []
    assert all(fault.startswith(label) and "tree {" in fault for fault in found)


@pytest.mark.parametrize("off", [-1, 1])
def test_embedded_order_is_exact(off):
    others = [(t, replace(t, embedded_order=t.embedded_order + off)) for t in map(TABLEAUS.get, IMPLICIT)]
    for tableau in map(TABLEAUS.get, EXPLICIT):
        for place, estimate in enumerate(tableau.error_estimates):
            estimates = list(tableau.error_estimates)
            estimates[place] = replace(estimate, order=estimate.order + off)
            others.append((tableau, replace(tableau, error_estimates=tuple(estimates))))
    for tableau, other in others:
        found = faults(other, CLAIMS[tableau.name])
        assert found != []
        assert all(fault.startswith("error estimate of order") for fault in found)


def test_missing_figure_is_named():
    with pytest.raises(TableauError, match=r"weights: rows of \[5\] figures, needed \[6\]"):
        replace(DORMAND_PRINCE_54, weights=DORMAND_PRINCE_54.weights[:-1])
    with pytest.raises(TableauError, match=r"coupling: rows of"):
        replace(RODAS4, coupling=RODAS4.coupling[:-1])


# Order by experiment: u = exp(sin phi), v = cos phi with phi = t + t**2 / 4 solve a nonlinear system that depends on t.


def solution_at(time: float) -> Vector:
    phase = time + time**2 / 4
    return np.array([math.exp(math.sin(phase)), math.cos(phase)])


def slope(time: float, state: Vector) -> Vector:
    u, v = state
    return (1 + time / 2) * np.array([u * v, -math.log(u)])


def jacobian(time: float, state: Vector) -> Vector:
    u, v = state
    return (1 + time / 2) * np.array([[v, u], [-1 / u, 0]])


def time_derivative(time: float, state: Vector) -> Vector:
    u, v = state
    return np.array([u * v, -math.log(u)]) / 2


def step_of(tableau: Tableau, time: float, step: float) -> ReferenceStep:
    start = solution_at(time)
    if isinstance(tableau, ExplicitTableau):
        return explicit_step(tableau, slope, time, start, step)
    return rosenbrock_step(tableau, slope, jacobian(time, start), time_derivative(time, start), time, start, step)


def errors_of(result: ReferenceStep, time: float, step: float) -> list[Vector]:
    """Errors of solution, embedded solutions and dense output."""
    end = solution_at(time + step)
    thetas = np.linspace(0.1, 0.9, 9)
    dense = np.array([result.dense(theta) - solution_at(time + theta * step) for theta in thetas])
    return [result.end - end, *(result.end - error - end for error in result.errors), dense]


def slopes_of(steps: list[float], errors: list[list[float]]) -> list[float]:
    """Order of each column, fitted to the four smallest steps whose error is not rounding."""
    found = []
    for column in np.array(errors).T:
        usable = np.flatnonzero(column > 5e-14)[-4:]
        found.append(float(np.polyfit(np.log(np.array(steps)[usable]), np.log(column[usable]), 1)[0]))
    return found


@every_method
def test_one_step_converges_with_the_claimed_orders(tableau):
    steps = [0.4 * 2 ** (-k / 2) for k in range(13)]
    starts = np.linspace(0, 3, 13)
    errors = []
    for step in steps:
        of_starts = [errors_of(step_of(tableau, time, step), time, step) for time in starts]
        errors.append([float(np.linalg.norm(kind)) for kind in map(np.array, zip(*of_starts, strict=True))])
    if isinstance(tableau, ExplicitTableau):
        embedded = [estimate.order for estimate in tableau.error_estimates]
    else:
        embedded = [tableau.embedded_order]
    claims = CLAIMS[tableau.name]
    claimed = [order + 1 for order in (claims.order, *embedded, claims.dense_order)]
    assert slopes_of(steps, errors) == pytest.approx(claimed, abs=0.3)


@every_method
def test_combined_error_shrinks_with_the_exponent_for_the_controller(tableau):
    shares = [1.0]
    if isinstance(tableau, ExplicitTableau):
        shares = [float(estimate.share) for estimate in tableau.error_estimates]

    def combined(step: float) -> float:
        norms = [np.mean(error**2) for error in step_of(tableau, 0.5, step).errors]
        return float(norms[0] / math.sqrt(sum(share * norm for share, norm in zip(shares, norms, strict=True))))

    order = math.log2(combined(0.04) / combined(0.02))
    assert order == pytest.approx(tableau.error_exponent, abs=0.3)


@explicit_methods
def test_explicit_dense_output_joins_with_continuous_slope(tableau):
    weights = dense_weights(tableau).astype(float)
    degrees = np.arange(1, len(weights) + 1)
    assert np.allclose(weights.sum(axis=0)[: tableau.stages], floats((tableau.weights,), tableau.stages)[0], atol=1e-12)
    units = np.eye(weights.shape[1])
    assert np.allclose(weights[0], units[0], atol=1e-12)
    assert np.allclose(degrees @ weights, units[tableau.stages], atol=1e-11)


@implicit_methods
def test_rosenbrock_dense_output_meets_both_ends(tableau):
    weights = dense_weights(tableau).astype(float)
    assert np.allclose(weights.sum(axis=0), floats((tableau.weights,), tableau.stages)[0], rtol=0, atol=1e-13)
    start = np.array([0.7])
    result = rosenbrock_step(tableau, lambda t, y: -(y**2), -2 * start[None], np.zeros(1), 0.0, start, 0.3)
    assert result.dense(1.0) == pytest.approx(result.end, abs=1e-15)
    assert result.dense(0.0) == pytest.approx(start, abs=1e-15)


# Stiffness


def classical_arrays(tableau: RosenbrockTableau) -> tuple[Vector, Vector, Vector, Vector]:
    form = classical_form(tableau)
    ((_, error_weights),) = form.error_weights
    alpha, gamma, weights, errors = (
        figures.astype(float) for figures in (form.alpha, form.gamma, form.weights, error_weights)
    )
    return alpha, gamma, weights, errors


def stability(tableau: RosenbrockTableau, z: complex) -> complex:
    alpha, gamma, weights, _ = classical_arrays(tableau)
    ones = np.ones(tableau.stages)
    return complex(1 + z * weights @ np.linalg.solve(np.eye(tableau.stages) - z * (alpha + gamma), ones))


@implicit_methods
def test_rosenbrock_methods_are_l_stable(tableau):
    assert max(abs(stability(tableau, 1j * y)) for y in np.logspace(-2, 6, 400)) <= 1 + 1e-13
    assert abs(stability(tableau, -1e9)) < 1e-7
    assert stability(tableau, -0.01) == pytest.approx(math.exp(-0.01), abs=1e-11)


@implicit_methods
def test_one_long_step_of_a_stiff_equation_ends_at_rest(tableau):
    rate = -1e10
    result = rosenbrock_step(tableau, lambda t, y: rate * y, np.array([[rate]]), np.zeros(1), 0.0, np.array([1.0]), 1.0)
    assert abs(result.end[0]) < 1e-8
    assert abs(result.end[0] - result.errors[0][0]) < 1e-8  # the embedded solution as well


@implicit_methods
def test_classical_and_transformed_form_take_the_same_step(tableau):
    alpha, gamma, weights, error_weights = classical_arrays(tableau)
    time, step = 0.4, 0.2
    start = solution_at(time)
    matrix = np.eye(2) - step * gamma[0, 0] * jacobian(time, start)
    slopes = np.zeros((tableau.stages, 2))
    for stage in range(tableau.stages):
        at = time + alpha[stage].sum() * step
        rhs = slope(at, start + step * alpha[stage] @ slopes)
        rhs = rhs + step * jacobian(time, start) @ (gamma[stage, :stage] @ slopes[:stage])
        rhs = rhs + step * gamma[stage].sum() * time_derivative(time, start)
        slopes[stage] = np.linalg.solve(matrix, rhs)
    transformed = step_of(tableau, time, step)
    assert np.allclose(start + step * weights @ slopes, transformed.end, rtol=1e-13, atol=0)
    assert np.allclose(step * error_weights @ slopes, transformed.errors[0], rtol=1e-7, atol=1e-15)
    powers = classical_form(tableau).dense_weights.astype(float)
    at_middle = start + step * (0.5 ** np.arange(1, len(powers) + 1)) @ powers @ slopes
    assert np.allclose(at_middle, transformed.dense(0.5), rtol=1e-13, atol=0)


@implicit_methods
def test_index_one_system_converges_with_the_claimed_orders(tableau):
    # u' = (1 + t / 2) u v and 0 = 1 - v**2 - log(u)**2 have the same solution as above while v > 0.
    def constrained(time: float, state: Vector) -> Vector:
        u, v = state
        return np.array([(1 + time / 2) * u * v, 1 - v**2 - math.log(u) ** 2])

    mass = np.diag([1.0, 0.0])
    steps = [0.2 * 2 ** (-k / 2) for k in range(13)]
    errors = []
    for step in steps:
        of_starts = []
        for time in np.linspace(0.2, 0.6, 5):
            u, v = start = solution_at(time)
            rate = 1 + time / 2
            matrix = np.array([[rate * v, rate * u], [-2 * math.log(u) / u, -2 * v]])
            derivative = np.array([u * v / 2, 0.0])
            result = rosenbrock_step(tableau, constrained, matrix, derivative, time, start, step, mass)
            of_starts.append(errors_of(result, time, step))
        kinds = [np.array(kind) for kind in zip(*of_starts, strict=True)]
        errors.append([float(np.linalg.norm(kind[..., part])) for part in (0, 1) for kind in kinds])
    found = slopes_of(steps, errors)
    claims = CLAIMS[tableau.name]
    differential = (claims.order, tableau.embedded_order, claims.dense_order)
    claimed = [order + 1 for order in (*differential, *claims.algebraic_orders)]
    assert all(order > claim - 0.3 for order, claim in zip(found, claimed, strict=True)), (found, claimed)


# Stability polynomials


@explicit_methods
def test_stability_polynomial_is_the_exponential_series_through_the_order(tableau):
    coefficients = stability_polynomial(tableau)
    claims = CLAIMS[tableau.name]
    assert len(coefficients) == tableau.stages + 1
    for power in range(claims.order + 1):
        assert abs(coefficients[power] - Fraction(1, math.factorial(power))) <= claims.rounding
    assert coefficients[claims.order + 1 :][:1] != (Fraction(1, math.factorial(claims.order + 1)),)


def test_stability_polynomial_of_dormand_prince_ends_with_one_six_hundredth():
    # Hairer & Wanner II, section IV.2, eq. (2.13): R(z) = 1 + z + ... + z**5 / 120 + z**6 / 600.
    assert stability_polynomial(DORMAND_PRINCE_54)[6] == Fraction(1, 600)


# Layout that the generated step relies on


def test_end_slope_enters_the_error_of_dormand_prince_only():
    both = (DORMAND_PRINCE_54, DOP853)
    ends = [[estimate.weights[-1] for estimate in tableau.error_estimates] for tableau in both]
    assert ends == [[Fraction(-1, 40)], [0, 0]]
    assert [len(tableau.dense_nodes) for tableau in both] == [0, 3]


@explicit_methods
def test_first_error_estimate_has_share_one(tableau):
    assert tableau.error_estimates[0].share == 1


@implicit_methods
def test_arguments_of_the_last_stages_continue_one_another(tableau):
    first = tableau.nodes.index(1)
    rows = (*tableau.matrix[first:], tableau.weights)
    for before, after in pairwise(rows):
        assert after == (*before, Fraction(1))
    assert all(node == 1 for node in tableau.nodes[first:])
    assert all(weight == 0 for weight in tableau.time_weights[first:])


@implicit_methods
def test_classical_form_is_stiffly_accurate_to_all_decimals(tableau):
    form = classical_form(tableau)
    with localcontext(prec=PRECISION):
        assert max(abs(form.alpha[-1] + form.gamma[-1] - form.weights)) < Decimal("1e-45")
