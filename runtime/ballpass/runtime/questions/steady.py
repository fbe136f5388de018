"""A step towards the periodic orbit of a machine: one Newton iteration of shooting, and the orbit's multipliers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.options import Option, TightRtol
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import Progress
from ballpass.runtime.show.short import ShortRepr

#: Difference of the accelerations at one state, at both ends of the period, that a period of few digits has [1].
SAME = 1e-3

Turns = Annotated[
    float,
    Option(words="Period of the orbit, in turns; loads and balls must be where they were then.", shown="N", above=0.0),
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SteadyStep(ShortRepr, Reported):
    """One Newton iteration towards an orbit that repeats after some turns.

    Attributes
    ----------
    states, units : names and SI units
    turns : period
    start : state at t = 0 after the step, shape (states,)
    before, after : what a period changes in the state, from the scene's start and from that after the step, same shape
    multipliers : eigenvalues of the derivative of the state after a period by that at the start, largest first
    resolution : size below which a multiplier is not known from zero
    difference : of the accelerations at the ends of the period, at one state, relative to them [1]

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
    >>> found = model.steady(parameters=pitch)
    >>> len(found.multipliers), bool(abs(found.multipliers[0]) < 1.0)
    (8, True)
    """

    states: tuple[str, ...]
    units: tuple[str, ...]
    turns: float
    start: np.ndarray
    before: np.ndarray
    after: np.ndarray
    multipliers: np.ndarray
    resolution: float
    difference: float

    def _report(self) -> Report:
        residuals = [
            {"state": name, "unit": unit, "start": start, "before": before, "after": after}
            for name, unit, start, before, after in zip(
                self.states, self.units, self.start.tolist(), self.before.tolist(), self.after.tolist(), strict=True
            )
        ]
        changes = ReportTable(
            title=f"What {self.turns:g} turns change, before and after one Newton step",
            heads=("state", "start after", "before", "after", "unit"),
            rows=[
                (row["state"], f"{row['start']:z.6g}", f"{row['before']:z.3g}", f"{row['after']:z.3g}", row["unit"])
                for row in residuals
            ],
            right=("start after", "before", "after"),
        )
        sizes = np.abs(self.multipliers)
        known = [f"{size:.4g}" for size in sizes if size > self.resolution]
        known += [f"{len(sizes) - len(known)} below {self.resolution:.0e}"] if len(known) < len(sizes) else []
        notes = [
            f"multipliers, magnitudes: {', '.join(known)}",
            "One step only. Where the change after it is not small against the one before, this is no orbit yet, and "
            "the multipliers are those of the motion from the scene's start.",
        ]
        warnings = []
        if self.difference > SAME:
            warnings.append(
                f"{self.turns:g} turns are no period of this machine: at one state the accelerations at both ends "
                f"differ by {100.0 * self.difference:.2g} %. Loads or balls are elsewhere. Take other turns."
            )
        facts = {
            "turns": self.turns,
            "states": residuals,
            "multipliers": [
                {"real": m.real, "imaginary": m.imag, "magnitude": abs(m)} for m in self.multipliers.tolist()
            ],
            "resolution": self.resolution,
            "difference": self.difference,
            "iterations": 1,
        }
        return Report(parts=(changes, *notes), facts=facts, records=residuals, index=("state",), warnings=warnings)


@Question(stage="simulate")
def steady(
    model: AnyModel,
    turns: Turns = 1.0,
    *,
    parameters: Mapping[str, float] | None = None,
    rtol: TightRtol = None,
    progress: Progress = None,
) -> SteadyStep:
    """One Newton iteration of shooting towards the orbit that repeats after some turns, and its multipliers.

    Starts from the scene's initial state. Further iterations are left to the caller: give `start` as the initial state.

    Parameters
    ----------
    parameters : overrides, SI
    progress : as for `simulate`

    Raises
    ------
    RequestError
        A scene without states, or one whose driver's motion is a state.
    SimulationError
        A multiplier is 1, so that no step is defined, or the computation failed.

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
    >>> found = model.steady(parameters=pitch)
    >>> found.states[0], found.start.shape
    ('inner.x', (8,))
    """
    from ballpass.runtime.contract.defaults import SENSITIVITY
    from ballpass.runtime.point.evaluate import point

    manifest = model.manifest
    names, mechanism = manifest.initial, manifest.mechanism
    if not names or (mechanism is not None and mechanism.angle):
        why = "the driver's motion is a state" if names else "nothing is integrated"
        raise RequestError(f"steady: {why} in this scene. Allowed: bearings, and a driver or shaft at constant speed.")
    numbers = model.numbers(parameters)
    begin = np.array([numbers.values[name] for name in names])
    found = model.sensitivities(names, turns, parameters=parameters, rtol=rtol, samples_per_cycle=2, progress=progress)
    monodromy, before = found.x[-1], found.solution.x[-1] - begin
    try:
        start = begin - np.linalg.solve(monodromy - np.eye(len(begin)), before)
    except np.linalg.LinAlgError:
        raise SimulationError(
            "steady: a multiplier is 1, the orbit is one of many, and no step is defined. Add damping or a load."
        ) from None
    run = model.simulate(
        turns,
        parameters={**(parameters or {}), **dict(zip(names, start.tolist(), strict=True))},
        rtol=found.solution.statistics.rtol,
        samples_per_cycle=2,
        outputs=[],
        transient=0.0,
    )
    rates = [np.array(model.kernel("rhs")(point(model, numbers, t, run.x[-1]))) for t in (run.t[0], run.t[-1])]
    multipliers = np.linalg.eigvals(monodromy)
    return SteadyStep(
        states=tuple(info.name for info in manifest.states),
        units=tuple(info.unit for info in manifest.states),
        turns=turns,
        start=start,
        before=before,
        after=run.x[-1] - start,
        multipliers=multipliers[np.argsort(-np.abs(multipliers), kind="stable")],
        resolution=SENSITIVITY * found.solution.statistics.rtol,
        difference=float(np.max(np.abs(rates[1] - rates[0])) / max(float(np.max(np.abs(rates))), 1e-300)),
    )
