"""The description of an FMU 2.0 from that of the same FMU 3.0.

In: the tree of ``modelDescription.xml`` of FMI 3.0.  Out: that of FMI 2.0.  It has no arrays: each number of one is a
variable, ``ball.force[1]``, and variables behind it have later value references.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from xml.etree import ElementTree as Xml

#: Attributes of the root and of <CoSimulation>, by their names in FMI 3.0.
_ROOT = {"modelName": "modelName", "instantiationToken": "guid", "description": "description"}
_ROOT |= {name: name for name in ("generationTool", "variableNamingConvention")}
_ABLE = {
    name: name for name in ("modelIdentifier", "canHandleVariableCommunicationStepSize", "maxOutputDerivativeOrder")
}
_ABLE |= {"canGetAndSetFMUState": "canGetAndSetFMUstate", "canSerializeFMUState": "canSerializeFMUstate"}
_ABLE |= {"providesDirectionalDerivatives": "providesDirectionalDerivative"}

#: Attributes of a number, the others are of the variable.
_REAL = ("unit", "min", "max", "nominal", "start")

#: Lists of the model's structure, by the elements of FMI 3.0.
_STRUCTURE = {
    "Outputs": "Output",
    "Derivatives": "ContinuousStateDerivative",
    "InitialUnknowns": "InitialUnknown",
}


def fmi2_description(given: Xml.Element, sources: Iterable[str]) -> Xml.Element:
    """Tree of ``modelDescription.xml`` by FMI 2.0.

    Parameters
    ----------
    given : that by FMI 3.0
    sources : C files to compile
    """
    root = Xml.Element("fmiModelDescription", {"fmiVersion": "2.0"} | _renamed(given, _ROOT))
    able = Xml.SubElement(root, "CoSimulation", _renamed(given.find("CoSimulation"), _ABLE))
    able.set("canNotUseMemoryManagementFunctions", "true")
    files = Xml.SubElement(able, "SourceFiles")
    for name in sources:
        Xml.SubElement(files, "File", name=name)
    for kept in ("UnitDefinitions", "LogCategories", "DefaultExperiment"):
        root.extend(given.findall(kept))
    # places among the variables, counted from 1, by value references of FMI 3.0
    places: dict[str, list[int]] = {}
    variables = Xml.SubElement(root, "ModelVariables")
    derivatives: list[tuple[Xml.Element, str]] = []
    behind = 0
    for item in given.iterfind("ModelVariables/Float64"):
        reference, dimension = item.attrib["valueReference"], item.find("Dimension")
        names = [item.attrib["name"]]
        if dimension is not None:
            names = [f"{names[0]}[{k + 1}]" for k in range(int(dimension.attrib["start"]))]
        for k, name in enumerate(names):
            own = {key: text for key, text in item.attrib.items() if key not in (*_REAL, "derivative")}
            if len(names) > 1:
                own["description"] += f" ({k + 1})"
            own |= {"name": name, "valueReference": str(int(reference) + behind + k)}
            number = Xml.SubElement(Xml.SubElement(variables, "ScalarVariable", own), "Real")
            number.attrib.update({key: item.attrib[key] for key in _REAL if key in item.attrib})
            if "derivative" in item.attrib:
                derivatives.append((number, item.attrib["derivative"]))
            places.setdefault(reference, []).append(len(variables))
        behind += len(names) - 1
    for number, of in derivatives:
        number.set("derivative", str(places[of][0]))
    structure = Xml.SubElement(root, "ModelStructure")
    for kind, name in _STRUCTURE.items():
        found = sorted(_unknowns(given.iterfind(f"ModelStructure/{name}"), places))
        group = Xml.SubElement(structure, kind) if found else structure
        for place, known in found:
            Xml.SubElement(group, "Unknown", index=str(place), dependencies=" ".join(map(str, known)))
    return root


def _renamed(given: Xml.Element | None, names: dict[str, str]) -> dict[str, str]:
    """Attributes of an element by their new names."""
    assert given is not None  # `model_description` writes it
    return {new: given.attrib[name] for name, new in names.items() if name in given.attrib}


def _unknowns(given: Iterable[Xml.Element], places: dict[str, list[int]]) -> Iterator[tuple[int, list[int]]]:
    """Places of unknowns, and of what each depends on."""
    for item in given:
        known = sorted(place for name in item.attrib["dependencies"].split() for place in places[name])
        for place in places[item.attrib["valueReference"]]:
            yield place, known
