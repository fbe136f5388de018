"""Tilt of a bearing's rings by misalignment and bending of the shaft, and how much its clearance leaves free: by hand.

In: lengths, load.  Out: angles [rad].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Young's modulus of a steel shaft [Pa].
SHAFT_MODULUS = 207e9
ARCMIN = math.pi / 180.0 / 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt:
    """Tilt of the rings [rad]: `misalignment`, `bending`, and of a rigid `shaft`, None where nothing is known of it.

    `free` is what the clearance leaves free.
    """

    misalignment: float | None
    bending: float | None
    free: float | None
    shaft: float | None = None

    @property
    def _parts(self) -> dict[str, float | None]:
        return {
            "misalignment": self.misalignment,
            "bending of the shaft": self.bending,
            "the shaft's motion in its bearings, at most": self.shaft,
        }

    @property
    def total(self) -> float:
        """Sum of all parts [rad]."""
        return sum(value for value in self._parts.values() if value is not None)

    @property
    def words(self) -> str:
        """What it says, in a sentence."""
        free = "" if self.free is None else f"the clearance leaves {self.free / ARCMIN:.3g} arcmin free"
        if all(value is None for value in self._parts.values()):
            known = "Misalignment and bending of the shaft are in no number here"
            return f"{known}{f'; {free}' if free else ''}."
        parts = self._parts.items()
        causes = ", ".join(f"{name} {value / ARCMIN:.3g} arcmin" for name, value in parts if value is not None)
        return f"Tilt by {causes}{f'; {free}' if free else ''}."

    @property
    def beyond(self) -> str:
        """Warning where the tilt is more than the clearance leaves free; else empty."""
        if self.free is None or self.total <= self.free:
            return ""
        return (
            f"the rings are tilted by {self.total / ARCMIN:.3g} arcmin, and the clearance leaves "
            f"{self.free / ARCMIN:.3g} arcmin free: balls at both sides are loaded by the tilt, which the motion does "
            "not have. Real lives may be far shorter. Take a thicker shaft, more clearance, or a self-aligning bearing."
        )


def free_tilt(diameter: float, pitch: float, grooves: tuple[float, float], clearance: float) -> float:
    """Angle by which the rings of an unloaded deep groove bearing tilt to one side until balls touch [rad].

    The centres of the grooves lie on circles of the radii R_i and R_o = R_i - A + P_d/2; tilted by θ, two of them are
    apart by A = r_i + r_o - D_w: cos θ = (R_i² + R_o² - A²)/(2 R_i R_o) (after Harris & Kotzalas 2006, ch. 2).

    Parameters
    ----------
    diameter, pitch, clearance : D_w, D_pw, P_d [m]
    grooves : r_i and r_o [m]
    """
    if clearance <= 0.0:
        return 0.0
    inner = pitch / 2.0 + grooves[0] - diameter / 2.0 - clearance / 4.0
    outer = pitch / 2.0 - grooves[1] + diameter / 2.0 + clearance / 4.0
    apart = grooves[0] + grooves[1] - diameter
    return math.acos((inner**2 + outer**2 - apart**2) / (2.0 * inner * outer))


def shaft_slope(load: float, span: float, shaft_diameter: float) -> float:
    """Slope of a round steel shaft at each of two supports with the load in the middle, F L²/(16 E I) [rad].

    Parameters
    ----------
    load : on the bearing, half that on the shaft [N]
    span : of the supports [m]
    """
    inertia = math.pi / 64.0 * shaft_diameter**4
    return 2.0 * load * span**2 / (16.0 * SHAFT_MODULUS * inertia)
