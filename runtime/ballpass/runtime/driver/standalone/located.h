/* ballpass_run of stepper.h with steps that end on the kinks of the laws (kinks.h); defined by located.c, for a scene that has some. */
#ifndef BALLPASS_LOCATED_H
#define BALLPASS_LOCATED_H

#include "stepper.h"

BALLPASS_EXPORT int ballpass_run_located(const ballpass_options *options, const double *p, const double *c, double *x, long segments,
                                       const double *times, const double *inputs, const unsigned char *restarts, long outputs,
                                       const double *output_times, double *output_states, ballpass_result *result);
BALLPASS_EXPORT void ballpass_sizes_located(int *sizes);

#endif
