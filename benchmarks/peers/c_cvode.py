"""CVODE all in C: the exported model, compiled with about a hundred lines around SUNDIALS.

The libraries are those inside the wheel of scikit-sundae; a C compiler is needed.  The right-hand
side is the exported one, or that of `model.bare`, whose address a user may pass on as well.
"""

import ctypes
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import sksundae
from clock import Case, Curve, decades, library, pulse_shape

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
    found.make.restype, found.run.restype = ctypes.c_void_p, ctypes.c_long
    return found


def address(array: np.ndarray | None) -> ctypes.c_void_p:
    """Address of an array, which must live on; none of no array."""
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def solver(case: Case, tolerance: float, bare: bool = True) -> ctypes.c_void_p:
    """A solver with its memory, which all runs share."""
    rhs = case.model.bare("rhs")
    how = ctypes.c_double(tolerance), address(case.model.error_scale)
    rates = ctypes.c_void_p(rhs.address if bare else None)
    made = compiled(case.model.name).make(rates, address(rhs.constants), *how)
    return ctypes.c_void_p(made)


def lane_change(case: Case, *factors: float) -> np.ndarray:
    """Size, rate and begin of a lane change."""
    return np.array([*pulse_shape(case.racked, *factors), steering.BEGIN])


def run(case: Case) -> dict[str, Curve]:
    """Whole runs: states alone, and all outputs beside them."""
    library, times, pulse = compiled(case.model.name), case.maneuver.times, lane_change(case)
    edges = np.array([0, *(last for _, last, _ in case.spans())], dtype=np.int32)

    def make(tolerance: float, bare: bool = True, outputs: bool = False) -> Any:
        own = solver(case, tolerance, bare)

        def whole() -> tuple[np.ndarray, int]:
            states = np.empty((len(times), len(case.start)))
            found = np.empty((len(times), len(case.model.outputs))) if outputs else None
            arrays = map(address, (pulse, times, edges))
            calls = library.run(own, *arrays, -1, address(states), address(found))
            if calls < 0:
                raise ArithmeticError("CVODE failed")
            return states, calls

        return whole

    def curve(delivers: str = "states", **how: bool) -> Curve:
        made, read = partial(make, **how), lambda r: case.lateral_of(r[0])
        return Curve(made, decades(1e-2, 1e-9), read, delivers, lambda r: r[1])

    found = {"CVODE in C": curve(bare=False), BARE: curve()}
    return found | {f"{BARE}, outputs": curve("outputs", outputs=True)}


def steps(case: Case) -> dict[str, Curve]:
    """A loop in Python over steps in C, each of which starts afresh."""
    library, inputs = compiled(case.model.name), [address(u) for u in case.more]

    def make(tolerance: float) -> Any:
        own, length, state = solver(case, tolerance), ctypes.c_double(0.01), case.start
        place = address(state)

        def step(_: np.ndarray, u: ctypes.c_void_p) -> np.ndarray:
            library.step(own, place, u, length)
            return state

        def loop() -> np.ndarray:
            state[:] = case.start
            return case.loop(step, state, inputs)

        return loop

    return {BARE: Curve(make, decades(1e-1, 1e-7, 2))}


def batch(case: Case) -> dict[str, Curve]:
    """Run after run."""
    library, runs = compiled(case.model.name), []
    for signal in case.more:
        times = np.union1d(signal.times, signal.break_points)
        ends = [0.0, *signal.break_points, signal.duration]
        edges = np.searchsorted(times, ends).astype(np.int32)
        pulse = lane_change(case, signal.amplitude_factor, signal.frequency_factor)
        runs.append((np.isin(times, signal.times), (pulse, times, edges)))

    def make(tolerance: float) -> Any:
        own = solver(case, tolerance)

        def all_runs() -> np.ndarray:
            found = np.empty(case.reference.shape)
            for row, (kept, arrays) in zip(found, runs, strict=True):
                lateral = np.empty(len(kept))
                given = [*map(address, arrays), case.lateral, address(lateral), address(None)]
                library.run(own, *given)
                row[:] = lateral[kept]
            return found

        return all_runs

    return {BARE: Curve(make, decades(1e-3, 1e-9, 2), delivers="lateral position")}
