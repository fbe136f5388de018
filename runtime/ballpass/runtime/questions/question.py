"""The declaration of a question: its function, options, and how the command line shows it.

A question is a function of a model.  Parameters with a type of `contract.options` are its options; ``parameters`` are
overrides of the numbers; ``progress`` gets the part that is done.  Modules with heavy work are imported inside
functions: the command line imports all questions before it knows which one is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import wraps
from inspect import Parameter, cleandoc, signature
from typing import TYPE_CHECKING, Any, Literal, TypeVar, cast

from ballpass.runtime.contract.arguments import plain, typed
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.options import options_of, refuse_faults, refuse_unknown
from ballpass.runtime.contract.refused_scenes import refuse_still, refuse_without_bearings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A `Model`, which imports the questions and cannot be imported here.
AnyModel = Any

_Function = TypeVar("_Function", bound=Callable[..., Any])


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """Declares a function as a question, as its decorator.  The docstring then has the words of all options.

    Attributes
    ----------
    name : of the command; the function's if there is none
    stage : words of its progress
    needs : optional package without which there is no answer
    check : of values of the options: RequestError where they contradict each other
    runs : whether it integrates, so that the stepper is compiled first
    samples : whether samples are enough, which other methods give without a compiler
    takes_runs : whether the solution of a run may stand in place of the model
    figures : of a model, an answer and overrides, by names of files
    files : of an answer: further files for that folder, by their names
    steady : whether its numbers are those of the steady machine, so that what is not is warned of; where it finds
        parameters itself, a function of the answer that gives them
    requires : what a scene must have for an answer: ``"states"`` or ``"bearings"``; empty for nothing
    digits : whether the command asks at a tighter tolerance as well, and prints the digits that both bear
    always : whether figures are drawn into the folder of the results unless they are turned off; otherwise figures and
        ``<name>.json`` are written where a folder is given
    """

    name: str = ""
    stage: str = "simulating"
    needs: str = ""
    check: Callable[[Mapping[str, Any]], None] | None = None
    runs: bool = True
    samples: bool = False
    takes_runs: bool = False
    figures: Callable[[Any, Any, Mapping[str, float]], Iterator[tuple[str, Figure]]] | None = None
    files: Callable[[Any], Mapping[str, bytes]] | None = None
    requires: Literal["", "states", "bearings"] = ""
    digits: bool = False
    always: bool = False
    steady: bool | Callable[[Any], Mapping[str, float]] = False

    def refuse(self, values: Mapping[str, Any]) -> None:
        """Refuse a missing package, and values that contradict each other; the command does it before it derives."""
        if self.needs:
            need(self.needs)
        if self.check is not None:
            self.check(values)

    def refuse_scene(self, *, integrated: bool, bearings: bool) -> None:
        """Refuse a scene that the question has no meaning for; the command does it before it derives."""
        if self.requires == "bearings":
            refuse_without_bearings(self.name, bearings=bearings)
        elif self.requires:
            refuse_still(self.name, integrated=integrated)

    def __call__(self, ask: _Function) -> _Function:
        call, question = typed(ask), replace(self, name=self.name or ask.__name__)

        @wraps(ask)
        def checked(*given: Any, **named: Any) -> Any:
            values = signature(ask).bind(*given, **named)
            values.apply_defaults()
            for name, (kind, _) in options_of(ask).items():
                values.arguments[name] = plain(str(kind), values.arguments[name])
            refuse_faults(options_of(ask), values.arguments)
            self.refuse(values.arguments)
            refuse_unknown(options_of(ask), values.arguments)  # first, as the command line must
            manifest = next(iter(values.arguments.values())).manifest
            question.refuse_scene(integrated=manifest.integrated, bearings=bool(manifest.bearings))
            refuse_unknown(options_of(ask), values.arguments, manifest)
            return call(*values.args, **values.kwargs)

        checked.__doc__ = _with_options(ask)
        _DECLARED[checked] = question
        return cast("_Function", checked)


_DECLARED: dict[Callable[..., Any], Question] = {}


def declared(ask: Callable[..., Any]) -> Question:
    """The declaration of a question."""
    return _DECLARED[ask]


def is_declared(function: Any) -> bool:
    """Whether a function is a question."""
    return callable(function) and function in _DECLARED


def summary_of(function: Callable[..., Any]) -> str:
    """The docstring's paragraphs in front of its sections, each a line."""
    paragraphs = cleandoc(function.__doc__ or "").partition("\n\nParameters\n")[0].split("\n\n")
    return "\n\n".join(" ".join(one.split()) for one in paragraphs)


def _with_options(ask: Callable[..., Any]) -> str:
    """The docstring with words, unit and default of each option; other parameters it describes itself."""
    words, _, others = cleandoc(ask.__doc__ or "").partition("\n\nParameters\n----------")
    defaults = signature(ask).parameters
    lines = []
    for name, (_, option) in options_of(ask).items():
        default = defaults[name].default
        by_default = "" if default in (None, Parameter.empty) else f"  Default: {default!r}"
        unit = f" [{option.unit}]" if option.unit else ""
        lines.append(f"{name} : {option.words}{by_default}{unit}")
    return "\n".join([words, "", "Parameters", "----------", *lines]) + others
