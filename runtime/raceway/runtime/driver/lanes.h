/* The model and the methods for a member of an ensemble in each SIMD lane; see model.h, explicit.h and rosenbrock.h for one member.

   Every array holds RW_MEMBERS values an entry, next to each other.  Lanes never look at each other: a member's arithmetic is the same
   whichever members are its neighbours. */
#ifndef RACEWAY_LANES_H
#define RACEWAY_LANES_H

#include <stdint.h>
#include <string.h>

#include "control.h"
#include "ensemble_kernels.h"

enum { RW_L = RW_MEMBERS };

#define RW_EACH_LANE _Pragma("omp simd") for (int lane = 0; lane < RW_L; lane++)
#define RW_ALIGNED __attribute__((aligned(64)))
#define RW_INLINE static inline __attribute__((always_inline))

typedef struct {
    const double *u;
    const double *p;
    const double *c;
} rw_lane_numbers;

/* Bits of a number in each lane. */
typedef union {
    double value[RW_L];
    uint64_t bits[RW_L];
} rw_lane_bits;

/* Natural logarithm of positive numbers and exponential of moderate ones without branches and tables, for the step size controller: to
   1e-11, and the same in every lane. */
static inline void rw_lane_log(const double *restrict x, double *restrict y)
{
    rw_lane_bits from RW_ALIGNED, exponent RW_ALIGNED, fraction RW_ALIGNED;
    RW_EACH_LANE from.value[lane] = x[lane] * 1.4142135623730951; /* so that the fraction is about one */
    RW_EACH_LANE exponent.bits[lane] = (from.bits[lane] >> 52) | UINT64_C(0x4330000000000000);
    RW_EACH_LANE fraction.bits[lane] = (from.bits[lane] & UINT64_C(0xFFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000);
    RW_EACH_LANE {
        const double m = fraction.value[lane] * 0.7071067811865476, s = (m - 1.0) / (m + 1.0), z = s * s, zz = z * z;
        /* in pairs: the next step waits for it */
        const double low = (1.0 + z * (1.0 / 3)) + zz * (1.0 / 5 + z * (1.0 / 7));
        const double series = low + zz * zz * ((1.0 / 9 + z * (1.0 / 11)) + zz * (1.0 / 13));
        y[lane] = (exponent.value[lane] - (4503599627370496.0 + 1023.0)) * 0.6931471805599453 + 2.0 * s * series;
    }
}

static inline void rw_lane_exp(const double *restrict x, double *restrict y)
{
    rw_lane_bits shifted RW_ALIGNED, power RW_ALIGNED;
    double series[RW_L] RW_ALIGNED;
    RW_EACH_LANE {
        /* adding 1.5 * 2^52 rounds to a whole number and puts it into the low bits */
        const double bounded = x[lane] > 40.0 ? 40.0 : x[lane], z = bounded < -40.0 ? -40.0 : bounded;
        shifted.value[lane] = z * 1.4426950408889634 + 6755399441055744.0;
        const double r = z - (shifted.value[lane] - 6755399441055744.0) * 0.6931471805599453, rr = r * r;
        const double low = (1.0 + r) + rr * (1.0 / 2 + r * (1.0 / 6));
        const double high = (1.0 / 24 + r * (1.0 / 120)) + rr * ((1.0 / 720 + r * (1.0 / 5040)) + rr * (1.0 / 40320 + r * (1.0 / 362880)));
        series[lane] = low + rr * rr * high;
    }
    RW_EACH_LANE power.bits[lane] = (shifted.bits[lane] + UINT64_C(1023)) << 52;
    RW_EACH_LANE y[lane] = series[lane] * power.value[lane];
}

/* Where the angles of the stages are when a step begins, and how fast they turn. */
typedef struct {
    double angle[RW_NA * RW_L] RW_ALIGNED, rate[RW_NA * RW_L] RW_ALIGNED;
    double cosine[RW_NA * RW_L] RW_ALIGNED, sine[RW_NA * RW_L] RW_ALIGNED;
    double far[RW_L] RW_ALIGNED; /* whether an angle turns by more within the step than rw_turn takes */
    double any;                  /* whether one does so in any lane */
} rw_lane_angles;

RW_INLINE void rw_lane_angles_start(rw_lane_angles *restrict at, const rw_lane_numbers *n, const double *restrict t, const double *restrict h)
{
    double largest[RW_L] RW_ALIGNED;
    rw_member_angles_lanes(t, n->u, n->p, n->c, at->angle, at->rate);
    RW_EACH_LANE largest[lane] = 0.0;
    for (int k = 0; k < RW_NA; k++)
        RW_EACH_LANE {
            const int i = k * RW_L + lane;
            const double turning = fabs(at->rate[i]);
            largest[lane] = turning > largest[lane] ? turning : largest[lane];
            rw_sincos(at->angle[i], &at->sine[i], &at->cosine[i]);
        }
    RW_EACH_LANE at->far[lane] = largest[lane] * h[lane] <= RW_SMALL_ANGLE ? 0.0 : 1.0;
    double any = 0.0;
    for (int lane = 0; lane < RW_L; lane++) any += at->far[lane];
    at->any = any;
}

/* Cosines and sines of the angles at the times t + node h, which are returned; as rw_directions for one member. */
RW_INLINE void rw_lane_turn(const rw_lane_angles *restrict at, double node, const double *restrict t, const double *restrict h,
                            double *restrict C, double *restrict S, double *restrict time)
{
    RW_EACH_LANE time[lane] = t[lane] + node * h[lane];
    for (int k = 0; k < RW_NA; k++)
        RW_EACH_LANE {
            const int i = k * RW_L + lane;
            rw_turn(at->cosine[i], at->sine[i], at->rate[i] * h[lane] * node, &C[i], &S[i]);
        }
    if (at->any == 0.0) return;
    for (int k = 0; k < RW_NA; k++)
        RW_EACH_LANE {
            const int i = k * RW_L + lane;
            double sine, cosine;
            rw_sincos(at->angle[i] + at->rate[i] * h[lane] * node, &sine, &cosine);
            C[i] = at->far[lane] != 0.0 ? cosine : C[i];
            S[i] = at->far[lane] != 0.0 ? sine : S[i];
        }
}

/* Stage variables at the times t + node h. */
RW_INLINE void rw_lane_stage(const rw_lane_numbers *n, const rw_lane_angles *restrict at, double node, const double *restrict t,
                             const double *restrict h, double *restrict w)
{
    double C[RW_NA * RW_L] RW_ALIGNED, S[RW_NA * RW_L] RW_ALIGNED, time[RW_L] RW_ALIGNED;
    rw_lane_turn(at, node, t, h, C, S, time);
    rw_member_stage_turned_lanes(C, S, time, n->u, n->p, n->c, w);
}

/* Balls come in opposite pairs where their number is even, for they are equal: one direction serves both. */
enum { RW_OPPOSITE = RW_NB % 2 == 0, RW_DIRECTIONS = RW_OPPOSITE ? RW_NB / 2 : RW_NB };

/* Direction of a ball, and what deflection and rate of it and of the one opposite are made of: along, along_rate. */
RW_INLINE void rw_lane_direction(int j, const double *restrict w, const double *restrict r, double *restrict co, double *restrict si,
                                 double *restrict along, double *restrict along_rate)
{
    RW_EACH_LANE {
        co[lane] = rw_cos[j] * w[lane] - rw_sin[j] * w[RW_L + lane];
        si[lane] = rw_sin[j] * w[lane] + rw_cos[j] * w[RW_L + lane];
        along[lane] = r[RW_L + lane] * co[lane] + r[2 * RW_L + lane] * si[lane];
        along_rate[lane] = r[3 * RW_L + lane] * co[lane] + r[4 * RW_L + lane] * si[lane];
    }
}

/* Sums over the balls of F cos, F sin. */
RW_INLINE void rw_lane_sums(const rw_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    RW_EACH_LANE S[lane] = S[RW_L + lane] = 0.0;
    for (int j = 0; j < RW_DIRECTIONS; j++) {
        double co[RW_L] RW_ALIGNED, si[RW_L] RW_ALIGNED, along[RW_L] RW_ALIGNED, along_rate[RW_L] RW_ALIGNED, force[RW_L] RW_ALIGNED;
        double delta[RW_L] RW_ALIGNED, rate[RW_L] RW_ALIGNED, opposite[RW_L] RW_ALIGNED;
        rw_lane_direction(j, w, r, co, si, along, along_rate);
        RW_EACH_LANE delta[lane] = r[lane] + along[lane];
        rw_member_law_lanes(delta, along_rate, n->p, n->c, force);
        if (RW_OPPOSITE) {
            RW_EACH_LANE {
                delta[lane] = r[lane] - along[lane];
                rate[lane] = -along_rate[lane];
            }
            rw_member_law_lanes(delta, rate, n->p, n->c, opposite);
            RW_EACH_LANE force[lane] -= opposite[lane];
        }
        RW_EACH_LANE {
            S[lane] += force[lane] * co[lane];
            S[RW_L + lane] += force[lane] * si[lane];
        }
    }
}

/* The same, and the sums G of the slopes times cos cos, cos sin, sin sin: by deflection, then by rate. */
RW_INLINE void rw_lane_sums_and_slopes(const rw_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S,
                                       double *restrict G)
{
    for (int k = 0; k < 2; k++) RW_EACH_LANE S[k * RW_L + lane] = 0.0;
    for (int k = 0; k < 6; k++) RW_EACH_LANE G[k * RW_L + lane] = 0.0;
    for (int j = 0; j < RW_DIRECTIONS; j++) {
        double co[RW_L] RW_ALIGNED, si[RW_L] RW_ALIGNED, along[RW_L] RW_ALIGNED, along_rate[RW_L] RW_ALIGNED;
        double delta[RW_L] RW_ALIGNED, rate[RW_L] RW_ALIGNED, force[RW_L] RW_ALIGNED, by_delta[RW_L] RW_ALIGNED, by_rate[RW_L] RW_ALIGNED;
        rw_lane_direction(j, w, r, co, si, along, along_rate);
        RW_EACH_LANE delta[lane] = r[lane] + along[lane];
        rw_member_law_slopes_lanes(delta, along_rate, n->p, n->c, force, by_delta, by_rate);
        if (RW_OPPOSITE) {
            double other[RW_L] RW_ALIGNED, other_delta[RW_L] RW_ALIGNED, other_rate[RW_L] RW_ALIGNED;
            RW_EACH_LANE {
                delta[lane] = r[lane] - along[lane];
                rate[lane] = -along_rate[lane];
            }
            rw_member_law_slopes_lanes(delta, rate, n->p, n->c, other, other_delta, other_rate);
            RW_EACH_LANE {
                force[lane] -= other[lane];
                by_delta[lane] += other_delta[lane];
                by_rate[lane] += other_rate[lane];
            }
        }
        RW_EACH_LANE {
            const double cc = co[lane] * co[lane], cs = co[lane] * si[lane], ss = si[lane] * si[lane];
            S[lane] += force[lane] * co[lane];
            S[RW_L + lane] += force[lane] * si[lane];
            G[lane] += by_delta[lane] * cc;
            G[RW_L + lane] += by_delta[lane] * cs;
            G[2 * RW_L + lane] += by_delta[lane] * ss;
            G[3 * RW_L + lane] += by_rate[lane] * cc;
            G[4 * RW_L + lane] += by_rate[lane] * cs;
            G[5 * RW_L + lane] += by_rate[lane] * ss;
        }
    }
}

/* dx/dt at a state, for stage variables w that hold for its time. */
static inline void rw_lane_rate(const rw_lane_numbers *n, const double *restrict w, const double *restrict x, double *restrict dx)
{
    double r[5 * RW_L] RW_ALIGNED, S[2 * RW_L] RW_ALIGNED;
    rw_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    rw_lane_sums(n, w, r, S);
    for (int k = 0; k < RW_NQ; k++) RW_EACH_LANE dx[k * RW_L + lane] = x[(RW_NQ + k) * RW_L + lane];
    rw_member_acceleration_lanes(x, S, n->u, n->p, n->c, w, dx + RW_NQ * RW_L);
}

/* Root mean square of an error over its tolerance. */
RW_INLINE void rw_lane_norm(const double *restrict error, const double *restrict weight, double *restrict norm)
{
    RW_EACH_LANE norm[lane] = 0.0;
    for (int k = 0; k < RW_NX; k++)
        RW_EACH_LANE {
            const double e = error[k * RW_L + lane] * weight[k * RW_L + lane];
            norm[lane] += e * e;
        }
    RW_EACH_LANE norm[lane] = sqrt(norm[lane] / (double)RW_NX);
}

/* y = x + h sum of row[j] k[j]; the latest slope is added last.  Entry by entry: the sum stays in a register. */
RW_INLINE void rw_lane_combine(const double *restrict row, const int count, const double k[][RW_NX * RW_L], const double *restrict h,
                               const double *restrict x, double *restrict y)
{
    for (int i = 0; i < RW_NX; i++)
        RW_EACH_LANE {
            double sum = 0.0;
#pragma GCC unroll 16
            for (int j = 0; j < count; j++) sum += row[j] != 0.0 ? row[j] * k[j][i * RW_L + lane] : 0.0;
            y[i * RW_L + lane] = x[i * RW_L + lane] + h[lane] * sum;
        }
}

typedef struct {
    double k[RW_DP54_STAGES + 1][RW_NX * RW_L] RW_ALIGNED; /* slopes; the first is known when a step starts */
    double y[RW_NX * RW_L] RW_ALIGNED;                     /* argument of the last stage: stiffness shows in it */
} rw_lane_explicit;

typedef struct {
    double w[RW_NW * RW_L] RW_ALIGNED, wt[RW_NW * RW_L] RW_ALIGNED;         /* stage variables at the start */
    double end_w[RW_NW * RW_L] RW_ALIGNED, end_wt[RW_NW * RW_L] RW_ALIGNED; /* and at the end of the step tried */
    double u[RW_RODAS5P_STAGES][RW_NX * RW_L] RW_ALIGNED;                   /* stages */
    double A[RW_NQ * RW_NQ * RW_L] RW_ALIGNED, B[RW_NQ * RW_NQ * RW_L] RW_ALIGNED; /* of the step tried */
    double pivoted[RW_L] RW_ALIGNED; /* whether its system was solved with pivoting */
} rw_lane_linear;

/* One step of Dormand and Prince from (t, x) to `next`, the end slope included. */
static inline void rw_lane_explicit_step(rw_lane_explicit *restrict work, const rw_lane_numbers *n, rw_lane_angles *restrict angles,
                                         const double *restrict t, const double *restrict x, const double *restrict h,
                                         const double *restrict weight, double *restrict next, double *restrict norm)
{
    const rw_explicit_method *method = &rw_dp54;
    double w[RW_DP54_STAGES][RW_NW * RW_L] RW_ALIGNED;
    rw_lane_angles_start(angles, n, t, h);
    /* all times of the step first: nothing in them waits for a slope.  The last stage and the end slope are both at its end */
#pragma GCC unroll 16
    for (int i = 1; i <= RW_DP54_STAGES; i++) {
        if (i < RW_DP54_STAGES) rw_lane_stage(n, angles, method->nodes[i], t, h, w[i]);
        const double *row = i < RW_DP54_STAGES ? method->a[i] : method->weights;
        double *restrict y = i < RW_DP54_STAGES ? work->y : next;
        rw_lane_combine(row, i, (const double(*)[RW_NX * RW_L])work->k, h, x, y);
        rw_lane_rate(n, w[i < RW_DP54_STAGES ? i : RW_DP54_STAGES - 1], y, work->k[i]);
    }
    double error[RW_NX * RW_L] RW_ALIGNED;
    for (int i = 0; i < RW_NX; i++)
        RW_EACH_LANE {
            double sum = 0.0;
#pragma GCC unroll 16
            for (int j = 0; j <= RW_DP54_STAGES; j++)
                sum += method->error[0][j] != 0.0 ? method->error[0][j] * work->k[j][i * RW_L + lane] : 0.0;
            error[i * RW_L + lane] = h[lane] * sum;
        }
    rw_lane_norm(error, weight, norm);
}

/* Product of step size and dominant eigenvalue, from the last two slopes at the step's end. */
static inline void rw_lane_stiffness(const rw_lane_explicit *restrict work, const double *restrict h, const double *restrict next,
                                     const double *restrict weight, double *restrict reach)
{
    double slopes[RW_NX * RW_L] RW_ALIGNED, states[RW_NX * RW_L] RW_ALIGNED, below[RW_L] RW_ALIGNED;
    for (int i = 0; i < RW_NX * RW_L; i++) {
        slopes[i] = work->k[RW_DP54_STAGES][i] - work->k[RW_DP54_STAGES - 1][i];
        states[i] = next[i] - work->y[i];
    }
    rw_lane_norm(states, weight, below);
    rw_lane_norm(slopes, weight, reach);
    RW_EACH_LANE reach[lane] = below[lane] > 0.0 ? h[lane] * reach[lane] / below[lane] : 0.0;
}

/* Columns of [W^-1 A/s | W^-1] for every lane, by Gauss-Jordan elimination without pivoting; a lane whose W is not dominated by its
   diagonal is done anew by itself, with pivoting.  A singular W makes its lane's step not a number. */
static inline void rw_lane_factorize(double solve[RW_NX][RW_NQ * RW_L], double *restrict pivoted, const double *restrict A, const double *restrict B,
                                     const double *restrict s)
{
    double rows[RW_NQ][3 * RW_NQ][RW_L] RW_ALIGNED, dominance[RW_L] RW_ALIGNED, inverse[RW_L] RW_ALIGNED;
    RW_EACH_LANE inverse[lane] = 1.0 / s[lane];
    RW_EACH_LANE dominance[lane] = 1.0;
    for (int i = 0; i < RW_NQ; i++) {
        double rest[RW_L] RW_ALIGNED = {0.0};
        for (int j = 0; j < RW_NQ; j++)
            RW_EACH_LANE {
                const double scaled = A[(i * RW_NQ + j) * RW_L + lane] * inverse[lane];
                const double entry = (i == j ? s[lane] : 0.0) - B[(i * RW_NQ + j) * RW_L + lane] - scaled;
                rows[i][j][lane] = entry;
                rows[i][RW_NQ + j][lane] = scaled;
                rows[i][2 * RW_NQ + j][lane] = i == j ? 1.0 : 0.0;
                rest[lane] += i != j ? fabs(entry) : 0.0;
            }
        RW_EACH_LANE dominance[lane] = fabs(rows[i][i][lane]) >= rest[lane] ? dominance[lane] : 0.0;
    }
    for (int k = 0; k < RW_NQ; k++) {
        double pivot[RW_L] RW_ALIGNED;
        RW_EACH_LANE pivot[lane] = 1.0 / rows[k][k][lane];
        for (int j = k + 1; j < 3 * RW_NQ; j++) RW_EACH_LANE rows[k][j][lane] *= pivot[lane];
        for (int i = 0; i < RW_NQ; i++) {
            if (i == k) continue;
            double factor[RW_L] RW_ALIGNED;
            RW_EACH_LANE factor[lane] = rows[i][k][lane];
            for (int j = k + 1; j < 3 * RW_NQ; j++) RW_EACH_LANE rows[i][j][lane] -= factor[lane] * rows[k][j][lane];
        }
    }
    for (int j = 0; j < RW_NX; j++)
        for (int i = 0; i < RW_NQ; i++) RW_EACH_LANE solve[j][i * RW_L + lane] = rows[i][RW_NQ + j][lane];
    RW_EACH_LANE pivoted[lane] = 1.0 - dominance[lane];
    for (int lane = 0; lane < RW_L; lane++) {
        if (dominance[lane] != 0.0) continue;
        double own_A[RW_NQ * RW_NQ], own_B[RW_NQ * RW_NQ];
        rw_matrix matrix;
        for (int k = 0; k < RW_NQ * RW_NQ; k++) {
            own_A[k] = A[k * RW_L + lane];
            own_B[k] = B[k * RW_L + lane];
        }
        const int regular = rw_factorize(&matrix, own_A, own_B, s[lane]);
        for (int j = 0; j < RW_NX; j++)
            for (int i = 0; i < RW_NQ; i++) solve[j][i * RW_L + lane] = regular ? matrix.solve[j][i] : NAN;
    }
}

/* One step of Rodas5P from (t, x) to `next`; linearizes at its start, where w and wt hold. */
static inline void rw_lane_linear_step(rw_lane_linear *restrict work, const rw_lane_numbers *n, rw_lane_angles *restrict angles,
                                       const double *restrict t, const double *restrict x, const double *restrict h,
                                       const double *restrict weight, double *restrict next, double *restrict norm)
{
    const rw_rosenbrock_method *method = &rw_rodas5p;
    double dx0[RW_NX * RW_L] RW_ALIGNED, at[RW_NQ * RW_L] RW_ALIGNED, solve[RW_NX][RW_NQ * RW_L] RW_ALIGNED;
    double s[RW_L] RW_ALIGNED, inverse_s[RW_L] RW_ALIGNED, inverse_h[RW_L] RW_ALIGNED, w[RW_RODAS5P_STAGES][RW_NW * RW_L] RW_ALIGNED;
    rw_lane_angles_start(angles, n, t, h);
    RW_EACH_LANE {
        s[lane] = 1.0 / (h[lane] * method->gamma);
        inverse_s[lane] = h[lane] * method->gamma;
        inverse_h[lane] = 1.0 / h[lane];
    }
    {
        double r[5 * RW_L] RW_ALIGNED, S[2 * RW_L] RW_ALIGNED, G[6 * RW_L] RW_ALIGNED;
        rw_member_relative_lanes(x, n->u, n->p, n->c, work->w, r);
        rw_lane_sums_and_slopes(n, work->w, r, S, G);
        for (int k = 0; k < RW_NQ; k++) RW_EACH_LANE dx0[k * RW_L + lane] = x[(RW_NQ + k) * RW_L + lane];
        rw_member_acceleration_lanes(x, S, n->u, n->p, n->c, work->w, dx0 + RW_NQ * RW_L);
        rw_member_acceleration_jacobian_lanes(x, S, G, n->u, n->p, n->c, work->w, work->A, work->B);
        rw_member_acceleration_rate_lanes(x, S, G, r, n->u, n->p, n->c, work->w, work->wt, at);
        rw_lane_factorize(solve, work->pivoted, work->A, work->B, s);
    }
    /* the times inside the step, and its end, which serves several stages and the next step, with the time derivative */
    {
        double C[RW_NA * RW_L] RW_ALIGNED, S[RW_NA * RW_L] RW_ALIGNED, time[RW_L] RW_ALIGNED;
        rw_lane_turn(angles, 1.0, t, h, C, S, time);
        rw_member_stage_rate_turned_lanes(C, S, angles->rate, time, n->u, n->p, n->c, work->end_w, work->end_wt);
    }
#pragma GCC unroll 16
    for (int i = 0; i < RW_RODAS5P_STAGES; i++) {
        double y[RW_NX * RW_L] RW_ALIGNED, dx[RW_NX * RW_L] RW_ALIGNED, R[RW_NX * RW_L] RW_ALIGNED;
        for (int k = 0; k < RW_NX; k++)
            RW_EACH_LANE {
                double reached = x[k * RW_L + lane], coupled = 0.0;
#pragma GCC unroll 16
                for (int j = 0; j < i; j++) {
                    const double stage = work->u[j][k * RW_L + lane];
                    reached += method->a[i][j] * stage;
                    coupled += method->coupling[i][j] * stage;
                }
                y[k * RW_L + lane] = reached;
                R[k * RW_L + lane] = coupled * inverse_h[lane];
            }
        if (i>0 && i <= method->inner) rw_lane_stage(n, angles, method->nodes[i], t, h, w[i]);
        if (i > 0) rw_lane_rate(n, i <= method->inner ? w[i] : work->end_w, y, dx);
        const double *slope = i > 0 ? dx : dx0;
        const double d = method->time_weights[i];
        for (int k = 0; k < RW_NX; k++)
            RW_EACH_LANE R[k * RW_L + lane] += k < RW_NQ ? slope[k * RW_L + lane]
                                                         : slope[k * RW_L + lane] + h[lane] * d * at[(k - RW_NQ) * RW_L + lane];
        for (int k = 0; k < RW_NQ; k++)
            RW_EACH_LANE {
                double kv = 0.0;
#pragma GCC unroll 16
                for (int j = 0; j < RW_NX; j++) kv += solve[j][k * RW_L + lane] * R[j * RW_L + lane];
                work->u[i][(RW_NQ + k) * RW_L + lane] = kv;
                work->u[i][k * RW_L + lane] = (R[k * RW_L + lane] + kv) * inverse_s[lane];
            }
    }
    double error[RW_NX * RW_L] RW_ALIGNED;
    for (int k = 0; k < RW_NX; k++)
        RW_EACH_LANE {
            double end = x[k * RW_L + lane], estimate = 0.0;
#pragma GCC unroll 16
            for (int i = 0; i < RW_RODAS5P_STAGES; i++) {
                end += method->weights[i] * work->u[i][k * RW_L + lane];
                estimate += method->error_weights[i] != 0.0 ? method->error_weights[i] * work->u[i][k * RW_L + lane] : 0.0;
            }
            next[k * RW_L + lane] = end;
            error[k * RW_L + lane] = estimate;
        }
    rw_lane_norm(error, weight, norm);
}

/* Terms of the dense output, as in rw_explicit_dense. */
static inline void rw_lane_explicit_dense(const rw_lane_explicit *restrict work, const double *restrict x, const double *restrict h,
                                          const double *restrict next, double dense[RW_DENSE_ROWS][RW_NX * RW_L])
{
    for (int k = 0; k < RW_NX; k++)
        RW_EACH_LANE {
            const int i = k * RW_L + lane;
            const double delta = next[i] - x[i];
            dense[0][i] = h[lane] * work->k[0][i] - delta;
            dense[1][i] = 2.0 * delta - h[lane] * (work->k[0][i] + work->k[RW_DP54_STAGES][i]);
        }
    for (int row = 0; row < rw_dp54.dense_rows; row++) {
        double *restrict sum = dense[2 + row];
        for (int i = 0; i < RW_NX * RW_L; i++) sum[i] = 0.0;
        for (int j = 0; j <= RW_DP54_STAGES; j++) {
            const double d = rw_dp54.dense[row][j];
            if (d == 0.0) continue;
            for (int i = 0; i < RW_NX * RW_L; i++) sum[i] += d * work->k[j][i];
        }
        for (int k = 0; k < RW_NX; k++) RW_EACH_LANE sum[k * RW_L + lane] *= h[lane];
    }
}

static inline void rw_lane_linear_dense(const rw_lane_linear *restrict work, double dense[RW_DENSE_ROWS][RW_NX * RW_L])
{
    for (int row = 0; row < rw_rodas5p.dense_rows; row++) {
        double *restrict sum = dense[row];
        for (int i = 0; i < RW_NX * RW_L; i++) sum[i] = 0.0;
        for (int j = 0; j < RW_RODAS5P_STAGES; j++) {
            const double d = rw_rodas5p.dense[row][j];
            for (int i = 0; i < RW_NX * RW_L; i++) sum[i] += d * work->u[j][i];
        }
    }
}

/* Entry of the state at theta, from its terms of the dense output `stride` apart; see rw_explicit_at and rw_rosenbrock_at. */
RW_INLINE double rw_explicit_entry(const double *restrict dense, int stride, double x, double next, double theta)
{
    double inner = 0.0;
    for (int row = 1 + rw_dp54.dense_rows; row >= 0; row--) inner = (dense[row * stride] + inner) * (row % 2 == 0 ? 1.0 - theta : theta);
    return x + theta * (next - x + inner);
}

RW_INLINE double rw_linear_entry(const double *restrict dense, int stride, double x, double next, double theta)
{
    double inner = 0.0;
    for (int row = rw_rodas5p.dense_rows - 1; row >= 0; row--) inner = dense[row * stride] + (row < rw_rodas5p.dense_rows - 1 ? theta * inner : 0.0);
    return x + theta * (next - x + (1.0 - theta) * inner);
}

/* Channels of the reductions (see reductions.h) in lanes. */
static inline void rw_lane_ball_channels(const rw_lane_numbers *n, const rw_lane_angles *restrict angles, double theta,
                                         const double *restrict t, const double *restrict h, const double *restrict x,
                                         double *restrict value)
{
    double w[RW_NW * RW_L] RW_ALIGNED, r[5 * RW_L] RW_ALIGNED;
    double C[RW_NA * RW_L] RW_ALIGNED, S[RW_NA * RW_L] RW_ALIGNED, time[RW_L] RW_ALIGNED;
    rw_lane_turn(angles, theta, t, h, C, S, time);
    rw_member_cage_turned_lanes(C, S, time, n->u, n->p, n->c, w);
    rw_member_relative_lanes(x, n->u, n->p, n->c, w, r);
    for (int j = 0; j < RW_NB; j++) {
        double delta[RW_L] RW_ALIGNED, rate[RW_L] RW_ALIGNED, elastic[RW_L] RW_ALIGNED, damping[RW_L] RW_ALIGNED;
        RW_EACH_LANE {
            const double co = rw_cos[j] * w[lane] - rw_sin[j] * w[RW_L + lane];
            const double si = rw_sin[j] * w[lane] + rw_cos[j] * w[RW_L + lane];
            delta[lane] = r[lane] + r[RW_L + lane] * co + r[2 * RW_L + lane] * si;
            rate[lane] = r[3 * RW_L + lane] * co + r[4 * RW_L + lane] * si;
        }
        rw_member_contact_lanes(delta, rate, n->p, n->c, elastic, damping);
        RW_EACH_LANE {
            const double total = elastic[lane] + damping[lane];
            value[lane] = j == 0 || total > value[lane] ? total : value[lane];
            value[RW_L + lane] = j == 0 || elastic[lane] > value[RW_L + lane] ? elastic[lane] : value[RW_L + lane];
            value[2 * RW_L + lane] = j == 0 || damping[lane] > value[2 * RW_L + lane] ? damping[lane] : value[2 * RW_L + lane];
            value[3 * RW_L + lane] = j == 0 || delta[lane] > value[3 * RW_L + lane] ? delta[lane] : value[3 * RW_L + lane];
        }
    }
}

#endif
