"""The report of a query of sensitivities: values, derivatives with their certificates, warnings.

In: nothing but numbers.  Out: `SensitivityReport`, which gives JSON and tables.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from ballpass.runtime.certify.certificate import Check, Verdict
from ballpass.runtime.certify.dimensions import Identity
from ballpass.runtime.certify.grazing import Grazing, describe, merge_grazing
from ballpass.runtime.contract.method_registry import NOT_INTEGRATED
from ballpass.runtime.contract.parameters import check_name
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.quantity.values import QuantityValue
from ballpass.runtime.ratings.elements import element_words
from ballpass.runtime.report.report import Marked, Report, ReportTable, Words
from ballpass.runtime.report.reported import Reported

#: Grazing places that are listed; the JSON has all.
LISTED = 3

#: The route of derivatives of the stepper's own steps.
STEPS = "steps"

#: Rows of each section of a table; pairs that disagree are always there, and the JSON has all.
ROWS = 15

#: Verdicts in words.
_LOOKS: dict[Verdict, Literal["good", "bad", "doubt"]] = {
    Verdict.VERIFIED: "good",
    Verdict.DISAGREES: "bad",
    Verdict.NOT_CHECKED: "doubt",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """Derivative of one quantity by one parameter.

    Attributes
    ----------
    quantity, parameter : names
    value, parameter_value, quantity_unit, parameter_unit : numbers and their units
    derivative, unit : dQ/dp, by the route that is known better; NaN where nothing is known: neither is verified, and
        they have no digit in common
    dimensionless : (p/Q) dQ/dp; NaN where p or Q is zero: there it says nothing of the parameter's effect
    scale : change of the parameter that is a large one, in its unit: its value; for an angle a radian; where it is
        zero, what positions move by in the run, or the largest value of its unit
    uncertainty : of the derivative, same unit: eight times its distance from that of a run at a looser tolerance, and
        from the difference of both routes' values of the quantity; None where the check was turned off
    route : the route that gave the derivative: ``steps``, or that of the check
    by_steps : derivative of the steps, same unit
    check : the certificate
    """

    quantity: str
    parameter: str
    value: float
    parameter_value: float
    quantity_unit: str
    parameter_unit: str
    derivative: float
    unit: str
    dimensionless: float
    scale: float
    uncertainty: float | None
    route: str
    by_steps: float
    check: Check

    @property
    def is_nothing(self) -> bool:
        """Whether the check only shows that the derivative is below the bound that counts as zero."""
        return self.check.is_nothing(self.derivative)

    @property
    def change(self) -> float:
        """Change of the quantity per `scale` of the parameter, in the quantity's unit."""
        return self.derivative * self.scale


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SensitivityReport(Reported):
    """Answer to a query: every pair, with its certificate.

    Attributes
    ----------
    scene : name
    quantities : values
    parameters : names
    words : description of each quantity and parameter, by name
    pairs : quantity by quantity, parameters in order
    grazing : where the trajectory grazes a kink
    elements : kinds of the bearings' rolling elements
    settings : cycles, transient, method that ran, kinks, tolerances, steps
    identities : of dimensions, where derivatives are by all parameters

    Examples
    --------
    >>> names = "bearing.outer_ring.*"
    >>> report = model.sensitivity("rms:inner.y", names, cycles=3, check=False)
    >>> report.parameters
    ('bearing.outer_ring.mass', 'bearing.outer_ring.stiffness', 'bearing.outer_ring.damping')
    >>> report["rms:inner.y", "bearing.outer_ring.mass"].unit
    'm/kg'
    """

    scene: str
    quantities: tuple[QuantityValue, ...]
    parameters: tuple[str, ...]
    words: Mapping[str, str]
    pairs: tuple[Sensitivity, ...]
    grazing: tuple[Grazing, ...]
    settings: Mapping[str, Any]
    identities: tuple[Identity, ...] = ()
    elements: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line."""
        verdicts = ", ".join(f"{count} {verdict.value}" for verdict, count in self.verdicts.items() if count)
        return (
            f"SensitivityReport({self.scene!r}: {len(self.quantities)} quantities by {len(self.parameters)} "
            f"parameters, {verdicts})"
        )

    def __getitem__(self, key: tuple[str, str]) -> Sensitivity:
        """The pair of a quantity and a parameter.

        Examples
        --------
        >>> report = model.sensitivity("rms:inner.y", "bearing.clearance", cycles=3, check=False)
        >>> f"{report['rms:inner.y', 'bearing.clearance'].dimensionless:.3f} % per %"
        '0.617 % per %'
        """
        quantity, parameter = key
        names = [item.name for item in self.quantities]
        check_name("quantity of this report", quantity, names)
        check_name("parameter of this report", parameter, self.parameters)
        return self.pairs[names.index(quantity) * len(self.parameters) + self.parameters.index(parameter)]

    def of(self, quantity: str) -> tuple[Sensitivity, ...]:
        """Pairs of one quantity, ranked by the size of the dimensionless derivative.

        After them come those that have none, because parameter or quantity is zero, ranked by the change per `scale`.

        Examples
        --------
        >>> lengths = ["mechanism.bodies.crank.points.B", "bearing.clearance"]
        >>> report = model.sensitivity("rms:inner.y", lengths, cycles=3, check=False)
        >>> [pair.parameter for pair in report.of("rms:inner.y")]
        ['bearing.clearance', 'mechanism.bodies.crank.points.B']
        """
        pairs = [self[quantity, name] for name in self.parameters]
        return tuple(sorted(pairs, key=_rank))

    @property
    def verdicts(self) -> dict[Verdict, int]:
        """How many pairs have each verdict."""
        return {verdict: sum(pair.check.verdict is verdict for pair in self.pairs) for verdict in Verdict}

    @property
    def disagreements(self) -> tuple[Sensitivity, ...]:
        """Pairs whose two routes disagree."""
        return tuple(pair for pair in self.pairs if pair.check.verdict is Verdict.DISAGREES)

    def _report(self) -> Report:
        numbers = ("quantity", "parameter", "value", "parameter_value", "derivative", "unit", "dimensionless")
        common = [{name: getattr(pair, name) for name in (*numbers, "uncertainty")} for pair in self.pairs]
        pairs = list(zip(self.pairs, common, strict=True))
        return Report(
            parts=[*(_table(self, quantity) for quantity in self.quantities), *_remarks(self)],
            facts={
                "scene": self.scene,
                "settings": dict(self.settings),
                "verdicts": {verdict.value: count for verdict, count in self.verdicts.items()},
                "quantities": [asdict(item) for item in self.quantities],
                "sensitivities": [known | _facts(pair) for pair, known in pairs],
                "identities": [asdict(one) | {"holds": one.holds} for one in self.identities],
                "grazing": [
                    {name: value for name, value in asdict(item).items() if name != "bearing"}
                    | {"units": {"ball": "1", "depth": "m" if item.kink == "contact" else "m/s"}}
                    for item in self.grazing
                ],
            },
            records=[known | {"verdict": pair.check.verdict.value} for pair, known in pairs],
            index=("quantity", "parameter"),
            fault=self._fault(),
        )

    def _fault(self) -> str:
        if not self.disagreements:
            broken = [str(words) for words in _dimension_words(self.identities) if isinstance(words, Marked)]
            return "\n".join([*broken, "Do not rely on these derivatives."]) if broken else ""
        first = self.disagreements[0]
        return (
            f"{len(self.disagreements)} of {len(self.pairs)} derivatives disagree with their second route, "
            f"{first.check.route}, first d({first.quantity})/d({first.parameter}): {first.by_steps:.9g} and "
            f"{_number(first.check.value)} {printed_unit(first.unit)}. "
            "Do not rely on them; take a tighter --rtol and --sensitivity-rtol, or fewer turns."
        )


def _facts(pair: Sensitivity) -> dict[str, Any]:
    """Texts of a pair in the JSON, beside its numbers."""
    check = pair.check
    return {
        "units": dict.fromkeys(("value", "change_per_scale"), pair.quantity_unit)
        | dict.fromkeys(("parameter_value", "parameter_scale"), pair.parameter_unit),
        "parameter_scale": pair.scale,
        "change_per_scale": pair.change,
        "route": pair.route,
        "by_steps": pair.by_steps,
        "certificate": {
            "units": {"value": pair.unit},
            "route": check.route,
            "value": check.value,
            "uncertainty": check.uncertainty,
            "disagreement": check.disagreement,
            "verdict": check.verdict.value,
            "nothing": pair.is_nothing,
            "within_bound_only": check.bounded,
            "bound": check.quantum,
            "reason": check.reason,
            "slopes_at_kink": check.sides,
        },
    }


def _rank(pair: Sensitivity) -> tuple[bool, float]:
    """Sort key: those with a dimensionless derivative first, larger ones first, NaN last."""
    has_one = math.isfinite(pair.dimensionless)
    size = pair.dimensionless if has_one else pair.change
    return not has_one, -abs(size) if math.isfinite(size) else 1.0


def _table(report: SensitivityReport, quantity: QuantityValue) -> ReportTable:
    """Parameters ranked by the size of the dimensionless derivative.

    Parameters that are zero have none and stand apart, ranked by the derivative times a natural change of them.
    Verdicts have a column where they are not all the same.
    """
    ranked = report.of(quantity.name)
    zero = [pair for pair in ranked if pair.value == 0.0 or pair.parameter_value == 0.0]
    judged = any(pair.check.verdict is not Verdict.VERIFIED or _bounded(pair) for pair in ranked)
    rows = _rows([pair for pair in ranked if pair not in zero], judged=judged)
    sections = [len(rows)] if zero else []
    if zero:
        what = "quantity" if quantity.value == 0.0 else "parameter"
        rows += [(Marked(f"{what} is 0: no % per %", "head"),), *_rows(zero, judged=judged)]
    return ReportTable(
        title=_title(quantity, report.words.get(quantity.name, ""), element_words("ball", report.elements)),
        heads=("parameter", "% per %", "derivative", *(["verdict"] if judged else [])),
        rows=rows,
        right=("% per %",),
        wrapped=("derivative", "verdict"),
        caption="; ".join(quantity.notes),
        sections=sections,
    )


def _rows(ranked: Sequence[Sensitivity], *, judged: bool) -> list[tuple[Words, ...]]:
    """Rows of one section; of parameters without influence no more than a few."""
    shown: list[Sensitivity] = []
    smaller = nothing = 0
    for rank, pair in enumerate(ranked):
        if pair.check.verdict is Verdict.DISAGREES:
            shown.append(pair)
        elif pair.is_nothing and sum(one.is_nothing for one in shown) >= LISTED:
            nothing += 1
        elif rank < ROWS:
            shown.append(pair)
        else:
            smaller += 1
    more = [f"{smaller} more, smaller"] * bool(smaller) + [f"{nothing} more without influence, ~0"] * bool(nothing)
    return [*(_row(pair, judged=judged) for pair in shown), *((Marked(words, "faint"),) for words in more)]


def _bounded(pair: Sensitivity) -> bool:
    return pair.check.bounded and not pair.is_nothing


def _title(quantity: QuantityValue, described: str, noun: str) -> str:
    words = f"{described}\n{quantity.name} = {quantity.value:.6g} {printed_unit(quantity.unit)}"
    words = words.strip().removesuffix(" 1")
    if quantity.time is not None:
        words += f" at t = {quantity.time:.6g} s"
    if quantity.ball is not None:
        words += f", {noun} {quantity.ball}"
    return words


def _row(pair: Sensitivity, *, judged: bool) -> tuple[Words, ...]:
    check = pair.check
    relative = f"{pair.dimensionless:+z.4f}" if math.isfinite(pair.dimensionless) else "–"
    number, words = f"{pair.derivative:z.4g}", check.verdict.value
    if pair.is_nothing:
        # digits that no check verifies are not shown
        relative = "~0" if math.isfinite(pair.dimensionless) else relative
        number, words = f"~0 (<{check.quantum:.0e})", f"{words}: ~0"
    elif math.isnan(pair.derivative):
        number, words = "unknown", f"{words}: no digit in common"
    elif check.sides is not None:
        number, words = f"{check.sides[0]:z.4g} | {check.sides[1]:z.4g}", "kink: below | above"
    elif check.verdict is not Verdict.VERIFIED and pair.uncertainty is not None:
        number = _known(pair.derivative, pair.uncertainty)
        words += "" if pair.route == STEPS else f": by {pair.route}"
    elif check.bounded:
        words += f" to ±{check.quantum:.0e}"
    verdict = [Marked(words, _LOOKS[check.verdict])] if judged else []
    return (pair.parameter, relative, f"{number} {printed_unit(pair.unit)}", *verdict)


def _remarks(report: SensitivityReport) -> list[Words]:
    """Sentences below the tables."""
    counts = report.verdicts
    words = ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count)
    route = next((pair.check.route for pair in report.pairs if pair.check.route != "none"), None)
    nothing = sum(pair.is_nothing for pair in report.pairs)
    if nothing:
        words += f" ({nothing} of them ~0: both routes below the bound shown, no digit of the derivative is verified)"
    lines: list[Words] = [f"{len(report.pairs)} derivatives: {words}{_farthest(report, route)}"]
    lines.append(
        "% per %: by how many per cent the quantity grows when the parameter grows by one; derivatives in SI units, "
        "angles in radians"
    )
    lines += [
        Marked(
            "disagrees",
            "bad",
            f": d({pair.quantity})/d({pair.parameter}) is {pair.by_steps:.9g}, by "
            f"{pair.check.route} {_number(pair.check.value)} ± {_number(pair.check.uncertainty)} "
            f"{printed_unit(pair.unit)}",
        )
        for pair in report.disagreements
    ]
    lines += _dimension_words(report.identities)
    if report.settings["method"] == NOT_INTEGRATED:
        lines.append("all follows from the driver's angle: nothing is integrated")
    elif report.settings["sensitivity_rtol"] is not None:
        lines.append(
            "values of a run by {method}, relative tolerance {rtol:.0e}, kinks {kinks}, {steps} steps; "
            "derivatives at tolerance {sensitivity_rtol:.0e}".format(**report.settings)
        )
    reasons: dict[str, int] = {}
    for pair in report.pairs:
        if pair.check.verdict is Verdict.NOT_CHECKED and pair.check.reason:
            # numbers differ from pair to pair; the remedy is the same
            kind = pair.check.reason.split(" by ", 1)[0] + ": " + pair.check.reason.rsplit(": ", 1)[-1]
            kind = pair.check.reason if ": " not in pair.check.reason else kind
            if pair.check.sides is not None:
                kind = "a kink: the slopes on both sides are in the table"
            reasons[kind] = reasons.get(kind, 0) + 1
    lines += [Marked("not checked", "doubt", f", {count} pairs: {reason}") for reason, count in reasons.items()]
    if report.grazing:
        places = merge_grazing(report.grazing)
        count = f"{len(places)} place{'s' if len(places) > 1 else ''}"
        if len(places) < len(report.grazing):
            count += f" ({len(report.grazing)} counting each {element_words('ball', report.elements)})"
        more = f"; the first {LISTED} here, --json lists all" if len(places) > LISTED else ""
        words = f" at {count}: a small change moves the motion over a kink there{more}"
        lines.append(Marked("grazing", "doubt", words))
        lines += [f"  {element_words(describe(items), report.elements)}" for items in places[:LISTED]]
    return lines


def _dimension_words(identities: Sequence[Identity]) -> list[Words]:
    """Whether derivatives by all parameters agree with the unit of each quantity."""
    lines: list[Words] = [
        Marked(
            "disagrees",
            "bad",
            f": the sum of power times parameter times derivative of {one.quantity} over {one.base} is "
            f"{one.total:.9g}, and by its unit {one.expected:.9g}: {one.departure:.0e} of the largest term apart, "
            f"{one.stated:.0e} stated",
        )
        for one in identities
        if not one.holds
    ]
    if identities and not lines:
        bases = ", ".join(dict.fromkeys(one.base for one in identities))
        worst = max(identities, key=lambda one: one.departure)
        lines.append(
            f"units: over all parameters the derivatives add up as powers of {bases} ask, to {worst.departure:.0e} of "
            f"the largest term ({worst.stated:.0e} stated)"
        )
    return lines


def _farthest(report: SensitivityReport, route: str | None) -> str:
    """How far verified derivatives are from the second route, at most."""
    apart = [
        pair.check.disagreement / max(abs(pair.by_steps), abs(pair.check.value or 0.0))
        for pair in report.pairs
        if pair.check.verdict is Verdict.VERIFIED
        and pair.check.disagreement
        and not (pair.is_nothing or _bounded(pair))
    ]
    return f"; verified ones differ from {route} by at most {100.0 * max(apart):.0e} %" if apart else ""


def _known(value: float, uncertainty: float) -> str:
    """A number with its uncertainty, to the digits that this leaves, from two to seven."""
    digits = 2
    if value != 0.0 and 0.0 < uncertainty < abs(value):
        digits = min(max(math.ceil(math.log10(abs(value) / uncertainty)) + 1, 2), 7)
    return f"{value:.{digits}g} ± {uncertainty:.0e}"


def _number(value: float | None) -> str:
    return "no number" if value is None else f"{value:.9g}"
