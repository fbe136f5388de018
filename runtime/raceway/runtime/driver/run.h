/* A run: what is carried from step to step, and one step of whichever method it has.

   The files locate.h, differentiate.h and observe.h add what a run may do besides; stepper.c is the loop around all.  They are parts of
   one translation unit. */
#ifndef RACEWAY_RUN_H
#define RACEWAY_RUN_H

#include <float.h>
#include <string.h>

#include "control.h"
#include "explicit.h"
#include "family.h"
#include "rosenbrock.h"
#include "stepper.h"
#ifdef RACEWAY_LOCATED
#include "kinks.h"
#endif
#ifdef RACEWAY_SENSITIVITIES
#include "sensitivity.h"
#endif
#ifdef RACEWAY_REDUCTIONS
#include "reductions.h"
#endif

#ifdef RACEWAY_LOCATED
/* End of a contact ahead, as foreseen: time within the segment, not a number where there is none, and what ends. */
typedef struct {
    double time;
    int which, ball;
} rw_release;
#endif

typedef struct {
    const raceway_options *options;
    raceway_result *result;
    rw_numbers numbers;
    double weight[RW_NX]; /* 1 / tolerance */
    double *x;
    double next[RW_NX];
    double step;           /* proposal for the next step; 0 where it has to be estimated */
    rw_seen seen;
    double last_error;     /* logarithm of that of the last accepted step, for the PI controller */
    int method;
    /* within the segment, of a run that goes on in another call */
    double elapsed; /* [s] */
    int rejected_last;
    rw_family family;
    long outputs;
    const double *output_times;
    double *output_states;
    /* work of the methods */
    rw_rosenbrock linear;
    rw_matrix matrix;
    rw_explicit plain;
    double dense[RW_DENSE_ROWS][RW_NX];
#ifdef RACEWAY_SENSITIVITIES
    const raceway_tangents *tangents; /* or NULL */
    rw_tangent_block *blocks;
    double rate_before[RW_NX]; /* at the end of the segment before */
#endif
#ifdef RACEWAY_REDUCTIONS
    double *reduction; /* or NULL where nothing is reduced in the present segment */
    double sampled[RW_POINTS][RW_CHANNELS];
#endif
#ifdef RACEWAY_LOCATED
    rw_sides sides;
    double rate[RW_NX]; /* dx/dt where the step starts: its first slope where its pace is even */
    double lead;        /* of the step tried, 1 where its pace is even (pace.h) */
    double touch;
    double onset;       /* time of the branch point behind, minus infinity where there is none [s] */
    rw_release release; /* branch point ahead */
#endif
} rw_run;

#ifdef RACEWAY_LOCATED
static int is_paced(const rw_run *run) { return run->lead != 1.0; }
static const double *lead_of(const rw_run *run) { return &run->lead; }
static double place_of(const rw_run *run, double part) { return is_paced(run) ? rw_theta(run->lead, part) : part; }
#else
#define is_paced(run) 0
#define lead_of(run) NULL
#define place_of(run, part) (part)
#endif

static int is_explicit(int method) { return method == RACEWAY_DP54 || method == RACEWAY_DOP853; }

static int is_finite(const double *x)
{
    for (int k = 0; k < RW_NX; k++)
        if (!(fabs(x[k]) <= DBL_MAX)) return 0;
    return 1;
}

/* Whether the tolerance is above the rounding of the states reached.  A motion that grows without bound ends where it is not: error
   control would follow it with ever smaller steps for hours. */
static int within_reach(const rw_run *run)
{
    for (int k = 0; k < RW_NX; k++)
        if (!(fabs(run->next[k]) * run->weight[k] <= 1.0 / DBL_EPSILON)) return 0;
    return 1;
}

static double error_exponent(int method)
{
    switch (method) {
    case RACEWAY_RODAS4: return rw_rodas4.error_exponent;
    case RACEWAY_RODAS5P: return rw_rodas5p.error_exponent;
    case RACEWAY_DP54: return rw_dp54.error_exponent;
    default: return rw_dop853.error_exponent;
    }
}

/* Prepare the dense output of the step from (t, x) to (t + h, next). */
static void prepare_dense(rw_run *run, double t, double h)
{
    const rw_numbers *n = &run->numbers;
    switch (run->method) {
    case RACEWAY_DP54:
        if (is_paced(run)) rw_explicit_dense(&rw_dp54, &run->plain, n, t, run->x, h, lead_of(run), run->next, run->dense);
        else rw_explicit_dense(&rw_dp54, &run->plain, n, t, run->x, h, NULL, run->next, run->dense);
        break;
    case RACEWAY_DOP853:
        if (is_paced(run)) rw_explicit_dense(&rw_dop853, &run->plain, n, t, run->x, h, lead_of(run), run->next, run->dense);
        else rw_explicit_dense(&rw_dop853, &run->plain, n, t, run->x, h, NULL, run->next, run->dense);
        break;
    case RACEWAY_RODAS4: rw_rosenbrock_dense(&rw_rodas4, &run->linear, run->dense); break;
    default: rw_rosenbrock_dense(&rw_rodas5p, &run->linear, run->dense);
    }
}

/* The state of that step where a part of its time has passed. */
static void state_at(const rw_run *run, double part, double *y)
{
    const double(*dense)[RW_NX] = (const double(*)[RW_NX])run->dense;
    const double theta = place_of(run, part);
    switch (run->method) {
    case RACEWAY_DP54: rw_explicit_at(&rw_dp54, dense, run->x, run->next, theta, y); break;
    case RACEWAY_DOP853: rw_explicit_at(&rw_dop853, dense, run->x, run->next, theta, y); break;
    case RACEWAY_RODAS4: rw_rosenbrock_at(&rw_rodas4, dense, run->x, run->next, theta, y); break;
    default: rw_rosenbrock_at(&rw_rodas5p, dense, run->x, run->next, theta, y);
    }
}

/* Try one step; returns its scaled error. */
static double try_step(rw_run *run, double t, double h)
{
    raceway_result *result = run->result;
    switch (run->method) {
    case RACEWAY_DP54:
        result->evaluations += rw_dp54.stages;
        if (is_paced(run))
            return rw_explicit_step(&rw_dp54, RW_DP54_STAGES, &run->plain, &run->numbers, t, run->x, h, lead_of(run), run->weight, run->next);
        return rw_explicit_step(&rw_dp54, RW_DP54_STAGES, &run->plain, &run->numbers, t, run->x, h, NULL, run->weight, run->next);
    case RACEWAY_DOP853:
        result->evaluations += rw_dop853.stages;
        if (is_paced(run))
            return rw_explicit_step(&rw_dop853, RW_DOP853_STAGES, &run->plain, &run->numbers, t, run->x, h, lead_of(run), run->weight,
                                    run->next);
        return rw_explicit_step(&rw_dop853, RW_DOP853_STAGES, &run->plain, &run->numbers, t, run->x, h, NULL, run->weight, run->next);
    case RACEWAY_RODAS4: {
        result->evaluations += rw_rodas4.stages - 1;
        const double error = rw_rosenbrock_step(&rw_rodas4, RW_RODAS4_STAGES, &run->linear, &run->matrix, &run->numbers, t, run->x, h,
                                                run->weight, run->next);
        result->factorizations++;
        result->pivoted += run->matrix.pivoted;
        return error;
    }
    default: {
        result->evaluations += rw_rodas5p.stages - 1;
        const double error = rw_rosenbrock_step(&rw_rodas5p, RW_RODAS5P_STAGES, &run->linear, &run->matrix, &run->numbers, t, run->x, h,
                                                run->weight, run->next);
        result->factorizations++;
        result->pivoted += run->matrix.pivoted;
        return error;
    }
    }
}

/* The state whose scaled value is worst, or the first that is none. */
static int worst_state(const rw_run *run)
{
    int worst = 0;
    double largest = -1.0;
    for (int k = 0; k < RW_NX; k++) {
        if (!(fabs(run->next[k]) <= DBL_MAX)) return k;
        const double change = fabs(run->next[k] - run->x[k]) * run->weight[k];
        if (change > largest) {
            largest = change;
            worst = k;
        }
    }
    return worst;
}

static void first_slope(rw_run *run, double t)
{
    rw_explicit_rate(&run->numbers, t, run->x, run->plain.k[0]);
    run->result->evaluations++;
#ifdef RACEWAY_LOCATED
    memcpy(run->rate, run->plain.k[0], sizeof run->rate);
#endif
}

/* That behind an accepted step which ended at (t, x): most end with the slope of the next. */
static void next_slope(rw_run *run, double t)
{
    const int end = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
#ifdef RACEWAY_LOCATED
    const double pace = rw_pace(run->lead, 1.0);
    if (pace < RW_LEAST_PACE) {
        first_slope(run, t);
        return;
    }
    for (int k = 0; k < RW_NX; k++) run->rate[k] = run->plain.k[end][k] / pace;
    memcpy(run->plain.k[0], run->rate, sizeof run->rate);
#else
    (void)t;
    memcpy(run->plain.k[0], run->plain.k[end], sizeof run->plain.k[0]);
#endif
}

static void linearize(rw_run *run, double t, int fresh)
{
    rw_rosenbrock_start(&run->linear, &run->numbers, t, run->x, fresh);
    run->result->evaluations++;
}

#endif
