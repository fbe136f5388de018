"""Three evaluators that share nothing but the equations: SymPy in 40 digits, CasADi, the compiled kernels."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import sympy as sp

from ballpass.derive import derive
from ballpass.derive.emit.kernel_headers import kernels_header
from ballpass.derive.lowering.functions import LoweredFunctions, lower
from ballpass.derive.mechanism.swing import OF_IDEAL_LINKAGE
from ballpass.derive.scene.records import Scene
from ballpass.derive.system import System
from ballpass.derive.terms import TIME
from ballpass.runtime.native.compile import compile_sources, find_compiler
from ballpass.runtime.native.driver_library import DRIVER, FLAGS

DIGITS = 40

#: The driver's own functions, one point a call: as stages within a step see it, and as the start of a step does.
SHIM = """
#include "model.h"

void at_stage(double t, double h, const double *x, const double *u, const double *p, const double *c, double *dx)
{
    const bp_numbers n = {u, p, c};
    static const double nodes[3] = {0.0, 0.3, 1.0};
    double w[3][BP_NW];
    bp_stages(&n, t, h, nodes, 3, w);
    for (int i = 0; i < 3; i++) bp_rate(&n, w[i], x, dx + i * BP_NX);
}

void at_end(double t, double h, const double *x, const double *u, const double *p, const double *c, double *dx,
            double *A, double *B, double *at)
{
    const bp_numbers n = {u, p, c};
    static const double nodes[1] = {0.3};
    double w[1][BP_NW], end[BP_NW], rate[BP_NW];
    bp_stages_and_end(&n, t, h, nodes, 1, w, end, rate);
    bp_linearize(&n, end, rate, x, dx, A, B, at);
}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A time, a state, and everything else that the right-hand side takes."""

    t: float
    x: np.ndarray
    u: np.ndarray
    p: np.ndarray


class Evaluators:
    """The right-hand side of a scene; `folder` is for what is generated."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        self.scene, self.folder = scene, folder
        self.system: System = derive(scene)
        self.functions: LoweredFunctions = lower(self.system)

    def points(self, count: int) -> list[Point]:
        """Random ones: balls that touch and balls that do not, gates open and shut, parameters off by two percent."""
        random, system, found = np.random.default_rng(20261121), self.system, []
        angle = np.array([c.kind == "angle" for c in system.coordinates])
        for _ in range(count):
            position = np.where(angle, random.uniform(-6.0, 6.0, len(angle)), random.uniform(-2e-5, 2e-5, len(angle)))
            velocity = np.where(angle, random.uniform(-60.0, 60.0, len(angle)), random.uniform(-0.05, 0.05, len(angle)))
            found.append(
                Point(
                    t=random.uniform(0.0, 0.1),
                    x=np.concatenate([position, velocity]),
                    u=np.array([self._input(kind, random) for kind in (i.kind for i in system.inputs)]),
                    p=np.array([q.default for q in system.parameters])
                    * random.uniform(0.98, 1.02, len(system.parameters)),
                )
            )
        return found

    @staticmethod
    def _input(kind: str, random: np.random.Generator) -> float:
        if kind == "gate":
            return float(random.integers(0, 2))
        return 0.0 if kind == "border" else random.uniform(0.0, 6.28)  # no side is held

    def value(self, name: str, point: Point, t: float | None = None) -> np.ndarray:
        """A function of CasADi's, as a dense array; that of several results one behind the other."""
        time = point.t if t is None else t
        given = {"t": time, "x": point.x, "u": point.u, "p": point.p, "c": self.constants(point.p)}
        function = self.functions[name]
        found = function(*(given[k] for k in function.name_in()))
        return np.concatenate([np.array(r).ravel() for r in found]) if isinstance(found, tuple) else np.array(found)

    def constants(self, p: np.ndarray) -> np.ndarray:
        return np.array(self.functions["constants"](p)).ravel()

    def by_sympy(self, point: Point) -> np.ndarray:
        """The definitions put in one by one; elliptic integrals by mpmath; M a = f by elimination.

        Constants of the linkage without play, found along a whole turn, are those of CasADi.
        """
        system, known = self.system, {TIME: _number(point.t)}
        for named, values in ((system.states, point.x), (system.inputs, point.u), (system.parameters, point.p)):
            known |= {n.symbol: _number(v) for n, v in zip(named, values, strict=True)}
        late = system.late
        lowered = dict(zip((c.name for c in self.functions.constants), self.constants(point.p), strict=True))
        for definition in system.constants:
            if sp.sympify(definition.expression).has(*OF_IDEAL_LINKAGE):
                known[definition.symbol] = _number(lowered[definition.symbol.name])
        for definition in (*system.constants, *system.definitions):
            if definition.symbol not in late and definition.symbol not in known:
                known[definition.symbol] = _evaluated(definition.expression, known)
        totals: dict[sp.Symbol, sp.Expr] = {}
        for bearing in system.bearings:
            ball = bearing.ball
            cage = _evaluated(ball.cage.angle, known)
            for j in range(ball.count):
                theta = cage + 2 * sp.pi * j / ball.count
                one = known | {ball.cos: sp.cos(theta).evalf(DIGITS), ball.sin: sp.sin(theta).evalf(DIGITS)}
                for definition in ball.definitions:
                    one[definition.symbol] = _evaluated(definition.expression, one)
                for s in ball.sums:
                    totals[s.symbol] = totals.get(s.symbol, sp.S.Zero) + _evaluated(s.expression, one)
        known |= totals
        for symbol, expression in late.items():
            if sp.sympify(expression).free_symbols <= known.keys():
                known[symbol] = _evaluated(expression, known)
        mass, forcing = (
            matrix.applyfunc(lambda entry: _evaluated(entry, known)) for matrix in (system.mass, system.forcing)
        )
        accelerations = sp.Matrix(mass).LUsolve(sp.Matrix(forcing))
        return np.array([*point.x[len(accelerations) :], *(float(a) for a in accelerations)])

    @cached_property
    def _kernels(self) -> ctypes.CDLL:
        shim, header, kernels = self.folder / "shim.c", self.folder / "kernels.h", self.functions.kernels
        assert kernels is not None
        shim.write_text(SHIM, encoding="utf-8")
        header.write_text(kernels_header(self.system, self.functions, kernels), encoding="utf-8")
        compiler = find_compiler()
        assert compiler is not None
        headers = [*sorted(DRIVER.glob("*.h")), header]
        library = compile_sources((shim,), compiler, label="kernels", headers=headers, flags=FLAGS)
        return ctypes.CDLL(str(library.path))

    def stages(self, point: Point, h: float) -> np.ndarray:
        """Rates by the compiled kernels at the point's time, and 0.3 and 1.0 of h later."""
        dx = np.empty((3, len(point.x)))
        self._kernels.at_stage(*self._arguments(point, h), ctypes.c_void_p(dx.ctypes.data))
        return dx

    def linearized(self, point: Point, h: float) -> tuple[np.ndarray, ...]:
        """Rates h later, and derivatives of the accelerations by positions, velocities and time."""
        n = len(point.x) // 2
        results = (np.empty(2 * n), np.empty((n, n)), np.empty((n, n)), np.empty(n))
        self._kernels.at_end(*self._arguments(point, h), *(ctypes.c_void_p(r.ctypes.data) for r in results))
        return results

    def _arguments(self, point: Point, h: float) -> list[ctypes.c_double | ctypes.c_void_p]:
        self._held = [point.x, np.append(point.u, 0.0), point.p, self.constants(point.p)]
        return [ctypes.c_double(point.t), ctypes.c_double(h), *(ctypes.c_void_p(a.ctypes.data) for a in self._held)]


def _number(value: float) -> sp.Float:
    return sp.Float(sp.Rational(value), DIGITS)


def _evaluated(expression: sp.Expr, known: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    return sp.sympify(expression).xreplace(known).evalf(DIGITS)
