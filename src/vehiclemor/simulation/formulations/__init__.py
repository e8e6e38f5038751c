"""Equations as integrators see them: of the full state, or projected on a subspace."""
