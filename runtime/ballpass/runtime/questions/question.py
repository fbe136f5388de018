"""What makes a function a question: its options, its report, how the command line shows it.

A question is a function of a model.  Parameters with a type of `contract.options` are its options; ``parameters`` are
overrides of the model's numbers; ``progress`` is told how far it is.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from ballpass.runtime.contract.options import option_of, options_of
from ballpass.runtime.report.report import Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A `Model`.  It lists the questions, and so stands above them.
AnyModel = Any

_Function = TypeVar("_Function", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """How the command line asks a question.

    Attributes
    ----------
    name : of the command
    ask : the function
    report : of its answer
    stage : what is announced while it computes
    check : of values of the options, before anything is derived: RequestError where they contradict each other
    runs : whether it integrates, so that the stepper is compiled first
    figures : of a model, an answer and overrides, by names of files
    files : where figures and ``<name>.json`` go: to ``--out`` where that is given, or always (then figures alone)
    of_run : the same function of a run in a file, with fewer options
    """

    name: str
    ask: Callable[..., Any]
    report: Callable[[Any], Report]
    stage: str
    check: Callable[[Mapping[str, Any]], None] | None
    runs: bool
    figures: Callable[[Any, Any, Mapping[str, float]], Iterator[tuple[str, Figure]]] | None
    files: Literal["where asked", "always"]
    of_run: Callable[..., Any] | None


_DECLARED: dict[Callable[..., Any], Question] = {}


def question(
    *,
    name: str = "",
    report: Callable[[Any], Report] = lambda answer: answer.report(),
    stage: str = "simulate",
    check: Callable[[Mapping[str, Any]], None] | None = None,
    runs: bool = True,
    figures: Callable[[Any, Any, Mapping[str, float]], Iterator[tuple[str, Figure]]] | None = None,
    files: Literal["where asked", "always"] = "where asked",
    of_run: Callable[..., Any] | None = None,
) -> Callable[[_Function], _Function]:
    """Declare a function as a question; arguments are those of `Question`.  Its docstring gets its options' words."""

    def declare(ask: _Function) -> _Function:
        _DECLARED[ask] = Question(
            name=name or ask.__name__,
            ask=ask,
            report=report,
            stage=stage,
            check=check,
            runs=runs,
            figures=figures,
            files=files,
            of_run=of_run,
        )
        ask.__doc__ = _with_options(ask)
        return ask

    return declare


def questions_of(listed: type) -> list[Question]:
    """The questions that a class lists, in its order."""
    return [_DECLARED[item] for item in vars(listed).values() if inspect.isfunction(item) and item in _DECLARED]


def summary_of(function: Callable[..., Any]) -> str:
    """The docstring's paragraphs in front of its sections, each a line."""
    paragraphs = inspect.cleandoc(function.__doc__ or "").partition("\n\nParameters\n")[0].split("\n\n")
    return "\n\n".join(" ".join(one.split()) for one in paragraphs)


def _with_options(ask: Callable[..., Any]) -> str:
    """The docstring with words, unit and default of each option; other parameters it describes itself."""
    words, _, others = inspect.cleandoc(ask.__doc__ or "").partition("\n\nParameters\n----------")
    defaults = inspect.signature(ask).parameters
    lines = []
    for name, kind in options_of(ask).items():
        option = option_of(kind)
        assert option is not None
        default = defaults[name].default
        told = "" if default in (None, inspect.Parameter.empty) else f"  Default: {default!r}"
        unit = f" [{option.unit}]" if option.unit else ""
        lines.append(textwrap.fill(f"{name} : {option.words}{told}{unit}", 110, subsequent_indent="    "))
    return "\n".join([words, "", "Parameters", "----------", *lines]) + others
