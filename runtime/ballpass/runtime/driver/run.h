/* A run: what is carried from step to step, and one step of whichever method it has.

   The files locate.h, differentiate.h and observe.h add what a run may do besides; stepper.c is the loop around all.  They are parts of
   one translation unit. */
#ifndef BALLPASS_RUN_H
#define BALLPASS_RUN_H

#include <float.h>
#include <string.h>

#include "control.h"
#include "family.h"
#include "stepper.h"
#ifdef BALLPASS_LOCATED
#include "kinks.h"
#endif
#ifdef BALLPASS_SENSITIVITIES
#include "sensitivity.h"
#endif
#ifdef BALLPASS_REDUCTIONS
#include "reductions.h"
#endif

#ifdef BALLPASS_LOCATED
/* End of a contact ahead, as foreseen: time within the segment, not a number where there is none, and what ends. */
typedef struct {
    double time;
    int which;
} bp_release;
#endif

#ifdef BP_HAS_BORDERS
/* Passages of a window's edge in a row, each less than the angle BP_STALL_ANGLE [rad] behind the last: so many are a stall. */
enum { BP_STALLED = 100 };
static const double BP_STALL_ANGLE = 1e-3;

/* Inputs with the borders of the sides held, and passages of the driver through windows of its angle that come back at once. */
typedef struct {
    double held[BP_NU];
    int come_back;
} bp_driver;
#endif

/* A step that was accepted: its size [s] and the one that was tried, what the controller makes of it, the kink it met, whether the
   segment ends with it. */
typedef struct {
    double h, tried, factor;
    int met, last;
} bp_taken;

typedef struct {
    const ballpass_options *options;
    ballpass_result *result;
    bp_numbers numbers;
#ifdef BP_HAS_BORDERS
    bp_driver driver;
#endif
    double weight[BP_NX]; /* 1 / tolerance */
    double *x;
    double next[BP_NX] BP_ALIGNED;
    double step;           /* proposal for the next step; 0 where it has to be estimated */
    bp_seen seen;
    double last_error;     /* logarithm of that of the last accepted step, for the PI controller */
    int method;
    /* within the segment, of a run that continues in another call */
    double elapsed; /* [s] */
    int rejected_last;
    bp_family family;
    bp_taken taken;
    int waiting; /* whether that step is kept, for output times of another call */
    long outputs;
    const double *output_times;
    double *output_states;
    /* work of the methods */
    bp_linear linear;
    bp_matrix matrix;
    bp_explicit plain;
    double dense[BP_DENSE_ROWS][BP_NX] BP_ALIGNED;
#ifdef BALLPASS_SENSITIVITIES
    const ballpass_tangents *tangents; /* or NULL */
    bp_tangent_block *blocks;
    double rate_before[BP_NX]; /* at the end of the segment before */
#endif
#ifdef BALLPASS_REDUCTIONS
    double *reduction; /* or NULL where nothing is reduced in the present segment */
    int reduces_balls, reduces_passes, behind_kink; /* on which the step before ended */
    double sampled[BP_POINTS][BP_CHANNELS], balls[BP_POINTS][BP_BALL_QUANTITIES]; /* at the quarters of a step */
#endif
#ifdef BALLPASS_LOCATED
    bp_sides sides;
    double rate[BP_NX]; /* dx/dt where the step starts: its first slope where its pace is even */
    double lead;        /* of the step tried, 1 where its pace is even (sqrt_time.h) */
    double touch;
    double onset;       /* time of the branch point behind, minus infinity where there is none [s] */
    bp_release release; /* branch point ahead */
    double foreseen;    /* time within the segment from which it was foreseen by its rate */
#endif
} bp_run;

#ifdef BALLPASS_LOCATED
static int is_paced(const bp_run *run) { return run->lead != 1.0; }
static const double *lead_of(const bp_run *run) { return &run->lead; }
static void set_lead(bp_run *run, double lead) { run->lead = lead; }
static double place_of(const bp_run *run, double part) { return is_paced(run) ? bp_theta(run->lead, part) : part; }
#else
#define is_paced(run) 0
#define lead_of(run) NULL
#define set_lead(run, lead) ((void)0)
#define place_of(run, part) (part)
#endif

static const bp_explicit_method *explicit_method(int method) { return bp_methods[method].plain; }
static const bp_rosenbrock_method *rosenbrock_method(int method) { return bp_methods[method].linear; }
static int is_explicit(int method) { return explicit_method(method) != NULL; }

static int is_finite(const double *x)
{
    for (int k = 0; k < BP_NX; k++)
        if (!(fabs(x[k]) <= DBL_MAX)) return 0;
    return 1;
}

/* Whether the tolerance is above the rounding of the states reached.  A motion that grows without bound ends where it is not: error
   control would follow it with ever smaller steps for hours. */
static int within_reach(const bp_run *run)
{
    for (int k = 0; k < BP_NX; k++)
        if (!(fabs(run->next[k]) * run->weight[k] <= 1.0 / DBL_EPSILON)) return 0;
    return 1;
}

/* Prepare the dense output of the step from (t, x) to (t + h, next). */
static void prepare_dense(bp_run *run, double t, double h)
{
    const bp_explicit_method *plain = explicit_method(run->method);
    if (plain) {
        bp_times at;
        bp_times_of(&at, &run->numbers, t, h, plain->dense_nodes, plain->dense_stages, is_paced(run) ? lead_of(run) : NULL);
        bp_explicit_dense(plain, &at, run->plain.k, run->x, &h, run->next, run->dense);
    } else {
        bp_rosenbrock_dense(rosenbrock_method(run->method), (const double(*)[BP_NX])run->linear.u, run->dense);
    }
}

/* The state of that step where a part of its time has passed. */
static void state_at(const bp_run *run, double part, double *y)
{
    const double(*dense)[BP_NX] = (const double(*)[BP_NX])run->dense;
    const double theta = place_of(run, part);
    const bp_explicit_method *plain = explicit_method(run->method);
    if (plain) bp_explicit_at(plain, dense, run->x, run->next, theta, y);
    else bp_rosenbrock_at(rosenbrock_method(run->method), dense, run->x, run->next, theta, y);
}

/* Try one step; returns its scaled error. */
static double try_step(bp_run *run, double t, double h)
{
    const bp_explicit_method *plain = explicit_method(run->method);
    const bp_rosenbrock_method *linear = rosenbrock_method(run->method);
    if (plain) {
        run->result->evaluations += plain->stages;
        /* even steps once more: without a pace that no other step has */
        /* the method of most runs once more, so that its coefficients are constants */
        if (run->method == BP_AUTO_LOW && !is_paced(run))
            return bp_explicit_step(bp_methods[BP_AUTO_LOW].plain, &run->plain, &run->numbers, t, run->x, h, NULL, run->weight, run->next);
        if (is_paced(run)) return bp_explicit_step(plain, &run->plain, &run->numbers, t, run->x, h, lead_of(run), run->weight, run->next);
        return bp_explicit_step(plain, &run->plain, &run->numbers, t, run->x, h, NULL, run->weight, run->next);
    }
    const double error = bp_rosenbrock_step(linear, &run->linear, &run->matrix, &run->numbers, t, run->x, h, run->weight, run->next);
    run->result->evaluations += linear->stages - 1;
    run->result->factorizations++;
    run->result->pivoted += run->matrix.pivoted;
    return error;
}

/* The state whose scaled value is worst, or the first that is none. */
static int worst_state(const bp_run *run)
{
    int worst = 0;
    double largest = -1.0;
    for (int k = 0; k < BP_NX; k++) {
        if (!(fabs(run->next[k]) <= DBL_MAX)) return k;
        const double change = fabs(run->next[k] - run->x[k]) * run->weight[k];
        if (change > largest) {
            largest = change;
            worst = k;
        }
    }
    return worst;
}

static void first_slope(bp_run *run, double t)
{
    bp_explicit_rate(&run->numbers, t, run->x, run->plain.k[0]);
    run->result->evaluations++;
#ifdef BALLPASS_LOCATED
    memcpy(run->rate, run->plain.k[0], sizeof run->rate);
#endif
}

/* That behind an accepted step which ended at (t, x): most end with the slope of the next. */
static void next_slope(bp_run *run, double t)
{
    const int end = explicit_method(run->method)->stages;
#ifdef BALLPASS_LOCATED
    const double pace = bp_pace(run->lead, 1.0);
    if (pace < BP_LEAST_PACE) {
        first_slope(run, t);
        return;
    }
    for (int k = 0; k < BP_NX; k++) run->rate[k] = run->plain.k[end][k] / pace;
    memcpy(run->plain.k[0], run->rate, sizeof run->rate);
#else
    (void)t;
    memcpy(run->plain.k[0], run->plain.k[end], sizeof run->plain.k[0]);
#endif
}

static void linearize(bp_run *run, double t, int fresh)
{
    bp_linear_start(&run->linear, &run->numbers, t, run->x, fresh);
    run->result->evaluations++;
}

#endif
