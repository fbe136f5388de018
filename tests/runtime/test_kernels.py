"""Claims about the stepper's kernels, point by point: what the driver integrates is the model's right-hand side."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import derive, generate
from ballpass.derive.lowering.functions import Functions, lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.system import System
from ballpass.runtime.native.compile import compile_sources, find_compiler
from ballpass.runtime.native.driver_library import DRIVER, FLAGS

#: The driver's own functions, one point a call: as a stage within a step sees it, and as the start of a step does.
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

#: Laws of the press, by what replaces the line of its law.
LAWS = {
    "one-sided": ('law = "one-sided"', 'law = "one-sided"'),
    "one-sided-gated": ('law = "one-sided"', 'law = "one-sided-gated"'),
    "two-sided-gated": ('law = "one-sided"', 'law = "two-sided-gated"'),
    "none": ('law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"', 'law = "none"'),
}
PRESS = {law: ("punching_press", (change,)) for law, change in LAWS.items()}
CASES: dict[str, tuple[str, tuple[tuple[str, str], ...]]] = {
    **PRESS,
    "tangent": ("punching_press_tangent", ()),
    "odd number of balls": ("punching_press", (("balls = 8", "balls = 9"),)),
    "one ring, no law": ("varying_compliance", ()),
    "one ring, tangent": (
        "varying_compliance",
        (('law = "none"  ', 'law = "tangent"\nratio = "0.25e-5 s"  '),),
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A time, a state, and everything else the right-hand side takes."""

    t: float
    x: np.ndarray
    u: np.ndarray
    p: np.ndarray
    c: np.ndarray

    def pointers(self) -> list[ctypes.c_void_p]:
        return [ctypes.c_void_p(a.ctypes.data) for a in (self.x, self.u, self.p, self.c)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """A scene's functions, which CasADi evaluates, and the kernels of its stepper, which a compiler has made."""

    system: System
    functions: Functions
    kernels: ctypes.CDLL

    def value(self, name: str, t: float, point: Point) -> np.ndarray:
        """A function of the right-hand side's arguments, as a dense array."""
        given = {"t": t, "x": point.x, "u": point.u[: len(self.system.inputs)], "p": point.p, "c": point.c}
        function = self.functions[name]
        return np.array(function(*(given[k] for k in function.name_in())))


@pytest.fixture(scope="module", params=CASES)
def made(
    request: pytest.FixtureRequest, scene_text: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> Made:
    name, changes = CASES[request.param]
    scene = scene_from_text(scene_text(name, *changes), name)
    place = tmp_path_factory.mktemp("kernels")
    folder = Path(generate(scene, place / name))
    (place / "shim.c").write_text(SHIM, encoding="utf-8")
    compiler = find_compiler()
    assert compiler is not None
    headers = [*sorted(DRIVER.glob("*.h")), folder / "kernels.h"]
    library = compile_sources(
        (place / "shim.c",), compiler, label="kernels", headers=headers, include=(DRIVER, folder), flags=FLAGS
    )
    system = derive(scene)
    return Made(system=system, functions=lower(system), kernels=ctypes.CDLL(str(library.path)))


def points(made: Made, count: int) -> list[Point]:
    """Random ones: some balls touch and some do not, gates on and off, clearance and preload."""
    random = np.random.default_rng(20261121)
    system, found = made.system, []
    for number in range(count):
        values = {p.name: float(p.default) for p in system.parameters}
        values["bearing.clearance"] = (1e-5, -4e-6)[number % 2]
        p = np.array([*values.values()])
        n = len(system.coordinates)
        u = [float(random.integers(0, 2)) if i.kind == "gate" else random.uniform(0.0, 6.28) for i in system.inputs]
        found.append(
            Point(
                t=random.uniform(0.0, 0.1),
                x=np.concatenate([random.uniform(-2e-5, 2e-5, n), random.uniform(-0.05, 0.05, n)]),
                u=np.array(u or [0.0]),
                p=p,
                c=np.array(made.functions["constants"](p)).ravel(),
            )
        )
    return found


def close(found: np.ndarray, expected: np.ndarray, rtol: float) -> None:
    """Equal within the largest entry of each half: sums over balls cancel, their rounding does not."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=rtol * np.max(np.abs(expected)))


@pytest.mark.parametrize("h", [1e-5, 3e-3], ids=["a step of the stepper", "a step across a large angle"])
def test_kernels_are_the_right_hand_side(made: Made, h: float) -> None:
    n = len(made.system.coordinates)
    for point in points(made, 60):
        dx = np.empty((3, 2 * n))
        made.kernels.at_stage(
            ctypes.c_double(point.t), ctypes.c_double(h), *point.pointers(), ctypes.c_void_p(dx.ctypes.data)
        )
        for row, node in zip(dx, (0.0, 0.3, 1.0), strict=True):
            expected = made.value("rhs", point.t + node * h, point).ravel()
            assert np.array_equal(row[:n], point.x[n:])
            close(row[n:], expected[n:], 1e-12)


@pytest.mark.parametrize("h", [1e-5, 3e-3], ids=["a step of the stepper", "a step across a large angle"])
def test_linearized_kernels_are_the_jacobian_of_the_right_hand_side(made: Made, h: float) -> None:
    n = len(made.system.coordinates)
    for point in points(made, 60):
        dx, a, b, at = np.empty(2 * n), np.empty((n, n)), np.empty((n, n)), np.empty(n)
        made.kernels.at_end(
            *(ctypes.c_double(point.t), ctypes.c_double(h), *point.pointers()),
            *(ctypes.c_void_p(result.ctypes.data) for result in (dx, a, b, at)),
        )
        t = point.t + h
        close(dx[n:], made.value("rhs", t, point).ravel()[n:], 1e-12)
        jacobian = made.value("rhs_jac_x", t, point)
        close(a, jacobian[n:, :n], 1e-12)
        close(b, jacobian[n:, n:], 1e-12)
        close(at, made.value("rhs_jac_t", t, point).ravel()[n:], 1e-11)
