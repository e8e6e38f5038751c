"""Keys of a size study, which times full and reduced runs over meshes; see `plans/size.py`."""

from typing import Annotated

from pydantic import Field

from vehiclemor.toml_files import FileSchema


class Size(FileSchema):
    """Meshes of a structure, over which full and reduced runs are timed; see `plans/size.py`."""

    meshes: list[Annotated[dict[str, float], Field(min_length=1)]] = Field(
        min_length=1, description="parameters of each mesh, the finest last: what is refined first"
    )
    frequency: float = Field(1.0, gt=0.0, description="factor of the maneuver")
    amplitude: float = Field(1.0, description="factor of the maneuver")
    step: float = Field(1e-3, ge=1e-6, le=0.1, description="s, the same of all runs")
    whole: int = Field(1000, description="coordinates up to which full order is timed over the run")
    window: float = Field(1.0, ge=0.1, description="s of the run, over which it is timed beyond")
    up_to: dict[str, int] = Field(
        default_factory=dict,
        description="label -> coordinates of the largest mesh that it is made of",
    )
    beside: list[str] = Field(
        default_factory=list, description="models whose shipped reduced models are timed beside"
    )
