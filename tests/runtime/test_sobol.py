"""Shares of inputs in a variance: a closed form through the same code, failed members, yield against a sweep."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import norm, sobol_indices, uniform
from scipy.stats.qmc import Sobol

from ballpass.runtime import Model, RequestError
from ballpass.runtime.questions.sobol import _interval
from ballpass.runtime.shares import drawn_members
from ballpass.runtime.shares.variance_shares import VarianceShare, variance_shares, wilson

CLEARANCE = "bearing.clearance"


def _ishigami(x: np.ndarray) -> np.ndarray:
    return np.asarray(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


#: Ishigami and Homma 1990: first-order and total shares with constants 7 and 0.1.
FIRST, TOTAL = (0.3139, 0.4424, 0.0), (0.5576, 0.4424, 0.2437)


def _members(samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points = np.pi * (2.0 * Sobol(6, seed=np.random.default_rng(3)).random(samples).T - 1.0)
    a, b = points[:3], points[3:]
    mixed = []
    for k in range(3):
        both = a.copy()
        both[k] = b[k]
        mixed.append(_ishigami(both))
    return _ishigami(a), _ishigami(b), np.array(mixed)


def _check(found: tuple[VarianceShare, ...], tolerance: float) -> None:
    for one, first, total in zip(found, FIRST, TOTAL, strict=True):
        assert one.first == pytest.approx(first, abs=tolerance)
        assert one.total == pytest.approx(total, abs=tolerance)
        assert one.first_low < first < one.first_high
        assert one.total_low < total < one.total_high


def test_shares_of_the_ishigami_function() -> None:
    _check(variance_shares(*_members(2**14), seed=1), 0.01)


@pytest.mark.long
def test_one_member_in_twenty_without_a_result_spoils_nothing() -> None:
    a, b, mixed = _members(2**14)
    random = np.random.default_rng(1)
    for part in (a, b, mixed):
        part[random.random(part.shape) < 0.05] = np.nan
    found = variance_shares(a, b, mixed, seed=1)
    _check(found, 0.03)
    assert found[0].rows == pytest.approx(0.95**3 * 2**14, rel=0.01)


def test_the_estimates_are_those_of_scipy() -> None:
    a, b, mixed = _members(2**10)
    given = {"f_A": a[None], "f_B": b[None], "f_AB": mixed[:, None]}
    theirs = sobol_indices(func=given, n=2**10, dists=[uniform()] * 3)
    ours = variance_shares(a, b, mixed, seed=1)
    assert [one.first for one in ours] == pytest.approx(theirs.first_order.ravel().tolist(), rel=1e-9)
    assert [one.total for one in ours] == pytest.approx(theirs.total_order.ravel().tolist(), rel=1e-9)


def test_shares_of_few_members_are_printed_as_far_as_their_intervals_bear_them() -> None:
    """Values of a few members that are ten times the others: first-order shares are estimated above total ones."""
    random = np.random.default_rng(5)
    parts = [random.standard_t(1.5, size=(16, 3)) for _ in range(2)]
    mixed = [np.where(np.arange(3) == k, parts[1], parts[0]).prod(axis=1) for k in range(3)]
    found = variance_shares(parts[0].prod(axis=1), parts[1].prod(axis=1), np.array(mixed), seed=1)
    assert any(not 0.0 <= one.first <= min(one.total, 1.0) for one in found)
    for one in (share.borne for share in found):
        assert 0.0 <= one.first_low <= one.first <= one.first_high <= one.total_high <= 1.0
        assert one.first_low <= one.total_low <= one.total <= one.total_high
    assert _interval(1.83, -0.4, 2.5).startswith("not known")
    assert _interval(0.502, 0.40, 0.61) == "0.5  (0.40 to 0.61)"
    assert _interval(0.5024, 0.501, 0.504) == "0.502  (0.5010 to 0.5040)"


def test_wilson_covers_the_share_in_95_percent_of_samples() -> None:
    hits = np.random.default_rng(1).binomial(80, 0.03, 4000)
    inside = [low <= 0.03 <= high for low, high in (wilson(int(one), 80) for one in hits)]
    assert 0.93 < np.mean(inside) < 0.985
    assert wilson(0, 10)[0] == 0.0
    assert wilson(0, 10)[1] == pytest.approx(0.2775, abs=1e-4)  # a printed table


@pytest.mark.long
def test_shares_of_the_few_members_that_have_results_are_a_fault(rotor: Model) -> None:
    """Above some 100 kN a ball is flattened as in no bearing."""
    load, of = "load.force.x=1 kN:100 MN", "rms:inner.y"
    shares = rotor.sobol(load, of, cycles=2, transient=1, samples=64, progress=False)
    effects = rotor.morris(load, of, cycles=2, transient=1, base=16, progress=False)
    screened = rotor.morris("load.force.x=1 kN:1 MN:log", of, cycles=2, transient=1, base=16, progress=False)
    for found, ends in ((shares, True), (effects, True), (screened, False)):
        assert found.failed > 0.05 * found.members
        assert bool(found.report().fault) == ends
    assert rotor.sobol(load, of, cycles=2, transient=1, samples=64, indices=False, progress=False).failed in (63, 64)


@pytest.mark.filterwarnings("error")
def test_infinite_lives_keep_a_limit_and_are_said(rotor: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bearing that carries nothing lives for ever; one in four does here."""

    def lives(_model: object, _inputs: object, members: np.ndarray, *_: object, **__: object) -> object:
        return np.where(np.arange(len(members)) % 4 == 0, math.inf, 1.0 + members[:, 0]).reshape(-1, 1), ()

    monkeypatch.setattr(drawn_members, "run_members", lives)
    found = rotor.sobol("load.force.x=0 N:1 N", "life", limit="life >= 1.5 turns", samples=64, progress=False)
    assert found.limits[0].kept == np.count_nonzero(np.isinf(found.values[:, 0]) | (found.base[:, 0] >= 0.5))
    assert found.limits[0].members == 128
    effects = rotor.morris("load.force.x=0 N:1 N", "life", base=16, progress=False)
    assert effects.quantities[0].effects[0].rows == 12
    for answer, count in ((found, "48 of 192"), (effects, "8 of 32")):
        (said,) = answer.report().warnings
        assert said == f"life is infinite in {count} members, which its means and shares leave out."


@pytest.mark.long
def test_failed_members_of_a_scene_leave_the_shares_as_they_are(make_model: Callable[..., Model]) -> None:
    """The crank's inertia acts nowhere; one in twenty is drawn below zero, which is refused."""
    press = make_model("punching_press_tangent")
    vary = [f"{CLEARANCE}=5 um:20 um", "bearing.outer_ring.stiffness=30 MN/m:80 MN/m"]
    inertia = "mechanism.bodies.crank.inertia=norm:loc=1.645 kg*m^2:scale=1 kg*m^2"
    plain = press.sobol(vary, "peak_ball_force", cycles=2, transient=1, samples=128, progress=False)
    spoiled = press.sobol([*vary, inertia], "peak_ball_force", cycles=2, transient=1, samples=128, progress=False)
    assert spoiled.failed == pytest.approx(0.05 * spoiled.members, rel=0.4)
    assert "have no result" in spoiled.report().warnings[0]
    for one, other in zip(plain.quantities[0].shares, spoiled.quantities[0].shares, strict=False):
        assert other.total_low < one.total < other.total_high
        assert other.first_low < one.first < other.first_high
    assert spoiled.quantities[0].shares[2].total == pytest.approx(0.0, abs=1e-9)


@pytest.mark.long
def test_the_yield_is_the_share_of_a_fine_sweep_that_keeps_the_limit(make_model: Callable[..., Model]) -> None:
    press = make_model("punching_press_tangent")
    found = press.sobol(
        f"{CLEARANCE}=norm:loc=12 um:scale=3 um",
        limit="peak_ball_force <= 5.7 kN",
        cycles=2,
        transient=1,
        samples=256,
        indices=False,
        progress=False,
    )
    table = {CLEARANCE: norm(12e-6, 3e-6).ppf((np.arange(2000) + 0.5) / 2000)}
    swept = press.simulate_many(table, "peak_ball_force", cycles=2, transient=1)["peak_ball_force"]
    (one,) = found.limits
    assert one.low < np.mean(swept <= 5700.0) < one.high
    assert 0.02 < one.share < 0.98
    assert one.high - one.low < 0.13


@pytest.mark.long
def test_peak_force_of_the_press_over_ten_parameters_takes_less_than_two_minutes(
    make_model: Callable[..., Model],
) -> None:
    """N = 1024, so that there are 12288 members, on two processors."""
    press = make_model("punching_press")
    names = [
        "mechanism.bodies.slider.mass",
        "mechanism.bodies.rod.mass",
        "bearing.outer_ring.stiffness",
        "bearing.outer_ring.damping",
        "bearing.outer_ring.mass",
        "bearing.pitch_diameter",
        "bearing.contact.young_modulus",
        "bearing.damping.ratio",
        "bearing.share",
    ]
    vary = [f"{CLEARANCE}=5 um:15 um"]
    for name in names:
        info = next(one for one in press.manifest.parameters if one.name == name)
        width = 1e-3 if name == "bearing.pitch_diameter" else 0.05
        low, high = (
            f"{value:.9g} {info.unit}" if info.unit != "1" else f"{value:.9g}"
            for value in (info.default * (1 - width), info.default * (1 + width))
        )
        vary.append(f"{name}={low}:{high}")
    begin = time.process_time()
    found = press.sobol(vary, "peak_ball_force", samples=1024, progress=False)
    assert time.process_time() - begin < 2 * 120.0
    assert found.members == 12288
    assert found.failed == 0
    shares = found.quantities[0].shares
    assert sum(one.first for one in shares) == pytest.approx(1.0, abs=0.2)
    assert all(one.total_high - one.total_low < 0.2 for one in shares)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"of": "rms:inner.y", "samples": 100}, "no power of two"),
        ({}, "no quantity was named"),
        ({"of": "rms:inner.y", "vary": f"{CLEARANCE}=normal:loc=1 um"}, "no continuous distribution|normal"),
        ({"of": "rms:inner.y", "vary": f"{CLEARANCE}=norm:loc=1 N"}, CLEARANCE),
        ({"of": "rms:inner.y", "vary": f"{CLEARANCE}=norm:scale=-1 um"}, "domain"),
        ({"of": "rms:inner.y", "vary": [f"{CLEARANCE}=1 um:2 um"] * 2}, "each once"),
        ({"limit": "rms:inner.y"}, "^limit: 'rms:inner.y' is no limit"),
        ({"limit": "rms:inner.y <= 5 N"}, "^limit rms:inner.y: "),
    ],
)
def test_wrong_requests_are_refused(make_model: Callable[..., Model], options: dict[str, object], words: str) -> None:
    with pytest.raises(RequestError, match=words):
        make_model("punching_press_tangent").sobol(**{"vary": f"{CLEARANCE}=1 um:2 um", **options})
