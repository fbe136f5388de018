"""Dormand–Prince 5(4): six stages, the end slope in the error estimate, dense output of order 4 without further stages.

J. R. Dormand, P. J. Prince, A family of embedded Runge–Kutta formulae, J. Comput. Appl. Math. 6 (1980) 19–26,
doi:10.1016/0771-050X(80)90013-3.  Dense output: L. F. Shampine, Some practical Runge–Kutta formulas, Math. Comp. 46
(1986) 135–150, doi:10.1090/S0025-5718-1986-0815836-3, in the nested form of E. Hairer, S. P. Nørsett, G. Wanner,
Solving Ordinary Differential Equations I, Springer 1993, section II.6, doi:10.1007/978-3-540-78862-1.
"""

from __future__ import annotations

from ballpass.runtime.contract.tableaus import ErrorEstimate, ExplicitTableau, StabilityLimits, row_of, rows_of

METHOD = ExplicitTableau(
    name="Dormand–Prince 5(4)",
    number=3,
    order=5,
    dense_order=4,
    nodes=row_of("0 1/5 3/10 4/5 8/9 1"),
    matrix=rows_of(
        "",
        "1/5",
        "3/40 9/40",
        "44/45 -56/15 32/9",
        "19372/6561 -25360/2187 64448/6561 -212/729",
        "9017/3168 -355/33 46732/5247 49/176 -5103/18656",
    ),
    weights=row_of("35/384 0 500/1113 125/192 -2187/6784 11/84"),
    error_estimates=(
        ErrorEstimate(weights=row_of("71/57600 0 -71/16695 71/1920 -17253/339200 22/525 -1/40"), order=4),
    ),
    dense_nodes=(),
    dense_matrix=(),
    dense_rows=rows_of(
        "-12715105075/11282082432 0 87487479700/32700410799 -10690763975/1880347072 701980252875/199316789632"
        " -1453857185/822651844 69997945/29380423",
    ),
    source="Dormand & Prince 1980, doi:10.1016/0771-050X(80)90013-3;"
    " Shampine 1986, doi:10.1090/S0025-5718-1986-0815836-3",
    # of an oscillation: a fit within 6 %; 1.00 without damping, 1.38 at a ratio of 0.001, 1.87 at 0.01, 2.68 at 0.1,
    # 3.35 at 0.4
    stability=StabilityLimits(decay=3.3, undamped=1.0, damped=3.84, exponent=0.156, reach=3.25),
)
