"""Which linearly implicit methods does the stepper have?  Rodas4 and Rodas5P, for stiff damping.

Both are L-stable and stiffly accurate.  From stage 5 (Rodas4) or 6 (Rodas5P) on, every argument is the one before plus
the u found there: the argument of the last stage is the embedded solution, its u the error estimate, and both together
the new solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction

from ballpass.derive.methods.order_conditions import (
    PRECISION,
    Figures,
    OrderConditions,
    decimal_of,
    elementary_weights,
    inverse_of_lower,
    lower_triangle,
    rooted_trees,
    vector,
)
from ballpass.derive.methods.tableaus import (
    CheckedTableau,
    Row,
    Rows,
    nested_powers,
    row_of,
    row_sum_faults,
    rows_of,
    shape_faults,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassicalForm:
    """A linearly implicit method as its order conditions see it.

    ``k_i = f(t + alpha_i h, y0 + h sum_j alpha_ij k_j) + h J sum_j gamma_ij k_j + h gamma_i f_t``, with row sums
    alpha_i and gamma_i, and ``y1 = y0 + h sum_i b_i k_i``.

    Attributes
    ----------
    alpha : alpha_ij, shape (s, s), strictly lower
    gamma : gamma_ij, shape (s, s), lower, with equal diagonal
    weights : b_i, shape (s,)
    error_weights : b_i minus those of the embedded solution, shape (s,)
    dense_weights : row k are the weights of ``theta**(k + 1)``, shape (degree, s)
    """

    alpha: tuple[tuple[Decimal, ...], ...]
    gamma: tuple[tuple[Decimal, ...], ...]
    weights: tuple[Decimal, ...]
    error_weights: tuple[Decimal, ...]
    dense_weights: tuple[tuple[Decimal, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RosenbrockTableau(CheckedTableau):
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
    order, embedded_order, dense_order : orders for ordinary differential equations
    algebraic_orders : orders of solution, embedded solution and dense output in the algebraic component of index-1
        systems: what is left of the order in a component that relaxes within a fraction of the step
    gamma : the diagonal of gamma_ij
    nodes : c_i, shape (s,)
    matrix : a_ij, s rows, row i with i figures (0-based)
    coupling : C_ij, s rows, row i with i figures
    time_weights : d_i, the row sums of gamma_ij, shape (s,)
    weights : m_i, shape (s,)
    error_weights : e_i, shape (s,)
    dense_rows : h_mi of H1, H2, ..., each of shape (s,).  The figures of the last stage are free as far as the order
        goes: its u is the error estimate, no larger than what the dense output leaves out
    rounding : residual in a condition that the rounding of the printed figures explains; more raises
    source : where the figures are printed

    Raises
    ------
    TableauError : listing every claim that does not hold
    """

    name: str
    order: int
    embedded_order: int
    dense_order: int
    algebraic_orders: tuple[int, int, int]
    gamma: Fraction
    nodes: Row
    matrix: Rows
    coupling: Rows
    time_weights: Row
    weights: Row
    error_weights: Row
    dense_rows: Rows
    rounding: Fraction
    source: str

    @property
    def stages(self) -> int:
        """Number of stages: linear systems solved in a step, all with one matrix."""
        return len(self.nodes)

    @property
    def error_exponent(self) -> int:
        """q in error ∝ h**q, for the step size controller."""
        return self.embedded_order + 1

    def dense_weights(self) -> Rows:
        """Weights of the powers of theta in ``y(t + theta h) = y0 + sum_i m_i(theta) u_i``.

        Returns
        -------
        row k are the weights of ``theta**(k + 1)``, shape (degree, s)
        """
        return nested_powers((self.weights, *self.dense_rows), [place > 0 for place in range(len(self.dense_rows))])

    def classical(self) -> ClassicalForm:
        """The form of textbooks and order conditions, to `PRECISION` digits.

        ``u = h Gamma k`` gives ``Gamma**-1 = diag(1 / gamma) - C``, ``alpha = a Gamma`` and ``b = m Gamma``.
        """
        with localcontext() as context:
            context.prec = PRECISION
            alpha, gamma = self._classical_matrices()
            size = self.stages
            return ClassicalForm(
                alpha=tuple(tuple(row) for row in alpha),
                gamma=tuple(tuple(row) for row in gamma),
                weights=tuple(vector(self.weights, size) @ gamma),
                error_weights=tuple(vector(self.error_weights, size) @ gamma),
                dense_weights=tuple(tuple(vector(row, size) @ gamma) for row in self.dense_weights()),
            )

    def _classical_matrices(self) -> tuple[Figures, Figures]:
        size = self.stages
        inverse = -lower_triangle(self.coupling, size)
        for stage in range(size):
            inverse[stage, stage] = 1 / decimal_of(self.gamma)
        gamma = inverse_of_lower(inverse)
        return lower_triangle(self.matrix, size) @ gamma, gamma

    def _shape_faults(self) -> list[str]:
        size = self.stages
        faults = shape_faults("matrix", self.matrix, range(size))
        faults += shape_faults("coupling", self.coupling, range(size))
        single = (self.time_weights, self.weights, self.error_weights)
        faults += shape_faults("time_weights, weights, error_weights", single, (size,) * 3)
        faults += shape_faults("dense_rows", self.dense_rows, (size,) * len(self.dense_rows))
        for claim, order in zip(
            self.algebraic_orders, (self.order, self.embedded_order, self.dense_order), strict=True
        ):
            if claim > order:
                faults.append(f"algebraic_orders: {claim}, needed at most the order {order}")
        if self.gamma <= 0:
            faults.append(f"gamma: {self.gamma}, needed a positive number")
        return faults

    def _order_faults(self) -> list[str]:
        size = self.stages
        tolerance = decimal_of(self.rounding)
        alpha, gamma = self._classical_matrices()
        beta = alpha + gamma
        b = vector(self.weights, size) @ gamma
        e = vector(self.error_weights, size) @ gamma
        # The time derivative is that of the autonomous system with t as a further unknown: two sets of row sums.
        faults = row_sum_faults("alpha_ij, row", alpha, vector(self.nodes, size), tolerance)
        faults += row_sum_faults("gamma_ij, row", gamma, vector(self.time_weights, size), tolerance)
        faults += _stiffness_faults(alpha, beta, b, e, tolerance)
        trees = rooted_trees(max(self.order, self.embedded_order + 1, self.dense_order), algebraic=True)
        conditions = OrderConditions(trees=trees, weights=elementary_weights(trees, alpha, beta), tolerance=tolerance)
        of_solution, of_embedded, of_dense = self.algebraic_orders
        faults += conditions.faults_of_step("solution", b, self.order, of_solution)
        faults += conditions.faults_of_estimate("error estimate", e, self.embedded_order, of_embedded)
        powers = [vector(row, size) @ gamma for row in self.dense_weights()]
        return faults + conditions.faults_of_dense_output("dense output", powers, self.dense_order, of_dense)


def _stiffness_faults(alpha: Figures, beta: Figures, b: Figures, e: Figures, tolerance: Decimal) -> list[str]:
    """What a stiff problem needs: the last stage is the solution, and R(infinity) = 0, for both solutions.

    Stiff accuracy of the solution is ``beta_sj = b_j``; that of the embedded one is ``alpha_sj = b_hat_j``, the
    argument of the last stage.  ``R(infinity) = 1 - b beta**-1 1``.
    """
    b_hat = b - e
    faults = [
        f"{label}: differs from the last row of {which} by {off:.1e}, so it is not stiffly accurate"
        for label, which, off in (
            ("solution", "beta_ij", max(abs(beta[-1] - b))),
            ("embedded solution", "alpha_ij", max(abs(alpha[-1] - b_hat))),
        )
        if off > tolerance
    ]
    relaxed = inverse_of_lower(beta).sum(axis=1)
    limits = (("solution", 1 - b @ relaxed), ("embedded solution", 1 - b_hat @ relaxed))
    return faults + [
        f"{label}: R(infinity) = {limit:.1e}, needed 0" for label, limit in limits if abs(limit) > tolerance
    ]


_RODAS4_LAST = "1.221224509226641 6.019134481288629 12.53708332932087 -0.6878860361058950"

#: Rodas4: order 4(3) with six stages and dense output of order 3, for moderate tolerances.
#:
#: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, section VI.4,
#: doi:10.1007/978-3-642-05221-7, and its code RODAS, first set of coefficients.
RODAS4 = RosenbrockTableau(
    name="Rodas4",
    order=4,
    embedded_order=3,
    dense_order=3,
    algebraic_orders=(4, 3, 2),
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
    # Printed to 16 digits: up to 5e-15 each where a figure is above 10; 1.2e-14 is the largest residual.
    rounding=Fraction("1e-13"),
    source="Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, section VI.4, code RODAS",
)

_RODAS5P_LAST = "-7.502846399306121 2.561846144803919 -11.627539656261098 -0.18268767659942256 0.030198172008377946"

#: Rodas5P: order 5(4) with eight stages and dense output of order 4, for tight tolerances.
#:
#: G. Steinebach, Construction of Rosenbrock–Wanner method Rodas5P and numerical benchmarks within the Julia
#: Differential Equations package, BIT Numerical Mathematics 63 (2023) 27, doi:10.1007/s10543-023-00967-x.
RODAS5P = RosenbrockTableau(
    name="Rodas5P",
    order=5,
    embedded_order=4,
    dense_order=4,
    algebraic_orders=(4, 3, 3),
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
    # Printed from double precision: up to 1.4e-14 each where a figure is above 128; 2.3e-13 is the largest residual.
    rounding=Fraction("1e-12"),
    source="Steinebach, BIT Numerical Mathematics 63 (2023) 27, doi:10.1007/s10543-023-00967-x",
)
