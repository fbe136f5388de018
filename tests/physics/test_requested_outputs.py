"""Claims about outputs on request: motion of points and bodies, powers, Hertz's contact; exact, and free elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from coupled_scenes import GATED, ONE_SIDED, Derived, bearing, with_bearings
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from ballpass.derive import derive
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.scene.records import Scene
from ballpass.runtime.request.request import on_request

SCENES = Path(__file__).resolve().parents[2] / "scenes"
MOTION = ("*inner.a[xy]", "*outer.a[xy]", "point.*", "body.*.speed", "body.*.acceleration", "reaction.*.magnitude")
POWER = (
    "*.power",
    "*.loss",
    "*_energy",
    "*.energy",
    "*cage.moment",
    "drive_power",
    "applied_power",
    "dissipated_power",
)
HERTZ = ("contact.stiffness.*", "ball.stiffness", "ball.*_pressure", "ball.*_axis", "ball.*_approach")

SPRINGS = """[mechanism.springs.return]
bodies = ["frame", "slider"]
points = ["hook", "C"]
stiffness = "2 N/mm"
free_length = "50 mm"
damping = "40 N*s/m"
[mechanism.torsion_springs.twist]
bodies = ["crank", "rod"]
stiffness = "30 N*m/rad"
free_angle = "80 deg"
damping = "0.5 N*m*s/rad"
[mechanism.forces.punch]
"""
TORQUE = """[mechanism.driver]
torque = { law = "constant", torque = "40 N*m" }
flywheel = { inertia = "0.3 kg*m^2" }
"""
DAMPED_RING = (
    "[bearing.inner_ring.equivalent_mass]",
    '[bearing.inner_ring]\ndamping = "30 N*s/m"\n[bearing.inner_ring.equivalent_mass]',
)


@cache
def press(*changes: tuple[str, str]) -> str:
    text = (SCENES / "punching_press.toml").read_text(encoding="utf-8")
    for old, new in (
        ("[mechanism.forces.punch]\n", SPRINGS),
        ('guide = "origin"', 'guide = "origin"\nhook = ["80 mm", "30 mm"]'),
        *changes,
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def two_way(*changes: tuple[str, str], angle: str = "") -> Scene:
    bearings = (
        bearing("A", elastic=True, law=GATED, count=2),
        bearing("B", inner="crank", law=ONE_SIDED),
        bearing("C", inner="slider", elastic=True),
    )
    return with_bearings(press(*changes), *(text.replace("ball_angle", f"{angle}\nball_angle") for text in bearings))


@cache
def machine(which: str) -> Derived:
    """A press with everything on: gravity, springs, dampers, punch, bearings with damping."""
    scene = {
        "one-way": lambda: scene_from_text(press(DAMPED_RING), "press"),
        "two-way": two_way,
        "angled": lambda: two_way(angle='contact_angle = "20 deg"'),
        "torque": lambda: two_way(("[mechanism.driver]\n", TORQUE)),
    }[which]()
    return Derived(scene, further=(*MOTION, *POWER))


def states(model: Derived) -> list[tuple[float, np.ndarray]]:
    """Instants, and states with loaded balls, off every symmetry."""
    rng = np.random.default_rng(5)
    n = len(model.coordinates)
    out = []
    for t in (0.031, 0.074, 0.11):
        x = np.concatenate([rng.uniform(-3e-5, 3e-5, n), rng.uniform(-0.2, 0.2, n)])
        if model.coordinates[-1] == "driver.angle":
            x[n - 1], x[-1] = rng.uniform(4.2, 4.6), rng.uniform(20.0, 60.0)
        out.append((t, x))
    return out


def along_motion(model: Derived, t: float, x: np.ndarray, h: float = 2e-6) -> tuple[dict[str, float], dict[str, float]]:
    """Outputs, and their time derivatives by differences of fourth order along the motion."""
    gates = model.gates(1.0)
    rate = model.rhs(t, x, gates)
    at = {k: model.outputs(t + k * h, x + k * h * rate, gates) for k in (-2, -1, 0, 1, 2)}
    return at[0], {name: (8 * (at[1][name] - at[-1][name]) - at[2][name] + at[-2][name]) / (12 * h) for name in at[0]}


@pytest.mark.parametrize("which", ["one-way", "two-way", pytest.param("torque", marks=pytest.mark.long)])
def test_velocities_and_accelerations_are_the_time_derivatives(which: str) -> None:
    """Of every point and body, whatever drives the machine: exact, the accelerations of all coordinates included."""
    model, checked = machine(which), 0
    for t, x in states(model):
        values, rates = along_motion(model, t, x)
        for name in values:
            stem, _, end = name.rpartition(".")
            pairs = {"x": "vx", "y": "vy", "vx": "ax", "vy": "ay"} if stem.startswith("point.") else {}
            pairs |= {"vx": "ax", "vy": "ay"} if stem.endswith(("inner", "outer")) else {}
            pairs |= {"angle": "speed", "speed": "acceleration"} if stem.startswith("body.") else {}
            if end in pairs:
                there = values[f"{stem}.{pairs[end]}"]
                scale = max(abs(v) for n, v in values.items() if n.rpartition(".")[2] == pairs[end])
                assert rates[name] == pytest.approx(there, rel=1e-8, abs=1e-8 * scale), name
                checked += 1
    rings = 4 if which == "one-way" else 10
    assert checked == 3 * (8 * 4 + 3 * 2 + rings)


def test_acceleration_of_the_slider_is_that_of_the_textbook() -> None:
    """One-way at constant speed: twice the time derivative of l1 sin + sqrt(l2^2 - (l1 cos)^2), by hand."""
    model, l1, l2, w = machine("one-way"), 6e-3, 100e-3, 500 * 2 * math.pi / 60
    for t in (0.013, 0.05, 0.1):
        s, c = math.sin(w * t), math.cos(w * t)
        root = math.sqrt(l2**2 - (l1 * c) ** 2)
        # y = l1 s - root, below the crank
        bend = l1**2 * ((c * c - s * s) / root - (l1 * s * c) ** 2 / root**3)
        found = model.outputs(t, np.zeros(8), model.gates())
        assert found["point.slider.C.ay"] == pytest.approx(-(w**2) * (l1 * s + bend), rel=1e-12)
        assert found["point.slider.C.ax"] == pytest.approx(0.0, abs=1e-12)
        assert found["body.rod.speed"] ** 2 + 0.0 == pytest.approx((w * l1 * s / root) ** 2, rel=1e-12)


@pytest.mark.parametrize("which", ["one-way", "two-way", "angled", pytest.param("torque", marks=pytest.mark.long)])
def test_the_balance_of_every_joule_closes(which: str) -> None:
    """The kinetic energy changes by the sum of all named powers, with everything on that takes or gives work."""
    model = machine(which)
    for t, x in states(model):
        values, rates = along_motion(model, t, x)
        powers = {n: v for n, v in values.items() if n.endswith((".power", "drive_power"))}
        apart = {n: v for n, v in powers.items() if which == "one-way" and n.startswith(("contact", "load", "housing"))}
        linkage = [v for n, v in powers.items() if n not in apart]
        assert all(v != 0.0 for v in powers.values())
        assert len(linkage) == {"one-way": 5, "two-way": 10, "angled": 10, "torque": 10}[which]
        assert rates["kinetic_energy"] == pytest.approx(sum(linkage), abs=1e-9 * sum(map(abs, linkage)))
        if apart:
            rings = sum(apart.values()) - values["inner.loss"]
            assert rates["rings.kinetic_energy"] == pytest.approx(rings, abs=1e-9 * sum(map(abs, apart.values())))
        losses = [v for n, v in values.items() if n.endswith(".loss")]
        assert losses
        if not apart:  # what is stored and what dampers take, in place of their powers
            # a ball that nearly leaves has a kink in the second derivative of its energy: a shorter step
            near = along_motion(model, t, x, 2e-7)[1]
            stored = {n: v for n, v in near.items() if n.endswith(".energy")}
            assert len(stored) == 8
            assert all(v != 0.0 for v in stored.values())
            summed = sum(v for n, v in values.items() if n.endswith(".loss") and "ball" not in n)
            given = values["drive_power"] + values["force.punch.power"] - summed
            scale = sum(map(abs, stored.values()))
            # both bearings at A, whose housing stands still: what the balls give is the cage's work and the ring's
            along = sum(
                2.0 * values[f"at_A.ring_force.{a}"] * (values[f"at_A.inner.v{a}"] - values[f"at_A.outer.v{a}"])
                for a in "xy"
            )
            turned = values["at_A.cage.moment"] * rates["at_A.cage.in_outer"]
            assert turned - along == pytest.approx(values["at_A.contact.power"], rel=1e-8)
            assert near["kinetic_energy"] + sum(stored.values()) == pytest.approx(given, abs=1e-8 * scale)
            # the same by the sums alone
            given = values["applied_power"] - values["dissipated_power"]
            assert near["total_energy"] == pytest.approx(given, abs=1e-8 * scale)
            assert summed == pytest.approx(values["dissipated_power"], rel=1e-12)
        assert ("total_energy" in values) is (which != "one-way")
        assert min(losses) >= 0.0


@pytest.mark.parametrize("which", ["two-way", "angled"])
def test_contacts_take_what_they_store_and_what_dampers_take(which: str) -> None:
    """Two-way: elastic forces times rates of deflection, plus the loss, are what the balls take from the machine."""
    model = machine(which)
    gates, h = model.gates(1.0), 2e-6
    t, x = states(model)[0]
    rate, values = model.rhs(t, x, gates), model.outputs(t, x, gates)

    def balls(output: str, step: float = 0.0) -> np.ndarray:
        start = model.names.index(output)
        return model.at(t + step, x + step * rate, gates)[1][start : start + 8]

    for prefix, count in (("at_A.", 2), ("at_B.", 1), ("at_C.", 1)):
        deflection = f"{prefix}ball.deflection"
        wide, near = ((balls(deflection, k * h) - balls(deflection, -k * h)) / (k * h) for k in (2, 1))
        stored = count * float(balls(f"{prefix}ball.elastic_force") @ (8 * near - 2 * wide)) / 12
        loss = values[f"{prefix}contact.loss"]
        assert loss == pytest.approx(count * float(np.sum(balls(f"{prefix}ball.loss"))), rel=1e-12)
        assert loss > 0.0
        assert stored + loss == pytest.approx(-values[f"{prefix}contact.power"], rel=1e-8)


def test_a_spring_takes_its_tension_along_its_length_and_its_damper_the_square_of_the_rate() -> None:
    model = machine("torque")
    for t, x in states(model):
        values, rates = along_motion(model, t, x)
        rate, name = rates["spring.return.length"], "spring.return"
        assert values[f"{name}.power"] == pytest.approx(-values[f"{name}.tension"] * rate, rel=1e-8)
        assert values[f"{name}.loss"] == pytest.approx(40.0 * rate**2, rel=1e-8)


def test_magnitude_of_a_reaction_is_that_of_its_components() -> None:
    model = machine("torque")
    t, x = states(model)[1]
    found = model.outputs(t, x, model.gates(1.0))
    for joint in "ABCD":
        size = math.hypot(found[f"reaction.{joint}.x"], found[f"reaction.{joint}.y"])
        assert found[f"reaction.{joint}.magnitude"] == pytest.approx(size, rel=1e-14)


def ellipse(ring: str) -> tuple[float, float, float]:
    """Half axes [m] under 1 N and curvature sum [1/m] of the 6204, from SciPy's elliptic integrals."""
    ball, pitch, sign = 7.9375e-3, 33.5e-3, 1 if ring == "inner" else -1
    groove = {"inner": 4.1275e-3, "outer": 4.206875e-3}[ring]
    across, along = 2 / ball - 1 / groove, 2 / ball + sign * 2 / (pitch - sign * ball)
    target = (along - across) / (along + across)  # F(rho)

    def difference(ratio: float) -> float:
        m = 1 - ratio**-2
        first, second = ellipk(m), ellipe(m)
        return ((ratio**2 + 1) * second - 2 * first) / ((ratio**2 - 1) * second) - target

    ratio = brentq(difference, 1.01, 100.0, xtol=1e-13, rtol=1e-14)
    second, total = ellipe(1 - ratio**-2), across + along
    reduced = 2 * (1 - 0.3**2) / 207e9
    minor = (2 * second / (math.pi * ratio)) ** (1 / 3) * (1.5 * reduced / total) ** (1 / 3)
    return ratio * minor, minor, total


def contact(load: float) -> dict[str, float]:
    """What the most loaded ball of the 6204 reports, pressed straight along x onto its first ball [N]."""
    model = Derived(scene_from_text(press(), "press"), further=HERTZ)
    k_b = float(np.array(model._c)[[c.symbol.name for c in model.system.constants].index("bearing.k_b")][0])
    x = np.zeros(8)
    x[0] = 5e-6 + (load / k_b) ** (2 / 3)
    return model.outputs(0.0, x, model.gates())


@pytest.mark.parametrize("ring", ["inner", "outer"])
def test_ellipse_and_pressure_are_hertzs(ring: str) -> None:
    """Half axes by SciPy's elliptic integrals; p = 3Q/(2 pi a b), whose integral over the ellipse is the force."""
    load = 1234.0
    found, (major, minor, _) = contact(load), ellipse(ring)
    a, b = major * load ** (1 / 3), minor * load ** (1 / 3)
    assert found["ball.elastic_force"] == pytest.approx(load, rel=1e-9)
    assert found[f"ball.{ring}_major_axis"] == pytest.approx(a, rel=1e-9)
    assert found[f"ball.{ring}_minor_axis"] == pytest.approx(b, rel=1e-9, abs=0.0)
    assert found[f"ball.{ring}_pressure"] == pytest.approx(1.5 * load / (math.pi * a * b), rel=1e-9)


def test_approaches_of_both_contacts_add_up_to_the_deflection() -> None:
    found = contact(1234.0)
    assert found["ball.inner_approach"] + found["ball.outer_approach"] == pytest.approx(
        found["ball.deflection"], rel=1e-12, abs=0.0
    )
    slope = (contact(1234.1)["ball.elastic_force"] - contact(1233.9)["ball.elastic_force"]) / (
        contact(1234.1)["ball.deflection"] - contact(1233.9)["ball.deflection"]
    )
    assert found["ball.stiffness"] == pytest.approx(slope, rel=1e-7)


def test_stiffness_matrix_is_the_slope_of_the_ring_force() -> None:
    """Differences of the balls' forces on the rings, without damping, at an eccentric place."""
    model = Derived(scene_from_text(press(), "press"), {"bearing.damping.ratio": 0.0}, further=HERTZ)
    x, h = np.array([2.1e-5, -1.7e-5, 1e-6, 2e-6, 0.0, 0.0, 0.0, 0.0]), 1e-9
    found = model.outputs(0.02, x, model.gates())
    for column, axis in enumerate("xy"):
        ahead, behind = (model.outputs(0.02, x + s * h * np.eye(8)[column], model.gates()) for s in (1, -1))
        for other in "xy":
            slope = (ahead[f"ring_force.{other}"] - behind[f"ring_force.{other}"]) / (2 * h)
            name = f"contact.stiffness.{min(axis, other)}{max(axis, other)}"
            assert slope == pytest.approx(found[name], rel=1e-6), name


def test_static_rating_of_iso_76_is_where_the_pressure_is_4200_mpa() -> None:
    """C_0 = f_0 Z D_w^2 with f_0 = 13.1 at gamma = 0.237; the most loaded ball takes 5 C_0/Z."""
    load = 5 * 13.06 * 7.9375**2
    assert contact(load)["ball.inner_pressure"] == pytest.approx(4200e6, rel=3e-3)


@pytest.mark.parametrize(
    "which",
    [pytest.param("one-way", marks=pytest.mark.long), "two-way", pytest.param("torque", marks=pytest.mark.long)],
)
def test_the_runtime_knows_what_is_on_request(which: str) -> None:
    """It can say how to get an output that the manifest does not know, and says it of no other."""
    model = machine(which)
    plain = [o.name for o in derive(replace(model.scene, outputs=("*",))).outputs]
    further = [o.name for o in model.system.outputs if o.name not in plain]
    assert len(further) > 70
    assert [name for name in further if not on_request(name)] == []
    assert [name for name in plain if on_request(name) and name != "drive_power"] == []


def test_what_nobody_names_is_not_there() -> None:
    """A pattern means the outputs on request only where it matches no other."""

    def names(*patterns: str) -> list[str]:
        scene = scene_from_text(press(), "press")
        return [o.name for o in derive(replace(scene, outputs=patterns)).quantities]

    plain = names("reaction.A.*", "ball.*", "body.*", "*.x")
    assert not any(n.startswith("point.") or n.endswith(("magnitude", "power", "speed", "pressure")) for n in plain)
    asked = names("reaction.*.magnitude", "ball.inner_pressure", "point.rod.B.a*")
    wanted = [*(f"point.rod.B.{a}" for a in ("ax", "ay")), *(f"reaction.{j}.magnitude" for j in "ABCD")]
    assert asked == [*plain, *wanted, "ball.inner_pressure"]
    with pytest.raises(SceneError, match=r"on request point\.crank\.A\.\{x,y,vx,vy,ax,ay\}"):
        names("point.rod.Q.ax")
