/* Derivatives of a run: blocks of directions that follow its steps (sensitivity.h). */
#ifndef RACEWAY_DIFFERENTIATE_H
#define RACEWAY_DIFFERENTIATE_H

#include "run.h"

#ifdef RACEWAY_SENSITIVITIES
static void tangent_start(rw_run *run, double t)
{
    if (run->tangents && is_explicit(run->method))
        rw_explicit_tangent_start(run->tangents, run->blocks, &run->numbers, run->result->segment, t, run->x);
}

/* Differentiate the step tried; returns its error, with that of the derivatives where they are controlled. */
static double tangent_step(rw_run *run, double t, double h, double error)
{
    const raceway_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents) return error;
    switch (run->method) {
    case RACEWAY_DP54:
        rw_explicit_tangent_step(&rw_dp54, RW_DP54_STAGES, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h,
                                 run->next);
        break;
    case RACEWAY_DOP853:
        rw_explicit_tangent_step(&rw_dop853, RW_DOP853_STAGES, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h,
                                 run->next);
        break;
    case RACEWAY_RODAS4:
        rw_rosenbrock_tangent_step(&rw_rodas4, RW_RODAS4_STAGES, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers, segment,
                                   t, run->x, h);
        break;
    default:
        rw_rosenbrock_tangent_step(&rw_rodas5p, RW_RODAS5P_STAGES, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers,
                                   segment, t, run->x, h);
    }
    if (!tangents->weight) return error;
    double theirs;
    if (is_explicit(run->method)) {
        const rw_explicit_method *method = run->method == RACEWAY_DP54 ? &rw_dp54 : &rw_dop853;
        const double *weights[2] = {method->error[0], method->error[1]};
        theirs = rw_tangent_error(tangents, run->blocks, weights, method->estimates, method->error_share, method->stages + 1, h);
    } else {
        const rw_rosenbrock_method *method = run->method == RACEWAY_RODAS4 ? &rw_rodas4 : &rw_rodas5p;
        const double *weights[1] = {method->error_weights}, none[1] = {0.0};
        theirs = rw_tangent_error(tangents, run->blocks, weights, 1, none, method->stages, 1.0);
    }
    return theirs <= error ? error : theirs;
}

/* Take over the derivatives of an accepted step. */
static void tangent_accept(rw_run *run)
{
    if (!run->tangents) return;
    const int end = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
    for (long b = 0; b < run->tangents->blocks; b++) {
        memcpy(rw_tangent_state(run->tangents, b), run->blocks[b].next, sizeof run->blocks[b].next);
        if (is_explicit(run->method)) memcpy(run->blocks[b].k[0], run->blocks[b].k[end], sizeof run->blocks[b].k[0]);
    }
}

static void tangent_output(rw_run *run, double t, double h, double theta, int prepared)
{
    const raceway_tangents *tangents = run->tangents;
    if (!tangents || !tangents->outputs) return;
    double *out = tangents->outputs + run->result->written * tangents->blocks * (RW_NX * RW_LANES);
    if (theta >= 1.0) {
        for (long b = 0; b < tangents->blocks; b++)
            memcpy(out + b * (RW_NX * RW_LANES), run->blocks[b].next, sizeof run->blocks[b].next);
        return;
    }
    const long segment = run->result->segment;
    if (!prepared) {
        if (run->method == RACEWAY_DP54)
            rw_explicit_tangent_dense(&rw_dp54, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h);
        else if (run->method == RACEWAY_DOP853)
            rw_explicit_tangent_dense(&rw_dop853, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h);
        else
            rw_rosenbrock_tangent_dense(run->method == RACEWAY_RODAS4 ? &rw_rodas4 : &rw_rodas5p, tangents, run->blocks);
    }
    if (run->method == RACEWAY_DP54) rw_explicit_tangent_at(&rw_dp54, tangents, run->blocks, theta, out);
    else if (run->method == RACEWAY_DOP853) rw_explicit_tangent_at(&rw_dop853, tangents, run->blocks, theta, out);
    else rw_rosenbrock_tangent_at(run->method == RACEWAY_RODAS4 ? &rw_rodas4 : &rw_rodas5p, tangents, run->blocks, theta, out);
}

/* Where a load switches at a time that moves with a parameter, the derivative at fixed time jumps. */
static void tangent_jump(rw_run *run)
{
    const raceway_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents || segment == 0) return;
    double behind[RW_NX];
    rw_explicit_rate(&run->numbers, 0.0, run->x, behind);
    for (long b = 0; b < tangents->blocks; b++) {
        const double *shift = tangents->shift + (segment * tangents->blocks + b) * RW_LANES;
        double *xd = rw_tangent_state(tangents, b);
        for (int k = 0; k < RW_NX; k++)
            for (int l = 0; l < RW_LANES; l++) xd[k * RW_LANES + l] += (run->rate_before[k] - behind[k]) * shift[l];
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
