"""What a generated folder was made from: the key that tells whether it is fresh.

Nothing here needs SymPy or CasADi, so that a fresh folder is found without waiting for them.  Numbers are not in the
signature: a changed number rewrites the manifest's defaults and nothing else.
"""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from pathlib import Path

from ballpass.derive.scene.records import Scene
from ballpass.runtime import contract as mf


def signature(scene: Scene) -> str:
    """Digest of everything but numbers that decides what is generated: structure, deriving sources, versions."""
    text = repr((mf.SCHEMA, scene.structure(), _sources(), versions()))
    return hashlib.sha256(text.encode()).hexdigest()


def source_key(path: Path) -> str:
    """Digest of a scene file, whatever its ends of lines, of the deriving sources and of the versions.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    digest = hashlib.sha256(repr((mf.SCHEMA, path.stem, _sources(), versions())).encode())
    digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def versions() -> tuple[tuple[str, str], ...]:
    """Names and versions of the packages that decide what is generated."""
    return tuple((name, version(name)) for name in ("ballpass", "casadi", "sympy"))


def run_info(scene: Scene) -> mf.RunInfo:
    """The run settings of a scene."""
    run = scene.run
    return mf.RunInfo(
        cycles=run.cycles,
        duration=run.duration,
        transient_cycles=run.transient_cycles,
        samples_per_cycle=run.samples_per_cycle,
        method=run.method,
        rtol=run.rtol,
    )


def _sources() -> str:
    """Digest of the deriving modules: a changed derivation makes every artefact stale."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.parent.rglob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
