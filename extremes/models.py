"""Models of the tour: shipped scenes with replacements, generated and compiled once."""

from __future__ import annotations

import atexit
import hashlib
import shutil
import tempfile
from functools import cache
from pathlib import Path

from ballpass.derive import generate
from ballpass.derive.scene.read import scene_from_text
from ballpass.runtime import Model, load

ROOT = Path(__file__).resolve().parent.parent

Change = tuple[str, str]

#: Damping of the shipped press, and what stands there instead for each law.
SHIPPED_DAMPING = 'law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"'
DAMPING = {
    "none": 'law = "none"',
    "one-sided": SHIPPED_DAMPING,
    "one-sided-gated": 'law = "one-sided-gated"\nratio = "0.25e-5 s*mm^0.5"',
    "two-sided-gated": 'law = "two-sided-gated"\nratio = "0.25e-5 s*mm^0.5"',
    "tangent": 'law = "tangent"\nratio = "0.25e-5 s"',
}


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="ballpass-extremes-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def text_of(name: str, *changes: Change) -> str:
    """Text of a shipped scene with replacements, each of which must apply."""
    text = (ROOT / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        if old not in text:
            raise ValueError(f"{old!r} is not in {name}.toml")
        text = text.replace(old, new)
    return text


@cache
def made(name: str, *changes: Change) -> Model:
    """Model of a shipped scene with replacements."""
    text = text_of(name, *changes)
    place = _folder() / hashlib.sha256(text.encode()).hexdigest()[:16] / name
    return load(generate(scene_from_text(text, name), place))


def press(law: str = "one-sided", *changes: Change) -> Model:
    """The shipped press with a damping law, and with other replacements."""
    damping = ((SHIPPED_DAMPING, DAMPING[law]),) if law != "one-sided" else ()
    return made("punching_press", *damping, *changes)


def _lines(name: str, *starts: str) -> str:
    """Lines of a shipped scene that start so, which must follow each other."""
    return "\n".join(line for line in text_of(name).splitlines() if line.startswith(starts))


#: Replacements in the shipped press: an outer ring that does not move.
FIXED_RING: tuple[Change, ...] = (
    (
        _lines("punching_press", 'support = "elastic"', 'mass = "0.555 kg"', 'stiffness = "5e7', 'damping = "500'),
        'support = "fixed"',
    ),
    (_lines("punching_press", "outer = ", "outer_velocity = "), ""),
    ('"outer.*", ', ""),
)

#: Load of the shipped rotor, and loads instead of it.
ROTOR_LOAD = _lines("varying_compliance", "type = ", "force = ")
STEP_TABLE = 'type = "table"\ntime = ["0 s", "1 us"]\nx = ["0 N", "100 N"]\ny = ["0 N", "0 N"]'
HARMONIC = (
    'type = "harmonic"\nmean = ["196 N", "0 N"]\namplitude = ["20 N", "0 N"]\nfrequency = "40 Hz"\nphase = "0 deg"'
)


def rotor(*changes: Change) -> Model:
    """The shipped rotor in a fixed outer ring, with replacements."""
    return made("varying_compliance", *changes)
