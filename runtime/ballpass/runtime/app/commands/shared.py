"""Functions that the commands of ``ballpass`` share: errors with exit codes, stages on stderr, folders, a model.

Like every module here it serves both halves and imports `ballpass.derive` inside functions.  Messages and
progress go to stderr, results to stdout.  Exit codes: 0 done, 1 the computation failed, 2 the request was wrong, 130
interrupted.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from ballpass.runtime.app.commands.load_scene import generated_folder
from ballpass.runtime.app.commands.messages import complain, errors_console, note, warn
from ballpass.runtime.app.interrupted import say_interrupted
from ballpass.runtime.contract.errors import BallpassError, RequestError
from ballpass.runtime.contract.extras import can_derive, is_installed, missing
from ballpass.runtime.contract.folder import ForeignFolderError, read_manifest
from ballpass.runtime.contract.folders import nearest
from ballpass.runtime.contract.plugins import place_of
from ballpass.runtime.plot import FORMATS
from ballpass.runtime.show.progress import silent

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import Manifest
    from ballpass.runtime.model import Model

#: Times that a folder is derived and read while another process writes its own scene there.
ATTEMPTS = 100

_Read = TypeVar("_Read")

#: Where a command needs `ballpass.derive` and only the runtime is installed.
NO_DERIVE = (
    "This reads a scene or derives its equations, and only the runtime is installed: pip install ballpass. Without it "
    "commands that simulate take a generated folder in place of the scene: ballpass run generated/punching_press"
)

#: Time without a line of progress where no bar can move [s].
QUIET = 10.0

#: Stages of a derivation as they are announced; others have their words.
STAGES = {
    "derive": "deriving equations",
    "lower": "building functions",
    "emit": "generating C",
}


@contextlib.contextmanager
def command(scene: Path | None = None) -> Iterator[Stages]:
    """The stages of a command; its warnings as messages, each once, and its errors as messages with an exit code.

    Parameters
    ----------
    scene : named in faults that a later stage than reading finds; None for a command without one
    """
    try:
        with warnings.catch_warnings(), silent(), Stages() as stages:
            said: set[str] = set()

            def once(message: Warning | str, *_: Any, **__: Any) -> None:
                if str(message) not in said:
                    said.add(str(message))
                    warn(message)

            warnings.showwarning = once
            yield stages
    except BallpassError as error:
        if can_derive():
            from ballpass.derive.scene.errors import SceneError

            if isinstance(error, SceneError) and error.source is None:
                error = SceneError(error.faults, source=scene)
        complain(str(error))
        raise typer.Exit(2 if isinstance(error, ValueError) else 1) from None
    except ModuleNotFoundError as fault:
        if can_derive() or not str(fault.name).startswith("ballpass.derive"):
            raise
        complain(NO_DERIVE)
        raise typer.Exit(2) from None
    except BrokenPipeError:  # the reader has closed the pipe, as in `ballpass equations SCENE | head`
        raise
    except OSError as error:
        where = f" {os.fspath(error.filename)!r}" if error.filename else ""
        why = error.strerror or str(error)
        complain(f"cannot read or write{where}: {why}. Check the path, its permissions and the free space.")
        raise typer.Exit(2) from None
    except MemoryError:
        complain("there is not enough memory for this. Ask for less: fewer members, fewer samples or a shorter run.")
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        say_interrupted()
        raise typer.Exit(130) from None
    except Exception as fault:
        if not (place := place_of(fault)):
            raise
        complain(f"{place}, a plugin: {type(fault).__name__}: {fault}. Correct it; ballpass.testing has checks.")
        raise typer.Exit(2) from fault


class Stages:
    """Progress on stderr: on a terminal bars that move, elsewhere a line when a stage begins and while it lasts."""

    def __init__(self) -> None:
        # with FORCE_COLOR rich takes a file for a terminal as well
        self._moving = sys.stderr.isatty() and errors_console.is_interactive
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description:<20}"),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            console=errors_console,
            disable=not self._moving,
        )
        self._begin = self._written = time.perf_counter()
        self._words = ""
        self._task: Any = None
        self._ended = threading.Event()

    def __enter__(self) -> Stages:
        self._progress.__enter__()
        if not self._moving:
            threading.Thread(target=self._remind, daemon=True).start()
        return self

    def _remind(self) -> None:
        """A line where nothing was written for long: what takes long without fractions, as a compiler, is at work."""
        while not self._ended.wait(max(self._written + QUIET - time.perf_counter(), 0.01)):
            if self._words and time.perf_counter() - self._written >= QUIET:
                self._write(f"still {self._words}")

    def __exit__(self, *error: Any) -> None:
        self._ended.set()
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
        self._words = STAGES.get(name, name)
        if self._moving:
            self._task = self._progress.add_task(self._words, total=None)
        else:
            self._write(self._words)

    def fraction(self, done: float) -> None:
        """Move the bar of the present stage to its finished fraction; without a terminal, a line now and then."""
        if self._moving:
            self._progress.update(self._task, total=1.0, completed=done)
        elif time.perf_counter() - self._written >= QUIET:
            self._write(f"{self._words}, {100.0 * done:.0f} %")

    def _write(self, words: str) -> None:
        self._written = time.perf_counter()
        errors_console.print(f"{self._written - self._begin:7.1f} s  {words}", highlight=False, soft_wrap=True)


def name_of(scene: Path) -> str:
    """Name of a scene file, or of the generated folder in its place."""
    return scene.resolve().name if scene.is_dir() else scene.stem


def figure_formats(given: Sequence[str] | None, *, wanted: bool) -> tuple[str, ...]:
    """Kinds of the figures, each once, the first one where none was named; none where no figures are wanted.

    A message names the missing package where they cannot be drawn.
    """
    if not wanted:
        return ()
    for package in ("matplotlib", "scipy"):
        if not is_installed(package):
            note(f"No figures are drawn. {missing(package)}")
            return ()
    return tuple(dict.fromkeys(given or FORMATS[:1]))


def results_folder(out: Path | None, scene: Path, *names: str) -> Path:
    """Folder of a scene's results with files of these names; one that cannot be written is refused."""
    folder = out if out is not None else Path("results") / name_of(scene)
    check_folder(folder, *names)
    return folder


def results_file(out: Path | None, scene: Path, name: str, kinds: Sequence[str]) -> Path:
    """The file that ``--out`` names by its ending, one of `kinds`; else `name` in the folder that it names."""
    if out is not None and out.suffix.removeprefix(".") in kinds and not out.is_dir():
        check_folder(out.parent, out.name)
        return out
    return results_folder(out, scene, name) / name


def check_folder(folder: Path, *names: str) -> None:
    """Refuse a folder of results that cannot be made or written, before the simulation instead of after it.

    Parameters
    ----------
    names : of the files, or patterns of them: nothing but files may stand there
    """
    place, why = nearest(folder), None
    if not place.is_dir():
        why = f"{place} is not a folder"
    elif not os.access(place, os.W_OK | os.X_OK):
        why = f"{place} may not be written"
    else:
        taken = sorted(path for name in names for path in folder.glob(name) if path.exists() and not path.is_file())
        if taken:
            why = f"{taken[0]} is in the place of a file, and is none"
    if why is not None:
        raise RequestError(
            f"The folder of the results, {folder}, cannot be written: {why}. Allowed: a folder that you may write, or "
            "one that can be made. Give another: --out DIR."
        )


def read_own(
    scene: Path,
    stages: Stages,
    read: Callable[[Path, bool], _Read],
    manifest: Callable[[_Read], Manifest],
    inspect: Callable[[Manifest], None] | None = None,
) -> _Read:
    """Result of `read` for the scene's folder, derived where it is stale; a generated folder is read as it is.

    Scenes of one file name in different folders share a generated folder: where another process, also of another user,
    has written its own scene there between writing and reading, both are done again.

    Parameters
    ----------
    read : called with the folder, and whether it must be one that this user's ballpass wrote
    manifest : function that gives the manifest of the result
    inspect : called with the manifest before C is generated, where none is before `read`; raises to refuse
    """
    if scene.is_dir():
        if inspect is not None:
            inspect(read_manifest(scene))
        return read(scene, False)
    from ballpass.derive.emit.generate import generate
    from ballpass.derive.emit.signature import is_of_file

    for _ in range(ATTEMPTS):
        folder = generate(scene, generated_folder(scene), progress=stages, inspect=inspect)
        with contextlib.suppress(ForeignFolderError):
            found = read(folder, True)
            if is_of_file(manifest(found), scene):
                return found
    raise RequestError(
        f"{folder}: other processes keep writing another scene of the name {scene.stem} there. Allowed: one scene for "
        "a generated folder. Rename the scene file, or run in another folder."
    )


def load_model(
    scene: Path,
    stages: Stages,
    method: str,
    kinks: str | None = None,
    rtol: float | None = None,
    *,
    integrated: bool,
    needs: str = "",
    inspect: Callable[[Manifest], None] | None = None,
) -> Model:
    """The scene's model, derived and compiled where it is stale; with the stepper that a run of these will take.

    Parameters
    ----------
    integrated : whether the scene has states
    needs : command that works with the stepper alone: where there is no compiler it is refused before anything is
        derived; empty for others.  A scene without states needs no stepper
    inspect : see `read_own`: refuses names that the model does not have
    """
    from ballpass.runtime.contract.method_registry import STEPPERS
    from ballpass.runtime.model import load, load_own
    from ballpass.runtime.native.compilers import need_compiler
    from ballpass.runtime.request.locating import choose_kinks, stepper_for

    if integrated and (needs or method in STEPPERS):
        need_compiler(needs or f"method {method}")

    def compiled(folder: Path, own: bool) -> Model:
        stages("compiling")
        return load_own(folder) if own else load(folder)

    model = read_own(scene, stages, compiled, lambda model: model.manifest, inspect)
    if model.has_stepper and method in ("auto", *STEPPERS):
        tolerance = model.manifest.run.rtol if rtol is None else rtol
        chosen = choose_kinks(kinks, "stepper" if method == "auto" else method, model.manifest, tolerance)
        _ = stepper_for(model, chosen)  # compiled here, where it is announced
    return model


@contextlib.contextmanager
def speed_over_time(scene: Path, stages: Stages) -> Iterator[Path]:
    """Folder, for the time of the context, of a scene file with its driver's constant speed as a table of time.

    The driver's angle and speed are states there, so that there is something to integrate, and the speed may change.

    Raises
    ------
    RequestError
        The scene has a feature that a driver with a table of its speed does not allow.
    """
    from ballpass.derive import SceneError, generate, read_scene
    from ballpass.runtime.export.model_description import SPEED

    mechanism = read_scene(scene).mechanism
    assert mechanism is not None
    if mechanism.driver.swing is not None:
        raise RequestError(
            "What is written integrates the driver's motion, by a speed that changes, and this driver swings. Allowed: "
            "a scene with a bearing, or whose driver turns. Its numbers as samples: ballpass run, ballpass stream."
        )
    speed = f"{mechanism.driver.speed.value!r} rad/s"
    table = {"time": ["0 s", "1 s"], "speed": [speed, speed]}
    # states of a duty cycle may set the speed by its old name, and are for lives alone
    changes = {"mechanism": {"driver": {"speed": None, "table": table}}, "duty": None}
    try:
        changed = read_scene(scene, changes=changes)
    except SceneError as error:
        raise RequestError(
            f"{SPEED}: with a speed that changes, here [mechanism.driver.table], this scene is refused. Leave "
            f"the speed a parameter, or correct this:\n{error}"
        ) from error
    with tempfile.TemporaryDirectory() as place:
        yield generate(changed, Path(place) / scene.stem, progress=stages)
