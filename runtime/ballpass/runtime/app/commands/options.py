"""Options of the command line alone that several commands have; those of questions are in `contract.options`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.contract.options import Option
from ballpass.runtime.plot import FORMATS

SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", help="Scene file (TOML); `ballpass new` copies one.", show_default=False)
]

#: Of commands that need only the generated folder.
SceneOrFolder = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE",
        help="Scene file (TOML), which `ballpass new` copies, or a generated folder in its place.",
        show_default=False,
    ),
]

#: Of questions that also take a finished run.
SceneFolderOrRun = Annotated[
    Path,
    typer.Argument(
        metavar="SCENE",
        help="Scene file (TOML), which `ballpass new` copies, or the solution.nc of a run, or what ballpass stream "
        "wrote.",
        show_default=False,
    ),
]

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="PATH=VALUE",
        help='Another value for a number of the scene: `--set bearing.clearance="20 um"`. May be repeated.',
    ),
]

ResultsFolder = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Folder of the results; `results/<scene>` if not given.")
]

#: Of commands that write one file.
ResultsFile = Annotated[
    Path | None,
    typer.Option(metavar="PATH", help="File to write, or its folder; `results/<scene>` if not given."),
]

ReportFolder = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Folder for report and figures; none are written if not given.")
]

Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object on stdout, nothing else.")]

Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Draw the figures.")]

FigureFormats = Annotated[
    Sequence[str] | None,
    Option(
        words="Kind of the figures: `png` (default), `svg` or `pdf`. May be repeated.",
        shown="KIND",
        flags=("--format",),
        choices=FORMATS,
    ),
]

Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Run on the workers of this Dask scheduler: `tcp://192.168.0.10:8786`."),
]

Workers = Annotated[int | None, typer.Option(metavar="N", help="Run on N processes of a Dask cluster on this machine.")]
