"""A force table over two turns, as in a four-stroke engine: two equal turns are one, and derivatives hold in each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict

WINDOW = 'window = { start = "237 deg", end = "267 deg" }'
FORCE = ('force = ["0 N", "8964.8 N"]', 'direction = "90 deg"')
ANGLES, FORCES = [30.0, 140.0, 230.0, 250.0], [0.0, 500.0, 4000.0, 0.0]


def table(angles: list[float], forces: list[float], more: str = "") -> tuple[tuple[str, str], ...]:
    columns = f'angle = {{ values = {angles}, unit = "deg" }}, force = {{ values = {forces}, unit = "N" }}'
    text = f"table = {{ {columns}{more} }}"
    return FORCE, (WINDOW, text)


@pytest.mark.parametrize("scene", ["punching_press", pytest.param("punching_press_motor", marks=pytest.mark.long)])
def test_two_equal_turns_are_one_and_others_differ(make_virtual: Callable[..., Model], scene: str) -> None:
    both = [*ANGLES, *(angle + 360.0 for angle in ANGLES)]
    one = make_virtual(scene, *table(ANGLES, FORCES))
    two = make_virtual(scene, *table(both, FORCES * 2, ", turns = 2"))
    idle = make_virtual(scene, *table(both, [*FORCES, 0.0, 0.0, 0.0, 0.0], ", turns = 2"))
    a, b, c = (
        model.simulate(2.4, transient=0, method="cvodes", rtol=1e-9, samples_per_cycle=100)["reaction.A.y"]
        for model in (one, two, idle)
    )
    size = np.max(np.abs(a))
    assert b == pytest.approx(a, rel=0, abs=1e-4 * size)
    first, second = slice(0, 80), slice(140, 190)
    assert c[first] == pytest.approx(a[first], rel=0, abs=1e-4 * size)
    assert np.max(np.abs(c[second])) < 0.5 * np.max(np.abs(a[second]))


@pytest.mark.long
def test_derivatives_of_a_cycle_of_two_turns_are_verified(make_model: Callable[..., Model]) -> None:
    both = [*ANGLES, *(angle + 360.0 for angle in ANGLES)]
    model = make_model("punching_press", *table(both, [*FORCES, 0.0, 300.0, 900.0, 0.0], ", turns = 2"))
    path = "mechanism.forces.punch.table"
    names = [f"{path}.force.7", f"{path}.angle.3", f"{path}.angle.7", "mechanism.driver.speed"]
    report = model.sensitivity(["rms:inner.y"], names, 5, transient=1)
    assert report.verdicts[Verdict.VERIFIED] == 4
    assert all(pair.by_steps != 0.0 for pair in report.pairs)


def test_angles_beyond_the_turns_are_refused(scene_text: Callable[..., str]) -> None:
    with pytest.raises(SceneError, match=r"(?s)cover a whole turn.*turns = 2"):
        scene_from_text(scene_text("punching_press", *table([0.0, 100.0, 700.0], [0.0, 1.0, 0.0])), "press")
