"""The results of a run as a folder: solution, summary and figures.

In: a folder, and a function that writes the files of a run.  Out: the folder holds them beside its other files.
The summary is put in place last and carries the digests of the other files, so that `load_results` reads a complete run
or refuses: a process that is killed during the writing leaves the old run, the new one, or files that are refused.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folder import file_digest
from ballpass.runtime.contract.folders import read_whole, replace_files
from ballpass.runtime.report.plain import json_text
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.solution.solution import Solution
from ballpass.runtime.solution.solution_file import read_bytes

SOLUTION = "solution.nc"
SUMMARY = "summary.json"

#: Key of the summary under which the digests of the other files stand.
FILES = "files"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Results(ShortRepr):
    """What ``ballpass run`` wrote: the solution, and the summary as it stands in ``summary.json``.

    Examples
    --------
    >>> results = load_results("results/punching_press")
    >>> results.solution["ball.force"].shape[1]  # balls
    8
    """

    solution: Solution
    summary: Mapping[str, Any]

    def _repr_html_(self) -> str:
        return self.solution._repr_html_()


def write_results(
    folder: Path, write: Callable[[Path], dict[str, Any]], *, figures: Collection[str] = ()
) -> tuple[dict[str, Any], list[str]]:
    """Replace the results of an earlier run by those of a new one; files of others stay.

    Parameters
    ----------
    folder : to be written, made where it is missing
    write : writes solution and figures into the folder it is called with; gives the summary
    figures : names of all figures there are: beside a summary, those that the new run does not write are deleted

    Returns
    -------
    The summary, with the digests of the files, and the names of the files.

    Raises
    ------
    OSError
        The folder cannot be written; what was there is as it was.
    """

    def write_all(made: Path) -> dict[str, Any]:
        summary = write(made)
        summary[FILES] = {path.name: file_digest(path) for path in sorted(made.iterdir())}
        (made / SUMMARY).write_text(json_text(summary), encoding="utf-8")
        return summary

    def outdated() -> Collection[str]:
        return figures if (folder / SUMMARY).exists() else ()

    summary = replace_files(folder, write_all, last=SUMMARY, owned=outdated)
    return summary, sorted((*summary[FILES], SUMMARY))


@typed
def load_results(folder: str | Path) -> Results:
    """Read what ``ballpass run`` wrote into a folder.

    Raises
    ------
    RequestError
        There are no results, or files of different runs.

    Examples
    --------
    >>> results = load_results("results/punching_press")  # of `ballpass run`
    >>> round(results.summary["peak_ball_force"]["total"], -1)  # [N]
    4390.0
    """
    return read_whole(Path(folder), lambda: _load(Path(folder)), RequestError)


def _load(home: Path) -> Results:
    try:
        text = (home / SUMMARY).read_text(encoding="utf-8")
    except (OSError, ValueError) as fault:
        why = getattr(fault, "strerror", None) or fault
        raise RequestError(
            f"{home / SUMMARY}: cannot be read ({why}). A folder that `ballpass run` wrote is expected."
        ) from None
    try:
        summary = json.loads(text)
        digests = {str(name): str(digest) for name, digest in summary[FILES].items()}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise RequestError(
            f"{home / SUMMARY}: it has no digests of the run's files: not written by `ballpass run` of this "
            "version, or edited. Run the scene again."
        ) from None
    solution = b""
    for name in dict.fromkeys((SOLUTION, *digests)):
        if Path(name).name != name:
            continue
        try:
            content = (home / name).read_bytes()
        except OSError as fault:
            if isinstance(fault, FileNotFoundError) and name != SOLUTION:
                continue  # the user may have deleted a figure
            raise RequestError(f"{home / name}: cannot be read ({fault.strerror}). Run the scene again.") from None
        if hashlib.sha256(content).hexdigest() != digests.get(name):
            raise RequestError(
                f"{home}: {name}: does not belong to the run of {SUMMARY}: edited, or of another run. Run the "
                "scene again, or read the solution alone with load_solution."
            )
        if name == SOLUTION:
            solution = content
    return Results(solution=read_bytes(home / SOLUTION, solution), summary=summary)
