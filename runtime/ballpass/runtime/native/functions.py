"""The generated functions of a model: compiled where there is a library, as expression graphs for derivatives.

In: a generated folder, its manifest, perhaps its compiled library.  Out: CasADi functions by name, and kernels and
loops that call them cheaply, each made when first asked for and kept.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi

from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.errors import ArtefactError, CompileError, RequestError
from ballpass.runtime.contract.folder import read_unchanged
from ballpass.runtime.contract.manifest import MODEL, Manifest
from ballpass.runtime.contract.options import Option, refuse_faults
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.casadi_integrators import make_integrator
from ballpass.runtime.native.compile import CompiledLibrary, compile_sources, digests_of
from ballpass.runtime.native.compilers import need_compiler
from ballpass.runtime.native.kernel import Array, CompiledKernel, CompiledLoop, Loop, PointLoop

#: Arguments of a function of outputs that change from sample to sample.
_MOVING = ("t", "x", "u")

_INTERVALS = Option(words="Equal output intervals.", least=1)

#: Names of derivatives.
_DERIVATIVE = re.compile(r"(?P<of>\w+?)_(?:jac_(?P<along>[a-z])|tangent)")

#: A source above this size [bytes] is compiled without optimization: what a compiler takes grows faster than its input,
#: and Jacobians of a bearing with every wave and five spalls (5 MB) take gcc 180 s with -O1, 27 s without.
LARGE = 2_000_000


class _OwnMemory(threading.local):
    """Kernels and loops of one thread: a call fills their memory and reads it, so no other thread may have them."""

    def __init__(self) -> None:
        self.kernels: dict[str, CompiledKernel] = {}
        self.loops: dict[tuple[str, tuple[str, ...]], PointLoop] = {}


class CompiledFunctions:
    """Functions of one generated folder by name.

    For any number of threads at once: each has kernels and loops of its own, which it must not hand to another.

    Attributes
    ----------
    folder : the generated folder, absolute
    manifest : what the folder consists of
    library : the compiled library of ``model.c``, None when CasADi's virtual machine runs the functions
    """

    def __init__(
        self, folder: Path, manifest: Manifest, library: CompiledLibrary | None, compiler: str | None = None
    ) -> None:
        self.folder = folder
        self.manifest = manifest
        self.library = library
        self._compiler = compiler
        self._where = {info.name: info.library for info in manifest.functions}
        self._libraries = {MODEL: library} if library is not None else {}
        self._read: set[str] = set()
        self._functions: dict[str, casadi.Function] = {}
        self._own = _OwnMemory()
        # what is shared is made once: re-entrant, for one function is made from another
        self._making = threading.RLock()
        self._symbolic: dict[str, casadi.Function] = {}
        self._integrators: dict[int, casadi.Function] = {}

    def has(self, name: str) -> bool:
        """Whether the manifest has a function of that name."""
        return isinstance(name, str) and name in self._where

    def function(self, name: str) -> casadi.Function:
        """CasADi function by name, compiled if possible.

        Raises
        ------
        RequestError
            The model has no such function.
        """
        self._require(name)
        if name not in self._functions:
            with self._making:
                self._functions[name] = self.symbolic(name) if self.library is None else self._external(name)
        return self._functions[name]

    def kernel(self, name: str) -> CompiledKernel:
        """Function by name on memory of its own."""
        self._require(name)
        if name not in self._own.kernels:
            self._own.kernels[name] = CompiledKernel(self.function(name))
        return self._own.kernels[name]

    @typed
    def loop(self, name: str, varying: tuple[str, ...]) -> PointLoop:
        """Function by name for many points at once; `varying` names the inputs that change between them."""
        if (name, varying) not in self._own.loops:
            function = self.function(name)
            if self.library is None:
                loop: PointLoop = Loop(function, varying)
            else:
                compiler = need_compiler("loop.c", self._compiler)
                loop = CompiledLoop(compiler, self._library(name).path, function, varying)
            self._own.loops[name, varying] = loop
        return self._own.loops[name, varying]

    @typed
    def sample_outputs(self, count: int, values: Mapping[str, Any], names: Sequence[str]) -> dict[str, Array]:
        """Outputs by name at `count` points, each of shape (count, rows).

        Parameters
        ----------
        values : t, x and u at the points, p and c
        names : of outputs that are no states

        Raises
        ------
        RequestError
            Wrong names, or values that are missing.
        """
        loop = self.loop("outputs", _MOVING)
        known = [info.name for info in self.manifest.outputs]
        unknown = [unknown_name("output", name, known) for name in names if name not in known]
        unknown += [f"values: {name} is missing." for name in loop.function.name_in() if name not in values]
        if unknown:
            raise RequestError("\n".join(unknown))
        fields = dict(zip(known, loop.function.name_out(), strict=True))
        results = loop(count, values, [fields[name] for name in names])
        return {name: results[fields[name]] for name in names}

    def symbolic(self, name: str) -> casadi.Function:
        """CasADi function by name as an expression graph, which can be differentiated further.

        Raises
        ------
        RequestError
            The model has no such function.
        ArtefactError
            The folder has none, or was written anew since its manifest was read.
        """
        self._require(name)
        where = self._where[name]
        path = self.folder / f"{where}.casadi"
        with self._making:
            if where not in self._read:
                self._symbolic |= _read_functions(path, dict(self.manifest.files)[path.name])
                self._read.add(where)
            if name not in self._symbolic:
                # derivatives are generated to C only; here they are made from what they belong to
                derivative = _DERIVATIVE.fullmatch(name)
                if derivative is None or not self.has(derivative["of"]):
                    raise ArtefactError(f"{path}: has no function {name!r}. Write the folder again.")
                self._symbolic[name] = _differentiate(self.symbolic(derivative["of"]), name, derivative["along"])
            return self._symbolic[name]

    def virtual_integrator(self, intervals: int) -> casadi.Function:
        """CasADi's integrator over a grid, in the virtual machine (see `casadi_integrators`)."""
        refuse_faults({"intervals": (int, _INTERVALS)}, {"intervals": intervals})
        intervals = int(intervals)
        with self._making:
            if intervals not in self._integrators:
                manifest = self.manifest
                sizes = {"u": len(manifest.inputs), "p": len(manifest.parameters), "c": len(manifest.constants)}
                made = make_integrator(self.symbolic("rhs"), sizes, intervals)
                self._integrators[intervals] = made
            return self._integrators[intervals]

    def _require(self, name: str) -> None:
        if not self.has(name):
            raise RequestError(unknown_name("function", name, [info.name for info in self.manifest.functions]))

    def _library(self, name: str) -> CompiledLibrary:
        """Library that holds a function, compiled when first asked for."""
        where = self._where[name]
        with self._making:
            if where not in self._libraries:
                source, label = self.folder / f"{where}.c", f"{self.manifest.scene}_{where}"
                compiler = need_compiler(source.name, self._compiler)
                digests = digests_of(self.folder, self.manifest)
                flags = ("-O0",) if source.stat().st_size > LARGE else ()
                self._libraries[where] = compile_sources((source,), compiler, label=label, flags=flags, digests=digests)
            return self._libraries[where]

    def _external(self, name: str) -> casadi.Function:
        library = self._library(name)
        try:
            return casadi.external(name, str(library.path))
        except RuntimeError as fault:
            raise CompileError(
                f"{library.path}: function {name!r} cannot be loaded. "
                f"Delete this file, and it is compiled anew.\n{fault}"
            ) from fault


def _read_functions(path: Path, digest: str) -> dict[str, casadi.Function]:
    content = read_unchanged(path, digest)  # CasADi does not survive every torn file
    try:
        stored = casadi.StringDeserializer(content.decode("ascii"))
        functions = [stored.unpack() for _ in range(int(stored.unpack()))]
    except (RuntimeError, SystemError, UnicodeError) as fault:
        raise ArtefactError(f"{path}: no functions can be read from it. Write the folder again.\n{fault}") from fault
    return {function.name(): function for function in functions}


def _differentiate(graph: casadi.Function, name: str, along: str | None) -> casadi.Function:
    """Sparse derivative by one argument, or along a direction of all (``dx`` for ``x``) where `along` is None."""
    result = graph.name_out(0)
    arguments = dict(zip(graph.name_in(), graph.sx_in(), strict=True))
    value = graph(*arguments.values())
    if along is not None:
        block = casadi.cse(casadi.jacobian(value, arguments[along]))
        return casadi.Function(name, [*arguments.values()], [block], [*arguments], [f"{result}_{along}"])
    return directional(name, arguments, value, f"d{result}")


def directional(name: str, arguments: Mapping[str, casadi.SX], value: casadi.SX, result: str) -> casadi.Function:
    """Derivative along a direction of all arguments, ``dx`` for ``x``."""
    directions = {f"d{key}": casadi.SX.sym(f"d{key}", argument.numel()) for key, argument in arguments.items()}
    moved = casadi.jtimes(value, casadi.vertcat(*arguments.values()), casadi.vertcat(*directions.values()))
    both = {**arguments, **directions}
    return casadi.Function(name, [*both.values()], [casadi.cse(casadi.densify(moved))], [*both], [result])
