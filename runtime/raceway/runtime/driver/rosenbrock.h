/* Linearly implicit step (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.7) for q'' = a(t, q, v).

   Each stage solves (1/(h gamma) I - J) k = R with J = [0 I; A B].  The upper half is kq = (Rq + kv)/s with s = 1/(h gamma), so that only
   W kv = Rv + A Rq / s with W = s I - B - A/s remains: RW_NQ equations instead of RW_NX. */
#ifndef RACEWAY_ROSENBROCK_H
#define RACEWAY_ROSENBROCK_H

#include "methods.h"
#include "model.h"

typedef struct {
    double solve[RW_NX][RW_NQ]; /* column j: what R[j] adds to kv, [W^-1 A/s | W^-1] */
    int pivoted;
} rw_matrix;

/* Gauss-Jordan elimination on the rows of [W | A/s | I]: with eight right-hand sides a step, products with the inverse cost less than
   substitutions, and its rows fill SIMD lanes.  Without pivoting where every row of W is dominated by its diagonal, as it is for steps
   that resolve the motion; with partial pivoting otherwise.  Returns 0 where W is singular. */
static inline int rw_factorize(rw_matrix *restrict m, const double *restrict A, const double *restrict B, double s)
{
    double rows[RW_NQ][3 * RW_NQ];
    const double inverse = 1.0 / s;
    int dominant = 1;
    for (int i = 0; i < RW_NQ; i++) {
        double rest = 0.0;
        for (int j = 0; j < RW_NQ; j++) {
            const double scaled = A[i * RW_NQ + j] * inverse;
            const double entry = (i == j ? s : 0.0) - B[i * RW_NQ + j] - scaled;
            rows[i][j] = entry;
            rows[i][RW_NQ + j] = scaled;
            rows[i][2 * RW_NQ + j] = i == j ? 1.0 : 0.0;
            rest += i != j ? fabs(entry) : 0.0;
        }
        if (!(fabs(rows[i][i]) >= rest)) dominant = 0;
    }
    m->pivoted = !dominant;
    for (int k = 0; k < RW_NQ; k++) {
        if (!dominant) {
            int best = k;
            for (int i = k + 1; i < RW_NQ; i++)
                if (fabs(rows[i][k]) > fabs(rows[best][k])) best = i;
            for (int j = 0; j < 3 * RW_NQ; j++) {
                const double swap = rows[k][j];
                rows[k][j] = rows[best][j];
                rows[best][j] = swap;
            }
        }
        if (rows[k][k] == 0.0) return 0;
        const double pivot = 1.0 / rows[k][k];
        for (int j = 0; j < 3 * RW_NQ; j++) rows[k][j] *= pivot;
        for (int i = 0; i < RW_NQ; i++) {
            const double factor = i == k ? 0.0 : rows[i][k];
            for (int j = 0; j < 3 * RW_NQ; j++) rows[i][j] -= factor * rows[k][j];
        }
    }
    for (int j = 0; j < RW_NX; j++)
        for (int i = 0; i < RW_NQ; i++) m->solve[j][i] = rows[i][RW_NQ + j];
    return 1;
}

/* What a step starts from and keeps when it is rejected. */
typedef struct {
    double w[RW_NW], wt[RW_NW];   /* stage variables at the start */
    double end_w[RW_NW], end_wt[RW_NW]; /* and at the end of the step tried */
    double dx[RW_NX], A[RW_NQ * RW_NQ], B[RW_NQ * RW_NQ], at[RW_NQ];
    double u[RW_METHOD_STAGES][RW_NX]; /* stages */
} rw_rosenbrock;

/* Linearize at the start of a step; `fresh` also evaluates the stage variables there. */
static inline void rw_rosenbrock_start(rw_rosenbrock *restrict work, const rw_numbers *n, double t, const double *restrict x, int fresh)
{
    if (fresh)
        rw_stage_rate(t, n->u, n->p, n->c, work->w, work->wt);
    else
        for (int k = 0; k < RW_NW; k++) {
            work->w[k] = work->end_w[k];
            work->wt[k] = work->end_wt[k];
        }
    rw_linearize(n, work->w, work->wt, x, work->dx, work->A, work->B, work->at);
}

/* One step of size h from (t, x) to `next`; returns the scaled error, negative where W is singular. */
static inline __attribute__((always_inline)) double rw_rosenbrock_step(const rw_rosenbrock_method *restrict method, const int stages,
                                                                        rw_rosenbrock *restrict work, rw_matrix *restrict matrix,
                                                                        const rw_numbers *n, double t, const double *restrict x, double h,
                                                                        const double *restrict weight, double *restrict next)
{
    const double s = 1.0 / (h * method->gamma), inverse_s = h * method->gamma, inverse_h = 1.0 / h;
    if (!rw_factorize(matrix, work->A, work->B, s)) return -1.0;
    /* the times inside the step at once; its end, which serves several stages and the next step, with the time derivative */
    double w[RW_METHOD_STAGES][RW_NW];
    rw_stages(n, t, h, method->nodes + 1, method->inner, w);
    rw_stage_rate(t + h, n->u, n->p, n->c, work->end_w, work->end_wt);
    double last[RW_NX];
    for (int i = 0; i < stages; i++) {
        double y[RW_NX], dx[RW_NX], R[RW_NX], *restrict u = work->u[i];
        for (int k = 0; k < RW_NX; k++) y[k] = x[k];
        for (int k = 0; k < RW_NX; k++) R[k] = 0.0;
        for (int j = 0; j < i - 1; j++) {
            const double a = method->a[i][j], coupling = method->coupling[i][j];
            for (int k = 0; k < RW_NX; k++) {
                y[k] += a * work->u[j][k];
                R[k] += coupling * work->u[j][k];
            }
        }
        if (i > 0) {
            /* the latest stage last: all else is ready before it is */
            const double a = method->a[i][i - 1], coupling = method->coupling[i][i - 1];
#pragma GCC unroll 16
            for (int k = 0; k < RW_NX; k++) {
                y[k] += a * last[k];
                R[k] += coupling * last[k];
            }
        }
        if (i == 0) {
            for (int k = 0; k < RW_NX; k++) dx[k] = work->dx[k];
        } else {
            rw_rate(n, i <= method->inner ? w[i - 1] : work->end_w, y, dx);
        }
        for (int k = 0; k < RW_NX; k++) R[k] = R[k] * inverse_h + dx[k];
        const double d = h * method->time_weights[i];
        for (int k = 0; k < RW_NQ; k++) R[RW_NQ + k] += d * work->at[k];
        double kv[RW_NQ];
        for (int k = 0; k < RW_NQ; k++) kv[k] = 0.0;
        for (int j = 0; j < RW_NX; j++)
            for (int k = 0; k < RW_NQ; k++) kv[k] += matrix->solve[j][k] * R[j];
#pragma GCC unroll 16
        for (int k = 0; k < RW_NQ; k++) {
            last[RW_NQ + k] = kv[k];
            last[k] = (R[k] + kv[k]) * inverse_s;
        }
#pragma GCC unroll 16
        for (int k = 0; k < RW_NX; k++) u[k] = last[k];
    }
    double error[RW_NX];
    for (int k = 0; k < RW_NX; k++) {
        next[k] = x[k];
        error[k] = 0.0;
    }
    for (int i = 0; i < stages; i++) {
        const double m = method->weights[i], e = method->error_weights[i];
        for (int k = 0; k < RW_NX; k++) next[k] += m * work->u[i][k];
        if (e != 0.0)
            for (int k = 0; k < RW_NX; k++) error[k] += e * work->u[i][k];
    }
    return rw_norm(error, weight);
}

/* Dense output of an accepted step: y = x + theta (D + (1 - theta) (H1 + theta (H2 + theta H3))). */
static inline void rw_rosenbrock_dense(const rw_rosenbrock_method *restrict method, const rw_rosenbrock *restrict work,
                                       double dense[RW_DENSE_ROWS][RW_NX])
{
    for (int row = 0; row < method->dense_rows; row++) {
        for (int k = 0; k < RW_NX; k++) dense[row][k] = 0.0;
        for (int i = 0; i < method->stages; i++)
            for (int k = 0; k < RW_NX; k++) dense[row][k] += method->dense[row][i] * work->u[i][k];
    }
}

static inline void rw_rosenbrock_at(const rw_rosenbrock_method *restrict method, const double dense[RW_DENSE_ROWS][RW_NX],
                                    const double *restrict x, const double *restrict next, double theta, double *restrict y)
{
    for (int k = 0; k < RW_NX; k++) {
        double inner = 0.0;
        for (int row = method->dense_rows - 1; row >= 0; row--) inner = dense[row][k] + (row < method->dense_rows - 1 ? theta * inner : 0.0);
        y[k] = x[k] + theta * (next[k] - x[k] + (1.0 - theta) * inner);
    }
}

#endif
