"""A machine has one answer, however it is described: the same numbers, names and refusals.

Each pair of `TWINS` is one machine described in two ways; every question is asked of both.  What is skipped stands in
`NOT_YET`, with the reason.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from one_machine import OTHERS, QUESTIONS, RUN, TWINS, Machine, Twin, ask, asked, differences
from quick_cases import long_but

from ballpass.runtime import Model
from ballpass.runtime.questions import QUESTIONS as REGISTERED
from ballpass.runtime.questions.question import declared

#: Patterns of a case, and why its two machines answer differently.  A line goes when its reason does.
NOT_YET: tuple[tuple[str, str], ...] = (
    (
        r"table and the same twice over two turns, motor: (explain|figures)",
        "where a torque drives a table is no input, and `Repetition` takes its turns as declared",
    ),
    (
        r"unbalance and harmonic load, shaft: steady",
        "words of the forcing name a load's rate for each component, though it is that of the shaft",
    ),
)

#: Cases of the quick suite, of few models: deriving and compiling them takes most of the time.
QUICK = (
    *(f"constant speed and a table of it, one-way: {question}" for question in ("quantities", "explain")),
    "constant speed and a table of it, one-way: settle",
    *(f"slip and a table of it, shaft: {question}" for question in ("quantities", "spectrum")),
    "table and the same twice over two turns, one-way: samples",
    "unbalance and harmonic load, shaft: quantities",
    "windows a turn on, shaft: quantities",
    "windows a turn on, one-way: passages",
    *(f"load and equal rows over time, shaft: {question}" for question in ("quantities", "life")),
    "frame turned, one-way: quantities",
    "frame mirrored, one-way: quantities",
    "other units, shaft: quantities",
    "other units of mass and time, shaft: life",
)


def _cases() -> list[str]:
    return [f"{twin}: {question}" for twin in TWINS for question in twin.questions or (*OTHERS, *QUESTIONS)]


_TWINS = {str(twin): twin for twin in TWINS}


@pytest.fixture(scope="module")
def answer(model_of: Callable[..., Model]) -> Callable[[Twin, Machine, str], Any]:
    """The answer of one of two machines; that of the first is found once for all pairs."""
    known: dict[tuple[str, str], Any] = {}

    def find(twin: Twin, machine: Machine, question: str) -> Any:
        key = (machine.text, question)
        if machine is twin.first and key in known:
            return known[key]
        found = ask(asked(twin, machine, model_of(machine.text + RUN)), question)
        if machine is twin.first:
            known[key] = found
        return found

    return find


@pytest.mark.parametrize("case", long_but(_cases(), *QUICK))
def test_one_machine_has_one_answer(
    case: str, answer: Callable[[Twin, Machine, str], Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for pattern, reason in NOT_YET:
        if re.match(pattern, case):
            pytest.skip(reason)
    monkeypatch.chdir(tmp_path)
    name, _, question = case.partition(": ")
    twin = _TWINS[name]
    found = differences(twin, *(answer(twin, machine, question) for machine in (twin.first, twin.second)))
    assert not found, "\n".join([f"{len(found)} differences:", *found[:10]])


def test_what_is_left_out_is_a_case() -> None:
    for pattern, _ in NOT_YET:
        assert any(re.match(pattern, case) for case in _cases()), pattern


def test_every_question_is_asked() -> None:
    """A question that is added to the registry needs a line in `QUESTIONS` of `one_machine.py`."""
    assert {declared(question).name for question in REGISTERED} == set(QUESTIONS)
