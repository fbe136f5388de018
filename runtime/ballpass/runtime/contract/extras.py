"""Optional packages: where one is missing, the error names the extra that installs it."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

from ballpass.runtime.contract.errors import RequestError

#: Title and extra of the packages that are imported where they are needed.
EXTRAS = {
    "dask": ("Dask", "scale"),
    "jax": ("JAX", "jax"),
    "matplotlib": ("matplotlib", "figures"),
    "mcp": ("the MCP SDK", "mcp"),
    "pandas": ("pandas", "labelled"),
    "scipy": ("SciPy", "analysis"),
    "torch": ("PyTorch", "torch"),
    "xarray": ("xarray", "labelled"),
    "zarr": ("Zarr", "scale"),
}


#: What to do where a compiler is missing.
INSTALL_COMPILER = 'Install gcc or clang, or a compiler from PyPI: `pip install "ballpass[compiler]"`'

#: What works without a compiler, in messages and on the page about installing.
WITHOUT_COMPILER = (
    "Without a C compiler `run`, `stream`, `spectrum`, `section`, `animate`, `linearize`, `jacobian`, `explain` and "
    "`export --c` work, in CasADi's virtual machine. All other commands that compute, `export --fmu`, and `run` with "
    "`--of`, `--error`, `--turns settle` or a method of the stepper, need one"
)


def need(module: str) -> Any:
    """A module of a package of `EXTRAS`.

    Raises
    ------
    RequestError
        It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as fault:
        package = module.partition(".")[0]
        if (fault.name or "").partition(".")[0] not in (package, "distributed"):
            raise
        raise RequestError(missing(package)) from None


def missing(package: str) -> str:
    """Message for a package of `EXTRAS` that is not installed."""
    name, extra = EXTRAS[package]
    target = f"'ballpass-runtime[{extra}]'"
    if can_derive():  # ballpass brings figures and analysis
        target = package if extra in ("figures", "analysis") else f"'ballpass[{extra}]'"
    return f"This needs {name}, which is not installed: pip install {target}."


def is_installed(package: str) -> bool:
    """Whether a package is there; it is not imported."""
    return importlib.util.find_spec(package) is not None


def can_derive() -> bool:
    """Whether the deriving half is installed, `ballpass.derive`."""
    return importlib.util.find_spec("ballpass.derive") is not None
