"""Contenders a user would pick instead: SciPy, numba, numbalsoda, SUNDIALS, diffrax.

All integrate the scaled states ``z = x / magnitude`` with the same relative and absolute tolerance, from edge to
edge of the
load, with the right-hand side of `press`.  None is given a Jacobian.  A contender that is not installed is reported as
missing.
"""

from __future__ import annotations

import ctypes
import importlib
import math
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ballpass.runtime.native.compile import compile_sources
from ballpass.runtime.native.compilers import find_compiler
from benchmarks.contenders import HALVES, Contender, Kept, UnavailableError
from benchmarks.press import Press, make_load, make_loop_rate, make_vector_rate
from benchmarks.problem import ROOT, Member


def imported(name: str) -> Any:
    """A module.

    Raises
    ------
    UnavailableError
        It is not installed, or cannot be loaded.
    """
    try:
        return importlib.import_module(name)
    except ImportError as fault:
        if isinstance(fault, ModuleNotFoundError) and (fault.name or "").split(".")[0] == name.split(".")[0]:
            raise UnavailableError("not installed") from fault
        raise UnavailableError(f"cannot be loaded ({fault})") from fault
    except OSError as fault:
        raise UnavailableError(f"cannot be loaded ({fault})") from fault


def _needs(*names: str) -> Callable[[], None]:
    def ready() -> None:
        for name in names:
            imported(name)

    return ready


# -------------------------------------------------------------------------------------------------------------- numba


@cache
def numba_rate() -> Any:
    """dx/dt into an array, compiled by numba: (numbers, gate, t, x, dx)."""
    numba = imported("numba")
    load = numba.njit(make_load(math))
    return numba.njit(make_loop_rate(load, 8))


@cache
def numba_scaled_rate() -> Any:
    """dz/dt of the scaled states: (t, z, numbers, gate, scale) -> array."""
    numba, rate = imported("numba"), numba_rate()

    @numba.njit
    def scaled(t, z, n, gate, scale):  # type: ignore[no-untyped-def]
        dx = np.empty(8)
        rate(n, gate, t, z * scale, dx)
        return dx / scale

    return scaled


# -------------------------------------------------------------------------------------------------------------- SciPy


def numpy_rate(tangent: bool) -> Callable[[Press, float, float, np.ndarray], np.ndarray]:
    """dx/dt in NumPy: (numbers, gate, t, x) -> array."""
    return make_vector_rate(np, make_load(math), 8, tangent)


_numpy_rates = {tangent: numpy_rate(tangent) for tangent in (False, True)}


def _scipy(method: str, how: str) -> Contender:
    def solve(member: Member, tolerance: float) -> np.ndarray:
        n, scale = member.press, member.magnitude
        if how == "numba":
            scaled = numba_scaled_rate()

            def right_side(t: float, z: np.ndarray, gate: float) -> np.ndarray:
                rates: np.ndarray = scaled(t, z, n, gate, scale)
                return rates
        else:
            rate = _numpy_rates[n.tangent == 1.0]

            def right_side(t: float, z: np.ndarray, gate: float) -> np.ndarray:
                rates: np.ndarray = rate(n, gate, t, z * scale) / scale
                return rates

        state = member.start / scale
        rows = []
        for a, b, gate, inside in member.pieces:
            wanted = inside if inside.size and inside[-1] == b else np.append(inside, b)
            done = solve_ivp(
                right_side, (a, b), state, method=method, t_eval=wanted, rtol=tolerance, atol=tolerance, args=(gate,)
            )
            if not done.success:
                return np.full((len(member.times), 8), np.nan)
            rows.append(done.y.T[: len(inside)])
            state = done.y[:, -1]
        return np.asarray(np.concatenate(rows) * scale)

    return Contender(
        label=f"SciPy {method}, {how}",
        group=f"SciPy, {how}",
        solve=solve,
        ready=_needs("numba") if how == "numba" else lambda: None,
    )


# --------------------------------------------------------------------------------------------------------- numbalsoda


@cache
def _numbalsoda_rate() -> Any:
    """dz/dt of the scaled states as a C function; what has to live as long as its address."""
    numba, numbalsoda, rate = imported("numba"), imported("numbalsoda"), numba_rate()
    count = len(Press._fields)

    @numba.cfunc(numbalsoda.lsoda_sig)
    def scaled(t, z, dz, data):  # type: ignore[no-untyped-def]
        d = numba.carray(data, (count + 9,))
        n = Press(
            d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7], d[8], d[9], d[10], d[11],
            d[12], d[13], d[14], d[15], d[16], d[17], d[18], d[19], d[20], d[21], d[22],
        )  # fmt: skip
        scale = d[count + 1 :]
        inside, outside = numba.carray(z, (8,)), numba.carray(dz, (8,))
        x = np.empty(8)
        for k in range(8):
            x[k] = inside[k] * scale[k]
        rate(n, d[count], t, x, outside)
        for k in range(8):
            outside[k] /= scale[k]

    return scaled


@cache
def _numbalsoda_cycle(method: str) -> Any:
    numba = imported("numba")
    count = len(Press._fields)
    address = _numbalsoda_rate().address
    solve = getattr(imported("numbalsoda"), method)

    @numba.njit
    def cycle(data, start, edges, gates, counts, times, tolerance):  # type: ignore[no-untyped-def]
        states = np.empty((len(times), 8))
        scale = data[count + 1 :]
        z = start / scale
        row = 0
        for i in range(len(gates)):
            data[count] = gates[i]
            wanted = np.empty(counts[i] + 2)
            wanted[0] = edges[i]
            wanted[1:-1] = times[row : row + counts[i]]
            wanted[-1] = edges[i + 1]
            if wanted[-2] >= wanted[-1]:
                wanted = wanted[:-1]
            found, success = solve(address, z, wanted, data, tolerance, tolerance, 10_000_000)
            if not success:
                states[:] = np.nan
                return states
            states[row : row + counts[i]] = found[1 : counts[i] + 1] * scale
            z = found[-1]
            row += counts[i]
        return states

    return cycle


_numbalsoda_data = Kept(
    lambda member: (
        np.concatenate([np.array(member.press), [0.0], member.magnitude]),
        np.array(member.gates),
        np.array([len(inside) for *_, inside in member.pieces]),
    )
)


def _numbalsoda(method: str) -> Contender:
    def solve(member: Member, tolerance: float) -> np.ndarray:
        data, gates, counts = _numbalsoda_data(member)
        cycle = _numbalsoda_cycle(method)
        return np.asarray(cycle(data, member.start, member.edges, gates, counts, member.times, tolerance))

    return Contender(
        label=f"numbalsoda {method.upper()}",
        group="numbalsoda",
        solve=solve,
        tolerances=HALVES,
        ready=_needs("numba", "numbalsoda"),
    )


# ----------------------------------------------------------------------------------------------------------- SUNDIALS


@cache
def cvode_library() -> ctypes.CDLL:
    package = imported("sksundae")
    libraries = Path(package.__file__).parent.parent / "scikit_sundae.libs"
    wanted = ("core", "cvode", "nvecserial", "sunlinsoldense", "sunmatrixdense")
    found = [next(iter(sorted(libraries.glob(f"libsundials_{name}-*.so*"))), None) for name in wanted]
    compiler = find_compiler()
    if compiler is None or any(path is None for path in found):
        raise UnavailableError("needs a C compiler and scikit-sundae's wheel for Linux")
    for path in found:
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    folder = ROOT / "benchmarks"
    library = compile_sources(
        (folder / "cvode.c",),
        compiler,
        label="cvode",
        flags=("-O3", "-ffast-math"),
    )
    return ctypes.CDLL(str(library.path))


_cvode_data = Kept(
    lambda member: (
        np.array([*member.press, *member.magnitude]),
        np.array(member.gates),
        np.array([len(inside) for *_, inside in member.pieces], dtype=ctypes.c_long),
    )
)


#: Methods of cvode.c: words, and CVODE's number.
_CVODE_METHODS = {"BDF": 2, "Adams": 1}


def _cvode(words: str) -> Contender:
    def solve(member: Member, tolerance: float) -> np.ndarray:
        numbers, gates, counts = _cvode_data(member)
        states = np.empty((len(member.times), 8))
        pointer = ctypes.c_void_p
        status = cvode_library().cvode_cycle(
            _CVODE_METHODS[words],
            ctypes.c_double(tolerance),
            pointer(numbers.ctypes.data),
            pointer(member.start.ctypes.data),
            len(gates),
            pointer(member.edges.ctypes.data),
            pointer(gates.ctypes.data),
            pointer(counts.ctypes.data),
            pointer(member.times.ctypes.data),
            pointer(states.ctypes.data),
        )
        if status:
            states[:] = np.nan
        return states

    return Contender(
        label=f"SUNDIALS CVODE {words}, C",
        group="SUNDIALS",
        solve=solve,
        tolerances=HALVES,
        ready=_cvode_ready,
    )


def _cvode_ready() -> None:
    try:
        cvode_library()
    except (OSError, subprocess.SubprocessError) as fault:
        raise UnavailableError(f"cannot be built ({fault})") from fault


# ------------------------------------------------------------------------------------------------------------ diffrax


@cache
def jax_rate(tangent: bool) -> Any:
    """dx/dt in JAX, in double precision: (numbers, gate, t, x) -> array."""
    jax = imported("jax")
    jax.config.update("jax_enable_x64", True)
    jnp = jax.numpy

    def root(a: Any) -> Any:  # implicit solvers differentiate it, also where it is zero
        touching = a > 0.0
        return jnp.where(touching, jnp.sqrt(jnp.where(touching, a, 1.0)), 0.0)

    return make_vector_rate(jnp, make_load(jnp), 8, tangent, root)


@cache
def _diffrax_cycle(solver: str, tangent: bool, sizes: tuple[int, ...]) -> Any:
    jax, diffrax, rate = imported("jax"), imported("diffrax"), jax_rate(tangent)
    jnp = jax.numpy
    method = getattr(diffrax, solver)()

    def field(t: Any, z: Any, args: Any) -> Any:
        n, gate, scale = args
        return rate(n, gate, t, z * scale) / scale

    def cycle(n: Press, scale: Any, start: Any, edges: Any, gates: Any, times: Any, tolerance: Any) -> Any:
        z = start / scale
        rows = []
        row = 0
        for k, size in enumerate(sizes):
            wanted = times[row : row + size]
            row += size
            done = diffrax.diffeqsolve(
                diffrax.ODETerm(field),
                method,
                edges[k],
                edges[k + 1],
                None,
                z,
                args=(n, gates[k], scale),
                saveat=diffrax.SaveAt(ts=wanted, t1=True),
                stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
                max_steps=200_000,
                adjoint=diffrax.ForwardMode(),
                throw=False,
            )
            rows.append(done.ys[:-1])
            z = done.ys[-1]
        return jnp.concatenate(rows) * scale

    return jax.jit(cycle)


def _diffrax(solver: str) -> Contender:
    def solve(member: Member, tolerance: float) -> np.ndarray:
        sizes = tuple(len(inside) for *_, inside in member.pieces)
        cycle = _diffrax_cycle(solver, member.press.tangent == 1.0, sizes)
        found = cycle(
            member.press,
            member.magnitude,
            member.start,
            member.edges,
            np.array(member.gates),
            member.times,
            tolerance,
        )
        return np.asarray(found)

    return Contender(
        label=f"diffrax {solver}",
        group="diffrax",
        solve=solve,
        ready=_needs("jax", "diffrax"),
    )


def peers() -> list[Contender]:
    """All of them, in the order of tables."""
    return [
        *(_numbalsoda(method) for method in ("lsoda", "dop853")),
        *(_cvode(words) for words in _CVODE_METHODS),
        _diffrax("Tsit5"),
        _diffrax("Kvaerno5"),
        *(_scipy(method, "numba") for method in ("LSODA", "DOP853", "Radau")),
        _scipy("LSODA", "NumPy"),
    ]
