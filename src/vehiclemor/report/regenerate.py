"""Regeneration of figures and tables from stored results; what is missing is run first."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.arguments import MOST_JOBS, count, file_path, quoted
from vehiclemor.errors import InputError
from vehiclemor.files import make_folder, write_text
from vehiclemor.study.failure import attempt_apart
from vehiclemor.study.netcdf_file import read_dataset
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import xarray as xr

    from vehiclemor.report.figures.catalogue import Entry


def figures(
    only: Sequence[str] = (),
    out: str | Path = "results/figures",
    results: str | Path = "results",
    jobs: int = 1,
    *,
    style: str = "",
    dpi: int | None = None,
) -> list[Path]:
    """Draw figures of the paper or of any study; studies that are missing are run first.

    Parameters
    ----------
    only
        Figure names such as `6`, or `histories-`, `errors-`, `map-` or `pareto-` and the name of a
        model, or studies and protocols by name or TOML file; the paper's by default.
    out
        Folder of the figures.
    results
        Results folder.
    jobs
        Number of processes for missing studies.
    style, dpi
        Name or file of a Matplotlib style on top of the package's, and dots an inch of PNG files.

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    VehiclemorError
        If a name or file is wrong; at last if a figure can't be drawn, when all others are written.
    """
    folders = file_path("results", results), file_path("out", out)
    chosen = [only] if isinstance(only, str) else only
    if not (isinstance(chosen, Sequence) and all(isinstance(name, str) for name in chosen)):
        raise InputError(f"only is {quoted(only)}, not a list of names of figures")
    written, failed = regenerate_figures(*folders, chosen, jobs, style=style, dpi=dpi)
    if failed:
        raise InputError("; ".join(f"figure {name}: {why}" for name, why in failed.items()))
    return written


def regenerate_figures(
    results: Path,
    out: Path,
    only: Sequence[str] = (),
    jobs: int = 1,
    *,
    style: str = "",
    dpi: int | None = None,
) -> tuple[list[Path], dict[str, str]]:
    """As `figures`: files that were written, and figures that could not be drawn -> why.

    By default all are drawn but those `left_out`, and an index of captions is written.
    """
    from vehiclemor.report.figures.catalogue import FIGURES, PARAMETERS, find
    from vehiclemor.report.figures.theme import FORMATS, styled

    # What is wrong is named before anything is computed.
    styled(style, dpi)
    jobs = count("jobs", jobs, most=MOST_JOBS)
    missing = left_out(results)
    wanted = only or [name for name in FIGURES if name not in missing]
    chosen = {entry.name: entry for name in wanted for entry in find(name, results)}
    make_folder(out)
    data: dict[str, xr.Dataset] = {}
    for entry in chosen.values():
        for study in entry.studies if only or entry.default else ():
            if not data.keys() >= set(entry.names):
                data |= run_studies(study, results, jobs)
    written: list[Path] = []
    failed: dict[str, str] = {}
    index = ["# Figures", "", PARAMETERS, ""]
    for name, entry in chosen.items():
        files = [out / f"figure-{name}.{suffix}" for suffix in FORMATS]
        with styled(style, dpi):
            caption = attempt_apart(name, failed, partial(_draw, entry, data, results, files))
        index += [f"- figure-{name}: {text}" for text in caption]
        written += files if caption else []
        if not (caption or only or entry.default):
            # Perhaps by other source.
            failed[name] += f"; vehiclemor figures --only {name} makes its study again"
    if not only:
        written.append(write_text(out / "figures.md", "\n".join(index) + "\n"))
    return written, failed


def _draw(entry: Entry, data: dict[str, xr.Dataset], results: Path, files: list[Path]) -> str:
    """Draw a figure of datasets, or of what is stored; its caption and where it is from."""
    from vehiclemor.report.figures.theme import save_figure

    stored = [name for name in entry.names if name not in data]
    read = {name: read_dataset(_stored(results, name), "study", name) for name in stored}
    shown = data | read
    figure = entry.draw(shown)
    for path in files:
        save_figure(figure, path)
    if not entry.studies:
        return entry.caption
    hashes = sorted({str(shown[name].attrs["kernel_hash"]) for name in entry.names})
    return f"{entry.caption} Studies: {', '.join(entry.names)}; kernels {', '.join(hashes)}."


def left_out(results: Path) -> dict[str, str]:
    """Figures that are drawn only where their study is stored, and which study isn't."""
    from vehiclemor.report.figures.catalogue import FIGURES

    optional = [(name, study) for name, e in FIGURES.items() if not e.default for study in e.names]
    return {name: study for name, study in optional if not _stored(results, study).exists()}


def _stored(results: Path, study: str) -> Path:
    return results / "studies" / f"{study}.nc"


def regenerate_all(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """All figures into `out`/figures and all tables into `out`/tables."""
    from vehiclemor.report.tables import regenerate_tables

    written = regenerate_tables(results, out / "tables", jobs)
    return figures((), out / "figures", results, jobs) + written
