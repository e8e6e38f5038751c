"""Sobol indices: how much of an objective's spread over a box of parameters is whose."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.arguments import count, quoted, real_array
from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.batch_arguments import model_behind
from vehiclemor.online.batches import simulate_many
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.registry import component
from vehiclemor.simulation.maneuver_checks import checked_maneuver
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start
from vehiclemor.study.objectives import Objective, objective
from vehiclemor.study.provenance import attributes

if TYPE_CHECKING:
    import xarray as xr

# Resamples of the bootstrap, and the share of them in an interval.
RESAMPLES, CONFIDENCE = 400, 0.95
NAMES = {"first_order": "of the parameter alone", "total_order": "of it with all others"}


def sobol_indices(
    model: str | Model | ReducedOrderModel,
    objectives: str | Sequence[str],
    box: Mapping[str, Sequence[float]],
    *,
    maneuver: str | Maneuver | None = None,
    start: Start | None = None,
    samples: int = 512,
    seed: int = 0,
    jobs: int | None = None,
) -> xr.Dataset:
    """First and total Sobol indices of objectives over a box of parameters.

    By `scipy.stats.sobol_indices` (A. Saltelli et al., Comput. Phys. Commun. 181 (2010), 259-270),
    of samples (parameters + 2) runs in threads, with intervals by bootstrap.

    Parameters
    ----------
    model
        Full model, its name, or a reduced model whose method learns from no run.
    objectives
        Names of objectives, see `objectives()`.
    box
        Parameter (of a component `joint.z`) -> both ends of its range in SI units, in which it is
        uniformly distributed.
    maneuver, start
        Of all runs; the model's own, and its first.
    samples
        A power of two.
    seed
        Of the samples and of the bootstrap.
    jobs
        Number of threads; by default as many as there are cores.

    Returns
    -------
    xarray.Dataset
        `first_order` and `total_order` (objective, parameter) with the ends `_low` and `_high` of
        their 95 % intervals, NaN of an objective that is the same in all runs, `mean` and
        `standard_deviation` (objective,) of the objectives, and the CPU seconds of all in the
        attributes; `untrusted` counts the runs that the reduced model doesn't trust, and `remark`
        says why the first of them isn't.

    Raises
    ------
    InputError
        If an argument is wrong, or a car of the box has no value of an objective.
    """
    from scipy.stats import DegenerateDataWarning, uniform
    from scipy.stats import sobol_indices as indices_of

    reduced = model_behind(model)
    chosen = [objective(objectives)] if isinstance(objectives, str) else _all(objectives)
    names, ranges = list(box), _ranges(box)
    if len(names) == 1:
        raise InputError(f"box has {names[0]} alone: all of the spread is its doing")
    if count("samples", samples) & (samples - 1):
        raise InputError(f"samples is {samples}, not a power of two")
    runs = _Runs(reduced, chosen, names, maneuver, start, jobs)
    spread = [uniform(low, high - low) for low, high in ranges]
    began, rng = time.process_time(), np.random.default_rng(seed)
    # Parts of no variance, and intervals about what is zero in every sample, are none.
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateDataWarning)
        found = indices_of(func=runs, n=samples, dists=spread, rng=rng)
        seconds = time.process_time() - began
        sure = found.bootstrap(CONFIDENCE, n_resamples=RESAMPLES)
    return _dataset(runs, (found, sure), ranges, {"samples": samples, "seed": seed}, seconds)


class _Runs:
    """The objectives as a function of the parameters."""

    def __init__(
        self,
        reduced: ReducedOrderModel,
        objectives: Sequence[Objective],
        names: Sequence[str],
        maneuver: str | Maneuver | None,
        start: Start | None,
        jobs: int | None,
    ) -> None:
        definition = reduced.model.definition
        chosen = definition.maneuver if maneuver is None else maneuver
        chosen = component("maneuver", chosen) if isinstance(chosen, str) else chosen
        self.reduced, self.objectives, self.names = reduced, objectives, names
        self.maneuver, self.start, self.jobs = checked_maneuver(chosen, definition), start, jobs
        self.values: list[np.ndarray] = []
        self.untrusted: list[str] = []
        known = {*reduced.output_names, *reduced.inputs}
        for own in objectives:
            if missing := [name for name in own.histories if name not in known]:
                raise InputError(f"{own.name} needs {missing[0]}: {definition.name} has none")

    def __call__(self, places: np.ndarray) -> np.ndarray:
        """Values (objectives, runs) at parameters (parameters, runs)."""
        import xarray as xr

        wanted = dict.fromkeys(name for own in self.objectives for name in own.histories)
        found = simulate_many(
            self.reduced,
            [self.maneuver] * places.shape[1],
            self.start,
            dict(zip(self.names, places, strict=True)),
            outputs=[name for name in wanted if name in self.reduced.output_names],
            jobs=self.jobs,
        )
        given = self.maneuver.at(found["time"].values)
        found["inputs"] = xr.DataArray(
            given, {"input": list(self.reduced.inputs)}, ("time", "input")
        )
        values = np.array([own(found).values for own in self.objectives])
        if len(bad := np.flatnonzero(~np.isfinite(values).all(axis=0))):
            told = found.isel(run=int(bad[0]))
            reason = str(told["message"].item()) or "an objective has no value"
            raise InputError(f"{len(bad)} of {places.shape[1]} cars in the box fail: {reason}")
        untrusted = found["status"].values == "untrusted"
        self.untrusted += found["message"].values[untrusted].tolist()
        # They are centred in place by who asked.
        self.values.append(values.copy())
        return values


def _all(objectives: Any) -> list[Objective]:
    if not isinstance(objectives, Sequence) or not objectives:
        raise InputError(f"objectives is {quoted(objectives)}, no list of names")
    return [objective(name) for name in objectives]


def _ranges(box: Any) -> np.ndarray:
    """Both ends (parameters, 2) of the ranges of a box."""
    if not isinstance(box, Mapping) or not box:
        raise InputError(f"box is {quoted(box)}, no ranges by the names of parameters")
    ranges = []
    for name, ends in box.items():
        try:
            own = real_array(ends)
        except (TypeError, ValueError):
            own = np.empty(0)
        if own.shape != (2,) or not own[0] < own[1] or not np.isfinite(own).all():
            raise InputError(f"box: {name} is {quoted(ends)}, not the two ends of a range")
        ranges.append(own)
    return np.array(ranges)


def _dataset(
    runs: _Runs, found: tuple[Any, Any], ranges: np.ndarray, how: dict[str, int], seconds: float
) -> xr.Dataset:
    """Labelled dataset of indices and their bootstrap."""
    import xarray as xr

    indices, sure = found
    shape = len(runs.objectives), len(runs.names)
    both, model = ("objective", "parameter"), runs.reduced.model
    variables: dict[str, tuple] = {}
    # Of what is the same in all runs, but for rounding of their mean, there are no parts.
    varies = np.ptp(np.concatenate(runs.values, axis=1), axis=1, keepdims=True) > 0.0
    for name, text in NAMES.items():
        interval = getattr(sure, name).confidence_interval
        about = {"units": "1", "long_name": f"part of the variance {text}"}
        index = np.where(varies, np.reshape(getattr(indices, name), shape), np.nan)
        variables[name] = both, index, about
        for end in ("low", "high"):
            values = np.where(varies, np.reshape(getattr(interval, end), shape), np.nan)
            # What has no effect has none in any resample.
            variables[f"{name}_{end}"] = both, np.where(index == 0.0, 0.0, values), about
    # The first two calls are of independent samples.
    values = np.concatenate(runs.values[:2], axis=1)
    for name, own in (("mean", values.mean(axis=1)), ("standard_deviation", values.std(axis=1))):
        variables[name] = "objective", own, {"long_name": name.replace("_", " ")}
    coordinates = {
        "objective": [own.name for own in runs.objectives],
        "objective_unit": ("objective", [own.unit for own in runs.objectives]),
        "parameter": list(runs.names),
        "low": ("parameter", ranges[:, 0]),
        "high": ("parameter", ranges[:, 1]),
    }
    count = sum(part.shape[1] for part in runs.values)
    about = {"runs": count, "seconds": seconds, "method": runs.reduced.method} | how
    about |= {"untrusted": len(runs.untrusted), "remark": next(iter(runs.untrusted), "")}
    title = f"Sobol indices of {model.name}, {runs.reduced.method}"
    made = attributes(title, model.kernel_hash, model=model.name, maneuver=runs.maneuver.name)
    return xr.Dataset(variables, coordinates, made | about)
