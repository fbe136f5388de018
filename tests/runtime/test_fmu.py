"""Claims about exported FMUs: valid, the bits of `simulate`, independent instances, states that come back, errors told.

The importer is FMPy, of the Modelica Association, and in some tests Ecos, in C++.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import math
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filelock import FileLock
from typer.testing import CliRunner

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.folder import read_artefact
from ballpass.runtime.export.fmu import export_fmu, input_names, platform_tuple
from ballpass.runtime.export.model_description import base_powers
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoints

fmpy = pytest.importorskip("fmpy", reason="needs FMPy: pip install ballpass[dev]")
fmi3 = pytest.importorskip("fmpy.fmi3")

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")

FORCE = "mechanism.forces.punch.force.y"
TORQUE = "mechanism.driver.torque.torque"
SPEED = "mechanism.driver.speed"

#: The press with a motor gets a constant torque in its place.
WITHOUT_MOTOR = (
    (
        'law = "asynchronous"                    # Kloss\'s curve\n'
        'breakdown_torque = "25 N*m"             # [assumption] some 2.2 times the nominal torque\n'
        "breakdown_slip = 0.3                    # [assumption] small motors of many poles have much slip\n"
        'synchronous_speed = "500 rpm"           # [paper] the speed of the crank',
        'law = "constant"\ntorque = "0 N*m"',
    ),
)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory, make_model: Callable[..., Model]) -> Callable[..., Exported]:
    """A scene with replacements as an FMU, made once for all processes of the suite."""
    place = tmp_path_factory.getbasetemp()
    shared = (place.parent if place.name.startswith("popen-") else place) / "fmus"
    shared.mkdir(exist_ok=True)

    def make(name: str, inputs: Sequence[str] = (), *changes: tuple[str, str]) -> Exported:
        model = make_model(name, *changes)
        path = shared / f"{'_'.join((name, *inputs))}{len(changes)}.fmu"
        with FileLock(f"{path}.lock"):
            if not path.is_file():
                export_fmu(model.folder, path, inputs=inputs)
        return Exported(path, model)

    return make


class Exported:
    """An FMU and the model that it was made from."""

    def __init__(self, path: Path, model: Model) -> None:
        self.path, self.model = path, model
        self.description = fmpy.read_model_description(str(path))
        self.places = {variable.name: variable.valueReference for variable in self.description.modelVariables}
        self.sizes = {
            variable.valueReference: int(variable.dimensions[0].start) if variable.dimensions else 1
            for variable in self.description.modelVariables
        }

    @property
    def outputs(self) -> list[str]:
        return [variable.name for variable in self.description.modelVariables if variable.causality == "output"]

    @contextmanager
    def instance(self, **given: Any) -> Iterator[Instance]:
        folder = fmpy.extract(str(self.path))
        try:
            made = Instance(self, folder, **given)
            yield made
            made.slave.freeInstance()
        finally:
            shutil.rmtree(folder, ignore_errors=True)


class Instance:
    """An instance in FMPy, by names; keeps the messages that it logs."""

    def __init__(self, exported: Exported, folder: str, **given: Any) -> None:
        self.exported, self.messages = exported, []
        self.slave = fmi3.FMU3Slave(
            guid=exported.description.guid,
            unzipDirectory=folder,
            modelIdentifier=exported.description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.slave.instantiate(
            logMessage=lambda _, status, category, message: self.messages.append(message.decode()), **given
        )

    def begin(self, stop: float, **values: float) -> None:
        self.set(**values)
        self.slave.enterInitializationMode(startTime=0.0, stopTime=stop)
        self.slave.exitInitializationMode()

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self.slave.setFloat64([self.exported.places[name]], [value])

    def get(self, *names: str) -> np.ndarray:
        places = [self.exported.places[name] for name in names or self.exported.outputs]
        return np.array(self.slave.getFloat64(places, sum(self.exported.sizes[place] for place in places)))

    def steps(self, times: Sequence[float]) -> np.ndarray:
        """Outputs at increasing times, the first of which is where the instance is."""
        rows = [self.get()]
        for before, time in pairwise(times):
            self.slave.doStep(before, time - before)
            rows.append(self.get())
        return np.array(rows)


def reached(times: Sequence[float]) -> np.ndarray:
    """Ends of steps as an FMU is told them, each a point plus a step, which may be a rounding beside the next point."""
    return np.array([times[0], *(before + (time - before) for before, time in pairwise(times))])


def columns(solution: Any, names: Sequence[str]) -> np.ndarray:
    """Samples of outputs side by side."""
    return np.column_stack([solution.outputs[name] for name in names])


def press(exported: Callable[..., Exported]) -> Exported:
    return exported("punching_press", ("mechanism.forces.punch",))


def test_fmu_is_valid_and_says_what_it_has(exported: Callable[..., Exported]) -> None:
    from fmpy.validation import validate_fmu

    found = press(exported)
    assert validate_fmu(str(found.path)) == []
    variables = {variable.name: variable for variable in found.description.modelVariables}
    model = found.model
    for name, info in zip(model.parameters, model.manifest.parameters, strict=True):
        assert (float(variables[name].start), variables[name].description) == (info.default, info.description)
        assert (variables[name].unit or "1") == (info.unit or "1")
        expected = "input" if name.startswith("mechanism.forces.punch.force") else "parameter"
        assert variables[name].causality == expected
    assert sorted(found.outputs) == sorted(model.outputs)
    with zipfile.ZipFile(found.path) as archive:
        names = archive.namelist()
        text = archive.read("modelDescription.xml").decode()
    assert "documentation/licenses/license.txt" in names
    assert "sources/fmi.c" in names
    assert not re.search(r"/tmp|/home|/root", text)
    assert base_powers("N*s/m") == {"kg": 1, "s": -1}
    assert base_powers("s*m^0.5") is None


def test_fmu_has_every_function_of_the_standard(exported: Callable[..., Exported]) -> None:
    """FMPy binds all that the standard declares; the standard's own headers are what the C is compiled with."""
    declared = set(re.findall(r"fmi3[A-Z]\w+(?=\()", Path(fmi3.__file__).read_text(encoding="utf-8")))
    declared = {name for name in declared if hasattr(fmi3.FMU3Slave, name)}
    assert len(declared) > 70
    with press(exported).instance() as one:
        assert [name for name in sorted(declared) if not hasattr(one.slave.dll, name)] == []


@pytest.mark.parametrize("steps", [7, 500])
def test_fmu_has_the_bits_of_simulate(exported: Callable[..., Exported], steps: int) -> None:
    """FMPy's own loop, and communication steps of any size, one after the other or at random."""
    found = press(exported)
    model = found.model
    end = model.simulate(method="stepper", samples_per_cycle=1).statistics.duration
    result = fmpy.simulate_fmu(str(found.path), output=found.outputs, stop_time=end, output_interval=end / steps)
    solution = model.simulate(method="stepper", times=reached(result["time"]), duration=end)
    for name in found.outputs:
        assert np.array_equal(result[name], solution.outputs[name]), name
    times = np.concatenate([[0.0], np.sort(np.random.default_rng(3).uniform(0.0, end, steps)), [end]])
    with found.instance() as one:
        one.begin(end)
        rows = one.steps(times)
    solution = model.simulate(method="stepper", times=reached(times), duration=end)
    assert np.array_equal(rows, columns(solution, found.outputs))


def test_two_instances_share_nothing_and_parameters_are_set_between_runs(exported: Callable[..., Exported]) -> None:
    found = press(exported)
    model = found.model
    end = model.simulate(method="stepper", samples_per_cycle=1).statistics.duration
    times = np.linspace(0.0, end, 33)
    other = {"bearing.clearance": 30e-6, "mechanism.driver.start_angle": 1.0}
    expected = [
        columns(model.simulate(method="stepper", times=times, duration=end, parameters=parameters), found.outputs)
        for parameters in ({}, other)
    ]
    with found.instance() as one, found.instance() as two:
        one.begin(end)
        two.begin(end, **other)
        rows: tuple[list[np.ndarray], ...] = ([], [])
        for k, time in enumerate(times):  # in turns
            for instance, row in zip((one, two), rows, strict=True):
                if k:
                    instance.slave.doStep(times[k - 1], time - times[k - 1])
                row.append(instance.get())
        assert np.array_equal(rows[0], expected[0])
        assert np.array_equal(rows[1], expected[1])
        one.slave.reset()
        one.begin(end, **other)
        assert np.array_equal(one.steps(times), expected[1])
        one.slave.terminate()
        one.slave.reset()
        one.slave.enterInitializationMode(startTime=0.0, stopTime=end)
        one.set(**other)  # in Initialization Mode as well, and outputs follow
        assert np.array_equal(one.get(), expected[1][0])
        one.set(**{name: model.parameters[name] for name in other})
        assert np.array_equal(one.get(), expected[0][0])
        one.slave.exitInitializationMode()
        assert np.array_equal(one.steps(times), expected[0])


def test_states_that_are_kept_and_serialized_go_on_with_the_same_bits(exported: Callable[..., Exported]) -> None:
    found = press(exported)
    end = 0.12
    times = np.linspace(0.0, end, 41)
    with found.instance() as one:
        one.begin(end)
        whole = one.steps(times)
    with found.instance() as one, found.instance() as two:
        one.begin(end)
        one.steps(times[:18])
        kept = one.slave.getFMUState()
        text = one.slave.serializeFMUState(kept)
        assert np.array_equal(one.steps(times[17:30]), whole[17:30])
        one.slave.setFMUState(kept)
        assert np.array_equal(one.steps(times[17:]), whole[17:])
        state = two.slave.deserializeFMUState(text)  # in an instance that was never initialized
        two.slave.setFMUState(state)
        assert np.array_equal(two.steps(times[17:]), whole[17:])
        torn = bytearray(text)
        torn[len(torn) // 2] ^= 1
        for wrong in (bytes(torn), text[:-1]):
            with pytest.raises(Exception, match="fmi3DeserializeFMUState"):
                two.slave.deserializeFMUState(wrong)
        for instance, freed in ((one, kept), (two, state)):
            instance.slave.freeFMUState(freed)


@pytest.mark.long
def test_inputs_hold_until_the_next_step(exported: Callable[..., Exported]) -> None:
    """A force that is switched off for good is that of a scene without it; one set to its own value changes no bit."""
    found = press(exported)
    model = found.model
    end, halfway = 0.24, 0.13  # the punch comes between 0.079 s and 0.089 s, and one turn later
    times = np.linspace(halfway, end, 23)
    without = model.simulate(method="stepper", duration=end, times=times, parameters={FORCE: 0.0}, rtol=1e-9)
    with_it = model.simulate(method="stepper", duration=end, times=times, rtol=1e-9)
    names = ["inner.x", "inner.y"]
    with found.instance() as one:
        one.set(**{FORCE: 0.0})
        one.slave.enterInitializationMode(tolerance=1e-9, startTime=0.0, stopTime=end)
        one.slave.exitInitializationMode()
        one.slave.doStep(0.0, halfway)
        one.set(**{FORCE: 0.0})
        kept = one.slave.getFMUState()
        off = one.steps(times)
        assert np.array_equal(off, columns(without, found.outputs))
        one.slave.setFMUState(kept)
        one.set(**{FORCE: model.parameters[FORCE]})
        on = one.steps(times)[:, [found.outputs.index(name) for name in names]]
        one.slave.freeFMUState(kept)
    # from a little other state the motion under the punch becomes the same
    apart = np.abs(on - columns(with_it, names))[-1] / np.max(np.abs(columns(with_it, names)))
    other = np.abs(on - columns(without, names)) / np.max(np.abs(columns(with_it, names)))
    assert np.max(apart) < 0.02
    assert np.max(other) > 0.5


@pytest.mark.long
def test_a_load_on_a_ring_is_an_input(exported: Callable[..., Exported]) -> None:
    """A constant one has the bits of the scene with it.  A ramp of held values becomes that of a table: the error is of
    first order in the step where each is the value of the step's begin, of second where it is that of its middle."""
    found = exported("rotor", ("loads.weight",))
    weight = 'type = "constant"\nforce = ["0 N", "-49.03 N"]             # of 5 kg'
    ramp = 'type = "table"\ntime = ["0 s", "0.1 s"]\nx = ["0 N", "20 N"]\ny = ["-49.03 N", "-149.03 N"]'
    table = exported("rotor", (), (weight, ramp)).model
    loads, names, end = ("loads.weight.force.x", "loads.weight.force.y"), ("inner.x", "inner.y"), 0.1
    still = dict(zip(loads, (7.0, -80.0), strict=True))
    times = np.linspace(0.0, end, 5)
    expected = found.model.simulate(method="stepper", duration=end, times=reached(times), parameters=still)
    with found.instance() as one:
        one.begin(end, **still)
        one.slave.doStep(0.0, times[1])
        one.set(**still)
        assert np.array_equal(one.steps(times[1:]), columns(expected, found.outputs)[1:])
    solution = table.simulate(duration=end, times=[end], rtol=1e-11)
    errors = []
    for count in (200, 400, 800):
        for part in (0.0, 0.5):
            with found.instance() as one:
                one.set(**dict(zip(loads, (0.0, -49.03), strict=True)))
                one.slave.enterInitializationMode(startTime=0.0, stopTime=end, tolerance=1e-10)
                one.slave.exitInitializationMode()
                for k in range(count):
                    there = (k + part) / count
                    one.set(**dict(zip(loads, (20.0 * there, -49.03 - 100.0 * there), strict=True)))
                    one.slave.doStep(k * end / count, (k + 1) * end / count - k * end / count)
                errors.append(one.get(*names) - [solution.outputs[name][-1] for name in names])
    first, second = (np.abs(errors[part::2]) for part in (0, 1))
    assert np.all(np.abs(first[:-1] / first[1:] - 2.0) < 0.05), first
    assert np.all(second[-1] < 1e-3 * first[-1]), (first, second)


def test_derivatives_are_those_of_differences(exported: Callable[..., Exported]) -> None:
    """Of rates and outputs at a moment, to states, inputs and parameters, those that turn the balls as well."""
    found = press(exported)
    model = found.model
    manifest, states = model.manifest, list(model.states)
    others = [name for name in found.outputs if name not in states]
    with found.instance() as one:
        one.slave.enterInitializationMode(startTime=0.0, stopTime=0.48)
        start, ends = "bearing.initial.inner.x", []
        unknowns, sizes = [found.places[name] for name in ("inner.x", "ball.deflection")], 9
        moved = one.slave.getDirectionalDerivative(unknowns, [found.places[start]], [2.0], sizes)
        for sign in (1.0, -1.0):
            one.set(**{start: model.parameters[start] + sign * 1e-9})
            ends.append(one.get("inner.x", "ball.deflection"))
        one.set(**{start: model.parameters[start]})
        assert np.allclose(moved, (ends[0] - ends[1]) / 1e-9, rtol=0.0, atol=1e-5)  # where the motion begins
        one.slave.exitInitializationMode()
        one.slave.doStep(0.0, 0.0831)  # in the punch
        unknowns = [f"der({name})" for name in states] + others
        x = one.get(*states)

        def values(numbers: dict[str, float], state: np.ndarray) -> np.ndarray:
            resolved = model.numbers(numbers)
            edges = breakpoints(manifest, resolved.values, 0.0, 0.0831)
            start = float(edges[-1])
            u = timeline.inputs_at(manifest, resolved.values, start, 0.083)
            there = {"t": 0.0831 - start, "x": state, "u": u, "p": resolved.p, "c": resolved.c}
            kernel = model.kernel("outputs")
            kernel.run(there)
            fields = [name.replace(".", "_") for name in others]
            return np.concatenate([model.kernel("rhs")(there), *(kernel.output(field) for field in fields)])

        assert np.allclose(one.get(*unknowns), values({}, x), rtol=1e-9, atol=1e-9)
        size = sum(found.sizes[found.places[name]] for name in unknowns)
        scale = None
        for known in (*states, FORCE, "bearing.clearance", "bearing.ball_diameter", "mechanism.driver.speed"):
            moved = one.slave.getDirectionalDerivative(
                [found.places[name] for name in unknowns], [found.places[known]], [2.0], size
            )
            at = states.index(known) if known in states else None
            amount = 1e-9 if at is not None else 1e-6 * abs(model.parameters[known])
            ends = []
            for sign in (1.0, -1.0):
                state = x + (0.0 if at is None else sign * amount * np.eye(len(x))[at])
                ends.append(values({} if at is not None else {known: model.parameters[known] + sign * amount}, state))
            expected = (ends[0] - ends[1]) / (2.0 * amount)
            scale = np.max(np.abs(expected))
            assert scale > 0.0
            assert np.max(np.abs(np.array(moved) / 2.0 - expected)) < 2e-6 * scale, known
            weights = np.linspace(-1.0, 1.0, size)
            place = [found.places[known]]
            (adjoint,) = one.slave.getAdjointDerivative([found.places[name] for name in unknowns], place, weights, 1)
            assert adjoint == pytest.approx(np.dot(weights, moved) / 2.0, rel=1e-12, abs=1e-12 * scale)
        # a derivative by time: that of outputs while the motion goes on
        place = found.places["reaction.A.y"]
        (rate,) = one.slave.getOutputDerivatives([place], [1])
        before = one.get("reaction.A.y")[0]
        one.slave.doStep(0.0831, 1e-7)
        assert rate == pytest.approx((one.get("reaction.A.y")[0] - before) / 1e-7, rel=1e-4)


def test_what_is_no_dependency_has_no_derivative(exported: Callable[..., Exported]) -> None:
    """At rest, in a run, in the punch; and an importer sees which outputs an input reaches at once: no other loop."""
    found = press(exported)
    description = found.description
    running = [*description.outputs, *description.derivatives]
    knowns = [item.name for item in description.modelVariables if item.causality in ("parameter", "input")]

    def check(slave: Any, unknowns: Sequence[Any], names: Sequence[str]) -> None:
        places = [item.variable.valueReference for item in unknowns]
        sizes = [found.sizes[place] for place in places]
        for name in names:
            moved = slave.getDirectionalDerivative(places, [found.places[name]], [1.0], sum(sizes))
            for item, part in zip(unknowns, np.split(np.array(moved), np.cumsum(sizes)[:-1]), strict=True):
                if name not in [known.name for known in item.dependencies]:
                    assert not np.any(part), (item.variable.name, name)

    with found.instance() as one:
        one.slave.enterInitializationMode(startTime=0.0, stopTime=0.48)
        check(one.slave, description.initialUnknowns, ["time", *knowns])
        one.slave.exitInitializationMode()
        for begin, end in ((0.0, 0.02), (0.02, 0.0831)):
            one.slave.doStep(begin, end - begin)
            check(one.slave, running, ["time", *knowns, *found.model.states])
    named = {item.variable.name: {known.name for known in item.dependencies} for item in running}
    reached = {name for name, of in named.items() if FORCE in of}
    assert {"reaction.A.x", "reaction.A.y", "der(inner.vy)"} <= reached
    assert reached.isdisjoint({"ball.force", "inner.x", "inner.y", "der(inner.y)"})
    assert {"inner.x", "bearing.ball_diameter"} <= named["ball.force"]
    magnitudes = {item.name: float(item.nominal) for item in description.modelVariables if item.nominal}
    solution = found.model.simulate()
    reach = np.max(np.abs(solution.x), axis=0)
    for name, most in zip(found.model.states, reach, strict=True):  # what the motion really reaches
        assert 0.01 < most / magnitudes[name] < 5.0, name


def test_a_system_that_fmi_has_no_name_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: "AMD64")
    monkeypatch.setattr("platform.system", lambda: "Windows")
    assert platform_tuple() == "x86_64-windows"
    monkeypatch.setattr("platform.system", lambda: "FreeBSD")
    with pytest.raises(RequestError, match=r"FreeBSD on amd64 was asked for. Allowed: Linux, .* --c"):
        platform_tuple()


def test_steps_end_early_where_a_load_switches(exported: Callable[..., Exported]) -> None:
    found = press(exported)
    window = [found.model.parameters[f"mechanism.forces.punch.window.{end}"] for end in ("start", "end")]
    speed = found.model.parameters["mechanism.driver.speed"]
    with found.instance(earlyReturnAllowed=True) as one, found.instance() as two:
        one.begin(0.48)
        two.begin(0.48)
        time, ends = 0.0, []
        while time < 0.12:
            _, _, early, time = one.slave.doStep(time, 0.12 - time)
            ends += [time] if early else []
        two.slave.doStep(0.0, 0.12)
        assert np.allclose(ends, [edge / speed for edge in window], rtol=1e-12)
        assert np.array_equal(one.get(), two.get())


def test_bad_calls_are_errors_with_text(exported: Callable[..., Exported]) -> None:
    found = press(exported)
    places = found.places
    with found.instance() as one:
        slave = one.slave

        def refused(words: str, call: Callable[[], object]) -> None:
            with pytest.raises(Exception, match=r"fmi3"):
                call()
            assert words in one.messages[-1], one.messages[-1]

        refused("not allowed in the state Instantiated", lambda: slave.doStep(0.0, 0.1))
        refused("not known before Initialization Mode", lambda: one.get("inner.x"))
        refused("Allowed: a number above 0 [m]", lambda: one.set(**{"bearing.ball_diameter": -1.0}))
        refused("tolerance 1", lambda: slave.enterInitializationMode(tolerance=1.0))
        refused("from 0 s to -1 s", lambda: slave.enterInitializationMode(stopTime=-1.0))
        one.set(**{"mechanism.bodies.rod.points.C": 0.003})
        slave.enterInitializationMode(stopTime=0.4)
        refused("the linkage cannot be assembled at joint C", slave.exitInitializationMode)
        one.set(**{"mechanism.bodies.rod.points.C": 0.1})
        slave.exitInitializationMode()
        refused("0.1 s was given. Allowed: 0 s", lambda: slave.doStep(0.1, 0.1))
        refused("a step of -0.1 s", lambda: slave.doStep(0.0, -0.1))
        refused("Allowed: times up to the stop time, 0.4 s", lambda: slave.doStep(0.0, 0.41))
        refused("a value before the run starts", lambda: one.set(**{"bearing.clearance": 1e-6}))
        refused("Allowed: parameters and inputs", lambda: one.set(**{"inner.x": 0.0}))
        refused("value reference 9999", lambda: slave.getFloat64([9999]))
        refused("Allowed: 8", lambda: slave.getFloat64([places["ball.force"]], 9))
        refused("more than the 1 values", lambda: slave.getFloat64([places["ball.force"]], 1))
        refused("the known", lambda: slave.getDirectionalDerivative([places["inner.x"]], [places["ball.force"]], [1.0]))
        refused("no variable has this type", lambda: slave.getInt32([0]))
        x, y = [places["inner.x"]], [places["inner.y"]]
        refused("Allowed: 1, one for each known", lambda: slave.getAdjointDerivative(x, y, [1.0], 2))
        refused("2 values were given. Allowed: 1", lambda: slave.getAdjointDerivative(x, y, [1.0, 1.0], 1))
        refused("no event mode", slave.enterEventMode)
        refused("no clocks", lambda: slave.getClock([0]))
        refused("order 2", lambda: slave.getOutputDerivatives([places["ball.force"]], [2]))
        assert slave.doStep(0.0, 0.01)[3] == 0.01  # none of that has hurt
    for given, words in (({"eventModeUsed": True}, "event mode"), ({"requiredIntermediateVariables": [1]}, "intermed")):
        heard: list[str] = []
        folder = fmpy.extract(str(found.path))
        identifier = found.description.coSimulation.modelIdentifier
        slave = fmi3.FMU3Slave(
            guid=found.description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName="x"
        )
        log = lambda *words, to=heard: to.append(words[-1].decode())  # noqa: E731
        with pytest.raises(Exception, match="Failed to instantiate"):
            slave.instantiate(logMessage=log, **given)
        assert words in heard[0]


def test_names_that_cannot_be_inputs_are_refused(
    exported: Callable[..., Exported], scene_text: Callable[..., str], tmp_path: Path
) -> None:
    folder = press(exported).model.folder
    for name, words in (
        ("mechanism.driver.speed", "Name the scene file instead"),
        ("bearing.clearance", "does not change in a run"),
        ("mechanism.forces.bunch", "There is no input 'mechanism.forces.bunch'"),
    ):
        with pytest.raises(RequestError, match=words):
            export_fmu(folder, folder / "x.fmu", inputs=[name])
    # what a cage has lagged would change with the speed, and its angle jump
    slip = '[bearing.cage]\nslip = { time = ["0 s", "0.5 s"], value = [0.0, 0.04] }\n\n[bearing.damping]'
    slipping = generate(scene_from_text(scene_text("rotor", ("[bearing.damping]", slip)), "rotor"), tmp_path / "rotor")
    with pytest.raises(RequestError, match="does not change in a run"):
        export_fmu(slipping, tmp_path / "x.fmu", inputs=["shaft.speed"])
    window = 'type = "unbalance"', 'type = "unbalance"\ntime_window = { start = "0.1 s" }'
    windowed = generate(scene_from_text(scene_text("rotor", window), "rotor"), tmp_path / "windowed")
    assert input_names(read_artefact(windowed), ["shaft"]) == ("shaft.speed",)  # though its end is a constant
    polar = 'force = ["0 N", "-49.03 N"]', 'force = { magnitude = "49.03 N", direction = "-90 deg" }'
    weight = generate(scene_from_text(scene_text("rotor", polar), "rotor"), tmp_path / "polar")
    names = tuple(f"loads.weight.force.{part}" for part in ("magnitude", "direction"))
    assert input_names(read_artefact(weight), ["loads.weight"]) == names


@pytest.mark.long
def test_motor_outside_becomes_the_motor_inside_as_steps_get_shorter(exported: Callable[..., Exported]) -> None:
    """Torque in, angle and speed out; the motor's torque is held over a step, so the error is of first order."""
    outside = exported(
        "punching_press_motor",
        (TORQUE,),
        *WITHOUT_MOTOR,
    )
    inside = exported("punching_press_motor").model
    end, synchronous = 0.25, 500.0 / 60.0 * 2.0 * math.pi

    def torque(speed: float) -> float:
        slip = (synchronous - speed) / synchronous
        return 2.0 * 25.0 / (slip / 0.3 + 0.3 / slip)

    expected = inside.simulate(duration=end, times=[0.5 * end, end], outputs=["driver.angle", "driver.speed"])
    errors = []
    for count in (200, 400, 800):
        with outside.instance() as one:
            speed = 490.0 / 60.0 * 2.0 * math.pi
            one.begin(end, **{TORQUE: torque(speed)})
            for k in range(count):
                one.set(**{TORQUE: torque(speed)})
                one.slave.doStep(k * end / count, (k + 1) * end / count - k * end / count)
                angle, speed = one.get("driver.angle", "driver.speed")
            errors.append([angle - expected.outputs["driver.angle"][-1], speed - expected.outputs["driver.speed"][-1]])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(np.abs(errors[-1]) < [1e-4, 2e-3]), errors
    assert np.all(np.abs(ratios - 2.0) < 0.15), (errors, ratios)


def in_ecos(tmp_path: Path, **asked: Any) -> np.ndarray:
    """Values wanted behind each step of a co-simulation in Ecos."""
    asked["result"] = str(tmp_path / "result.json")
    script = Path(__file__).parent / "in_ecos.py"
    subprocess.run(
        [sys.executable, str(script)], input=json.dumps(asked), text=True, check=True, stdout=subprocess.PIPE
    )
    return np.array(json.loads(Path(asked["result"]).read_text(encoding="utf-8")))


needs_ecos = pytest.mark.skipif(
    importlib.util.find_spec("ecospy") is None, reason="needs Ecos, on Linux and x86-64: pip install ballpass[dev]"
)


@needs_ecos
def test_another_importer_gets_the_same_bits(exported: Callable[..., Exported], tmp_path: Path) -> None:
    """Two instances in Ecos, which reads FMUs by a C library of its own; without a stop time, as it steps."""
    found = press(exported)
    names = ["time", "inner.x", "outer.y", "reaction.A.y"]
    rows = in_ecos(
        tmp_path,
        models={"one": str(found.path), "two": str(found.path)},
        connections=[],
        parameters={"two::bearing.clearance": 20e-6},
        step=1e-3,
        count=150,
        wanted=[f"{model}::{name}" for model in ("one", "two") for name in names],
    )
    duration = found.model.simulate(method="stepper", samples_per_cycle=1).statistics.duration
    for own, parameters in ((rows[:, :4], {}), (rows[:, 4:], {"bearing.clearance": 20e-6})):
        solution = found.model.simulate(
            method="stepper", times=np.concatenate([[0.0], own[:, 0]]), duration=duration, parameters=parameters
        )
        assert np.array_equal(own[:, 1:], columns(solution, names[1:])[1:])


@needs_ecos
@pytest.mark.long
def test_fmus_connected_by_another_importer_turn_as_one_model(
    exported: Callable[..., Exported], tmp_path: Path
) -> None:
    """One press has its motor inside; one its motor in Ecos; a third gets the torque of the first one's motor."""
    inside, outside = exported("punching_press_motor"), exported("punching_press_motor", (TORQUE,), *WITHOUT_MOTOR)
    speed = inside.model.parameters["mechanism.driver.speed"]
    torque = float(
        inside.model.simulate(duration=1e-3, times=[0.0], outputs=["drive_torque"]).outputs["drive_torque"][0]
    )
    errors = []
    for count in (200, 400, 800):
        rows = in_ecos(
            tmp_path,
            models={"inside": str(inside.path), "outside": str(outside.path), "third": str(outside.path)},
            connections=[
                ["outside::driver.speed", f"outside::{TORQUE}", True],
                ["inside::drive_torque", f"third::{TORQUE}", False],
            ],
            parameters={f"{model}::{TORQUE}": torque for model in ("outside", "third")},
            step=0.25 / count,
            count=count,
            wanted=[f"{model}::driver.speed" for model in ("inside", "outside", "third")],
        )
        whole, *others = rows[-1]
        errors.append(np.array(others) - whole)
    assert abs(whole / speed - 1.0) > 1e-3
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(np.abs(errors[-1]) < [1e-3, 3e-3]), errors
    assert np.all(np.abs(ratios - 2.0) < 0.15), (errors, ratios)


@pytest.mark.long
@pytest.mark.parametrize(
    "scene", ["rotor", "four_bar", "varying_compliance", "punching_press_motor", "punching_press_roller"]
)
def test_fmus_of_other_scenes_have_the_bits_of_simulate(exported: Callable[..., Exported], scene: str) -> None:
    from fmpy.validation import validate_fmu

    found = exported(scene)
    assert validate_fmu(str(found.path)) == []
    model = found.model
    end = model.simulate(method="stepper", samples_per_cycle=1).statistics.duration
    result = fmpy.simulate_fmu(str(found.path), output=found.outputs, stop_time=end, output_interval=end / 300)
    solution = model.simulate(method="stepper", times=reached(result["time"]), duration=end)
    for name in found.outputs:
        assert np.array_equal(result[name], solution.outputs[name]), name


@pytest.mark.long
def test_a_shaft_whose_speed_is_set_turns_on_from_its_angle(exported: Callable[..., Exported]) -> None:
    """The unbalance turns with the shaft: its force has the angle that is the sum of speed times time."""
    found = exported("rotor", ("shaft.speed",))
    speed = found.model.parameters["shaft.speed"]
    with found.instance() as one:
        one.begin(0.4)
        angle = time = 0.0
        for k, factor in enumerate((1.0, 1.5, 1.5, 0.25, -1.0)):
            one.set(**{"shaft.speed": factor * speed})
            one.slave.doStep(time, 0.0137)
            time, angle = 0.0137 * (k + 1), angle + factor * speed * 0.0137
            size = 5e-3 * 20e-3 * (factor * speed) ** 2
            load = one.get("load.x", "load.y") - [0.0, -49.03]
            assert np.allclose(load, [size * math.cos(angle), size * math.sin(angle)], rtol=0.0, atol=1e-9 * size)
            assert one.get("time")[0] == pytest.approx(time, rel=1e-14)


@pytest.mark.long
def test_a_speed_that_needs_too_many_segments_is_an_error_until_another_is_set(
    exported: Callable[..., Exported],
) -> None:
    found = exported("rotor", ("shaft.speed",))
    speed = found.model.parameters["shaft.speed"]
    for early in (False, True):
        with found.instance(earlyReturnAllowed=early) as one:
            one.begin(0.4)
            one.slave.doStep(0.0, 0.01)
            one.set(**{"shaft.speed": 1e15})
            for _ in range(2):
                with pytest.raises(Exception, match="fmi3DoStep"):
                    one.slave.doStep(0.01, 0.01)
            one.set(**{"shaft.speed": speed})
            one.slave.doStep(0.01, 0.01)
            with found.instance() as two:
                two.begin(0.4)
                two.slave.doStep(0.0, 0.02)
                assert np.allclose(one.get(), two.get(), rtol=1e-4, atol=1e-9)


@pytest.mark.long
@pytest.mark.extreme
def test_a_driver_whose_speed_is_an_input_goes_the_way_of_its_table(
    exported: Callable[..., Exported], scene_text: Callable[..., str]
) -> None:
    """The speed is linear within a step, so that a table with rows at communication points is the same run."""
    motor = scene_text("punching_press_motor").partition("[mechanism.driver.torque]")[2]
    motor = f"[mechanism.driver.torque]{motor.partition('[mechanism.driver.flywheel]')[0]}"
    table = '{ time = ["0 s", "0.1 s", "0.2 s"], speed = ["490 rpm", "490 rpm", "520 rpm"] }'
    given = ('speed = "490 rpm" ', f"table = {table} "), (motor, ""), ("cycles = 8 ", 'duration = "0.3 s" ')
    given = (*given, ("transient_cycles = 4", "transient_cycles = 0"))
    found = exported("punching_press_motor", ("mechanism.driver.speed",), *given)
    solution = found.model.simulate(duration=0.3, rtol=1e-9)
    names = ["driver.angle", "driver.speed", "inner.x", "inner.y"]
    assert not any(name.startswith("mechanism.driver.table") for name in found.places)  # the input takes its place
    with found.instance() as one:
        one.slave.enterInitializationMode(startTime=0.0, stopTime=0.3, tolerance=1e-9)
        place = [found.places["mechanism.driver.speed"]]
        assert one.slave.getDirectionalDerivative([found.places["driver.speed"]], place, [1.0], 1) == [1.0]
        one.slave.exitInitializationMode()
        for k in range(30):
            speed = np.interp((k + 1) / 100, [0.1, 0.2], [490.0, 520.0]) * 2.0 * math.pi / 60.0
            one.set(**{"mechanism.driver.speed": speed})
            one.slave.doStep(k / 100, (k + 1) / 100 - k / 100)
        ends = one.get(*names)
        assert one.slave.getDirectionalDerivative([found.places["driver.speed"]], place, [1.0], 1) == [0.0]
    speeds = [name for name in found.model.parameters if name.startswith("mechanism.driver.table.speed")]
    times = np.linspace(0.0, 0.3, 16)
    for fast in (1.0, 1.3):  # one that is set before the run holds from its start on
        speed = fast * found.model.parameters[speeds[0]]
        still = found.model.simulate(
            method="stepper", duration=0.3, times=reached(times), parameters=dict.fromkeys(speeds, speed)
        )
        with found.instance() as one:
            one.begin(0.3, **({"mechanism.driver.speed": speed} if fast > 1.0 else {}))
            assert one.get("mechanism.driver.speed", "driver.speed").tolist() == [speed, speed]
            assert np.array_equal(one.steps(times), columns(still, found.outputs))
            one.slave.reset()
            assert one.get("mechanism.driver.speed") == [found.model.parameters[speeds[0]]]
    expected = np.array([solution.outputs[name][-1] for name in names])
    assert np.allclose(ends[:2], expected[:2], rtol=1e-12)
    assert np.allclose(ends[2:], expected[2:], rtol=0.0, atol=1e-3 * np.max(np.abs(expected[2:])))


@pytest.mark.long
def test_a_driver_at_constant_speed_takes_its_speed_as_an_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make_model: Callable[..., Model], scene_text: Callable[..., str]
) -> None:
    """The command derives the scene with a speed that may change: the motion is that of the scene until it does."""
    from fmpy.validation import validate_fmu

    monkeypatch.chdir(tmp_path)
    Path("press.toml").write_text(scene_text("punching_press"), encoding="utf-8")
    command = ["export", "press.toml", "--fmu", "--target", "linux-x86_64", "--input", "mechanism.driver.speed"]
    assert CliRunner().invoke(app, command).exit_code == 0
    assert validate_fmu("export/press.fmu") == []
    model = make_model("punching_press")
    found = Exported(Path("export/press.fmu"), model)
    assert set(model.parameters) <= set(found.places)
    names, times = ["inner.x", "inner.y", "reaction.A.x", "reaction.A.y"], np.linspace(0.0, 0.2, 41)
    for fast in (1.0, 1.2):
        speed = fast * model.parameters["mechanism.driver.speed"]
        expected = columns(model.simulate(duration=0.2, times=times, rtol=1e-9, parameters={SPEED: speed}), names)
        with found.instance() as one:
            one.set(**{SPEED: speed})
            one.slave.enterInitializationMode(startTime=0.0, stopTime=0.2, tolerance=1e-9)
            one.slave.exitInitializationMode()
            rows = [one.get(*names)]
            for before, time in pairwise(times):
                one.slave.doStep(before, time - before)
                rows.append(one.get(*names))
            assert np.all(np.abs(rows - expected) < 1e-4 * np.max(np.abs(expected), axis=0))
    slip = '[bearing.cage]\nslip = { time = ["0 s", "0.5 s"], value = [0.0, 0.04] }\n\n[bearing.damping]'
    Path("press.toml").write_text(scene_text("punching_press", ("[bearing.damping]", slip)), encoding="utf-8")
    assert CliRunner().invoke(app, command).exit_code == 0
    assert validate_fmu("export/press.fmu") == []


@pytest.mark.long
def test_the_sources_alone_make_the_same_fmu(exported: Callable[..., Exported], tmp_path: Path) -> None:
    """As buildDescription.xml says, and without warnings."""
    found = press(exported)
    with zipfile.ZipFile(found.path) as archive:
        archive.extractall(tmp_path)
    from xml.etree import ElementTree as Xml

    build = Xml.parse(tmp_path / "sources" / "buildDescription.xml").getroot()
    files = build.find(".//SourceFileSet")
    assert files is not None
    names = [file.attrib["name"] for file in files.iter("SourceFile")]
    library = tmp_path / "scene.so"
    warnings = ["-Wall", "-Wextra", "-Wshadow", "-pedantic", "-Werror"]
    flags = [*files.attrib["compilerOptions"].split(), "-std=c99", "-fPIC", "-shared", *warnings]
    subprocess.run(["cc", *flags, *names, "-o", str(library), "-lm"], cwd=tmp_path / "sources", check=True)
    assert ctypes.CDLL(str(library)).fmi3GetVersion
    (binary,) = (tmp_path / "binaries").glob("*/*")
    shutil.copy(library, binary)
    times = np.linspace(0.0, 0.1, 21)
    with found.instance() as one:
        one.begin(0.1)
        expected = one.steps(times)
    made = Instance(found, str(tmp_path))
    made.begin(0.1)
    assert np.array_equal(made.steps(times), expected)
    made.slave.freeInstance()
