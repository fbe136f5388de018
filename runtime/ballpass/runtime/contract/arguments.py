"""Arguments of Python calls: made plain where they enter, and refused there where they are of a wrong type.

In: a value and its annotation.  Out: what NumPy holds without a dimension as a plain value, names in anything that has
an order as a tuple, an integer beyond all floats as infinite.  Names, texts, paths and mappings are checked here;
numbers where their bounds are known.
"""

from __future__ import annotations

import functools
import inspect
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from typing import Any, TypeGuard, TypeVar, cast

from ballpass.runtime.contract.errors import RequestError

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Class = TypeVar("_Class")

#: Bytes of a name in a path, and of a path.
_LONGEST, _LONGEST_PATH = 255, 4000

_NAMES, _TEXT, _PATH, _MAPPING = "one name or several in a list", "a text", "a path", "a mapping from name to value"

#: What is expected where these words stand in an annotation.
_EXPECTED = {
    "str | Sequence[str]": _NAMES,
    "Sequence[str]": _NAMES,
    "tuple[str, ...]": _NAMES,
    "str | Path": _PATH,
    "str": _TEXT,
    "Mapping[str, Any]": _MAPPING,
    "Mapping[str, float]": _MAPPING,
    "Mapping[str, str]": _MAPPING,
    "Mapping[str, Mapping[str, Expr]]": _MAPPING,
    "str | Path | Scene": "a path or a scene",
    "Scene": "a scene that `read_scene` gave",
    "System": "a system that `derive` gave",
    "Coupling": '"one-way" or "two-way"',
    "Sequence[SignalClass]": "signal classes in a list",
    "Signals": "what is recorded, as Signals",
    "Callable[[str], None]": "a function that takes words",
    "Callable[[Manifest], None]": "a function that takes a manifest",
    "LoadedModel": "a model that `load` gave",
    "Solution": "a solution of a run",
    "Sensor": "a sensor",
    "bool": "True or False",
    "Progress": "a function that takes the finished fraction, True, False or None",
    "Callable[[str, float], None] | bool": "a function that takes words and the finished fraction, True, False or None",
}
_EXAMPLES = {
    "outputs": '["inner.y"]',
    "of": '["rms:inner.y"]',
    "observables": '["peak_ball_force"]',
    "wrt": '["bearing.clearance"]',
    "method": '"auto"',
    "compiler": '"gcc"',
    "name": '"ball.force"',
    "folder": '"generated/press"',
    "path": '"results/press.nc"',
    "parameters": '{"bearing.clearance": 10e-6}',
    "units": '{"bearing.clearance": "um"}',
    "model": 'load("generated/press")',
    "solution": "model.simulate()",
    "sensor": "Sensor(resonance=8e3)",
}


def type_fault(name: str, annotation: str, value: Any) -> str | None:
    """Why a value is none of what an annotation says; None where it is one, or the annotation is of another kind."""
    kind = _without_modules(annotation)
    optional = kind.removesuffix(" | None")
    expected = _EXPECTED.get(optional)
    if expected is None or (value is None and optional != kind) or _fits(expected, optional, value):
        return None
    example = f" Example: {name}={_EXAMPLES[name]}." if name in _EXAMPLES else ""
    if expected == _PATH and isinstance(value, str | os.PathLike):
        example = f" Names in a path have up to {_LONGEST} bytes, none of them NUL.{example}"
    elif expected == _NAMES and isinstance(value, set | frozenset):
        example = f" A set has no order.{example}"
    return f"{name}: {expected} is expected, not {brief(value)} ({type(value).__name__}).{example}"


def brief(value: object) -> str:
    """A value as Python writes it, shortened."""
    value = os.fspath(value) if isinstance(value, os.PathLike) else value
    try:
        return f"{value!r:.60}"
    except (ValueError, RecursionError):  # more digits, or lists in lists, than Python writes
        return f"a {type(value).__name__} that cannot be written"


def plain(annotation: str, value: Any) -> Any:
    """A value as the code behind an annotation takes it."""
    if type(value).__module__ == "numpy" and getattr(value, "shape", None) == ():
        value = value.item()
    value = _finite(value)
    kind = _without_modules(annotation).removesuffix(" | None")
    if _EXPECTED.get(kind) == _NAMES:
        if isinstance(value, str):
            return value if kind.startswith("str") else (value,)
        if isinstance(value, Iterable) and not isinstance(value, bytes | set | frozenset):
            return tuple(value)
    return value


def _without_modules(annotation: str) -> str:
    return re.sub(r"\b(?:\w+\.)+", "", annotation)


def _fits(expected: str, kind: str, value: Any) -> bool:
    if expected == _NAMES:
        several = isinstance(value, Iterable) and not isinstance(value, bytes | set | frozenset)
        return several and all(isinstance(item, str) for item in value)
    if expected == _TEXT or kind == "Coupling":
        return isinstance(value, str)
    if expected == _PATH:
        # an empty one would be the working directory
        return isinstance(value, str | os.PathLike) and value != "" and _is_file_name(os.fspath(value))
    if expected == _MAPPING:
        nested = kind.startswith("Mapping[str, Mapping")
        return isinstance(value, Mapping) and all(isinstance(item, Mapping) for item in value.values() if nested)
    if kind == "str | Path | Scene":
        return _fits(_PATH, "str | Path", value) or _fits(expected, "Scene", value)
    if kind.startswith("Sequence["):
        return isinstance(value, Sequence) and all(_fits(expected, kind[9:-1], item) for item in value)
    if kind.startswith("Callable[") and "True" not in expected:
        return callable(value)
    if kind == "bool":
        return isinstance(value.item() if getattr(value, "shape", None) == () else value, bool)
    if "True, False or None" in expected:
        return value is None or isinstance(value, bool) or callable(value)
    return any(base.__name__ == kind for base in type(value).__mro__)


def _finite(value: Any, depth: int = 64) -> Any:
    """A value that Python can write: integers beyond all floats are infinite, lists are in few others."""
    if isinstance(value, int):
        return value if abs(value) <= sys.float_info.max else math.inf if value > 0 else -math.inf
    if type(value) in (list, tuple, dict) and not depth:
        return ...
    if type(value) is dict:
        return {_finite(key): _finite(item, depth - 1) for key, item in value.items()}
    return type(value)(_finite(item, depth - 1) for item in value) if type(value) in (list, tuple) else value


def _is_file_name(path: str | bytes) -> bool:
    """Whether a file system can have it: text that can be encoded, no NUL, names and the whole not too long."""
    try:
        name = os.fsencode(path)
    except UnicodeEncodeError:
        return False
    return b"\0" not in name and len(name) <= _LONGEST_PATH and max(map(len, re.split(rb"[/\\]", name))) <= _LONGEST


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is one real number, also as NumPy has them."""
    if getattr(value, "shape", None) == ():
        value = value.item()  # type: ignore[attr-defined]
    return isinstance(value, Real) and not isinstance(value, bool)


def typed(function: _Function) -> _Function:
    """The function that first refuses arguments of a wrong type with a `RequestError`, as a decorator."""
    written = {name: _without_modules(kind) for name, kind in function.__annotations__.items() if name != "return"}
    arguments = inspect.signature(function)

    @functools.wraps(function)
    def checked(*given: Any, **named: Any) -> Any:
        bound = arguments.bind(*given, **named)
        values = bound.arguments
        for name, kind in written.items():
            if name in values:
                values[name] = plain(kind, values[name])
        faults = [type_fault(name, kind, values[name]) for name, kind in written.items() if name in values]
        if any(faults):
            raise RequestError("\n".join(filter(None, faults)))
        return function(*bound.args, **bound.kwargs)

    return cast("_Function", checked)


def typed_methods(cls: type[_Class]) -> type[_Class]:
    """A class with `typed` around the public methods that it declares itself, as a decorator."""
    for name, item in list(vars(cls).items()):
        if inspect.isfunction(item) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, typed(item))
    return cls
