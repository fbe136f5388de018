"""Can the linkage be assembled at every crank angle?  A sweep over one turn with the numbers of a scene.

Also the numbers of a derivation: ordered definitions evaluated with NumPy, for whole arrays at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy as sp

from ballpass.derive.mechanism.dyads import Placement
from ballpass.derive.mechanism.kinematics import Pose
from ballpass.derive.scene.errors import Fault
from ballpass.derive.terms import Definition

#: Margins up to this are a dead centre: the transmission angle is below 3e-5 rad, and forces grow like its inverse [1].
DEAD_CENTER = 1e-9
#: Step of the sweep [deg].
STEP = 0.5

Array = npt.NDArray[np.float64]


def locked_positions(
    definitions: Sequence[Definition],
    placements: Sequence[Placement],
    driven: Pose,
    values: Mapping[str, float],
    plays: Mapping[str, tuple[tuple[sp.Symbol, ...], float]] = MappingProxyType({}),
    turns: int = 1,
) -> list[Fault]:
    """One fault for each dyad that cannot be assembled somewhere in the turns after which all bodies are alike.

    Every margin is swept over a turn in steps of `STEP`, and each of its minima is refined.

    Parameters
    ----------
    definitions, placements : of a `Linkage`
    driven : pose of the driven body, whose cosine and sine are swept
    values : SI value of every parameter, by its path
    plays : by joint, the displacements of its play, and their largest resultant [m].  A margin is then its smallest
        value over all positions of the plays, to first order

    Raises
    ------
    KeyError
        a parameter without a value.
    """
    assert driven.angle is not None  # it is the driver's
    evaluator = Evaluator(definitions, [p.margin.expression for p in placements], given=(driven.cos, driven.sin))
    parameters: dict[sp.Symbol, Any] = {sp.Symbol(name, real=True): np.float64(v) for name, v in values.items()}

    def sweep(degrees: Array) -> Array:
        radians = np.deg2rad(degrees)
        # Beyond the limit of one dyad the next one is NaN: no warning, because this is what the sweep searches for.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            turned = {**parameters, driven.cos: np.cos(radians), driven.sin: np.sin(radians), driven.angle: radians}

            def margins(moved: Mapping[sp.Symbol, float]) -> Array:
                rows = evaluator({**turned, **moved})
                return np.array([np.broadcast_to(row, degrees.shape) for row in rows], dtype=float)

            left = margins({})
            for along, far in plays.values():
                ways = [(margins({s: np.float64(far)}) - margins({s: np.float64(-far)})) / 2.0 for s in along]
                left = left - np.sqrt(sum(way**2 for way in ways))
        return left

    grid = np.arange(0.0, 360.0 * turns, STEP)
    swept = sweep(grid)
    faults = []
    for row, placement in enumerate(placements):
        # Where an earlier dyad has failed, this one cannot be placed.
        reachable = np.all(swept[:row] > DEAD_CENTER, axis=0)
        here = np.where(np.isnan(swept[row]), -np.inf, swept[row])
        here = np.where(reachable, here, np.inf)
        angle, least = _least(sweep, row, grid, here)
        if least <= DEAD_CENTER:
            closed = STEP * float(np.count_nonzero(here <= DEAD_CENTER))
            faults.append(_fault(placement, angle, least, (closed, 360.0 * turns), plays))
    return faults


def _least(sweep: Callable[[Array], Array], row: int, grid: Array, here: Array) -> tuple[float, float]:
    """Angle [deg] and value of the least margin of one dyad; minima of the grid are refined to 1e-6 deg."""
    lowest = int(np.argmin(here))
    best = float(grid[lowest]), float(here[lowest])
    if best[1] <= DEAD_CENTER:
        return best
    for start in grid[(here <= np.roll(here, 1)) & (here <= np.roll(here, -1)) & np.isfinite(here)]:
        center, half = float(start), STEP
        while half > 1e-6:
            fine = np.linspace(center - half, center + half, 21)
            values = sweep(fine)[row]
            values = np.where(np.isnan(values), np.inf, values)
            lowest = int(np.argmin(values))
            center, half = float(fine[lowest]), half / 10
            if values[lowest] < best[1]:
                best = center % (grid[-1] + STEP), float(values[lowest])
    return best


def _fault(
    placement: Placement, angle: float, least: float, closed: tuple[float, float], plays: Iterable[str]
) -> Fault:
    """`closed` is how much of the crank's way the dyad is not assembled at, and the whole way [deg]."""
    margin, dyad = placement.margin, placement.dyad
    joints = ", ".join(dyad.joints)
    if np.isneginf(least):
        problem = f"the dyad at joint {margin.joint} has no finite position at {angle:.4g} deg: is a length zero?"
        given = f"joints {joints} of {' and '.join(dyad.bodies)}"
    else:
        verb = "locks (dead centre)" if abs(least) <= DEAD_CENTER else "cannot be assembled"
        problem = f"the linkage {verb} at joint {margin.joint} at a crank angle of {angle:.4f} deg"
        given = f"{margin.description}: {least:.6g} there"
        if closed[0] > STEP:
            whole = "a turn" if closed[1] == 360.0 else "the turns after which the machine repeats"
            given += f", not positive at {closed[0]:.4g} of the {closed[1]:g} deg of {whole}"
    remedy = f"change the lengths between joints {joints}, or shorten the crank"
    if played := ", ".join(plays):
        problem = (
            f"the clearance of the bearings at {played} lets the linkage reach a dead centre at joint {margin.joint} "
            f"at a crank angle of {angle:.4f} deg"
        )
        remedy += ", or give the bearings less clearance"
    return Fault(
        key=f"mechanism.joints.{margin.joint}",
        problem=problem,
        given=given,
        allowed=f"above {DEAD_CENTER:g} at every crank angle",
        remedy=remedy,
    )


#: Value of a symbol: a number, or an array over the points of a sweep; real or complex.
Values = Mapping[sp.Symbol, Any]


class Evaluator:
    """Compiled definitions and result expressions.

    Parameters
    ----------
    definitions : ordered; those that no result needs are left out
    results : expressions in parameters, inputs and defined symbols
    given : symbols whose definitions are ignored: their values come with the call
    """

    def __init__(
        self, definitions: Sequence[Definition], results: Sequence[sp.Expr], given: Iterable[sp.Symbol] = ()
    ) -> None:
        own = {d.symbol: d for d in definitions}
        for symbol in given:
            own.pop(symbol, None)
        needed = set[sp.Symbol]()
        for expression in results:
            needed |= sp.sympify(expression).free_symbols
        kept = []
        for definition in reversed(definitions):
            if definition.symbol in needed and definition.symbol in own:
                kept.append(definition)
                needed |= sp.sympify(definition.expression).free_symbols
        self._steps = [(d.symbol, *_compile(d.expression)) for d in reversed(kept)]
        self._results = [_compile(e) for e in results]

    def __call__(self, values: Values) -> list[Any]:
        """Values of the results; arrays where a given value is one.

        Raises
        ------
        KeyError
            a symbol that is neither defined nor given.
        """
        known = dict(values)
        for symbol, function, arguments in self._steps:
            known[symbol] = function(*(known[a] for a in arguments))
        return [function(*(known[a] for a in arguments)) for function, arguments in self._results]


def _compile(expression: sp.Expr) -> tuple[Callable[..., Any], tuple[sp.Symbol, ...]]:
    expression = sp.sympify(expression)
    arguments = tuple(sorted(expression.free_symbols, key=str))
    return sp.lambdify(arguments, expression, modules=np), arguments
