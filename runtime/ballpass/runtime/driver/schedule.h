/* Segments of a run: the times at which loads switch, and the inputs between them. */
#ifndef SCHEDULE_H
#define SCHEDULE_H

enum schedule_kind { SCHEDULE_PHASE, SCHEDULE_GATE, SCHEDULE_TABLE, SCHEDULE_TABLE_RATE, SCHEDULE_BORDER };

/* An input that is constant within a segment.  Numbers are named by their place among parameters and, behind these, derived constants.

   phase        the angle offset + rate t at the segment's start [rad]
   gate         1 while that angle, plus a table over time where there are knots, lies in one of the windows, else 0
   table        value of the piecewise linear table at the segment's start
   table rate   its slope there
   border       0: of a switching function of the state
   A table with a rate is one over that angle, periodic over a turn; others are over time. */
typedef struct {
    enum schedule_kind kind;
    int offset, rate;
    int windows;       /* number of pairs start, end in `edges` */
    const int *edges;  /* [2 windows] */
    int knots;         /* number of entries in `times` and `heights` */
    const int *times;  /* [knots] */
    const int *heights; /* [knots] */
} schedule_input;

/* The most segments that a run may have, counted before any is made.

   length, turn    of the run and of a turn [s]; the turn may be infinite */
double schedule_most_segments(const schedule_input *inputs, int count, const double *values, double length, double turn);

/* Ends of the segments of a run: its begin, every time at which a gate switches or a table has a knot, whole turns, its end, and more
   where a phase would get so large between two that its sine loses digits.

   inputs, count   the model's inputs
   values          parameters and derived constants
   turn            time of a turn [s], or infinity
   edges           on return memory with them, increasing [s]; the caller frees it
   Returns the number of segments, or -1 where the memory is too small. */
long schedule_edges(const schedule_input *inputs, int count, const double *values, double begin, double end, double turn, double **edges);

/* Moments of a run for magnitudes: so many between its edges, and so many evenly spread. */
enum { SCHEDULE_MOMENTS = 32 };

/* Inputs at the moments of a run.

   edges, segments those of the run
   horizon         a turn, or the run, that moments are evenly spread over [s]
   u               on return the inputs, row after row: [2 SCHEDULE_MOMENTS][count, or 1 where there are none]
   Returns the number of moments. */
int schedule_moments(const schedule_input *inputs, int count, const double *values, const double *edges, long segments, double horizon,
                     double *u);

/* Inputs for a segment that starts at t; `inside` is a time within it, for which gates and slopes hold. */
void schedule_inputs(const schedule_input *inputs, int count, const double *values, double t, double inside, double *u);

/* Derivatives of these inputs along a direction of the values, at fixed times; gates have none. */
void schedule_tangents(const schedule_input *inputs, int count, const double *values, const double *moved, double t, double inside, double *ud);

/* The first table whose knots do not increase, or not within a turn of their angle; -1 where all are right. */
int schedule_fault(const schedule_input *inputs, int count, const double *values);

#endif
