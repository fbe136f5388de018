"""Rodas4: order 4(3) with six stages and dense output of order 3, for moderate tolerances.

E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, section VI.4,
doi:10.1007/978-3-642-05221-7, and its code RODAS, first set of coefficients.
"""

from __future__ import annotations

from fractions import Fraction

from ballpass.runtime.contract.tableaus import RosenbrockTableau, row_of, rows_of

_LAST = "1.221224509226641 6.019134481288629 12.53708332932087 -0.6878860361058950"

METHOD = RosenbrockTableau(
    name="Rodas4",
    number=1,
    order=4,
    embedded_order=3,
    dense_order=3,
    gamma=Fraction("0.25"),
    nodes=row_of("0 0.386 0.21 0.63 1 1"),
    matrix=rows_of(
        "",
        "1.544",
        "0.9466785280815826 0.2557011698983284",
        "3.314825187068521 2.896124015972201 0.9986419139977817",
        _LAST,
        f"{_LAST} 1",
    ),
    coupling=rows_of(
        "",
        "-5.6688",
        "-2.430093356833875 -0.2063599157091915",
        "-0.1073529058151375 -9.594562251023355 -20.47028614809616",
        "7.496443313967647 -10.24680431464352 -33.99990352819905 11.70890893206160",
        "8.083246795921522 -7.981132988064893 -31.52159432874371 16.31930543123136 -6.058818238834054",
    ),
    time_weights=row_of("0.25 -0.1043 0.1035 -0.03620000000000023 0 0"),
    weights=row_of(f"{_LAST} 1 1"),
    error_weights=row_of("0 0 0 0 0 1"),
    dense_rows=rows_of(
        "10.12623508344586 -7.487995877610167 -34.80091861555747 -7.992771707568823 1.025137723295662 0",
        "-0.6762803392801253 6.087714651680015 16.43084320892478 24.76722511418386 -6.594389125716872 0",
    ),
    source="Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, section VI.4, code RODAS",
)
