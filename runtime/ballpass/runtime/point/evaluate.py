"""Functions at one time and state: the point they are called at, and the outputs there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, Parameters, real, unchecked_numbers, vector
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.assembly import check_assembled
from ballpass.runtime.request.request import no_output
from ballpass.runtime.time import timeline
from ballpass.runtime.time.span import MOST_TIME


def evaluate_point(
    model: LoadedModel,
    numbers: Numbers,
    t: float,
    x: Sequence[float] | np.ndarray | None,
    outputs: str | Sequence[str] | None,
) -> dict[str, float | np.ndarray]:
    """Outputs at one time and state; see `ballpass.runtime.Model.evaluate`.

    Raises
    ------
    RequestError
        No such output, a time that is not finite, a state of another shape, or a linkage that cannot be assembled then.
    """
    wanted = list(model.outputs) if outputs is None else [outputs] if isinstance(outputs, str) else list(outputs)
    for name in wanted:
        if name not in model.outputs:
            raise RequestError(no_output(model.manifest, name, model.outputs))
    if not wanted:
        return {}
    kernel = model.kernel("outputs")
    kernel.run(point(model, numbers, checked_time(t), x))
    results: dict[str, float | np.ndarray] = {}
    for info, output in zip(model.manifest.outputs, kernel.function.name_out(), strict=True):
        if info.name in wanted:
            value = kernel.output(output)
            results[info.name] = value if info.size > 1 else float(value[0])
    return results


def neighbour(model: LoadedModel, numbers: Numbers, change: Mapping[str, float]) -> Numbers:
    """Numbers beside those of a run.  Bounds do not apply: a difference may step slightly beyond a bound."""
    manifest = model.manifest
    parameters = Parameters(manifest.parameters, {**numbers.parameters, **change})
    return unchecked_numbers(manifest, parameters, lambda p: model.kernel("constants")({"p": p}))


def point(
    model: LoadedModel, numbers: Numbers, t: float, x: Sequence[float] | np.ndarray | None
) -> dict[str, float | np.ndarray]:
    """Arguments of a generated function at time `t` and state `x` (None: the initial one): t, x, u, p, c by name.

    Raises
    ------
    RequestError
        `x` has another shape than (states,), or the linkage cannot be assembled at `t`.  Other instants do not count.
    """
    state = np.array([numbers.values[name] for name in model.manifest.initial]) if x is None else vector(x)
    if state.shape != (len(model.states),) or not np.all(np.isfinite(state)):
        raise RequestError(
            f"x: shape ({len(model.states)},) is expected ({', '.join(model.states)}), not {state.shape}"
            f"{'' if np.all(np.isfinite(state)) else ' with NaN or inf'}."
        )
    u = timeline.inputs_at(model.manifest, numbers.values, t)
    there: dict[str, float | np.ndarray] = {"t": 0.0, "x": state, "u": u, "p": numbers.p, "c": numbers.c}
    check_assembled(model, numbers, t, there)
    return there


def checked_time(t: float) -> float:
    """A time [s] at which angles have digits left; RequestError for anything else."""
    value = real(t)
    if not abs(value) <= MOST_TIME:
        raise RequestError(f"t: a time [s] of at most {MOST_TIME:g} s is expected, not {t!r}.")
    return value
