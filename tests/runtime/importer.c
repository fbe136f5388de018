/* An importer of FMI 2.0 as small as can be: library, GUID, how many numbers to read and their references; steps of 0.01 s up to 0.24 s. */
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

#include "fmi2.h"

static void told(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    fprintf(stderr, "%s\n", message);
}

#define FUNCTION(answer, name, ...) answer (*name)(__VA_ARGS__) = (answer (*)(__VA_ARGS__))GetProcAddress(library, #name)

int main(int count, char **given)
{
    HMODULE library = LoadLibraryA(given[1]);
    if (!library) return 1;
    FUNCTION(fmi2Component, fmi2Instantiate, fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *, fmi2Boolean, fmi2Boolean);
    FUNCTION(fmi2Status, fmi2SetupExperiment, fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real);
    FUNCTION(fmi2Status, fmi2EnterInitializationMode, fmi2Component);
    FUNCTION(fmi2Status, fmi2ExitInitializationMode, fmi2Component);
    FUNCTION(fmi2Status, fmi2DoStep, fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
    FUNCTION(fmi2Status, fmi2GetReal, fmi2Component, const fmi2ValueReference *, size_t, fmi2Real *);
    const fmi2CallbackFunctions callbacks = {.logger = told};
    const fmi2Component run = fmi2Instantiate("one", fmi2CoSimulation, given[2], NULL, &callbacks, 0, 0);
    if (!run || fmi2SetupExperiment(run, 0, 0.0, 0.0, 1, 0.24) || fmi2EnterInitializationMode(run) || fmi2ExitInitializationMode(run)) return 2;
    for (int step = 0; step < 24; step++) {
        if (fmi2DoStep(run, step * 0.01, (step + 1) * 0.01 - step * 0.01, 1)) return 3;
        for (int k = 3; k < count; k++) {
            const fmi2ValueReference place = (fmi2ValueReference)atoi(given[k]);
            double value;
            if (fmi2GetReal(run, &place, 1, &value)) return 4;
            printf("%.17g%s", value, k + 1 < count ? " " : "\n");
        }
    }
    return 0;
}
