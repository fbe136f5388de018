"""Options of the command line alone that several commands have; those of questions are in `contract.options`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Option
from ballpass.runtime.plot import FORMATS


def paper_width(text: str) -> float:
    """A width [m] from a text: 90mm, 9 cm, 3.5in; RequestError for another."""
    number, unit = text.strip()[:-2], text.strip()[-2:]
    try:
        width = float(number) * {"mm": 1e-3, "cm": 1e-2, "in": 25.4e-3}[unit]
    except (KeyError, ValueError):
        width = 0.0
    if not 0.05 <= width <= 0.5:
        raise RequestError(f"{text!r} is not a width of a figure. Allowed: 50mm to 500mm, as 90mm, 9cm or 3.5in.")
    return width


SceneFile = Annotated[
    Path, Option(shown="SCENE", words="Scene file (TOML); `ballpass new` copies one.", positional=True)
]

#: Of commands that need only the generated folder.
SceneOrFolder = Annotated[
    Path,
    Option(
        shown="SCENE",
        words="Scene file (TOML), which `ballpass new` copies, or a generated folder in its place.",
        positional=True,
    ),
]

#: Of questions that also take a finished run.
SceneFolderOrRun = Annotated[
    Path,
    Option(
        shown="SCENE",
        words="Scene file (TOML), which `ballpass new` copies, or the solution.nc of a run, or what ballpass stream "
        "wrote.",
        positional=True,
    ),
]

Settings = Annotated[
    Sequence[str] | None,
    Option(
        shown="PATH=VALUE",
        words="Another value for a number of the scene, may be repeated.",
        example='bearing.clearance="20 um"',
    ),
]

ResultsFolder = Annotated[
    Path | None, Option(shown="DIR", words="Folder of the results; `results/<scene>` if not given.")
]

#: Of commands that write one file.
ResultsFile = Annotated[
    Path | None,
    Option(shown="PATH", words="File to write, or its folder; `results/<scene>` if not given."),
]

ReportFolder = Annotated[
    Path | None, Option(shown="DIR", words="Folder for report and figures; none are written if not given.")
]

Json = Annotated[bool, Option(words="Print the result as one JSON object on stdout, nothing else.")]

Figures = Annotated[bool, Option(words="Draw the figures.", flags=("--figures/--no-figures",))]

FigureFormats = Annotated[
    Sequence[str] | None,
    Option(
        words="Kind of the figures: `png` (default), `svg` or `pdf`. May be repeated.",
        shown="KIND",
        flags=("--format",),
        choices=FORMATS,
    ),
]

FigureWidth = Annotated[
    float | None,
    Option(
        shown="WIDTH",
        words="Width of the figures in a paper, `90mm`: letters have 7 points in it. They are 8 inches wide without.",
        flags=("--width",),
        reader=paper_width,
    ),
]

FigureTitles = Annotated[
    bool, Option(words="Draw the titles of the figures. Captions have them too.", flags=("--title/--no-title",))
]

Scheduler = Annotated[
    str | None,
    Option(shown="ADDRESS", words="Run on the workers of this Dask scheduler: `tcp://192.168.0.10:8786`."),
]

Workers = Annotated[int | None, Option(shown="N", words="Run on N processes of a Dask cluster on this machine.")]
