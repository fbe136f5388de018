"""The main results of a run, as one mapping ready for JSON.

In: a `Model` and its `Solution`.  Out: a dict; every number stands in an object with its ``unit``.

Only steady cycles count, transient ones are dropped.  Extremes are searched between the samples as well, and means
are taken over every step, where the project's own stepper ran.  ``rms`` is the plain root mean square; ``std`` that of
the deviation from the mean.
"""

from __future__ import annotations

import math
import platform
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.app.summary_words import inside, row_place, row_words
from ballpass.runtime.ask.observables import statistics
from ballpass.runtime.ask.peaks import Kind, Peak, has_quantities, refine_peaks, run_of
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.extras import is_installed
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.plausible_ranges import UnusualWarning, unusual
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.native.reduction_rows import DEFLECTION
from ballpass.runtime.point.conditioning import conditioning, has_reactions
from ballpass.runtime.point.model_limits import limits_of_model
from ballpass.runtime.quantity.characteristic import frequencies_of, mean_speeds
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.ratings.of_bearing import contact_cosine, inner_ring_mass, radial_gap
from ballpass.runtime.ratings.result_limits import limit_words, passed_limit
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.run.failure_location import ring_distances
from ballpass.runtime.solution.settle import MEANS, PEAKS
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.turning import TURN

if TYPE_CHECKING:
    from ballpass.runtime.ask.observables import SignalStatistics
    from ballpass.runtime.model import Model
    from ballpass.runtime.run.reductions import Reduction
    from ballpass.runtime.solution.settle import Settled
    from ballpass.runtime.solution.solution import Solution

#: Packages whose version may change a number.
_TOOLS = ("casadi", "numpy", "scipy")

#: The ball forces of a bearing whose peaks are reported, by their key.
_BALL_FORCES = {"elastic": "ball.elastic_force", "total": "ball.force"}

#: Numbers that `add_turns` names; the file has all.
SHOWN = 5


def summarize(model: Model, sol: Solution) -> dict[str, Any]:
    """Key numbers of a run.

    Returns
    -------
    mapping with words (``scene``, ``status``, ``method``, ``versions`` ...) and objects with numbers and their
    ``unit``, as far as the scene has them and their outputs were asked for: of the run (``steps``, ``wall_time`` ...);
    extremes of reactions, loads and ``drive_torque``; ``drive_work`` a turn; ``reaction_condition``, the largest
    condition number of the matrix of Eq. (1) in a turn; ``peak_ball_force`` with time and ball; extremes and means of
    the rings' motions; derived constants; kinematic ``frequencies``.  The page of outputs lists them all.

    Raises
    ------
    RequestError
        The run lies within its transient cycles.
    SimulationError
        An output holds values that are not finite.
    """
    steady = sol.steady()
    manifest, statistic = model.manifest, sol.statistics
    summary: dict[str, Any] = {
        "scene": manifest.scene,
        "title": manifest.title,
        "status": sol.status.name.lower(),
        "method": statistic.method,
        "compiled": statistic.compiled,
        "rtol": _numbers("rtol", "1", value=statistic.rtol),
        "steps": {"value": statistic.steps, "unit": "1"},
        **({"located_kinks": {"value": statistic.located, "unit": "1"}} if statistic.located is not None else {}),
        "wall_time": _numbers("wall_time", "s", value=statistic.wall_time),
        "transient_cycles_dropped": _numbers("transient cycles", "1", value=sol.transient_cycles),
        "samples": {"value": len(steady.t), "unit": "1"},
    }
    if steady.period is not None:
        turns_run = (steady.t[-1] - steady.t[0]) / steady.period
        summary["cycle_length"] = _numbers("cycle_length", "s", value=steady.period)
        summary["steady_cycles"] = _numbers("steady_cycles", "1", value=turns_run)
    peaks = _peaks(model, steady)
    summary |= _forces(model, steady, peaks)
    summary |= _conditioning(model, steady)
    summary |= _balls(manifest, peaks)
    summary |= _paths(steady)
    summary |= _motions(steady)
    summary |= _constants(steady)
    summary["versions"] = _versions(steady)
    found = _unusual(steady)
    for text in found:
        warnings.warn(text, UnusualWarning, stacklevel=2)
    values = model.numbers(sol.parameters).values
    summary["limits"] = list(limits_of_model(manifest, values, _moved(steady, summary, values)))
    summary["warnings"] = [*unusual(manifest, values), *found]
    return summary


def _moved(sol: Solution, summary: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Highest acceleration between samples of inner rings loaded one-way [m/s^2], and highest ball force [N]."""
    found = {}
    for bearing in sol.manifest.bearings:
        peak = summary.get(f"{bearing.prefix}peak_ball_force", {})
        if bearing.joint and inner_ring_mass(bearing, values) is not None and "total" in peak:
            speeds = [np.diff(sol[f"{bearing.prefix}inner.v{axis}"]) for axis in "xy"]
            found[bearing.path] = float(np.max(np.hypot(*speeds) / np.diff(sol.t))), peak["total"]
    return found


def _unusual(sol: Solution) -> list[str]:
    """Results outside what real bearings show; those that no bearing can have, a run refuses."""
    said = []
    known = {**sol.parameters, **sol.constants}
    reduced: Mapping[str, Reduction] = sol.reductions or {}
    for bearing, apart in zip(sol.manifest.bearings, ring_distances(sol.manifest, known, sol.x.T), strict=True):
        ball, name = sol.parameters[f"{bearing.path}.ball_diameter"], bearing.prefix + DEFLECTION
        displaced = float(np.max(apart))
        deflection = contact_cosine(bearing, known) * (displaced - radial_gap(bearing, known))
        if name in reduced:  # of a ball, which need not be where the rings are nearest
            deflection = reduced[name].maximum
        if passed_limit(ball, deflection, displaced):
            said.append(limit_words(bearing, "deflected", ball=ball, deflection=deflection, displaced=displaced))
    return said


@dataclass(frozen=True, slots=True, kw_only=True)
class Turned:
    """What is said of more turns than those of a run.

    Attributes
    ----------
    turns : how many
    rows : entries of the summary and their numbers, and whether four digits are as before
    settled : whether no more turns change a number
    """

    turns: int
    rows: tuple[tuple[str, str, bool], ...]
    settled: bool

    def words(self, summary: Mapping[str, Any], manifest: Manifest) -> str:
        """A sentence: which results change, over how many turns."""
        said = []
        for entry, kind, same in self.rows[:SHOWN]:
            factor, shown = table_unit(summary[entry]["unit"])
            now, before = (rounded(factor * of[entry][kind]) for of in (summary["longer"], summary))
            row = f"{entry}.{kind}" if kind in _BALL_FORCES else entry
            words = inside(row_words(manifest, row)) + ("" if kind in _BALL_FORCES else f", {kind}")
            said.append(f"{words} {now} {shown} {'as before' if same else f'instead of {before}'}")
        if self.settled:
            said.append(
                f"peaks change by at most {100.0 * PEAKS:g} % of their range, rms by at most {100.0 * MEANS:g} %."
            )
            return f"Over {self.turns} steady turns: {'; '.join(said)}"
        more = f"; and {len(self.rows) - SHOWN} more (summary.json)" if len(self.rows) > SHOWN else ""
        return f"Over {self.turns} steady turns: {'; '.join(said)}{more}. --turns settle runs until they settle."


def add_turns(
    summary: dict[str, Any], longer: Settled, manifest: Manifest, like: Turned | None = None, *, instead: bool
) -> tuple[str, Turned]:
    """Add the results of more turns to a summary (``longer``).

    Parameters
    ----------
    longer : extremes and rms over more turns than the run's
    like : what is said of an answer that this is compared with
    instead : replace those of the run by them

    Returns
    -------
    A sentence, and what it says.
    """
    added: dict[str, Any] = {"turns": _numbers("turns", "1", value=longer.turns), "settled": longer.settled}
    changed: list[tuple[bool, float, tuple[str, str, bool]]] = []
    for name, found in longer.reductions.items():
        entry, numbers = _printed(name, found)
        if entry not in summary:
            continue
        numbers = {kind: value for kind, value in numbers.items() if kind in summary[entry]}
        if not numbers:
            continue
        unit, (peak, mean) = summary[entry]["unit"], longer.changes.get(name, (0.0, 0.0))
        added[entry] = added.get(entry, {}) | _numbers(entry, unit, **numbers)
        factor, _ = table_unit(unit)
        for kind, value in numbers.items():
            before = summary[entry][kind]
            # the highest force comes first, changed or not
            change = math.inf if kind == "total" else abs(value - before) / max(abs(before), abs(value), 1e-300)
            counts = (kind in ("min", "max") and peak > PEAKS) or (kind == "rms" and mean > MEANS)
            if change == math.inf or (counts and change > PEAKS):
                row = f"{entry}.{kind}" if kind in _BALL_FORCES else entry
                same = rounded(factor * value) == rounded(factor * before)
                # rows of the table before those that it leaves out
                changed.append((row_place(manifest, row) is None, -change, (entry, kind, same)))
        if instead:
            summary[entry] |= added[entry]
            for key in numbers.keys() & _BALL_FORCES.keys():
                summary[entry]["time"][key], summary[entry]["ball"][key] = found.maximum_time, found.maximum_ball
                summary[entry]["sampled"].pop(key)
    if longer.dropped:
        added["transient_turns"] = _numbers("transient turns", "1", value=longer.dropped)
    if longer.first:
        added["of_start"] = {
            name: {"kind": kind, "time": time, "value": value, "later": later}
            for name, (kind, time, value, later) in longer.first.items()
        }
    summary["longer"] = added
    if instead:
        summary["steady_cycles"] = added["turns"]
        words = longer.words_of(lambda name: inside(row_words(manifest, name)))
        said = f"{words}. Samples and figures are those of the first turns."
        return said, Turned(turns=longer.turns, rows=(), settled=longer.settled)
    if like is None:
        changed.sort(key=lambda line: line[:2])
        rows = [row for _, change, row in changed if change == -math.inf or not longer.settled]
        like = Turned(turns=longer.turns, rows=tuple(rows), settled=longer.settled)
    return like.words(summary, manifest), like


def _printed(channel: str, found: Reduction) -> tuple[str, dict[str, float]]:
    """Key of a channel in the summary, and the numbers that stand there."""
    prefix, of_ball, _ = channel.rpartition("ball.")
    if of_ball:
        keys = {path: key for key, path in _BALL_FORCES.items()}
        name = channel.removeprefix(prefix)
        return f"{prefix}peak_ball_force", {keys[name]: found.maximum} if name in keys else {}
    return channel, _moments(found)


def _moments(of: Reduction | SignalStatistics) -> dict[str, float]:
    return {"min": of.minimum, "max": of.maximum, "mean": of.mean, "rms": of.rms, "std": of.std}


def _peaks(model: Model, sol: Solution) -> dict[tuple[str, Kind], Peak]:
    """Peaks of forces and torques, also between samples, which miss a load's step and a contact's spike."""
    prefixes = [bearing.prefix for bearing in sol.manifest.bearings]
    of_balls = [prefix + name for prefix in prefixes for name in _BALL_FORCES.values()]
    wanted: list[tuple[str, Kind]] = [(name, "max") for name in of_balls if name in sol.outputs]
    forces = ("reaction.", "stop.", "spring.", "drive_torque", *(f"{prefix}load." for prefix in prefixes))
    for info in sol.manifest.outputs:
        if info.name in sol.outputs and info.name.startswith(forces) and info.unit in ("N", "N*m"):
            wanted += [(info.name, "min"), (info.name, "max")]
    if not wanted:
        return {}
    return dict(zip(wanted, refine_peaks(model, model.numbers(sol.parameters), sol, wanted), strict=True))


def _forces(model: Model, sol: Solution, peaks: Mapping[tuple[str, Kind], Peak]) -> dict[str, Any]:
    """Extremes of reactions, stops, springs, load and drive torque; the work of the drive."""
    found: dict[str, Any] = {}
    for info in sol.manifest.outputs:
        if (info.name, "min") in peaks:
            low, high = peaks[info.name, "min"], peaks[info.name, "max"]
            found[info.name] = _numbers(info.name, info.unit, min=low.value, max=high.value)
            found[info.name]["searched"] = {"min": low.searched, "max": high.searched}
    work = _drive_work(model, sol) if "drive_torque" in found else None
    if work is not None:
        found["drive_work"] = _numbers("drive_torque", "J", value=work)
    return found


def _drive_work(model: Model, sol: Solution) -> float | None:
    """Work of the drive in a turn [J]: the quantity, where the output follows from time or from steps.

    None where a torque drives, or the driver makes no whole turn.
    """
    mechanism, numbers = sol.manifest.mechanism, model.numbers(sol.parameters)
    if mechanism is None or mechanism.angle or mechanism.swing:
        return None
    run = run_of(model, numbers, sol)
    window = run.span.whole_cycles(Repetition.of(sol.manifest, numbers.values).turns)
    if window is None:
        return None
    if has_quantities(sol, "drive_torque", model):
        return float(QuantityRun(model, quantities_of(model, ["drive_work"])).measure(run).values[0])
    if sol.period is None:
        return None
    begin, end = np.searchsorted(sol.t, np.array(window) + 1e-9 * sol.period * np.array([-1.0, 1.0]))
    torque = statistics(sol.t[begin:end], sol["drive_torque"][begin:end])
    return math.copysign(TURN, sol.parameters[mechanism.speed]) * torque.mean


def _conditioning(model: Model, sol: Solution) -> dict[str, Any]:
    """Condition numbers of Eq. (1) over a turn; warns where they pass a bound."""
    if not has_reactions(model):
        return {}
    found = conditioning(model, model.numbers(sol.parameters), float(sol.t[-1]))
    angles = {"unscaled": found.unscaled_angle, "scaled": found.scaled_angle, "unit": "rad"}
    conditions = {"unscaled": found.unscaled, "scaled": found.scaled, "unit": "1", "crank_angle": angles}
    return {"reaction_condition": conditions}


def _balls(manifest: Manifest, found_peaks: Mapping[tuple[str, Kind], Peak]) -> dict[str, Any]:
    """The highest force of any ball of each bearing, and how it was found."""
    forces = {}
    for bearing in manifest.bearings:
        names: dict[str, tuple[str, Kind]] = {key: (bearing.prefix + name, "max") for key, name in _BALL_FORCES.items()}
        peaks = {key: found_peaks[name] for key, name in names.items() if name in found_peaks}
        if not peaks:
            continue
        found: dict[str, Any] = _numbers("ball.force", "N", **{key: peak.value for key, peak in peaks.items()})
        for part, unit in (("time", "s"), ("ball", "1"), ("sampled", "N")):
            found[part] = {**{key: getattr(peak, part) for key, peak in peaks.items()}, "unit": unit}
        found["searched"] = {key: peak.searched for key, peak in peaks.items()}
        forces[f"{bearing.prefix}peak_ball_force"] = found
    return forces


def _motions(sol: Solution) -> dict[str, Any]:
    """Extremes and means of the states: of every step where the stepper ran, else of the samples."""
    found: dict[str, Any] = {}
    for info in sol.manifest.states:
        reduced = None if sol.reductions is None else sol.reductions.get(info.name)
        values = reduced or statistics(sol.t, sol[info.name])
        found[info.name] = _numbers(info.name, info.unit, **_moments(values))
        where = "samples" if reduced is None else "every step"
        found[info.name]["searched"] = {"min": where, "max": where}
    return found


def _paths(sol: Solution) -> dict[str, Any]:
    """Extremes of the coordinates of points that the scene names: of the samples."""
    found: dict[str, Any] = {}
    for info in sol.manifest.outputs:
        if info.name.startswith("point.") and info.name.endswith((".x", ".y")) and info.name in sol:
            values = statistics(sol.t, sol[info.name])
            found[info.name] = _numbers(info.name, info.unit, min=values.minimum, max=values.maximum)
            found[info.name]["searched"] = {"min": "samples", "max": "samples"}
    return found


def _constants(sol: Solution) -> dict[str, Any]:
    """Derived constants of each bearing by the last part of their name, and the kinematic frequencies."""
    units = {info.name: info.unit for info in sol.manifest.constants}
    found: dict[str, Any] = {}
    for bearing in sol.manifest.bearings:
        for key in ("k_i", "k_o", "k_b", "c_b", "m_ei", "cage_ratio", "cos_contact_angle", "radial_gap"):
            name = f"{bearing.path}.{key}"
            if name in units:
                found[bearing.prefix + key] = _numbers(name, units[name], value=sol.constants[name])
        speed = {**sol.constants, **sol.parameters}[bearing.ring_speed]
        if sol.period is not None and speed != 0.0:  # rings that only swing against each other pass no ball
            values = mean_speeds(sol)
            frequencies = frequencies_of(bearing, values)
            found[f"{bearing.prefix}frequencies"] = asdict(frequencies) | {"unit": "Hz"}
        found[f"{bearing.prefix}damping_law"] = bearing.damping.law
    return found


def _versions(sol: Solution) -> dict[str, Any]:
    """Versions of the tools that generated the model, and of those that ran it."""
    running = {"python": platform.python_version(), "ballpass": __version__}
    running |= {name: version(name) for name in _TOOLS if is_installed(name)}
    return {"generated_with": dict(sol.manifest.versions), "run_with": running}


def _numbers(name: str, unit: str, **values: float | np.floating[Any]) -> dict[str, Any]:
    """Numbers with their unit; the error names `name` where one is not finite."""
    for value in values.values():
        if not isfinite(value):
            raise SimulationError(
                f"{name} holds {value}; allowed: finite values; the run diverged or a parameter is out of range: "
                "check the scene"
            )
    return {**{key: float(value) for key, value in values.items()}, "unit": unit}
