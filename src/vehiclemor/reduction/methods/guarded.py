"""A fast model with the full order behind it.

The fast model runs.  If it tells that it leaves what it knows, the full order does the whole run:
the fast one has mostly gone wrong before it notices.
"""

import tomllib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.reduction.interface import FitOther, Method, Offline, ReducedModel, simulated
from vehiclemor.reduction.reduced_system import StateSpace
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.validation import checked_fit, checked_settings, fitted, validated
from vehiclemor.reduction.vehicle.shape import no_steered_vehicle
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust

NAME, SAFE = "guarded", "full_order"
ONLINE = ("solver", "tolerance")


class GuardedSettings(OnlineSettings):
    """Settings for a vehicle; solver and tolerance are the fast model's."""

    fast: str = Field("slow_manifold", description="method of the fast model")
    fast_settings: str = Field(
        "", description="its other settings, as in TOML: terms = 12, ridge = 1e-9"
    )
    safe_solver: Solver = "etdrk4"
    safe_tolerance: Tolerance = 2e-3
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 2e-3


@dataclass(frozen=True, eq=False)
class GuardedModel(ShortRepr):
    """Both models; solver and tolerance are the fast model's, if it has them."""

    fast: ReducedModel
    safe: ReducedModel
    offline: Offline
    solver: str
    tolerance: float

    def check_sizes(self) -> None:
        """Raise `PlugInError` if one of them is no reduced model."""
        checked_fit(NAME, self.fast)
        checked_fit(NAME, self.safe)

    @property
    def effective_rank(self) -> int:
        """Rank of the fast model."""
        return self.fast.effective_rank

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Best approximation of the fast model."""
        return self.fast.best_approximation(states)

    @cached_property
    def ahead(self) -> ReducedModel:
        """The fast model as it is integrated."""
        online = {name: getattr(self, name) for name in ONLINE}
        if any(getattr(self.fast, name, value) != value for name, value in online.items()):
            return replace(self.fast, **online)  # type: ignore[type-var]
        return self.fast

    @property
    def state_space(self) -> StateSpace:
        """That of the fast model, which tells where it is not to be trusted any more."""
        return self.ahead.state_space  # type: ignore[attr-defined]

    def simulate(
        self, maneuver: Maneuver, start: Start, outputs: tuple[str, ...] | None = None
    ) -> Trajectory:
        """The fast run; where it can't be trusted, the safe one."""
        run = simulated(self.ahead, maneuver, start, outputs)
        if run.status == "ok" and run.trust:
            return run
        # A model that does not judge itself is trusted nowhere.
        silent = run.message or "the fast model does not judge itself"
        trust = run.trust or Trust(np.inf, 0.0, silent)
        safe = simulated(self.safe, maneuver, start, outputs)
        told = f"from t = 0 s on by {SAFE}: {trust.reason or run.message}"
        return replace(
            safe,
            counts={name: count + safe.counts[name] for name, count in run.counts.items()},
            seconds=run.seconds + safe.seconds,
            remark="; ".join(part for part in (told, safe.remark) if part),
            trust=trust,
        )


def fit(
    model: DynamicModel,
    training: Training,
    settings: GuardedSettings,
    others: FitOther | None = None,
) -> GuardedModel:
    """Fit both, by `others` if it is given."""
    made = others or (lambda name, own: fitted(component("method", name), model, training, own))
    fast = made(settings.fast, _of_fast(model, settings))
    safe = made(SAFE, _of_safe(model, settings))
    first, second = fast.offline, safe.offline
    cost = Offline(first.seconds + second.seconds, first.evaluations + second.evaluations)
    return GuardedModel(fast, safe, cost, settings.solver, settings.tolerance)


def check(model: DynamicModel, settings: GuardedSettings) -> None:
    """Raise `InputError` if a method or its settings don't fit the model."""
    method: Method = component("method", settings.fast)
    accepted, reason = method.accepts(model)
    if not accepted or settings.fast == NAME:
        told = reason or "it would guard itself"
        raise InputError(f"{NAME}: fast can't be {settings.fast!r}: {told}")
    checked_settings(method, model, _of_fast(model, settings))
    checked_settings(component("method", SAFE), model, _of_safe(model, settings))


def _of_fast(model: DynamicModel, settings: GuardedSettings) -> Any:
    """Settings of the fast model."""
    method: Method = component("method", settings.fast)
    lines = [line.strip(" ,") for line in settings.fast_settings.splitlines()]
    try:
        read = tomllib.loads(f"given = {{ {', '.join(filter(None, lines))} }}")
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{NAME}: fast_settings: {error}") from None
    given = read.pop("given")
    if read or any(isinstance(value, dict | list) for value in given.values()):
        raise InputError(f"{NAME}: fast_settings are names with one value each, not tables")
    known = method.names_of(model.kind)
    online = {name: getattr(settings, name) for name in ONLINE if name in known}
    for name in online:
        if name in given:
            raise InputError(f"{NAME}: fast_settings has {name}, which is a setting of its own")
    return validated(method, model.kind, online | given)


def _of_safe(model: DynamicModel, settings: GuardedSettings) -> Any:
    """Settings of the safe model."""
    online = {"solver": settings.safe_solver, "tolerance": settings.safe_tolerance}
    return validated(component("method", SAFE), model.kind, online)


METHOD = Method(
    name=NAME,
    summary="a fast model where it can be trusted, the full order where not",
    settings=dict.fromkeys(("ode", "dae"), GuardedSettings),
    refusal=no_steered_vehicle,
    check=check,
    fit=fit,
    fits_others=True,
)
