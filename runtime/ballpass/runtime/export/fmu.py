"""From a generated folder to an FMU 3.0 or 2.0 for co-simulation, which runs without Python.

In: a generated folder, names of parameters that become inputs, other systems to compile for.  Out: a file ``.fmu``:
the libraries, their sources, ``modelDescription.xml`` (`ballpass.runtime.export.model_description`), a page and the
licences.

The FMU is the exported program (`ballpass.runtime.export.c_program`) as a library, with ``driver/fmi/fmi.c`` over its
interface ``ballpass.h``, and ``fmi2.c`` over that for FMI 2.0.
"""

from __future__ import annotations

import hashlib
import html
import platform
import re
import struct
import sys
import uuid
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import accumulate, chain
from pathlib import Path
from xml.etree import ElementTree as Xml

import casadi
import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folder import read_artefact
from ballpass.runtime.contract.folders import replaced
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.export.c_program import LIBRARY_FLAGS, PROGRAM_ONLY, program_texts, started
from ballpass.runtime.export.dependencies import dependencies, rates_and_outputs
from ballpass.runtime.export.fmi2_description import fmi2_description
from ballpass.runtime.export.model_description import SPEED, build_description, experiment, model_description
from ballpass.runtime.export.scene_numbers import MOMENT, behind, computed_outputs, filled, speed_table, varying
from ballpass.runtime.export.targets import TARGETS, compiled, cross_compiled, targets_of
from ballpass.runtime.native.compile import library_suffix
from ballpass.runtime.native.compilers import need_compiler
from ballpass.runtime.native.driver_library import DRIVER
from ballpass.runtime.native.functions import directional
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.magnitudes import model_scales
from ballpass.runtime.time.timeline import stretch

#: C of the interface, the standard's headers, and the licence of both.
FMI = DRIVER / "fmi"

#: Of the FMI.
VERSIONS = (2, 3)

#: Folders of binaries by the names of FMI 3.0, where FMI 2.0 has others; it has no name for Linux on arm64.
_FMI2_FOLDERS = {"x86_64-linux": "linux64", "x86_64-windows": "win64"}

#: Time stamp of the files in the archive, so that the same scene gives the same bytes.
_DATE = (1980, 1, 1, 0, 0, 0)


def export_fmu(
    folder: str | Path,
    out: str | Path,
    *,
    inputs: Sequence[str] = (),
    manifest: Manifest | None = None,
    version: int = 3,
    targets: Sequence[str] = (),
    progress: Callable[[str], object] = str,
) -> Path:
    """Write the FMU of a generated folder.

    Parameters
    ----------
    folder : what `ballpass derive` wrote
    out : file to write; replaced if it is there
    inputs : parameters that become inputs, or prefixes of their names: ``"mechanism.forces.punch"``
    manifest : of the folder, where it was read before: the numbers are its own then
    version : of the FMI, 3 or 2
    targets : systems to compile for besides this machine, as for `ballpass.runtime.export.targets.targets_of`
    progress : called with what is done next

    Returns
    -------
    The file written.

    Raises
    ------
    ArtefactError, RequestError
        As for `ballpass.runtime.export.c_program.export_c`; a version or target that is none; a name that cannot be an
        input; no compiler.
    CompileError
        The compiler failed.
    """
    place, target = Path(folder).absolute(), Path(out)
    manifest = read_artefact(place) if manifest is None else manifest
    if version not in VERSIONS:
        raise RequestError(f"FMI {version} was asked for. Allowed: {' or '.join(map(str, VERSIONS))}.")
    chosen = input_names(manifest, inputs)
    others = targets_of(targets)
    model = started(place, manifest)
    manifest = model.manifest
    sources = {name: text for name, text in program_texts(model).items() if name not in PROGRAM_ONLY}
    sources |= _interface(model, version)
    token = _token(manifest, chosen, sources)
    sources["fmu.h"] = _fmu_header(manifest, token, chosen, version)
    identifier = model_identifier(manifest)
    description = model_description(manifest, identifier, token, chosen, dependencies(model), _magnitudes(model))
    if version == 2:
        description = fmi2_description(description, _units_of(sources))
    files = {
        "modelDescription.xml": _xml(description),
        **{f"sources/{name}": text.encode() for name, text in sources.items()},
        "documentation/index.html": _page(manifest, chosen, version).encode(),
        "documentation/licenses/license.txt": (FMI / "license.txt").read_bytes(),
        **_binaries(sources, identifier, version, others, progress),
    }
    if version == 3:
        files["sources/buildDescription.xml"] = _xml(build_description(identifier, _units_of(sources)))
    target.parent.mkdir(parents=True, exist_ok=True)
    with replaced(target) as made, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(files):
            archive.writestr(zipfile.ZipInfo(path, _DATE), files[path], zipfile.ZIP_DEFLATED)
    return target


def input_names(manifest: Manifest, asked: Sequence[str]) -> tuple[str, ...]:
    """Parameters that become inputs, in the scene's order.

    Raises
    ------
    RequestError
        An unknown name, or that of a number that cannot change in a run.
    """
    able, chosen = (*varying(manifest), *([SPEED] if speed_table(manifest)[0] else ())), set[str]()
    for name in asked:
        found = [known for known in able if known == name or known.startswith(f"{name}.")]
        if found:
            chosen.update(found)
        elif any(info.name == name or info.name.startswith(f"{name}.") for info in manifest.parameters):
            why = "it does not change in a run; set it as a parameter before"
            if name in ("mechanism.driver", SPEED):
                why = (
                    "it is the speed at t = 0 alone; a torque drives"
                    if manifest.mechanism is not None and manifest.mechanism.angle
                    else "this folder was generated for a constant speed, and has no acceleration that a change of it "
                    "would need. Name the scene file instead: `ballpass export` derives it with a speed that changes"
                )
            allowed = f"Allowed: {', '.join(able)}." if able else "This scene has no number that can be an input."
            raise RequestError(f"input {name!r}: {why}. {allowed}")
        else:
            raise RequestError(unknown_name("input", name, able))
    return tuple(name for name in able if name in chosen)


def model_identifier(manifest: Manifest) -> str:
    """The scene's name as a C identifier."""
    name = re.sub(r"\W", "_", manifest.scene, flags=re.ASCII)
    return f"_{name}" if name[:1].isdigit() else name or "scene"


def platform_tuple() -> str:
    """Folder of the binaries for this machine, as the standard names it.

    Raises
    ------
    RequestError
        The standard has no name for it.
    """
    machine, system = platform.machine().lower(), platform.system().lower()
    if system not in ("linux", "darwin", "windows") or not machine:
        raise RequestError(
            f"export: an FMU for {platform.system() or 'an unknown system'} on {machine or 'an unknown processor'} was "
            "asked for. Allowed: Linux, Darwin (macOS) and Windows, the systems that FMI 3.0 has names for. Export it "
            "on one of these; `ballpass export SCENE --c` writes the same model as C sources for any."
        )
    return f"{ {'amd64': 'x86_64', 'arm64': 'aarch64', 'i386': 'x86', 'i686': 'x86'}.get(machine, machine) }-{system}"


def _interface(model: LoadedModel, version: int) -> dict[str, str]:
    """Sources of the interface: those that are the same for all scenes, and derivatives of this one."""
    paths = [path for path in sorted(FMI.glob("*.[ch]")) if version == 2 or path.stem != "fmi2"]
    texts = {path.name: path.read_text(encoding="utf-8") for path in paths}
    constants, moved = _tangents(model)
    along = tuple((f"const double *d{name}", f"d{name}") for name in "txupc")
    own = (("const double *p", "p"), ("const double *dp", "dp"))
    return texts | {
        "rates.c": behind("The states' derivatives", model.symbolic("rhs"), "scene_rates", MOMENT, "rates"),
        "constants_tangent.c": behind(
            "Derivatives of the derived constants", constants, "scene_constants_tangent", own, "dc"
        ),
        "tangent.c": behind("Derivatives of rates and outputs", moved, "scene_tangent", MOMENT + along, "moved"),
    }


def _magnitudes(model: LoadedModel) -> list[float]:
    """Of the states in the scene's run, which the error control is relative to."""
    numbers = model.numbers()
    initial = np.array([numbers.values[name] for name in model.manifest.initial])
    duration, _ = experiment(model.manifest)
    scales = model_scales(model, numbers, initial, duration, stretch(model.manifest, numbers.values))
    return [float(size) for size in scales.magnitude]


def _tangents(model: LoadedModel) -> tuple[casadi.Function, casadi.Function]:
    """Directional derivatives of the derived constants over p, and of rates and outputs over t, x, u, p, c."""
    moment, results = rates_and_outputs(model)
    constants = model.symbolic("constants")(moment["p"])
    return (
        directional("constants_tangent", {"p": moment["p"]}, constants, "moved"),
        directional("tangent", moment, results, "moved"),
    )


def _token(manifest: Manifest, inputs: Sequence[str], sources: Mapping[str, str]) -> str:
    digest = hashlib.sha256(repr((manifest.signature, inputs, sorted(sources.items()))).encode()).hexdigest()
    return f"{{{uuid.UUID(digest[:32])}}}"


def _units_of(sources: Iterable[str]) -> list[str]:
    """The C files to compile: fmi2.c includes fmi.c."""
    return [name for name in sorted(sources) if name.endswith(".c") and not (name == "fmi.c" and "fmi2.c" in sources)]


def _fmu_header(manifest: Manifest, token: str, inputs: Sequence[str], version: int) -> str:
    sizes = [info.size for info in computed_outputs(manifest)]
    # FMI 2.0 has no arrays: each number is a variable
    ends = [*accumulate(sizes)] if version == 3 else [*range(1, sum(sizes) + 1)]
    speeds, times = speed_table(manifest) if SPEED in inputs else ((), ())
    names = [info.name for info in manifest.parameters]
    table = ", ".join(str(names.index(name)) for name in (*speeds, *times)) or "0"
    return filled(
        FMI / "fmu.h.in",
        TOKEN=token,
        OUTPUTS=str(len(ends)),
        DRIVEN=str(int(SPEED in inputs)),
        SPEEDS=str(len(speeds)),
        TABLE=str(len(speeds) + len(times)),
        PLACES=table,
        ENDS=", ".join(map(str, (0, *ends))),
    )


def _binaries(
    sources: Mapping[str, str],
    identifier: str,
    version: int,
    targets: Sequence[str],
    progress: Callable[[str], object],
) -> dict[str, bytes]:
    """Shared libraries by their paths in the FMU: for any processor of this machine's kind, and for other kinds."""
    compiler = need_compiler("An FMU, which holds compiled code,")
    names, found, here = _units_of(sources), dict[str, bytes](), platform_tuple()
    made = f"{identifier}{library_suffix()}"
    own = ("-Wl,-Bsymbolic",) if sys.platform == "linux" else ()
    command = (*compiler.command, *LIBRARY_FLAGS, *names, *own, "-o", made, "-lm")
    found[f"{here}/{made}"] = compiled(command, " ".join(command), sources, made)
    for other in targets:
        target = TARGETS[other]
        if target.place == here:
            continue
        progress(f"compiling for {other}; the first time takes a minute or two, for zig's own libraries")
        made = f"{identifier}{target.library}"
        flags = [flag for flag in LIBRARY_FLAGS if flag != "-fPIC" or target.library != ".dll"]
        flags += ["-s"]  # without the paths of files here
        flags += ["-Wl,-Bsymbolic"] if target.library == ".so" else []
        found[f"{target.place}/{made}"] = cross_compiled(sources, other, flags, names, made)
    if version == 3:
        return {f"binaries/{path}": content for path, content in found.items()}
    macos = f"{identifier}.dylib"
    slices = {kind: found.pop(f"{kind}-darwin/{macos}", b"") for kind in ("x86_64", "aarch64")}
    if any(slices.values()):
        found[f"darwin64/{macos}"] = universal({kind: content for kind, content in slices.items() if content})
    parts = [(*path.split("/"), path) for path in found]
    return {f"binaries/{_FMI2_FOLDERS.get(place, place)}/{name}": found[path] for place, name, path in parts}


def universal(slices: Mapping[str, bytes]) -> bytes:
    """One library of macOS for several processors, as `lipo` makes them: FMI 2.0 has one folder for all.

    Parameters
    ----------
    slices : libraries by processor
    """
    kinds = {"x86_64": (0x01000007, 3), "aarch64": (0x0100000C, 0)}
    align = 14  # pages of 16 KiB
    head, body = struct.pack(">II", 0xCAFEBABE, len(slices)), b""
    for kind, content in slices.items():
        body += bytes(-len(body) % (1 << align))
        head += struct.pack(">IIIII", *kinds[kind], (1 << align) + len(body), len(content), align)
        body += content
    return head + bytes((1 << align) - len(head)) + body


def _xml(root: Xml.Element) -> bytes:
    Xml.indent(root)
    return bytes(Xml.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def _page(manifest: Manifest, inputs: Sequence[str], version: int) -> str:
    """The page that describes the FMU."""

    def rows(names: Sequence[tuple[str, str, str]]) -> str:
        cells = ("".join(f"<td>{html.escape(text)}</td>" for text in row) for row in names)
        return "<table>\n" + "".join(f"<tr>{row}</tr>\n" for row in cells) + "</table>"

    gone = {*chain(*speed_table(manifest))} if SPEED in inputs else set()
    parameters = [(info.name, info.unit, info.description) for info in manifest.parameters if info.name not in gone]
    parameters += [(SPEED, "rad/s", "Speed of the driver")] if SPEED in inputs else []
    outputs = [(info.name, info.unit, info.description) for info in manifest.outputs]
    return filled(
        FMI / "index.html.in",
        TITLE=html.escape(manifest.title),
        VERSION=f"{version}.0",
        INPUTS=rows([row for row in parameters if row[0] in inputs]),
        OUTPUTS=rows(outputs),
        PARAMETERS=rows([row for row in parameters if row[0] not in inputs]),
    )
