"""Claims about the smoothed laws: what they keep, how far they are off, and that nobody pays who does not ask."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from ballpass.derive import SceneError, derive, generate
from ballpass.derive.bearing.laws.contact import RAMP_ERROR, SMOOTHED_HERTZ_ERROR
from ballpass.derive.lowering.functions import lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.system import System
from ballpass.runtime import Model
from ballpass.runtime.certify.differences import richardson
from ballpass.runtime.contract import read_manifest
from ballpass.runtime.contract.errors import RequestError

CONTACT = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')
WIDTH = 0.05e-6

#: Damping table of the press by law: what stands in the file, and the smoothness with smoothing of the contact, and of
#: the rate as well.
LAWS = {
    "one-sided": ("kinked", "twice smooth"),
    "one-sided-gated": ("kinked", "twice smooth"),
    "two-sided-gated": ("twice smooth", None),
    "tangent": ("twice smooth", None),
}


def press(scene_text: Callable[..., str], law: str, *, contact: bool, rate: bool = False) -> System:
    old = '[bearing.damping]\nlaw = "one-sided"\nratio = "0.25e-5 s*mm^0.5"'
    new = old.replace('"one-sided"', f'"{law}"')
    if law == "tangent":
        new = new.replace("s*mm^0.5", "s")
    if rate:
        new += '\nsmoothing = "1 mm/s"'
    changes = [(old, new)] + ([CONTACT] if contact else [])
    return derive(scene_from_text(scene_text("punching_press", *changes), "smoothed"))


class Law:
    """Force of one ball over deflection and rate, elastic and damping, and its derivatives up to the second."""

    def __init__(self, system: System, **overrides: float) -> None:
        functions = lower(system)
        values = {p.name: p.default for p in system.parameters} | overrides
        self.p = list(values.values())
        self.c = functions["constants"](self.p)
        names = [k.name for k in functions.constants]
        self.k_b, self.c_b = (float(self.c[names.index(f"bearing.{k}")]) for k in ("k_b", "c_b"))
        delta, rate = ca.SX.sym("delta"), ca.SX.sym("rate")
        self._z = ca.vertcat(delta, rate)
        self._forces = functions["contact"](delta, rate, ca.DM(self.p), ca.DM(self.c))

    def __call__(self, which: int, delta: float, rate: float) -> float:
        return float(ca.Function("f", [self._z], [self._forces[which]])([delta, rate]))

    def table(self, which: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, gradients (2), Hessians (4) at points of shape (n, 2)."""
        hessian, gradient = ca.hessian(self._forces[which], self._z)
        f = ca.Function("f", [self._z], [self._forces[which], gradient, ca.densify(hessian).reshape((4, 1))])
        value, slope, curvature = f.map(len(points))(points.T)
        return value.full()[0], slope.full().T, curvature.full().T


@pytest.mark.parametrize("law", LAWS)
def test_smoothness_is_declared(scene_text: Callable[..., str], law: str) -> None:
    with_contact, with_both = LAWS[law]
    system = press(scene_text, law, contact=True)
    assert {name: s.value for name, s in system.smoothness} == {"elastic": "twice smooth", "damping": with_contact}
    if with_both is not None:
        system = press(scene_text, law, contact=True, rate=True)
        assert {name: s.value for name, s in system.smoothness} == {"elastic": "twice smooth", "damping": with_both}


def test_outside_the_width_it_is_hertz_and_inside_within_the_stated_error(scene_text: Callable[..., str]) -> None:
    law = Law(press(scene_text, "tangent", contact=True))
    delta = np.linspace(-3 * WIDTH, 3 * WIDTH, 60_001)
    smoothed, _, _ = law.table(0, np.column_stack([delta, np.zeros_like(delta)]))
    hertz = law.k_b * np.maximum(delta, 0.0) ** 1.5
    error = smoothed - hertz
    outside = np.abs(delta) > WIDTH
    assert np.all(np.abs(error[outside]) <= 4 * np.finfo(float).eps * hertz[outside])  # rounding of two formulas
    assert np.min(error) >= -1e-12 * np.max(hertz)
    bound = SMOOTHED_HERTZ_ERROR * law.k_b * WIDTH**1.5
    assert 0.99 * bound <= np.max(error) <= bound


@pytest.mark.long
def test_error_falls_as_the_width_to_the_three_halves(scene_text: Callable[..., str]) -> None:
    """And the slope's as its root: Hertz's own law is the limit."""
    system = press(scene_text, "tangent", contact=True)
    force, slope = [], []
    for width in (1.6e-7, 4e-8, 1e-8):
        law = Law(system, **{"bearing.contact.smoothing": width})
        delta = np.linspace(-width, width, 4001)
        value, gradient, _ = law.table(0, np.column_stack([delta, np.zeros_like(delta)]))
        force.append(np.max(np.abs(value - law.k_b * np.maximum(delta, 0.0) ** 1.5)))
        slope.append(np.max(np.abs(gradient[:, 0] - 1.5 * law.k_b * np.sqrt(np.maximum(delta, 0.0)))))
    assert np.log(np.array(force[:-1]) / force[1:]) / np.log(4.0) == pytest.approx([1.5, 1.5], abs=1e-3)
    assert np.log(np.array(slope[:-1]) / slope[1:]) / np.log(4.0) == pytest.approx([0.5, 0.5], abs=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_second_derivatives_are_bounded_and_continuous(scene_text: Callable[..., str], law: str) -> None:
    """Across onset and rest, on a fine grid: no jump of a Hessian's entry larger than its slope allows."""
    of_law = Law(press(scene_text, law, contact=True, rate=LAWS[law][1] is not None))
    for which in (0, 1):
        for fixed, along in (((0.0, 3e-4), 0), ((0.4 * WIDTH, 0.0), 1)):
            reach = 1.5 * (WIDTH, 1e-3)[along]
            jumps = []
            for count in (501, 5001, 50_001):
                points = np.tile(fixed, (count, 1))
                points[:, along] = np.linspace(-reach, reach, count) + 1e-3 * reach
                _, _, curvature = of_law.table(which, points)
                assert np.all(np.isfinite(curvature))
                jumps.append(np.max(np.abs(np.diff(curvature, axis=0)), axis=0))
            # a jump that stays is a jump of the law; a continuous entry's shrinks with the grid
            assert np.all(jumps[2] <= 0.15 * jumps[1] + 1e-12 * np.max(jumps[0]))


def test_hertz_has_no_bounded_second_derivative(scene_text: Callable[..., str]) -> None:
    law = Law(press(scene_text, "tangent", contact=False))
    delta = np.array([1e-8, 1e-10, 1e-12])
    _, _, curvature = law.table(0, np.column_stack([delta, np.zeros(3)]))
    assert curvature[:, 0] == pytest.approx(0.75 * law.k_b / np.sqrt(delta), rel=1e-12)


def test_one_sided_damping_is_off_by_the_stated_part_of_the_width(scene_text: Callable[..., str]) -> None:
    law = Law(press(scene_text, "one-sided", contact=True, rate=True))
    rate = np.linspace(-2e-3, 2e-3, 4001)
    value, _, _ = law.table(1, np.column_stack([np.full_like(rate, 1e-6), rate]))
    error = value - law.c_b * np.maximum(rate, 0.0)
    assert np.max(error) == pytest.approx(RAMP_ERROR * law.c_b * 1e-3, rel=1e-9)
    assert np.max(np.abs(error[np.abs(rate) > 1e-3])) <= 1e-12 * law.c_b


def test_gate_opens_within_the_width(scene_text: Callable[..., str]) -> None:
    law = Law(press(scene_text, "two-sided-gated", contact=True))
    assert law(1, -WIDTH, 1.0) == 0.0
    assert law(1, 0.0, 1.0) == pytest.approx(0.5 * law.c_b, rel=1e-12)
    assert law(1, WIDTH * (1 + 1e-9), -1.0) == pytest.approx(-law.c_b, rel=1e-12)


@pytest.mark.parametrize("name", ["punching_press", "punching_press_tangent", "four_bar", "varying_compliance"])
def test_scenes_without_the_key_know_nothing_of_it(scene_text: Callable[..., str], name: str, tmp_path: Path) -> None:
    """No parameter, no constant, no branch more; kernels are the same text whether the key exists in the reader or not:
    Hertz's law has one comparison, deflection > 0."""
    folder = generate(scene_from_text(scene_text(name), name), tmp_path / name)
    system = derive(scene_from_text(scene_text(name), name))
    assert not any("smoothing" in p.name for p in system.parameters)
    text = (folder / "kernels.h").read_text(encoding="utf-8")
    law = text[text.index("bp_0_forces_lanes(") :]
    law = law[: law.index("\n}")].replace("lane < BP_0_BALLS", "")
    damping = system.scene.bearing.damping.law if system.scene.bearing else "none"
    assert law.count("<") + law.count(">") <= {"none": 1, "one-sided": 2, "tangent": 2}[damping]


@pytest.mark.long
def test_motion_goes_to_that_of_hertz_with_the_width(make_model: Callable[..., Model]) -> None:
    """The width is a run-time number; a quarter of it brings the motion nearer by more than a factor of four."""
    plain, smoothed = make_model("varying_compliance"), make_model("varying_compliance", CONTACT)
    reference = plain.simulate(duration=0.05, rtol=1e-9).x
    apart = []
    for width in (8e-8, 2e-8, 5e-9):
        run = smoothed.simulate(duration=0.05, rtol=1e-9, parameters={"bearing.contact.smoothing": width})
        apart.append(float(np.max(np.abs(run.x[:, :2] - reference[:, :2]))))
    assert apart[0] > 4 * apart[1] > 16 * apart[2] > 0.0


@pytest.mark.long
def test_second_derivatives_are_given_for_the_smoothed_law_only(scene_text: Callable[..., str], tmp_path: Path) -> None:
    def virtual(name: str, *changes: tuple[str, str]) -> Model:
        """Evaluated a few times: not worth a compiler."""
        folder = generate(scene_from_text(scene_text("punching_press_tangent", *changes), name), tmp_path / name)
        return Model(folder, read_manifest(folder), None)

    plain, smoothed = virtual("plain"), virtual("smoothed", CONTACT)
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
    ("change", "words"),
    [
        ((CONTACT[0], '[bearing.contact]\nsmoothing = "0 um"\n'), "bearing.contact.smoothing"),
        ((CONTACT[0], '[bearing.contact]\nsmoothing = "1 s"\n'), "dimension"),
    ],
)
def test_wrong_widths_are_refused(scene_text: Callable[..., str], change: tuple[str, str], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        scene_from_text(scene_text("punching_press", change), "wrong")


def test_a_law_without_a_kink_at_rest_takes_no_width_of_the_rate(scene_text: Callable[..., str]) -> None:
    with pytest.raises(SceneError, match="no kink at rest"):
        press(scene_text, "tangent", contact=True, rate=True)
