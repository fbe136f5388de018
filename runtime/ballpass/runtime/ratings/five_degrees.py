"""Statics of a deep groove ball bearing in five degrees of freedom: radial and axial load, moments or tilt.

In: geometry, loads, angle of a ball.  Out: `BallStatics`: displacements, load and contact angle of each ball,
stiffness.  One call solves many loads at once, in NumPy.  The work of the contacts is a convex function of the
displacements, so that the equilibrium is found from any start.  Source: ISO 16281:2008.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.contract.errors import RequestError

Array = NDArray[np.float64]

#: Residual over the load that counts as zero [1], and Newton steps and halvings of each at most.
RESIDUAL, STEPS, HALVINGS = 1e-9, 200, 40
#: Share of the mean stiffness that is added where the load leaves a direction free: it decides the step only.
REGULAR = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class BallBearing:
    """What the statics of a ball bearing follow from.

    Attributes
    ----------
    balls : Z
    ball_diameter, pitch_diameter : D_w, D_pw [m]
    grooves : r_i and r_e [m]
    clearance : diametral, s; negative is preload [m]
    stiffness : c_p, load of a ball over its deflection to the power 1.5, both contacts [N/m^1.5]
    """

    balls: int
    ball_diameter: float
    pitch_diameter: float
    grooves: tuple[float, float]
    clearance: float
    stiffness: float

    @property
    def apart(self) -> float:
        """Distance of the grooves' centres where a ball just touches both, A [m]."""
        return sum(self.grooves) - self.ball_diameter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BallStatics:
    """Equilibrium of the inner ring against the outer one, for each load.

    Attributes
    ----------
    displacement : δ_x, δ_y, δ_a [m], θ_x, θ_y [rad]; from the middle, shape (loads, 5)
    ball_load : shape (loads, balls) [N]
    contact_angle : of each ball, zero in the radial plane, shape (loads, balls) [rad]
    stiffness : derivatives of the load F_x, F_y, F_a, M_x, M_y by the displacements, shape (loads, 5, 5) [SI]
    load : F_x, F_y, F_a [N], M_x, M_y [N m]: those given, and the moments that hold a given tilt, shape (loads, 5)
    """

    displacement: Array
    ball_load: Array
    contact_angle: Array
    stiffness: Array
    load: Array


def contact_forces(bearing: BallBearing, displacement: Array, ball_angle: ArrayLike = 0.0) -> BallStatics:
    """Loads of balls and rings at given displacements.

    Parameters
    ----------
    displacement : see `BallStatics`
    ball_angle : of ball 1 from the x axis, one or one of each load [rad]
    """
    angle = np.broadcast_to(np.asarray(ball_angle, float), displacement.shape[:1])[:, None]
    angle = angle + 2.0 * np.pi * np.arange(bearing.balls) / bearing.balls
    cosine, sine, arm = np.cos(angle), np.sin(angle), 0.5 * bearing.pitch_diameter
    lever = np.zeros((*angle.shape, 2, 5))  # of the groove's centre at each ball, radially and axially
    lever[..., 0, 0], lever[..., 0, 1], lever[..., 1, 2] = cosine, sine, 1.0
    lever[..., 1, 3], lever[..., 1, 4] = arm * sine, -arm * cosine
    moved = np.einsum("njkq,nq->njk", lever, displacement) - [0.5 * bearing.clearance, 0.0]
    centre = moved + np.array([bearing.apart, 0.0])
    length = np.hypot(centre[..., 0], centre[..., 1])
    normal = centre / length[..., None]
    longer = moved[..., 0] * (centre[..., 0] + bearing.apart) + moved[..., 1] ** 2  # no difference of large numbers
    deflection = np.maximum(longer / (length + bearing.apart), 0.0)
    load = bearing.stiffness * deflection**1.5
    along = 1.5 * bearing.stiffness * np.sqrt(deflection)
    turned = load / length  # the line of contact turns with the displacement
    of_ball = turned[..., None, None] * np.eye(2)
    of_ball += (along - turned)[..., None, None] * normal[..., :, None] * normal[..., None, :]
    return BallStatics(
        displacement=displacement,
        ball_load=load,
        contact_angle=np.arctan2(centre[..., 1], centre[..., 0]),
        stiffness=np.einsum("njkq,njkl,njlr->nqr", lever, of_ball, lever, optimize=True),
        load=np.einsum("nj,njk,njkq->nq", load, normal, lever, optimize=True),
    )


def ball_statics(
    bearing: BallBearing,
    force: ArrayLike,
    *,
    tilt: ArrayLike | None = None,
    moment: ArrayLike = (0.0, 0.0),
    ball_angle: ArrayLike = 0.0,
) -> BallStatics:
    """Equilibrium under forces, and a tilt or moments.

    Parameters
    ----------
    force : F_x, F_y, F_a on the inner ring, shape (3,) or (loads, 3) [N]
    tilt : θ_x, θ_y of the inner ring, shape (2,) or (loads, 2) [rad]; None: free under the moments
    moment : M_x, M_y on the inner ring, likewise [N m]; of no effect where the tilt is given
    ball_angle : of ball 1 from the x axis, one or one of each load [rad]

    Raises
    ------
    RequestError
        No equilibrium was found: a load or a tilt is too large for the bearing.

    Examples
    --------
    >>> from ballpass.runtime.ratings.five_degrees import BallBearing, ball_statics
    >>> grooves = (0.52 * 11.5e-3, 0.53 * 11.5e-3)
    >>> bearing = BallBearing(
    ...     balls=7, ball_diameter=11.5e-3, pitch_diameter=43.5e-3, grooves=grooves, clearance=10e-6, stiffness=1.05e10
    ... )
    >>> found = ball_statics(bearing, (0.0, 0.0, 1000.0))
    >>> f"{np.degrees(found.contact_angle[0, 0]):.1f} deg"
    '16.1 deg'
    """
    forces = np.atleast_2d(np.asarray(force, float))
    count, free = len(forces), 5 if tilt is None else 3
    target = np.hstack([forces, np.broadcast_to(np.asarray(moment, float), (count, 2))])
    angle = np.broadcast_to(np.asarray(ball_angle, float), (count,))
    scale = np.array([1.0, 1.0, 1.0, *2 * (0.5 * bearing.pitch_diameter,)])[:free]  # all unknowns are lengths
    place = _start(bearing, forces)
    if tilt is not None:
        place[:, 3:] = tilt

    def at(of: NDArray[np.intp], where: Array) -> tuple[BallStatics, Array]:
        found = contact_forces(bearing, where, angle[of])
        return found, (found.load - target[of])[:, :free] / scale

    pending: NDArray[np.intp] = np.arange(count)
    for _ in range(STEPS):
        found, rest = at(pending, place[pending])
        size = np.max(np.abs(target[pending, :free] / scale), axis=1) + np.max(found.ball_load, axis=1)
        open_ = ~(np.max(np.abs(rest), axis=1) <= RESIDUAL * size)  # so that what is no number counts
        if not np.any(open_):
            break
        pending, rest = pending[open_], rest[open_]
        matrix = found.stiffness[open_][:, :free, :free] / scale[:, None] / scale
        mean = np.trace(matrix, axis1=1, axis2=2) + bearing.stiffness * math.sqrt(bearing.ball_diameter) * REGULAR
        step = -np.linalg.solve(matrix + REGULAR * mean[:, None, None] * np.eye(free), rest[..., None])[..., 0]
        far = np.max(np.abs(step), axis=1, keepdims=True) / (0.01 * bearing.ball_diameter)
        step /= np.maximum(far, 1.0)
        slope, share = np.sum(rest * step, axis=1), np.ones(len(pending))
        for _ in range(HALVINGS):  # until the work no longer rises along the step
            moved = place[pending]
            moved[:, :free] += share[:, None] * step / scale
            beyond = np.sum(at(pending, moved)[1] * step, axis=1) > 0.1 * np.abs(slope)
            if not np.any(beyond):
                break
            share[beyond] /= 2.0
        place[pending] = moved
    else:
        given = target[pending[0], :3].tolist()
        raise RequestError(
            f"The statics of a ball bearing have no equilibrium under F_x, F_y, F_a = {given} N after {STEPS} steps. "
            "Allowed: loads and tilts that the balls can carry. Check axial force, tilt and units."
        )
    return contact_forces(bearing, place, angle)


def _start(bearing: BallBearing, forces: Array) -> Array:
    """Displacements at which balls touch: the axial force on all balls, the radial one on some."""
    size = np.hypot(forces[:, 0], forces[:, 1])
    place = np.zeros((len(forces), 5))
    deep = (np.abs(forces[:, 2]) / (bearing.balls * bearing.stiffness)) ** (2.0 / 3.0)
    radial = bearing.apart - 0.5 * bearing.clearance
    reach = np.sqrt(np.maximum((bearing.apart + deep) ** 2 - radial**2, 0.0))
    place[:, 2] = np.sign(forces[:, 2]) * reach
    pressed = (5.0 * size / (bearing.balls * bearing.stiffness)) ** (2.0 / 3.0)
    pressed += np.where(forces[:, 2] == 0.0, 0.5 * max(bearing.clearance, 0.0), 0.0)
    direction = forces[:, :2] / np.where(size > 0.0, size, 1.0)[:, None]
    place[:, :2] = pressed[:, None] * direction
    return place
