"""Parts 2 and 3: what one right-hand side and one step cost, and how cost grows with the number of balls."""

from __future__ import annotations

import ctypes
import re
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.model import Model
from ballpass.runtime.native.stepper import METHODS, Family
from benchmarks.own import Unavailable, c_numbers, hand, hand_run, stepper_run
from benchmarks.peers import imported, numba_rate, numpy_rate
from benchmarks.problem import BUILD, ROOT, Case, Member, parameter_sets
from benchmarks.timing import Entry, digits, interleave, spread

#: Tolerance of the runs that steps are counted in [1].
TOLERANCE = 1e-5

#: Ball counts of part 3, and the ball diameter that lets the largest fit on the pitch circle.
BALLS = (4, 8, 16, 32, 64)
SMALL_BALL = "1.5 mm"

#: Contact stiffness of the eight balls together; each has its share, so that the motion hardly depends on their number.
STIFFNESS_OF_ALL = 8 * 8.64e9


def one_step(case: Case, model: Model, rounds: int) -> dict[str, Any]:
    """Times of one right-hand side, one evaluation within a run and one step, without outputs."""
    member = Member(case, model, parameter_sets(case, model, 1)[0])
    rows: list[dict[str, Any]] = []
    entries: list[tuple[Entry, dict[str, Any]]] = []

    def add(label: str, count: int, call: Callable[[int], object], **more: Any) -> None:
        row = {"label": label, "count": count, **more}
        rows.append(row)
        entries.append((Entry(call=call), row))

    points = 2000
    states = member.start + 0.01 * member.magnitude * np.random.default_rng(1).uniform(-1.0, 1.0, (points, 8))
    times = member.period * np.linspace(0.1, 0.3, points)
    press, numbers = member.press, c_numbers(member)
    add(
        "by hand in C",
        100_000,
        lambda _: hand().press_rates(ctypes.addressof(numbers), 0.0, 0.02, 1e-9, 100_000, member.start.ctypes.data),
        kind="rate",
    )
    values = {"t": times, "x": states, "u": member.segments.inputs[0], "p": member.numbers.p, "c": member.numbers.c}
    loop = model.loop("rhs", ("t", "x"))
    add("generated for CasADi, C", points, lambda _: loop(points, values), kind="rate")
    try:
        sweep = _numba_sweep()
        sweep(press, times, states)
        add("numba", points, lambda _: sweep(press, times, states), kind="rate")
    except Unavailable:
        rows.append({"label": "numba", "kind": "rate", "absent": "not installed"})
    in_numpy = numpy_rate(press.tangent == 1.0)

    def all_in_numpy(_: int) -> None:
        for t, x in zip(times[:200], states[:200], strict=True):
            in_numpy(press, 0.0, t, x)

    add("NumPy", 200, all_in_numpy, kind="rate")
    for name, family in METHODS.items():
        if family is Family.AUTO:
            continue
        _, outcome = stepper_run(member, TOLERANCE, family, outputs=False)
        add(
            name,
            outcome.steps + outcome.rejected,
            _by_stepper(member, family),
            kind="step",
            evaluations=outcome.evaluations,
        )
    for method in ("rodas4", "rodas5p", "dp54"):
        _, counts = hand_run(member, TOLERANCE, method, outputs=False)
        add(
            f"by hand in C, {method}",
            counts.steps + counts.rejected,
            _by_hand(member, method),
            kind="step",
            evaluations=counts.evaluations,
        )
    interleave([entry for entry, _ in entries], rounds=rounds)
    for entry, row in entries:
        row["seconds_each"] = spread([t / row["count"] for t in entry.times])
        if row["kind"] == "step":
            row["seconds_an_evaluation"] = spread([t / row["evaluations"] for t in entry.times])
    return {"case": case.key, "tolerance": TOLERANCE, "rows": rows}


def _by_stepper(member: Member, family: Family) -> Callable[[int], object]:
    return lambda _: stepper_run(member, TOLERANCE, family, outputs=False)


def _by_hand(member: Member, method: str) -> Callable[[int], object]:
    return lambda _: hand_run(member, TOLERANCE, method, outputs=False)


def _numba_sweep() -> Callable[..., float]:
    numba, rate = imported("numba"), numba_rate()

    @numba.njit
    def sweep(n, times, states):  # type: ignore[no-untyped-def]
        total = 0.0
        dx = np.empty(8)
        for k in range(len(times)):
            rate(n, 0.0, times[k], states[k], dx)
            total += dx[4]
        return total

    found: Callable[..., float] = sweep
    return found


def balls(rounds: int, counts: tuple[int, ...] = BALLS) -> dict[str, Any]:
    """Cost of an evaluation and of a cycle against the number of balls, for an explicit and an implicit method."""
    rows: list[dict[str, Any]] = []
    entries = []
    for count in counts:
        begun = time.perf_counter()
        folder = generate(_scene(count), BUILD / "generated" / f"balls_{count}")
        generated = time.perf_counter() - begun
        model = load(folder)
        compiled = model.stepper.library.seconds
        member = Member(_BALLS_CASE, model, {})
        for name, family in (("stepper-dp54", Family.DP54), ("stepper-rodas5p", Family.RODAS5P)):
            _, outcome = stepper_run(member, TOLERANCE, family, outputs=False)
            row = {
                "balls": count,
                "method": name,
                "steps": outcome.steps + outcome.rejected,
                "evaluations": outcome.evaluations,
                "kernel_bytes": (folder / "kernels.h").stat().st_size,
                "generate_seconds": digits(generated, 2),
                "compile_seconds": digits(compiled, 2),
            }
            rows.append(row)
            entries.append(
                (
                    Entry(call=_by_stepper(member, family)),
                    row,
                )
            )
    interleave([entry for entry, _ in entries], rounds=rounds)
    for entry, row in entries:
        row["seconds"] = spread(entry.times)
        row["seconds_an_evaluation"] = spread([t / row["evaluations"] for t in entry.times])
    fits = []
    for method in sorted({row["method"] for row in rows}):
        some = [row for row in rows if row["method"] == method]
        x = np.array([row["balls"] for row in some], dtype=float)
        y = np.array([row["seconds_an_evaluation"]["median"] for row in some])
        slope, offset = np.polyfit(x, y, 1)
        fits.append(
            {
                "method": method,
                "seconds_a_ball": digits(slope),
                "seconds_without": digits(offset),
                "largest_deviation": digits(float(np.max(np.abs(slope * x + offset - y) / y)), 2),
            }
        )
    return {"tolerance": TOLERANCE, "rows": rows, "fits": fits}


_BALLS_CASE = Case(key="balls", words="balls", scene="punching_press")


def _scene(count: int) -> Any:
    """Scene file of the press with so many small balls, whose stiffness and damping together stay the same."""
    text = (ROOT / "scenes" / "punching_press.toml").read_text(encoding="utf-8")
    text = _replaced(r"^balls = 8\b", f"balls = {count}", text)
    text = _replaced(r'^ball_diameter = "[^"]*"', f'ball_diameter = "{SMALL_BALL}"', text)
    contact = f'[bearing.contact]\nstiffness = "{STIFFNESS_OF_ALL / count!r} N/m^1.5"\n'
    text = _replaced(r"^\[bearing\.contact\]\n(?:[a-z_]+ = .*\n)+", contact, text)
    path = BUILD / "scenes" / f"balls_{count}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def _replaced(pattern: str, by: str, text: str) -> str:
    found, count = re.subn(pattern, lambda _: by, text, flags=re.MULTILINE)
    if count != 1:
        raise ValueError(f"scenes/punching_press.toml: {pattern!r} was found {count} times, once is expected")
    return found
