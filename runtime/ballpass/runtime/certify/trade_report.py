"""The report of a trade: a table of the choices that no other one beats, sentences, plain data.

In: nothing but numbers.  Out: `Trade`, its report, its rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from ballpass.runtime.certify.method_choice import MethodChoice
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.request.locating import LOCATED
from ballpass.runtime.show.short import ShortRepr

#: Usual target errors [1].
TARGETS = (0.1, 0.01, 0.001, 0.0001)

#: Part of the members whose error is at most what is promised.
PROMISED = 0.95


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Measured(ShortRepr):
    """Results of one choice of method, tolerance and kinks.

    Attributes
    ----------
    way : how it was integrated
    time : median over the members, of the integration of one cycle [s]
    median, promised : relative error of each quantity: median and 95 % point over the members, none below the
        reference's uncertainty [1]
    failures : members it could not finish
    """

    way: MethodChoice
    time: float
    median: Mapping[str, float]
    promised: Mapping[str, float]
    failures: int


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Trade(Reported):
    """Accuracy against time on one scene.

    Attributes
    ----------
    scene, title : of the scene
    quantities : what errors are measured of
    meanings : of the quantities, by name
    values : of the quantities, medians over the members, in SI
    uncertainty : relative, of the reference: 95 % point of the difference of two methods [1]
    members : parameter sets
    spread : half the width of the interval they are drawn from [1]
    cycles : turns of a run
    measured : all ways
    units : of the quantities, by name
    """

    scene: str
    title: str
    quantities: tuple[str, ...]
    values: Mapping[str, float]
    uncertainty: Mapping[str, float]
    members: int
    spread: float
    cycles: float
    measured: tuple[Measured, ...]
    meanings: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"Trade({self.scene}: {len(self.measured)} ways, {self.members} members; quantities: "
            f"{', '.join(self.quantities)})"
        )

    def error(self, one: Measured, quantity: str | None = None) -> float:
        """95 % point of a quantity's error; of the worst quantity where none is named."""
        return max(one.promised.values()) if quantity is None else one.promised[quantity]

    def _report(self) -> Report:
        heads, rows = table(self, self.quantities[0])
        best = ReportTable(
            title=f"{self.title}: the fastest at each error of {self.quantities[0]}",
            heads=heads,
            rows=rows,
            right=heads[:-1],
            wrapped=heads[-1:],
            caption="\n".join(
                [
                    f"{self.members} members, scenes with other numbers, of {self.cycles:g} turns each",
                    "way: method and its relative tolerance (rtol); kinks located: steps end where a contact opens",
                    *(f"{name}: {words}" for name, words in self.meanings.items()),
                ]
            ),
        )
        records = [
            {**asdict(one.way), "time": one.time, "failures": one.failures, "error": self.error(one), **one.promised}
            for one in self.measured
        ]
        said = words(self)
        return Report(
            parts=(best, *said),
            facts={"trade": asdict(self), "words": said, "units": {"uncertainty": "1"}},
            records=records,
        )

    def front(self, quantity: str | None = None) -> tuple[Measured, ...]:
        """Ways that no other beats in both error and time, from cheap to accurate."""
        found: list[Measured] = []
        for one in sorted(self.measured, key=lambda m: (m.time, self.error(m, quantity))):
            error = self.error(one, quantity)
            if math.isfinite(error) and (not found or error < self.error(found[-1], quantity)):
                found.append(one)
        return tuple(found)

    def cheapest(self, target: float, quantity: str | None = None) -> Measured | None:
        """The fastest way whose error is within the target for 95 % of the members; None where none is."""
        fit = [one for one in self.measured if self.error(one, quantity) <= target]
        return min(fit, key=lambda m: m.time) if fit else None


def words(trade: Trade) -> list[str]:
    """Time for each target and quantity, and time and error with located kinks."""
    columns: list[tuple[str, str | None]] = [(name, name) for name in trade.quantities]
    if len(columns) > 1:
        columns.append(("all of them", None))
    said = []
    for name, quantity in columns:
        for target in TARGETS:
            one = trade.cheapest(target, quantity)
            if one is None:
                best = min(trade.measured, key=lambda m, q=quantity: trade.error(m, q))  # type: ignore[misc]
                said.append(
                    f"{percent(target)} on {name}: nothing measured here; the best is "
                    f"{percent(trade.error(best, quantity))} ({best.way.words})."
                )
            else:
                said.append(f"{percent(target)} on {name}: {milliseconds(one.time)} a cycle ({one.way.words}).")
    known = ", ".join(f"{name} {percent(value)}" for name, value in trade.uncertainty.items())
    said.append(
        f"The reference, two methods that agree, is known to: {known}. Smaller errors cannot be measured with it."
    )
    return said + _located(trade)


def _located(trade: Trade) -> list[str]:
    known = {one.way: one for one in trade.measured}
    pairs = []
    for way, one in known.items():
        plain = known.get(MethodChoice(method=way.method, rtol=way.rtol)) if way.kinks == LOCATED else None
        if plain is not None and math.isfinite(one.time) and math.isfinite(plain.time):
            pairs.append((one, plain))
    if not pairs:
        return []
    longer = sorted(one.time / plain.time for one, plain in pairs)[len(pairs) // 2]
    one, plain = min(pairs, key=lambda pair: pair[0].way.rtol)
    return [
        f"Ending steps on the kinks of the laws takes {longer:.2g} times the time at the same tolerance; at "
        f"{one.way.method}, rtol {one.way.rtol:g}, the worst error is {percent(trade.error(one))}, without "
        f"{percent(trade.error(plain))}."
    ]


def table(trade: Trade, quantity: str | None = None) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows of a front: error, time, way."""
    head: tuple[str, ...] = (f"error ({PROMISED:.0%} of runs)", "median error", "time a cycle", "way")
    rows: list[tuple[str, ...]] = []
    for one in trade.front(quantity):
        median = max(one.median.values()) if quantity is None else one.median[quantity]
        rows.append((percent(trade.error(one, quantity)), percent(median), milliseconds(one.time), one.way.words))
    return head, rows


def percent(error: float) -> str:
    """A relative error as text: 1 %, 0.02 %, 3e-05 %."""
    if not math.isfinite(error):
        return "no result"
    value = 100.0 * error
    return f"{rounded(value, 2)} %" if value < 100.0 else f"{value:.0f} %"


def milliseconds(seconds: float) -> str:
    """A time as text."""
    return f"{1e3 * seconds:.2g} ms" if seconds < 0.1 else f"{1e3 * seconds:.0f} ms"
