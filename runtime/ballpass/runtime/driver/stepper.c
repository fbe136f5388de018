/* The loop around the methods: segments, step sizes, choice of method, status.  See stepper.h; a run and its steps are in run.h. */
#include "stepper.h"

#include <float.h>
#include <string.h>

#include "control.h"
#include "differentiate.h"
#include "family.h"
#include "locate.h"
#include "observe.h"
#include "run.h"
#include "scales.h"

static double estimate_step(bp_run *run, double t, double longest)
{
    run->result->evaluations += 2;
    return bp_first_step(&run->numbers, t, run->x, longest, run->weight, bp_methods[run->method].error_exponent);
}

/* The family for the coming segment. */
static int choose_method(bp_run *run, double t)
{
    bp_linear_start(&run->linear, &run->numbers, t, run->x, 1);
    run->result->evaluations++;
    return bp_starts_linear(&run->seen, run->linear.A, run->linear.B) ? BP_AUTO_LINEAR : BP_AUTO_LOW;
}

typedef struct {
    bp_run *run;
    double t;
} bp_step_start;

static double stable_step(void *from, const bp_stability *limit)
{
    const bp_step_start *start = from;
    bp_run *run = start->run;
    if (is_explicit(run->method)) linearize(run, start->t, 1);
    return bp_stable_step(run->linear.A, run->linear.B, limit);
}

/* The method for the next step, from the accepted one of size h at time t. */
static int judge_family(bp_run *run, bp_family *family, double t, double h)
{
    const bp_explicit_method *plain = explicit_method(run->method);
    bp_step_start start = {run, t};
    double reach = 0.0;
    if (!bp_family_looks(family)) return run->method;
    if (plain) bp_explicit_reach(plain->stages, (const double(*)[BP_NX])run->plain.k, run->plain.y, &h, run->next, run->weight, &reach);
    return bp_judge_family(family, &run->seen, run->method, 1, h, reach, stable_step, &start);
}

/* The first step of a segment from `start` on: its size and method, and what it starts from. */
static void begin_segment(bp_run *run, double start, double length, double resolution, int restart, int changeable)
{
    const ballpass_options *options = run->options;
    const double t = 0.0;
    if (run->step == 0.0) sides_start(run, t);
    else if (restart) sides_jump(run, t);
    if (restart || run->step == 0.0) {
        if (changeable) {
            const int chosen = choose_method(run, t);
            run->result->switches += run->method != chosen && run->method != BALLPASS_AUTO;
            run->method = chosen;
        }
        const double estimate = options->first_step > 0.0 && run->step == 0.0 ? options->first_step : estimate_step(run, t, length);
        run->step = estimate;
        run->last_error = BP_LOG_SMALL_ERROR;
    }
    sides_of_method(run);
    /* slopes that overflow give an estimate of zero, or none */
    if (!(run->step > 2.0 * resolution)) run->step = 2.0 * resolution;
    forget_release(run);
    reduce_start(run, start);
    tangent_jump(run);
    if (is_explicit(run->method)) first_slope(run, t);
    else linearize(run, t, 1);
    tangent_start(run, t);
    run->elapsed = t;
    run->rejected_last = run->waiting = 0;
    run->family = (bp_family){0};
}

/* Keep the data that a run needs to continue in another call; returns the status. */
static int set_aside(bp_run *run, const bp_family *family, double t, int rejected_last, int status)
{
    run->elapsed = t;
    run->rejected_last = rejected_last;
    run->family = *family;
    return status;
}

/* Write the outputs within the accepted step from time *t, and go to its end, unless the run pauses with it. */
static int take_step(bp_run *run, bp_family *family, double start, double end, double *time, int changeable)
{
    ballpass_result *result = run->result;
    const bp_taken *taken = &run->taken;
    const double t = *time, h = taken->h, length = end - start;
    const int prepared = write_outputs(run, start, t, h, taken->last ? end : start + (t + h));
    run->waiting = run->options->pause && result->written >= run->outputs;
    if (run->waiting) {
        result->step = run->step;
        return BALLPASS_PAUSED;
    }
    const int reduced = reduce_step(run, start, t, h, taken->met == CUT, prepared);
    keep_step(run, start, t, h, taken->last ? end : start + (t + h), taken->met == CUT, reduced);
    /* a step that was cut, or has its own pace, does not show which family suits */
    const int chosen = changeable && taken->met == NO_KINK && !is_paced(run) ? judge_family(run, family, t, h) : run->method;
    tangent_accept(run);
    memcpy(run->x, run->next, sizeof run->next);
    if (taken->met == CUT) {
        if (taken->factor < 1.0) run->step = taken->tried * taken->factor;
    } else if (!taken->last || taken->factor < 1.0) {
        run->step = stretched(run, start, t, h, taken->factor, 1);
    }
    if (taken->met == NO_KINK) remember_touch(run, h, taken->factor);
    const double reached = *time = taken->last ? length : t + h;
    if (taken->met == CUT) {
        tangent_switch(run, reached);
        tangent_onset(run, reached, 1);
        turn_sides(run, start + reached, taken->tried);
    }
    sides_move_on(run);
    if (taken->met == CUT) sides_jump(run, reached);
    if (has_stalled(run)) {
        result->time = start + reached;
        return BALLPASS_STALLED;
    }
    if (chosen != run->method) {
        run->method = chosen;
        result->switches++;
        sides_of_method(run);
        if (is_explicit(chosen)) {
            if (run->step > family->stable) run->step = family->stable;
            first_slope(run, reached);
            tangent_start(run, reached);
        } else {
            linearize(run, reached, 1);
        }
    } else if (taken->met == CUT && is_explicit(run->method)) {
        first_slope(run, reached);
        tangent_start(run, reached);
    } else if (is_explicit(run->method)) {
        next_slope(run, reached);
        if (stands_at_end(run)) tangent_start(run, reached);
    } else if (reached < length) {
        linearize(run, reached, 0);
    }
    return BALLPASS_DONE;
}

/* Integrate one segment from `start` to `end`; its clock starts at zero.  `resumed`: it continues where another call ended. */
static int run_segment(bp_run *run, double start, double end, int restart, int changeable, int resumed)
{
    ballpass_result *result = run->result;
    const ballpass_options *options = run->options;
    const double length = end - start;
    /* of time within the segment; at t = 0 the sum start + t would take steps down to the smallest of all numbers */
    const double resolution = DBL_EPSILON * (fabs(start) > fabs(end) ? fabs(start) : fabs(end));
    if (!(length > 0.0)) return BALLPASS_DONE;
    if (!resumed) begin_segment(run, start, length, resolution, restart, changeable);
    double t = run->elapsed;
    int rejected_last = run->rejected_last;
    bp_family family = run->family;
    if (resumed && run->waiting) {
        const int ended = take_step(run, &family, start, end, &t, changeable);
        if (ended != BALLPASS_DONE) return set_aside(run, &family, t, 0, ended);
        result->time = start + t;
    }
    while (t < length) {
        double h = run->step < options->largest_step ? run->step : options->largest_step;
        const double left = length - t;
        int last = 0;
        if (h * 1.0001 >= left) {
            h = left;
            last = 1;
        } else if (2.0 * h > left) {
            h = 0.5 * left; /* two even steps rather than a full and a tiny one */
        }
        const double longest = left < options->largest_step ? left : options->largest_step;
        const int aimed = aim(run, t, longest, resolution, &h);
        if (aimed) last = 0;
        if (result->steps + result->rejected >= options->max_steps) {
            result->step = h;
            return set_aside(run, &family, t, rejected_last, BALLPASS_TOO_MANY_STEPS);
        }
        if (!last && run->step <= resolution) {
            /* accepted steps may shrink as well: they would no longer move the time */
            result->step = run->step;
            result->state = worst_state(run);
            return BALLPASS_STEP_TOO_SMALL;
        }
        set_pace(run, start, t, h);
        double error = try_step(run, t, h);
        const double tried = h;
        const int met = error >= 0.0 && error <= 1.0 && within_reach(run)
                            ? locate(run, start, t, &h, &error, resolution, aimed, longest)
                            : NO_KINK;
        if (met == AT_ONCE) {
            tangent_switch(run, t);
            tangent_onset(run, t, 0);
            turn_sides(run, start + t, tried);
            sides_jump(run, t);
            if (is_explicit(run->method)) first_slope(run, t);
            else linearize(run, t, 1);
            tangent_start(run, t);
            continue;
        }
        int by_derivatives = 0;
        if (error >= 0.0 && error <= 1.0 && within_reach(run)) {
            const double theirs = tangent_step(run, t, h, error, met);
            /* a step that was cut short is shorter than one that both errors allowed */
            by_derivatives = (met == NO_KINK || h >= tried) && !(theirs <= 1.0);
            if (met == NO_KINK || by_derivatives) error = theirs;
            if (by_derivatives) keep_sides(run);
        }
        if (h != tried) last = 0;
        const double accepted = error >= 0.0 && error <= 1.0 && within_reach(run);
        const double factor = bp_step_factor(bp_methods[run->method].error_exponent, error, accepted, rejected_last, &run->last_error);
        if (accepted != 0.0) {
            result->steps++;
            rejected_last = 0;
            run->taken = (bp_taken){h, tried, factor, met, last};
            const int ended = take_step(run, &family, start, end, &t, changeable);
            if (ended != BALLPASS_DONE) return set_aside(run, &family, t, 0, ended);
        } else {
            const int finite = error >= 0.0 && error <= DBL_MAX && is_finite(run->next);
            result->rejected++;
            rejected_last = 1;
            run->step = stretched(run, start, t, h, factor, 0);
            if (by_derivatives) foresee_by_rate(run, t, h, &run->step);
            else if (finite) foresee(run, t, h, &run->step);
            if (run->step < options->smallest_step || run->step <= resolution) {
                result->step = run->step;
                result->state = worst_state(run);
                result->time = start + t;
                return finite ? BALLPASS_STEP_TOO_SMALL : BALLPASS_NOT_FINITE;
            }
        }
        result->time = start + t;
    }
    result->time = end;
    return BALLPASS_DONE;
}

/* Integrate over the segments from `first` on. */
static int run_segments(bp_run *run, double *x, long first, long segments, const double *times, const double *inputs,
                        const unsigned char *restarts, int resumed)
{
    ballpass_result *result = run->result;
    const ballpass_options *options = run->options;
    for (long i = first; i < segments; i++) {
        result->segment = i;
        segment_inputs(run, inputs + i * BP_NU);
        result->status = run_segment(run, times[i], times[i + 1], restarts[i], options->method == BALLPASS_AUTO, resumed && i == first);
        if (result->status != BALLPASS_DONE) break;
#ifdef BALLPASS_SENSITIVITIES
        if (run->tangents) bp_explicit_rate(&run->numbers, times[i + 1] - times[i], x, run->rate_before);
#else
        (void)x;
#endif
    }
    if (segments > first) tangent_end(run, result->time - times[result->segment]);
    result->method = run->method;
    const int goes_on = result->status == BALLPASS_TOO_MANY_STEPS || result->status == BALLPASS_PAUSED;
    if (goes_on && options->work != NULL) memcpy(options->work, run, sizeof *run);
    return result->status;
}

/* Whether output times follow each other from `begin` to `end`, and are numbers: one that does not would not be reached. */
static int are_within(const double *times, long count, double begin, double end)
{
    if (count <= 0) return count == 0;
    int follow = times[0] >= begin && times[count - 1] <= end;
    for (long k = 1; k < count; k++) follow &= times[k] >= times[k - 1];
    return follow;
}

static int run_all(bp_run *run, const ballpass_options *options, const double *p, const double *c, double *x, long segments,
                   const double *times, const double *inputs, const unsigned char *restarts, long outputs, const double *output_times,
                   double *output_states, ballpass_result *result)
{
    if (options->resume) memcpy(run, options->work, sizeof *run);
    run->options = options;
    run->result = result;
    run->x = x;
    run->outputs = outputs;
    run->output_times = output_times;
    run->output_states = output_states;
    run->numbers.p = p;
    run->numbers.c = c;
    if (options->resume) {
        sides_here(run);
        result->step = 0.0;
        return run_segments(run, x, result->segment, segments, times, inputs, restarts, 1);
    }
    memset(result, 0, sizeof *result);
    result->state = -1;
    result->time = segments > 0 ? times[0] : 0.0;
    run->step = 0.0;
    run->last_error = BP_LOG_SMALL_ERROR;
    run->seen = (bp_seen){.least = INFINITY};
    run->method = options->method;
    if (options->method < BALLPASS_AUTO || options->method >= BP_METHODS) return result->status = BALLPASS_BAD_ARGUMENT;
    if (!bp_are_limits(options->first_step, options->smallest_step, options->largest_step)) return result->status = BALLPASS_BAD_ARGUMENT;
    for (int k = 0; k < BP_NX; k++) {
        run->weight[k] = 1.0 / options->tolerance[k];
        /* zero, below it, not a number, or so small that its inverse is none */
        if (!(options->tolerance[k] > 0.0 && run->weight[k] <= DBL_MAX)) return result->status = BALLPASS_BAD_ARGUMENT;
    }
    for (long i = 1; i <= segments; i++)
        if (!(times[i] >= times[i - 1])) return result->status = BALLPASS_BAD_ARGUMENT;
    if (segments < 0 || !are_within(output_times, outputs, result->time, segments > 0 ? times[segments] : result->time))
        return result->status = BALLPASS_BAD_ARGUMENT;
    if (!is_finite(x)) return result->status = BALLPASS_NOT_FINITE;
    while (result->written < outputs && output_times[result->written] <= result->time) {
        if (output_states) memcpy(output_states + result->written * BP_NX, x, BP_NX * sizeof *x);
#ifdef BALLPASS_SENSITIVITIES
        if (run->tangents && run->tangents->outputs) {
            const long size = run->tangents->blocks * (BP_NX * BP_LANES);
            memcpy(run->tangents->outputs + result->written * size, run->tangents->x, (size_t)size * sizeof *x);
        }
#endif
        result->written++;
    }
    return run_segments(run, x, 0, segments, times, inputs, restarts, 0);
}

int ballpass_run(const ballpass_options *options, const double *p, const double *c, double *x, long segments, const double *times,
                const double *inputs, const unsigned char *restarts, long outputs, const double *output_times, double *output_states,
                ballpass_result *result)
{
    bp_run run;
#ifdef BALLPASS_SENSITIVITIES
    run.tangents = NULL;
#endif
    return run_all(&run, options, p, c, x, segments, times, inputs, restarts, outputs, output_times, output_states, result);
}

void ballpass_states_at(const double *kept, long steps, long outputs, const double *output_times, double *output_states)
{
    const bp_kept *step = (const bp_kept *)kept, *last = step + steps - 1, *read = NULL;
    bp_run run;
    double x[BP_NX];
    run.x = x;
    for (long i = 0; i < outputs; i++) {
        while (step < last && output_times[i] > step->end) step++;
        if (read != step) {
            read = step;
            run.method = (int)step->method;
            set_lead(&run, step->lead);
            memcpy(x, step->x, sizeof x);
            memcpy(run.next, step->next, sizeof run.next);
            memcpy(run.dense, step->dense, sizeof run.dense);
        }
        const double theta = ((output_times[i] - step->start) - step->t) / step->h;
        double *y = output_states + i * BP_NX;
        if (theta >= 1.0) memcpy(y, run.next, sizeof run.next);
        else state_at(&run, theta > 0.0 ? theta : 0.0, y);
    }
}

#ifdef BALLPASS_SENSITIVITIES
int ballpass_run_tangents(const ballpass_options *options, const double *p, const double *c, double *x, long segments, const double *times,
                         const double *inputs, const unsigned char *restarts, long outputs, const double *output_times,
                         double *output_states, const ballpass_tangents *tangents, ballpass_result *result)
{
    bp_run run;
    if (options->work != NULL || options->resume) return result->status = BALLPASS_BAD_ARGUMENT;
    run.tangents = tangents;
    run.blocks = (bp_tangent_block *)tangents->work;
    return run_all(&run, options, p, c, x, segments, times, inputs, restarts, outputs, output_times, output_states, result);
}

long ballpass_tangent_work(long blocks) { return blocks * (long)sizeof(bp_tangent_block); }
#endif

void ballpass_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *inputs, double horizon,
                        double *magnitude)
{
    bp_magnitudes(p, c, initial, moments, inputs, horizon, magnitude);
}

void ballpass_sizes(int *sizes)
{
    sizes[5] = BP_LANES;
    sizes[0] = BP_NX;
    sizes[1] = BP_NU;
    sizes[2] = BP_NP;
    sizes[3] = BP_NC;
    sizes[4] = BP_NB;
    sizes[6] = (int)sizeof(bp_run);
    sizes[7] = (int)(sizeof(bp_kept) / sizeof(double));
    sizes[8] = (int)sizeof(ballpass_options);
    sizes[9] = (int)sizeof(ballpass_result);
    sizes[10] = (int)sizeof(ballpass_tangents);
}
