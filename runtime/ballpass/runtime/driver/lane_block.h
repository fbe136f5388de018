/* Members of an ensemble outside the lanes and in them. */
#ifndef BALLPASS_LANE_BLOCK_H
#define BALLPASS_LANE_BLOCK_H

#include <float.h>

#include "ensemble.h"
#include "family.h"
#include "lanes.h"
#include "reductions.h"

enum { BP_WAITING = 0, BP_FINISHED = 1 };

/* A member outside the lanes. */
typedef struct {
    double t, step, log_error; /* t counts from the segment's start */
    int phase, method;
    bp_family family;
    bp_seen seen;
} bp_member;

typedef struct {
    const ballpass_ensemble_options *options;
    long members;
    const double *p, *c, *tolerance;
    double *x;
    const long *first;
    const double *times, *inputs;
    const unsigned char *restarts;
    double *reductions;
    bp_member *member;
    ballpass_result *results;
} bp_job;

typedef struct {
    /* numbers of the members in the lanes */
    double p[(BP_NP > 0 ? BP_NP : 1) * BP_L] BP_ALIGNED, c[(BP_NC > 0 ? BP_NC : 1) * BP_L] BP_ALIGNED, u[BP_NU * BP_L] BP_ALIGNED;
    double weight[BP_NX * BP_L] BP_ALIGNED;
    /* where they are */
    double x[BP_NX * BP_L] BP_ALIGNED, next[BP_NX * BP_L] BP_ALIGNED;
    double t[BP_L] BP_ALIGNED, length[BP_L] BP_ALIGNED, step[BP_L] BP_ALIGNED, log_error[BP_L] BP_ALIGNED;
    double h[BP_L] BP_ALIGNED, error[BP_L] BP_ALIGNED;
    /* flags, as numbers so that they live in lanes as well */
    double active[BP_L] BP_ALIGNED, last[BP_L] BP_ALIGNED, accepted[BP_L] BP_ALIGNED, rejected_last[BP_L] BP_ALIGNED;
    double small[BP_L] BP_ALIGNED, reducing[BP_L] BP_ALIGNED, changing[BP_L] BP_ALIGNED; /* changing: the method to change to */
    double steps[BP_L] BP_ALIGNED, rejected[BP_L] BP_ALIGNED, pivoted[BP_L] BP_ALIGNED; /* since the member entered its lane */
    double allowed[BP_L] BP_ALIGNED; /* steps, accepted and rejected */
    /* what bp_family_looks takes: steps until the next examination, and whether all are examined */
    double until_look[BP_L] BP_ALIGNED, at_limit[BP_L] BP_ALIGNED;
    bp_lane_explicit plain;
    bp_lane_linear linear;
    /* reductions */
    double dense[BP_DENSE_ROWS][BP_NX * BP_L] BP_ALIGNED;
    double sampled[BP_POINTS][BP_CHANNELS * BP_L] BP_ALIGNED;
    double first[BP_POINTS][(BP_NB > 0 ? BP_NB : 1) * BP_L] BP_ALIGNED; /* powers of the balls' loads at the quarters, where wanted */
    /* sides of the balls' quantities at the quarters (bp_side), and whether they change in the step */
    double side[BP_POINTS][(BP_NB > 0 ? BP_LOOKED_AT - BP_NX : 1) * BP_L] BP_ALIGNED, cut[BP_LOOKED_AT * BP_L] BP_ALIGNED;
    double best[BP_EXTREMES][BP_CHANNELS * BP_L] BP_ALIGNED;
    double shift[BP_CHANNELS * BP_L] BP_ALIGNED, moment[BP_MOMENTS][BP_CHANNELS * BP_L] BP_ALIGNED;
    long who[BP_L];
    double start[BP_L] BP_ALIGNED, resolution[BP_L] BP_ALIGNED; /* of the segment, and of time within it [s] */
    int method;         /* which this pass advances */
    int balls, passes;  /* whether channels of the balls, and what fatigue needs, are reduced */
    int sided;          /* whether moments of the former are */
    int guarded;        /* whether of these only such as guard a run */
    const double *wanted; /* a row of reductions: what is wanted, of all members the same */
    int extremes, moments[BP_MOMENTS];                           /* how many channels are, */
    int extreme[BP_LOOKED_AT], moment_of[BP_MOMENTS][BP_CHANNELS]; /* and which */
    int states, state[BP_NX]; /* which states are evaluated within a step */
    bp_lane_numbers numbers;
    bp_lane_angles angles; /* of the step tried */
} bp_lane_block;

static void put(double *lanes, int lane, const double *row, int count)
{
    for (int k = 0; k < count; k++) lanes[k * BP_L + lane] = row[k];
}

static void get(const double *lanes, int lane, double *row, int count)
{
    for (int k = 0; k < count; k++) row[k] = lanes[k * BP_L + lane];
}

static bp_numbers member_numbers(const bp_job *job, long m)
{
    bp_numbers n;
    n.p = job->p + m * BP_NP;
    n.c = job->c + m * BP_NC;
    n.u = job->inputs + (job->first[m] + job->results[m].segment) * BP_NU;
    return n;
}

static double member_end(const bp_job *job, long m) { return job->times[job->first[m] + m + job->results[m].segment + 1]; }
static double member_start(const bp_job *job, long m) { return job->times[job->first[m] + m + job->results[m].segment]; }

/* Of time within the member's segment [s]: see run_segment in stepper.c. */
static double member_resolution(const bp_job *job, long m) { return DBL_EPSILON * fmax(fabs(member_start(job, m)), fabs(member_end(job, m))); }

#endif
