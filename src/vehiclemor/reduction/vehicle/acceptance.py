"""Which models are vehicles, with what the methods for vehicles need."""

from vehiclemor.simulation.model import Model

# Outputs in which the slow manifold has its nonlinear terms.
SLIP_OUTPUTS = ("roll", *(f"slip_angle_{wheel}" for wheel in ("FL", "FR", "RL", "RR")))


def is_vehicle(model: Model) -> tuple[bool, str]:
    """Whether a model moves on a road, and why not."""
    if len(getattr(model, "planar", ())) == 3:
        return True, ""
    return False, f"{model.name} is no vehicle with a place and a heading on the road"


def is_steered_vehicle(model: Model) -> tuple[bool, str]:
    """Whether a model is a vehicle whose inputs are the steering and its derivatives."""
    accepted, reason = is_vehicle(model)
    if not accepted:
        return accepted, reason
    missing = [name for name in SLIP_OUTPUTS if name not in model.outputs]
    if missing:
        return False, f"{model.name} has no output {missing[0]}"
    first, *others = model.inputs
    if others != [f"{first}_dot", f"{first}_ddot"][: len(others)]:
        return False, f"the inputs of {model.name} are not a steering and its derivatives"
    return True, ""
