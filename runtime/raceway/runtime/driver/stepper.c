/* The loop around the methods: segments, step sizes, dense output, choice of method, status.  See stepper.h. */
#include "stepper.h"

#include <float.h>
#include <string.h>

#include "control.h"
#include "explicit.h"
#include "rosenbrock.h"
#include "scales.h"
#ifdef RACEWAY_SENSITIVITIES
#include "sensitivity.h"
#endif
#ifdef RACEWAY_REDUCTIONS
#include "reductions.h"
#endif

typedef struct {
    const raceway_options *options;
    raceway_result *result;
    rw_numbers numbers;
    double weight[RW_NX]; /* 1 / tolerance */
    double *x;
    double next[RW_NX];
    double step;           /* proposal for the next step; 0 where it has to be estimated */
    double fastest, slowest; /* rates seen by the linearly implicit methods [1/s] */
    double last_error;     /* logarithm of that of the last accepted step, for the PI controller */
    int method;
    long outputs;
    const double *output_times;
    double *output_states;
    /* work of the methods */
    rw_rosenbrock linear;
    rw_matrix matrix;
    rw_explicit plain;
    double dense[RW_DENSE_ROWS][RW_NX];
#ifdef RACEWAY_SENSITIVITIES
    const raceway_tangents *tangents; /* or NULL */
    rw_tangent_block *blocks;
    double rate_before[RW_NX]; /* at the end of the segment before */
#endif
#ifdef RACEWAY_REDUCTIONS
    double *reduction; /* or NULL where nothing is reduced in the present segment */
    double sampled[RW_POINTS][RW_CHANNELS];
#endif
} rw_run;

static int is_explicit(int method) { return method == RACEWAY_DP54 || method == RACEWAY_DOP853; }

static int is_finite(const double *x)
{
    for (int k = 0; k < RW_NX; k++)
        if (!(fabs(x[k]) <= DBL_MAX)) return 0;
    return 1;
}

/* Whether the tolerance is above the rounding of the states reached.  A motion that grows without bound ends where it is not: error
   control would follow it with ever smaller steps for hours. */
static int within_reach(const rw_run *run)
{
    for (int k = 0; k < RW_NX; k++)
        if (!(fabs(run->next[k]) * run->weight[k] <= 1.0 / DBL_EPSILON)) return 0;
    return 1;
}

static double error_exponent(int method)
{
    switch (method) {
    case RACEWAY_RODAS4: return rw_rodas4.error_exponent;
    case RACEWAY_RODAS5P: return rw_rodas5p.error_exponent;
    case RACEWAY_DP54: return rw_dp54.error_exponent;
    default: return rw_dop853.error_exponent;
    }
}

static double estimate_step(rw_run *run, double t, double longest)
{
    run->result->evaluations += 2;
    return rw_first_step(&run->numbers, t, run->x, longest, run->weight, error_exponent(run->method));
}

/* The family for the coming segment. */
static int choose_method(rw_run *run, double t)
{
    rw_rosenbrock_start(&run->linear, &run->numbers, t, run->x, 1);
    run->result->evaluations++;
    return rw_is_stiff(run->linear.A, run->linear.B) ? RACEWAY_RODAS5P : RACEWAY_DP54;
}

#ifdef RACEWAY_SENSITIVITIES
static void tangent_start(rw_run *run, double t)
{
    if (run->tangents && is_explicit(run->method))
        rw_explicit_tangent_start(run->tangents, run->blocks, &run->numbers, run->result->segment, t, run->x);
}

/* Differentiate the step tried; returns its error, with that of the derivatives where they are controlled. */
static double tangent_step(rw_run *run, double t, double h, double error)
{
    const raceway_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents) return error;
    switch (run->method) {
    case RACEWAY_DP54:
        rw_explicit_tangent_step(&rw_dp54, RW_DP54_STAGES, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h,
                                 run->next);
        break;
    case RACEWAY_DOP853:
        rw_explicit_tangent_step(&rw_dop853, RW_DOP853_STAGES, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h,
                                 run->next);
        break;
    case RACEWAY_RODAS4:
        rw_rosenbrock_tangent_step(&rw_rodas4, RW_RODAS4_STAGES, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers, segment,
                                   t, run->x, h);
        break;
    default:
        rw_rosenbrock_tangent_step(&rw_rodas5p, RW_RODAS5P_STAGES, tangents, run->blocks, &run->linear, &run->matrix, &run->numbers,
                                   segment, t, run->x, h);
    }
    if (!tangents->weight) return error;
    double theirs;
    if (is_explicit(run->method)) {
        const rw_explicit_method *method = run->method == RACEWAY_DP54 ? &rw_dp54 : &rw_dop853;
        const double *weights[2] = {method->error[0], method->error[1]};
        theirs = rw_tangent_error(tangents, run->blocks, weights, method->estimates, method->error_share, method->stages + 1, h);
    } else {
        const rw_rosenbrock_method *method = run->method == RACEWAY_RODAS4 ? &rw_rodas4 : &rw_rodas5p;
        const double *weights[1] = {method->error_weights}, none[1] = {0.0};
        theirs = rw_tangent_error(tangents, run->blocks, weights, 1, none, method->stages, 1.0);
    }
    return theirs <= error ? error : theirs;
}

/* Take over the derivatives of an accepted step. */
static void tangent_accept(rw_run *run)
{
    if (!run->tangents) return;
    const int end = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
    for (long b = 0; b < run->tangents->blocks; b++) {
        memcpy(rw_tangent_state(run->tangents, b), run->blocks[b].next, sizeof run->blocks[b].next);
        if (is_explicit(run->method)) memcpy(run->blocks[b].k[0], run->blocks[b].k[end], sizeof run->blocks[b].k[0]);
    }
}

static void tangent_output(rw_run *run, double t, double h, double theta, int prepared)
{
    const raceway_tangents *tangents = run->tangents;
    if (!tangents || !tangents->outputs) return;
    double *out = tangents->outputs + run->result->written * tangents->blocks * (RW_NX * RW_LANES);
    if (theta >= 1.0) {
        for (long b = 0; b < tangents->blocks; b++)
            memcpy(out + b * (RW_NX * RW_LANES), run->blocks[b].next, sizeof run->blocks[b].next);
        return;
    }
    const long segment = run->result->segment;
    if (!prepared) {
        if (run->method == RACEWAY_DP54)
            rw_explicit_tangent_dense(&rw_dp54, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h);
        else if (run->method == RACEWAY_DOP853)
            rw_explicit_tangent_dense(&rw_dop853, tangents, run->blocks, &run->plain, &run->numbers, segment, t, run->x, h);
        else
            rw_rosenbrock_tangent_dense(run->method == RACEWAY_RODAS4 ? &rw_rodas4 : &rw_rodas5p, tangents, run->blocks);
    }
    if (run->method == RACEWAY_DP54) rw_explicit_tangent_at(&rw_dp54, tangents, run->blocks, theta, out);
    else if (run->method == RACEWAY_DOP853) rw_explicit_tangent_at(&rw_dop853, tangents, run->blocks, theta, out);
    else rw_rosenbrock_tangent_at(run->method == RACEWAY_RODAS4 ? &rw_rodas4 : &rw_rodas5p, tangents, run->blocks, theta, out);
}

/* Where a load switches at a time that moves with a parameter, the derivative at fixed time jumps. */
static void tangent_jump(rw_run *run)
{
    const raceway_tangents *tangents = run->tangents;
    const long segment = run->result->segment;
    if (!tangents || segment == 0) return;
    double behind[RW_NX];
    rw_explicit_rate(&run->numbers, 0.0, run->x, behind);
    for (long b = 0; b < tangents->blocks; b++) {
        const double *shift = tangents->shift + (segment * tangents->blocks + b) * RW_LANES;
        double *xd = rw_tangent_state(tangents, b);
        for (int k = 0; k < RW_NX; k++)
            for (int l = 0; l < RW_LANES; l++) xd[k * RW_LANES + l] += (run->rate_before[k] - behind[k]) * shift[l];
    }
}
#else
#define tangent_start(run, t) ((void)0)
#define tangent_step(run, t, h, error) (error)
#define tangent_accept(run) ((void)0)
#define tangent_output(run, t, h, theta, prepared) ((void)(prepared))
#define tangent_jump(run) ((void)0)
#endif

/* Outputs up to `end`, that of the accepted step from (t, x) to (t + h, next); t counts from the segment's start.  The caller gives the
   end, for start + (t + h) may fall short of the segment's by rounding, and its output would then be lost. */
static void write_outputs(rw_run *run, double start, double t, double h, double end)
{
    raceway_result *result = run->result;
    if (result->written >= run->outputs) return;
    if (run->output_times[result->written] > end) return;
    int prepared = 0, tangents_prepared = 0;
    while (result->written < run->outputs && run->output_times[result->written] <= end) {
        const double theta = ((run->output_times[result->written] - start) - t) / h;
        double at[RW_NX], *y = run->output_states ? run->output_states + result->written * RW_NX : at;
        if (theta >= 1.0) {
            memcpy(y, run->next, sizeof run->next);
        } else {
            if (!prepared) {
                if (run->method == RACEWAY_DP54) rw_explicit_dense(&rw_dp54, &run->plain, &run->numbers, t, run->x, h, run->next, run->dense);
                else if (run->method == RACEWAY_DOP853) rw_explicit_dense(&rw_dop853, &run->plain, &run->numbers, t, run->x, h, run->next, run->dense);
                else if (run->method == RACEWAY_RODAS4) rw_rosenbrock_dense(&rw_rodas4, &run->linear, run->dense);
                else rw_rosenbrock_dense(&rw_rodas5p, &run->linear, run->dense);
                prepared = 1;
            }
            const double(*dense)[RW_NX] = (const double(*)[RW_NX])run->dense;
            const double place = theta > 0.0 ? theta : 0.0;
            if (run->method == RACEWAY_DP54) rw_explicit_at(&rw_dp54, dense, run->x, run->next, place, y);
            else if (run->method == RACEWAY_DOP853) rw_explicit_at(&rw_dop853, dense, run->x, run->next, place, y);
            else if (run->method == RACEWAY_RODAS4) rw_rosenbrock_at(&rw_rodas4, dense, run->x, run->next, place, y);
            else rw_rosenbrock_at(&rw_rodas5p, dense, run->x, run->next, place, y);
        }
        /* behind the state: the derivatives use its slopes */
        tangent_output(run, t, h, theta > 0.0 ? theta : 0.0, tangents_prepared);
        tangents_prepared = tangents_prepared || theta < 1.0;
        result->written++;
    }
}

#ifdef RACEWAY_REDUCTIONS
/* An accepted step, for the reductions: its dense output is ready.  They look at its part from `from` over `span` of it. */
typedef struct {
    const rw_run *run;
    double t, h, from, span;
} rw_step_taken;

static void state_at(const rw_run *run, double theta, double *y)
{
    const double(*dense)[RW_NX] = (const double(*)[RW_NX])run->dense;
    if (run->method == RACEWAY_DP54) rw_explicit_at(&rw_dp54, dense, run->x, run->next, theta, y);
    else if (run->method == RACEWAY_DOP853) rw_explicit_at(&rw_dop853, dense, run->x, run->next, theta, y);
    else if (run->method == RACEWAY_RODAS4) rw_rosenbrock_at(&rw_rodas4, dense, run->x, run->next, theta, y);
    else rw_rosenbrock_at(&rw_rodas5p, dense, run->x, run->next, theta, y);
}

static double channel_at(const void *source, int channel, double theta, int *ball)
{
    const rw_step_taken *step = source;
    double y[RW_NX];
    const double place = step->from + step->span * theta;
    state_at(step->run, place, y);
    return rw_channel(&step->run->numbers, step->t + place * step->h, y, channel, ball);
}

static void reduce_start(rw_run *run, double start)
{
    run->reduction = run->options->reduction;
    if (run->reduction == NULL || start < run->reduction[RW_FROM]) run->reduction = NULL;
    else rw_channels(&run->numbers, 0.0, run->x, rw_balls_wanted(run->reduction), run->sampled[0]);
}

static void reduce_step(rw_run *run, double start, double t, double h)
{
    if (run->reduction == NULL) return;
    if (run->method == RACEWAY_DP54) rw_explicit_dense(&rw_dp54, &run->plain, &run->numbers, t, run->x, h, run->next, run->dense);
    else if (run->method == RACEWAY_DOP853) rw_explicit_dense(&rw_dop853, &run->plain, &run->numbers, t, run->x, h, run->next, run->dense);
    else if (run->method == RACEWAY_RODAS4) rw_rosenbrock_dense(&rw_rodas4, &run->linear, run->dense);
    else rw_rosenbrock_dense(&rw_rodas5p, &run->linear, run->dense);
    /* the output of DOP853 is of degree seven, more than five points tell: its steps are taken in halves */
    const int parts = run->method == RACEWAY_DOP853 ? 2 : 1;
    for (int part = 0; part < parts; part++) {
        const rw_step_taken step = {run, t, h, (double)part / parts, 1.0 / parts};
        for (int i = 1; i < RW_POINTS; i++) {
            const double theta = step.from + step.span * i / (RW_POINTS - 1);
            double y[RW_NX];
            if (theta < 1.0) state_at(run, theta, y);
            else memcpy(y, run->next, sizeof y);
            rw_channels(&run->numbers, t + theta * h, y, rw_balls_wanted(run->reduction), run->sampled[i]);
        }
        rw_reduce(run->reduction, (const double(*)[RW_CHANNELS])run->sampled, start + t + step.from * h, step.span * h, channel_at, &step);
        memcpy(run->sampled[0], run->sampled[RW_POINTS - 1], sizeof run->sampled[0]);
    }
}
#else
#define reduce_start(run, start) ((void)0)
#define reduce_step(run, start, t, h) ((void)0)
#endif

/* Try one step; returns its scaled error. */
static double try_step(rw_run *run, double t, double h)
{
    raceway_result *result = run->result;
    switch (run->method) {
    case RACEWAY_DP54:
        result->evaluations += rw_dp54.stages;
        return rw_explicit_step(&rw_dp54, RW_DP54_STAGES, &run->plain, &run->numbers, t, run->x, h, run->weight, run->next);
    case RACEWAY_DOP853:
        result->evaluations += rw_dop853.stages;
        return rw_explicit_step(&rw_dop853, RW_DOP853_STAGES, &run->plain, &run->numbers, t, run->x, h, run->weight, run->next);
    case RACEWAY_RODAS4: {
        result->evaluations += rw_rodas4.stages - 1;
        const double error = rw_rosenbrock_step(&rw_rodas4, RW_RODAS4_STAGES, &run->linear, &run->matrix, &run->numbers, t, run->x, h,
                                                run->weight, run->next);
        result->factorizations++;
        result->pivoted += run->matrix.pivoted;
        return error;
    }
    default: {
        result->evaluations += rw_rodas5p.stages - 1;
        const double error = rw_rosenbrock_step(&rw_rodas5p, RW_RODAS5P_STAGES, &run->linear, &run->matrix, &run->numbers, t, run->x, h,
                                                run->weight, run->next);
        result->factorizations++;
        result->pivoted += run->matrix.pivoted;
        return error;
    }
    }
}

/* The state whose scaled value is worst, or the first that is none. */
static int worst_state(const rw_run *run)
{
    int worst = 0;
    double largest = -1.0;
    for (int k = 0; k < RW_NX; k++) {
        if (!(fabs(run->next[k]) <= DBL_MAX)) return k;
        const double change = fabs(run->next[k] - run->x[k]) * run->weight[k];
        if (change > largest) {
            largest = change;
            worst = k;
        }
    }
    return worst;
}

static void first_slope(rw_run *run, double t)
{
    rw_explicit_rate(&run->numbers, t, run->x, run->plain.k[0]);
    run->result->evaluations++;
}

static void linearize(rw_run *run, double t, int fresh)
{
    rw_rosenbrock_start(&run->linear, &run->numbers, t, run->x, fresh);
    run->result->evaluations++;
}

/* What a segment has shown about the families so far. */
typedef struct {
    double sum;    /* of the reach of the steps looked at */
    double stable; /* step at which an explicit method is at its limit, where the last look was at a linearly implicit one [s] */
    int looks, stiff, changes;
    long steps;
} rw_family;

/* The family for the next step, from the accepted one.  The reach of a step is its size times the fastest rate. */
static int judge_family(rw_run *run, rw_family *family, double h)
{
    const int explicitly = is_explicit(run->method), looking = family->stiff > 0 || family->steps++ % RW_STIFF_LOOK == 0;
    if (!looking) return run->method;
    if (explicitly) {
        const int dp54 = run->method == RACEWAY_DP54;
        const double limit = dp54 ? 3.25 : 6.1;
        const double reach = rw_explicit_stiffness(&run->plain, dp54 ? RW_DP54_STAGES : RW_DOP853_STAGES, h, run->next, run->weight);
        family->stiff = reach > limit ? family->stiff + 1 : 0;
        if (family->stiff >= RW_STIFF_STEPS) {
            *family = (rw_family){.changes = family->changes + 1};
            return RACEWAY_RODAS5P;
        }
        family->sum += reach < limit ? reach : limit;
    } else {
        /* the fastest of the run: balls that are off now come back.  Before rates have changed no ball has landed yet, and they say
           nothing; a ring that is always loaded has shown at the start what it is */
        const double rate = rw_fastest_rate(run->linear.A, run->linear.B);
        run->fastest = rate > run->fastest ? rate : run->fastest;
        run->slowest = rate < run->slowest ? rate : run->slowest;
        if (!(run->fastest > 2.0 * run->slowest)) return run->method;
        family->stable = RW_LIMITED / run->fastest;
        family->sum += h * run->fastest;
    }
    if (++family->looks < RW_FAMILY_LOOKS) return run->method;
    const double mean = family->sum / family->looks;
    family->sum = 0.0;
    family->looks = 0;
    if (family->changes >= RW_FAMILY_CHANGES || (explicitly ? !(mean > RW_LIMITED) : !(mean < RW_WORTH_SOLVING))) return run->method;
    family->changes++;
    family->stiff = 0;
    return explicitly ? RACEWAY_RODAS5P : RACEWAY_DP54;
}

/* Integrate one segment from `start` to `end`; its clock starts at zero. */
static int run_segment(rw_run *run, double start, double end, int restart, int changeable)
{
    raceway_result *result = run->result;
    const raceway_options *options = run->options;
    const double length = end - start;
    /* of time within the segment; at t = 0 the sum start + t would take steps down to the smallest of all numbers */
    const double resolution = DBL_EPSILON * (fabs(start) > fabs(end) ? fabs(start) : fabs(end));
    double t = 0.0;
    if (!(length > 0.0)) return RACEWAY_DONE;
    if (restart || run->step == 0.0) {
        if (changeable) {
            const int chosen = choose_method(run, t);
            result->switches += run->method != chosen && run->method != RACEWAY_AUTO;
            run->method = chosen;
        }
        const double estimate = options->first_step > 0.0 && run->step == 0.0 ? options->first_step : estimate_step(run, t, length);
        run->step = estimate;
        run->last_error = RW_LOG_SMALL_ERROR;
    }
    /* slopes that overflow give an estimate of zero, or none */
    if (!(run->step > 2.0 * resolution)) run->step = 2.0 * resolution;
    int rejected_last = 0;
    rw_family family = {0};
    reduce_start(run, start);
    tangent_jump(run);
    if (is_explicit(run->method)) first_slope(run, t);
    else linearize(run, t, 1);
    tangent_start(run, t);
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
        if (result->steps + result->rejected >= options->max_steps) {
            result->step = h;
            return RACEWAY_TOO_MANY_STEPS;
        }
        if (!last && run->step <= resolution) {
            /* accepted steps may shrink as well: they would no longer move the time */
            result->step = run->step;
            result->state = worst_state(run);
            return RACEWAY_STEP_TOO_SMALL;
        }
        double error = try_step(run, t, h);
        const double q = error_exponent(run->method);
        if (error >= 0.0 && error <= 1.0 && within_reach(run)) error = tangent_step(run, t, h, error);
        if (error >= 0.0 && error <= 1.0 && within_reach(run)) {
            /* PI controller (Hairer & Wanner II, section IV.2) */
            const double log_error = log(error > 1e-10 ? error : 1e-10);
            double factor = 0.9 * exp((0.4 * run->last_error - 0.7 * log_error) / q);
            factor = factor > 6.0 ? 6.0 : factor < 0.2 ? 0.2 : factor;
            if (rejected_last && factor > 1.0) factor = 1.0;
            run->last_error = log_error > RW_LOG_SMALL_ERROR ? log_error : RW_LOG_SMALL_ERROR;
            result->steps++;
            write_outputs(run, start, t, h, last ? end : start + (t + h));
            reduce_step(run, start, t, h);
            const int chosen = changeable ? judge_family(run, &family, h) : run->method;
            tangent_accept(run);
            memcpy(run->x, run->next, sizeof run->next);
            t = last ? length : t + h;
            if (!last || factor < 1.0) run->step = h * factor;
            rejected_last = 0;
            if (chosen != run->method) {
                run->method = chosen;
                result->switches++;
                if (is_explicit(chosen)) {
                    if (run->step > family.stable) run->step = family.stable;
                    first_slope(run, t);
                    tangent_start(run, t);
                } else {
                    linearize(run, t, 1);
                }
            } else if (is_explicit(run->method)) {
                const int stages = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
                memcpy(run->plain.k[0], run->plain.k[stages], sizeof run->plain.k[0]);
            } else if (t < length) {
                linearize(run, t, 0);
            }
        } else {
            const int finite = error >= 0.0 && error <= DBL_MAX && is_finite(run->next);
            double factor = finite && error > 1.0 ? 0.9 * pow(error, -1.0 / q) : 0.1;
            if (factor < 0.1) factor = 0.1;
            if (factor > 0.9) factor = 0.9;
            result->rejected++;
            rejected_last = 1;
            run->step = h * factor;
            if (run->step < options->smallest_step || run->step <= resolution) {
                result->step = run->step;
                result->state = worst_state(run);
                result->time = start + t;
                return finite ? RACEWAY_STEP_TOO_SMALL : RACEWAY_NOT_FINITE;
            }
        }
        result->time = start + t;
    }
    result->time = end;
    return RACEWAY_DONE;
}

static int run_all(rw_run *run, const raceway_options *options, const double *p, const double *c, double *x, long segments,
                   const double *times, const double *inputs, const unsigned char *restarts, long outputs, const double *output_times,
                   double *output_states, raceway_result *result)
{
    memset(result, 0, sizeof *result);
    result->state = -1;
    result->time = segments > 0 ? times[0] : 0.0;
    run->options = options;
    run->result = result;
    run->x = x;
    run->step = 0.0;
    run->last_error = RW_LOG_SMALL_ERROR;
    run->fastest = 0.0;
    run->slowest = INFINITY;
    run->method = options->method;
    run->outputs = outputs;
    run->output_times = output_times;
    run->output_states = output_states;
    run->numbers.p = p;
    run->numbers.c = c;
    const int changeable = options->method == RACEWAY_AUTO;
    if (options->method < RACEWAY_AUTO || options->method > RACEWAY_DOP853) return result->status = RACEWAY_BAD_ARGUMENT;
    for (int k = 0; k < RW_NX; k++) {
        run->weight[k] = 1.0 / options->tolerance[k];
        /* zero, below it, not a number, or so small that its inverse is none */
        if (!(options->tolerance[k] > 0.0 && run->weight[k] <= DBL_MAX)) return result->status = RACEWAY_BAD_ARGUMENT;
    }
    for (long i = 1; i <= segments; i++)
        if (!(times[i] >= times[i - 1])) return result->status = RACEWAY_BAD_ARGUMENT;
    if (!is_finite(x)) return result->status = RACEWAY_NOT_FINITE;
    while (result->written < outputs && output_times[result->written] <= result->time) {
        if (output_states) memcpy(output_states + result->written * RW_NX, x, RW_NX * sizeof *x);
#ifdef RACEWAY_SENSITIVITIES
        if (run->tangents && run->tangents->outputs) {
            const long size = run->tangents->blocks * (RW_NX * RW_LANES);
            memcpy(run->tangents->outputs + result->written * size, run->tangents->x, (size_t)size * sizeof *x);
        }
#endif
        result->written++;
    }
    for (long i = 0; i < segments; i++) {
        result->segment = i;
        run->numbers.u = inputs + i * RW_NU;
        result->status = run_segment(run, times[i], times[i + 1], restarts[i], changeable);
        if (result->status != RACEWAY_DONE) break;
#ifdef RACEWAY_SENSITIVITIES
        if (run->tangents) rw_explicit_rate(&run->numbers, times[i + 1] - times[i], x, run->rate_before);
#endif
    }
    result->method = run->method;
    return result->status;
}

int raceway_run(const raceway_options *options, const double *p, const double *c, double *x, long segments, const double *times,
                const double *inputs, const unsigned char *restarts, long outputs, const double *output_times, double *output_states,
                raceway_result *result)
{
    rw_run run;
#ifdef RACEWAY_SENSITIVITIES
    run.tangents = NULL;
#endif
    return run_all(&run, options, p, c, x, segments, times, inputs, restarts, outputs, output_times, output_states, result);
}

#ifdef RACEWAY_SENSITIVITIES
int raceway_run_tangents(const raceway_options *options, const double *p, const double *c, double *x, long segments, const double *times,
                         const double *inputs, const unsigned char *restarts, long outputs, const double *output_times,
                         double *output_states, const raceway_tangents *tangents, raceway_result *result)
{
    rw_run run;
    run.tangents = tangents;
    run.blocks = (rw_tangent_block *)tangents->work;
    return run_all(&run, options, p, c, x, segments, times, inputs, restarts, outputs, output_times, output_states, result);
}

long raceway_tangent_work(long blocks) { return blocks * (long)sizeof(rw_tangent_block); }
#endif

void raceway_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *inputs, double horizon,
                        double *magnitude)
{
    rw_magnitudes(p, c, initial, moments, inputs, horizon, magnitude);
}

void raceway_sizes(int *sizes)
{
    sizes[5] = RW_LANES;
    sizes[0] = RW_NX;
    sizes[1] = RW_NU;
    sizes[2] = RW_NP;
    sizes[3] = RW_NC;
    sizes[4] = RW_NB;
}
