"""CasADi's own integrator: what runs a model without a compiler, and checks the compiled stepper.

``cvodes``, SUNDIALS' variable-order BDF, takes stiff and mild models, in CasADi's virtual machine.  It integrates the
scaled states ``z = x / scale`` over the normalised time of a piece, with an absolute tolerance of one: ``scale = rtol *
magnitude`` is the tolerance, chosen at run time.  The local error of a step is kept below `rtol` times the magnitude of
each state (see `scales`).
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Mapping
from types import FrameType
from typing import Any

import casadi
import numpy as np

from ballpass.runtime.native.kernel import EvaluationError

#: Names of the methods.
METHODS = ("cvodes",)

#: CasADi's integrators end the process where two threads are in one of them, and count steps in one place for all.
_ONE_AT_A_TIME = threading.Lock()


def advance(
    function: casadi.Function, state: np.ndarray, piece: tuple[float, float], scale: np.ndarray, given: np.ndarray
) -> tuple[np.ndarray, int, int]:
    """States at the ends of an integrator's output intervals, shape (intervals, states); steps accepted and rejected.

    Parameters
    ----------
    function : from `make_integrator`
    piece : start, and length of all intervals together [s]
    scale : error allowed in a step, shape (states,)
    given : inputs, parameters and constants, one behind the other

    Raises
    ------
    EvaluationError
        The method could not go on.
    """
    with _ONE_AT_A_TIME:
        samples = _call(function, {"x0": state / scale, "p": np.concatenate([piece, scale, given])})
        statistics = function.stats()
    return samples.reshape(len(state), -1).T * scale, int(statistics["nsteps"]), int(statistics["netfails"])


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
