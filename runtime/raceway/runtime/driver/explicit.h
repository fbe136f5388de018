/* Explicit Runge-Kutta step (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6). */
#ifndef RACEWAY_EXPLICIT_H
#define RACEWAY_EXPLICIT_H

#include "methods.h"
#include "model.h"

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
    for (int i = 0; i < RW_NX; i++) y[i] = 0.0;
    for (int j = 0; j < count; j++) {
        const double a = row[j];
        if (a == 0.0) continue;
        for (int i = 0; i < RW_NX; i++) y[i] += a * k[j][i];
    }
    for (int i = 0; i < RW_NX; i++) y[i] = x[i] + h * y[i];
}

/* One step of size h from (t, x) to `next`, the end slope included; returns the scaled error. */
static inline __attribute__((always_inline)) double rw_explicit_step(const rw_explicit_method *restrict method, const int stages,
                                                                      rw_explicit *restrict work, const rw_numbers *n, double t,
                                                                      const double *restrict x, double h,
                                                                      const double *restrict weight, double *restrict next)
{
    /* all times of the step at once; the last stage and the end slope are both at its end */
    double w[RW_METHOD_STAGES][RW_NW];
    rw_stages(n, t, h, method->nodes + 1, stages - 1, w);
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
#pragma GCC unroll 16
        for (int k = 0; k < RW_NX; k++) work->k[i][k] = last[k];
        if (i == stages - 1)
            for (int k = 0; k < RW_NX; k++) work->y[k] = y[k];
    }
    for (int k = 0; k < RW_NX; k++) next[k] = y[k];
    double first = 0.0, below = 0.0;
    for (int m = 0; m < method->estimates; m++) {
        double error[RW_NX];
        for (int i = 0; i < RW_NX; i++) error[i] = 0.0;
        for (int j = 0; j <= stages; j++) {
            const double e = h * method->error[m][j];
            if (e == 0.0) continue;
            for (int i = 0; i < RW_NX; i++) error[i] += e * work->k[j][i];
        }
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

/* Terms F1, F2, ... of the dense output of an accepted step; may take further slopes. */
static inline void rw_explicit_dense(const rw_explicit_method *restrict method, rw_explicit *restrict work, const rw_numbers *n, double t,
                                     const double *restrict x, double h, const double *restrict next,
                                     double dense[RW_DENSE_ROWS][RW_NX])
{
    const int end = method->stages;
    for (int r = 0; r < method->dense_stages; r++) {
        double y[RW_NX];
        rw_combine(method->dense_a[r], end + 1 + r, (const double(*)[RW_NX])work->k, h, x, y);
        rw_explicit_rate(n, t + method->dense_nodes[r] * h, y, work->k[end + 1 + r]);
    }
    for (int i = 0; i < RW_NX; i++) {
        const double delta = next[i] - x[i];
        dense[0][i] = h * work->k[0][i] - delta;
        dense[1][i] = 2.0 * delta - h * (work->k[0][i] + work->k[end][i]);
    }
    for (int row = 0; row < method->dense_rows; row++) {
        for (int i = 0; i < RW_NX; i++) dense[2 + row][i] = 0.0;
        for (int j = 0; j < end + 1 + method->dense_stages; j++) {
            const double d = h * method->dense[row][j];
            if (d == 0.0) continue;
            for (int i = 0; i < RW_NX; i++) dense[2 + row][i] += d * work->k[j][i];
        }
    }
}

/* y = x + theta (D + (1 - theta) (F1 + theta (F2 + (1 - theta) (F3 + ...)))). */
static inline void rw_explicit_at(const rw_explicit_method *restrict method, const double dense[RW_DENSE_ROWS][RW_NX],
                                  const double *restrict x, const double *restrict next, double theta, double *restrict y)
{
    const int terms = 2 + method->dense_rows;
    for (int i = 0; i < RW_NX; i++) {
        double inner = 0.0;
        for (int row = terms - 1; row >= 0; row--) inner = (dense[row][i] + inner) * (row % 2 == 0 ? 1.0 - theta : theta);
        y[i] = x[i] + theta * (next[i] - x[i] + inner);
    }
}

#endif
