"""Beats: rates of a machine that are nearly multiples of each other, so that turns repeat after many only.

In: a manifest and numbers.  Out: `Beat`s, each with the numbers of a run that is half a beat further on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.ratings.of_bearing import TURNS, bearing_words
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN

#: Orders of beats: q times the one rate is nearly a multiple of the other.  A load and the shaft, others; and the most
#: multiples of what is not the shaft [1].
MOST_OF_SHAFT, MOST_OF_OTHERS, MOST_MULTIPLES = 6, 2, 6

#: Rates this near to a multiple of each other are locked [1].
LOCKED = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat:
    """Two rates that are nearly multiples of each other.

    Attributes
    ----------
    words : what beats, "load push with the shaft"
    period : after which their phases are alike again [s]
    half : parameters of a run that is half a beat further on, by name
    """

    words: str
    period: float
    half: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class _Rate:
    words: str
    frequency: float  # [Hz]
    phases: Mapping[str, float]  # parameters of its phase, and what half a turn of that is


def beats(manifest: Manifest, values: Mapping[str, float]) -> Iterator[Beat]:
    """Beats of harmonic loads and passing balls with the shaft, and with each other, at the speed behind the last row;
    none where nothing turns.

    Parameters
    ----------
    values : parameters and derived constants by name
    """
    values = {**values, **timeline.settled_rates(manifest, values)}
    shaft = abs(timeline.shaft_speed(manifest, values)) / TURN
    if shaft == 0.0:
        return
    balls, loads = list(_passing(manifest, values)), list(_loads(manifest, values))
    others = [*balls, *loads]
    turning = _Rate("the shaft" if manifest.mechanism is None else "the driver", shaft, {})
    for number, one in enumerate(others):
        for other in (turning, *others[:number]):
            for q in range(1, (MOST_OF_SHAFT if other is turning and one in loads else MOST_OF_OTHERS) + 1):
                multiple = round(q * one.frequency / other.frequency)
                apart = abs(q * one.frequency - multiple * other.frequency)
                if math.gcd(q, multiple) > 1 or (other is not turning and multiple > MOST_MULTIPLES):
                    continue
                if multiple and apart > LOCKED * q * one.frequency:
                    half = {name: values[name] + step / q for name, step in one.phases.items()}
                    yield Beat(words=f"{one.words} with {other.words}", period=1.0 / apart, half=half)


def slowest_beat(manifest: Manifest, values: Mapping[str, float], most: float) -> float:
    """Period of the slowest beat of at most some time [s]; zero without one."""
    return max((beat.period for beat in beats(manifest, values) if beat.period <= most), default=0.0)


def _passing(manifest: Manifest, values: Mapping[str, float]) -> Iterator[_Rate]:
    for bearing in manifest.bearings:
        speed = values.get(f"{bearing.path}.outer_pass_speed", values[f"{bearing.path}.cage_speed"])
        if abs(values[bearing.ring_speed]) > TURNS * abs(timeline.shaft_speed(manifest, values)):
            whose = f" of {bearing.name}" if bearing.name else ""
            start = {f"{bearing.path}.ball_angle": 0.5 * TURN / bearing.balls}
            words = bearing_words(f"balls passing the outer ring{whose}", [bearing])
            yield _Rate(words, bearing.balls * abs(speed) / TURN, start)


def _loads(manifest: Manifest, values: Mapping[str, float]) -> Iterator[_Rate]:
    for rate, infos in timeline.loads(manifest).items():
        phases = {info.offset: 0.5 * TURN for info in infos}
        yield _Rate(infos[0].words, abs(values[rate]) / TURN, phases)
