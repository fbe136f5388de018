"""Claims about scenes that the stepper does not take: they run on CasADi's functions, and say why and at what cost."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import generate
from ballpass.derive.lowering.ball_kernels import BallBuilder, UnfitError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, NoKernelsWarning, RequestError, load
from ballpass.runtime.export.c_program import export_c
from ballpass.runtime.export.fmu import export_fmu

REASON = "ball.deflection is not linear in the direction of the ball"


@pytest.fixture
def unfit(scene_text: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Model:
    def refuse(_: BallBuilder) -> None:
        raise UnfitError(REASON)

    with monkeypatch.context() as patch:
        patch.setattr(BallBuilder, "_relative", refuse)
        return load(generate(scene_from_text(scene_text("varying_compliance"), "vc"), tmp_path / "vc"))


def test_it_runs_on_casadis_functions_with_a_warning(make_model: Callable[..., Model], unfit: Model) -> None:
    reference = make_model("varying_compliance").simulate(cycles=0.2, transient=0, rtol=1e-9)
    assert not (unfit.folder / "kernels.h").exists()
    assert not unfit.has_stepper
    with pytest.warns(NoKernelsWarning, match=r"\(ball\.deflection is not linear.*\).*ten times as long"):
        run = unfit.simulate(cycles=0.2, transient=0, rtol=1e-11)
    assert np.max(np.abs(run.x - reference.x)) < 1e-6 * np.max(np.abs(reference.x))


@pytest.mark.parametrize(
    "asked",
    [
        lambda model, _: model.simulate(cycles=0.2, method="stepper"),
        lambda model, _: model.reduce(cycles=0.2),
        lambda model, _: model.simulate_many({"bearing.clearance": np.zeros(2)}, ["max:ball.force"], cycles=0.2),
        lambda model, _: model.life(cycles=0.2, transient=0),
        lambda model, _: model.sensitivity(["mean:ball.force"], ["bearing.clearance"], cycles=0.2, transient=0),
        lambda model, _: model.steady(),
        lambda model, path: export_c(model.folder, path / "program"),
        lambda model, path: export_fmu(model.folder, path / "vc.fmu"),
    ],
    ids=["stepper", "reduce", "many", "life", "sensitivity", "steady", "export-c", "export-fmu"],
)
def test_what_needs_the_stepper_says_why_there_is_none(
    unfit: Model, tmp_path: Path, asked: Callable[[Model, Path], object]
) -> None:
    """Every call that needs it, in the words of the derivation, and none that advises a compiler."""
    with pytest.raises(RequestError, match=re.escape(REASON)) as refused:
        asked(unfit, tmp_path)
    assert "gcc" not in str(refused.value)
