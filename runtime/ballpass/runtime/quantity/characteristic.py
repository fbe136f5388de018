"""Characteristic frequencies of the bearings of a model, and the one that a line of a spectrum belongs to.

In: a manifest and numbers.  Out: frequencies, or orders of the driver's or shaft's speed, with names.

They come from the speed of the model's cage, so that slip of the cage shifts them as it shifts the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ballpass.runtime.contract import BearingInfo, Manifest
from ballpass.runtime.ratings.kinematic_frequencies import KinematicFrequencies
from ballpass.runtime.run import driver_angle

#: Multiples that are looked for: of the shaft, of ball passes, of the cage (more are ball passes); and the most shafts
#: or cages to their sides.  With more of them everything would be something.
MOST_OF_SHAFT, MOST_MULTIPLES, MOST_OF_CAGE, MOST_SIDEBANDS = 30, 10, 3, 5
#: A second name is told where it is hardly less simple.
NEARLY_AS_SIMPLE = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class CharacteristicLine:
    """A characteristic frequency of a bearing.

    Attributes
    ----------
    name : "shaft", "FTF", "BPFO", "BPFI" or "2 BSF"
    bearing : name of the bearing, "" for the scene's only one and for the shaft
    frequency : [Hz], or [1] as an order
    side : distance of its sidebands, in the same unit; 0 for the shaft and the cage, which have none
    side_name : what that is, "shaft" or "FTF"
    """

    name: str
    bearing: str
    frequency: float
    side: float
    side_name: str

    @property
    def label(self) -> str:
        """Name with that of the bearing, where it has one."""
        return f"{self.name} {self.bearing}".rstrip()


def frequencies_of(bearing: BearingInfo, values: Mapping[str, float]) -> KinematicFrequencies:
    """Frequencies of a bearing by the model's own speeds of its cage [Hz].

    A ball rolls on the outer raceway, also where the cage slips.

    Parameters
    ----------
    values : parameters and derived constants by name
    """
    at = bearing.path
    outer = values.get(f"{at}.outer_pass_speed", values[f"{at}.cage_speed"])
    cage, inner = abs(outer) / driver_angle.TURN, abs(values[f"{at}.inner_pass_speed"]) / driver_angle.TURN
    return KinematicFrequencies(
        shaft=abs(values[bearing.ring_speed]) / driver_angle.TURN,
        cage=cage,
        ball_pass_outer=bearing.balls * cage,
        ball_pass_inner=bearing.balls * inner,
        ball_spin=cage * (1.0 + values[f"{at}.pitch_diameter"] / values[f"{at}.ball_diameter"]),
    )


def characteristic_lines(
    manifest: Manifest, values: Mapping[str, float], *, orders: bool = False
) -> tuple[CharacteristicLine, ...]:
    """Lines of the shaft and of every bearing; none where nothing turns.

    Parameters
    ----------
    values : parameters and derived constants by name, as of `Solution.parameters` and `Solution.constants`
    orders : over the speed of driver or shaft, instead of frequencies

    Notes
    -----
    Where the speed changes, frequencies are those of the initial one, and orders hold throughout.
    """
    speed = abs(driver_angle.shaft_speed(manifest, values)) / driver_angle.TURN
    if speed == 0.0:
        return ()
    unit = speed if orders else 1.0
    shaft = speed / unit
    found = [CharacteristicLine(name="shaft", bearing="", frequency=shaft, side=0.0, side_name="")]
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


def identify(frequency: float, lines: Sequence[CharacteristicLine], resolution: float) -> str:
    """What a line of a spectrum is: "3 BPFO", "BPFI - shaft"; the simplest that fits, "" where nothing does.

    Parameters
    ----------
    frequency : of the line
    resolution : distance of two lines of the spectrum: largest distance of a name from the line
    """
    fits: list[tuple[int, float, str]] = []
    for line in lines:
        if line.frequency == 0.0:
            continue
        most = {"shaft": MOST_OF_SHAFT, "FTF": MOST_OF_CAGE}.get(line.name, MOST_MULTIPLES)
        for m in range(-MOST_SIDEBANDS, MOST_SIDEBANDS + 1) if line.side else (0,):
            k = round((frequency - m * line.side) / line.frequency)
            beside = abs(frequency - k * line.frequency - m * line.side)
            if 1 <= k <= most and beside <= resolution * (1.0 + 1e-9):
                fits.append((k + 3 * abs(m), beside, _words(k, m, line)))
    fits.sort()
    return " or ".join(words for rank, _, words in fits[:2] if rank <= fits[0][0] + NEARLY_AS_SIMPLE)


def _words(k: int, m: int, line: CharacteristicLine) -> str:
    head = line.label if k == 1 else f"{k} x {line.label}" if line.name[0].isdigit() else f"{k} {line.label}"
    if m == 0:
        return head
    times = "" if abs(m) == 1 else f"{abs(m)} "
    return f"{head} {'+' if m > 0 else '-'} {times}{line.side_name}"
