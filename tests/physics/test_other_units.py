"""Shipped scenes in other units of length, mass and time: the same machine, and no number in the code has a unit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from quick_cases import long_but

from ballpass.derive import shipped_scenes
from ballpass.derive.scene.units import looked_up_size
from ballpass.runtime import Model
from ballpass.runtime.contract.units import unit_size

SCENES = sorted(path.stem for path in shipped_scenes().values())
#: How many new units of mass, length and time an old one is, by the base units of `unit_size`.
NEW = {"gram": 8.0, "meter": 4.0, "second": 2.0}
#: Difference of an output over its largest value: the tolerance is relative, and steps differ.
AGREE = 1e-6


def ratio(unit: str) -> float:
    """How many new units an old one is."""
    return math.prod(NEW.get(name, 1.0) ** float(power) for name, power in unit_size(unit, looked_up_size).base)


@pytest.mark.parametrize("scene", long_but(SCENES, "rotor", "punching_press_two_way"))
def test_a_scene_in_other_units_moves_alike(make_model: Callable[..., Model], scene: str) -> None:
    model = make_model(scene)
    turn = model.period()
    length = turn if math.isfinite(turn) else model.manifest.run.duration or 0.0
    numbers = {name: value * ratio(model.parameters.info(name).unit) for name, value in model.parameters.items()}
    first = model.simulate(times=np.linspace(0.0, length, 201), duration=length, rtol=1e-11, transient=0)
    other = model.simulate(
        times=first.t * ratio("s"),
        duration=length * ratio("s"),
        parameters=numbers,
        initial=first.x[0] * [ratio(info.unit) for info in model.manifest.states],
        rtol=1e-11,
        transient=0,
    )
    worst = {}
    for info in (*model.manifest.states, *model.manifest.outputs):
        here, there = first[info.name], other[info.name] / ratio(info.unit)
        worst[info.name] = float(np.max(np.abs(here - there)) / (np.max(np.abs(here)) or 1.0))
    assert {name: off for name, off in worst.items() if not off < AGREE} == {}
