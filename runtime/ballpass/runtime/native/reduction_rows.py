"""Rows of on-line reductions: what the driver takes of every step, and where it writes it (`driver/reductions.h`).

The tables here are the only list.  `reduction_tables` writes them as C, which is compiled with the driver: single runs,
lanes and sectors loop over them.

A row is a head and, for every channel, one number of each kind in `ROWS`.  Channels are the states, then the quantities
of the balls of each bearing, each with its value of the most loaded ball at the moment, then of each bearing the angle
that its inner ring turns against the outer one, an integral alone.  Behind all stand the places of the raceways, with
the power of the balls' loads that fatigue needs over this angle, for fatigue counts passes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.ratings.result_limits import void_words

Array: TypeAlias = NDArray[np.float64]

#: Head of a row; `equal`: extremes that differ by less, relative to themselves, are equal, and the first is taken [1].
HEAD = ("from", "duration", "equal")

#: Least of it: outputs of equal states differ by less [1].
EQUAL = 1e-10

#: Extremes of a channel, by their sign; each is a value, its time and its ball.
EXTREMES = {"max": 1, "min": -1}

#: Integrals of powers of the channel less its shift, by their exponent.  A further one is a line here: exact for
#: states, whose dense output is a polynomial; for the balls by Boole's rule in steps without a cut.
MOMENTS = {"integral": 1, "square": 2}

#: The channel that shows whether a bearing can be so.
DEFLECTION = "ball.deflection"

#: What is wanted of it in rows that do not ask for it.
GUARD = 0.5


def row_names() -> tuple[str, ...]:
    """What a row holds of every channel: first whether each extreme and each moment is wanted."""
    extremes = (f"{name}{what}" for name in EXTREMES for what in ("", "_time", "_ball"))
    return (*(f"{name}_wanted" for name in (*EXTREMES, *MOMENTS)), *extremes, "shift", *MOMENTS)


ROWS = row_names()

#: Channels of a bearing behind those of the states, without its prefix: values of the most loaded ball, in the order of
#: the generated kernel; whether they jump where a contact begins or ends.
JUMPS = {"ball.force": True, "ball.elastic_force": False, "ball.damping_force": True, "ball.deflection": False}
BALL_CHANNELS = tuple(JUMPS)


#: Angle that the inner ring turned against the outer one, behind these and the bearing's prefix [rad].
TURNED = "load.turned"

#: Places of a raceway, and the power of the loads that is added up there.
SECTORS, SECTOR_POWER = 72, "TURNING"

#: Name of the header.
REDUCTION_TABLES = "reduction_tables.h"


@dataclass(frozen=True)  # without slots: what is asked for some hundred times a run is kept
class ReductionRows:
    """Layout of the rows of a model.

    Attributes
    ----------
    states, balls, turned : names of the channels: states, quantities of the balls, angles that rings turned
    """

    states: tuple[str, ...]
    balls: tuple[str, ...]
    turned: tuple[str, ...]

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """All channels in the driver's order."""
        return (*self.states, *self.balls, *self.turned)

    @cached_property
    def columns(self) -> dict[tuple[str, str], int]:
        """Place of each entry of `ROWS` in a row, by kind and channel."""
        named = ((kind, channel) for kind in ROWS for channel in self.channels)
        return {entry: len(HEAD) + place for place, entry in enumerate(named)}

    @property
    def size(self) -> int:
        """Numbers of a row."""
        return self._sectors + 2 * SECTORS * len(self.turned)

    @property
    def _sectors(self) -> int:
        return len(HEAD) + len(ROWS) * len(self.channels)

    def raceways(self, rows: np.ndarray, prefix: str) -> np.ndarray:
        """Integrals of the power of the ball loads at the places of both raceways of a bearing, over its angle.

        Places are hat functions at equal distances, in the ring's own coordinates, from where its x axis was at the
        start.

        Returns
        -------
        numpy.ndarray
            Outer, then inner raceway, loads in kN, shape (members, 2, SECTORS).
        """
        first = self.first_place(prefix)
        return rows[:, first : first + 2 * SECTORS].reshape(len(rows), 2, SECTORS)

    def first_place(self, prefix: str) -> int:
        """Place in a row of the first place of a bearing's outer raceway; all others follow."""
        return self._sectors + 2 * SECTORS * self.turned.index(prefix + TURNED)

    def all_of(self, channels: Iterable[str]) -> list[tuple[str, str]]:
        """All extremes and moments of these channels, for `empty`."""
        return [(name, channel) for channel in channels for name in (*EXTREMES, *MOMENTS)]

    def empty(self, count: int, start: ArrayLike, wanted: Collection[tuple[str, str]], rtol: float = 0.0) -> np.ndarray:
        """Rows of reductions that count from `start` on [s], shape (count, size).

        Parameters
        ----------
        wanted : extremes and moments, each of a channel.  The highest deflection of the balls is always among them: it
            shows whether a bearing can be so.
        rtol : relative tolerance of the runs [1]
        """
        rows = np.zeros((count, self.size))
        rows[:, HEAD.index("from")], rows[:, HEAD.index("equal")] = start, max(rtol, EQUAL)
        for channel in self.channels:
            if channel.endswith(DEFLECTION):
                rows[:, self.columns["max_wanted", channel]] = GUARD
        for name, channel in wanted:
            rows[:, self.columns[f"{name}_wanted", channel]] = 1.0
        return rows


def void_moment(manifest: Manifest, values: Mapping[str, float], row: Array) -> tuple[str, float] | None:
    """Why a run means nothing, and when its largest deflection is [s]; None where it is not void."""
    columns = reduction_rows(manifest).columns
    for bearing in manifest.bearings:
        channel = bearing.prefix + DEFLECTION
        if words := void_words(bearing, values, float(row[columns["max", channel]])):
            return words, float(row[columns["max_time", channel]])
    return None


@lru_cache(maxsize=1)
def reduction_tables() -> str:
    """Text of the header ``reduction_tables.h``."""
    nodes, weights = np.polynomial.legendre.leggauss(2 * max(MOMENTS.values()) + 1)
    looked_at = f"BP_NX + {len(BALL_CHANNELS)} * BP_BEARINGS"
    places = (f"BP_{name.upper()} = {k}" for k, name in enumerate(HEAD))
    kinds = {name: f"{len(HEAD)} + {k} * BP_CHANNELS" for k, name in enumerate(ROWS)}
    end = f"{len(HEAD)} + {len(ROWS)} * BP_CHANNELS"
    return f"""\
/* What on-line reductions take of a step, from native/reduction_rows.py: do not edit. */
#ifndef BALLPASS_REDUCTION_TABLES_H
#define BALLPASS_REDUCTION_TABLES_H

enum {{
    BP_BALL_CHANNELS = {len(BALL_CHANNELS)},
    BP_DAMPING = {BALL_CHANNELS.index("ball.damping_force")},
    BP_DEFLECTION = {BALL_CHANNELS.index("ball.deflection")}, /* among them */
    BP_SECTORS = {SECTORS},  /* of a raceway */
    BP_EXTREMES = {len(EXTREMES)},
    BP_MOMENTS = {len(MOMENTS)},
    BP_LOOKED_AT = {looked_at}, /* channels with extremes and moments */
    BP_CHANNELS = BP_LOOKED_AT + BP_BEARINGS
}};

/* Places in a row: the head, then BP_CHANNELS entries of each kind.  An extreme is a value, its time and its ball;
   moments follow each other.  Behind them integrals of the power of the loads: of each bearing outer, then inner
   raceway. */
enum {{
    {", ".join(places)},
    BP_WANTED = {kinds[ROWS[0]]}, /* extremes, then moments: 0 where it is not */
    BP_WANTED_MOMENT = BP_WANTED + BP_EXTREMES * BP_CHANNELS,
    BP_EXTREME = {kinds[next(iter(EXTREMES))]},
    BP_SHIFT = {kinds["shift"]},
    BP_MOMENT = {kinds[next(iter(MOMENTS))]},
    BP_RACEWAYS = {end},
    BP_REDUCTION = BP_RACEWAYS + 2 * BP_SECTORS * BP_BEARINGS
}};

/* Whether channels of the balls jump where a contact begins or ends; signs of the extremes. */
static const int bp_jumps[BP_BALL_CHANNELS] = {{{", ".join(str(int(jumps)) for jumps in JUMPS.values())}}};
static const double bp_sign[BP_EXTREMES] = {{{", ".join(f"{sign:.1f}" for sign in EXTREMES.values())}}};

/* Exponents of the moments. */
#define BP_EACH_MOMENT(DO) {" ".join(f"DO({k}, {degree})" for k, degree in enumerate(MOMENTS.values()))}

/* Gauss's rule that is exact for these powers of a polynomial of degree four, over -2 ... 2. */
enum {{ BP_GAUSS = {len(nodes)} }};
static const double bp_gauss[BP_GAUSS] = {{{", ".join(repr(2.0 * float(s)) for s in nodes)}}};
static const double bp_gauss_weight[BP_GAUSS] = {{{", ".join(repr(0.5 * float(s)) for s in weights)}}};

/* Power of the loads of bearing b that damages a place, as a fraction. */
#define BP_SECTOR_POWER(b) BP_##b##_{SECTOR_POWER}, BP_##b##_{SECTOR_POWER}_BY

#endif
"""


def moments_of(shift: Array, integral: Array, square: Array, duration: Array) -> tuple[Array, Array]:
    """Mean and standard deviation over a time, from integrals about a shift; infinite where squares overflow."""
    apart = integral / duration
    with np.errstate(over="ignore", invalid="ignore"):
        variance = square / duration - apart**2
    return shift + apart, np.sqrt(np.where(variance >= 0.0, variance, np.where(np.isnan(variance), np.inf, 0.0)))


def rms_of(mean: Array, std: Array) -> Array:
    """Root mean square with the mean in it."""
    return np.asarray(np.hypot(mean, std))


def reduction_rows(manifest: Manifest) -> ReductionRows:
    """Layout of the rows of a model."""
    return _rows(tuple(state.name for state in manifest.states), tuple(one.prefix for one in manifest.bearings))


@lru_cache(maxsize=64)
def _rows(states: tuple[str, ...], prefixes: tuple[str, ...]) -> ReductionRows:
    return ReductionRows(
        states=states,
        balls=tuple(prefix + name for prefix in prefixes for name in BALL_CHANNELS),
        turned=tuple(prefix + TURNED for prefix in prefixes),
    )
