"""Bearings coupled both ways: cost at equal error beside the one-way press, beside Exudyn, and in lanes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.model import Model
from benchmarks.contenders import UnavailableError, stepped
from benchmarks.exudyn_press import INTEGRATORS, ExudynPress
from benchmarks.problem import BUILD, ROOT, Cycle
from benchmarks.timing import interleave, spread
from benchmarks.work_precision import time_at

#: Scenes and their names; ratios refer to the first.
SCENES = {
    "punching_press": "one-way at A, the paper's model",
    "punching_press_two_way": "two-way at A",
    "punching_press_hinges": "two-way at A, B and C",
}
EXUDYN_SCENE = "punching_press_two_way"
LEVEL = 1e-3
TOLERANCES = tuple(10.0**-k for k in np.arange(1.5, 9.1, 0.5))
STEPS = tuple(6e-5 * 2.0**-k for k in range(7))
#: Members of the ensembles, which differ in clearance.
CLEARANCES = tuple(np.linspace(8e-6, 12e-6, 64))


class Turn(Cycle):
    """The first turn of a scene from its start, rings at rest.

    Attributes
    ----------
    reference : displacements of all rings at the output points [m], shape (POINTS, coordinates)
    agreement : greatest difference of two references over the range of the motion [1]
    """

    def __init__(self, scene: str) -> None:
        model = load(generate(ROOT / "scenes" / f"{scene}.toml", BUILD / "generated" / scene))
        begun = model.simulate(cycles=1, transient=0, outputs=[], samples_per_cycle=2)
        super().__init__(model, {}, np.array(begun.x[0]), np.array(begun.statistics.magnitudes))
        located = [self._located(method) for method in ("stepper-dop853", "stepper-rodas5p")]
        self.reference = 0.5 * (located[0] + located[1])
        self.agreement = self.error(located[0], located[1])

    def _located(self, method: str) -> np.ndarray:
        solution = self.model.simulate(
            times=self.times, method=method, kinks="located", rtol=1e-12, outputs=[], transient=0
        )
        return self.motion(np.asarray(solution.x))

    def motion(self, states: np.ndarray) -> np.ndarray:
        """Displacements, of which states are the first half."""
        return states[:, : states.shape[1] // 2]

    def error(self, motion: np.ndarray, reference: np.ndarray | None = None) -> float:
        """Greatest distance from the reference over the range of the motion."""
        other = self.reference if reference is None else reference
        extent = float(np.max(np.ptp(self.reference, axis=0)))
        return float(np.max(np.abs(motion[:, : other.shape[1]] - other))) / extent


def measure(rounds: int) -> dict[str, Any]:
    """Time of a turn at an error of 1e-3 of the motion, ratios in one run, and what lanes gain."""
    turns = {scene: Turn(scene) for scene in SCENES}
    curves = {scene: _own_curve(turn, rounds) for scene, turn in turns.items()}
    found: dict[str, Any] = {
        "level": LEVEL,
        "agreement": float(f"{max(turn.agreement for turn in turns.values()):.2g}"),
        "scenes": {SCENES[scene]: _at_level(curve) for scene, curve in curves.items()},
    }
    try:
        found["exudyn"] = _exudyn(turns[EXUDYN_SCENE], rounds)
        found["exudyn"]["ballpass"] = _at_level(curves[EXUDYN_SCENE])
    except UnavailableError as reason:
        found["absent"] = str(reason)
    found["lanes"] = {SCENES[scene]: _lanes(turn.model, rounds) for scene, turn in turns.items()}
    return found


def _own_curve(turn: Turn, rounds: int) -> list[tuple[float, float]]:
    def solve(tolerance: float) -> np.ndarray:
        return turn.motion(stepped(turn, "stepper", tolerance))

    return _curve(turn, {tolerance: _call(solve, tolerance) for tolerance in TOLERANCES}, rounds)


def _exudyn(turn: Turn, rounds: int) -> dict[str, Any]:
    """Curves of its integrators over the length of the step."""
    press = ExudynPress(turn.model.numbers({}).values, turn.model.manifest.bearings[0].balls)
    found = {}
    for integrator in INTEGRATORS:
        calls = {step: _call(press.solve, step, integrator, turn.times) for step in STEPS}
        found[integrator] = _curve(turn, calls, min(rounds, 3))
    return {"curves": found, "seconds": {name: _at_level(curve) for name, curve in found.items()}}


def _curve(turn: Turn, calls: dict[float, Callable[[], np.ndarray]], rounds: int) -> list[tuple[float, float]]:
    """(error, time) from loose to tight."""
    errors = [turn.error(call()) for call in calls.values()]
    times = np.median(interleave(list(calls.values()), rounds), axis=0)
    return [(float(f"{e:.3g}"), float(f"{t:.4g}")) for e, t in zip(errors, times, strict=True) if math.isfinite(e)]


def _call(solve: Callable[..., np.ndarray], *arguments: Any) -> Callable[[], np.ndarray]:
    return lambda: solve(*arguments)


def _at_level(curve: list[tuple[float, float]]) -> float | None:
    return time_at(curve, LEVEL)


def _lanes(model: Model, rounds: int) -> tuple[float, float, float]:
    """Members a second in lanes over one by one, on one thread; median, 10th and 90th percentile."""
    table = [{f"{model.manifest.bearings[0].path}.clearance": value} for value in CLEARANCES]
    gains, of = [], [f"end:{model.manifest.states[0].name}"]
    for number in range(rounds + 1):
        taken = []
        for lanes in (False, True):
            begun = time.perf_counter()
            model.simulate_many(table, of, cycles=1, transient=0, lanes=lanes, threads=1)
            taken.append(time.perf_counter() - begun)
        if number:  # the first round compiles
            gains.append(taken[0] / taken[1])
    return spread(gains)
