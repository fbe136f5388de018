"""Words, tables and plain numbers of periodic states: kind of stability, branches, contacts.

In: multipliers, branches, contact signatures.  Out: parts of a report.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.motion.contact_sequence import GRAZES, ContactSequence
from ballpass.runtime.motion.continuation import SteadyBranch
from ballpass.runtime.report.report import ReportTable

#: A multiplier is on the unit circle within this [1].
ON_CIRCLE = 1e-6

#: Most changes of contacts of a branch that a table lists; JSON lists all.
LISTED = 10

#: So many special points within this share of the range are said to be crowded [1].
CROWD, CROWDED = 8, 0.05


def kind_of(multipliers: np.ndarray) -> str:
    """Stability in words."""
    out = [m for m in multipliers.tolist() if abs(m) > 1.0 + ON_CIRCLE]
    on = [m for m in multipliers.tolist() if abs(abs(m) - 1.0) <= ON_CIRCLE]
    if on:
        names = {"fold or branch point": 1.0, "period doubling": -1.0}
        near = [name for name, place in names.items() if any(abs(m - place) <= ON_CIRCLE for m in on)]
        return f"at a bifurcation: {' and '.join(near) or 'Neimark-Sacker point'}"
    if not out:
        return "stable"
    kinds = {
        "a real multiplier above 1, as behind a fold": any(not m.imag and m.real > 0.0 for m in out),
        "a real multiplier below -1, as behind a period doubling": any(not m.imag and m.real < 0.0 for m in out),
        "a complex pair outside the unit circle, as behind a Neimark-Sacker point": any(m.imag for m in out),
    }
    return f"unstable: {'; '.join(words for words, holds in kinds.items() if holds)}"


def complex_words(m: complex) -> str:
    """A multiplier."""
    return f"{m.real:.6g} ± {abs(m.imag):.6g} i (size {abs(m):.9g})" if m.imag else f"{m.real:.9g}"


def complex_facts(m: complex) -> dict[str, float]:
    """A multiplier, for JSON."""
    return {"real": m.real, "imaginary": m.imag, "magnitude": abs(m)}


def contact_words(contacts: ContactSequence) -> str:
    """A signature, and whether it is near another one."""
    words = f"Contacts in a period, balls or rollers by number: {contacts.words}"
    if not contacts.grazes:
        return words
    return (
        f"{words}. Near grazing: a deflection has an extreme of {contacts.margin:.1e} of the largest one. "
        "Multipliers hold for changes too small to open or close that contact."
    )


def contact_facts(contacts: ContactSequence) -> dict[str, Any]:
    """A signature, for JSON."""
    return {
        "touching": list(contacts.touching[0]),
        "order": list(contacts.order),
        "count": contacts.count,
        "margin": contacts.margin if np.isfinite(contacts.margin) else None,
        "grazes": contacts.grazes,
    }


def branch_table(branches: Sequence[SteadyBranch], over: ParameterRange, resolution: float) -> ReportTable:
    """Ends of the branches, the points at which the kind of the states changes, and where contacts do.

    Parameters
    ----------
    resolution : size below which a multiplier is not known from zero
    """
    rows = []
    for branch in branches:
        listed = {id(one): other for one, other in branch.contact_changes[:LISTED]}
        unlocated = {id(one): other for one, other in branch.unlocated}
        for k, point in enumerate(branch.points):
            what = point.kind or {0: "first point", len(branch.points) - 1: "last point"}.get(k)
            value = f"{point.value / over.factor:.9g}"
            first = complex(point.multipliers[0])
            largest = f"{abs(first):.6g}, of a pair" if first.imag else complex_words(first)
            if abs(first) <= resolution:
                largest = f"below {resolution:.0e}"
            if what:
                rows.append((str(branch.repeats), value, what, largest))
            if id(point) in listed:
                behind = f"{listed[id(point)].value / over.factor:.9g}"
                rows.append((str(branch.repeats), f"{value} to {behind}", "contacts change", ""))
            if id(point) in unlocated:
                behind = f"{unlocated[id(point)].value / over.factor:.9g}"
                rows.append((str(branch.repeats), f"{value} to {behind}", "stability changes, not located", ""))
    value = f"value, {printed_unit(over.shown_unit)}"
    return ReportTable(
        title=f"Branches over {over.name}",
        heads=("period", value, "what", "largest multiplier"),
        rows=rows,
        right=("period", value, "largest multiplier"),
    )


def branch_words(branch: SteadyBranch) -> str:
    """How long a branch is, why it ends, and how often contacts change on it."""
    words = f"branch of period {branch.repeats}: {len(branch.points)} points, ends {branch.ended}"
    changes = len(branch.contact_changes)
    if not changes:
        return f"{words}; contacts of all: {branch.points[0].contacts.words}"
    shown = f", of which the table has the first {LISTED}" if changes > LISTED else ""
    return f"{words}; contacts change in {changes} of {len(branch.points) - 1} steps{shown}"


def early_end(branch: SteadyBranch, over: ParameterRange) -> str:
    """Why and where a branch ends within its range, and what crowds there."""
    unit = printed_unit(over.shown_unit)
    words = (
        f"The branch ends {branch.ended}, at {branch.points[-1].value / over.factor:.6g} {unit}, and does not reach "
        "the end of the range."
    )
    places = [point.value for point in branch.special][-CROWD:]
    if len(places) < CROWD or np.ptp(places) > CROWDED * abs(over.high - over.low):
        return words
    return (
        f"{words} It has {len(branch.special)} folds, doublings and other changes, and the last {CROWD} lie between "
        f"{min(places) / over.factor:.6g} and {max(places) / over.factor:.6g} {unit}: branches wind so where motion is "
        "chaotic. On which motion runs end there: ballpass bifurcation."
    )


def branch_facts(branch: SteadyBranch) -> dict[str, Any]:
    """A branch, for JSON."""
    return {
        "repeats": branch.repeats,
        "ended": branch.ended,
        "events": [
            {
                "kind": "contacts change",
                "between": [one.value, other.value],
                "before": contact_facts(one.contacts),
                "after": contact_facts(other.contacts),
            }
            for one, other in branch.contact_changes
        ]
        + [{"kind": "stability changes", "between": [a.value, b.value]} for a, b in branch.unlocated],
        "points": [
            {
                "value": point.value,
                "kind": point.kind,
                "stable": point.stable,
                "start": point.nodes[0].tolist(),
                "multipliers": [complex_facts(m) for m in point.multipliers.tolist()],
                "contacts": contact_facts(point.contacts),
            }
            for point in branch.points
        ],
    }


def grazing_warnings(branch: SteadyBranch, over: ParameterRange) -> list[str]:
    """A word where a branch passes a contact that grazes: that Newton's iteration is not to be trusted across it."""
    # two contacts may change their order without grazing
    passed = [pair for pair in branch.contact_changes if pair[0].contacts.count != pair[1].contacts.count]
    near = [point for point in branch.points if point.contacts.grazes]
    if not passed and not near:
        return []
    found = []
    if passed:
        one, other = (point.value / over.factor for point in passed[0])
        found.append(
            f"contacts are added or lost in {len(passed)} of {len(branch.points) - 1} steps (first: {one:.9g} to "
            f"{other:.9g} {printed_unit(over.shown_unit)})"
        )
    if near:
        found.append(f"{len(near)} points have an extreme of a deflection below {GRAZES:g} of the largest one")
    return [
        f"Branch of period {branch.repeats}: {'; '.join(found)}. A contact grazes there: derivatives of the force jump "
        "or are unbounded. Do not trust Newton's iteration, multipliers and located points across it; check them by "
        "runs on both sides."
    ]
