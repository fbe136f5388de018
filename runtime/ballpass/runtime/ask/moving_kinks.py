"""How kinks move with parameters, and a run along nodes that move with them.

In: a `Track` along nodes that stand still at the kinks.  Out: the same run along nodes that move: a zero of s(t, p)
moves by -s_p / s_t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ballpass.runtime.ask.kinks import DEFLECTION, Kink
from ballpass.runtime.ask.nodes import Plan, place
from ballpass.runtime.ask.quantity_records import Array
from ballpass.runtime.ask.track import Outlook, Track
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run.sensitivity import Chain


def released(
    model: LoadedModel, numbers: Numbers, track: Track, regular: Track, plan: Plan, kinks: Sequence[Kink], chain: Chain
) -> Track:
    """The track along nodes that move with the kinks.

    Parameters
    ----------
    track : along nodes that stand still at the kinks
    regular : its part without the places asked for
    plan : where the nodes are
    kinks : in the order of ``track.edges.kinks``
    """
    edges = track.edges
    channels = [kink.channel for kink in kinks if kink.channel]
    if any(kink.kind != "rank" for kink in kinks):
        channels.append(DEFLECTION)
    still = replace(regular.nodes, slope=np.zeros_like(regular.nodes.slope))
    signals = Outlook(model, channels).look(regular.along(still, edges), numbers, chain)
    slopes = edges.slopes.copy()
    for place_, kink in zip(edges.kinks, kinks, strict=True):
        first = int(np.searchsorted(regular.nodes.segment, place_, side="left"))
        rows = np.arange(first, first + 4)
        if kink.kind == "rank":
            signal = signals[kink.channel]
            values = signal.value[:, kink.ball] - signal.value[:, kink.other]
            moved = signal.slope[first, kink.ball] - signal.slope[first, kink.other]
            rate = _slope_at(regular.nodes.t[rows], values[rows])
        else:
            signal = signals[DEFLECTION]
            values, moved = signal.value[:, kink.ball], signal.slope[first, kink.ball]
            rate = _slope_at(regular.nodes.t[rows], values[rows])
            if kink.kind == "rate":
                moved = _slope_at(regular.nodes.t[rows], signal.slope[rows, kink.ball])
                rate = _bend_at(regular.nodes.t[rows], values[rows])
        if rate != 0.0:
            slopes[place_] = -moved / rate
    released = replace(edges, slopes=slopes)
    nodes = place(plan, released)
    count = len(nodes)
    nodes = replace(
        track.nodes,
        slope=np.concatenate([nodes.slope, track.nodes.slope[count:]]),
        weight_slope=np.concatenate([nodes.weight_slope, track.nodes.weight_slope[count:]]),
    )
    return track.along(nodes, released)


def _slope_at(t: Array, values: Array) -> Array:
    """Time derivative at the first of four times, of columns too; by the cubic through them."""
    return np.asarray(_taylor(t, values)[1])


def _bend_at(t: Array, values: Array) -> Array:
    """Second time derivative likewise."""
    return np.asarray(2.0 * _taylor(t, values)[2])


def _taylor(t: Array, values: Array) -> Array:
    """Coefficients of the cubic through four points in powers of the time since the first."""
    span = float(t[-1] - t[0])
    powers = np.vander((t - t[0]) / span, 4, increasing=True)
    coefficients = np.linalg.solve(powers, values)
    scale = span ** -np.arange(4.0)
    return np.asarray(coefficients * (scale if values.ndim == 1 else scale[:, None]))
