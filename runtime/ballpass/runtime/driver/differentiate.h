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
    const bp_explicit_method *plain = explicit_method(run->method);
    const bp_rosenbrock_method *linear = rosenbrock_method(run->method);
    const long segment = run->result->segment;
    if (!tangents) return error;
    if (plain)
        bp_explicit_tangent_step(plain, plain->stages, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h, run->next);
    else
        bp_rosenbrock_tangent_step(linear, linear->stages, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers, segment, t,
                                   run->x, h);
    if (!tangents->weight) return error;
    const double theirs = bp_tangent_error(tangents, run->blocks, plain, linear, h);
    return theirs <= error ? error : theirs;
}

/* Take over the derivatives of an accepted step. */
static void tangent_accept(bp_run *run)
{
    if (!run->tangents) return;
    const bp_explicit_method *plain = explicit_method(run->method);
    for (long b = 0; b < run->tangents->blocks; b++) {
        memcpy(bp_tangent_state(run->tangents, b), run->blocks[b].next, sizeof run->blocks[b].next);
        if (plain) memcpy(run->blocks[b].k[0], run->blocks[b].k[plain->stages], sizeof run->blocks[b].k[0]);
    }
}

static void tangent_output(bp_run *run, double t, double h, double theta, int prepared)
{
    const ballpass_tangents *tangents = run->tangents;
    if (!tangents || !tangents->outputs) return;
    const bp_explicit_method *plain = explicit_method(run->method);
    const bp_rosenbrock_method *linear = rosenbrock_method(run->method);
    double *out = tangents->outputs + run->result->written * tangents->blocks * (BP_NX * BP_LANES);
    if (!prepared && theta < 1.0 && plain)
        bp_explicit_tangent_dense(plain, tangents, run->blocks, &run->plain, &run->numbers, run->result->segment, t, run->x, h);
    for (long b = 0; b < tangents->blocks; b++, out += BP_NX * BP_LANES) {
        bp_tangent_block *own = &run->blocks[b];
        const double *from = bp_tangent_state(tangents, b);
        const double(*dense)[BP_NX * BP_LANES] = (const double(*)[BP_NX * BP_LANES])own->dense;
        if (theta >= 1.0) {
            memcpy(out, own->next, sizeof own->next);
        } else if (plain) {
            bp_tangent_explicit_at(plain, dense, from, own->next, theta, out);
        } else {
            if (!prepared) bp_tangent_rosenbrock_dense(linear, (const double(*)[BP_NX * BP_LANES])own->k, own->dense);
            bp_tangent_rosenbrock_at(linear, dense, from, own->next, theta, out);
        }
    }
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

#if defined BALLPASS_LOCATED && defined BP_HAS_WINDOWS
/* Parameter that is the edge of a window nearest to an angle. */
static int nearest_edge(const bp_run *run, int window, double angle)
{
    const int start = bp_window_start[window], end = bp_window_end[window];
    const double turn = 6.283185307179586476925286766559;
    const double before = fabs(remainder(angle - run->numbers.p[start], turn)), behind = fabs(remainder(angle - run->numbers.p[end], turn));
    return before < behind ? start : end;
}

/* The same where the driver passes edges of windows, marked to be turned: one edge after another, each with its own motion.  The driver
   meets an edge later by (edge' - angle')/speed; its angle and speed do not jump. */
static void tangent_switch(bp_run *run, double t)
{
    const ballpass_tangents *tangents = run->tangents;
    if (!tangents) return;
    double before[BP_NX], behind[BP_NX];
    bp_explicit_rate(&run->numbers, t, run->x, before);
    for (int w = 0; w < BP_WINDOWS; w++) {
        if (!run->sides.turn[BP_FIRST_WINDOW + w]) continue;
        const int edge = nearest_edge(run, w, run->x[BP_DRIVER]);
        run->driver.held[bp_window_input[w]] = -run->sides.border[BP_FIRST_WINDOW + w];
        bp_explicit_rate(&run->numbers, t, run->x, behind);
        for (long b = 0; b < tangents->blocks; b++) {
            const double *edge_d = tangents->p + (b * BP_NP + edge) * BP_LANES;
            double *xd = bp_tangent_state(tangents, b), later[BP_LANES];
            for (int l = 0; l < BP_LANES; l++) later[l] = (edge_d[l] - xd[BP_DRIVER * BP_LANES + l]) / run->x[BP_NQ + BP_DRIVER];
            for (int k = 0; k < BP_NX; k++)
                for (int l = 0; l < BP_LANES; l++) xd[k * BP_LANES + l] += (before[k] - behind[k]) * later[l];
        }
        memcpy(before, behind, sizeof before);
    }
}
#else
#define tangent_switch(run, t) ((void)0)
#endif
#else
#define tangent_switch(run, t) ((void)0)
#define tangent_start(run, t) ((void)0)
#define tangent_step(run, t, h, error) (error)
#define tangent_accept(run) ((void)0)
#define tangent_output(run, t, h, theta, prepared) ((void)(prepared))
#define tangent_jump(run) ((void)0)
#endif

#endif
