"""Deriving half of ballpass: scene file to equations to generated code.

    read_scene -> Scene        what to model: frozen, SI, all faults of a file at once
    derive     -> System       SymPy: states, inputs, parameters, definitions, equations of motion, outputs
    lower      -> Functions    CasADi: right-hand side, Jacobians, contact, outputs, derived constants
    generate   -> folder       C, serialised functions, EQUATIONS.md, manifest.json

Nothing flows back.  `ballpass.runtime` reads the folder and never imports this package.

Names are imported when first used: finding that the folder of a scene is fresh does not import SymPy.
"""

from __future__ import annotations

from ballpass.runtime.contract.lazy_names import names_of_stub

__getattr__, __dir__, __all__ = names_of_stub(__name__, __file__)
