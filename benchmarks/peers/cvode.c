/* CVODE of SUNDIALS (BDF, dense) on an exported model: a run, a step, a batch, all in C.
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
    double size, rate, begin, u[U], c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
    int moves;
} Solver;

static int rhs(double t, Any x, Any dx, Any data)
{
    Solver *s = data;
    if (s->moves) {
        const double a = s->rate * (t - s->begin);
        s->u[0] = s->size * (sin(a) - 0.5 * sin(2.0 * a));
        if (U > 1) {
            s->u[U > 1] = s->size * s->rate * (cos(a) - cos(2.0 * a));
            s->u[U - 1] = s->size * s->rate * s->rate * (2.0 * sin(2.0 * a) - sin(a));
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

/* States, or one of them if `column` isn't negative, at the times [0, edges[3]]; outputs as well
   unless there is no room for them.  Calls of the right-hand side, those for Jacobians too, or -1
   where it fails. */
long run(Solver *s, const double *pulse, const double *times, const int *edges, int column,
        double *states, double *outputs)
{
    double *x = N_VGetArrayPointer(s->state), t;
    long calls = 0, further[2];
    s->size = pulse[0], s->rate = pulse[1], s->begin = pulse[2];
    memcpy(x, vehiclemor_start_equilibrium, N * sizeof(double));
    for (int part = 0; part < 3; part++) {
        s->moves = part == 1;
        memset(s->u, 0, sizeof s->u);
        CVodeReInit(s->cvode, times[edges[part]], s->state);
        CVodeSetStopTime(s->cvode, times[edges[part + 1]]);
        for (int k = edges[part]; k <= edges[part + 1]; k++) {
            if (k > edges[part] && CVode(s->cvode, times[k], s->state, &t, 1) < 0)
                return -1;
            if (column < 0)
                memcpy(states + (size_t)k * N, x, N * sizeof(double));
            else
                states[k] = x[column];
            if (outputs)
                vehiclemor_outputs(x, s->u, s->c, outputs + (size_t)k * VEHICLEMOR_OUTPUTS);
        }
        CVodeGetNumRhsEvals(s->cvode, further);
        CVodeGetNumLinRhsEvals(s->cvode, further + 1);
        calls += further[0] + further[1];
    }
    return calls;
}

/* One step with held inputs. */
void step(Solver *s, double *state, const double *u, double dt)
{
    double *x = N_VGetArrayPointer(s->state), t;
    s->moves = 0;
    memcpy(s->u, u, sizeof s->u);
    memcpy(x, state, N * sizeof(double));
    CVodeReInit(s->cvode, 0.0, s->state);
    CVodeSetStopTime(s->cvode, dt);
    CVode(s->cvode, dt, s->state, &t, 1);
    memcpy(state, x, N * sizeof(double));
}
