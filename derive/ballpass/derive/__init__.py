"""Deriving half of ballpass: scene file to equations to generated code.

    read_scene -> Scene        what to model: frozen, SI, all faults of a file at once
    derive     -> System       SymPy: states, inputs, parameters, definitions, equations of motion, outputs
    lower      -> Functions    CasADi: right-hand side, Jacobians, contact, outputs, derived constants
    generate   -> folder       C, serialised functions, EQUATIONS.md, manifest.json

Nothing flows back.  `ballpass.runtime` reads the folder and never imports this package.

Names are imported when first used: reading a scene, or finding that its folder is fresh, does not import SymPy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ballpass.derive.emit.equations import equations
    from ballpass.derive.emit.generate import check, generate
    from ballpass.derive.lowering.functions import lower
    from ballpass.derive.reading.read import read_scene
    from ballpass.derive.scene.errors import SceneError
    from ballpass.derive.scene.records import Scene
    from ballpass.derive.scene.shipped import shipped_scenes
    from ballpass.derive.system import System, derive

__all__ = [
    "Scene",
    "SceneError",
    "System",
    "check",
    "derive",
    "equations",
    "generate",
    "lower",
    "read_scene",
    "shipped_scenes",
]

_HOME = {
    "Scene": "scene.records",
    "SceneError": "scene.errors",
    "System": "system",
    "check": "emit.generate",
    "derive": "system",
    "equations": "emit.equations",
    "generate": "emit.generate",
    "lower": "lowering.functions",
    "read_scene": "reading.read",
    "shipped_scenes": "scene.shipped",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("ballpass.runtime.contract.version").__version__
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
