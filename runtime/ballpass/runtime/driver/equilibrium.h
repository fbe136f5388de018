/* The quasi-static model's interface: one call follows the rings' equilibrium through any number of segments.

   At each instant the positions q solve a(q, v = 0, t) = 0, the generated accelerations with the rings at rest; the velocities are the time
   derivative of q by the implicit function theorem, A v + da/dt = 0 with A = da/dq.  Inertia and the motion of the rings do not act:
   reductions of the balls' forces are those of rings at rest, which balance the load.
   Segments are those of stepper.h; where the load jumps between two of them, so does the equilibrium.

   No static state, no allocation: callable from many threads at once. */
#ifndef BALLPASS_EQUILIBRIUM_H
#define BALLPASS_EQUILIBRIUM_H

#include "stepper.h"

enum ballpass_equilibrium_status {
    BALLPASS_EQUILIBRIUM_DONE = 0,
    BALLPASS_EQUILIBRIUM_TOO_MANY_STEPS = 1, /* max_steps reached */
    BALLPASS_EQUILIBRIUM_NONE = 2,           /* no position balances the load */
    BALLPASS_EQUILIBRIUM_FREE = 3,           /* positions around it balance the load as well: nothing holds a ring */
    BALLPASS_EQUILIBRIUM_BAD_ARGUMENT = 4    /* times out of order, start not finite */
};

typedef struct {
    long max_steps;          /* accepted and rejected */
    const double *tolerance; /* error allowed between the instants, for each state */
    double *reduction;       /* on-line reductions, see reductions.h; NULL: none */
} ballpass_equilibrium_options;

typedef struct {
    int status;      /* enum ballpass_equilibrium_status */
    long segment;    /* segment in which the run ended */
    long written;    /* output times reached */
    long steps;      /* accepted */
    long rejected;
    long iterations; /* of Newton's method, each with one evaluation of accelerations and Jacobian */
    long jumps;      /* instants within segments at which the equilibrium jumps */
    double time;     /* reached [s] */
} ballpass_equilibrium_result;

/* Follow the equilibrium.  x: a state to start the search from, on return the last one; the rest as for ballpass_run. */
BALLPASS_EXPORT int ballpass_equilibria(const ballpass_equilibrium_options *options, const double *p, const double *c, double *x, long segments,
                                      const double *times, const double *inputs, long outputs, const double *output_times,
                                      double *output_states, ballpass_equilibrium_result *result);

/* Sizes the library was compiled for: states, inputs, parameters, constants, numbers in a reduction; bytes of options and result. */
BALLPASS_EXPORT void ballpass_equilibrium_sizes(int *sizes);

#endif
