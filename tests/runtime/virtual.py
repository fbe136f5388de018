"""Models that run in CasADi's virtual machine: for what is evaluated a few times and is not worth a compiler."""

from __future__ import annotations

from pathlib import Path

from raceway.derive import generate
from raceway.derive.read import scene_from_text
from raceway.runtime import Model
from raceway.runtime.manifest import read_manifest


def virtual_model(text: str, folder: Path) -> Model:
    """Model of a scene's text, written to `folder`."""
    generate(scene_from_text(text, folder.name), folder)
    return Model(folder, read_manifest(folder), None)
