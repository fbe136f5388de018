/* Steps that end on kinks of the law, and steps near a contact, taken over the square root of time: the use of kinks.h and sqrt_time.h in a
   run.  Compiled in only where BALLPASS_LOCATED is defined. */
#ifndef BALLPASS_LOCATE_H
#define BALLPASS_LOCATE_H

#include "run.h"

enum { NO_KINK = 0, CUT = 1, AT_ONCE = 2 }; /* result of a step: no kink; cut to end on a kink; a kink at its start */

#ifdef BALLPASS_LOCATED
/* The step tried, at a part of its time: the cubic through its ends and their slopes where these are known, else its dense output. */
static void glance_at(const bp_run *run, double part, double *y)
{
    if (is_explicit(run->method)) {
        const double theta = place_of(run, part);
#pragma omp simd
        for (int k = 0; k < BP_NX; k++) {
            const double inner = run->dense[0][k] + theta * run->dense[1][k];
            y[k] = run->x[k] + theta * (run->next[k] - run->x[k] + (1.0 - theta) * inner);
        }
    } else {
        state_at(run, part, y);
    }
}

static void prepare_glance(bp_run *run, double t, double h)
{
    if (is_explicit(run->method)) {
        const int end = explicit_method(run->method)->stages;
#pragma omp simd
        for (int k = 0; k < BP_NX; k++) {
            const double delta = run->next[k] - run->x[k], first = h * run->plain.k[0][k];
            run->dense[0][k] = first - delta;
            run->dense[1][k] = 2.0 * delta - (first + h * run->plain.k[end][k]);
        }
    } else {
        prepare_dense(run, t, h);
    }
}

typedef void bp_view(const bp_run *, double, double *);

/* Check the step tried, before its end by `at`; whether a side changes. */
static int look(bp_run *run, double t, double h, bp_view *at)
{
    bp_sides *s = &run->sides;
    double unused[BP_EVENTS], y[BP_NX], place;
    int changed = 0;
    for (int k = 1; k <= BP_LOOKS; k++) {
        s->place[k] = (double)k / BP_LOOKS;
        if (k < BP_LOOKS) at(run, s->place[k], y);
        bp_switch_values(&run->numbers, t + s->place[k] * h, k < BP_LOOKS ? y : run->next, s->seen[k], k < BP_LOOKS ? unused : s->slope[1]);
        changed |= bp_changed(s, k);
    }
    const int dip = changed ? 0 : bp_dip(s, &place);
    if (dip > 0) {
        s->place[dip] = place;
        at(run, place, y);
        bp_switch_values(&run->numbers, t + place * h, y, s->seen[dip], unused);
        changed = bp_changed(s, dip);
    }
    return changed;
}

/* Whether the step tried has to be checked on its dense output. */
static int glance(bp_run *run, double t, double h)
{
    bp_sides *s = &run->sides;
    if (!bp_has_slopes()) {
        prepare_glance(run, t, h);
        return look(run, t, h, glance_at);
    }
    const double pace[2] = {h * bp_pace(run->lead, 0.0), h * bp_pace(run->lead, 1.0)};
    double theta[BP_LOOKS + 1];
    for (int k = 0; k <= BP_LOOKS; k++) theta[k] = place_of(run, (double)k / BP_LOOKS);
    bp_switch_values(&run->numbers, t + h, run->next, s->seen[BP_LOOKS], s->slope[1]);
    return bp_glance(s, theta, pace);
}

/* A switching function within the step tried. */
static double switch_at(const bp_run *run, double t, double h, double part, bp_view *at, int event)
{
    double y[BP_NX], g[BP_EVENTS], unused[BP_EVENTS];
    if (part < 1.0) at(run, part, y);
    bp_switch_values(&run->numbers, t + part * h, part < 1.0 ? y : run->next, g, unused);
    return g[event];
}

/* Where a ball changes the side that is changed at a checked place: the first root before it, by regula falsi (Illinois). */
static double root_before(const bp_run *run, double t, double h, bp_view *at, int before, int event)
{
    const bp_sides *s = &run->sides;
    const double side = s->side[event];
    int behind = before;
    while (before > 0 && !(side * s->seen[before - 1][event] > 0.0)) behind = --before;
    if (before == 0) return 0.0;
    before--;
    double a = s->place[before], b = s->place[behind], fa = side * s->seen[before][event], fb = side * s->seen[behind][event];
    double root = b;
    int kept = 0; /* end that the last iteration kept: -1 the first, 1 the last */
    for (int k = 0; k < BP_ROOT_ITERATIONS && fb < 0.0; k++) {
        const double next = k % 8 == 7 ? 0.5 * (a + b) : b - fb * (b - a) / (fb - fa), moved = fabs(next - root);
        if (!(next > a && next < b)) break;
        root = next;
        if (!(moved > DBL_EPSILON * root)) break;
        const double f = side * switch_at(run, t, h, root, at, event);
        if (fabs(f) <= BP_CLOSE * s->band[event]) break;
        if (f > 0.0) {
            fb *= kept > 0 ? 0.5 : 1.0;
            a = root, fa = f, kept = 1;
        } else {
            fa *= kept < 0 ? 0.5 : 1.0;
            b = root, fb = f, kept = -1;
        }
    }
    return root;
}

/* The first change of a side in the checked step: its part of the step's time, above 1 where there is none; all that change. */
static double first_change(const bp_run *run, double t, double h, bp_view *at, int *which, unsigned char changed[BP_EVENTS])
{
    const bp_sides *s = &run->sides;
    double first = 2.0;
    for (int e = 0; e < BP_EVENTS; e++)
        for (int k = 1; k <= BP_LOOKS && !changed[e]; k++) {
            if (!(s->side[e] * s->seen[k][e] < -s->band[e])) continue;
            changed[e] = 1;
            const double root = root_before(run, t, h, at, k, e);
            if (root < first) first = root, *which = e;
        }
    return first;
}

/* Pace of a step of size h from t: over the root of the time to a branch point of the law that is near. */
static void set_pace(bp_run *run, double start, double t, double h)
{
    run->lead = 1.0;
    if (!is_explicit(run->method)) return;
    if (run->release.time > t) {
        const double from = run->release.time - t, to = from - h;
        run->lead = bp_lead(from, to > 0.0 ? to : 0.0);
    } else {
        const double from = (start + t) - run->onset;
        if (h > BP_FAR * from) run->lead = bp_lead(from, from + h);
    }
    for (int k = 0; k < BP_NX; k++) run->plain.k[0][k] = run->lead * run->rate[k];
}

/* Size of a step by `factor` longer than the one of size h from t, over its clock: the next, or the same again. */
static double stretched(const bp_run *run, double start, double t, double h, double factor, int next)
{
    if (!is_paced(run)) return h * factor;
    const int ahead = run->release.time > t;
    const double from = ahead ? run->release.time - t : (start + t) - run->onset, to = ahead ? from - h : from + h;
    /* the step was made to end with the contact, as predicted, and the contact continues: the rest is rounding */
    if (next && !(to > BP_ARRIVED * from)) return h * factor;
    const double first = sqrt(from), last = sqrt(to > 0.0 ? to : 0.0), reach = factor * fabs(last - first), base = next ? last : first;
    if (!ahead) return reach * (2.0 * base + reach);
    return reach < base ? reach * (2.0 * base - reach) : base * base;
}

/* Where a step of size h that was refused runs over the end of a contact, the next is paced for it, and `next` is the way there.
   Much shorter than what error control makes of the step it is not taken: a refused step predicts no farther, and a ball that has just
   landed is on its kink. */
static void foresee(bp_run *run, double t, double h, double *next)
{
    if (!is_explicit(run->method) || run->release.time > t) return;
    unsigned char changed[BP_EVENTS] = {0};
    int which = 0;
    prepare_glance(run, t, h);
    if (!look(run, t, h, glance_at)) return;
    const double part = first_change(run, t, h, glance_at, &which, changed);
    if (!(part * h > BP_NEAREST * *next && part < 1.0 && bp_ends(which, run->sides.side[which]))) return;
    *next = part * h;
    run->release = (bp_release){t + *next, which};
}

/* Where the derivatives refuse a step of size h, the end of a contact that comes soon, by the rate of its deflection: before it their
   rate is unbounded, and even steps would approach it without ever passing it.  Once from each place, so that the step that
   aims there may be refused as well. */
static void foresee_by_rate(bp_run *run, double t, double h, double *next)
{
    const bp_sides *s = &run->sides;
    if (!is_explicit(run->method) || run->foreseen == t) return;
    const bp_release known = run->release;
    double soonest = BP_SOON * h;
    run->foreseen = t;
    for (int e = 0; e < BP_FIRST_LOAD; e++) {
        const double ahead = -s->seen[0][e] / s->slope[0][e];
        if (!(bp_has_rate[e] > 0.0 && bp_ends(e, s->side[e]) && s->side[e] * s->slope[0][e] < 0.0)) continue;
        if (!(ahead > 0.0 && ahead < soonest) || (known.time > t && t + ahead > known.time)) continue;
        soonest = ahead;
        run->release = (bp_release){t + ahead, e};
        *next = ahead;
    }
}

#ifdef BP_HAS_WINDOWS
static const double BP_TURN = 6.283185307179586476925286766559;

/* Distance of an edge ahead of an angle, in the direction of motion [rad]. */
static double ahead_of(double edge, double angle, double way)
{
    const double rest = fmod(way < 0.0 ? angle - edge : edge - angle, BP_TURN);
    return rest < 0.0 ? rest + BP_TURN : rest;
}

/* Part of the step tried that passes no whole window, nor a whole gap: at its ends that would not show. */
static double within_windows(const bp_run *run, double t, double h)
{
    const bp_numbers *n = &run->numbers;
    double from[BP_WINDOWS], to[BP_WINDOWS], start[BP_WINDOWS], end[BP_WINDOWS], part = 1.0;
    bp_window_edges(t + h, run->next, n->u, n->p, n->c, to, start, end);
    bp_window_edges(t, run->x, n->u, n->p, n->c, from, start, end);
    for (int w = 0; w < BP_WINDOWS; w++) {
        const double way = to[w] - from[w];
        if (start[w] == end[w] || fabs(end[w] - start[w]) >= BP_TURN) continue;
        const double one = ahead_of(start[w], from[w], way), other = ahead_of(end[w], from[w], way);
        const double last = one > other ? one : other, between = 0.5 * (one + other);
        if (last < fabs(way) && between < part * fabs(way)) part = between / fabs(way);
    }
    return part;
}
#else
#define within_windows(run, t, h) 1.0
#endif

/* Whether the step tried changes a side.  Then it is repeated with a length that ends on the first kink, and `h` is that length; the sides
   to turn there are marked.  `aimed`: it was made to end where a contact does, and may become longer for it, up to `longest`. */
static int locate(bp_run *run, double start, double t, double *h, double *error, double resolution, int aimed, double longest)
{
    bp_sides *s = &run->sides;
    ballpass_result *result = run->result;
    for (double part = within_windows(run, t, *h); part < 1.0; part = within_windows(run, t, *h)) {
        result->rejected++;
        *h *= part;
        set_pace(run, start, t, *h);
        *error = try_step(run, t, *h);
        if (!(*error >= 0.0 && *error <= 1.0 && within_reach(run))) return NO_KINK;
    }
    const double tried = *h;
    unsigned char changed[BP_EVENTS] = {0};
    const double farthest = aimed && BP_ASTRAY * tried < longest ? BP_ASTRAY * tried : aimed ? longest : tried;
    double reach = tried;
    int which = run->release.which, met;
    met = glance(run, t, tried);
    if (met) {
        prepare_dense(run, t, tried);
        met = look(run, t, tried, state_at);
    }
    if (!met && !aimed) return NO_KINK;
    if (met) reach = first_change(run, t, tried, state_at, &which, changed) * tried;
    const int ends = is_explicit(run->method) && bp_ends(which, s->side[which]);
    double scale = 0.0;
    for (int e = 0; e < BP_EVENTS; e++)
        if (bp_of_rate[e] == bp_of_rate[which]) scale = fabs(s->seen[0][e]) > scale ? fabs(s->seen[0][e]) : scale;
    const double band = s->band[which], least = 1e-6 * band, rounding = 4.0 * DBL_EPSILON * scale;
    /* after a branch point of the law its slope is unbounded: a linearly implicit step stays on the other side */
    const double clear = is_explicit(run->method) ? 0.0 : bp_ends(which, 1.0) ? -1.0 : bp_ends(which, -1.0) ? 1.0 : 0.0;
    const double goal = clear * (least > rounding ? least : rounding);
    double length = tried; /* of the step at hand */
    for (int k = 0; k < BP_REPEATS; k++) {
        if (!(reach > resolution)) {
            s->turn[which] = 1;
            result->rejected++;
            return AT_ONCE;
        }
        if (reach != length) {
            length = reach;
            result->rejected++;
            if (ends) run->release = (bp_release){t + reach, which};
            set_pace(run, start, t, reach);
            const double again = try_step(run, t, reach);
            *h = reach;
            *error = again;
            if (!(again >= 0.0 && again <= 1.0 && within_reach(run))) return NO_KINK;
        }
        bp_switch_values(&run->numbers, t + reach, run->next, s->seen[BP_LOOKS], s->slope[1]);
        const double left = s->seen[BP_LOOKS][which];
        if (fabs(left) <= band && !(clear * left < 0.0)) break;
        double slope = s->slope[1][which];
        if (!(bp_has_rate[which] > 0.0)) {
            const double back = 1.0 / 64.0;
            prepare_dense(run, t, reach);
            slope = (left - switch_at(run, t, reach, 1.0 - back, state_at, which)) / (back * reach);
        }
        const double moved = reach - (left - goal) / slope;
        if (aimed && !met && !(s->side[which] * slope < 0.0 && moved <= farthest)) return NO_KINK; /* contact continues */
        if (!(moved > 0.0 && moved <= farthest)) break;
        if (k + 1 < BP_REPEATS) reach = moved;
    }
    for (int e = 0; e < BP_EVENTS; e++) s->turn[e] = changed[e] && s->side[e] * s->seen[BP_LOOKS][e] <= s->band[e];
    s->turn[which] = 1;
    return CUT;
}

#ifdef BP_HAS_BORDERS
/* Borders of the sides, among the inputs. */
static void hold_borders(bp_run *run)
{
#ifdef BP_HAS_WINDOWS
    for (int w = 0; w < BP_WINDOWS; w++) run->driver.held[bp_window_input[w]] = run->sides.border[BP_FIRST_WINDOW + w];
#endif
#ifdef BP_HAS_STOPS
    for (int k = 0; k < BP_STOPS; k++) run->driver.held[bp_stop_input[k]] = run->sides.border[BP_FIRST_STOP + k];
#endif
}

/* Inputs of the segment, and those that hold sides. */
static void segment_inputs(bp_run *run, const double *u)
{
    memcpy(run->driver.held, u, sizeof run->driver.held);
    run->numbers.u = run->driver.held;
    hold_borders(run);
}
#else
#define segment_inputs(run, values) ((run)->numbers.u = (values))
#define hold_borders(run) ((void)0)
#endif

#ifdef BP_HAS_WINDOWS
/* Note passages of edges: a driver that returns to one at once, many times, has stalled there. */
static void note_passages(bp_run *run, double time)
{
    double g[BP_WINDOWS], rate[BP_WINDOWS]; /* at an edge the slope over the angle is one */
    bp_windows(time, run->x, run->numbers.u, run->numbers.p, run->numbers.c, g, rate);
    for (int w = 0; w < BP_WINDOWS; w++)
        if (run->sides.turn[BP_FIRST_WINDOW + w] && bp_window_of_driver[w])
            run->driver.come_back =
                (time - run->sides.last[BP_FIRST_WINDOW + w]) * fabs(rate[w]) < BP_STALL_ANGLE ? run->driver.come_back + 1 : 0;
}

#define start_passages(run) ((run)->driver.come_back = 0)
#define has_stalled(run) ((run)->driver.come_back >= BP_STALLED)
#else
#define note_passages(run, time) ((void)0)
#define start_passages(run) ((void)0)
#define has_stalled(run) 0
#endif

/* Turn the sides marked: the slopes at (t, x) are new. */
static void turn_sides(bp_run *run, double time, double step)
{
    note_passages(run, time);
    bp_turn_sides(&run->sides, time, step);
    hold_borders(run);
    run->onset = bp_onset(&run->sides);
    if (run->onset == time && run->step > run->touch) run->step = run->touch;
    run->release.time = NAN;
    run->result->kinks++;
}

/* The numbers point into the run itself. */
static void sides_here(bp_run *run)
{
    run->numbers.border = run->sides.border;
    hold_borders(run);
}

/* After a jump of an input, or of the gate of an effect. */
static void sides_jump(bp_run *run, double t) { bp_sides_jump(&run->sides, &run->numbers, t, run->x); }

static void sides_start(bp_run *run, double t)
{
    run->lead = 1.0;
    bp_sides_start(&run->sides, &run->numbers, t, run->x, run->weight);
    sides_here(run);
    start_passages(run);
    run->onset = -INFINITY;
    run->touch = INFINITY;
}

/* No side is turned: the step is refused. */
static void keep_sides(bp_run *run) { memset(run->sides.turn, 0, sizeof run->sides.turn); }

/* Sides for the current method. */
static void sides_of_method(bp_run *run)
{
#ifdef BALLPASS_SENSITIVITIES
    bp_locate_balls(&run->sides, is_explicit(run->method));
    hold_borders(run);
#else
    (void)run;
#endif
}

/* Pace at the end of the step taken, and whether it is too slow to give the slope there. */
static double pace_at_end(const bp_run *run) { return bp_pace(run->lead, 1.0); }
static int stands_at_end(const bp_run *run) { return pace_at_end(run) < BP_LEAST_PACE; }

static void sides_move_on(bp_run *run)
{
    bp_sides_move_on(&run->sides);
    hold_borders(run);
}

/* After the first step from an onset: how long it could have been. */
static void remember_touch(bp_run *run, double h, double factor)
{
    if (run->lead == 0.0) run->touch = h * factor * factor;
}

/* The coming times are those of another segment. */
static void forget_release(bp_run *run)
{
    run->release = (bp_release){NAN, 0};
    run->foreseen = NAN;
}

/* Whether a step is to end at the predicted end of a contact, no farther than `longest`; `h` is then the distance to it. */
static int aim(bp_run *run, double t, double longest, double resolution, double *h)
{
    const double ahead = run->release.time - t;
    if (!(ahead > 0.0)) return 0;
    if (!(ahead > resolution)) {
        run->release.time = NAN;
        return 0;
    }
    if (!(ahead <= *h * 1.0001 && ahead <= longest)) return 0;
    *h = ahead;
    return 1;
}
#else
#define locate(run, start, t, h, error, resolution, aimed, longest) ((void)(aimed), NO_KINK)
#define turn_sides(run, time, step) ((void)(time), (void)(step))
#define segment_inputs(run, values) ((run)->numbers.u = (values))
#define has_stalled(run) 0
#define sides_start(run, t) ((void)0)
#define sides_jump(run, t) ((void)0)
#define sides_here(run) ((void)0)
#define sides_of_method(run) ((void)0)
#define keep_sides(run) ((void)0)
#define pace_at_end(run) 1.0
#define stands_at_end(run) 0
#define sides_move_on(run) ((void)0)
#define remember_touch(run, h, factor) ((void)0)
#define forget_release(run) ((void)0)
#define aim(run, t, longest, resolution, h) ((void)(longest), 0)
#define set_pace(run, start, t, h) ((void)0)
#define stretched(run, start, t, h, factor, next) ((h) * (factor))
#define foresee(run, t, h, next) ((void)0)
#define foresee_by_rate(run, t, h, next) ((void)0)
#endif

#endif
