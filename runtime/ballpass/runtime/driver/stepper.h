/* The stepper's interface: one call integrates a run over any number of segments.

   A segment is a stretch of time within which the inputs u are constant; its clock starts at zero.  The driver lands on every
   segment's end exactly, so that a load never switches within a step.

   Compiled with BALLPASS_LOCATED, no step straddles a kink of the law (kinks.h); without, error control steps over them.

   No static state, no allocation: callable from many threads at once. */
#ifndef BALLPASS_STEPPER_H
#define BALLPASS_STEPPER_H

#ifdef _WIN32
#define BALLPASS_EXPORT __declspec(dllexport)
#else
#define BALLPASS_EXPORT __attribute__((visibility("default")))
#endif

enum { BALLPASS_AUTO = 0 }; /* the choice among methods; the others have the numbers of method_tables.h */

enum ballpass_status {
    BALLPASS_DONE = 0,
    BALLPASS_TOO_MANY_STEPS = 1, /* max_steps reached */
    BALLPASS_STEP_TOO_SMALL = 2, /* the error test fails at the smallest step */
    BALLPASS_NOT_FINITE = 3,     /* the state or its rate is not a number even for the smallest step */
    BALLPASS_STALLED = 5,        /* the driver returns to the edge of a window many times */
    BALLPASS_PAUSED = 6,         /* all output times are written, and the step that passed the last is kept (`pause`) */
    BALLPASS_BAD_ARGUMENT = 4    /* method unknown, times out of order, an output time outside the run, a count below zero, a tolerance or a
                                   largest step that is not positive, another step that is negative; a number that is none */
};

typedef struct {
    int method;              /* its number */
    long max_steps;          /* accepted and rejected */
    double first_step;       /* [s]; 0: estimated */
    double smallest_step;    /* [s] */
    double largest_step;     /* [s] */
    const double *tolerance; /* error allowed in a step for each state */
    double *reduction;       /* on-line reductions, see reductions.h; NULL: none.  Only with BALLPASS_REDUCTIONS */
    void *work;              /* keeps a run that has taken all its steps, so that a later call can continue it; NULL: it is not kept */
    int resume;              /* nonzero: continue the run kept there */
    double *before;          /* reductions of the time before the one where `reduction` begins; NULL: none */
    int pause;               /* nonzero, with `work`: end with the step that passes the last output time, before x moves on */
    double *kept;            /* filled with each accepted step, from which ballpass_states_at takes states; NULL: not written */
    long *keeps;             /* how many there are so far, which the caller sets to zero: room for max_steps of a call */
} ballpass_options;

typedef struct {
    int status;          /* enum ballpass_status */
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
} ballpass_result;

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

   With `work`, of the size that ballpass_sizes returns and aligned for double, a run may be made in several calls: one that ends for
   having taken max_steps is followed by one with `resume`, more steps, and all else as the first left it, x, reduction and result as
   well.  Counts are those of all calls, max_steps too, and every bit is that of a run in one call.  Not for runs with derivatives.
   With `pause` as well, the next call brings output times of its own, none below those before, and result->written = 0; those within the
   step that was kept are read from its dense output.  x is where that step started. */
BALLPASS_EXPORT int ballpass_run(const ballpass_options *options, const double *p, const double *c, double *x, long segments,
                               const double *times, const double *inputs, const unsigned char *restarts, long outputs,
                               const double *output_times, double *output_states, ballpass_result *result);

/* States at times of a run whose steps were kept, the same bits as its outputs there; row after row.  Of each step its end [s] comes first,
   then 1 where it lies on a kink, else 0. */
BALLPASS_EXPORT void ballpass_states_at(const double *kept, long steps, long outputs, const double *output_times, double *output_states);

/* Directions along which a run is differentiated, BP_LANES to a block; entries of a block lie next to each other. */
typedef struct {
    long blocks;
    const double *p;     /* of the parameters, [blocks][BP_NP][BP_LANES] */
    const double *c;     /* of the derived constants, [blocks][BP_NC][BP_LANES] */
    const double *u;     /* of the inputs, [segments][blocks][BP_NU][BP_LANES] */
    const double *shift; /* of the time at which a load switches at each segment's start, [segments][blocks][BP_LANES] [s] */
    const double *moved; /* of the times along which it is differentiated (sensitivity.h), at each start, [segments][blocks][BP_LANES] [s] */
    const double *stretch; /* and how fast they grow with time, [blocks][BP_LANES] */
    double *x;           /* of the states at fixed time, [blocks][BP_NX][BP_LANES]: at the start, on return where the run ended */
    double *outputs;     /* the same at the output times, [outputs][blocks][BP_NX][BP_LANES], or NULL */
    void *work;          /* ballpass_tangent_work(blocks) bytes, aligned for double */
    /* Where the derivatives take part in the choice of the step size: 1 / error allowed in a step, [blocks][BP_NX][BP_LANES], zero for
       directions that do not count, and the relative tolerance in it, for derivatives that have grown beyond 1 / (rtol weight).
       Else NULL. */
    const double *weight;
    double rtol;
} ballpass_tangents;

#ifdef BALLPASS_SENSITIVITIES
/* The same run with its derivatives. */
BALLPASS_EXPORT int ballpass_run_tangents(const ballpass_options *options, const double *p, const double *c, double *x, long segments,
                                        const double *times, const double *inputs, const unsigned char *restarts, long outputs,
                                        const double *output_times, double *output_states, const ballpass_tangents *tangents,
                                        ballpass_result *result);
BALLPASS_EXPORT long ballpass_tangent_work(long blocks);
#endif

/* Magnitudes of the states of a run, which tolerances are relative to (scales.h).

   inputs       u at so many moments spread over the run, row after row
   horizon      a turn, or the run: bounds the travel of a body that nothing holds [s] */
BALLPASS_EXPORT void ballpass_magnitudes(const double *p, const double *c, const double *initial, long moments, const double *inputs,
                                       double horizon, double *magnitude);

/* Sizes the library was compiled for: states, inputs, parameters, constants, balls, lanes; bytes of the work of a run in several calls;
   numbers of a step that is kept; bytes of options, result and tangents. */
BALLPASS_EXPORT void ballpass_sizes(int *sizes);

#endif
