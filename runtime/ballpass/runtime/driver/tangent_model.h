/* The model differentiated along BP_LANES directions at a time: what directions share at a state, and derivatives of the rates. */
#ifndef BALLPASS_TANGENT_MODEL_H
#define BALLPASS_TANGENT_MODEL_H

#include "model.h"
#include "tangents.h"

/* The same as one value (a vector of gcc and clang), for sums that should stay in registers. */
typedef double bp_vector __attribute__((vector_size(BP_LANES * sizeof(double)), aligned(8), may_alias));

/* What the directions share at one state and time.  Force and slopes of the balls enter the derivative of their sums
   S = (sum F cos, sum F sin) by sums of their own: all that moves a ball is r, the cage's angle, and the numbers of the law. */
typedef struct {
    const double *x, *w;
    double r[5], S[2], G[6], by_r0[2], by_angle[2], by_number[2][BP_NK];
    double co[BP_NB], si[BP_NB], delta[BP_NB], rate[BP_NB], force[BP_NB], by_delta[BP_NB], by_rate[BP_NB];
} bp_point;

/* Directions of one block: parameters, constants, inputs of the segment. */
typedef struct {
    const double *p, *c, *u;
} bp_direction;

static inline void bp_point_at(bp_point *restrict at, const bp_numbers *n, const double *restrict w, const double *restrict x)
{
    at->x = x;
    at->w = w;
    bp_relative(x, n->u, n->p, n->c, w, at->r);
    const double *restrict r = at->r, cage_cos = w[0], cage_sin = w[1];
    double k[BP_NK], by_number[BP_NK * BP_NB];
    double sx[BP_TERMS], sy[BP_TERMS], d[5][BP_TERMS], v[3][BP_TERMS], nx[BP_NK][BP_TERMS], ny[BP_NK][BP_TERMS];
    bp_law_numbers(n->p, n->c, k);
#pragma omp simd
    for (int j = 0; j < BP_NB; j++) {
        const double co = bp_cos[j] * cage_cos - bp_sin[j] * cage_sin;
        const double si = bp_sin[j] * cage_cos + bp_cos[j] * cage_sin;
        at->co[j] = co;
        at->si[j] = si;
        at->delta[j] = r[0] + r[1] * co + r[2] * si;
        at->rate[j] = r[3] * co + r[4] * si;
    }
    bp_ball_partials_lanes(at->delta, at->rate, k, at->force, at->by_delta, at->by_rate, by_number);
#pragma omp simd
    for (int j = 0; j < BP_NB; j++) {
        const double co = at->co[j], si = at->si[j], by_delta = at->by_delta[j], by_rate = at->by_rate[j];
        sx[j] = at->force[j] * co;
        sy[j] = at->force[j] * si;
        d[3][j] = by_delta * co;
        d[4][j] = by_delta * si;
        d[0][j] = by_delta * co * co;
        d[1][j] = by_delta * co * si;
        d[2][j] = by_delta * si * si;
        v[0][j] = by_rate * co * co;
        v[1][j] = by_rate * co * si;
        v[2][j] = by_rate * si * si;
    }
    for (int m = 0; m < BP_NK; m++) {
#pragma omp simd
        for (int j = 0; j < BP_NB; j++) {
            nx[m][j] = by_number[m * BP_NB + j] * at->co[j];
            ny[m][j] = by_number[m * BP_NB + j] * at->si[j];
        }
    }
    at->S[0] = bp_total(sx);
    at->S[1] = bp_total(sy);
    for (int m = 0; m < 3; m++) {
        at->G[m] = bp_total(d[m]);
        at->G[3 + m] = bp_total(v[m]);
    }
    at->by_r0[0] = bp_total(d[3]);
    at->by_r0[1] = bp_total(d[4]);
    for (int m = 0; m < BP_NK; m++) {
        at->by_number[0][m] = bp_total(nx[m]);
        at->by_number[1][m] = bp_total(ny[m]);
    }
    const double *restrict G = at->G;
    at->by_angle[0] = -r[1] * G[1] + r[2] * G[0] - r[3] * G[4] + r[4] * G[3] - at->S[1];
    at->by_angle[1] = -r[1] * G[2] + r[2] * G[1] - r[3] * G[5] + r[4] * G[4] + at->S[0];
}

/* Derivatives of deflection and rate of ball j, and of its direction. */
static inline void bp_ball_tangent(const bp_point *restrict at, int j, const double *restrict wd, const double *restrict rd,
                                   double *restrict co, double *restrict si, double *restrict delta, double *restrict rate)
{
#pragma omp simd
    for (int l = 0; l < BP_LANES; l++) {
        co[l] = bp_cos[j] * wd[l] - bp_sin[j] * wd[BP_LANES + l];
        si[l] = bp_sin[j] * wd[l] + bp_cos[j] * wd[BP_LANES + l];
        delta[l] = rd[l] + rd[BP_LANES + l] * at->co[j] + rd[2 * BP_LANES + l] * at->si[j] + at->r[1] * co[l] + at->r[2] * si[l];
        rate[l] = rd[3 * BP_LANES + l] * at->co[j] + rd[4 * BP_LANES + l] * at->si[j] + at->r[3] * co[l] + at->r[4] * si[l];
    }
}

/* Derivatives of the sums S along the block's directions, for moved coefficients rd and stage variables wd. */
static inline void bp_sums_tangent(const bp_point *restrict at, const bp_direction *d, const double *restrict wd, const double *restrict rd,
                                   double *restrict Sd)
{
    const bp_vector *r = (const bp_vector *)rd, *w = (const bp_vector *)wd;
    double numbers[BP_NK * BP_LANES];
    bp_law_numbers_lanes(d->p, d->c, numbers);
    const bp_vector *k = (const bp_vector *)numbers, angle = at->w[0] * w[1] - at->w[1] * w[0];
    bp_vector x = at->by_angle[0] * angle, y = at->by_angle[1] * angle;
    x += at->by_r0[0] * r[0] + at->G[0] * r[1] + at->G[1] * r[2] + at->G[3] * r[3] + at->G[4] * r[4];
    y += at->by_r0[1] * r[0] + at->G[1] * r[1] + at->G[2] * r[2] + at->G[4] * r[3] + at->G[5] * r[4];
#pragma GCC unroll 16
    for (int m = 0; m < BP_NK; m++) {
        x += at->by_number[0][m] * k[m];
        y += at->by_number[1][m] * k[m];
    }
    *(bp_vector *)Sd = x;
    *(bp_vector *)(Sd + BP_LANES) = y;
}

/* Derivative of dx/dt along the block's directions, for the moved state xd and stage variables wd. */
static inline void bp_rate_tangent(const bp_point *restrict at, const bp_numbers *n, const bp_direction *d, const double *restrict wd,
                                   const double *restrict xd, double *restrict out)
{
    double rd[5 * BP_LANES], Sd[2 * BP_LANES];
    bp_relative_tangent_lanes(at->x, n->u, n->p, n->c, at->w, xd, d->u, d->p, d->c, wd, rd);
    bp_sums_tangent(at, d, wd, rd, Sd);
    for (int k = 0; k < BP_NQ * BP_LANES; k++) out[k] = xd[BP_NQ * BP_LANES + k];
    bp_acceleration_tangent_lanes(at->x, at->S, n->u, n->p, n->c, at->w, xd, Sd, d->u, d->p, d->c, wd, out + BP_NQ * BP_LANES);
}

/* Derivatives of the Jacobian's blocks and of the partial time derivative. */
static inline void bp_linearize_tangent(const bp_point *restrict at, const bp_numbers *n, const bp_direction *d,
                                        const double *restrict wt, const double *restrict wd, const double *restrict wtd,
                                        const double *restrict xd, double *restrict A, double *restrict B, double *restrict rate_d)
{
    double rd[5 * BP_LANES], Sd[2 * BP_LANES], Gd[6 * BP_LANES];
    bp_relative_tangent_lanes(at->x, n->u, n->p, n->c, at->w, xd, d->u, d->p, d->c, wd, rd);
    bp_sums_tangent(at, d, wd, rd, Sd);
    bp_vector sum[6];
#pragma GCC unroll 6
    for (int k = 0; k < 6; k++) sum[k] = (bp_vector){0.0};
    for (int j = 0; j < BP_NB; j++) {
        double co[BP_LANES], si[BP_LANES], delta[BP_LANES], rate[BP_LANES], by_delta[BP_LANES], by_rate[BP_LANES];
        bp_ball_tangent(at, j, wd, rd, co, si, delta, rate);
        bp_law_slopes_tangent_lanes(at->delta[j], at->rate[j], n->p, n->c, delta, rate, d->p, d->c, by_delta, by_rate);
        const double c = at->co[j], s = at->si[j], fd = at->by_delta[j], fv = at->by_rate[j];
        const bp_vector c_d = *(const bp_vector *)co, s_d = *(const bp_vector *)si;
        const bp_vector cc = 2.0 * c * c_d, cs = s * c_d + c * s_d, ss = 2.0 * s * s_d;
        const bp_vector fd_d = *(const bp_vector *)by_delta, fv_d = *(const bp_vector *)by_rate;
        sum[0] += c * c * fd_d + fd * cc;
        sum[1] += c * s * fd_d + fd * cs;
        sum[2] += s * s * fd_d + fd * ss;
        sum[3] += c * c * fv_d + fv * cc;
        sum[4] += c * s * fv_d + fv * cs;
        sum[5] += s * s * fv_d + fv * ss;
    }
#pragma GCC unroll 6
    for (int k = 0; k < 6; k++) *(bp_vector *)(Gd + k * BP_LANES) = sum[k];
    bp_acceleration_jacobian_tangent_lanes(at->x, at->S, at->G, n->u, n->p, n->c, at->w, xd, Sd, Gd, d->u, d->p, d->c, wd, A, B);
    bp_acceleration_rate_tangent_lanes(at->x, at->S, at->G, at->r, n->u, n->p, n->c, at->w, wt, xd, Sd, Gd, rd, d->u, d->p, d->c, wd, wtd,
                                       rate_d);
}

#endif
