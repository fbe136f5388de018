"""Shapes of links, guides and displaced rings, and forces, for pictures and pages alike; needs no matplotlib."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.plot.record import FRAME, Array, Record

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import MechanismInfo

#: Points of bodies: a place (2,), or places over time (times, 2) [m].
Points = dict[tuple[str, str], Array]


#: A guide's and a slider's point meet below this part of their largest distance.
MEETING = 0.02

#: Distance of a body's point from the figure of the others below which it belongs to that, over the picture's size.
FLAT = 0.02


def used_points(mechanism: MechanismInfo) -> list[tuple[str, str]]:
    """Points of joints, of applied forces and of springs, then the others of moving bodies, each once."""
    return [*_acting_points(mechanism), *coupler_points(mechanism)]


def coupler_points(mechanism: MechanismInfo) -> list[tuple[str, str]]:
    """Points of moving bodies that no joint, force or spring has; centres of mass are none."""
    acting = {FRAME: True} | dict.fromkeys(_acting_points(mechanism), True)
    every = ((info.body, info.point) for info in mechanism.points)
    return [key for key in every if not {key, key[0]} & acting.keys() and key[1] != "center_of_mass"]


def _acting_points(mechanism: MechanismInfo) -> list[tuple[str, str]]:
    joined = [key for _, _, b, p, c, q in mechanism.joints for key in ((b, p), (c, q))]
    pulled = [key for _, b, p, c, q in mechanism.springs for key in ((b, p), (c, q))]
    return list(dict.fromkeys([*joined, *((body, point) for _, body, point, _ in mechanism.forces), *pulled]))


def pitch_circles(mechanism: MechanismInfo, points: Points) -> list[tuple[Array, Array]]:
    """Centres and radii of the wheels in mesh: of places (2,), (), or of places over time (times, 2), (times,) [m]."""
    found = []
    for *ends, share in mechanism.wheels:
        one, other = points[ends[0], ends[1]], points[ends[2], ends[3]]
        apart = np.hypot(*(other - one).T)
        found += [(one, abs(share) * apart), (other, abs(1.0 - share) * apart)]
    return found


def drawn_corners(mechanism: MechanismInfo, points: Points) -> Array:
    """Places over time that a picture holds, those around pitch circles as well, (places, 2) [m]."""
    circles = [at + sign * r[:, None] for at, r in pitch_circles(mechanism, points) for sign in (-1.0, 1.0)]
    return np.vstack([*(points[key] for key in used_points(mechanism)), *circles])


def links(used: list[tuple[str, str]], now: Points, size: float) -> list[tuple[str, list[tuple[str, str]]]]:
    """Each moving body with the corners of its figure: two ends of a bar, those of a plate in order, or one point.

    It is drawn around all its points and its centre of mass.
    """
    found = []
    for body in dict.fromkeys(name for name, _ in used if name != FRAME):
        keys: list[tuple[str, str]] = []
        for key in used:
            if key[0] == body and all(np.hypot(*(now[key] - now[other])) > 1e-6 * size for other in keys):
                keys.append(key)
        center = (body, "center_of_mass")
        found.append((body, _outline([*keys, center] if len(keys) > 1 and center in now else keys, now, size)))
    return found


def _outline(keys: list[tuple[str, str]], now: Points, size: float) -> list[tuple[str, str]]:
    """Corners of the convex figure around places, counter-clockwise; those that hardly stand out are left out."""
    if len(keys) < 3:
        return keys
    ordered = sorted(keys, key=lambda key: tuple(now[key]))

    def half(way: list[tuple[str, str]]) -> list[tuple[str, str]]:
        kept: list[tuple[str, str]] = []
        for key in way:
            while len(kept) > 1:
                along, further = now[kept[-1]] - now[kept[-2]], now[key] - now[kept[-2]]
                if along[0] * further[1] - along[1] * further[0] > FLAT * size * np.hypot(*further):
                    break
                kept.pop()
            kept.append(key)
        return kept[:-1]

    return half(ordered) + half(ordered[::-1])


def guide_direction(now: Points, trace: Points, guide: tuple[str, str], block: tuple[str, str]) -> Array:
    """Unit vector along the guide.

    The slider's point stays on the line through the guide's point: one to the other, or, where they meet, as in the
    nearest pose in which they are apart.  On the frame, along the path.
    """
    ways = trace[block] - (trace[block][0] if guide[0] == FRAME else trace[guide])
    far = np.hypot(*ways.T)
    longest = ways[int(np.argmax(far))]
    if guide[0] != FRAME:
        other = np.hypot(*(trace[block] - now[block]).T) + np.hypot(*(trace[guide] - now[guide]).T)
        apart, clear = now[block] - now[guide], MEETING * float(np.max(far))
        longest = apart if np.hypot(*apart) > clear else ways[int(np.argmin(np.where(far > clear, other, np.inf)))]
    length = float(np.hypot(*longest))
    return longest / length if length > 0.0 else np.array([1.0, 0.0])


def exaggeration(shown: float, actual: float) -> float:
    """Largest of 1, 2, 5, 10, 20 ... that keeps `actual` [m] within `shown` [m]."""
    if actual <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(shown / actual))
    return float(max(1.0, decade * max(digit for digit in (1.0, 2.0, 5.0) if digit * decade <= shown / actual)))


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnForce:
    """A force of a picture over samples.

    Attributes
    ----------
    name, words : as ``reaction.A``, ``force.punch`` or ``spring.valve.rod``; by and on which body
    at : body and point where it acts
    pushes : whether its arrow ends there; else it begins there
    force : components, shape (samples, 2) [N]
    """

    name: str
    words: str
    at: tuple[str, str]
    pushes: bool
    force: Array


def drawn_forces(record: Record, samples: np.ndarray, paths: Points) -> list[DrawnForce]:
    """Reactions that are outputs, applied forces, and those of springs and stops on moving bodies, at some samples.

    A reaction is drawn on the frame where that is one of both bodies, else on the joint's first body.  Applied forces
    are zero while they do not act.
    """
    found = []
    for name, _, first, _, second, point in record.mechanism.joints:
        if record.has(f"reaction.{name}.x", f"reaction.{name}.y"):
            # the reaction is the force of the second body on the first
            sign, on, by = (-1.0, second, first) if second == FRAME else (1.0, first, second)
            force = np.column_stack([record.values(f"reaction.{name}.{axis}")[samples] for axis in "xy"])
            words, at = f"{name}: {by} on {on}", (second, point)
            found.append(DrawnForce(name=f"reaction.{name}", words=words, at=at, pushes=False, force=sign * force))
    acting = [record.applied_forces(float(record.t[k])) for k in samples]
    for name, at in dict.fromkeys((name, at) for now in acting for name, at, _ in now):
        force = np.array([next((f for n, _, f in now if n == name), np.zeros(2)) for now in acting])
        found.append(DrawnForce(name=f"force.{name}", words=f"{name} on {at[0]}", at=at, pushes=True, force=force))
    for label, *ends in record.mechanism.springs:
        tension = record.spring_tension(label)
        pairs = [(ends[0], ends[1]), (ends[2], ends[3])]
        for at, other in (pairs, pairs[::-1]):
            if tension is None or at[0] == FRAME:
                continue
            way, pull = paths[other] - paths[at], tension[samples]
            force = pull[:, None] * way / np.maximum(np.hypot(*way.T), 1e-12)[:, None]
            words, pushes = f"{label.replace('.', ' ')} on {at[0]}", bool(np.mean(pull) < 0.0)
            found.append(DrawnForce(name=f"{label}.{at[0]}", words=words, at=at, pushes=pushes, force=force))
    return found
