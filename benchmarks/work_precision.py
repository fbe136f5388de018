"""Error and time of one cycle, for every contender and tolerance, over an ensemble of parameter sets."""

from __future__ import annotations

import contextlib
import ctypes
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from benchmarks import peers
from benchmarks.contenders import Contender, UnavailableError, own_contenders
from benchmarks.press import Press, disagreement
from benchmarks.problem import Case, Member, parameter_sets
from benchmarks.timing import interleave, timed

#: Errors at which contenders are compared [1].
LEVELS = (1e-3, 1e-5, 1e-7)
#: Largest difference of the right-hand sides written by hand from the generated one [1].
RATE_AGREEMENT = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is measured: parameter sets; a run that takes longer [s] is the last tolerance a contender tries, and
    one that takes longer than `slow` [s] is given three parameter sets only; every so many of the tolerances."""

    members: int = 16
    longest: float = 3.0
    slow: float = 0.1
    every: int = 1


QUICK = Effort(members=2, longest=0.3, slow=0.01, every=4)


def measure(case: Case, effort: Effort) -> dict[str, Any]:
    """Results of a case, for JSON."""
    model = case.model()
    ready, absent = _ready([*own_contenders(), *peers.peers()])
    members = [Member(case, model, numbers) for numbers in parameter_sets(case, model, effort.members)]
    rates = check_rates(members[0])
    independent = next((c.solve for c in ready if c.label == "SciPy DOP853, numba"), None)
    for member in members:
        member.refer(independent)
    found: dict[str, dict[str, Any]] = {c.label: {"group": c.group, "runs": _errors(c, members, effort)} for c in ready}
    # times in rounds over all contenders and tolerances; round k takes the parameter set k
    rows = [(c, run) for c in ready for run in found[c.label]["runs"]]
    times: dict[int, list[float]] = {id(run): [] for _, run in rows}
    for number, member in enumerate(members):
        left = [(c, run) for c, run in rows if len(run["errors"]) > number]
        taken = interleave([_call(c, member, run["tolerance"]) for c, run in left], rounds=1)[0]
        for (_, run), seconds in zip(left, taken, strict=True):
            times[id(run)].append(float(f"{seconds:.4g}"))
    for _, run in rows:
        run["times"] = times[id(run)]
    return {
        "words": case.words,
        "members": effort.members,
        "reference_agreement": float(f"{max(m.agreement for m in members):.2g}"),
        "rate_agreement": {name: float(f"{value:.2g}") for name, value in rates.items()},
        "contenders": found,
        "absent": absent,
    }


def _ready(contenders: Sequence[Contender]) -> tuple[list[Contender], dict[str, str]]:
    there, absent = [], {}
    for contender in contenders:
        try:
            contender.ready()
            there.append(contender)
        except UnavailableError as reason:
            absent[contender.label] = str(reason)
    return there, absent


def _call(contender: Contender, member: Member, tolerance: float) -> Callable[[], object]:
    return lambda: contender.solve(member, tolerance)


def _errors(contender: Contender, members: Sequence[Member], effort: Effort) -> list[dict[str, Any]]:
    """Errors of the members at each tolerance, after a first call that is not timed, because it may compile."""
    runs: list[dict[str, Any]] = []
    contender.solve(members[0], contender.tolerances[0])
    for tolerance in contender.tolerances[:: effort.every]:
        try:
            alone = timed(_call(contender, members[0], tolerance))
            some = members if alone < effort.slow else members[:3]
            errors = [member.error(contender.solve(member, tolerance)) for member in some]
        except (RuntimeError, ArithmeticError, ValueError):
            continue  # a dash in the table: this tolerance is not reached
        if all(math.isfinite(error) for error in errors):
            runs.append({"tolerance": float(f"{tolerance:.4g}"), "errors": [float(f"{e:.3g}") for e in errors]})
        if alone > effort.longest:
            break  # tighter ones take longer still
    return runs


def check_rates(member: Member) -> dict[str, float]:
    """Differences of the right-hand sides written by hand from the generated one.

    Raises
    ------
    ArithmeticError
        One of them is more than rounding: it is another model, and its times would mean nothing.
    """
    rates = {"NumPy": peers.numpy_rate(member.press.tangent == 1.0)}
    with contextlib.suppress(UnavailableError):
        rates["C"] = _filled(_c_rate(member))
    with contextlib.suppress(UnavailableError):
        rates["numba"] = _filled(peers.numba_rate())
    with contextlib.suppress(UnavailableError):
        rates["JAX"] = peers.imported("jax").jit(peers.jax_rate(member.press.tangent == 1.0))
    found = {n: disagreement(member.model, member.parameters, rate, member.magnitude) for n, rate in rates.items()}
    for name, value in found.items():
        if not value <= RATE_AGREEMENT:
            raise ArithmeticError(
                f"The right-hand side in {name} differs from the generated one by {value:.1e}; {RATE_AGREEMENT:g} is "
                "allowed. One of them is wrong: see benchmarks/press.py and benchmarks/cvode.c."
            )
    return found


def _c_rate(member: Member) -> Callable[..., None]:
    library, numbers = peers.cvode_library(), np.array([*member.press, *member.magnitude])

    def rate(_: Press, gate: float, t: float, x: np.ndarray, dx: np.ndarray) -> None:
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in (numbers, np.ascontiguousarray(x), dx)]
        library.press_rate(pointers[0], ctypes.c_double(gate), ctypes.c_double(t), *pointers[1:])

    return rate


def _filled(fills: Callable[..., None]) -> Callable[[Press, float, Any, Any], Any]:
    def rate(n: Press, gate: float, t: Any, x: Any) -> Any:
        outside = np.empty(8)
        fills(n, gate, t, x, outside)
        return outside

    return rate


def curve(contender: dict[str, Any]) -> list[tuple[float, float]]:
    """(error, time) of a contender's tolerances, from loose to tight; medians over the parameter sets."""
    return [(float(np.median(run["errors"])), float(np.median(run["times"]))) for run in contender["runs"]]


def time_at(points: Sequence[tuple[float, float]], error: float) -> float | None:
    """Time to an error [s], between neighbouring tolerances log against log; None where it is not reached."""
    found = [t for e, t in points if e <= error]
    for (e0, t0), (e1, t1) in pairwise(points):
        if 0.0 < min(e0, e1) <= error <= max(e0, e1) and e0 != e1:
            found.append(t0 * (t1 / t0) ** (math.log(error / e0) / math.log(e1 / e0)))
    return min(found, default=None)
