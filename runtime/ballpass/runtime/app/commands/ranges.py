"""Ranges of a scene's numbers, as ``--vary`` writes them: ``bearing.clearance=5 um:40 um:8``, or ``=CN:8`` for a group.

In: a scene, or the manifest of a generated folder, and texts.  Out: a `Range` for each, checked, and the grid of all
their combinations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.app.commands.load_scene import read_value, refuse_run_setting
from ballpass.runtime.contract.bounds import Bounded, outside
from ballpass.runtime.contract.bounds import allowed as bounds_text
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import unknown_name

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.scene.errors import Fault

#: Most members of a sweep.
MOST = 1_000_000

#: The number of a quantity; its unit follows.
_NUMBER = re.compile(r"\s*[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?")

_EXAMPLE = '--vary bearing.clearance="5 um:40 um:8"'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Range:
    """Values of one number.

    Attributes
    ----------
    path : of the number
    unit : SI unit
    values : from one end to the other, shape (points,) [`unit`]
    shown_unit : the unit that the first end was written in
    factor : size of `shown_unit` [`unit`]
    logarithmic : spaced by equal factors instead of equal steps
    """

    path: str
    unit: str
    values: np.ndarray
    shown_unit: str
    factor: float
    logarithmic: bool

    @property
    def shown(self) -> np.ndarray:
        """The values in `shown_unit`, shape (points,)."""
        return self.values / self.factor


class _SceneNumbers:
    """The numbers of a scene: checks of ranges, and the messages of their faults."""

    def __init__(self, scene: Scene) -> None:
        from ballpass.derive.reading.values import value_bounds

        self._scene = scene
        self.bounds: Mapping[str, Bounded] = value_bounds(scene)
        self.units = {quantity.path: quantity.unit for quantity in scene.quantities}

    def fault(self, path: str, problem: str, given: str, allowed: str, remedy: str) -> ValueError:
        """A fault as an error."""
        from ballpass.derive import SceneError
        from ballpass.derive.scene.errors import Fault

        return SceneError([Fault(key=path, problem=problem, given=given, allowed=allowed, remedy=remedy)])

    def together(self, errors: Sequence[ValueError]) -> ValueError:
        """All faults as one error."""
        from ballpass.derive import SceneError

        faults: list[Fault] = []
        for error in errors:
            if not isinstance(error, SceneError):
                return error
            faults += error.faults
        return SceneError(faults, source="--vary")

    def check(self, path: str) -> None:
        """Refuse structure and settings of the run: they are not numbers of the model."""
        from ballpass.derive.reading.values import check_path

        refuse_run_setting(path)
        check_path(self._scene, path)

    def group(self, path: str, name: str) -> tuple[float, ...] | None:
        """Least and most clearance of a group [m]; None where the text names none."""
        from ballpass.derive.reading.clearance_groups import clearance_of_group

        found = clearance_of_group(self._scene, path, name)
        return None if found is None else tuple(found[::2])

    def value(self, path: str, text: str) -> float:
        """A value of a number [SI]."""
        from ballpass.derive.reading.read import parse_override

        return parse_override(self._scene, f"{path}={text}")[1]


class _ModelNumbers:
    """The same of a generated folder, whose scene may not be here."""

    def __init__(self, manifest: Manifest) -> None:
        self.bounds: Mapping[str, Bounded] = {info.name: info for info in manifest.parameters}
        self.units = {info.name: info.unit for info in manifest.parameters}

    def fault(self, path: str, problem: str, given: str, allowed: str, remedy: str) -> ValueError:
        """A fault as an error."""
        return RequestError(f"--vary {path}: {problem}; given: {given}; allowed: {allowed}; remedy: {remedy}")

    def together(self, errors: Sequence[ValueError]) -> ValueError:
        """All faults as one error."""
        return RequestError("\n".join(map(str, errors)))

    def check(self, path: str) -> None:
        """Only numbers of the model can vary."""
        if path not in self.units:
            raise RequestError(f"--vary: {unknown_name('parameter', path, self.units)}")

    def group(self, path: str, name: str) -> tuple[float, ...] | None:
        """None: groups of clearance are in the table of bearings, which the runtime does not have."""
        return None

    def value(self, path: str, text: str) -> float:
        """A value of a number [SI]."""
        return read_value(f"--vary {path}", text, self.units[path])


def read_ranges(source: Scene | Manifest, texts: Sequence[str], settings: Mapping[str, float]) -> tuple[Range, ...]:
    """Ranges as they were written, all faults at once.

    Parameters
    ----------
    source : the scene, or the manifest of its generated folder
    settings : numbers that were set to another value, by path

    Raises
    ------
    RequestError
        None was given, or they have too many combinations; of a manifest, any of the faults below.
    SceneError
        No number of the scene, another unit, ends outside the bounds of a number, a wrong count.
    """
    if not texts:
        raise RequestError(
            f"sweep: no number to vary was given. Allowed: one or more ranges, as in {_EXAMPLE}. For one set of "
            "numbers: ballpass run."
        )
    numbers = _ModelNumbers(source) if isinstance(source, Manifest) else _SceneNumbers(source)
    errors: list[ValueError] = []
    found: list[Range] = []
    seen: dict[str, str] = {}
    for text in texts:
        path = text.partition("=")[0].strip()
        if path in settings or path in seen:
            other = f"--vary {seen[path]}" if path in seen else f"--set {path}"
            given = f"--vary {text} and {other}"
            allowed, remedy = "one range or one value for a number", "omit one of them"
            errors.append(numbers.fault(path, "the number is given twice", given, allowed, remedy))
            continue
        seen[path] = text
        try:
            found.append(_read_range(numbers, text))
        except ValueError as error:
            errors.append(error)
    if errors:
        raise numbers.together(errors)
    count = math.prod(len(one.values) for one in found)
    if count > MOST:
        raise RequestError(
            f"--vary: {' times '.join(str(len(one.values)) for one in found)} values are {count} members. Allowed: at "
            f"most {MOST}. Take fewer values."
        )
    return tuple(found)


def grid(ranges: Sequence[Range]) -> dict[str, np.ndarray]:
    """All combinations: values by path, each of shape (members,); the last range varies fastest."""
    meshes = np.meshgrid(*(one.values for one in ranges), indexing="ij")
    return {one.path: mesh.ravel() for one, mesh in zip(ranges, meshes, strict=True)}


def _read_range(numbers: _SceneNumbers | _ModelNumbers, text: str) -> Range:
    path, equals, written = (part.strip() for part in text.partition("="))
    parts = [part.strip() for part in written.split(":")]

    def require(holds: bool, problem: str, allowed: str, remedy: str) -> None:
        if not holds:
            raise numbers.fault(path, problem, text, allowed, remedy)

    numbers.check(path)
    group = numbers.group(path, parts[0])
    if group is not None and len(parts) == 2:
        parts = [*(f"{1e6 * end:.12g} um" for end in group), parts[1]]
    logarithmic = len(parts) == 4 and parts[3] == "log"
    whole = bool(equals) and (len(parts) == 3 or logarithmic)
    require(whole, "this is not a range", "PATH=A:B:N or PATH=A:B:N:log", f"write it as in {_EXAMPLE}")
    ends = tuple(numbers.value(path, end) for end in parts[:2])
    count = int(parts[2]) if re.fullmatch(r"[0-9]{1,18}", parts[2]) else 0
    remedy = f"write a count after the ends, as in {_EXAMPLE}"
    require(count >= 2, "the count of values is wrong", "a whole number from 2 on", remedy)
    remedy = f'for one value write --set {path}="{parts[0]}"'
    require(ends[0] != ends[1], "both ends are the same", "two ends that differ", remedy)
    remedy = 'omit ":log" for equal steps'
    positive = not logarithmic or min(ends) > 0.0
    require(positive, "numbers from zero down have no logarithm", "two ends above zero", remedy)
    require(count <= MOST, "these are too many values", f"at most {MOST}", "take fewer values")
    bounds = numbers.bounds.get(path)
    if bounds is not None:  # values between the ends are then within the bounds as well
        problem, allowed = "an end lies outside the bounds of this number", f"numbers {bounds_text(bounds)}"
        require(not outside(bounds, np.array(ends)).any(), problem, allowed, "give other ends")
    unit = numbers.units[path]
    shown = _NUMBER.sub("", parts[0], count=1).strip() or "1"
    space = np.geomspace if logarithmic else np.linspace
    return Range(
        path=path,
        unit=unit,
        values=np.asarray(space(ends[0], ends[1], count), dtype=float),
        shown_unit=shown,
        factor=read_value("--vary", f"1 {shown}", unit) if shown != "1" else 1.0,
        logarithmic=logarithmic,
    )
