"""The methods' tableaus as C: ``method_tables.h``, which is compiled with the driver.

In: the registry of methods.  Out: a header with constant structures, unused entries zero, and one table of all methods.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import lru_cache

from ballpass.runtime.contract.method_registry import AUTO, METHODS
from ballpass.runtime.contract.tableaus import ExplicitTableau, RosenbrockTableau, Tableau, TableauError

#: Name of the header.
METHOD_TABLES = "method_tables.h"

#: Stages of a linearly implicit method within the step that the driver evaluates at once, with the end.
_MOST_INNER = 7

_TYPES = """\
typedef struct {
    int stages, inner, dense_rows; /* inner: times of stages between start and end */
    int place[BP_METHOD_STAGES];   /* time of each stage behind the first, `inner` for the end */
    double gamma;
    double inner_nodes[BP_METHOD_STAGES], nodes[BP_METHOD_STAGES], time_weights[BP_METHOD_STAGES];
    double a[BP_METHOD_STAGES][BP_METHOD_STAGES], coupling[BP_METHOD_STAGES][BP_METHOD_STAGES];
    double weights[BP_METHOD_STAGES], error_weights[BP_METHOD_STAGES];
    double dense[BP_DENSE_ROWS][BP_METHOD_STAGES];
} bp_rosenbrock_method;

/* Limits of stability: see StabilityLimits in contract/tableaus.py. */
typedef struct {
    double decay, undamped, damped, exponent, reach;
} bp_stability;

typedef struct {
    int stages, dense_stages, dense_rows, estimates;
    int times;                                            /* of stages behind the first, the step's end the last */
    double nodes[BP_METHOD_STAGES], a[BP_METHOD_STAGES][BP_METHOD_STAGES], weights[BP_METHOD_STAGES];
    double error[2][BP_METHOD_STAGES], error_share[2];
    double dense_nodes[BP_METHOD_STAGES], dense_a[BP_METHOD_STAGES][BP_METHOD_STAGES];
    double dense[BP_DENSE_ROWS][BP_METHOD_STAGES];
    bp_stability stability;
} bp_explicit_method;

/* A method of either family; the other one is NULL. */
typedef struct {
    const bp_explicit_method *plain;
    const bp_rosenbrock_method *linear;
    double error_exponent;
    int dense_degree; /* of the dense output */
} bp_method;"""


def method_tables() -> str:
    """Text of the header."""
    return _tables(tuple(METHODS))


@lru_cache(maxsize=1)
def _tables(_names: tuple[str, ...]) -> str:
    explicit = {name: t for name, t in METHODS.items() if isinstance(t, ExplicitTableau)}
    linear = {name: t for name, t in METHODS.items() if isinstance(t, RosenbrockTableau)}
    stages = max(*(t.stages for t in linear.values()), *(t.stages + 1 + len(t.dense_nodes) for t in explicit.values()))
    rows = max(*(len(t.dense_rows) for t in linear.values()), *(2 + len(t.dense_rows) for t in explicit.values()))
    low, high, implicit = (METHODS[name].number for name in AUTO)
    parts = [
        "/* Coefficients of the integration methods, from contract/methods: do not edit. */",
        "#ifndef BALLPASS_METHOD_TABLES_H\n#define BALLPASS_METHOD_TABLES_H\n#include <stddef.h>",
        f"enum {{ BP_METHODS = {1 + len(METHODS)}, BP_METHOD_STAGES = {stages}, BP_DENSE_ROWS = {rows} }};",
        "/* What `auto` chooses among: explicit methods of low and of high order, a linearly implicit one. */\n"
        f"enum {{ BP_AUTO_LOW = {low}, BP_AUTO_HIGH = {high}, BP_AUTO_LINEAR = {implicit} }};",
        _TYPES,
        *(_rosenbrock(name, tableau) for name, tableau in linear.items()),
        *(_explicit(name, tableau) for name, tableau in explicit.items()),
        "/* All methods by number; 0 is the choice among them. */\nstatic const bp_method bp_methods[BP_METHODS] = {\n"
        + ",\n".join(["    {0}", *(_entry(name, tableau) for name, tableau in METHODS.items())])
        + "};",
        "#endif",
    ]
    return "\n\n".join(parts) + "\n"


def _entry(name: str, t: Tableau) -> str:
    if isinstance(t, ExplicitTableau):
        return f"    {{&bp_{name}, NULL, {_number(t.error_exponent)}, {3 + len(t.dense_rows)}}}"
    return f"    {{NULL, &bp_{name}, {_number(t.error_exponent)}, {1 + len(t.dense_rows)}}}"


def _rosenbrock(name: str, t: RosenbrockTableau) -> str:
    inner = [node for node in t.nodes[1:] if node != 1]
    before = [sum(node != 1 for node in t.nodes[1:stage]) for stage in range(t.stages)]
    places = [len(inner) if node == 1 else place for node, place in zip(t.nodes, before, strict=True)]
    if len(inner) > _MOST_INNER:
        raise TableauError(f"{t.name}: {len(inner)} stages within the step, of which the driver takes {_MOST_INNER}")
    fields = {
        "stages": str(t.stages),
        "inner": str(len(inner)),
        "dense_rows": str(len(t.dense_rows)),
        "place": "{" + ", ".join(map(str, places)) + "}",
        "gamma": _number(t.gamma),
        "inner_nodes": _row(inner),
        "nodes": _row(t.nodes),
        "time_weights": _row(t.time_weights),
        "a": _rows(t.matrix),
        "coupling": _rows(t.coupling),
        "weights": _row(t.weights),
        "error_weights": _row(t.error_weights),
        "dense": _rows(t.dense_rows),
    }
    return _struct("bp_rosenbrock_method", name, t, fields)


def _explicit(name: str, t: ExplicitTableau) -> str:
    ends = t.nodes[-1] == 1  # the last stage is where the end slope is
    fields = {
        "stages": str(t.stages),
        "dense_stages": str(len(t.dense_nodes)),
        "dense_rows": str(len(t.dense_rows)),
        "estimates": str(len(t.error_estimates)),
        "times": str(t.stages - 1 if ends else t.stages),
        "nodes": _row(t.nodes if ends else (*t.nodes, Fraction(1))),
        "a": _rows(t.matrix),
        "weights": _row(t.weights),
        "error": _rows([e.weights for e in t.error_estimates]),
        "error_share": _row([e.share for e in t.error_estimates]),
        "dense_nodes": _row(t.dense_nodes),
        "dense_a": _rows(t.dense_matrix),
        "dense": _rows(t.dense_rows),
    }
    limits = t.stability
    if limits is not None:
        each = (limits.decay, limits.undamped, limits.damped, limits.exponent, limits.reach)
        fields["stability"] = "{" + ", ".join(map(_number, each)) + "}"
    return _struct("bp_explicit_method", name, t, fields)


def _struct(kind: str, name: str, t: Tableau, fields: Mapping[str, str]) -> str:
    body = ",\n".join(f"    .{key} = {value}" for key, value in fields.items())
    return f"/* {t.name}: {t.source} */\nstatic const {kind} bp_{name} = {{\n{body}}};"


def _number(value: Fraction | float) -> str:
    return repr(float(value))


def _row(values: Sequence[Fraction]) -> str:
    return "{" + (", ".join(_number(v) for v in values) or "0.0") + "}"


def _rows(rows: Sequence[Sequence[Fraction]]) -> str:
    return "{" + (", ".join(_row(r) for r in rows) or "{0.0}") + "}"
