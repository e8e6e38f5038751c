"""Regeneration of figures and tables from stored results; what is missing is run first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vehiclemor.arguments import count, file_path, quoted
from vehiclemor.errors import FileError, InputError
from vehiclemor.files import make_folder, write_text
from vehiclemor.study.netcdf_file import read_dataset
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
    """Draw figures, by default all but those `left_out`, and an index of captions; files written.

    Studies that the results folder lacks are run, but for those of minutes: see `left_out`.

    Parameters
    ----------
    style, dpi
        Name or file of a Matplotlib style on top of the package's, and dots an inch of pictures.

    Raises
    ------
    InputError, FileError
        If a name is unknown or a folder can't be written.
    """
    from vehiclemor.report.figures.catalogue import FIGURES, PARAMETERS, find
    from vehiclemor.report.figures.saving import FORMATS, save_figure, styled

    # What is wrong is named before anything is computed.
    styled(style, dpi)
    missing = left_out(results)
    wanted = only or [name for name in FIGURES if name not in missing]
    chosen = {entry.name: entry for name in wanted for entry in find(name, results)}
    make_folder(out)
    data: dict[str, xr.Dataset] = {}
    for entry in chosen.values():
        for study in entry.studies:
            if not only and not entry.default:
                data[study] = read_dataset(_stored(results, study), "study", study)
            elif not data.keys() >= set(entry.names):
                data |= run_studies(study, results, jobs)
    written: list[Path] = []
    index = ["# Figures", "", PARAMETERS, ""]
    for name, entry in chosen.items():
        with styled(style, dpi):
            try:
                figure = entry.draw(data)
            except KeyError as error:
                if only or entry.default:
                    raise
                # Read as it was stored, perhaps by other source.
                raise FileError(
                    f"{_stored(results, entry.names[0])}: lacks {error}; vehiclemor figures "
                    f"--only {name} makes it again"
                ) from None
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


def figures(
    only: Sequence[str] = (),
    out: str | Path = "results",
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
    """
    folders = file_path("results", results), file_path("out", out)
    chosen = [only] if isinstance(only, str) else only
    if not (isinstance(chosen, Sequence) and all(isinstance(name, str) for name in chosen)):
        raise InputError(f"only is {quoted(only)}, not a list of names of figures")
    return regenerate_figures(*folders, chosen, count("jobs", jobs), style=style, dpi=dpi)


def left_out(results: Path) -> dict[str, str]:
    """Figures that are drawn only where their study is stored, and which study isn't."""
    from vehiclemor.report.figures.catalogue import FIGURES

    return {
        name: study
        for name, entry in FIGURES.items()
        for study in entry.names
        if not entry.default and not _stored(results, study).exists()
    }


def _stored(results: Path, study: str) -> Path:
    return results / "studies" / f"{study}.nc"


def regenerate_all(results: Path, out: Path, jobs: int = 1) -> list[Path]:
    """All figures into `out`/figures and all tables into `out`/tables."""
    from vehiclemor.report.tables import regenerate_tables

    written = regenerate_figures(results, out / "figures", (), jobs)
    return written + regenerate_tables(results, out / "tables", jobs)
