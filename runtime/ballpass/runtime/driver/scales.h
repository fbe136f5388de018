/* Magnitudes of the states of a run, from its most loaded moments, as in ballpass.runtime.request.magnitudes, for one member after another. */
#ifndef BALLPASS_SCALES_H
#define BALLPASS_SCALES_H

#include <float.h>
#include <string.h>

#include "model.h"

enum { BP_LOADED_MOMENTS = 3, BP_ITERATIONS = 80 };

static const double BP_SOFT = 10.0, BP_ROUNDED_AWAY = 1e9, BP_RADIAN = 1.0;

/* Numbers of a moment.  No side of a law is held. */
static inline bp_numbers bp_numbers_at(const double *u, const double *p, const double *c)
{
#ifdef BALLPASS_LOCATED
    static const double released[BP_EVENTS] = {0.0};
    return (bp_numbers){.u = u, .p = p, .c = c, .border = released};
#else
    return (bp_numbers){.u = u, .p = p, .c = c};
#endif
}

/* A state at rest, moment i of so many: angles are spread over a turn, and keep their velocities. */
static inline void bp_at_moment(const double *rest, long i, long moments, double *x)
{
    for (int k = 0; k < BP_NX; k++) x[k] = rest[k];
    for (int k = 0; k < BP_NQ; k++)
        if (bp_is_angle[k]) x[k] += 6.283185307179586 * (double)i / (double)moments;
}

static inline double bp_length(const double *v)
{
    double sum = 0.0;
    for (int k = 0; k < BP_NQ; k++) sum += v[k] * v[k];
    return sqrt(sum);
}

/* The rows of (shift I - A) d = r, right-hand sides last. */
static inline void bp_shifted_rows(const double *A, double shift, const double *r, double rows[][BP_NQ + 1])
{
    for (int i = 0; i < BP_NQ; i++) {
        for (int j = 0; j < BP_NQ; j++) rows[i][j] = (i == j ? shift : 0.0) - A[i * BP_NQ + j];
        rows[i][BP_NQ] = r[i];
    }
}

/* Solve rows with their right-hand sides last, which are overwritten; returns 0 where a pivot is zero, or no number. */
static inline int bp_eliminate(double rows[][BP_NQ + 1], double *d)
{
    for (int k = 0; k < BP_NQ; k++) {
        int best = k;
        for (int i = k + 1; i < BP_NQ; i++)
            if (fabs(rows[i][k]) > fabs(rows[best][k])) best = i;
        if (!(fabs(rows[best][k]) > 0.0)) return 0;
        for (int j = 0; j <= BP_NQ; j++) {
            const double swap = rows[k][j];
            rows[k][j] = rows[best][j];
            rows[best][j] = swap;
        }
        for (int i = k + 1; i < BP_NQ; i++) {
            const double factor = rows[i][k] / rows[k][k];
            for (int j = k; j <= BP_NQ; j++) rows[i][j] -= factor * rows[k][j];
        }
    }
    for (int i = BP_NQ - 1; i >= 0; i--) {
        d[i] = rows[i][BP_NQ];
        for (int j = i + 1; j < BP_NQ; j++) d[i] -= rows[i][j] * d[j];
        d[i] /= rows[i][i];
    }
    return 1;
}

/* Accelerations and their slopes by position at a state, t = 0. */
static inline void bp_field(const bp_numbers *n, const double *x, double *a, double *A)
{
    double w[BP_NW], wt[BP_NW], dx[BP_NX], B[BP_NQ * BP_NQ], at[BP_NQ];
    bp_stage_rate(0.0, n->u, n->p, n->c, w, wt);
    bp_linearize(n, w, wt, x, dx, A, B, at);
    memcpy(a, dx + BP_NQ, BP_NQ * sizeof *a);
}

static inline double bp_largest(const double *v)
{
    double most = 0.0;
    for (int k = 0; k < BP_NQ; k++) most = fabs(v[k]) > most ? fabs(v[k]) : most;
    return most;
}

/* Masses of the coordinates that a force through the balls accelerates. */
static inline void bp_masses(const bp_numbers *n, double *mass)
{
    const double force = 1e12, x[BP_NX] = {0.0};
    double both[BP_NS], none[BP_NS]; /* of length zero without bearings */
    double w[BP_NW], r[BP_NR], a[BP_NQ], b[BP_NQ];
    for (int k = 0; k < BP_NS; k++) both[k] = force, none[k] = 0.0;
    bp_stage(0.0, n->u, n->p, n->c, w);
    bp_relative(x, n->u, n->p, n->c, w, r);
    bp_acceleration(x, none, r, n->u, n->p, n->c, w, a);
    bp_acceleration(x, both, r, n->u, n->p, n->c, w, b);
    for (int k = 0; k < BP_NQ; k++) mass[k] = bp_is_angle[k] ? 1.0 : force / fabs(b[k] - a[k]);
}

/* Coordinates of a group share a magnitude (bp_group); of one that has a partner (bp_partner) the difference counts. */
static inline double bp_largest_of(const double *v, int group)
{
    double most = 0.0;
    for (int k = 0; k < BP_NQ; k++)
        if (bp_group[k] == group && fabs(v[k]) > most) most = fabs(v[k]);
    return most;
}

static inline int bp_has_partners(int group)
{
    int found = 0;
    for (int k = 0; k < BP_NQ; k++) found |= bp_group[k] == group && bp_partner[k] >= 0;
    return found;
}

/* Largest difference between coordinates of a group and their partners. */
static inline double bp_apart(const double *x, int group)
{
    double most = 0.0;
    for (int k = 0; k < BP_NQ; k++) {
        const int partner = bp_partner[k];
        const double between = fabs(x[k] - (partner >= 0 ? x[partner] : 0.0));
        if (bp_group[k] == group && between > most) most = between;
    }
    return most;
}

/* Whether a group has moved so far that rounding hides the differences in it. */
static inline int bp_is_gone(const double *x)
{
    int gone = 0;
    for (int g = 0; g < BP_NQ; g++) gone |= bp_largest_of(x, g) > BP_ROUNDED_AWAY * bp_apart(x, g);
    return gone;
}

static inline double bp_weighted(const double *mass, const double *a)
{
    double force[BP_NQ];
    for (int k = 0; k < BP_NQ; k++) force[k] = mass[k] * a[k];
    return bp_length(force);
}

/* The same with angles held where they are. */
static inline void bp_field_held(const bp_numbers *n, const double *x, double *a, double *A)
{
    bp_field(n, x, a, A);
    for (int k = 0; k < BP_NQ; k++) {
        if (!bp_is_angle[k]) continue;
        a[k] = 0.0;
        for (int j = 0; j < BP_NQ; j++) {
            A[k * BP_NQ + j] = 0.0;
            A[j * BP_NQ + k] = 0.0;
        }
    }
}

/* Positions at rest with vanishing acceleration, by pseudo-transient continuation; returns 0 when nothing holds them, and -1 when it
   fails. */
static inline int bp_equilibrium(const bp_numbers *n, const double *mass, double *x)
{
    double a[BP_NQ], A[BP_NQ * BP_NQ], there[BP_NQ], slopes[BP_NQ * BP_NQ], d[BP_NQ];
    bp_field_held(n, x, a, A);
    double size = bp_weighted(mass, a);
    const double first = size;
    if (size == 0.0) return 1;
    /* the first step moves by a nanometre: well inside any clearance */
    double tau = 1e-9 * (1.0 + bp_largest(x)) / bp_length(a);
    for (int i = 0; i < BP_ITERATIONS; i++) {
        double trial[BP_NX], rows[BP_NQ][BP_NQ + 1];
        bp_shifted_rows(A, 1.0 / tau, a, rows);
        if (!bp_eliminate(rows, d)) return -1;
        memcpy(trial, x, sizeof trial);
        for (int k = 0; k < BP_NQ; k++) trial[k] += d[k];
        bp_field_held(n, trial, there, slopes);
        const double reached = bp_weighted(mass, there);
        if (!(reached <= DBL_MAX) || reached > 1.5 * size) {
            tau /= 8.0;
            continue;
        }
        if (bp_is_gone(trial)) return 0;
        memcpy(x, trial, sizeof trial);
        memcpy(a, there, sizeof a);
        memcpy(A, slopes, sizeof A);
        double gain = reached > 0.0 ? size / reached : 1.0;
        gain = gain < 1.0 ? 1.0 : gain > 16.0 ? 16.0 : gain;
        tau *= 4.0 * gain;
        size = reached;
        if (size <= 1e-6 * first) return 1;
    }
    return -1;
}

/* to twelve bits: an equilibrium is known to a part in a million, and the last digits of its size should not decide about
   the last digits of the motion */
static double bp_rounded(double value)
{
    int exponent;
    double part = frexp(value, &exponent);
    return ldexp(rint(part * 4096.0) / 4096.0, exponent);
}

/* The moments that load a group most, by its acceleration at rest; returns how many, with that of the first. */
static inline int bp_loaded_moments(const double *p, const double *c, const double *rest, long moments, const double *u, int group,
                                    long which[BP_LOADED_MOMENTS], double *highest)
{
    double loaded[BP_LOADED_MOMENTS], a[BP_NQ], A[BP_NQ * BP_NQ], x[BP_NX];
    int kept = 0;
    for (long i = 0; i < moments; i++) {
        const bp_numbers n = bp_numbers_at(u + i * BP_NU, p, c);
        bp_at_moment(rest, i, moments, x);
        bp_field(&n, x, a, A);
        double size = bp_largest_of(a, group);
        if (!(size <= DBL_MAX)) size = 0.0;
        int place = kept;
        while (place > 0 && size > loaded[place - 1]) place--;
        if (place >= BP_LOADED_MOMENTS) continue;
        for (int k = kept < BP_LOADED_MOMENTS ? kept : BP_LOADED_MOMENTS - 1; k > place; k--) {
            loaded[k] = loaded[k - 1];
            which[k] = which[k - 1];
        }
        loaded[place] = size;
        which[place] = i;
        if (kept < BP_LOADED_MOMENTS) kept++;
    }
    *highest = kept > 0 ? loaded[0] : 0.0;
    return kept;
}

/* Magnitudes of a member whose inputs at so many moments are the rows of u. */
static inline void bp_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *u, double horizon,
                                 double *magnitude)
{
    const double turn = 6.283185307179586;
    double rest[BP_NX] = {0.0}, highest[BP_NQ], travel[BP_NQ] = {0.0}, apart[BP_NQ], equal[BP_NQ], mass[BP_NQ];
    int found = 0;
    memcpy(rest, initial, BP_NQ * sizeof *rest);
    for (int k = 0; k < BP_NQ; k++)
        if (bp_is_angle[k]) rest[BP_NQ + k] = initial[BP_NQ + k];
    for (int k = 0; k < BP_NQ; k++) equal[k] = 1.0;
    for (int g = 0; g < BP_NQ; g++) apart[g] = bp_apart(initial, g);
    for (int g = 0; g < BP_NQ; g++) {
        long which[BP_LOADED_MOMENTS];
        int any = 0;
        for (int k = 0; k < BP_NQ; k++) any |= bp_group[k] == g;
        const int kept = any ? bp_loaded_moments(p, c, rest, moments, u, g, which, &highest[g]) : 0;
        for (int i = 0; i < kept; i++) {
            const bp_numbers n = bp_numbers_at(u + which[i] * BP_NU, p, c);
            double x[BP_NX];
            bp_at_moment(rest, which[i], moments, x);
            /* a light ring has enormous accelerations on the way: then the forces have to fall */
            int held = bp_equilibrium(&n, equal, x);
            if (held < 0) {
                bp_at_moment(rest, which[i], moments, x);
                bp_masses(&n, mass);
                held = bp_equilibrium(&n, mass, x);
            }
            if (held < 0) continue;
            found |= held;
            for (int k = 0; k < BP_NQ; k++) {
                apart[k] = fmax(apart[k], bp_apart(x, k));
                if (held) travel[k] = fmax(travel[k], bp_largest_of(x, k));
            }
        }
    }
    for (int k = 0; k < BP_NQ; k++) {
        const int g = bp_group[k];
        const double moving = bp_largest_of(initial + BP_NQ, g);
        double position = fmax(travel[g], bp_largest_of(initial, g));
        /* nothing holds the body: its travel within the horizon by its load and its initial velocity */
        if (!found) position = fmax(position, highest[g] * (horizon / turn) * (horizon / turn));
        if (!found || highest[g] == 0.0) position = fmax(position, moving * (horizon / turn));
        if (bp_has_partners(g) && apart[g] > 0.0) position = fmin(position, BP_SOFT * apart[g]);
        if (bp_is_angle[k]) position = BP_RADIAN;
        double speed = fmax(sqrt(highest[g] * position), moving);
        /* a model at rest without load: any magnitude will do */
        if (position == 0.0) position = speed > 0.0 ? speed * horizon / turn : 1.0;
        if (speed == 0.0) speed = position * turn / horizon;
#ifdef BP_HAS_LAGS
        if (bp_is_lag[k]) position = horizon / turn, speed = BP_RADIAN; /* a velocity that is an angle */
#endif
        magnitude[k] = bp_rounded(position);
        magnitude[BP_NQ + k] = bp_rounded(speed);
    }
}

#endif
