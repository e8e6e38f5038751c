"""`vehiclemor report`: results as one HTML file."""

from pathlib import Path

from vehiclemor import api
from vehiclemor.cli.output_file import page_file
from vehiclemor.cli.progress import shown_progress


def report(
    *studies: str, out: Path = Path("report.html"), results: Path = api.RESULTS, jobs: int = 1
) -> int:
    """Write results as one HTML file: verdicts, tables, figures, settings and provenance.

    It needs no network and loads no other file.

    Parameters
    ----------
    studies
        Studies, collections or TOML files, run first where results are missing, or models, of which
        their studies by default are meant. Without any: everything that the results folder holds.
    out
        The file, which ends with .html.
    results
        Results folder.
    jobs
        Number of processes for missing studies.
    """
    page = page_file("--out", out)
    from vehiclemor.report.page import write_report

    with shown_progress():
        written = write_report(studies, page, results, jobs)
    print(f"written: {written}")
    return 0
