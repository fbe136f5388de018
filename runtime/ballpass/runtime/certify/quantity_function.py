"""Quantities of interest as a function of parameters: arrays in, arrays out, with the Jacobian.

In: a model, names of quantities and parameters, how long to run.  Out: a `QuantityFunction`, as optimisers take it;
`ballpass.jax` and `ballpass.torch` wrap it.

Values come from ensembles in lanes, which step over the kinks of the laws, derivatives from steps that end on them.
A warning names kinks that a run with derivatives meets; `QuantityFunction.certify` compares with differences.
"""

from __future__ import annotations

import os
import warnings
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Literal, NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.certify.derivative_runs import derivative_run, differentiate, differentiate_unless_chaotic
from ballpass.runtime.certify.sensitivity_query import Query, answer, length_request
from ballpass.runtime.certify.sensitivity_report import SensitivityReport
from ballpass.runtime.contract.arguments import brief, typed_methods
from ballpass.runtime.contract.defaults import FUNCTION_RTOL, FUNCTION_SLOPES, TOLERANCES
from ballpass.runtime.contract.errors import BallpassWarning, RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers, check_name, wrong_unit
from ballpass.runtime.many.ensemble import simulate_many
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.slopes import KinkWarning
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Estimate
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.request.locating import STEPPED_OVER, Kinks, check_kinks, refuse_jumps
from ballpass.runtime.request.request import tolerance
from ballpass.runtime.request.resolve import resolve
from ballpass.runtime.show.progress import shown, shown_steps

Array = NDArray[np.float64]
T = TypeVar("T")


class UnknownValueWarning(BallpassWarning):
    """A quantity is NaN for some parameters; the warning says why."""


@typed_methods
class QuantityFunction:
    """Quantities of a model over some of its parameters, all others fixed.

    Parameters
    ----------
    model : the model
    of : quantities, as for `Model.sensitivity`.  One name gives values without the axis of quantities
    wrt : parameters, in the order of the last axis of what the function is called with
    cycles, duration, transient : as for `Model.simulate`
    parameters : values of other parameters, SI.  Default: the scene's
    rtol : error allowed per step of the states [1].  Runs with derivatives have a hundredth
    kinks : treatment of the kinks of the laws in runs for values.  By default steps go over them, in lanes; ``located``
        gives the same bits as `Model.quantities` with the same options
    failed : for a value or derivative that is not known: ``raise`` an error, or give ``nan`` with a warning
    chaos : ``refuse`` derivatives of a chaotic motion, or ``ignore`` chaos

    Attributes
    ----------
    of, wrt : names
    start : values of the parameters in the scene, shape (parameters,)
    shape : of one value: (quantities,), or () for one name

    Warns
    -----
    KinkWarning
        When differentiated: a quantity has no derivative, but one on each side.  Said once for each quantity.
    UnknownValueWarning
        With ``failed="nan"``: why a quantity is NaN.  Said once for each quantity.

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
        rtol: float = FUNCTION_RTOL,
        kinks: Kinks | None = None,
        failed: Literal["raise", "nan"] = "raise",
        chaos: Literal["refuse", "ignore"] = "refuse",
    ) -> None:
        check_name("choice of failed", failed, ("raise", "nan"))
        if kinks is not None:
            check_kinks(kinks)
        check_name("choice of chaos", chaos, ("refuse", "ignore"))
        self.of = (of,) if isinstance(of, str) else tuple(of)
        self.wrt = (wrt,) if isinstance(wrt, str) else tuple(wrt)
        self.shape = () if isinstance(of, str) else (len(self.of),)
        self._model, self._failed, self._chaos, self._rtol = model, failed, chaos, tolerance("rtol", rtol)
        self._kinks = STEPPED_OVER if kinks is None and not model.manifest.borders else kinks
        numbers = model.numbers(parameters)
        self._fixed = dict(parameters or {})
        for what, names in (("of", self.of), ("wrt", self.wrt)):
            if not names or len(dict.fromkeys(names)) < len(names):
                raise RequestError(f"{what}: one name or more is expected, each once, not {list(names)!r}.")
        for name in self.wrt:
            check_name("parameter", name, numbers.parameters)
        self.start = np.array([numbers.parameters[name] for name in self.wrt])
        self._quantities = quantities_of(model, self.of)
        self._request = length_request(model, cycles, duration, transient)
        # not for two threads at once: each thread takes a free one and puts it back
        self._free: defaultdict[tuple[int, ...], list[QuantityRun]] = defaultdict(list)
        self._slope_rtol = max(FUNCTION_SLOPES * self._rtol, TOLERANCES[0])
        self._all = tuple(range(len(self.of)))
        self._said: set[tuple[type[BallpassWarning], str, str]] = set()
        resolve(model, numbers, self._request).check_steady()  # a wrong length is refused now

    def __getstate__(self) -> dict[str, Any]:
        """Without what runs have left to be taken up again, which is of this process."""
        return {**self.__dict__, "_free": defaultdict(list)}

    def __repr__(self) -> str:
        return f"QuantityFunction({self._model.manifest.scene}: {_some(self.of)} by {_some(self.wrt)})"

    def __call__(self, x: ArrayLike) -> Array:
        """Values of the quantities, SI, shape (..., quantities), or (...) for one name.

        The values of a row are equal to the bit for any other rows.

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
        if len(able):
            with shown("simulating") as tell:
                found[able] = self._by_ensemble(rows[able], tell)
        return found.reshape((*batch, *self.shape))

    def jacobian(self, x: ArrayLike) -> Array:
        """Derivatives, SI, shape (..., quantities, parameters), or (..., parameters) for one name.

        Where a quantity has a kink, as an extreme that passes from one peak to another, it is the derivative on one
        side, with a `KinkWarning` where the run shows the kink; `certify` compares both sides.

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
        if len(able):
            with shown("differentiating") as tell:
                each = self._differentiated(rows[able], tell)
            found[able] = [[item.slope for item in one] for one in each]
        return found.reshape((*batch, *self.shape, len(self.wrt)))

    def certify(
        self,
        x: ArrayLike | Mapping[str, float] | None = None,
        *,
        progress: Callable[[str, float], None] | bool | None = None,
    ) -> SensitivityReport:
        """The derivatives of `jacobian` at one point, each with a certificate, as `Model.sensitivity` gives them.

        They are compared with differences of tight runs to both sides, which takes as long as several gradients.

        Parameters
        ----------
        x : values of the parameters, SI, shape (parameters,); or some by name.  Default: the scene's
        progress : called with words and a finished fraction; else as for `Model.simulate`

        Raises
        ------
        RequestError
            As for `jacobian`; or several points.
        SimulationError
            The run failed, or its motion is chaotic.

        Examples
        --------
        >>> f = QuantityFunction(model, "rms:inner.y", ["bearing.clearance"], cycles=3)
        >>> report = f.certify({"bearing.clearance": 8e-6})
        >>> [(pair.parameter, pair.check.verdict.value) for pair in report.pairs]
        [('bearing.clearance', 'verified')]
        """
        values = self.start if x is None else self.arguments(x) if isinstance(x, Mapping) else x
        given = self._array(values)
        self.check_shape(given.shape)
        if given.ndim > 1:
            raise RequestError(f"certify: one point is expected, of shape ({len(self.wrt)},), not {given.shape}.")
        query = Query(
            of=self.of,
            wrt=self.wrt,
            request=self._request,
            rtol=self._slope_rtol,
            sensitivity_rtol=self._slope_rtol,
        )
        with shown_steps("differentiating", progress) as tell:
            return answer(self._model, self._numbers(given), replace(query, progress=tell))

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
            A name that is none of `wrt`, or values that say another unit.
        """
        infos = {info.name: info.unit for info in self._model.manifest.parameters}
        for name, value in parameters.items():
            check_name("parameter of this function", name, self.wrt)
            if wrong := wrong_unit(value, infos[name]):
                raise RequestError(f"{name}: {wrong}")
        return [parameters.get(name, value) for name, value in zip(self.wrt, self.start.tolist(), strict=True)]

    def refuse_second(self) -> NoReturn:
        """Raise `RequestError`: a second derivative was asked for."""
        raise RequestError(
            f"{', '.join(self.of)}: a second derivative was asked for (hessian, or grad of grad). Only first ones are "
            "known. Take differences of the gradient, or a method that needs none: for sums of squares Gauss-Newton, "
            "with the Jacobian."
        )

    def check_differentiable(self) -> None:
        """Refuse quantities without a derivative for any parameters.

        Raises
        ------
        RequestError
            A law of the scene jumps.
        """
        refuse_jumps(self._model.manifest, "derivatives")

    def _array(self, x: ArrayLike) -> Array:
        """The parameters as they are; refuses what is no numbers, or says another unit."""
        infos = {info.name: info.unit for info in self._model.manifest.parameters}
        if wrong := wrong_unit(x, *(infos[name] for name in self.wrt)):
            raise RequestError(f"parameters: {wrong}")
        try:
            return np.asarray(x, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise RequestError(
                f"parameters: an array of numbers, SI, is expected, not {brief(x)} ({type(x).__name__}). A mapping "
                "from names goes through `arguments`."
            ) from None

    def _rows(self, x: ArrayLike) -> tuple[Array, NDArray[np.int_], tuple[int, ...]]:
        """The parameters as a table, the rows to run, and the shape in front."""
        given = self._array(x)
        self.check_shape(given.shape)
        rows = given.reshape(-1, len(self.wrt))
        finite = np.isfinite(rows).all(axis=1)
        able = np.flatnonzero(finite | (self._failed == "raise"))
        if self._failed == "nan" and len(able) < len(rows):
            row = rows[np.flatnonzero(~finite)[0]]
            unknown = [(name, row, "a parameter is no finite number") for name in self.of]
            self._warn(UnknownValueWarning, unknown, "input")
        return rows, able, given.shape[:-1]

    def _numbers(self, row: Array) -> Numbers:
        return self._model.numbers(self._fixed | dict(zip(self.wrt, row.tolist(), strict=True)))

    def _by_ensemble(self, rows: Array, tell: Callable[[float], None] | None) -> Array:
        """Values of the quantities, shape (rows, quantities)."""
        table: dict[str, object] = {name: np.full(len(rows), value) for name, value in self._fixed.items()}
        result = simulate_many(
            self._model,
            table | dict(zip(self.wrt, rows.T, strict=True)),
            list(self.of),
            cycles=self._request.cycles,
            duration=self._request.duration,
            transient=self._request.transient_cycles,
            rtol=self._rtol,
            kinks=self._kinks,
            progress=tell,
        )
        if result.interrupted:
            raise KeyboardInterrupt
        if result.failures and self._failed == "raise":
            failure = result.failures[0]
            kind = RequestError if failure.status == "REFUSED" else SimulationError
            raise kind(f"{self._told(rows[failure.member])}: {failure.message}")
        failed = [
            (name, rows[failure.member], failure.message)
            for failure in result.failures
            for name in self.of
            if np.isnan(result[name][failure.member])
        ]
        self._warn(UnknownValueWarning, failed)
        return np.array([result[name] for name in self.of]).T

    def _differentiated(self, rows: Array, tell: Callable[[float], None] | None) -> list[list[Estimate]]:
        """Quantities of rows with their derivatives, each run by itself, in threads."""
        found: list[dict[int, Estimate]] = []
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            for one in threads.map(lambda row: self._known(row, self._all), rows):
                found.append(one)
                if tell is not None:
                    tell(len(found) / len(rows))
        each = [(self.of[k], row, item) for row, one in zip(rows, found, strict=True) for k, item in one.items()]
        nan = [
            (name, row, " ".join(item.notes)) for name, row, item in each if np.isnan([item.value, *item.slope]).any()
        ]
        self._warn(UnknownValueWarning, nan)
        self._warn(KinkWarning, [(name, row, item.kink) for name, row, item in each if item.kink])
        return [[one[k] for k in self._all] for one in found]

    def _known(self, row: Array, of: tuple[int, ...]) -> dict[int, Estimate]:
        """Quantities of a row; where NaN is asked for and they fail together, one by one."""
        try:
            return dict(zip(of, self._row(row, of), strict=True))
        except (RequestError, SimulationError) as error:
            if self._failed == "raise":
                kind = RequestError if isinstance(error, RequestError) else SimulationError
                raise kind(f"{self._told(row)}: {error}") from error
            # a failed run gives no values, but rings at rest need no run
            at_rest = any(KINDS[self._quantities[k].kind].at_rest is not None for k in of)
            if len(of) > 1 and (at_rest or isinstance(error, RequestError)):
                return {k: item for one in of for k, item in self._known(row, (one,)).items()}
            unknown = Estimate(value=np.nan, slope=np.full(len(self.wrt), np.nan), notes=(str(error),))
            return dict.fromkeys(of, unknown)

    def _row(self, row: Array, of: tuple[int, ...]) -> tuple[Estimate, ...]:
        """A run of its own."""
        numbers = self._numbers(row)
        quantities = [self._quantities[k] for k in of]
        try:
            along = self._free[of].pop()
        except IndexError:
            along = QuantityRun(self._model, quantities)
        run, _ = derivative_run(self._model, numbers, replace(self._request, rtol=self._slope_rtol))
        if self._chaos == "refuse":
            found, _ = differentiate_unless_chaotic(along, run, self._request, self.wrt, self._slope_rtol)
        else:
            found, _ = differentiate(along, run, self.wrt, self._slope_rtol)
        self._free[of].append(along)
        return found.estimates

    def _warn(self, kind: type[BallpassWarning], unknown: Sequence[tuple[str, Array, str]], cause: str = "run") -> None:
        """Warn, once for each quantity and cause: wrong input must not silence what a run says."""
        fresh: dict[str, list[str]] = {}
        for name, row, words in unknown:
            if (kind, cause, name) not in self._said:
                self._said.add((kind, cause, name))
                fresh.setdefault(f"{words} ({self._told(row)})", []).append(name)
        for words, names in fresh.items():
            warnings.warn(f"{_some(names)}: {words}. Said once of each quantity.", kind, stacklevel=4)

    def _told(self, row: Array) -> str:
        return _some([f"{name} = {value:.9g}" for name, value in zip(self.wrt, row.tolist(), strict=True)])


def _some(names: Sequence[str]) -> str:
    return f"{', '.join(names[:3])}{', ...' if len(names) > 3 else ''}"
