"""Derived equations against the second implementation: states to compare at, and what is compared."""

from __future__ import annotations

import math

import numpy as np
import pytest
from coupled_scenes import Derived
from multibody import Multibody


def drawn(rng: np.random.Generator, derived: Derived, machine: Multibody) -> tuple[float, np.ndarray, dict[str, float]]:
    """A time in the first two turns, a state with loaded and free balls, and the gates there."""
    size = len(derived.coordinates)
    t = float(rng.uniform(0, 2)) * 2 * math.pi / abs(machine.speed or 1.0)
    x = np.concatenate([rng.uniform(-3e-5, 3e-5, size), rng.uniform(-0.1, 0.1, size)])
    if machine.free:
        behind = 1 + len(machine.lagging)
        x[size - behind], x[-behind] = machine.start + rng.uniform(-10, 10), rng.uniform(-60, 60)
    angle, _ = machine.drive(t, x)
    spalls = derived.spall_gates(t)
    return t, x, spalls | {name: machine.gate(name, angle) for name in derived.gates() if name not in spalls}


def largest_difference(derived: Derived, machine: Multibody, t: float, x: np.ndarray, gates: dict[str, float]) -> float:
    """Of accelerations, forces, and moments, relative to the largest one of a kind; ball angles are compared, too."""
    reference, size = machine.evaluate(t, x), len(derived.coordinates)
    outputs = derived.outputs(t, x, gates)
    accelerations = dict(zip(derived.coordinates, derived.rhs(t, x, gates)[size:], strict=True))
    assert set(accelerations) == set(reference.accelerations)
    q, _ = machine.absolute(t, x)
    assert derived.ball_angles(t, x) == pytest.approx(
        [machine.ball_angle(one, q) for one in machine.bearings], abs=1e-11
    )
    moments = [name for name in reference.outputs if name.endswith(("moment", "torque"))]
    worst = 0.0
    for found, expected in (
        (accelerations, reference.accelerations),
        (outputs, {k: v for k, v in reference.outputs.items() if k not in moments}),
        (outputs, {k: reference.outputs[k] for k in moments}),
    ):
        scale = max(map(abs, expected.values()), default=0.0) or 1.0  # free motion has no torque
        worst = max(worst, 0.0, *(abs(found[name] - value) / scale for name, value in expected.items()))
    return worst


def largest_imbalance(derived: Derived, machine: Multibody, t: float, x: np.ndarray, gates: dict[str, float]) -> float:
    """Of reactions and the forces between a bearing's rings, relative to the largest reaction."""
    outputs = derived.outputs(t, x, gates)
    largest = max(abs(value) for key, value in outputs.items() if key.startswith("reaction") and "moment" not in key)
    q, v = machine.absolute(t, x)
    (balance,) = derived.at(t, x, gates)[4]
    assert balance == pytest.approx(outputs["drive_torque"], rel=1e-9, abs=1e-12 * largest)
    worst = 0.0
    for name, several in machine.in_play.items():
        joint = machine.mechanism.joint(name or "")
        sign = 1.0 if several[0].inner_body == joint.bodies[0] else -1.0
        on_inner = np.zeros(2)
        for one in several:
            push = -machine.count(one) * np.array([outputs[f"{one.prefix}ring_force.{axis}"] for axis in "xy"])
            on_inner += push if one.outer is None else machine.housing_force(one, q, v)[0]
        reaction = np.array([outputs[f"reaction.{joint.name}.{axis}"] for axis in "xy"])
        worst = max(worst, float(np.max(np.abs(reaction - sign * on_inner))) / largest)
    return worst


def power_imbalance(derived: Derived, machine: Multibody, t: float, x: np.ndarray, gates: dict[str, float]) -> float:
    """Change of the kinetic energy less the sum of all named powers, relative to their sizes."""
    outputs = derived.outputs(t, x, gates)
    powers = [value for name, value in outputs.items() if name.endswith((".power", "drive_power"))]
    _, v = machine.absolute(t, x)
    change = float(machine.masses() * v @ machine.evaluate(t, x).absolute)
    assert outputs["kinetic_energy"] == pytest.approx(machine.energy(t, x)[0], rel=1e-10)
    return abs(change - sum(powers)) / sum(map(abs, powers))
