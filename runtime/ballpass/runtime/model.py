"""A generated model: load, inspect, evaluate, simulate, differentiate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ballpass.runtime.ask.peaks import Peak, refine_peak
from ballpass.runtime.certify.error_target import simulate_to_error
from ballpass.runtime.certify.growth import Growth, find_growth
from ballpass.runtime.certify.member_digits import ends_of, parted, simulate_members
from ballpass.runtime.certify.transient import find_transient
from ballpass.runtime.contract.arguments import typed, typed_methods
from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.folder import read_artefact
from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.manifest import Manifest, RunInfo
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.plugins import use, warn_of_changes
from ballpass.runtime.many.ensemble import EnsembleResult, simulate_many
from ballpass.runtime.many.ensemble_parts import simulate_parts
from ballpass.runtime.many.members import Table
from ballpass.runtime.native.compile import CompiledLibrary, compile_model
from ballpass.runtime.point.explain import Explanation, explain
from ballpass.runtime.point.point_model import PointModel
from ballpass.runtime.point.run_start import Initial, start_of
from ballpass.runtime.quantity.cuts import passing_times
from ballpass.runtime.quantity.values import QuantityValue, quantity_values
from ballpass.runtime.questions import Questions
from ballpass.runtime.report.digits import further, uncertainty
from ballpass.runtime.request.choose_method import method_names
from ballpass.runtime.request.locating import Kinks, refuse_with_error
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import resolve
from ballpass.runtime.run.reduced_run import reduced
from ballpass.runtime.run.reductions import Reductions
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.solution.sensitivity import Sensitivities, sensitivities
from ballpass.runtime.solution.settle import Settled, settle
from ballpass.runtime.solution.simulate import simulate
from ballpass.runtime.solution.stream import stream_run
from ballpass.runtime.time.repetition import MOST_RUN

if TYPE_CHECKING:
    from ballpass.runtime.solution.solution import Solution, Statistics


@typed
def load(folder: str | Path, *, compiler: str | None = None, verify: bool = True, plugins: Sequence[str] = ()) -> Model:
    """Load a generated folder; compile its C when no cached library fits.

    A generated folder is a program, which runs with your rights: load only folders you trust.  The digests of its
    manifest show damage, not who wrote it.

    Parameters
    ----------
    folder : what `ballpass derive` wrote
    compiler : command of a C compiler.  Default: the first found of $CC, cc, gcc, clang, ziglang
    verify : refuse files that differ from the manifest's digests
    plugins : modules, or files of them, with quantities, questions or methods of your own; known from then on

    Warns
    -----
    NoCompilerWarning
        There is no compiler: the functions run in CasADi's virtual machine.
    PluginWarning
        A package of which the scene has a law is not installed, or has changed since.

    Raises
    ------
    ArtefactError
        No such folder, a manifest that is wrong or of another schema, edited files.
    CompileError
        The compiler failed.

    Examples
    --------
    >>> model = load("generated/punching_press")
    >>> model.states[:3]
    ('inner.x', 'inner.y', 'outer.x')
    >>> model.parameters["bearing.clearance"]  # [m]
    1e-05
    """
    use(plugins)
    return _loaded(folder, compiler, partial(read_artefact, folder, verify=verify))


def load_own(folder: Path) -> Model:
    """The model of a scene's folder, which `ForeignFolderError` refuses where this user's ballpass did not write it."""
    return _loaded(folder, None, partial(read_artefact, folder, own=True))


def _loaded(folder: str | Path, compiler: str | None, read: Callable[[], Manifest]) -> Model:
    # absolute: functions may be read after the process has moved elsewhere
    place = Path(folder).absolute()
    manifest = read()
    warn_of_changes(manifest.versions, place)
    try:
        with shown("compiling"):
            library = compile_model(place, manifest, compiler)
    except ArtefactError:  # another process has written the folder anew since the manifest was read
        manifest = read()
        library = compile_model(place, manifest, compiler)
    return Model(place, manifest, library, compiler=compiler)


def _load_same(folder: str, content: tuple[object, ...], compiler: str | None) -> Model:
    """A model from another process: loaded anew, if its folder is unchanged."""
    model = load(folder, compiler=compiler)
    if _content(model.manifest) != content:
        raise ArtefactError(
            f"{folder}: another scene was generated here since the model was pickled. Allowed: the folder it was "
            "loaded from, unchanged. Load it and pickle it again."
        )
    return model


def _content(manifest: Manifest) -> tuple[object, ...]:
    """What is generated, whatever the numbers of its scene."""
    return manifest.signature, manifest.files


@typed_methods
class Model(PointModel, Questions):
    """Functions of one scene with their names, units and defaults.  All numbers are SI.

    For any number of threads at once, with the same bits as calls one after the other.  Results of `kernel`, `loop` and
    `jacobian_function` belong to the thread that called them.

    Attributes
    ----------
    manifest : what the model consists of
    library : the compiled library, None when CasADi's virtual machine runs the functions

    Examples
    --------
    >>> model = load("generated/punching_press")
    >>> solution = model.simulate(cycles=2, parameters={"bearing.clearance": 8e-6})
    >>> solution["ball.force"].shape  # [N]: samples, balls
    (4001, 8)
    """

    def __init__(
        self, folder: Path, manifest: Manifest, library: CompiledLibrary | None, *, compiler: str | None = None
    ) -> None:
        super().__init__(folder, manifest, library, compiler=compiler)
        if manifest.run.at_rest:
            from ballpass.runtime.point.equilibrium import seated  # with SciPy

            self.manifest = seated(self)

    def __reduce__(self) -> tuple[Callable[..., Model], tuple[object, ...]]:
        return _load_same, (str(self.folder), _content(self.manifest), self._compiler)

    @cached_property
    def run_settings(self) -> RunInfo:
        """How long to run: as the scene says, else turns of the steady machine at the scene's own numbers."""
        return self.manifest.run if self.manifest.run.stated else find_transient(self)

    @property
    def methods(self) -> tuple[str, ...]:
        """Integration methods of this model, besides ``auto``."""
        return method_names(self)

    def _asked(
        self, parameters: Mapping[str, float] | None, initial: Initial, transient: float | None, **given: Any
    ) -> tuple[Numbers, Request]:
        """Numbers of a run, and its request; RequestError for an unknown word in the place of a start."""
        numbers = self.numbers(parameters)
        start = start_of(self, numbers, initial)
        return numbers, Request(initial=start, transient_cycles=transient, **given)

    def simulate(
        self,
        cycles: float | None = None,
        *,
        duration: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        samples_per_cycle: int | None = None,
        times: Sequence[float] | np.ndarray | None = None,
        sample_rate: float | None = None,
        outputs: Sequence[str] | None = None,
        initial: Initial = None,
        transient: float | None = None,
        kinks: Kinks | None = None,
        progress: Progress = None,
        error: float | None = None,
        of: str | Sequence[str] | None = None,
    ) -> Solution:
        """Simulate, from t = 0 or from where another run ended.  Defaults are the scene's run settings.

        Parameters
        ----------
        cycles, duration : turns of driver or shaft, or time [s]; one of them
        parameters : overrides of parameters, SI
        method : ``auto`` or one of `methods`.  ``auto`` takes ``stepper`` where there is a compiler, else
            ``cvodes``
        rtol : error allowed per step, relative to the magnitudes of the states (`ballpass.runtime.request.magnitudes`)
        samples_per_cycle : samples in a turn; in the whole run where nothing turns
        times : times of the samples instead, increasing, within the run; where neither cycles nor duration is given,
            the run ends at the last one.  The stepper takes the same steps for any samples of a run of one length;
            ``cvodes`` steps from sample to sample [s]
        sample_rate : samples at whole multiples of one over this, instead [Hz]
        outputs : names of the outputs to keep, none of them for ``[]``, where none is evaluated.  Default: all of the
            scene
        initial : state at the start, shape (states,); ``"equilibrium"`` for rings at rest under the load of t = 0, with
            the driver at its speed (`static_equilibrium`); or `Solution.end` of a run of this scene, whose time and
            motion continue (``end.x``, its state alone, begins at t = 0).  Default: the scene's
        transient : turns from t = 0 on that `Solution.steady` leaves out, also where the run continues another one
        kinks : ``stepped-over`` leaves kinks of the laws to error control; with ``located`` steps of the project's own
            stepper end on them (see `docs/theory/integration.md`).  Default: located by ``stepper`` at rtol up to 1e-6,
            else stepped over
        progress : called with the finished fraction.  Default: a bar on a terminal or in a notebook, from the first
            second on; False for none.  With BALLPASS_PROGRESS=0 in the environment there is one only for True
        error : relative error wanted instead of `method` and `rtol`: the tool chooses them, estimates the error of
            this run and tightens until the estimate is within it; ``Solution.accuracy`` has the result (see
            `ballpass.runtime.certify.error_target`)
        of : quantities that `error` is about.  Default: peak ball force, rms and range of the inner ring's motion

        Raises
        ------
        RequestError
            A wrong request, or a linkage that cannot be assembled.
        IntegrationError
            The computation failed; ``.partial`` holds what was computed.
        TargetMissed
            No method and tolerance keep the requested error.

        Examples
        --------
        >>> solution = model.simulate(cycles=1, samples_per_cycle=360)
        >>> solution["inner.y"].shape  # [m]
        (361,)
        >>> model.simulate(duration=0.05, sample_rate=10e3, outputs=[]).t[:3]  # [s]
        array([0.    , 0.0001, 0.0002])
        """
        numbers, request = self._asked(
            parameters,
            initial,
            transient,
            cycles=cycles,
            duration=duration,
            method=method,
            rtol=rtol,
            samples_per_cycle=samples_per_cycle,
            times=times,
            sample_rate=sample_rate,
            outputs=outputs,
            kinks=kinks,
        )
        refuse_with_error(error, method=method, rtol=rtol, kinks=kinks)
        with shown("simulating", progress) as tell:
            request = replace(request, progress=tell)
            if error is None:
                return simulate(self, numbers, request)
            return simulate_to_error(self, numbers, request, error, of)

    def stream(
        self,
        path: str | Path,
        *,
        sample_rate: float,
        cycles: float | None = None,
        duration: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        outputs: Sequence[str] | None = None,
        initial: Initial = None,
        transient: float | None = None,
        kinks: Kinks | None = None,
        progress: Progress = None,
    ) -> Statistics:
        """Simulate into a file, in memory that does not grow with the run (see `ballpass.runtime.solution.stream`).

        Parameters are those of `simulate`.

        Parameters
        ----------
        path : of the NetCDF-4 file, which `load_solution` and xarray read
        sample_rate : of the samples [Hz]

        Raises
        ------
        RequestError
            A wrong request, or a file that cannot be written.
        IntegrationError
            The computation failed; no file is written.

        Examples
        --------
        >>> statistics = model.stream("press.nc", sample_rate=20e3, outputs=["inner.y"])
        >>> statistics.method
        'stepper'
        >>> load_solution("press.nc")["inner.y"].shape  # [m]
        (9601,)
        """
        numbers, request = self._asked(
            parameters,
            initial,
            transient,
            cycles=cycles,
            duration=duration,
            method=method,
            rtol=rtol,
            sample_rate=sample_rate,
            outputs=outputs,
            kinks=kinks,
        )
        with shown("simulating", progress) as tell:
            return stream_run(self, numbers, replace(request, progress=tell), Path(path))

    def sensitivities(
        self,
        wrt: str | Sequence[str],
        cycles: float | None = None,
        *,
        duration: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        sensitivity_rtol: float | None = None,
        samples_per_cycle: int | None = None,
        kinks: Literal["stepped-over", "located"] | None = None,
        progress: Progress = None,
    ) -> Sensitivities:
        """Simulate from t = 0 with the derivatives of the states by parameters, exact for the discrete solution.

        Parameters
        ----------
        wrt : names of parameters; any number in one pass
        rtol : error allowed per step in the states.  Default: 1e-11, because derivatives lose digits
        sensitivity_rtol : the same in the derivatives, which take part in the choice of step sizes, relative to the
            states' magnitudes over the parameters' scales (`request/direction_scales.py`) or to the derivative itself
            where it is larger.  Default: ten times `rtol`; where steps would fall below the resolution of time ten
            times as much, and so on up to 1e-6: see `Sensitivities.sensitivity_rtol`
        kinks : ``located``, the default, at any tolerance; ``stepped-over`` costs digits
        others : as for `simulate`

        Raises
        ------
        RequestError
            A wrong request, an unknown parameter, or a damping law whose force jumps.
        IntegrationError
            The computation failed.

        Examples
        --------
        >>> names = ["bearing.clearance", "mechanism.driver.speed"]
        >>> slopes = model.sensitivities(names, cycles=0.5)
        >>> slopes.x.shape  # samples, states, parameters
        (1001, 8, 2)
        >>> slopes["inner.y", "bearing.clearance"].shape  # [m/m]
        (1001,)
        """
        numbers, request = self._asked(
            parameters,
            None,
            None,
            cycles=cycles,
            duration=duration,
            method=method,
            rtol=rtol,
            sensitivity_rtol=sensitivity_rtol,
            samples_per_cycle=samples_per_cycle,
            kinks=kinks,
        )
        names = [wrt] if isinstance(wrt, str) else list(wrt)
        with shown("differentiating", progress) as tell:
            return sensitivities(self, numbers, replace(request, progress=tell), names)

    def quantities(
        self,
        of: str | Sequence[str],
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        initial: Initial = None,
        kinks: Kinks | None = None,
        progress: Progress = None,
    ) -> dict[str, QuantityValue]:
        """Quantities of a run, each with time and ball where it has some (see `ballpass.runtime.quantity.grammar`).

        Parameters are those of `reduce`; at equal ones the values are the same bits in every call and command.

        Raises
        ------
        RequestError
            Unknown names, a wrong request, or a linkage that cannot be assembled.
        SimulationError
            The computation failed.

        Examples
        --------
        >>> found = model.quantities(["drive_work", "peak_ball_force"], cycles=3, transient=2)
        >>> work, force = found["drive_work"], found["peak_ball_force"]
        >>> f"{work.value:.3f} {work.unit}, ball {force.ball}"
        '9.078 J, ball 3'
        """
        numbers, request = self._asked(
            parameters, initial, transient, cycles=cycles, duration=duration, method=method, rtol=rtol, kinks=kinks
        )
        with shown("simulating", progress) as tell:
            return quantity_values(self, numbers, replace(request, progress=tell), [of] if isinstance(of, str) else of)

    def passages(
        self,
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        rtol: float | None = None,
        initial: Initial = None,
        progress: Progress = None,
    ) -> dict[str, np.ndarray]:
        """Times at which loads in windows begin and end, and balls enter and leave spalls, by the edge [s].

        An edge has the name of its parameter, or of its constant where it follows from others.  Each ball that passes
        an edge of a spall gives a time; which ball it is, is not given.  Known times are exact, those that the motion
        decides as exact as the run.  Parameters are those of `simulate`; times of the transient are left out.

        Raises
        ------
        RequestError
            A wrong request, or a linkage that cannot be assembled.
        SimulationError
            The computation failed.

        Examples
        --------
        >>> found = model.passages(cycles=2, transient=0)
        >>> found["mechanism.forces.punch.window.start"].round(4)  # [s]
        array([0.079, 0.199])
        """
        numbers, request = self._asked(parameters, initial, transient, cycles=cycles, duration=duration, rtol=rtol)
        with shown("simulating", progress) as tell:
            return passing_times(self, numbers, replace(request, progress=tell))

    def reduce(
        self,
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        initial: Initial = None,
        kinks: Kinks | None = None,
        progress: Progress = None,
    ) -> Reductions:
        """Extremes with their times, mean and rms of a run after its transient, without a stored trajectory.

        Parameters are those of `simulate`; the transient's turns do not count.  The memory does not grow with the run.
        Several times a second `progress` is called and an interrupt (Ctrl-C) takes effect; that changes no bit of the
        results.  The limits of a run are those of `simulate`.

        Raises
        ------
        RequestError
            A wrong request, or a linkage that cannot be assembled.
        SimulationError
            The computation failed.

        Examples
        --------
        >>> found = model.reduce(cycles=20, transient=2)["ball.force"]
        >>> round(found.maximum, -1), round(found.rms, -1)  # [N]
        (4400.0, 690.0)
        """
        numbers, request = self._asked(
            parameters, initial, transient, cycles=cycles, duration=duration, method=method, rtol=rtol, kinks=kinks
        )
        with shown("simulating", progress) as tell:
            return reduced(resolve(self, numbers, replace(request, progress=tell)))

    def settle(
        self,
        *,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        initial: Initial = None,
        kinks: Kinks | None = None,
        most: int = MOST_RUN,
        progress: Progress = None,
    ) -> Settled:
        """Reduce a run of as many turns as its extremes and rms take to settle (`solution/settle.py`).

        Parameters are those of `reduce`.

        Parameters
        ----------
        most : largest number of steady turns; ``settled`` of the result is False where they are not enough

        Raises
        ------
        RequestError
            A wrong request, a linkage that cannot be assembled, or a model in which nothing turns.
        SimulationError
            The computation failed.

        Examples
        --------
        >>> found = model.settle(transient=2)
        >>> found.settled
        True
        >>> round(found.reductions["ball.force"].maximum, -1)  # [N]
        4400.0
        """
        numbers, request = self._asked(parameters, initial, transient, method=method, rtol=rtol, kinks=kinks)
        with shown("simulating until settled", progress) as tell:
            return settle(self, numbers, replace(request, progress=tell), most)

    def simulate_many(
        self,
        parameters: Table,
        observables: str | Sequence[str],
        *,
        cycles: float | None = None,
        duration: float | None = None,
        transient: float | None = None,
        rtol: float | None = None,
        method: str | None = None,
        kinks: Kinks | None = None,
        threads: int | None = None,
        lanes: bool = True,
        uncertainty: bool = False,
        client: Any = None,
        progress: Progress = None,
    ) -> EnsembleResult:
        """Simulate many parameter sets, keeping only observables.

        The results of a member are those of a single run within the tolerance, and the same bits for any number of
        threads.  A member that fails is reported in ``failures`` and has NaN in its place.  An interrupt (Ctrl-C) ends
        the ensemble within a fraction of a second, and the members finished by then are kept.

        Parameters
        ----------
        parameters : overrides, SI: name to one value for each member, or a mapping for each member, or a structured
            array
        observables : ``max:``, ``min:``, ``mean:``, ``rms:``, ``range:``, ``peak_time:``, ``peak_ball:``, ``min_time:``
            or ``end:``, and a state or one of ball.force, ball.elastic_force, ball.damping_force, ball.deflection (the
            largest of all balls); also written ``peak_ball_force``, ``rms_inner_y``
        cycles, duration : turns of driver or shaft, or time [s]; one of them
        transient : turns at the start that do not count
        rtol : error allowed per step, relative to each member's own magnitudes
        method : ``auto``, or one of the project's own stepper
        kinks : as in `simulate`: with ``located``, the default of ``auto`` and ``stepper`` at rtol up to 3e-7 (1e-6
            where a law jumps), steps end on the kinks of the laws and members run one at a time, because lanes cannot;
            with ``stepped-over`` they run in lanes at any tolerance, but a step's error at a kink exceeds a tight one
            and members agree with single runs only within that error.  ``statistics.kinks`` has the choice
        threads : default: as many as processors
        lanes : False advances one member at a time
        uncertainty : run each member at a tighter tolerance as well, and at more of them where its numbers scatter;
            ``uncertainty`` of the result then has the ± of each number
        client : of `dask.distributed`; its workers simulate parts of the table, in lanes, with the same bits where they
            have the same processor and compiler.  ``threads`` are then those of the cluster
        progress : as for `simulate`

        Raises
        ------
        RequestError
            A wrong request: unknown names, columns of unequal length, values that are not finite numbers.
        SimulationError
            A cluster gave up; what it had finished is lost.

        Examples
        --------
        >>> clearances = {"bearing.clearance": np.linspace(5e-6, 20e-6, 4)}  # [m]
        >>> many = model.simulate_many(clearances, ["peak_ball_force", "rms:inner.y"], cycles=3)
        >>> many["peak_ball_force"].round(-1)  # [N]
        array([4230., 4390., 4550., 4690.])
        """
        where = partial(simulate_many, threads=threads) if client is None else partial(simulate_parts, client=client)
        with shown("simulating members", progress) as tell:
            run = partial(
                where,
                self,
                cycles=cycles,
                duration=duration,
                transient=transient,
                rtol=rtol,
                method=method,
                kinks=kinks,
                lanes=lanes,
                progress=tell,
            )
            return simulate_members(self, parameters, observables, run) if uncertainty else run(parameters, observables)

    def growth(
        self,
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        rtol: float | None = None,
        initial: Initial = None,
        progress: Progress = None,
    ) -> Growth:
        """Change of the extremes and rms of a run when its start moves by the tolerance, by two runs of the stepper.

        Parameters are those of `simulate`.  `uncertainties` says by how much the numbers of a motion scatter.

        Raises
        ------
        RequestError
            A wrong request, a linkage that cannot be assembled, or no compiler for the stepper.
        SimulationError
            The computation failed.

        Examples
        --------
        >>> found = model.growth(cycles=4, transient=2)
        >>> found.uncertain, found.worst < 1e-3
        ((), True)
        """
        numbers, request = self._asked(parameters, initial, transient, cycles=cycles, duration=duration, rtol=rtol)
        with shown("simulating from two starts", progress) as tell:
            return find_growth(self, numbers, replace(request, progress=tell))

    def uncertainties(
        self,
        of: str | Sequence[str],
        cycles: float | None = None,
        *,
        duration: float | None = None,
        transient: float | None = None,
        parameters: Mapping[str, float] | None = None,
        method: str | None = None,
        rtol: float | None = None,
        initial: Initial = None,
        kinks: Kinks | None = None,
        progress: Progress = None,
    ) -> dict[str, float]:
        """± of the values of `quantities`, from runs at tighter tolerances: one, and more where the values scatter.

        Parameters are those of `quantities`.

        Raises
        ------
        RequestError
            As for `quantities`.
        SimulationError
            A computation failed.

        Examples
        --------
        >>> found = model.uncertainties(["drive_work", "peak_ball_force"], cycles=3, transient=2)
        >>> found["drive_work"], found["peak_ball_force"] < 0.1  # [J], [N]
        (0.0, True)
        """

        names = [of] if isinstance(of, str) else list(of)
        judged = ends_of(self, names)

        def ask(tighter: float | None) -> list[float]:
            found = self.quantities(
                [*names, *judged],
                cycles,
                duration=duration,
                transient=transient,
                parameters=parameters,
                method=method,
                rtol=rtol if tighter is None else tighter,
                initial=initial,
                kinks=kinks,
                progress=progress,
            )
            return [found[name].value for name in [*names, *judged]]

        asked = self.run_settings.rtol if rtol is None else rtol

        every = np.array(further(ask(None), ask, asked, lambda two: bool(np.any(parted(np.array(two), len(names))))))
        return dict(zip(names, map(uncertainty, every.T.tolist()), strict=False))

    def refine_peak(self, solution: Solution, name: str, *, kind: Literal["max", "min"] = "max") -> Peak:
        """Peak of an output of a run of this model, between its samples too (see `ballpass.runtime.ask.peaks`).

        It is that of every step where the project's own stepper ran and reduced the output, that of the samples where
        another method did; the result's ``searched`` says which.

        Parameters
        ----------
        solution : the run, or its steady part
        name : an output
        kind : which extreme

        Raises
        ------
        RequestError
            No such output, no samples, or another `kind`.

        Examples
        --------
        >>> solution = model.simulate(cycles=1, samples_per_cycle=90)
        >>> peak = model.refine_peak(solution, "ball.force")
        >>> round(peak.value), round(peak.sampled), peak.ball  # [N], [N], counted from 1
        (4403, 3079, 1)
        """
        numbers = self.numbers(solution.parameters)
        return refine_peak(self, numbers, solution, name, kind=kind)

    def explore(self, path: str | Path, *, units: Mapping[str, str] | None = None) -> Path:
        """Write a page with the solver in it: sliders for all numbers, and pictures and peaks that follow them.

        It needs no server, no network and no installation where it is opened; ziglang is needed to write it.

        Parameters
        ----------
        path : file to write, HTML
        units : by name of a parameter, where the page shows it in another unit than the usual

        Raises
        ------
        RequestError
            The compiler is missing; the model has no states, or nothing that can be drawn; wrong units.
        SimulationError, CompileError
            The run of the scene's own numbers, or the compiler, failed.

        Examples
        --------
        >>> model.explore("explore.html", units={"bearing.clearance": "um"}).name
        'explore.html'
        """
        from ballpass.runtime.export.web_assembly import check_compiler
        from ballpass.runtime.plot.explore import explore_page
        from ballpass.runtime.plot.sliders import check_units

        check_units(self.manifest, units or {})
        check_compiler()
        target = Path(path)
        replace_file(target, explore_page(self, self.simulate(), units=units).encode())
        return target

    def explain(self, parameters: Mapping[str, float] | None = None) -> Explanation:
        """Breakpoints, smoothness and time scales, and the method that suits them.

        Examples
        --------
        >>> explanation = model.explain()
        >>> explanation.method, len(explanation.breakpoints)
        ('stepper', 2)
        """
        return explain(self, parameters)
