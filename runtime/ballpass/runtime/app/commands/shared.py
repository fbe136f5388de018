"""What the commands of ``ballpass`` share: errors as messages, stages on stderr, reading a scene with its settings.

Like every module here it serves both halves and imports `ballpass.derive` inside functions.  Messages and
progress go to stderr, results to stdout.  Exit codes: 0 done, 1 the computation failed, 2 the request was wrong, 130
interrupted.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from ballpass.runtime.app.interrupted import INTERRUPTED
from ballpass.runtime.contract.errors import BallpassError, RequestError

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.scene.records import Run
    from ballpass.runtime.contract import Manifest, RunInfo
    from ballpass.runtime.model import Model
    from ballpass.runtime.run.locating import Kinks

_Run = TypeVar("_Run", bound="Run | RunInfo")

errors_console = Console(stderr=True, emoji=False)  # A:B:N is no picture

#: Lines of a scene's run table that have an option of ``ballpass run``.
RUN_OPTIONS = {
    "run.cycles": "--cycles",
    "run.duration": "--duration",
    "run.transient_cycles": "--transient",
    "run.rtol": "--rtol",
    "run.method": "--method",
}

#: Names of the stages as they are announced.
STAGES = {
    "read": "reading the scene",
    "derive": "deriving equations",
    "lower": "building functions",
    "emit": "generating C",
    "check": "deriving to compare",
    "compile": "compiling",
    "export": "writing the C program",
    "simulate": "simulating",
    "draw": "drawing figures",
    "write": "writing results",
}


@contextlib.contextmanager
def command(scene: Path) -> Iterator[Stages]:
    """The stages of a command; its warnings as messages, and its errors as messages with an exit code.

    Parameters
    ----------
    scene : named in faults that a later stage than reading finds
    """
    try:
        with warnings.catch_warnings(), Stages() as stages:
            warnings.showwarning = warn
            yield stages
    except BallpassError as error:
        from ballpass.derive.scene.errors import SceneError

        if isinstance(error, SceneError) and error.source is None:
            error = SceneError(error.faults, source=scene)
        complain(str(error))
        raise typer.Exit(2 if isinstance(error, ValueError) else 1) from None
    except BrokenPipeError:  # the reader has seen enough, as in `ballpass equations SCENE | head`
        raise
    except OSError as error:
        where = f" {os.fspath(error.filename)!r}" if error.filename else ""
        why = error.strerror or str(error)
        complain(f"cannot read or write{where}: {why}. Check the path, its permissions and the free space.")
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        complain(INTERRUPTED)
        raise typer.Exit(130) from None


def complain(message: str) -> None:
    """Print an error on stderr."""
    errors_console.print(f"[bold red]error[/]: {escape(message)}", soft_wrap=True, highlight=False)


def warn(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning on stderr; takes the place of `warnings.showwarning`."""
    errors_console.print(f"[bold yellow]warning[/]: {escape(str(message))}", soft_wrap=True, highlight=False)


def note(message: str) -> None:
    """Print a remark on stderr."""
    errors_console.print(f"[bold]note[/]: {escape(message)}", soft_wrap=True, highlight=False)


def show(text: str) -> None:
    """Print a line of results on stdout."""
    Console(emoji=False).print(text, highlight=False, soft_wrap=True, markup=False)


def show_json(result: Any) -> None:
    """Print results as one JSON object on stdout."""
    typer.echo(json_text(result), nl=False)


def json_text(result: Any) -> str:
    """Results as JSON for people and programs."""
    return json.dumps(result, indent=2, allow_nan=False) + "\n"


class Stages:
    """Progress on stderr: on a terminal bars that move, elsewhere one line when a stage begins."""

    def __init__(self) -> None:
        # rich's own answer is yes under FORCE_COLOR, also for a file
        self._moving = sys.stderr.isatty() and errors_console.is_interactive
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description:<20}"),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            console=errors_console,
            disable=not self._moving,
        )
        self._begin = time.perf_counter()
        self._task: Any = None

    def __enter__(self) -> Stages:
        self._progress.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        if error[0] is None:
            self._finish()
        elif self._task is not None:
            self._progress.stop_task(self._task)
        self._progress.__exit__(*error)

    def _finish(self) -> None:
        if self._task is not None:
            self._progress.update(self._task, total=1.0, completed=1.0)

    def __call__(self, name: str) -> None:
        self._finish()
        words = STAGES.get(name, name)
        if self._moving:
            self._task = self._progress.add_task(words, total=None)
        else:
            errors_console.print(
                f"{time.perf_counter() - self._begin:7.1f} s  {words}", highlight=False, soft_wrap=True
            )

    def fraction(self, done: float) -> None:
        """Move the bar of the present stage to its finished fraction."""
        if self._moving:
            self._progress.update(self._task, total=1.0, completed=done)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a command needs of a scene before it has a model.

    Attributes
    ----------
    path : the scene file
    run : its run settings, with what was asked for instead
    overrides : numbers of ``--set`` by path [SI]
    speed : of driver or shaft, with the overrides; 0 where nothing turns [rad/s]
    """

    path: Path
    run: Run | RunInfo
    overrides: dict[str, float]
    speed: float


def read_asked(
    path: Path, settings: list[str] | None, duration: float | None = None, transient: float | None = None
) -> Asked:
    """What is asked of a scene by ``--set``, ``--duration`` [s] and ``--transient`` [turns].

    Where the generated folder is fresh its manifest tells all that is needed; the scene is read where it is not, and
    where something is wrong, to say so in the scene's words.
    """
    from ballpass.derive.emit.signature import fresh_manifest

    manifest = fresh_manifest(path)
    overrides = _plain_overrides(manifest, settings or []) if manifest is not None else None
    if manifest is not None and overrides is not None:
        run: Run | RunInfo = manifest.run
        names = [m.speed for m in (manifest.mechanism,) if m] + [b.shaft_speed for b in manifest.bearings]
        values = {info.name: info.default for info in manifest.parameters} | overrides
        speed = values.get(names[0], 0.0) if names else 0.0
    else:
        _, scene, overrides = read_with_settings(path, settings, duration, transient)
        run = scene.run
        shaft = scene.mechanism.driver.speed if scene.mechanism else scene.shaft.speed if scene.shaft else None
        speed = shaft.value if shaft is not None else 0.0
    return Asked(path=path, run=_asked_run(run, duration, transient), overrides=overrides, speed=speed)


def _asked_run(run: _Run, duration: float | None, transient: float | None) -> _Run:
    """Run settings with a duration, where one was asked for."""
    if duration is None:
        return run
    dropped = run.transient_cycles if transient is None else transient
    return replace(run, cycles=None, duration=duration, transient_cycles=dropped)


def _plain_overrides(manifest: Manifest, settings: list[str]) -> dict[str, float] | None:
    """Numbers of ``--set`` by path, where the manifest's bounds alone tell that they are right; else None."""
    from ballpass.derive.scene.units import parse_quantity
    from ballpass.runtime.contract.parameters import resolve_parameters

    units = {info.name: info.unit for info in manifest.parameters}
    found: dict[str, float] = {}
    try:
        for text in settings:
            path, _, value = (part.strip() for part in text.partition("="))
            # ends of windows and knots of tables are checked against each other when a scene is read
            if path not in units or path in found or ".window" in path or path.startswith("load."):
                return None
            found[path] = parse_quantity(value, units[path])
        resolve_parameters(manifest, found)
    except RequestError:
        return None
    return found


def read_with_settings(
    path: Path, settings: list[str] | None, duration: float | None = None, transient: float | None = None
) -> tuple[Scene, Scene, dict[str, float]]:
    """The scene as the file has it, the scene as asked for, and the overrides in SI; checked as if in the file."""
    from ballpass.derive import SceneError, read_scene
    from ballpass.derive.reading.read import parse_override, with_values
    from ballpass.derive.scene.errors import Fault

    read = read_scene(path)
    faults: list[Fault] = []
    texts: dict[str, str] = {}
    overrides: dict[str, float] = {}
    for text in settings or []:
        try:
            refuse_run_setting(text)
            name, value = parse_override(read, text)
        except SceneError as error:
            faults += error.faults
            continue
        given = text.partition("=")[2].strip()
        if name in overrides:
            faults.append(
                Fault(
                    key=name,
                    problem="the number is set twice",
                    given=f"{texts[name]} and {given}",
                    allowed="one value for a number",
                    remedy="leave one --set away",
                )
            )
        overrides[name], texts[name] = value, given
    if faults:
        raise SceneError(faults, source="--set")
    asked = replace(read, run=_asked_run(read.run, duration, transient))
    try:
        return read, with_values(asked, overrides) if overrides else asked, overrides
    except SceneError as error:
        raise SceneError(error.faults, source="--set") from None


def read_quantity(option: str, text: str | None, unit: str) -> float | None:
    """A finite quantity of an option [unit], None where it was not given."""
    from ballpass.derive.scene.units import QuantityError, parse_quantity

    if text is None:
        return None
    try:
        value = parse_quantity(text, unit)
    except QuantityError as error:
        raise RequestError(f"{option}: {error}") from None
    if not math.isfinite(value):
        raise RequestError(f"{option}: {text!r} is no finite quantity.")
    return value


def read_duration(text: str | None, cycles: float | None) -> float | None:
    """The time of ``--duration "0.5 s"`` [s].

    Raises
    ------
    RequestError
        No time above 0, or turns were given as well.
    """
    if text is None:
        return None
    if cycles is not None:
        raise RequestError(
            f"--cycles {cycles:g} and --duration {text!r} were both given. Allowed: one of them. Leave one away."
        )
    seconds = read_quantity("--duration", text, "s") or 0.0
    if not seconds > 0.0:
        raise RequestError(
            f'--duration: {text!r} cannot be simulated. Allowed: a time above 0, as in --duration "0.5 s".'
        )
    return seconds


def faults_of_turns(cycles: float | None, transient: float | None) -> list[str]:
    """What is wrong with ``--cycles`` and ``--transient``."""
    faults = []
    if cycles is not None and not 0.0 < cycles < math.inf:
        faults.append(f"--cycles: {cycles:g} turns cannot be simulated. Allowed: a number above 0, as in --cycles 4.")
    if transient is not None and not 0.0 <= transient < math.inf:
        faults.append(f"--transient: {transient:g} turns cannot be left out. Allowed: a number from 0 on.")
    return faults


def refuse_run_setting(text: str) -> None:
    """Refuse ``--set`` of a line of the run table, which holds no parameters of the model."""
    from ballpass.derive.scene.errors import Fault, SceneError

    path, _, value = (part.strip() for part in text.partition("="))
    if not path.startswith("run."):
        return
    option = RUN_OPTIONS.get(path)
    if option is not None:
        remedy = f"`ballpass run` has {option} for it, as in {option} {value or 'VALUE'}"
    else:
        remedy = f"`ballpass run` has {', '.join(RUN_OPTIONS.values())}; for the rest edit [run] in the scene"
    fault = Fault(
        key=path,
        problem="is a setting of the run, not a parameter of the model",
        given=text,
        allowed="paths of numbers of mechanism, shaft, load and bearing",
        remedy=remedy,
    )
    raise SceneError([fault])


def results_folder(out: Path | None, scene: Path) -> Path:
    """Folder of a scene's results; one that cannot be written is refused."""
    folder = out if out is not None else Path("results") / scene.stem
    check_folder(folder)
    return folder


def check_folder(folder: Path) -> None:
    """Refuse a folder of results that cannot be made or written, before the simulation instead of behind it."""
    place = folder.absolute()
    while not os.path.lexists(place):
        place = place.parent
    why = None
    if not place.is_dir():
        why = f"{place} is no folder"
    elif not os.access(place, os.W_OK | os.X_OK):
        why = f"{place} may not be written"
    if why is not None:
        raise RequestError(
            f"The folder of the results, {folder}, cannot be written: {why}. Allowed: a folder that you may write, or "
            "one that can be made. Give another: --out DIR."
        )


def checked_kinks(kinks: str | None, method: str, error: str | None = None) -> Kinks | None:
    """What to do at kinks; what no run can do is refused before anything is derived or written."""
    from ballpass.runtime.run.locating import check_located, refuse_with_error

    refuse_with_error(kinks, error)
    return check_located(kinks, "stepper" if method == "auto" else method) if kinks is not None else None


def load_model(
    scene: Path,
    stages: Stages,
    method: str,
    kinks: str | None = None,
    rtol: float | None = None,
    *,
    overrides: Mapping[str, float],
) -> Model:
    """The scene's model, derived and compiled where it is stale; with the stepper that a run of these will take.

    Parameters
    ----------
    overrides : numbers of ``--set``; refused where the linkage locks with them
    """
    from ballpass.derive.emit.generate import generate
    from ballpass.runtime.model import load
    from ballpass.runtime.native.stepper import METHODS as STEPPERS
    from ballpass.runtime.run.locating import choose_kinks, stepper_for

    folder = generate(scene, progress=stages)
    stages("compile")
    model = load(folder)
    if any(path.startswith("mechanism.") for path in overrides):
        model.check_assembly(overrides)
    if model.has_stepper and method in ("auto", *STEPPERS):
        _ = model.stepper  # compiled here, where it is announced
        tolerance = model.manifest.run.rtol if rtol is None else rtol
        chosen = choose_kinks(kinks, "stepper" if method == "auto" else method, model.manifest, tolerance)
        _ = stepper_for(model, chosen)
    return model
