"""What the numbers were measured on: processor, compiler, versions.  No paths, no names of machines."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path

from ballpass.runtime.native.compilers import find_compiler

PACKAGES = ("casadi", "numpy", "scipy", "sympy", "numba", "numbalsoda", "scikit-sundae", "jax", "diffrax")


def machine() -> dict[str, object]:
    """Facts for the page."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "vectors": _vectors(),
        "system": f"{platform.system()} {platform.machine()}",
        "compiler": _compiler(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in PACKAGES},
        "load": load(),
    }


def load() -> float | None:
    """Programs that wanted a processor during the last minute, ours included; None where the system does not tell."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None


def _lines() -> list[str]:
    try:
        return Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []


def _fact(label: str) -> str:
    return next((line.partition(":")[2].strip() for line in _lines() if line.partition(":")[0].strip() == label), "")


def _processor() -> str:
    name = _fact("model name") or platform.processor() or platform.machine()
    family, model = _fact("cpu family"), _fact("model")
    return f"{name} (family {family}, model {model})" if family else name


def _vectors() -> str:
    flags = _fact("flags").split()
    return next((words for flag, words in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "")


def _compiler() -> str:
    found = find_compiler()
    if found is None:
        return "none"
    answer = subprocess.run((*found.command, "--version"), capture_output=True, text=True, check=False)
    return answer.stdout.splitlines()[0] if answer.stdout else "unknown"


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
