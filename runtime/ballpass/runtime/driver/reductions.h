/* On-line reductions: extremes with their times, mean and mean square of channels, from the dense output of every accepted step.

   Channels are the states, then for each bearing four quantities of its balls, each with its value of the most loaded ball: total force,
   elastic force, damping force, deflection.  Every step is evaluated at its quarters, theta = 0, 1/4, 1/2, 3/4, 1; those of methods
   whose dense output is of a degree above four, as two steps of half the size.

   Integrals are taken by Boole's rule; squares of states over the polynomial of degree four through the five values, which is exact for
   all methods but these; squares of the balls' quantities by Boole's rule as well, for where these jump a polynomial swings.  The most loaded
   ball has kinks where two balls change rank, where it comes into contact or leaves it, and where its damping ends that is one-sided.  A step
   with such a cut is integrated piece by piece between its cuts, by Gauss's rule, and one near a contact over its own pace (sqrt_time.h).

   Extremes: that polynomial is searched for tops, all of them, wherever it may reach beyond the extreme known so far; the channel is
   evaluated there from the dense output, and refined where it is not what the polynomial promised.  For states and all other
   methods the polynomial is the dense output itself, and no extreme is missed.  An extreme is always a value that the solution takes, never
   an extrapolation across a kink.

   What fatigue needs of a bearing follows behind: the angle that its inner ring turns against the outer one, in either sense, as an
   integral, for fatigue counts passes.  Where it is wanted, the power of the balls' loads that the rolling element's life takes, loads in kN
   and nothing where they pull, is added up over this angle at the places of both raceways: these are hat functions, BP_SECTORS of them, in
   the ring's own coordinates, and what a ball gives in a step acts at its centroid, so that amount and first moment are right.

   The most loaded ball has kinks where two balls change rank.  Its largest value is the largest of any ball, whose tops are looked for
   one ball after the other; its smallest is looked for where the ranks change as well.  Where a law jumps at contact, the force has its
   extreme beside the jump.  A quarter of a step with a change of rank or contact is searched by halves, to 1e-6 of the extreme.  Of extremes
   that differ by less than the tolerance of the run the first is taken.

   A reduction is a row of BP_REDUCTION numbers, which a run adds to: it can go on in another call. */
#ifndef BALLPASS_REDUCTIONS_H
#define BALLPASS_REDUCTIONS_H

#include <string.h>

#include "model.h"
#include "powers.h"
#include "reduction_tables.h"
#include "sqrt_time.h"

enum { BP_POINTS = 5 };

enum {
    BP_REFINEMENTS = 28, /* evaluations spent on a top at most, besides the first; that of a state takes no more */
    BP_CELLS = 16        /* parts of a step in which the slope of a channel may change its sign */
};

/* Of what few steps call: kept out of the code that all of them run, and compiled for size, which takes gcc 0.13 s less. */
#define BP_SELDOM __attribute__((noinline, cold)) static

/* The most that is wanted of the channels from the `first` on: 0 nothing, 1 what is asked for, between them what only guards the run. */
static inline double bp_wanted(const double *reduction, int first)
{
    double most = 0.0;
    for (int row = 0; row < BP_EXTREMES + BP_MOMENTS; row++)
        for (int k = first; k < BP_CHANNELS; k++) {
            const double wanted = reduction[BP_WANTED + row * BP_CHANNELS + k];
            most = wanted > most ? wanted : most;
        }
    return most;
}

/* How far a channel may reach beyond its values at the quarters of a step, as a part of their range. */
static const double BP_BEYOND = 0.5;

/* Parts that a step is taken in: more than a degree of four five points do not tell. */
static inline int bp_parts(int dense_degree) { return dense_degree < BP_POINTS ? 1 : 2; }

/* Weights of Boole's rule. */
static const double bp_boole[BP_POINTS] = {7.0 / 90.0, 32.0 / 90.0, 12.0 / 90.0, 32.0 / 90.0, 7.0 / 90.0};

/* Quantities of all balls at a state and time: for each bearing BP_BALL_CHANNELS rows, one entry a ball.  At least one: C knows no arrays
   without entries. */
enum { BP_BALL_QUANTITIES = BP_NB > 0 ? BP_BALL_CHANNELS * BP_NB : 1 };

static inline void bp_ball_quantities(const bp_numbers *n, double t, const double *restrict x, double *restrict q)
{
    double w[BP_NW], r[BP_NR];
    bp_cage(t, n->u, n->p, n->c, w);
    bp_relative(x, n->u, n->p, n->c, w, r);
#define BP_CONTACT(b)                                                                                  \
    {                                                                                                  \
        BP_BALLS(b, BP_BALL_CHANNELS)                                                                  \
        bp_##b##_contact_lanes(co, si, r + bp_first_relative[bearing], k, rows);                                          \
        memcpy(q + BP_BALL_CHANNELS * bp_first_ball[bearing], rows, sizeof rows);                         \
    }
    BP_EACH_BEARING(BP_CONTACT)
#undef BP_CONTACT
}

/* Row of a channel of the balls, counted behind the states, among these quantities, and its balls. */
static inline const double *bp_ball_row(const double *q, int channel, int *balls)
{
    const int bearing = channel / BP_BALL_CHANNELS;
    *balls = bp_first_ball[bearing + 1] - bp_first_ball[bearing];
    return q + BP_BALL_CHANNELS * bp_first_ball[bearing] + channel % BP_BALL_CHANNELS * *balls;
}

/* All channels at a state and time, and all quantities of the balls; those of the balls are zero where they are not wanted. */
static inline void bp_channels(const bp_numbers *n, double t, const double *restrict x, int balls, double *restrict value,
                               double *restrict q)
{
    for (int k = 0; k < BP_NX; k++) value[k] = x[k];
    for (int k = BP_NX; k < BP_CHANNELS; k++) value[k] = 0.0;
    if (!balls) return;
    bp_ball_quantities(n, t, x, q);
#define BP_MOST(b)                                                                                     \
    for (int k = 0; k < BP_BALL_CHANNELS; k++) {                                                       \
        const double *of = q + BP_BALL_CHANNELS * bp_first_ball[bearing] + k * BP_##b##_BALLS;            \
        double most = -INFINITY;                                                                       \
        _Pragma("omp simd reduction(max : most)")                                                      \
        for (int j = 0; j < BP_##b##_BALLS; j++) most = of[j] > most ? of[j] : most;                   \
        value[BP_NX + BP_BALL_CHANNELS * bearing + k] = most;                                              \
    }
    BP_EACH_BEARING(BP_MOST)
#undef BP_MOST
}

/* Add to the places of both raceways what one ball of a bearing gave in a step.

   sectors   of the outer, then of the inner raceway
   ball      as a part of a turn behind ball 1
   amount    integral of the first power over the angle turned in the step
   centroid  of it, as a part of the step
   from, to  angle of ball 1 as outer and inner ring see it at both ends of the step [rad] */
static inline void bp_add_places(double *restrict sectors, double ball, double amount, double centroid, const double *restrict from,
                                 const double *restrict to)
{
    for (int ring = 0; ring < 2; ring++) {
        const double turns = (from[ring] + (to[ring] - from[ring]) * centroid) * 0.15915494309189533577 + ball;
        const double place = BP_SECTORS * (turns - floor(turns)), below = floor(place);
        const int k = (int)below % BP_SECTORS;
        sectors[BP_SECTORS * ring + k] += amount * (1.0 - (place - below));
        sectors[BP_SECTORS * ring + (k + 1) % BP_SECTORS] += amount * (place - below);
    }
}

/* Angle that the inner ring turns against the outer one in a step, in either sense [rad]; arguments as above. */
static inline double bp_turned(const double *restrict from, const double *restrict to) { return fabs(to[0] - from[0] - (to[1] - from[1])); }

/* Add what all balls of a bearing give, whose forces at the quarters of the step are `of` [N], BP_BALL_QUANTITIES apart; the power of the
   loads is p/q. */
static inline __attribute__((always_inline)) void bp_add_sectors(double *restrict sectors, int balls, const int p, const int q, double turned,
                                                                 const double *restrict of, const double *restrict from,
                                                                 const double *restrict to)
{
    for (int j = 0; j < balls; j++) {
        double sum = 0.0, moment = 0.0;
        for (int i = 0; i < BP_POINTS; i++) {
            const double force = of[i * BP_BALL_QUANTITIES + j], load = force > 0.0 ? 1e-3 * force : 0.0;
            const double part = bp_boole[i] * bp_power(load, p, q);
            sum += part;
            moment += 0.25 * i * part;
        }
        if (sum > 0.0) bp_add_places(sectors, (double)j / balls, turned * sum, moment / sum, from, to);
    }
}

/* The most loaded ball, counted from 1, of these entries. */
static inline int bp_most_loaded(const double *of, int balls)
{
    int best = 0;
    for (int j = 1; j < balls; j++)
        if (of[j] > of[best]) best = j;
    return best + 1;
}

/* A step, as searches see it; `lead` of its pace (sqrt_time.h). */
typedef struct {
    double time, h, lead;
    const bp_numbers *n;
    /* state at a part of the step, and its time in the segment */
    double (*state)(const void *source, double theta, double *x);
    const void *source;
    const double (*balls)[BP_BALL_QUANTITIES]; /* of the balls, at the quarters */
} bp_within;

/* Quantities of all balls within a step: of many a step where one is cut, and so not compiled for size with those that call it. */
__attribute__((noinline)) static void bp_balls_within(const bp_within *step, double theta, double *restrict q)
{
    double x[BP_NX];
    bp_ball_quantities(step->n, step->state(step->source, theta, x), x, q);
}

/* One channel within a step; `ball`, counted from 1, is the one evaluated, 0: the most loaded ball, which is set then. */
static inline double bp_channel(const bp_within *step, double theta, int channel, int *ball)
{
    double x[BP_NX], q[BP_BALL_QUANTITIES];
    if (BP_NB == 0 || channel < BP_NX) {
        step->state(step->source, theta, x);
        return x[channel];
    }
    int balls;
    bp_balls_within(step, theta, q);
    const double *of = bp_ball_row(q, channel - BP_NX, &balls);
    if (*ball == 0) *ball = bp_most_loaded(of, balls);
    return of[*ball - 1];
}

/* Top of the parabola through three points with the middle one the highest; the middle where they lie on a line. */
static inline double bp_top(double a, double va, double b, double vb, double c, double vc)
{
    const double left = (b - a) * (vb - vc), right = (b - c) * (vb - va), below = left - right;
    if (below == 0.0) return b;
    const double top = b - 0.5 * ((b - a) * left - (b - c) * right) / below;
    return top > a && top < c ? top : b;
}

/* A polynomial of degree four in powers of s = 4 theta - 2.  Handed over by value: an array has an address, and loops over lanes or channels
   would keep one for each of them in memory, at distances that no vector is stored to. */
typedef struct {
    double c0, c1, c2, c3, c4;
} bp_quartic;

/* The one through the values at the quarters. */
static inline bp_quartic bp_quartic_through(double v0, double v1, double v2, double v3, double v4)
{
    return (bp_quartic){
        v2,
        (8.0 * (v3 - v1) - (v4 - v0)) * (1.0 / 12.0),
        (16.0 * (v1 + v3) - (v0 + v4) - 30.0 * v2) * (1.0 / 24.0),
        ((v4 - v0) - 2.0 * (v3 - v1)) * (1.0 / 12.0),
        ((v0 + v4) - 4.0 * (v1 + v3) + 6.0 * v2) * (1.0 / 24.0),
    };
}

/* Mean of its square over the step. */
static inline double bp_mean_square(bp_quartic q)
{
    return q.c0 * q.c0 + 4.0 / 3.0 * (2.0 * q.c0 * q.c2 + q.c1 * q.c1) + 16.0 / 5.0 * (2.0 * (q.c0 * q.c4 + q.c1 * q.c3) + q.c2 * q.c2)
           + 64.0 / 7.0 * (2.0 * q.c2 * q.c4 + q.c3 * q.c3) + 256.0 / 9.0 * (q.c4 * q.c4);
}

/* Mean over the step of a power of the channel less a shift: of a small vibration on a large offset raw squares have few digits.  `q`: that
   polynomial less the shift; `smooth`: it is the channel. */
BP_POWER double bp_moment(const int degree, double v0, double v1, double v2, double v3, double v4, bp_quartic q, double shift, int smooth)
{
    if (degree == 1) return bp_boole[0] * (v0 + v4) + bp_boole[1] * (v1 + v3) + bp_boole[2] * v2 - shift;
    double exact = 0.0;
    if (degree == 2) exact = bp_mean_square(q);
    else
        for (int i = 0; i < BP_GAUSS; i++) {
            const double s = bp_gauss[i];
            exact += bp_gauss_weight[i] * bp_whole_power(q.c0 + s * (q.c1 + s * (q.c2 + s * (q.c3 + s * q.c4))), degree);
        }
    const double boole = bp_boole[0] * (bp_whole_power(v0 - shift, degree) + bp_whole_power(v4 - shift, degree))
                         + bp_boole[1] * (bp_whole_power(v1 - shift, degree) + bp_whole_power(v3 - shift, degree))
                         + bp_boole[2] * bp_whole_power(v2 - shift, degree);
    return smooth ? exact : boole;
}

/* Bounds of that polynomial between its ends: its inner Bezier ordinates (it lies within their hull and that of its end values). */
typedef struct {
    double left, middle, right;
} bp_hull;

static inline bp_hull bp_hull_of(bp_quartic q)
{
    const double even = q.c0 - 16.0 * q.c4, odd = q.c1 - 4.0 * q.c3;
    return (bp_hull){even - odd, q.c0 - 4.0 / 3.0 * q.c2 + 16.0 * q.c4, even + odd};
}

/* Bounds of what a step may bring, from the values at its quarters and that polynomial: no extreme is looked for that lies within those
   known.  A parabola through three of the points rises above them by no more than an eighth of their range; beside a jump, where two of the
   points tell nothing of the third, a force decays by no more than half between two quarters. */
static inline void bp_survey(double v0, double v1, double v2, double v3, double v4, bp_quartic q, double *restrict bottom,
                             double *restrict top)
{
    const bp_hull hull = bp_hull_of(q);
    const double a = v0 > v1 ? v0 : v1, c = v0 > v1 ? v1 : v0, d = v2 > v3 ? v2 : v3, e = v2 > v3 ? v3 : v2;
    double high = a > d ? a : d, low = c < e ? c : e;
    high = v4 > high ? v4 : high;
    low = v4 < low ? v4 : low;
    const double reach = BP_BEYOND * (high - low), up = hull.left > hull.middle ? hull.left : hull.middle, down = hull.left > hull.middle ? hull.middle : hull.left;
    high = up > high + reach ? up : high + reach;
    low = down < low - reach ? down : low - reach;
    *top = hull.right > high ? hull.right : high;
    *bottom = hull.right < low ? hull.right : low;
}

/* What the search for one extreme of a channel within a step knows. */
typedef struct {
    double *best; /* in the reduction; its time and ball follow */
    double sign;  /* 1 for a maximum, -1 for a minimum */
    const bp_within *step;
    int channel;
    int ball; /* counted from 1; 0: the most loaded one, or a state */
} bp_search;

/* The channel within the step, with the sign of a maximum; the extreme is brought up to date. */
static inline double bp_probe(const bp_search *search, double theta)
{
    int ball = search->ball;
    const double value = bp_channel(search->step, theta, search->channel, &ball), found = search->sign * value;
    if (found > search->sign * *search->best) {
        search->best[0] = value;
        search->best[BP_CHANNELS] = search->step->time + theta * search->step->h;
        search->best[2 * BP_CHANNELS] = ball;
    }
    return found;
}

/* The top between a and c, of which b is the highest place known; b is one of them where the top may be beside it. */
BP_SELDOM void bp_climb(const bp_search *search, double a, double va, double b, double vb, double c, double vc)
{
    for (int i = 0, settled = 0; i < BP_REFINEMENTS && settled < 2; i++) {
        /* what the next parabola promises on top; beside a kink or a jump parabolas creep, or promise nothing by chance, and every other
           place is the middle of the larger part instead */
        const double range = va < vc ? vb - va : vb - vc, next = bp_top(a, va, b, vb, c, vc);
        const double move = next == b ? b == a || b == c : (next - b) / (next < b ? b - a : c - b);
        settled = range * move * move > 1e-9 * fabs(vb) ? 0 : settled + 1;
        const double at = i % 2 == 0 && next != b ? next : b - a > c - b ? 0.5 * (a + b) : 0.5 * (b + c), found = bp_probe(search, at);
        if (at < b) {
            if (found > vb) c = b, vc = vb, b = at, vb = found;
            else a = at, va = found;
        } else {
            if (found > vb) a = b, va = vb, b = at, vb = found;
            else c = at, vc = found;
        }
    }
}

/* The top that is near theta, where `promised` was expected; u holds the channel at the quarters, with the sign of a maximum. */
BP_SELDOM void bp_climb_near(const bp_search *search, const double *u, double theta, double promised)
{
    const double found_there = bp_probe(search, theta);
    /* the polynomial is the channel: there is its top */
    if (fabs(found_there - promised) <= 1e-12 * (fabs(found_there) + fabs(promised))) return;
    double place[BP_POINTS + 1], value[BP_POINTS + 1];
    int k = 0;
    for (int i = 0, j = 0; j <= BP_POINTS; j++) {
        const int here = i == j && (i == BP_POINTS || theta < 0.25 * i);
        place[j] = here ? theta : 0.25 * i;
        value[j] = here ? found_there : u[i];
        if (!here) i++;
        if (value[j] > value[k]) k = j;
    }
    if (k > 0 && k < BP_POINTS) bp_climb(search, place[k - 1], value[k - 1], place[k], value[k], place[k + 1], value[k + 1]);
}

/* The top within the quarter of a step from i on, in which the channel has a kink or a jump. */
static inline void bp_climb_quarter(const bp_search *search, const double *u, int i)
{
    const double a = 0.25 * i, c = 0.25 * (i + 1);
    if (u[i] > u[i + 1]) bp_climb(search, a, u[i], a, u[i], c, u[i + 1]);
    else bp_climb(search, a, u[i], c, u[i + 1], c, u[i + 1]);
}

/* Every top of what is searched for, whose values at the quarters are u, with the sign of a maximum.  The parabola is for where no polynomial
   is the channel. */
static inline void bp_tops(const bp_search *search, const double *u)
{
    double slope[BP_CELLS + 1];
    int top = 0;
    for (int i = 1; i < BP_POINTS; i++)
        if (u[i] > u[top]) top = i;
    const bp_quartic q = bp_quartic_through(u[0], u[1], u[2], u[3], u[4]);
    const bp_hull hull = bp_hull_of(q);
    const int middle = top == 0 ? 1 : top == BP_POINTS - 1 ? BP_POINTS - 2 : top;
    const double bend = u[middle - 1] - 2.0 * u[middle] + u[middle + 1], rise = 0.5 * (u[middle + 1] - u[middle - 1]);
    const double shift = bend < 0.0 ? -rise / bend : 0.0, place = (middle + shift) / (BP_POINTS - 1);
    const double above = u[middle] + 0.5 * rise * shift, known = search->sign * *search->best;
    if (!(hull.left > known || hull.middle > known || hull.right > known || above > known)) return;
    /* every top of the polynomial: where its slope changes sign */
    for (int i = 0; i <= BP_CELLS; i++) {
        const double s = 4.0 * i / BP_CELLS - 2.0;
        slope[i] = q.c1 + s * (2.0 * q.c2 + s * (3.0 * q.c3 + s * (4.0 * q.c4)));
    }
    for (int i = 0; i < BP_CELLS; i++) {
        if (!(slope[i] > 0.0 && slope[i + 1] <= 0.0)) continue;
        const double low = 4.0 * i / BP_CELLS - 2.0, high = 4.0 * (i + 1) / BP_CELLS - 2.0;
        double s = low + (high - low) * slope[i] / (slope[i] - slope[i + 1]);
        for (int k = 0; k < 4; k++) {
            const double there = q.c1 + s * (2.0 * q.c2 + s * (3.0 * q.c3 + s * (4.0 * q.c4)));
            const double curve = 2.0 * q.c2 + s * (6.0 * q.c3 + s * (12.0 * q.c4)), moved = curve < 0.0 ? s - there / curve : s;
            s = moved < low ? low : moved > high ? high : moved;
        }
        const double promised = q.c0 + s * (q.c1 + s * (q.c2 + s * (q.c3 + s * q.c4)));
        if (promised > search->sign * *search->best) bp_climb_near(search, u, 0.25 * (s + 2.0), promised);
    }
    if (search->channel >= BP_NX && above > search->sign * *search->best && place > 0.0 && place < 1.0) bp_climb_near(search, u, place, above);
}

/* Least that the most loaded ball carries within a step, from what all carry at its quarters; `least`: between two quarters each. */
static inline double bp_least(const double *const of[BP_POINTS], int balls, double least[BP_POINTS - 1])
{
    double whole = -INFINITY;
    for (int i = 0; i + 1 < BP_POINTS; i++) least[i] = -INFINITY;
    for (int j = 0; j < balls; j++) {
        double low = of[0][j], high = of[0][j];
        for (int i = 1; i < BP_POINTS; i++) {
            high = of[i][j] > high ? of[i][j] : high;
            low = of[i][j] < low ? of[i][j] : low;
        }
        const double reach = BP_BEYOND * (high - low);
        whole = low - reach > whole ? low - reach : whole;
        for (int i = 0; i + 1 < BP_POINTS; i++) {
            const double lower = (of[i][j] < of[i + 1][j] ? of[i][j] : of[i + 1][j]) - reach;
            least[i] = lower > least[i] ? lower : least[i];
        }
    }
    return whole;
}

/* Whether the most loaded ball may carry less than `best` where it changes within a quarter of a step, from what all carry at both ends: chords
   cross there, and a quarter of their rise is room for the curves. */
static inline int bp_dips(const double *start, const double *end, int balls, double best)
{
    const int first = bp_most_loaded(start, balls) - 1, last = bp_most_loaded(end, balls) - 1;
    if (first == last || start[last] >= best || end[first] >= best) return 0;
    const double ahead = start[first] - start[last], behind = end[last] - end[first];
    const double fall = end[first] - start[first], rise = end[last] - start[last];
    return start[first] + fall * ahead / (ahead + behind) - 0.25 * (fabs(fall) + fabs(rise)) < best;
}

/* Rows of a channel of the balls at the quarters of a step, and of their deflections. */
static inline int bp_rows_at(const bp_within *step, int row, const double *of[BP_POINTS], const double *gap[BP_POINTS])
{
    int balls = 0;
    for (int i = 0; i < BP_POINTS; i++) {
        of[i] = bp_ball_row(step->balls[i], row, &balls);
        gap[i] = of[i] + (BP_DEFLECTION - row % BP_BALL_CHANNELS) * balls;
    }
    return balls;
}

/* Extreme of a channel of the balls, whose value of the most loaded ball at the quarters is u, with the sign of a maximum. */
static inline void bp_ball_extreme(bp_search search, const double *u)
{
    const int row = search.channel - BP_NX, kind = row % BP_BALL_CHANNELS;
    const double *of[BP_POINTS], *gap[BP_POINTS];
    const int balls = bp_rows_at(search.step, row, of, gap);
    /* no ball carries more than the most loaded one */
    const int jumps = bp_jumps[kind];
    if (search.sign < 0.0) {
        double least[BP_POINTS - 1];
        if (!(bp_least(of, balls, least) < *search.best)) return;
        bp_tops(&search, u);
        for (int i = 0; i + 1 < BP_POINTS; i++) {
            if (!(least[i] < *search.best)) continue;
            int kink = bp_dips(of[i], of[i + 1], balls, *search.best);
            for (int j = 0; j < balls && jumps; j++) kink |= (gap[i][j] > 0.0) != (gap[i + 1][j] > 0.0);
            if (kink) bp_climb_quarter(&search, u, i);
        }
        return;
    }
    for (int j = 0; j < balls; j++) {
        double own[BP_POINTS], high = -INFINITY, low = INFINITY;
        for (int i = 0; i < BP_POINTS; i++) {
            own[i] = of[i][j];
            high = own[i] > high ? own[i] : high;
            low = own[i] < low ? own[i] : low;
        }
        search.ball = j + 1;
        bp_tops(&search, own);
        for (int i = 0; i + 1 < BP_POINTS && jumps && high + BP_BEYOND * (high - low) > *search.best; i++)
            if ((gap[i][j] > 0.0) != (gap[i + 1][j] > 0.0)) bp_climb_quarter(&search, own, i);
    }
}

/* Bring one extreme of a channel up to date with a step.

   reduction   the row
   extreme     its number
   v           the channel at the quarters, `stride` apart */
BP_SELDOM void bp_extreme(double *reduction, int extreme, int channel, const double *v, int stride, const bp_within *step)
{
    const double sign = bp_sign[extreme];
    const bp_search search = {reduction + BP_EXTREME + 3 * extreme * BP_CHANNELS + channel, sign, step, channel, 0};
    double *best = search.best, u[BP_POINTS];
    const double known = best[0], time = best[BP_CHANNELS], ball = best[2 * BP_CHANNELS];
    int top = 0, balls;
    for (int i = 0; i < BP_POINTS; i++) {
        u[i] = sign * v[i * stride];
        if (u[i] > u[top]) top = i;
    }
    if (!(reduction[BP_DURATION] > 0.0) || u[top] > sign * *best) {
        best[0] = v[top * stride];
        best[BP_CHANNELS] = step->time + 0.25 * top * step->h;
        best[2 * BP_CHANNELS] = 0.0;
        if (channel >= BP_NX) {
            const double *of = bp_ball_row(step->balls[top], channel - BP_NX, &balls);
            best[2 * BP_CHANNELS] = bp_most_loaded(of, balls);
        }
    }
    if (channel < BP_NX) bp_tops(&search, u);
    else bp_ball_extreme(search, u);
    /* of equal extremes the first; one at the end of the step before goes on here */
    const int apart = reduction[BP_DURATION] > 0.0 && time < step->time - 1e-3 * step->h;
    if (apart && fabs(best[0] - known) <= reduction[BP_EQUAL] * fabs(known)) {
        best[0] = known;
        best[BP_CHANNELS] = time;
        best[2 * BP_CHANNELS] = ball;
    }
}

enum { BP_CUTS = 64, BP_HALVINGS = 20 }; /* of a step at most, and to find one */

/* Cuts nearer to each other than this part of a step are one, and ranks within this part of their change are equal: what that costs is of its
   square. */
static const double BP_SAME_CUT = 1e-4;

/* Nodes of Gauss's rule between two cuts, in parts, and their weights: of the degree of Boole's rule. */
enum { BP_NODES = 3 };
static const double bp_node[BP_NODES] = {0.11270166537925831, 0.5, 0.88729833462074169}, bp_node_weight[BP_NODES] = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

/* Places of a step, as parts of it, between which the largest values of the balls' channels are smooth. */
typedef struct {
    int count;
    double at[BP_CUTS + 2];
} bp_cuts;

static inline double bp_quartic_at(bp_quartic q, double s) { return q.c0 + s * (q.c1 + s * (q.c2 + s * (q.c3 + s * q.c4))); }

/* Where a polynomial passes zero between the places low and high, whose signs differ; low where they do not. */
static inline double bp_root(bp_quartic q, double low, double high)
{
    double a = 4.0 * low - 2.0, b = 4.0 * high - 2.0;
    const int positive = bp_quartic_at(q, a) > 0.0;
    if (positive == (bp_quartic_at(q, b) > 0.0)) return low;
    for (int i = 0; i < BP_HALVINGS; i++) {
        const double middle = 0.5 * (a + b);
        if ((bp_quartic_at(q, middle) > 0.0) == positive) a = middle;
        else b = middle;
    }
    return 0.125 * (a + b) + 0.5;
}

/* A cut more, in order. */
static inline void bp_cut(bp_cuts *cuts, double at)
{
    int k = cuts->count;
    for (int i = 0; i < k; i++)
        if (fabs(cuts->at[i] - at) < BP_SAME_CUT) return;
    if (k == BP_CUTS) return;
    for (; k > 0 && cuts->at[k - 1] > at; k--) cuts->at[k] = cuts->at[k - 1];
    cuts->at[k] = at;
    cuts->count++;
}

/* One ball's row `of` at the quarters, as the polynomial through them. */
static inline bp_quartic bp_quartic_of(const double *const of[BP_POINTS], int j)
{
    return bp_quartic_through(of[0][j], of[1][j], of[2][j], of[3][j], of[4][j]);
}

/* Cuts between the places low and high, from a row of the balls there: where another ball becomes the most loaded one, which may be a third
   one between those at both ends.  The polynomials give the first guess. */
static void bp_rank_cuts(bp_cuts *cuts, const bp_within *step, int row, const double *const of[BP_POINTS], double low, const double *start,
                         double high, const double *end)
{
    double q[BP_BALL_QUANTITIES];
    int balls;
    const double *const there = bp_ball_row(q, row, &balls);
    const int a = bp_most_loaded(start, balls) - 1, b = bp_most_loaded(end, balls) - 1;
    if (a == b || high - low < BP_SAME_CUT) return;
    const bp_quartic one = bp_quartic_of(of, a), two = bp_quartic_of(of, b);
    double left = low, right = high, ahead = start[a] - start[b], behind = end[a] - end[b];
    double at = bp_root((bp_quartic){one.c0 - two.c0, one.c1 - two.c1, one.c2 - two.c2, one.c3 - two.c3, one.c4 - two.c4}, low, high);
    const double close = BP_SAME_CUT * (ahead - behind);
    for (int i = 0; i < BP_REFINEMENTS; i++) {
        if (!(at > left && at < right)) at = 0.5 * (left + right);
        bp_balls_within(step, at, q);
        const int most = bp_most_loaded(there, balls) - 1;
        if (most != a && most != b) {
            bp_rank_cuts(cuts, step, row, of, low, start, at, there);
            bp_rank_cuts(cuts, step, row, of, at, there, high, end);
            return;
        }
        const double apart = there[a] - there[b];
        if (fabs(apart) <= close) break;
        if (apart > 0.0) left = at, ahead = apart;
        else right = at, behind = apart;
        at = i % 2 ? 0.5 * (left + right) : left + (right - left) * ahead / (ahead - behind);
    }
    bp_cut(cuts, at);
}

/* Tolerance of a run up to which steps are cut at the corners of the most loaded ball: at looser ones what a corner costs is of the size of
   the run's own error, and a cut step takes twice as long.  Kinks are located from there on (request/locating.py). */
static const double BP_CUT_BELOW = 3e-7;

/* Whether moments of a channel are wanted between its corners. */
static inline int bp_cuts_moments(const double *reduction, int channel)
{
    double wanted = 0.0;
    for (int m = 0; m < BP_MOMENTS; m++) wanted += reduction[BP_WANTED_MOMENT + m * BP_CHANNELS + channel];
    return wanted != 0.0 && reduction[BP_EQUAL] <= BP_CUT_BELOW;
}

/* Number of the most loaded ball of a channel of the balls, times 4, and on which side it is of what makes corners: contact, and the end of the
   damping of a law that damps one way.  Deflections have none.  lane_model.h has the same in lanes. */
static inline double bp_side(const double *q, int row)
{
    int balls;
    const double *of = bp_ball_row(q, row, &balls);
    const int j = bp_most_loaded(of, balls) - 1, kind = row % BP_BALL_CHANNELS;
    const double *own = of + j - kind * balls;
    return 4.0 * j + (kind == BP_DEFLECTION ? 0.0 : 2.0 * (own[BP_DEFLECTION * balls] > 0.0) + (own[BP_DAMPING * balls] == 0.0));
}

/* Whether a step is cut for a channel of the balls: its side changes between the quarters, or the step's pace is uneven. */
static inline int bp_is_cut(const bp_within *step, int row)
{
    const double side = bp_side(step->balls[0], row);
    int cut = step->lead != 1.0;
    for (int i = 1; i < BP_POINTS && !cut; i++) cut = bp_side(step->balls[i], row) != side;
    return cut;
}

/* Cuts of a step for a channel of the balls: where another ball becomes the most loaded one, where such a ball comes into contact or leaves it,
   and where its approach turns under a law that damps one way. */
static void bp_find_cuts(bp_cuts *cuts, const bp_within *step, int row)
{
    const double *of[BP_POINTS], *gap[BP_POINTS];
    const int balls = bp_rows_at(step, row, of, gap);
    cuts->count = 0;
    for (int i = 0; i + 1 < BP_POINTS; i++) {
        const double low = 0.25 * i, high = 0.25 * (i + 1);
        const int first = bp_most_loaded(of[i], balls) - 1, last = bp_most_loaded(of[i + 1], balls) - 1;
        bp_rank_cuts(cuts, step, row, of, low, of[i], high, of[i + 1]);
        for (int j = first; row % BP_BALL_CHANNELS != BP_DEFLECTION; j = last) {
            const int damping = j + (BP_DAMPING - BP_DEFLECTION) * balls, contact = (gap[i][j] > 0.0) != (gap[i + 1][j] > 0.0);
            if (contact || (gap[i][damping] == 0.0) != (gap[i + 1][damping] == 0.0)) {
                const bp_quartic q = bp_quartic_of(gap, j), slope = {q.c1, 2.0 * q.c2, 3.0 * q.c3, 4.0 * q.c4, 0.0};
                const double at = bp_root(contact ? q : slope, low, high);
                if (at != low) bp_cut(cuts, at);
            }
            if (j == last) break;
        }
    }
}

/* Means over a step of powers of a channel of the balls less its shift, from Gauss's nodes between its cuts, over the pace of the step. */
BP_SELDOM void bp_moments_between(const bp_within *step, int row, double shift, double moment[BP_MOMENTS])
{
    bp_cuts cuts;
    bp_find_cuts(&cuts, step, row);
    cuts.at[cuts.count] = 1.0;
    for (int m = 0; m < BP_MOMENTS; m++) moment[m] = 0.0;
    for (int piece = 0; piece <= cuts.count; piece++) {
        const double from = bp_theta(step->lead, piece ? cuts.at[piece - 1] : 0.0), to = bp_theta(step->lead, cuts.at[piece]);
        for (int g = 0; g < BP_NODES; g++) {
            const double s = from + (to - from) * bp_node[g], weight = bp_node_weight[g] * (to - from) * bp_pace(step->lead, s);
            int ball = 0;
            const double apart = bp_channel(step, bp_passed(step->lead, s), BP_NX + row, &ball) - shift;
#define BP_OF_DEGREE(m, degree) moment[m] += weight * bp_whole_power(apart, degree);
            BP_EACH_MOMENT(BP_OF_DEGREE)
#undef BP_OF_DEGREE
        }
    }
}

/* Add an accepted step whose channels at the quarters are v; `passes`: whether what fatigue needs is wanted. */
static inline void bp_reduce(double *reduction, int passes, const double v[BP_POINTS][BP_CHANNELS], const bp_within *step)
{
    const double h = step->h;
    const int first = !(reduction[BP_DURATION] > 0.0);
    for (int k = 0; k < BP_LOOKED_AT && first; k++) reduction[BP_SHIFT + k] = v[0][k];
    double moment[BP_MOMENTS][BP_LOOKED_AT], top[BP_LOOKED_AT], bottom[BP_LOOKED_AT];
#pragma omp simd
    for (int k = 0; k < BP_LOOKED_AT; k++) {
        const double v0 = v[0][k], v1 = v[1][k], v2 = v[2][k], v3 = v[3][k], v4 = v[4][k], shift = reduction[BP_SHIFT + k];
        bp_quartic q = bp_quartic_through(v0, v1, v2, v3, v4);
        double low, high;
        bp_survey(v0, v1, v2, v3, v4, q, &low, &high);
        q.c0 -= shift;
        top[k] = high;
        bottom[k] = low;
#define BP_OF_DEGREE(m, degree) moment[m][k] = bp_moment(degree, v0, v1, v2, v3, v4, q, shift, k < BP_NX);
        BP_EACH_MOMENT(BP_OF_DEGREE)
#undef BP_OF_DEGREE
    }
    for (int k = BP_NX; k < BP_LOOKED_AT; k++) {
        if (!bp_cuts_moments(reduction, k) || !bp_is_cut(step, k - BP_NX)) continue;
        double between[BP_MOMENTS];
        bp_moments_between(step, k - BP_NX, reduction[BP_SHIFT + k], between);
        for (int m = 0; m < BP_MOMENTS; m++) moment[m][k] = between[m];
    }
    for (int k = 0; k < BP_LOOKED_AT; k++) {
        for (int m = 0; m < BP_MOMENTS; m++)
            if (reduction[BP_WANTED_MOMENT + m * BP_CHANNELS + k] != 0.0) reduction[BP_MOMENT + m * BP_CHANNELS + k] += h * moment[m][k];
        for (int e = 0; e < BP_EXTREMES; e++) {
            if (reduction[BP_WANTED + e * BP_CHANNELS + k] == 0.0) continue;
            const double bound = bp_sign[e] > 0.0 ? top[k] : bottom[k];
            if (first || bp_sign[e] * bound > bp_sign[e] * reduction[BP_EXTREME + 3 * e * BP_CHANNELS + k])
                bp_extreme(reduction, e, k, v[0] + k, BP_CHANNELS, step);
        }
    }
    if (passes) {
        double x[BP_NX], from[2 * BP_BEARINGS + 1], to[2 * BP_BEARINGS + 1];
        const double *of = step->balls[0];
        for (int end = 0; end < 2; end++) {
            const double t = step->state(step->source, end, x);
            bp_passes(t, x, step->n->u, step->n->p, step->n->c, end ? to : from);
        }
        for (int k = 0; k < BP_BEARINGS; k++) reduction[BP_MOMENT + BP_LOOKED_AT + k] += bp_turned(from + 2 * k, to + 2 * k);
#define BP_ADD(b)                                                                                                                       \
    bp_add_sectors(reduction + BP_RACEWAYS + 2 * BP_SECTORS * bearing, BP_##b##_BALLS, BP_SECTOR_POWER(b),                                   \
                   bp_turned(from + 2 * bearing, to + 2 * bearing), of + BP_BALL_CHANNELS * bp_first_ball[bearing], from + 2 * bearing, to + 2 * bearing);
        BP_EACH_BEARING(BP_ADD)
#undef BP_ADD
    }
    reduction[BP_DURATION] += h;
}

#endif
