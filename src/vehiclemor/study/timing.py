"""The timing pass: runs interleaved in one process, medians of rounds, stored by content.

What counts is a call of `simulate` with a new input, all states and outputs delivered, timed from
outside: whatever a model works out about an input is part of its call. Inputs arrive as signals,
piecewise polynomials: making these of a formula takes milliseconds of Python, once, for reduced
models and full order alike. The same call repeated, and what a model reports of its loop, are
recorded beside it and decide nothing. Between two runs of a comparison other work throws code and
data out of the processor's caches, so a call that is not timed comes first. Seconds stored with the
results of a study are measured while others run beside them; a speed-up is quoted
from this pass only.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from vehiclemor.codegen.cache import compiler_identity
from vehiclemor.codegen.sources import source_digest
from vehiclemor.failure import Failure, attempt
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.inputs.signal import Signal
from vehiclemor.progress import tell
from vehiclemor.provenance import attributes, machine
from vehiclemor.reduction.interface import FittedModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import one_thread, timed
from vehiclemor.simulation.trajectory import FINISHED, Trajectory
from vehiclemor.study.evaluate import cached_fit, evaluate, for_run, fresh_fit, model_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.result import variables
from vehiclemor.study.scenario import model_of_run, start_of
from vehiclemor.study.store import stored

# Rounds of a cost table, and of the test set of a protocol, which has many runs; and those of them
# in which long runs stand, which scatter less.
CASE_ROUNDS, PROTOCOL_ROUNDS, PROTOCOL_ROUNDS_OF_LONG = 31, 3, 2
# New inputs in a row for a short and a long run, the first to warm up; length (s) of a long run,
# and of one beside which warming up is nothing.
INPUTS, INPUTS_OF_LONG, LONG_RUN, LONGEST_RUN = 3, 2, 2e-3, 2e-2
# Fits whose median counts, as long as they take no more than these seconds together; and the length
# (s) of a fit beside which loading machine code is nothing.
FITS, FIT_SECONDS, LONG_FIT = 9, 2.0, 1.0
CALL, REPEATED, LOOP = 0, 1, 2
# Variable -> case against which it is the speed-up of a call; quantiles of its seconds.
SPEED_UPS = {"speed_up": "baseline", "speed_up_strongest": "strongest"}
QUANTILES = {"seconds_median": 0.5, "seconds_lower": 0.25, "seconds_upper": 0.75}


def timed_starts(experiments: Mapping[str, Mapping[str, Experiment]], path: Path) -> xr.Dataset:
    """Stored timing of initial condition -> name of a case -> experiment, as of `timed_cases`."""

    def every_start() -> xr.Dataset:
        parts = [timed_cases(cases).assign_coords(start=s) for s, cases in experiments.items()]
        return xr.concat(parts, dim="start", join="exact", combine_attrs="override")

    keys: dict[str, dict[str, str]] = {}
    for start, cases in experiments.items():
        keys[start] = {case: experiment.key for case, experiment in cases.items()}
    return stored_timing(path, keys, every_start)


def stored_timing(path: Path, content: object, make: Callable[[], xr.Dataset]) -> xr.Dataset:
    """What is stored for this content, machine and source, else what `make` gives, see `stored`."""
    source = source_digest((), ("study/timing.py",))
    text = json.dumps([content, machine(), compiler_identity(), source])
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    return stored(path, "timing", key, make)


def timed_cases(experiments: Mapping[str, Experiment]) -> xr.Dataset:
    """Time experiments on the one run that all are tested on.

    The case `baseline` is the paper's kind of full-order run and `strongest` the best full-order
    solver, for every model.  Beside what `timed_tests` has there are speed-ups against
    these two, counts, rank and status; errors on `output` too.
    """
    first = next(iter(experiments.values()))
    samples, start = first.test[0].maneuver.samples, first.test[0].start
    names = ["effective_rank", "offline_evaluations", "rms_error", "status"]
    names += model_of(first).counts
    results = [evaluate(experiment)[names] for experiment in experiments.values()]
    dataset = xr.concat(results, dim="case", join="exact", combine_attrs="drop_conflicts")
    dataset = dataset.drop_vars("output_unit").assign_coords(case=list(experiments))
    finished = np.isin(dataset["status"].values[:, None], FINISHED)
    what = f"{samples} time points from {start}"
    times, seconds = _measured(experiments, (CASE_ROUNDS, CASE_ROUNDS), what, finished)
    dataset = dataset.merge(times.isel(scenario=0, drop=True))
    columns: dict[str, object] = {
        "tolerance": [float(e.settings.get("tolerance", np.nan)) for e in experiments.values()]
    }
    # Round by round, so that a burst of other load on the machine hits both alike.
    calls = seconds[:, :, 0, CALL]
    calls = np.where(calls > 0.0, calls, np.nan)
    for name, against in SPEED_UPS.items():
        if against in experiments:
            baseline = calls[:, [list(experiments).index(against)]]
            columns[name] = np.median(baseline / calls, axis=0)
    return dataset.assign(variables(columns, "case")).assign_attrs(times.attrs)


def timed_tests(
    experiments: Mapping[str, Experiment], finished: np.ndarray, what: str = "test set"
) -> xr.Dataset:
    """Time experiments on their test scenarios, which are the same for all.

    A run that has not `finished` (experiments, scenarios) is not timed: its `seconds` with
    quartiles and `loop_seconds`, on `case` and `scenario`, are missing.
    """
    rounds = PROTOCOL_ROUNDS, PROTOCOL_ROUNDS_OF_LONG
    return _measured(experiments, rounds, what, finished)[0]


def _measured(
    experiments: Mapping[str, Experiment], rounds: tuple[int, int], what: str, finished: np.ndarray
) -> tuple[xr.Dataset, np.ndarray]:
    """Median and quartiles of `_rounds`, with the number of missing times, and their seconds."""
    seconds, offline = _rounds(list(experiments.values()), rounds, what, finished)
    of_calls = seconds[..., CALL]
    with warnings.catch_warnings():
        # What was never timed has none.
        warnings.filterwarnings("ignore", "All-NaN slice")
        quantiles = {n: np.nanquantile(of_calls, share, axis=0) for n, share in QUANTILES.items()}
        quantiles["repeated_seconds"] = np.nanmedian(seconds[..., REPEATED], axis=0)
        quantiles["loop_seconds"] = np.nanmedian(seconds[..., LOOP], axis=0)
    columns = variables(quantiles, "case", "scenario")
    columns |= variables({"offline_seconds": offline}, "case")
    columns["seconds"] = columns.pop("seconds_median")
    first = next(iter(experiments.values()))
    labels = {"case": list(experiments), "scenario": [scenario.label for scenario in first.test]}
    title = f"timing of {first.model}, interleaved, {len(seconds)} rounds, {what}"
    missing = np.count_nonzero(np.isnan(quantiles["seconds_median"][finished]))
    about = attributes(title, first.kernel, model=first.model, missing=missing)
    return xr.Dataset(columns, labels, about), seconds


@one_thread()
def _rounds(
    experiments: Sequence[Experiment], rounds: tuple[int, int], what: str, finished: np.ndarray
) -> tuple[np.ndarray, list[float]]:
    """Seconds of runs (rounds, experiments, scenarios, parts of `Seconds`), and of fits.

    `rounds` are all of them, and those of long runs, which have no seconds (NaN) in the others, as
    runs that fail have in all.  All runs of a round follow one another: load hits all alike.
    """
    model = model_of(experiments[0])
    scenarios = experiments[0].test
    tests = [(as_signal(model, s.maneuver), start_of(model, s)) for s in scenarios]
    wanted = finished.copy()
    # The names differ, so that progress never goes back.
    work = f"rounds of times on {model.name}, {what}"
    tell(work, 0, rounds[0] + 1)
    fits = [_warm_fit(model, e, bool(w.any())) for e, w in zip(experiments, wanted, strict=True)]
    for (reduced, _), runs in zip(fits, wanted, strict=True):
        if isinstance(reduced, Failure) and runs.any():
            raise RuntimeError(f"its runs have finished, but the fit fails: {reduced.message}")
    models = [model_of_run(model, scenario) for scenario in scenarios]
    for_test: list[list[Any]] = []
    for reduced, _ in fits:
        for_test.append([for_run(reduced, changed) for changed in models])
    seconds = np.full((rounds[0] + 1, *wanted.shape, len(Seconds._fields)), np.nan)
    for turn in range(rounds[0] + 1):
        for number, (maneuver, start) in enumerate(tests):
            for index in range(len(fits)):
                # The first round loads machine code, and tells how long a run takes.
                long = turn == 0 or seconds[0, index, number, CALL] >= LONG_RUN
                if not wanted[index, number] or (long and turn > rounds[1]):
                    continue
                simulate = for_test[index][number].simulate
                inputs = INPUTS_OF_LONG if long else INPUTS
                if turn > 0 and seconds[0, index, number, CALL] >= LONGEST_RUN:
                    inputs = 1
                measured = attempt(partial(called, simulate, (maneuver, start), inputs))
                if isinstance(measured, Failure):
                    wanted[index, number], seconds[:, index, number] = False, np.nan
                else:
                    seconds[turn, index, number] = measured
        tell(work, turn + 1, rounds[0] + 1)
    return seconds[1:], [offline for _, offline in fits]


class Seconds(NamedTuple):
    """Of a call with a new input, of the same call again, and of the loop that it reports."""

    call: float
    repeated: float
    loop: float


def as_signal(model: Model, maneuver: Excitation) -> Excitation:
    """A maneuver as the signal of its polynomials; a structure's, which takes samples, as it is."""
    if isinstance(maneuver, Signal) or model.kind == "structural":
        return maneuver
    about = maneuver.name, maneuver.summary, maneuver.inputs, maneuver.duration, maneuver.samples
    return Signal(*about, hold="polynomials", nominal_pieces=maneuver.pieces)


def as_new(maneuver: Excitation) -> Excitation:
    """A maneuver as a user has just built it: nothing is known of its inputs from earlier calls."""
    if isinstance(maneuver, Signal):
        return replace(maneuver, nominal_pieces=maneuver.nominal_pieces._replace())
    assert isinstance(maneuver, Maneuver)
    # Cached results are looked up by the function.
    return replace(maneuver, signal=partial(maneuver.signal))


def called(
    simulate: Callable[..., Trajectory],
    run: tuple[Excitation, *tuple[Any, ...]],
    inputs: int,
    *,
    again: bool = True,
) -> Seconds | Failure:
    """Median seconds of a run with so many new inputs, or the failure.

    The first of several inputs warms up.  The maneuver comes first of what the run takes.  Without
    `again` no call is repeated.
    """
    maneuver, *further = run

    def delivered(new: Excitation) -> Trajectory:
        # Histories are computed when they are first read.
        trajectory = simulate(new, *further)
        assert trajectory.outputs is not None
        return trajectory

    measured: list[Seconds] = []
    for _ in range(inputs):
        new = as_new(maneuver)
        trajectory, seconds = timed(partial(delivered, new))
        if not trajectory.finished:
            return Failure(trajectory.status, trajectory.message)
        repeated = np.nan
        if again:
            trajectory, repeated = timed(partial(delivered, new))
        measured.append(Seconds(seconds, repeated, trajectory.seconds))
    return Seconds(*np.median(measured[1:] or measured, axis=0).tolist())


def _warm_fit(
    model: Model, experiment: Experiment, needed: bool
) -> tuple[FittedModel | Failure, float]:
    """A fitted model, and the median seconds of fits with their machine code loaded."""
    fitted = cached_fit(model, experiment)
    if isinstance(fitted, Failure):
        return fitted, np.nan
    if not needed or fitted.offline.seconds > LONG_FIT:
        return fitted, fitted.offline.seconds
    seconds: list[float] = []
    while len(seconds) < FITS and sum(seconds) < FIT_SECONDS:
        fitted = fresh_fit(model, experiment)
        if isinstance(fitted, Failure):
            return fitted, np.nan
        seconds.append(fitted.offline.seconds)
    return fitted, float(np.median(seconds))
