/* Functions of an instance for main.c and the interface of FMI, besides ballpass.h. */
#ifndef BALLPASS_SIMULATION_H
#define BALLPASS_SIMULATION_H

#include "ballpass.h"

/* Sets a parameter that is checked later, with all others. */
void ballpass_put(ballpass *simulation, int place, double value);

/* Checks bounds and relations of all values. */
int ballpass_check_bounds(ballpass *simulation);

/* Parameters and, behind them, derived constants; states and time reached. */
const double *ballpass_values(const ballpass *simulation);
const double *ballpass_states(const ballpass *simulation);
double ballpass_time(const ballpass *simulation);
int ballpass_started(const ballpass *simulation);

/* Ends the run: any parameter may be set again. */
void ballpass_stop(ballpass *simulation);

/* Add every step that a run takes to this row of reductions.h, until another one is given; NULL: to none.
   Only with BALLPASS_REDUCTIONS.  A step that was read within is added when the run continues behind it. */
void ballpass_reduce(ballpass *simulation, double *row);

/* Begin of the segment at the time reached, and its middle [s]. */
double ballpass_segment(const ballpass *simulation, double *middle);

/* Inputs u that hold at the time reached; returns the time since the one they belong to [s]. */
double ballpass_moment(const ballpass *simulation, double *u);

#endif
