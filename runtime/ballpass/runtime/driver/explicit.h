/* Explicit Runge-Kutta step (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6). */
#ifndef BALLPASS_EXPLICIT_H
#define BALLPASS_EXPLICIT_H

#include "methods.h"
#include "model.h"
#include "pace.h"

typedef struct {
    double k[BP_METHOD_STAGES][BP_NX]; /* slopes; the first is known when a step starts */
    double y[BP_NX];                   /* argument of the last stage: stiffness shows in it */
} bp_explicit;

static inline void bp_explicit_rate(const bp_numbers *n, double t, const double *restrict x, double *restrict dx)
{
    double w[BP_NW];
    bp_stage(t, n->u, n->p, n->c, w);
    bp_rate(n, w, x, dx);
}

static inline __attribute__((always_inline)) void bp_combine(const double *restrict row, int count, const double k[][BP_NX], double h,
                                                             const double *restrict x, double *restrict y)
{
    bp_state sum = {0.0};
    for (int j = 0; j < count; j++) {
        const double a = row[j];
        if (a == 0.0) continue;
        sum += a * BP_STATE(k[j]);
    }
    *(bp_state *)y = BP_STATE(x) + h * sum;
}

/* One step of size h from (t, x) to `next`, the end slope included; returns the scaled error.  Where `lead` is given the step has an
   uneven pace (pace.h), and all its slopes are by theta h, the first as well. */
static inline __attribute__((always_inline)) double bp_explicit_step(const bp_explicit_method *restrict method, const int stages,
                                                                      bp_explicit *restrict work, const bp_numbers *n, double t,
                                                                      const double *restrict x, double h, const double *restrict lead,
                                                                      const double *restrict weight, double *restrict next)
{
    /* all times of the step at once; the last stage and the end slope are both at its end */
    double w[BP_METHOD_STAGES][BP_NW], passed[BP_METHOD_STAGES];
    const double *nodes = method->nodes;
    if (lead) {
        for (int i = 1; i < stages; i++) passed[i] = bp_passed(*lead, method->nodes[i]);
        nodes = passed;
    }
    bp_stages(n, t, h, nodes + 1, stages - 1, w);
    /* the latest slope stays in registers and is added last: all else is ready before it is */
    double last[BP_NX], y[BP_NX];
    for (int k = 0; k < BP_NX; k++) last[k] = work->k[0][k];
    for (int i = 1; i <= stages; i++) {
        const double *restrict row = i < stages ? method->a[i] : method->weights;
        const double latest = h * row[i - 1];
        double base[BP_NX];
        bp_combine(row, i - 1, (const double(*)[BP_NX])work->k, h, x, base);
#pragma GCC unroll 16
        for (int k = 0; k < BP_NX; k++) y[k] = base[k] + latest * last[k];
        bp_rate(n, w[i < stages ? i - 1 : stages - 2], y, last);
        if (lead) {
            const double pace = bp_pace(*lead, i < stages ? method->nodes[i] : 1.0);
            for (int k = 0; k < BP_NX; k++) last[k] *= pace;
        }
#pragma GCC unroll 16
        for (int k = 0; k < BP_NX; k++) work->k[i][k] = last[k];
        if (i == stages - 1)
            for (int k = 0; k < BP_NX; k++) work->y[k] = y[k];
    }
    for (int k = 0; k < BP_NX; k++) next[k] = y[k];
    double first = 0.0, below = 0.0;
    for (int m = 0; m < method->estimates; m++) {
        double error[BP_NX];
        bp_state sum = {0.0};
        for (int j = 0; j <= stages; j++) {
            const double e = h * method->error[m][j];
            if (e == 0.0) continue;
            sum += e * BP_STATE(work->k[j]);
        }
        *(bp_state *)error = sum;
        const double norm = bp_norm(error, weight);
        if (m == 0) first = norm;
        below += method->error_share[m] * norm * norm;
    }
    return below > 0.0 ? first * first / sqrt(below) : first;
}

/* Product of step size and dominant eigenvalue, from the last two slopes at the step's end (section IV.2 of volume II). */
static inline double bp_explicit_stiffness(const bp_explicit *restrict work, int stages, double h, const double *restrict next,
                                           const double *restrict weight)
{
    double slopes[BP_NX], states[BP_NX];
    for (int i = 0; i < BP_NX; i++) {
        slopes[i] = work->k[stages][i] - work->k[stages - 1][i];
        states[i] = next[i] - work->y[i];
    }
    const double below = bp_norm(states, weight);
    return below > 0.0 ? h * bp_norm(slopes, weight) / below : 0.0;
}

/* Terms F1, F2, ... of the dense output of an accepted step; may take further slopes.  `lead` is the step's. */
static inline __attribute__((always_inline)) void bp_explicit_dense(const bp_explicit_method *restrict method, bp_explicit *restrict work,
                                                                     const bp_numbers *n, double t, const double *restrict x, double h,
                                                                     const double *restrict lead, const double *restrict next,
                                                                     double dense[BP_DENSE_ROWS][BP_NX])
{
    const int end = method->stages;
    if (method->dense_stages > 0) {
        double w[BP_METHOD_STAGES][BP_NW], passed[BP_METHOD_STAGES];
        const double *nodes = method->dense_nodes;
        if (lead) {
            for (int r = 0; r < method->dense_stages; r++) passed[r] = bp_passed(*lead, method->dense_nodes[r]);
            nodes = passed;
        }
        bp_stages(n, t, h, nodes, method->dense_stages, w);
        for (int r = 0; r < method->dense_stages; r++) {
            double y[BP_NX];
            bp_combine(method->dense_a[r], end + 1 + r, (const double(*)[BP_NX])work->k, h, x, y);
            bp_rate(n, w[r], y, work->k[end + 1 + r]);
            if (lead) {
                const double pace = bp_pace(*lead, method->dense_nodes[r]);
                for (int k = 0; k < BP_NX; k++) work->k[end + 1 + r][k] *= pace;
            }
        }
    }
    const bp_state delta = BP_STATE(next) - BP_STATE(x), first = h * BP_STATE(work->k[0]);
    *(bp_state *)dense[0] = first - delta;
    *(bp_state *)dense[1] = 2.0 * delta - (first + h * BP_STATE(work->k[end]));
    for (int row = 0; row < method->dense_rows; row++) {
        bp_state sum = {0.0};
        for (int j = 0; j < end + 1 + method->dense_stages; j++) {
            const double d = h * method->dense[row][j];
            if (d == 0.0) continue;
            sum += d * BP_STATE(work->k[j]);
        }
        *(bp_state *)dense[2 + row] = sum;
    }
}

/* y = x + theta (D + (1 - theta) (F1 + theta (F2 + (1 - theta) (F3 + ...)))). */
static inline __attribute__((always_inline)) void bp_explicit_at(const bp_explicit_method *restrict method,
                                                                  const double dense[BP_DENSE_ROWS][BP_NX], const double *restrict x,
                                                                  const double *restrict next, double theta, double *restrict y)
{
    bp_state inner = {0.0};
#pragma GCC unroll 16
    for (int row = 1 + method->dense_rows; row >= 0; row--)
        inner = (BP_STATE(dense[row]) + inner) * (row % 2 == 0 ? 1.0 - theta : theta);
    *(bp_state *)y = BP_STATE(x) + theta * (BP_STATE(next) - BP_STATE(x) + inner);
}

#endif
