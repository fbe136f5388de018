/* Runs the scene and prints its states and outputs as CSV.  --help prints the options, --list the parameters.  It uses an instance only
   through ballpass.h, except for the check of values that are only listed. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ballpass.h"
#include "scene.h"
#include "simulation.h"

static const double SMALLEST_RTOL = 1e-13, LARGEST_RTOL = 1e-1;
static const double TURN = 6.283185307179586476925286766559;

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
    printf("  --method M       %s; default %s\n", scene_methods_listed, scene_method);
    printf("  --kinks HOW      stepped-over, or located: steps end where a law has a kink or jump; default: located by method\n                   auto at an --rtol of %g and below, else stepped-over\n", SCENE_TIGHT);
    printf("  --list           print parameters with values, units and meaning, and stop\n\n");
    printf("Values of parameters are numbers in SI units.\n");
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
    return BALLPASS_REFUSED;
}

/* Print each line of the message of the instance after the word error; return the exit code. */
static int complain(const ballpass *simulation, int code)
{
    const char *text = ballpass_error(simulation);
    while (*text) {
        const char *end = strchr(text, '\n');
        const int length = end ? (int)(end - text) : (int)strlen(text);
        fprintf(stderr, "error: %.*s\n", length, text);
        text += length + (end != NULL);
    }
    return code;
}

static void list(const ballpass *simulation)
{
    for (int i = 0; i < SCENE_PARAMETERS; i++)
        printf("%s=%.17g  [%s] %s\n", scene_parameters[i].name, ballpass_value(simulation, i), scene_parameters[i].unit, scene_parameters[i].description);
}

static int set_option(request *asked, const char *name, const char *text)
{
    double value;
    if (!strcmp(name, "--method")) {
        for (int k = 0; k < SCENE_METHODS; k++)
            if (!strcmp(text, scene_methods[k])) {
                asked->method = k;
                return 0;
            }
        return refuse(name, text, scene_methods_listed);
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

static int set_parameter(ballpass *simulation, unsigned char *given, const char *text)
{
    double value;
    const char *sign = strchr(text, '=');
    const size_t length = sign ? (size_t)(sign - text) : strlen(text);
    for (int i = 0; i < SCENE_PARAMETERS; i++) {
        if (strlen(scene_parameters[i].name) != length || strncmp(scene_parameters[i].name, text, length) != 0) continue;
        if (!sign || !number(sign + 1, &value)) return refuse(scene_parameters[i].name, sign ? sign + 1 : "nothing", "a number in SI units, as in name=1e-5.");
        if (given[i]) return refuse(scene_parameters[i].name, "more than one value", "one value for a number. Omit the others.");
        given[i] = 1;
        ballpass_put(simulation, i, value);
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

/* The request from the command line; 0, or an exit code, or -1 where the request was only to print. */
static int read_request(int count, char **arguments, request *asked, ballpass *simulation)
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
            if (!value) return refuse(text, "nothing", "a value after it.");
            fault = set_option(asked, text, value);
        } else {
            fault = set_parameter(simulation, given, text);
        }
        if (fault) return fault;
    }
    if (asked->turns_given && asked->time_given) return refuse("--cycles, --duration", "each of them", "one of the two. Omit the other.");
    if (listed) {
        if (ballpass_check_bounds(simulation)) return complain(simulation, BALLPASS_REFUSED);
        list(simulation);
        return -1;
    }
    return 0;
}

static int print_row(ballpass *simulation, double *columns)
{
    if (ballpass_read(simulation, columns) != BALLPASS_OK) return 0;
    for (int k = 0; k < ballpass_columns(); k++) printf(k > 0 ? ",%.17g" : "%.17g", columns[k]);
    return printf("\n") > 0;
}

static int simulate(const request *asked, ballpass *simulation)
{
    double columns[1 + SCENE_STATES + SCENE_OUTPUTS];
    const double speed = scene_speed >= 0 ? ballpass_value(simulation, scene_speed) : 0.0, turn = speed != 0.0 ? TURN / fabs(speed) : INFINITY;
    const double duration = asked->cycles > 0.0 ? ballpass_after(simulation, asked->cycles) : asked->duration;
    if (!isfinite(duration)) return refuse("--cycles", "a number", "--duration T, for nothing turns in this model, or not so often.");
    /* where its speed changes the driver may be slow on the mean */
    const double turns = fmax(duration / turn, ballpass_turns(simulation, duration));
    const double wished = turns > 0.0 ? rint((double)asked->samples * turns) : (double)asked->samples;
    const ballpass_request run = {0.0, duration, asked->rtol, asked->method, asked->located};
    int answer = ballpass_start(simulation, &run);
    if (answer != BALLPASS_OK) return complain(simulation, answer);
    const long count = wished > 1.0 ? (long)wished : 1;
    for (int k = 0; k < ballpass_columns(); k++) printf(k > 0 ? ",%s" : "%s", ballpass_column(k, NULL));
    printf("\n");
    for (long k = 0; k <= count; k++) {
        answer = ballpass_run_to(simulation, duration * ((double)k / (double)count));
        if (answer != BALLPASS_OK) {
            fflush(stdout);
            complain(simulation, answer);
            fprintf(stderr, "%ld samples written.\n", k);
            return answer;
        }
        if (!print_row(simulation, columns)) break;
    }
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fprintf(stderr, "error: the output cannot be written: %s\n", strerror(errno));
        return BALLPASS_FAILED;
    }
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    ballpass *simulation = ballpass_make();
    if (!simulation) {
        fprintf(stderr, "error: the memory is too small, or scene.c and kernels.h belong to different models. Export the scene again.\n");
        return BALLPASS_FAILED;
    }
    request asked = {scene_cycles, scene_duration, 0, 0, scene_rtol, scene_samples, 0, -1};
    asked.method = ballpass_default(simulation).method;
    int answer = read_request(argc, argv, &asked, simulation);
    if (answer == 0) answer = simulate(&asked, simulation);
    ballpass_free(simulation);
    return answer < 0 ? EXIT_SUCCESS : answer;
}
