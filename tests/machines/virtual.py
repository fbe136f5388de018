"""Models that run in CasADi's virtual machine: for what is evaluated a few times and is not worth a compiler."""

from __future__ import annotations

from pathlib import Path

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model
from ballpass.runtime.contract.folder import read_manifest


def virtual_model(text: str, folder: Path) -> Model:
    """Model of a scene's text, written to `folder`."""
    generate(scene_from_text(text, folder.name), folder)
    return Model(folder, read_manifest(folder), None)
