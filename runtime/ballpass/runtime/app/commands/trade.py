"""``ballpass trade``: error and time of methods and tolerances on a user's scene."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

from ballpass.runtime.app.commands.load_scene import generated_folder
from ballpass.runtime.contract.options import Option
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.show.progress import Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.derive.reading.change_coupling import Coupling
    from ballpass.runtime.certify.simplification import Simplification
    from ballpass.runtime.certify.trade_report import Trade
    from ballpass.runtime.model import Model

Of = Annotated[
    Sequence[str] | None,
    option_names.quantity(
        "Quantity whose error counts, as for a sweep: `peak_ball_force`, `rms:inner.y`, `range:inner.x`. May be "
        "repeated. Peak ball force, rms and range of the inner ring's motion if none is given."
    ),
]
Against = Annotated[
    str | None,
    Option(
        words="Measure another model of the machine instead of methods: `one-way` or `two-way`, the same scene with "
        "its bearings coupled so, or another scene file.",
        shown="WHAT",
    ),
]
Members = Annotated[
    int | None,
    Option(words="Parameter sets around the scene's; 40 if not given.", shown="N", least=2, most=10_000),
]


def _figures(_model: AnyModel, found: Trade | Simplification, _parameters: Any) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.certify.trade_report import Trade
    from ballpass.runtime.plot.trade import draw_trade

    if not isinstance(found, Trade):
        return
    for quantity in found.quantities:
        yield f"trade_{re.sub(r'[^a-z0-9]+', '_', quantity)}", draw_trade(found, quantity)


@Question(stage="measuring", figures=_figures, always=True, requires="states")
def trade(
    model: AnyModel,
    *,
    scene: Path,
    of: Of = None,
    against: Against = None,
    members: Members = None,
    parameters: Mapping[str, float],
    progress: Progress = None,
) -> Trade | Simplification:
    """Measure error against time on a scene: of methods and tolerances, or of a simpler model (--against)."""
    from ballpass.runtime.certify.simplification import measure_simplification
    from ballpass.runtime.certify.trade import MEMBERS, measure_trade

    count = MEMBERS if members is None else members
    if against is None:
        return measure_trade(model, of, parameters=parameters, members=count, progress=progress)
    simpler = _simpler(scene, against)
    return measure_simplification(model, simpler, of, parameters=parameters, members=count, progress=progress)


def _simpler(scene: Path, against: str) -> Model:
    """Model of a scene's variant, or of another scene file or generated folder."""
    from ballpass.derive import generate, read_scene
    from ballpass.runtime.model import load, load_own

    if against in ("one-way", "two-way"):
        return load_own(generate(read_scene(scene, coupling=cast("Coupling", against))))
    return load(against) if Path(against).is_dir() else load_own(generate(against, generated_folder(Path(against))))
