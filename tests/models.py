"""Names of the models that the package has."""

WISHBONE = "double_wishbone"
CAR = "independent_suspension_vehicle"
FIDELITY = "high_fidelity_vehicle"
TRUCK = "flexible_truck"
VEHICLES = (CAR, FIDELITY)
# The models of the paper.
MODELS = (WISHBONE, *VEHICLES)
