/* The model for a member of an ensemble in each SIMD lane; see model.h for one member.

   Every array holds BP_LANES values an entry, next to each other.  Lanes never look at each other: a member's arithmetic is the same
   whichever members are its neighbours. */
#ifndef BALLPASS_LANE_MODEL_H
#define BALLPASS_LANE_MODEL_H

#include "ensemble_kernels.h"
#include "model.h"
#include "reductions.h"

enum { BP_L = BP_LANES };

#define BP_EACH_LANE _Pragma("omp simd") for (int lane = 0; lane < BP_L; lane++)
#define BP_ALIGNED __attribute__((aligned(64)))
#define BP_INLINE static inline __attribute__((always_inline))

/* Whether a flag is set, not 0, in any lane. */
BP_INLINE int bp_any_lane(const double *restrict flags)
{
    double sum = 0.0;
    _Pragma("omp simd reduction(+ : sum)") for (int lane = 0; lane < BP_L; lane++) sum += flags[lane];
    return sum != 0.0;
}

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
    int any;                     /* whether one does so in any lane */
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
    at->any = bp_any_lane(at->far);
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
    if (!at->any) return;
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

/* Direction of ball j of a bearing, whose cage has the angle with the cosine and sine at `cage`. */
BP_INLINE void bp_lane_direction(double cage_cos, double cage_sin, const double *restrict cage, double *restrict co, double *restrict si)
{
    BP_EACH_LANE {
        co[lane] = cage_cos * cage[lane] - cage_sin * cage[BP_L + lane];
        si[lane] = cage_sin * cage[lane] + cage_cos * cage[BP_L + lane];
    }
}

/* Numbers of the balls of a bearing. */
#define BP_LANE_NUMBERS(b)                                \
    double numbers[BP_##b##_NK * BP_L] BP_ALIGNED;        \
    BP_NUMBERS(b, BP_LANES, n->p, n->c, w, numbers)

/* A kernel of a bearing of structure b for all its directions (of opposite balls one), its first rows added up to S and the others to G, in the order of
   bp_total. */
#define BP_LANE_SUM(b, kernel, slopes)                                                                                           \
    {                                                                                                                            \
        BP_LANE_NUMBERS(b)                                                                                                       \
        double sum[BP_SUMMANDS][(BP_##b##_SUMS + (slopes)) * BP_L] BP_ALIGNED;                                                               \
        for (int j = 0; j < BP_##b##_DIRECTIONS; j++) {                                                                          \
            double co[BP_L] BP_ALIGNED, si[BP_L] BP_ALIGNED, more[(BP_##b##_SUMS + (slopes)) * BP_L] BP_ALIGNED;                             \
            double *rows = j < BP_SUMMANDS ? sum[j] : more;                                                                      \
            bp_lane_direction(bp_##b##_cos[j], bp_##b##_sin[j], r + BP_CAGE * BP_L, co, si);                                  \
            bp_##b##_member_##kernel##_lanes(co, si, r + bp_first_relative[bearing] * BP_L, numbers, rows);                         \
            for (int m = 0; m < BP_##b##_SUMS + (slopes) && j >= BP_SUMMANDS; m++)                                                           \
                BP_EACH_LANE sum[j % BP_SUMMANDS][m * BP_L + lane] += more[m * BP_L + lane];                                     \
        }                                                                                                                        \
        for (int j = BP_##b##_DIRECTIONS; j < BP_SUMMANDS; j++)                                                                  \
            for (int i = 0; i < (BP_##b##_SUMS + (slopes)) * BP_L; i++) sum[j][i] = 0.0;                                                     \
        for (int m = 0; m < BP_##b##_SUMS + (slopes); m++) {                                                                                 \
            double *restrict to = m < BP_##b##_SUMS ? S + (bp_first_sum[bearing] + m) * BP_L : G + (bp_first_slope[bearing] + m - BP_##b##_SUMS) * BP_L;                  \
            BP_EACH_LANE to[lane] = (sum[0][m * BP_L + lane] + sum[2][m * BP_L + lane])                                          \
                                    + (sum[1][m * BP_L + lane] + sum[3][m * BP_L + lane]);                                       \
        }                                                                                                                        \
    }

/* Sums over the balls of each bearing: F cos, F sin. */
BP_INLINE void bp_lane_sums(const bp_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    double *const G = NULL;
#define BP_SUM(b) BP_LANE_SUM(b, forces, 0)
    BP_EACH_BEARING(BP_SUM)
#undef BP_SUM
    (void)G;
}

/* The same, and the sums G of the slopes. */
BP_INLINE void bp_lane_sums_and_slopes(const bp_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S,
                                       double *restrict G)
{
#define BP_SUM(b) BP_LANE_SUM(b, slopes, BP_##b##_SLOPES)
    BP_EACH_BEARING(BP_SUM)
#undef BP_SUM
}

/* dx/dt at a state, for stage variables w that hold for its time. */
static inline void bp_lane_rate(const bp_lane_numbers *n, const double *restrict w, const double *restrict x, double *restrict dx)
{
    double r[BP_NR * BP_L] BP_ALIGNED, S[BP_NS * BP_L] BP_ALIGNED;
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    bp_lane_sums(n, w, r, S);
    for (int k = 0; k < BP_NQ; k++) BP_EACH_LANE dx[k * BP_L + lane] = x[(BP_NQ + k) * BP_L + lane];
    bp_member_acceleration_lanes(x, S, r, n->u, n->p, n->c, w, dx + BP_NQ * BP_L);
}

/* dx/dt, the blocks A = da/dq and B = da/dv of its Jacobian, and the partial time derivative of a. */
static inline void bp_lane_linearize(const bp_lane_numbers *n, const double *restrict w, const double *restrict wt, const double *restrict x,
                                     double *restrict dx, double *restrict A, double *restrict B, double *restrict at)
{
    double r[BP_NR * BP_L] BP_ALIGNED, S[BP_NS * BP_L] BP_ALIGNED, G[BP_NG * BP_L] BP_ALIGNED;
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    bp_lane_sums_and_slopes(n, w, r, S, G);
    for (int k = 0; k < BP_NQ; k++) BP_EACH_LANE dx[k * BP_L + lane] = x[(BP_NQ + k) * BP_L + lane];
    bp_member_acceleration_lanes(x, S, r, n->u, n->p, n->c, w, dx + BP_NQ * BP_L);
    bp_member_acceleration_jacobian_lanes(x, S, G, r, n->u, n->p, n->c, w, A, B);
    bp_member_acceleration_rate_lanes(x, S, G, r, n->u, n->p, n->c, w, wt, at);
}

/* Deflection of the most loaded ball of each bearing at the times `time`, into its channel; of the kernel the compiler leaves nothing else. */
static inline __attribute__((flatten)) void bp_lane_deflections(const bp_lane_numbers *n, const double *restrict time, const double *restrict x,
                                                                double *restrict value)
{
    double w[BP_NW * BP_L] BP_ALIGNED, r[BP_NR * BP_L] BP_ALIGNED;
    bp_member_cage_lanes(time, n->u, n->p, n->c, w);
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
#define BP_CHANNEL(b)                                                                                                            \
    BP_LANE_NUMBERS(b)                                                                                                           \
    for (int j = 0; j < BP_##b##_BALLS; j++) {                                                                                   \
        double co[BP_L] BP_ALIGNED, si[BP_L] BP_ALIGNED, rows[BP_BALL_CHANNELS * BP_L] BP_ALIGNED;                               \
        double *most = value + (BP_BALL_CHANNELS * bearing + BP_DEFLECTION) * BP_L;                                                  \
        bp_lane_direction(bp_##b##_cos[j], bp_##b##_sin[j], r + BP_CAGE * BP_L, co, si);                                      \
        bp_##b##_member_contact_lanes(co, si, r + bp_first_relative[bearing] * BP_L, numbers, rows);                          \
        BP_EACH_LANE {                                                                                                           \
            const double own = rows[BP_DEFLECTION * BP_L + lane];                                                                \
            most[lane] = j == 0 || own > most[lane] ? own : most[lane];                                                          \
        }                                                                                                                        \
    }
    BP_EACH_BEARING(BP_CHANNEL)
#undef BP_CHANNEL
}

/* Channels of the balls (see reductions.h) in lanes, at the times `time`: of each bearing quantities of the most loaded ball, and,
   where `passes`, the powers of all balls' loads that sectors add up; where they are wanted, the sides of the balls (bp_side). */
static inline void bp_lane_ball_channels(const bp_lane_numbers *n, const double *restrict time, const double *restrict x,
                                         int passes, double *restrict value, double *restrict first, double *restrict side,
                                         int sided)
{
    double w[BP_NW * BP_L] BP_ALIGNED, r[BP_NR * BP_L] BP_ALIGNED;
    bp_member_cage_lanes(time, n->u, n->p, n->c, w);
    bp_member_relative_lanes(x, n->u, n->p, n->c, w, r);
#define BP_CHANNEL(b)                                                                                                            \
    {                                                                                                                            \
        BP_LANE_NUMBERS(b)                                                                                                       \
        double *sides = side + BP_BALL_CHANNELS * bearing * BP_L;                                                                    \
        double *to = value + BP_BALL_CHANNELS * bearing * BP_L;                                                                      \
        for (int j = 0; j < BP_##b##_BALLS; j++) {                                                                               \
            double co[BP_L] BP_ALIGNED, si[BP_L] BP_ALIGNED, rows[BP_BALL_CHANNELS * BP_L] BP_ALIGNED, load[BP_L] BP_ALIGNED;    \
            double *own = first + (bp_first_ball[bearing] + j) * BP_L;                                                              \
            bp_lane_direction(bp_##b##_cos[j], bp_##b##_sin[j], r + BP_CAGE * BP_L, co, si);                                  \
            bp_##b##_member_contact_lanes(co, si, r + bp_first_relative[bearing] * BP_L, numbers, rows);                            \
            for (int k = 0; k < BP_BALL_CHANNELS && sided; k++)                                                                  \
                BP_EACH_LANE {                                                                                                   \
                    const int i = k * BP_L + lane, contact = k != BP_DEFLECTION && rows[BP_DEFLECTION * BP_L + lane] > 0.0;      \
                    const double at = 4.0 * j + 2.0 * contact + (k != BP_DEFLECTION && rows[BP_DAMPING * BP_L + lane] == 0.0);   \
                    sides[i] = j == 0 || rows[i] > to[i] ? at : sides[i];                                                        \
                }                                                                                                                \
            _Pragma("omp simd")                                                                                                  \
            for (int i = 0; i < BP_BALL_CHANNELS * BP_L; i++) to[i] = j == 0 || rows[i] > to[i] ? rows[i] : to[i];               \
            if (!passes) continue;                                                                                               \
            BP_EACH_LANE load[lane] = rows[lane] > 0.0 ? 1e-3 * rows[lane] : 0.0;                                                \
            BP_EACH_LANE own[lane] = bp_power(load[lane], BP_SECTOR_POWER(b));                                                   \
        }                                                                                                                        \
    }
    BP_EACH_BEARING(BP_CHANNEL)
#undef BP_CHANNEL
}

#endif
