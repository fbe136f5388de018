"""The pages that hold the tool against measurements and other programs: their numbers are those of their scripts."""

from __future__ import annotations

import math
import re
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scripts.validation import cage_lag, lines, load_zone, spall_lines

from ballpass.runtime.vibration.diagnosis import diagnosis

PAGES = Path(__file__).resolve().parents[2] / "docs" / "validation"
SCRIPTS = ("spall_lines", "load_zone", "cage_lag", "lives", "motions", "classifier", "machines", "mechanisms")


def text(name: str) -> str:
    return (PAGES / f"{name}.md").read_text(encoding="utf-8")


def shown(name: str) -> list[str]:
    """What the page shows that its script prints."""
    (block,) = re.findall(rf"```console\n\$ python -m scripts\.validation\.{name}\n(.*?)\n```", text(name), re.DOTALL)
    return str(block).split("\n")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) for n in SCRIPTS if n != "cage_lag"])
def test_a_page_shows_what_its_script_prints(name: str) -> None:
    script = import_module(f"scripts.validation.{name}")
    found = script.printed(script.compare()) if name == "spall_lines" else script.printed()
    assert found == shown(name)


def test_slip_of_the_cage_falls_with_the_load() -> None:
    """Both series of MFPT; over the shaft's own line, where the recording has it, and over 25 Hz."""
    rows = cage_lag.measured(None)
    assert cage_lag.printed(rows) == shown("cage_lag")
    inner = [cage_lag.slip(one.spall, one.order) for one in rows if one.spall == "inner"]
    outer = [cage_lag.slip(one.spall, one.line) for one in rows if one.spall == "outer"]
    assert np.all(np.diff(inner) < 0.0)
    assert np.all(np.diff(outer) < 0.0)
    # read off the same recordings by another program: order of the outer line over 25 Hz
    others = [3.2033, 3.2067, 3.2075, 3.2100, 3.2129, 3.2208, 3.2273]
    assert [one.line for one in rows if one.spall == "outer"] == pytest.approx(others, abs=3e-4)


def test_the_contact_angle_of_outer_spalls_gives_the_lines_of_inner_ones() -> None:
    """CWRU, files 130 to 133 give those of 105 to 108 within 0.1 %; no contact angle misses both by 0.2 % and more."""
    rows = {int(one.file): one for one in spall_lines.measured(None)}
    angle = spall_lines.angle_of("outer", float(np.mean([rows[n].order for n in range(130, 134)])))
    assert 4.0 < math.degrees(angle) < 11.0
    for spall, numbers in (("outer", range(130, 134)), ("outer", range(144, 148)), ("inner", range(105, 109))):
        for number in numbers:
            order = rows[number].order
            assert order == pytest.approx(spall_lines.ball_pass(spall, angle), rel=1e-3)
            assert abs(order / spall_lines.ball_pass(spall, 0.0) - 1.0) > 2e-3
    # said on the page: another bearing, whose line no angle gives that gives those of the first
    orders = [float(np.mean([rows[n].order for n in numbers])) for numbers in (range(105, 109), range(169, 173))]
    assert abs(orders[1] / orders[0] - 1.0) > 2.1e-3
    assert abs(orders[1] / spall_lines.ball_pass("inner", angle) - 1.0) > 2e-3
    # read off the same recordings by another program: order over the speed of the file
    others = {130: 3.5962, 131: 3.5972, 132: 3.5973, 133: 3.5969, 105: 5.3984, 106: 5.4016, 107: 5.4018, 108: 5.4000}
    for number, order in others.items():
        assert rows[number].line == pytest.approx(order, abs=1.1e-4)


def test_an_angle_by_the_line_of_a_spall_gives_that_of_the_other_raceway_in_each_bearing() -> None:
    """Within 0.1 %, as read off the mean spectra of four files each; both add up to the balls over the shaft."""
    rows = {int(one.file): one for one in spall_lines.measured(None)}
    others = spall_lines.other_lines(None, rows)
    assert list(others) == list(spall_lines.GROUPS)
    for name, (spall, numbers) in spall_lines.GROUPS.items():
        order = float(np.mean([rows[number].order for number in numbers]))
        given = spall_lines.ball_pass(spall_lines.other_of(spall), spall_lines.angle_of(spall, order))
        assert others[name][0] == pytest.approx(given, rel=1e-3)
        assert others[name][0] + order == pytest.approx(9.0, rel=4e-4)
        assert others[name][1] > 4.0


def test_lines_of_a_spall_stand_higher_than_those_of_the_other_ring() -> None:
    """In every second of the files that were chosen; BPFO against BPFI, without a classifier."""
    from scripts.validation import classifier  # imports scikit-learn

    seconds = [one for one in classifier.measured(None) if one.file in (*range(105, 109), *range(130, 134))]
    assert len(seconds) == 80
    for one in seconds:
        outer, inner = one.features[0], one.features[2]
        assert (outer > inner) == (one.label == "outer")


def test_kurtosis_of_recordings_at_6_and_12_o_clock_is_alike_and_that_at_3_is_half() -> None:
    """At every load of the motor, though rms at 12 o'clock is the least and that at 3 o'clock the highest."""
    rows = {(one.place, one.load): one for one in load_zone.measured(None)}
    assert len(rows) == 12
    for load in range(4):
        six, three, twelve = (rows[place, load] for place in (6, 3, 12))
        assert twelve.rms < 0.5 * six.rms < 0.5 * three.rms
        assert twelve.kurtosis == pytest.approx(six.kurtosis, rel=0.11)
        assert three.kurtosis == pytest.approx(0.53 * six.kurtosis, rel=0.06)


def test_kurtosis_of_a_resonance_is_one_and_a_half_decays_between_hits() -> None:
    """What the page explains the model's kurtosis by, whatever the height of the hits."""
    rate, ball_pass, decay = 200e3, 100.0, 900.0
    since = (np.arange(200000) / rate) % (1.0 / ball_pass)
    for height in (0.3, 1.0):
        ringing = height * np.exp(-decay * since) * np.sin(2.0 * np.pi * 3300.0 * since)
        assert diagnosis(ringing).kurtosis == pytest.approx(1.5 * decay / ball_pass, rel=0.01)


def test_lines_are_found_where_they_were_put() -> None:
    """Bursts of a resonance at 3.5972 times a shaft of 29.37 Hz, stronger once a turn, and noise."""
    rate, shaft, order = 12000.0, 29.37, 3.5972
    time = np.arange(120000) / rate
    since = (time * shaft * order) % 1.0 / (shaft * order)
    burst = np.exp(-600.0 * since) * np.sin(2.0 * np.pi * 3300.0 * since)
    signal = burst * (1.0 + 0.3 * np.cos(2.0 * np.pi * shaft * time))
    signal = signal + 0.1 * np.random.default_rng(1).standard_normal(time.size)
    found = lines.lines_of(signal, rate, 29.4, 3.585, file="", spall="outer", load=0.0)
    assert found.order == pytest.approx(order, rel=1e-4)
    assert found.shaft * 29.4 == pytest.approx(shaft, rel=2e-4)
    assert found.second > 50.0
    assert found.below == pytest.approx(found.above, rel=0.3)


def test_the_table_on_top_has_numbers_of_its_pages() -> None:
    blocks = "\n".join("\n".join(shown(name)) for name in SCRIPTS)
    _, *rows = re.findall(r"^\| (.*) \|$", text("index").replace("| --- | --- | --- | --- |\n", ""), re.MULTILINE)
    assert len(rows) >= 12
    for row in rows:
        for number in re.findall(r"-?\d+\.\d{2,}", row.split(" | ")[-1]):
            assert number in blocks, f"{number} of the row {row}"
