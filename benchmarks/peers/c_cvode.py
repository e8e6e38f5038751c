"""CVODE all in C: the exported model, compiled with about a hundred lines around SUNDIALS.

The libraries are those inside the wheel of scikit-sundae; a C compiler is needed.  The right-hand
side is the exported one, or that of `model.bare`, whose address a user may pass on as well.
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
BARE = "CVODE in C, bare rhs"


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
    library.calls.restype = ctypes.c_long
    return library


def address(array: np.ndarray | None) -> ctypes.c_void_p:
    """Address of an array, which must live on; none of no array."""
    return ctypes.c_void_p(None if array is None else array.ctypes.data)


def solver(case: Case, tolerance: float, bare: bool) -> tuple[ctypes.CDLL, ctypes.c_void_p]:
    """A solver with its memory, which all runs share."""
    library, rhs = compiled(case.model.name), case.model.bare("rhs")
    how = ctypes.c_double(tolerance), address(case.model.error_scale)
    rates = ctypes.c_void_p(rhs.address if bare else None)
    return library, ctypes.c_void_p(library.make(rates, address(rhs.constants), *how))


def pulse(case: Case, amplitude: float = 1.0, speed: float = 1.0) -> np.ndarray:
    """Size, rate and begin of a lane change."""
    racked = len(case.model.inputs) > 1
    size = steering.RACK_AMPLITUDE if racked else steering.LANE_CHANGE_AMPLITUDE
    rate = 2.0 * np.pi * speed / steering.LANE_CHANGE_LENGTH
    return np.array([amplitude * size, rate, steering.BEGIN])


def run(case: Case) -> dict[str, Curve]:
    """Whole runs: states alone, and all outputs beside them."""
    compiled(case.model.name)
    times, given = case.maneuver.times, pulse(case)
    edges = np.array([0, *(last for _, last, _ in case.spans())], dtype=np.int32)

    def make(tolerance: float, bare: bool = True, outputs: bool = False) -> Any:
        library, own = solver(case, tolerance, bare)

        def whole() -> tuple[np.ndarray, int]:
            states, found = np.empty((len(times), len(case.start))), None
            if outputs:
                found = np.empty((len(times), len(case.model.outputs)))
            arrays = map(address, (given, times, edges))
            if library.run(own, *arrays, -1, address(states), address(found)):
                raise ArithmeticError("CVODE failed")
            return states, library.calls(own)

        return whole

    read, scan, calls = (lambda r: r[0][:, case.lateral]), decades(1e-2, 1e-9), lambda r: r[1]
    return {
        "CVODE in C": Curve(partial(make, bare=False), scan, read, counts=calls),
        BARE: Curve(make, scan, read, counts=calls),
        f"{BARE}, outputs": Curve(partial(make, outputs=True), scan, read, "outputs", calls),
    }


def steps(case: Case) -> dict[str, Curve]:
    """A loop in Python over steps in C, each of which starts afresh."""
    compiled(case.model.name)

    def make(tolerance: float) -> Any:
        library, own = solver(case, tolerance, bare=True)
        length, state = ctypes.c_double(0.01), case.start
        inputs = [(u, address(u)) for u in case.more["held"]]

        def loop() -> np.ndarray:
            state[:] = case.start
            found, place = np.empty(len(case.reference)), address(state)
            for k, (_, u) in enumerate(inputs):
                library.step(own, place, u, length)
                found[k] = state[case.lateral]
            return found

        return loop

    return {BARE: Curve(make, decades(1e-1, 1e-7, 2), np.asarray)}


def batch(case: Case) -> dict[str, Curve]:
    """Run after run."""
    compiled(case.model.name)
    runs = []
    for signal in case.more["signals"]:
        times = np.union1d(signal.times, signal.break_points)
        ends = [0.0, *signal.break_points, signal.duration]
        edges = np.searchsorted(times, ends).astype(np.int32)
        given = pulse(case, signal.amplitude_factor, signal.frequency_factor)
        runs.append((np.isin(times, signal.times), (given, times, edges)))

    def make(tolerance: float) -> Any:
        library, own = solver(case, tolerance, bare=True)

        def all_runs() -> np.ndarray:
            found = np.empty(case.reference.shape)
            for row, (kept, arrays) in zip(found, runs, strict=True):
                lateral, given = np.empty(len(kept)), map(address, arrays)
                library.run(own, *given, case.lateral, address(lateral), address(None))
                row[:] = lateral[kept]
            return found

        return all_runs

    return {BARE: Curve(make, decades(1e-3, 1e-9, 2), np.asarray, "lateral position")}
