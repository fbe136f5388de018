"""A trade measures errors against a reference of two methods, and tells what they cost; its report survives JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ballpass.runtime import Model, RequestError
from ballpass.runtime.certify.method_choice import MethodChoice
from ballpass.runtime.certify.trade import measure_trade, perturbed
from ballpass.runtime.certify.trade_report import Measured, Trade, percent, table, words
from ballpass.runtime.plot.style import save
from ballpass.runtime.plot.trade import draw_trade

PEAK, SWING = "peak_ball_force", "range_inner_x"
LOOSE, TIGHT = MethodChoice(method="stepper", rtol=1e-3), MethodChoice(method="stepper", rtol=1e-7)
LOCATED = replace(TIGHT, kinks="located")


@pytest.fixture(scope="module")
def trade(make_model: Callable[..., Model]) -> Trade:
    return measure_trade(make_model("four_bar"), [PEAK, SWING], members=8, ways=(LOOSE, TIGHT, LOCATED))


def test_errors_are_those_against_an_independent_run_of_the_same_members(
    trade: Trade, make_model: Callable[..., Model]
) -> None:
    """Members in lanes by another method, which share no code with the runs that were measured."""
    model = make_model("four_bar")
    sets = perturbed(model, dict(model.parameters), 8)
    columns = {name: [numbers[name] for numbers in sets] for name in sets[0]}
    exact = model.simulate_many(columns, [PEAK, SWING], method="stepper-dp54", rtol=1e-10)
    loose = [model.reduce(parameters=numbers, method="stepper", rtol=1e-3) for numbers in sets]
    errors = np.abs(np.array([one["ball.force"].maximum for one in loose]) / exact[PEAK] - 1.0)
    (told,) = (one for one in trade.measured if one.way == LOOSE)
    assert told.promised[PEAK] == pytest.approx(np.quantile(errors, 0.95, method="higher"), rel=1e-3)
    assert trade.values[SWING] == pytest.approx(np.median(exact[SWING]), rel=1e-6)


def test_tighter_tolerances_and_located_kinks_are_more_accurate_and_the_front_goes_on(trade: Trade) -> None:
    loose, tight, located = trade.measured
    assert trade.error(loose) > 30.0 * trade.error(tight) > 30.0 * trade.error(located)
    assert max(trade.uncertainty.values()) < trade.error(located)
    assert loose.time < tight.time
    errors = [trade.error(one) for one in trade.front()]
    times = [one.time for one in trade.front()]
    assert errors == sorted(errors, reverse=True)
    assert times == sorted(times)
    assert trade.cheapest(0.5) == loose
    assert trade.cheapest(0.0) is None
    assert any("Ending steps on the kinks" in line for line in words(trade))


def test_members_lie_around_the_numbers_asked_for_and_within_their_bounds(make_model: Callable[..., Model]) -> None:
    model = make_model("punching_press")
    near = 0.4999
    around = {**model.parameters, "bearing.contact.poisson_ratio": near}
    sets = perturbed(model, around, 50, spread=0.01)
    ratios = np.array([one["bearing.contact.poisson_ratio"] for one in sets])
    assert ratios.max() < 0.5  # its bound: mirrored, not cut
    assert 0.99 * near <= ratios.min() < ratios.max()
    clearances = np.array([one["bearing.clearance"] for one in sets]) / around["bearing.clearance"]
    assert 0.99 <= clearances.min() < 0.995 < 1.005 < clearances.max() <= 1.01
    assert sets == perturbed(model, around, 50, spread=0.01)


def test_what_cannot_be_finished_is_told_and_never_on_the_front(trade: Trade) -> None:
    failed = Measured(
        way=replace(LOOSE, method="stepper-dop853"),
        time=math.inf,
        median=dict.fromkeys((PEAK, SWING), math.inf),
        promised=dict.fromkeys((PEAK, SWING), math.inf),
        failures=8,
    )
    more = replace(trade, measured=(*trade.measured, failed))
    assert failed not in more.front()
    data = json.loads(json.dumps(more.to_json(), allow_nan=False))
    assert data["trade"]["measured"][-1]["time"] is None
    assert data["trade"]["measured"][0]["promised"][PEAK] == trade.measured[0].promised[PEAK]
    assert data["words"] == words(more)


def test_the_table_and_the_figure_show_every_way_of_the_front(trade: Trade, tmp_path: Path) -> None:
    head, rows = table(trade, PEAK)
    assert len(rows) == len(trade.front(PEAK))
    assert all(len(row) == len(head) for row in rows)
    assert rows[-1][-1] == trade.front(PEAK)[-1].way.words
    figure = draw_trade(trade)
    shown = {line.get_label() for line in figure.axes[0].lines}
    assert shown >= {"stepper", "stepper, kinks located", "best of all"}
    save(figure, tmp_path / "trade.png")
    assert (tmp_path / "trade.png").read_bytes().startswith(b"\x89PNG")
    text = " ".join(str(trade).split())
    assert all(f"{name}: {trade.meanings[name]}" in text for name in trade.quantities)


def test_errors_are_written_as_people_read_them() -> None:
    assert [percent(error) for error in (0.01, 2.34e-4, 3.0, math.inf)] == ["1 %", "0.023 %", "300 %", "no result"]


def test_wrong_requests_are_refused(make_model: Callable[..., Model]) -> None:
    model = make_model("four_bar")
    with pytest.raises(RequestError, match="at least 2"):
        measure_trade(model, [PEAK], members=1)
    with pytest.raises(RequestError, match="peak_ball_force"):
        measure_trade(model, ["peak_ball_forse"])
