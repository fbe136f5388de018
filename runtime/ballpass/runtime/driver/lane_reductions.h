/* On-line reductions of the members in lanes; see reductions.h. */
#ifndef BALLPASS_LANE_REDUCTIONS_H
#define BALLPASS_LANE_REDUCTIONS_H

#include "lane_block.h"

/* A member within the step just taken, for bp_within. */
typedef struct {
    bp_numbers n;
    double t, h, x[BP_NX], next[BP_NX], dense[BP_DENSE_ROWS][BP_NX];
    const bp_method *method;
    double part, span; /* of the step that is reduced: where it starts, and how much of it it is */
    double balls[BP_POINTS][BP_BALL_QUANTITIES]; /* at the quarters */
} bp_lane_source;

static double lane_state(const void *from, double theta, double *x)
{
    const bp_lane_source *source = from;
    const double(*dense)[BP_NX] = (const double(*)[BP_NX])source->dense;
    const bp_method *method = source->method;
    const double place = source->part + source->span * theta;
    if (place >= 1.0) memcpy(x, source->next, sizeof source->next);
    else if (method->plain) bp_explicit_at(method->plain, dense, source->x, source->next, place, x);
    else bp_rosenbrock_at(method->linear, dense, source->x, source->next, place, x);
    return source->t + place * source->h;
}

static void lane_source(const bp_job *job, const bp_lane_block *b, int lane, double part, double span, int balls, bp_lane_source *source)
{
    source->n = member_numbers(job, b->who[lane]);
    source->t = b->t[lane];
    source->h = b->h[lane];
    source->method = &bp_methods[b->method];
    source->part = part;
    source->span = span;
    get(b->x, lane, source->x, BP_NX);
    get(b->next, lane, source->next, BP_NX);
    const bp_explicit_method *plain = source->method->plain;
    for (int row = 0; row < (plain ? 2 + plain->dense_rows : source->method->linear->dense_rows); row++) get(b->dense[row], lane, source->dense[row], BP_NX);
    for (int i = 0; i < BP_POINTS && balls; i++) {
        double x[BP_NX];
        const double t = lane_state(source, (double)i / (BP_POINTS - 1), x);
        bp_ball_quantities(&source->n, t, x, source->balls[i]);
    }
}

/* List what of a step is wanted by a row of reductions. */
static void list_wanted(bp_lane_block *b, const double *reduction)
{
    const double balls = bp_wanted(reduction, BP_NX), *wanted = reduction + BP_WANTED;
    b->wanted = reduction;
    b->balls = balls > 0.0;
    b->guarded = b->balls && balls < 1.0;
    b->passes = bp_wanted(reduction, BP_LOOKED_AT) > 0.0;
    /* balls are evaluated within the step, or at the end of a part of it */
    const int all_states = b->balls && (!b->guarded || bp_parts(bp_methods[b->method].dense_degree) > 1);
    b->sided = 0;
    for (int k = BP_NX; k < BP_LOOKED_AT; k++) b->sided |= bp_cuts_moments(reduction, k);
    for (int k = 0; k < BP_LOOKED_AT; k++) {
        double extreme = 0.0, any = (double)all_states;
        for (int e = 0; e < BP_EXTREMES; e++) extreme += wanted[e * BP_CHANNELS + k];
        if (extreme > 0.0) b->extreme[b->extremes++] = k;
        any += extreme;
        for (int m = 0; m < BP_MOMENTS; m++) {
            const double moment = wanted[(BP_EXTREMES + m) * BP_CHANNELS + k];
            if (moment != 0.0) b->moment_of[m][b->moments[m]++] = k;
            any += moment;
        }
        if (any > 0.0 && k < BP_NX) b->state[b->states++] = k;
    }
}

/* Add a part of the steps of lanes to the angles turned and to the places of the raceways; see bp_add_sectors. */
static void add_passes(const bp_job *job, bp_lane_block *b, double part, double span, const double *add)
{
    double sum[BP_NB + 1][BP_L] BP_ALIGNED, moment[BP_NB + 1][BP_L] BP_ALIGNED;
    for (int j = 0; j < BP_NB; j++) {
        const int i = j * BP_L;
        BP_EACH_LANE {
            const double c0 = bp_boole[0] * b->first[0][i + lane], c1 = bp_boole[1] * b->first[1][i + lane];
            const double c2 = bp_boole[2] * b->first[2][i + lane], c3 = bp_boole[3] * b->first[3][i + lane];
            const double c4 = bp_boole[4] * b->first[4][i + lane];
            sum[j][lane] = c0 + c1 + c2 + c3 + c4;
            moment[j][lane] = 0.25 * c1 + 0.5 * c2 + 0.75 * c3 + c4;
            b->first[0][i + lane] = add[lane] != 0.0 ? b->first[BP_POINTS - 1][i + lane] : b->first[0][i + lane];
        }
    }
    for (int lane = 0; lane < BP_L; lane++) {
        if (add[lane] == 0.0) continue;
        const bp_numbers n = member_numbers(job, b->who[lane]);
        double x[BP_NX], from[2 * BP_BEARINGS + 1], to[2 * BP_BEARINGS + 1];
        double *sectors = job->reductions + b->who[lane] * BP_REDUCTION + BP_RACEWAYS;
        get(b->sampled[0], lane, x, BP_NX);
        bp_passes(b->t[lane] + part * b->h[lane], x, n.u, n.p, n.c, from);
        get(b->sampled[BP_POINTS - 1], lane, x, BP_NX);
        bp_passes(b->t[lane] + (part + span) * b->h[lane], x, n.u, n.p, n.c, to);
        for (int k = 0; k < BP_BEARINGS; k++) b->moment[0][(BP_LOOKED_AT + k) * BP_L + lane] += bp_turned(from + 2 * k, to + 2 * k);
#define BP_ADD(b_)                                                                                                                      \
        for (int j = 0; j < BP_##b_##_BALLS; j++) {                                                                                     \
            const double total = sum[bp_first_ball[bearing] + j][lane];                                                                   \
            if (total > 0.0)                                                                                                            \
                bp_add_places(sectors + 2 * BP_SECTORS * bearing, (double)j / BP_##b_##_BALLS,                                             \
                              bp_turned(from + 2 * bearing, to + 2 * bearing) * total, moment[bp_first_ball[bearing] + j][lane] / total,        \
                              from + 2 * bearing, to + 2 * bearing);                                                                          \
        }
        BP_EACH_BEARING(BP_ADD)
#undef BP_ADD
    }
}

/* Reductions of a part of the steps of the lanes to `add`, whose dense output is ready; the same rules as bp_reduce. */
static void reduce_part(const bp_job *job, bp_lane_block *b, double part, double span, const double *add)
{
    const bp_method *method = &bp_methods[b->method];
    const double(*dense)[BP_NX * BP_L] = (const double(*)[BP_NX * BP_L])b->dense;
    memset(b->cut, 0, sizeof b->cut);
    for (int q = 1; q < BP_POINTS; q++) {
        const double theta = part + span * ((double)q / (BP_POINTS - 1));
        double *restrict y = b->sampled[q];
        if (theta >= 1.0) memcpy(y, b->next, sizeof b->next);
        for (int i = 0; i < b->states && theta < 1.0; i++) {
            /* the method of most runs once more, as its step: its coefficients are constants */
            if (b->method == BP_AUTO_LOW) bp_lane_explicit_part(bp_methods[BP_AUTO_LOW].plain, dense, b->x, b->next, theta, b->state[i], y);
            else if (method->plain) bp_lane_explicit_part(method->plain, dense, b->x, b->next, theta, b->state[i], y);
            else bp_lane_rosenbrock_part(method->linear, dense, b->x, b->next, theta, b->state[i], y);
        }
        if (!b->balls || (b->guarded && q < BP_POINTS - 1)) continue;
        double time[BP_L] BP_ALIGNED;
        BP_EACH_LANE time[lane] = b->t[lane] + theta * b->h[lane];
        if (b->guarded) bp_lane_deflections(&b->numbers, time, y, y + BP_NX * BP_L);
        else bp_lane_ball_channels(&b->numbers, time, y, b->passes, y + BP_NX * BP_L, b->first[q], b->side[q], b->sided);
        for (int i = 0; i < (BP_LOOKED_AT - BP_NX) * BP_L && b->sided; i++) b->cut[BP_NX * BP_L + i] += b->side[q][i] != b->side[q - 1][i];
    }
    /* deflections that only guard against results that mean nothing are evaluated at the ends, and between where that may be a new extreme */
    for (int k = BP_NX + BP_DEFLECTION; k < BP_LOOKED_AT && b->guarded; k += BP_BALL_CHANNELS)
        for (int q = 1; q < BP_POINTS - 1; q++)
            BP_EACH_LANE {
                const double *end = b->sampled[BP_POINTS - 1] + k * BP_L, *start = b->sampled[0] + k * BP_L;
                b->sampled[q][k * BP_L + lane] = start[lane] + 0.25 * q * (end[lane] - start[lane]);
            }
    double news[BP_EXTREMES][BP_LOOKED_AT][BP_L] BP_ALIGNED, any[BP_L] BP_ALIGNED = {0.0}, of_balls[BP_L] BP_ALIGNED = {0.0};
    for (int i = 0; i < b->extremes; i++) {
        const int k = b->extreme[i], row = k * BP_L;
        const double *wanted = b->wanted + BP_WANTED + k;
        BP_EACH_LANE {
            const double v0 = b->sampled[0][row + lane], v1 = b->sampled[1][row + lane], v2 = b->sampled[2][row + lane];
            const double v3 = b->sampled[3][row + lane], v4 = b->sampled[4][row + lane];
            double low, high;
            bp_survey(v0, v1, v2, v3, v4, bp_quartic_through(v0, v1, v2, v3, v4), &low, &high);
            for (int e = 0; e < BP_EXTREMES; e++) {
                const double bound = bp_sign[e] > 0.0 ? high : low, asked = wanted[e * BP_CHANNELS] != 0.0 ? add[lane] : 0.0;
                const double new = bp_sign[e] * bound > bp_sign[e] * b->best[e][row + lane] ? asked : 0.0;
                news[e][k][lane] = new;
                any[lane] += new;
                of_balls[lane] += k < BP_NX ? 0.0 : new;
            }
        }
    }
#define BP_OF_DEGREE(m, degree)                                                                                                        \
    for (int i = 0; i < b->moments[m]; i++) {                                                                                          \
        const int k = b->moment_of[m][i], row = k * BP_L;                                                                              \
        BP_EACH_LANE {                                                                                                                 \
            const double v0 = b->sampled[0][row + lane], v1 = b->sampled[1][row + lane], v2 = b->sampled[2][row + lane];               \
            const double v3 = b->sampled[3][row + lane], v4 = b->sampled[4][row + lane], shift = b->shift[row + lane];                 \
            bp_quartic q = bp_quartic_through(v0, v1, v2, v3, v4);                                                                     \
            q.c0 -= shift;                                                                                                             \
            const double mean = bp_moment(degree, v0, v1, v2, v3, v4, q, shift, k < BP_NX);                                            \
            const double whole = b->cut[row + lane] == 0.0 ? add[lane] : 0.0;                                                          \
            b->moment[m][row + lane] += whole != 0.0 ? span * b->h[lane] * mean : 0.0;                                                 \
        }                                                                                                                              \
    }
    BP_EACH_MOMENT(BP_OF_DEGREE)
#undef BP_OF_DEGREE
    for (int k = BP_NX; k < BP_LOOKED_AT && b->sided; k++)
        for (int lane = 0; lane < BP_L && bp_cuts_moments(b->wanted, k); lane++) {
            b->cut[k * BP_L + lane] *= add[lane];
            any[lane] += b->cut[k * BP_L + lane];
            of_balls[lane] += b->cut[k * BP_L + lane];
        }
    for (int lane = 0; lane < BP_L && bp_any_lane(any); lane++) {
        if (any[lane] == 0.0) continue;
        double *reduction = job->reductions + b->who[lane] * BP_REDUCTION;
        bp_lane_source source;
        lane_source(job, b, lane, part, span, of_balls[lane] != 0.0, &source);
        const double(*balls)[BP_BALL_QUANTITIES] = (const double(*)[BP_BALL_QUANTITIES])source.balls;
        const bp_within step = {b->start[lane] + b->t[lane] + part * b->h[lane], span * b->h[lane], 1.0, &source.n, lane_state, &source, balls};
        for (int k = BP_NX; k < BP_LOOKED_AT && b->sided; k++) {
            if (b->cut[k * BP_L + lane] == 0.0 || !bp_cuts_moments(b->wanted, k)) continue;
            double mean[BP_MOMENTS];
            bp_moments_between(&step, k - BP_NX, b->shift[k * BP_L + lane], mean);
            for (int m = 0; m < BP_MOMENTS; m++) b->moment[m][k * BP_L + lane] += span * b->h[lane] * mean[m];
        }
        for (int i = 0; i < b->extremes; i++) {
            for (int e = 0; e < BP_EXTREMES; e++) {
                const int k = b->extreme[i];
                if (news[e][k][lane] != 0.0) bp_extreme(reduction, e, k, b->sampled[0] + k * BP_L + lane, BP_CHANNELS * BP_L, &step);
                b->best[e][k * BP_L + lane] = reduction[BP_EXTREME + 3 * e * BP_CHANNELS + k];
            }
        }
    }
    if (b->passes) add_passes(job, b, part, span, add);
    for (int lane = 0; lane < BP_L; lane++)
        if (add[lane] != 0.0) job->reductions[b->who[lane] * BP_REDUCTION + BP_DURATION] += span * b->h[lane];
    for (int k = 0; k < BP_LOOKED_AT; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            b->sampled[0][i] = add[lane] != 0.0 ? b->sampled[BP_POINTS - 1][i] : b->sampled[0][i];
        }
    for (int k = 0; k < BP_LOOKED_AT - BP_NX && b->sided; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            b->side[0][i] = add[lane] != 0.0 ? b->side[BP_POINTS - 1][i] : b->side[0][i];
        }
}

/* Reductions of the lanes whose step was accepted. */
static void reduce(const bp_job *job, bp_lane_block *b)
{
    const bp_method *method = &bp_methods[b->method];
    const int parts = bp_parts(method->dense_degree);
    double add[BP_L] BP_ALIGNED;
    BP_EACH_LANE add[lane] = b->accepted[lane] * b->reducing[lane];
    if (b->method == BP_AUTO_LOW && bp_methods[BP_AUTO_LOW].plain->dense_stages == 0) {
        bp_lane_explicit_dense(bp_methods[BP_AUTO_LOW].plain, NULL, b->plain.k, b->x, b->h, b->next, b->dense);
    } else if (method->plain) {
        bp_lane_times at;
        bp_lane_times_of(&at, &b->numbers, &b->angles, method->plain->dense_nodes, method->plain->dense_stages, b->t, b->h);
        bp_lane_explicit_dense(method->plain, &at, b->plain.k, b->x, b->h, b->next, b->dense);
    } else {
        bp_lane_rosenbrock_dense(method->linear, (const double(*)[BP_NX * BP_L])b->linear.u, b->dense);
    }
    for (int part = 0; part < parts; part++) reduce_part(job, b, (double)part / parts, 1.0 / parts, add);
}

#endif
