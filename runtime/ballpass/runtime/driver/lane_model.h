/* The model for a member of an ensemble in each SIMD lane; see model.h for one member.

   Every array holds BP_MEMBERS values an entry, next to each other.  Lanes never look at each other: a member's arithmetic is the same
   whichever members are its neighbours. */
#ifndef BALLPASS_LANE_MODEL_H
#define BALLPASS_LANE_MODEL_H

#include "ensemble_kernels.h"
#include "model.h"

enum { BP_L = BP_MEMBERS };

#define BP_EACH_LANE _Pragma("omp simd") for (int lane = 0; lane < BP_L; lane++)
#define BP_ALIGNED __attribute__((aligned(64)))
#define BP_INLINE static inline __attribute__((always_inline))

typedef struct {
    const double *u;
    const double *p;
    const double *c;
} bp_lane_numbers;

/* Where the angles of the stages are when a step begins, and how fast they turn. */
typedef struct {
    double angle[BP_NA * BP_L] BP_ALIGNED, rate[BP_NA * BP_L] BP_ALIGNED;
    double cosine[BP_NA * BP_L] BP_ALIGNED, sine[BP_NA * BP_L] BP_ALIGNED;
    double far[BP_L] BP_ALIGNED; /* whether an angle turns by more within the step than bp_turn takes */
    double any;                  /* whether one does so in any lane */
} bp_lane_angles;

BP_INLINE void bp_lane_angles_start(bp_lane_angles *restrict at, const bp_lane_numbers *n, const double *restrict t, const double *restrict h)
{
    double largest[BP_L] BP_ALIGNED;
    bp_member_angles_lanes(t, n->u, n->p, n->c, at->angle, at->rate);
    BP_EACH_LANE largest[lane] = 0.0;
    for (int k = 0; k < BP_NA; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            const double turning = fabs(at->rate[i]);
            largest[lane] = turning > largest[lane] ? turning : largest[lane];
            bp_sincos(at->angle[i], &at->sine[i], &at->cosine[i]);
        }
    BP_EACH_LANE at->far[lane] = largest[lane] * h[lane] <= BP_SMALL_ANGLE ? 0.0 : 1.0;
    double any = 0.0;
    for (int lane = 0; lane < BP_L; lane++) any += at->far[lane];
    at->any = any;
}

/* Cosines and sines of the angles at the times t + node h, which are returned; as bp_directions for one member. */
BP_INLINE void bp_lane_turn(const bp_lane_angles *restrict at, double node, const double *restrict t, const double *restrict h,
                            double *restrict C, double *restrict S, double *restrict time)
{
    BP_EACH_LANE time[lane] = t[lane] + node * h[lane];
    for (int k = 0; k < BP_NA; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            bp_turn(at->cosine[i], at->sine[i], at->rate[i] * h[lane] * node, &C[i], &S[i]);
        }
    if (at->any == 0.0) return;
    for (int k = 0; k < BP_NA; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            double sine, cosine;
            bp_sincos(at->angle[i] + at->rate[i] * h[lane] * node, &sine, &cosine);
            C[i] = at->far[lane] != 0.0 ? cosine : C[i];
            S[i] = at->far[lane] != 0.0 ? sine : S[i];
        }
}

/* Stage variables at the times t + node h. */
BP_INLINE void bp_lane_stage(const bp_lane_numbers *n, const bp_lane_angles *restrict at, double node, const double *restrict t,
                             const double *restrict h, double *restrict w)
{
    double C[BP_NA * BP_L] BP_ALIGNED, S[BP_NA * BP_L] BP_ALIGNED, time[BP_L] BP_ALIGNED;
    bp_lane_turn(at, node, t, h, C, S, time);
    bp_member_stage_turned_lanes(C, S, time, n->u, n->p, n->c, w);
}

/* Balls come in opposite pairs where their number is even, for they are equal: one direction serves both. */
enum { BP_OPPOSITE = BP_NB % 2 == 0, BP_DIRECTIONS = BP_OPPOSITE ? BP_NB / 2 : BP_NB };

/* Direction of a ball, and what deflection and rate of it and of the one opposite are made of: along, along_rate. */
BP_INLINE void bp_lane_direction(int j, const double *restrict w, const double *restrict r, double *restrict co, double *restrict si,
                                 double *restrict along, double *restrict along_rate)
{
    BP_EACH_LANE {
        co[lane] = bp_cos[j] * w[lane] - bp_sin[j] * w[BP_L + lane];
        si[lane] = bp_sin[j] * w[lane] + bp_cos[j] * w[BP_L + lane];
        along[lane] = r[BP_L + lane] * co[lane] + r[2 * BP_L + lane] * si[lane];
        along_rate[lane] = r[3 * BP_L + lane] * co[lane] + r[4 * BP_L + lane] * si[lane];
    }
}

/* Sums over the balls of F cos, F sin. */
BP_INLINE void bp_lane_sums(const bp_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    BP_EACH_LANE S[lane] = S[BP_L + lane] = 0.0;
    for (int j = 0; j < BP_DIRECTIONS; j++) {
        double co[BP_L] BP_ALIGNED, si[BP_L] BP_ALIGNED, along[BP_L] BP_ALIGNED, along_rate[BP_L] BP_ALIGNED, force[BP_L] BP_ALIGNED;
        double delta[BP_L] BP_ALIGNED, rate[BP_L] BP_ALIGNED, opposite[BP_L] BP_ALIGNED;
        bp_lane_direction(j, w, r, co, si, along, along_rate);
        BP_EACH_LANE delta[lane] = r[lane] + along[lane];
        bp_member_law_lanes(delta, along_rate, n->p, n->c, force);
        if (BP_OPPOSITE) {
            BP_EACH_LANE {
                delta[lane] = r[lane] - along[lane];
                rate[lane] = -along_rate[lane];
            }
            bp_member_law_lanes(delta, rate, n->p, n->c, opposite);
            BP_EACH_LANE force[lane] -= opposite[lane];
        }
        BP_EACH_LANE {
            S[lane] += force[lane] * co[lane];
            S[BP_L + lane] += force[lane] * si[lane];
        }
    }
}

/* The same, and the sums G of the slopes times cos cos, cos sin, sin sin: by deflection, then by rate. */
BP_INLINE void bp_lane_sums_and_slopes(const bp_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S,
                                       double *restrict G)
{
    for (int k = 0; k < 2; k++) BP_EACH_LANE S[k * BP_L + lane] = 0.0;
    for (int k = 0; k < 6; k++) BP_EACH_LANE G[k * BP_L + lane] = 0.0;
    for (int j = 0; j < BP_DIRECTIONS; j++) {
        double co[BP_L] BP_ALIGNED, si[BP_L] BP_ALIGNED, along[BP_L] BP_ALIGNED, along_rate[BP_L] BP_ALIGNED;
        double delta[BP_L] BP_ALIGNED, rate[BP_L] BP_ALIGNED, force[BP_L] BP_ALIGNED, by_delta[BP_L] BP_ALIGNED, by_rate[BP_L] BP_ALIGNED;
        bp_lane_direction(j, w, r, co, si, along, along_rate);
        BP_EACH_LANE delta[lane] = r[lane] + along[lane];
        bp_member_law_slopes_lanes(delta, along_rate, n->p, n->c, force, by_delta, by_rate);
        if (BP_OPPOSITE) {
            double other[BP_L] BP_ALIGNED, other_delta[BP_L] BP_ALIGNED, other_rate[BP_L] BP_ALIGNED;
            BP_EACH_LANE {
                delta[lane] = r[lane] - along[lane];
                rate[lane] = -along_rate[lane];
            }
            bp_member_law_slopes_lanes(delta, rate, n->p, n->c, other, other_delta, other_rate);
            BP_EACH_LANE {
                force[lane] -= other[lane];
                by_delta[lane] += other_delta[lane];
                by_rate[lane] += other_rate[lane];
            }
        }
        BP_EACH_LANE {
            const double cc = co[lane] * co[lane], cs = co[lane] * si[lane], ss = si[lane] * si[lane];
            S[lane] += force[lane] * co[lane];
            S[BP_L + lane] += force[lane] * si[lane];
            G[lane] += by_delta[lane] * cc;
            G[BP_L + lane] += by_delta[lane] * cs;
            G[2 * BP_L + lane] += by_delta[lane] * ss;
            G[3 * BP_L + lane] += by_rate[lane] * cc;
            G[4 * BP_L + lane] += by_rate[lane] * cs;
            G[5 * BP_L + lane] += by_rate[lane] * ss;
        }
    }
}

/* dx/dt at a state, for stage variables w that hold for its time. */
static inline void bp_lane_rate(const bp_lane_numbers *n, const double *restrict w, const double *restrict x, double *restrict dx)
{
    double r[5 * BP_L] BP_ALIGNED, S[2 * BP_L] BP_ALIGNED;
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    bp_lane_sums(n, w, r, S);
    for (int k = 0; k < BP_NQ; k++) BP_EACH_LANE dx[k * BP_L + lane] = x[(BP_NQ + k) * BP_L + lane];
    bp_member_acceleration_lanes(x, S, n->u, n->p, n->c, w, dx + BP_NQ * BP_L);
}

/* dx/dt, the blocks A = da/dq and B = da/dv of its Jacobian, and the partial time derivative of a. */
static inline void bp_lane_linearize(const bp_lane_numbers *n, const double *restrict w, const double *restrict wt, const double *restrict x,
                                     double *restrict dx, double *restrict A, double *restrict B, double *restrict at)
{
    double r[5 * BP_L] BP_ALIGNED, S[2 * BP_L] BP_ALIGNED, G[6 * BP_L] BP_ALIGNED;
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    bp_lane_sums_and_slopes(n, w, r, S, G);
    for (int k = 0; k < BP_NQ; k++) BP_EACH_LANE dx[k * BP_L + lane] = x[(BP_NQ + k) * BP_L + lane];
    bp_member_acceleration_lanes(x, S, n->u, n->p, n->c, w, dx + BP_NQ * BP_L);
    bp_member_acceleration_jacobian_lanes(x, S, G, n->u, n->p, n->c, w, A, B);
    bp_member_acceleration_rate_lanes(x, S, G, r, n->u, n->p, n->c, w, wt, at);
}

/* Channels of the reductions (see reductions.h) in lanes. */
static inline void bp_lane_ball_channels(const bp_lane_numbers *n, const bp_lane_angles *restrict angles, double theta,
                                         const double *restrict t, const double *restrict h, const double *restrict x,
                                         double *restrict value)
{
    double w[BP_NW * BP_L] BP_ALIGNED, r[5 * BP_L] BP_ALIGNED;
    double C[BP_NA * BP_L] BP_ALIGNED, S[BP_NA * BP_L] BP_ALIGNED, time[BP_L] BP_ALIGNED;
    bp_lane_turn(angles, theta, t, h, C, S, time);
    bp_member_cage_turned_lanes(C, S, time, n->u, n->p, n->c, w);
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    for (int j = 0; j < BP_NB; j++) {
        double delta[BP_L] BP_ALIGNED, rate[BP_L] BP_ALIGNED, elastic[BP_L] BP_ALIGNED, damping[BP_L] BP_ALIGNED;
        BP_EACH_LANE {
            const double co = bp_cos[j] * w[lane] - bp_sin[j] * w[BP_L + lane];
            const double si = bp_sin[j] * w[lane] + bp_cos[j] * w[BP_L + lane];
            delta[lane] = r[lane] + r[BP_L + lane] * co + r[2 * BP_L + lane] * si;
            rate[lane] = r[3 * BP_L + lane] * co + r[4 * BP_L + lane] * si;
        }
        bp_member_contact_lanes(delta, rate, n->p, n->c, elastic, damping);
        BP_EACH_LANE {
            const double total = elastic[lane] + damping[lane];
            value[lane] = j == 0 || total > value[lane] ? total : value[lane];
            value[BP_L + lane] = j == 0 || elastic[lane] > value[BP_L + lane] ? elastic[lane] : value[BP_L + lane];
            value[2 * BP_L + lane] = j == 0 || damping[lane] > value[2 * BP_L + lane] ? damping[lane] : value[2 * BP_L + lane];
            value[3 * BP_L + lane] = j == 0 || delta[lane] > value[3 * BP_L + lane] ? delta[lane] : value[3 * BP_L + lane];
        }
    }
}

#endif
