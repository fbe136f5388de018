"""The page of machines to choose from has every scene that comes with ballpass, by the name that copies it."""

from __future__ import annotations

import re
from pathlib import Path

from ballpass.derive import shipped_scenes
from ballpass.derive.scene.shipped import shipped_data_sets

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_every_shipped_scene_has_a_picture_three_sentences_its_file_and_a_live_page() -> None:
    _, *sections = re.split(r"^## ", (DOCS / "machines.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    found = {}
    assert f"`ballpass new {next(iter(shipped_data_sets()))}`" in sections.pop()
    for section in sections:
        (name,) = re.findall(r"`ballpass new ([a-z-]+)`", section)
        (scene,) = re.findall(r"\.\./scenes/(\w+)\.toml", section)
        assert f'href="live/{scene}.html"' in section
        assert f"](images/machine_{scene}.png)" in section
        (words,) = re.findall(r"\n\n([A-Z][^\n<!]*\.)\n\n", section)
        assert len(re.findall(r"\.(?: |$)", words)) == 3, words
        found[name] = scene
    assert found == {name: path.stem for name, path in shipped_scenes().items()}


def test_landing_page_shows_the_live_press() -> None:
    assert 'src="live/punching_press.html"' in (DOCS / "index.md").read_text(encoding="utf-8")
