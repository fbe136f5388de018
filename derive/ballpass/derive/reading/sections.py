"""All tables of the scene file with their keys, for the reference page and the JSON Schema.

The keys are those of the records that the reader fills.  Where the value of one key (a law, a type) decides which other
keys are allowed, each of its values is a section.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.bearing.elements.element import RINGS
from ballpass.derive.bearing.laws import LAWS
from ballpass.derive.drive import LAWS as TORQUE_LAWS
from ballpass.derive.mechanism.forces import FORCE_TABLES, ForceTable
from ballpass.derive.reading import read_bearing, read_cage, read_coupling, read_load, read_mechanism
from ballpass.derive.reading.read_designation import DESIGNATION
from ballpass.derive.reading.read_fit import Fit
from ballpass.derive.scene import bearing_records, mechanism_records, rating_records, records, shaft_records
from ballpass.derive.scene.keys import Fill, Key
from ballpass.derive.scene.read_keys import Either, choices_of, keys_of

#: Text in place of a name in descriptions.
NAME: Fill = {"NAME": "<name>", "POINT": "<name>", "OWNER": "body or frame", "INDEX": ""}


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A table of the scene file.

    Attributes
    ----------
    path : parts of its place; "*" stands for a name that the user chooses, "#" for a number
    keys : by name
    one_of : groups of keys of which one is given
    variant : key, and the value of it that the section holds for; empty where it always does
    many : it may be a list of such tables
    free : it may have any keys
    """

    path: tuple[str, ...]
    keys: Mapping[str, Key]
    one_of: tuple[Either, ...] = ()
    variant: tuple[str, str] = ("", "")
    many: bool = False
    free: bool = False


def sections() -> tuple[Section, ...]:
    """The tables of a scene."""
    return (*_top(), *_mechanism(), *_load(), *_bearing())


def _of(path: str, *kinds: type[Any], fill: Fill = NAME, **more: Any) -> Section:
    """The keys of records, and others."""
    keys = {name: key for kind in kinds for name, key in keys_of(kind, fill).items()}
    one_of = tuple(rule for kind in kinds for rule in choices_of(kind, fill))
    return Section(path=tuple(path.split(".")) if path else (), keys=keys | more, one_of=one_of)


def _variants(
    path: str, tag: Key, name: str, kinds: Mapping[str, tuple[Mapping[str, Key], tuple[Either, ...]]]
) -> Iterator[Section]:
    for value, (keys, one_of) in kinds.items():
        yield Section(path=tuple(path.split(".")), keys={name: tag, **keys}, one_of=one_of, variant=(name, value))


def _top() -> Iterator[Section]:
    yield _of("", records.Scene)
    yield _of("shaft", shaft_records.Shaft)
    yield _of("run", records.RunSettings, outputs=records.OUTPUTS)
    yield _of("duty.*", records.DutyState)
    yield Section(path=("duty", "*", "set"), keys={}, free=True)


def _mechanism() -> Iterator[Section]:
    yield _of("mechanism", gravity=read_mechanism.GRAVITY)
    yield _of("mechanism.driver", mechanism_records.Driver, fill=read_mechanism.CONSTANT)
    yield _of("mechanism.driver.range", mechanism_records.DriverRange)
    yield _of("mechanism.driver.swing", mechanism_records.OscillatingDriver)
    yield _of("mechanism.driver.table", mechanism_records.SpeedOverTime)
    yield _of("mechanism.driver.flywheel", inertia=read_mechanism.FLYWHEEL)
    torques = {name: (keys_of(law), choices_of(law)) for name, law in TORQUE_LAWS.items()}
    yield from _variants("mechanism.driver.torque", read_mechanism.LAW, "law", torques)
    points = {"*": mechanism_records.POINT.filled(NAME)}
    yield Section(path=("mechanism", "frame", "points"), keys=points)
    yield _of("mechanism.bodies.*", mechanism_records.Body)
    yield Section(path=("mechanism", "bodies", "*", "points"), keys=points)
    yield Section(path=("mechanism", "bodies", "*", "positions"), keys={"*": mechanism_records.POSITION.filled(NAME)})
    yield _of("mechanism.joints.*", mechanism_records.Joint, branch=read_mechanism.BRANCH)
    yield _of("mechanism.gears.*", mechanism_records.Gear)
    for table in FORCE_TABLES:
        yield from _forces(table)


def _forces(table: ForceTable) -> Iterator[Section]:
    """Each pathway with each law."""
    for pathway in table.pathways:
        for law in table.laws:
            path, fill = f"mechanism.{table.key}.*", pathway.fill("<name>", "body")
            left_out = keys_of(pathway).keys() & pathway.left_out(law).keys()
            inner = law.inner()
            keys = keys_of(pathway, fill) | (keys_of(law, fill) if inner is None else {})
            keys = {name: key for name, key in keys.items() if name not in left_out}
            yield Section(path=tuple(path.split(".")), keys=keys, one_of=choices_of(law, fill))
            if inner is not None:
                yield Section(path=(*path.split("."), law.key), keys=keys_of(inner, fill), many=inner is not law)


def _load() -> Iterator[Section]:
    common = keys_of(shaft_records.Load)
    loads = {name: (keys_of(law) | common, choices_of(law)) for name, law in read_load.LOADS.items()}
    yield from _variants("load", read_load.TYPE, "type", loads)
    both = {"phase": read_load.components_of_phase()}
    yield from _variants("load", read_load.TYPE, "type", {"harmonic": (both, ())})
    for key, fill in read_load.WINDOWS.items():
        yield _of(f"load.{key}", shaft_records.LoadWindow, fill=fill)


def _bearing() -> Iterator[Section]:
    yield _of(
        "bearing",
        bearing_records.Bearing,
        rating_records.Catalogue,
        designation=DESIGNATION,
        element=read_bearing.ELEMENT,
    )
    yield _of("bearing.fit", Fit)
    yield _of("bearing.lubrication", rating_records.Lubrication)
    yield _of("bearing.alignment", rating_records.Alignment)
    for element in ELEMENTS.values():
        if element.derived is not element.given:
            yield _of("bearing.contact", element.derived, bearing_records.Material, fill=RINGS)
            yield _of("bearing.contact.ball_material", bearing_records.Material, fill=element.element_material)
        yield _of("bearing.contact", element.given)
    smoothing = keys_of(bearing_records.Damping)
    laws = {name: ({**law.keys, **(smoothing if law.kinked_at_rest else {})}, law.one_of) for name, law in LAWS.items()}
    yield from _variants("bearing.damping", read_bearing.LAW, "law", laws)
    yield _of("bearing.inner_ring", bearing_records.InnerRing, body=read_coupling.BODY)
    yield _of("bearing.inner_ring.equivalent_mass", bearing_records.EquivalentMass)
    outer = {"support": read_bearing.SUPPORT} | keys_of(bearing_records.OuterRing)
    yield Section(path=("bearing", "outer_ring"), keys=outer)
    for effect in EFFECTS.values():
        for path, keys in effect.tables.items():
            yield Section(path=("bearing", effect.name, *path), keys=keys)
    yield _of("bearing.cage", bearing_records.CageMotion)
    yield Section(path=("bearing", "cage", "slip"), keys=read_cage.SLIPS)
    yield _of("bearing.cage.jitter", read_cage.Jitter)
    yield Section(path=("bearing", "initial"), keys=read_bearing.INITIAL)
