"""What tables and figures show of a model: outputs, and cases and counts of the cost table.

The three models of the paper have rows of their own in `data/figures/tables.toml`; every other one
gets rows by its kind of equations.
"""

from functools import cache

from pydantic import Field

from vehiclemor.multibody.definition import ModelDefinition
from vehiclemor.resources import data_folder
from vehiclemor.study.plans.study_file import MethodEntry, Settings
from vehiclemor.toml_files import FileSchema, Line, read_toml

MOST_PRINTED = 3
LARGEST_DEFAULT_RANK = 3
# Method and preset of the reduced models that are timed where none are listed.
REDUCED = (("pod", "recommended"), ("pod", "literal"), ("fixed_basis", "recommended"))


class Case(MethodEntry):
    """A row of a cost table; identifier and label of a reduced model follow from its settings."""

    id: str = ""

    def named(self) -> "Case":
        """With identifier and label."""
        label = self.label or self._label()
        name = self.id or label.replace(",", "").replace("=", "").replace(" ", "_")
        return self.model_copy(update={"id": name, "label": label})

    def _label(self) -> str:
        """What differs from the recommended settings."""
        words = [self.method.replace("_", " ")]
        words += [self.preset] if self.preset != "recommended" else []
        rest = dict(self.settings)
        rank, tolerance = rest.pop("rank"), rest.pop("tolerance", None)
        label = " ".join([*words, *map(str, rest.values()), f"r={rank}"])
        return label if tolerance is None else f"{label}, {tolerance:.0e}".replace("e-0", "e-")


class OfKind(FileSchema):
    """What tables show of all models of a kind, see `data/figures/tables.toml`."""

    against: list[Line] = Field(min_length=2, max_length=2)
    cases: list[Case]
    counts: dict[str, Line]


class TablesFile(FileSchema):
    """Schema of `data/figures/tables.toml`."""

    algebraic: OfKind
    dynamic: OfKind
    reduced: dict[str, list[Case]]


@cache
def tables_file() -> TablesFile:
    """The package's own file, read once."""
    return read_toml(data_folder() / "figures" / "tables.toml", TablesFile)


def of_kind(kind: str) -> OfKind:
    """What tables show of all models of a kind: `ae`, `ode` or `dae`."""
    return tables_file().algebraic if kind == "ae" else tables_file().dynamic


def default_rank(coordinates: int) -> int:
    """Rank of the reduced models in the default rows: 3, but less than the coordinates."""
    return max(1, min(LARGEST_DEFAULT_RANK, coordinates - 1))


def timing_cases(definition: ModelDefinition) -> list[Case]:
    """Rows of a model's cost table: full-order solvers, replay, reduced models."""
    settings: Settings = {"rank": default_rank(len(definition.coordinates))}
    reduced = tables_file().reduced.get(definition.name) or [
        Case.model_validate({"method": method, "preset": preset, "settings": settings})
        for method, preset in REDUCED
    ]
    return [case.named() for case in (*of_kind(definition.kind).cases, *reduced)]


def tabled_outputs(definition: ModelDefinition) -> tuple[str, ...]:
    """Outputs whose errors are tabled: those that the model declares, or all."""
    return definition.tabled_outputs or tuple(output.name for output in definition.outputs)


def main_outputs(definition: ModelDefinition) -> tuple[str, ...]:
    """Outputs that are printed and drawn: those that the model declares, or the first three."""
    return definition.main_outputs or tabled_outputs(definition)[:MOST_PRINTED]
