"""Count the lines of code of derive and runtime and hold them against the budget in ``code_lines.txt``.

A line of code holds anything but a comment or a docstring.  Without arguments it prints the count of each package, and
fails above the budget; `--lower` writes the count into the file where it is below.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUDGET = HERE / "code_lines.txt"
PACKAGES = ("derive", "runtime")
SOURCES = (".py", ".pyi")

_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def code_lines(text: str) -> int:
    """Lines of Python source that hold code."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
            node, clean=False
        ):
            lines -= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return len(lines)


def main() -> int:
    """0 within the budget."""
    counts = {
        package: sum(
            code_lines(path.read_text()) for path in (HERE.parent / package).rglob("*.py*") if path.suffix in SOURCES
        )
        for package in PACKAGES
    }
    total, budget = sum(counts.values()), int(BUDGET.read_text())
    print(*(f"{package} {count}" for package, count in counts.items()), f"total {total} of {budget}", sep=", ")
    if total > budget:
        print(
            f"{total - budget} lines of code more than the budget: delete as many elsewhere.  Raising the number in "
            f"{BUDGET.relative_to(HERE.parent)} is a commit of its own that says what for.",
            file=sys.stderr,
        )
        return 1
    if "--lower" in sys.argv[1:]:
        BUDGET.write_text(f"{total}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
