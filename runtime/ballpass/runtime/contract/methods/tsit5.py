"""Tsitouras 5(4): six stages and the end slope, as Dormand–Prince, with smaller error terms; dense output of order 4.

Ch. Tsitouras, Runge–Kutta pairs of order 5(4) satisfying only the first column simplifying assumption, Comput. Math.
Appl. 62 (2011) 770–775, doi:10.1016/j.camwa.2011.06.002.  The dense output is printed there as polynomials b_i(theta);
its row here are their coefficients of theta**4.
"""

from __future__ import annotations

from ballpass.runtime.contract.tableaus import ErrorEstimate, ExplicitTableau, row_of, rows_of

METHOD = ExplicitTableau(
    name="Tsitouras 5(4)",
    number=5,
    order=5,
    dense_order=4,
    nodes=row_of("0 0.161 0.327 0.9 0.9800255409045097 1"),
    matrix=rows_of(
        "",
        "0.161",
        "-0.008480655492356989 0.335480655492357",
        "2.8971530571054935 -6.359448489975075 4.3622954328695815",
        "5.325864828439257 -11.748883564062828 7.4955393428898365 -0.09249506636175525",
        "5.86145544294642 -12.92096931784711 8.159367898576159 -0.071584973281401 -0.028269050394068383",
    ),
    weights=row_of(
        "0.09646076681806523 0.01 0.4798896504144996 1.379008574103742 -3.290069515436081 2.324710524099774"
    ),
    error_estimates=(
        ErrorEstimate(
            weights=row_of(
                "-0.00178001105222577714 -0.0008164344596567469 0.007880878010261995 -0.1447110071732629"
                " 0.5823571654525552 -0.45808210592918697 0.015151515151515152"
            ),
            order=4,
        ),
    ),
    dense_nodes=(),
    dense_matrix=(),
    dense_rows=rows_of(
        "-1.0530884977290216 0.1017 2.490627285651252793 -16.54810288924490272 47.37952196281928122"
        " -34.87065786149660974 2.5",
    ),
    source="Tsitouras 2011, doi:10.1016/j.camwa.2011.06.002",
)
