"""What the compiled drivers share: where their C is, how it is compiled with a model's kernels, how it is called.

In: a generated folder and the C of a driver.  Out: a library, checked against the manifest, and addresses for calls.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.native.compile import CompiledLibrary, compile_sources, digests_of
from ballpass.runtime.native.compilers import Compiler

#: C sources of the drivers, and the generated headers they include: those of single runs, and those of reductions too.
DRIVER = Path(__file__).parent.parent / "driver"
HEADERS = ("kernels.h", "methods.h", "tangents.h")
ENSEMBLE_HEADERS = (*HEADERS, "ensemble_kernels.h")

#: Where the laws have kinks, for the driver whose steps end there; laws without kinks have no such file.
SWITCHES = "switches.h"
LOCATING_HEADERS = (*ENSEMBLE_HEADERS, SWITCHES)

#: IEEE arithmetic throughout, without fused multiply-add: contact amplifies the last bit, and another compiler should
#: give the same motion.  What is given up is errno and traps, and what is gained are vectors of square roots.
#: Packing scalars of short dependent chains costs more than it saves.
FLAGS = ("-O3", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd", "-fno-tree-slp-vectorize")


def check_headers(folder: Path, headers: Sequence[str]) -> None:
    """Raise `ArtefactError` where a generated folder lacks headers, for an older version wrote it."""
    missing = [name for name in headers if not (folder / name).is_file()]
    if missing:
        raise ArtefactError(f"{folder}: has no {', '.join(missing)}. Write the folder again with `ballpass derive`.")


def compile_driver(
    folder: Path,
    manifest: Manifest,
    compiler: Compiler,
    sources: Sequence[str],
    *,
    kind: str,
    headers: Sequence[str],
    flags: tuple[str, ...] = (),
) -> CompiledLibrary:
    """Library of a driver and the kernels of a generated folder.

    Parameters
    ----------
    sources : names of C files in `DRIVER`
    kind : word for the driver in the library's name
    headers : names of the generated headers that the sources include
    flags : further flags, behind `FLAGS`

    Raises
    ------
    ArtefactError
        The folder was written anew since its manifest was read.
    CompileError
        The compiler failed, or a header is missing.
    """
    place = folder.absolute()
    return compile_sources(
        tuple(DRIVER / name for name in sources),
        compiler,
        label=f"{manifest.scene}-{kind}",
        headers=[*sorted(DRIVER.glob("*.h")), *(place / name for name in headers)],
        include=(place, DRIVER),
        flags=(*FLAGS, *flags),
        digests=digests_of(place, manifest),
    )


def input_columns(manifest: Manifest) -> int:
    """Inputs as the drivers count them: at least one, for C knows no arrays without entries."""
    return max(len(manifest.inputs), 1)


def padded(inputs: np.ndarray, columns: int) -> np.ndarray:
    """Inputs, shape (segments, inputs); zeros of shape (segments, columns) where a model has none."""
    return inputs if inputs.shape[1] else np.zeros((len(inputs), columns))


def open_driver(
    library: CompiledLibrary, sizes: str, numbers: int, records: Sequence[type[ctypes.Structure]]
) -> tuple[ctypes.CDLL, list[int]]:
    """Code of a library, checked to take the records that it will be called with.

    Parameters
    ----------
    sizes : name of the C function that tells the library's sizes: some numbers, then bytes of the records
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


def address(name: str, array: np.ndarray) -> int:
    """Address of an array's numbers; the array must outlive its use.  TypeError for other than contiguous float64."""
    if array.dtype != np.float64 or not array.flags.c_contiguous:
        raise TypeError(f"{name}: a C-contiguous array of float64 is expected, not {array.dtype}, {array.flags}")
    found: int = array.ctypes.data
    return found
