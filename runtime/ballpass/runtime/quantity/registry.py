"""Every kind of quantity by its name.

A kind is one file in `kinds`, which no other file names: a `Kind` in its ``KINDS`` is available in every command.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module

from ballpass.runtime.quantity import kinds
from ballpass.runtime.quantity.records import Kind


def _found() -> dict[str, Kind]:
    modules = sorted(info.name for info in pkgutil.iter_modules(kinds.__path__))
    every = [kind for name in modules for kind in import_module(f"{kinds.__name__}.{name}").KINDS]
    return {kind.name: kind for kind in sorted(every, key=lambda kind: kind.name)}


KINDS: Mapping[str, Kind] = _found()

#: Other names of kinds.
ALSO: Mapping[str, str] = {also: kind.name for kind in KINDS.values() for also in kind.also}
