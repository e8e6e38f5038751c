"""The paper's own terms: POD at its rank and control period, as fast as its errors allow.

Trained on the run that is shown, as the paper does: what is measured here is the speed of a
recording, not of a prediction.  Of all formulations, inner products, integrators and tolerances the
fastest counts whose errors stay within the published ones from every start.
"""

from collections.abc import Iterable, Iterator
from itertools import product
from pathlib import Path

import numpy as np

from vehiclemor.report.default_studies import bounds, smaller_rank
from vehiclemor.report.predictive.targets import Row
from vehiclemor.report.printing import Line as Printed
from vehiclemor.report.printing import fixed, table_text
from vehiclemor.report.shown import of_kind
from vehiclemor.simulation.build import build
from vehiclemor.simulation.model import Model
from vehiclemor.study.timing import TimingCase, timed_model


def paper_terms_rows(models: Iterable[str], folder: Path) -> list[Row]:
    """All variants of all models: errors (worst of the starts), seconds, speed-ups, verdict.

    Returns
    -------
    list of dict
        `kind` is `paper`; `within_bounds` tells whether the errors stay within the published ones
        (see `default_studies.bounds`), `winner` marks the fastest that does.
        `ratio_same_integrator` is against the paper's kind of full-order run, `ratio_strongest`
        against the best full-order integrator.
    """
    rows: list[Row] = []
    for model in models:
        part = _model_rows(model, folder)
        within = [row for row in part if row["within_bounds"]]
        if within:
            min(within, key=lambda row: row["seconds"])["winner"] = True
        rows += part
    return rows


def paper_cases(model: Model) -> Iterator[TimingCase]:
    """Both full-order cases, then POD with all that the paper leaves open.

    Rank and control period are the defaults of POD, which are the paper's.  The identifier and the
    label of a variant are the values that it sets.
    """
    yield TimingCase("baseline", "full order, the paper's kind", "full_order")
    yield TimingCase("strongest", "full order, strongest", "full_order", "strongest")
    varied = of_kind(model.kind).paper_open
    for values in product(*varied.values()):
        label = ", ".join(str(value) for value in values)
        chosen = smaller_rank(model, "pod") | dict(zip(varied, values, strict=True))
        yield TimingCase(label, f"pod, {label}", "pod", settings=chosen)


def _model_rows(name: str, folder: Path) -> list[Row]:
    model = build(name)
    cases, limits = list(paper_cases(model)), bounds(model)
    dataset = timed_model(model, cases, folder, f"paper-terms-{name}")
    rows = []
    for case in cases:
        if case.method == "full_order":
            continue
        part = dataset.sel(case=case.id)
        worst = part["rms_error"].max("start", skipna=False)
        errors = {output: float(worst.sel(output=output)) for output in limits}
        ok = bool((part["status"] == "ok").all())
        rows.append(
            {
                "kind": "paper",
                "model": name,
                "method": case.label,
                "within_bounds": ok and all(errors[o] <= limits[o] for o in limits),
                "winner": False,
                "stable_share": float((part["status"] == "ok").mean()),
                "seconds": float(part["seconds"].mean()),
                "ratio_same_integrator": float(part["speed_up"].mean()),
                "ratio_strongest": float(part["speed_up_strongest"].mean()),
                "offline_seconds": float(part["offline_seconds"].mean()),
                **{f"worst_rms_{output}": error for output, error in errors.items()},
            }
        )
    return rows


def paper_terms_text(rows: list[Row]) -> str:
    """The fastest variant of each model within the published errors, and how many are."""
    printed: list[Printed] = []
    for model in dict.fromkeys(row["model"] for row in rows):
        part = [row for row in rows if row["model"] == model]
        within = sum(bool(row["within_bounds"]) for row in part)
        heading = f"{model}: {within} of {len(part)} variants within"
        printed.append(Printed([], heading=heading))
        for row in part:
            if row["winner"]:
                errors = ", ".join(
                    f"{column.removeprefix('worst_rms_')} {value:.2g}"
                    for column, value in row.items()
                    if column.startswith("worst_") and np.isfinite(value)
                )
                cells = [f"  {row['method']}", fixed(1e6 * row["seconds"], 1)]
                cells += [fixed(row[f"ratio_{name}"]) for name in ("same_integrator", "strongest")]
                printed.append(Printed(cells, f"worst RMS errors: {errors}"))
    heading = "fastest variant within the bounds"
    title = "The paper's own terms: its rank and control period, trained on the run shown"
    return f"{title}\n{table_text([heading, 'us', 'x same', 'x best'], printed)}"
