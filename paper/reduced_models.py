"""Makes the reduced models that ship with the package: of each protocol the one that it has chosen.

Usage: python paper/reduced_models.py [--check | --refit] [--results FOLDER] [MODEL ...]

Protocols are run first where their results are missing.  What is chosen is fitted on the protocol's
training runs and written to data/reduced/MODEL.nc, unless a file made by the same source of the
same choice is there.  With --check nothing is run or written: what each file says that it was made
of is fitted anew and compared with it; the exit status is 1 if one differs.  With --refit that is
written: no protocol is run, and tests need not fit anew what this source has fitted.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vehiclemor import VehiclemorError, errors
from vehiclemor.api import RESULTS, reduce, run_study
from vehiclemor.exceptions import FileError
from vehiclemor.files import data_folder, make_folder
from vehiclemor.provenance import code_digest
from vehiclemor.reduction.model_file import content
from vehiclemor.reduction.reduced_model import ReducedOrderModel, load, shipped_folder
from vehiclemor.simulation.trajectory import Trajectory
from vehiclemor.study.experiment import Settings
from vehiclemor.study.plans.choice import errors_by
from vehiclemor.study.plans.protocol import Protocol, load_protocol, protocol_names
from vehiclemor.study.scenario import Scenario, parameters_of, start_of

COMMAND = "python paper/reduced_models.py"
# Largest difference of two fits, in bounds.  Fits amplify rounding, which differs between
# processors and libraries of linear algebra: 0.25 is the most that was seen.
SAME = 0.5
# Validation runs by which fits are compared.
COMPARED = 3


class Choice(NamedTuple):
    """What a protocol has chosen, and what that learns from."""

    protocol: Protocol
    method: str
    settings: Settings
    training: tuple[Scenario, ...]


def chosen(name: str, results: Path) -> Choice:
    """What validation has chosen in a model's protocol."""
    protocol = load_protocol(protocol_names()[name])
    dataset = run_study(protocol_names()[name], results=results)
    row = dataset.isel(label=int(dataset["winner"].values.argmax()))
    training = next(c.training for c in protocol.entries if c.label == row["label"].item())
    method, settings = str(row["method"].item()), json.loads(str(row["settings"].item()))
    return Choice(protocol, method, settings, training)


def shipped(name: str) -> Choice:
    """What the file of a model says that it was made of."""
    rom, protocol = load(path_of(name)), load_protocol(protocol_names()[name])
    settings, method = dict(rom.settings), rom.method
    training = next(c.training for c in protocol.entries if c.method == method)
    return Choice(protocol, method, settings, training)


def fitted(choice: Choice) -> ReducedOrderModel:
    """The chosen model, fitted."""
    settings: dict[str, Any] = choice.settings
    return reduce(choice.protocol.model, choice.method, training=choice.training, **settings)


def fitted_once(path: Path, fit: Callable[[], ReducedOrderModel]) -> ReducedOrderModel:
    """The model in a file, which is fitted and written where it can't be loaded."""
    try:
        return load(path)
    except FileError as error:
        print(f"{error}: fitted anew", flush=True)
    make_folder(path.parent)
    return load(fit().save(path, overwrite=True))


def path_of(name: str) -> Path:
    """File of the model that ships."""
    return shipped_folder() / f"{name}.nc"


def stale(name: str, choice: Choice) -> list[str]:
    """In what a file is not that of the choice and of this source; `source` alone may be harmless.

    Only `file` if there is none that can be loaded.
    """
    try:
        load(path_of(name))
        written, attributes = content(path_of(name))
    except FileError:
        return ["file"]
    training = [scenario.content for scenario in choice.training]
    here = {
        "method": (attributes["method"], choice.method),
        "settings": (json.loads(written["settings"]), choice.settings),
        "training": (json.loads(written["training"]), json.loads(json.dumps(training))),
        "parameters": (json.loads(written["parameters"]), parameters_of(choice.protocol.model)),
        "source": (attributes["code"], code_digest(name, choice.method)),
    }
    return [what for what, (then, now) in here.items() if then != now]


def in_bounds(protocol: Protocol, run: Trajectory, other: Trajectory) -> float:
    """Largest difference of two runs in the measures of a protocol, in its bounds."""
    apart, bounds = errors(run, other), protocol.definition.bounds.items()
    return max(float(errors_by(apart, output, b.measure)) / b.bound for output, b in bounds)


def difference(choice: Choice, one: ReducedOrderModel, other: ReducedOrderModel) -> float:
    """Largest difference of two models in validation runs, in bounds."""
    largest = 0.0
    for scenario in choice.protocol.sets["validation"][:COMPARED]:
        start = start_of(choice.protocol.model, scenario)
        runs = (rom.simulate(scenario.maneuver, start) for rom in (one, other))
        largest = max(largest, in_bounds(choice.protocol, *runs))
    return largest


def main() -> int:
    """Write or check the files; exit status."""
    parser = argparse.ArgumentParser(description="Make the reduced models that ship.")
    parser.add_argument("--check", action="store_true", help="compare with a fit, write nothing")
    parser.add_argument("--refit", action="store_true", help="keep the choice that files tell")
    parser.add_argument("--results", type=Path, default=RESULTS, help="results folder")
    parser.add_argument("models", nargs="*", default=[*protocol_names()], metavar="MODEL")
    given = parser.parse_args()
    if not given.check and data_folder() != Path(__file__).resolve().parents[1] / "data":
        raise VehiclemorError("the package does not run from a checkout: pip install -e . there")
    status = 0
    for name in given.models:
        choice = shipped(name) if given.check or given.refit else chosen(name, given.results)
        path = path_of(name)
        reasons = stale(name, choice)
        if not reasons and not given.check:
            print(f"{name}: {path} is up to date")
            continue
        began = time.process_time()
        made = fitted(choice)
        told = f"{choice.method}, {len(choice.training)} runs, {time.process_time() - began:.0f} s"
        if given.check:
            off = np.inf if "file" in reasons else difference(choice, load(path), made)
            status |= not off <= SAME
            print(f"{name}: {told}; differs from {path} by {off:.1e} bounds")
            continue
        make_folder(path.parent)
        made.save(path, overwrite=True)
        size, why = path.stat().st_size / 1e3, ", ".join(reasons)
        print(f"{name}: {told}; written {path}, {size:.0f} kB (new {why})")
    return status


if __name__ == "__main__":
    try:
        sys.exit(main())
    except VehiclemorError as error:
        sys.exit(f"{error}")
