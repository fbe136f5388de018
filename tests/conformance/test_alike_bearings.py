"""Claims about bearings whose kernels are written once: each has its own numbers, wherever it stands among others."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from parts import shipped

from ballpass.runtime import Model

#: Two alike bearings with an unlike one between them: designation, clearance, mass of the inner ring and its rotor.
BEARINGS = {
    "first": ("6204", "8 um", "20 kg"),
    "roller": ("NU204", "30 um", "15 kg"),
    "last": ("6204", "14 um", "9 kg"),
}
TEXT = """
[bearings.{name}]
designation = "{}"
clearance = "{}"
share = 1.0

[bearings.{name}.damping]
law = "one-sided"
coefficient = "683 N*s/m"

[bearings.{name}.inner_ring]
mass = "{}"
damping = "200 N*s/m"

[bearings.{name}.outer_ring]
support = "fixed"
"""


def scene(*names: str) -> str:
    """A shaft under a load in these bearings, which do not feel each other."""
    text = shipped("varying_compliance")
    head, _, run = text.partition("[bearing]")[0], *text.partition("[run]")[1:]
    parts = [TEXT.format(*BEARINGS[name], name=name) for name in names]
    return head + "".join(parts) + "[run]" + re.sub(r"outputs = \[.*?\]", 'outputs = ["*"]', run, flags=re.S)


@pytest.mark.long
@pytest.mark.parametrize("alone", ["roller", "last"])
def test_each_of_alike_bearings_moves_as_it_does_alone(model_of: Callable[..., Model], alone: str) -> None:
    """In single runs, members in lanes, and derivatives."""
    together, one = model_of(scene(*BEARINGS), "together"), model_of(scene(alone), "alone")
    state, clearance = f"{alone}.inner.x", f"bearings.{alone}.clearance"
    runs = [model.simulate(cycles=2, rtol=1e-11) for model in (together, one)]
    np.testing.assert_allclose(runs[0][state], runs[1][state], rtol=1e-7, atol=1e-14)
    force = [run[f"{alone}.ball.force"] for run in runs]
    np.testing.assert_allclose(force[0], force[1], rtol=1e-6, atol=1e-6 * np.max(force[1]))
    table, observed = {clearance: np.linspace(4e-6, 12e-6, 3)}, [f"end:{state}", f"max:{alone}.ball.force"]
    options = {"cycles": 1, "transient": 0, "rtol": 1e-9, "kinks": "stepped-over"}
    members = [model.simulate_many(table, observed, **options) for model in (together, one)]
    for name in observed:
        np.testing.assert_allclose(members[0][name], members[1][name], rtol=1e-5)
        assert np.ptp(members[0][name]) > 0.0
    slopes = [model.sensitivities(clearance, cycles=1) for model in (together, one)]
    size = np.max(np.abs(slopes[1][state, clearance]))
    np.testing.assert_allclose(slopes[0][state, clearance], slopes[1][state, clearance], atol=1e-5 * size)
    assert np.max(np.abs(slopes[0]["first.inner.x", clearance])) < 1e-7 * size


@pytest.mark.parametrize(("names", "structures"), [(("first", "last"), 1), (("first", "roller", "last"), 2)])
def test_kernels_of_alike_bearings_are_written_once(
    model_of: Callable[..., Model], names: tuple[str, ...], structures: int
) -> None:
    """The law's text of each structure, however many bearings have it."""
    folder = model_of(scene(*names), "together").folder
    text = (folder / "kernels.h").read_text()
    assert len(re.findall(r"void bp_\d+_forces_lanes\(", text)) == structures
