"""Rating life of a run: readings against samples of the ball forces, lanes against single runs, derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.life import reference_life
from ballpass.runtime.ratings.of_bearing import ratings_of

READINGS = ("life_mean", "life_miner", "life_sectors")


def by_samples(model: Model, cycles: int, prefix: str = "") -> dict[str, float]:
    """Readings from fine samples of the ball forces, sectors counted as bins."""
    bearing = next(b for b in model.manifest.bearings if b.prefix == prefix)
    run = model.simulate(cycles=cycles, transient=1, samples_per_cycle=20000, rtol=1e-8)
    steady = np.asarray(run.t) > model.period()
    loads = np.maximum(np.asarray(run[f"{prefix}ball.force"]), 0.0)[steady]
    cubes, more = loads**3, loads ** (10 / 3)
    numbers = model.numbers({}).values
    mean = float(cubes.mean()) ** (1 / 3)
    by_ring = {
        "life_mean": (mean, float(more.mean()) ** 0.3),
        "life_miner": (mean, float((more.mean(axis=1) ** 0.9).mean()) ** (1 / 3)),
    }
    rated = ratings_of(bearing, numbers)
    balls = (rated.inner_ball, rated.outer_ball)
    found = {name: reference_life(balls, pair) for name, pair in by_ring.items()}
    # a shaft at constant speed in a ring at rest
    speed, cage = numbers[bearing.ring_speed], numbers[f"{bearing.path}.cage_speed"]
    first = numbers[f"{bearing.path}.ball_angle"] + 2 * np.pi * np.arange(bearing.balls) / bearing.balls
    rings = []
    for rate in (cage - speed, cage):
        place = (first + rate * np.asarray(run.t)[steady, None]) / (2 * np.pi) % 1.0
        field = np.histogram(place, bins=90, range=(0, 1), weights=cubes)[0] * 90 / cubes.size
        rings.append(float(np.mean(field ** (10 / 9))) ** 0.3)
    found["life_sectors"] = reference_life(balls, tuple(rings))
    return found


@pytest.mark.parametrize(
    ("scene", "cycles"), [("punching_press", 12), pytest.param("varying_compliance", 12, marks=pytest.mark.long)]
)
def test_readings_are_those_of_fine_samples(make_model: Callable[..., Model], scene: str, cycles: int) -> None:
    model = make_model(scene)
    table = {"bearing.clearance": [model.parameters["bearing.clearance"]]}
    found = model.simulate_many(table, READINGS, cycles=cycles, transient=1, rtol=1e-8, growth=False)
    for name, expected in by_samples(model, cycles).items():
        # bins and hat functions smear a field alike only in the limit
        allowed = 5e-3 if name == "life_sectors" else 2e-5
        assert float(found[name][0]) == pytest.approx(expected, rel=allowed), name


@pytest.mark.parametrize("ring", [pytest.param("inner", marks=pytest.mark.long), "outer"])
def test_under_a_load_that_stands_both_readings_agree_whichever_ring_turns(
    make_model: Callable[..., Model], ring: str
) -> None:
    """What ISO 16281 takes for granted holds there; with the rings the wrong way round the life is a tenth longer."""
    model = make_model("varying_compliance", ("[shaft]\n", f'[shaft]\nring = "{ring}"\n'))
    table = {"bearing.clearance": [0.0]}
    found = model.simulate_many(table, READINGS, cycles=40, transient=2, growth=False, rtol=1e-6)
    single = model.quantities(READINGS, cycles=40, transient=2, rtol=1e-6)
    (report,) = model.life(cycles=40, transient=2, rtol=1e-6).bearings
    assert (report.speed < 0.0) is (ring == "outer")  # of the inner ring against the outer one
    for name in READINGS:
        assert float(found[name][0]) == pytest.approx(report.lives["sectors"], rel=5e-3)
        assert single[name].value == pytest.approx(report.lives[name.removeprefix("life_")], rel=1e-3)


def test_the_ring_of_a_body_that_swings_stands(make_model: Callable[..., Model]) -> None:
    """The rod carries the inner ring, in which the force of a slider without inertia stands: all readings agree."""
    model = make_model(
        "punching_press_two_way",
        ('joint = "A"\ncoupling', 'joint = "B"\ncoupling'),
        ("count = 2 ", "count = 1 "),
        ('support = "elastic"\nmass = "0.555 kg"', 'support = "fixed"\n#mass = "0.555 kg"'),
        ('stiffness = "5e7 N/m"', "#"),
        ('damping = "500 N*s/m"', "#"),
        ('outer = ["0 um", "0 um"]\nouter_velocity = ["0 m/s", "0 m/s"]', ""),
        ("[bearing.outer_ring]", '[bearing.inner_ring]\nbody = "rod"\n[bearing.outer_ring]'),
        ('window = { start = "237 deg", end = "267 deg" }', ""),
        ('"outer.*", ', ""),
    )
    numbers = {"mechanism.driver.speed": 10.0}
    (report,) = model.life(cycles=20, transient=2, parameters=numbers).bearings
    single = model.quantities(READINGS, cycles=20, transient=2, parameters=numbers)
    lanes = model.simulate_many({name: [value] for name, value in numbers.items()}, READINGS, cycles=20, transient=2)
    for name in READINGS:
        found = report.lives[name.removeprefix("life_")], single[name].value, float(lanes[name][0])
        assert found == pytest.approx([report.lives["sectors"]] * 3, rel=0.02), name


@pytest.mark.long
def test_lanes_single_runs_and_quadrature_give_one_life(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    clearances = [8e-6, 10e-6, 12e-6]
    run = {"cycles": 4, "transient": 2, "rtol": 1e-8, "growth": False, "kinks": "stepped-over"}
    lanes, single = (
        model.simulate_many({"bearing.clearance": clearances}, READINGS, lanes=lanes, **run) for lanes in (True, False)
    )
    assert lanes.statistics.lanes > 1
    for name in READINGS:
        np.testing.assert_allclose(lanes[name], single[name], rtol=2e-5)
    report = model.sensitivity(of=[*READINGS, "life"], wrt=["mechanism.forces.punch.force.y"], cycles=4, transient=2)
    values = {quantity.name: quantity.value for quantity in report.quantities}
    for name in READINGS:
        assert values[name] == pytest.approx(float(single[name][1]), rel=1e-4)
    assert values["life"] == min(values[name] for name in READINGS)


@pytest.mark.long
@pytest.mark.extreme
def test_the_bearing_of_several_is_named(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_hinges")
    names = ["main.life_sectors", "big_end.life_sectors"]  # the pin swings
    found = model.simulate_many({"mechanism.gravity": [9.81]}, names, cycles=2, transient=1, growth=False)
    assert all(1e4 < float(found[name][0]) < 1e12 for name in names)
    with pytest.raises(RequestError, match=r"life_sectors is of a bearing. Write main.life_sectors or"):
        model.sensitivity(of=["life_sectors:inner.x"], wrt=["mechanism.gravity"])


@pytest.mark.long
def test_derivatives_of_life_are_verified_and_those_of_differences(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press_tangent")
    names = [
        *("bearing.clearance", "bearing.contact.inner_groove_radius"),
        *("mechanism.forces.punch.force.y", "mechanism.driver.speed"),
    ]
    report = model.sensitivity(of=["life", *READINGS], wrt=names, cycles=6, transient=2)
    assert report.verdicts[Verdict.VERIFIED] == len(report.pairs)
    for name in names:
        at = model.parameters[name]
        steps = at * np.array([-6e-4, -3e-4, 3e-4, 6e-4])
        run = {"cycles": 6, "transient": 2, "rtol": 1e-10, "kinks": "located", "growth": False}
        found = model.simulate_many({name: at + steps}, READINGS, **run)
        for reading in READINGS:
            far, near = (float(found[reading][k] - found[reading][3 - k]) / (steps[k] - steps[3 - k]) for k in (0, 1))
            slope = (4 * near - far) / 3
            value = float(np.mean(found[reading]))
            assert report[reading, name].derivative == pytest.approx(slope, rel=2e-3, abs=2e-4 * value / at), (
                reading,
                name,
            )
