"""Subspaces by time window and in them the equations of a model."""
