/* Explicit Runge-Kutta step (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6). */
#ifndef RACEWAY_EXPLICIT_H
#define RACEWAY_EXPLICIT_H

#include "methods.h"
#include "model.h"
#include "pace.h"

typedef struct {
    double k[RW_METHOD_STAGES][RW_NX]; /* slopes; the first is known when a step starts */
    double y[RW_NX];                   /* argument of the last stage: stiffness shows in it */
} rw_explicit;

static inline void rw_explicit_rate(const rw_numbers *n, double t, const double *restrict x, double *restrict dx)
{
    double w[RW_NW];
    rw_stage(t, n->u, n->p, n->c, w);
    rw_rate(n, w, x, dx);
}

static inline __attribute__((always_inline)) void rw_combine(const double *restrict row, int count, const double k[][RW_NX], double h,
                                                             const double *restrict x, double *restrict y)
{
    rw_state sum = {0.0};
    for (int j = 0; j < count; j++) {
        const double a = row[j];
        if (a == 0.0) continue;
        sum += a * RW_STATE(k[j]);
    }
    *(rw_state *)y = RW_STATE(x) + h * sum;
}

/* One step of size h from (t, x) to `next`, the end slope included; returns the scaled error.  Where `lead` is given the step has an
   uneven pace (pace.h), and all its slopes are by theta h, the first as well. */
static inline __attribute__((always_inline)) double rw_explicit_step(const rw_explicit_method *restrict method, const int stages,
                                                                      rw_explicit *restrict work, const rw_numbers *n, double t,
                                                                      const double *restrict x, double h, const double *restrict lead,
                                                                      const double *restrict weight, double *restrict next)
{
    /* all times of the step at once; the last stage and the end slope are both at its end */
    double w[RW_METHOD_STAGES][RW_NW], passed[RW_METHOD_STAGES];
    const double *nodes = method->nodes;
    if (lead) {
        for (int i = 1; i < stages; i++) passed[i] = rw_passed(*lead, method->nodes[i]);
        nodes = passed;
    }
    rw_stages(n, t, h, nodes + 1, stages - 1, w);
    /* the latest slope stays in registers and is added last: all else is ready before it is */
    double last[RW_NX], y[RW_NX];
    for (int k = 0; k < RW_NX; k++) last[k] = work->k[0][k];
    for (int i = 1; i <= stages; i++) {
        const double *restrict row = i < stages ? method->a[i] : method->weights;
        const double latest = h * row[i - 1];
        double base[RW_NX];
        rw_combine(row, i - 1, (const double(*)[RW_NX])work->k, h, x, base);
#pragma GCC unroll 16
        for (int k = 0; k < RW_NX; k++) y[k] = base[k] + latest * last[k];
        rw_rate(n, w[i < stages ? i - 1 : stages - 2], y, last);
        if (lead) {
            const double pace = rw_pace(*lead, i < stages ? method->nodes[i] : 1.0);
            for (int k = 0; k < RW_NX; k++) last[k] *= pace;
        }
#pragma GCC unroll 16
        for (int k = 0; k < RW_NX; k++) work->k[i][k] = last[k];
        if (i == stages - 1)
            for (int k = 0; k < RW_NX; k++) work->y[k] = y[k];
    }
    for (int k = 0; k < RW_NX; k++) next[k] = y[k];
    double first = 0.0, below = 0.0;
    for (int m = 0; m < method->estimates; m++) {
        double error[RW_NX];
        rw_state sum = {0.0};
        for (int j = 0; j <= stages; j++) {
            const double e = h * method->error[m][j];
            if (e == 0.0) continue;
            sum += e * RW_STATE(work->k[j]);
        }
        *(rw_state *)error = sum;
        const double norm = rw_norm(error, weight);
        if (m == 0) first = norm;
        below += method->error_share[m] * norm * norm;
    }
    return below > 0.0 ? first * first / sqrt(below) : first;
}

/* Product of step size and dominant eigenvalue, from the last two slopes at the step's end (section IV.2 of volume II). */
static inline double rw_explicit_stiffness(const rw_explicit *restrict work, int stages, double h, const double *restrict next,
                                           const double *restrict weight)
{
    double slopes[RW_NX], states[RW_NX];
    for (int i = 0; i < RW_NX; i++) {
        slopes[i] = work->k[stages][i] - work->k[stages - 1][i];
        states[i] = next[i] - work->y[i];
    }
    const double below = rw_norm(states, weight);
    return below > 0.0 ? h * rw_norm(slopes, weight) / below : 0.0;
}

/* Terms F1, F2, ... of the dense output of an accepted step; may take further slopes.  `lead` is the step's. */
static inline __attribute__((always_inline)) void rw_explicit_dense(const rw_explicit_method *restrict method, rw_explicit *restrict work,
                                                                     const rw_numbers *n, double t, const double *restrict x, double h,
                                                                     const double *restrict lead, const double *restrict next,
                                                                     double dense[RW_DENSE_ROWS][RW_NX])
{
    const int end = method->stages;
    if (method->dense_stages > 0) {
        double w[RW_METHOD_STAGES][RW_NW], passed[RW_METHOD_STAGES];
        const double *nodes = method->dense_nodes;
        if (lead) {
            for (int r = 0; r < method->dense_stages; r++) passed[r] = rw_passed(*lead, method->dense_nodes[r]);
            nodes = passed;
        }
        rw_stages(n, t, h, nodes, method->dense_stages, w);
        for (int r = 0; r < method->dense_stages; r++) {
            double y[RW_NX];
            rw_combine(method->dense_a[r], end + 1 + r, (const double(*)[RW_NX])work->k, h, x, y);
            rw_rate(n, w[r], y, work->k[end + 1 + r]);
            if (lead) {
                const double pace = rw_pace(*lead, method->dense_nodes[r]);
                for (int k = 0; k < RW_NX; k++) work->k[end + 1 + r][k] *= pace;
            }
        }
    }
    const rw_state delta = RW_STATE(next) - RW_STATE(x), first = h * RW_STATE(work->k[0]);
    *(rw_state *)dense[0] = first - delta;
    *(rw_state *)dense[1] = 2.0 * delta - (first + h * RW_STATE(work->k[end]));
    for (int row = 0; row < method->dense_rows; row++) {
        rw_state sum = {0.0};
        for (int j = 0; j < end + 1 + method->dense_stages; j++) {
            const double d = h * method->dense[row][j];
            if (d == 0.0) continue;
            sum += d * RW_STATE(work->k[j]);
        }
        *(rw_state *)dense[2 + row] = sum;
    }
}

/* y = x + theta (D + (1 - theta) (F1 + theta (F2 + (1 - theta) (F3 + ...)))). */
static inline __attribute__((always_inline)) void rw_explicit_at(const rw_explicit_method *restrict method,
                                                                  const double dense[RW_DENSE_ROWS][RW_NX], const double *restrict x,
                                                                  const double *restrict next, double theta, double *restrict y)
{
    rw_state inner = {0.0};
#pragma GCC unroll 16
    for (int row = 1 + method->dense_rows; row >= 0; row--)
        inner = (RW_STATE(dense[row]) + inner) * (row % 2 == 0 ? 1.0 - theta : theta);
    *(rw_state *)y = RW_STATE(x) + theta * (RW_STATE(next) - RW_STATE(x) + inner);
}

#endif
