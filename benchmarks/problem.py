"""What is computed: one steady working cycle of the press, for three dampings and an ensemble of parameter sets.

In: the shipped scenes.  Out: `Member`s: model, numbers, start state, reference trajectory.

Every member is run through its transient first.  The measured cycle starts from the state reached there, with the cage
turned on by as much, so that it is a working cycle like any other and starts at crank angle 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.model import Model
from ballpass.runtime.native.stepper import End, Family, Segments
from ballpass.runtime.run.segments import segment_edges
from benchmarks.press import Press, press_numbers

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "benchmarks"

#: Output points of a cycle.
POINTS = 2000

#: Cycles before the measured one.
TRANSIENT = 3

#: Tolerance of the two references [1].
REFERENCE_TOLERANCE = 1e-13

#: What an ensemble changes, by up to `SPREAD` either way.
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


class Member:
    """One parameter set of a case, ready to be run by any contender.

    Attributes
    ----------
    parameters : overrides of the model's defaults, SI
    numbers : all parameters and constants as the runtime has them
    press : the same for the formulas written by hand
    magnitude : of the states, shape (8,): tolerances are relative to it
    start : state at the start of the cycle, shape (8,)
    reference : states at the output points, shape (POINTS, 8)
    agreement : largest difference of the two references over the range of the ring's motion [1]
    """

    def __init__(self, case: Case, model: Model, parameters: dict[str, float]) -> None:
        self.case = case
        self.model = model
        transient = model.simulate(
            cycles=TRANSIENT, parameters=parameters, method="stepper-dop853", rtol=1e-11, samples_per_cycle=2
        )
        turned = model.numbers(parameters).values["bearing.cage_speed"] * float(transient.t[-1])
        start_angle = model.numbers(parameters).values["bearing.ball_angle"]
        self.parameters = {**parameters, "bearing.ball_angle": math.fmod(start_angle + turned, 2.0 * math.pi)}
        self.start = np.array(transient.x[-1])
        self.magnitude = np.array(transient.statistics.magnitudes)
        self.numbers: Numbers = model.numbers(self.parameters)
        self.press: Press = press_numbers(model, self.parameters)
        self.period = model.period(self.parameters)
        # the quotient may lie a last digit behind the end
        self.times = np.minimum(self.period * np.arange(1, POINTS + 1) / POINTS, self.period)
        self.edges = segment_edges(model, self.numbers, 0.0, self.period, self.period)
        self.gates = tuple(
            float(self.press.window_start <= self.press.speed * 0.5 * (a + b) < self.press.window_end)
            for a, b in zip(self.edges[:-1], self.edges[1:], strict=True)
        )
        self.reference = np.zeros((0, 0))
        self.agreement = math.nan

    @cached_property
    def segments(self) -> Segments:
        """The cycle as the project's stepper takes it."""
        inputs = np.array(
            [
                self.model_inputs(float(a), 0.5 * float(a + b))
                for a, b in zip(self.edges[:-1], self.edges[1:], strict=True)
            ]
        )
        return Segments(times=self.edges, inputs=inputs, restarts=np.ones(len(self.edges) - 1, dtype=bool))

    def model_inputs(self, t: float, inside: float) -> np.ndarray:
        """Inputs with reference time `t`, gates as they are at `inside`."""
        from ballpass.runtime.run import inputs as clock

        return clock.inputs_at(self.model.manifest.inputs, self.numbers.values, t, inside)

    @cached_property
    def pieces(self) -> tuple[tuple[float, float, float, np.ndarray], ...]:
        """(start, end, gate, output times) of each segment; an output on an edge belongs to the segment it ends."""
        found = []
        for a, b, gate in zip(self.edges[:-1], self.edges[1:], self.gates, strict=True):
            inside = self.times[(self.times > a) & (self.times <= b)]
            found.append((float(a), float(b), gate, np.ascontiguousarray(inside)))
        return tuple(found)

    @cached_property
    def reference_quantities(self) -> tuple[float, float, float]:
        """Range of the ring's motion [m], peak ball force [N], rms of the motion [m] of the reference."""
        motion = self.reference[:, :2]
        return float(np.max(np.ptp(motion, axis=0))), peak_ball_force(self, self.reference), rms(motion)


def rms(motion: np.ndarray) -> float:
    """Root mean square distance of the ring from its mean place [m]."""
    return float(np.sqrt(np.mean(np.sum((motion - motion.mean(axis=0)) ** 2, axis=1))))


def peak_ball_force(member: Member, states: np.ndarray) -> float:
    """Largest force of any ball at the output points, damping included [N]; formulas of `press`."""
    n = member.press
    angle = n.ball_angle + n.cage_speed * member.times[:, None] + 2.0 * np.pi * np.arange(8) / 8
    co, si = np.cos(angle), np.sin(angle)
    x, y = states[:, 0] - states[:, 2], states[:, 1] - states[:, 3]
    vx, vy = states[:, 4] - states[:, 6] + n.cage_speed * y, states[:, 5] - states[:, 7] - n.cage_speed * x
    deflection = np.maximum(x[:, None] * co + y[:, None] * si - n.half_clearance, 0.0)
    closing = vx[:, None] * co + vy[:, None] * si
    if n.tangent:
        force = n.contact * np.sqrt(deflection) * (deflection + 1.5 * n.rate * closing)
    else:
        force = n.contact * deflection**1.5 + n.rate * np.maximum(closing, 0.0)
    return float(np.max(force))


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Relative errors of the quantities of interest of one run [1]."""

    motion: float
    peak: float
    rms: float

    @property
    def worst(self) -> float:
        return max(self.motion, self.peak, self.rms)


def errors(member: Member, states: np.ndarray) -> Errors:
    """Errors of a run against the member's reference; infinite where the run is not finite."""
    if states.shape != member.reference.shape or not np.all(np.isfinite(states)):
        return Errors(motion=math.inf, peak=math.inf, rms=math.inf)
    extent, peak, root = member.reference_quantities
    return Errors(
        motion=float(np.max(np.abs(states[:, :2] - member.reference[:, :2]))) / extent,
        peak=abs(peak_ball_force(member, states) - peak) / peak,
        rms=abs(rms(states[:, :2]) - root) / root,
    )


def models() -> dict[str, Model]:
    """The models of the cases, by scene; generated into the build folder."""
    found = {}
    for scene in sorted({case.scene for case in CASES}):
        found[scene] = load(generate(ROOT / "scenes" / f"{scene}.toml", BUILD / "generated" / scene))
    return found


def parameter_sets(case: Case, model: Model, count: int) -> list[dict[str, float]]:
    """The ensemble; its first member has the case's own numbers."""
    random = np.random.default_rng(SEED)
    defaults = {**model.parameters, **dict(case.changes)}
    sets = [dict(case.changes)]
    for _ in range(count - 1):
        factors = 1.0 + SPREAD * random.uniform(-1.0, 1.0, len(VARIED))
        sets.append({**dict(case.changes), **{k: defaults[k] * f for k, f in zip(VARIED, factors, strict=True)}})
    return sets


#: A solver of one cycle: member and tolerance to states at the output points.
Solve = Callable[[Member, float], np.ndarray]


def located_run(member: Member, tolerance: float, family: Family) -> np.ndarray:
    """A cycle by the project's stepper with every kink of the laws located, shape (POINTS, 8).

    Raises
    ------
    RuntimeError
        It ended early.
    """
    states = np.empty((POINTS, len(member.start)))
    outcome = member.model.locating_stepper.run(
        family=family,
        tolerance=tolerance * member.magnitude,
        p=member.numbers.p,
        c=member.numbers.c,
        x=member.start.copy(),
        segments=member.segments,
        output_times=member.times,
        output_states=states,
    )
    if outcome.end is not End.DONE:
        raise RuntimeError(f"{member.case.key}: the reference ended early: {outcome.end.name}")
    return states


def set_references(members: Sequence[Member], independent: Solve | None) -> None:
    """Give each member its reference, the mean of two methods, and say how well they agree.

    One is the project's, by Rodas5P with kinks located.  The other is somebody else's, with a right-hand side written
    by hand; where none is there, it is the project's DOP853.
    """
    for member in members:
        own = located_run(member, REFERENCE_TOLERANCE, Family.RODAS5P)
        if independent is None:
            other = located_run(member, REFERENCE_TOLERANCE, Family.DOP853)
        else:
            other = independent(member, REFERENCE_TOLERANCE)
        member.reference = 0.5 * (own + other)
        extent = float(np.max(np.ptp(member.reference[:, :2], axis=0)))
        member.agreement = float(np.max(np.abs(own[:, :2] - other[:, :2]))) / extent
