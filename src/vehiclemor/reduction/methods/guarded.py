"""Fallback to the full order.

A fast model runs.  Where it extrapolates, the full order does the whole run: the fast one has
mostly gone wrong before its trust indicator passes 1.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.interface import FitOther, FittedModel, Method, OfflineCost, simulated
from vehiclemor.reduction.settings import OnlineSettings, Settings, Solver, Tolerance, inline_table
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.validation import checked_fit, checked_settings, fitted, validated
from vehiclemor.reduction.vehicle.shape import no_steered_vehicle
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust

NAME, SAFE = "guarded", "full_order"
# What of the fast model a user steps and asks.
STEPPED = ("states", "begin", "step", "rates", "sensitivities", "decode", "trust")


class GuardedSettings(OnlineSettings):
    """Settings for a vehicle; solver and tolerance are the fast model's."""

    fast: str = Field("slow_manifold", description="method of the fast model")
    fast_settings: str = Field(
        "", description="its other settings, as in TOML: terms = 12, ridge = 1e-9"
    )
    safe_solver: Solver = "etdrk4"
    safe_tolerance: Tolerance = 1e-4
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 2e-3


@dataclass(frozen=True, eq=False)
class FallbackModel(ShortRepr):
    """Both models; it is stepped as the fast one, whose trust indicator is to be watched."""

    fast: FittedModel
    safe: FittedModel
    offline: OfflineCost

    def check_sizes(self) -> None:
        """Raise `PlugInError` if one of them is no reduced model."""
        checked_fit(NAME, self.fast)
        checked_fit(NAME, self.safe)

    def __getattr__(self, name: str) -> Any:
        if name not in STEPPED:
            raise AttributeError(f"a guarded model has no {name}")
        return getattr(self.fast, name)

    @property
    def order(self) -> int:
        """Order of the fast model."""
        return self.fast.order

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Best approximation of the fast model."""
        return self.fast.best_approximation(states)

    def simulate(
        self, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """The fast run; where it can't be trusted, the safe one."""
        run = simulated(self.fast, maneuver, start, outputs)
        if run.status == "ok" and run.trust:
            return run
        # A model without ranges of its own is trusted nowhere.
        silent = run.message or "the fast model does not judge itself"
        trust = run.trust or Trust(np.inf, 0.0, silent)
        safe = simulated(self.safe, maneuver, start, outputs)
        why = f"{SAFE} did the run: {trust.message or run.message}"
        return replace(
            safe,
            counts={name: count + safe.counts[name] for name, count in run.counts.items()},
            seconds=run.seconds + safe.seconds,
            remark="; ".join(part for part in (why, safe.remark) if part),
            trust=trust,
        )


def fit(
    model: DynamicModel,
    training: Training,
    settings: GuardedSettings,
    others: FitOther | None = None,
) -> FallbackModel:
    """Fit both, by `others` if it is given."""
    made = others or (lambda name, own: fitted(component("method", name), model, training, own))
    fast, safe = (made(name, own) for name, own in _settings_of_both(model, settings))
    first, second = fast.offline, safe.offline
    cost = OfflineCost(first.seconds + second.seconds, first.evaluations + second.evaluations)
    return FallbackModel(fast, safe, cost)


def check(model: DynamicModel, settings: GuardedSettings) -> None:
    """Raise `InputError` if a method or its settings don't fit the model."""
    accepted, reason = component("method", settings.fast).accepts(model)
    if not accepted or settings.fast == NAME:
        reason = reason or "it would guard itself"
        raise InputError(f"{NAME}: fast can't be {settings.fast!r}: {reason}")
    for name, own in _settings_of_both(model, settings):
        checked_settings(component("method", name), model, own)


def _settings_of_both(model: DynamicModel, settings: GuardedSettings) -> list[tuple[str, Settings]]:
    """Methods of the fast and of the safe model with their settings."""
    method: Method = component("method", settings.fast)
    given = inline_table(settings.fast_settings, f"{NAME}: fast_settings")
    known = {*method.names_of(model.kind)}
    online = {name: getattr(settings, name) for name in ("solver", "tolerance") if name in known}
    if twice := [name for name in online if name in given]:
        raise InputError(f"{NAME}: fast_settings has {twice[0]}, which is a setting of its own")
    safe = {"solver": settings.safe_solver, "tolerance": settings.safe_tolerance}
    return [
        (settings.fast, validated(method, model.kind, online | given)),
        (SAFE, validated(component("method", SAFE), model.kind, safe)),
    ]


METHOD = Method(
    name=NAME,
    summary="a fast model where it can be trusted, the full order where not",
    settings=dict.fromkeys(("ode", "dae"), GuardedSettings),
    refusal=no_steered_vehicle,
    check=check,
    fit=fit,
    fits_others=True,
)
