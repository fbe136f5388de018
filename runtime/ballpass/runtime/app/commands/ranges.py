"""Ranges of a scene's numbers, as ``--vary`` of a sweep writes them: also ``=CN:8`` for a group of clearance.

In: a scene or a manifest, and texts.  Out: ranges, all faults at once; the grid of all combinations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.app.commands.load_scene import refuse_run_setting
from ballpass.runtime.ask.parameter_range import MOST, ParameterRange, parameter_range
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest, ParameterInfo

if TYPE_CHECKING:
    from ballpass.derive import Scene


def read_ranges(
    source: Scene | Manifest, texts: Sequence[str], settings: Mapping[str, float]
) -> tuple[ParameterRange, ...]:
    """Ranges as they were written.

    Parameters
    ----------
    source : the scene, or the manifest of a generated folder whose scene may not be here
    texts : ``PATH=A:B:N`` or ``PATH=A:B:N:log``
    settings : numbers that ``--set`` gives, by path

    Raises
    ------
    RequestError
        All faults: no range, a number twice, and those of `parameter_range` and of the scene's paths and groups.
    """
    if not texts:
        raise RequestError(
            'sweep: no number to vary was given. Allowed: one or more ranges, as in --vary bearing.clearance="5 um:40 '
            'um:8". For one set of numbers: ballpass run.'
        )
    faults: list[str] = []
    found: list[ParameterRange] = []
    seen: dict[str, str] = {}
    for text in texts:
        path = text.partition("=")[0].strip()
        if path in settings or path in seen:
            other = f"--vary {seen[path]}" if path in seen else f"--set {path}"
            faults.append(f"--vary {text} and {other}: the number is given twice. Omit one of them.")
            continue
        if path.endswith(".designation"):
            wanted = text.partition("=")[2]
            faults.append(f"--vary {text}: this is no number. Bearings of the tables: select --designation {wanted}.")
            continue
        seen[path] = text
        try:
            refuse_run_setting("--vary", path)
            if isinstance(source, Manifest):
                found.append(parameter_range(source.parameters, "--vary", text, counted=True))
            else:
                found.append(_range_of_scene(source, text))
        except RequestError as fault:
            faults.append(str(fault))
    if faults:
        raise RequestError("\n".join(faults))
    count = math.prod(one.count for one in found)
    if count > MOST:
        raise RequestError(
            f"--vary: {' times '.join(str(one.count) for one in found)} values are {count} members. Allowed: at "
            f"most {MOST}. Take fewer values."
        )
    return tuple(found)


def _range_of_scene(scene: Scene, text: str) -> ParameterRange:
    """A range of a scene's number, in all units of pint; the group that it names is written out."""
    from ballpass.derive import SceneError
    from ballpass.derive.reading.clearance_groups import clearance_of_group
    from ballpass.derive.reading.values import check_path
    from ballpass.derive.scene.units import parse_quantity

    path, _, written = (part.strip() for part in text.partition("="))
    name, *rest = (part.strip() for part in written.split(":"))
    try:
        check_path(scene, path)
        group = clearance_of_group(scene, path, name)
    except SceneError as error:
        raise RequestError("\n".join(f"--vary {fault.render()}" for fault in error.faults)) from None
    if group is not None and len(rest) == 1:
        least, _, most = (f"{1e6 * end:.12g} um" for end in group)
        text = f"{path}={least}:{most}:{rest[0]}"
    one = next(number for number in scene.quantities if number.path == path)
    bounds = asdict(one.limits.bounds) if one.limits.bounds is not None else {}
    info = ParameterInfo(name=path, unit=one.unit, description=one.description, latex="", default=one.value, **bounds)
    return parameter_range([info], "--vary", text, counted=True, parse=parse_quantity)


def grid(ranges: Sequence[ParameterRange]) -> dict[str, np.ndarray]:
    """All combinations: values by path, each of shape (members,); the last range varies fastest."""
    meshes = np.meshgrid(*(one.values for one in ranges), indexing="ij")
    return {one.name: mesh.ravel() for one, mesh in zip(ranges, meshes, strict=True)}
