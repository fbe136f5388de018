"""Which explicit methods does the stepper have?  Dormand–Prince 5(4) and DOP853, for light damping.

The first is of use at moderate, the second at tight tolerances.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from ballpass.derive.methods.tableaus import Row, Rows, require_lengths, row_of, rows_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorEstimate:
    """Error weights ``e = b - b_hat`` of one embedded solution.

    Attributes
    ----------
    weights : e_i of the stages and, last, of the slope at the end of the step; shape (s + 1,)
    order : order of the embedded solution
    share : its share in the denominator of the combined error, see `ExplicitTableau`
    """

    weights: Row
    order: int
    share: Fraction = Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplicitTableau:
    """An explicit Runge–Kutta pair with dense output.

    ``k_i = f(t + c_i h, y0 + h sum_j a_ij k_j)`` for s stages, ``y1 = y0 + h sum_i b_i k_i``.  Stage s + 1 is the end
    slope ``f(t + h, y1)``, the first stage of the next step.  The r stages of the dense output follow; they are needed
    only in steps that contain a requested point.

    Error: with ``E_m = h sum_i e_mi k_i`` and the root mean square norm scaled by ``atol + rtol |y|``, the error of the
    step is ``|E_1|**2 / sqrt(sum_m share_m |E_m|**2)``; for a single estimate that is ``|E_1|``.

    Dense output: with ``Delta = y1 - y0``, ``F1 = h k_1 - Delta``, ``F2 = 2 Delta - h (k_1 + k_end)``, ``F3, F4, ...``
    from `dense_rows` and ``x = 1 - theta``,

        y(t + theta h) = y0 + theta (Delta + x (F1 + theta (F2 + x (F3 + theta (F4 + x (...))))))

    so that it meets y0, y1 and the slopes there whatever the figures are.

    Attributes
    ----------
    name : name of the method
    nodes : c_i, shape (s,)
    matrix : a_ij, s rows, row i with i figures (0-based)
    weights : b_i, shape (s,)
    error_estimates : at least one; the first has share 1
    dense_nodes : c_i of the stages of the dense output, shape (r,)
    dense_matrix : a_ij of these, r rows, row i with s + 1 + i figures
    dense_rows : d_mi of ``F_(m + 3) = h sum_i d_mi k_i``, each of shape (s + 1 + r,)
    source : where the figures are printed

    Raises
    ------
    TableauError : a row has too many or too few figures
    """

    name: str
    nodes: Row
    matrix: Rows
    weights: Row
    error_estimates: tuple[ErrorEstimate, ...]
    dense_nodes: Row
    dense_matrix: Rows
    dense_rows: Rows
    source: str

    def __post_init__(self) -> None:
        stages, all_stages = self.stages, self.stages + 1 + len(self.dense_nodes)
        estimates = [estimate.weights for estimate in self.error_estimates]
        require_lengths(
            self.name,
            ("matrix", self.matrix, range(stages)),
            ("weights", (self.weights,), (stages,)),
            ("error weights", estimates, (stages + 1,) * len(estimates)),
            ("dense_matrix", self.dense_matrix, range(stages + 1, all_stages)),
            ("dense_rows", self.dense_rows, (all_stages,) * len(self.dense_rows)),
        )

    @property
    def stages(self) -> int:
        """Slopes that form the new solution; the first of them is known from the step before."""
        return len(self.nodes)

    @property
    def error_exponent(self) -> int:
        """q in error ∝ h**q, for the step size controller."""
        lowest = min(estimate.order for estimate in self.error_estimates)
        return 2 * (self.error_estimates[0].order + 1) - (lowest + 1)


#: Dormand–Prince 5(4): six stages, the end slope in the error estimate, dense output of order 4 without further stages.
#:
#: J. R. Dormand, P. J. Prince, A family of embedded Runge–Kutta formulae, J. Comput. Appl. Math. 6 (1980) 19–26,
#: doi:10.1016/0771-050X(80)90013-3.  Dense output: L. F. Shampine, Some practical Runge–Kutta formulas, Math. Comp. 46
#: (1986) 135–150, doi:10.1090/S0025-5718-1986-0815836-3, in the nested form of E. Hairer, S. P. Nørsett, G. Wanner,
#: Solving Ordinary Differential Equations I, Springer 1993, section II.6, doi:10.1007/978-3-540-78862-1.
DORMAND_PRINCE_54 = ExplicitTableau(
    name="Dormand–Prince 5(4)",
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
)

_DOP853_WEIGHTS = row_of(
    "0.0542937341165687622380535766363 0 0 0 0 4.45031289275240888144113950566"
    " 1.89151789931450038304281599044 -5.8012039600105847814672114227"
    " 0.31116436695781989440891606237 -0.152160949662516078556178806805"
    " 0.201365400804030348374776537501 0.0447106157277725905176885569043"
)

#: Weights of the embedded solution of order 3, which uses stages 1, 9 and 12.
_DOP853_THIRD_ORDER = row_of(
    "0.244094488188976377952755905512 0 0 0 0 0 0 0 0.733846688281611857341361741547 0 0"
    " 0.0220588235294117647058823529412"
)

#: DOP853: the method of order 8 with twelve stages of Dormand and Prince as E. Hairer arranged it, with embedded
#: solutions of orders 5 and 3 whose estimates are combined so that the error behaves like h**8, and a dense output of
#: order 7 with three further stages.
#:
#: E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, Springer 1993, sections II.5, II.6
#: and II.10, doi:10.1007/978-3-540-78862-1, and its code DOP853.
DOP853 = ExplicitTableau(
    name="DOP853",
    nodes=row_of(
        "0 0.0526001519587677318785587544488 0.0789002279381515978178381316732"
        " 0.118350341907227396726757197510 0.281649658092772603273242802490"
        " 0.333333333333333333333333333333 0.25 0.307692307692307692307692307692"
        " 0.651282051282051282051282051282 0.6 0.857142857142857142857142857142 1.0"
    ),
    matrix=rows_of(
        "",
        "0.0526001519587677318785587544488",
        "0.0197250569845378994544595329183 0.0591751709536136983633785987549",
        "0.0295875854768068491816892993775 0 0.0887627564304205475450678981324",
        "0.241365134159266685502369798665 0 -0.884549479328286085344864962717 0.924834003261792003115737966543",
        "0.037037037037037037037037037037 0 0 0.170828608729473871279604482173 0.125467687566822425016691814123",
        "0.037109375 0 0 0.170252211019544039314978060272 0.0602165389804559606850219397283 -0.017578125",
        "0.0370920001185047927108779319836 0 0 0.170383925712239993810214054705"
        " 0.107262030446373284651809199168 -0.0153194377486244017527936158236"
        " 0.00827378916381402288758473766002",
        "0.624110958716075717114429577812 0 0 -3.36089262944694129406857109825"
        " -0.868219346841726006818189891453 27.5920996994467083049415600797"
        " 20.1540675504778934086186788979 -43.4898841810699588477366255144",
        "0.477662536438264365890433908527 0 0 -2.48811461997166764192642586468"
        " -0.590290826836842996371446475743 21.2300514481811942347288949897"
        " 15.2792336328824235832596922938 -33.2882109689848629194453265587"
        " -0.0203312017085086261358222928593",
        "-0.93714243008598732571704021658 0 0 5.18637242884406370830023853209"
        " 1.09143734899672957818500254654 -8.14978701074692612513997267357"
        " -18.5200656599969598641566180701 22.7394870993505042818970056734"
        " 2.49360555267965238987089396762 -3.0467644718982195003823669022",
        "2.27331014751653820792359768449 0 0 -10.5344954667372501984066689879"
        " -2.00087205822486249909675718444 -17.9589318631187989172765950534"
        " 27.9488845294199600508499808837 -2.85899827713502369474065508674"
        " -8.87285693353062954433549289258 12.3605671757943030647266201528"
        " 0.643392746015763530355970484046",
    ),
    weights=_DOP853_WEIGHTS,
    error_estimates=(
        ErrorEstimate(
            weights=row_of(
                "0.01312004499419488073250102996 0 0 0 0 -1.225156446376204440720569753"
                " -0.4957589496572501915214079952 1.664377182454986536961530415"
                " -0.3503288487499736816886487290 0.3341791187130174790297318841"
                " 0.08192320648511571246570742613 -0.02235530786388629525884427845 0"
            ),
            order=5,
        ),
        ErrorEstimate(
            weights=(*(b - b_hat for b, b_hat in zip(_DOP853_WEIGHTS, _DOP853_THIRD_ORDER, strict=True)), Fraction(0)),
            order=3,
            share=Fraction("0.01"),
        ),
    ),
    dense_nodes=row_of("0.1 0.2 0.777777777777777777777777777778"),
    dense_matrix=rows_of(
        "0.0561675022830479523392909219681 0 0 0 0 0 0.253500210216624811088794765333"
        " -0.246239037470802489917441475441 -0.124191423263816360469010140626"
        " 0.15329179827876569731206322685 0.00820105229563468988491666602057"
        " 0.00756789766054569976138603589584 -0.008298",
        "0.0318346481635021405060768473261 0 0 0 0 0.0283009096723667755288322961402"
        " 0.0535419883074385676223797384372 -0.0549237485713909884646569340306 0 0"
        " -0.000108347328697249322858509316994 0.000382571090835658412954920192323"
        " -0.000340465008687404560802977114492 0.141312443674632500278074618366",
        "-0.428896301583791923408573538692 0 0 0 0 -4.69762141536116384314449447206"
        " 7.68342119606259904184240953878 4.06898981839711007970213554331"
        " 0.356727187455281109270669543021 0 0 0 -0.00139902416515901462129418009734"
        " 2.9475147891527723389556272149 -9.15095847217987001081870187138",
    ),
    dense_rows=rows_of(
        "-8.4289382761090128651353491142 0 0 0 0 0.56671495351937776962531783590"
        " -3.0689499459498916912797304727 2.3846676565120698287728149680"
        " 2.1170345824450282767155149946 -0.87139158377797299206789907490"
        " 2.2404374302607882758541771650 0.63157877876946881815570249290"
        " -0.088990336451333310820698117400 18.148505520854727256656404962"
        " -9.1946323924783554000451984436 -4.4360363875948939664310572000",
        "10.427508642579134603413151009 0 0 0 0 242.28349177525818288430175319"
        " 165.20045171727028198505394887 -374.54675472269020279518312152"
        " -22.113666853125306036270938578 7.7334326684722638389603898808"
        " -30.674084731089398182061213626 -9.3321305264302278729567221706"
        " 15.697238121770843886131091075 -31.139403219565177677282850411"
        " -9.3529243588444783865713862664 35.816841486394083752465898540",
        "19.985053242002433820987653617 0 0 0 0 -387.03730874935176555105901742"
        " -189.17813819516756882830838328 527.80815920542364900561016686"
        " -11.573902539959630126141871134 6.8812326946963000169666922661"
        " -1.0006050966910838403183860980 0.77771377980534432092869265740"
        " -2.7782057523535084065932004339 -60.196695231264120758267380846"
        " 84.320405506677161018159903784 11.992291136182789328035130030",
        "-25.693933462703749003312586129 0 0 0 0 -154.18974869023643374053993627"
        " -231.52937917604549567536039109 357.63911791061412378285349910"
        " 93.405324183624310003907691704 -37.458323136451633156875139351"
        " 104.09964950896230045147246184 29.840293426660503123344363579"
        " -43.533456590011143754432175058 96.324553959188282948394950600"
        " -39.177261675615439165231486172 -149.72683625798562581422125276",
    ),
    source="Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 1993, section II.5, code DOP853",
)
