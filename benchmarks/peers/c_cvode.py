"""CVODE all in C: the exported model, compiled with about a hundred lines around SUNDIALS.

The libraries are those inside the wheel of scikit-sundae; a C compiler is needed.
"""

import ctypes
import subprocess
import tempfile
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import sksundae
from clock import COMPILER, Case, Curve, decades

import vehiclemor as vm
from vehiclemor.inputs import steering

LIBRARIES = ("core", "cvode", "nvecserial", "sunmatrixdense", "sunlinsoldense")
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC", "-w")


@cache
def compiled(name: str) -> ctypes.CDLL:
    """The library of a model."""
    if COMPILER is None:
        raise FileNotFoundError("no C compiler")
    wheel = Path(sksundae.__file__).parents[1] / "scikit_sundae.libs"
    libraries = [next(wheel.glob(f"libsundials_{part}-*")) for part in LIBRARIES]
    with tempfile.TemporaryDirectory() as folder:
        source = vm.export(name, "c", f"{folder}/model")
        parts = [Path(__file__).with_name("cvode.c"), source / "vehiclemor_model.c"]
        made = Path(folder) / "peer.so"
        link = [*libraries, f"-Wl,-rpath,{wheel}", "-lm"]
        subprocess.run([COMPILER, *FLAGS, f"-I{source}", *parts, *link, "-o", made], check=True)  # noqa: S603
        library = ctypes.CDLL(str(made))
    library.make.restype = ctypes.c_void_p
    return library


def solver(case: Case, tolerance: float) -> tuple[ctypes.CDLL, ctypes.c_void_p]:
    """A solver with its memory, which all runs share."""
    library = compiled(case.model.name)
    own = ctypes.c_void_p(library.make())
    library.tolerance(own, ctypes.c_double(tolerance), pointer(case.model.error_scale))
    return library, own


def pointer(array: np.ndarray) -> ctypes.c_void_p:
    """Address of an array, which must live on."""
    return ctypes.c_void_p(array.ctypes.data)


def pulse(case: Case, amplitude: float = 1.0, speed: float = 1.0) -> np.ndarray:
    """Size, rate and begin of a lane change."""
    racked = len(case.model.inputs) > 1
    size = steering.RACK_AMPLITUDE if racked else steering.LANE_CHANGE_AMPLITUDE
    rate = 2.0 * np.pi * speed / steering.LANE_CHANGE_LENGTH
    return np.array([amplitude * size, rate, steering.BEGIN])


def run(case: Case) -> dict[str, Curve]:
    """Whole runs: states alone, and all outputs beside them."""
    compiled(case.model.name)
    times, counts = case.maneuver.times, np.zeros(4, dtype=np.int64)
    edges = np.array([0, *(last for _, last, _ in case.spans())], dtype=np.int32)
    given, shape = pulse(case), (len(times), len(case.start))

    def make(tolerance: float, outputs: bool) -> Any:
        library, own = solver(case, tolerance)
        fixed = own, pointer(given), pointer(times), pointer(edges), -1

        def whole() -> tuple[np.ndarray, np.ndarray]:
            states, found = np.empty(shape), None
            if outputs:
                found = np.empty((len(times), len(case.model.outputs)))
            address = None if found is None else pointer(found)
            if library.run(*fixed, pointer(states), address, pointer(counts)):
                raise ArithmeticError("CVODE failed")
            return states, counts.copy()

        return whole

    read, scan = (lambda r: r[0][:, case.lateral]), decades(1e-2, 1e-9)
    evaluations = lambda r: r[1][:2].sum()  # noqa: E731
    return {
        "CVODE in C": Curve(partial(make, outputs=False), scan, read, "states", evaluations),
        "CVODE in C, outputs": Curve(partial(make, outputs=True), scan, read, "outputs"),
    }


def steps(case: Case) -> dict[str, Curve]:
    """A loop in Python over steps in C, each of which starts afresh."""
    compiled(case.model.name)

    def make(tolerance: float) -> Any:
        library, own = solver(case, tolerance)
        length, state = ctypes.c_double(0.01), case.start
        inputs = [(u, pointer(u)) for u in case.more["held"]]

        def loop() -> np.ndarray:
            state[:] = case.start
            found, address = np.empty(len(case.reference)), pointer(state)
            for k, (_, u) in enumerate(inputs):
                library.step(own, address, u, length)
                found[k] = state[case.lateral]
            return found

        return loop

    return {"CVODE in C": Curve(make, decades(1e-1, 1e-7, 2), np.asarray)}


def batch(case: Case) -> dict[str, Curve]:
    """Run after run."""
    compiled(case.model.name)
    counts = np.zeros(4, dtype=np.int64)

    def make(tolerance: float) -> Any:
        library, own = solver(case, tolerance)
        runs = []
        for signal in case.more["signals"]:
            begin = [steering.BEGIN, steering.BEGIN + steering.LANE_CHANGE_LENGTH]
            breaks = [begin[0], begin[0] + (begin[1] - begin[0]) / signal.frequency_factor]
            times = np.union1d(signal.times, breaks)
            edges = np.searchsorted(times, [0.0, *breaks, signal.duration]).astype(np.int32)
            kept = np.isin(times, signal.times)
            given = pulse(case, signal.amplitude_factor, signal.frequency_factor)
            runs.append((given, times, edges, kept))

        def all_runs() -> np.ndarray:
            found = np.empty(case.reference.shape)
            for row, (given, times, edges, kept) in zip(found, runs, strict=True):
                all_times = np.empty(len(times))
                library.run(
                    own,
                    *map(pointer, (given, times, edges)),
                    case.lateral,
                    pointer(all_times),
                    None,
                    pointer(counts),
                )
                row[:] = all_times[kept]
            return found

        return all_runs

    return {"CVODE in C": Curve(make, decades(1e-2, 1e-7, 2), np.asarray, "lateral position")}
