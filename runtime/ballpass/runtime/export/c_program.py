"""From a generated folder to a folder of plain C that runs without Python.

In: a generated folder.  Out: the model's kernels, the driver with its methods, the scene's numbers, an interface for
other programs, a main that prints a CSV, a Makefile and a README.  `make` needs gcc, clang or another compiler of C99
that supports their vector types, and nothing else.

The program finds the segments of a run in C (``schedule.c``, as ensembles do), the magnitudes
that tolerances are relative to (``scales.h``, as the stepper does), and evaluates the derived constants there, so that
parameters can be changed on its command line and the numbers are those of the model in Python.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from ballpass.runtime.contract.errors import ArtefactError, RequestError
from ballpass.runtime.contract.folder import read_artefact, read_unchanged
from ballpass.runtime.contract.folders import read_file, replace_file
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.export.scene_numbers import STANDALONE, columns_of, filled, margins_of, scene_texts
from ballpass.runtime.export.targets import TARGETS, cross_compiled, targets_of
from ballpass.runtime.native.compile import digests_of
from ballpass.runtime.native.compilers import FLAGS as BASE_FLAGS
from ballpass.runtime.native.driver_library import DRIVER, FLAGS, SWITCHES
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.method_tables import METHOD_TABLES, method_tables
from ballpass.runtime.request.assembly import may_lock
from ballpass.runtime.request.locating import has_kinks

#: Flags of the compiler for a shared library, or replaced here.
_LIBRARY_ONLY = ("-O1", "-fPIC", "-shared")

#: Flags of the program, for any processor of a kind.
PROGRAM_FLAGS = (*FLAGS[:1], *(flag for flag in BASE_FLAGS if flag not in _LIBRARY_ONLY), *FLAGS[1:])

#: Flags of a library for any processor of a kind.
LIBRARY_FLAGS = (*FLAGS[:1], *(flag for flag in BASE_FLAGS if flag != "-O1"), *FLAGS[1:], "-fvisibility=hidden")

#: Files of the program that an FMU and a page do not need.
PROGRAM_ONLY = ("main.c", "example.c", "Makefile", "README.md")

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)

#: Includes that a program that only simulates does not need.
_LEFT_OUT = re.compile(r'^#ifdef BALLPASS_(?:SENSITIVITIES|REDUCTIONS)\n(?:#include "[^"]+"\n)+#endif\n', re.MULTILINE)


def export_c(
    folder: str | Path,
    out: str | Path,
    *,
    manifest: Manifest | None = None,
    targets: Sequence[str] = (),
    progress: Callable[[str], object] = str,
) -> Path:
    """Write the stand-alone C program of a generated folder.

    Parameters
    ----------
    folder : what `ballpass derive` wrote
    out : folder to write; files of an earlier export are replaced, others stay
    manifest : of the folder, where it was read before: the numbers are its own then
    targets : systems that the program is compiled for, as for `ballpass.runtime.export.targets.targets_of`
    progress : called with what is done next

    Returns
    -------
    The folder written.

    Raises
    ------
    ArtefactError
        The generated folder is missing, edited or without kernels.
    RequestError
        The model has no states, so that there is nothing to integrate, or the stepper does not take it; or the folder
        holds files of these names that are no earlier export; an unknown target, or no compiler for it.
    CompileError
        The compiler failed.
    """
    place, target, others = Path(folder).absolute(), Path(out), targets_of(targets)
    manifest = read_artefact(place) if manifest is None else manifest
    texts = program_texts(started(place, manifest))
    target.mkdir(parents=True, exist_ok=True)
    earlier = (target / "ballpass.h").is_file()
    taken = [name for name in texts if (target / name).exists() and not (earlier and (target / name).is_file())]
    if taken:
        raise RequestError(
            f"{target}: {', '.join(taken[:5])} would be replaced, and no exported program is there. Allowed: a folder "
            "that is new, without files of these names, or of an earlier export. Nothing was changed. Give another one."
        )
    for name, text in texts.items():
        replace_file(target / name, text.encode())
    sources = [name for name in sorted(texts) if name.endswith(".c") and name != "example.c"]
    for other in others:
        progress(f"compiling for {other}; the first time takes a minute or two, for zig's own libraries")
        program = f"{_program(manifest)}-{other}{TARGETS[other].program}"
        replace_file(target / program, cross_compiled(texts, other, PROGRAM_FLAGS, sources, program))
        (target / program).chmod(0o755)
    return target


def started(folder: Path, manifest: Manifest) -> LoadedModel:
    """The model to export, whose rings start where those of `ballpass.runtime.load` do.

    In CasADi's virtual machine: writing C needs no compiler.
    """
    model = LoadedModel(folder, manifest, None)
    if manifest.run.at_rest:
        from ballpass.runtime.point.equilibrium import seated  # with SciPy

        model.manifest = seated(model)
    return model


def program_texts(model: LoadedModel) -> dict[str, str]:
    """Content of the exported files by name; errors as for `export_c`."""
    manifest, folder = model.manifest, model.folder
    if not manifest.states:
        raise RequestError(
            f"{manifest.scene}: the model has no states, because all follows from the driver's angle, so that there is "
            "nothing to integrate. Name the scene file instead: `ballpass export` and `ballpass explore` derive it "
            f"with the driver's speed as a table over time. The functions of this model are in {folder / 'model.c'}."
        )
    if may_lock(model, model.numbers(None)):
        raise RequestError(
            f"{manifest.scene}: a torque may turn the driver to the end of its range, or to where the linkage locks, "
            "and what is exported does not find when. Allowed: a linkage that turns round, without a driver.range."
        )
    texts = {**scene_texts(model), METHOD_TABLES: method_tables()}
    extra = [STANDALONE / "located.c"] if has_kinks(manifest) else []
    extra += [STANDALONE / "assembly.c"] if margins_of(manifest) else []
    sources = (STANDALONE / "main.c", STANDALONE / "ballpass.c", DRIVER / "schedule.c", DRIVER / "stepper.c", *extra)
    for source in sources:
        texts.update(_with_includes(source, digests_of(folder, manifest), texts))
    objects = sorted(name for name in texts if name.endswith(".c"))
    texts["example.c"] = (STANDALONE / "example.c").read_text(encoding="utf-8")
    headers = sorted(name for name in texts if name.endswith(".h"))
    texts["Makefile"] = _makefile(manifest, objects, headers)
    texts["README.md"] = _readme(manifest)
    return texts


def _with_includes(source: Path, generated: Mapping[Path, str], known: Iterable[str]) -> dict[str, str]:
    """Texts of a source and of its includes; those in `known` are left out.

    Parameters
    ----------
    generated : files of the generated folder and their sha256
    """
    content = read_unchanged(source, generated[source]) if source in generated else read_file(source)
    texts = {source.name: content.decode()}
    places = {path.name: path for path in generated}
    for name in _INCLUDE.findall(_LEFT_OUT.sub("", texts[source.name])):
        if name in known or name in texts or (name == SWITCHES and name not in places):
            continue  # a scene without kinks has no file of them, and compiles nothing that includes it
        own = next((place / name for place in (STANDALONE, DRIVER) if (place / name).is_file()), None)
        found = own or places.get(name)
        if found is None:
            raise ArtefactError(
                f"{source.name} includes {name}, which is neither in the driver nor in the generated folder. Write it "
                "again with this version's `ballpass derive`."
            )
        texts.update(_with_includes(found, generated, {*known, *texts}))
    return texts


def _makefile(manifest: Manifest, sources: Sequence[str], headers: Sequence[str]) -> str:
    return filled(
        STANDALONE / "Makefile.in",
        PROGRAM=_program(manifest),
        FLAGS=" ".join(PROGRAM_FLAGS),
        OBJECTS=" ".join(source.removesuffix(".c") + ".o" for source in sources),
        HEADERS=" ".join(headers),
    )


def _program(manifest: Manifest) -> str:
    """Name of the program: the scene's, unless that is a file or a target of the Makefile."""
    taken = ("all", "clean", "example", "makefile", "run")
    return f"{manifest.scene}_program" if manifest.scene.lower() in taken else manifest.scene


def _readme(manifest: Manifest) -> str:
    example = manifest.parameters[0]
    return filled(
        STANDALONE / "README.md.in",
        TITLE=manifest.title,
        PROGRAM=_program(manifest),
        EXAMPLE=f"{example.name}={example.default!r}",
        COLUMNS=", ".join(f"`{name}`" for name, _ in columns_of(manifest)),
    )
