"""Measure the trade of accuracy against time on the shipped scenes, and write its page of the documentation.

    python -m benchmarks.trade [--scenes NAME ...] [--members N]
    python -m benchmarks.trade --draw

Writes benchmarks/trade/measured.json, docs/trade.md and docs/images/trade_<scene>.png; ``--draw`` measures nothing and
writes page and pictures of what was measured last.  How to read it: every number on the page comes from here;
errors are relative to a reference made by two methods, times are of the processor for the integration alone, and all
ratios are of times measured in one run, interleaved.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.app.commands.shared import Stages
from ballpass.runtime.certify.method_choice import MethodChoice
from ballpass.runtime.certify.trade import measure_trade
from ballpass.runtime.certify.trade_report import Measured, Trade, percent, table, words
from ballpass.runtime.plot.style import caption_of, save
from ballpass.runtime.plot.trade import draw_trade
from benchmarks.trade.promise import ROOT, SCENES, markdown

PEAK = "peak_ball_force"

#: What was measured last.
MEASURED = Path(__file__).with_name("measured.json")


def from_plain(data: Mapping[str, Any]) -> Trade:
    """The trade whose plain data these are."""

    def finite(values: Mapping[str, float | None]) -> dict[str, float]:
        return {name: math.inf if value is None else value for name, value in values.items()}

    measured = tuple(
        Measured(
            way=MethodChoice(**one["way"]),
            time=math.inf if one["time"] is None else one["time"],
            median=finite(one["median"]),
            promised=finite(one["promised"]),
            failures=one["failures"],
        )
        for one in data["measured"]
    )
    return Trade(**{**data, "quantities": tuple(data["quantities"]), "measured": measured})


def write(trades: list[Trade], minutes: float, target: Path) -> None:
    """The page of the documentation and its pictures beside it."""
    (target.parent / "images").mkdir(parents=True, exist_ok=True)
    captions = {}
    for trade in trades:
        figure = draw_trade(trade, PEAK)
        captions[trade.scene] = caption_of(figure)
        save(figure, target.parent / "images" / f"trade_{trade.scene}.png")
    target.write_text(page(trades, minutes, captions), encoding="utf-8", newline="\n")


def page(trades: list[Trade], minutes: float, captions: Mapping[str, str]) -> str:
    """Text of the page."""
    first = trades[0]
    parts = [
        "# Speed for accuracy, measured",
        "<!-- Written by `make trade`. Do not edit. -->",
        "What an error of the result costs, on the shipped scenes. `ballpass trade SCENE` makes the same table for "
        "your own; [how to use it](howto/accuracy.md).",
        f"Errors are relative, the 95 % point over {first.members} parameter sets within {percent(first.spread)} of "
        "the scene's (contact makes single errors random). The reference is Rodas5P at rtol 1e-12, checked by "
        "Dormand–Prince 5(4); the difference of the two is its uncertainty, and no error is claimed below that. Times "
        "are those of the integration alone on one processor, all measured in one run, interleaved.",
        f"`make trade` wrote this page in {minutes:.0f} minutes.",
    ]
    for trade in trades:
        doubt = ", ".join(f"{percent(value)} on {name}" for name, value in trade.uncertainty.items())
        parts += [
            f"## {trade.title}",
            f"`scenes/{trade.scene}.toml`, {trade.cycles:g} cycles a run. Uncertainty of the reference: {doubt}.",
            f"![Error of the peak ball force against time a cycle](images/trade_{trade.scene}.png)",
            f"*{captions[trade.scene]}*",
            "Peak ball force, what no other way beats:",
            markdown(*table(trade, PEAK)),
            "Worst of all quantities:",
            markdown(*table(trade)),
            words(trade)[-1],
        ]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.trade", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--members", type=int, default=30, help="parameter sets of each trade")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "trade.md", help="page to write")
    parser.add_argument("--draw", action="store_true", help="measure nothing: write the page of what was measured last")
    given = parser.parse_args()
    if not given.draw:
        found = measure(given.scenes, given.members)
        MEASURED.write_text(json.dumps(found, separators=(",", ":")) + "\n", encoding="utf-8")
    if not MEASURED.is_file():
        parser.error(f"{MEASURED} is not there: nothing was measured yet. Omit --draw.")
    found = json.loads(MEASURED.read_text(encoding="utf-8"))
    write([from_plain(data) for data in found["trades"]], found["minutes"], given.out)
    print(given.out)


def measure(scenes: list[str], members: int) -> dict[str, Any]:
    """Plain data of the trades, and how long it took [min]."""
    started, trades = time.perf_counter(), []
    with Stages() as stages:
        for name in scenes:
            model = load(generate(ROOT / "scenes" / f"{name}.toml", progress=stages))
            stages(f"measuring: {name}")
            trades.append(measure_trade(model, members=members, progress=stages.fraction).to_json()["trade"])
    return {"minutes": (time.perf_counter() - started) / 60.0, "trades": trades}


if __name__ == "__main__":
    main()
