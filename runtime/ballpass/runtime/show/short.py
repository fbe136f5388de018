"""Short reprs of records: a few lines for any size of arrays and tables."""

from __future__ import annotations

import reprlib
from dataclasses import fields, is_dataclass
from typing import Any

#: Most characters of a repr.
LONGEST = 800


class _ShortValues(reprlib.Repr):
    """Values of fields: of containers the first few, of arrays the shape."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxdict, self.maxlist, self.maxtuple = 3, 3, 4, 4
        self.maxstring = self.maxother = 80

    def repr_float64(self, number: Any, level: int) -> str:
        return repr(float(number))

    def repr_ndarray(self, array: Any, level: int) -> str:
        return f"array{array.shape}" if array.size > 4 else repr(array)


class ShortRepr:
    """Gives a dataclass (with ``repr=False``) a short repr, without all numbers of its arrays."""

    __slots__ = ()

    def __repr__(self) -> str:
        assert is_dataclass(self)
        values = _ShortValues()
        shown = (f"{item.name}={values.repr(getattr(self, item.name))}" for item in fields(self) if item.repr)
        text = f"{type(self).__name__}({', '.join(shown)})"
        return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]}...)"
