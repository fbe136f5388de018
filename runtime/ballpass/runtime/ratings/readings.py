"""Ways to get a rating life from a history of ball loads: mean over time, Miner's rule, sectors of the raceways.

In: mean powers of the loads over the passes.  Out: equivalent loads of both rings [N], lives [turns].

A history has more than one reading.  `mean` takes ISO 16281's means over the balls, one ring turning against the load
and the other standing, over the passes as well.  The ring that stands is the outer one, or the inner one where that
stands in the frame and the outer one turns.  `miner` takes the damage of the standing ring at every instant and
adds it up.  `sectors` asks no ring to stand or to turn: it adds up what every place of each raceway has met, in the
ring's own coordinates, and reduces to either mean where the load stands or turns.  Where a load turns with the shaft,
as a punch's, one place of the inner raceway meets it in every turn, and `mean` is on the unsafe side.

Damage counts passes: means are over the angle that the inner ring turns against the outer one, which is time where the
speeds are constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ballpass.runtime.ratings.life import ElementLife, reference_life, sector_ball_load
from ballpass.runtime.ratings.of_bearing import Ratings

KILO = 1e3

#: Readings, and their descriptions.
READINGS = {
    "mean": "ISO 16281, one ring turning against the load, the other standing, means over the passes",
    "miner": "the same, the damage of the ring that stands added up instant by instant",
    "sectors": "damage of every place of both raceways, the ring as it turns",
}

#: What a row of a table says of a reading.
SHORT_READINGS = {"mean": "loads averaged", "miner": "damage added up", "sectors": "damage by place"}

#: Quantities: the readings that each takes the shortest life of.
KINDS = {"life": tuple(READINGS), **{f"life_{reading}": (reading,) for reading in READINGS}}


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadPowers:
    """Means over the passes, loads in kN; each of shape (members,) or a number, `raceways` with two axes more.

    Attributes
    ----------
    turning : of the power of the balls' loads that damages a turning ring, over the balls as well; of balls [kN^3]
    standing : of the power that damages a standing ring; of balls [kN^(10/3)]
    standing_damage : of the mean over the balls of the latter, to the power that makes damage of it; of balls [kN^3]
    inner_stands : whether the inner ring makes no whole turns, and the outer one does
    raceways : of the first power at each place of the outer, then of the inner raceway, over the balls that pass,
        shape (..., 2, places) ; None where it is not known
    """

    turning: Any
    standing: Any
    standing_damage: Any
    inner_stands: Any = False
    raceways: Any = None


def equivalent_loads(powers: LoadPowers, of: ElementLife) -> Mapping[str, tuple[Any, ...]]:
    """Q_ei and Q_ee of every reading [N]; not of `sectors` where the raceways are not known."""
    root = float(1 / of.turning)
    turning = KILO * powers.turning**root
    pairs = {
        "mean": (turning, KILO * powers.standing ** float(1 / of.standing)),
        "miner": (turning, KILO * powers.standing_damage**root),
    }
    found = {
        name: tuple(np.where(powers.inner_stands, *both) for both in (pair[::-1], pair)) for name, pair in pairs.items()
    }
    if powers.raceways is not None:
        places = (np.moveaxis(powers.raceways[..., ring, :], -1, 0) for ring in (1, 0))
        found["sectors"] = tuple(KILO * sector_ball_load(place, of) for place in places)
    return found


def lives(ratings: Ratings, powers: LoadPowers) -> dict[str, Any]:
    """Life by every reading [turns], infinite without a load."""
    balls = ratings.inner_ball, ratings.outer_ball
    found = {}
    with np.errstate(divide="ignore"):
        for name, (inner, outer) in equivalent_loads(powers, ratings.life).items():
            # arrays: a number of Python's that is zero has no reciprocal
            found[name] = reference_life(balls, (np.asarray(inner), np.asarray(outer)), ratings.life)
    return found
