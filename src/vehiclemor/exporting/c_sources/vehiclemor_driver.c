/* Test driver: runs the model over inputs from standard input, and times every step.

   Standard input: the number of steps, their length in s, then a row of inputs for each end of a
   step, the start included.  Standard output: the derivative at the start, then states and outputs
   at each end of a step, one row each.  Standard error: mean, 99.9th percentile and largest time of
   a step with its outputs. */

#define _POSIX_C_SOURCE 199309L

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "vehiclemor_model.h"

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int later(const void *a, const void *b)
{
    const double first = *(const double *)a, second = *(const double *)b;
    return (first > second) - (first < second);
}

static void row(const vehiclemor_real *values, int count)
{
    int i;
    for (i = 0; i < count; i++)
        printf("%.17g ", (double)values[i]);
}

static int inputs(vehiclemor_real *u)
{
    double value;
    int i;
    for (i = 0; i < VEHICLEMOR_INPUTS; i++) {
        if (scanf("%lf", &value) != 1)
            return 0;
        u[i] = (vehiclemor_real)value;
    }
    return 1;
}

int main(void)
{
    vehiclemor_real x[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    vehiclemor_real dx[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    vehiclemor_real u[2][VEHICLEMOR_FLOATS(VEHICLEMOR_INPUTS)];
    vehiclemor_real y[VEHICLEMOR_FLOATS(VEHICLEMOR_OUTPUTS)];
    vehiclemor_real c[VEHICLEMOR_FLOATS(VEHICLEMOR_CONSTANTS)];
    double h, total = 0.0, *taken;
    long steps, n;
    int i;
    if (scanf("%ld %lf", &steps, &h) != 2 || steps < 1 || !inputs(u[0])) {
        fprintf(stderr, "standard input: steps, their length in s, inputs at each end of a step\n");
        return EXIT_FAILURE;
    }
    taken = malloc((size_t)steps * sizeof *taken);
    if (!taken)
        return EXIT_FAILURE;
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        x[i] = vehiclemor_start[i];
    vehiclemor_constants(vehiclemor_parameters, c);
    vehiclemor_derivative(x, u[0], c, dx);
    row(dx, VEHICLEMOR_STATES);
    printf("\n");
    vehiclemor_outputs(x, u[0], c, y);
    for (n = 0;; n++) {
        row(x, VEHICLEMOR_STATES);
        row(y, VEHICLEMOR_OUTPUTS);
        printf("\n");
        if (n == steps)
            break;
        if (!inputs(u[(n + 1) % 2])) {
            fprintf(stderr, "no inputs for the end of step %ld\n", n + 1);
            return EXIT_FAILURE;
        }
        taken[n] = seconds();
        vehiclemor_step(x, u[n % 2], u[(n + 1) % 2], c, (vehiclemor_real)h);
        vehiclemor_outputs(x, u[(n + 1) % 2], c, y);
        taken[n] = seconds() - taken[n];
        total += taken[n];
    }
    qsort(taken, (size_t)steps, sizeof *taken, later);
    fprintf(stderr, "%.3g %.3g %.3g\n", total / (double)steps,
            taken[(long)(0.999 * (double)(steps - 1))], taken[steps - 1]);
    free(taken);
    return EXIT_SUCCESS;
}
