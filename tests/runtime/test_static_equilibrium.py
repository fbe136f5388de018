"""Claims about static equilibrium: reference values, Hertz's power law, implicit derivatives."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from ballpass.runtime import Model
from ballpass.runtime.certify.differences import richardson
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.point.equilibrium import FreeRingWarning, StaticEquilibrium

GIVEN = 'stiffness = "13.34e9 N/m^1.5"'
HERTZ = """inner_groove_radius = "4.1275 mm"
outer_groove_radius = "4.206875 mm"
young_modulus = "207 GPa"
poisson_ratio = 0.3"""
BETWEEN = math.pi / 8


@pytest.fixture(scope="module")
def bearing_6204(make_virtual: Callable[..., Model]) -> Model:
    return make_virtual("varying_compliance", (GIVEN, HERTZ))


@pytest.fixture(scope="module")
def press(make_virtual: Callable[..., Model]) -> Model:
    """In the virtual machine: nothing here is evaluated often."""
    return make_virtual("punching_press_tangent")


@pytest.mark.parametrize(
    ("clearance", "angle", "displacement", "largest"),
    [
        (0.0, 0.0, 15.8057e-6, 543.21),
        (0.0, BETWEEN, 15.9145e-6, 487.38),
        (10e-6, 0.0, 21.7348e-6, 591.81),
        (10e-6, BETWEEN, 21.9984e-6, 518.56),
    ],
)
def test_6204_under_1000_newton(
    bearing_6204: Model, clearance: float, angle: float, displacement: float, largest: float
) -> None:
    found = bearing_6204.static_equilibrium(
        parameters={"bearing.clearance": clearance, "bearing.ball_angle": angle}, load=(1000.0, 0.0)
    )
    assert found["inner.x"] == pytest.approx(displacement, abs=6e-11)
    assert found.peak_ball_force == pytest.approx(largest, abs=6e-3)
    assert found.residual <= 1e-9
    if clearance == angle == 0.0:  # a ball on the load line
        assert 8 * found.peak_ball_force / 1000.0 == pytest.approx(
            8 / (1 + 2 * math.cos(math.pi / 4) ** 2.5), rel=1e-10
        )


def test_deflection_follows_the_two_thirds_power_of_the_load(bearing_6204: Model) -> None:
    """Zero clearance: every load a multiple of the first; and d(delta)/dF = (2/3) delta/F by the implicit function."""
    parameters = {"bearing.clearance": 0.0, "bearing.ball_angle": 0.1}
    at = [bearing_6204.static_equilibrium(parameters=parameters, load=(f, 0.0)) for f in (1e-3, 100.0, 3e5)]
    for one, force in zip(at, (1e-3, 100.0, 3e5), strict=True):
        assert one.positions == pytest.approx(at[1].positions * (force / 100.0) ** (2 / 3), rel=1e-9, abs=0.0)
    own = bearing_6204.static_equilibrium(parameters={**parameters, "load.force.x": 300.0, "load.force.y": 0.0})
    slope = own.derivative("positions", "load.force.x")
    assert slope == pytest.approx(own.positions * (2 / 3) / 300.0, rel=1e-9, abs=0.0)


@pytest.mark.parametrize("clearance", [-8e-6, 0.0, 10e-6, 1e-3])
@pytest.mark.parametrize("load", [(0.01, 0.0), (30.0, 70.0), (-5000.0, 900.0)])
def test_equilibrium_is_the_minimum_of_the_potential_energy(
    bearing_6204: Model, clearance: float, load: tuple[float, float]
) -> None:
    """V = (2/5) k sum (delta_+)^2.5 - F q, minimised without derivatives from another start, in scaled units."""
    parameters = {"bearing.clearance": clearance, "bearing.ball_angle": 0.2}
    found = bearing_6204.static_equilibrium(parameters=parameters, load=load)
    k_b = bearing_6204.constants()["bearing.k_b"]
    angles = 0.2 + 2 * np.pi * np.arange(8) / 8

    def net(q: np.ndarray) -> np.ndarray:
        delta = np.maximum(q[0] * np.cos(angles) + q[1] * np.sin(angles) - clearance / 2, 0.0)
        force = k_b * delta**1.5
        return np.array(load) - np.array([force @ np.cos(angles), force @ np.sin(angles)])

    size = math.hypot(*load)
    assert np.max(np.abs(net(found.positions))) <= 1e-9 * size + 1e-9
    unit = float(np.max(np.abs(found.positions)))

    def energy(z: np.ndarray) -> float:
        q = unit * z
        delta = np.maximum(q[0] * np.cos(angles) + q[1] * np.sin(angles) - clearance / 2, 0.0)
        return float((0.4 * k_b * np.sum(delta**2.5) - q @ np.array(load)) / (size * unit))

    best = minimize(energy, found.positions / unit * 1.3, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-14})
    assert energy(found.positions / unit) <= best.fun + 1e-12 + 1e-15 * abs(best.fun)


def test_equilibrium_of_elastic_rings_is_a_point_of_rest(press: Model) -> None:
    """With the shaft standing nothing is accelerated there, whatever the damping law; the housing carries the load."""
    parameters = {"mechanism.driver.speed": 0.0, "mechanism.driver.start_angle": math.radians(240.0)}
    found = press.static_equilibrium(parameters=parameters)
    numbers = press.numbers(parameters)
    rate = press.kernel("rhs")(
        {"t": 0.0, "x": found.x, "u": press.inputs_at(0.0, parameters), "p": numbers.p, "c": numbers.c}
    )
    assert np.max(np.abs(rate)) <= 1e-8
    housing = press.parameters["bearing.outer_ring.stiffness"] * found.positions[2:]
    assert housing == pytest.approx(np.array(found.load), rel=1e-11)


def test_crank_angle_and_time_name_the_same_instant(press: Model) -> None:
    speed = press.numbers().values["mechanism.driver.speed"]
    by_angle = press.static_equilibrium(crank_angle=math.radians(240.0))
    by_time = press.static_equilibrium(math.radians(240.0) / speed)
    assert by_angle.positions == pytest.approx(by_time.positions, rel=1e-9, abs=0.0)
    # largest force of the crank on the frame, half of it on this bearing
    assert by_angle.load[1] == pytest.approx(8487.1 / 2, rel=2e-5)


@pytest.mark.parametrize(
    "name",
    [
        "bearing.clearance",
        "bearing.contact.inner_groove_radius",
        "bearing.pitch_diameter",
        "bearing.outer_ring.stiffness",
        "mechanism.bodies.crank.points.B",
        "mechanism.bodies.slider.mass",
        "mechanism.driver.speed",
        "mechanism.forces.punch.force.y",
    ],
)
def test_implicit_derivative_agrees_with_extrapolated_differences(press: Model, name: str) -> None:
    t = 0.0811  # within the punch window
    found = press.static_equilibrium(t)
    of = ["ball.deflection", "ball.elastic_force"]

    def at(value: float) -> np.ndarray:
        e = press.static_equilibrium(t, parameters={name: value})
        return np.concatenate([e.positions * 1e6, e.deflection * 1e6, e.ball_force])

    value = press.parameters[name]
    second = richardson(at, value, 1e-3 * abs(value))
    first = np.concatenate([found.derivative("positions", name), found.derivative(of, name)])
    first[:12] *= 1e6
    noise = 1e-7 * float(np.max(np.abs(first)))
    assert first == pytest.approx(second.value, rel=1e-7, abs=noise)
    assert np.any(first != 0.0)


@pytest.mark.parametrize(
    "name", ["start_angle", "table.time.1", "table.time.2", "table.speed.1", "table.speed.2", "table.speed.3", "time"]
)
def test_derivatives_follow_a_driver_whose_angle_is_a_state(make_virtual: Callable[..., Model], name: str) -> None:
    table = 'table = { time = ["1 ms", "30 ms", "200 ms"], speed = ["100 rpm", "400 rpm", "700 rpm"] }'
    model, t, path = make_virtual("punching_press", ('speed = "500 rpm"', table)), 0.02, f"mechanism.driver.{name}"
    rest = model.static_equilibrium(t)
    here = t if name == "time" else model.parameters[path]
    step = 1e-4 * (here or 1.0)

    def beside(side: float) -> StaticEquilibrium:
        moved = here + side * step
        return (
            model.static_equilibrium(moved) if name == "time" else model.static_equilibrium(t, parameters={path: moved})
        )

    above, below = beside(1.0), beside(-1.0)
    by = "time" if name == "time" else path
    for found, one, other in (
        (rest.derivative("positions", by), above.positions, below.positions),
        (rest.derivative("ball.elastic_force", by), above.ball_force, below.ball_force),
    ):
        differences = (one - other) / (2.0 * step)
        assert found == pytest.approx(differences, rel=1e-4, abs=1e-5 * float(np.max(np.abs(differences)) + 1e-300))


def test_a_given_load_does_not_move_with_the_machine(press: Model) -> None:
    found = press.static_equilibrium(0.0811, load=(100.0, 3000.0))
    own = press.static_equilibrium(0.0811).derivative("positions", "mechanism.bodies.slider.mass")
    given = found.derivative("positions", "mechanism.bodies.slider.mass")
    assert np.max(np.abs(given)) <= 1e-14 * np.max(np.abs(own))
    assert np.any(found.derivative("positions", "bearing.clearance"))


def test_one_loaded_ball_leaves_the_ring_free_sideways(bearing_6204: Model) -> None:
    parameters = {"bearing.clearance": 1e-3}
    with pytest.warns(FreeRingWarning, match=r"inner\.y"):
        found = bearing_6204.static_equilibrium(parameters=parameters, load=(1000.0, 0.0))
    assert np.abs(found.free_directions) == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-12)
    assert np.count_nonzero(found.ball_force) == 1
    k_b = bearing_6204.constants()["bearing.k_b"]
    assert found["inner.x"] == pytest.approx(0.5e-3 + (1000.0 / k_b) ** (2 / 3), rel=1e-12, abs=0.0)
    with pytest.raises(RequestError, match="free to move"):
        found.derivative("positions", "bearing.clearance")


def test_a_ball_that_only_touches_holds_no_ring(bearing_6204: Model) -> None:
    """The ring leans on a second ball with what rounding of the first one's angle makes of the load: 0.7 nN of 50 N."""
    parameters = {"bearing.clearance": 2e-5, "bearing.ball_angle": 1e-11}
    with pytest.warns(FreeRingWarning, match=r"inner\.y"):
        found = bearing_6204.static_equilibrium(parameters=parameters, load=(50.0, 0.0))
    assert np.sort(found.ball_force)[-2] < 1e-9
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bearing_6204.static_equilibrium(parameters={**parameters, "bearing.ball_angle": 1e-4}, load=(50.0, 0.0))


def test_what_cannot_be_in_equilibrium_is_refused(bearing_6204: Model, press: Model) -> None:
    with pytest.raises(RequestError, match="may stand anywhere"):
        bearing_6204.static_equilibrium(parameters={"bearing.clearance": 1e-5}, load=(0.0, 0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        preloaded = bearing_6204.static_equilibrium(parameters={"bearing.clearance": -1e-5}, load=(0.0, 0.0))
    assert np.max(np.abs(preloaded.positions)) <= 1e-18
    with pytest.raises(SimulationError, match="housing"):
        press.static_equilibrium(0.08, parameters={"bearing.outer_ring.stiffness": 0.0})
    with pytest.raises(RequestError, match="two finite numbers"):
        bearing_6204.static_equilibrium(load=(1.0, math.nan))
    with pytest.raises(RequestError, match="one of the two"):
        press.static_equilibrium(0.1, crank_angle=1.0)


def test_degrees_in_place_of_radians_are_asked_about(press: Model) -> None:
    for ask in (press.static_equilibrium, press.linearize):
        with pytest.raises(RequestError, match="Were degrees meant"):
            ask(crank_angle=240)
    two_turns_back = press.static_equilibrium(crank_angle=math.radians(240.0) - 4.0 * math.pi)
    np.testing.assert_allclose(
        two_turns_back.positions, press.static_equilibrium(crank_angle=math.radians(240.0)).positions, rtol=1e-9
    )


@pytest.mark.parametrize("load", ["196 N", (1.0, 2.0, 3.0), ("196 N", "0 N"), 5.0])
def test_a_load_that_is_no_pair_of_numbers_is_refused(press: Model, load: object) -> None:
    with pytest.raises(RequestError, match="two finite numbers, x and y"):
        press.static_equilibrium(load=load)  # type: ignore[arg-type]


def test_one_line_says_what_it_is_and_print_shows_every_ball(press: Model) -> None:
    found = press.static_equilibrium(crank_angle=4.2)
    assert "\n" not in repr(found)
    assert f"{found.peak_ball_force:.6g} N" in repr(found)
    assert sum(line.strip().startswith("ball ") for line in str(found).splitlines()) == len(found.ball_force)
    small = press.linearize(crank_angle=4.2)
    assert "\n" not in repr(small)
    assert f"{small.natural_frequencies[0]:.6g}" in repr(small)
    assert "0.00∠" not in str(small)


@pytest.mark.long
def test_angles_of_an_engine_count_over_both_turns_of_its_cycle(make_model: Callable[..., Model]) -> None:
    """400 degrees are not 40: the gas presses in one of two turns only."""
    model = make_model("engine")
    speed = model.parameters["mechanism.driver.speed"]
    for degrees in (40.0, 400.0, -320.0):
        angle = math.radians(degrees)
        rest = model.static_equilibrium(crank_angle=angle)
        assert rest.time == pytest.approx(angle % (4.0 * math.pi) / speed, rel=1e-9)
        assert rest.load == pytest.approx(model.static_equilibrium(t=rest.time).load, rel=1e-9)
    turns = [model.static_equilibrium(crank_angle=math.radians(degrees)).peak_ball_force for degrees in (40.0, 400.0)]
    assert turns[0] > 1.3 * turns[1]
