/* See assembly.h: the margins of the dyads over a run, a turn at most, refined around their smallest sample. */
#include "assembly.h"

#include <math.h>

#include "scene.h"
#include "schedule.h"

static const double TURN = 6.283185307179586476925286766559;

/* Margins up to this are no position of the linkage, as in Python. */
static const double DEAD_CENTER = 1e-9;

/* Angles checked in a turn; then sweeps around the smallest, each so many times finer than the one before. */
enum { ANGLES = 720, SWEEPS = 3, FINE = 128 };

/* A margin at a time, from the inputs at t = 0; NaN: it cannot be assembled. */
static double margin_at(const double *values, const double *inputs, int row, double time)
{
    double margins[SCENE_MARGINS];
    scene_margins(time, inputs, values, values + SCENE_PARAMETERS, margins);
    return isnan(margins[row]) ? -INFINITY : margins[row];
}

/* Keeps the smaller of two margins, the earlier of equal ones, with its time. */
static void keep_smaller(double margin, double time, double *worst, double *when)
{
    if (margin >= *worst) return;
    *worst = margin;
    *when = time;
}

void refuse_unassembled(const double *values, double turn, double end, ballpass_faults *faults)
{
    double inputs[SCENE_INPUTS > 0 ? SCENE_INPUTS : 1] = {0.0};
    const int turns = isfinite(turn);
    long angles = ANGLES, repeats = 1;
    for (int i = 0; i < scene_schedule.count; i++) /* gears repeat after several turns */
        if (scene_schedule.inputs[i].kind == SCHEDULE_PHASE && repeats < scene_schedule.inputs[i].turns)
            repeats = scene_schedule.inputs[i].turns;
    angles *= repeats;
    const double last = turns ? fmin(turn * (double)repeats, end) : 0.0;
    schedule_inputs(&scene_schedule, values, 0.0, 0.0, inputs);
    for (int row = 0; row < SCENE_MARGINS; row++) {
        double worst = margin_at(values, inputs, row, 0.0), when = 0.0, reach = last / (double)angles;
        for (long k = 1; turns && k <= angles; k++) {
            const double time = last * (double)k / (double)angles;
            keep_smaller(margin_at(values, inputs, row, time), time, &worst, &when);
        }
        for (int sweep = 0; turns && worst > DEAD_CENTER && sweep < SWEEPS; sweep++) {
            const double middle = when;
            for (int k = -FINE; k <= FINE; k++) {
                const double time = fmin(fmax(middle + reach * k / FINE, 0.0), last);
                keep_smaller(margin_at(values, inputs, row, time), time, &worst, &when);
            }
            reach /= FINE;
        }
        if (worst > DEAD_CENTER) continue;
        double angle = fmod(values[scene_start_angle] + values[scene_speed] * when, TURN);
        if (angle < 0.0) angle += TURN;
        add_fault(faults,
                  "the linkage cannot be assembled at joint %s, worst at crank angle %.2f deg (%s: margin %.4g). Allowed: lengths that "
                  "keep the margin above 1e-9 at all angles of the run. Change those of the bodies that meet at the joint.",
                  scene_margin_infos[row].joint, 360.0 / TURN * angle, scene_margin_infos[row].description, worst);
    }
}
