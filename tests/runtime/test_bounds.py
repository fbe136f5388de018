"""Numbers given in Python meet the bounds of the scene file: no run of a ring with negative mass."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.reading.values import value_bounds, value_relations, with_values
from ballpass.runtime import Model, RequestError


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("mechanism.bodies.slider.mass", -1.0, "allowed is a number above 0 [kg], not -1."),
        ("mechanism.bodies.crank.points.B", 0.0, "allowed is a number above 0 [m], not 0."),
        ("bearing.outer_ring.stiffness", -5e7, "allowed is a number from 0 [N/m], not -50000000."),
        ("bearing.contact.poisson_ratio", 0.5, "allowed is a number above -1 below 0.5 [1], not 0.5."),
        ("bearing.contact.inner_groove_radius", 3.9e-3, "allowed is a number above 0.5 times bearing.ball_diameter"),
        ("bearing.ball_diameter", 15e-3, "bearing.pitch_diameter: allowed is a number above 2.61312593 times"),
    ],
)
def test_a_number_that_no_scene_may_have_is_refused(
    make_model: Callable[..., Model], name: str, value: float, rule: str
) -> None:
    model = make_model("punching_press")
    with pytest.raises(RequestError) as caught:
        model.simulate(cycles=1, parameters={name: value})
    assert rule in str(caught.value)


def test_a_number_of_bearings_is_whole(make_virtual: Callable[..., Model]) -> None:
    model = make_virtual("punching_press_two_way")
    assert model.numbers({"bearing.count": 3.0}).values["bearing.count"] == 3.0
    with pytest.raises(RequestError, match=r"bearing\.count: allowed is a whole number from 1, not 2\.5"):
        model.numbers({"bearing.count": 2.5})


def test_a_member_out_of_bounds_is_reported_and_the_others_kept(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    masses = [2.0, -2.0, 2.5]
    many = model.simulate_many({"mechanism.bodies.slider.mass": masses}, ["peak_ball_force"], cycles=3)
    assert [f.member for f in many.failures] == [1]
    assert "above 0 [kg], not -2" in many.failures[0].message
    assert np.isfinite(many["peak_ball_force"][[0, 2]]).all()


def test_bounds_are_those_of_the_file(scene_text: Callable[..., str]) -> None:
    """Each bound is tried from both sides on the reader's own check, which was written apart from them."""
    scene = scene_from_text(scene_text("punching_press"), "punching_press")
    values = {q.path: q.value for q in scene.quantities}

    def accepted(path: str, value: float) -> bool:
        try:
            with_values(scene, {path: value})
        except SceneError:
            return False
        return True

    for path, bound in value_bounds(scene).items():
        for limit, inside, included in (
            (bound.above, 1, False),
            (bound.least, 1, True),
            (bound.most, -1, True),
            (bound.below, -1, False),
        ):
            if limit is None:
                continue
            assert not accepted(path, limit - inside * 1e-300 if limit == 0.0 else limit - inside * 1e-12)
            if not included:
                assert not accepted(path, limit)
    for path, factor, other in value_relations(scene):
        edge = factor * values[other]
        assert accepted(path, math.nextafter(edge + 1e-12 * abs(edge), math.inf))
        assert not accepted(path, edge - 1e-9 * abs(edge))
