"""The command line: ``raceway run | derive | equations``.

The one module that knows both halves; it imports `raceway.derive` where a command needs it.  Messages and progress
go to
stderr, results to stdout.  Exit codes: 0 done, 1 the computation failed, 2 the request was wrong.
"""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from raceway.runtime.errors import RacewayError

if TYPE_CHECKING:
    from raceway.derive import Scene
    from raceway.runtime.model import Model
    from raceway.runtime.solution import Solution

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Planar mechanisms and the ball bearings they load: equations, generated code, simulation.",
)
_err = Console(stderr=True)

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).", show_default=False)]


@contextmanager
def _reported() -> Iterator[None]:
    """Turn the errors raised on purpose into a message and an exit code; everything else is a defect and shows
    itself."""
    try:
        yield
    except RacewayError as error:
        _err.print(f"[bold red]error[/]: {escape(str(error))}", soft_wrap=True, highlight=False)
        raise typer.Exit(2 if isinstance(error, ValueError) else 1) from None
    except OSError as error:
        where = f" {error.filename!r}" if error.filename else ""
        _err.print(
            f"[bold red]error[/]: cannot read or write{where}: {error.strerror}. Check the path, its permissions and the free space.",
            soft_wrap=True,
            highlight=False,
        )
        raise typer.Exit(2) from None


def _warn(message: Warning | str, *_: Any) -> None:
    _err.print(f"[bold yellow]warning[/]: {escape(str(message))}", soft_wrap=True, highlight=False)


@contextmanager
def _warnings_shown() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.showwarning = _warn
        yield


class _Stages:
    """Progress on stderr: a line for each finished stage, a bar for the running simulation."""

    def __init__(self) -> None:
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description:<12}"),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            console=_err,
            transient=False,
        )
        self._task: Any = None

    def __enter__(self) -> _Stages:
        self._progress.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        if error[0] is None:
            self._finish()
        self._progress.__exit__(*error)

    def _finish(self) -> None:
        if self._task is not None:
            self._progress.update(self._task, total=1.0, completed=1.0)

    def __call__(self, name: str) -> None:
        self._finish()
        self._task = self._progress.add_task(name, total=None)

    def fraction(self, done: float) -> None:
        self._progress.update(self._task, total=1.0, completed=done)


@app.command()
def run(
    scene: SceneFile,
    cycles: Annotated[float | None, typer.Option(help="Turns of the driver or shaft.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help='Parameter: bearing.clearance="20 um".')
    ] = None,
    rtol: Annotated[float | None, typer.Option(help="Relative tolerance of the integrator.")] = None,
    method: Annotated[str | None, typer.Option(help="auto, erk, rosenbrock or cvodes.")] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Results; default results/<scene>.")] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print the summary as JSON on stdout, nothing else.")] = False,
    figures: Annotated[bool, typer.Option(help="Draw the figures.")] = True,
) -> None:
    """Simulate a scene: derive and compile what is stale, run, write solution, summary and figures."""
    with _reported(), _warnings_shown(), _Stages() as stages:
        stages("read")
        read, overrides = _read(scene, set_ or [])
        model = _model(read, stages)
        stages("simulate")
        solution = model.simulate(
            cycles=cycles, parameters=overrides, method=method, rtol=rtol, progress=stages.fraction
        )
        stages("write")
        folder = out if out is not None else Path("results") / read.name
        summary = _write_results(model, solution, folder, figures=figures)
    from raceway.runtime.summary import render_summary

    if json_:
        typer.echo(json.dumps(summary, indent=2, allow_nan=False))
    else:
        console = Console()
        console.print(render_summary(summary))
        console.print(f"results in {folder}", highlight=False)


@app.command()
def derive(
    scene: SceneFile,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder; default generated/<scene>.")] = None,
    check: Annotated[bool, typer.Option("--check", help="Write nothing; exit 1 where the folder is stale.")] = False,
) -> None:
    """Derive a scene and write its generated folder."""
    from raceway import derive as deriving

    with _reported(), _Stages() as stages:
        if check:
            stages("check")
            result = deriving.check(scene, out)
            if result.stale:
                names = ", ".join(result.stale)
                raise typer.Exit(_fail(f"{result.folder} is stale: {names}. Run: raceway derive {scene}"))
            message = f"{result.folder} is up to date"
        else:
            message = str(deriving.generate(scene, out, progress=stages))
    typer.echo(message)


@app.command()
def equations(scene: SceneFile) -> None:
    """Print the derived equations of a scene as Markdown with LaTeX."""
    from raceway import derive as deriving

    with _reported():
        typer.echo(deriving.equations(deriving.derive(deriving.read_scene(scene))), nl=False)


def _fail(message: str) -> int:
    _err.print(f"[bold red]error[/]: {escape(message)}", soft_wrap=True, highlight=False)
    return 1


def _read(path: Path, settings: list[str]) -> tuple[Scene, dict[str, float]]:
    """The scene, and the overrides in SI; overrides are checked as if they stood in the file."""
    from raceway.derive import read_scene
    from raceway.derive.read import parse_override, with_values

    read = read_scene(path)
    overrides = dict(parse_override(read, text) for text in settings)
    with_values(read, overrides)
    return read, overrides


def _model(scene: Scene, stages: _Stages) -> Model:
    from raceway.derive import generate
    from raceway.runtime.model import load

    folder = generate(scene, progress=stages)
    stages("compile")
    return load(folder)


def _write_results(model: Model, solution: Solution, folder: Path, *, figures: bool) -> dict[str, Any]:
    """Write into a folder beside the target and move file by file: what is there is whole."""
    from raceway.runtime.summary import summarize

    folder.mkdir(parents=True, exist_ok=True)
    summary = summarize(model, solution)
    with tempfile.TemporaryDirectory(prefix=".writing-", dir=folder) as name:
        made = Path(name)
        solution.save(made / "solution.nc")
        (made / "summary.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        if figures:
            from raceway.runtime.figures import draw_all

            draw_all(model, solution, made)
        for path in sorted(made.iterdir()):
            os.replace(path, folder / path.name)
    return summary


def main() -> None:
    """Entry point of the ``raceway`` command."""
    app()
