/* One linearly implicit step of order 2, ROS2 of Verwer, Spee, Blom and Hundsdorfer (SIAM J. Sci.
   Comput. 20, 1999); the same source for all models.  The matrix in vehiclemor_solve belongs to
   VEHICLEMOR_STEP: with a shorter h the error is about that of VEHICLEMOR_STEP. */

#include "vehiclemor_model.h"

void vehiclemor_step(vehiclemor_real *x, const vehiclemor_real *u, const vehiclemor_real *u_end,
                     const vehiclemor_real *c, vehiclemor_real h)
{
    vehiclemor_real f[VEHICLEMOR_STATES], k[2][VEHICLEMOR_STATES], y[VEHICLEMOR_STATES];
    int i;
    vehiclemor_derivative(x, u, c, f);
    vehiclemor_solve(x, f, k[0]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        y[i] = x[i] + h * k[0][i];
    vehiclemor_derivative(y, u_end, c, f);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        f[i] -= 2 * k[0][i];
    vehiclemor_solve(x, f, k[1]);
    for (i = 0; i < VEHICLEMOR_STATES; i++)
        x[i] += h / 2 * (3 * k[0][i] + k[1][i]);
}
