"""Run generated models: load, simulate, differentiate.  Needs neither SymPy nor pint.

Names are imported when first used, so that ``raceway.runtime.manifest`` stays light for those who only write one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from raceway.runtime.accuracy.stored_trade import load_trade
    from raceway.runtime.accuracy.trade import Trade
    from raceway.runtime.compiled.compile import CacheWarning, NoCompilerWarning
    from raceway.runtime.derivatives.jacobian_function import JacobianFunction
    from raceway.runtime.derivatives.linearize import KinkWarning, Linearization, Mode
    from raceway.runtime.derivatives.sensitivity import Sensitivities
    from raceway.runtime.derivatives.sensitivity_report import SensitivityReport
    from raceway.runtime.derivatives.statics import FreeRingWarning, StaticEquilibrium
    from raceway.runtime.ensembles.chunks import MemberFailure
    from raceway.runtime.ensembles.ensemble import EnsembleResult, EnsembleStatistics
    from raceway.runtime.errors import ArtefactError, CompileError, RacewayError, RequestError, SimulationError
    from raceway.runtime.explain import Explanation
    from raceway.runtime.integrate.reductions import Reduction, Reductions
    from raceway.runtime.manifest import Manifest, read_manifest
    from raceway.runtime.model import Model, load
    from raceway.runtime.parameters import Parameters
    from raceway.runtime.quantities.peaks import Peak
    from raceway.runtime.results import Results, load_results
    from raceway.runtime.solution import Solution, Statistics, load_solution
    from raceway.runtime.status import IntegrationError, Status

__all__ = [
    "ArtefactError",
    "CacheWarning",
    "CompileError",
    "EnsembleResult",
    "EnsembleStatistics",
    "Explanation",
    "FreeRingWarning",
    "IntegrationError",
    "JacobianFunction",
    "KinkWarning",
    "Linearization",
    "Manifest",
    "MemberFailure",
    "Mode",
    "Model",
    "NoCompilerWarning",
    "Parameters",
    "Peak",
    "RacewayError",
    "Reduction",
    "Reductions",
    "RequestError",
    "Results",
    "Sensitivities",
    "SensitivityReport",
    "SimulationError",
    "Solution",
    "StaticEquilibrium",
    "Statistics",
    "Status",
    "Trade",
    "load",
    "load_results",
    "load_solution",
    "load_trade",
    "read_manifest",
]

_HOME = {
    "load_trade": "accuracy.stored_trade",
    "Trade": "accuracy.trade",
    "CacheWarning": "compiled.compile",
    "NoCompilerWarning": "compiled.compile",
    "EnsembleResult": "ensembles.ensemble",
    "EnsembleStatistics": "ensembles.ensemble",
    "MemberFailure": "ensembles.chunks",
    "ArtefactError": "errors",
    "CompileError": "errors",
    "RacewayError": "errors",
    "RequestError": "errors",
    "SimulationError": "errors",
    "Explanation": "explain",
    "JacobianFunction": "derivatives.jacobian_function",
    "KinkWarning": "derivatives.linearize",
    "Linearization": "derivatives.linearize",
    "Mode": "derivatives.linearize",
    "Manifest": "manifest",
    "read_manifest": "manifest",
    "Model": "model",
    "load": "model",
    "Parameters": "parameters",
    "Peak": "quantities.peaks",
    "Reduction": "integrate.reductions",
    "Reductions": "integrate.reductions",
    "Results": "results",
    "load_results": "results",
    "Sensitivities": "derivatives.sensitivity",
    "SensitivityReport": "derivatives.sensitivity_report",
    "Solution": "solution",
    "Statistics": "solution",
    "load_solution": "solution",
    "FreeRingWarning": "derivatives.statics",
    "StaticEquilibrium": "derivatives.statics",
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
