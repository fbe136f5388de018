"""What one Jacobian costs, ``python -m benchmarks.jacobians [--rounds N]``.

In: the press with tangent damping, under the punch's load, balls in contact.  Out: time of one call, alone and over the
time of the right-hand side called the same way, paired round by round.

Three ways to the same entries stand in one table: "code" is the compiled function through its buffer alone; "prepared"
is `Model.jacobian_function`, which copies the state in, calls that and picks the entries; "differences" are central
differences of the same quantity through its buffer, which cost two calls for each column and are half as exact.  The
dense `Model.jacobian`, which looks up names and numbers anew, is there for scale.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ballpass.derive import generate
from ballpass.runtime import Model, load
from ballpass.runtime.point.jacobian import rows_of
from benchmarks.problem import BUILD, ROOT
from benchmarks.tables import table
from benchmarks.timing import Entry, digits, interleave, spread

SCENE = "punching_press_tangent"

#: Within the window of the punch [s].
INSTANT = 0.0811

#: What by what.
QUERIES: tuple[tuple[str, str | tuple[str, ...]], ...] = (
    ("rhs", "states"),
    ("ball.force", "states"),
    ("ring_force.*", "states"),
    ("ball.force", "bearing.clearance"),
    ("reaction.A.*", "crank_angle"),
    ("drive_torque", "mechanism.bodies.crank.points.B"),
    ("rhs", ("bearing.clearance", "mechanism.bodies.slider.mass", "mechanism.driver.speed")),
)

#: Calls of one visit.
CALLS = 2000


def measure(rounds: int) -> dict[str, Any]:
    """Times of one call [s] and ratios to the right-hand side; medians over interleaved rounds."""
    model = load(generate(ROOT / "scenes" / f"{SCENE}.toml", BUILD / "generated" / SCENE))
    x = model.static_equilibrium(INSTANT).x
    x[len(x) // 2 :] = 1e-3 * np.cos(np.arange(len(x) // 2))
    base = Entry(call=_raw(model, "rhs", x))
    entries: dict[str, Entry] = {"rhs": base}
    facts = []
    for k, (of, wrt) in enumerate(QUERIES):
        prepared = model.jacobian_function(of, wrt, t=INSTANT)
        prepared(x)
        facts.append({"of": of, "wrt": wrt if isinstance(wrt, str) else list(wrt), "entries": len(prepared.values)})
        (rows,) = rows_of(model, of)
        entries |= {
            f"{k}, code": Entry(call=_times(prepared.evaluate)),
            f"{k}, prepared": Entry(call=_times(partial(prepared, x))),
            f"{k}, dense": Entry(call=_times(partial(model.jacobian, of, wrt, t=INSTANT, x=x), CALLS // 50)),
            f"{k}, differences": Entry(call=_raw(model, rows.function, x, 2 * prepared.sparsity.shape[1])),
        }
    interleave(list(entries.values()), rounds=rounds)
    reference = np.array(base.times) / CALLS
    out = []
    for k, fact in enumerate(facts):
        row: dict[str, Any] = dict(fact)
        for way in ("code", "prepared", "dense", "differences"):
            calls = CALLS // 50 if way == "dense" else CALLS
            times = np.array(entries[f"{k}, {way}"].times) / calls
            row[way] = {
                "time": digits(float(np.median(times))),
                "seconds": spread(times),
                "ratio": spread(times / reference),
            }
        out.append(row)
    return {"scene": SCENE, "rhs": digits(float(np.median(reference))), "rows": out}


def _times(call: Callable[[], object], calls: int = CALLS) -> Callable[[int], None]:
    def visit(_: int) -> None:
        for _ in range(calls):
            call()

    return visit


def _raw(model: Model, name: str, x: np.ndarray, evaluations: int = 1) -> Callable[[int], None]:
    """A function through its buffer, as often as a difference quotient needs it."""
    function = model.function(name)
    made: Any = function.buffer()
    buffer, evaluate = made
    numbers = model.numbers()
    point: dict[str, Any] = {"t": 0.0, "x": x, "u": model.inputs_at(INSTANT), "p": numbers.p, "c": numbers.c}
    memory = []
    for k, argument in enumerate(function.name_in()):
        values = np.array(np.broadcast_to(point[argument], function.nnz_in(k)), dtype=float)
        memory.append(values)
        if values.size:
            buffer.set_arg(k, values.data)
    result = np.zeros(function.nnz_out(0))
    buffer.set_res(0, result.data)
    memory.append(result)

    def visit(_: int, _held: object = (buffer, memory)) -> None:
        for _ in range(CALLS * evaluations):
            evaluate()

    return visit


def lines(result: dict[str, Any]) -> list[str]:
    """The table in Markdown."""
    head = ("of", "by", "entries", "code, µs", "prepared, µs", "dense, µs", "code / rhs", "differences / code")
    rows = []
    for row in result["rows"]:
        wrt = row["wrt"] if isinstance(row["wrt"], str) else f"{len(row['wrt'])} parameters"
        quotient = row["differences"]["ratio"]["median"] / row["code"]["ratio"]["median"]
        rows.append(
            (
                row["of"],
                wrt,
                str(row["entries"]),
                *(f"{1e6 * row[way]['time']:.3g}" for way in ("code", "prepared", "dense")),
                f"{row['code']['ratio']['median']:.2f}×",
                f"{quotient:.2f}×",
            )
        )
    return table(head, rows)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.jacobians", description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args(arguments)
    result = measure(options.rounds)
    print(f"one right-hand side through its buffer: {1e6 * result['rhs']:.3g} µs")
    print("\n".join(lines(result)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
