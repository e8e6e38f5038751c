"""Kernels along paths of states and inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.errors import InputError
from vehiclemor.simulation.checks import loop_array

PATH_LOOPS = ("simulation.integrators.structures", "simulation.path_loops")


def along(
    kernels: Kernels,
    name: str,
    constants: np.ndarray,
    paths: tuple[np.ndarray, np.ndarray],
    sizes: tuple[int, int, int],
) -> np.ndarray:
    """Results (samples, size) of a kernel at every sample of a path.

    Parameters
    ----------
    paths
        States and inputs by sample.
    sizes
        Numbers of states, inputs and results.

    Raises
    ------
    InputError
        If a path has another shape: the kernel reads as many numbers as it knows.
    """
    try:
        states, inputs = (np.atleast_1d(loop_array(path)) for path in paths)
    except (TypeError, ValueError) as error:
        raise InputError(f"states and inputs must be arrays of numbers: {error}") from None
    for path, kind, size in zip((states, inputs), ("states", "inputs"), sizes[:2], strict=True):
        if path.shape != (len(states), size):
            raise InputError(f"{kind} have shape {path.shape}, not ({len(states)}, {size})")
    result = np.empty((len(states), sizes[2]))
    address = np.array([address_of(kernels, name)], dtype=np.int64)
    path_loops()["kernel_path"](states, inputs, address, constants, result)
    return result


def address_of(kernels: Kernels, name: str) -> int:
    """Address of a kernel for compiled loops, which don't look before they call it.

    Raises
    ------
    InputError
        If there is none.
    """
    address = kernels.address(name)
    if not address:
        raise InputError(f"the equations have no {name}")
    return address


def path_loops() -> Mapping[str, Loop]:
    """Loops over the samples of a path, the same for all systems."""
    return loops(PATH_LOOPS, ("kernel_path", "jacobian_at"))
