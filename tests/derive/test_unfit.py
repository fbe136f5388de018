"""Claims about scenes that the stepper does not take: they run on CasADi's functions, and say why and at what cost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import generate
from ballpass.derive.lowering.ball_kernels import BallBuilder, UnfitError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, NoKernelsWarning, load


def test_it_runs_on_casadis_functions_with_a_warning(
    make_model: Callable[..., Model],
    scene_text: Callable[..., str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reference = make_model("varying_compliance").simulate(cycles=0.2, transient=0, rtol=1e-9)

    def refuse(_: BallBuilder) -> None:
        raise UnfitError("ball.deflection is not linear in the direction of the ball")

    monkeypatch.setattr(BallBuilder, "_relative", refuse)
    folder = generate(scene_from_text(scene_text("varying_compliance"), "vc"), tmp_path / "vc")
    assert not (folder / "kernels.h").exists()
    slow = load(folder)
    assert not slow.has_stepper
    with pytest.warns(NoKernelsWarning, match=r"\(ball\.deflection is not linear.*\).*ten times as long"):
        run = slow.simulate(cycles=0.2, transient=0, rtol=1e-11)
    assert np.max(np.abs(run.x - reference.x)) < 1e-6 * np.max(np.abs(reference.x))
