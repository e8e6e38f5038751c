"""POD in control periods, which is the paper's method, or with one basis.

R. Masoudi, T. Uchida, J. McPhee, Reduction of Multibody Dynamic Models in Automotive Systems Using
the Proper Orthogonal Decomposition, J. Comput. Nonlinear Dyn. 10(3), 031007 (2015), section 3.
L. Sirovich, Turbulence and the dynamics of coherent structures, Quart. Appl. Math. 45 (1987).
"""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, create_model

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.interface import FittedModel, Method
from vehiclemor.reduction.projection import algebraic, dynamic, structural
from vehiclemor.reduction.projection.bases import Snapshots, window_edges
from vehiclemor.reduction.settings import Settings
from vehiclemor.reduction.training import Training
from vehiclemor.simulation.model import Model

PROJECTIONS = {"ae": algebraic, "ode": dynamic, "dae": dynamic}
SETTINGS: dict[str, type[Settings]] = {
    "ae": algebraic.AlgebraicPodSettings,
    "ode": dynamic.DynamicPodSettings,
    "dae": dynamic.ConstrainedPodSettings,
}
# Lengths in s of the paper's control periods, and the shortest: no motion of a vehicle happens in
# less.
PERIODS = {"ae": 5.0, "ode": 0.5, "dae": 0.1}
SHORTEST_PERIOD = {"ae": 1e-3, "ode": 1e-2, "dae": 1e-2}
ControlPeriod = Annotated[float, Field(gt=0.0, description="length of a control period in s")]
# As many snapshots of one basis as the paper's control periods have together.
SNAPSHOTS = {"ae": 20, "ode": 500, "dae": 500}
DYNAMIC_LITERAL = {"formulation": "state", "inner_product": "euclidean", "rank_tolerance": 0.0}
# `literal` takes the paper's words literally.
PRESETS = {
    "ae": {"literal": {"test_space": "galerkin", "rank_tolerance": 0.0}},
    "ode": {"literal": DYNAMIC_LITERAL},
    "dae": {"literal": DYNAMIC_LITERAL},
}


def _settings(kind: str, name: str, **further: Any) -> type[Settings]:
    """Settings of POD with another field or default."""
    return create_model(name, __base__=SETTINGS[kind], **further)


def check(model: Model, settings: Any) -> None:
    """Raise `InputError` if the settings don't fit the model; every rank fits a structure."""
    if model.kind == "structural":
        return
    PROJECTIONS[model.kind].check_subspace(model, settings)
    period, shortest = getattr(settings, "control_period", np.inf), SHORTEST_PERIOD[model.kind]
    if period < shortest:
        raise InputError(f"control_period is below {shortest:g} s")


def fit(model: Model, training: Training, settings: Any) -> FittedModel:
    """One POD subspace for each control period of the training runs, or for the whole of them.

    `InputError` if these differ in duration.
    """
    if model.kind == "structural":
        return structural.fit_basis(model, training, settings)  # type: ignore[arg-type]
    duration, *others = sorted({run.maneuver.duration for run in training})
    if others:
        lengths = ", ".join(f"{length:g}" for length in (duration, *others))
        raise InputError(f"windows in time need training runs of one duration, not {lengths} s")
    edges = window_edges(duration, getattr(settings, "control_period", duration))
    return PROJECTIONS[model.kind].fit_windows(model, training, edges, settings)


METHOD = Method(
    name="pod",
    summary="POD with its own mean and basis in each control period (the paper's method)",
    reference="10.1115/1.4029390",
    settings={
        kind: _settings(kind, "PodSettings", control_period=(ControlPeriod, PERIODS[kind]))
        for kind in SETTINGS
    },
    presets=PRESETS,
    refusal=dynamic.further_states_refused,
    check=check,
    fit=fit,
)
FIXED_BASIS = replace(
    METHOD,
    name="fixed_basis",
    summary="POD with one mean and basis for the whole run",
    reference="10.1090/qam/910462",
    settings={
        kind: _settings(kind, "FixedBasisSettings", snapshots=(Snapshots, SNAPSHOTS[kind]))
        for kind in SETTINGS
    }
    | {"structural": structural.StructuralPodSettings},
)
