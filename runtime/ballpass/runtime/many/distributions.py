"""Random numbers of members: distributions by SciPy's names, and a stream of numbers for each member.

In: a seed, the place of a class and of its members, distributions.  Out: columns of values.  A member's numbers depend
on the seed, its class and its place in the class alone: not on other members, nor on the worker that computes them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ballpass.runtime.contract.arguments import typed_methods
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.parameters import unknown_name

#: Streams of a member: of its parameters, and of its noise.
PARAMETERS, NOISE = 0, 1

#: Distributions whose shape parameters are values of the number itself, and may have its unit.
ENDS = ("loguniform", "reciprocal")


@typed_methods
@dataclass(frozen=True, slots=True, kw_only=True)
class Distribution:
    """A continuous distribution of `scipy.stats`.

    Attributes
    ----------
    name : "uniform", "norm", "lognorm", "triang", "loguniform", "truncnorm", or any other one of SciPy
    arguments : shape parameters, ``loc`` and ``scale`` by SciPy's names [SI]

    Raises
    ------
    RequestError
        SciPy has no such distribution, it does not take these arguments, or their values are outside its domain.

    Examples
    --------
    >>> speed = Distribution(name="norm", arguments={"loc": 50.0, "scale": 2.0})
    >>> speed.values(np.array([0.5, 0.975])).round(1)
    array([50. , 53.9])
    """

    name: str
    arguments: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        try:
            support = self._frozen().support()
        except TypeError as fault:
            shapes = ", ".join(shape_names(self.name)) or "no shape parameters"
            raise RequestError(
                f"{self.name}: {self._shown()}. Expected: {shapes}; loc and scale where wanted."
            ) from fault
        if not support[0] <= support[1]:  # SciPy gives NaN
            raise RequestError(
                f"{self.name}: {self._shown()} lie outside the domain of this distribution of scipy.stats. scale is "
                "above 0; for shape parameters see SciPy's page of it."
            )

    def _shown(self) -> str:
        return "the arguments " + (", ".join(f"{key} = {value!r}" for key, value in self.arguments.items()) or "(none)")

    def _frozen(self) -> Any:
        return _continuous(self.name)(**self.arguments)

    def values(self, quantiles: np.ndarray) -> np.ndarray:
        """Values whose share of smaller ones is `quantiles`, of its shape.

        Examples
        --------
        >>> clearance = Distribution(name="uniform", arguments={"loc": 5.0, "scale": 10.0})
        >>> clearance.values(np.array([0.0, 0.5]))
        array([ 5., 10.])
        """
        return np.asarray(self._frozen().ppf(quantiles), dtype=float)


def shape_names(name: str) -> tuple[str, ...]:
    """Names of the shape parameters of a distribution.

    Raises
    ------
    RequestError
        SciPy has no continuous distribution of this name.
    """
    shapes = _continuous(name).shapes
    return tuple(shapes.replace(" ", "").split(",")) if shapes else ()


def plain_arguments(name: str, given: Collection[str]) -> tuple[str, ...]:
    """Arguments without the number's unit, as a share of the width; those of `ENDS` are values of the number itself.

    Parameters
    ----------
    given : names of the arguments

    Raises
    ------
    RequestError
        SciPy has no continuous distribution of this name.
    """
    shapes = shape_names(name)
    return () if name in ENDS and "scale" not in given else shapes


def _continuous(name: str) -> Any:
    stats = need("scipy.stats")

    found = getattr(stats, name, None)
    if not isinstance(found, stats.rv_continuous):
        known = [key for key in dir(stats) if isinstance(getattr(stats, key), stats.rv_continuous)]
        raise RequestError(unknown_name("continuous distribution of scipy.stats", name, known))
    return found


def stream(seed: int, kind: int, member: int, what: int) -> np.random.Generator:
    """Random numbers of a member of a class: of its `PARAMETERS` or its `NOISE`."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(kind, member, what)))


def draw(
    seed: int, kind: int, members: int, distributions: Mapping[str, Distribution | float]
) -> dict[str, np.ndarray]:
    """Values of all members of a class by name, each of shape (members,).

    Parameters
    ----------
    kind : place of the class
    distributions : one of each name, or the number that all members have
    """
    varied = {name: one for name, one in distributions.items() if isinstance(one, Distribution)}
    quantiles = np.array([stream(seed, kind, member, PARAMETERS).random(len(varied)) for member in range(members)])
    columns = {name: one.values(quantiles[:, k]) for k, (name, one) in enumerate(varied.items())}
    fixed = {name: np.full(members, float(one)) for name, one in distributions.items() if isinstance(one, float | int)}
    return columns | fixed
