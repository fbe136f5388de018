"""The numbers of a model: names, defaults, and overrides checked before anything runs."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from ballpass.runtime.contract.arguments import brief, is_number
from ballpass.runtime.contract.bounds import violations
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest, ParameterInfo
from ballpass.runtime.show import html
from ballpass.runtime.show.short import ShortRepr

#: Most characters of an unknown name that a message shows.
LONGEST_NAME = 100

_HEADS = ("name", "value", "unit", "description")


class Parameters(Mapping[str, float]):
    """Run-time parameters: name to value in SI; ``print`` shows a table with units and descriptions.

    Examples
    --------
    >>> model.parameters["bearing.clearance"], len(model.parameters)  # [m]
    (1e-05, 41)
    """

    __slots__ = ("_infos", "_values")

    def __init__(self, infos: Sequence[ParameterInfo], values: Mapping[str, float]) -> None:
        self._infos = {info.name: info for info in infos}
        self._values = {info.name: float(values[info.name]) for info in infos}

    def __getitem__(self, name: str) -> float:
        try:
            return self._values[name]
        except KeyError:
            raise KeyError(unknown_name("parameter", name, self._values)) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def info(self, name: str) -> ParameterInfo:
        """Unit, description, symbol and default of a parameter.

        Examples
        --------
        >>> info = model.parameters.info("bearing.clearance")
        >>> info.unit, info.default
        ('m', 1e-05)
        """
        self[name]
        return self._infos[name]

    def __repr__(self) -> str:
        first = ", ".join(f"{name} {self[name]:.8g} {info.unit}" for name, info in list(self._infos.items())[:3])
        return f"Parameters({len(self)}: {first}{', ...' if len(self) > 3 else ''})"

    def __str__(self) -> str:
        rows = [_HEADS, *self._rows()]
        names, values, units, _ = (max(map(len, column)) for column in zip(*rows, strict=True))
        lines = [f"{a:<{names}}  {b:>{values}}  {c:<{units}}  {d}".rstrip() for a, b, c, d in rows]
        return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])

    def _repr_html_(self) -> str:
        return html.block(self.table_html())

    def table_html(self) -> str:
        """The table as HTML, for a larger block of a notebook."""
        return html.table(_HEADS, self._rows(), right=("value",))

    def _rows(self) -> list[tuple[str, str, str, str]]:
        return [(name, f"{self[name]:.8g}", info.unit, info.description) for name, info in self._infos.items()]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Numbers(ShortRepr):
    """The numbers of one run: parameters and constants, as vectors and by name."""

    parameters: Parameters
    p: np.ndarray
    c: np.ndarray
    values: dict[str, float]


def resolve_parameters(manifest: Manifest, overrides: Mapping[str, float] | None) -> Parameters:
    """Defaults with `overrides` applied.

    Raises
    ------
    RequestError
        Unknown names (with the nearest known ones), values that are not finite real numbers, or outside the bounds of a
        scene file (see `bounds`); all faults at once.
    """
    values = {info.name: info.default for info in manifest.parameters}
    if overrides is None:
        return Parameters(manifest.parameters, values)
    if not isinstance(overrides, Mapping):
        raise RequestError(
            f"parameters: a mapping from name to value in SI is expected, not {type(overrides).__name__}. "
            'Example: parameters={"bearing.clearance": 8e-6}.'
        )
    units = {info.name: info.unit for info in manifest.parameters}
    faults = []
    for name, value in overrides.items():
        if name not in values:
            faults.append(unknown_name("parameter", name, values))
            continue
        number = scalar(value)
        if wrong := wrong_unit(value, units[name]):
            faults.append(f"{name}: {wrong}")
        elif number is None:
            what = f"{value!r:.200} ({type(value).__name__})"
            faults.append(f"{name}: one number in {units[name]} is expected, not {what}")
        elif not math.isfinite(number):
            faults.append(f"{name}: a finite number in {units[name]} is expected, not {number!r}")
        else:
            values[name] = number
    if not faults:
        for _, rule in violations(manifest, values):
            name = rule.partition(":")[0]
            faults.append(f"{rule}, not {values[name]:.9g}.")
    if faults:
        raise RequestError("\n".join(faults))
    return Parameters(manifest.parameters, values)


def parameters_named(patterns: Sequence[str], known: Iterable[str]) -> list[str]:
    """Parameters by name or shell-style pattern, each once; those of a pattern in the order of `known`."""
    names = list(known)
    found: list[str] = []
    for pattern in patterns:
        matches = [pattern] if pattern in names else [name for name in names if fnmatchcase(name, pattern)]
        if not matches:
            raise RequestError(unknown_name("parameter", pattern, names))
        found += matches
    return list(dict.fromkeys(found))


def numbers_of(
    manifest: Manifest, overrides: Mapping[str, float] | None, constants: Callable[[np.ndarray], np.ndarray]
) -> Numbers:
    """Parameters with overrides, checked, and the derived constants that follow.

    Parameters
    ----------
    constants : derived constants, shape (constants,), of parameters, shape (parameters,); not called where there are
        none

    Raises
    ------
    RequestError
        As `resolve_parameters`; or constants that are not finite.
    """
    numbers = unchecked_numbers(manifest, resolve_parameters(manifest, overrides), constants)
    bad = [info.name for info in manifest.constants if not math.isfinite(numbers.values[info.name])]
    if bad:
        raise RequestError(
            f"With these parameters the derived constants {', '.join(bad)} are not finite numbers. "
            "Check the values that were changed: geometry and elastic constants must be physical."
        )
    return numbers


def unchecked_numbers(
    manifest: Manifest, parameters: Parameters, constants: Callable[[np.ndarray], np.ndarray]
) -> Numbers:
    """Numbers with the derived constants that follow, finite or not; see `numbers_of`."""
    p = np.array(list(parameters.values()), dtype=float)
    c = constants(p) if manifest.constants else np.zeros(0)
    derived = {info.name: float(value) for info, value in zip(manifest.constants, c, strict=True)}
    return Numbers(parameters=parameters, p=p, c=c, values={**parameters, **derived})


def scalar(value: object) -> float | None:
    """`value` as float when it is one real number (NumPy's scalars and arrays of no dimension included), else None."""
    if not is_number(value):
        return None
    try:
        return float(value)
    except OverflowError:  # an integer of more than 308 digits
        return math.inf if value > 0 else -math.inf


def said_unit(given: object) -> str:
    """Unit that numbers of xarray or pint say of themselves, as a scene would have it; empty for plain numbers."""
    said = getattr(given, "units", None)  # of pint
    if said is None:
        said = getattr(given, "attrs", {}).get("units")  # of xarray
    if said is None:
        return ""
    text = f"{said:~}" if hasattr(said, "dimensionality") else str(said)  # pint's symbols
    return text.replace(" ", "") or "1"


def wrong_unit(given: object, *units: str) -> str:
    """What is wrong with numbers that say another unit than these, which should be one; empty where nothing is."""
    said = said_unit(given)
    if not said or {said} == set(units):
        return ""
    allowed = f", or values in {units[0]}" if len(set(units)) == 1 else ""
    return f"values in {said} were given. Allowed: plain numbers in SI{allowed}. Convert them."


def real(value: object) -> float:
    """`value` as float when it is one real number, else NaN, which lies within no bounds."""
    number = scalar(value)
    return math.nan if number is None else number


def whole(name: str, value: object) -> int:
    """A whole number from 1 on; RequestError for another."""
    if not (1.0 <= real(value) < math.inf and real(value).is_integer()):
        raise RequestError(f"{name}: a whole number from 1 on is expected, not {value!r:.80}.")
    return int(real(value))


def vector(value: object) -> np.ndarray:
    """`value` as an array of numbers, of its own shape; where it is none, one NaN, shape (1,)."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return np.array([math.nan])


def check_name(what: str, name: object, known: Iterable[str]) -> None:
    """Refuse a name that is none of the known ones."""
    if name not in (names := list(known)):
        raise RequestError(unknown_name(what, name, names))


def unknown_name(what: str, name: object, known: Iterable[str]) -> str:
    """Message for an unknown name: the nearest ones, or all where they are few."""
    names = list(known)
    text = name if isinstance(name, str) else brief(name)
    text = text if len(text) <= LONGEST_NAME else f"{text[:LONGEST_NAME]}..."
    said = repr(text) if isinstance(name, str) else text
    near = difflib.get_close_matches(text, names, n=4, cutoff=0.5)
    if not near:
        # only the last part of the path given: the commonest slip that the ratio of difflib misses
        tail = text.rsplit(".", 1)[-1]
        near = [candidate for candidate in names if tail and tail in candidate][:4]
    if near:
        return f"There is no {what} {said}. Did you mean {' or '.join(map(repr, near))}?"
    if len(names) <= 12:
        return f"There is no {what} {said}. There are: {', '.join(names) or 'none'}."
    return f"There is no {what} {said}. There are {len(names)}; the first: {', '.join(names[:8])}, ..."
