"""Damping laws: their formulas, how often they may be differentiated, where they switch, their smoothed forms.

Everything is asked of every law of the registry; a new one needs its formula in `FORMULAS` and a row in the docs.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import sympy as sp
from parts import DAMPING, ROOT, press, shipped
from quick_cases import long_but

from ballpass.derive import SceneError, derive, generate
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.bearing.laws.contact import SMOOTHED_HERTZ_ERROR, Contact, SmoothedRest
from ballpass.derive.bearing.switching import Switching, find_switching
from ballpass.derive.lowering.functions import lower
from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.system import System
from ballpass.runtime import Model
from ballpass.runtime.certify.differences import richardson
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folder import read_manifest

DELTA, RATE, STIFFNESS, COEFFICIENT, WIDTH, RATE_WIDTH = sp.symbols("delta rate k c w w_v", real=True)

#: Force of one ball from deflection, rate, contact stiffness and the law's coefficient.
FORMULAS: dict[str, Callable[[float, float, float, float], float]] = {
    "none": lambda d, v, k, c: 0.0,
    "one-sided": lambda d, v, k, c: c * max(v, 0.0),
    "one-sided-gated": lambda d, v, k, c: c * max(v, 0.0) if d > 0 else 0.0,
    "two-sided-gated": lambda d, v, k, c: c * v if d > 0 else 0.0,
    "tangent": lambda d, v, k, c: c * 1.5 * k * math.sqrt(max(d, 0.0)) * v,
    "hunt-crossley": lambda d, v, k, c: c * k * max(d, 0.0) ** 1.5 * v,
}
#: Numbers of a 6204: k_b, a coefficient of any law, half widths of deflection and rate.
NUMBERS = {STIFFNESS: 8.6e9, COEFFICIENT: 700.0, WIDTH: 0.05e-6, RATE_WIDTH: 1e-3}
SMOOTH = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')

every_law = pytest.mark.parametrize("law", LAWS)


@cache
def system_of(law: str) -> System:
    """Of the press with this law, derived once."""
    return derive(scene_from_text(press(law, DAMPING[law]), "press"))


def test_every_law_has_a_formula() -> None:
    assert set(FORMULAS) == set(LAWS), "FORMULAS needs the force of each law, written by hand"


def parts_of(law: str, *, contact: bool = False, rate: bool = False) -> tuple[sp.Expr, sp.Expr]:
    """Elastic and damping force of one ball, smoothed over the deflection, over the rate."""
    touch = Contact(stiffness=STIFFNESS, exponent=sp.Rational(3, 2), width=WIDTH if contact else None)
    rest = SmoothedRest(width=RATE_WIDTH if rate else None)
    return touch.force(DELTA), LAWS[law].force(DELTA, RATE, COEFFICIENT, touch, rest)


def table(force: sp.Expr, points: np.ndarray, **numbers: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values, gradients (2) and Hessians (4) at points of shape (n, 2), lowered to CasADi."""
    z = ca.SX.sym("z", 2)
    known = {symbol: ca.SX(numbers.get(symbol.name, value)) for symbol, value in NUMBERS.items()}
    value = Visitor({DELTA: z[0], RATE: z[1], **known}, {})(force)
    hessian, gradient = ca.hessian(value, z)
    function = ca.Function("f", [z], [value, gradient, ca.densify(hessian).reshape((4, 1))])
    values, slopes, curvatures = function.map(len(points))(points.T)
    return values.full()[0], slopes.full().T, curvatures.full().T


def along(axis: int, reach: float, count: int, fixed: float) -> np.ndarray:
    """Points across zero, none of them there."""
    points = np.full((count, 2), fixed)
    points[:, axis] = np.linspace(-reach, reach, count) + 1e-3 * reach
    return points


# formulas


@every_law
def test_the_force_is_that_of_its_formula(law: str) -> None:
    """Of the scene's own function, on both sides of the first contact and of rest."""
    system = system_of(law)
    functions, p = lower(system, derivatives=False), [q.default for q in system.parameters]
    c = functions["constants"](p)
    constants = dict(zip((k.name for k in functions.constants), np.asarray(c).ravel(), strict=True))
    k_b, coefficient = constants["bearing.k_b"], constants.get("bearing.c_b", 0.0)
    assert (coefficient > 0.0) == (law != "none")
    for delta in (-3e-6, -1e-12, 1e-12, 5e-6):
        for rate in (-0.02, 0.0, 0.013):
            elastic, damping = (float(v) for v in functions["contact"](delta, rate, p, c))
            assert elastic == pytest.approx(k_b * max(delta, 0.0) ** 1.5, rel=1e-14, abs=0.0)
            assert damping == pytest.approx(FORMULAS[law](delta, rate, k_b, coefficient), rel=1e-14, abs=0.0)


def test_the_papers_ratio_in_millimetres_and_in_si() -> None:
    for ratio, value in (("0.25e-5 s*mm^0.5", 683.4), ("0.25e-5 s*m^0.5", 2.1612e4)):
        system = derive(scene_from_text(press("one-sided", f'ratio = "{ratio}"'), "press"))
        functions = lower(system, derivatives=False)
        found = functions["constants"]([q.default for q in system.parameters]).full().ravel()
        c = dict(zip((k.name for k in functions.constants), found, strict=True))
        assert c["bearing.c_b"] == pytest.approx(value, rel=1e-4)


def test_ungated_one_sided_balls_are_an_isotropic_dashpot_of_twice_c_b() -> None:
    """Opposite balls complete each other: with 8 balls that touch nothing, F_c = 2 c_b v, whatever the cage's angle."""
    system = derive(scene_from_text(press("one-sided", DAMPING["one-sided"]), "press"))
    functions = lower(system, derivatives=False)
    changed = {"bearing.clearance": 1e-2, "mechanism.driver.speed": 0.0}
    p = np.array([changed.get(q.name, q.default) for q in system.parameters])
    c = functions["constants"](p)
    mass = float(c[[k.name for k in functions.constants].index("bearing.m_ei")])
    moving = np.array([0, 0, 0, 0, 0.3, -0.2, 0.1, 0.4])
    for phase in (0.0, 0.123, 2.0):
        u = np.array([phase if i.name == "phase.cage" else 0.0 for i in system.inputs])
        change = (functions["rhs"](0, moving, u, p, c) - functions["rhs"](0, np.zeros(8), u, p, c)).full().ravel()
        assert change[4:6] * mass == pytest.approx(-2 * 683.0 * np.array([0.2, -0.6]), rel=1e-12)


# smoothness


@pytest.mark.parametrize("law", long_but(LAWS, "none", "one-sided", "hunt-crossley"))
def test_the_docs_and_the_manifest_say_how_smooth_it_is(law: str) -> None:
    """As its row in the page on damping has it; it jumps where its formula does; smoothed it is twice smooth."""
    page = (ROOT / "docs/theory/damping.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| `{law}` \|.* \| (\w+|–) \|$", page, re.MULTILINE)
    declared = {name: s.value for name, s in system_of(law).smoothness}
    assert declared.get("damping", "–") == row
    assert declared["elastic"] == "smooth"
    jump = abs(FORMULAS[law](1e-30, 1.0, 1e9, 1.0) - FORMULAS[law](-1e-30, 1.0, 1e9, 1.0))
    assert (row == "discontinuous") == (jump > 0.1)
    smoothed = 'smoothing = "1 mm/s"' if LAWS[law].kinked_at_rest else ""
    system = derive(scene_from_text(press(law, f"{DAMPING[law]}\n{smoothed}", SMOOTH), "press"))
    assert {s.value for _, s in system.smoothness} == {"twice smooth"}


def test_a_kink_at_rest_stays_where_only_the_contact_is_smoothed() -> None:
    system = derive(scene_from_text(press("one-sided-gated", DAMPING["one-sided-gated"], SMOOTH), "press"))
    assert {name: s.value for name, s in system.smoothness} == {"elastic": "twice smooth", "damping": "kinked"}


@every_law
def test_second_derivatives_of_the_smoothed_law_are_bounded_and_continuous(law: str) -> None:
    """Across onset and rest: a jump that stays is a jump of the law; a continuous entry's shrinks with the grid."""
    for force in parts_of(law, contact=True, rate=True):
        for axis, reach, fixed in ((0, 1.5 * NUMBERS[WIDTH], 3e-4), (1, 1.5 * NUMBERS[RATE_WIDTH], 2e-8)):
            jumps = []
            for count in (501, 5001, 50_001):
                _, _, curvature = table(force, along(axis, reach, count, fixed))
                assert np.all(np.isfinite(curvature))
                jumps.append(np.max(np.abs(np.diff(curvature, axis=0)), axis=0))
            assert np.all(jumps[2] <= 0.15 * jumps[1] + 1e-12 * np.max(jumps[0]))


@every_law
def test_outside_the_widths_the_smoothed_law_is_the_law(law: str) -> None:
    """And inside, Hertz's force lies within its stated error above Hertz's, a gate opens, a kink is off by its part."""
    width, rest, k, c = NUMBERS[WIDTH], NUMBERS[RATE_WIDTH], NUMBERS[STIFFNESS], NUMBERS[COEFFICIENT]
    elastic, damping = parts_of(law, contact=True, rate=True)
    delta = np.linspace(-3 * width, 3 * width, 6001)
    hertz = k * np.maximum(delta, 0.0) ** 1.5
    error = table(elastic, np.column_stack([delta, np.zeros_like(delta)]))[0] - hertz
    outside = np.abs(delta) > width
    assert np.all(np.abs(error[outside]) <= 4 * np.finfo(float).eps * hertz[outside])  # rounding of two formulas
    assert np.min(error) >= -1e-12 * np.max(hertz)
    assert 0.99 * SMOOTHED_HERTZ_ERROR * k * width**1.5 <= np.max(error) <= SMOOTHED_HERTZ_ERROR * k * width**1.5
    there = [(d, v) for d in (-2 * width, 2 * width) for v in (-2 * rest, 2 * rest)]
    found = table(damping, np.array(there))[0]
    assert found == pytest.approx([FORMULAS[law](d, v, k, c) for d, v in there], rel=1e-12, abs=1e-300)
    if LAWS[law].kinked_at_rest:
        rate = np.linspace(-2 * rest, 2 * rest, 4001)
        error = table(damping, np.column_stack([np.full_like(rate, 1e-6), rate]))[0] - c * np.maximum(rate, 0.0)
        assert np.max(error) == pytest.approx(5.0 / 32.0 * c * rest, rel=1e-9)


def test_a_gate_opens_within_the_width() -> None:
    damping, width = parts_of("two-sided-gated", contact=True)[1], NUMBERS[WIDTH]
    found, _, _ = table(damping, np.array([(-width, 1.0), (0.0, 1.0), (width * (1 + 1e-9), -1.0)]))
    assert found == pytest.approx(NUMBERS[COEFFICIENT] * np.array([0.0, 0.5, -1.0]), rel=1e-12)


def test_hertz_is_the_limit_and_has_no_bounded_second_derivative() -> None:
    """The error falls as the width to the three halves, that of the slope as its root."""
    delta, k = np.array([1e-8, 1e-10, 1e-12]), NUMBERS[STIFFNESS]
    _, _, curvature = table(parts_of("none")[0], np.column_stack([delta, np.zeros(3)]))
    assert curvature[:, 0] == pytest.approx(0.75 * k / np.sqrt(delta), rel=1e-12)
    force, slope = [], []
    for width in (1.6e-7, 4e-8, 1e-8):
        delta = np.linspace(-width, width, 4001)
        value, gradient, _ = table(parts_of("none", contact=True)[0], np.column_stack([delta, 0.0 * delta]), w=width)
        force.append(np.max(np.abs(value - k * np.maximum(delta, 0.0) ** 1.5)))
        slope.append(np.max(np.abs(gradient[:, 0] - 1.5 * k * np.sqrt(np.maximum(delta, 0.0)))))
    assert np.log(np.array(force[:-1]) / force[1:]) / np.log(4.0) == pytest.approx([1.5, 1.5], abs=1e-3)
    assert np.log(np.array(slope[:-1]) / slope[1:]) / np.log(4.0) == pytest.approx([0.5, 0.5], abs=1e-3)


# switching


def switching(law: str, *, contact: bool = False, rate: bool = False, pairs: bool = False) -> Switching:
    return find_switching([*parts_of(law, contact=contact, rate=rate)], DELTA, RATE, pairs=pairs)


@every_law
def test_it_switches_where_its_formula_does(law: str) -> None:
    """At first contact, where Hertz's law ends; at rest, where it has a kink there; it jumps where its formula does."""
    found = switching(law).switches
    assert [s.function for s in found] == [DELTA, RATE][: 1 + LAWS[law].kinked_at_rest]
    assert [(s.ends_above, s.ends_below) for s in found] == [(True, False), (False, False)][: len(found)]
    jump = abs(FORMULAS[law](1e-30, 1.0, 1e9, 1.0) - FORMULAS[law](-1e-30, 1.0, 1e9, 1.0)) > 0.1
    assert [s.jumps for s in found] == [jump, False][: len(found)]
    assert switching(law, contact=True, rate=True).switches == ()


def test_what_is_left_unsmoothed_still_switches() -> None:
    (switch,) = switching("one-sided-gated", contact=True).switches
    assert (switch.function, switch.of_rate, switch.jumps) == (RATE, True, False)
    (switch,) = switching("one-sided", rate=True).switches
    assert (switch.function, switch.of_rate) == (DELTA, False)


def test_opposite_balls_take_out_a_kink_of_the_rate_alone() -> None:
    assert [s.function for s in switching("one-sided", pairs=True).switches] == [DELTA]
    assert [s.function for s in switching("one-sided-gated", pairs=True).switches] == [DELTA, RATE]


def test_a_held_law_continues_its_side_and_is_the_law_where_let_go() -> None:
    found = switching("one-sided-gated")
    touch, approach = (s.border for s in found.switches)
    numbers = {STIFFNESS: 2, COEFFICIENT: 3}
    hertz = 2 * sp.Rational(1, 4) ** sp.Rational(3, 2)
    there = found.force.subs(numbers | {touch: -sp.oo, approach: -sp.oo})
    assert there.subs({DELTA: -1, RATE: -5}) == -15
    assert there.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == hertz + 15
    away = found.force.subs(numbers | {touch: sp.oo, approach: sp.oo})
    assert away.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == 0
    receding = found.force.subs(numbers | {touch: -sp.oo, approach: sp.oo})
    assert receding.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == hertz
    free = found.force.subs(numbers | {touch: 0, approach: 0})
    assert free.subs({DELTA: -1, RATE: 5}) == 0
    assert free.subs({DELTA: sp.Rational(1, 4), RATE: 5}) == hertz + 15


def test_a_law_that_ends_from_above_is_held_there_alone() -> None:
    mirrored = sp.Piecewise((0, DELTA > 0), (STIFFNESS * (-DELTA) ** sp.Rational(3, 2), True))
    found = find_switching([mirrored], DELTA, RATE, pairs=False)
    (switch,) = found.switches
    assert (switch.ends_above, switch.ends_below) == (False, True)
    values = {STIFFNESS: 2, DELTA: -sp.Rational(1, 4)}
    assert found.force.subs({switch.border: -sp.oo}).subs(values) == 0
    assert found.force.subs({switch.border: sp.oo}).subs(values) == sp.Rational(1, 4)
    assert found.force.subs({switch.border: sp.oo}).subs({STIFFNESS: 2, DELTA: sp.Rational(1, 4)}) == 0


@pytest.mark.parametrize("touching", [False, True])
def test_a_law_that_acts_while_the_ball_recedes_switches_as_its_mirror_image(touching: bool) -> None:
    """`rest.positive(-rate)` was refused: its condition holds below its place.  Held, it is the opposite of z_+ - z."""
    rest, gate = SmoothedRest(), Contact(stiffness=STIFFNESS, exponent=sp.Rational(3, 2)).gate(DELTA)
    scale = COEFFICIENT * (gate if touching else 1)
    found, other = (
        find_switching([scale * law], DELTA, RATE, pairs=False)
        for law in (rest.positive(-RATE), rest.positive(RATE) - RATE)
    )
    assert found.switches == other.switches
    assert [s.function for s in found.switches] == [DELTA, RATE][1 - touching :]
    for border in (-sp.oo, 0, sp.oo):
        held = {COEFFICIENT: 3, **{s.border: border for s in found.switches}}
        for delta, rate in itertools.product((-1, 1), (-5, 5)):
            there = held | {DELTA: delta, RATE: rate}
            assert found.force.subs(there) == other.force.subs(there)


def test_a_law_that_ends_where_its_condition_does_keeps_it() -> None:
    mirrored = sp.Piecewise((STIFFNESS * (-DELTA) ** sp.Rational(3, 2), DELTA < 0), (0, True))
    found = find_switching([mirrored], DELTA, RATE, pairs=False)
    (switch,) = found.switches
    assert (switch.ends_above, switch.ends_below) == (False, True)
    assert found.force.subs({STIFFNESS: 2, DELTA: sp.Rational(1, 4), switch.border: sp.oo}) == 0
    assert found.force.subs({STIFFNESS: 2, DELTA: -sp.Rational(1, 4), switch.border: sp.oo}) == sp.Rational(1, 4)
    assert found.force.subs({STIFFNESS: 2, DELTA: -sp.Rational(1, 4), switch.border: -sp.oo}) == 0


def test_a_condition_of_something_else_is_refused() -> None:
    with pytest.raises(TypeError, match="constant of the run"):
        find_switching([sp.Piecewise((1, DELTA > RATE), (0, True))], DELTA, RATE, pairs=False)


# scenes


def test_a_scene_without_smoothing_has_no_term_for_it_and_one_without_kinks_no_file_of_them(tmp_path: Path) -> None:
    """Hertz's law has one comparison, deflection > 0."""
    plain, smooth = (shipped("varying_compliance", *changes) for changes in ((), (SMOOTH,)))
    folders = [
        generate(scene_from_text(text, name), tmp_path / name) for name, text in (("plain", plain), ("smooth", smooth))
    ]
    assert [(folder / "switches.h").is_file() for folder in folders] == [True, False]
    text = (folders[0] / "kernels.h").read_text(encoding="utf-8")
    law = text[text.index("bp_0_forces_lanes(") :]
    law = law[: law.index("\n}")].replace("lane < BP_0_BALLS", "")
    assert law.count("<") + law.count(">") <= 1
    assert not any("smoothing" in p.name for p in derive(scene_from_text(plain, "plain")).parameters)


@pytest.mark.long
def test_motion_goes_to_that_of_hertz_with_the_width(make_model: Callable[..., Model]) -> None:
    """The width is a run-time number; a quarter of it brings the motion nearer by more than a factor of four."""
    plain, smoothed = make_model("varying_compliance"), make_model("varying_compliance", SMOOTH)
    reference = plain.simulate(duration=0.05, rtol=1e-9).x
    apart = []
    for width in (8e-8, 2e-8, 5e-9):
        run = smoothed.simulate(duration=0.05, rtol=1e-9, parameters={"bearing.contact.smoothing": width})
        apart.append(float(np.max(np.abs(run.x[:, :2] - reference[:, :2]))))
    assert apart[0] > 4 * apart[1] > 16 * apart[2] > 0.0


@pytest.mark.long
def test_second_derivatives_are_given_for_the_smoothed_law_only(tmp_path: Path) -> None:
    def virtual(name: str, *changes: tuple[str, str]) -> Model:
        """Evaluated a few times: not worth a compiler."""
        folder = generate(scene_from_text(shipped("punching_press_tangent", *changes), name), tmp_path / name)
        return Model(folder, read_manifest(folder), None)

    plain, smoothed = virtual("plain"), virtual("smoothed", SMOOTH)
    t = 0.0811
    x = smoothed.static_equilibrium(t).x
    x[4:] = [1e-3, -2e-3, 3e-3, 1e-3]
    with pytest.raises(RequestError, match="smoothing") as caught:
        plain.hessian("ball.force", ("inner.x", "inner.x"), t=t, x=x)
    assert "deflection^(-1/2)" in str(caught.value)
    assert np.all(np.isfinite(plain.hessian("drive_torque", ("crank_angle", "crank_angle"), t=t)))
    for pair in (("inner.x", "inner.y"), ("inner.y", "bearing.clearance"), ("bearing.clearance", "crank_angle")):
        for of in ("rhs", "ball.force"):
            found = smoothed.hessian(of, pair, t=t, x=x)
            swapped = smoothed.hessian(of, (pair[1], pair[0]), t=t, x=x)
            assert found == pytest.approx(swapped, rel=1e-9, abs=1e-9 * np.max(np.abs(found)))
            assert np.any(found != 0.0)

    def slope(value: float) -> np.ndarray:
        moved = x.copy()
        moved[1] = value
        return smoothed.jacobian("ball.force", ["inner.x", "bearing.clearance"], t=t, x=moved)

    second = richardson(slope, x[1], 1e-7).value
    for k, name in enumerate(("inner.x", "bearing.clearance")):
        found = smoothed.hessian("ball.force", (name, "inner.y"), t=t, x=x)
        assert found == pytest.approx(second[:, k], rel=1e-7, abs=1e-7 * np.max(np.abs(found)))


@pytest.mark.parametrize(
    ("law", "contact", "rate", "words"),
    [
        ("one-sided", 'smoothing = "0 um"', "", "bearing.contact.smoothing"),
        ("one-sided", 'smoothing = "1 s"', "", "dimension"),
        ("tangent", "", 'smoothing = "1 mm/s"', "no kink at rest"),
    ],
)
def test_wrong_widths_are_refused(law: str, contact: str, rate: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        scene_from_text(press(law, f"{DAMPING[law]}\n{rate}", (SMOOTH[0], f"{SMOOTH[0]}{contact}\n")), "wrong")
