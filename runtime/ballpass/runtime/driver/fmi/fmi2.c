/* The interface of FMI 2.0 co-simulation: each function is one of FMI 3.0, compiled here with value references of single numbers, for FMI 2.0
   has no arrays.  Functions of types that no variable has are there and return fmi2Error with a message. */
#define FMI3_Export /* internal here */
#include "fmi.c"
#include "fmi2.h"

typedef struct {
    fmi3Instance run;
    fmi2CallbackFunctions callbacks;
    const char *call; /* under way, for messages */
    struct {
        int tolerance_given, stop_given;
        double tolerance, start, stop;
    } asked;
    char name[];
} component;

/* A message of an FMI 3.0 function as one of the function that was called. */
static void pass_on(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    const component *at = environment;
    const char *text = strstr(message, ": ");
    if (at->callbacks.logger)
        at->callbacks.logger(at->callbacks.componentEnvironment, at->name, (fmi2Status)status, category, "%s%s", at->call, text ? text : message);
}

/* The instance of a component, on the way into a function. */
static fmi3Instance run_of(fmi2Component c, const char *call)
{
    component *at = c;
    if (at) at->call = call;
    return at ? at->run : NULL;
}

#define RUN run_of(c, __func__)
#define FMI2(name) FMI2_EXPORT fmi2Status name
#define ANSWER(call)                                                                                                                        \
    {                                                                                                                                       \
        return (fmi2Status)(call);                                                                                                          \
    }
#define READS fmi2Component c, const fmi2ValueReference vr[], size_t nvr

FMI2_EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_EXPORT fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String guid, fmi2String resourceLocation,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    const size_t size = instanceName ? strlen(instanceName) + 1 : 1;
    component *at = calloc(1, sizeof *at + size);
    if (!at) return NULL;
    if (instanceName) memcpy(at->name, instanceName, size);
    if (functions) at->callbacks = *functions;
    at->call = __func__;
    if (fmuType != fmi2CoSimulation) pass_on(at, fmi3Error, "logStatusError", "fmi2Instantiate: this FMU is for co-simulation.");
    else at->run = fmi3InstantiateCoSimulation(instanceName, guid, resourceLocation, visible != 0, loggingOn != 0, 0, 0, NULL, 0, at, pass_on, NULL);
    if (at->run) return at;
    free(at);
    return NULL;
}

FMI2_EXPORT void fmi2FreeInstance(fmi2Component c)
{
    fmi3FreeInstance(RUN);
    free(c);
}

FMI2(fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) ANSWER(fmi3SetDebugLogging(RUN, on != 0, n, categories))

/* initialization, end, reset */

FMI2(fmi2SetupExperiment)(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime, fmi2Boolean stopTimeDefined,
                          fmi2Real stopTime)
{
    component *at = c;
    if (!in(RUN, INSTANTIATED, __func__)) return fmi2Error;
    at->asked.tolerance_given = toleranceDefined, at->asked.tolerance = tolerance;
    at->asked.stop_given = stopTimeDefined, at->asked.stop = stopTime;
    at->asked.start = startTime;
    return fmi2OK;
}

FMI2(fmi2EnterInitializationMode)(fmi2Component c)
{
    const fmi3Instance run = RUN;
    const component *at = c;
    if (!run) return fmi2Error;
    return (fmi2Status)fmi3EnterInitializationMode(run, at->asked.tolerance_given != 0, at->asked.tolerance, at->asked.start,
                                                   at->asked.stop_given != 0, at->asked.stop);
}

FMI2(fmi2ExitInitializationMode)(fmi2Component c) ANSWER(fmi3ExitInitializationMode(RUN))
FMI2(fmi2Terminate)(fmi2Component c) ANSWER(fmi3Terminate(RUN))

FMI2(fmi2Reset)(fmi2Component c)
{
    component *at = c;
    if (at) memset(&at->asked, 0, sizeof at->asked);
    return (fmi2Status)fmi3Reset(RUN);
}

/* values */

FMI2(fmi2GetReal)(READS, fmi2Real value[]) ANSWER(fmi3GetFloat64(RUN, vr, nvr, value, nvr))
FMI2(fmi2SetReal)(READS, const fmi2Real value[]) ANSWER(fmi3SetFloat64(RUN, vr, nvr, value, nvr))

#define OTHER_TYPE_2(name, values)                                                                     \
    FMI2(name)(READS, values)                                                                          \
    {                                                                                                  \
        (void)vr, (void)value;                                                                         \
        return nvr ? (fmi2Status)lacks(RUN, #name, "all variables are of type Real") : fmi2OK;         \
    }
OTHER_TYPE_2(fmi2GetInteger, fmi2Integer value[])
OTHER_TYPE_2(fmi2SetInteger, const fmi2Integer value[])
OTHER_TYPE_2(fmi2GetBoolean, fmi2Boolean value[])
OTHER_TYPE_2(fmi2SetBoolean, const fmi2Boolean value[])
OTHER_TYPE_2(fmi2GetString, fmi2String value[])
OTHER_TYPE_2(fmi2SetString, const fmi2String value[])

FMI2(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknowns[], size_t nUnknown, const fmi2ValueReference knowns[], size_t nKnown,
                                   const fmi2Real seed[], fmi2Real found[])
    ANSWER(fmi3GetDirectionalDerivative(RUN, unknowns, nUnknown, knowns, nKnown, seed, nKnown, found, nUnknown))
FMI2(fmi2GetRealOutputDerivatives)(READS, const fmi2Integer order[], fmi2Real value[]) ANSWER(fmi3GetOutputDerivatives(RUN, vr, nvr, order, value, nvr))
FMI2(fmi2SetRealInputDerivatives)(READS, const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return (fmi2Status)lacks(RUN, __func__, "inputs are held over a step");
}

/* states kept */

FMI2(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state) ANSWER(fmi3GetFMUState(RUN, state))
FMI2(fmi2SetFMUstate)(fmi2Component c, fmi2FMUstate state) ANSWER(fmi3SetFMUState(RUN, state))
FMI2(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state) ANSWER(fmi3FreeFMUState(RUN, state))
FMI2(fmi2SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size) ANSWER(fmi3SerializedFMUStateSize(RUN, state, size))
FMI2(fmi2SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
    ANSWER(fmi3SerializeFMUState(RUN, state, (fmi3Byte *)bytes, size))
FMI2(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
    ANSWER(fmi3DeserializeFMUState(RUN, (const fmi3Byte *)bytes, size, state))

/* steps */

FMI2(fmi2DoStep)(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    fmi3Boolean events, terminate, early;
    double reached;
    return (fmi2Status)fmi3DoStep(RUN, currentCommunicationPoint, communicationStepSize, noSetFMUStatePriorToCurrentPoint != 0, &events,
                                  &terminate, &early, &reached);
}

/* a step ends before fmi2DoStep returns: nothing is pending */
FMI2(fmi2CancelStep)(fmi2Component c) ANSWER(lacks(RUN, __func__, "no step is under way"))

FMI2(fmi2GetRealStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    const instance_of *at = RUN;
    if (!at || kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ballpass_time(at->simulation);
    return fmi2OK;
}

#define NO_STATUS(name, T)                                              \
    FMI2(name)(fmi2Component c, const fmi2StatusKind kind, T *value)     \
    {                                                                   \
        (void)c, (void)kind, (void)value;                               \
        return fmi2Discard;                                             \
    }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetBooleanStatus, fmi2Boolean)
NO_STATUS(fmi2GetStringStatus, fmi2String)
