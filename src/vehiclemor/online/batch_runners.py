"""How a batch of runs is done: by one compiled loop where there is one, else one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.online.batch_result import Found, Selection
from vehiclemor.online.batch_runs import BatchRuns
from vehiclemor.online.batch_signals import Signals
from vehiclemor.online.rom import ReducedOrderModel
from vehiclemor.reduction.methods.full_order import FullOrderModel
from vehiclemor.reduction.methods.guarded import GuardedModel, handed_over
from vehiclemor.reduction.vehicle.reduced_vehicle import ReducedVehicle
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start
from vehiclemor.study.failure import Failure, attempt


class Runner(Protocol):
    """Does some runs."""

    def found(self, signals: Sequence[Maneuver], starts: Sequence[Start]) -> Found:
        """Results of the runs in their order."""
        ...


def runner_of(reduced: ReducedOrderModel, chosen: Selection) -> Runner:
    """What does batches of runs of a model quickest."""
    fitted = reduced.reduced
    if reduced.outside or (isinstance(fitted, GuardedModel) and fitted.car and fitted.car.reason):
        # Of all runs there is more to tell than a loop knows.
        return SingleRuns(reduced, chosen)
    if _in_one_loop(fitted):
        return BatchRuns(fitted, chosen)  # type: ignore[arg-type]
    if isinstance(fitted, GuardedModel) and np.isinf(fitted.back):
        both = _in_one_loop(fitted.ahead) and _in_one_loop(fitted.safe)
        return GuardedRuns(fitted, chosen) if both else SingleRuns(reduced, chosen)
    return SingleRuns(reduced, chosen)


def _in_one_loop(fitted: Any) -> bool:
    """Whether one compiled loop does all runs; a reduced vehicle must judge itself."""
    if isinstance(fitted, FullOrderModel):
        return isinstance(fitted.model, DynamicModel)
    if not isinstance(fitted, ReducedVehicle):
        return False
    return bool(fitted.lift.features.watched)


class GuardedRuns:
    """Runs of a fast model, and of the safe one where that does not trust itself."""

    def __init__(self, fitted: GuardedModel, chosen: Selection) -> None:
        self.safe_name = fitted.safe_name
        self.ahead = BatchRuns(fitted.ahead, chosen)  # type: ignore[arg-type]
        self.safe = BatchRuns(fitted.safe, chosen)

    def found(self, signals: Sequence[Maneuver], starts: Sequence[Start]) -> Found:
        """Results of the runs in their order."""
        fast = self.ahead.found(signals, starts)
        left = np.flatnonzero((fast.status == "untrusted") | (fast.status == "diverged")).tolist()
        if not left:
            return fast
        safe = self.safe.found([signals[run] for run in left], [starts[run] for run in left])
        for k, run in enumerate(left):
            why = fast.reason[run] or fast.message[run]
            told = handed_over(0.0, self.safe_name, why)
            safe.remark[k] = "; ".join(part for part in (told, safe.remark[k]) if part)
        fast.write(
            left,
            safe._replace(
                indicator=fast.indicator[left],
                until=fast.until[left],
                reason=fast.reason[left],
                counts=fast.counts[left] + safe.counts,
                seconds=fast.seconds[left] + safe.seconds,
            ),
        )
        return fast


class SingleRuns:
    """Runs one by one, of any method."""

    def __init__(self, reduced: ReducedOrderModel, chosen: Selection) -> None:
        self.reduced, self.chosen = reduced, chosen

    def check(self, signals: Sequence[Maneuver]) -> None:
        """Raise `InputError` if times are chosen that aren't the signals' own."""
        distinct = [signals.first] if isinstance(signals, Signals) else signals
        if self.chosen.times is None or all(self.chosen.samples(s)[0] is None for s in distinct):
            return
        raise InputError(f"times: {self.reduced.method} gives only the signals' own")

    def found(self, signals: Sequence[Maneuver], starts: Sequence[Start]) -> Found:
        """Results of the runs in their order."""
        if isinstance(signals, Signals):
            signals = signals.apart()
        _, rows = self.chosen.samples(signals[0])
        columns, counts = self.chosen.columns, self.reduced.model.counts
        found = Found.empty(len(signals), (len(rows), len(columns)), len(counts))
        for run, (signal, start) in enumerate(zip(signals, starts, strict=True)):
            _, rows = self.chosen.samples(signal)
            done = attempt(lambda: self.reduced.simulate(signal, start))  # noqa: B023
            if isinstance(done, Failure):
                found.refuse({run: done.message}, done.status)
            else:
                found.write_trajectory(run, done, rows, columns)
        return found
