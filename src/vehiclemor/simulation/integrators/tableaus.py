"""Coefficients of the Rosenbrock methods, in the form that needs no product with the Jacobian."""

import numpy as np


def rodas4() -> np.ndarray:
    """Tableau (16, 6) of RODAS: a, c, alpha, d, m, e; gamma is 1/4.

    Hairer, Wanner, Solving Ordinary Differential Equations II (2nd ed., Springer 1996), section
    VI.4.
    """
    a, c = np.zeros((6, 6)), np.zeros((6, 6))
    a[1, :1] = [1.544]
    a[2, :2] = [0.9466785280815826, 0.2557011698983284]
    a[3, :3] = [3.314825187068521, 2.896124015972201, 0.9986419139977817]
    a[4, :4] = [1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950]
    a[5, :4] = a[4, :4]
    a[5, 4] = 1.0
    c[1, :1] = [-5.6688]
    c[2, :2] = [-2.430093356833875, -0.2063599157091915]
    c[3, :3] = [-0.1073529058151375, -9.594562251023355, -20.47028614809616]
    c[4, :4] = [7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160]
    c[5, :5] = [
        8.083246795921522,
        -7.981132988064893,
        -31.52159432874371,
        16.31930543123136,
        -6.058818238834054,
    ]
    m = a[5].copy()
    m[5] = 1.0
    e = np.zeros(6)
    e[5] = 1.0
    alpha = np.array([0.0, 0.386, 0.21, 0.63, 1.0, 1.0])
    d = np.array([0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0])
    return np.vstack([a, c, alpha, d, m, e])


def ros34pw2() -> np.ndarray:
    """Tableau (11, 4) of ROS34PW2: a, gamma c, alpha, m, e; gamma is that of its module.

    J. Rang, L. Angermann, BIT Numer. Math. 45 (2005).  The time derivative is left out: order 3
    holds for any matrix, its column of f_t included.
    """
    gamma = 4.3586652150845900e-01
    alpha = np.zeros((4, 4))
    alpha[1, 0] = 8.7173304301691801e-01
    alpha[2, :2] = [8.4457060015369423e-01, -1.1299064236484185e-01]
    alpha[3, 2] = 1.0
    g = gamma * np.eye(4)
    g[1, 0] = -8.7173304301691801e-01
    g[2, :2] = [-9.0338057013044082e-01, 5.4180672388095326e-02]
    g[3, :3] = [2.4212380706095346e-01, -1.2232505839045147e00, 5.4526025533510214e-01]
    b = np.array([2.4212380706095346e-01, -1.2232505839045147e00, 1.5452602553351020e00, gamma])
    embedded = np.array(
        [3.7810903145819369e-01, -9.6042292212423178e-02, 0.5, 2.1793326075422950e-01]
    )
    inverse = np.linalg.inv(g)
    a = np.tril(alpha @ inverse, -1)
    c = np.tril(np.eye(4) / gamma - inverse, -1)
    m, e = b @ inverse, (b - embedded) @ inverse
    return np.vstack([a, gamma * c, alpha.sum(axis=1), m, e])
