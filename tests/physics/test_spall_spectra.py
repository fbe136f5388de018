"""Claims about spalls in envelope spectra: which characteristic frequency tells which part, with slip too."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ballpass.runtime import Model
from ballpass.runtime.quantity.characteristic import characteristic_lines, name_of
from ballpass.runtime.vibration.diagnosis import envelope
from ballpass.runtime.vibration.spectrum import amplitude_spectrum

SPALLS = """
[bearing.defects.outside]
on = "outer"
angle = "-90 deg"
chord = "1 um"
profile = "path"
[bearing.defects.inside]
on = "inner"
angle = "0 deg"
chord = "1 um"
profile = "path"
[bearing.defects.rolling]
on = "ball"
ball = 1
angle = "0 deg"
chord = "1 um"
profile = "path"
[bearing.cage]
slip = 0.0
[bearing.inner_ring]"""


@pytest.fixture(scope="module")
def spalled(make_model: Callable[..., Model]) -> Model:
    return make_model("rotor", ("[bearing.inner_ring]", SPALLS))


@pytest.mark.long
@pytest.mark.parametrize("slip", [0.0, 0.03])
@pytest.mark.parametrize(
    ("spall", "names"),
    [
        ("outside", {"BPFO", "2 BPFO", "3 BPFO"}),
        ("inside", {"BPFI", "BPFI - shaft", "BPFI + shaft"}),
        ("rolling", {"2 BSF", "2 BSF - FTF", "2 BSF + FTF"}),
    ],
)
def test_a_spall_is_named_by_the_highest_lines_of_the_envelope(
    spalled: Model, spall: str, names: set[str], slip: float
) -> None:
    """Chord 1 mm, 1 kN: lines of the spalled part, the loaded one's with sidebands; slip moves them by its part."""
    numbers = {
        f"bearing.defects.{spall}.chord": 1e-3,
        "bearing.cage.slip": slip,
        "bearing.clearance": 1e-5,
        "loads.weight.force.y": -1000.0,
    }
    run = spalled.simulate(200, transient=20, parameters=numbers, rtol=1e-5, outputs=["inner.ay"]).steady()
    found = amplitude_spectrum(run.t, envelope(run.t, run["inner.ay"], (2000.0, 10000.0)), window="hann")
    values = spalled.numbers(numbers).values
    lines = characteristic_lines(spalled.manifest, values)
    rolling = (1 - values["bearing.ball_diameter"] / values["bearing.pitch_diameter"]) / 2
    at = {line.name: line.frequency for line in lines}
    assert at["BPFO"] == pytest.approx(8 * rolling * (1 - slip) * 50.0, rel=1e-12)
    height = found.amplitude
    tops = [k for k in range(2, height.size - 1) if height[k - 1] <= height[k] > height[k + 1]]
    highest = sorted(tops, key=lambda k: -height[k])[:8]
    assert names <= {name_of(float(found.frequency[k]), lines, found.resolution) for k in highest}
