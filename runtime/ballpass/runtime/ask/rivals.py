"""Other peaks that take a largest value's place after a small change of a parameter: there its derivative jumps.

In: a run along nodes, with derivatives, and its extreme.  Out: a sentence, empty where no other one is near.

Every ball's extremes are looked at, by the parabola through three nodes.  One of the same derivative does not count, as
the same peak in another turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.quantity_records import Array, Mark, Quantity, View

#: A change of a parameter by this share of its value, or of a radian, is a small one [1].
NEAR = 1e-3

#: Derivatives (p/Q) dQ/dp that differ by less are one: by this share of the larger one, and by themselves [1].
ALIKE, FLOOR = 1e-2, 1e-5

#: Nodes beside that of the extreme belong to it.
BESIDE = 2

#: Extremes lower than the highest by more than this share are not looked at [1].
REACH = 1e-2


def nearest_rival(view: View, quantity: Quantity, mark: Mark, sign: float) -> str:
    """The extreme that the smallest change of a parameter makes the largest (sign 1) or smallest (-1) value."""
    signal = view.signals[quantity.channel]
    best, slope = float(signal.value[mark.node, mark.ball]), signal.slope[mark.node, mark.ball]
    if best == 0.0 or not view.names:
        return ""
    columns = np.arange(signal.value.shape[1]) if quantity.ball is None else np.array([mark.ball])
    order = np.lexsort((view.nodes.t, view.nodes.segment))
    t, segment = view.nodes.t[order], view.nodes.segment[order]
    height = sign * signal.value[np.ix_(order, columns)]
    rows, found = _tops(height, segment, sign * best - REACH * abs(best))
    others = (columns[found] != mark.ball) | (np.abs(rows - np.flatnonzero(order == mark.node)) > BESIDE)
    rows, found = rows[others], found[others]
    weights, balls = _at_top(t, segment, height, rows, found), columns[found]
    near = order[np.clip(rows[:, None] + np.arange(-1, 2), 0, len(t) - 1)]  # nodes of each parabola, shape (tops, 3)
    values = np.sum(weights * signal.value[near, balls[:, None]], axis=1)
    slopes = np.einsum("kn,knd->kd", weights, signal.slope[near, balls[:, None]])
    scales = np.array([_scale(view, name) for name in view.names]) / abs(best)
    apart = np.abs(slopes - slope) * scales
    same = np.maximum(ALIKE * np.maximum(np.abs(slopes), np.abs(slope)) * scales, FLOOR)
    gap = np.maximum(sign * (best - values) / abs(best), 0.0)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(apart > same, gap / apart, np.inf)
    k, column = divmod(int(np.argmin(change)), len(view.names)) if change.size else (0, 0)
    if not change.size or not change[k, column] < NEAR:
        return ""
    name, by = view.names[column], change[k, column] * scales[column] * abs(best)
    ball = f", ball {balls[k] + 1}" if len(columns) > 1 else ""
    return (
        f"a change of {name} by {by:.2g} puts the extreme at t = {t[rows[k]]:.6g} s{ball} in place of that at t = "
        f"{mark.time:.6g} s, and makes the derivative {slopes[k, column]:.4g} instead of {slope[column]:.4g}"
    )


def _tops(height: Array, segment: NDArray[np.int_], least: float) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Rows and columns that no neighbour in the same segment exceeds, from `least` on."""
    same = (np.diff(segment) == 0)[:, None]
    never = np.full((1, height.shape[1]), -np.inf)
    before = np.concatenate([never, np.where(same, height[:-1], -np.inf)])
    behind = np.concatenate([np.where(same, height[1:], -np.inf), never])
    rows, columns = np.nonzero((height > before) & (height >= behind) & (height >= least))
    return rows, columns


def _at_top(
    t: Array, segment: NDArray[np.int_], height: Array, rows: NDArray[np.int_], columns: NDArray[np.int_]
) -> Array:
    """Weights of the node before, the node and the one behind it at the top of their parabola, shape (tops, 3)."""
    weights = np.tile([0.0, 1.0, 0.0], (len(rows), 1))
    inner = np.flatnonzero((rows > 0) & (rows < len(t) - 1))
    inner = inner[segment[rows[inner] - 1] == segment[rows[inner] + 1]]
    at = rows[inner]
    left, right = t[at] - t[at - 1], t[at + 1] - t[at]
    inner, at, left, right = (item[(left > 0.0) & (right > 0.0)] for item in (inner, at, left, right))
    low, middle, high = (height[at + k, columns[inner]] for k in (-1, 0, 1))
    fall, rise = (middle - low) / left, (high - middle) / right
    bend = (rise - fall) / (left + right)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0.0, -0.5 * (fall + bend * left) / bend, 0.0)
    shift = np.clip(shift, -left, right)
    weights[inner, 0] = shift * (shift - right) / (left * (left + right))
    weights[inner, 1] = (left + shift) * (right - shift) / (left * right)
    weights[inner, 2] = shift * (shift + left) / (right * (left + right))
    return weights


def _scale(view: View, name: str) -> float:
    """What a change of a parameter is measured in: its value; of an angle a radian."""
    unit = next(info.unit for info in view.manifest.parameters if info.name == name)
    return 1.0 if unit == "rad" else abs(view.numbers.parameters[name])
