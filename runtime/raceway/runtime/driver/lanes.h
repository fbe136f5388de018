/* The model and the methods for a member of an ensemble in each SIMD lane; see model.h, explicit.h and rosenbrock.h for one member.

   Every array holds RW_LANES values an entry, next to each other.  Lanes never look at each other: a member's arithmetic is the same
   whichever members are its neighbours. */
#ifndef RACEWAY_LANES_H
#define RACEWAY_LANES_H

#include <stdint.h>
#include <string.h>

#include "control.h"
#include "ensemble_kernels.h"

enum { RW_L = RW_LANES };

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
        const double m = fraction.value[lane] * 0.7071067811865476, s = (m - 1.0) / (m + 1.0), z = s * s;
        const double series = 1.0 + z * (1.0 / 3 + z * (1.0 / 5 + z * (1.0 / 7 + z * (1.0 / 9 + z * (1.0 / 11 + z * (1.0 / 13))))));
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
        const double r = z - (shifted.value[lane] - 6755399441055744.0) * 0.6931471805599453;
        series[lane] = 1.0 + r * (1.0 + r * (1.0 / 2 + r * (1.0 / 6 + r * (1.0 / 24 + r * (1.0 / 120 + r * (1.0 / 720 + r * (1.0 / 5040
                       + r * (1.0 / 40320 + r * (1.0 / 362880)))))))));
    }
    RW_EACH_LANE power.bits[lane] = (shifted.bits[lane] + UINT64_C(1023)) << 52;
    RW_EACH_LANE y[lane] = series[lane] * power.value[lane];
}

/* Sums over the balls of F cos, F sin. */
RW_INLINE void rw_lane_sums(const rw_lane_numbers *n, const double *restrict w, const double *restrict r, double *restrict S)
{
    RW_EACH_LANE S[lane] = S[RW_L + lane] = 0.0;
    for (int j = 0; j < RW_NB; j++) {
        double co[RW_L] RW_ALIGNED, si[RW_L] RW_ALIGNED, delta[RW_L] RW_ALIGNED, rate[RW_L] RW_ALIGNED, force[RW_L] RW_ALIGNED;
        RW_EACH_LANE {
            co[lane] = rw_cos[j] * w[lane] - rw_sin[j] * w[RW_L + lane];
            si[lane] = rw_sin[j] * w[lane] + rw_cos[j] * w[RW_L + lane];
            delta[lane] = r[lane] + r[RW_L + lane] * co[lane] + r[2 * RW_L + lane] * si[lane];
            rate[lane] = r[3 * RW_L + lane] * co[lane] + r[4 * RW_L + lane] * si[lane];
        }
        rw_member_law_lanes(delta, rate, n->p, n->c, force);
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
    for (int j = 0; j < RW_NB; j++) {
        double co[RW_L] RW_ALIGNED, si[RW_L] RW_ALIGNED, delta[RW_L] RW_ALIGNED, rate[RW_L] RW_ALIGNED;
        double force[RW_L] RW_ALIGNED, by_delta[RW_L] RW_ALIGNED, by_rate[RW_L] RW_ALIGNED;
        RW_EACH_LANE {
            co[lane] = rw_cos[j] * w[lane] - rw_sin[j] * w[RW_L + lane];
            si[lane] = rw_sin[j] * w[lane] + rw_cos[j] * w[RW_L + lane];
            delta[lane] = r[lane] + r[RW_L + lane] * co[lane] + r[2 * RW_L + lane] * si[lane];
            rate[lane] = r[3 * RW_L + lane] * co[lane] + r[4 * RW_L + lane] * si[lane];
        }
        rw_member_law_slopes_lanes(delta, rate, n->p, n->c, force, by_delta, by_rate);
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

/* y = x + h sum of row[j] k[j]. */
RW_INLINE void rw_lane_combine(const double *restrict row, int count, const double k[][RW_NX * RW_L], const double *restrict h,
                               const double *restrict x, double *restrict y)
{
    double sum[RW_NX * RW_L] RW_ALIGNED;
    for (int i = 0; i < RW_NX; i++) RW_EACH_LANE sum[i * RW_L + lane] = 0.0;
    for (int j = 0; j < count; j++) {
        const double a = row[j];
        if (a == 0.0) continue;
        for (int i = 0; i < RW_NX; i++) RW_EACH_LANE sum[i * RW_L + lane] += a * k[j][i * RW_L + lane];
    }
    for (int i = 0; i < RW_NX; i++) RW_EACH_LANE y[i * RW_L + lane] = x[i * RW_L + lane] + h[lane] * sum[i * RW_L + lane];
}

typedef struct {
    double k[RW_DP54_STAGES + 1][RW_NX * RW_L] RW_ALIGNED; /* slopes; the first is known when a step starts */
    double y[RW_NX * RW_L] RW_ALIGNED;                     /* argument of the last stage: stiffness shows in it */
} rw_lane_explicit;

typedef struct {
    double w[RW_NW * RW_L] RW_ALIGNED, wt[RW_NW * RW_L] RW_ALIGNED;         /* stage variables at the start */
    double end_w[RW_NW * RW_L] RW_ALIGNED, end_wt[RW_NW * RW_L] RW_ALIGNED; /* and at the end of the step tried */
    double u[RW_RODAS5P_STAGES][RW_NX * RW_L] RW_ALIGNED;                   /* stages */
    long pivoted[RW_L];
} rw_lane_linear;

/* One step of Dormand and Prince from (t, x) to `next`, the end slope included. */
static inline void rw_lane_explicit_step(rw_lane_explicit *restrict work, const rw_lane_numbers *n, const double *restrict t,
                                         const double *restrict x, const double *restrict h, const double *restrict weight,
                                         double *restrict next, double *restrict norm)
{
    const rw_explicit_method *method = &rw_dp54;
    double time[RW_L] RW_ALIGNED, w[RW_NW * RW_L] RW_ALIGNED;
    for (int i = 1; i < RW_DP54_STAGES; i++) {
        const double node = method->nodes[i];
        RW_EACH_LANE time[lane] = t[lane] + node * h[lane];
        rw_member_stage_lanes(time, n->u, n->p, n->c, w);
        rw_lane_combine(method->a[i], i, (const double(*)[RW_NX * RW_L])work->k, h, x, work->y);
        rw_lane_rate(n, w, work->y, work->k[i]);
    }
    rw_lane_combine(method->weights, RW_DP54_STAGES, (const double(*)[RW_NX * RW_L])work->k, h, x, next);
    rw_lane_rate(n, w, next, work->k[RW_DP54_STAGES]); /* the last stage is at the step's end as well */
    double error[RW_NX * RW_L] RW_ALIGNED;
    for (int i = 0; i < RW_NX; i++) RW_EACH_LANE error[i * RW_L + lane] = 0.0;
    for (int j = 0; j <= RW_DP54_STAGES; j++) {
        const double e = method->error[0][j];
        if (e == 0.0) continue;
        for (int i = 0; i < RW_NX; i++) RW_EACH_LANE error[i * RW_L + lane] += e * work->k[j][i * RW_L + lane];
    }
    for (int i = 0; i < RW_NX; i++) RW_EACH_LANE error[i * RW_L + lane] *= h[lane];
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
static inline void rw_lane_factorize(double solve[RW_NX][RW_NQ * RW_L], long *pivoted, const double *restrict A, const double *restrict B,
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
    for (int lane = 0; lane < RW_L; lane++) {
        pivoted[lane] = dominance[lane] == 0.0;
        if (!pivoted[lane]) continue;
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
static inline void rw_lane_linear_step(rw_lane_linear *restrict work, const rw_lane_numbers *n, const double *restrict t,
                                       const double *restrict x, const double *restrict h, const double *restrict weight,
                                       double *restrict next, double *restrict norm)
{
    const rw_rosenbrock_method *method = &rw_rodas5p;
    double dx0[RW_NX * RW_L] RW_ALIGNED, at[RW_NQ * RW_L] RW_ALIGNED, solve[RW_NX][RW_NQ * RW_L] RW_ALIGNED;
    double s[RW_L] RW_ALIGNED, inverse_s[RW_L] RW_ALIGNED, inverse_h[RW_L] RW_ALIGNED, time[RW_L] RW_ALIGNED;
    RW_EACH_LANE {
        s[lane] = 1.0 / (h[lane] * method->gamma);
        inverse_s[lane] = h[lane] * method->gamma;
        inverse_h[lane] = 1.0 / h[lane];
    }
    {
        double r[5 * RW_L] RW_ALIGNED, S[2 * RW_L] RW_ALIGNED, G[6 * RW_L] RW_ALIGNED;
        double A[RW_NQ * RW_NQ * RW_L] RW_ALIGNED, B[RW_NQ * RW_NQ * RW_L] RW_ALIGNED;
        rw_member_relative_lanes(x, n->u, n->p, n->c, work->w, r);
        rw_lane_sums_and_slopes(n, work->w, r, S, G);
        for (int k = 0; k < RW_NQ; k++) RW_EACH_LANE dx0[k * RW_L + lane] = x[(RW_NQ + k) * RW_L + lane];
        rw_member_acceleration_lanes(x, S, n->u, n->p, n->c, work->w, dx0 + RW_NQ * RW_L);
        rw_member_acceleration_jacobian_lanes(x, S, G, n->u, n->p, n->c, work->w, A, B);
        rw_member_acceleration_rate_lanes(x, S, G, r, n->u, n->p, n->c, work->w, work->wt, at);
        rw_lane_factorize(solve, work->pivoted, A, B, s);
    }
    RW_EACH_LANE time[lane] = t[lane] + h[lane];
    rw_member_stage_rate_lanes(time, n->u, n->p, n->c, work->end_w, work->end_wt);
    for (int i = 0; i < RW_RODAS5P_STAGES; i++) {
        double y[RW_NX * RW_L] RW_ALIGNED, dx[RW_NX * RW_L] RW_ALIGNED, R[RW_NX * RW_L] RW_ALIGNED, w[RW_NW * RW_L] RW_ALIGNED;
        for (int k = 0; k < RW_NX; k++)
            RW_EACH_LANE {
                y[k * RW_L + lane] = x[k * RW_L + lane];
                R[k * RW_L + lane] = 0.0;
            }
        for (int j = 0; j < i; j++) {
            const double a = method->a[i][j], coupling = method->coupling[i][j];
            for (int k = 0; k < RW_NX; k++)
                RW_EACH_LANE {
                    y[k * RW_L + lane] += a * work->u[j][k * RW_L + lane];
                    R[k * RW_L + lane] += coupling * work->u[j][k * RW_L + lane];
                }
        }
        const double *slope = dx0;
        if (i > 0) {
            if (i <= method->inner) {
                const double node = method->nodes[i];
                RW_EACH_LANE time[lane] = t[lane] + node * h[lane];
                rw_member_stage_lanes(time, n->u, n->p, n->c, w);
            }
            rw_lane_rate(n, i <= method->inner ? w : work->end_w, y, dx);
            slope = dx;
        }
        for (int k = 0; k < RW_NX; k++) RW_EACH_LANE R[k * RW_L + lane] = R[k * RW_L + lane] * inverse_h[lane] + slope[k * RW_L + lane];
        const double d = method->time_weights[i];
        for (int k = 0; k < RW_NQ; k++) RW_EACH_LANE R[(RW_NQ + k) * RW_L + lane] += h[lane] * d * at[k * RW_L + lane];
        double kv[RW_NQ * RW_L] RW_ALIGNED;
        for (int k = 0; k < RW_NQ; k++) RW_EACH_LANE kv[k * RW_L + lane] = 0.0;
        for (int j = 0; j < RW_NX; j++)
            for (int k = 0; k < RW_NQ; k++) RW_EACH_LANE kv[k * RW_L + lane] += solve[j][k * RW_L + lane] * R[j * RW_L + lane];
        for (int k = 0; k < RW_NQ; k++)
            RW_EACH_LANE {
                work->u[i][(RW_NQ + k) * RW_L + lane] = kv[k * RW_L + lane];
                work->u[i][k * RW_L + lane] = (R[k * RW_L + lane] + kv[k * RW_L + lane]) * inverse_s[lane];
            }
    }
    double error[RW_NX * RW_L] RW_ALIGNED;
    for (int k = 0; k < RW_NX; k++)
        RW_EACH_LANE {
            next[k * RW_L + lane] = x[k * RW_L + lane];
            error[k * RW_L + lane] = 0.0;
        }
    for (int i = 0; i < RW_RODAS5P_STAGES; i++) {
        const double m = method->weights[i], e = method->error_weights[i];
        for (int k = 0; k < RW_NX; k++) RW_EACH_LANE next[k * RW_L + lane] += m * work->u[i][k * RW_L + lane];
        if (e != 0.0)
            for (int k = 0; k < RW_NX; k++) RW_EACH_LANE error[k * RW_L + lane] += e * work->u[i][k * RW_L + lane];
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
static inline void rw_lane_ball_channels(const rw_lane_numbers *n, const double *restrict t, const double *restrict x,
                                         double *restrict value)
{
    double w[RW_NW * RW_L] RW_ALIGNED, r[5 * RW_L] RW_ALIGNED;
    rw_member_cage_lanes(t, n->u, n->p, n->c, w);
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
