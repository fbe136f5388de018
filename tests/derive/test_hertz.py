"""Hertz point contact against printed tables, against mpmath, and against the 1977 approximation."""

from __future__ import annotations

import math

import casadi as ca
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from ballpass.derive.bearing.elements import hertz
from ballpass.derive.bearing.elements.ball import Ball
from ballpass.derive.lowering.visitor import Visitor

BALL, PITCH = 7.9375e-3, 33.5e-3
COMPLIANCE = 2 * (1 - 0.3**2) / 207e9
RATIO = sp.Symbol("ratio", real=True)


def lowered(expression: sp.Expr) -> ca.Function:
    x = ca.SX.sym("x")
    return ca.Function("f", [x], [Visitor({RATIO: x}, {})(expression)])


def raceway(sign: int) -> tuple[float, float]:
    """Curvature ratio and sum of the 6204's inner (+1) or outer (-1) contact."""
    groove = 0.52 if sign > 0 else 0.53
    ratio, total = hertz.curvature_ratio(
        sp.Float(BALL, 20), sp.Float(sign * (PITCH - sign * BALL) / 2, 20), sp.Float(groove * BALL, 20)
    )
    return ratio, total


def stiffness(sign: int) -> float:
    ratio, total = raceway(sign)
    return float(
        hertz.contact_stiffness(kappa=hertz.ellipticity(ratio), curvature_sum=total, compliance=COMPLIANCE).evalf(20)
    )


def test_stiffness_of_the_6204() -> None:
    inner, outer = stiffness(1), stiffness(-1)
    assert inner == pytest.approx(2.52959e10, rel=3e-6)
    assert outer == pytest.approx(2.36521e10, rel=3e-6)
    assert Ball().in_series([inner, outer]) == pytest.approx(8.64473e9, rel=3e-6)


@pytest.mark.parametrize(
    ("f_rho", "a_star", "b_star", "delta_star"),
    [
        (0.3204, 1.2623, 0.8114, 0.9761),
        (0.5916, 1.6440, 0.6687, 0.9077),
        (0.7332, 2.011, 0.5881, 0.8394),
        (0.90999, 3.233, 0.4499, 0.6636),
        (0.97290, 5.267, 0.3490, 0.4960),
        (0.997300, 12.789, 0.2232, 0.2705),
    ],
)
def test_dimensionless_contact_parameters_equal_harris_table(
    f_rho: float, a_star: float, b_star: float, delta_star: float
) -> None:
    kappa = hertz.ellipticity(sp.Float((1 - f_rho) / (1 + f_rho), 20))
    second = sp.elliptic_e(1 - kappa**-2)
    assert float(sp.cbrt(2 * kappa**2 * second / sp.pi).evalf()) == pytest.approx(a_star, rel=1e-3)
    assert float(sp.cbrt(2 * second / (sp.pi * kappa)).evalf()) == pytest.approx(b_star, rel=1e-3)
    assert float(hertz.deflection_factor(kappa).evalf()) == pytest.approx(delta_star, rel=1e-3)


@pytest.mark.parametrize(
    ("gamma", "kappa", "second"),
    [(0.10, 8.675157, 1.020324), (0.20, 9.317368, 1.018022), (0.23, 9.535239, 1.017333), (0.30, 10.099802, 1.015726)],
)
def test_ellipticity_equals_iso_tr_10657_table_a1(gamma: float, kappa: float, second: float) -> None:
    # inner contact, groove radius 0.52 of the ball diameter, gamma = ball diameter over pitch diameter
    ratio, _ = hertz.curvature_ratio(sp.Float(gamma, 20), sp.Float((1 - gamma) / 2, 20), sp.Float(0.52 * gamma, 20))
    computed = hertz.ellipticity(ratio).evalf()
    assert float(computed) == pytest.approx(kappa, rel=1e-4)
    assert float(sp.elliptic_e(1 - computed**-2)) == pytest.approx(second, rel=1e-4)


@settings(max_examples=30)
@given(st.floats(min_value=1e-4, max_value=0.9))
def test_unrolled_iteration_agrees_with_mpmath(ratio: float) -> None:
    exact = hertz.ellipticity(sp.Float(ratio, 30)).evalf(20)
    assert float(lowered(hertz.ellipticity(RATIO))(ratio)) == pytest.approx(float(exact), rel=2e-13, abs=0.0)


@pytest.mark.parametrize("kappa", [1.05, 2.0, 9.5875, 40.0])
def test_generated_elliptic_integrals_agree_with_mpmath(kappa: float) -> None:
    for integral in (sp.elliptic_k, sp.elliptic_e):
        expression = integral(1 - RATIO**-2)
        exact = float(expression.subs(RATIO, sp.Float(kappa, 30)).evalf(20))
        assert float(lowered(expression)(kappa)) == pytest.approx(exact, rel=1e-13, abs=0.0)


@pytest.mark.parametrize("ratio", [1e-3, 0.029348, 0.07, 0.5])
def test_derivative_passes_through_the_iteration(ratio: float) -> None:
    """Derivative of the unrolled iteration, implicit derivative, and a difference in 40 digits agree."""
    function = lowered(hertz.ellipticity(RATIO))
    x = ca.SX.sym("x")
    automatic = float(ca.Function("d", [x], [ca.jacobian(function(x), x)])(ratio))
    implicit = float(sp.diff(hertz.ellipticity(RATIO), RATIO).subs(RATIO, sp.Float(ratio, 40)).evalf(20))
    step = sp.Float(ratio, 40) * sp.Float("1e-12", 40)
    difference = (
        hertz.ellipticity(sp.Float(ratio, 40) + step).evalf(40)
        - hertz.ellipticity(sp.Float(ratio, 40) - step).evalf(40)
    ) / (2 * step)
    assert automatic == pytest.approx(float(difference), rel=1e-10)
    assert implicit == pytest.approx(float(difference), rel=1e-12)


def test_brewe_hamrock_1977_is_off_by_the_known_amounts() -> None:
    """doi:10.1115/1.3453245: +1.8 % on the inner contact of a 6204, -0.2 % on the outer."""

    def approximate(sign: int) -> float:
        ratio, total = (float(v) for v in raceway(sign))
        along_over_across = 1 / ratio
        kappa = 1.0339 * along_over_across**0.636
        second = 1.0003 + 0.5968 / along_over_across
        first = 1.5277 + 0.6023 * math.log(along_over_across)
        modulus = 2 / COMPLIANCE
        return math.pi * kappa * modulus * math.sqrt(second / (4.5 * total * first**3))

    assert approximate(1) / stiffness(1) - 1 == pytest.approx(0.018, abs=5e-4)
    assert approximate(-1) / stiffness(-1) - 1 == pytest.approx(-0.002, abs=5e-4)
