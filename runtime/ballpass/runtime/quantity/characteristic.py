"""Characteristic frequencies of the bearings of a model, and the one that a line of a spectrum belongs to.

In: a manifest and numbers.  Out: frequencies, or orders of the driver's or shaft's speed, with names.

They come from the speed of the model's cage, so that slip of the cage shifts them as it shifts the motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.ratings.of_bearing import contact_cosine
from ballpass.runtime.solution.solution import Solution
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import LOCKED, Repetition, near_fraction
from ballpass.runtime.time.turning import TURN

#: Multiples that are looked for: of ball passes, of these with sidebands, of the cage (more are ball passes); and the
#: most shafts or cages to their sides.  With more of them everything would be something.
MOST_MULTIPLES, MOST_SIDED, MOST_OF_CAGE, MOST_SIDEBANDS = 30, 10, 3, 5

SIDEBANDS = range(-MOST_SIDEBANDS, MOST_SIDEBANDS + 1)

#: Turns of a spectrum at least; its lines between ball pass and the nearest harmonic of the shaft, with room for the
#: window's width; and the most turns that these may cost.
TURNS, APART, MOST = 100, 5.0, 400

#: Names of what is of a bearing.
OF_BEARINGS = ("FTF", "BPFO", "BPFI", "2 BSF")


#: Speeds of the balls over both rings, behind the path of a bearing.
PASS_SPEEDS = ("outer_pass_speed", "inner_pass_speed")

#: Channels of a linkage begin with these.
LINKAGE = ("reaction.", "drive_", "driver.", "body.", "point.", "spring.", "stop.")


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicFrequencies:
    """Frequencies of a ball bearing whose inner ring turns [Hz].

    Attributes
    ----------
    shaft : turns of the inner ring
    cage : turns of the cage (FTF)
    ball_pass_outer : balls over a point of the outer ring (BPFO)
    ball_pass_inner : balls over a point of the inner ring (BPFI)
    ball_spin : turns of a ball about itself, seen from the cage (BSF); a spot on it meets a ring at twice this
    """

    shaft: float
    cage: float
    ball_pass_outer: float
    ball_pass_inner: float
    ball_spin: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CharacteristicLine:
    """A characteristic frequency of a bearing or of the machine.

    Attributes
    ----------
    name : "FTF", "BPFO", "BPFI" or "2 BSF"; "shaft", or a harmonic load of a frequency of its own, as "load push"
    bearing : name of the bearing, "" for the scene's only one and for the machine
    frequency : [Hz], or [1] as an order
    side : distance of its sidebands, in the same unit; 0 for shaft and cage, which have none
    side_name : what that is, "shaft" or "FTF"
    parts : into which its lines divide it: an engine whose loads repeat after two turns has lines of half a shaft
    """

    name: str
    bearing: str
    frequency: float
    side: float
    side_name: str
    parts: int = 1

    @property
    def of_bearing(self) -> bool:
        """Whether it is of a bearing; else it is there without one."""
        return self.name in OF_BEARINGS

    @property
    def is_load(self) -> bool:
        """Whether it is a harmonic load of a frequency of its own."""
        return not self.of_bearing and self.side > 0.0

    @property
    def healthy(self) -> bool:
        """Whether a healthy bearing has it: balls that pass the load, and what is there without a bearing."""
        return self.name == "BPFO" or not self.of_bearing

    @property
    def label(self) -> str:
        """Name with that of the bearing, where it has one."""
        return f"{self.name} {self.bearing}".rstrip()


def frequencies_of(bearing: BearingInfo, values: Mapping[str, float]) -> KinematicFrequencies:
    """Frequencies of a bearing by the model's own speeds of its cage [Hz].

    A ball rolls on the outer raceway, also where the cage slips.

    Parameters
    ----------
    values : parameters and derived constants by name; complex as `timeline.along` moves them
    """
    at, speed = bearing.path, values[f"{bearing.path}.cage_speed"]
    speeds = (speed, values.get(f"{at}.outer_pass_speed", speed), values[f"{at}.inner_pass_speed"])
    # the size of a complex number has no such derivative
    cage, outer, inner = ((-speed if speed.real < 0.0 else speed) / TURN for speed in speeds)
    return KinematicFrequencies(
        shaft=abs(values[bearing.ring_speed]) / TURN,
        cage=cage,
        ball_pass_outer=bearing.balls * outer,
        ball_pass_inner=bearing.balls * inner,
        ball_spin=outer
        * (contact_cosine(bearing, values) + values[f"{at}.pitch_diameter"] / values[f"{at}.ball_diameter"]),
    )


def characteristic_lines(
    manifest: Manifest, values: Mapping[str, float], *, orders: bool = False
) -> tuple[CharacteristicLine, ...]:
    """Lines of the shaft, of harmonic loads that do not go with it, and of every bearing; none where nothing turns.

    Parameters
    ----------
    values : parameters and derived constants by name, as of `Solution.parameters` and `Solution.constants`
    orders : over the speed of driver or shaft, instead of frequencies

    Notes
    -----
    Where the speed changes, frequencies are those of the speeds given, and orders hold throughout.
    """
    speed = abs(timeline.shaft_speed(manifest, values)) / TURN
    if speed == 0.0:
        return ()
    unit = speed if orders else 1.0
    shaft = speed / unit
    repetition = Repetition.of(manifest, values)
    parts = repetition.turns
    found = [CharacteristicLine(name="shaft", bearing="", frequency=shaft, side=0.0, side_name="", parts=parts)]
    for load in repetition.loads:
        frequency = load.frequency / unit
        if near_fraction(frequency / shaft * parts, 1, LOCKED):
            continue
        found.append(
            CharacteristicLine(name=load.words, bearing="", frequency=frequency, side=shaft, side_name="shaft")
        )
    for bearing in manifest.bearings:
        one = frequencies_of(bearing, values)
        cage, turning = one.cage / unit, one.shaft / unit
        if turning == 0.0:  # rings that only swing against each other pass no ball
            continue
        lines = (
            ("FTF", cage, 0.0, ""),
            ("BPFO", one.ball_pass_outer / unit, turning, "shaft"),
            ("BPFI", one.ball_pass_inner / unit, turning, "shaft"),
            ("2 BSF", 2.0 * one.ball_spin / unit, cage, "FTF"),
        )
        found += [
            CharacteristicLine(name=name, bearing=bearing.name, frequency=f, side=side, side_name=of)
            for name, f, side, of in lines
        ]
    return tuple(found)


def mean_speeds(solution: Solution) -> Mapping[str, float]:
    """Parameters and constants with speeds that change as means over the samples.

    Where a torque drives, they are those at the initial speed, means over its angle.
    """
    manifest, mechanism, ends = solution.manifest, solution.manifest.mechanism, solution.t[[0, -1]]
    found = {**solution.parameters, **solution.constants}
    passed = float(ends[1] - ends[0])
    if passed > 0.0:
        found |= timeline.mean_rates(manifest, found, float(ends[0]), float(ends[1]))
    if mechanism is not None and mechanism.angle and found[mechanism.speed] != 0.0:
        first, last = solution[mechanism.angle][[0, -1]]
        passed = float(last - first) / found[mechanism.speed]
    for bearing in manifest.bearings:
        name = f"{bearing.prefix}cage.lag"
        if name in solution.states and passed > 0.0:
            lags = solution[name][[0, -1]]
            for speed in (f"{bearing.path}.{speed}" for speed in ("cage_speed", *PASS_SPEEDS)):
                if speed in found:
                    found[speed] -= float(lags[1] - lags[0]) / passed
    return found


def name_of(frequency: float, lines: Sequence[CharacteristicLine], resolution: float) -> str:
    """What a line of a spectrum is: the nearest name within the resolution; empty for none.

    A machine turns, whether or not its bearings are damaged: a multiple of the shaft or of a load that the record does
    not separate from a name of a bearing comes first.  Positions are known to a tenth of a line; of names as near, that
    with fewer sidebands and the lower multiple is given.  Loads of frequencies of their own are sidebands of balls that
    pass and of each other, and mix so much that damage beside them has no sidebands.

    Parameters
    ----------
    frequency : of the line
    resolution : distance of two lines of the spectrum
    """
    fits: list[tuple[bool, float, int, Fraction, str]] = []
    loads = [line for line in lines if line.is_load]
    for line in lines:
        if line.frequency == 0.0:
            continue
        sides = [(line.side, line.side_name)] if line.side and (line.healthy or not loads) else []
        sides += [(one.frequency, one.label) for one in loads if line.healthy and line.side and one is not line]
        for m, (side, name) in ((0, (0.0, "")), *((m, of) for of in sides for m in SIDEBANDS if m)):
            most = MOST_OF_CAGE if line.name == "FTF" else MOST_SIDED if m else MOST_MULTIPLES
            k = Fraction(round((frequency - m * side) / line.frequency * line.parts), line.parts)
            apart = abs(frequency - float(k) * line.frequency - m * side) / resolution
            if k > 0 and (k <= most or line.name == "shaft") and apart <= 1.0 + 1e-9:
                fits.append((m != 0 or line.of_bearing, round(apart, 1), abs(m), k, _words(k, m, line, name)))
    return min(fits)[-1] if fits else ""


def turns_to_separate(manifest: Manifest, values: Mapping[str, float]) -> int:
    """Turns of a spectrum that separates ball pass from the nearest multiple of the shaft; `TURNS` at least.

    Parameters
    ----------
    values : parameters and derived constants by name
    """
    turns, repetition = TURNS, Repetition.of(manifest, values)
    values = {**values, **timeline.settled_rates(manifest, values)}
    for bearing in manifest.bearings:
        found = frequencies_of(bearing, values)
        order = found.ball_pass_outer / found.shaft if found.shaft > 0.0 else 0.0
        near = abs(order - round(order * repetition.turns) / repetition.turns)
        if near * MOST > APART:
            turns = max(turns, math.ceil(APART / near))
    return repetition.whole(turns)


def carries_lines(manifest: Manifest, channel: str) -> bool:
    """Whether bearings are heard in a channel: not in what an ideal linkage does, nor in a load that is given."""
    ideal = not any(bearing.two_way for bearing in manifest.bearings)
    loads = tuple(f"{bearing.prefix}load." for bearing in manifest.bearings)
    return not (channel.startswith(loads) or (manifest.mechanism is not None and ideal and channel.startswith(LINKAGE)))


def _words(k: Fraction, m: int, line: CharacteristicLine, side: str) -> str:
    head = line.label if k == 1 else f"{k} x {line.label}" if line.name[0].isdigit() else f"{k} {line.label}"
    if m == 0:
        return head
    times = "" if abs(m) == 1 else f"{abs(m)} "
    return f"{head} {'+' if m > 0 else '-'} {times}{side}"
