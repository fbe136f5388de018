"""A generated folder loaded: its functions, drivers and numbers, and no questions yet.

Everything that asks something of a model takes a `LoadedModel`; `ballpass.runtime.model.Model` adds the questions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.parameters import Numbers, Parameters, numbers_of, resolve_parameters
from ballpass.runtime.native.compile import CompiledLibrary
from ballpass.runtime.native.drivers import Drivers
from ballpass.runtime.native.ensemble_driver import EnsembleDriver
from ballpass.runtime.native.functions import Functions
from ballpass.runtime.native.kernel import Array, Kernel
from ballpass.runtime.native.loops import PointLoop
from ballpass.runtime.native.stepper import Stepper


class LoadedModel:
    """Functions of one scene with their names, units and defaults.  All numbers are SI.

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
        self._functions = Functions(folder, manifest, library, compiler)
        self._drivers = Drivers(folder, manifest, compiler, compiled=library is not None)

    def __repr__(self) -> str:
        how = "compiled" if self.compiled else "in CasADi's virtual machine"
        counts = f"{len(self.states)} states, {len(self.manifest.parameters)} parameters, {len(self.outputs)} outputs"
        return f"{type(self).__name__}({self.manifest.scene}: {counts}, {how})"

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
    def has_stepper(self) -> bool:
        """Whether the folder brings the kernels of the project's own stepper, and a compiler made code of the rest."""
        return self._drivers.available

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
        return self._drivers.stepper

    @property
    def differentiating_stepper(self) -> Stepper:
        """The stepper with the derivatives of its steps, compiled when first asked for; errors as for `stepper`."""
        return self._drivers.differentiating_stepper

    @property
    def locating_stepper(self) -> Stepper:
        """The stepper whose steps end on kinks of the laws, compiled when first asked for; errors as for `stepper`."""
        return self._drivers.locating_stepper

    @property
    def ensemble_driver(self) -> EnsembleDriver:
        """The driver of ensembles and reductions, compiled when first asked for; errors as for `stepper`."""
        return self._drivers.ensemble

    def has(self, name: str) -> bool:
        """Whether the model has a function of that name."""
        return self._functions.has(name)

    def function(self, name: str) -> casadi.Function:
        """CasADi function by name, compiled if possible.

        Raises
        ------
        RequestError
            The model has no such function.
        """
        return self._functions.function(name)

    def kernel(self, name: str) -> Kernel:
        """Function by name on memory of its own: ``kernel({"t": 0.0, "x": x, ...})`` costs microseconds."""
        return self._functions.kernel(name)

    def loop(self, name: str, varying: tuple[str, ...]) -> PointLoop:
        """Function by name for many points at once; `varying` names the inputs that change between them."""
        return self._functions.loop(name, varying)

    def sample_outputs(
        self, count: int, values: Mapping[str, Any], names: Sequence[str], *, lean: bool
    ) -> dict[str, Array]:
        """Outputs at many points (see `ballpass.runtime.native.functions`)."""
        return self._functions.sample_outputs(count, values, names, lean=lean)

    def symbolic(self, name: str) -> casadi.Function:
        """CasADi function by name as an expression graph, which can be differentiated further."""
        return self._functions.symbolic(name)

    def virtual_integrator(self, plugin: str, intervals: int) -> casadi.Function:
        """Integrator of one of CasADi's plugins over a grid, in the virtual machine (see `casadi_integrators`)."""
        return self._functions.virtual_integrator(plugin, intervals)

    def numbers(self, parameters: Mapping[str, float] | None = None) -> Numbers:
        """Parameters with overrides, checked, and the derived constants that follow."""
        return numbers_of(self.manifest, parameters, lambda p: self.kernel("constants")({"p": p}))
