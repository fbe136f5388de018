"""The compiled drivers of a model: the stepper, the stepper with derivatives, the driver of ensembles and reductions.

In: a generated folder and a compiler.  Out: each driver, compiled (or found in the cache) when first asked for.
"""

from __future__ import annotations

import threading
from pathlib import Path

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.errors import ArtefactError, RequestError
from ballpass.runtime.native.compilers import Compiler, find_compiler
from ballpass.runtime.native.driver_library import ENSEMBLE_HEADERS, SWITCHES
from ballpass.runtime.native.ensemble_driver import EnsembleDriver, compile_ensemble
from ballpass.runtime.native.stepper import Stepper, compile_locating_stepper, compile_stepper


class NoKernelsWarning(UserWarning):
    """The generated folder has no kernels: CasADi's functions and integrators take the place of the stepper."""


class Drivers:
    """Drivers of one generated folder.

    Parameters
    ----------
    folder : the generated folder, absolute
    manifest : what it consists of
    compiler : command of a C compiler, None for the first that is found
    compiled : whether there is a compiler at all
    """

    def __init__(self, folder: Path, manifest: Manifest, compiler: str | None, *, compiled: bool) -> None:
        self._folder = folder
        self._manifest = manifest
        self._compiler = compiler
        self._compiled = compiled
        self._making = threading.RLock()  # each is compiled once, however many threads ask for it
        self._available: bool | None = None
        self._stepper: Stepper | None = None
        self._differentiating: Stepper | None = None
        self._locating: Stepper | None = None
        self._ensemble: EnsembleDriver | None = None

    @property
    def available(self) -> bool:
        """Whether there was a compiler, and the folder brought the kernels, when first asked."""
        if self._available is None:
            self._available = self._compiled and all((self._folder / name).is_file() for name in ENSEMBLE_HEADERS)
        return self._available

    @property
    def stepper(self) -> Stepper:
        """The driver of single runs, with reductions.

        Raises
        ------
        RequestError
            There is no compiler, or the folder brings no kernels.
        CompileError
            The compiler failed.
        """
        with self._making:
            if self._stepper is None:
                self._stepper = self._make_stepper(sensitivities=False)
            return self._stepper

    @property
    def differentiating_stepper(self) -> Stepper:
        """The same with the derivatives of its steps; errors as for `stepper`."""
        with self._making:
            if self._differentiating is None:
                self._differentiating = self._make_stepper(sensitivities=True)
            return self._differentiating

    @property
    def locating_stepper(self) -> Stepper:
        """The driver of single runs whose steps end on kinks of the laws, with reductions; errors as for `stepper`.

        Raises
        ------
        ArtefactError
            The folder does not say where the kinks are.
        """
        with self._making:
            if self._locating is None:
                if not (self._folder / SWITCHES).is_file():
                    raise ArtefactError(
                        f"{self._folder}: has no {SWITCHES}, which says where the laws have kinks. Write the folder "
                        "again with `ballpass derive`, or leave kinks stepped-over."
                    )
                library = compile_locating_stepper(self._folder, self._manifest, self._find_compiler())
                self._locating = Stepper(library, self._manifest)
            return self._locating

    @property
    def ensemble(self) -> EnsembleDriver:
        """The driver of ensembles and reductions; errors as for `stepper`."""
        with self._making:
            if self._ensemble is None:
                library = compile_ensemble(self._folder, self._manifest, self._find_compiler())
                self._ensemble = EnsembleDriver(library, self._manifest)
            return self._ensemble

    def _find_compiler(self) -> Compiler:
        compiler = find_compiler(self._compiler) if self.available else None
        if compiler is None:
            raise RequestError(
                "method stepper: it needs a C compiler and the kernels in the generated folder. Install gcc or "
                "clang, write the folder again, or take another method."
            )
        return compiler

    def _make_stepper(self, *, sensitivities: bool) -> Stepper:
        compiler = self._find_compiler()
        library = compile_stepper(self._folder, self._manifest, compiler, sensitivities=sensitivities)
        return Stepper(library, self._manifest)
