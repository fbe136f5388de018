"""What is computed: one steady working cycle of the press, for three dampings and an ensemble of parameter sets.

In: the shipped scenes.  Out: `Member`s: model, numbers, start state, reference trajectory.

Every member is run through its transient first.  The measured cycle starts from the state reached there, with the cage
turned on by as much, so that it is a working cycle like any other and starts at crank angle 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.model import Model
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.request.segments import segment_edges
from ballpass.runtime.time import timeline
from benchmarks.press import Press, press_numbers

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "benchmarks"

#: Output points of a cycle.
POINTS = 2000
#: Cycles before the measured one.
TRANSIENT = 3
#: Tolerance of the two references [1].
REFERENCE_TOLERANCE = 1e-13

#: Parameters that an ensemble changes, by up to `SPREAD` in both directions.
VARIED = (
    "mechanism.driver.speed",
    "mechanism.bodies.crank.mass",
    "mechanism.bodies.rod.mass",
    "mechanism.bodies.rod.inertia",
    "mechanism.bodies.slider.mass",
    "mechanism.forces.punch.force.y",
    "bearing.clearance",
    "bearing.contact.young_modulus",
    "bearing.damping.ratio",
    "bearing.outer_ring.mass",
    "bearing.outer_ring.stiffness",
    "bearing.outer_ring.damping",
)
SPREAD = 0.03
SEED = 20260101


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A damping of the press: key, words for tables, scene and what is changed in it."""

    key: str
    words: str
    scene: str
    changes: tuple[tuple[str, float], ...] = ()

    def model(self) -> Model:
        """The model, generated into the build folder."""
        return load(generate(ROOT / "scenes" / f"{self.scene}.toml", BUILD / "generated" / self.scene))


CASES = (
    Case(
        key="stiff",
        words="one-sided, 2.16e4 N·s/m (stiff)",
        scene="punching_press",
        changes=(("bearing.damping.ratio", 0.25e-5),),
    ),
    Case(key="onesided", words="one-sided, 683 N·s/m", scene="punching_press"),
    Case(key="tangent", words="tangent (light)", scene="punching_press_tangent"),
)


def parameter_sets(case: Case, model: Model, count: int) -> list[dict[str, float]]:
    """The ensemble; its first member has the case's own numbers."""
    random = np.random.default_rng(SEED)
    defaults = {**model.parameters, **dict(case.changes)}
    sets = [dict(case.changes)]
    for _ in range(count - 1):
        factors = 1.0 + SPREAD * random.uniform(-1.0, 1.0, len(VARIED))
        sets.append({**dict(case.changes), **{k: defaults[k] * f for k, f in zip(VARIED, factors, strict=True)}})
    return sets


class Cycle:
    """One turn of a machine with given numbers and start, as the stepper takes it.

    Attributes
    ----------
    model : that is run
    parameters : overrides of the model's defaults, SI
    numbers : all parameters and constants of the runtime
    start : state at the start, shape (states,)
    magnitude : of the states, shape (states,): tolerances are relative to it
    times : output points [s], shape (POINTS,)
    edges : ends of the segments with one input each [s]
    """

    def __init__(self, model: Model, parameters: dict[str, float], start: np.ndarray, magnitude: np.ndarray) -> None:
        self.model, self.parameters, self.start, self.magnitude = model, parameters, start, magnitude
        self.numbers: Numbers = model.numbers(parameters)
        self.period = model.period(parameters)
        # by rounding the quotient may lie after the end
        self.times = np.minimum(self.period * np.arange(1, POINTS + 1) / POINTS, self.period)
        self.edges = segment_edges(model, self.numbers, 0.0, self.period, self.period)

    @cached_property
    def segments(self) -> Segments:
        """The cycle as the project's stepper takes it."""
        manifest = self.model.manifest
        inputs = [
            timeline.inputs_at(manifest, self.numbers.values, float(a), 0.5 * float(a + b))
            for a, b in pairwise(self.edges)
        ]
        return Segments(times=self.edges, inputs=np.array(inputs), restarts=np.ones(len(inputs), dtype=bool))


class Member(Cycle):
    """One parameter set of a case, ready to be run by any contender.

    Attributes
    ----------
    press : the numbers for the formulas written by hand
    gates : whether the punch acts, in each segment
    reference : states at the output points, shape (POINTS, 8); the mean of two methods at a tight tolerance
    agreement : largest difference of the two over the range of the ring's motion [1]
    """

    def __init__(self, case: Case, model: Model, parameters: dict[str, float]) -> None:
        self.case = case
        transient = model.simulate(
            cycles=TRANSIENT, parameters=parameters, method="stepper-dop853", rtol=1e-11, samples_per_cycle=2
        )
        values = model.numbers(parameters).values
        turned = values["bearing.ball_angle"] + values["bearing.cage_speed"] * float(transient.t[-1])
        parameters = {**parameters, "bearing.ball_angle": math.fmod(turned, 2.0 * math.pi)}
        magnitude = np.array(transient.statistics.magnitudes)
        super().__init__(model, parameters, np.array(transient.x[-1]), magnitude)
        self.press: Press = press_numbers(model, self.parameters)
        self.gates = tuple(
            float(self.press.window_start <= self.press.speed * 0.5 * (a + b) < self.press.window_end)
            for a, b in pairwise(self.edges)
        )
        self.reference = np.zeros((0, 0))
        self.agreement = math.nan

    @cached_property
    def pieces(self) -> tuple[tuple[float, float, float, np.ndarray], ...]:
        """(start, end, gate, output times) of each segment; an output on an edge belongs to the segment it ends."""
        return tuple(
            (float(a), float(b), gate, np.ascontiguousarray(self.times[(self.times > a) & (self.times <= b)]))
            for (a, b), gate in zip(pairwise(self.edges), self.gates, strict=True)
        )

    def refer(self, independent: Callable[[Member, float], np.ndarray] | None) -> None:
        """Make the reference from Rodas5P with located kinks and a method of another library (else DOP853)."""
        own = self._located("stepper-rodas5p")
        other = self._located("stepper-dop853") if independent is None else independent(self, REFERENCE_TOLERANCE)
        self.reference = 0.5 * (own + other)
        extent = float(np.max(np.ptp(self.reference[:, :2], axis=0)))
        self.agreement = float(np.max(np.abs(own[:, :2] - other[:, :2]))) / extent

    def _located(self, method: str) -> np.ndarray:
        solution = self.model.simulate(
            times=self.times, parameters=self.parameters, initial=self.start, method=method, kinks="located",
            rtol=REFERENCE_TOLERANCE, outputs=[], transient=0,
        )  # fmt: skip
        return np.asarray(solution.x)

    def error(self, states: np.ndarray) -> float:
        """The largest of the relative errors of motion, peak ball force and rms; infinite where a run is not finite."""
        if states.shape != self.reference.shape or not np.all(np.isfinite(states)):
            return math.inf
        extent, peak, root = self._quantities
        motion = float(np.max(np.abs(states[:, :2] - self.reference[:, :2]))) / extent
        return max(motion, abs(self._peak(states) - peak) / peak, abs(_rms(states[:, :2]) - root) / root)

    @cached_property
    def _quantities(self) -> tuple[float, float, float]:
        motion = self.reference[:, :2]
        return float(np.max(np.ptp(motion, axis=0))), self._peak(self.reference), _rms(motion)

    def _peak(self, states: np.ndarray) -> float:
        """Largest force of any ball at the output points, damping included [N]; formulas of `press`."""
        n = self.press
        angle = n.ball_angle + n.cage_speed * self.times[:, None] + 2.0 * np.pi * np.arange(8) / 8
        co, si = np.cos(angle), np.sin(angle)
        x, y = states[:, 0] - states[:, 2], states[:, 1] - states[:, 3]
        vx, vy = states[:, 4] - states[:, 6] + n.cage_speed * y, states[:, 5] - states[:, 7] - n.cage_speed * x
        deflection = np.maximum(x[:, None] * co + y[:, None] * si - n.half_clearance, 0.0)
        closing = vx[:, None] * co + vy[:, None] * si
        if n.tangent:
            return float(np.max(n.contact * np.sqrt(deflection) * (deflection + 1.5 * n.rate * closing)))
        return float(np.max(n.contact * deflection**1.5 + n.rate * np.maximum(closing, 0.0)))


def _rms(motion: np.ndarray) -> float:
    """Root mean square distance of the ring from its mean place [m]."""
    return float(np.sqrt(np.mean(np.sum((motion - motion.mean(axis=0)) ** 2, axis=1))))
