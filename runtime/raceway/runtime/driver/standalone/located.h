/* raceway_run of stepper.h with steps that end on the kinks of the laws (kinks.h); defined by located.c, for a scene that has some. */
#ifndef RACEWAY_LOCATED_H
#define RACEWAY_LOCATED_H

#include "stepper.h"

RACEWAY_EXPORT int raceway_run_located(const raceway_options *options, const double *p, const double *c, double *x, long segments,
                                       const double *times, const double *inputs, const unsigned char *restarts, long outputs,
                                       const double *output_times, double *output_states, raceway_result *result);

#endif
