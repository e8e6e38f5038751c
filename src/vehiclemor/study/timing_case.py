"""What is timed of a model: a method with settings, run on the nominal maneuver."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from vehiclemor.reduction.settings import Value


@dataclass(frozen=True)
class TimingCase:
    """One row of a cost table.

    Attributes
    ----------
    id
        By which the row is known; `baseline` is the paper's kind of full-order run and `strongest`
        the best full-order solver, for every model.
    label
        As it is printed.
    method, preset, settings
        Registered name, one of its presets, and settings that differ from that.
    """

    id: str
    label: str
    method: str
    preset: str = "recommended"
    settings: Mapping[str, Value] = field(default_factory=dict)
