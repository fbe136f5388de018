"""Second derivatives at a point, for laws that are smooth enough.

In: a model, numbers, an output and the pair to differentiate by.  Out: a dense array.

The graph of the function is put together with those of the derived constants and of the inputs, so that second
derivatives along parameters are total, and differentiated twice by CasADi.  Hertz's law has no bounded second
derivative at contact onset, d2F/d(delta)2 ~ delta^(-1/2): such a query is refused, and the message names the smoothed
law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.manifest import InputInfo, TurningInfo
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.smoothness import WORDS
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import checked_time, point
from ballpass.runtime.point.jacobian import CRANK_ANGLE, RHS, STATES, TIME, directions_of, rows_of, turning_speed
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import Turning

Array = NDArray[np.float64]

#: Quantities that the contact and damping laws enter.
_BY_LAW = ("ball.elastic_force", "ball.damping_force", "ball.force", "ring_force.")


def hessian(
    model: LoadedModel,
    numbers: Numbers,
    of: str | Sequence[str],
    wrt: tuple[str, str],
    *,
    t: float,
    x: Sequence[float] | np.ndarray | None,
) -> Array:
    """Second derivatives at one time and state, shape (rows,); see `ballpass.runtime.Model.hessian`.

    Raises
    ------
    RequestError
        `wrt` is not a pair, unknown names, or a law without a bounded second derivative.
    SimulationError
        The derivatives are not finite there.
    """
    if not isinstance(wrt, tuple | list) or len(wrt) != 2:
        raise RequestError(f"hessian: wrt must be a pair of names, as ('inner.x', 'bearing.clearance'), not {wrt!r}.")
    time = checked_time(t)
    parts = rows_of(model, of)
    directions_of(model, numbers, list(wrt), time)  # the names are refused as they are for first derivatives
    if STATES in wrt:
        raise RequestError("hessian: wrt takes two names; 'states' stands for several. Name the states.")
    _refuse_unbounded(model, [label for part in parts for label in part.labels], [part.function for part in parts])
    there = point(model, numbers, time, x)
    sizes = {"moved": 1, "turned": 1, "states": len(model.states), "p": len(numbers.p)}
    symbols = moved, turned, states, p = [ca.SX.sym(name, size) for name, size in sizes.items()]
    c = model.symbolic("constants")(p) if model.manifest.constants else ca.SX(0, 1)
    known = {info.name: p[k] for k, info in enumerate(model.manifest.parameters)}
    known |= {info.name: c[k] for k, info in enumerate(model.manifest.constants)}
    named = {**known, TIME: moved, CRANK_ANGLE: turned, **{name: states[k] for k, name in enumerate(model.states)}}
    u = ca.vertcat(*(_input(item, known, model, numbers, time) for item in model.manifest.inputs))
    if CRANK_ANGLE in wrt:
        turning_speed(model, numbers, time)
        info = timeline.driver_info(model.manifest)
        assert info is not None  # something turns
        _, rate, slope = _turned(info, known, numbers.values, time)
        passed = turned / rate
        moved = moved + passed - 0.5 * slope / rate * passed**2
    arguments = {"t": moved, "x": states, "u": ca.SX(u), "p": p, "c": c}
    found = []
    for part in parts:
        graph = model.symbolic(part.function)
        found.append(graph(*(arguments[name] for name in graph.name_in()))[part.indices.tolist()])
    twice = ca.jacobian(ca.jacobian(ca.vertcat(*found), named[wrt[0]]), named[wrt[1]])
    result = ca.Function("twice", symbols, [ca.densify(twice)])(0.0, 0.0, there["x"], numbers.p).full().ravel()
    if not np.all(np.isfinite(result)):
        raise SimulationError("hessian: the second derivatives are not finite here. Check state and parameters.")
    single = isinstance(of, str) and of != RHS and len(result) == 1
    return np.asarray(result[0] if single else result, dtype=float)


def _refuse_unbounded(model: LoadedModel, labels: Sequence[str], functions: Sequence[str]) -> None:
    rough = [f"{law}: {WORDS[kind]}" for law, kind in model.manifest.smoothness if kind != "twice smooth"]
    asked = [label for label in labels if label.startswith(_BY_LAW)] + ([RHS] if RHS in functions else [])
    if rough and asked:
        raise RequestError(
            f"hessian: {asked[0]} depends on laws without a bounded second derivative ({', '.join(rough)}): that of "
            "Hertz's law grows as deflection^(-1/2) at contact onset, so a number would say nothing about its "
            'surroundings. Take the smoothed law: smoothing = "0.05 um" in [bearing.contact], for a one-sided damping '
            'law also smoothing = "1 mm/s" in [bearing.damping].'
        )


def _input(item: InputInfo, known: dict[str, ca.SX], model: LoadedModel, numbers: Numbers, t: float) -> ca.SX:
    """An input at the time `t` as a function of parameters: its value there, and what moves it."""
    manifest, values = model.manifest, numbers.values
    now = float(timeline.inputs_over(manifest, values, np.array([t]), np.array([t]), [item])[0, 0])
    if item.kind in ("border", "gate"):
        return ca.SX(now)
    moved, rate, slope = (ca.SX(0.0),) * 3
    if item.turning:
        info = timeline.info_of(manifest, item)
        moved, rate, slope = _turned(info, known, values, t)
        moved -= float(Turning.of(info, values).at(t)[0])
    if item.kind in ("phase", "angle"):
        return now + moved
    if item.kind in ("rate", "slope"):
        return rate if item.kind == "rate" else slope
    rows, knots, argument = timeline.table_piece(manifest, item, values, t)
    if rows[0] == rows[1]:
        return ca.SX(0.0) if item.kind == "table_rate" else known[item.values[rows[0]]]
    (t0, t1), (y0, y1) = ([known[names[row]] for row in rows] for names in (item.times, item.values))
    # angles are counted beyond a turn; the added whole turns have no derivative
    t0, t1 = (k + (v - values[item.times[r]]) for k, v, r in zip((t0, t1), knots, rows, strict=True))
    steepness = (y1 - y0) / (t1 - t0)
    return steepness if item.kind == "table_rate" else y0 + steepness * (argument + moved - t0)


def _turned(
    info: TurningInfo, known: dict[str, ca.SX], values: Mapping[str, float], t: float
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Angle, rate and slope of the rate of a turning at a time, over the numbers that it depends on."""
    one = {**known, "": ca.SX(0.0)}
    if not info.turns and not info.times:
        return one[info.offset] + one[info.rate] * t, one[info.rate], ca.SX(0.0)
    knots = [*(n for n in (*info.times, *info.lag_times) if 0.0 < values[n] <= t)]
    edges = [ca.SX(0.0), *(one[n] for n in sorted(knots, key=lambda n: values[n])), ca.SX(t)]
    places = [0.0, *sorted(values[n] for n in knots), t]
    angle, rate, slope = one[info.offset] - one[info.lag], ca.SX(0.0), ca.SX(0.0)
    for k, place in enumerate(places[:-1]):
        speed, steepness = _row(info.times, info.speeds, one, values, place)
        turns = (one[info.turns] if info.turns else 1.0) - one[info.rolling] * _row(
            info.lag_times, info.lags, one, values, place
        )[1]
        length = edges[k + 1] - edges[k]
        begin = turns * speed(edges[k])
        slope = turns * steepness
        angle += length * (begin + 0.5 * slope * length)
        rate = begin + slope * length
    return angle, rate, slope


def _row(
    times: Sequence[str], heights: Sequence[str], one: dict[str, ca.SX], values: Mapping[str, float], place: float
) -> tuple[Callable[[ca.SX], ca.SX], ca.SX]:
    """The piece of a table behind a time: a function of time, and its slope; constant outside of the rows."""
    k = sum(values[name] <= place for name in times)
    if k in (0, len(times)):
        height = one[heights[max(k - 1, 0)]] if heights else ca.SX(0.0)
        return lambda _: height, ca.SX(0.0)
    left, low = one[times[k - 1]], one[heights[k - 1]]
    slope = (one[heights[k]] - low) / (one[times[k]] - left)
    return lambda at: low + slope * (at - left), slope
