"""Trials: a candidate with its training scenarios, and one set that it is simulated on."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from vehiclemor.simulation.model import Model
from vehiclemor.study.protocol import Contestant, Settings
from vehiclemor.study.provenance import code_digest
from vehiclemor.study.scenarios import Scenario, identity

# Sources beside those of a cell that determine a trial's result.
FILES = ("study/trials.py", "study/trial_execution.py", "study/scenarios.py")


@dataclass(frozen=True)
class Trial:
    """What one result file holds, and all that determines it; other sets play no part.

    Attributes
    ----------
    kernel, code
        Hash of the compiled kernels, and of the source of everything that computes results.
    scenarios
        Those of the set: `validation`, `test` or `outside`.
    """

    model: str
    kernel: str
    code: str
    parameters: dict[str, Any]
    method: str
    settings: Settings
    training: tuple[Scenario, ...]
    purpose: str
    scenarios: tuple[Scenario, ...]

    @cached_property
    def configuration(self) -> str:
        """Canonical JSON text of the trial."""
        content = vars(self) | {
            "training": [identity(scenario) for scenario in self.training],
            "scenarios": [identity(scenario) for scenario in self.scenarios],
        }
        return json.dumps(content, sort_keys=True)

    @cached_property
    def key(self) -> str:
        """Hash of the configuration: the name of the trial's file."""
        return hashlib.sha256(self.configuration.encode()).hexdigest()[:20]


def make_trial(
    model: Model,
    contestant: Contestant,
    candidate: int,
    purpose: str,
    scenarios: tuple[Scenario, ...],
) -> Trial:
    """A trial of one candidate with the present kernels, parameters and source."""
    return Trial(
        model.name,
        model.kernel_hash,
        code_digest(model.name, contestant.method, FILES),
        {name: entry.value for name, entry in model.parameters.entries.items()},
        contestant.method,
        contestant.candidates[candidate],
        contestant.training,
        purpose,
        scenarios,
    )
