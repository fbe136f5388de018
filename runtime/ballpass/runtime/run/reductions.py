"""On-line reductions of a run: extremes with their times, mean and rms of channels.

In: rows that the driver has written (`ballpass.runtime.native.reduction_rows`).  Out: `Reductions`.  The
driver evaluates every accepted step in its quarters and refines extremes from its own dense output, so that what is
found does not depend on samples, and a run of any length takes the same memory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.reduction_rows import (
    BALL_CHANNELS,
    HEAD,
    ROWS,
    SECTORS,
    TURNED,
    ReductionRows,
    moments_of,
    reduction_rows,
    rms_of,
)
from ballpass.runtime.show import html
from ballpass.runtime.show.short import ShortRepr


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduction:
    """What is kept of one channel.

    Attributes
    ----------
    maximum, minimum : extremes, in the unit of the channel
    maximum_time, minimum_time : when [s]
    maximum_ball, minimum_ball : the ball, counted from 1; None for a state
    mean : over time
    std : root mean square of the deviation from the mean

    Examples
    --------
    >>> force = model.reduce(cycles=3, transient=2)["ball.force"]
    >>> round(force.maximum, -1), round(force.mean, -1)  # [N]
    (4390.0, 270.0)
    """

    maximum: float
    maximum_time: float
    maximum_ball: int | None
    minimum: float
    minimum_time: float
    minimum_ball: int | None
    mean: float
    std: float

    @property
    def rms(self) -> float:
        """Plain root mean square over time, with the mean in it."""
        return float(rms_of(np.array(self.mean), np.array(self.std)))

    @property
    def range(self) -> float:
        """Maximum less minimum."""
        return self.maximum - self.minimum


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Reductions(ShortRepr, Mapping[str, Reduction]):
    """Reductions of a run by channel: ``reductions["ball.force"].maximum``.

    Attributes
    ----------
    channels : what is reduced
    start, duration : the time that counts, from the end of the transient on [s]
    end : state at the end, by name
    steps, rejected : of the whole run
    cycle_length : time of a turn, None when nothing turns [s]

    Examples
    --------
    >>> found = model.reduce(cycles=3, transient=2)
    >>> round(1e6 * found["inner.y"].range, 1)  # [um]
    362.9
    >>> f"{found.duration / model.period():.1f} turns behind the transient"
    '1.0 turns behind the transient'
    """

    channels: Mapping[str, Reduction]
    start: float
    duration: float
    end: Mapping[str, float]
    steps: int
    rejected: int
    cycle_length: float | None

    def _repr_html_(self) -> str:
        span = f"from {self.start:.6g} s on, over {self.duration:.6g} s; {self.steps} steps"
        return html.block(html.title("Extremes and means of every step, SI", span), self.table_html())

    def table_html(self) -> str:
        """The table as HTML, for a larger block of a notebook."""
        heads = ("min", "mean", "rms", "max", "max at [s]", "ball")
        rows = [
            (
                name,
                *(f"{number:z.6g}" for number in (one.minimum, one.mean, one.rms, one.maximum, one.maximum_time)),
                one.maximum_ball or "",
            )
            for name, one in self.channels.items()
        ]
        return html.table(("channel", *heads), rows, right=heads)

    def __getitem__(self, name: str) -> Reduction:
        try:
            return self.channels[name]
        except KeyError:
            raise KeyError(unknown_name("channel", name, self.channels)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return len(self.channels)

    @staticmethod
    def from_facts(facts: Mapping[str, Any]) -> Reductions:
        """Reductions from what `dataclasses.asdict` gave of some."""
        channels = {name: Reduction(**entry) for name, entry in facts["channels"].items()}
        return Reductions(**{**facts, "channels": channels})


def channel_names(manifest: Manifest) -> tuple[str, ...]:
    """Channels that mean something, in the driver's order; without damping there is no damping force."""
    balls = [
        bearing.prefix + name
        for bearing in manifest.bearings or ()
        for name in BALL_CHANNELS
        if bearing.damping.acts or name != "ball.damping_force"
    ]
    return (*(state.name for state in manifest.states), *balls)


def reduced_channels(manifest: Manifest, outputs: Sequence[str]) -> tuple[str, ...]:
    """Channels that a run reduces beside its samples: the states and the outputs it keeps; none where it keeps none."""
    balls = reduction_rows(manifest).balls
    return tuple(name for name in channel_names(manifest) if outputs and (name in outputs or name not in balls))


def reductions_of(
    manifest: Manifest,
    row: np.ndarray,
    names: Sequence[str],
    *,
    end: np.ndarray,
    steps: int,
    rejected: int,
    turn: float,
) -> Reductions | None:
    """What a row holds of the channels `names`; None where nothing was reduced.

    Parameters
    ----------
    end : state at the end, shape (states,)
    steps, rejected : of the run
    turn : time of a turn, infinite where nothing turns [s]
    """
    rows = reduction_rows(manifest)
    duration = float(row[HEAD.index("duration")])
    if not duration > 0.0:
        return None
    return Reductions(
        channels=_channels(rows, row, names, duration),
        start=float(row[HEAD.index("from")]),
        duration=duration,
        end=dict(zip(rows.states, end.tolist(), strict=True)),
        steps=steps,
        rejected=rejected,
        cycle_length=turn if math.isfinite(turn) else None,
    )


def reduction_of(rows: ReductionRows, row: np.ndarray, channel: str, duration: float) -> Reduction:
    """What a row holds of a channel over its duration [s]."""
    return _channels(rows, row, (channel,), duration)[channel]


def _channels(rows: ReductionRows, row: np.ndarray, names: Sequence[str], duration: float) -> dict[str, Reduction]:
    places = [[rows.columns[kind, name] for name in names] for kind in ROWS]
    entries = dict(zip(ROWS, row[places], strict=True))
    means, stds = moments_of(entries["shift"], entries["integral"], entries["square"], np.array(duration))
    of = {kind: values.tolist() for kind, values in entries.items()} | {"mean": means.tolist(), "std": stds.tolist()}
    return {
        name: Reduction(
            maximum=of["max"][k],
            maximum_time=of["max_time"][k],
            maximum_ball=int(of["max_ball"][k]) if name in rows.balls else None,
            minimum=of["min"][k],
            minimum_time=of["min_time"][k],
            minimum_ball=int(of["min_ball"][k]) if name in rows.balls else None,
            mean=of["mean"][k],
            std=of["std"][k],
        )
        for k, name in enumerate(names)
    }


def joined(first: Reductions | None, second: Reductions | None) -> Reductions | None:
    """Reductions of a time and of the one behind it, as of both together."""
    if first is None or second is None:
        return first or second
    length = first.duration + second.duration
    return replace(
        second,
        channels={
            name: _joined(first[name], second[name], first.duration / length, second.duration / length)
            for name in second.channels
        },
        start=first.start,
        duration=length,
    )


def _joined(first: Reduction, second: Reduction, share: float, rest: float) -> Reduction:
    # Chan, Golub & LeVeque 1983: from deviations, not from raw squares
    apart = second.mean - first.mean
    high = first if first.maximum >= second.maximum else second
    low = first if first.minimum <= second.minimum else second
    return replace(
        high,
        minimum=low.minimum,
        minimum_time=low.minimum_time,
        minimum_ball=low.minimum_ball,
        mean=first.mean + rest * apart,
        std=math.sqrt(share * first.std**2 + rest * second.std**2 + share * rest * apart**2),
    )


def raceway_powers(manifest: Manifest, bearing: BearingInfo, rows: np.ndarray) -> np.ndarray:
    """Mean powers of a bearing's ball loads at the places of outer and inner raceway, over its passes, from reductions.

    Returns
    -------
    numpy.ndarray
        Loads in kN, shape (members, 2, SECTORS); zero where no ball passes.
    """
    layout = reduction_rows(manifest)
    turned = rows[:, layout.columns["integral", bearing.prefix + TURNED], None, None]
    passes = np.where(turned > 0.0, turned, np.inf) * bearing.balls / SECTORS  # no pass, no damage
    return np.asarray(layout.raceways(rows, bearing.prefix) / passes)
