"""The answer of a map: kinds of motion and largest exponents over the plane of two parameters.

In: motions at the points of a plane.  Out: `MotionMap`: its report, a table for pandas, NetCDF.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.motion.lyapunov import EXPONENT_WORDS
from ballpass.runtime.motion.map_points import NONE, PointMotions
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.solution.netcdf import Variable, netcdf_bytes

if TYPE_CHECKING:
    import xarray

#: Kinds that are no periods, in the order of tables.
_OTHERS = ("quasi-periodic", "chaotic", "undecided", NONE)

#: Most rows of the plane in the report, and most regions of one.
ROWS, REGIONS = 9, 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MotionMap(ShortRepr, Reported):
    """Motions over the plane of two parameters, each from the scene's start.

    Attributes
    ----------
    vary : the parameters and their ranges
    title : of the scene
    every : time between readings, in words
    motions : of the points, those of the second parameter after each other, each array of shape (points,)
    exponents : whether exponents were computed

    Examples
    --------
    >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8: a turn is a period
    >>> plane = ["bearing.clearance=5 um:10 um:2", "mechanism.driver.speed=60 rpm:100 rpm:2"]
    >>> found = model.bifurcation(plane, parameters=pitch, readings=20, exponent=False)
    >>> found.kinds.tolist()
    [['periodic 1', 'periodic 1'], ['periodic 1', 'periodic 1']]
    """

    vary: tuple[ParameterRange, ParameterRange]
    title: str
    every: str
    motions: PointMotions
    exponents: bool

    def _plane(self, values: np.ndarray) -> np.ndarray:
        return values.reshape([one.count for one in self.vary])

    @property
    def kinds(self) -> np.ndarray:
        """``periodic n``, ``quasi-periodic``, ``chaotic``, ``undecided`` or ``no motion``, shape (first, second)."""
        return self._plane(self.motions.kind)

    @property
    def exponent(self) -> np.ndarray:
        """Largest exponent per reading, NaN where there is none, shape (first, second) [1]."""
        return self._plane(self.motions.exponent)

    @property
    def half(self) -> np.ndarray:
        """Half of its interval, shape (first, second) [1]."""
        return self._plane(self.motions.half)

    def _report(self) -> Report:
        first, second = self.vary
        kinds, count = self.kinds, self.kinds.size
        columns: dict[str, Callable[[str], str]] = {
            "motion": str,
            ">points": lambda kind: str(np.count_nonzero(kinds == kind)),
            ">% of points": lambda kind: f"{100.0 * np.mean(kinds == kind):.3g}",
        }
        if self.exponents:
            columns["largest exponent per reading"] = lambda kind: self._span(kinds == kind)
        taken = self.motions.returns
        rate = f"; {taken[0]:.4g} periods integrated, {taken[0] / taken[1]:.2g} a second of a core" if taken[1] else ""
        overall = ReportTable.of(
            kinds_in(kinds),
            columns,
            title=f"Motion over {first.name} and {second.name}, read {self.every}",
            caption=f"{first.count} x {second.count} points, each from the scene's start{rate}",
        )
        unit = printed_unit(first.shown_unit)
        places = np.unique(np.linspace(0, second.count - 1, min(ROWS, second.count)).round().astype(int))
        along = ReportTable.of(
            places.tolist(),
            {
                f"{second.name}\n[{printed_unit(second.shown_unit)}]": lambda k: f"{second.shown[k]:.6g}",
                f"~motions over {first.name} [{unit}]": lambda k: _regions(first, kinds[:, k]),
            },
            title=f"Regions over {first.name}",
        )
        said = [EXPONENT_WORDS] if self.exponents else []
        for words in dict.fromkeys(sorted(filter(None, self.motions.open.tolist()))):
            number = np.count_nonzero(self.motions.open == words)
            decides = "What decides: " if np.any(self.motions.kind[self.motions.open == words] != NONE) else ""
            said.append(f"Without a kind: {number} of {count} points. {decides}{words}")
        said.append("Regions hold at the points themselves, whose distance limits where one ends.")
        facts = {
            "vary": [one.name for one in self.vary],
            "vary_unit": [one.unit for one in self.vary],
            "values": [one.values.tolist() for one in self.vary],
            "units": {"values": "SI", "half": "1"},
            **self._named("every"),
            **{name: getattr(self, name).tolist() for name in ("kinds", "exponent", "half")},
            "open": self._plane(self.motions.open).tolist(),
        }
        return Report(parts=(overall, along, *said), facts=facts)

    def _span(self, which: np.ndarray) -> str:
        """Exponents of some points."""
        known = which & np.isfinite(self.exponent)
        means, half = self.exponent[known], np.max(self.half[known], initial=0.0)
        if not len(means):
            return ""
        if len(means) == 1:
            return f"{means[0]:.3g} ± {half:.2g}"
        return f"{np.min(means):.3g} to {np.max(means):.3g}, ± {half:.2g} at most"

    def variables(self) -> dict[str, Variable]:
        """Variables of a NetCDF file, with units and descriptions; the parameters are dimensions.

        Examples
        --------
        >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8: a turn is a period
        >>> plane = ["bearing.clearance=5 um:10 um:2", "mechanism.driver.speed=60 rpm:100 rpm:2"]
        >>> found = model.bifurcation(plane, parameters=pitch, readings=20, exponent=False)
        >>> sorted(found.variables())
        ['bearing.clearance', 'kind', 'mechanism.driver.speed', 'open']
        """
        names = tuple(one.name for one in self.vary)
        found: dict[str, Variable] = {
            one.name: ((one.name,), one.values, {"units": one.unit, "long_name": one.words}) for one in self.vary
        }
        found["kind"] = (names, self.kinds.astype(object), {"long_name": "kind of motion"})
        words = {
            "exponent": "largest Lyapunov exponent per reading",
            "half": "half of the interval of the exponent",
        }
        if self.exponents:
            found |= {
                name: (names, getattr(self, name), {"units": "1", "long_name": text}) for name, text in words.items()
            }
        found["open"] = (names, self._plane(self.motions.open).astype(object), {"long_name": "what would decide"})
        return found

    def netcdf(self) -> bytes:
        """A NetCDF-4 file of `variables`.

        Examples
        --------
        >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8: a turn is a period
        >>> plane = ["bearing.clearance=5 um:10 um:2", "mechanism.driver.speed=60 rpm:100 rpm:2"]
        >>> found = model.bifurcation(plane, parameters=pitch, readings=20, exponent=False)
        >>> found.netcdf()[1:4]
        b'HDF'
        """
        return netcdf_bytes(self.variables(), {"title": self.title, "every": self.every})

    def to_xarray(self) -> xarray.Dataset:
        """Dataset whose dimensions are the two parameters, SI.

        Examples
        --------
        >>> pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8: a turn is a period
        >>> plane = ["bearing.clearance=5 um:10 um:2", "mechanism.driver.speed=60 rpm:100 rpm:2"]
        >>> found = model.bifurcation(plane, parameters=pitch, readings=20, exponent=False)
        >>> dict(found.to_xarray().sizes)
        {'bearing.clearance': 2, 'mechanism.driver.speed': 2}
        """
        attributes: dict[str, Any] = {"title": self.title, "every": self.every}
        return need("xarray").Dataset(self.variables(), attrs=attributes)


def kinds_in(kinds: np.ndarray) -> list[str]:
    """The kinds that there are: periods from the shortest on, then others."""
    there = set(np.unique(kinds).tolist())
    periods = sorted(there.difference(_OTHERS), key=lambda kind: int(kind.split()[1]))
    return [*periods, *(kind for kind in _OTHERS if kind in there)]


def _regions(vary: ParameterRange, kinds: np.ndarray) -> str:
    """Kinds along a row, each with its first and last value."""
    found, first = [], 0
    for kind, group in groupby(kinds.tolist()):
        last = first + len(list(group)) - 1
        ends = [f"{vary.shown[k]:.6g}" for k in dict.fromkeys((first, last))]
        found.append(f"{kind} {' to '.join(ends)}")
        first = last + 1
    more = [f"and {len(found) - REGIONS} more"] if len(found) > REGIONS else []
    return "; ".join([*found[:REGIONS], *more])
