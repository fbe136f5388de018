"""Kinds of machines that programs and FMUs are compiled for, by ziglang, from any one.

In: texts of sources, a kind.  Out: a program or shared library of them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.compilers import ZIG, need_zig, run_compiler


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A kind of machines.

    Attributes
    ----------
    triple : as ziglang names it; of Linux with the oldest C library that it runs with
    place : folder of its binaries in an FMU 3.0
    library, program : endings of names
    """

    triple: str
    place: str
    library: str
    program: str = ""


#: By the names of ``--target``.
TARGETS = {
    "linux-x86_64": Target(triple="x86_64-linux-gnu.2.17", place="x86_64-linux", library=".so"),
    "linux-arm64": Target(triple="aarch64-linux-gnu.2.17", place="aarch64-linux", library=".so"),
    "windows-x86_64": Target(triple="x86_64-windows-gnu", place="x86_64-windows", library=".dll", program=".exe"),
    "macos-arm64": Target(triple="aarch64-macos", place="aarch64-darwin", library=".dylib"),
    "macos-x86_64": Target(triple="x86_64-macos", place="x86_64-darwin", library=".dylib"),
}


def targets_of(asked: Sequence[str]) -> list[str]:
    """Names among `TARGETS` that are asked for, each by its name or the part before the hyphen: ``"windows"``.

    Raises
    ------
    RequestError
        An unknown name; the compiler for them is missing.
    """
    for name in asked:
        if not any(name in (known, known.partition("-")[0]) for known in TARGETS):
            raise RequestError(unknown_name("target", name, TARGETS))
    if asked:
        need_zig("Compiling for another system")
    return [known for known in TARGETS if known in asked or known.partition("-")[0] in asked]


def cross_compiled(
    texts: Mapping[str, str], target: str, flags: Sequence[str], sources: Sequence[str], name: str
) -> bytes:
    """What C files are compiled to, for a kind of machines.

    Parameters
    ----------
    texts : of the files, by name
    name : of the file that is made

    Raises
    ------
    CompileError
        The compiler failed.
    """
    command = ("-target", TARGETS[target].triple, *flags, *sources, "-o", name, "-lm")
    return compiled((*ZIG, *command), " ".join(("python -m ziglang cc", *command)), texts, name)


def compiled(command: tuple[str, ...], shown: str, texts: Mapping[str, str], name: str) -> bytes:
    """What a compiler makes of C files in a folder of their own; else as for `cross_compiled`.

    Parameters
    ----------
    shown : the command as a user may repeat it
    """
    with tempfile.TemporaryDirectory(prefix="ballpass-") as made:
        folder = Path(made)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        run_compiler(command, folder, shown)
        return (folder / name).read_bytes()
