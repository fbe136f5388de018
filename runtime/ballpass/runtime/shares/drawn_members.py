"""Members whose inputs are drawn from distributions: read from text, run in blocks that survive a kill.

In: a model, texts: ``bearing.clearance=5 um:20 um`` (uniform), ``...=5 um:20 um:log`` (uniform in the logarithm), or
``...=norm:loc=10 um:scale=2 um``; values of the inputs.  Out: values of quantities, NaN for members without results.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.ask.kept_parts import Arrays, kept_parts
from ballpass.runtime.ask.parameter_range import parameter_range
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.units import QuantityError, parse_quantity
from ballpass.runtime.many.distributions import Distribution, plain_arguments
from ballpass.runtime.many.ensemble import simulate_many
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.show.progress import Progress, shown

#: Most members; those that are run together where they are kept: a tenth slower than all at once.
MOST, BLOCK = 10_000_000, 1024


def read_inputs(manifest: Manifest, option: str, vary: str | Sequence[str]) -> dict[str, Distribution]:
    """Distributions of the inputs by name.

    Parameters
    ----------
    option : what the caller calls them, for messages

    Raises
    ------
    RequestError
        None, or one twice; or see `parameter_distribution`.
    """
    texts = [vary] if isinstance(vary, str) else list(vary)
    pairs = [parameter_distribution(manifest, option, text) for text in texts]
    found = dict(pairs)
    if not found or len(found) < len(pairs):
        raise RequestError(
            f"{option}: one parameter or more is expected, each once, not {[name for name, _ in pairs]!r}."
        )
    return found


def parameter_distribution(manifest: Manifest, option: str, text: str) -> tuple[str, Distribution]:
    """Read a parameter and its distribution.

    Parameters
    ----------
    option : what the caller calls it, for messages

    Raises
    ------
    RequestError
        Another form, an unknown parameter or distribution, a wrong unit, or numbers out of bounds.
    """
    path, _, written = (part.strip() for part in text.partition("="))
    name, *parts = (part.strip() for part in written.split(":"))
    if not parts or not all("=" in part for part in parts):
        chosen = parameter_range(manifest.parameters, option, text)
        low, high = sorted((chosen.low, chosen.high))
        if chosen.logarithmic:
            return path, Distribution(name="loguniform", arguments={"a": low, "b": high})
        return path, Distribution(name="uniform", arguments={"loc": low, "scale": high - low})
    units = {info.name: info.unit for info in manifest.parameters}
    if path not in units:
        raise RequestError(f"{option}: {unknown_name('parameter', path, units)}")
    given = {word.strip(): value.strip() for word, _, value in (part.partition("=") for part in parts)}
    plain = plain_arguments(name, given)
    try:
        values = {word: parse_quantity(value, "1" if word in plain else units[path]) for word, value in given.items()}
    except QuantityError as error:
        raise RequestError(f"{option} {path}: {error}") from None
    return path, Distribution(name=name, arguments=values)


def check_count(members: int) -> None:
    """Refuse more members than are allowed, before any is drawn."""
    if members > MOST:
        raise RequestError(f"samples: {members} members. Allowed: {MOST}. Give fewer samples.")


def fault_of(failed: int, members: int, known: bool) -> str:
    """What is at fault where members without results leave no number that was asked for; empty if nothing is.

    Parameters
    ----------
    known : whether each input has numbers
    """
    if failed == members:
        return "No member has a result."
    if failed and not known:
        return (
            f"{failed} of {members} members have no result: too few are left to compare. Give narrower distributions."
        )
    return ""


def _infinite_words(names: Sequence[str], values: np.ndarray) -> tuple[str, ...]:
    """Warnings about infinite values, as lives of bearings that carry nothing: means and shares leave them out."""
    counts = np.count_nonzero(np.isinf(values), axis=0).tolist()
    return tuple(
        f"{name} is infinite in {count} of {len(values)} members, which its means and shares leave out."
        for name, count in zip(names, counts, strict=True)
        if count
    )


def values_of(inputs: Mapping[str, Distribution], shares: np.ndarray) -> np.ndarray:
    """Values of the inputs from shares of smaller ones, shape (members, inputs)."""
    return np.stack([one.values(share) for one, share in zip(inputs.values(), shares.T, strict=True)], axis=1)


def run_drawn(
    model: LoadedModel,
    inputs: Mapping[str, Distribution],
    members: np.ndarray,
    names: Sequence[str],
    seed: int,
    progress: Progress,
    **run: Any,
) -> tuple[np.ndarray, dict[str, Any]]:
    """Values of quantities, shape (members, quantities), and what an answer says of the members: its fields.

    Parameters
    ----------
    members, names, run : as for `run_members`
    """
    with shown("simulating", progress) as tell:
        values, faults = run_members(model, tuple(inputs), members, names, progress=tell, **run)
    return values, {
        "inputs": tuple(inputs),
        "distributions": tuple(map(_words_of, inputs.values())),
        "seed": seed,
        "members": len(values),
        "failed": len(faults),
        "fault": faults[0] if faults else "",
        "infinite": _infinite_words(names, values),
    }


def _words_of(one: Distribution) -> str:
    """A distribution with its arguments, SI."""
    return f"{one.name}({', '.join(f'{key}={value:g}' for key, value in one.arguments.items())})"


def run_members(
    model: LoadedModel,
    inputs: Sequence[str],
    members: np.ndarray,
    names: Sequence[str],
    *,
    cycles: float | None,
    transient: float | None,
    parameters: Mapping[str, float] | None,
    keep: str | Path | None,
    progress: Callable[[float], None] | None,
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Values of quantities, shape (members, quantities), and messages of the members without results.

    Parameters
    ----------
    inputs : names of the columns
    members : values of the inputs, shape (members, inputs)
    names : of the quantities
    keep : see `kept_parts`
    """
    fixed = dict(parameters or {})
    block = len(members) if keep is None else BLOCK

    def run(first: int) -> Arrays:
        some = members[first : first + block]
        table: dict[str, object] = {name: np.full(len(some), value) for name, value in fixed.items()}
        found = simulate_many(
            model,
            table | dict(zip(inputs, some.T, strict=True)),
            names,
            cycles=cycles,
            transient=transient,
            progress=None if progress is None else lambda done: progress((first + done * len(some)) / len(members)),
        )
        if found.interrupted:
            raise KeyboardInterrupt
        return np.array([found[name] for name in names]).T, np.array([one.message for one in found.failures], dtype=str)

    with kept_parts(keep, model, tuple(inputs), tuple(names), cycles, transient, fixed) as parts:
        blocks = [
            parts.once(members[first : first + block], partial(run, first)) for first in range(0, len(members), block)
        ]
    return np.concatenate([values for values, _ in blocks]), tuple(str(one) for _, some in blocks for one in some)
