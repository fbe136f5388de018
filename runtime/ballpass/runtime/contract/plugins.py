"""Laws, elements, effects, quantities, questions and methods of other packages.

A plugin is a module with a tuple ``BALLPASS`` of what it adds.  It is named by an entry point of the group
``ballpass``, for the kind that is the entry point's name (`GROUPS`), or by `use` for all kinds.  A module is imported
when a name is looked up that ballpass itself does not have, or when all names are listed.
"""

from __future__ import annotations

import hashlib
import importlib.util
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeVar

from ballpass.runtime.contract.errors import BallpassError, BallpassWarning, RequestError

#: Kinds of what a plugin may add: the names of entry points.
GROUPS = (
    *("damping_laws", "force_laws", "torque_laws", "rolling_elements", "rated_elements", "effects"),
    *("quantities", "methods", "questions"),
)

#: Name of the tuple in a module.
TUPLE = "BALLPASS"

#: Before the name of a module among the versions of a manifest, where its digest stands.
PLUGIN = "plugin "

T = TypeVar("T")

#: Modules that `use` was called with, in that order, and what named them: absolute paths of files.
_used: dict[str, str] = {}

#: Names of the modules that list an object, by its identity.
_listed_by: dict[int, set[str]] = {}


class PluginWarning(BallpassWarning):
    """A plugin that a model was derived with is not installed, or has changed."""


class MissingEntryError(RequestError, KeyError):
    """Neither ballpass nor a plugin has an entry of this name."""


def use(names: Iterable[str]) -> None:
    """Add modules that no entry point names: their names, or paths of files ``.py``.

    Raises
    ------
    RequestError
        There is no such module, it cannot be imported, or it has no tuple ``BALLPASS``.
    """
    for name in names:
        path = Path(name)
        if path.suffix == ".py":
            if not path.is_file():
                raise RequestError(f"plugin {name}: there is no such file. Allowed: a file, or the name of a module.")
            if (folder := str(path.parent.absolute())) not in sys.path:
                sys.path.insert(0, folder)
        module = path.stem if path.suffix == ".py" else name
        _entries(module)
        _used[module] = str(path.absolute()) if path.suffix == ".py" else name


def used() -> tuple[str, ...]:
    """What another process must `use` to have the same plugins."""
    return tuple(_used.values())


def used_modules() -> set[str]:
    """Top-level modules that `use` was called with."""
    return {module.partition(".")[0] for module in _used}


def entries_of(group: str) -> Iterator[Any]:
    """What plugins list, of one of `GROUPS` or of modules that were named for all."""
    for point in _points():
        if point.name not in GROUPS:
            raise RequestError(
                f"the entry point {point.name} = {point.value!r} of the package {_package(point)} is none of ballpass. "
                f"Allowed names: {', '.join(GROUPS)}. Correct it in the package, or remove the package."
            )
    named = {point.value for point in _points() if point.name == group}
    for module in dict.fromkeys((*sorted(named), *_used)):
        yield from _entries(module)


def modules_of(*entries: Any) -> tuple[str, ...]:
    """Top-level modules whose sources decide what entries are: those that list them, and those of their classes."""
    found = {module for entry in entries for module in _listed_by.get(id(entry), ())}
    for entry in entries:
        kind = entry if isinstance(entry, type) else type(entry)
        found |= {base.__module__ for base in kind.__mro__}
    tops = {module.partition(".")[0] for module in found}
    return tuple(sorted(tops - {"ballpass"} - sys.stdlib_module_names))


def digest_of(module: str) -> str | None:
    """Digest of the sources of a top-level module; None where it is not installed.

    Of a package these are all its files; of a module that is one file, the modules in the same folder, which it may
    import.
    """
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    places, pattern = spec.submodule_search_locations, "**/*"
    if places is None:
        places, pattern = [str(Path(spec.origin or "").parent)], "*.py"
    digest = hashlib.sha256()
    for folder in sorted(map(Path, places)):
        for path in sorted(path for path in folder.glob(pattern) if path.is_file() and path.suffix != ".pyc"):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def warn_of_changes(versions: Iterable[tuple[str, str]], folder: Path) -> None:
    """Warn of plugins that a folder was generated with and that are not installed, or have other sources now."""
    for name, key in versions:
        module = name.removeprefix(PLUGIN)
        if module == name or (now := digest_of(module)) == key:
            continue
        words = "has changed since, and numbers are those of then. Run the scene file, which derives it anew"
        if now is None:
            words = (
                "Python does not find here: the model runs as it was generated, and cannot be derived anew. Install "
                f"it, or give its file: --plugin {module}.py"
            )
        warnings.warn(f"{folder} has a law, element or effect of {module}, which {words}.", PluginWarning, stacklevel=4)


def place_of(fault: BaseException) -> str:
    """File and line of a plugin's code that an error comes from; empty where it is none of a plugin."""
    modules = {sys.modules[name] for names in _listed_by.values() for name in names if name in sys.modules}
    files = {getattr(module, "__file__", None) for module in modules}
    lines = [frame for frame in traceback.extract_tb(fault.__traceback__) if frame.filename in files]
    return f"{Path(lines[-1].filename).name}, line {lines[-1].lineno}" if lines else ""


def digests() -> dict[str, str | None]:
    """Digest of every plugin that can be looked up, by its top-level module: what else decides a result."""
    modules = (*(point.value for point in _points()), *_used)
    return {name: digest_of(name) for name in sorted({module.partition(".")[0] for module in modules})}


class Registry(Mapping[str, T]):
    """Entries by name: ballpass's own, and those of plugins, which are looked up when asked.

    Parameters
    ----------
    group : one of `GROUPS`
    word : what an entry is called
    kind : class of the entries
    own : ballpass's own; by name where `name` does not give it
    name : of an entry
    classes : whether the entries are classes, not objects
    """

    def __init__(
        self,
        group: str,
        word: str,
        kind: type[Any],
        own: Iterable[T] | Mapping[str, T],
        *,
        name: Callable[[Any], str] = attrgetter("name"),
        classes: bool = False,
    ) -> None:
        self._group, self._word, self._kind, self._name, self._classes = group, word, kind, name, classes
        self._own = dict(own) if isinstance(own, Mapping) else {name(entry): entry for entry in own}

    def __getitem__(self, name: str) -> T:
        if name in self._own:
            return self._own[name]
        found = self.added()
        if name not in found:
            raise MissingEntryError(
                f"There is no {self._word} {name!r} here. Allowed: {', '.join((*self._own, *found))}. Install the "
                "package that has it, or give its module by --plugin."
            )
        return found[name]

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self.added()

    def __len__(self) -> int:
        return len(self._own) + len(self.added())

    def added(self) -> dict[str, T]:
        """Those of plugins."""
        found: dict[str, T] = {}
        for entry in added(self._group, self._kind, classes=self._classes):
            name = self._name(entry)
            if name in self._own or found.get(name, entry) is not entry:
                raise RequestError(
                    f"plugin {_lists(entry)}: there is a {self._word} {name!r} already. Allowed: a name of its own. "
                    "Rename it."
                )
            found[name] = entry
        return found


def added(group: str, kind: type[Any], *, classes: bool = False) -> list[Any]:
    """Entries of plugins that are of a class; subclasses of it with `classes`."""
    found = []
    for entry in entries_of(group):
        is_class = isinstance(entry, type)
        if is_class and issubclass(entry, kind) and not classes:
            raise RequestError(
                f"plugin {_lists(entry)}: {TUPLE} lists the class {entry.__name__}. "
                f"Allowed: an object of it. Write {TUPLE} = ({entry.__name__}(),)."
            )
        if issubclass(entry, kind) if is_class and classes else isinstance(entry, kind):
            found.append(entry)
    return found


def _lists(entry: object) -> str:
    return ", ".join(sorted(_listed_by[id(entry)]))


@cache
def _points() -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group="ballpass"))


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else "unknown"


@cache
def _entries(module: str) -> tuple[Any, ...]:
    try:
        found = getattr(importlib.import_module(module), TUPLE, None)
    except BallpassError:
        raise
    except Exception as fault:
        raise RequestError(
            f"plugin {module}: it cannot be imported ({type(fault).__name__}: {fault}). Allowed: a module that Python "
            "finds and imports, or a file of it as law.py. Correct it, or remove its package."
        ) from fault
    if not isinstance(found, tuple):
        raise RequestError(
            f"plugin {module}: the module has no tuple {TUPLE} of what it adds. Allowed: {TUPLE} = (Law(),). Write it."
        )
    for entry in found:
        _listed_by.setdefault(id(entry), set()).add(module)
    return found
