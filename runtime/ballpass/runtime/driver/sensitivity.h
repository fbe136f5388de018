/* Forward sensitivities: the derivative of the discrete solution along any number of directions of the parameters.

   After a step is accepted, the same formulas (explicit.h, rosenbrock.h) are differentiated at fixed step size, BP_LANES directions at a
   time; what does not depend on the direction (slopes of the law, the small inverse) is computed once for all.

   Derivatives are taken along moving times: with the driver's speed, all events at an angle move in time, and by more in every
   turn.  At fixed time the derivative would be a small difference of two large parts.  Where the time moves by t', which grows by `stretch`
   in time, dx/dt = f(t, x) gives (dx/dt)' = f_x x' + f_t t' + f_p p' + stretch f; steps that stretch with the time have the same formulas,
   and the caller gets x' - f t', the derivative at fixed time.  So t' is free at any time: x' + f d belongs to t' + d.

   At a branch point of the law, where a contact begins or ends, f_x is unbounded, like one over the root of the time to it.  Times that
   move with the contact leave its deflection at zero, and f_x x' at zero with it: t' is set to that at an onset, and a step that ends with a
   release is differentiated twice, the second time with the stretch that leads there (locate.h, sqrt_time.h).

   Where a load switches at a time that moves by `shift`, the derivative jumps by (rate before - rate behind) (shift - t').

   Where the caller gives tolerances for the derivatives, their embedded error takes part in the choice of the step size.  A step is
   differentiated before it is judged; the derivatives of the state change only when it is accepted, so that a rejected one has no effect.

   Compiled in only where BALLPASS_SENSITIVITIES is defined. */
#ifndef BALLPASS_SENSITIVITY_H
#define BALLPASS_SENSITIVITY_H

#include <float.h>
#include <string.h>

#include "single.h"
#include "stepper.h"
#include "tangent_model.h"

/* Work of one block of directions; the caller brings ballpass_tangent_work(blocks) bytes. */
typedef struct {
    double rate[BP_NX * BP_LANES]; /* of dx/dt where an explicit step starts, without stretch */
    double moved[BP_LANES], stretch[BP_LANES]; /* t' where the step starts, and how fast it grows in the step */
    double k[BP_METHOD_STAGES][BP_NX * BP_LANES]; /* derivatives of slopes or stages */
    double argument[BP_NX * BP_LANES], next[BP_NX * BP_LANES], dense[BP_DENSE_ROWS][BP_NX * BP_LANES];
    double w[BP_NW * BP_LANES], wt[BP_NW * BP_LANES];
    double A[BP_NQ * BP_NQ * BP_LANES], B[BP_NQ * BP_NQ * BP_LANES], at[BP_NQ * BP_LANES];
} bp_tangent_block;

/* Derivatives of the stage variables by inputs, parameters and constants at stage times, BP_AT_ONCE times to a row. */
enum { BP_TIMES = (BP_METHOD_STAGES + BP_AT_ONCE - 1) / BP_AT_ONCE };
typedef double bp_stage_slopes[BP_TIMES][BP_NJ * BP_AT_ONCE];

/* Common data of the directions at the stages of a step, and the slopes there that are differentiated. */
typedef struct {
    const bp_numbers *n;
    const bp_linear *plain; /* of a linearly implicit step */
    const double *nodes;
    double after[BP_METHOD_STAGES], pace[BP_METHOD_STAGES]; /* time since the step's start, and the pace there (sqrt_time.h) */
    double w[BP_METHOD_STAGES][BP_NW], y[BP_METHOD_STAGES][BP_NX];
    const double *slope[BP_METHOD_STAGES]; /* dx/dt there, times the pace */
    double rate[BP_METHOD_STAGES][BP_NX];  /* the same where the step itself does not keep it */
    bp_stage_slopes J;
    bp_point at[BP_METHOD_STAGES];
} bp_step_points;

/* One block at these stages. */
typedef struct {
    bp_step_points *points;
    bp_direction d;
    bp_tangent_block *own;
} bp_tangent_times;

typedef bp_tangent_times bp_tangent_linear;

static inline double *bp_tangent_state(const ballpass_tangents *tangents, long block) { return tangents->x + block * (BP_NX * BP_LANES); }

static inline bp_tangent_times bp_tangent_of(const ballpass_tangents *tangents, bp_tangent_block *work, bp_step_points *points, long segment,
                                             long block)
{
    bp_tangent_times at;
    at.points = points;
    at.own = &work[block];
    at.d.p = tangents->p + block * (BP_NP * BP_LANES);
    at.d.c = tangents->c + block * (BP_NC * BP_LANES);
    at.d.u = tangents->u + (segment * tangents->blocks + block) * (BP_NU * BP_LANES);
    return at;
}

/* t' at a time since the step's start. */
static inline void bp_moved_time(const bp_tangent_block *restrict own, double after, double *restrict td)
{
    for (int l = 0; l < BP_LANES; l++) td[l] = own->moved[l] + own->stretch[l] * after;
}

/* x' + f d: the derivative along times that move by d more. */
static inline void bp_move(const double *restrict f, const double *restrict d, double *restrict xd)
{
    for (int k = 0; k < BP_NX; k++)
        for (int l = 0; l < BP_LANES; l++) xd[k * BP_LANES + l] += f[k] * d[l];
}

/* Derivatives of the stage variables at the time number `time` along a block's directions. */
static inline void bp_tangent_stage(const bp_tangent_times *at, int time)
{
    double td[BP_LANES];
    bp_moved_time(at->own, at->points->after[time], td);
    bp_stage_moved_lanes(at->points->J[time / BP_AT_ONCE] + time % BP_AT_ONCE, td, at->d.u, at->d.p, at->d.c, at->own->w);
}

static inline void bp_tangent_rate(const bp_tangent_times *at, int i, double pace, const double *restrict y, double *restrict k)
{
    const bp_vector stretch = *(const bp_vector *)at->own->stretch;
    bp_rate_tangent(&at->points->at[i], at->points->n, &at->d, at->own->w, y, k);
    for (int c = 0; c < BP_NX; c++) ((bp_vector *)k)[c] = pace * ((bp_vector *)k)[c] + stretch * at->points->slope[i][c];
}

/* Where the end slope is at the time of the last stage, its variables are there. */
static inline void bp_tangent_slope(const bp_tangent_times *at, int i, int time, const double *restrict y, double *restrict k)
{
    if (time == i - 1) bp_tangent_stage(at, time);
    bp_tangent_rate(at, i, at->points->pace[time], y, k);
}

static inline void bp_tangent_linear_slope(const bp_tangent_linear *at, int i, const double *restrict y, double *restrict dx)
{
    if (i == 1 || (i > 1 && at->points->nodes[i] != at->points->nodes[i - 1])) bp_tangent_stage(at, i - 1);
    bp_tangent_rate(at, i, 1.0, y, dx);
}

/* E u = R gives E u' = R' + J' u; with stretch l, J' is J' + l J and the partial derivative by time, f_t, moves by 2 l f_t. */
BP_INLINE bp_vector bp_tangent_time_term(const bp_tangent_linear *at, int i, int c, double d)
{
    const bp_vector *A = (const bp_vector *)at->own->A + c * BP_NQ, *B = (const bp_vector *)at->own->B + c * BP_NQ;
    const double *restrict u = at->points->plain->u[i];
    bp_vector term = d * ((const bp_vector *)at->own->at)[c];
#pragma GCC unroll 16
    for (int j = 0; j < BP_NQ; j++) term += u[j] * A[j] + u[BP_NQ + j] * B[j];
    double stretched = 2.0 * d * at->points->plain->at[c];
    for (int j = 0; j < BP_NQ; j++)
        stretched += at->points->plain->A[c * BP_NQ + j] * u[j] + at->points->plain->B[c * BP_NQ + j] * u[BP_NQ + j];
    return term + stretched * *(const bp_vector *)at->own->stretch;
}

/* The same for position c, of which J has but the velocity. */
BP_INLINE bp_vector bp_tangent_position_term(const bp_tangent_linear *at, int i, int c)
{
    return (at->points->slope[i][c] + at->points->plain->u[i][BP_NQ + c]) * *(const bp_vector *)at->own->stretch;
}

#define BP_NAME(f) bp_tangent_##f
#define BP_W BP_LANES
#define BP_N bp_vector
#define BP_V bp_vector
#define BP_VS BP_NQ
#define BP_H double
#define BP_S double
#define BP_STRETCHED
#include "explicit.h"
#include "rosenbrock.h"
#undef BP_STRETCHED
#undef BP_NAME
#undef BP_W
#undef BP_N
#undef BP_V
#undef BP_VS
#undef BP_H
#undef BP_S

/* Stage variables at the nodes i = 0 ... count - 1 of a step from t, and their derivatives; `lead` where the pace is uneven, else NULL. */
static inline void bp_sloped_stages(bp_step_points *points, const bp_numbers *n, double t, double h, const double *restrict nodes,
                                    const int count, const double *lead)
{
    double passed[BP_METHOD_STAGES];
    points->n = n;
    for (int i = 0; i < count; i++) {
        passed[i] = lead ? bp_passed(*lead, nodes[i]) : nodes[i];
        points->after[i] = passed[i] * h;
        points->pace[i] = lead ? bp_pace(*lead, nodes[i]) : 1.0;
    }
    for (int first = 0; first < count; first += BP_AT_ONCE) {
        double some[BP_AT_ONCE], time[BP_AT_ONCE], C[BP_NA * BP_AT_ONCE], S[BP_NA * BP_AT_ONCE], lanes[BP_NW * BP_AT_ONCE];
        bp_some_nodes(passed, first, count, some);
        bp_directions(n, t, h, some, C, S);
        for (int i = 0; i < BP_AT_ONCE; i++) time[i] = t + some[i] * h;
        bp_stage_slopes_lanes(C, S, time, n->u, n->p, n->c, lanes, points->J[first / BP_AT_ONCE]);
        for (int i = 0; i < BP_AT_ONCE && first + i < count; i++)
            for (int k = 0; k < BP_NW; k++) points->w[first + i][k] = lanes[k * BP_AT_ONCE + i];
    }
}

/* Derivative of the first slope, where no step before has left it. */
static inline void bp_explicit_tangent_start(const ballpass_tangents *tangents, bp_tangent_block *restrict work, const bp_numbers *n,
                                             long segment, double t, const double *restrict x)
{
    static const double start[1] = {0.0};
    bp_step_points points;
    bp_sloped_stages(&points, n, t, 0.0, start, 1, NULL);
    bp_point_at(&points.at[1], n, points.w[0], x);
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_tangent_times at = bp_tangent_of(tangents, work, &points, segment, b);
        bp_tangent_stage(&at, 0);
        bp_rate_tangent(&points.at[1], n, &at.d, at.own->w, bp_tangent_state(tangents, b), work[b].rate);
    }
}

/* Differentiate an explicit step that was tried; `plain` still holds its slopes.  Block after block, so that one block's numbers stay near
   the processor; what the blocks share is made beforehand. */
static inline void bp_explicit_tangent_step(const bp_explicit_method *restrict method, const ballpass_tangents *tangents,
                                            bp_tangent_block *restrict work, const bp_explicit *restrict plain, const bp_numbers *n,
                                            long segment, double t, const double *restrict x, double h, const double *lead,
                                            const double *restrict next)
{
    bp_step_points points;
    const int stages = method->stages;
    bp_sloped_stages(&points, n, t, h, method->nodes + 1, method->times, lead);
    for (int i = 1; i <= stages; i++) {
        double *restrict y = points.y[i];
        if (i == stages) memcpy(y, next, sizeof points.y[i]);
        else bp_combine(method->a[i], i, (const double(*)[BP_NX])plain->k, &h, x, y);
        bp_point_at(&points.at[i], n, points.w[i < stages ? i - 1 : method->times - 1], y);
        points.slope[i] = plain->k[i];
    }
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_tangent_times at = bp_tangent_of(tangents, work, &points, segment, b);
        const double pace = lead ? *lead : 1.0;
        for (int k = 0; k < BP_NX; k++)
            for (int l = 0; l < BP_LANES; l++)
                work[b].k[0][k * BP_LANES + l] = pace * work[b].rate[k * BP_LANES + l] + work[b].stretch[l] * plain->k[0][k];
        bp_tangent_explicit_stages(method, &at, work[b].k, work[b].argument, bp_tangent_state(tangents, b), &h, work[b].next);
    }
}

/* Differentiate a linearly implicit step that was tried. */
static inline void bp_rosenbrock_tangent_step(const bp_rosenbrock_method *restrict method, const ballpass_tangents *tangents, bp_tangent_block *restrict work,
                                              const bp_linear *restrict plain, const bp_matrix *restrict matrix, const bp_numbers *n,
                                              long segment, double t, const double *restrict x, double h)
{
    const double one = 1.0;
    bp_step_points points;
    points.plain = plain;
    points.nodes = method->nodes;
    bp_sloped_stages(&points, n, t, h, method->nodes + 1, method->stages - 1, NULL);
    bp_point_at(&points.at[0], n, plain->w, x);
    points.slope[0] = plain->dx;
    for (int i = 1; i < method->stages; i++) {
        double *restrict y = points.y[i], *restrict rate = points.rate[i];
        bp_add(method->a[i], i, (const double(*)[BP_NX])plain->u, &one, x, y);
        bp_point_at(&points.at[i], n, points.w[i - 1], y);
        memcpy(rate, y + BP_NQ, BP_NQ * sizeof *rate);
        bp_acceleration(y, points.at[i].S, points.at[i].r, n->u, n->p, n->c, points.w[i - 1], rate + BP_NQ);
        points.slope[i] = rate;
    }
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_tangent_times at = bp_tangent_of(tangents, work, &points, segment, b);
        const double *restrict xd = bp_tangent_state(tangents, b);
        bp_tangent_block *restrict own = &work[b];
        bp_stage_rate_tangent_lanes(t, n->u, n->p, n->c, own->moved, at.d.u, at.d.p, at.d.c, own->w, own->wt);
        bp_linearize_tangent(&points.at[0], n, &at.d, plain->wt, own->w, own->wt, xd, own->A, own->B, own->at);
        bp_tangent_rosenbrock_stages(method, &at, matrix->solve[0], own->k, xd, &h);
        bp_tangent_rosenbrock_end(method, (const double(*)[BP_NX * BP_LANES])own->k, xd, own->next);
    }
}

/* Largest scaled error of the directions' derivatives in the step tried, by the method given; NaN where one is NaN.

   The tolerance grows with the derivative: one that the motion multiplies a thousandfold is followed relative to its size. */
static inline double bp_tangent_error(const ballpass_tangents *tangents, const bp_tangent_block *restrict work,
                                      const bp_explicit_method *plain, const bp_rosenbrock_method *linear, double h)
{
    double worst = 0.0;
    for (long b = 0; b < tangents->blocks; b++) {
        const double *restrict weight = tangents->weight + b * (BP_NX * BP_LANES);
        const double(*k)[BP_NX * BP_LANES] = (const double(*)[BP_NX * BP_LANES])work[b].k;
        double error[BP_LANES], size[BP_LANES];
        if (plain) bp_tangent_explicit_error(plain, k, &h, weight, error);
        else bp_tangent_rosenbrock_error(linear, k, weight, error);
        bp_tangent_norm(bp_tangent_state(tangents, b), weight, size);
        for (int l = 0; l < BP_LANES; l++) {
            const double grown = tangents->rtol * size[l], relative = error[l] / (grown > 1.0 ? grown : 1.0);
            if (!(relative <= worst)) worst = relative; /* also where it is NaN */
            if (!(worst <= DBL_MAX)) return NAN;
        }
    }
    return worst;
}

#ifdef BALLPASS_LOCATED
/* Derivative of a switching function of a ball at a time and state along directions x', t' of a block. */
static inline void bp_switch_moved(const ballpass_tangents *tangents, bp_tangent_block *restrict work, const bp_numbers *n, long segment,
                                   long block, int event, double t, const double *restrict x, const double *restrict xd,
                                   const double *restrict td, double *restrict gd)
{
    static const double start[1] = {0.0};
    bp_step_points points;
    const bp_tangent_times at = bp_tangent_of(tangents, work, &points, segment, block);
    double wd[BP_NW * BP_LANES], r[BP_NR], rd[BP_NR * BP_LANES];
    bp_sloped_stages(&points, n, t, 0.0, start, 1, NULL);
    bp_stage_moved_lanes(points.J[0], td, at.d.u, at.d.p, at.d.c, wd);
    bp_relative(x, n->u, n->p, n->c, points.w[0], r);
    bp_relative_tangent_lanes(x, n->u, n->p, n->c, points.w[0], xd, at.d.u, at.d.p, at.d.c, wd, rd);
#define BP_MOVED(b)                                                                                                              \
    if (event >= bp_first_event[bearing] && event < bp_first_event[bearing] + BP_##b##_SWITCHES * BP_##b##_BALLS) {                    \
        const int j = (event - bp_first_event[bearing]) % BP_##b##_BALLS, which = (event - bp_first_event[bearing]) / BP_##b##_BALLS;  \
        const double *const cd = rd + BP_CAGE * BP_LANES, *const sd = cd + BP_LANES, *turn = r + BP_CAGE; \
        const double co = bp_##b##_cos[j] * turn[0] - bp_##b##_sin[j] * turn[1], si = bp_##b##_sin[j] * turn[0] + bp_##b##_cos[j] * turn[1]; \
        double k[BP_##b##_NK], kd[BP_##b##_NK * BP_LANES], cod[BP_LANES], sid[BP_LANES];                                         \
        double moved[(BP_##b##_SWITCHES + 1) * BP_LANES];                                                                        \
        BP_NUMBERS(b, 1, n->p, n->c, points.w[0], k)                                                                            \
        BP_NUMBERS(b, BP_LANES, at.d.p, at.d.c, wd, kd)                                                                          \
        for (int l = 0; l < BP_LANES; l++) {                                                                                     \
            cod[l] = bp_##b##_cos[j] * cd[l] - bp_##b##_sin[j] * sd[l];                                                          \
            sid[l] = bp_##b##_sin[j] * cd[l] + bp_##b##_cos[j] * sd[l];                                                          \
        }                                                                                                                        \
        bp_##b##_switches_moved_lanes(&co, &si, r + bp_first_relative[bearing], k, cod, sid, rd + bp_first_relative[bearing] * BP_LANES, kd, moved); \
        memcpy(gd, moved + which * BP_LANES, BP_LANES * sizeof *gd);                                                             \
    }
    BP_EACH_BEARING(BP_MOVED)
#undef BP_MOVED
}
#endif

/* Terms of the dense output of the derivatives. */
static inline void bp_explicit_tangent_dense(const bp_explicit_method *restrict method, const ballpass_tangents *tangents,
                                             bp_tangent_block *restrict work, const bp_explicit *restrict plain, const bp_numbers *n,
                                             long segment, double t, const double *restrict x, double h, const double *lead)
{
    bp_step_points points;
    bp_sloped_stages(&points, n, t, h, method->dense_nodes, method->dense_stages, lead);
    for (int r = 0; r < method->dense_stages; r++) {
        bp_combine(method->dense_a[r], method->stages + 1 + r, (const double(*)[BP_NX])plain->k, &h, x, points.y[r]);
        bp_point_at(&points.at[r + 1], n, points.w[r], points.y[r]);
        points.slope[r + 1] = plain->k[method->stages + 1 + r];
    }
    for (long b = 0; b < tangents->blocks; b++) {
        const bp_tangent_times at = bp_tangent_of(tangents, work, &points, segment, b);
        bp_tangent_explicit_dense(method, &at, work[b].k, bp_tangent_state(tangents, b), &h, work[b].next, work[b].dense);
    }
}

#endif
