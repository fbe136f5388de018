/* How a program of your own embeds the scene (ballpass.h): make example && ./example.  For C and C++. */
#include <stdio.h>
#include <stdlib.h>

#include "ballpass.h"

static int failed(const ballpass *simulation)
{
    fprintf(stderr, "error: %s\n", ballpass_error(simulation));
    return EXIT_FAILURE;
}

/* Ten times of the scene's run, with a value of a parameter if the command line gives both. */
int main(int argc, char **argv)
{
    ballpass *simulation = ballpass_make();
    double *columns = (double *)malloc((size_t)ballpass_columns() * sizeof *columns);
    if (!simulation || !columns) return EXIT_FAILURE;
    if (argc > 2 && ballpass_set(simulation, argv[1], atof(argv[2])) != BALLPASS_OK) return failed(simulation);
    const ballpass_request run = ballpass_default(simulation);
    if (ballpass_start(simulation, &run) != BALLPASS_OK) return failed(simulation);
    for (int k = 1; k <= 10; k++) {
        if (ballpass_run_to(simulation, run.end * (k / 10.0)) != BALLPASS_OK) return failed(simulation);
        ballpass_read(simulation, columns);
        for (int i = 0; i < 3; i++) {
            const char *unit, *name = ballpass_column(i, &unit);
            printf("%s = %.6g %s%s", name, columns[i], unit, i < 2 ? ", " : "\n");
        }
    }
    free(columns);
    ballpass_free(simulation);
    return EXIT_SUCCESS;
}
