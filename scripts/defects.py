"""Undo the fix of each known defect in a copy of the tree, and see that its test fails: writes docs/defects.md.

In: `scripts/defects.toml`, what each defect did and how its fix is undone.  Out: the page, and `scripts/defects.json`
with the test that was seen to fail.  `python scripts/defects.py NAME ...` takes some of them, the others as they were
seen; without names all, which takes half an hour.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
REGISTER = ROOT / "scripts" / "defects.toml"
SEEN = ROOT / "scripts" / "defects.json"
PAGE = ROOT / "docs" / "defects.md"

#: Longest that tests may take without the fix [s]; what a fix bounded may go on for hours without it.
PATIENCE = 150.0

#: What the tests need of the tree.
NEEDED = ("derive", "runtime", "tests", "scenes", "generated", "extremes", "pyproject.toml")

HEAD = """---
orphan: true
---

<!-- Written by scripts/defects.py from scripts/defects.toml. Do not edit. -->

# Defects found and mended

What the [tour of extremes](extremes.md) and the tests of files and processes found, and the test that fails without the
fix: `python scripts/defects.py` undoes each fix in a copy of the tree and watches.

| defect | mended in | seen to fail without the fix |
| --- | --- | --- |
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """A defect that was mended.

    Attributes
    ----------
    name : short name, for the command line
    did : what it did
    file : where it was mended
    fix, undone : a piece of that file, and what stands there without the fix
    tests : files with the tests that guard it
    select : which tests of those, as pytest's -k; empty for all
    """

    name: str
    did: str
    file: str
    fix: str
    undone: str
    tests: tuple[str, ...]
    select: str = ""


def read_register() -> tuple[Defect, ...]:
    """The register; TypeError where an entry has too few keys or strange ones."""
    entries = tomllib.loads(REGISTER.read_text(encoding="utf-8"))["defect"]
    return tuple(Defect(**{**entry, "tests": tuple(entry["tests"])}) for entry in entries)


def failing_test(copy: Path, defect: Defect) -> str | None:
    """The test that fails in a copy of the tree without the fix, None where all pass."""
    with undone(copy, defect):
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *defect.tests]
        command += ["-k", defect.select] if defect.select else []
        try:
            done = subprocess.run(
                command,
                cwd=copy,
                env={**os.environ, "PYTHONPATH": os.pathsep.join((str(copy / "derive"), str(copy / "runtime")))},
                capture_output=True,
                text=True,
                timeout=PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return f"{' '.join(defect.tests)} ({defect.select}): no end within {PATIENCE:g} s"
    if done.returncode < 0:
        return f"{' '.join(defect.tests)} ({defect.select}): the process ends by signal {-done.returncode}"
    failed = [line.split(" - ")[0].split(" ", 1)[1] for line in done.stdout.splitlines() if line.startswith("FAILED ")]
    return failed[0] if done.returncode == 1 and failed else None


def stands(tree: Path, defect: Defect) -> int:
    """How often the text of a fix stands in its file: once, or the register is out of date."""
    path = tree / defect.file
    return path.read_text(encoding="utf-8").count(defect.fix) if path.exists() else 0


@contextmanager
def undone(copy: Path, defect: Defect) -> Iterator[None]:
    """The file of a fix without it, for a while."""
    path = copy / defect.file
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(defect.fix, defect.undone), encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(text, encoding="utf-8")


def page(defects: tuple[Defect, ...], seen: Mapping[str, str]) -> str:
    rows = []
    for defect in defects:
        test = f"`{seen[defect.name]}`" if defect.name in seen else "**not yet**"
        rows.append(f"| {defect.did} | `{defect.file}` | {test.replace('|', '/')} |\n")
    return HEAD + "".join(rows)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    names = parser.parse_args().names
    defects = read_register()
    unknown = sorted(set(names) - {defect.name for defect in defects})
    if unknown:
        parser.error(f"no such defect: {', '.join(unknown)}. There are: {', '.join(d.name for d in defects)}")
    seen: dict[str, str] = json.loads(SEEN.read_text(encoding="utf-8")) if SEEN.exists() else {}
    missed = []
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "tree"
        for name in NEEDED:
            source = ROOT / name
            if source.is_dir():
                shutil.copytree(source, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, copy / name)
        for defect in defects:
            if names and defect.name not in names:
                continue
            if stands(copy, defect) != 1:
                print(
                    f"{defect.name}: the fix stands {stands(copy, defect)} times in {defect.file}, not once", flush=True
                )
                missed.append(defect.name)
                continue
            test = failing_test(copy, defect)
            print(f"{defect.name}: {test or 'NO TEST FAILS'}", flush=True)
            if test is None:
                missed.append(defect.name)
                seen.pop(defect.name, None)
            else:
                seen[defect.name] = test
    known = {defect.name: seen[defect.name] for defect in defects if defect.name in seen}
    SEEN.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(defects, known), encoding="utf-8")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
