"""Every number in the prose of README and documentation has a source.

A number has one if it stands, to its digits and in its unit, in a block or a table of its own page (blocks are run and
compared by `test_pages.py`, tables by the tests named in `TABLES`), or if `NAMED` says where it comes from: in a
sentence, as a file that contains it, or as a computation.  Decisions (`adr`) are left out: they are dated, and say what
was measured then.
"""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
from benchmarks import waviness

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [
    "README.md",
    *(
        path.relative_to(ROOT).as_posix()
        for path in (
            DOCS / "index.md",
            DOCS / "tutorial.md",
            *(
                page
                for part in ("readers", "howto", "theory", "reference", "validation")
                for page in sorted((DOCS / part).rglob("*.md"))
            ),
        )
        if "_numbers" not in path.name
    ),
]

#: Pages with tables of numbers, and what holds these.
TABLES = {
    "docs/index.md": "test_speeds_of_the_landing_page_are_those_of_the_benchmarks",
    "docs/howto/accuracy.md": "written by `python -m benchmarks.trade.promise`, a campaign of an hour",
    "docs/howto/damping.md": "test_damping_table.py",
    "docs/howto/data_sets.md": "written by `python -m benchmarks.data_sets`: times, which no test repeats",
    "docs/howto/install.md": "sizes of installations, which its script prints",
    "docs/howto/life.md": "test_life_table.py",
    "docs/howto/sensitivity.md": "test_sensitivity_table.py",
    "docs/howto/two_way.md": "test_coupling_table.py",
    "docs/theory/damping.md": "a definition",
    "docs/theory/rollers.md": "test_cylindrical_roller.py",
    "docs/validation/index.md": "test_validation.py",
    "docs/validation/lives.md": "test_five_degrees.py",
    "docs/reference/scene.md": "test_keys.py, which makes the page anew",
}

#: Numbers without a block: inputs, definitions, limits of the code.  By page, with the words around them.  Where the
#: reason is the name of a file, the file holds the numbers; where it begins with "=", it computes them from others of
#: the page.
NAMED: dict[str, dict[str, str]] = {
    "docs/howto/optimize.md": {
        "is least, 3685.164 N": "an independent program; test_optimize.py",
        "limits another quantity": "a statement",
        "a sweep of 33 values comes first": "`SWEPT` of questions/optimize.py",
    },
    "docs/howto/paper_figures.md": {
        "letters of 7 points": "`PAPER_SCALE` of plot/style.py",
    },
    "docs/howto/fit.md": {
        "its 95 % interval": "`CONFIDENCE` of fit/least_squares.py",
    },
    "docs/howto/sobol.md": {
        "are N (d + 2) members": "the base samples A and B, and one for each input",
        "between 0 and 1, and": "what a share is",
        "the interval is wider than 0.6": "`UNKNOWN` of questions/sobol.py",
    },
    "docs/howto/bifurcation.md": {
        "cage ratio of 3/8": "31.75 mm in the block: (1 - 7.9375/31.75)/2",
        "a 95 % interval by means of ten batches": "`BATCHES` and `CONFIDENCE` of motion/lyapunov.py",
        "repeats after n readings, up to 200": "`LONGEST` of motion/lyapunov.py",
        "at 10 µm with 3/8 −9.893456 ± 2e-6": "ADR 0032; test_bifurcation.py",
        "exact over 134 readings, and 268 give": "test_bifurcation.py",
        "at 40 µm 38 readings read 4.0 to 4.4": "ADR 0032",
        "larger denominator than 200": "`LONGEST` of motion/lyapunov.py",
        "and `periodic 134` is said from any number": "test_bifurcation.py",
        "ratio 409/1072) repeats after 134 turns only": "(1 - 7.9375/33.5)/2; test_steady.py",
        "In Fig. 7 of the paper": "the paper's figure",
        "`motion` is the name": "test_section.py",
        "`periodic 134` here": "test_section.py",
        "clearance of 40 µm the paper's press is chaotic: +4.2 a turn": "ADR 0032",
        "40 µm lies in a periodic window within": "test_bifurcation.py",
        "−0.297, and +1.6 at 39.9 µm": "ADR 0032",
        "at 30 µm with 3/8": "31.75 mm in the block",
        "chaotic for some 1650 turns": "ADR 0032",
        "ratio is 409/1072, has no short one; with 3/8, as above": "31.75 mm in the block; test_steady.py",
    },
    "docs/howto/steady.md": {
        "cage ratio of 409/1072, and repeats after 134 turns": "(1 - 7.9375/33.5)/2; test_steady.py",
        "All are smaller than 1 here": "the definition of stability",
        "passes −1, a": "a definition",
        "passes −1: above it": "a definition",
        'over `--over "bearing.clearance=10 um:20.2 um"`': "test_steady.py",
        "follow each other from 20.13 µm on": "20.12879 of test_steady.py",
        "at 20.2 µm is": "test_steady.py",
        "with a cage ratio of 3/8": "31.75 mm; test_steady.py",
        "move by 0.15 at most": "`MOVED` of motion/continuation.py",
        "where its 400 points are used up": "`POINTS` of motion/continuation.py",
        "10 to 25 µm it has used up its 400 points at 20.3 µm": "40 s of processor time, which no test repeats",
    },
    "docs/index.md": {
        "0.12 s with four": "the problem measured",
        "eight balls and 2 000 output points, at an error of 1e-3": "likewise",
        "takes 0.314 ms, and 873× as long": "test_speeds_of_the_landing_page_are_those_of_the_benchmarks",
    },
    "docs/tutorial.md": {
        "over 16 ball angles is 42 % lower, 15 %": "test_window_rise.py",
        "more than 200 MB are written": "a limit of the code",
        "stands out follows: 4200 MPa is": "STATIC_PRESSURE",
        "of 100 turns": "a number of docs/make_figures.py",
        "of 101 turns": "likewise",
        "ball pass, 25.44 Hz, from the third harmonic, 25 Hz": "test_frequencies_of_the_tutorial_are_those_of_its_cage",
    },
    "docs/howto/accuracy.md": {
        "estimate times 1.5 is within": "a number of the method",
        "at least 99 % keep their target, at most 1 %": "test_promises_hold_in_the_table_of_the_campaign",
        "and 50 ms": "test_promises_hold_in_the_table_of_the_campaign",
        "(every number within 0.5 %)": "a number of the campaign",
        "3 to 12 turns after the transient": "a number of the campaign",
        '"1 % on peak_ball_force: ... ms a cycle (stepper-rodas4, rtol 0.01)"': "the form of a sentence",
    },
    "docs/validation/cage_lag.md": {
        "8 balls of 0.235 in on 1.245 in": "cage_lag.py",
        "it stands 15 times above": "cage_lag.py",
        "0.988 to 0.990": "the table",
        "offset of up to 1.1 %": "slip at 25 Hz less that of a shaft at 0.989: 1 - 0.989",
    },
    "docs/validation/classifier.md": {
        "of 0.3, 0.7 and 1.5 m/s²": "BACKGROUNDS of classifier.py",
        "recording has 0.7 m/s²": "rms of file 97, 0.073 g",
        "with 500 trees": "classifier.py",
        "of 2 to 5 kHz": "BAND of scripts/validation/lines.py",
        "(outer, 0.014 in)": "the recordings",
        "(inner, 0.028 in)": "the recordings",
        "All 190 seconds": "120 outer and 40 inner of 0.021 in, 30 at 12 o'clock; the table has no other mistakes",
        "spalls of 0.021 in": "the recordings",
        "at 12 o'clock": "the recordings",
        "recording, of 5 s": "243 938 samples at 48 kHz",
        "at 48 kHz": "the recordings",
    },
    "docs/validation/lives.md": {
        "7 balls of 11.5 mm on 43.5 mm, grooves of 0.52 and 0.53 of the ball, 210 GPa": "the scene",
        "= 23.4 kN, 1000 N, no": "the scene",
        "prints 15.1101 µm and 13163.019 million": "the program's output",
        "ours are 7e-6 and 2e-5 away": "15.1102041/15.1101 - 1, 1 - 13162.7717/13163.019",
        "program has 12769.7 for": "an independent program",
        "agree within 3e-5 and": "test_five_degrees.py",
        "lives within 5e-5": "1630.6106/1630.5367 - 1 is 4.5e-5",
        "(8 balls of 7.92 mm on 34.55 mm,": "xjtu_uer204.toml",
        "12 820 N,": "the maker's rating",
        "6650 N)": "the maker's rating",
        "Reliability 69, 2020)": "a source",
        "κ = 1 and": "the scene",
        "= 0.5: the tests": "the scene",
        "holds up to 0.5, and": "LARGEST_LOAD of life/limits.py",
        "beyond 4200 MPa": "STATIC_PRESSURE",
    },
    "docs/validation/load_zone.md": {
        "drive end, 12 kHz, an outer spall of 0.007 in at 6": "the recordings",
        "brought to 12 kHz": "RATE of load_zone.py",
        "kurtosis of 1.5 times": "test_kurtosis_of_a_resonance_is_one_and_a_half_decays_between_hits",
        "within 11 % in the recordings and within 1 %": "8.66/7.85 - 1, 9.51/9.47 - 1; test_validation.py",
        "in the recordings differs by a factor of 2 and more": "test_validation.py: 12 below half of 6",
        "all within 3 %": "9.74/9.47 - 1",
        "between 200 and 300 N s/m": "the table",
    },
    "docs/validation/machines.md": {
        "agree within 1e-9 of": "`TOLERANCE` of tests/conformance/machine_states.py",
    },
    "docs/validation/motions.md": {
        "tolerance of 1e-12 and": "`write` of scripts/validation/motions.py; test_driven_crank.py",
        "20 kg, 196 N, no clearance": "the scene",
        "energy over 10 s": "the scene",
        "program at 1e-11": "its tolerance",
    },
    "docs/validation/spall_lines.md": {
        "drive end, 12 kHz": "the recordings",
        "9 balls of 0.3126 in on 1.537 in": "spall_lines.py",
        "squared envelope of 2 to 5 kHz": "BAND of scripts/validation/lines.py",
        "up to 0.08 % below": "column `shaft` of scripts/validation/cwru_lines.csv",
        "no other to 0.1 %": "0.210 % is more",
        "circle that is 1.4 % larger": "1/cos(9.45 deg) - 1",
    },
    "docs/theory/contact_angle.md": {
        "angular contact bearing at 15 to 40": "catalogues",
        "for deep groove bearings": "ISO/TR 1281-1, 7.2, as in `life.axial_factors`",
        "for angular contact 1.25 and": "likewise",
        "up to 15°, else": "likewise; 17.5° between the table's rows",
        "Below 10° a": "ANGULAR_CONTACT of life/wear.py",
        "Table 3 of ISO 281": "the standard",
        "(ISO/TR 1281-1, 7.2):": "the standard",
    },
    "docs/howto/fmu.md": {"co-simulation by FMI 3,": "the standard's version"},
    "docs/howto/animate.md": {
        "about 260 kB": "a size",
        "up to 1000 a turn": "a limit of the code",
        "from 0 to the highest": "a scale",
    },
    "docs/howto/explore.md": {"browsers from 2023 on": "when the last of them learned to unpack gzip"},
    "docs/howto/install.md": {
        "x86-64, Python 3.11": "the machine",
        "CasADi is 290 MB": "measured by scripts/sizes.py",
        "exit code 2": "a definition",
    },
    "docs/howto/bearing_only.md": {
        "a rotor of 5 kg in a 6204, with 5 g at 20 mm from its axis": "numbers of the scene"
    },
    "docs/howto/ensembles.md": {"up to 3e-7 (single runs: 1e-6)": "locating.py"},
    "docs/reference/quantities.md": {"up to 3e-7 a step": "reductions.h"},
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
        "take 12 % off": "= 100 - 100 * 307 / 348",
        "moves the life by 9 %": "= 100 * 249.3 / 228.8 - 100",
        "costs 10 %": "= 100 - 100 * 226.1 / 251.4",
        "59 % less": "= 100 - 100 * 98.99 / 242.3",
        "1 % of its radius is a quarter of the 4 %": "geometry",
        "9.9 kg for each bearing and not 0.41 kg": "blocks of two_way.md",
    },
    "docs/howto/jax.md": {
        "good to 1e-4 of their size at": "test_derivatives_over_turns.py",
        "the default `rtol` of 1e-9": "a default",
        "differences up to 5.5 turns": "test_derivatives_over_turns.py",
    },
    "docs/howto/linearize.md": {"(exit code 1)": "a definition"},
    "docs/howto/sensitivity.md": {
        "at a tolerance of 1e-11": "a number of the method",
        "whose value is 0": "a definition",
        "(verified: ~0)": "a definition",
    },
    "docs/howto/two_way.md": {
        "13 to 28 % low": "= 100 - 100 * 5575 / 6436, 100 - 100 * 3517 / 4856",
    },
    "docs/theory/bearing.md": {
        "(0.5 in the paper": "punching_press.toml",
        '$s$ is 1 for `crank = "whole"`': "a definition",
    },
    "docs/theory/coupling.md": {"ball 1 stands at": "a definition"},
    "docs/theory/drive.md": {"5 (1916) 59–87": "literature"},
    "docs/theory/effects.md": {
        "a bearing of 8 balls": "varying_compliance.toml",
        "25.588 µm and 41.406 µm": "test_spalls.py",
        "a chord of 1 mm in a 6204": "what test_spalls.py measures",
        "a rotor with 8 balls": "the 6204 of rotor.toml",
        waviness.sentence(
            json.loads(waviness.RESULTS.read_text(encoding="utf-8"))
        ): "measured; test_benchmarks_page.py",
    },
    "docs/theory/errata.md": {
        "bottom dead centre is at 270°, the window ends 3° before it": "geometry",
        "With a crank of 6 mm on a rod of 100 mm": "punching_press.toml",
        "stays within 3.5°": "the arc sine behind it",
        "in N/m^1.5": "a unit",
        "s·m^0.5": "a unit",
        "a rod of 2.55 kg and 100 mm": "punching_press.toml",
        "a crank of 0.3567 kg and 6 mm": "punching_press.toml",
        "of 54 mm and 41 mm": "test_radii_of_gyration_of_the_errata_follow_from_the_scene",
        "obtained using [4]": "a quotation",
    },
    "docs/theory/hertz.md": {
        "5th ed., 2006": "literature",
        "The 4200 MPa of ISO 76": "a limit of the standard",
        "(Abramowitz & Stegun 17.6)": "literature",
    },
    "docs/theory/integration.md": {
        "else 0.": "a definition",
        "at 237° and 267°": "punching_press.toml",
        "in 50 digits": "PRECISION of test_tableaus.py",
        "(below 1/16": "trig.h",
        "limited to between 0.1 and 0.9": "step_size.h",
        "within 0.01 % of": "a factor of 1.0001 in lane_control.h",
        "of order 7 with four": "a property of the method",
        "at 1.00 without damping and at 2.68 for a damping ratio of 0.1": "methods/dp54.py",
        "below 1.7 times": "control.h",
        "below 1.25 times": "control.h",
        "below 0.35 the run changes": "control.h",
        "above 1.2 it": "control.h",
        "for 64 steps": "kinks.h",
        "from 0 to 1": "a definition",
        "*SIAM J. Numer. Anal.* 35, 1998": "literature",
    },
    "docs/theory/rollers.md": {
        "both agree with Koyo to 0.2 %": "test_cylindrical_roller.py",
        "FWF-202617-E of a connecting rod": "NSK, CAT. No. E1102e; test_cylindrical_roller.py",
        "21200 N), if it has 14 needles": "test_cylindrical_roller.py",
        "20 mm,": "test_cylindrical_roller.py",
        "26 mm,": "test_cylindrical_roller.py",
        "16800 N,": "test_cylindrical_roller.py",
        "within 1 % of the printed one": "test_cylindrical_roller.py",
        "is 2 to 3 % lower for NU204": "= 100 - 100 * 25100 / 25719, 100 - 100 * 29700 / 30593",
    },
    "docs/theory/life.md": {
        "by 0.4 of the sum": "ratings/tolerances.py",
        "DIN 7190-1:2017": "ratings/tolerances.py",
        "editions say 0.8": "ratings/tolerances.py",
        "has 4200 MPa in": "a limit of the standard",
        "a peak pressure above 4200 MPa": "a limit of the standard",
        "above 500 000 mm/min": "a limit of the catalogues, in other units in life/limits.py",
        "207 GPa, 0.3)": "numbers of the standard",
        "SKF's C is 5 % higher for the same balls: 16 % of life": "a comparison of catalogues",
        "with 1.044 in": "a number of the standard",
        "2461.8 million turns": "test_ratings.py",
        "lasts 389 million turns": "test_ratings.py",
        "and 348 by sectors": "test_ratings.py",
        "12 % unsafe": "= 100 * 389 / 348 - 100",
        "lives 8 and 12 % too long": "ADR 0021",
        "at 72 places": "reduction_rows.py",
        "41 across it": "life/wear.py",
        "as many as 64 steady turns have": "life/wear.py",
        "of 76 of the 77 bearings within 2 %": "all but those of MISSED in test_designations.py",
        "2.01 % lower": "the one of MISSED in test_designations.py",
        "Koyo's of 67": "test_designations.py",
    },
    "docs/theory/linkage.md": {"(16 times the squared area": "Heron"},
    "docs/theory/reactions.md": {"8×8 matrix": "Eq. (1)", "is 8×8 and not 9×9": "Eq. (1)"},
    "docs/theory/sensitivities.md": {
        "By default `rtol` is 1e-11 and": "contract/defaults.py",
        "at a tolerance of 1e-11": "contract/defaults.py",
        "moving speed and start by 1e-7": "sensitivity_query.py",
        "(1e-3 of the derivative, plus 1e-5": "certificate.py",
        "exceeds 1e-3 of the derivative": "certificate.py",
        "to within 1e-5": "certificate.py",
        "called ~0": "a definition",
        "300 pairs on five scenes": "certificates.py",
        "5 to 3000 rpm": "certificates.py",
        "1e-4 of the largest deflection": "grazing.py",
        "below about 1e-9": "an observation, which a status of the run repeats",
    },
    "docs/reference/cli/run.md": {
        "up to 1e-6, and at any": "locating.py",
        "up to 3e-7, and 1e-6 where": "locating.py",
        "by more than 0.1 %": "report/digits.py",
        "up to 64 steady turns or 100 000 steps": "settle.py",
        "from 64 on": "settle.py",
        "At 4096 turns": "repetition.py",
        "miss by more than 5 % of the range": "settle.py",
        "by more than 0.5 % of its range and no rms by more than 1 %": "settle.py",
    },
    "docs/reference/cli/life.md": {
        "from 64 steady ones on": "settle.py",
        "where 4096 are": "repetition.py",
        "by more than 1 % and no highest ball force by more than 0.5 %": "settle.py",
    },
    "docs/reference/outputs.md": {
        "additional turns: 100, or up to 400": "characteristic.py",
        "after 20 that are": "figure_run.py",
        "more than 300 000 steps": "figure_run.py",
    },
    "docs/reference/python.md": {
        "ten seconds at 51.2 kHz": "an example",
        "by more than 0.5 % of its range and no rms by more than 1 %": "settle.py",
    },
    "docs/reference/scene/fit.md": {
        "Diameters above 3 mm to 180 mm": "ratings/tolerances.py",
        "to 120 mm,": "ratings/tolerances.py",
        "from above 6 mm": "ratings/tolerances.py",
    },
    "docs/reference/scene/friction.md": {"has 76 % of its amount": "tanh 1"},
    "docs/reference/scene/index.md": {"at most 64 characters": "table.py"},
    "docs/reference/scene/run.md": {"which are 50 where": "read_tables.py"},
    "docs/reference/scene/shaft.md": {"at most 1000 rows": "file_columns.py"},
    "docs/reference/scene/stops.md": {"turned by 180°": "geometry"},
}

FENCE = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
#: What is no result: code, exit codes, formulas, links, names of equations, figures, standards, bearings and versions,
#: literature.
APART = re.compile(
    r"`[^`]*`|\$\$.*?\$\$|\$[^$]*\$|\]\([^)]*\)|Eqs?\. [\d.]+(?:, [\d.]+)*|\(\d+\)|Fig\. \d+|items? \d+(?: and \d+)?"
    r"|ISO(?:/TR)? [\d-]+|\b6\d\d\d\b|6[\d/]+ to 6[\d/]+|Python 3\.\d+|FM[IU] \d\.\d|UTF-8|NetCDF-4|ADR \d+|C99|t = 0\b"
    r"|[Ee]xit code (?:is )?[012]\b|doi:[\d./S-]*\d|(?<=[a-z.*,] )(?:1[89]|20)\d\d(?=[,;)])"
)
#: Powers of ten between SI and the units of prose.
SCALES = {"%": 2, "mm": 3, "µm": 6, "ms": 3, "kN": -3, "MPa": -6, "kHz": -3, "million": -6, "N/µm": -6}
NUMBER = re.compile(r"(?<![\w.])\d+(?: \d{3})*(?:\.\d+)?(?:e-?\d+)?")
SOURCES = ("scripts", "derive", "runtime", "scenes", "tests")
SOURCE_NUMBER = re.compile(r"(?<![\w.])\d[\d_]*(?:\.\d+)?(?:e-?\d+)?")


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


def in_prose(text: str) -> list[float]:
    return [float(number.replace(" ", "")) for number in NUMBER.findall(text)]


def has_a_source(number: str, behind: str, known: list[float]) -> bool:
    """Whether one of the known values, as it is or in the unit behind the number, is the number to its digits."""
    number = number.replace(" ", "")
    digits = len(number.partition("e")[0].replace(".", "").strip("0")) or 1
    unit = re.match(r"\s*([%\wµ/]+)", behind)
    powers = {0, SCALES.get(unit[1], 0) if unit else 0}
    return any(f"{v * 10.0**p:.{digits - 1}e}" == f"{float(number):.{digits - 1}e}" for v in known for p in powers)


def numbers_of_file(name: str) -> list[float]:
    """Numbers of a source file or scene, and negative ones without their sign."""
    (path,) = (path for folder in SOURCES for path in (ROOT / folder).rglob(name))
    return [float(n.replace("_", "")) for n in SOURCE_NUMBER.findall(path.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("page", PAGES)
def test_numbers_of_prose_have_a_source(page: str) -> None:
    text = text_of(page)
    known = sources(text)
    named = NAMED.get(page, {})
    lines = [
        line
        for line in FENCE.sub("", (ROOT / page).read_text(encoding="utf-8")).splitlines()
        if not line.startswith(("|", "<!--", "#"))
    ]
    prose = " ".join(" ".join(re.sub(r"^ *\d+\. ", "", line) for line in lines).split())
    whole = in_prose(prose)
    for words, reason in named.items():
        assert words in prose, f"{page} no longer says: {words}"
        prose = prose.replace(words, "")
        apart = APART.sub(" ", words)
        if reason.startswith("= "):
            assert {float(number) for number in NUMBER.findall(reason)} <= {100.0, *known, *whole}
            values = [eval(term) for term in reason.removeprefix("= ").split(", ")]
        elif re.fullmatch(r"[\w/]+\.\w+", reason):
            values = numbers_of_file(reason)
        else:
            continue
        for found in NUMBER.finditer(apart):
            there = has_a_source(found[0], apart[found.end() :], values)
            assert there, f"{page}: {reason} does not give {found[0]}"
    for found in NUMBER.finditer(prose := APART.sub(" ", prose)):
        near = prose[max(found.start() - 60, 0) : found.end() + 60]
        assert has_a_source(found[0], prose[found.end() :], known), f"{page}: where does {found[0]} come from?\n{near}"


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
    rows = [row for row in rows if row[1].endswith("%")]  # the second table
    assert len(rows) == 5
    for _, within, _, understated, worst, _ in rows:
        often, never = understated.split(", ")
        assert float(within.removesuffix(" %")) >= 99.0
        assert float(often.removesuffix(" %")) <= 1.0
        assert int(never) == 0
        assert float(worst) < 100.0


def test_radii_of_gyration_of_the_errata_follow_from_the_scene() -> None:
    bodies = tomllib.loads((ROOT / "scenes/punching_press.toml").read_text(encoding="utf-8"))["mechanism"]["bodies"]
    rod, crank = (
        (float(body["inertia"].split()[0]) / float(body["mass"].split()[0])) ** 0.5
        for body in (bodies["rod"], bodies["crank"])
    )
    assert (round(rod), round(crank)) == (54, 41)


def test_frequencies_of_the_tutorial_are_those_of_its_cage() -> None:
    turns = 500 / 60
    assert f"{8 * turns * (1 - 7.9375 / 33.5) / 2:.2f} Hz" == "25.44 Hz"
    assert 3 * turns == pytest.approx(25.0)
