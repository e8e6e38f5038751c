"""The paper's own terms: POD at its rank and control period, as fast as its errors allow.

Trained on the run that is shown, as the paper does: what is measured here is the speed of a
recording, not of a prediction.  Of all formulations, inner products, integrators and tolerances the
fastest counts whose errors stay within the published ones from every start.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vehiclemor.models.report import TimingCase
from vehiclemor.reduction.settings import Value
from vehiclemor.report.published import load_published
from vehiclemor.simulation.build import build
from vehiclemor.study.timing import timed_model

Row = dict[str, Any]
BASELINES = (
    TimingCase("baseline", "full order, the paper's kind", "full_order"),
    TimingCase("strongest", "full order, strongest", "full_order", "strongest"),
)


@dataclass(frozen=True)
class Terms:
    """What the paper sets for a model, and what it leaves open.

    Attributes
    ----------
    fixed
        Settings that the paper names.
    open
        Setting -> values that are tried, in all combinations.
    bounds
        Output -> key of its published RMS error.
    """

    fixed: dict[str, Value]
    open: dict[str, tuple[Value, ...]]
    bounds: dict[str, str]

    def variants(self) -> Iterator[TimingCase]:
        """All variants, known by what they set."""
        for values in product(*self.open.values()):
            chosen = dict(zip(self.open, values, strict=True))
            label = ", ".join(str(value) for value in values)
            yield TimingCase(label, f"pod, {label}", "pod", settings=self.fixed | chosen)


FORMS: dict[str, tuple[Value, ...]] = {
    "formulation": ("coordinates", "state"),
    "inner_product": ("energy", "euclidean"),
    "solver": ("explicit", "rodas4"),
    "tolerance": (1e-6, 1e-4, 1e-3),
}
TERMS = {
    "double_wishbone": Terms(
        {"rank": 3, "control_period": 5.0},
        {
            "test_space": ("least_squares", "galerkin"),
            "tolerance": (1e-12, 1e-8, 1e-6, 1e-5, 1e-4),
        },
        {"spindle_y": "dw_rms_spindle_y", "second_euler_angle": "dw_rms_second_euler_angle"},
    ),
    "independent_suspension_vehicle": Terms(
        {"rank": 3, "control_period": 0.5},
        FORMS,
        {"pitch": "gv_rms_pitch", "yaw": "gv_rms_yaw"},
    ),
    "high_fidelity_vehicle": Terms(
        {"rank": 1, "control_period": 0.1},
        FORMS,
        {"lateral_speed": "hfv_rms_lateral_speed", "vertical_speed": "hfv_rms_vertical_speed"},
    ),
}


def paper_terms_rows(folder: Path) -> list[Row]:
    """All variants of all models: errors (worst of the starts), seconds, speed-ups, verdict.

    Returns
    -------
    list of dict
        `kind` is `paper`; `within_bounds` tells whether the errors stay within the published ones,
        `winner` marks the fastest that does.  `ratio_same_integrator` is against the paper's kind
        of full-order run, `ratio_strongest` against the best full-order integrator.
    """
    rows: list[Row] = []
    for model in TERMS:
        part = _model_rows(model, folder)
        racing = [row for row in part if row["within_bounds"]]
        if racing:
            min(racing, key=lambda row: row["seconds"])["winner"] = True
        rows += part
    return rows


def _model_rows(name: str, folder: Path) -> list[Row]:
    terms = TERMS[name]
    numbers = load_published().numbers
    variants = tuple(terms.variants())
    dataset = timed_model(build(name), (*BASELINES, *variants), folder, f"paper-terms-{name}")
    rows = []
    for variant in variants:
        part = dataset.sel(case=variant.id)
        worst = part["rms_error"].max("start")
        errors = {f"worst_rms_{o}": float(worst.sel(output=o)) for o in terms.bounds}
        ok = bool((part["status"] == "ok").all())
        within = ok and all(
            errors[f"worst_rms_{output}"] <= numbers[key].value
            for output, key in terms.bounds.items()
        )
        rows.append(
            {
                "kind": "paper",
                "model": name,
                "method": variant.label,
                "within_bounds": within,
                "winner": False,
                "stable_share": float((part["status"] == "ok").mean()),
                "seconds": float(part["seconds"].mean()),
                "ratio_same_integrator": float(part["speed_up"].mean()),
                "ratio_strongest": float(part["speed_up_strongest"].mean()),
                "offline_seconds": float(part["offline_seconds"].mean()),
                **errors,
            }
        )
    return rows


def printed_terms(rows: list[Row]) -> list[str]:
    """The fastest variant of each model within the published errors, and how many are."""
    lines = ["", "The paper's own terms: its rank and control period, trained on the run shown"]
    head = f"  {'fastest variant within the published errors':<52}{'us':>9}{'x same':>8}"
    lines.append(head + f"{'x best':>8}  worst RMS errors")
    for model in dict.fromkeys(row["model"] for row in rows):
        part = [row for row in rows if row["model"] == model]
        within = [row for row in part if row["within_bounds"]]
        lines.append(f"  {model}: {len(within)} of {len(part)} variants within")
        for row in within:
            if row["winner"]:
                errors = ", ".join(
                    f"{column.removeprefix('worst_rms_')} {value:.2g}"
                    for column, value in row.items()
                    if column.startswith("worst_") and np.isfinite(value)
                )
                text = f"    {row['method']:<50}{1e6 * row['seconds']:>9.1f}"
                text += f"{row['ratio_same_integrator']:>8.2f}{row['ratio_strongest']:>8.2f}"
                lines.append(f"{text}  {errors}")
    return lines
