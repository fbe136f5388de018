/* Segments of many members at once: schedule.h for one after the other.  See ensemble.h. */
#include <math.h>
#include <stdlib.h>

#include "ensemble.h"

/* Fraction of a turn, or of a run that is shorter, within which an edge is where reductions start. */
static const double AT_START = 1e-9;

/* Where a run is cut into windows: the begin of window `w`, the run's end where that is not one of its windows [s]. */
static double window_begin(double w, double turns_a_window, double duration, double turn)
{
    if (w == 0.0) return 0.0;
    const double turns = w * turns_a_window, time = turns * turn, near = AT_START * (turn < duration ? turn : duration);
    return isfinite(turn) && turns < ceil(duration / turn) && time < duration - near ? time : duration;
}

double ballpass_schedule_edges(const ballpass_schedule *schedule, const double *durations, const double *turns, const double *starts,
                               double turns_a_window, long window, long windows, double room, long *first, double *times)
{
    double most = 0.0;
    long segments = 0;
    if (room > 0.0) first[0] = 0;
    for (long m = 0; m < schedule->members; m++) {
        const double *values = schedule->values + m * schedule->columns;
        const double duration = durations[m], turn = turns[m], start = starts[m];
        const double near = AT_START * (turn < duration ? turn : duration);
        if (room > 0.0) times[segments + m] = window_begin((double)window, turns_a_window, duration, turn);
        for (long w = window; w < window + windows; w++) {
            const double left = window_begin((double)w, turns_a_window, duration, turn);
            const double right = window_begin((double)(w + 1), turns_a_window, duration, turn);
            if (!(left < right)) break;
            /* reductions start on an edge; not a window of its own, whose first step size would be estimated anew */
            const int split = left + near < start && start < right - near;
            most += 1.0 + schedule_most_segments(&schedule->scene, values, right - left, turn);
            for (int part = 0; part <= split && room > 0.0; part++) {
                const double begin = part ? start : left, end = split && !part ? start : right;
                double *edges;
                const long count = schedule_edges(&schedule->scene, values, begin, end, turn, &edges);
                if (count < 0) return -1.0;
                for (long k = 0; k <= count; k++)
                    times[segments + m + k] = !split && fabs(edges[k] - start) <= near ? start : edges[k];
                segments += count;
                free(edges);
            }
        }
        if (room > 0.0) first[m + 1] = segments;
    }
    return room > 0.0 ? (double)segments : most;
}

void ballpass_schedule_inputs(const ballpass_schedule *schedule, long count, const long *owner, const double *t, const double *inside,
                              double *u)
{
    for (long i = 0; i < count; i++)
        schedule_inputs(&schedule->scene, schedule->values + owner[i] * schedule->columns, t[i], inside[i],
                        u + i * schedule->scene.count);
}

long ballpass_schedule_moments(const ballpass_schedule *schedule, const long *first, const double *times, const double *horizons,
                               long *rows, double *u)
{
    const int columns = schedule->scene.count > 0 ? schedule->scene.count : 1;
    rows[0] = 0;
    for (long m = 0; m < schedule->members; m++)
        rows[m + 1] = rows[m] + schedule_moments(&schedule->scene, schedule->values + m * schedule->columns,
                                                 times + first[m] + m, first[m + 1] - first[m], horizons[m], u + rows[m] * columns);
    return rows[schedule->members];
}
