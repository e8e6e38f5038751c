/* FMI 3.0, model exchange and co-simulation: https://fmi-standard.org/docs/3.0.2/
   With -DFMI3_HEADER the declarations are those of the standard's header. */

#ifdef FMI3_HEADER
#include "fmi3Functions.h"
#else
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef double fmi3Float64;
typedef float fmi3Float32;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean *,
                                               fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

#include "vehiclemor_fmu.h"

#define STATUS EXPORTED fmi3Status
#define REFERENCES const fmi3ValueReference r[], size_t n
/* Transitions between modes that change nothing. */
#define NOTHING(name) \
    STATUS name(fmi3Instance m) { return m ? fmi3OK : fmi3Error; }
/* What the model doesn't have. */
#define NONE(name, ...) \
    STATUS name(fmi3Instance m, __VA_ARGS__) { return fmi3Error; }
/* All variables are of type Float64. */
#define NO_VARIABLES(type) \
    STATUS fmi3Get##type(fmi3Instance m, REFERENCES, fmi3##type v[], size_t k) \
    { \
        return n ? fmi3Error : fmi3OK; \
    } \
    STATUS fmi3Set##type(fmi3Instance m, REFERENCES, const fmi3##type v[], size_t k) \
    { \
        return n ? fmi3Error : fmi3OK; \
    }

EXPORTED const char *fmi3GetVersion(void)
{
    return "3.0";
}

STATUS fmi3SetDebugLogging(fmi3Instance m, fmi3Boolean on, size_t n, const fmi3String names[])
{
    return fmi3OK;
}

EXPORTED fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token,
                                                   fmi3String path, fmi3Boolean visible,
                                                   fmi3Boolean logging, fmi3InstanceEnvironment e,
                                                   fmi3LogMessageCallback log)
{
    return instance(token);
}

EXPORTED fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, REFERENCES, fmi3InstanceEnvironment e,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    return instance(token);
}

EXPORTED fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment e, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    return NULL;
}

EXPORTED void fmi3FreeInstance(fmi3Instance m)
{
    free(m);
}

STATUS fmi3EnterInitializationMode(fmi3Instance m, fmi3Boolean tolerance_given,
                                   fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean stop_given,
                                   fmi3Float64 stop)
{
    ((Instance *)m)->time = start;
    return fmi3OK;
}

NOTHING(fmi3ExitInitializationMode)
NOTHING(fmi3EnterEventMode)
NOTHING(fmi3EnterContinuousTimeMode)
NOTHING(fmi3EnterStepMode)
NOTHING(fmi3EnterConfigurationMode)
NOTHING(fmi3ExitConfigurationMode)
NOTHING(fmi3EvaluateDiscreteStates)
NOTHING(fmi3Terminate)

STATUS fmi3Reset(fmi3Instance m)
{
    reset(m);
    return fmi3OK;
}

STATUS fmi3GetFloat64(fmi3Instance m, REFERENCES, fmi3Float64 v[], size_t k)
{
    return k == n && get(m, r, n, v) ? fmi3OK : fmi3Error;
}

STATUS fmi3SetFloat64(fmi3Instance m, REFERENCES, const fmi3Float64 v[], size_t k)
{
    return k == n && set(m, r, n, v) ? fmi3OK : fmi3Error;
}

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
NONE(fmi3GetBinary, REFERENCES, size_t s[], fmi3Binary v[], size_t k)
NONE(fmi3SetBinary, REFERENCES, const size_t s[], const fmi3Binary v[], size_t k)
NONE(fmi3GetClock, REFERENCES, fmi3Clock v[])
NONE(fmi3SetClock, REFERENCES, const fmi3Clock v[])
NONE(fmi3GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *count)
NONE(fmi3GetVariableDependencies, fmi3ValueReference d, size_t of[], fmi3ValueReference i[],
     size_t on[], fmi3DependencyKind kinds[], size_t n)
NONE(fmi3GetIntervalDecimal, REFERENCES, fmi3Float64 v[], fmi3IntervalQualifier q[])
NONE(fmi3GetIntervalFraction, REFERENCES, fmi3UInt64 v[], fmi3UInt64 w[], fmi3IntervalQualifier q[])
NONE(fmi3GetShiftDecimal, REFERENCES, fmi3Float64 v[])
NONE(fmi3GetShiftFraction, REFERENCES, fmi3UInt64 v[], fmi3UInt64 w[])
NONE(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 v[])
NONE(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 v[], const fmi3UInt64 w[])
NONE(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 v[])
NONE(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 v[], const fmi3UInt64 w[])
NONE(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 o[], fmi3Float64 v[], size_t k)
NONE(fmi3ActivateModelPartition, fmi3ValueReference r, fmi3Float64 t)
NONE(fmi3GetAdjointDerivative, REFERENCES, const fmi3ValueReference to[], size_t l,
     const fmi3Float64 seed[], size_t j, fmi3Float64 v[], size_t k)

STATUS fmi3GetFMUState(fmi3Instance m, fmi3FMUState *state)
{
    if (!*state && !(*state = malloc(sizeof(Instance))))
        return fmi3Error;
    memcpy(*state, m, sizeof(Instance));
    return fmi3OK;
}

STATUS fmi3SetFMUState(fmi3Instance m, fmi3FMUState state)
{
    memcpy(m, state, sizeof(Instance));
    return fmi3OK;
}

STATUS fmi3FreeFMUState(fmi3Instance m, fmi3FMUState *state)
{
    free(*state);
    *state = NULL;
    return fmi3OK;
}

STATUS fmi3SerializedFMUStateSize(fmi3Instance m, fmi3FMUState state, size_t *size)
{
    *size = sizeof(Instance);
    return fmi3OK;
}

STATUS fmi3SerializeFMUState(fmi3Instance m, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (size != sizeof(Instance))
        return fmi3Error;
    memcpy(bytes, state, size);
    return fmi3OK;
}

STATUS fmi3DeserializeFMUState(fmi3Instance m, const fmi3Byte bytes[], size_t size,
                               fmi3FMUState *state)
{
    if (size != sizeof(Instance) || (!*state && !(*state = malloc(size))))
        return fmi3Error;
    memcpy(*state, bytes, size);
    return fmi3OK;
}

STATUS fmi3UpdateDiscreteStates(fmi3Instance m, fmi3Boolean *update, fmi3Boolean *terminate,
                                fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *defined,
                                fmi3Float64 *next)
{
    *update = *terminate = *nominals = *values = *defined = false;
    return fmi3OK;
}

STATUS fmi3CompletedIntegratorStep(fmi3Instance m, fmi3Boolean final, fmi3Boolean *event,
                                   fmi3Boolean *terminate)
{
    *event = *terminate = false;
    return fmi3OK;
}

STATUS fmi3SetTime(fmi3Instance m, fmi3Float64 time)
{
    ((Instance *)m)->time = time;
    return fmi3OK;
}

STATUS fmi3SetContinuousStates(fmi3Instance m, const fmi3Float64 x[], size_t n)
{
    return set_states(m, x, n) ? fmi3OK : fmi3Error;
}

STATUS fmi3GetContinuousStates(fmi3Instance m, fmi3Float64 x[], size_t n)
{
    return get_states(m, x, n) ? fmi3OK : fmi3Error;
}

STATUS fmi3GetContinuousStateDerivatives(fmi3Instance m, fmi3Float64 dx[], size_t n)
{
    return get_rates(m, dx, n) ? fmi3OK : fmi3Error;
}

STATUS fmi3GetNominalsOfContinuousStates(fmi3Instance m, fmi3Float64 v[], size_t n)
{
    while (n)
        v[--n] = 1.0;
    return fmi3OK;
}

STATUS fmi3GetEventIndicators(fmi3Instance m, fmi3Float64 v[], size_t n)
{
    return n ? fmi3Error : fmi3OK;
}

STATUS fmi3GetNumberOfEventIndicators(fmi3Instance m, size_t *n)
{
    *n = 0;
    return fmi3OK;
}

STATUS fmi3GetNumberOfContinuousStates(fmi3Instance m, size_t *n)
{
    *n = VEHICLEMOR_STATES;
    return fmi3OK;
}

STATUS fmi3DoStep(fmi3Instance m, fmi3Float64 time, fmi3Float64 length, fmi3Boolean final,
                  fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early,
                  fmi3Float64 *reached)
{
    const int fine = advance(m, time, length);
    *event = *terminate = *early = false;
    *reached = ((Instance *)m)->time;
    return fine ? fmi3OK : fmi3Error;
}

STATUS fmi3GetDirectionalDerivative(fmi3Instance m, REFERENCES, const fmi3ValueReference on[],
                                    size_t l, const fmi3Float64 seed[], size_t j, fmi3Float64 v[],
                                    size_t k)
{
    return j == l && k == n && directional(m, r, n, on, l, seed, v) ? fmi3OK : fmi3Error;
}
