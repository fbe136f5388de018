/* The stepper's interface: one call integrates a run over any number of segments.

   A segment is a stretch of time within which the inputs u are constant; its clock starts at zero.  The driver lands on every
   segment's end exactly, so that a load that switches there never hides inside a step.

   Compiled with RACEWAY_LOCATED, no step straddles a kink of the law (kinks.h); without, error control steps over them.

   No static state, no allocation: callable from many threads at once. */
#ifndef RACEWAY_STEPPER_H
#define RACEWAY_STEPPER_H

#ifdef _WIN32
#define RACEWAY_EXPORT __declspec(dllexport)
#else
#define RACEWAY_EXPORT __attribute__((visibility("default")))
#endif

enum raceway_method {
    RACEWAY_AUTO = 0,
    RACEWAY_RODAS4 = 1,
    RACEWAY_RODAS5P = 2,
    RACEWAY_DP54 = 3,
    RACEWAY_DOP853 = 4
};

enum raceway_status {
    RACEWAY_DONE = 0,
    RACEWAY_TOO_MANY_STEPS = 1, /* max_steps reached */
    RACEWAY_STEP_TOO_SMALL = 2, /* the error test fails at the smallest step */
    RACEWAY_NOT_FINITE = 3,     /* the state or its rate is not a number even for the smallest step */
    RACEWAY_BAD_ARGUMENT = 4    /* method unknown, times out of order, an output time outside the run, a count below zero, a tolerance or a
                                   largest step that is not positive, another step that is negative; a number that is none */
};

typedef struct {
    int method;              /* enum raceway_method */
    long max_steps;          /* accepted and rejected */
    double first_step;       /* [s]; 0: estimated */
    double smallest_step;    /* [s] */
    double largest_step;     /* [s] */
    const double *tolerance; /* error allowed in a step for each state */
    double *reduction;       /* on-line reductions, see reductions.h; NULL: none.  Only with RACEWAY_REDUCTIONS */
    void *work;              /* keeps a run that has taken all its steps, so that a later call can go on; NULL: it is not kept */
    int resume;              /* nonzero: go on with the run kept there */
} raceway_options;

typedef struct {
    int status;          /* enum raceway_status */
    int method;          /* the method of the last segment */
    int state;           /* state whose error or value ended the run, -1 if none */
    long segment;        /* segment in which the run ended */
    long written;        /* output times reached */
    long steps;          /* accepted */
    long rejected;
    long evaluations;    /* of the right-hand side */
    long factorizations; /* of the iteration matrix */
    long pivoted;        /* of these, with pivoting */
    long switches;       /* changes of method */
    long kinks;          /* located: steps that end on one, and turns of a side where a step began */
    double time;         /* reached [s] */
    double step;         /* last step size tried [s] */
} raceway_result;

/* Integrate from x to the last segment's end.

   x            states; on return those reached
   segments     number of segments
   times        their ends, [segments + 1] values, increasing [s]
   inputs       u of each, row after row
   restarts     1 where the load jumps at the segment's start: the step size is estimated anew there
   outputs      number of output times
   output_times none below the one before, from the run's begin to its end; of a run of no segments, 0 [s]
   output_states row after row, or NULL
   Returns result->status.

   With `work`, of the bytes that raceway_sizes tells and aligned for double, a run may be made in several calls: one that ends for
   having taken max_steps is followed by one with `resume`, more steps, and all else as the first left it, x, reduction and result as
   well.  Counts are those of all calls, max_steps too, and every bit is that of a run in one call.  Not for runs with derivatives. */
RACEWAY_EXPORT int raceway_run(const raceway_options *options, const double *p, const double *c, double *x, long segments,
                               const double *times, const double *inputs, const unsigned char *restarts, long outputs,
                               const double *output_times, double *output_states, raceway_result *result);

/* Directions along which a run is differentiated, RW_LANES to a block; entries of a block lie next to each other. */
typedef struct {
    long blocks;
    const double *p;     /* of the parameters, [blocks][RW_NP][RW_LANES] */
    const double *c;     /* of the derived constants, [blocks][RW_NC][RW_LANES] */
    const double *u;     /* of the inputs, [segments][blocks][RW_NU][RW_LANES] */
    const double *shift; /* of the time at which each segment starts, [segments][blocks][RW_LANES] [s] */
    double *x;           /* of the states, [blocks][RW_NX][RW_LANES]: at the start, on return at the end */
    double *outputs;     /* at the output times, [outputs][blocks][RW_NX][RW_LANES], or NULL */
    void *work;          /* raceway_tangent_work(blocks) bytes, aligned for double */
    /* Where the derivatives take part in the choice of the step size: 1 / error allowed in a step, [blocks][RW_NX][RW_LANES], zero for
       directions that do not count, and the relative tolerance in it, for derivatives that have grown beyond 1 / (rtol weight).
       Else NULL. */
    const double *weight;
    double rtol;
} raceway_tangents;

#ifdef RACEWAY_SENSITIVITIES
/* The same run with its derivatives. */
RACEWAY_EXPORT int raceway_run_tangents(const raceway_options *options, const double *p, const double *c, double *x, long segments,
                                        const double *times, const double *inputs, const unsigned char *restarts, long outputs,
                                        const double *output_times, double *output_states, const raceway_tangents *tangents,
                                        raceway_result *result);
RACEWAY_EXPORT long raceway_tangent_work(long blocks);
#endif

/* Magnitudes of the states of a run, which tolerances are relative to (scales.h).

   inputs       u at so many moments spread over the run, row after row
   horizon      a turn, or the run: bounds the travel of a body that nothing holds [s] */
#ifndef RACEWAY_LOCATED
RACEWAY_EXPORT void raceway_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *inputs,
                                       double horizon, double *magnitude);
#endif

/* Sizes the library was compiled for: states, inputs, parameters, constants, balls, lanes; bytes of the work of a run in several calls, of
   options, result and tangents. */
RACEWAY_EXPORT void raceway_sizes(int *sizes);

#endif
