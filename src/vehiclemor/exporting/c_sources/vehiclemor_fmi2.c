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

#include <stdlib.h>
#include <string.h>

#include "vehiclemor_model.h"
#include "vehiclemor_token.h"

#if defined _WIN32
#define EXPORTED __declspec(dllexport)
#else
#define EXPORTED __attribute__((visibility("default")))
#endif

/* Between two exchanges; `long` holds as many everywhere. */
#define MOST_STEPS 1e9

/* First value reference of each array. */
enum {
    TIME,
    X,
    DX = X + VEHICLEMOR_STATES,
    U = DX + VEHICLEMOR_STATES,
    Y = U + VEHICLEMOR_INPUTS,
    P = Y + VEHICLEMOR_OUTPUTS,
    END = P + VEHICLEMOR_PARAMETERS
};

/* An instance.  `known` says whether rates and outputs are those of its states and inputs. */
typedef struct {
    int known;
    double time;
    vehiclemor_real x[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    vehiclemor_real dx[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    vehiclemor_real u[VEHICLEMOR_FLOATS(VEHICLEMOR_INPUTS)];
    vehiclemor_real y[VEHICLEMOR_FLOATS(VEHICLEMOR_OUTPUTS)];
    vehiclemor_real p[VEHICLEMOR_FLOATS(VEHICLEMOR_PARAMETERS)];
    vehiclemor_real c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
} Instance;

static void reset(Instance *m)
{
    memset(m, 0, sizeof *m);
    memcpy(m->x, vehiclemor_start, sizeof m->x);
    memcpy(m->p, vehiclemor_parameters, sizeof m->p);
    vehiclemor_constants(m->p, m->c);
}

static Instance *instance(const char *token)
{
    Instance *m = token && !strcmp(token, VEHICLEMOR_TOKEN) ? malloc(sizeof *m) : NULL;
    if (m)
        reset(m);
    return m;
}

/* Place of a variable other than the time; none if there is no such variable. */
static vehiclemor_real *variable(Instance *m, unsigned number)
{
    if (number >= P && number < END)
        return &m->p[number - P];
    if (number >= U)
        return number < Y ? &m->u[number - U] : number < P ? &m->y[number - Y] : NULL;
    return number >= DX ? &m->dx[number - DX] : number >= X ? &m->x[number - X] : NULL;
}

static void evaluate(Instance *m)
{
    if (m->known)
        return;
    vehiclemor_derivative(m->x, m->u, m->c, m->dx);
    vehiclemor_outputs(m->x, m->u, m->c, m->y);
    m->known = 1;
}

static int get(Instance *m, const unsigned *numbers, size_t count, double *values)
{
    size_t i;
    for (i = 0; i < count; i++) {
        const vehiclemor_real *place = variable(m, numbers[i]);
        if (numbers[i] == TIME) {
            values[i] = m->time;
            continue;
        }
        if (!place)
            return 0;
        if ((numbers[i] >= DX && numbers[i] < U) || (numbers[i] >= Y && numbers[i] < P))
            evaluate(m);
        values[i] = *place;
    }
    return 1;
}

/* All values or, where one can't be set, none. */
static int set(Instance *m, const unsigned *numbers, size_t count, const double *values)
{
    size_t i;
    int changed = 0;
    for (i = 0; i < count; i++) {
        const unsigned n = numbers[i];
        if (!((n >= X && n < DX) || (n >= U && n < Y) || (n >= P && n < END)))
            return 0;
        changed |= n >= P;
    }
    for (i = 0; i < count; i++)
        *variable(m, numbers[i]) = (vehiclemor_real)values[i];
    if (changed)
        vehiclemor_constants(m->p, m->c);
    m->known = 0;
    return 1;
}

/* Change of rates and outputs where states, inputs and parameters change by seeds. */
static int directional(Instance *m, const unsigned *unknown, size_t unknowns, const unsigned *known,
                       size_t knowns, const double *seed, double *change)
{
    vehiclemor_real s[END] = {0}, c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
    size_t i;
    for (i = 0; i < knowns; i++) {
        if (known[i] >= END)
            return 0;
        s[known[i]] += (vehiclemor_real)seed[i];
    }
    vehiclemor_constants_tangent(m->p, s + P, c);
    vehiclemor_derivative_tangent(m->x, m->u, m->c, s + X, s + U, c, s + DX);
    vehiclemor_outputs_tangent(m->x, m->u, m->c, s + X, s + U, c, s + Y);
    for (i = 0; i < unknowns; i++) {
        if (unknown[i] >= END)
            return 0;
        change[i] = s[unknown[i]];
    }
    return 1;
}

/* Equal steps, none longer than VEHICLEMOR_STEP, with the inputs held; 0 if the motion diverges,
   and for a length that is no number, not above zero or more than any run has. */
static int advance(Instance *m, double time, double length)
{
    const double count = length / VEHICLEMOR_STEP;
    long steps, n;
    int i;
    if (!(length > 0.0 && count <= MOST_STEPS))
        return 0;
    steps = 1 + (long)(count - 1e-9);
    for (n = 0; n < steps; n++)
        vehiclemor_step(m->x, m->u, m->u, m->c, (vehiclemor_real)(length / (double)steps));
    m->time = time + length;
    m->known = 0;
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        if (m->x[i] - m->x[i] != 0)
            return 0;
    return 1;
}

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
    size_t i;
    if (n != VEHICLEMOR_STATES)
        return fmi2Error;
    for (i = 0; i < n; i++)
        ((Instance *)m)->x[i] = (vehiclemor_real)x[i];
    ((Instance *)m)->known = 0;
    return fmi2OK;
}

STATUS fmi2GetContinuousStates(fmi2Component m, fmi2Real x[], size_t n)
{
    size_t i;
    if (n != VEHICLEMOR_STATES)
        return fmi2Error;
    for (i = 0; i < n; i++)
        x[i] = ((Instance *)m)->x[i];
    return fmi2OK;
}

STATUS fmi2GetDerivatives(fmi2Component m, fmi2Real dx[], size_t n)
{
    size_t i;
    if (n != VEHICLEMOR_STATES)
        return fmi2Error;
    evaluate(m);
    for (i = 0; i < n; i++)
        dx[i] = ((Instance *)m)->dx[i];
    return fmi2OK;
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
