"""A loaded model evaluated at one instant: numbers, outputs, derivatives, positions at rest."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.arguments import typed_methods
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, real
from ballpass.runtime.contract.plausible_ranges import warn_unusual
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import checked_time, evaluate_point
from ballpass.runtime.point.jacobian_function import JacobianFunction
from ballpass.runtime.point.second_derivatives import hessian
from ballpass.runtime.point.slopes import jacobian
from ballpass.runtime.request.assembly import check_assembly
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoints

if TYPE_CHECKING:
    from ballpass.runtime.point.equilibrium import StaticEquilibrium


@typed_methods
class PointModel(LoadedModel):
    """Evaluations of a model without a run.  `ballpass.runtime.model.Model` adds runs and their results."""

    _looked_usual = b""  # parameters that were last compared with the usual ones

    def numbers(self, parameters: Mapping[str, float] | None = None) -> Numbers:
        """Parameters with overrides, checked, and the derived constants that follow.

        Warns
        -----
        UnusualWarning
            A number is allowed, but outside of its usual range (`Manifest.usual`).

        Examples
        --------
        >>> numbers = model.numbers({"bearing.clearance": 8e-6})
        >>> numbers.p.shape, numbers.c.shape
        ((41,), (40,))
        >>> numbers.values["bearing.clearance"]  # [m]
        8e-06
        """
        numbers = super().numbers(parameters)
        looked_at = numbers.p.tobytes()
        if looked_at != self._looked_usual:
            self._looked_usual = looked_at
            warn_unusual(self.manifest, numbers.values)
        return numbers

    def constants(self, parameters: Mapping[str, float] | None = None) -> dict[str, float]:
        """Derived constants (stiffness, cage ratio, ...) by name, for the defaults with `parameters` put in.

        Examples
        --------
        >>> f"{model.constants()['bearing.k_b']:.3g}"  # [N/m^1.5]
        '8.64e+09'
        """
        values = self.numbers(parameters).values
        return {info.name: values[info.name] for info in self.manifest.constants}

    def period(self, parameters: Mapping[str, float] | None = None) -> float:
        """Time of a turn of driver or shaft [s], behind the last row of a table of its speed; infinite where it stands.

        Examples
        --------
        >>> f"{model.period():.4g} s"
        '0.12 s'
        """
        return timeline.driver(self.manifest, self.numbers(parameters).values).turn

    def breakpoints(self, t0: float, t1: float, parameters: Mapping[str, float] | None = None) -> np.ndarray:
        """Times in the open interval (t0, t1) at which a load switches or a table has a knot, increasing [s].

        Examples
        --------
        >>> model.breakpoints(0.0, model.period()).round(4)  # [s]: the punch's window
        array([0.079, 0.089])
        """
        if not -math.inf < real(t0) < real(t1) < math.inf:
            raise RequestError(f"breakpoints: finite times t0 < t1 are expected, not {t0!r} and {t1!r}.")
        return breakpoints(self.manifest, self.numbers(parameters).values, float(t0), float(t1))

    def inputs_at(self, t: float, parameters: Mapping[str, float] | None = None) -> np.ndarray:
        """Inputs ``u`` at time `t`, for functions that are then called with ``t = 0``; shape (inputs,).

        Examples
        --------
        >>> model.inputs_at(0.01).shape
        (4,)
        """
        return timeline.inputs_at(self.manifest, self.numbers(parameters).values, checked_time(t))

    def initial(self, parameters: Mapping[str, float] | None = None) -> np.ndarray:
        """State at the start, shape (states,).

        Examples
        --------
        >>> model.initial().shape, model.states[0]
        ((8,), 'inner.x')
        """
        values = self.numbers(parameters).values
        return np.array([values[name] for name in self.manifest.initial], dtype=float)

    def evaluate(
        self,
        t: float,
        x: Sequence[float] | np.ndarray | None = None,
        outputs: str | Sequence[str] | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> dict[str, float | np.ndarray]:
        """Outputs at one time and state.

        Parameters
        ----------
        t : time [s]
        x : state, shape (states,).  Default: the initial one
        outputs : names.  Default: all
        parameters : overrides, SI

        Returns
        -------
        dict from name to number, or to array of shape (balls,)

        Raises
        ------
        RequestError
            Unknown names, a state of another shape, or a linkage that cannot be assembled at `t`, as in all evaluations
            at one instant.  It may lock at others: `check_assembly` checks a turn.

        Examples
        --------
        >>> there = model.evaluate(0.07, outputs=["drive_torque", "ball.force"])
        >>> round(there["drive_torque"], 1), there["ball.force"].shape  # [N m], [N]
        (-1.8, (8,))
        """
        return evaluate_point(self, self.numbers(parameters), t, x, outputs)

    def check_assembly(self, parameters: Mapping[str, float] | None = None) -> None:
        """Raise `RequestError`, naming joint and crank angle, when the linkage locks somewhere in a turn.

        Examples
        --------
        >>> model.check_assembly()
        >>> model.check_assembly({"mechanism.bodies.crank.points.B": 0.5})
        Traceback (most recent call last):
            ...
        RequestError: The linkage cannot be assembled at joint 'C' at crank angle 0.00 deg, where it starts ...
        """
        check_assembly(self, self.numbers(parameters))

    def jacobian(
        self,
        of: str | Sequence[str],
        wrt: str | Sequence[str] = "states",
        *,
        t: float = 0.0,
        x: Sequence[float] | np.ndarray | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> np.ndarray:
        """Derivative of the right-hand side or of quantities at one time and state, from generated code.

        Parameters
        ----------
        of : "rhs", or names or patterns of quantities ("ball.force", "reaction.A.*"), whether a run reports them or
            not; `manifest.quantities` lists them
        wrt : "states", "time", "crank_angle" (time over speed: everything moves except the rings), names of states or
            parameters, or several of these.  Derivatives along parameters are total: through the derived constants,
            the phases and the tables as well, at fixed state.  Gates are flat (they jump at edges).
        t : time [s]
        x : state.  Default: the initial one
        parameters : overrides, SI

        Returns
        -------
        array, shape (rows, columns); a single number as `of` has no rows, a single name as `wrt` no columns

        Warns
        -----
        KinkWarning
            Balls rest on the corner of a one-sided law, and the quantity has two slopes there, whose mean
            is given.  Sums over balls, as "rhs", often have a single slope there.

        Raises
        ------
        RequestError
            Unknown names, with the nearest ones, or a linkage that cannot be assembled at `t`.

        Examples
        --------
        >>> rest = model.static_equilibrium(crank_angle=4.2)
        >>> model.jacobian("rhs", "states", t=rest.time, x=rest.x).shape
        (8, 8)
        >>> slope = model.jacobian("ball.force", "bearing.clearance", t=rest.time, x=rest.x)
        >>> slope.shape  # [N/m]
        (8,)
        """
        return jacobian(self, self.numbers(parameters), of, wrt, t=t, x=x)

    def jacobian_function(
        self,
        of: str | Sequence[str],
        wrt: str | Sequence[str] = "states",
        *,
        t: float = 0.0,
        parameters: Mapping[str, float] | None = None,
    ) -> JacobianFunction:
        """The same, sparse and prepared for many states: ``J = model.jacobian_function("ball.force"); J(x)``.

        Where balls rest on the corner of a one-sided law it gives the slope on the side of release, without a warning.

        Examples
        --------
        >>> J = model.jacobian_function("ball.force", "states")
        >>> J(model.initial()).shape, J.to_dense().shape  # entries; balls, states
        ((64,), (8, 8))
        """
        return JacobianFunction(self, self.numbers(parameters), of, wrt, t=t)

    def hessian(
        self,
        of: str | Sequence[str],
        wrt: tuple[str, str],
        *,
        t: float = 0.0,
        x: Sequence[float] | np.ndarray | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> np.ndarray:
        """Second derivatives by a pair of names at one time and state, shape (rows,), as for `jacobian`.

        Raises
        ------
        RequestError
            Unknown names, or laws without a bounded second derivative: Hertz's at contact onset.

        Examples
        --------
        >>> bend = model.hessian("drive_torque", ("crank_angle", "crank_angle"), t=0.01)
        >>> f"{bend:.3g} N m/rad^2"
        '2.19 N m/rad^2'
        """
        return hessian(self, self.numbers(parameters), of, wrt, t=t, x=x)

    def static_equilibrium(
        self,
        t: float | None = None,
        *,
        crank_angle: float | None = None,
        parameters: Mapping[str, float] | None = None,
        load: tuple[float, float] | None = None,
    ) -> StaticEquilibrium:
        """Positions at which the rings rest under the load of one instant, everything at rest, no damping force.

        Parameters
        ----------
        t, crank_angle : the instant: time [s], default 0, or angle of crank or shaft in the first turn in radians,
            at most two turns
        parameters : overrides, SI
        load : on the inner ring, x and y [N], instead of the scene's

        Warns
        -----
        FreeRingWarning
            The rings can move without force along some direction: the place is one of many.

        Raises
        ------
        RequestError
            No bearing, an unloaded ring in a clearance, or a linkage that cannot be assembled at that instant.
        SimulationError
            Nothing holds the rings.

        Examples
        --------
        >>> rest = model.static_equilibrium(crank_angle=4.2)  # [rad]
        >>> f"{1e6 * rest['inner.y']:.1f} um, {rest.peak_ball_force:.0f} N"
        '132.2 um, 2385 N'
        """
        from ballpass.runtime.point.equilibrium import instant, static_equilibrium  # with SciPy

        numbers = self.numbers(parameters)
        return static_equilibrium(self, numbers, t=instant(self, numbers, t, crank_angle), load=load)
