"""Static equilibrium: positions of the rings under the load of one instant, and their derivatives by parameters.

In: a model, numbers, an instant.  Out: a `StaticEquilibrium`.

Everything is at rest: the balls stand where they are at that instant, and no damping force acts.  The search starts
with concentric rings (`ballpass.runtime.request.equilibrium_newton`).

Derivatives are those of the implicit function: 0 = f(q(p), p) gives dq/dp = K^-1 df/dp with the stiffness K = -df/dq.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import BallpassWarning, RequestError, SimulationError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers, check_name, real, vector
from ballpass.runtime.contract.refused_scenes import refuse_without_bearings
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import checked_time, point
from ballpass.runtime.point.jacobian import RHS, JacobianDirections, Rows, contract, directions_of, rows_of
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.ratings.result_limits import void_words
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.request.equilibrium_newton import FIRST_STEP, SearchEnd, settle
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import Repetition
from ballpass.runtime.time.span import check_length
from ballpass.runtime.time.turning import ANGLE_RESOLUTION, beside, past

Array = NDArray[np.float64]

#: Allowed residual net force, relative to the acting forces.
TOLERANCE = 1e-12

#: Most Newton steps, and distance at which nothing holds a ring [m].
ITERATIONS, FAR = 400, 1.0

#: Largest angle of crank or shaft that is taken as radians: a larger one probably means degrees [rad].
LARGEST_ANGLE = 4.0 * math.pi

#: Part of a number by which it is moved to see angle and speed of a driver change [1].
DRIVER_STEP = 1e-6

#: Stiffness below this fraction of the largest counts as none.
FREE = 1e-9

#: The same of rings that are moved, along directions that are not those of a matrix to the last digit [1].
YIELDING = 1e-7


class FreeRingWarning(BallpassWarning):
    """The equilibrium is one of many: a ring can move without force along some direction."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StaticEquilibrium(Reported):
    """Rings at rest under the load of one instant.

    Attributes
    ----------
    coordinates : names of the positions
    positions : shape (coordinates,) [m]
    x : the state with these positions and no velocities, shape (states,)
    time : the instant [s]
    load : on the inner ring of each bearing, x and y [N]
    deflection : of each ball, shape (balls,) [m]
    ball_force : elastic force of each ball, shape (balls,) [N]
    stiffness : -d(force)/d(position), shape (coordinates, coordinates) [N/m]
    free_directions : directions without stiffness, shape (number, coordinates); empty where the equilibrium is unique
    iterations : Newton steps taken
    residual : largest net force left [N]

    Examples
    --------
    >>> rest = model.static_equilibrium(crank_angle=4.2)  # [rad]
    >>> rest.ball_force.shape, f"{rest.peak_ball_force:.0f} N"
    ((8,), '2385 N')
    """

    coordinates: tuple[str, ...]
    positions: Array
    x: Array
    time: float
    load: tuple[float, ...]
    deflection: Array
    ball_force: Array
    stiffness: Array
    free_directions: Array
    iterations: int
    residual: float
    model: LoadedModel = field(repr=False)
    numbers: Numbers = field(repr=False)
    load_is_given: bool = field(repr=False)

    def __repr__(self) -> str:
        places = ", ".join(f"{name} {q:.4g} m" for name, q in self._found.items())
        return (
            f"StaticEquilibrium({self.model.manifest.scene} at t = {self.time:.6g} s: {places}; "
            f"peak {self._noun} force {self.peak_ball_force:.6g} N)"
        )

    @property
    def _noun(self) -> str:
        return bearing_words("ball", self.model.manifest.bearings)

    @property
    def _found(self) -> dict[str, float]:
        """Positions of the rings: the driver's angle is given [m]."""
        held = held_coordinates(self.model).tolist()
        return {n: q for n, q, no in zip(self.coordinates, self.positions.tolist(), held, strict=True) if not no}

    def _report(self) -> Report:
        positions = dict(zip(self.coordinates, self.positions.tolist(), strict=True))
        forces = zip(self.deflection.tolist(), self.ball_force.tolist(), strict=True)
        balls = [{"ball": k, "deflection": d, "elastic_force": force} for k, (d, force) in enumerate(forces, 1)]
        table = ReportTable.of(
            [
                *((name, q, None) for name, q in self._found.items()),
                *((f"{self._noun} {ball['ball']}", ball["deflection"], ball["elastic_force"]) for ball in balls),
            ],
            {
                f"position or {self._noun}": lambda row: row[0],
                ">position or deflection, µm": lambda row: f"{1e6 * row[1]:z.6g}",
                ">elastic force, N": lambda row: "" if row[2] is None else f"{row[2]:z.6g}",
            },
            title=f"Static equilibrium at t = {self.time:.6g} s",
            caption=f"load {', '.join(f'{part:z.6g} N' for part in self.load)}; " * bool(self.load)
            + f"net force left {self.residual:.2g} N",
        )
        facts = {"time": self.time, "load": self.load, "positions": positions, "balls": balls}
        return Report(parts=(table,), facts=facts, records=balls, index=("ball",))

    def __getitem__(self, name: str) -> float:
        """Position by name [m].

        Examples
        --------
        >>> f"{model.static_equilibrium(crank_angle=4.2)['inner.y'] * 1e6:.1f} um"
        '132.2 um'
        """
        check_name("position of this equilibrium", name, self.coordinates)
        return float(self.positions[self.coordinates.index(name)])

    @property
    def peak_ball_force(self) -> float:
        """Largest elastic force of any ball [N]."""
        return float(np.max(self.ball_force))

    def derivative(self, of: str | Sequence[str], wrt: str | Sequence[str]) -> Array:
        """Derivative of the equilibrium, or of quantities at it, by parameters: the rings move with them.

        Parameters
        ----------
        of : "positions", or quantities as for `Model.jacobian`, ball.elastic_force
        wrt : parameters, "time" or "crank_angle"; a given load does not move with them

        Returns
        -------
        array, shape (rows, columns); no columns where `wrt` is a single name

        Raises
        ------
        RequestError
            Unknown names, a state in `wrt`, or a ring that is free to move.

        Examples
        --------
        >>> rest = model.static_equilibrium(crank_angle=4.2)
        >>> rest.derivative("positions", "bearing.clearance").round(2)  # [m/m]
        array([-0.02,  0.59,  0.  ,  0.  ])
        """
        names = [wrt] if isinstance(wrt, str) else list(wrt)
        for name in names:
            if name in (*self.model.states, "states"):
                raise RequestError(f"static equilibrium: {name!r} is found, not given. Differentiate by parameters.")
        if of == RHS:
            raise RequestError("static equilibrium: rhs is not a quantity of it. Name positions or quantities.")
        if len(self.free_directions):
            raise RequestError(
                "static equilibrium: a ring is free to move along some direction, so that its place is not a function "
                f"of the parameters. Give a preload, or another instant or {self._noun} angle."
            )
        directions = _with_driver(self.model, self.numbers, self.time, names)
        there = point(self.model, self.numbers, self.time, self.x)
        half, held = len(self.coordinates), held_coordinates(self.model)
        forces = Rows(function="static_forces", indices=np.arange(half), labels=self.coordinates, units=("N",) * half)
        moved = contract(self.model, forces, directions, there)
        if self.load_is_given:
            (load,) = rows_of(self.model, _loads(self.model))
            moved[_loaded(self.model)] -= contract(self.model, load, directions, there)
        moved[held] = 0.0
        slopes = np.linalg.solve(self.stiffness, moved)
        slopes[held] = directions.x[:half][held]
        if of != "positions":  # the rings move along
            moving = replace(directions, x=np.vstack([slopes, directions.x[half:]]))
            slopes = np.concatenate([contract(self.model, rows, moving, there) for rows in rows_of(self.model, of)])
        return np.asarray(slopes[:, 0] if isinstance(wrt, str) else slopes)


def _with_driver(model: LoadedModel, numbers: Numbers, t: float, names: Sequence[str]) -> JacobianDirections:
    """Directions along which the driver and the cages move as well, where their angles are states.

    Their derivatives by parameters and time are differences of closed forms.
    """
    directions, manifest = directions_of(model, numbers, names, t), model.manifest
    if not np.any(held_coordinates(model)) or manifest.mechanism is None:
        return directions

    def moved(at: float, states: Callable[[float], Array]) -> Array:
        step = DRIVER_STEP * (abs(at) or 1.0)
        return np.asarray((states(at + step) - states(at - step)) / (2.0 * step))

    def with_number(value: float, name: str) -> Array:
        return timeline.held_states(manifest, model.numbers({**numbers.parameters, name: value}).values, t)

    by_time = moved(t, lambda at: timeline.held_states(manifest, numbers.values, at))
    x = by_time[:, None] * directions.t
    for column, name in enumerate(names):
        if name in numbers.parameters:
            x[:, column] = moved(numbers.parameters[name], partial(with_number, name=name))
    return replace(directions, x=x)


def instant(model: LoadedModel, numbers: Numbers, t: float | None, crank_angle: float | None) -> float:
    """Time of an instant given by itself [s] or by the crank's angle [rad], in the first cycle of turns; 0 by default.

    Raises
    ------
    RequestError
        Both are given, one is no finite number, the angle is beyond two turns, or nothing turns.
    """
    if t is not None and crank_angle is not None:
        raise RequestError("Both t and crank_angle were given. Allowed: one of the two.")
    if crank_angle is None:
        time = checked_time(0.0 if t is None else t)
        if time < 0.0:
            raise RequestError(f"t: {t!r} s lies before the start. Allowed: times from 0 s on.")
        check_length(timeline.driver(model.manifest, numbers.values), time)
        return time
    mechanism = model.manifest.mechanism
    if mechanism is not None and mechanism.angle:
        raise RequestError(
            "crank_angle: a torque drives this scene, so that no time belongs to an angle. Give the "
            f"angle as the parameter {mechanism.start_angle} instead."
        )
    angle = real(crank_angle)
    if not math.isfinite(angle):
        raise RequestError(f"crank_angle: a finite angle [rad] is expected, not {crank_angle!r}.")
    if abs(angle) > LARGEST_ANGLE:
        raise RequestError(
            f"crank_angle: {crank_angle!r} rad is more than two turns. Were degrees meant? Allowed: radians from -4 pi "
            f"to 4 pi; for degrees give math.radians({crank_angle!r})."
        )
    repetition = Repetition.of(model.manifest, numbers.values)
    turning, turns = repetition.driver, repetition.turns
    ahead = angle - timeline.crank_angle(model.manifest, numbers.values, 0.0)
    if turning.fastest == 0.0:
        if abs(beside(ahead)) < ANGLE_RESOLUTION:
            return 0.0
        raise RequestError("crank_angle: nothing turns in this scene. Give the start angle as a parameter instead.")
    if len(turning.begin) == 1:
        return float(past(math.copysign(1.0, turning.rate[0]) * ahead, turns=turns)) / abs(float(turning.rate[0]))
    passed = turning.first_pass(angle, turns)
    if passed is None:
        raise RequestError(
            f"crank_angle: the driver never passes {angle:.9g} rad by its table of speeds. Allowed: an angle on its "
            "way; or give the instant as a time (t)."
        )
    return passed


def held_coordinates(model: LoadedModel) -> Array:
    """Whether each coordinate keeps its place and speed while the rings come to rest: the driver's angle, a lag."""
    return np.array([info.kind != "displacement" for info in model.manifest.coordinates], dtype=bool)


def static_equilibrium(
    model: LoadedModel, numbers: Numbers, *, t: float = 0.0, load: tuple[float, float] | None = None
) -> StaticEquilibrium:
    """Positions at which the rings rest; see `ballpass.runtime.Model.static_equilibrium`."""
    found = _equilibrium(model, numbers, t, load)
    _refuse_void(found)
    free = found.free_directions
    if len(free):
        warnings.warn(
            f"static_equilibrium: the rings can move without force along {len(free)} direction(s), mostly "
            f"{_mostly(found)}: the place given is one of many (one loaded {found._noun} does not hold a ring "
            "sideways).",
            FreeRingWarning,
            stacklevel=3,
        )
    return found


def start_at_rest(model: LoadedModel, numbers: Numbers) -> Array:
    """State of a run that starts with its rings at rest under the load of t = 0, shape (states,).

    Raises
    ------
    RequestError
        As for `static_equilibrium`, or rings that the load does not hold along some direction.
    SimulationError
        Nothing holds the rings.
    """
    found = _equilibrium(model, numbers, 0.0, None)
    if len(found.free_directions):
        raise RequestError(
            f'initial = "equilibrium": the load at the start does not hold the rings: along '
            f"{len(found.free_directions)} direction(s), mostly {_mostly(found)}, they can move without force, so that "
            "they have no single rest place. Give a negative clearance (preload), another start or "
            f"{found._noun} angle, where two {found._noun}s carry, or a state: "
            "initial = model.static_equilibrium().x takes one of the many."
        )
    return found.x


def seated(model: LoadedModel) -> Manifest:
    """The manifest whose rings start at rest under the load of t = 0, if the scene says so and the load holds them.

    They stay there when other parameters change, so that runs of neighbours start alike.
    """
    manifest = model.manifest
    if not (manifest.run.at_rest and model.has("static_forces")):
        return manifest
    try:
        found = _equilibrium(model, model.numbers(None), 0.0, None)
    except (RequestError, SimulationError):
        return manifest
    at = dict(zip(manifest.initial, found.x.tolist(), strict=True))
    path = tuple(f"{bearing.path}." for bearing in manifest.bearings)
    return replace(
        manifest,
        parameters=tuple(
            replace(info, default=at[info.name]) if info.name.startswith(path) and info.name in at else info
            for info in manifest.parameters
        ),
    )


def _mostly(found: StaticEquilibrium) -> str:
    """The coordinate that each free direction moves most."""
    return ", ".join(found.coordinates[int(np.argmax(np.abs(row)))] for row in found.free_directions)


def _equilibrium(model: LoadedModel, numbers: Numbers, t: float, load: tuple[float, float] | None) -> StaticEquilibrium:
    """Positions at which the rings rest, one of them where there are many.

    Raises
    ------
    RequestError
        No bearing; an unloaded inner ring inside a clearance, which may stand anywhere.
    SimulationError
        Nothing holds the rings.
    """
    refuse_without_bearings("static_equilibrium", bearings=bool(model.manifest.bearings))
    half = len(model.states) // 2
    there = point(model, numbers, t, np.zeros(2 * half))
    kernel, slopes = model.kernel("static_forces"), model.kernel("static_forces_jac_x")
    own = _own_loads(model, there)
    applied = own if load is None else vector(load)
    if load is not None and not len(own):
        raise RequestError(
            "load: the bearings of this scene have no load of their own: the forces of a linkage that they act back "
            "on, or of a shaft that tilts, load them. Omit load, or change the scene's forces."
        )
    if applied.shape != own.shape or not np.all(np.isfinite(applied)):
        words = (
            "two finite numbers, x and y" if len(own) == 2 else f"{len(own)} finite numbers, x and y of each bearing"
        )
        raise RequestError(f"load: {words} [N], are expected, not {load!r}.")
    extra = np.zeros(half)
    extra[_loaded(model)] = applied - own

    held = held_coordinates(model)
    start, velocity = np.split(timeline.held_states(model.manifest, numbers.values, t), 2)

    def force(q: Array) -> Array:
        there["x"] = np.concatenate([q, velocity])
        return np.where(held, 0.0, kernel(there) + extra)

    def stiffness(q: Array) -> Array:
        there["x"] = np.concatenate([q, velocity])
        matrix = -slopes(there).reshape(half, 2 * half)[:, :half]
        matrix = 0.5 * (matrix + matrix.T)
        if np.any(held):
            matrix[held, :] = matrix[:, held] = 0.0
            matrix[held, held] = np.max(np.abs(matrix))
        return np.asarray(matrix)

    # where bearings act back on the linkage, the load is the net force with concentric rings
    size = float(np.linalg.norm(applied if len(own) else force(start)))
    clearance = max(abs(numbers.values[f"{bearing.path}.clearance"]) for bearing in model.manifest.bearings)

    def done(q: Array, net: Array, matrix: Array) -> bool:
        # rounding of the forces: stiffness times the last digit of the numbers that give a deflection
        reach = float(np.max(np.abs(q - start))) + clearance
        rounding = 16.0 * np.finfo(float).eps * float(np.max(np.abs(matrix))) * reach
        return bool(np.max(np.abs(net)) <= TOLERANCE * size + rounding)

    found = settle(
        force,
        stiffness,
        start,
        weights=np.ones(half),
        done=done,
        gone=lambda q: float(np.max(np.abs(q - start))) > FAR,
        iterations=ITERATIONS,
    )
    if found.end is not SearchEnd.FOUND:
        raise SimulationError(
            f"static_equilibrium: {found.end.value}; a net force of {float(np.max(np.abs(found.force))):.3g} N is left "
            f"of a load of {size:.6g} N. Check clearance, load, contact stiffness, and the stiffness of the housing "
            "(outer_ring.stiffness), which must be above 0 where the outer ring moves."
        )
    q = found.q
    matrix = stiffness(q)
    eigenvalues, vectors = np.linalg.eigh(matrix)
    stiffest = max(float(eigenvalues[-1]), 0.0)

    def yields(direction: Array) -> bool:
        """Whether rings move away to one side without force: a ball that only just touches holds the other side."""
        back = [abs(float(direction @ force(q + side * FIRST_STEP * direction))) for side in (-1.0, 1.0)]
        return min(back) <= YIELDING * stiffest * FIRST_STEP

    rings = [bool(np.sum(vector[held] ** 2) < 0.5) for vector in vectors.T]
    alone = [
        k for k, found in enumerate(eigenvalues) if found <= FREE * stiffest or (rings[k] and yields(vectors[:, k]))
    ]
    free = vectors[:, alone].T
    state = np.concatenate([q, velocity])
    if len(free) and not np.any(applied) and float(np.max(_balls(model, numbers, t, state)[0])) < 0.0:
        words = bearing_words("no ball touches", model.manifest.bearings)
        raise RequestError(
            f"static_equilibrium: the inner ring carries no load and {words}: it may stand anywhere in its "
            "clearance. Give a load, or a negative clearance (preload)."
        )
    deflection, ball_force = _balls(model, numbers, t, state)
    return StaticEquilibrium(
        coordinates=model.states[:half],
        positions=q,
        x=state,
        time=t,
        load=tuple(applied.tolist()),
        deflection=deflection,
        ball_force=ball_force,
        stiffness=matrix,
        free_directions=free,
        iterations=found.iterations,
        residual=float(np.max(np.abs(found.force))),
        model=model,
        numbers=numbers,
        load_is_given=load is not None,
    )


def _refuse_void(found: StaticEquilibrium) -> None:
    """Refuse rings at rest on balls that are flattened as none can be."""
    first = 0
    for bearing in found.model.manifest.bearings:
        deflection = float(np.max(found.deflection[first : first + bearing.balls]))
        if words := void_words(bearing, found.numbers.values, deflection):
            raise SimulationError(f"static_equilibrium: {words}")
        first += bearing.balls


def _loads(model: LoadedModel) -> list[str]:
    """Names of the loads on inner rings that are loaded one-way."""
    known = {info.name for info in model.manifest.quantities}
    names = (f"{bearing.prefix}load.{axis}" for bearing in model.manifest.bearings for axis in "xy")
    return [name for name in names if name in known]


def _own_loads(model: LoadedModel, there: dict[str, Any]) -> Array:
    """Values of these loads [N]."""
    names = _loads(model)
    if not names:
        return np.zeros(0)
    (rows,) = rows_of(model, names)
    return np.asarray(model.kernel(rows.function)(there)[rows.indices])


def _loaded(model: LoadedModel) -> list[int]:
    """Coordinates that these loads act on."""
    return [model.states.index(name.replace("load.", "inner.")) for name in _loads(model)]


def _balls(model: LoadedModel, numbers: Numbers, t: float, x: Array) -> tuple[Array, Array]:
    """Deflection and elastic force of each ball, bearing by bearing."""
    there = point(model, numbers, t, x)

    def of_all(name: str) -> Array:
        rows = [rows for bearing in model.manifest.bearings for rows in rows_of(model, bearing.prefix + name)]
        return np.concatenate([model.kernel(some.function)(there)[some.indices] for some in rows])

    return of_all("ball.deflection"), of_all("ball.elastic_force")
