/* The model as the methods see it: accelerations, their Jacobian and time derivative, from the generated kernels.

   kernels.h is generated with the scene.  It brings the sizes RW_NQ (coordinates), RW_NX = 2 RW_NQ, RW_NU, RW_NP, RW_NC, RW_NW (stage
   variables), RW_NB (balls), the directions rw_cos, rw_sin of the balls in the cage, and the inline functions called here. */
#ifndef RACEWAY_MODEL_H
#define RACEWAY_MODEL_H

#include <math.h>

#include "kernels.h"
#ifdef RACEWAY_LOCATED
#include "switches.h"
#endif

/* All states, and positions or velocities alone, as vectors of the compiler: short loops it would write out one number after another.
   There are two or four coordinates. */
typedef double rw_state __attribute__((vector_size(RW_NX * sizeof(double)), aligned(8), may_alias));
typedef double rw_half __attribute__((vector_size(RW_NQ * sizeof(double)), aligned(8), may_alias));
#define RW_STATE(x) (*(const rw_state *)(x))
#define RW_HALF(x) (*(const rw_half *)(x))

/* Numbers of a run and of its present segment. */
typedef struct {
    const double *u;
    const double *p;
    const double *c;
#ifdef RACEWAY_LOCATED
    const double (*border)[RW_NSWITCHES]; /* sides of each ball, see kinks.h */
#endif
} rw_numbers;

/* The law of a ball, and with its slopes; where kinks are located its sides are held. */
#ifdef RACEWAY_LOCATED
#define RW_BALL_FORCE(n, j, delta, rate, k, force) rw_ball_held_force(delta, rate, k, (n)->border[j], force)
#define RW_BALL_SLOPES(n, j, delta, rate, k, force, by_delta, by_rate) \
    rw_ball_held_slopes(delta, rate, k, (n)->border[j], force, by_delta, by_rate)
#else
#define RW_BALL_FORCE(n, j, delta, rate, k, force) rw_ball_force(delta, rate, k, force)
#define RW_BALL_SLOPES(n, j, delta, rate, k, force, by_delta, by_rate) rw_ball_slopes(delta, rate, k, force, by_delta, by_rate)
#endif

/* Cosines and sines of the stage's angles at the times t + nodes[i] h, i = 0 ... RW_LANES - 1, nodes within [0, 1].  An angle that turns by
   little is turned on from its value at t. */
static inline __attribute__((always_inline)) void rw_directions(const rw_numbers *n, double t, double h, const double *restrict nodes,
                                                                double *restrict C, double *restrict S)
{
    double angle[RW_NA], rate[RW_NA], c0[RW_NA], s0[RW_NA], largest = 0.0;
    rw_angles(t, n->u, n->p, n->c, angle, rate);
    for (int k = 0; k < RW_NA; k++) largest = fabs(rate[k]) > largest ? fabs(rate[k]) : largest;
    if (largest * h <= RW_SMALL_ANGLE) {
#pragma omp simd
        for (int k = 0; k < RW_NA; k++) rw_sincos(angle[k], &s0[k], &c0[k]);
        for (int k = 0; k < RW_NA; k++) {
            const double turn = rate[k] * h, c = c0[k], s = s0[k];
#pragma omp simd
            for (int i = 0; i < RW_LANES; i++) rw_turn(c, s, turn * nodes[i], &C[k * RW_LANES + i], &S[k * RW_LANES + i]);
        }
    } else {
        for (int k = 0; k < RW_NA; k++) {
            const double turn = rate[k] * h, from = angle[k];
#pragma omp simd
            for (int i = 0; i < RW_LANES; i++) rw_sincos(from + turn * nodes[i], &S[k * RW_LANES + i], &C[k * RW_LANES + i]);
        }
    }
}

/* Up to RW_LANES nodes from the `first` of `count`, the last repeated. */
static inline __attribute__((always_inline)) void rw_some_nodes(const double *restrict nodes, const int first, const int count,
                                                                double *restrict some)
{
    for (int i = 0; i < RW_LANES; i++) some[i] = nodes[first + i < count ? first + i : count - 1];
}

/* Stage variables at the times t + nodes[i] h, i = 0 ... count - 1, into the rows of w. */
static inline __attribute__((always_inline)) void rw_stages(const rw_numbers *n, double t, double h, const double *restrict nodes,
                                                             const int count, double w[][RW_NW])
{
    for (int first = 0; first < count; first += RW_LANES) {
        double some[RW_LANES], time[RW_LANES], C[RW_NA * RW_LANES], S[RW_NA * RW_LANES], lanes[RW_NW * RW_LANES];
        rw_some_nodes(nodes, first, count, some);
        rw_directions(n, t, h, some, C, S);
        for (int i = 0; i < RW_LANES; i++) time[i] = t + some[i] * h;
        rw_stage_turned_lanes(C, S, time, n->u, n->p, n->c, lanes);
        for (int i = 0; i < RW_LANES && first + i < count; i++)
            for (int k = 0; k < RW_NW; k++) w[first + i][k] = lanes[k * RW_LANES + i];
    }
}

/* The same, and the stage variables and their time derivatives at t + h; count < RW_LANES. */
static inline __attribute__((always_inline)) void rw_stages_and_end(const rw_numbers *n, double t, double h, const double *restrict nodes,
                                                                     const int count, double w[][RW_NW], double *restrict end,
                                                                     double *restrict end_rate)
{
    double some[RW_LANES], time[RW_LANES], C[RW_NA * RW_LANES], S[RW_NA * RW_LANES], angle[RW_NA], rate[RW_NA];
    double lanes[RW_NW * RW_LANES], rates[RW_NW * RW_LANES];
    for (int i = 0; i < RW_LANES; i++) some[i] = i < count ? nodes[i] : 1.0;
    rw_directions(n, t, h, some, C, S);
    rw_angles(t, n->u, n->p, n->c, angle, rate);
    for (int i = 0; i < RW_LANES; i++) time[i] = t + some[i] * h;
    rw_stage_rate_turned_lanes(C, S, rate, time, n->u, n->p, n->c, lanes, rates);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < RW_NW; k++) w[i][k] = lanes[k * RW_LANES + i];
    for (int k = 0; k < RW_NW; k++) {
        end[k] = lanes[k * RW_LANES + count];
        end_rate[k] = rates[k * RW_LANES + count];
    }
}

/* Terms of a sum over the balls, filled up with zeros.  They are added in an order that is written here, not by the compiler's choice of
   lanes: every library made of this file, and every processor, gives the same bits. */
enum { RW_SUMMANDS = 8, RW_TERMS = (RW_NB + RW_SUMMANDS - 1) / RW_SUMMANDS * RW_SUMMANDS };
typedef double rw_summands __attribute__((vector_size(RW_SUMMANDS * sizeof(double)), aligned(8), may_alias));

static inline double rw_total(double *restrict terms)
{
    for (int j = RW_NB; j < RW_TERMS; j++) terms[j] = 0.0;
    rw_summands sum = *(const rw_summands *)terms;
    for (int j = RW_SUMMANDS; j < RW_TERMS; j += RW_SUMMANDS) sum += *(const rw_summands *)(terms + j);
    return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

/* Sums over the balls of F cos, F sin.  One ball a lane. */
static inline void rw_sums(const rw_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    double k[RW_NK], sx[RW_TERMS], sy[RW_TERMS];
    rw_law_numbers(n->p, n->c, k);
    const double cage_cos = w[0], cage_sin = w[1];
#pragma omp simd
    for (int j = 0; j < RW_NB; j++) {
        const double co = rw_cos[j] * cage_cos - rw_sin[j] * cage_sin;
        const double si = rw_sin[j] * cage_cos + rw_cos[j] * cage_sin;
        double force;
        RW_BALL_FORCE(n, j, r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si, k, &force);
        sx[j] = force * co;
        sy[j] = force * si;
    }
    S[0] = rw_total(sx);
    S[1] = rw_total(sy);
}

/* The same, and the sums G of the slopes times cos cos, cos sin, sin sin: by deflection, then by rate. */
static inline void rw_sums_and_slopes(const rw_numbers *n, const double *restrict w, const double *restrict r,
                                      double *restrict S, double *restrict G)
{
    double k[RW_NK], sx[RW_TERMS], sy[RW_TERMS], d0[RW_TERMS], d1[RW_TERMS], d2[RW_TERMS], v0[RW_TERMS], v1[RW_TERMS], v2[RW_TERMS];
    rw_law_numbers(n->p, n->c, k);
    const double cage_cos = w[0], cage_sin = w[1];
#pragma omp simd
    for (int j = 0; j < RW_NB; j++) {
        const double co = rw_cos[j] * cage_cos - rw_sin[j] * cage_sin;
        const double si = rw_sin[j] * cage_cos + rw_cos[j] * cage_sin;
        double force, by_delta, by_rate;
        RW_BALL_SLOPES(n, j, r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si, k, &force, &by_delta, &by_rate);
        sx[j] = force * co;
        sy[j] = force * si;
        d0[j] = by_delta * co * co;
        d1[j] = by_delta * co * si;
        d2[j] = by_delta * si * si;
        v0[j] = by_rate * co * co;
        v1[j] = by_rate * co * si;
        v2[j] = by_rate * si * si;
    }
    S[0] = rw_total(sx);
    S[1] = rw_total(sy);
    G[0] = rw_total(d0);
    G[1] = rw_total(d1);
    G[2] = rw_total(d2);
    G[3] = rw_total(v0);
    G[4] = rw_total(v1);
    G[5] = rw_total(v2);
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
    double square[RW_NX];
    for (int k = 0; k < RW_NX; k++) {
        const double e = error[k] * weight[k];
        square[k] = e * e;
    }
    /* in pairs: the step size waits for this sum */
    for (int half = RW_NX / 2; half > 0; half /= 2)
        for (int k = 0; k < half; k++) square[k] += square[k + half];
    return sqrt(square[0] / (double)RW_NX);
}

#endif
