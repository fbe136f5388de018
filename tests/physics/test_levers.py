"""Two bearings at places along the shaft carry forces by levers, with the same sum and the same moment."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model

SCENE = (Path(__file__).parent / "overhung_crank.toml").read_text(encoding="utf-8")
CRANK = "mechanism.bodies.crank"


@pytest.fixture(scope="module")
def crank(model_of: Callable[..., Model]) -> Model:
    return model_of(SCENE, "overhung_crank")


def pair(values: dict[str, float], name: str) -> np.ndarray:
    return np.array([values[f"{name}.x"], values[f"{name}.y"]])


def test_an_overhung_crank_loads_its_bearings_by_levers(crank: Model) -> None:
    """Overhung by 40 mm in front of two bearings 60 mm apart: 5/3 and -2/3 of the force, the printed shares."""
    constants = crank.constants()
    assert constants["bearings.front.share"] == pytest.approx(5.0 / 3.0, rel=1e-15)
    assert constants["bearings.rear.share"] == pytest.approx(-2.0 / 3.0, rel=1e-15)
    words = " ".join(str(crank.explain()).split())
    assert "Levers: of a force in the plane that positions count from carry front 1.67, rear -0.667" in words


@pytest.mark.parametrize("seed", range(20))
def test_loads_of_random_layouts_balance_forces_and_moments(crank: Model, seed: int) -> None:
    """Forces on the crank by hand: rod, belt, weight, and inertia of a mass that goes round at a constant speed."""
    draw = np.random.default_rng([seed, 46])
    mass, x, y, front, rear, pulley, center, pin = draw.uniform(
        [1, -0.02, -0.02, *[-0.2] * 5], [5, 0.02, 0.02, *[0.2] * 5]
    )
    numbers = {
        f"{CRANK}.mass": mass,
        f"{CRANK}.center_of_mass.x": x,
        f"{CRANK}.center_of_mass.y": y,
        f"{CRANK}.positions.pulley": pulley,
        f"{CRANK}.positions.center_of_mass": center,
        f"{CRANK}.positions.B": pin,
        "bearings.front.position": front,
        "bearings.rear.position": rear,
    }
    time, speed = draw.uniform(0.0, 0.05), crank.parameters["mechanism.driver.speed"]
    values = crank.evaluate(time, parameters=numbers)
    turned = np.array(
        [[math.cos(speed * time), -math.sin(speed * time)], [math.sin(speed * time), math.cos(speed * time)]]
    )
    inertia = mass * speed**2 * (turned @ [x, y]) - np.array([0.0, 9.81 * mass])
    forces = [(pin, pair(values, "reaction.B")), (pulley, np.array([200.0, 0.0])), (center, inertia)]
    carried = [(front, pair(values, "front.load")), (rear, pair(values, "rear.load"))]
    size = max(np.abs(force).max() for _, force in (*forces, *carried))
    assert sum(force for _, force in carried) == pytest.approx(sum(force for _, force in forces), abs=1e-12 * size)
    moment = sum(place * force for place, force in forces)
    assert sum(place * force for place, force in carried) == pytest.approx(moment, abs=1e-12 * size)


def test_unbalances_in_two_planes_are_a_couple(model_of: Callable[..., Model]) -> None:
    """Two opposite unbalances 100 mm apart load bearings 200 mm apart by half of either, in opposite directions."""
    bearing = """
[bearings.{name}]
designation = "6204"
position = "{place}"
damping = {{ law = "none" }}
inner_ring = {{ mass = "1 kg", damping = "1000 N*s/m" }}
outer_ring = {{ support = "fixed" }}
"""
    load = """
[loads.{name}]
type = "unbalance"
mass = "10 g"
eccentricity = "20 mm"
angle = "{angle}"
position = "{place}"
"""
    text = '[shaft]\nspeed = "3000 rpm"\n[run]\ncycles = 2\noutputs = ["*load*"]\n'
    text += bearing.format(name="one", place="-100 mm") + bearing.format(name="two", place="100 mm")
    text += load.format(name="left", angle="0 deg", place="-50 mm") + load.format(
        name="right", angle="180 deg", place="50 mm"
    )
    model = model_of(text, "couple")
    force = 0.01 * 0.02 * model.parameters["shaft.speed"] ** 2
    values = model.evaluate(0.0)
    assert values["one.load.x"] == pytest.approx(0.5 * force, rel=1e-12)
    assert values["two.load.x"] == pytest.approx(-0.5 * force, rel=1e-12)
    static = model.evaluate(0.0, parameters={"loads.right.angle": 0.0, "loads.left.position": 0.05})
    assert [static[f"{name}.load.x"] for name in ("one", "two")] == pytest.approx([0.5 * force, 1.5 * force], rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('position = "100 mm"', "share = 0.5", "bearings.front.position"),
        ('position = "100 mm"', 'position = "40 mm"', "one place twice"),
        ('position = "100 mm"', 'position = "100 mm"\nshare = 0.5', "is given twice"),
        ('position = "100 mm"', 'coupling = "two-way"', "bearings.front"),
        ('pulley = "150 mm"', 'pully = "150 mm"', 'did you mean "pulley"'),
        ('pulley = "150 mm"', 'pulley = "150 mm", A = "5 mm"', "positions.A .* no place along the shaft of its own"),
        (
            'points = { B = "origin", C = "120 mm" }',
            'points = { B = "origin", C = "120 mm" }\npositions = { C = "1 mm" }',
            "mechanism.bodies.rod.positions",
        ),
    ],
)
def test_places_that_no_levers_take_are_refused(old: str, new: str, problem: str) -> None:
    with pytest.raises(SceneError, match=problem):
        scene_from_text(SCENE.replace(old, new), "overhung_crank")
