/* The interface of FMI 3.0 co-simulation over ballpass.h.

   Value references: 0 is the time; then parameters and inputs, states, derivatives of states, outputs that are no states, in the order of
   the scene; then the driver's speed, where that is an input in place of its table's parameters.  Functions of other kinds of interface, and of types that no variable has, are there and return fmi3Error with a message. */
#include "fmi3Functions.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ballpass.h"
#include "fmu.h"
#include "scene.h"
#include "simulation.h"
#include "tangents.h"

enum { FIRST_STATE = 1 + SCENE_PARAMETERS, FIRST_RATE = FIRST_STATE + SCENE_STATES, FIRST_OUTPUT = FIRST_RATE + SCENE_STATES };

/* State of an instance, as the standard names it. */
typedef enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, TERMINATED = 8 } mode;

/* Data of an instance that are kept and restored with the simulation. */
typedef struct {
    mode where;
    int prepared; /* whether the run is begun with the values at hand */
    ballpass_request asked;
    int end_known;
    int driven;   /* whether it has been another one than the driver's */
    double speed; /* of the driver, where it is an input [rad/s] */
} bookkeeping;

typedef struct {
    bookkeeping own;
    ballpass *simulation;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    int early_return;
} instance_of;

/* A kept state, also as it is serialized: sums of its bytes detect one that is damaged or of another FMU. */
typedef struct {
    char token[sizeof FMU_TOKEN];
    uint64_t sum;
    bookkeeping own;
} kept_head;

static size_t kept_size(void) { return sizeof(kept_head) + ballpass_state_size(); }

/* FNV-1a over all but the sum itself. */
static uint64_t sum_of(const unsigned char *bytes, size_t size)
{
    uint64_t sum = 14695981039346656037u;
    for (size_t i = 0; i < size; i++) {
        const int own = i >= offsetof(kept_head, sum) && i < offsetof(kept_head, sum) + sizeof(uint64_t);
        sum = (sum ^ (own ? 0 : bytes[i])) * 1099511628211u;
    }
    return sum;
}

static fmi3Status fail(instance_of *at, const char *format, ...)
{
    char text[5000];
    va_list given;
    va_start(given, format);
    vsnprintf(text, sizeof text, format, given);
    va_end(given);
    if (at && at->log) at->log(at->environment, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

static fmi3Status answered(instance_of *at, const char *call, int answer)
{
    return answer == BALLPASS_OK ? fmi3OK : fail(at, "%s: %s", call, ballpass_error(at->simulation));
}

static const char *mode_name(mode where)
{
    return where == INSTANTIATED ? "Instantiated" : where == INITIALIZATION ? "Initialization Mode" : where == STEP ? "Step Mode" : "Terminated";
}

/* The instance, where the call is allowed there; else NULL, with a message. */
static instance_of *in(fmi3Instance instance, int modes, const char *call)
{
    instance_of *at = instance;
    if (!at || ((int)at->own.where & modes)) return at;
    fail(at, "%s: is not allowed in the state %s.", call, mode_name(at->own.where));
    return NULL;
}

/* The driver's speed as an input: before the run, that of all rows of its table; then what a step is to reach. */
static void set_speed(instance_of *at, double speed)
{
    at->own.speed = speed;
    for (int k = 0; k < FMU_SPEEDS && at->own.where != STEP; k++) ballpass_put(at->simulation, fmu_table[k], speed);
}

static int in_table(size_t place)
{
    int found = 0;
    for (int k = 0; k < FMU_TABLE; k++) found |= (size_t)fmu_table[k] == place;
    return found;
}

enum { ANY = INSTANTIATED | INITIALIZATION | STEP | TERMINATED, RUNNING = INITIALIZATION | STEP | TERMINATED };

/* creation */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
                                         fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    instance_of before = {.environment = instanceEnvironment, .log = logMessage};
    (void)instanceName, (void)resourcePath, (void)visible, (void)loggingOn, (void)requiredIntermediateVariables, (void)intermediateUpdate;
    if (!instantiationToken || strcmp(instantiationToken, FMU_TOKEN) != 0) {
        fail(&before, "fmi3InstantiateCoSimulation: the instantiation token %s was given. Allowed: %s, of modelDescription.xml.",
             instantiationToken ? instantiationToken : "NULL", FMU_TOKEN);
        return NULL;
    }
    if (eventModeUsed || nRequiredIntermediateVariables > 0) {
        fail(&before, "fmi3InstantiateCoSimulation: %s. Allowed: neither, as modelDescription.xml says.",
             eventModeUsed ? "event mode is to be used" : "intermediate variables are required");
        return NULL;
    }
    instance_of *at = calloc(1, sizeof *at);
    if (at) at->simulation = ballpass_make();
    if (!at || !at->simulation) {
        fail(&before, "fmi3InstantiateCoSimulation: the memory is too small.");
        free(at);
        return NULL;
    }
    at->environment = instanceEnvironment;
    at->log = logMessage;
    at->early_return = earlyReturnAllowed;
    at->own.where = INSTANTIATED;
    if (FMU_DRIVEN) set_speed(at, ballpass_value(at->simulation, fmu_table[0]));
    at->own.asked = ballpass_default(at->simulation);
    return at;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    instance_of *at = instance;
    if (!at) return;
    ballpass_free(at->simulation);
    free(at);
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[])
{
    instance_of *at = instance;
    (void)loggingOn; /* errors are all that is logged, and always */
    for (size_t k = 0; at && k < nCategories; k++)
        if (strcmp(categories[k], "logStatusError") != 0)
            return fail(at, "fmi3SetDebugLogging: the category %s was given. Allowed: logStatusError.", categories[k]);
    return at ? fmi3OK : fmi3Error;
}

/* initialization, end, reset */

/* Begin the run with the values that are set, where that is not done. */
static fmi3Status prepare(instance_of *at, const char *call)
{
    if (at->own.prepared) return fmi3OK;
    ballpass_request asked = at->own.asked;
    if (!at->own.end_known) asked.end = asked.begin + ballpass_default(at->simulation).end;
    const fmi3Status status = answered(at, call, ballpass_start(at->simulation, &asked));
    at->own.prepared = status == fmi3OK;
    return status;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    instance_of *at = in(instance, INSTANTIATED, "fmi3EnterInitializationMode");
    if (!at) return fmi3Error;
    if (!(isfinite(startTime) && startTime >= 0.0) || (stopTimeDefined && !(stopTime > startTime && isfinite(stopTime))))
        return fail(at, "fmi3EnterInitializationMode: a run from %g s to %g s was asked for. Allowed: a start from 0 on, a stop after it.", startTime,
                    stopTimeDefined ? stopTime : INFINITY);
    if (toleranceDefined && !(tolerance >= 1e-13 && tolerance <= 0.1))
        return fail(at, "fmi3EnterInitializationMode: the tolerance %g was given. Allowed: a number from 1e-13 to 0.1.", tolerance);
    at->own.asked = ballpass_default(at->simulation);
    at->own.asked.begin = startTime;
    if (toleranceDefined) at->own.asked.rtol = tolerance;
    if (stopTimeDefined) at->own.asked.end = stopTime;
    at->own.end_known = stopTimeDefined;
    at->own.where = INITIALIZATION;
    at->own.prepared = 0;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    instance_of *at = in(instance, INITIALIZATION, "fmi3ExitInitializationMode");
    if (!at || prepare(at, "fmi3ExitInitializationMode") != fmi3OK) return fmi3Error;
    at->own.where = STEP;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    instance_of *at = in(instance, STEP, "fmi3Terminate");
    if (!at) return fmi3Error;
    at->own.where = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    instance_of *at = in(instance, ANY, "fmi3Reset");
    if (!at) return fmi3Error;
    ballpass *fresh = ballpass_make();
    if (!fresh) return fail(at, "fmi3Reset: the memory is too small.");
    ballpass_free(at->simulation);
    at->simulation = fresh;
    at->own = (bookkeeping){.where = INSTANTIATED, .asked = ballpass_default(fresh)};
    if (FMU_DRIVEN) set_speed(at, ballpass_value(fresh, fmu_table[0]));
    return fmi3OK;
}

/* values */

/* Place of a variable's numbers among those of its kind, and how many; 0 where there is no such variable. */
typedef enum { NONE, TIME, PARAMETER, STATE, RATE, OUTPUT, SPEED } kind;

static kind find(fmi3ValueReference reference, size_t *first, size_t *count)
{
    *count = 1;
    *first = 0;
    if (reference == 0) return TIME;
    if (reference < FIRST_STATE) return *first = reference - 1, in_table(*first) ? NONE : PARAMETER;
    if (reference < FIRST_RATE) return *first = reference - FIRST_STATE, STATE;
    if (reference < FIRST_OUTPUT) return *first = reference - FIRST_RATE, RATE;
    const size_t k = reference - FIRST_OUTPUT;
    if (k == FMU_OUTPUTS && FMU_DRIVEN) return SPEED;
    if (k >= FMU_OUTPUTS) return NONE;
    *first = (size_t)fmu_outputs[k];
    *count = (size_t)(fmu_outputs[k + 1] - fmu_outputs[k]);
    return OUTPUT;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    static const char call[] = "fmi3GetFloat64";
    double columns[1 + SCENE_STATES + SCENE_OUTPUTS], rates[SCENE_STATES];
    int read = 0;
    size_t at_value = 0;
    instance_of *at = in(instance, ANY, call);
    if (!at) return fmi3Error;
    for (size_t k = 0; k < nValueReferences; k++) {
        size_t first, count;
        const kind what = find(valueReferences[k], &first, &count);
        if (what == NONE) return fail(at, "%s: the value reference %u was given. Allowed: those of modelDescription.xml.", call, (unsigned)valueReferences[k]);
        if (count > nValues - at_value) return fail(at, "%s: the variables have more than the %zu values that were given.", call, nValues);
        if (what == PARAMETER) {
            values[at_value++] = ballpass_value(at->simulation, (int)first);
            continue;
        }
        if (what == SPEED) {
            values[at_value++] = at->own.speed;
            continue;
        }
        if (what == TIME && !at->own.prepared) {
            values[at_value++] = at->own.asked.begin;
            continue;
        }
        if (!read) {
            if (at->own.where == INSTANTIATED) return fail(at, "%s: states and outputs are not known before Initialization Mode.", call);
            if (prepare(at, call) != fmi3OK || answered(at, call, ballpass_read(at->simulation, columns)) != fmi3OK) return fmi3Error;
            read = 1;
        }
        if (what == RATE) {
            double u[SCENE_INPUTS > 0 ? SCENE_INPUTS : 1];
            const double t = ballpass_moment(at->simulation, u), *p = ballpass_values(at->simulation);
            scene_rates(t, ballpass_states(at->simulation), u, p, p + SCENE_PARAMETERS, rates);
        }
        const double *from = what == TIME ? columns : what == STATE ? columns + 1 : what == RATE ? rates : columns + 1 + SCENE_STATES;
        memcpy(values + at_value, from + first, count * sizeof *values);
        at_value += count;
    }
    return at_value == nValues ? fmi3OK : fail(at, "%s: %zu values were given. Allowed: %zu.", call, nValues, at_value);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Float64 values[],
                          size_t nValues)
{
    static const char call[] = "fmi3SetFloat64";
    instance_of *at = in(instance, INSTANTIATED | INITIALIZATION | STEP, call);
    if (!at) return fmi3Error;
    if (nValues != nValueReferences) return fail(at, "%s: %zu values were given. Allowed: %zu, one for each variable that may be set.", call, nValues, nValueReferences);
    for (size_t k = 0; k < nValueReferences; k++) {
        size_t first, count;
        const kind what = find(valueReferences[k], &first, &count);
        if (what != PARAMETER && what != SPEED)
            return fail(at, "%s: the value reference %u was given. Allowed: parameters and inputs.", call, (unsigned)valueReferences[k]);
        if (at->own.where != STEP) {
            ballpass_stop(at->simulation);
            at->own.prepared = 0;
        }
        if (what == SPEED) {
            if (!isfinite(values[k])) return fail(at, "%s: the driver's speed %g was given. Allowed: a finite number [rad/s].", call, values[k]);
            set_speed(at, values[k]);
            continue;
        }
        const fmi3Status status = answered(at, call, ballpass_set_at(at->simulation, (int)first, values[k]));
        if (status != fmi3OK) return status;
    }
    return fmi3OK;
}

/* steps */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    static const char call[] = "fmi3DoStep";
    instance_of *at = in(instance, STEP, call);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!at) return fmi3Error;
    const double here = ballpass_time(at->simulation);
    double there = currentCommunicationPoint + communicationStepSize;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = here;
    if (!(communicationStepSize > 0.0 && isfinite(there)))
        return fail(at, "%s: a step of %g s was given. Allowed: a time above 0.", call, communicationStepSize);
    if (!(fabs(currentCommunicationPoint - here) <= 1e-9 * (fabs(here) + communicationStepSize)))
        return fail(at, "%s: the communication point %.9g s was given. Allowed: %.9g s, where the last step has ended.", call, currentCommunicationPoint, here);
    const double last = at->own.asked.end;
    if (at->own.end_known && there - last > 1e-9 * (fabs(last) + communicationStepSize))
        return fail(at, "%s: a step to %.9g s was given. Allowed: times up to the stop time, %.9g s.", call, there, last);
    /* with an unchanged speed results equal those without such an input to the bit */
    if (FMU_DRIVEN && at->own.speed != ballpass_driver_speed(at->simulation)) at->own.driven = 1;
    if (at->own.driven && answered(at, call, ballpass_drive(at->simulation, at->own.speed)) != fmi3OK) return fmi3Error;
    if (at->early_return) {
        const double next = ballpass_next_switch(at->simulation);
        if (next > here && next < there * (1.0 - 1e-12)) {
            if (at->own.driven) { /* a part of the way to the speed at the end */
                const double speed = ballpass_driver_speed(at->simulation);
                ballpass_drive(at->simulation, speed + (at->own.speed - speed) * (next - here) / (there - here));
            }
            there = next;
            *earlyReturn = fmi3True;
        }
    }
    const fmi3Status status = answered(at, call, ballpass_run_to(at->simulation, there < here ? here : there));
    *lastSuccessfulTime = ballpass_time(at->simulation);
    if (status != fmi3OK) *earlyReturn = fmi3False;
    return status;
}

/* derivatives */

/* Seeds of knowns as directions: of time, state, parameters. */
static fmi3Status seeds(instance_of *at, const char *call, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                        double *dt, double *dx, double *dp)
{
    if (nSeed != nKnowns) return fail(at, "%s: %zu seeds were given. Allowed: %zu, one for each known.", call, nSeed, nKnowns);
    for (size_t k = 0; k < nKnowns; k++) {
        size_t first, count;
        const kind what = find(knowns[k], &first, &count);
        if (what == TIME) *dt += seed[k];
        else if (what == STATE) dx[first] += seed[k];
        else if (what == PARAMETER) dp[first] += seed[k];
        else if (what == SPEED) { /* in a run it has no effect before the next step */
            for (int row = 0; row < FMU_SPEEDS && at->own.where == INITIALIZATION; row++) dp[fmu_table[row]] += seed[k];
        } else return fail(at, "%s: the known %u was given. Allowed: time, states, inputs and parameters.", call, (unsigned)knowns[k]);
    }
    return fmi3OK;
}

/* Derivatives of unknowns along directions. */
static fmi3Status derive(instance_of *at, const char *call, double dt, const double *dx, const double *dp, const fmi3ValueReference unknowns[],
                         size_t nUnknowns, fmi3Float64 found[], size_t nFound)
{
    double moved[SCENE_STATES + SCENE_OUTPUTS];
    size_t at_value = 0;
    ballpass_tangent(at->simulation, dt, dx, dp, moved);
    for (size_t k = 0; k < nUnknowns; k++) {
        size_t first, count;
        const kind what = find(unknowns[k], &first, &count);
        if (what != STATE && what != RATE && what != OUTPUT)
            return fail(at, "%s: the unknown %u was given. Allowed: states, their derivatives, and outputs.", call, (unsigned)unknowns[k]);
        if (count > nFound - at_value) return fail(at, "%s: the unknowns have more than the %zu values that were given.", call, nFound);
        memcpy(found + at_value, (what == STATE ? dx : what == RATE ? moved : moved + SCENE_STATES) + first, count * sizeof *found);
        at_value += count;
    }
    return at_value == nFound ? fmi3OK : fail(at, "%s: %zu values were given. Allowed: %zu.", call, nFound, at_value);
}

static fmi3Status ready(instance_of *at, const char *call)
{
    double columns[1 + SCENE_STATES + SCENE_OUTPUTS];
    if (!at || prepare(at, call) != fmi3OK) return fmi3Error;
    return answered(at, call, ballpass_read(at->simulation, columns)); /* so that values that were set are in use */
}

/* Derivatives of unknowns along seeds of knowns. */
static fmi3Status along(instance_of *at, const char *call, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 found[], size_t nFound)
{
    double dt = 0.0, dx[SCENE_STATES] = {0.0}, dp[SCENE_PARAMETERS] = {0.0};
    if (seeds(at, call, knowns, nKnowns, seed, nSeed, &dt, dx, dp) != fmi3OK) return fmi3Error;
    if (at->own.where == INITIALIZATION) ballpass_initial_tangent(at->simulation, dp, dx);
    return derive(at, call, dt, dx, dp, unknowns, nUnknowns, found, nFound);
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    static const char call[] = "fmi3GetDirectionalDerivative";
    instance_of *at = in(instance, RUNNING, call);
    if (ready(at, call) != fmi3OK) return fmi3Error;
    return along(at, call, unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity);
}

/* One direction for each known: models are small, and directions cheap. */
fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    static const char call[] = "fmi3GetAdjointDerivative";
    const double one = 1.0;
    instance_of *at = in(instance, RUNNING, call);
    if (ready(at, call) != fmi3OK) return fmi3Error;
    if (nSensitivity != nKnowns) return fail(at, "%s: %zu values were given. Allowed: %zu, one for each known.", call, nSensitivity, nKnowns);
    double *found = malloc((nSeed ? nSeed : 1) * sizeof *found);
    fmi3Status status = found ? fmi3OK : fail(at, "%s: the memory is too small.", call);
    for (size_t k = 0; k < nKnowns && status == fmi3OK; k++) {
        status = along(at, call, unknowns, nUnknowns, knowns + k, 1, &one, 1, found, nSeed);
        sensitivity[k] = 0.0;
        for (size_t i = 0; i < nSeed && status == fmi3OK; i++) sensitivity[k] += seed[i] * found[i];
    }
    free(found);
    return status;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues)
{
    static const char call[] = "fmi3GetOutputDerivatives";
    double u[SCENE_INPUTS > 0 ? SCENE_INPUTS : 1], dx[SCENE_STATES], dp[SCENE_PARAMETERS] = {0.0};
    instance_of *at = in(instance, STEP | TERMINATED, call);
    if (ready(at, call) != fmi3OK) return fmi3Error;
    for (size_t k = 0; k < nValueReferences; k++)
        if (orders[k] != 1) return fail(at, "%s: order %d was asked for. Allowed: 1.", call, (int)orders[k]);
    const double t = ballpass_moment(at->simulation, u), *p = ballpass_values(at->simulation);
    scene_rates(t, ballpass_states(at->simulation), u, p, p + SCENE_PARAMETERS, dx);
    return derive(at, call, 1.0, dx, dp, valueReferences, nValueReferences, values, nValues);
}

/* states kept */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    instance_of *at = in(instance, ANY, "fmi3GetFMUState");
    if (!at) return fmi3Error;
    kept_head *kept = *FMUState ? *FMUState : calloc(1, kept_size());
    if (!kept) return fail(at, "fmi3GetFMUState: the memory is too small.");
    memcpy(kept->token, FMU_TOKEN, sizeof kept->token);
    memcpy(&kept->own, &at->own, sizeof kept->own);
    ballpass_save(at->simulation, kept + 1);
    *FMUState = kept;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    instance_of *at = in(instance, ANY, "fmi3SetFMUState");
    const kept_head *kept = FMUState;
    if (!at) return fmi3Error;
    if (!kept) return fail(at, "fmi3SetFMUState: no state was given. Allowed: one that this FMU has given.");
    at->own = kept->own;
    return answered(at, "fmi3SetFMUState", ballpass_restore(at->simulation, kept + 1, ballpass_state_size()));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)instance;
    if (!FMUState) return fmi3OK;
    free(*FMUState);
    *FMUState = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    instance_of *at = in(instance, ANY, "fmi3SerializedFMUStateSize");
    if (!at) return fmi3Error;
    if (!FMUState) return fail(at, "fmi3SerializedFMUStateSize: no state was given. Allowed: one that this FMU has given.");
    *size = kept_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    instance_of *at = in(instance, ANY, "fmi3SerializeFMUState");
    if (!at) return fmi3Error;
    if (!FMUState || size < kept_size()) return fail(at, "fmi3SerializeFMUState: a state and %zu bytes are needed; %zu bytes were given.", kept_size(), size);
    kept_head *kept = FMUState;
    kept->sum = sum_of((const unsigned char *)kept, kept_size());
    memcpy(serializedState, kept, kept_size());
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState)
{
    static const char call[] = "fmi3DeserializeFMUState";
    instance_of *at = in(instance, ANY, call);
    kept_head head;
    if (!at) return fmi3Error;
    if (size != kept_size()) return fail(at, "%s: %zu bytes were given. Allowed: %zu of this very FMU.", call, size, kept_size());
    memcpy(&head, serializedState, sizeof head);
    if (memcmp(head.token, FMU_TOKEN, sizeof head.token) != 0 || head.sum != sum_of(serializedState, size))
        return fail(at, "%s: the bytes are not those that this very FMU has written.", call);
    void *kept = *FMUState ? *FMUState : malloc(size);
    if (!kept) return fail(at, "%s: the memory is too small.", call);
    memcpy(kept, serializedState, size);
    *FMUState = kept;
    return fmi3OK;
}

/* functions that this FMU does not have */

static fmi3Status lacks(fmi3Instance instance, const char *call, const char *what)
{
    return fail(instance, "%s: %s.", call, what);
}

#define NO_VARIABLES "no variable has this type; all are of type Float64"
#define OTHER_TYPE(T)                                                                                                                        \
    fmi3Status fmi3Get##T(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3##T values[],      \
                          size_t nValues)                                                                                                    \
    {                                                                                                                                        \
        (void)valueReferences, (void)values, (void)nValues;                                                                                  \
        return nValueReferences ? lacks(instance, "fmi3Get" #T, NO_VARIABLES) : fmi3OK;                                                      \
    }                                                                                                                                        \
    fmi3Status fmi3Set##T(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3##T values[], \
                          size_t nValues)                                                                                                    \
    {                                                                                                                                        \
        (void)valueReferences, (void)values, (void)nValues;                                                                                  \
        return nValueReferences ? lacks(instance, "fmi3Set" #T, NO_VARIABLES) : fmi3OK;                                                      \
    }
OTHER_TYPE(Float32)
OTHER_TYPE(Int8)
OTHER_TYPE(UInt8)
OTHER_TYPE(Int16)
OTHER_TYPE(UInt16)
OTHER_TYPE(Int32)
OTHER_TYPE(UInt32)
OTHER_TYPE(Int64)
OTHER_TYPE(UInt64)
OTHER_TYPE(Boolean)
OTHER_TYPE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, size_t valueSizes[],
                         fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return nValueReferences ? lacks(instance, "fmi3GetBinary", NO_VARIABLES) : fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return nValueReferences ? lacks(instance, "fmi3SetBinary", NO_VARIABLES) : fmi3OK;
}

/* A function with `given` that is refused; `unused` casts its arguments to void. */
#define REFUSED(name, what, given, unused) \
    fmi3Status name given                  \
    {                                      \
        unused;                            \
        return lacks(instance, #name, what); \
    }
#define NO_CLOCKS "this FMU has no clocks"
#define NO_EXCHANGE "this FMU is for co-simulation; the function belongs to model exchange"
#define NO_EVENTS "this FMU has no event mode; loads that switch are handled within a step"
#define REFERENCES fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences
#define NO_REFERENCES (void)valueReferences, (void)nValueReferences

REFUSED(fmi3GetClock, NO_CLOCKS, (REFERENCES, fmi3Clock values[]), (NO_REFERENCES, (void)values))
REFUSED(fmi3SetClock, NO_CLOCKS, (REFERENCES, const fmi3Clock values[]), (NO_REFERENCES, (void)values))
REFUSED(fmi3GetIntervalDecimal, NO_CLOCKS, (REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]),
        (NO_REFERENCES, (void)intervals, (void)qualifiers))
REFUSED(fmi3GetIntervalFraction, NO_CLOCKS, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]),
        (NO_REFERENCES, (void)counters, (void)resolutions, (void)qualifiers))
REFUSED(fmi3GetShiftDecimal, NO_CLOCKS, (REFERENCES, fmi3Float64 shifts[]), (NO_REFERENCES, (void)shifts))
REFUSED(fmi3GetShiftFraction, NO_CLOCKS, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]),
        (NO_REFERENCES, (void)counters, (void)resolutions))
REFUSED(fmi3SetIntervalDecimal, NO_CLOCKS, (REFERENCES, const fmi3Float64 intervals[]), (NO_REFERENCES, (void)intervals))
REFUSED(fmi3SetIntervalFraction, NO_CLOCKS, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
        (NO_REFERENCES, (void)counters, (void)resolutions))
REFUSED(fmi3SetShiftDecimal, NO_CLOCKS, (REFERENCES, const fmi3Float64 shifts[]), (NO_REFERENCES, (void)shifts))
REFUSED(fmi3SetShiftFraction, NO_CLOCKS, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
        (NO_REFERENCES, (void)counters, (void)resolutions))
REFUSED(fmi3ActivateModelPartition, NO_CLOCKS, (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime),
        ((void)clockReference, (void)activationTime))
REFUSED(fmi3EnterEventMode, NO_EVENTS, (fmi3Instance instance), (void)0)
REFUSED(fmi3EnterStepMode, NO_EVENTS, (fmi3Instance instance), (void)0)
REFUSED(fmi3EvaluateDiscreteStates, NO_EVENTS, (fmi3Instance instance), (void)0)
REFUSED(fmi3UpdateDiscreteStates, NO_EVENTS,
        (fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
         fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime),
        ((void)discreteStatesNeedUpdate, (void)terminateSimulation, (void)nominalsOfContinuousStatesChanged, (void)valuesOfContinuousStatesChanged,
         (void)nextEventTimeDefined, (void)nextEventTime))
REFUSED(fmi3EnterConfigurationMode, "this FMU has no structural parameters", (fmi3Instance instance), (void)0)
REFUSED(fmi3ExitConfigurationMode, "this FMU has no structural parameters", (fmi3Instance instance), (void)0)
REFUSED(fmi3GetNumberOfVariableDependencies, "this FMU does not provide dependencies of elements",
        (fmi3Instance instance, fmi3ValueReference valueReference, size_t *nDependencies), ((void)valueReference, (void)nDependencies))
REFUSED(fmi3GetVariableDependencies, "this FMU does not provide dependencies of elements",
        (fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
         size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[], size_t nDependencies),
        ((void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents, (void)dependencyKinds,
         (void)nDependencies))
REFUSED(fmi3EnterContinuousTimeMode, NO_EXCHANGE, (fmi3Instance instance), (void)0)
REFUSED(fmi3CompletedIntegratorStep, NO_EXCHANGE,
        (fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation),
        ((void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation))
REFUSED(fmi3SetTime, NO_EXCHANGE, (fmi3Instance instance, fmi3Float64 time), (void)time)
REFUSED(fmi3SetContinuousStates, NO_EXCHANGE, (fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates),
        ((void)continuousStates, (void)nContinuousStates))
REFUSED(fmi3GetContinuousStateDerivatives, NO_EXCHANGE, (fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates),
        ((void)derivatives, (void)nContinuousStates))
REFUSED(fmi3GetEventIndicators, NO_EXCHANGE, (fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators),
        ((void)eventIndicators, (void)nEventIndicators))
REFUSED(fmi3GetContinuousStates, NO_EXCHANGE, (fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates),
        ((void)continuousStates, (void)nContinuousStates))
REFUSED(fmi3GetNominalsOfContinuousStates, NO_EXCHANGE, (fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates),
        ((void)nominals, (void)nContinuousStates))
REFUSED(fmi3GetNumberOfEventIndicators, NO_EXCHANGE, (fmi3Instance instance, size_t *nEventIndicators), (void)nEventIndicators)
REFUSED(fmi3GetNumberOfContinuousStates, NO_EXCHANGE, (fmi3Instance instance, size_t *nContinuousStates), (void)nContinuousStates)

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    instance_of before = {.environment = instanceEnvironment, .log = logMessage};
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    fail(&before, "fmi3InstantiateModelExchange: " NO_EXCHANGE ".");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
                                               fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                               fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    instance_of before = {.environment = instanceEnvironment, .log = logMessage};
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn, (void)clockUpdate, (void)lockPreemption,
        (void)unlockPreemption;
    fail(&before, "fmi3InstantiateScheduledExecution: this FMU is for co-simulation.");
    return NULL;
}
