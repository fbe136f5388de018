"""Check that `--error` is kept, on random parameter sets near the shipped scenes and far from them.

    python -m benchmarks.trade.promise [--scenes NAME ...] [--sets N] [--seed N]

Writes docs/howto/accuracy_numbers.md.  The true error is the distance to another method at rtol 1e-12 with located
kinks.  A third run starts a picometre aside: quantities that it changes much have no value to compare (chaos).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ballpass.derive import generate
from ballpass.runtime import BallpassError, load
from ballpass.runtime.app.commands.shared import Stages
from ballpass.runtime.certify.error_target import MOVED, TargetMissed, meet_target
from ballpass.runtime.certify.method_choice import compared_quantities, stepper_run
from ballpass.runtime.certify.trade import REFERENCE, perturbed, reference
from ballpass.runtime.certify.trade_report import percent
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "howto" / "accuracy_numbers.md"
SCENES = ("punching_press", "punching_press_tangent", "offset_slider", "four_bar", "varying_compliance")
TARGETS = (0.1, 0.03, 0.01, 0.003, 1e-3, 1e-4, 1e-5, 1e-6)

#: An estimate is near the true error within the first factor of it, and wrong beyond the second.
NEAR, WRONG = 10.0, 100.0

#: What a named error may add: so many times the chosen run, and so long [s].
TIMES, SPARE = 3.0, 0.05

#: Far sets: numbers of these units, and the clearance, are multiplied by up to this factor or divided by it.
FAR, FAR_UNITS = 4.0, ("rad/s", "N", "kg", "kg*m^2", "N*s/m", "N/m")

#: Turns of a far run, drawn evenly.
TURNS = (3, 12)


@dataclass(slots=True, kw_only=True)
class Counts:
    """Outcome of the requests.

    Attributes
    ----------
    asked, missed, chaotic : requests; refused; refused as chaotic
    inconsistent : requests that were met although a larger error had been refused
    undefined : requests whose target is below what the reference, or a start moved by a picometre, leaves open
    accepted : of these, requests that were not refused
    kept : of the others that were not refused, whether the true error is within the target
    ratios : true error over estimate, where the true one is known
    cheap : whether the time besides the chosen run is within what was promised
    """

    asked: int = 0
    missed: int = 0
    chaotic: int = 0
    inconsistent: int = 0
    undefined: int = 0
    accepted: int = 0
    kept: list[bool] = field(default_factory=list)
    ratios: list[float] = field(default_factory=list)
    cheap: list[bool] = field(default_factory=list)


def far_sets(model: LoadedModel, seed: int) -> Iterator[tuple[dict[str, float], Request]]:
    """Parameter sets and lengths of runs far from the scene's; any ball angle."""
    random = np.random.default_rng(seed)
    while True:
        (numbers,) = perturbed(model, dict(model.parameters), 1, seed=int(random.integers(2**31)))
        for info in model.manifest.parameters:
            if info.unit in FAR_UNITS or info.name.endswith("clearance"):
                numbers[info.name] *= FAR ** random.uniform(-1.0, 1.0)
            elif info.name.endswith("ball_angle"):
                numbers[info.name] = random.uniform(0.0, math.tau)
        transient = model.manifest.run.transient_cycles
        yield numbers, Request(cycles=transient + random.integers(*TURNS, endpoint=True))


def near_sets(model: LoadedModel, seed: int) -> Iterator[tuple[dict[str, float], Request]]:
    """Parameter sets within half a per cent of the scene's."""
    random = np.random.default_rng(seed)
    while True:
        yield perturbed(model, dict(model.parameters), 1, seed=int(random.integers(2**31)))[0], Request()


def count(
    model: LoadedModel,
    sets: Iterator[tuple[dict[str, float], Request]],
    wanted: int,
    progress: Callable[[float], None],
) -> Counts:
    """Request every target, of the peak ball force alone and of all default quantities, on `sets` parameter sets."""
    compared = compared_quantities(model, None)
    quantities = QuantityRun(model, compared)
    found = Counts()
    done = 0
    while done < wanted:
        numbers, request = next(sets)
        try:
            run = stepper_run(model, model.numbers(numbers), request)
            values, doubt = reference(run, quantities)
            moved = REFERENCE.measure(quantities, run, MOVED).values
        except BallpassError:
            continue  # a linkage that cannot be assembled, a ring without support: there is no run
        with np.errstate(divide="ignore", invalid="ignore"):
            doubt = np.fmax(doubt, np.abs(moved / values - 1.0))
        if np.all(np.isfinite(doubt)):
            for columns in (slice(0, 1), slice(None)):
                _ask(run, compared[columns], values[columns], float(doubt[columns].max()), found)
        done += 1
        progress(done / wanted)
    return found


def _ask(run: Run, of: Sequence[Quantity], values: np.ndarray, doubt: float, found: Counts) -> None:
    refused = False
    for target in TARGETS:
        found.asked += 1
        found.undefined += doubt > target
        try:
            one = meet_target(run, target, of)
        except TargetMissed as refusal:
            found.missed += 1
            found.chaotic += "chaotic" in str(refusal)
            refused = True
            continue
        found.inconsistent += refused
        # the chosen run is integrated once more, with samples
        found.cheap.append(one.check_time + one.time <= TIMES * one.time + SPARE)
        if doubt > target:
            found.accepted += 1
            continue
        true = float(np.abs(np.array([one.values[item.name] for item in of]) / values - 1.0).max())
        found.kept.append(true <= target)
        if true > doubt:
            found.ratios.append(true / one.estimate)


def row(name: str, kind: str, one: Counts) -> tuple[str, ...]:
    """A row of the table."""
    ratios = np.array(one.ratios)
    return (
        f"{name}, {kind}",
        str(one.asked),
        f"{one.missed} ({one.chaotic} as chaotic)",
        str(one.inconsistent),
        f"{one.accepted} of {one.undefined}",
        f"{100 * np.mean(one.kept):.1f} %",
        f"{100 * np.mean((ratios <= NEAR) & (ratios >= 1.0 / NEAR)):.1f} %",
        f"{100 * np.mean(ratios > NEAR):.1f} %, {np.sum(ratios > WRONG)}",
        f"{ratios.max():.2g}",
        f"{100 * np.mean(one.cheap):.1f} %",
    )


HEAD = (
    *("scene and sets", "requests", "refused", "met though a larger error was refused", "accepted without a value"),
    "true error within the target",
    *("estimate within a factor of 10", "understated by more than 10, by more than 100", "worst understatement"),
    "added at most 3 times the run and 50 ms",
)
#: Columns of the first of the two tables, which fit on a page.
SPLIT = 5


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def main() -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.trade.promise", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--sets", type=int, default=40, help="parameter sets far from each scene; a fifth near it")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--out", type=Path, default=PAGE, help="page to write")
    given = parser.parse_args()
    rows = []
    with Stages() as stages:
        for name in given.scenes:
            model = load(generate(ROOT / "scenes" / f"{name}.toml", progress=stages))
            near, far = near_sets(model, given.seed), far_sets(model, given.seed)
            for kind, sets, wanted in (("near", near, max(given.sets // 5, 1)), ("far", far, given.sets)):
                stages(f"counting: {name}, {kind}")
                rows.append(row(name, kind, count(model, sets, wanted, stages.fraction)))
    targets = ", ".join(percent(target) for target in TARGETS)
    text = (
        f"<!-- Written by `python -m benchmarks.trade.promise --sets {given.sets} --seed {given.seed}`. "
        "Do not edit. -->\n\n"
        f"On {given.sets} random parameter sets far from each scene and a fifth as many near it: targets of {targets}, "
        f"each of the peak ball force alone and of five quantities together.\n\n"
        f"{markdown(HEAD[:SPLIT], [cells[:SPLIT] for cells in rows])}\n\n"
        f"{markdown((HEAD[0], *HEAD[SPLIT:]), [(cells[0], *cells[SPLIT:]) for cells in rows])}\n"
    )
    given.out.write_text(text, encoding="utf-8", newline="\n")
    print(text)


if __name__ == "__main__":
    main()
