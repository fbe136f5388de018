"""Contenders of the project, by hand in C, and of CasADi; none needs more than the project's own packages.

A `Contender` says whether it can run here, and solves one cycle of a `Member` at a tolerance.  What depends on the
member
alone (arrays, numbers) is prepared once and kept: the time that counts is that of one more cycle.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi
import numpy as np

from ballpass.runtime.native.compile import compile_sources
from ballpass.runtime.native.compilers import find_compiler
from ballpass.runtime.native.kernel import Kernel
from ballpass.runtime.native.stepper import METHODS, End, Family, Stepper
from ballpass.runtime.run.locating import choose_kinks, stepper_for
from benchmarks.problem import BUILD, POINTS, ROOT, Member

DECADES = tuple(10.0**-k for k in range(2, 11))
HALVES = tuple(10.0**-k for k in np.arange(1.5, 11.1, 0.5))


class Unavailable(Exception):
    """A contender cannot run here; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Contender:
    """Something that integrates the cycle.

    Attributes
    ----------
    key, label, group : names for files, for people, and of the group it belongs to
    solve : member and tolerance to states at the output points, shape (POINTS, 8)
    tolerances : that are swept
    ready : raises `Unavailable` where it cannot run
    """

    key: str
    label: str
    group: str
    solve: Callable[[Member, float], np.ndarray]
    tolerances: tuple[float, ...] = DECADES
    ready: Callable[[], None] = lambda: None
    counts: Callable[[Member, float], dict[str, int]] | None = None


class Kept:
    """What a contender prepares once per member."""

    def __init__(self, make: Callable[[Member], Any]) -> None:
        self._make = make
        self._made: dict[int, tuple[Member, Any]] = {}

    def __call__(self, member: Member) -> Any:
        if id(member) not in self._made:
            self._made[id(member)] = (member, self._make(member))
        return self._made[id(member)][1]


# ------------------------------------------------------------------------------------------------------ the project's


def stepper_run(
    member: Member, tolerance: float, family: Family, *, outputs: bool = True, stepper: Stepper | None = None
) -> tuple[np.ndarray, Any]:
    """One raw call of the stepper that `model.simulate` takes, or of another one; states and outcome."""
    if stepper is None:
        model, named = member.model, "stepper" if family is Family.AUTO else f"stepper-{family.name.lower()}"
        stepper = stepper_for(model, choose_kinks(None, named, model.manifest, tolerance))
    states = np.empty((POINTS, len(member.start)))
    outcome = stepper.run(
        family=family,
        tolerance=tolerance * member.magnitude,
        p=member.numbers.p,
        c=member.numbers.c,
        x=member.start.copy(),
        segments=member.segments,
        output_times=member.times if outputs else member.times[:0],
        output_states=states if outputs else None,
    )
    if outcome.end is not End.DONE:
        states[outcome.written :] = np.nan
    return states, outcome


def _stepper(key: str, family: Family) -> Contender:
    def counts(member: Member, tolerance: float) -> dict[str, int]:
        _, outcome = stepper_run(member, tolerance, family)
        return {"steps": outcome.steps, "rejected": outcome.rejected, "evaluations": outcome.evaluations}

    return Contender(
        key=key,
        label=key,
        group="ballpass",
        solve=lambda member, tolerance: stepper_run(member, tolerance, family)[0],
        tolerances=HALVES,
        counts=counts,
    )


def _simulate(member: Member, tolerance: float) -> np.ndarray:
    """What a user calls: checks, magnitudes, outputs of the scene at every sample included."""
    solution = member.model.simulate(
        cycles=1,
        parameters=member.parameters,
        method="stepper",
        rtol=tolerance,
        samples_per_cycle=POINTS,
        initial=member.start,
    )
    return np.asarray(solution.x[1:])


# ------------------------------------------------------------------------------------------------------------ by hand


class _Press(ctypes.Structure):
    _fields_ = (("numbers", ctypes.c_double * 23), ("scale", ctypes.c_double * 8))


class _Counts(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_long) for name in ("status", "steps", "rejected", "evaluations"))


#: Fast arithmetic is part of what a hand may do here.
HAND_FLAGS = ("-O3", "-ffast-math", "-ffp-contract=fast", "-Wno-psabi")


def compiled(source: str, *flags: str) -> Path:
    """Shared library of a C file of this folder.

    Raises
    ------
    Unavailable
        There is no C compiler.
    """
    compiler = find_compiler()
    if compiler is None:
        raise Unavailable("no C compiler")
    return compile_sources((ROOT / "benchmarks" / source,), compiler, label=Path(source).stem, flags=flags).path


@lru_cache(maxsize=1)
def hand() -> ctypes.CDLL:
    """The functions of hand_written.c."""
    code = ctypes.CDLL(str(compiled("hand_written.c", *HAND_FLAGS)))
    pointer = ctypes.c_void_p
    code.press_cycle.argtypes = (
        *(ctypes.c_int, ctypes.c_double, pointer, pointer, ctypes.c_double, ctypes.c_long, pointer, pointer, pointer),
    )
    code.press_rate.argtypes = (pointer, ctypes.c_double, ctypes.c_double, pointer, pointer)
    code.press_rate.restype = None
    code.press_rates.argtypes = (pointer, *(ctypes.c_double,) * 3, ctypes.c_long, pointer)
    code.press_rates.restype = ctypes.c_double
    return code


def c_numbers(member: Member) -> _Press:
    """A member's numbers as the C files take them."""
    return _Press((ctypes.c_double * 23)(*member.press), (ctypes.c_double * 8)(*member.magnitude))


_hand_numbers = Kept(c_numbers)
HAND_METHODS = {"rodas4": 1, "rodas5p": 2, "dp54": 3}


def hand_run(member: Member, tolerance: float, method: str, *, outputs: bool = True) -> tuple[np.ndarray, _Counts]:
    """One cycle by hand_written.c; states and counts."""
    states = np.empty((POINTS, 8))
    x = member.start.copy()
    counts = _Counts()
    status = hand().press_cycle(
        HAND_METHODS[method],
        tolerance,
        ctypes.addressof(_hand_numbers(member)),
        x.ctypes.data,
        member.period,
        POINTS if outputs else 0,
        member.times.ctypes.data,
        states.ctypes.data,
        ctypes.addressof(counts),
    )
    if status:
        states[:] = np.nan
    return states, counts


def _hand_ready() -> None:
    hand()


def _by_hand(method: str) -> Contender:
    def counts(member: Member, tolerance: float) -> dict[str, int]:
        _, found = hand_run(member, tolerance, method)
        return {"steps": found.steps, "rejected": found.rejected, "evaluations": found.evaluations}

    return Contender(
        key=f"hand-{method}",
        label=f"by hand in C, {method}",
        group="by hand in C",
        solve=lambda member, tolerance: hand_run(member, tolerance, method)[0],
        tolerances=HALVES,
        ready=_hand_ready,
        counts=counts,
    )


# ------------------------------------------------------------------------------------------------------------- CasADi


@dataclass(kw_only=True)
class CasadiIntegrators:
    """One of CasADi's plugins with an integrator for each segment, whose grid is that segment's output points.

    The grid is in fractions of the segment: windows are fixed in angle, so one grid serves the whole ensemble.
    """

    plugin: str
    how: str  # "C": generated, "vm": virtual machine, "jit": cvodes with compiled right-hand side
    made: dict[str, list[Kernel]] = field(default_factory=dict)

    def integrators(self, member: Member) -> list[Kernel]:
        scene = member.case.scene
        if scene not in self.made:
            grids = []
            for a, b, _, inside in member.pieces:
                fractions = (inside - a) / (b - a)
                grids.append([*fractions[fractions < 1.0 - 1e-9], 1.0])
            self.made[scene] = self._compile(member, grids)
        return self.made[scene]

    def _compile(self, member: Member, grids: list[list[float]]) -> list[Kernel]:
        functions = [integrator(member, self.plugin, k, grid, self.how == "jit") for k, grid in enumerate(grids)]
        if self.how != "C":
            return [Kernel(f) for f in functions]
        folder = BUILD / "casadi"
        folder.mkdir(parents=True, exist_ok=True)
        source = f"{self.plugin}_{member.case.scene}.c"
        generator = casadi.CodeGenerator(source)
        for f in functions:
            generator.add(f)
        generator.generate(f"{folder}{os.sep}")
        compiler = find_compiler()
        if compiler is None:
            raise Unavailable("no C compiler")
        library = compile_sources((folder / source,), compiler, label=Path(source).stem, flags=("-O3",))
        return [Kernel(casadi.external(f.name(), str(library.path))) for f in functions]

    def solve(self, member: Member, tolerance: float) -> np.ndarray:
        kernels = self.integrators(member)
        scale = tolerance * member.magnitude
        state = member.start
        rows = []
        for k, ((a, b, _, inside), kernel) in enumerate(zip(member.pieces, kernels, strict=True)):
            u = member.segments.inputs[k]
            packed = np.concatenate([(0.0, b - a), scale, u, member.numbers.p, member.numbers.c])
            kernel.run({"x0": state / scale, "p": packed})
            block = kernel.output("xf").T * scale
            rows.append(block[: len(inside)])
            state = block[-1]
        return np.concatenate(rows)


def integrator(member: Member, plugin: str, segment: int, grid: list[float], jit: bool) -> casadi.Function:
    """An integrator of the scaled states over a normalised segment, as in ballpass.runtime.run.casadi_integrators."""
    model, rhs = member.model, member.model.symbolic("rhs")
    manifest = model.manifest
    sizes = {"u": len(manifest.inputs), "p": len(manifest.parameters), "c": len(manifest.constants)}
    symbols = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    time, start, step = (casadi.SX.sym(name) for name in ("s", "start", "step"))
    count = rhs.size1_out(0)
    scaled, scale = casadi.SX.sym("z", count), casadi.SX.sym("scale", count)
    given = {"t": start + step * time, "x": scaled * scale, **symbols}
    (rate,) = rhs.call([given[name] for name in rhs.name_in()])
    equations = {
        "t": time,
        "x": scaled,
        "p": casadi.vertcat(start, step, scale, *symbols.values()),
        "ode": step * rate / scale,
    }
    options: dict[str, Any] = {"abstol": 1.0, "reltol": 1e-14, "max_num_steps": 10_000_000, "show_eval_warnings": False}
    if plugin != "cvodes":
        options["control_group_size"] = [len(grid)]  # steps may cross output times
    name = f"{plugin}_{segment}"
    if not jit:
        return casadi.integrator(name, plugin, equations, 0.0, grid, options)
    options.update(
        jit=True, compiler="shell", jit_cleanup=False, jit_options={"flags": ["-O3", "-march=native"], "cleanup": False}
    )
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:  # CasADi compiles in the working folder
        os.chdir(folder)
        try:
            return casadi.integrator(name, plugin, equations, 0.0, grid, options)
        finally:
            os.chdir(here)


def _casadi(key: str, label: str, plugin: str, how: str) -> Contender:
    made = CasadiIntegrators(plugin=plugin, how=how)
    return Contender(key=key, label=label, group="CasADi", solve=made.solve)


def own_contenders() -> list[Contender]:
    """All of them, in the order of tables."""
    return [
        *(_stepper(name, family) for name, family in METHODS.items()),
        Contender(
            key="simulate",
            label="model.simulate, outputs included",
            group="ballpass",
            solve=_simulate,
            tolerances=HALVES,
        ),
        *(_by_hand(method) for method in HAND_METHODS),
        _casadi("erk", "CasADi erk, C", "erk", "C"),
        _casadi("rosenbrock", "CasADi rosenbrock, C", "rosenbrock", "C"),
        _casadi("cvodes", "CasADi cvodes, virtual machine", "cvodes", "vm"),
        _casadi("cvodes-compiled", "CasADi cvodes, compiled", "cvodes", "jit"),
    ]
