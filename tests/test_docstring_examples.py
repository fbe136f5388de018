"""Everything public has an example in its docstring, and the examples run and print what they show.

They see the press of the paper as `model`, its generated folder and results where commands would write them, NumPy as
`np`, and all public names.
"""

from __future__ import annotations

import doctest
import importlib.util
import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from typer.testing import CliRunner

import ballpass.derive
import ballpass.runtime
import ballpass.testing
from ballpass.runtime import Model
from ballpass.runtime.app.cli import app

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parent.parent
REFERENCE = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
#: Of packages that not every installation has.
WRAPPERS = ("ballpass.jax", "ballpass.torch")
#: Names by `__all__`, but for errors and warnings; and names of the reference.
PUBLIC = {
    name: found
    for package in (ballpass.runtime, ballpass.derive, ballpass.testing)
    for name in package.__all__
    if not (inspect.isclass(found := getattr(package, name)) and issubclass(found, BaseException))
}
PUBLIC |= {
    name: getattr(import_module(module), name)
    for module, name in re.findall(
        r"auto(?:function|class):: (ballpass\.(?:derive|runtime)\S*)\.(\w+)$", REFERENCE, re.M
    )
}
#: What other modules call, though its name has no underscore.
INTERNAL = {
    "Accuracy.plain",
    "EnsembleResult.attributes",
    "Parameters.table_html",
    "QuantityFunction.arguments",
    "QuantityFunction.check_differentiable",
    "QuantityFunction.check_shape",
    "QuantityFunction.refuse_second",
    "Reductions.from_facts",
    "Reductions.table_html",
    "SolutionPlot.__call__",
}
#: Of examples that need what not every installation has.
MARKS = {
    "Model.explore": pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed")
}
#: Code of a page at 1280 pixels, and what is code.
COLUMNS, EXAMPLE = 90, re.compile(r" *(>>>|\.\.\.) ")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL


def documented() -> Iterator[tuple[str, Any]]:
    """Public functions and classes, and methods of the classes, also those of their bases: each once."""
    for name, found in PUBLIC.items():
        yield name, found
        for base in found.__mro__ if inspect.isclass(found) else ():
            if base.__module__.startswith("ballpass.") and not base.__module__.startswith("ballpass.runtime.native."):
                for method, value in vars(base).items():
                    value = getattr(value, "__func__", value)
                    public = not method.startswith("_") or method == "__call__"
                    if public and inspect.isfunction(value) and f"{name}.{method}" not in INTERNAL:
                        yield f"{name}.{method}", value


@pytest.fixture(scope="module")
def names(make_model: Callable[..., Model], tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    folder = tmp_path_factory.mktemp("examples")
    (folder / "scenes").symlink_to(ROOT / "scenes")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        model = make_model("punching_press")
        done = CliRunner().invoke(app, ["run", "scenes/punching_press.toml", "--no-figures"])
        assert done.exit_code == 0, done.output
        yield {"Path": Path, "np": np, "model": model, **PUBLIC}


@pytest.fixture
def run(names: dict[str, Any]) -> Iterator[Callable[[str, Any], None]]:
    """Runs the examples of one docstring."""

    def run_examples(name: str, found: Any) -> None:
        runner, told = doctest.DocTestRunner(optionflags=FLAGS, verbose=False), []
        for test in doctest.DocTestFinder(recurse=False).find(found, name, globs=dict(names)):
            for line in (test.docstring or "").splitlines():
                assert not EXAMPLE.match(line) or len(line.strip()) <= COLUMNS, f"{name}: {line.strip()}"
            runner.run(test, out=told.append)
        assert runner.summarize(verbose=False).attempted, f"{name}: its docstring has no example (>>>)"
        assert not runner.failures, "".join(told)

    yield run_examples
    plt.close("all")


@pytest.mark.parametrize(
    ("name", "found"), [pytest.param(*item, id=item[0], marks=MARKS.get(item[0], ())) for item in documented()]
)
def test_public_names_have_examples_that_run(run: Callable[[str, Any], None], name: str, found: Any) -> None:
    run(name, found)


@pytest.mark.parametrize("wrapper", WRAPPERS)
def test_examples_of_wrappers_run(run: Callable[[str, Any], None], wrapper: str) -> None:
    package = wrapper.rpartition(".")[2]
    pytest.importorskip(package, reason=f"not installed: pip install ballpass[{package}]")
    run(f"{wrapper}.wrap", import_module(wrapper).wrap)
