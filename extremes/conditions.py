"""Cases of conditioning: the reaction matrix of Eq. (1) near positions where the linkage locks."""

from __future__ import annotations

import math
import warnings
from functools import partial

import numpy as np
from scipy.linalg import svdvals

from ballpass.runtime.point.conditioning import ConditioningWarning, conditioning
from extremes.case import Case, Finding
from extremes.models import press

GROUP = "Conditioning"
CRANK = "mechanism.bodies.crank.points.B"


def matrix(crank: float, rod: float, angle: float) -> np.ndarray:
    """Eq. (1) of the paper's press by hand: bodies crank, rod, slider; forces at A, B, C, guide force, drive torque."""
    bx, by = crank * math.cos(angle), crank * math.sin(angle)
    ux, uy = -bx / rod, -math.sqrt(1.0 - (bx / rod) ** 2)
    half = 0.5 * rod
    a = np.zeros((8, 8))
    a[0, 0] = a[1, 1] = a[2, 7] = 1.0
    a[0, 2] = a[1, 3] = -1.0
    a[2, 2:4] = by, -bx
    a[3, 2] = a[4, 3] = 1.0
    a[3, 4] = a[4, 5] = -1.0
    a[5, 2:6] = half * uy, -half * ux, half * uy, -half * ux
    a[6, 4] = a[7, 5] = a[6, 6] = 1.0
    return a


def against_svd(ratio: float, bound: float) -> Finding:
    """Largest condition number over a turn, against that of the matrix by hand at the angle found and beside it."""
    model = press()
    rod = 0.1
    numbers = model.numbers({CRANK: ratio * rod})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConditioningWarning)
        found = conditioning(model, numbers)
    angles = np.concatenate([np.linspace(0.0, 2.0 * math.pi, 721), [found.unscaled_angle]])
    by_hand = []
    for angle in angles:
        s = svdvals(matrix(ratio * rod, rod, float(angle)))
        by_hand.append(s[0] / s[-1])
    return Finding(
        status="done",
        error=abs(found.unscaled / max(by_hand) - 1.0),
        bound=bound,
        note=f"unscaled {found.unscaled:.4g}, scaled {found.scaled:.4g}",
    )


def warned(gap: float, expected: bool) -> Finding:
    """Whether a linkage so near to locking is warned about, with the angle."""
    model = press()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = conditioning(model, model.numbers({CRANK: 0.1 * (1.0 - gap)}))
    words = [str(item.message) for item in said if issubclass(item.category, ConditioningWarning)]
    assert bool(words) == expected, words
    if expected:
        assert "crank angle 180.00 deg" in words[0] or "crank angle 0.00 deg" in words[0], words
    return Finding(status="warned" if expected else "done", note=f"scaled condition number {found.scaled:.3g}")


def cases() -> list[Case]:
    """All of this section."""
    against = "singular values of the matrix by hand"
    return [
        *(
            Case(group=GROUP, name=f"A(q) with crank over rod {ratio:g}", method="conditioning", against=against,
                 run=partial(against_svd, ratio, bound), quick=True)
            for ratio, bound in ((1e-5, 1e-8), (0.06, 1e-8), (0.9, 1e-8), (0.9999, 1e-6))
        ),
        Case(group=GROUP, name="crank over rod 0.9999", method="conditioning", against="no warning below 1e4",
             run=partial(warned, 1e-4, False), quick=True),
        Case(group=GROUP, name="crank over rod 1 - 1e-9", method="conditioning", against="a warning with the angle",
             run=partial(warned, 1e-9, True), quick=True),
    ]  # fmt: skip
