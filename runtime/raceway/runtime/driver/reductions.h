/* On-line reductions: extremes with their times, mean and mean square of channels, from the dense output of every accepted step.

   Channels are the states, then four quantities of the balls, each with its value of the most loaded ball at the moment: total force,
   elastic force, damping force, deflection.  Every step is looked at in its quarters, theta = 0, 1/4, 1/2, 3/4, 1.

   Integrals are taken by Boole's rule, exact up to degree five: for states exact with all methods but DOP853, whose output is of degree
   seven.  Extremes: a parabola through the three best points says whether
   and where there is a larger value between them; the channel is evaluated there from the dense output, and the parabola drawn anew.  So an
   extreme is always a value that the solution takes, never an extrapolation across a kink.  At a kink it is met to a part of a quarter
   step: the smallest value of the most loaded ball is such a place, for there two balls change rank.

   A reduction is a row of RW_REDUCTION numbers, which a run adds to: it can go on in another call. */
#ifndef RACEWAY_REDUCTIONS_H
#define RACEWAY_REDUCTIONS_H

#include "ensemble_kernels.h"
#include "model.h"

enum { RW_POINTS = 5, RW_BALL_CHANNELS = 4, RW_CHANNELS = RW_NX + RW_BALL_CHANNELS };

/* Places in a reduction: the head, then RW_CHANNELS entries of each kind. */
enum {
    RW_FROM = 0,     /* nothing is reduced in segments that start before this time [s]; given by the caller */
    RW_WANTED = 1,   /* sum of 2^k over the channels k that are wanted; given by the caller */
    RW_DURATION = 2, /* time reduced so far [s] */
    RW_HEAD = 3,
    RW_MAX = RW_HEAD,
    RW_MAX_TIME = RW_MAX + RW_CHANNELS,
    RW_MAX_BALL = RW_MAX_TIME + RW_CHANNELS, /* counted from 1; 0 for a state */
    RW_MIN = RW_MAX_BALL + RW_CHANNELS,
    RW_MIN_TIME = RW_MIN + RW_CHANNELS,
    RW_MIN_BALL = RW_MIN_TIME + RW_CHANNELS,
    RW_INTEGRAL = RW_MIN_BALL + RW_CHANNELS, /* of the channel over time */
    RW_SQUARE = RW_INTEGRAL + RW_CHANNELS,   /* of its square */
    RW_REDUCTION = RW_SQUARE + RW_CHANNELS
};

enum { RW_REFINEMENTS = 12 }; /* evaluations spent on an extreme at most; a smooth one takes two or three */

/* Channels wanted, a bit each; whether those of the balls are among them. */
static inline unsigned long rw_wanted(const double *reduction) { return (unsigned long)reduction[RW_WANTED]; }
static inline int rw_balls_wanted(const double *reduction) { return rw_wanted(reduction) >> RW_NX != 0; }

/* Weights of Boole's rule. */
static const double rw_boole[RW_POINTS] = {7.0 / 90.0, 32.0 / 90.0, 12.0 / 90.0, 32.0 / 90.0, 7.0 / 90.0};

/* Value of a channel within a step, and the ball that has it. */
typedef double (*rw_channel_at)(const void *source, int channel, double theta, int *ball);

/* Quantities of all balls at a state and time.  One ball a lane. */
static inline void rw_ball_quantities(const rw_numbers *n, double t, const double *restrict x, double q[RW_BALL_CHANNELS][RW_NB])
{
    double w[RW_NW], r[5];
    rw_cage(t, n->u, n->p, n->c, w);
    rw_relative(x, n->u, n->p, n->c, w, r);
    const double *restrict p = n->p, *restrict c = n->c;
#pragma omp simd
    for (int j = 0; j < RW_NB; j++) {
        const double co = rw_cos[j] * w[0] - rw_sin[j] * w[1];
        const double si = rw_sin[j] * w[0] + rw_cos[j] * w[1];
        const double delta = r[0] + r[1] * co + r[2] * si;
        double elastic, damping;
        rw_contact(delta, r[3] * co + r[4] * si, p, c, &elastic, &damping);
        q[0][j] = elastic + damping;
        q[1][j] = elastic;
        q[2][j] = damping;
        q[3][j] = delta;
    }
}

/* All channels at a state and time; those of the balls are zero where not wanted. */
static inline void rw_channels(const rw_numbers *n, double t, const double *restrict x, int balls, double *restrict value)
{
    for (int k = 0; k < RW_NX; k++) value[k] = x[k];
    for (int k = RW_NX; k < RW_CHANNELS; k++) value[k] = 0.0;
    if (!balls) return;
    double q[RW_BALL_CHANNELS][RW_NB];
    rw_ball_quantities(n, t, x, q);
    for (int k = 0; k < RW_BALL_CHANNELS; k++) {
        double most = q[k][0];
        for (int j = 1; j < RW_NB; j++) most = q[k][j] > most ? q[k][j] : most;
        value[RW_NX + k] = most;
    }
}

/* One channel at a state and time, and its ball counted from 1. */
static inline double rw_channel(const rw_numbers *n, double t, const double *restrict x, int channel, int *ball)
{
    *ball = 0;
    if (channel < RW_NX) return x[channel];
    double q[RW_BALL_CHANNELS][RW_NB];
    rw_ball_quantities(n, t, x, q);
    const double *of = q[channel - RW_NX];
    int best = 0;
    for (int j = 1; j < RW_NB; j++)
        if (of[j] > of[best]) best = j;
    *ball = best + 1;
    return of[best];
}

/* Top of the parabola through three points with the middle one the highest; the middle where they lie on a line. */
static inline double rw_top(double a, double va, double b, double vb, double c, double vc)
{
    const double left = (b - a) * (vb - vc), right = (b - c) * (vb - va), below = left - right;
    if (below == 0.0) return b;
    const double top = b - 0.5 * ((b - a) * left - (b - c) * right) / below;
    return top > a && top < c ? top : b;
}

/* Bring one extreme of a channel up to date with a step.

   reduction   the row
   value       place of the extreme in the row; its time and ball follow
   sign        1 for a maximum, -1 for a minimum
   v           the channel at the quarters, `stride` apart
   time        start of the step [s] */
static inline void rw_extreme(double *reduction, int value, int channel, double sign, const double *v, int stride, double time, double h,
                              rw_channel_at at, const void *source)
{
    double *best = reduction + value + channel;
    double *best_time = best + RW_CHANNELS, *best_ball = best_time + RW_CHANNELS;
    const int first = !(reduction[RW_DURATION] > 0.0);
    int top = 0, ball;
    for (int i = 1; i < RW_POINTS; i++)
        if (sign * v[i * stride] > sign * v[top * stride]) top = i;
    if (first || sign * v[top * stride] > sign * *best) {
        const double theta = (double)top / (RW_POINTS - 1);
        at(source, channel, theta, &ball);
        *best = v[top * stride];
        *best_time = time + theta * h;
        *best_ball = ball;
    }
    /* does a parabola promise more within the step?  At its ends the nearest three points are taken. */
    const int middle = top == 0 ? 1 : top == RW_POINTS - 1 ? RW_POINTS - 2 : top;
    const double low = sign * v[(middle - 1) * stride], mid = sign * v[middle * stride], high = sign * v[(middle + 1) * stride];
    const double curvature = low - 2.0 * mid + high, slope = 0.5 * (high - low);
    if (!(curvature < 0.0)) return;
    const double shift = -slope / curvature;
    double theta = (middle + shift) / (RW_POINTS - 1);
    if (!(theta > 0.0 && theta < 1.0) || !(mid - 0.5 * slope * slope / curvature > sign * *best)) return;
    /* bracket a < b < c, values with the sign of a maximum */
    double a = (double)(middle - 1) / (RW_POINTS - 1), b = (double)middle / (RW_POINTS - 1), c = (double)(middle + 1) / (RW_POINTS - 1);
    double va = low, vb = mid, vc = high;
    for (int i = 0; i < RW_REFINEMENTS; i++) {
        const double found = sign * at(source, channel, theta, &ball);
        if (found > sign * *best) {
            *best = sign * found;
            *best_time = time + theta * h;
            *best_ball = ball;
        }
        if (theta < b) {
            if (found > vb) c = b, vc = vb, b = theta, vb = found;
            else a = theta, va = found;
        } else if (theta > b) {
            if (found > vb) a = b, va = vb, b = theta, vb = found;
            else c = theta, vc = found;
        }
        if (!(vb >= va && vb >= vc)) return;
        /* what the next parabola promises on top; beside a jump of the force parabolas creep, and every other place is the middle of the
           larger part instead */
        const double range = va < vc ? vb - va : vb - vc, next = rw_top(a, va, b, vb, c, vc), move = (next - b) / (next < b ? b - a : c - b);
        if (!(range * move * move > 1e-9 * fabs(vb))) return;
        theta = i % 2 == 0 ? next : b - a > c - b ? 0.5 * (a + b) : 0.5 * (b + c);
    }
}

/* Add an accepted step whose channels at the quarters are v. */
static inline void rw_reduce(double *reduction, const double v[RW_POINTS][RW_CHANNELS], double time, double h, rw_channel_at at,
                             const void *source)
{
    const unsigned long wanted = rw_wanted(reduction);
    for (int k = 0; k < RW_CHANNELS; k++) {
        if (!(wanted >> k & 1)) continue;
        double sum = 0.0, square = 0.0;
        for (int i = 0; i < RW_POINTS; i++) {
            sum += rw_boole[i] * v[i][k];
            square += rw_boole[i] * (v[i][k] * v[i][k]);
        }
        reduction[RW_INTEGRAL + k] += h * sum;
        reduction[RW_SQUARE + k] += h * square;
        rw_extreme(reduction, RW_MAX, k, 1.0, v[0] + k, RW_CHANNELS, time, h, at, source);
        rw_extreme(reduction, RW_MIN, k, -1.0, v[0] + k, RW_CHANNELS, time, h, at, source);
    }
    reduction[RW_DURATION] += h;
}

#endif
