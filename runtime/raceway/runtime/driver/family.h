/* The rule by which `auto` changes its mind within a segment; single runs and ensembles follow it alike.

   A method is judged by the reach of its steps, their size times the fastest rate.  See control.h for the family a segment starts with. */
#ifndef RACEWAY_FAMILY_H
#define RACEWAY_FAMILY_H

#include "control.h"
#include "stepper.h"

/* Reach at which the explicit methods are at the limit of stability. */
static const double RW_DP54_LIMIT = 3.25, RW_DOP853_LIMIT = 6.1;

/* What a segment has shown about the families so far. */
typedef struct {
    double sum;    /* of the reach of the steps looked at */
    double stable; /* step at which an explicit method is at its limit, where the last look was at a linearly implicit one [s] */
    int looks, stiff, changes;
    long steps;
} rw_family;

/* Rates seen by the linearly implicit methods in a run [1/s]. */
typedef struct {
    double fastest, slowest;
} rw_rates;

/* Whether an accepted step is looked at: every so many, and each while an explicit method is at its limit. */
static inline int rw_family_looks(rw_family *family) { return family->stiff > 0 || family->steps++ % RW_STIFF_LOOK == 0; }

/* Whether there have been enough looks to decide on; then their mean reach, and they are counted anew. */
static inline int rw_family_mean(rw_family *family, double *mean)
{
    if (++family->looks < RW_FAMILY_LOOKS) return 0;
    *mean = family->sum / family->looks;
    family->sum = 0.0;
    family->looks = 0;
    return 1;
}

/* The method for the next step, from the reach of one by an explicit method; `high_order`: whether DOP853 is to be had. */
static inline int rw_after_explicit(rw_family *family, int method, double reach, int high_order)
{
    const int dp54 = method == RACEWAY_DP54;
    const double limit = dp54 ? RW_DP54_LIMIT : RW_DOP853_LIMIT;
    double mean;
    family->stiff = reach > limit ? family->stiff + 1 : 0;
    if (family->stiff >= RW_STIFF_STEPS) {
        *family = (rw_family){.changes = family->changes + 1};
        return RACEWAY_RODAS5P;
    }
    /* nothing touches: no rate to be held down by */
    if (!(reach > RW_FREE)) return method;
    family->sum += reach < limit ? reach : limit;
    if (!rw_family_mean(family, &mean)) return method;
    if (high_order && (dp54 ? mean < RW_HIGH_ORDER : mean > RW_LOW_ORDER)) {
        family->stiff = 0;
        family->stable = INFINITY;
        return dp54 ? RACEWAY_DOP853 : RACEWAY_DP54;
    }
    if (!dp54 || family->changes >= RW_FAMILY_CHANGES || !(mean > RW_LIMITED)) return method;
    family->changes++;
    family->stiff = 0;
    return RACEWAY_RODAS5P;
}

/* The same after one of size h by a linearly implicit method, at whose start the fastest rate was this. */
static inline int rw_after_linear(rw_family *family, rw_rates *seen, int method, double rate, double h)
{
    double mean;
    /* the fastest of the run: balls that are off now come back.  Before rates have changed no ball has landed yet, and they say
       nothing; a ring that is always loaded has shown at the start what it is */
    seen->fastest = rate > seen->fastest ? rate : seen->fastest;
    seen->slowest = rate < seen->slowest ? rate : seen->slowest;
    if (!(seen->fastest > 2.0 * seen->slowest)) return method;
    family->stable = RW_LIMITED / seen->fastest;
    family->sum += h * seen->fastest;
    if (!rw_family_mean(family, &mean)) return method;
    if (family->changes >= RW_FAMILY_CHANGES || !(mean < RW_WORTH_SOLVING)) return method;
    family->changes++;
    return RACEWAY_DP54;
}

#endif
