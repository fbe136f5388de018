/* Derivatives of a run: blocks of directions that follow its steps (sensitivity.h). */
#ifndef BALLPASS_DIFFERENTIATE_H
#define BALLPASS_DIFFERENTIATE_H

#include "locate.h"
#include "run.h"

#ifdef BALLPASS_SENSITIVITIES
/* Largest change of the moving times at a contact: what it adds to a derivative, over its size.  More would be rounding, as where a ball
   touches at zero speed. */
static const double BP_MOST_MOVED = 1e4;

static const double *step_lead(const bp_run *run) { return is_paced(run) ? lead_of(run) : NULL; }

static void tangent_start(bp_run *run, double t)
{
    if (run->tangents && is_explicit(run->method))
        bp_explicit_tangent_start(run->tangents, run->blocks, &run->numbers, run->result->segment, t, run->x);
}

#ifdef BALLPASS_LOCATED
/* How much later than along the times of a block a contact begins or ends, which it does at this time and state with slope f; the
   switching function has a rate there. */
static void contact_moved(const bp_run *run, long block, int event, double rate, double t, const double *x, const double *f, const double *xd,
                          const double *moved, double *later)
{
    double gd[BP_LANES];
    bp_switch_moved(run->tangents, run->blocks, &run->numbers, run->result->segment, block, event, t, x, xd, moved, gd);
    for (int l = 0; l < BP_LANES; l++) {
        double by_time = 0.0, own = 0.0;
        later[l] = -gd[l] / rate;
        for (int k = 0; k < BP_NX; k++) {
            const double shifted = f[k] * later[l] * run->weight[k], size = xd[k * BP_LANES + l] * run->weight[k];
            by_time += shifted * shifted;
            own += size * size;
        }
        if (!(by_time <= BP_MOST_MOVED * BP_MOST_MOVED * own)) later[l] = 0.0;
    }
}

/* Times that move with the contacts that begin at t, where the sides marked are about to turn; `behind` a step, or at its start. */
static void tangent_onset(bp_run *run, double t, int behind)
{
    const bp_sides *s = &run->sides;
    if (!run->tangents || !is_explicit(run->method)) return;
    for (int e = 0; e < BP_FIRST_LOAD; e++) {
        const double rate = s->slope[behind][e];
        if (!s->turn[e] || !bp_ends(e, -s->side[e]) || !(bp_has_rate[e] > 0.0) || rate == 0.0) continue;
        double f[BP_NX], later[BP_LANES];
        bp_explicit_rate(&run->numbers, t, run->x, f);
        for (long b = 0; b < run->tangents->blocks; b++) {
            double *xd = bp_tangent_state(run->tangents, b), *moved = run->blocks[b].moved;
            contact_moved(run, b, e, rate, t, run->x, f, xd, moved, later);
            bp_move(f, later, xd);
            for (int l = 0; l < BP_LANES; l++) moved[l] += later[l];
        }
    }
}

/* Stretch of the step tried that leads to the time at which a contact ends with it; whether there is one. */
static int stretch_to_release(bp_run *run, double t, double h)
{
    const int event = run->release.which;
    const double rate = run->sides.slope[1][event];
    if (!stands_at_end(run) || !(bp_has_rate[event] > 0.0) || rate == 0.0) return 0;
    double f[BP_NX], later[BP_LANES], moved[BP_LANES];
    bp_explicit_rate(&run->numbers, t + h, run->next, f);
    for (long b = 0; b < run->tangents->blocks; b++) {
        bp_tangent_block *own = &run->blocks[b];
        bp_moved_time(own, h, moved);
        contact_moved(run, b, event, rate, t + h, run->next, f, own->next, moved, later);
        for (int l = 0; l < BP_LANES; l++) own->stretch[l] += later[l] / h;
    }
    return 1;
}
#else
#define tangent_onset(run, t, behind) ((void)(behind))
#define stretch_to_release(run, t, h) 0
#endif

static void explicit_tangents(bp_run *run, const bp_explicit_method *plain, double t, double h)
{
    bp_explicit_tangent_step(plain, run->tangents, run->blocks, &run->plain, &run->numbers, run->result->segment, t, run->x, h,
                             step_lead(run), run->next);
}

/* Differentiate the step tried; returns its error, with that of the derivatives where they are controlled. */
static double tangent_step(bp_run *run, double t, double h, double error, int met)
{
    const ballpass_tangents *tangents = run->tangents;
    const bp_explicit_method *plain = explicit_method(run->method);
    const bp_rosenbrock_method *linear = rosenbrock_method(run->method);
    if (!tangents) return error;
    for (long b = 0; b < tangents->blocks; b++)
        memcpy(run->blocks[b].stretch, tangents->stretch + b * BP_LANES, sizeof run->blocks[b].stretch);
    if (plain) {
        explicit_tangents(run, plain, t, h);
        if (met == CUT && stretch_to_release(run, t, h)) explicit_tangents(run, plain, t, h);
    } else {
        bp_rosenbrock_tangent_step(linear, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers,
                                   run->result->segment, t, run->x, h);
    }
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
        bp_tangent_block *own = &run->blocks[b];
        memcpy(bp_tangent_state(run->tangents, b), own->next, sizeof own->next);
        bp_moved_time(own, run->taken.h, own->moved);
        if (!plain || stands_at_end(run)) continue;
        const double pace = pace_at_end(run);
        for (int k = 0; k < BP_NX; k++)
            for (int l = 0; l < BP_LANES; l++) {
                const int i = k * BP_LANES + l;
                own->rate[i] = (own->k[plain->stages][i] - own->stretch[l] * run->plain.k[plain->stages][k]) / pace;
            }
    }
}

/* Derivatives at fixed time of the state y after a part of the step. */
static void tangent_output(bp_run *run, double t, double h, double part, const double *y, int prepared)
{
    const ballpass_tangents *tangents = run->tangents;
    if (!tangents || !tangents->outputs) return;
    const bp_explicit_method *plain = explicit_method(run->method);
    const bp_rosenbrock_method *linear = rosenbrock_method(run->method);
    const double theta = place_of(run, part);
    double *out = tangents->outputs + run->result->written * tangents->blocks * (BP_NX * BP_LANES), slope[BP_NX], moved[BP_LANES];
    if (!prepared && part < 1.0 && plain)
        bp_explicit_tangent_dense(plain, tangents, run->blocks, &run->plain, &run->numbers, run->result->segment, t, run->x, h, step_lead(run));
    bp_explicit_rate(&run->numbers, t + part * h, y, slope);
    for (long b = 0; b < tangents->blocks; b++, out += BP_NX * BP_LANES) {
        bp_tangent_block *own = &run->blocks[b];
        const double *from = bp_tangent_state(tangents, b);
        const double(*dense)[BP_NX * BP_LANES] = (const double(*)[BP_NX * BP_LANES])own->dense;
        if (part >= 1.0) {
            memcpy(out, own->next, sizeof own->next);
        } else if (plain) {
            bp_tangent_explicit_at(plain, dense, from, own->next, theta, out);
        } else {
            if (!prepared) bp_tangent_rosenbrock_dense(linear, (const double(*)[BP_NX * BP_LANES])own->k, own->dense);
            bp_tangent_rosenbrock_at(linear, dense, from, own->next, theta, out);
        }
        bp_moved_time(own, part * h, moved);
        for (int l = 0; l < BP_LANES; l++) moved[l] = -moved[l];
        bp_move(slope, moved, out);
    }
}

/* Into the times of a segment: from fixed time in the first one; else from those of the one before, whose slope at the edge was another
   where a load switches. */
static void tangent_jump(bp_run *run)
{
    const ballpass_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents) return;
    double behind[BP_NX], from[BP_LANES], to[BP_LANES];
    bp_explicit_rate(&run->numbers, 0.0, run->x, behind);
    for (long b = 0; b < tangents->blocks; b++) {
        const long place = (segment * tangents->blocks + b) * BP_LANES;
        const double *shift = tangents->shift + place;
        double *xd = bp_tangent_state(tangents, b), *moved = run->blocks[b].moved;
        memcpy(run->blocks[b].stretch, tangents->stretch + b * BP_LANES, sizeof run->blocks[b].stretch);
        for (int l = 0; l < BP_LANES; l++) {
            from[l] = segment > 0 ? shift[l] - moved[l] : 0.0;
            moved[l] = tangents->moved[place + l];
            to[l] = segment > 0 ? moved[l] - shift[l] : moved[l];
        }
        if (segment > 0) bp_move(run->rate_before, from, xd);
        bp_move(behind, to, xd);
    }
}

/* Back to fixed time, where a run ends at a time within its last segment. */
static void tangent_end(bp_run *run, double time)
{
    double slope[BP_NX], back[BP_LANES];
    if (!run->tangents) return;
    bp_explicit_rate(&run->numbers, time, run->x, slope);
    for (long b = 0; b < run->tangents->blocks; b++) {
        for (int l = 0; l < BP_LANES; l++) back[l] = -run->blocks[b].moved[l];
        bp_move(slope, back, bp_tangent_state(run->tangents, b));
    }
}

#if defined BALLPASS_LOCATED && defined BP_HAS_WINDOWS
/* The same where edges of windows are passed, marked to be turned: one edge after another, each with its own motion.  An edge is met later
   by the change of the switching function over its rate; angles do not jump. */
static void tangent_switch(bp_run *run, double t)
{
    const ballpass_tangents *tangents = run->tangents;
    const bp_numbers *n = &run->numbers;
    if (!tangents) return;
    double before[BP_NX], behind[BP_NX], g[BP_WINDOWS], rate[BP_WINDOWS], gd[BP_WINDOWS * BP_LANES];
    bp_explicit_rate(n, t, run->x, before);
    bp_windows(t, run->x, n->u, n->p, n->c, g, rate);
    for (int w = 0; w < BP_WINDOWS; w++) {
        if (!run->sides.turn[BP_FIRST_WINDOW + w]) continue;
        run->driver.held[bp_window_input[w]] = -run->sides.border[BP_FIRST_WINDOW + w];
        sides_jump(run, t);
        bp_explicit_rate(n, t, run->x, behind);
        for (long b = 0; b < tangents->blocks; b++) {
            bp_step_points points;
            const bp_direction d = bp_tangent_of(tangents, run->blocks, &points, run->result->segment, b).d;
            double *xd = bp_tangent_state(tangents, b);
            bp_windows_tangent_lanes(t, run->x, n->u, n->p, n->c, run->blocks[b].moved, xd, d.u, d.p, d.c, gd);
            for (int k = 0; k < BP_NX; k++)
                for (int l = 0; l < BP_LANES; l++) xd[k * BP_LANES + l] -= (before[k] - behind[k]) * gd[w * BP_LANES + l] / rate[w];
        }
        memcpy(before, behind, sizeof before);
    }
}
#else
#define tangent_switch(run, t) ((void)0)
#endif
#else
#define tangent_switch(run, t) ((void)0)
#define tangent_onset(run, t, behind) ((void)0)
#define tangent_start(run, t) ((void)0)
#define tangent_step(run, t, h, error, met) (error)
#define tangent_accept(run) ((void)0)
#define tangent_output(run, t, h, theta, y, prepared) ((void)(prepared))
#define tangent_jump(run) ((void)0)
#define tangent_end(run, time) ((void)(time))
#endif

#endif
