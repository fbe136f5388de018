"""Claims about ``ballpass spectrum`` and ``ballpass stream``: lines by closed forms, their names, refusals."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from typer.testing import Result

from ballpass.runtime import load
from ballpass.runtime.vibration.spectrum import amplitude_spectrum

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "rotor.toml"


@pytest.fixture(scope="module")
def signal(site: Path, ballpass: Callable[..., Result]) -> Path:
    """A preloaded rotor without weight, into a file."""
    file = site / "signal.nc"
    numbers = ("--set", "bearing.clearance=-8 um", "--set", "loads.weight.force.y=0 N")
    rate = ("--sample-rate", "25.6 kHz", "--duration", "1 s")
    done = ballpass("stream", SCENE, *rate, *numbers, "--rtol", "1e-6", "--out", file)
    assert done.exit_code == 0, done.output
    assert "1 s in" in done.stdout
    return file


def test_the_highest_line_of_a_preloaded_rotor_is_its_unbalance(ballpass: Callable[..., Result], signal: Path) -> None:
    """m e w^4/(k - M w^2) at the shaft's frequency, k = (Z/2) 1.5 k_b sqrt(delta_0); power is half its square."""
    words = ("spectrum", signal, "--of", "inner.ax", "--json", "--window", "flattop", "--transient", "20")
    done = ballpass(*words, "--out", "figure")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    speed, stiffness = 100 * math.pi, 6.0 * load("generated/rotor").constants()["bearing.k_b"] * math.sqrt(4e-6)
    expected = 1e-4 * speed**4 / abs(stiffness - 5.0 * speed**2 + 500j * speed)
    assert found["lines"][0]["line"] == "shaft"
    assert found["lines"][0]["frequency"] == pytest.approx(50.0, abs=found["resolution"])
    assert found["lines"][0]["amplitude"] == pytest.approx(expected, rel=3e-3)
    assert found["statistics"]["rms"] == pytest.approx(expected / math.sqrt(2), rel=3e-3)
    power = json.loads(ballpass(*words, "--scaling", "power", "--no-figures").stdout)["lines"][0]["power"]
    assert power == pytest.approx(expected**2 / 2, rel=6e-3)
    assert np.ptp(imread("figure/spectrum.png")[..., :3]) > 0.9


def test_tables_name_the_lines_in_frequencies_orders_and_envelopes(
    ballpass: Callable[..., Result], signal: Path
) -> None:
    for words in ((), ("--orders",), ("--envelope", "2kHz:8kHz"), ("--spectrogram",)):
        done = ballpass("spectrum", signal, "--of", "inner.ay", "--transient", "20", *words)
        assert done.exit_code == 0, done.output
        assert re.search(rf" {'3.05224' if '--orders' in words else '152.612'} +\S+  BPFO\n", done.stdout)
        assert "crest factor" in done.stdout
        assert ("envelope of 2000 to 8000 Hz" in done.stdout) == ("--envelope" in words)
        place, _, names = done.stdout.rpartition("results in ")[2].strip().partition(": ")
        assert all((Path(place) / name).is_file() for name in names.split(", "))


def test_a_table_says_how_low_its_heights_may_read(ballpass: Callable[..., Result], signal: Path) -> None:
    """The least reading of a sine anywhere between two lines, by transforms of the sines themselves."""
    turns = 2.0 * math.pi * np.arange(512) / 512
    for window in ("boxcar", "hann", "blackmanharris", "flattop"):
        read = [
            np.max(amplitude_spectrum(turns, np.sin((60.0 + part) * turns), window=window).amplitude)
            for part in np.linspace(0.0, 1.0, 41)
        ]
        done = ballpass("spectrum", signal, "--of", "inner.ay", "--window", window, "--no-figures")
        assert done.exit_code == 0, done.output
        said = " ".join(done.stdout.split())
        assert ("reads up to" in said) == (min(read) < 0.99)
        assert (f"reads up to {100 * (1 - min(read)):.0f} % low" in said) == (min(read) < 0.99)


@pytest.mark.long
def test_waves_of_the_inner_raceway_are_heard_at_bpfi_and_a_shaft(site: Path, ballpass: Callable[..., Result]) -> None:
    """n = Z + 1 waves of amplitude B: k B w^2/(k - M w^2) at BPFI + shaft, and no other line above a hundredth."""
    text = SCENE.read_text(encoding="utf-8") + '\n[bearing.inner_waviness]\n9 = { amplitude = "0.05 um" }\n'
    (site / "wavy.toml").write_text(text, encoding="utf-8")
    numbers = ("bearing.clearance=-8 um", "loads.weight.force.y=0 N", "loads.unbalance.mass=0 g")
    settings = [word for number in numbers for word in ("--set", number)]
    done = ballpass("spectrum", "wavy.toml", "--of", "inner.ay", *settings, "--window", "flattop", "--json")
    assert done.exit_code == 0, done.output
    first, second = json.loads(done.stdout)["lines"][:2]
    stiffness = 6.0 * load("generated/wavy").constants()["bearing.k_b"] * math.sqrt(4e-6)
    speed = 2 * math.pi * 297.388
    expected = stiffness * 5e-8 * speed**2 / abs(stiffness - 5.0 * speed**2 + 500j * speed)
    assert first["line"] == "BPFI + shaft"
    assert first["amplitude"] == pytest.approx(expected, rel=5e-3)
    assert second["amplitude"] < 0.01 * expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--of", "inner.z"), "inner.z"),
        (("--of", "ball.force"), "one value for each ball"),
        (("--of", "inner.ay", "--scaling", "loud"), "Allowed: amplitude, power, density"),
        (("--of", "inner.ay", "--envelope", "2kHz"), "is no band"),
        (("--of", "inner.ay", "--envelope", "2kHz:20kHz"), "half the sampling"),
        (("--of", "inner.ay", "--window", "loud"), "get_window"),
        (("--of", "inner.ay", "--cycles", "3"), "a finished run"),
        (("--of", "inner.ay", "--top", "0"), "from 1 on"),
        (("--of", "inner.ay", "--orders", "--spectrogram"), "one of the two"),
    ],
)
def test_wrong_requests_are_refused_with_words(
    ballpass: Callable[..., Result], signal: Path, words: tuple[str, ...], message: str
) -> None:
    done = ballpass("spectrum", signal, "--no-figures", *words)
    assert done.exit_code == 2
    assert message in done.stderr.replace("\n", " ")


def test_a_sensor_and_a_chosen_band_are_said(ballpass: Callable[..., Result], signal: Path) -> None:
    words = ("spectrum", signal, "--of", "inner.ay", "--transient", "20", "--no-figures")
    plain, sensed = (
        json.loads(ballpass(*words, *more, "--json").stdout) for more in ((), ("--sensor", "low_pass=30 Hz"))
    )
    assert sensed["lines"][0]["amplitude"] < 0.1 * plain["lines"][0]["amplitude"]
    done = ballpass(*words, "--kurtogram")
    assert done.exit_code == 0, done.output
    assert "chosen by its kurtosis" in done.stdout
    refused = ballpass(*words, "--kurtogram", "--envelope", "2kHz:8kHz")
    assert refused.exit_code == 2
    assert "Omit one of the two" in refused.stderr
    refused = ballpass(*words, "--sensor", "resonance=8")
    assert (refused.exit_code, "--sensor: resonance: " in refused.stderr) == (2, True)
