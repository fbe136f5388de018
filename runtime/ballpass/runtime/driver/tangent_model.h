/* The model differentiated along BP_LANES directions at a time: what directions share at a state, and derivatives of the rates. */
#ifndef BALLPASS_TANGENT_MODEL_H
#define BALLPASS_TANGENT_MODEL_H

#include <string.h>

#include "model.h"
#include "tangents.h"

/* The same as one value (a vector of gcc and clang), for sums that should stay in registers. */
typedef double bp_vector __attribute__((vector_size(BP_LANES * sizeof(double)), aligned(8), may_alias));

/* What the directions share at one state and time: of each bearing the relative motion, the directions and numbers of its balls, and the
   sums S, of the slopes G, and of the rows that derivatives of S are made of (partials). */
typedef struct {
    const double *x, *w;
    double r[BP_NR], S[BP_NS], G[BP_NG], co[BP_NB], si[BP_NB];
#define BP_OF_ALIKE(b) double k_##b[BP_##b##_ALIKE][BP_##b##_NK], total_##b[BP_##b##_ALIKE][BP_##b##_SUMS + BP_##b##_PARTIALS];
    BP_EACH_STRUCTURE(BP_OF_ALIKE)
#undef BP_OF_ALIKE
} bp_point;

/* Directions of one block: parameters, constants, inputs of the segment. */
typedef struct {
    const double *p, *c, *u;
} bp_direction;

/* Sums over the balls with their slopes and partial derivatives; where kinks are located the law's sides are held. */
#ifdef BALLPASS_LOCATED
#define BP_PARTIALS(b) bp_##b##_held_partials_lanes(co, si, r + bp_first_relative[bearing], k, n->border + bp_first_event[bearing], rows);
#else
#define BP_PARTIALS(b) bp_##b##_partials_lanes(co, si, r + bp_first_relative[bearing], k, rows);
#endif

static inline void bp_point_at(bp_point *restrict at, const bp_numbers *n, const double *restrict w, const double *restrict x)
{
    at->x = x;
    at->w = w;
    bp_relative(x, n->u, n->p, n->c, w, at->r);
#define BP_POINT(b)                                                                                                              \
    {                                                                                                                            \
        const double *const r = at->r;                                                                                           \
        BP_BALLS(b, BP_##b##_SUMS + BP_##b##_PARTIALS)                                                                                       \
        BP_PARTIALS(b)                                                                                                           \
        BP_TOTALS(b, 0, BP_##b##_SUMS + BP_##b##_PARTIALS, at->total_##b[alike])                                                                    \
        memcpy(at->S + bp_first_sum[bearing], at->total_##b[alike], BP_##b##_SUMS * sizeof *at->S);                                                               \
        memcpy(at->G + bp_first_slope[bearing], at->total_##b[alike] + BP_##b##_SUMS, BP_##b##_SLOPES * sizeof *at->G);                                \
        memcpy(at->co + bp_first_ball[bearing], co, sizeof co);                                                                     \
        memcpy(at->si + bp_first_ball[bearing], si, sizeof si);                                                                     \
        memcpy(at->k_##b[alike], k, sizeof k);                                                                                          \
    }
    BP_EACH_BEARING(BP_POINT)
#undef BP_POINT
}

/* Derivatives of the sums S along the block's directions, for moved coefficients rd and stage variables wd. */
static inline void bp_sums_tangent(const bp_point *restrict at, const bp_direction *d, const double *restrict wd, const double *restrict rd,
                                   double *restrict Sd)
{
#define BP_MOVED(b)                                                                                                              \
    {                                                                                                                            \
        const double c = at->r[BP_CAGE], s = at->r[BP_CAGE + 1];                                         \
        const double *const cd = rd + BP_CAGE * BP_LANES, *const sd = cd + BP_LANES;                             \
        double kd[BP_##b##_NK * BP_LANES], angle[BP_LANES];                                                                      \
        BP_NUMBERS(b, BP_LANES, d->p, d->c, wd, kd)                                                                              \
        _Pragma("omp simd")                                                                                                      \
        for (int l = 0; l < BP_LANES; l++) angle[l] = c * sd[l] - s * cd[l];                                                     \
        bp_##b##_sums_moved_lanes(at->total_##b[alike], rd + bp_first_relative[bearing] * BP_LANES, angle, kd, Sd + bp_first_sum[bearing] * BP_LANES);                   \
    }
    BP_EACH_BEARING(BP_MOVED)
#undef BP_MOVED
}

/* Derivative of dx/dt along the block's directions, for the moved state xd and stage variables wd. */
static inline void bp_rate_tangent(const bp_point *restrict at, const bp_numbers *n, const bp_direction *d, const double *restrict wd,
                                   const double *restrict xd, double *restrict out)
{
    double rd[BP_NR * BP_LANES], Sd[BP_NS * BP_LANES];
    bp_relative_tangent_lanes(at->x, n->u, n->p, n->c, at->w, xd, d->u, d->p, d->c, wd, rd);
    bp_sums_tangent(at, d, wd, rd, Sd);
    for (int k = 0; k < BP_NQ * BP_LANES; k++) out[k] = xd[BP_NQ * BP_LANES + k];
    bp_acceleration_tangent_lanes(at->x, at->S, at->r, n->u, n->p, n->c, at->w, xd, Sd, rd, d->u, d->p, d->c, wd, out + BP_NQ * BP_LANES);
}

/* Derivatives of the Jacobian's blocks and of the partial time derivative. */
static inline void bp_linearize_tangent(const bp_point *restrict at, const bp_numbers *n, const bp_direction *d,
                                        const double *restrict wt, const double *restrict wd, const double *restrict wtd,
                                        const double *restrict xd, double *restrict A, double *restrict B, double *restrict rate_d)
{
    double rd[BP_NR * BP_LANES], Sd[BP_NS * BP_LANES], Gd[BP_NG * BP_LANES];
    bp_relative_tangent_lanes(at->x, n->u, n->p, n->c, at->w, xd, d->u, d->p, d->c, wd, rd);
    bp_sums_tangent(at, d, wd, rd, Sd);
    for (int i = 0; i < BP_NG * BP_LANES; i++) Gd[i] = 0.0;
#define BP_MOVED(b)                                                                                                              \
    {                                                                                                                            \
        const double *const cd = rd + BP_CAGE * BP_LANES, *const sd = cd + BP_LANES;                             \
        double kd[BP_##b##_NK * BP_LANES], *const to = Gd + bp_first_slope[bearing] * BP_LANES;                                     \
        BP_NUMBERS(b, BP_LANES, d->p, d->c, wd, kd)                                                                              \
        for (int j = 0; j < BP_##b##_BALLS; j++) {                                                                               \
            const int i = bp_first_ball[bearing] + j;                                                                               \
            double cod[BP_LANES], sid[BP_LANES], moved[BP_##b##_SLOPES * BP_LANES];                                              \
            _Pragma("omp simd")                                                                                                  \
            for (int l = 0; l < BP_LANES; l++) {                                                                                 \
                cod[l] = bp_##b##_cos[j] * cd[l] - bp_##b##_sin[j] * sd[l];                                                      \
                sid[l] = bp_##b##_sin[j] * cd[l] + bp_##b##_cos[j] * sd[l];                                                      \
            }                                                                                                                    \
            bp_##b##_moved_lanes(at->co + i, at->si + i, at->r + bp_first_relative[bearing], at->k_##b[alike], cod, sid, rd + bp_first_relative[bearing] * BP_LANES, kd,      \
                                 moved);                                                                                         \
            _Pragma("omp simd")                                                                                                  \
            for (int m = 0; m < BP_##b##_SLOPES * BP_LANES; m++) to[m] += moved[m];                                              \
        }                                                                                                                        \
    }
    BP_EACH_BEARING(BP_MOVED)
#undef BP_MOVED
    bp_acceleration_jacobian_tangent_lanes(at->x, at->S, at->G, at->r, n->u, n->p, n->c, at->w, xd, Sd, Gd, rd, d->u, d->p, d->c, wd, A, B);
    bp_acceleration_rate_tangent_lanes(at->x, at->S, at->G, at->r, n->u, n->p, n->c, at->w, wt, xd, Sd, Gd, rd, d->u, d->p, d->c, wd, wtd,
                                       rate_d);
}

#endif
