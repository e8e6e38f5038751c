"""Slow modes of a vehicle at straight running: coordinates in which fast motion is slaved.

Left eigenvectors w of the linearised shape give z = w^T d with z' = lambda z + w^T B u exactly, so
that hop of the wheels, spins and stabilised constraints leave no trace in z.  The speed is the mode
of eigenvalue zero.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vehiclemor.reduction.vehicle.shape import VehicleShape

# Modes that steering moves by less than this (relative) are symmetric: they don't steer.
CONTROLLED = 1e-6
# Of all modes those that steering moves by less than this (relative) are not lateral.
MOVED = 1e-8
# Eigenvalues (1/s) nearer to each other belong to the cluster of stabilised constraints.
APART = 1e-2
# Smaller eigenvalues (1/s) count as zero.
STILL = 1e-6


@dataclass(frozen=True, eq=False)
class SlowModes:
    """Slow modes in real form: those that steering moves, then the slowest symmetric ones."""

    lateral: int  # How many coordinates steering moves.
    rates: np.ndarray  # Of z' the matrix (k, k), blocks of two for conjugate pairs.
    # z = left d (k, n), and d = right z for slow motion (n, k).
    left: np.ndarray
    right: np.ndarray
    input_matrix: np.ndarray  # Of z' the steering's column (k,).
    # What of the inputs (k + 1, inputs) is subtracted, so that z' has no derivative of the
    # steering; of the speed, which is last, nothing.
    input_shift: np.ndarray
    # Deviation (n,) of the shape that follows the steering without delay.
    static_response: np.ndarray
    # Deviation (n, inputs) of the shape by which faster motion follows steering and derivatives.
    slaved: np.ndarray
    # What fast motion in a deviation of the shape still adds to heading, X and Y (3, n).
    settling: np.ndarray
    # Mode of the speed (n,), scaled so that U grows by one.
    speed_left: np.ndarray
    speed_right: np.ndarray

    @property
    def encoding(self) -> np.ndarray:
        """Slow coordinates and, last, the speed per deviation of the shape (k + 1, n)."""
        return np.vstack([self.left, self.speed_left])

    def coordinates(self, deviations: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Slow coordinates and speed (samples, k + 1) of deviations and inputs."""
        return deviations @ self.encoding.T - inputs @ self.input_shift.T


def slow_modes(shape: VehicleShape, fastest: float, symmetric: int = 0) -> SlowModes:
    """Slow modes with |lambda| up to `fastest` (1/s), and so many symmetric ones (or pairs).

    The derivatives of the steering are taken out of the coordinates.  Torques stay: left
    eigenvectors hold the momentum of the wheels' spin, so that no coordinate needs their rates.
    """
    linear = shape.linearised
    values, left, right = eigenmodes(linear.a)
    # The many equal eigenvalues of stabilised constraints are defective, but not used.
    controlled = np.abs(left @ linear.b[:, 0]) * np.linalg.norm(right, axis=0)
    steers = controlled > CONTROLLED * controlled.max()
    still = int(np.argmin(np.abs(values)))
    moving = np.abs(values) >= STILL
    moving[still] = False
    wanted = steers & moving & (np.abs(values) <= fastest)
    w, v = real_modes(values, left, right, wanted)
    count = len(w)
    quiet = np.flatnonzero(
        ~steers & (np.imag(values) >= 0.0) & (np.arange(len(values)) != still) & apart(values)
    )
    quiet = quiet[np.argsort(np.abs(values[quiet]))]
    if symmetric:
        chosen = np.isin(np.arange(len(values)), quiet[:symmetric])
        more_w, more_v = real_modes(values, left, right, chosen)
        w, v = np.vstack([w, more_w]), np.hstack([v, more_v])
    rates = w @ linear.a @ v
    steering, b = shape.inputs.steering, w @ linear.b
    shift = np.zeros((len(w) + 1, b.shape[1]))
    shift[:-1, :steering], driven = without_derivatives(rates, b[:, :steering])
    static = -np.linalg.lstsq(linear.a, linear.b[:, 0], rcond=1e-10)[0]
    scale = linear.velocity_a[1] @ right[:, still].real
    slow = v @ w + np.outer(right[:, still].real, left[still].real)
    slaved, settling = fast_motion(shape, slow)
    return SlowModes(
        count,
        rates,
        w,
        v,
        driven,
        shift,
        static + v @ np.linalg.solve(rates, driven),
        slaved,
        settling,
        left[still].real * scale,
        right[:, still].real / scale,
    )


def fast_motion(shape: VehicleShape, slow: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What follows the steering (n, inputs), and what adds to heading, X and Y (3, n) as it decays.

    `slow` is the projection (n, n) on slow motion.  The rest e' = A e + d s soon follows as
    e = -A^-1 d s - A^-2 d s' - A^-3 d s'' ...; free, it adds -A^-1 e to its integral.
    """
    linear = shape.linearised
    follow, drive = without_derivatives(linear.a, linear.b[:, : shape.inputs.steering])
    fast = np.eye(len(slow)) - slow
    inverse = np.linalg.solve(linear.a @ fast + slow, fast)
    column = -inverse @ drive
    for j in range(follow.shape[1]):
        follow[:, j] += column
        column = inverse @ column
    integral = -linear.velocity_a @ inverse
    # Where the heading is still to change, the vehicle goes sideways.
    integral[2] += shape.speed * integral[0] @ inverse
    return follow, integral


def response(
    shape: VehicleShape, modes: SlowModes, inputs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What inputs (inputs,) do in straight running: to z' (k,), and at once to psi', U and V (3,).

    Fast motion follows them without delay.
    """
    linear, b = shape.linearised, shape.linearised.b @ inputs
    slow = modes.right @ (modes.left @ b) + modes.speed_right * (modes.speed_left @ b)
    fast = -np.linalg.lstsq(linear.a, b - slow, rcond=1e-10)[0]
    return modes.left @ b, linear.velocity_b @ inputs + linear.velocity_a @ fast


def eigenmodes(a: np.ndarray) -> tuple[Any, Any, Any]:
    """Eigenvalues (n,), left eigenvectors by rows (n, n), and the inverse of these."""
    values, vectors = np.linalg.eig(a.T)
    left = vectors.T
    return values, left, np.linalg.inv(left)


def real_modes(
    values: np.ndarray, left: np.ndarray, right: np.ndarray, chosen: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates per state (k, n) and back (n, k) of modes in real form, slow ones first.

    Left eigenvectors stand by rows, `right` is the inverse of that matrix.  Of a conjugate pair
    both modes or the upper one are chosen; it has a block of two.
    """
    rows, columns = [], []
    upper = np.flatnonzero(chosen & (np.imag(values) >= 0.0))
    for i in sorted(upper, key=lambda i: abs(values[i])):
        rows.append(left[i].real)
        if values[i].imag > 0.0:
            rows.append(left[i].imag)
            columns += [2.0 * np.real(right[:, i]), -2.0 * np.imag(right[:, i])]
        else:
            columns.append(np.real(right[:, i]))
    return np.array(rows), np.array(columns).T


def without_derivatives(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Feedthrough H (n, inputs) and drive d (n,) of x' = A x + b_0 s + b_1 s' + b_2 s'' ...

    For z = x - H (s, s', ...) the derivatives of s go: z' = A z + d s.
    """
    feedthrough = np.zeros_like(b)
    for j in range(b.shape[1] - 1, 0, -1):
        feedthrough[:, j - 1] = b[:, j] + a @ feedthrough[:, j]
    return feedthrough, b[:, 0] + a @ feedthrough[:, 0]


def apart(values: np.ndarray) -> np.ndarray:
    """Eigenvalues outside of clusters: those of stabilised constraints are no motion."""
    distance = np.abs(values[:, None] - values[None, :]) + 1e9 * np.eye(len(values))
    return distance.min(axis=1) > APART


def lateral_modes(shape: VehicleShape) -> tuple[SlowModes, np.ndarray]:
    """All modes that steering moves, and what of the shape (n, inputs) follows inputs at once."""
    linear = shape.linearised
    follow, drive = without_derivatives(linear.a, linear.b)
    values, w, v = eigenmodes(linear.a)
    motion = apart(values) & (np.abs(values) > APART)
    moved = np.abs(w @ drive) * np.linalg.norm(v, axis=0) / np.maximum(np.abs(values), APART)
    moved[~motion] = 0.0
    left, right = real_modes(values, w, v, moved > MOVED * moved.max())
    modes = replace(
        slow_modes(shape, np.inf),
        lateral=len(left),
        rates=left @ linear.a @ right,
        left=left,
        right=right,
        input_matrix=left @ drive,
        input_shift=np.vstack([left @ follow, np.zeros(follow.shape[1])]),
    )
    return modes, follow


def within(modes: SlowModes, test: np.ndarray, trial: np.ndarray) -> SlowModes:
    """The modes in fewer coordinates: test (r, k) times the old ones, which are trial times new."""
    return replace(
        modes,
        lateral=len(test),
        rates=test @ modes.rates @ trial,
        left=test @ modes.left,
        right=modes.right @ trial,
        input_matrix=test @ modes.input_matrix,
        input_shift=np.vstack([test @ modes.input_shift[:-1], modes.input_shift[-1:]]),
    )
