/* When `auto` switches between explicit and linearly implicit steps within a segment, in single runs and ensembles.

   An explicit method is left where its steps are as long as stability allows: by the Jacobian, for how far steps reach into a fast
   oscillation of little damping estimates the states' differences badly.  A linearly implicit one then shows what its steps are worth.  At
   the limit the explicit method has excited the oscillation to about the tolerance, and it takes some fifty steps to damp that; then they
   may be hundreds of times as long.  Where they are not, the explicit one comes back and rests, each time twice as long.  See control.h
   for the family a segment starts with. */
#ifndef BALLPASS_FAMILY_H
#define BALLPASS_FAMILY_H

#include "control.h"
#include "stepper.h"

/* Limits of stability of an explicit method. */
static inline const bp_stability *bp_stability_of(int method) { return &bp_methods[method].plain->stability; }

/* What a segment has shown about the families so far. */
typedef struct {
    double reach, size, longest; /* of the steps examined: sums of their reaches [1] and sizes [s], the longest [s] */
    double mean_reach, mean_size; /* at the last decision about an explicit method */
    double stable; /* step at which an explicit method is at its limit, where the last look was at a linearly implicit one [s] */
    int looks, stiff;
    int vain; /* decisions in a row at which linearly implicit steps were not worth it */
    long steps;
    long rest;        /* decisions until the largest stable step is asked for again; steps were far below it */
    long wait, pause; /* decisions until the explicit method may be left, and how many that will be when it comes back next */
} bp_family;

/* What a run has shown about them. */
typedef struct {
    double least, most; /* stable steps of an explicit method that the linearly implicit ones have seen [s] */
    double left;        /* steps of the explicit method that was left within a segment; 0 where none was [s] */
    double gain;        /* how many times as long the longest linearly implicit one was since [1] */
} bp_seen;

/* Whether an accepted step is examined: every so many, and each while an explicit method is at its limit. */
static inline int bp_family_looks(bp_family *family) { return family->stiff > 0 || family->steps++ % BP_STIFF_LOOK == 0; }

/* Count a step examined; whether there have been enough to decide on. */
static inline int bp_family_decides(bp_family *family, double reach, double h)
{
    family->reach += reach;
    family->size += h;
    family->longest = h > family->longest ? h : family->longest;
    return ++family->looks >= BP_FAMILY_LOOKS;
}

static inline void bp_family_anew(bp_family *family)
{
    family->reach = family->size = family->longest = 0.0;
    family->looks = 0;
}

/* Leave an explicit method, whose steps cost as much as steps of this size by the one of low order. */
static inline int bp_try_linear(bp_family *family, bp_seen *seen, double size)
{
    bp_family_anew(family);
    family->stiff = family->vain = 0;
    seen->left = size;
    seen->gain = 0.0;
    return BP_AUTO_LINEAR;
}

/* What a look at a step of an explicit method asks for: nothing; the other family at once; a decision, or one for which the largest stable
   step has to be known. */
enum { BP_GO_ON, BP_GIVE_UP, BP_DECIDE, BP_ASK };

/* Look at a step of size h and this reach by an explicit method. */
static inline int bp_look_at_explicit(bp_family *family, int method, double reach, double h)
{
    const double limit = bp_stability_of(method)->reach;
    family->stiff = reach > limit ? family->stiff + 1 : 0;
    if (family->stiff >= BP_STIFF_STEPS) return BP_GIVE_UP;
    /* nothing touches: no rate to be held down by */
    if (!(reach > BP_FREE && bp_family_decides(family, reach < limit ? reach : limit, h))) return BP_GO_ON;
    family->mean_reach = family->reach / family->looks;
    family->mean_size = family->size / family->looks;
    bp_family_anew(family);
    if (family->rest == 0) return BP_ASK;
    family->rest--;
    return BP_DECIDE;
}

/* The method for the next step behind that; `stable`: the largest stable step of the method at hand, infinite where it was not asked for
   [s]; `high_order`: whether that method is to be had. */
static inline int bp_after_explicit(bp_family *family, bp_seen *seen, int method, double stable, int high_order)
{
    const int low = method == BP_AUTO_LOW;
    const double size = family->mean_size, reach = family->mean_reach;
    if (family->wait > 0) family->wait--;
    else if (size > BP_LIMITED * stable) return bp_try_linear(family, seen, (low ? 1.0 : 0.5) * (size < stable ? size : stable));
    const int far = stable < INFINITY && size < BP_FAR_FROM_LIMIT * stable;
    if (far) family->rest = BP_FAMILY_REST;
    if (!(high_order && (low ? far && reach < BP_HIGH_ORDER : reach > BP_LOW_ORDER))) return method;
    family->stiff = 0;
    family->stable = INFINITY;
    return low ? BP_AUTO_HIGH : BP_AUTO_LOW;
}

/* Look at a step of size h by a linearly implicit method; whether there is something to decide on. */
static inline int bp_look_at_linear(bp_family *family, double h) { return bp_family_decides(family, 0.0, h); }

/* The method for the next step behind that, at whose start this was the largest stable step of the explicit one of low order [s]. */
static inline int bp_after_linear(bp_family *family, bp_seen *seen, int method, double stable)
{
    /* the least of the run: balls that are off now come back */
    seen->least = stable < seen->least ? stable : seen->least;
    seen->most = stable > seen->most ? stable : seen->most;
    const double size = family->size / family->looks, longest = family->longest;
    /* what the explicit method would take here: not more than it took, nor than is stable by now */
    const double explicit_step = stable < seen->left ? stable : seen->left;
    bp_family_anew(family);
    /* before the stable step has changed no ball has landed yet, and it says nothing; a ring that is always loaded has shown at the start
       what it is */
    const int short_ones = seen->most > 2.0 * seen->least && size < BP_WORTH_SOLVING * seen->least;
    family->vain = longest < BP_WORTH_TRYING * explicit_step ? family->vain + 1 : 0;
    if (longest > seen->gain * seen->left && seen->left > 0.0) seen->gain = longest / seen->left;
    if (!short_ones && family->vain < BP_PATIENCE) return method;
    family->stable = short_ones ? BP_LIMITED * seen->least : explicit_step;
    family->vain = 0;
    family->wait = family->pause;
    family->pause = family->pause > 0 ? 2 * family->pause : 1;
    seen->left = seen->gain = 0.0;
    return BP_AUTO_LOW;
}

/* The largest stable step within these limits where a run's step started [s]. */
typedef double bp_stable(void *run, const bp_stability *limit);

/* The method for the next step, from an accepted one of size h that is examined; `reach`: of an explicit method. */
static inline int bp_judge_family(bp_family *family, bp_seen *seen, int method, int high_order, double h, double reach, bp_stable *stable,
                                  void *run)
{
    const int low = method == BP_AUTO_LOW;
    if (bp_methods[method].linear)
        return bp_look_at_linear(family, h) ? bp_after_linear(family, seen, method, stable(run, bp_stability_of(BP_AUTO_LOW))) : method;
    const int wanted = bp_look_at_explicit(family, method, reach, h);
    if (wanted == BP_GO_ON) return method;
    if (wanted == BP_GIVE_UP) return bp_try_linear(family, seen, low ? h : 0.5 * h);
    return bp_after_explicit(family, seen, method, wanted == BP_ASK ? stable(run, bp_stability_of(method)) : INFINITY, high_order);
}

/* Whether a segment behind a breakpoint starts with the linearly implicit family. */
static inline int bp_starts_linear(const bp_seen *seen, const double *restrict A, const double *restrict B)
{
    return seen->gain > BP_WORTH_KEEPING || bp_is_stiff(A, B);
}

#endif
