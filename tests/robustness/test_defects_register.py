"""Claims about the register of defects: a test was seen to fail without each fix, and is still there."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def register() -> ModuleType:
    spec = importlib.util.spec_from_file_location("defects", ROOT / "scripts" / "defects.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["defects"] = module
    spec.loader.exec_module(module)
    return module


def test_a_test_was_seen_to_fail_without_every_fix_and_is_still_there(register: ModuleType) -> None:
    seen = json.loads(register.SEEN.read_text(encoding="utf-8"))
    defects = register.read_register()
    assert [defect.name for defect in defects if defect.name in seen] == list(seen)
    for defect in defects:
        if defect.name not in seen:  # the page says so
            continue
        test = seen[defect.name].split(":")[-1].partition("[")[0]
        sources = "".join((ROOT / file).read_text(encoding="utf-8") for file in defect.tests)
        ended = "no end within" in seen[defect.name] or "ends by signal" in seen[defect.name]
        assert ended or f"def {test}(" in sources, seen[defect.name]
    assert register.PAGE.read_text(encoding="utf-8") == register.page(defects, seen)
