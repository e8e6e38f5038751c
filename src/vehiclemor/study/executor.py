"""Computing what is missing of some trials, in one process or several, and storing it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.study.store import read_dataset, write_dataset
from vehiclemor.study.trial_execution import compute
from vehiclemor.study.trials import Trial

if TYPE_CHECKING:
    import xarray as xr

Progress = Callable[[str, int, int], None]


@dataclass
class Executor:
    """Computes what is missing of some trials and stores it."""

    name: str
    folder: Path
    jobs: int = 1
    progress: Progress | None = None
    done: int = 0
    total: int = 0

    def __call__(self, groups: Sequence[Sequence[Trial]]) -> None:
        """Compute missing trials; those of a group are of one candidate, which is fitted once."""
        self.total += sum(len(group) for group in groups)
        missing = {t.key: t for group in groups for t in group if not self.path(t).exists()}
        work: list[list[Trial]] = []
        for group in groups:
            # Two candidates may be the same trial: `pop` leaves it to the first.
            part = [found for trial in group if (found := missing.pop(trial.key, None))]
            work += [part] if part else []
        self.done = self.total - sum(len(part) for part in work)
        self._report(0)
        for count in self._executed(work):
            self._report(count)

    def _report(self, count: int) -> None:
        self.done += count
        if self.progress:
            self.progress(self.name, self.done, self.total)

    def _executed(self, work: list[list[Trial]]) -> Iterator[int]:
        folder = results_folder(self.folder)
        if self.jobs == 1 or len(work) < 2 * self.jobs:
            for group in work:
                yield compute_and_store(group, folder)
            return
        from joblib import Parallel, delayed

        # One candidate of each method first, so that its loops are compiled once.
        first = {group[0].method: group for group in reversed(work)}.values()
        for group in first:
            yield compute_and_store(group, folder)
        rest = [group for group in work if all(group is not other for other in first)]
        pool = Parallel(n_jobs=self.jobs, return_as="generator_unordered")
        for count in pool(delayed(compute_and_store)(group, folder) for group in rest):
            yield count or 0

    def path(self, trial: Trial) -> Path:
        """File of a trial."""
        return results_folder(self.folder) / f"{trial.key}.nc"

    def result(self, trial: Trial) -> xr.Dataset:
        """Stored result of a trial."""
        return read_dataset(self.path(trial), "trial", trial.key)


def compute_and_store(trials: Sequence[Trial], folder: Path) -> int:
    """Compute the trials of one candidate, move their files into place, and count them."""
    for trial, dataset in zip(trials, compute(trials), strict=True):
        write_dataset(dataset, folder / f"{trial.key}.nc")
    return len(trials)


def results_folder(folder: Path) -> Path:
    """Folder of the trials' files."""
    return folder / "predictive"
