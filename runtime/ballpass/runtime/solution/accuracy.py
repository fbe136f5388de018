"""Record of a run to a named error: request, choice and result; `ballpass.runtime.certify.error_target` makes it."""

from __future__ import annotations

from dataclasses import dataclass

from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.show.short import ShortRepr


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Accuracy(ShortRepr):
    """Request, choice and result of a run to a named error.

    Attributes
    ----------
    target : relative error asked for [1]
    estimate : of the worst quantity of this run [1]
    of : quantities
    values : of the quantities, in SI
    estimates : of each quantity [1]
    method, rtol, kinks : chosen
    check : words for the second run: method, tolerance, kinks
    tried : choices that were integrated before and did not meet the target, in words, with their estimates
    time : of the chosen integration [s]
    check_time : of all others [s]

    Examples
    --------
    >>> accuracy = model.simulate(cycles=3, error=1e-2).accuracy
    >>> accuracy.estimate < accuracy.target, accuracy.of
    (True, ('peak_ball_force', 'rms_inner_x', 'rms_inner_y', 'range_inner_x', 'range_inner_y'))
    """

    target: float
    estimate: float
    of: tuple[str, ...]
    values: dict[str, float]
    estimates: dict[str, float]
    method: str
    rtol: float
    kinks: str
    check: str
    tried: tuple[tuple[str, float], ...]
    time: float
    check_time: float

    @property
    def words(self) -> str:
        """One paragraph on choice and cost; `values` and `estimates` are a table of their own."""
        worst = max(self.estimates, key=lambda name: self.estimates[name])
        after = f", after {len(self.tried)} other ways" if self.tried else ""
        return (
            f"error asked for {100 * self.target:g} %, estimated {rounded(100 * self.estimate, 2)} % (worst: "
            f"{worst}) by {self.method} at rtol {self.rtol:g}, against a second whole run: "
            f"{self.check}. Integrated in {1e3 * self.time:.3g} ms; {1e3 * self.check_time:.3g} ms more went into the "
            f"estimate{after}."
        )
