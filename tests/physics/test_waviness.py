"""Claims about waviness of the outer raceway: which orders push the ring, how strongly and how fast; exact rates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import SceneError, generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model

BALLS, PRELOAD, AMPLITUDE = 8, 4e-6, 1e-11
ORDERS = tuple(range(2, 21))
WAVES = "\n".join(f'{n} = {{ amplitude = "0 um", phase = "20 deg" }}' for n in ORDERS)
WAVY = ("[bearing.inner_ring]", f"[bearing.outer_waviness]\n{WAVES}\n[bearing.inner_ring]")
#: Rings held concentric with preload: every ball is pressed alike.
TIGHT = ('clearance = "0 um"  ', f'clearance = "{-2e6 * PRELOAD} um"  ')
START = ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]')
FORCES = ('"load.*"]', '"load.*", "ring_force.*"]')
DAMPED = ('law = "none"  ', 'law = "tangent"\nratio = "2e-5 s"  ')


@pytest.fixture(scope="module")
def held(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance", WAVY, TIGHT, DAMPED, START, FORCES)


def samples(model: Model, order: int, output: str) -> np.ndarray:
    """An output over one pass of the cage, the rings held at the centre."""
    wave = {f"bearing.outer_waviness.{order}.amplitude": AMPLITUDE}
    turn = 2 * np.pi / model.constants()["bearing.cage_speed"]
    rest = np.zeros(4)
    return np.array([model.evaluate(t, rest, [output], wave)[output] for t in np.linspace(0, turn, 65)[:-1]])


@pytest.mark.parametrize("order", ORDERS)
def test_only_orders_beside_multiples_of_the_balls_push_the_ring(held: Model, order: int) -> None:
    """n = qZ + 1 and qZ - 1, at qZ times the cage's speed, with 0.75 Z k_b sqrt(preload) B."""
    lines = np.abs(np.fft.rfft(samples(held, order, "ring_force.x"))) * 2 / 64
    linear = 0.75 * BALLS * held.constants()["bearing.k_b"] * np.sqrt(PRELOAD) * AMPLITUDE
    expected = np.zeros(33)
    if (order + 1) % BALLS == 0 or (order - 1) % BALLS == 0:
        expected[BALLS * round(order / BALLS)] = linear
    # what damping adds to the force of a ball: beta times its rate, which is n times the cage's speed
    faster = np.hypot(1.0, 2e-5 * order * held.constants()["bearing.cage_speed"])
    assert lines[1:] == pytest.approx(expected[1:] * faster, abs=2e-5 * linear)


@pytest.mark.parametrize("order", [7, 16])
def test_the_rate_is_that_of_the_deflection(held: Model, order: int) -> None:
    """Damping force over the tangent stiffness and beta is the rate; differences of the deflection are another way."""
    wave = {f"bearing.outer_waviness.{order}.amplitude": 1e-6}
    rest, t, h = np.zeros(4), 0.013, 1e-6

    def at(time: float, output: str) -> np.ndarray:
        return np.asarray(held.evaluate(time, rest, [output], wave)[output])

    slope = 1.5 * held.constants()["bearing.k_b"] * np.sqrt(at(t, "ball.deflection"))
    rate = at(t, "ball.damping_force") / (2e-5 * slope)
    difference = (at(t + h, "ball.deflection") - at(t - h, "ball.deflection")) / (2 * h)
    assert rate == pytest.approx(difference, rel=1e-7, abs=1e-9 * np.max(np.abs(rate)))


@pytest.mark.long
def test_stepper_lanes_and_virtual_machine_agree(held: Model) -> None:
    waves = {"bearing.outer_waviness.7.amplitude": 0.5e-6, "bearing.outer_waviness.9.amplitude": 0.2e-6}
    runs = [held.simulate(cycles=0.5, transient=0, parameters=waves, method=m, rtol=1e-9).x for m in METHODS]
    scale = np.max(np.abs(runs[0]), axis=0)
    for other in runs[1:]:
        assert np.max(np.abs(other - runs[0]) / scale) < 1e-6
    many = held.simulate_many({k: [v] for k, v in waves.items()}, ["max:inner.y"], cycles=0.5, transient=0, rtol=1e-9)
    assert many["max:inner.y"][0] == pytest.approx(
        held.reduce(cycles=0.5, transient=0, parameters=waves, rtol=1e-9)["inner.y"].maximum, rel=1e-6
    )


METHODS = ("stepper-dp54", "stepper-rodas5p", "cvodes")


def test_derivatives_by_amplitude_and_phase_are_those_of_differences(held: Model) -> None:
    names = ["bearing.outer_waviness.7.amplitude", "bearing.outer_waviness.7.phase"]
    waves = {names[0]: 0.5e-6, names[1]: 0.4}
    for method in ("stepper-dp54", "stepper-rodas5p"):
        found = held.sensitivities(names, cycles=0.3, parameters=waves, method=method, rtol=1e-9).x[-1]
        for k, (name, step) in enumerate(zip(names, (1e-9, 1e-4), strict=True)):
            ends = [
                held.simulate(cycles=0.3, transient=0, parameters={**waves, name: waves[name] + s}, rtol=1e-11).x[-1]
                for s in (step, -step)
            ]
            slope = (ends[0] - ends[1]) / (2 * step)
            assert found[:, k] == pytest.approx(slope, rel=1e-4, abs=1e-4 * np.max(np.abs(slope)))


def test_orders_are_structure_and_amplitudes_numbers(held: Model, scene_text: Callable[..., str]) -> None:
    assert {f"bearing.outer_waviness.{n}.{key}" for n in ORDERS for key in ("amplitude", "phase")} <= set(
        held.parameters
    )
    plain = scene_from_text(scene_text("varying_compliance"), "plain")
    assert scene_from_text(scene_text("varying_compliance", WAVY), "plain").structure() != plain.structure()


@pytest.mark.parametrize("key", ["0", "x", "1000", "08"])
def test_an_order_that_is_none_is_refused(scene_text: Callable[..., str], tmp_path: Path, key: str) -> None:
    text = scene_text("varying_compliance", (WAVY[0], f"[bearing.outer_waviness]\n{key} = {{}}\n{WAVY[0]}"))
    with pytest.raises(SceneError, match="no order of waviness"):
        generate(scene_from_text(text, "wavy"), tmp_path)


def test_a_negative_amplitude_is_refused(scene_text: Callable[..., str]) -> None:
    with pytest.raises(SceneError, match=r"outer_waviness\.2\.amplitude[\s\S]*turn the phase by 180 deg"):
        scene_from_text(scene_text("varying_compliance", (WAVY[0], WAVY[1].replace('"0 um"', '"-1 um"', 1))), "wavy")
