"""Regeneration of figures and tables from stored results; what is missing is run first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.files import make_folder, write_text
from vehiclemor.study.run import run_studies

if TYPE_CHECKING:
    import xarray as xr


def regenerate_figures(
    results: Path,
    out: Path,
    only: Sequence[str] = (),
    jobs: int = 1,
    *,
    style: str = "",
    dpi: int | None = None,
) -> list[Path]:
    """Draw figures, by default those of the paper and an index of their captions; files written.

    Studies that the results folder lacks are run.

    Raises
    ------
    InputError, FileError
        If a name is unknown or a folder can't be written.
    """
    from vehiclemor.report.figures.catalogue import FIGURES, PARAMETERS, find
    from vehiclemor.report.figures.saving import FORMATS, save_figure, styled

    defaults = [name for name, entry in FIGURES.items() if entry.default]
    chosen = {name: find(name, results) for name in only or defaults}
    make_folder(out)
    data: dict[str, xr.Dataset] = {}
    for study in dict.fromkeys(study for entry in chosen.values() for study in entry.studies):
        data |= run_studies(study, results, jobs)
    written: list[Path] = []
    index = ["# Figures", "", PARAMETERS, ""]
    for name, entry in chosen.items():
        with styled(style, dpi):
            figure = entry.draw(data)
            files = [out / f"figure-{name}.{suffix}" for suffix in FORMATS]
            written += [save_figure(figure, path) for path in files]
        origin = ""
        if entry.studies:
            hashes = sorted({str(data[study].attrs["kernel_hash"]) for study in entry.names})
            origin = f"Studies: {', '.join(entry.names)}; kernels {', '.join(hashes)}."
        index.append(f"- figure-{name}: {entry.caption} {origin}".rstrip())
    if not only:
        written.append(write_text(out / "figures.md", "\n".join(index) + "\n"))
    return written


def regenerate_all(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """All figures into `out`/figures and all tables into `out`/tables."""
    from vehiclemor.report.tables import regenerate_tables

    written = regenerate_figures(results, out / "figures", (), jobs)
    return written + regenerate_tables(results, out / "tables", jobs)
