/* Linearly implicit step (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.7) for q'' = a(t, q, v).

   Each stage solves (1/(h gamma) I - J) k = R with J = [0 I; A B].  The upper half is kq = (Rq + kv)/s with s = 1/(h gamma), so that only
   W kv = Rv + A Rq / s with W = s I - B - A/s remains: BP_NQ equations instead of BP_NX. */
#ifndef BALLPASS_ROSENBROCK_H
#define BALLPASS_ROSENBROCK_H

#include "methods.h"
#include "model.h"

typedef struct {
    double solve[BP_NX][BP_NQ]; /* column j: what R[j] adds to kv, [W^-1 A/s | W^-1] */
    int pivoted;
} bp_matrix;

/* Gauss-Jordan elimination on the rows of [W | A/s | I]: with eight right-hand sides a step, products with the inverse cost less than
   substitutions, and its rows fill SIMD lanes.  Without pivoting where every row of W is dominated by its diagonal, as it is for steps
   that resolve the motion; with partial pivoting otherwise.  Returns 0 where W is singular. */
static inline int bp_factorize(bp_matrix *restrict m, const double *restrict A, const double *restrict B, double s)
{
    double rows[BP_NQ][3 * BP_NQ];
    const double inverse = 1.0 / s;
    int dominant = 1;
    for (int i = 0; i < BP_NQ; i++) {
        double rest = 0.0;
        for (int j = 0; j < BP_NQ; j++) {
            const double scaled = A[i * BP_NQ + j] * inverse;
            const double entry = (i == j ? s : 0.0) - B[i * BP_NQ + j] - scaled;
            rows[i][j] = entry;
            rows[i][BP_NQ + j] = scaled;
            rows[i][2 * BP_NQ + j] = i == j ? 1.0 : 0.0;
            rest += i != j ? fabs(entry) : 0.0;
        }
        if (!(fabs(rows[i][i]) >= rest)) dominant = 0;
    }
    m->pivoted = !dominant;
    for (int k = 0; k < BP_NQ; k++) {
        if (!dominant) {
            int best = k;
            for (int i = k + 1; i < BP_NQ; i++)
                if (fabs(rows[i][k]) > fabs(rows[best][k])) best = i;
            for (int j = 0; j < 3 * BP_NQ; j++) {
                const double swap = rows[k][j];
                rows[k][j] = rows[best][j];
                rows[best][j] = swap;
            }
        }
        if (rows[k][k] == 0.0) return 0;
        const double pivot = 1.0 / rows[k][k];
        for (int j = 0; j < 3 * BP_NQ; j++) rows[k][j] *= pivot;
        for (int i = 0; i < BP_NQ; i++) {
            const double factor = i == k ? 0.0 : rows[i][k];
            for (int j = 0; j < 3 * BP_NQ; j++) rows[i][j] -= factor * rows[k][j];
        }
    }
    for (int j = 0; j < BP_NX; j++)
        for (int i = 0; i < BP_NQ; i++) m->solve[j][i] = rows[i][BP_NQ + j];
    return 1;
}

/* What a step starts from and keeps when it is rejected. */
typedef struct {
    double w[BP_NW], wt[BP_NW];   /* stage variables at the start */
    double end_w[BP_NW], end_wt[BP_NW]; /* and at the end of the step tried */
    double dx[BP_NX], A[BP_NQ * BP_NQ], B[BP_NQ * BP_NQ], at[BP_NQ];
    double u[BP_METHOD_STAGES][BP_NX]; /* stages */
} bp_rosenbrock;

/* Linearize at the start of a step; `fresh` also evaluates the stage variables there. */
static inline void bp_rosenbrock_start(bp_rosenbrock *restrict work, const bp_numbers *n, double t, const double *restrict x, int fresh)
{
    if (fresh)
        bp_stage_rate(t, n->u, n->p, n->c, work->w, work->wt);
    else
        for (int k = 0; k < BP_NW; k++) {
            work->w[k] = work->end_w[k];
            work->wt[k] = work->end_wt[k];
        }
    bp_linearize(n, work->w, work->wt, x, work->dx, work->A, work->B, work->at);
}

/* One step of size h from (t, x) to `next`; returns the scaled error, negative where W is singular. */
static inline __attribute__((always_inline)) double bp_rosenbrock_step(const bp_rosenbrock_method *restrict method, const int stages,
                                                                        bp_rosenbrock *restrict work, bp_matrix *restrict matrix,
                                                                        const bp_numbers *n, double t, const double *restrict x, double h,
                                                                        const double *restrict weight, double *restrict next)
{
    const double s = 1.0 / (h * method->gamma), inverse_s = h * method->gamma, inverse_h = 1.0 / h;
    if (!bp_factorize(matrix, work->A, work->B, s)) return -1.0;
    /* the times inside the step at once; its end, which serves several stages and the next step, with the time derivative */
    double w[BP_METHOD_STAGES][BP_NW];
    bp_stages_and_end(n, t, h, method->nodes + 1, method->inner, w, work->end_w, work->end_wt);
    bp_half last_q = {0.0}, last_v = {0.0};
    for (int i = 0; i < stages; i++) {
        double y[BP_NX], dx[BP_NX], R[BP_NX], *restrict u = work->u[i];
        bp_half y_q = BP_HALF(x), y_v = BP_HALF(x + BP_NQ), R_q = {0.0}, R_v = {0.0};
        for (int j = 0; j < i - 1; j++) {
            const double a = method->a[i][j], coupling = method->coupling[i][j];
            const bp_half u_q = BP_HALF(work->u[j]), u_v = BP_HALF(work->u[j] + BP_NQ);
            y_q += a * u_q;
            y_v += a * u_v;
            R_q += coupling * u_q;
            R_v += coupling * u_v;
        }
        if (i > 0) {
            /* the latest stage last: all else is ready before it is */
            const double a = method->a[i][i - 1], coupling = method->coupling[i][i - 1];
            y_q += a * last_q;
            y_v += a * last_v;
            R_q += coupling * last_q;
            R_v += coupling * last_v;
        }
        *(bp_half *)y = y_q;
        *(bp_half *)(y + BP_NQ) = y_v;
        if (i == 0) {
            for (int k = 0; k < BP_NX; k++) dx[k] = work->dx[k];
        } else {
            bp_rate(n, i <= method->inner ? w[i - 1] : work->end_w, y, dx);
            /* positions move with the velocities: taken from the vector, not from the copy just stored */
            R_q = R_q * inverse_h + y_v;
        }
        if (i == 0) R_q = BP_HALF(dx);
        const double d = h * method->time_weights[i];
        *(bp_half *)R = R_q;
        *(bp_half *)(R + BP_NQ) = R_v * inverse_h;
        for (int k = 0; k < BP_NQ; k++) R[BP_NQ + k] = R[BP_NQ + k] + dx[BP_NQ + k] + d * work->at[k];
        /* two sums, that of the positions ready before the forces are */
        bp_half by_q = {0.0}, by_v = {0.0};
        for (int j = 0; j < BP_NQ; j++) by_q += BP_HALF(matrix->solve[j]) * R[j];
        for (int j = BP_NQ; j < BP_NX; j++) by_v += BP_HALF(matrix->solve[j]) * R[j];
        last_v = by_q + by_v;
        last_q = (R_q + last_v) * inverse_s;
        *(bp_half *)u = last_q;
        *(bp_half *)(u + BP_NQ) = last_v;
    }
    double error[BP_NX];
    bp_state end = BP_STATE(x), estimate = {0.0};
    for (int i = 0; i < stages; i++) {
        const double m = method->weights[i], e = method->error_weights[i];
        end += m * BP_STATE(work->u[i]);
        if (e != 0.0) estimate += e * BP_STATE(work->u[i]);
    }
    *(bp_state *)next = end;
    *(bp_state *)error = estimate;
    return bp_norm(error, weight);
}

/* Dense output of an accepted step: y = x + theta (D + (1 - theta) (H1 + theta (H2 + theta H3))). */
static inline __attribute__((always_inline)) void bp_rosenbrock_dense(const bp_rosenbrock_method *restrict method,
                                                                       const bp_rosenbrock *restrict work,
                                                                       double dense[BP_DENSE_ROWS][BP_NX])
{
    for (int row = 0; row < method->dense_rows; row++) {
        bp_state sum = {0.0};
        for (int i = 0; i < method->stages; i++) sum += method->dense[row][i] * BP_STATE(work->u[i]);
        *(bp_state *)dense[row] = sum;
    }
}

static inline __attribute__((always_inline)) void bp_rosenbrock_at(const bp_rosenbrock_method *restrict method,
                                                                    const double dense[BP_DENSE_ROWS][BP_NX], const double *restrict x,
                                                                    const double *restrict next, double theta, double *restrict y)
{
    const int rows = method->dense_rows;
    bp_state inner = BP_STATE(dense[rows - 1]);
#pragma GCC unroll 16
    for (int row = rows - 2; row >= 0; row--) inner = BP_STATE(dense[row]) + theta * inner;
    *(bp_state *)y = BP_STATE(x) + theta * (BP_STATE(next) - BP_STATE(x) + (1.0 - theta) * inner);
}

#endif
