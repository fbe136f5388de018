"""A solution with the error of quantities named instead of method and tolerance.

In: a model, a request, an error, a trade of the scene or none.  Out: a `Solution` whose ``accuracy`` tells choice,
estimate and cost.  Its samples are those of the integration that was judged.
"""

from __future__ import annotations

import time as clocks
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ballpass.runtime.certify.error_target import Search, meet_target
from ballpass.runtime.certify.prepared import Prepared, default_observables, prepare
from ballpass.runtime.certify.trade import FULL, Trade
from ballpass.runtime.contract import read_artefact
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run.request import Plan, Request, make_plan
from ballpass.runtime.run.segments import time_resolution
from ballpass.runtime.run.simulate import to_solution
from ballpass.runtime.run.stepping import Cost
from ballpass.runtime.run.trajectory import Trajectory

if TYPE_CHECKING:
    from ballpass.runtime.contract.parameters import Numbers
    from ballpass.runtime.run.solution import Solution

#: Which models may be taken: the full one alone, or simpler ones that the trade was measured with as well.
Models = Literal["any", "full"]


def simulate_to_error(
    model: LoadedModel,
    numbers: Numbers,
    request: Request,
    target: float,
    of: str | Sequence[str] | None,
    trade: Trade | None,
    models: Models = "any",
) -> Solution:
    """Simulate with the error of quantities named instead of method and tolerance; see `meet_target`.

    Parameters
    ----------
    models : ``"full"`` forbids simpler models, also the quasi-static one

    Raises
    ------
    RequestError
        A wrong request: method or tolerance named besides, a model without states, a trade of another scene.
    TargetMissed
        No way meets the target.
    """
    _check(model, request, trade, models)
    names = default_observables(model) if of is None else (of,) if isinstance(of, str) else tuple(of)
    plan = make_plan(model, numbers, request)
    run = prepare(
        model, numbers.parameters, duration=plan.duration, transient=plan.transient_cycles, initial=plan.initial
    )
    # behind what is compiled once
    started = clocks.perf_counter()
    simpler: dict[str, Prepared] = {}

    def prepared(name: str) -> Prepared:
        if name not in simpler:
            assert trade is not None
            simpler[name] = _simpler(trade.model(name), run, plan)
        return simpler[name]

    search = Search(
        run=run,
        simpler=prepared,
        recorder=lambda one: _memory(one, plan),
        progress=request.progress,
    )
    allowed = (FULL, *(_usable(trade, plan) if trade is not None and models == "any" else ()))
    found = meet_target(run, target, names, trade, models=allowed, quasi_static=models == "any", search=search)
    chosen = search.prepared(found.model)
    assert search.done is not None
    assert search.record is not None
    solution = to_solution(
        chosen.model,
        chosen.numbers,
        replace(plan, rtol=found.rtol),
        search.record,
        Cost(steps=search.done.steps, rejected=search.done.rejected),
        method=found.method,
        reason=found.words,
        magnitude=chosen.magnitude,
        started=started,
        status=Status.DONE,
    )
    return replace(solution, accuracy=found)


def _check(model: LoadedModel, request: Request, trade: Trade | None, models: str) -> None:
    if request.method is not None or request.rtol is not None:
        raise RequestError(
            "error was given, and method or rtol as well: with an error named, the tool chooses both. Give one or the "
            "other."
        )
    if not model.states:
        raise RequestError("This model has no states; its outputs follow from time alone, without an error.")
    if models not in ("any", "full"):
        raise RequestError(f"models: 'any' or 'full' is expected, not {models!r}.")
    if trade is not None and trade.scene != model.manifest.scene:
        raise RequestError(
            f"trade: measured of the scene {trade.scene!r}, and this is {model.manifest.scene!r}. Measure this scene "
            "with `ballpass trade`, or leave trade away."
        )


def _usable(trade: Trade, plan: Plan) -> list[str]:
    """Simpler models stored with the trade that have every output which is wanted."""
    found = []
    for name, folder in trade.folders.items():
        if name != FULL and folder.is_dir():
            offered = {info.name for info in read_artefact(folder).outputs}
            if offered.issuperset(plan.outputs):
                found.append(name)
    return found


def _simpler(model: LoadedModel, run: Prepared, plan: Plan) -> Prepared:
    """The same run of a simpler model, which has no parameters and no states for what it leaves out."""
    own = dict(zip(run.model.states, run.initial.tolist(), strict=True))
    return prepare(
        model,
        {name: value for name, value in run.numbers.parameters.items() if name in model.parameters},
        duration=plan.duration,
        transient=plan.transient_cycles,
        initial=np.array([own[name] for name in model.states]),
    )


def _memory(run: Prepared, plan: Plan) -> Trajectory:
    """Memory for the samples of a run."""
    near = time_resolution(0.0, plan.duration, plan.turn)
    stops = np.searchsorted(plan.times, run.segments.times - near)
    stops[0], stops[-1] = 0, len(plan.times)
    return Trajectory(
        begin=0.0,
        end=plan.duration,
        turn=plan.turn,
        initial=run.initial,
        t=plan.times,
        even=plan.even,
        x=np.empty((len(plan.times), len(run.initial))),
        segments=run.segments,
        stops=stops,
        near=near,
    )
