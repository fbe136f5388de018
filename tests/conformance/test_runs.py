"""Runs with each effect on the balls: methods agree, derivatives by its numbers are those of differences."""

from __future__ import annotations

import numpy as np
import pytest
from parts import PARTS, Part
from stepper_methods import NAMES

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load

pytestmark = pytest.mark.long

RUN = {"cycles": 0.5, "transient": 0.0}


@pytest.fixture(scope="module", params=[part for part in PARTS if part.registry == "effect"], ids=str)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Part, Model]:
    part: Part = request.param
    # the path of a ball over an edge is real within its window alone: not at the gates that the other tests draw
    text = part.text.replace('profile = "rectangular"', 'profile = "path"', 1)
    return part, load(generate(scene_from_text(text, "part"), tmp_path_factory.mktemp("run") / "part"))


def test_methods_agree(case: tuple[Part, Model]) -> None:
    _, model = case
    runs = [model.simulate(**RUN, rtol=1e-11, method=method).x for method in (*NAMES, "cvodes")]
    scale = np.max(np.abs(runs[0]), axis=0)
    for other in runs[1:]:
        assert np.max(np.abs(other - runs[0]) / scale) < 2e-6


def test_derivatives_by_its_numbers_are_those_of_differences(case: tuple[Part, Model]) -> None:
    """By explicit and linearly implicit steps."""
    part, model = case
    names = [name for name in model.parameters if name.startswith(part.path)]
    assert set(part.off) <= set(names)
    slopes = []
    for name in names:
        value = model.parameters[name]
        step = 1e-4 * (1.0 if name.endswith(("angle", "phase")) else abs(value))
        ends = [
            model.simulate(**RUN, rtol=1e-12, method="stepper-dop853", parameters={name: value + s}).x[-1]
            for s in (step, -step)
        ]
        slopes.append((ends[0] - ends[1]) / (2.0 * step))
    for method in ("stepper-dp54", "stepper-rodas5p"):
        found = model.sensitivities(names, cycles=0.5, method=method, rtol=1e-10).x[-1]
        for name, column, slope in zip(names, found.T, slopes, strict=True):
            assert column == pytest.approx(slope, rel=1e-3, abs=2e-4 * np.max(np.abs(slope))), name
