"""Moments at which a trajectory touches a kink of a law instead of crossing it: derivatives change fast there.

In: deflections of the balls along a run.  Out: `Grazing` records.

A ball that crosses into contact does so at a moment that moves smoothly with every parameter.  One whose deflection has
an extreme near zero may touch or not after the smallest change: first derivatives are continuous, and second ones grow
without bound on one side.  The same holds for the rate of deflection under a law that damps one way only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: An extreme counts as grazing within this share of the largest deflection, or rate.
TOLERANCE = 1e-4

#: Moments nearer to each other than this share of the time are one.
SAME = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Grazing:
    """An extreme near a kink.

    Attributes
    ----------
    ball : counted from 1
    time : [s]
    crank_angle : of the driver or shaft, in [0, 2 pi) [rad]
    depth : deflection [m] or rate of deflection [m/s] at its extreme; negative before the kink is reached
    kink : "contact" or "rate"
    bearing : its name, "" for the scene's only one
    """

    ball: int
    time: float
    crank_angle: float
    depth: float
    kink: str
    bearing: str = ""

    def __str__(self) -> str:
        return describe((self,))


def describe(place: Sequence[Grazing]) -> str:
    """One line for the balls that graze one kink at one moment."""
    first = place[0]
    unit = "m" if first.kink == "contact" else "m/s"
    what = "contact" if first.kink == "contact" else "the kink of one-sided damping"
    balls = " and ".join(str(item.ball) for item in place) + (f" of {first.bearing}" if first.bearing else "")
    return (
        f"{'balls' if len(place) > 1 else 'ball'} {balls} graze{'' if len(place) > 1 else 's'} {what} at t = "
        f"{first.time:.6g} s, crank angle {np.degrees(first.crank_angle):.4g} deg, with {first.depth:.2e} {unit}"
    )


def merge_grazing(found: Sequence[Grazing]) -> list[tuple[Grazing, ...]]:
    """Places in order of time: balls that graze one kind of kink at one moment, as opposite ones do, are one place."""
    places: list[list[Grazing]] = []
    for item in found:
        same = [
            place
            for place in places
            if (place[0].kink, place[0].bearing) == (item.kink, item.bearing)
            and abs(place[0].time - item.time) <= SAME * item.time
        ]
        if same:
            same[0].append(item)
        else:
            places.append([item])
    return [tuple(sorted(place, key=lambda item: item.ball)) for place in places]


def find_grazing(
    t: Array,
    segment: NDArray[np.int_],
    deflection: Array,
    angles: Array,
    *,
    one_sided: bool,
    bearing: str = "",
) -> tuple[Grazing, ...]:
    """Extremes of deflection near zero, and of its rate where the law is one-sided, in order of time.

    Parameters
    ----------
    t : increasing times, shape (n,) [s]
    segment : part of the run between load switches that each belongs to, shape (n,)
    deflection : shape (n, balls) [m]
    angles : crank angle at each time, shape (n,) [rad]
    one_sided : whether the damping law has a kink at rate zero, in contact or not
    bearing : name of the balls' bearing
    """
    found: list[Grazing] = []
    for k in np.unique(segment).tolist():
        rows = np.flatnonzero(segment == k)
        rows = rows[np.concatenate([[True], np.diff(t[rows]) > 0.0])]
        if len(rows) < 5:
            continue
        time, part = t[rows], deflection[rows]
        found += _near_zero(time, part, angles[rows], "contact", TOLERANCE * float(np.max(np.abs(deflection))), bearing)
        if one_sided:
            rate = np.gradient(part, time, axis=0)
            found += _near_zero(time, rate, angles[rows], "rate", TOLERANCE * float(np.max(np.abs(rate))), bearing)
    return tuple(sorted(found, key=lambda item: (item.time, item.kink, item.ball)))


def _near_zero(t: Array, signal: Array, angles: Array, kink: str, width: float, bearing: str) -> list[Grazing]:
    """Extremes within `width` of zero that touch zero rather than cross it, by parabolas through three neighbours."""
    before, here, behind = signal[:-2], signal[1:-1], signal[2:]
    top = (here > before) & (here >= behind) & (here <= 2.0 * width)
    bottom = (here < before) & (here <= behind) & (here >= -2.0 * width)
    # a constant signal varies by rounding
    moving = np.maximum(np.abs(here - before), np.abs(here - behind)) > 1e-6 * width
    rows, balls = np.nonzero((top | bottom) & moving)
    # Newton's form of the parabola about the middle point
    left, right = t[rows] - t[rows + 1], t[rows + 2] - t[rows + 1]
    middle = here[rows, balls]
    fall, rise = (before[rows, balls] - middle) / left, (behind[rows, balls] - middle) / right
    bend = (rise - fall) / (right - left)
    slope = fall - bend * left
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.clip(np.where(bend != 0.0, -0.5 * slope / bend, 0.0), left, right)
    depth = middle + shift * (slope + bend * shift)
    return [
        Grazing(
            ball=int(balls[k]) + 1,
            time=float(t[rows[k] + 1] + shift[k]),
            crank_angle=float(angles[rows[k] + 1]),
            depth=float(depth[k]),
            kink=kink,
            bearing=bearing,
        )
        for k in np.flatnonzero(np.abs(depth) <= width)
    ]
