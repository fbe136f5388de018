"""The digits that answers at several tolerances share: what is printed of each number, and its ±.

In: the same answer several times, the first as it was asked for, the others at tighter tolerances.  Out: its texts with
the digits that all bear, and the uncertainty of its numbers.

Numbers are compared where they stand, in texts and in plain data, so that no question has code for it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Marked, Report, ReportTable, Words

_Answer = TypeVar("_Answer")

#: Tolerance of the second answer over that of the first [1].
TIGHTER = 1e-2

#: ± over its number from which on further answers are asked for [1].
SCATTER = 1e-3

#: How many, each at another tolerance, where two tight ones differ as much: of a motion that amplifies small errors.
FURTHER = 3

#: Digits of a number that has no ±, if it is written with so many.
LEAST = 3

#: Whole numbers that are named instead of given a ±, as "ball 3 or 5".
NAMED = 2

_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)")
#: But for times and angles of a peak, which may be as high elsewhere.
_PLUS_MINUS = re.compile(rf"({_NUMBER.pattern})\s±({_NUMBER.pattern})(?! s\b| deg\b)")

#: A place whose element is another in each answer: the time and angle beside it say nothing either.  A time or angle of
#: a place, and its largest ± over it: of peaks that come again, each answer may have another one [1].
_NOWHERE = re.compile(r"\([a-z]+ -?\d+ ±\d+ at [^()]*\)")
_MOMENT = re.compile(r"(?: at|,(?: [a-z ]+ at)?) (-?\d\S*) ±(\d\S*) (?:s|deg)\b(?: of [a-z ]+)?")
LOOSE = 0.1


def second_tolerance(rtol: float) -> float:
    """Tolerance of the answer that one is compared with: a tighter one, or a looser where that is not to be had [1]."""
    return TIGHTER * rtol if TIGHTER * rtol >= TOLERANCES[0] else rtol / TIGHTER


def further(
    first: _Answer, ask: Callable[[float], _Answer], rtol: float, scattered: Callable[[Sequence[_Answer]], bool]
) -> list[_Answer]:
    """An answer and a tighter one; where these scatter a third like that, and where the last two do `FURTHER` more.

    These are at about the first's tolerance: where small errors grow, as good as any, and cheap.

    Parameters
    ----------
    first : as it was asked for
    ask : takes the tolerance
    rtol : tolerance of the first [1]
    scattered : whether two have numbers that differ by more than `SCATTER`
    """
    second = second_tolerance(rtol)
    found = [first, ask(second)]
    if scattered(found):
        found.append(ask(1.1 * second))
        if scattered(found[1:]):
            found += [ask((1.0 - 0.1 * k) * rtol) for k in range(1, FURTHER + 1)]
    return found


def uncertainty(values: Sequence[float], least: float = 0.0) -> float:
    """± of the first of some values.

    It is twice the distance from the mean of the others, or the distance and four of their standard deviations, of
    which 98 % of further ones lie within.

    Parameters
    ----------
    least : where values differ at all

    Examples
    --------
    >>> round(uncertainty([3.2440, 3.2399]), 4)
    0.0082
    """
    first, *others = values
    if all(other == first for other in others):  # lives may be infinite
        return 0.0
    mean = math.fsum(others) / len(others)
    scatter = math.dist(others, [mean] * len(others)) / math.sqrt(len(others) - 1) if len(others) > 1 else 0.0
    return max(2.0 * abs(first - mean), abs(first - mean) + 4.0 * scatter, least)


def shared_text(texts: Sequence[str], between: str = " ", least: int = LEAST) -> str:
    """The first of some texts, its numbers with the digits that all have, or ±.

    Texts that differ in words as well are others: the first stays as it is.

    Parameters
    ----------
    between : a number that stands alone and its ±
    least : digits of a number without ±

    Examples
    --------
    >>> shared_text(["4390.5 N (ball 3)", "4390.9 N (ball 5)"]), shared_text(["0.0457", "0.0618"])
    ('4390.5 ±0.8 N (ball 3 or 5)', '0.05 ±0.04')
    >>> shared_text([f"320 N (ball {k} at 0.{k} s)" for k in (1, 5, 8)])
    '320 N (elsewhere at each tolerance)'
    >>> shared_text([f"320 N (ball 3 at {t} s, crank at 81.02 deg)" for t in (1.2, 2.2, 3.2)])
    '320 N (ball 3, crank at 81.02 deg)'
    """
    words = _NUMBER.split(texts[0])
    if len(set(texts)) == 1 or any(_NUMBER.split(text) != words for text in texts):
        return texts[0]
    numbers = zip(*(_NUMBER.findall(text) for text in texts), strict=True)
    between = between if len(words) == 2 and len("".join(words)) < 2 else " "  # with a star at most
    found = [_shared_number(each, between, least) for each in numbers]
    joined = "".join(part for pair in zip(words, [*found, ""], strict=True) for part in pair)
    joined = _NOWHERE.sub("(elsewhere at each tolerance)", joined)
    return _MOMENT.sub(lambda found: "" if float(found[2]) > LOOSE * abs(float(found[1])) else found[0], joined)


def _shared_number(texts: Sequence[str], between: str, least: int) -> str:
    """One number with the digits that all have, or ±."""
    named = list(dict.fromkeys(texts))
    if len(named) == 1:
        return texts[0]
    if len(named) <= NAMED and all(text.isdigit() and len(text) <= LEAST for text in named):
        return " or ".join(named)
    values = [float(text) for text in texts]
    most = max(len(re.sub(r"e.*|^-?[0.]+|\D", "", text)) for text in texts)
    apart = uncertainty(values)
    # draws of a motion that scatters may share a digit by luck
    within = values if len(values) <= 3 else [values[0] - apart, values[0] + apart]
    return _agreed(within, most, least) or plus_minus(values[0], apart, between)


def _agreed(values: Sequence[float], most: int, least: int) -> str:
    """The number of the digits that all share; empty where they are fewer than `least`, or end before the point."""
    whole = len(str(int(abs(values[0]))))  # zeros in front of the point would look like digits
    for digits in range(most, max(min(least, most), min(whole, most)) - 1, -1):
        shown = {rounded(value, digits) for value in values}
        if len(shown) == 1:
            return shown.pop()
    return ""


def plus_minus(value: float, apart: float, between: str = " ") -> str:
    """A number to the first digit of its ±, which is rounded up together with what the number lost.

    Examples
    --------
    >>> plus_minus(-1922.3, 113.0)
    '-1900 ±200'
    """
    last = 10.0 ** math.floor(math.log10(apart))
    near = last * round(value / last)
    apart = last * math.ceil((apart + abs(value - near)) / last - 1e-9)
    digits = math.floor(math.log10(abs(near) / last)) + 1 if near else 1
    return f"{rounded(near, digits)}{between}±{rounded(apart, 1)}"


def shared(items: Sequence[Any], between: str = " ", least: int = LEAST) -> Any:
    """The first of some sentences, cells, tables or reports, with the digits that all bear.

    Where parts are not alike, as a table with a sentence, the first stays as it is.
    """
    first = items[0]
    if any(type(item) is not type(first) for item in items):
        return first
    if isinstance(first, str):
        return shared_text(items, between, least)
    if isinstance(first, ReportTable):
        return replace(first, rows=_shared_rows(items, least))
    if isinstance(first, Marked):
        text, rest = (shared([getattr(item, name) for item in items], " ", least) for name in ("text", "rest"))
        return replace(first, text=text, rest=rest)
    if isinstance(first, Report):
        parts, warnings = (
            [shared(each, " ", least) for each in _matched([getattr(item, name) for item in items])]
            for name in ("parts", "warnings")
        )
        return replace(first, parts=parts, warnings=warnings)
    if len({len(item) for item in items}) > 1:
        return first
    return [shared(each, between, least) for each in zip(*items, strict=True)]


def _matched(every: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Sentences and tables of the first of some reports, each with those of the others that differ in numbers alone.

    What another report does not have, as a limit that it does not pass, is compared with itself.
    """
    first, *others = every
    left = [list(parts) for parts in others]
    found = []
    for part in first:
        like = [next((each for each in parts if _words_of(each) == _words_of(part)), None) for parts in left]
        for parts, each in zip(left, like, strict=True):
            if each is not None:
                parts.remove(each)
        found.append([part, *(part if each is None else each for each in like)])
    return found


def _words_of(part: Words | ReportTable) -> Sequence[str]:
    """What parts of reports have in common that differ in numbers alone."""
    return tuple(part.heads) if isinstance(part, ReportTable) else tuple(_NUMBER.split(str(part)))


def _shared_rows(tables: Sequence[ReportTable], least: int) -> list[Sequence[Words]]:
    """Rows of the first table; those that begin with a number that another table does not have are left out."""
    first, *others = tables
    if first.heads[0] in first.right:
        known = [{row[0]: row for row in table.rows} for table in others]
        found = [[row, *(table[row[0]] for table in known)] for row in first.rows if all(row[0] in t for t in known)]
    else:
        found = [[row, *(table.rows[k] for table in others if k < len(table.rows))] for k, row in enumerate(first.rows)]
    return [shared(rows, "\n", least) for rows in found]  # ± below: three of these fill a line


def scatters(reports: Sequence[Report]) -> bool:
    """Whether numbers of reports differ by more than `SCATTER`: of themselves, or of the largest of one quantity."""
    found: Report = shared(reports, least=LEAST + 1)
    texts = list(found.warnings)
    for part in found.parts:
        if not isinstance(part, ReportTable):
            texts.append(str(part))
        elif "min" in part.heads:  # of one quantity
            texts += ["\n".join(map(str, row[1:])) for row in part.rows]
        else:
            texts += [str(cell) for row in part.rows for cell in row]

    def differ(text: str) -> bool:
        pairs = [(abs(float(value)), float(apart)) for value, apart in _PLUS_MINUS.findall(text)]
        sizes = [abs(float(number)) for number in _NUMBER.findall(text)] if "\n" in text else [0.0]
        return any(apart > SCATTER * max(value, *sizes) for value, apart in pairs)

    return any(map(differ, texts))


def uncertainties(plain: Sequence[Any], least: float, size: float = 0.0) -> Any:
    """± of the numbers of some plain data, in the shape of the first; None where all are equal, or not alike.

    Parameters
    ----------
    least : ± of a number that differs at all, over it, or over the largest beside it of the same unit [1]
    size : of that one
    """
    first = plain[0]
    if isinstance(first, Mapping):
        rest = [item for item in plain if isinstance(item, Mapping)]
        size = max((abs(item) for item in first.values() if isinstance(item, float)), default=0.0) * ("unit" in first)
        found = {key: uncertainties([item.get(key) for item in rest], least, size) for key in first}
        return {key: each for key, each in found.items() if each is not None} or None
    if isinstance(first, (list, tuple)):
        if any(not isinstance(item, (list, tuple)) or len(item) != len(first) for item in plain):
            return None
        every = [uncertainties(each, least) for each in zip(*plain, strict=True)]
        return every if any(each is not None for each in every) else None
    numbers = [item for item in plain if isinstance(item, (int, float)) and not isinstance(item, bool)]
    if len(numbers) < len(plain) or not all(map(math.isfinite, numbers)):
        return None
    return uncertainty(numbers, least * max(size, abs(numbers[0]))) or None
