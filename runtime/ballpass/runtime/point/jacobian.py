"""Derivatives of generated functions at a point, along states, time, angle and parameters, by the chain rule.

In: a model, numbers, a point.  Out: dense arrays.

A generated function depends on (t, x, u, p, c).  A *direction* holds their derivatives by one variable: a state, the
time, the crank's angle, or a parameter, which moves the derived constants (groove radius -> elliptic integrals ->
stiffness), the phases and the tables as well.  Gates are flat: they jump at the edges of their windows, where no
derivative exists.  Derivatives along parameters are taken at fixed states.

`contract` evaluates the sparse blocks of ``jacobians.c`` and contracts them with the directions (`slopes` does so on
both sides of a corner); `output_tangents` runs the generated derivative along a direction for many samples;
`jacobian_function` prepares one query for many states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers, unknown_name
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.request import on_request
from ballpass.runtime.time import timeline

Array = NDArray[np.float64]

#: Arguments of a generated function, in the order they are differentiated.
ARGUMENTS = ("t", "x", "u", "p", "c")

#: Further names besides quantities, states and parameters.
RHS, STATES, TIME, CRANK_ANGLE = "rhs", "states", "time", "crank_angle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Rows of the result that one generated function gives.

    Attributes
    ----------
    function : "rhs", or a group of quantities
    indices : rows of that function's value, shape (rows,)
    labels : name of each, "ball.force[3]" for ball 3
    units : SI unit of each
    """

    function: str
    indices: NDArray[np.int64]
    labels: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JacobianDirections:
    """Derivatives of the arguments of a function along each direction, shape (size of the argument, directions)."""

    labels: tuple[str, ...]
    units: tuple[str, ...]
    t: Array
    x: Array
    u: Array
    p: Array
    c: Array

    def of(self, argument: str) -> Array:
        """The block of one argument, "t", "x", "u", "p" or "c": shape (size of the argument, directions)."""
        return {"t": self.t, "x": self.x, "u": self.u, "p": self.p, "c": self.c}[argument]


def differentiable(manifest: Manifest, names: Sequence[str]) -> list[str]:
    """What can be differentiated; `RequestError` where none of it has one of the names or patterns, all at once."""
    known = [RHS] if any(info.name == RHS for info in manifest.functions) else []
    known += [item.name for item in manifest.quantities]
    faults = [
        on_request(name) or unknown_name("function to differentiate", name, known)
        for name in names
        if not any(fnmatchcase(candidate, name) for candidate in known)
    ]
    if not names:
        faults.append("Nothing to differentiate was named. Give a name, as ball.force, or several.")
    if faults:
        raise RequestError("\n".join(faults))
    return known


def rows_of(model: LoadedModel, of: str | Sequence[str]) -> list[Rows]:
    """Rows of the right-hand side ("rhs") or of quantities by name or pattern, one record per generated function.

    Raises
    ------
    RequestError
        Unknown names, with the nearest ones; all at once.
    """
    names = [of] if isinstance(of, str) else list(of)
    manifest = model.manifest
    known = differentiable(manifest, names)
    chosen = [c for name in names for c in known if fnmatchcase(c, name) and (c != RHS or name == RHS)]
    place: dict[str, tuple[str, int, int, str]] = {}
    counts: dict[str, int] = {}
    for item in manifest.quantities:
        start = counts.get(item.group, 0)
        place[item.name] = (item.group, start, item.size, item.unit)
        counts[item.group] = start + item.size
    found: list[Rows] = []
    for name in dict.fromkeys(chosen):
        if name == RHS:
            labels = tuple(f"d({state.name})/dt" for state in manifest.states)
            units = tuple(f"{state.unit}/s" for state in manifest.states)
            found.append(Rows(function=RHS, indices=np.arange(len(labels)), labels=labels, units=units))
            continue
        group, start, size, unit = place[name]
        labels = (name,) if size == 1 else tuple(f"{name}[{k + 1}]" for k in range(size))
        found.append(Rows(function=group, indices=np.arange(start, start + size), labels=labels, units=(unit,) * size))
    return _merged(found)


def _merged(found: Sequence[Rows]) -> list[Rows]:
    """Consecutive rows of one function joined; the order of the rows is kept."""
    out: list[Rows] = []
    for rows in found:
        if out and out[-1].function == rows.function:
            last = out.pop()
            rows = Rows(
                function=rows.function,
                indices=np.concatenate([last.indices, rows.indices]),
                labels=last.labels + rows.labels,
                units=last.units + rows.units,
            )
        out.append(rows)
    return out


def check_directions(manifest: Manifest, names: Sequence[str]) -> dict[str, str]:
    """Units of all that can be differentiated by; `RequestError` for other names, all at once."""
    units = {state.name: state.unit for state in manifest.states} | {TIME: "s", CRANK_ANGLE: "rad"}
    units |= {info.name: info.unit for info in manifest.parameters}
    known = [*(info.name for info in manifest.parameters), *(info.name for info in manifest.states)]
    words = f"'{STATES}', names of states, '{TIME}' and '{CRANK_ANGLE}'"
    faults = [
        f"{unknown_name('parameter', name, (*known, STATES, TIME, CRANK_ANGLE))} Besides parameters, wrt takes {words}."
        for name in names
        if name not in (*units, STATES)
    ]
    if STATES in names and not manifest.integrated:
        faults.append("wrt: this scene has no states. Give parameters, 'time' or 'crank_angle'.")
    if faults:
        raise RequestError("\n".join(faults))
    return units


def directions_of(model: LoadedModel, numbers: Numbers, wrt: str | Sequence[str], t: float) -> JacobianDirections:
    """Directions along states ("states": all), "time", "crank_angle" or parameters, at time `t` [s].

    Raises
    ------
    RequestError
        Unknown names, with the nearest ones; a crank angle where nothing turns.
    """
    manifest = model.manifest
    names = [wrt] if isinstance(wrt, str) else list(wrt)
    units = check_directions(manifest, names)
    names = [item for name in names for item in (model.states if name == STATES else (name,))]
    rows = {name: row for row, name in enumerate(numbers.parameters)}
    if not names:
        raise RequestError("wrt: nothing to differentiate by was named. Give a parameter, or 'states'.")
    count = len(names)
    along_t, along_x = np.zeros((1, count)), np.zeros((len(model.states), count))
    along_p = np.zeros((len(numbers.p), count))
    for column, name in enumerate(names):
        if name == TIME:
            along_t[0, column] = 1.0
        elif name == CRANK_ANGLE:
            along_t[0, column] = 1.0 / turning_speed(model, numbers, t)
        elif name in rows:
            along_p[rows[name], column] = 1.0
        else:
            along_x[model.states.index(name), column] = 1.0
    along_c = np.zeros((len(numbers.c), count))
    if len(numbers.c) and np.any(along_p):
        by_parameters = model.kernel("constants_jac")({"p": numbers.p}).reshape(len(numbers.c), len(numbers.p))
        along_c = by_parameters @ along_p
    along_u = np.zeros((len(manifest.inputs), count))
    constants = {info.name: row for row, info in enumerate(manifest.constants)}
    named = timeline.names_of_inputs(manifest)
    now = np.array([t])
    for column in range(count):
        moved = {
            name: float(along_p[rows[name], column] if name in rows else along_c[constants[name], column])
            for name in named
        }
        along_u[:, column] = timeline.input_slopes(manifest, numbers.values, moved, now, now)[0]
    return JacobianDirections(
        labels=tuple(names),
        units=tuple(units[name] for name in names),
        t=along_t,
        x=along_x,
        u=along_u,
        p=along_p,
        c=along_c,
    )


def turning_speed(model: LoadedModel, numbers: Numbers, t: float) -> float:
    """Speed of crank or shaft at a time [rad/s].

    Raises
    ------
    RequestError
        Nothing turns.
    """
    mechanism = model.manifest.mechanism
    if mechanism is not None and mechanism.angle:
        raise RequestError(
            f"crank_angle: the driver's angle is a state of this scene. Differentiate by {mechanism.angle!r} instead."
        )
    speed = float(timeline.driver(model.manifest, numbers.values).at(t)[1])
    if speed == 0.0:
        raise RequestError(
            "crank_angle: nothing turns in this scene, so time does not move the angle. Give a speed, or differentiate "
            "by the driver's start angle, which turns the linkage alone and holds the balls."
        )
    return speed


def contract(model: LoadedModel, rows: Rows, directions: JacobianDirections, there: Mapping[str, object]) -> Array:
    """Sum over the arguments of block times direction, shape (rows, directions)."""
    total = np.zeros((len(rows.indices), len(directions.labels)))
    for argument in ARGUMENTS:
        along = directions.of(argument)
        name = f"{rows.function}_jac_{argument}"
        # a block without entries is not generated
        if np.any(along) and model.has(name):
            kernel = model.kernel(name)
            block = kernel(there).reshape(-1, along.shape[0])
            total += block[rows.indices] @ along
    return total


def values_of_rows(model: LoadedModel, parts: Sequence[Rows], there: Mapping[str, object]) -> Array:
    """Values of rows with the arguments `there`, shape (rows,)."""
    return np.concatenate([model.kernel(part.function)(there)[part.indices] for part in parts])


def output_tangents(
    model: LoadedModel,
    numbers: Numbers,
    of: str | Sequence[str],
    *,
    t: Array,
    x: Array,
    u: Array,
    dx: Array | None = None,
    du: Array | None = None,
    dp: Array | None = None,
    dc: Array | None = None,
    dt: Array | None = None,
) -> Array:
    """Derivatives of quantities along M directions at N samples, through generated C; no Python loop over samples.

    Parameters
    ----------
    of : names or patterns of quantities, or "rhs", as for `jacobian`; the rows of the result stand in that order, an
        entry per ball one below the other (`rows_of` gives their labels)
    t : times since the reference time of `u`, shape (N,) [s]
    x : states, shape (N, states)
    u : inputs at the reference time, shape (N, inputs), or (inputs,) for all samples
    dx : how the states move, shape (N, states, M); None: not at all, likewise the others
    du : how the inputs move, shape (N, inputs, M) or (inputs, M)
    dp, dc : how parameters and constants move, shape (parameters, M) and (constants, M); see `directions_of`
    dt : how the time since the reference moves, shape (N, M) or (M,) [s]

    Returns
    -------
    array, shape (N, rows, M)

    Raises
    ------
    RequestError
        Unknown names, no direction given, shapes that do not fit.

    Examples
    --------
    >>> times, states = np.zeros(3), np.zeros((3, 8))
    >>> directions = np.zeros((3, 8, 2))  # two of them
    >>> numbers, u = model.numbers(), model.inputs_at(0.0)
    >>> force = output_tangents(
    ...     model, numbers, "ball.force", t=times, x=states, u=u, dx=directions
    ... )
    >>> force.shape  # [N]: samples, balls, directions
    (3, 8, 2)
    """
    count = len(t)
    given = {"t": t, "x": x, "u": u, "p": numbers.p, "c": numbers.c}
    moved = {"x": dx, "u": du, "p": dp, "c": dc, "t": dt}
    states, inputs = len(model.states), len(model.manifest.inputs)
    shapes = {"t": (count,), "x": (count, states), "u": (count, inputs), "p": numbers.p.shape, "c": numbers.c.shape}
    moves = next((one.shape[-1] for one in moved.values() if one is not None), None)
    if moves is None:
        raise RequestError("output_tangents: no direction was given. Give one or more of dx, du, dp, dc, dt.")

    def shaped(value: Array | None, shape: tuple[int, ...], name: str) -> Array:
        if value is None:
            return np.broadcast_to(0.0, shape)
        try:
            return np.broadcast_to(np.asarray(value, dtype=float), shape)
        except ValueError as fault:
            raise RequestError(f"output_tangents: {name} of shape {shape} is expected, not {value.shape}.") from fault

    there = {name: shaped(value, shapes[name], name) for name, value in given.items()}
    along = {f"d{name}": shaped(value, (*shapes[name], moves), f"d{name}") for name, value in moved.items()}
    parts = []
    for rows in rows_of(model, of):
        loop = model.loop(f"{rows.function}_tangent", ("t", "x", "u", "dt", "dx", "du"))
        (result,) = loop.function.name_out()
        part = np.empty((count, len(rows.indices), moves))
        for m in range(moves):
            way = {name: one[..., m] for name, one in along.items()}
            part[:, :, m] = loop(count, there | way)[result][:, rows.indices]
        parts.append(part)
    return np.concatenate(parts, axis=1)
