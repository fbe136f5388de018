"""Ranges of a scene's numbers, as ``--vary`` writes them: ``bearing.clearance=5 um:40 um:8``, or ``=CN:8`` for a group.

In: a scene and texts.  Out: a `Range` for each, checked, and the grid of all their combinations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.app.commands.asked import refuse_run_setting
from ballpass.runtime.contract.bounds import allowed as bounds_text
from ballpass.runtime.contract.bounds import outside
from ballpass.runtime.contract.errors import RequestError

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.scene.errors import Fault

#: Most members of a sweep.
MOST = 1_000_000

#: The number of a quantity; what stands behind it is its unit.
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


def read_ranges(scene: Scene, texts: Sequence[str], settings: Mapping[str, float]) -> tuple[Range, ...]:
    """Ranges as they were written, all faults at once.

    Parameters
    ----------
    settings : numbers that were set to another value, by path

    Raises
    ------
    RequestError
        None was given, or they have too many combinations.
    SceneError
        No number of the scene, another unit, ends outside the bounds of a number, a wrong count.
    """
    from ballpass.derive import SceneError
    from ballpass.derive.scene.errors import Fault

    if not texts:
        raise RequestError(
            f"sweep: no number to vary was given. Allowed: one or more ranges, as in {_EXAMPLE}. For one set of "
            "numbers: ballpass run."
        )
    faults: list[Fault] = []
    found: list[Range] = []
    seen: dict[str, str] = {}
    for text in texts:
        path = text.partition("=")[0].strip()
        if path in settings or path in seen:
            other = f"--vary {seen[path]}" if path in seen else f"--set {path}"
            given = f"--vary {text} and {other}"
            allowed, remedy = "one range or one value for a number", "leave one of them away"
            problem = "the number is given twice"
            faults.append(Fault(key=path, problem=problem, given=given, allowed=allowed, remedy=remedy))
            continue
        seen[path] = text
        try:
            found.append(_read_range(scene, text))
        except SceneError as error:
            faults += error.faults
    if faults:
        raise SceneError(faults, source="--vary")
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


def _read_range(scene: Scene, text: str) -> Range:
    from ballpass.derive import SceneError
    from ballpass.derive.reading.clearance_groups import clearance_of_group
    from ballpass.derive.reading.read import parse_override
    from ballpass.derive.reading.values import check_path, value_bounds
    from ballpass.derive.scene.errors import Fault
    from ballpass.derive.scene.units import parse_quantity

    path, equals, written = (part.strip() for part in text.partition("="))
    parts = [part.strip() for part in written.split(":")]

    def require(holds: bool, problem: str, allowed: str, remedy: str) -> None:
        if not holds:
            raise SceneError([Fault(key=path, problem=problem, given=text, allowed=allowed, remedy=remedy)])

    # structure and settings of the run are no numbers of the model
    refuse_run_setting(path)
    check_path(scene, path)
    group = clearance_of_group(scene, path, parts[0])
    if group is not None and len(parts) == 2:
        parts = [*(f"{1e6 * end:.12g} um" for end in group[::2]), parts[1]]
    logarithmic = len(parts) == 4 and parts[3] == "log"
    whole = bool(equals) and (len(parts) == 3 or logarithmic)
    require(whole, "this is no range", "PATH=A:B:N or PATH=A:B:N:log", f"write it as in {_EXAMPLE}")
    ends = tuple(parse_override(scene, f"{path}={end}")[1] for end in parts[:2])
    count = int(parts[2]) if re.fullmatch(r"[0-9]{1,9}", parts[2]) else 0
    remedy = f"write a count behind the ends, as in {_EXAMPLE}"
    require(count >= 2, "the count of values is wrong", "a whole number from 2 on", remedy)
    remedy = f'for one value write --set {path}="{parts[0]}"'
    require(ends[0] != ends[1], "both ends are the same", "two ends that differ", remedy)
    remedy = 'leave ":log" away: equal steps instead'
    positive = not logarithmic or min(ends) > 0.0
    require(positive, "numbers from zero down have no logarithm", "two ends above zero", remedy)
    require(count <= MOST, "these are too many values", f"at most {MOST}", "take fewer values")
    bounds = value_bounds(scene).get(path)
    if bounds is not None:  # what lies between the ends is then within them as well
        problem, allowed = "an end lies outside the bounds of this number", f"numbers {bounds_text(bounds)}"
        require(not outside(bounds, np.array(ends)).any(), problem, allowed, "give other ends")
    unit = next(quantity.unit for quantity in scene.quantities if quantity.path == path)
    shown = _NUMBER.sub("", parts[0], count=1).strip() or "1"
    space = np.geomspace if logarithmic else np.linspace
    return Range(
        path=path,
        unit=unit,
        values=np.asarray(space(ends[0], ends[1], count), dtype=float),
        shown_unit=shown,
        factor=parse_quantity(f"1 {shown}", unit) if shown != "1" else 1.0,
        logarithmic=logarithmic,
    )
