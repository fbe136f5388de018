"""Links of README and the documentation lead somewhere: files and headings offline, addresses by their form."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import urlparse

import pytest

ROOT = Path(__file__).resolve().parents[2]
BUILT = {"_build", "auto_gallery", "generated"}
PAGES = [
    path
    for path in (*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md")))
    if not BUILT & set(path.relative_to(ROOT).parts)
]
LINK = re.compile(r"\]\(<?([^)\s>]*)>?\)")
ROLE = re.compile(r"\{doc\}`(?:[^`<]*<)?([^`>]+)>?`")


def plain(path: Path) -> str:
    """Text of a page without code."""
    text = re.sub(r"^ *```.*?^ *```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"(?<!\})`[^`\n]+`", "", text)


def anchors(path: Path) -> set[str]:
    """Names of the headings of a page, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ +(.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    bare = (re.sub(r"[`*$]|\]\([^)]*\)|\[", "", heading).lower() for heading in headings)
    return {re.sub(r"[^\w\- ]", "", heading).strip().replace(" ", "-") for heading in bare}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_headings(path: Path) -> None:
    for target in LINK.findall(plain(path)):
        parts = urlparse(target)
        if parts.scheme:
            assert parts.scheme in ("https", "mailto"), target
            assert parts.scheme == "mailto" or "." in parts.netloc, target
            continue
        file = (path.parent / parts.path).resolve() if parts.path else path
        assert file.exists(), f"{target}: no such file"
        assert file.is_relative_to(ROOT), target
        if parts.fragment and file.suffix == ".md":
            assert parts.fragment in anchors(file), f"{target}: no such heading"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_pages_named_by_roles_exist(path: Path) -> None:
    if path.parent != ROOT:  # files beside README are included from docs/
        for target in ROLE.findall(path.read_text(encoding="utf-8")):
            file = path.parent / f"{target}.md"
            assert file.exists() or target.startswith("auto_gallery/"), f"{target}: no such page"


def test_readme_shows_pictures_that_there_are() -> None:
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(pictures) >= 3
    for picture in pictures:
        assert (ROOT / picture).exists() or urlparse(picture).scheme == "https", picture
