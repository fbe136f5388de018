"""Claims about random machines: any drive, windows, springs, stops, friction, and bearings in any of their hinges.

BALLPASS_MACHINES says how many; 300 take half an hour.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from comparison import drawn, largest_difference, largest_imbalance, power_imbalance
from coupled_scenes import POWERS, Derived
from linkages import MACHINES
from multibody import Multibody
from random_machines import random_machine, random_scene
from scipy.integrate import solve_ivp
from stepper_methods import NAMES

from ballpass.derive import generate
from ballpass.derive.reading.read import with_values
from ballpass.runtime import Model, load, read_manifest

COUNT = int(os.environ.get("BALLPASS_MACHINES", len(MACHINES)))
#: Of those that are compiled, which takes longest.
COMPILED = [13, 32, *range(60, COUNT, 12)]


def states(derived: Derived, machine: Multibody, seed: int) -> Iterator[tuple[float, np.ndarray, dict[str, float]]]:
    rng = np.random.default_rng(seed)
    return (drawn(rng, derived, machine) for _ in range(2))


#: Those that `make test` draws: of other linkages than test_coupled_machines.py.
DEFAULT = (2, 15)
SEEDS = [seed if seed in DEFAULT else pytest.param(seed, marks=pytest.mark.long) for seed in range(COUNT)]


@pytest.mark.parametrize("seed", SEEDS)
def test_random_machines_move_as_in_absolute_coordinates_and_lose_nothing(seed: int) -> None:
    """Accelerations and reactions; action and reaction; the kinetic energy changes by the sum of all named powers.

    The first bound is wider than for shipped scenes: absolute coordinates round the play of light bearings to 1e-17 m.
    """
    derived = Derived(random_machine(seed), further=POWERS)
    machine = Multibody(derived.scene, derived.points())
    for t, x, gates in states(derived, machine, seed):
        assert largest_difference(derived, machine, t, x, gates) < 1e-9
        assert largest_imbalance(derived, machine, t, x, gates) < 1e-11
        assert power_imbalance(derived, machine, t, x, gates) < 1e-10


@pytest.mark.long
@pytest.mark.parametrize("seed", [pytest.param(COMPILED[0], marks=pytest.mark.extreme), *COMPILED[1:]])
def test_random_machines_run_alike_by_every_family_of_methods(seed: int, tmp_path: Path) -> None:
    """Explicit and linearly implicit, and as SciPy integrates the equations."""
    scene = random_machine(seed)
    derived, model = Derived(scene), load(generate(scene, tmp_path / "model"))
    machine, size = Multibody(scene, derived.points()), len(derived.coordinates)
    end = 0.02 * 2 * math.pi / abs(machine.speed)
    times = np.linspace(end / 8, end, 8)
    runs = [
        model.simulate(
            duration=end, times=times, method=method, rtol=1e-10, transient=0, outputs=[], initial=derived.initial
        ).x
        for method in NAMES
    ]
    # displacements of all rings alike, and the driver's angle; their rates likewise
    kinds = np.repeat([0, 1, 2, 3], [size - machine.free, machine.free] * 2)
    scale = np.array([np.max(np.abs(runs[0][:, kinds == kind])) for kind in kinds])
    for other in runs[1:]:
        assert np.max(np.abs(runs[0] - other) / scale) < 1e-5

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        angle, _ = machine.drive(t, x)
        return derived.rhs(t, x, {name: machine.gate(name, angle) for name in derived.gates()})

    # at 1e-10 SciPy's own error is 1e-5 to 3e-5 of a machine whose stop is hit, by the last bits of M's inverse
    other = solve_ivp(rates, (0, end), derived.initial, method="DOP853", rtol=1e-12, atol=1e-12 * scale, t_eval=times)
    assert np.max(np.abs(runs[0] - other.y.T) / scale) < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_random_linkages_rest_at_their_static_equilibrium(seed: int, tmp_path: Path) -> None:
    """All rings of all bearings, wherever they are: with the crank held, nothing moves in absolute coordinates."""
    scene = with_values(random_scene(seed), {"mechanism.driver.speed": 1e-9})  # a crawl, which damps nothing
    folder = generate(scene, tmp_path / "model")
    rest = Model(folder, read_manifest(folder), None).static_equilibrium()
    assert not len(rest.free_directions)
    machine = Multibody(scene, Derived(scene).points())
    there, concentric = (
        max(map(abs, machine.evaluate(0.0, x).accelerations.values())) for x in (rest.x, np.zeros_like(rest.x))
    )
    assert there < 1e-9 * concentric
