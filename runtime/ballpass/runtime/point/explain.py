"""Effects of a model's numbers on its integration: breakpoints, smoothness, time scales, and a suitable method.

In: a model and numbers.  Out: `Explanation`.  Time scales are eigenvalues of the derivative of the right-hand side by
the states, at the equilibria that the ring would rest in under the lightest and the heaviest load of a turn, at rest
and moving each way (only the motion shows the damping of a law that damps the approach alone).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from ballpass.runtime.contract.errors import BallpassError
from ballpass.runtime.contract.manifest import CAGE_EXCESS_SLIP, DRIVER_ACCELERATION, Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.plausible_ranges import unusual
from ballpass.runtime.contract.smoothness import WORDS
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.equilibrium import held_coordinates, static_equilibrium
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.point.jacobian import rows_of
from ballpass.runtime.point.model_limits import limits_of_model
from ballpass.runtime.point.slopes import jacobian
from ballpass.runtime.ratings.of_bearing import fit_clearances
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Marked, Report, ReportTable, Words
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.request.assembly import check_assembly
from ballpass.runtime.request.choose_method import STIFF_RATIO, choose_method
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoints, rows_over_time
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.turning import past

#: Instants of a turn that are searched for the lightest and the heaviest load.
INSTANTS = 360

#: Fastest oscillations in a turn, above which damped vibrations decay within a small part of it.
MANY_OSCILLATIONS = 5000.0

#: Breakpoints that are named one by one; of more, the table of a load has most.
MOST_NAMED = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class Breakpoint:
    """A time of the first turn, or of as many as loads repeat after, at which a load switches or a table has a knot; of
    tables over time any of the run.

    Time [s], driver angle [rad], which counts over these turns and is NaN where the motion decides it, and cause.
    """

    time: float
    angle: float
    cause: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeScale:
    """Rates of small motions about one equilibrium.

    Attributes
    ----------
    name : "lightest load" or "heaviest load"; "at rest under the load" where the load is the same all the time
    time, angle : instant [s] and driver angle [rad]
    acceleration : of the unsupported ring at that instant: its load over its mass [m/s^2]
    decay : fastest decay, the largest -Re(eigenvalue) [1/s]
    frequency : fastest natural frequency without damping [rad/s]
    slowest : smallest magnitude of an eigenvalue [1/s]
    """

    name: str
    time: float
    angle: float
    acceleration: float
    decay: float
    frequency: float
    slowest: float

    @property
    def stiffness(self) -> float:
        """Fastest decay over fastest natural frequency in rad/s [1]; above about 3 steps are bounded by decay.

        For a single mode that oscillates this is its damping ratio; above 1 it is not.
        """
        return self.decay / self.frequency if self.frequency > 0.0 else math.inf if self.decay > 0.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Explanation(ShortRepr, Reported):
    """Properties of a run of a model.

    Attributes
    ----------
    states, outputs : their names
    turn : time of a turn [s]; infinite where nothing turns
    breakpoints : of the first of these turns (of the run where nothing turns)
    smoothness : pairs of law and the manifest's word, which `ballpass.runtime.contract.smoothness.WORDS` explains
    scales : rates at the lightest and heaviest load, once under a load that does not change; empty for a model without
        states
    unsupported : instants without equilibrium, whose rates are not known
    method, reason : the choice of ``auto``, and why
    unusual : sentences about numbers outside of their usual ranges
    turns : after which all loads repeat, two for a four-stroke engine
    first : time that the first of them take [s]
    levers : share of a force in the plane that positions count from, by bearings with one [1]
    fits : sentences about interferences and clearances by class of fit

    Examples
    --------
    >>> explanation = model.explain()
    >>> f"{explanation.turn:.2f} s, {explanation.method}"
    '0.12 s, stepper'
    >>> [f"{item.time:.3f} s" for item in explanation.breakpoints]
    ['0.079 s', '0.089 s']
    """

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    turn: float
    breakpoints: tuple[Breakpoint, ...]
    smoothness: tuple[tuple[str, str], ...]
    scales: tuple[TimeScale, ...]
    unsupported: tuple[str, ...]
    method: str
    reason: str
    unusual: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    turns: int = 1
    first: float = math.inf
    levers: Mapping[str, float] = field(default_factory=dict)
    fits: tuple[str, ...] = ()

    def _report(self) -> Report:
        repeats = self.first
        where = _places(self.breakpoints, repeats) or "none"
        first = "turn" if self.turns == 1 else f"{self.turns} turns"
        first += " and of tables over time" if any(item.time >= repeats for item in self.breakpoints) else ""
        laws = "; ".join(f"{law}: {WORDS[kind]}" for law, kind in self.smoothness) or "none"
        parts: list[Words | ReportTable] = [
            Marked(f"Breakpoints of the first {first}", "head", f": {where}"),
            Marked("Smoothness of the contact laws", "head", f": {laws}"),
        ]
        table = ReportTable.of(
            self.scales,
            {
                "at": lambda item: item.name if item.time < repeats else f"{item.name}, {item.time:.4g} s",
                ">crank or\nshaft angle": lambda item: f"{math.degrees(item.angle):.0f}°",
                ">fastest\ndecay": lambda item: f"{rounded(item.decay, 3)} 1/s",
                ">fastest\nfrequency": lambda item: f"{rounded(item.frequency / math.tau, 3)} Hz",
                ">slowest\nrate": lambda item: f"{rounded(item.slowest, 3)} 1/s",
                ">decay over\nfrequency": lambda item: f"{item.stiffness:.2g}" if math.isfinite(item.stiffness) else "",
            },
            title="Time scales of small motions",
            caption="Decay over frequency, with 2π: of a single mode, up to 1, its damping ratio; above 3 decay bounds "
            "explicit steps.",
        )
        parts += ["", table] if self.scales else []
        parts += [f"no equilibrium at {place}" for place in self.unsupported]
        parts += ["", Marked("Method", "head", f": auto takes {self.method}, {self.reason}")]
        if self.levers:
            carried = ", ".join(f"{name} {rounded(share, 3)}" for name, share in self.levers.items())
            parts.append(
                Marked("Levers", "head", f": of a force in the plane that positions count from carry {carried}")
            )
        parts += [Marked("Fits", "head", f": {words}") for words in self.fits]
        parts += [Marked("Unusual", "doubt", f": {words}") for words in self.unusual]
        parts += [Marked("Limits", "doubt", f": {words}") for words in self.limits]
        scales = [
            asdict(item) | {"angle_deg": math.degrees(item.angle), "stiffness": item.stiffness} for item in self.scales
        ]
        facts = {
            **self._named("states", "outputs"),
            "breakpoints": [
                {"time": item.time, "angle_deg": math.degrees(item.angle), "cause": item.cause}
                for item in self.breakpoints
            ],
            **self._named("turn", "turns"),
            "smoothness": [{"law": law, "is": kind, "words": WORDS[kind]} for law, kind in self.smoothness],
            "time_scales": scales,
            "units": {"frequency": "rad/s", "levers": "1"},
            "without_equilibrium": self.unsupported,
            "method": {"auto": self.method, "reason": self.reason},
            "levers": dict(self.levers),
            "warnings": self.unusual,
            "limits": self.limits,
            "fits": self.fits,
        }
        return Report(parts=parts, facts=facts, records=scales, index=("name",))


def explain(model: LoadedModel, parameters: Mapping[str, float] | None = None) -> Explanation:
    """Breakpoints, smoothness and time scales of a model.

    Raises
    ------
    RequestError
        Unknown parameters, or a linkage that cannot be assembled.
    """
    numbers = model.numbers(parameters)
    check_assembly(model, numbers, 0.0)
    values = numbers.values
    manifest = model.manifest
    repetition = Repetition.of(manifest, values)
    turn, turns = repetition.turn, repetition.turns
    first = repetition.driver.after(turns)
    span = first if math.isfinite(first) else (manifest.run.duration or 1.0)
    length = max(span, _changing(manifest, repetition))
    scales, unsupported = _time_scales(model, parameters, span, length) if model.states else ((), ())
    method, reason = _method(model, scales, turn)
    return Explanation(
        states=model.states,
        outputs=model.outputs,
        turn=turn,
        turns=turns,
        first=first,
        breakpoints=_breakpoints(model, values, span, length),
        smoothness=manifest.smoothness,
        scales=scales,
        unsupported=unsupported,
        method=method,
        reason=reason,
        unusual=tuple(unusual(manifest, values)),
        limits=tuple(limits_of_model(manifest, values)),
        levers={
            bearing.name: values[f"{bearing.path}.share"]
            for bearing in manifest.bearings
            if f"{bearing.path}.lever_per_moment" in values
        },
        fits=tuple(_fits(manifest, values)),
    )


def _fits(manifest: Manifest, values: Mapping[str, float]) -> Iterator[str]:
    """Interferences and clearance of each bearing with a fit by class."""
    for info in manifest.bearings:
        if info.fit is None:
            continue
        lengths = {
            f"interference on the shaft, {info.fit.shaft}": info.fit.inner,
            f"interference in the housing, {info.fit.housing}": info.fit.outer,
            "clearance in operation": fit_clearances(info, values),
        }
        for words, spread in lengths.items():
            if spread:
                least, low, mean, high, largest = (f"{1e6 * each:.1f}" for each in spread)
                yield f"{info.path}: {words}: {least} to {largest} µm, probably {low} to {high}, mean {mean}"


def _places(breakpoints: Sequence[Breakpoint], repeats: float) -> str:
    """Where the breakpoints are, those of tables over time behind the first turns by their time; of many, how many each
    load has."""
    places = [
        f"{item.time:.4g} s" if item.time >= repeats or math.isnan(item.angle) else f"{math.degrees(item.angle):.4g}°"
        for item in breakpoints
    ]
    if len(breakpoints) <= MOST_NAMED:
        return "; ".join(f"{at} {item.cause}" for at, item in zip(places, breakpoints, strict=True))
    times = Counter(cause for item in breakpoints for cause in item.cause.split(", "))
    loads = ", ".join(f"{cause} {count} times" for cause, count in times.items())
    return f"{len(breakpoints)} from {places[0]} to {places[-1]}: {loads} (each: --json)"


def _changing(manifest: Manifest, repetition: Repetition) -> float:
    """Time over which loads change but with the turn [s]: with tables over time the run, else a harmonic's period."""
    length = manifest.run.duration or repetition.driver.after(manifest.run.cycles or 0.0)
    length = length if math.isfinite(length) else 0.0
    return length if repetition.changing(0.0, length) else min(length, repetition.slowest_load)


def _breakpoints(model: LoadedModel, values: Mapping[str, float], span: float, length: float) -> tuple[Breakpoint, ...]:
    found = []
    manifest, inputs = model.manifest, model.manifest.inputs
    # a little over the turn's end, so that an edge at t = 0 counts once
    times = breakpoints(manifest, values, -1e-9 * span, span * (1.0 - 1e-9))
    timed = rows_over_time(manifest, values, span * (1.0 - 1e-9), length)
    for time in [*times, *timed]:
        before = timeline.inputs_at(manifest, values, time, time - 1e-7 * span)
        behind = timeline.inputs_at(manifest, values, time, time + 1e-7 * span)
        causes = dict.fromkeys(  # the components of a load share their knots
            f"{item.name.removeprefix('gate.')} {'on' if b > a else 'off'}" if item.kind == "gate" else _knot(item.name)
            for item, a, b in zip(inputs, before, behind, strict=True)
            if a != b and item.kind in ("gate", "table_rate", "slope")
        )
        if not causes:  # a row at which nothing changes
            continue
        angle = math.nan if timeline.is_free(manifest) else _angle(model, values, float(time))
        found.append(Breakpoint(time=float(time), angle=angle, cause=", ".join(causes)))
    return tuple(found)


def _angle(model: LoadedModel, values: Mapping[str, float], time: float) -> float:
    """Angle of driver or shaft within the turns after which loads repeat [rad]."""
    repetition = Repetition.of(model.manifest, values)
    return float(past(repetition.driver.at(time)[0], turns=repetition.turns))


def _knot(slope: str) -> str:
    """Words for a knot of the table whose slope is this input, as ``force.punch_slope`` or ``load.x_rate``."""
    if slope == DRIVER_ACCELERATION:
        return "row of the driver's table"
    if slope.endswith(CAGE_EXCESS_SLIP):
        return "row of the cage's slip"
    kind, _, name = slope.rpartition("_")[0].partition(".")
    return f"knot of {'the load' if kind == 'load' else name}"


def _time_scales(
    model: LoadedModel, parameters: Mapping[str, float] | None, span: float, length: float
) -> tuple[tuple[TimeScale, ...], tuple[str, ...]]:
    numbers = model.numbers(parameters)
    values = numbers.values
    half = len(model.states) // 2
    rest = np.array([values[name] for name in model.manifest.initial])
    rest[half:] *= held_coordinates(model)
    even = (np.arange(INSTANTS) + 0.5) / INSTANTS
    times = even * span
    if length > span:
        rows = rows_over_time(model.manifest, values, 0.0, length)
        times = np.concatenate([times, even * length, rows])
    # at the initial position, so that contact forces are those of t = 0 and only the load differs between instants
    point = {"t": 0.0, "x": rest, "p": numbers.p, "c": numbers.c}
    pull = np.empty(len(times))
    for k, time in enumerate(times):
        u = timeline.inputs_at(model.manifest, values, float(time))
        free = 1.0 - held_coordinates(model)
        pull[k] = np.linalg.norm(free * model.kernel("rhs")({**point, "u": u})[half:])
    scales, unsupported = [], []
    instants: tuple[tuple[str, int], ...] = (
        ("lightest load", int(np.argmin(pull))),
        ("heaviest load", int(np.argmax(pull))),
    )
    mechanism = model.manifest.mechanism
    if mechanism is not None and mechanism.angle:
        instants = (("at the start", 0),)
    elif _is_constant(model, numbers, times):
        instants = (("at rest under the load", 0),)
    for name, k in instants:
        time = float(times[k])
        angle = _angle(model, values, time)
        try:
            x = static_equilibrium(model, numbers, t=time, load=None).x if model.manifest.bearings else rest
        except BallpassError as fault:
            unsupported.append(f"{name}, {math.degrees(angle):.4g} deg: {fault}")
            continue
        decay = frequency = 0.0
        slowest = math.inf
        moved = (1.0 - held_coordinates(model)) * np.abs(x[:half])
        # nothing moves the lag of a cage
        moving = np.flatnonzero([info.kind != "lag" for info in model.manifest.coordinates] * 2)
        speed = math.sqrt(pull[k] * max(float(np.max(moved)), 1e-12))
        for kick in (np.zeros(half), *(sign * speed * unit for unit in np.eye(half) for sign in (1.0, -1.0))):
            matrix = jacobian(model, numbers, "rhs", "states", t=time, x=np.concatenate([x[:half], x[half:] + kick]))
            eigenvalues = np.linalg.eigvals(matrix[np.ix_(moving, moving)])
            decay = max(decay, float(np.max(-eigenvalues.real)))
            slowest = min(slowest, float(np.min(np.abs(eigenvalues))))
            frequency = max(frequency, math.sqrt(float(np.max(np.abs(np.linalg.eigvals(matrix[half:, :half]))))))
        scales.append(
            TimeScale(
                name=name,
                time=time,
                angle=angle,
                acceleration=float(pull[k]),
                decay=decay,
                frequency=frequency,
                slowest=slowest,
            )
        )
    return tuple(scales), tuple(unsupported)


def _is_constant(model: LoadedModel, numbers: Numbers, times: np.ndarray) -> bool:
    """Whether the load is the same at all these times, to rounding."""
    if not any(info.name == "load.x" for info in model.manifest.quantities):
        return False
    (rows,) = rows_of(model, ["load.x", "load.y"])
    kernel = model.kernel(rows.function)
    loads = np.array([kernel(point(model, numbers, float(time), None))[rows.indices] for time in times])
    return bool(np.max(np.ptp(loads, axis=0)) <= 1e-12 * np.max(np.abs(loads)))


def _method(model: LoadedModel, scales: tuple[TimeScale, ...], turn: float) -> tuple[str, str]:
    """The choice of ``auto`` for these rates and turns of `turn` [s], and why."""
    decay = max((s.decay for s in scales), default=0.0)
    frequency = max((s.frequency for s in scales), default=0.0)
    name, reason = choose_method(model, "auto")
    if frequency > 0.0:
        ratio = decay / frequency
        if ratio > STIFF_RATIO:
            reason += (
                f"; decay is {ratio:.2g} times the fastest oscillation, so that an explicit method's steps would be "
                "bounded by it: linearly implicit steps suit"
            )
        else:
            reason += (
                f"; decay is {ratio:.2g} times the fastest oscillation: explicit steps suit while the ring vibrates"
            )
            oscillations = frequency * turn / (2.0 * math.pi)
            if math.isfinite(turn) and oscillations > MANY_OSCILLATIONS:
                reason += (
                    f", but {oscillations:.2g} oscillations fit into a turn: where they have died out, the stepper's "
                    "are linearly implicit and as long as the tolerance allows; the explicit methods cannot do so"
                )
    jumping = [law for law, kind in model.manifest.smoothness if kind == "discontinuous"]
    if jumping:
        reason += f"; the {' and '.join(jumping)} law jumps, and steps across a jump are rejected and repeated"
    return name, reason
