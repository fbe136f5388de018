"""What a user could ask for at the edge, and which cases of the tour answer it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase

from extremes.case import Case, Row

#: Edge, and patterns of the names of the cases that go there.
ITEMS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("speed 0", ("speed 0 inside*", "ring pressed by*", "turns of a shaft that stands")),
    ("1 rpm to 60 000 rpm, both senses", ("1 rpm*", "60 000 rpm*", "5000 rpm clockwise", "equilibria, *rpm")),
    ("1 to 100 000 cycles, phases to 1e-9 rad", ("angles *", "phases after*", "motion after*")),
    ("load 0, 1 mN to 1 MN", ("punch *", "law *, punch 1 MN")),
    ("clearance -30 um to 1 mm", ("clearance *", "law *, clearance*")),
    ("3 to 60 balls", ("3 balls", "60 balls*")),
    ("balls of 0.5 to 100 mm", ("balls of*", "stiffness of balls*")),
    ("masses of 1 mg to 10 t", ("outer ring *", "inner ring *", "slider *", "rings of 1 mg*")),
    ("housing from free to rigid", ("housing stiffness*", "housing damping*")),
    ("damping 0 to 100 times critical, every law", ("contact damping 0", "law *")),
    ("crank 5 um to 5 m", ("crank 5 um*", "crank 5 m,*")),
    ("crank over rod to 0.9999", ("crank over rod 0.9999", "A(q) with crank over rod*")),
    ("start at a dead centre", ("start at * dead centre", "a linkage at its dead centre")),
    ("offset at the limit of assembly, masses off the links", ("two windows, guide offset*", "crank balanced*")),
    ("windows: zero width, over 360 deg, through 0, two", ("window *", "two windows*")),
    ("step load on a ring in free flight", ("step load*",)),
    ("all balls out of contact", ("all balls out*", "rings of 1 mg to 10 t in free flight")),
    ("start inside 200 um of penetration", ("start inside*",)),
    ("energy over 1e5 oscillations", ("energy over*",)),
    ("work of drive and punch", ("drive work*",)),
    ("turned, mirrored, in other units", ("scene turned*", "scene in a mirror", "length x*")),
    ("momentum over a cycle", ("momentum*",)),
    ("constant force ends in equilibrium", ("ring pressed by*", "equilibria, *")),
    ("independent of sampling, dense output", ("16 and 5600*", "samples between*", "angles * at chosen times")),
    ("each method on the stiffest, the least damped case", ("stiffest*", "no damping at all", "100 times stiffer*")),
    ("step-size floor, too many steps, overflow, growth", ("start at 1e200*", "overflow*", "growth*", "100 times*")),
    ("laws whose force jumps: bounded work, right motion", ("law *gated*", "steps that end*")),
    ("fast loads on a shaft that stands", ("load of*",)),
    ("what would fill memory, or cannot be met", ("100 000 turns with*", "rtol 1e-14")),
    ("ensembles in lanes at these edges", ("* side by side*", "members that fail*", "rings of 1 mg*")),
    ("sensitivities at these edges", ("derivatives *",)),
    ("outputs and equilibria at these edges", ("outputs, *", "equilibria*")),
    ("conditioning of A(q)", ("A(q)*", "crank over rod 1 - 1e-9")),
    ("generated C: warnings, sanitizers, two compilers", ("-Wall*", "exported*", "planted*", "section*", "gcc and*")),
)  # fmt: skip


def answering(patterns: Sequence[str], cases: Iterable[Case]) -> list[Case]:
    """Cases whose name fits one of the patterns."""
    return [case for case in cases if any(fnmatchcase(case.name, pattern) for pattern in patterns)]


def table(rows: Sequence[Row]) -> list[str]:
    """Markdown: edge, the cases that go there, how many of them hold."""
    lines = ["| asked for | cases | hold |", "| --- | --- | ---: |"]
    for item, patterns in ITEMS:
        names = {case.name for case in answering(patterns, (row.case for row in rows))}
        of = [row for row in rows if row.case.name in names]
        listed = "; ".join(dict.fromkeys(row.case.name for row in of))
        lines.append(f"| {item} | {listed} | {sum(row.holds for row in of)} of {len(of)} |")
    return lines
