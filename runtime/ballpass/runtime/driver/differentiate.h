/* Derivatives of a run: blocks of directions that follow its steps (sensitivity.h). */
#ifndef BALLPASS_DIFFERENTIATE_H
#define BALLPASS_DIFFERENTIATE_H

#include "run.h"

#ifdef BALLPASS_SENSITIVITIES
static void tangent_start(bp_run *run, double t)
{
    if (run->tangents && is_explicit(run->method))
        bp_explicit_tangent_start(run->tangents, run->blocks, &run->numbers, run->result->segment, t, run->x, run->plain.k[0]);
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

/* Derivatives at fixed time of the state y at theta of the step. */
static void tangent_output(bp_run *run, double t, double h, double theta, const double *y, int prepared)
{
    const ballpass_tangents *tangents = run->tangents;
    if (!tangents || !tangents->outputs) return;
    const bp_explicit_method *plain = explicit_method(run->method);
    const bp_rosenbrock_method *linear = rosenbrock_method(run->method);
    double *out = tangents->outputs + run->result->written * tangents->blocks * (BP_NX * BP_LANES);
    if (!prepared && theta < 1.0 && plain)
        bp_explicit_tangent_dense(plain, tangents, run->blocks, &run->plain, &run->numbers, run->result->segment, t, run->x, h);
    double slope[BP_NX];
    bp_explicit_rate(&run->numbers, t + theta * h, y, slope);
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
        bp_move(tangents, run->result->segment, b, t + theta * h, slope, -1.0, out);
    }
}

/* Derivatives of the states, at fixed time (sign 1) or along moving times (-1), the other way, at a time within a segment. */
static void tangent_turn(bp_run *run, double time, double sign)
{
    const ballpass_tangents *tangents = run->tangents;
    double slope[BP_NX];
    bp_explicit_rate(&run->numbers, time, run->x, slope);
    for (long b = 0; b < tangents->blocks; b++)
        bp_move(tangents, run->result->segment, b, time, slope, sign, bp_tangent_state(tangents, b));
}

/* Where a load switches at a time that does not move with t', the derivative jumps; the first segment brings that at fixed time. */
static void tangent_jump(bp_run *run)
{
    const ballpass_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents) return;
    if (segment == 0) {
        tangent_turn(run, 0.0, 1.0);
        return;
    }
    double behind[BP_NX];
    bp_explicit_rate(&run->numbers, 0.0, run->x, behind);
    for (long b = 0; b < tangents->blocks; b++) {
        const long place = (segment * tangents->blocks + b) * BP_LANES;
        const double *shift = tangents->shift + place, *moved = tangents->moved + place;
        double *xd = bp_tangent_state(tangents, b);
        for (int k = 0; k < BP_NX; k++)
            for (int l = 0; l < BP_LANES; l++) xd[k * BP_LANES + l] += (run->rate_before[k] - behind[k]) * (shift[l] - moved[l]);
    }
}

/* A run that ends at a time within its last segment. */
static void tangent_end(bp_run *run, double time)
{
    if (run->tangents) tangent_turn(run, time, -1.0);
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
#define tangent_output(run, t, h, theta, y, prepared) ((void)(prepared))
#define tangent_jump(run) ((void)0)
#define tangent_end(run, time) ((void)(time))
#endif

#endif
