"""Check that a fresh interpreter which loads every module of the runtime holds neither derive nor SymPy nor pint.

Import statements are checked by import-linter (pyproject.toml); this finds what reaches them through other packages.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

RUNTIME = Path(__file__).resolve().parent.parent / "runtime"

LOAD = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
print(*(m for m in sorted(sys.modules) if m.split(".")[0] in ("sympy", "pint") or m.startswith("ballpass.derive")))
"""


def main() -> int:
    """0 when no such module is loaded."""
    files = [path.relative_to(RUNTIME).with_suffix("") for path in sorted(RUNTIME.rglob("*.py"))]
    names = [".".join(path.parts) for path in files if path.name != "__init__"]
    done = subprocess.run([sys.executable, "-c", LOAD, *names], capture_output=True, text=True, check=True)
    for name in done.stdout.split():
        print(f"loading the runtime brings {name}", file=sys.stderr)
    return bool(done.stdout.split())


if __name__ == "__main__":
    sys.exit(main())
