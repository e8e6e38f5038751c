"""The system that the integrators see: the full model, or its projection on a subspace.

Three forms have one right-hand side, `slope`:

FULL
    y is the state x = (coordinates, speeds); dy = f(x, u).
STATE
    x = mean + lift y; dy = drop f(x, u), with drop the projection (paper, section 3).
COORDINATES
    y = (a, b): coordinates q = mean + V a, rates V b; V^T M V db/dt = V^T F with the model's own
    mass matrix, V the first rows of `lift`.

`model` is (constants, addresses): the parameters' constants, and where the machine code of the
model's kernels begins, zero where it has none.  So these loops are compiled once for all models,
and sizes are lengths of arrays.  `signal` is (edges, first, coefficients) of the inputs, `space`
(mean, lift, drop) of the window, `scratch` (x, u, dx, matrix, small).
"""

import math

import numpy as np

from vehiclemor.codegen.stubs import call_machine

# One place in each integrator calls them for all stages of a step.
INLINED = ("slope", "lifted", "input_at", "positions_and_rates", "galerkin", "product")
FULL = 0
STATE = 1
COORDINATES = 2


def derivative(x, u, model, result):
    """State derivative f(x, u) into result (2 n,)."""
    call_machine(model, 0, x, u, result)


def outputs(x, u, model, result):
    """Outputs y(x, u) into result."""
    call_machine(model, 1, x, u, result)


def second_order(x, u, model, result):
    """Mass matrix into result[:, :n] and forces into result[:, n]; result is (n, n + 1)."""
    call_machine(model, 2, x, u, result)


def speeds(x, u, model, result):
    """Speeds into result (n,) or longer, where x holds rates of the coordinates in their place."""
    call_machine(model, 3, x, u, result)


def scratch_space(states, inputs):
    """Work space of the functions below."""
    n = states // 2
    return (
        np.empty(states),
        np.zeros(inputs),
        np.empty(states),
        np.empty((n, n + 1)),
        np.empty((n, n + 1)),
    )


def input_at(t, segment, signal, u):
    """Inputs at time t, by the polynomials of one segment also beyond its ends, into u."""
    edges, first, coefficients = signal
    pieces = first[segment + 1] - first[segment]
    a = edges[segment]
    place = (t - a) / (edges[segment + 1] - a) * pieces
    i = int(np.floor(place))
    if i < 0:
        i = 0
    if i > pieces - 1:
        i = pieces - 1
    z = place - i
    row = first[segment] + i
    for j in range(len(u)):
        value = coefficients[row, j, 5]
        value = coefficients[row, j, 4] + z * value
        value = coefficients[row, j, 3] + z * value
        value = coefficients[row, j, 2] + z * value
        value = coefficients[row, j, 1] + z * value
        u[j] = coefficients[row, j, 0] + z * value


def lifted(form, y, dim, space, model, scratch, x):
    """State x (2 n) of reduced coordinates y (dim)."""
    mean, lift, _ = space
    n = len(x) // 2
    if form == FULL:
        for i in range(dim):
            x[i] = y[i]
        return
    if form == STATE:
        for i in range(2 * n):
            x[i] = mean[i]
        for j in range(dim):
            for i in range(2 * n):
                x[i] += lift[j, i] * y[j]
        return
    positions_and_rates(y, dim, space, x)
    _, u, dx, _, _ = scratch
    speeds(x, u, model, dx)
    for i in range(n):
        x[n + i] = dx[i]


def positions_and_rates(y, dim, space, x):
    """Coordinates and their rates, in place of the speeds, of y = (a, b) into x (2 n)."""
    mean, lift, _ = space
    n, r = len(x) // 2, dim // 2
    for i in range(n):
        x[i] = mean[i]
        x[n + i] = 0.0
    for j in range(r):
        for i in range(n):
            x[i] += lift[j, i] * y[j]
            x[n + i] += lift[j, i] * y[r + j]


def projected(form, x, dim, space, model, scratch, y):
    """Reduced coordinates y (dim) of a state x (2 n); one derivative in form COORDINATES."""
    mean, _, drop = space
    n = len(x) // 2
    if form == FULL:
        for i in range(dim):
            y[i] = x[i]
    elif form == STATE:
        for j in range(dim):
            total = 0.0
            for i in range(2 * n):
                total += drop[j, i] * (x[i] - mean[i])
            y[j] = total
    else:
        r = dim // 2
        _, u, dx, _, _ = scratch
        derivative(x, u, model, dx)
        for j in range(r):
            total, rate = 0.0, 0.0
            for i in range(n):
                total += drop[j, i] * (x[i] - mean[i])
                rate += drop[j, i] * dx[i]
            y[j] = total
            y[r + j] = rate


def slope(form, t, segment, y, dim, signal, space, model, scratch, dy):
    """Right-hand side of the system at time t into dy (dim)."""
    x, u, dx, matrix, small = scratch
    input_at(t, segment, signal, u)
    if form == FULL:
        derivative(y, u, model, dy)
    elif form == STATE:
        lifted(form, y, dim, space, model, scratch, x)
        derivative(x, u, model, dx)
        drop = space[2]
        for j in range(dim):
            total = 0.0
            for i in range(len(dx)):
                total += drop[j, i] * dx[i]
            dy[j] = total
    else:
        lifted(form, y, dim, space, model, scratch, x)
        second_order(x, u, model, matrix)
        galerkin(dim // 2, space[1], matrix, dx, small)
        r = dim // 2
        for j in range(r):
            dy[j] = y[r + j]
            dy[r + j] = small[j, r]


def slope_apart(form, t, segment, y, dim, signal, space, model, scratch, dy):
    """The same as `slope`, not inlined: for places that are not in every stage."""
    slope(form, t, segment, y, dim, signal, space, model, scratch, dy)


def product(n, matrix, row, lift, image):
    """Product of the first n columns of a symmetric matrix with a row of lift into image (n)."""
    for i in range(n):
        image[i] = 0.0
    # Four rows at a time: a loop over a dozen places costs as much to enter as to run.
    j = 0
    while j + 3 < n:
        a, b, c, d = lift[row, j], lift[row, j + 1], lift[row, j + 2], lift[row, j + 3]
        for i in range(n):
            image[i] += (matrix[j, i] * a + matrix[j + 1, i] * b) + (
                matrix[j + 2, i] * c + matrix[j + 3, i] * d
            )
        j += 4
    while j < n:
        a = lift[row, j]
        for i in range(n):
            image[i] += matrix[j, i] * a
        j += 1


def galerkin(r, lift, matrix, image, small):
    """Solve (V^T M V) a = V^T F; V^T are the rows of lift; a replaces column r of small."""
    n = len(matrix)
    for k in range(r):
        # M is symmetric: its rows are its columns.
        product(n, matrix, k, lift, image)
        total = 0.0
        for i in range(n):
            total += lift[k, i] * matrix[i, n]
        small[k, r] = total
        for j in range(k + 1):
            total = 0.0
            for i in range(n):
                total += lift[j, i] * image[i]
            small[k, j] = total
    # Cholesky: V^T M V is positive definite.
    for k in range(r):
        pivot = small[k, k]
        for j in range(k):
            pivot -= small[k, j] * small[k, j]
        pivot = math.sqrt(pivot)
        small[k, k] = pivot
        for i in range(k + 1, r):
            total = small[i, k]
            for j in range(k):
                total -= small[i, j] * small[k, j]
            small[i, k] = total / pivot
    for k in range(r):
        total = small[k, r]
        for j in range(k):
            total -= small[k, j] * small[j, r]
        small[k, r] = total / small[k, k]
    for k in range(r - 1, -1, -1):
        total = small[k, r]
        for j in range(k + 1, r):
            total -= small[j, k] * small[j, r]
        small[k, r] = total / small[k, k]


def error_norm(form, error, y, dim, space, typical, tolerance):
    """Largest error of a state as a multiple of its tolerance; not a number if y is none.

    In a subspace the error is lifted first, so that a tolerance means the same in every form.
    """
    mean, lift, _ = space
    n = len(typical) // 2
    largest = 0.0
    if form == FULL:
        for i in range(dim):
            ratio = abs(error[i]) / (typical[i] + abs(y[i]))
            if not ratio <= largest:
                largest = ratio
    elif form == STATE:
        for i in range(2 * n):
            value, change = mean[i], 0.0
            for j in range(dim):
                value += lift[j, i] * y[j]
                change += lift[j, i] * error[j]
            ratio = abs(change) / (typical[i] + abs(value))
            if not ratio <= largest:
                largest = ratio
    else:
        r = dim // 2
        for i in range(n):
            value, change, rate, drift = mean[i], 0.0, 0.0, 0.0
            for j in range(r):
                value += lift[j, i] * y[j]
                change += lift[j, i] * error[j]
                rate += lift[j, i] * y[r + j]
                drift += lift[j, i] * error[r + j]
            ratio = abs(change) / (typical[i] + abs(value))
            if not ratio <= largest:
                largest = ratio
            ratio = abs(drift) / (typical[n + i] + abs(rate))
            if not ratio <= largest:
                largest = ratio
    return largest / tolerance
