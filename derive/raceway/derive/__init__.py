"""Deriving half of raceway: scene file to equations to generated code.

    read_scene -> Scene        what to model: frozen, SI, all faults of a file at once
    derive     -> System       SymPy: states, inputs, parameters, definitions, equations of motion, outputs
    lower      -> Functions    CasADi: right-hand side, Jacobians, contact, outputs, derived constants
    generate   -> folder       C, serialised functions, EQUATIONS.md, manifest.json

Nothing flows back.  `raceway.runtime` reads the folder and never imports this package.
"""

from raceway.derive.emit import check, generate
from raceway.derive.equations import equations
from raceway.derive.errors import SceneError
from raceway.derive.lower import lower
from raceway.derive.read import read_scene
from raceway.derive.scene import Scene
from raceway.derive.system import System, derive

__all__ = ["Scene", "SceneError", "System", "check", "derive", "equations", "generate", "lower", "read_scene"]
