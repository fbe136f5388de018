"""Measure the trade of accuracy against time on the shipped scenes, and write its page of the documentation.

    python -m trade [--scenes NAME ...] [--members N]

Writes docs/trade.md and docs/images/trade_<scene>.png.  How to read it: every number on the page comes from here;
errors are relative to a reference made by two methods, times are of the processor for the integration alone, and all
ratios are of times measured in one run, interleaved.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.app.commands.shared import Stages
from ballpass.runtime.certify.trade import measure_trade
from ballpass.runtime.certify.trade_report import Trade, percent, table, words
from ballpass.runtime.plot.style import save
from ballpass.runtime.plot.trade import draw_trade
from trade.promise import ROOT, SCENES, markdown

PEAK = "peak_ball_force"


def page(trades: list[Trade], minutes: float) -> str:
    """The page of the documentation."""
    first = trades[0]
    parts = [
        "# Speed for accuracy, measured",
        "<!-- Written by `make trade`. Do not edit. -->",
        "What an error of the result costs, on the shipped scenes. `ballpass trade SCENE` makes the same table for "
        "your own; [how to use it](howto/accuracy.md).",
        f"Errors are relative, the 95 % point over {first.members} parameter sets within {percent(first.spread)} of "
        "the scene's (contact makes single runs a lottery). The reference is Rodas5P at rtol 1e-12, checked by "
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
            "Peak ball force, what no other way beats:",
            markdown(*table(trade, PEAK)),
            "Worst of all quantities:",
            markdown(*table(trade)),
            words(trade)[-1],
        ]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(prog="trade", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--members", type=int, default=30, help="parameter sets of each trade")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "trade.md", help="page to write")
    given = parser.parse_args()
    started = time.perf_counter()
    trades = []
    with Stages() as stages:
        for name in given.scenes:
            model = load(generate(ROOT / "scenes" / f"{name}.toml", progress=stages))
            stages(f"measuring: {name}")
            trades.append(measure_trade(model, members=given.members, progress=stages.fraction))
            save(draw_trade(trades[-1], PEAK), ROOT / "docs" / "images" / f"trade_{name}.png")
    given.out.write_text(page(trades, (time.perf_counter() - started) / 60.0), encoding="utf-8", newline="\n")
    print(given.out)


if __name__ == "__main__":
    main()
