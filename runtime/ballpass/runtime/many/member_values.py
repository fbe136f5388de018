"""Quantities that steps do not reduce, member by member of an ensemble.

In: an ensemble under way, quantities.  Out: their values; members with unknown values, and why.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.many.chunks import Work, member_run, note_failure
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.run.loop import RunFailed


def measure_members(
    work: Work,
    quantities: Sequence[Quantity],
    able: np.ndarray,
    found: np.ndarray,
    threads: int,
    progress: Callable[[float], None],
) -> bool:
    """Evaluate quantities that steps do not reduce, member by member; whether the user interrupted.

    Parameters
    ----------
    found : filled, NaN for a quantity that is not known, shape (members, quantities)
    """
    own = threading.local()  # a `QuantityRun` is not for several threads

    def measure(member: int, which: tuple[int, ...]) -> tuple[dict[int, float], RequestError | SimulationError | None]:
        """Values by their place, and why some are not known."""
        runs = own.__dict__.setdefault("runs", {})
        if which not in runs:
            runs[which] = QuantityRun(work.model, [quantities[k] for k in which])
        try:
            values = runs[which].measure(member_run(work, member)).values.tolist()
            return dict(zip(which, values, strict=True)), None
        except (RequestError, SimulationError) as fault:
            known: dict[int, float] = {}
            if len(which) > 1:  # one by one
                for k in which:
                    known |= measure(member, (k,))[0]
            return known, fault

    every = tuple(range(len(quantities)))
    with ThreadPoolExecutor(max_workers=threads, thread_name_prefix="ballpass") as pool:
        pending = [pool.submit(measure, member, every) for member in able.tolist()]
        done = 0
        try:
            for member, future in zip(able.tolist(), pending, strict=True):
                values, fault = future.result()
                done += 1
                found[member, list(values)] = list(values.values())
                if fault is not None and member not in work.results:
                    ended = (fault.status.name, fault.time) if isinstance(fault, RunFailed) else ("REFUSED", 0.0)
                    note_failure(work, member, ended[0], str(fault), ended[1])
                progress(done / len(pending))
        except KeyboardInterrupt:
            for future in pending:
                future.cancel()
            for member in able[done:].tolist():
                note_failure(work, member, "INTERRUPTED", "Interrupted before it was done.")
            return True
    return False
