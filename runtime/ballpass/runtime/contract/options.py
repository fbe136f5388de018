"""Options of questions and commands, each declared once: words, unit, bounds, the text that people write.

A parameter with one of these types is an option of the command line; its default is in the signature.  Help texts,
checks, docstrings and the reference page come from here.  Flags are the parameters' names with hyphens.
"""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, get_args, get_origin

from ballpass.runtime.contract.arguments import brief, is_number, type_fault
from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest

#: What a number with a unit is.
_KINDS = {"s": "time", "Hz": "frequency", "rad": "angle"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """Description and allowed values of an option.

    Attributes
    ----------
    words : for its help
    example : a value, for help on the command line
    shown : placeholder of the value in the help
    flags : on the command line, the first for messages; that of the parameter's name if there is none
    unit : of a quantity, which the command line takes as text with a unit; empty for other options
    least, above, most : bounds of a number
    choices : allowed words; empty for any
    reader : of a record, which the command line takes as text
    names : where its texts name something of a model: raises `RequestError` for what the manifest does not have, and
        without a manifest for what no scene has; called with the manifest or None, the parameter's name, the texts
    positional : whether it stands by its place on the command line, without a flag
    complete : the texts that begin with one, for completion in a shell
    """

    words: str
    example: str = ""
    shown: str | None = None
    flags: tuple[str, ...] = ()
    unit: str = ""
    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf
    choices: tuple[str, ...] = ()
    reader: Callable[[str], Any] | None = None
    names: Callable[[Manifest | None, str, Sequence[str]], object] | None = None
    positional: bool = False
    complete: Callable[[str], list[str]] | None = None

    def flag(self, name: str) -> str:
        """Flag of a parameter on the command line; its placeholder where it has none."""
        if self.positional:
            return self.shown or name
        return self.flags[0] if self.flags else f"--{name.strip('_').replace('_', '-')}"

    def help(self, name: str) -> str:
        """Words for the command line."""
        return f"{self.words.removesuffix('.')}: `{self.flag(name)} {self.example}`." if self.example else self.words

    def fault(self, name: str, kind: Any, value: Any) -> str | None:
        """Fault of a value: the given and the allowed one; None where there is none.

        Parameters
        ----------
        name : name of the option for the caller
        kind : its type
        """
        if is_number(value) and hasattr(value, "item"):
            value = value.item()
        wanted = type_fault(name, kind.__name__ if isinstance(kind, type) else str(kind), value)
        if wanted is not None or (value is None and type(None) in get_args(kind)):
            return wanted
        if choices := self.choices or literals(kind):
            several = is_of(kind, Sequence) and isinstance(value, Iterable) and not isinstance(value, str)
            wrong = [x for x in (value if several else [value]) if not isinstance(x, str) or x not in choices]
            allowed = f"none of the choices. Allowed: {', '.join(choices)}."
            return f"{name}: {brief(wrong[0])} is {allowed}" if wrong else None
        if is_of(kind, tuple):
            right = isinstance(value, Sequence) and len(value) == 2 and all(map(is_number, value))
            return None if right else f"{name}: {brief(value)} was given. Allowed: two numbers [{self.unit}]."
        whole = kind in (int, int | None)
        if not is_number(value):
            given = f"{brief(value)} ({type(value).__name__}) is no number"
            numeric = whole or kind in (float, float | None)
            return f"{name}: {given}. Allowed: {self._allowed('number')}." if numeric else None
        if whole and isinstance(value, float):
            return f"{name}: {value!r} is no whole number. Allowed: {self._allowed('whole number')}."
        words = "whole number" if isinstance(value, int) else _KINDS.get(self.unit, "number")
        value = math.copysign(math.inf, value > 0 or -1) if abs(value) > sys.float_info.max else value
        if self.least <= value <= self.most and value > self.above and math.isfinite(value):
            return None
        given = f"{value:g} {self.unit}".rstrip()
        return f"{name}: {given} lies outside its bounds. Allowed: {self._allowed(words)}."

    def _allowed(self, kind: str) -> str:
        if self.most < math.inf:
            return f"{self.least:g} to {self.most:g}"
        if self.above > -math.inf:
            return f"a {kind} above {self.above:g}"
        return f"a {kind} from {self.least:g} on" if self.least > -math.inf else f"a finite {kind}"


def options_in(annotations: Mapping[str, Any]) -> dict[str, tuple[Any, Option]]:
    """The options among annotations: the type and the option of each."""
    return {
        name: (get_args(kind)[0], option)
        for name, kind in annotations.items()
        for option in getattr(kind, "__metadata__", ())
        if isinstance(option, Option)
    }


@cache
def options_of(function: Callable[..., Any]) -> dict[str, tuple[Any, Option]]:
    """The options among a function's parameters, where they are written as names of types in its module."""
    known = inspect.unwrap(function).__globals__
    return options_in({name: known.get(written) for name, written in function.__annotations__.items()})


def refuse_faults(options: Mapping[str, tuple[Any, Option]], values: Mapping[str, Any]) -> None:
    """Refuse values that are not allowed, all at once; None always is.

    Parameters
    ----------
    options : with their types, by their names for the caller, as are the values

    Raises
    ------
    RequestError
        Numbers out of bounds, words that are none of the choices.
    """
    found = [option.fault(name, kind, values[name]) for name, (kind, option) in options.items() if name in values]
    if any(found):
        raise RequestError("\n".join(filter(None, found)))


def refuse_unknown(
    options: Mapping[str, tuple[Any, Option]], values: Mapping[str, Any], manifest: Manifest | None = None
) -> None:
    """Refuse names that no scene has, all at once; with a manifest those that its model does not have.

    Parameters
    ----------
    options : with their types, by the names of the parameters, as are the values

    Raises
    ------
    RequestError
        Unknown names, with the nearest known ones.
    """
    faults = []
    for name, (_, option) in options.items():
        value = values.get(name)
        if option.names is not None and value is not None:
            is_several = isinstance(value, Sequence) and not isinstance(value, str)
            try:
                option.names(manifest, name, list(value) if is_several else [value])
            except RequestError as fault:
                faults.append(str(fault))
    if faults:
        raise RequestError("\n".join(faults))


def literals(kind: Any) -> tuple[str, ...]:
    """The words of a `Literal`, also of one that may be None."""
    return tuple(
        word
        for one in (kind, *get_args(kind))
        if get_origin(one) is Literal
        for word in get_args(one)
        if word is not None
    )


def is_of(kind: Any, container: type) -> bool:
    """Whether a type is, or may be, one of `Sequence`, `tuple`."""
    return any(get_origin(item) is container for item in (kind, *get_args(kind)))


# ------------------------------------------------------------------------------------------------ how long a run takes

Cycles = Annotated[float | None, Option(words="Turns of driver or shaft to simulate.", shown="N", above=0.0)]

Duration = Annotated[
    float | None,
    Option(
        words="Time to simulate instead of turns, also at speed 0.",
        example='"0.5 s"',
        shown="TIME",
        unit="s",
        above=0.0,
    ),
]

#: Of questions about the steady motion; ``ballpass run`` keeps the transient in its solution.
Transient = Annotated[float | None, Option(words="Turns at the start that do not count.", shown="N", least=0.0)]

# --------------------------------------------------------------------------------------------------------- how exactly


def _tolerance(words: str) -> Option:
    return Option(words=words, shown="R", least=TOLERANCES[0], most=TOLERANCES[1])


Rtol = Annotated[float | None, _tolerance("Relative tolerance of the integrator.")]

TightRtol = Annotated[float | None, _tolerance("Tolerance of the states; tight if not given.")]

SensitivityRtol = Annotated[float | None, _tolerance("Tolerance of the derivatives; tight if not given.")]

Check = Annotated[
    bool, Option(words="Compare each derivative with extrapolated differences.", flags=("--check/--no-check",))
]

# -------------------------------------------------------------------------------------------------------- what to keep


def rate_of_samples(words: str, example: str = '"25.6 kHz"') -> Option:
    """Option of samples a second."""
    return Option(words=words, example=example, shown="RATE", unit="Hz", above=0.0)


SampleRate = Annotated[float | None, rate_of_samples("Samples a second instead of the scene's samples in a turn.")]

# ------------------------------------------------------------------------------------------------- files of recordings

TimeColumn = Annotated[
    str | None,
    Option(
        words="Column of the times; else the one that has the name or the unit of a time.",
        example='"elapsed [ms]"',
        shown="COLUMN",
    ),
]

RecordedRate = Annotated[
    float | None,
    rate_of_samples("Samples a second of the recording, in place of a column of times.", '"20 kHz"'),
]

# ------------------------------------------------------------------------------------------------------- which instant

Instant = Annotated[
    float | None,
    Option(
        words="The instant as a time; the start if none is given.",
        example='"0.08 s"',
        shown="TIME",
        unit="s",
        least=0.0,
        flags=("--time",),
    ),
]

CrankAngle = Annotated[
    float | None,
    Option(
        words="The instant as an angle of crank or shaft in the first turn, or cycle of turns.",
        example='"240 deg"',
        shown="ANGLE",
        unit="rad",
        flags=("--at-angle", "--angle"),
    ),
]
