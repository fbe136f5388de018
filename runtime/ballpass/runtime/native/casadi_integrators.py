"""CasADi's own integrator: what runs a model without a compiler, and checks the compiled stepper.

``cvodes``, SUNDIALS' variable-order BDF, takes stiff and mild models, in CasADi's virtual machine.  It integrates the
scaled states ``z = x / scale`` over the normalised time of a piece, with an absolute tolerance of one: ``scale = rtol *
magnitude`` is the tolerance, chosen at run time.  The local error of a step is kept below `rtol` times the magnitude of
each state (see `scales`).
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import FrameType
from typing import Any

import casadi
import numpy as np

from ballpass.runtime.native.kernel import EvaluationError

#: Gives the integrator over so many output intervals.
Maker = Callable[[int], casadi.Function]

#: CasADi's integrators end the process where two threads are in one of them, and count steps in one place for all.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class Frozen:
    """What stays constant during a piece: scale of the states, inputs, parameters, constants."""

    scale: np.ndarray
    u: np.ndarray
    p: np.ndarray
    c: np.ndarray

    def pack(self, start: float, step: float) -> np.ndarray:
        """The integrators' parameter vector: start, step, scale, u, p, c one behind the other, shape (n,)."""
        return np.concatenate([(start, step), self.scale, self.u, self.p, self.c])


class VirtualIntegrator:
    """The integrator at work on one model.

    Parameters
    ----------
    make : gives it over so many output intervals, as `Model.virtual_integrator` does

    Attributes
    ----------
    steps, rejected : accepted and rejected steps so far
    """

    def __init__(self, make: Maker) -> None:
        self._make = make
        self.steps = 0
        self.rejected = 0

    def advance(self, state: np.ndarray, start: float, step: float, intervals: int, frozen: Frozen) -> np.ndarray:
        """States at ``start + step * k / intervals``, k = 1 ... intervals; shape (intervals, states).

        Raises
        ------
        EvaluationError
            The method could not go on.
        """
        function = self._make(intervals)
        with _ONE_AT_A_TIME:
            samples = _call(function, {"x0": state / frozen.scale, "p": frozen.pack(start, step)})
            statistics = function.stats()
        self.steps += int(statistics["nsteps"])
        self.rejected += int(statistics["netfails"])
        return np.asarray(samples.reshape(len(state), intervals).T * frozen.scale)


def make_integrator(rhs: casadi.Function, sizes: Mapping[str, int], intervals: int) -> casadi.Function:
    """Integrator of the scaled states of `rhs` over a normalised step, in the virtual machine.

    Parameters
    ----------
    rhs : right-hand side as an expression graph, with the arguments t, x, u, p, c or some of them
    sizes : lengths of u, p and c
    intervals : equal output intervals
    """
    names = rhs.name_in()
    symbols = {name: casadi.SX.sym(name, sizes[name]) for name in ("u", "p", "c")}
    count = rhs.size1_out(0)
    time, start, step = (casadi.SX.sym(name) for name in ("s", "start", "step"))
    scaled, scale = casadi.SX.sym("z", count), casadi.SX.sym("scale", count)
    given = {"t": start + step * time, "x": scaled * scale, **symbols}
    (rate,) = rhs.call([given[name] for name in names])
    equations = {
        "t": time,
        "x": scaled,
        "p": casadi.vertcat(start, step, scale, *symbols.values()),
        "ode": step * rate / scale,
    }
    # the relative part is there only because it may not be zero
    options: dict[str, Any] = {"abstol": 1.0, "reltol": 1e-14, "max_num_steps": 100_000, "show_eval_warnings": False}
    grid = [k / intervals for k in range(1, intervals + 1)]
    return casadi.integrator(f"cvodes_{intervals}", "cvodes", equations, 0.0, grid, options)


#: Name of the method to how it is made.
METHODS: Mapping[str, Callable[[Maker], VirtualIntegrator]] = {"cvodes": VirtualIntegrator}


def _call(function: casadi.Function, values: Mapping[str, Any]) -> np.ndarray:
    """CasADi's integrators report Ctrl-C as a right-hand side that failed: it is noted, and is Ctrl-C again behind."""
    before = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()
    heard = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal heard
        heard = True
        if callable(before):
            before(number, frame)

    if main:
        signal.signal(signal.SIGINT, note)
    try:
        return np.asarray(function(**values)["xf"].full())
    except RuntimeError as fault:
        if heard:
            raise KeyboardInterrupt from None
        lines = [line.strip() for line in str(fault).splitlines() if line.strip()]
        raise EvaluationError(f"{function.name()}: {lines[-1] if lines else 'failed'}") from fault
    finally:
        if main:
            signal.signal(signal.SIGINT, before)
