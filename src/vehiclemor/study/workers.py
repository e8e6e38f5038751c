"""Evaluating what is missing of some experiments, in one process or several, and storing it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.study.evaluate import evaluate
from vehiclemor.study.experiment import Experiment
from vehiclemor.study.progress import tell
from vehiclemor.study.store import cell_path, read_dataset, write_dataset

if TYPE_CHECKING:
    import xarray as xr


@dataclass
class Workers:
    """Evaluates what is missing of some experiments, in so many jobs, and stores it."""

    name: str
    folder: Path
    jobs: int = 1
    done: int = 0
    total: int = 0

    def __call__(self, groups: Sequence[Sequence[Experiment]]) -> None:
        """Evaluate what is missing; a group stays in one process, where its fit is made once."""
        self.total += sum(len(group) for group in groups)
        missing = {e.key: e for group in groups for e in group if not self._path(e).exists()}
        work: list[list[Experiment]] = []
        for group in groups:
            # Two candidates may be the same experiment: `pop` leaves it to the first.
            part = [found for e in group if (found := missing.pop(e.key, None))]
            work += [part] if part else []
        self.done = self.total - sum(len(part) for part in work)
        self._report(0)
        for count in self._evaluated(work):
            self._report(count)

    def result(self, experiment: Experiment) -> xr.Dataset:
        """Stored result of an experiment."""
        return read_dataset(self._path(experiment), "cell", experiment.key)

    def _path(self, experiment: Experiment) -> Path:
        return cell_path(self.folder, experiment.key)

    def _report(self, count: int) -> None:
        self.done += count
        tell(self.name, self.done, self.total)

    def _evaluated(self, work: list[list[Experiment]]) -> Iterator[int]:
        # Starting processes costs seconds: a handful of groups is quicker without.
        if self.jobs == 1 or len(work) < 2 * self.jobs:
            for group in work:
                yield evaluate_and_store(group, self.folder)
            return
        from joblib import Parallel, delayed

        # One group of each method first, so that its loops are compiled once.
        first = {group[0].method: group for group in reversed(work)}.values()
        for group in first:
            yield evaluate_and_store(group, self.folder)
        rest = [group for group in work if all(group is not other for other in first)]
        pool = Parallel(n_jobs=self.jobs, return_as="generator_unordered")
        for count in pool(delayed(evaluate_and_store)(group, self.folder) for group in rest):
            yield count or 0


def evaluate_and_store(experiments: Sequence[Experiment], folder: Path) -> int:
    """Evaluate some experiments, move each complete file into place, and count them."""
    for experiment in experiments:
        write_dataset(evaluate(experiment), cell_path(folder, experiment.key))
    return len(experiments)
