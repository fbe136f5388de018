/* The model as the methods see it: accelerations, their Jacobian and time derivative, from the generated kernels.

   kernels.h is generated with the scene.  It brings the sizes BP_NQ (coordinates), BP_NX = 2 BP_NQ, BP_NU, BP_NP, BP_NC, BP_NW (stage
   variables), for each bearing b the balls BP_<b>_BALLS and their directions in the cage, and the inline functions called here. */
#ifndef BALLPASS_MODEL_H
#define BALLPASS_MODEL_H

#include <math.h>

/* Vectors are passed between functions of one file alone: that another processor would pass them in other registers means nothing. */
#pragma GCC diagnostic ignored "-Wpsabi"

#include "kernels.h"
#ifdef BALLPASS_LOCATED
#include "switches.h"
/* Whether inputs hold the sides of loads that switch where the motion decides. */
#if defined BP_HAS_WINDOWS || defined BP_HAS_STOPS
#define BP_HAS_BORDERS
#endif
#endif

/* Numbers of a run and of its present segment. */
typedef struct {
    const double *u;
    const double *p;
    const double *c;
#ifdef BALLPASS_LOCATED
    const double *border; /* sides of each event, see kinks.h */
#endif
} bp_numbers;

/* Cosines and sines of the stage's angles at the times t + nodes[i] h, i = 0 ... BP_AT_ONCE - 1, nodes within [0, 1].  An angle that turns by
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
            for (int i = 0; i < BP_AT_ONCE; i++) bp_turn(c, s, turn * nodes[i], &C[k * BP_AT_ONCE + i], &S[k * BP_AT_ONCE + i]);
        }
    } else {
        for (int k = 0; k < BP_NA; k++) {
            const double turn = rate[k] * h, from = angle[k];
#pragma omp simd
            for (int i = 0; i < BP_AT_ONCE; i++) bp_sincos(from + turn * nodes[i], &S[k * BP_AT_ONCE + i], &C[k * BP_AT_ONCE + i]);
        }
    }
}

/* Up to BP_AT_ONCE nodes from the `first` of `count`, the last repeated. */
static inline __attribute__((always_inline)) void bp_some_nodes(const double *restrict nodes, const int first, const int count,
                                                                double *restrict some)
{
    for (int i = 0; i < BP_AT_ONCE; i++) some[i] = nodes[first + i < count ? first + i : count - 1];
}

/* Stage variables at the times t + nodes[i] h, i = 0 ... count - 1, into the rows of w. */
static inline __attribute__((always_inline)) void bp_stages(const bp_numbers *n, double t, double h, const double *restrict nodes,
                                                             const int count, double w[][BP_NW])
{
    for (int first = 0; first < count; first += BP_AT_ONCE) {
        double some[BP_AT_ONCE], time[BP_AT_ONCE], C[BP_NA * BP_AT_ONCE], S[BP_NA * BP_AT_ONCE], lanes[BP_NW * BP_AT_ONCE];
        bp_some_nodes(nodes, first, count, some);
        bp_directions(n, t, h, some, C, S);
        for (int i = 0; i < BP_AT_ONCE; i++) time[i] = t + some[i] * h;
        bp_stage_turned_lanes(C, S, time, n->u, n->p, n->c, lanes);
        for (int i = 0; i < BP_AT_ONCE && first + i < count; i++)
            for (int k = 0; k < BP_NW; k++) w[first + i][k] = lanes[k * BP_AT_ONCE + i];
    }
}

/* The same, and the stage variables and their time derivatives at t + h; count < BP_AT_ONCE. */
static inline __attribute__((always_inline)) void bp_stages_and_end(const bp_numbers *n, double t, double h, const double *restrict nodes,
                                                                     const int count, double w[][BP_NW], double *restrict end,
                                                                     double *restrict end_rate)
{
    double some[BP_AT_ONCE], time[BP_AT_ONCE], C[BP_NA * BP_AT_ONCE], S[BP_NA * BP_AT_ONCE], angle[BP_NA], rate[BP_NA];
    double lanes[BP_NW * BP_AT_ONCE], rates[BP_NW * BP_AT_ONCE];
    for (int i = 0; i < BP_AT_ONCE; i++) some[i] = i < count ? nodes[i] : 1.0;
    bp_directions(n, t, h, some, C, S);
    bp_angles(t, n->u, n->p, n->c, angle, rate);
    for (int i = 0; i < BP_AT_ONCE; i++) time[i] = t + some[i] * h;
    bp_stage_rate_turned_lanes(C, S, rate, time, n->u, n->p, n->c, lanes, rates);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < BP_NW; k++) w[i][k] = lanes[k * BP_AT_ONCE + i];
    for (int k = 0; k < BP_NW; k++) {
        end[k] = lanes[k * BP_AT_ONCE + count];
        end_rate[k] = rates[k * BP_AT_ONCE + count];
    }
}

/* Terms of a sum over the balls are added in an order that is written here, not by the compiler's choice of lanes: every library made of
   this file, and every processor, gives the same bits, and so do lanes of members (lane_model.h).  Opposite balls first, where there are
   such; then every fourth term; then these four sums. */
enum { BP_SUMMANDS = 4 };
typedef double bp_summands __attribute__((vector_size(BP_SUMMANDS * sizeof(double)), aligned(8), may_alias));

static inline __attribute__((always_inline)) double bp_total(const double *restrict terms, const int balls)
{
    const int directions = balls % 2 == 0 ? balls / 2 : balls;
    bp_summands sum = {0.0};
    for (int j = 0; j < directions; j += BP_SUMMANDS) {
        bp_summands more = {0.0};
        if (j + BP_SUMMANDS <= directions) {
            more = *(const bp_summands *)(terms + j);
            if (balls % 2 == 0) more += *(const bp_summands *)(terms + directions + j);
        } else {
            for (int i = j; i < directions; i++) more[i - j] = balls % 2 == 0 ? terms[i] + terms[directions + i] : terms[i];
        }
        if (j > 0) sum += more;
        else sum = more;
    }
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

/* For each bearing what DO says of its structure b; `bearing` is its number among all, `alike` that among those of its structure. */
#define BP_ALIKE(b, DO)                                     \
    for (int alike = 0; alike < BP_##b##_ALIKE; alike++) { \
        const int bearing = bp_##b##_bearings[alike];       \
        DO(b)                                               \
    }

/* Place of the cosine of a cage's angle in the relative motion r; its sine follows. */
#define BP_CAGE (bp_first_relative[bearing] + BP_RINGS)

/* Directions of a bearing's balls: those in its cage turned by the cage's angle, whose cosine and sine are given.  One ball a lane. */
static inline __attribute__((always_inline)) void bp_ball_directions(const double *restrict cage, const double *restrict cage_cos,
                                                                     const double *restrict cage_sin, const int balls, double *restrict co,
                                                                     double *restrict si)
{
    const double c = cage[0], s = cage[1];
#pragma omp simd
    for (int j = 0; j < balls; j++) {
        co[j] = cage_cos[j] * c - cage_sin[j] * s;
        si[j] = cage_sin[j] * c + cage_cos[j] * s;
    }
}

/* Numbers k of the balls of a bearing, of a state in each of the lanes: entries of p, of c and of w, whose places are `taken`. */
static inline __attribute__((always_inline)) void bp_numbers_of(const int *restrict taken, const int count, const int of_p, const int of_c,
                                                                const int lanes, const double *restrict p, const double *restrict c,
                                                                const double *restrict w, double *restrict k)
{
#pragma GCC unroll 32
    for (int i = 0; i < count; i++) {
        const double *restrict from = (i < of_p ? p : i < of_p + of_c ? c : w) + taken[i] * lanes;
#pragma omp simd
        for (int lane = 0; lane < lanes; lane++) k[i * lanes + lane] = from[lane];
    }
}

#define BP_NUMBERS(b, lanes, p, c, w, k) bp_numbers_of(bp_##b##_taken[alike], BP_##b##_NK, BP_##b##_OF_P, BP_##b##_OF_C, lanes, p, c, w, k);

/* Directions co, si and numbers k of the balls of bearing b, from the relative motion r and the stage variables w; room for `count` rows of summands. */
#define BP_BALLS(b, count)                                                                                                    \
    double co[BP_##b##_BALLS], si[BP_##b##_BALLS], k[BP_##b##_NK], rows[(count) * BP_##b##_BALLS];                            \
    bp_ball_directions(r + BP_CAGE, bp_##b##_cos, bp_##b##_sin, BP_##b##_BALLS, co, si);                                      \
    BP_NUMBERS(b, 1, n->p, n->c, w, k)

/* Rows from the `first` on, added up. */
#define BP_TOTALS(b, first, count, to) \
    for (int m = 0; m < (count); m++) (to)[m] = bp_total(rows + ((first) + m) * BP_##b##_BALLS, BP_##b##_BALLS);

/* The law of the balls, and with its slopes; where kinks are located its sides are held. */
#ifdef BALLPASS_LOCATED
#define BP_FORCES(b) bp_##b##_held_forces_lanes(co, si, r + bp_first_relative[bearing], k, n->border + bp_first_event[bearing], rows);
#define BP_SLOPES(b) bp_##b##_held_slopes_lanes(co, si, r + bp_first_relative[bearing], k, n->border + bp_first_event[bearing], rows);
#else
#define BP_FORCES(b) bp_##b##_forces_lanes(co, si, r + bp_first_relative[bearing], k, rows);
#define BP_SLOPES(b) bp_##b##_slopes_lanes(co, si, r + bp_first_relative[bearing], k, rows);
#endif

/* Sums S over the balls of each bearing: F cos, F sin, and a torque where effects turn bodies. */
static inline __attribute__((always_inline)) void bp_sums(const bp_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
#define BP_SUM(b) { BP_BALLS(b, BP_##b##_SUMS) BP_FORCES(b) BP_TOTALS(b, 0, BP_##b##_SUMS, S + bp_first_sum[bearing]) }
    BP_EACH_BEARING(BP_SUM)
#undef BP_SUM
}

/* The same, and the sums G of the slopes. */
static inline void bp_sums_and_slopes(const bp_numbers *n, const double *restrict w, const double *restrict r,
                                      double *restrict S, double *restrict G)
{
#define BP_SUM(b)                              \
    {                                          \
        BP_BALLS(b, BP_##b##_SUMS + BP_##b##_SLOPES) \
        BP_SLOPES(b)                           \
        BP_TOTALS(b, 0, BP_##b##_SUMS, S + bp_first_sum[bearing]) \
        BP_TOTALS(b, BP_##b##_SUMS, BP_##b##_SLOPES, G + bp_first_slope[bearing]) \
    }
    BP_EACH_BEARING(BP_SUM)
#undef BP_SUM
}

/* dx/dt at a state, for stage variables w that hold for its time. */
static inline __attribute__((always_inline)) void bp_rate(const bp_numbers *n, const double *restrict w, const double *restrict x, double *restrict dx)
{
    double r[BP_NR], S[BP_NS];
    bp_relative(x, n->u, n->p, n->c, w, r);
    bp_sums(n, w, r, S);
    for (int k = 0; k < BP_NQ; k++) dx[k] = x[BP_NQ + k];
    bp_acceleration(x, S, r, n->u, n->p, n->c, w, dx + BP_NQ);
}

/* dx/dt, the blocks A = da/dq and B = da/dv of its Jacobian, and the partial time derivative of a. */
static inline void bp_linearize(const bp_numbers *n, const double *restrict w, const double *restrict wt, const double *restrict x,
                                double *restrict dx, double *restrict A, double *restrict B, double *restrict at)
{
    double r[BP_NR], S[BP_NS], G[BP_NG];
    bp_relative(x, n->u, n->p, n->c, w, r);
    bp_sums_and_slopes(n, w, r, S, G);
    for (int k = 0; k < BP_NQ; k++) dx[k] = x[BP_NQ + k];
    bp_acceleration(x, S, r, n->u, n->p, n->c, w, dx + BP_NQ);
    bp_acceleration_jacobian(x, S, G, r, n->u, n->p, n->c, w, A, B);
    bp_acceleration_rate(x, S, G, r, n->u, n->p, n->c, w, wt, at);
}

#endif
