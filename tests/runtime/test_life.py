"""Rating life of a run: against samples of the ball forces, lanes against single runs, derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.life import reference_life
from ballpass.runtime.ratings.of_bearing import ratings_of


def by_samples(model: Model, cycles: int) -> float:
    """Life from fine samples of the ball forces, places counted as bins."""
    (bearing,) = model.manifest.bearings
    run = model.simulate(cycles=cycles, transient=1, samples_per_cycle=20000, rtol=1e-8)
    steady = np.asarray(run.t) > model.period()
    cubes = np.maximum(np.asarray(run["ball.force"]), 0.0)[steady] ** 3
    numbers = model.numbers({}).values
    rated = ratings_of(bearing, numbers)
    # a shaft at constant speed in a ring at rest
    speed, cage = numbers[bearing.ring_speed], numbers[f"{bearing.path}.cage_speed"]
    first = numbers[f"{bearing.path}.ball_angle"] + 2 * np.pi * np.arange(bearing.balls) / bearing.balls
    rings = []
    for rate in (cage - speed, cage):
        place = (first + rate * np.asarray(run.t)[steady, None]) / (2 * np.pi) % 1.0
        field = np.histogram(place, bins=90, range=(0, 1), weights=cubes)[0] * 90 / cubes.size
        rings.append(float(np.mean(field ** (10 / 9))) ** 0.3)
    return float(reference_life((rated.inner_ball, rated.outer_ball), (rings[0], rings[1])))


@pytest.mark.parametrize(
    ("scene", "cycles"), [("punching_press", 12), pytest.param("varying_compliance", 12, marks=pytest.mark.long)]
)
def test_a_life_is_that_of_fine_samples(make_model: Callable[..., Model], scene: str, cycles: int) -> None:
    model = make_model(scene)
    table = {"bearing.clearance": [model.parameters["bearing.clearance"]]}
    found = model.simulate_many(table, ["life"], cycles=cycles, transient=1, rtol=1e-8)
    # bins and hat functions smear a field alike only in the limit
    assert float(found["life"][0]) == pytest.approx(by_samples(model, cycles), rel=5e-3)


@pytest.mark.parametrize("ring", [pytest.param("inner", marks=pytest.mark.long), "outer"])
def test_under_a_load_that_stands_a_life_is_that_of_iso_16281_whichever_ring_turns(
    make_model: Callable[..., Model], ring: str
) -> None:
    """With the rings the wrong way round the life is a tenth longer."""
    model = make_model("varying_compliance", ("[shaft]\n", f'[shaft]\nring = "{ring}"\n'))
    span = {"cycles": 40, "transient": 2, "rtol": 1e-6}
    found = model.simulate_many({"bearing.clearance": [0.0]}, ["life"], **span)  # type: ignore[arg-type]
    (report,) = model.life(parameters={"bearing.clearance": 0.0}, **span).bearings  # type: ignore[arg-type]
    assert (report.speed < 0.0) is (ring == "outer")  # of the inner ring against the outer one
    assert float(found["life"][0]) == pytest.approx(report.life, rel=1e-3)
    assert report.life == pytest.approx(by_means(model, ring), rel=5e-3)


def by_means(model: Model, turning: str) -> float:
    """ISO 16281: cubic mean of the ring that turns, the mean of exponent 10/3 of the one that stands."""
    run = model.simulate(cycles=40, transient=2, parameters={"bearing.clearance": 0.0}).steady()
    loads = np.maximum(np.asarray(run["ball.force"]), 0.0)
    turns, stands = float(np.mean(loads**3)) ** (1 / 3), float(np.mean(loads ** (10 / 3))) ** 0.3
    rated = ratings_of(model.manifest.bearings[0], model.numbers({}).values)
    loads_of_rings = (turns, stands) if turning == "inner" else (stands, turns)
    return float(reference_life((rated.inner_ball, rated.outer_ball), loads_of_rings))


@pytest.mark.long
def test_lanes_single_runs_and_quadrature_give_one_life(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    clearances = [8e-6, 10e-6, 12e-6]
    run = {"cycles": 4, "transient": 2, "rtol": 1e-8, "kinks": "stepped-over"}
    lanes, single = (
        model.simulate_many({"bearing.clearance": clearances}, ["life"], lanes=lanes, **run) for lanes in (True, False)
    )
    assert lanes.statistics.lanes > 1
    np.testing.assert_allclose(lanes["life"], single["life"], rtol=2e-5)
    report = model.sensitivity(of=["life"], wrt=["mechanism.forces.punch.force.y"], cycles=4, transient=2)
    assert report.quantities[0].value == pytest.approx(float(single["life"][1]), rel=1e-4)


def test_the_static_safety_is_that_of_the_life_and_follows_sizes_and_load(make_model: Callable[..., Model]) -> None:
    """s_0 = 5 C_0/(Z Q) of the peak Q."""
    model = make_model("punching_press")
    run = {"cycles": 3, "transient": 1, "rtol": 1e-9}
    found = model.quantities(["s_0", "peak_ball_force"], kinks="located", **run)  # type: ignore[arg-type]
    report = model.life(**run).bearings[0]  # type: ignore[arg-type]
    assert found["s_0"].value == pytest.approx(report.static_safety, rel=1e-6)
    static = 5.0 * report.static_rating / 8 / found["peak_ball_force"].value
    assert found["s_0"].value == pytest.approx(static, rel=1e-12)
    by = model.sensitivity("s_0", ["bearing.ball_diameter", "bearing.clearance"], cycles=3, transient=1)
    assert by.verdicts[Verdict.VERIFIED] == 2
    assert by["s_0", "bearing.ball_diameter"].dimensionless > 2.0  # of C_0 alone


@pytest.mark.long
@pytest.mark.extreme
def test_the_bearing_of_several_is_named(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_hinges")
    names = ["main.life", "big_end.life"]  # the pin swings
    found = model.simulate_many({"mechanism.gravity": [9.81]}, names, cycles=2, transient=1)
    assert all(1e4 < float(found[name][0]) < 1e12 for name in names)
    with pytest.raises(RequestError, match=r"life is of a bearing. Write main.life or"):
        model.sensitivity(of=["life:inner.x"], wrt=["mechanism.gravity"])


@pytest.mark.long
def test_derivatives_of_life_are_verified_and_those_of_differences(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_tangent")
    names = [
        *("bearing.clearance", "bearing.contact.inner_groove_radius"),
        *("mechanism.forces.punch.force.y", "mechanism.driver.speed"),
    ]
    report = model.sensitivity(of=["life"], wrt=names, cycles=6, transient=2)
    assert report.verdicts[Verdict.VERIFIED] == len(report.pairs)
    for name in names:
        at = model.parameters[name]
        steps = at * np.array([-6e-4, -3e-4, 3e-4, 6e-4])
        run = {"cycles": 6, "transient": 2, "rtol": 1e-10, "kinks": "located"}
        found = np.asarray(model.simulate_many({name: at + steps}, ["life"], **run)["life"])
        far, near = (float(found[k] - found[3 - k]) / (steps[k] - steps[3 - k]) for k in (0, 1))
        slope, allowed = (4 * near - far) / 3, 2e-4 * float(np.mean(found)) / at
        assert report["life", name].derivative == pytest.approx(slope, rel=2e-3, abs=allowed), name
