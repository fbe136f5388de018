/* The model as the methods see it: accelerations, their Jacobian and time derivative, from the generated kernels.

   kernels.h is generated with the scene.  It brings the sizes BP_NQ (coordinates), BP_NX = 2 BP_NQ, BP_NU, BP_NP, BP_NC, BP_NW (stage
   variables), BP_NB (balls), the directions bp_cos, bp_sin of the balls in the cage, and the inline functions called here. */
#ifndef BALLPASS_MODEL_H
#define BALLPASS_MODEL_H

#include <math.h>

#include "kernels.h"
#ifdef BALLPASS_LOCATED
#include "switches.h"
#endif

/* Numbers of a run and of its present segment. */
typedef struct {
    const double *u;
    const double *p;
    const double *c;
#ifdef BALLPASS_LOCATED
    const double (*border)[BP_NSWITCHES]; /* sides of each ball, see kinks.h */
#endif
} bp_numbers;

/* The law of a ball, and with its slopes; where kinks are located its sides are held. */
#ifdef BALLPASS_LOCATED
#define BP_BALL_FORCE(n, j, delta, rate, k, force) bp_ball_held_force(delta, rate, k, (n)->border[j], force)
#define BP_BALL_SLOPES(n, j, delta, rate, k, force, by_delta, by_rate) \
    bp_ball_held_slopes(delta, rate, k, (n)->border[j], force, by_delta, by_rate)
#else
#define BP_BALL_FORCE(n, j, delta, rate, k, force) bp_ball_force(delta, rate, k, force)
#define BP_BALL_SLOPES(n, j, delta, rate, k, force, by_delta, by_rate) bp_ball_slopes(delta, rate, k, force, by_delta, by_rate)
#endif

/* Cosines and sines of the stage's angles at the times t + nodes[i] h, i = 0 ... BP_LANES - 1, nodes within [0, 1].  An angle that turns by
   little is turned on from its value at t. */
static inline __attribute__((always_inline)) void bp_directions(const bp_numbers *n, double t, double h, const double *restrict nodes,
                                                                double *restrict C, double *restrict S)
{
    double angle[BP_NA], rate[BP_NA], c0[BP_NA], s0[BP_NA], largest = 0.0;
    bp_angles(t, n->u, n->p, n->c, angle, rate);
    for (int k = 0; k < BP_NA; k++) largest = fabs(rate[k]) > largest ? fabs(rate[k]) : largest;
    if (largest * h <= BP_SMALL_ANGLE) {
#pragma omp simd
        for (int k = 0; k < BP_NA; k++) bp_sincos(angle[k], &s0[k], &c0[k]);
        for (int k = 0; k < BP_NA; k++) {
            const double turn = rate[k] * h, c = c0[k], s = s0[k];
#pragma omp simd
            for (int i = 0; i < BP_LANES; i++) bp_turn(c, s, turn * nodes[i], &C[k * BP_LANES + i], &S[k * BP_LANES + i]);
        }
    } else {
        for (int k = 0; k < BP_NA; k++) {
            const double turn = rate[k] * h, from = angle[k];
#pragma omp simd
            for (int i = 0; i < BP_LANES; i++) bp_sincos(from + turn * nodes[i], &S[k * BP_LANES + i], &C[k * BP_LANES + i]);
        }
    }
}

/* Up to BP_LANES nodes from the `first` of `count`, the last repeated. */
static inline __attribute__((always_inline)) void bp_some_nodes(const double *restrict nodes, const int first, const int count,
                                                                double *restrict some)
{
    for (int i = 0; i < BP_LANES; i++) some[i] = nodes[first + i < count ? first + i : count - 1];
}

/* Stage variables at the times t + nodes[i] h, i = 0 ... count - 1, into the rows of w. */
static inline __attribute__((always_inline)) void bp_stages(const bp_numbers *n, double t, double h, const double *restrict nodes,
                                                             const int count, double w[][BP_NW])
{
    for (int first = 0; first < count; first += BP_LANES) {
        double some[BP_LANES], time[BP_LANES], C[BP_NA * BP_LANES], S[BP_NA * BP_LANES], lanes[BP_NW * BP_LANES];
        bp_some_nodes(nodes, first, count, some);
        bp_directions(n, t, h, some, C, S);
        for (int i = 0; i < BP_LANES; i++) time[i] = t + some[i] * h;
        bp_stage_turned_lanes(C, S, time, n->u, n->p, n->c, lanes);
        for (int i = 0; i < BP_LANES && first + i < count; i++)
            for (int k = 0; k < BP_NW; k++) w[first + i][k] = lanes[k * BP_LANES + i];
    }
}

/* The same, and the stage variables and their time derivatives at t + h; count < BP_LANES. */
static inline __attribute__((always_inline)) void bp_stages_and_end(const bp_numbers *n, double t, double h, const double *restrict nodes,
                                                                     const int count, double w[][BP_NW], double *restrict end,
                                                                     double *restrict end_rate)
{
    double some[BP_LANES], time[BP_LANES], C[BP_NA * BP_LANES], S[BP_NA * BP_LANES], angle[BP_NA], rate[BP_NA];
    double lanes[BP_NW * BP_LANES], rates[BP_NW * BP_LANES];
    for (int i = 0; i < BP_LANES; i++) some[i] = i < count ? nodes[i] : 1.0;
    bp_directions(n, t, h, some, C, S);
    bp_angles(t, n->u, n->p, n->c, angle, rate);
    for (int i = 0; i < BP_LANES; i++) time[i] = t + some[i] * h;
    bp_stage_rate_turned_lanes(C, S, rate, time, n->u, n->p, n->c, lanes, rates);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < BP_NW; k++) w[i][k] = lanes[k * BP_LANES + i];
    for (int k = 0; k < BP_NW; k++) {
        end[k] = lanes[k * BP_LANES + count];
        end_rate[k] = rates[k * BP_LANES + count];
    }
}

/* Terms of a sum over the balls, filled up with zeros.  They are added in an order that is written here, not by the compiler's choice of
   lanes: every library made of this file, and every processor, gives the same bits. */
enum { BP_SUMMANDS = 8, BP_TERMS = (BP_NB + BP_SUMMANDS - 1) / BP_SUMMANDS * BP_SUMMANDS };
typedef double bp_summands __attribute__((vector_size(BP_SUMMANDS * sizeof(double)), aligned(8), may_alias));

static inline double bp_total(double *restrict terms)
{
    for (int j = BP_NB; j < BP_TERMS; j++) terms[j] = 0.0;
    bp_summands sum = *(const bp_summands *)terms;
    for (int j = BP_SUMMANDS; j < BP_TERMS; j += BP_SUMMANDS) sum += *(const bp_summands *)(terms + j);
    return ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
}

/* Sums over the balls of F cos, F sin.  One ball a lane. */
static inline __attribute__((always_inline)) void bp_sums(const bp_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    double k[BP_NK], sx[BP_TERMS], sy[BP_TERMS];
    bp_law_numbers(n->p, n->c, k);
    const double cage_cos = w[0], cage_sin = w[1];
#pragma omp simd
    for (int j = 0; j < BP_NB; j++) {
        const double co = bp_cos[j] * cage_cos - bp_sin[j] * cage_sin;
        const double si = bp_sin[j] * cage_cos + bp_cos[j] * cage_sin;
        double force;
        BP_BALL_FORCE(n, j, r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si, k, &force);
        sx[j] = force * co;
        sy[j] = force * si;
    }
    S[0] = bp_total(sx);
    S[1] = bp_total(sy);
}

/* The same, and the sums G of the slopes times cos cos, cos sin, sin sin: by deflection, then by rate. */
static inline void bp_sums_and_slopes(const bp_numbers *n, const double *restrict w, const double *restrict r,
                                      double *restrict S, double *restrict G)
{
    double k[BP_NK], sx[BP_TERMS], sy[BP_TERMS], d0[BP_TERMS], d1[BP_TERMS], d2[BP_TERMS], v0[BP_TERMS], v1[BP_TERMS], v2[BP_TERMS];
    bp_law_numbers(n->p, n->c, k);
    const double cage_cos = w[0], cage_sin = w[1];
#pragma omp simd
    for (int j = 0; j < BP_NB; j++) {
        const double co = bp_cos[j] * cage_cos - bp_sin[j] * cage_sin;
        const double si = bp_sin[j] * cage_cos + bp_cos[j] * cage_sin;
        double force, by_delta, by_rate;
        BP_BALL_SLOPES(n, j, r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si, k, &force, &by_delta, &by_rate);
        sx[j] = force * co;
        sy[j] = force * si;
        d0[j] = by_delta * co * co;
        d1[j] = by_delta * co * si;
        d2[j] = by_delta * si * si;
        v0[j] = by_rate * co * co;
        v1[j] = by_rate * co * si;
        v2[j] = by_rate * si * si;
    }
    S[0] = bp_total(sx);
    S[1] = bp_total(sy);
    G[0] = bp_total(d0);
    G[1] = bp_total(d1);
    G[2] = bp_total(d2);
    G[3] = bp_total(v0);
    G[4] = bp_total(v1);
    G[5] = bp_total(v2);
}

/* dx/dt at a state, for stage variables w that hold for its time. */
static inline __attribute__((always_inline)) void bp_rate(const bp_numbers *n, const double *restrict w, const double *restrict x, double *restrict dx)
{
    double r[5], S[2];
    bp_relative(x, n->u, n->p, n->c, w, r);
    bp_sums(n, w, r, S);
    for (int k = 0; k < BP_NQ; k++) dx[k] = x[BP_NQ + k];
    bp_acceleration(x, S, n->u, n->p, n->c, w, dx + BP_NQ);
}

/* dx/dt, the blocks A = da/dq and B = da/dv of its Jacobian, and the partial time derivative of a. */
static inline void bp_linearize(const bp_numbers *n, const double *restrict w, const double *restrict wt, const double *restrict x,
                                double *restrict dx, double *restrict A, double *restrict B, double *restrict at)
{
    double r[5], S[2], G[6];
    bp_relative(x, n->u, n->p, n->c, w, r);
    bp_sums_and_slopes(n, w, r, S, G);
    for (int k = 0; k < BP_NQ; k++) dx[k] = x[BP_NQ + k];
    bp_acceleration(x, S, n->u, n->p, n->c, w, dx + BP_NQ);
    bp_acceleration_jacobian(x, S, G, n->u, n->p, n->c, w, A, B);
    bp_acceleration_rate(x, S, G, r, n->u, n->p, n->c, w, wt, at);
}

#endif
