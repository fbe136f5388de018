"""The results of a run as a folder: solution, summary and figures of one run, the old one or the new one.

In: a folder, and a function that writes the files of a run.  Out: the folder holds them, and whatever else was in it.

A new folder is written beside the old one, gets the files of others as further links, and is exchanged with it in one
step.  Where that cannot be (the system has no such step; folders or links of others are in it; it is where this process
works, or a disk of its own), the new files are made whole in a hidden folder within, and put in place one by one: a
break in between leaves a mixture, but the new run whole beside it.  The summary carries the digests of all files, so
that `load_results` takes the whole run or refuses.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import clear, permit, read_settled, swap, turn
from ballpass.runtime.native.interrupts import held
from ballpass.runtime.run.solution import Solution, read_bytes

SOLUTION = "solution.nc"
SUMMARY = "summary.json"

#: Key of the summary under which the digests of the other files stand.
FILES = "files"

_COMPLETE = ".complete"


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What ``ballpass run`` wrote: the solution, and the summary as it stands in ``summary.json``."""

    solution: Solution
    summary: Mapping[str, Any]


def write_results(
    folder: Path, write: Callable[[Path], dict[str, Any]], *, figures: Collection[str] = ()
) -> tuple[dict[str, Any], list[str]]:
    """Replace the results of an earlier run by those of a new one; files of others stay.

    Parameters
    ----------
    folder : to be written, made where it is missing
    write : writes solution and figures into the folder it is called with; gives the summary
    figures : names of all figures there are: those that the new run does not bring go, for they would pass for its own

    Returns
    -------
    The summary, with the digests of the files, and the names of the files.

    Raises
    ------
    OSError
        The folder cannot be written; what was there is as it was.
    """
    place = Path(os.path.realpath(folder))  # of a link, what it points to: the link itself stays
    missing = [path for path in (place.parent, *place.parent.parents) if not path.exists()]
    place.parent.mkdir(parents=True, exist_ok=True)
    with turn(place.parent):
        beside = _may_be_exchanged(place)
    home = place.parent if beside else place
    if not beside and not place.exists():
        missing.insert(0, place)
        place.mkdir()
    label = place.name if beside else ""
    clear(home, label, ".new")
    made = Path(tempfile.mkdtemp(prefix=f".{label}-", suffix=".new", dir=home))
    owned = {SOLUTION, SUMMARY, *figures}
    try:
        summary = write(made)
        names = sorted(path.name for path in made.iterdir())
        summary[FILES] = {name: _digest(made / name) for name in names}
        (made / SUMMARY).write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        with turn(place.parent), held():
            if not (beside and _exchange(made, place, owned)):
                made = _move(made, place, owned)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        for path in missing:
            with contextlib.suppress(OSError):  # not empty: somebody else wrote there
                path.rmdir()
        raise
    with held():
        shutil.rmtree(made, ignore_errors=True)
    return summary, sorted((*names, SUMMARY))


def load_results(folder: str | Path) -> Results:
    """Read what ``ballpass run`` wrote into a folder.

    Raises
    ------
    RequestError
        There are no results, or files of different runs.
    """
    place = Path(folder)
    return read_settled(place, lambda: _load(_newest(place)), RequestError)


def _newest(place: Path) -> Path:
    """The folder itself, or the newest in it that was whole before a process was ended while it put files in place."""
    hidden = []
    for path in place.glob(f"{_COMPLETE}-*.new"):
        with contextlib.suppress(FileNotFoundError):  # its files are in place now
            hidden.append((path.stat().st_mtime_ns, path.name))
    return place / max(hidden)[1] if hidden else place


def _summary_text(home: Path) -> str:
    try:
        return (home / SUMMARY).read_text(encoding="utf-8")
    except (OSError, ValueError) as fault:
        why = getattr(fault, "strerror", None) or fault
        raise RequestError(
            f"{home / SUMMARY}: cannot be read ({why}). A folder that `ballpass run` wrote is expected."
        ) from None


def _load(home: Path) -> Results:
    text = _summary_text(home)
    try:
        summary = json.loads(text)
        digests = {str(name): str(digest) for name, digest in summary[FILES].items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise RequestError(
            f"{home / SUMMARY}: it does not tell the digests of the run's files: not written by `ballpass run` of this "
            "version, or edited. Run the scene again."
        ) from None
    strange = [name for name, digest in digests.items() if Path(name).name == name and _differs(home / name, digest)]
    if strange:
        raise RequestError(
            f"{home}: {', '.join(strange)}: not of the run that {SUMMARY} tells of: edited, or of another run. Run the "
            "scene again, or read the solution alone with load_solution."
        )
    try:
        content = (home / SOLUTION).read_bytes()
    except OSError as fault:
        raise RequestError(f"{home / SOLUTION}: cannot be read ({fault.strerror}). Run the scene again.") from None
    if hashlib.sha256(content).hexdigest() != digests.get(SOLUTION):
        raise RequestError(f"{home / SOLUTION}: not of the run that {SUMMARY} tells of. Run the scene again.")
    return Results(solution=read_bytes(home / SOLUTION, content), summary=summary)


def _may_be_exchanged(place: Path) -> bool:
    """Whether a new folder may take this one's place: nothing but plain files in it, and nobody at work there."""
    if not os.access(place.parent, os.W_OK | os.X_OK):
        return False
    if not place.exists():
        return True
    try:
        here = Path.cwd()
    except OSError:  # deleted meanwhile
        return False
    return (
        place not in (here, *here.parents)
        and place.stat().st_dev == place.parent.stat().st_dev
        and all(path.is_file() and not path.is_symlink() for path in place.iterdir())
    )


def _exchange(made: Path, place: Path, owned: Collection[str]) -> bool:
    """Put `made` in the place of `place` in one step, the files of others with it; False where that cannot be."""
    permit(made, place)
    if not place.exists():
        try:
            os.rename(made, place)
        except OSError:  # another process was faster
            return False
        return True
    linked: list[Path] = []
    try:
        for name in sorted(_names(place) - set(owned)):
            os.link(place / name, made / name, follow_symlinks=False)
            linked.append(made / name)
        done = swap(made, place)
    except OSError:  # no links on this file system, or a folder of somebody came meanwhile
        done = False
    if not done:
        for path in linked:
            path.unlink()
        return False
    for name in sorted(_names(made) - _names(place) - set(owned)):  # of somebody, come meanwhile
        os.rename(made / name, place / name)
    return True


def _move(made: Path, place: Path, owned: Collection[str]) -> Path:
    """Put the files of `made` into `place` one by one, the summary last; the folder that remains to be deleted."""
    place.mkdir(exist_ok=True)
    token = made.name.rpartition("-")[2]
    whole, done = place / f"{_COMPLETE}-{token}", place / f".-{token}"
    os.rename(made, whole)  # from here on the new run is the one that counts
    names = _names(whole)
    for name in sorted(set(owned) - names):
        (place / name).unlink(missing_ok=True)
    for name in sorted(names, key=lambda name: (name == SUMMARY, name)):
        second = whole / f"{name}.second"
        try:
            os.link(whole / name, second)
        except OSError:  # no links on this file system
            shutil.copyfile(whole / name, second)
        os.replace(second, place / name)
    for left in sorted(place.glob(f"{_COMPLETE}-*.new")):  # of processes that were killed
        if left != whole:
            aside = place / f".-{left.name.rpartition('-')[2]}"
            os.rename(left, aside)  # at once: half of it would pass for a run
            shutil.rmtree(aside, ignore_errors=True)
    os.rename(whole, done)
    return done


def _names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def _differs(path: Path, digest: str) -> bool:
    """Whether a file is there and is another one; the user may have deleted it, or a new run that has no such file."""
    try:
        return _digest(path) != digest
    except FileNotFoundError:
        return False
    except OSError as fault:
        raise RequestError(f"{path}: cannot be read ({fault.strerror}). Run the scene again.") from None


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
