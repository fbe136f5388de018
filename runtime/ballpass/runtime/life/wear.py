"""Ball loads at samples of a run, and the wear of both raceways that follows from them.

In: a run.  Out: `LoadSamples`; fields of wear over the places of a raceway and across its groove.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.native.reduction_rows import SECTORS
from ballpass.runtime.quantity.track import ChannelValues
from ballpass.runtime.ratings.life import combined_load
from ballpass.runtime.ratings.of_bearing import RacewayContact, contact_cosine
from ballpass.runtime.ratings.wear import depth_of_pass
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.request.segments import time_resolution
from ballpass.runtime.run.loop import Samples, start_run
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN, beside, past

Array = NDArray[np.float64]

#: Turns whose samples wear and the equivalent load of ISO 281 have; a longer run has as many, farther apart, but in a
#: turn so many at least: balls pass less than half a turn of either ring between two, else how far is not known.
SAMPLED_TURNS, LEAST_IN_TURN = 64, 8

#: Places across the groove where wear is computed, from its middle to the edge of the widest contact.
ACROSS = 41


#: A bearing with this contact angle or more in its scene is one of angular contact [rad].
ANGULAR_CONTACT = float(np.radians(10.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadSamples:
    """Loads of a bearing's balls at equally spaced times.

    Attributes
    ----------
    time : shape (samples,) [s]
    crank : angle of driver or shaft since t = 0, with that at the start, shape (samples,) [rad]
    force : of each ball, zero where it pulls, shape (samples, balls) [N]
    resultant : force on the inner ring, shape (samples,) [N]
    in_outer, in_inner : angle of ball 1 as the rings see it, shape (samples,) [rad]
    contact_angle : [rad]
    deep_groove : whether the bearing has no contact angle of its own, whatever its preload makes of it
    tilt : largest of a rigid shaft in its bearings [rad]; None where it has none
    """

    time: Array
    crank: Array
    force: Array
    resultant: Array
    in_outer: Array
    in_inner: Array
    contact_angle: float = 0.0
    deep_groove: bool = True
    tilt: float | None = None

    def equivalent_load(self, power: float) -> float:
        """P of ISO 281, mean of a power over the angle that the rings turn against each other, else over time [N]."""
        turned = np.abs(passed_angle(self.in_outer) - passed_angle(self.in_inner))
        weight = turned if np.any(turned) else np.ones_like(turned)
        axial = np.sin(self.contact_angle) * np.sum(self.force, axis=1)
        load = combined_load(self.resultant, axial, self.contact_angle, deep_groove=self.deep_groove)
        return float(np.average(load**power, weights=weight) ** (1.0 / power))


def load_samples(run: Run, turns: float | None = None) -> Mapping[str, LoadSamples]:
    """Samples of the steady part of a run, by the prefix of each bearing.

    Parameters
    ----------
    turns : of the steady part, where its speed changes; None: as the run has them

    Raises
    ------
    RequestError
        A wrong request.
    SimulationError
        The computation failed.
    """
    model, numbers, manifest = run.model, run.numbers, run.model.manifest
    steady = run.end - run.start
    turns = run.span.counted if turns is None else turns
    # odd: in any whole number of turns two samples differ in the driver's angle, also where a turn has few of them
    whole = turns or 1.0
    several = max(manifest.run.samples_per_cycle * min(whole, SAMPLED_TURNS), LEAST_IN_TURN * whole)
    count = 2 * max(round(several) // 2, 2) + 1  # of turns that rounding makes a little less as well
    time = run.start + steady * np.arange(count) / count
    near = time_resolution(run.begin, run.end, run.stretch)
    samples = Samples(times=time, x=np.empty((count, len(model.states))), near=near, end=run.end)
    start_run(run, [samples]).go_on()
    states = samples.x
    names = ("ball.force", "ring_force.x", "ring_force.y", "cage.in_outer", "cage.in_inner")
    channels = ChannelValues(model, [b.prefix + name for b in manifest.bearings for name in names])
    inputs = timeline.inputs_over(manifest, numbers.values, time, time)
    given = {"t": np.zeros(len(time)), "x": states, "u": inputs, "p": numbers.p, "c": numbers.c}
    signals = channels.outputs_at(len(time), given)
    angle = "" if manifest.mechanism is None else manifest.mechanism.angle
    crank = states[:, model.states.index(angle)] if angle else timeline.driver(manifest, numbers.values).at(time)[0]
    found = {}
    for bearing in manifest.bearings:
        force, x, y, outer, inner = (signals[bearing.prefix + name] for name in names)
        found[bearing.prefix] = LoadSamples(
            time=time,
            crank=past(crank),
            force=np.maximum(force, 0.0),
            resultant=np.hypot(x[:, 0], y[:, 0]),
            contact_angle=float(np.arccos(min(contact_cosine(bearing, numbers.values), 1.0))),
            deep_groove=numbers.values.get(f"{bearing.path}.contact_angle", 0.0) < ANGULAR_CONTACT,
            in_outer=outer[:, 0],
            in_inner=inner[:, 0],
            tilt=_tilt(bearing, numbers.values, dict(zip(model.states, states.T, strict=True))),
        )
    return found


def _tilt(bearing: BearingInfo, values: Mapping[str, float], states: Mapping[str, Array]) -> float | None:
    """Largest tilt of the shaft whose axis runs through the inner rings of two bearings [rad]."""
    if not bearing.axis:
        return None
    ends = [np.array([states[f"{name}.inner.{axis}"] for axis in "xy"]) for name in bearing.axis]
    first, second = (values[f"bearings.{name}.position"] for name in bearing.axis)
    return float(np.max(np.hypot(*(ends[1] - ends[0]))) / abs(second - first))


def wear_field(samples: LoadSamples, angle: Array, contact: RacewayContact) -> tuple[Array, Array]:
    """Wear that the passing balls leave on a raceway, over the wear coefficient.

    Parameters
    ----------
    angle : of ball 1 as the ring sees it: `LoadSamples.in_outer` or `in_inner`

    Returns
    -------
    across : places across the groove, from its middle on, shape (ACROSS,) [m]
    rate : depth a second over the coefficient, shape (SECTORS, ACROSS) [N/(m s)]
    """
    force = samples.force
    count, balls = force.shape
    moved = np.abs(passed_angle(angle))
    length = float(samples.time[-1] - samples.time[0]) * count / max(count - 1, 1)
    widest = float(contact.semi_axes(float(np.max(force)))[0]) if np.max(force) > 0.0 else 0.0
    across = np.linspace(0.0, widest, ACROSS)
    row, ball = np.nonzero(force > 0.0)
    load, passed = force[row, ball], moved[row]
    place = (angle[row] / TURN + ball / balls) % 1.0
    sector = np.minimum((SECTORS * place).astype(int), SECTORS - 1)
    half = contact.semi_axes(load)[0]
    rate = np.zeros((SECTORS, ACROSS))
    for k, x in enumerate(across):
        within = half > x
        worn = passed[within] * depth_of_pass(x, load[within], contact)
        rate[:, k] = np.bincount(sector[within], worn, SECTORS)
    return across, rate * SECTORS / (TURN * length)


def passed_angle(angle: Array) -> Array:
    """How far an angle moves behind each sample, by less than half a turn; behind the last as behind the one before."""
    moved = beside(np.diff(angle, append=angle[-1:]))  # angles come back after a turn
    if len(moved) > 1:
        moved[-1] = moved[-2]
    return np.asarray(moved)
