"""The answer of a fit: numbers with their intervals, signals beside the measured ones, and its report."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.units import printed_unit, table_unit
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.short import ShortRepr

if TYPE_CHECKING:
    from ballpass.runtime.fit.undetermined import UndeterminedGroup

#: Differences from quantities in their deviations from which on the report warns of them [1].
FAR = 3.0

#: Differences below this share of a signal's rms, or deviations of a number, are rounding [1].
ROUNDING = 1e-12

#: Correlation of two unknowns from which on the report names it.
CORRELATED = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedNumber:
    """A number that was found, SI.

    Attributes
    ----------
    name, unit : what it is
    kind : ``parameter``, or of the measurement ``shift``, ``gain``, ``offset``
    value : NaN where the data do not determine it
    deviation : standard deviation; NaN likewise, and where a bound holds it
    low, high : 95 % interval; NaN likewise, and for a profile that ends at a bound
    held : ``first`` or ``second`` where that end of its range holds it, else empty
    shown_unit, factor : unit for people, and its size

    Examples
    --------
    >>> run = model.simulate(duration=0.05, sample_rate=10e3)
    >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
    >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
    >>> (number,) = model.fit(data, "bearing.clearance=5 um:30 um").numbers
    >>> number.low < 10e-6 < number.high, number.unit
    (True, 'm')
    """

    name: str
    unit: str
    kind: str
    value: float
    deviation: float
    low: float
    high: float
    held: str
    shown_unit: str
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedSignal:
    """A measured signal, spectrum or quantities, and the model's.

    Attributes
    ----------
    name, unit : of the signal
    axis : ``time``, ``frequency``, or ``quantity``
    t : times as recorded [s], or frequencies [Hz], or numbers of quantities, shape (samples,)
    measured, model : samples, of the same shape; of quantities over their deviations, or else over the measured values
    noise : deviation of the differences, by the median for a robust loss
    correlation : of differences with the next one [1]

    Examples
    --------
    >>> run = model.simulate(duration=0.05, sample_rate=10e3)
    >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
    >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
    >>> (signal,) = model.fit(data, "bearing.clearance=5 um:30 um").signals
    >>> 0.8e-8 < signal.noise < 1.2e-8, signal.unit
    (True, 'm')
    """

    name: str
    unit: str
    axis: str
    t: np.ndarray
    measured: np.ndarray
    model: np.ndarray
    noise: float
    correlation: float

    @property
    def white(self) -> bool:
        """Whether differences look independent of each other, as intervals assume.

        Examples
        --------
        >>> run = model.simulate(duration=0.05, sample_rate=10e3)
        >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
        >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
        >>> model.fit(data, "bearing.clearance=5 um:30 um").signals[0].white
        True
        """
        return self.axis == "quantity" or self.exact or abs(self.correlation) < 4.0 / math.sqrt(len(self.t))

    @property
    def exact(self) -> bool:
        """Whether nothing but rounding is left of the differences.

        Examples
        --------
        >>> run = model.simulate(duration=0.05, sample_rate=10e3)
        >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
        >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
        >>> model.fit(data, "bearing.clearance=5 um:30 um").signals[0].exact
        False
        """
        return bool(self.noise <= ROUNDING * np.sqrt(np.mean(self.measured**2)))

    def unexplained(self, unknowns: int) -> bool:
        """Whether the differences are as large as the signal's own deviation about its mean, or larger.

        Parameters
        ----------
        unknowns : of the fit: so many more or less explain something of any noise

        Examples
        --------
        >>> run = model.simulate(duration=0.05, sample_rate=10e3)
        >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
        >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
        >>> model.fit(data, "bearing.clearance=5 um:30 um").signals[0].unexplained(1)
        False
        """
        samples = len(self.t)
        if self.axis == "quantity":
            return False
        return bool(self.noise**2 * (samples - 1) >= np.var(self.measured) * (samples - unknowns))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class FitAnswer(ShortRepr, Reported):
    """Parameters that fit measured signals best.

    Attributes
    ----------
    numbers : parameters, then shifts, gains and offsets
    correlations : of the numbers, NaN for those without a deviation, shape (numbers, numbers)
    undetermined : groups of numbers that the data do not determine
    signals : measured and fitted
    starts : values of the parameters where each search began, and the misfit where it ended
    rivals : values of the parameters of other searches that fit as well within the noise
    loss, profile, rtol : as asked for
    converged : whether the best search ended by itself
    notes : how the files were read

    Examples
    --------
    >>> wide = {"bearing.clearance": 13e-6}
    >>> run = model.simulate(duration=0.05, sample_rate=10e3, parameters=wide)
    >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
    >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
    >>> found = model.fit(data, "bearing.clearance=5 um:30 um")
    >>> abs(found.numbers[0].value - 13e-6) < 3.0 * found.numbers[0].deviation < 1e-8
    True
    """

    numbers: tuple[FittedNumber, ...]
    correlations: np.ndarray
    undetermined: tuple[UndeterminedGroup, ...]
    signals: tuple[FittedSignal, ...]
    starts: tuple[tuple[tuple[float, ...], float], ...]
    rivals: tuple[tuple[float, ...], ...]
    loss: str
    profile: bool
    rtol: float
    converged: bool
    notes: tuple[str, ...] = ()

    def _report(self) -> Report:
        samples = sum(len(one.t) for one in self.signals)
        table = ReportTable(
            title=f"Fit to {samples} samples of {', '.join(one.name for one in self.signals)}",
            heads=("number", "value", "deviation", "95 % interval", "unit"),
            rows=[_row(one) for one in self.numbers],
            right=("value", "deviation"),
            wrapped=("number",),
            caption="intervals by profiles of the misfit" if self.profile else "",
        )
        said = list(self.notes)
        for one in self.undetermined:
            said.append(one.words)
            if one.combination:
                said.append(
                    f"Determined is {one.combination} = {one.value:.6g} in SI, ± {rounded(100.0 * one.deviation, 2)} %."
                )
        said += [
            f"Differences of {one.name}: {one.noise:.3g} of their deviations, or of values without one"
            if one.axis == "quantity"
            else f"Noise of {one.name}: none, but for rounding"
            if one.exact
            else f"Noise of {one.name}: {_shown(one.noise, one.unit)}, "
            f"{rounded(100.0 * one.noise / float(np.std(one.measured)), 2)} % of the signal"
            for one in self.signals
        ]
        pairs = np.argwhere(np.triu(np.abs(np.nan_to_num(self.correlations)), 1) > CORRELATED)
        said += [
            f"{self.numbers[i].name} and {self.numbers[j].name}: correlation {self.correlations[i, j]:.3f}"
            for i, j in pairs.tolist()
        ]
        if len(self.starts) > 1:
            ends = ", ".join(f"{end:.4g}" for _, end in self.starts)
            said.append(
                f"{len(self.starts)} starts ended with these mean squares of the differences over the noise (1: noise "
                f"alone is left): {ends}"
            )
        warned = []
        if self.rivals:
            listed = "; ".join(", ".join(f"{value:.6g}" for value in rival) for rival in self.rivals)
            warned.append(
                f"Other values fit as well within the noise, SI: {listed}. The intervals do not reach to them. Give "
                "narrower bounds, more data, or a part of the record that depends less on its start."
            )
        warned += [
            f"{one.name} is held by the {one.held} end of its range: the data ask for a number beyond it, and "
            "others are fitted to that end. Give wider bounds, unless no such thing can be."
            for one in self.numbers
            if one.held
        ]
        nothing = [one.name for one in self.signals if one.unexplained(len(self.numbers))]
        warned += [
            f"{name}: the differences are as large as the signal's own deviation about its mean, or larger. The model "
            "explains nothing of it: check its column, its unit and the time of its start (begin), or give wider "
            "bounds, more starts or a shift."
            for name in nothing
        ]
        warned += [
            f"{one.name}: each difference is correlated with the next one ({one.correlation:.2f}). Intervals hold for "
            "white noise: the model leaves something out, or the noise is filtered. They are too narrow then."
            for one in self.signals
            if not one.white
        ]
        warned += [
            f"{one.name}: the model differs by {one.noise:.3g} of their deviations. It leaves something out, the "
            "deviations are too small, or the search ended elsewhere: give more starts or narrower bounds."
            for one in self.signals
            if one.axis == "quantity" and one.noise > FAR
        ]
        records = [asdict(one) for one in self.numbers]
        facts = {
            "numbers": records,
            "correlations": self.correlations.tolist(),
            "undetermined": [asdict(one) for one in self.undetermined],
            "signals": [
                {
                    "name": one.name,
                    "unit": one.unit,
                    "samples": len(one.t),
                    "noise": one.noise,
                    "correlation": one.correlation,
                }
                for one in self.signals
            ],
            "starts": [{"start": list(start), "end": end, "units": {"end": "1"}} for start, end in self.starts],
            **self._named("rivals", "loss", "profile", "rtol", "converged", "notes"),
        }
        fault = "" if self.converged else "The search did not end by itself. Give narrower bounds or more starts."
        if nothing:
            fault = f"The model explains nothing of {', '.join(nothing)}: no number of this fit can be relied on."
        return Report(parts=(table, *said), facts=facts, records=records, index=("name",), warnings=warned, fault=fault)


def _shown(value: float, unit: str) -> str:
    factor, shown_unit = table_unit(unit)
    return f"{factor * value:.3g} {shown_unit}"


def _row(one: FittedNumber) -> tuple[str, ...]:
    if math.isnan(one.value):
        return one.name, "", "", "not determined", ""
    if one.held:
        return one.name, f"{one.value / one.factor:.6g}", "", "end of its range", printed_unit(one.shown_unit)
    if one.deviation <= ROUNDING * abs(one.value):
        return one.name, f"{one.value / one.factor:.13g}", "0", "no noise", printed_unit(one.shown_unit)
    digits = max(3, 3 + math.floor(math.log10(max(abs(one.value) / one.deviation, 1.0))))
    low, value, high = (
        "bound" if math.isnan(number) else f"{number / one.factor:.{digits}g}"
        for number in (one.low, one.value, one.high)
    )
    return one.name, value, f"{one.deviation / one.factor:.3g}", f"{low} to {high}", printed_unit(one.shown_unit)
