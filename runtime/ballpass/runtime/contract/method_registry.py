"""Every integration method of the stepper by its name, which is that of its file.

A method is one file in `methods`, which no other file has to know: it runs in single runs, lanes, with located kinks,
reductions and derivatives, and in exported programs.
"""

from __future__ import annotations

import pkgutil
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import import_module

from ballpass.runtime.contract import methods
from ballpass.runtime.contract.plugins import Registry
from ballpass.runtime.contract.tableaus import Tableau


def _found() -> dict[str, Tableau]:
    names = [info.name for info in pkgutil.iter_modules(methods.__path__)]
    every: dict[str, Tableau] = {name: import_module(f"{methods.__name__}.{name}").METHOD for name in names}
    return dict(sorted(every.items(), key=lambda item: item[1].number))


class Methods(Registry[Tableau]):
    """The methods in the order of their numbers; those of plugins follow ballpass's own."""

    def added(self) -> dict[str, Tableau]:
        """By the letters and figures of their names, with their numbers."""
        first = len(self._own) + 1
        found = enumerate(super().added().items(), start=first)
        return {name: replace(tableau, number=number) for number, (name, tableau) in found}


#: Ballpass's own.
OWN = _found()

METHODS = Methods(
    "methods", "integration method", Tableau, OWN, name=lambda method: re.sub("[^a-z0-9]", "", method.name.lower())
)

#: What ``auto`` chooses among: two explicit methods, the second for tight tolerances, and a linearly implicit one.
#: The numbers of the rule (`driver/control.h`, `driver/family.h`) were measured with these.
AUTO = ("dp54", "dop853", "rodas5p")

#: Name of the choice among them.
CHOICE = "stepper"


class Steppers(Mapping[str, str]):
    """Names that users give, the choice and each method, and the methods."""

    def __getitem__(self, name: str) -> str:
        choice, _, method = name.partition("-")
        if name == CHOICE or choice != CHOICE or method not in METHODS:
            return {CHOICE: "auto"}[name]
        return method

    def __iter__(self) -> Iterator[str]:
        return iter((CHOICE, *(f"{CHOICE}-{name}" for name in METHODS)))

    def __len__(self) -> int:
        return 1 + len(METHODS)


STEPPERS = Steppers()

#: The method of a model without states, where all follows from the driver's angle.
NOT_INTEGRATED = "none"
