"""Rating life along a run, and its derivative.

In: the data of a run for a kind of quantity.  Out: an `Estimate` in turns of the inner ring against the outer one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.native.reduction_rows import LOAD_POWERS, POWERS, SECTORS, TURNED
from ballpass.runtime.quantity.panels import GAUSS, WEIGHTS
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, ReducedRuns, View
from ballpass.runtime.ratings.life import ElementLife
from ballpass.runtime.ratings.of_bearing import Ratings, ratings_of, refuse_swinging
from ballpass.runtime.ratings.readings import KILO, LoadPowers, lives
from ballpass.runtime.ratings.readings import KINDS as READINGS_OF
from ballpass.runtime.run.driver_angle import TURN, set_moving, shaft_speed
from ballpass.runtime.run.reductions import load_powers

Array = NDArray[np.float64]

#: A number or an array, and its derivative, with an axis of directions behind.
Dual = tuple[float | Array, Array]

#: Angle of ball 1 as the rings see it, outer and inner, behind the bearing's prefix.
PLACES = ("cage.in_outer", "cage.in_inner")

#: Rate at Gauss's nodes of what has values there, over the part of a panel: that of the polynomial through them.
_POWERS = np.vander(GAUSS, increasing=True)
RATE = np.arange(len(GAUSS)) * np.pad(_POWERS, ((0, 0), (1, 0)))[:, :-1] @ np.linalg.inv(_POWERS)

#: Step along the imaginary axis that gives the derivatives of powers of means: no difference is taken, so that none
#: cancels, however small it is (Squire and Trapp 1998) [1].
IMAGINARY = 1e-100


def life(view: View, quantity: Quantity, readings: Sequence[str]) -> Estimate:
    """Life by the reading that gives the shortest one [turns], see `ballpass.runtime.ratings.readings`.

    Raises
    ------
    RequestError
        The bearing does not turn.
    """
    _check(view.manifest, view.numbers.values, quantity)
    bearing, prefix = _bearing(view.manifest, quantity), quantity.channel.removesuffix("ball.force")
    ratings = ratings_of(bearing, view.numbers.values)
    passes = _over_passes(view, prefix)
    powers, moved_powers = (
        replace(one, inner_stands=bearing.stands_inside(view.numbers.values))
        for one in _powers(passes, quantity, prefix, ratings.life, raceways="sectors" in readings)
    )
    found = lives(ratings, powers)
    shortest = min(readings, key=lambda reading: found[reading])
    notes = (f"of {shortest}",) if len(readings) > 1 else ()
    value, slope = float(found[shortest]), np.zeros(view.directions)
    if np.isfinite(value) and view.directions:
        slope = np.imag(lives(_moved_ratings(view, bearing, ratings), moved_powers)[shortest]) / IMAGINARY
    return Estimate(value=value, slope=slope, notes=notes)


def _bearing(manifest: Manifest, quantity: Quantity) -> BearingInfo:
    return next(one for one in manifest.bearings if one.prefix + "ball.force" == quantity.channel)


def _check(manifest: Manifest, values: Mapping[str, float], quantity: Quantity) -> None:
    moving = {**values, **set_moving(manifest, values)}
    refuse_swinging(_bearing(manifest, quantity), moving, shaft_speed(manifest, moving))


def _moved(dual: Dual) -> NDArray[np.complex128]:
    """A number moved along each direction, shape (directions, ...)."""
    value, slope = dual
    return np.asarray(value + 1j * IMAGINARY * np.moveaxis(slope, -1, 0), dtype=complex)


def _moved_ratings(view: View, bearing: BearingInfo, ratings: Ratings) -> Ratings:
    """Ratings with Q_ci and Q_ce moved along the directions [N]."""
    values = view.numbers.values
    names = [name for name in view.numbers.parameters if name.startswith(f"{bearing.path}.")]
    every = casadi.SX.sym("parameters", len(names))
    symbols = ratings_of(bearing, dict(zip(names, casadi.vertsplit(every), strict=True)))
    each = casadi.vertcat(symbols.inner_ball, symbols.outer_ball)
    slopes = casadi.Function("slopes", [every], [casadi.jacobian(each, every)])([values[name] for name in names])
    seeds = np.array([view.slopes(name) for name in names]).reshape(len(names), view.directions)
    inner, outer = np.asarray(slopes) @ seeds
    return replace(
        ratings, inner_ball=_moved((ratings.inner_ball, inner)), outer_ball=_moved((ratings.outer_ball, outer))
    )


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


def _powers(
    view: View, quantity: Quantity, prefix: str, of: ElementLife, *, raceways: bool
) -> tuple[LoadPowers, LoadPowers]:
    """Means over the passes of powers of the loads, and the same moved along the directions."""
    signal = view.signals[quantity.channel]
    load = np.maximum(signal.value, 0.0) / KILO
    moved = np.where(signal.value[:, :, None] > 0.0, signal.slope, 0.0) / KILO

    def over_balls(power: float) -> tuple[Array, Array]:
        slopes = np.einsum("nb,nbd->nd", power * load ** (power - 1.0), moved)
        return np.mean(load**power, axis=1), slopes / load.shape[1]

    more, more_slope = over_balls(float(of.standing))
    root = float(1 / of.weibull)
    inverse = np.where(more > 0.0, more, np.inf) ** (root - 1.0)
    duals: dict[str, Dual] = {
        "turning": view.mean(*over_balls(float(of.turning))),
        "standing": view.mean(more, more_slope),
        "standing_damage": view.mean(more**root, root * inverse[:, None] * more_slope),
    }
    if raceways:
        values, slopes = zip(
            *(_raceway(view, load, moved, float(of.turning), prefix + place) for place in PLACES), strict=True
        )
        duals["raceways"] = np.stack(values), np.stack(slopes)
    return (
        LoadPowers(**{name: value for name, (value, _) in duals.items()}),
        LoadPowers(**{name: _moved(dual) for name, dual in duals.items()}),
    )


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


def _reduced(runs: ReducedRuns, quantity: Quantity, readings: Sequence[str]) -> Array:
    bearing = _bearing(runs.manifest, quantity)
    # powers of numbers and of arrays differ in the last bit
    values = {name: np.atleast_1d(value) for name, value in runs.values.items()}
    found = lives(ratings_of(bearing, values), load_powers(runs.manifest, bearing, runs.rows, values))
    return np.asarray(np.min([found[reading] for reading in readings], axis=0))


def _needs(channel: str, readings: Sequence[str]) -> tuple[str, ...]:
    # what every place of the raceways has met needs no root of a load
    powers = (POWERS[0].name, TURNED) if tuple(readings) == ("sectors",) else LOAD_POWERS
    return tuple(channel.removesuffix("ball.force") + name for name in powers)


def _kind(name: str) -> Kind:
    readings = READINGS_OF[name]
    reading = f"reading {readings[0]}" if len(readings) == 1 else "shortest reading"
    which = reading if len(readings) == 1 else "by the reading that gives the shortest"
    return Kind(
        name=name,
        summary=f"rating life of the bearing in turns, ISO 16281, {which}",
        words=f"Rating life, {reading}",
        takes="bearing",
        unit="turns",
        check=_check,
        evaluate=lambda view, quantity: life(view, quantity, readings),
        steep=True,
        beside=PLACES,
        reduced=lambda runs, quantity: _reduced(runs, quantity, readings),
        needs=lambda channel: _needs(channel, readings),
        rows=("integral",),
    )


KINDS = tuple(_kind(name) for name in READINGS_OF)
