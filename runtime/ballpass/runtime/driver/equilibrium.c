/* The quasi-static model: follows the rings' equilibrium, see equilibrium.h.

   Between two instants positions are the cubic Hermite polynomial through positions and velocities at both.  Its middle is compared with the
   equilibrium there; the difference, over the tolerance, controls how far the instants lie apart.  Where a ball leaves or takes the load the
   equilibrium can jump: the instants close in on the jump until they are as near as time resolves, and the next instant lies behind it. */
#include "equilibrium.h"

#include "reductions.h"
#include "rest.h"

/* Shortest distance of two instants, as a part of the segment: there a jump is passed. */
static const double BP_RESOLUTION = 1e-9;

/* Newton's method converges quadratically: what it leaves is far smaller than the last correction it makes. */
static const double BP_NEWTON_SHARE = 1e-3;

/* Where a single ball carries the load, for an instant, on its way from one neighbour's help to the other's, there is no single answer: so
   many steps of other lengths are tried around such an instant, and a point within a step is taken beside it by this part of the step. */
enum { BP_ATTEMPTS = 40 };
static const double BP_BESIDE = 1e-5;

/* An instant, with its clock in the segment. */
typedef struct {
    double t, q[BP_NQ], v[BP_NQ];
} bp_instant;

typedef struct {
    const ballpass_equilibrium_options *options;
    ballpass_equilibrium_result *result;
    bp_numbers numbers;
    double allowed[BP_NQ], weight[BP_NQ];
    bp_instant left, middle, right; /* of the step under way */
    int status;                     /* of a search within the step */
} bp_follower;

/* Hermite polynomial at the part theta of the way between two instants. */
static inline void hermite(const bp_instant *a, const bp_instant *b, double theta, double *q)
{
    const double h = b->t - a->t, rest = 1.0 - theta;
    for (int k = 0; k < BP_NQ; k++)
        q[k] = rest * rest * ((1.0 + 2.0 * theta) * a->q[k] + theta * h * a->v[k]) +
               theta * theta * ((1.0 + 2.0 * rest) * b->q[k] - rest * h * b->v[k]);
}

/* Equilibrium at instant->t, sought from instant->q. */
static int seek(bp_follower *f, bp_instant *instant)
{
    int is_free;
    if (bp_rest(&f->numbers, instant->t, f->allowed, instant->q, instant->v, &is_free, &f->result->iterations)) return 1;
    f->status = is_free ? BALLPASS_EQUILIBRIUM_FREE : BALLPASS_EQUILIBRIUM_NONE;
    return 0;
}

static inline void state_of(const bp_instant *instant, double *x)
{
    memcpy(x, instant->q, BP_NQ * sizeof *x);
    memcpy(x + BP_NQ, instant->v, BP_NQ * sizeof *x);
}

/* State whose balls carry the forces that balance the load: those with the rings at rest. */
static inline void resting_state_of(const bp_instant *instant, double *x)
{
    memcpy(x, instant->q, BP_NQ * sizeof *x);
    for (int k = BP_NQ; k < BP_NX; k++) x[k] = 0.0;
}

/* Equilibrium within the step, sought from the polynomials through its middle. */
static int within(bp_follower *f, double t, bp_instant *found)
{
    const int late = t >= f->middle.t;
    const bp_instant *a = late ? &f->middle : &f->left, *b = late ? &f->right : &f->middle;
    found->t = t;
    hermite(a, b, (t - a->t) / (b->t - a->t), found->q);
    if (seek(f, found)) return 1;
    f->status = BALLPASS_EQUILIBRIUM_DONE;
    found->t = t + (late ? -BP_BESIDE : BP_BESIDE) * (f->right.t - f->left.t);
    hermite(a, b, (found->t - a->t) / (b->t - a->t), found->q);
    return seek(f, found);
}

/* Ends of a step of length h from f->left on, and the guess for its middle. */
static int step_ends(bp_follower *f, double h, double *guess)
{
    for (int k = 0; k < BP_NQ; k++) f->right.q[k] = f->left.q[k] + h * f->left.v[k];
    if (!seek(f, &f->right)) return 0;
    hermite(&f->left, &f->right, 0.5, guess);
    f->middle.t = f->left.t + 0.5 * h;
    memcpy(f->middle.q, guess, BP_NQ * sizeof *guess);
    return seek(f, &f->middle);
}

/* A channel of the reductions within the step; where no equilibrium is found the run ends, and what is returned does not count. */
static double channel_at(const void *source, int channel, double theta, int *ball)
{
    bp_follower *f = (bp_follower *)source;
    bp_instant found;
    double x[BP_NX];
    *ball = 0;
    if (!within(f, f->left.t + theta * (f->right.t - f->left.t), &found)) return -DBL_MAX;
    if (channel < BP_NX) state_of(&found, x);
    else resting_state_of(&found, x);
    return bp_channel(&f->numbers, found.t, x, channel, ball);
}

static int reduce(bp_follower *f, double begin)
{
    double *reduction = f->options->reduction, v[BP_POINTS][BP_CHANNELS];
    const double h = f->right.t - f->left.t;
    for (int i = 0; i < BP_POINTS; i++) {
        bp_instant found;
        double x[BP_NX];
        if (i == 0) found = f->left;
        else if (i == BP_POINTS / 2) found = f->middle;
        else if (i == BP_POINTS - 1) found = f->right;
        else if (!within(f, f->left.t + h * i / (BP_POINTS - 1), &found)) return 0;
        resting_state_of(&found, x);
        bp_channels(&f->numbers, found.t, x, bp_balls_wanted(reduction), v[i]);
        state_of(&found, v[i]);
    }
    bp_reduce(reduction, (const double(*)[BP_CHANNELS])v, begin + f->left.t, h, channel_at, f);
    return f->status == BALLPASS_EQUILIBRIUM_DONE;
}

/* Difference of the polynomial's middle from the equilibrium there, over the tolerance. */
static double misfit(const bp_follower *f, const double *guess)
{
    double sum = 0.0;
    for (int k = 0; k < BP_NQ; k++) {
        const double e = (f->middle.q[k] - guess[k]) * f->weight[k];
        sum += e * e;
    }
    return sqrt(sum / BP_NQ);
}

/* Follow one segment of that length from f->left, whose clock is zero.  An output at its end belongs to the next one, where there is one:
   loads may jump there.  Returns 0 when it could not. */
static int follow(bp_follower *f, double begin, double length, int is_final, double *step, long outputs, const double *output_times,
                  double *output_states)
{
    ballpass_equilibrium_result *result = f->result;
    const double shortest = BP_RESOLUTION * length;
    double *reduction = f->options->reduction;
    const int reduced = reduction && begin >= reduction[BP_FROM];
    double h = *step < length ? *step : length;
    int attempts = 0;
    while (f->left.t < length) {
        if (result->steps + result->rejected >= f->options->max_steps) {
            f->status = BALLPASS_EQUILIBRIUM_TOO_MANY_STEPS;
            return 0;
        }
        const int last = f->left.t + h >= length - shortest;
        double guess[BP_NQ];
        f->right.t = last ? length : f->left.t + h;
        h = f->right.t - f->left.t;
        if (!step_ends(f, h, guess)) {
            if (++attempts > BP_ATTEMPTS) return 0;
            f->status = BALLPASS_EQUILIBRIUM_DONE;
            result->rejected++;
            /* such instants are isolated: shorter steps end before this one, and where none is shorter, longer ones behind it */
            if (h <= 4.0 * shortest && attempts < BP_ATTEMPTS / 2) attempts = BP_ATTEMPTS / 2;
            h *= attempts < BP_ATTEMPTS / 2 ? 0.37 : 2.9;
            continue;
        }
        const double error = misfit(f, guess);
        const int passed = error > 1.0 && (h <= 2.0 * shortest || attempts >= BP_ATTEMPTS / 2);
        /* the misfit of a smooth equilibrium goes like the fourth power of the step */
        double factor = error > 0.0 ? 0.9 * sqrt(sqrt(1.0 / error)) : 4.0;
        if (error > 1.0 && !passed) {
            result->rejected++;
            factor = factor > 0.1 ? factor : 0.1;
            h = h * factor > shortest ? h * factor : shortest;
            continue;
        }
        attempts = 0;
        result->steps++;
        result->jumps += passed;
        if (reduced && !passed && !reduce(f, begin)) return 0;
        for (; result->written < outputs; result->written++) {
            const double wanted = output_times[result->written] - begin;
            bp_instant found;
            if (wanted > f->right.t || (last && !is_final && wanted >= length)) break;
            if (!within(f, wanted, &found)) return 0;
            if (output_states) state_of(&found, output_states + result->written * BP_NX);
        }
        /* behind a jump the step before it says more than the tiny one across */
        h = passed ? 1e3 * h : h * (factor < 4.0 ? factor : 4.0);
        f->left = f->right;
        result->time = begin + f->left.t;
        if (!last) *step = h;
    }
    return 1;
}

int ballpass_equilibria(const ballpass_equilibrium_options *options, const double *p, const double *c, double *x, long segments,
                       const double *times, const double *inputs, long outputs, const double *output_times, double *output_states,
                       ballpass_equilibrium_result *result)
{
    bp_follower f = {.options = options, .result = result, .numbers = {inputs, p, c}};
    memset(result, 0, sizeof *result);
    result->time = segments > 0 ? times[0] : 0.0;
    for (long i = 1; i <= segments; i++)
        if (!(times[i] >= times[i - 1])) return result->status = BALLPASS_EQUILIBRIUM_BAD_ARGUMENT;
    for (int k = 0; k < BP_NQ; k++) {
        if (!(fabs(x[k]) <= DBL_MAX && options->tolerance[k] > 0.0)) return result->status = BALLPASS_EQUILIBRIUM_BAD_ARGUMENT;
        f.allowed[k] = BP_NEWTON_SHARE * options->tolerance[k];
        f.weight[k] = 1.0 / options->tolerance[k];
    }
    memcpy(f.left.q, x, sizeof f.left.q);
    double step = segments > 0 ? (times[segments] - times[0]) / 64.0 : 0.0;
    for (long i = 0; i < segments; i++) {
        result->segment = i;
        result->time = times[i];
        f.numbers.u = inputs + i * BP_NU;
        /* the load may have jumped */
        f.left.t = 0.0;
        const double length = times[i + 1] - times[i];
        if (!seek(&f, &f.left) ||
            !follow(&f, times[i], length, i == segments - 1, &step, outputs, output_times, output_states)) {
            result->status = f.status;
            break;
        }
    }
    state_of(&f.left, x);
    return result->status;
}

void ballpass_equilibrium_sizes(int *sizes)
{
    sizes[0] = BP_NX;
    sizes[1] = BP_NU;
    sizes[2] = BP_NP;
    sizes[3] = BP_NC;
    sizes[4] = BP_REDUCTION;
    sizes[5] = (int)sizeof(ballpass_equilibrium_options);
    sizes[6] = (int)sizeof(ballpass_equilibrium_result);
}
