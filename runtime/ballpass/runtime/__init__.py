"""Run generated models: load, simulate, differentiate.  Needs neither SymPy nor pint.

Names are imported when first used, so that ``ballpass.runtime.contract`` stays light for those who only write one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ballpass.runtime.app.results import Results as Results
    from ballpass.runtime.app.results import load_results as load_results
    from ballpass.runtime.ask.peaks import Peak as Peak
    from ballpass.runtime.certify.quantity_function import QuantityFunction as QuantityFunction
    from ballpass.runtime.certify.quantity_function import UnknownValueWarning as UnknownValueWarning
    from ballpass.runtime.certify.sensitivity_report import SensitivityReport as SensitivityReport
    from ballpass.runtime.contract.cache import CacheWarning as CacheWarning
    from ballpass.runtime.contract.errors import ArtefactError as ArtefactError
    from ballpass.runtime.contract.errors import BallpassError as BallpassError
    from ballpass.runtime.contract.errors import BallpassWarning as BallpassWarning
    from ballpass.runtime.contract.errors import CompileError as CompileError
    from ballpass.runtime.contract.errors import RequestError as RequestError
    from ballpass.runtime.contract.errors import SimulationError as SimulationError
    from ballpass.runtime.contract.folder import read_manifest as read_manifest
    from ballpass.runtime.contract.manifest import Manifest as Manifest
    from ballpass.runtime.contract.parameters import Parameters as Parameters
    from ballpass.runtime.contract.plausible_ranges import UnusualWarning as UnusualWarning
    from ballpass.runtime.contract.status import Status as Status
    from ballpass.runtime.many.chunks import MemberFailure as MemberFailure
    from ballpass.runtime.many.data_set import DataSetReport as DataSetReport
    from ballpass.runtime.many.data_set import SignalClass as SignalClass
    from ballpass.runtime.many.data_set import make_data_set as make_data_set
    from ballpass.runtime.many.distributions import Distribution as Distribution
    from ballpass.runtime.many.ensemble import EnsembleResult as EnsembleResult
    from ballpass.runtime.many.ensemble import EnsembleStatistics as EnsembleStatistics
    from ballpass.runtime.many.signals import Signals as Signals
    from ballpass.runtime.model import Model as Model
    from ballpass.runtime.model import load as load
    from ballpass.runtime.native.compile import NoCompilerWarning as NoCompilerWarning
    from ballpass.runtime.native.loaded_model import NoKernelsWarning as NoKernelsWarning
    from ballpass.runtime.point.equilibrium import FreeRingWarning as FreeRingWarning
    from ballpass.runtime.point.equilibrium import StaticEquilibrium as StaticEquilibrium
    from ballpass.runtime.point.explain import Explanation as Explanation
    from ballpass.runtime.point.jacobian_function import JacobianFunction as JacobianFunction
    from ballpass.runtime.point.linearize import Linearization as Linearization
    from ballpass.runtime.point.linearize import Mode as Mode
    from ballpass.runtime.point.slopes import KinkWarning as KinkWarning
    from ballpass.runtime.request.start import RunEnd as RunEnd
    from ballpass.runtime.run.reductions import Reduction as Reduction
    from ballpass.runtime.run.reductions import Reductions as Reductions
    from ballpass.runtime.solution.integration_error import IntegrationError as IntegrationError
    from ballpass.runtime.solution.sensitivity import Sensitivities as Sensitivities
    from ballpass.runtime.solution.solution import Solution as Solution
    from ballpass.runtime.solution.solution import Statistics as Statistics
    from ballpass.runtime.solution.solution_file import load_solution as load_solution
    from ballpass.runtime.vibration.sensor import Sensor as Sensor

#: Public names, and the modules that have them.
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
    "CacheWarning": "contract.cache",
    "NoCompilerWarning": "native.compile",
    "NoKernelsWarning": "native.loaded_model",
    "FreeRingWarning": "point.equilibrium",
    "StaticEquilibrium": "point.equilibrium",
    "Explanation": "point.explain",
    "JacobianFunction": "point.jacobian_function",
    "KinkWarning": "point.slopes",
    "Linearization": "point.linearize",
    "Mode": "point.linearize",
    "IntegrationError": "solution.integration_error",
    "Reduction": "run.reductions",
    "Reductions": "run.reductions",
    "Sensitivities": "solution.sensitivity",
    "Sensor": "vibration.sensor",
    "Solution": "solution.solution",
    "Statistics": "solution.solution",
    "load_solution": "solution.solution_file",
    "RunEnd": "request.start",
}
__all__ = sorted(_HOME.keys() - {"__version__"})


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_HOME)
