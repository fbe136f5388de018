"""Results of a sweep: the grid as a dataset, the table, the report, figures, and tables for the terminal."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.folders import replace_files
from ballpass.runtime.contract.units import printed_unit, table_unit
from ballpass.runtime.plot import FORMATS
from ballpass.runtime.report.digits import SCATTER, shared_text
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.plain import json_text
from ballpass.runtime.report.report import ReportTable
from ballpass.runtime.report.short_words import head_lines
from ballpass.runtime.report.units import with_units
from ballpass.runtime.solution.netcdf import Variable, netcdf_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.many.ensemble import EnsembleResult

#: Files of a sweep, beside a figure for each quantity.
TABLE, GRID, REPORT, CAPTIONS = "sweep.csv", "sweep.nc", "sweep.json", "sweep.md"


def _stem(quantity: str) -> str:
    """Name of a quantity's figure, without its ending."""
    return f"sweep_{re.sub(r'[^a-z0-9]+', '_', quantity)}"


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """The members of an ensemble over a grid.

    Attributes
    ----------
    ranges : of the grid, the last one varying fastest
    fixed : values of other parameters that differ from the scene's, by path [SI]
    """

    result: EnsembleResult
    ranges: Sequence[ParameterRange]
    fixed: Mapping[str, float]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points of each range."""
        return tuple(one.count for one in self.ranges)

    @cached_property
    def _values(self) -> list[np.ndarray]:
        """Values of each range [SI]."""
        return [one.values for one in self.ranges]

    @cached_property
    def _attributes(self) -> dict[str, dict[str, str]]:
        return self.result.attributes()

    def grid(self) -> bytes:
        """Write a NetCDF-4 file with a dimension for each varied parameter; ``status`` says how each member ended."""
        facts = self._attributes
        paths = tuple(one.name for one in self.ranges)
        status = np.full(math.prod(self.shape), "DONE", dtype=object)
        for failure in self.result.failures:
            status[failure.member] = failure.status
        variables: dict[str, Variable] = {one.name: ((one.name,), one.values, facts[one.name]) for one in self.ranges}
        variables |= {path: ((), np.array(value), facts[path]) for path, value in self.fixed.items()}
        for name, values in self.result.observables.items():
            variables[name] = (paths, values.reshape(self.shape), facts[name])
        variables["status"] = (paths, status.reshape(self.shape), {"long_name": "how the member's run ended"})
        attributes = {"title": self.result.manifest.title}
        if self.fixed:
            attributes["coordinates"] = " ".join(self.fixed)  # xarray takes these for coordinates
        return netcdf_bytes(variables, attributes)

    def unit(self, quantity: str) -> str:
        """SI unit of a quantity."""
        return self._attributes[quantity]["units"]

    def shown(self, quantity: str) -> tuple[np.ndarray, str]:
        """Values of a quantity on the grid, and their unit, as tables and figures show them."""
        factor, unit = table_unit(self.unit(quantity))
        return factor * self.result.observables[quantity].reshape(self.shape), unit

    def point(self, member: int) -> list[float]:
        """Values of a member's varied parameters [SI]."""
        indices = np.unravel_index(member, self.shape)
        return [float(values[k]) for values, k in zip(self._values, indices, strict=True)]

    def place(self, member: int) -> str:
        """Parameters of a member, in words and the units of the request."""
        return ", ".join(
            f"{one.name} = {value / one.factor:.6g} {printed_unit(one.shown_unit)}".removesuffix(" 1")
            for one, value in zip(self.ranges, self.point(member), strict=True)
        )

    @cached_property
    def scattering(self) -> list[int]:
        """Members of which a number scatters with the tolerance."""
        pairs = [(np.abs(self.result[name]), apart) for name, apart in self.result.uncertainty.items()]
        # what steps across kinks lose is in ± as well
        found = np.any([apart > 5.0 * SCATTER * size for size, apart in pairs], axis=0) if pairs else []
        return [int(member) for member in np.flatnonzero(found)]

    def report(self) -> dict[str, Any]:
        """The request and its results, in SI; members in the order of the table."""
        result = self.result
        paths = [one.name for one in self.ranges]
        facts = {
            "scene": result.manifest.scene,
            "title": result.manifest.title,
            "members": math.prod(self.shape),
            "varied": [
                {
                    "path": one.name,
                    "unit": one.unit,
                    "spacing": "logarithmic" if one.logarithmic else "linear",
                    "values": one.values.tolist(),
                }
                for one in self.ranges
            ],
            "set": dict(self.fixed),
            "quantities": {
                name: {"unit": self.unit(name), "values": values.tolist()}
                | ({"uncertainty": result.uncertainty[name].tolist()} if name in result.uncertainty else {})
                for name, values in result.observables.items()
            },
            "failures": [
                asdict(failure) | {"at": dict(zip(paths, self.point(failure.member), strict=True))}
                for failure in result.failures
            ],
            "interrupted": result.interrupted,
            "statistics": asdict(result.statistics),
            "units": {
                info.name: info.unit for info in result.manifest.parameters if info.name in {*paths, *self.fixed}
            },
        }
        return with_units(facts)

    def write(self, folder: Path, formats: Sequence[str]) -> list[str]:
        """Write all files, figures of these formats, and delete those of an earlier sweep.  Returns their names."""

        def write_all(made: Path) -> list[str]:
            self._write_table(made / TABLE)
            (made / GRID).write_bytes(self.grid())
            (made / REPORT).write_text(json_text(self.report()), encoding="utf-8")
            if formats and len(self.ranges) <= 2:
                from ballpass.runtime.plot.style import write_figures

                write_figures(self._figures(), made, formats, CAPTIONS)
            return sorted(path.name for path in made.iterdir())

        def owned() -> list[str]:
            try:
                before = list(json.loads((folder / REPORT).read_text(encoding="utf-8"))["quantities"])
            except (OSError, ValueError, KeyError, TypeError):  # no sweep was here
                return []
            return [f"{_stem(str(name))}.{kind}" for name in before for kind in FORMATS] + [CAPTIONS]

        return replace_files(folder, write_all, last=REPORT, owned=owned)

    def _write_table(self, path: Path) -> None:
        """A line for each member, SI; no number where a member has no result."""
        quantities = dict(self.result.observables)
        units = {name: self.unit(name) for name in quantities}
        for name, apart in self.result.uncertainty.items():
            quantities[f"± {name}"], units[f"± {name}"] = apart, units[name]
        parameters = [f"{one.name} [{one.unit}]" for one in self.ranges]
        heads = ["member", *parameters, *(f"{name} [{units[name]}]" for name in quantities), "status", "message"]
        ends = {failure.member: (failure.status, failure.message) for failure in self.result.failures}
        with path.open("w", encoding="utf-8", newline="") as stream:
            lines = csv.writer(stream, lineterminator="\n")
            lines.writerow(heads)
            for member in range(math.prod(self.shape)):
                values = [float(column[member]) for column in quantities.values()]
                cells = [repr(value) if math.isfinite(value) else "" for value in values]
                lines.writerow([member, *map(repr, self.point(member)), *cells, *ends.get(member, ("DONE", ""))])

    def _figures(self) -> Iterator[tuple[str, Figure]]:
        from ballpass.runtime.plot.sweep import draw_sweep

        text = f"rtol {self.result.statistics.rtol:g}."
        for name in self.result.observables:
            values, unit = self.shown(name)
            if np.any(np.isfinite(values)):
                figure = draw_sweep(
                    self.result.manifest.title,
                    self.ranges,
                    name,
                    self._attributes[name]["long_name"],
                    unit,
                    values,
                    text,
                )
                yield _stem(name), figure

    def _cell(self, quantity: str, value: float, member: int) -> str:
        """A number with the digits that it has, as tables show it."""
        if not math.isfinite(value):
            return "-"
        if quantity not in self.result.uncertainty:
            return rounded(value, 5)
        apart = table_unit(self.unit(quantity))[0] * float(self.result.uncertainty[quantity][member])
        if not math.isfinite(apart):
            return f"{rounded(value, 2)} ±?"
        return shared_text([rounded(value, 5), rounded(value + apart / 2.0, 5)])

    def all_members(self) -> ReportTable:
        """All members, each a row."""
        columns = {name: self.shown(name) for name in self.result.observables}
        heads = [_head(one.name, printed_unit(one.shown_unit)) for one in self.ranges]
        heads += [_head(name, unit) for name, (_, unit) in columns.items()]
        rows = []
        for member in range(math.prod(self.shape)):
            values = zip(self.ranges, self.point(member), strict=True)
            cells = [f"{value / one.factor:z.5g}" for one, value in values]
            cells += [self._cell(name, float(column.flat[member]), member) for name, (column, _) in columns.items()]
            rows.append(cells)
        return ReportTable(
            title=self.result.manifest.title,
            heads=heads,
            rows=rows,
            right=heads[len(self.ranges) :],
            caption=self._words(),
        )

    def _words(self) -> str:
        """What the quantities are."""
        return "\n".join(f"{name}: {self._attributes[name]['long_name']}" for name in self.result.observables)

    def extremes(self) -> ReportTable:
        """Smallest and largest value of each quantity, and where."""
        rows: list[tuple[str, ...]] = []
        for name in self.result.observables:
            values, unit = self.shown(name)
            if not np.any(np.isfinite(values)):
                rows.append((name, "", "-", "", "no member has a result"))
                continue
            lowest, highest = int(np.nanargmin(values)), int(np.nanargmax(values))
            rows.append((name, "min", self._cell(name, values.flat[lowest], lowest), unit, self.place(lowest)))
            rows.append(("", "max", self._cell(name, values.flat[highest], highest), unit, self.place(highest)))
        heads = ("quantity", "", "value", "unit", "at")
        return ReportTable(
            title=self.result.manifest.title, heads=heads, rows=rows, right=("value",), caption=self._words()
        )


def _head(name: str, unit: str) -> str:
    """A column's head, the unit in a line of its own."""
    return f"{head_lines(name)}\n[{unit}]"
