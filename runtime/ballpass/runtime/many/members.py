"""Members of an ensemble: a table of parameters read, checked, and completed by derived constants.

In: a table of parameters.  Out: `Members`, the `Spans` of their runs, and the edges of one run's segments.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.bounds import violations
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers, Parameters, scalar, unknown_name, wrong_unit
from ballpass.runtime.contract.plausible_ranges import warn_unusual
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.assembly import check_assembly, valid_angles
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoints
from ballpass.runtime.time.turning import ANGLE_RESOLUTION, TURN

Table = Mapping[str, object] | Sequence[Mapping[str, float]] | np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Members:
    """Numbers of all members.

    Attributes
    ----------
    varied : parameters of the table, each of shape (members,)
    columns : every parameter and constant by name, each of shape (members,)
    p, c : parameters and constants, shape (members, .)
    initial : states at the start, shape (members, states)
    refused : members whose numbers cannot be simulated, and why
    """

    varied: dict[str, np.ndarray]
    columns: dict[str, np.ndarray]
    p: np.ndarray
    c: np.ndarray
    initial: np.ndarray
    refused: dict[int, str]

    def __len__(self) -> int:
        return len(self.p)

    def numbers(self, model: LoadedModel, member: int) -> Numbers:
        """The numbers of one member, by name as well."""
        values = {name: float(column[member]) for name, column in self.columns.items()}
        parameters = Parameters(model.manifest.parameters, values)
        return Numbers(parameters=parameters, p=self.p[member], c=self.c[member], values=values)


def read_table(manifest: Manifest, table: Table) -> dict[str, np.ndarray]:
    """Columns of a table of parameters, each of shape (members,).

    Parameters
    ----------
    table : mapping from name to one number for each member; or one mapping for each member, where what a member does
        not name keeps its default; or a structured array, or a table of pandas.  Values that say their unit are
        refused where it is not SI

    Raises
    ------
    RequestError
        Unknown names, columns of unequal length, values that are not finite numbers; all faults at once.
    """
    defaults = {info.name: info.default for info in manifest.parameters}
    units = {info.name: info.unit for info in manifest.parameters}
    raw: dict[str, object] = {}
    if hasattr(table, "columns") and hasattr(table, "to_dict"):  # a table of pandas
        table = {str(name): table[name] for name in table.columns}
    if isinstance(table, np.ndarray):
        if table.dtype.names is None or table.ndim != 1:
            raise RequestError(
                "parameters: an array must have one dimension and named fields (a structured array). "
                'Otherwise give a mapping: {"bearing.clearance": values}.'
            )
        raw = {name: table[name] for name in table.dtype.names}
    elif isinstance(table, Mapping):
        raw = dict(table)
    elif isinstance(table, Sequence) and table and all(isinstance(row, Mapping) for row in table):
        names = list(dict.fromkeys(name for row in table for name in row))
        raw = {name: [row.get(name, defaults.get(name, math.nan)) for row in table] for name in names}
    else:
        raise RequestError(
            "parameters: a mapping from name to values, a list of mappings, or a structured array is expected, "
            f"not {type(table).__name__}{' without entries' if isinstance(table, Sequence) else ''}."
        )
    if not raw:
        raise RequestError("parameters: no parameter is named, so the number of members is unknown. Name one.")
    faults: list[str] = []
    columns: dict[str, np.ndarray] = {}
    for name, given in raw.items():
        if name not in defaults:
            faults.append(unknown_name("parameter", name, defaults))
            continue
        if wrong := wrong_unit(given, units[name]):
            faults.append(f"{name}: {wrong}")
            continue
        try:
            column = np.array(getattr(given, "magnitude", given), dtype=float)
            # NumPy takes truth values and texts for numbers
            plain = _plain(getattr(given, "magnitude", given))
        except (TypeError, ValueError, OverflowError):
            plain = False
        if not plain:
            faults.append(f"{name}: numbers are expected, not {given!r:.80}")
            continue
        if column.ndim != 1:
            faults.append(f"{name}: one number for each member is expected, not an array of shape {column.shape}")
            continue
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            more = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
            faults.append(f"{name}: member {bad[0]}{more} has {column[bad[0]]}; a finite number is expected")
        columns[name] = column
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} has {length}" for name, length in lengths.items())
        faults.append(f"The columns must be of one length, a value for each member: {listed}")
    if not faults and not next(iter(lengths.values())):
        faults.append("There are no members: the columns are empty. Give at least one value.")
    if faults:
        raise RequestError("\n".join(faults))
    return columns


def _plain(given: object) -> bool:
    """Whether these are numbers: NumPy takes truth values and texts for some."""
    if isinstance(given, list | tuple):
        kinds = dict.fromkeys(map(type, given))
        if all(issubclass(kind, float | int | np.floating | np.integer) and kind is not bool for kind in kinds):
            return True
        return all(scalar(item) is not None or isinstance(item, list | tuple | np.ndarray) for item in given)
    return np.asarray(given).dtype.kind in "iufO"


def make_members(model: LoadedModel, table: Table, *, bounded: bool = True) -> Members:
    """Members with their derived constants; those that cannot be simulated are noted, not raised.

    Parameters
    ----------
    bounded : hold the numbers to their bounds and warn of unusual ones; a difference may step slightly beyond a bound
    """
    manifest = model.manifest
    varied = read_table(manifest, table)
    count = len(next(iter(varied.values())))
    columns = {info.name: varied.get(info.name, np.full(count, info.default)) for info in manifest.parameters}
    p = np.ascontiguousarray(np.column_stack(list(columns.values())))
    c = np.zeros((count, 0))
    refused: dict[int, str] = {}
    for mask, rule in violations(manifest, columns) if bounded else ():
        name = rule.partition(":")[0]
        for member in np.flatnonzero(mask):
            refused.setdefault(int(member), f"{rule}, not {columns[name][member]:.9g}.")
    if bounded:
        warn_unusual(manifest, columns)
    if manifest.constants:
        c = np.ascontiguousarray(model.loop("constants", ("p",))(count, {"p": p})["c"])
        for member in np.flatnonzero(~np.all(np.isfinite(c), axis=1)):
            bad = [info.name for info, fine in zip(manifest.constants, np.isfinite(c[member]), strict=True) if not fine]
            refused.setdefault(
                int(member),
                f"The derived constants {', '.join(bad)} are not finite numbers. "
                "Geometry and elastic constants must be physical.",
            )
        columns |= {info.name: c[:, k] for k, info in enumerate(manifest.constants)}
    _check_knots(manifest, columns, refused)
    initial = np.ascontiguousarray(np.reshape([columns[name] for name in manifest.initial], (-1, count)).T)
    return Members(varied=varied, columns=columns, p=p, c=c, initial=initial, refused=refused)


def _check_knots(manifest: Manifest, columns: Mapping[str, np.ndarray], refused: dict[int, str]) -> None:
    """Note members whose tables have knots that do not increase, or not within a turn."""
    tables = [(item.times, item.turns * TURN if item.turning else np.inf) for item in manifest.inputs if item.times]
    tables += [(times, np.inf) for info in manifest.turnings for times in (info.times, info.lag_times) if times]
    wrong = np.zeros(len(next(iter(columns.values()))), dtype=bool)
    for names, most in dict.fromkeys(tables):
        knots = np.array([columns[name] for name in names])
        wrong |= np.any(np.diff(knots, axis=0) <= 0.0, axis=0) | (knots[-1] - knots[0] >= most - ANGLE_RESOLUTION)
    for member in np.flatnonzero(wrong).tolist():
        values = {name: float(columns[name][member]) for name in timeline.names_of_inputs(manifest)}
        try:
            breakpoints(manifest, values, 0.0, 1.0)
        except RequestError as fault:
            refused[member] = str(fault)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spans:
    """How long each member runs.

    Attributes
    ----------
    durations : shape (members,) [s]
    turns : time after which each is cut, see `timeline.stretch`, shape (members,) [s]
    starts : time from which the reductions count, shape (members,) [s]
    """

    durations: np.ndarray
    turns: np.ndarray
    starts: np.ndarray


def check_assembled_members(model: LoadedModel, members: Members, spans: Spans) -> bool:
    """Note members whose linkage is not valid in their runs; each distinct geometry is swept once.

    Returns whether a torque may turn some to where they lock: these do not run in lanes.
    """
    mechanism = model.manifest.mechanism
    if mechanism is None or not mechanism.margins:
        return False
    locks = False
    function = model.symbolic("assembly")
    # a turn has every angle for any speed and start
    speed_and_start = (mechanism.speed, mechanism.start_angle)
    timing = [k for k, info in enumerate(model.manifest.parameters) if info.name in speed_and_start]
    parts = [np.zeros((len(members), 0))]
    for name, rows in (("p", members.p), ("c", members.c)):
        if name in function.name_in() and rows.shape[1]:
            used = set(function.jac_sparsity(0, function.name_in().index(name)).get_col())
            parts.append(rows[:, sorted(used.difference(timing) if name == "p" else used)])
    turning: set[bytes] = set()  # geometries that are valid at every angle
    for member, geometry in enumerate(row.tobytes() for row in np.column_stack(parts)):
        if member in members.refused or geometry in turning:
            continue
        numbers = members.numbers(model, member)
        try:
            check_assembly(model, numbers, float(spans.durations[member]))
            if valid_angles(model, numbers) is None:
                turning.add(geometry)
            else:
                locks = locks or timeline.is_free(model.manifest)
        except RequestError as fault:
            members.refused[member] = str(fault)
    return locks
