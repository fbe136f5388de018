/* Events, located: which side of each switching function the state is on, where a step changes it, and when a kink is no longer located.

   switches.h is generated with the scene from the conditions of its laws: switching functions g of a ball's deflection and rate, zero at
   the kinks, and the law with its sides held.  A step is tried with the sides that its start has; where the law can be continued, it is
   smooth within any step.  The step is checked at BP_LOOKS places: a side changes where g is beyond zero by more
   than a band, which is a part BP_BAND of the error allowed in a step.  Below that a kink does not matter, and a ring that rests on one
   does not count as crossing it by rounding; between these places the parabola through three of them shows a ball that has been on the
   other side.  The step is then repeated so that it ends where g is zero on its dense output, and the sides are turned there.

   Work is bounded.  A step is repeated BP_REPEATS times at most for one kink.  A ball may turn its side back at the very place where it
   turned; the BP_TURNS-th time it is released.  A crossing that follows the last one of the same ball by less than BP_BRIEF times the step
   tried is brief: such steps do not resolve what crosses (an explicit method at the limit of its stability zigzags about rest), and
   BP_CHATTER brief ones in a row release it as well.  Steps go over the kinks of a released ball for BP_REST steps. */
#ifndef BALLPASS_KINKS_H
#define BALLPASS_KINKS_H

#include <string.h>

#include "model.h"

enum { BP_LOOKS = 4, BP_REPEATS = 4, BP_TURNS = 2, BP_CHATTER = 4, BP_REST = 64, BP_ROOT_ITERATIONS = 60 };

/* A root on the dense output is good enough where g is within the part BP_CLOSE of the band. */
static const double BP_BAND = 0.01, BP_BRIEF = 1.5, BP_CLOSE = 0.1;

/* Steps have the clock of sqrt_time.h where they are longer than BP_FAR times the time since an onset.  A slope at a step's end is divided by
   the pace there unless it is below BP_LEAST_PACE.  The end of a contact is foreseen no nearer than BP_NEAREST times the step that error
   control proposes, and looked for up to BP_ASTRAY times as far as it was foreseen; a step that leaves less than the part BP_ARRIVED of
   the way there has arrived.  Derivatives foresee it up to BP_SOON times the step that they refuse. */
static const double BP_FAR = 2.0, BP_LEAST_PACE = 0.25, BP_NEAREST = 0.1, BP_ASTRAY = 1.5, BP_ARRIVED = 1e-6, BP_SOON = 4.0;

/* Events of loads start here, those of the balls are before.  Second derivatives of the law are not held, and the clock of sqrt_time.h is
   one of explicit methods: linearly implicit steps with derivatives locate the events of loads alone. */
#if defined BP_HAS_WINDOWS
enum { BP_FIRST_LOAD = BP_FIRST_WINDOW }; /* stops follow them */
#elif defined BP_HAS_STOPS
enum { BP_FIRST_LOAD = BP_FIRST_STOP };
#else
enum { BP_FIRST_LOAD = BP_EVENTS };
#endif

typedef struct {
    double border[BP_EVENTS]; /* in place of the zero of g in the held law: -infinity, infinity, or 0 for a released event */
    double side[BP_EVENTS];   /* 1 where g > 0, else -1; 0 for a released event */
    double seen[BP_LOOKS + 1][BP_EVENTS]; /* g at the start of the step and at its checked places */
    double place[BP_LOOKS + 1];           /* where these are, as parts of the step's time */
    double slope[2][BP_EVENTS];           /* rate of g at the start of the step and at its end, where there is one */
    double last[BP_EVENTS];               /* time of the last crossing [s] */
    double band[BP_EVENTS];
    unsigned char turn[BP_EVENTS];  /* sides to turn after the step */
    unsigned char brief[BP_EVENTS], still[BP_EVENTS]; /* brief crossings in a row, those without a step between */
    unsigned char rest[BP_EVENTS];  /* steps for which an event is released */
    int resting; /* released events */
    int first;   /* events before this one are not located */
} bp_sides;

/* Switching functions of all events at a state and time, and their rates.  One ball a lane. */
static inline void bp_switch_values(const bp_numbers *n, double t, const double *restrict x, double *restrict g, double *restrict slope)
{
    double w[BP_NW], r[BP_NR];
    bp_cage(t, n->u, n->p, n->c, w);
    bp_relative(x, n->u, n->p, n->c, w, r);
#define BP_SWITCH(b)                                                                                                  \
    {                                                                                                                 \
        enum { here = BP_##b##_SWITCHES * BP_##b##_BALLS };                                                           \
        BP_BALLS(b, 2 * BP_##b##_SWITCHES + 1) /* one more: a bearing may have none */                                 \
        bp_##b##_switches_lanes(co, si, r + bp_first_relative[bearing], k, rows);                                                        \
        memcpy(g + bp_first_event[bearing], rows, here * sizeof *rows);                                                  \
        memcpy(slope + bp_first_event[bearing], rows + here, here * sizeof *rows);                                       \
    }
    BP_EACH_BEARING(BP_SWITCH)
#undef BP_SWITCH
#ifdef BP_HAS_WINDOWS
    bp_windows(t, x, n->u, n->p, n->c, g + BP_FIRST_WINDOW, slope + BP_FIRST_WINDOW);
#endif
#ifdef BP_HAS_STOPS
    bp_stops(t, x, n->u, n->p, n->c, g + BP_FIRST_STOP, slope + BP_FIRST_STOP);
#endif
}

static inline void bp_set_side(bp_sides *s, int e, double side)
{
    s->side[e] = side;
    s->border[e] = side > 0.0 ? -INFINITY : side < 0.0 ? INFINITY : 0.0;
}

/* Sides at the start of a run; `weight` is 1 over the error allowed in a step. */
static inline void bp_sides_start(bp_sides *restrict s, const bp_numbers *n, double t, const double *restrict x, const double *restrict weight)
{
    memset(s, 0, sizeof *s);
    bp_switch_values(n, t, x, s->seen[0], s->slope[0]);
#ifdef BP_HAS_WINDOWS
    double turned[BP_WINDOWS * BP_NX];
    bp_windows_by_state(t, x, n->u, n->p, n->c, turned);
#endif
#ifdef BP_HAS_STOPS
    double moved[BP_STOPS * BP_NX];
    bp_stops_by_state(t, x, n->u, n->p, n->c, moved);
#endif
    for (int e = 0; e < BP_EVENTS; e++) {
        double least = INFINITY; /* weight: of the coarsest state */
        for (int k = 0; k < BP_NQ; k++) {
            if (bp_is_angle[k]) continue;
            const double of = weight[bp_of_rate[e] > 0.0 ? BP_NQ + k : k];
            least = of < least ? of : least;
        }
        s->band[e] = BP_BAND / least;
#ifdef BP_HAS_WINDOWS
        if (e >= BP_FIRST_WINDOW && e < BP_FIRST_WINDOW + BP_WINDOWS) { /* of what the states turn */
            s->band[e] = 0.0;
            for (int k = 0; k < BP_NX; k++) s->band[e] += BP_BAND * fabs(turned[(e - BP_FIRST_WINDOW) * BP_NX + k]) / weight[k];
        }
#endif
#ifdef BP_HAS_STOPS
        if (e >= BP_FIRST_STOP) { /* of what the states move; none where the drive alone does */
            s->band[e] = 0.0;
            for (int k = 0; k < BP_NX; k++) s->band[e] += BP_BAND * fabs(moved[(e - BP_FIRST_STOP) * BP_NX + k]) / weight[k];
        }
#endif
        bp_set_side(s, e, s->seen[0][e] > 0.0 ? 1.0 : -1.0);
        s->last[e] = -INFINITY;
    }
}

/* Locate the events of the balls, or not. */
static inline void bp_locate_balls(bp_sides *s, int located)
{
    const int first = located ? 0 : BP_FIRST_LOAD;
    if (first == s->first) return;
    s->first = first;
    for (int e = 0; e < BP_FIRST_LOAD; e++) {
        s->resting -= !located && s->side[e] == 0.0;
        bp_set_side(s, e, !located ? 0.0 : s->seen[0][e] > 0.0 ? 1.0 : -1.0);
    }
}

/* Whether the law on a side of a switch ends there at a branch point. */
static inline int bp_ends(int e, double side) { return (side > 0.0 && bp_ends_above[e] > 0.0) || (side < 0.0 && bp_ends_below[e] > 0.0); }

/* Whether the rate of every switching function comes with its value. */
static inline int bp_has_slopes(void)
{
    int all = 1;
    for (int e = 0; e < BP_EVENTS; e++) all &= bp_has_rate[e] > 0.0;
    return all;
}

/* Whether, by the parabola through three checked places in a row, a ball that is on its own side at all of them has been on its other
   side between them. */
static inline int bp_is_dip(double before, double here, double behind, double band)
{
    const double bend = before - 2.0 * here + behind, difference = behind - before;
    return (bend > 0.0) & (fabs(difference) <= 2.0 * bend) & (8.0 * (here - band) * bend < difference * difference);
}

/* Whether a step has to be checked on its dense output: estimated by the cubics through the values and slopes of the switching
   functions at its ends, at these theta of its checked places.  `pace`: paces at the ends, times the step's size. */
static inline int bp_glance(const bp_sides *restrict s, const double theta[BP_LOOKS + 1], const double pace[2])
{
    int any = 0;
#pragma omp simd reduction(| : any)
    for (int e = 0; e < BP_EVENTS; e++) {
        const double band = -s->band[e];
        const double side = s->side[e], from = side * s->seen[0][e], to = side * s->seen[BP_LOOKS][e], change = to - from;
        const double first = side * pace[0] * s->slope[0][e], last = side * pace[1] * s->slope[1][e];
        const double level = first - change, tilt = 2.0 * change - (first + last);
        double at[BP_LOOKS + 1];
        at[0] = from;
        at[BP_LOOKS] = to;
#pragma GCC unroll 8
        for (int k = 1; k < BP_LOOKS; k++) at[k] = from + theta[k] * (change + (1.0 - theta[k]) * (level + theta[k] * tilt));
        any |= to < band;
#pragma GCC unroll 8
        for (int k = 1; k < BP_LOOKS; k++) any |= (at[k] < band) | bp_is_dip(at[k - 1], at[k], at[k + 1], band);
    }
    return any;
}

/* Time of the last onset that has a branch point, of the events that have not turned back since. */
static inline double bp_onset(const bp_sides *restrict s)
{
    double onset = -INFINITY;
    for (int e = 0; e < BP_EVENTS; e++)
        if (bp_ends(e, s->side[e]) && s->last[e] > onset) onset = s->last[e];
    return onset;
}

/* Where an event that is on its side at all checked places has been on the other between them: the place of the vertex, to be checked,
   and the place that it replaces; 0 where there is none. */
static inline int bp_dip(const bp_sides *restrict s, double *place)
{
    for (int k = 1; k < BP_LOOKS; k++)
        for (int e = 0; e < BP_EVENTS; e++) {
            const double side = s->side[e], here = side * s->seen[k][e];
            const double before = side * s->seen[k - 1][e], behind = side * s->seen[k + 1][e];
            if (!bp_is_dip(before, here, behind, -s->band[e])) continue;
            *place = (k - 0.5 * (behind - before) / (behind - 2.0 * here + before)) / BP_LOOKS;
            return k;
        }
    return 0;
}

/* Whether any event is on its other side at a checked place. */
static inline int bp_changed(const bp_sides *restrict s, int look)
{
    int any = 0;
#pragma omp simd reduction(| : any)
    for (int e = 0; e < BP_EVENTS; e++) any |= s->side[e] * s->seen[look][e] < -s->band[e];
    return any;
}

/* An event that is not located for some time. */
static inline void bp_let_go(bp_sides *s, int e)
{
    if (s->side[e] != 0.0) s->resting++;
    bp_set_side(s, e, 0.0);
    s->rest[e] = BP_REST;
    s->brief[e] = 0;
}

/* Turn the sides marked, at a time; `step` is the step tried. */
static inline void bp_turn_sides(bp_sides *s, double time, double step)
{
    for (int e = 0; e < BP_EVENTS; e++) {
        if (!s->turn[e]) continue;
        s->turn[e] = 0;
        const double since = time - s->last[e];
        s->brief[e] = (unsigned char)(since < BP_BRIEF * step ? s->brief[e] + 1 : 0);
        s->still[e] = (unsigned char)(since > 0.0 ? 0 : s->still[e] + 1);
        s->last[e] = time;
        if (s->brief[e] >= BP_CHATTER || s->still[e] >= BP_TURNS) bp_let_go(s, e);
        else bp_set_side(s, e, -s->side[e]);
    }
}

/* Sides of the balls where an effect on them begins or ends: deflections and rates jump there, and so do switching functions.  Those that
   are about to turn by themselves do so afterwards. */
static inline void bp_sides_jump(bp_sides *restrict s, const bp_numbers *n, double t, const double *restrict x)
{
    bp_switch_values(n, t, x, s->seen[0], s->slope[0]);
    for (int e = s->first; e < BP_FIRST_LOAD; e++)
        if (!s->turn[e] && s->side[e] * s->seen[0][e] < -s->band[e]) bp_set_side(s, e, -s->side[e]);
}

/* After an accepted step: its end is the next start, and released events return after their steps. */
static inline void bp_sides_move_on(bp_sides *s)
{
    memcpy(s->seen[0], s->seen[BP_LOOKS], sizeof s->seen[0]);
    memcpy(s->slope[0], s->slope[1], sizeof s->slope[0]);
    if (!s->resting) return;
    for (int e = s->first; e < BP_EVENTS; e++) {
        if (s->side[e] != 0.0 || --s->rest[e] > 0) continue;
        /* the side that the law takes by itself: nothing jumps */
        bp_set_side(s, e, s->seen[0][e] > 0.0 ? 1.0 : -1.0);
        s->resting--;
    }
}

#endif
