/* The loop around the methods: segments, step sizes, dense output, choice of method, status.  See stepper.h. */
#include "stepper.h"

#include <float.h>
#include <string.h>

#include "control.h"
#include "explicit.h"
#include "family.h"
#include "rosenbrock.h"
#ifdef RACEWAY_LOCATED
#include "kinks.h"
#else
#include "scales.h"
#endif
#ifdef RACEWAY_SENSITIVITIES
#include "sensitivity.h"
#endif
#ifdef RACEWAY_REDUCTIONS
#include "reductions.h"
#endif

#ifdef RACEWAY_LOCATED
/* End of a contact ahead, as foreseen: time within the segment, not a number where there is none, and what ends. */
typedef struct {
    double time;
    int which, ball;
} rw_release;
#endif

typedef struct {
    const raceway_options *options;
    raceway_result *result;
    rw_numbers numbers;
    double weight[RW_NX]; /* 1 / tolerance */
    double *x;
    double next[RW_NX];
    double step;           /* proposal for the next step; 0 where it has to be estimated */
    rw_rates seen;
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
#ifdef RACEWAY_LOCATED
    rw_sides sides;
    double rate[RW_NX]; /* dx/dt where the step starts: its first slope where its pace is even */
    double lead;        /* of the step tried, 1 where its pace is even (pace.h) */
    double touch;
    double onset;       /* time of the branch point behind, minus infinity where there is none [s] */
    rw_release release; /* branch point ahead */
#endif
} rw_run;

#ifdef RACEWAY_LOCATED
static int is_paced(const rw_run *run) { return run->lead != 1.0; }
static const double *lead_of(const rw_run *run) { return &run->lead; }
static double place_of(const rw_run *run, double part) { return is_paced(run) ? rw_theta(run->lead, part) : part; }
#else
#define is_paced(run) 0
#define lead_of(run) NULL
#define place_of(run, part) (part)
#endif

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

/* Prepare the dense output of the step from (t, x) to (t + h, next). */
static void prepare_dense(rw_run *run, double t, double h)
{
    const rw_numbers *n = &run->numbers;
    switch (run->method) {
    case RACEWAY_DP54:
        if (is_paced(run)) rw_explicit_dense(&rw_dp54, &run->plain, n, t, run->x, h, lead_of(run), run->next, run->dense);
        else rw_explicit_dense(&rw_dp54, &run->plain, n, t, run->x, h, NULL, run->next, run->dense);
        break;
    case RACEWAY_DOP853:
        if (is_paced(run)) rw_explicit_dense(&rw_dop853, &run->plain, n, t, run->x, h, lead_of(run), run->next, run->dense);
        else rw_explicit_dense(&rw_dop853, &run->plain, n, t, run->x, h, NULL, run->next, run->dense);
        break;
    case RACEWAY_RODAS4: rw_rosenbrock_dense(&rw_rodas4, &run->linear, run->dense); break;
    default: rw_rosenbrock_dense(&rw_rodas5p, &run->linear, run->dense);
    }
}

/* The state of that step where a part of its time has passed. */
static void state_at(const rw_run *run, double part, double *y)
{
    const double(*dense)[RW_NX] = (const double(*)[RW_NX])run->dense;
    const double theta = place_of(run, part);
    switch (run->method) {
    case RACEWAY_DP54: rw_explicit_at(&rw_dp54, dense, run->x, run->next, theta, y); break;
    case RACEWAY_DOP853: rw_explicit_at(&rw_dop853, dense, run->x, run->next, theta, y); break;
    case RACEWAY_RODAS4: rw_rosenbrock_at(&rw_rodas4, dense, run->x, run->next, theta, y); break;
    default: rw_rosenbrock_at(&rw_rodas5p, dense, run->x, run->next, theta, y);
    }
}

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
            if (!prepared) prepare_dense(run, t, h);
            prepared = 1;
            state_at(run, theta > 0.0 ? theta : 0.0, y);
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
    prepare_dense(run, t, h);
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
        if (is_paced(run))
            return rw_explicit_step(&rw_dp54, RW_DP54_STAGES, &run->plain, &run->numbers, t, run->x, h, lead_of(run), run->weight, run->next);
        return rw_explicit_step(&rw_dp54, RW_DP54_STAGES, &run->plain, &run->numbers, t, run->x, h, NULL, run->weight, run->next);
    case RACEWAY_DOP853:
        result->evaluations += rw_dop853.stages;
        if (is_paced(run))
            return rw_explicit_step(&rw_dop853, RW_DOP853_STAGES, &run->plain, &run->numbers, t, run->x, h, lead_of(run), run->weight,
                                    run->next);
        return rw_explicit_step(&rw_dop853, RW_DOP853_STAGES, &run->plain, &run->numbers, t, run->x, h, NULL, run->weight, run->next);
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
#ifdef RACEWAY_LOCATED
    memcpy(run->rate, run->plain.k[0], sizeof run->rate);
#endif
}

/* That behind an accepted step which ended at (t, x): most end with the slope of the next. */
static void next_slope(rw_run *run, double t)
{
    const int end = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
#ifdef RACEWAY_LOCATED
    const double pace = rw_pace(run->lead, 1.0);
    if (pace < RW_LEAST_PACE) {
        first_slope(run, t);
        return;
    }
    for (int k = 0; k < RW_NX; k++) run->rate[k] = run->plain.k[end][k] / pace;
    memcpy(run->plain.k[0], run->rate, sizeof run->rate);
#else
    (void)t;
    memcpy(run->plain.k[0], run->plain.k[end], sizeof run->plain.k[0]);
#endif
}

static void linearize(rw_run *run, double t, int fresh)
{
    rw_rosenbrock_start(&run->linear, &run->numbers, t, run->x, fresh);
    run->result->evaluations++;
}

enum { NO_KINK = 0, CUT = 1, AT_ONCE = 2 }; /* what a step met: nothing; it was cut to end on a kink; there is one at its start */

#ifdef RACEWAY_LOCATED
/* The step tried, at a part of its time: the cubic through its ends and their slopes where these are known, else its dense output. */
static void glance_at(const rw_run *run, double part, double *y)
{
    if (is_explicit(run->method)) {
        const double theta = place_of(run, part);
        const rw_state inner = RW_STATE(run->dense[0]) + theta * RW_STATE(run->dense[1]);
        *(rw_state *)y = RW_STATE(run->x) + theta * (RW_STATE(run->next) - RW_STATE(run->x) + (1.0 - theta) * inner);
    } else {
        state_at(run, part, y);
    }
}

static void prepare_glance(rw_run *run, double t, double h)
{
    if (is_explicit(run->method)) {
        const int end = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
        const rw_state delta = RW_STATE(run->next) - RW_STATE(run->x), first = h * RW_STATE(run->plain.k[0]);
        *(rw_state *)run->dense[0] = first - delta;
        *(rw_state *)run->dense[1] = 2.0 * delta - (first + h * RW_STATE(run->plain.k[end]));
    } else {
        prepare_dense(run, t, h);
    }
}

typedef void rw_view(const rw_run *, double, double *);

/* Look at the step tried, before its end by `at`; whether a side changes. */
static int look(rw_run *run, double t, double h, rw_view *at)
{
    rw_sides *s = &run->sides;
    double unused[RW_NB], y[RW_NX], place;
    int changed = 0;
    for (int k = 1; k <= RW_LOOKS; k++) {
        s->place[k] = (double)k / RW_LOOKS;
        if (k < RW_LOOKS) at(run, s->place[k], y);
        rw_switch_values(&run->numbers, t + s->place[k] * h, k < RW_LOOKS ? y : run->next, s->seen[k], k < RW_LOOKS ? unused : s->slope[1]);
        changed |= rw_changed(s, k);
    }
    const int dip = changed ? 0 : rw_dip(s, &place);
    if (dip > 0) {
        s->place[dip] = place;
        at(run, place, y);
        rw_switch_values(&run->numbers, t + place * h, y, s->seen[dip], unused);
        changed = rw_changed(s, dip);
    }
    return changed;
}

/* Whether the step tried has to be looked at in earnest. */
static int glance(rw_run *run, double t, double h)
{
    rw_sides *s = &run->sides;
    if (!rw_has_slopes()) {
        prepare_glance(run, t, h);
        return look(run, t, h, glance_at);
    }
    const double pace[2] = {h * rw_pace(run->lead, 0.0), h * rw_pace(run->lead, 1.0)};
    double theta[RW_LOOKS + 1];
    for (int k = 0; k <= RW_LOOKS; k++) theta[k] = place_of(run, (double)k / RW_LOOKS);
    rw_switch_values(&run->numbers, t + h, run->next, s->seen[RW_LOOKS], s->slope[1]);
    return rw_glance(s, theta, pace);
}

/* A switching function of a ball within the step tried. */
static double switch_at(const rw_run *run, double t, double h, double part, rw_view *at, int i, int j)
{
    double y[RW_NX], g[RW_NSWITCHES][RW_NB], unused[RW_NB];
    if (part < 1.0) at(run, part, y);
    rw_switch_values(&run->numbers, t + part * h, part < 1.0 ? y : run->next, g, unused);
    return g[i][j];
}

/* Where a ball changes its side that is found changed at a look: the first root in front of it, by regula falsi (Illinois). */
static double root_before(const rw_run *run, double t, double h, rw_view *at, int before, int i, int j)
{
    const rw_sides *s = &run->sides;
    const double side = s->side[i][j];
    int behind = before;
    while (before > 0 && !(side * s->seen[before - 1][i][j] > 0.0)) behind = --before;
    if (before == 0) return 0.0;
    before--;
    double a = s->place[before], b = s->place[behind], fa = side * s->seen[before][i][j], fb = side * s->seen[behind][i][j];
    double root = b;
    int kept = 0; /* end that the last iteration kept: -1 the first, 1 the last */
    for (int k = 0; k < RW_ROOT_ITERATIONS && fb < 0.0; k++) {
        const double next = k % 8 == 7 ? 0.5 * (a + b) : b - fb * (b - a) / (fb - fa), moved = fabs(next - root);
        if (!(next > a && next < b)) break;
        root = next;
        if (!(moved > DBL_EPSILON * root)) break;
        const double f = side * switch_at(run, t, h, root, at, i, j);
        if (fabs(f) <= RW_CLOSE * s->band[i]) break;
        if (f > 0.0) {
            fb *= kept > 0 ? 0.5 : 1.0;
            a = root, fa = f, kept = 1;
        } else {
            fa *= kept < 0 ? 0.5 : 1.0;
            b = root, fb = f, kept = -1;
        }
    }
    return root;
}

/* The first change of a side in the step looked at: its part of the step's time, above 1 where there is none; all that change. */
static double first_change(const rw_run *run, double t, double h, rw_view *at, int *which, int *ball,
                           unsigned char changed[RW_NSWITCHES][RW_NB])
{
    const rw_sides *s = &run->sides;
    double first = 2.0;
    for (int i = 0; i < RW_NSWITCHES; i++)
        for (int j = 0; j < RW_NB; j++)
            for (int k = 1; k <= RW_LOOKS && !changed[i][j]; k++) {
                if (!(s->side[i][j] * s->seen[k][i][j] < -s->band[i])) continue;
                changed[i][j] = 1;
                const double root = root_before(run, t, h, at, k, i, j);
                if (root < first) first = root, *which = i, *ball = j;
            }
    return first;
}

/* Pace of a step of size h from t: over the root of the time to a branch point of the law that is near. */
static void set_pace(rw_run *run, double start, double t, double h)
{
    run->lead = 1.0;
    if (!is_explicit(run->method)) return;
    if (run->release.time > t) {
        const double from = run->release.time - t, to = from - h;
        run->lead = rw_lead(from, to > 0.0 ? to : 0.0);
    } else {
        const double from = (start + t) - run->onset;
        if (h > RW_FAR * from) run->lead = rw_lead(from, from + h);
    }
    for (int k = 0; k < RW_NX; k++) run->plain.k[0][k] = run->lead * run->rate[k];
}

/* Size of a step by `factor` longer than the one of size h from t, over its clock: the next, or the same again. */
static double stretched(const rw_run *run, double start, double t, double h, double factor, int next)
{
    if (!is_paced(run)) return h * factor;
    const int ahead = run->release.time > t;
    const double from = ahead ? run->release.time - t : (start + t) - run->onset, to = ahead ? from - h : from + h;
    /* it was made to end where the contact was foreseen to, and the contact goes on: what is left there is rounding */
    if (next && !(to > RW_ARRIVED * from)) return h * factor;
    const double first = sqrt(from), last = sqrt(to > 0.0 ? to : 0.0), reach = factor * fabs(last - first), base = next ? last : first;
    if (!ahead) return reach * (2.0 * base + reach);
    return reach < base ? reach * (2.0 * base - reach) : base * base;
}

/* Where a step of size h that was refused runs over the end of a contact, the next is paced for it, and `next` is the way there.
   Much shorter than what error control makes of the step it is not taken: what was refused is not to be trusted so far, and a ball that has
   just landed is on its kink. */
static void foresee(rw_run *run, double t, double h, double *next)
{
    if (!is_explicit(run->method) || run->release.time > t) return;
    unsigned char changed[RW_NSWITCHES][RW_NB] = {{0}};
    int which = 0, ball = 0;
    prepare_glance(run, t, h);
    if (!look(run, t, h, glance_at)) return;
    const double part = first_change(run, t, h, glance_at, &which, &ball, changed);
    if (!(part * h > RW_NEAREST * *next && part < 1.0 && rw_ends(which, run->sides.side[which][ball]))) return;
    *next = part * h;
    run->release = (rw_release){t + *next, which, ball};
}

/* Whether the step tried changes a side.  Then it is repeated with a length that ends on the first kink, and `h` is that length; the sides
   to turn there are marked.  `aimed`: it was made to end where a contact does. */
static int locate(rw_run *run, double start, double t, double *h, double *error, double resolution, int aimed)
{
    rw_sides *s = &run->sides;
    raceway_result *result = run->result;
    const double tried = *h;
    unsigned char changed[RW_NSWITCHES][RW_NB] = {{0}};
    double reach = tried;
    int which = run->release.which, ball = run->release.ball, met;
    met = glance(run, t, tried);
    if (met) {
        prepare_dense(run, t, tried);
        met = look(run, t, tried, state_at);
    }
    if (!met && !aimed) return NO_KINK;
    if (met) reach = first_change(run, t, tried, state_at, &which, &ball, changed) * tried;
    const int ends = is_explicit(run->method) && rw_ends(which, s->side[which][ball]);
    double scale = 0.0;
    for (int j = 0; j < RW_NB; j++) scale = fabs(s->seen[0][which][j]) > scale ? fabs(s->seen[0][which][j]) : scale;
    const double band = s->band[which], least = 1e-6 * band, rounding = 4.0 * DBL_EPSILON * scale;
    /* behind a branch point of the law its slope is unbounded: a linearly implicit step stays on the other side */
    const double clear = is_explicit(run->method) ? 0.0 : rw_ends(which, 1.0) ? -1.0 : rw_ends(which, -1.0) ? 1.0 : 0.0;
    const double aim = clear * (least > rounding ? least : rounding);
    double length = tried; /* of the step at hand */
    for (int k = 0; k < RW_REPEATS; k++) {
        if (!(reach > resolution)) {
            s->turn[which][ball] = 1;
            result->rejected++;
            return AT_ONCE;
        }
        if (reach != length) {
            length = reach;
            result->rejected++;
            if (ends) run->release = (rw_release){t + reach, which, ball};
            set_pace(run, start, t, reach);
            const double again = try_step(run, t, reach);
            *h = reach;
            *error = again;
            if (!(again >= 0.0 && again <= 1.0 && within_reach(run))) return NO_KINK;
        }
        rw_switch_values(&run->numbers, t + reach, run->next, s->seen[RW_LOOKS], s->slope[1]);
        const double left = s->seen[RW_LOOKS][which][ball];
        if (fabs(left) <= band && !(clear * left < 0.0)) break;
        double slope = s->slope[1][ball];
        if (!rw_has_slope(which)) {
            const double back = 1.0 / 64.0;
            prepare_dense(run, t, reach);
            slope = (left - switch_at(run, t, reach, 1.0 - back, state_at, which, ball)) / (back * reach);
        }
        const double moved = reach - (left - aim) / slope;
        if (aimed && !met && !(s->side[which][ball] * slope < 0.0 && moved < RW_ASTRAY * tried)) return NO_KINK; /* contact goes on */
        if (!(moved > 0.0 && moved <= (aimed ? RW_ASTRAY : 1.0) * tried)) break;
        if (k + 1 < RW_REPEATS) reach = moved;
    }
    for (int i = 0; i < RW_NSWITCHES; i++)
        for (int j = 0; j < RW_NB; j++)
            s->turn[i][j] = changed[i][j] && s->side[i][j] * s->seen[RW_LOOKS][i][j] <= s->band[i];
    s->turn[which][ball] = 1;
    return CUT;
}

/* Turn the sides marked: the slopes at (t, x) are new. */
static void turn_sides(rw_run *run, double time, double step)
{
    rw_turn_sides(&run->sides, time, step);
    run->onset = rw_onset(&run->sides);
    if (run->onset == time && run->step > run->touch) run->step = run->touch;
    run->release.time = NAN;
    run->result->kinks++;
}

static void sides_start(rw_run *run, double t)
{
    rw_sides_start(&run->sides, &run->numbers, t, run->x, run->weight);
    run->numbers.border = (const double(*)[RW_NSWITCHES])run->sides.border;
    run->onset = -INFINITY;
    run->touch = INFINITY;
}

static void sides_move_on(rw_run *run) { rw_sides_move_on(&run->sides); }

/* Times of another segment. */
static void forget_release(rw_run *run) { run->release = (rw_release){NAN, 0, 0}; }

/* Whether a step is to end where a contact is foreseen to; `h` is the way there then. */
static int aim(rw_run *run, double t, double left, double resolution, double *h)
{
    const double ahead = run->release.time - t;
    if (!(ahead > 0.0)) return 0;
    if (!(ahead > resolution)) {
        run->release.time = NAN;
        return 0;
    }
    if (!(ahead <= *h * 1.0001 && ahead <= left)) return 0;
    *h = ahead;
    return 1;
}
#else
#define locate(run, start, t, h, error, resolution, aimed) ((void)(aimed), NO_KINK)
#define turn_sides(run, time, step) ((void)(time), (void)(step))
#define sides_start(run, t) ((void)0)
#define sides_move_on(run) ((void)0)
#define forget_release(run) ((void)0)
#define aim(run, t, left, resolution, h) 0
#define set_pace(run, start, t, h) ((void)0)
#define stretched(run, start, t, h, factor, next) ((h) * (factor))
#define foresee(run, t, h, next) ((void)0)
#endif

/* The method for the next step, from the accepted one. */
static int judge_family(rw_run *run, rw_family *family, double h)
{
    if (!rw_family_looks(family)) return run->method;
    if (!is_explicit(run->method)) return rw_after_linear(family, &run->seen, run->method, rw_fastest_rate(run->linear.A, run->linear.B), h);
    const int stages = run->method == RACEWAY_DP54 ? RW_DP54_STAGES : RW_DOP853_STAGES;
    return rw_after_explicit(family, run->method, rw_explicit_stiffness(&run->plain, stages, h, run->next, run->weight), 1);
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
    if (run->step == 0.0) sides_start(run, t);
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
    forget_release(run);
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
        const int aimed = aim(run, t, left, resolution, &h);
        if (aimed) last = 0;
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
        set_pace(run, start, t, h);
        double error = try_step(run, t, h);
        const double q = error_exponent(run->method);
        if (error >= 0.0 && error <= 1.0 && within_reach(run)) error = tangent_step(run, t, h, error);
        const double tried = h;
        const int met = error >= 0.0 && error <= 1.0 && within_reach(run) ? locate(run, start, t, &h, &error, resolution, aimed) : NO_KINK;
        if (met == AT_ONCE) {
            turn_sides(run, start + t, tried);
            if (is_explicit(run->method)) first_slope(run, t);
            else linearize(run, t, 1);
            continue;
        }
        if (h != tried) last = 0;
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
            /* a step that was cut, or has its own pace, says nothing about the families */
            const int chosen = changeable && met == NO_KINK && !is_paced(run) ? judge_family(run, &family, h) : run->method;
            tangent_accept(run);
            memcpy(run->x, run->next, sizeof run->next);
#ifdef RACEWAY_LOCATED
            if (run->lead == 0.0 && met == NO_KINK) run->touch = h * factor * factor;
#endif
            if (met == CUT) {
                if (factor < 1.0) run->step = tried * factor;
            } else if (!last || factor < 1.0) {
                run->step = stretched(run, start, t, h, factor, 1);
            }
            t = last ? length : t + h;
            if (met == CUT) turn_sides(run, start + t, tried);
            sides_move_on(run);
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
            } else if (met == CUT && is_explicit(run->method)) {
                first_slope(run, t);
            } else if (is_explicit(run->method)) {
                next_slope(run, t);
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
            run->step = stretched(run, start, t, h, factor, 0);
            if (finite) foresee(run, t, h, &run->step);
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
    run->seen = (rw_rates){0.0, INFINITY};
    run->method = options->method;
    run->outputs = outputs;
    run->output_times = output_times;
    run->output_states = output_states;
    run->numbers.p = p;
    run->numbers.c = c;
    const int changeable = options->method == RACEWAY_AUTO;
    if (options->method < RACEWAY_AUTO || options->method > RACEWAY_DOP853) return result->status = RACEWAY_BAD_ARGUMENT;
    if (!rw_are_limits(options->first_step, options->smallest_step, options->largest_step)) return result->status = RACEWAY_BAD_ARGUMENT;
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

#ifndef RACEWAY_LOCATED
void raceway_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *inputs, double horizon,
                        double *magnitude)
{
    rw_magnitudes(p, c, initial, moments, inputs, horizon, magnitude);
}
#endif

void raceway_sizes(int *sizes)
{
    sizes[5] = RW_LANES;
    sizes[0] = RW_NX;
    sizes[1] = RW_NU;
    sizes[2] = RW_NP;
    sizes[3] = RW_NC;
    sizes[4] = RW_NB;
    sizes[6] = (int)sizeof(raceway_options);
    sizes[7] = (int)sizeof(raceway_result);
    sizes[8] = (int)sizeof(raceway_tangents);
}
