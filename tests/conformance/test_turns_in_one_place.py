"""No module of the runtime but those of `time` reduces an angle by a turn, or reads what turns from a name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

RUNTIME = Path(__file__).parents[2] / "runtime/ballpass/runtime"

#: What a turn is called in a source.
A_TURN = re.compile(r"\bTURN\b|\bpi\b|\btau\b|\b360(\.0)?\b|\bfull\b")
REDUCING = {"mod", "fmod", "remainder"}
#: Ends of names of parameters and inputs that turn.
NAMES = re.compile(r"\.?(angular_frequency|part_angle_.*|excess_slip_\w+)")


def reductions(tree: ast.AST, source: str) -> Iterator[ast.expr]:
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
            divisor = ast.get_source_segment(source, node.right) or ""
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in REDUCING:
            divisor = ast.get_source_segment(source, node) or ""
        else:
            continue
        if A_TURN.search(divisor):
            yield node


def test_angles_are_reduced_by_turns_in_time_alone() -> None:
    found = []
    for path in sorted(RUNTIME.rglob("*.py")):
        source = path.read_text()
        if path.parent.name != "time":
            tree = ast.parse(source)
            found += [f"{path.name}:{node.lineno}" for node in reductions(tree, source)]
            words = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str))
            found += [f"{path.name}:{one.lineno} {one.value}" for one in words if NAMES.fullmatch(one.value)]
    assert not found


def test_a_reduction_is_seen() -> None:
    source = "a % TURN, np.mod(a, 2.0 * np.pi), math.remainder(a - b, math.tau), k % 8, '%d' % 7"
    assert len(list(reductions(ast.parse(source), source))) == 3
