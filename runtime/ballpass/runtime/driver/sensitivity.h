/* Forward sensitivities: the derivative of the discrete solution along any number of directions of the parameters.

   After a step is accepted, the same formulas are differentiated line by line at fixed step size, BP_LANES directions at a time; what does
   not depend on the direction (slopes of the law, the small inverse) is computed once for all.  Where a load switches at a time that
   depends on the parameters, the derivative jumps by (rate before - rate behind) d(time)/d(parameter).

   Where the caller gives tolerances for the derivatives, their embedded error takes part in the choice of the step size.  A step is
   differentiated before it is judged; the derivatives of the state change only when it is accepted, so that a rejected one leaves no trace.

   Compiled in only where BALLPASS_SENSITIVITIES is defined. */
#ifndef BALLPASS_SENSITIVITY_H
#define BALLPASS_SENSITIVITY_H

#include <float.h>
#include <string.h>

#include "explicit.h"
#include "rosenbrock.h"
#include "stepper.h"
#include "tangent_model.h"

/* An entry for each direction of a block. */
typedef double bp_lanes[BP_LANES];

/* Work of one block of directions; the caller brings ballpass_tangent_work(blocks) bytes. */
typedef struct {
    bp_lanes k[BP_METHOD_STAGES][BP_NX]; /* derivatives of slopes or stages */
    bp_lanes next[BP_NX];
    bp_lanes dense[BP_DENSE_ROWS][BP_NX];
    bp_lanes w[BP_NW], wt[BP_NW];
    bp_lanes A[BP_NQ * BP_NQ], B[BP_NQ * BP_NQ], at[BP_NQ];
} bp_tangent_block;

static inline bp_direction bp_direction_of(const ballpass_tangents *tangents, long segment, long block)
{
    bp_direction d;
    d.p = tangents->p + block * (BP_NP * BP_LANES);
    d.c = tangents->c + block * (BP_NC * BP_LANES);
    d.u = tangents->u + (segment * tangents->blocks + block) * (BP_NU * BP_LANES);
    return d;
}

/* y = x + factor * sum of row[j] k[j] for one block. */
static inline void bp_combine_lanes(const double *restrict row, int count, bp_lanes k[][BP_NX], double factor,
                                    const double *restrict x, double *restrict y)
{
    bp_vector sum[BP_NX];
#pragma GCC unroll 16
    for (int i = 0; i < BP_NX; i++) sum[i] = (bp_vector){0.0};
    for (int j = 0; j < count; j++) {
        const double a = row[j];
        if (a == 0.0) continue;
        const bp_vector *slope = (const bp_vector *)&k[j][0][0];
#pragma GCC unroll 16
        for (int i = 0; i < BP_NX; i++) sum[i] += a * slope[i];
    }
    const bp_vector *from = (const bp_vector *)x;
    bp_vector *to = (bp_vector *)y;
#pragma GCC unroll 16
    for (int i = 0; i < BP_NX; i++) to[i] = from[i] + factor * sum[i];
}

static inline double *bp_tangent_state(const ballpass_tangents *tangents, long block) { return tangents->x + block * (BP_NX * BP_LANES); }

/* Derivatives of the stage variables by inputs, parameters and constants at stage times, BP_LANES times to a row. */
enum { BP_TIMES = (BP_METHOD_STAGES + BP_LANES - 1) / BP_LANES };
typedef double bp_stage_slopes[BP_TIMES][BP_NJ * BP_LANES];

/* Stage variables at the times t + nodes[i] h, i = 0 ... count - 1, into the rows of w, and their derivatives. */
static inline void bp_sloped_stages(const bp_numbers *n, double t, double h, const double *restrict nodes, const int count, double w[][BP_NW],
                                    bp_stage_slopes J)
{
    for (int first = 0; first < count; first += BP_LANES) {
        double some[BP_LANES], time[BP_LANES], C[BP_NA * BP_LANES], S[BP_NA * BP_LANES], lanes[BP_NW * BP_LANES];
        bp_some_nodes(nodes, first, count, some);
        bp_directions(n, t, h, some, C, S);
        for (int i = 0; i < BP_LANES; i++) time[i] = t + some[i] * h;
        bp_stage_slopes_lanes(C, S, time, n->u, n->p, n->c, lanes, J[first / BP_LANES]);
        for (int i = 0; i < BP_LANES && first + i < count; i++)
            for (int k = 0; k < BP_NW; k++) w[first + i][k] = lanes[k * BP_LANES + i];
    }
}

/* Derivatives of the stage variables at the time number `i` along a block's directions. */
static inline void bp_stage_moved(bp_stage_slopes J, int i, const bp_direction *d, double *restrict wd)
{
    bp_stage_moved_lanes(J[i / BP_LANES] + i % BP_LANES, d->u, d->p, d->c, wd);
}

/* Derivative of the first slope, where no step before has left it. */
static inline void bp_explicit_tangent_start(const ballpass_tangents *tangents, bp_tangent_block *restrict work, const bp_numbers *n,
                                             long segment, double t, const double *restrict x)
{
    static const double start[1] = {0.0};
    double w[1][BP_NW];
    bp_stage_slopes J;
    bp_point at;
    bp_sloped_stages(n, t, 0.0, start, 1, w, J);
    bp_point_at(&at, n, w[0], x);
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_direction d = bp_direction_of(tangents, segment, b);
        bp_stage_moved(J, 0, &d, &work[b].w[0][0]);
        bp_rate_tangent(&at, n, &d, &work[b].w[0][0], bp_tangent_state(tangents, b), &work[b].k[0][0][0]);
    }
}

/* What the directions share at all stages of a step. */
typedef struct {
    double w[BP_METHOD_STAGES][BP_NW], y[BP_METHOD_STAGES][BP_NX];
    bp_stage_slopes J;
    bp_point at[BP_METHOD_STAGES];
} bp_step_points;

/* Differentiate an explicit step that was tried; `plain` still holds its slopes.  Block after block, so that one block's numbers stay near
   the processor; what the blocks share is made beforehand. */
static inline __attribute__((always_inline)) void bp_explicit_tangent_step(const bp_explicit_method *restrict method, const int stages,
                                                                            const ballpass_tangents *tangents,
                                                                            bp_tangent_block *restrict work,
                                                                            const bp_explicit *restrict plain, const bp_numbers *n,
                                                                            long segment, double t, const double *restrict x, double h,
                                                                            const double *restrict next)
{
    bp_step_points points;
    bp_sloped_stages(n, t, h, method->nodes + 1, stages - 1, points.w, points.J);
    for (int i = 1; i <= stages; i++) {
        const int end = i == stages;
        double *restrict y = points.y[i];
        if (end) memcpy(y, next, sizeof points.y[i]);
        else bp_combine(method->a[i], i, (const double(*)[BP_NX])plain->k, h, x, y);
        bp_point_at(&points.at[i], n, points.w[end ? stages - 2 : i - 1], y); /* the last stage is at the step's end as well */
    }
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_direction d = bp_direction_of(tangents, segment, b);
        bp_tangent_block *restrict own = &work[b];
        for (int i = 1; i <= stages; i++) {
            const int end = i == stages;
            double moved[BP_NX * BP_LANES];
            if (!end) bp_stage_moved(points.J, i - 1, &d, &own->w[0][0]);
            bp_combine_lanes(end ? method->weights : method->a[i], i, own->k, h, bp_tangent_state(tangents, b), moved);
            bp_rate_tangent(&points.at[i], n, &d, &own->w[0][0], moved, &own->k[i][0][0]);
            if (end) memcpy(own->next, moved, sizeof moved);
        }
    }
}

/* Largest error over its tolerance of the directions' derivatives, each the root mean square over the states as in bp_norm.  `estimates`
   and `share` as in bp_explicit_step; not a number where one is none.

   The tolerance grows with the derivative: one that the motion multiplies a thousandfold is followed relative to its size. */
static inline double bp_tangent_error(const ballpass_tangents *tangents, const bp_tangent_block *restrict work, const double *weights[],
                                      int estimates, const double *share, int count, double factor)
{
    double worst = 0.0;
    for (long b = 0; b < tangents->blocks; b++) {
        const double *restrict weight = tangents->weight + b * (BP_NX * BP_LANES), *restrict xd = bp_tangent_state(tangents, b);
        double size[BP_LANES] = {0.0}, first[BP_LANES] = {0.0}, below[BP_LANES] = {0.0};
        for (int k = 0; k < BP_NX; k++)
            for (int l = 0; l < BP_LANES; l++) {
                const double scaled = xd[k * BP_LANES + l] * weight[k * BP_LANES + l] * tangents->rtol;
                size[l] += scaled * scaled / (double)BP_NX;
            }
        for (int m = 0; m < estimates; m++) {
            double error[BP_NX * BP_LANES] = {0.0}, square[BP_LANES] = {0.0};
            for (int j = 0; j < count; j++) {
                const double e = factor * weights[m][j];
                if (e == 0.0) continue;
                const double *restrict slope = &work[b].k[j][0][0];
                for (int i = 0; i < BP_NX * BP_LANES; i++) error[i] += e * slope[i];
            }
            for (int k = 0; k < BP_NX; k++)
                for (int l = 0; l < BP_LANES; l++) {
                    const double e = error[k * BP_LANES + l] * weight[k * BP_LANES + l];
                    square[l] += e * e / (double)BP_NX;
                }
            for (int l = 0; l < BP_LANES; l++) {
                if (m == 0) first[l] = square[l];
                below[l] += share[m] * square[l];
            }
        }
        for (int l = 0; l < BP_LANES; l++) {
            const double square = below[l] > 0.0 ? first[l] * first[l] / below[l] : first[l];
            const double relative = square / (size[l] > 1.0 ? size[l] : 1.0);
            if (!(relative <= worst)) worst = relative; /* also where it is no number */
            if (!(worst <= DBL_MAX)) return NAN;
        }
    }
    return sqrt(worst);
}

/* Terms of the dense output of the derivatives; the same combinations as for the states. */
static inline void bp_explicit_tangent_dense(const bp_explicit_method *restrict method, const ballpass_tangents *tangents,
                                             bp_tangent_block *restrict work, const bp_explicit *restrict plain, const bp_numbers *n,
                                             long segment, double t, const double *restrict x, double h)
{
    const int end = method->stages;
    double w[BP_METHOD_STAGES][BP_NW];
    bp_stage_slopes J;
    bp_sloped_stages(n, t, h, method->dense_nodes, method->dense_stages, w, J);
    for (int r = 0; r < method->dense_stages; r++) {
        double y[BP_NX];
        bp_point at;
        bp_combine(method->dense_a[r], end + 1 + r, (const double(*)[BP_NX])plain->k, h, x, y);
        bp_point_at(&at, n, w[r], y);
        for (long b = 0; b < tangents->blocks; b++) {
            const bp_direction d = bp_direction_of(tangents, segment, b);
            double moved[BP_NX * BP_LANES];
            bp_stage_moved(J, r, &d, &work[b].w[0][0]);
            bp_combine_lanes(method->dense_a[r], end + 1 + r, work[b].k, h, bp_tangent_state(tangents, b), moved);
            bp_rate_tangent(&at, n, &d, &work[b].w[0][0], moved, &work[b].k[end + 1 + r][0][0]);
        }
    }
    for (long b = 0; b < tangents->blocks; b++) {
        const double *restrict from = bp_tangent_state(tangents, b), *restrict to = &work[b].next[0][0];
        const double *restrict first = &work[b].k[0][0][0], *restrict last = &work[b].k[end][0][0];
        double *restrict f1 = &work[b].dense[0][0][0], *restrict f2 = &work[b].dense[1][0][0];
        for (int i = 0; i < BP_NX * BP_LANES; i++) {
            const double delta = to[i] - from[i];
            f1[i] = h * first[i] - delta;
            f2[i] = 2.0 * delta - h * (first[i] + last[i]);
        }
        double zero[BP_NX * BP_LANES] = {0.0};
        for (int row = 0; row < method->dense_rows; row++)
            bp_combine_lanes(method->dense[row], end + 1 + method->dense_stages, work[b].k, h, zero, &work[b].dense[2 + row][0][0]);
    }
}

static inline void bp_explicit_tangent_at(const bp_explicit_method *restrict method, const ballpass_tangents *tangents,
                                          const bp_tangent_block *restrict work, double theta, double *restrict out)
{
    const int terms = 2 + method->dense_rows;
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_vector *from = (const bp_vector *)bp_tangent_state(tangents, b), *to = (const bp_vector *)&work[b].next[0][0];
        bp_vector *y = (bp_vector *)(out + b * (BP_NX * BP_LANES)), inner[BP_NX];
#pragma GCC unroll 16
        for (int i = 0; i < BP_NX; i++) inner[i] = (bp_vector){0.0};
        for (int row = terms - 1; row >= 0; row--) {
            const bp_vector *dense = (const bp_vector *)&work[b].dense[row][0][0];
            const double factor = row % 2 == 0 ? 1.0 - theta : theta;
#pragma GCC unroll 16
            for (int i = 0; i < BP_NX; i++) inner[i] = (dense[i] + inner[i]) * factor;
        }
#pragma GCC unroll 16
        for (int i = 0; i < BP_NX; i++) y[i] = from[i] + theta * (to[i] - from[i] + inner[i]);
    }
}

/* Differentiate a linearly implicit step that was tried: E u = R gives E u' = R' + J' u. */
static inline __attribute__((always_inline)) void bp_rosenbrock_tangent_step(const bp_rosenbrock_method *restrict method, const int stages,
                                                                              const ballpass_tangents *tangents,
                                                                              bp_tangent_block *restrict work,
                                                                              const bp_rosenbrock *restrict plain,
                                                                              const bp_matrix *restrict matrix, const bp_numbers *n,
                                                                              long segment, double t, const double *restrict x, double h)
{
    const double inverse_s = h * method->gamma, inverse_h = 1.0 / h;
    bp_step_points points;
    bp_sloped_stages(n, t, h, method->nodes + 1, stages - 1, points.w, points.J);
    bp_point_at(&points.at[0], n, plain->w, x);
    for (int i = 1; i < stages; i++) {
        bp_state y = BP_STATE(x);
        for (int j = 0; j < i; j++) y += method->a[i][j] * BP_STATE(plain->u[j]);
        *(bp_state *)points.y[i] = y;
        bp_point_at(&points.at[i], n, points.w[i - 1], points.y[i]);
    }
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_direction d = bp_direction_of(tangents, segment, b);
        bp_tangent_block *restrict own = &work[b];
        const double *restrict xd = bp_tangent_state(tangents, b);
        bp_stage_rate_tangent_lanes(t, n->u, n->p, n->c, d.u, d.p, d.c, &own->w[0][0], &own->wt[0][0]);
        bp_linearize_tangent(&points.at[0], n, &d, plain->wt, &own->w[0][0], &own->wt[0][0], xd, &own->A[0][0], &own->B[0][0],
                             &own->at[0][0]);
        for (int i = 0; i < stages; i++) {
            double R[BP_NX * BP_LANES], moved[BP_NX * BP_LANES], rate[BP_NX * BP_LANES], zero[BP_NX * BP_LANES] = {0.0};
            if (i == 1 || (i > 1 && method->nodes[i] != method->nodes[i - 1]))
                bp_stage_moved(points.J, i - 1, &d, &own->w[0][0]);
            if (i > 0) bp_combine_lanes(method->a[i], i, own->k, 1.0, xd, moved);
            bp_rate_tangent(&points.at[i], n, &d, &own->w[0][0], i > 0 ? moved : xd, rate);
            bp_combine_lanes(method->coupling[i], i, own->k, inverse_h, zero, R);
            const double hd = h * method->time_weights[i];
            bp_vector right[BP_NX], *to = (bp_vector *)&own->k[i][0][0];
            const bp_vector *coupled = (const bp_vector *)R, *rates = (const bp_vector *)rate, *moving = (const bp_vector *)&own->at[0][0];
            const bp_vector *A = (const bp_vector *)&own->A[0][0], *B = (const bp_vector *)&own->B[0][0];
#pragma GCC unroll 16
            for (int k = 0; k < BP_NX; k++) right[k] = coupled[k] + rates[k];
#pragma GCC unroll 16
            for (int k = 0; k < BP_NQ; k++) {
                bp_vector row = right[BP_NQ + k] + hd * moving[k];
#pragma GCC unroll 16
                for (int j = 0; j < BP_NQ; j++) row += plain->u[i][j] * A[k * BP_NQ + j] + plain->u[i][BP_NQ + j] * B[k * BP_NQ + j];
                right[BP_NQ + k] = row;
            }
#pragma GCC unroll 16
            for (int k = 0; k < BP_NQ; k++) {
                bp_vector kv = matrix->solve[0][k] * right[0];
#pragma GCC unroll 16
                for (int j = 1; j < BP_NX; j++) kv += matrix->solve[j][k] * right[j];
                to[BP_NQ + k] = kv;
                to[k] = (right[k] + kv) * inverse_s;
            }
        }
        bp_combine_lanes(method->weights, stages, own->k, 1.0, xd, &own->next[0][0]);
    }
}

static inline void bp_rosenbrock_tangent_dense(const bp_rosenbrock_method *restrict method, const ballpass_tangents *tangents,
                                               bp_tangent_block *restrict work)
{
    double zero[BP_NX * BP_LANES] = {0.0};
    for (long b = 0; b < tangents->blocks; b++)
        for (int row = 0; row < method->dense_rows; row++)
            bp_combine_lanes(method->dense[row], method->stages, work[b].k, 1.0, zero, &work[b].dense[row][0][0]);
}

static inline void bp_rosenbrock_tangent_at(const bp_rosenbrock_method *restrict method, const ballpass_tangents *tangents,
                                            const bp_tangent_block *restrict work, double theta, double *restrict out)
{
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_vector *from = (const bp_vector *)bp_tangent_state(tangents, b), *to = (const bp_vector *)&work[b].next[0][0];
        bp_vector *y = (bp_vector *)(out + b * (BP_NX * BP_LANES)), inner[BP_NX];
#pragma GCC unroll 16
        for (int i = 0; i < BP_NX; i++) inner[i] = (bp_vector){0.0};
        for (int row = method->dense_rows - 1; row >= 0; row--) {
            const bp_vector *dense = (const bp_vector *)&work[b].dense[row][0][0];
#pragma GCC unroll 16
            for (int i = 0; i < BP_NX; i++) inner[i] = dense[i] + theta * inner[i];
        }
#pragma GCC unroll 16
        for (int i = 0; i < BP_NX; i++) y[i] = from[i] + theta * (to[i] - from[i] + (1.0 - theta) * inner[i]);
    }
}

#endif
