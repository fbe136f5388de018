/* The model as the methods see it: accelerations, their Jacobian and time derivative, from the generated kernels.

   kernels.h is generated with the scene.  It brings the sizes RW_NQ (coordinates), RW_NX = 2 RW_NQ, RW_NU, RW_NP, RW_NC, RW_NW (stage
   variables), RW_NB (balls), the directions rw_cos, rw_sin of the balls in the cage, and the inline functions called here. */
#ifndef RACEWAY_MODEL_H
#define RACEWAY_MODEL_H

#include <math.h>

#include "kernels.h"

/* Numbers of a run and of its present segment. */
typedef struct {
    const double *u;
    const double *p;
    const double *c;
} rw_numbers;

/* Stage variables at the times t + nodes[i] h, i = 0 ... count - 1, into the rows of w. */
static inline __attribute__((always_inline)) void rw_stages(const rw_numbers *n, double t, double h, const double *restrict nodes,
                                                             const int count, double w[][RW_NW])
{
    for (int first = 0; first < count; first += RW_LANES) {
        double time[RW_LANES], lanes[RW_NW * RW_LANES];
        const int filled = count - first < RW_LANES ? count - first : RW_LANES;
        for (int i = 0; i < RW_LANES; i++) time[i] = t + nodes[first + (i < filled ? i : filled - 1)] * h;
        rw_stage_lanes(time, n->u, n->p, n->c, lanes);
        for (int i = 0; i < filled; i++)
            for (int k = 0; k < RW_NW; k++) w[first + i][k] = lanes[k * RW_LANES + i];
    }
}

/* Sums over the balls of F cos, F sin.  One ball a lane. */
static inline void rw_sums(const rw_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    const double *restrict p = n->p, *restrict c = n->c;
    const double cage_cos = w[0], cage_sin = w[1];
    double sx = 0.0, sy = 0.0;
#pragma omp simd reduction(+ : sx, sy)
    for (int j = 0; j < RW_NB; j++) {
        const double co = rw_cos[j] * cage_cos - rw_sin[j] * cage_sin;
        const double si = rw_sin[j] * cage_cos + rw_cos[j] * cage_sin;
        double force;
        rw_law(r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si, p, c, &force);
        sx += force * co;
        sy += force * si;
    }
    S[0] = sx;
    S[1] = sy;
}

/* The same, and the sums G of the slopes times cos cos, cos sin, sin sin: by deflection, then by rate. */
static inline void rw_sums_and_slopes(const rw_numbers *n, const double *restrict w, const double *restrict r,
                                      double *restrict S, double *restrict G)
{
    const double *restrict p = n->p, *restrict c = n->c;
    const double cage_cos = w[0], cage_sin = w[1];
    double sx = 0.0, sy = 0.0, d0 = 0.0, d1 = 0.0, d2 = 0.0, v0 = 0.0, v1 = 0.0, v2 = 0.0;
#pragma omp simd reduction(+ : sx, sy, d0, d1, d2, v0, v1, v2)
    for (int j = 0; j < RW_NB; j++) {
        const double co = rw_cos[j] * cage_cos - rw_sin[j] * cage_sin;
        const double si = rw_sin[j] * cage_cos + rw_cos[j] * cage_sin;
        double force, by_delta, by_rate;
        rw_law_slopes(r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si, p, c, &force, &by_delta, &by_rate);
        sx += force * co;
        sy += force * si;
        d0 += by_delta * co * co;
        d1 += by_delta * co * si;
        d2 += by_delta * si * si;
        v0 += by_rate * co * co;
        v1 += by_rate * co * si;
        v2 += by_rate * si * si;
    }
    S[0] = sx;
    S[1] = sy;
    G[0] = d0;
    G[1] = d1;
    G[2] = d2;
    G[3] = v0;
    G[4] = v1;
    G[5] = v2;
}

/* dx/dt at a state, for stage variables w that hold for its time. */
static inline void rw_rate(const rw_numbers *n, const double *restrict w, const double *restrict x, double *restrict dx)
{
    double r[5], S[2];
    rw_relative(x, n->u, n->p, n->c, w, r);
    rw_sums(n, w, r, S);
    for (int k = 0; k < RW_NQ; k++) dx[k] = x[RW_NQ + k];
    rw_acceleration(x, S, n->u, n->p, n->c, w, dx + RW_NQ);
}

/* dx/dt, the blocks A = da/dq and B = da/dv of its Jacobian, and the partial time derivative of a. */
static inline void rw_linearize(const rw_numbers *n, const double *restrict w, const double *restrict wt, const double *restrict x,
                                double *restrict dx, double *restrict A, double *restrict B, double *restrict at)
{
    double r[5], S[2], G[6];
    rw_relative(x, n->u, n->p, n->c, w, r);
    rw_sums_and_slopes(n, w, r, S, G);
    for (int k = 0; k < RW_NQ; k++) dx[k] = x[RW_NQ + k];
    rw_acceleration(x, S, n->u, n->p, n->c, w, dx + RW_NQ);
    rw_acceleration_jacobian(x, S, G, n->u, n->p, n->c, w, A, B);
    rw_acceleration_rate(x, S, G, r, n->u, n->p, n->c, w, wt, at);
}

/* Root mean square of an error over its tolerance; not a number where the error is none. */
static inline double rw_norm(const double *restrict error, const double *restrict weight)
{
    double sum = 0.0;
    for (int k = 0; k < RW_NX; k++) {
        const double e = error[k] * weight[k];
        sum += e * e;
    }
    return sqrt(sum / (double)RW_NX);
}

#endif
