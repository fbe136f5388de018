"""Claims about waviness of raceways and balls: which orders push the ring, how strongly and how fast; exact rates."""

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
BALL_ORDERS = tuple(range(1, 7))
BALL_WAVES = "\n".join(f'{n} = {{ amplitude = "0 um", phase = "20 deg" }}' for n in BALL_ORDERS)
TABLES = f"""
[bearing.outer_waviness]
{WAVES}
[bearing.inner_waviness]
{WAVES}
[bearing.ball_waviness.each]
{BALL_WAVES}
[bearing.ball_waviness.3]
2 = {{ amplitude = "0 um", phase = "50 deg" }}
[bearing.ball_deviation]
5 = "0 um"
"""
WAVY = ("[bearing.inner_ring]", f"{TABLES}[bearing.inner_ring]")
#: Rings held concentric with preload: every ball is pressed alike.
TIGHT = ('clearance = "0 um"  ', f'clearance = "{-2e6 * PRELOAD} um"  ')
START = ('["3.9937 um", "0.1 um"]', '["0 um", "0 um"]')
FORCES = ('"load.*"]', '"load.*", "ring_force.*"]')
DAMPED = ('law = "none"  ', 'law = "tangent"\nratio = "2e-5 s"  ')


@pytest.fixture(scope="module")
def held(make_virtual: Callable[..., Model]) -> Model:
    return make_virtual("varying_compliance", WAVY, TIGHT, DAMPED, START, FORCES)


def over_time(model: Model, t: np.ndarray, names: tuple[str, ...], changes: dict[str, float]) -> np.ndarray:
    """Outputs with the rings held in the middle, at many instants in one call; shape (names, instants)."""
    numbers, outputs = model.numbers(changes), model.function("outputs")
    u = np.column_stack([model.inputs_at(float(at), changes) for at in t])
    given = {"t": 0.0, "x": np.zeros((4, len(t))), "u": u, "p": numbers.p, "c": numbers.c}  # phases are those of t
    found = outputs.map(len(t))(*(given[key] for key in outputs.name_in()))
    values = dict(zip(outputs.name_out(), found, strict=True))
    return np.array([values[name.replace(".", "_")].full().ravel() for name in names])


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("ring", ["outer", "inner"])
def test_only_orders_beside_multiples_of_the_balls_push_the_ring(held: Model, ring: str, order: int) -> None:
    """n = qZ + 1 and qZ - 1, with 0.75 Z k_b sqrt(preload) B, at qZ times the speed of the balls over the raceway.

    In the raceway's own axes: in those at rest the lines of the inner one are at qZ (w - w_c) + w and - w.
    """
    constants = held.constants()
    passing = constants[f"bearing.{ring}_pass_speed" if ring == "inner" else "bearing.cage_speed"]
    turning = held.parameters["shaft.speed"] if ring == "inner" else 0.0
    wave = {f"bearing.{ring}_waviness.{order}.amplitude": AMPLITUDE}
    t = np.linspace(0.0, 2 * np.pi / abs(passing), 65)[:-1]
    x, y = over_time(held, t, ("ring_force.x", "ring_force.y"), wave)
    forces = (x + 1j * y) * np.exp(-1j * turning * t)
    lines = np.abs(np.fft.fft(forces)) / 64
    linear = 0.75 * BALLS * constants["bearing.k_b"] * np.sqrt(PRELOAD) * AMPLITUDE
    expected = np.zeros(64)
    for beside in (-1, 1):
        if (order - beside) % BALLS == 0:
            expected[round(-beside * np.sign(passing)) * (order - beside)] = linear
    # what damping adds to the force of a ball: beta times its rate, which is n times the speed of passing
    faster = np.hypot(1.0, 2e-5 * order * passing)
    assert lines[1:] == pytest.approx(expected[1:] * faster, abs=2e-5 * linear)


@pytest.mark.parametrize("order", BALL_ORDERS)
def test_only_even_orders_of_a_ball_press_it(held: Model, order: int) -> None:
    """Both raceways meet the wave: 2 C cos(n psi), psi at 1.991766 turns of the ball in one of the shaft."""
    names = ("bearing.ball_waviness.each.{}.amplitude", "bearing.ball_waviness.each.{}.phase")
    wave = {names[0].format(order): 1e-7, names[1].format(order): 0.3}
    times = np.linspace(0.0, 0.4, 23)
    found = np.array([held.evaluate(t, np.zeros(4), ["ball.deflection"], wave)["ball.deflection"] for t in times])
    spin = 1.991766 * held.parameters["shaft.speed"]
    thicker = 2e-7 * np.cos(order * spin * times + 0.3) if order % 2 == 0 else np.zeros(len(times))
    assert found - PRELOAD == pytest.approx(np.tile(thicker[:, None], BALLS), abs=1e-11)


def test_waves_and_deviations_of_single_balls_are_those_of_no_other(held: Model) -> None:
    numbers = {"bearing.ball_waviness.3.2.amplitude": 1e-7, "bearing.ball_deviation.5": -3e-7}
    for t in (0.0, 0.123, 7.7):
        found = held.evaluate(t, np.zeros(4), ["ball.deflection"], numbers)["ball.deflection"] - PRELOAD
        spin = held.constants()["bearing.spin_speed"] * t
        expected = np.zeros(BALLS)
        expected[2], expected[4] = 2e-7 * np.cos(2 * spin + np.deg2rad(50.0)), -3e-7
        assert found == pytest.approx(expected, abs=1e-16)


@pytest.mark.parametrize(
    "wave", ["outer_waviness.7", "outer_waviness.16", "inner_waviness.9", "ball_waviness.each.4", "ball_waviness.3.2"]
)
def test_the_rate_is_that_of_the_deflection(held: Model, wave: str) -> None:
    """Damping force over the tangent stiffness and beta is the rate; differences of the deflection are another way."""
    numbers = {f"bearing.{wave}.amplitude": 1e-6}
    rest, t, h = np.zeros(4), 0.013, 1e-6

    def at(time: float, output: str) -> np.ndarray:
        return np.asarray(held.evaluate(time, rest, [output], numbers)[output])

    slope = 1.5 * held.constants()["bearing.k_b"] * np.sqrt(at(t, "ball.deflection"))
    rate = at(t, "ball.damping_force") / (2e-5 * slope)
    difference = (at(t + h, "ball.deflection") - at(t - h, "ball.deflection")) / (2 * h)
    assert np.max(np.abs(rate)) > 0.0
    assert rate == pytest.approx(difference, rel=1e-7, abs=1e-9 * np.max(np.abs(rate)))


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


def test_waves_that_all_balls_have_alike_may_stand_alone(scene_text: Callable[..., str], tmp_path: Path) -> None:
    """Nothing of the ball's place is left in the term then."""
    table = '[bearing.ball_waviness.each]\n2 = { amplitude = "0.1 um" }\n[bearing.inner_ring]'
    text = scene_text("varying_compliance", ("[bearing.inner_ring]", table))
    folder = generate(scene_from_text(text, "alike"), tmp_path)
    assert "kernels.h" in "".join(path.name for path in folder.iterdir())


def test_a_roughness_is_its_waves(scene_text: Callable[..., str]) -> None:
    """Amplitudes fall with a power of the order, a seed draws the phases, of each ball its own; they stay numbers."""
    rough = '{{ amplitude = "0.2 um", exponent = 1.5, lowest = 4, highest = 9, seed = {} }}'

    def read(table: str, seed: int) -> dict[str, float]:
        text = f"[bearing.{table}]\nroughness = {rough.format(seed)}\n[bearing.inner_ring]"
        scene = scene_from_text(scene_text("varying_compliance", ("[bearing.inner_ring]", text)), "rough")
        return {q.path.removeprefix(f"bearing.{table}."): q.value for q in scene.quantities if table in q.path}

    first, again, other = read("inner_waviness", 1), read("inner_waviness", 1), read("inner_waviness", 2)
    assert first == again
    assert [first[f"{n}.amplitude"] for n in range(4, 10)] == pytest.approx(
        [0.2e-6 * (4 / n) ** 1.5 for n in range(4, 10)], rel=1e-12, abs=0.0
    )
    phases = [first[f"{n}.phase"] for n in range(4, 10)]
    assert len(set(phases)) == 6
    assert all(0.0 <= phase < 2 * np.pi for phase in phases)
    assert not set(phases) & {other[f"{n}.phase"] for n in range(4, 10)}
    table = "bearing.ball_waviness.each]\nroughness = " + rough.format(1)
    scene = scene_from_text(
        scene_text("varying_compliance", ("[bearing.inner_ring]", f"[{table}\n[bearing.inner_ring]")), "rough"
    )
    drawn = [q.value for q in scene.quantities if "ball_waviness" in q.path and q.path.endswith("phase")]
    assert len(set(drawn)) == BALLS * 6


def test_a_negative_amplitude_is_refused(scene_text: Callable[..., str]) -> None:
    with pytest.raises(SceneError, match=r"outer_waviness\.2\.amplitude[\s\S]*turn the phase by 180 deg"):
        scene_from_text(scene_text("varying_compliance", (WAVY[0], WAVY[1].replace('"0 um"', '"-1 um"', 1))), "wavy")
