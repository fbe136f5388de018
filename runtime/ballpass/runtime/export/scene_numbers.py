"""C code of a scene for its stand-alone program: its numbers, constants, outputs, margins of its linkage.

In: a manifest, or a model whose functions CasADi can write.  Out: texts of ``scene.h``, ``scene.c``, ``constants.c``,
``outputs.c`` and ``margins.c``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import casadi

from ballpass.runtime.contract.manifest import Manifest, MarginInfo, TurningInfo, VariableInfo
from ballpass.runtime.contract.method_registry import METHODS, STEPPERS
from ballpass.runtime.native.driver_library import DRIVER
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.locating import has_kinks, tight_below
from ballpass.runtime.time import timeline
from ballpass.runtime.time.timeline import speed_name

#: C sources that are the same for every scene, and templates of those that are not.
STANDALONE = DRIVER / "standalone"

#: Names of parameters that may change in a run.
_VARYING = re.compile(
    r"(loads?(\.\w+)?|mechanism\.forces\.\w+)\.force\.(x|y|magnitude|direction)"
    r"|mechanism\.torques\.\w+\.torque"
    r"|mechanism\.driver\.torque\.torque"
    r"|shaft\.speed"
)


def moment_symbols(manifest: Manifest) -> dict[str, casadi.SX]:
    """Symbols t, x, u, p, c."""
    counts = (manifest.states, manifest.inputs, manifest.parameters, manifest.constants)
    return {name: casadi.SX.sym(name, size) for name, size in zip("txupc", (1, *map(len, counts)), strict=True)}


def margins_of(manifest: Manifest) -> tuple[MarginInfo, ...]:
    """Of the dyads of the linkage; none where there is no linkage, or its driver's speed changes."""
    mechanism = manifest.mechanism
    return () if mechanism is None or mechanism.angle or speed_table(manifest)[0] else mechanism.margins


def columns_of(manifest: Manifest) -> tuple[tuple[str, str], ...]:
    """Name and unit of the numbers of a sample: time, states, outputs that are no states; balls count from 1."""
    rows = [
        (info.name if info.size == 1 else f"{info.name}[{k + 1}]", info.unit)
        for info in computed_outputs(manifest)
        for k in range(info.size)
    ]
    return (("t", "s"), *((info.name, info.unit) for info in manifest.states), *rows)


def computed_outputs(manifest: Manifest) -> tuple[VariableInfo, ...]:
    """Outputs that are no states."""
    states = {info.name for info in manifest.states}
    return tuple(info for info in manifest.outputs if info.name not in states)


def varying(manifest: Manifest) -> tuple[str, ...]:
    """Parameters that may change in a run: forces, torques, loads, speed of a shaft.

    Not the speed of a driver: one at constant speed has no acceleration that a change of it would need.  Nor that of a
    shaft whose cage slips by a table: the lag of the cage is a multiple of it, so that its angle would jump.
    """
    lags = any(info.lag for info in manifest.turnings)
    names = (info.name for info in manifest.parameters if _VARYING.fullmatch(info.name))
    return tuple(name for name in names if not (lags and name == "shaft.speed"))


def speed_table(manifest: Manifest) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Parameters that are speeds and times of the table of a driver's speed; none without."""
    info = timeline.driver_info(manifest)
    return ((), ()) if info is None or not info.times else (info.speeds, info.times)


def filled(template: Path, **values: str) -> str:
    """Text of a template with values in place of ``@NAME@``."""
    return re.sub("@([A-Z]+)@", lambda found: values[found[1]], template.read_text(encoding="utf-8"))


def scene_texts(model: LoadedModel) -> dict[str, str]:
    """Content of the files of a scene by name; ``margins.c`` where its linkage can lose its assembly."""
    constants = model.symbolic("constants")
    texts = {
        "scene.h": _scene_header(model.manifest),
        "scene.c": _scene_source(model.manifest),
        "constants.c": behind("The derived constants", constants, "scene_constants", MOMENT[3:4], "c"),
        "outputs.c": behind("The outputs", outputs_function(model), "scene_outputs", MOMENT, "y"),
    }
    if margins_of(model.manifest):
        margins, given = model.symbolic("assembly"), (MOMENT[0], *MOMENT[2:])
        texts["margins.c"] = behind("The linkage's margins", margins, "scene_margins", given, "margins")
    return texts


def _scene_header(manifest: Manifest) -> str:
    """Text of ``scene.h``: declarations of the scene for the other files."""
    sizes = {
        "SCENE_STATES": len(manifest.states),
        "SCENE_INPUTS": len(manifest.inputs),
        "SCENE_TURNINGS": len(manifest.turnings),
        "SCENE_PARAMETERS": len(manifest.parameters),
        "SCENE_CONSTANTS": len(manifest.constants),
        "SCENE_RELATIONS": len(manifest.relations),
        "SCENE_MARGINS": len(margins_of(manifest)),
        "SCENE_METHODS": 1 + len(METHODS),
        "SCENE_OUTPUTS": sum(info.size for info in computed_outputs(manifest)),
    }
    kinks = "\n/* The laws have kinks, which located.c ends steps on. */\n#define SCENE_KINKS\n"
    return filled(
        STANDALONE / "scene.h.in",
        SIZES=", ".join(f"{name} = {value}" for name, value in sizes.items()),
        KINKS=kinks if has_kinks(manifest) else "",
        TIGHT=repr(tight_below(manifest)),
        LINKAGE=(STANDALONE / "linkage.h.in").read_text(encoding="utf-8") if margins_of(manifest) else "",
    )


def _scene_source(manifest: Manifest) -> str:
    """Text of ``scene.c``: the scene's numbers."""
    names = [*(info.name for info in manifest.parameters), *(info.name for info in manifest.constants)]
    place = {name: k for k, name in enumerate(names)}
    speed = speed_name(manifest)
    run = manifest.run
    methods = ("auto", *METHODS)
    changing = varying(manifest)
    parameters = [
        f"    {{{_string(p.name)}, {_string(p.unit)}, {_string(p.description)}, {p.default!r}, "
        f"{_bound(p.above, '-INFINITY')}, {_bound(p.least, '-INFINITY')}, {_bound(p.most, 'INFINITY')}, "
        f"{_bound(p.below, 'INFINITY')}, {int(p.name in changing)}}},"
        for p in manifest.parameters
    ]
    relations = [f"    {{{place[name]}, {place[other]}, {factor!r}}}," for name, factor, other in manifest.relations]
    columns = [f"    {{{_string(name)}, {_string(unit)}}}," for name, unit in columns_of(manifest)]
    indices, inputs = _inputs(manifest, place)
    more, turnings = _turnings(manifest.turnings, place)
    drivers = [k for k, info in enumerate(manifest.turnings) if info.kind == "driver"]
    offsets = [str(place[info.offset]) if info.offset else "-1" for info in manifest.turnings]
    return filled(
        STANDALONE / "scene.c.in",
        TITLE=_string(manifest.title),
        PARAMETERS="\n".join(parameters),
        RELATIONS="\n".join(relations) or "    {0, 0, 0.0}, /* none */",  # C has no arrays of length zero
        CONSTANTS=_listed(_string(info.name) for info in manifest.constants),
        COLUMNS="\n".join(columns),
        INITIAL=_listed(str(place[name]) for name in manifest.initial),
        SPEED="-1" if speed is None else str(place[speed]),
        LINKAGE="".join(f"{line}\n" for line in _linkage(manifest, place)),
        PLACES="".join(f"{line}\n" for line in (*indices, *more)),
        INPUTS=inputs,
        TURNINGS=turnings,
        DRIVER=str(drivers[0] if drivers else -1),
        OFFSETS=_listed(offsets) or "-1",  # C has no arrays of length zero
        CYCLES=repr(float(run.cycles or 0.0)),
        DURATION=repr(float(run.duration or 0.0)),
        RTOL=repr(run.rtol),
        SAMPLES=str(run.samples_per_cycle),
        METHOD=_string(STEPPERS.get(run.method, "auto")),
        METHODS=_listed(_string(name) for name in methods),
        LISTED=_string(", ".join(methods)),
    )


def _linkage(manifest: Manifest, place: dict[str, int]) -> list[str]:
    """Definitions that only a scene with a linkage has."""
    margins = margins_of(manifest)
    if manifest.mechanism is None or not margins:
        return []
    rows = [f"    {{{_string(margin.joint)}, {_string(margin.description)}}}," for margin in margins]
    start = place[manifest.mechanism.start_angle]
    return [f"const int scene_start_angle = {start};", "const scene_margin scene_margin_infos[] = {", *rows, "};", ""]


def _array(arrays: list[str], name: str, names: Sequence[str], place: Mapping[str, int]) -> str:
    """An array of places is declared; its name."""
    if not names:
        return "NULL"
    arrays.append(f"static const int {name}[] = {{{_listed(str(place[n]) for n in names)}}};")
    return name


def _inputs(manifest: Manifest, place: dict[str, int]) -> tuple[list[str], str]:
    """Arrays of places, and the entries of the table of inputs that name them."""
    arrays, entries = list[str](), []
    turnings = {info.name: k for k, info in enumerate(manifest.turnings)}
    for k, item in enumerate(manifest.inputs):
        edges = _array(arrays, f"edges_{k}", [edge for window in item.windows for edge in window], place)
        times = _array(arrays, f"times_{k}", item.times, place)
        heights = _array(arrays, f"heights_{k}", item.values, place)
        entries.append(
            f"    {{SCHEDULE_{item.kind.upper()}, {turnings.get(item.turning, -1)}, {item.turns}, {item.parts}, "
            f"{len(item.windows)}, {edges}, {len(item.times)}, {times}, {heights}}}, /* {item.name} */"
        )
    # C has no arrays of length zero
    return arrays, "\n".join(entries) or "    {SCHEDULE_BORDER, -1, 1, 1, 0, NULL, 0, NULL, NULL}, /* none */"


def _turnings(infos: Sequence[TurningInfo], place: dict[str, int]) -> tuple[list[str], str]:
    """The same of the table of turnings."""
    arrays, entries, known = list[str](), [], {"": -1, **place}
    live = len(place) + len(infos)
    for k, info in enumerate(infos):
        listed = [
            _array(arrays, f"turning_{name}_{k}", getattr(info, name), place)
            for name in ("times", "speeds", "lag_times", "lags")
        ]
        # an angle of its own, which starts from the parameter
        numbers = [len(place) + k, *(known[name] for name in (info.rate, info.turns, info.rolling, info.lag))]
        numbers += [live if info.times else -1, len(info.times)]
        entries.append(
            f"    {{{_listed(map(str, numbers))}, {listed[0]}, {listed[1]}, {len(info.lag_times)}, {listed[2]}, "
            f"{listed[3]}}}, /* {info.name} */"
        )
    return arrays, "\n".join(entries) or "    {-1, -1, -1, -1, -1, -1, 0, NULL, NULL, 0, NULL, NULL}, /* none */"


def outputs_function(model: LoadedModel) -> casadi.Function:
    """Outputs that are no states, one below the other, over t, x, u, p and c."""
    graph = model.symbolic("outputs")
    arguments = dict(zip(graph.name_in(), graph.sx_in(), strict=True))
    results = dict(zip((info.name for info in model.manifest.outputs), graph.call([*arguments.values()]), strict=True))
    computed = (casadi.densify(results[info.name]) for info in computed_outputs(model.manifest))
    rows = casadi.vertcat(casadi.SX(0, 1), *computed)
    return casadi.Function("outputs", [*arguments.values()], [rows], [*arguments], ["y"])


#: Arguments of functions of a moment: declarations, and the addresses of the numbers.
MOMENT = (
    ("double t", "&t"),
    ("const double *x", "x"),
    ("const double *u", "u"),
    ("const double *p", "p"),
    ("const double *c", "c"),
)


def behind(what: str, function: casadi.Function, name: str, given: Sequence[tuple[str, str]], result: str) -> str:
    """C of a function as CasADi writes it, behind a function `name` with the project's signature.

    Parameters
    ----------
    given : declarations of its arguments, named as those of CasADi's function, and their addresses
    result : name of the array for its result
    """
    generator = casadi.CodeGenerator(f"{function.name()}.c", {"with_header": False, "with_export": False})
    generator.add(function)
    # C has no arrays of length zero
    sizes = [max(size, 1) for size in (function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w())]
    addresses = {declaration.rpartition(" ")[2].lstrip("*"): address for declaration, address in given}
    # a function that does not depend on time has no such argument
    arguments = "\n".join(f"    arguments[{k}] = {addresses[name]};" for k, name in enumerate(function.name_in()))
    return filled(
        STANDALONE / "casadi_function.c.in",
        WHAT=what,
        NAME=name,
        GIVEN=", ".join(declaration for declaration, _ in given),
        RESULT=result,
        ARGUMENTS=str(sizes[0]),
        RESULTS=str(sizes[1]),
        INTEGERS=str(sizes[2]),
        REALS=str(sizes[3]),
        ADDRESSES=arguments,
        FUNCTION=function.name(),
        CODE=generator.dump().strip(),
    )


def _string(text: str) -> str:
    """C string literal; all but plain ASCII as octal escapes."""
    plain = {byte for byte in range(32, 127) if chr(byte) not in '"\\?'}
    return '"' + "".join(chr(byte) if byte in plain else f"\\{byte:03o}" for byte in text.encode()) + '"'


def _bound(bound: float | None, none: str) -> str:
    return none if bound is None else repr(float(bound))


def _listed(items: Iterable[str]) -> str:
    return ", ".join(items) or "0"
