"""A run of many turns for figures that need them: stroboscopic points, and spectra that resolve near lines.

In: a model and a run of it.  Out: a run that continues it, or None where it is long enough, a longer one takes too much
time, or its turns are unlike later ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from ballpass.runtime.quantity.characteristic import turns_to_separate
from ballpass.runtime.time.repetition import Repetition

if TYPE_CHECKING:
    from ballpass.runtime.model import Model
    from ballpass.runtime.request.locating import Kinks
    from ballpass.runtime.solution.solution import Solution

#: Turns that are dropped before those of the figures.
SETTLE = 20

#: Steps that the turns may take: some tenths of a second.  A count, not a time: figures are the same on every machine.
STEPS = 300_000


def run_for_figures(model: Model, solution: Solution) -> Solution | None:
    """Positions and velocities of all rings over as many further turns as figures need.

    Parameters
    ----------
    solution : a run of the model by the project's own stepper; others are not continued

    Raises
    ------
    SimulationError
        The further turns failed.
    """
    length, statistics = solution.period, solution.statistics
    if length is None or not statistics.steps or solution.steady_reductions is None or not len(solution):
        return None
    done = (solution.t[-1] - statistics.begin) / length
    numbers = {**solution.parameters, **solution.constants}
    repetition = Repetition.of(model.manifest, numbers)
    if not repetition.holds(repetition.driver.after(solution.transient_cycles)):
        return None
    turns = turns_to_separate(solution.manifest, numbers)
    if done - solution.transient_cycles >= turns or (turns + SETTLE) * statistics.steps > STEPS * done:
        return None
    rings = tuple(f"{b.prefix}{ring}." for b in solution.manifest.bearings for ring in ("inner", "outer"))
    wanted = [name for name in solution.outputs if name.startswith(rings) and name.endswith(("x", "y"))]
    return model.simulate(
        SETTLE + turns,
        parameters=solution.parameters,
        method=statistics.method,
        rtol=statistics.rtol,
        kinks=cast("Kinks | None", statistics.kinks),
        outputs=[name for name in wanted if name not in solution.states],
        initial=solution.end,
        transient=repetition.driver.turns(0.0, float(solution.t[-1])) + SETTLE,
    )
