"""Read a solution that was saved: by `Solution.save`, `Model.stream`, or ``ballpass run``.

In: a file.  Out: its `Solution`, or an error where the file has another format, is cut short or was edited.
"""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path

import numpy as np

from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import read_file
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.status import Status
from ballpass.runtime.run.reductions import Reductions
from ballpass.runtime.solution.netcdf import SEAL_LENGTH, seal
from ballpass.runtime.solution.solution import FILE_SCHEMA, Solution, Statistics


@typed
def load_solution(path: str | Path) -> Solution:
    """Read a solution that `Solution.save` wrote.

    Raises
    ------
    RequestError
        There is no such file, it has another format, or it was cut short or edited.

    Examples
    --------
    >>> path = model.simulate(cycles=1).save("press.nc")
    >>> load_solution(path).manifest.title
    'Punching machine of the paper'
    """
    try:
        content = read_file(path)
    except FileNotFoundError:
        raise RequestError(f"{path}: there is no such file. `Solution.save` and `ballpass run` write one.") from None
    except (OSError, ValueError) as fault:  # a folder, no permission; no path
        raise RequestError(
            f"{path}: cannot be read ({getattr(fault, 'strerror', None) or fault}). A file that `Solution.save` or "
            "`ballpass run` wrote is expected."
        ) from None
    return read_bytes(path, content)


def read_bytes(path: str | Path, content: bytes) -> Solution:
    """Solution from the bytes of a file; errors as for `load_solution`."""
    inner = content[:-SEAL_LENGTH]
    if content[-SEAL_LENGTH:] != seal(hashlib.sha256(inner).hexdigest()):
        ours = content.startswith(b"\x89HDF")
        what = "the digest at its end does not fit its content" if ours else "not a NetCDF-4 file"
        raise RequestError(
            f"{path}: {what}: cut short, edited, or written by something else than `Solution.save` of this version. "
            "Give a file that it wrote, or run the scene again."
        )
    return _read(path, inner)


def _read(path: str | Path, content: bytes) -> Solution:
    """Solution from the bytes of an unchanged file."""
    import h5netcdf

    with h5netcdf.File(io.BytesIO(content), "r") as stored:
        facts = dict(stored.attrs)
        schema = facts.get("ballpass_schema")
        if schema is None or int(schema) != FILE_SCHEMA:
            raise RequestError(
                f"{path}: layout {schema!r} was found, this version reads layout {FILE_SCHEMA}. Run the scene again."
            )
        values = {name: variable[...] for name, variable in stored.variables.items()}
    manifest = Manifest.from_json(facts["ballpass_manifest"], source=f"{path}, manifest")
    statistics = json.loads(facts["ballpass_statistics"])
    statistics["magnitudes"] = tuple(statistics["magnitudes"])
    if statistics.get("initial") is not None:
        statistics["initial"] = tuple(statistics["initial"])
    columns = [values[state.name] for state in manifest.states]
    t = values["time"]
    return Solution(
        t=t,
        x=np.stack(columns, axis=1) if columns else np.zeros((len(t), 0)),
        outputs={name: values[name] for name in json.loads(facts["ballpass_outputs"])},
        parameters=json.loads(facts["ballpass_parameters"]),
        constants=json.loads(facts["ballpass_constants"]),
        manifest=manifest,
        statistics=Statistics(**statistics),
        status=Status[facts["status"]],
        reductions=_reductions(facts.get("ballpass_reductions")),
        steady_reductions=_reductions(facts.get("ballpass_steady_reductions")),
        **json.loads(facts["ballpass_run"]),
    )


def _reductions(text: str | None) -> Reductions | None:
    facts = None if text is None else json.loads(text)
    return None if facts is None else Reductions.from_facts(facts)
