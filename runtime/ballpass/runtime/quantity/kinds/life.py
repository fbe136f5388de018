"""Rating life along a run, and its derivative.

In: the data of a run for a kind of quantity.  Out: an `Estimate` in turns of the inner ring against the outer one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.native.reduction_rows import SECTORS, TURNED
from ballpass.runtime.quantity.cuts import PLACES
from ballpass.runtime.quantity.panels import GAUSS, WEIGHTS
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, ReducedRuns, View
from ballpass.runtime.ratings.life import KILO, ElementLife, raceway_life
from ballpass.runtime.ratings.of_bearing import Ratings, ratings_of, why_no_life
from ballpass.runtime.run.reductions import raceway_powers
from ballpass.runtime.time.timeline import set_moving, shaft_speed
from ballpass.runtime.time.turning import TURN

Array = NDArray[np.float64]

#: A number or an array, and its derivative, with an axis of directions behind.
Dual = tuple[float | Array, Array]

#: Rate at Gauss's nodes of what has values there, over the part of a panel: that of the polynomial through them.
_POWERS = np.vander(GAUSS, increasing=True)
RATE = np.arange(len(GAUSS)) * np.pad(_POWERS, ((0, 0), (1, 0)))[:, :-1] @ np.linalg.inv(_POWERS)

#: Step along the imaginary axis that gives the derivatives of powers of means: no difference is taken, so that none
#: cancels, however small it is (Squire and Trapp 1998) [1].
IMAGINARY = 1e-100


def life(view: View, quantity: Quantity) -> Estimate:
    """Rating life by the loads at every place of both raceways [turns].

    Raises
    ------
    RequestError
        The bearing does not turn.
    """
    _check(view.manifest, view.numbers.values, quantity)
    bearing, prefix = quantity.bearing(view.manifest), quantity.channel.removesuffix("ball.force")
    ratings = ratings_of(bearing, view.numbers.values)
    powers = _powers(_over_passes(view, prefix), quantity, prefix, ratings.life)
    value, slope = float(raceway_life(_rings(ratings), powers[0], ratings.life)), np.zeros(view.directions)
    if np.isfinite(value) and view.directions:
        moved = raceway_life(_moved_rings(view, bearing, ratings), _moved(powers), ratings.life)
        slope = np.imag(moved) / IMAGINARY
    return Estimate(value=value, slope=slope)


def _rings(ratings: Ratings) -> tuple[Any, Any]:
    return ratings.inner_ball, ratings.outer_ball


def _check(manifest: Manifest, values: Mapping[str, float], quantity: Quantity) -> None:
    bearing, moving = quantity.bearing(manifest), {**values, **set_moving(manifest, values)}
    if reason := why_no_life(bearing, moving, shaft_speed(manifest, moving)):
        others = "the life of a bearing that turns, or max:ball.force"
        raise RequestError(f"{bearing.prefix}life: {reason} Allowed: {others}.")


def _moved(dual: Dual) -> NDArray[np.complex128]:
    """A number moved along each direction, shape (directions, ...)."""
    value, slope = dual
    return np.asarray(value + 1j * IMAGINARY * np.moveaxis(slope, -1, 0), dtype=complex)


def _moved_rings(view: View, bearing: BearingInfo, ratings: Ratings) -> tuple[Any, Any]:
    """Q_ci and Q_ce moved along the directions [N]."""
    slopes = view.rated_slopes(bearing, lambda values: casadi.vertcat(*_rings(ratings_of(bearing, values))))
    inner, outer = map(_moved, zip(_rings(ratings), slopes, strict=True))
    return inner, outer


def _over_passes(view: View, prefix: str) -> View:
    """The same with integrals over the angle that the inner ring turns against the outer one, in either sense."""
    nodes = view.nodes
    within = np.flatnonzero(nodes.weight).reshape(-1, len(GAUSS))
    outer, inner = (view.signals[prefix + place] for place in PLACES)
    apart = np.unwrap((outer.value - inner.value)[within, 0])  # angles come back after a turn
    turned = WEIGHTS * (apart @ RATE.T)
    moved = np.einsum("i,ij,pjd->pid", WEIGHTS, RATE, (outer.slope - inner.slope)[within, 0])
    weight, weight_slope = np.zeros_like(nodes.weight), np.zeros_like(nodes.weight_slope)
    weight[within], weight_slope[within] = np.abs(turned), np.sign(turned)[:, :, None] * moved
    return replace(view, nodes=replace(nodes, weight=weight, weight_slope=weight_slope))


def _powers(view: View, quantity: Quantity, prefix: str, of: ElementLife) -> Dual:
    """Mean powers of the loads at the places of outer and inner raceway, over the passes, and their derivatives."""
    signal = view.signals[quantity.channel]
    load = np.maximum(signal.value, 0.0) / KILO
    moved = np.where(signal.value[:, :, None] > 0.0, signal.slope, 0.0) / KILO
    rings = [_raceway(view, load, moved, float(of.turning), prefix + place) for place in PLACES]
    values, slopes = zip(*rings, strict=True)
    return np.stack(values), np.stack(slopes)


def _raceway(view: View, load: Array, moved: Array, power: float, channel: str) -> tuple[Array, Array]:
    """Mean power of the load at each place of a raceway, and its derivative."""
    angle = view.signals[channel]
    balls, nodes = load.shape[1], view.nodes
    turns = angle.value / TURN + np.arange(balls) / balls
    place = SECTORS * (turns - np.floor(turns))
    below: NDArray[np.int_] = np.minimum(place.astype(int), SECTORS - 1)
    part = place - below

    def summed(low: Array, high: Array) -> Array:
        rows = np.bincount(below.ravel(), low.ravel(), SECTORS)
        return np.asarray(rows + np.bincount((below.ravel() + 1) % SECTORS, high.ravel(), SECTORS), dtype=float)

    length, longer = view.length
    scale = SECTORS / (balls * length)
    whole = load**power
    given = nodes.weight[:, None] * whole
    field = scale * summed(given * (1.0 - part), given * part)
    slope = np.zeros((SECTORS, view.directions))
    for k in range(view.directions):
        slopes = power * load ** (power - 1.0) * moved[:, :, k]
        amount = nodes.weight_slope[:, [k]] * whole + nodes.weight[:, None] * slopes
        shift = given * (SECTORS / TURN * angle.slope[:, :, k])
        slope[:, k] = scale * summed(amount * (1.0 - part) - shift, amount * part + shift) - field * longer[k] / length
    return field, slope


def _reduced(runs: ReducedRuns, quantity: Quantity) -> Array:
    bearing = quantity.bearing(runs.manifest)
    # powers of numbers and of arrays differ in the last bit
    ratings = ratings_of(bearing, {name: np.atleast_1d(value) for name, value in runs.values.items()})
    powers = raceway_powers(runs.manifest, bearing, runs.rows)
    return np.asarray(raceway_life(_rings(ratings), powers, ratings.life))


KINDS = (
    Kind(
        name="life",
        also=("life_sectors",),
        summary="rating life of the bearing in turns, ISO 16281, from the loads at every place of both raceways",
        words="Rating life",
        takes="bearing",
        unit="turns",
        check=_check,
        evaluate=life,
        steep=True,
        beside=PLACES,
        reduced=_reduced,
        needs=lambda channel: (channel.removesuffix("ball.force") + TURNED,),
        rows=("integral",),
    ),
)
