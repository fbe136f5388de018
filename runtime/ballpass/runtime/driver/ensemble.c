/* Members in and out of lanes, step sizes, segments, reductions.  See ensemble.h; the steps themselves are in lanes.h.

   Passes take turns until every member is done: each advances the members of one method.  A member that changes its method leaves its lane
   and waits for the pass of that. */
#include "ensemble.h"

#include <float.h>

#include "lane_control.h"
#include "lane_reductions.h"
#include "scales.h"

enum { BP_TELL_INTERVAL = 64 }; /* rounds between looks at the caller's wish to stop, and words on how far members are */

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
        method = bp_starts_linear(&at->seen, work.A, work.B) ? BP_AUTO_LINEAR : BP_AUTO_LOW;
        result->switches += at->method != method && at->method != BALLPASS_AUTO;
    }
    at->method = method;
    for (int k = 0; k < BP_NX; k++) weight[k] = 1.0 / job->tolerance[m * BP_NX + k];
    at->step = bp_first_step(&n, 0.0, x, member_end(job, m) - member_start(job, m), weight, bp_methods[method].error_exponent);
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

/* The powers of the balls' loads that sectors add up, out of all quantities of the balls. */
static void put_powers(bp_lane_block *b, int lane, const double *balls)
{
#define BP_PUT(b_)                                                                                       \
    for (int j = 0; j < BP_##b_##_BALLS; j++) {                                                          \
        const double force = balls[BP_BALL_CHANNELS * bp_first_ball[bearing] + j];                         \
        const double load = force > 0.0 ? 1e-3 * force : 0.0;                                            \
        b->first[0][(bp_first_ball[bearing] + j) * BP_L + lane] = bp_power(load, BP_SECTOR_POWER(b_));     \
    }
    BP_EACH_BEARING(BP_PUT)
#undef BP_PUT
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
    if (bp_methods[b->method].linear) {
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
        double value[BP_CHANNELS], balls[BP_BALL_QUANTITIES], *row = job->reductions + m * BP_REDUCTION;
        bp_channels(&n, at->t, x, b->balls, value, balls);
        put(b->sampled[0], lane, value, BP_CHANNELS);
        for (int k = 0; k < BP_LOOKED_AT - BP_NX && b->sided; k++) b->side[0][k * BP_L + lane] = bp_side(balls, k);
        if (!(row[BP_DURATION] > 0.0)) memcpy(row + BP_SHIFT, value, BP_LOOKED_AT * sizeof *value);
        put(b->shift, lane, row + BP_SHIFT, BP_CHANNELS);
        if (b->passes) put_powers(b, lane, balls);
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
            for (int e = 0; e < BP_EXTREMES; e++)
                b->best[e][k * BP_L + lane] = begun ? row[BP_EXTREME + 3 * e * BP_CHANNELS + k] : -bp_sign[e] * INFINITY;
            for (int m = 0; m < BP_MOMENTS; m++) b->moment[m][k * BP_L + lane] = row[BP_MOMENT + m * BP_CHANNELS + k];
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
    const bp_method *method = &bp_methods[b->method];
    const long steps = (long)b->steps[lane], rejected = (long)b->rejected[lane];
    result->steps += steps;
    result->rejected += rejected;
    result->evaluations += (steps + rejected) * (method->plain ? method->plain->stages : method->linear->stages);
    result->factorizations += method->linear ? steps + rejected : 0;
    result->pivoted += (long)b->pivoted[lane];
    result->status = status;
    result->method = b->method;
    result->step = b->step[lane];
    if (job->reductions != NULL) {
        double *row = job->reductions + m * BP_REDUCTION;
        for (int m = 0; m < BP_MOMENTS; m++) get(b->moment[m], lane, row + BP_MOMENT + m * BP_CHANNELS, BP_CHANNELS);
    }
    result->time = b->start[lane] + b->t[lane];
    at->t = b->t[lane];
    at->step = b->step[lane];
    at->log_error = b->log_error[lane];
    /* an idle lane continues with numbers that do no harm */
    b->active[lane] = b->reducing[lane] = b->t[lane] = b->small[lane] = b->changing[lane] = 0.0;
    b->length[lane] = 1.0;
    b->step[lane] = 1e-9;
    b->who[lane] = -1;
}

/* Take over what accepted steps reached. */
static void advance(bp_lane_block *b)
{
    for (int k = 0; k < BP_NX; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            b->x[i] = b->accepted[lane] != 0.0 ? b->next[i] : b->x[i];
        }
    const bp_explicit_method *plain = bp_methods[b->method].plain;
    if (!plain) {
        for (int k = 0; k < BP_NW; k++)
            BP_EACH_LANE {
                const int i = k * BP_L + lane;
                b->linear.w[i] = b->accepted[lane] != 0.0 ? b->linear.end_w[i] : b->linear.w[i];
                b->linear.wt[i] = b->accepted[lane] != 0.0 ? b->linear.end_wt[i] : b->linear.wt[i];
            }
    } else {
        const double *end = b->plain.k[plain->stages];
        for (int k = 0; k < BP_NX; k++)
            BP_EACH_LANE {
                /* both are read: of a row whose number the compiler does not know it reads no lane that is not taken */
                const double known = b->plain.k[0][k * BP_L + lane], slope = end[k * BP_L + lane];
                b->plain.k[0][k * BP_L + lane] = b->accepted[lane] != 0.0 ? slope : known;
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
    BP_EACH_LANE {
        const double over = b->steps[lane] + b->rejected[lane] >= b->allowed[lane] ? b->active[lane] : 0.0;
        happens[lane] = b->accepted[lane] * b->last[lane] + over + b->small[lane] + b->changing[lane];
    }
    return bp_any_lane(happens);
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
        at->method = (int)b->changing[lane];
        result->switches++;
        if (bp_methods[at->method].plain && b->step[lane] > at->family.stable) b->step[lane] = at->family.stable;
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
            if (at->method == b->method) {
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
static long next_member(const bp_job *job, int method, long from)
{
    for (long m = from; m < job->members; m++)
        if (job->member[m].phase == BP_WAITING && job->member[m].method == method) return m;
    return -1;
}

/* Tell the caller how far the members in the lanes have come. */
static void tell_reached(const bp_job *job, const bp_lane_block *b)
{
    if (job->options->reached == NULL) return;
    for (int lane = 0; lane < BP_L; lane++)
        if (b->active[lane] != 0.0) job->options->reached[b->who[lane]] = b->start[lane] + b->t[lane];
}

/* Advance all members that wait for a method until they are done or leave it; returns 0 when asked to stop. */
static int pass(const bp_job *job, bp_lane_block *b, int method)
{
    const int changeable = job->options->method == BALLPASS_AUTO;
    const bp_explicit_method *plain = bp_methods[method].plain;
    const bp_rosenbrock_method *linear = bp_methods[method].linear;
    long waiting = next_member(job, method, 0);
    int filled = 0, stopped = 0;
    if (waiting < 0) return 1;
    memset(b, 0, sizeof *b);
    b->method = method;
    if (job->reductions != NULL) list_wanted(b, job->reductions);
    b->numbers.u = b->u;
    b->numbers.p = b->p;
    b->numbers.c = b->c;
    for (int lane = 0; lane < BP_L; lane++) {
        /* every lane starts with a member's numbers, so that idle ones do no harm either */
        enter_lane(job, b, lane, waiting >= 0 ? waiting : b->who[0]);
        if (waiting >= 0) {
            filled++;
            waiting = next_member(job, method, waiting + 1);
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
        if (linear) bp_lane_linear_step(linear, &b->linear, &b->numbers, &b->angles, b->t, b->x, b->h, b->weight, b->next, b->error);
        /* the method of most runs once more, so that its coefficients are constants */
        else if (method == BP_AUTO_LOW)
            bp_lane_explicit_step(bp_methods[BP_AUTO_LOW].plain, &b->plain, &b->numbers, &b->angles, b->t, b->x, b->h, b->weight, b->next,
                                  b->error);
        else bp_lane_explicit_step(plain, &b->plain, &b->numbers, &b->angles, b->t, b->x, b->h, b->weight, b->next, b->error);
        judge(job, b, changeable);
        if (bp_any_lane(b->reducing)) reduce(job, b);
        advance(b);
        const int happening = eventful(b);
        for (int lane = 0; lane < BP_L && happening; lane++) {
            if (b->active[lane] == 0.0 || !settle(job, b, lane)) continue;
            if (waiting >= 0) {
                enter_lane(job, b, lane, waiting);
                waiting = next_member(job, method, waiting + 1);
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
    if (options->method < BALLPASS_AUTO || options->method >= BP_METHODS) return BALLPASS_BAD_ARGUMENT;
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
    int under_way = 1, stopped = 0;
    while (under_way && !stopped) {
        under_way = 0;
        for (int method = 1; method < BP_METHODS && !stopped; method++) {
            under_way |= next_member(&job, method, 0) >= 0;
            stopped = !pass(&job, &block, method);
        }
    }
    if (!stopped) return BALLPASS_DONE;
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
    sizes[4] = (int)sizeof(ballpass_schedule);
    sizes[5] = (int)sizeof(schedule_input);
    sizes[6] = (int)sizeof(schedule_turning);
}
