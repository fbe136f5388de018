"""The solution of a simulation: samples of states and outputs with their names and units; its file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.defaults import longer_words
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.manifest import Manifest, VariableInfo
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.request.request import no_output
from ballpass.runtime.request.start import RunEnd
from ballpass.runtime.run.reductions import Reductions
from ballpass.runtime.show import html
from ballpass.runtime.solution.accuracy import Accuracy
from ballpass.runtime.solution.netcdf import Variable, netcdf_bytes, seal
from ballpass.runtime.time import timeline

if TYPE_CHECKING:
    import pandas
    import xarray

    from ballpass.runtime.plot.accessor import SolutionPlot


#: Number of the layout of saved files.
FILE_SCHEMA = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistics:
    """How a solution came about.

    Attributes
    ----------
    method : the integrator that ran, and `reason` why
    rtol : relative tolerance, and `magnitudes` of the states it refers to
    steps, rejected : accepted and rejected steps; None for a model without states
    segments : intervals between breakpoints, integrated one by one
    calls : calls of the integrator
    wall_time : time the simulation took [s]
    compiled : whether generated C ran, else CasADi's virtual machine
    kinks : "stepped-over" or "located"; None for methods that cannot locate kinks
    located : kinks located, None where they are stepped over
    initial : state at its start; None where an earlier version wrote the solution
    begin : time at its start, above 0 where it continues another run [s]
    duration : length of the run, which may end after the last sample [s]; None as for `initial`

    Examples
    --------
    >>> statistics = model.simulate(cycles=1).statistics
    >>> statistics.method, statistics.rtol, statistics.segments
    ('stepper', 1e-06, 3)
    """

    method: str
    reason: str
    rtol: float
    magnitudes: tuple[float, ...] = ()
    steps: int | None = None
    rejected: int | None = None
    segments: int = 0
    calls: int = 0
    wall_time: float = 0.0
    compiled: bool = False
    kinks: str | None = None
    located: int | None = None
    initial: tuple[float, ...] | None = None
    begin: float = 0.0
    duration: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Samples of a simulation, in SI.

    ``solution["inner.y"]`` is an output or a state by name: shape (samples,), or (samples, balls).

    Attributes
    ----------
    t : times, increasing, not always evenly spaced, shape (samples,) [s]
    x : states, shape (samples, states), in the order of the manifest
    outputs : output name to samples; at a breakpoint, the value after it
    parameters, constants : numbers of the run by name
    cycle_length : time of one turn [s], where its speed changes behind its last row; None where nothing turns
    transient_cycles : turns from t = 0 on that `steady` leaves out
    manifest : names, units and descriptions
    statistics : how the solution came about
    status : how the simulation ended
    accuracy : target, choice and estimate, where an error was named instead of a method
    reductions : extremes, means and rms found in every step of the run, for any samples: of the states, and of
        the most loaded ball for those outputs that are kept (its means and rms to some 1e-5 at tolerances above 3e-7,
        to the tolerance below).  None for other methods than the project's own stepper, beside derivatives, and
        where no output is kept
    steady_reductions : the same from the end of the transient on
    model : that ran, for `plot`; None for a solution that was read from a file or sent by another process

    Examples
    --------
    >>> solution = model.simulate(cycles=2, transient=1)
    >>> len(solution), solution["inner.y"].shape, solution["ball.force"].shape  # [m], [N]
    (4001, (4001,), (4001, 8))
    >>> round(solution.reductions["ball.force"].maximum, -1)  # [N], of every step
    4400.0
    """

    t: np.ndarray
    x: np.ndarray
    outputs: Mapping[str, np.ndarray]
    parameters: Mapping[str, float]
    constants: Mapping[str, float]
    cycle_length: float | None
    transient_cycles: float
    manifest: Manifest
    statistics: Statistics
    status: Status
    accuracy: Accuracy | None = None
    reductions: Reductions | None = None
    steady_reductions: Reductions | None = None
    model: LoadedModel | None = None

    def __getstate__(self) -> list[Any]:
        return [None if item.name == "model" else getattr(self, item.name) for item in fields(self)]

    def __post_init__(self) -> None:
        for array in (self.t, self.x, *self.outputs.values()):
            array.flags.writeable = False
        for name in ("outputs", "parameters", "constants"):
            object.__setattr__(self, name, dict(getattr(self, name)))

    def __getitem__(self, name: str) -> np.ndarray:
        known = tuple(dict.fromkeys((*self.outputs, *self.states)))
        if not isinstance(name, str):
            raise RequestError(unknown_name("output or state", name, known))
        if name in self.outputs:
            return self.outputs[name]
        names = self.states
        if name in names:
            return self.x[:, names.index(name)]
        if any(name == info.name for info in self.manifest.outputs):
            raise RequestError(
                f"{name!r} was not kept in this run: name it in simulate(outputs=...), or omit outputs to keep all."
            )
        raise RequestError(no_output(self.manifest, name, known, "output or state"))

    def __contains__(self, name: object) -> bool:
        return name in self.outputs or name in self.states

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f"{self.t[0]:.6g} ... {self.t[-1]:.6g} s" if len(self.t) else "no samples"
        return (
            f"Solution({self.manifest.scene}: {len(self.t)} samples, {span}; {self.statistics.method}, "
            f"rtol {self.statistics.rtol:g}; {self.status.name.lower()}; outputs: {', '.join(self.outputs) or 'none'})"
        )

    def _repr_html_(self) -> str:
        rows = [(name, *_extent(self[name]), info.unit, info.description) for name, info in self._infos().items()]
        heads = ("name", "min", "mean", "max", "unit", "description")
        words = repr(self).partition("; outputs:")[0].partition("(")[2]
        return html.block(
            html.title(self.manifest.title or self.manifest.scene, words),
            html.paragraph(self.accuracy.words) if self.accuracy is not None else "",
            html.table(heads, rows, right=heads[1:4]),
        )

    def _infos(self) -> dict[str, VariableInfo]:
        """States, and outputs that are kept, by name."""
        return {info.name: info for info in (*self.manifest.states, *self.manifest.outputs) if info.name in self}

    @property
    def plot(self) -> SolutionPlot:
        """Draws this run on matplotlib's axes: ``solution.plot.orbit()``, ``.spectrum()``, ``.ball_loads()``.

        Examples
        --------
        >>> axes = model.simulate(cycles=3, transient=1).plot.orbit()  # of matplotlib
        """
        from ballpass.runtime.plot.accessor import SolutionPlot  # above, by name in pyproject.toml

        return SolutionPlot(self)

    @property
    def nbytes(self) -> int:
        """Bytes of the samples, which is about the size of the file that `save` writes."""
        return sum(array.nbytes for array in (self.t, self.x, *self.outputs.values()))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the columns of `x`."""
        return tuple(state.name for state in self.manifest.states)

    def steady(self) -> Solution:
        """The samples after the transient cycles; times are kept.

        Raises
        ------
        RequestError
            Nothing turns, or the simulation ended within the transient cycles.

        Examples
        --------
        >>> steady = model.simulate(cycles=3, transient=2).steady()
        >>> f"{steady.t[0] / model.period():.1f} turns"
        '2.0 turns'
        """
        if self.transient_cycles == 0.0:
            return self
        if self.cycle_length is None:
            raise RequestError("transient: its cycles are turns, and nothing turns in this run. Set it to 0.")
        start = timeline.driver(self.manifest, {**self.parameters, **self.constants}).after(self.transient_cycles)
        keep = self.t >= start * (1.0 - 1e-12)
        if np.count_nonzero(keep) < 2:
            last = self.t[-1] if len(self.t) else 0.0
            raise RequestError(
                f"The run of {last:g} s lies within its {self.transient_cycles:g} transient cycles: nothing is left. "
                f"Remedy: {longer_words(self.transient_cycles)}."
            )
        outputs = {name: samples[keep] for name, samples in self.outputs.items()}
        return replace(self, t=self.t[keep], x=self.x[keep], outputs=outputs, reductions=self.steady_reductions)

    @property
    def end(self) -> RunEnd:
        """End of the run at its last sample: ``simulate(initial=solution.end)`` continues from there.

        Raises
        ------
        RequestError
            There is no sample.
        """
        if not len(self.t):
            raise RequestError("end: the run has no samples, so that its end is not known. Run longer.")
        return RunEnd(time=float(self.t[-1]), x=self.x[-1], states=self.states, parameters=self.parameters)

    @property
    def period(self) -> float | None:
        """Time of a turn [s]; None where nothing turns, or its speed changes in the samples."""
        if timeline.is_free(self.manifest) or not len(self.t):
            return None
        turning = timeline.driver(self.manifest, {**self.parameters, **self.constants})
        even = turning.even_from <= float(self.t[0]) * (1.0 + timeline.TIME_RESOLUTION)
        return self.cycle_length if even else None

    def to_xarray(self) -> xarray.Dataset:
        """Dataset with dimensions ``time`` and ``ball`` (counted from 1), units and descriptions.

        Examples
        --------
        >>> data = model.simulate(cycles=1).to_xarray()
        >>> data["ball.force"].sel(ball=3).attrs["units"]
        'N'
        """
        variables, facts = contents(self)
        axes = ("time", *(f"{bearing.prefix}ball" for bearing in self.manifest.bearings))
        coordinates = {name: variables.pop(name) for name in axes if name in variables}
        return need("xarray").Dataset(variables, coords=coordinates, attrs=facts)

    def to_pandas(self) -> pandas.DataFrame:
        """Table with the index ``time`` [s] and a column for each state and output, of each ball ``ball.force[1]``.

        Units are in ``attrs["units"]``, by column.

        Raises
        ------
        RequestError
            pandas is not installed.

        Examples
        --------
        >>> table = model.simulate(cycles=1).to_pandas()
        >>> f"{table['inner.y'].abs().idxmax():.3f} s"
        '0.079 s'
        """
        pandas = need("pandas")
        columns: dict[str, np.ndarray] = {}
        units: dict[str, str] = {}
        for name, info in self._infos().items():
            samples = self[name]
            balls = {f"{name}[{k}]": column for k, column in enumerate(samples.T, start=1)} if samples.ndim > 1 else {}
            columns |= balls or {name: samples}
            units |= dict.fromkeys(balls or (name,), info.unit)
        table = pandas.DataFrame(columns, index=pandas.Index(self.t, name="time"))
        table.attrs["units"] = units
        return table

    @typed
    def save(self, path: str | Path) -> Path:
        """Write NetCDF-4: the old file or the new one, never half of it.  `load_solution` reads it back.

        Raises
        ------
        RequestError
            The folder does not exist or cannot be written, or the disk is full.

        Examples
        --------
        >>> path = model.simulate(cycles=1).save("press.nc")
        >>> load_solution(path)["inner.y"].shape  # [m]
        (2001,)
        """
        target = Path(path)
        content = netcdf_bytes(*contents(self))
        try:
            replace_file(target, content + seal(hashlib.sha256(content).hexdigest()))
        except OSError as fault:
            raise RequestError(
                f"{target}: cannot be written ({fault.strerror or fault}); a file that was there is as it was. Give a "
                "folder you may write, with enough free space."
            ) from fault
        return target


def _extent(samples: np.ndarray) -> tuple[str, str, str]:
    """Minimum, mean of the samples and maximum, as text."""
    if not samples.size:
        return ("", "", "")
    return (f"{np.min(samples):z.4g}", f"{np.mean(samples):z.4g}", f"{np.max(samples):z.4g}")


def contents(solution: Solution) -> tuple[dict[str, Variable], dict[str, Any]]:
    """Variables of a file, each with dimensions, values and attributes, and the facts that stand beside them."""
    manifest = solution.manifest
    infos = {info.name: info for info in manifest.outputs}
    found: dict[str, Variable] = {
        state.name: (("time",), solution.x[:, k], _attributes(state)) for k, state in enumerate(manifest.states)
    }
    found["time"] = (("time",), solution.t, {"units": "s", "long_name": "time"})
    for name, samples in solution.outputs.items():
        prefix = next((b.prefix for b in manifest.bearings if name.startswith(b.prefix)), "")
        balls = (f"{prefix}ball",) * (samples.ndim - 1)  # named bearings have axes of their own
        found[name] = (("time", *balls), samples, _attributes(infos[name]))
        for axis in balls:
            words = bearing_words("number of the ball", manifest.bearings, name)
            found[axis] = (balls, np.arange(1, samples.shape[1] + 1), {"units": "1", "long_name": words})
    facts: dict[str, Any] = {
        "title": manifest.title,
        "scene": manifest.scene,
        "status": solution.status.name,
        "ballpass_schema": FILE_SCHEMA,
        "ballpass_parameters": json.dumps(dict(solution.parameters)),
        "ballpass_constants": json.dumps(dict(solution.constants)),
        "ballpass_run": json.dumps(
            {"cycle_length": solution.cycle_length, "transient_cycles": solution.transient_cycles}
        ),
        "ballpass_outputs": json.dumps(list(solution.outputs)),
        "ballpass_reductions": json.dumps(_facts(solution.reductions)),
        "ballpass_steady_reductions": json.dumps(_facts(solution.steady_reductions)),
        "ballpass_statistics": json.dumps(asdict(solution.statistics)),
        "ballpass_manifest": manifest.to_json(),
    }
    return found, facts


def _facts(reductions: Reductions | None) -> dict[str, Any] | None:
    return None if reductions is None else asdict(reductions)


def _attributes(info: VariableInfo) -> dict[str, str]:
    return {"units": info.unit, "long_name": info.description}
