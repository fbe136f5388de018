/* One equilibrium of the rings: Newton's method with the generated Jacobian, and where it fails pseudo-transient continuation. */
#ifndef BALLPASS_REST_H
#define BALLPASS_REST_H

#include <float.h>
#include <string.h>

#include "elimination.h"

enum { BP_NEWTON_ITERATIONS = 16, BP_CONTINUATION_ITERATIONS = 400 };

/* Pivots smaller than this part of their row's largest entry are rounding: nothing holds a ring in that direction.  A ball that has just
   touched holds it with a slope that is the square root of its deflection: 1e-6 of the others' where it is 1e-12 of theirs. */
static const double BP_SINGULAR = 1e-12;

/* The model about a state at rest at time t: accelerations a, slopes A = da/dq, time derivative at. */
typedef struct {
    double a[BP_NQ], A[BP_NQ * BP_NQ], at[BP_NQ];
} bp_balance;

static inline void bp_balance_at(const bp_numbers *n, double t, const double *q, bp_balance *b)
{
    double w[BP_NW], wt[BP_NW], x[BP_NX] = {0.0}, dx[BP_NX], B[BP_NQ * BP_NQ];
    memcpy(x, q, BP_NQ * sizeof *x);
    bp_stage_rate(t, n->u, n->p, n->c, w, wt);
    bp_linearize(n, w, wt, x, dx, b->A, B, b->at);
    memcpy(b->a, dx + BP_NQ, BP_NQ * sizeof *b->a);
}

/* Solve (shift I - A) d = r; returns 0 where it is singular.  Rows are scaled, so that a light and a heavy ring count alike. */
static inline int bp_correction(const double *A, double shift, const double *r, double *d)
{
    double rows[BP_NQ][BP_NQ + 1];
    bp_shifted_rows(A, shift, r, rows);
    for (int i = 0; i < BP_NQ; i++) {
        double most = 0.0;
        for (int j = 0; j < BP_NQ; j++) most = fabs(rows[i][j]) > most ? fabs(rows[i][j]) : most;
        if (!(most > 0.0 && most <= DBL_MAX)) return 0;
        for (int j = 0; j <= BP_NQ; j++) rows[i][j] /= most;
    }
    return bp_eliminate(rows, BP_SINGULAR, d);
}

/* Whether a correction is within what is allowed; a NaN is not. */
static inline int bp_is_small(const double *d, const double *allowed)
{
    for (int k = 0; k < BP_NQ; k++)
        if (!(fabs(d[k]) <= allowed[k])) return 0;
    return 1;
}

/* Newton's method; the balance found with it is that of the position before the last, small correction is applied again. */
static inline int bp_newton(const bp_numbers *n, double t, const double *allowed, double *q, bp_balance *b, long *iterations)
{
    double size = DBL_MAX;
    for (int i = 0; i < BP_NEWTON_ITERATIONS; i++) {
        double d[BP_NQ];
        bp_balance_at(n, t, q, b);
        ++*iterations;
        const double reached = bp_length(b->a);
        if (!(reached <= 2.0 * size)) return 0;
        size = reached;
        if (!bp_correction(b->A, 0.0, b->a, d)) return 0;
        const int small = bp_is_small(d, allowed);
        for (int k = 0; k < BP_NQ; k++) q[k] += d[k];
        if (small) return 1;
    }
    return 0;
}

/* Position at time t whose acceleration vanishes, sought from q.  Returns 1 when found, with the velocity v of the equilibrium; else 0, with
   *is_free telling whether the load is balanced by a position that nothing holds.

   The continuation follows q' = a(q) with growing steps: where nothing touches it walks along the force, and where something does it
   becomes Newton's method (Kelley and Keyes, doi:10.1137/S0036142996304796). */
static inline int bp_rest(const bp_numbers *n, double t, const double *allowed, double *q, double *v, int *is_free, long *iterations)
{
    double start[BP_NQ];
    bp_balance b, there;
    *is_free = 0;
    memcpy(start, q, sizeof start);
    if (bp_newton(n, t, allowed, q, &b, iterations)) return bp_correction(b.A, 0.0, b.at, v);
    memcpy(q, start, sizeof start);
    bp_balance_at(n, t, q, &b);
    double size = bp_length(b.a), most = 0.0;
    for (int k = 0; k < BP_NQ; k++) most = fabs(q[k]) > most ? fabs(q[k]) : most;
    if (size == 0.0) {
        *is_free = 1;
        return 0;
    }
    const double first = size;
    /* the first step moves by a nanometre: well inside any clearance */
    double tau = 1e-9 * (1.0 + most) / size;
    for (int i = 0; i < BP_CONTINUATION_ITERATIONS; i++) {
        double d[BP_NQ], trial[BP_NQ];
        if (!bp_correction(b.A, 1.0 / tau, b.a, d)) return 0;
        for (int k = 0; k < BP_NQ; k++) trial[k] = q[k] + d[k];
        bp_balance_at(n, t, trial, &there);
        ++*iterations;
        const double reached = bp_length(there.a);
        if (!(reached <= DBL_MAX) || reached > 1.5 * size) {
            tau /= 8.0;
            continue;
        }
        memcpy(q, trial, sizeof trial);
        b = there;
        double gain = reached > 0.0 ? size / reached : 16.0;
        gain = gain < 1.0 ? 1.0 : gain > 16.0 ? 16.0 : gain;
        tau *= 4.0 * gain;
        size = reached;
        if (size <= 1e-4 * first) {
            memcpy(start, q, sizeof start);
            if (bp_newton(n, t, allowed, q, &b, iterations)) return bp_correction(b.A, 0.0, b.at, v);
            memcpy(q, start, sizeof start);
            bp_balance_at(n, t, q, &b);
            if (size <= 1e-12 * first) break;
        }
    }
    *is_free = !bp_correction(b.A, 0.0, b.a, v) && size <= 1e-6 * first;
    return 0;
}

#endif
