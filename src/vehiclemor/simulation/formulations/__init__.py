"""Equations as integrators see them: of the full state, or projected on a subspace.

Each formulation gives `rhs`, `reconstruct`, `project` and `error_norm`, compiled with the one time
loop.
"""

# Formulation -> kernels that it calls; a kernel of whole steps may come besides.
FORMULATIONS = {
    "full": ("derivative",),
    "state": ("derivative",),
    "coordinates": ("derivative", "second_order", "speeds"),
}
