"""Part 3, second half: what derivatives of a run cost against their number, ``python -m benchmarks.sensitivity_cost``.

In: one cycle of the press with its three dampings.  Out: times of runs with derivatives over the time of the run
without, paired round by round.

Three ways to the same derivatives at the end of the cycle stand in one table: forward sensitivities of the stepper,
those of CasADi's `erk` and `rosenbrock` in C, and central differences of the stepper's runs.  Every CasADi row is
checked against the stepper's derivatives before it is timed.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from ballpass.runtime.model import Model
from ballpass.runtime.native.compile import compile_sources
from ballpass.runtime.native.compilers import find_compiler
from ballpass.runtime.native.kernel import Kernel
from ballpass.runtime.native.stepper import End, Family
from ballpass.runtime.run.sensitivity import Chain, Directions
from benchmarks.own import Unavailable, integrator
from benchmarks.problem import BUILD, CASES, Case, Member, models, parameter_sets
from benchmarks.tables import table
from benchmarks.timing import Entry, digits, interleave, spread

#: Tolerance of the runs, and of those that CasADi's derivatives are checked at [1].
TOLERANCE = 1e-5
CHECKED_AT = 1e-8

#: Numbers of parameters; CasADi's code for many takes minutes to compile and is asked for the first ones of these only.
COUNTS = (1, 5, 10, 20, 40)
CASADI_COUNTS = (1, 5, 20)

#: Largest difference of CasADi's derivatives from the stepper's, over the largest of each parameter [1]: contacts that
#: open cost the derivatives order, and both carry that error.
AGREEMENT = 0.05

#: These move the times at which the punch acts, and stand at the end of the list: CasADi's integrators know no such
#: times.
MOVING = ("mechanism.driver.speed", "mechanism.driver.start_angle", "mechanism.forces.punch.window")


def sensitivity_cost(
    rounds: int, counts: Sequence[int] = COUNTS, casadi_counts: Sequence[int] = CASADI_COUNTS
) -> dict[str, Any]:
    """Rows of times over those of the plain run of the same method."""
    by_scene = models()
    rows: list[dict[str, Any]] = []
    for case in CASES:
        rows += _stepper_rows(case, by_scene[case.scene], rounds, counts)
    middle = next(case for case in CASES if case.key == "onesided")
    rows += _casadi_rows(middle, by_scene[middle.scene], rounds, casadi_counts)
    return {"tolerance": TOLERANCE, "counts": list(counts), "rows": rows, "fits": _fits(rows)}


def parameter_names(model: Model) -> list[str]:
    """All parameters, those that move breakpoints last."""
    names = list(model.parameters)
    return sorted(names, key=lambda name: (name.startswith(MOVING), names.index(name)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Timed:
    """A call with derivatives along `count` parameters (0: the plain run) of one way."""

    way: str
    case: Case
    count: int
    call: Callable[[], object]


def _paired(timed: Sequence[_Timed], rounds: int) -> list[dict[str, Any]]:
    """Times, and ratios to the plain run of the same way in the same round."""
    entries = [Entry(call=_numbered(one.call)) for one in timed]
    interleave(entries, rounds=rounds)
    plain = {(one.way, one.case.key): entry for one, entry in zip(timed, entries, strict=True) if one.count == 0}
    rows = []
    for one, entry in zip(timed, entries, strict=True):
        base = plain[one.way, one.case.key]
        ratios = np.array(entry.times) / np.array(base.times)
        rows.append(
            {
                "way": one.way,
                "case": one.case.key,
                "parameters": one.count,
                "seconds": spread(entry.times),
                "times_plain": spread(ratios.tolist()),
            }
        )
    return rows


def stepper_call(member: Member, names: Sequence[str], *, outputs: bool) -> Callable[..., np.ndarray]:
    """One run of the stepper with derivatives along `names` (none: the plain driver); returns those at the end."""
    model = member.model
    times = member.times if outputs else member.times[:0]
    states = np.empty((len(times), len(member.start)))
    directions = Directions(model, member.numbers, names, len(times)) if names else None
    stepper = model.differentiating_stepper if names else model.stepper
    tangents = directions.tangents(member.segments, 0, len(times)) if directions else None
    begin = tangents.x.copy() if tangents else None

    def run(tolerance: float = TOLERANCE) -> np.ndarray:
        if tangents is not None and begin is not None:
            tangents.x[:] = begin
        outcome = stepper.run(
            family=Family.AUTO,
            tolerance=tolerance * member.magnitude,
            p=member.numbers.p,
            c=member.numbers.c,
            x=member.start.copy(),
            segments=member.segments,
            output_times=times,
            output_states=states,
            tangents=tangents,
        )
        if outcome.end is not End.DONE:
            raise RuntimeError(f"the stepper ended early: {outcome.end.name}")
        if tangents is None:
            return np.zeros((len(member.start), 0))
        return np.asarray(tangents.x.transpose(1, 0, 2).reshape(len(member.start), -1)[:, : len(names)])

    return run


def _numbered(call: Callable[[], object]) -> Callable[[int], object]:
    return lambda _: call()


def _model_call(member: Member, names: Sequence[str]) -> Callable[[], object]:
    """What a user calls: a cycle from the scene's own start."""
    model, parameters, points = member.model, member.parameters, len(member.times)
    if not names:
        return lambda: model.simulate(1, parameters=parameters, rtol=TOLERANCE, samples_per_cycle=points)
    return lambda: model.sensitivities(names, 1, parameters=parameters, rtol=TOLERANCE, samples_per_cycle=points)


def _repeated(call: Callable[[], object], count: int) -> Callable[[], object]:
    return lambda: [call() for _ in range(count)]


def _stepper_rows(case: Case, model: Model, rounds: int, counts: Sequence[int]) -> list[dict[str, Any]]:
    member = Member(case, model, parameter_sets(case, model, 1)[0])
    names = parameter_names(model)
    timed = []
    for way, outputs in (("stepper, 2000 points", True), ("stepper, end only", False)):
        for count in (0, *counts):
            call = stepper_call(member, names[:count], outputs=outputs)
            timed.append(_Timed(way=way, case=case, count=count, call=call))
    timed += [
        _Timed(way="model.simulate", case=case, count=count, call=_model_call(member, names[:count]))
        for count in (0, *counts)
    ]
    plain = stepper_call(member, [], outputs=False)
    timed += [
        _Timed(way="central differences", case=case, count=count, call=_repeated(plain, max(2 * count, 1)))
        for count in (0, *counts)
    ]
    return _paired(timed, rounds)


# ------------------------------------------------------------------------------------------------------------- CasADi


def _casadi_rows(case: Case, model: Model, rounds: int, counts: Sequence[int]) -> list[dict[str, Any]]:
    member = Member(case, model, parameter_sets(case, model, 1)[0])
    names = parameter_names(model)
    timed = []
    absent: list[dict[str, Any]] = []
    agreement: dict[tuple[str, int], float] = {}
    for plugin in ("erk", "rosenbrock"):
        way = f"CasADi {plugin}, C"
        try:
            runs = {count: casadi_call(member, plugin, names[:count]) for count in (0, *counts)}
        except Unavailable as reason:
            absent.append({"way": way, "case": case.key, "absent": str(reason)})
            continue
        for count, run in runs.items():
            if count:
                expected = stepper_call(member, names[:count], outputs=False)(CHECKED_AT)
                agreement[way, count] = _disagreement(run(CHECKED_AT), expected)
                if not agreement[way, count] <= AGREEMENT:
                    raise ArithmeticError(
                        f"{way}: its derivatives by {count} parameters differ from the stepper's by "
                        f"{agreement[way, count]:.1e}; {AGREEMENT:g} is allowed. One of them is wrong."
                    )
            timed.append(_Timed(way=way, case=case, count=count, call=run))
    rows = _paired(timed, rounds) if timed else []
    for row in rows:
        if row["parameters"]:
            row["agreement"] = digits(agreement[row["way"], row["parameters"]], 2)
    return [*rows, *absent]


def _disagreement(found: np.ndarray, expected: np.ndarray) -> float:
    half = len(expected) // 2
    sizes = np.repeat([np.max(np.abs(expected[:half]), axis=0), np.max(np.abs(expected[half:]), axis=0)], half, axis=0)
    return float(np.max(np.abs(found - expected) / np.where(sizes > 0.0, sizes, 1.0)))


def casadi_call(member: Member, plugin: str, names: Sequence[str]) -> Callable[..., np.ndarray]:
    """The cycle by one of CasADi's integrators in C, with derivatives along `names` that move no breakpoint.

    Raises
    ------
    Unavailable
        There is no C compiler.
    """
    count = len(names)
    kernel = _compiled(member, plugin, count)
    chain = Chain(member.model, member.numbers, names)
    before = np.zeros((2 + len(member.start), count))  # of a segment's start and length, and of the scales
    seeds = [np.concatenate([before, chain.inputs(a), chain.p, chain.c]) for a, *_ in member.pieces]

    def run(tolerance: float = TOLERANCE) -> np.ndarray:
        scale = tolerance * member.magnitude
        state = member.start
        derivative = np.zeros((len(state), count))  # the cycle starts from a given state
        for k, (a, b, *_) in enumerate(member.pieces):
            packed = np.concatenate(
                [(0.0, b - a), scale, member.segments.inputs[k], member.numbers.p, member.numbers.c]
            )
            given = {"x0": state / scale, "p": packed}
            if count:
                given |= {"fwd_x0": (derivative / scale[:, None]).ravel("F"), "fwd_p": seeds[k].ravel("F")}
            kernel.run(given)
            state = np.ravel(kernel.output("xf")) * scale
            if count:
                derivative = kernel.output("fwd_xf").reshape(len(state), count) * scale[:, None]
        return derivative

    return run


def _compiled(member: Member, plugin: str, count: int) -> Kernel:
    """Integrator over a whole segment with its forward derivative along `count` directions, generated and compiled."""
    function = integrator(member, plugin, 0, [1.0], False)
    x, p = (casadi.MX.sym(name, function.size1_in(name)) for name in ("x0", "p"))
    names, given, results = ["x0", "p"], [x, p], [function(x0=x, p=p)["xf"]]
    if count:
        along_x, along_p = casadi.MX.sym("fwd_x0", x.size1(), count), casadi.MX.sym("fwd_p", p.size1(), count)
        names, given = [*names, "fwd_x0", "fwd_p"], [*given, along_x, along_p]
        results.append(function.forward(count)(x0=x, p=p, fwd_x0=along_x, fwd_p=along_p)["fwd_xf"])
    whole = casadi.Function(f"{plugin}_forward{count}", given, results, names, ["xf", "fwd_xf"][: len(results)])
    folder = BUILD / "casadi"
    folder.mkdir(parents=True, exist_ok=True)
    label = f"{plugin}_{member.case.scene}_forward{count}"
    generator = casadi.CodeGenerator(f"{label}.c")
    generator.add(whole)
    generator.generate(f"{folder}{os.sep}")
    compiler = find_compiler()
    if compiler is None:
        raise Unavailable("no C compiler")
    library = compile_sources((folder / f"{label}.c",), compiler, label=label, flags=("-O3",))
    return Kernel(casadi.external(whole.name(), str(library.path)))


# ------------------------------------------------------------------------------------------------------------ results


def _fits(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Lines through the ratios of the stepper against the blocks of eight directions that it differentiates along."""
    fits = []
    for way, case in sorted({(row["way"], row["case"]) for row in rows if row["way"].startswith("stepper")}):
        some = [row for row in rows if (row["way"], row["case"]) == (way, case) and row["parameters"]]
        if len({_blocks(row["parameters"]) for row in some}) < 2:
            continue
        x = np.array([_blocks(row["parameters"]) for row in some], dtype=float)
        y = np.array([row["times_plain"]["median"] for row in some])
        slope, offset = np.polyfit(x, y, 1)
        fits.append(
            {
                "way": way,
                "case": case,
                "a_block": digits(float(slope), 3),
                "without": digits(float(offset), 3),
                "largest_deviation": digits(float(np.max(np.abs(slope * x + offset - y) / y)), 2),
            }
        )
    return fits


def _blocks(count: int) -> int:
    return -(-count // 8)


def lines(result: dict[str, Any]) -> list[str]:
    """The table in Markdown."""
    words = {case.key: case.words for case in CASES}
    counts = result["counts"]
    body = []
    for way, case in dict.fromkeys((row["way"], row["case"]) for row in result["rows"]):
        some = {row.get("parameters"): row for row in result["rows"] if (row["way"], row["case"]) == (way, case)}
        if None in some:
            body.append([f"{way}, {words[case]}", some[None]["absent"], *[""] * len(counts)])
            continue
        cells = [f"{some[n]['times_plain']['median']:.3g}×" if n in some else "" for n in counts]
        body.append([f"{way}, {words[case]}", f"{1e3 * some[0]['seconds']['median']:.3g}", *cells])
    heads = [f"{n} parameter{'s' if n > 1 else ''}" for n in counts]
    return table(["", "plain run, ms", *heads], body)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sensitivity_cost", description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args(arguments)
    print("\n".join(lines(sensitivity_cost(options.rounds))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
