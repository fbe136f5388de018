"""Claims about events: the switching functions say where a run is cut and where a ball's force has kinks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import sympy as sp

from ballpass.derive import derive
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.terms import TIME
from ballpass.runtime import Model


@pytest.mark.parametrize("name", ["punching_press", "four_bar", "offset_slider"])
def test_a_run_is_cut_at_the_zeros_of_switching_functions_of_an_angle(
    scene_text: Callable[..., str], make_model: Callable[..., Model], name: str
) -> None:
    system = derive(scene_from_text(scene_text(name), name))
    values = {sp.Symbol(p.name, real=True): p.default for p in system.parameters}
    events = [event for event in system.events if event.kind == "angle"]
    cuts = make_model(name).breakpoints(0.0, 0.35)
    assert len(events)
    assert len(cuts) >= len(events)
    for event in events:
        assert sp.diff(event.function, TIME) == event.rate
    for time in cuts:
        past = [float(event.function.subs(values).subs(TIME, time)) / (2 * np.pi) for event in events]
        assert min(abs(turns - round(turns)) for turns in past) < 1e-12


def test_kinks_of_a_ball_are_events_of_the_state(scene_text: Callable[..., str]) -> None:
    gated = scene_text("punching_press", ('law = "one-sided"', 'law = "one-sided-gated"'))
    system = derive(scene_from_text(gated, "gated"))
    events = [event for event in system.events if event.kind == "state"]
    ball = system.bearings[0].ball
    assert [(e.function, e.rate) for e in events] == [
        (ball.deflection, ball.deflection_rate),
        (ball.deflection_rate, None),
    ]
    assert ["jumps" in e.changes for e in events] == [True, False]
