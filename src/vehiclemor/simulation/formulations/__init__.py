"""Equations as integrators see them: of the full state, or projected on a subspace.

Each formulation gives `rhs`, `reconstruct`, `project` and `error_norm`, see
`integrators/contract.py`; they are compiled with the one time loop.
"""
