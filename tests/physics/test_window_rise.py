"""A load that rises within its window: a table over the same angles, and what the rise does to the press's peak."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict

WINDOW = 'window = { start = "237 deg", end = "267 deg" }'
RISE = (WINDOW, 'window = { start = "237 deg", end = "267 deg", rise = "5 deg" }')
PATH = "mechanism.forces.punch.window"


@pytest.mark.parametrize("scene", ["punching_press", pytest.param("punching_press_motor", marks=pytest.mark.long)])
def test_a_rise_is_a_table_with_four_knots(make_virtual: Callable[..., Model], scene: str) -> None:
    """At a constant speed and where the angle is a state; across zero degrees as well."""
    for start, end in ((237.0, 267.0), (350.0, 25.0)):
        text = f'window = {{ start = "{start} deg", end = "{end} deg", rise = "5 deg" }}'
        risen = make_virtual(scene, (WINDOW, text))
        knots = [start, start + 5.0, start + (end - start) % 360.0 - 5.0, start + (end - start) % 360.0]
        table = (
            f'table = {{ angle = {{ values = {knots}, unit = "deg" }}, '
            'force = { values = [0, 8964.8, 8964.8, 0], unit = "N" } }\ndirection = "90 deg"'
        )
        by_table = make_virtual(scene, ('force = ["0 N", "8964.8 N"]', ""), (WINDOW, table))
        one, other = (model.simulate(1.1, transient=0, method="cvodes", rtol=1e-10) for model in (risen, by_table))
        for name in ("reaction.A.y", "inner.y"):
            size = np.max(np.abs(other[name]))
            assert size > 1e-6
            assert one[name] == pytest.approx(other[name], rel=0, abs=1e-5 * size)


@pytest.mark.long
def test_derivatives_by_the_rise_are_verified_over_turns(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press", RISE)
    names = [f"{PATH}.rise", f"{PATH}.start", f"{PATH}.end", "mechanism.driver.speed"]
    report = model.sensitivity(["rms:inner.y", "peak_ball_force"], names, 3.5, transient=1)
    assert report.verdicts[Verdict.VERIFIED] == 8
    assert all(pair.by_steps != 0.0 for pair in report.pairs)


@pytest.mark.long
@pytest.mark.parametrize(("scene", "lower"), [("punching_press", 0.42), ("punching_press_two_way", 0.15)])
def test_the_peak_of_the_press_is_the_overshoot_of_a_sudden_load(
    make_model: Callable[..., Model], scene: str, lower: float
) -> None:
    """Mean peak over 16 ball angles; another program: 4247 to 2473 N one-way, 5016 to 4215 N two-way."""
    angles = {"bearing.ball_angle": np.arange(16) * np.pi / 64.0}
    sudden, risen = (
        np.mean(make_model(scene, *changes).simulate_many(angles, ["peak_ball_force"])["peak_ball_force"])
        for changes in ((), (RISE,))
    )
    assert 1.0 - risen / sudden == pytest.approx(lower, abs=0.02)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('window = { start = "237 deg", end = "267 deg", rise = "15 deg" }', "cannot rise and fall"),
        ('window = { start = "237 deg", end = "267 deg", rise = "0 deg" }', "above"),
        (
            'window = [{ start = "237 deg", end = "267 deg", rise = "5 deg" }, { start = "7 deg", end = "67 deg" }]',
            "one window among several",
        ),
    ],
)
def test_rises_without_room_are_refused(scene_text: Callable[..., str], text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        scene_from_text(scene_text("punching_press", (WINDOW, text)), "press")
