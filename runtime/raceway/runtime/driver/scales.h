/* Magnitudes of the states of a run, from its most loaded moments: what raceway.runtime.integrate.scales does, for one member after another. */
#ifndef RACEWAY_SCALES_H
#define RACEWAY_SCALES_H

#include <float.h>
#include <string.h>

#include "elimination.h"

enum { RW_LOADED_MOMENTS = 3, RW_ITERATIONS = 80 };

static const double RW_SOFT = 10.0, RW_FAR = 1e9;

/* Accelerations and their slopes by position at a state, t = 0. */
static inline void rw_field(const rw_numbers *n, const double *x, double *a, double *A)
{
    double w[RW_NW], wt[RW_NW], dx[RW_NX], B[RW_NQ * RW_NQ], at[RW_NQ];
    rw_stage_rate(0.0, n->u, n->p, n->c, w, wt);
    rw_linearize(n, w, wt, x, dx, A, B, at);
    memcpy(a, dx + RW_NQ, RW_NQ * sizeof *a);
}

static inline double rw_largest(const double *v)
{
    double most = 0.0;
    for (int k = 0; k < RW_NQ; k++) most = fabs(v[k]) > most ? fabs(v[k]) : most;
    return most;
}

/* Masses of the coordinates: what a force through the balls accelerates. */
static inline void rw_masses(const rw_numbers *n, double *mass)
{
    const double force = 1e12, x[RW_NX] = {0.0}, none[2] = {0.0, 0.0}, both[2] = {force, force};
    double w[RW_NW], a[RW_NQ], b[RW_NQ];
    rw_stage(0.0, n->u, n->p, n->c, w);
    rw_acceleration(x, none, n->u, n->p, n->c, w, a);
    rw_acceleration(x, both, n->u, n->p, n->c, w, b);
    for (int k = 0; k < RW_NQ; k++) mass[k] = force / fabs(b[k] - a[k]);
}

/* Distance between the centres of the rings, the larger component; of one ring to the fixed other. */
static inline double rw_apart(const double *x)
{
    double most = 0.0;
    for (int k = 0; k < 2; k++) {
        const double between = fabs(x[k] - (RW_NQ > 2 ? x[(k + 2) % RW_NQ] : 0.0));
        most = between > most ? between : most;
    }
    return most;
}

static inline double rw_weighted(const double *mass, const double *a)
{
    double force[RW_NQ];
    for (int k = 0; k < RW_NQ; k++) force[k] = mass[k] * a[k];
    return rw_length(force);
}

/* Positions at rest with vanishing acceleration, by pseudo-transient continuation; returns 0 when nothing holds them, and -1 when it
   gets nowhere. */
static inline int rw_equilibrium(const rw_numbers *n, const double *mass, double *x)
{
    double a[RW_NQ], A[RW_NQ * RW_NQ], there[RW_NQ], slopes[RW_NQ * RW_NQ], d[RW_NQ];
    rw_field(n, x, a, A);
    double size = rw_weighted(mass, a);
    const double first = size;
    if (size == 0.0) return 1;
    /* the first step moves by a nanometre: well inside any clearance */
    double tau = 1e-9 * (1.0 + rw_largest(x)) / rw_length(a);
    for (int i = 0; i < RW_ITERATIONS; i++) {
        double trial[RW_NX], rows[RW_NQ][RW_NQ + 1];
        rw_shifted_rows(A, 1.0 / tau, a, rows);
        if (!rw_eliminate(rows, 0.0, d)) return -1;
        memcpy(trial, x, sizeof trial);
        for (int k = 0; k < RW_NQ; k++) trial[k] += d[k];
        rw_field(n, trial, there, slopes);
        const double reached = rw_weighted(mass, there);
        if (!(reached <= DBL_MAX) || reached > 1.5 * size) {
            tau /= 8.0;
            continue;
        }
        if (rw_largest(trial) > RW_FAR * rw_apart(trial)) return 0;
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
static double rw_rounded(double value)
{
    int exponent;
    double part = frexp(value, &exponent);
    return ldexp(rint(part * 4096.0) / 4096.0, exponent);
}

/* Magnitudes of a member whose inputs at so many moments are the rows of u. */
static inline void rw_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *u, double horizon,
                                 double *magnitude)
{
    const double turn = 6.283185307179586;
    rw_numbers n = {u, p, c};
    double rest[RW_NX] = {0.0}, a[RW_NQ], A[RW_NQ * RW_NQ], highest = 0.0, position = 0.0, apart = rw_apart(initial), speed;
    double loaded[RW_LOADED_MOMENTS], equal[RW_NQ], mass[RW_NQ];
    long which[RW_LOADED_MOMENTS];
    int kept = 0, found = 0;
    memcpy(rest, initial, RW_NQ * sizeof *rest);
    for (int k = 0; k < RW_NQ; k++) equal[k] = 1.0;
    for (long i = 0; i < moments; i++) {
        n.u = u + i * RW_NU;
        rw_field(&n, rest, a, A);
        double size = rw_largest(a);
        if (!(size <= DBL_MAX)) size = 0.0;
        int place = kept;
        while (place > 0 && size > loaded[place - 1]) place--;
        if (place >= RW_LOADED_MOMENTS) continue;
        for (int k = kept < RW_LOADED_MOMENTS ? kept : RW_LOADED_MOMENTS - 1; k > place; k--) {
            loaded[k] = loaded[k - 1];
            which[k] = which[k - 1];
        }
        loaded[place] = size;
        which[place] = i;
        if (kept < RW_LOADED_MOMENTS) kept++;
    }
    if (kept > 0) highest = loaded[0];
    for (int i = 0; i < kept; i++) {
        double x[RW_NX];
        memcpy(x, rest, sizeof x);
        n.u = u + which[i] * RW_NU;
        /* a light ring has enormous accelerations on the way: then the forces have to fall */
        int held = rw_equilibrium(&n, equal, x);
        if (held < 0) {
            memcpy(x, rest, sizeof x);
            rw_masses(&n, mass);
            held = rw_equilibrium(&n, mass, x);
        }
        if (held < 0) continue;
        apart = rw_apart(x) > apart ? rw_apart(x) : apart;
        if (!held) continue;
        found = 1;
        position = rw_largest(x) > position ? rw_largest(x) : position;
    }
    /* nothing holds the body: what it travels in the time at hand, pushed by its load and carried by its initial velocity */
    if (!found || highest == 0.0) {
        const double carried = rw_largest(initial + RW_NQ) * (horizon / turn);
        if (!found && highest > 0.0) position = highest * (horizon / turn) * (horizon / turn);
        if (carried > position) position = carried;
    }
    if (rw_largest(initial) > position) position = rw_largest(initial);
    if (RW_NQ > 2 && apart > 0.0 && position > RW_SOFT * apart) position = RW_SOFT * apart;
    speed = sqrt(highest * position);
    if (rw_largest(initial + RW_NQ) > speed) speed = rw_largest(initial + RW_NQ);
    /* a model at rest without load: any magnitude will do */
    if (position == 0.0) position = speed > 0.0 ? speed * horizon / turn : 1.0;
    if (speed == 0.0) speed = position * turn / horizon;
    for (int k = 0; k < RW_NQ; k++) {
        magnitude[k] = rw_rounded(position);
        magnitude[RW_NQ + k] = rw_rounded(speed);
    }
}

#endif
