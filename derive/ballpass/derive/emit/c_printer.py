"""C99 text of small CasADi functions, to be inlined.

In: an SX function.  Out: a ``static inline`` function whose body is straight-line code over local scalars.
CasADi's own
code generator passes everything through pointer tables, which no compiler turns into SIMD lanes; compilers do so with
this text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType

import casadi as ca

#: Largest denominator of an exponent that is taken for a fraction; `driver/powers.h` has roots so high.
HIGHEST_ROOT = 12

#: So many zeros of a result are written in a loop: bearings that do not feel each other leave most of a Jacobian empty.
MANY_ZEROS = 32

_TEXTS = {
    ca.OP_NEG: "-{0}",
    ca.OP_NOT: "!{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2.0 * {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_ASSIGN: "{0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIN: "bp_sin1({0})",
    ca.OP_COS: "bp_cos1({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_FLOOR: "floor({0})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_SIGN: "(double)(({0} > 0.0) - ({0} < 0.0))",
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_POW: "pow({0}, {1})",
    ca.OP_CONSTPOW: "pow({0}, {1})",
    ca.OP_ATAN2: "bp_atan2({0}, {1})",
    ca.OP_FMIN: "fmin({0}, {1})",
    ca.OP_FMAX: "fmax({0}, {1})",
    ca.OP_LT: "(double)({0} < {1})",
    ca.OP_LE: "(double)({0} <= {1})",
    # of comparisons, 0 or 1; loops around && or || become no vectors
    ca.OP_AND: "(double)({0} * {1} != 0.0)",
    ca.OP_OR: "(double)({0} + {1} != 0.0)",
    # a selection, not a product: the value that is not selected may be NaN
    ca.OP_IF_ELSE_ZERO: "({0} != 0.0 ? {1} : 0.0)",
}

#: An instruction of a function, asked for once: its operation, where its result goes, where its arguments are.
_Step = tuple[int, list[int], list[int]]


def print_function(
    function: ca.Function,
    *,
    prefix: str,
    description: str,
    scalars: frozenset[str] = frozenset(),
    lanes: str = "",
    varying: frozenset[str] = frozenset(),
    strided: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """C99 text of an SX function.

    Every argument is ``const double *restrict``, every result ``double *restrict``, both dense and column-major;
    arguments named in `scalars` are passed by value.

    Parameters
    ----------
    lanes : C constant; where given, the function is evaluated for so many points in one loop that compilers turn
        into SIMD
        lanes.  Results, and arguments named in `varying`, then hold that many values for each entry, next to each other
    varying : arguments that differ from lane to lane
    strided : arguments that are the same in all lanes, one column of results in lanes: how far their entries are apart

    Raises
    ------
    TypeError
        An operation has no C text here, or a result is sparse.
    """
    by_value = scalars - varying if lanes else scalars
    arguments = [f"double {n}" if n in by_value else f"const double *restrict {n}" for n in function.name_in()]
    results = [f"double *restrict {n}" for n in function.name_out()]
    for k in range(function.n_out()):
        if not function.sparsity_out(k).is_dense():
            raise TypeError(f"{function.name()}: the result {function.name_out(k)} is sparse; make it dense first")
    name = f"{prefix}{function.name()}{'_lanes' if lanes else ''}"
    head = [f"/* {description} */", f"static inline void {name}({', '.join(arguments + results)})", "{"]
    steps: list[_Step] = [
        (function.instruction_id(k), function.instruction_output(k), function.instruction_input(k))
        for k in range(function.n_instructions())
    ]
    head += _unused(function, steps)
    void = _zeros(function, steps)
    for k in range(function.n_out()):
        if any(out == k for out, _ in void.values()):
            size = f"{function.size1_out(k) * function.size2_out(k)}{f' * {lanes}' if lanes else ''}"
            head.append(f"    for (int i = 0; i < {size}; i++) {function.name_out(k)}[i] = 0.0;")
    body: list[str] = []
    if lanes:
        body += ["#pragma omp simd", f"    for (int lane = 0; lane < {lanes}; lane++) {{"]
    indent = "        " if lanes else "    "
    declared: set[int] = set()
    inverses = _shared_divisors(steps)
    exponents, silent = _fractional_exponents(function, steps)
    #: of each register, what holds its present value; in lanes what all share is computed before the loop: a choice
    #: that all lanes share, or a number that only one side of a choice loads, keep gcc from making vectors
    held: dict[int, str] = {}
    shared: set[str] = set()
    for k, (operation, out, take) in enumerate(steps):
        if k in silent or k in void:
            continue
        if operation == ca.OP_OUTPUT:
            place = f"{out[1]} * {lanes} + lane" if lanes else str(out[1])
            body.append(f"{indent}{function.name_out(out[0])}[{place}] = {held[take[0]]};")
            continue
        same = bool(lanes)
        taken: list[str] = []
        if operation == ca.OP_INPUT:
            name = function.name_in(take[0])
            place = str(take[1])
            if lanes and name in varying:
                place, same = f"{take[1]} * {lanes} + lane", False
            elif lanes and name in strided:
                place = f"{take[1]} * {strided[name]}"
            text = name if name in by_value else f"{name}[{place}]"
        elif operation == ca.OP_CONST:
            text = _literal(function.instruction_constant(k))
        else:
            taken = [held[place] for place in (take[:1] if k in exponents else take)]
            same = same and shared.issuperset(taken)
            if k in exponents:
                text = f"bp_power({taken[0]}, {exponents[k].numerator}, {exponents[k].denominator})"
            elif k in inverses:
                name, first = inverses[k]
                if first and taken[1] in shared:
                    head.append(f"    const double {name} = 1.0 / {taken[1]};")
                elif first:
                    body.append(f"{indent}const double {name} = 1.0 / {taken[1]};")
                text = f"{taken[0]} * {name}"
            elif operation in _TEXTS:
                text = _TEXTS[operation].format(*taken)
            else:
                raise TypeError(f"{function.name()}: operation {operation} has no C text")
        if same:
            held[out[0]] = f"s{k}"
            shared.add(f"s{k}")
            head.append(f"    const double s{k} = {text};")
        else:
            held[out[0]] = f"w{out[0]}"
            body.append(f"{indent}{'' if out[0] in declared else 'double '}w{out[0]} = {text};")
            declared.add(out[0])
    return "\n".join([*head, *body, *(["    }"] if lanes else []), "}"])


def _fractional_exponents(function: ca.Function, steps: Sequence[_Step]) -> tuple[dict[int, Fraction], set[int]]:
    """Exponents of powers that `bp_power` has, by instruction, and the constants that nothing else uses."""
    made_by: dict[int, int] = {}
    found: dict[int, Fraction] = {}
    silent: set[int] = set()
    used: set[int] = set()
    for k, (operation, out, take) in enumerate(steps):
        if operation in (ca.OP_POW, ca.OP_CONSTPOW):
            held = made_by[take[1]]
            if steps[held][0] == ca.OP_CONST:
                exponent = function.instruction_constant(held)
                near = Fraction(exponent).limit_denominator(HIGHEST_ROOT)
                if near.denominator > 2 and abs(float(near) - exponent) < 1e-14:
                    found[k], take = near, take[:1]
                    silent.add(held)
        if operation != ca.OP_INPUT:
            used |= {made_by[place] for place in take}
        if operation != ca.OP_OUTPUT:
            made_by[out[0]] = k
    return found, silent - used


def _zeros(function: ca.Function, steps: Sequence[_Step]) -> dict[int, tuple[int, int]]:
    """Instructions that write the zeros of results with many: result and entry."""
    zero: dict[int, bool] = {}
    found: dict[int, tuple[int, int]] = {}
    for k, (operation, out, take) in enumerate(steps):
        if operation == ca.OP_OUTPUT:
            if zero[take[0]]:
                found[k] = (out[0], out[1])
        else:
            zero[out[0]] = operation == ca.OP_CONST and function.instruction_constant(k) == 0.0
    counts = Counter(result for result, _ in found.values())
    return {k: of for k, of in found.items() if counts[of[0]] >= MANY_ZEROS}


def _shared_divisors(steps: Sequence[_Step]) -> dict[int, tuple[str, bool]]:
    """Divisions by a number that other divisions share, by instruction: the name of its inverse, and whether it is
    the first.

    A division costs as much as several products, and vectors of them more so.
    """
    made_by: dict[int, int] = {}
    divisions: dict[int, list[int]] = {}
    for k, (operation, out, take) in enumerate(steps):
        if operation == ca.OP_DIV:
            divisions.setdefault(made_by[take[1]], []).append(k)
        if operation != ca.OP_OUTPUT:
            made_by[out[0]] = k
    shared = [places for places in divisions.values() if len(places) > 1]
    return {k: (f"i{number}", k == places[0]) for number, places in enumerate(shared) for k in places}


def print_array(name: str, values: list[float]) -> str:
    """``static const double`` array; at least of length one, since C has no arrays of length zero."""
    body = ", ".join(_literal(v) for v in values) or "0.0"
    return f"static const double {name}[{max(len(values), 1)}] = {{{body}}};"


def _literal(value: float) -> str:
    text = repr(float(value))
    return text if any(mark in text for mark in ".en") else text + ".0"


def _unused(function: ca.Function, steps: Sequence[_Step]) -> list[str]:
    """Silence warnings on arguments a model does not need."""
    used = {take[0] for operation, _, take in steps if operation == ca.OP_INPUT}
    return [f"    (void){function.name_in(k)};" for k in range(function.n_in()) if k not in used]
