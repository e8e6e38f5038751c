"""How to cite the suite, the paper that it rebuilds, and its methods."""

from importlib.metadata import version

from vehiclemor.registry import component, names
from vehiclemor.report.published import load_published

TITLE = "vehiclemor: benchmark suite for model order reduction of multibody vehicle models"


def citations() -> str:
    """BibTeX entries for the suite and the paper, and the references of the methods."""
    paper = load_published().paper
    authors = " and ".join(paper.authors)
    lines = [
        "@software{vehiclemor,",
        "  author  = {{The vehiclemor developers}},",
        f"  title   = {{{{{TITLE}}}}},",
        f"  version = {{{version('vehiclemor')}}},",
        "  year    = {2026},",
        "}",
        "",
        "@article{masoudi2015,",
        f"  author  = {{{authors}}},",
        f"  title   = {{{paper.title}}},",
        f"  journal = {{{paper.journal}}},",
        f"  volume  = {{{paper.volume}}},",
        f"  number  = {{{paper.number}}},",
        f"  pages   = {{{paper.article}}},",
        f"  year    = {{{paper.year}}},",
        f"  doi     = {{{paper.doi}}},",
        "}",
    ]
    references = {name: component("method", name).reference for name in names("method")}
    lines += ["", *(f"method {name}: doi:{doi}" for name, doi in references.items() if doi)]
    return "\n".join(lines)
