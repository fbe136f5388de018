"""Dependencies of a model's states, their rates and its outputs, for importers of an FMU.

In: a model.  Out: for each of them the names of time, parameters and states that move it: at any moment, and where a
run starts.  From the sparsity of the generated functions, so that a quantity that is not listed has no influence at
all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi
import numpy as np

from ballpass.runtime.export.scene_numbers import computed_outputs, moment_symbols, outputs_function
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.time import timeline


@dataclass(frozen=True, slots=True, kw_only=True)
class Dependencies:
    """Dependencies of each state, rate ``der(<state>)`` and output that is not a state, by name.

    Attributes
    ----------
    running : among ``time``, parameters and states, at any moment; a state depends on itself alone
    initial : among ``time`` and parameters, where a run starts
    """

    running: dict[str, tuple[str, ...]]
    initial: dict[str, tuple[str, ...]]


def rates_and_outputs(model: LoadedModel) -> tuple[dict[str, casadi.SX], casadi.SX]:
    """Symbols t, x, u, p, c; over them the rates and, behind these, numbers of the outputs that are no states."""
    moment = moment_symbols(model.manifest)
    functions = [model.symbolic("rhs"), outputs_function(model)]
    results = [function(*(moment[name] for name in function.name_in())) for function in functions]
    return moment, casadi.vertcat(*(casadi.densify(result) for result in results))


def dependencies(model: LoadedModel) -> Dependencies:
    """Of all states, rates and outputs of a model."""
    manifest = model.manifest
    moment, results = rates_and_outputs(model)
    t, x, u, p, c = (_pattern(results, symbol) for symbol in moment.values())
    # parameters and derived constants, and their effects
    names = [*(info.name for info in manifest.parameters), *(info.name for info in manifest.constants)]
    own = np.eye(len(manifest.parameters), dtype=bool)
    both = np.vstack([own, _pattern(model.symbolic("constants")(moment["p"]), moment["p"])])
    inputs = _among(names, [timeline.names_of_input(manifest, item) for item in manifest.inputs]) @ both
    start = _among(names, [(name,) for name in manifest.initial]) @ both
    p = p | u @ inputs | c @ both[len(own) :]
    unmoved, itself = np.zeros((len(start), 1), dtype=bool), np.eye(len(start), dtype=bool)
    running = np.vstack([np.hstack([unmoved, np.zeros_like(start), itself]), np.hstack([t, p, x])])
    initial = np.vstack([np.hstack([unmoved, start]), np.hstack([t, p | x @ start])])
    outputs = [name for info in computed_outputs(manifest) for name in [info.name] * info.size]
    unknowns = [*model.states, *(f"der({name})" for name in model.states), *outputs]
    knowns = ("time", *names[: len(own)], *model.states)
    return Dependencies(running=_by_name(unknowns, knowns, running), initial=_by_name(unknowns, knowns, initial))


def _pattern(result: casadi.SX, symbol: casadi.SX) -> np.ndarray:
    """Whether each number of a result depends on each of a symbol, shape (numbers of the result, of the symbol)."""
    sparsity = casadi.Function("f", [symbol], [result], {"allow_free": True}).jac_sparsity(0, 0)
    return np.array(casadi.DM(sparsity, 1.0).full() != 0.0)


def _among(names: Sequence[str], chosen: Sequence[Iterable[str]]) -> np.ndarray:
    """For each choice whether it has each of the names, shape (choices, names)."""
    return np.array([[name in some for name in names] for some in chosen], dtype=bool).reshape(-1, len(names))


def _by_name(unknowns: Sequence[str], knowns: Sequence[str], pattern: np.ndarray) -> dict[str, tuple[str, ...]]:
    """Names of the columns that the rows of a name have."""
    found: dict[str, np.ndarray] = {}
    for name, row in zip(unknowns, pattern, strict=True):
        found[name] = found.get(name, False) | row
    return {name: tuple(known for known, has in zip(knowns, row, strict=False) if has) for name, row in found.items()}
