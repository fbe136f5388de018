"""Cases of methods: each integrator on the stiffest and the least damped case, refusals, laws that jump."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from ballpass.runtime import IntegrationError, Model
from ballpass.runtime.contract.errors import BallpassError, RequestError, SimulationError
from extremes.case import Case, Finding
from extremes.models import HARMONIC, ROTOR_LOAD, press, rotor
from extremes.physics import BEFORE_PUNCH, OUTER, PUNCH, RATIO, START, difference
from extremes.reference import Machine

GROUP = "Methods"
METHODS = (
    "stepper", "stepper-rodas5p", "stepper-rodas4", "stepper-dp54", "stepper-dop853", "rosenbrock", "erk", "cvodes",
)  # fmt: skip

#: The printed ratio read in SI (eigenvalues to -1e6 1/s with the shipped rings), and an outer ring of a gramme.
STIFFEST = {RATIO: 0.25e-5, f"{OUTER}.mass": 1e-3, START: BEFORE_PUNCH}
#: No damping anywhere.
LEAST = {f"{OUTER}.damping": 0.0, START: BEFORE_PUNCH}
TURNS = {"stiffest": 0.15, "least": 0.05}


def _run(kind: str, method: str, rtol: float) -> Any:
    model, numbers = (press(), STIFFEST) if kind == "stiffest" else (press("none"), LEAST)
    return model.simulate(
        cycles=TURNS[kind], parameters=numbers, method=method, rtol=rtol, samples_per_cycle=1000, transient=0
    )


@cache
def _expected(kind: str) -> np.ndarray:
    """States by SciPy on the press written down by hand."""
    model, numbers = (press(), STIFFEST) if kind == "stiffest" else (press("none"), LEAST)
    solution = _run(kind, "stepper", 1e-6)
    size = np.max(np.abs(solution.x), axis=0) + 1e-12
    by, tight = ("LSODA", 1e-9) if kind == "stiffest" else ("DOP853", 1e-11)
    return Machine.of(model, numbers).integrate(solution.t, solution.x[0], method=by, rtol=tight, magnitude=1e-2 * size)


def edge(kind: str, method: str, rtol: float, bound: float) -> Finding:
    """A method on the stiffest, or on the least damped case."""
    solution = _run(kind, method, rtol)
    steps = solution.statistics.steps
    return Finding(
        status="done",
        error=difference(solution.x, _expected(kind)),
        bound=bound,
        note=f"{steps} steps" if steps else "",
    )


def crawl(method: str) -> Finding:
    """A thousand times stiffer still: done, or refused with the remedy, after bounded work."""
    numbers = {**STIFFEST, RATIO: 2.5e-4}
    patterns = (r"method erk: damping decays at up to [\d.e+]+ 1/s.*Take method stepper or rosenbrock",
                r"more steps than allowed.*an explicit method crawls on a stiff model")  # fmt: skip
    said = ""
    try:
        solution = press().simulate(cycles=1, parameters=numbers, method=method, samples_per_cycle=100, transient=0)
    except BallpassError as fault:
        said = str(fault)
    if said:
        assert any(re.search(pattern, said, re.DOTALL) for pattern in patterns), said
        return Finding(status="refused: " + ("too stiff for erk" if method == "erk" else "too many steps"))
    same = press().simulate(
        cycles=1, parameters=numbers, method="stepper-rodas4", rtol=1e-9, samples_per_cycle=100, transient=0
    )
    return Finding(
        status="done", error=difference(solution.x, same.x), bound=1e-2, note=f"{solution.statistics.steps} steps"
    )


#: What every refusal on the way says besides its cause: where and when, and the ball.
WHERE = r"Method \S+, t = [\d.e+-]+ s, crank angle [\d.]+ deg, \d+ samples kept in \.partial\..*ball \d+ at [\d.]+ deg"


def refused(
    request: Callable[[], object], error: type[Exception], cause: str, *, kept: int | None = None, place: bool = True
) -> Finding:
    """A request that must be refused with such words; `kept`: samples that the solution must hold at least."""
    caught: Exception | None = None
    try:
        request()
    except error as fault:
        caught = fault
    assert caught is not None, "it was not refused"
    said = str(caught)
    assert re.search(cause, said, re.DOTALL), said
    if place:
        assert re.search(WHERE, said, re.DOTALL), said
    if kept is not None:
        assert isinstance(caught, IntegrationError)
        partial_run = caught.partial
        assert len(partial_run.t) >= kept, (len(partial_run.t), kept)
        assert np.all(np.isfinite(partial_run.x))
        assert partial_run.t[-1] <= caught.time * (1.0 + 1e-12)
        assert caught.ball is not None
    status = getattr(caught, "status", None)
    return Finding(status="refused: " + (status.name.lower().replace("_", " ") if status else "request"))


#: A start from which forces overflow at once.
FAR = np.full(8, 1e200)
OVERFLOWS = {PUNCH: 1e300}


def _growing(method: str) -> object:
    return press().simulate(cycles=1, initial=FAR, method=method, transient=0)


def _overflowing(method: str) -> object:
    # tolerances are relative to this load: the motion before it is followed no better than that
    return press().simulate(cycles=1, parameters=OVERFLOWS, method=method, transient=0)


def growth(method: str) -> Finding:
    """A rotor that damping of the wrong sign drives: refused with the samples kept, which grow as the closed form does.

    No scene may have such damping: the bounds are taken off, to meet growth that nothing stops.
    """
    bounded = rotor()
    model = copy.copy(bounded)
    free = (replace(info, above=None, least=None, most=None, below=None) for info in bounded.manifest.parameters)
    model.manifest = replace(bounded.manifest, parameters=tuple(free), relations=())
    rate, mass, speed = 200.0, 1.0, 1.0
    numbers = {
        "shaft.speed": 0.0, "bearing.inner_ring.damping": -rate * mass, "bearing.inner_ring.mass": mass,
        "bearing.clearance": 1e300, "load.force.x": 0.0, "load.force.y": 0.0, "bearing.initial.inner.x": 0.0,
        "bearing.initial.inner.y": 0.0, "bearing.initial.inner_velocity.x": speed,
    }  # fmt: skip
    try:
        model.simulate(duration=5.0, parameters=numbers, method=method, rtol=1e-8, samples_per_cycle=1000, transient=0)
    except IntegrationError as fault:
        kept, said = fault.partial, str(fault)
        assert re.search(WHERE, said, re.DOTALL) or "samples kept in .partial" in said, said
    else:
        raise AssertionError("it was not refused")
    assert len(kept.t) > 10, len(kept.t)
    assert np.all(np.isfinite(kept.x))
    t = kept.t[1:]
    with np.errstate(over="ignore"):
        expected = speed * np.expm1(rate * t) / rate
    error = float(np.max(np.abs(kept["inner.x"][1:] / expected - 1.0)))
    assert fault_is_told(said), said
    return Finding(status="refused", error=error, bound=1e-4, note=f"{len(kept.t)} samples kept, to {t[-1]:.3g} s")


def fault_is_told(said: str) -> bool:
    """Whether a refusal names a cause and a remedy."""
    return bool(re.search(r"(step size fell|stopped being finite|more steps than allowed|could not go on)", said)) and (
        "check" in said
    )


def jumps(law: str, multiple: float, allowed: float) -> Finding:
    """Steps in a turn where the force jumps at contact."""
    model = press(law)
    numbers = {RATIO: multiple * model.parameters[RATIO]}
    solution = model.simulate(cycles=4, parameters=numbers, transient=0)
    steps = (solution.statistics.steps or 0) + (solution.statistics.rejected or 0)
    return Finding(status="done", error=steps / 4.0, bound=allowed, note="steps a turn, rejected ones included")


def fast_load(frequency: float) -> Finding:
    """A load that swings a million times without anything turning: its phase at the end."""
    model: Model = rotor((ROTOR_LOAD, HARMONIC))
    # soft and heavy enough that steps span many swings; the load's own phase is what is asked
    duration = 1.0
    mass, amplitude = 20.0, 20.0
    numbers = {
        "shaft.speed": 0.0, "load.frequency": frequency, "load.mean.x": 0.0, "load.amplitude.x": amplitude,
        "bearing.clearance": 1.0, "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": mass,
        "bearing.initial.inner.x": 0.0, "bearing.initial.inner.y": 0.0,
    }  # fmt: skip
    w = 2.0 * math.pi * frequency
    solution = model.simulate(duration=duration, parameters=numbers, rtol=1e-12, samples_per_cycle=50, transient=0)
    speed = amplitude / (mass * w)
    expected = speed * np.sin(w * solution.t)
    error = float(np.max(np.abs(solution["inner.vx"] - expected))) / speed
    return Finding(status="done", error=error, bound=1e-3, note=f"{solution.statistics.steps} steps")


def cases() -> list[Case]:
    """All of this section."""
    against = "SciPy on the hand-written press"
    quick = ("stepper", "stepper-rodas4", "rosenbrock", "cvodes")
    found = [
        Case(group=GROUP, name=words, method=method, against=against, run=partial(edge, kind, method, rtol, bound),
             quick=method in quick)
        for kind, words, rtol, bound in (
            ("stiffest", "stiffest: one-sided read in SI, outer ring 1 g", 1e-8, 1e-3),
            ("least", "no damping at all", 1e-10, 1e-3),
        )
        for method in METHODS
    ]  # fmt: skip
    found += [
        Case(group=GROUP, name="100 times stiffer still", method=method, against="stepper-rodas4 at 1e-9, or a refusal",
             run=partial(crawl, method), quick=method in ("stepper", "erk"),
             long=method in ("stepper-dp54", "stepper-dop853"))
        for method in METHODS
    ]  # fmt: skip
    small = r"(step size fell to the resolution of time|stopped being finite).*check initial state"
    failed = r"integrator could not go on.*method=\"rosenbrock\""

    def wide() -> object:
        return press().simulate(cycles=1, parameters={"mechanism.bodies.crank.points.B": 0.1})

    plain: list[tuple[str, str, Callable[[], Finding], bool]] = [
        *(("start at 1e200 m", method,
           partial(refused, partial(_growing, method), IntegrationError,
                   small if method.startswith("stepper") else failed + "|" + small, kept=1), method == "stepper")
          for method in METHODS),
        *(("overflow of a load of 1e300 N", method,
           partial(refused, partial(_overflowing, method), IntegrationError, small, kept=50), method == "stepper")
          for method in ("stepper", "stepper-rodas5p", "stepper-dop853")),
        ("overflow of a load of 1e300 N", "reduce",
         partial(refused, lambda: press().reduce(cycles=3, parameters=OVERFLOWS), SimulationError,
                 small + r".*crank angle [\d.]+ deg.*ball \d+ at", place=False), True),
        ("a linkage at its dead centre", "assembly",
         partial(refused, wide, RequestError, r"cannot be assembled at joint 'C', worst at.*Change the lengths",
                 place=False), True),
        ("turns of a shaft that stands", "request",
         partial(refused, lambda: press().simulate(cycles=1, parameters={"mechanism.driver.speed": 0.0}), RequestError,
                 r"nothing turns.*Give duration", place=False), True),
        ("100 000 turns with 2000 samples each", "request",
         partial(refused, lambda: press().simulate(cycles=100_000), RequestError,
                 r"would not fit into memory.*Model\.reduce", place=False), True),
        ("rtol 1e-14", "request",
         partial(refused, lambda: press().simulate(cycles=1, rtol=1e-14), RequestError, r"rtol: a number from 1e-13",
                 place=False), True),
    ]  # fmt: skip
    found += [
        Case(group=GROUP, name=name, method=method, against="words of the refusal", run=run, quick=fast)
        for name, method, run, fast in plain
    ]
    found += [
        Case(group=GROUP, name="growth without bound", method=method, against="closed form, of the samples kept",
             run=partial(growth, method), quick=method in ("stepper", "erk"),
             long=method in ("rosenbrock", "cvodes"))
        for method in METHODS
    ]  # fmt: skip
    found += [
        Case(group=GROUP, name=f"law {law}, damping x {multiple:g}", method="stepper", against="steps a turn allowed",
             run=partial(jumps, law, multiple, 20_000.0), quick=law == "two-sided-gated")
        for law in ("one-sided-gated", "two-sided-gated")
        for multiple in (1.0, 30.0, 3000.0)
    ]  # fmt: skip
    found += [
        Case(group=GROUP, name=f"load of {f:g} Hz with nothing turning, 1 s", method="stepper", against="closed form",
             run=partial(fast_load, f), long=f > 1e3)
        for f in (1e3, 1e5)
    ]  # fmt: skip
    return found
