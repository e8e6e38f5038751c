/* One step of the classical Runge-Kutta method of order 4; the same source for all models. */

#include "vehiclemor_model.h"

void vehiclemor_step(vehiclemor_real *x, const vehiclemor_real *u, const vehiclemor_real *u_end,
                     const vehiclemor_real *c, vehiclemor_real h)
{
    vehiclemor_real k[4][VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    vehiclemor_real y[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    vehiclemor_real middle[VEHICLEMOR_FLOATS(VEHICLEMOR_INPUTS)];
    int i;
    for (i = 0; i < VEHICLEMOR_INPUTS; i++)
        middle[i] = (u[i] + u_end[i]) / 2;
    vehiclemor_derivative(x, u, c, k[0]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + h / 2 * k[0][i];
    vehiclemor_derivative(y, middle, c, k[1]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + h / 2 * k[1][i];
    vehiclemor_derivative(y, middle, c, k[2]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + h * k[2][i];
    vehiclemor_derivative(y, u_end, c, k[3]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        x[i] += h / 6 * (k[0][i] + 2 * (k[1][i] + k[2][i]) + k[3][i]);
}
