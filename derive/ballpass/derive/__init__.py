"""Deriving half of ballpass: scene file to equations to generated code.

    read_scene -> Scene        what to model: frozen, SI, all faults of a file at once
    derive     -> System       SymPy: states, inputs, parameters, definitions, equations of motion, outputs
    lower      -> Functions    CasADi: right-hand side, Jacobians, contact, outputs, derived constants
    generate   -> folder       C, serialised functions, EQUATIONS.md, manifest.json

Nothing flows back.  `ballpass.runtime` reads the folder and never imports this package.
"""

from ballpass.derive.emit.equations import equations
from ballpass.derive.emit.folder import check, generate
from ballpass.derive.lower.functions import lower
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.scene.read import read_scene
from ballpass.derive.scene.records import Scene
from ballpass.derive.system import System, derive

__all__ = ["Scene", "SceneError", "System", "check", "derive", "equations", "generate", "lower", "read_scene"]
