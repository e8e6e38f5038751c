"""Modes of structures, slow ones first: free, or with the deflections of the ports held."""

from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.simulation.structures.model import StructuralModel
from vehiclemor.simulation.structures.system import factored

# Modes that are looked for at first.
FIRST_MODES = 16


def port_rates(model: StructuralModel) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping (p,) of the ports at the static state."""
    law = model.system.law
    rest = np.zeros(law.static.shape[1])
    _, stiffness, damping = -law.at(rest, rest, np.zeros(len(model.inputs))).T
    return stiffness, damping


def free_modes(model: StructuralModel, highest: float) -> np.ndarray:
    """Modes (n, k) up to so many Hz of the structure on its springs and tires.

    It is linearised at the static state; dampers are left out.
    """
    structure: Any = model.system.structure
    stiffness, _ = port_rates(model)
    held = structure.held(stiffness)
    # Shifted, so that motion that hardly anything holds does no harm.
    shift = 1.0
    solve = factored(held + shift * structure.mass, "MMD_AT_PLUS_A").solve
    return _below(held, structure.mass, solve, -shift, highest)


def fixed_modes(model: StructuralModel, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Static shapes (n, p) of unit deflections of the ports, and modes (n, k) up to so many Hz.

    The modes are those of the structure whose ports do not deflect.
    """
    from scipy.sparse import block_array
    from scipy.sparse.linalg import splu

    structure: Any = model.system.structure
    n, p = structure.ports.shape
    # In a matrix of like sizes pivots stay where the factors are sparse.
    size = float(np.abs(structure.stiffness.diagonal()).mean())
    held = block_array(
        [[structure.stiffness, size * structure.ports], [size * structure.ports.T, None]]
    )
    factor = splu(held.tocsc())
    units = np.vstack([np.zeros((n, p)), size * np.eye(p)])
    shapes = factor.solve(units)[:n]

    def solve(b: np.ndarray) -> np.ndarray:
        return factor.solve(np.concatenate([b, np.zeros(p)]))[:n]

    return shapes, _below(structure.stiffness, structure.mass, solve, 0.0, highest)


def _below(stiffness: Any, mass: Any, solve: Any, shift: float, highest: float) -> np.ndarray:
    """Modes (n, k) up to so many Hz; `solve` is by the stiffness less `shift` times the mass."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    n, count, largest = mass.shape[0], FIRST_MODES, (2.0 * np.pi * highest) ** 2
    operator = LinearOperator((n, n), matvec=solve, dtype=float)  # type: ignore[call-arg]
    begin = solve(mass @ np.cos(np.arange(n, dtype=float)))
    while True:
        count = min(count, n - 2)
        squares, modes = eigsh(stiffness, count, mass, shift, v0=begin, OPinv=operator)
        order = np.argsort(squares)
        squares, modes = squares[order], modes[:, order]
        if squares[-1] > largest or count == n - 2:
            break
        count *= 2
    if squares[0] > largest:
        raise InputError(f"no mode is below {highest:g} Hz: the first has {_hertz(squares[0]):.4g}")
    return modes[:, squares <= largest]


def _hertz(square: float) -> float:
    return float(np.sqrt(max(square, 0.0)) / (2.0 * np.pi))
