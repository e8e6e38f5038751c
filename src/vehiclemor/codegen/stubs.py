"""Names of generated kernels and sizes, for the loops that call them.

The loops are compiled in the linked module (see `link.py`), where these names are the generated
kernels and constants.  Here they only give readers and type checkers something to hold on to.
"""

from numpy.typing import NDArray

Array = NDArray

N = 0
INPUTS = 0
OUTPUTS = 0
WORK = 0


def residual(q: Array, u: Array, constants: Array, work: Array, result: Array) -> None:
    """Residual Phi(q; u) into result (N,)."""
    raise NotImplementedError("runs only in a linked module")


def residual_jacobian(q: Array, u: Array, constants: Array, work: Array, result: Array) -> None:
    """Jacobian into result[:, :N] and residual into result[:, N]; result is (N, N + 1)."""
    raise NotImplementedError("runs only in a linked module")


def newton_step(q: Array, u: Array, constants: Array, work: Array, result: Array) -> None:
    """Newton step Phi_q^-1 Phi into result (N,), by straight-line elimination."""
    raise NotImplementedError("runs only in a linked module")


def outputs(q: Array, u: Array, constants: Array, work: Array, result: Array) -> None:
    """Outputs y(q, u) into result (OUTPUTS,)."""
    raise NotImplementedError("runs only in a linked module")


def residual_tangent(
    q: Array, u: Array, constants: Array, work: Array, basis: Array, r: int, result: Array
) -> None:
    """Jacobian times basis[:, :r] into result[:, :r], residual into result[:, N]."""
    raise NotImplementedError("runs only in a linked module")


def call_machine(model: tuple[Array, Array], place: int, x: Array, u: Array, result: Array) -> None:
    """Call a kernel's machine code; see `straight_line.call_machine`."""
    raise NotImplementedError("runs only in a linked module")
