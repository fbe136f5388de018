"""Arguments of Python calls of a wrong type, refused where they enter by what their annotations say.

Names, texts, paths and mappings are checked here; numbers where their bounds are known.
"""

from __future__ import annotations

import functools
import inspect
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from typing import Any, TypeVar, cast

from ballpass.runtime.contract.errors import RequestError

_Function = TypeVar("_Function", bound=Callable[..., Any])
_Class = TypeVar("_Class")

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
#: The annotations that are checked.
_KINDS = frozenset(kind + none for kind in _EXPECTED for none in ("", " | None"))
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
    return f"{name}: {expected} is expected, not {value!r:.60} ({type(value).__name__}).{example}"


def _without_modules(annotation: str) -> str:
    return re.sub(r"\b(?:\w+\.)+", "", annotation)


def _fits(expected: str, kind: str, value: Any) -> bool:
    if expected == _NAMES:
        several = isinstance(value, Iterable) and not isinstance(value, bytes)
        # an iterator is spent by looking into it
        return several and (iter(value) is value or all(isinstance(item, str) for item in value))
    if expected == _TEXT:
        return isinstance(value, str)
    if expected == _PATH:
        # an empty one would be the working directory
        return isinstance(value, str | os.PathLike) and value != ""
    if expected == _MAPPING:
        nested = kind.startswith("Mapping[str, Mapping")
        return isinstance(value, Mapping) and all(isinstance(item, Mapping) for item in value.values() if nested)
    if kind == "str | Path | Scene":
        return _fits(_PATH, "str | Path", value) or _fits(expected, "Scene", value)
    if kind.startswith("Sequence["):
        return isinstance(value, Sequence) and all(_fits(expected, kind[9:-1], item) for item in value)
    if kind == "Coupling":
        return isinstance(value, str)
    if kind.startswith("Callable[") and "True" not in expected:
        return callable(value)
    if kind == "bool":
        return isinstance(value.item() if getattr(value, "shape", None) == () else value, bool)
    if "True, False or None" in expected:
        return value is None or isinstance(value, bool) or callable(value)
    return any(base.__name__ == kind for base in type(value).__mro__)


def is_number(value: object) -> bool:
    """Whether a value is one real number, also as NumPy has them."""
    if getattr(value, "shape", None) == ():
        value = value.item()  # type: ignore[attr-defined]
    return isinstance(value, Real) and not isinstance(value, bool)


def typed(function: _Function) -> _Function:
    """The function that first refuses arguments of a wrong type with a `RequestError`, as a decorator."""
    written = {name: _without_modules(kind) for name, kind in function.__annotations__.items() if name != "return"}
    kinds = {name: kind for name, kind in written.items() if kind in _KINDS}
    if not kinds:
        return function
    arguments = inspect.signature(function)

    @functools.wraps(function)
    def checked(*given: Any, **named: Any) -> Any:
        values = arguments.bind(*given, **named).arguments
        faults = [type_fault(name, kind, values[name]) for name, kind in kinds.items() if name in values]
        if any(faults):
            raise RequestError("\n".join(filter(None, faults)))
        return function(*given, **named)

    return cast("_Function", checked)


def typed_methods(cls: type[_Class]) -> type[_Class]:
    """A class with `typed` around the public methods that it declares itself, as a decorator."""
    for name, item in list(vars(cls).items()):
        if inspect.isfunction(item) and (name == "__init__" or not name.startswith("_")):
            setattr(cls, name, typed(item))
    return cls
