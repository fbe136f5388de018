"""Random scenes by several routes, and their mutants: ``python -m scripts.validation.machines``.

Prints what `machines.csv` holds.  ``python -m scripts.validation.machines 0 200`` compares these seeds anew and adds
their rows, some ten seconds a seed.  Scenes, reference in maximal coordinates and mutants are those of the tests.
"""

from __future__ import annotations

import csv
import sys
import warnings
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from scripts.validation.lines import HERE

ROWS = HERE / "machines.csv"
TESTS = HERE.parents[1] / "tests"
REFERENCE = "reference in maximal coordinates"


def _module(name: str) -> Any:
    for folder in ("machines", "conformance"):
        if str(TESTS / folder) not in sys.path:
            sys.path.insert(0, str(TESTS / folder))
    return import_module(name)


def compared(seed: int) -> Iterator[tuple[str, list[str]]]:
    """Of the scene of a seed each case, and the values that differ."""
    generator, states, mutants = map(_module, ("generator", "machine_states", "mutants"))
    tables = generator.scene(seed)
    machine = states.States(tables)
    drawn = states.states_of(machine, seed)
    reference = _module("reference").Reference(tables)
    yield REFERENCE, [name for one in drawn for name in states.against_reference(machine, reference, *one)]
    for case in mutants.MUTANTS:
        found = mutants.mutant(case, tables)
        if found is None:
            continue
        try:
            twin = states.States(found.tables)
            yield case, [name for one in drawn for name in states.against_mutant(machine, found, twin, *one)]
        except Exception as refused:  # of a machine that was accepted as the other: a mismatch as well
            yield case, [f"{type(refused).__name__} {refused}"]


def rows() -> dict[tuple[int, str], int]:
    """How many values of a seed and case differ."""
    if not ROWS.exists():
        return {}
    with ROWS.open(encoding="utf-8", newline="") as file:
        return {(int(row["seed"]), row["case"]): int(row["differing"]) for row in csv.DictReader(file)}


def write(found: dict[tuple[int, str], int]) -> None:
    """Rows in the order of seeds."""
    with ROWS.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["seed", "case", "differing"])
        writer.writerows((*key, found[key]) for key in sorted(found, key=lambda key: key[0]))


def printed() -> list[str]:
    """The table as text."""
    known = rows()
    cases = list(dict.fromkeys(case for _, case in known))
    lines = [f"{len({seed for seed, _ in known})} random scenes", f"{'':34s} scenes  mismatches"]
    for case in sorted(cases, key=lambda case: (case != REFERENCE, case)):
        of_case = [differing for (_, other), differing in known.items() if other == case]
        lines.append(f"{case:34s} {len(of_case):6d}  {sum(map(bool, of_case)):10d}")
    return lines


def main(words: list[str]) -> None:
    """Compare the seeds that are named, then print."""
    warnings.simplefilter("ignore")
    known = rows()
    for seed in range(*map(int, words)) if words else ():
        known = {key: differing for key, differing in known.items() if key[0] != seed}
        for case, names in compared(seed):
            known[seed, case] = len(names)
            if names:
                print(f"seed {seed}, {case}: {', '.join(names[:4])}", file=sys.stderr)
        write(known)
    print("\n".join(printed()))


if __name__ == "__main__":
    main(sys.argv[1:])
