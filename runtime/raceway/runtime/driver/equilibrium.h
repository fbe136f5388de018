/* The quasi-static model's interface: one call follows the rings' equilibrium through any number of segments.

   At each instant the positions q solve a(q, v = 0, t) = 0, the generated accelerations with the rings at rest; the velocities are the time
   derivative of q by the implicit function theorem, A v + da/dt = 0 with A = da/dq.  Inertia and the motion of the rings do not act:
   reductions of the balls' forces are those of rings at rest, which balance the load.
   Segments are those of stepper.h; where the load jumps between two of them, so does the equilibrium.

   No static state, no allocation: callable from many threads at once. */
#ifndef RACEWAY_EQUILIBRIUM_H
#define RACEWAY_EQUILIBRIUM_H

#include "stepper.h"

enum raceway_equilibrium_status {
    RACEWAY_EQUILIBRIUM_DONE = 0,
    RACEWAY_EQUILIBRIUM_TOO_MANY_STEPS = 1, /* max_steps reached */
    RACEWAY_EQUILIBRIUM_NONE = 2,           /* no position balances the load */
    RACEWAY_EQUILIBRIUM_FREE = 3,           /* positions around it balance the load as well: nothing holds a ring */
    RACEWAY_EQUILIBRIUM_BAD_ARGUMENT = 4    /* times out of order, start not finite */
};

typedef struct {
    long max_steps;          /* accepted and rejected */
    const double *tolerance; /* error allowed between the instants, for each state */
    double *reduction;       /* on-line reductions, see reductions.h; NULL: none */
} raceway_equilibrium_options;

typedef struct {
    int status;      /* enum raceway_equilibrium_status */
    long segment;    /* segment in which the run ended */
    long written;    /* output times reached */
    long steps;      /* accepted */
    long rejected;
    long iterations; /* of Newton's method, each with one evaluation of accelerations and Jacobian */
    long jumps;      /* instants within segments at which the equilibrium jumps */
    double time;     /* reached [s] */
} raceway_equilibrium_result;

/* Follow the equilibrium.  x: a state to start the search from, on return the last one; the rest as for raceway_run. */
RACEWAY_EXPORT int raceway_equilibria(const raceway_equilibrium_options *options, const double *p, const double *c, double *x, long segments,
                                      const double *times, const double *inputs, long outputs, const double *output_times,
                                      double *output_states, raceway_equilibrium_result *result);

/* Sizes the library was compiled for: states, inputs, parameters, constants, numbers in a reduction; bytes of options and result. */
RACEWAY_EXPORT void raceway_equilibrium_sizes(int *sizes);

#endif
