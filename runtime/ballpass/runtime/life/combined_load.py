"""Life of a ball bearing with an axial force or a tilt, by its statics in five degrees of freedom (ISO 16281).

In: radial loads at samples of a run, axial force, tilt.  Out: a `CombinedLoad`.  The statics are solved at each sample:
of a tilt in the plane of the radial load, either way, and one across it, that counts which gives the shortest life.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.life.wear import LoadSamples, passed_angle
from ballpass.runtime.native.reduction_rows import SECTORS
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.elements.ball import GrooveContact
from ballpass.runtime.ratings.five_degrees import BallBearing, BallStatics, ball_statics
from ballpass.runtime.ratings.of_bearing import Ratings, contacts_of
from ballpass.runtime.ratings.tilt import ARCMIN
from ballpass.runtime.time.turning import TURN

Array = NDArray[np.float64]

#: Samples at most whose statics are solved; that of the highest radial load is one of them.
MOST_SOLVED = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedLoad:
    """A bearing under the radial loads of a run, an axial force and a tilt.

    Attributes
    ----------
    axial_force, tilt : [N], [rad]
    life : L_10r [turns]; None where the rings do not turn
    peak_force : highest load of any ball [N]
    contact_angle : largest of a loaded ball, from the radial plane [rad]
    peak_pressure : with inner and outer ring [Pa]
    reach : height above the groove's bottom that the contact reaches, of inner and outer ring [m]
    shoulder_height : of the scene [m]; None where it gives none
    factors : X, Y and e of ISO 281 for the axial force; None without one
    equivalent_load, basic_life : P = X F_r + Y F_a, mean over the run [N], and its L_10 [turns]; likewise
    """

    axial_force: float
    tilt: float
    life: float | None
    peak_force: float
    contact_angle: float
    peak_pressure: tuple[float, float]
    reach: tuple[float, float]
    shoulder_height: float | None
    factors: tuple[float, float, float] | None
    equivalent_load: float | None
    basic_life: float | None

    @property
    def words(self) -> str:
        """What it says, in sentences."""
        pressure = " and ".join(f"{each / 1e6:.0f} MPa" for each in self.peak_pressure)
        reach = " and ".join(f"{1e3 * each:.2f} mm" for each in self.reach)
        found = (
            f"Statics in five degrees of freedom (ISO 16281) with axial force {self.axial_force:.4g} N and tilt "
            f"{self.tilt / ARCMIN:.3g} arcmin: highest ball load {self.peak_force:.0f} N, contact angle up to "
            f"{math.degrees(self.contact_angle):.1f} deg; at inner and outer ring peak pressure {pressure}, and the "
            f"contact reaches {reach} above the groove's bottom."
        )
        if self.factors is not None:
            x, y, e = self.factors
            found += f" ISO 281: X {x:.2f}, Y {y:.2f} where F_a/F_r exceeds {e:.2f}."
        return (
            f"{found} Bearings of the motion resist neither: their forces and stiffness stay radial. Static safety, "
            "modified life and duty cycle include them; all other numbers are radial."
        )

    @property
    def beyond(self) -> str:
        """Warning where a contact passes its shoulder; else empty."""
        if self.shoulder_height is None or max(self.reach) <= self.shoulder_height:
            return ""
        return (
            f"axial force and tilt move a contact {1e3 * max(self.reach):.3g} mm up its groove, over the shoulder of "
            f"{1e3 * self.shoulder_height:.3g} mm: its edge cuts the contact, pressures are higher and lives shorter "
            "than here. Take an angular contact bearing, less axial force, or a larger bearing."
        )


def ball_bearing(info: BearingInfo, values: Mapping[str, float]) -> BallBearing:
    """What the statics of a bearing with balls need; `values` with derived constants."""
    inner, outer = _grooves(info, values)
    return BallBearing(
        balls=info.balls,
        ball_diameter=values[f"{info.path}.ball_diameter"],
        pitch_diameter=values[f"{info.path}.pitch_diameter"],
        grooves=(float(inner.groove_radius), float(outer.groove_radius)),
        clearance=values[f"{info.path}.clearance"],
        stiffness=values[f"{info.path}.k_b"],
    )


def combined_load(
    info: BearingInfo, values: Mapping[str, float], ratings: Ratings, samples: LoadSamples, tilt: float, *, turns: bool
) -> CombinedLoad | None:
    """Statics at the samples, and what follows; None without axial force and tilt, and where the angle is given.

    Parameters
    ----------
    tilt : of the rings against each other [rad]
    turns : whether the rings turn against each other, so that there is a life

    Raises
    ------
    RequestError
        The balls cannot carry it.
    """
    axial = info.axial_force or 0.0
    if info.element != "ball" or samples.contact_angle > 0.0 or not (axial or tilt):
        return None
    bearing, (inner, outer) = ball_bearing(info, values), _grooves(info, values)
    count = len(samples.time)
    chosen = np.unique([*np.linspace(0, count - 1, min(count, MOST_SOLVED)).astype(int), np.argmax(samples.resultant)])
    place = TURN * np.arange(info.balls) / info.balls
    rings = [angle[chosen] for angle in (samples.in_inner, samples.in_outer)]
    passed = [np.abs(passed_angle(angle))[chosen] for angle in (samples.in_inner, samples.in_outer)]
    radial = np.sum(samples.force[chosen] * np.exp(1j * (rings[1][:, None] + place)), axis=1)

    def statics(across: float, within: float) -> BallStatics:
        force = np.stack([np.abs(radial), 0.0 * passed[0], np.full(len(chosen), axial)], axis=1)
        return ball_statics(bearing, force, tilt=(across, within), ball_angle=rings[1] - np.angle(radial))

    def lasts(found: BallStatics) -> float:
        loads = [
            life.KILO
            * life.sector_ball_load(list(_powers(found.ball_load / life.KILO, angle[:, None] + place, by, power)), of)
            for angle, by in zip(rings, passed, strict=True)
        ]
        with np.errstate(divide="ignore"):  # no load: no end
            return float(life.reference_life((ratings.inner_ball, ratings.outer_ball), (loads[0], loads[1]), of))

    of, power = ratings.life, float(ratings.life.turning)
    found = [statics(*each) for each in (((0.0, tilt), (0.0, -tilt), (tilt, 0.0)) if tilt else ((0.0, 0.0),))]
    lives = [lasts(each) for each in found] if turns else None
    worst = found[int(np.argmin(lives or [-each.ball_load.max() for each in found]))]
    load, loaded = worst.ball_load, worst.ball_load > 0.0
    angle = np.abs(worst.contact_angle[loaded])
    factors = equivalent = None
    if axial:
        nominal = life.table_angle(axial, info.balls, bearing.ball_diameter)
        factors = life.axial_factors(nominal, deep_groove=True)
        each = life.combined_load(np.abs(radial), axial, nominal, deep_groove=True)
        turned = np.abs(passed_angle(samples.in_outer) - passed_angle(samples.in_inner))[chosen]
        equivalent = float(
            np.average(each ** float(of.basic), weights=turned if turns else None) ** float(1 / of.basic)
        )
    return CombinedLoad(
        axial_force=axial,
        tilt=tilt,
        life=min(lives) if lives else None,
        peak_force=float(load.max()),
        contact_angle=float(angle.max(initial=0.0)),
        peak_pressure=(float(inner.peak_pressure(load.max())), float(outer.peak_pressure(load.max()))),
        reach=(_reach(inner, load[loaded], angle), _reach(outer, load[loaded], angle)),
        shoulder_height=info.shoulder_height,
        factors=factors,
        equivalent_load=equivalent,
        basic_life=float(life.basic_life(ratings.dynamic, equivalent, of)) if equivalent and turns else None,
    )


def _grooves(info: BearingInfo, values: Mapping[str, float]) -> tuple[GrooveContact, GrooveContact]:
    inner, outer = contacts_of(info, values)
    assert isinstance(inner, GrooveContact)
    assert isinstance(outer, GrooveContact)
    return inner, outer


def _reach(contact: GrooveContact, load: Array, angle: Array) -> float:
    """Height above the groove's bottom that the edges of contacts reach [m]."""
    across, _ = contact.semi_axes(load)
    edge = np.minimum(angle + across / contact.groove_radius, math.pi)
    return float(np.max(contact.groove_radius * (1.0 - np.cos(edge)), initial=0.0))


def _powers(load: Array, angle: Array, passed: Array, power: float) -> Array:
    """Mean power of the loads that pass each place of a raceway; places that no sample meets are left out."""
    sector = np.minimum((SECTORS * (angle / TURN % 1.0)).astype(int), SECTORS - 1).ravel()
    weight = np.broadcast_to(passed[:, None], load.shape).ravel()
    number = np.bincount(sector, weight, SECTORS)
    return np.asarray(np.bincount(sector, weight * load.ravel() ** power, SECTORS)[number > 0.0] / number[number > 0.0])
