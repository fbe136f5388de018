"""Gear pairs against absolute coordinates with multipliers and closed forms; what of them is refused."""

from __future__ import annotations

import io
import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from coupled_scenes import RUN, Derived, bearing, linkage_text
from linkages import GEARED, Machine, build, evaluate, geared_five_bar, planetary, sector
from quick_cases import long_but
from test_machines import FREE, check, freely, states

from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.mechanism.swing import Turns
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.variables import DRIVER_ANGLE
from ballpass.runtime import Model, RequestError
from ballpass.runtime.export.c_program import export_c
from ballpass.runtime.time.repetition import Repetition


@pytest.mark.parametrize("name", long_but(GEARED, "geared five-bar", "sector"))
def test_gears_turn_and_push_as_in_absolute_coordinates(name: str) -> None:
    """At constant speed and turning freely: accelerations, reactions, tooth forces along the line of pressure."""
    for driver in ("[mechanism.frame.points]", FREE):
        pair = freely(linkage_text(GEARED[name]()), driver)
        check(*pair, states(*pair, 4))


def two_wheels(torque: float, kind: str = "external", teeth: tuple[int, int] = (20, 50)) -> Machine:
    """Wheels without eccentricity, 70 mm apart (internal: 30 mm), a torque on the second."""
    wheel = {"mass": 1.0, "inertia": 2e-3, "points": {"axis": None}}
    apart = 0.07 if kind == "external" else 0.03
    return build(
        frame={"A": None, "E": ("xy", apart, 0.0)},
        bodies={"pinion": {**wheel, "points": {"axis": None, "B": 0.02}}, "wheel": {**wheel, "inertia": 3e-2}},
        joints={
            "A": {"bodies": ("frame", "pinion"), "points": ("A", "axis")},
            "E": {"bodies": ("frame", "wheel"), "points": ("E", "axis")},
        },
        gears={"G": {"kind": kind, "bodies": ("pinion", "wheel"), "teeth": teeth}},
        torques={"load": ("wheel", torque)},
        gravity=None,
        speed=10.0,
    )


@pytest.mark.parametrize("kind", ["external", "internal"])
@pytest.mark.parametrize("torque", [5.0, -5.0])
def test_teeth_push_along_the_line_of_pressure_and_apart(kind: str, torque: float) -> None:
    """Pitch radii 20 and 50 mm; F_t = M / r, F_n = F_t / cos 20 deg, radial F_t tan 20 deg: pinion and wheel are pushed
    apart, the pinion of a ring to the ring's centre, whichever flank carries."""
    derived = Derived(scene_from_text(linkage_text(two_wheels(torque, kind)) + RUN, "wheels"))
    found = derived.outputs(0.1, np.zeros(0), {})
    tangential, sense = abs(torque) / 0.05, 1 if kind == "internal" else -1
    assert found["gear.G.force"] == pytest.approx(tangential / math.cos(math.radians(20)), rel=1e-14)
    assert found["drive_torque"] == pytest.approx(-sense * torque * 20 / 50, rel=1e-14)
    assert found["reaction.G.x"] == pytest.approx(sense * tangential * math.tan(math.radians(20)), rel=1e-14)
    # the pinion holds the torque of the wheel's load: on its tooth at x = 20 mm, or -20 mm within the ring
    assert found["reaction.G.y"] == pytest.approx(sense * torque / 0.05 * (-sense), rel=1e-14)
    assert found["reaction.A.x"] == pytest.approx(found["reaction.G.x"], rel=1e-14)  # of the pinion on the frame
    assert found["reaction.E.y"] == pytest.approx(-found["reaction.G.y"], rel=1e-14)


def test_a_geared_rotor_accelerates_by_its_reduced_inertia() -> None:
    """J1 + i² J2."""
    constant = '[mechanism.driver.torque]\nlaw = "constant"\ntorque = "3 N*m"\n\n[mechanism.frame.points]'
    derived, _ = freely(linkage_text(two_wheels(0.0)), constant)
    (_, acceleration) = derived.rhs(0.0, np.array([0.3, 7.0]), {})
    assert acceleration == pytest.approx(3.0 / (2e-3 + (20 / 50) ** 2 * 3e-2), rel=1e-14)


def test_a_planet_of_half_the_ring_moves_its_pitch_circle_along_a_line() -> None:
    """Cardan's circles: a point on the planet's pitch circle goes straight through the centre of the ring."""
    machine = build(
        frame={"A": None},
        bodies={
            "arm": {"mass": 1.0, "inertia": 1e-3, "points": {"A": None, "P": 0.04}},
            "planet": {"mass": 1.0, "inertia": 1e-3, "points": {"P": None, "rim": 0.04}},
        },
        joints={"A": {"bodies": ("frame", "arm")}, "P": {"bodies": ("arm", "planet")}},
        gears={"G": {"kind": "internal", "bodies": ("frame", "planet"), "teeth": (60, 30)}},
        speed=10.0,
    )
    linkage = machine.linkage()
    angle = np.linspace(0.0, 6.0, 41)
    x, y = evaluate(machine, list(linkage.motion("planet", "rim").position), angle, linkage)
    assert x == pytest.approx(0.08 * np.cos(angle), abs=1e-16)
    assert y == pytest.approx(np.zeros(41), abs=1e-16)
    assert linkage.turns == 1


@pytest.mark.parametrize(
    ("teeth", "turns"),
    [((20, 40), 2), ((21, 28), 4), ((40, 20), 1), pytest.param((17, 23), 23, marks=pytest.mark.long)],
)
def test_a_machine_with_gears_repeats_after_the_turns_of_its_ratio(
    teeth: tuple[int, int], turns: int, model_of: Callable[..., Model]
) -> None:
    """Not before; and in turns far away the angle of the wheel is as exact as in the first ones."""
    text = linkage_text(geared_five_bar(teeth)) + '[run]\noutputs = ["drive_torque"]\n'
    scene = scene_from_text(text, "geared")
    assert scene.run.cycles == 50 + turns * math.ceil(10 / turns)
    model = model_of(text)
    assert Repetition.of(model.manifest, model.numbers().values).turns == turns
    at = 2 * math.pi / 30.0 * np.arange(0.37, 2 * turns)

    def torque(first: int) -> np.ndarray:
        times = at + 2 * math.pi / 30.0 * first
        return model.simulate(duration=float(times[-1]), times=times, transient=0)["drive_torque"]

    there, alike = torque(0), np.abs(torque(0)[:turns] - torque(0)[turns:])
    assert np.max(alike) < 1e-12 * np.max(np.abs(there))
    assert turns == 1 or np.max(np.abs(np.diff(there))) > 0.1 * np.max(np.abs(there))
    assert torque(100000 * turns) == pytest.approx(there, rel=0, abs=1e-8 * np.max(np.abs(there)))


def test_the_drive_does_no_work_over_all_turns_of_the_ratio() -> None:
    """Weights and inertia take and give; over one turn of two they do not."""
    machine = geared_five_bar((21, 28))
    derived = Derived(scene_from_text(linkage_text(machine).partition("[mechanism.torques")[0] + RUN, "geared"))
    times = 2 * math.pi / 30.0 * np.arange(0.0, 4.0, 1 / 64)
    torque = np.array([derived.outputs(t, np.zeros(0), {})["drive_torque"] for t in times])
    assert abs(np.mean(torque)) < 1e-12 * np.max(np.abs(torque))
    assert abs(np.mean(torque[:64])) > 1e-3 * np.max(np.abs(torque))


@pytest.mark.long
@pytest.mark.parametrize("where", [("D", "right"), ("C", "left")])
def test_runs_with_a_bearing_agree(where: tuple[str, str], model_of: Callable[..., Model], tmp_path: Path) -> None:
    """The stepper alone, in lanes, in an exported program, and CasADi's integrator; rods that turn with the wheel."""
    machine = geared_five_bar().with_values(mechanism__driver__start_angle=6.8)  # in the second turn
    model = model_of(linkage_text(machine) + bearing(*where, law='law = "none"') + RUN)
    run = {"cycles": 0.05, "transient": 0}
    single = model.simulate(**run, method="stepper", rtol=1e-10)
    other = model.simulate(**run, method="cvodes", rtol=1e-11)
    for name in (*single.states, "drive_torque", "gear.G.force"):
        assert np.median(np.abs(single[name] - other[name])) <= 1e-5 * np.max(np.abs(single[name])) + 1e-12, name
    folder = export_c(model.folder, tmp_path / "c")
    subprocess.run(["make", "-s", "-C", str(folder)], check=True, timeout=300)
    arguments = [str(folder / "scene"), "--cycles", "0.05", "--rtol", "1e-10"]
    printed = subprocess.run(arguments, capture_output=True, text=True, check=True, timeout=300).stdout
    columns = np.loadtxt(io.StringIO(printed), delimiter=",", skiprows=1, ndmin=2)
    assert np.array_equal(columns[:, 1 : 1 + len(model.states)], single.x)


def test_turns_of_a_body_are_counted_over_all_turns_of_the_ratio() -> None:
    """Of one that turns once in two turns of the driver: half a turn in each."""
    half = Turns(sp.cos(DRIVER_ANGLE / 2), sp.sin(DRIVER_ANGLE / 2), DRIVER_ANGLE, sp.Integer(1), 2)
    assert float(Visitor({}, {})(half)) == 0.5


def test_a_dyad_that_fails_in_the_second_turn_alone_is_refused(model_of: Callable[..., Model]) -> None:
    shifted = {"mechanism__bodies__left__points__C": 0.044, "mechanism__gears__G__second_angle": 1.4 + math.pi}
    machine = geared_five_bar().with_values(**shifted)
    with pytest.raises(RequestError, match="cannot be assembled at joint 'C'") as caught:
        model_of(linkage_text(machine) + RUN).check_assembly()
    degrees = float(str(caught.value).partition("crank angle ")[2].split()[0])
    assert degrees > 360.0


def test_a_sector_that_comes_round_is_refused(model_of: Callable[..., Model]) -> None:
    machine = sector().with_values(mechanism__gears__G__second_angle=-1.2)
    with pytest.raises(RequestError, match=r"at joint 'F'.*how far the other wheel is from half a turn"):
        model_of(linkage_text(machine) + RUN).check_assembly()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            linkage_text(two_wheels(1.0)).replace(
                "['frame', 'wheel']\npoints = ['E',", "['pinion', 'wheel']\npoints = ['B',"
            ),
            "no body that carries both",
        ),
        (linkage_text(two_wheels(1.0)) + bearing("E", "wheel"), "play would move an axis of gear G"),
        (linkage_text(planetary()) + bearing("S", "sun"), "play would move an axis of gear free"),
        (linkage_text(two_wheels(1.0)).replace("gears.G", "gears.A"), "a joint has this name"),
        (linkage_text(two_wheels(1.0, "internal")).replace("[20, 50]", "[20, 20]"), "unlike numbers of teeth"),
        (linkage_text(two_wheels(1.0)).replace("[20, 50]", "[20.5, 50]"), "not a whole number"),
        (linkage_text(two_wheels(1.0)).replace("[20, 50]", "20"), "not a list of two whole numbers"),
        (linkage_text(two_wheels(1.0)).replace("['pinion', 'wheel']", "['wheel', 'wheel']"), "gear of a body with it"),
        (linkage_text(two_wheels(1.0)).partition("[mechanism.gears")[0], "mobility 2"),
        (linkage_text(two_wheels(1.0)).replace('["0.07 m", "0.0 m"]', '"origin"'), "is a length zero"),
    ],
    ids=["carrier", "play", "play of a sun", "name", "ring", "teeth", "one number", "itself", "no gear", "one axis"],
)
def test_what_is_no_gear_pair_is_refused(text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Derived(scene_from_text(text + RUN, "wheels"))


WHEEL = """
[bearing]
joint = "E"
share = 0.5
designation = "6204"
clearance = "5 um"
[bearing.damping]
law = "tangent"
ratio = "2.5e-5 s"
[bearing.inner_ring]
mass = "2 kg"
damping = "300 N*s/m"
[bearing.outer_ring]
support = "fixed"
"""
STEADY = '[run]\ncycles = 2\ntransient_cycles = 0\nrtol = 1e-11\nsamples_per_cycle = 100\noutputs = ["inner.*"]\n'


@pytest.mark.long
def test_a_bearing_loaded_one_way_turns_with_its_wheel(model_of: Callable[..., Model]) -> None:
    """At the axis of a wheel under a constant torque it is one on a shaft of the wheel's speed, under its reaction."""
    machine = linkage_text(two_wheels(30.0))
    geared = model_of(machine + WHEEL + STEADY.replace('"inner.*"', '"inner.*", "reaction.E.*"'))
    run = geared.simulate()
    force = [float(run[f"reaction.E.{axis}"][0]) for axis in "xy"]
    assert np.hypot(*force) == pytest.approx(30.0 / 0.05 / math.cos(math.radians(20)), rel=1e-12)
    load = f'[load]\ntype = "constant"\nforce = ["{force[0]!r} N", "{force[1]!r} N"]\n'
    shaft = f'[shaft]\nspeed = "{-10.0 * 20 / 50!r} rad/s"\n{load}'
    alone = model_of(shaft + WHEEL.replace('joint = "E"\n', "") + STEADY)
    other = alone.simulate(duration=float(run.t[-1]), sample_rate=(len(run.t) - 1) / float(run.t[-1]))
    np.testing.assert_allclose(run.x, other.x, rtol=0.0, atol=1e-8 * np.max(np.abs(other.x)))
    numbers, names = geared.numbers().values, ("ring_speed", "cage_speed")
    assert [numbers[f"bearing.{name}"] for name in names] == pytest.approx(
        [-4.0, alone.numbers().values["bearing.cage_speed"]], rel=1e-12
    )
    life = geared.life(cycles=2, transient=0).bearings[0], alone.life(cycles=0.8, transient=0).bearings[0]
    assert life[0].speed == pytest.approx(life[1].speed, rel=1e-9)
    assert life[0].life == pytest.approx(life[1].life, rel=1e-6)


def test_the_frame_may_be_either_body_at_a_wheel_on_a_bearing_loaded_one_way() -> None:
    """With the bodies of its joint exchanged the reaction has the other sign, and the bearing the same load."""
    machine, at = two_wheels(30.0), WHEEL + RUN
    given = machine.mechanism.joint("E")
    other = machine.with_joint("E", bodies=given.bodies[::-1], points=given.points[::-1])
    x = np.array([2e-6, -1e-6, 0.01, 0.02])
    one, two = (Derived(scene_from_text(linkage_text(m) + at, "w")) for m in (machine, other))
    found, exchanged = (derived.outputs(0.1, x, {}) for derived in (one, two))
    for axis in "xy":
        assert exchanged[f"load.{axis}"] == pytest.approx(found[f"load.{axis}"], rel=1e-13)
        assert exchanged[f"reaction.E.{axis}"] == pytest.approx(-found[f"reaction.E.{axis}"], rel=1e-13)
    np.testing.assert_allclose(two.rhs(0.1, x, {}), one.rhs(0.1, x, {}), rtol=1e-12)


@pytest.mark.parametrize(
    ("machine", "at", "words"),
    [
        (two_wheels(30.0), 'joint = "E"\nposition = "10 mm"', "those of the driven body"),
        (geared_five_bar(), 'joint = "B"\nshare = 0.5', "or hold a wheel of a gear to the frame"),
    ],
)
def test_a_bearing_loaded_one_way_is_refused_elsewhere(machine: Machine, at: str, words: str) -> None:
    text = linkage_text(machine) + WHEEL.replace('joint = "E"\nshare = 0.5', at) + STEADY
    with pytest.raises(SceneError, match=words):
        scene_from_text(text, "elsewhere")
