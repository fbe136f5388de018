"""Claims about contacts of the user's own, k delta^n: motion of ball and roller, statics, slopes, no ratings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.runtime import Model
from ballpass.runtime.app.summary_words import stands_out
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.contract.errors import RequestError

#: The rotor of the varying compliance: eight elements, no clearance, 196 N along x.
BALLS, LOAD = 8, 196.0
TANGENT = ('law = "none"', 'law = "tangent"\nratio = "2.5e-5 s"')


def own(force: str, deflection: str, exponent: float | str) -> tuple[tuple[str, str], ...]:
    """The rotor with a contact of this law."""
    keys = f'force = "{force}"\ndeflection = "{deflection}"\nexponent = {exponent}'
    return ("balls = 8\n", 'element = "power-law"\nballs = 8\n'), ('stiffness = "13.34e9 N/m^1.5"', keys)


#: 800 N at 20 um with the exponent 1.3.
FORCE, DEFLECTION, EXPONENT = 800.0, 20e-6, 1.3
OWN = own("800 N", "20 um", EXPONENT)


@pytest.mark.parametrize(
    ("of_another", "numbers"),
    [
        ((), {}),
        pytest.param(
            (
                ("balls = 8\n", 'element = "cylindrical-roller"\nballs = 8\n'),
                ('"13.34e9 N/m^1.5"', '"6e8 N/m^(10/9)"\nlength = "8 mm"'),
            ),
            {"bearing.contact.force": 6e8, "bearing.contact.exponent": 10.0 / 9.0},
            marks=pytest.mark.long,
        ),
    ],
    ids=["ball", "roller"],
)
def test_with_the_exponent_of_an_element_it_is_that_element(
    make_model: Callable[..., Model], of_another: tuple[tuple[str, str], ...], numbers: dict[str, float]
) -> None:
    """Balls, n = 3/2, and rollers, n = 10/9, in one model whose numbers change: forces to rounding, and motion."""
    element = make_model("varying_compliance", *of_another, TANGENT)
    model = make_model("varying_compliance", *own("13.34e9 N", "1 m", 1.5), TANGENT)
    for state in ([4e-6, 1e-7, 1e-5, 0.0], [-2e-6, 5e-6, 0.0, -3e-3]):
        force, same = (
            one.evaluate(0.01, state, outputs=["ball.force"], parameters=values)["ball.force"]
            for one, values in ((model, numbers), (element, {}))
        )
        assert np.count_nonzero(same) >= 3
        np.testing.assert_allclose(force, same, rtol=1e-13)
    settings = {"cycles": 0.2, "transient": 0, "rtol": 1e-12, "samples_per_cycle": 200}
    run, expected = model.simulate(**settings, parameters=numbers), element.simulate(**settings)
    assert np.max(np.abs(run.x - expected.x) / np.max(np.abs(expected.x), axis=0)) < 1e-7


@pytest.fixture(scope="module")
def rotor(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance", *OWN, TANGENT)


@pytest.mark.parametrize("clearance", [0.0, 10e-6])
def test_static_distribution_of_the_load_by_hand(rotor: Model, clearance: float) -> None:
    """At rest with an element on the load line: F = F_ref (delta/delta_ref)^n of each, on the load line in sum W."""
    cos = np.cos(2.0 * np.pi * np.arange(BALLS) / BALLS)

    def forces(place: float) -> np.ndarray:
        return np.asarray(FORCE * (np.maximum(place * cos - clearance / 2.0, 0.0) / DEFLECTION) ** EXPONENT)

    place = brentq(lambda x: forces(x) @ cos - LOAD, 0.0, 1e-3, xtol=1e-18, rtol=1e-14)
    rest = rotor.static_equilibrium(parameters={"bearing.clearance": clearance})
    assert rest["inner.x"] == pytest.approx(place, rel=1e-9)
    found = rotor.evaluate(
        0.0, [place, 0.0, 0.0, 0.0], outputs=["ball.elastic_force"], parameters={"bearing.clearance": clearance}
    )
    np.testing.assert_allclose(found["ball.elastic_force"].ravel(), forces(place), rtol=1e-12, atol=1e-12 * LOAD)
    # without clearance the heaviest one bears W/sum cos^(n + 1), whatever the stiffness
    if clearance == 0.0:
        share = 1.0 / np.sum(np.maximum(cos, 0.0) ** (EXPONENT + 1.0))
        assert rest.peak_ball_force == pytest.approx(share * LOAD, rel=1e-9)


def test_energy_and_stiffness_are_integral_and_slope(make_model: Callable[..., Model]) -> None:
    """F delta/(n + 1) and n F/delta of each element."""
    outputs = ('outputs = ["inner.*", ', 'outputs = ["contact.energy", "ball.stiffness", "inner.*", ')
    model = make_model("varying_compliance", *OWN, TANGENT, outputs)
    found = model.evaluate(0.0, [8e-6, 3e-6, 0.0, 0.0])
    force, delta = found["ball.elastic_force"].ravel(), found["ball.deflection"].ravel()
    loaded = delta > 0.0
    assert 0 < loaded.sum() < BALLS
    assert float(found["contact.energy"]) == pytest.approx(np.sum(force * delta) / (EXPONENT + 1.0), rel=1e-12)
    slopes = found["ball.stiffness"].ravel()
    np.testing.assert_allclose(slopes[loaded], EXPONENT * force[loaded] / delta[loaded], rtol=1e-12)
    assert not slopes[~loaded].any()


@pytest.mark.long
def test_derivatives_by_the_numbers_of_the_law_are_verified(rotor: Model) -> None:
    """Elements meet and part in the run; the derivative by the exponent is that of differences too."""
    wrt = [f"bearing.contact.{key}" for key in ("exponent", "force", "deflection")]
    asked, length = ["mean:ball.force", "rms:inner.y"], {"cycles": 0.4, "transient": 0.2}
    report = rotor.sensitivity(asked, wrt, **length)
    assert all(pair.check.verdict is Verdict.VERIFIED for pair in report.pairs), [p.check for p in report.pairs]
    step, values = 1e-5, []
    for sign in (1.0, -1.0):
        changed = {wrt[0]: EXPONENT + sign * step}
        values.append(rotor.quantities(asked, **length, rtol=1e-12, parameters=changed))
    for pair in report.pairs[::3]:
        ends = [found[pair.quantity].value for found in values]
        assert pair.derivative == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-5), pair.quantity


def test_what_needs_a_shape_is_refused_in_words(rotor: Model) -> None:
    """Lives, ratings and pressures; a run says its highest force without a pressure."""
    with pytest.raises(RequestError, match=r"^bearing: element = \"power-law\" .* no standard .* a life"):
        rotor.life(cycles=1, transient=0)
    with pytest.raises(RequestError, match=r"^life: element = \"power-law\""):
        rotor.quantities("life", cycles=1, transient=0)
    peak = {"total": 62.0, "time": {"total": 0.1}, "ball": {"total": 3}}
    (words,) = stands_out(rotor.manifest, rotor.numbers({}).values, {"peak_ball_force": peak})
    assert words.startswith("Highest rolling element force: 62 N (rolling element 3 at 0.1 s, ")
    assert "MPa" not in words


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (own("800 N", "20 um", 1.0), ("out of its bounds", "a value above 1")),
        (own("800 N", "0 um", 1.3), ("deflection", "above zero")),
        (
            (*OWN, ('law = "none"', 'law = "one-sided"\nratio = "1e-5 s*mm^0.5"')),
            ('multiplies k_b [N/m]: write a time, as in "0.25e-5 s"',),
        ),
        ((*OWN, ("balls = 8\n", 'balls = 8\ncontact_angle = "15 deg"\n')), ('element = "ball"',)),
        ((*OWN, ("exponent = 1.3", 'stiffness = "8e9 N/m^1.5"')), ("exponent", "stiffness")),
    ],
    ids=["linear", "no deflection", "damping ratio", "contact angle", "stiffness"],
)
def test_what_it_cannot_have_is_refused_in_words(
    scene_text: Callable[..., str], changes: tuple[tuple[str, str], ...], words: tuple[str, ...]
) -> None:
    with pytest.raises(SceneError) as refused:
        scene_from_text(scene_text("varying_compliance", *changes), "own")
    for text in words:
        assert text in str(refused.value)
