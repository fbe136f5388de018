"""Ranges in which the numbers of a scene usually lie: a number outside is allowed, but probably a mistake.

In: a `Scene`.  Out: ranges for its manifest, by which the runtime warns, wherever a number comes from.  The range of a
number is declared with its key; ranges for ratios of several numbers are here and with their laws.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby

from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.records import Scene, quantities_of
from ballpass.runtime.contract.manifest import UsualInfo

#: Sum of the shares of several bearings at one joint.
_SHARES = (1.0 - 1e-9, 1.0 + 1e-9)


def usual_ranges(scene: Scene) -> tuple[UsualInfo, ...]:
    """The ranges that apply to the numbers of a scene."""
    known = {quantity.path for quantity in scene.quantities}
    found: list[UsualInfo] = []
    if scene.mechanism is not None:
        for force in scene.mechanism.forces:
            found += _declared(quantities_of(force), known)
            found += (*force.law.usual(scene.mechanism.driver), *force.pathway.usual(force))
    found += _declared(quantities_of(scene.bearings), known)
    at_joint = sorted(scene.bearings, key=lambda bearing: bearing.joint or "")
    for joint, group in groupby(at_joint, key=lambda bearing: bearing.joint):
        shares = [bearing.share.path for bearing in group if bearing.share is not None]
        if len(shares) > 1:
            hint = "The bearings carry the shaft's whole load together."
            if joint is not None:
                hint = f"The bearings at joint {joint} carry its whole reaction together."
            found.append(UsualInfo(names=tuple(shares), least=_SHARES[0], most=_SHARES[1], hint=hint))
    return tuple(found)


def _declared(quantities: Iterable[SceneNumber], known: set[str]) -> Iterator[UsualInfo]:
    for quantity in quantities:
        usual = quantity.limits.usual
        if usual is not None:
            of = _nearest(quantity.path, usual.of, known) if usual.of else ""
            yield UsualInfo(names=(quantity.path,), least=usual.least, most=usual.most, of=of, hint=usual.hint)


def _nearest(path: str, name: str, known: set[str]) -> str:
    """Path of the number of a name in the innermost table around `path` that has one."""
    while path:
        path = path.rpartition(".")[0]
        if f"{path}.{name}" in known:
            return f"{path}.{name}"
    raise KeyError(name)
