"""What the rows of the summary's table are called, their order, and what stands out.

In: a manifest, what `summarize` gave.  Out: words for each number, and sentences.

Names of numbers are those of files and options; people read words.  Words of states, outputs and constants are the
manifest's own descriptions, shortened.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.ratings.elements import RatedElement
from ballpass.runtime.ratings.of_bearing import bearing_words, contacts_of, rated_element
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.short_words import short_words
from ballpass.runtime.time.timeline import crank_angle, is_free

#: Words of what the summary adds to states, outputs and constants; those of one bearing of several name it.
_ADDED = {
    "peak_ball_force.total": "Highest ball force",
    "peak_ball_force.elastic": "Highest ball force, elastic part",
    "drive_work": "Work of the drive in a turn",
    "reaction_condition.unscaled": "Condition number of the joint forces' equations",
    "reaction_condition.scaled": "The same, with equations and forces scaled",
    "frequencies.shaft": "Shaft frequency",
    "frequencies.cage": "Cage frequency (FTF)",
    "frequencies.ball_pass_outer": "Ball pass, outer (BPFO)",
    "frequencies.ball_pass_inner": "Ball pass, inner (BPFI)",
    "frequencies.ball_spin": "Ball spin (BSF)",
}

#: What a reader wants first, by the beginnings of names behind that of a bearing; other rows are shown on request.
_FIRST = (
    ("peak_ball_force.total",),
    ("stop.", "spring."),
    ("reaction.", "load."),
    ("drive_torque", "drive_work", "drive_power"),
    ("driver.",),
    ("point.",),
    ("inner.x", "inner.y", "outer.x", "outer.y"),
    ("frequencies.",),
)


def row_words(manifest: Manifest, name: str) -> str:
    """What a number of the summary is."""
    prefix, own = _of_bearing(manifest, name)
    whose = f" of {prefix.removesuffix('.')}" if prefix else ""
    if own in _ADDED:
        words = bearing_words(_ADDED[own], manifest.bearings, name)
        return f"{words}{',' + whose.removeprefix(' of') if whose else ''}"
    infos = (*manifest.states, *manifest.outputs)
    found = next((info.description for info in infos if info.name == name), "")
    paths = {f"{bearing.path}.{own}" for bearing in manifest.bearings if bearing.prefix == prefix}
    found = found or next((info.description for info in manifest.constants if info.name in paths), name)
    found = short_words(found)
    return found if not whose or prefix.removesuffix(".") in found else f"{found}{whose}"


def written(item: Mapping[str, Any], key: str, factor: float) -> str:
    """A number of the summary; one of the samples alone has a star: more samples may show more."""
    star = "*" if item.get("searched", {}).get(key) == "samples" else ""
    return f"{rounded(factor * item[key])}{star}"


def inside(words: str) -> str:
    """Words of a row within a sentence."""
    return words[:1].lower() + words[1:]


def row_place(manifest: Manifest, name: str) -> int | None:
    """Place of a number among those a reader wants first; None for the others."""
    own = _of_bearing(manifest, name)[1]
    if own.startswith("point.") and not own.endswith((".x", ".y")):  # velocities of coupler points
        return None
    return next((place for place, begins in enumerate(_FIRST) if own.startswith(begins)), None)


def stands_out(manifest: Manifest, values: Mapping[str, float], summary: Mapping[str, Any]) -> list[str]:
    """Sentences on top: the highest ball force of each bearing with its moment, and what its pressure leaves behind.

    Parameters
    ----------
    values : parameters and derived constants of the run by name
    """
    said: list[str] = []
    beyond: list[RatedElement] = []
    for bearing in manifest.bearings:
        peak = summary.get(f"{bearing.prefix}peak_ball_force")
        if peak is None or "total" not in peak:
            continue
        force, time = peak["total"], peak["time"]["total"]
        place = f"{rated_element(bearing).noun} {peak['ball']['total']} at {time:.5g} s"
        if not is_free(manifest):
            place += f", {manifest.turning} at {math.degrees(crank_angle(manifest, values, time)):.1f} deg"
        element = rated_element(bearing)
        whose = f" of {bearing.name}" if bearing.name else ""
        said.append(f"Highest {element.noun} force{whose}: {written(peak, 'total', 1.0)} N ({place})")
        if not element.unrated:
            pressure, ring = max(
                (float(contact.peak_pressure(force)), ring)
                for contact, ring in zip(contacts_of(bearing, values), ("inner", "outer"), strict=True)
            )
            said[-1] += f", {pressure / 1e6:.0f} MPa on the {ring} raceway"
            if pressure > element.static_pressure:
                beyond.append(element)
        said[-1] += "."
    limits = {element.noun: element.static_pressure for element in beyond}
    said += [
        f"Above {limit / 1e6:.0f} MPa (ISO 76) a dent of about a ten-thousandth of the {noun}'s diameter remains: see "
        "ballpass life."
        for noun, limit in limits.items()
    ]
    return said


def _of_bearing(manifest: Manifest, name: str) -> tuple[str, str]:
    """Prefix of the bearing that a number belongs to, and the rest of the name."""
    prefix = next((b.prefix for b in manifest.bearings if b.prefix and name.startswith(b.prefix)), "")
    return prefix, name.removeprefix(prefix)
