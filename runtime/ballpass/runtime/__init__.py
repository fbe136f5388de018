"""Run generated models: load, simulate, differentiate.  Needs neither SymPy nor pint.

Names are imported when first used, so that ``ballpass.runtime.contract`` stays light for those who only write one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ballpass.runtime.app.results import Results, load_results
    from ballpass.runtime.ask.peaks import Peak
    from ballpass.runtime.certify.sensitivity_report import SensitivityReport
    from ballpass.runtime.certify.stored_trade import load_trade
    from ballpass.runtime.certify.trade import Trade
    from ballpass.runtime.contract import Manifest, read_manifest
    from ballpass.runtime.contract.errors import (
        ArtefactError,
        BallpassError,
        CompileError,
        RequestError,
        SimulationError,
    )
    from ballpass.runtime.contract.parameters import Parameters
    from ballpass.runtime.contract.status import IntegrationError, Status
    from ballpass.runtime.many.chunks import MemberFailure
    from ballpass.runtime.many.ensemble import EnsembleResult, EnsembleStatistics
    from ballpass.runtime.model import Model, load
    from ballpass.runtime.native.compile import CacheWarning, NoCompilerWarning
    from ballpass.runtime.point.equilibrium import FreeRingWarning, StaticEquilibrium
    from ballpass.runtime.point.explain import Explanation
    from ballpass.runtime.point.jacobian_function import JacobianFunction
    from ballpass.runtime.point.linearize import KinkWarning, Linearization, Mode
    from ballpass.runtime.run.reductions import Reduction, Reductions
    from ballpass.runtime.run.sensitivity import Sensitivities
    from ballpass.runtime.run.solution import Solution, Statistics, load_solution

__all__ = [
    "ArtefactError",
    "BallpassError",
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
    "BallpassError": "errors",
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
