"""Names of a package that are imported when first used."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def names_of_stub(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of a package whose names its stub imports.

    Parameters
    ----------
    package, file
        `__name__` and `__file__` of the package; beside it lies its stub ``__init__.pyi``.
    """
    statements = ast.parse(Path(file).with_suffix(".pyi").read_text()).body
    homes = {
        alias.name: str(statement.module)
        for statement in statements
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }

    def named(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return named, lambda: sorted(homes), sorted(homes.keys() - {"__version__"})
