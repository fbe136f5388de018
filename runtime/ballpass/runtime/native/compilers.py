"""C compilers: which one there is, what it can, and how it is run.

In: a command, $CC, or what is installed.  Out: a `Compiler`; and of its runs an end without children left behind.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import os
import shlex
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import FrameType

from ballpass.runtime.contract.errors import CompileError, RequestError
from ballpass.runtime.contract.extras import INSTALL_COMPILER, WITHOUT_COMPILER, can_derive, is_installed

#: -O1: straight-line code runs as fast as with -O2 and compiles in half to a third of the time; the stepper's driver
#: asks for more.  -ffp-contract=off: the same bits with and without fused multiply-add, so that results do not depend
#: on the processor.  -fno-math-errno: square roots without a branch for errno; outputs take a sixth less.
FLAGS = ("-O1", "-fPIC", "-shared", "-std=c99", "-ffp-contract=off", "-fno-math-errno")

#: ziglang's compiler, which compiles for other machines as well.
ZIG = (sys.executable, "-m", "ziglang", "cc")

#: Longest a compiler may take on an idle machine [s]; a generated file takes about one second, ten with a cold ziglang.
TIMEOUT = 300.0

#: Longest a compiler may take to tell its version [s].
ANSWER_TIMEOUT = 30.0

#: Time a compiler has to end, and to delete its temporary files, once it is asked to [s].
GRACE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Compiler:
    """A C compiler: command, flags and what identifies it (path and version)."""

    command: tuple[str, ...]
    flags: tuple[str, ...]
    identity: str


def find_compiler(command: str | None = None) -> Compiler | None:
    """The compiler to use, or None.

    Parameters
    ----------
    command : a command, with arguments or without.  Default: $CC, else the first of cc, gcc, clang, ziglang

    Raises
    ------
    RequestError
        `command`, or $CC, names no program.
    CompileError
        The compiler does not answer when it is asked for its version.
    """
    origin = "compiler" if command else "the environment variable CC"
    asked = command or os.environ.get("CC", "").strip()
    if asked:
        try:
            words = shlex.split(asked) or [""]
            path = shutil.which(words[0])
            fault = "" if path else f", but there is no program {words[0]!r}"
        except ValueError as error:
            path, fault = None, f", which is no command ({str(error).lower()})"
        if path is None:
            raise RequestError(
                f"{origin} names {asked!r}{fault}. Give the command of a C compiler (gcc, clang), or leave it unset."
            )
        return _describe((path, *words[1:]))
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            return _describe((path,))
    if is_installed("ziglang"):
        # zig compiles for the processor at hand by itself
        return Compiler(
            command=ZIG,
            flags=FLAGS,
            identity=f"ziglang {importlib.metadata.version('ziglang')}",
        )
    return None


def need_compiler(what: str, command: str | None = None) -> Compiler:
    """The compiler to use, as `find_compiler`.

    Parameters
    ----------
    what : what needs one, in words
    command : as for `find_compiler`

    Raises
    ------
    RequestError
        There is none.
    """
    found = find_compiler(command)
    if found is None:
        raise RequestError(without_compiler(what))
    return found


def need_zig(what: str) -> None:
    """Refuse with a `RequestError` where ziglang is missing.

    Parameters
    ----------
    what : what needs it, in words
    """
    if not is_installed("ziglang"):
        target = "ballpass[compiler]" if can_derive() else "ziglang"
        raise RequestError(
            f"{what} needs a compiler for other systems, ziglang, which is not installed; gcc and clang of a system do "
            f'not bring their libraries. Install it from PyPI: pip install "{target}".'
        )


def without_compiler(what: str) -> str:
    """Message where there is no compiler, of what needs one."""
    return (
        f"{what} needs a C compiler, and none was found ($CC, cc, gcc, clang, ziglang). {WITHOUT_COMPILER}. "
        f"{INSTALL_COMPILER}."
    )


@lru_cache(maxsize=16)
def _describe(command: tuple[str, ...]) -> Compiler:
    """Ask a compiler for its version, and whether it can compile for the processor at hand."""
    version = _ask((*command, "--version"))
    identity = f"{command[0]} {version.stdout.strip() if version is not None else ''}"
    native = _ask((*command, "-march=native", "-x", "c", "-E", os.devnull))
    flags = (FLAGS[0], "-march=native", *FLAGS[1:]) if native is not None and native.returncode == 0 else FLAGS
    return Compiler(command=command, flags=flags, identity=identity)


def _ask(command: tuple[str, ...]) -> subprocess.CompletedProcess[str] | None:
    """Answer of a short command, None where it cannot run: a broken compiler fails, loudly, when it compiles."""
    try:
        return _finish(command, None, ANSWER_TIMEOUT)
    except OSError:
        return None
    except subprocess.TimeoutExpired as fault:
        raise CompileError(
            f"The C compiler did not answer within {ANSWER_TIMEOUT:g} s.\n  {shlex.join(command)}\n"
            "Nothing was written. Try another compiler: set CC."
        ) from fault


def run_compiler(command: tuple[str, ...], folder: Path, shown: str) -> None:
    """Run the compiler in `folder`.

    Parameters
    ----------
    shown : the command as a user may repeat it

    Raises
    ------
    CompileError
        It failed, took too long or cannot be run; with command and output.
    """
    # of processor time, as far as other work leaves it
    busy = max(os.getloadavg()[0] / (os.cpu_count() or 1), 1.0) if hasattr(os, "getloadavg") else 1.0
    try:
        done = _finish(command, folder, TIMEOUT * busy)
    except subprocess.TimeoutExpired as fault:
        others = f", {busy:.2g} times as long as on an idle machine" * (busy > 1.0)
        raise CompileError(
            f"The C compiler did not finish within {TIMEOUT * busy:.3g} s{others}.\n  {shown}\nNothing was written. "
            "Wait until less else runs, or take a faster compiler: set CC, to gcc or clang in place of ziglang."
        ) from fault
    except OSError as fault:
        raise CompileError(
            f"The C compiler cannot be run ({fault}).\n  {shown}\nNothing was written. Try another compiler: set CC."
        ) from fault
    if done.returncode != 0:
        output = "\n".join(text for text in (done.stdout.strip(), done.stderr.strip()) if text) or "(no output)"
        output = output.replace(f"{folder}{os.sep}", "")
        raise CompileError(
            f"The C compiler failed with exit code {done.returncode}.\n  {shown}\n{output}\n"
            "Nothing was written. Check the compiler's installation, the free space of the cache and of the folder for "
            "temporary files, or set CC to another one."
        )


def _finish(command: tuple[str, ...], folder: Path | None, timeout: float) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; at a timeout or an interrupt it ends with all its children.

    A compiler is a driver that starts the real one: ending the driver alone leaves a child that holds the pipes, and
    reading them would wait for it.
    """
    process = None
    try:
        with _interrupted_behind():
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                start_new_session=True,
            )
        stdout, stderr = process.communicate(timeout=timeout)
    except BaseException:
        if process is not None:
            _end(process)
        raise
    return subprocess.CompletedProcess(command, process.returncode, stdout, stderr)


@contextlib.contextmanager
def _interrupted_behind() -> Iterator[None]:
    """An interrupt (Ctrl-C) within comes behind it: a process that has begun has a name then, by which it is ended."""
    before = signal.getsignal(signal.SIGINT)
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda *what: heard.append(what))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if heard:
        before(*heard[0])


def _end(process: subprocess.Popen[str]) -> None:
    """End a process and its children; politely first, so that they delete their temporary files."""
    if os.name != "posix":
        process.kill()
        return
    for number in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):  # all have ended
            os.killpg(process.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(GRACE)
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()
