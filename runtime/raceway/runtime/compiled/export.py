"""From a generated folder to a folder of plain C that runs without Python.

In: a generated folder.  Out: the model's kernels, the driver with its methods, the scene's numbers, a main that prints
a CSV, a Makefile and a README.  `make` needs a C99 compiler and nothing else.

The program finds the segments of a run in C (``schedule.c``, the counterpart of `integrate/clock.py`) and evaluates
the derived constants there, so that parameters can be changed on its command line.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import casadi
import numpy as np

from raceway.runtime.compiled.compile import FLAGS as BASE_FLAGS
from raceway.runtime.compiled.driver_library import DRIVER, FLAGS, SWITCHES
from raceway.runtime.errors import ArtefactError, RequestError
from raceway.runtime.integrate import clock
from raceway.runtime.integrate.locating import has_kinks, tight_below
from raceway.runtime.integrate.magnitudes import default_magnitudes as run_magnitudes
from raceway.runtime.integrate.stepper import METHODS as STEPPERS
from raceway.runtime.manifest import InputInfo, Manifest, read_artefact
from raceway.runtime.model import Model

#: C sources that are the same for every scene, beside the driver.
STANDALONE = DRIVER / "standalone"

#: What of the compiler's flags makes a shared library, or is overruled.
_LIBRARY_ONLY = ("-O2", "-fPIC", "-shared")

_NOTE = "/* Written by raceway export. */"
_KINDS = {
    "phase": "SCHEDULE_PHASE",
    "gate": "SCHEDULE_GATE",
    "table": "SCHEDULE_TABLE",
    "table_rate": "SCHEDULE_TABLE_RATE",
}
_INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


def export_c(folder: str | Path, out: str | Path) -> Path:
    """Write the stand-alone C program of a generated folder.

    Parameters
    ----------
    folder : what `raceway derive` wrote
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
    texts = _texts(Model(place, manifest, None), place)
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".writing-", dir=target) as name:
        made = Path(name)
        for file, text in texts.items():
            (made / file).write_text(text, encoding="utf-8", newline="\n")
        for file in texts:
            os.replace(made / file, target / file)
    return target


def _texts(model: Model, folder: Path) -> dict[str, str]:
    """Content of the exported files by name."""
    manifest = model.manifest
    texts = {
        "scene.h": _scene_header(manifest),
        "scene.c": _scene_source(manifest, default_magnitudes(model)),
        "constants.c": _constants(model),
    }
    located = (STANDALONE / "located.c",) if has_kinks(manifest) else ()
    for source in (STANDALONE / "main.c", STANDALONE / "schedule.c", DRIVER / "stepper.c", *located):
        texts.update(_with_includes(source, (STANDALONE, DRIVER, folder), texts))
    objects = sorted(name for name in texts if name.endswith(".c"))
    headers = sorted(name for name in texts if name.endswith(".h"))
    texts["Makefile"] = _makefile(manifest, objects, headers)
    texts["README.md"] = _readme(manifest)
    return texts


def default_magnitudes(model: Model) -> np.ndarray:
    """Magnitudes of the states that a run with the scene's own settings has, shape (states,)."""
    numbers = model.numbers()
    run = model.manifest.run
    turn = clock.period(model.manifest, numbers.values)
    duration = run.duration if run.duration is not None else (run.cycles or 1.0) * turn
    if not np.isfinite(duration):
        raise RequestError(
            "The scene's run is given in cycles, but nothing turns in it (its speed is zero). Give its [run] a "
            "duration."
        )
    return run_magnitudes(model, numbers, model.initial(), duration, turn)


def _with_includes(source: Path, places: Sequence[Path], known: Iterable[str]) -> dict[str, str]:
    """Text of a source and of all that it includes from `places`; what is in `known` is there already."""
    texts = {source.name: source.read_text(encoding="utf-8")}
    for name in _INCLUDE.findall(texts[source.name]):
        if name in known or name in texts or (name == SWITCHES and not (places[-1] / SWITCHES).is_file()):
            continue  # a scene without kinks has no file of them, and compiles nothing that includes it
        found = next((place / name for place in places if (place / name).is_file()), None)
        if found is None:
            raise ArtefactError(
                f"{source.name} includes {name}, which is neither in the driver nor in {places[-1]}. Write the folder "
                "again with this version's `raceway derive`."
            )
        texts.update(_with_includes(found, places, {*known, *texts}))
    return texts


def _scene_header(manifest: Manifest) -> str:
    sizes = {
        "SCENE_STATES": len(manifest.states),
        "SCENE_INPUTS": len(manifest.inputs),
        "SCENE_PARAMETERS": len(manifest.parameters),
        "SCENE_CONSTANTS": len(manifest.constants),
        "SCENE_RELATIONS": len(manifest.relations),
    }
    listed = ", ".join(f"{name} = {value}" for name, value in sizes.items())
    kinks = (
        "\n/* The laws have kinks, which located.c ends steps on. */\n#define SCENE_KINKS\n"
        if has_kinks(manifest)
        else ""
    )
    return f"""{_NOTE}
#ifndef SCENE_H
#define SCENE_H

#include "schedule.h"

enum {{ {listed} }};
{kinks}
/* Tolerance at which kinks are located unless something else is asked for. */
#define SCENE_TIGHT {tight_below(manifest)!r}

/* A parameter in SI; a value must be above `above`, at least `least`, at most `most` and below `below`. */
typedef struct {{
    const char *name, *unit, *description;
    double value, above, least, most, below;
}} scene_parameter;

/* A parameter that must be above `factor` times another one; places among the parameters. */
typedef struct {{
    int parameter, other;
    double factor;
}} scene_relation;

extern const char *const scene_title;
extern const scene_parameter scene_parameters[];
extern const scene_relation scene_relations[];
extern const char *const scene_constant_names[];
extern const char *const scene_states[];
extern const double scene_magnitudes[]; /* tolerances are relative to these */

/* Places among parameters and, behind these, derived constants. */
extern const int scene_initial[];
extern const int scene_speed; /* of driver or shaft [rad/s]; -1 where there is none */
extern const schedule_input scene_inputs[];

/* Run settings: of cycles and duration [s] one is above zero. */
extern const double scene_cycles, scene_duration, scene_rtol;
extern const long scene_samples;
extern const char *const scene_method;

/* Derived constants of the parameters. */
void scene_constants(const double *p, double *c);

#endif
"""


def _scene_source(manifest: Manifest, magnitudes: np.ndarray) -> str:
    names = [*(info.name for info in manifest.parameters), *(info.name for info in manifest.constants)]
    place = {name: k for k, name in enumerate(names)}
    speed = -1
    if manifest.mechanism is not None:
        speed = place[manifest.mechanism.speed]
    elif manifest.bearing is not None:
        speed = place[manifest.bearing.shaft_speed]
    run = manifest.run
    method = run.method.removeprefix("stepper-") if run.method in STEPPERS and run.method != "stepper" else "auto"
    parameters = [
        f"    {{{_string(p.name)}, {_string(p.unit)}, {_string(p.description)}, {p.default!r}, "
        f"{_bound(p.above, '-INFINITY')}, {_bound(p.least, '-INFINITY')}, {_bound(p.most, 'INFINITY')}, "
        f"{_bound(p.below, 'INFINITY')}}},"
        for p in manifest.parameters
    ]
    relations = [f"    {{{place[name]}, {place[other]}, {factor!r}}}," for name, factor, other in manifest.relations]
    indices, inputs = _inputs(manifest.inputs, place)
    return "\n".join(
        [
            _NOTE,
            "/* The scene's numbers. */",
            '#include "scene.h"',
            "",
            "#include <math.h>",
            "#include <stddef.h>",
            "",
            f"const char *const scene_title = {_string(manifest.title)};",
            "",
            "const scene_parameter scene_parameters[] = {",
            *parameters,
            "};",
            "",
            "const scene_relation scene_relations[] = {",
            *(relations or ["    {0, 0, 0.0}, /* none */"]),  # C has no arrays of length zero
            "};",
            "",
            f"const char *const scene_constant_names[] = {{{_listed(_string(c.name) for c in manifest.constants)}}};",
            "",
            f"const char *const scene_states[] = {{{_listed(_string(s.name) for s in manifest.states)}}};",
            f"const double scene_magnitudes[] = {{{_listed(repr(float(m)) for m in magnitudes)}}};",
            f"const int scene_initial[] = {{{_listed(str(place[name]) for name in manifest.initial)}}};",
            f"const int scene_speed = {speed};",
            "",
            *indices,
            f"const schedule_input scene_inputs[] = {{\n{inputs}\n}};",
            "",
            f"const double scene_cycles = {float(run.cycles or 0.0)!r};",
            f"const double scene_duration = {float(run.duration or 0.0)!r};",
            f"const double scene_rtol = {run.rtol!r};",
            f"const long scene_samples = {run.samples_per_cycle};",
            f"const char *const scene_method = {_string(method)};",
            "",
        ]
    )


def _inputs(inputs: Sequence[InputInfo], place: dict[str, int]) -> tuple[list[str], str]:
    """Arrays of places, and the entries of the table of inputs that name them."""
    arrays: list[str] = []

    def array(name: str, names: Sequence[str]) -> str:
        if not names:
            return "NULL"
        arrays.append(f"static const int {name}[] = {{{_listed(str(place[n]) for n in names)}}};")
        return name

    entries = []
    for k, item in enumerate(inputs):
        edges = array(f"edges_{k}", [edge for window in item.windows for edge in window])
        times = array(f"times_{k}", item.times)
        heights = array(f"heights_{k}", item.values)
        offset = place[item.offset] if item.offset else -1
        rate = place[item.rate] if item.rate else -1
        entries.append(
            f"    {{{_KINDS[item.kind]}, {offset}, {rate}, {len(item.windows)}, {edges}, {len(item.times)}, {times}, "
            f"{heights}}}, /* {item.name} */"
        )
    # C has no arrays of length zero
    return arrays, "\n".join(entries) or "    {SCHEDULE_PHASE, -1, -1, 0, NULL, 0, NULL, NULL}, /* none */"


def _constants(model: Model) -> str:
    """C of ``constants`` as CasADi writes it, behind one function with the project's signature."""
    if not model.manifest.constants:
        body = "{\n    (void)p;\n    (void)c;\n}"
        return f'{_NOTE}\n#include "scene.h"\n\nvoid scene_constants(const double *p, double *c)\n{body}\n'
    function = model.symbolic("constants")
    generator = casadi.CodeGenerator("constants.c", {"with_header": False, "with_export": False})
    generator.add(function)
    # C has no arrays of length zero
    sizes = [max(size, 1) for size in (function.sz_arg(), function.sz_res(), function.sz_iw(), function.sz_w())]
    return f"""{_NOTE}
/* The derived constants, as CasADi writes them, and scene_constants at the end, which calls them. */
#include "scene.h"

#if defined(__GNUC__)
/* CasADi's calling convention has arguments that this function does not need */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

{generator.dump().strip()}

void scene_constants(const double *p, double *c)
{{
    const casadi_real *arguments[{sizes[0]}];
    casadi_real *results[{sizes[1]}];
    casadi_int iw[{sizes[2]}];
    casadi_real w[{sizes[3]}];
    arguments[0] = p;
    results[0] = c;
    constants(arguments, results, iw, w, 0);
}}
"""


def _makefile(manifest: Manifest, sources: Sequence[str], headers: Sequence[str]) -> str:
    flags = (*FLAGS[:1], *(flag for flag in BASE_FLAGS if flag not in _LIBRARY_ONLY), *FLAGS[1:])
    objects = " ".join(source.removesuffix(".c") + ".o" for source in sources)
    program = _program(manifest)
    return f"""# Written by raceway export.  make builds {program}; make run writes out.csv

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

A simulation in C99, written by `raceway export`. It needs a C compiler and nothing else.

```console
$ make
$ ./{program} > out.csv
$ ./{program} --cycles 2 --rtol 1e-8 --samples 500 {example.name}={example.default!r} > out.csv
$ ./{program} --list
```

The columns of the CSV are the time [s] and the states in SI units: {", ".join(s.name for s in manifest.states)}.
Parameters are given in SI units; `--list` prints them with units and meaning, `--help` the options. A value that the
scene file could not have, as a mass of zero, is refused, with what is allowed.
Exit codes: 0 done, 1 the computation failed (the rows so far are printed), 2 the request was wrong.

| file | what it holds |
| --- | --- |
| `scene.c`, `scene.h` | parameters with their defaults, states, loads, run settings |
| `constants.c` | derived constants (stiffness, cage ratio, ...) of the parameters |
| `kernels.h` | the model, generated from its equations |
| `methods.h` | coefficients of the integration methods |
| `stepper.c`, `stepper.h` and what they include | the integrator; `stepper.h` documents its one call, `raceway_run` |
| `located.h`, and `located.c` where the laws have kinks | the same integrator, compiled so that steps end on kinks |
| `schedule.c`, `schedule.h` | times at which loads switch, inputs in between |
| `main.c` | command line and CSV |

Tolerances are relative to `scene_magnitudes` in `scene.c`: the sizes that positions and velocities have in a run with
the scene's own numbers. Parameters that move the parts much further, or much less far, want other magnitudes there.
"""


def _string(text: str) -> str:
    """C string literal; all but plain ASCII as octal escapes."""
    out = []
    for byte in text.encode():
        character = chr(byte)
        plain = 32 <= byte < 127 and character not in '"\\?'
        out.append(character if plain else f"\\{byte:03o}")
    return '"' + "".join(out) + '"'


def _bound(bound: float | None, none: str) -> str:
    return none if bound is None else repr(float(bound))


def _listed(items: Iterable[str]) -> str:
    return ", ".join(items) or "0"
