"""Where data sets are stored: Zarr while they are made, and as long as people like; NetCDF from that.

In: axes, labels and parameters of all members; then samples, chunk by chunk.  Out: files.  The status of the members of
a chunk is written last, so that a chunk counts when it is whole.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.folders import LOCK, refuse_other, replace_file, replaced
from ballpass.runtime.many.chunks import MemberFailure
from ballpass.runtime.many.signals import Made
from ballpass.runtime.solution.netcdf import create_variable

#: Number of the layout of data sets.
SCHEMA = 1

#: Times of entry that an array has room for at first, and by which it grows.
ENTRIES = 64

#: Names of files in a store and its arrays; Zarr writes a file under a name that ends in partial first.
_ENTRY = re.compile(
    r"(\.z(group|array|attrs|metadata|metadata\.new)|\d+(\.\d+)*|\.ballpass-mark|\.ballpass\.lock)"
    r"(\.[0-9a-f]{32}\.partial)?|\.\.zmetadata-[a-z0-9_]{8}"
)

#: Characters of a message that are kept.
MESSAGE = 300

#: What the status of a member says, by its number.
STATUSES = ("unfinished", "made", "failed")
UNFINISHED, MADE, FAILED = range(3)

#: File by which a worker sees whether a folder is the one that it was given, on this machine or a shared disk.
MARK = ".ballpass-mark"


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalPlace:
    """A store as a worker finds it.

    Attributes
    ----------
    path : absolute
    mark : what its mark says
    """

    path: str
    mark: str

    def seen(self) -> bool:
        """Whether this process sees the store."""
        try:
            return (Path(self.path) / MARK).read_text(encoding="utf-8") == self.mark
        except OSError:
            return False


@contextlib.contextmanager
def marked(store: Path) -> Iterator[SignalPlace]:
    """A store with a mark, as long as this lasts."""
    mark = uuid.uuid4().hex
    (store / MARK).write_text(mark, encoding="utf-8")
    try:
        yield SignalPlace(path=str(store.absolute()), mark=mark)
    finally:
        (store / MARK).unlink(missing_ok=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalAxes:
    """What a data set has beside its signals.

    Attributes
    ----------
    spec : all that decides its content
    times : of the samples, shape (samples,) [s]
    precision : of the samples
    outputs : name, unit and meaning of each
    quantities : the same of each quantity
    labels : shape (members,)
    names : name, unit and meaning of each parameter
    parameters : shape (members, parameters) [SI]
    snr : shape (members,) [dB]
    entries : by spall, times at which a ball reaches it, shape (members, entries), NaN behind the last [s]
    driven : spalls of which the motion decides these times
    chunk : members of a chunk
    """

    spec: Mapping[str, Any]
    times: np.ndarray
    precision: str
    outputs: Sequence[tuple[str, str, str]]
    quantities: Sequence[tuple[str, str, str]]
    labels: np.ndarray
    names: Sequence[tuple[str, str, str]]
    parameters: np.ndarray
    snr: np.ndarray
    entries: Mapping[str, np.ndarray]
    driven: Sequence[str]
    chunk: int


def open_store(path: str | Path) -> Any:
    """A store that there is; RequestError where what describes it cannot be read."""
    try:
        return need("zarr").open_group(path, mode="r+", zarr_format=2)
    except (ValueError, KeyError, TypeError, AttributeError) as fault:
        raise RequestError(
            f"{path}: what describes the data set (.zmetadata, .zattrs) cannot be read ({fault}): cut short, or "
            "edited. Allowed: a data set as it was written. Take these files from a copy, or delete the folder."
        ) from None


def is_complete(store: Path) -> bool:
    """Whether a store was made with all its axes; the file it looks for is written last."""
    return (store / ".zmetadata").exists()


def create_store(path: Path, axes: SignalAxes) -> Any:
    """A new store with everything but signals; files of one that was begun are written anew."""
    zarr = need("zarr")
    count, size = len(axes.labels), axes.chunk
    clear_store(path)
    group = zarr.open_group(path, mode="a", zarr_format=2)  # "w" would delete files of others
    facts = {"title": axes.spec["title"], "ballpass_data_set": SCHEMA, "ballpass_spec": json.dumps(axes.spec)}
    group.attrs.update(facts)

    def array(name: str, dimensions: str, values: np.ndarray, meaning: str, unit: str = "", chunk: int = 0) -> None:
        facts = {"_ARRAY_DIMENSIONS": dimensions.split(), "long_name": meaning}
        group.create_array(
            name,
            data=values,
            chunks=(chunk or values.shape[0], *values.shape[1:]),
            fill_value=None,  # xarray would make NaN of zeros
            compressors=None if chunk else "auto",  # `mend` knows the length of a chunk
            attributes=facts | ({"units": unit} if unit else {}),
        )

    for row in _known_arrays(axes):
        array(*row)
    noise = np.full((count, len(axes.outputs)), np.nan)
    array("noise_rms", "member output", noise, "rms of the noise, in the unit of the output", chunk=size)
    if axes.quantities:
        unknown = np.full((count, len(axes.quantities)), np.nan)
        array("quantities", "member quantity", unknown, "quantities of the recorded part of the run", chunk=size)
    for name, unit, meaning in axes.outputs:
        group.create_array(
            name,
            shape=(count, len(axes.times)),
            chunks=(size, len(axes.times)),
            dtype=axes.precision,
            fill_value=np.nan,
            compressors=None,  # noise does not get smaller
            attributes={"_ARRAY_DIMENSIONS": ["member", "time"], "units": unit, "long_name": meaning},
        )
    for name in axes.driven:
        unknown = np.full((count, ENTRIES), np.nan)
        array(f"entry_time.{name}", f"member entry.{name}", unknown, _entry_words(name), "s", chunk=size)
    array("failure", "member", np.full(count, "", f"<U{MESSAGE}"), "why there is no signal", chunk=size)
    array("status", "member", np.full(count, UNFINISHED, np.int8), "whether there is a signal", chunk=size)
    group["status"].attrs.update({"flag_values": list(range(len(STATUSES))), "flag_meanings": " ".join(STATUSES)})
    # as Zarr's consolidate_metadata, which would also read the lock
    known = {
        described.relative_to(path).as_posix(): json.loads(described.read_text(encoding="utf-8"))
        for described in sorted(path.rglob(".z*"))
        if described.name in (".zgroup", ".zattrs", ".zarray")
    }
    _write_summary(path, {"metadata": known, "zarr_consolidated_format": 1})
    return open_store(path)


def _known_arrays(axes: SignalAxes) -> Iterator[tuple[str, str, np.ndarray, str, str]]:
    """Arrays that are known before anything is simulated: name, dimensions, values, meaning, unit."""
    yield "member", "member", np.arange(len(axes.labels)), "number of the member", "1"
    yield "time", "time", axes.times, "time from the start of the run", "s"
    yield "label", "member", axes.labels, "class of the member", ""
    for name, rows in (("parameter", axes.names), ("output", axes.outputs), ("quantity", axes.quantities)):
        if not rows:
            continue
        names, units, meanings = (np.array(column) for column in zip(*rows, strict=True))
        yield name, name, names, f"name of the {name}", ""
        yield f"{name}_unit", name, units, f"SI unit of the {name}", ""
        yield f"{name}_meaning", name, meanings, f"what the {name} is", ""
    yield "parameters", "member parameter", axes.parameters, "parameters of the run; NaN: its class has none such", ""
    yield "snr", "member", axes.snr, "ratio of signal to noise", "dB"
    for name, times in axes.entries.items():
        yield f"entry_time.{name}", f"member entry.{name}", times, _entry_words(name), "s"


def _entry_words(spall: str) -> str:
    return f"times in the record at which a ball reaches {spall}; NaN behind the last"


def mend(group: Any, axes: SignalAxes) -> None:
    """Write again what is known and was deleted, cut or edited since; chunks of signals without files are unfinished.

    A file of samples counts by its length, which is known because samples are not compressed.
    """
    folder = Path(group.store.root)
    for name, facts in json.loads((folder / ".zmetadata").read_text(encoding="utf-8"))["metadata"].items():
        if "/" in name and not _is_json(folder / name):
            (folder / name).write_text(json.dumps(facts, indent=2), encoding="utf-8")
    for name, _, values, _, _ in _known_arrays(axes):
        found = _readable(group, name)
        if found is None or not np.array_equal(found, values, equal_nan=values.dtype.kind == "f"):
            group[name][:] = values
    quantities = ["quantities"] if axes.quantities else []
    entries = [f"entry_time.{name}" for name in axes.driven]
    names = [*(name for name, _, _ in axes.outputs), *quantities, *entries, "noise_rms", "failure", "status"]
    for number, first in enumerate(range(0, len(axes.labels), axes.chunk)):
        which = slice(first, first + axes.chunk)
        places = {name: folder / name / ".".join(map(str, (number, *[0] * (group[name].ndim - 1)))) for name in names}
        if not _is_whole(group, axes, which, places):
            for place in places.values():
                place.unlink(missing_ok=True)
            group["status"][which] = np.full(len(axes.labels[which]), UNFINISHED, np.int8)


def _is_json(path: Path) -> bool:
    """Whether a description of an array is there, and is not cut."""
    try:
        json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return True


def _readable(group: Any, name: str) -> Any:
    """Values of an array; None where its files cannot be decoded."""
    try:
        return group[name][:]
    except (OSError, ValueError, RuntimeError, TypeError):  # what codecs raise of a file that is cut
        return None


def _is_whole(group: Any, axes: SignalAxes, which: slice, places: Mapping[str, Path]) -> bool:
    """Whether all there is to a chunk is there; its files by the names of the arrays."""
    lengths = {name: place.stat().st_size for name, place in places.items() if place.is_file()}
    for name, length in lengths.items():
        array = group[name]
        if length != math.prod(array.chunks) * array.dtype.itemsize:
            return False
    status = group["status"][which] if "status" in lengths else np.array([UNFINISHED])
    recorded = [name for name in places if name not in ("noise_rms", "failure", "status")]
    wanted = recorded if np.any(status == MADE) else []
    # what holds nothing but zeros or empty words has no file
    wanted += ["noise_rms"] if wanted and np.any(np.isfinite(axes.snr[which])) else []
    wanted += ["failure"] if np.any(status == FAILED) else []
    return all(name in lengths for name in wanted)


def write_samples(group: Any, first: int, made: Made) -> None:
    """Write the samples of a chunk whose first member this is."""
    for name, samples in made.samples.items():
        group[name][first : first + len(samples)] = samples


def write_status(group: Any, first: int, made: Made) -> None:
    """Write what else there is of a chunk whose samples are there, and last that they are."""
    count = len(made.noise_rms)
    which = slice(first, first + count)
    group["noise_rms"][which] = made.noise_rms
    if made.quantities.shape[1]:
        group["quantities"][which] = made.quantities
    for name, times in made.entries.items():
        _write_entries(group, f"entry_time.{name}", which, times)
    status = np.full(count, MADE, dtype=np.int8)
    if made.failures:
        words = np.full(count, "", dtype=f"<U{MESSAGE}")
        for failure in made.failures:
            status[failure.member] = FAILED
            words[failure.member] = f"{failure.status} at {failure.time:.9g} s: {failure.message}"[:MESSAGE]
        group["failure"][which] = words
    group["status"][which] = status


def _note_length(store: Path, name: str) -> None:
    """Note how long an array has become where readers look first; Zarr would also read marks and locks."""
    known = json.loads((store / ".zmetadata").read_text(encoding="utf-8"))
    known["metadata"][f"{name}/.zarray"] = json.loads((store / name / ".zarray").read_text(encoding="utf-8"))
    _write_summary(store, known)


def _write_summary(store: Path, known: Mapping[str, Any]) -> None:
    """Write the descriptions of all arrays where readers look first."""
    replace_file(store / ".zmetadata", json.dumps(known, indent=2).encode())


def _write_entries(group: Any, name: str, which: slice, times: Sequence[np.ndarray]) -> None:
    """Write times of entry, as many in the longest row as there are."""
    zarr = need("zarr")
    array = zarr.open_array(group.store, path=name, mode="r+", zarr_format=2)  # it may be longer than the group knows
    missing = max(map(len, times)) - array.shape[1]
    if missing > 0:
        array.resize((array.shape[0], array.shape[1] + -(-missing // ENTRIES) * ENTRIES))
        _note_length(Path(group.store.root), name)
    rows = np.full((len(times), array.shape[1]), np.nan)
    for row, own in zip(rows, times, strict=True):
        row[: len(own)] = own
    with zarr.config.set({"array.write_empty_chunks": True}):  # a file that is missing was deleted
        zarr.open_array(group.store, path=name, mode="r+", zarr_format=2)[which] = rows


def read_failures(stored: Any) -> tuple[MemberFailure, ...]:
    """Members without a signal, in order."""
    failed = np.flatnonzero(stored["status"][:] == FAILED)
    words = stored["failure"][:] if len(failed) else []
    found = []
    for number in failed.tolist():
        begin, _, message = str(words[number]).partition(" s: ")
        status, _, time = begin.partition(" at ")
        found.append(MemberFailure(member=number, status=status, time=float(time), message=message))
    return tuple(found)


def refuse_foreign(store: Path, *, scratch: bool) -> None:
    """Refuse a place that holds something else than a data set, or files of others that would be deleted with it.

    Parameters
    ----------
    scratch : the store is deleted when all is made
    """
    if not os.path.lexists(store):
        return
    names = [path.name for path in store.iterdir() if not path.name.startswith(".ballpass")] if store.is_dir() else []
    if not store.is_dir() or (names and ".zgroup" not in names) or not (is_complete(store) or _is_begun(store, names)):
        raise RequestError(
            f"{store}: something else than a data set is there, and nothing was changed. Give a place that is new."
        )
    others = _others(store) if scratch or not is_complete(store) else []
    if others:
        raise RequestError(
            f"{store}: files that are no parts of a data set are there ({', '.join(others[:5])}), and nothing was "
            "changed. Move them, or give a place that is new."
        )


def _is_begun(store: Path, names: Sequence[str]) -> bool:
    """Whether a process was killed while it made this store: another store without a summary is no such one."""
    try:
        facts = json.loads((store / ".zattrs").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        facts = {}
    return "ballpass_data_set" in facts or not set(names) - {".zgroup", ".zattrs"}


def _others(store: Path) -> list[str]:
    """Paths in a store that neither this module nor Zarr wrote; links lead to files of others."""
    found = []
    for path in sorted([*store.iterdir(), *store.glob("*/*")]):
        within = path.parent != store
        own = (_ENTRY.fullmatch(path.name) and path.is_file()) or (not within and path.is_dir())
        if path.is_symlink() or not own:
            found.append(str(path.relative_to(store)))
    return found


def clear_store(store: Path) -> None:
    """Delete what belongs to a store, but not the lock of the process that writes there."""
    others = set(_others(store))
    arrays = [path for path in store.iterdir() if path.is_dir() and not path.is_symlink()]
    for path in (path for place in (*arrays, store) for path in place.iterdir()):
        if not path.is_dir() and path.name != LOCK and str(path.relative_to(store)) not in others:
            path.unlink()
    for array in arrays:
        if not any(array.iterdir()):
            array.rmdir()


def refuse_changed(place: Path, facts: Mapping[str, Any], spec: Mapping[str, Any]) -> None:
    """Refuse to go on with a data set of another specification."""
    try:
        before = json.loads(facts["ballpass_spec"]) if facts.get("ballpass_data_set") == SCHEMA else None
    except (KeyError, TypeError, ValueError):
        before = None
    if not isinstance(before, Mapping):
        raise RequestError(f"{place}: this is no data set of this version of ballpass. Give a place that is new.")
    # the title is words; by default it is the name of a file
    if {**before, "title": ""} != {**spec, "title": ""}:
        raise RequestError(
            f"{place}: a data set of another specification is there: {_changes(before, spec)}. It is as it was. Give a "
            "place that is new, or delete it."
        )


def _changes(before: Any, now: Any, path: str = "") -> str:
    """What differs between two specifications, first difference at each place."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        keys = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        if path.endswith(".files"):
            return f"{path.removesuffix('.files')} is generated otherwise (another scene, or version of ballpass)"
        return "; ".join(_changes(before.get(key), now.get(key), f"{path}.{key}".lstrip(".")) for key in keys[:3])
    return f"{path} was {before!r}, and is {now!r} now"


def read_finished(path: Path, spec: Mapping[str, Any]) -> tuple[MemberFailure, ...]:
    """Failures of a NetCDF file that is there; RequestError where it is of another specification."""
    import h5netcdf

    try:
        refuse_other(path)
        with h5netcdf.File(path, "r", decode_vlen_strings=True) as file:
            refuse_changed(path, dict(file.attrs), spec)
            return read_failures({name: file.variables[name][...] for name in ("status", "failure")})
    except (OSError, KeyError) as fault:
        raise RequestError(f"{path}: this is no data set of ballpass ({fault}). Give a place that is new.") from None


def write_netcdf(group: Any, path: Path) -> None:
    """Write a finished data set as NetCDF-4, some members at a time: the whole file or none."""
    import h5netcdf
    import h5py

    with replaced(path) as new, h5netcdf.File(new, "w") as file:
        file.attrs.update(group.attrs)
        for name, array in group.arrays():
            facts = dict(array.attrs)
            dimensions = facts.pop("_ARRAY_DIMENSIONS")
            text = array.dtype.kind == "U"
            kind, how = (h5py.string_dtype(), {}) if text else (array.dtype, {"chunks": array.chunks})
            if not text and array.fill_value is not None:
                how["fillvalue"] = array.fill_value
            variable = create_variable(file, name, dimensions, array.shape, kind, facts, **how)
            for first in range(0, array.shape[0], array.chunks[0]):
                which = slice(first, first + array.chunks[0])
                values = array[which]
                variable[which] = values.astype(object) if text else values
