"""Makes the reduced models that ship with the package: of each protocol the one that it has chosen.

Usage: python paper/reduced_models.py [--check] [MODEL ...]

What was chosen stands in the ledger of the protocol's draws.  It is fitted on the protocol's
training runs and written to data/reduced/MODEL.nc, unless a file made by the same source of the
same choice is there.  With --check nothing is written, every model is fitted anew and compared
with its file; the exit status is 1 if one differs.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vehiclemor import VehiclemorError
from vehiclemor.errors import FileError
from vehiclemor.files import make_folder
from vehiclemor.online.model_file import content
from vehiclemor.online.rom import ReducedOrderModel, reduce
from vehiclemor.online.saved import load, shipped_folder
from vehiclemor.registry import component
from vehiclemor.resources import checkout_data, data_folder, data_names
from vehiclemor.study.method_settings import Settings, complete_settings
from vehiclemor.study.plans.ledger import Ledger
from vehiclemor.study.plans.protocol import Protocol, load_protocol
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.scenario import Scenario, parameters_of, start_of

COMMAND = "python paper/reduced_models.py"
# Largest difference of an output of two fits, as part of its range: rounding differs by machine.
SAME = 1e-6
# Validation runs by which fits are compared.
COMPARED = 3


class Choice(NamedTuple):
    """What a protocol has chosen, and what that learns from."""

    protocol: Protocol
    method: str
    settings: Settings
    training: tuple[Scenario, ...]


def chosen(name: str) -> Choice:
    """The winner of the last draw in the ledger of a model's protocol."""
    protocol = load_protocol(name)
    drawn = [draw for draw in Ledger(name, data_folder(), own=True).entries() if draw.rows]
    if not drawn:
        raise VehiclemorError(f"protocol {name!r} has no draw: vehiclemor run predictive")
    label, row = next((label, row) for label, row in drawn[-1].rows.items() if row.winner)
    training = next(c.training for c in protocol.contestants if c.label == label)
    # What was a setting when it was drawn, and is none any more, has that value for good.
    known = component("method", row.method).names_of(protocol.model.kind)
    given = {name: value for name, value in row.settings.items() if name in known}
    settings = complete_settings(protocol.model, row.method, given)
    return Choice(protocol, row.method, settings, training)


def fitted(choice: Choice) -> ReducedOrderModel:
    """The chosen model, fitted."""
    settings: dict[str, Any] = choice.settings
    return reduce(choice.protocol.model, choice.method, training=choice.training, **settings)


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


def difference(choice: Choice, one: ReducedOrderModel, other: ReducedOrderModel) -> float:
    """Largest difference of an output in validation runs, as part of its range."""
    largest = 0.0
    for scenario in choice.protocol.sets["validation"][:COMPARED]:
        start = start_of(choice.protocol.model, scenario)
        a, b = (rom.simulate(scenario.maneuver, start).outputs for rom in (one, other))
        largest = max(largest, float(np.max(np.abs(a - b) / np.ptp(a, axis=0).clip(1e-6))))
    return largest


def main() -> int:
    """Write or check the files; exit status."""
    parser = argparse.ArgumentParser(description="Make the reduced models that ship.")
    parser.add_argument("--check", action="store_true", help="compare with a fit, write nothing")
    parser.add_argument("models", nargs="*", default=data_names("protocols"), metavar="MODEL")
    given = parser.parse_args()
    if not given.check and checkout_data() is None:
        raise VehiclemorError("the package does not run from a checkout: pip install -e . there")
    status = 0
    for name in given.models:
        choice, path = chosen(name), path_of(name)
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
            print(f"{name}: {told}; outputs differ from {path} by {off:.1e} of their ranges")
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
