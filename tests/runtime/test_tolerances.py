"""Fits by class: against printed tables, the formulas of ISO 286, and draws of the parts."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from click.testing import Result
from scipy.integrate import quad
from scipy.stats import norm

from ballpass.runtime import Model
from ballpass.runtime.point.model_limits import limits_of_fit
from ballpass.runtime.ratings import of_bearing, tolerances
from ballpass.runtime.ratings.of_bearing import fit_clearances
from ballpass.runtime.ratings.tolerances import Spread

#: Housing tolerances and resultant fits, tables 8 of SKF's Rolling bearings: for outside diameters up to the first
#: number [mm], of each class the deviations of the bore, the theoretical and the probable clearance [µm].
SKF_HOUSINGS = {
    "H7": {
        18: ((0, 18), (0, 26), (3, 23)), 50: ((0, 25), (0, 36), (4, 32)), 120: ((0, 35), (0, 50), (5, 45)),
    },
    "J7": {
        10: ((-7, 8), (-7, 16), (-4, 13)), 18: ((-8, 10), (-8, 18), (-5, 15)), 30: ((-9, 12), (-9, 21), (-6, 18)),
        50: ((-11, 14), (-11, 25), (-7, 21)), 80: ((-12, 18), (-12, 31), (-7, 26)),
        120: ((-13, 22), (-13, 37), (-8, 32)), 150: ((-14, 26), (-14, 44), (-7, 37)),
        180: ((-14, 26), (-14, 51), (-6, 43)),
    },
    "JS7": {50: ((-12.5, 12.5), (-12.5, 23.5), (-9, 20)), 120: ((-17.5, 17.5), (-17.5, 32.5), (-12, 27))},
    "K6": {10: ((-7, 2), (-7, 10), (-5, 8)), 50: ((-13, 3), (-13, 14), (-10, 11))},
    "K7": {30: ((-15, 6), (-15, 15), (-12, 12)), 50: ((-18, 7), (-18, 18), (-14, 14)),
           180: ((-28, 12), (-28, 37), (-20, 29))},
    "M6": {30: ((-17, -4), (-17, 5), (-14, 2)), 120: ((-28, -6), (-28, 9), (-23, 4))},
    "M7": {50: ((-25, 0), (-25, 11), (-21, 7)), 120: ((-35, 0), (-35, 15), (-30, 10))},
    "N6": {50: ((-28, -12), (-28, -1), (-25, -4)), 150: ((-45, -20), (-45, -2), (-39, -8))},
    "N7": {18: ((-23, -5), (-23, 3), (-20, 0)), 50: ((-33, -8), (-33, 3), (-29, -1))},
    "P6": {50: ((-37, -21), (-37, -10), (-34, -13)), 80: ((-45, -26), (-45, -13), (-41, -17))},
    "P7": {30: ((-35, -14), (-35, -5), (-32, -8)), 120: ((-59, -24), (-59, -9), (-54, -14))},
}  # fmt: skip

#: Fits of bearings of class 0 on shafts (GB/T 275, as GBB prints it): largest play and largest interference [µm].
GBB_SHAFTS = {
    6: {"g6": (12, 4), "g5": (9, 4), "h6": (8, 8), "h5": (5, 8), "j5": (2, 11), "j6": (2, 14), "js6": (4, 12)},
    18: {"g6": (17, 2), "g5": (14, 2), "h6": (11, 8), "h5": (8, 8), "j5": (3, 13), "j6": (3, 16), "js6": (5.5, 13.5)},
    30: {"g6": (20, 3), "g5": (16, 3), "h6": (13, 10), "h5": (9, 10), "j5": (4, 15), "j6": (4, 19), "js6": (6.5, 16.5)},
    50: {"g6": (25, 3), "g5": (20, 3), "h6": (16, 12), "h5": (11, 12), "j5": (5, 18), "j6": (5, 23), "js6": (8, 20)},
    80: {"g6": (29, 5), "g5": (23, 5), "h6": (19, 15), "h5": (13, 15), "j5": (7, 21), "j6": (7, 27)},
    120: {"g6": (34, 8), "g5": (27, 8), "h6": (22, 20), "h5": (15, 20), "j5": (9, 26), "j6": (9, 33), "js6": (11, 31)},
}

#: Steps of ISO 286: above, up to and including [mm].
STEPS = ((3, 6), (6, 10), (10, 18), (18, 30), (30, 50), (50, 80), (80, 120), (120, 180))
#: Fits by class of the press: a loose shaft, a tight housing.
FITS = '[bearing]\nfit = { shaft = "g6", housing = "P7", roughness = "4 um" }\n'


def in_um(ends: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(round(1e6 * end, 6) for end in ends)


def outwards(low: float, high: float) -> tuple[float, float]:
    """SKF rounds the probable range to whole micrometres, outwards."""
    return math.floor(low + 1e-6), math.ceil(high - 1e-6)


@pytest.mark.parametrize("name", SKF_HOUSINGS)
def test_housings_are_those_of_a_makers_table(name: str) -> None:
    """Deviations, theoretical and probable fit; the probable one is three deviations of parts that have six."""
    for diameter, (deviations, theoretical, probable) in SKF_HOUSINGS[name].items():
        for size in (diameter, diameter - 1.0):
            seat = tolerances.housing_deviations(name, size / 1e3)
            assert in_um(seat) == deviations
            found = tolerances.interference(tolerances.ring_deviations(size / 1e3, "outside"), seat)
            assert in_um((-found.largest, -found.least)) == theoretical
            _, low, _, high, _ = in_um(found.five)
            assert outwards(-high, -low) == probable


@pytest.mark.parametrize("diameter", GBB_SHAFTS)
def test_fits_on_shafts_are_those_of_another_table(diameter: int) -> None:
    for name, printed in GBB_SHAFTS[diameter].items():
        found = tolerances.seat_interference(name, diameter / 1e3)
        assert in_um((-found.least, found.largest)) == printed


def test_shafts_are_within_rounding_of_the_formulas_of_iso_286() -> None:
    """i = 0.45 D^(1/3) + 0.001 D; IT5 to IT8 7, 10, 16, 25 i; g -2.5 D^0.34, k 0.6 D^(1/3), m IT7 - IT6, n 5 D^0.34."""
    for above, to in STEPS:
        mean, at = math.sqrt(above * to), to / 1e3
        unit = 0.45 * mean ** (1 / 3) + 0.001 * mean
        grade = {
            number: 1e6 * float(np.diff(tolerances.housing_deviations(f"H{number}", at))[0]) for number in (6, 7, 8)
        }
        grade[5] = 1e6 * float(np.diff(tolerances.shaft_deviations("h5", at))[0])
        assert grade == pytest.approx({5: 7 * unit, 6: 10 * unit, 7: 16 * unit, 8: 25 * unit}, abs=1.0)
        lower = {letter: 1e6 * tolerances.shaft_deviations(f"{letter}6", at)[0] for letter in "kmn"}
        assert lower == pytest.approx(
            {"k": 0.6 * mean ** (1 / 3), "m": grade[7] - grade[6], "n": 5 * mean**0.34}, abs=1.0
        )
        assert 1e6 * tolerances.shaft_deviations("g6", at)[1] == pytest.approx(-2.5 * mean**0.34, abs=0.6)


def test_classes_of_shafts_and_housings_at_a_6204() -> None:
    shafts = {"k6": (2, 15), "m6": (8, 21), "g6": (-20, -7), "j6": (-4, 9), "p6": (22, 35), "js5": (-4.5, 4.5)}
    assert {name: in_um(tolerances.shaft_deviations(name, 20e-3)) for name in shafts} == shafts
    housings = {"K7": (-18, 7), "M7": (-25, 0), "N7": (-33, -8), "K8": (-27, 12), "P8": (-65, -26), "G7": (9, 34)}
    assert {name: in_um(tolerances.housing_deviations(name, 47e-3)) for name in housings} == housings


@pytest.mark.parametrize(("name", "diameter"), [("k6", 3e-3), ("k6", 181e-3), ("j6", 130e-3), ("j6", math.nan)])
def test_what_no_table_has_is_refused(name: str, diameter: float) -> None:
    with pytest.raises(ValueError, match="no such class for a diameter"):
        tolerances.shaft_deviations(name, diameter)


def test_roughness_takes_a_part_of_the_interference() -> None:
    found = tolerances.interference((2e-6, 15e-6), (-10e-6, 0.0), roughness=5e-6)  # 0.4 of 5 µm
    assert in_um((found.least, found.mean, found.largest)) == (0.0, 11.5, 23.0)
    assert found.deviation == pytest.approx(math.hypot(13e-6, 10e-6) / 6)


@pytest.mark.parametrize("mean", [-3.0, -0.7, 0.0, 0.4, 2.0])
def test_play_presses_nothing(mean: float) -> None:
    """Moments of a normal distribution cut at zero, by quadrature."""
    found = Spread(least=-9.0, largest=9.0, mean=mean, deviation=1.3).pressed
    first, second = (quad(lambda x, k=k: x**k * norm.pdf(x, mean, 1.3), 0.0, 20.0)[0] for k in (1, 2))
    assert (found.mean, found.deviation) == pytest.approx((first, math.sqrt(second - first**2)), rel=1e-7)
    assert (found.least, found.largest) == (0.0, 9.0)


@pytest.mark.parametrize(("shaft", "housing"), [("k6", "H7"), ("j6", "J7"), ("g6", "P7")])
def test_clearance_in_operation_is_that_of_drawn_parts(shaft: str, housing: str) -> None:
    """Least and largest over all corners of the parts; mean and deviation over 400 000 draws of them."""
    parts = (
        (13e-6, 28e-6), tolerances.shaft_deviations(shaft, 20e-3), (-10e-6, 0.0), (-11e-6, 0.0),
        tolerances.housing_deviations(housing, 47e-3),
    )  # fmt: skip
    rates, lost = (0.782, 0.881), 1.5e-6

    def clearance(group: object, shaft: object, bore: object, outside: object, hole: object) -> np.ndarray:
        inner, outer = (np.maximum(np.subtract(a, b), 0.0) for a, b in ((shaft, bore), (outside, hole)))
        return np.asarray(group - rates[0] * inner - rates[1] * outer - lost)  # type: ignore[operator]

    pressed = [
        (tolerances.interference(parts[1], parts[2]), rates[0]),
        (tolerances.interference(parts[3], parts[4]), rates[1]),
    ]
    found = tolerances.operating_clearance(parts[0], pressed, lost)
    corners = [float(clearance(*corner)) for corner in itertools.product(*parts)]
    assert (found.least, found.largest) == pytest.approx((min(corners), max(corners)), rel=1e-9)
    rng = np.random.default_rng(7)
    drawn = clearance(*(rng.normal(sum(ends) / 2, (ends[1] - ends[0]) / 6, 400_000) for ends in parts))
    assert found.mean == pytest.approx(np.mean(drawn), abs=2e-8)
    assert found.deviation == pytest.approx(np.std(drawn), rel=0.01)


@pytest.fixture(scope="module")
def fitted(make_model: Callable[..., Model]) -> Model:
    return make_model("punching_press_tangent", ("[bearing]\n", FITS))


def test_life_and_peak_over_the_clearance_are_those_of_runs_at_each(fitted: Model) -> None:
    report = fitted.life(cycles=3, transient=1)
    (fit,) = report.fits
    assert list(fit.clearance) == sorted(fit.clearance)
    assert fit.clearance[2] == fitted.parameters["bearing.clearance"]
    single = fitted.life(cycles=3, transient=1, parameters={"bearing.clearance": fit.clearance[4]}).bearings[0]
    assert (fit.lives[4], fit.peak_forces[4]) == pytest.approx((single.life, single.peak_force), rel=1e-3)
    text = str(report)
    row = next(line.split() for line in text.partition("Over the clearance")[2].splitlines() if line[:7] == " least ")
    least, shaft, housing = (1e6 * x for x in (fit.clearance[0], fit.fit.inner[4], fit.fit.outer[4]))
    assert row[1:4] == [f"{least:.1f}", f"{shaft:.1f}", f"{housing:.1f}"]  # the largest interferences
    assert max(map(len, text.splitlines())) <= 80


def test_a_clearance_that_cannot_be_run_is_told_and_the_others_stand(
    fitted: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As with a preload that flattens balls beyond what a bearing can have."""
    monkeypatch.setattr(of_bearing, "fit_clearances", lambda *_: (-5e-3, 0.0, 5e-6, 10e-6, 20e-6))
    report = fitted.life(cycles=3, transient=1)
    (fit,) = report.fits
    assert np.isnan(fit.lives).tolist() == np.isnan(fit.peak_forces).tolist() == [True, *4 * [False]]
    (said,) = fit.failed
    assert said.startswith("-5000.0 µm of clearance: ")
    assert said in report.report().warnings


def test_the_spread_moves_with_a_clearance_that_is_set(fitted: Model) -> None:
    (info,) = fitted.manifest.bearings
    assert info.fit is not None
    moved = fit_clearances(info, fitted.numbers({"bearing.clearance": 30e-6}).values)
    assert moved == pytest.approx([30e-6 + each - info.fit.clearance[2] for each in info.fit.clearance], rel=1e-12)


def test_a_loose_ring_that_turns_and_a_lost_clearance_are_told(fitted: Model) -> None:
    """The ring that turns is the inner one, but for a bearing without a joint whose inner ring stands."""
    (info,) = fitted.manifest.bearings
    values = fitted.numbers({}).values
    creep, preload = limits_of_fit(info, values)
    assert "inner ring turns against the load and may creep on its seat: with g6" in creep
    assert "-21.6 µm" in creep  # 20 µm of play, and 0.4 of 4 µm
    assert "preload" in preload
    turned = replace(info, inner_stands=True, joint="")
    assert not any("creep" in said for said in limits_of_fit(turned, values))  # P7 holds
    assert info.fit is not None
    loose = replace(turned, fit=replace(info.fit, housing="H7", outer=(-36e-6, -32e-6, -18e-6, -4e-6, 0.0)))
    assert "outer ring turns against the load and may creep on its seat: with H7" in next(limits_of_fit(loose, values))
    swinging = replace(loose, joint=info.joint)
    assert not any("creep" in said for said in limits_of_fit(swinging, values))
    wide = {**values, "bearing.clearance": 60e-6}
    assert not any("preload" in said for said in limits_of_fit(info, wide))
    said = fitted.explain()
    assert [words.split(": ")[1] for words in said.fits] == [
        "interference on the shaft, g6", "interference in the housing, P7", "clearance in operation"
    ]  # fmt: skip
    assert any("may creep" in words for words in said.limits)


def test_bearings_show_interferences_by_class(ballpass: Callable[..., Result]) -> None:
    (row,) = json.loads(ballpass("bearings", "6204", "--shaft", "k6", "--housing", "H7", "--json").stdout)["bearings"]
    assert {name: in_um(ends) for name, ends in row["interference"].items()} == {"k6": (2, 25), "H7": (-36, 0)}
    # the tables of fits begin above 3 mm
    small, large = json.loads(ballpass("bearings", "61[89]/[34]", "--shaft", "k6", "--json").stdout)["bearings"][:2]
    assert (small["interference"], list(large["interference"])) == ({}, ["k6"])
    assert "2 to 25" in ballpass("bearings", "6204", "--shaft", "k6").stdout
    refused = ballpass("bearings", "6204", "--housing", "k6")
    assert refused.exit_code == 2
    assert "Allowed: G6" in refused.output
