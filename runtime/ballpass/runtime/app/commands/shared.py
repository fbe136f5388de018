"""What the commands of ``ballpass`` share: errors as messages, stages on stderr, reading a scene with its settings.

Like every module here it serves both halves and imports `ballpass.derive` inside functions.  Messages and
progress go to stderr, results to stdout.  Exit codes: 0 done, 1 the computation failed, 2 the request was wrong, 130
interrupted.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from ballpass.runtime.app.interrupted import INTERRUPTED
from ballpass.runtime.contract.errors import BallpassError, RequestError

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.scene.errors import Fault
    from ballpass.derive.scene.records import Run
    from ballpass.runtime.contract import Manifest, RunInfo
    from ballpass.runtime.model import Model
    from ballpass.runtime.run.locating import Kinks

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
def reported() -> Iterator[None]:
    """Turn errors raised on purpose into a message and an exit code; everything else is a defect and shows itself."""
    try:
        yield
    except BallpassError as error:
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


@contextlib.contextmanager
def warnings_shown() -> Iterator[None]:
    """Print warnings within as a command prints them."""
    with warnings.catch_warnings():
        warnings.showwarning = warn
        yield


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


@contextlib.contextmanager
def faults_of(source: Path | str) -> Iterator[None]:
    """Say whose faults they are, where a later stage than reading finds them."""
    from ballpass.derive.scene.errors import SceneError

    try:
        yield
    except SceneError as error:
        if error.source is not None:
            raise
        raise SceneError(error.faults, source=source) from None


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

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.path.stem


def read_asked(path: Path, settings: list[str], duration: float | None = None, transient: float | None = None) -> Asked:
    """What is asked of a scene; arguments as for `read_with_settings`.

    Where the generated folder is fresh its manifest tells all that is needed; the scene is read where it is not, and
    where something is wrong, to say so in the scene's words.
    """
    from ballpass.derive.emit.signature import fresh_manifest

    manifest = fresh_manifest(path)
    overrides = _plain_overrides(manifest, settings) if manifest is not None else None
    if manifest is not None and overrides is not None:
        run: Run | RunInfo = manifest.run
        names = [m.speed for m in (manifest.mechanism,) if m] + [b.shaft_speed for b in manifest.bearings]
        values = {info.name: info.default for info in manifest.parameters} | overrides
        speed = values.get(names[0], 0.0) if names else 0.0
    else:
        _, scene, overrides = read_with_settings(path, settings)
        run = scene.run
        shaft = scene.mechanism.driver.speed if scene.mechanism else scene.shaft.speed if scene.shaft else None
        speed = shaft.value if shaft is not None else 0.0
    if duration is not None:
        dropped = run.transient_cycles if transient is None else transient
        run = replace(run, cycles=None, duration=duration, transient_cycles=dropped)
    return Asked(path=path, run=run, overrides=overrides, speed=speed)


def _plain_overrides(manifest: Manifest, settings: list[str]) -> dict[str, float] | None:
    """Numbers of ``--set`` by path, where the manifest's bounds alone tell that they are right; else None."""
    from ballpass.derive.scene.units import QuantityError, parse_quantity
    from ballpass.runtime.contract.parameters import resolve_parameters

    units = {info.name: info.unit for info in manifest.parameters}
    found: dict[str, float] = {}
    for text in settings:
        path, _, value = (part.strip() for part in text.partition("="))
        # ends of windows and knots of tables are checked against each other when a scene is read
        if path not in units or path in found or ".window" in path or path.startswith("load."):
            return None
        try:
            found[path] = parse_quantity(value, units[path])
        except QuantityError:
            return None
    try:
        resolve_parameters(manifest, found)
    except RequestError:
        return None
    return found


def read_with_settings(
    path: Path, settings: list[str], duration: float | None = None, transient: float | None = None
) -> tuple[Scene, Scene, dict[str, float]]:
    """The scene as the file has it, the scene as asked for, and the overrides in SI; checked as if in the file.

    Parameters
    ----------
    duration : length of the run instead of the file's cycles or duration [s]
    transient : turns at its start that do not count, beside a duration
    """
    from ballpass.derive import SceneError, read_scene
    from ballpass.derive.reading.read import parse_override, with_values

    read = read_scene(path)
    faults: list[Fault] = []
    overrides: dict[str, float] = {}
    texts: dict[str, str] = {}
    for text in settings:
        misplaced = run_setting(text)
        if misplaced is not None:
            faults.append(misplaced)
            continue
        try:
            name, value = parse_override(read, text)
        except SceneError as error:
            faults += error.faults
            continue
        if name in overrides:
            faults.append(_given_twice(name, texts[name], text))
        overrides[name], texts[name] = value, text
    if faults:
        raise SceneError(faults, source="--set")
    asked = read
    if duration is not None:
        dropped = read.run.transient_cycles if transient is None else transient
        asked = replace(read, run=replace(read.run, cycles=None, duration=duration, transient_cycles=dropped))
    if not overrides:
        return read, asked, {}
    with faults_of("--set"):
        asked = with_values(asked, overrides)
    return read, asked, overrides


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
    from ballpass.derive.scene.units import QuantityError, parse_quantity

    try:
        seconds = parse_quantity(text, "s")
    except QuantityError as error:
        raise RequestError(f"--duration: {error}") from None
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


def _given_twice(path: str, first: str, second: str) -> Fault:
    """A fault where ``--set`` names a number twice: nobody can tell which value is meant."""
    from ballpass.derive.scene.errors import Fault

    values = [text.partition("=")[2].strip() for text in (first, second)]
    return Fault(
        key=path,
        problem="the number is set twice",
        given=f"{values[0]} and {values[1]}",
        allowed="one value for a number",
        remedy="leave one --set away",
    )


def run_setting(text: str) -> Fault | None:
    """A fault where ``--set`` names a line of the run table, which holds no parameters of the model."""
    from ballpass.derive.scene.errors import Fault

    path, _, value = (part.strip() for part in text.partition("="))
    if not path.startswith("run."):
        return None
    option = RUN_OPTIONS.get(path)
    if option is not None:
        remedy = f"`ballpass run` has {option} for it, as in {option} {value or 'VALUE'}"
    else:
        remedy = f"`ballpass run` has {', '.join(RUN_OPTIONS.values())}; for the rest edit [run] in the scene"
    return Fault(
        key=path,
        problem="is a setting of the run, not a parameter of the model",
        given=text,
        allowed="paths of numbers of mechanism, shaft, load and bearing",
        remedy=remedy,
    )


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
    scene: Path | Scene,
    stages: Stages,
    method: str,
    kinks: str | None = None,
    rtol: float | None = None,
    *,
    overrides: Mapping[str, float] | None = None,
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
    if any(path.startswith("mechanism.") for path in overrides or {}):
        model.check_assembly(overrides)
    if model.has_stepper and method in ("auto", *STEPPERS):
        _ = model.stepper  # compiled here, where it is announced
        tolerance = model.manifest.run.rtol if rtol is None else rtol
        _ = stepper_for(
            model, choose_kinks(kinks, "stepper" if method == "auto" else method, model.manifest, tolerance)
        )
    return model
