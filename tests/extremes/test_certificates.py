"""A few of the pairs that `certificates.py` asks for."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from certificates import SCENES, Query, draw, examine

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict

pytestmark = pytest.mark.extreme


@pytest.mark.parametrize("number", [2, 4])
def test_what_is_verified_is_so(make_model: Callable[..., Model], number: int, holds: Callable[..., None]) -> None:
    """What a certificate calls verified agrees with differences of SciPy's runs."""
    scene = "varying_compliance"
    model = make_model(scene)
    rows = examine(model, draw(model, np.random.default_rng([SCENES.index(scene), number])))
    verified = [row for row in rows if row.pair.check.verdict is Verdict.VERIFIED and row.known]
    assert len(verified) >= 8
    holds(max(abs(row.pair.derivative - row.truth.value) / row.allowed for row in verified if row.allowed > 0.0), 1.0)


def test_integrals_of_ball_forces_are_right(make_model: Callable[..., Model], holds: Callable[..., None]) -> None:
    """Integrals over the balls' forces, which begin and end in contact, have right derivatives by a groove radius."""
    query = Query(
        parameters={"mechanism.driver.start_angle": math.radians(235.0)},
        cycles=0.06,
        of=("rms:ball.elastic_force", "mean:ball.elastic_force[3]", "mean:outer.y"),
        wrt=("bearing.contact.inner_groove_radius",),
    )
    rows = examine(make_model("punching_press_tangent"), query)
    assert all(row.pair.check.verdict is Verdict.VERIFIED for row in rows)
    assert all(row.known for row in rows)
    assert [row.pair.value for row in rows] == pytest.approx([row.value for row in rows], rel=1e-6)
    holds(max(abs(row.pair.derivative / row.truth.value - 1.0) for row in rows), 1e-3)
