"""Drawn runs on which the full order itself is sensitive: found by rule, reported apart.

Where two tolerances of the full order disagree by more than a bound, where the car spins, tips over
or has a wheel in the air, no error against one of them tells anything of a reduced model.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from vehiclemor.study.experiment import Experiment, make_experiment
from vehiclemor.study.method_settings import complete_settings
from vehiclemor.study.plans.choice import scores
from vehiclemor.study.plans.protocol import Protocol
from vehiclemor.study.scenario import Scenario

if TYPE_CHECKING:
    import xarray as xr


def second_run(protocol: Protocol, scenarios: tuple[Scenario, ...]) -> Experiment:
    """The full order at its default tolerance, a thousand times that of the references."""
    model = protocol.model
    settings = complete_settings(model, "full_order", {}, "recommended")
    return make_experiment(model, "full_order", settings, (), scenarios, "errors")


def reasons(protocol: Protocol, second: xr.Dataset) -> list[str]:
    """Why each scenario of the second run is reported apart; empty if it is not."""
    definition = protocol.definition
    found = []
    for index, score in enumerate(scores(second, definition.bounds)):
        part = second.isel(scenario=index)
        lifted = _lifted(part, protocol.model.definition.loads)
        found.append(_reason(part, float(score), definition.sensitive) or lifted)
    return found


def _lifted(part: xr.Dataset, loads: Sequence[str]) -> str:
    """Which wheels leave the ground; a dropped car has landed before."""
    least = part["smallest_output"]
    wheels = [name for name in loads if float(least.sel(output=name)) <= 0.0]
    return f"without load: {', '.join(wheels)}" if wheels else ""


def _reason(part: xr.Dataset, score: float, largest: dict[str, float]) -> str:
    if not np.isfinite(score):
        return f"full order: {part['message'].item()}"
    if score > 1.0:
        return f"two tolerances of the full order differ by {score:.2g} times a bound"
    for output, limit in largest.items():
        value = float(part["largest_output"].sel(output=output))
        if value > limit:
            return f"{output} of the full order reaches {value:.3g}, beyond {limit:g}"
    return ""
