"""Fallback: the full order repeats the runs of a reduced vehicle that are not to be trusted.

It repeats them from the beginning: the reduced model has mostly gone wrong before its trust
indicator passes 1, and errors at a restart near the edge grow.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vehiclemor.arguments import require
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.quantities import ErrorBound
from vehiclemor.reduction.error_estimate import judged
from vehiclemor.reduction.interface import MEMBERS, FittedModel, simulated
from vehiclemor.reduction.reduced_system import ReducedSystem
from vehiclemor.reduction.settings import FallbackSettings
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.trajectory import WITHOUT_COMPLAINT, Start, Trajectory, Trust

# What is that of the reduced model: users step and ask this one.
REDUCED = (
    *("offline", "order", "best_approximation"),
    *("states", "begin", "step", "rates", "sensitivities", "decode", "trust"),
)


@dataclass(frozen=True, eq=False)
class FallbackModel(ShortRepr):
    """A reduced model and the full order; it is stepped as the reduced one."""

    reduced: FittedModel
    full: ReducedSystem

    def check_sizes(self) -> None:
        """Raise `ValueError` if the first is no reduced model."""
        for name in MEMBERS:
            require(hasattr(self.reduced, name), name)

    def __getattr__(self, name: str) -> Any:
        if name not in REDUCED:
            raise AttributeError(f"a model with fallback has no {name}")
        return getattr(self.reduced, name)

    def simulate(
        self,
        maneuver: Excitation,
        start: Start,
        outputs: tuple[str, ...] | None = None,
        bounds: Mapping[str, ErrorBound] | None = None,
    ) -> Trajectory:
        """The reduced run; where it can't be trusted, that of the full order.

        It is judged by its estimated error in bounds, those of the model by default.
        """
        run = self.reduced.simulate(maneuver, start)
        run = judged(run, self.reduced.simulate, (maneuver, start), bounds)
        if outputs is not None:
            run = run.chosen(outputs)
        if run.status in WITHOUT_COMPLAINT and run.trust and np.isinf(run.trust.until):
            return run
        # A model without a trust indicator is trusted nowhere.
        reason = run.message or "the reduced model does not judge itself"
        trust = run.trust or Trust(np.inf, 0.0, reason)
        full = self.full.simulate(maneuver, start, outputs)
        remarks = f"full_order did the run: {trust.message or run.message}", full.remark
        return replace(
            full,
            counts={name: count + full.counts[name] for name, count in run.counts.items()},
            seconds=run.seconds + full.seconds,
            remark="; ".join(filter(None, remarks)),
            trust=trust,
        )


def with_fallback(reduced: FittedModel, model: Any, settings: Any) -> Any:
    """A reduced model with the fallback that its settings name, if they name one."""
    if not isinstance(settings, FallbackSettings) or settings.fallback == "none":
        return reduced
    full_order = component("method", "full_order")
    chosen = full_order.settings[model.kind](
        solver=settings.fallback, tolerance=settings.fallback_tolerance
    )
    return FallbackModel(reduced, full_order.fit(model, (), chosen))


def run_of(
    reduced: Any,
    given: tuple[Excitation, Start],
    outputs: tuple[str, ...] | None,
    bounds: Mapping[str, ErrorBound] | None,
    estimate: bool,
) -> Trajectory:
    """A run of a reduced model with some outputs alone; whether its error is estimated."""
    if isinstance(reduced, FallbackModel):
        if estimate:
            return reduced.simulate(*given, outputs, bounds)
        reduced = reduced.reduced
    if not estimate:
        return simulated(reduced, *given, outputs)
    run = judged(reduced.simulate(*given), reduced.simulate, given, bounds)
    return run if outputs is None else run.chosen(outputs)
