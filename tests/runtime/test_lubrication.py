"""Lubrication as a drawing says it: oil grade, temperature and cleanliness give κ, e_C and a_ISO."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.contract.manifest import LubricationInfo
from ballpass.runtime.ratings import life, lubrication

WORDS = '[bearing.lubrication]\noil_grade = "VG 68"\ntemperature_celsius = 70\ncleanliness = "normal cleanliness"\n'
END = "[bearing.damping]"


def test_viscosity_of_a_grade_is_that_of_a_catalogue() -> None:
    """SKF's example: an oil of ISO VG 68 has about 20 mm²/s at 70 °C."""
    assert 1e6 * lubrication.viscosity("VG 68", 70.0) == pytest.approx(20.0, rel=0.02)
    for grade in lubrication.GRADES:
        assert 1e6 * lubrication.viscosity(grade, 40.0) == pytest.approx(int(grade[3:]), rel=1e-12)
        falling = [lubrication.viscosity(grade, t) for t in np.linspace(-20.0, 150.0, 35)]
        assert np.all(np.diff(falling) < 0.0)


def test_contamination_falls_with_the_code_and_rises_with_film_and_size() -> None:
    for where, codes in lubrication.FILTERS.items():
        factors = [lubrication.contamination_of_code(code, where, 1.0, 0.1) for code in codes]
        assert np.all(np.diff(factors) < 0.0)
        assert 0.0 <= factors[-1] < factors[0] <= 1.0
        for code in codes:
            by_film = [lubrication.contamination_of_code(code, where, kappa, 0.06) for kappa in (0.2, 0.5, 1.0, 2.0)]
            by_size = [lubrication.contamination_of_code(code, where, 0.5, size) for size in (0.03, 0.06, 0.2, 0.5)]
            assert np.all(np.diff(by_film) >= 0.0)
            assert np.all(np.diff(by_size) >= 0.0)
    for code in lubrication.FILTERS["in line"]:  # a filter that all oil passes is the better one
        ways = [lubrication.contamination_of_code(code, where, 0.7, 0.06) for where in ("off line", "in line")]
        assert ways[0] <= ways[1]
    # classes of ISO 281, as printed, the lower end
    assert lubrication.contamination_of_class("normal cleanliness", 0.0335) == 0.5
    assert lubrication.contamination_of_class("normal cleanliness", 0.1) == 0.6


def test_three_words_of_a_drawing_give_the_life_of_their_numbers(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    model = make_model("rotor", (END, WORDS + END))
    (said,) = model.life(cycles=3, transient=2).bearings
    viscosity = lubrication.viscosity("VG 68", 70.0)
    needed = 4500.0 * 3000.0**-0.5 * 33.5**-0.5
    assert said.viscosity_ratio == pytest.approx(1e6 * viscosity / needed, rel=1e-9)
    assert said.contamination == 0.5
    film = LubricationInfo(viscosity_ratio=None, viscosity=viscosity, contamination=0.5)
    numbers = replace(model.manifest.bearings[0], lubrication=film)
    monkeypatch.setattr(model, "manifest", replace(model.manifest, bearings=(numbers,)))
    (plain,) = model.life(cycles=3, transient=2).bearings
    assert said.factor == plain.factor
    assert said.modified_life == plain.modified_life
    monkeypatch.undo()
    assert f"κ {said.viscosity_ratio:.3g}, e_C 0.5" in str(model.life(cycles=3, transient=2))
    assert said.life is not None
    load = said.dynamic_rating * (1e6 / said.life) ** (1 / 3)
    assert said.factor == pytest.approx(life.life_factor(said.viscosity_ratio, 0.5 * said.fatigue_limit / load))


@pytest.mark.parametrize(
    ("keys", "key", "words"),
    [
        ('oil_grade = "VG 70"\ntemperature_celsius = 70\ncontamination = 0.5', "oil_grade", "VG 68"),
        ('oil_grade = "VG 68"\ncontamination = 0.5', "temperature_celsius", "missing"),
        ('oil_grade = "VG 68"\ntemperature_celsius = "70 degC"\ncontamination = 0.5', "temperature_celsius", "number"),
        ('oil_grade = "VG 68"\ntemperature_celsius = 343\ncontamination = 0.5', "temperature_celsius", "Celsius"),
        ("viscosity_ratio = 1", "lubrication", "cleanliness|contamination"),
        ('viscosity_ratio = 1\ncontamination = 0.5\noil_code = "-/17/14"', "lubrication", "twice"),
        ('viscosity_ratio = 1\ncontamination = 0.5\nfilter = "in line"', "filter", "belongs"),
        ('viscosity_ratio = 1\noil_code = "-/21/18"\nfilter = "in line"', "oil_code", "-/19/16"),
    ],
)
def test_wrong_words_are_refused(scene_text: Callable[..., str], keys: str, key: str, words: str) -> None:
    text = scene_text("rotor", (END, f"[bearing.lubrication]\n{keys}\n{END}"))
    with pytest.raises(SceneError, match=words) as error:
        scene_from_text(text, "rotor")
    assert any(key in fault.key for fault in error.value.faults)


def test_a_code_and_a_filter_give_the_factor_of_the_annex(make_model: Callable[..., Model]) -> None:
    film = '[bearing.lubrication]\nviscosity_ratio = 0.8\noil_code = "-/15/12"\nfilter = "in line"\n'
    (found,) = make_model("rotor", (END, film + END)).life(cycles=3, transient=2).bearings
    share = min(0.0432 * 0.8**0.68 * 33.5**0.55, 1.0)
    assert found.contamination == pytest.approx(share * (1.0 - 0.9987 / 33.5 ** (1 / 3)), rel=1e-12, abs=0.0)
