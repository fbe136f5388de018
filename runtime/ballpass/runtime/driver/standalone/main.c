/* Runs the scene and prints its states as CSV.  --help tells the options, --list the parameters. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assembly.h"
#include "located.h"
#include "scene.h"
#include "stepper.h"

/* Results went to stdout; the computation failed; the request was wrong. */
enum { EXIT_FAILED = 1, EXIT_REQUEST = 2 };

/* Segments of one call: so much memory does a run need at a time. */
enum { SEGMENTS_A_CALL = 600 };

/* That the samples of a run may hold, or its segments: 4 GiB. */
static const double MOST_NUMBERS = 536870912.0;

/* Numbers that a segment takes while segments are sought: its end, in lists that grow twofold. */
static const double SEGMENT_NUMBERS = 6.0;

static const double SMALLEST_RTOL = 1e-13, LARGEST_RTOL = 1e-1;
static const double TURN = 6.283185307179586476925286766559;

/* In the order of enum ballpass_method. */
static const char *const METHODS[] = {"auto", "rodas4", "rodas5p", "dp54", "dop853"};

static const char *const STATUS[] = {
    "done",
    "too many steps: take a shorter run or a looser --rtol",
    "the step size fell to the resolution of time: the force jumps there, or the motion grows without bound",
    "the motion stopped being finite: check parameters and initial state",
    "the request cannot be run",
    "the driver has stalled: it comes back to the edge of a window again and again",
};

typedef struct {
    double cycles, duration; /* one of them above zero */
    int turns_given, time_given;
    double rtol;
    long samples; /* in a turn; in the whole run where nothing turns */
    int method;
    int located; /* whether steps end on the kinks of the laws; -1: as the tolerance is */
} request;

static void help(const char *program)
{
    printf("%s\n\nusage: %s [options] [PARAMETER=VALUE]... > out.csv\n\n", scene_title, program);
    printf("  --cycles N       turns of driver or shaft\n");
    printf("  --duration T     time [s], instead of turns\n");
    printf("  --rtol R         error allowed in a step, relative to the magnitudes of the states; default %g\n", scene_rtol);
    printf("  --samples N      samples in a turn (in the whole run where nothing turns); default %ld\n", scene_samples);
    printf("  --method M       auto, rodas4, rodas5p, dp54, dop853; default %s\n", scene_method);
    printf("  --kinks HOW      stepped-over, or located: steps end where a law has a kink or jump; default: located by method\n                   auto at an --rtol of %g and below, else stepped-over\n", SCENE_TIGHT);
    printf("  --list           print parameters with values, units and meaning, and stop\n\n");
    printf("Values of parameters are numbers in SI units.\n");
}

static void list(const double *values)
{
    for (int i = 0; i < SCENE_PARAMETERS; i++)
        printf("%s=%.17g  [%s] %s\n", scene_parameters[i].name, values[i], scene_parameters[i].unit, scene_parameters[i].description);
}

/* A finite number, the whole text of it. */
static int number(const char *text, double *value)
{
    char *end;
    *value = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*value);
}

static int refuse(const char *what, const char *given, const char *allowed)
{
    fprintf(stderr, "error: %s: %s was given. Allowed: %s\n", what, given, allowed);
    return EXIT_REQUEST;
}

/* Says which values are outside the scene's bounds, all of them, and what is allowed; returns how many. */
static int refuse_outside(const double *values)
{
    int faults = 0;
    for (int i = 0; i < SCENE_PARAMETERS; i++) {
        const scene_parameter *info = &scene_parameters[i];
        const double value = values[i];
        /* not a number is no pass */
        if (value > info->above && value >= info->least && value <= info->most && value < info->below) continue;
        fprintf(stderr, "error: %s: %.9g was given. Allowed: a number", info->name, value);
        if (info->above > -INFINITY) fprintf(stderr, " above %g", info->above);
        if (info->least > -INFINITY) fprintf(stderr, " from %g", info->least);
        if (info->most < INFINITY) fprintf(stderr, " to %g", info->most);
        if (info->below < INFINITY) fprintf(stderr, " below %g", info->below);
        fprintf(stderr, " [%s].\n", info->unit);
        faults++;
    }
    for (int k = 0; k < SCENE_RELATIONS; k++) {
        const scene_relation *rule = &scene_relations[k];
        const double least = rule->factor * values[rule->other];
        if (values[rule->parameter] > least) continue;
        fprintf(stderr, "error: %s: %.9g was given. Allowed: a number above %.9g times %s, which is %.9g [%s].\n",
                scene_parameters[rule->parameter].name, values[rule->parameter], rule->factor, scene_parameters[rule->other].name, least,
                scene_parameters[rule->parameter].unit);
        faults++;
    }
    return faults;
}

static int set_option(request *asked, const char *name, const char *text)
{
    double value;
    if (!strcmp(name, "--method")) {
        for (int k = 0; k < (int)(sizeof METHODS / sizeof *METHODS); k++)
            if (!strcmp(text, METHODS[k])) {
                asked->method = k;
                return 0;
            }
        return refuse(name, text, "auto, rodas4, rodas5p, dp54, dop853.");
    }
    if (!strcmp(name, "--kinks")) {
        asked->located = !strcmp(text, "located");
        return asked->located || !strcmp(text, "stepped-over") ? 0 : refuse(name, text, "stepped-over, located.");
    }
    if (!number(text, &value) || value <= 0.0) return refuse(name, text, "a number above 0.");
    if (!strcmp(name, "--cycles")) {
        asked->cycles = value;
        asked->duration = 0.0;
        asked->turns_given = 1;
    } else if (!strcmp(name, "--duration")) {
        asked->duration = value;
        asked->cycles = 0.0;
        asked->time_given = 1;
    } else if (!strcmp(name, "--rtol")) {
        if (value < SMALLEST_RTOL || value > LARGEST_RTOL) return refuse(name, text, "a number from 1e-13 to 0.1.");
        asked->rtol = value;
    } else {
        if (value != floor(value) || value > 1e9) return refuse(name, text, "a whole number from 1 on.");
        asked->samples = (long)value;
    }
    return 0;
}

static int set_parameter(double *values, unsigned char *given, const char *text)
{
    const char *sign = strchr(text, '=');
    const size_t length = sign ? (size_t)(sign - text) : strlen(text);
    for (int i = 0; i < SCENE_PARAMETERS; i++) {
        if (strlen(scene_parameters[i].name) != length || strncmp(scene_parameters[i].name, text, length) != 0) continue;
        if (!sign || !number(sign + 1, &values[i])) return refuse(scene_parameters[i].name, sign ? sign + 1 : "nothing", "a number in SI units, as in name=1e-5.");
        if (given[i]) return refuse(scene_parameters[i].name, "more than one value", "one value for a number. Leave the others away.");
        given[i] = 1;
        return 0;
    }
    return refuse("parameter", text, "PARAMETER=VALUE with a parameter that --list names, and the options that --help names.");
}

static int known_option(const char *name)
{
    static const char *const options[] = {"--cycles", "--duration", "--rtol", "--samples", "--method", "--kinks"};
    for (int k = 0; k < (int)(sizeof options / sizeof *options); k++)
        if (!strcmp(name, options[k])) return 1;
    return 0;
}

/* The request from the command line; 0, or an exit code, or -1 where everything is said already. */
static int read_request(int count, char **arguments, request *asked, double *values)
{
    unsigned char given[SCENE_PARAMETERS] = {0}; /* parameters that have a value from there */
    int listed = 0;
    for (int i = 1; i < count; i++) {
        char *text = arguments[i];
        int fault;
        if (!strcmp(text, "--help")) {
            help(arguments[0]);
            return -1;
        }
        if (!strcmp(text, "--list")) {
            listed = 1;
            continue;
        }
        if (strncmp(text, "--", 2) == 0) {
            char *value = strchr(text, '=');
            if (value) *value++ = '\0';
            if (!known_option(text)) return refuse("option", text, "those that --help names.");
            if (!value && i + 1 < count) value = arguments[++i];
            if (!value) return refuse(text, "nothing", "a value behind it.");
            fault = set_option(asked, text, value);
        } else {
            fault = set_parameter(values, given, text);
        }
        if (fault) return fault;
    }
    if (asked->turns_given && asked->time_given) return refuse("--cycles, --duration", "each of them", "one of the two. Leave the other away.");
    if (listed) {
        if (refuse_outside(values)) return EXIT_REQUEST;
        list(values);
        return -1;
    }
    return 0;
}

/* First of the sorted times that is not below `time`. */
static long first_at(const double *times, long count, double time)
{
    long low = 0, high = count;
    while (low < high) {
        const long middle = low + (high - low) / 2;
        if (times[middle] < time) low = middle + 1;
        else high = middle;
    }
    return low;
}

static int print_rows(const double *times, const double *states, long rows)
{
    for (long k = 0; k < rows; k++) {
        printf("%.17g", times[k]);
        for (int i = 0; i < SCENE_STATES; i++) printf(",%.17g", states[k * SCENE_STATES + i]);
        if (printf("\n") < 0) return 0;
    }
    return 1;
}

/* Memory of a run: samples, segments, and one call's share of them. */
typedef struct {
    double *times, *edges, *inputs, *wanted, *states;
    unsigned char *restarts;
    int located;
} memory;

static void release(memory *m)
{
    free(m->times);
    free(m->edges);
    free(m->inputs);
    free(m->wanted);
    free(m->states);
    free(m->restarts);
}

/* One call: segments first to first + count, samples from `stop` on.  Returns the driver's status, -1 where memory is short. */
static int run_part(memory *m, long first, long count, int whole, long from, long to, const ballpass_options *options, const double *values,
                    double *x, const double *before, ballpass_result *result)
{
    const int inputs = SCENE_INPUTS > 0 ? SCENE_INPUTS : 1;
    const double *edges = m->edges + first;
    const long samples = to - from;
    double *wanted = realloc(m->wanted, (size_t)(samples > 0 ? samples : 1) * sizeof *wanted);
    if (wanted) m->wanted = wanted;
    double *states = realloc(m->states, (size_t)(samples > 0 ? samples : 1) * SCENE_STATES * sizeof *states);
    if (states) m->states = states;
    if (!wanted || !states) return -1;
    for (long k = 0; k < samples; k++) {
        /* a sample that rounding puts beside an edge lies on it */
        const double time = m->times[from + k];
        wanted[k] = time < edges[0] ? edges[0] : time > edges[count] ? edges[count] : time;
    }
    for (long i = 0; i < count; i++) {
        double *u = m->inputs + i * inputs;
        u[0] = 0.0;
        schedule_inputs(scene_inputs, SCENE_INPUTS, values, edges[i], 0.5 * (edges[i] + edges[i + 1]), u);
        const double *past = i > 0 ? u - inputs : before;
        m->restarts[i] = (unsigned char)(i == 0 && whole);
        for (int k = 0; k < SCENE_INPUTS; k++)
            if (scene_inputs[k].kind != SCHEDULE_PHASE && past && u[k] != past[k]) m->restarts[i] = 1;
    }
#ifdef SCENE_KINKS
    if (m->located)
        return ballpass_run_located(options, values, values + SCENE_PARAMETERS, x, count, edges, m->inputs, m->restarts, samples, wanted, states, result);
#endif
    return ballpass_run(options, values, values + SCENE_PARAMETERS, x, count, edges, m->inputs, m->restarts, samples, wanted, states, result);
}

/* Time of a turn of driver or shaft [s]; infinite where nothing turns. */
static double time_of_turn(const double *values)
{
    const double speed = scene_speed >= 0 ? values[scene_speed] : 0.0;
    return speed != 0.0 ? TURN / fabs(speed) : INFINITY;
}

/* Errors allowed in a step: relative to the magnitudes that the states have in this very run. */
static void find_tolerance(double rtol, const double *values, const double *x, const double *edges, long segments, double horizon,
                           double *tolerance)
{
    double inputs[2 * SCHEDULE_MOMENTS * (SCENE_INPUTS > 0 ? SCENE_INPUTS : 1)], magnitude[SCENE_STATES];
    const int moments = schedule_moments(scene_inputs, SCENE_INPUTS, values, edges, segments, horizon, inputs);
    ballpass_magnitudes(values, values + SCENE_PARAMETERS, x, moments, inputs, horizon, magnitude);
    for (int i = 0; i < SCENE_STATES; i++) tolerance[i] = rtol * magnitude[i];
}

static int simulate(const request *asked, const double *values)
{
    double tolerance[SCENE_STATES], x[SCENE_STATES], before[SCENE_INPUTS > 0 ? SCENE_INPUTS : 1] = {0.0};
    const double turn = time_of_turn(values);
    if (asked->cycles > 0.0 && !isfinite(turn)) return refuse("--cycles", "a number", "--duration T, for nothing turns in this model (its speed is zero).");
    const double duration = asked->cycles > 0.0 ? asked->cycles * turn : asked->duration;
    const double wished = isfinite(turn) ? rint((double)asked->samples * duration / turn) : (double)asked->samples;
    if ((wished + 1.0) * (SCENE_STATES + 1.0) > MOST_NUMBERS) {
        fprintf(stderr, "error: --samples: %.0f samples of %d numbers were asked for. Allowed: %.0f numbers. Take fewer samples, or a shorter run.\n",
                wished, SCENE_STATES + 1, MOST_NUMBERS);
        return EXIT_REQUEST;
    }
    const long count = wished > 1.0 ? (long)wished : 1;
    const double most = schedule_most_segments(scene_inputs, SCENE_INPUTS, values, duration, turn);
    if (!(most * SEGMENT_NUMBERS <= MOST_NUMBERS)) {
        fprintf(stderr,
                "error: up to %.10g segments, cut where a load switches and at every whole turn, were asked for. Allowed: %.0f. Take a "
                "shorter run, or slower loads.\n",
                most, floor(MOST_NUMBERS / SEGMENT_NUMBERS));
        return EXIT_REQUEST;
    }
    for (int i = 0; i < SCENE_STATES; i++) x[i] = values[scene_initial[i]];
    /* far above what any method needs that fits the model: what meets it crawls */
    const double steps = 2e7 + 1e7 * ceil(duration / turn) + 1e6 * duration;
    const ballpass_options options = {
        .method = asked->method, .max_steps = steps < 2e9 ? (long)steps : 2000000000L, .largest_step = INFINITY, .tolerance = tolerance};
    const size_t inputs = SCENE_INPUTS > 0 ? SCENE_INPUTS : 1;
    const int tight = asked->method == BALLPASS_AUTO && asked->rtol <= SCENE_TIGHT;
    memory m = {NULL, NULL, NULL, NULL, NULL, NULL, asked->located >= 0 ? asked->located : tight};
    m.times = malloc((size_t)(count + 1) * sizeof *m.times);
    m.inputs = malloc(SEGMENTS_A_CALL * inputs * sizeof *m.inputs);
    m.restarts = malloc(SEGMENTS_A_CALL);
    int status = m.times && m.inputs && m.restarts ? BALLPASS_DONE : -1;
    long segments = 0;
    if (status == BALLPASS_DONE) {
        for (long k = 0; k <= count; k++) m.times[k] = duration * ((double)k / (double)count);
        segments = schedule_edges(scene_inputs, SCENE_INPUTS, values, m.times[0], m.times[count], turn, &m.edges);
        if (segments < 0) status = -1;
        else find_tolerance(asked->rtol, values, x, m.edges, segments, duration < turn ? duration : turn, tolerance);
    }
    printf("t");
    for (int i = 0; i < SCENE_STATES; i++) printf(",%s", scene_states[i]);
    printf("\n");
    ballpass_result result;
    memset(&result, 0, sizeof result);
    long written = 0;
    for (long first = 0; first < segments && status == BALLPASS_DONE; first += SEGMENTS_A_CALL) {
        const long part = segments - first < SEGMENTS_A_CALL ? segments - first : SEGMENTS_A_CALL;
        const double end = m.edges[first + part], near = 1e-9 * (m.times[1] - m.times[0]);
        const long to = end >= m.times[count] ? count + 1 : first_at(m.times, count + 1, end - near);
        status = run_part(&m, first, part, first == 0, written, to, &options, values, x, first > 0 ? before : NULL, &result);
        if (status < 0) break;
        memcpy(before, m.inputs + (size_t)(part - 1) * inputs, inputs * sizeof *before);
        if (!print_rows(m.times + written, m.states, result.written)) {
            fprintf(stderr, "error: the output cannot be written: %s\n", strerror(errno));
            release(&m);
            return EXIT_FAILED;
        }
        written += result.written;
    }
    release(&m);
    if (fflush(stdout) != 0) {
        fprintf(stderr, "error: the output cannot be written: %s\n", strerror(errno));
        return EXIT_FAILED;
    }
    if (status < 0) {
        fprintf(stderr, "error: the memory is too small for %ld samples. Allowed: fewer --samples or --cycles.\n", count);
        return EXIT_FAILED;
    }
    if (status != BALLPASS_DONE) {
        fprintf(stderr, "error: %s.\nt = %.9g s, step size %.3g s%s%s, %ld samples written.\n", STATUS[status], result.time, result.step,
                result.state >= 0 ? ", worst state " : "", result.state >= 0 ? scene_states[result.state] : "", written);
        return EXIT_FAILED;
    }
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    static double values[SCENE_PARAMETERS + SCENE_CONSTANTS];
    request asked = {scene_cycles, scene_duration, 0, 0, scene_rtol, scene_samples, 0, -1};
    int sizes[16] = {0};
    ballpass_sizes(sizes);
    if (sizes[0] != SCENE_STATES || sizes[2] != SCENE_PARAMETERS || sizes[3] != SCENE_CONSTANTS) {
        fprintf(stderr, "error: scene.c and kernels.h belong to different models. Export the scene again.\n");
        return EXIT_REQUEST;
    }
    for (int i = 0; i < SCENE_PARAMETERS; i++) values[i] = scene_parameters[i].value;
    for (int k = 0; k < (int)(sizeof METHODS / sizeof *METHODS); k++)
        if (!strcmp(scene_method, METHODS[k])) asked.method = k;
    const int fault = read_request(argc, argv, &asked, values);
    if (fault) return fault < 0 ? EXIT_SUCCESS : fault;
    if (refuse_outside(values)) return EXIT_REQUEST;
    const double *p = values;
    double *c = values + SCENE_PARAMETERS;
    scene_constants(p, c);
    for (int k = 0; k < SCENE_CONSTANTS; k++)
        if (!isfinite(c[k])) return refuse("derived constant", scene_constant_names[k], "geometry and elastic constants that make it a finite number.");
    const int table = schedule_fault(scene_inputs, SCENE_INPUTS, values);
    if (table >= 0) return refuse("table", "a knot that is not after the one before", "knots that increase, angles within a turn.");
#ifdef SCENE_LINKAGE
    if (refuse_unassembled(values, time_of_turn(values))) return EXIT_REQUEST;
#endif
    return simulate(&asked, values);
}
