"""Claims about what is asked at one instant of a linkage that locks at others."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError

#: The press with a rod [m] shorter than its crank: hinge B stands ``crank |cos(angle)|`` beside the slider's guide.
ROD, CRANK = 5e-3, 6e-3
LOCKS = {"mechanism.bodies.rod.points.C": ROD}

ASKED: dict[str, Callable[..., Any]] = {
    "evaluate": lambda model, t, p: list(model.evaluate(t, parameters=p).values()),
    "jacobian": lambda model, t, p: model.jacobian("load.*", "mechanism.bodies.crank.points.B", t=t, parameters=p),
    "jacobian_function": lambda model, t, p: model.jacobian_function("rhs", t=t, parameters=p)(model.initial()),
    "hessian": lambda model, t, p: model.hessian("load.*", ("crank_angle",) * 2, t=t, parameters=p),
    "linearize": lambda model, t, p: model.linearize(t, x=np.full(8, 1e-6), parameters=p).stiffness,
    "static_equilibrium": lambda model, t, p: model.static_equilibrium(t, parameters=p).x,
}


@pytest.fixture(scope="module")
def press(make_virtual: Callable[..., Model]) -> Model:
    return make_virtual("punching_press")


@pytest.mark.filterwarnings("ignore::ballpass.runtime.KinkWarning")
@pytest.mark.parametrize("name", ASKED)
def test_what_is_asked_at_an_instant_needs_the_linkage_assembled_at_that_instant(press: Model, name: str) -> None:
    """RRP can be assembled where the rod reaches the guide: crank |cos(angle)| < rod."""

    def ask(degrees: float, parameters: Mapping[str, float]) -> Any:
        return ASKED[name](press, math.radians(degrees) / press.parameters["mechanism.driver.speed"], parameters)

    edge = math.degrees(math.acos(ROD / CRANK))
    for degrees in (edge + 5.0, 175.0 - edge):
        for found in ask(degrees, LOCKS):
            assert np.all(np.isfinite(found))
    for degrees in (0.0, edge - 0.01, 180.0 - edge + 0.01):
        words = f"joint 'C' at .* s, crank angle {degrees:.2f} deg .*margin -"
        with pytest.raises(RequestError, match=words) as refused:
            ask(degrees, LOCKS)
        margin = float(re.findall("margin (.*)\\)", str(refused.value))[0])
        assert margin == pytest.approx(1.0 - (CRANK * math.cos(math.radians(degrees)) / ROD) ** 2, rel=1e-3)
    ask(0.0, {})


def test_a_jacobian_function_is_not_moved_to_where_the_linkage_locks(press: Model) -> None:
    prepared = press.jacobian_function("rhs")
    with pytest.raises(RequestError, match="cannot be assembled at joint 'C'"):
        prepared.move(0.0, LOCKS)
