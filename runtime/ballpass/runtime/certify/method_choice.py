"""A choice of method, tolerance and treatment of kinks, which the tool makes or measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.quantity.grammar import channels_of, quantities_of
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.request.locating import LOCATED, STEPPED_OVER, Kinks
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodChoice:
    """How to integrate: a method of the stepper, its tolerance [1], what it does at kinks."""

    method: str
    rtol: float
    kinks: Kinks = STEPPED_OVER

    @property
    def words(self) -> str:
        """As text: method, tolerance, and kinks where they are located."""
        return f"{self.method}, rtol {self.rtol:g}" + (", kinks located" if self.kinks == LOCATED else "")

    def measure(self, quantities: QuantityRun, run: Run, moved: float | np.ndarray = 0.0) -> EvaluatedQuantities:
        """Quantities of a run that is integrated this way.

        Parameters
        ----------
        moved : added to the positions at the start, a number or shape (states / 2,) [m]

        Raises
        ------
        RunFailed
            The method could not reach the end.
        """
        initial = run.initial.copy()
        initial[: len(initial) // 2] += moved
        return quantities.measure(replace(run, method=self.method, rtol=self.rtol, kinks=self.kinks, initial=initial))


def stepper_run(model: LoadedModel, numbers: Numbers, request: Request) -> Run:
    """A run by the project's own stepper.  What the request leaves open is taken from the scene's run settings.

    Raises
    ------
    RequestError
        A wrong request, a linkage that cannot be assembled, or no compiler for the stepper.
    """
    return resolve(model, numbers, replace(request, method="stepper", kinks=None)).check_steady()


def compared_quantities(model: LoadedModel, of: str | Sequence[str] | None) -> tuple[Quantity, ...]:
    """Quantities whose errors are asked for; by default peak ball force, rms and range of the inner ring's motion."""
    names = default_compared(model.manifest) if of is None else (of,) if isinstance(of, str) else tuple(of)
    return quantities_of(model, names)


def default_compared(manifest: Manifest) -> tuple[str, ...]:
    """Peak ball force, rms and range of the inner ring's motion."""
    channels = [name.replace(".", "_") for name in channels_of(manifest)]
    peaks = [name for name in channels if name.endswith("ball_force")]
    rings = [name for name in channels if name.endswith(("inner_x", "inner_y"))]
    return (*(f"peak_{name}" for name in peaks), *(f"{kind}_{name}" for kind in ("rms", "range") for name in rings))


def motion_of(run: Run, values: EvaluatedQuantities) -> np.ndarray:
    """Largest and smallest value of each state, and that at the end, over its magnitude, shape (3 * states,).

    Extremes may be near the start, before errors have grown.
    """
    layout = reduction_rows(run.model.manifest)
    assert values.row is not None  # `QuantityRun` with `motion`
    assert values.end is not None
    extremes = [values.row[layout.columns[kind, name]] for kind in ("max", "min") for name in run.model.states]
    return np.asarray(np.concatenate([extremes, values.end]) / np.tile(run.magnitude, 3))
