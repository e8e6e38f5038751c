/* CVODE of SUNDIALS (BDF, dense) on an exported model: a smooth part of a run, or a step.
   The wheel that brings the libraries has no headers: the few prototypes are declared here. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vehiclemor_model.h"

#define N VEHICLEMOR_STATES
#define U VEHICLEMOR_INPUTS
typedef void *Any;
typedef int (*Rhs)(double, Any, Any, Any);
typedef void (*Rates)(const double *, const double *, const double *, double *);
int SUNContext_Create(int, Any *);
Any N_VNew_Serial(int, Any);
double *N_VGetArrayPointer(Any);
Any SUNDenseMatrix(int, int, Any);
Any SUNLinSol_Dense(Any, Any, Any);
Any CVodeCreate(int, Any);
int CVodeInit(Any, Rhs, double, Any), CVodeReInit(Any, double, Any), CVodeSetUserData(Any, Any);
int CVodeSVtolerances(Any, double, Any), CVodeSetLinearSolver(Any, Any, Any);
int CVodeSetMaxNumSteps(Any, long), CVodeSetStopTime(Any, double);
int CVode(Any, double, Any, double *, int);
int CVodeGetNumRhsEvals(Any, long *), CVodeGetNumLinRhsEvals(Any, long *);

typedef struct {
    Any cvode, state;
    Rates rates;
    const double *constants;
    const double *pulse; /* size, rate and begin of a lane change, or none */
    double u[U], c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
} Solver;

static int rhs(double t, Any x, Any dx, Any data)
{
    Solver *s = data;
    if (s->pulse) {
        const double size = s->pulse[0], rate = s->pulse[1], a = rate * (t - s->pulse[2]);
        s->u[0] = size * (sin(a) - 0.5 * sin(2.0 * a));
        if (U > 1) {
            s->u[U > 1] = size * rate * (cos(a) - cos(2.0 * a));
            s->u[U - 1] = size * rate * rate * (2.0 * sin(2.0 * a) - sin(a));
        }
    }
    s->rates(N_VGetArrayPointer(x), s->u, s->constants, N_VGetArrayPointer(dx));
    return 0;
}

/* A solver of the exported right-hand side, or of another one with its constants. */
Any make(Rates rates, const double *constants, double tolerance, const double *scale)
{
    Solver *s = calloc(1, sizeof *s);
    Any context, matrix, tolerances;
    SUNContext_Create(0, &context);
    s->state = N_VNew_Serial(N, context);
    tolerances = N_VNew_Serial(N, context);
    for (int i = 0; i < N; i++)
        N_VGetArrayPointer(tolerances)[i] = tolerance * scale[i];
    vehiclemor_constants(vehiclemor_parameters, s->c);
    s->rates = rates ? rates : vehiclemor_derivative;
    s->constants = rates ? constants : s->c;
    memcpy(N_VGetArrayPointer(s->state), vehiclemor_start_equilibrium, N * sizeof(double));
    s->cvode = CVodeCreate(2, context); /* CV_BDF */
    CVodeInit(s->cvode, rhs, 0.0, s->state);
    CVodeSetUserData(s->cvode, s);
    CVodeSVtolerances(s->cvode, tolerance, tolerances);
    matrix = SUNDenseMatrix(N, N, context);
    CVodeSetLinearSolver(s->cvode, SUNLinSol_Dense(s->state, matrix, context), matrix);
    CVodeSetMaxNumSteps(s->cvode, 1000000);
    return s;
}

/* From states[0] at times[0] to the other times; a stride of 0 overwrites the state, else outputs
   go along with states.  `given` are the inputs, or what the pulse is that moves them.  Calls of
   the right-hand side, those for Jacobians too, or -1 where CVODE fails. */
long part(Solver *s, int moves, const double *given, const double *times, int count, int stride,
          double *states, double *outputs)
{
    double *x = N_VGetArrayPointer(s->state), t;
    long calls, further;
    s->pulse = moves ? given : NULL;
    if (!moves)
        memcpy(s->u, given, sizeof s->u);
    memcpy(x, states, N * sizeof(double));
    CVodeReInit(s->cvode, times[0], s->state);
    CVodeSetStopTime(s->cvode, times[count - 1]);
    for (int k = 0; k < count; k++) {
        if (k > 0 && CVode(s->cvode, times[k], s->state, &t, 1) < 0)
            return -1;
        memcpy(states + (size_t)k * stride, x, N * sizeof(double));
        if (outputs)
            vehiclemor_outputs(x, s->u, s->c, outputs + (size_t)k * VEHICLEMOR_OUTPUTS);
    }
    CVodeGetNumRhsEvals(s->cvode, &calls);
    CVodeGetNumLinRhsEvals(s->cvode, &further);
    return calls + further;
}
