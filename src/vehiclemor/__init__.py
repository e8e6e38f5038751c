"""vehiclemor: benchmark suite for model order reduction of multibody vehicle models.

The names below are all that a user needs; each is imported when it is first used, so that
`import vehiclemor` costs next to nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vehiclemor.api import describe as describe
    from vehiclemor.api import maneuvers as maneuvers
    from vehiclemor.api import methods as methods
    from vehiclemor.api import model as model
    from vehiclemor.api import models as models
    from vehiclemor.api import plot as plot
    from vehiclemor.api import reduce as reduce
    from vehiclemor.api import run_study as run_study
    from vehiclemor.api import simulate as simulate
    from vehiclemor.api import status as status
    from vehiclemor.api import studies as studies
    from vehiclemor.exceptions import VehiclemorError as VehiclemorError
    from vehiclemor.exporting.export import export as export
    from vehiclemor.inputs.maneuver import maneuver as maneuver
    from vehiclemor.inputs.road import road as road
    from vehiclemor.inputs.signal import Signal as Signal
    from vehiclemor.inputs.signal import many_signals as many_signals
    from vehiclemor.metrics import errors as errors
    from vehiclemor.metrics import weighted_rms as weighted_rms
    from vehiclemor.reduction.reduced_model import load as load
    from vehiclemor.reduction.reduced_model import rom as rom
    from vehiclemor.report.comparison import compare as compare
    from vehiclemor.report.figures.animation import animate as animate
    from vehiclemor.report.figures.catalogue import figures as figures
    from vehiclemor.report.page import write_report as write_report
    from vehiclemor.report.study_formats import convert as convert
    from vehiclemor.simulation.batches import simulate_many as simulate_many
    from vehiclemor.study.dataset import dataset as dataset
    from vehiclemor.study.judge import judge as judge

__version__ = "1.0.0"
__all__ = [
    "Signal",
    "VehiclemorError",
    "animate",
    "compare",
    "convert",
    "dataset",
    "describe",
    "errors",
    "export",
    "figures",
    "judge",
    "load",
    "maneuver",
    "maneuvers",
    "many_signals",
    "methods",
    "model",
    "models",
    "plot",
    "reduce",
    "road",
    "rom",
    "run_study",
    "simulate",
    "simulate_many",
    "status",
    "studies",
    "weighted_rms",
    "write_report",
]
# Name -> module that defines it.
_DEFINED_IN = {
    **dict.fromkeys(__all__, "vehiclemor.api"),
    **dict.fromkeys(("Signal", "many_signals"), "vehiclemor.inputs.signal"),
    **dict.fromkeys(("load", "rom"), "vehiclemor.reduction.reduced_model"),
    "VehiclemorError": "vehiclemor.exceptions",
    "animate": "vehiclemor.report.figures.animation",
    "compare": "vehiclemor.report.comparison",
    "convert": "vehiclemor.report.study_formats",
    "dataset": "vehiclemor.study.dataset",
    "errors": "vehiclemor.metrics",
    "export": "vehiclemor.exporting.export",
    "figures": "vehiclemor.report.figures.catalogue",
    "judge": "vehiclemor.study.judge",
    "maneuver": "vehiclemor.inputs.maneuver",
    "road": "vehiclemor.inputs.road",
    "simulate_many": "vehiclemor.simulation.batches",
    "weighted_rms": "vehiclemor.metrics",
    "write_report": "vehiclemor.report.page",
}


def __getattr__(name: str) -> Any:
    if name not in _DEFINED_IN:
        raise AttributeError(f"module 'vehiclemor' has no attribute {name!r}")
    return getattr(import_module(_DEFINED_IN[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
