"""Write NetCDF-4 files in memory, so that a full disk fails in one plain write, not within HDF5; add their seal.

In: variables with dimensions, units and descriptions.  Out: the bytes of a file that xarray and `h5netcdf` read.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

#: Dimensions, values and attributes of a variable.
Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]

#: Bytes of `seal`.
SEAL_LENGTH = 82


def seal(digest: str) -> bytes:
    """Last bytes of a saved file, which HDF5 ignores: the SHA-256 digest of all bytes before.

    The HDF5 library may end the process, or give other numbers, where bytes of a file have changed; so they are checked
    first.
    """
    return b"\nballpass sha256 " + digest.encode() + b"\n"


def netcdf_bytes(variables: Mapping[str, Variable], facts: Mapping[str, Any]) -> bytes:
    """A NetCDF-4 file.

    Parameters
    ----------
    variables : by name; values of type object are texts; one with the name of a dimension gives its coordinates
    facts : attributes of the file
    """
    import h5netcdf
    import h5py

    memory = io.BytesIO()
    with h5netcdf.File(memory, "w") as file:
        for name, (dimensions, values, attributes) in variables.items():
            kind = h5py.string_dtype() if values.dtype == object else values.dtype
            create_variable(file, name, dimensions, values.shape, kind, attributes, data=values)
        file.attrs.update(facts)
    return memory.getvalue()


def create_variable(
    file: Any,
    name: str,
    dimensions: Sequence[str],
    shape: tuple[int, ...],
    kind: Any,
    attributes: Mapping[str, Any],
    **how: Any,
) -> Any:
    """A new variable of a file, and its dimensions where they are new."""
    for dimension, length in zip(dimensions, shape, strict=True):
        if dimension not in file.dimensions:
            file.dimensions[dimension] = length
    variable = file.create_variable(name, dimensions, kind, **how)
    variable.attrs.update(attributes)
    return variable
