"""The report of an answer: sentences and tables in the order of reading, plain data for JSON, rows for pandas.

In: nothing but text and numbers.  Out: `Report`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

_Item = TypeVar("_Item")


@dataclass(frozen=True, slots=True)
class Marked:
    """Text whose beginning has a meaning that terminals and notebooks show as a colour.

    Attributes
    ----------
    text : what is coloured
    look : its meaning
    rest : plain text behind it
    """

    text: str
    look: Literal["good", "bad", "doubt", "faint", "head"]
    rest: str = ""

    def __str__(self) -> str:
        return self.text + self.rest


#: Text of a cell, or a sentence.  Leading blanks of a sentence are its indentation.
Words = str | Marked


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTable:
    """A table of plain text.

    Attributes
    ----------
    heads : of the columns
    rows : of cells; those missing at a row's end are empty
    title, caption : above and below
    right : heads of the columns that are aligned to the right
    wrapped : heads of the columns of sentences, which take several lines where there is no room; others never do
    sections : rows that a rule stands in front of
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[Words]]
    title: str = ""
    caption: str = ""
    right: Collection[str] = ()
    wrapped: Collection[str] = ()
    sections: Collection[int] = ()

    @classmethod
    def of(cls, items: Iterable[_Item], columns: Mapping[str, Callable[[_Item], Words]], **rest: Any) -> ReportTable:
        """A row for each item.

        Parameters
        ----------
        columns : text of an item by the column's head; a head behind ">" is aligned to the right, behind "~" wrapped
        rest : title, caption, sections

        Examples
        --------
        >>> table = ReportTable.of([1.5, 2.5], {"load": str, ">twice [N]": lambda load: f"{2.0 * load:g}"})
        >>> table.heads, table.rows[1], table.right
        (('load', 'twice [N]'), ('2.5', '5'), ('twice [N]',))
        """
        heads = {sign: tuple(head[1:] for head in columns if head[:1] == sign) for sign in ">~"}
        return cls(
            heads=tuple(head.lstrip(">~") for head in columns),
            rows=[tuple(text(item) for text in columns.values()) for item in items],
            right=heads[">"],
            wrapped=heads["~"],
            **rest,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The report of an answer.

    Attributes
    ----------
    title : of the answer
    parts : sentences and tables, in the order of reading
    facts : everything as plain data, SI
    records, index : rows of the table for pandas, and the columns that name them
    warnings : to read before the numbers are used
    fault : why the numbers must not be relied on; the command then ends with exit code 1
    """

    title: str = ""
    parts: Sequence[Words | ReportTable] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)
    records: Sequence[Mapping[str, Any]] = ()
    index: Sequence[str] = ()
    warnings: Sequence[str] = ()
    fault: str = ""
