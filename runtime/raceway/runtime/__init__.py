"""Run generated models: load, simulate, differentiate.  Needs neither SymPy nor pint.

Names are imported when first used, so that ``raceway.runtime.manifest`` stays light for those who only write one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raceway.runtime.compile import CacheWarning, NoCompilerWarning
    from raceway.runtime.errors import ArtefactError, CompileError, RacewayError, RequestError, SimulationError
    from raceway.runtime.manifest import Manifest, read_manifest
    from raceway.runtime.model import Model, load
    from raceway.runtime.parameters import Parameters
    from raceway.runtime.peaks import Peak
    from raceway.runtime.solution import Solution, Statistics, load_solution
    from raceway.runtime.status import IntegrationError, Status

__all__ = [
    "ArtefactError",
    "CacheWarning",
    "CompileError",
    "IntegrationError",
    "Manifest",
    "Model",
    "NoCompilerWarning",
    "Parameters",
    "Peak",
    "RacewayError",
    "RequestError",
    "SimulationError",
    "Solution",
    "Statistics",
    "Status",
    "load",
    "load_solution",
    "read_manifest",
]

_HOME = {
    "CacheWarning": "compile",
    "NoCompilerWarning": "compile",
    "ArtefactError": "errors",
    "CompileError": "errors",
    "RacewayError": "errors",
    "RequestError": "errors",
    "SimulationError": "errors",
    "Manifest": "manifest",
    "read_manifest": "manifest",
    "Model": "model",
    "load": "model",
    "Parameters": "parameters",
    "Peak": "peaks",
    "Solution": "solution",
    "Statistics": "solution",
    "load_solution": "solution",
    "IntegrationError": "status",
    "Status": "status",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
