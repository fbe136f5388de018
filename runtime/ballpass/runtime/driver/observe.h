/* Results that a run gives while it integrates: states at output times, ends of steps, and reductions (reductions.h). */
#ifndef BALLPASS_OBSERVE_H
#define BALLPASS_OBSERVE_H

#include "differentiate.h"
#include "run.h"

/* Outputs up to `end`, that of the accepted step from (t, x) to (t + h, next); t counts from the segment's start.  The caller gives the
   end, for start + (t + h) may fall short of the segment's by rounding, and its output would then be lost.  Returns whether the step's dense
   output is prepared. */
static int write_outputs(bp_run *run, double start, double t, double h, double end)
{
    ballpass_result *result = run->result;
    if (result->written >= run->outputs) return 0;
    if (run->output_times[result->written] > end) return 0;
    int prepared = 0, tangents_prepared = 0;
    while (result->written < run->outputs && run->output_times[result->written] <= end) {
        const double theta = ((run->output_times[result->written] - start) - t) / h;
        double at[BP_NX], *y = run->output_states ? run->output_states + result->written * BP_NX : at;
        if (theta >= 1.0) {
            memcpy(y, run->next, sizeof run->next);
        } else {
            if (!prepared) prepare_dense(run, t, h);
            prepared = 1;
            state_at(run, theta > 0.0 ? theta : 0.0, y);
        }
        /* after the state: the derivatives use its slopes */
        tangent_output(run, t, h, theta > 0.0 ? theta : 0.0, y, tangents_prepared);
        tangents_prepared = tangents_prepared || theta < 1.0;
        result->written++;
    }
    return prepared;
}

/* A step that is kept: its end [s]; 1 where that lies on a kink, else 0; its method and dense output. */
typedef struct {
    double end, on_kink, start, t, h, lead, method, x[BP_NX], next[BP_NX], dense[BP_DENSE_ROWS][BP_NX];
} bp_kept;

/* Keep the accepted step from (t, x) to (t + h, next), which ends at `end`; t counts from the segment's start. */
static void keep_step(bp_run *run, double start, double t, double h, double end, int on_kink, int prepared)
{
    const ballpass_options *options = run->options;
    if (options->kept == NULL) return;
    if (!prepared) prepare_dense(run, t, h);
    const double *lead = lead_of(run);
    bp_kept *step = (bp_kept *)options->kept + (*options->keeps)++;
    *step = (bp_kept){.end = end, .on_kink = on_kink, .start = start, .t = t, .h = h, .lead = 1.0, .method = run->method};
    if (lead) step->lead = *lead;
    memcpy(step->x, run->x, sizeof step->x);
    memcpy(step->next, run->next, sizeof step->next);
    memcpy(step->dense, run->dense, sizeof step->dense);
}

#ifdef BALLPASS_REDUCTIONS
/* An accepted step, for the reductions: its dense output is ready.  They use its part from `from` over `span` of it. */
typedef struct {
    const bp_run *run;
    double t, h, from, span;
} bp_step_taken;

/* Place in a step that is beside a kink at its end, as a part of it. */
static const double BP_BESIDE = 1e-6;

static double state_of_step(const void *source, double theta, double *x)
{
    const bp_step_taken *step = source;
    const double place = step->from + step->span * theta;
    if (place < 1.0) state_at(step->run, place, x);
    else memcpy(x, step->run->next, sizeof step->run->next);
    return step->t + place * step->h;
}

#ifdef BALLPASS_LOCATED
/* Lead of a part of a step. */
static double lead_between(const bp_run *run, double from, double to)
{
    const double first = bp_pace(run->lead, place_of(run, from)), last = bp_pace(run->lead, place_of(run, to));
    return is_paced(run) ? 2.0 * first / (first + last) : 1.0;
}
#else
#define lead_between(run, from, to) 1.0
#endif

static void reduce_start(bp_run *run, double start)
{
    run->reduction = run->options->reduction;
    if (run->reduction != NULL && start < run->reduction[BP_FROM]) run->reduction = run->options->before;
    if (run->reduction == NULL) return;
    run->behind_kink = 0;
    run->reduces_balls = bp_wanted(run->reduction, BP_NX) > 0.0;
    run->reduces_passes = bp_wanted(run->reduction, BP_LOOKED_AT) > 0.0;
    bp_channels(&run->numbers, 0.0, run->x, run->reduces_balls, run->sampled[0], run->balls[0]);
}

/* The balls at an end of the part of a step, which lies on a kink: those within the step, for the other side of a jump is not its own. */
static void reduce_beside(bp_run *run, const bp_step_taken *step, int point)
{
    double y[BP_NX], beside[BP_CHANNELS];
    const double time = state_of_step(step, point ? 1.0 - BP_BESIDE : BP_BESIDE, y);
    bp_channels(&run->numbers, time, y, 1, beside, run->balls[point]);
    memcpy(run->sampled[point] + BP_NX, beside + BP_NX, (BP_CHANNELS - BP_NX) * sizeof *beside);
}

/* The step ends on a kink where it was `cut`.  Returns whether the step's dense output is prepared. */
static int reduce_step(bp_run *run, double start, double t, double h, int cut, int prepared)
{
    if (run->reduction == NULL) return prepared;
    if (!prepared) prepare_dense(run, t, h);
    const int parts = bp_parts(bp_methods[run->method].dense_degree);
    for (int part = 0; part < parts; part++) {
        const bp_step_taken step = {run, t, h, (double)part / parts, 1.0 / parts};
        for (int i = 1; i < BP_POINTS; i++) {
            double y[BP_NX];
            const double time = state_of_step(&step, (double)i / (BP_POINTS - 1), y);
            bp_channels(&run->numbers, time, y, run->reduces_balls, run->sampled[i], run->balls[i]);
        }
        if (run->reduces_balls && run->behind_kink && part == 0) reduce_beside(run, &step, 0);
        if (run->reduces_balls && cut && part == parts - 1) reduce_beside(run, &step, BP_POINTS - 1);
        const double(*balls)[BP_BALL_QUANTITIES] = (const double(*)[BP_BALL_QUANTITIES])run->balls;
        const bp_within within = {start + t + step.from * h, step.span * h, lead_between(run, step.from, step.from + step.span), &run->numbers, state_of_step, &step, balls};
        bp_reduce(run->reduction, run->reduces_passes, (const double(*)[BP_CHANNELS])run->sampled, &within);
        memcpy(run->balls[0], run->balls[BP_POINTS - 1], sizeof run->balls[0]);
        memcpy(run->sampled[0], run->sampled[BP_POINTS - 1], sizeof run->sampled[0]);
    }
    run->behind_kink = cut;
    return 1;
}
#else
#define reduce_start(run, start) ((void)(start))
#define reduce_step(run, start, t, h, cut, prepared) (prepared)
#endif

#endif
