"""Running a protocol: fit, validate, choose; only then test.

The stages are functions of what they may see: `validate` gets no scenario of the test set.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.errors import FileError
from vehiclemor.study.choice import Row, choose, validation_of
from vehiclemor.study.executor import Executor, Progress, results_folder
from vehiclemor.study.predictive_results import combined
from vehiclemor.study.predictive_timing import timing
from vehiclemor.study.protocol import FULL_ORDER, Contestant, load_protocol
from vehiclemor.study.protocol_file import ProtocolFile
from vehiclemor.study.scenarios import Scenario
from vehiclemor.study.store import prepare_folder, write_dataset
from vehiclemor.study.trials import make_trial

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.simulation.model import Model


def run_protocols(
    protocols: Sequence[str], folder: Path, jobs: int = 1, progress: Progress | None = None
) -> dict[str, xr.Dataset]:
    """Run protocols; what an earlier run has finished is not computed again.

    Returns
    -------
    dict
        `predictive-<protocol>` -> combined dataset on the dimensions `row`, `scenario` and
        `output`, stored as `studies/predictive-<protocol>.nc` too.
    """
    loaded = [load_protocol(protocol) for protocol in protocols]
    prepare_folder(folder)
    try:
        results_folder(folder).mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(f"{results_folder(folder)}: not a folder ({error.strerror})") from None
    results: dict[str, xr.Dataset] = {}
    for protocol in loaded:
        model, definition, name = protocol.model, protocol.definition, f"predictive-{protocol.name}"
        execute = Executor(name, folder, jobs, progress)
        rows = validate(
            model, definition, protocol.contestants, protocol.sets["validation"], execute
        )
        tested = {key: protocol.sets[key] for key in ("test", "outside") if protocol.sets[key]}
        found = test(model, rows, tested, execute)
        timed = timing(protocol, rows, found, folder)
        results[name] = combined(protocol, rows, found, timed)
        write_dataset(results[name], folder / "studies" / f"{name}.nc")
    return results


def validate(
    model: Model,
    definition: ProtocolFile,
    contestants: Sequence[Contestant],
    validation: tuple[Scenario, ...],
    execute: Executor,
) -> list[Row]:
    """Fit every candidate on its training, simulate the validation set, choose.

    Of a full-order contestant every candidate becomes a row.
    """
    trials = [
        [make_trial(model, c, i, "validation", validation) for i in range(len(c.candidates))]
        for c in contestants
    ]
    execute([[trial] for candidates in trials for trial in candidates])
    rows: list[Row] = []
    for contestant, candidates in zip(contestants, trials, strict=True):
        results = tuple(
            validation_of(execute.result(trial), definition.bounds, model.evaluations)
            for trial in candidates
        )
        every = contestant.role == FULL_ORDER
        chosen = range(len(candidates)) if every else [choose(results)]
        rows += [Row(contestant, candidate, results) for candidate in chosen]
    return rows


def test(
    model: Model,
    rows: Sequence[Row],
    sets: dict[str, tuple[Scenario, ...]],
    execute: Executor,
) -> dict[str, list[xr.Dataset]]:
    """Results of the chosen candidates: set -> one dataset for each row."""
    trials = [
        [make_trial(model, row.contestant, row.candidate, *pair) for pair in sets.items()]
        for row in rows
    ]
    execute(trials)
    return {
        purpose: [execute.result(group[index]) for group in trials]
        for index, purpose in enumerate(sets)
    }
