"""Groups of clearance in place of numbers: ``--set bearing.clearance=C3``, ``--vary bearing.clearance=CN:9``.

In: a scene, the path of a number, the text given for it.  Out: the range of the group in operation.
"""

from __future__ import annotations

from ballpass.derive.scene.designations import GROUPS, BearingType, bearing_types
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.table import listing
from ballpass.derive.scene.units import show


def no_group(kind: BearingType) -> tuple[str, str]:
    """Problem and allowed groups, where a bearing's bore has not the group that is named."""
    allowed = listing([group for group in GROUPS if kind.clearance(group) is not None])
    return f"ISO 5753-1 has no such group for a bore of {kind.bore} mm", allowed


def clearance_of_group(scene: Scene, path: str, written: str) -> tuple[float, float, float] | None:
    """Lowest, middle and highest clearance of a group [m], reduced by `bearing.fit`.

    Returns
    -------
    None where `path` is no clearance, or `written` no group

    Raises
    ------
    SceneError
        The bearing has no designation, or ISO 5753-1 no such group for its bore.
    """
    bearing = next((b for b in scene.bearings if b.clearance.path == path), None)
    if bearing is None or written not in GROUPS:
        return None
    catalogue = bearing.catalogue
    kind = bearing_types().get(catalogue.designation) if catalogue is not None else None
    if catalogue is None or kind is None:
        allowed, remedy = "a group where the scene names a designation", "write the clearance as a length"
        raise Fault(key=path, problem="no bore is known", given=show(written), allowed=allowed, remedy=remedy).error()
    span = kind.clearance(written)
    if span is None:
        problem, allowed = no_group(kind)
        raise Fault(key=path, problem=problem, given=show(written), allowed=allowed, remedy="name one of them").error()
    least, middle, most = (um / 1e6 - catalogue.mounting_loss for um in (span[0], sum(span) / 2.0, span[1]))
    return least, middle, most
