"""Base class of answers: text, HTML, plain data and a table of pandas, written from their report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ballpass.runtime.report import plain
from ballpass.runtime.report.html import to_html
from ballpass.runtime.report.report import Report

if TYPE_CHECKING:
    import pandas


class Reported:
    """Base of answers: their texts and tables, written from their report."""

    __slots__ = ()

    def _report(self) -> Report:
        raise NotImplementedError

    def _named(self, *names: str) -> dict[str, Any]:
        """Attributes by name, as facts of a report."""
        return {name: getattr(self, name) for name in names}

    def report(self) -> Report:
        """The report of the answer: sentences, tables, plain data.

        Examples
        --------
        >>> model.linearize(crank_angle=4.2).report().parts[0].heads[:3]
        ('natural\\n[Hz]', 'damped\\n[Hz]', 'damping\\nratio')
        """
        return self._report()

    def __str__(self) -> str:
        from ballpass.runtime.report.text import to_text  # with Rich

        return to_text(self._report())

    def _repr_html_(self) -> str:
        return to_html(self._report())

    def to_json(self) -> dict[str, Any]:
        """Plain data, SI; numbers that are not finite are None.

        Examples
        --------
        >>> model.linearize(crank_angle=4.2).to_json()["stiffness"]["unit"]
        'N/m'
        """
        return plain.to_plain(self._report())

    def to_pandas(self) -> pandas.DataFrame:
        """The numbers as a table, SI.

        Raises
        ------
        RequestError
            pandas is not installed.

        Examples
        --------
        >>> table = model.linearize(crank_angle=4.2).to_pandas()
        >>> table["natural_frequency"].round().tolist()  # [Hz]
        [1064.0, 1108.0, 2923.0, 4180.0]
        """
        return plain.to_pandas(self._report())
