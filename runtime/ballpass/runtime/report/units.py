"""Units of the fields of answers, by their names, for JSON.

``units`` of an object has the unit of a field in it by its name, and of all within that field; any other number has
the ``unit`` of the nearest object around it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

#: Names of fields that mean the same in all answers that do not say otherwise, by unit.  SI: each value has its own.
_NAMES = {
    "1": "agreement bound_share change contamination correlation correlations count crest_factor cycles damage "
    "difference dimensionless drift evaluations excess exponent exponent_half factor factors failed failures "
    "harmonics imaginary infinite integrated kept kurtosis left line magnitude margin members operations parts "
    "peak_ball phase promised real reliability repeats resolution rows rtol samples seed segments "
    "sensitivity_rtol shape share shares side skewness sooner spread static_safety step transient "
    "transient_cycles turns verdicts viscosity_ratio median rest steps multipliers made missed balls stiffness "
    "chunk lanes pivoted rejected switches threads member gain error simpler_error",
    "N": "axial_force dynamic dynamic_rating equivalent_load fatigue_limit mean_load peak_force peak_forces static "
    "static_rating",
    "Pa": "peak_pressure",
    "Hz": "frequency",
    "h": "basic_hours hours modified_hours",
    "m": "ball_diameter bore clearance interference major_axis minor_axis outside_diameter pitch_diameter reach "
    "shoulder_height wear_across width",
    "m/s": "wear",
    "m^2/N": "wear_coefficients",
    "rad": "angle contact_angle crank_angle critical dither free peak_angle tilt wear_angle worst_angle",
    "deg": "angle_deg",
    "s": "duration peak_time period time turn wall_time simpler_time",
    "turns": "basic_life basic_turns life lives modified_life modified_turns",
    "1/s": "decay eigenvalue slowest",
    "rad/s": "speed",
    "m/s^2": "acceleration",
    "SI": "start state",
}

UNITS = {name: unit for unit, names in _NAMES.items() for name in names.split()}


def with_units(plain: Mapping[str, Any]) -> dict[str, Any]:
    """An answer with the units of its fields; those that it has already stay."""
    found = {name: UNITS[name] for name in sorted(set(_names(plain))) if name in UNITS} | plain.get("units", {})
    return {**plain, "units": found} if found else dict(plain)


def _names(plain: Any) -> Iterator[str]:
    if isinstance(plain, Mapping):
        yield from plain
    if isinstance(plain, Mapping | list | tuple):
        for value in plain.values() if isinstance(plain, Mapping) else plain:
            yield from _names(value)
