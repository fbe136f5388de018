/* See ballpass.h.  A run is cut into segments (schedule.h), these are integrated some hundred to a call of the stepper, and a call is paused
   with the step that passes the time asked for: reading has no influence on the steps. */
#include "ballpass.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assembly.h"
#include "faults.h"
#include "located.h"
#include "scene.h"
#include "simulation.h"
#include "stepper.h"

/* Segments of one call. */
enum { SEGMENTS_A_CALL = 600, SCALED_TURNS = 16 }; /* turns for the magnitudes, as in request/resolve.py */

/* Numbers that segments may take while they are sought, 4 GiB; and how many one takes, in lists that grow twofold. */
static const double MOST_NUMBERS = 536870912.0, SEGMENT_NUMBERS = 6.0;

static const double SMALLEST_RTOL = 1e-13, LARGEST_RTOL = 1e-1;
static const double TURN = 6.283185307179586476925286766559;

/* Times closer than this fraction of the run are one time. */
static const double TIME_RESOLUTION = 1e-12;

static const char *const STATUS[] = {
    "done",
    "too many steps: take a shorter run or a looser tolerance",
    "the step size fell to the resolution of time: the force jumps there, or the motion grows without bound",
    "the motion stopped being finite: check parameters and initial state",
    "the request cannot be run",
    "the driver has stalled: it comes back to the edge of a window again and again",
};

/* Behind the angles of the turnings: since when the driver follows speeds that are set, its speed then, its acceleration. */
enum { ANGLES = SCENE_PARAMETERS + SCENE_CONSTANTS, LIVE = ANGLES + SCENE_TURNINGS, INPUTS = SCENE_INPUTS > 0 ? SCENE_INPUTS : 1 };

/* All independent data of a run. */
typedef struct {
    double values[LIVE + 3];
    int started, changed, failed;
    int driven;    /* whether the driver follows speeds that are set, */
    double wanted; /* to this one */
    ballpass_request asked; /* begin and end: of the time that segments are known for */
    double farther;         /* how much longer that becomes where the end is reached [s] */
    double tolerance[SCENE_STATES];
    long first, segments;   /* of the call at hand, the call's length */
    int begun;              /* whether the call has made a step */
    double before[INPUTS];  /* inputs behind which the call begins */
    double first_step;
    ballpass_result result;
    double x[SCENE_STATES]; /* where the step at hand starts */
    double time, state[SCENE_STATES];
} run_state;

struct ballpass {
    run_state run;
    ballpass_faults faults;
    double *edges; /* of all segments [s] */
    long edge_count;
    double *inputs; /* of the call's segments */
    unsigned char *restarts;
    void *work;
    double *reduction; /* see ballpass_reduce; NULL: none */
};

static size_t work_size(void)
{
    int sizes[16] = {0}, located[16] = {0};
    ballpass_sizes(sizes);
#ifdef SCENE_KINKS
    ballpass_sizes_located(located);
#endif
    return (size_t)(sizes[6] > located[6] ? sizes[6] : located[6]);
}

static void clear(ballpass *s)
{
    s->faults.count = 0;
    s->faults.text[0] = '\0';
}

static int answer_of(const ballpass *s, int answer) { return s->faults.count ? answer : BALLPASS_OK; }

static int refuse(ballpass *s, const char *what, const char *given, const char *allowed)
{
    add_fault(&s->faults, "%s: %s was given. Allowed: %s", what, given, allowed);
    return BALLPASS_REFUSED;
}

ballpass *ballpass_make(void)
{
    int sizes[16] = {0};
    ballpass *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->inputs = malloc(SEGMENTS_A_CALL * INPUTS * sizeof *s->inputs);
    s->restarts = malloc(SEGMENTS_A_CALL);
    s->work = calloc(1, work_size());
    ballpass_sizes(sizes);
    /* else scene.c and kernels.h belong to different models */
    const int whole = sizes[0] == SCENE_STATES && sizes[2] == SCENE_PARAMETERS && sizes[3] == SCENE_CONSTANTS;
    if (!s->inputs || !s->restarts || !s->work || !whole) {
        ballpass_free(s);
        return NULL;
    }
    for (int i = 0; i < SCENE_PARAMETERS; i++) s->run.values[i] = scene_parameters[i].value;
    return s;
}

void ballpass_free(ballpass *s)
{
    if (!s) return;
    free(s->edges);
    free(s->inputs);
    free(s->restarts);
    free(s->work);
    free(s);
}

const char *ballpass_error(const ballpass *s) { return s->faults.text; }

/* parameters */

int ballpass_parameters(void) { return SCENE_PARAMETERS; }

const char *ballpass_parameter(int place, const char **unit, const char **description)
{
    if (place < 0 || place >= SCENE_PARAMETERS) return NULL;
    if (unit) *unit = scene_parameters[place].unit;
    if (description) *description = scene_parameters[place].description;
    return scene_parameters[place].name;
}

int ballpass_place(const char *name)
{
    for (int i = 0; i < SCENE_PARAMETERS; i++)
        if (!strcmp(scene_parameters[i].name, name)) return i;
    return -1;
}

int ballpass_varies(int place) { return place >= 0 && place < SCENE_PARAMETERS && scene_parameters[place].varies; }

double ballpass_value(const ballpass *s, int place) { return place >= 0 && place < SCENE_PARAMETERS ? s->run.values[place] : NAN; }

static void refuse_outside(ballpass *s, int i, double value)
{
    const scene_parameter *info = &scene_parameters[i];
    char allowed[200] = "a number";
    /* NaN does not pass */
    if (isfinite(value) && value > info->above && value >= info->least && value <= info->most && value < info->below) return;
    size_t used = strlen(allowed);
    const double bounds[] = {info->above, info->least, info->most, info->below};
    static const char *const words[] = {"above", "from", "to", "below"};
    for (int k = 0; k < 4; k++)
        if (isfinite(bounds[k])) used += (size_t)snprintf(allowed + used, sizeof allowed - used, " %s %g", words[k], bounds[k]);
    add_fault(&s->faults, "%s: %.9g was given. Allowed: %s [%s].", info->name, value, allowed, info->unit);
}

int ballpass_set_at(ballpass *s, int place, double value)
{
    char given[40];
    clear(s);
    if (place < 0 || place >= SCENE_PARAMETERS) {
        snprintf(given, sizeof given, "place %d", place);
        return refuse(s, "parameter", given, "a place from 0 on, below the number of parameters.");
    }
    snprintf(given, sizeof given, "%.9g", value);
    if (s->run.started && !scene_parameters[place].varies)
        return refuse(s, scene_parameters[place].name, given, "a value before the run starts; in a run loads, forces and torques change.");
    refuse_outside(s, place, value);
    if (s->faults.count) return BALLPASS_REFUSED;
    if (s->run.started && value != s->run.values[place]) {
        double old[SCENE_TURNINGS + 1];
        double *values = s->run.values, *angles = values + ANGLES;
        for (int k = 0; k < SCENE_TURNINGS; k++) old[k] = values[scene_turnings[k].rate];
        values[place] = value;
        scene_constants(values, values + SCENE_PARAMETERS);
        /* where a rate changes, the angle continues from its value */
        for (int k = 0; k < SCENE_TURNINGS; k++)
            if (values[scene_turnings[k].rate] != old[k]) angles[k] += (old[k] - values[scene_turnings[k].rate]) * s->run.time;
        s->run.changed = 1;
    }
    s->run.values[place] = value;
    return BALLPASS_OK;
}

static int refuse_name(ballpass *s, const char *name)
{
    clear(s);
    return refuse(s, "parameter", name, "names that ballpass_parameter returns.");
}

int ballpass_set(ballpass *s, const char *name, double value)
{
    const int place = ballpass_place(name);
    return place < 0 ? refuse_name(s, name) : ballpass_set_at(s, place, value);
}

int ballpass_get(ballpass *s, const char *name, double *value)
{
    const int place = ballpass_place(name);
    if (place < 0) return refuse_name(s, name);
    clear(s);
    *value = s->run.values[place];
    return BALLPASS_OK;
}

/* runs */

/* Time of a turn of driver or shaft [s]; infinite where nothing turns. */
static double time_of_turn(const double *values)
{
    const double speed = scene_speed >= 0 ? values[scene_speed] : 0.0;
    return speed != 0.0 ? TURN / fabs(speed) : INFINITY;
}

/* Turns from t = 0 to a time; the time at which so many are made is put there where that is sooner. */
static double turns_until(const double *values, double most, double *end)
{
    if (scene_driver >= 0 && scene_turnings[scene_driver].rows) {
        schedule_turning driver = scene_turnings[scene_driver];
        driver.live = -1; /* by its table, wherever an FMU's input has brought it */
        return schedule_turns(&driver, values, most, end);
    }
    const double turn = time_of_turn(values);
    if (most * turn < *end) *end = most * turn;
    return *end / turn;
}

double ballpass_turns(const ballpass *s, double end) { return turns_until(s->run.values, INFINITY, &end); }

double ballpass_after(const ballpass *s, double turns)
{
    double end = INFINITY;
    turns_until(s->run.values, turns, &end);
    return end;
}

ballpass_request ballpass_default(const ballpass *s)
{
    ballpass_request asked = {0.0, scene_duration, scene_rtol, 0, -1};
    if (scene_cycles > 0.0) asked.end = ballpass_after(s, scene_cycles);
    for (int k = 0; k < SCENE_METHODS; k++)
        if (!strcmp(scene_method, scene_methods[k])) asked.method = k;
    return asked;
}

/* Times closer than this are one [s]. */
static double resolution(const ballpass *s)
{
    const double turn = time_of_turn(s->run.values), begin = fabs(s->run.asked.begin), end = fabs(s->run.asked.end);
    const double larger = begin > end ? begin : end;
    return TIME_RESOLUTION * (isfinite(turn) && turn > larger ? turn : larger);
}

/* Segments of the time from asked.begin to asked.end. */
static int find_edges(ballpass *s)
{
    const double *values = s->run.values, turn = time_of_turn(values), length = s->run.asked.end - s->run.asked.begin;
    const double most = schedule_most_segments(&scene_schedule, values, length, turn);
    if (!(most * SEGMENT_NUMBERS <= MOST_NUMBERS)) {
        add_fault(&s->faults,
                  "up to %.10g segments, cut where a load switches and at every whole turn, were asked for. Allowed: %.0f. Take a shorter "
                  "run, or slower loads.",
                  most, floor(MOST_NUMBERS / SEGMENT_NUMBERS));
        return BALLPASS_REFUSED;
    }
    double *edges = NULL;
    const long count = schedule_edges(&scene_schedule, values, s->run.asked.begin, s->run.asked.end, turn, &edges);
    if (count < 0) {
        add_fault(&s->faults, "the memory is too small for %.0f segments. Allowed: a shorter run.", most);
        return BALLPASS_FAILED;
    }
    free(s->edges);
    s->edges = edges;
    s->edge_count = count;
    return BALLPASS_OK;
}

/* Inputs of a segment, which begins at `start`. */
static void inputs_of(const ballpass *s, double start, double middle, double *u)
{
    u[0] = 0.0;
    schedule_inputs(&scene_schedule, s->run.values, start, middle, u);
}

/* Inputs and jumps of the segments of the call at hand. */
static void find_inputs(ballpass *s)
{
    const run_state *r = &s->run;
    const double *edges = s->edges + r->first;
    for (long i = 0; i < r->segments; i++) {
        double *u = s->inputs + i * INPUTS;
        inputs_of(s, edges[i], 0.5 * (edges[i] + edges[i + 1]), u);
        const double *past = i > 0 ? u - INPUTS : r->before;
        s->restarts[i] = (unsigned char)(i == 0 && r->first == 0);
        for (int k = 0; k < SCENE_INPUTS; k++)
            if (scene_inputs[k].kind > SCHEDULE_RATE && u[k] != past[k]) s->restarts[i] = 1; /* phases and rates go on */
    }
}

static void begin_call(ballpass *s, long first)
{
    run_state *r = &s->run;
    if (first > 0) memcpy(r->before, s->inputs + (r->segments - 1) * INPUTS, sizeof r->before);
    r->first = first;
    r->segments = s->edge_count - first < SEGMENTS_A_CALL ? s->edge_count - first : SEGMENTS_A_CALL;
    r->begun = 0;
    if (first > 0) r->first_step = 0.0;
    find_inputs(s);
}

/* Errors allowed in a step: relative to the magnitudes that the states have in this very run. */
static void find_tolerance(ballpass *s)
{
    run_state *r = &s->run;
    const double turn = time_of_turn(r->values), length = r->asked.end - r->asked.begin, horizon = length < turn ? length : turn;
    const double last = (r->asked.begin + SCALED_TURNS * turn) * (1.0 + 1e-12);
    long segments = s->edge_count;
    while (segments > 1 && s->edges[segments] > last) segments--;
    double inputs[2 * SCHEDULE_MOMENTS * INPUTS], magnitude[SCENE_STATES];
    const int moments = schedule_moments(&scene_schedule, r->values, s->edges, segments, horizon, inputs);
    ballpass_magnitudes(r->values, r->values + SCENE_PARAMETERS, r->x, moments, inputs, horizon, magnitude);
    for (int i = 0; i < SCENE_STATES; i++) r->tolerance[i] = r->asked.rtol * magnitude[i];
}

static void check_request(ballpass *s, const ballpass_request *asked)
{
    if (!(isfinite(asked->begin) && isfinite(asked->end) && asked->begin >= 0.0 && asked->end > asked->begin)) {
        const int still = !isfinite(asked->end) && !isfinite(time_of_turn(s->run.values));
        add_fault(&s->faults, "a run from %g s to %g s was asked for. Allowed: %s.", asked->begin, asked->end,
                  still ? "a time, for nothing turns in this model (its speed is zero)" : "finite times, from 0 on, the end after the begin");
    }
    if (!(asked->rtol >= SMALLEST_RTOL && asked->rtol <= LARGEST_RTOL))
        add_fault(&s->faults, "tolerance: %g was given. Allowed: a number from 1e-13 to 0.1.", asked->rtol);
    if (asked->method < BALLPASS_AUTO || asked->method >= SCENE_METHODS)
        add_fault(&s->faults, "method: %d was given. Allowed: 0 to %d.", asked->method, SCENE_METHODS - 1);
}

/* Values that the scene file could not have, all of them. */
int ballpass_check_bounds(ballpass *s)
{
    const double *values = s->run.values;
    clear(s);
    for (int i = 0; i < SCENE_PARAMETERS; i++) refuse_outside(s, i, values[i]);
    for (int k = 0; k < SCENE_RELATIONS; k++) {
        const scene_relation *rule = &scene_relations[k];
        const double least = rule->factor * values[rule->other];
        if (values[rule->parameter] > least) continue;
        add_fault(&s->faults, "%s: %.9g was given. Allowed: a number above %.9g times %s, which is %.9g [%s].",
                  scene_parameters[rule->parameter].name, values[rule->parameter], rule->factor, scene_parameters[rule->other].name, least,
                  scene_parameters[rule->parameter].unit);
    }
    return answer_of(s, BALLPASS_REFUSED);
}

void ballpass_stop(ballpass *s) { s->run.started = 0; }

void ballpass_reduce(ballpass *s, double *row) { s->reduction = row; }

void ballpass_put(ballpass *s, int place, double value) { s->run.values[place] = value; }

/* Values; derived constants; tables. */
static void check_values(ballpass *s)
{
    double *values = s->run.values;
    if (ballpass_check_bounds(s)) return;
    scene_constants(values, values + SCENE_PARAMETERS);
    for (int k = 0; k < SCENE_TURNINGS; k++) values[ANGLES + k] = scene_offsets[k] >= 0 ? values[scene_offsets[k]] : 0.0;
    values[LIVE] = NAN;
    for (int k = 0; k < SCENE_CONSTANTS; k++)
        if (!isfinite(values[SCENE_PARAMETERS + k])) {
            refuse(s, "derived constant", scene_constant_names[k], "geometry and elastic constants that make it a finite number.");
            return;
        }
    if (schedule_fault(&scene_schedule, values))
        refuse(s, "table", "a knot that is not after the one before", "knots that increase, angles within a turn.");
}

int ballpass_start(ballpass *s, const ballpass_request *request)
{
    run_state *r = &s->run;
    clear(s);
    r->started = r->changed = r->failed = r->driven = 0;
    check_values(s);
    if (s->faults.count) return BALLPASS_REFUSED;
    r->asked = request ? *request : ballpass_default(s);
    check_request(s, &r->asked);
#ifdef SCENE_LINKAGE
    if (!s->faults.count) refuse_unassembled(r->values, time_of_turn(r->values), r->asked.end, &s->faults);
#endif
    if (s->faults.count) return BALLPASS_REFUSED;
    if (r->asked.located < 0)
        r->asked.located = r->asked.rtol <= SCENE_TIGHT && (r->asked.method == BALLPASS_AUTO || SCENE_TIGHT >= 1.0);
    const int fault = find_edges(s);
    if (fault) return fault;
    for (int i = 0; i < SCENE_STATES; i++) r->x[i] = r->state[i] = r->values[scene_initial[i]];
    r->time = r->asked.begin;
    r->farther = r->asked.end - r->asked.begin;
    find_tolerance(s);
    memset(r->before, 0, sizeof r->before);
    memset(&r->result, 0, sizeof r->result);
    r->first_step = 0.0;
    begin_call(s, 0);
    r->started = 1;
    return BALLPASS_OK;
}

/* From the time reached on with other values, or for a longer time. */
static int start_anew(ballpass *s, double end)
{
    run_state *r = &s->run;
    r->first_step = r->result.step > 0.0 && isfinite(r->result.step) ? r->result.step : 0.0;
    memcpy(r->x, r->state, sizeof r->x);
    r->asked.begin = r->time;
    r->asked.end = end;
    r->changed = 1; /* until there are segments for it */
    const int fault = find_edges(s);
    if (fault) return fault;
    r->changed = 0;
    begin_call(s, 0);
    return BALLPASS_OK;
}

/* As long again after the end, and twice that the next time: independent of the times that are asked for. */
static int go_beyond(ballpass *s)
{
    const double end = s->run.asked.end + s->run.farther;
    s->run.farther *= 2.0;
    return start_anew(s, end);
}

/* The state at a time within the call at hand. */
static int run_call(ballpass *s, double time)
{
    run_state *r = &s->run;
    const double *edges = s->edges + r->first, *p = r->values, *c = r->values + SCENE_PARAMETERS;
    /* a time beside an edge by rounding lies on it */
    const double wanted = time < edges[0] ? edges[0] : time > edges[r->segments] ? edges[r->segments] : time;
    const double length = r->asked.end - r->asked.begin;
    /* far above the steps of any suitable method */
    const double steps = 2e7 + 1e7 * ceil(length / time_of_turn(r->values)) + 1e6 * length;
    const ballpass_options options = {.method = r->asked.method,
                                      .max_steps = steps < 2e9 ? (long)steps : 2000000000L,
                                      .first_step = r->first_step,
                                      .largest_step = INFINITY,
                                      .tolerance = r->tolerance,
                                      .reduction = s->reduction,
                                      .work = s->work,
                                      .resume = r->begun,
                                      .pause = wanted < edges[r->segments]}; /* else the step to it is taken, reductions included */
    r->begun = 1;
    r->result.written = 0;
#ifdef SCENE_KINKS
    const int located = r->asked.located;
#else
    const int located = 0;
#define ballpass_run_located ballpass_run
#endif
    const int status = (located ? ballpass_run_located : ballpass_run)(&options, p, c, r->x, r->segments, edges, s->inputs, s->restarts, 1,
                                                                      &wanted, r->state, &r->result);
    if (status == BALLPASS_PAUSED || status == BALLPASS_DONE) return BALLPASS_OK;
    r->failed = 1;
    add_fault(&s->faults, "%s. t = %.9g s, step size %.3g s%s%s.", STATUS[status], r->result.time, r->result.step,
              r->result.state >= 0 ? ", worst state " : "", r->result.state >= 0 ? scene_columns[1 + r->result.state].name : "");
    return BALLPASS_FAILED;
}

static int must_run(ballpass *s)
{
    clear(s);
    if (!s->run.started) add_fault(&s->faults, "the run has not been started. Allowed: ballpass_start first.");
    else if (s->run.failed) add_fault(&s->faults, "the run has failed. Allowed: to start it again, or to restore a state.");
    return answer_of(s, BALLPASS_REFUSED);
}

/* Segments and constants follow values that were set. */
static int settle(ballpass *s)
{
    run_state *r = &s->run;
    if (!r->changed) return BALLPASS_OK;
    for (int k = 0; k < SCENE_CONSTANTS; k++)
        if (!isfinite(r->values[SCENE_PARAMETERS + k])) return refuse(s, "derived constant", scene_constant_names[k], "numbers that make it finite.");
    return r->time >= r->asked.end ? go_beyond(s) : start_anew(s, r->asked.end);
}

/* From the time reached on the driver turns at an acceleration, and all else with it. */
static void turn_from_here(ballpass *s, double acceleration)
{
    double *values = s->run.values, angles[SCENE_TURNINGS + 1];
    const double speed = ballpass_driver_speed(s);
    for (int k = 0; k < SCENE_TURNINGS; k++) schedule_angle(&scene_turnings[k], values, s->run.time, &angles[k], NULL);
    for (int k = 0; k < SCENE_TURNINGS; k++)
        if (scene_turnings[k].live >= 0) values[ANGLES + k] = angles[k];
    values[LIVE] = s->run.time;
    values[LIVE + 1] = speed;
    values[LIVE + 2] = acceleration;
    s->run.changed = 1;
}

int ballpass_drive(ballpass *s, double speed)
{
    const int refused = must_run(s);
    if (refused) return refused;
    if (scene_driver < 0 || scene_turnings[scene_driver].rows == 0 || !isfinite(speed)) {
        add_fault(&s->faults, "a speed of %g rad/s was given for the driver. Allowed: a finite one, where the scene has a table of its speed.", speed);
        return BALLPASS_REFUSED;
    }
    s->run.wanted = speed;
    if (!s->run.driven) {
        s->run.driven = 1;
        turn_from_here(s, 0.0);
    }
    return BALLPASS_OK;
}

double ballpass_driver_speed(const ballpass *s)
{
    double speed = 0.0;
    if (scene_driver >= 0) schedule_angle(&scene_turnings[scene_driver], s->run.values, s->run.time, NULL, &speed);
    return speed;
}

int ballpass_run_to(ballpass *s, double time)
{
    run_state *r = &s->run;
    const int refused = must_run(s);
    if (refused) return refused;
    if (!(isfinite(time) && time >= r->time)) {
        add_fault(&s->faults, "time %.9g s was asked for, and the run has come to %.9g s. Allowed: a finite time not before that.", time, r->time);
        return BALLPASS_REFUSED;
    }
    if (r->driven && time > r->time) {
        const double acceleration = (r->wanted - ballpass_driver_speed(s)) / (time - r->time);
        if (acceleration != r->values[LIVE + 2]) turn_from_here(s, acceleration);
    }
    int fault = settle(s);
    while (!fault) {
        const double near = resolution(s), end = s->edges[r->first + r->segments];
        if (r->first + r->segments == s->edge_count) {
            if (time <= r->asked.end + near) break;
            if (r->time < r->asked.end) fault = run_call(s, end);
            if (fault) break;
            r->time = r->asked.end;
            fault = go_beyond(s);
        } else {
            if (time < end - near) break;
            fault = run_call(s, end);
            memcpy(r->x, r->state, sizeof r->x);
            if (!fault) begin_call(s, r->first + r->segments);
        }
    }
    if (!fault && time > r->time && r->time < r->asked.end) fault = run_call(s, time);
    if (!fault) r->time = time;
    return fault;
}

/* Reading */

int ballpass_columns(void) { return 1 + SCENE_STATES + SCENE_OUTPUTS; }

const char *ballpass_column(int column, const char **unit)
{
    if (column < 0 || column >= ballpass_columns()) return NULL;
    if (unit) *unit = scene_columns[column].unit;
    return scene_columns[column].name;
}

/* The segment at the time reached: one that begins there is meant. */
static long segment_here(const ballpass *s)
{
    const double near = resolution(s);
    long i = s->run.first;
    while (i + 1 < s->edge_count && s->edges[i + 1] - near <= s->run.time) i++;
    return i;
}

double ballpass_segment(const ballpass *s, double *middle)
{
    const long i = segment_here(s);
    *middle = 0.5 * (s->edges[i] + s->edges[i + 1]);
    return s->edges[i];
}

double ballpass_moment(const ballpass *s, double *u)
{
    double middle;
    const double start = ballpass_segment(s, &middle);
    inputs_of(s, start, middle, u);
    return s->run.time - start;
}

const double *ballpass_values(const ballpass *s) { return s->run.values; }
const double *ballpass_states(const ballpass *s) { return s->run.state; }
double ballpass_time(const ballpass *s) { return s->run.time; }
int ballpass_started(const ballpass *s) { return s->run.started; }

int ballpass_read(ballpass *s, double *columns)
{
    const int refused = must_run(s), fault = refused ? refused : settle(s);
    if (fault) return fault;
    columns[0] = s->run.time;
    memcpy(columns + 1, s->run.state, sizeof s->run.state);
    double u[INPUTS];
    const double t = ballpass_moment(s, u);
    scene_outputs(t, s->run.state, u, s->run.values, s->run.values + SCENE_PARAMETERS, columns + 1 + SCENE_STATES);
    return BALLPASS_OK;
}

double ballpass_next_switch(ballpass *s)
{
    double here[INPUTS], there[INPUTS];
    if (must_run(s) || settle(s)) return INFINITY;
    long i = segment_here(s);
    for (; i + 1 < s->edge_count; i++) {
        const double *e = s->edges + i;
        inputs_of(s, e[0], 0.5 * (e[0] + e[1]), here);
        inputs_of(s, e[1], 0.5 * (e[1] + e[2]), there);
        for (int k = 0; k < SCENE_INPUTS; k++) {
            const int even = scene_inputs[k].kind <= SCHEDULE_RATE || scene_inputs[k].kind == SCHEDULE_TABLE; /* slopes tell of its rows */
            if (!even && here[k] != there[k]) return e[1];
        }
    }
    return INFINITY;
}

/* copies */

size_t ballpass_state_size(void) { return sizeof(run_state) + work_size(); }

void ballpass_save(const ballpass *s, void *bytes)
{
    memcpy(bytes, &s->run, sizeof s->run);
    memcpy((char *)bytes + sizeof s->run, s->work, work_size());
}

int ballpass_restore(ballpass *s, const void *bytes, size_t size)
{
    clear(s);
    if (size != ballpass_state_size()) {
        add_fault(&s->faults, "a state of %zu bytes was given. Allowed: %zu bytes that ballpass_save has written.", size, ballpass_state_size());
        return BALLPASS_REFUSED;
    }
    memcpy(&s->run, bytes, sizeof s->run);
    memcpy(s->work, (const char *)bytes + sizeof s->run, work_size());
    /* values that were set and not run with have segments of their own, which come with the next call */
    if (!s->run.started || s->run.changed) return BALLPASS_OK;
    const int fault = find_edges(s);
    if (!fault) find_inputs(s);
    return fault;
}
