"""Bogacki–Shampine 3(2): three stages, the last at three quarters of the step, and the end slope; cubic dense output.

P. Bogacki, L. F. Shampine, A 3(2) pair of Runge–Kutta formulas, Appl. Math. Lett. 2 (1989) 321–325,
doi:10.1016/0893-9659(89)90079-7.  The dense output is the cubic through both ends and their slopes.
"""

from __future__ import annotations

from ballpass.runtime.contract.tableaus import ErrorEstimate, ExplicitTableau, row_of, rows_of

METHOD = ExplicitTableau(
    name="Bogacki–Shampine 3(2)",
    number=6,
    order=3,
    dense_order=3,
    nodes=row_of("0 1/2 3/4"),
    matrix=rows_of("", "1/2", "0 3/4"),
    weights=row_of("2/9 1/3 4/9"),
    error_estimates=(ErrorEstimate(weights=row_of("-5/72 1/12 1/9 -1/8"), order=2),),
    dense_nodes=(),
    dense_matrix=(),
    dense_rows=(),
    source="Bogacki & Shampine 1989, doi:10.1016/0893-9659(89)90079-7",
)
