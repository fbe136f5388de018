/* Magnitudes of the states of a run, from its most loaded moments: what ballpass.runtime.run.scales does, for one member after another. */
#ifndef BALLPASS_SCALES_H
#define BALLPASS_SCALES_H

#include <float.h>
#include <string.h>

#include "elimination.h"

enum { BP_LOADED_MOMENTS = 3, BP_ITERATIONS = 80 };

static const double BP_SOFT = 10.0, BP_FAR = 1e9;

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

/* Masses of the coordinates: what a force through the balls accelerates. */
static inline void bp_masses(const bp_numbers *n, double *mass)
{
    const double force = 1e12, x[BP_NX] = {0.0}, none[BP_NS] = {0.0};
    double both[BP_NS];
    double w[BP_NW], a[BP_NQ], b[BP_NQ];
    for (int k = 0; k < BP_NS; k++) both[k] = force;
    bp_stage(0.0, n->u, n->p, n->c, w);
    bp_acceleration(x, none, n->u, n->p, n->c, w, a);
    bp_acceleration(x, both, n->u, n->p, n->c, w, b);
    for (int k = 0; k < BP_NQ; k++) mass[k] = force / fabs(b[k] - a[k]);
}

/* Distance between the centres of the rings, the larger component; of one ring to the fixed other. */
static inline double bp_apart(const double *x)
{
    double most = 0.0;
    for (int k = 0; k < 2; k++) {
        const double between = fabs(x[k] - (BP_NQ > 2 ? x[(k + 2) % BP_NQ] : 0.0));
        most = between > most ? between : most;
    }
    return most;
}

static inline double bp_weighted(const double *mass, const double *a)
{
    double force[BP_NQ];
    for (int k = 0; k < BP_NQ; k++) force[k] = mass[k] * a[k];
    return bp_length(force);
}

/* Positions at rest with vanishing acceleration, by pseudo-transient continuation; returns 0 when nothing holds them, and -1 when it
   gets nowhere. */
static inline int bp_equilibrium(const bp_numbers *n, const double *mass, double *x)
{
    double a[BP_NQ], A[BP_NQ * BP_NQ], there[BP_NQ], slopes[BP_NQ * BP_NQ], d[BP_NQ];
    bp_field(n, x, a, A);
    double size = bp_weighted(mass, a);
    const double first = size;
    if (size == 0.0) return 1;
    /* the first step moves by a nanometre: well inside any clearance */
    double tau = 1e-9 * (1.0 + bp_largest(x)) / bp_length(a);
    for (int i = 0; i < BP_ITERATIONS; i++) {
        double trial[BP_NX], rows[BP_NQ][BP_NQ + 1];
        bp_shifted_rows(A, 1.0 / tau, a, rows);
        if (!bp_eliminate(rows, 0.0, d)) return -1;
        memcpy(trial, x, sizeof trial);
        for (int k = 0; k < BP_NQ; k++) trial[k] += d[k];
        bp_field(n, trial, there, slopes);
        const double reached = bp_weighted(mass, there);
        if (!(reached <= DBL_MAX) || reached > 1.5 * size) {
            tau /= 8.0;
            continue;
        }
        if (bp_largest(trial) > BP_FAR * bp_apart(trial)) return 0;
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

/* Magnitudes of a member whose inputs at so many moments are the rows of u. */
static inline void bp_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *u, double horizon,
                                 double *magnitude)
{
    const double turn = 6.283185307179586;
    bp_numbers n = {u, p, c};
    double rest[BP_NX] = {0.0}, a[BP_NQ], A[BP_NQ * BP_NQ], highest = 0.0, position = 0.0, apart = bp_apart(initial), speed;
    double loaded[BP_LOADED_MOMENTS], equal[BP_NQ], mass[BP_NQ];
    long which[BP_LOADED_MOMENTS];
    int kept = 0, found = 0;
    memcpy(rest, initial, BP_NQ * sizeof *rest);
    for (int k = 0; k < BP_NQ; k++) equal[k] = 1.0;
    for (long i = 0; i < moments; i++) {
        n.u = u + i * BP_NU;
        bp_field(&n, rest, a, A);
        double size = bp_largest(a);
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
    if (kept > 0) highest = loaded[0];
    for (int i = 0; i < kept; i++) {
        double x[BP_NX];
        memcpy(x, rest, sizeof x);
        n.u = u + which[i] * BP_NU;
        /* a light ring has enormous accelerations on the way: then the forces have to fall */
        int held = bp_equilibrium(&n, equal, x);
        if (held < 0) {
            memcpy(x, rest, sizeof x);
            bp_masses(&n, mass);
            held = bp_equilibrium(&n, mass, x);
        }
        if (held < 0) continue;
        apart = bp_apart(x) > apart ? bp_apart(x) : apart;
        if (!held) continue;
        found = 1;
        position = bp_largest(x) > position ? bp_largest(x) : position;
    }
    /* nothing holds the body: what it travels in the time at hand, pushed by its load and carried by its initial velocity */
    if (!found || highest == 0.0) {
        const double carried = bp_largest(initial + BP_NQ) * (horizon / turn);
        if (!found && highest > 0.0) position = highest * (horizon / turn) * (horizon / turn);
        if (carried > position) position = carried;
    }
    if (bp_largest(initial) > position) position = bp_largest(initial);
    if (BP_NQ > 2 && apart > 0.0 && position > BP_SOFT * apart) position = BP_SOFT * apart;
    speed = sqrt(highest * position);
    if (bp_largest(initial + BP_NQ) > speed) speed = bp_largest(initial + BP_NQ);
    /* a model at rest without load: any magnitude will do */
    if (position == 0.0) position = speed > 0.0 ? speed * horizon / turn : 1.0;
    if (speed == 0.0) speed = position * turn / horizon;
    for (int k = 0; k < BP_NQ; k++) {
        magnitude[k] = bp_rounded(position);
        magnitude[BP_NQ + k] = bp_rounded(speed);
    }
}

#endif
