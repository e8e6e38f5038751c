"""Figures from stored results; what is missing is run first."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import xarray as xr

from vehiclemor.arguments import MOST_JOBS, count, file_path, quoted
from vehiclemor.errors import InputError
from vehiclemor.failure import attempt_apart
from vehiclemor.files import make_folder, write_text
from vehiclemor.netcdf_file import read_dataset
from vehiclemor.report.figures import catalogue, theme
from vehiclemor.study.run import run_studies


def figures(
    only: Sequence[str] = (),
    out: str | Path | None = None,
    results: str | Path = "results",
    jobs: int = 1,
    *,
    style: str = "",
    dpi: int | None = None,
    failed: dict[str, str] | None = None,
) -> list[Path]:
    """Draw figures of the paper or of any study; studies that are missing are run first.

    Parameters
    ----------
    only
        Figure names such as `6`, or `histories-`, `errors-`, `map-` or `pareto-` and the name of a
        model, or studies and protocols by name or TOML file; by default the paper's but those
        `left_out`, and an index of captions.
    out
        Folder of the figures; `figures` in the results folder by default.
    results
        Results folder.
    jobs
        Number of processes for missing studies.
    style, dpi
        Name or file of a Matplotlib style on top of the package's, and dots an inch of PNG files.
    failed
        Is given the figures that can't be drawn, and why: they raise no error then.

    Returns
    -------
    list of Path
        Files written.

    Raises
    ------
    VehiclemorError
        If a name or file is wrong; at last if a figure can't be drawn, when all others are written.
    """
    folder = file_path("results", results)
    target = folder / "figures" if out is None else file_path("out", out)
    only = [only] if isinstance(only, str) else only
    if not (isinstance(only, Sequence) and all(isinstance(name, str) for name in only)):
        raise InputError(f"only is {quoted(only)}, not a list of names of figures")
    # What is wrong is named before anything is computed.
    theme.styled(style, dpi)
    jobs = count("jobs", jobs, most=MOST_JOBS)
    missing = left_out(folder)
    wanted = only or [name for name in catalogue.FIGURES if name not in missing]
    chosen = {entry.name: entry for name in wanted for entry in catalogue.find(name, folder)}
    make_folder(target)
    data: dict[str, xr.Dataset] = {}
    for entry in chosen.values():
        for study in entry.studies if only or entry.default else ():
            if not data.keys() >= set(entry.names):
                data |= run_studies(study, folder, jobs)
    written: list[Path] = []
    wrong: dict[str, str] = {}
    index = ["# Figures", "", catalogue.PARAMETERS, ""]
    for name, entry in chosen.items():
        stem = name if name.startswith("figure") else f"figure-{name}"
        files = [target / f"{stem}.{suffix}" for suffix in theme.FORMATS]
        with theme.styled(style, dpi):
            caption = attempt_apart(name, wrong, partial(_draw, entry, data, folder, files))
        index += [f"- {stem}: {text}" for text in caption]
        written += files if caption else []
        if not (caption or only or entry.default):
            # Perhaps by other source.
            wrong[name] += f"; vehiclemor figures --only {name} makes its study again"
    if not only:
        written.append(write_text(target / "figures.md", "\n".join(index) + "\n"))
    if failed is not None:
        failed.update(wrong)
    elif wrong:
        raise InputError("; ".join(f"figure {name}: {why}" for name, why in wrong.items()))
    return written


def _draw(
    entry: catalogue.Entry, data: dict[str, xr.Dataset], results: Path, files: list[Path]
) -> str:
    """Draw a figure of datasets, or of what is stored; its caption and where it is from."""
    shown = {
        name: data[name] if name in data else read_dataset(_stored(results, name), "study", name)
        for name in entry.names
    }
    figure = entry.draw(shown)
    for path in files:
        theme.save_figure(figure, path)
    if not entry.studies:
        return entry.caption
    hashes = sorted({str(dataset.attrs["kernel_hash"]) for dataset in shown.values()})
    return f"{entry.caption} Studies: {', '.join(entry.names)}; kernels {', '.join(hashes)}."


def left_out(results: Path) -> dict[str, str]:
    """Figures that are drawn only where their study is stored, and which study isn't."""
    optional = [
        (name, study) for name, e in catalogue.FIGURES.items() if not e.default for study in e.names
    ]
    return {name: study for name, study in optional if not _stored(results, study).exists()}


def _stored(results: Path, study: str) -> Path:
    return results / "studies" / f"{study}.nc"
