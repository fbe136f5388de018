"""A rigid shaft that tilts in its bearings, against closed forms of rotors on linear supports and of levers.

Preloaded by 10 um, bearings are linear supports for displacements of some nanometres.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.plot.gallery import draw

SCENE = (Path(__file__).parent / "tilting_rotor.toml").read_text(encoding="utf-8")
CRANK = (Path(__file__).parent / "overhung_crank.toml").read_text(encoding="utf-8")
MASS, TRANSVERSE, POLAR, CENTER, HALF = 4.0, 0.02, 0.012, 0.01, 0.07
#: A third bearing like the others; what follows the last table of bearings.
RUN = "[run]\ncycles"


def with_third(place: str, more: str = "") -> str:
    third = SCENE[SCENE.index("[bearings.right]") : SCENE.index(RUN)]
    third = third.replace(".right]", ".middle]").replace('position = "80 mm"', f'position = "{place}"\n{more}')
    return SCENE.replace(RUN, third + RUN)


@pytest.fixture(scope="module")
def rotor(model_of: Callable[..., Model]) -> Model:
    return model_of(SCENE, "tilting_rotor")


def stiffness(model: Model) -> float:
    """Of each support: nine preloaded balls are an isotropic spring."""
    values = model.evaluate(0.0, x=np.zeros(len(model.states)))
    found = values["left.contact.stiffness.xx"]
    assert found == pytest.approx(9 / 2 * 1.5 * 8.6e9 * math.sqrt(10e-6), rel=1e-12)
    assert values["right.contact.stiffness.yy"] == pytest.approx(found, rel=1e-12)
    return float(found)


def accelerations(values: dict[str, float], *names: str) -> np.ndarray:
    return np.array([[values[f"{name}.inner.a{axis}"] for axis in "xy"] for name in names])


def ends(model: Model, x: complex, slope: complex) -> np.ndarray:
    """Positions of both inner rings for a displacement x + iy of the centre of mass and a slope of the axis."""
    places = [model.parameters[f"bearings.{name}.position"] - CENTER for name in ("left", "right")]
    rings = [x + place * slope for place in places]
    return np.array([part for ring in rings for part in (ring.real, ring.imag)])


def test_modes_are_cylindrical_and_conical(rotor: Model) -> None:
    """sqrt(2k/m) twice; J_t w^2 -+ J_p W w - 2 k b^2 = 0: whirl forward and backward."""
    k, speed = stiffness(rotor), rotor.parameters["shaft.speed"]
    found = np.sort(np.abs(rotor.linearize(x=np.zeros(8), parameters={"loads.unbalance.mass": 0.0}).eigenvalues.imag))
    cylindrical = math.sqrt(2 * k / MASS)
    conical = [abs(root) for root in np.roots([TRANSVERSE, -POLAR * speed, -2 * k * HALF**2])]
    assert found[::2] == pytest.approx(sorted([cylindrical, cylindrical, *conical]), rel=1e-9)
    assert conical[0] / conical[1] > 1.02


def test_unbalance_bows_by_its_mass_and_a_couple_tilts(rotor: Model) -> None:
    """(2k - m w^2) x = U w^2, and (2 k b^2 - (J_t - J_p) w^2) s = U w^2 a: circles, on which the accelerations are."""
    k, speed = stiffness(rotor), rotor.parameters["shaft.speed"]
    static, couple = 0.2e-3 * 0.005 * speed**2, 0.1e-3 * 0.005 * speed**2 * 0.06
    x = static / (2 * k - MASS * speed**2)
    slope = 1j * couple / (2 * k * HALF**2 - (TRANSVERSE - POLAR) * speed**2)
    assert max(abs(x), abs(slope) * HALF) < 1e-8
    for time in (0.0, 0.0011):
        turned = np.exp(1j * speed * time)
        at, moving = (ends(rotor, x * factor, slope * factor) for factor in (turned, 1j * speed * turned))
        values = rotor.evaluate(time, np.concatenate([at, moving]))
        assert accelerations(values, "left", "right").ravel() == pytest.approx(
            -(speed**2) * at, abs=2e-4 * speed**2 * np.abs(at).max()
        )
        assert complex(values["shaft.tilt.y"], -values["shaft.tilt.x"]) == pytest.approx(slope * turned, rel=1e-9)


@pytest.mark.long
def test_motion_obeys_newton_and_euler_in_any_state(model_of: Callable[..., Model]) -> None:
    """Of the centre of mass and of the tilts: forces of the balls and loads at their places, moments of a gyroscope."""
    model = model_of(
        with_third("20 mm", 'offset = ["2 um", "-1 um"]').replace(
            'damping = { law = "none" }', 'damping = { law = "tangent", ratio = "2e-5 s" }'
        ),
        "three_supports",
    )
    draw = np.random.default_rng(46)
    names = ("left", "right", "middle")
    places = np.array([model.parameters[f"bearings.{name}.position"] for name in names])
    speed = model.parameters["shaft.speed"]
    for _ in range(5):
        state = np.concatenate([draw.uniform(-2e-5, 2e-5, 4), draw.uniform(-0.1, 0.1, 4)])
        time = draw.uniform(0.0, 0.01)
        values = model.evaluate(time, state)
        rates = accelerations(values, "left", "right")
        slope_rate = (state[6:8] - state[4:6]) / (places[1] - places[0])
        bent = (rates[1] - rates[0]) / (places[1] - places[0])
        middle = state[:2] + (places[2] - places[0]) / (places[1] - places[0]) * (state[2:4] - state[:2])
        assert [values["middle.inner.x"], values["middle.inner.y"]] == pytest.approx(middle, rel=1e-12)
        assert accelerations(values, "middle")[0] == pytest.approx(rates[0] + (places[2] - places[0]) * bent, rel=1e-9)
        center = rates[0] + (CENTER - places[0]) * bent
        force, moment = np.zeros(2), np.zeros(2)
        loads = [(0.2e-3, 0.0, 0.01), (0.1e-3, math.pi / 2, 0.04), (0.1e-3, 3 * math.pi / 2, -0.02)]
        for mass, angle, place in loads:
            push = mass * 0.005 * speed**2 * np.array([math.cos(speed * time + angle), math.sin(speed * time + angle)])
            force, moment = force + push, moment + (place - CENTER) * push
        for name, place in zip(names, places, strict=True):
            push = -np.array([values[f"{name}.ring_force.{axis}"] for axis in "xy"])
            force, moment = force + push, moment + (place - CENTER) * push
        assert MASS * center == pytest.approx(force, rel=1e-11, abs=1e-11 * np.abs(force).max())
        # J_t s'' = M with s = (phi_y, -phi_x), and J_p w (-s_y', s_x') of the gyroscope
        turning = POLAR * speed * np.array([-slope_rate[1], slope_rate[0]])
        assert TRANSVERSE * bent == pytest.approx(moment + turning, rel=1e-11, abs=1e-11 * np.abs(moment).max())


@pytest.mark.long
def test_three_supports_carry_by_their_stiffness(model_of: Callable[..., Model]) -> None:
    """A rigid beam on three springs alike at -b, 0, b: F/3 + F z z_i/(2 b^2); the middle one off the line by e carries
    2 k e/3, and each of the others k e/3 against it."""
    model = model_of(with_third("10 mm", 'offset = ["0 um", "0 um"]'), "line_of_three")
    unbalanced = {f"loads.{name}.mass": 0.0 for name in ("unbalance", "couple", "opposite")}
    load, place = 2.0, 0.05
    at_rest = {**unbalanced, "loads.weight.force.y": -load, "loads.weight.position": place}

    def carried(parameters: dict[str, float]) -> np.ndarray:
        rest = model.static_equilibrium(parameters=parameters)
        values = model.evaluate(0.0, x=rest.x, parameters=parameters)
        return np.array([values[f"{name}.ring_force.y"] for name in ("left", "middle", "right")])

    beam = [-load / 3 - load * (place - CENTER) * z / (2 * HALF**2) for z in (-HALF, 0.0, HALF)]
    assert carried(at_rest) == pytest.approx(beam, abs=1e-3 * load)
    k, e = stiffness(model), 5e-9
    off = carried({**unbalanced, "bearings.middle.offset.y": e})
    assert off == pytest.approx([k * e / 3, -2 * k * e / 3, k * e / 3], rel=1e-3)


def test_energy_changes_by_the_work_of_unbalance_and_dampers(rotor: Model) -> None:
    """Kinetic energy of the shaft and energy of the contacts, over four turns."""
    changes = {"loads.unbalance.mass": 0.2, "loads.couple.mass": 0.1}
    changes |= {f"bearings.{name}.inner_ring.damping": 300.0 for name in ("left", "right")}
    run = rotor.simulate(parameters=changes, rtol=1e-10)
    energy = sum(run[name] for name in ("shaft.kinetic_energy", "left.contact.energy", "right.contact.energy"))
    power = run["applied_power"] - run["dissipated_power"]
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(run.t))])
    coarse = np.concatenate([[0.0], np.cumsum(0.5 * (power[2::2] + power[:-2:2]) * np.diff(run.t[::2]))])
    work = work[::2] + (work[::2] - coarse) / 3.0  # Richardson: trapezoids
    found = energy[::2] - energy[0]
    assert np.ptp(found) > 1e-3
    assert found == pytest.approx(work, abs=1e-6 * np.ptp(found))


@pytest.mark.long
def test_at_rest_two_bearings_carry_by_levers(model_of: Callable[..., Model]) -> None:
    """Whatever their stiffness: an overhung crank on two bearings is statically determinate."""
    levers = model_of(CRANK, "overhung_crank")
    crank = "[mechanism.bodies.crank]\n"
    tilting = CRANK.replace(crank, f'{crank}transverse_inertia = "900 kg*mm^2"\n')
    tilting = tilting.replace('law = "tangent", ratio = "0.25e-5 s"', 'law = "none"')  # balls pass while it rests
    tilting = tilting.replace('inner_ring = { mass = "0.8 kg" }\n', "").replace('"*load*"', '"*ring_force*"')
    model = model_of(tilting, "tilting_crank")
    for angle in (0.3, 1.9, 4.4):
        expected = levers.evaluate(0.0, parameters={"mechanism.driver.start_angle": angle})
        parameters = {"mechanism.driver.start_angle": angle}
        rest = model.static_equilibrium(parameters=parameters)
        values = model.evaluate(0.0, x=rest.x, parameters=parameters)
        for name in ("front", "rear"):
            for axis in "xy":
                size = abs(expected["front.load.x"]) + abs(expected["front.load.y"])
                assert values[f"{name}.ring_force.{axis}"] == pytest.approx(
                    expected[f"{name}.load.{axis}"], abs=1e-7 * size
                )


def test_a_figure_of_the_shaft_has_all_forces_at_their_places(model_of: Callable[..., Model]) -> None:
    """Of the bearings and of what is on the crank, at the sample of the highest force of a bearing."""
    model = model_of(CRANK, "overhung_crank")
    run = model.simulate()
    figure = draw("shaft_loads", model, run)
    highest = int(np.argmax(np.hypot(run["front.load.x"], run["front.load.y"])))  # the front one bears more
    for axes in figure.axes:
        drawn = dict(text.get_text().split("\n") for text in axes.texts if text.get_text())
        assert set(drawn) == {"front", "rear", "belt", "B"}
    # along y, the last panel
    assert drawn["belt"] == "0"
    assert float(drawn["rear"]) == pytest.approx(-run["rear.load.y"][highest], abs=0.5)
    assert float(drawn["B"]) == pytest.approx(run["reaction.B.y"][highest], abs=0.5)


@pytest.mark.long
def test_five_bearings_of_an_engine_carry_what_its_plane_model_has(make_model: Callable[..., Model]) -> None:
    """Impulse of all bearings over a cycle is that of the reaction of the linkage, less the momentum of the shaft."""
    model = make_model("four_cylinder")
    run = model.simulate(rtol=1e-9, transient=2, cycles=4)
    speeds = [run[f"{name}.inner.vy"] for name in ("main_1", "main_2")]
    places = [model.parameters[f"bearings.{name}.position"] for name in ("main_1", "main_2")]
    center = speeds[0] - places[0] * (speeds[1] - speeds[0]) / (places[1] - places[0])
    carried = sum(run[f"main_{k}.ring_force.y"] for k in range(1, 6))
    impulse = np.trapezoid(run["reaction.A.y"] - carried, run.t)
    momentum = model.parameters["mechanism.bodies.crankshaft.mass"] * (center[-1] - center[0])
    assert impulse == pytest.approx(momentum, abs=1e-4 * np.trapezoid(np.abs(carried), run.t))
    peaks = [np.max(np.abs(run[f"main_{k}.ring_force.y"])) for k in range(1, 6)]
    assert peaks[0] > 1.5 * peaks[2]  # the middle one has two cranks that never fire together


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('position = "80 mm"', 'position = "-60 mm"', "one place twice"),
        ('position = "80 mm"', "share = 0.5", "stiffnesses part its forces"),
        ('position = "80 mm"\n', "", "what the bearing carries is missing"),
        ("inner_ring = { damping", 'inner_ring = { mass = "1 kg", damping', "moves with the shaft that tilts"),
        ('transverse_inertia = "0.02 kg*m^2"\n', "", "only a shaft that tilts in its bearings"),
        ('mass = "4 kg"\n', "", "shaft.mass"),
        ('mass = "4 kg"\n', 'mass = "4 kg"\nbending_stiffness = "1e4 N*m^2"\n', "rigid: it tilts"),
    ],
)
def test_what_no_rigid_shaft_takes_is_refused(old: str, new: str, problem: str) -> None:
    with pytest.raises(SceneError, match=problem):
        scene_from_text(SCENE.replace(old, new), "tilting_rotor")


def test_offsets_without_a_shaft_that_tilts_are_refused() -> None:
    text = CRANK.replace('position = "100 mm"', 'position = "100 mm"\noffset = ["1 um", "0 um"]', 1)
    with pytest.raises(SceneError, match="a stiffness against it"):
        scene_from_text(text, "overhung_crank")
