"""Ensembles on clusters that fail: the message says what is lost, and which worker is at fault.

The cluster is a stand-in, so that nothing waits for the timeouts of Dask; `test_data_sets.py` has real ones.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from distributed import CancelledError, KilledWorker

from ballpass.runtime import Model, RequestError, SimulationError
from ballpass.runtime.many import cluster


class LostCluster(list[Any]):
    """Client and queue of futures: all tasks come back cancelled, as they do where the scheduler is gone."""

    add = list.append

    def nthreads(self) -> dict[str, int]:
        return {"worker": 1}

    def submit(self, *_: Any, **__: Any) -> Future:
        def result() -> None:
            raise CancelledError("part", "scheduler-connection-lost", "Please re-run your work.")

        return Future(result)

    def nothing(self, *_: Any, **__: Any) -> None:
        pass

    wait_for_workers = register_plugin = unregister_worker_plugin = cancel = nothing


class Future:
    def __init__(self, result: Callable[[], None]) -> None:
        self.result = result


def test_members_of_a_lost_scheduler_are_not_said_to_be_kept(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = SimpleNamespace(
        as_completed=LostCluster, KilledWorker=KilledWorker, CancelledError=CancelledError, WorkerPlugin=object
    )
    monkeypatch.setattr(cluster, "need", lambda _: made)
    table = {"bearing.clearance": np.linspace(5e-6, 1e-5, 5)}
    with pytest.raises(SimulationError, match="members simulated before are lost: call simulate_many again") as caught:
        make_model("rotor").simulate_many(table, ["max:ball.force"], cycles=1, client=LostCluster())
    assert "kept" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_worker_without_a_compiler_says_which_it_is(
    make_model: Callable[..., Model], monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = cluster.pack(make_model("rotor"))
    cluster._receive([packed])
    worker = f"The worker on {socket.gethostname()}, process {os.getpid()}"
    monkeypatch.setenv("CC", "/no/such/cc")  # which did not say that it is a worker's
    with pytest.raises(RequestError, match=f"{worker}: the environment variable CC names '/no/such/cc'"):
        cluster.loaded(packed.key)
    monkeypatch.setattr("ballpass.runtime.native.compilers.find_compiler", lambda command=None: None)
    with pytest.raises(RequestError, match=f"{worker}: it needs a C compiler"):
        cluster.loaded(packed.key)
