"""The punching press with other damping laws, as replacements in its scene."""

from __future__ import annotations

from collections.abc import Callable

from ballpass.runtime import Model

#: The law that the shipped scene has.
LAW = 'law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"'

LAWS = {
    "one-sided": LAW,
    "stiff": 'law = "one-sided"\ncoefficient = "2.16e4 N*s/m"',
    "one-sided-gated": 'law = "one-sided-gated"\ncoefficient = "683 N*s/m"',
    "two-sided-gated": 'law = "two-sided-gated"\ncoefficient = "683 N*s/m"',
    "tangent": 'law = "tangent"\nratio = "0.25e-5 s"',
}


def press(make_model: Callable[..., Model], law: str = "one-sided") -> Model:
    """The press with one of `LAWS`."""
    return make_model("punching_press", (LAW, LAWS[law]))
