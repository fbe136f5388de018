/* What a page asks of an instance besides ballpass.h and simulation.h: all that it draws. */
#include "scene.h"
#include "simulation.h"

/* Written for the scene: points of the linkage, angles of the cages, the same as the rings see them, inputs. */
void scene_drawn(double t, const double *x, const double *u, const double *p, const double *c, double *drawn);

/* What ballpass_read gives at the time reached and, behind it, what is written for the scene. */
static int read_row(ballpass *simulation, double *row)
{
    const int fault = ballpass_read(simulation, row);
    if (fault) return fault;
    double u[SCENE_INPUTS > 0 ? SCENE_INPUTS : 1] = {0.0}, middle;
    const double *p = ballpass_values(simulation);
    ballpass_segment(simulation, &middle);
    /* inputs that belong to this very time */
    schedule_inputs(&scene_schedule, p, ballpass_time(simulation), middle, u);
    scene_drawn(0.0, ballpass_states(simulation), u, p, p + SCENE_PARAMETERS, row + ballpass_columns());
    return BALLPASS_OK;
}

/* Rows of `width` numbers at `count` of the times that divide `whole` into equal parts, from the first one on; for a time that has passed
   the time reached. */
int ballpass_rows(ballpass *simulation, double whole, double parts, double first, int count, int width, double *rows)
{
    int fault = BALLPASS_OK;
    for (int k = 0; k < count && !fault; k++) {
        const double time = whole * ((first + k) / parts), reached = ballpass_time(simulation);
        fault = ballpass_run_to(simulation, time > reached ? time : reached);
        if (!fault) fault = read_row(simulation, rows + (size_t)k * (size_t)width);
    }
    return fault;
}

/* Written for the scene: loads of an element for a life of a million turns of inner and outer ring, of each bearing [N]. */
void scene_ratings(const double *p, const double *c, double *ratings);

void ballpass_ratings(const ballpass *simulation, double *ratings)
{
    const double *p = ballpass_values(simulation);
    scene_ratings(p, p + SCENE_PARAMETERS, ratings);
}
