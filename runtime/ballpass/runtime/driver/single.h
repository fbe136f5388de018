/* The methods for one run: states are plain numbers. */
#ifndef BALLPASS_SINGLE_H
#define BALLPASS_SINGLE_H

#include <float.h>
#include <stddef.h>

#include "method_tables.h"
#include "model.h"
#include "sqrt_time.h"
#include "step_size.h"

#define BP_INLINE static inline __attribute__((always_inline))
#define BP_ALIGNED __attribute__((aligned(64)))

/* Positions or velocities as vectors of the compiler, as wide as their number can be cut into: short loops it would write out one number
   after another. */
enum { BP_EVEN = BP_NQ & -BP_NQ, BP_WIDTH = BP_EVEN < 8 ? BP_EVEN : 8 };
typedef double bp_wide __attribute__((vector_size(BP_WIDTH * sizeof(double)), aligned(8), may_alias));
/* The same of a whole state: of an odd number of coordinates positions and velocities in pairs. */
enum { BP_STATE_WIDTH = BP_WIDTH < 4 && 2 * BP_EVEN > BP_WIDTH ? 2 * BP_EVEN : BP_WIDTH };
typedef double bp_whole __attribute__((vector_size(BP_STATE_WIDTH * sizeof(double)), aligned(8), may_alias));

/* Slopes and times of an explicit step. */
typedef struct {
    double k[BP_METHOD_STAGES][BP_NX] BP_ALIGNED; /* slopes; the first is known when a step starts */
    double y[BP_NX];                   /* argument of the last stage: stiffness shows in it */
} bp_explicit;

typedef struct {
    const bp_numbers *n;
    const double *lead, *theta; /* of a step with an uneven pace (sqrt_time.h), else NULL, and its stages' places */
    double w[BP_METHOD_STAGES][BP_NW];
} bp_times;

/* What a linearly implicit step starts from and keeps when it is rejected. */
typedef struct {
    const bp_numbers *n;
    const bp_rosenbrock_method *method;
    double w[BP_NW], wt[BP_NW];         /* stage variables at the start */
    double end_w[BP_NW], end_wt[BP_NW]; /* and at the end of the step tried */
    double inner_w[BP_METHOD_STAGES][BP_NW];
    double dx[BP_NX], A[BP_NQ * BP_NQ], B[BP_NQ * BP_NQ], at[BP_NQ];
    double u[BP_METHOD_STAGES][BP_NX] BP_ALIGNED; /* stages */
} bp_linear;

typedef struct {
    double solve[BP_NX][BP_NQ] BP_ALIGNED; /* column j: what R[j] adds to kv, [W^-1 A/s | W^-1] */
    int pivoted;
} bp_matrix;

/* Slopes of such a step are by theta h, the first as well. */
BP_INLINE void bp_slope(const bp_times *at, int i, int time, const double *restrict y, double *restrict k)
{
    (void)i;
    bp_rate(at->n, at->w[time], y, k);
    if (!at->lead) return;
    const double pace = bp_pace(*at->lead, at->theta[time]);
    for (int c = 0; c < BP_NX; c++) k[c] *= pace;
}

BP_INLINE void bp_linear_slope(const bp_linear *at, int i, const double *restrict y, double *restrict dx)
{
    if (i == 0)
        for (int k = 0; k < BP_NX; k++) dx[k] = at->dx[k];
    else bp_rate(at->n, at->method->place[i] < at->method->inner ? at->inner_w[at->method->place[i]] : at->end_w, y, dx);
}

BP_INLINE double bp_time_term(const bp_linear *at, int i, int c, double d)
{
    (void)i;
    return d * at->at[c];
}

#define BP_NAME(f) bp_##f
#define BP_W 1
#define BP_N double
#define BP_V bp_wide
#define BP_VS (BP_NQ / BP_WIDTH)
#define BP_H double
#define BP_S bp_wide
#define BP_X bp_whole
#define BP_XS (BP_NX / BP_STATE_WIDTH)
#include "explicit.h"
#include "rosenbrock.h"
#include "iteration_matrix.h"
#undef BP_NAME
#undef BP_W
#undef BP_N
#undef BP_V
#undef BP_VS
#undef BP_H
#undef BP_S

static inline double bp_size(const double *restrict error, const double *restrict weight)
{
    double size;
    bp_norm(error, weight, &size);
    return size;
}

static inline void bp_explicit_rate(const bp_numbers *n, double t, const double *restrict x, double *restrict dx)
{
    double w[BP_NW];
    bp_stage(t, n->u, n->p, n->c, w);
    bp_rate(n, w, x, dx);
}

/* All times of a step from t at once, with their places. */
BP_INLINE void bp_times_of(bp_times *restrict at, const bp_numbers *n, double t, double h, const double *restrict theta, const int count,
                           const double *restrict lead)
{
    double passed[BP_METHOD_STAGES];
    at->n = n;
    at->lead = lead;
    at->theta = theta;
    if (lead)
        for (int i = 0; i < count; i++) passed[i] = bp_passed(*lead, theta[i]);
    bp_stages(n, t, h, lead ? passed : theta, count, at->w);
}

/* One step of size h from (t, x) to `next`, the end slope included; returns the scaled error. */
BP_INLINE double bp_explicit_step(const bp_explicit_method *restrict method, bp_explicit *restrict work, const bp_numbers *n, double t, const double *restrict x, double h, const double *restrict lead,
                                  const double *restrict weight, double *restrict next)
{
    bp_times at;
    double error;
    bp_times_of(&at, n, t, h, method->nodes + 1, method->times, lead);
    bp_explicit_stages(method, &at, work->k, work->y, x, &h, next);
    bp_explicit_error(method, (const double(*)[BP_NX])work->k, &h, weight, &error);
    return error;
}

/* Linearize at the start of a step; `fresh` also evaluates the stage variables there. */
static inline void bp_linear_start(bp_linear *restrict work, const bp_numbers *n, double t, const double *restrict x, int fresh)
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

/* Returns 0 where W is singular. */
static inline int bp_factorize(bp_matrix *restrict m, const double *restrict A, const double *restrict B, double s)
{
    double rows[BP_NQ][3 * BP_NQ], dominance;
    bp_matrix_rows(rows, &dominance, A, B, &s);
    m->pivoted = dominance == 0.0;
    for (int k = 0; k < BP_NQ; k++) {
        if (m->pivoted) {
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
        bp_clear_column(rows, k);
    }
    for (int j = 0; j < BP_NX; j++)
        for (int i = 0; i < BP_NQ; i++) m->solve[j][i] = rows[i][BP_NQ + j];
    return 1;
}

/* One step of size h from (t, x) to `next`; returns the scaled error, negative where W is singular. */
BP_INLINE double bp_rosenbrock_step(const bp_rosenbrock_method *restrict method, bp_linear *restrict work,
                                    bp_matrix *restrict matrix, const bp_numbers *n, double t, const double *restrict x, double h,
                                    const double *restrict weight, double *restrict next)
{
    double error;
    if (!bp_factorize(matrix, work->A, work->B, 1.0 / (h * method->gamma))) return -1.0;
    /* the times inside the step at once; its end, which serves several stages and the next step, with the time derivative */
    work->n = n;
    work->method = method;
    bp_stages_and_end(n, t, h, method->inner_nodes, method->inner, work->inner_w, work->end_w, work->end_wt);
    bp_rosenbrock_stages(method, work, matrix->solve[0], work->u, x, &h);
    bp_rosenbrock_end(method, (const double(*)[BP_NX])work->u, x, next);
    bp_rosenbrock_error(method, (const double(*)[BP_NX])work->u, weight, &error);
    return error;
}

#endif
