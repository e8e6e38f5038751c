"""Singular values of the paper's subspaces, and the energy that their leading modes hold.

Masoudi, Uchida, McPhee (2015), equations 5 to 8: the eigenvalues l_j of the snapshots' correlation
matrix are the squares of the singular values in step 3 of section 3, and a subspace of rank r
leaves out their sum over j > r.  Eigenvalues are those of the snapshots of one control period with
its mean removed, as step 2 has it, and a share does not depend on how the integral is discretised.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from vehiclemor.exceptions import InputError
from vehiclemor.reduction.methods import pod
from vehiclemor.reduction.projection.algebraic import AlgebraicProjection
from vehiclemor.reduction.projection.dynamic import DynamicProjection
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.registry import component
from vehiclemor.report.default_studies import smaller_rank
from vehiclemor.simulation.build import build

PRESETS = ("literal", "recommended")


def spectrum(models: Sequence[str]) -> xr.Dataset:
    """Singular values and energies of every control period of POD, in the nominal run.

    `singular_value` (over the largest of its control period), `energy` (cumulative share) and
    `left_out` (1 - energy, without cancellation) are on the dimensions `model`, `preset` (`literal`
    is the paper's: Euclidean, all states; `recommended` has the inner product of the default
    settings), `window` (control periods from 0 on) and `mode` (from 1 on), NaN where a model has
    less of them.  Coordinates `rank`, `control_period` (s) and `snapshots` are on `model`.
    """
    return _side_by_side([_of_model(name) for name in models], "model")


def spectrum_table(model: str) -> pd.DataFrame:
    """One row for each preset and mode, of all control periods.

    These are the median and the largest singular value (over the first of its period), the least
    energy, and the largest share that is left out.
    """
    data = spectrum([model]).squeeze("model", drop=True)
    values = data["singular_value"]
    found = {
        "median_singular_value": values.median("window"),
        "largest_singular_value": values.max("window"),
        "least_energy": data["energy"].min("window"),
        "largest_left_out": data["left_out"].max("window"),
    }
    table = data[[]].assign(found).to_dataframe(["preset", "mode"]).reset_index()
    return table.reindex(columns=["preset", "mode", *found]).dropna(ignore_index=True)


def _of_model(name: str) -> xr.Dataset:
    model = build(name)
    definition = component("model", name)
    maneuver = component("maneuver", definition.maneuver)
    training = [TrainingRun(model, maneuver, model.starts[0])]
    parts, chosen = [], {}
    for preset in PRESETS:
        settings = validated(pod.METHOD, model.kind, smaller_rank(model, "pod"), preset)
        try:
            pod.check(model, settings)
        except InputError:
            # A model without second-order equations has no energy.
            continue
        chosen = {key: getattr(settings, key) for key in ("rank", "control_period", "snapshots")}
        fitted = pod.fit(model, training, settings)
        assert isinstance(fitted, AlgebraicProjection | DynamicProjection)
        values = np.array([basis.singular_values for basis in fitted.bases])
        parts.append(_shares(values).assign_coords(preset=preset))
    return _side_by_side(parts, "preset").assign_coords(model=name, **chosen)


def _side_by_side(parts: Sequence[xr.Dataset], dimension: str) -> xr.Dataset:
    return xr.concat(parts, dimension, coords="different", compat="equals", join="outer")


def _shares(values: np.ndarray) -> xr.Dataset:
    """Spectra of singular values (windows, modes); no share where nothing moves."""
    squares = values**2
    with np.errstate(invalid="ignore"):
        tails = np.cumsum(squares[:, ::-1], axis=1)[:, ::-1] / squares.sum(axis=1, keepdims=True)
        left_out = np.hstack([tails[:, 1:], 0.0 * tails[:, :1]])
        found = {"singular_value": values / values[:, :1], "left_out": left_out}
    found["energy"] = 1.0 - left_out
    places = {"window": np.arange(len(values)), "mode": np.arange(1, values.shape[1] + 1)}
    return xr.Dataset({name: (tuple(places), array) for name, array in found.items()}, places)
