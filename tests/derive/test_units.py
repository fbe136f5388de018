"""Claims about quantities in text: size, dimension, and that nothing in them is ever run."""

from __future__ import annotations

import math
import string
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import mpmath
import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ballpass.derive.scene.units import COMMON, KINDS, QuantityError, looked_up_size, parse_quantity
from ballpass.runtime.contract.errors import BallpassError
from ballpass.runtime.contract.units import table_unit


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        # Sizes by definition: SI prefixes, inch 25.4 mm, pound-force 4.4482216152605 N.
        ("6 mm", "m", 0.006),
        ("10um", "m", 10e-6),
        ("10 µm", "m", 10e-6),
        ("10 μm", "m", 10e-6),
        ("0.3126 inch", "m", 0.00794004),
        ("611.7 kg*mm^2", "kg*m^2", 611.7e-6),
        ("611.7 kg·mm²", "kg*m^2", 611.7e-6),
        ("611.7 kg mm**2", "kg*m^2", 611.7e-6),
        ("7517.545 g*m*mm", "kg*m^2", 7517.545e-6),
        ("207 GPa", "Pa", 207e9),
        ("207 kN/mm^2", "Pa", 207e9),
        ("50 N/um", "N/m", 5e7),
        ("1 lbf", "N", 4.4482216152605),
        ("9.81 m/s/s", "m/s^2", 9.81),
        ("9.81 m/(s*s)", "m/s^2", 9.81),
        ("9.81 m*s^-2", "m/s^2", 9.81),
        ("-0.5e-3 kN", "N", -0.5),
        ("+.5 N", "N", 0.5),
        ("683 N*s/m", "N*s/m", 683.0),
        ("683 kg/s", "N*s/m", 683.0),
        ("250 1/s", "Hz", 250.0),
        ("250/s", "Hz", 250.0),
        ("50 %", "1", 0.5),
        ("0.5", "1", 0.5),
        (0.5, "1", 0.5),
        (8, "1", 8.0),
        # Fractional powers: 1 mm^1.5 is 10^-4.5 m^1.5.
        ("1 N/mm^1.5", "N/m^1.5", 10**4.5),
        ("13.34e9 N/m^1.5", "N/m^1.5", 13.34e9),
        ("1 N/m^(3/2)", "N/m^1.5", 1.0),
        ("0.25e-5 s*mm^0.5", "s*m^0.5", 0.25e-5 * math.sqrt(1e-3)),
    ],
)
def test_sizes_of_units_are_those_of_their_definitions(text: object, unit: str, value: float) -> None:
    assert parse_quantity(text, unit) == pytest.approx(value, rel=4e-16, abs=0.0)


@pytest.mark.parametrize("rpm", ["1", "500", "393.1540342298", "-0.1"])
def test_rpm_is_two_pi_over_sixty_rounded_once(rpm: str) -> None:
    with mpmath.workdps(40):
        exact = 2 * mpmath.pi * mpmath.mpf(rpm) / 60
        assert parse_quantity(f"{rpm} rpm", "rad/s") == float(exact)


@pytest.mark.parametrize("degrees", ["1", "90", "237", "267", "-33.3"])
def test_degrees_are_pi_over_180_rounded_once(degrees: str) -> None:
    with mpmath.workdps(40):
        exact = mpmath.pi * mpmath.mpf(degrees) / 180
        assert parse_quantity(f"{degrees} deg", "rad") == float(exact)
        assert parse_quantity(f"{degrees}°", "rad") == float(exact)


def test_one_length_in_any_unit_is_one_float() -> None:
    assert {parse_quantity(text, "kg") for text in ("0.3567 kg", "356.7 g", "356700 mg", "3.567e-4 t")} == {0.3567}


@pytest.mark.parametrize(
    ("text", "unit", "remedy"),
    [
        ("50 Hz", "rad/s", "rpm"),
        ("50 1/s", "rad/s", "rad/s"),
        ("500 rpm", "Hz", "Hz"),
        ("3 rad/s", "Hz", "Hz"),
        ("0.5", "rad", "deg"),
        ("1 mm/m", "rad", "deg"),
        ("0.5 rad", "1", "leave out"),
    ],
)
def test_an_angle_is_no_plain_number(text: str, unit: str, remedy: str) -> None:
    with pytest.raises(QuantityError) as caught:
        parse_quantity(text, unit)
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("text", "unit", "problem", "remedy"),
    [
        (6, "m", "unit is missing", "6 <unit>"),
        (6.5, "m", "unit is missing", "6.5 <unit>"),
        ("6", "m", "unit is missing", "6 mm"),
        ("6 kg", "m", "wrong dimension", "SI: m"),
        ("6 N", "kg", "wrong dimension", "0.36 kg"),
        ("6 m", "1", "wrong dimension", "leave out the unit"),
        ("3 Nm", "N*m", "wrong dimension", "N*m"),
        ("6 millimetrs", "m", "no unit is called", "mm"),
        ("6 mm2", "m", "no unit is called", "^"),
        ("nan m", "m", "not finite", "finite"),
        ("-inf m", "m", "not finite", "finite"),
        ("1e999 m", "m", "not finite", "finite"),
        (math.nan, "1", "not finite", "finite"),
        (math.inf, "1", "not finite", "finite"),
        (10**400, "1", "not finite", "finite"),
        ("1e-400 m", "m", "too small", "0"),
        ("20 degC", "m", "offset", "proportional"),
        ("3 dB", "1", "offset or logarithmic", "proportional"),
        (True, "1", "truth value", "0.5"),
        (["6 mm"], "m", "a list", "6 mm"),
        ({"a": 1}, "m", "a table", "6 mm"),
        (None, "m", "something else", "6 mm"),
        ("", "m", "no number in front", "6 mm"),
        ("mm", "m", "no number in front", "6 mm"),
        ("6,5 mm", "m", "comma", "6.5"),
        ("1_000 mm", "m", "comma or another mark", "1000"),
        ("6 mm + 3 mm", "m", "computation", "result"),
        ("2*3 mm", "m", "computation", "result"),
        ("6 mm^-99", "m", "power of a unit is too large", "between"),
        ("6 m^(1/0)", "m", "denominator 0", "m^1.5"),
        ("6 mm)", "m", "no unit can go on", "names"),
        ("6 (mm", "m", "no unit can go on", "names"),
        ("6 mm*", "m", "no unit can go on", "names"),
        ("6 m\nm", "m", "no place in a unit", "names"),
        ("6 " + "m" * 200, "m", "202 characters", "at most"),
    ],
)
def test_a_text_that_is_no_quantity_is_refused_with_a_remedy(
    text: object, unit: str, problem: str, remedy: str
) -> None:
    with pytest.raises(QuantityError) as caught:
        parse_quantity(text, unit)
    assert problem in caught.value.problem
    assert remedy in caught.value.remedy
    assert isinstance(caught.value, BallpassError)
    for part in (caught.value.problem, caught.value.given, caught.value.allowed, caught.value.remedy):
        assert part
        assert part in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        '__import__("os").getpid() m',
        '1 __import__("os").getpid()',
        "1 m.__class__",
        "9**9**9**9",
        "1 m**9**9**9",
        "1 m^1000000000",
        "1e999999999 m",
        "1 " + "(" * 90,
        "1 " + "m*" * 49,
        "(lambda: 1)() m",
        "1 m; 2",
        "1 {m}",
    ],
)
def test_nothing_in_a_text_is_run_or_takes_long(text: str) -> None:
    with pytest.raises(QuantityError):
        parse_quantity(text, "m")


@given(st.text(alphabet=string.ascii_letters + string.digits + " */^().+-eE_%°·²\"'\\", max_size=40))
def test_any_text_is_a_finite_number_or_refused(text: str) -> None:
    for unit in ("m", "1", "N/m^1.5"):
        try:
            value = parse_quantity(text, unit)
        except QuantityError:
            continue
        assert math.isfinite(value)


@given(
    number=st.decimals(min_value=-(10**6), max_value=10**6, places=6),
    unit=st.sampled_from(sorted(KINDS)),
)
def test_a_number_in_si_keeps_its_value(number: object, unit: str) -> None:
    assert parse_quantity(f"{number} {unit}", unit) == float(str(number))


@pytest.mark.parametrize("name", ["mm", "inch", "kN", "lbf", "GPa", "psi", "minute", "rpm", "deg", "oz", "mile"])
def test_sizes_agree_with_pints_own_conversion(name: str) -> None:
    """A second route: pint's parser and converter in floating point."""
    quantity = pint.get_application_registry().Quantity(2.5, name).to_base_units()
    unit = {"kilogram": "kg", "meter": "m", "second": "s", "radian": "rad"}
    target = "*".join(f"{unit[base]}^{power}" for base, power in quantity.unit_items())
    assert parse_quantity(f"2.5 {name}", target) == pytest.approx(quantity.magnitude, rel=1e-14, abs=0.0)


def test_sizes_kept_here_are_those_of_pint() -> None:
    for name, size in COMMON.items():
        assert looked_up_size(name) == size


@pytest.mark.long
def test_scenes_are_read_without_pint() -> None:
    code = (
        "import sys; from pathlib import Path; from ballpass.derive import read_scene\n"
        "for path in Path('scenes').glob('*.toml'): read_scene(path)\n"
        "assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).resolve().parents[2])


def test_refusals_name_the_kind_that_is_asked_for() -> None:
    for unit, (kind, example) in KINDS.items():
        assert math.isfinite(parse_quantity(example, unit)), "every example of a message must itself be right"
        with pytest.raises(QuantityError, match=kind):
            parse_quantity("1 cd", unit)


@pytest.mark.parametrize("unit", sorted(set(KINDS) - {"1"}))
def test_a_number_of_a_table_is_read_in_a_scene(unit: str) -> None:
    factor, shown = table_unit(unit)
    assert not [sign for sign in ("*", "^2", "um") if sign in shown]
    assert parse_quantity(f"{factor!r} {shown}", unit) == pytest.approx(1.0, rel=1e-15, abs=0.0)


def test_rational_powers_multiply() -> None:
    exact = Fraction(1, 1000) ** 3
    assert parse_quantity("1 (mm^1.5)^2", "m^3") == pytest.approx(float(exact), rel=1e-15, abs=0.0)


def test_the_minus_of_printed_tables_is_understood_and_rpm_in_capitals_hinted_at() -> None:
    assert parse_quantity("\u22125 mm", "m") == parse_quantity("-5 mm", "m")
    with pytest.raises(QuantityError) as caught:
        parse_quantity("500 RPM", "rad/s")
    assert caught.value.remedy == 'write "rpm"'
