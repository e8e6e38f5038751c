"""The timing pass: runs interleaved in one process, medians of rounds, stored by content.

What counts is a whole call of `simulate`, all states and outputs delivered, timed from outside;
what a model tells of its own loop is recorded beside it and decides nothing.  Between two runs of a
comparison other work throws code and data out of the caches, so every timed call follows one of the
same run that is not: a user who runs a model again and again finds them warm.  Seconds stored with
the results of a study are measured while others run beside them; a speed-up is quoted from this
pass only.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from vehiclemor.codegen.cache import compiler_identity
from vehiclemor.failure import Failure, attempt
from vehiclemor.progress import tell
from vehiclemor.provenance import attributes, machine
from vehiclemor.reduction.interface import FittedModel
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.run_timer import CLOCK, timed
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study.evaluate import evaluate, for_run, fresh_fit, kept_fit, model_of
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.result import variables
from vehiclemor.study.scenario import model_of_run, start_of
from vehiclemor.study.store import stored

# Rounds of a cost table, and of the test set of a protocol, which has many runs; and those of them
# in which long runs stand, which scatter less.
CASE_ROUNDS, PROTOCOL_ROUNDS, PROTOCOL_ROUNDS_OF_LONG = 41, 7, 3
# Calls of a short and of a long run in a row, the first a warm-up; length (s) of a long one.
REPEATS, REPEATS_OF_LONG, LONG_RUN = 4, 2, 2e-3
# Fits whose median counts, as long as they take no more than these seconds together; and the length
# (s) of a fit beside which loading machine code is nothing.
FITS, FIT_SECONDS, LONG_FIT = 9, 2.0, 1.0
# Variable -> case against which it is the speed-up, and what of a run; quantiles of its seconds.
WHOLE, LOOP = 0, 1
SPEED_UPS = {
    "speed_up": ("baseline", WHOLE),
    "speed_up_strongest": ("strongest", WHOLE),
    "loop_speed_up": ("baseline", LOOP),
    "loop_speed_up_strongest": ("strongest", LOOP),
}
QUANTILES = {"seconds_median": 0.5, "seconds_lower": 0.25, "seconds_upper": 0.75}


def timed_starts(experiments: Mapping[str, Mapping[str, Experiment]], path: Path) -> xr.Dataset:
    """Stored timing of initial condition -> name of a case -> experiment, as of `timed_cases`."""

    def every_start() -> xr.Dataset:
        parts = [timed_cases(cases).assign_coords(start=s) for s, cases in experiments.items()]
        return xr.concat(parts, dim="start", join="exact", combine_attrs="override")

    keys = {
        start: {case: experiment.key for case, experiment in cases.items()}
        for start, cases in experiments.items()
    }
    return stored_timing(path, [keys, CASE_ROUNDS], every_start)


def stored_timing(path: Path, content: object, make: Callable[[], xr.Dataset]) -> xr.Dataset:
    """What is stored for this content and machine, or else is made and stored at `path`."""
    text = json.dumps([content, machine(), compiler_identity(), REPEATS, REPEATS_OF_LONG, CLOCK])
    key = hashlib.sha256(text.encode()).hexdigest()[:16]
    return stored(path, "timing", key, make)


def timed_cases(experiments: Mapping[str, Experiment]) -> xr.Dataset:
    """Time experiments on the one run that all are tested on.

    The case `baseline` is the paper's kind of full-order run and `strongest` the best full-order
    solver, for every model.  Beside what `timed_tests` has there are seconds for a time point,
    speed-ups against these two, counts, rank and status; errors on `output` too.
    """
    first = next(iter(experiments.values()))
    samples, start = first.test[0].maneuver.samples, first.test[0].start
    kept = ["effective_rank", "offline_evaluations", "rms_error", "status"]
    kept += model_of(first).counts
    results = [evaluate(experiment)[kept] for experiment in experiments.values()]
    dataset = xr.concat(results, dim="case", join="exact", combine_attrs="drop_conflicts")
    dataset = dataset.drop_vars("output_unit").assign_coords(case=list(experiments))
    rounds, what = (CASE_ROUNDS, CASE_ROUNDS), f"from {start}"
    seconds, offline = _rounds(list(experiments.values()), rounds, what)
    times = _dataset(experiments, seconds, offline, f"{samples} time points")
    dataset = dataset.merge(times.isel(scenario=0, drop=True))
    columns: dict[str, object] = {
        "seconds_per_sample": dataset["seconds"].values / samples,
        "tolerance": [float(e.settings.get("tolerance", np.nan)) for e in experiments.values()],
    }
    # Round by round, so that a burst of other load on the machine hits both alike.
    own = np.where(seconds[:, :, 0] > 0.0, seconds[:, :, 0], np.nan)
    for name, (against, part) in SPEED_UPS.items():
        if against in experiments:
            baseline = own[:, [list(experiments).index(against)], part]
            columns[name] = np.median(baseline / own[:, :, part], axis=0)
    return dataset.assign(variables(columns, "case")).assign_attrs(times.attrs)


def timed_tests(
    experiments: Mapping[str, Experiment],
    finished: np.ndarray | None = None,
    what: str = "test set",
) -> xr.Dataset:
    """Time experiments on their test scenarios, which are the same for all.

    A run that has not `finished` (experiments, scenarios) is not timed: its `seconds` with
    quartiles and `loop_seconds`, on `case` and `scenario`, are missing.
    """
    rounds = PROTOCOL_ROUNDS, PROTOCOL_ROUNDS_OF_LONG
    seconds, offline = _rounds(list(experiments.values()), rounds, what, finished)
    return _dataset(experiments, seconds, offline, what)


def _dataset(
    experiments: Mapping[str, Experiment], seconds: np.ndarray, offline: list[float], what: str
) -> xr.Dataset:
    """Median and quartiles of rounds (rounds, cases, scenarios, whole call and loop)."""
    whole, loop = seconds[..., WHOLE], seconds[..., LOOP]
    with warnings.catch_warnings():
        # What was never timed has none.
        warnings.filterwarnings("ignore", "All-NaN slice")
        quantiles = {n: np.nanquantile(whole, share, axis=0) for n, share in QUANTILES.items()}
        quantiles["loop_seconds"] = np.nanmedian(loop, axis=0)
    found = variables(quantiles, "case", "scenario")
    found |= variables({"offline_seconds": offline}, "case")
    found["seconds"] = found.pop("seconds_median")
    first = next(iter(experiments.values()))
    labels = {"case": list(experiments), "scenario": [scenario.label for scenario in first.test]}
    title = f"timing of {first.model}, interleaved, {len(seconds)} rounds, {what}"
    return xr.Dataset(found, labels, attributes(title, first.kernel, model=first.model))


def _rounds(
    experiments: Sequence[Experiment],
    rounds: tuple[int, int],
    what: str,
    finished: np.ndarray | None = None,
) -> tuple[np.ndarray, list[float]]:
    """Seconds of runs (rounds, experiments, scenarios, whole call and loop), and of fits.

    `rounds` are all of them, and those of long runs, which have no seconds (NaN) in the others, as
    runs that fail have in all.  All runs of a round follow one another: load hits all alike.
    """
    model = model_of(experiments[0])
    scenarios = experiments[0].test
    tests = [(scenario.maneuver, start_of(model, scenario)) for scenario in scenarios]
    shape = (len(experiments), len(tests))
    wanted = np.ones(shape, dtype=bool) if finished is None else finished.copy()
    # Each has a name of its own, so that progress never goes back.
    work = f"rounds of times on {model.name}, {what}"
    tell(work, 0, rounds[0] + 1)
    fits = [_warm_fit(model, e, bool(w.any())) for e, w in zip(experiments, wanted, strict=True)]
    for_test = {
        (index, place): for_run(reduced, model_of_run(model, scenario))
        for index, (reduced, _) in enumerate(fits)
        for place, scenario in enumerate(scenarios)
    }
    seconds = np.full((rounds[0] + 1, *shape, 2), np.nan)
    for turn in range(rounds[0] + 1):
        for place, test in enumerate(tests):
            for index, (reduced, _) in enumerate(fits):
                # The first round loads machine code, and tells how long a run takes.
                long = turn == 0 or seconds[0, index, place, WHOLE] >= LONG_RUN
                if reduced is None or not wanted[index, place] or (long and turn > rounds[1]):
                    continue
                run = partial(for_test[index, place].simulate, *test)
                found = attempt(partial(called, run, REPEATS_OF_LONG if long else REPEATS))
                if isinstance(found, Failure):
                    wanted[index, place], seconds[:, index, place] = False, np.nan
                else:
                    seconds[turn, index, place] = found
        tell(work, turn + 1, rounds[0] + 1)
    return seconds[1:], [offline for _, offline in fits]


def called(run: Callable[[], Trajectory], repeats: int) -> tuple[float, float] | Failure:
    """Seconds of a call from outside, and of its loop by its own account; or how it has failed.

    They are medians of all calls but the first, which warms the caches.
    """

    def delivered() -> Trajectory:
        # Histories are made when they are first read.
        trajectory = run()
        assert trajectory.outputs is not None
        return trajectory

    found: list[tuple[float, float]] = []
    for _ in range(repeats):
        trajectory, seconds = timed(delivered)
        if not trajectory.finished:
            return Failure(trajectory.status, trajectory.message)
        found.append((seconds, trajectory.seconds))
    whole, loop = np.median(found[1:], axis=0)
    return float(whole), float(loop)


def _warm_fit(
    model: Model, experiment: Experiment, needed: bool
) -> tuple[FittedModel | None, float]:
    """A fitted model, and the median seconds of fits that found their machine code loaded."""
    fitted = kept_fit(model, experiment)
    if isinstance(fitted, Failure):
        return None, np.nan
    if not needed or fitted.offline.seconds > LONG_FIT:
        return fitted, fitted.offline.seconds
    seconds: list[float] = []
    while len(seconds) < FITS and sum(seconds) < FIT_SECONDS:
        fitted = fresh_fit(model, experiment)
        if isinstance(fitted, Failure):
            return None, np.nan
        seconds.append(fitted.offline.seconds)
    return fitted, float(np.median(seconds))
