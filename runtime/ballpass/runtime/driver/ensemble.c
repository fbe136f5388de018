/* Members in and out of lanes, step sizes, segments, reductions.  See ensemble.h; the steps themselves are in lanes.h.

   Two passes take turns until every member is done: one advances members by Dormand and Prince, the other those by Rodas5P.  A member that
   changes its family leaves its lane and waits for the other pass. */
#include "ensemble.h"

#include <float.h>

#include "family.h"
#include "lanes.h"
#include "reductions.h"
#include "scales.h"

enum { BP_WAITING = 0, BP_FINISHED = 1 };
enum { BP_TELL_INTERVAL = 64 }; /* rounds between looks at the caller's wish to stop, and words on how far members are */

/* A member outside the lanes. */
typedef struct {
    double t, step, log_error; /* t counts from the segment's start */
    int phase, method;
    bp_family family;
    bp_seen seen;
} bp_member;

typedef struct {
    const ballpass_ensemble_options *options;
    long members;
    const double *p, *c, *tolerance;
    double *x;
    const long *first;
    const double *times, *inputs;
    const unsigned char *restarts;
    double *reductions;
    bp_member *member;
    ballpass_result *results;
} bp_job;

typedef struct {
    /* numbers of the members in the lanes */
    double p[(BP_NP > 0 ? BP_NP : 1) * BP_L] BP_ALIGNED, c[(BP_NC > 0 ? BP_NC : 1) * BP_L] BP_ALIGNED, u[BP_NU * BP_L] BP_ALIGNED;
    double weight[BP_NX * BP_L] BP_ALIGNED;
    /* where they are */
    double x[BP_NX * BP_L] BP_ALIGNED, next[BP_NX * BP_L] BP_ALIGNED;
    double t[BP_L] BP_ALIGNED, length[BP_L] BP_ALIGNED, step[BP_L] BP_ALIGNED, log_error[BP_L] BP_ALIGNED;
    double h[BP_L] BP_ALIGNED, error[BP_L] BP_ALIGNED;
    /* flags, as numbers so that they live in lanes as well */
    double active[BP_L] BP_ALIGNED, last[BP_L] BP_ALIGNED, accepted[BP_L] BP_ALIGNED, rejected_last[BP_L] BP_ALIGNED;
    double small[BP_L] BP_ALIGNED, reducing[BP_L] BP_ALIGNED, changing[BP_L] BP_ALIGNED;
    double steps[BP_L] BP_ALIGNED, rejected[BP_L] BP_ALIGNED, pivoted[BP_L] BP_ALIGNED; /* since the member entered its lane */
    double allowed[BP_L] BP_ALIGNED; /* steps, accepted and rejected */
    /* what bp_family_looks looks at: steps until the next look, and whether all are looked at */
    double until_look[BP_L] BP_ALIGNED, at_limit[BP_L] BP_ALIGNED;
    bp_lane_explicit plain;
    bp_lane_linear linear;
    /* reductions */
    double dense[BP_DENSE_ROWS][BP_NX * BP_L] BP_ALIGNED;
    double sampled[BP_POINTS][BP_CHANNELS * BP_L] BP_ALIGNED;
    double maximum[BP_CHANNELS * BP_L] BP_ALIGNED, minimum[BP_CHANNELS * BP_L] BP_ALIGNED;
    double integral[BP_CHANNELS * BP_L] BP_ALIGNED, square[BP_CHANNELS * BP_L] BP_ALIGNED;
    long who[BP_L];
    double start[BP_L] BP_ALIGNED, resolution[BP_L] BP_ALIGNED; /* of the segment, and of time within it [s] */
    int linearly;       /* which family this pass advances */
    int balls;          /* whether channels of the balls are reduced */
    unsigned long wanted; /* channels reduced, a bit each; all members have the same */
    bp_lane_numbers numbers;
    bp_lane_angles angles; /* of the step tried */
} bp_lane_block;

static void put(double *lanes, int lane, const double *row, int count)
{
    for (int k = 0; k < count; k++) lanes[k * BP_L + lane] = row[k];
}

static void get(const double *lanes, int lane, double *row, int count)
{
    for (int k = 0; k < count; k++) row[k] = lanes[k * BP_L + lane];
}

static bp_numbers member_numbers(const bp_job *job, long m)
{
    bp_numbers n;
    n.p = job->p + m * BP_NP;
    n.c = job->c + m * BP_NC;
    n.u = job->inputs + (job->first[m] + job->results[m].segment) * BP_NU;
    return n;
}

static double member_end(const bp_job *job, long m) { return job->times[job->first[m] + m + job->results[m].segment + 1]; }
static double member_start(const bp_job *job, long m) { return job->times[job->first[m] + m + job->results[m].segment]; }

/* Of time within the member's segment [s]: see run_segment in stepper.c. */
static double member_resolution(const bp_job *job, long m) { return DBL_EPSILON * fmax(fabs(member_start(job, m)), fabs(member_end(job, m))); }

/* Decide method and step size where a segment begins. */
static void choose_start(const bp_job *job, long m)
{
    bp_member *at = job->member + m;
    ballpass_result *result = job->results + m;
    const bp_numbers n = member_numbers(job, m);
    double *x = job->x + m * BP_NX, weight[BP_NX];
    at->t = 0.0;
    at->family = (bp_family){0};
    if (!job->restarts[job->first[m] + result->segment] && at->step > 0.0) return;
    int method = job->options->method;
    if (method == BALLPASS_AUTO) {
        bp_linear work;
        bp_linear_start(&work, &n, 0.0, x, 1);
        result->evaluations++;
        method = bp_starts_linear(&at->seen, work.A, work.B) ? BALLPASS_RODAS5P : BALLPASS_DP54;
        result->switches += at->method != method && at->method != BALLPASS_AUTO;
    }
    at->method = method;
    for (int k = 0; k < BP_NX; k++) weight[k] = 1.0 / job->tolerance[m * BP_NX + k];
    at->step = bp_first_step(&n, 0.0, x, member_end(job, m) - member_start(job, m), weight,
                             method == BALLPASS_DP54 ? bp_dp54.error_exponent : bp_rodas5p.error_exponent);
    at->log_error = BP_LOG_SMALL_ERROR;
    result->evaluations += 2;
}

/* The same, with a step that moves the time: slopes that overflow give an estimate of zero, or none. */
static void begin_segment(const bp_job *job, long m)
{
    choose_start(job, m);
    const double least = 2.0 * member_resolution(job, m);
    if (!(job->member[m].step > least)) job->member[m].step = least;
}

/* When the member in a lane is looked at next. */
static void tell_looks(const bp_member *at, bp_lane_block *b, int lane)
{
    b->until_look[lane] = (double)((BP_STIFF_LOOK - at->family.steps % BP_STIFF_LOOK) % BP_STIFF_LOOK);
    b->at_limit[lane] = at->family.stiff > 0 ? 1.0 : 0.0;
}

/* Put a member whose segment has begun into a lane, all that depends on the segment included. */
static void enter_segment(const bp_job *job, bp_lane_block *b, int lane)
{
    const long m = b->who[lane];
    const bp_member *at = job->member + m;
    const bp_numbers n = member_numbers(job, m);
    double x[BP_NX], slope[BP_NX], w[BP_NW], wt[BP_NW];
    get(b->x, lane, x, BP_NX);
    put(b->u, lane, n.u, BP_NU);
    b->start[lane] = member_start(job, m);
    b->length[lane] = member_end(job, m) - b->start[lane];
    b->resolution[lane] = member_resolution(job, m);
    b->t[lane] = at->t;
    b->step[lane] = at->step;
    b->log_error[lane] = at->log_error;
    b->rejected_last[lane] = 0.0;
    tell_looks(at, b, lane);
    if (b->linearly) {
        bp_stage_rate(at->t, n.u, n.p, n.c, w, wt);
        put(b->linear.w, lane, w, BP_NW);
        put(b->linear.wt, lane, wt, BP_NW);
    } else {
        bp_explicit_rate(&n, at->t, x, slope);
        put(b->plain.k[0], lane, slope, BP_NX);
    }
    job->results[m].evaluations++;
    b->reducing[lane] = 0.0;
    if (job->reductions != NULL && b->start[lane] >= job->reductions[m * BP_REDUCTION + BP_FROM]) {
        double value[BP_CHANNELS];
        bp_channels(&n, at->t, x, b->balls, value);
        put(b->sampled[0], lane, value, BP_CHANNELS);
        b->reducing[lane] = 1.0;
    }
}

static void enter_lane(const bp_job *job, bp_lane_block *b, int lane, long m)
{
    double weight[BP_NX];
    b->who[lane] = m;
    b->active[lane] = 1.0;
    b->steps[lane] = b->rejected[lane] = b->pivoted[lane] = 0.0;
    b->allowed[lane] = (double)(job->options->max_steps[m] - job->results[m].steps - job->results[m].rejected);
    put(b->p, lane, job->p + m * BP_NP, BP_NP);
    put(b->c, lane, job->c + m * BP_NC, BP_NC);
    put(b->x, lane, job->x + m * BP_NX, BP_NX);
    for (int k = 0; k < BP_NX; k++) weight[k] = 1.0 / job->tolerance[m * BP_NX + k];
    put(b->weight, lane, weight, BP_NX);
    if (job->reductions != NULL) {
        const double *row = job->reductions + m * BP_REDUCTION;
        const int begun = row[BP_DURATION] > 0.0;
        for (int k = 0; k < BP_CHANNELS; k++) {
            b->maximum[k * BP_L + lane] = begun ? row[BP_MAX + k] : -INFINITY;
            b->minimum[k * BP_L + lane] = begun ? row[BP_MIN + k] : INFINITY;
            b->integral[k * BP_L + lane] = row[BP_INTEGRAL + k];
            b->square[k * BP_L + lane] = row[BP_SQUARE + k];
        }
    }
    enter_segment(job, b, lane);
}

/* Keep what a lane knows of its member, and free the lane. */
static void leave_lane(const bp_job *job, bp_lane_block *b, int lane, int status)
{
    const long m = b->who[lane];
    ballpass_result *result = job->results + m;
    bp_member *at = job->member + m;
    get(b->x, lane, job->x + m * BP_NX, BP_NX);
    const long steps = (long)b->steps[lane], rejected = (long)b->rejected[lane];
    result->steps += steps;
    result->rejected += rejected;
    result->evaluations += (steps + rejected) * (b->linearly ? BP_RODAS5P_STAGES : BP_DP54_STAGES);
    result->factorizations += b->linearly ? steps + rejected : 0;
    result->pivoted += (long)b->pivoted[lane];
    result->status = status;
    result->method = b->linearly ? BALLPASS_RODAS5P : BALLPASS_DP54;
    result->step = b->step[lane];
    if (job->reductions != NULL) {
        double *row = job->reductions + m * BP_REDUCTION;
        get(b->integral, lane, row + BP_INTEGRAL, BP_CHANNELS);
        get(b->square, lane, row + BP_SQUARE, BP_CHANNELS);
    }
    result->time = b->start[lane] + b->t[lane];
    at->t = b->t[lane];
    at->step = b->step[lane];
    at->log_error = b->log_error[lane];
    /* an idle lane goes on with numbers that do no harm */
    b->active[lane] = b->reducing[lane] = b->t[lane] = b->small[lane] = b->changing[lane] = 0.0;
    b->length[lane] = 1.0;
    b->step[lane] = 1e-9;
    b->who[lane] = -1;
}

/* A member within the step just taken, for bp_extreme. */
typedef struct {
    bp_numbers n;
    double t, h, x[BP_NX], next[BP_NX], dense[BP_DENSE_ROWS][BP_NX];
    int linearly;
} bp_lane_source;

static bp_lane_source lane_source(const bp_job *job, const bp_lane_block *b, int lane)
{
    bp_lane_source source;
    source.n = member_numbers(job, b->who[lane]);
    source.t = b->t[lane];
    source.h = b->h[lane];
    source.linearly = b->linearly;
    get(b->x, lane, source.x, BP_NX);
    get(b->next, lane, source.next, BP_NX);
    const int rows = b->linearly ? bp_rodas5p.dense_rows : 2 + bp_dp54.dense_rows;
    for (int row = 0; row < rows; row++) get(b->dense[row], lane, source.dense[row], BP_NX);
    return source;
}

static double lane_channel(const void *from, int channel, double theta, int *ball)
{
    const bp_lane_source *source = from;
    const double(*dense)[BP_NX] = (const double(*)[BP_NX])source->dense;
    double y[BP_NX];
    if (source->linearly) bp_rosenbrock_at(&bp_rodas5p, dense, source->x, source->next, theta, y);
    else bp_explicit_at(&bp_dp54, dense, source->x, source->next, theta, y);
    return bp_channel(&source->n, source->t + theta * source->h, y, channel, ball);
}

/* Reductions of the lanes whose step was accepted; the same rules as bp_reduce. */
static void reduce(const bp_job *job, bp_lane_block *b)
{
    double add[BP_L] BP_ALIGNED;
    BP_EACH_LANE add[lane] = b->accepted[lane] * b->reducing[lane];
    const double(*dense)[BP_NX * BP_L] = (const double(*)[BP_NX * BP_L])b->dense;
    if (b->linearly) bp_lane_rosenbrock_dense(&bp_rodas5p, (const double(*)[BP_NX * BP_L])b->linear.u, b->dense);
    else bp_lane_explicit_dense(&bp_dp54, NULL, b->plain.k, b->x, b->h, b->next, b->dense);
    for (int q = 1; q < BP_POINTS; q++) {
        const double theta = (double)q / (BP_POINTS - 1);
        double *restrict y = b->sampled[q];
        if (q == BP_POINTS - 1) memcpy(y, b->next, sizeof b->next);
        else if (b->linearly) bp_lane_rosenbrock_at(&bp_rodas5p, dense, b->x, b->next, theta, y);
        else bp_lane_explicit_at(&bp_dp54, dense, b->x, b->next, theta, y);
        if (!b->balls) continue;
        bp_lane_ball_channels(&b->numbers, &b->angles, theta, b->t, b->h, y, y + BP_NX * BP_L);
    }
    for (int k = 0; k < BP_CHANNELS; k++) {
        if (!(b->wanted >> k & 1)) continue;
        double news[BP_L] BP_ALIGNED, any = 0.0;
        const int row = k * BP_L;
        BP_EACH_LANE {
            const double v0 = b->sampled[0][row + lane], v1 = b->sampled[1][row + lane], v2 = b->sampled[2][row + lane];
            const double v3 = b->sampled[3][row + lane], v4 = b->sampled[4][row + lane];
            const double sum = bp_boole[0] * (v0 + v4) + bp_boole[1] * (v1 + v3) + bp_boole[2] * v2;
            double q[5], low, high;
            bp_quartic(v0, v1, v2, v3, v4, q);
            bp_survey(v0, v1, v2, v3, v4, q, &low, &high);
            const double boole = bp_boole[0] * (v0 * v0 + v4 * v4) + bp_boole[1] * (v1 * v1 + v3 * v3) + bp_boole[2] * (v2 * v2);
            const double squares = k < BP_NX ? bp_mean_square(q) : boole;
            b->integral[row + lane] += add[lane] != 0.0 ? b->h[lane] * sum : 0.0;
            b->square[row + lane] += add[lane] != 0.0 ? b->h[lane] * squares : 0.0;
            const double above = high > b->maximum[row + lane] ? 1.0 : 0.0, below = low < b->minimum[row + lane] ? 1.0 : 0.0;
            news[lane] = add[lane] * (above + 2.0 * below);
        }
        for (int lane = 0; lane < BP_L; lane++) any += news[lane];
        if (any == 0.0) continue;
        for (int lane = 0; lane < BP_L; lane++) {
            if (news[lane] == 0.0) continue;
            const long m = b->who[lane];
            double *reduction = job->reductions + m * BP_REDUCTION;
            const bp_lane_source source = lane_source(job, b, lane);
            const double time = b->start[lane] + b->t[lane], *v = b->sampled[0] + row + lane;
            if (news[lane] != 2.0) bp_extreme(reduction, BP_MAX, k, 1.0, v, BP_CHANNELS * BP_L, time, b->h[lane], lane_channel, &source);
            if (news[lane] != 1.0) bp_extreme(reduction, BP_MIN, k, -1.0, v, BP_CHANNELS * BP_L, time, b->h[lane], lane_channel, &source);
            b->maximum[row + lane] = reduction[BP_MAX + k];
            b->minimum[row + lane] = reduction[BP_MIN + k];
        }
    }
    for (int lane = 0; lane < BP_L; lane++)
        if (add[lane] != 0.0) job->reductions[b->who[lane] * BP_REDUCTION + BP_DURATION] += b->h[lane];
    for (int k = 0; k < BP_CHANNELS; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            b->sampled[0][i] = add[lane] != 0.0 ? b->sampled[BP_POINTS - 1][i] : b->sampled[0][i];
        }
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

/* The method for the next step of a lane, from the accepted one by Dormand-Prince of this reach: see judge_family in stepper.c. */
static int after_explicit(const bp_job *job, const bp_lane_block *b, int lane, double reach)
{
    const long m = b->who[lane];
    bp_member *at = job->member + m;
    const int wanted = bp_look_at_explicit(&at->family, at->method, reach, b->h[lane]);
    if (wanted == BP_GO_ON) return at->method;
    if (wanted == BP_GIVE_UP) return bp_try_linear(&at->family, &at->seen, b->h[lane]);
    double stable = INFINITY;
    if (wanted == BP_ASK) {
        const bp_numbers n = member_numbers(job, m);
        double x[BP_NX];
        bp_linear work;
        get(b->x, lane, x, BP_NX);
        bp_linear_start(&work, &n, b->t[lane], x, 1);
        job->results[m].evaluations++;
        stable = bp_stable_step(work.A, work.B, 1);
    }
    return bp_after_explicit(&at->family, &at->seen, at->method, stable, 0);
}

/* Ask the rule of families about the lanes in which a step is to be looked at. */
static void look(const bp_job *job, bp_lane_block *b, const double *looking)
{
    double reach[BP_L] BP_ALIGNED;
    const double(*k)[BP_NX * BP_L] = (const double(*)[BP_NX * BP_L])b->plain.k;
    if (!b->linearly) bp_lane_explicit_reach(BP_DP54_STAGES, k, b->plain.y, b->h, b->next, b->weight, reach);
    for (int lane = 0; lane < BP_L; lane++) {
        if (looking[lane] == 0.0) continue;
        bp_member *at = job->member + b->who[lane];
        int method;
        /* the lane has counted to the next look; of the steps only the rest by BP_STIFF_LOOK matters */
        if (at->family.stiff == 0) at->family.steps = 1;
        if (b->linearly) {
            method = at->method;
            if (bp_look_at_linear(&at->family, b->h[lane])) {
                double A[BP_NQ * BP_NQ], B[BP_NQ * BP_NQ];
                get(b->linear.A, lane, A, BP_NQ * BP_NQ);
                get(b->linear.B, lane, B, BP_NQ * BP_NQ);
                method = bp_after_linear(&at->family, &at->seen, method, bp_stable_step(A, B, 1));
            }
        } else {
            method = after_explicit(job, b, lane, reach[lane]);
        }
        b->changing[lane] = method == at->method ? 0.0 : 1.0;
        tell_looks(at, b, lane);
    }
}

/* Accept or reject; propose the next step sizes by the PI controller (Hairer & Wanner II, section IV.2). */
static void judge(const bp_job *job, bp_lane_block *b, int changeable)
{
    const double exponent = 1.0 / (b->linearly ? bp_rodas5p.error_exponent : bp_dp54.error_exponent);
    const double log_least = -23.025850929940457; /* of 1e-10 */
    double beyond[BP_L] BP_ALIGNED, fine[BP_L] BP_ALIGNED, bounded[BP_L] BP_ALIGNED, log_error[BP_L] BP_ALIGNED;
    double factor[BP_L] BP_ALIGNED, log_factor[BP_L] BP_ALIGNED;
    /* states beyond reach: no number, or so large that the tolerance is below their rounding (within_reach in stepper.c).  A comparison
       with what is no number is false */
    BP_EACH_LANE beyond[lane] = 0.0;
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE beyond[lane] += fabs(b->next[k * BP_L + lane]) * b->weight[k * BP_L + lane] <= 1.0 / DBL_EPSILON ? 0.0 : 1.0;
    BP_EACH_LANE {
        /* whether the error says by how much to shrink */
        fine[lane] = b->error[lane] > 1.0 && b->error[lane] <= DBL_MAX ? 1.0 : 0.0;
        const double least = b->error[lane] > 1e-10 ? b->error[lane] : 1e-10;
        bounded[lane] = least <= DBL_MAX ? least : 1.0;
    }
    bp_lane_log(bounded, log_error);
    BP_EACH_LANE {
        log_error[lane] = log_error[lane] > log_least ? log_error[lane] : log_least;
        const double log_grow = (0.4 * b->log_error[lane] - 0.7 * log_error[lane]) * exponent;
        const double accepted = b->error[lane] <= 1.0 && beyond[lane] == 0.0 ? b->active[lane] : 0.0;
        b->accepted[lane] = accepted;
        log_factor[lane] = accepted != 0.0 ? log_grow : -log_error[lane] * exponent;
    }
    bp_lane_exp(log_factor, factor);
    BP_EACH_LANE {
        const double accepted = b->accepted[lane];
        double up = 0.9 * factor[lane];
        up = up > 6.0 ? 6.0 : up;
        up = up < 0.2 ? 0.2 : up;
        const double bound = b->rejected_last[lane] != 0.0 ? 1.0 : 6.0;
        up = up > bound ? bound : up;
        double down = fine[lane] != 0.0 ? 0.9 * factor[lane] : 0.1;
        down = down < 0.1 ? 0.1 : down;
        down = down > 0.9 ? 0.9 : down;
        /* a last step cut short says nothing against the size that was proposed */
        const double cut = up >= 1.0 ? b->last[lane] : 0.0;
        const double kept = cut != 0.0 ? b->step[lane] : b->h[lane] * up;
        const double tried = b->active[lane] != 0.0 ? b->h[lane] * down : b->step[lane];
        b->step[lane] = accepted != 0.0 ? kept : tried;
        const double remembered = log_error[lane] > BP_LOG_SMALL_ERROR ? log_error[lane] : BP_LOG_SMALL_ERROR;
        b->log_error[lane] = accepted != 0.0 ? remembered : b->log_error[lane];
        b->rejected_last[lane] = 1.0 - accepted;
        b->steps[lane] += accepted;
        b->rejected[lane] += b->active[lane] - accepted;
        /* accepted steps may shrink as well: they would no longer move the time, unless the next is the last */
        const double ahead = b->length[lane] - (b->t[lane] + b->h[lane]);
        const double lasting = b->step[lane] * 1.0001 >= ahead ? b->active[lane] - accepted : b->active[lane];
        b->small[lane] = b->step[lane] <= b->resolution[lane] ? lasting : 0.0;
    }
    if (b->linearly) BP_EACH_LANE b->pivoted[lane] += b->active[lane] * b->linear.pivoted[lane];
    if (!changeable) return;
    double looking[BP_L] BP_ALIGNED;
    int any = 0;
    BP_EACH_LANE {
        /* bp_family_looks, for all lanes: steps are not counted while all are looked at */
        const double due = b->until_look[lane] == 0.0 || b->at_limit[lane] != 0.0 ? b->accepted[lane] : 0.0;
        const double counted = b->at_limit[lane] == 0.0 ? b->accepted[lane] : 0.0;
        looking[lane] = due;
        b->until_look[lane] -= due == 0.0 ? counted : 0.0;
    }
    for (int lane = 0; lane < BP_L; lane++) any |= looking[lane] != 0.0;
    if (any) look(job, b, looking);
}

/* Take over what accepted steps reached. */
static void advance(bp_lane_block *b)
{
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            b->x[i] = b->accepted[lane] != 0.0 ? b->next[i] : b->x[i];
        }
    if (b->linearly) {
        for (int k = 0; k < BP_NW; k++)
            BP_EACH_LANE {
                const int i = k * BP_L + lane;
                b->linear.w[i] = b->accepted[lane] != 0.0 ? b->linear.end_w[i] : b->linear.w[i];
                b->linear.wt[i] = b->accepted[lane] != 0.0 ? b->linear.end_wt[i] : b->linear.wt[i];
            }
    } else {
        for (int k = 0; k < BP_NX; k++)
            BP_EACH_LANE {
                const int i = k * BP_L + lane;
                b->plain.k[0][i] = b->accepted[lane] != 0.0 ? b->plain.k[BP_DP54_STAGES][i] : b->plain.k[0][i];
            }
    }
    BP_EACH_LANE {
        const double there = b->last[lane] != 0.0 ? b->length[lane] : b->t[lane] + b->h[lane];
        b->t[lane] = b->accepted[lane] != 0.0 ? there : b->t[lane];
    }
}

/* The state that moved most against its tolerance, or the first that is no number. */
static int worst_state(const bp_lane_block *b, int lane)
{
    int worst = 0;
    double largest = -1.0;
    for (int k = 0; k < BP_NX; k++) {
        const int i = k * BP_L + lane;
        if (!(fabs(b->next[i]) <= DBL_MAX)) return k;
        const double change = fabs(b->next[i] - b->x[i]) * b->weight[i];
        if (change > largest) {
            largest = change;
            worst = k;
        }
    }
    return worst;
}

/* Whether anything happens in a lane beyond its step: the end of a segment, a change of family, or of the run. */
static int eventful(const bp_lane_block *b)
{
    double happens[BP_L] BP_ALIGNED;
    int any = 0;
    BP_EACH_LANE {
        const double over = b->steps[lane] + b->rejected[lane] >= b->allowed[lane] ? b->active[lane] : 0.0;
        happens[lane] = b->accepted[lane] * b->last[lane] + over + b->small[lane] + b->changing[lane];
    }
    for (int lane = 0; lane < BP_L; lane++) any |= happens[lane] != 0.0;
    return any;
}

/* What happens to a lane beyond a step: ends of segments, failures, changes of method.  Returns whether the lane has become free. */
static int settle(const bp_job *job, bp_lane_block *b, int lane)
{
    const long m = b->who[lane];
    ballpass_result *result = job->results + m;
    bp_member *at = job->member + m;
    int status = BALLPASS_DONE;
    const int changing = b->changing[lane] != 0.0;
    if (changing) {
        at->method = b->linearly ? BALLPASS_DP54 : BALLPASS_RODAS5P;
        result->switches++;
        if (b->linearly && b->step[lane] > at->family.stable) b->step[lane] = at->family.stable;
        b->changing[lane] = 0.0;
    }
    if (b->accepted[lane] != 0.0 && b->last[lane] != 0.0) {
        const long segments = job->first[m + 1] - job->first[m];
        const double reached = member_end(job, m);
        at->step = b->step[lane];
        at->log_error = b->log_error[lane];
        while (result->segment + 1 < segments) {
            result->segment++;
            if (!(member_end(job, m) > member_start(job, m))) continue;
            get(b->x, lane, job->x + m * BP_NX, BP_NX);
            begin_segment(job, m);
            if ((at->method == BALLPASS_RODAS5P) == b->linearly) {
                enter_segment(job, b, lane);
                return 0;
            }
            /* the other pass takes it: step size and time as the new segment wants them */
            const bp_member begun = *at;
            leave_lane(job, b, lane, BALLPASS_DONE);
            *at = begun;
            return 1;
        }
        at->phase = BP_FINISHED;
        leave_lane(job, b, lane, BALLPASS_DONE);
        result->time = reached;
        if (job->options->reached != NULL) job->options->reached[m] = reached;
        return 1;
    }
    if (b->small[lane] != 0.0) {
        status = b->error[lane] <= DBL_MAX ? BALLPASS_STEP_TOO_SMALL : BALLPASS_NOT_FINITE;
        for (int k = 0; k < BP_NX; k++)
            if (!(fabs(b->next[k * BP_L + lane]) <= DBL_MAX)) status = BALLPASS_NOT_FINITE;
    } else if (b->steps[lane] + b->rejected[lane] >= b->allowed[lane]) {
        status = BALLPASS_TOO_MANY_STEPS;
    }
    if (status == BALLPASS_DONE && !changing) return 0;
    if (status != BALLPASS_DONE) at->phase = BP_FINISHED;
    if (b->small[lane] != 0.0) result->state = worst_state(b, lane);
    leave_lane(job, b, lane, status);
    return 1;
}

/* The next member that waits for this pass, from `from` on; -1 if none. */
static long next_member(const bp_job *job, int linearly, long from)
{
    for (long m = from; m < job->members; m++)
        if (job->member[m].phase == BP_WAITING && (job->member[m].method == BALLPASS_RODAS5P) == linearly) return m;
    return -1;
}

/* Tell the caller how far the members in the lanes have come. */
static void tell_reached(const bp_job *job, const bp_lane_block *b)
{
    if (job->options->reached == NULL) return;
    for (int lane = 0; lane < BP_L; lane++)
        if (b->active[lane] != 0.0) job->options->reached[b->who[lane]] = b->start[lane] + b->t[lane];
}

/* Advance all members that wait for a family until they are done or leave it; returns 0 when asked to stop. */
static int pass(const bp_job *job, bp_lane_block *b, int linearly)
{
    const int changeable = job->options->method == BALLPASS_AUTO;
    long waiting = next_member(job, linearly, 0);
    int filled = 0, stopped = 0;
    if (waiting < 0) return 1;
    memset(b, 0, sizeof *b);
    b->linearly = linearly;
    b->wanted = job->reductions != NULL ? bp_wanted(job->reductions) : 0;
    b->balls = job->reductions != NULL && bp_balls_wanted(job->reductions);
    b->numbers.u = b->u;
    b->numbers.p = b->p;
    b->numbers.c = b->c;
    for (int lane = 0; lane < BP_L; lane++) {
        /* every lane starts with a member's numbers, so that idle ones do no harm either */
        enter_lane(job, b, lane, waiting >= 0 ? waiting : b->who[0]);
        if (waiting >= 0) {
            filled++;
            waiting = next_member(job, linearly, waiting + 1);
        } else {
            job->results[b->who[lane]].evaluations--;
            b->active[lane] = b->reducing[lane] = b->t[lane] = 0.0;
            b->length[lane] = 1.0;
            b->step[lane] = 1e-9;
            b->who[lane] = -1;
        }
    }
    for (long round = 0; filled > 0 && !stopped; round++) {
        choose_steps(b);
        if (linearly) bp_lane_linear_step(&b->linear, &b->numbers, &b->angles, b->t, b->x, b->h, b->weight, b->next, b->error);
        else bp_lane_explicit_step(&b->plain, &b->numbers, &b->angles, b->t, b->x, b->h, b->weight, b->next, b->error);
        judge(job, b, changeable);
        double reducing = 0.0;
        for (int lane = 0; lane < BP_L; lane++) reducing += b->reducing[lane];
        if (reducing > 0.0) reduce(job, b);
        advance(b);
        const int happening = eventful(b);
        for (int lane = 0; lane < BP_L && happening; lane++) {
            if (b->active[lane] == 0.0 || !settle(job, b, lane)) continue;
            if (waiting >= 0) {
                enter_lane(job, b, lane, waiting);
                waiting = next_member(job, linearly, waiting + 1);
            } else {
                filled--;
            }
        }
        if (round % BP_TELL_INTERVAL != 0) continue;
        tell_reached(job, b);
        stopped = job->options->stop != NULL && *job->options->stop;
    }
    for (int lane = 0; lane < BP_L; lane++)
        if (b->active[lane] != 0.0) leave_lane(job, b, lane, BALLPASS_STOPPED);
    return !stopped;
}

int ballpass_ensemble(const ballpass_ensemble_options *options, long members, const double *p, const double *c, const double *tolerance,
                     double *x, const long *first, const double *times, const double *inputs, const unsigned char *restarts,
                     double *reductions, void *work, ballpass_result *results)
{
    const bp_job job = {options, members, p, c, tolerance, x, first, times, inputs, restarts, reductions, work, results};
    bp_lane_block block;
    if (options->method != BALLPASS_AUTO && options->method != BALLPASS_DP54 && options->method != BALLPASS_RODAS5P) return BALLPASS_BAD_ARGUMENT;
    for (long m = 0; m < members; m++) {
        ballpass_result *result = results + m;
        bp_member *at = job.member + m;
        const long segments = first[m + 1] - first[m];
        const double *own = times + first[m] + m;
        if (!options->resume) {
            memset(result, 0, sizeof *result);
            memset(at, 0, sizeof *at);
            at->seen.least = INFINITY;
            result->state = -1;
            result->status = BALLPASS_DONE;
        }
        at->phase = BP_FINISHED;
        /* what an earlier call could not bring to its end does not go on */
        if (result->status != BALLPASS_DONE) continue;
        result->segment = 0;
        if (segments < 0) result->status = BALLPASS_BAD_ARGUMENT;
        else result->time = own[0];
        for (long i = 0; i < segments; i++)
            if (!(own[i + 1] >= own[i])) result->status = BALLPASS_BAD_ARGUMENT;
        for (int k = 0; k < BP_NX; k++) {
            const double error = tolerance[m * BP_NX + k];
            /* zero, below it, not a number, or so small that its inverse is none */
            if (!(error > 0.0 && 1.0 / error <= DBL_MAX)) result->status = BALLPASS_BAD_ARGUMENT;
        }
        for (int k = 0; k < BP_NX; k++)
            if (!(fabs(x[m * BP_NX + k]) <= DBL_MAX)) result->status = BALLPASS_NOT_FINITE;
        if (result->status != BALLPASS_DONE || !(own[segments] > own[0])) continue;
        while (!(member_end(&job, m) > member_start(&job, m))) result->segment++;
        begin_segment(&job, m);
        at->phase = BP_WAITING;
        result->status = BALLPASS_STOPPED; /* unless it comes to another end */
    }
    for (int linearly = 0;; linearly = !linearly) {
        if (next_member(&job, linearly, 0) < 0 && next_member(&job, !linearly, 0) < 0) return BALLPASS_DONE;
        if (!pass(&job, &block, linearly)) break;
    }
    for (long m = 0; m < members; m++)
        if (job.member[m].phase == BP_WAITING) results[m].status = BALLPASS_STOPPED;
    return BALLPASS_STOPPED;
}

void ballpass_ensemble_magnitudes(long members, const double *p, const double *c, const double *initial, const long *first,
                                 const double *inputs, const double *horizons, double *magnitudes)
{
    for (long m = 0; m < members; m++)
        bp_magnitudes(p + m * BP_NP, c + m * BP_NC, initial + m * BP_NX, first[m + 1] - first[m], inputs + first[m] * BP_NU, horizons[m],
                      magnitudes + m * BP_NX);
}

long ballpass_ensemble_work(long members) { return members * (long)sizeof(bp_member); }

void ballpass_ensemble_sizes(int *sizes)
{
    sizes[0] = BP_REDUCTION;
    sizes[1] = BP_CHANNELS;
    sizes[2] = BP_L;
    sizes[3] = (int)sizeof(ballpass_ensemble_options);
}
