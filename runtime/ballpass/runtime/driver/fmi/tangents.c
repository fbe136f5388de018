/* See tangents.h. */
#include "tangents.h"

#include "scene.h"
#include "simulation.h"

enum { INPUTS = SCENE_INPUTS > 0 ? SCENE_INPUTS : 1 };

void ballpass_tangent(const ballpass *s, double dt, const double *dx, const double *dp, double *moved)
{
    const double *p = ballpass_values(s), *c = p + SCENE_PARAMETERS;
    double u[INPUTS], du[INPUTS], dc[SCENE_CONSTANTS + 1], middle, values[SCENE_PARAMETERS + SCENE_CONSTANTS + SCENE_TURNINGS + 3] = {0.0};
    const double start = ballpass_segment(s, &middle), t = ballpass_moment(s, u);
    for (int i = 0; i < SCENE_PARAMETERS; i++) values[i] = scene_parameters[i].varies ? 0.0 : dp[i];
    scene_constants_tangent(p, values, values + SCENE_PARAMETERS);
    for (int k = 0; k < SCENE_TURNINGS; k++)
        if (scene_offsets[k] >= 0) values[SCENE_PARAMETERS + SCENE_CONSTANTS + k] = values[scene_offsets[k]];
    du[0] = 0.0;
    schedule_tangents(&scene_schedule, p, values, start, middle, du);
    scene_constants_tangent(p, dp, dc);
    scene_tangent(t, ballpass_states(s), u, p, c, &dt, dx, du, dp, dc, moved);
}

void ballpass_initial_tangent(const ballpass *s, const double *dp, double *dx)
{
    double dc[SCENE_CONSTANTS + 1];
    scene_constants_tangent(ballpass_values(s), dp, dc);
    for (int i = 0; i < SCENE_STATES; i++)
        dx[i] += scene_initial[i] < SCENE_PARAMETERS ? dp[scene_initial[i]] : dc[scene_initial[i] - SCENE_PARAMETERS];
}
