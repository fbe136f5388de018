"""Quantities of a run and their derivatives, by steps, quadrature, extremes and differences of the tests' own.

Taken from the package are the right-hand side, the outputs and the derived constants, as generated functions.  A run
and its neighbours in parameters are one system of equations in the share of each segment: SciPy's DOP853 takes the
same steps for all of them, so that what a step loses is nearly the same on both sides of a difference.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from ballpass.runtime import Model
from ballpass.runtime.point.evaluate import neighbour

Array = NDArray[np.float64]
TURN = 2.0 * math.pi

#: Steps of the differences relative to a parameter's scale, in pairs that are extrapolated; they halve within a pair.
PAIRS = (4e-5, 4e-6)

#: Gauss's rule in a step, what gives the part of fifth degree, the largest that is left alone, relative to the whole
#: integral, and into how many parts the others are cut: a kink lies in them.
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(6)
FIFTH = 5.5 * WEIGHTS * np.polynomial.Legendre.basis(5)(GAUSS)
ROUGH, PARTS = 1e-9, 64

#: Points and rounds of the grids around an extreme, and around how many nodes.
GRID, ROUNDS, CANDIDATES = 33, 4, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivative:
    """Derivative by differences, what is known of its error, and the one-sided ones."""

    value: float
    uncertainty: float
    left: float
    right: float


class IndependentRuns:
    """A run from t = 0 over `cycles` turns, and its neighbours.

    Parameters
    ----------
    parameters : of the run, SI
    changes : of each neighbour
    cycles, transient : turns in all, and those that do not count
    """

    def __init__(
        self,
        model: Model,
        parameters: Mapping[str, float],
        changes: Sequence[Mapping[str, float]],
        cycles: float,
        transient: float,
        rtol: float = 1e-11,
    ) -> None:
        base = model.numbers(dict(parameters))
        self._model, self._members = model, [neighbour(model, base, change) for change in changes]
        self._p = np.array([item.p for item in self._members])
        self._c = np.array([item.c for item in self._members])
        self._rtol, self._magnitude = rtol, np.repeat([1e-6, 1e-3], len(model.states) // 2)
        edges = [self._edges(item.values, cycles, transient) for item in self._members]
        assert len({len(times) for times in edges}) == 1, "neighbours have other segments"
        self.edges = np.array(edges).T
        turns = np.array([self._turn(item.values) for item in self._members])
        self.start = int(np.argmin(np.abs(self.edges[:, 0] - transient * turns[0])))
        self.turns = turns
        self._solve()

    def _turn(self, values: Mapping[str, float]) -> float:
        manifest = self._model.manifest
        name = manifest.mechanism.speed if manifest.mechanism is not None else "shaft.speed"
        return TURN / values[name]

    def _edges(self, values: Mapping[str, float], cycles: float, transient: float) -> list[float]:
        turn = self._turn(values)
        found = [0.0, cycles * turn, *([transient * turn] if transient > 0.0 else [])]
        for item in self._model.manifest.inputs:
            for window in item.windows:
                turning = next(one for one in self._model.manifest.turnings if one.name == item.turning)
                for name in window:
                    first = (values[name] - values[turning.offset]) % TURN
                    times = (first + TURN * np.arange(math.ceil(cycles) + 1)) / values[turning.rate]
                    found += times[times < found[1]].tolist()
        return sorted(found)

    def _inputs(self, segment: int) -> Array:
        rows = []
        for k, member in enumerate(self._members):
            begin, middle = self.edges[segment, k], 0.5 * (self.edges[segment, k] + self.edges[segment + 1, k])
            row = []
            for item in self._model.manifest.inputs:
                turning = next(one for one in self._model.manifest.turnings if one.name == item.turning)
                offset, rate = member.values[turning.offset], member.values[turning.rate]
                if item.kind == "phase":
                    row.append((offset + rate * begin) % TURN)
                    continue
                angle = offset + rate * middle
                inside = [
                    (angle - member.values[a]) % TURN < (member.values[b] - member.values[a]) % TURN
                    for a, b in item.windows
                ]
                row.append(float(any(inside)))
            rows.append(row)
        return np.array(rows)

    def _solve(self) -> None:
        """Steps of all segments: dense outputs, with the shares at which they begin."""
        count, states = len(self._members), len(self._model.states)
        # one function of all members, on memory of its own: a step costs twelve calls
        mapped = self._model.function("rhs").map(count)
        call, evaluate = mapped.buffer()
        given = {
            "t": np.zeros((count, 1)),
            "x": np.zeros((count, states)),
            "u": np.zeros((count, len(self._model.manifest.inputs))),
            "p": self._p,
            "c": self._c,
        }
        rate = np.zeros((count, states))
        for place, name in enumerate(mapped.name_in()):
            call.set_arg(place, memoryview(given[name]))
        call.set_res(0, memoryview(rate))
        x = np.array([[item.values[name] for name in self._model.manifest.initial] for item in self._members])
        self._dense, self._ends, self._u = [], [], []
        for segment in range(len(self.edges) - 1):
            length = self.edges[segment + 1] - self.edges[segment]
            given["u"][:] = u = self._inputs(segment)

            def system(share: float, y: Array, length: Array = length[:, None]) -> Array:
                np.multiply(length, share, out=given["t"])
                given["x"][:] = y.reshape(count, states)
                evaluate()
                return np.asarray((rate * length).ravel())

            # SciPy's norm is a mean over all states: the error of a single run would be diluted by its neighbours
            tolerance = np.tile(self._rtol * self._magnitude, count)
            solver = DOP853(system, 0.0, x.ravel(), 1.0, rtol=max(self._rtol, 3e-14), atol=tolerance)
            dense, ends = [], [0.0]
            while solver.status == "running":
                message = solver.step()
                assert solver.status != "failed", message
                dense.append(solver.dense_output())
                ends.append(float(solver.t))
            self._dense.append(dense)
            self._ends.append(np.array(ends))
            self._u.append(u)
            x = solver.y.reshape(count, states)

    def _states(self, segment: int, shares: Array, step: NDArray[np.int_] | None = None) -> Array:
        """States of all members at shares of a segment that increase, shape (shares, members, states)."""
        if step is None:
            step = np.clip(np.searchsorted(self._ends[segment], shares, side="right") - 1, 0, None)
            step = np.minimum(step, len(self._dense[segment]) - 1)
        found = [self._dense[segment][k](shares[step == k]) for k in np.unique(step).tolist()]
        return np.concatenate(found, axis=1).T.reshape(len(shares), len(self._members), -1)

    def _channel(self, channel: str, ball: int | None, segment: int, shares: Array, x: Array, member: int) -> Array:
        """A channel of one member at shares of a segment; of the most loaded ball unless one is named."""
        if channel in self._model.states:
            return np.asarray(x[:, self._model.states.index(channel)])
        length = self.edges[segment + 1, member] - self.edges[segment, member]
        given = {"t": shares * length, "x": x, "u": np.tile(self._u[segment][member], (len(shares), 1))}
        numbers = {"p": self._members[member].p, "c": self._members[member].c}
        table = self._model.sample_outputs(len(shares), {**given, **numbers}, [channel])[channel]
        return np.asarray(np.max(table, axis=1) if ball is None else table[:, ball - 1])

    def quantities(self, names: Sequence[str]) -> Array:
        """Values of quantities for every member, shape (quantities, members)."""
        parsed = [_parse(name) for name in names]
        channels = list(dict.fromkeys((channel, ball) for _, channel, ball, _ in parsed))
        members = len(self._members)
        sums = {key: np.zeros((3, members), dtype=complex) for key in [*channels, *parsed]}
        best: dict[tuple[tuple[str, int | None], float], list[list[tuple[float, int, float, float]]]] = {
            (key, sign): [[] for _ in range(members)] for key in channels for sign in (1.0, -1.0)
        }
        length = self.edges[-1] - self.edges[self.start]
        for segment in range(self.start, len(self.edges) - 1):
            ends = self._ends[segment]
            width = np.diff(ends)[:, None]
            places = ends[:-1, None] + 0.5 * width * (1.0 + GAUSS)
            shares = np.concatenate([ends[:-1, None], places], axis=1).ravel()
            weight = np.concatenate([0.0 * width, 0.5 * width * WEIGHTS], axis=1).ravel()
            steps = np.repeat(np.arange(len(width)), len(GAUSS) + 1)
            shares, weight, steps = np.append(shares, 1.0), np.append(weight, 0.0), np.append(steps, len(width) - 1)
            x = self._states(segment, shares, steps)
            for m in range(members):
                span = self.edges[segment + 1, m] - self.edges[segment, m]
                for key in channels:
                    values = self._channel(*key, segment, shares, x[:, m], m)
                    first, second = self._integrals(key, segment, values, m)
                    sums[key][0, m] += span * first
                    sums[key][1, m] += span * second
                    for sign in (1.0, -1.0):
                        best[key, sign][m] += _tops(sign * values, segment, shares)
                    for item in parsed:
                        if item[0] == "amplitude" and item[1:3] == key:
                            turning = weight * span * np.exp(-1j * self._angle(item[3], m, segment, shares))
                            sums[item][0, m] += turning @ values
                            sums[item][1, m] += np.sum(turning)
        found = np.zeros((len(names), members))
        for row, item in enumerate(parsed):
            kind, channel, ball, _ = item
            key = (channel, ball)
            for m in range(members):
                mean = sums[key][0, m].real / length[m]
                if kind == "mean":
                    found[row, m] = mean
                elif kind == "rms":
                    found[row, m] = math.sqrt(sums[key][1, m].real / length[m])
                elif kind == "amplitude":
                    found[row, m] = abs(2.0 * (sums[item][0, m] - mean * sums[item][1, m]) / length[m])
                elif kind == "end":
                    last = len(self.edges) - 2
                    x = self._states(last, np.ones(1))
                    found[row, m] = self._channel(channel, ball, last, np.ones(1), x[:, m], m)[0]
                else:
                    top = self._refined(key, 1.0, best[key, 1.0][m], m) if kind != "min" else 0.0
                    bottom = -self._refined(key, -1.0, best[key, -1.0][m], m) if kind != "max" else 0.0
                    found[row, m] = top - bottom if kind == "range" else top + bottom
        return found

    def _integrals(self, key: tuple[str, int | None], segment: int, values: Array, member: int) -> tuple[float, float]:
        """Integrals of a channel and of its square over the share of a segment, closer where a step holds a kink."""
        ends = self._ends[segment]
        width, inner = np.diff(ends), values[:-1].reshape(len(ends) - 1, -1)[:, 1:]
        rough = np.abs(inner @ FIFTH) * width > ROUGH * np.max(np.abs(values))
        first, second = 0.5 * width * (inner @ WEIGHTS), 0.5 * width * (inner**2 @ WEIGHTS)
        steps = np.flatnonzero(rough)
        if len(steps):
            part = (np.arange(PARTS)[:, None] + 0.5 * (1.0 + GAUSS)).ravel() / PARTS
            shares = (ends[steps, None] + width[steps, None] * part).ravel()
            x = self._states(segment, shares, np.repeat(steps, len(part)))[:, member]
            closer = self._channel(*key, segment, shares, x, member).reshape(len(steps), PARTS, -1)
            first[steps] = 0.5 * width[steps] / PARTS * np.sum(closer @ WEIGHTS, axis=1)
            second[steps] = 0.5 * width[steps] / PARTS * np.sum(closer**2 @ WEIGHTS, axis=1)
        return float(np.sum(first)), float(np.sum(second))

    def _angle(self, order: float, member: int, segment: int, shares: Array) -> Array:
        """Angle of a line at a multiple of the turns [rad]."""
        begin, end = self.edges[segment, member], self.edges[segment + 1, member]
        return np.asarray(TURN * order / self.turns[member] * (begin + shares * (end - begin)))

    def _refined(
        self, key: tuple[str, int | None], sign: float, tops: list[tuple[float, int, float, float]], member: int
    ) -> float:
        """Largest value around the best nodes, on grids that get finer."""
        best = -math.inf
        for _, segment, low, high in sorted(tops, reverse=True)[:CANDIDATES]:
            for _ in range(ROUNDS):
                shares = np.linspace(low, high, GRID)
                x = self._states(segment, shares)[:, member]
                values = sign * self._channel(*key, segment, shares, x, member)
                k = int(np.argmax(values))
                best = max(best, float(values[k]))
                low, high = float(shares[max(k - 1, 0)]), float(shares[min(k + 1, GRID - 1)])
        return best


def _tops(values: Array, segment: int, shares: Array) -> list[tuple[float, int, float, float]]:
    """The best nodes that no neighbour exceeds: value, segment, and the shares of the neighbours."""
    fenced = np.concatenate([[-math.inf], values, [-math.inf]])
    tops = np.flatnonzero((values >= fenced[:-2]) & (values >= fenced[2:]))
    tops = tops[np.argsort(-values[tops], kind="stable")[:CANDIDATES]]
    last = len(values) - 1
    return [
        (float(values[k]), segment, float(shares[max(k - 1, 0)]), float(shares[min(k + 1, last)]))
        for k in tops.tolist()
    ]


def _parse(name: str) -> tuple[str, str, int | None, float]:
    """Kind, channel, ball and order of a quantity's name."""
    kind, _, rest = ("max:ball.force" if name == "peak_ball_force" else name).partition(":")
    channel, _, place = rest.partition("@")
    channel, _, ball = channel.partition("[")
    return kind, channel, int(ball[:-1]) if ball else None, float(place[:-1]) if place else 0.0


def differentiate(
    model: Model,
    parameters: Mapping[str, float],
    of: Sequence[str],
    scales: Mapping[str, float],
    cycles: float,
    transient: float,
) -> tuple[Array, dict[tuple[str, str], Derivative]]:
    """Values of quantities, and their derivatives by the parameters in `scales`, whose values are large changes."""
    centre = model.numbers(dict(parameters)).parameters
    moves = [side * half * step for step in PAIRS for half in (1.0, 0.5) for side in (1.0, -1.0)]
    changes: list[dict[str, float]] = [{}]
    changes += [{name: centre[name] + move * scale} for name, scale in scales.items() for move in moves]
    values = IndependentRuns(model, parameters, changes, cycles, transient).quantities(of)
    found = {}
    for row, quantity in enumerate(of):
        here = values[row, 0]
        for column, (name, scale) in enumerate(scales.items()):
            part = values[row, 1 + column * len(moves) : 1 + (column + 1) * len(moves)]
            slopes = (part[0::2] - part[1::2]) / (2.0 * scale * np.array(moves[0::2]))
            wide, narrow = ((4.0 * slopes[k + 1] - slopes[k]) / 3.0 for k in (0, 2))
            left, right = (here - part[7]) / (scale * moves[6]), (part[6] - here) / (scale * moves[6])
            # two pairs may agree by chance: within the narrow one truncation is nothing, and what is left is scatter
            scatter = 2.0 * abs(slopes[3] - slopes[2])
            known = abs(wide - narrow) + scatter + 1e-13 * abs(here) / (scale * moves[6])
            found[quantity, name] = Derivative(value=narrow, uncertainty=known, left=left, right=right)
    return values[:, 0], found
