"""How far balls may be deflected and rings displaced: the limits, and the sentences where a run passes them.

In: a bearing of the manifest.  Out: templates of `str.format`, which name what they are filled with.  Pages with the
solver in them fill the same ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.ratings.of_bearing import rated_element

#: Largest share of a ball's diameter that a ball can be flattened by, and that is usual [1].
FLATTENED, MOST_DEFLECTION = 0.1, 0.01

Limit = Literal["flattened", "displaced", "deflected"]

#: Beyond these results mean nothing; the other is unusual.
VOID: tuple[Limit, ...] = ("flattened", "displaced")


def passed_limit(ball: float, deflection: float, displaced: float) -> Limit | None:
    """The limit that results pass; None: none.

    Parameters
    ----------
    ball : diameter [m]
    deflection, displaced : largest of a ball, and largest displacement of the rings [m]
    """
    if deflection > FLATTENED * ball:
        return "flattened"
    if displaced > ball:
        return "displaced"
    return "deflected" if deflection > MOST_DEFLECTION * ball else None


def void_words(bearing: BearingInfo, values: Mapping[str, float], deflection: float) -> str:
    """Why results with this largest deflection of a ball [m] mean nothing; empty where they mean something."""
    ball, clearance = (values[f"{bearing.path}.{key}"] for key in ("ball_diameter", "clearance"))
    displaced = deflection + clearance / 2.0
    limit = passed_limit(ball, deflection, displaced)
    return limit_words(bearing, limit, ball=ball, deflection=deflection, displaced=displaced) if limit in VOID else ""


def limit_templates(bearing: BearingInfo) -> Mapping[Limit, str]:
    """A sentence for each limit, over `deflection` and `displaced` [mm], and the `share` of the diameter [%]."""
    noun = rated_element(bearing).noun
    void = (
        "these results mean nothing, for no bearing can be so. Reduce load, speed or clearance, give more damping, or "
        "check stiffness, masses and their units."
    )
    return {
        "flattened": f"{bearing.path}: a {noun} is flattened by {{deflection:.4g}} mm, {{share:.3g}} % of its "
        f"diameter: {void}",
        "displaced": f"{bearing.path}: the rings are displaced by {{displaced:.4g}} mm, more than a {noun}'s diameter: "
        f"{void}",
        "deflected": f"{bearing.path}: a {noun} is deflected by {{deflection:.4g}} mm, {{share:.3g}} % of its "
        f"diameter: unusual. Usual is at most {100.0 * MOST_DEFLECTION:g} %: contacts are not elastic beyond. Check "
        "loads, stiffness and their units.",
    }


def limit_words(bearing: BearingInfo, limit: Limit, *, ball: float, deflection: float, displaced: float) -> str:
    """The sentence of a limit; lengths in m."""
    share = 100.0 * deflection / ball
    return limit_templates(bearing)[limit].format(deflection=1e3 * deflection, displaced=1e3 * displaced, share=share)
