"""From generated C to a shared library in the user's cache.

In: C sources.  Out: a `CompiledLibrary` whose file name carries the key of everything that made it: content of the
sources, compiler, flags, versions, processor; and, behind it, the digest of the library itself.  A library is compiled
under a temporary name and moved into place, so that a second process sees the whole file or none.  One that is not what
its name says (cut short, overwritten) is compiled anew: mapping half a library would end the process.  CasADi keeps the
code of a path it has opened: a changed source gets another key, hence another path.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import errno
import hashlib
import importlib.metadata
import importlib.util
import os
import platform
import re
import shlex
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from ballpass.runtime.contract.cache import CACHE_VARIABLE, CacheWarning, cache_folder, refuse_shared
from ballpass.runtime.contract.errors import ArtefactError, BallpassWarning, CompileError, RequestError
from ballpass.runtime.contract.extras import INSTALL_COMPILER, WITHOUT_COMPILER
from ballpass.runtime.contract.folder import read_unchanged
from ballpass.runtime.contract.folders import read_file
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.native.compilers import Compiler, find_compiler, run_compiler

#: Name of the C source in a generated folder.
SOURCE = "model.c"

#: Temporary files of this age were left by a process that was killed [s].
LEFT_BEHIND = 86_400.0

#: Names of these files: others' files may end alike.
_LEFT = re.compile(r"\..+-[0-9a-f]{32}-[a-z0-9_]{8}\.tmp")

#: Libraries that this process has opened, by path: they stay open, so that their functions can be had even where
#: another program empties the cache meanwhile.
_opened: dict[Path, ctypes.CDLL] = {}


class NoCompilerWarning(BallpassWarning):
    """No C compiler was found: the functions run in CasADi's virtual machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledLibrary:
    """A shared library.

    Attributes
    ----------
    path : the file; its name carries the key of all that made it
    cached : whether it was there already
    """

    path: Path
    cached: bool


def compile_model(folder: str | Path, manifest: Manifest, compiler: str | None = None) -> CompiledLibrary | None:
    """Library with the functions of a generated folder; None, with a warning, where there is no compiler.

    Parameters
    ----------
    folder : generated folder with ``model.c``
    manifest : its manifest; the scene's name starts the library's file name
    compiler : command of the compiler.  Default: $CC, cc, gcc, clang, ziglang, in this order

    Raises
    ------
    RequestError
        `compiler` or $CC names no program.
    CompileError
        The compiler failed.
    """
    found = find_compiler(compiler)
    if found is None:
        warnings.warn(
            "No C compiler was found ($CC, cc, gcc, clang, ziglang): the model runs in CasADi's virtual machine. "
            "Results are the same within the tolerance; a simulation takes some ten times as long, and extremes are "
            f"those of samples. {WITHOUT_COMPILER}. {INSTALL_COMPILER}.",
            NoCompilerWarning,
            stacklevel=5,  # the caller of `load`, which is checked
        )
        return None
    place = Path(folder).absolute()
    return compile_sources((place / SOURCE,), found, label=manifest.scene, digests=digests_of(place, manifest))


def digests_of(folder: Path, manifest: Manifest) -> dict[Path, str]:
    """sha256 that the files of a generated folder had when its manifest was read, by path."""
    return {folder / name: digest for name, digest in manifest.files}


def compile_sources(
    sources: Sequence[Path],
    compiler: Compiler,
    *,
    label: str = "model",
    headers: Sequence[Path] = (),
    made_headers: Mapping[str, str] | None = None,
    flags: tuple[str, ...] = (),
    digests: Mapping[Path, str] | None = None,
) -> CompiledLibrary:
    """Compile C sources together into one shared library, or find it in the cache.

    Each file is read once: what is compiled is what gave the key, whoever writes the files anew meanwhile.

    Parameters
    ----------
    sources : C files, absolute; their order and content enter the key, their place does not
    compiler : see `find_compiler`
    label : start of the library's file name
    headers : what the sources include, which enters the key as well; no two files of one name.  Nothing else is
        found: a header that lies in a folder by chance would be executed
    made_headers : texts of further headers by name, which are part of the key as well
    flags : further flags, behind the compiler's own
    digests : sha256 that files must have, by path; in folders without one of these files they may have any

    Raises
    ------
    ArtefactError
        A file has another digest, or none: the folder was written anew since its manifest was read.
    CompileError
        The compiler failed, took too long, or a source cannot be read; with command and output.
    """
    compiler = replace(compiler, flags=(*compiler.flags, *flags))
    contents = {path: _content(path, digests or {}) for path in (*sources, *headers)}
    contents |= {Path(name): text.encode() for name, text in (made_headers or {}).items()}
    name = f"{_file_name(label)}-{library_key(list(contents.values()), compiler)[:32]}"
    ready = _find(cache_folder(), name)
    if ready is not None:
        return CompiledLibrary(path=ready, cached=True)
    folder = _writable_cache_folder()
    _clear(folder)
    with tempfile.TemporaryDirectory(
        dir=folder, prefix=f".{name}-", suffix=".tmp", ignore_cleanup_errors=True
    ) as temporary:
        made = Path(temporary)
        _write_copies(made, contents)
        copies = tuple(str(made / path.name) for path in sources)
        library = made / f"library{library_suffix()}"
        library.touch()
        command = (*compiler.command, *compiler.flags, *copies, "-o", str(library), "-lm")
        shown = shlex.join((*compiler.command, *compiler.flags, *map(str, sources), "-o", library.name, "-lm"))
        run_compiler(command, made, shown)
        library.chmod(0o755)
        target = folder / f"{name}-{_digest(library)}{library_suffix()}"
        try:
            os.replace(library, target)
        except IsADirectoryError:
            raise CompileError(
                f"The folder {target} is in the way of a compiled library. Delete it, or set {CACHE_VARIABLE} to "
                "another folder."
            ) from None
        _open(target, shown)
    return CompiledLibrary(path=target, cached=False)


def _content(path: Path, digests: Mapping[Path, str]) -> bytes:
    if path in digests:
        return read_unchanged(path, digests[path])
    if any(path.parent == known.parent for known in digests):
        raise ArtefactError(f"{path}: the manifest does not name this file. Write the folder again, into an empty one.")
    try:
        return read_file(path)
    except OSError as fault:
        raise CompileError(f"{path}: cannot be read ({fault.strerror}). Write the folder again.") from fault


def _write_copies(folder: Path, contents: Mapping[Path, bytes]) -> None:
    names = [path.name for path in contents]
    if len(set(names)) < len(names):
        raise ValueError(f"two files of one name are compiled together: {', '.join(sorted(names))}")
    try:
        for path, content in contents.items():
            (folder / path.name).write_bytes(content)
    except OSError as fault:
        raise CompileError(
            f"The cache {folder.parent} cannot be written ({fault.strerror}). Nothing was written. Free some space, or "
            f"set {CACHE_VARIABLE} to another folder."
        ) from fault


def _find(folder: Path, name: str) -> Path | None:
    """The library of this name in the cache, opened; None, with a warning, where it is not what was written."""
    try:
        refuse_shared(folder)
        found = sorted(folder.glob(f"{name}-*{library_suffix()}"))
    except OSError:  # `_writable_cache_folder` says why
        found = []
    for path in found:
        if path in _opened:  # its code is in this process, whatever has become of the file
            return path
        try:
            whole = path.name == f"{name}-{_digest(path)}{library_suffix()}"
            if whole:
                _opened[path] = ctypes.CDLL(str(path))
                return path
            why = "it is not the file that was written"
        except FileNotFoundError:  # another process has deleted it meanwhile
            continue
        except OSError as fault:
            why = str(fault)
        warnings.warn(
            f"The library {path} in the cache is damaged ({why}): the model is compiled anew. Nothing is lost.",
            CacheWarning,
            stacklevel=5,
        )
        with contextlib.suppress(OSError):  # a folder, or not ours to delete: another name is taken then
            path.unlink()
    places = (folder, _private_folder()) if _private_folder.cache_info().currsize else (folder,)
    return next((path for path in _opened if path.parent in places and path.name.startswith(f"{name}-")), None)


def _open(path: Path, command: str) -> None:
    """Open a library just compiled; it stays open."""
    try:
        _opened[path] = ctypes.CDLL(str(path))
    except OSError as fault:
        path.unlink(missing_ok=True)
        raise CompileError(
            f"The C compiler ended well, but what it wrote cannot be loaded ({fault}).\n  {command}\n"
            "Nothing is kept. Take a compiler that makes shared libraries for this machine: set CC."
        ) from fault


def _digest(path: Path) -> str:
    """Digest of a file in the name of a library: 16 hexadecimal figures of its sha256."""
    return hashlib.sha256(read_file(path)).hexdigest()[:16]


def _clear(folder: Path) -> None:
    """Delete what processes that were killed while compiling left in the cache long ago."""
    for path in filter(lambda path: _LEFT.fullmatch(path.name), folder.glob(".*.tmp")):
        with contextlib.suppress(OSError):  # gone meanwhile, or of another user
            if time.time() - path.stat().st_mtime > LEFT_BEHIND:
                shutil.rmtree(path) if path.is_dir() else path.unlink()


def library_key(contents: Sequence[bytes], compiler: Compiler) -> str:
    """sha256 over contents of sources, compiler, flags, versions, system and processor."""
    digest = hashlib.sha256()
    facts = (
        compiler.identity,
        *compiler.command[1:],
        *compiler.flags,
        f"casadi {importlib.metadata.version('casadi')}",
        f"ballpass {__version__}",
        f"{platform.system()} {platform.machine()} {sys.maxsize > 2**32}",
        _processor(),
    )
    for fact in facts:
        digest.update(fact.encode() + b"\0")
    for content in contents:
        digest.update(str(len(content)).encode() + b"\0" + content)
    return digest.hexdigest()


def _refuse_unreadable(folder: Path) -> None:
    """Python's ctypes loads no library from a path that is not UTF-8."""
    try:
        os.fsencode(folder).decode()
    except UnicodeDecodeError:
        raise OSError(errno.EILSEQ, "its path is not UTF-8") from None


def _writable_cache_folder() -> Path:
    """The cache, made when missing; a folder of this process, with a warning, where the cache cannot be written."""
    folder = cache_folder()
    try:
        _refuse_unreadable(folder)
        refuse_shared(folder)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as fault:
        try:
            private = _private_folder()
        except OSError as second:
            raise RequestError(
                f"Neither the cache {folder} ({fault.strerror}) nor a temporary folder ({second.strerror or second}) "
                f"can be written, and compiled models need one. Set {CACHE_VARIABLE} to a folder you may write, "
                "or free some space."
            ) from fault
        warnings.warn(
            f"The cache {folder} cannot be written ({fault.strerror}): the model is compiled anew in every process, "
            f"this time into {private}, which is deleted at the end. Set {CACHE_VARIABLE} to a folder you may write.",
            CacheWarning,
            stacklevel=5,
        )
        return private
    return folder


@lru_cache(maxsize=1)
def _private_folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="ballpass-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@lru_cache(maxsize=1)
def _processor() -> str:
    """What -march=native depends on: a cache on a shared disk serves machines with different processors."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor()
    facts: dict[str, str] = {}
    for line in lines:
        label, _, value = line.partition(":")
        if label.strip() in ("model name", "flags", "Features", "CPU part", "isa"):
            facts.setdefault(label.strip(), value.strip())
    return repr(sorted(facts.items()))


def _file_name(label: str) -> str:
    return "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in label) or "model"


def library_suffix() -> str:
    """Ending of the names of libraries."""
    return {"Darwin": ".dylib", "Windows": ".dll"}.get(platform.system(), ".so")
