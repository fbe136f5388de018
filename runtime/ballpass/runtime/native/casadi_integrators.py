"""CasADi's integration methods, behind one interface and a registry of names.

Every method integrates the scaled states ``z = x / scale`` over the normalised time of a piece, with an absolute
tolerance of one: ``scale = rtol * magnitude`` is the tolerance, chosen at run time.  The local error of a step is kept
below `rtol` times the magnitude of each state (see `scales`).  All run in CasADi's virtual machine: they need no
compiler, and check the compiled stepper.

erk         explicit Runge-Kutta 5(4)
rosenbrock  linearly implicit, L-stable, order 5(4)
cvodes      SUNDIALS' variable-order BDF

A further method is a line in `METHODS`.
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

#: Output intervals of the one-step methods with a fine grid.
GRID = 64

#: Gives the integrator of a plugin over so many output intervals.
Maker = Callable[[str, int], casadi.Function]

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
    """One of CasADi's plugins at work on one model.

    Parameters
    ----------
    make : gives the integrator of a plugin over so many output intervals, as `Model.virtual_integrator` does
    plugin : ``cvodes``, or what a derived class is for

    Attributes
    ----------
    steps, rejected : accepted and rejected steps so far
    """

    #: Names under which the plugin counts accepted and rejected steps.
    counters = ("nsteps", "netfails")

    def __init__(self, make: Maker, plugin: str) -> None:
        self._make = make
        self._plugin = plugin
        self.steps = 0
        self.rejected = 0

    def pieces(self, intervals: int) -> list[int]:
        """Numbers of intervals, adding up to `intervals`, that single calls can take.

        All at once: a multistep method starts with tiny steps, so there are as few starts as possible.
        """
        return [intervals] if intervals else []

    def advance(self, state: np.ndarray, start: float, step: float, intervals: int, frozen: Frozen) -> np.ndarray:
        """States at ``start + step * k / intervals``, k = 1 ... intervals; shape (intervals, states).

        Raises
        ------
        EvaluationError
            The method could not go on.
        """
        function = self._make(self._plugin, intervals)
        with _ONE_AT_A_TIME:
            samples = _call(function, {"x0": state / frozen.scale, "p": frozen.pack(start, step)})
            statistics = function.stats()
        self.steps += int(statistics[self.counters[0]])
        self.rejected += int(statistics[self.counters[1]])
        return np.asarray(samples.reshape(len(state), intervals).T * frozen.scale)


class OneStepIntegrator(VirtualIntegrator):
    """``erk`` and ``rosenbrock``: functions for a grid of 1 and of `GRID` intervals, whatever a run is sampled like.

    A piece of fewer intervals (a power of two) is integrated on the fine grid, of which every second, fourth ... point
    is kept: outputs within a step cost next to nothing, another function would take a fraction of a second to make.
    """

    counters = ("n_steps", "n_reject")

    def pieces(self, intervals: int) -> list[int]:
        """Powers of two, as many of `GRID` as there are."""
        sizes = []
        size = GRID
        while intervals:
            count, intervals = divmod(intervals, size)
            sizes += [size] * count
            size //= 2
        return sizes

    def advance(self, state: np.ndarray, start: float, step: float, intervals: int, frozen: Frozen) -> np.ndarray:
        """As `VirtualIntegrator` does, on one of two grids."""
        grid = 1 if intervals == 1 else GRID
        every = grid // intervals
        return super().advance(state, start, step, grid, frozen)[every - 1 :: every]


def make_integrator(rhs: casadi.Function, sizes: Mapping[str, int], plugin: str, intervals: int) -> casadi.Function:
    """One of CasADi's integrators for the scaled states of `rhs` over a normalised step, in the virtual machine.

    Parameters
    ----------
    rhs : right-hand side as an expression graph, with the arguments t, x, u, p, c or some of them
    sizes : lengths of u, p and c
    plugin : ``cvodes``, ``erk``, ``rosenbrock``
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
    # the relative part is there only because some plugins want one
    options: dict[str, Any] = {"abstol": 1.0, "reltol": 1e-14, "max_num_steps": 1_000_000, "show_eval_warnings": False}
    if plugin != "cvodes" and intervals > 1:
        options["control_group_size"] = [intervals]  # steps may cross output times
    grid = [k / intervals for k in range(1, intervals + 1)]
    return casadi.integrator(f"{plugin}_{intervals}", plugin, equations, 0.0, grid, options)


#: Name of a method to how it is made; the order is that of messages.
METHODS: Mapping[str, Callable[[Maker], VirtualIntegrator]] = {
    "erk": lambda make: OneStepIntegrator(make, "erk"),
    "rosenbrock": lambda make: OneStepIntegrator(make, "rosenbrock"),
    "cvodes": lambda make: VirtualIntegrator(make, "cvodes"),
}


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
