"""Which linearly implicit methods does the stepper have?  Rodas4 and Rodas5P, for stiff damping.

Both are L-stable and stiffly accurate.  From stage 5 (Rodas4) or 6 (Rodas5P) on, every argument is the one before plus
the u found there: the argument of the last stage is the embedded solution, its u the error estimate, and both together
the new solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from ballpass.derive.methods.tableaus import Row, Rows, require_lengths, row_of, rows_of


@dataclass(frozen=True, slots=True, kw_only=True)
class RosenbrockTableau:
    """A linearly implicit pair with dense output, in the form that needs no product with the Jacobian.

    With ``u_i = h sum_j gamma_ij k_j``, stage i solves

        (I / (h gamma) - J) u_i = f(t + c_i h, y0 + sum_j a_ij u_j) + sum_j C_ij u_j / h + h d_i f_t

    where J and f_t are exact and taken at (t, y0).  Then ``y1 = y0 + sum_i m_i u_i``, and the error of the step is the
    root mean square norm of ``sum_i e_i u_i`` scaled by ``atol + rtol |y|``.

    Dense output: with ``Delta = y1 - y0``, ``H_m = sum_i h_mi u_i`` and ``x = 1 - theta``,

        y(t + theta h) = y0 + theta (Delta + x (H1 + theta (H2 + theta H3)))

    so that it meets y0 and y1 whatever the figures are.

    Attributes
    ----------
    name : name of the method
    embedded_order : order of the embedded solution
    gamma : the diagonal of gamma_ij
    nodes : c_i, shape (s,)
    matrix : a_ij, s rows, row i with i figures (0-based)
    coupling : C_ij, s rows, row i with i figures
    time_weights : d_i, the row sums of gamma_ij, shape (s,)
    weights : m_i, shape (s,)
    error_weights : e_i, shape (s,)
    dense_rows : h_mi of H1, H2, ..., each of shape (s,).  The figures of the last stage are free as far as the order
        goes: its u is the error estimate, no larger than what the dense output leaves out
    source : where the figures are printed

    Raises
    ------
    TableauError : a row has too many or too few figures
    """

    name: str
    embedded_order: int
    gamma: Fraction
    nodes: Row
    matrix: Rows
    coupling: Rows
    time_weights: Row
    weights: Row
    error_weights: Row
    dense_rows: Rows
    source: str

    def __post_init__(self) -> None:
        size = self.stages
        require_lengths(
            self.name,
            ("matrix", self.matrix, range(size)),
            ("coupling", self.coupling, range(size)),
            (
                "time_weights, weights, error_weights",
                (self.time_weights, self.weights, self.error_weights),
                (size,) * 3,
            ),
            ("dense_rows", self.dense_rows, (size,) * len(self.dense_rows)),
        )

    @property
    def stages(self) -> int:
        """Number of stages: linear systems solved in a step, all with one matrix."""
        return len(self.nodes)

    @property
    def error_exponent(self) -> int:
        """q in error ∝ h**q, for the step size controller."""
        return self.embedded_order + 1


_RODAS4_LAST = "1.221224509226641 6.019134481288629 12.53708332932087 -0.6878860361058950"

#: Rodas4: order 4(3) with six stages and dense output of order 3, for moderate tolerances.
#:
#: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, section VI.4,
#: doi:10.1007/978-3-642-05221-7, and its code RODAS, first set of coefficients.
RODAS4 = RosenbrockTableau(
    name="Rodas4",
    embedded_order=3,
    gamma=Fraction("0.25"),
    nodes=row_of("0 0.386 0.21 0.63 1 1"),
    matrix=rows_of(
        "",
        "1.544",
        "0.9466785280815826 0.2557011698983284",
        "3.314825187068521 2.896124015972201 0.9986419139977817",
        _RODAS4_LAST,
        f"{_RODAS4_LAST} 1",
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
    weights=row_of(f"{_RODAS4_LAST} 1 1"),
    error_weights=row_of("0 0 0 0 0 1"),
    dense_rows=rows_of(
        "10.12623508344586 -7.487995877610167 -34.80091861555747 -7.992771707568823 1.025137723295662 0",
        "-0.6762803392801253 6.087714651680015 16.43084320892478 24.76722511418386 -6.594389125716872 0",
    ),
    source="Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, section VI.4, code RODAS",
)

_RODAS5P_LAST = "-7.502846399306121 2.561846144803919 -11.627539656261098 -0.18268767659942256 0.030198172008377946"

#: Rodas5P: order 5(4) with eight stages and dense output of order 4, for tight tolerances.
#:
#: G. Steinebach, Construction of Rosenbrock–Wanner method Rodas5P and numerical benchmarks within the Julia
#: Differential Equations package, BIT Numerical Mathematics 63 (2023) 27, doi:10.1007/s10543-023-00967-x.
RODAS5P = RosenbrockTableau(
    name="Rodas5P",
    embedded_order=4,
    gamma=Fraction("0.21193756319429014"),
    nodes=row_of("0 0.6358126895828704 0.4095798393397535 0.9769306725060716 0.4288403609558664 1 1 1"),
    matrix=rows_of(
        "",
        "3.0",
        "2.849394379747939 0.45842242204463923",
        "-6.954028509809101 2.489845061869568 -10.358996098473584",
        "2.8029986275628964 0.5072464736228206 -0.3988312541770524 -0.04721187230404641",
        _RODAS5P_LAST,
        f"{_RODAS5P_LAST} 1",
        f"{_RODAS5P_LAST} 1 1",
    ),
    coupling=rows_of(
        "",
        "-14.155112264123755",
        "-17.97296035885952 -2.859693295451294",
        "147.12150275711716 -1.41221402718213 71.68940251302358",
        "165.43517024871676 -0.4592823456491126 42.90938336958603 -5.961986721573306",
        "24.854864614690072 -3.0009227002832186 47.4931110020768 5.5814197821558125 -0.6610691825249471",
        "30.91273214028599 -3.1208243349937974 77.79954646070892 34.28646028294783 -19.097331116725623"
        " -28.087943162872662",
        "37.80277123390563 -3.2571969029072276 112.26918849496327 66.9347231244047 -40.06618937091002"
        " -54.66780262877968 -9.48861652309627",
    ),
    time_weights=row_of(
        "0.21193756319429014 -0.42387512638858027 -0.3384627126235924 1.8046452872882734 2.325825639765069 0 0 0"
    ),
    weights=row_of(f"{_RODAS5P_LAST} 1 1 1"),
    error_weights=row_of("0 0 0 0 0 0 0 1"),
    dense_rows=rows_of(
        "25.948786856663858 -2.5579724845846235 10.433815404888879 -2.3679251022685204"
        " 0.524948541321073 1.1241088310450404 0.4272876194431874 -0.17202221070155493",
        "-9.91568850695171 -0.9689944594115154 3.0438037242978453 -24.495224566215796"
        " 20.176138334709044 15.98066361424651 -6.789040303419874 -6.710236069923372",
        "11.419903575922262 2.8879645146136994 72.92137995996029 80.12511834622643"
        " -52.072871366152654 -59.78993625266729 -0.15582684282751913 4.883087185713722",
    ),
    source="Steinebach, BIT Numerical Mathematics 63 (2023) 27, doi:10.1007/s10543-023-00967-x",
)
