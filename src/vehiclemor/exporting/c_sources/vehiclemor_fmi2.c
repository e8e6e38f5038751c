/* FMI 2.0, model exchange and co-simulation: https://fmi-standard.org/docs/2.0.5/
   With -DFMI2_HEADER the declarations are those of the standard's header. */

#ifdef FMI2_HEADER
#include "fmi2Functions.h"
#else
#include <stddef.h>
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum {
    fmi2DoStepStatus,
    fmi2PendingStatus,
    fmi2LastSuccessfulTime,
    fmi2Terminated
} fmi2StatusKind;
/* Callbacks are never called. */
typedef struct fmi2CallbackFunctions fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded, terminateSimulation, nominalsOfContinuousStatesChanged,
        valuesOfContinuousStatesChanged, nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#endif

#include "vehiclemor_fmu.h"

#define STATUS EXPORTED fmi2Status
#define REFERENCES const fmi2ValueReference r[], size_t n
/* Transitions between modes that change nothing. */
#define NOTHING(name) \
    STATUS name(fmi2Component m) { return m ? fmi2OK : fmi2Error; }
/* What the model doesn't have. */
#define NONE(name, ...) \
    STATUS name(fmi2Component m, __VA_ARGS__) { return fmi2Error; }
/* All variables are of type Real. */
#define NO_VARIABLES(type) \
    STATUS fmi2Get##type(fmi2Component m, REFERENCES, fmi2##type v[]) \
    { \
        return n ? fmi2Error : fmi2OK; \
    } \
    STATUS fmi2Set##type(fmi2Component m, REFERENCES, const fmi2##type v[]) \
    { \
        return n ? fmi2Error : fmi2OK; \
    }

EXPORTED const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORTED const char *fmi2GetVersion(void)
{
    return "2.0";
}

STATUS fmi2SetDebugLogging(fmi2Component m, fmi2Boolean on, size_t n, const fmi2String names[])
{
    return fmi2OK;
}

EXPORTED fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token,
                                       fmi2String path, const fmi2CallbackFunctions *functions,
                                       fmi2Boolean visible, fmi2Boolean logging)
{
    return instance(token);
}

EXPORTED void fmi2FreeInstance(fmi2Component m)
{
    free(m);
}

STATUS fmi2SetupExperiment(fmi2Component m, fmi2Boolean tolerance_given, fmi2Real tolerance,
                           fmi2Real start, fmi2Boolean stop_given, fmi2Real stop)
{
    ((Instance *)m)->time = start;
    return fmi2OK;
}

NOTHING(fmi2EnterInitializationMode)
NOTHING(fmi2ExitInitializationMode)
NOTHING(fmi2EnterEventMode)
NOTHING(fmi2EnterContinuousTimeMode)
NOTHING(fmi2CancelStep)
NOTHING(fmi2Terminate)

STATUS fmi2Reset(fmi2Component m)
{
    reset(m);
    return fmi2OK;
}

STATUS fmi2GetReal(fmi2Component m, REFERENCES, fmi2Real v[])
{
    return get(m, r, n, v) ? fmi2OK : fmi2Error;
}

STATUS fmi2SetReal(fmi2Component m, REFERENCES, const fmi2Real v[])
{
    return set(m, r, n, v) ? fmi2OK : fmi2Error;
}

NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
NONE(fmi2SetRealInputDerivatives, REFERENCES, const fmi2Integer o[], const fmi2Real v[])
NONE(fmi2GetRealOutputDerivatives, REFERENCES, const fmi2Integer o[], fmi2Real v[])
NONE(fmi2GetStatus, const fmi2StatusKind s, fmi2Status *v)
NONE(fmi2GetIntegerStatus, const fmi2StatusKind s, fmi2Integer *v)
NONE(fmi2GetBooleanStatus, const fmi2StatusKind s, fmi2Boolean *v)
NONE(fmi2GetStringStatus, const fmi2StatusKind s, fmi2String *v)

STATUS fmi2GetRealStatus(fmi2Component m, const fmi2StatusKind s, fmi2Real *v)
{
    *v = ((Instance *)m)->time;
    return s == fmi2LastSuccessfulTime ? fmi2OK : fmi2Error;
}

STATUS fmi2GetFMUstate(fmi2Component m, fmi2FMUstate *state)
{
    if (!*state && !(*state = malloc(sizeof(Instance))))
        return fmi2Error;
    memcpy(*state, m, sizeof(Instance));
    return fmi2OK;
}

STATUS fmi2SetFMUstate(fmi2Component m, fmi2FMUstate state)
{
    memcpy(m, state, sizeof(Instance));
    return fmi2OK;
}

STATUS fmi2FreeFMUstate(fmi2Component m, fmi2FMUstate *state)
{
    free(*state);
    *state = NULL;
    return fmi2OK;
}

STATUS fmi2SerializedFMUstateSize(fmi2Component m, fmi2FMUstate state, size_t *size)
{
    *size = sizeof(Instance);
    return fmi2OK;
}

STATUS fmi2SerializeFMUstate(fmi2Component m, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (size != sizeof(Instance))
        return fmi2Error;
    memcpy(bytes, state, size);
    return fmi2OK;
}

STATUS fmi2DeSerializeFMUstate(fmi2Component m, const fmi2Byte bytes[], size_t size,
                               fmi2FMUstate *state)
{
    if (size != sizeof(Instance) || (!*state && !(*state = malloc(size))))
        return fmi2Error;
    memcpy(*state, bytes, size);
    return fmi2OK;
}

STATUS fmi2NewDiscreteStates(fmi2Component m, fmi2EventInfo *info)
{
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

STATUS fmi2CompletedIntegratorStep(fmi2Component m, fmi2Boolean final, fmi2Boolean *event,
                                   fmi2Boolean *terminate)
{
    *event = *terminate = 0;
    return fmi2OK;
}

STATUS fmi2SetTime(fmi2Component m, fmi2Real time)
{
    ((Instance *)m)->time = time;
    return fmi2OK;
}

STATUS fmi2SetContinuousStates(fmi2Component m, const fmi2Real x[], size_t n)
{
    return set_states(m, x, n) ? fmi2OK : fmi2Error;
}

STATUS fmi2GetContinuousStates(fmi2Component m, fmi2Real x[], size_t n)
{
    return get_states(m, x, n) ? fmi2OK : fmi2Error;
}

STATUS fmi2GetDerivatives(fmi2Component m, fmi2Real dx[], size_t n)
{
    return get_rates(m, dx, n) ? fmi2OK : fmi2Error;
}

STATUS fmi2GetNominalsOfContinuousStates(fmi2Component m, fmi2Real v[], size_t n)
{
    while (n)
        v[--n] = 1.0;
    return fmi2OK;
}

STATUS fmi2GetEventIndicators(fmi2Component m, fmi2Real v[], size_t n)
{
    return n ? fmi2Error : fmi2OK;
}

STATUS fmi2DoStep(fmi2Component m, fmi2Real time, fmi2Real length, fmi2Boolean final)
{
    return advance(m, time, length) ? fmi2OK : fmi2Error;
}

STATUS fmi2GetDirectionalDerivative(fmi2Component m, REFERENCES, const fmi2ValueReference on[],
                                    size_t l, const fmi2Real seed[], fmi2Real v[])
{
    return directional(m, r, n, on, l, seed, v) ? fmi2OK : fmi2Error;
}
