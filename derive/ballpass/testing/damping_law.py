"""What must hold of every damping law of a ball, tried on a bearing under constant load.

In: the name of a law and its lines of ``[bearing.damping]``.  Out: nothing, or all that does not hold.
"""

from __future__ import annotations

import itertools
import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import casadi as ca
import numpy as np
import sympy as sp

from ballpass.derive import generate, shipped_scenes
from ballpass.derive.bearing.laws import LAWS, DampingLaw
from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.switching import find_switching
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import load
from ballpass.runtime.contract.errors import BallpassError
from ballpass.runtime.contract.plugins import use
from ballpass.runtime.contract.units import unit_size

_DELTA, _RATE, _STIFFNESS, _COEFFICIENT = sp.symbols("delta rate k c", real=True)

#: Deflections [m] and rates [m/s] on both sides of contact and rest, near and far.
_DELTAS, _RATES = (-4e-6, -3e-9, 2e-9, 1e-7, 7e-6), (-0.3, -1e-4, 2e-6, 3e-3, 0.2)

#: How far values may be apart, relative: by three routes; slopes from differences; with other units.
_SAME, _SLOPE, _UNITS = 1e-12, 1e-6, 1e-10

Force = Callable[[float, float], float]


class ConformanceError(BallpassError, AssertionError):
    """What does not hold of a law, all of it."""


def check_damping_law(law: str, numbers: str, *, plugins: Sequence[str] = ()) -> None:
    """Check a damping law of the scene file.

    SymPy, CasADi and the compiled C give one force; slopes are those of differences; the force has the unit N where
    the numbers have theirs; it jumps only where steps end; it is finite, nothing at rest, and takes energy.

    Parameters
    ----------
    law : its name
    numbers : its lines in ``[bearing.damping]``
    plugins : see `read_scene`

    Raises
    ------
    ConformanceError
        With all that does not hold.

    Examples
    --------
    >>> check_damping_law("tangent", 'ratio = "2e-5 s"')
    """
    use(plugins)
    own = LAWS[law]
    formula = _formula(own)
    if others := formula.free_symbols - {_DELTA, _RATE, _STIFFNESS, _COEFFICIENT}:
        raise ConformanceError(
            f'The damping law "{law}": its force has {", ".join(sorted(map(str, others)))} beside deflection, rate, '
            "coefficient and contact. Allowed: one number of its own, the coefficient, made of all that the law has."
        )
    text = shipped_scenes()["varying-compliance"].read_text(encoding="utf-8")
    scene = scene_from_text(text.replace('law = "none" ', f'law = "{law}"\n{numbers}  '), "conformance")
    with tempfile.TemporaryDirectory() as place:
        model = load(generate(scene, Path(place) / "conformance"))
        routes = {"CasADi": model.symbolic("contact"), "the compiled C": model.function("contact")}
    p, c = (np.array(a) for a in (model.numbers().p, model.numbers().c))
    constants = model.constants()
    k_b, c_b = constants["bearing.k_b"], constants.get("bearing.c_b", 0.0)
    exact = sp.lambdify((_DELTA, _RATE, _STIFFNESS, _COEFFICIENT), formula, "mpmath")

    def force(delta: float, rate: float) -> float:
        return float(exact(delta, rate, k_b, c_b))

    faults = [*_values(force), *_units(own, exact, k_b, c_b), *_jumps(formula, force)]
    for name, function in routes.items():
        worst = max(_apart(float(function(d, v, p, c)[1]), force(d, v)) for d, v in _points())
        if worst > _SAME:
            faults.append(f"{name} and SymPy differ by {worst:.1g} of the force")
    faults += _slopes(routes["CasADi"], force, p, c)
    if faults:
        raise ConformanceError(f'The damping law "{law}":' + "".join(f"\n  - {fault}" for fault in faults))


def _points() -> Iterator[tuple[float, float]]:
    return itertools.product(_DELTAS, _RATES)


def _apart(one: float, other: float) -> float:
    return abs(one - other) / max(abs(one), abs(other), 1e-300)


def _formula(law: DampingLaw) -> sp.Expr:
    contact = Contact(stiffness=_STIFFNESS, exponent=sp.Rational(3, 2))
    return sp.sympify(law.force(_DELTA, _RATE, _COEFFICIENT, contact, SmoothedRest()))


def _values(force: Force) -> Iterator[str]:
    found = {(d, v): force(d, v) for d, v in _points()}
    if not all(map(math.isfinite, found.values())):
        yield "the force is not finite"
    if any(force(d, 0.0) != 0.0 for d in _DELTAS):
        yield "the force is not zero at rest"
    if given := [(d, v) for (d, v), f in found.items() if f * v < 0.0]:
        yield f"the force gives energy instead of taking it, at deflection and rate {given[0]}"


def _units(law: DampingLaw, exact: Callable[..., float], k_b: float, c_b: float) -> Iterator[str]:
    """The force in units of other sizes is the same force."""
    sizes: dict[str, float] = {}

    def factor(unit: str) -> float:
        product = 1.0
        for name, power in unit_size(unit).base:
            product *= sizes.setdefault(name, (2.3, 0.7, 1.9, 0.3)[len(sizes)]) ** float(power)
        return product

    scales = factor("m"), factor("m/s"), factor("N/m^1.5"), factor(law.unit)
    for d, v in _points():
        scaled = float(exact(*(a * s for a, s in zip((d, v, k_b, c_b), scales, strict=True)))) / factor("N")
        if _apart(scaled, float(exact(d, v, k_b, c_b))) > _UNITS:
            yield f"the force has not the unit N where its coefficient has the unit {law.unit}"
            return


def _slopes(contact: ca.Function, force: Force, p: np.ndarray, c: np.ndarray) -> Iterator[str]:
    """Slopes as the program has them, against differences of the formula."""
    delta, rate = ca.SX.sym("delta"), ca.SX.sym("rate")
    value = contact(delta, rate, p, c)[1]
    slopes = ca.Function("slopes", [delta, rate], [ca.gradient(value, ca.vertcat(delta, rate))])
    for d, v in _points():
        steps = (1e-4 * abs(d), 0.0), (0.0, 1e-4 * abs(v))
        for found, (a, b), words in zip(np.array(slopes(d, v)).ravel(), steps, ("deflection", "rate"), strict=True):
            ends, h = [force(d + s * a, v + s * b) for s in (-2, -1, 1, 2)], a + b
            difference = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
            size = max(abs(difference), abs(found), 1e-6 * max(map(abs, ends)) / h)
            if abs(found - difference) > _SLOPE * size:
                place = f"at deflection {d:g} m and rate {v:g} m/s"
                yield f"its slope by the {words} is {found:.6g} {place}, and by differences {difference:.6g}"
                return


def _jumps(formula: sp.Expr, force: Force) -> Iterator[str]:
    """Jumps at places where no step ends."""
    switches = [
        (s.of_rate, s.function) for s in find_switching([formula], _DELTA, _RATE, pairs=False).switches if s.jumps
    ]
    fine = np.geomspace(1e-14, 1.0, 600)
    line = np.concatenate([-fine[::-1], fine])
    lines: list[tuple[str, np.ndarray, Callable[[float], float]]] = []
    for d in _DELTAS:
        lines.append(("rate", line, lambda at, d=d: force(d, at)))  # type: ignore[misc]
    for v in _RATES:
        lines.append(("deflection", 1e-5 * line, lambda at, v=v: force(at, v)))  # type: ignore[misc]
    for words, places, value in lines:
        values = np.array([value(at) for at in places])
        size = np.maximum(np.abs(values[1:]), np.abs(values[:-1]))
        for k in np.flatnonzero(np.abs(np.diff(values)) > 0.5 * size):
            low, high = places[k], places[k + 1]
            first = abs(values[k + 1] - values[k])
            for _ in range(60):
                middle = 0.5 * (low + high)
                left = abs(value(middle) - value(low)) > abs(value(high) - value(middle))
                low, high = (low, middle) if left else (middle, high)
            if abs(value(high) - value(low)) < 0.2 * first:
                continue
            symbol = _RATE if words == "rate" else _DELTA
            known = [
                sp.N((symbol - f).subs({_STIFFNESS: 1.0})) for of_rate, f in switches if of_rate == (words == "rate")
            ]
            if not any(place.is_number and abs(float(place) - high) <= 1e-12 for place in known):
                yield f"the force jumps at the {words} {high:.3g}, where no step ends: write a sympy.Piecewise there"
                return
