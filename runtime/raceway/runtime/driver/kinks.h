/* Kinks of the law, located: which side of each every ball is on, where a step changes it, and when to leave one alone.

   switches.h is generated with the scene from the conditions of its laws: switching functions g of a ball's deflection and rate, zero at
   the kinks, and the law with its sides held.  A step is tried with the sides that its start has; where the law can be continued, it is
   smooth within the step whatever the step does.  The step is looked at in RW_LOOKS places: a side changes where g is beyond zero by more
   than a band, which is a part RW_BAND of the error allowed in a step.  Below that a kink does not matter, and a ring that rests on one
   does not count as crossing it by rounding; between looks the parabola through three of them tells who has been on the other side.  The
   step is then repeated so that it ends where g is zero on its dense output, and the sides are turned there.

   Work is bounded.  A step is repeated RW_REPEATS times at most for one kink.  A ball may turn its side back at the very place where it
   turned; the RW_TURNS-th time it is let go.  A crossing that follows the last one of the same ball by less than RW_BRIEF times the step
   tried is brief: such steps do not resolve what crosses (an explicit method at the limit of its stability zigzags about rest), and
   RW_CHATTER brief ones in a row let go as well.  A ball let go obeys the law as it is, stepped over, for RW_REST steps. */
#ifndef RACEWAY_KINKS_H
#define RACEWAY_KINKS_H

#include <string.h>

#include "ensemble_kernels.h"
#include "model.h"

enum { RW_LOOKS = 4, RW_REPEATS = 4, RW_TURNS = 2, RW_CHATTER = 4, RW_REST = 64, RW_ROOT_ITERATIONS = 60 };

/* A root on the dense output is good enough where g is within the part RW_CLOSE of the band. */
static const double RW_BAND = 0.01, RW_BRIEF = 1.5, RW_CLOSE = 0.1;

/* Steps have the clock of pace.h where they are longer than RW_FAR times the time since an onset.  A slope at a step's end is divided by
   the pace there unless it is below RW_LEAST_PACE.  The end of a contact is foreseen no nearer than RW_NEAREST times the step that error
   control proposes, and looked for up to RW_ASTRAY times as far as it was foreseen; a step that leaves less than the part RW_ARRIVED of
   the way there has arrived. */
static const double RW_FAR = 2.0, RW_LEAST_PACE = 0.25, RW_NEAREST = 0.1, RW_ASTRAY = 1.5, RW_ARRIVED = 1e-6;

typedef struct {
    double border[RW_NB][RW_NSWITCHES]; /* in place of the zero of g in the held law: -infinity, infinity, or 0 for a ball let go */
    double side[RW_NSWITCHES][RW_NB];   /* 1 where g > 0, else -1; 0 for a ball let go */
    double seen[RW_LOOKS + 1][RW_NSWITCHES][RW_NB]; /* g at the start of the step and at its looks */
    double place[RW_LOOKS + 1];         /* where these are, as parts of the step's time */
    double slope[2][RW_NB];             /* rate of deflection at the start of the step and at its end */
    double last[RW_NSWITCHES][RW_NB];   /* time of the last crossing [s] */
    double band[RW_NSWITCHES];
    unsigned char turn[RW_NSWITCHES][RW_NB]; /* sides to turn behind the step */
    unsigned char brief[RW_NSWITCHES][RW_NB], still[RW_NSWITCHES][RW_NB]; /* brief crossings in a row, those without a step between */
    unsigned char rest[RW_NSWITCHES][RW_NB]; /* steps for which a ball is let go */
    int resting; /* balls let go */
} rw_sides;

/* Switching functions of all balls at a state and time, and their rates of deflection.  One ball a lane. */
static inline void rw_switch_values(const rw_numbers *n, double t, const double *restrict x, double g[RW_NSWITCHES][RW_NB],
                                    double slope[RW_NB])
{
    double w[RW_NW], r[5], k[RW_NK];
    rw_cage(t, n->u, n->p, n->c, w);
    rw_relative(x, n->u, n->p, n->c, w, r);
    rw_law_numbers(n->p, n->c, k);
    const double cage_cos = w[0], cage_sin = w[1];
#pragma omp simd
    for (int j = 0; j < RW_NB; j++) {
        const double co = rw_cos[j] * cage_cos - rw_sin[j] * cage_sin;
        const double si = rw_sin[j] * cage_cos + rw_cos[j] * cage_sin;
        double at[RW_NSWITCHES];
        slope[j] = r[3] * co + r[4] * si;
        rw_ball_switches(r[0] + r[1] * co + r[2] * si, slope[j], k, at);
        for (int i = 0; i < RW_NSWITCHES; i++) g[i][j] = at[i];
    }
}

static inline void rw_set_side(rw_sides *s, int i, int j, double side)
{
    s->side[i][j] = side;
    s->border[j][i] = side > 0.0 ? -INFINITY : side < 0.0 ? INFINITY : 0.0;
}

/* Sides at the start of a run; `weight` is 1 over the error allowed in a step. */
static inline void rw_sides_start(rw_sides *restrict s, const rw_numbers *n, double t, const double *restrict x, const double *restrict weight)
{
    memset(s, 0, sizeof *s);
    for (int i = 0; i < RW_NSWITCHES; i++) {
        double least = INFINITY; /* weight: of the coarsest state */
        for (int k = 0; k < RW_NQ; k++) {
            const double of = weight[rw_switch_of_rate[i] > 0.0 ? RW_NQ + k : k];
            least = of < least ? of : least;
        }
        s->band[i] = RW_BAND / least;
    }
    rw_switch_values(n, t, x, s->seen[0], s->slope[0]);
    for (int i = 0; i < RW_NSWITCHES; i++)
        for (int j = 0; j < RW_NB; j++) {
            rw_set_side(s, i, j, s->seen[0][i][j] > 0.0 ? 1.0 : -1.0);
            s->last[i][j] = -INFINITY;
        }
}

/* Whether the law on a side of a switch ends there at a branch point. */
static inline int rw_ends(int i, double side) { return (side > 0.0 && rw_ends_above[i] > 0.0) || (side < 0.0 && rw_ends_below[i] > 0.0); }

/* Whether slopes of a switching function come with its values: of a deflection, where rates are computed. */
static inline int rw_has_slope(int i) { return RW_RATES && !(rw_switch_of_rate[i] > 0.0); }

static inline int rw_has_slopes(void)
{
    int all = 1;
    for (int i = 0; i < RW_NSWITCHES; i++) all &= rw_has_slope(i);
    return all;
}

/* Whether a ball has been on its other side between three looks in a row, on its own at all of them, as far as the parabola through them
   tells. */
static inline int rw_is_dip(double before, double here, double behind, double band)
{
    const double bend = before - 2.0 * here + behind, difference = behind - before;
    return (bend > 0.0) & (fabs(difference) <= 2.0 * bend) & (8.0 * (here - band) * bend < difference * difference);
}

/* Whether a step has to be looked at in earnest: the cubics through the values of the switching functions at its ends and their slopes
   tell, at these theta of its looks.  `pace`: paces at the ends, times the step's size. */
static inline int rw_glance(const rw_sides *restrict s, const double theta[RW_LOOKS + 1], const double pace[2])
{
    int found = 0;
    for (int i = 0; i < RW_NSWITCHES; i++) {
        const double band = -s->band[i];
        int any = 0;
#pragma omp simd reduction(| : any)
        for (int j = 0; j < RW_NB; j++) {
            const double side = s->side[i][j], from = side * s->seen[0][i][j], to = side * s->seen[RW_LOOKS][i][j], change = to - from;
            const double first = side * pace[0] * s->slope[0][j], last = side * pace[1] * s->slope[1][j];
            const double level = first - change, tilt = 2.0 * change - (first + last);
            double at[RW_LOOKS + 1];
            at[0] = from;
            at[RW_LOOKS] = to;
#pragma GCC unroll 8
            for (int k = 1; k < RW_LOOKS; k++) at[k] = from + theta[k] * (change + (1.0 - theta[k]) * (level + theta[k] * tilt));
            any |= to < band;
#pragma GCC unroll 8
            for (int k = 1; k < RW_LOOKS; k++) any |= (at[k] < band) | rw_is_dip(at[k - 1], at[k], at[k + 1], band);
        }
        found |= any;
    }
    return found;
}

/* Time of the last onset that has a branch point, of the balls that have not left it since. */
static inline double rw_onset(const rw_sides *restrict s)
{
    double onset = -INFINITY;
    for (int i = 0; i < RW_NSWITCHES; i++)
        for (int j = 0; j < RW_NB; j++)
            if (rw_ends(i, s->side[i][j]) && s->last[i][j] > onset) onset = s->last[i][j];
    return onset;
}

/* Where a ball that all looks find on its side has been on the other between them: the place of the vertex, to be looked at, and the look
   that it replaces; 0 where there is none. */
static inline int rw_dip(const rw_sides *restrict s, double *place)
{
    for (int k = 1; k < RW_LOOKS; k++)
        for (int i = 0; i < RW_NSWITCHES; i++)
            for (int j = 0; j < RW_NB; j++) {
                const double side = s->side[i][j], here = side * s->seen[k][i][j];
                const double before = side * s->seen[k - 1][i][j], behind = side * s->seen[k + 1][i][j];
                if (!rw_is_dip(before, here, behind, -s->band[i])) continue;
                *place = (k - 0.5 * (behind - before) / (behind - 2.0 * here + before)) / RW_LOOKS;
                return k;
            }
    return 0;
}

/* Whether any ball is on its other side at a look. */
static inline int rw_changed(const rw_sides *restrict s, int look)
{
    int changed = 0;
    for (int i = 0; i < RW_NSWITCHES; i++) {
        const double band = -s->band[i];
        int any = 0;
#pragma omp simd reduction(| : any)
        for (int j = 0; j < RW_NB; j++) any |= s->side[i][j] * s->seen[look][i][j] < band;
        changed |= any;
    }
    return changed;
}

/* A ball that leaves its side alone for some time. */
static inline void rw_let_go(rw_sides *s, int i, int j)
{
    if (s->side[i][j] != 0.0) s->resting++;
    rw_set_side(s, i, j, 0.0);
    s->rest[i][j] = RW_REST;
    s->brief[i][j] = 0;
}

/* Turn the sides marked, at a time; `step` is the step tried. */
static inline void rw_turn_sides(rw_sides *s, double time, double step)
{
    for (int i = 0; i < RW_NSWITCHES; i++)
        for (int j = 0; j < RW_NB; j++) {
            if (!s->turn[i][j]) continue;
            s->turn[i][j] = 0;
            const double since = time - s->last[i][j];
            s->brief[i][j] = (unsigned char)(since < RW_BRIEF * step ? s->brief[i][j] + 1 : 0);
            s->still[i][j] = (unsigned char)(since > 0.0 ? 0 : s->still[i][j] + 1);
            s->last[i][j] = time;
            if (s->brief[i][j] >= RW_CHATTER || s->still[i][j] >= RW_TURNS) rw_let_go(s, i, j);
            else rw_set_side(s, i, j, -s->side[i][j]);
        }
}

/* Behind an accepted step: its end is the next start, and balls let go come back in time. */
static inline void rw_sides_move_on(rw_sides *s)
{
    memcpy(s->seen[0], s->seen[RW_LOOKS], sizeof s->seen[0]);
    memcpy(s->slope[0], s->slope[1], sizeof s->slope[0]);
    if (!s->resting) return;
    for (int i = 0; i < RW_NSWITCHES; i++)
        for (int j = 0; j < RW_NB; j++) {
            if (s->side[i][j] != 0.0 || --s->rest[i][j] > 0) continue;
            /* the side that the law takes by itself: nothing jumps */
            rw_set_side(s, i, j, s->seen[0][i][j] > 0.0 ? 1.0 : -1.0);
            s->resting--;
        }
}

#endif
