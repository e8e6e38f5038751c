"""Combined dataset of a protocol: every row on every test scenario."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Container, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.study.plans.choice import Row, Validation
from vehiclemor.study.plans.protocol import Protocol
from vehiclemor.study.provenance import attributes
from vehiclemor.study.variables import variables

if TYPE_CHECKING:
    import xarray as xr


def protocol_dataset(
    protocol: Protocol,
    rows: Sequence[Row],
    found: dict[str, list[xr.Dataset]],
    measured: tuple[xr.Dataset, dict[str, list[str]]],
) -> xr.Dataset:
    """Results of all rows on the dimensions `label`, `scenario` and `output`.

    `scenario_set` tells which set a scenario is of, `apart` why a drawn one is not judged;
    `validation` of a row is the JSON list of its candidates' settings and validation results.

    Parameters
    ----------
    found
        Set -> results of the rows.
    measured
        Timing of the first scenarios of what is judged, and set -> why scenarios are not.
    """
    timed, apart = measured
    import xarray as xr

    labels = [row.label for row in rows]
    parts = [
        xr.concat(datasets, dim="label", combine_attrs="drop").assign_coords(
            scenario_set=("scenario", [purpose] * datasets[0].sizes["scenario"]),
            apart=("scenario", apart.get(purpose, [""] * datasets[0].sizes["scenario"])),
        )
        for purpose, datasets in found.items()
    ]
    # What does not depend on the scenario is the same in every set, but for seconds.
    fixed = [n for n, v in parts[0].data_vars.items() if "scenario" not in v.dims]
    rest = [part.drop_vars(fixed) for part in parts]
    dataset = xr.concat(rest, dim="scenario", combine_attrs="drop").merge(parts[0][fixed])
    # How the files store text holds for their own longest words only.
    dataset = dataset.drop_vars(["seconds", "offline_seconds"]).drop_encoding()
    dataset = dataset.assign_coords(label=labels)
    per_row: dict[str, list[Any]] = {
        "role": [row.entry.role for row in rows],
        "series": [row.entry.label for row in rows],
        "winner": [row.winner for row in rows],
        "method": [row.entry.method for row in rows],
        "settings": [_settings(row) for row in rows],
        "cell_keys": [
            json.dumps({purpose: cells[index].attrs["cell"] for purpose, cells in found.items()})
            for index in range(len(rows))
        ],
        "validation": [_validation(row) for row in rows],
        "validation_score": [row.validation[row.candidate].score for row in rows],
        "offline_seconds": [float(value) for value in timed["offline_seconds"]],
    }
    dataset = dataset.assign(variables(per_row, "label")).set_coords("method")
    judged = dataset["scenario_set"].values == judged_set(found)
    places = np.flatnonzero(judged)[: timed.sizes["scenario"]]
    for name in (n for n, variable in timed.data_vars.items() if "scenario" in variable.dims):
        online = np.full((len(rows), dataset.sizes["scenario"]), np.nan)
        online[:, places] = timed[name].values
        dataset[name] = (("label", "scenario"), online, dict(timed[name].attrs))
    return dataset.assign_attrs(
        attributes(
            protocol.definition.title,
            protocol.model.kernel_hash,
            study=protocol.study,
            model=protocol.model.name,
            evaluations=protocol.model.evaluations,
            configuration=protocol.definition.model_dump_json(exclude_defaults=True),
            test_set=_test_set(protocol, found),
        )
    )


def _test_set(protocol: Protocol, found: Mapping[str, Sequence[xr.Dataset]]) -> str:
    """Name of what is judged, with a hash of the very runs where they are drawn."""
    if "drawn" not in found:
        return "listed"
    labels = "\n".join(str(label) for label in found["drawn"][0]["scenario"].values)
    return f"{protocol.test_set}, runs {hashlib.sha256(labels.encode()).hexdigest()[:8]}"


def judged_set(sets: Container[str]) -> str:
    """The set on which a protocol judges: what is drawn, else what is listed."""
    return "drawn" if "drawn" in sets else "test"


def judged_part(dataset: xr.Dataset) -> xr.Dataset:
    """What is judged of a combined dataset: without runs on which the full order is sensitive."""
    sets = dataset["scenario_set"].values
    chosen = (sets == judged_set(set(sets))) & (dataset["apart"].values == "")
    return dataset.isel(scenario=chosen)


def _settings(row: Row) -> str:
    return json.dumps(row.entry.candidates[row.candidate], sort_keys=True)


def _validation(row: Row) -> str:
    """Every candidate's settings and validation result as JSON text; the chosen one is marked."""
    pairs = zip(row.entry.candidates, row.validation, strict=True)
    content = [
        {"settings": settings, "chosen": index == row.candidate, **_finite(result)}
        for index, (settings, result) in enumerate(pairs)
    ]
    return json.dumps(content, sort_keys=True)


def _finite(result: Validation) -> dict[str, Any]:
    """JSON has no infinity: a number that is infinite is null."""
    return {name: value if np.isfinite(value) else None for name, value in asdict(result).items()}
