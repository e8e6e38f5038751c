"""Why a model can't be reduced as a vehicle; empty where it can."""

from vehiclemor.simulation.model import Model

# Outputs in which the slow manifold has its nonlinear terms.
SLIP_OUTPUTS = ("roll", *(f"slip_angle_{wheel}" for wheel in ("FL", "FR", "RL", "RR")))


def no_vehicle(model: Model) -> str:
    """Why a model does not move on a road."""
    if len(getattr(model, "planar", ())) == 3:
        return ""
    return f"{model.name} is no vehicle with a place and a heading on the road"


def no_steered_vehicle(model: Model) -> str:
    """Why a model is no vehicle whose inputs are the steering and its derivatives."""
    if reason := no_vehicle(model) or lacking(model, SLIP_OUTPUTS):
        return reason
    first, *others = model.inputs
    if others != [f"{first}_dot", f"{first}_ddot"][: len(others)]:
        return f"the inputs of {model.name} are not a steering and its derivatives"
    return ""


def lacking(model: Model, outputs: tuple[str, ...]) -> str:
    """Which of these outputs a model does not have."""
    missing = [name for name in outputs if name not in model.outputs]
    return f"{model.name} has no output {', '.join(missing)}" if missing else ""
