/* Derivatives of a run's rates and outputs where it is, along one direction. */
#ifndef BALLPASS_TANGENTS_H
#define BALLPASS_TANGENTS_H

#include "ballpass.h"

/* Derivatives of states. */
void scene_rates(double t, const double *x, const double *u, const double *p, const double *c, double *rates);

/* Those of the derived constants, and of rates and outputs one behind the other, along directions. */
void scene_constants_tangent(const double *p, const double *dp, double *dc);
void scene_tangent(double t, const double *x, const double *u, const double *p, const double *c, const double *dt, const double *dx, const double *du,
                   const double *dp, const double *dc, double *moved);

/* The same of a simulation, along a direction of time, states and parameters.  Angles of driver and cages follow the parameters that make
   them at fixed time, except for those that may change in a run: a shaft whose speed is set continues from its angle. */
void ballpass_tangent(const ballpass *simulation, double dt, const double *dx, const double *dp, double *moved);

/* Adds the effect of one of the parameters to a direction of the initial states. */
void ballpass_initial_tangent(const ballpass *simulation, const double *dp, double *dx);

#endif
