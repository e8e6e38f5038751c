"""Coefficients of the tire models, by the names of their parameters."""

# Coefficients that the Magic Formula below needs; all are dimensionless.
MAGIC_FORMULA = (
    *("PCX1", "PDX1", "PDX2", "PEX1", "PEX2", "PEX3", "PKX1", "PKX2", "PKX3"),
    *("PCY1", "PDY1", "PDY2", "PEY1", "PEY2", "PKY1", "PKY2"),
    *("QBZ1", "QBZ2", "QBZ3", "QCZ1", "QDZ1", "QDZ2", "QEZ1", "QEZ2", "QEZ3"),
    *("RBX1", "RBX2", "RCX1", "REX1", "RBY1", "RBY2", "RCY1", "REY1"),
)
# Coefficients that the Fiala model needs.
FIALA = (
    "longitudinal_slip_stiffness",
    "cornering_stiffness",
    "largest_friction",
    "smallest_friction",
    "tire_width",
)
