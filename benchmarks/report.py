"""The page docs/benchmarks.md and its figures, from benchmarks/results/*.json alone: ``python -m benchmarks.report``.

A further part is an entry of `parts_of` in `benchmarks.__main__`, which writes a file of results, and an entry of
`SECTIONS` in `benchmarks.sections`.  A section without its file is left out.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import figures, provenance
from benchmarks.compared import GROUPS, Compared, Figure
from benchmarks.curves import LEVELS, error_of, lower, measured, written
from benchmarks.problem import SPREAD
from benchmarks.sections import SECTIONS
from benchmarks.tables import milliseconds, table, with_spread
from benchmarks.targets import targets

Result = dict[str, Any]

#: The page's text around the numbers.
TEMPLATE = Path(__file__).with_name("page.md")


def write(folder: Path, page: Path) -> None:
    """Write page and figures from the results in a folder; errors as for `text_of`."""
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text_of(folder, page.parent / "images", provenance.digest()), encoding="utf-8")


def text_of(folder: Path, images: Path, now: str) -> str:
    """Text of the page; figures are drawn into a folder.

    Parameters
    ----------
    folder : of the results
    images : folder of the figures
    now : digest of the code, which states of the results are compared with

    Raises
    ------
    FileNotFoundError
        There are no results of part 1.
    """
    results = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))}
    found = [results[f"work_precision_{key}"] for key in _ORDER if f"work_precision_{key}" in results]
    if not found:
        raise FileNotFoundError(f"{folder}: no results of work_precision are here; measure them first")
    cases = [Compared(case) for case in found]
    quick = any(result["quick"] for result in results.values())
    sections = [line for name, section in SECTIONS if name in results for line in (*section(results[name], images), "")]
    text = TEMPLATE.read_text(encoding="utf-8").format(
        note="**Measured with `QUICK=1`: these numbers only show that the scripts run.**\n\n" if quick else "",
        machine="\n".join(_machine(results)),
        states="\n".join(provenance.lines(results, now)),
        now=now,
        summary="\n".join(_summary(cases)),
        level=written(LEVELS[0]),
        elsewhere="\n".join(f"- {text}" for name, text in _ELSEWHERE if name in results),
        spread=f"{100 * SPREAD:g} %",
        tolerances=_tolerances(cases),
        cases="\n".join(line for case in cases for line in _case(case, images)),
        targets="\n".join(targets(cases, results)),
        sections="\n".join(sections),
        **_conditions(found),
    )
    return text.rstrip() + "\n"


#: Name of a file of results, and what its section tells, for the list on top.
_ELSEWHERE = (
    ("ensemble", "[Ensembles](#ensembles) advance eight parameter sets in the lanes of one core, and on all cores."),
    ("sensitivity_cost", "[Derivatives](#number-of-parameters) by any number of parameters come out of the same run."),
    (
        "sensitivity_error",
        "[How accurate derivatives are](#errors-of-derivatives) is a question of its own: pass `sensitivity_rtol`.",
    ),
    (
        "regeneration",
        "Changing a number compiles nothing; [from a scene to a model](#from-scene-to-model) takes seconds.",
    ),
)

#: A load below this is that of the benchmarks alone.
QUIET = 1.5

_ORDER = ("stiff", "onesided", "tangent")


def _machine(results: dict[str, Result]) -> list[str]:
    newest = next(iter(results.values()))["machine"]
    packages = ", ".join(f"{name} {version}" for name, version in newest["packages"].items())
    lines = [
        f"Machine: {newest['processor']}, {newest['cores']} cores, {newest['vectors'] or 'no wide vectors'}; "
        f"{newest['system']}; {newest['compiler']}; Python {newest['python']}; {packages}."
    ]
    begun, after = (
        [result["machine"][when] for result in results.values() if result["machine"].get(when) is not None]
        for when in ("load", "load_after")
    )
    if begun:
        quiet = max(begun) < QUIET
        lines += [
            "",
            f"Load of the machine (programs that wanted a processor, these included): {min(begun):.1f} to "
            f"{max(begun):.1f} when parts began"
            + (f", {min(after):.1f} to {max(after):.1f} when they ended. " if after else ". ")
            + ("It was quiet otherwise." if quiet else "It was not quiet: times may be long, ratios less so."),
        ]
    return lines


#: What groups of contenders are called.
_GROUP_WORDS = {"hand-best": "by hand in C, best method", "numpy-best": "best of SciPy with NumPy"}


def _summary(cases: Sequence[Compared]) -> list[str]:
    """What to take from the page first: time of a cycle, and what each peer takes at the loosest error compared."""
    labels = {key: c["label"] for case in cases for key, c in case.contenders.items()} | _GROUP_WORDS
    peers = [key for key in labels if not key.startswith(("stepper", "hand-", "simulate", "numpy-"))]
    own = [case.figure("stepper", LEVELS[0]) for case in cases]
    rows = [["**ballpass**, ms a cycle", *(f"**{milliseconds(one.time if one else None)}**" for one in own)]]
    for key in ("hand-best", *(key for key in peers if key not in GROUPS["numpy-best"]), "numpy-best"):
        ratios = [case.ratio(key, "stepper", LEVELS[0]) for case in cases]
        rows.append([labels[key], *("–" if r is None else f"{float(f'{r.value:.2g}'):g}×" for r in ratios)])
    return table(["", *(case.case["words"] for case in cases)], rows)


def _tolerances(cases: Sequence[Compared]) -> str:
    """Which tolerances were tried, by contenders that share them."""
    groups: dict[tuple[float, ...], list[str]] = {}
    for contender in cases[0].contenders.values():
        if "tolerances" in contender:
            groups.setdefault(tuple(contender["tolerances"]), []).append(contender["group"])
    texts = []
    ordered = sorted(groups.items(), key=lambda item: -len(item[0]))
    for k, (tried, names) in enumerate(ordered):
        who = "the others" if 0 < k == len(ordered) - 1 else ", ".join(dict.fromkeys(names))
        texts.append(f"{len(tried)} tolerances from {tried[0]:.0e} to {tried[-1]:.0e} ({who})")
    return " or ".join(texts)


def _conditions(cases: Sequence[Result]) -> dict[str, object]:
    """What all cases have in common, for the template."""
    rates: dict[str, float] = {}
    for case in cases:
        for name, value in case["rate_agreement"].items():
            rates[name] = max(value, rates.get(name, 0.0))
    agreement = max(case["reference"]["worst_agreement"] for case in cases)
    typical = max(case["reference"]["median_agreement"] for case in cases)
    return {
        "transient": cases[0]["transient_cycles"],
        "points": f"{cases[0]['points']:,}".replace(",", " "),
        "members": cases[0]["members"],
        "reference": " and ".join(cases[0]["reference"]["methods"]),
        "reference_tolerance": f"{cases[0]['reference']['tolerance']:.0e}",
        "agreement": f"{agreement:.0e}",
        "typical": f"{typical:.0e}",
        "longest": f"{cases[0]['effort']['longest']:g} s",
        "budget": f"{cases[0]['effort']['budget_of_figures']:g} s",
        "slow_budget": f"{cases[0]['effort']['budget_of_slow']:g} s",
        "tightest": written(LEVELS[-1]),
        "consequence": f"{100 * 0.5 * agreement / LEVELS[-1]:.2g} %",
        "rates": ", ".join(f"{name} within {value:.0e}" for name, value in rates.items()),
    }


def _case(case: Compared, images: Path) -> list[str]:
    words, key = case.case["words"], case.case["case"]
    curves: dict[str, figures.Curve] = dict(case.curves)
    curves["hand-best"] = lower([curves[one] for one in case.members_of("hand-best")])
    figures.work_precision(images / f"bench_{key}.png", words, curves)
    rows = []
    for one, contender in case.contenders.items():
        label = "stepper (auto)" if one == "stepper" else contender["label"]
        if "absent" in contender:
            rows.append([label, *(contender["absent"], *[""] * (2 * len(LEVELS)))])
            continue
        found = [case.figure(one, level) for level in LEVELS]
        cells = []
        for level, figure in zip(LEVELS, found, strict=True):
            ratio = case.ratio(one, "stepper", level)
            cells += [
                "–" if figure is None else with_spread(1e3 * figure.time, 1e3 * figure.low, 1e3 * figure.high),
                "–" if ratio is None else "1" if one == "stepper" else with_spread(ratio.value, ratio.low, ratio.high),
            ]
        rows.append([label, *cells, _rests_on(found)])
    head = ["ms a cycle at error", *(word for level in LEVELS for word in (written(level), "× stepper")), "sets"]
    lines = [
        f"### Damping {words}",
        "",
        f"![Time against error, damping {words}](images/bench_{key}.png)",
        "",
        "*In the figure a library stands for the best of its methods at every error; all that were measured are in the "
        "table.*",
        "",
        *table(head, rows),
        "",
    ]
    return lines + _faults(case) + _dashes(case)


def _rests_on(found: Sequence[Figure | None]) -> str:
    """Parameter sets and visits that a row's figures rest on; one number where it is one for all."""
    texts = [
        "–" if one is None else f"{one.members}" if one.visits >= one.members else f"{one.members}/{one.visits}"
        for one in found
    ]
    reached = {text for text in texts if text != "–"}
    return reached.pop() if len(reached) == 1 else " · ".join(texts)


def _dashes(case: Compared) -> list[str]:
    """Why a figure is not there."""
    found = []
    longest = case.case["effort"]["longest"]
    for key, contender in case.contenders.items():
        runs = measured(contender)
        missing = [level for level in LEVELS if case.figure(key, level) is None]
        if not missing or not runs:
            continue
        best, last = min(runs, key=error_of), contender["runs"][-1]
        ended = last["tolerance"] > contender["tolerances"][-1]
        found.append(
            f"- {contender['label']}: {' and '.join(written(level) for level in missing)} not reached; the smallest "
            f"median error was {error_of(best):.0e}, at a tolerance of {best['tolerance']:.0e}"
            + (f", behind which none was tried, for a run took more than {longest:g} s." if ended else ".")
        )
    return [*found, ""] if found else []


def _faults(case: Compared) -> list[str]:
    lines = []
    for c in case.contenders.values():
        faults = [(row["tolerance"], row["fault"]) for row in c.get("runs", ()) if "fault" in row]
        if faults:
            where = ", ".join(f"{tolerance:.0e}" for tolerance, _ in faults)
            lines.append(f"- {c['label']} failed at tolerance {where}: {faults[0][1]}")
    return [*lines, ""] if lines else []


if __name__ == "__main__":
    here = Path(__file__).resolve().parent
    write(here / "results", here.parent / "docs" / "benchmarks.md")
