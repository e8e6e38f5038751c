"""Weights of the exponential Adams method for variable steps, see `exponential_adams`."""

# Rows of numbers: nodes of the polynomial, its coefficients, weights of the classical predictor, of
# the polynomial at the end of the step.
NODES, POWERS, CLASSICAL, AT_END = range(4)


def set_weights(k, table, numbers, weights):
    """Weights of a step with k nodes: zero and past ones; classical weight of the corrector.

    The table has phi_1, phi_2, ...  of h B by row; numbers are rows of nodes in steps, and of what
    is set, see above.  The weights of N (k + 1, columns) in the predictor, the last in the
    corrector, are set.
    """
    nodes, powers = numbers[NODES], numbers[POWERS]
    classical, at_end = numbers[CLASSICAL], numbers[AT_END]
    size = table.shape[1]
    classical[0], at_end[0] = 1.0, 1.0
    for i in range(size):
        weights[0, i] = 0.0
    # Lagrange polynomial of each past node; N_n has what is left of D_j.
    for j in range(1, k):
        at_end[j] = polynomial(k, j, nodes, powers)
        classical[j] = integrals(k, powers, table, weights[j])
        classical[0] -= classical[j]
        at_end[0] -= at_end[j]
        for i in range(size):
            weights[0, i] -= weights[j, i]
    # omega / omega(1) for the corrector.
    last = 1.0 / polynomial(k, k, nodes, powers)
    for m in range(k + 1):
        powers[m] *= last
    return integrals(k + 1, powers, table, weights[k])


def polynomial(k, without, nodes, powers):
    """Coefficients of the product of s - s_l over all nodes but one, 1 there; value at s = 1.

    No node is left out if there is none of that number.
    """
    for m in range(k + 1):
        powers[m] = 0.0
    powers[0] = 1.0
    degree, at_end = 0, 1.0
    for node in range(k):
        if node == without:
            continue
        scale = 1.0 if without == k else 1.0 / (nodes[without] - nodes[node])
        for m in range(degree + 1, 0, -1):
            powers[m] = scale * (powers[m - 1] - nodes[node] * powers[m])
        powers[0] *= -scale * nodes[node]
        at_end *= scale * (1.0 - nodes[node])
        degree += 1
    return at_end


def integrals(k, powers, table, weights):
    """Integral over the step of a polynomial of degree k - 1 that vanishes at its beginning.

    Its integrals with e^{(1-s) h B} are the weights.
    """
    total, factorial = 0.0, 1.0
    for i in range(len(weights)):
        weights[i] = 0.0
    for m in range(1, k):
        factorial *= m
        total += powers[m] / (m + 1)
        scale = factorial * powers[m]
        for i in range(table.shape[1]):
            weights[i] += scale * table[m, i]
    return total
