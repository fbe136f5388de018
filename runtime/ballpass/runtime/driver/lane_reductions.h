/* On-line reductions of the members in lanes; see reductions.h. */
#ifndef BALLPASS_LANE_REDUCTIONS_H
#define BALLPASS_LANE_REDUCTIONS_H

#include "lane_block.h"

/* A member within the step just taken, for bp_within. */
typedef struct {
    bp_numbers n;
    double t, h, x[BP_NX], next[BP_NX], dense[BP_DENSE_ROWS][BP_NX];
    int linearly;
    double balls[BP_POINTS][BP_BALL_QUANTITIES]; /* at the quarters */
} bp_lane_source;

static double lane_state(const void *from, double theta, double *x)
{
    const bp_lane_source *source = from;
    const double(*dense)[BP_NX] = (const double(*)[BP_NX])source->dense;
    if (theta >= 1.0) memcpy(x, source->next, sizeof source->next);
    else if (source->linearly) bp_rosenbrock_at(&bp_rodas5p, dense, source->x, source->next, theta, x);
    else bp_explicit_at(&bp_dp54, dense, source->x, source->next, theta, x);
    return source->t + theta * source->h;
}

static void lane_source(const bp_job *job, const bp_lane_block *b, int lane, int balls, bp_lane_source *source)
{
    source->n = member_numbers(job, b->who[lane]);
    source->t = b->t[lane];
    source->h = b->h[lane];
    source->linearly = b->linearly;
    get(b->x, lane, source->x, BP_NX);
    get(b->next, lane, source->next, BP_NX);
    const int rows = b->linearly ? bp_rodas5p.dense_rows : 2 + bp_dp54.dense_rows;
    for (int row = 0; row < rows; row++) get(b->dense[row], lane, source->dense[row], BP_NX);
    for (int i = 0; i < BP_POINTS && balls; i++) {
        double x[BP_NX];
        const double t = lane_state(source, (double)i / (BP_POINTS - 1), x);
        bp_ball_quantities(&source->n, t, x, source->balls[i]);
    }
}

/* Add the steps of lanes to the powers of loads, whose means over each step are those of the channels, and to the places of the raceways; see
   bp_add_sectors. */
static void add_passes(const bp_job *job, bp_lane_block *b, const double *add, const double (*mean)[BP_L])
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
        get(b->x, lane, x, BP_NX);
        bp_passes(b->t[lane], x, n.u, n.p, n.c, from);
        get(b->next, lane, x, BP_NX);
        bp_passes(b->t[lane] + b->h[lane], x, n.u, n.p, n.c, to);
        for (int k = 0; k < BP_POWERS * BP_BEARINGS; k++) {
            const double turned = bp_turned(from + 2 * (k / BP_POWERS), to + 2 * (k / BP_POWERS));
            b->integral[(BP_LOOKED_AT + k) * BP_L + lane] += turned * mean[k][lane];
        }
#define BP_ADD(b_)                                                                                                                      \
        for (int j = 0; j < BP_##b_##_BALLS; j++) {                                                                                     \
            const double total = sum[BP_##b_##_FIRST_BALL + j][lane];                                                                   \
            if (total > 0.0)                                                                                                            \
                bp_add_places(sectors + 2 * BP_SECTORS * (b_), (double)j / BP_##b_##_BALLS,                                             \
                              bp_turned(from + 2 * (b_), to + 2 * (b_)) * total, moment[BP_##b_##_FIRST_BALL + j][lane] / total,        \
                              from + 2 * (b_), to + 2 * (b_));                                                                          \
        }
        BP_EACH_BEARING(BP_ADD)
#undef BP_ADD
    }
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
        bp_lane_ball_channels(&b->numbers, &b->angles, theta, b->t, b->h, y, b->powers, y + BP_NX * BP_L, b->first[q]);
    }
    double news[BP_CHANNELS][BP_L] BP_ALIGNED, any[BP_L] BP_ALIGNED = {0.0}, of_balls[BP_L] BP_ALIGNED = {0.0};
    double power[BP_POWERS * BP_BEARINGS + 1][BP_L] BP_ALIGNED = {{0.0}};
    for (int k = 0; k < BP_CHANNELS; k++) {
        if (b->wanted[k] == 0.0) continue;
        double *restrict of = news[k];
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
            if (k >= BP_LOOKED_AT) {
                power[k - BP_LOOKED_AT][lane] = sum;
                continue;
            }
            b->integral[row + lane] += add[lane] != 0.0 ? b->h[lane] * sum : 0.0;
            b->square[row + lane] += add[lane] != 0.0 ? b->h[lane] * squares : 0.0;
            const double above = high > b->maximum[row + lane] ? 1.0 : 0.0, below = low < b->minimum[row + lane] ? 1.0 : 0.0;
            of[lane] = add[lane] * (above + 2.0 * below);
            any[lane] += of[lane];
            of_balls[lane] += k < BP_NX ? 0.0 : of[lane];
        }
    }
    for (int lane = 0; lane < BP_L; lane++) {
        if (any[lane] == 0.0) continue;
        double *reduction = job->reductions + b->who[lane] * BP_REDUCTION;
        bp_lane_source source;
        lane_source(job, b, lane, of_balls[lane] != 0.0, &source);
        const double(*balls)[BP_BALL_QUANTITIES] = (const double(*)[BP_BALL_QUANTITIES])source.balls;
        const bp_within step = {b->start[lane] + b->t[lane], b->h[lane], &source.n, lane_state, &source, balls};
        for (int k = 0; k < BP_CHANNELS; k++) {
            if (b->wanted[k] == 0.0) continue;
            const double *v = b->sampled[0] + k * BP_L + lane;
            if (news[k][lane] == 1.0 || news[k][lane] == 3.0) bp_extreme(reduction, BP_MAX, k, 1.0, v, BP_CHANNELS * BP_L, &step);
            if (news[k][lane] >= 2.0) bp_extreme(reduction, BP_MIN, k, -1.0, v, BP_CHANNELS * BP_L, &step);
            b->maximum[k * BP_L + lane] = reduction[BP_MAX + k];
            b->minimum[k * BP_L + lane] = reduction[BP_MIN + k];
        }
    }
    if (b->powers) add_passes(job, b, add, (const double(*)[BP_L])power);
    for (int lane = 0; lane < BP_L; lane++)
        if (add[lane] != 0.0) job->reductions[b->who[lane] * BP_REDUCTION + BP_DURATION] += b->h[lane];
    for (int k = 0; k < BP_CHANNELS; k++)
        BP_EACH_LANE {
            const int i = k * BP_L + lane;
            b->sampled[0][i] = add[lane] != 0.0 ? b->sampled[BP_POINTS - 1][i] : b->sampled[0][i];
        }
}

#endif
