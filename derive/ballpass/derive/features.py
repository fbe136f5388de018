"""Cost of the parts of a scene: the operations that each part adds to the generated functions.

In: a scene.  Out: its features, each with the path of the lines that ask for it and the same scene without it; and
operation counts of every function.  The share of a feature is measured, not estimated: the scene is derived and
lowered once more without it, and the counts are compared.  Features share subexpressions, so shares need not add up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.lowering.functions import LoweredFunctions, lower, operations
from ballpass.derive.outputs import OUTPUTS
from ballpass.derive.scene.bearing_records import Bearing, Damping, EquivalentMass, InitialState, InnerRing
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.scene.mechanism_records import CENTER_OF_MASS, Mechanism
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.shaft_records import ConstantLoad, Load, Shaft
from ballpass.derive.scene.table import FRAME
from ballpass.derive.system import derive
from ballpass.runtime.ratings.elements import element_words


@dataclass(frozen=True, slots=True, kw_only=True)
class Feature:
    """A part of the model that a scene asks for.

    Attributes
    ----------
    name : short, as in "outer ring"
    path : its place in the scene, "bearing.outer_ring"
    modelled : what it adds to the model
    without : the scene without it; None where every scene needs it
    """

    name: str
    path: str
    modelled: str
    without: Scene | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Operations of the generated functions, and how many of them a feature adds.

    Attributes
    ----------
    functions : function name to its arithmetic operations
    added : feature name to function name to operations that vanish without the feature
    """

    functions: dict[str, int]
    added: dict[str, dict[str, int]]


def features(scene: Scene) -> tuple[Feature, ...]:
    """Parts of a scene, in the order of the scene file."""
    return tuple(_features(scene))


def count_operations(scene: Scene) -> dict[str, int]:
    """Arithmetic operations of each generated function of a scene, by name; the stepper's as ``kernel.<name>``, those
    of a ball as ``kernel.ball.<name>``.

    Raises
    ------
    SceneError
        The scene cannot be derived.
    """
    return operations_of(lower(derive(scene), derivatives=False))


def operations_of(lowered: LoweredFunctions) -> dict[str, int]:
    """`count_operations` of a scene that is lowered already."""
    counts = {f.name(): operations(f) for f, _ in (*lowered.functions, *lowered.equations)}
    if lowered.kernels is not None:
        counts |= {f"kernel.{k.function.name()}": operations(k.function) for k in lowered.kernels.functions}
        for balls in lowered.kernels.bearings:
            counts |= {f"kernel.{balls.prefix}ball.{n}": operations(f) for n, f in balls.over_numbers.items()}
    return counts


def cost(scene: Scene, progress: Callable[[str], None] | None = None) -> Cost:
    """Operations of a scene's functions, and what each feature adds to them.

    Parameters
    ----------
    progress : called with the name of each feature that is left out
    """
    full = count_operations(scene)
    added: dict[str, dict[str, int]] = {}
    for feature in features(scene):
        if feature.without is None:
            continue
        if progress is not None:
            progress(feature.name)
        rest = _count_what_is_left(feature.without)
        added[feature.name] = {name: count - rest.get(name, 0) for name, count in full.items()}
    return Cost(functions=full, added=added)


def _count_what_is_left(scene: Scene) -> dict[str, int]:
    """Operations of a scene without one of its parts; outputs that were of this part go with it."""
    try:
        return count_operations(scene)
    except SceneError as error:
        gone = {fault.given for fault in error.faults if fault.key == OUTPUTS}
        if not gone:
            raise
        left = tuple(pattern for pattern in scene.outputs if repr(pattern) not in gone)
        return count_operations(replace(scene, outputs=left))


def _features(scene: Scene) -> Iterator[Feature]:
    mechanism = scene.mechanism
    if mechanism is not None:
        yield from _of_mechanism(scene, mechanism)
    if any(bearing.tilts for bearing in scene.bearings):
        bodies = () if mechanism is None else mechanism.bodies
        driven = [f"mechanism.bodies.{body.name}" for body in bodies if body.transverse_inertia is not None]
        yield Feature(
            name="tilts of the shaft",
            path=f"{driven[0] if driven else 'shaft'}.transverse_inertia",
            modelled="a rigid shaft that tilts in its bearings, with gyroscopic moments",
            without=None,
        )
    for load in scene.loads:
        rest = tuple(other for other in scene.loads if other is not load)
        yield Feature(
            name=f"load {load.name}".rstrip(),
            path=load.path,
            modelled=f"{type(load.law).__name__.removesuffix('Load').lower()} force on the inner ring",
            without=replace(scene, loads=rest) if not _is_free(load) else None,
        )
    for bearing in scene.bearings:
        yield from _of_bearing(scene, bearing)


def _of_mechanism(scene: Scene, mechanism: Mechanism) -> Iterator[Feature]:
    count, torque = len(mechanism.bodies), mechanism.driver.torque
    table = mechanism.driver.table
    driven = " at constant drive speed" if torque is None else f", driven by {torque.words()}"
    if table is not None:
        driven = f", driven at a speed by a table of {len(table.time)} times"
    if mechanism.driver.swing is not None:
        driven = ", driven to and fro"
    yield Feature(
        name="mechanism",
        path="mechanism",
        modelled=f"inertia of {count} moving {'body' if count == 1 else 'bodies'}{driven}, hinge "
        "reactions in closed form",
        without=_without_mechanism(scene, mechanism),
    )
    if mechanism.gravity is not None:
        yield Feature(
            name="gravity",
            path="mechanism.gravity",
            modelled="weight of every moving body of the mechanism",
            without=replace(scene, mechanism=replace(mechanism, gravity=None)),
        )
    for force in mechanism.forces:
        rest = tuple(f for f in mechanism.forces if f is not force)
        yield Feature(
            name=f"{force.word.replace('_', ' ')} {force.name}",
            path=f"mechanism.{force.table}.{force.name}",
            modelled=force.pathway.words() + force.law.words(),
            without=replace(scene, mechanism=replace(mechanism, forces=rest)),
        )


def _of_bearing(scene: Scene, bearing: Bearing) -> Iterator[Feature]:
    of, element = f" of {bearing.name}" if bearing.name else "", ELEMENTS[bearing.element]

    def feature(name: str, key: str, modelled: str, without: Scene | None = None, **other: Any) -> Feature:
        """Without it some fields of the bearing are `other` ones."""
        rest = without if not other else _with(scene, replace(bearing, **other))
        return Feature(name=f"{name}{of}", path=f"{bearing.path}.{key}", modelled=modelled, without=rest)

    words = f"{bearing.balls} {element.noun}s at the cage's angles, {element.force_words} of each"
    yield feature(f"{element.noun} contacts", "contact", words)
    if bearing.coupling == "two-way":
        words = f"play of joint {bearing.joint} moves the linkage, forces of the {element.noun}s act on both bodies"
        yield feature("coupling", "coupling", words, _one_way(scene, bearing))
    if bearing.contact.smoothing is not None:
        words = "contact onset smoothed over a given width: second derivatives exist"
        sharp = replace(bearing.contact, smoothing=None)
        yield feature("contact smoothing", "contact.smoothing", words, contact=sharp)
    if bearing.damping.numbers:
        words = f"law {bearing.damping.law} at each {element.noun}"
        yield feature("contact damping", "damping", words, damping=Damping(law="none", numbers=()))
    if bearing.damping.smoothing is not None:
        words = "kink of the one-sided law at rest smoothed over a given speed"
        kinked = replace(bearing.damping, smoothing=None)
        yield feature("damping smoothing", "damping.smoothing", words, damping=kinked)
    if bearing.inner is not None and bearing.inner.damping is not None:
        words = "viscous damping of the inner ring to the frame"
        free = replace(bearing.inner, damping=None)
        yield feature("inner ring damping", "inner_ring.damping", words, inner=free)
    if bearing.outer is not None:
        words, start = "outer ring on an elastic, damped housing: two coordinates more", bearing.initial
        fixed = InitialState(position=start.position[:-2], velocity=start.velocity[:-2])
        yield feature("outer ring", "outer_ring", words, outer=None, initial=fixed)
    if bearing.cage is not None:
        words = "the cage's own speed: " + ("slip" if bearing.cage.slipping else "a given ratio")
        yield feature("cage", "cage", words, cage=None)
    for effect in bearing.effects:
        words = element_words(EFFECTS[effect.kind].describe(effect), [bearing.element])
        rest = tuple(e for e in bearing.effects if e is not effect)
        yield feature(effect.kind, effect.kind, words, effects=rest)


def _is_free(load: Load) -> bool:
    return isinstance(load.law, ConstantLoad) and load.law.force.kind == "zero"


def _without_mechanism(scene: Scene, mechanism: Mechanism) -> Scene | None:
    """The bearings alone on their shaft, unloaded; None where there is none, they act back on the
    mechanism, or its speed changes."""
    if not scene.bearings or scene.coupled or mechanism.driver.turns_unevenly:
        return None
    bearings, shaft = [], Shaft(speed=mechanism.driver.speed, ring="inner", mass=None)
    for body in mechanism.bodies:
        if body.transverse_inertia is not None:
            shaft = replace(
                shaft,
                transverse_inertia=body.transverse_inertia,
                mass=body.mass,
                polar_inertia=body.inertia,
                center_of_mass=dict(body.positions).get(CENTER_OF_MASS),
            )
    for bearing in scene.bearings:
        inner = bearing.inner
        assert inner is not None  # loaded one-way
        if isinstance(inner.mass, EquivalentMass):
            path = f"{bearing.path}.inner_ring.mass"
            number = SceneNumber(path=path, value=1.0, unit="kg", description="Mass of the inner ring", latex="m_i")
            inner = InnerRing(mass=number, damping=inner.damping)
        bearings.append(replace(bearing, inner=inner, joint=None, share=None))
    return replace(scene, mechanism=None, shaft=shaft, bearings=tuple(bearings))


def _one_way(scene: Scene, bearing: Bearing) -> Scene | None:
    """The scene with its bearing loaded by the ideal linkage; None where one-way coupling has no place."""
    mechanism = scene.mechanism
    assert mechanism is not None  # what the bearing is coupled with
    joint = mechanism.joint(mechanism.driver.joint)
    if mechanism.driver.torque is not None:  # loads of bearings follow from a speed that is known
        return None
    if len(scene.bearings) > 1 or bearing.joint != joint.name or bearing.inner_body != joint.other(FRAME):
        return None
    share = SceneNumber(
        path=f"{bearing.path}.share", value=1.0, unit="1", description="Share of the reaction", latex="s"
    )
    mass = SceneNumber(
        path=f"{bearing.path}.inner_ring.mass", value=1.0, unit="kg", description="Mass of the inner ring", latex="m_i"
    )
    loaded = replace(
        bearing, coupling="one-way", inner_body="", count=None, share=share, inner=InnerRing(mass=mass, damping=None)
    )
    return _with(scene, loaded)


def _with(scene: Scene, bearing: Bearing) -> Scene:
    """The scene with another bearing of that name."""
    return replace(scene, bearings=tuple(bearing if b.name == bearing.name else b for b in scene.bearings))
