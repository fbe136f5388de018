/* The methods for a member of an ensemble in each SIMD lane; see explicit.h and rosenbrock.h for one member, lane_model.h for the model. */
#ifndef BALLPASS_LANES_H
#define BALLPASS_LANES_H

#include <stdint.h>
#include <string.h>

#include "control.h"
#include "lane_model.h"

/* Bits of a number in each lane. */
typedef union {
    double value[BP_L];
    uint64_t bits[BP_L];
} bp_lane_bits;

/* Natural logarithm of positive numbers and exponential of moderate ones without branches and tables, for the step size controller: to
   1e-11, and the same in every lane. */
static inline void bp_lane_log(const double *restrict x, double *restrict y)
{
    bp_lane_bits from BP_ALIGNED, exponent BP_ALIGNED, fraction BP_ALIGNED;
    BP_EACH_LANE from.value[lane] = x[lane] * 1.4142135623730951; /* so that the fraction is about one */
    BP_EACH_LANE exponent.bits[lane] = (from.bits[lane] >> 52) | UINT64_C(0x4330000000000000);
    BP_EACH_LANE fraction.bits[lane] = (from.bits[lane] & UINT64_C(0xFFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000);
    BP_EACH_LANE {
        const double m = fraction.value[lane] * 0.7071067811865476, s = (m - 1.0) / (m + 1.0), z = s * s, zz = z * z;
        /* in pairs: the next step waits for it */
        const double low = (1.0 + z * (1.0 / 3)) + zz * (1.0 / 5 + z * (1.0 / 7));
        const double series = low + zz * zz * ((1.0 / 9 + z * (1.0 / 11)) + zz * (1.0 / 13));
        y[lane] = (exponent.value[lane] - (4503599627370496.0 + 1023.0)) * 0.6931471805599453 + 2.0 * s * series;
    }
}

static inline void bp_lane_exp(const double *restrict x, double *restrict y)
{
    bp_lane_bits shifted BP_ALIGNED, power BP_ALIGNED;
    double series[BP_L] BP_ALIGNED;
    BP_EACH_LANE {
        /* adding 1.5 * 2^52 rounds to a whole number and puts it into the low bits */
        const double bounded = x[lane] > 40.0 ? 40.0 : x[lane], z = bounded < -40.0 ? -40.0 : bounded;
        shifted.value[lane] = z * 1.4426950408889634 + 6755399441055744.0;
        const double r = z - (shifted.value[lane] - 6755399441055744.0) * 0.6931471805599453, rr = r * r;
        const double low = (1.0 + r) + rr * (1.0 / 2 + r * (1.0 / 6));
        const double high = (1.0 / 24 + r * (1.0 / 120)) + rr * ((1.0 / 720 + r * (1.0 / 5040)) + rr * (1.0 / 40320 + r * (1.0 / 362880)));
        series[lane] = low + rr * rr * high;
    }
    BP_EACH_LANE power.bits[lane] = (shifted.bits[lane] + UINT64_C(1023)) << 52;
    BP_EACH_LANE y[lane] = series[lane] * power.value[lane];
}

/* Root mean square of an error over its tolerance. */
BP_INLINE void bp_lane_norm(const double *restrict error, const double *restrict weight, double *restrict norm)
{
    BP_EACH_LANE norm[lane] = 0.0;
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE {
            const double e = error[k * BP_L + lane] * weight[k * BP_L + lane];
            norm[lane] += e * e;
        }
    BP_EACH_LANE norm[lane] = sqrt(norm[lane] / (double)BP_NX);
}

/* y = x + h sum of row[j] k[j]; the latest slope is added last.  Entry by entry: the sum stays in a register. */
BP_INLINE void bp_lane_combine(const double *restrict row, const int count, const double k[][BP_NX * BP_L], const double *restrict h,
                               const double *restrict x, double *restrict y)
{
    for (int i = 0; i < BP_NX; i++)
        BP_EACH_LANE {
            double sum = 0.0;
#pragma GCC unroll 16
            for (int j = 0; j < count; j++) sum += row[j] != 0.0 ? row[j] * k[j][i * BP_L + lane] : 0.0;
            y[i * BP_L + lane] = x[i * BP_L + lane] + h[lane] * sum;
        }
}

typedef struct {
    double k[BP_DP54_STAGES + 1][BP_NX * BP_L] BP_ALIGNED; /* slopes; the first is known when a step starts */
    double y[BP_NX * BP_L] BP_ALIGNED;                     /* argument of the last stage: stiffness shows in it */
} bp_lane_explicit;

typedef struct {
    double w[BP_NW * BP_L] BP_ALIGNED, wt[BP_NW * BP_L] BP_ALIGNED;         /* stage variables at the start */
    double end_w[BP_NW * BP_L] BP_ALIGNED, end_wt[BP_NW * BP_L] BP_ALIGNED; /* and at the end of the step tried */
    double u[BP_RODAS5P_STAGES][BP_NX * BP_L] BP_ALIGNED;                   /* stages */
    double A[BP_NQ * BP_NQ * BP_L] BP_ALIGNED, B[BP_NQ * BP_NQ * BP_L] BP_ALIGNED; /* of the step tried */
    double pivoted[BP_L] BP_ALIGNED; /* whether its system was solved with pivoting */
} bp_lane_linear;

/* One step of Dormand and Prince from (t, x) to `next`, the end slope included. */
static inline void bp_lane_explicit_step(bp_lane_explicit *restrict work, const bp_lane_numbers *n, bp_lane_angles *restrict angles,
                                         const double *restrict t, const double *restrict x, const double *restrict h,
                                         const double *restrict weight, double *restrict next, double *restrict norm)
{
    const bp_explicit_method *method = &bp_dp54;
    double w[BP_DP54_STAGES][BP_NW * BP_L] BP_ALIGNED;
    bp_lane_angles_start(angles, n, t, h);
    /* all times of the step first: nothing in them waits for a slope.  The last stage and the end slope are both at its end */
#pragma GCC unroll 16
    for (int i = 1; i <= BP_DP54_STAGES; i++) {
        if (i < BP_DP54_STAGES) bp_lane_stage(n, angles, method->nodes[i], t, h, w[i]);
        const double *row = i < BP_DP54_STAGES ? method->a[i] : method->weights;
        double *restrict y = i < BP_DP54_STAGES ? work->y : next;
        bp_lane_combine(row, i, (const double(*)[BP_NX * BP_L])work->k, h, x, y);
        bp_lane_rate(n, w[i < BP_DP54_STAGES ? i : BP_DP54_STAGES - 1], y, work->k[i]);
    }
    double error[BP_NX * BP_L] BP_ALIGNED;
    for (int i = 0; i < BP_NX; i++)
        BP_EACH_LANE {
            double sum = 0.0;
#pragma GCC unroll 16
            for (int j = 0; j <= BP_DP54_STAGES; j++)
                sum += method->error[0][j] != 0.0 ? method->error[0][j] * work->k[j][i * BP_L + lane] : 0.0;
            error[i * BP_L + lane] = h[lane] * sum;
        }
    bp_lane_norm(error, weight, norm);
}

/* Product of step size and dominant eigenvalue, from the last two slopes at the step's end. */
static inline void bp_lane_stiffness(const bp_lane_explicit *restrict work, const double *restrict h, const double *restrict next,
                                     const double *restrict weight, double *restrict reach)
{
    double slopes[BP_NX * BP_L] BP_ALIGNED, states[BP_NX * BP_L] BP_ALIGNED, below[BP_L] BP_ALIGNED;
    for (int i = 0; i < BP_NX * BP_L; i++) {
        slopes[i] = work->k[BP_DP54_STAGES][i] - work->k[BP_DP54_STAGES - 1][i];
        states[i] = next[i] - work->y[i];
    }
    bp_lane_norm(states, weight, below);
    bp_lane_norm(slopes, weight, reach);
    BP_EACH_LANE reach[lane] = below[lane] > 0.0 ? h[lane] * reach[lane] / below[lane] : 0.0;
}

/* Columns of [W^-1 A/s | W^-1] for every lane, by Gauss-Jordan elimination without pivoting; a lane whose W is not dominated by its
   diagonal is done anew by itself, with pivoting.  A singular W makes its lane's step not a number. */
static inline void bp_lane_factorize(double solve[BP_NX][BP_NQ * BP_L], double *restrict pivoted, const double *restrict A, const double *restrict B,
                                     const double *restrict s)
{
    double rows[BP_NQ][3 * BP_NQ][BP_L] BP_ALIGNED, dominance[BP_L] BP_ALIGNED, inverse[BP_L] BP_ALIGNED;
    BP_EACH_LANE inverse[lane] = 1.0 / s[lane];
    BP_EACH_LANE dominance[lane] = 1.0;
    for (int i = 0; i < BP_NQ; i++) {
        double rest[BP_L] BP_ALIGNED = {0.0};
        for (int j = 0; j < BP_NQ; j++)
            BP_EACH_LANE {
                const double scaled = A[(i * BP_NQ + j) * BP_L + lane] * inverse[lane];
                const double entry = (i == j ? s[lane] : 0.0) - B[(i * BP_NQ + j) * BP_L + lane] - scaled;
                rows[i][j][lane] = entry;
                rows[i][BP_NQ + j][lane] = scaled;
                rows[i][2 * BP_NQ + j][lane] = i == j ? 1.0 : 0.0;
                rest[lane] += i != j ? fabs(entry) : 0.0;
            }
        BP_EACH_LANE dominance[lane] = fabs(rows[i][i][lane]) >= rest[lane] ? dominance[lane] : 0.0;
    }
    for (int k = 0; k < BP_NQ; k++) {
        double pivot[BP_L] BP_ALIGNED;
        BP_EACH_LANE pivot[lane] = 1.0 / rows[k][k][lane];
        for (int j = k + 1; j < 3 * BP_NQ; j++) BP_EACH_LANE rows[k][j][lane] *= pivot[lane];
        for (int i = 0; i < BP_NQ; i++) {
            if (i == k) continue;
            double factor[BP_L] BP_ALIGNED;
            BP_EACH_LANE factor[lane] = rows[i][k][lane];
            for (int j = k + 1; j < 3 * BP_NQ; j++) BP_EACH_LANE rows[i][j][lane] -= factor[lane] * rows[k][j][lane];
        }
    }
    for (int j = 0; j < BP_NX; j++)
        for (int i = 0; i < BP_NQ; i++) BP_EACH_LANE solve[j][i * BP_L + lane] = rows[i][BP_NQ + j][lane];
    BP_EACH_LANE pivoted[lane] = 1.0 - dominance[lane];
    for (int lane = 0; lane < BP_L; lane++) {
        if (dominance[lane] != 0.0) continue;
        double own_A[BP_NQ * BP_NQ], own_B[BP_NQ * BP_NQ];
        bp_matrix matrix;
        for (int k = 0; k < BP_NQ * BP_NQ; k++) {
            own_A[k] = A[k * BP_L + lane];
            own_B[k] = B[k * BP_L + lane];
        }
        const int regular = bp_factorize(&matrix, own_A, own_B, s[lane]);
        for (int j = 0; j < BP_NX; j++)
            for (int i = 0; i < BP_NQ; i++) solve[j][i * BP_L + lane] = regular ? matrix.solve[j][i] : NAN;
    }
}

/* One step of Rodas5P from (t, x) to `next`; linearizes at its start, where w and wt hold. */
static inline void bp_lane_linear_step(bp_lane_linear *restrict work, const bp_lane_numbers *n, bp_lane_angles *restrict angles,
                                       const double *restrict t, const double *restrict x, const double *restrict h,
                                       const double *restrict weight, double *restrict next, double *restrict norm)
{
    const bp_rosenbrock_method *method = &bp_rodas5p;
    double dx0[BP_NX * BP_L] BP_ALIGNED, at[BP_NQ * BP_L] BP_ALIGNED, solve[BP_NX][BP_NQ * BP_L] BP_ALIGNED;
    double s[BP_L] BP_ALIGNED, inverse_s[BP_L] BP_ALIGNED, inverse_h[BP_L] BP_ALIGNED, w[BP_RODAS5P_STAGES][BP_NW * BP_L] BP_ALIGNED;
    bp_lane_angles_start(angles, n, t, h);
    BP_EACH_LANE {
        s[lane] = 1.0 / (h[lane] * method->gamma);
        inverse_s[lane] = h[lane] * method->gamma;
        inverse_h[lane] = 1.0 / h[lane];
    }
    {
        double r[5 * BP_L] BP_ALIGNED, S[2 * BP_L] BP_ALIGNED, G[6 * BP_L] BP_ALIGNED;
        bp_member_relative_lanes(x, n->u, n->p, n->c, work->w, r);
        bp_lane_sums_and_slopes(n, work->w, r, S, G);
        for (int k = 0; k < BP_NQ; k++) BP_EACH_LANE dx0[k * BP_L + lane] = x[(BP_NQ + k) * BP_L + lane];
        bp_member_acceleration_lanes(x, S, n->u, n->p, n->c, work->w, dx0 + BP_NQ * BP_L);
        bp_member_acceleration_jacobian_lanes(x, S, G, n->u, n->p, n->c, work->w, work->A, work->B);
        bp_member_acceleration_rate_lanes(x, S, G, r, n->u, n->p, n->c, work->w, work->wt, at);
        bp_lane_factorize(solve, work->pivoted, work->A, work->B, s);
    }
    /* the times inside the step, and its end, which serves several stages and the next step, with the time derivative */
    {
        double C[BP_NA * BP_L] BP_ALIGNED, S[BP_NA * BP_L] BP_ALIGNED, time[BP_L] BP_ALIGNED;
        bp_lane_turn(angles, 1.0, t, h, C, S, time);
        bp_member_stage_rate_turned_lanes(C, S, angles->rate, time, n->u, n->p, n->c, work->end_w, work->end_wt);
    }
#pragma GCC unroll 16
    for (int i = 0; i < BP_RODAS5P_STAGES; i++) {
        double y[BP_NX * BP_L] BP_ALIGNED, dx[BP_NX * BP_L] BP_ALIGNED, R[BP_NX * BP_L] BP_ALIGNED;
        for (int k = 0; k < BP_NX; k++)
            BP_EACH_LANE {
                double reached = x[k * BP_L + lane], coupled = 0.0;
#pragma GCC unroll 16
                for (int j = 0; j < i; j++) {
                    const double stage = work->u[j][k * BP_L + lane];
                    reached += method->a[i][j] * stage;
                    coupled += method->coupling[i][j] * stage;
                }
                y[k * BP_L + lane] = reached;
                R[k * BP_L + lane] = coupled * inverse_h[lane];
            }
        if (i>0 && i <= method->inner) bp_lane_stage(n, angles, method->nodes[i], t, h, w[i]);
        if (i > 0) bp_lane_rate(n, i <= method->inner ? w[i] : work->end_w, y, dx);
        const double *slope = i > 0 ? dx : dx0;
        const double d = method->time_weights[i];
        for (int k = 0; k < BP_NX; k++)
            BP_EACH_LANE R[k * BP_L + lane] += k < BP_NQ ? slope[k * BP_L + lane]
                                                         : slope[k * BP_L + lane] + h[lane] * d * at[(k - BP_NQ) * BP_L + lane];
        for (int k = 0; k < BP_NQ; k++)
            BP_EACH_LANE {
                double kv = 0.0;
#pragma GCC unroll 16
                for (int j = 0; j < BP_NX; j++) kv += solve[j][k * BP_L + lane] * R[j * BP_L + lane];
                work->u[i][(BP_NQ + k) * BP_L + lane] = kv;
                work->u[i][k * BP_L + lane] = (R[k * BP_L + lane] + kv) * inverse_s[lane];
            }
    }
    double error[BP_NX * BP_L] BP_ALIGNED;
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE {
            double end = x[k * BP_L + lane], estimate = 0.0;
#pragma GCC unroll 16
            for (int i = 0; i < BP_RODAS5P_STAGES; i++) {
                end += method->weights[i] * work->u[i][k * BP_L + lane];
                estimate += method->error_weights[i] != 0.0 ? method->error_weights[i] * work->u[i][k * BP_L + lane] : 0.0;
            }
            next[k * BP_L + lane] = end;
            error[k * BP_L + lane] = estimate;
        }
    bp_lane_norm(error, weight, norm);
}

/* Terms of the dense output, as in bp_explicit_dense. */
static inline void bp_lane_explicit_dense(const bp_lane_explicit *restrict work, const double *restrict x, const double *restrict h,
                                          const double *restrict next, double dense[BP_DENSE_ROWS][BP_NX * BP_L])
{
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            const double delta = next[i] - x[i];
            dense[0][i] = h[lane] * work->k[0][i] - delta;
            dense[1][i] = 2.0 * delta - h[lane] * (work->k[0][i] + work->k[BP_DP54_STAGES][i]);
        }
    for (int row = 0; row < bp_dp54.dense_rows; row++) {
        double *restrict sum = dense[2 + row];
        for (int i = 0; i < BP_NX * BP_L; i++) sum[i] = 0.0;
        for (int j = 0; j <= BP_DP54_STAGES; j++) {
            const double d = bp_dp54.dense[row][j];
            if (d == 0.0) continue;
            for (int i = 0; i < BP_NX * BP_L; i++) sum[i] += d * work->k[j][i];
        }
        for (int k = 0; k < BP_NX; k++) BP_EACH_LANE sum[k * BP_L + lane] *= h[lane];
    }
}

static inline void bp_lane_linear_dense(const bp_lane_linear *restrict work, double dense[BP_DENSE_ROWS][BP_NX * BP_L])
{
    for (int row = 0; row < bp_rodas5p.dense_rows; row++) {
        double *restrict sum = dense[row];
        for (int i = 0; i < BP_NX * BP_L; i++) sum[i] = 0.0;
        for (int j = 0; j < BP_RODAS5P_STAGES; j++) {
            const double d = bp_rodas5p.dense[row][j];
            for (int i = 0; i < BP_NX * BP_L; i++) sum[i] += d * work->u[j][i];
        }
    }
}

/* Entry of the state at theta, from its terms of the dense output `stride` apart; see bp_explicit_at and bp_rosenbrock_at. */
BP_INLINE double bp_explicit_entry(const double *restrict dense, int stride, double x, double next, double theta)
{
    double inner = 0.0;
    for (int row = 1 + bp_dp54.dense_rows; row >= 0; row--) inner = (dense[row * stride] + inner) * (row % 2 == 0 ? 1.0 - theta : theta);
    return x + theta * (next - x + inner);
}

BP_INLINE double bp_linear_entry(const double *restrict dense, int stride, double x, double next, double theta)
{
    double inner = 0.0;
    for (int row = bp_rodas5p.dense_rows - 1; row >= 0; row--) inner = dense[row * stride] + (row < bp_rodas5p.dense_rows - 1 ? theta * inner : 0.0);
    return x + theta * (next - x + (1.0 - theta) * inner);
}

#endif
