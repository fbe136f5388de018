"""The steps of every method in C advance a number of coordinates that fills no vector in the order of the method."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm
from stepper_methods import EXPLICIT, IMPLICIT, NAMES, ORDERS

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime.native.compile import find_compiler
from ballpass.runtime.native.driver_library import DRIVER, FLAGS
from ballpass.runtime.native.method_tables import METHOD_TABLES, method_tables

#: Five coordinates with q'' = A q + B q' + sin t, in place of a generated model.
HARNESS = """
#include <math.h>
#define BALLPASS_MODEL_H
enum { BP_NQ = 5, BP_NX = 10, BP_NW = 1 };
typedef struct { const double *u, *p, *c; } bp_numbers;
static void bp_stage(double t, const double *u, const double *p, const double *c, double *w)
{
    w[0] = sin(t);
}
static void bp_stage_rate(double t, const double *u, const double *p, const double *c, double *w, double *wt)
{
    w[0] = sin(t);
    wt[0] = cos(t);
}
static void bp_stages(const bp_numbers *n, double t, double h, const double *nodes, int count, double w[][BP_NW])
{
    for (int i = 0; i < count; i++) w[i][0] = sin(t + nodes[i] * h);
}
static void bp_stages_and_end(const bp_numbers *n, double t, double h, const double *nodes, int count,
                              double w[][BP_NW], double *end, double *rate)
{
    bp_stages(n, t, h, nodes, count, w);
    bp_stage_rate(t + h, n->u, n->p, n->c, end, rate);
}
static void bp_rate(const bp_numbers *n, const double *w, const double *x, double *dx)
{
    for (int i = 0; i < 5; i++) {
        dx[i] = x[5 + i];
        dx[5 + i] = w[0];
        for (int j = 0; j < 5; j++) dx[5 + i] += n->p[5 * i + j] * x[j] + n->c[5 * i + j] * x[5 + j];
    }
}
static void bp_linearize(const bp_numbers *n, const double *w, const double *wt, const double *x, double *dx,
                         double *A, double *B, double *at)
{
    bp_rate(n, w, x, dx);
    for (int k = 0; k < 25; k++) A[k] = n->p[k], B[k] = n->c[k];
    for (int k = 0; k < 5; k++) at[k] = wt[0];
}
#include "single.h"
static void explicit_run(const bp_explicit_method *method, bp_numbers n, double *x, double h, int steps)
{
    double weight[10] = {0}, next[10];
    bp_explicit work;
    for (int i = 0; i < steps; i++) {
        bp_explicit_rate(&n, i * h, x, work.k[0]);
        bp_explicit_step(method, &work, &n, i * h, x, h, 0, weight, next);
        for (int k = 0; k < 10; k++) x[k] = next[k];
    }
}
static void linear_run(const bp_rosenbrock_method *method, bp_numbers n, double *x, double h, int steps)
{
    double weight[10] = {0}, next[10];
    bp_linear work;
    bp_matrix matrix;
    for (int i = 0; i < steps; i++) {
        bp_linear_start(&work, &n, i * h, x, 1);
        bp_rosenbrock_step(method, &work, &matrix, &n, i * h, x, h, weight, next);
        for (int k = 0; k < 10; k++) x[k] = next[k];
    }
}
#define METHOD(name, run) \\
    void name(const double *p, const double *c, double *x, double h, int steps) \\
    { \\
        const bp_numbers n = {0, p, c}; \\
        run(&bp_##name, n, x, h, steps); \\
    }
"""
HARNESS += "".join(
    f"METHOD({name.removeprefix('stepper-')}, {run}_run)\n"
    for run, names in (("explicit", EXPLICIT), ("linear", IMPLICIT))
    for name in names
)


@pytest.fixture(scope="module")
def five(scene_text: Callable[..., str], tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    place = tmp_path_factory.mktemp("five")
    folder = generate(scene_from_text(scene_text("varying_compliance"), "v"), place / "v")
    source, library = place / "harness.c", place / "harness.so"
    source.write_text(HARNESS)
    (place / METHOD_TABLES).write_text(method_tables(), encoding="utf-8")
    options = [*FLAGS, f"-I{place}", "-std=c99", "-shared", "-fPIC", f"-I{DRIVER}", f"-I{folder}"]
    subprocess.run([*compiler.command, *options, str(source), "-o", str(library), "-lm"], check=True)
    return ctypes.CDLL(str(library))


@pytest.mark.parametrize("method", NAMES)
def test_five_coordinates_are_advanced_in_the_order_of_the_method(five: ctypes.CDLL, method: str) -> None:
    """Against the exponential of the matrix; sin t is the output of two more states."""
    random = np.random.default_rng(4)
    A, B = (-np.eye(5) * size + random.normal(size=(5, 5)) for size in (9.0, 1.0))
    start = random.normal(size=10)
    whole = np.zeros((12, 12))
    whole[:5, 5:10], whole[5:10, :5], whole[5:10, 5:10], whole[5:10, 10] = np.eye(5), A, B, 1.0
    whole[10, 11], whole[11, 10] = 1.0, -1.0
    exact = (expm(whole) @ np.concatenate([start, [0.0, 1.0]]))[:10]
    errors, (order, _) = [], ORDERS[method]
    steps = 32 if order < 8 else 6
    for count in (steps, 2 * steps):
        x = start.copy()
        pointers = (ctypes.c_void_p(array.ctypes.data) for array in (A, B, x))
        getattr(five, method.removeprefix("stepper-"))(*pointers, ctypes.c_double(1.0 / count), ctypes.c_int(count))
        errors.append(float(np.max(np.abs(x - exact))))
    assert errors[1] < 1e-3
    assert np.log2(errors[0] / errors[1]) > order - 0.5
