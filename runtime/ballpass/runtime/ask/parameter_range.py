"""A range of one parameter as questions take it: ``bearing.clearance=0um:40um``, or with a count behind it.

In: parameters and text.  Out: a `ParameterRange`, SI, within the parameter's bounds.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.bounds import allowed as bounds_text
from ballpass.runtime.contract.bounds import outside
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import ParameterInfo
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.units import QuantityError, parse_quantity

#: The number of a quantity; what stands behind it is its unit.
_NUMBER = re.compile(r"\s*[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?")

#: Most values of a range.
MOST = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRange:
    """Values of a parameter from one end to the other.

    Attributes
    ----------
    name, unit, words : of the parameter
    low, high : ends as they were written, SI
    count : of values; 0 where none was asked for
    shown_unit, factor : the unit that the first end was written in, and its size in `unit`
    logarithmic : whether equal shares are equal factors
    """

    name: str
    unit: str
    words: str
    low: float
    high: float
    count: int = 0
    shown_unit: str = ""
    factor: float = 1.0
    logarithmic: bool = False

    @property
    def values(self) -> np.ndarray:
        """All values, from one end to the other, shape (count,), SI."""
        space = np.geomspace if self.logarithmic else np.linspace
        return np.asarray(space(self.low, self.high, self.count), dtype=float)

    @property
    def shown(self) -> np.ndarray:
        """The same in `shown_unit`."""
        return self.values / self.factor

    def at(self, share: float) -> float:
        """The value that lies so far on the way from the first end to the second, SI."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)

    def share_of(self, value: float) -> float:
        """How far a value lies on the way; beyond 0 and 1 where it lies outside."""
        if self.logarithmic:
            return float(np.log(max(value, 1e-300) / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)

    def slope(self, share: float) -> float:
        """Derivative of that value by the share."""
        if self.logarithmic:
            return self.at(share) * float(np.log(self.high / self.low))
        return self.high - self.low


def parameter_range(
    parameters: Sequence[ParameterInfo],
    option: str,
    text: str,
    *,
    counted: bool = False,
    deviations: bool = False,
    parse: Callable[[object, str], float] = parse_quantity,
) -> ParameterRange:
    """Read a range.

    Parameters
    ----------
    parameters : those that there are
    option : what the caller calls it, for messages
    counted : whether a count of values belongs to it
    deviations : whether it is of changes of the parameter, to which the parameter's bounds do not apply
    parse : reads a text as a number of a unit

    Raises
    ------
    RequestError
        Another form, an unknown parameter, a wrong unit, or ends that are equal or out of bounds.
    """
    form, example = ("PATH=A:B:N", '5 um:40 um:8"') if counted else ("PATH=A:B", '5 um:40 um"')
    shape = form if deviations else f"{form} or {form}:log"
    path, equals, written = (part.strip() for part in text.partition("="))
    parts = [part.strip() for part in written.split(":")]
    logarithmic = not deviations and parts[-1] == "log"
    if not equals or len(parts) - logarithmic != form.count(":") + 1:
        raise RequestError(f'{option}: {text!r:.80} is no range. Allowed: {shape}, as in bearing.clearance="{example}.')
    infos = {info.name: info for info in parameters}
    if path not in infos:
        raise RequestError(f"{option}: {unknown_name('parameter', path, infos)}")
    info = infos[path]
    try:
        low, high = (parse(end, info.unit) for end in parts[:2])
    except QuantityError as error:
        raise RequestError(f"{option} {path}: {error}") from None
    if low == high:
        raise RequestError(f"{option} {path}: both ends are {parts[0]}. Allowed: two ends that differ.")
    if not deviations and outside(info, np.array([low, high])).any():
        raise RequestError(f"{option} {path}: {written} goes beyond its bounds. Allowed: numbers {bounds_text(info)}.")
    if logarithmic and min(low, high) <= 0.0:
        raise RequestError(f"{option} {path}: numbers from zero down have no logarithm. Leave :log away.")
    count = 0
    if counted:
        if not parts[2].isdecimal() or not 2 <= int(parts[2][:9]) <= MOST:
            raise RequestError(
                f"{option} {path}: {parts[2]!r:.40} is no count. Allowed: whole numbers from 2 to {MOST}."
            )
        count = int(parts[2])
    shown = _NUMBER.sub("", parts[0], count=1).strip() or "1"
    return ParameterRange(
        name=path,
        unit=info.unit,
        words=info.description,
        low=low,
        high=high,
        count=count,
        shown_unit=shown,
        factor=parse(f"1 {shown}", info.unit) if shown != "1" else 1.0,
        logarithmic=logarithmic,
    )
