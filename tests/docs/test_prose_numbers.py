"""Every number in the prose of README, tutorial, how-to and readers' pages has a source.

A number has one if it stands, to its digits, in a block or a table of its own page (blocks are run and compared by
`test_pages.py`, tables by the tests named in `TABLES`), or if `NAMED` says where it comes from.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [
    "README.md",
    *(
        path.relative_to(ROOT).as_posix()
        for path in (
            DOCS / "index.md",
            DOCS / "tutorial.md",
            *sorted(DOCS.glob("readers/*.md")),
            *DOCS.glob("howto/*.md"),
        )
        if "_numbers" not in path.name
    ),
]

#: Pages with tables of numbers, and what holds these.
TABLES = {
    "docs/index.md": "test_speeds_of_the_landing_page_are_those_of_the_benchmarks",
    "docs/howto/accuracy.md": "written by `python -m trade.promise`, a campaign of an hour",
    "docs/howto/damping.md": "test_damping_table.py",
    "docs/howto/data_sets.md": "written by `python -m benchmarks.data_sets`: times, which no test repeats",
    "docs/howto/install.md": "sizes of installations, which its script prints",
    "docs/howto/life.md": "test_life_table.py",
    "docs/howto/sensitivity.md": "test_sensitivity_table.py",
    "docs/howto/two_way.md": "test_coupling_table.py",
}

#: Numbers without a block: inputs, definitions, limits of the code.  By page, with the words around them.
NAMED: dict[str, dict[str, str]] = {
    "docs/index.md": {
        "0.12 s with four": "the problem measured",
        "eight balls and 2 000 output points, at an error of 1e-3": "likewise",
        "takes 0.263 ms, and 901× as long": "test_speeds_of_the_landing_page_are_those_of_the_benchmarks",
    },
    "docs/tutorial.md": {
        "more than 200 MB are written": "a limit of the code",
        "of 100 turns": "a number of docs/make_figures.py",
        "of 101 turns": "likewise",
        "ball pass, 25.44 Hz, from the third harmonic, 25 Hz": "test_frequencies_of_the_tutorial_are_those_of_its_cage",
    },
    "docs/howto/accuracy.md": {
        "estimate times 1.5 is within": "a number of the method",
        "at least 99 % keep their target, at most 1 %": "test_promises_hold_in_the_table_of_the_campaign",
        "and 50 ms": "test_promises_hold_in_the_table_of_the_campaign",
        "(every number within 0.5 %)": "a number of the campaign",
        "3 to 12 turns behind the transient": "a number of the campaign",
        '"1 % on peak_ball_force: ... ms a cycle (stepper-rodas4, rtol 0.01)"': "the form of a sentence",
    },
    "docs/howto/fmu.md": {"co-simulation by FMI 3,": "the standard's version"},
    "docs/howto/animate.md": {
        "about 260 kB": "a size",
        "up to 1000 a turn": "a limit of the code",
        "from 0 to the highest": "a scale",
    },
    "docs/howto/install.md": {
        "x86-64, Python 3.11": "the machine",
        "CasADi is 290 MB": "scripts/sizes.py",
        "exit code 2": "a definition",
    },
    "docs/howto/bearing_only.md": {
        "a rotor of 5 kg in a 6204, with 5 g at 20 mm from its axis": "numbers of the scene"
    },
    "docs/howto/data_sets.md": {
        "above 95 %": "tests/test_cli_dataset.py, which the page names",
        "(`rtol` from 1e-6 on)": "a limit of the code",
    },
    "docs/howto/export.md": {
        "Exit codes: 0 done; 1 the computation failed": "definitions",
        "2 the request was wrong": "a definition",
        "counted from 1": "a definition",
        "more than 4 GiB": "a limit of the code",
    },
    "docs/howto/find_spall.md": {"2 BSF by": "the name of a line"},
    "docs/howto/life.md": {
        "17 runs of 64 steady turns": "what the command runs",
        "the 4200 MPa of ISO 76": "a limit of the standard",
        "take 12 to 15 % off": "test_life_table.py",
        "8 % unsafe": "test_life_table.py",
        "moves the life by 9 %": "test_life_table.py",
        "costs 10 %": "test_life_table.py",
        "59 % less": "test_life_table.py",
        "1 % of its radius is a quarter of the 4 %": "geometry",
        "9.9 kg for each bearing and not 0.41 kg": "blocks of two_way.md",
    },
    "docs/howto/linearize.md": {"(exit code 1)": "a definition"},
    "docs/howto/sensitivity.md": {
        "at a tolerance of 1e-11": "a number of the method",
        "whose value is 0": "a definition",
        "(verified: ~0)": "a definition",
    },
    "docs/howto/two_way.md": {
        "13 to 28 % low": "test_coupling_table.py",
        "Eq. (3)": "an equation",
    },
}

FENCE = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
#: What is no result: code, formulas, links, names of equations, figures, standards, bearings and versions.
APART = re.compile(
    r"`[^`]*`|\$[^$]*\$|\]\([^)]*\)|Eqs?\. \([^)]*\)|Fig\. \d+|item \d+|ISO [\d-]+|\b6\d\d\d\b|Python 3\.\d+|FMI \d\.\d"
)
NUMBER = re.compile(r"(?<![\w.])\d+(?: \d{3})*(?:\.\d+)?(?:e-?\d+)?")


def text_of(page: str) -> str:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.sub(
        r"^```\{include\} (\S+)\n```$",
        lambda found: ((ROOT / page).parent / found[1]).read_text(encoding="utf-8"),
        text,
        flags=re.MULTILINE,
    )


def sources(text: str) -> list[float]:
    """Numbers of the blocks and tables of a page."""
    rows = "\n".join(line for line in text.splitlines() if line.startswith("|"))
    found = NUMBER.findall("\n".join(FENCE.findall(text)) + rows)
    return [float(number.replace(" ", "")) for number in found]


def rounds_to(value: float, number: str) -> bool:
    """Whether a value is the number to the digits it has, also in per cent, thousandths or millionths."""
    number = number.replace(" ", "")
    digits = len(number.partition("e")[0].replace(".", "").strip("0")) or 1
    scaled = (value * 10.0**power for power in (0, -6, -3, -2, 2, 3, 6))
    return any(f"{each:.{digits - 1}e}" == f"{float(number):.{digits - 1}e}" for each in scaled)


@pytest.mark.parametrize("page", PAGES)
def test_numbers_of_prose_have_a_source(page: str) -> None:
    known = sources(text_of(page))
    named = NAMED.get(page, {})
    lines = [
        line
        for line in FENCE.sub("", (ROOT / page).read_text(encoding="utf-8")).splitlines()
        if not line.startswith(("|", "<!--", "#"))
    ]
    prose = " ".join(" ".join(re.sub(r"^ *\d+\. ", "", line) for line in lines).split())
    for words in named:
        assert words in prose, f"{page} no longer says: {words}"
        prose = prose.replace(words, "")
    for found in NUMBER.finditer(prose := APART.sub(" ", prose)):
        near = prose[max(found.start() - 60, 0) : found.end() + 60]
        assert any(rounds_to(value, found[0]) for value in known), f"{page}: where does {found[0]} come from?\n{near}"


def test_tables_of_numbers_are_held_by_a_test_or_say_why_not() -> None:
    for page in PAGES:
        rows = [line for line in text_of(page).splitlines() if re.match(r"\|.*\| [+-]?\d[\d. ]*[×%]? \|", line)]
        assert not rows or page in TABLES, f"{page}: who holds {rows[0]}?"


def test_speeds_of_the_landing_page_are_those_of_the_benchmarks() -> None:
    measured = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    landing = (DOCS / "index.md").read_text(encoding="utf-8")
    speeds = landing.partition("## How fast")[2].partition("## ")[0]
    rows = [line for line in speeds.splitlines() if line.startswith("|")]
    assert len(rows) > 5
    for row in rows:
        assert row in measured
    for words in re.findall(r"commit\s+`(\w+)`|(\S+)×\s+as long|takes (\S+) ms", speeds):
        assert "".join(words) in measured


def test_promises_hold_in_the_table_of_the_campaign() -> None:
    page = (DOCS / "howto" / "accuracy_numbers.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if ", far |" in line]
    assert len(rows) == 5
    for _, _, _, _, _, within, _, understated, worst, _ in rows:
        often, never = understated.split(", ")
        assert float(within.removesuffix(" %")) >= 99.0
        assert float(often.removesuffix(" %")) <= 1.0
        assert int(never) == 0
        assert float(worst) < 100.0


def test_frequencies_of_the_tutorial_are_those_of_its_cage() -> None:
    turns = 500 / 60
    assert f"{8 * turns * (1 - 7.9375 / 33.5) / 2:.2f} Hz" == "25.44 Hz"
    assert 3 * turns == pytest.approx(25.0)
