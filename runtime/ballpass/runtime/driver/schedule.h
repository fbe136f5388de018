/* Segments of a run: the times at which loads switch, and the inputs between them. */
#ifndef SCHEDULE_H
#define SCHEDULE_H

/* An angle that is known before a run.  Numbers are named by their place among parameters and, behind these, derived constants; -1: none.

   It is `offset` at t = 0 and grows at `rate`; or, where there are `turns` or rows, it makes so many turns in one of the driver, whose speeds
   are linear between the rows and constant outside (one speed without rows: constant), less the lag of a cage: `lag` at t = 0, and from then
   on `rolling` times the driver's speed times the slope of `lags`.
   `live` is the place of three numbers more: where the first is finite, it is a time from which on the driver turns with the speed and
   acceleration behind it, and the offset is the angle then. */
typedef struct {
    int offset, rate, turns, rolling, lag, live;
    int rows;
    const int *times, *speeds; /* [rows], [rows, or 1] */
    int lag_rows;
    const int *lag_times, *lags; /* [lag_rows] */
} schedule_turning;

enum schedule_kind { SCHEDULE_PHASE, SCHEDULE_ANGLE, SCHEDULE_RATE, SCHEDULE_SLOPE, SCHEDULE_GATE, SCHEDULE_TABLE, SCHEDULE_TABLE_RATE, SCHEDULE_BORDER };

/* An input that is constant within a segment.

   phase        the angle of its turning at the segment's start, within a turn [rad]; angle: with whole turns; rate, slope: the rate there,
                and the slope of that
   gate         1 while `parts` times that angle lies in one of the windows, else 0
   table        value of the piecewise linear table at the segment's start
   table rate   its slope there
   border       0: of a switching function of the state
   A table with a turning is one over that angle, periodic over `turns` turns; others are over time. */
typedef struct {
    enum schedule_kind kind;
    int turning, turns, parts;
    int windows;       /* number of pairs start, end in `edges` */
    const int *edges;  /* [2 windows] */
    int knots;         /* number of entries in `times` and `heights` */
    const int *times;  /* [knots] */
    const int *heights; /* [knots] */
} schedule_input;

/* The inputs of a scene and what turns in it. */
typedef struct {
    const schedule_input *inputs;
    int count;
    const schedule_turning *turnings;
    int turning_count;
} schedule_scene;

/* Angle of a turning at a time [rad], and its rate [rad/s]; each may be NULL. */
void schedule_angle(const schedule_turning *turning, const double *values, double t, double *angle, double *rate);

/* Turns that a turning makes from t = 0 until `end`, in either sense; where it makes so many as `most` before, `end` becomes that time. */
double schedule_turns(const schedule_turning *turning, const double *values, double most, double *end);

/* The most segments that a run may have, counted before any is made.

   length, turn    of the run and of a turn [s]; the turn may be infinite */
double schedule_most_segments(const schedule_scene *scene, const double *values, double length, double turn);

/* Ends of the segments of a run: its begin, every time at which a gate switches or a table has a knot, whole turns, its end, and more
   where a phase would get so large between two that its sine loses digits.

   scene           the model's inputs and turnings
   values          parameters and derived constants
   turn            time of a turn [s], or infinity
   edges           on return memory with them, increasing [s]; the caller frees it
   Returns the number of segments, or -1 where the memory is too small. */
long schedule_edges(const schedule_scene *scene, const double *values, double begin, double end, double turn, double **edges);

/* Moments of a run for magnitudes: so many between its edges, and so many evenly spread. */
enum { SCHEDULE_MOMENTS = 32 };

/* Inputs at the moments of a run.

   edges, segments those of the run
   horizon         a turn, or the run, that moments are evenly spread over [s]
   u               on return the inputs, row after row: [2 SCHEDULE_MOMENTS][count, or 1 where there are none]
   Returns the number of moments. */
int schedule_moments(const schedule_scene *scene, const double *values, const double *edges, long segments, double horizon,
                     double *u);

/* Inputs for a segment that starts at t; `inside` is a time within it, for which gates and slopes hold. */
void schedule_inputs(const schedule_scene *scene, const double *values, double t, double inside, double *u);

/* Derivatives of these inputs along a direction of the values, at fixed times; gates have none. */
void schedule_tangents(const schedule_scene *scene, const double *values, const double *moved, double t, double inside, double *ud);

/* The first table whose knots do not increase, or not within a turn of their angle; -1 where all are right. */
int schedule_fault(const schedule_scene *scene, const double *values);

#endif
