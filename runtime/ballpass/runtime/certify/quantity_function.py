"""Quantities of interest as a function of parameters: arrays in, arrays out, with the Jacobian.

In: a model, names of quantities and parameters, how long to run.  Out: a `QuantityFunction`, as optimisers take it;
`ballpass.jax` and `ballpass.torch` wrap it.

Values come from ensembles in lanes, derivatives from the stepper's own steps, both stepping over the kinks of the laws.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Literal, NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.ask.quantities import parse_quantity
from ballpass.runtime.ask.quantity_records import Estimate
from ballpass.runtime.ask.study import Study
from ballpass.runtime.certify.derivative_runs import differentiate, refuse_chaos, stepping_with_derivatives
from ballpass.runtime.certify.member_runs import reduced_by_ensembles
from ballpass.runtime.certify.sensitivity_query import NODES, make_span
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers, unknown_name
from ballpass.runtime.many.ensemble import simulate_many
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.assembly import check_assembly
from ballpass.runtime.run.locating import STEPPED_OVER, refuse_jumps
from ballpass.runtime.run.request import tolerance

Array = NDArray[np.float64]
T = TypeVar("T")

#: Tolerance of the states; that of the derivatives is ten times as large [1].
RTOL = 1e-9


class QuantityFunction:
    """Quantities of a model over some of its parameters, all others fixed.

    Parameters
    ----------
    model : the model
    of : quantities, as for `Model.sensitivity`.  One name gives values without the axis of quantities
    wrt : parameters, in the order of the last axis of what the function is called with
    cycles, duration, transient : as for `Model.simulate`
    parameters : values of other parameters, SI.  Default: the scene's
    rtol : error allowed per step of the states; ten times that of the derivatives [1]
    failed : what stands for a run that fails: ``raise`` an error, or ``nan``, for values and derivatives
    chaos : ``refuse`` derivatives of a motion that amplifies a tiny change beyond meaning, which takes two more runs
        each; or ``ignore`` that

    Attributes
    ----------
    of, wrt : names
    start : values of the parameters in the scene, shape (parameters,)
    shape : of one value: (quantities,), or () for one name

    Raises
    ------
    RequestError
        Unknown names, or a wrong request.

    Examples
    --------
    >>> from ballpass.runtime import QuantityFunction
    >>> of, wrt = ["peak_ball_force", "rms:inner.y"], ["bearing.clearance"]
    >>> f = QuantityFunction(model, of, wrt, cycles=3)
    >>> f(f.start).shape, f([[5e-6], [10e-6]]).shape
    ((2,), (2, 2))
    >>> f.jacobian(f.start).shape  # [N/m], [m/m]
    (2, 1)
    """

    def __init__(
        self,
        model: LoadedModel,
        of: str | Sequence[str],
        wrt: str | Sequence[str],
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        rtol: float = RTOL,
        failed: Literal["raise", "nan"] = "raise",
        chaos: Literal["refuse", "ignore"] = "refuse",
    ) -> None:
        _check_word("failed", failed, ("raise", "nan"))
        _check_word("chaos", chaos, ("refuse", "ignore"))
        self.of = (of,) if isinstance(of, str) else tuple(of)
        self.wrt = (wrt,) if isinstance(wrt, str) else tuple(wrt)
        self.shape = () if isinstance(of, str) else (len(self.of),)
        self._model, self._failed, self._chaos, self._rtol = model, failed, chaos, tolerance("rtol", rtol)
        self._fixed = dict(parameters or {})
        numbers = model.numbers(self._fixed)
        for what, names in (("of", self.of), ("wrt", self.wrt)):
            if not names or len(dict.fromkeys(names)) < len(names):
                raise RequestError(f"{what}: one name or more is expected, each once, not {list(names)!r}.")
        for name in self.wrt:
            if name not in numbers.parameters:
                raise RequestError(unknown_name("parameter", name, numbers.parameters))
        self.start = np.array([numbers.parameters[name] for name in self.wrt])
        self._quantities = [parse_quantity(model.manifest, name) for name in self.of]
        self._span = make_span(model.manifest, cycles, duration, transient)
        # a study is not for two threads at once: each takes one that is free, and puts it back
        self._free: dict[bool, list[Study]] = {True: [], False: []}
        self._reduced = reduced_by_ensembles(model, self._quantities)
        self._others = [k for k in range(len(self.of)) if k not in self._reduced]
        self._study(slopes=True).window(numbers)  # a wrong length is told now

    def __repr__(self) -> str:
        of, wrt = (f"{', '.join(names[:3])}{', ...' if len(names) > 3 else ''}" for names in (self.of, self.wrt))
        return f"QuantityFunction({self._model.manifest.scene}: {of} by {wrt})"

    def __call__(self, x: ArrayLike) -> Array:
        """Values of the quantities, SI, shape (..., quantities), or (...) for one name.

        The values of a row are the same bits whichever rows stand beside it.

        Parameters
        ----------
        x : values of the parameters, SI, shape (..., parameters)

        Raises
        ------
        RequestError
            Another shape, or parameters that cannot be simulated.
        SimulationError
            A run failed.

        Examples
        --------
        >>> f = QuantityFunction(model, "rms:inner.y", ["bearing.clearance"], cycles=3)
        >>> f([[5e-6], [10e-6]]).shape  # [m]
        (2,)
        """
        rows, able, batch = self._rows(x)
        found = np.full((len(rows), len(self.of)), np.nan)
        if self._reduced and len(able):
            found[able[:, None], list(self._reduced)] = self._by_ensemble(rows[able])
        if self._others:
            found[able[:, None], self._others] = self._each(self._values, rows[able], (len(self._others),))
        found[np.isnan(found).any(axis=1)] = np.nan  # a run that failed for one quantity
        return found.reshape((*batch, *self.shape))

    def jacobian(self, x: ArrayLike) -> Array:
        """Derivatives, SI, shape (..., quantities, parameters), or (..., parameters) for one name.

        Where a quantity has a kink, as an extreme that passes from one peak to another, it is the derivative on one
        side.  `Model.sensitivity` tells such places, and compares derivatives with differences.

        Parameters
        ----------
        x : values of the parameters, SI, shape (..., parameters)

        Raises
        ------
        RequestError
            As for values; or a law whose force jumps.
        SimulationError
            A run failed, or its motion is chaotic.

        Examples
        --------
        >>> f = QuantityFunction(model, "rms:inner.y", ["bearing.clearance"], cycles=3)
        >>> f.jacobian([5e-6]).shape  # [m/m]
        (1,)
        """
        self.check_differentiable()
        rows, able, batch = self._rows(x)
        found = np.full((len(rows), len(self.of), len(self.wrt)), np.nan)
        found[able] = self._each(self._slopes, rows[able], found.shape[1:])
        return found.reshape((*batch, *self.shape, len(self.wrt)))

    def check_shape(self, shape: tuple[int, ...]) -> None:
        """Refuse parameters of another shape than (..., parameters).

        Raises
        ------
        RequestError
            They are.
        """
        if shape[-1:] != (len(self.wrt),):
            raise RequestError(
                f"parameters: an array of shape (..., {len(self.wrt)}) is expected, for {', '.join(self.wrt)}, not "
                f"{shape}."
            )

    def arguments(self, parameters: Mapping[str, T]) -> list[T | float]:
        """Values of all parameters in order, the scene's for those that a mapping leaves out.

        Raises
        ------
        RequestError
            A name that is none of `wrt`.
        """
        for name in parameters:
            if name not in self.wrt:
                raise RequestError(unknown_name("parameter of this function", name, self.wrt))
        return [parameters.get(name, value) for name, value in zip(self.wrt, self.start.tolist(), strict=True)]

    def refuse_second(self) -> NoReturn:
        """Raise `RequestError`: a second derivative was asked for."""
        raise RequestError(
            f"{', '.join(self.of)}: a second derivative was asked for (hessian, or grad of grad). Only first ones are "
            "known. Take differences of the gradient, or a method that needs none: for sums of squares Gauss-Newton, "
            "with the Jacobian."
        )

    def check_differentiable(self) -> None:
        """Refuse what has no derivative, whatever the parameters are.

        Raises
        ------
        RequestError
            A law of the scene jumps.
        """
        refuse_jumps(self._model.manifest, "derivatives")

    def _rows(self, x: ArrayLike) -> tuple[Array, NDArray[np.int_], tuple[int, ...]]:
        """The parameters as a table, the rows to run, and the shape in front."""
        given = np.asarray(x, dtype=float)
        self.check_shape(given.shape)
        rows = given.reshape(-1, len(self.wrt))
        able = np.flatnonzero(np.isfinite(rows).all(axis=1) | (self._failed == "raise"))
        return rows, able, given.shape[:-1]

    def _numbers(self, row: Array) -> Numbers:
        numbers = self._model.numbers(self._fixed | dict(zip(self.wrt, row.tolist(), strict=True)))
        check_assembly(self._model, numbers)
        return numbers

    def _by_ensemble(self, rows: Array) -> Array:
        """Values of the quantities that ensembles reduce, shape (rows, quantities)."""
        table: dict[str, object] = {name: np.full(len(rows), value) for name, value in self._fixed.items()}
        result = simulate_many(
            self._model,
            table | dict(zip(self.wrt, rows.T, strict=True)),
            list(dict.fromkeys(self._reduced.values())),
            cycles=self._span.cycles,
            duration=self._span.duration,
            transient=self._span.transient,
            rtol=self._rtol,
            method=None,
            kinks=None if self._model.manifest.borders else STEPPED_OVER,
            threads=None,
            lanes=True,
            progress=None,
        )
        if result.interrupted:
            raise KeyboardInterrupt
        if result.failures and self._failed == "raise":
            failure = result.failures[0]
            kind = RequestError if failure.status == "REFUSED" else SimulationError
            raise kind(f"{self._told(rows[failure.member])}: {failure.message}")
        return np.array([result[name] for name in self._reduced.values()]).T

    def _each(self, run: Callable[[Array], Array], rows: Array, shape: tuple[int, ...]) -> Array:
        """What runs give that are made one by one, in threads, shape (rows, *shape)."""

        def one(row: Array) -> Array:
            try:
                return run(row)
            except (RequestError, SimulationError) as error:
                if self._failed == "nan":
                    return np.full(shape, np.nan)
                kind = RequestError if isinstance(error, RequestError) else SimulationError
                raise kind(f"{self._told(row)}: {error}") from error

        with ThreadPoolExecutor(os.cpu_count()) as threads:
            return np.array(list(threads.map(one, rows))).reshape(len(rows), *shape)

    def _values(self, row: Array) -> Array:
        return np.array([item.value for item in self._course(row, slopes=False)])

    def _slopes(self, row: Array) -> Array:
        return np.array([item.slope for item in self._course(row, slopes=True)])

    def _course(self, row: Array, *, slopes: bool) -> tuple[Estimate, ...]:
        """A run of its own."""
        numbers = self._numbers(row)
        if slopes and self._chaos == "refuse":
            refuse_chaos(self._model, numbers, self._quantities, self._span)
        free = self._free[slopes]
        try:
            study = free.pop()
        except IndexError:
            study = self._study(slopes=slopes)
        stepping, _ = stepping_with_derivatives(
            self._model, numbers, study.window(numbers), rtol=self._rtol, sensitivity_rtol=10.0 * self._rtol
        )
        course = differentiate(study, numbers, self.wrt, stepping)[0] if slopes else study.measure(numbers, stepping)
        free.append(study)
        return course.estimates

    def _study(self, *, slopes: bool) -> Study:
        wanted = self._quantities if slopes else [self._quantities[k] for k in self._others]
        return Study(self._model, wanted, self._span, NODES)

    def _told(self, row: Array) -> str:
        return ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.wrt, row.tolist(), strict=True))


def _check_word(what: str, given: str, allowed: tuple[str, ...]) -> None:
    if given not in allowed:
        raise RequestError(unknown_name(f"choice of {what}", given, allowed))
