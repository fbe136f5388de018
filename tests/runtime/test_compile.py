"""Promises of the cache: compile once, recompile when it must, never half, never silently."""

from __future__ import annotations

import importlib.util
import shutil
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from artefact import write_folder

from ballpass.runtime import CacheWarning, CompileError, Model, NoCompilerWarning, RequestError, load
from ballpass.runtime.native import compile, functions

# models made by hand here have no kernels
pytestmark = pytest.mark.filterwarnings("ignore::ballpass.runtime.NoKernelsWarning")

SOURCE = "double twice(double x) { return 2.0 * x; }\n"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv(compile.CACHE_VARIABLE, str(folder))
    return folder


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "source.c"
    path.write_text(SOURCE)
    return path


@pytest.fixture
def counting(tmp_path: Path) -> tuple[compile.Compiler, Path]:
    """A compiler that writes a line each time it compiles."""
    script, log = tmp_path / "counting-cc", tmp_path / "log"
    real = shutil.which("cc") or shutil.which("gcc")
    assert real is not None, "these tests need a C compiler"
    script.write_text(f'#!/bin/sh\ncase "$*" in *.c*) echo compiled >> {log};; esac\nexec {real} "$@"\n')
    script.chmod(0o755)
    found = compile.find_compiler(str(script))
    assert found is not None
    log.write_text("")
    return found, log


def test_second_call_compiles_nothing(cache: Path, source: Path, counting: tuple[compile.Compiler, Path]) -> None:
    compiler, log = counting
    first = compile.compile_sources((source,), compiler)
    second = compile.compile_sources((source,), compiler)
    assert (first.cached, second.cached) == (False, True)
    assert first.path == second.path
    assert log.read_text().count("compiled") == 1
    assert [path.name for path in cache.iterdir()] == [first.path.name]
    assert compile.library_key([source.read_bytes()], compiler)[:32] in first.path.name


def test_same_content_at_another_place_is_the_same_library(
    cache: Path, source: Path, tmp_path: Path, counting: tuple[compile.Compiler, Path]
) -> None:
    other = tmp_path / "other.c"
    other.write_text(SOURCE)
    assert compile.library_key([each.read_bytes() for each in (source,)], counting[0]) == compile.library_key(
        [each.read_bytes() for each in (other,)], counting[0]
    )


def test_content_flags_compiler_versions_and_processor_all_enter_the_key(
    cache: Path, source: Path, counting: tuple[compile.Compiler, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler, _ = counting
    keys = [compile.library_key([each.read_bytes() for each in (source,)], compiler)]
    keys.append(
        compile.library_key(
            [each.read_bytes() for each in (source,)], replace(compiler, flags=(*compiler.flags, "-O3"))
        )
    )
    keys.append(compile.library_key([each.read_bytes() for each in (source,)], replace(compiler, identity="cc 99")))
    keys.append(
        compile.library_key(
            [
                each.read_bytes()
                for each in (
                    source,
                    source,
                )
            ],
            compiler,
        )
    )
    with monkeypatch.context() as patch:
        patch.setattr(compile, "_processor", lambda: "another")
        keys.append(compile.library_key([each.read_bytes() for each in (source,)], compiler))
    with monkeypatch.context() as patch:
        patch.setattr(compile.importlib.metadata, "version", lambda name: "0")
        keys.append(compile.library_key([each.read_bytes() for each in (source,)], compiler))
    with monkeypatch.context() as patch:
        patch.setattr(compile, "__version__", "0")
        keys.append(compile.library_key([each.read_bytes() for each in (source,)], compiler))
    source.write_text(SOURCE.replace("2.0", "3.0"))
    keys.append(compile.library_key([each.read_bytes() for each in (source,)], compiler))
    assert len(set(keys)) == len(keys) == 8


def test_several_sources_become_one_library(cache: Path, tmp_path: Path, source: Path) -> None:
    second = tmp_path / "second.c"
    second.write_text("double twice(double); double four_times(double x) { return twice(twice(x)); }\n")
    compiler = compile.find_compiler()
    assert compiler is not None
    library = compile.compile_sources((source, second), compiler)
    import ctypes

    handle = ctypes.CDLL(str(library.path))
    handle.four_times.restype, handle.four_times.argtypes = ctypes.c_double, [ctypes.c_double]
    assert handle.four_times(3.0) == 12.0


def test_failing_compiler_is_loud_and_leaves_nothing(cache: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.c"
    broken.write_text("this is not C\n")
    compiler = compile.find_compiler()
    assert compiler is not None
    with pytest.raises(CompileError) as caught:
        compile.compile_sources((broken,), compiler)
    assert "broken.c" in str(caught.value)
    assert "error" in str(caught.value)
    assert "-ffp-contract=off" in str(caught.value)
    assert list(cache.iterdir()) == []


def test_interrupted_compile_leaves_nothing(
    cache: Path, source: Path, counting: tuple[compile.Compiler, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(compile.os, "replace", interrupted)
        with pytest.raises(KeyboardInterrupt):
            compile.compile_sources((source,), counting[0])
    assert list(cache.iterdir()) == []


def test_unknown_compiler_is_a_wrong_request(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RequestError, match="no program 'nocc'"):
        compile.find_compiler("nocc -O3")
    monkeypatch.setenv("CC", "nocc")
    with pytest.raises(RequestError, match="environment variable CC"):
        compile.find_compiler()


def test_cc_variable_with_arguments_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "cc -DX=1")
    found = compile.find_compiler()
    assert found is not None
    assert found.command[1:] == ("-DX=1",)


def test_cache_that_is_no_folder_warns_and_compiles_elsewhere(cache: Path, source: Path) -> None:
    cache.write_text("a file where the folder should be")
    compiler = compile.find_compiler()
    assert compiler is not None
    with pytest.warns(CacheWarning, match=compile.CACHE_VARIABLE):
        library = compile.compile_sources((source,), compiler)
    assert library.path.exists()
    assert cache.read_text() == "a file where the folder should be"


def test_changed_number_recompiles_nothing_and_changed_structure_does(
    cache: Path, tmp_path: Path, counting: tuple[compile.Compiler, Path]
) -> None:
    compiler, log = counting
    command = compiler.command[0]
    first = load(write_folder(tmp_path / "a"), compiler=command)
    first.simulate(cycles=0.1, rtol=1e-6)
    first.simulate(cycles=0.1, rtol=1e-9, parameters={"spring.stiffness": 77.0}, samples_per_cycle=50)
    so_far = log.read_text().count("compiled")  # the model, and the loop that is the same for all models
    numbers = load(write_folder(tmp_path / "a", defaults={"spring.stiffness": 500.0}), compiler=command)
    assert numbers.library is not None
    assert numbers.library.cached
    assert log.read_text().count("compiled") == so_far
    changed = load(write_folder(tmp_path / "a", extra_term=1.0), compiler=command)
    assert log.read_text().count("compiled") == so_far + 1
    point = {"t": 0.0, "x": [0.1, 0.2], "u": [0.0] * 4, "p": list(first.parameters.values()), "c": [2.0]}
    # the changed file is used although the first library is still open in this process
    np.testing.assert_allclose(changed.kernel("rhs")(point) - first.kernel("rhs")(point), [0.0, 0.5], rtol=1e-12)


def test_without_compiler_the_virtual_machine_gives_the_same_results_and_a_warning_names_the_cost(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_folder(tmp_path / "model")
    compiled = load(folder)
    solutions = {method: compiled.simulate(cycles=1, method=method, rtol=1e-8) for method in ("cvodes",)}
    monkeypatch.setattr(compile.shutil, "which", lambda _: None)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compile.importlib.util, "find_spec", lambda _: None)
    with pytest.warns(NoCompilerWarning, match="times as long"):
        virtual = load(folder)
    assert not virtual.compiled
    for method, a in solutions.items():
        b = virtual.simulate(cycles=1, method=method, rtol=1e-8)
        np.testing.assert_allclose(a.x, b.x, rtol=1e-9, atol=1e-13)
        np.testing.assert_allclose(a["ball.force"], b["ball.force"], rtol=1e-9, atol=1e-9)
        assert b.statistics.steps is not None
        assert b.statistics.steps > 0


@pytest.mark.long
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed")
def test_ziglang_compiles_where_the_system_has_no_compiler(
    cache: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compile.shutil, "which", lambda _: None)
    monkeypatch.delenv("CC", raising=False)
    found = compile.find_compiler()
    assert found is not None
    assert found.identity.startswith("ziglang")
    assert compile.compile_sources((source,), found).path.exists()


def test_code_and_virtual_machine_agree_at_random_points(cache: Path, tmp_path: Path) -> None:
    model = load(write_folder(tmp_path / "model"))
    random = np.random.default_rng(7)
    for info in model.manifest.functions:
        compiled, virtual = model.function(info.name), model.symbolic(info.name)
        for _ in range(20):
            point = [ca.DM(random.normal(size=compiled.size_in(k))) for k in range(compiled.n_in())]
            for a, b in zip(compiled.call(point), virtual.call(point), strict=True):
                np.testing.assert_allclose(a.full(), b.full(), rtol=1e-13, atol=1e-13)


def test_nothing_is_said_when_all_is_well(cache: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(write_folder(tmp_path / "model"))


def test_a_large_source_is_compiled_without_optimization_and_gives_the_same_bits(
    cache: Path, monkeypatch: pytest.MonkeyPatch, make_model: Callable[..., Model]
) -> None:
    """The Jacobians of a bearing with every wave and five spalls (5 MB) took gcc longer than it may."""
    folder, blocks = make_model("rotor").folder, []
    for limit in (0, functions.LARGE):
        monkeypatch.setattr(functions, "LARGE", limit)
        model = load(folder)
        blocks.append(np.asarray(model.jacobian("rhs", "states", t=0.01, x=[2e-5, 1e-5, 0.1, 0.2])))
    assert np.array_equal(*blocks)
    assert len(list(cache.glob("rotor_equations*"))) == 2
