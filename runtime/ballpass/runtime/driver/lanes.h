/* The methods for a member of an ensemble in each SIMD lane; bodies in explicit.h and rosenbrock.h, the model in lane_model.h. */
#ifndef BALLPASS_LANES_H
#define BALLPASS_LANES_H

#include <string.h>

#include "control.h"
#include "lane_model.h"

/* A number of each member. */
typedef double bp_lane __attribute__((vector_size(BP_L * sizeof(double)), aligned(8), may_alias));

typedef struct {
    double k[BP_METHOD_STAGES][BP_NX * BP_L] BP_ALIGNED; /* slopes; the first is known when a step starts */
    double y[BP_NX * BP_L] BP_ALIGNED;                     /* argument of the last stage: stiffness shows in it */
} bp_lane_explicit;

typedef struct {
    const bp_lane_numbers *n;
    double w[BP_METHOD_STAGES][BP_NW * BP_L] BP_ALIGNED;
} bp_lane_times;

typedef struct {
    const bp_lane_numbers *n;
    const bp_rosenbrock_method *method;
    double w[BP_NW * BP_L] BP_ALIGNED, wt[BP_NW * BP_L] BP_ALIGNED;         /* stage variables at the start */
    double end_w[BP_NW * BP_L] BP_ALIGNED, end_wt[BP_NW * BP_L] BP_ALIGNED; /* and at the end of the step tried */
    double inner_w[BP_METHOD_STAGES][BP_NW * BP_L] BP_ALIGNED;
    double u[BP_METHOD_STAGES][BP_NX * BP_L] BP_ALIGNED;                    /* stages */
    double A[BP_NQ * BP_NQ * BP_L] BP_ALIGNED, B[BP_NQ * BP_NQ * BP_L] BP_ALIGNED; /* of the step tried */
    double dx[BP_NX * BP_L] BP_ALIGNED, at[BP_NQ * BP_L] BP_ALIGNED;
    double pivoted[BP_L] BP_ALIGNED; /* whether its system was solved with pivoting */
} bp_lane_linear;

BP_INLINE void bp_lane_slope(const bp_lane_times *at, int i, int time, const double *restrict y, double *restrict k)
{
    (void)i;
    bp_lane_rate(at->n, at->w[time], y, k);
}

BP_INLINE void bp_lane_linear_slope(const bp_lane_linear *at, int i, const double *restrict y, double *restrict dx)
{
    if (i == 0) memcpy(dx, at->dx, sizeof at->dx);
    else bp_lane_rate(at->n, at->method->place[i] < at->method->inner ? at->inner_w[at->method->place[i]] : at->end_w, y, dx);
}

BP_INLINE bp_lane bp_lane_time_term(const bp_lane_linear *at, int i, int c, bp_lane d)
{
    (void)i;
    return d * ((const bp_lane *)at->at)[c];
}

#define BP_NAME(f) bp_lane_##f
#define BP_W BP_L
#define BP_N bp_lane
#define BP_V bp_lane
#define BP_VS BP_NQ
#define BP_H bp_lane
#define BP_S bp_lane
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

/* Stage variables at times of the step from t whose angles have been started. */
BP_INLINE void bp_lane_times_of(bp_lane_times *restrict at, const bp_lane_numbers *n, const bp_lane_angles *restrict angles,
                                const double *restrict nodes, int count, const double *restrict t, const double *restrict h)
{
    at->n = n;
    for (int i = 0; i < count; i++) bp_lane_stage(n, angles, nodes[i], t, h, at->w[i]);
}

/* One explicit step from (t, x) to `next`, the end slope included. */
BP_INLINE void bp_lane_explicit_step(const bp_explicit_method *restrict method, bp_lane_explicit *restrict work, const bp_lane_numbers *n, bp_lane_angles *restrict angles,
                                         const double *restrict t, const double *restrict x, const double *restrict h,
                                         const double *restrict weight, double *restrict next, double *restrict error)
{
    bp_lane_times at;
    bp_lane_angles_start(angles, n, t, h);
    /* all times of the step first: nothing in them waits for a slope */
    bp_lane_times_of(&at, n, angles, method->nodes + 1, method->times, t, h);
    bp_lane_explicit_stages(method, &at, work->k, work->y, x, h, next);
    bp_lane_explicit_error(method, (const double(*)[BP_NX * BP_L])work->k, h, weight, error);
}

/* Columns of [W^-1 A/s | W^-1] for every lane, without pivoting; a lane whose W is not dominated by its diagonal is done anew by itself,
   with pivoting.  A singular W makes its lane's step not a number. */
static inline void bp_lane_factorize(double solve[BP_NX][BP_NQ * BP_L], double *restrict pivoted, const double *restrict A,
                                     const double *restrict B, const double *restrict s)
{
    bp_lane rows[BP_NQ][3 * BP_NQ];
    double dominance[BP_L] BP_ALIGNED;
    bp_lane_matrix_rows(rows, dominance, A, B, (const bp_lane *)s);
#pragma GCC unroll 16
    for (int k = 0; k < BP_NQ; k++) bp_lane_clear_column(rows, k);
    for (int j = 0; j < BP_NX; j++)
        for (int i = 0; i < BP_NQ; i++) ((bp_lane *)solve[j])[i] = rows[i][BP_NQ + j];
    BP_EACH_LANE pivoted[lane] = 1.0 - dominance[lane];
    for (int lane = 0; lane < BP_L; lane++) {
        if (dominance[lane] != 0.0) continue;
        double own_A[BP_NQ * BP_NQ], own_B[BP_NQ * BP_NQ];
        bp_matrix matrix;
        for (int k = 0; k < BP_NQ * BP_NQ; k++) {
            own_A[k] = A[k * BP_L + lane];
            own_B[k] = B[k * BP_L + lane];
        }
        const int regular = bp_factorize(&matrix, own_A, own_B, s[lane]);
        for (int j = 0; j < BP_NX; j++)
            for (int i = 0; i < BP_NQ; i++) solve[j][i * BP_L + lane] = regular ? matrix.solve[j][i] : NAN;
    }
}

/* One linearly implicit step from (t, x) to `next`; linearizes at its start, where w and wt hold. */
static inline void bp_lane_linear_step(const bp_rosenbrock_method *restrict method, bp_lane_linear *restrict work, const bp_lane_numbers *n, bp_lane_angles *restrict angles,
                                       const double *restrict t, const double *restrict x, const double *restrict h,
                                       const double *restrict weight, double *restrict next, double *restrict error)
{
    const double(*stages)[BP_NX * BP_L] = (const double(*)[BP_NX * BP_L])work->u;
    double solve[BP_NX][BP_NQ * BP_L] BP_ALIGNED, s[BP_L] BP_ALIGNED;
    double C[BP_NA * BP_L] BP_ALIGNED, S[BP_NA * BP_L] BP_ALIGNED, time[BP_L] BP_ALIGNED;
    work->n = n;
    work->method = method;
    BP_EACH_LANE s[lane] = 1.0 / (h[lane] * method->gamma);
    bp_lane_linearize(n, work->w, work->wt, x, work->dx, work->A, work->B, work->at);
    bp_lane_factorize(solve, work->pivoted, work->A, work->B, s);
    bp_lane_angles_start(angles, n, t, h);
    for (int i = 0; i < method->inner; i++) bp_lane_stage(n, angles, method->inner_nodes[i], t, h, work->inner_w[i]);
    /* the end serves several stages and the next step, with the time derivative */
    bp_lane_turn(angles, 1.0, t, h, C, S, time);
    bp_member_stage_rate_turned_lanes(C, S, angles->rate, time, n->u, n->p, n->c, work->end_w, work->end_wt);
    bp_lane_rosenbrock_stages(method, work, solve[0], work->u, x, h);
    bp_lane_rosenbrock_end(method, stages, x, next);
    bp_lane_rosenbrock_error(method, stages, weight, error);
}

#endif
