"""Refuse scenes for which a question has no meaning: those without states, or without bearings.

In: what asks, and whether the scene has them.  Out: nothing, or a `RequestError` that says what such a scene can be
asked.
"""

from __future__ import annotations

from ballpass.runtime.contract.errors import RequestError


def refuse_still(what: str, *, integrated: bool) -> None:
    """Refuse a scene without states."""
    if not integrated:
        raise RequestError(
            f"{what}: this scene has no states, because all follows from the driver's angle: nothing is integrated, so "
            "that there is no tolerance, no transient and no stability. Allowed: a scene with [bearing], "
            "[mechanism.driver.torque] or a table of the driver's speed. Ask this one for samples (ballpass run) or "
            "quantities (ballpass run --of, sweep, sensitivity, optimize)."
        )


def refuse_without_bearings(what: str, *, bearings: bool) -> None:
    """Refuse a scene without bearings."""
    if not bearings:
        raise RequestError(
            f"{what}: this scene has no bearing. Allowed: a scene with [bearing] or [bearings.<name>]. Its joints' "
            "reactions, which bearings would carry, are outputs and quantities: ballpass run --of max:reaction.A.x."
        )
