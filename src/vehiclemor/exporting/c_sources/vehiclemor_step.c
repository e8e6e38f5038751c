/* One step of the classical Runge-Kutta method of order 4; the same source for all models. */

#include "vehiclemor_model.h"

void vehiclemor_step(double *x, const double *u, const double *u_end, const double *c, double h)
{
    double k[4][VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)], y[VEHICLEMOR_FLOATS(VEHICLEMOR_STATES)];
    double middle[VEHICLEMOR_FLOATS(VEHICLEMOR_INPUTS)];
    int i;
    for (i = 0; i < VEHICLEMOR_INPUTS; i++)
        middle[i] = 0.5 * (u[i] + u_end[i]);
    vehiclemor_derivative(x, u, c, k[0]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + 0.5 * h * k[0][i];
    vehiclemor_derivative(y, middle, c, k[1]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + 0.5 * h * k[1][i];
    vehiclemor_derivative(y, middle, c, k[2]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + h * k[2][i];
    vehiclemor_derivative(y, u_end, c, k[3]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        x[i] += h / 6.0 * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]);
}
