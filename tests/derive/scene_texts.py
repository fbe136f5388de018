"""Texts of two shipped scenes, and edits of them that must apply."""

from __future__ import annotations

from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes"
PRESS = (SCENES / "punching_press.toml").read_text(encoding="utf-8")
ROTOR = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")


def edited(text: str, old: str, new: str) -> str:
    """The text with `new` in the place of `old`, which stands in it once."""
    assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
    return text.replace(old, new)
