"""Which state of the code was measured, and when: what keeps results of different states from being mixed in silence.

In: the sources, and git where it is there.  Out: `State`, which every file of results carries and the page compares.
"""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from benchmarks.problem import ROOT

#: What is measured, and what measures.
SOURCES = (
    "scenes/punching_press*.toml",
    "derive/**/*.py",
    "runtime/**/*.py",
    "runtime/**/*.[ch]",
    "benchmarks/*.py",
    "benchmarks/*.c",
)

#: Not among them, for they only show what was measured: the command line, and what makes the page.
LEFT_OUT = (
    "runtime/ballpass/runtime/app/cli.py",
    "runtime/ballpass/runtime/commands/",
    "runtime/ballpass/runtime/figures/",
    "benchmarks/compared.py",
    "benchmarks/figures.py",
    "benchmarks/report.py",
    "benchmarks/sections.py",
    "benchmarks/tables.py",
    "benchmarks/targets.py",
    "benchmarks/test_",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A state of the code.

    Attributes
    ----------
    digest : of the sources that are measured and that measure
    commit : of git, empty where it is not there; with a plus where these sources differ from it
    date : when it was measured, day of UTC
    """

    digest: str
    commit: str
    date: str

    def record(self) -> dict[str, str]:
        """For JSON."""
        return asdict(self)

    @classmethod
    def of(cls, result: Mapping[str, Any]) -> State:
        """The state that a file of results carries; unknown in those of before it was kept."""
        kept = result.get("state", {})
        return cls(**{name: kept.get(name, "") for name in ("digest", "commit", "date")})


def present() -> State:
    """The state of the code now."""
    commit = _git("rev-parse", "--short=12", "HEAD")
    if commit and _git(
        "status", "--porcelain", "--", "scenes", "derive", "runtime", "benchmarks/*.py", "benchmarks/*.c"
    ):
        commit += "+"
    return State(digest=digest(), commit=commit, date=datetime.now(UTC).date().isoformat())


def digest() -> str:
    """Digest of the sources that are measured and that measure."""
    found = hashlib.sha256()
    for pattern in SOURCES:
        for path in sorted(ROOT.glob(pattern)):
            name = path.relative_to(ROOT).as_posix()
            if not name.startswith(LEFT_OUT):
                found.update(name.encode() + b"\0" + path.read_bytes())
    return found.hexdigest()[:16]


def _git(*words: str) -> str:
    try:
        done = subprocess.run(("git", *words), cwd=ROOT, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def lines(results: Mapping[str, Mapping[str, Any]], now: str) -> list[str]:
    """What the page says of the states its parts were measured at.

    Parameters
    ----------
    results : content of each file of results, by its name
    now : digest of the code when the page was written
    """
    states: dict[State, list[str]] = {}
    for name, result in results.items():
        states.setdefault(State.of(result), []).append(name)
    digests = {state.digest for state in states}
    if len(digests) == 1:
        days = sorted({state.date for state in states})
        commits = sorted({state.commit for state in states})
        when = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
        text = f"All parts were measured on one state of the code: `{digests.pop()}`{_commits(commits)}, {when}."
        one = next(iter(states))
        if one.digest != now:
            text += f" **The code has changed since: it is `{now}` where this page was written.**"
        return [text]
    found = [
        "**The parts were not all measured on one state of the code.** Ratios within a part hold; between parts they "
        f"may not. The code where this page was written is `{now}`.",
        "",
        "| state | commit | measured | differs from the code of this page | parts |",
        "| --- | --- | --- | --- | --- |",
    ]
    for state, names in sorted(states.items(), key=lambda item: (item[0].date, item[0].digest, item[0].commit)):
        differs = "no" if state.digest == now else "yes"
        parts = ", ".join(f"`{name}`" for name in names)
        cells = (f"`{state.digest}`" if state.digest else "not kept", state.commit or "–", state.date or "–")
        found.append(f"| {' | '.join(cells)} | {differs} | {parts} |")
    return found


def _commits(commits: list[str]) -> str:
    named = [f"`{commit}`" for commit in commits if commit]
    if not named:
        return ""
    changed = " (+: with changes not committed)" if any("+" in commit for commit in commits) else ""
    return f", commit {' and '.join(named)}{changed}"
