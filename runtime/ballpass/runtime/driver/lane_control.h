/* Step sizes and families of the members in lanes (step_size.h, family.h). */
#ifndef BALLPASS_LANE_CONTROL_H
#define BALLPASS_LANE_CONTROL_H

#include "lane_block.h"

/* When the member in a lane is examined next. */
static void tell_looks(const bp_member *at, bp_lane_block *b, int lane)
{
    b->until_look[lane] = (double)((BP_STIFF_LOOK - at->family.steps % BP_STIFF_LOOK) % BP_STIFF_LOOK);
    b->at_limit[lane] = at->family.stiff > 0 ? 1.0 : 0.0;
}

/* Sizes of the steps to try: as proposed, or so that the segment's end is met. */
static void choose_steps(bp_lane_block *b)
{
    BP_EACH_LANE {
        const double proposed = b->step[lane], left = b->length[lane] - b->t[lane];
        b->last[lane] = proposed * 1.0001 >= left ? 1.0 : 0.0;
        b->h[lane] = proposed * 1.0001 >= left ? left : 2.0 * proposed > left ? 0.5 * left : proposed;
    }
}

/* A member in a lane within the step just taken. */
typedef struct {
    const bp_job *job;
    const bp_lane_block *b;
    int lane;
} bp_lane_step;

static double lane_stable_step(void *from, const bp_stability *limit)
{
    const bp_lane_step *step = from;
    const bp_lane_block *b = step->b;
    bp_linear work;
    if (bp_methods[b->method].linear) {
        get(b->linear.A, step->lane, work.A, BP_NQ * BP_NQ);
        get(b->linear.B, step->lane, work.B, BP_NQ * BP_NQ);
    } else {
        const long m = b->who[step->lane];
        const bp_numbers n = member_numbers(step->job, m);
        double x[BP_NX];
        get(b->x, step->lane, x, BP_NX);
        bp_linear_start(&work, &n, b->t[step->lane], x, 1);
        step->job->results[m].evaluations++;
    }
    return bp_stable_step(work.A, work.B, limit);
}

/* Ask the rule of families about the lanes in which a step is to be examined. */
static void look(const bp_job *job, bp_lane_block *b, const double *looking)
{
    double reach[BP_L] BP_ALIGNED = {0.0};
    const double(*k)[BP_NX * BP_L] = (const double(*)[BP_NX * BP_L])b->plain.k;
    const bp_explicit_method *plain = bp_methods[b->method].plain;
    if (plain) bp_lane_explicit_reach(plain->stages, k, b->plain.y, b->h, b->next, b->weight, reach);
    for (int lane = 0; lane < BP_L; lane++) {
        if (looking[lane] == 0.0) continue;
        bp_member *at = job->member + b->who[lane];
        bp_lane_step step = {job, b, lane};
        /* the lane has counted to the next look; of the steps only the rest by BP_STIFF_LOOK matters */
        if (at->family.stiff == 0) at->family.steps = 1;
        const int method = bp_judge_family(&at->family, &at->seen, at->method, 0, b->h[lane], reach[lane], lane_stable_step, &step);
        b->changing[lane] = method == at->method ? 0.0 : (double)method;
        tell_looks(at, b, lane);
    }
}

/* Accept or reject; propose the next step sizes. */
static void judge(const bp_job *job, bp_lane_block *b, int changeable)
{
    double beyond[BP_L] BP_ALIGNED, factor[BP_L] BP_ALIGNED;
    const double order = bp_methods[b->method].error_exponent;
    /* states beyond reach: no number, or so large that the tolerance is below their rounding (within_reach in run.h).  A comparison with
       what is no number is false */
    BP_EACH_LANE beyond[lane] = 0.0;
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE beyond[lane] += fabs(b->next[k * BP_L + lane]) * b->weight[k * BP_L + lane] <= 1.0 / DBL_EPSILON ? 0.0 : 1.0;
    BP_EACH_LANE b->accepted[lane] = b->error[lane] <= 1.0 && beyond[lane] == 0.0 ? b->active[lane] : 0.0;
    BP_EACH_LANE factor[lane] = bp_step_factor(order, b->error[lane], b->accepted[lane], b->rejected_last[lane], &b->log_error[lane]);
    BP_EACH_LANE {
        const double accepted = b->accepted[lane];
        /* a last step cut short says nothing against the size that was proposed */
        const double cut = accepted != 0.0 && factor[lane] >= 1.0 ? b->last[lane] : 0.0;
        const double idle = b->active[lane] == 0.0 ? 1.0 : cut;
        b->step[lane] = idle != 0.0 ? b->step[lane] : b->h[lane] * factor[lane];
        b->rejected_last[lane] = 1.0 - accepted;
        b->steps[lane] += accepted;
        b->rejected[lane] += b->active[lane] - accepted;
        /* accepted steps may shrink as well: they would no longer move the time, unless the next is the last */
        const double ahead = b->length[lane] - (b->t[lane] + b->h[lane]);
        const double lasting = b->step[lane] * 1.0001 >= ahead ? b->active[lane] - accepted : b->active[lane];
        b->small[lane] = b->step[lane] <= b->resolution[lane] ? lasting : 0.0;
    }
    if (bp_methods[b->method].linear) BP_EACH_LANE b->pivoted[lane] += b->active[lane] * b->linear.pivoted[lane];
    if (!changeable) return;
    double looking[BP_L] BP_ALIGNED;
    BP_EACH_LANE {
        /* bp_family_looks, for all lanes: steps are not counted while all are examined */
        const double due = b->until_look[lane] == 0.0 || b->at_limit[lane] != 0.0 ? b->accepted[lane] : 0.0;
        const double counted = b->at_limit[lane] == 0.0 ? b->accepted[lane] : 0.0;
        looking[lane] = due;
        b->until_look[lane] -= due == 0.0 ? counted : 0.0;
    }
    if (bp_any_lane(looking)) look(job, b, looking);
}

#endif
