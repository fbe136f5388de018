"""Run generated models: load, simulate, differentiate.  Needs neither SymPy nor pint.

Names are imported when first used, so that ``ballpass.runtime.contract`` stays light for those who only write one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ballpass.runtime.app.results import Results, load_results
    from ballpass.runtime.ask.peaks import Peak
    from ballpass.runtime.certify.quantity_function import QuantityFunction, UnknownValueWarning
    from ballpass.runtime.certify.sensitivity_report import SensitivityReport
    from ballpass.runtime.contract.errors import (
        ArtefactError,
        BallpassError,
        BallpassWarning,
        CompileError,
        RequestError,
        SimulationError,
    )
    from ballpass.runtime.contract.folder import read_manifest
    from ballpass.runtime.contract.manifest import Manifest
    from ballpass.runtime.contract.parameters import Parameters
    from ballpass.runtime.contract.plausible_ranges import UnusualWarning
    from ballpass.runtime.contract.status import Status
    from ballpass.runtime.many.chunks import MemberFailure
    from ballpass.runtime.many.data_set import DataSetReport, SignalClass, make_data_set
    from ballpass.runtime.many.distributions import Distribution
    from ballpass.runtime.many.ensemble import EnsembleResult, EnsembleStatistics
    from ballpass.runtime.many.signals import Signals
    from ballpass.runtime.model import Model, load
    from ballpass.runtime.native.compile import CacheWarning, NoCompilerWarning
    from ballpass.runtime.native.loaded_model import NoKernelsWarning
    from ballpass.runtime.point.equilibrium import FreeRingWarning, StaticEquilibrium
    from ballpass.runtime.point.explain import Explanation
    from ballpass.runtime.point.jacobian_function import JacobianFunction
    from ballpass.runtime.point.linearize import Linearization, Mode
    from ballpass.runtime.point.slopes import KinkWarning
    from ballpass.runtime.run.integration_error import IntegrationError
    from ballpass.runtime.run.reductions import Reduction, Reductions
    from ballpass.runtime.run.sensitivity import Sensitivities
    from ballpass.runtime.run.sensor import Sensor
    from ballpass.runtime.run.solution import Solution, Statistics
    from ballpass.runtime.run.solution_file import load_solution
    from ballpass.runtime.run.start import RunEnd

__all__ = [
    "ArtefactError",
    "BallpassError",
    "BallpassWarning",
    "CacheWarning",
    "CompileError",
    "DataSetReport",
    "Distribution",
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
    "NoKernelsWarning",
    "Parameters",
    "Peak",
    "QuantityFunction",
    "Reduction",
    "Reductions",
    "RequestError",
    "Results",
    "RunEnd",
    "Sensitivities",
    "SensitivityReport",
    "Sensor",
    "SignalClass",
    "Signals",
    "SimulationError",
    "Solution",
    "StaticEquilibrium",
    "Statistics",
    "Status",
    "UnknownValueWarning",
    "UnusualWarning",
    "load",
    "load_results",
    "load_solution",
    "make_data_set",
    "read_manifest",
]

_HOME = {
    "Results": "app.results",
    "load_results": "app.results",
    "Peak": "ask.peaks",
    "QuantityFunction": "certify.quantity_function",
    "UnknownValueWarning": "certify.quantity_function",
    "SensitivityReport": "certify.sensitivity_report",
    "Manifest": "contract.manifest",
    "read_manifest": "contract.folder",
    "ArtefactError": "contract.errors",
    "BallpassError": "contract.errors",
    "BallpassWarning": "contract.errors",
    "CompileError": "contract.errors",
    "RequestError": "contract.errors",
    "SimulationError": "contract.errors",
    "Parameters": "contract.parameters",
    "Status": "contract.status",
    "UnusualWarning": "contract.plausible_ranges",
    "__version__": "contract.version",
    "MemberFailure": "many.chunks",
    "DataSetReport": "many.data_set",
    "SignalClass": "many.data_set",
    "make_data_set": "many.data_set",
    "Distribution": "many.distributions",
    "EnsembleResult": "many.ensemble",
    "EnsembleStatistics": "many.ensemble",
    "Signals": "many.signals",
    "Model": "model",
    "load": "model",
    "CacheWarning": "native.compile",
    "NoCompilerWarning": "native.compile",
    "NoKernelsWarning": "native.loaded_model",
    "FreeRingWarning": "point.equilibrium",
    "StaticEquilibrium": "point.equilibrium",
    "Explanation": "point.explain",
    "JacobianFunction": "point.jacobian_function",
    "KinkWarning": "point.slopes",
    "Linearization": "point.linearize",
    "Mode": "point.linearize",
    "IntegrationError": "run.integration_error",
    "Reduction": "run.reductions",
    "Reductions": "run.reductions",
    "Sensitivities": "run.sensitivity",
    "Sensor": "run.sensor",
    "Solution": "run.solution",
    "Statistics": "run.solution",
    "load_solution": "run.solution_file",
    "RunEnd": "run.start",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
