"""What the paper prints: its numbers, each with its page; and how to cite."""

from functools import cache
from importlib.metadata import version
from typing import Literal

from vehiclemor.files import data_folder
from vehiclemor.registry import component, names
from vehiclemor.toml_files import FileSchema, Line, read_toml

# Models of the paper: it says nothing about others in the registry.
Model = Literal["independent_suspension_vehicle", "double_wishbone", "high_fidelity_vehicle"]


class Printed(FileSchema):
    """One thing that the paper prints, and where."""

    id: str
    page: str
    section: str
    figure: int | None = None


class Number(Printed):
    """A printed number, and the settings behind it, as far as the paper prints them.

    A time reduction is 1 - reduced time / full time, a perturbation the relative increase of the
    input's frequency or amplitude; `note` says how the printed words were read.
    """

    model: Model
    kind: Literal["rms_error", "time_reduction", "setting", "perturbation"]
    item: Line
    quantity: str = ""
    value: float
    unit: Line
    states: int | None = None
    control_period: float | None = None
    snapshots: int | None = None
    note: Line | None = None


class Published(FileSchema):
    """Schema of `data/published/masoudi2015.toml`: the paper's numbers."""

    number: list[Number]

    @property
    def numbers(self) -> dict[str, Number]:
        """Id -> number, in the order of the file."""
        return {number.id: number for number in self.number}


class FixedSets(FileSchema):
    """Schema of `data/published/test_sets.toml`: name of a test set -> its digest."""

    test_sets: dict[str, str]


@cache
def load_published() -> Published:
    """What the paper prints, from the file of the package."""
    return read_toml(data_folder() / "published" / "masoudi2015.toml", Published)


def rms_numbers(model: str) -> dict[str, Number]:
    """Published RMS errors of a model by the output that they are about; none for a plug-in's."""
    numbers = load_published().number
    return {n.quantity: n for n in numbers if n.model == model and n.kind == "rms_error"}


def fixed_test_sets() -> dict[str, str]:
    """Digests of the fixed test sets by their names."""
    return read_toml(data_folder() / "published" / "test_sets.toml", FixedSets).test_sets


def citations() -> str:
    """BibTeX of the suite and the paper, the fixed test sets, and the methods' references."""
    text = (data_folder() / "published" / "citations.bib").read_text(encoding="utf-8")
    references = {name: component("method", name).reference for name in names("method")}
    lines = [f"test set {name}: digest {digest}" for name, digest in fixed_test_sets().items()]
    lines += [f"method {name}: doi:{doi}" for name, doi in references.items() if doi]
    return "\n".join([text.replace("VERSION", version("vehiclemor")), *lines])
