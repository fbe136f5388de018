"""Points of a map in blocks: on the threads of this process or on a cluster, each kept until all are there.

In: a model, a table of points.  Out: `PointMotions` of all, in the order of the table.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import astuple, fields
from typing import Any

import numpy as np

from ballpass.runtime.ask.kept_parts import KeptParts
from ballpass.runtime.many.chunks import CHUNK, PATIENCE, chunk_size
from ballpass.runtime.many.cluster import loaded, refuse_other_clients, run_tasks
from ballpass.runtime.many.ensemble import thread_count
from ballpass.runtime.motion.map_points import MapRequest, PointMotions, motions
from ballpass.runtime.native.loaded_model import LoadedModel

#: What becomes of finished blocks where Dask gives up.
LOST = "Blocks that were finished are kept where a folder was given: the same call computes the rest."


def motions_in_blocks(
    model: LoadedModel,
    table: Mapping[str, np.ndarray],
    asked: MapRequest,
    parts: KeptParts,
    client: Any,
    progress: Callable[[float], None] | None,
) -> PointMotions:
    """Motions at all points.

    Parameters
    ----------
    table : overrides of each point, SI, each of shape (points,)
    client : of `dask.distributed`; None: threads of this process
    """
    if client is not None:
        refuse_other_clients(client)
    count = len(next(iter(table.values())))
    size = min(CHUNK, chunk_size(count, model.ensemble_driver.lanes))
    blocks = {
        first: {name: all_[first : first + size] for name, all_ in table.items()} for first in range(0, count, size)
    }
    keys = {first: np.array(list(block.values())) for first, block in blocks.items()}
    found = {first: arrays for first, key in keys.items() if (arrays := parts.read(key)) is not None}
    left = [(first, block, asked) for first, block in blocks.items() if first not in found]
    done = (
        _in_threads(model, left)
        if client is None
        else run_tasks(client, [model], _block, lambda names: ((names[0], *task) for task in left), LOST)
    )
    with closing(done):  # an interrupt here must end it at once
        for first, arrays in done:
            found[first] = parts.write(keys[first], arrays)
            if progress is not None:
                progress(len(found) / len(blocks))
    joined = {
        item.name: np.concatenate([found[first][k] for first in blocks]) for k, item in enumerate(fields(PointMotions))
    }
    joined["returns"] = joined["returns"].reshape(-1, 2).sum(axis=0)
    return PointMotions(**joined)


def _block(key: str, first: int, block: Mapping[str, np.ndarray], asked: MapRequest) -> tuple[int, Any]:
    """On a worker: where the block begins, and its arrays."""
    return first, astuple(motions(loaded(key), block, asked))


def _in_threads(model: LoadedModel, tasks: Sequence[tuple[int, Any, MapRequest]]) -> Generator[tuple[int, Any]]:
    stop = ctypes.c_int(0)
    with ThreadPoolExecutor(thread_count(None)) as pool:
        pending = {pool.submit(motions, model, block, asked, stop): first for first, block, asked in tasks}
        try:
            while pending:  # with a limit, so that an interrupt ends the wait on every system
                finished, _ = wait(pending, timeout=PATIENCE, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield pending.pop(future), astuple(future.result())
        except BaseException:
            stop.value = 1  # the pool waits for its threads
            for future in pending:
                future.cancel()
            raise
