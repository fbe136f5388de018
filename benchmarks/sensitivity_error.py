"""Part 6: error of states and of their derivatives against tolerance, ``python -m benchmarks.sensitivity_error``.

In: one cycle of the press over perturbed parameter sets.  Out: errors of runs whose step sizes follow the states alone,
and of runs in which the derivatives take part with the same tolerance.

The reference is a run of DOP853 at tight tolerances; one of Rodas5P tells how far it can be trusted.  Errors are the
largest difference at any output point over the largest value: of each state, and of each state's derivative by each of
`NAMES`; the worst of them counts.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.native.stepper import End, Family
from ballpass.runtime.run.sensitivity import Directions
from benchmarks import figures
from benchmarks.problem import CASES, Case, Member, models, parameter_sets
from benchmarks.tables import table
from benchmarks.timing import digits, spread

#: One of each kind: geometry, mass, load, elasticity, and one that moves the punch in time.
NAMES = (
    "bearing.clearance",
    "mechanism.bodies.slider.mass",
    "mechanism.forces.punch.force.y",
    "bearing.contact.young_modulus",
    "mechanism.driver.speed",
)

#: Tolerances of states and derivatives [1].
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

#: Of the reference: of the states, of the derivatives [1].
REFERENCE = (1e-11, 1e-8)

#: Output points of the cycle, every so many of those of part 1.
EVERY = 20

#: Cases shown; the laws differ in how derivatives behave where contact opens.
SHOWN = ("onesided", "tangent")


@dataclass(frozen=True, slots=True, kw_only=True)
class Differentiated:
    """States, shape (points, states), derivatives, shape (points, states, names), and steps taken."""

    states: np.ndarray
    derivatives: np.ndarray
    steps: int


def differentiated(member: Member, family: Family, rtol: float, sensitivity_rtol: float | None) -> Differentiated:
    """One run with derivatives along `NAMES`.

    Raises
    ------
    RuntimeError
        The run ended early.
    """
    model = member.model
    times = np.ascontiguousarray(member.times[EVERY - 1 :: EVERY])
    states = np.empty((len(times), len(member.start)))
    directions = Directions(model, member.numbers, NAMES, len(times))
    if sensitivity_rtol is not None:
        directions.control(sensitivity_rtol, member.magnitude)
    tangents = directions.tangents(member.segments, 0, len(times))
    outcome = model.differentiating_stepper.run(
        family=family,
        tolerance=rtol * member.magnitude,
        p=member.numbers.p,
        c=member.numbers.c,
        x=member.start.copy(),
        segments=member.segments,
        output_times=times,
        output_states=states,
        tangents=tangents,
    )
    if outcome.end is not End.DONE:
        raise RuntimeError(f"{member.case.key}: a run at {rtol:g}, {sensitivity_rtol} ended early: {outcome.end.name}")
    return Differentiated(
        states=states, derivatives=directions.states(len(times)), steps=outcome.steps + outcome.rejected
    )


def errors(found: Differentiated, reference: Differentiated) -> tuple[float, float]:
    """Largest relative error of a state, and of a derivative [1]."""
    state = np.max(np.abs(found.states - reference.states), axis=0) / np.max(np.abs(reference.states), axis=0)
    size = np.max(np.abs(reference.derivatives), axis=0)
    derivative = np.max(np.abs(found.derivatives - reference.derivatives), axis=0) / size
    return float(np.max(state)), float(np.max(derivative))


def sensitivity_error(
    members: int, say: Callable[[str], None], tolerances: Sequence[float] = TOLERANCES
) -> dict[str, Any]:
    """Errors over the ensemble, for every case shown."""
    by_scene = models()
    cases = [_case(case, by_scene[case.scene], members, tolerances, say) for case in CASES if case.key in SHOWN]
    return {"members": members, "names": list(NAMES), "reference": list(REFERENCE), "cases": cases}


def _case(
    case: Case, model: Any, members: int, tolerances: Sequence[float], say: Callable[[str], None]
) -> dict[str, Any]:
    say(f"sensitivity_error, {case.key}: references of {members} members")
    ensemble = [Member(case, model, p) for p in parameter_sets(case, model, members)]
    references = [differentiated(m, Family.DOP853, *REFERENCE) for m in ensemble]
    others = [differentiated(m, Family.RODAS5P, *REFERENCE) for m in ensemble]
    agreement = [errors(a, b) for a, b in zip(others, references, strict=True)]
    rows = []
    for tolerance in tolerances:
        say(f"sensitivity_error, {case.key}: tolerance {tolerance:g}")
        row: dict[str, Any] = {"tolerance": tolerance}
        for kind, own in (("states alone", None), ("with derivatives", tolerance)):
            runs = [differentiated(m, Family.AUTO, tolerance, own) for m in ensemble]
            found = [errors(run, reference) for run, reference in zip(runs, references, strict=True)]
            row[kind] = {
                "state": spread([e for e, _ in found]),
                "derivative": spread([e for _, e in found]),
                "steps": digits(float(np.median([run.steps for run in runs]))),
            }
        rows.append(row)
    return {
        "case": case.key,
        "words": case.words,
        "agreement": {
            "state": digits(max(e for e, _ in agreement), 2),
            "derivative": digits(float(np.median([e for _, e in agreement])), 2),
            "worst_derivative": digits(max(e for _, e in agreement), 2),
        },
        "rows": rows,
    }


def lines(result: dict[str, Any]) -> list[str]:
    """A table in Markdown for each case."""
    found = []
    for case in result["cases"]:
        body = []
        for row in case["rows"]:
            free, controlled = row["states alone"], row["with derivatives"]
            cells = [f"{part[what]['median']:.1e}" for part in (free, controlled) for what in ("state", "derivative")]
            steps = f"{controlled['steps'] / free['steps']:.2g}×"
            body.append([f"{row['tolerance']:.0e}", *cells[:2], f"{free['steps']:.0f}", *cells[2:], steps])
        head = ["tolerance", "state", "derivative", "steps", "state, both controlled", "derivative", "steps"]
        found += [
            f"**Damping {case['words']}** (references agree within {case['agreement']['state']:.0e} in the states, "
            f"{case['agreement']['derivative']:.0e} in the derivatives; median over the members)",
            "",
            *table(head, body),
            "",
        ]
    return found


def figure(path: Path, result: dict[str, Any]) -> None:
    """Errors against tolerance."""
    figures.sensitivity_errors(path, result["cases"])


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sensitivity_error", description=__doc__)
    parser.add_argument("--members", type=int, default=24)
    options = parser.parse_args(arguments)
    print("\n".join(lines(sensitivity_error(options.members, lambda line: print(line, file=sys.stderr)))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
