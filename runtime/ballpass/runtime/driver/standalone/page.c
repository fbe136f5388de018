/* What a page asks of an instance besides ballpass.h and simulation.h: all that it draws. */
#include "scene.h"
#include "simulation.h"

/* Written for the scene: points of the linkage, angles of the cages, the same as the rings see them, inputs. */
void scene_drawn(double t, const double *x, const double *u, const double *p, const double *c, double *drawn);

/* These at the time reached. */
void ballpass_drawn(const ballpass *simulation, double *drawn)
{
    double u[SCENE_INPUTS > 0 ? SCENE_INPUTS : 1] = {0.0}, middle;
    const double *p = ballpass_values(simulation);
    ballpass_segment(simulation, &middle);
    /* inputs that belong to this very time */
    schedule_inputs(scene_inputs, SCENE_INPUTS, p, ballpass_time(simulation), middle, u);
    scene_drawn(0.0, ballpass_states(simulation), u, p, p + SCENE_PARAMETERS, drawn);
}

/* Written for the scene: loads of an element for a life of a million turns of inner and outer ring, of each bearing [N]. */
void scene_ratings(const double *p, const double *c, double *ratings);

void ballpass_ratings(const ballpass *simulation, double *ratings)
{
    const double *p = ballpass_values(simulation);
    scene_ratings(p, p + SCENE_PARAMETERS, ratings);
}
