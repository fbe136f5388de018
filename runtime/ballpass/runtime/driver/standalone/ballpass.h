/* The scene as a library: make an instance, set parameters, start, run to a time, read.

       ballpass *press = ballpass_make();
       double columns[64];                                         // ballpass_columns() of them
       ballpass_set(press, "bearing.clearance", 20e-6);            // [m]; all numbers are SI
       if (ballpass_start(press, NULL) != BALLPASS_OK) puts(ballpass_error(press));
       for (int k = 1; k <= 100; k++) {
           if (ballpass_run_to(press, 1e-3 * k) != BALLPASS_OK) puts(ballpass_error(press));
           ballpass_read(press, columns);                          // time, states, outputs
       }
       ballpass_free(press);

   Any number of instances, each of them for one thread at a time; there is no static state.  How often a run is read does not change it:
   its results equal those of an uninterrupted run to the bit.  For C99 and C++. */
#ifndef BALLPASS_H
#define BALLPASS_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* One simulation of the scene. */
typedef struct ballpass ballpass;

/* Result of a call; for all but BALLPASS_OK, ballpass_error has the reason. */
enum ballpass_answer {
    BALLPASS_OK = 0,
    BALLPASS_FAILED = 1, /* the computation failed: the motion is no longer finite, the memory is too small, ... */
    BALLPASS_REFUSED = 2 /* a name, number or order of calls that is not allowed; nothing was changed */
};

/* How to run.  ballpass_default fills it with the scene's settings; change what should differ. */
typedef struct {
    double begin, end; /* of the run [s]; magnitudes, which tolerances are relative to, are those of this time */
    double rtol;       /* error allowed in a step, relative to the magnitudes of the states; 1e-13 to 0.1 */
    int method;        /* 0 auto; the others from 1 on, in the order of --help */
    int located;       /* 1: steps end on the kinks of the laws; 0: they are stepped over; -1: as in Python, by the tolerance */
} ballpass_request;

/* A new instance with the scene's parameters; NULL where the memory is too small.  Free it with ballpass_free, which takes NULL as well. */
ballpass *ballpass_make(void);
void ballpass_free(ballpass *simulation);

/* Parameters: how many, and of each name, unit and description; place of a name, -1 where there is none. */
int ballpass_parameters(void);
const char *ballpass_parameter(int place, const char **unit, const char **description);
int ballpass_place(const char *name);

/* Value of a parameter [SI].  Before ballpass_start any may be set; in a run those that ballpass_varies names: forces, torques, loads,
   speed of a shaft.  They hold from the time reached on; a shaft whose speed is set continues from its angle. */
int ballpass_set(ballpass *simulation, const char *name, double value);
int ballpass_set_at(ballpass *simulation, int place, double value);
int ballpass_get(ballpass *simulation, const char *name, double *value);
double ballpass_value(const ballpass *simulation, int place);
int ballpass_varies(int place);

/* Of a driver whose scene has a table of its speed: the speed that it reaches at the end of the coming ballpass_run_to, which it goes to at a
   constant acceleration [rad/s].  The table is out of use from then on. */
int ballpass_drive(ballpass *simulation, double speed);

/* Speed of the driver or shaft at the time reached [rad/s]; 0 where a torque drives, or nothing is turned. */
double ballpass_driver_speed(const ballpass *simulation);

/* Turns that driver or shaft makes from t = 0 to a time, in either sense; the time that it takes for so many, infinite where it never makes
   them.  Where a torque drives, at its first speed. */
double ballpass_turns(const ballpass *simulation, double time);
double ballpass_after(const ballpass *simulation, double turns);

/* The scene's run, of the parameters that are set. */
ballpass_request ballpass_default(const ballpass *simulation);

/* Begin a run in the scene's initial state; NULL asks for the scene's own.  Checks all numbers, and that the linkage can be assembled.  An
   instance may be started again, with the parameters that it has. */
int ballpass_start(ballpass *simulation, const ballpass_request *request);

/* Bring the run to a time, not before the one reached [s].  It may go beyond the end that was asked for. */
int ballpass_run_to(ballpass *simulation, double time);

/* Time, states and outputs that the run has reached: how many numbers, their names and units, and the numbers. */
int ballpass_columns(void);
const char *ballpass_column(int column, const char **unit);
int ballpass_read(ballpass *simulation, double *columns);

/* The next time at which a load switches, after the time reached [s]; infinite where none does before the run's end. */
double ballpass_next_switch(ballpass *simulation);

/* A copy of all data of an instance, in so many bytes, for instances of the same program on machines of the same kind.  A run that
   continues from it has the same bits. */
size_t ballpass_state_size(void);
void ballpass_save(const ballpass *simulation, void *bytes);
int ballpass_restore(ballpass *simulation, const void *bytes, size_t size);

/* Why the last call did not return BALLPASS_OK, one line for each fault; "" where it did. */
const char *ballpass_error(const ballpass *simulation);

#ifdef __cplusplus
}
#endif

#endif
