"""Every kind of quantity by its name.

A kind is one file in `kinds`, which no other file names: a `Kind` in its ``KINDS`` is available in every command.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from ballpass.runtime.contract.plugins import Registry
from ballpass.runtime.quantity import kinds
from ballpass.runtime.quantity.records import Kind


def _found() -> list[Kind]:
    modules = sorted(info.name for info in pkgutil.iter_modules(kinds.__path__))
    every = [kind for name in modules for kind in import_module(f"{kinds.__name__}.{name}").KINDS]
    return sorted(every, key=lambda kind: kind.name)


KINDS: Registry[Kind] = Registry("quantities", "kind of quantity", Kind, _found())


def find_kind(name: str) -> Kind | None:
    """The kind of a name, or of another name of it."""
    return KINDS.get(name) or next((kind for kind in KINDS.values() if name in kind.also), None)
