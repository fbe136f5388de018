/* The ensembles' interface: one call integrates any number of members, BP_LANES of them at a time.

   Every member has its own parameters, segments, step sizes and method; a lane whose member is done takes the next one.  A member's numbers
   do not depend on its neighbours, so results are the same bits however members are spread over calls and threads.

   A run may be cut at the ends of its segments: a call can go on where another has ended, with what members carry over in their results and
   in the work space.  Steps and bits are those of a run in one call, so a run of any length needs memory for a stretch of it only.

   No static state, no allocation: callable from many threads at once. */
#ifndef BALLPASS_ENSEMBLE_H
#define BALLPASS_ENSEMBLE_H

#include "schedule.h"
#include "stepper.h"

enum { BALLPASS_STOPPED = 5 }; /* status of members that were under way when the caller asked to stop */

typedef struct {
    int method;               /* its number */
    int resume;               /* nonzero: go on behind an earlier call with the same x, reductions, work and results */
    const long *max_steps;    /* of each member, accepted and rejected, in all its calls */
    const volatile int *stop; /* the call ends soon after this becomes nonzero; or NULL */
    volatile double *reached; /* how far each member has come, written now and then while the call is under way [s]; or NULL */
} ballpass_ensemble_options;

/* Integrate members from x to the ends of their last segments.

   members      number of members; their rows follow each other in every array
   p, c         parameters, derived constants
   tolerance    error allowed in a step, [members][states]; a member's status is BALLPASS_BAD_ARGUMENT where one is not positive, where its
                times are out of order and where it has fewer than no segments
   x            states; on return those reached
   first        first segment of each member, [members + 1]
   times        ends of the segments, [segments + 1] values a member: those of member m start at first[m] + m [s]
   inputs       u of each segment
   restarts     1 where the load jumps at the segment's start; of a member's first segment in a call that continues, against the last one of
                the call before
   reductions   rows of ballpass_reduction_size() numbers, head filled in (see reductions.h), or NULL
   work         ballpass_ensemble_work(members) bytes, aligned for double
   results      one for each member; `written` is not used.  In a call that continues, counts are added to, and members that ended otherwise
                than done stay as they are, and so do those without segments in this call */
BALLPASS_EXPORT int ballpass_ensemble(const ballpass_ensemble_options *options, long members, const double *p, const double *c,
                                    const double *tolerance, double *x, const long *first, const double *times, const double *inputs,
                                    const unsigned char *restarts, double *reductions, void *work, ballpass_result *results);

/* Magnitudes of the states, [members][states], from inputs at moments spread over each member's run.

   first        first moment of each member, [members + 1]
   inputs       u at each moment
   horizons     a turn, or the run [s]: bounds the travel of a body that nothing holds */
BALLPASS_EXPORT void ballpass_ensemble_magnitudes(long members, const double *p, const double *c, const double *initial, const long *first,
                                                const double *inputs, const double *horizons, double *magnitudes);

BALLPASS_EXPORT long ballpass_ensemble_work(long members);

/* What the segments of members are made of: the model's inputs and turnings, and the numbers these name, [members][columns]. */
typedef struct {
    schedule_scene scene;
    int columns;
    long members;
    const double *values;
} ballpass_schedule;

/* Ends of the segments of so many windows of each run from the number `window` on: a window is so many turns, and of a run that is over
   there is its end alone.

   durations, turns of the runs, and of a turn, which may be infinite [s]
   starts          where reductions start: an edge [s]
   room            numbers of segments that `times` has room for; zero: only the most that there can be are counted
   first, times    as for ballpass_ensemble
   Returns the number of segments, or the most; -1 where memory is short. */
BALLPASS_EXPORT double ballpass_schedule_edges(const ballpass_schedule *schedule, const double *durations, const double *turns,
                                               const double *starts, double turns_a_window, long window, long windows, double room,
                                               long *first, double *times);

/* Inputs of so many segments that start at `t`, of the members `owner`; gates and slopes hold for a time `inside`. */
BALLPASS_EXPORT void ballpass_schedule_inputs(const ballpass_schedule *schedule, long count, const long *owner, const double *t,
                                              const double *inside, double *u);

/* Inputs at the moments that magnitudes are taken from, with the first row of each member; returns the number of rows. */
BALLPASS_EXPORT long ballpass_schedule_moments(const ballpass_schedule *schedule, const long *first, const double *times,
                                               const double *horizons, long *rows, double *u);

/* Numbers in a reduction, its channels, the lanes of this library; bytes of the options, of a schedule, of an input and a turning in it. */
BALLPASS_EXPORT void ballpass_ensemble_sizes(int *sizes);

#endif
