"""Symbolic layer: a single-assignment tape over SymPy scalars and vector geometry on it."""
