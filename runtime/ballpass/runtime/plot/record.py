"""Data of a run for all figures, gathered once.

In: a model and its `Solution`.  Out: a frozen `Record`: the steady part, its turns, angles, and text for captions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.observables import turns
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import force_components, table_direction
from ballpass.runtime.contract.parameters import check_name
from ballpass.runtime.quantity.characteristic import KinematicFrequencies, frequencies_of, mean_speeds
from ballpass.runtime.ratings.of_bearing import contact_cosine, inner_ring_mass, radial_gap, rated_element
from ballpass.runtime.request.ball_angles import ball_angles_along
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.turning import TURN, past

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import BearingInfo, InputInfo, Manifest, MechanismInfo
    from ballpass.runtime.point.point_model import PointModel
    from ballpass.runtime.solution.solution import Solution

Array = NDArray[np.float64]

#: Name of the body that does not move.
FRAME = "frame"


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """The steady part of a run.

    Attributes
    ----------
    solution : steady cycles only
    bearing : the one that the figures are of; None where the scene has none
    cycle_length : one turn of driver or shaft [s]; None when nothing turns
    turns : whole turns of the steady part, oldest first; empty without them
    longer : of a run of more turns, for spectra and stroboscopic points; None where there is none
    """

    model: PointModel
    solution: Solution
    bearing: BearingInfo | None
    cycle_length: float | None
    turns: tuple[slice, ...]
    longer: Record | None = None

    @property
    def manifest(self) -> Manifest:
        """Of the model that ran."""
        return self.solution.manifest

    @property
    def mechanism(self) -> MechanismInfo:
        """Of a scene that has one."""
        assert self.manifest.mechanism is not None  # figures of a mechanism are drawn of such scenes only
        return self.manifest.mechanism

    @property
    def noun(self) -> str:
        """What a rolling element of the bearing is called."""
        return "ball" if self.bearing is None else rated_element(self.bearing).noun

    @property
    def t(self) -> Array:
        """Times [s]."""
        return self.solution.t

    def output(self, name: str) -> str:
        """Name of an output or state of this bearing: "inner.x" may be "left.inner.x"."""
        if self.bearing is None or not name.startswith(("inner.", "outer.", "ball.", "load.", "ring_force.")):
            return name
        own = f"{self.bearing.prefix}{name}"
        ring = name.startswith("inner.") and own not in self.solution
        return self.bearing.inner_state(name.removeprefix("inner.")) if ring else own

    def has(self, *names: str) -> bool:
        """Whether all these outputs were kept, of this bearing where bearings have them."""
        return all(self.output(name) in self.solution for name in names)

    def values(self, name: str) -> Array:
        """Samples of an output or state, of this bearing where bearings have it."""
        return self.solution[self.output(name)]

    def parameter(self, name: str) -> float:
        """Value of a parameter or, where none has this name, of a derived constant [SI]; "bearing." is this one."""
        if self.bearing is not None and name.startswith("bearing."):
            name = f"{self.bearing.path}{name.removeprefix('bearing')}"
        values = self.solution.parameters
        return float(values[name]) if name in values else float(self.solution.constants[name])

    @property
    def _values(self) -> dict[str, float]:
        return {**self.solution.parameters, **self.solution.constants}

    @property
    def cycle_turns(self) -> int:
        """Turns after which all loads repeat: two for a four-stroke engine."""
        return Repetition.of(self.manifest, self._values).turns

    @property
    def start_passed(self) -> float:
        """A time at which the driver stands at the angle of its start, while it turns evenly [s]."""
        turning = timeline.driver(self.manifest, self._values)
        return turning.first_pass(float(turning.at(0.0)[0]), begin=turning.even_from) or 0.0

    def last_turns(self, count: int) -> slice:
        """The last whole turns, at most `count`; the whole record where it holds none."""
        if not self.turns:
            return slice(0, self.t.size)
        chosen = self.turns[-count:]
        return slice(chosen[0].start, chosen[-1].stop)

    def crank_angle(self, t: Array | None = None) -> Array:
        """Angle of the driven body (shaft: from its place at t = 0) at `t` or the samples, not wrapped, (n,) [rad]."""
        time = self.t if t is None else t
        mechanism = self.manifest.mechanism
        if mechanism is not None and mechanism.angle:
            return np.asarray(np.interp(time, self.t, self.solution[mechanism.angle]))
        return np.asarray(timeline.driver(self.manifest, self._values).at(time)[0])

    def along(self, window: slice) -> tuple[Array, str]:
        """Axis of some samples and its label: the angle from its first turn on [deg]; the time without turns [ms]."""
        if not self.turns:
            return 1e3 * self.t[window], "time [ms]"
        angle = np.degrees(self.crank_angle()[window])
        label = f"{self.manifest.angle_words} [°]"
        return angle - 360.0 * np.floor(min(angle[0], angle[-1]) / 360.0 + 1e-9), label

    def load_windows(self) -> tuple[tuple[float, float], ...]:
        """Windows of the crank angle in which some load acts, start in [0, 2 pi), end after it [rad].

        A load that acts all the turn has none, and none whose table takes several turns; nor have loads of which some
        act at any angle.
        """
        edges = [(self.parameter(start), self.parameter(end)) for start, end in self.load_window_edges()]
        found = tuple((float(past(first)), float(past(first) + past(end, first))) for first, end in edges)
        ends_alone = (end for _, end in found if not any(past(end, a) < b - a - 1e-9 for a, b in found))
        return () if found and next(ends_alone, None) is None else found

    def load_window_edges(self) -> list[tuple[str, str]]:
        """Parameters at which these windows start and end; of a table over the angle, where it is not zero."""
        found: list[tuple[str, str]] = []
        bearings = tuple(f"{bearing.path}." for bearing in self.manifest.bearings)
        for item in self.manifest.inputs:
            turning = item.kind == "table" and item.turning != ""
            spall = any(edge.startswith(bearings) for window in item.windows for edge in window)
            if spall or (turning and item.turns > 1):
                continue
            found += _acting_rows(item, self.parameter) if turning else item.windows
        return found

    def frequencies(self) -> KinematicFrequencies | None:
        """Kinematic frequencies of the bearing [Hz]; None without a bearing, or where the speed changes."""
        bearing = self.bearing
        if bearing is None or self.cycle_length is None:
            return None
        return frequencies_of(bearing, mean_speeds(self.solution))

    def ball_angles(self, samples: NDArray[np.int_] | slice = slice(None)) -> Array:
        """Angles of the balls at all samples, or some, (n, balls) [rad]."""
        assert self.bearing is not None  # figures of balls are drawn of scenes with a bearing only
        numbers = self.model.numbers(self.solution.parameters)
        angles = ball_angles_along(self.model, numbers, self.t[samples], self.solution.x[samples])
        return angles[self.manifest.bearings.index(self.bearing)]

    def state(self, sample: int) -> Array:
        """State at a sample, (states,)."""
        return np.asarray(self.solution.x[sample])

    def ball_force(self) -> tuple[str, Array]:
        """Name and values of the ball force to show: total where asked for, else elastic, (n, balls) [N]."""
        bearing = self.bearing
        if self.has("ball.force"):
            damped = bearing is not None and bearing.damping.acts
            return "elastic and damping force" if damped else "elastic force", self.values("ball.force")
        return "elastic force", self.values("ball.elastic_force")

    def highest_ball_force(self) -> Array:
        """Ball force of the most loaded ball, (n,) [N]."""
        return np.asarray(np.max(self.ball_force()[1], axis=1))

    @property
    def has_ball_force(self) -> bool:
        """Whether a ball force was asked for."""
        return self.has("ball.force") or self.has("ball.elastic_force")

    @property
    def can_draw_bearing(self) -> bool:
        """Whether ring position and a ball force were asked for."""
        return self.bearing is not None and self.has("inner.x", "inner.y") and self.has_ball_force

    def centres(self, ring: str) -> Array:
        """Centre of a ring, "inner" or "outer", (n, 2) [m]; zero where it is fixed."""
        if ring == "outer" and not self.has("outer.x", "outer.y"):
            return np.zeros((self.t.size, 2))
        return np.column_stack((self.values(f"{ring}.x"), self.values(f"{ring}.y")))

    @property
    def radial_gap(self) -> float:
        """Approach of the rings at which a ball is in contact [m]: half the clearance, or what axial preload leaves."""
        assert self.bearing is not None  # of those only
        return radial_gap(self.bearing, self._values)

    @property
    def loaded_by_joint(self) -> bool:
        """Whether the bearing's load is its share of a joint's reaction alone: none is beside it or its plane."""
        names = self.solution.parameters
        given = any(name.startswith(("load.", "loads.")) or ".positions." in name for name in names)
        tilting = self.bearing is not None and self.bearing.axis
        return self.manifest.mechanism is not None and not (given or tilting)

    def ring_load(self) -> Array | None:
        """Load on the inner ring, (n, 2) [N]: the output, else the reaction's share; None where neither is known."""
        if self.has("load.x", "load.y"):
            return np.column_stack((self.values("load.x"), self.values("load.y")))
        bearing = self.bearing
        if bearing is None or not (bearing.axis or self.loaded_by_joint):
            return None
        # two-way the reaction is that of the housing, which moves an outer ring of its own as well
        if bearing.axis or (bearing.outer_ring and inner_ring_mass(bearing, self._values) is None):
            return self._force_on_balls() if self.has("ball.force") else None
        names = [f"reaction.{bearing.joint}.{axis}" for axis in "xy"]
        if not self.has(*names):
            return None
        first = next(item[2] for item in self.mechanism.joints if item[0] == bearing.joint)
        # Eq. (2): the force on the outer ring's body presses the ring; the reaction is that of the second body on the
        # first
        share = self._values.get(f"{bearing.path}.share", 1.0) / self._values.get(f"{bearing.path}.count", 1.0)
        return (-share if first == bearing.inner_body else share) * np.column_stack(list(map(self.values, names)))

    def _force_on_balls(self) -> Array:
        """Force of the inner ring on the balls, Eqs. (8) and (9), (n, 2) [N]."""
        bearing = self.bearing
        assert bearing is not None  # of those only
        angles, radial = self.ball_angles(), contact_cosine(bearing, self._values) * self.values("ball.force")
        return np.column_stack([np.sum(radial * part(angles), axis=1) for part in (np.cos, np.sin)])

    def applied_forces(self, t: float) -> tuple[tuple[str, tuple[str, str], Array], ...]:
        """Applied forces that act at a time: name, (body, point), components (2,) [N]."""
        parameters = self._values
        values = self.model.inputs_at(t, self.solution.parameters)
        inputs = {info.name: value for info, value in zip(self.manifest.inputs, values, strict=True)}
        acting = []
        for name, body, point, given in self.mechanism.forces:
            amount = inputs[given] if given in inputs else self._over_driver_angle(name, t) if given else 1.0
            if amount == 0.0:
                continue
            cartesian, (magnitude, direction) = force_components(name)
            if cartesian[0] in parameters:
                force = amount * np.array([parameters[component] for component in cartesian])
            elif magnitude in parameters:
                force = amount * parameters[magnitude] * _unit(parameters[direction])
            else:
                force = amount * _unit(parameters[table_direction(name)])
            acting.append((name, (body, point), force))
        return tuple(acting)

    def _over_driver_angle(self, name: str, t: float) -> float:
        """Gate or table of a force that no input holds, for the driver's angle is a state."""
        angle = float(self.crank_angle(np.array([t]))[0])
        windows = [item.windows[0] for item in self.manifest.inputs if item.name.startswith(f"border.{name}.")]
        if windows:
            edges = [(self.parameter(start), self.parameter(end)) for start, end in windows]
            return float(any(past(angle, start) < past(end, start) for start, end in edges))
        window = f"mechanism.forces.{name}.window"
        if f"{window}.rise" in self.solution.parameters:
            start, end, rise = (self.parameter(f"{window}.{key}") for key in ("start", "end", "rise"))
            ahead, width = past(angle, start), past(end, start)
            return float(np.interp(ahead, [0.0, rise, width - rise, width], [0.0, 1.0, 1.0, 0.0]))
        columns = [f"mechanism.forces.{name}.table.{column}" for column in ("angle", "force")]
        knots, values = ([v for n, v in self._values.items() if n.startswith(c)] for c in columns)
        return float(np.interp(angle, knots, values, period=TURN * dict(self.mechanism.turns).get(f"force.{name}", 1)))

    def spring_tension(self, label: str) -> Array | None:
        """Tension of a spring or stop between two points, (n,) [N]; None where it was not asked for."""
        if self.has(f"{label}.tension"):
            return self.values(f"{label}.tension")
        return -self.values(f"{label}.force") if self.has(f"{label}.force") else None

    def points(self, t: float, state: Array | None = None) -> dict[tuple[str, str], Array]:
        """Coordinates of the mechanism's points at a time, the state there or joints without play: -> (2,) [m]."""
        given = {
            "x": np.zeros(len(self.model.states)) if state is None else state,
            "t": 0.0,  # time since the reference time of the inputs' phases, which is t itself
            "u": self.model.inputs_at(t, self.solution.parameters),
            "p": np.array([self.solution.parameters[info.name] for info in self.manifest.parameters]),
            "c": np.array([self.solution.constants[info.name] for info in self.manifest.constants]),
        }
        signature = self.manifest.function("geometry").inputs
        flat = self.model.function("geometry")(*(given[name] for name, _ in signature))
        pairs = np.array(flat, dtype=float).reshape(-1, 2)
        return {(info.body, info.point): pairs[k] for k, info in enumerate(self.mechanism.points)}

    def when(self, sample: int) -> str:
        """Words for the moment of a sample: its time and, of a mechanism, the angle then."""
        words = f"At t = {self.t[sample] * 1e3:.4g} ms"
        if self.manifest.mechanism is None:
            return words
        return f"{words}, {self.manifest.angle_words} {np.degrees(past(self.crank_angle()[sample])):.1f}°"

    def title(self, words: str) -> str:
        """Title of a figure: these words and, on a line of its own, the bearing's name if it has one."""
        return f"{words}\nbearing {self.bearing.name}" if self.bearing is not None and self.bearing.name else words

    def settings(self) -> str:
        """Text of a caption on the run: transient cycles dropped, method, clearance, damping law."""
        statistics = self.solution.statistics
        dropped = self.solution.transient_cycles
        parts = [f"{dropped:g} transient cycle{'' if dropped == 1 else 's'} dropped"]
        if self.solution.states:  # a linkage alone needs no integration
            parts.append(f"method {statistics.method}")
        if self.bearing is not None:
            # a no-break space keeps number and unit on one line
            parts.append(f"diametral clearance {self.parameter('bearing.clearance') * 1e6:g}\u00a0µm")
            parts.append(f"damping law {self.bearing.damping.law}")
        return ", ".join(parts)


def _acting_rows(table: InputInfo, parameter: Callable[[str], float]) -> list[tuple[str, str]]:
    """Where a periodic table is not zero, from knot to knot: pairs of parameters; none where no interval is zero."""
    count = len(table.times)
    zero = [parameter(name) == 0.0 for name in table.values]
    rests = [zero[k] and zero[(k + 1) % count] for k in range(count)]  # from knot k to the next one
    starts = [k for k in range(count) if rests[k - 1] and not rests[k]]
    ends = (next(k % count for k in range(start, start + count) if rests[k % count]) for start in starts)
    return [(table.times[start], table.times[end]) for start, end in zip(starts, ends, strict=True)]


def _unit(angle: float) -> Array:
    """Unit vector at an angle [rad] from +x, (2,)."""
    return np.array([np.cos(angle), np.sin(angle)])


def bearing_named(manifest: Manifest, name: str) -> BearingInfo:
    """The bearing of this name; a `RequestError` names those that there are."""
    known = {info.name: info for info in manifest.bearings if info.name}
    if not known and manifest.bearings:
        raise RequestError(
            f"There is no bearing {name!r}. There are: none, for the only bearing has no name. Omit the name."
        )
    check_name("bearing", name, known)
    return known[name]


def gather(
    model: PointModel, solution: Solution, bearing: BearingInfo | None = None, longer: Solution | None = None
) -> Record:
    """The steady part of `solution`, with its turns, for figures of a bearing; the first one if none is given.

    Parameters
    ----------
    longer : a run of more turns, for the figures that need them
    """
    steady = solution.steady()
    length = steady.period
    return Record(
        model=model,
        solution=steady,
        bearing=bearing or solution.manifest.bearing,
        cycle_length=length,
        turns=() if length is None else turns(steady.t, length),
        longer=None if longer is None else gather(model, longer, bearing),
    )
