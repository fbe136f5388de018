"""Shapes of links, guides and displaced rings, for pictures and pages alike; needs no matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.plot.record import FRAME, Array

if TYPE_CHECKING:
    from ballpass.runtime.contract import MechanismInfo

#: Points of bodies: a place (2,), or places over time (times, 2) [m].
Points = dict[tuple[str, str], Array]


def used_points(mechanism: MechanismInfo) -> list[tuple[str, str]]:
    """Points of joints, of applied forces and of springs, each once."""
    joined = [key for _, _, b, p, c, q in mechanism.joints for key in ((b, p), (c, q))]
    pulled = [key for _, b, p, c, q in mechanism.springs for key in ((b, p), (c, q))]
    return list(dict.fromkeys([*joined, *((body, point) for _, body, point, _ in mechanism.forces), *pulled]))


def links(used: list[tuple[str, str]], now: Points, size: float) -> list[tuple[str, list[tuple[str, str]]]]:
    """Each moving body and its points: two ends of a bar, the corners of a plate in order, or one point."""
    found = []
    for body in dict.fromkeys(name for name, _ in used if name != FRAME):
        keys: list[tuple[str, str]] = []
        for key in used:
            if key[0] == body and all(np.hypot(*(now[key] - now[other])) > 1e-6 * size for other in keys):
                keys.append(key)
        corners = np.array([now[key] for key in keys])
        around = corners - corners.mean(axis=0)
        if len(keys) > 2:
            keys = [keys[k] for k in np.argsort(np.arctan2(around[:, 1], around[:, 0]))]
        found.append((body, keys))
    return found


def guide_direction(now: Points, trace: Points, guide: tuple[str, str], block: tuple[str, str]) -> Array:
    """Unit vector along the guide.

    The slider's point stays on the line through the guide's point: one to the other.  On the frame, along the path.
    """
    ways = (trace[block] - trace[block][0]) if guide[0] == FRAME else (now[block] - now[guide])[None, :]
    longest = ways[int(np.argmax(np.hypot(*ways.T)))]
    length = float(np.hypot(*longest))
    return longest / length if length > 0.0 else np.array([1.0, 0.0])


def exaggeration(shown: float, actual: float) -> float:
    """Largest of 1, 2, 5, 10, 20 ... that keeps `actual` [m] within `shown` [m]."""
    if actual <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(shown / actual))
    return float(max(1.0, decade * max(digit for digit in (1.0, 2.0, 5.0) if digit * decade <= shown / actual)))
