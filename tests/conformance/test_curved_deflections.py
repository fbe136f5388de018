"""Claims about deflections that are not linear in the direction of a ball: kernels take them, slopes are found.

No scene names one.  Here grooves stand apart axially, so that the contact angle follows each ball's own approach s,
delta = sqrt((A + s - g)^2 + B^2) - sqrt(A^2 + B^2), with A and B far below those of real grooves: the angle of a
loaded ball is seven degrees off that of an unloaded one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
import sympy as sp
import test_every_part as every
from evaluators import Evaluators
from numpy.typing import NDArray
from parts import shipped
from scipy.integrate import solve_ivp
from test_lanes import METHODS_OF_RUNS, differing

from ballpass.derive import generate
from ballpass.derive.bearing import contact_direction, equations
from ballpass.derive.bearing.contact_direction import ContactDirection
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.runtime import Model, load
from ballpass.runtime.certify.certificate import Verdict

RADIAL, AXIAL = 60e-6, 40e-6
WAVES = '[bearing.inner_waviness]\n9 = { amplitude = "0.2 um", phase = "0.3 rad" }\n\n[run]'
TANGENT = ('law = "none"', 'law = "tangent"\nratio = "0.25e-5 s"')
CASES = {
    "a rotor": shipped("varying_compliance", TANGENT),
    "the press": shipped("punching_press"),
    "the press with a wavy ring": shipped("punching_press", ("[run]", WAVES)),
    "the two-way press": shipped("punching_press_two_way"),
    "the two-way press with a wavy ring": shipped("punching_press_two_way", ("[run]", WAVES)),
}

LONG = pytest.mark.long


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvedDirection(ContactDirection):
    """Contact of grooves that stand apart axially."""

    def deflection(self, approach: sp.Expr) -> sp.Expr:
        radial, axial = sp.Float(RADIAL, 17), sp.Float(AXIAL, 17)
        return sp.sqrt((radial + approach - self.gap) ** 2 + axial**2) - sp.sqrt(radial**2 + axial**2)


@pytest.fixture(scope="module", autouse=True)
def _curved() -> Iterator[None]:
    def direction(bearing: Bearing) -> ContactDirection:
        plain = contact_direction.contact_direction(bearing)
        return CurvedDirection(cosine=plain.cosine, gap=plain.gap, constants=plain.constants)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(equations, "contact_direction", direction)
        yield


@pytest.fixture(
    scope="module",
    params=[pytest.param(text, id=of, marks=() if text is CASES["a rotor"] else LONG) for of, text in CASES.items()],
)
def evaluators(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Evaluators:
    return Evaluators(scene_from_text(request.param, "curved"), tmp_path_factory.mktemp("curved"))


@pytest.fixture(scope="module")
def rotor(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return load(generate(scene_from_text(CASES["a rotor"], "rotor"), tmp_path_factory.mktemp("rotor") / "rotor"))


def test_sympy_casadi_and_kernels_agree(evaluators: Evaluators) -> None:
    """In values, in the Jacobian, and with differences by every parameter."""
    every.test_sympy_casadi_and_compiled_kernels_agree(evaluators)
    every.test_kernels_have_the_jacobian_of_the_right_hand_side(evaluators)
    every.test_derivatives_agree_with_differences(evaluators)


@LONG
def test_motion_of_a_rotor_is_that_of_scipy_and_of_casadis_integrator(rotor: Model) -> None:
    """By every method, against a model written here and against functions that have no kernels."""
    c = rotor.constants()
    cage, contact, ratio = c["bearing.cage_speed"], c["bearing.k_b"], rotor.parameters["bearing.damping.ratio"]

    def rates(t: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, vx, vy = state
        angles = cage * t + 2.0 * np.pi * np.arange(8) / 8
        co, si = np.cos(angles), np.sin(angles)
        radial = RADIAL + x * co + y * si
        length = np.hypot(radial, AXIAL)
        delta = np.maximum(length - np.hypot(RADIAL, AXIAL), 0.0)
        rate = radial / length * (vx * co + vy * si + cage * (y * co - x * si))
        force = (contact * delta**1.5 + 1.5 * ratio * contact * np.sqrt(delta) * rate) * radial / length
        return np.array([vx, vy, (196.0 - 200.0 * vx - force @ co) / 20.0, (-200.0 * vy - force @ si) / 20.0])

    start = [3.9937e-6, 0.1e-6, 0.0, 0.0]
    run = {"transient": 0, "samples_per_cycle": 100}
    turn = rotor.period()
    times = np.linspace(0.0, 0.2 * turn, 21)
    own = solve_ivp(
        rates, (0.0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=[1e-17, 1e-17, 1e-14, 1e-14], max_step=1e-4
    )
    size = np.max(np.abs(own.y[:2]))
    for method in (*METHODS_OF_RUNS, "cvodes"):
        found = rotor.simulate(0.2, method=method, rtol=1e-10, **run)  # type: ignore[arg-type]
        assert np.max(np.abs(found.x[:, :2] - own.y[:2].T)) < 1e-7 * size, method


@LONG
def test_lanes_derivatives_and_reductions_take_them(rotor: Model) -> None:
    """Members are the bits of single runs; derivatives of runs are verified; extremes are those of samples."""
    assert differing(rotor, "stepper-dp54", 0.3) == differing(rotor, "stepper-rodas5p", 0.3) == []
    found = rotor.sensitivity(
        ["max:ball.force", "mean:inner.x"], ["bearing.clearance", "bearing.contact.stiffness"], cycles=0.3, transient=0
    )
    assert all(pair.check.verdict is Verdict.VERIFIED for pair in found.pairs)
    samples = rotor.simulate(0.3, transient=0, samples_per_cycle=50_000, outputs=["ball.force"])
    force = rotor.reduce(0.3, transient=0)["ball.force"]
    assert force.maximum == pytest.approx(samples["ball.force"].max(), rel=1e-5)  # of samples 3 us apart
