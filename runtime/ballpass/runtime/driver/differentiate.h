/* Derivatives of a run: blocks of directions that follow its steps (sensitivity.h). */
#ifndef BALLPASS_DIFFERENTIATE_H
#define BALLPASS_DIFFERENTIATE_H

#include "run.h"

#ifdef BALLPASS_SENSITIVITIES
static void tangent_start(bp_run *run, double t)
{
    if (run->tangents && is_explicit(run->method))
        bp_explicit_tangent_start(run->tangents, run->blocks, &run->numbers, run->result->segment, t, run->x);
}

/* Differentiate the step tried; returns its error, with that of the derivatives where they are controlled. */
static double tangent_step(bp_run *run, double t, double h, double error)
{
    const ballpass_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents) return error;
    switch (run->method) {
    case BALLPASS_DP54:
        bp_explicit_tangent_step(&bp_dp54, BP_DP54_STAGES, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h,
                                 run->next);
        break;
    case BALLPASS_DOP853:
        bp_explicit_tangent_step(&bp_dop853, BP_DOP853_STAGES, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h,
                                 run->next);
        break;
    case BALLPASS_RODAS4:
        bp_rosenbrock_tangent_step(&bp_rodas4, BP_RODAS4_STAGES, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers, segment,
                                   t, run->x, h);
        break;
    default:
        bp_rosenbrock_tangent_step(&bp_rodas5p, BP_RODAS5P_STAGES, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers,
                                   segment, t, run->x, h);
    }
    if (!tangents->weight) return error;
    double theirs;
    if (is_explicit(run->method)) {
        const bp_explicit_method *method = run->method == BALLPASS_DP54 ? &bp_dp54 : &bp_dop853;
        const double *weights[2] = {method->error[0], method->error[1]};
        theirs = bp_tangent_error(tangents, run->blocks, weights, method->estimates, method->error_share, method->stages + 1, h);
    } else {
        const bp_rosenbrock_method *method = run->method == BALLPASS_RODAS4 ? &bp_rodas4 : &bp_rodas5p;
        const double *weights[1] = {method->error_weights}, none[1] = {0.0};
        theirs = bp_tangent_error(tangents, run->blocks, weights, 1, none, method->stages, 1.0);
    }
    return theirs <= error ? error : theirs;
}

/* Take over the derivatives of an accepted step. */
static void tangent_accept(bp_run *run)
{
    if (!run->tangents) return;
    const int end = run->method == BALLPASS_DP54 ? BP_DP54_STAGES : BP_DOP853_STAGES;
    for (long b = 0; b < run->tangents->blocks; b++) {
        memcpy(bp_tangent_state(run->tangents, b), run->blocks[b].next, sizeof run->blocks[b].next);
        if (is_explicit(run->method)) memcpy(run->blocks[b].k[0], run->blocks[b].k[end], sizeof run->blocks[b].k[0]);
    }
}

static void tangent_output(bp_run *run, double t, double h, double theta, int prepared)
{
    const ballpass_tangents *tangents = run->tangents;
    if (!tangents || !tangents->outputs) return;
    double *out = tangents->outputs + run->result->written * tangents->blocks * (BP_NX * BP_LANES);
    if (theta >= 1.0) {
        for (long b = 0; b < tangents->blocks; b++)
            memcpy(out + b * (BP_NX * BP_LANES), run->blocks[b].next, sizeof run->blocks[b].next);
        return;
    }
    const long segment = run->result->segment;
    if (!prepared) {
        if (run->method == BALLPASS_DP54)
            bp_explicit_tangent_dense(&bp_dp54, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h);
        else if (run->method == BALLPASS_DOP853)
            bp_explicit_tangent_dense(&bp_dop853, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h);
        else
            bp_rosenbrock_tangent_dense(run->method == BALLPASS_RODAS4 ? &bp_rodas4 : &bp_rodas5p, tangents, run->blocks);
    }
    if (run->method == BALLPASS_DP54) bp_explicit_tangent_at(&bp_dp54, tangents, run->blocks, theta, out);
    else if (run->method == BALLPASS_DOP853) bp_explicit_tangent_at(&bp_dop853, tangents, run->blocks, theta, out);
    else bp_rosenbrock_tangent_at(run->method == BALLPASS_RODAS4 ? &bp_rodas4 : &bp_rodas5p, tangents, run->blocks, theta, out);
}

/* Where a load switches at a time that moves with a parameter, the derivative at fixed time jumps. */
static void tangent_jump(bp_run *run)
{
    const ballpass_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents || segment == 0) return;
    double behind[BP_NX];
    bp_explicit_rate(&run->numbers, 0.0, run->x, behind);
    for (long b = 0; b < tangents->blocks; b++) {
        const double *shift = tangents->shift + (segment * tangents->blocks + b) * BP_LANES;
        double *xd = bp_tangent_state(tangents, b);
        for (int k = 0; k < BP_NX; k++)
            for (int l = 0; l < BP_LANES; l++) xd[k * BP_LANES + l] += (run->rate_before[k] - behind[k]) * shift[l];
    }
}
#else
#define tangent_start(run, t) ((void)0)
#define tangent_step(run, t, h, error) (error)
#define tangent_accept(run) ((void)0)
#define tangent_output(run, t, h, theta, prepared) ((void)(prepared))
#define tangent_jump(run) ((void)0)
#endif

#endif
