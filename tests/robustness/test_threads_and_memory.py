"""Claims about one process that does much: threads give the bits of serial calls, memory does not grow.

Threads and long loops run in processes of their own: what breaks there may end them.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from profiles import LONG

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import ArtefactError, Model, load
from ballpass.runtime.native import ensemble_driver, stepper
from ballpass.runtime.native.compile import compile_sources, find_compiler
from ballpass.runtime.native.driver_library import DRIVER

pytestmark = pytest.mark.long

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Path:
    text = (SCENES / "punching_press.toml").read_text(encoding="utf-8")
    return generate(scene_from_text(text, "press"), tmp_path_factory.mktemp("threads") / "press")


def everything(model: Model, clearance: float) -> list[np.ndarray]:
    """What a caller may ask of a model: each of these once shared memory with every other call."""
    parameters = {"bearing.clearance": clearance}
    found = []
    for method in ("auto", "cvodes"):
        run = model.simulate(cycles=0.3, samples_per_cycle=400, parameters=parameters, method=method, rtol=1e-5)
        found += [run.x, *run.outputs.values()]
    reduced = model.reduce(cycles=1, transient=0, parameters=parameters)
    found += [np.array([reduced["inner.y"].maximum, reduced["ball.force"].maximum])]
    found += [model.jacobian("rhs", t=0.001, parameters=parameters)]
    found += [model.jacobian("rhs", wrt=["bearing.clearance"], t=0.001, parameters=parameters)]
    found += [np.asarray(value) for value in model.evaluate(0.002, parameters=parameters).values()]
    found += [np.array(list(model.constants(parameters).values()))]
    return [np.array(array) for array in found]


def assert_same_bits(one: list[np.ndarray], other: list[np.ndarray]) -> None:
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("own", [False, True], ids=["one model", "a model for each thread"])
def test_concurrent_calls_give_the_bits_of_serial_ones(press: Path, own: bool) -> None:
    sizes = [k * 1e-6 for k in range(1, 9 if not LONG else 100)]
    model = load(press)
    serial = [everything(model, size) for size in sizes]
    fresh = load(press)  # nothing is made yet: threads make it at once
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)  # threads take turns in the middle of everything
    try:
        with ThreadPoolExecutor(4) as pool:
            parallel = list(pool.map(lambda size: everything(load(press) if own else fresh, size), sizes))
    finally:
        sys.setswitchinterval(before)
    for one, other in zip(serial, parallel, strict=True):
        assert_same_bits(one, other)


MANY = """
    import sys
    import numpy as np
    from ballpass.runtime import load

    def resident():  # [bytes]
        with open("/proc/self/statm") as stream:
            return int(stream.read().split()[1]) * 4096

    model = load(sys.argv[1])
    def run(k):
        return model.simulate(
            cycles=0.05, samples_per_cycle=400, parameters={"bearing.clearance": (1 + k % 20) * 1e-6}, rtol=1e-4,
            method=("auto", "auto", "auto", "cvodes")[k % 4],
        )
    def others():
        model.reduce(cycles=0.05, transient=0)
        model.jacobian("rhs", t=1e-3)
    first = [run(k).x for k in range(20)]
    others()  # libraries and modules are loaded when they are first asked for
    for k in range(60):
        np.testing.assert_array_equal(run(k).x, first[k % 20])
    before, count = resident(), int(sys.argv[2])
    for k in range(count):
        last = run(k)
        if k % 50 == 0:
            others()
    for k in range(20):
        np.testing.assert_array_equal(run(k).x, first[k])
    print(resident() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="asks Linux for the memory of a process")
def test_memory_is_flat_over_many_simulations(press: Path) -> None:
    count = 10_000 if LONG else 400
    command = [sys.executable, "-W", "error", "-c", textwrap.dedent(MANY), str(press), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    # a kilobyte lost in each simulation would be 10 MB in ten thousand; 4 MB are the allocator's own moods
    assert int(done.stdout) < 4_000_000 + count * 200


def test_a_process_with_models_at_work_in_threads_ends_well(press: Path) -> None:
    """At the end of an interpreter nothing calls into code that is gone, whoever still holds what."""
    code = """
        import sys, threading
        from ballpass.runtime import load
        model = load(sys.argv[1])
        kept = [model.simulate(cycles=0.1), model.kernel("rhs"), model.function("outputs"), model.stepper]
        stop = threading.Event()
        def work():
            while not stop.is_set():
                model.simulate(cycles=0.05)
        threads = [threading.Thread(target=work, daemon=True) for _ in range(2)]
        for thread in threads:
            thread.start()
        cycle = []
        cycle.append((cycle, model, kept))
        del model, kept
        print("done")
    """
    for _ in range(20 if LONG else 3):
        command = [sys.executable, "-X", "faulthandler", "-c", textwrap.dedent(code), str(press)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stdout == "done\n"
        assert "Segmentation" not in done.stderr


LAYOUTS = {
    "ballpass_options": stepper._Options,
    "ballpass_result": stepper._Result,
    "ballpass_tangents": stepper._TangentRecord,
    "ballpass_ensemble_options": ensemble_driver._EnsembleOptions,
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_records_of_the_driver_have_the_layout_that_python_gives_them(name: str, tmp_path: Path) -> None:
    """A field that only one side knows lets C read or write beyond the record: chance numbers, or a crash at exit."""
    record = LAYOUTS[name]
    fields = [field[0] for field in record._fields_]
    entries = [f"sizeof({name})"]
    for field in fields:
        entries += [f"offsetof({name}, {field})", f"sizeof((({name} *)0)->{field})"]
    includes = "".join(f'#include "{header}"\n' for header in ("stepper.h", "ensemble.h"))
    source = tmp_path / "layout.c"
    numbers = ", ".join(f"(long){entry}" for entry in entries)
    source.write_text(f"#include <stddef.h>\n{includes}const long layout[] = {{{numbers}}};\n", encoding="utf-8")
    compiler = find_compiler()
    assert compiler is not None
    code = ctypes.CDLL(str(compile_sources((source,), compiler, headers=sorted(DRIVER.glob("*.h"))).path))
    found = list((ctypes.c_long * len(entries)).in_dll(code, "layout"))
    expected = [ctypes.sizeof(record)]
    for field in fields:
        place = getattr(record, field)
        expected += [place.offset, place.size]
    assert found == expected
    header = next(path for path in sorted(DRIVER.glob("*.h")) if f"}} {name};" in path.read_text(encoding="utf-8"))
    body = re.search(
        rf"typedef struct \{{([^}}]*)\}} {name};", re.sub(r"(?s)/\*.*?\*/", "", header.read_text(encoding="utf-8"))
    )
    assert body is not None
    declared = re.findall(r"(\w+)\s*[;,]", body.group(1))
    assert declared == fields


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_driver_of_other_records_is_refused_before_it_is_called(
    name: str, press: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A library of sources with one field more or less than the Python that calls it."""
    model = load(press)
    record = LAYOUTS[name]
    longer = type(record.__name__, (ctypes.Structure,), {"_fields_": (*record._fields_, ("later", ctypes.c_double))})
    driver, module = {
        "ballpass_ensemble_options": (model.ensemble_driver, ensemble_driver),
    }.get(name, (model.stepper, stepper))
    type(driver)(driver.library, model.manifest)
    monkeypatch.setattr(module, record.__name__, longer)
    with pytest.raises(
        ArtefactError, match=f"{ctypes.sizeof(record)}.* bytes there, and .*{ctypes.sizeof(longer)}.*again"
    ):
        type(driver)(driver.library, model.manifest)


def test_results_of_ensembles_have_the_layout_of_those_of_single_runs() -> None:
    assert ensemble_driver.RESULT.itemsize == ctypes.sizeof(stepper._Result)
    assert ensemble_driver.RESULT.names == tuple(field[0] for field in stepper._Result._fields_)
    for field in ensemble_driver.RESULT.names:
        assert ensemble_driver.RESULT.fields is not None
        assert ensemble_driver.RESULT.fields[field][1] == getattr(stepper._Result, field).offset
