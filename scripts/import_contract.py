"""Check the import contract: the runtime never needs the deriving half, SymPy or pint.

Two routes: every import statement under runtime/ is read (the command line, `cli.py` and `commands/`, serves both
halves and may import `ballpass.derive` inside functions), and a fresh interpreter that loads the runtime's modules is
asked what it holds.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FORBIDDEN = ("sympy", "pint", "ballpass.derive")
#: What the deriving half may use of the runtime: the contract between them.
SHARED = ("ballpass.runtime", "ballpass.runtime.contract")


def imports(path: Path) -> Iterator[tuple[int, str]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), str(path))):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            if node.module == "ballpass":
                yield from ((node.lineno, f"ballpass.{alias.name}") for alias in node.names)
            elif node.module == "ballpass.runtime":
                known = {p.stem for p in (ROOT / "runtime/ballpass/runtime").iterdir()}
                yield from (
                    (node.lineno, f"{node.module}.{a.name}" if a.name in known else node.module) for a in node.names
                )
            else:
                yield node.lineno, node.module


def violations() -> list[str]:
    found = []
    for path in sorted((ROOT / "runtime").rglob("*.py")):
        if "app" in path.parts:
            continue
        for line, name in imports(path):
            if any(name == f or name.startswith(f + ".") for f in FORBIDDEN):
                found.append(f"{path.relative_to(ROOT)}:{line}: runtime imports {name}")
    for path in sorted((ROOT / "derive").rglob("*.py")):
        for line, name in imports(path):
            if name.startswith("ballpass.runtime") and name not in SHARED and ".contract." not in name:
                found.append(f"{path.relative_to(ROOT)}:{line}: derive imports {name}")
    return found


def loaded() -> list[str]:
    """Forbidden modules in a process that imported every module of the runtime."""
    modules = sorted(
        ".".join(p.relative_to(ROOT / "runtime").with_suffix("").parts)
        for p in (ROOT / "runtime").rglob("*.py")
        if p.name != "__init__.py"
    )
    code = (
        f"import importlib, sys\nfor m in {modules!r}: importlib.import_module(m)\n"
        "bad = [m for m in sorted(sys.modules) if m.split('.')[0] in ('sympy', 'pint')"
        " or m.startswith('ballpass.derive')]\nprint('\\n'.join(bad))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return [f"loading the runtime brings {name}" for name in result.stdout.split()]


def main() -> int:
    found = violations() + loaded()
    for line in found:
        print(line, file=sys.stderr)
    print("import contract: " + ("broken" if found else "kept"))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
