"""Warnings that numbers of a run are not those of the steady machine.

In: a model, and the numbers and the length of a run.  Out: sentences.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from ballpass.runtime.app.summary_words import inside, row_place, row_words
from ballpass.runtime.certify.transient import remembered, still_changes
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.quantity.grammar import channels_of
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.run.reduced_run import reduced
from ballpass.runtime.solution.settle import MEANS, PEAKS, changed, look_beyond
from ballpass.runtime.time.breakpoints import rows_over_time
from ballpass.runtime.time.repetition import Repetition

if TYPE_CHECKING:
    from ballpass.runtime.model import Model
    from ballpass.runtime.solution.settle import Settled

#: Channels that a warning names.
SHOWN = 4


def warnings_of_transient(
    model: Model,
    parameters: Mapping[str, float],
    *,
    cycles: float | None = None,
    duration: float | None = None,
    transient: float | None = None,
) -> list[str]:
    """Sentences about a run of a command; none where it is steady, or nothing turns."""
    if not (model.has_stepper and model.states):
        return []
    request = Request(cycles=cycles, duration=duration, transient_cycles=transient)
    asked = (cycles, duration, transient) != (None, None, None)
    try:
        run = resolve(model, model.numbers(parameters), request).check_steady()
        left_out = [] if asked else tables_left_out(model, run.numbers.values)
        return [*left_out, *transient_words(model, run, look_beyond(run), asked=asked)]
    except SimulationError as fault:
        return [f"whether these are numbers of the steady machine is not known, for a longer run failed: {fault}"]


def tables_left_out(model: Model, values: Mapping[str, float]) -> list[str]:
    """A sentence where turns that a scene without a run takes lie behind rows of tables, or are no load's period."""
    settings, repetition = model.run_settings, Repetition.of(model.manifest, values)
    turning = repetition.driver
    if settings.stated or settings.cycles is None or turning.fastest == 0.0:
        return []
    begin, end = turning.after(settings.transient_cycles), turning.after(settings.cycles)
    rows = rows_over_time(model.manifest, values, 0.0, begin if repetition.changing(0.0, begin) else 0.0)
    slowest, length = repetition.slowest_load, end - begin
    if not len(rows) and slowest > length * (1.0 + 1e-9):
        return [
            f"turns {settings.transient_cycles:g} to {settings.cycles:g}, which a scene without a run takes, are "
            f"{length:.4g} s, and a period of its slowest harmonic load {slowest:.4g} s: extremes and means are those "
            f'of a part of it. Give the run that is meant, as --duration "{begin + slowest:.4g} s".'
        ]
    if not len(rows):
        return []
    return [
        f"turns {settings.transient_cycles:g} to {settings.cycles:g}, which a scene without a run takes, begin at "
        f"{begin:.4g} s, and load, speed or slip follow tables over time before, with rows up to {rows[-1]:.4g} s: "
        "what happens there is in no number here. Give the run that is meant, as "
        f'--duration "{rows[-1]:.4g} s" --transient 0.'
    ]


def transient_words(model: Model, run: Run, longer: Settled | None, *, asked: bool) -> list[str]:
    """Sentences about a run, what more turns change, and means over a part of the turns after which loads repeat.

    Parameters
    ----------
    asked : whether its length or transient was asked for

    Raises
    ------
    SimulationError
        A run from another start failed.
    """
    words = [*_part_of_cycle(run), *_part_of_beats(run, longer)]
    if longer is not None and longer.first:
        return [_start_words(run, longer), *words]
    if asked or longer is None or model.manifest.run.stated:
        return words
    found = still_changes(run)
    names = remembered(found)
    if not names:
        return words
    # what a reader wants first; channels that are all but nothing may change by more
    names.sort(key=lambda n: (not n.endswith("ball.force"), row_place(model.manifest, n) is None, -found.changes[n]))
    first = ", ".join(f"{name} by {rounded(100.0 * found.changes[name], 2)} %" for name in names[:SHOWN])
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return [
        f"turns {run.span.transient:g} to {run.span.transient + run.span.counted:g}, which a scene without a run "
        f"takes, have not forgotten their start: one moved by {found.moved:g} of the motion still changes "
        f"{first}{more}. Give a run with a longer "
        "transient (--cycles, --transient), or let it be found (ballpass run --turns settle).",
        *words,
    ]


def _part_of_cycle(run: Run) -> list[str]:
    """A warning about means of a run that ends within the turns after which all loads repeat."""
    cycle, turns = Repetition.of(run.model.manifest, run.numbers.values).turns, run.span.counted
    if cycle == 1 or math.isclose(turns, cycle * round(turns / cycle), rel_tol=1e-9):
        return []
    return [
        f"means and rms are over {turns:g} turns, and the loads repeat after {cycle}: some of these turns count more "
        f"often than others. Let {cycle}, or a multiple of that, be behind the transient (--cycles, --transient)."
    ]


def _part_of_beats(run: Run, longer: Settled | None) -> list[str]:
    """Warnings about beats that are slower than the run, where half a beat changes its numbers.

    Raises
    ------
    SimulationError
        The run that is half a beat further on failed.
    """
    model, values, words = run.model, run.numbers.values, []
    turns = max(run.span.counted, 0.0 if longer is None else longer.turns)
    turn = run.span.turning.turn
    repetition = Repetition.of(model.manifest, values)
    slow = [one for one in repetition.beats() if one.period > turns * turn]
    if not slow or not repetition.holds(run.start):
        return []
    here = reduced(run)
    for beat in slow:
        half = {name: values[name] + step for name, step in beat.half.items()}
        there = reduced(replace(run, numbers=model.numbers({**run.numbers.parameters, **half})))
        changes = changed(run, here, there)
        name = max(changes, key=lambda one: max(changes[one][0] / PEAKS, changes[one][1] / MEANS))
        peak, mean = changes[name]
        if peak <= PEAKS and mean <= MEANS:
            continue
        needed, what = math.ceil(beat.period / turn), bearing_words(beat.words, model.manifest.bearings)
        words.append(
            f"{what} beats once in {beat.period:.4g} s, {rounded(beat.period / turn)} turns, of which the "
            f"run has {turns:g}: half a beat later extremes of {name} change by {rounded(100.0 * peak, 2)} % of their "
            f"range and its rms by {rounded(100.0 * mean, 2)} %. Numbers are those of a part of the beat; all of it "
            f"takes --cycles {math.ceil(run.span.transient) + needed} --transient {run.span.transient:g}."
        )
    return words


def _start_words(run: Run, longer: Settled) -> str:
    """A warning about extremes of the first turns, which later ones do not come near."""
    # forces first: they are what is designed by
    names = sorted(longer.first, key=lambda name: "ball." not in name)
    kind, time, value, later = longer.first[names[0]]
    manifest, turning = run.model.manifest, run.span.turning
    _, unit = channels_of(manifest)[names[0]]
    factor, shown = table_unit(unit)
    turn = f", in turn {int(turning.turns(0.0, time)) + 1}" if turning.fastest else ""
    more = f", and {len(names) - 1} more" if len(names) > 1 else ""
    words = inside(row_words(manifest, names[0]))
    return (
        f"extremes of the start, not of the steady machine: {words} ({names[0]}) has its {kind} of "
        f"{factor * value:.4g} {shown} at {time:.4g} s{turn}, and later turns have {factor * later:.4g} {shown}{more}. "
        "Drop more turns (--transient), start at rest (--initial equilibrium), or let the run find its transient "
        "(--turns settle)."
    )
