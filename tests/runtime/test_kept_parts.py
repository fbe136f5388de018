"""What was computed survives a kill: a second call computes the rest, and answers as if nothing had happened."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ballpass.runtime import Model
from ballpass.runtime.ask.kept_parts import ENDING, Arrays, KeptParts, refuse_other_files
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.shares import drawn_members

CLEARANCE = "bearing.clearance=2 um:15 um"


def _optimize(rotor: Model, keep: Path | None) -> Any:
    return rotor.optimize("rms:inner.y", CLEARANCE, cycles=2, transient=1, starts=1, keep=keep, progress=False)


def _fit(rotor: Model, keep: Path | None) -> Any:
    t = np.arange(60) / 5e3
    clean = rotor.simulate(times=t, parameters={"bearing.clearance": 7e-6}, rtol=1e-9, progress=False)["inner.y"]
    data = {"time": t, "inner.y": clean + 1e-8 * np.random.default_rng(1).standard_normal(60)}
    return rotor.fit(data, CLEARANCE, starts=1, keep=keep, progress=False)


def _sobol(rotor: Model, keep: Path | None) -> Any:
    return rotor.sobol(CLEARANCE, "rms:inner.y", cycles=2, transient=1, samples=16, keep=keep, progress=False)


def _morris(rotor: Model, keep: Path | None) -> Any:
    return rotor.morris(CLEARANCE, "rms:inner.y", cycles=2, transient=1, base=16, keep=keep, progress=False)


def _bifurcation(rotor: Model, keep: Path | None) -> Any:
    return rotor.bifurcation("bearing.clearance=5 um:6 um:3", readings=20, settling=2, keep=keep, progress=False)


def _steady(rotor: Model, keep: Path | None) -> Any:
    pitch = {"bearing.pitch_diameter": 31.75e-3}  # cage ratio 3/8
    return rotor.steady(parameters=pitch, keep=keep, progress=False)


@pytest.mark.parametrize("ask", [_optimize, _fit, _sobol, _morris, _bifurcation, _steady])
def test_a_second_call_computes_the_rest_alone_and_gives_the_same_answer(
    ask: Callable[[Model, Path | None], Any],
    make_model: Callable[..., Model],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    rotor, keep = make_model("rotor"), tmp_path / "results" / "parts"
    monkeypatch.setattr(drawn_members, "BLOCK", 16)
    computed: list[np.ndarray] = []
    stop_after, once = [1_000_000], KeptParts.once

    def counted(self: KeptParts, key: np.ndarray, compute: Callable[[], Arrays], what: str = "") -> Arrays:
        def computing() -> Arrays:
            if len(computed) == stop_after[0]:
                raise KeyboardInterrupt
            computed.append(key)
            return compute()

        return once(self, key, computing, what)

    monkeypatch.setattr(KeptParts, "once", counted)
    whole = ask(rotor, tmp_path / "other")
    total, stop_after[0] = len(computed), len(computed) // 2
    computed.clear()
    with pytest.raises(KeyboardInterrupt):
        ask(rotor, keep)
    kept = len(list(keep.iterdir()))
    assert total // 2 - (ask is _bifurcation) <= kept <= total // 2  # its other direction is stopped on its way
    stop_after[0] = 1_000_000
    computed.clear()
    again = ask(rotor, keep)
    assert len(computed) == total - kept
    assert again.to_json() == whole.to_json()
    assert not keep.exists()


def test_parts_of_another_request_and_cut_files_are_not_taken(tmp_path: Path) -> None:
    key = np.arange(3.0)
    first, other = KeptParts(tmp_path, ("rtol", 1e-8)), KeptParts(tmp_path, ("rtol", 1e-9))
    assert first.once(key, lambda: (key, np.array(["words"])))[1].tolist() == ["words"]
    assert first.once(key, lambda: (-key,))[0].tolist() == [0.0, 1.0, 2.0]
    assert other.once(key, lambda: (-key,))[0].tolist() == [0.0, -1.0, -2.0]
    for path in tmp_path.iterdir():
        path.write_bytes(path.read_bytes()[:50])
    assert first.once(key, lambda: (2.0 * key,))[0].tolist() == [0.0, 2.0, 4.0]


def test_a_folder_in_which_a_part_was_being_written_is_no_file_of_others(tmp_path: Path) -> None:
    """What a killed call leaves; a folder in the place of a part is the user's."""
    name = f"{32 * '0'}{ENDING}"
    (tmp_path / f".{name}-abcd_123").mkdir()
    refuse_other_files(tmp_path)
    (tmp_path / name).mkdir()
    with pytest.raises(RequestError, match=f"no parts of a computation are there \\({name}\\)"):
        refuse_other_files(tmp_path)
