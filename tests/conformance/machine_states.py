"""A random scene's machine at random states: by its model, by `reference.py`, and as a mutant of it.

In: the tables of a scene.  Out: values by name, and how far those of two routes are apart.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from generator import Tables, amount, text
from mutants import Mutant
from reference import Reference

from ballpass.derive import derive
from ballpass.derive.emit.describe import describe
from ballpass.derive.emit.generate import signature
from ballpass.derive.lowering.functions import LoweredFunctions, lower
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import numbers_of
from ballpass.runtime.time import timeline

Values = dict[str, Any]

#: Greatest difference, relative to the largest value of a unit.
TOLERANCE = 1e-9
#: Of its digits a torque or moment that is zero has none.
NOTHING = 1e-12


#: What was derived, by the signature of its structure: numbers are parameters, and derive nothing anew.
_DERIVED: dict[str, tuple[LoweredFunctions, Manifest]] = {}


class States:
    """A machine by its functions, as CasADi's virtual machine evaluates them at the times of the runtime's timeline."""

    def __init__(self, tables: Tables) -> None:
        self.tables, scene = tables, scene_from_text(text(tables), "machine")
        key = signature(scene)
        if key not in _DERIVED:
            system = derive(scene)
            functions = lower(system, derivatives=False)
            _DERIVED[key] = functions, describe(system, functions, "", ())
        self.functions, self.manifest = _DERIVED[key]
        values = {one.path: one.value for one in scene.quantities}
        self.numbers = numbers_of(self.manifest, values, lambda p: np.array(self.functions["constants"](p)).ravel())
        self.states = [one.name for one in self.manifest.states]

    def drawn(self, rng: np.random.Generator) -> tuple[float, Values]:
        """A time of the first turns, and a state in which some balls are loaded."""
        driver = self.tables.get("shaft") or self.tables["mechanism"]["driver"]
        start, turns = amount(driver.get("start_angle", 0.0)), float(rng.uniform(0, 2))
        state = {name: float(self._drawn(rng, name, start)) for name in self.states}
        if "swing" in driver:
            return turns / amount(driver["swing"]["frequency"]), state
        speed = amount(driver["speed"] if "speed" in driver else driver["table"]["speed"][0])
        if "range" in driver:
            low, high = (amount(driver["range"][end]) for end in ("start", "end"))
            turns *= 0.5 * ((high if speed > 0 else low) - start) / math.copysign(math.tau, speed)
            state |= {"driver.angle": float(rng.uniform(low, high))} if "driver.angle" in state else {}
        return turns * math.tau / abs(speed), state

    @staticmethod
    def _drawn(rng: np.random.Generator, name: str, start: float) -> float:
        if name == "driver.angle":
            return start + rng.uniform(-8, 8)
        if name == "driver.speed":
            return rng.uniform(-60, 60)
        if "cage.lag" in name:
            return 0.0 if name.endswith("integral") else rng.uniform(-0.5, 0.5)
        return rng.uniform(-0.1, 0.1) if re.search(r"v.$", name) else rng.uniform(-3e-5, 3e-5)

    def at(self, time: float, state: Mapping[str, float]) -> tuple[Values, Values]:
        """Outputs, and rates of velocities by their names."""
        x, numbers = np.array([state[name] for name in self.states]), self.numbers
        inputs = timeline.inputs_at(self.manifest, numbers.values, time)
        given = {"t": 0.0, "x": x, "u": inputs, "p": numbers.p, "c": numbers.c}

        def call(name: str) -> list[Any]:
            function = self.functions[name]
            found = function.call([given[one] for one in function.name_in()])
            return [np.array(one).ravel() for one in found]

        outputs = {
            one.name: value if one.size > 1 else float(value[0])
            for one, value in zip(self.manifest.outputs, call("outputs"), strict=True)
        }
        half = len(x) // 2
        found = call("rhs")[0][half:] if half else []
        return outputs, dict(zip(self.states[half:], map(float, found), strict=True))

    def unit(self, name: str) -> str:
        """Of an output or, per second, of a state."""
        known = {one.name: one.unit for one in self.manifest.outputs}
        known |= {one.name: one.unit for one in self.manifest.states}
        return known[name]


def by_reference(reference: Reference, time: float, state: Values) -> tuple[Values, Values]:
    """Outputs, and rates of velocities by their names."""
    found = reference.evaluate(time, state)
    rates = {name.removeprefix("a."): value for name, value in found.items() if name.startswith("a.")}
    outputs = {name: value for name, value in found.items() if not name.startswith("a.")}

    def velocity(name: str) -> str:
        if name.endswith("lag_integral"):
            return name.removesuffix("_integral")
        return "driver.speed" if name == "driver.angle" else re.sub(r"(.)$", r"v\1", name)

    return outputs, {velocity(name): value for name, value in rates.items()}


def differences(first: Values, second: Values, units: Mapping[str, str], label: str = "") -> dict[str, float]:
    """Names of values that differ, and by which part of the largest value of their unit."""
    sizes: dict[str, float] = {}
    for name in first:
        sizes[units[name]] = max(sizes.get(units[name], NOTHING), float(np.max(np.abs(first[name]))))
    lever = 1e-3 * sizes.get("N", 0.0)  # torques that cancel
    sizes |= {unit: max(size, lever) for unit, size in sizes.items() if unit in ("N*m", "W")}
    found = {}
    for name, value in first.items():
        apart = np.abs(np.asarray(value) - second[name])
        if units[name] == "rad":
            apart, size = np.abs(np.angle(np.exp(1j * (np.asarray(value) - second[name])))), 1.0
        else:
            size = sizes[units[name]]
        if not float(np.max(apart)) <= TOLERANCE * size:
            found[label + name] = float(np.max(apart)) / size
    return found


def against_reference(machine: States, reference: Reference, time: float, state: Values) -> dict[str, float]:
    """Where a machine's model is not the reference."""
    found = {}
    for one, other, label in zip(
        machine.at(time, state), by_reference(reference, time, state), ("", "rate of "), strict=True
    ):
        both = {name: value for name, value in one.items() if name in other}
        missed = [name for name in one if name not in both and (label or re.search(r"^reaction|ball\.force", name))]
        assert not missed, missed
        found |= differences(both, other, {name: machine.unit(name) for name in both}, label)
    return found


def against_mutant(machine: States, mutant: Mutant, twin: States, time: float, state: Values) -> dict[str, float]:
    """Where a mutant's model has another answer."""
    later, found = time * mutant.time, {}
    other = mutant.moved(state)
    other |= mutant.further(later, other)
    other = {name: value * mutant.scale(twin.unit(name)) for name, value in other.items() if name in twin.states}
    rng = np.random.default_rng(1)
    other |= {name: States._drawn(rng, name, 0.0) for name in twin.states if name not in other}
    for one, two, label in zip(machine.at(time, state), twin.at(later, other), ("", "rate of "), strict=True):
        expected = {n: v for n, v in mutant.moved(one).items() if not n.startswith(mutant.but or ("-",))}
        units = {name: twin.unit(name) for name in expected}
        per = 1.0 / mutant.time if label else 1.0
        expected = {name: value * mutant.scale(units[name]) * per for name, value in expected.items()}
        found |= differences(expected, two, units, label)
    return found


def states_of(machine: States, seed: int, count: int = 2) -> list[tuple[float, Values]]:
    rng = np.random.default_rng([seed, 7])
    return [machine.drawn(rng) for _ in range(count)]
