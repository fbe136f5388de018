"""What holds of every damping law, effect, drive, force and dyad: evaluators, derivatives, limits, costs, docs.

The registries are read from their tables; `parts.py` has a scene for each entry.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from evaluators import Evaluators, Point
from parts import PARTS, QUICK, REGISTERED, ROOT, Part, cases

from ballpass.derive import equations
from ballpass.derive.features import count_operations, features, operations_of
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.records import Scene

every_part = pytest.mark.parametrize("part", PARTS, ids=str)


@cache
def scene_of(text: str) -> Scene:
    return scene_from_text(text, "part")


@pytest.fixture(scope="module")
def evaluators_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Evaluators]:
    """Of the text of a scene, lowered once."""
    return cache(lambda text: Evaluators(scene_of(text), tmp_path_factory.mktemp("part")))


@pytest.fixture(params=cases(), ids=str)
def evaluators(request: pytest.FixtureRequest, evaluators_of: Callable[[str], Evaluators]) -> Evaluators:
    return evaluators_of(request.param.text)


@pytest.mark.parametrize("registry", REGISTERED)
def test_every_entry_of_a_registry_has_a_case(registry: str) -> None:
    found = {part.name for part in PARTS if part.registry == registry}
    missing, gone = REGISTERED[registry] - found, found - REGISTERED[registry]
    assert not missing, f"tests/conformance/parts.py has no scene with the {registry} {', '.join(sorted(missing))}"
    assert not gone, f"tests/conformance/parts.py has a scene for {', '.join(sorted(gone))}, which is no {registry}"
    assert any(name.startswith(registry) for name in QUICK), f"QUICK of tests/conformance/parts.py has no {registry}"


def close(found: np.ndarray, expected: np.ndarray, rtol: float) -> None:
    """Equal within the largest entry: sums over balls cancel, their rounding does not."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=rtol * np.max(np.abs(expected), initial=1e-300))


def test_sympy_casadi_and_compiled_kernels_agree(evaluators: Evaluators) -> None:
    """SymPy in 40 digits at two points; the kernels within a step and across a large angle."""
    for point in evaluators.points(2):
        close(evaluators.value("rhs", point).ravel(), evaluators.by_sympy(point), 1e-13)
    n = len(evaluators.system.coordinates)
    for point in evaluators.points(30):
        for h in (1e-5, 3e-3):
            for row, node in zip(evaluators.stages(point, h), (0.0, 0.3, 1.0), strict=True):
                assert np.array_equal(row[:n], point.x[n:])
                close(row[n:], evaluators.value("rhs", point, point.t + node * h).ravel()[n:], 1e-12)


def by_name(evaluators: Evaluators, key: str, point: Point) -> np.ndarray:
    """Derivative of the rates; what they do not depend on has no function."""
    columns = {"t": 1, "p": len(point.p), "c": len(evaluators.constants(point.p)), "x": len(point.x)}
    try:
        return evaluators.value(f"rhs_jac_{key}", point)
    except KeyError:
        return np.zeros((len(point.x), columns[key]))


def test_kernels_have_the_jacobian_of_the_right_hand_side(evaluators: Evaluators) -> None:
    n = len(evaluators.system.coordinates)
    for point in evaluators.points(30):
        for h in (1e-5, 3e-3):
            dx, a, b, at = evaluators.linearized(point, h)
            t = point.t + h
            close(dx[n:], evaluators.value("rhs", point, t).ravel()[n:], 1e-12)
            jacobian = evaluators.value("rhs_jac_x", point, t)
            close(a, jacobian[n:, :n], 1e-12)
            close(b, jacobian[n:, n:], 1e-12)
            by_time = by_name(evaluators, "t", replace(point, t=t))
            close(at, by_time.ravel()[n:], 1e-11)


def test_derivatives_agree_with_differences(evaluators: Evaluators) -> None:
    """By states, time and every parameter, those of constants included, away from symmetry."""
    (point,) = evaluators.points(1)
    n = len(evaluators.system.coordinates)

    def off(derivative: np.ndarray, what: str, k: int, step: float) -> float:
        """From central differences, over the largest entry that the step resolves."""
        ends = []
        for sign in (1.0, -1.0):
            moved = np.atleast_1d(getattr(point, what)).copy()
            moved[k] += sign * step
            ends.append(evaluators.value("rhs", replace(point, **{what: moved if what != "t" else float(moved[0])})))
        difference = (ends[0] - ends[1]).ravel()[n:] / (2.0 * step)
        rounding = 1e-15 * np.max(np.abs(ends[0])) / step
        return float(np.max(np.abs(derivative[n:] - difference)) / max(np.max(np.abs(difference)), 1e6 * rounding))

    by = {key: by_name(evaluators, key, point) for key in "xtpc"}
    total = by["p"] + by["c"] @ np.array(evaluators.functions["constants_jac"](point.p))
    for k in range(2 * n):
        assert off(by["x"][:, k], "x", k, 1e-6 * max(abs(point.x[k]), 1e-7)) < 1e-5, evaluators.system.states[k].name
    assert off(by["t"][:, 0], "t", 0, 1e-8) < 1e-5
    for k, parameter in enumerate(evaluators.system.parameters):
        assert off(total[:, k], "p", k, 1e-6 * max(abs(point.p[k]), 1e-7)) < 3e-5, parameter.name


@pytest.mark.parametrize("part", cases(part for part in PARTS if part.without), ids=str)
def test_nothing_is_left_of_it_where_its_numbers_are_zero(
    part: Part, evaluators_of: Callable[[str], Evaluators]
) -> None:
    """Motion and outputs are those of the scene that never named it; with its numbers they are others."""
    with_it, without = evaluators_of(part.text), evaluators_of(part.without)
    moved = False
    for point in with_it.points(12):
        plain = results(without, with_it, point)
        close(results(with_it, with_it, point, part.off), plain, 1e-12)
        moved |= not np.allclose(results(with_it, with_it, point), plain, rtol=1e-6, atol=0.0)
    assert moved


def results(one: Evaluators, of: Evaluators, point: Point, changes: Mapping[str, float] = {}) -> np.ndarray:
    """Rates and outputs at a point `of` another scene, at changed numbers.

    What a table gives is an input and no number of the scene: with changes it is zero, as its rows are.
    """
    u = {
        i.name: 0.0 if changes and i.kind.startswith("table") else value
        for i, value in zip(of.system.inputs, point.u, strict=True)
    }
    p = dict(zip((q.name for q in of.system.parameters), point.p, strict=True)) | dict(changes)
    there = replace(
        point,
        u=np.array([u[i.name] for i in one.system.inputs]),
        p=np.array([p[q.name] for q in one.system.parameters]),
    )
    return np.concatenate([one.value(name, there).ravel() for name in ("rhs", "outputs")])


@pytest.mark.parametrize("part", cases(part for part in PARTS if part.path), ids=str)
def test_a_scene_pays_for_it_only_where_it_names_it(part: Part, evaluators_of: Callable[[str], Evaluators]) -> None:
    """Its features list it; left out in memory it costs what a scene file costs that never named it."""
    scene = scene_of(part.text)
    (feature,) = [f for f in features(scene) if f.path == part.path]
    assert feature.without is not None
    assert feature.modelled
    full, bare = operations_of(evaluators_of(part.text).functions), count_operations(feature.without)
    assert bare == operations_of(evaluators_of(part.without).functions)
    assert sum(bare.values()) < sum(full.values())
    balls = part.registry in ("damping law", "effect")
    # loads depend on time alone: the law of a ball, which is called for each of them, is not touched
    assert (bare["kernel.ball.forces"] < full["kernel.ball.forces"]) == balls
    of_it = {q.path for q in scene.quantities} - {q.path for q in scene_of(part.without).quantities}
    assert all(path.startswith(part.path) for path in of_it)


@every_part
def test_the_docs_name_it(part: Part) -> None:
    page, words = part.docs
    lines = (ROOT / "docs" / page).read_text(encoding="utf-8").splitlines()
    assert any(words in line for line in lines if line.startswith(("|", "#"))), f"{page} has no row or heading: {words}"


def test_equations_show_every_symbol(evaluators: Evaluators) -> None:
    """Each has a LaTeX name: no path of the scene file is left in a formula."""
    system = evaluators.system
    text = equations(system)
    assert text.count("$$") % 2 == 0
    assert ("Eq. (1)" in text) == (system.reactions is not None)
    formulas = "".join(text.split("$$")[1::2])
    assert not re.search(r"^(\S+) = \1$", formulas, re.MULTILINE)  # a row that says nothing
    assert not [p.name for p in system.parameters if p.name in formulas]
    assert not re.search(r"\bbody\.", formulas)
    for state in system.states[: len(system.coordinates)]:
        assert rf"\ddot {state.latex}" in text
