"""From functions to files: the generated folder of a scene.

In: a `System` and its `Functions`.  Out: the files of ``generated/<scene>/``:

model.c, model.h   what every run calls, as C99: constants, outputs, geometry, reactions
equations.c, .h    right-hand side, its derivatives, mass matrix: compiled when first asked for
kernels.h          the model cut into inline functions for the project's own stepper
tangents.h         derivatives of these along several directions at once, for sensitivities
ensemble_kernels.h the kernels for several members of an ensemble at once, and what reductions need
switches.h         where the laws have kinks, for runs whose steps end there; no such file where they have none
model.casadi, equations.casadi    the same functions serialised, for machines without a compiler
jacobians.c, .h    all quantities, their derivatives and those of the right-hand side, compiled when first asked for
jacobians.casadi   the quantities serialised
EQUATIONS.md       the derivation as a readable text
manifest.json      the contract with the runtime, written last

The same scene gives the same bytes on every run.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from ballpass.derive.emit.describe import describe
from ballpass.derive.emit.equations import equations
from ballpass.derive.emit.kernel_headers import ensemble_header, kernels_header, switches_header, tangents_header
from ballpass.derive.emit.signature import deriving_sources
from ballpass.derive.lowering.functions import LoweredFunctions
from ballpass.derive.lowering.jacobians import DERIVATIVES, Described
from ballpass.derive.system import System
from ballpass.runtime.contract.folder import file_digest, write_manifest


def write_folder(folder: Path, system: System, functions: LoweredFunctions, source: str) -> None:
    """Write all files of a generated folder into an empty one; `source` goes into the manifest."""
    _write_c(folder, "model", functions.functions)
    _write_c(folder, "equations", functions.equations)
    _write_c(folder, "jacobians", functions.jacobians)
    for name, text in _headers(system, functions).items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    _pack(folder / "model.casadi", functions.functions)
    _pack(folder / "equations.casadi", functions.equations)
    # values only: without a compiler the runtime makes their derivatives when they are needed
    values = [entry for entry in functions.jacobians if not entry[0].name().endswith(DERIVATIVES)]
    _pack(folder / "jacobians.casadi", values)
    (folder / "EQUATIONS.md").write_text(equations(system, values=False), encoding="utf-8", newline="\n")
    files = tuple((p.name, file_digest(p)) for p in sorted(folder.iterdir()))
    write_manifest(folder, describe(system, functions, source, files), made_by=deriving_sources())


def _headers(system: System, functions: LoweredFunctions) -> dict[str, str]:
    """Texts of the headers for the project's own stepper, by name; none where it does not take the model."""
    kernels = functions.kernels
    if kernels is None:
        return {}
    headers = {
        "kernels.h": kernels_header(system, functions, kernels),
        "ensemble_kernels.h": ensemble_header(kernels),
        "tangents.h": tangents_header(kernels),
    }
    switches = switches_header(system, kernels)
    return {**headers, "switches.h": switches} if switches is not None else headers


def _pack(path: Path, functions: Sequence[Described]) -> None:
    pack = ca.StringSerializer()
    pack.pack(len(functions))
    for function, _ in functions:
        pack.pack(function)
    path.write_bytes(pack.encode().encode("ascii"))  # CasADi itself opens files of UTF-8 paths only


def _write_c(folder: Path, name: str, functions: Sequence[Described]) -> None:
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True})
    for function, _ in functions:
        generator.add(function)
    with tempfile.TemporaryDirectory() as place:  # CasADi writes nothing, without an error, where a path is not UTF-8
        generator.generate(f"{place}{os.sep}")
        for ending in ("c", "h"):
            shutil.copyfile(Path(place) / f"{name}.{ending}", folder / f"{name}.{ending}")
