"""Size studies as rows: what a reduction gains on each mesh, and against which full model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vehiclemor.study.plans.size import FULL, GROUPS

if TYPE_CHECKING:
    import xarray as xr

Row = dict[str, Any]
KIND = "size"
# Kinds of meshes in words, with the unit of what is refined.
KINDS = {"elements_per_bay": ("beams", "a bay"), "shell_size": ("shells", "m")}
# Decades are fitted over meshes of at least so many coordinates: smaller ones are all overhead.
GROWING = 300


def size_rows(dataset: xr.Dataset) -> Iterator[Row]:
    """A row for each reduced model on each mesh: its gains, errors, rivals and offline cost.

    `rival_*` is the cheapest full model, on any mesh, whose error in that group of outputs is no
    larger; the reduced model is so many times faster (`gain_*`).
    """
    seconds, n = dataset["seconds_median"], dataset["coordinates_of_mesh"].values
    full = seconds.sel(label=FULL).values
    for mesh in range(dataset.sizes["mesh"]):
        kind = str(dataset["kind"].values[mesh])
        for label in dataset["label"].values.tolist()[1:]:
            reduced = dataset.isel(mesh=mesh).sel(label=label)
            time, offline = float(reduced["seconds_median"]), float(reduced["offline_seconds"])
            if not np.isfinite(time):
                continue
            saved = full[mesh] - time
            row: Row = {
                "kind": KIND,
                "study": dataset.attrs["study"],
                "mesh": mesh_text(dataset, mesh),
                "mesh_kind": kind,
                "coordinates": int(n[mesh]),
                "label": "chosen by its protocol" if kind == "vehicle" else label,
                "order": float(reduced["effective_rank"]),
                "full_seconds": float(full[mesh]),
                "seconds": time,
                "gain_mesh": float(full[mesh] / time),
                "offline_seconds": offline,
                "growth_full": growth(dataset, kind, FULL),
                "growth": growth(dataset, kind, label),
                "break_even": float(offline / saved) if saved > 0.0 else np.nan,
            }
            for group in GROUPS:
                error = float(reduced["relative_error"].sel(group=group))
                row |= _cheapest_rival(dataset, group, error, time)
            yield row


def _cheapest_rival(dataset: xr.Dataset, group: str, error: float, seconds: float) -> Row:
    """The cheapest full model whose error in a group of outputs is no larger."""
    full = dataset.sel(label=FULL)
    errors = full["relative_error"].sel(group=group).values
    times = np.where(errors <= error, full["seconds_median"].values, np.inf)
    rival, gain = "", np.nan
    if np.isfinite(times).any():
        fastest = int(times.argmin())
        rival, gain = mesh_text(dataset, fastest), float(times[fastest] / seconds)
    return {f"error_{group}": error, f"rival_{group}": rival, f"gain_{group}": gain}


def mesh_text(dataset: xr.Dataset, mesh: int) -> str:
    """A mesh in words: `shells, 0.25 m`; of a vehicle its name."""
    name, kind = str(dataset["mesh"].values[mesh]), str(dataset["kind"].values[mesh])
    if kind == "vehicle":
        return name.replace("_", " ")
    word, unit = KINDS.get(kind, (kind, ""))
    return f"{word}, {name.split()[1].rstrip(',')} {unit}".rstrip()


def growth(dataset: xr.Dataset, kind: str, label: str) -> float:
    """Exponent p of time ~ n^p over the meshes of a kind; NaN where fewer than two are timed."""
    n = dataset["coordinates_of_mesh"].values
    seconds = dataset["seconds_median"].sel(label=label).values
    chosen = (dataset["kind"].values == kind) & np.isfinite(seconds) & (n >= GROWING)
    if chosen.sum() < 2:
        return np.nan
    return float(np.polyfit(np.log(n[chosen]), np.log(seconds[chosen]), 1)[0])


def growth_text(rows: Sequence[Row]) -> str:
    """Growth of the times with the number of coordinates, by kind of mesh, in one sentence."""
    first_of_kind: dict[str, Row] = {}
    for row in rows:
        if not np.isnan(row["growth_full"]):
            first_of_kind.setdefault(row["mesh_kind"], row)
    parts: list[str] = []
    for kind, row in sorted(first_of_kind.items()):
        word, *_ = KINDS.get(kind, (kind,))
        reduced = f"{row['label']} n^{row['growth']:.2f}"
        parts.append(f"{word}: full n^{row['growth_full']:.2f}, {reduced}")
    return f"Times grow with the number n of coordinates ({'; '.join(parts)})." if parts else ""


EXPLAINED = (
    "Errors: worst RMS error of the group against the finest mesh, over the output's range. "
    "Cheapest full: the full model, on any mesh, that is at least as accurate."
)
