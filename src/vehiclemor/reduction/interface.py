"""What every reduction method declares, and what its fit gives.

The entry point of a method, in the group `vehiclemor.methods`, names a `Method`.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from inspect import signature
from typing import Any, Literal, Protocol

import numpy as np

from vehiclemor.arguments import line_of_text, quoted
from vehiclemor.exceptions import InputError, blamed
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.reduction.settings import Settings, Value
from vehiclemor.reduction.trust import InputRange, band_range
from vehiclemor.registry import choice
from vehiclemor.short_repr import ShortRepr
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.trajectory import Start, Trajectory

Presets = Mapping[str, Mapping[str, Value]]


@dataclass(frozen=True)
class OfflineCost:
    """Cost of making a reduced model, compilation not included.

    Attributes
    ----------
    seconds
        CPU time of the process, for training simulations and fit.
    evaluations
        Evaluations of the full model's equations in training simulations.
    """

    seconds: float = 0.0
    evaluations: int = 0

    def check_sizes(self) -> None:
        """There are none."""


@contextmanager
def installed(library: str, extra: str = "contenders") -> Iterator[None]:
    """Where a method imports its library; `InputError` that says how to install it."""
    try:
        yield
    except ImportError as error:
        raise InputError(
            f'this method needs {library}; install it by: pip install "vehiclemor[{extra}]"'
        ) from error


def offline_cost(
    began: float, model: Model, runs: Sequence[Trajectory] = (), further: int = 0
) -> OfflineCost:
    """Seconds since `began` (`time.process_time()`), evaluations of the runs and `further` ones."""
    evaluations = sum(run.counts[model.evaluations] for run in runs) + further
    return OfflineCost(time.process_time() - began, evaluations)


# What every fitted model has.
MEMBERS = ("simulate", "best_approximation", "offline", "order")


class FittedModel(Protocol):
    """What `fit` returns: a model that is run.

    One that can be stepped too is a `ReducedSystem` or a `ReducedMechanism`, or has `states`,
    `begin`, `step`, `rates`, `sensitivities`, `decode` and `trust` as these do.
    """

    @property
    def offline(self) -> OfflineCost:
        """Cost of making it."""
        ...

    @property
    def order(self) -> int:
        """Largest number of reduced coordinates in any window; n for a full-order model."""
        ...

    def simulate(self, maneuver: Excitation, start: Start) -> Trajectory:
        """Trajectory at the maneuver's output times.

        It may take `outputs`, a tuple of the names of the recorded ones; see `simulated`.
        """
        ...

    def best_approximation(self, states: np.ndarray) -> np.ndarray | None:
        """Projection of full-order states (samples, n) onto the same subspaces, if any."""
        ...


def lower_rank(settings: Mapping[str, Any], reduced: FittedModel) -> str:
    """That a model has a lower rank than its settings ask for; empty if it has not."""
    rank = settings.get("rank", 0)
    if reduced.order >= rank:
        return ""
    return f"effective rank {reduced.order}, where {rank} is asked for: training has no more"


def simulated(
    reduced: FittedModel, maneuver: Excitation, start: Start, outputs: tuple[str, ...] | None
) -> Trajectory:
    """A run of a reduced model, with some outputs alone."""
    if outputs is None:
        return reduced.simulate(maneuver, start)
    if _selects(type(reduced)):
        return reduced.simulate(maneuver, start, outputs)  # type: ignore[call-arg]
    return reduced.simulate(maneuver, start).chosen(outputs)


@cache
def _selects(kind: type) -> bool:
    """Whether reduced models of a class make some outputs alone."""
    return "outputs" in signature(kind.simulate).parameters  # type: ignore[attr-defined]


def never_refused(model: Any) -> str:  # noqa: ARG001
    """Every model of a kind that the method has settings for can be reduced."""
    return ""


def fits_all(model: Model, settings: Any) -> None:
    """All validated settings fit every model."""


@dataclass(frozen=True)
class Method(ShortRepr):
    """A reduction method.

    Attributes
    ----------
    name
        As registered.
    summary
        One line.
    settings
        Kind of model -> class of its settings.  A kind that the method can't reduce has none.
    fit
        (model, training runs, settings) -> reduced model.
    reference
        DOI of the publication, if there is one.
    refusal
        Model of such a kind -> why the method can't reduce it all the same; empty if it can.
    learns_from
        What `fit` reads of the training: its `runs`, which are of the model that it reduces; their
        `inputs` alone; or `nothing`.
    own_limits
        Whether its runs carry a trust indicator, or it knows no bounds; else a run
        beyond the inputs that `fit` has read is not trusted.
    band
        Name of the setting up to whose frequency in Hz a structure's inputs are known, of a method
        that reads nothing.
    variant_of
        Name of the method with the same `fit`, if this one differs from it in defaults alone.
    check
        (model, settings): raises `InputError` if valid settings don't fit the model or each other.
    presets
        Kind of model -> name of a preset -> values that differ from the defaults.  The preset
        `recommended` is the defaults where it isn't named.
    packages
        Names of the installed packages that `fit` or its model computes with, such as `pymor`.
        Stored results are computed again when the version of one changes.
    """

    repr_fields = ("name", "summary", "reference")

    name: str
    summary: str
    settings: Mapping[str, type[Settings]]
    fit: Callable[..., FittedModel]
    reference: str = ""
    refusal: Callable[[Any], str] = never_refused
    check: Callable[[Any, Any], None] = fits_all
    learns_from: Literal["runs", "inputs", "nothing"] = "runs"
    own_limits: bool = False
    band: str = ""
    variant_of: str = ""
    presets: Mapping[str, Presets] = field(default_factory=dict)
    packages: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what is no method, so that its author reads one clear line."""
        for name in ("name", "summary", "reference"):
            line_of_text(f"method {quoted(self.name)}: {name}", getattr(self, name))
        if isinstance(self.packages, str):
            raise InputError(f"method {self.name!r}: packages are a tuple of names, not a text")
        for name in self.packages:
            line_of_text(f"method {self.name!r}: packages", name)
        choice(f"learns_from of {self.name!r}", self.learns_from, ("runs", "inputs", "nothing"))
        for name in ("fit", "refusal", "check"):
            if not callable(getattr(self, name)):
                raise InputError(f"method {self.name!r}: {name} is not a function")
        with blamed(f"method {self.name!r}: settings", self.fit):
            wrong = [kind for kind, s in self.settings.items() if not issubclass(s, Settings)]
        if wrong:
            raise InputError(
                f"method {self.name!r}: settings of {wrong[0]} are no class of Settings"
            )
        with blamed(f"method {self.name!r}: presets", self.fit):
            for kind, presets in self.presets.items():
                for preset, name in ((p, n) for p, values in presets.items() for n in values):
                    choice(f"setting in preset {preset!r} of {kind}", name, self.names_of(kind))

    def accepts(self, model: Model) -> tuple[bool, str]:
        """Whether the method can reduce a model, and why not; a broken refusal refuses."""
        if model.kind not in self.settings:
            kinds = " or ".join(self.settings)
            return False, f"{self.name} reduces kind {kinds}; {model.name} is of kind {model.kind}"
        try:
            with blamed(f"method {self.name!r}: refusal", self.refusal):
                reason = self.refusal(model)
        except InputError as error:
            reason = str(error)
        if not isinstance(reason, str):
            reason = f"method {self.name!r}: refusal gives {quoted(reason)}, not text"
        return not reason, reason

    def require(self, model: Model) -> None:
        """Raise `InputError` if the method can't reduce a model."""
        if reason := self.accepts(model)[1]:
            raise InputError(reason)

    def known_range(
        self, model: Model, settings: Mapping[str, Any], trained: Callable[[], InputRange | None]
    ) -> InputRange | None:
        """Known inputs, where runs carry no trust indicator; none where all are known."""
        if self.own_limits:
            return None
        if self.learns_from != "nothing":
            return trained()
        return band_range(model, settings[self.band]) if self.band in settings else None

    def presets_of(self, kind: str) -> Presets:
        """Presets for models of a kind: name -> values that differ from the defaults."""
        return {"recommended": {}, **self.presets.get(kind, {})}

    def names_of(self, kind: str) -> tuple[str, ...]:
        """Names of the settings for models of a kind."""
        return tuple(self.settings[kind].model_fields) if kind in self.settings else ()
