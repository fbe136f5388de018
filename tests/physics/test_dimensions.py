"""Derivatives by all parameters add up as the units of a quantity ask: Euler's theorem, whatever the machine."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from quick_cases import long_but

from ballpass.runtime import Model
from ballpass.runtime.certify.dimensions import identities
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.report.plain import json_text

SCENES = sorted(path.stem for path in (Path(__file__).parents[2] / "scenes").glob("*.toml"))
KINDS = ("max", "rms", "mean", "end", "kurtosis")
#: Turns, so that derivatives by all parameters fit into memory; of Andrews' mechanism, which a torque drives, a time.
SHORT = {"cycles": 0.1, "transient": 0}
LENGTHS = {"toggle_press": {"cycles": 0.5, "transient": 0}, "four_cylinder": SHORT, "andrews": {}}
EACH = ("drive_work", "mean_load", "amplitude:inner.x@1x", "value:inner.y@100deg", "value:inner.y@0.01s")


@pytest.mark.parametrize("scene", long_but(SCENES, "varying_compliance"))
def test_derivatives_by_all_parameters_add_up_as_units_ask(make_model: Callable[..., Model], scene: str) -> None:
    """Of every kind of quantity; the largest departure over all scenes stands in the docs."""
    model, length = make_model(scene), LENGTHS.get(scene, {"cycles": 2, "transient": 1})
    wanted = (r"(\w+\.)?ball\.force", r"(\w+\.)?inner\.[xy]", "drive_torque")
    channels = [name for name in (*model.outputs, *model.states) if any(re.fullmatch(w, name) for w in wanted)]
    channels = channels or list(model.states)
    asked = []
    for name in (*(f"{kind}:{channel}" for channel in channels[:4] for kind in KINDS), *EACH):
        try:
            model.quantities(name, **length)
            asked.append(name)
        except RequestError:  # not of this scene
            continue
    report = model.sensitivity(asked, check=False, **length)
    assert len(report.identities) >= 2 * len(report.quantities) - 4
    worst = max(report.identities, key=lambda one: one.departure)
    assert worst.holds, worst
    timed = {one.base for one in report.identities if one.quantity.endswith("@0.01s")}
    assert timed <= {"kg", "m"}


@pytest.mark.long
def test_a_derivative_that_is_off_by_a_hundredth_is_seen(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    report = model.sensitivity("rms:inner.y")
    assert all(one.holds for one in report.identities)
    assert "the derivatives add up as powers of kg, m, s ask" in str(report)
    units = {name: model.parameters.info(name).unit for name in report.parameters}
    terms = [(pair.parameter, pair.parameter_value, pair.derivative, pair.uncertainty or 0.0) for pair in report.pairs]
    (quantity,) = report.quantities
    for place, (name, value, slope, doubt) in enumerate(terms):
        if abs(value * slope) < 1e-3 * abs(quantity.value) or units[name] in ("rad", "1", ""):
            continue
        patched = [*terms[:place], (name, value, 1.01 * slope, doubt), *terms[place + 1 :]]
        found = identities(quantity.name, quantity.value, quantity.unit, patched, units)
        assert not all(one.holds for one in found), name
    broken = replace(report, identities=tuple(identities("rms:inner.y", 1.0, "m", terms, units)))
    assert "Do not rely on these derivatives" in broken._report().fault
    assert not all(one["holds"] for one in json.loads(json_text(broken._report().facts))["identities"])
