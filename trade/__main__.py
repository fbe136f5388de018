"""Measure the trade of accuracy against time on the shipped scenes, and write its page of the documentation.

    python -m trade [--scenes NAME ...] [--members N] [--calibration N]

Writes docs/trade.md, docs/images/trade_<scene>.png, results/<scene>/trade.json as `ballpass trade` does, and
runtime/ballpass/runtime/accuracy/ladder.json, with which a search begins where there is no trade.
How to read it: every number on the page comes from here; errors are relative to a reference made by two methods, times
are of the processor for the integration alone, and all ratios are of times measured in one run, interleaved.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ballpass.derive import read_scene
from ballpass.runtime.app.commands.shared import Stages, check_folder
from ballpass.runtime.app.commands.trade import MODELS, folders_of, key_of, load_models
from ballpass.runtime.app.figures.canvas import save
from ballpass.runtime.app.figures.trade import draw_trade
from ballpass.runtime.certify.calibration import Calibration, calibrate
from ballpass.runtime.certify.candidates import prefer, rungs
from ballpass.runtime.certify.ladder import TABLE, table_of
from ballpass.runtime.certify.prepared import check_observables
from ballpass.runtime.certify.stored_trade import FILE_NAME, to_plain
from ballpass.runtime.certify.trade import (
    FULL,
    TARGETS,
    Configuration,
    Measured,
    Trade,
    compile_fast_math,
    measure_trade,
)
from ballpass.runtime.certify.trade_report import milliseconds, percent, simplifications, table

ROOT = Path(__file__).resolve().parent.parent
SCENES = ("punching_press", "punching_press_tangent", "offset_slider", "four_bar", "varying_compliance")
PEAK = "peak_ball_force"

#: What speed is compared with.
SLOW = Configuration(model=FULL, method="cvodes", rtol=1e-6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What was measured on a scene."""

    scene: str
    trade: Trade
    observables: dict[str, tuple[str, str]]
    calibration: list[Calibration]


def measure(name: str, members: int, runs: int, stages: Stages) -> Result:
    """Trade and calibration of a scene; the trade is stored as the command stores it."""
    scene = read_scene(ROOT / "scenes" / f"{name}.toml")
    folder = ROOT / "results" / name
    check_folder(folder)
    models = load_models(scene, folder, stages)
    stages(f"measuring: {name}")
    found = measure_trade(
        models,
        members=members,
        fast_math=compile_fast_math(models[FULL], folder / MODELS / FULL),
        progress=lambda _, fraction: stages.fraction(fraction),
    )
    found = replace(found, folders=folders_of(scene, folder))
    text = json.dumps(to_plain(found, key_of(scene, None, members), folder), indent=1, allow_nan=False)
    (folder / FILE_NAME).write_text(text + "\n", encoding="utf-8", newline="\n")
    stages(f"calibrating: {name}")
    counted = calibrate(
        models[FULL],
        *((PEAK,), found.quantities),
        members=runs,
        trades=(found, None),
        simpler=models,
        progress=stages.fraction,
    )
    save(draw_trade(found, PEAK), ROOT / "docs" / "images" / f"trade_{name}.png")
    observables = dict(zip(found.quantities, check_observables(models[FULL], found.quantities), strict=True))
    return Result(scene=name, trade=found, observables=observables, calibration=counted)


def page(results: list[Result], minutes: float) -> str:
    """The page of the documentation."""
    first = results[0].trade
    parts = [
        "# Speed for accuracy, measured",
        "<!-- Written by `make trade`. Do not edit. -->",
        "What an error of the result costs, on the five shipped scenes. `ballpass trade SCENE` makes the same table "
        "for your own; [how to use it](howto/accuracy.md).",
        f"Errors are relative, the 95 % point over {first.members} parameter sets within {100 * first.spread:g} % of "
        "the scene's (contact makes single runs a lottery). The reference is Rodas5P at rtol 1e-11, checked by "
        "Dormand–Prince 5(4); the difference of the two is its uncertainty, and no error is claimed below that. Times "
        "are those of the integration alone on one processor, all measured in one run, interleaved. CasADi's methods "
        "are read at the samples the scene asks for, which read a spike low whatever the tolerance. The quasi-static "
        "model needs no transient: it leaves those cycles out, and its time is still divided by all of them.",
        f"`make trade` wrote this page in {minutes:.0f} minutes.",
    ]
    for result in results:
        parts += _scene(result)
    parts += _calibration(results)
    return "\n\n".join(parts) + "\n"


def _scene(result: Result) -> list[str]:
    trade = result.trade
    head, rows = table(trade, PEAK)
    doubt = ", ".join(f"{percent(value)} on {name}" for name, value in trade.uncertainty.items())
    return [
        f"## {trade.title}",
        f"`scenes/{result.scene}.toml`, {trade.cycles:g} cycles a run. Uncertainty of the reference: {doubt}.",
        f"![Error of the peak ball force against time a cycle](images/trade_{result.scene}.png)",
        "Peak ball force, what no other way beats:",
        _markdown(head, rows),
        "What an error costs, and what `--error` chooses from this measurement:",
        _markdown(
            (
                "error",
                "of",
                "cheapest",
                "time a cycle",
                "chosen",
                "its time over the cheapest's",
                "cvodes at 1e-6 over it",
            ),
            [row for of in ((PEAK,), trade.quantities) for target in TARGETS for row in _choice(result, target, of)],
        ),
        "What parts of the model cost and save:",
        "\n".join(f"- {line}" for line in simplifications(trade)),
    ]


def _choice(result: Result, target: float, of: tuple[str, ...]) -> list[tuple[str, ...]]:
    trade = result.trade
    quantity = of[0] if len(of) == 1 else None
    name = quantity or "all"
    cheapest = trade.cheapest(target, quantity)
    if cheapest is None:
        return [(percent(target), name, "none", "", "", "", "")]
    chosen = _chosen(result, target, of)
    start = (percent(target), name, cheapest.configuration.words, milliseconds(cheapest.time))
    if chosen is None:
        return [(*start, "none that was measured", "", "")]
    slow = next((one for one in trade.measured if one.configuration == SLOW), None)
    return [
        (
            *start,
            chosen.configuration.words,
            f"{chosen.time / cheapest.time:.2f}",
            f"{slow.time / chosen.time:.0f}" if slow is not None else "",
        )
    ]


def _chosen(result: Result, target: float, of: tuple[str, ...]) -> Measured | None:
    """What `--error` ends with: the preferred way, else the first rung of the ladder that keeps the target."""
    trade, observables = result.trade, [result.observables[name] for name in of]
    known = {one.configuration: one for one in trade.measured}
    preferred = prefer(trade, target, of, {one.configuration.model for one in trade.measured})
    ways = [preferred] if preferred is not None else rungs(target, observables, stiff=False)
    found = (known.get(Configuration(model=w.model, method=w.way[0], rtol=w.way[1])) for w in ways)
    return next((one for one in found if one is not None and max(one.promised[q] for q in of) <= target), None)


def _calibration(results: list[Result]) -> list[str]:
    return [
        "## Are named errors kept?",
        "`--error` on parameter sets around each scene, other ones than those of the trade; the true error is that "
        "against the reference. What was promised: within the target in 95 % of the runs, the estimate within a factor "
        "of ten of the true error in 90 %. Everything else that was integrated, companions and ways that did not meet "
        "the target, is counted against the chosen integration; the median over the runs is told.",
        _counted(results, measured=True),
        "The same without a stored trade, up the ladder that is the same for all scenes:",
        _counted(results, measured=False),
    ]


def _counted(results: list[Result], *, measured: bool) -> str:
    head = (
        *("scene", "of", "error asked for", "runs", "refused", "true error within it"),
        *("estimate within a factor of 10", "time a cycle", "all else integrated, over it", "chosen most"),
    )
    rows = []
    for result in results:
        for one in (c for c in result.calibration if c.measured == measured):
            (model, method, rtol), _ = one.ways[0] if one.ways else ((FULL, "none", 0.0), 0)
            name = one.of[0] if len(one.of) == 1 else "all"
            rows.append(
                (
                    *(result.scene, name, percent(one.target), str(one.runs), str(one.missed)),
                    *(f"{100 * one.within:.1f} %", f"{100 * one.near:.1f} %", milliseconds(one.time)),
                    *(f"{one.share:.2f}", Configuration(model=model, method=method, rtol=rtol).words),
                )
            )
    return _markdown(head, rows)


def _markdown(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def main() -> None:
    parser = argparse.ArgumentParser(prog="trade", description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=SCENES)
    parser.add_argument("--members", type=int, default=30, help="parameter sets of each trade")
    parser.add_argument("--calibration", type=int, default=200, help="runs of each target")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "trade.md", help="page to write")
    given = parser.parse_args()
    started = time.perf_counter()
    with Stages() as stages:
        results = [measure(name, given.members, given.calibration, stages) for name in given.scenes]
    text = page(results, (time.perf_counter() - started) / 60.0)
    given.out.write_text(text, encoding="utf-8", newline="\n")
    print(given.out)
    if set(given.scenes) == set(SCENES):
        # what a search begins with where there is no trade: of all scenes, or not at all
        observables = {name: one for result in results for name, one in result.observables.items()}
        TABLE.write_text(table_of([r.trade for r in results], observables), encoding="utf-8", newline="\n")
        print(TABLE)


if __name__ == "__main__":
    main()
