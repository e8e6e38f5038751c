"""Kernels along paths of states and inputs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vehiclemor.codegen.kernels import Kernels
from vehiclemor.codegen.loops import Loop, loops
from vehiclemor.codegen.vector_lanes import LANES
from vehiclemor.exceptions import InputError
from vehiclemor.simulation.checks import checked_path

PATH_LOOPS = ("simulation.integrators.structures", "simulation.path_loops")


def at_samples(
    kernels: Kernels,
    name: str,
    constants: np.ndarray,
    paths: tuple[np.ndarray, np.ndarray],
    sizes: tuple[int, int, int],
    finite: bool = False,
) -> np.ndarray:
    """Results (samples, size) of a kernel at every sample of paths of states and inputs.

    `sizes` are numbers of states, inputs and results: `InputError` if a path has another shape, as
    the kernel reads as many numbers as it knows, or if it must be finite and isn't.
    """
    states = checked_path(paths[0], sizes[0], "states", finite=finite)
    inputs = checked_path(paths[1], sizes[1], "inputs", len(states), finite)
    result = np.empty((len(states), sizes[2]))
    if name in kernels:
        kernels.sources[name].check(sizes[0], sizes[1], len(constants), sizes[2])
    evaluate(kernels, name, constants, (states, inputs), result)
    return result


def evaluate(
    kernels: Kernels,
    name: str,
    constants: np.ndarray,
    paths: tuple[np.ndarray, np.ndarray],
    result: np.ndarray,
    results: tuple[int, ...] = (),
) -> None:
    """Write results of a kernel along a path, some of them where `results` names their numbers."""
    lanes = LANES if len(result) >= LANES else 1
    address = np.array([address_of(kernels, name, lanes, results)], dtype=np.int64)
    loop = path_loops()["lane_path" if lanes == LANES else "kernel_path"]
    loop(*paths, address, constants, result)


def address_of(kernels: Kernels, name: str, lanes: int = 1, results: tuple[int, ...] = ()) -> int:
    """Address of a kernel for loops, which don't look before they call it; else `InputError`.

    See `Kernels.address`.
    """
    address = kernels.address(name, lanes, results)
    if not address:
        raise InputError(f"the equations have no {name}")
    return address


def path_loops() -> Mapping[str, Loop]:
    """Loops over the samples of a path, the same for all systems."""
    entries = "kernel_path", "lane_path", "watched", "chosen", "sampled", "jacobian_at"
    return loops(PATH_LOOPS, entries)
