"""A generated model at work: load, look, evaluate, simulate, differentiate."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import casadi
import numpy as np

from raceway.runtime import clock
from raceway.runtime.assembly import check_assembly
from raceway.runtime.compile import CompiledLibrary, Compiler, compile_model, find_compiler
from raceway.runtime.ensemble import EnsembleResult, simulate_many
from raceway.runtime.ensemble_driver import EnsembleDriver, compile_ensemble
from raceway.runtime.errors import ArtefactError, CompileError, RequestError
from raceway.runtime.integrators import available_methods, make_integrator
from raceway.runtime.kernel import Kernel, Loop
from raceway.runtime.manifest import Manifest, check_files, read_manifest
from raceway.runtime.members import Table
from raceway.runtime.parameters import Parameters, resolve_parameters, unknown_name
from raceway.runtime.peaks import Peak, refine_peak
from raceway.runtime.reductions import Reductions, reduce_run
from raceway.runtime.sensitivity import Sensitivities, sensitivities
from raceway.runtime.simulate import Numbers, Request, run_length, simulate, start_state
from raceway.runtime.stepper import HEADERS, Stepper, compile_stepper
from raceway.runtime.stepper import METHODS as STEPPERS

if TYPE_CHECKING:
    from raceway.runtime.solution import Solution

#: Name of the file with the serialised functions in a generated folder.
FUNCTIONS = "model.casadi"


def load(folder: str | Path, *, compiler: str | None = None, verify: bool = True) -> Model:
    """Load a generated folder; compile its C when no cached library fits.

    Parameters
    ----------
    folder : what `raceway derive` wrote
    compiler : command of a C compiler.  Default: $CC, cc, gcc, clang, ziglang, whichever is there first
    verify : refuse files that differ from the manifest's digests

    Warns
    -----
    NoCompilerWarning
        There is no compiler: the functions run in CasADi's virtual machine.

    Raises
    ------
    ArtefactError
        No such folder, a manifest that is wrong or of another schema, edited files.
    CompileError
        The compiler failed.
    """
    manifest = read_manifest(folder)
    if verify:
        check_files(folder, manifest)
    # absolute: the compiler runs in the cache folder, and functions may be read after the process has moved elsewhere
    place = Path(folder).absolute()
    return Model(place, manifest, compile_model(place, manifest, compiler), compiler=compiler)


class Model:
    """Functions of one scene with their names, units and defaults.  All numbers are SI.

    Not for several threads at once: evaluations share memory.  Processes may each load their own.

    Attributes
    ----------
    manifest : what the model consists of
    library : the compiled library, None when CasADi's virtual machine runs the functions
    """

    def __init__(
        self, folder: Path, manifest: Manifest, library: CompiledLibrary | None, *, compiler: str | None = None
    ) -> None:
        self.manifest = manifest
        self.library = library
        self._folder = folder
        self._functions: dict[str, casadi.Function] = {}
        self._kernels: dict[str, Kernel] = {}
        self._loops: dict[tuple[str, tuple[str, ...]], Loop] = {}
        self._symbolic: dict[str, casadi.Function] = {}
        self._compiler = compiler
        self._stepper: Stepper | None = None
        self._ensemble: EnsembleDriver | None = None
        self._differentiating: Stepper | None = None

    def __repr__(self) -> str:
        how = "compiled" if self.compiled else "in CasADi's virtual machine"
        return (
            f"Model({self.manifest.scene}: {len(self.states)} states, {len(self.manifest.parameters)} parameters, "
            f"{len(self.outputs)} outputs, {how})"
        )

    @property
    def compiled(self) -> bool:
        """Whether generated C runs."""
        return self.library is not None

    @property
    def parameters(self) -> Parameters:
        """Names and defaults; prints as a table with units and descriptions."""
        return resolve_parameters(self.manifest, None)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: positions, then velocities."""
        return tuple(state.name for state in self.manifest.states)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(output.name for output in self.manifest.outputs)

    @property
    def methods(self) -> tuple[str, ...]:
        """Integration methods of this model, besides ``auto``."""
        return (*(STEPPERS if self.has_stepper else ()), *available_methods(self))

    @property
    def has_stepper(self) -> bool:
        """Whether the folder brings the kernels of the project's own stepper, and a compiler made code of the rest."""
        return self.compiled and all((self._folder / name).is_file() for name in HEADERS)

    @property
    def stepper(self) -> Stepper:
        """The project's own stepper, compiled when first asked for.

        Raises
        ------
        RequestError
            There is no compiler, or the folder brings no kernels.
        CompileError
            The compiler failed.
        """
        if self._stepper is None:
            self._stepper = self._make_stepper(sensitivities=False)
        return self._stepper

    @property
    def differentiating_stepper(self) -> Stepper:
        """The stepper with the derivatives of its steps, compiled when first asked for; errors as for `stepper`."""
        if self._differentiating is None:
            self._differentiating = self._make_stepper(sensitivities=True)
        return self._differentiating

    @property
    def ensemble_driver(self) -> EnsembleDriver:
        """The driver of ensembles and reductions, compiled when first asked for; errors as for `stepper`."""
        if self._ensemble is None:
            library = compile_ensemble(self._folder, self.manifest, self._stepper_compiler())
            self._ensemble = EnsembleDriver(library, self.manifest)
        return self._ensemble

    def _stepper_compiler(self) -> Compiler:
        compiler = find_compiler(self._compiler) if self.has_stepper else None
        if compiler is None:
            raise RequestError(
                "method stepper: it needs a C compiler and the kernels in the generated folder. Install gcc or "
                "clang, write the folder again, or take another method."
            )
        return compiler

    def _make_stepper(self, *, sensitivities: bool) -> Stepper:
        compiler = self._stepper_compiler()
        library = compile_stepper(self._folder, self.manifest, compiler, sensitivities=sensitivities)
        return Stepper(library, self.manifest)

    def has(self, name: str) -> bool:
        """Whether the model has a function of that name."""
        return any(info.name == name for info in self.manifest.functions)

    def function(self, name: str) -> casadi.Function:
        """CasADi function by name, compiled if possible.

        Raises
        ------
        RequestError
            The model has no such function.
        """
        if name not in self._functions:
            self._functions[name] = self._external(name) if self.compiled else self.symbolic(name)
        return self._functions[name]

    def kernel(self, name: str) -> Kernel:
        """Function by name on memory of its own: ``kernel({"t": 0.0, "x": x, ...})`` costs microseconds."""
        if name not in self._kernels:
            self._kernels[name] = Kernel(self.function(name))
        return self._kernels[name]

    def loop(self, name: str, varying: tuple[str, ...]) -> Loop:
        """Function by name for many points at once; `varying` names the inputs that change between them."""
        if (name, varying) not in self._loops:
            self._loops[name, varying] = Loop(self.function(name), varying)
        return self._loops[name, varying]

    def symbolic(self, name: str) -> casadi.Function:
        """CasADi function by name as an expression graph, which can be differentiated further."""
        self._require(name)
        if not self._symbolic:
            self._symbolic = _read_functions(self._folder / FUNCTIONS)
        if name not in self._symbolic:
            plugin, _, intervals = name.rpartition("_")
            if name == "rhs" or not intervals.isdecimal():
                raise ArtefactError(f"{self._folder / FUNCTIONS}: has no function {name!r}. Write the folder again.")
            # the integrators are generated to C only; here they are made from the right-hand side
            self._symbolic[name] = self.virtual_integrator(plugin, int(intervals))
        return self._symbolic[name]

    def virtual_integrator(self, plugin: str, intervals: int) -> casadi.Function:
        """Integrator of one of CasADi's plugins over a grid, in the virtual machine (see `integrators`)."""
        manifest = self.manifest
        sizes = {"u": len(manifest.inputs), "p": len(manifest.parameters), "c": len(manifest.constants)}
        return make_integrator(self.symbolic("rhs"), sizes, plugin, intervals)

    def numbers(self, parameters: Mapping[str, float] | None = None) -> Numbers:
        """Parameters with overrides, checked, and the derived constants that follow."""
        resolved = resolve_parameters(self.manifest, parameters)
        p = np.array(list(resolved.values()), dtype=float)
        c = np.zeros(0)
        if self.manifest.constants:
            c = self.kernel("constants")({"p": p})
            if not np.all(np.isfinite(c)):
                bad = [
                    info.name
                    for info, value in zip(self.manifest.constants, c, strict=True)
                    if not math.isfinite(value)
                ]
                raise RequestError(
                    f"With these parameters the derived constants {', '.join(bad)} are not finite numbers. "
                    "Check the values that were changed: geometry and elastic constants must be physical."
                )
        values = dict(resolved)
        values.update((info.name, float(value)) for info, value in zip(self.manifest.constants, c, strict=True))
        return Numbers(parameters=resolved, p=p, c=c, values=values)

    def constants(self, parameters: Mapping[str, float] | None = None) -> dict[str, float]:
        """Derived constants (stiffness, cage ratio, ...) by name, for the defaults with `parameters` put in."""
        values = self.numbers(parameters).values
        return {info.name: values[info.name] for info in self.manifest.constants}

    def period(self, parameters: Mapping[str, float] | None = None) -> float:
        """Time of one turn of driver or shaft [s]; infinite when nothing turns."""
        return clock.period(self.manifest, self.numbers(parameters).values)

    def breakpoints(self, t0: float, t1: float, parameters: Mapping[str, float] | None = None) -> np.ndarray:
        """Times in the open interval (t0, t1) at which a load switches or a table has a knot, increasing [s]."""
        if not (math.isfinite(t0) and math.isfinite(t1) and t0 < t1):
            raise RequestError(f"breakpoints: finite times t0 < t1 are expected, not {t0!r} and {t1!r}.")
        return clock.breakpoints(self.manifest.inputs, self.numbers(parameters).values, float(t0), float(t1))

    def inputs_at(self, t: float, parameters: Mapping[str, float] | None = None) -> np.ndarray:
        """Inputs ``u`` at time `t`, for functions that are then called with ``t = 0``; shape (inputs,)."""
        return clock.inputs_at(self.manifest.inputs, self.numbers(parameters).values, _time(t))

    def initial(self, parameters: Mapping[str, float] | None = None) -> np.ndarray:
        """State at the start, shape (states,)."""
        values = self.numbers(parameters).values
        return np.array([values[name] for name in self.manifest.initial], dtype=float)

    def evaluate(
        self,
        t: float,
        x: Sequence[float] | np.ndarray | None = None,
        outputs: Sequence[str] | None = None,
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
        """
        wanted = list(self.outputs) if outputs is None else list(outputs)
        for name in wanted:
            if name not in self.outputs:
                hint = unknown_name("output", name, self.outputs)
                raise RequestError(f"{hint} The scene's run.outputs says which are computed.")
        if not wanted:
            return {}
        kernel = self.kernel("outputs")
        kernel.run(self._point(self.numbers(parameters), _time(t), x))
        results: dict[str, float | np.ndarray] = {}
        for info, output in zip(self.manifest.outputs, kernel.function.name_out(), strict=True):
            if info.name in wanted:
                value = kernel.output(output)
                results[info.name] = value if info.size > 1 else float(value[0])
        return results

    def simulate(
        self,
        cycles: float | None = None,
        *,
        duration: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        samples_per_cycle: int | None = None,
        initial: Sequence[float] | np.ndarray | None = None,
        transient: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Solution:
        """Simulate from t = 0.  What is not given is taken from the scene's run settings.

        Parameters
        ----------
        cycles, duration : turns of driver or shaft, or time [s]; one of them
        parameters : overrides of parameters, SI
        method : ``auto`` or one of `methods`.  ``auto`` takes ``stepper`` where there is a compiler, else
            ``rosenbrock`` for a stiff model and ``erk`` for others
        rtol : error allowed per step, relative to the magnitudes of the states (`raceway.runtime.scales`)
        samples_per_cycle : samples in a turn; in the whole run where nothing turns
        initial : state at the start, shape (states,)
        transient : turns at the start that `Solution.steady` leaves out
        progress : called with the finished fraction

        Raises
        ------
        RequestError
            A wrong request, or a linkage that cannot be assembled.
        IntegrationError
            The computation failed; ``.partial`` holds what was computed.
        """
        numbers = self.numbers(parameters)
        check_assembly(self, numbers)
        request = Request(
            cycles=cycles,
            duration=duration,
            method=method,
            rtol=rtol,
            samples_per_cycle=samples_per_cycle,
            initial=None if initial is None else np.asarray(initial, dtype=float),
            transient_cycles=transient,
            progress=progress,
        )
        return simulate(self, numbers, request)

    def sensitivities(
        self,
        wrt: str | Sequence[str],
        cycles: float | None = None,
        *,
        duration: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        samples_per_cycle: int | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Sensitivities:
        """Simulate from t = 0 with the derivatives of the states by parameters, exact for the discrete solution.

        Parameters
        ----------
        wrt : names of parameters; any number in one pass
        others : as for `simulate`

        Raises
        ------
        RequestError
            A wrong request, an unknown parameter, or a damping law whose force jumps.
        IntegrationError
            The computation failed.
        """
        numbers = self.numbers(parameters)
        check_assembly(self, numbers)
        request = Request(
            cycles=cycles,
            duration=duration,
            method=method,
            rtol=rtol,
            samples_per_cycle=samples_per_cycle,
            progress=progress,
        )
        return sensitivities(self, numbers, request, [wrt] if isinstance(wrt, str) else list(wrt))

    def reduce(
        self,
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        initial: Sequence[float] | np.ndarray | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Reductions:
        """Extremes with their times, mean and rms of a run behind its transient, without a stored trajectory.

        Parameters are those of `simulate`; the transient's turns do not count.  The memory does not grow with the run.

        Raises
        ------
        RequestError
            A wrong request, or a linkage that cannot be assembled.
        SimulationError
            The computation failed.
        """
        numbers = self.numbers(parameters)
        check_assembly(self, numbers)
        run = self.manifest.run
        request = Request(
            cycles=cycles, duration=duration, initial=None if initial is None else np.asarray(initial, dtype=float)
        )
        return reduce_run(
            self,
            numbers,
            initial=start_state(self, numbers, request.initial),
            duration=run_length(self, request, clock.period(self.manifest, numbers.values)),
            transient=run.transient_cycles if transient is None else float(transient),
            method=method or run.method,
            rtol=run.rtol if rtol is None else float(rtol),
            progress=progress,
        )

    def simulate_many(
        self,
        parameters: Table,
        observables: Sequence[str],
        *,
        cycles: float | None = None,
        duration: float | None = None,
        transient: float | None = None,
        rtol: float | None = None,
        method: str | None = None,
        threads: int | None = None,
        lanes: bool = True,
        progress: Callable[[float], None] | None = None,
    ) -> EnsembleResult:
        """Simulate many parameter sets, keeping only observables.

        The results of a member are those of a single run within the tolerance, and the same bits for any number of
        threads.  A member that fails is reported in ``failures`` and has NaN in its place.  An interrupt (Ctrl-C) ends
        the ensemble soon, and the members finished by then are kept.

        Parameters
        ----------
        parameters : overrides, SI: name to one value for each member, or a mapping for each member, or a structured
            array
        observables : ``max:``, ``min:``, ``mean:``, ``rms:``, ``range:``, ``peak_time:``, ``peak_ball:``, ``min_time:``
            or ``end:``, and a state or one of ball.force, ball.elastic_force, ball.damping_force, ball.deflection (of
            the most loaded ball); also written ``peak_ball_force``, ``rms_inner_y``
        cycles, duration : turns of driver or shaft, or time [s]; one of them
        transient : turns at the start that do not count
        rtol : error allowed per step, relative to each member's own magnitudes
        method : ``auto``, or one of the project's own stepper
        threads : default: as many as processors
        lanes : False advances one member at a time
        progress : called with the finished fraction

        Raises
        ------
        RequestError
            A wrong request: unknown names, columns of unequal length, values that are no finite numbers.
        """
        return simulate_many(
            self,
            parameters,
            observables,
            cycles=cycles,
            duration=duration,
            transient=transient,
            rtol=rtol,
            method=method,
            threads=threads,
            lanes=lanes,
            progress=progress,
        )

    def refine_peak(
        self, solution: Solution, name: str, *, kind: Literal["max", "min"] = "max", candidates: int = 6
    ) -> Peak:
        """Peak of an output between the samples of a run of this model (see `raceway.runtime.peaks`)."""
        numbers = self.numbers(solution.parameters)
        return refine_peak(self, numbers, solution, name, kind=kind, candidates=candidates)

    def check_assembly(self, parameters: Mapping[str, float] | None = None) -> None:
        """Raise `RequestError`, naming joint and crank angle, when the linkage locks somewhere in a turn."""
        check_assembly(self, self.numbers(parameters))

    def jacobian(
        self,
        of: str,
        wrt: str | Sequence[str] = "states",
        *,
        t: float = 0.0,
        x: Sequence[float] | np.ndarray | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> np.ndarray:
        """Derivative of the right-hand side at one time and state.

        Parameters
        ----------
        of : "rhs"
        wrt : "states", "time", the name of a parameter, or several names.  Derivatives along parameters are total:
            through the derived constants, the phases and the tables as well.  Gates are flat (they jump at edges).
        t : time [s]
        x : state.  Default: the initial one
        parameters : overrides, SI

        Returns
        -------
        array, shape (states, states), (states,) for one name, (states, names) for several
        """
        if of != "rhs" or not self.has("rhs"):
            known = ("rhs",) if self.has("rhs") else ()
            raise RequestError(unknown_name("function to differentiate", of, known))
        numbers = self.numbers(parameters)
        time = _time(t)
        point = self._point(numbers, time, x)
        count = len(self.states)
        if wrt == "states":
            return self.kernel("rhs_jac_x")(point).reshape(count, count)
        if wrt == "time":
            return self.kernel("rhs_jac_t")(point).reshape(count)
        names = [wrt] if isinstance(wrt, str) else list(wrt)
        for name in names:
            if name not in numbers.parameters:
                hint = unknown_name("parameter", name, numbers.parameters)
                raise RequestError(f"{hint} Besides parameters, wrt takes 'states' and 'time'.")
        total = self._parameter_jacobian(numbers, time, point)
        columns = [list(numbers.parameters).index(name) for name in names]
        return total[:, columns[0]] if isinstance(wrt, str) else total[:, columns]

    def _parameter_jacobian(self, numbers: Numbers, time: float, point: Mapping[str, object]) -> np.ndarray:
        """Total derivative of the right-hand side along all parameters, shape (states, parameters)."""
        states, parameters, constants = len(self.states), len(numbers.p), len(numbers.c)
        total = self.kernel("rhs_jac_p")(point).reshape(states, parameters)
        along_constants = np.zeros((constants, parameters))
        if constants:
            along_constants = self.kernel("constants_jac")(point).reshape(constants, parameters)
            total = total + self.kernel("rhs_jac_c")(point).reshape(states, constants) @ along_constants
        entries = clock.input_derivatives(self.manifest.inputs, numbers.values, time)
        if entries:
            rows = {name: row for row, name in enumerate(numbers.parameters)}
            chain = np.zeros((len(self.manifest.inputs), parameters))
            for row, name, slope in entries:
                if name in rows:
                    chain[row, rows[name]] += slope
                else:
                    chain[row] += slope * along_constants[[info.name for info in self.manifest.constants].index(name)]
            total = total + self._input_kernel()(point).reshape(states, -1) @ chain
        return total

    def _input_kernel(self) -> Kernel:
        """Derivative of the right-hand side along the inputs, made from its expression graph."""
        if "rhs_jac_u" not in self._kernels:
            rhs = self.symbolic("rhs")
            name = f"jac:{rhs.name_out(0)}:u"
            self._kernels["rhs_jac_u"] = Kernel(rhs.factory("rhs_jac_u", rhs.name_in(), [name]))
        return self._kernels["rhs_jac_u"]

    def _point(self, numbers: Numbers, t: float, x: Sequence[float] | np.ndarray | None) -> dict[str, object]:
        state = (
            np.array([numbers.values[name] for name in self.manifest.initial])
            if x is None
            else np.asarray(x, dtype=float)
        )
        if state.shape != (len(self.states),):
            raise RequestError(
                f"x: shape ({len(self.states)},) is expected ({', '.join(self.states)}), not {state.shape}."
            )
        u = clock.inputs_at(self.manifest.inputs, numbers.values, t)
        return {"t": 0.0, "x": state, "u": u, "p": numbers.p, "c": numbers.c}

    def _require(self, name: str) -> None:
        if not self.has(name):
            raise RequestError(unknown_name("function", name, [info.name for info in self.manifest.functions]))

    def _external(self, name: str) -> casadi.Function:
        self._require(name)
        assert self.library is not None
        try:
            function = casadi.external(name, str(self.library.path))
        except RuntimeError as fault:
            raise CompileError(
                f"{self.library.path}: function {name!r} cannot be loaded. "
                f"Delete this file, and it is compiled anew.\n{fault}"
            ) from fault
        _check_signature(function, self.manifest)
        return function


def _read_functions(path: Path) -> dict[str, casadi.Function]:
    try:
        stored = casadi.FileDeserializer(str(path))
        functions = [stored.unpack() for _ in range(int(stored.unpack()))]
    except (RuntimeError, SystemError) as fault:
        raise ArtefactError(f"{path}: no functions can be read from it. Write the folder again.\n{fault}") from fault
    return {function.name(): function for function in functions}


def _check_signature(function: casadi.Function, manifest: Manifest) -> None:
    """Refuse a function whose arguments are not those of the manifest."""
    info = manifest.function(function.name())
    names = function.name_in()
    for name, rows in info.inputs:
        if name not in names or function.size1_in(name) != rows:
            raise ArtefactError(
                f"{function.name()}: the manifest has the argument {name} with {rows} rows, the compiled code has "
                f"{', '.join(f'{n} ({function.size1_in(n)})' for n in names)}. Write the folder again."
            )


def _time(t: float) -> float:
    value = float(t)
    if not math.isfinite(value):
        raise RequestError(f"t: a finite time [s] is expected, not {t!r}.")
    return value
