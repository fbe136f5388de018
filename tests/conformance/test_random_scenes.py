"""Random scenes over the features of the scene file: every route has one answer, and so has every mutant of a machine.

BALLPASS_SCENES says how many seeds the long tests take; `scripts/validation/machines.py` counts scenes and mismatches.
"""

from __future__ import annotations

import io
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evaluators import Evaluators
from generator import FIRST, FURTHER, KINDS, scene, text
from machine_states import States, against_mutant, against_reference, states_of
from mutants import MUTANTS, mutant
from quick_cases import long_but
from reference import Reference

from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.export.c_program import export_c

COUNT = int(os.environ.get("BALLPASS_SCENES", 24))
#: Of some kinds of machine one; 25 and 56 could not be derived once.
QUICK = (0, 5, 25, 56, FIRST, FIRST + 1, FIRST + 4)
#: Of which COUNT are drawn, each.
SERIES = (0, FIRST)


def seeds(quick: tuple[int, ...], every: int = 1) -> list[Any]:
    long = [first + k for first in SERIES for k in range(0, COUNT, every) if first + k not in quick]
    return [*quick, *(pytest.param(seed, marks=pytest.mark.long) for seed in long)]


@pytest.mark.parametrize("seed", seeds(QUICK))
def test_random_scenes_move_as_in_maximal_coordinates(seed: int) -> None:
    """Accelerations, reactions, torques, ball forces and rates of lags."""
    tables = scene(seed)
    machine, reference = States(tables), Reference(tables)
    for state in states_of(machine, seed):
        assert not against_reference(machine, reference, *state)


#: A seed for each mutant that has something to edit.
PAIRS = {name: next(s for s in range(60) if s not in (1, 2) and mutant(name, scene(s)) is not None) for name in MUTANTS}


@pytest.mark.parametrize("name", long_but(MUTANTS, "frame mirrored"))
def test_mutants_of_random_scenes_are_the_same_machine(name: str) -> None:
    tables, found = scene(PAIRS[name]), mutant(name, scene(PAIRS[name]))
    machine = States(tables)
    assert found is not None
    twin = States(found.tables)
    for state in states_of(machine, PAIRS[name]):
        assert not against_mutant(machine, found, twin, *state)


@pytest.mark.parametrize("seed", seeds((5,), every=6))
def test_evaluators_of_random_scenes_agree(seed: int, tmp_path: Path) -> None:
    """SymPy in 40 digits, CasADi's virtual machine, compiled kernels."""
    if "path" in text(scene(seed)):
        pytest.skip("beside a spall SymPy takes roots of negative numbers; the other routes have this seed")
    evaluators = Evaluators(scene_from_text(text(scene(seed)), "machine"), tmp_path)
    for at in evaluators.points(2) if evaluators.system.coordinates else ():
        exact, virtual = evaluators.by_sympy(at), evaluators.value("rhs", at).ravel()
        half = len(exact) // 2
        scale = np.max(np.abs(exact[half:]))
        assert virtual[half:] == pytest.approx(exact[half:], rel=1e-9, abs=1e-9 * scale)
        if evaluators.functions.kernels is not None:
            assert evaluators.stages(at, 1e-4)[0][half:] == pytest.approx(exact[half:], rel=1e-9, abs=1e-9 * scale)


@pytest.mark.long
@pytest.mark.parametrize("seed", [*range(6, 6 + len(KINDS)), *range(FIRST + 5, FIRST + 5 + len(FURTHER))])
def test_runs_of_random_scenes_agree(seed: int, model_of: Callable[..., Model], tmp_path: Path) -> None:
    """The stepper alone, in lanes, in an exported program, and CasADi's integrator."""
    model = model_of(text(scene(seed)))
    run: dict[str, Any] = {"cycles": 0.1, "transient": 0}
    single = model.simulate(**run, method="stepper", rtol=1e-9)
    other = model.simulate(**run, method="cvodes", rtol=1e-10)  # whose error is ten times its tolerance
    for name in (*single.states, *single.outputs):
        apart = np.abs(single[name] - other[name])
        apart = np.minimum(apart, np.abs(apart - 2 * np.pi)) if "angle" in name or "cage.in" in name else apart
        assert np.median(apart) <= 1e-5 * np.max(np.abs(single[name])) + 1e-12, name
    if not model.states:  # nothing is integrated
        return
    names = [f"end:{name}" for name in model.states]
    name, value = next(iter(model.parameters.items()))
    several = {name: [value] * 3}
    members = model.simulate_many(several, names, **run, kinks="stepped-over", rtol=1e-9, lanes=False)
    lanes = model.simulate_many(several, names, **run, kinks="stepped-over", rtol=1e-9)
    for name in names:  # members alike are alike, and agree with single runs within some errors of a run
        assert np.ptp(lanes[name]) == 0.0, name
        assert np.max(np.abs(lanes[name] - members[name])) <= 1e-5 * np.max(np.abs(single[name[4:]])) + 1e-12, name
    folder = export_c(model.folder, tmp_path / "c")
    subprocess.run(["make", "-s", "-C", str(folder)], check=True, timeout=300)
    arguments = [str(folder / "scene"), "--cycles", "0.1", "--rtol", "1e-9"]
    printed = subprocess.run(arguments, capture_output=True, text=True, check=True, timeout=300).stdout
    columns = np.loadtxt(io.StringIO(printed), delimiter=",", skiprows=1, ndmin=2)
    assert np.array_equal(columns[:, 1 : 1 + len(model.states)], single.x)
