"""Every integration method of the stepper by its name, which is that of its file.

A method is one file in `methods`, which no other file has to know: it runs in single runs, lanes, with located kinks,
reductions and derivatives, and in exported programs.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module

from ballpass.runtime.contract import methods
from ballpass.runtime.contract.tableaus import Tableau, TableauError


def _found() -> dict[str, Tableau]:
    names = [info.name for info in pkgutil.iter_modules(methods.__path__)]
    every: dict[str, Tableau] = {name: import_module(f"{methods.__name__}.{name}").METHOD for name in names}
    found = dict(sorted(every.items(), key=lambda item: item[1].number))
    numbers = [tableau.number for tableau in found.values()]
    if numbers != list(range(1, len(numbers) + 1)):
        raise TableauError(f"integration methods {', '.join(found)}: their numbers are {numbers}, not 1, 2, 3 ...")
    return found


#: The methods in the order of their numbers.
METHODS: Mapping[str, Tableau] = _found()

#: What ``auto`` chooses among: two explicit methods, the second for tight tolerances, and a linearly implicit one.
#: The numbers of the rule (`driver/control.h`, `driver/family.h`) were measured with these.
AUTO = ("dp54", "dop853", "rodas5p")

#: Name of the choice among them.
CHOICE = "stepper"

#: Names that users give: the choice, and each method.
STEPPERS: Mapping[str, str] = {CHOICE: "auto", **{f"{CHOICE}-{name}": name for name in METHODS}}

#: The method of a model without states, where all follows from the driver's angle.
NOT_INTEGRATED = "none"
