/* What the FMUs of both versions do: the values of an instance, by value reference. */

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
    double x[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)], dx[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    double u[VEHICLEMOR_FLOATS(VEHICLEMOR_INPUTS)], y[VEHICLEMOR_FLOATS(VEHICLEMOR_OUTPUTS)];
    double p[VEHICLEMOR_FLOATS(VEHICLEMOR_PARAMETERS)];
    double c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
} Instance;

static void reset(Instance *m)
{
    memset(m, 0, sizeof *m);
    memcpy(m->x, vehiclemor_start, VEHICLEMOR_STATES * sizeof(double));
    memcpy(m->p, vehiclemor_parameters, VEHICLEMOR_PARAMETERS * sizeof(double));
    vehiclemor_constants(m->p, m->c);
}

static Instance *instance(const char *token)
{
    Instance *m = token && !strcmp(token, VEHICLEMOR_TOKEN) ? malloc(sizeof *m) : NULL;
    if (m)
        reset(m);
    return m;
}

/* Place of a variable; none if there is no such variable. */
static double *variable(Instance *m, unsigned number)
{
    if (number >= P && number < END)
        return &m->p[number - P];
    if (number >= U)
        return number < Y ? &m->u[number - U] : number < P ? &m->y[number - Y] : NULL;
    return number >= DX ? &m->dx[number - DX] : number >= X ? &m->x[number - X] : &m->time;
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
        const double *place = variable(m, numbers[i]);
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
        *variable(m, numbers[i]) = values[i];
    if (changed)
        vehiclemor_constants(m->p, m->c);
    m->known = 0;
    return 1;
}

/* Change of rates and outputs where states, inputs and parameters change by seeds. */
static int directional(Instance *m, const unsigned *unknown, size_t unknowns, const unsigned *known,
                       size_t knowns, const double *seed, double *change)
{
    double s[END] = {0.0}, c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
    size_t i;
    for (i = 0; i < knowns; i++) {
        if (known[i] >= END)
            return 0;
        s[known[i]] += seed[i];
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
        vehiclemor_step(m->x, m->u, m->u, m->c, length / (double)steps);
    m->time = time + length;
    m->known = 0;
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        if (m->x[i] - m->x[i] != 0.0)
            return 0;
    return 1;
}

/* Continuous states and their rates as a tool's integrator has them: 0 if their number is wrong. */
static int set_states(Instance *m, const double x[], size_t n)
{
    if (n != VEHICLEMOR_STATES)
        return 0;
    memcpy(m->x, x, n * sizeof *x);
    m->known = 0;
    return 1;
}

static int get_states(const Instance *m, double x[], size_t n)
{
    if (n != VEHICLEMOR_STATES)
        return 0;
    memcpy(x, m->x, n * sizeof *x);
    return 1;
}

static int get_rates(Instance *m, double dx[], size_t n)
{
    if (n != VEHICLEMOR_STATES)
        return 0;
    evaluate(m);
    memcpy(dx, m->dx, n * sizeof *dx);
    return 1;
}
