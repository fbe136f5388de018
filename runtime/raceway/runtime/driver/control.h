/* Family of methods and first step size.  Single runs and ensembles decide alike, where a segment begins and within it
   (family.h). */
#ifndef RACEWAY_CONTROL_H
#define RACEWAY_CONTROL_H

#include "explicit.h"
#include "rosenbrock.h"

enum {
    RW_STIFF_STEPS = 12, /* steps at the stability limit before an explicit method gives up */
    RW_STIFF_LOOK = 8,   /* every so many steps it looks whether it is there */
    RW_FAMILY_LOOKS = 3, /* looks that a change of family is decided on */
    RW_FAMILY_CHANGES = 3 /* changes of family within a segment; more only where an explicit method gives up */
};

/* Step size times fastest rate, in the mean over the looks.  Above the first an explicit method is held down by stability and not by
   accuracy.  Below the second an explicit step, of which more than three cost as much as a linearly implicit one, is not. */
static const double RW_LIMITED = 2.6, RW_WORTH_SOLVING = 4.0;

/* Where accuracy asks for steps far below the stability limit the higher order pays, although its step costs twice as much.  Below the
   last the ring flies free. */
static const double RW_HIGH_ORDER = 0.35, RW_LOW_ORDER = 1.2, RW_FREE = 1e-3;

/* Logarithm of 1e-4: smaller errors of the step before do not tell the controller more. */
static const double RW_LOG_SMALL_ERROR = -9.210340371976182;

/* Whether limits of the step size [s] are numbers that can be kept to. */
static inline int rw_are_limits(double first, double smallest, double largest) { return first >= 0.0 && smallest >= 0.0 && largest > 0.0; }

/* Initial step (Hairer, Norsett & Wanner I, section II.4): from the size of the first and a guess of the second derivative.  Takes two
   evaluations of the right-hand side. */
static inline double rw_first_step(const rw_numbers *n, double t, const double *restrict x, double longest, const double *restrict weight,
                                   double error_exponent)
{
    double dx[RW_NX], moved[RW_NX], change[RW_NX];
    rw_explicit_rate(n, t, x, dx);
    const double slope = rw_norm(dx, weight), size = rw_norm(x, weight);
    double h = size > 1e-5 && slope > 1e-5 ? 0.01 * size / slope : 1e-6 * longest;
    /* from rest the size says nothing: the step of a tolerance's motion does */
    if (slope > 0.0 && h < 1.0 / slope) h = 1.0 / slope;
    if (h > longest) h = longest;
    for (int k = 0; k < RW_NX; k++) moved[k] = x[k] + h * dx[k];
    rw_explicit_rate(n, t + h, moved, change);
    for (int k = 0; k < RW_NX; k++) change[k] = (change[k] - dx[k]) / h;
    const double curvature = rw_norm(change, weight), larger = curvature > slope ? curvature : slope;
    const double second = larger > 1e-15 ? pow(0.01 / larger, 1.0 / error_exponent) : h * 1e-3;
    h = 100.0 * h < second ? 100.0 * h : second;
    return h < longest ? h : longest;
}

/* Bounds of the fastest decay [1/s] and of the squared fastest frequency [1/s^2] of q'' = A q + B q': the largest row sums. */
static inline void rw_bounds(const double *restrict A, const double *restrict B, double *decay, double *squared)
{
    *decay = *squared = 0.0;
    for (int i = 0; i < RW_NQ; i++) {
        double a = 0.0, b = 0.0;
        for (int j = 0; j < RW_NQ; j++) {
            a += fabs(A[i * RW_NQ + j]);
            b += fabs(B[i * RW_NQ + j]);
        }
        *decay = b > *decay ? b : *decay;
        *squared = a > *squared ? a : *squared;
    }
}

/* Bound of the fastest rate of q'' = A q + B q' [1/s]: of decay or of oscillation. */
static inline double rw_fastest_rate(const double *restrict A, const double *restrict B)
{
    double decay, squared;
    rw_bounds(A, B, &decay, &squared);
    const double half = 0.5 * decay, oscillation = sqrt(squared);
    return half > oscillation ? half + sqrt(half * half - squared) : oscillation;
}

/* Whether the linearly implicit family fits: where damping is faster than the oscillation it damps, for then an explicit method's step is
   held down by stability and not by accuracy.  A = da/dq, B = da/dv. */
static inline int rw_is_stiff(const double *restrict A, const double *restrict B)
{
    double decay, squared;
    rw_bounds(A, B, &decay, &squared);
    return decay * decay > 2.0 * squared;
}

#endif
