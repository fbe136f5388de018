"""Where a model's simplifications decide about its forces: sentences, with the command that measures it.

Where fits by class may let a ring creep, or take the whole clearance.
In: a manifest and values of its parameters and constants.  Out: sentences; none where nothing is to be said.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.ratings.of_bearing import fit_clearances, inner_ring_mass

#: Interference that holds a ring: above rounding [m].
HOLDING = 1e-9
#: Part of the highest ball force up to which the inertia that a one-way load leaves out does not matter [1].
LITTLE = 0.01
_BODY, _MASS = "mechanism.bodies.", ".mass"


def limits_of_model(
    manifest: Manifest, values: Mapping[str, float], moved: Mapping[str, tuple[float, float]] | None = None
) -> Iterator[str]:
    """Linkages that outweigh the ring of a bearing that is loaded one-way, forces that begin at once, lost preloads.

    Parameters
    ----------
    values : parameters and derived constants by name
    moved : of a run by the bearings' paths: highest acceleration of the inner ring [m/s^2], highest ball force [N]
    """
    for bearing in manifest.bearings:
        yield from (f"{bearing.path}: {words}" for words in limits_of_fit(bearing, values))
        gap, apart = (values.get(f"{bearing.path}.{name}", 0.0) for name in ("radial_gap", "groove_centre_distance"))
        if gap > 0.0:
            enough = math.sqrt(apart**2 - (apart - 0.5 * values[f"{bearing.path}.clearance"]) ** 2)
            yield (
                f"{bearing.path} is not preloaded: the axial displacement of "
                f"{1e6 * values[f'{bearing.path}.axial_displacement']:.3g} µm leaves a radial gap of {1e6 * gap:.3g} "
                f"µm. Its balls touch from {1e6 * enough:.3g} µm on."
            )
    mechanism = manifest.mechanism
    if mechanism is None:
        whole = [one.path for one in manifest.bearings if not one.axis and f"{one.path}.share" not in values]
        if len(manifest.bearings) > 1 and whole:
            yield (
                f"{', '.join(whole)}: each carries the whole load of the shaft, as no other bearing does. Give each "
                "bearing its part, as share = 0.5."
            )
        return
    if not manifest.bearings:
        return
    speed = values.get(mechanism.speed)
    turning = "" if speed is None else f", at {abs(speed) * 30.0 / math.pi:.4g} rpm"
    linkage = sum(value for name, value in values.items() if name.startswith(_BODY) and name.endswith(_MASS))
    for bearing in manifest.bearings:
        ring = inner_ring_mass(bearing, values)
        acceleration, force = (moved or {}).get(bearing.path, (math.inf, 0.0))
        inertia = linkage * acceleration
        if bearing.joint and ring is not None and linkage > ring and not inertia <= LITTLE * force:
            size = (
                f" Left out are up to {inertia:.0f} N of inertia; a ball carries up to {force:.0f} N." if force else ""
            )
            yield (
                f"{bearing.path} is loaded one-way: the linkage, {linkage:.3g} kg, {linkage / ring:.2g} times as heavy "
                f"as the ring, {ring:.3g} kg{turning}, does not feel its motion.{size} "
                "Peak forces may be far off. `ballpass trade SCENE --against two-way` measures it."
            )
    gates = {info.name for info in manifest.inputs if info.kind == "gate"}
    sudden = [name for name, _, _, item in mechanism.forces if item in gates]
    # where the angle is a state no input holds the gate, but the border of its window
    borders = {info.name.split(".")[1] for info in manifest.inputs if info.kind == "border" and info.windows}
    sudden += [name for name, _, _, _ in mechanism.forces if name in borders]
    if sudden:
        yield (
            f"{', '.join(sudden)}: the load begins and ends at once. Peaks behind its edges are the overshoot of a "
            'sudden load; a real one rises: give its window a rise, as rise = "5 deg".'
        )


def limits_of_fit(bearing: BearingInfo, values: Mapping[str, float]) -> Iterator[str]:
    """A ring that may creep, and a clearance that may be lost, where fits are given by class."""
    fit = bearing.fit
    if fit is None:
        return
    outer = bearing.inner_stands  # at a joint such a bearing swings, and neither ring turns
    ring, name, pressed = ("outer", fit.housing, fit.outer) if outer else ("inner", fit.shaft, fit.inner)
    if pressed and pressed[0] < HOLDING and not (outer and bearing.joint):
        yield (
            f"the {ring} ring turns against the load and may creep on its seat: with {name} its least interference is "
            f"{1e6 * pressed[0]:.1f} µm, the least probable one {1e6 * pressed[1]:.1f} µm. Take a tighter class."
        )
    least, probable, *_ = fit_clearances(bearing, values)
    if least < 0.0:
        yield (
            f"the least clearance in operation is {1e6 * least:.1f} µm, the least probable one {1e6 * probable:.1f} "
            "µm: below zero is preload. Take a larger group of clearance, or a looser class."
        )
