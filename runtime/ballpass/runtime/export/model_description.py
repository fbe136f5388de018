"""The description of an FMU: ``modelDescription.xml`` and ``buildDescription.xml`` of FMI 3.0.

In: a manifest, the names of its inputs.  Out: trees of XML.  Value references are those of ``driver/fmi/fmi.c``: 0 is
the time; then parameters, states, derivatives of states, outputs that are no states, in the scene's order; then the
driver's speed where it is an input, in place of its table's parameters.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from itertools import chain
from xml.etree import ElementTree as Xml

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.units import unit_size
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.export.c_program import LIBRARY_FLAGS
from ballpass.runtime.export.dependencies import Dependencies
from ballpass.runtime.export.scene_numbers import computed_outputs, speed_table, varying
from ballpass.runtime.time.timeline import driver, speed_name, stretch

#: Input that the driver's speed is, where the scene has a table of it.
SPEED = "mechanism.driver.speed"

#: Base units of the standard, by our names.
_BASE = {"gram": "kg", "meter": "m", "second": "s", "radian": "rad"}

#: A name of the standard's structured naming convention.
_STRUCTURED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)


def model_description(
    manifest: Manifest,
    identifier: str,
    token: str,
    inputs: Sequence[str],
    known: Dependencies,
    magnitudes: Sequence[float],
) -> Xml.Element:
    """Tree of ``modelDescription.xml``.

    Parameters
    ----------
    identifier : C identifier that names the library
    token : instantiation token
    inputs : parameters that are inputs
    known : dependencies of rates and outputs
    magnitudes : of the states [their units]
    """
    parameters = {info.name: info for info in manifest.parameters}
    names = [*parameters, *(info.name for info in manifest.outputs), *(info.name for info in manifest.states)]
    laws = dict.fromkeys(bearing.damping.law for bearing in manifest.bearings)
    structured = all(_STRUCTURED.fullmatch(name) for name in names)
    root = Xml.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=manifest.title or manifest.scene,
        instantiationToken=token,
        description=f"Scene {manifest.scene}" + (f", damping of ball contacts: {' and '.join(laws)}" if laws else ""),
        generationTool=f"ballpass {__version__}",
        variableNamingConvention="structured" if structured else "flat",
    )
    Xml.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier,
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
        canHandleVariableCommunicationStepSize="true",
        providesDirectionalDerivatives="true",
        providesAdjointDerivatives="true",
        maxOutputDerivativeOrder="1",
        mightReturnEarlyFromDoStep="true",
        providesIntermediateUpdate="false",
        hasEventMode="false",
    )
    _units(root, manifest)
    categories = Xml.SubElement(root, "LogCategories")
    Xml.SubElement(categories, "Category", name="logStatusError", description="Why a call has failed")
    duration, step = experiment(manifest)
    rtol = repr(manifest.run.rtol)
    Xml.SubElement(
        root, "DefaultExperiment", startTime="0", stopTime=repr(duration), tolerance=rtol, stepSize=f"{step:.12g}"
    )
    _structure(root, manifest, _variables(root, manifest, inputs, magnitudes), known, inputs)
    return root


def _units(root: Xml.Element, manifest: Manifest) -> None:
    variables = (*manifest.states, *manifest.outputs)
    names = {*(info.unit for info in manifest.parameters), *(info.unit for info in variables)}
    names |= {_rate_unit(info.unit) for info in manifest.states}
    place = Xml.SubElement(root, "UnitDefinitions")
    for name in sorted({*names, "s"} - {"", "1"}):
        unit = Xml.SubElement(place, "Unit", name=name)
        powers = base_powers(name)
        if powers is not None:
            Xml.SubElement(unit, "BaseUnit", {base: str(power) for base, power in powers.items()})


def base_powers(unit: str) -> dict[str, int] | None:
    """Powers of the base units in an SI unit such as ``N*s/m``; None where one is no whole number."""
    powers = unit_size(unit).base
    if any(power.denominator != 1 for _, power in powers):
        return None
    return {_BASE[name]: int(power) for name, power in powers}


def _rate_unit(unit: str) -> str:
    """Unit of the derivative of a state."""
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"


def experiment(manifest: Manifest) -> tuple[float, float]:
    """Length of the scene's run, and time between its samples [s]."""
    # where a shaft stands at t = 0 is derived, and changes no length
    values = {info.name: 0.0 for info in manifest.constants} | {p.name: p.default for p in manifest.parameters}
    run, turn = manifest.run, stretch(manifest, values)
    duration = run.duration if run.cycles is None else driver(manifest, values).after(run.cycles)
    if duration is None or not math.isfinite(duration):
        return 1.0, 1.0 / run.samples_per_cycle
    return duration, (turn if math.isfinite(turn) else duration) / run.samples_per_cycle


def _variables(
    root: Xml.Element, manifest: Manifest, inputs: Sequence[str], magnitudes: Sequence[float]
) -> dict[str, int]:
    """Variables; returns their value references."""
    place = Xml.SubElement(root, "ModelVariables")
    references: dict[str, int] = {}

    def add(name: str, unit: str, description: str, **attributes: str) -> Xml.Element:
        references[name] = len(references)
        given = {"name": name, "valueReference": str(references[name]), "description": description, **attributes}
        if unit not in ("", "1"):
            given["unit"] = unit
        return Xml.SubElement(place, "Float64", {key: value for key, value in given.items() if value})

    add("time", "s", "Time", causality="independent", variability="continuous")
    changing, replaced = varying(manifest), {*chain(*speed_table(manifest))} if SPEED in inputs else {}
    for info in manifest.parameters:
        start = repr(info.default)
        if info.name in replaced:
            references[info.name] = len(references)
        elif info.name in inputs:
            add(info.name, info.unit, info.description, causality="input", variability="continuous", start=start)
        else:
            tunable = "tunable" if info.name in changing else "fixed"
            bounds = {"min": info.least, "max": info.most}
            limits = {key: repr(value) for key, value in bounds.items() if value is not None}
            add(
                *(info.name, info.unit, info.description),
                **{"causality": "parameter", "variability": tunable, "start": start, **limits},
            )
    calculated = {"variability": "continuous", "initial": "calculated"}
    wanted = {info.name for info in manifest.outputs}
    for state, magnitude in zip(manifest.states, magnitudes, strict=True):
        causality = "output" if state.name in wanted else "local"
        add(state.name, state.unit, state.description, causality=causality, nominal=repr(magnitude), **calculated)
    for state in manifest.states:
        unit, description = _rate_unit(state.unit), f"Derivative of {state.name}"
        of = str(references[state.name])
        add(f"der({state.name})", unit, description, causality="local", **calculated, derivative=of)
    for output in computed_outputs(manifest):
        variable = add(output.name, output.unit, output.description, causality="output", **calculated)
        if output.size > 1:
            Xml.SubElement(variable, "Dimension", start=str(output.size))
    if SPEED in inputs:
        start = repr(next(info.default for info in manifest.parameters if info.name == speed_name(manifest)))
        text = "Speed of the driver: at first that of the start, then the one at the end of the coming step"
        add(SPEED, "rad/s", text, causality="input", variability="continuous", start=start)
    return references


def _structure(
    root: Xml.Element, manifest: Manifest, references: dict[str, int], known: Dependencies, inputs: Sequence[str]
) -> None:
    """Which variables are outputs, derivatives, and unknown at the start, and what they depend on."""
    structure = Xml.SubElement(root, "ModelStructure")
    speeds, times = speed_table(manifest) if SPEED in inputs else ((), ())

    def add(kind: str, name: str, knowns: Iterable[str], gone: Sequence[str]) -> None:
        found = {SPEED if item in speeds else item for item in knowns if item not in gone}
        numbers = " ".join(map(str, sorted(references[item] for item in found)))
        Xml.SubElement(structure, kind, valueReference=str(references[name]), dependencies=numbers)

    states, wanted = [info.name for info in manifest.states], {info.name for info in manifest.outputs}
    rates, computed = [f"der({name})" for name in states], [info.name for info in computed_outputs(manifest)]
    kinds = {"Output": [*(name for name in states if name in wanted), *computed], "ContinuousStateDerivative": rates}
    for kind, names in kinds.items():
        for name in names:
            # a table that an input replaces has no effect in a run
            add(kind, name, known.running[name], (*speeds, *times))
    for name in (*states, *rates, *computed):
        add("InitialUnknown", name, known.initial[name], times)


def build_description(identifier: str, sources: Iterable[str]) -> Xml.Element:
    """Tree of ``sources/buildDescription.xml``; `sources` are the C files."""
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    build = Xml.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    flags = " ".join(flag for flag in LIBRARY_FLAGS if flag not in ("-fPIC", "-shared", "-std=c99"))
    files = Xml.SubElement(build, "SourceFileSet", language="C99", compiler="gcc", compilerOptions=flags)
    for name in sources:
        Xml.SubElement(files, "SourceFile", name=name)
    Xml.SubElement(build, "Library", name="m")
    return root
