"""Text with a unit to a number in SI.

In: a value of a scene file ("611.7 kg*mm^2", 0.5).  Out: one float in the SI unit the key asks for.

A scene is data, so nothing in it is evaluated: the grammar below is a part of that of Python's expressions, of which
only the tree is taken.  Sizes of the usual units are here, equal to pint's.  A caller with more units, as
`ballpass.derive` with pint's, gives a function that looks them up.

::

    quantity = number [unit]
    number   = decimal with a point, "6", "-0.5", "0.25e-5"
    unit     = factor { ("*" | "·" | "/" | blank) factor }      from left to right
    factor   = ( name | "1" | "(" unit ")" ) [ ("^" | "**") exponent | "²" | "³" ]
    exponent = [sign] decimal | "(" [sign] decimal ["/" decimal] ")"

Two things differ from pint.  The radian counts as a dimension: "Hz" and "rad/s" are different things here, while pint
silently loses a factor of 2 pi.  Arithmetic is rational: "0.3567 kg" and "356.7 g" are the same float, and
1 rpm is 2 pi/60 rad/s rounded once.
"""

from __future__ import annotations

import ast
import math
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from ballpass.runtime.contract.errors import RequestError

#: Unit of a number in a file -> factor and unit in tables and figures, where six digits of a displacement are six then.
_TABLE_UNITS = {"m": (1e6, "µm"), "m/s": (1e3, "mm/s"), "turns": (1e-6, "million turns")}

#: Longest text read as a quantity; the longest sensible one has some thirty characters.
MAX_LENGTH = 100
#: Largest power of a unit; rational arithmetic with "m^1000000" would not end.
MAX_EXPONENT = 12
#: Angle from which on numbers are more than 1e-6 rad apart, so that none has a place in a turn [rad].
MOST_ANGLE = 2.0**33
FAR_ANGLE = f"so large an angle has no place in a turn; allowed are angles within {MOST_ANGLE:.1e} rad"


class QuantityError(RequestError):
    """The text is not a quantity of the required unit.

    Parameters
    ----------
    problem : what is wrong, in one clause
    given : what was given
    allowed : the allowed values
    remedy : what to do
    """

    def __init__(self, *, problem: str, given: str, allowed: str, remedy: str) -> None:
        self.problem, self.given, self.allowed, self.remedy = problem, given, allowed, remedy
        super().__init__(f"{problem}; given: {given}; allowed: {allowed}; remedy: {remedy}")


#: SI unit of a key → what it measures, and how to write it.
KINDS: dict[str, tuple[str, str]] = {
    "1": ("a plain number", "0.5"),
    "kg": ("a mass", "0.36 kg"),
    "kg*m^2": ("a moment of inertia", "611.7 kg*mm^2"),
    "m": ("a length", "6 mm"),
    "m/s": ("a velocity", "2 mm/s"),
    "m/s^2": ("an acceleration", "9.81 m/s^2"),
    "rad": ("an angle", "237 deg"),
    "rad/s": ("a speed of rotation", "500 rpm"),
    "N": ("a force", "8964.8 N"),
    "N*m": ("a torque", "20 N*m"),
    "N/m": ("a stiffness", "50 N/um"),
    "N/m^1.5": ("a contact stiffness", "8.6e9 N/m^1.5"),
    "N*s/m": ("a damping coefficient", "500 N*s/m"),
    "s": ("a time", "0.5 s"),
    "s*m^0.5": ("a damping ratio c_b/k_b", "0.25e-5 s*mm^0.5"),
    "Pa": ("a pressure or an elastic modulus", "207 GPa"),
    "Hz": ("a frequency", "50 Hz"),
    "K": ("a difference of temperatures", "10 K"),
    "m^2/s": ("a kinematic viscosity", "32 mm^2/s"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitSize:
    """A unit: `exact` times `rounded` of its base units, which are pairs of name and power in order of name."""

    exact: Fraction
    rounded: float
    base: tuple[tuple[str, Fraction], ...]


#: Size of a unit by its name; GrammarError where there is none.
LookUp = Callable[[str], UnitSize]


class GrammarError(Exception):
    """Why a text is not a unit; `parse_quantity` turns it into a `QuantityError`."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.problem, self.remedy = problem, remedy


def table_unit(unit: str) -> tuple[float, str]:
    """Factor and unit of a number in tables and figures."""
    factor, shown = _TABLE_UNITS.get(unit, (1.0, unit))
    return factor, printed_unit(shown)


def printed_unit(unit: str) -> str:
    """A unit of a scene, a request or a file as tables and figures write it: N·s/m for N*s/m, m/s², µm."""
    for plain, sign in ((r"\*", "·"), (r"\^2(?![.\d])", "²"), (r"\^3(?![.\d])", "³"), (r"\bum\b", "µm")):
        unit = re.sub(plain, sign, unit)
    return unit


def parse_quantity(given: object, unit: str, look_up: LookUp | None = None) -> float:
    """Value in SI of a text or number of a scene file.

    Parameters
    ----------
    given : text such as "6 mm"; a plain number only where `unit` is "1"
    unit : SI unit of the result, one of `KINDS` or any other text of the same grammar
    look_up : for names that are not `COMMON`; None: they are refused

    Returns
    -------
    float
        Finite value [`unit`]

    Raises
    ------
    QuantityError
        No number, no unit or an unknown one, another dimension, not finite, offset or logarithmic unit, text too long.
    """
    kind, example = KINDS.get(unit, (f"a quantity in {unit}", f"1 {unit}"))
    allowed = f'{kind}, as in "{example}"' if unit != "1" else f"{kind}, as in {example}"

    def refuse(problem: str, remedy: str) -> QuantityError:
        return QuantityError(problem=problem, given=show(given), allowed=allowed, remedy=remedy)

    if isinstance(given, bool) or not isinstance(given, str | int | float):
        what = "a truth value" if isinstance(given, bool) else _type_name(given)
        raise refuse(f"{what} instead of {kind}", f"write {_quoted(example, unit)}")
    if not isinstance(given, str):
        if not abs(given) <= sys.float_info.max:
            raise refuse("the number is not finite", "give a finite number")
        if unit != "1":
            raise refuse("the unit is missing", f'write the number as text with its unit, "{show(given)} <unit>"')
        return float(given)

    text = given.strip().replace("\u2212", "-")  # the minus sign of printed tables
    if len(text) > MAX_LENGTH:
        raise refuse(f"a text of {len(text)} characters is no quantity", f"use at most {MAX_LENGTH} characters")
    match = _NUMBER.match(text)
    if match is None:
        if re.match(r"[+-]?(nan|inf)", text, re.IGNORECASE):
            raise refuse("the number is not finite", "give a finite number")
        raise refuse("no number in front", f"write a number, then its unit, as in {_quoted(example, unit)}")
    rest = text[match.end() :].strip()
    if re.match(r"[,'_]\s*[0-9]", rest):
        raise refuse("a number with a comma or another mark between its digits", 'write a decimal point: "6.5", "1000"')
    try:
        size = unit_size(rest, look_up)
    except GrammarError as error:
        raise refuse(error.problem, error.remedy) from None
    target = unit_size(unit, look_up)
    if size.base != target.base:
        raise refuse(*_dimension_fault(rest, size, target, kind, example, unit))
    try:
        number = Fraction(match.group())
        value = float(number * size.exact / target.exact) * (size.rounded / target.rounded)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise refuse("the number is not finite", "give a finite number")
    if unit == "rad" and abs(value) >= MOST_ANGLE:
        raise refuse(FAR_ANGLE, "give the angle without its whole turns")
    if value == 0.0 and number != 0:
        raise refuse("the number is too small to differ from zero", 'write "0" where zero is meant')
    return value


def split_setting(text: str) -> tuple[str, str, str]:
    """Path, equals sign and value of ``PATH=VALUE``; the value may stand in quotes, as in a scene file."""
    path, equals, value = (part.strip() for part in text.partition("="))
    quoted = len(value) > 1 and value[0] == value[-1] and value[0] in "\"'"
    return path, equals, value[1:-1] if quoted else value


def show(given: object, limit: int = 60) -> str:
    """A value as it is written in the file, shortened to `limit` characters."""
    if isinstance(given, str):
        text = f'"{given[:limit]}"'
    elif isinstance(given, bool):
        text = "true" if given else "false"
    elif isinstance(given, int) and given.bit_length() > 256:
        text = "an integer of more than 77 digits"
    elif isinstance(given, dict):
        text = "{ " + ", ".join(f"{key} = {_show_inner(value)}" for key, value in list(given.items())[:6]) + " }"
    elif isinstance(given, list):
        text = "[" + ", ".join(_show_inner(value) for value in given[:6]) + ("]" if len(given) <= 6 else ", ...]")
    else:
        text = str(given)
    text = "".join(character if character.isprintable() else "?" for character in text)
    return text if len(text) <= limit else text[: limit - 3] + "..."


def _show_inner(given: object) -> str:
    """A value inside a list or table; a file's tables may be nested to any depth, a message is short."""
    return "..." if isinstance(given, dict | list) else show(given, 20)


@lru_cache(maxsize=512)
def unit_size(text: str, look_up: LookUp | None = None) -> UnitSize:
    """Size of the unit written as `text`; the empty text is "1"."""
    if len(text) > MAX_LENGTH:
        raise GrammarError(f"a text of {len(text)} characters is no unit", f"use at most {MAX_LENGTH} characters")
    names: list[str] = []
    words: list[str] = []
    for match in _TOKEN.finditer(text):
        if match.lastgroup == "stray":
            raise GrammarError(
                f"the character {show(match.group())} has no place in a unit",
                'write units with names, "*", "/" and "^", as in "N*s/m" or "N/m^1.5"',
            )
        if match.lastgroup == "name":  # numbered, for Python has words that are units: in
            words.append(f"n{len(names)}")
            names.append(match.group())
        elif match.lastgroup == "sign":
            words.append(_SIGNS.get(match.group(), match.group()))
    product = re.sub(r"(?<=[\w)]) (?=[n(])", " * ", " ".join(words))
    # "250 /s" is a quotient; any other sign behind the number makes a computation of it, as a factor 0 does
    product = {"/": "1 ", "*": "0 ", "+": "0 ", "-": "0 "}.get(product[:1], "") + product
    try:
        return _size_of(ast.parse(product or "1", mode="eval").body, names, look_up or unknown_unit)
    except SyntaxError:
        raise GrammarError(
            f"{show(text)} has a place where no unit can go on",
            'write units with names, "*", "/" and "^", as in "kg*m^2/s"',
        ) from None


_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3}(?![0-9]))?")
_TOKEN = re.compile(
    r"(?P<name>[^\W\d²³][^\W²³]*|[%°])|(?P<sign>[0-9]+(?:\.[0-9]+)?|\*\*|[*·⋅/^²³()+-])|[ \t]+|(?P<stray>.)", re.DOTALL
)
#: What Python writes for signs of a unit.
_SIGNS = {"·": "*", "⋅": "*", "^": "**", "²": "**2", "³": "**3"}
_COMPUTATION = ("this is a computation, which is not done here", "write the result: one number and its unit")


def _size_of(unit: ast.expr, names: Sequence[str], look_up: LookUp) -> UnitSize:
    """Size of a unit of which Python has read the grammar alone."""
    match unit:
        case ast.Constant(value=1):
            return _size(Fraction(1), {})
        case ast.Name(id=word):
            name = names[int(word[1:])]
            return COMMON[name] if name in COMMON else look_up(name)
        case ast.BinOp(left=base, op=ast.Pow(), right=exponent):
            return _power(_size_of(base, names, look_up), _exponent(exponent))
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as sign, right=right):
            first, second = (_size_of(factor, names, look_up) for factor in (left, right))
            return _multiply(first, second, -1 if isinstance(sign, ast.Div) else 1)
    raise GrammarError(*_COMPUTATION)


def _exponent(written: ast.expr) -> Fraction:
    match written:
        case ast.Constant(value=number):
            return Fraction(str(number))
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=rest):
            return _exponent(rest) * (-1 if isinstance(sign, ast.USub) else 1)
        case ast.BinOp(left=above, op=ast.Div(), right=below):
            divisor = _exponent(below)
            if divisor == 0:
                raise GrammarError("a power with the denominator 0", 'write the power as in "m^1.5" or "m^(3/2)"')
            return _exponent(above) / divisor
    raise GrammarError(*_COMPUTATION)


def _multiply(left: UnitSize, right: UnitSize, sign: int) -> UnitSize:
    base = dict(left.base)
    for name, power in right.base:
        base[name] = base.get(name, Fraction(0)) + sign * power
    return UnitSize(
        exact=left.exact * right.exact**sign,
        rounded=left.rounded * right.rounded**sign,
        base=tuple(sorted((name, power) for name, power in base.items() if power)),
    )


def _power(size: UnitSize, exponent: Fraction) -> UnitSize:
    if abs(exponent) > MAX_EXPONENT:
        raise GrammarError("the power of a unit is too large", f"use powers between -{MAX_EXPONENT} and {MAX_EXPONENT}")
    base = tuple((name, power * exponent) for name, power in size.base if exponent)
    try:
        if exponent.denominator == 1:
            whole = int(exponent)
            return UnitSize(exact=size.exact**whole, rounded=size.rounded**whole, base=base)
        # An irrational factor such as mm^0.5 is rounded; it stays apart so that the rest is not.
        rounded = (float(size.exact) * size.rounded) ** float(exponent)
    except (OverflowError, ZeroDivisionError):
        rounded = math.inf
    if not (math.isfinite(rounded) and rounded > 0.0):
        raise GrammarError("the size of the unit is not a finite number", "use units nearer to SI")
    return UnitSize(exact=Fraction(1), rounded=rounded, base=base)


#: Pint's number, to its last digit.
_PI = Fraction("3.1415926535897932384626433832795028841971693993751")
_PREFIXES = {"": 0, "k": 3, "M": 6, "G": 9, "m": -3, "u": -6, "µ": -6, "μ": -6, "n": -9}
_UNITS: dict[str, tuple[int, dict[str, int]]] = {
    "m": (1, {"meter": 1}),
    "g": (1, {"gram": 1}),
    "s": (1, {"second": 1}),
    "N": (1000, {"gram": 1, "meter": 1, "second": -2}),
    "Pa": (1000, {"gram": 1, "meter": -1, "second": -2}),
    "bar": (10**8, {"gram": 1, "meter": -1, "second": -2}),
    "J": (1000, {"gram": 1, "meter": 2, "second": -2}),
    "W": (1000, {"gram": 1, "meter": 2, "second": -3}),
    "Hz": (1, {"second": -1}),
    "rad": (1, {"radian": 1}),
    "K": (1, {"kelvin": 1}),
}
_ANGLES = {"deg": _PI / 180, "°": _PI / 180, "turn": 2 * _PI}


def _size(exact: Fraction, base: dict[str, int]) -> UnitSize:
    return UnitSize(exact=exact, rounded=1.0, base=tuple((name, Fraction(power)) for name, power in base.items()))


#: Sizes of common names, so that most scenes are read without pint.
COMMON: dict[str, UnitSize] = {
    **{
        prefix + name: _size(size * Fraction(10) ** power, base)
        for name, (size, base) in _UNITS.items()
        for prefix, power in _PREFIXES.items()
    },
    **{name: _size(size, {"radian": 1}) for name, size in _ANGLES.items()},
    "%": _size(Fraction(1, 100), {}),
    "rpm": _size(_PI / 30, {"radian": 1, "second": -1}),
}


def unknown_unit(name: str) -> UnitSize:
    """Raise GrammarError: the name is not among `COMMON`, and there is no other source."""
    raise GrammarError(f"no unit is called {show(name)} here", unit_hint(name))


def unit_hint(name: str) -> str:
    """Remedy for a name that is not a unit."""
    if name.lower() in COMMON:
        return f'write "{name.lower()}"'
    if re.fullmatch(r"[kMm]?N[mn]*m?", name):
        return 'write products with "*", as in "N*m"'
    if re.search(r"\d", name):
        return 'write powers with "^", as in "mm^2"'
    return 'use a unit such as m, mm, um, kg, s, N, Pa, deg, rad, rpm, Hz; products with "*", as in "N*m"'


def _dimension_fault(
    rest: str, size: UnitSize, target: UnitSize, kind: str, example: str, unit: str
) -> tuple[str, str]:
    """Problem and remedy for a unit of another dimension than `target`."""
    if not rest:
        return "the unit is missing", f'add the unit, as in "{example}"'
    problem = f'the unit "{show(rest).strip(chr(34))}" has the wrong dimension for {kind}'
    of_angles = {
        "rad/s": f'cycles per second are not rad/s: write "rpm", "rad/s" or "turn/s" instead of "{rest}"',
        "Hz": f'a frequency counts cycles: write "Hz" or "1/s" instead of "{rest}"',
        "rad": 'write the angle in "deg" or "rad"',
    }
    first, second = ([item for item in one.base if item[0] != "radian"] for one in (size, target))
    if first == second and unit in of_angles:
        return problem, of_angles[unit]
    if unit == "1":
        return problem, "leave out the unit"
    if rest in ("Nm", "kNm"):
        return problem, f'write products with "*": "{rest[:-1]}*m"'
    return problem, f'use a unit as in "{example}" (SI: {unit})'


def _quoted(example: str, unit: str) -> str:
    return example if unit == "1" else f'"{example}"'


def _type_name(given: object) -> str:
    names = {"dict": "a table", "list": "a list", "datetime": "a date", "date": "a date", "time": "a time of day"}
    return names.get(type(given).__name__, "something else")


def ratio_unit(above: str, below: str) -> str:
    """Unit of a derivative."""
    if below in ("", "1"):
        return above or "1"
    under = f"({below})" if any(sign in below for sign in "*/") else below
    return f"{above or '1'}/{under}"
