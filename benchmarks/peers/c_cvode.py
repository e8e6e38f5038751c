"""CVODE all in C: the exported model, compiled with about a hundred lines around SUNDIALS.

The libraries are those inside the wheel of scikit-sundae; a C compiler is needed.  The right-hand
side is the exported one, or that of `model.bare`, whose address a user may pass on as well.
"""

import ctypes
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import sksundae
from clock import Case, Curve, decades, library, pulse_shape, smooth_parts

import vehiclemor as vm
from vehiclemor.inputs import steering

LIBRARIES = ("core", "cvode", "nvecserial", "sunmatrixdense", "sunlinsoldense")
BARE = "CVODE in C, bare rhs"


@cache
def compiled(name: str) -> ctypes.CDLL:
    """The library of a model."""
    wheel = Path(sksundae.__file__).parents[1] / "scikit_sundae.libs"
    libraries = [next(wheel.glob(f"libsundials_{part}-*")) for part in LIBRARIES]
    with tempfile.TemporaryDirectory() as folder:
        source = vm.export(name, "c", f"{folder}/model")
        parts = Path(__file__).with_name("cvode.c"), source / "vehiclemor_model.c"
        link = *libraries, f"-Wl,-rpath,{wheel}", "-lm"
        found = ctypes.CDLL(library(folder, "-O3", f"-I{source}", *parts, *link))
    found.make.restype, found.part.restype = ctypes.c_void_p, ctypes.c_long
    return found


def address(array: np.ndarray) -> ctypes.c_void_p:
    """Address of an array, which it keeps alive."""
    return array.ctypes.data_as(ctypes.c_void_p)


def solver(case: Case, tolerance: float, bare: bool = True) -> ctypes.c_void_p:
    """A solver with its memory, which all runs share."""
    rhs = case.model.bare("rhs")
    how = ctypes.c_double(tolerance), address(case.model.error_scale)
    rates = ctypes.c_void_p(rhs.address if bare else None)
    made = compiled(case.model.name).make(rates, address(rhs.constants), *how)
    return ctypes.c_void_p(made)


def lane_change(case: Case, signal: Any, *factors: float) -> tuple[np.ndarray, Callable]:
    """Times with all break points, and a run: (solver, outputs) -> states, calls of the rhs."""
    part, start, n = compiled(case.model.name).part, case.start, len(case.start)
    pulse = np.array([*pulse_shape(case.racked, *factors), steering.BEGIN])
    (times, parts), spans = smooth_parts(signal), []
    for first, last, moves in parts:
        given = address(pulse if moves else np.zeros(3))
        spans.append((first, (moves, given, address(times[first:]), last - first + 1, n)))

    def run(own: ctypes.c_void_p, outputs: np.ndarray | None = None) -> tuple[np.ndarray, int]:
        states, calls = np.empty((len(times), n)), 0
        states[0] = start
        for first, given in spans:
            beside = None if outputs is None else address(outputs[first:])
            found = part(own, *given, address(states[first:]), beside)
            if found < 0:
                raise ArithmeticError("CVODE failed")
            calls += found
        return states, calls

    return times, run


def run(case: Case) -> dict[str, Curve]:
    """Whole runs: states alone, and all outputs beside them."""
    shape, (_, whole) = case.reference.shape, lane_change(case, case.maneuver)

    def make(tolerance: float, bare: bool = True, outputs: bool = False) -> Any:
        own, sizes = solver(case, tolerance, bare), (*shape, len(case.model.outputs))
        return lambda: whole(own, np.empty(sizes) if outputs else None)

    def curve(delivers: str = "states", **how: bool) -> Curve:
        made, read = partial(make, **how), lambda r: r[0][:, case.lateral]
        return Curve(made, decades(1e-2, 1e-9), read, delivers, lambda r: r[1])

    found = {"CVODE in C": curve(bare=False), BARE: curve()}
    return found | {f"{BARE}, outputs": curve("outputs", outputs=True)}


def steps(case: Case) -> dict[str, Curve]:
    """A loop in Python over steps in C, each of which starts afresh."""
    part, inputs = compiled(case.model.name).part, [address(u) for u in case.more]
    span, state = address(np.array([0.0, 0.01])), case.start
    place = address(state)

    def make(tolerance: float) -> Any:
        own = solver(case, tolerance)

        def step(_: np.ndarray, u: ctypes.c_void_p, __: float) -> np.ndarray:
            part(own, False, u, span, 2, 0, place, None)
            return state

        def loop() -> np.ndarray:
            state[:] = case.start
            return case.loop(step, state, inputs)

        return loop

    return {BARE: Curve(make, decades(1e-1, 1e-7, 2))}


def batch(case: Case) -> dict[str, Curve]:
    """Run after run."""
    runs = []
    for s in case.more:
        times, run = lane_change(case, s, s.amplitude_factor, s.frequency_factor)
        runs.append((np.isin(times, np.round(s.times, 9)), run))

    def make(tolerance: float) -> Any:
        own = solver(case, tolerance)
        return lambda: np.array([run(own)[0][kept, case.lateral] for kept, run in runs])

    return {BARE: Curve(make, decades(1e-3, 1e-9, 2), delivers="lateral position")}
