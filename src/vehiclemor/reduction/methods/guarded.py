"""A fast model with a safe one behind it.

The fast model runs.  If it tells that it leaves what it knows, the safe one does the whole run, or
goes on from the full state at the last output time that the fast one answers for.
"""

import tomllib
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.reduction.interface import FitOther, Method, Offline, ReducedModel
from vehiclemor.reduction.settings import OnlineSettings, Solver, Tolerance
from vehiclemor.reduction.state_space import StateSpace
from vehiclemor.reduction.training import Training
from vehiclemor.reduction.validation import checked_settings, fitted, validated
from vehiclemor.reduction.vehicle.acceptance import no_steered_vehicle
from vehiclemor.registry import component
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.dynamic import DynamicModel
from vehiclemor.simulation.trajectory import Start, Trajectory, Trust

NAME = "guarded"
ONLINE = ("solver", "tolerance")


class GuardedSettings(OnlineSettings):
    """Settings for a vehicle; solver and tolerance are the fast model's."""

    fast: str = Field("slow_manifold", description="method of the fast model")
    fast_settings: str = Field(
        "", description="its other settings, as in TOML: terms = 12, ridge = 1e-9"
    )
    safe: Literal["full_order"] = Field("full_order", description="method of the safe model")
    safe_solver: Solver = "etdrk4"
    safe_tolerance: Tolerance = 2e-3
    resume: Literal["start", "departure"] = Field(
        "start",
        description="what the safe model does: the whole run, or what comes after the fast one has "
        "left, which is hardly quicker and inherits what was wrong before it was noticed",
    )
    back: float = Field(0.0, ge=0.0, description="time in s before the departure, for resume")
    solver: Solver = "etdrk4"
    tolerance: Tolerance = 2e-3


@dataclass(frozen=True, eq=False)
class GuardedModel(ShortRepr):
    """Both models.

    Attributes
    ----------
    solver, tolerance
        Of the fast model, if it has them.
    safe_name
        Method of the safe model.
    back
        How many seconds before the fast model leaves the safe one takes over.
    """

    fast: ReducedModel
    safe: Any
    safe_name: str
    back: float
    offline: Offline
    solver: str
    tolerance: float

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

    def simulate(self, maneuver: Maneuver, start: Start) -> Trajectory:
        """The fast run; from where it can't be trusted on, the safe one."""
        run = self.ahead.simulate(maneuver, start)
        if run.status == "ok" and run.trust:
            return run
        # A model that does not judge itself is trusted nowhere.
        silent = run.message or "the fast model does not judge itself"
        trust = run.trust or Trust(np.inf, 0.0, silent)
        # A run that has failed without a warning is trusted nowhere.
        known = trust.until if np.isfinite(trust.until) else -np.inf
        kept = int(np.searchsorted(run.time, known - self.back)) - 1
        if kept <= 0:
            kept, begin, state = 0, 0.0, start
        else:
            begin, state = float(run.time[kept]), run.states[kept]
        later = self.safe.simulate(maneuver, state, begin)
        told = handed_over(begin, self.safe_name, trust.reason or run.message)
        remark = "; ".join(part for part in (told, later.remark) if part)
        return replace(joined(run, later, kept), remark=remark, trust=trust)


def handed_over(begin: float, name: str, why: str) -> str:
    """That a method does a run from a time in s on."""
    return f"from t = {begin:.4g} s on by {name}: {why}"


def joined(run: Trajectory, later: Trajectory, kept: int) -> Trajectory:
    """The first samples of a run, and then the later one; with the later one's status."""

    def rows(name: str) -> np.ndarray:
        return np.concatenate([getattr(run, name)[:kept], getattr(later, name)])

    return replace(
        later,
        time=rows("time"),
        inputs=rows("inputs"),
        coordinates=rows("coordinates"),
        speeds=rows("speeds"),
        outputs=rows("outputs"),
        counts={name: count + later.counts[name] for name, count in run.counts.items()},
        seconds=run.seconds + later.seconds,
    )


def fit(
    model: DynamicModel,
    training: Training,
    settings: GuardedSettings,
    others: FitOther | None = None,
) -> GuardedModel:
    """Fit both, by `others` if it is given."""

    def anew(name: str, given: Any) -> ReducedModel:
        return fitted(component("method", name), model, training, given)

    fast = (others or anew)(settings.fast, _of_fast(model, settings))
    safe = (others or anew)(settings.safe, _of_safe(model, settings))
    return GuardedModel(
        fast,
        safe,
        settings.safe,
        np.inf if settings.resume == "start" else settings.back,
        _both(fast, safe),
        settings.solver,
        settings.tolerance,
    )


def _both(*models: ReducedModel) -> Offline:
    parts = [model.offline for model in models]
    return Offline(sum(o.seconds for o in parts), sum(o.evaluations for o in parts))


def check(model: DynamicModel, settings: GuardedSettings) -> None:
    """Raise `InputError` if a method or its settings don't fit the model."""
    if settings.back and settings.resume == "start":
        raise InputError(f"{NAME}: back is for resume = 'departure'; the whole run is done anew")
    for setting, of in (("fast", _of_fast), ("safe", _of_safe)):
        name = getattr(settings, setting)
        method: Method = component("method", name)
        accepted, reason = method.accepts(model)
        if not accepted or name == NAME:
            told = reason or "it would guard itself"
            raise InputError(f"{NAME}: {setting} can't be {name!r}: {told}")
        checked_settings(method, model, of(model, settings))


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
    return validated(component("method", settings.safe), model.kind, online)


METHOD = Method(
    name=NAME,
    summary="a fast model where it can be trusted, a safe one from there on",
    settings=dict.fromkeys(("ode", "dae"), GuardedSettings),
    refusal=no_steered_vehicle,
    check=check,
    fit=fit,
    fits_others=True,
)
