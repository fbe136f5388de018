"""A generated folder loaded: its functions, drivers and numbers, and no questions yet.

Everything that asks something of a model takes a `LoadedModel`; `ballpass.runtime.model.Model` adds the questions.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ballpass.runtime.contract.errors import BallpassWarning, RequestError
from ballpass.runtime.contract.manifest import Manifest, RunInfo
from ballpass.runtime.contract.parameters import Numbers, Parameters, numbers_of, resolve_parameters
from ballpass.runtime.contract.refused_scenes import refuse_still
from ballpass.runtime.native.compile import CompiledLibrary
from ballpass.runtime.native.compilers import find_compiler, without_compiler
from ballpass.runtime.native.driver_library import (
    DIFFERENTIATING,
    DIFFERENTIATING_LOCATED,
    ENSEMBLE,
    LOCATING,
    PLAIN,
    DriverSources,
    compile_driver,
)
from ballpass.runtime.native.ensemble_driver import EnsembleDriver
from ballpass.runtime.native.functions import CompiledFunctions
from ballpass.runtime.native.stepper import Stepper
from ballpass.runtime.show import html

_Driver = TypeVar("_Driver", Stepper, EnsembleDriver)


class NoKernelsWarning(BallpassWarning):
    """The generated folder has no kernels: CasADi's functions and integrators take the place of the stepper."""


class LoadedModel(CompiledFunctions):
    """Functions of one scene with their names, units and defaults.  All numbers are SI.

    Attributes
    ----------
    folder : the generated folder, absolute
    manifest : what the model consists of
    library : the compiled library, None when CasADi's virtual machine runs the functions
    """

    def __init__(
        self, folder: Path, manifest: Manifest, library: CompiledLibrary | None, *, compiler: str | None = None
    ) -> None:
        super().__init__(folder, manifest, library, compiler)
        self._drivers: dict[DriverSources, Stepper | EnsembleDriver] = {}
        self.valid_angles: tuple[bytes, Any] | None = None  # of the parameters asked for last, see request/assembly.py

    def __repr__(self) -> str:
        how = "compiled" if self.compiled else "in CasADi's virtual machine"
        counts = f"{len(self.states)} states, {len(self.manifest.parameters)} parameters, {len(self.outputs)} outputs"
        return f"{type(self).__name__}({self.manifest.scene}: {counts}, {how})"

    def _repr_html_(self) -> str:
        manifest, parameters = self.manifest, self.parameters
        heads = ("name", "unit", "description")
        lists = {"states": manifest.states, "outputs": manifest.outputs}
        return html.block(
            html.title(manifest.title or manifest.scene, repr(self)),
            *(
                html.folded(
                    f"{len(infos)} {words}", html.table(heads, [(i.name, i.unit, i.description) for i in infos])
                )
                for words, infos in lists.items()
            ),
            html.folded(f"{len(parameters)} parameters", parameters.table_html()),
        )

    @property
    def compiled(self) -> bool:
        """Whether generated C runs."""
        return self.library is not None

    @property
    def run_settings(self) -> RunInfo:
        """How long to run; `Model` finds the transient that a scene does not state."""
        return self.manifest.run

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

    @cached_property
    def has_stepper(self) -> bool:
        """Whether there was a compiler, and the folder brought the stepper's kernels, when first asked."""
        return self.compiled and all((self.folder / name).is_file() for name in ENSEMBLE.headers)

    @property
    def stepper(self) -> Stepper:
        """The project's own stepper, with reductions, compiled when first asked for.

        Raises
        ------
        RequestError
            There is no compiler, or the folder brings no kernels.
        CompileError
            The compiler failed.
        """
        return self._driver(Stepper, PLAIN)

    @property
    def differentiating_stepper(self) -> Stepper:
        """The stepper with the derivatives of its steps, which go over kinks; errors as for `stepper`."""
        return self._driver(Stepper, DIFFERENTIATING)

    @property
    def locating_differentiating_stepper(self) -> Stepper:
        """The same whose steps end on kinks of the laws."""
        return self._driver(Stepper, DIFFERENTIATING_LOCATED)

    @property
    def locating_stepper(self) -> Stepper:
        """The stepper whose steps end on kinks of the laws, compiled when first asked for; errors as for `stepper`."""
        return self._driver(Stepper, LOCATING)

    @property
    def ensemble_driver(self) -> EnsembleDriver:
        """The driver of ensembles and reductions, compiled when first asked for; errors as for `stepper`."""
        return self._driver(EnsembleDriver, ENSEMBLE)

    def _driver(self, kind: type[_Driver], sources: DriverSources) -> _Driver:
        """A driver, compiled once, however many threads ask for it."""
        with self._making:
            if sources not in self._drivers:
                compiler = find_compiler(self._compiler) if self.has_stepper else None
                if compiler is None:
                    refuse_still("The project's own stepper", integrated=self.manifest.integrated)
                    raise RequestError(self._without_stepper())
                library = compile_driver(self.folder, self.manifest, compiler, sources)
                self._drivers[sources] = kind(library, self.manifest)
            found = self._drivers[sources]
            assert isinstance(found, kind)
            return found

    def _without_stepper(self) -> str:
        """What to say where the stepper is asked for and cannot be had."""
        if not self.compiled:
            return without_compiler("The project's own stepper")
        return (
            f"This needs the project's own stepper: the folder {self.folder} has no kernels for it. Write the folder "
            "again with `ballpass derive`, or run the model with method cvodes, for samples."
        )

    def numbers(self, parameters: Mapping[str, float] | None = None) -> Numbers:
        """Parameters with overrides, checked, and the derived constants that follow."""
        return numbers_of(self.manifest, parameters, lambda p: self.kernel("constants")({"p": p}))
