"""What the integrators see of a system: the full state, or its projection on a subspace.

Each formulation gives `rhs`, `lift`, `project` and `error_norm`, compiled with the one time loop.
"""
