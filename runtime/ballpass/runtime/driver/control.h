/* Family of methods and first step size.  Single runs and ensembles decide alike, at the start of a segment and within it
   (family.h). */
#ifndef BALLPASS_CONTROL_H
#define BALLPASS_CONTROL_H

#include <string.h>

#include "single.h"

enum {
    BP_STIFF_STEPS = 12, /* steps at the stability limit before an explicit method stops */
    BP_STIFF_LOOK = 8,   /* steps between two checks whether it is at the limit */
    BP_FAMILY_LOOKS = 3, /* checks before a change of family is decided */
    BP_FAMILY_REST = 3,  /* decisions without asking for the largest stable step where steps are far below it */
    BP_PATIENCE = 4      /* decisions before a linearly implicit method is judged */
};

/* Step size, in the mean over the checks, by the largest stable step of an explicit method.  Above the first an explicit method is held
   down by stability and not by accuracy, below the second it is far from it.  Below the third a linearly implicit step, which costs more
   than two explicit ones, is not worth it. */
static const double BP_LIMITED = 0.9, BP_FAR_FROM_LIMIT = 0.3, BP_WORTH_SOLVING = 1.25;

/* Longest of the linearly implicit steps by those of the explicit method before: below the first they are not worth it, above the second
   the family is kept at a breakpoint. */
static const double BP_WORTH_TRYING = 1.7, BP_WORTH_KEEPING = 3.0;

/* Where accuracy asks for steps far below the stability limit the higher order pays, although its step costs twice as much.  Below
   BP_FREE no ball is in contact. */
static const double BP_HIGH_ORDER = 0.35, BP_LOW_ORDER = 1.2, BP_FREE = 1e-3;

/* Whether limits of the step size [s] are numbers that can be kept to. */
static inline int bp_are_limits(double first, double smallest, double largest) { return first >= 0.0 && smallest >= 0.0 && largest > 0.0; }

/* Initial step (Hairer, Norsett & Wanner I, section II.4): from the size of the first and a guess of the second derivative.  Takes two
   evaluations of the right-hand side. */
static inline double bp_first_step(const bp_numbers *n, double t, const double *restrict x, double longest, const double *restrict weight,
                                   double error_exponent)
{
    double dx[BP_NX], moved[BP_NX], change[BP_NX];
    bp_explicit_rate(n, t, x, dx);
    const double slope = bp_size(dx, weight), size = bp_size(x, weight);
    double h = size > 1e-5 && slope > 1e-5 ? 0.01 * size / slope : 1e-6 * longest;
    /* from rest the size says nothing: the step of a tolerance's motion does */
    if (slope > 0.0 && h < 1.0 / slope) h = 1.0 / slope;
    if (h > longest) h = longest;
    for (int k = 0; k < BP_NX; k++) moved[k] = x[k] + h * dx[k];
    bp_explicit_rate(n, t + h, moved, change);
    for (int k = 0; k < BP_NX; k++) change[k] = (change[k] - dx[k]) / h;
    const double curvature = bp_size(change, weight), larger = curvature > slope ? curvature : slope;
    const double second = larger > 1e-15 ? pow(0.01 / larger, 1.0 / error_exponent) : h * 1e-3;
    h = 100.0 * h < second ? 100.0 * h : second;
    return h < longest ? h : longest;
}

/* Bounds of the fastest decay [1/s] and of the squared fastest frequency [1/s^2] of q'' = A q + B q': the largest row sums. */
static inline void bp_bounds(const double *restrict A, const double *restrict B, double *decay, double *squared)
{
    *decay = *squared = 0.0;
    for (int i = 0; i < BP_NQ; i++) {
        double a = 0.0, b = 0.0;
        for (int j = 0; j < BP_NQ; j++) {
            a += fabs(A[i * BP_NQ + j]);
            b += fabs(B[i * BP_NQ + j]);
        }
        *decay = b > *decay ? b : *decay;
        *squared = a > *squared ? a : *squared;
    }
}

/* Limit of stability for an oscillation, step size times frequency, by its damping ratio. */
static inline double bp_oscillation_limit(const bp_stability *limit, double ratio)
{
    const double fit = limit->damped * pow(ratio, limit->exponent);
    return fit < limit->undamped ? limit->undamped : fit < limit->decay ? fit : limit->decay;
}

/* Frequency [1/s] and damping ratio [1] of the fastest oscillation of q'' = A q + B q', from A^4: its size is nearly that of the largest
   eigenvalue, its widest column nearly that mode.  `squared` bounds the squared frequency. */
static inline double bp_fastest_mode(const double *restrict A, const double *restrict B, double squared, double *ratio)
{
    double power[BP_NQ * BP_NQ], product[BP_NQ * BP_NQ];
    const double inverse = 1.0 / squared;
    for (int k = 0; k < BP_NQ * BP_NQ; k++) power[k] = A[k] * inverse;
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < BP_NQ; i++)
            for (int j = 0; j < BP_NQ; j++) {
                double sum = 0.0;
                for (int k = 0; k < BP_NQ; k++) sum += power[i * BP_NQ + k] * power[k * BP_NQ + j];
                product[i * BP_NQ + j] = sum;
            }
        memcpy(power, product, sizeof power);
    }
    int mode = 0;
    double width = 0.0, size = 0.0, damped = 0.0;
    for (int j = 0; j < BP_NQ; j++) {
        double column = 0.0, row = 0.0;
        for (int i = 0; i < BP_NQ; i++) {
            column += fabs(power[i * BP_NQ + j]);
            row += fabs(power[j * BP_NQ + i]);
        }
        if (column > width) width = column, mode = j;
        size = row > size ? row : size;
    }
    for (int i = 0; i < BP_NQ; i++) {
        double sum = 0.0;
        for (int j = 0; j < BP_NQ; j++) sum += B[i * BP_NQ + j] * power[j * BP_NQ + mode];
        damped += fabs(sum);
    }
    const double frequency = sqrt(squared) * sqrt(sqrt(sqrt(size)));
    *ratio = width > 0.0 ? 0.5 * damped / (width * frequency) : 0.0;
    return frequency;
}

/* Largest step of an explicit method that is stable for q'' = A q + B q' [s]; infinite where nothing touches. */
static inline double bp_stable_step(const double *restrict A, const double *restrict B, const bp_stability *limit)
{
    double decay, squared, ratio;
    bp_bounds(A, B, &decay, &squared);
    const double half = 0.5 * decay;
    double rate = half * half > squared ? (half + sqrt(half * half - squared)) / limit->decay : 0.0;
    if (squared > 0.0) {
        const double frequency = bp_fastest_mode(A, B, squared, &ratio);
        const double oscillating = frequency / bp_oscillation_limit(limit, ratio);
        rate = oscillating > rate ? oscillating : rate;
    }
    return rate > 0.0 ? 1.0 / rate : INFINITY;
}

/* Whether the linearly implicit family fits from the start: where damping is faster than the oscillation it damps, for then an explicit
   method's step is held down by stability and not by accuracy.  A fast oscillation may have to be resolved; only the steps show
   whether (family.h).  A = da/dq, B = da/dv. */
static inline int bp_is_stiff(const double *restrict A, const double *restrict B)
{
    double decay, squared;
    bp_bounds(A, B, &decay, &squared);
    return decay * decay > 2.0 * squared;
}

#endif
