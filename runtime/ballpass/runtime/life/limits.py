"""Limits of rating lives, and of balls without mass, that a bearing is beyond: sentences with number and source.

In: a bearing, its numbers, what a run found of it.  Out: sentences for people.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.life.records import BearingStrength
from ballpass.runtime.ratings.of_bearing import geometry_of, rated_element

#: Largest equivalent load over C_r for which ISO 281 gives a life [1].
LARGEST_LOAD = 0.5

#: Least load over C_r with which balls roll, from makers' catalogues [1].
LEAST_LOAD = 0.01

#: Pitch diameter times speed that grease allows, from makers' catalogues [m*rad/s]: 500 000 mm/min.
SPEED_FACTOR = 500.0 * 2.0 * math.pi / 60.0

#: Density of steel [kg/m^3], and the centrifugal force that may be left out, over the heaviest ball's share of P [1].
DENSITY, CENTRIFUGAL = 7800.0, 0.1


def limits_of(
    info: BearingInfo, values: Mapping[str, float], found: BearingStrength, fastest: float = 1.0
) -> Iterator[str]:
    """What the bearing is beyond.

    Parameters
    ----------
    values : parameters and derived constants by name, with the driver at speed
    fastest : highest speed of the run over its mean [1]
    """
    element, geometry = rated_element(info), geometry_of(info, values)
    noun = element.noun
    combined, dynamic, static = found.combined, found.dynamic_rating, found.static_rating
    load = (combined and combined.equivalent_load) or found.equivalent_load
    if not found.why_no_life and load > LARGEST_LOAD * dynamic:
        yield (
            f"P = {load:.4g} N is {load / dynamic:.2f} C_r: ISO 281 gives lives up to {LARGEST_LOAD:g} C_r. "
            "Real lives are shorter. Take a larger bearing."
        )
    if not found.why_no_life and load > static:
        yield f"P = {load:.4g} N exceeds C_0r = {static:.4g} N: ISO 281 gives no life beyond. Take a larger bearing."
    if not found.why_no_life and load < LEAST_LOAD * dynamic:
        yield (
            f"P = {load:.3g} N is {load / dynamic:.2g} C_r: below {LEAST_LOAD:g} C_r, the minimum load of makers' "
            f"catalogues, {noun}s slide, and wear decides, not fatigue. Preload it, or take a smaller bearing."
        )
    pressures = () if combined is None else combined.peak_pressure
    pressure = max(found.inner.peak_pressure, found.outer.peak_pressure, *pressures)
    if pressure > element.static_pressure:
        yield (
            f"the peak pressure, {pressure / 1e6:.0f} MPa, exceeds {element.static_pressure / 1e6:.0f} MPa, the static "
            f"limit of ISO 76: {noun}s leave dents, which the model does not have."
        )
    if found.static_safety < 1.0:
        yield f"the static safety s_0 = {found.static_safety:.2g} is below 1, the least of ISO 76."
    pitch, speed = float(geometry.pitch), fastest * abs(found.speed)
    when = " at the highest speed" if fastest > 1.01 else ""
    cage = speed and speed * values[f"{info.path}.cage_speed"] / values[info.ring_speed]
    centrifugal = DENSITY * element.volume(geometry) * 0.5 * pitch * cage**2
    share = 5.0 * load / info.balls
    if centrifugal > CENTRIFUGAL * share > 0.0:  # without a load there is no life that it could shorten
        yield (
            f"the centrifugal force of a {noun}{when}, {centrifugal:.3g} N, is {centrifugal / share:.2g} of the "
            f"heaviest {noun}'s share of P, {share:.3g} N: the model's {noun}s have no mass, which holds to some "
            f"{CENTRIFUGAL:g}. The outer ring carries more than is said here."
        )
    if pitch * speed > SPEED_FACTOR:
        yield (
            f"n d_m{when} = {pitch * speed * 30.0 / math.pi * 1e3:.3g} mm/min exceeds "
            f"{SPEED_FACTOR * 30.0 / math.pi * 1e3:.0f} mm/min, the usual limit of makers' catalogues with grease."
        )
