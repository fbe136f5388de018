"""From a generated folder to a folder of plain C that runs without Python.

In: a generated folder.  Out: the model's kernels, the driver with its methods, the scene's numbers, a main that prints
a CSV, a Makefile and a README.  `make` needs gcc, clang or another compiler of C99
that knows their vector types, and nothing else.

The program finds the segments of a run in C (``schedule.c``, as ensembles do), the magnitudes
that tolerances are relative to (``scales.h``, as the stepper does), and evaluates the derived constants there, so that
parameters can be changed on its command line and the numbers are those of the model in Python.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from ballpass.runtime.contract import Manifest, read_artefact
from ballpass.runtime.contract.errors import ArtefactError, RequestError
from ballpass.runtime.export.scene_numbers import (
    constants_source,
    margins_of,
    margins_source,
    scene_header,
    scene_source,
)
from ballpass.runtime.native.compilers import FLAGS as BASE_FLAGS
from ballpass.runtime.native.driver_library import DRIVER, FLAGS, SWITCHES
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run.locating import has_kinks

#: C sources that are the same for every scene, beside the driver.
STANDALONE = DRIVER / "standalone"

#: What of the compiler's flags makes a shared library, or is overruled.
_LIBRARY_ONLY = ("-O2", "-fPIC", "-shared")

_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)

#: Includes for what a program that only simulates does not do.
_LEFT_OUT = re.compile(r'^#ifdef BALLPASS_(?:SENSITIVITIES|REDUCTIONS)\n(?:#include "[^"]+"\n)+#endif\n', re.MULTILINE)


def export_c(folder: str | Path, out: str | Path) -> Path:
    """Write the stand-alone C program of a generated folder.

    Parameters
    ----------
    folder : what `ballpass derive` wrote
    out : folder to write; files of the same names are replaced, others stay

    Returns
    -------
    The folder written.

    Raises
    ------
    ArtefactError
        The generated folder is missing, edited or without kernels.
    RequestError
        The model has no states, so that there is nothing to integrate.
    """
    place, target = Path(folder).absolute(), Path(out)
    manifest = read_artefact(place)
    if not manifest.states:
        raise RequestError(
            f"{manifest.scene}: the model has no states, so there is nothing to integrate in C. Its functions are in "
            f"{place / 'model.c'}. A scene with a bearing can be exported."
        )
    # in CasADi's virtual machine: nothing has to be compiled to write C
    texts = _texts(LoadedModel(place, manifest, None), place)
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".writing-", dir=target) as name:
        made = Path(name)
        for file, text in texts.items():
            (made / file).write_text(text, encoding="utf-8", newline="\n")
        for file in texts:
            os.replace(made / file, target / file)
    return target


def _texts(model: LoadedModel, folder: Path) -> dict[str, str]:
    """Content of the exported files by name."""
    manifest = model.manifest
    texts = {
        "scene.h": scene_header(manifest),
        "scene.c": scene_source(manifest),
        "constants.c": constants_source(model),
    }
    if margins_of(manifest):
        texts["margins.c"] = margins_source(model)
    extra = [STANDALONE / "located.c"] if has_kinks(manifest) else []
    extra += [STANDALONE / "assembly.c"] if margins_of(manifest) else []
    for source in (STANDALONE / "main.c", DRIVER / "schedule.c", DRIVER / "stepper.c", *extra):
        texts.update(_with_includes(source, (STANDALONE, DRIVER, folder), texts))
    objects = sorted(name for name in texts if name.endswith(".c"))
    headers = sorted(name for name in texts if name.endswith(".h"))
    texts["Makefile"] = _makefile(manifest, objects, headers)
    texts["README.md"] = _readme(manifest)
    return texts


def _with_includes(source: Path, places: Sequence[Path], known: Iterable[str]) -> dict[str, str]:
    """Text of a source and of all that it includes from `places`; what is in `known` is there already."""
    texts = {source.name: source.read_text(encoding="utf-8")}
    for name in _INCLUDE.findall(_LEFT_OUT.sub("", texts[source.name])):
        if name in known or name in texts or (name == SWITCHES and not (places[-1] / SWITCHES).is_file()):
            continue  # a scene without kinks has no file of them, and compiles nothing that includes it
        found = next((place / name for place in places if (place / name).is_file()), None)
        if found is None:
            raise ArtefactError(
                f"{source.name} includes {name}, which is neither in the driver nor in {places[-1]}. Write the folder "
                "again with this version's `ballpass derive`."
            )
        texts.update(_with_includes(found, places, {*known, *texts}))
    return texts


def _makefile(manifest: Manifest, sources: Sequence[str], headers: Sequence[str]) -> str:
    flags = (*FLAGS[:1], *(flag for flag in BASE_FLAGS if flag not in _LIBRARY_ONLY), *FLAGS[1:])
    objects = " ".join(source.removesuffix(".c") + ".o" for source in sources)
    program = _program(manifest)
    return f"""# Written by ballpass export.  make builds {program}; make run writes out.csv

CC ?= cc
# code for the processor at hand, where the compiler knows how
NATIVE := $(shell $(CC) -march=native -x c -E /dev/null > /dev/null 2>&1 && echo -march=native)
CFLAGS ?= {" ".join(flags)} $(NATIVE)

{program}: {objects}
	$(CC) $(CFLAGS) $(LDFLAGS) -o $@ $^ -lm

%.o: %.c {" ".join(headers)}
	$(CC) $(CFLAGS) -c -o $@ $<

run: {program}
	./{program} > out.csv

clean:
	rm -f *.o {program} out.csv

.PHONY: run clean
"""


def _program(manifest: Manifest) -> str:
    """Name of the program: the scene's, unless that is a file or a target of the Makefile."""
    taken = ("all", "clean", "makefile", "run")
    return f"{manifest.scene}_program" if manifest.scene.lower() in taken else manifest.scene


def _readme(manifest: Manifest) -> str:
    example, program = manifest.parameters[0], _program(manifest)
    return f"""# {manifest.title}

A simulation in C99 with the vector types of GCC and Clang, written by `ballpass export`. It needs one of these
compilers (or another that knows their `vector_size`) and nothing else.

```console
$ make
$ ./{program} > out.csv
$ ./{program} --cycles 2 --rtol 1e-8 --samples 500 {example.name}={example.default!r} > out.csv
$ ./{program} --list
```

The columns of the CSV are the time [s] and the states in SI units: {", ".join(s.name for s in manifest.states)}.
Parameters are given in SI units; `--list` prints them with units and meaning, `--help` the options. A value that the
scene file could not have, as a mass of zero or lengths with which a linkage locks, is refused, with what is allowed.
Exit codes: 0 done, 1 the computation failed (the rows so far are printed), 2 the request was wrong.

| file | what it holds |
| --- | --- |
| `scene.c`, `scene.h` | parameters with their defaults, states, loads, run settings |
| `constants.c` | derived constants (stiffness, cage ratio, ...) of the parameters |
| `assembly.h`, and `assembly.c`, `margins.c` where there is a linkage | whether it can be assembled all around |
| `kernels.h` | the model, generated from its equations |
| `methods.h` | coefficients of the integration methods |
| `stepper.c`, `stepper.h` and what they include | the integrator; `stepper.h` documents its one call, `ballpass_run` |
| `located.h`, and `located.c` where the laws have kinks | the same integrator, compiled so that steps end on kinks |
| `schedule.c`, `schedule.h` | times at which loads switch, inputs in between, moments to look at for magnitudes |
| `main.c` | command line and CSV |

Tolerances are relative to magnitudes: the sizes that positions and velocities get in the run that is asked for. The
program finds them anew for every run, from its parameters, its length and its most loaded moments (`scales.h`).
"""
