"""Structures ready to run: sparse matrices, their factors, the time loop, the model."""
