"""What the compiled drivers share: where their C is, and how it is compiled with a model's kernels.

In: a generated folder and the C of a driver.  Out: a library, checked against the manifest.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.native.compile import CompiledLibrary, compile_sources, digests_of
from ballpass.runtime.native.compilers import Compiler
from ballpass.runtime.native.method_tables import METHOD_TABLES, method_tables
from ballpass.runtime.native.reduction_rows import REDUCTION_TABLES, reduction_tables

#: Folder with the C sources of the drivers.
DRIVER = Path(__file__).parent.parent / "driver"

#: Where the laws have kinks, for the driver whose steps end there; laws without kinks have no such file.
SWITCHES = "switches.h"

#: IEEE arithmetic throughout, without fused multiply-add: contact amplifies the last bit, and another compiler should
#: give the same motion.  What is given up is traps, and what is gained are vectors of square roots.
#: Packing scalars of short dependent chains costs more than it saves.
FLAGS = ("-O3", "-fno-trapping-math", "-fopenmp-simd", "-fno-tree-slp-vectorize")

#: Of gcc, which else spends half its time on registers of Jacobians with ten thousand lines: four bearings compile in
#: two thirds of the time, and the code of one bearing is nearly the same.
GCC_FLAGS = ("--param", "lra-max-considered-reload-pseudos=50")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSources:
    """What a driver is compiled from.

    Attributes
    ----------
    kind : word for it in the library's name
    sources : names of C files in `DRIVER`
    headers : names of the generated headers that these include
    flags : further flags, behind `FLAGS`
    """

    kind: str
    sources: tuple[str, ...] = ("stepper.c",)
    headers: tuple[str, ...]
    flags: tuple[str, ...]


_DERIVATIVES = ("kernels.h", "tangents.h")
_REDUCTIONS = (*_DERIVATIVES, "ensemble_kernels.h")

#: Drivers of single runs: with reductions, which cost a run that does not ask for them nothing that can be measured;
#: with derivatives; with steps that end on the kinks of the laws.
PLAIN = DriverSources(kind="stepper", headers=_REDUCTIONS, flags=("-DBALLPASS_REDUCTIONS",))
DIFFERENTIATING = DriverSources(kind="stepper", headers=_DERIVATIVES, flags=("-DBALLPASS_SENSITIVITIES",))
#: With derivatives, and steps that end on kinks of the laws, and where loads switch as the motion decides.
DIFFERENTIATING_LOCATED = DriverSources(
    kind="differentiating",
    headers=(*_DERIVATIVES, SWITCHES),
    flags=("-DBALLPASS_SENSITIVITIES", "-DBALLPASS_LOCATED"),
)
LOCATING = DriverSources(
    kind="locating", headers=(*_REDUCTIONS, SWITCHES), flags=("-DBALLPASS_LOCATED", "-DBALLPASS_REDUCTIONS")
)

#: Driver of ensembles, without that of single runs.
ENSEMBLE = DriverSources(
    kind="ensemble",
    sources=("ensemble.c", "member_schedule.c", "schedule.c"),
    headers=_REDUCTIONS,
    flags=("-DBALLPASS_REDUCTIONS",),
)


def compile_driver(folder: Path, manifest: Manifest, compiler: Compiler, driver: DriverSources) -> CompiledLibrary:
    """Library of a driver and the kernels of a generated folder.

    Raises
    ------
    ArtefactError
        The folder was written anew since its manifest was read.
    CompileError
        The compiler failed, or a header is missing.
    """
    place = folder.absolute()
    own = GCC_FLAGS if "Free Software Foundation" in compiler.identity else ()
    return compile_sources(
        tuple(DRIVER / name for name in driver.sources),
        compiler,
        label=f"{manifest.scene}-{driver.kind}",
        headers=[*sorted(DRIVER.glob("*.h")), *(place / name for name in driver.headers)],
        made_headers={METHOD_TABLES: method_tables(), REDUCTION_TABLES: reduction_tables()},
        flags=(*FLAGS, *own, *driver.flags),
        digests=digests_of(place, manifest),
    )


def open_driver(
    library: CompiledLibrary, sizes: str, numbers: int, records: Sequence[type[ctypes.Structure]]
) -> tuple[ctypes.CDLL, list[int]]:
    """Code of a library, checked to take the records that it will be called with.

    Parameters
    ----------
    sizes : name of the C function that returns the library's sizes: some numbers, then bytes of the records
    numbers : how many numbers
    records : as declared here

    Returns
    -------
    The code, and the numbers.

    Raises
    ------
    ArtefactError
        Records have other sizes in C: it would write beyond them, or read chance numbers.
    """
    code = ctypes.CDLL(str(library.path))
    found = (ctypes.c_int * (numbers + len(records)))()
    getattr(code, sizes)(found)
    expected = [ctypes.sizeof(record) for record in records]
    if found[numbers:] != expected:
        raise ArtefactError(
            f"{library.path}: the records of the driver's calls have {found[numbers:]} bytes there, and {expected} "
            "where they are called. The driver's C and the Python that calls it are of two versions: install ballpass "
            "again."
        )
    return code, found[:numbers]


def check_sizes(library: CompiledLibrary, what: str, found: Sequence[int], expected: Sequence[int]) -> None:
    """Raise `ArtefactError` where what a library was compiled for is not what the manifest has."""
    if list(found) != list(expected):
        raise ArtefactError(
            f"{library.path}: compiled for {list(found)} {what}, the manifest has {list(expected)}. Write the folder "
            "again."
        )
