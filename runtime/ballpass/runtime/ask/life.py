"""Rating life along a run, and its derivative.

In: what a kind of quantity sees of a run.  Out: an `Estimate` in turns of the inner ring against the outer one.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.quantity_records import Estimate, Quantity, View
from ballpass.runtime.contract import BearingInfo
from ballpass.runtime.native.reduction_rows import SECTORS
from ballpass.runtime.ratings.life import MILLION
from ballpass.runtime.ratings.of_bearing import ratings_of, refuse_swinging
from ballpass.runtime.ratings.readings import KILO
from ballpass.runtime.run.inputs import TURN, shaft_speed

Array = NDArray[np.float64]

#: A number and its derivative along the directions.
Dual = tuple[float, Array]

#: Angle of ball 1 as the rings see it, outer and inner, behind the bearing's prefix.
PLACES = ("cage.in_outer", "cage.in_inner")


def bearing_of(view: View, quantity: Quantity) -> BearingInfo:
    """The bearing whose balls the quantity's channel is of."""
    prefix = quantity.channel.removesuffix("ball.force")
    return next(bearing for bearing in view.manifest.bearings if bearing.prefix == prefix)


def life(view: View, quantity: Quantity, readings: Sequence[str]) -> Estimate:
    """Life by the reading that gives the shortest one [turns], see `ballpass.runtime.ratings.readings`.

    Raises
    ------
    RequestError
        The bearing does not turn.
    """
    bearing = bearing_of(view, quantity)
    refuse_swinging(bearing, view.numbers.values, shaft_speed(view.manifest, view.numbers.values))
    balls = _ball_ratings(view, bearing)
    loads = _equivalent_loads(view, quantity, bearing, readings)
    found = {reading: _reference_life(balls, loads[reading]) for reading in readings}
    shortest = min(found, key=lambda reading: found[reading][0])
    notes = (f"of {shortest}",) if len(readings) > 1 else ()
    value, slope = found[shortest]
    return Estimate(value=value, slope=slope, notes=notes)


def _reference_life(balls: Sequence[Dual], loads: Sequence[Dual]) -> Dual:
    """ISO 16281's life, see `ballpass.runtime.ratings.life.reference_life`."""
    total, moved = 0.0, 0.0 * balls[0][1]
    for (rating, rating_slope), (load, load_slope) in zip(balls, loads, strict=True):
        part = (load / rating) ** (10.0 / 3.0)
        total += part
        moved = moved + 10.0 / 3.0 * part * ((load_slope / load if load else 0.0) - rating_slope / rating)
    if total == 0.0:
        return np.inf, moved
    value = MILLION * total**-0.9
    return value, -0.9 * value / total * moved


def _ball_ratings(view: View, bearing: BearingInfo) -> list[Dual]:
    """Q_ci and Q_ce [N]."""
    names = [name for name in view.numbers.parameters if name.startswith(f"{bearing.path}.")]
    symbols = {name: casadi.SX.sym(name) for name in names}
    found = ratings_of(bearing, symbols)
    each = casadi.vertcat(found.inner_ball, found.outer_ball)
    every = casadi.vertcat(*symbols.values())
    function = casadi.Function("ratings", [every], [each, casadi.jacobian(each, every)])
    values, slopes = (np.asarray(item) for item in function([view.numbers.values[name] for name in names]))
    seeds = np.array([view.slopes(name) for name in names]).reshape(len(names), view.directions)
    return [(float(value), slope @ seeds) for value, slope in zip(values[:, 0], slopes, strict=True)]


def _equivalent_loads(
    view: View, quantity: Quantity, bearing: BearingInfo, readings: Sequence[str]
) -> dict[str, tuple[Dual, Dual]]:
    """Q_ei and Q_ee of readings [N]: `readings.equivalent_loads`, with derivatives."""
    signal = view.signals[quantity.channel]
    load = np.maximum(signal.value, 0.0) / KILO
    moved = np.where(signal.value[:, :, None] > 0.0, signal.slope, 0.0) / KILO

    def over_balls(power: float) -> tuple[Array, Array]:
        slopes = np.einsum("nb,nbd->nd", power * load ** (power - 1.0), moved)
        return np.mean(load**power, axis=1), slopes / load.shape[1]

    cubes = _mean(view, *over_balls(3.0))
    more, more_slope = over_balls(10.0 / 3.0)
    cubic = _root(cubes, 1.0 / 3.0)
    found = {}
    if "mean" in readings:
        found["mean"] = (cubic, _root(_mean(view, more, more_slope), 0.3))
    if "miner" in readings:
        inverse = np.where(more > 0.0, more, np.inf) ** -0.1
        damage = _mean(view, more**0.9, 0.9 * inverse[:, None] * more_slope)
        found["miner"] = (cubic, _root(damage, 1.0 / 3.0))
    if "sectors" in readings:
        outer, inner = (_over_raceway(view, load, moved, bearing.prefix + place) for place in PLACES)
        found["sectors"] = (inner, outer)
    return found


def _mean(view: View, values: Array, slopes: Array) -> Dual:
    """Mean over time."""
    total, moved = view.integral(values, slopes)
    length, longer = view.length
    mean = total.real / length
    return mean, (moved.real - mean * longer) / length


def _root(dual: Dual, exponent: float) -> Dual:
    """A power of a mean in kN, in N."""
    value, slope = dual
    if value == 0.0:
        return 0.0, 0.0 * slope
    result = KILO * value**exponent
    return result, exponent * result / value * slope


def _over_raceway(view: View, load: Array, moved: Array, channel: str) -> Dual:
    """Q_e of a raceway from the third power of the load at each of its places [N]."""
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
    cube = load**3
    given = nodes.weight[:, None] * cube
    field = scale * summed(given * (1.0 - part), given * part)
    mean = float(np.mean(field ** (10.0 / 9.0)))
    slope = np.zeros(view.directions)
    for k in range(view.directions):
        amount = nodes.weight_slope[:, [k]] * cube + nodes.weight[:, None] * 3.0 * load**2 * moved[:, :, k]
        shift = given * (SECTORS / TURN * angle.slope[:, :, k])
        change = scale * summed(amount * (1.0 - part) - shift, amount * part + shift) - field * longer[k] / length
        slope[k] = np.mean(10.0 / 9.0 * field ** (1.0 / 9.0) * change)
    return _root((mean, slope), 0.3)
